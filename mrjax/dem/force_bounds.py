"""Bounds on forces other than weight and contact, which limit the time step of a run."""

from dataclasses import fields
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import LARGEST
from mrjax.core.errors import InputError
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.core.state import State
from mrjax.core.tracing import drop_tracers, evaluated_or_none
from mrjax.dem.forces import (
    BodyForce,
    Contact,
    Gravity,
    PairForce,
    Particles,
    body_forces,
    pair_forces,
)
from mrjax.dem.kinematics import PairKinematics, ParticleState, pair_kinematics
from mrjax.dem.pair_forces import over_pairs
from mrjax.dem.plan import System
from mrjax.laws import particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.time_scales import ForceBounds
from mrjax.laws.vectors import dot

GAPS = 65
"""Number of gaps at which a pair force is sampled, from the overlap `DEEPEST` to its reach."""
NEAR = 8
"""Number of further gaps, and of overlaps, that are closer to each other near first touch.

There a force of surfaces is steepest, within a range that may be far below `DEEPEST`."""
NEAREST = 1e-3
"""Least of them, over the reach or `DEEPEST`."""
DEEPEST = 0.05
"""Deepest sampled overlap, in radii."""
SAMPLED = 64
"""Largest number of sampled particles; they are evenly spaced in the order of size."""


def force_bounds(system: System, numbers: Parameters, reach: tuple[float, ...]) -> ForceBounds:
    """Bounds on the forces of a system; forces that depend on traced values are left out.

    Args:
      system: the system, in SI.
      numbers: its parameters without tracers.
      reach: reach of each pair force, m.
    """
    stiffness = pair_force = acceleration = 0.0
    for force, gap in zip(pair_forces(system.forces), reach, strict=True):
        if not isinstance(force, Contact):
            greatest = evaluated_or_none(_of_pair, drop_tracers(force), numbers, system.state, gap)
            if greatest is not None:
                stiffness += float(greatest[0])
                pair_force += float(greatest[1])
    for body_force in beside_weight(system):
        known = drop_tracers(body_force), numbers, drop_tracers(system.state)
        fastest = evaluated_or_none(_of_bodies, *known)
        acceleration += 0.0 if fastest is None else float(fastest)
        touching = evaluated_or_none(_of_touching, *known[:2])
        if touching is not None:
            stiffness += float(touching[0])
            pair_force += float(touching[1])
            acceleration += float(touching[2])
    return ForceBounds(stiffness, pair_force, acceleration)


def beside_weight(system: System) -> list[BodyForce]:
    """Body forces other than a weight along z, which the parameters give."""
    return [
        force
        for force in body_forces(system.forces)
        if not isinstance(force, Gravity) or force.vector is not None
    ]


def _of_pair(
    force: PairForce, numbers: Parameters, state: State, reach: float
) -> tuple[Array, Array]:
    """Largest stiffness and force over the sampled gaps.

    Each sampled particle is paired with a copy of itself, with the largest particle of every
    material, since unlike surfaces may attract each other most, and with a wall.
    """
    coated, material, count = particle.coated_particle(numbers), state.material, state.particles
    sizes = np.broadcast_to(coated.radius, count)
    ids = np.argsort(sizes)[np.linspace(0, count - 1, min(count, SAMPLED)).astype(int)]
    blocks = [ids, *(np.full_like(ids, one) for one in _largest_of_materials(sizes, material)), ids]
    partner, own = np.concatenate(blocks), np.tile(ids, len(blocks))
    at_wall = np.arange(len(own)) >= len(own) - len(ids)
    depth = DEEPEST * np.minimum(sizes[own], sizes[partner])
    share = np.linspace(0.0, 1.0, GAPS)[:, None]
    near = np.geomspace(NEAREST, 1.0, NEAR)[:, None]
    gaps = np.concatenate(
        [share * (reach + depth) - depth, near * np.full_like(depth, reach), -near * depth]
    )
    gap, samples = gaps.ravel(), len(gaps)
    first, second, wall = (np.tile(array, samples) for array in (own, partner, at_wall))
    radii = sizes[first], sizes[second]
    coefficients = force.coefficients(
        numbers, SurfacePairs(first, np.where(wall, count, second), wall, material, coated)
    )
    law = force.for_one_pair()

    def at(pair: PairKinematics, own: Any) -> tuple[Array, Array]:
        wrench, _ = law(pair, own, law.blank_memory(pair.overlap), 0.0)
        stiffness = law.stiffness(pair, own, 1.0).normal
        return jnp.asarray(stiffness), jnp.sqrt(dot(wrench.force, wrench.force))

    @jax.jit
    def greatest(gap: Array, radii: tuple[Array, Array], coefficients: Any) -> tuple[Array, ...]:
        still = (jnp.zeros_like(gap),) * 3
        mine, other = (ParticleState(still, still, still, radius, still) for radius in radii)
        along = radii[0] + jnp.where(wall, 0.0, radii[1]) + gap
        pairs = pair_kinematics(mine, other, (along, *still[:2]), jnp.where(wall, 0, -1))
        return tuple(jnp.max(values) for values in over_pairs(at, pairs, coefficients))

    return evaluate_with_numpy(greatest, gap, radii, coefficients)


def _largest_of_materials(sizes: np.ndarray, material: Array | None) -> list[int]:
    """Id of the largest particle of every material; none if all are of one material."""
    if material is None:
        return []
    index = np.asarray(material)
    return [int(np.where(index == one, sizes, 0.0).argmax()) for one in np.unique(index)]


def _of_bodies(force: BodyForce, numbers: Parameters, state: State) -> Array:
    """Largest acceleration by a body force at the start."""
    memory = {name: rows.T for name, rows in state.memory.items()}
    particles = Particles(state.position.T, state.velocity.T, state.spin.T, memory)
    pushed = jnp.asarray(force(numbers, particles).force)
    return jnp.max(jnp.sqrt(jnp.sum(pushed**2, axis=0)) / particle.inertia(numbers))


def _of_touching(force: BodyForce, numbers: Parameters) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
    """Bounds on stiffness, N/m, and force, N, of two touching particles, and its acceleration."""
    stiffness, pair_force = force.between_surfaces(numbers)
    return stiffness, pair_force, pair_force / jnp.min(particle.inertia(numbers))


def plan_reach(system: System, numbers: Parameters) -> tuple[float, ...]:
    """Evaluates the reach of each pair force, m.

    Args:
      system: the system, in SI.
      numbers: its parameters without tracers.

    Raises:
      InputError: a reach is traced, or is not a length.
    """
    return tuple(_reach(force, numbers) for force in pair_forces(system.forces))


def _reach(force: PairForce, numbers: Parameters) -> float:
    name = type(force).__name__
    reach = evaluated_or_none(drop_tracers(force).reach, numbers)
    if reach is None:
        traced = [
            leaf.name
            for leaf in fields(numbers)
            if isinstance(getattr(numbers, leaf.name), jax.core.Tracer)
        ]
        raise InputError(
            f"the reach of {name} is traced by jit or vmap; it fixes the neighbour list: keep "
            f"{' or '.join(traced) or 'the fields of the force'} out of jit and vmap (grad alone "
            "is allowed), or let reach() of a force of your own give a number in m"
        )
    if not 0.0 <= reach <= LARGEST:
        raise InputError(f"the reach of {name} is {reach:g} m: give a length, 0 for contact")
    return float(reach)
