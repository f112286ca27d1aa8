"""The state of the particles: positions, velocities, spins, contact history.

`place` makes one from arrays.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from numbers import Real

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from mrjax.core.box import LARGEST, SMALLEST
from mrjax.core.errors import InputError, shown
from mrjax.core.randomness import RandomStream

NOBODY = -1
WALLS = (-2, -3, -4, -5, -6, -7)
"""Ids of an empty slot (`NOBODY`), and of the walls at the lower and upper end of x, y and z."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class ContactHistory:
    """History of the contacts of a state: S slots for each of N particles.

    Both particles of a contact hold its history. `sliding` and `rolling` are None if no law reads
    them.
    """

    partner: Array
    """Id of the partner, (N, S): the index of a particle, -1 in an empty slot, -2 to -7 for the
    walls at the lower and upper end of x, y and z."""
    sliding: Array | None
    """Tangential displacement of the particle's surface against its partner's, (N, S, 3) in m."""
    rolling: Array | None
    """Angle rolled on the partner, (N, S, 3) in rad."""
    named: dict[str, Array] = field(default_factory=dict)
    """History of further forces, by name: (N, S, 3) vectors or (N, S) numbers."""

    @staticmethod
    def of_names(partner: Array, by_name: Mapping[str, Array]) -> "ContactHistory":
        """The history with these memories.

        Args:
          partner: ids of the partners, (N, S).
          by_name: what is remembered, by name: (N, S, 3) vectors or (N, S) numbers.
        """
        named = dict(by_name)
        sliding, rolling = named.pop("sliding", None), named.pop("rolling", None)
        return ContactHistory(partner, sliding, rolling, named)

    @property
    def by_name(self) -> dict[str, Array]:
        """All that is remembered, by name."""
        own = {"sliding": self.sliding, "rolling": self.rolling}
        return {name: rows for name, rows in own.items() if rows is not None} | self.named


Contacts = ContactHistory
"""The old name of `ContactHistory`."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class State:
    """N particles at one moment."""

    position: Array
    """Centres, (N, 3) in m; not wrapped on periodic axes (see `Box.wrap`)."""
    velocity: Array
    """Velocities, (N, 3) in m/s; the z component is positive upwards."""
    spin: Array
    """Angular velocity, (N, 3) in rad/s."""
    contacts: ContactHistory | None = None
    """History of the contacts; None before the first contact, or without friction."""
    material: Array | None = None
    """Index into the tables of `Parameters`, (N,); None if all particles are of one material."""
    contact_diameter: float | None = field(default=None, metadata={"static": True})
    """Largest distance of centres at which two particles touch, m. It fixes the reach of the
    neighbour list if the parameters are traced. None: it is read from concrete parameters."""
    memory: dict[str, Array] = field(default_factory=dict)
    """Values that forces remember of each particle, by name: (N, 3) vectors or (N,) numbers, SI."""
    random: RandomStream | None = None
    """Random numbers of the particles, for Brownian motion; None stands for those of seed 0."""

    @property
    def particles(self) -> int:
        """Number of particles N."""
        return self.position.shape[0]

    def with_seed(self, seed: int) -> "State":
        """Returns the state with other random kicks to come: those of a seed, from the first on.

        Example:
          >>> state = mrjax.place([[5e-6, 5e-6, 5e-6]])
          >>> states = [state.with_seed(seed) for seed in range(3)]
        """
        return replace(self, random=RandomStream.of_seed(seed, self.particles))


def allocate_history(
    particles: int, slots: int, dtype: DTypeLike, *, sliding: bool, rolling: bool
) -> ContactHistory | None:
    """Returns an empty contact history with the fields that a run needs; None if it needs none."""
    if not sliding and not rolling:
        return None
    zeros = jnp.zeros((particles, slots, 3), dtype)
    partner = jnp.full((particles, slots), NOBODY, jnp.int32)
    return ContactHistory(partner, zeros if sliding else None, zeros if rolling else None)


def widened(contacts: ContactHistory | None, slots: int) -> ContactHistory | None:
    """Returns the contact history with `slots` slots for each particle; new slots are empty."""
    if contacts is None:
        return None
    padding = ((0, 0), (0, slots - contacts.partner.shape[1]))

    def wide(rows: Array) -> Array:
        return jnp.pad(rows, (*padding, (0, 0))[: rows.ndim])

    partner = jnp.pad(contacts.partner, padding, constant_values=NOBODY)
    by_name = {name: wide(rows) for name, rows in contacts.by_name.items()}
    return ContactHistory.of_names(partner, by_name)


def place(
    positions: ArrayLike,
    velocities: ArrayLike | None = None,
    spins: ArrayLike | None = None,
    *,
    materials: ArrayLike | None = None,
    contact_diameter: float | None = None,
    seed: int | None = None,
    dtype: DTypeLike = float,
) -> State:
    """Makes a state from positions, velocities and spins.

    Args:
      positions: centres, (N, 3) in m.
      velocities: velocities, (N, 3) in m/s; zero by default.
      spins: angular velocities, (N, 3) in rad/s; zero by default.
      materials: index of each particle's material into the tables of `Parameters`, (N,); by
        default all particles are of one material.
      contact_diameter: largest distance of centres at which two particles touch, m; needed only if
        `simulate` is called with traced radii.
      seed: seed of the random kicks of Brownian motion; None for seed 0.
      dtype: dtype of the state, and so of a run that starts from it; `float` is JAX's default.

    Raises:
      InputError: an array has another shape, or `materials` are not whole numbers from 0.

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
        random=None if seed is None else RandomStream.of_seed(seed, len(position)),
    )


def _array(name: str, values: ArrayLike, dtype: DTypeLike) -> Array:
    """Converts values to an array.

    Raises:
      InputError: the values are no numbers.
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
    """Returns a length, m, as a float.

    Raises:
      InputError: the value is no positive number.
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not SMALLEST <= value <= LARGEST:
        raise InputError(f"{name} = {shown(value)}: give a length in m, above 0")
    return float(value)
