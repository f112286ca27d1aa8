"""Coefficients of a pair force as operands of the sum over pairs: equal, by kind or by pair."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core.parameters import Parameters
from mrjax.dem.forces.force import PairForce
from mrjax.dem.pairs import Pairs
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.particle import CoatedParticle
from mrjax.laws.vectors import Vector


@dataclass(frozen=True)
class CoefficientArrays:
    """A force and its coefficients on all pairs of a list, in as few arrays as hold them.

    What is equal for all pairs is one number. Where all particles are alike, what differs has one
    value for two particles and one for a particle at a wall; otherwise one for every pair.
    """

    shared: list[Array]
    """By kind where particles are alike, and then what is equal for all."""
    by_pair: Array | None
    """(C, P)."""
    kinds: int
    """Number of arrays by kind."""
    differing: tuple[int, ...]
    """Leaves of the coefficients that differ between pairs."""
    structure: Any
    """Tree of the coefficients."""
    numbers: tuple[bool, ...]
    """Leaves of the force itself: True for one number, which is equal for all pairs."""
    force: Any
    """Tree of the force."""

    @staticmethod
    def of_pairs(
        force: PairForce,
        parameters: Parameters,
        coated: CoatedParticle,
        material: Array | None,
        pairs: Pairs,
    ) -> "CoefficientArrays":
        """The coefficients of the pairs of a list.

        Args:
          force: in the system of units of the parameters.
          parameters: in one coherent system of units.
          coated: the coated particles.
          material: of each particle, (N,); None where all are of one.
          pairs: the list.
        """
        alike = force.alike(parameters, material)
        surfaces = SurfacePairs(*pairs.surfaces, material, coated)
        if alike:
            walled = pairs.wall is not None
            anyone = jnp.zeros(1 + walled, jnp.int32)
            wall = np.array([False, True]) if walled else None
            surfaces = SurfacePairs(anyone, anyone, wall, None, coated)
        leaves, structure = jax.tree.flatten(force.coefficients(parameters, surfaces))
        own, tree = jax.tree.flatten(force)
        numbers = tuple(jnp.ndim(leaf) == 0 for leaf in own)
        differing = tuple(n for n, leaf in enumerate(leaves) if jnp.ndim(leaf))
        dtype = parameters.radius.dtype
        equal = [leaf for leaf in leaves if not jnp.ndim(leaf)]
        equal += [leaf for leaf, number in zip(own, numbers, strict=True) if number]
        equal += [] if jnp.ndim(coated.radius) else [coated.radius]
        rows = jnp.stack([jnp.asarray(leaves[n], dtype) for n in differing]) if differing else None
        by_kind = list(rows.T) if alike and rows is not None else []
        together = [jnp.stack([jnp.asarray(leaf, dtype) for leaf in equal])] if equal else []
        return CoefficientArrays(
            [*by_kind, *together],
            None if alike else rows,
            len(by_kind),
            differing,
            structure,
            numbers,
            tree,
        )

    def of_pair(
        self, shared: Sequence[Vector], own: Vector | None, axis: Array
    ) -> tuple[PairForce, Any]:
        """The force and its coefficients for one pair.

        Args:
          shared, own: its scalars of `shared` and `by_pair`.
          axis: of a wall's normal, 0 to 2; -1 where both are particles.
        """
        values = own or ()
        if self.kinds:
            particles, *wall = shared[: self.kinds]
            values = particles
            if wall:
                values = [
                    jnp.where(axis < 0, value, at_wall)
                    for value, at_wall in zip(particles, *wall, strict=True)
                ]
        by_leaf = dict(zip(self.differing, values, strict=True))
        equal = iter(shared[self.kinds]) if len(shared) > self.kinds else iter(())
        leaves = [
            by_leaf[n] if n in by_leaf else next(equal) for n in range(self.structure.num_leaves)
        ]
        force = self.force.unflatten([next(equal) if one else None for one in self.numbers])
        return force, self.structure.unflatten(leaves)

    def equal_radius(self, shared: Sequence[Vector]) -> Array:
        """The radius of every particle, where all are equal."""
        return shared[self.kinds][-1]
