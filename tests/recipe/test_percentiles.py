"""Sizes by three percentiles: shares of the volume, moments, and the mean that settles alike."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import quad

import mrjax
from mrjax.recipe import sizes
from mrjax.recipe.percentiles import Percentiles

near = partial(pytest.approx, rel=1e-9, abs=0.0)  # its own abs passes all within 1e-12

POWDER = Percentiles(2e-6, 5e-6, 9e-6)
LEAST, LARGEST = 2e-6 * 0.4**0.25, 9e-6 * 1.8**0.25
NODES = [LEAST, 2e-6, 5e-6, 9e-6, LARGEST]
SHARES = [0.1, 0.4, 0.4, 0.1]


def mean_by_volume(law):
    """Mean over the volume, which is spread evenly in ln d between the nodes."""
    return sum(
        share * quad(lambda log: law(np.exp(log)), np.log(lower), np.log(upper))[0]
        / np.log(upper / lower)
        for share, lower, upper in zip(SHARES, NODES, NODES[1:], strict=False)
    )  # fmt: skip


@pytest.mark.parametrize(
    "upto, share",
    [(2e-6, 0.1), (5e-6, 0.5), (9e-6, 0.9), (np.sqrt(2e-6 * 5e-6), 0.3), (LARGEST, 1.0)],
)
def test_shares_of_the_volume_are_linear_in_the_logarithm(upto, share):
    diameters = POWDER.sample(200_001)
    assert (np.diff(diameters) > 0.0).all()
    assert diameters[0] > LEAST and diameters[-1] < LARGEST
    found = (diameters[diameters <= upto] ** 3).sum() / (diameters**3).sum()
    # A particle is 1e-5 of the volume at the upper end.
    assert found == pytest.approx(share, abs=2e-4)


def test_the_tails_go_on_with_the_slope_beside_them():
    """A tenth of the volume takes a quarter of the way, in ln d, of the four tenths beside it."""
    diameters = POWDER.sample(100_001)
    assert np.log(2e-6 / diameters[0]) == pytest.approx(np.log(5.0 / 2.0) / 4.0, rel=1e-4)
    assert np.log(diameters[-1] / 9e-6) == pytest.approx(np.log(9.0 / 5.0) / 4.0, rel=5e-3)


def test_moments_are_integrals_over_the_volume():
    assert POWDER.mean_cube == near(1.0 / mean_by_volume(lambda d: d**-3.0))
    assert POWDER.settling_diameter == near(np.sqrt(mean_by_volume(lambda d: d**2)))
    assert np.mean(POWDER.sample(100_001) ** 3) == pytest.approx(POWDER.mean_cube, rel=1e-3)


@pytest.mark.parametrize(
    "distribution, settles_as",
    [
        # (5e-6^5 + 3e-6^5) / (5e-6^3 + 3e-6^3), root.
        (sizes.Classes((3e-6, 5e-6)), np.sqrt((5.0**5 + 3.0**5) / (5.0**3 + 3.0**3)) * 1e-6),
        (sizes.Classes((3e-6, 5e-6), (0.75, 0.25), "volume"), np.sqrt(0.75 * 9 + 0.25 * 25) * 1e-6),
        # Of a log-normal distribution, the volume median times exp(ln^2 s).
        (sizes.LogNormal(2e-5, 1.5, "volume"), 2e-5 * np.exp(np.log(1.5) ** 2)),
        (sizes.LogNormal(2e-5, 1.5), 2e-5 * np.exp(4.0 * np.log(1.5) ** 2)),
        (POWDER, np.sqrt(mean_by_volume(lambda d: d**2))),
    ],
)
def test_one_size_settles_like_the_mean_of_all_by_mass(distribution, settles_as, case2):
    """Stokes' velocities of a million particles, each counted by its mass."""
    assert distribution.settling_diameter == near(settles_as)
    diameters = distribution.sample(1_000_000)
    one = case2.parameters()
    velocity = np.asarray(mrjax.terminal_velocity(one.replace(radius=diameters / 2)))
    mean = (velocity * diameters**3).sum() / (diameters**3).sum()
    alone = mrjax.terminal_velocity(one.replace(radius=distribution.settling_diameter / 2))
    # The million leave out what is beyond their last quantile.
    assert float(alone) == pytest.approx(mean, rel=1e-3)


def test_a_sheet_has_percentiles(case2):
    recipe = case2.replace(particle={"diameter": {"d10": 2e-6, "d50": 3e-6, "d90": 5e-6}})
    assert recipe.particle.diameter == Percentiles(2e-6, 3e-6, 5e-6)
    diameters = recipe.diameters
    assert recipe.parameters().radius.shape == diameters.shape == (recipe.particle_count,)
    wanted = recipe.volume_fraction * recipe.box.volume
    assert np.pi / 6 * (diameters**3).sum() == pytest.approx(wanted, rel=0.02)


WRONG = {
    "one is missing": ({"d10": 2e-6, "d90": 9e-6}, "d50 is missing; give values, or median and"),
    "alone": ({"d50": 5e-6}, "d10 is missing"),
    "descending": (
        {"d10": 9e-6, "d50": 5e-6, "d90": 2e-6},
        "d10, d50, d90 = 9e-06, 5e-06, 2e-06: must ascend; without spread, give the diameter alone",
    ),
    "equal": ({"d10": 5e-6, "d50": 5e-6, "d90": 9e-6}, "d10, d50, d90 = 5e-06, 5e-06"),
    "negative": ({"d10": -2e-6, "d50": 5e-6, "d90": 9e-6}, "d10 = -2e-06: must be a diameter in m"),
    "text": ({"d10": 2e-6, "d50": "5um", "d90": 9e-6}, "d50 = '5um': must be a diameter in m"),
    "in another unit": ({"d10": 2e-6, "d50": 5e-6, "d90": 9.0}, "d90 = 9: more than 1000 times"),
    "smaller than atoms": ({"d10": 2e-12, "d50": 5e-12, "d90": 9e-12}, "d10 = 2e-12: smaller than"),
    "by number": (
        {"d10": 2e-6, "d50": 5e-6, "d90": 9e-6, "by": "number"},
        "by = 'number': unknown key; known: d10, d50, d90",
    ),
    "in micrometres": ({"d10": 2.0, "d50": 5.0, "d90": 9.0}, None),
}


@pytest.mark.parametrize("diameter, says", WRONG.values(), ids=WRONG)
def test_wrong_percentiles_get_one_line(diameter, says, case2):
    with pytest.raises(mrjax.InputError) as refusal:
        case2.replace(particle={"diameter": diameter})
    message = str(refusal.value)
    begins = f"particle.diameter.{says}" if says else "particle.diameter = Percentiles(d10=2.0"
    assert message.startswith(begins) and "\n" not in message, message
    assert says or message.endswith("give m: 4 um is 4e-6")
