"""The sum of forces on every particle, all but the drag (Son 2018, Eqs. 2 and 19).

The drag is linear in the velocity and integrated exactly by the leapfrog. Arrays are kept apart by
component and by neighbour slot, (K, N): on a CPU that is worth 3 to 4 times over (N, K, 3).
"""

from collections.abc import Callable

import jax.numpy as jnp
from jax import Array

from mrjax import contact, particle
from mrjax.box import Box
from mrjax.neighbours import Neighbours
from mrjax.parameters import Parameters, per_particle

Force = Callable[[Array, Array, Array, Neighbours], tuple[Array, Array]]


def total(parameters: Parameters, box: Box, particles: int) -> Force:
    """The force law of a run, with all that does not change during it computed once.

    Returns:
      force(reference, displacement, velocity, neighbours), the first three (3, N): positions when
      the neighbours were listed, what has been travelled since, and velocities. It gives the
      forces, (3, N), and the deepest overlap as a fraction of the particle's radius, ().
    """
    radius = per_particle(particle.outer_radius(parameters), particles)
    weight = per_particle(particle.net_weight(parameters), particles)
    between_particles = _between_particles(parameters, radius)
    from_walls = _from_walls(parameters, box, radius)

    def force(reference, displacement, velocity, neighbours):
        repulsion, overlap = between_particles(displacement, velocity, neighbours)
        support, wall_overlap = from_walls(reference + displacement, velocity)
        pull = jnp.stack([jnp.zeros_like(weight), jnp.zeros_like(weight), -weight])
        return pull + repulsion + support, jnp.maximum(overlap, wall_overlap)

    return force


def _between_particles(parameters: Parameters, radius: Array):
    inertia = particle.inertia(parameters)
    damping = contact.damping_ratio(parameters.restitution)

    def force(displacement: Array, velocity: Array, neighbours: Neighbours):
        partner, present = neighbours.partner, neighbours.present

        def pair(leaf: Array) -> tuple[Array, Array]:
            return (leaf, leaf) if jnp.ndim(leaf) == 0 else (leaf[None, :], leaf[partner])

        def mean(leaf: Array) -> Array:
            mine, theirs = pair(leaf)
            return 0.5 * (mine + theirs)

        def difference(component: Array) -> Array:
            return component[None, :] - component[partner]

        apart = [
            separation + difference(moved)
            for separation, moved in zip(neighbours.separation, displacement, strict=True)
        ]
        square = sum(component**2 for component in apart)
        distance = jnp.sqrt(jnp.where(present & (square > 0.0), square, 1.0))
        normal = [component / distance for component in apart]
        approach = -sum(
            difference(component) * along for component, along in zip(velocity, normal, strict=True)
        )
        mine, theirs = pair(radius)
        overlap = jnp.where(present, mine + theirs - distance, -mine)
        modulus_i, modulus_j = pair(parameters.elastic_modulus)
        poisson_i, poisson_j = pair(parameters.poisson_ratio)
        size = contact.normal_force(
            overlap,
            approach,
            contact.effective_modulus(modulus_i, poisson_i, modulus_j, poisson_j),
            contact.harmonic(mine, theirs),
            contact.harmonic(*pair(inertia)),
            mean(parameters.dissipation),
            mean(damping),
        )
        deepest = jnp.max(overlap / radius[None, :], initial=0.0)
        return jnp.stack([jnp.sum(size * along, axis=0) for along in normal]), deepest

    return force


def _from_walls(parameters: Parameters, box: Box, radius: Array):
    inertia = particle.inertia(parameters)
    damping = contact.damping_ratio(parameters.restitution)
    modulus = contact.effective_modulus(
        parameters.elastic_modulus,
        parameters.poisson_ratio,
        parameters.wall_elastic_modulus,
        parameters.wall_poisson_ratio,
    )

    def push(overlap: Array, approach: Array) -> Array:
        return contact.normal_force(
            overlap, approach, modulus, radius, inertia, parameters.dissipation, damping
        )

    def force(position: Array, velocity: Array):
        components, deepest = [], jnp.zeros((), position.dtype)
        for axis in range(3):
            if box.periodic[axis]:
                components.append(jnp.zeros_like(radius))
                continue
            near = radius - position[axis]
            far = radius + position[axis] - box.size[axis]
            components.append(push(near, -velocity[axis]) - push(far, velocity[axis]))
            deepest = jnp.maximum(deepest, jnp.max(jnp.maximum(near, far) / radius))
        return jnp.stack(components), deepest

    return force
