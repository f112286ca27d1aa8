"""The curves of a run: the initial settling, and the whole sedimentation curve."""

import jax
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.core.units import MM_PER_DAY
from mrjax.figures.style import PAGE, STYLE, interface
from mrjax.laws import closed_forms
from mrjax.observables.concentration import concentration
from mrjax.observables.interface import asymptotes
from mrjax.simulation.sedimentation import Sedimentation


@STYLE
def settling(run: Run, parameters: Parameters) -> Figure:
    """Draws the mean settling velocity with Eq. 27, and the descent of the mudline.

    Args:
      run: a finished run, not traced.
      parameters: parameters of the run.
    """
    run.check()
    times = np.asarray(run.times, float)
    figure = Figure(figsize=(PAGE, 2.4), layout="constrained")
    velocity, mudline = figure.subplots(1, 2)
    smooth = np.linspace(0.0, times[-1], 200)
    velocity.plot(
        smooth,
        MM_PER_DAY * np.mean(closed_forms.free_fall_velocity(parameters, smooth[:, None]), axis=1),
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
    velocity.legend()
    sign = -1.0 if np.any(run.rising) else 1.0
    mudline.plot(times, sign * (run.mudline[0] - np.asarray(run.mudline)), "k-")
    mudline.set_ylabel(f"{'rise' if sign < 0.0 else 'descent'} of the mudline")
    mudline.yaxis.set_major_formatter(EngFormatter("m"))
    for axes in (velocity, mudline):
        axes.set_xlabel("time")
        axes.xaxis.set_major_formatter(EngFormatter("s"))
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
    if sign < 0.0:  # velocities are positive downwards
        velocity.set_ylim(velocity.dataLim.y0 * 1.05, 0.0)
    return figure


@STYLE
def sedimentation(whole: Sedimentation) -> Figure:
    """Draws the sedimentation curve with its asymptotes, and profiles of the volume fraction.

    See Son (2018), Fig. 4. Each run of an ensemble is a thin line, their mean a thick one.

    Args:
      whole: one run to rest, or an ensemble.
    """
    times = np.asarray(whole.run.times[0], float)
    ratio = np.asarray(whole.ratio(), float)
    first = jax.tree.map(lambda leaf: leaf[0], whole.run)
    figure = Figure(figsize=(PAGE, 2.6), layout="constrained")
    curve, profile = figure.subplots(1, 2)
    if len(ratio) > 1:
        curve.plot(times, ratio.T, color="0.65", linewidth=0.7)
    curve.plot(times, ratio.mean(axis=0), "k-", label=interface(whole.run))
    lines = jax.vmap(asymptotes)(whole.run)
    final, crossing = float(lines.final_ratio.mean()), float(lines.crossing_time.mean())
    corners = ([0.0, crossing, times[-1]], [ratio[:, 0].mean(), final, final])
    curve.plot(*corners, "--", color="0.4", label="asymptotes")
    curve.set_ylabel("sedimentation ratio")
    curve.legend()
    curve.set_xlim(left=0)
    curve.xaxis.set_major_formatter(EngFormatter("s"))
    curve.set_xlabel("time")
    diameter, top = 2.0 * float(first.radius.max()), whole.run.box.height
    levels = np.linspace(0.0, top, 200)
    frames = np.searchsorted(times, np.array([0.0, 0.5, 1.0, times[-1] / crossing]) * crossing)
    fraction = concentration(first, levels, 2.0 * diameter)
    for frame, shade in zip(
        np.minimum(frames, len(times) - 1), ("0.75", "0.55", "0.3", "0.0"), strict=True
    ):
        label = f"{times[frame]:.3g} s"
        profile.plot(fraction[frame], levels / top, color=shade, label=label)
    profile.set_xlabel("volume fraction")
    profile.set_ylabel("height / initial height")
    profile.legend()
    profile.set_xlim(left=0)
    profile.set_ylim(0, 1)
    return figure
