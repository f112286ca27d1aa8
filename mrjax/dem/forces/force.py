"""Base classes of forces: `PairForce` of two surfaces, `BodyForce` of each particle, `Noise`.

A force is a dataclass whose fields are its coefficients. They are leaves of a pytree, so they can
be differentiated, fitted and mapped like the parameters. A law is written in SI: all its arguments
and results are in SI. The bundled forces are the exception. They hold in any coherent system of
units, and are evaluated in the reduced units of a run.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, dataclass_transform

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.core.quantities import quantity, reduced
from mrjax.core.state import State
from mrjax.core.units import Units
from mrjax.dem.contact_history import Remembered
from mrjax.dem.kinematics import PairKinematics
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.vectors import Vector, dot

Memory = Mapping[str, Any]
"""History of a pair, by name: a number, or a vector of three components."""


class Wrench(NamedTuple):
    """A force and its torques."""

    force: Vector
    """Force on the particle, N; the partner of a pair gets the opposite force."""
    torque: Vector | None = None
    """Torque on the particle about its centre, N m; None for no torque."""
    partner_torque: Vector | None = None
    """Torque on the partner about its centre, N m; None for no torque."""


class Stiffness(NamedTuple):
    """Springs and dashpots of pairs, which limit the stable time step; (P,) or ()."""

    normal: ArrayLike
    """dt K + 2 c along the normal, with stiffness K and dashpot c; kg/s."""
    tangential: ArrayLike = 0.0
    """dt K + 2 c in the tangent plane, kg/s."""


@dataclass_transform(frozen_default=True, field_specifiers=(quantity,))
class Force:
    """A force of a run. A subclass is a frozen dataclass, and a pytree of its fields."""

    in_si = True
    """True if the law is in SI; False if it holds in any coherent units, as the bundled forces."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Makes the subclass a frozen dataclass and registers it as a JAX pytree."""
        super().__init_subclass__(**keywords)
        jax.tree_util.register_dataclass(dataclass(frozen=True)(cls))

    def active(self, parameters: Parameters) -> Self:
        """Returns the force without the parts whose coefficients are known to be zero."""
        return self

    def apart(self) -> Self:
        """Returns the force for a run in which no surfaces touch."""
        return self

    def within(self, box: Box) -> Self:
        """Returns the force for particles in this container."""
        return self

    def refuse(self, state: State) -> None:
        """Refuses a state on which the force cannot act; traced values pass unchecked.

        Raises:
          InputError: there is a fault.
        """

    def reduced(self, units: Units) -> Self:
        """Returns the force in the reduced units of a run, for a law that is not written in SI."""
        return reduced(self, units)


class PairForce(Force):
    """A force between two surfaces, written for one pair; the kernel sums it over all pairs.

    A subclass defines the law in `__call__`. By default a force acts in contact only, has no
    coefficients by pair, and has no history: override the other methods to change this. The force
    must vanish beyond its reach.
    Inside the law the fields of `self` are numbers. A field with one number for each particle is
    None there; the law receives its values through `coefficients`.

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
    """Largest overlap for which the law is valid, in radii; a run that exceeds it fails."""

    def __call__(
        self, pair: PairKinematics, coefficients: Any, memory: Memory, time_step: ArrayLike
    ) -> tuple[Wrench, Memory]:
        """Returns the force of one pair and its new history.

        Args:
          pair: geometry and relative motion of the two surfaces.
          coefficients: coefficients of this pair, in the pytree that `coefficients` returns.
          memory: history of the pair, by name.
          time_step: time by which the history advances, s.
        """
        raise NotImplementedError(f"{type(self).__name__} has no law: define __call__")

    def reach(self, parameters: Parameters) -> ArrayLike:
        """Largest gap between surfaces at which the force acts, m; 0 if it acts in contact only."""
        return 0.0

    def coefficients(self, parameters: Parameters, surfaces: SurfacePairs) -> Any:
        """Coefficients of pairs: a pytree of arrays, (P,) each, or () if equal for all pairs.

        Args:
          parameters: parameters of the run.
          surfaces: surfaces of the pairs.
        """
        return ()

    def alike(self, parameters: Parameters, material: Array | None) -> bool:
        """True if all pairs of two particles have equal coefficients, and so do all wall pairs.

        Args:
          parameters: parameters of the run.
          material: material index of each particle, (N,); None if all have the same material.
        """
        return False

    def memory(self) -> dict[str, Remembered]:
        """Size and unit of each entry of a pair's history, by name; kept while within reach."""
        return {}

    def stiffness(self, pair: PairKinematics, coefficients: Any, time_step: ArrayLike) -> Stiffness:
        """Springs and dashpots of one pair, which limit the stable step.

        The default is |dF/dh|, the slope of the normal force over the gap h, for a pair without
        history.

        Args:
          pair: geometry and relative motion of the two surfaces.
          coefficients: coefficients of this pair.
          time_step: length of a step, s.
        """

        def normal_force(overlap: Array) -> Array:
            moved = pair._replace(overlap=overlap)
            wrench, _ = self(moved, coefficients, self.blank_memory(overlap), time_step)
            return dot(wrench.force, pair.normal)

        _, slope = jax.jvp(normal_force, (pair.overlap,), (jnp.ones_like(pair.overlap),))
        return Stiffness(time_step * jnp.abs(slope))

    def blank_memory(self, like: Array) -> Memory:
        """History of a pair that has just come within reach: zeros of the shape of `like`."""
        zero = jnp.zeros_like(like)
        return {
            name: (zero,) * kind.size if kind.size > 1 else zero
            for name, kind in self.memory().items()
        }

    def for_one_pair(self) -> Self:
        """Returns the force as its law sees it: fields that are not a single number become None."""
        leaves, tree = jax.tree.flatten(self)
        scalars = [None if jnp.ndim(leaf) else leaf for leaf in leaves]
        return jax.tree.unflatten(tree, scalars)


class Particles(NamedTuple):
    """Positions, velocities and spins of the particles at one moment; (3, N) each."""

    position: Array
    """Centres, m; not wrapped on periodic axes."""
    velocity: Array
    """Velocities, m/s."""
    spin: Array
    """Angular velocities, rad/s."""
    memory: Mapping[str, Array] = {}
    """Values that forces remember of each particle, by name, (3, N) or (N,)."""


class BodyForce(Force):
    """A force and torque on every particle, such as gravity or a field; it sees all particles.

    Example:
      >>> class Drift(mrjax.BodyForce):
      ...     size: float = mrjax.quantity("N", "along x, of every particle")
      ...
      ...     def __call__(self, parameters, particles):
      ...         along = jnp.array([1.0, 0.0, 0.0])[:, None]
      ...         return mrjax.Wrench(self.size * along * jnp.ones_like(particles.position))
    """

    steady = False
    """True if the force does not depend on positions, velocities or spins; it is computed once."""

    def __call__(self, parameters: Parameters, particles: Particles) -> Wrench:
        """Returns the force on every particle, (3, N) in N, and the torque, (3, N) in N m, or None.

        Args:
          parameters: parameters of the run.
          particles: positions, velocities and spins at this moment.
        """
        raise NotImplementedError(f"{type(self).__name__} has no law: define __call__")

    def memory(self) -> dict[str, Remembered]:
        """Size and unit of each value that a particle remembers, by name.

        The values are in `Particles.memory`, and in `State.memory` between runs. They begin as
        zeros if the state has none.
        """
        return {}

    def moved(
        self, parameters: Parameters, particles: Particles, time: float
    ) -> Mapping[str, Array]:
        """Returns the memory after a time in which velocities and spins are constant.

        Args:
          parameters: parameters of the run.
          particles: particles, with the memory of this force before that time.
          time: duration, s; negative for half a step back, at the end of an interval of a run.
        """
        return particles.memory

    def between_surfaces(self, parameters: Parameters) -> tuple[ArrayLike, ArrayLike]:
        """Upper bounds on stiffness, N/m, and force, N, of two touching particles; for the step."""
        return 0.0, 0.0


class Noise(Force):
    """A random force and torque on every particle, held for one step.

    The random numbers of a particle follow from the seed of the state, the number of the particle
    and the step alone: a run does not depend on the order of the particles or on its parts.

    A random force of this kind drives diffusion if its variance is inversely proportional to the
    step, as that of `Brownian` is. It is a force beside drag, which must damp it.

    Example:
      >>> class Stirring(mrjax.Noise):
      ...     strength: float = mrjax.quantity("N^2 s", "twice the spectral density, along an axis")
      ...
      ...     def __call__(self, parameters, numbers, time_step):
      ...         return mrjax.Wrench(jnp.sqrt(self.strength / time_step) * numbers[:3])
    """

    def __call__(self, parameters: Parameters, numbers: Array, time_step: ArrayLike) -> Wrench:
        """Returns the force on every particle, (3, N) in N, and the torque, (3, N) in N m, or None.

        Args:
          parameters: parameters of the run; with local drag, f_w is that of every particle now.
          numbers: standard normal numbers, independent in every step, (6, N): by custom three for
            the force and three for the torque.
          time_step: time for which the force acts, s.
        """
        raise NotImplementedError(f"{type(self).__name__} has no law: define __call__")
