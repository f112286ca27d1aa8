"""A run on disk: arrays in SI, named with their units, and metadata; no pickle."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from pydantic import PositiveFloat, PositiveInt

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.run import Run
from mrjax.core.trajectory import Trajectory
from mrjax.io import npz, state_file
from mrjax.io.markers import Strict

RUN_FIELDS = {
    "times_s": "times",
    "heights_m": "heights",
    "radius_m": "radius",
    "mean_velocity_m_per_s": "mean_velocity",
    "mean_speed_m_per_s": "mean_speed",
    "deepest_overlap_radii": "deepest_overlap",
    "deepest_overlap_coatings": "coating_overlap",
    "fault": "fault",
}
"""Fields of `Run`, by the names of the arrays in a file."""
BY_PARTICLE = {
    "position_m": "position",
    "velocity_m_per_s": "velocity",
    "spin_rad_per_s": "spin",
}
"""Fields of `Trajectory` and of the last `State`, by the names of the arrays in a file."""


class Metadata(Strict):
    """The metadata of a run."""

    box_size_m: tuple[PositiveFloat, PositiveFloat, PositiveFloat]
    box_periodic: tuple[bool, bool, bool]
    time_step_s: PositiveFloat
    steps: PositiveInt
    contact_diameter_m: PositiveFloat | None
    made_by: dict[str, Any]


SIDE = npz.SIDE_BY_SIDE
SMALLEST = float(np.finfo(np.float32).smallest_subnormal)
PER_FRAME = npz.Numbers((SIDE, "F"))
PER_RUN = npz.Numbers((SIDE,), least=0.0)
PER_PARTICLE = npz.Numbers((SIDE, "F", "N", 3), optional=True)
ARRAYS = {
    "times_s": replace(PER_FRAME, least=0.0),
    "heights_m": npz.Numbers((SIDE, "F", "N")),
    "radius_m": npz.Numbers((SIDE, "N"), least=SMALLEST),
    "mean_velocity_m_per_s": PER_FRAME,
    "mean_speed_m_per_s": replace(PER_FRAME, least=0.0),
    "deepest_overlap_radii": PER_RUN,
    "deepest_overlap_coatings": PER_RUN,
    "fault": npz.Numbers((SIDE,), "int", least=0, most=0),
    "rising": npz.Numbers((SIDE,), "int", least=0, most=1, optional=True),
    "position_m": replace(PER_PARTICLE, needs="velocity_m_per_s"),
    "velocity_m_per_s": replace(PER_PARTICLE, needs="spin_rad_per_s"),
    "spin_rad_per_s": replace(PER_PARTICLE, needs="position_m"),
    **{
        f"last_{name}" if name in BY_PARTICLE else name: replace(
            numbers, shape=(SIDE, *numbers.shape)
        )
        for name, numbers in state_file.ARRAYS.items()
    },
}
"""Requirements on the arrays of a run of N particles at F times, by name."""
SCHEMA = npz.Schema("a file of a run", Metadata, ARRAYS, least={"S": 0, "F": 2})


def save_run(path: str | Path, run: Run, made_by: Mapping[str, Any]) -> None:
    """Writes a run, or several along a leading axis, as an `.npz` file.

    Args:
      path: path of the file, ending in `.npz`; an old file is replaced.
      run: run, which is saved with its last state and, if it has one, its trajectory.
      made_by: recipe, seed and versions, in types that JSON has.

    Raises:
      InputError: the path has another suffix.
      SimulationError: the run has a fault.
    """
    path = npz.npz_path(path)
    run.check()
    arrays = {name: getattr(run, field) for name, field in RUN_FIELDS.items()}
    arrays["rising"] = np.asarray(run.rising, np.int32)
    for name, array in state_file.arrays(run.state).items():
        arrays[f"last_{name}" if name in BY_PARTICLE else name] = array
    if run.trajectory is not None:
        arrays |= {name: getattr(run.trajectory, field) for name, field in BY_PARTICLE.items()}
    npz.write(
        path,
        arrays,
        {
            "box_size_m": run.box.size,
            "box_periodic": run.box.periodic,
            "time_step_s": run.time_step,
            "steps": run.steps,
            "contact_diameter_m": run.state.contact_diameter,
            "made_by": made_by,
        },
    )


def load_run(path: str | Path, *, max_bytes: int = npz.MAX_BYTES) -> tuple[Run, dict[str, Any]]:
    """Reads a run that `mrjax simulate` or `save_run` wrote, to the last bit.

    Numbers become single precision if JAX is set to single precision. Names, shapes and types of
    the arrays are checked before anything is unpacked, and all numbers must be finite.

    Args:
      path: path of the `.npz` file.
      max_bytes: largest size of the unpacked arrays.

    Returns:
      The run, and the `made_by` with which it was saved.

    Raises:
      InputError: there is no such file, or it holds no run, is damaged, or is larger.
    """
    arrays, metadata = npz.read(Path(path), SCHEMA, max_bytes)
    npz.refuse_beyond_single(Path(path), arrays)
    if (np.diff(arrays["times_s"]) < 0.0).any():
        raise InputError(f"{path}: its times decrease; give {SCHEMA.description}")
    leaves = {name: jnp.asarray(array) for name, array in arrays.items()}
    rising = leaves.pop("rising", jnp.zeros(leaves["fault"].shape, jnp.int32))
    last_state = {
        name.removeprefix("last_"): array
        for name, array in arrays.items()
        if name not in BY_PARTICLE
    }
    trajectory = None
    if "position_m" in leaves:
        trajectory = Trajectory(**{field: leaves[name] for name, field in BY_PARTICLE.items()})
    return Run(
        **{field: leaves[name] for name, field in RUN_FIELDS.items()},
        rising=rising != 0,
        state=state_file.to_state(last_state, metadata.contact_diameter_m),
        box=Box(metadata.box_size_m, metadata.box_periodic),
        time_step=metadata.time_step_s,
        steps=metadata.steps,
        trajectory=trajectory,
    ), metadata.made_by
