"""A run on disk: arrays in SI whose names tell their units, and what made them; no pickle."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp

from mrjax import files, state_file
from mrjax.box import Box
from mrjax.errors import InputError
from mrjax.run import Run
from mrjax.trajectory import Trajectory

OF_RUN = {
    "times_s": "times",
    "heights_m": "heights",
    "radius_m": "radius",
    "mean_velocity_m_per_s": "mean_velocity",
    "mean_speed_m_per_s": "mean_speed",
    "deepest_overlap_radii": "deepest_overlap",
    "deepest_overlap_coatings": "coating_overlap",
    "fault": "fault",
}
"""Fields of `Run` by the names of their arrays."""
OF_EACH = {"position_m": "position", "velocity_m_per_s": "velocity", "spin_rad_per_s": "spin"}
"""Fields of `Trajectory`, and of `State`, where it is the last."""


def save_run(path: str | Path, run: Run, made_by: Mapping[str, Any]) -> None:
    """Writes a run, or several side by side, as an `.npz` file, which is replaced at once.

    Args:
      path: ends in `.npz`.
      run: its last state, and its trajectory if it has one, are kept with it.
      made_by: recipe, seed, versions: what JSON takes.

    Raises:
      InputError: another ending.
      SimulationError: the run is not to be trusted.
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise InputError(f"{path}: give a name that ends in .npz")
    run.check()
    arrays = {name: getattr(run, field) for name, field in OF_RUN.items()}
    for name, array in state_file.arrays(run.state).items():
        arrays[f"last_{name}" if name in OF_EACH else name] = array
    if run.trajectory is not None:
        arrays |= {name: getattr(run.trajectory, field) for name, field in OF_EACH.items()}
    files.write_npz(
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


def load_run(path: str | Path) -> tuple[Run, dict[str, Any]]:
    """The run that `mrjax simulate` or `save_run` wrote, to the last bit, and what made it.

    In single precision where JAX is set to that.

    Args:
      path: of the `.npz` file.

    Raises:
      InputError: no such file, or not of a run.
    """
    arrays, told = files.read_npz(Path(path))
    found = {name: jnp.asarray(array) for name, array in arrays.items()}
    of_last = {
        name.removeprefix("last_"): array for name, array in arrays.items() if name not in OF_EACH
    }
    moved = None
    try:
        if "position_m" in found:
            moved = Trajectory(**{field: found[name] for name, field in OF_EACH.items()})
        return Run(
            **{field: found[name] for name, field in OF_RUN.items()},
            state=state_file.of_arrays(of_last, told["contact_diameter_m"]),
            box=Box(tuple(told["box_size_m"]), tuple(told["box_periodic"])),
            time_step=told["time_step_s"],
            steps=told["steps"],
            trajectory=moved,
        ), told["made_by"]
    except KeyError as error:
        raise InputError(f"{path}: has no {error}, so it is not of a run; give another") from None
