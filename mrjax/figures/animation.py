"""A settling run as a film: the particles in their box, and the mudline beside them."""

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
"""Pictures."""
HEIGHT, DOTS_PER_INCH = 3.6, 120
FINENESS = 12.0
"""Pixels to a radius: what that resolution shows of a few hundred particles."""
SHADES = 24
"""Levels of grey: with all of them a GIF takes more than twice the room."""


def refuse_without_writer(path: Path) -> None:
    """Refuses a film that could not be written, before any work for it.

    Raises:
      InputError: another ending than .gif or .mp4, or .mp4 without ffmpeg.
    """
    if path.suffix not in (f".{ending}" for ending in FORMATS):
        raise InputError(f"{path}: give a name that ends in .gif or .mp4")
    if path.suffix == ".mp4" and not animation.writers.is_available("ffmpeg"):
        raise InputError(f"{path}: MP4 needs the program ffmpeg, which is not there; give .gif")


@STYLE
def save_animation(path: str | Path, run: Run, pictures: int = 100, progress: bool = False) -> None:
    """Writes a run as a film of 20 pictures to the second.

    Args:
      path: ends in `.gif`, or in `.mp4`, for which the program ffmpeg is needed; replaced at once.
      run: one that recorded its trajectory.
      pictures: at most; evenly spaced frames of the run, the first and the last among them.
      progress: whether to show a progress bar, on standard error.

    Raises:
      InputError: a run without a trajectory, another ending, or no ffmpeg.
      SimulationError: the run is not to be trusted.
    """
    path = Path(path)
    refuse_without_writer(path)
    run.check()
    if run.trajectory is None or run.trajectory.position.ndim != 3:
        raise InputError("give one run, with a trajectory: simulate(..., trajectory=True)")
    count = min(checks.whole(pictures, "pictures"), len(run.times))
    shown = np.unique(np.linspace(0, len(run.times) - 1, count).round().astype(int))
    times, mudline = np.asarray(run.times, float), np.asarray(run.mudline, float)
    size, radius = np.asarray(run.box.size), np.asarray(run.radius, float)
    places = spheres.inside(run.trajectory.position, run.box)

    low, high = spheres.bounds(size)
    wide = HEIGHT * (high - low)[0] / (high - low)[1]
    figure = Figure(figsize=(wide + 3.0, HEIGHT), layout="constrained")
    box, curve = figure.subplots(1, 2, width_ratios=[wide, 3.0])
    picture = spheres.draw(box, places[0], radius, size, FINENESS)
    picture.set_interpolation("nearest")
    curve.plot(times, mudline, color="0.7")
    (passed,) = curve.plot([], [], "k-")
    (now,) = curve.plot([], [], "ko", ms=4)
    curve.set_xlim(times[0], times[-1])
    curve.set_ylim(0.0, run.box.height)
    curve.set_xlabel("time")
    curve.set_ylabel(interface(run))
    curve.xaxis.set_major_formatter(EngFormatter("s"))
    curve.yaxis.set_major_formatter(EngFormatter("m"))
    kind = animation.PillowWriter if path.suffix == ".gif" else animation.FFMpegWriter
    curve.set_title(" ", loc="left")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # nothing moves but what is to move
    clock = EngFormatter("s", places=1)
    writer = kind(fps=PER_SECOND)
    with (
        matplotlib.rc_context({"savefig.bbox": None}),  # all pictures are of one size
        files.replacing(path) as scratch,
        writer.saving(figure, scratch, DOTS_PER_INCH),
    ):
        for frame in tqdm(shown, desc="film", disable=not progress, leave=False):
            shades = spheres.image(places[frame], radius, size, FINENESS)
            picture.set_data((SHADES * shades).round() / SHADES)
            passed.set_data(times[: frame + 1], mudline[: frame + 1])
            now.set_data(times[frame : frame + 1], mudline[frame : frame + 1])
            curve.set_title(clock(times[frame]), loc="left")
            writer.grab_frame()
