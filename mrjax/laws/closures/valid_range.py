"""The range of volume fractions in which a closure holds."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike


class ValidRange(NamedTuple):
    """Volume fractions from `least` to below `most`, and the reason for each end, in words."""

    least: float = 0.0
    """Least volume fraction; 1."""
    most: float = 1.0
    """Volume fraction below which the closure holds; 1."""
    below: str = ""
    """Reason why the closure does not hold below `least`."""
    above: str = ""
    """Reason why the closure does not hold from `most` on."""

    def fault(self, volume_fraction: float) -> str | None:
        """Returns the reason why the closure does not hold at a volume fraction, or None."""
        if volume_fraction < self.least:
            return f"holds from a volume fraction of {self.least:.4g}: {self.below}"
        if volume_fraction >= self.most:
            return f"holds below a volume fraction of {self.most:.4g}: {self.above}"
        return None


def nan_outside(law: Callable[[Array], Array], argument: ArrayLike, valid: Array) -> Array:
    """Returns a law where it holds, and NaN elsewhere.

    The derivatives are 0 where the result is NaN: a result that leaves out these elements, as with
    `jnp.where`, keeps its derivatives.

    Args:
      law: elementwise law that holds for 0.5.
      argument: its argument, of any shape.
      valid: True where the law holds, of the same shape.
    """
    return jnp.where(valid, law(jnp.where(valid, argument, 0.5)), jnp.nan)
