"""Conversion of a run between SI and reduced units; no other module converts them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.quantities import dimension
from mrjax.core.randomness import RandomStream
from mrjax.core.run import Run
from mrjax.core.state import State
from mrjax.core.units import Units
from mrjax.dem import contact_history
from mrjax.dem.contact_history import ParticleHistory, Remembered
from mrjax.dem.engine import Motion, Observed, Outcome
from mrjax.dem.forces import Force, noises, particle_memory
from mrjax.dem.forces.si import in_reduced_units
from mrjax.dem.pair_forces import memory_of
from mrjax.dem.plan import Matter, RunPlan, System
from mrjax.laws import particle


def reduced_state(
    state: State, units: Units, slots: int, memory: Mapping[str, Remembered]
) -> tuple[Array, Array, Array, ParticleHistory]:
    """Converts a state: positions, velocities and spins, (3, N) each, and the contact history.

    Args:
      state: state in SI.
      units: reduced units.
      slots: number S of contacts that each particle can store.
      memory: size and unit of each entry of the contact history, by name.
    """
    history = contact_history.from_state(
        state.contacts,
        state.position,
        slots=slots,
        memory=memory,
        units=units,
    )
    return (
        state.position.T / units.length,
        state.velocity.T / units.velocity,
        state.spin.T * units.time,
        history,
    )


def reduced_memory(state: State, units: Units, forces: Sequence[Force]) -> dict[str, Array]:
    """Converts the values that forces remember of each particle; (3, N) or (N,), by name.

    Values that the state does not have are zero; values that no force remembers are left out.
    """

    def rows(name: str, kind: Remembered) -> Array:
        if name in state.memory:
            return state.memory[name].T * (1.0 / units.scale(dimension(kind.unit)))
        shape = (state.particles,) if kind.size == 1 else (kind.size, state.particles)
        return jnp.zeros(shape, state.position.dtype)

    return {name: rows(name, kind) for name, kind in particle_memory(forces).items()}


def memory_in_si(
    memory: Mapping[str, Array], nan_if_faulty: Array, units: Units, forces: Sequence[Force]
) -> dict[str, Array]:
    """Converts the values that forces remember of each particle; (N, 3) or (N,), by name."""
    kinds = particle_memory(forces)
    return {
        name: nan_if_faulty * units.scale(dimension(kinds[name].unit)) * rows.T
        for name, rows in memory.items()
    }


def reduced_parameters(parameters: Parameters, units: Units, state: State) -> Parameters:
    """Converts parameters to reduced units and to the dtype of the state."""
    return parameters.reduced(units).astype(state.position.dtype)


def reduced_forces(forces: Sequence[Force], units: Units, state: State) -> tuple[Force, ...]:
    """Converts forces to reduced units, with coefficients in the dtype of the state."""
    return jax.tree.map(
        lambda leaf: jnp.asarray(leaf, state.position.dtype),
        tuple(in_reduced_units(force, units) for force in forces),
    )


def reduced(system: System, plan: RunPlan) -> tuple[tuple[Any, ...], Matter]:
    """Converts a system to reduced units.

    Returns:
      the initial state, as from `reduced_state`, `reduced_memory` and `random_numbers`, and the
      parameters and forces of the run.
    """
    slots = plan.neighbour_list.capacity + 2 * len(system.box.walled_axes)
    parameters = reduced_parameters(system.parameters, plan.units, system.state)
    forces = reduced_forces(plan.forces(system), plan.units, system.state)
    matter = Matter(parameters, system.state.material, system.hindrance, forces)
    begin = reduced_state(system.state, plan.units, slots, memory_of(matter.forces))
    memory = reduced_memory(system.state, plan.units, matter.forces)
    return (*begin, memory, random_numbers(system)), matter


def random_numbers(system: System) -> RandomStream | None:
    """Random numbers of a system, those of seed 0 by default; None without random forces."""
    if not noises(system.forces):
        return None
    return system.state.random or RandomStream.of_seed(0, system.particles)


def run_in_si(
    system: System,
    matter: Matter,
    end: Motion,
    observed: Observed,
    outcome: Outcome,
    plan: RunPlan,
    nan_if_faulty: Array,
) -> Run:
    """Builds the result of a run, in SI.

    Args:
      system: the system; its state has the materials and the contact diameter of the particles.
      matter: parameters, materials, local drag and forces, in reduced units.
      end: the motion at the end, in reduced units.
      observed: observables at the start and in every frame, (frames + 1, ...), in SI.
      outcome: outcome of the run, in reduced units.
      plan: plan of the run.
      nan_if_faulty: factor on the results: 1, or NaN if the run has a fault, ().
    """
    units, state = plan.units, system.state
    last = replace(
        state,
        position=nan_if_faulty * units.length * end.position.T,
        velocity=nan_if_faulty * units.velocity * end.velocity.T,
        spin=nan_if_faulty / units.time * end.spin.T,
        contacts=contact_history.to_state(
            outcome.history,
            nan_if_faulty,
            memory=memory_of(matter.forces),
            units=units,
        ),
        memory=memory_in_si(end.memory, nan_if_faulty, units, matter.forces),
        random=state.random if end.random is None else end.random,
    )
    radius = particle.outer_radius(matter.parameters)
    times = np.linspace(0.0, plan.duration, plan.schedule.frames + 1)
    return Run(
        times=jnp.asarray(times, state.position.dtype),
        heights=observed.heights,
        mean_velocity=observed.descent,
        mean_speed=observed.speed,
        radius=units.length * per_particle(radius, state.particles),
        state=last,
        deepest_overlap=nan_if_faulty * outcome.overlap,
        coating_overlap=nan_if_faulty * outcome.coating,
        fault=outcome.fault,
        box=system.box,
        time_step=plan.time_step,
        steps=plan.schedule.total,
        trajectory=observed.trajectory,
        rising=particle.rises(matter.parameters),
    )
