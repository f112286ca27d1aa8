"""Trajectories in the formats of viewers: GSD, which OVITO opens, and VTK, which ParaView opens.

Lengths are in micrometres, because OVITO ignores a cell of less than 1e-6 cubic units, as the box
would be in metres.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal
from xml.sax.saxutils import quoteattr

import numpy as np
from jax.typing import ArrayLike
from pydantic import NonNegativeInt

from mrjax.core import refusals
from mrjax.core.errors import InputError
from mrjax.core.run import Run
from mrjax.io import files, markers
from mrjax.io.markers import ForeignError, Strict

UM_PER_METRE = 1e6
FRAME_COUNT = "mrjax-frames.json"
"""Name of the file, in a folder of frames, with the number of frames that mrjax wrote."""


class _FrameCount(Strict):
    kind: Literal["mrjax frames"]
    frames: NonNegativeInt


def _frame_count(frames: int) -> _FrameCount:
    return _FrameCount(kind="mrjax frames", frames=frames)


def write_gsd(path: str | Path, run: Run, metadata: Mapping[str, Any]) -> None:
    """Writes a trajectory as a GSD file, in HOOMD's schema and in single precision.

    There is a frame for each recorded time, with coordinates from the middle of the box. A frame
    has the time step, `log/time_s`, and for each particle its position [um], periodic image,
    velocity [um/s], diameter [um], type (its material) and `log/particles/spin_rad_per_s`. The
    schema has periodic boxes only; `log/walls` of the first frame marks which of x, y and z end in
    walls. `log/metadata` of the first frame is JSON, one byte for each character.

    Args:
      path: path of the file; an old file is replaced.
      run: run that recorded its trajectory.
      metadata: origin of the run, such as recipe, seed and versions.

    Raises:
      InputError: the run has no trajectory.
      SimulationError: the run has a fault.
    """
    import gsd.hoomd

    position, velocity, spin = _trajectory(run)
    size = np.asarray(run.box.size)
    image = run.box.image(position)
    centred = position - size * (image + 0.5)
    material = run.state.material
    index = np.zeros(run.state.particles) if material is None else np.asarray(material)
    types = [f"material {number}" for number in range(int(index.max()) + 1)]
    with files.replacing(Path(path)) as scratch, gsd.hoomd.open(scratch, "w") as written:
        for number, time in enumerate(np.asarray(run.times, float)):
            frame = gsd.hoomd.Frame()
            frame.configuration.step = round(run.steps * number / (len(position) - 1))
            frame.configuration.box = _single([*(UM_PER_METRE * size), 0.0, 0.0, 0.0])
            frame.particles.N = run.state.particles
            frame.particles.types = types
            frame.particles.typeid = index.astype(np.uint32)
            frame.particles.diameter = _single(2.0 * UM_PER_METRE * np.asarray(run.radius))
            frame.particles.position = _single(UM_PER_METRE * centred[number])
            frame.particles.image = image[number].astype(np.int32)
            frame.particles.velocity = _single(UM_PER_METRE * velocity[number])
            frame.log["particles/spin_rad_per_s"] = _single(spin[number])
            frame.log["time_s"] = np.array([time])
            if number == 0:
                frame.log["walls"] = np.logical_not(run.box.periodic).astype(np.uint8)
                text = json.dumps(files.plain(metadata))
                # Bytes as numbers, because gsd 5.0.1 cannot read the frames after logged text.
                frame.log["metadata"] = np.frombuffer(text.encode("ascii"), np.uint8)
            written.append(frame)


def write_vtk(path: str | Path, run: Run) -> None:
    """Writes a trajectory as a `.pvd` file, which lists a `.vtu` file for each recorded time.

    The `.vtu` files are in a folder of the same name beside it. `mrjax-frames.json` in that folder
    counts the files that mrjax wrote; other files are not touched. The points are the centres [um],
    wrapped into the box on periodic axes. Each point has `radius_um`, `velocity_um_per_s`,
    `spin_rad_per_s`, `id` (its row in the arrays of the run) and, if there are several materials,
    `material`. Numbers have the precision of the run.

    Args:
      path: path of the `.pvd` file, which is written last.
      run: run that recorded its trajectory.

    Raises:
      InputError: the run has no trajectory, the path has another suffix, or the folder has frames
        that mrjax did not write.
      SystemRefusal: a file or the folder cannot be written.
      SimulationError: the run has a fault.
    """
    from pyevtk.hl import pointsToVTK

    position, velocity, spin = _trajectory(run)
    centres = (UM_PER_METRE * run.box.inside(position)).astype(position.dtype)
    constant = {
        "radius_um": UM_PER_METRE * np.asarray(run.radius),
        "id": np.arange(run.state.particles),
    }
    if run.state.material is not None:
        constant["material"] = np.asarray(run.state.material)
    path = Path(path)
    if path.suffix != ".pvd":
        raise InputError(f"{path}: give a name that ends in .pvd")
    if not path.name.isprintable():  # XML cannot hold such characters
        raise InputError(f"{path}: give a name of printable characters")
    frames = path.with_suffix("")
    before = _refuse_foreign(frames, len(position))
    with refusals.writing(frames):
        frames.mkdir(exist_ok=True)
    files.write_text(path, _frame_list([]))  # the frames of an old list are about to change
    files.write_json(frames / FRAME_COUNT, _frame_count(max(before, len(position))).model_dump())
    lines = []
    for number, time in enumerate(np.asarray(run.times, float)):
        moving = {
            "velocity_um_per_s": _columns(UM_PER_METRE * velocity[number]),
            "spin_rad_per_s": _columns(spin[number]),
        }
        frame = frames / f"{number:06d}.vtu"
        with files.replacing(frame) as scratch:
            pointsToVTK(str(scratch.with_suffix("")), *_columns(centres[number]), moving | constant)
        name = quoteattr(f"{frames.name}/{frame.name}")
        lines.append(f'    <DataSet timestep="{float(time)!r}" part="0" file={name}/>\n')
    for number in range(len(position), before):
        (frames / f"{number:06d}.vtu").unlink(missing_ok=True)
    files.write_json(frames / FRAME_COUNT, _frame_count(len(position)).model_dump())
    files.write_text(path, _frame_list(lines))


def _frame_list(lines: list[str]) -> str:
    """Returns the list of frames in ParaView's format."""
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        f"{''.join(lines)}  </Collection>\n</VTKFile>\n"
    )


def _refuse_foreign(folder: Path, frames: int) -> int:
    """Refuses a folder with frames that mrjax did not write; returns the number that it did write.

    Raises:
      InputError: the folder is a link, or has other frames.
    """
    if folder.is_symlink():
        raise InputError(f"{folder}: is a link, and is not followed; give another name")
    if not folder.is_dir():
        return 0
    try:
        own = (markers.read(folder / FRAME_COUNT, _FrameCount) or _frame_count(0)).frames
    except ForeignError as error:
        raise InputError(
            f"{folder / FRAME_COUNT}: was not written by mrjax, or has changed since ({error}); "
            "give another name"
        ) from None
    for number in range(own, frames):
        if os.path.lexists(frame := folder / f"{number:06d}.vtu"):
            raise InputError(
                f"{frame}: was not written by mrjax, and is not overwritten; give another name, "
                "or take it away"
            )
    return own


def _trajectory(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns positions, velocities and spins of a run, (frames + 1, N, 3) in SI."""
    run.check()
    if run.trajectory is None:
        raise InputError("the run has no trajectory: give simulate or settle trajectory=True")
    if run.trajectory.position.ndim != 3:
        raise InputError(
            "these are several runs: give one of them, jax.tree.map(lambda leaf: leaf[0], run)"
        )
    trajectory = run.trajectory
    return (
        np.asarray(trajectory.position),
        np.asarray(trajectory.velocity),
        np.asarray(trajectory.spin),
    )


def _single(values: ArrayLike) -> np.ndarray:
    """Returns a contiguous array in single precision, as GSD needs it."""
    return np.ascontiguousarray(values, np.float32)


def _columns(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Splits (N, 3) into three contiguous arrays."""
    x, y, z = map(np.ascontiguousarray, rows.T)
    return x, y, z
