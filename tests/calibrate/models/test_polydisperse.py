"""The tube of several sizes as a forward model: limits, thresholds, layers, a fit."""

from collections import OrderedDict
from dataclasses import replace
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.experiment.sample import Measurement, Point, Sample
from calibrate.experiment.suspension import refuse_unknown, suspension
from calibrate.models import polydisperse
from calibrate.models.column import column
from calibrate.models.forward_models import FORWARD_MODELS, cheap_model
from calibrate.models.quick_column import quick_column

HEIGHT, BED, CELLS = 0.3, 0.5, 60
near = partial(pytest.approx, abs=0.0)


@pytest.fixture(autouse=True)
def few_cells(monkeypatch):
    monkeypatch.setattr(polydisperse, "CELLS", CELLS)
    monkeypatch.setattr(polydisperse, "CLASSES", 4)


def powder(diameter):
    return mrjax.Recipe(
        name="powder",
        particle={"density": 2700.0, "diameter": diameter},
        fluid={"density": 998.0, "viscosity": 1e-3},
        composition={"volume_fraction": 0.15},
        drag={"f_w": {"closure": "richardson-zaki", "exponent": 4.65}, "local": True},
    )


EQUAL, SPREAD = (
    powder(4e-6),
    powder({"median": 4e-6, "geometric_standard_deviation": 1.4, "by": "volume"}),
)
FINAL = Measurement("final_ratio", 0.3, 0.01, "1", 1.0)
FALL = HEIGHT / float(mrjax.terminal_velocity(EQUAL.parameters()))


def sample(recipe, **changes):
    times = tuple(FALL * np.linspace(0.1, 1.5, 8))
    return replace(Sample("A", recipe, HEIGHT, BED, (), times=times), **changes)


def predicted(recipe, changes=None, model=column, **of_sample):
    predict = model(sample(recipe, **of_sample), suspension(recipe, BED, {}))
    return predict(suspension(recipe, BED, changes or {}))


def test_equal_sizes_are_the_column():
    """Mudline and layers are within a cell, and the initial velocity is Eq. 27."""
    points = tuple(
        Point(height * HEIGHT, time * FALL, 0.1 * HEIGHT, place, "t", "m", "s")
        for place, (height, time) in enumerate([(0.1, 0.3), (0.8, 0.1), (0.9, 0.4), (0.1, 2.0)])
    )
    velocity = Measurement("initial_velocity", 1.0, 1.0, "m/s", 1.0)
    options = dict(points=points, fractions=(0.05, 0.1), measurements=(velocity,))
    exact = predicted(EQUAL, **options)
    close = predicted(powder([4e-6, 4.0001e-6]), **options)
    assert np.abs(close["mudline"] - exact["mudline"]).max() < HEIGHT / CELLS
    assert np.abs(close["concentrations"] - exact["concentrations"]).max() < 0.01
    assert close["initial_velocity"] == near(float(exact["initial_velocity"]), rel=0.02)
    velocities = np.asarray(exact["initial_velocities"])
    assert np.asarray(close["initial_velocities"]) == near(velocities, rel=0.02)
    assert close["final_ratio"] == near(float(exact["final_ratio"]), rel=1e-12)


def test_a_delay_holds_the_mudline_and_not_the_initial_velocity():
    """As for equal sizes, whose initial velocity is that of dispersed particles."""
    velocity = Measurement("initial_velocity", 1.0, 1.0, "m/s", 1.0)
    at_once, late = (
        predicted(
            powder([4e-6, 5e-6]), {"delay": delay} if delay else None, measurements=(velocity,)
        )
        for delay in (None, FALL)
    )
    assert late["initial_velocity"] == near(float(at_once["initial_velocity"]), rel=1e-12)
    assert np.all(late["mudline"][:4] > at_once["mudline"][:4] + HEIGHT / CELLS)


def test_the_mudline_is_that_of_the_threshold():
    half, hundredth = (
        predicted(SPREAD, mudline_threshold=share)["mudline"] for share in (0.5, 0.01)
    )
    assert np.all(hundredth[:4] > half[:4] + HEIGHT / CELLS)
    assert float(hundredth[-1]) == near(float(half[-1]), rel=1e-3)


@pytest.mark.slow
def test_a_fit_of_several_sizes_finds_the_values_of_a_synthetic_mudline():
    truth = {"f_w.exponent": 5.5, "viscosity": 1.1e-3, "bed_fraction": 0.55}
    predict = column(sample(SPREAD), suspension(SPREAD, BED, {}))
    readings = predict(suspension(SPREAD, BED, truth))["mudline"]

    def residuals(theta):
        return (predict(suspension(SPREAD, BED, theta))["mudline"] - readings) / (1e-3 * HEIGHT)

    start = OrderedDict({"f_w.exponent": 4.65, "viscosity": 1e-3, "bed_fraction": BED})
    fitted = calibrate.fit(residuals, start)
    assert fitted.converged
    assert dict(fitted.theta) == pytest.approx(truth, rel=1e-4)


def test_searches_take_the_size_of_the_mean_velocity():
    assert cheap_model(column, costly=True) is quick_column
    assert cheap_model(column) is column
    diameter = SPREAD.particle.diameter.settling_diameter
    cheap = predicted(SPREAD, model=quick_column)["mudline"]
    exact = predicted(powder(diameter))["mudline"]
    assert np.asarray(cheap) == near(np.asarray(exact), rel=1e-12)
    assert jnp.all(predicted(EQUAL, model=quick_column)["mudline"] == predicted(EQUAL)["mudline"])


def test_a_fitted_spread_is_that_of_a_recipe():
    """Ten classes of a spread about one diameter are those of the recipe that states it."""
    changes = {"geometric_standard_deviation": 1.4}
    fitted = column(sample(EQUAL), suspension(EQUAL, BED, changes))(suspension(EQUAL, BED, changes))
    stated = predicted(SPREAD)
    for name in ("mudline", "initial_velocity"):
        assert np.asarray(fitted[name]) == near(np.asarray(stated[name]), rel=1e-12)


@pytest.mark.parametrize("model", ["closed-form", "particles"])
def test_a_spread_is_refused_by_models_that_take_the_sizes_of_the_recipe(model):
    with pytest.raises(mrjax.InputError, match="takes the sizes of the recipe; fit with column"):
        FORWARD_MODELS[model](
            sample(EQUAL),
            suspension(EQUAL, BED, {"geometric_standard_deviation": 1.4}),
            0,
            (),
            None,
        )


def test_a_spread_of_a_recipe_of_several_sizes_is_refused():
    with pytest.raises(mrjax.InputError, match="give \\[particle\\] one diameter"):
        refuse_unknown("geometric_standard_deviation", SPREAD, SPREAD.parameters())


def test_a_bed_that_is_not_known_is_refused():
    with pytest.raises(mrjax.InputError, match="the volume fraction of its bed is not known"):
        column(
            sample(SPREAD, bed_fraction=None, measurements=(FINAL,)), suspension(SPREAD, None, {})
        )
