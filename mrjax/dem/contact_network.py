"""The contact network of a state: every pair of surfaces with its total force.

    F = sum of all pair forces: normal force, friction, attraction, forces of a user

The compiled loop of a run sums forces over pairs and does not keep them. Here the laws are
evaluated on arrays, pair by pair, at one moment.
"""

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.network import ContactNetwork
from mrjax.core.parameters import Parameters
from mrjax.core.state import State
from mrjax.dem.contact_history import pairs_from_particles
from mrjax.dem.contact_list import Moment, moment_of
from mrjax.dem.forces import Force, PairForce, pair_forces
from mrjax.dem.kinematics import PairKinematics, ParticleState, pair_kinematics
from mrjax.dem.pair_forces import over_pairs
from mrjax.dem.pairs import WALL_COUNT, Pairs
from mrjax.dem.plan import System
from mrjax.laws import particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.vectors import Vector, plus


def contact_network(
    state: State, parameters: Parameters, box: Box, *, forces: Sequence[Force] | None = None
) -> ContactNetwork:
    """All contacts of a state with their forces, attraction and friction included.

    The forces between two surfaces count; those of all particles together, such as weight and
    dipoles, do not. The function works under `jit` and `grad` if the state has a contact diameter;
    derivatives by the parameters are at fixed positions. In a traced call the forces are NaN if the
    particles are packed too densely for the neighbour list.

    Args:
      state: state of the particles; its contact history gives the tangential springs.
      parameters, box: parameters and container of the run.
      forces: forces of the run; those of a run if left out.

    Raises:
      InputError: the parameters do not fit the state, an entry of `forces` is not a force, or a
        period of the box is too short for the forces.

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> state = mrjax.place([[5e-6, 5e-6, 2e-6], [5e-6, 5e-6, 5.99e-6]])
      >>> soft = recipe.parameters().replace(elastic_modulus=1e4)
      >>> network = mrjax.contact_network(state, soft, mrjax.Box((1e-5, 1e-5, 1e-5)))
      >>> int(network.touching.sum())
      1
    """
    return network_of(System.of(state, parameters, box, forces=forces))


def network_of(system: System, stretch: ArrayLike | None = None) -> ContactNetwork:
    """The contact network of a system, as `contact_network`.

    Args:
      system: the system at that moment.
      stretch: edges of the container over those of the system's periodic box, at least 1, (3,).
    """
    moment = moment_of(system, stretch)
    pairs, units = moment.pairs, moment.units
    force = units.scale((1, 1, -2)) * _forces(moment).T
    sound = jnp.where(pairs.overflow == 0, 1.0, jnp.nan).astype(force.dtype)
    stretched = 1.0 if stretch is None else jnp.prod(jnp.asarray(stretch, force.dtype))
    return ContactNetwork(
        pairs.first,
        pairs.second,
        pairs.present & (moment.sums.deepest > 0.0),
        system.state.position[pairs.first],
        units.length * jnp.stack(pairs.separation, axis=1),
        sound * force,
        jnp.asarray(system.box.volume * stretched, force.dtype),
        system.particles,
        system.box,
    )


def _forces(moment: Moment) -> Array:
    """Force on the first surface of each pair, (3, P), in reduced units."""
    position, velocity, spin, history = moment.state
    matter, settings = moment.matter, moment.settings
    return _forces_of_pairs(
        moment.pairs,
        jnp.zeros_like(position),
        velocity,
        spin,
        pairs_from_particles(history, moment.pairs),
        matter.parameters,
        matter.material,
        pair_forces(matter.forces),
        reach=settings.reach,
    )


@partial(jax.jit, static_argnames="reach")
def _forces_of_pairs(
    pairs: Pairs,
    displacement: Array,
    velocity: Array,
    spin: Array,
    history: dict[str, Array],
    parameters: Parameters,
    material: Array | None,
    forces: tuple[PairForce, ...],
    *,
    reach: tuple[float, ...],
) -> Array:
    """Sum of the pair forces on the first surface of each pair, (3, P)."""
    coated = particle.coated_particle(parameters)
    radius = jnp.broadcast_to(coated.radius, displacement.shape[1])
    kinematics = _kinematics(pairs, displacement, velocity, spin, radius)
    surfaces = SurfacePairs(*pairs.surfaces, material, coated)
    nothing = jnp.zeros_like(kinematics.overlap)
    total: Vector = (nothing,) * 3
    for force, gap in zip(forces, reach, strict=True):
        own = force.coefficients(parameters, surfaces), _memory(force, history)
        pushed = over_pairs(partial(_of_pair, force.for_one_pair()), kinematics, own)
        acts = pairs.present & (kinematics.gap < gap)
        total = plus(total, 1.0, tuple(jnp.where(acts, part, 0.0) for part in pushed))
    return jnp.stack(total)


def _of_pair(law: PairForce, pair: PairKinematics, own: tuple) -> Vector:
    """Force on the first surface of one pair; the history does not advance."""
    coefficients, memory = own
    wrench, _ = law(pair, coefficients, memory, 0.0)
    return wrench.force


def _memory(force: PairForce, history: dict[str, Array]) -> dict[str, Array | tuple[Array, ...]]:
    """History of the pairs that a force reads, as it reads it."""
    return {
        name: tuple(history[name]) if kind.size > 1 else history[name]
        for name, kind in force.memory().items()
    }


def _kinematics(
    pairs: Pairs, displacement: Array, velocity: Array, spin: Array, radius: Array
) -> PairKinematics:
    """Kinematics of all pairs at one moment, (P,) each; walls do not move."""

    def with_walls(rows: Array) -> Array:
        walls = jnp.zeros_like(rows, shape=(*rows.shape[:-1], WALL_COUNT))
        return jnp.concatenate([rows, walls], axis=-1)

    moved, speed, turn, size = map(with_walls, (displacement, velocity, spin, radius))

    def vector(rows: Array, ids: Array) -> Vector:
        return rows[0, ids], rows[1, ids], rows[2, ids]

    def surface(ids: Array) -> ParticleState:
        displacement, velocity, spin = (vector(rows, ids) for rows in (moved, speed, turn))
        return ParticleState(displacement, velocity, spin, size[ids], (size[ids],) * 3)

    return pair_kinematics(
        surface(pairs.first), surface(pairs.second), pairs.separation, pairs.axis
    )
