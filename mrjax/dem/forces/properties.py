"""Effective properties of pairs as the operands of a sum over pairs: equal, by kind or by pair."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

from mrjax.core.parameters import Parameters
from mrjax.dem.pairs import Pairs
from mrjax.laws import effective
from mrjax.laws.effective import PairProperties
from mrjax.laws.particle import CoatedParticle
from mrjax.laws.vectors import Vector


class PropertyArrays(NamedTuple):
    """Properties of all pairs of a list, in as few arrays as hold them.

    What is equal for all pairs is one number. Where all particles are alike, what differs has one
    value for two particles and one for a particle at a wall; otherwise one for every pair.
    """

    names: tuple[str, ...]  # of what differs
    shared: list[Array]  # by kind where particles are alike, and then what is equal for all
    by_pair: Array | None  # (C, P)
    kinds: int  # number of arrays by kind

    @staticmethod
    def of_pairs(
        parameters: Parameters, coated: CoatedParticle, material: Array | None, pairs: Pairs
    ) -> "PropertyArrays":
        """The properties of the pairs of a list.

        Args:
          parameters: in one coherent system of units.
          coated: the coated particles.
          material: of each particle, (N,); None where all are of one.
          pairs: the list.
        """
        kinds = effective.per_kind(parameters, material, pairs.wall is not None, coated)
        properties = kinds
        if properties is None:
            properties = effective.per_pair(parameters, material, *pairs.surfaces, coated=coated)
        values = properties._asdict()
        differing = {name: value for name, value in values.items() if jnp.ndim(value)}
        equal = [value for name, value in values.items() if name not in differing]
        equal += [] if jnp.ndim(coated.radius) else [coated.radius]
        rows = jnp.stack([*differing.values()]) if differing else None
        by_kind = [] if kinds is None or rows is None else list(rows.T)
        return PropertyArrays(
            tuple(differing),
            [*by_kind, *([jnp.stack(equal)] if equal else [])],
            rows if kinds is None else None,
            len(by_kind),
        )

    def of_pair(self, shared: Sequence[Vector], own: Vector | None, axis: Array) -> PairProperties:
        """The properties of one pair.

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
        differing = dict(zip(self.names, values, strict=True))
        names = [name for name in PairProperties._fields if name not in differing]
        equal = dict(zip(names, shared[self.kinds], strict=False)) if names else {}
        return PairProperties(**differing, **equal)

    def equal_radius(self, shared: Sequence[Vector]) -> Array:
        """The radius of every particle, where all are equal."""
        return shared[self.kinds][-1]
