"""Where the particles are: positions, velocities, spins; and particles put by hand."""

from dataclasses import dataclass, field
from numbers import Real

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from mrjax.core.box import LARGEST, SMALLEST
from mrjax.core.errors import InputError, shown
from mrjax.dem.contact_history import Contacts


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class State:
    """N particles at one moment."""

    position: Array
    """Centres, (N, 3) in m. On periodic axes they run on past the box (`Box.wrap`)."""
    velocity: Array
    """(N, 3) in m/s."""
    spin: Array
    """Angular velocity, (N, 3) in rad/s."""
    contacts: Contacts | None = None
    """What the contacts remember; None where nothing has touched yet, or without friction."""
    material: Array | None = None
    """Index into the tables of `Parameters`, (N,); None where all are of one material."""
    contact_diameter: float | None = field(default=None, metadata={"static": True})
    """Largest distance of centres at which two particles touch, m. It fixes the reach of the
    neighbour list where the parameters are traced; None: read from concrete parameters."""

    @property
    def particles(self) -> int:
        """N."""
        return self.position.shape[0]


def place(
    positions: ArrayLike,
    velocities: ArrayLike | None = None,
    spins: ArrayLike | None = None,
    *,
    materials: ArrayLike | None = None,
    contact_diameter: float | None = None,
    dtype: DTypeLike = float,
) -> State:
    """Particles put by hand.

    Args:
      positions: centres, (N, 3) in m.
      velocities: (N, 3) in m/s; at rest when left out.
      spins: (N, 3) in rad/s; none when left out.
      materials: index of each particle's material into the tables of `Parameters`, (N,); left
        out, all are of one.
      contact_diameter: largest distance at which two of them touch, m; only needed where
        `simulate` is called with traced radii.
      dtype: of the state, and so of a run that starts from it; `float` is JAX's default.

    Raises:
      InputError: an array of another shape, or materials that are not whole numbers from 0.

    Example:
      >>> state = mrjax.place([[5e-3, 5e-3, 1e-3], [5e-3, 5e-3, 3e-3]], [[0, 0, 0], [0, 0, -0.1]])
      >>> state.particles
      2
    """
    try:
        precise = jnp.dtype(dtype) in (jnp.float32, jnp.float64)
    except TypeError:
        precise = False
    if not precise:
        raise InputError(f"dtype = {shown(dtype)}: must be float32 or float64")
    position = _array("positions", positions, dtype)
    if position.ndim != 2 or position.shape[1] != 3 or position.shape[0] == 0:
        raise InputError(
            f"positions have shape {position.shape}; give one row of x, y, z for each particle, "
            "shape (N, 3)"
        )

    def like_positions(name: str, values: ArrayLike | None) -> Array:
        array = _array(name, np.zeros(position.shape) if values is None else values, dtype)
        if array.shape != position.shape:
            raise InputError(
                f"{name} have shape {array.shape}; give the shape of the positions, "
                f"{position.shape}"
            )
        return array

    if contact_diameter is not None:
        contact_diameter = _length("contact_diameter", contact_diameter)
    return State(
        position,
        like_positions("velocities", velocities),
        like_positions("spins", spins),
        material=None if materials is None else _indices(materials, len(position)),
        contact_diameter=contact_diameter,
    )


def _array(name: str, values: ArrayLike, dtype: DTypeLike) -> Array:
    """The values as an array.

    Raises:
      InputError: they are no numbers.
    """
    try:
        return jnp.asarray(values, dtype)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} are not an array of numbers: {error}") from None


def _indices(materials: ArrayLike, particles: int) -> Array:
    try:
        index = np.asarray(materials)
    except ValueError:  # rows of unequal lengths
        index = np.zeros(0)
    if index.shape != (particles,) or index.dtype.kind not in "iu" or index.min() < 0:
        raise InputError(
            f"materials = {shown(materials)}: give a whole number from 0 for each of the "
            f"{particles} particles"
        )
    return jnp.asarray(index, jnp.int32)


def _length(name: str, value: float) -> float:
    """A length that is known, m.

    Raises:
      InputError: it is none.
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not SMALLEST <= value <= LARGEST:
        raise InputError(f"{name} = {shown(value)}: give a length in m, above 0")
    return float(value)
