"""Fits and predictions of samples whose carrier has a yield stress."""

from collections import OrderedDict

import jax
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.experiment import plausibility
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import refuse_unknown, suspension
from calibrate.models.closed_form import closed_form
from calibrate.models.column import column
from mrjax.laws import yield_stress

HEIGHT, BED = 0.3, 0.55


def iron(local, **fluid):
    return mrjax.Recipe(
        name="iron in a thickened oil",
        particle={"density": 7470.0, "diameter": 10e-6},
        fluid={"density": 950.0, "viscosity": 0.05, **fluid},
        composition={"volume_fraction": 0.2},
        drag={"f_w": "brzinski-durian", "local": local},
    )


def sampled(recipe, shares):
    """A sample read at shares of the time in which its particles fall in a fresh carrier."""
    alone = recipe.parameters().replace(yield_stress=0.0, yield_growth=0.0)
    fall = HEIGHT / float(mrjax.terminal_velocity(alone))
    return Sample("A", recipe, HEIGHT, BED, (), times=tuple(fall * np.asarray(shares)))


@pytest.mark.parametrize("make, local", [(column, True), (closed_form, False)])
def test_a_fit_finds_the_yield_stress_of_a_synthetic_mudline(make, local):
    recipe = iron(local, yield_stress=3e-3)
    sample = sampled(recipe, np.linspace(0.2, 2.0, 12))
    predict = make(sample, suspension(recipe, BED, {}))
    truth = OrderedDict(yield_stress=9e-3)

    def mudline(theta):
        return predict(suspension(recipe, BED, theta))["mudline"]

    readings = mudline(truth)
    assert HEIGHT * 0.2 / BED < readings[-1] < 0.8 * HEIGHT
    fitted = calibrate.fit(
        lambda theta: (mudline(theta) - readings) / (1e-3 * HEIGHT), OrderedDict(yield_stress=3e-3)
    )
    assert fitted.converged and fitted.theta["yield_stress"] == pytest.approx(9e-3, rel=1e-6)


@pytest.mark.parametrize("make, local", [(column, True), (closed_form, False)])
def test_a_suspension_that_is_held_keeps_its_height(make, local):
    recipe = iron(local, yield_stress=0.1)
    sample = sampled(recipe, [0.1, 10.0])
    start = suspension(recipe, BED, {})
    predict = make(sample, start)
    held = predict(start)
    np.testing.assert_allclose(held["mudline"], HEIGHT, rtol=1e-12)
    assert held["initial_velocity"] == 0.0 and held["final_ratio"] == 1.0
    slope = jax.grad(lambda x: predict(suspension(recipe, BED, {"yield_stress": x}))["mudline"][1])
    assert slope(0.1) == 0.0


@pytest.mark.parametrize("make, local", [(column, True), (closed_form, False)])
def test_an_ageing_carrier_stops_the_mudline_in_both_models(make, local):
    """It stops after 3 times the fall in a fresh carrier, at 30.5 mPa."""
    fall = sampled(iron(local), [1.0]).times[0]
    recipe = iron(local, yield_stress=5e-3, yield_growth=25.5e-3 / (3 * fall))
    sample = sampled(recipe, [0.1, 50.0, 100.0])
    start = suspension(recipe, BED, {})
    predicted = make(sample, start)(start)
    effective = yield_stress.effective_times(start.parameters, np.array(sample.times))
    exact = HEIGHT - float(predicted["initial_velocity"]) * np.asarray(effective)
    np.testing.assert_allclose(predicted["mudline"], exact, rtol=1e-9)
    assert exact[0] > exact[1] == exact[2] > 0.5 * HEIGHT
    assert predicted["final_ratio"] == pytest.approx(exact[2] / HEIGHT, rel=1e-9)


def test_a_yield_stress_that_the_recipe_does_not_state_is_refused():
    recipe = iron(False)
    with pytest.raises(mrjax.InputError, match=r"has no yield_stress; state it in \[fluid\]"):
        refuse_unknown("yield_stress", recipe, recipe.parameters())
    refuse_unknown(
        "yield_growth", iron(False, yield_growth=0.0), iron(False, yield_growth=0.0).parameters()
    )


def test_a_fit_that_begins_where_nothing_moves_is_warned_of():
    held = iron(False, yield_stress=0.1)
    sample = sampled(held, [0.1])
    warned = list(plausibility.oddities([sample], [suspension(held, BED, {})]))
    assert len(warned) == 1 and "a yield stress of 0.1 Pa holds all particles" in warned[0]
    assert "move below 0.0305 Pa" in warned[0]
