"""How near a bed is to instability: its fastest mode by power iteration, against a dense matrix."""

from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.units import Units
from mrjax.dem import integrator, neighbours, pairs, stability
from mrjax.dem.forces import ActiveLaws, Contact
from mrjax.dem.pair_forces import PairForces, total_stiffness
from mrjax.laws import particle

near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
EXACT = 1e-12  # some ten roundings of numbers of order one
CONVERGED = 1e-5
"""The noise that every call adds, 1e-3 of the mode, counts twice: 1e-6, times what is left of it
after 8 iterations. Modes that are nearly as fast as the fastest hardly change the rate."""

POISSON, RESTITUTION = 0.3, 0.6
BOX = mrjax.Box((6.0, 6.0, 4.6))
DRAG = {"without drag": 0.0, "between": 0.3, "overdamped": 300.0}
"""Viscosities; of 1 kg in a sphere of 1 m at steps of 1 s, alpha dt is 6 pi mu = 0, 6 and 6000."""


def spheres(radius, viscosity, **changes):
    """Of one kg each where the radius is one; the unit of time is a step."""
    leaves = dict(
        radius=radius,
        particle_density=3 / (4 * np.pi),
        fluid_density=0.0,
        viscosity=viscosity,
        gravity=0.0,
        elastic_modulus=0.1,
        poisson_ratio=POISSON,
        friction=0.5,
        restitution=RESTITUTION,
        dissipation=0.2,
        tangential_dissipation=0.3,
    )
    return mrjax.Parameters(**{**leaves, **changes}).astype(float)


def listed_contacts(position, box, parameters):
    """The contacts of a moment, and their overlaps: what a run hands to `swing`."""
    radius = jnp.broadcast_to(particle.outer_radius(parameters), (len(position),))
    largest = float(radius.max())
    plan = neighbours.plan_list(box, len(position), 2 * largest, 2 * largest, 0.2)
    plan = plan.grown(neighbours.PAIRS_DROPPED, len(position))
    listed = _listed(position, radius, plan.cutoff - 2 * largest, plan=plan, box=box)
    assert int(listed.overflow) == 0
    apart = np.sqrt(sum(np.asarray(part) ** 2 for part in listed.separation))
    first, second = np.asarray(listed.first), np.asarray(listed.second)
    sizes = np.append(np.asarray(radius), 0.0)  # a wall has none
    overlap = sizes[first] + sizes[np.minimum(second, len(radius))] - apart
    return listed, jnp.where(listed.present, overlap, -1.0), radius


@partial(jax.jit, static_argnames=("plan", "box"))
def _listed(position, radius, skin, *, plan, box):
    found = neighbours.build(plan, box, position)
    return pairs.list_pairs(found, box, position.T, radius, skin, plan.pairs)


class Depth(NamedTuple):
    """As much of the kinematics as the stiffness of a contact takes."""

    overlap: jax.Array

    @property
    def gap(self):
        return -self.overlap


def stiffness(listed, overlap, parameters, sliding):
    """Springs and dashpots of contacts at an overlap each, at a step of 1."""
    contact = Contact(ActiveLaws(sliding=sliding, rolling=False, damped=True))
    return total_stiffness(PairForces([contact], parameters), listed, Depth(overlap))


@partial(jax.jit, static_argnames=("sliding", "calls"))
def found_by_iteration(listed, overlap, radius, parameters, *, sliding, calls):
    """Rates of `calls` beds in a row, all the same; (calls,)."""
    springs = stiffness(listed, overlap, parameters, sliding)
    kicks = integrator.kick(parameters, 1.0), integrator.spin_kick(parameters, 1.0)

    def again(swing, _):
        swing = stability.estimate_mode(swing, listed, springs, radius, *kicks)
        return swing, swing.rate

    start = stability.initial_estimate(radius.shape[0], radius.dtype)
    return jax.lax.scan(again, start, length=calls)[1]


def compliances(parameters, count):
    """tanh(alpha dt / 2) / gamma of velocity and spin, dt = 1; dt / 2 m and dt / 2 I without."""
    radius = np.broadcast_to(np.asarray(parameters.radius), count)
    mass = np.asarray(parameters.particle_density) * 4 / 3 * np.pi * radius**3
    viscosity = np.asarray(parameters.viscosity)

    def of(resistance, inertia):
        if viscosity == 0.0:
            return 0.5 / inertia
        return np.tanh(resistance / inertia / 2) / resistance

    return (
        of(6 * np.pi * viscosity * radius, mass),
        of(8 * np.pi * viscosity * radius**3, 0.4 * mass * radius**2),
        radius,
        mass,
    )


def of_contact(overlap, radius, mass, at_wall, parameters, sliding):
    """K + 2 c of one contact, normal and tangential, by hand (Son 2018, Eqs. 4 to 8)."""
    modulus, poisson = float(parameters.elastic_modulus), float(parameters.poisson_ratio)
    # A rigid wall gives way by nothing.
    hertz = modulus / (1 - poisson**2) / (1 if at_wall else 2)
    mindlin = modulus / (2 * (2 - poisson) * (1 + poisson)) / (1 if at_wall else 2)
    normal = 2 * hertz * np.sqrt(radius * overlap)
    shear = 8 * mindlin * np.sqrt(radius * overlap) if sliding else 0.0
    # z of -ln e = 2 z arccos(z) / sqrt(1 - z^2), by bisection.
    low, high = 0.0, 1.0
    for _ in range(80):
        z = (low + high) / 2
        less = 2 * z * np.arccos(z) / np.sqrt(1 - z**2) < -np.log(float(parameters.restitution))
        low, high = (z, high) if less else (low, z)
    dashpot = 2 / 3 * normal * float(parameters.dissipation)
    dashpot += low * np.sqrt(10 / 3 * mass * normal)
    drag = shear * float(parameters.tangential_dissipation)
    drag += low * np.sqrt(10 / 3 * mass * shear)
    return normal + 2 * dashpot, shear + 2 * drag


def dense_rate(position, box, parameters, sliding):
    """Half of the largest eigenvalue of Q^1/2 (A + 2 C) Q^1/2, from every pair of surfaces."""
    position = np.asarray(position)
    count = len(position)
    moves, turns, radius, mass = compliances(parameters, count)
    matrix = np.zeros((6 * count, 6 * count))

    def rigid(vector):  # a turn w moves a point at r by w x r
        x, y, z = vector
        return np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])

    def touch(normal, overlap, effective, reduced, sides, at_wall):
        along, across = of_contact(overlap, effective, reduced, at_wall, parameters, sliding)
        stiffness = across * np.eye(3) + (along - across) * np.outer(normal, normal)
        seen = np.zeros((3, 6 * count))
        for sign, i in sides:
            seen[:, 3 * i : 3 * i + 3] = sign * np.eye(3)
            point = -sign * radius[i] * normal
            seen[:, 3 * (count + i) : 3 * (count + i) + 3] = sign * rigid(point)
        return seen.T @ stiffness @ seen

    for i in range(count):
        for axis in box.walled_axes:
            for end in (0.0, box.size[axis]):
                apart = position[i, axis] - end
                if (overlap := radius[i] - abs(apart)) > 0:
                    normal = np.sign(apart) * np.eye(3)[axis]
                    matrix += touch(normal, overlap, radius[i], mass[i], [(1, i)], True)
        for j in range(i):
            apart = position[i] - position[j]
            distance = np.linalg.norm(apart)
            if (overlap := radius[i] + radius[j] - distance) > 0:
                sizes = (of[i] * of[j] / (of[i] + of[j]) for of in (radius, mass))
                matrix += touch(apart / distance, overlap, *sizes, [(1, i), (-1, j)], False)
    root = np.sqrt(np.concatenate([np.repeat(moves, 3), np.repeat(turns, 3)]))
    return 0.5 * np.linalg.eigvalsh(root[:, None] * matrix * root[None, :])[-1]


@cache
def random_bed(unequal):
    """30 spheres at random where they overlap each other and the walls, at most by a third.

    Returns their contacts as well, which no other parameter changes.
    """
    random = np.random.default_rng(3)
    radius = random.uniform(0.7, 1.1, 30) if unequal else np.full(30, 0.9)
    chosen = []
    while len(chosen) < 30:
        size = radius[len(chosen)]
        point = random.uniform(0.75 * size, np.array(BOX.size) - 0.75 * size)
        deep = [
            np.linalg.norm(point - q) < 0.7 * (size + s)
            for q, s in zip(chosen, radius, strict=False)
        ]
        if not any(deep):
            chosen.append(point)
    position = jnp.array(chosen)
    return position, *listed_contacts(position, BOX, spheres(jnp.array(radius), 0.0))


@pytest.mark.parametrize("drag", DRAG)
@pytest.mark.parametrize("unequal", [False, True])
@pytest.mark.parametrize("sliding", [False, True])
def test_the_rate_of_a_random_bed_is_half_its_largest_eigenvalue(sliding, unequal, drag):
    position, listed, overlap, radius = random_bed(unequal)
    parameters = spheres(radius, DRAG[drag])
    # Of some five contacts for each, as in a bed, with each other and with walls.
    at_wall = int(((overlap > 0) & listed.wall).sum())
    assert at_wall > 10 and int((overlap > 0).sum()) - at_wall > 40
    exact = dense_rate(position, BOX, parameters, sliding)
    rates = found_by_iteration(listed, overlap, radius, parameters, sliding=sliding, calls=200)
    # A power iteration never says more than there is, and says about that at once.
    assert rates.max() <= exact * (1 + EXACT)
    assert rates[0] > 0.7 * exact
    assert rates[20] > 0.95 * exact
    assert float(rates[-1]) == near(exact, rel=CONVERGED)


@pytest.mark.parametrize("drag", DRAG)
@pytest.mark.parametrize("sliding", [False, True])
@pytest.mark.parametrize("partner", ["sphere", "wall"])
def test_a_pair_and_a_sphere_on_a_wall_in_closed_form(partner, sliding, drag):
    """A pair bounces with 2 K / m and slides with 7 K_t / m, 3.5 K_t where drag resists."""
    parameters = spheres(1.0, DRAG[drag])
    box = mrjax.Box((20.0, 20.0, 20.0))
    places = {"sphere": [[5.0, 5.0, 5.0], [6.92, 5.0, 5.0]], "wall": [[5.0, 5.0, 0.92]]}
    position = jnp.array(places[partner])
    listed, overlap, radius = listed_contacts(position, box, parameters)
    assert int((overlap > 0).sum()) == 1
    at_wall = partner == "wall"
    effective = 1.0 if at_wall else 0.5
    along, across = of_contact(0.08, effective, effective, at_wall, parameters, sliding)
    moves, turns = (float(of[0]) for of in compliances(parameters, 1)[:2])
    # Both ends give way, with their spins about arms of one radius.
    ends = 1 if at_wall else 2
    exact = 0.5 * ends * max(along * moves, across * (moves + turns))
    if drag == "without drag":
        assert turns / moves == near(2.5, rel=EXACT)
    if drag == "overdamped":
        assert turns / moves == near(0.75, rel=EXACT)
    rates = found_by_iteration(listed, overlap, radius, parameters, sliding=sliding, calls=20)
    assert rates.max() <= exact * (1 + EXACT)
    assert float(rates[-1]) == near(exact, rel=CONVERGED)


def test_where_nothing_touches_every_step_is_stable():
    parameters = spheres(1.0, 0.3)
    position = jnp.array([[5.0, 5.0, 5.0], [7.05, 5.0, 5.0]])
    listed, overlap, radius = listed_contacts(position, mrjax.Box((20.0,) * 3), parameters)
    assert bool(listed.present.any())  # within the skin
    rates = found_by_iteration(listed, overlap, radius, parameters, sliding=True, calls=3)
    assert (rates == 0.0).all()


# --- what a run makes of it -----------------------------------------------------------------------

EDGE, PRESSED = 3, 0.03
"""Spheres along each side of a cube, pressed by its walls until each contact overlaps by this."""


def pressed_cube():
    """A simple cubic lattice in equilibrium between six walls; of 1 m, nudged by 1e-6."""
    pitch = 2 - PRESSED
    grid = np.stack(np.meshgrid(*[np.arange(EDGE)] * 3, indexing="ij"), -1).reshape(-1, 3)
    box = mrjax.Box((EDGE * pitch,) * 3)
    nudge = 1e-6 * np.random.default_rng(0).normal(size=grid.shape)
    # Half the pitch from the walls: overlaps of half of PRESSED there.
    return pitch * (grid + 0.5) + nudge, box


@pytest.mark.parametrize(
    "drag", [pytest.param("without drag", marks=pytest.mark.slow), "overdamped"]
)
def test_a_run_is_refused_above_the_limit_of_its_bed_and_only_there(drag):
    """The limit from the dense matrix; 8 frames, so that the iteration has found the mode."""
    position, box = pressed_cube()
    parameters = spheres(1.0, DRAG[drag], restitution=1.0, dissipation=0.0, friction=0.4)
    parameters = parameters.replace(tangential_dissipation=jnp.asarray(0.0))

    def rate(step):
        reduced = parameters.reduced(Units(mass=1.0, length=1.0, time=step))
        return dense_rate(position, box, reduced, True)

    # Inertial: rate ~ dt^2. Overdamped: rate ~ dt.
    guess = 1.0
    for _ in range(60):
        guess /= rate(guess) ** 0.5
    assert rate(guess) == near(1.0, rel=1e-9)

    def run(step):
        return mrjax.simulate(
            mrjax.place(position),
            parameters,
            box,
            duration=64 * 4 * step,
            frames=8,
            time_step=step,
            rebuild_every=32,
        )

    stable = run(0.8 * guess)
    assert stable.steps == 256 and stable.time_step == near(0.8 * guess, rel=1e-9)
    # The nudge of 1e-6 stays what it was, or is damped; an unstable mode grows by 2 in each step.
    assert jnp.abs(stable.state.position - position).max() < 1e-4
    for factor in (1.05, 1.3):
        with pytest.raises(mrjax.SimulationError, match="stiffer than the step can follow"):
            run(factor * guess)


def test_a_contact_that_has_no_part_in_the_mode_of_before_is_found():
    """Of four particles two touch, long enough for the mode to be theirs alone; then the others."""
    parameters = spheres(1.0, 0.0)
    rates = []
    for gaps in ((1.9, 2.4), (2.4, 1.9)):
        places = [[1.1, 1.5, 2.3], [1.1 + gaps[0], 1.5, 2.3]]
        places += [[1.1, 4.5, 2.3], [1.1 + gaps[1], 4.5, 2.3]]
        rates.append(listed_contacts(jnp.array(places), BOX, parameters))
    swing = stability.initial_estimate(4, jnp.dtype(float))
    kicks = integrator.kick(parameters, 1.0), integrator.spin_kick(parameters, 1.0)

    @jax.jit
    def after(swing, listed, overlap, radius):
        springs = stiffness(listed, overlap, parameters, sliding=True)
        return stability.estimate_mode(swing, listed, springs, radius, *kicks)

    for _ in range(3):
        swing = after(swing, *rates[0])
    alone = float(swing.rate)
    assert alone > 0.0
    for _ in range(3):
        swing = after(swing, *rates[1])
    assert float(swing.rate) == near(alone, rel=1e-3)
