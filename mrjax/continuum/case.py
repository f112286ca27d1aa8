"""The arguments of a settling column: parameters, initial state, closures and output times."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from mrjax.continuum.compression import Compression
from mrjax.continuum.rotor import Rotor
from mrjax.continuum.tilt import Tilt
from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import value_or_none
from mrjax.laws import particle
from mrjax.laws.hindrance import Hindrance, as_tree


class Case(NamedTuple):
    """The arguments of `column`, in SI."""

    parameters: Parameters
    height: ArrayLike
    volume_fraction: ArrayLike
    bed_fraction: ArrayLike
    times: ArrayLike
    hindrance: Hindrance | None
    compression: Compression | None
    tilt: Tilt | None = None
    rotor: Rotor | None = None

    def as_arrays(self) -> "Case":
        """Returns the case with the closure and the times as trees of arrays.

        Raises:
          InputError: the times are no numbers.
        """
        times = self.times
        try:
            checks.numeric(times)
        except ValueError:
            raise InputError(
                f"times = {shown(times)}: give one row of numbers in s, shape (T,)"
            ) from None
        if not isinstance(times, Array):
            times = jnp.asarray(times) if value_or_none(times) is None else np.asarray(times, float)
        return self._replace(times=times, hindrance=as_tree(self.hindrance))

    def sinking(self) -> tuple["Case", Array]:
        """Returns the case with particles that sink, and True, (), if it is a mirror image.

        A column that creams is turned into its mirror image by the sign of gravity. In a rotor, the
        acceleration of the floor takes the place of gravity.
        """
        if self.rotor is not None:
            parameters = self.parameters.replace(gravity=self.rotor.floor_acceleration)
            return self._replace(parameters=parameters), jnp.asarray(False)
        rising = particle.rises(self.parameters)
        gravity = jnp.where(rising, -self.parameters.gravity, self.parameters.gravity)
        return self._replace(parameters=self.parameters.replace(gravity=gravity)), rising

    def astype(self, dtype: DTypeLike) -> "Case":
        """Returns the case with all numbers in one precision."""
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), self)
