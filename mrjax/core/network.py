"""The contact network of a packing: which surfaces touch, and with which forces.

`mrjax.contact_network` makes one from a state. The observables of packings are functions of it.
"""

from dataclasses import dataclass, field

import jax
from jax import Array

from mrjax.core.box import Box


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ContactNetwork:
    """P pairs of surfaces within reach of a force; the list may have empty places."""

    first: Array
    """Index of the first particle, (P,)."""
    second: Array
    """Index of the partner, (P,); walls follow from N on: lower and upper x, then y, then z."""
    touching: Array
    """True if the surfaces overlap, (P,); False for a pair apart and for an empty place."""
    centre: Array
    """Centre of the first particle, (P, 3) in m."""
    branch: Array
    """Vector l from the centre of the partner, or from the wall, to that of the first; (P, 3)
    in m."""
    force: Array
    """Force f on the first by the second, (P, 3) in N, by all pair forces; zero in an empty
    place."""
    volume: Array
    """Volume of the container, m^3, ()."""
    particles: int = field(metadata={"static": True})
    """Number of particles, N."""
    box: Box = field(metadata={"static": True})
    """The container."""

    @property
    def between_particles(self) -> Array:
        """True for a contact of two particles, (P,)."""
        return self.touching & (self.second < self.particles)
