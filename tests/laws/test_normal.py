"""The normal contact: Son 2018, Eqs. 4-6 and 25, Hertz' impacts, and restitution."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

import mrjax
from mrjax.laws import closed_forms, normal

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
DRY = dict(fluid_density=0.0, viscosity=0.0, gravity=0.0)

# Chung & Ooi (2011), tests 1 and 2: two glass spheres head-on, an aluminium one on a rigid wall.
GLASS = dict(radius=0.01, particle_density=2800.0, elastic_modulus=48e9, poisson_ratio=0.2)
ALUMINIUM = dict(radius=0.1, particle_density=2699.0, elastic_modulus=70e9, poisson_ratio=0.3)
GLASS_MASS = 4 / 3 * np.pi * 0.01**3 * 2800.0
PAIR = (48e9 / (2 * 0.96), 0.005, GLASS_MASS / 2)  # E*, R*, m*
WALL = (70e9 / 0.91, 0.1, 4 / 3 * np.pi * 0.1**3 * 2699.0)
HERTZ = 4 / 3 * PAIR[0] * np.sqrt(PAIR[1])  # k of the glass pair, N/m^1.5


def dry(material, **contact_parameters):
    return mrjax.Parameters(**material, **DRY, **contact_parameters).astype(float)


# --- the elastic law -------------------------------------------------------------------------


def test_effective_modulus_and_radius():
    assert normal.effective_modulus(48e9, 0.2, 48e9, 0.2) == near(25e9, rel=EXACT)
    # (1 - 0.25) / 3 + (1 - 0.36) / 4 = 0.25 + 0.16
    assert normal.effective_modulus(3.0, 0.5, 4.0, 0.6) == near(1 / 0.41, rel=EXACT)
    assert normal.harmonic(2.0, 3.0) == near(1.2, rel=EXACT)


def test_a_rigid_wall_leaves_the_particle_its_modulus():
    wall = jnp.asarray(jnp.inf)
    assert normal.effective_modulus(48e9, 0.2, wall, 0.0) == near(50e9, rel=EXACT)
    slopes = jax.grad(normal.effective_modulus, (0, 1, 2, 3))(48e9, 0.2, wall, 0.0)
    # E* = E / (1 - nu^2), whatever the wall: 1 / 0.96 and 2 * 0.2 * 48e9 / 0.96^2.
    expected = [1 / 0.96, 0.4 * 48e9 / 0.96**2, 0.0, 0.0]
    np.testing.assert_allclose(np.array(slopes), expected, rtol=EXACT)


def test_hertz_force_and_its_stiffness():
    # 4/3 * 9 * sqrt(4) * 0.25^1.5 = 3 and 2 * 9 * sqrt(4 * 0.25) = 18.
    assert closed_forms.hertz_force(9.0, 4.0, 0.25) == near(3.0, rel=EXACT)
    assert normal.stiffness(9.0, 4.0, 0.25) == near(18.0, rel=EXACT)
    overlap = jnp.array([1e-9, 1e-7, 1e-5, 1e-3]) * PAIR[1]
    force, slope = jax.vmap(
        jax.value_and_grad(lambda overlap: normal.normal_force(overlap, 0.0, *PAIR))
    )(overlap)
    # Rounding off takes 0.5e-14 R* / overlap of the force and as much of the slope: 5e-6 at 1e-9.
    for of, exact in (
        (force, HERTZ * overlap**1.5),
        (slope, normal.stiffness(*PAIR[:2], overlap)),
    ):
        np.testing.assert_array_less(np.abs(of / exact - 1), 0.5e-14 * PAIR[1] / overlap + EXACT)


def test_rounding_off_is_as_small_as_stated():
    overlap = 1e-7 * PAIR[1]
    change = 1.0 - float(normal.normal_force(overlap, 0.0, *PAIR)) / (HERTZ * overlap**1.5)
    assert 0 < change < 5.0e-8


# --- no attraction, no energy gained, no infinite derivative ------------------------------------

numbers = st.floats(-1.0, 1.0)
positive = st.floats(0.0, 10.0)


@settings(deadline=None)  # the first call compiles
@given(numbers, numbers, positive, positive)
def test_never_tensile_and_dissipative(overlap, speed, dissipation, damping):
    overlap, speed = 1e-3 * PAIR[1] * overlap, 100.0 * speed
    arguments = (*PAIR, 1e-5 * dissipation, damping)
    approach, rest, separation = (
        float(normal.normal_force(overlap, v, *arguments)) for v in (abs(speed), 0.0, -abs(speed))
    )
    assert 0.0 <= separation <= rest <= approach
    if overlap <= 0.0:
        assert approach == 0.0
    elif overlap > 1e-12 and abs(speed) > 1e-6 and dissipation + damping > 1e-3:
        assert separation < rest < approach


def test_damped_forces():
    overlap, speed = 1e-4, 2.0
    elastic = HERTZ * overlap**1.5
    # Eq. 4 and Tsuji's damping. Rounding off takes 0.75e-14 R* / overlap: 4e-13.
    by_a = normal.normal_force(overlap, speed, *PAIR, 1e-5)
    assert by_a == near(elastic * (1 + 1e-5 * speed / overlap), rel=1e-12)
    by_damping = normal.normal_force(overlap, speed, *PAIR, 0.0, 0.3)
    viscous = 0.3 * np.sqrt(5 * PAIR[2] * HERTZ) * overlap**0.25 * speed
    assert by_damping == near(elastic + viscous, rel=1e-12)


def points(units, dtype):
    """Apart, touching, overlapping; leaving, at rest, approaching; with either damping."""
    length, speed, modulus, radius, mass, time = units
    overlaps = (
        np.array([-1, -1e-7, -1e-30, 0, 1e-30, 1e-20, 1e-14, 1e-10, 1e-7, 1e-3, 0.1]) * length
    )
    grid = np.meshgrid(
        overlaps, [-speed, 0.0, speed], modulus, radius, mass, [0.0, time], [0.0, 0.4, 2.0]
    )
    return jnp.asarray(np.stack([axis.ravel() for axis in grid], axis=1), dtype)


SI = (PAIR[1], 1.0, *PAIR, 1e-6)
REDUCED = (1.0, 0.01, 2.0, 0.5, 2.0, 0.3)  # as within a run


def force(point):
    return normal.normal_force(*point)


@pytest.mark.parametrize("units, dtype", [(SI, float), (REDUCED, float), (REDUCED, jnp.float32)])
def test_first_and_second_derivatives_are_finite_everywhere(units, dtype):
    at = points(units, dtype)
    derivatives = {
        "value": force,
        "grad": jax.grad(force),
        "forward": jax.jacfwd(force),
        "hessian": jax.hessian(force),
        "reverse over reverse": jax.jacrev(jax.jacrev(force)),
    }
    apart = at[:, 0] < 0
    for name, law in derivatives.items():
        found = jax.jit(jax.vmap(law))(at)
        assert found.dtype == at.dtype
        assert jnp.isfinite(found).all(), name
        assert (found[apart] == 0).all(), name
    assert (force(at[at[:, 0] == 0].T) == 0).all()


def test_gradients_are_central_differences():
    # Approach, rest and a separation that does not end the contact.
    at = jnp.array([[0.02, v, 2.0, 0.5, 2.0, 0.3, 0.4] for v in (0.01, 1e-3, -0.005)])
    assert (force(at.T) > 0).all()
    step = 1e-6 * jnp.maximum(jnp.abs(at), 1e-3)
    gradient = jax.vmap(jax.grad(force))(at)
    for axis in range(7):
        change = jnp.zeros_like(at).at[:, axis].set(step[:, axis])
        central = (force((at + change).T) - force((at - change).T)) / (2 * step[:, axis])
        # Rounding of F over the step: 1e-16 * 0.06 / 1e-9.
        np.testing.assert_allclose(gradient[:, axis], central, rtol=1e-7, atol=2e-8)


# --- restitution ----------------------------------------------------------------------------------


def rebound(law, speed, depth):
    """Rebound over impact speed of the glass pair; `law` gives the force from overlap and speed.

    In units of the depth of the elastic impact. The contact ends where the force does.
    """

    def motion(_, state):
        return state[1], -law(depth * abs(state[0]), speed * state[1]) * depth / (
            PAIR[2] * speed**2
        )

    def no_force(_, state):
        # Less a factor overlap^(1/4), with which the force of the damping rises at first touch.
        overlap = state[0]
        force = law(depth * overlap, speed * state[1]) if overlap > 0 else 0.0
        return force / overlap**0.25 if overlap > 0 else overlap

    no_force.terminal, no_force.direction = True, -1
    start = [1e-12, 1.0]
    path = solve_ivp(
        motion, (0, 1e3), start, "DOP853", events=no_force, rtol=1e-9, atol=1e-12, max_step=0.5
    )
    assert path.status == 1
    return -path.y[1, -1]


def rebound_by_damping(damping, speed):
    def tsuji(overlap, closing):
        viscous = damping * np.sqrt(5 * PAIR[2] * HERTZ) * overlap**0.25 * closing
        return HERTZ * overlap**1.5 + viscous

    return rebound(tsuji, speed, float(normal.impact_overlap(*PAIR, speed)))


@pytest.mark.parametrize(
    "restitution", [0.1, 0.13, 0.14, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1]
)
def test_a_dry_impact_returns_the_restitution(restitution):
    damping = float(normal.damping_ratio(float(restitution)))
    for speed in (0.01, 1.0, 10.0):
        # The solver's tolerance, through the square-root end of the contact.
        assert rebound_by_damping(damping, speed) == near(restitution, rel=1e-4)


def test_the_usual_formulas_would_not():
    """Both nominally 0.5: one exact if contacts could pull, and a polynomial sqrt(2) off."""
    log = np.log(2.0)
    assert rebound_by_damping(log / np.hypot(np.pi, log), 1.0) == pytest.approx(0.550, abs=5e-4)
    polynomial = (4.8218, -18.022, 27.467, -22.348, 11.087, -4.2783, 1.2728)
    damping = np.polyval(polynomial, 0.5) / np.sqrt(5)
    pulling = np.exp(-np.pi * damping / np.sqrt(1 - damping**2))  # d^(5/4) is a damped oscillator
    assert pulling == pytest.approx(0.616, abs=5e-4)
    assert rebound_by_damping(damping, 1.0) > pulling


SEAM = float(np.exp(-2.0))  # where the damping ratio passes 1; a series serves near it


def test_damping_ratio_solves_its_equation():
    e = np.concatenate(
        [
            np.geomspace(1e-4, 0.999, 60),
            SEAM * np.linspace(0.99, 1.01, 10),
            SEAM * np.array([0.9995, 1.0005]),
        ]
    )
    z = np.asarray(normal.damping_ratio(jnp.asarray(e)))
    angle = np.where(z < 1, np.arccos(np.minimum(z, 1)), np.arccosh(np.maximum(z, 1)))
    # The reference loses digits near z = 1, 1e-3 away: 1e-16 / 1e-3.
    np.testing.assert_allclose(2 * z * angle / np.sqrt(np.abs(1 - z**2)), -np.log(e), rtol=1e-11)
    assert normal.damping_ratio(1.0) == 0.0
    assert normal.damping_ratio(SEAM) == near(1.0, rel=EXACT)


def test_derivatives_of_the_damping_ratio():
    e = jnp.array(
        [
            0.05,
            *(SEAM * (1 + x) for x in (-0.01, -0.001, -5e-4, 0, 5e-4, 0.001, 0.01)),
            0.5,
            0.95,
            1.0,
        ]
    )
    value = jax.jit(jax.vmap(normal.damping_ratio))
    slope = jax.jit(jax.vmap(jax.grad(normal.damping_ratio)))
    curvature = jax.jit(jax.vmap(jax.jacfwd(jax.jacfwd(normal.damping_ratio))))
    h = 1e-5 * e
    # h^2 times the third logarithmic derivative, about 10, and rounding over h: 1e-10.
    np.testing.assert_allclose(slope(e), (value(e + h) - value(e - h)) / (2 * h), rtol=1e-8)
    # The slope loses digits near z = 1: a difference of the fourth order takes longer steps.
    far = 100.0 * h
    near_by, beyond = ((slope(e + k * far) - slope(e - k * far)) / (2 * k * far) for k in (1, 2))
    np.testing.assert_allclose(curvature(e), (4.0 * near_by - beyond) / 3.0, rtol=1e-7)
    assert slope(e)[-1] == near(-1 / np.pi, rel=EXACT)  # weak damping: ln e = -pi z
    single = e.astype(jnp.float32)
    np.testing.assert_allclose(value(single), value(e), atol=1e-5)
    # Where the series ends, at 1 - z^2 = 1e-3, single precision leaves 1e-7 / 1e-3 of a difference.
    np.testing.assert_allclose(slope(single), slope(e), rtol=2e-3)


# Restitution of Eq. 4 against A* = A (k / m*)^(2/5) v^(1/5), the only number that matters.
RESTITUTION_OF_A = {
    0.95: 0.04479,
    0.9: 0.09284,
    0.8: 0.20114,
    0.7: 0.33091,
    0.5: 0.69804,
    0.3: 1.39634,
}


def dissipation_at(scaled, speed):
    return scaled * (PAIR[2] / HERTZ) ** 0.4 * speed**-0.2


@pytest.mark.parametrize("restitution, scaled", RESTITUTION_OF_A.items())
def test_restitution_of_the_papers_dissipation(restitution, scaled):
    compiled = jax.jit(normal.normal_force)
    dissipation = dissipation_at(scaled, 3.0)

    def law(overlap, closing):
        return float(compiled(overlap, closing, *PAIR, dissipation))

    depth = float(normal.impact_overlap(*PAIR, 3.0))
    # Five digits of A* give e within 5e-6 * de/dA*, at most 1.
    assert rebound(law, 3.0, depth) == pytest.approx(restitution, abs=1e-5)


# --- through the simulation -----------------------------------------------------------------------


def table(values, elsewhere):
    """Of materials that meet their like alone; the walls last, never met."""
    return np.diag(np.array([*values, elsewhere]) - elsewhere) + elsewhere


def test_rebounds_of_a_simulation():
    """Pairs of many speeds and dampings in one run, which start as they touch."""
    fixed = dissipation_at(RESTITUTION_OF_A[0.7], 1.0)
    pairs = [(1.0, 1.0, dissipation_at(scaled, 1.0), e) for e, scaled in RESTITUTION_OF_A.items()]
    pairs += [(v, 1.0, fixed, None) for v in (0.1, 10.0)]
    pairs += [
        (v, e, 0.0, e) for v, e in ((0.1, 0.5), (1.0, 0.5), (10.0, 0.5), (1.0, 0.9), (1.0, 0.2))
    ]
    speed, restitution, dissipation, expected = zip(*pairs, strict=True)
    speed, (count, radius) = np.array(speed), (len(pairs), GLASS["radius"])
    rows = 0.05 * np.arange(1, count + 1)
    still = np.zeros(count)
    left = np.stack([0.05 + still, rows, 0.05 + still], axis=1)
    right = left + np.array([2 * radius, 0.0, 0.0])
    velocity = np.stack([speed / 2, still, still], axis=1)
    run = mrjax.simulate(
        mrjax.place(
            np.concatenate([left, right]),
            np.concatenate([velocity, -velocity]),
            materials=np.tile(np.arange(count), 2),
        ),
        dry(GLASS, restitution=table(restitution, 1.0), dissipation=table(dissipation, 0.0)),
        mrjax.Box((0.12, 0.05 * (count + 1), 0.1)),
        duration=400e-6,
        time_step=40e-9,
    )
    leaving = np.asarray(run.state.velocity[count:, 0] - run.state.velocity[:count, 0])
    returned = leaving / speed
    # First order in the step where velocities enter the force: 40 ns of some 60 us of contact.
    known = [row for row, e in enumerate(expected) if e is not None]
    np.testing.assert_allclose(returned[known], [expected[row] for row in known], rtol=2e-3)
    slow, fast = returned[6:8]
    assert fast < 0.7 - 0.05 < 0.7 + 0.05 < slow  # A* goes with v^(1/5): 0.63 and 1.58 of itself
    # Momentum is kept to rounding.
    velocity_sum = np.asarray(run.state.velocity[:count] + run.state.velocity[count:])
    assert np.abs(velocity_sum).max() < 1e-12


def test_closed_forms_of_elastic_impacts():
    # To the digits that are printed.
    for contact_of, speed, depth, peak, duration in (
        (PAIR, 20.0, 274.11e-6, 10.697e3, 40.34e-6),
        (WALL, 0.2, 49.72e-6, 11.370e3, 731.6e-6),
    ):
        overlap = float(normal.impact_overlap(*contact_of, speed))
        assert overlap == near(depth, rel=1.1e-4)
        assert closed_forms.hertz_force(*contact_of[:2], overlap) == near(peak, rel=5e-5)
        assert closed_forms.hertz_duration(*contact_of, speed) == near(duration, rel=1.3e-4)
    # The constant is given to six digits.
    factor, _ = quad(lambda s: 8 / 5 * np.sin(s) ** -0.2, 0, np.pi / 2)  # x^(5/2) = sin^2 s
    assert closed_forms.hertz_duration(*PAIR, 3.0) == near(
        factor * float(normal.impact_overlap(*PAIR, 3.0)) / 3.0, rel=2e-6
    )


@pytest.mark.parametrize(
    "material, positions, velocities, depth, duration",
    [
        (GLASS, [[4, 5, 5], [6, 5, 5]], [[10, 0, 0], [-10, 0, 0]], 274.11e-6, 40.34e-6),
        (ALUMINIUM, [[5, 5, 1]], [[0, 0, -0.2]], 49.72e-6, 731.6e-6),
    ],
)
def test_simulated_elastic_impacts(material, positions, velocities, depth, duration):
    """In a box of ten radii, from first touch until just after the last; 400 steps."""
    radius = material["radius"]
    impact = mrjax.place(radius * np.array(positions, float), velocities)
    run = mrjax.simulate(
        impact,
        dry(material),
        mrjax.Box((10 * radius,) * 3),
        duration=1.001 * duration,
        time_step=duration / 400,
    )
    assert run.deepest_overlap * radius == near(depth, rel=5e-3)
    # Back where they touched, at the speed of impact: a contact 0.1 % longer or shorter than this
    # would show. The step, 1/400 of the contact, errs by about its square.
    travel = np.abs(np.asarray(impact.velocity)) * duration
    assert (np.abs(run.state.position - impact.position) <= 1.5e-3 * travel + 1e-12).all()
    np.testing.assert_allclose(run.state.velocity, -impact.velocity, rtol=1e-4, atol=1e-9)
