"""Tangential contact: Mindlin's spring within Coulomb's limit (Son 2018, Eqs. 7 and 8)."""

from functools import partial
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax import lax

from mrjax.laws import normal, tangential
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

# --- coefficients ---------------------------------------------------------------------------------


def test_effective_shear_modulus():
    # 2 (2 - 0.5) (1 + 0.5) / 3 + 2 (2 - 0.25) (1 + 0.25) / 4 = 1.5 + 1.09375
    assert tangential.effective_shear_modulus(3.0, 0.5, 4.0, 0.25) == near(1 / 2.59375)
    # Like surfaces: G / (2 (2 - nu)), here of glass with G = 20 GPa.
    assert tangential.effective_shear_modulus(48e9, 0.2, 48e9, 0.2) == near(20e9 / 3.6)


def test_a_rigid_wall_leaves_the_particle_its_shear_modulus():
    at = (48e9, 0.2, jnp.asarray(jnp.inf), 0.0)
    assert tangential.effective_shear_modulus(*at) == near(20e9 / 1.8)
    slopes = jax.grad(tangential.effective_shear_modulus, (0, 1, 2, 3))(*at)
    # G* = E / (2 (2 - nu) (1 + nu)), whatever the wall.
    shape = 1.8 * 1.2
    expected = [0.5 / shape, -0.5 * 48e9 * (1 - 2 * 0.2) / shape**2, 0.0, 0.0]
    np.testing.assert_allclose(np.array(slopes), expected, rtol=EXACT)


@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.5])
def test_mindlins_ratio_of_the_stiffnesses(poisson):
    """K_t / K_n = 2 (1 - nu) / (2 - nu), whatever the overlap (Mindlin 1949)."""
    material = (7.0, poisson, 7.0, poisson)
    in_plane = tangential.stiffness(tangential.effective_shear_modulus(*material), 4.0, 0.3)
    in_normal = normal.stiffness(normal.effective_modulus(*material), 4.0, 0.3)
    assert in_plane / in_normal == near(2 * (1 - poisson) / (2 - poisson))


def test_stiffness_and_damping_coefficient():
    assert tangential.stiffness(3.0, 4.0, 0.25) == near(24.0)  # 8 * 3 * sqrt(4 * 0.25)
    # 24 * 0.5 + 0.1 sqrt(10/3 * 5 * 24) = 12 + 2
    assert tangential.damping_coefficient(3.0, 4.0, 5.0, 0.25, 0.5, 0.1) == near(14.0)


# --- the force and what is remembered -------------------------------------------------------------

PAIR = dict(shear_modulus=3.0, radius=4.0, mass=5.0, friction=0.5)
OVERLAP, STIFFNESS = 0.25, 24.0
DAMPED = dict(dissipation=0.5, damping=0.1)  # 14 N s/m, as above
# At this overlap Hertz's law is rounded off by 0.5e-14 R* / d = 8e-14 of itself.
ROUNDED = 4e-13


@jax.jit
def grip(stretch, slip, overlap=OVERLAP, normal_force=10.0, **changes):
    """Force and memory as arrays, (3,) each."""
    force, kept = tangential.tangential_force(
        tuple(jnp.asarray(stretch, float)),
        tuple(jnp.asarray(slip, float)),
        jnp.asarray(overlap, float),
        jnp.asarray(normal_force, float),
        **{**PAIR, **changes},
    )
    return jnp.stack(force), jnp.stack(kept)


def test_a_sticking_contact_is_a_spring_with_a_dashpot():
    stretch, slip = 0.1 * ALONG, 0.1 * ACROSS
    force, kept = grip(stretch, slip)
    np.testing.assert_allclose(force, -STIFFNESS * stretch, rtol=ROUNDED)
    np.testing.assert_array_equal(kept, stretch)
    force, kept = grip(stretch, slip, **DAMPED)
    np.testing.assert_allclose(force, -STIFFNESS * stretch - 14.0 * slip, rtol=ROUNDED)
    np.testing.assert_array_equal(kept, stretch)


def test_a_sliding_contact_bears_the_limit_and_remembers_no_more():
    # mu F_n = 5 N is borne by a spring of 24 N/m at 5/24 m.
    force, kept = grip(0.7 * ALONG, ACROSS)
    np.testing.assert_allclose(force, -5.0 * ALONG, rtol=ROUNDED)
    np.testing.assert_allclose(kept, 5 / 24 * ALONG, rtol=ROUNDED)
    # With a dashpot, the direction is that of both together.
    force, kept = grip(0.7 * ALONG, ACROSS, **DAMPED)
    both = 5.0 * ALONG + 14.0 * ACROSS
    np.testing.assert_allclose(force, -5.0 * both / length(both), rtol=ROUNDED)
    np.testing.assert_allclose(kept, 5 / 24 * ALONG, rtol=ROUNDED)


def test_a_dashpot_alone_may_slide():
    """The spring bears 2.4 N, both together sqrt(2.4^2 + 14^2) N: the memory stays."""
    force, kept = grip(0.1 * ALONG, ACROSS, **DAMPED)
    both = 2.4 * ALONG + 14.0 * ACROSS
    np.testing.assert_allclose(force, -5.0 * both / length(both), rtol=ROUNDED)
    np.testing.assert_array_equal(kept, 0.1 * ALONG)


@settings(deadline=None)  # the first call compiles
@given(
    stretch=vectors,
    slip=vectors,
    scale=st.sampled_from([1e-6, 1e-2, 1.0, 1e3]),
    overlap=st.floats(1e-6, 0.5),
    push=st.sampled_from([0.0, 1e-9]) | st.floats(0.01, 100.0),
    mu=st.sampled_from([0.0, 1e-9]) | st.floats(0.01, 2.0),
    damping=st.sampled_from([0.0, 0.1, 3.0]),
)
def test_coulombs_limit_and_the_direction(stretch, slip, scale, overlap, push, mu, damping):
    stretch, slip = scale * stretch, scale * slip
    damped = dict(dissipation=damping, damping=damping)
    force, kept = grip(stretch, slip, overlap, push, friction=mu, **damped)
    limit, spring = mu * push, float(tangential.stiffness(3.0, 4.0, overlap))
    more = 1 + ROUNDED + 2e-14 / overlap  # rounding off of the spring at small overlap
    assert length(force) <= limit * more
    assert spring * length(kept) <= limit * more
    # The memory lies along the trial displacement, and is either all of it or at the limit.
    np.testing.assert_allclose(np.cross(kept, stretch), 0.0, atol=1e-15 * scale**2)
    assert kept @ stretch >= 0.0
    if length(kept) < length(stretch) * (1 - 1e-12):
        assert spring * length(kept) == pytest.approx(limit, rel=1e-12 + 2e-14 / overlap, abs=0.0)
    # The force opposes what spring and dashpot bear.
    coefficient = float(tangential.damping_coefficient(3.0, 4.0, 5.0, overlap, damping, damping))
    borne = spring * kept + coefficient * slip
    assert force @ borne <= 0.0
    np.testing.assert_allclose(
        np.cross(force, borne), 0.0, atol=4e-14 / overlap * length(force) * length(borne)
    )
    alone, _ = grip(STILL, slip, overlap, push, friction=mu, **damped)
    assert alone @ slip <= 0.0
    if damping and mu * push > 1e-3 and length(slip) > 1e-6:
        assert alone @ slip < 0.0


@pytest.mark.parametrize("damped", [{}, DAMPED], ids=["spring", "spring and dashpot"])
@pytest.mark.parametrize("share", [0.0, 0.5, 0.99])
def test_continuous_where_sticking_turns_into_sliding(share, damped):
    """Along a path whose trial force, `share` of it the dashpot's, passes the limit of 5 N."""
    coefficient = 14.0 if damped else 0.0
    slip = share * 5.0 / 14.0 * ALONG
    at_limit = (5.0 - coefficient * share * 5.0 / 14.0) / STIFFNESS
    (before, kept_before), (after, kept_after) = (
        grip(at_limit * (1 + side * 1e-9) * ALONG, slip, **damped) for side in (-1, 1)
    )
    # 2e-9 of the spring's 5 N, and of its stretch.
    np.testing.assert_allclose(before, after, atol=1.1e-8)
    np.testing.assert_allclose(kept_before, kept_after, atol=5e-10)
    assert length(before) < length(after) * (1 - 1e-12) or share > 0.98
    np.testing.assert_allclose(length(after), 5.0, rtol=ROUNDED)


@pytest.mark.parametrize("overlap", [0.0, -1e-12, -0.3])
def test_apart_there_is_no_force_and_no_memory(overlap):
    force, kept = grip(ALONG, ACROSS, overlap, 0.0, **DAMPED)
    assert (force == 0).all() and (kept == 0).all()


def test_a_contact_that_bears_nothing_remembers_nothing():
    """A separation so fast that the damped normal force has ended before the overlap."""
    force, kept = grip(0.1 * ALONG, ACROSS, OVERLAP, 0.0, **DAMPED)
    assert (force == 0).all() and (kept == 0).all()
    force, kept = grip(0.1 * ALONG, ACROSS, friction=0.0, **DAMPED)
    assert (force == 0).all() and (kept == 0).all()


@pytest.mark.parametrize("dtype", [float, jnp.float32])
@pytest.mark.parametrize("before", [False, True], ids=["now", "in the step before"])
def test_a_spring_that_has_yielded_grips_alike_compiled_and_not(before, dtype):
    """Without a dashpot it bears the limit to the rounding, and is measured against it once more.

    However a compiler rounds that comparison, and wherever it copies it to, no component is cut.
    """
    random = np.random.default_rng(0)
    count = 4000
    overlap, push = random.uniform(0.01, 0.5, count), random.uniform(0.1, 10.0, count)
    direction = random.normal(size=(3, count))
    direction /= np.linalg.norm(direction, axis=0)
    at_limit = PAIR["friction"] * push / np.asarray(tangential.stiffness(3.0, 4.0, overlap))
    stretch, slip = 1.3 * at_limit * direction, random.normal(size=(3, count))

    def grips(stretch, slip, overlap, push):
        """Components of force and memory, apart as in a run: each is compiled for itself."""
        force, kept = tangential.tangential_force(stretch, slip, overlap, push, **PAIR)
        return *force, *kept

    stretch, slip = (tuple(jnp.asarray(part, dtype) for part in of) for of in (stretch, slip))
    overlap, push = (jnp.asarray(of, dtype) for of in (overlap, push))
    if before:
        stretch = grips(stretch, slip, overlap, push)[3:]
    plain, compiled = (of(stretch, slip, overlap, push) for of in (grips, jax.jit(grips)))
    rounding = 45 * float(jnp.finfo(dtype).eps)  # some ten of them; 1e-14 in double precision
    for found, expected in zip(compiled, plain, strict=True):
        np.testing.assert_allclose(found, expected, rtol=rounding, atol=0)
    for found in (plain, compiled):
        force = np.linalg.norm(np.asarray(found[:3], float), axis=0)
        np.testing.assert_allclose(force, PAIR["friction"] * np.asarray(push, float), rtol=rounding)


# --- work -----------------------------------------------------------------------------------------


@jax.jit
def along(path, time_step, damping):
    """Forces of a contact dragged along displacements (n, 3) from the first, and the memories."""

    def step(stretch, change):
        force, kept = grip(
            stretch + change, change / time_step, dissipation=damping, damping=damping
        )
        return kept, (force, kept)

    return lax.scan(step, jnp.zeros(3), jnp.diff(path, axis=0))[1]


def test_hysteresis_of_a_sliding_cycle():
    """To and fro by +-A: 4 mu F_n (A - mu F_n / K_t) is lost in every cycle."""
    farthest, yields = 16 / 24, 5 / 24
    path = to_and_fro(farthest)
    force = np.asarray(along(path[:, None] * ALONG, 1.0, 0.0)[0] @ ALONG)
    work = work_of_a_cycle(force, path)
    assert work == near(-4 * 5.0 * (farthest - yields), rel=1e-12)


def test_an_elastic_cycle_loses_nothing():
    turn = np.linspace(0.0, 2 * np.pi, 2001)[:, None]
    path = 0.05 * ((1 - np.cos(turn)) * ALONG + np.sin(turn) * ACROSS)  # within 0.1 < 5/24 m
    force, kept = along(path, 1.0, 0.0)
    np.testing.assert_allclose(kept[-1], 0.0, atol=1e-15)
    mean = 0.5 * (force[1:] + force[:-1])
    work = float(jnp.sum(mean * np.diff(path, axis=0)[1:]))
    assert abs(work) < 1e-4 * 0.5 * STIFFNESS * 0.1**2  # the first of 2000 steps left out


@settings(deadline=None)
@given(steps, st.sampled_from([0.01, 0.1, 0.5]), st.sampled_from([0.0, 0.05, 1.0]))
def test_closed_cycles_dissipate(steps, size, damping):
    """Along any closed path; the force of each step acts along it, as in a run."""
    path = closed_path(steps, size)
    force, kept = along(path, 0.1, damping)
    work = float(jnp.sum(force * np.diff(path, axis=0)))
    stored = 0.5 * STIFFNESS * float(kept[-1] @ kept[-1])
    # What the spring still holds has been put in as well. Rounding of 25 terms.
    assert work + stored <= 1e-12 * size * 5.0


# --- derivatives ----------------------------------------------------------------------------------


def law(point):
    """Normal and tangential law together, as in a run; force and memory, (6,)."""
    closing, modulus, shear_modulus, radius, mass, mu, dissipation, along, damping = point[7:]
    overlap = point[6]
    push = normal.normal_force(overlap, closing, modulus, radius, mass, dissipation, damping)
    force, kept = tangential.tangential_force(
        tuple(point[:3]),
        tuple(point[3:6]),
        overlap,
        push,
        shear_modulus=shear_modulus,
        radius=radius,
        mass=mass,
        friction=mu,
        dissipation=along,
        damping=damping,
    )
    return jnp.stack([*force, *kept])


GLASS = (0.005, 1.0, 25e9, 5.6e9, 0.005, 0.0059, 1e-6)
REDUCED = (1.0, 0.01, 2.0, 1.5, 0.5, 2.0, 0.3)  # as within a run


def points(units, dtype):
    """Apart, touching, overlapping; without stretch, slip, friction or damping; stick and slide."""
    size, speed, *pair, time = units
    # Rounding of positions leaves no smaller overlap than eps.
    resolved = (d for d in (1e-15, 1e-14, 1e-10, 1.2e-7, 1e-3, 0.11) if d > jnp.finfo(dtype).eps)
    overlaps = (-1.0, -1e-7, 0.0, *resolved)
    kinds = product(
        (0.0, 1e-12, 1e-4, 1.0), (0.0, 1e-9, 1.0), overlaps, (-1, 0, 1), (0.0, 0.4), (0, 1)
    )
    rows = []
    for stretch, slip, overlap, closing, mu, damped in kinds:
        motion = (*stretch * size * ALONG, *slip * speed * BETWEEN, overlap * size, closing * speed)
        rows.append((*motion, *pair, mu, damped * time, damped * time, 0.4 * damped))
    return jnp.asarray(np.array(rows), dtype)


DERIVATIVES = derivatives(law)


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


# stretch, slip (m/s), closing (m/s), friction, A, B and z: of every kind, away from the switches
KINDS = {
    "sticking": (1e-3, 1e-4, 0.01, 0.4, 0.3, 0.2, 0.3),
    "resting": (1e-3, 0.0, 0.0, 0.4, 0.0, 0.0, 0.0),
    "sliding": (0.1, 0.01, 0.01, 0.4, 0.3, 0.2, 0.3),
    "sliding on the dashpot": (1e-3, 0.1, 0.01, 0.4, 0.3, 0.2, 0.3),
    "opening": (0.1, 0.01, -0.005, 0.4, 0.3, 0.2, 0.3),
}


def test_gradients_are_central_differences():
    at = jnp.array(
        [
            [*stretch * ALONG, *slip * BETWEEN, 0.02, closing, 2.0, 1.5, 0.5, 2.0, mu, a, b, z]
            for stretch, slip, closing, mu, a, b, z in KINDS.values()
        ]
    )
    held = kept_share(law, at)
    np.testing.assert_array_less(held[[2, 4]], 0.9)  # those that slide
    np.testing.assert_allclose(held[[0, 1, 3]], 1.0, rtol=EXACT)
    check_central_differences(DERIVATIVES, at)


def test_without_a_dashpot_the_shorter_program_is_the_same():
    """Force, memory and first derivatives, in contact and apart, sticking and sliding."""

    def grips(point, damped):
        law = {**PAIR, "friction": point[8], "damped": damped}
        return jnp.stack(
            sum(tangential.tangential_force(point[:3], point[3:6], point[6], point[7], **law), ())
        )

    kinds = product((0.0, 1e-4, 0.1, 1.0), (0.0, 1.0), (-0.3, 0.0, 0.25), (0.0, 10.0), (0.0, 0.5))
    at = jnp.array([[*(a * ALONG), *(b * BETWEEN), *others] for a, b, *others in kinds])
    for of in (grips, jax.jacfwd(grips), jax.jacrev(grips)):
        short, whole = (
            np.asarray(jax.jit(jax.vmap(lambda point, of=of, damped=damped: of(point, damped)))(at))
            for damped in (False, True)
        )
        # Roundings; the whole cuts what has just yielded to the limit once more.
        np.testing.assert_allclose(short, whole, rtol=1e-13, atol=1e-13 * np.abs(whole).max())


def test_the_derivative_with_respect_to_friction_where_there_is_none():
    """From mu = 0 upwards, -F_n along what the spring would bear: a fit may start there."""
    for of in (jax.jacfwd, jax.jacrev):
        slope = of(lambda mu: grip(0.1 * ALONG, STILL, friction=mu)[0])(0.0)
        np.testing.assert_allclose(slope, -10.0 * ALONG, rtol=ROUNDED)
