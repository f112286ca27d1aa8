"""A carrier with a yield stress: thresholds, limits, the force balance, ageing, derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import mrjax
from mrjax import Parameters
from mrjax.laws import closed_forms, drag, particle, yield_stress

EXACT = 1e-12
near = partial(pytest.approx, abs=0.0)
CRITICAL = 0.143 / 3 * (7470.0 - 950.0) * 9.81 * 4e-6
"""Pa, of iron of 4 um in oil: Y = 3 tau_y / (Delta rho g d)."""


def iron(**changes):
    iron_in_oil = dict(
        radius=2e-6, particle_density=7470.0, fluid_density=950.0, viscosity=0.01, f_w=5.0, f_s=1.2,
        elastic_modulus=1e9, poisson_ratio=0.3,
    )  # fmt: skip
    return Parameters(**iron_in_oil | changes).astype(float)


def factor(bingham):
    """f(Bi) by numpy, for root finding and integrals; the law is compared with it."""
    powers = (2.93 * bingham**0.83) ** 16 + (bingham / (6 * 0.143)) ** 16
    return 1 + powers ** (1 / 16)


def velocity(**changes):
    return mrjax.terminal_velocity(iron(**changes))


@pytest.mark.parametrize("diameter, threshold", [(2e-6, 6.1), (4e-6, 12.2), (10e-6, 30.5)])
def test_the_yield_stress_that_holds_iron(diameter, threshold):
    """Published numbers in mPa, which the viscosity does not change."""
    for viscosity in (0.01, 10.0):
        parameters = iron(radius=diameter / 2, viscosity=viscosity)
        found = 1e3 * float(yield_stress.critical_yield_stress(parameters))
        assert found == pytest.approx(threshold, abs=0.05)


def test_a_particle_stops_at_the_threshold():
    at = iron(yield_stress=CRITICAL)
    assert yield_stress.yield_number(at) == near(0.143, rel=EXACT)
    assert yield_stress.critical_yield_stress(at) == near(CRITICAL, rel=EXACT)
    for stress in (1.000001 * CRITICAL, 2.0 * CRITICAL, 1e6):
        assert velocity(yield_stress=stress) == 0.0
    # z tends to (1 - Y / 0.143) at the threshold, for the slope of f at large Bi is that of c Bi.
    just = velocity(yield_stress=(1 - 1e-8) * CRITICAL) / velocity()
    assert just == near(1e-8, rel=0.01)


def test_without_a_yield_stress_it_is_a_newtonian_carrier():
    assert velocity(yield_stress=0.0) == velocity(yield_stress=0.0, flow_index=1.0) == velocity()
    small = 1e-9 * CRITICAL
    slower = 1 - float(velocity(yield_stress=small) / velocity())
    assert slower == near(2.93 * (6 * 0.143e-9) ** 0.83, rel=1e-5)


def test_the_drag_of_a_moving_sphere():
    """Blackery & Mitsoulis' regression up to Bi = 60, and Beris' limit from Bi = 1e4 on."""
    small, large = np.array([0.01, 1.0, 10.0, 60.0]), np.array([1e4, 1e6, 1e8])
    regression = 1 + 2.93 * small**0.83
    np.testing.assert_allclose(yield_stress.drag_factor(small), regression, rtol=2e-3)
    limit = large / (6 * 0.143)
    np.testing.assert_allclose(yield_stress.drag_factor(large), limit, rtol=1e-3)
    assert pytest.approx(1.166, abs=1e-3) == yield_stress.LARGE_BINGHAM_SLOPE
    meeting = (2.93 / yield_stress.LARGE_BINGHAM_SLOPE) ** (1 / 0.17)
    assert meeting == pytest.approx(226, abs=1)
    join = (yield_stress.drag_factor(meeting) - 1) / (2.93 * meeting**0.83)
    assert join == near(2 ** (1 / 16), rel=1e-9)
    assert yield_stress.drag_factor(0.0) == 1.0
    every = np.logspace(-3, 6, 10)
    np.testing.assert_allclose(yield_stress.drag_factor(every), factor(every), rtol=EXACT)


@pytest.mark.parametrize("share", [1e-6, 0.01, 0.3, 0.9, 0.9999])
@pytest.mark.parametrize("index", [None, 1.0, 0.5, 1.5])
def test_weight_and_drag_balance(share, index):
    """W = 3 pi mu d v f(tau_y d / (mu v)) with mu = K (v / d)^(n - 1), and the factors of drag."""
    parameters = iron(yield_stress=share * CRITICAL, flow_index=index)
    alone = 5.0 * 1.2 * float(mrjax.terminal_velocity(parameters))  # without f_w and f_s
    if index == 0.5 or index == 1.5:  # they divide the velocity of a Newtonian carrier
        v_of_balance = brentq(
            lambda v: balance(v, share * CRITICAL, index, 1.2), 1e-14, 1e-2, xtol=1e-30, rtol=1e-13
        )
        assert alone / 1.2 == near(v_of_balance, rel=1e-9)
        return
    assert abs(balance(alone, share * CRITICAL, 1.0)) < 1e-9


def balance(v, stress, index, f_s=1.0):
    weight = float(particle.net_weight(iron()))
    viscosity = 0.01 * (v / 4e-6) ** (index - 1.0) * f_s
    bingham = stress * 4e-6 / (viscosity * v)
    return 3 * np.pi * viscosity * 4e-6 * v * factor(bingham) / weight - 1


NAMES = ("radius", "viscosity", "particle_density", "f_s", "yield_stress", "flow_index")


def test_derivatives_are_central_differences():
    """Of the logarithm by logarithms, first and second, near both ends of the yield stress too."""
    starts = jnp.array([[2e-6, 0.01, 7470.0, 1.2, x * CRITICAL, 0.7] for x in (0.001, 0.3, 0.99)])

    def law(logarithms, start):
        parameters = iron().replace(**dict(zip(NAMES, start * jnp.exp(logarithms), strict=True)))
        return jnp.log(mrjax.terminal_velocity(parameters))

    slope = jax.value_and_grad(law)
    slopes = jax.jit(jax.vmap(jax.vmap(slope, (0, None)), (None, 0)))
    steps = 1e-5 * jnp.eye(len(NAMES))
    curvature = jax.jit(jax.vmap(jax.hessian(law), (None, 0)))(jnp.zeros(len(NAMES)), starts)
    _, exact = slopes(jnp.zeros((1, len(NAMES))), starts)
    (more, slope_more), (less, slope_less) = slopes(steps, starts), slopes(-steps, starts)
    np.testing.assert_allclose(exact[:, 0], (more - less) / 2e-5, rtol=2e-5, atol=1e-9)
    central = (slope_more - slope_less) / 2e-5
    np.testing.assert_allclose(curvature, central, rtol=1e-3, atol=1e-4)


def test_derivatives_above_the_threshold_and_without_a_yield_stress_are_finite():
    def slopes(stress, index):
        parameters = iron(yield_stress=stress, flow_index=index)
        return jax.grad(lambda parameters: mrjax.terminal_velocity(parameters))(parameters)

    for index in (None, 0.7):
        still = jax.tree.leaves(slopes(1.1 * CRITICAL, index))
        assert len(still) > 20 and not np.any(still)
        free = slopes(0.0, index)
        assert np.isfinite(jax.tree.leaves(free)).all() and free.yield_stress == 0.0
    newtonian = jax.grad(lambda parameters: mrjax.terminal_velocity(parameters))(iron())
    assert slopes(0.0, None).radius == newtonian.radius != 0.0


def test_each_size_has_its_own_threshold():
    radius = jnp.array([1e-6, 2e-6, 4e-6])
    found = velocity(radius=radius, yield_stress=0.6 * CRITICAL)
    assert found[0] == 0.0 and found[1] == velocity(yield_stress=0.6 * CRITICAL)
    assert found[2] > found[1]
    rising = velocity(particle_density=500.0, yield_stress=1e-5)
    assert rising < 0.0 and velocity(particle_density=500.0, yield_stress=1.0) == 0.0


def test_without_gravity_nothing_moves():
    for stress, number in ((0.0, 0.0), (1e-3, np.inf)):
        floating = iron(gravity=0.0, yield_stress=stress)
        assert yield_stress.yield_number(floating) == number
        assert mrjax.terminal_velocity(floating) == 0.0


def test_the_wall_holds_a_suspension():
    found = yield_stress.plug_yield_stress(iron(), 0.337, 0.02)
    assert found == near(6520 * 9.81 * 0.337 * 0.02 / 4, rel=EXACT) and 107 < found < 109


def test_a_carrier_that_ages_lets_particles_fall_less_far():
    """The integral of v(t), by the Bingham number: Y = Bi / (6 f), z = 1 / f; until they stop."""
    start, growth = 0.3 * CRITICAL, 1e-9
    parameters = iron(yield_stress=start, yield_growth=growth)
    stop = (CRITICAL - start) / growth
    times = stop * np.array([0.0, 0.2, 0.9, 1.0, 5.0])
    found = yield_stress.effective_times(parameters, times)

    def root(number):
        def excess(log_bingham):
            bingham = np.exp(log_bingham)
            return bingham / (6 * factor(bingham)) - number

        return 1 / factor(np.exp(brentq(excess, -40, 40, xtol=1e-13)))

    def fallen(time):
        at = [0.143 * (start + growth * t) / CRITICAL for t in (0.0, min(time, 0.999999 * stop))]
        area, _ = quad(root, *at, epsrel=1e-7, limit=60)
        return area / root(at[0]) * CRITICAL / 0.143 / growth

    np.testing.assert_allclose(found[:3], [fallen(time) for time in times[:3]], rtol=2e-6)
    assert found[3] == near(fallen(stop), rel=1e-5)
    assert found[4] == found[3]
    fresh = iron(yield_growth=growth)
    aged = yield_stress.effective_times(fresh, 1e-3 * stop * jnp.ones(1))
    number = 0.143 * growth * 1e-3 * stop / CRITICAL
    loss = 2.93 * (6 * number) ** 0.83 / 1.83  # of the leading order, in the mean over the time
    assert 1 - aged[0] / (1e-3 * stop) == near(loss, rel=0.05)


def test_the_quadrature_takes_the_infinite_slope_of_a_small_yield_stress():
    node, weight = yield_stress._quadrature()
    assert node**0.83 @ weight == near(1 / 1.83, rel=1e-8)
    assert weight.sum() == near(1.0, rel=EXACT)


def test_ageing_has_derivatives_and_a_still_carrier_stays_still():
    times = jnp.array([1e5, 1e6, 1e8])

    @jax.jit
    def fallen(growth):
        parameters = iron(yield_stress=0.3 * CRITICAL, yield_growth=growth)
        return yield_stress.effective_times(parameters, times)

    slope = jax.jit(jax.jacfwd(fallen))
    exact = slope(1e-8)
    np.testing.assert_allclose(exact, (fallen(1.001e-8) - fallen(0.999e-8)) / 2e-11, rtol=1e-5)
    assert (fallen(0.0) == times).all() and np.isfinite(slope(0.0)).all()
    still = iron(yield_stress=2 * CRITICAL, yield_growth=1e-8)
    assert (yield_stress.effective_times(still, times) == times).all()


@pytest.mark.parametrize("name, value", [("yield_stress", 1e-3), ("flow_index", 0.5)])
def test_particles_that_touch_need_a_newtonian_carrier(name, value):
    state, box = mrjax.place([[1e-5] * 3]), mrjax.Box((2e-5,) * 3)
    with pytest.raises(mrjax.InputError, match=f"{name} = .*: particles that touch are simulated"):
        mrjax.simulate(state, iron(**{name: value}), box, duration=1e-6)
    with pytest.raises(mrjax.InputError, match=f"{name} = a traced value: particles"):
        jax.jit(
            lambda value: closed_forms.free_fall_velocity(iron().replace(**{name: value}), 1.0)
        )(value)
    yield_stress.refuse_particles(iron(yield_stress=0.0, flow_index=1.0, yield_growth=0.0))


def test_the_drag_coefficient_is_that_of_the_viscosity_alone():
    assert drag.coefficient(iron(yield_stress=1.0)) == drag.coefficient(iron())
