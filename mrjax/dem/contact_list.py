"""Contacts at one moment: how many, and what they exert."""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.core.state import State
from mrjax.core.tracing import drop_tracers, evaluated_or_none, value_or_none
from mrjax.core.units import Units
from mrjax.dem import contact_history, neighbours, schedule
from mrjax.dem.contact_history import ParticleHistory
from mrjax.dem.forces import ContactForces, active_laws, contact_law
from mrjax.dem.pairs import WALL_COUNT, Pairs, list_pairs
from mrjax.dem.plan import EngineSettings
from mrjax.dem.reduced_units import reduced_parameters, reduced_state
from mrjax.laws import effective, normal, particle


def contact_forces(state: State, parameters: Parameters, box: Box) -> tuple[Array, Array]:
    """Force and torque of its contacts on every particle, dissipation and walls included.

    Works under `jit` and `grad` where the state brings its contact diameter; NaN where the
    particles of a traced call are packed denser than there is room for.

    Args:
      state: a moment of a run; its contacts remember how far their springs are stretched.
      parameters, box: those of the run.

    Returns:
      forces, (N, 3) in N, and torques about the centres, (N, 3) in N m.

    Raises:
      InputError: parameters that do not fit the state.
    """
    pairs, forces, units = _moment(state, parameters, box)
    force = units.scale((1, 1, -2)) * forces.force.T
    torque = units.scale((1, 2, -2)) * forces.torque.T
    sound = jnp.where(pairs.overflow == 0, 1.0, jnp.nan).astype(force.dtype)
    return sound * force, sound * torque


def coordination_number(state: State, parameters: Parameters, box: Box) -> Array:
    """Number of particles that each particle touches, walls not counted; (N,).

    Whole numbers, without a derivative; -1 where the particles of a traced call are packed denser
    than there is room for.

    Args:
      state: a moment of a run.
      parameters, box: those of the run.

    Raises:
      InputError: parameters that do not fit the state.
    """
    pairs, forces, _ = _moment(state, parameters, box)
    touch = forces.deepest > 0.0
    if pairs.wall is not None:
        touch &= ~pairs.wall
    count = touch.astype(jnp.int32)
    return jnp.where(pairs.overflow == 0, pairs.sum_over_pairs(count, count), -1)


class ContactList(NamedTuple):
    """The C contacts of one moment, those with walls among them."""

    first: np.ndarray
    """Row of a particle, (C,)."""
    second: np.ndarray
    """Row of its partner, or from N on a wall: lower and upper end of x, then y, then z; (C,)."""
    reach: np.ndarray
    """From the centre of the first to that of the second, or to the wall; (C, 3) in m."""
    force: np.ndarray
    """Normal force, dissipation included; (C,) in N."""


Touching = ContactList
"""Its name of before."""


def normal_forces(state: State, parameters: Parameters, box: Box) -> ContactList:
    """Every contact and its normal force. Not for traced calls.

    Args:
      state: a moment of a run.
      parameters, box: those of the run.

    Raises:
      InputError: parameters that do not fit the state.
    """
    pairs, forces, units = _moment(state, parameters, box)
    reduced = parameters.reduced(units).astype(state.position.dtype)
    separation = np.stack([np.asarray(part) for part in pairs.separation], axis=1)
    touch = np.asarray(forces.deepest > 0.0)
    velocity = np.asarray(state.velocity) / units.velocity
    walls = np.zeros((WALL_COUNT, 3), velocity.dtype)
    partner_velocity = np.concatenate([velocity, walls])[np.asarray(pairs.second)]
    distance = np.sqrt((separation**2).sum(axis=1))
    approach = (separation * (velocity[np.asarray(pairs.first)] - partner_velocity)).sum(axis=1)
    properties = effective.per_pair(reduced, state.material, *pairs.surfaces)
    force = normal.normal_force(
        forces.deepest,
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


def _moment(state: State, parameters: Parameters, box: Box) -> tuple[Pairs, ContactForces, Units]:
    """The contacts of a moment and what they exert, in reduced units."""
    checks.require_run_inputs(state, parameters, box)
    checks.refuse_bad_parameters(parameters, state.particles, state.material)
    radius = evaluated_or_none(particle.outer_radius, drop_tracers(parameters))
    diameter = schedule.contact_diameter(state, radius, slack=0.0)
    checks.refuse_close_walls(box, diameter)
    length = diameter / 2
    units = Units(mass=1000.0 * length**3, length=length, time=length)
    reduced = reduced_parameters(parameters, units, state)
    settings = EngineSettings(
        box=box.scaled(1 / units.length),
        neighbour_list=schedule.plan_neighbour_list(state, radius, box, diameter, skin=0.0),
        steps=1,
        laws=active_laws(parameters),
        trajectory=False,
    )
    while True:
        slots = settings.neighbour_list.capacity + 2 * len(box.walled_axes)
        moment = reduced_state(state, units, slots, settings.laws)
        pairs, forces = _exerted(*moment, reduced, state.material, settings=settings)
        overflow = value_or_none(pairs.overflow)
        if overflow is None or not overflow:
            return pairs, forces, units
        grown = settings.neighbour_list.grown(int(overflow), state.particles)
        settings = replace(settings, neighbour_list=grown)


@partial(jax.jit, static_argnames="settings")
def _exerted(
    position: Array,
    velocity: Array,
    spin: Array,
    history: ParticleHistory,
    parameters: Parameters,
    material: Array | None,
    *,
    settings: EngineSettings,
) -> tuple[Pairs, ContactForces]:
    """The pairs of a moment, and what they exert; in reduced units, as one program."""
    plan, box = settings.neighbour_list, settings.box
    radii = jnp.broadcast_to(particle.outer_radius(parameters), position.shape[1:])
    skin = plan.cutoff - 2.0 * jnp.max(radii)
    around = neighbours.build(plan, box, position.T)
    pairs = list_pairs(around, box, position, radii, skin, plan.pairs)
    law = contact_law(parameters, laws=settings.laws, material=material, time_step=0.0)
    forces = law(pairs)(
        jnp.zeros_like(position),
        velocity,
        spin,
        contact_history.pairs_from_particles(history, pairs),
        jnp.zeros_like(position, shape=plan.pairs),
        jnp.ones_like(position, shape=2),
    )
    return pairs, forces
