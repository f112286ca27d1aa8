"""A heat map of the volume fraction over height and time."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from mrjax.core.run import Run
from mrjax.figures.style import COLUMN, STYLE, interface
from mrjax.observables.concentration import concentration as volume_fraction

LEVELS = 200


@STYLE
def concentration(run: Run, thickness: float | None = None) -> Figure:
    """Draws the volume fraction over height and time, with the mudline.

    Args:
      run: run in a box with a floor.
      thickness: thickness of the slabs over which the volume fraction is averaged, m. The default,
        two largest diameters, averages over the layers of a packing.

    Raises:
      InputError: `thickness` is no positive number, or the box has no floor.
      SimulationError: the run has a fault.
    """
    if thickness is None:
        thickness = 4.0 * float(run.radius.max())
    edges = np.linspace(0.0, run.box.height, LEVELS + 1)
    fraction = volume_fraction(run, 0.5 * (edges[1:] + edges[:-1]), thickness)
    times = np.asarray(run.times, float)
    # Each recorded time covers the interval of the times that are nearest to it.
    time_edges = np.concatenate([times[:1], 0.5 * (times[1:] + times[:-1]), times[-1:]])
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    mesh = axes.pcolormesh(time_edges, edges, np.asarray(fraction).T, vmin=0.0, rasterized=True)
    axes.plot(times, run.mudline, "k--", linewidth=0.8, label=interface(run))
    axes.set_xlim(times[0], times[-1])
    axes.set_ylim(0.0, run.box.height)
    axes.set_xlabel("time")
    axes.set_ylabel("height")
    axes.xaxis.set_major_formatter(EngFormatter("s"))
    axes.yaxis.set_major_formatter(EngFormatter("m"))
    # The legend is in the clear layer, which is white.
    axes.legend(loc="lower right" if np.any(run.rising) else "upper right")
    figure.colorbar(mesh, ax=axes, label="volume fraction")
    return figure
