"""A state on disk: positions, velocities, spins, and what its contacts remember."""

from collections.abc import Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax import files
from mrjax.errors import InputError
from mrjax.history import Contacts
from mrjax.state import State

KIND = "mrjax state"


def save_state(path: str | Path, state: State, time: float = 0.0) -> None:
    """Writes a state with all digits, for `load_state`.

    Args:
      path: of the file, which ends in `.npz`.
      state: concrete.
      time: of the state, s.
    """
    diameter = state.contact_diameter
    metadata = {"kind": KIND, "time_s": time, "contact_diameter_m": diameter}
    files.write_npz(Path(path), arrays(state), metadata)


def load_state(path: str | Path) -> State:
    """A state that `save_state` wrote, in the dtype in which it was written.

    Double precision needs `jax.config.update("jax_enable_x64", True)` here, too.

    Raises:
      InputError: no such file, or a file of something else.
    """
    stored, metadata = files.read_npz(Path(path))
    try:
        if metadata["kind"] != KIND:
            raise KeyError
        return of_arrays(stored, metadata["contact_diameter_m"])
    except KeyError:
        raise InputError(f"{path}: holds no state; give a file that save_state wrote") from None


def arrays(state: State) -> dict[str, np.ndarray]:
    """All arrays of a state by name."""
    found = {
        "position_m": state.position,
        "velocity_m_per_s": state.velocity,
        "spin_rad_per_s": state.spin,
        "material": state.material,
    }
    if state.contacts is not None:
        found |= {
            "contact_partner": state.contacts.partner,
            "contact_sliding_m": state.contacts.sliding,
            "contact_rolling_rad": state.contacts.rolling,
        }
    return {name: np.asarray(array) for name, array in found.items() if array is not None}


def of_arrays(stored: Mapping[str, np.ndarray], contact_diameter: float | None) -> State:
    """The state of which `arrays` gave these, among others."""

    def maybe(name: str) -> Array | None:
        return jnp.asarray(stored[name]) if name in stored else None

    contacts = None
    if "contact_partner" in stored:
        contacts = Contacts(
            jnp.asarray(stored["contact_partner"]),
            maybe("contact_sliding_m"),
            maybe("contact_rolling_rad"),
        )
    return State(
        position=jnp.asarray(stored["position_m"]),
        velocity=jnp.asarray(stored["velocity_m_per_s"]),
        spin=jnp.asarray(stored["spin_rad_per_s"]),
        contacts=contacts,
        material=maybe("material"),
        contact_diameter=contact_diameter,
    )
