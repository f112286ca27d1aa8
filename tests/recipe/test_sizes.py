"""Size distributions: numbers, volumes and moments; and what a recipe makes of them."""

from functools import partial

import jax
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import lognorm

import mrjax
from mrjax.laws import particle
from mrjax.recipe import sizes
from mrjax.recipe.size_classes import log_normal_classes

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12

SPREAD = 1.4


def by_volume(diameters, upto):
    """Fraction of the volume in particles not larger than a diameter."""
    return float((diameters[diameters <= upto] ** 3).sum() / (diameters**3).sum())


def test_a_list_is_equally_many_of_each():
    found = sizes.Classes((3e-6, 1e-6, 2e-6)).sample(300)
    values, counts = np.unique(found, return_counts=True)
    assert values.tolist() == [1e-6, 2e-6, 3e-6] and counts.tolist() == [100, 100, 100]
    assert sizes.Classes((3e-6, 1e-6, 2e-6)).mean_cube == near(36e-18 / 3)


def test_classes_by_number_and_by_volume():
    classes = sizes.Classes((1e-6, 2e-6), (3.0, 1.0))
    assert np.unique(classes.sample(400), return_counts=True)[1].tolist() == [300, 100]
    # Equal volumes: eight small ones for each of twice their diameter.
    classes = sizes.Classes((1e-6, 2e-6), (0.5, 0.5), by="volume")
    assert np.unique(classes.sample(900), return_counts=True)[1].tolist() == [800, 100]
    assert by_volume(classes.sample(900), 1.5e-6) == near(0.5)
    assert classes.mean_cube == near((8 + 8) / 9 * 1e-18)


@pytest.mark.parametrize("by", ["number", "volume"])
def test_log_normal(by):
    distribution = sizes.LogNormal(4e-6, SPREAD, by)
    found = distribution.sample(100_001)
    assert (np.diff(found) > 0).all()
    reached = (found <= 4e-6).mean() if by == "number" else by_volume(found, 4e-6)
    # The tails beyond the last quantile hold some 1e-4 of the volume.
    assert reached == pytest.approx(0.5, abs=2e-4)
    assert np.log(found).std() == near(np.log(SPREAD), rel=1e-4)
    density = lognorm(np.log(SPREAD), scale=1e6 * distribution.number_median).pdf
    cube, _ = quad(lambda d: d**3 * density(d), 0, 60)  # in um; 60 is eight spreads away
    cube *= 1e-18
    assert distribution.mean_cube == near(cube)
    assert np.mean(found**3) == near(cube, rel=1e-3)


@pytest.mark.parametrize("by", ["number", "volume"])
def test_classes_of_equal_volume(by, case3):
    """Each class settles with the mean of d^2 by volume between its quantiles."""
    median, sigma = 3e-6, np.log(SPREAD)
    table = {"median": median, "geometric_standard_deviation": SPREAD, "by": by}
    recipe = case3.replace(particle={"diameter": table})
    classes = recipe.size_classes(4)
    volume = lognorm(sigma, scale=median * np.exp(3 * sigma**2 * (by == "number")))
    for number, diameter in enumerate(classes.diameters):
        inner = volume.ppf(np.array([number, number + 1]) / 4)
        square, _ = quad(lambda d: d**2 * 1e12 * volume.pdf(d), *np.clip(inner, 1e-8, 1e-4))
        assert diameter == near(1e-6 * np.sqrt(4 * square), rel=2e-3)
    assert np.asarray(classes.parameters.radius) == near(classes.diameters / 2)
    assert np.asarray(classes.volume_fraction) == near(
        np.full(4, recipe.coated_volume_fraction / 4)
    )


def test_classes_of_percentiles_and_of_lists(case3):
    percentiles = case3.replace(particle={"diameter": {"d10": 2e-6, "d50": 3e-6, "d90": 4e-6}})
    classes = percentiles.size_classes(20)
    mean_square = np.mean(classes.diameters**2)
    assert np.sqrt(mean_square) == near(percentiles.particle.diameter.settling_diameter)
    stated = {"values": [4e-6, 2e-6], "fractions": [0.25, 0.75], "by": "volume"}
    listed = case3.replace(particle={"diameter": stated}).size_classes()
    assert listed.diameters == near(np.array([2e-6, 4e-6]))
    share = np.asarray(listed.volume_fraction) / case3.coated_volume_fraction
    assert share == near(np.array([0.75, 0.25]))
    assert case3.size_classes(7).volume_fraction.shape == (1,)


@pytest.mark.parametrize(
    "table",
    [
        [3e-6, 4e-6, 5e-6],
        {"values": [2e-6, 4e-6], "fractions": [1, 1], "by": "volume"},
        {"median": 4e-6, "geometric_standard_deviation": 1.25, "by": "volume"},
    ],
)
def test_a_recipe_of_many_sizes(table, case3):
    """N holds the volume fraction, to one particle; every law reads the radius of each."""
    sheet = case3.model_dump()
    sheet["particle"]["diameter"] = table
    sheet["box"] = case3.box
    recipe = mrjax.Recipe(**sheet)
    parameters, diameters = recipe.parameters(), recipe.diameters
    assert parameters.radius.shape == diameters.shape == (recipe.particle_count,)
    volume = np.pi / 6 * (diameters**3).sum()
    wanted = recipe.volume_fraction * recipe.box.volume
    assert abs(volume - wanted) <= np.pi / 6 * diameters.max() ** 3
    np.testing.assert_array_equal(diameters, 2 * parameters.radius)
    expected = 2 / 9 * (5811.3 - 950) * 9.81 * (1.1 * diameters / 2) ** 2
    expected /= 0.01 * recipe.f_w * recipe.f_s * recipe.drag.f_v
    # The apparent density of the coated particle is given to five digits.
    np.testing.assert_allclose(mrjax.terminal_velocity(parameters), expected, rtol=2e-5)


def test_particles_of_many_sizes_settle_each_at_its_own_velocity(case2):
    sheet = case2.model_dump()
    sheet["particle"]["diameter"] = {"median": 3.5e-6, "geometric_standard_deviation": 1.2}
    sheet["box"] = mrjax.Box((15e-6, 15e-6, 15e-6))
    recipe = mrjax.Recipe(**sheet)
    parameters, state = recipe.parameters(), mrjax.disperse(recipe, seed=4)
    gap = np.linalg.norm(state.position[:, None] - state.position[None], axis=-1)
    gap -= parameters.radius[:, None] + parameters.radius[None]
    assert gap[~np.eye(len(gap), dtype=bool)].min() > 0
    assert (np.asarray(state.position) >= parameters.radius[:, None]).all()
    run = mrjax.simulate(state, parameters, recipe.box, duration=2e-6, time_step=2e-8)
    alone = mrjax.terminal_velocity(parameters)
    # Twenty relaxation times of the largest.
    np.testing.assert_allclose(-run.state.velocity[:, 2], alone, rtol=1e-6)
    assert mrjax.settling_velocity(run) == near(float(alone.mean()))


def test_the_typical_diameter_is_of_the_mean_volume():
    assert particle.typical_diameter(np.array([1.0, 1.0, 2.0])) == near(2 * (10 / 3) ** (1 / 3))
    assert particle.typical_diameter(np.array(3.0)) == near(6.0)


WRONG = {
    "text": ("small", ["particle.diameter.values = 'small'", "list of diameters in m"]),
    "empty list": ([], ["particle.diameter.values = []"]),
    "a negative one": ([1e-6, -2e-6], ["values = [1e-06, -2e-06]", "above zero"]),
    "a flag": (True, ["particle.diameter.values = True"]),
    "no values": ({"fractions": [1.0]}, ["particle.diameter.values is missing"]),
    "no spread": ({"median": 4e-6}, ["geometric_standard_deviation is missing"]),
    "spread of one": (
        {"median": 4e-6, "geometric_standard_deviation": 1.0},
        ["geometric_standard_deviation = 1.0", "above 1", "give the diameter alone"],
    ),
    "spread in per cent": (
        {"median": 4e-6, "geometric_standard_deviation": 30.0},
        ["geometric_standard_deviation = 30.0", "at most 3"],
    ),
    "misspelt": (
        {"median": 4e-6, "geometric_standard_deviation": 1.2, "basis": "volume"},
        ["basis = 'volume': unknown key", "known: median"],
    ),
    "by mass": ({"values": [1e-6], "by": "mass"}, ["by = 'mass'", '"number" or "volume"']),
    "too few fractions": (
        {"values": [1e-6, 2e-6], "fractions": [1.0]},
        ["1 for 2 values", "give one for each"],
    ),
    "in micrometres": ([3.0, 4.0], ["too large for a suspension", "4 um is 4e-6"]),
}


@pytest.mark.parametrize("diameter, words", WRONG.values(), ids=WRONG)
def test_wrong_sizes_get_one_line(diameter, words, case2, tmp_path):
    sheet = case2.model_dump()
    sheet["particle"]["diameter"] = diameter
    with pytest.raises(mrjax.InputError) as refusal:
        mrjax.recipe.sheets.validated(mrjax.Recipe, {**sheet, "box": case2.box}, "mine.toml")
    message = str(refusal.value)
    assert message.startswith("mine.toml: ") and "\n" not in message
    assert all(word in message for word in words), message


def test_classes_of_a_fitted_spread_have_exact_derivatives():
    slope = jax.jacfwd(lambda spread: log_normal_classes(spread, 5))(1.5)
    step = 1e-6
    above, below = log_normal_classes(1.5 + step, 5), log_normal_classes(1.5 - step, 5)
    np.testing.assert_allclose(slope, (above - below) / (2.0 * step), rtol=1e-8)
    np.testing.assert_array_equal(log_normal_classes(1.0, 5), np.ones(5))
