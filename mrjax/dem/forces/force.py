"""The two kinds of force: between two surfaces, and on every particle by itself.

A force is a dataclass whose fields are its coefficients. They are leaves: they can be
differentiated, fitted and mapped like the parameters. A law is written in SI: all that it is given
is in SI, and so is what it returns. The bundled forces are written in any coherent system of units
instead, and are evaluated in the reduced units of a run.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, dataclass_transform

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.core.quantities import quantity, reduced
from mrjax.core.units import Units
from mrjax.dem.contact_history import Remembered
from mrjax.dem.kinematics import PairKinematics
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.vectors import Vector, dot

Memory = Mapping[str, Any]
"""What a pair or particle remembers, by name: a number, or a vector of three components."""


class Wrench(NamedTuple):
    """A force, and the torques that go with it."""

    force: Vector
    """On the particle, N; of a pair, the partner gets the opposite."""
    torque: Vector | None = None
    """On the particle about its centre, N m; None for none."""
    partner_torque: Vector | None = None
    """On the partner about its centre, N m; None for none."""


class Stiffness(NamedTuple):
    """The springs and dashpots of pairs that the step has to resolve; (P,) or ()."""

    normal: ArrayLike
    """dt K + 2 c along the normal, kg/s: stiffness K, dashpot c."""
    tangential: ArrayLike = 0.0
    """The same along the tangent plane, kg/s."""


@dataclass_transform(frozen_default=True, field_specifiers=(quantity,))
class Force:
    """A force of a run. A subclass is a frozen dataclass, and a pytree of its fields."""

    in_si = True
    """False for a law that is written in any coherent system of units, as the bundled ones are."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Makes the subclass a dataclass that JAX takes apart."""
        super().__init_subclass__(**keywords)
        jax.tree_util.register_dataclass(dataclass(frozen=True)(cls))

    def active(self, parameters: Parameters) -> Self:
        """The same force without the parts whose coefficients are known to be zero."""
        return self

    def apart(self) -> Self:
        """The same force for a run in which no surfaces touch."""
        return self

    def reduced(self, units: Units) -> Self:
        """The same force in the reduced units of a run, where it is not written in SI."""
        return reduced(self, units)


class PairForce(Force):
    """A force between two surfaces, written for one pair; the kernel sums it over all.

    A subclass gives the law, `__call__`, and overrides what differs from a force that acts in
    contact only, has no coefficients by pair and remembers nothing. It must vanish beyond
    its reach.
    Inside the law the fields of `self` are numbers; a field with one number for each particle is
    None there, and reaches the law by `coefficients`.

    Example:
      >>> class Attraction(mrjax.PairForce):
      ...     pull_off: float = mrjax.quantity("N")
      ...     range: float = mrjax.quantity("m")
      ...
      ...     def reach(self, parameters):
      ...         return 1e-6
      ...
      ...     def __call__(self, pair, coefficients, memory, time_step):
      ...         size = self.pull_off * jnp.exp(-jnp.maximum(pair.gap, 0.0) / self.range)
      ...         return mrjax.Wrench(tuple(-size * part for part in pair.normal)), memory
    """

    greatest_overlap = float("inf")
    """Overlap, in radii, beyond which the law is no description; a run that exceeds it fails."""

    def __call__(
        self, pair: PairKinematics, coefficients: Any, memory: Memory, time_step: ArrayLike
    ) -> tuple[Wrench, Memory]:
        """The force of one pair, and its new memory.

        Args:
          pair: geometry and relative motion of the two surfaces.
          coefficients: those of this pair, of the tree that `coefficients` returns.
          memory: what the pair remembers, by name.
          time_step: by which the memory advances, s.
        """
        raise NotImplementedError(f"{type(self).__name__} has no law: define __call__")

    def reach(self, parameters: Parameters) -> ArrayLike:
        """The largest gap between surfaces at which the force acts, m; 0: in contact only."""
        return 0.0

    def coefficients(self, parameters: Parameters, surfaces: SurfacePairs) -> Any:
        """Coefficients of pairs: a tree of arrays, (P,) each, or () where equal for all.

        Args:
          parameters: of the run.
          surfaces: the pairs.
        """
        return ()

    def alike(self, parameters: Parameters, material: Array | None) -> bool:
        """True if all pairs of particles have the same coefficients, and all with a wall.

        Args:
          parameters: of the run.
          material: of each particle, (N,); None where all are of one.
        """
        return False

    def memory(self) -> dict[str, Remembered]:
        """What a pair remembers while it is within reach, by name."""
        return {}

    def stiffness(self, pair: PairKinematics, coefficients: Any, time_step: ArrayLike) -> Stiffness:
        """Springs and dashpots of one pair, for the stable step.

        Here: |dF/dh| of the normal force by the gap h, of a pair that remembers nothing.

        Args:
          pair: geometry and relative motion of the two surfaces.
          coefficients: those of this pair.
          time_step: s.
        """

        def normal_force(overlap: Array) -> Array:
            moved = pair._replace(overlap=overlap)
            wrench, _ = self(moved, coefficients, self.blank_memory(overlap), time_step)
            return dot(wrench.force, pair.normal)

        _, slope = jax.jvp(normal_force, (pair.overlap,), (jnp.ones_like(pair.overlap),))
        return Stiffness(time_step * jnp.abs(slope))

    def blank_memory(self, like: Array) -> Memory:
        """What a pair remembers that has just come within reach: zeros of this shape."""
        zero = jnp.zeros_like(like)
        return {
            name: (zero,) * kind.size if kind.size > 1 else zero
            for name, kind in self.memory().items()
        }

    def for_one_pair(self) -> Self:
        """The force as its law sees it: fields that are no single number are None."""
        leaves, tree = jax.tree.flatten(self)
        scalars = [None if jnp.ndim(leaf) else leaf for leaf in leaves]
        return jax.tree.unflatten(tree, scalars)


class Particles(NamedTuple):
    """The particles at one moment; (3, N) each."""

    position: Array
    """Centres, m. On periodic axes they run on past the box."""
    velocity: Array
    """m/s."""
    spin: Array
    """rad/s."""


class BodyForce(Force):
    """A force and torque on every particle, of all particles: gravity, a field.

    Example:
      >>> class Drift(mrjax.BodyForce):
      ...     size: float = mrjax.quantity("N", "along x, of every particle")
      ...
      ...     def __call__(self, parameters, particles):
      ...         along = jnp.array([1.0, 0.0, 0.0])[:, None]
      ...         return mrjax.Wrench(self.size * along * jnp.ones_like(particles.position))
    """

    steady = False
    """True if the force is the same wherever the particles are: it is then computed once."""

    def __call__(self, parameters: Parameters, particles: Particles) -> Wrench:
        """The force on every particle, (3, N) in N, and the torque, (3, N) in N m, or None.

        Args:
          parameters: of the run.
          particles: at this moment.
        """
        raise NotImplementedError(f"{type(self).__name__} has no law: define __call__")
