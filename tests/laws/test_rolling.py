"""Rolling resistance: Ai et al. (2011), model C."""

from functools import partial
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax import lax

from mrjax.laws import normal, rolling
from tests.builders.tangents import (
    ACROSS,
    ALONG,
    BETWEEN,
    STILL,
    check_central_differences,
    check_finite,
    closed_path,
    derivatives,
    kept_share,
    length,
    steps,
    to_and_fro,
    vectors,
    work_of_a_cycle,
)

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, rel=EXACT, abs=0.0)  # its own abs passes all within 1e-12

# --- the torque and what is remembered ------------------------------------------------------------

PAIR = dict(modulus=3.0, radius=4.0, inertia=4.0, friction=0.1)
OVERLAP = 0.25
STIFFNESS = 1.44  # 9/4 * 4/3 * 3 * sqrt(4 * 0.25) * (0.1 * 4)^2, N m
DASHPOT = 2.4  # 2 * 0.5 * sqrt(4 * 1.44), N m s, for half of critical damping
LIMIT = 4.0  # 0.1 * 4 * 10, N m
DAMPED = dict(damping=0.5)
# At this overlap Hertz's law is rounded off by 0.5e-14 R* / d = 8e-14 of itself.
ROUNDED = 4e-13


@jax.jit
def resist(roll, rate, overlap=OVERLAP, normal_force=10.0, **changes):
    """Torque and memory as arrays, (3,) each."""
    torque, kept = rolling.rolling_torque(
        tuple(jnp.asarray(roll, float)),
        tuple(jnp.asarray(rate, float)),
        jnp.asarray(overlap, float),
        jnp.asarray(normal_force, float),
        **{**PAIR, **changes},
    )
    return jnp.stack(torque), jnp.stack(kept)


def test_inertia_about_the_contact():
    assert rolling.contact_inertia(0.4, 1.0, 1.0) == near(1.4)
    assert rolling.contact_inertia(3.0, 2.0, 5.0) == near(53.0)


def test_a_spring_with_a_dashpot():
    torque, kept = resist(ALONG, ACROSS)
    np.testing.assert_allclose(torque, -STIFFNESS * ALONG, rtol=ROUNDED)
    np.testing.assert_array_equal(kept, ALONG)
    torque, kept = resist(ALONG, ACROSS, **DAMPED)
    np.testing.assert_allclose(torque, -STIFFNESS * ALONG - DASHPOT * ACROSS, rtol=ROUNDED)
    np.testing.assert_array_equal(kept, ALONG)


def test_no_more_than_the_limit():
    torque, kept = resist(5.0 * ALONG, STILL)
    np.testing.assert_allclose(torque, -LIMIT * ALONG, rtol=ROUNDED)
    np.testing.assert_allclose(kept, LIMIT / STIFFNESS * ALONG, rtol=ROUNDED)
    # With a dashpot, the direction is that of both together.
    torque, kept = resist(5.0 * ALONG, ACROSS, **DAMPED)
    both = LIMIT * ALONG + DASHPOT * ACROSS
    np.testing.assert_allclose(torque, -LIMIT * both / length(both), rtol=ROUNDED)
    np.testing.assert_allclose(kept, LIMIT / STIFFNESS * ALONG, rtol=ROUNDED)


@settings(deadline=None)  # the first call compiles
@given(
    roll=vectors,
    rate=vectors,
    scale=st.sampled_from([1e-6, 1e-2, 1.0, 1e3]),
    overlap=st.floats(1e-6, 0.5),
    push=st.sampled_from([0.0, 1e-9]) | st.floats(0.01, 100.0),
    mu=st.sampled_from([0.0, 1e-9]) | st.floats(0.01, 2.0),
    damping=st.sampled_from([0.0, 0.3, 3.0]),
)
def test_the_limit_and_the_direction(roll, rate, scale, overlap, push, mu, damping):
    roll, rate = scale * roll, scale * rate
    torque, kept = resist(roll, rate, overlap, push, friction=mu, damping=damping)
    limit, spring = mu * 4.0 * push, 18.0 * np.sqrt(overlap) * (mu * 4.0) ** 2
    off = ROUNDED + 2e-14 / overlap  # rounding off of the spring at small overlap
    assert length(torque) <= limit * (1 + off)
    assert spring * length(kept) <= limit * (1 + off)
    np.testing.assert_allclose(np.cross(kept, roll), 0.0, atol=1e-15 * scale**2)
    assert kept @ roll >= 0.0
    if length(kept) < length(roll) * (1 - 1e-12):
        assert spring * length(kept) == pytest.approx(limit, rel=off, abs=0.0)
    borne = spring * kept + 2 * damping * np.sqrt(4.0 * spring) * rate
    assert torque @ borne <= 0.0
    np.testing.assert_allclose(
        np.cross(torque, borne), 0.0, atol=4e-14 / overlap * length(torque) * length(borne)
    )
    alone, _ = resist(STILL, rate, overlap, push, friction=mu, damping=damping)
    assert alone @ rate <= 0.0
    if damping and mu * push > 1e-3 and length(rate) > 1e-6:
        assert alone @ rate < 0.0


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_continuous_where_the_spring_yields(share):
    """Along a path whose trial torque, `share` of it the dashpot's, passes the limit."""
    rate = share * LIMIT / DASHPOT * ALONG
    at_limit = (1 - share) * LIMIT / STIFFNESS
    (before, kept_before), (after, kept_after) = (
        resist(at_limit * (1 + side * 1e-9) * ALONG, rate, **DAMPED) for side in (-1, 1)
    )
    # 2e-9 of the limit, and of the angle at which the spring yields.
    np.testing.assert_allclose(before, after, atol=1e-8)
    np.testing.assert_allclose(kept_before, kept_after, atol=6e-9)
    assert length(after) == pytest.approx(LIMIT, rel=ROUNDED, abs=0.0)


@pytest.mark.parametrize("overlap", [0.0, -1e-12, -0.3])
def test_apart_there_is_no_torque_and_no_memory(overlap):
    torque, kept = resist(ALONG, ACROSS, overlap, 0.0, **DAMPED)
    assert (torque == 0).all() and (kept == 0).all()


def test_a_contact_that_bears_nothing_remembers_nothing():
    torque, kept = resist(ALONG, ACROSS, OVERLAP, 0.0, **DAMPED)
    assert (torque == 0).all() and (kept == 0).all()


def test_a_perfect_sphere_is_not_resisted():
    """Without mu_r there is no limit, but nothing to reach it either."""
    torque, _ = resist(ALONG, ACROSS, friction=0.0, **DAMPED)
    assert (torque == 0).all()


# --- work -----------------------------------------------------------------------------------------


@jax.jit
def along(path, time_step, damping):
    """Torques of a contact that rolls along angles (n, 3) from the first, and the memories."""

    def step(roll, change):
        torque, kept = resist(roll + change, change / time_step, damping=damping)
        return kept, (torque, kept)

    return lax.scan(step, jnp.zeros(3), jnp.diff(path, axis=0))[1]


@settings(deadline=None)
@given(steps, st.sampled_from([0.1, 1.0, 5.0]), st.sampled_from([0.0, 0.2, 2.0]))
def test_closed_cycles_dissipate(steps, size, damping):
    """Along any closed path; the torque of each step acts along it, as in a run."""
    path = closed_path(steps, size)
    torque, kept = along(path, 0.1, damping)
    work = float(jnp.sum(torque * np.diff(path, axis=0)))
    stored = 0.5 * STIFFNESS * float(kept[-1] @ kept[-1])
    assert work + stored <= 1e-12 * size * LIMIT  # rounding of 25 terms


def test_hysteresis_of_a_rolling_cycle():
    """To and fro by +-A: 4 M (A - M / k_r) is lost in every cycle, M the limit."""
    yields = LIMIT / STIFFNESS
    farthest = 3.2 * yields
    path = to_and_fro(farthest)
    torque = np.asarray(along(path[:, None] * ALONG, 1.0, 0.0)[0] @ ALONG)
    work = work_of_a_cycle(torque, path)
    assert work == near(-4 * LIMIT * (farthest - yields), rel=1e-12)


# --- derivatives ----------------------------------------------------------------------------------


def law(point):
    """Normal and rolling law together, as in a run; torque and memory, (6,)."""
    overlap, closing, modulus, radius, mass, inertia, mu, dissipation, restored, damping = point[6:]
    push = normal.normal_force(overlap, closing, modulus, radius, mass, dissipation, restored)
    torque, kept = rolling.rolling_torque(
        tuple(point[:3]),
        tuple(point[3:6]),
        overlap,
        push,
        modulus=modulus,
        radius=radius,
        inertia=inertia,
        friction=mu,
        damping=damping,
    )
    return jnp.stack([*torque, *kept])


GLASS = (0.005, 100.0, 1.0, 25e9, 0.005, 0.0059, 2e-7, 1e-6)
REDUCED = (1.0, 0.02, 0.01, 2.0, 0.5, 2.0, 0.7, 0.3)  # as within a run
DERIVATIVES = derivatives(law)


def points(units, dtype):
    """Apart, touching, overlapping; without roll, friction or damping; elastic and plastic."""
    size, spin, speed, *pair, time = units
    # Rounding of positions leaves no smaller overlap than eps.
    resolved = (d for d in (1e-15, 1e-14, 1e-10, 1.2e-7, 1e-3, 0.1) if d > jnp.finfo(dtype).eps)
    overlaps = (-1.0, -1e-7, 0.0, *resolved)
    kinds = product(
        (0.0, 1e-12, 1e-4, 1.0), (0.0, 1e-9, 1.0), overlaps, (-1, 0, 1), (0.0, 0.4), (0, 1)
    )
    rows = []
    for roll, rate, overlap, closing, mu, damped in kinds:
        motion = (*roll * ALONG, *rate * spin * BETWEEN, overlap * size, closing * speed)
        rows.append((*motion, *pair, mu, damped * time, 0.4 * damped, 0.3 * damped))
    return jnp.asarray(np.array(rows), dtype)


@pytest.mark.parametrize(
    "units, dtype",
    [
        (REDUCED, float),
        pytest.param(GLASS, float, marks=pytest.mark.slow),
        pytest.param(REDUCED, jnp.float32, marks=pytest.mark.slow),
    ],
)
def test_first_and_second_derivatives_are_finite_everywhere(units, dtype):
    check_finite(DERIVATIVES, points(units, dtype))


# roll, rate (1/s), closing (m/s), friction, A, z and h_r: of every kind, away from the switches
KINDS = {
    "elastic": (1e-3, 1e-4, 0.01, 0.4, 0.3, 0.3, 0.2),
    "resting": (1e-3, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0),
    "plastic": (1.0, 0.01, 0.01, 0.4, 0.3, 0.3, 0.2),
    "plastic by the dashpot": (1e-3, 1.0, 0.01, 0.4, 0.3, 0.3, 0.2),
    "opening": (1.0, 0.01, -0.005, 0.4, 0.3, 0.3, 0.2),
}


def test_gradients_are_central_differences():
    at = jnp.array(
        [
            [*roll * ALONG, *rate * BETWEEN, 0.02, closing, 2.0, 0.5, 2.0, 0.7, mu, a, z, h]
            for roll, rate, closing, mu, a, z, h in KINDS.values()
        ]
    )
    held = kept_share(law, at)
    np.testing.assert_array_less(held[[2, 4]], 0.9)  # those whose spring yields
    np.testing.assert_allclose(held[[0, 1, 3]], 1.0, rtol=EXACT)
    check_central_differences(DERIVATIVES, at)
