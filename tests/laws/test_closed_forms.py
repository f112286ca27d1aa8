"""Closed forms of settling: Son 2018, Eqs. 13 and 27."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mrjax
from mrjax.laws import closed_forms, drag, particle, time_scales

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
MM_PER_DAY = 1e-3 / 86400

CASE_3 = dict(rho_p=7470.0, rho_c=800.0, rho_f=950.0, f_r=1.1, f_w=48.985, f_s=1.1, f_v=1.68)


def settling(rho_p, rho_f, f_w=1.0, f_s=1.0, f_v=1.0, f_r=1.0, rho_c=0.0, shell=None):
    """beta/alpha of Eq. 27 as the paper writes it, with an apparent density for rho_c; mm/day.

    `shell` is the f_r of the apparent density alone.
    """
    cubed = (shell or f_r) ** 3
    density = (rho_p + rho_c * (cubed - 1)) / cubed
    alpha = 9 * f_w * f_s * f_v * 0.01 / ((2 * density + rho_f) * f_r**2 * 2e-6**2)
    beta = (2 * density - 2 * rho_f) / (2 * density + rho_f) * 9.81
    return beta / alpha / MM_PER_DAY


@pytest.mark.parametrize(
    "name, f_w, expected",
    [
        ("case1", 1.0, 491.22),
        ("case2", 48.49, 9.2094),  # the f_w that Table 2 prints
        ("case2", None, 9.1164),  # the f_w of Eq. 14: 48.985
        ("case3", None, 4.8955),
    ],
)
def test_terminal_velocities(name, f_w, expected):
    parameters = mrjax.Recipe.load(name).parameters()
    if f_w:
        parameters = parameters.replace(f_w=jnp.asarray(f_w))
    velocity = float(mrjax.terminal_velocity(parameters)) / MM_PER_DAY
    assert velocity == near(expected, rel=1e-5)  # the digits given
    assert settling(
        rho_p=7470.0,
        rho_f=950.0,
        rho_c=float(parameters.coating_density),
        **{f: float(getattr(parameters, f)) for f in ("f_w", "f_s", "f_v", "f_r")},
    ) == near(velocity, rel=1e-12)


# What the paper prints, and the readings of its equations that come to it.
@pytest.mark.parametrize(
    "printed, digit, reading",
    [
        (491.2, 0.05, settling(7470.0, 950.0)),
        (9.21, 0.005, settling(7470.0, 950.0, f_w=48.49, f_s=1.10)),
        # Case 3: without f_r^2, "4.0" to its digits; Eqs. 19 to 24 give 4.8955.
        (4.0, 0.05, settling(**CASE_3) / 1.1**2),
        (4.046, 0.0005, settling(**CASE_3) / 1.1**2),
    ],
)
def test_printed_velocities(printed, digit, reading):
    assert reading == pytest.approx(printed, abs=digit)


def test_the_printed_density_of_equation_27_would_rise():
    """rho_c as the coating's own density, lighter than the oil; it must be the apparent one."""
    assert settling(**{**CASE_3, "rho_p": 800.0}) < 0 < settling(**CASE_3)


def test_the_factors_enter_as_a_product(case3):
    parameters = case3.parameters()
    gradient = jax.grad(mrjax.terminal_velocity)(parameters)
    velocity = float(mrjax.terminal_velocity(parameters))
    for factor in ("f_w", "f_s", "f_v", "viscosity"):
        relative = float(getattr(gradient, factor) * getattr(parameters, factor)) / velocity
        assert relative == near(-1.0, rel=EXACT), factor
    assert float(gradient.gravity) == near(velocity / 9.81, rel=EXACT)


def test_free_fall_solves_the_equation_of_motion(case):
    """(m + m_a) u' = weight - buoyancy - drag (Eqs. 12 and 19), from rest and from a throw."""
    parameters = case.parameters()
    inertia, weight, resistance = (
        float(law(parameters)) for law in (particle.inertia, particle.net_weight, drag.coefficient)
    )
    relaxation = inertia / resistance
    final = weight / resistance
    times = relaxation * np.array([0.01, 0.1, 1.0, 5.0, 30.0])
    for start in (0.0, -3.0 * final):
        path = solve_ivp(
            lambda _, u: (weight - resistance * u) / inertia,
            (0.0, times[-1]),
            [start],
            t_eval=times,
            rtol=1e-11,
            atol=1e-13 * final,
        )
        found = closed_forms.free_fall_velocity(parameters, jnp.asarray(times), start)
        np.testing.assert_allclose(found, path.y[0], rtol=1e-8)  # the solver's, over 30 e-folds
    rise = closed_forms.free_fall_velocity(parameters, time_scales.rise_time(parameters))
    assert float(rise) == near(0.99 * final, rel=EXACT)


LEAVES = ("radius", "particle_density", "fluid_density", "viscosity", "gravity", "f_w", "f_r")


def test_free_fall_without_drag(case3):
    """v_0 + beta t, with a derivative in the viscosity: of second order in time."""
    still = case3.parameters().replace(viscosity=jnp.asarray(0.0))
    time, start = 1e-3, 0.2
    inertia, weight = float(particle.inertia(still)), float(particle.net_weight(still))
    velocity, gradient = jax.value_and_grad(closed_forms.free_fall_velocity)(still, time, start)
    assert float(velocity) == near(start + weight / inertia * time, rel=EXACT)
    for leaf in LEAVES:
        assert jnp.isfinite(getattr(gradient, leaf)), leaf
    per_viscosity = float(drag.coefficient(case3.parameters())) / 0.01 / inertia
    expected = -per_viscosity * (start * time + 0.5 * weight / inertia * time**2)
    assert float(gradient.viscosity) == near(expected, rel=1e-12)
    assert closed_forms.terminal_velocity(still) == jnp.inf


def test_weightless(case3):
    floating = case3.parameters().replace(gravity=jnp.asarray(0.0))
    for law in (mrjax.terminal_velocity, lambda p: closed_forms.free_fall_velocity(p, 1e-8)):
        velocity, gradient = jax.value_and_grad(law)(floating)
        assert velocity == 0.0
        assert all(jnp.isfinite(getattr(gradient, leaf)) for leaf in LEAVES)
        assert gradient.gravity > 0.0
    relaxation = float(time_scales.relaxation_time(floating))
    thrown = closed_forms.free_fall_velocity(floating, 2 * relaxation, 0.5)
    assert float(thrown) == near(0.5 * np.exp(-2), rel=EXACT)


def test_neither_weight_nor_drag(case3):
    zero = jnp.asarray(0.0)
    parameters = case3.parameters().replace(gravity=zero, viscosity=zero, fluid_density=zero)
    velocity, gradient = jax.value_and_grad(closed_forms.free_fall_velocity)(parameters, 1.0, 0.3)
    assert velocity == 0.3
    assert all(jnp.isfinite(getattr(gradient, leaf)) for leaf in LEAVES)


def test_plain_numbers_without_drag():
    ball = mrjax.Parameters(
        radius=0.01,
        particle_density=1000.0,
        fluid_density=0.0,
        viscosity=0.0,
        elastic_modulus=1e9,
        poisson_ratio=0.3,
    )
    assert mrjax.terminal_velocity(ball) == jnp.inf
    assert float(closed_forms.free_fall_velocity(ball, 2.0, 1.0)) == near(20.62, rel=EXACT)


def test_one_value_for_each_particle(case2):
    parameters = case2.parameters()
    many = parameters.replace(radius=jnp.array([1e-6, 2e-6, 4e-6]))
    velocity = mrjax.terminal_velocity(many) / mrjax.terminal_velocity(parameters)
    np.testing.assert_allclose(velocity, [0.25, 1.0, 4.0], rtol=EXACT)
    settled = closed_forms.free_fall_velocity(many, 1e-3)
    np.testing.assert_allclose(settled, mrjax.terminal_velocity(many), rtol=EXACT)
