"""Coefficients of a pair force, stored once for all pairs, by kind of pair, or by pair."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

from mrjax.core.parameters import Parameters
from mrjax.dem.forces.force import PairForce
from mrjax.dem.pairs import Pairs
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.particle import CoatedParticle
from mrjax.laws.vectors import Vector


@dataclass(frozen=True)
class CoefficientArrays:
    """A force and its coefficients for all pairs of a list, stored compactly.

    A coefficient that is equal for all pairs is one number. If all particles are alike, any other
    coefficient has one value for each of two kinds of pair: particle and particle, particle and
    wall. Otherwise it has one value for every pair.
    """

    shared: list[Array]
    """Arrays by kind if particles are alike, then an array of the numbers equal for all pairs."""
    by_pair: Array | None
    """Coefficients of every pair, (C, P); None if particles are alike or nothing differs."""
    kinds: int
    """Number of arrays by kind."""
    differing: tuple[int, ...]
    """Indices of the leaves of the coefficients that differ between pairs."""
    structure: Any
    """Tree structure of the coefficients."""
    numbers: tuple[bool, ...]
    """True for each leaf of the force that is one number, equal for all pairs."""
    force: Any
    """Tree structure of the force."""

    @staticmethod
    def of_pairs(
        force: PairForce,
        parameters: Parameters,
        coated: CoatedParticle,
        material: Array | None,
        pairs: Pairs,
    ) -> "CoefficientArrays":
        """Evaluates the coefficients of a force for the pairs of a list.

        Args:
          force: the force, in the units of the parameters.
          parameters: physical parameters, in any coherent system of units.
          coated: the coated particles.
          material: material index of each particle, (N,); None if all have the same material.
          pairs: the pair list.
        """
        alike = force.alike(parameters, material)
        surfaces = SurfacePairs(*pairs.surfaces, material, coated)
        if alike:
            surfaces = SurfacePairs.by_kind(pairs.wall is not None, coated)
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
        """Rebuilds the force and its coefficients for one pair.

        Args:
          shared, own: scalars of the pair, read from `shared` and `by_pair`.
          axis: axis of a wall's normal, 0 to 2; -1 if both surfaces are particles.
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
        force = self.force.unflatten([next(equal) if number else None for number in self.numbers])
        return force, self.structure.unflatten(leaves)

    def equal_radius(self, shared: Sequence[Vector]) -> Array:
        """Radius of every particle; call it only if all radii are equal."""
        return shared[self.kinds][-1]
