"""Animation of a settling run: the particles in their box, and the mudline beside them."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import animation
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter
from tqdm import tqdm

from mrjax.core import checks
from mrjax.core.errors import InputError
from mrjax.core.run import Run
from mrjax.figures import spheres
from mrjax.figures.style import STYLE, interface
from mrjax.io import files

FORMATS = ("gif", "mp4")
PER_SECOND = 20
"""Pictures per second."""
HEIGHT, DOTS_PER_INCH = 3.6, 120
FINENESS = 12.0
"""Pixels per radius, enough for a few hundred particles at that resolution."""
SHADES = 24
"""Number of grey levels; with all levels a GIF would be more than twice as large."""


def refuse_without_writer(path: Path) -> None:
    """Refuses a path to which no animation can be written, before any work is done.

    Raises:
      InputError: the suffix is neither .gif nor .mp4, or it is .mp4 without ffmpeg.
    """
    if path.suffix not in (f".{ending}" for ending in FORMATS):
        raise InputError(f"{path}: give a name that ends in .gif or .mp4")
    if path.suffix == ".mp4" and not animation.writers.is_available("ffmpeg"):
        raise InputError(f"{path}: MP4 needs the program ffmpeg, which is not there; give .gif")


@STYLE
def save_animation(path: str | Path, run: Run, pictures: int = 100, progress: bool = False) -> None:
    """Writes a run as an animation with 20 pictures per second.

    Args:
      path: path of the file, ending in `.gif`, or in `.mp4`, which needs the program ffmpeg; an old
        file is replaced.
      run: run that recorded its trajectory.
      pictures: largest number of pictures; they are equidistant frames of the run, including the
        first and the last.
      progress: True to show a progress bar on standard error.

    Raises:
      InputError: the run has no trajectory, the path has another suffix, or ffmpeg is missing.
      SimulationError: the run has a fault.
    """
    path = Path(path)
    refuse_without_writer(path)
    run.check()
    if run.trajectory is None or run.trajectory.position.ndim != 3:
        raise InputError("give one run, with a trajectory: simulate(..., trajectory=True)")
    count = min(checks.whole(pictures, "pictures"), len(run.times))
    frames = np.unique(np.linspace(0, len(run.times) - 1, count).round().astype(int))
    times, mudline = np.asarray(run.times, float), np.asarray(run.mudline, float)
    size, radius = np.asarray(run.box.size), np.asarray(run.radius, float)
    centres = spheres.inside(run.trajectory.position, run.box)

    low, high = spheres.bounds(size)
    wide = HEIGHT * (high - low)[0] / (high - low)[1]
    figure = Figure(figsize=(wide + 3.0, HEIGHT), layout="constrained")
    box, curve = figure.subplots(1, 2, width_ratios=[wide, 3.0])
    picture = spheres.draw(box, centres[0], radius, size, FINENESS)
    picture.set_interpolation("nearest")
    curve.plot(times, mudline, color="0.7")
    (past,) = curve.plot([], [], "k-")
    (present,) = curve.plot([], [], "ko", ms=4)
    curve.set_xlim(times[0], times[-1])
    curve.set_ylim(0.0, run.box.height)
    curve.set_xlabel("time")
    curve.set_ylabel(interface(run))
    curve.xaxis.set_major_formatter(EngFormatter("s"))
    curve.yaxis.set_major_formatter(EngFormatter("m"))
    kind = animation.PillowWriter if path.suffix == ".gif" else animation.FFMpegWriter
    curve.set_title(" ", loc="left")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the axes stay in place in all pictures
    clock = EngFormatter("s", places=1)
    writer = kind(fps=PER_SECOND)
    with (
        matplotlib.rc_context({"savefig.bbox": None}),  # all pictures have the same size
        files.replacing(path) as scratch,
        writer.saving(figure, scratch, DOTS_PER_INCH),
    ):
        for frame in tqdm(frames, desc="film", disable=not progress, leave=False):
            shades = spheres.image(centres[frame], radius, size, FINENESS)
            picture.set_data((SHADES * shades).round() / SHADES)
            past.set_data(times[: frame + 1], mudline[: frame + 1])
            present.set_data(times[frame : frame + 1], mudline[frame : frame + 1])
            curve.set_title(clock(times[frame]), loc="left")
            writer.grab_frame()
