"""Trajectories in the formats of viewers: GSD, which OVITO opens, and VTK, which ParaView opens.

Lengths are in micrometres: OVITO takes a cell of less than 1e-6 cubic units for none, and a box of
micrometres in metres would be one.
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

PER_METRE = 1e6
"""Micrometres."""
OWN = "mrjax-frames.json"
"""File in a folder of frames with the number of them that mrjax wrote."""


class _FrameCount(Strict):
    kind: Literal["mrjax frames"]
    frames: NonNegativeInt

    @classmethod
    def of(cls, frames: int) -> "_FrameCount":
        return cls(kind="mrjax frames", frames=frames)


def write_gsd(path: str | Path, run: Run, metadata: Mapping[str, Any]) -> None:
    """A trajectory as GSD, in HOOMD's schema: a frame for each recorded time, in single precision.

    Coordinates are from the middle of the box. Each frame has the time step, `log/time_s`, and of
    each particle: position and image (um), velocity (um/s), diameter (um), type (its material), and
    `log/particles/spin_rad_per_s`. The schema knows periodic boxes only: `log/walls` of the first
    frame says which of x, y and z end in walls. `log/metadata` there is JSON, byte by byte.

    Args:
      path: of the file, which is replaced at once.
      run: one that recorded its trajectory.
      metadata: what made it, such as recipe, seed and versions.

    Raises:
      InputError: a run without a trajectory.
      SimulationError: the run is not to be trusted.
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
            frame.configuration.box = _single([*(PER_METRE * size), 0.0, 0.0, 0.0])
            frame.particles.N = run.state.particles
            frame.particles.types = types
            frame.particles.typeid = index.astype(np.uint32)
            frame.particles.diameter = _single(2.0 * PER_METRE * np.asarray(run.radius))
            frame.particles.position = _single(PER_METRE * centred[number])
            frame.particles.image = image[number].astype(np.int32)
            frame.particles.velocity = _single(PER_METRE * velocity[number])
            frame.log["particles/spin_rad_per_s"] = _single(spin[number])
            frame.log["time_s"] = np.array([time])
            if number == 0:
                frame.log["walls"] = np.logical_not(run.box.periodic).astype(np.uint8)
                text = json.dumps(files.plain(metadata))
                # As numbers: gsd 5.0.1 cannot read a frame after one that has logged text.
                frame.log["metadata"] = np.frombuffer(text.encode("ascii"), np.uint8)
            written.append(frame)


def write_vtk(path: str | Path, run: Run) -> None:
    """A trajectory as a `.pvd` file, which lists a `.vtu` file for each recorded time.

    Those are in a folder of the same name beside it, where `mrjax-frames.json` says how many of
    them are ours; others are not touched. Points are the centres (um), in the box on
    periodic axes; of each there is `radius_um`, `velocity_um_per_s`, `spin_rad_per_s`, `id`, its
    row in the arrays of the run, and `material` where there are several, in the run's precision.

    Args:
      path: of the list, which is written when all else is there.
      run: one that recorded its trajectory.

    Raises:
      InputError: a run without a trajectory, another ending, or files of others in that folder.
      SystemRefusal: a file or the folder cannot be written.
      SimulationError: the run is not to be trusted.
    """
    from pyevtk.hl import pointsToVTK

    position, velocity, spin = _trajectory(run)
    centres = (PER_METRE * run.box.inside(position)).astype(position.dtype)
    of_each = {
        "radius_um": PER_METRE * np.asarray(run.radius),
        "id": np.arange(run.state.particles),
    }
    if run.state.material is not None:
        of_each["material"] = np.asarray(run.state.material)
    path = Path(path)
    if path.suffix != ".pvd":
        raise InputError(f"{path}: give a name that ends in .pvd")
    if not path.name.isprintable():  # XML has no form for it
        raise InputError(f"{path}: give a name of printable characters")
    frames = path.with_suffix("")
    before = _refuse_foreign(frames, len(position))
    with refusals.writing(frames):
        frames.mkdir(exist_ok=True)
    files.write_text(path, _listed([]))  # what it listed is about to change
    files.write_json(frames / OWN, _FrameCount.of(max(before, len(position))).model_dump())
    lines = []
    for number, time in enumerate(np.asarray(run.times, float)):
        moving = {
            "velocity_um_per_s": _columns(PER_METRE * velocity[number]),
            "spin_rad_per_s": _columns(spin[number]),
        }
        frame = frames / f"{number:06d}.vtu"
        with files.replacing(frame) as scratch:
            pointsToVTK(str(scratch.with_suffix("")), *_columns(centres[number]), moving | of_each)
        name = quoteattr(f"{frames.name}/{frame.name}")
        lines.append(f'    <DataSet timestep="{float(time)!r}" part="0" file={name}/>\n')
    for number in range(len(position), before):
        (frames / f"{number:06d}.vtu").unlink(missing_ok=True)
    files.write_json(frames / OWN, _FrameCount.of(len(position)).model_dump())
    files.write_text(path, _listed(lines))


def _listed(lines: list[str]) -> str:
    """The list of frames, as ParaView has it."""
    return (
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
        f"{''.join(lines)}  </Collection>\n</VTKFile>\n"
    )


def _refuse_foreign(folder: Path, frames: int) -> int:
    """Passes where a folder has no files of frames but ours; how many there may be of those.

    Raises:
      InputError: something else is there.
    """
    if folder.is_symlink():
        raise InputError(f"{folder}: is a link, and is not followed; give another name")
    if not folder.is_dir():
        return 0
    try:
        own = (markers.read(folder / OWN, _FrameCount) or _FrameCount.of(0)).frames
    except ForeignError as error:
        raise InputError(
            f"{folder / OWN}: is not as mrjax wrote it ({error}); give another name"
        ) from None
    for number in range(own, frames):
        if os.path.lexists(frame := folder / f"{number:06d}.vtu"):
            raise InputError(
                f"{frame}: is not of mrjax, and is not overwritten; give another name, or take it "
                "away"
            )
    return own


def _trajectory(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, velocities and spins, (frames + 1, N, 3) in SI."""
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
    """An array in one piece of memory, as GSD needs it."""
    return np.ascontiguousarray(values, np.float32)


def _columns(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(N, 3) as three arrays, each in one piece of memory."""
    x, y, z = map(np.ascontiguousarray, rows.T)
    return x, y, z
