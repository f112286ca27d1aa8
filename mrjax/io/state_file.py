"""A state on disk: positions, velocities, spins, and what contacts and particles remember."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from pydantic import FiniteFloat, PositiveFloat

from mrjax.core.errors import InputError
from mrjax.core.randomness import RandomStream
from mrjax.core.state import WALLS, ContactHistory, State
from mrjax.io import npz
from mrjax.io.markers import Strict


class Metadata(Strict):
    """The metadata of a state."""

    kind: Literal["mrjax state"]
    time_s: FiniteFloat
    contact_diameter_m: PositiveFloat | None


VECTOR, NUMBER = "contact_vector_", "contact_number_"
"""Beginnings of the names of what further forces remember; in SI."""
OWN_VECTOR, OWN_NUMBER = "particle_vector_", "particle_number_"
"""Beginnings of the names of what forces remember of each particle; in SI."""
VECTORS = npz.Numbers(("N", 3))
MEMORY = npz.Numbers(("N", "S", 3), optional=True, needs="contact_partner")
ARRAYS = {
    "position_m": VECTORS,
    "velocity_m_per_s": VECTORS,
    "spin_rad_per_s": VECTORS,
    "material": npz.Numbers(("N",), "int", least=0, optional=True),
    "random_key": npz.Numbers((2,), "int", optional=True, needs="random_number"),
    "random_number": npz.Numbers(("N",), "int", optional=True, needs="random_step"),
    "random_step": npz.Numbers((), "int", least=0, optional=True, needs="random_key"),
    "contact_partner": npz.Numbers(("N", "S"), "int", least=min(WALLS), below="N", optional=True),
    "contact_sliding_m": MEMORY,
    "contact_rolling_rad": MEMORY,
    f"{VECTOR}*": MEMORY,
    f"{NUMBER}*": npz.Numbers(("N", "S"), optional=True, needs="contact_partner"),
    f"{OWN_VECTOR}*": npz.Numbers(("N", 3), optional=True),
    f"{OWN_NUMBER}*": npz.Numbers(("N",), optional=True),
}
"""Requirements on the arrays of a state of N particles with S contact slots each, by name."""
SCHEMA = npz.Schema("a file that save_state wrote", Metadata, ARRAYS, least={"S": 0})


def save_state(path: str | Path, state: State, time: float = 0.0) -> None:
    """Writes a state with all digits, for `load_state`.

    Args:
      path: path of the file, ending in `.npz`; an old file is replaced.
      state: state of one run, not traced.
      time: time of the state, s.

    Raises:
      InputError: the path has another suffix, the state is of several runs, or it is not finite.
    """
    path = npz.npz_path(path)
    if state.position.ndim != 2:
        raise InputError(
            "these are states of several runs: give one, jax.tree.map(lambda leaf: leaf[0], state)"
        )
    by_name = arrays(state)
    for name, array in (by_name | {"time": np.asarray(time)}).items():
        if not np.isfinite(array).all():
            raise InputError(
                f"{name} is not finite everywhere, and no run can start from it: give a state of "
                "finite numbers"
            )
    metadata = Metadata(
        kind="mrjax state", time_s=float(time), contact_diameter_m=state.contact_diameter
    )
    npz.write(path, by_name, metadata.model_dump())


def load_state(path: str | Path, *, max_bytes: int = npz.MAX_BYTES) -> State:
    """Reads a state that `save_state` wrote, in the dtype in which it was written.

    Double precision needs `jax.config.update("jax_enable_x64", True)` here, too. Names, shapes and
    types of the arrays are checked before anything is unpacked, and all numbers must be finite.

    Args:
      path: path of the `.npz` file.
      max_bytes: largest size of the unpacked arrays.

    Raises:
      InputError: there is no such file, or it holds no state, is damaged, or is larger.
    """
    stored, metadata = npz.read(Path(path), SCHEMA, max_bytes)
    npz.refuse_beyond_single(Path(path), stored)
    return to_state(stored, metadata.contact_diameter_m)


def arrays(state: State) -> dict[str, np.ndarray]:
    """Returns all arrays of a state, by their names in a file."""
    by_name = {
        "position_m": state.position,
        "velocity_m_per_s": state.velocity,
        "spin_rad_per_s": state.spin,
        "material": state.material,
    }
    if state.random is not None:
        by_name |= {
            "random_key": lax.bitcast_convert_type(state.random.key, jnp.int32),
            "random_number": state.random.number,
            "random_step": state.random.step,
        }
    if state.contacts is not None:
        by_name |= {
            "contact_partner": state.contacts.partner,
            "contact_sliding_m": state.contacts.sliding,
            "contact_rolling_rad": state.contacts.rolling,
        }
        for name, rows in state.contacts.named.items():
            vector = rows.ndim > state.contacts.partner.ndim
            by_name[f"{VECTOR if vector else NUMBER}{name}"] = rows
    for name, rows in state.memory.items():
        vector = rows.ndim == state.position.ndim
        by_name[f"{OWN_VECTOR if vector else OWN_NUMBER}{name}"] = rows
    return {name: np.asarray(array) for name, array in by_name.items() if array is not None}


def to_state(stored: Mapping[str, np.ndarray], contact_diameter: float | None) -> State:
    """Returns the state with these arrays; the inverse of `arrays`, which ignores other names."""

    def optional(name: str) -> Array | None:
        return jnp.asarray(stored[name]) if name in stored else None

    def named(*kinds: str) -> dict[str, Array]:
        return {
            name.removeprefix(kind): jnp.asarray(rows)
            for kind in kinds
            for name, rows in stored.items()
            if name.startswith(kind)
        }

    contacts = None
    if "contact_partner" in stored:
        contacts = ContactHistory(
            jnp.asarray(stored["contact_partner"]),
            optional("contact_sliding_m"),
            optional("contact_rolling_rad"),
            named(VECTOR, NUMBER),
        )
    random = None
    if "random_key" in stored:
        words = np.asarray(stored["random_key"]).view(np.uint32)
        random = RandomStream(
            jnp.asarray(words),
            jnp.asarray(stored["random_number"]),
            jnp.asarray(stored["random_step"]),
        )
    return State(
        position=jnp.asarray(stored["position_m"]),
        velocity=jnp.asarray(stored["velocity_m_per_s"]),
        spin=jnp.asarray(stored["spin_rad_per_s"]),
        contacts=contacts,
        material=optional("material"),
        contact_diameter=contact_diameter,
        memory=named(OWN_VECTOR, OWN_NUMBER),
        random=random,
    )
