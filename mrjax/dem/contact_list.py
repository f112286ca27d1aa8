"""Contacts of a state: coordination number, normal forces, and total force on each particle."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.core.state import State
from mrjax.core.tracing import drop_tracers, evaluated_or_none, value_or_none
from mrjax.core.units import Units
from mrjax.dem import contact_history, neighbours, schedule
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.force_bounds import plan_reach
from mrjax.dem.forces import Force, pair_forces
from mrjax.dem.pair_forces import PairForces, PairForceSums, memory_of
from mrjax.dem.pairs import WALL_COUNT, Pairs, list_pairs
from mrjax.dem.plan import EngineSettings, Matter, System
from mrjax.dem.reduced_units import reduced_forces, reduced_parameters, reduced_state
from mrjax.laws import effective, normal, particle


def contact_forces(
    state: State, parameters: Parameters, box: Box, *, forces: Sequence[Force] | None = None
) -> tuple[Array, Array]:
    """Total force and torque on every particle from pair forces, with dissipation and walls.

    The function works under `jit` and `grad` if the state has a contact diameter. In a traced call
    the result is NaN if the particles are packed too densely for the neighbour list.

    Args:
      state: state of the particles; its contact history gives the tangential springs.
      parameters, box: parameters and container of the run.
      forces: forces of the run, of which only the pair forces count;
        those of a run if left out.

    Returns:
      forces, (N, 3) in N, and torques about the centres, (N, 3) in N m.

    Raises:
      InputError: the parameters do not fit the state, an entry of `forces` is not a force, or a
        period of the box is too short for the forces.
    """
    pairs, sums, units = _moment(System.of(state, parameters, box, forces=forces))
    force = units.scale((1, 1, -2)) * sums.force.T
    torque = units.scale((1, 2, -2)) * sums.torque.T
    sound = jnp.where(pairs.overflow == 0, 1.0, jnp.nan).astype(force.dtype)
    return sound * force, sound * torque


def coordination_number(state: State, parameters: Parameters, box: Box) -> Array:
    """Number of particles that each particle touches, walls not counted; (N,).

    The numbers are integers and have no derivative. In a traced call they are -1 if the particles
    are packed too densely for the neighbour list.

    Args:
      state: state of the particles.
      parameters, box: parameters and container of the run.

    Raises:
      InputError: the parameters do not fit the state.
    """
    pairs, sums, _ = _moment(System.of(state, parameters, box))
    touch = sums.deepest > 0.0
    if pairs.wall is not None:
        touch &= ~pairs.wall
    count = touch.astype(jnp.int32)
    return jnp.where(pairs.overflow == 0, pairs.sum_over_pairs(count, count), -1)


class ContactList(NamedTuple):
    """The C contacts of a state, including those with walls."""

    first: np.ndarray
    """Index of the first particle, (C,)."""
    second: np.ndarray
    """Index of the partner, (C,); walls follow from N on: lower and upper x, then y, then z."""
    reach: np.ndarray
    """Vector from the centre of the first particle to that of the second, or to the wall; (C, 3)
    in m."""
    force: np.ndarray
    """Repulsive normal force, dissipation included, without attraction; (C,) in N."""


Touching = ContactList
"""The old name of `ContactList`."""


def normal_forces(state: State, parameters: Parameters, box: Box) -> ContactList:
    """Lists all contacts with their normal forces. It cannot be traced (by `jit` or `grad`).

    The forces are those of Hertz's law with dissipation. Attraction is not subtracted from them.

    Args:
      state: state of the particles.
      parameters, box: parameters and container of the run.

    Raises:
      InputError: the parameters do not fit the state.
    """
    pairs, sums, units = _moment(System.of(state, parameters, box))
    reduced = parameters.reduced(units).astype(state.position.dtype)
    separation = np.stack([np.asarray(part) for part in pairs.separation], axis=1)
    touch = np.asarray(sums.deepest > 0.0)
    velocity = np.asarray(state.velocity) / units.velocity
    walls = np.zeros((WALL_COUNT, 3), velocity.dtype)
    partner_velocity = np.concatenate([velocity, walls])[np.asarray(pairs.second)]
    distance = np.sqrt((separation**2).sum(axis=1))
    approach = (separation * (velocity[np.asarray(pairs.first)] - partner_velocity)).sum(axis=1)
    properties = effective.per_pair(reduced, state.material, *pairs.surfaces)
    force = normal.normal_force(
        sums.deepest,
        jnp.asarray(-approach / np.where(distance > 0.0, distance, 1.0)),
        properties.modulus,
        properties.radius,
        properties.mass,
        properties.dissipation,
        properties.damping,
    )
    return ContactList(
        np.asarray(pairs.first)[touch],
        np.asarray(pairs.second)[touch],
        -units.length * separation[touch],
        units.scale((1, 1, -2)) * np.asarray(force)[touch],
    )


class Moment(NamedTuple):
    """Pairs of a state with their forces, in reduced units."""

    pairs: Pairs
    sums: PairForceSums
    units: Units
    matter: Matter
    state: tuple[Array, Array, Array, ParticleHistory]  # position, velocity, spin, (3, N) each
    settings: EngineSettings


def _moment(system: System) -> tuple[Pairs, PairForceSums, Units]:
    """Pairs of a state, the sums of their forces in reduced units, and these units."""
    pairs, sums, units, *_ = moment_of(system)
    return pairs, sums, units


def moment_of(system: System, stretch: ArrayLike | None = None) -> Moment:
    """Pairs of a state with the sums of their forces, in reduced units.

    In a call that is not traced, the neighbour list is enlarged until it holds every pair.

    Args:
      system: the system at that moment.
      stretch: edges of the container over those of the system's box, as in `Matter`.
    """
    state, parameters, _, box, _ = system
    checks.refuse_bad_parameters(
        parameters, state.particles, state.material, contacts=system.in_contact
    )
    numbers = drop_tracers(parameters)
    radius = evaluated_or_none(particle.outer_radius, numbers)
    diameter = schedule.contact_diameter(state, radius, slack=0.0)
    checks.refuse_close_walls(box, diameter)
    length, reach = diameter / 2, plan_reach(system, numbers)
    units = Units(mass=1000.0 * length**3, length=length, time=length)
    matter = Matter(
        reduced_parameters(parameters, units, state),
        state.material,
        None,
        reduced_forces(system.forces, units, state),
        None if stretch is None else jnp.asarray(stretch, state.position.dtype),
    )
    plan = schedule.plan_neighbour_list(
        state, radius, box, diameter, skin=0.0, reach=max(reach, default=0.0)
    )
    checks.refuse_short_period(box, state.particles, plan.cutoff * length)
    settings = EngineSettings(
        box=box.scaled(1 / units.length),
        neighbour_list=plan,
        steps=1,
        reach=tuple(gap / length for gap in reach),
        trajectory=False,
    )
    while True:
        slots = settings.neighbour_list.capacity + 2 * len(box.walled_axes)
        moment = reduced_state(state, units, slots, memory_of(matter.forces))
        pairs, sums = _exerted(*moment, matter, settings=settings)
        overflow = value_or_none(pairs.overflow)
        if overflow is None or not overflow:
            return Moment(pairs, sums, units, matter, moment, settings)
        grown = settings.neighbour_list.grown(int(overflow), state.particles)
        settings = replace(settings, neighbour_list=grown)


@partial(jax.jit, static_argnames="settings")
def _exerted(
    position: Array,
    velocity: Array,
    spin: Array,
    history: ParticleHistory,
    matter: Matter,
    *,
    settings: EngineSettings,
) -> tuple[Pairs, PairForceSums]:
    """Pairs of a state and the sums of their forces, in reduced units; one compiled program."""
    plan, box, parameters = settings.neighbour_list, settings.box, matter.parameters
    radii = jnp.broadcast_to(particle.outer_radius(parameters), position.shape[1:])
    listed_gap = plan.cutoff - 2.0 * jnp.max(radii)
    around = neighbours.build(plan, box, position.T, matter.stretch)
    pairs = list_pairs(around, box, position, radii, listed_gap, plan.pairs)
    law = PairForces(
        pair_forces(matter.forces),
        parameters,
        reach=settings.reach,
        material=matter.material,
        time_step=0.0,
    )
    sums = law.on(pairs)(
        jnp.zeros_like(position),
        velocity,
        spin,
        contact_history.pairs_from_particles(history, pairs),
        jnp.zeros_like(position, shape=plan.pairs),
        jnp.ones_like(position, shape=2),
    )
    return pairs, sums
