"""Plots of a run; legible in grey, sized for a paper's column."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from mrjax import theory
from mrjax.parameters import Parameters
from mrjax.run import Run

MM_PER_DAY = 86400e3
"""1 m/s in mm/day."""


def settling(run: Run, parameters: Parameters) -> Figure:
    """Mean settling velocity against Eq. 27, and the descent of the mudline.

    Args:
      run: a plain, finished run.
      parameters: of the run.
    """
    run.check()
    times = np.asarray(run.times, float)
    figure = Figure(figsize=(7.0, 2.8), layout="constrained")
    velocity, mudline = figure.subplots(1, 2)
    smooth = np.linspace(0.0, times[-1], 200)
    velocity.plot(
        smooth,
        MM_PER_DAY * np.mean(theory.free_fall_velocity(parameters, smooth[:, None]), axis=1),
        color="0.6",
        label="Eq. 27, same factors",
    )
    velocity.plot(
        times,
        MM_PER_DAY * np.asarray(run.mean_velocity),
        "k.",
        label=f"mean of {run.state.particles} particles",
    )
    velocity.set_ylabel("settling velocity, mm/day")
    velocity.legend(frameon=False)
    mudline.plot(times, run.mudline[0] - np.asarray(run.mudline), "k-")
    mudline.set_ylabel("descent of the mudline")
    mudline.yaxis.set_major_formatter(EngFormatter("m"))
    for axes in (velocity, mudline):
        axes.set_xlabel("time")
        axes.xaxis.set_major_formatter(EngFormatter("s"))
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
    return figure
