"""Closures of f_w: published values, the dilute limit, and refusals outside their ranges."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial

import mrjax
from mrjax.laws import drag, hindrance
from mrjax.laws.closures import brzinski_durian, table

EXACT = 1e-13
near = partial(pytest.approx, abs=0.0)

# Volume fraction of the suspension of the literature, and factors at it by other routes: in a
# simple cubic array exact hydrodynamics gives 15 (Zick & Homsy 1982).
DENSE = 0.337


def happel(fraction):
    """The cell model of Happel (1958): velocity of Stokes over that of a crowd in a closed tube."""
    cell = np.cbrt(fraction)
    least = 3.0 - 4.5 * cell + 4.5 * cell**5 - 3.0 * cell**6
    return (3.0 + 2.0 * cell**5) / least


def test_brzinski_and_durian_have_two_branches():
    assert drag.brzinski_durian(0.5) == near(2.0**5.6, rel=EXACT)
    assert drag.brzinski_durian(0.5, brzinski_durian.BRANCHES["high"]) == near(2**4.48, rel=EXACT)
    assert [brzinski_durian.branch(number) for number in (1e3, 0.99e8, 1.01e8)] == [
        "low",
        "low",
        "high",
    ]


def test_a_recipe_chooses_the_branch_by_its_peclet_number(case2):
    """Of iron: 1e3 at 4 um, and with R^4 above 1e8 from 71 um on."""
    weight = 4 / 3 * np.pi * 2e-6**3 * (7470 - 950) * 9.81
    assert case2.peclet_number == near(weight * 2e-6 / (1.380649e-23 * 293.15), rel=1e-12)

    def exponent(diameter, **coefficients):
        f_w = {"closure": "brzinski-durian", **coefficients}
        drag_table = {"f_w": f_w, "local": True}
        recipe = case2.replace(particle={"diameter": diameter}, drag=drag_table, box=None)
        return recipe.closure.keywords["exponent"]

    assert (exponent(70e-6), exponent(71e-6)) == (5.6, 4.48)
    assert exponent(4e-6, branch="high") == exponent(4e-6, exponent=4.48) == 4.48
    assert case2.replace(drag={"f_w": "brzinski-durian"}).closure.keywords["exponent"] == 5.6


def test_the_default_exponent_is_on_neither_branch():
    assert drag.richardson_zaki(0.5) == near(2.0**4.65, rel=EXACT)
    assert 4.65 not in brzinski_durian.BRANCHES.values()


def test_flocs_hinder_by_their_own_volume():
    assert drag.floc_richardson_zaki(0.02, 25.0, 4.65) == near(2.0**4.65, rel=EXACT)
    assert drag.floc_richardson_zaki(0.3, 1.0) == near(0.7**-4.65, rel=EXACT)
    # d ln f_w / d phi of the dilute limit is n C: a fit without flocs takes it for an exponent.
    slope = jax.grad(lambda phi: jnp.log(drag.floc_richardson_zaki(phi, 20.0)))(1e-9)
    assert slope == near(93.0, rel=1e-6)


def test_vesilind_is_an_exponential():
    assert drag.vesilind(0.02, 50.0) == near(np.e, rel=EXACT)


def test_carman_and_kozeny_in_a_closed_tube():
    """The backflow k delta_rho g phi / mu at a permeability of d^2 (1 - phi)^3 / (180 phi^2)."""
    for phi in (0.25, DENSE, 0.6):
        permeability = (1 - phi) ** 3 / (180 * phi**2)  # over d^2
        assert drag.carman_kozeny(phi) == near(1 / 18 / (permeability * phi), rel=EXACT)
    assert drag.carman_kozeny(DENSE) == near(11.6, rel=5e-3)
    assert happel(DENSE) == near(12.7, rel=5e-3)
    ratio = [float(drag.carman_kozeny(phi)) / happel(phi) - 1 for phi in (0.2, 0.3, 0.5)]
    assert ratio == pytest.approx([-0.31, -0.14, 0.06], abs=5e-3)


def test_a_rigid_network_is_a_packing_of_larger_units():
    assert drag.rigid_network(DENSE, 1.0) == near(float(drag.carman_kozeny(DENSE)), rel=EXACT)
    # By hand: units of C^(1/3) d with C phi = 0.5, in which liquid seeps; 1/0.8^2 by their surface.
    expected = 2.0 ** (1 / 3) * 10 * 0.5 / 0.5**3 / 0.64
    assert drag.rigid_network(0.25, 2.0, 0.8) == near(expected, rel=EXACT)


DILUTE = {
    "brzinski-durian": {},
    "richardson-zaki": {},
    "floc-richardson-zaki": {"floc_volume": 20.0},
    "vesilind": {"rate": 80.0},
}


@pytest.mark.parametrize("name", DILUTE)
def test_a_particle_alone_has_stokes_drag(name):
    law = Partial(drag.CLOSURES[name], **DILUTE[name])
    assert law(0.0) == 1.0
    assert law(1e-9) == near(1.0, rel=1e-6)


@pytest.mark.parametrize(
    "name, coefficients, least, most",
    [
        ("floc-richardson-zaki", {"floc_volume": 20.0}, 0.0, 0.05),
        ("carman-kozeny", {}, 0.2, 1.0),
        ("rigid-network", {"floc_volume": 2.0}, 0.1, 0.5),
    ],
)
def test_outside_its_range_a_law_is_nan(name, coefficients, least, most):
    law = Partial(drag.CLOSURES[name], **coefficients)
    holds = table.valid_range(law)
    assert (holds.least, holds.most) == (near(least), near(most))
    slope = jax.value_and_grad(law)
    for inside in ((1 + 1e-9) * least, (1 - 1e-9) * most):
        assert np.isfinite(slope(inside)).all() and holds.fault(inside) is None
    for outside in ([(1 - 1e-9) * least] if least else []) + [most, 1.1 * most]:
        value, derivative = slope(outside)
        assert np.isnan(value) and derivative == 0.0 and holds.fault(outside)


def test_traced_coefficients_have_no_known_range():
    def known(floc_volume):
        law = Partial(drag.floc_richardson_zaki, floc_volume=floc_volume)
        return floc_volume if table.valid_range(law) is None else -floc_volume

    assert jax.jit(known)(2.0) == 2.0
    assert table.valid_range(Partial(drag.richardson_zaki)) is None
    assert table.valid_range(drag.carman_kozeny).least == 0.2


@pytest.mark.parametrize(
    "f_w, fault",
    [
        ("vesilind", r'rate is missing: .*give \{closure = "vesilind", rate = \.\.\.\}'),
        ({"closure": "floc-richardson-zaki", "floc_volume": 3.0}, "at 0.3372.* below .* 0.3333"),
        ({"closure": "floc-richardson-zaki", "floc_volume": 0.9}, "floc_volume = 0.9: flocs are"),
        ({"closure": "rigid-network", "floc_volume": 3.0}, "network fills the suspension"),
        ({"closure": "brzinski-durian", "branch": "middle"}, "branch = 'middle': give \"low\" or"),
        ({"closure": "brzinski-durian", "branch": "low", "exponent": 5.0}, "sets the exponent"),
        ({"closure": "carman-kozeny", "exponent": 5.0}, "has no such coefficient; known: none"),
    ],
)
def test_refused_in_a_recipe(case2, f_w, fault):
    with pytest.raises(mrjax.InputError, match=fault):
        case2.replace(drag={"f_w": f_w})


def test_a_packing_is_no_dilute_suspension(case2):
    with pytest.raises(mrjax.InputError, match=r"not at 0.1000, it holds from .* 0.2: more dilute"):
        case2.replace(drag={"f_w": "carman-kozeny"}, composition={"volume_fraction": 0.1})


@pytest.mark.parametrize(
    "f_w", ["carman-kozeny", {"closure": "floc-richardson-zaki", "floc_volume": 2.0}]
)
def test_particles_with_local_drag_need_a_law_from_fluid_to_bed(case2, f_w):
    recipe = case2.replace(drag={"f_w": f_w, "local": True})
    with pytest.raises(mrjax.InputError, match=r"from 0 to 0.7: give drag.local = false, or sim"):
        hindrance.refuse_partial(recipe.hindrance)
    state = mrjax.place([[1e-5, 1e-5, 1e-5]])
    with pytest.raises(mrjax.InputError, match="particles with local drag pass all volume"):
        mrjax.simulate(
            state, recipe.parameters(), recipe.box, duration=1e-6, hindrance=recipe.hindrance
        )
    hindrance.refuse_partial(Partial(drag.richardson_zaki, exponent=5.6))
