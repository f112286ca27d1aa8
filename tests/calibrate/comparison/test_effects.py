"""Effects as changes of an experiment: what they add, and what the plain experiment lacks."""

from dataclasses import replace

import numpy as np
import pytest

import mrjax
from calibrate.comparison.effects import (
    DELAY_AT_START,
    EFFECTS,
    FLOCS,
    SIZES,
    YIELDING_BED,
    combine,
    plain,
    refusal,
    with_effects,
)
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Measurement, Sample
from calibrate.problem.problem import Problem

HEIGHT = 0.3


def powder(f_w=("richardson-zaki", {}), diameter=10e-6):
    closure, coefficients = f_w
    return mrjax.Recipe(
        name="powder",
        particle={"density": 2600.0, "diameter": diameter},
        fluid={"density": 998.0, "viscosity": 1e-3},
        composition={"volume_fraction": 0.08},
        drag={"f_w": {"closure": closure, **coefficients}, "local": True},
    )


FALL = HEIGHT / float(mrjax.terminal_velocity(powder().parameters()))


def experiment(recipe=None, parameters=(), **of_sample):
    """A tube with a mudline that falls to a quarter, as in a bed of 0.32."""
    ratios = (1.0, 0.9, 0.7, 0.5, 0.3, 0.25)
    readings = tuple(
        Measurement("mudline", 1e3 * HEIGHT * ratio, 1.0, "mm", 1e-3, place)
        for place, ratio in enumerate(ratios)
    )
    times = tuple(float(time) for time in FALL * np.array([0.0, 0.1, 0.3, 0.5, 0.9, 3.0]))
    sample = Sample("A", recipe or powder(), HEIGHT, None, readings, times=times)
    free = FreeParameter("f_s", "f_s", ("A",), 1.0, 0.5)
    return Experiment("tube", (replace(sample, **of_sample),), (free, *parameters))


def names(of):
    return [parameter.name for parameter in of.parameters]


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_adds_its_values_and_the_model_predicts(effect):
    changed = with_effects(experiment(), [effect])
    added = set(names(changed)) - {"f_s", "bed_fraction"}
    assert added == set(effect.quantities)
    problem = Problem.prepare(changed, "column")
    assert np.isfinite(np.asarray(problem.predict(problem.start))).all()


def test_the_plain_experiment_has_a_rigid_bed_of_the_last_reading():
    bare = plain(experiment())
    (bed,) = (one for one in bare.parameters if one.name == "bed_fraction")
    assert bed.median == pytest.approx(0.08 / 0.25, abs=0.0, rel=1e-12)
    assert names(with_effects(bare, [YIELDING_BED])).count("bed_fraction") == 0


def test_effects_of_the_file_are_taken_from_there():
    """Priors of the file, a stated delay, flocs of a recipe, and sizes of a recipe."""
    own = FreeParameter("delay", "delay", ("A",), 77.0, 0.1)
    assert own not in plain(experiment(parameters=(own,))).parameters
    assert own in with_effects(experiment(parameters=(own,)), [DELAY_AT_START]).parameters

    stated = experiment(tube={"delay": 55.0})
    assert plain(stated).samples[0].tube == {}
    assert with_effects(stated, [DELAY_AT_START]).samples[0].tube == {"delay": 55.0}

    flocs = experiment(powder(("floc-richardson-zaki", {"floc_volume": 3.0, "exponent": 5.0})))
    without, having = (
        one.samples[0].recipe for one in (plain(flocs), with_effects(flocs, [FLOCS]))
    )
    assert without.drag.f_w == {"closure": "richardson-zaki", "exponent": 5.0}
    assert having.drag.f_w == flocs.samples[0].recipe.drag.f_w

    spread = {"median": 10e-6, "geometric_standard_deviation": 1.5}
    sized = experiment(powder(diameter=spread))
    assert isinstance(plain(sized).samples[0].recipe.particle.diameter, float)
    recipe = with_effects(sized, [SIZES]).samples[0].recipe
    assert recipe.particle.diameter == sized.samples[0].recipe.particle.diameter


def test_the_densest_bed_of_a_file_whose_bed_yields_is_no_rigid_bed():
    """The plain model fits a rigid bed of its own; the yielding one is that of the file."""
    stated = experiment(
        tube={
            "compression.gel_fraction": 0.15,
            "compression.stress": 9.0,
            "compression.exponent": 3.0,
        },
        bed_fraction=0.6,
    )
    bare = plain(stated)
    assert bare.samples[0].bed_fraction is None and names(bare) == ["f_s", "bed_fraction"]
    restored = with_effects(stated, [YIELDING_BED])
    assert restored.samples == stated.samples and restored.parameters == stated.parameters

    own = FreeParameter("bed_fraction", "bed_fraction", ("A",), 0.6, 0.1)
    fitted = experiment(parameters=(own,), tube=stated.samples[0].tube)
    assert own not in plain(fitted).parameters
    assert with_effects(fitted, [YIELDING_BED]).parameters == fitted.parameters


def test_a_stated_rigid_bed_does_not_bound_a_yielding_one():
    changed = with_effects(experiment(bed_fraction=0.32), [YIELDING_BED])
    assert changed.samples[0].bed_fraction is None
    assert plain(experiment(bed_fraction=0.32)).samples[0].bed_fraction == 0.32


def test_flocs_begin_where_the_closure_holds_in_the_bed():
    bed = FreeParameter("bed_fraction", "bed_fraction", ("A",), 0.6, 0.1)
    changed = with_effects(experiment(parameters=(bed,)), [FLOCS])
    assert 1.0 < changed.start["f_w.floc_volume"] < 1.0 / 0.6


def test_what_cannot_be_tried_says_why():
    assert combine([FLOCS, SIZES, DELAY_AT_START])
    assert not combine([SIZES, YIELDING_BED])
    assert refusal(experiment(), FLOCS) is None
    assert "has no flocs" in refusal(experiment(powder(("vesilind", {"rate": 20.0}))), FLOCS)
    number = powder().replace(drag={"f_w": 3.0, "local": False})
    assert "is not local" in refusal(experiment(number), FLOCS)
