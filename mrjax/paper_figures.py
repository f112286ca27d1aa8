"""Son's figures drawn from other data: legible in grey, one column of a paper wide.

Fig. 2 the wall factor, Fig. 4 the sedimentation curve, Figs. 5 and 8 the particles at both ends of
a run, Figs. 6 and 7 bars beside the measurements. Figs. 1 and 3 are sketches without data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import jax
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrjax import drag, observe
from mrjax.dropped import INFERRED_FRICTION
from mrjax.observe import Asymptotes
from mrjax.reproduce import HABERMAN_SAYRE_EXACT, Row, Simulated
from mrjax.sedimentation import Sedimentation, standard_error

COLUMN = 3.4
"""Width, inches."""
DOTS_PER_INCH = 300
SMALL = 7.5
"""Of a legend, points."""

COMPARED = ("case2", "case3")
"""The cases that the paper sets beside measurements."""

AZIMUTH, ELEVATION = np.radians(25.0), np.radians(12.0)
"""From where a box is looked at: to the right of its front, and from above."""
SUN = np.array([-0.45, 0.55, 0.70])
"""Direction of the light: to the right, up, towards the eye."""
FINENESS = 30
"""Pixels to a radius."""


@dataclass(frozen=True)
class PaperFigure:
    """One of the paper's figures, drawn from the results here."""

    number: int
    figure: Figure
    caption: str

    @property
    def file(self) -> str:
        """Its name among the results."""
        return f"figure-{self.number}.png"


def of_paper(found: Sequence[Row], runs: Simulated, settled: Sedimentation) -> list[PaperFigure]:
    """Figs. 2 and 4 to 8 with their captions.

    Args:
      found: the rows.
      runs: behind the rows.
      settled: case2 at its own viscosity; the first of its runs is drawn.
    """
    curve = jax.tree.map(lambda leaf: leaf[0], settled.run)
    lines = observe.asymptotes(curve)
    starts = len(runs.final_ratios("case2"))
    errors = [float(standard_error(runs.final_ratios(case))) for case in COMPARED]
    return [
        PaperFigure(
            2,
            wall_factor(HABERMAN_SAYRE_EXACT),
            "Wall correction factor against diameter ratio: the exact solution of "
            "Haberman & Sayre (1958) and their rational formula; Eq. 14, and Eq. 14 with the "
            "smooth cap that gradients need. The cap is the rational formula at 0.8, a third "
            "below the exact value.",
        ),
        PaperFigure(
            4,
            sedimentation_curve(
                np.asarray(curve.times), np.asarray(observe.sedimentation_ratio(curve)), lines
            ),
            "The whole sedimentation curve of case 2 at its own viscosity, with a friction "
            f"coefficient of {np.max(settled.parameters.friction):g}, and its initial and final "
            f"asymptotes, which meet after {float(lines.crossing_time):.0f} s; it ends at "
            f"{100 * float(lines.final_ratio):.1f} %. In the paper this figure is a sketch.",
        ),
        _configurations(5, "case1", runs),
        PaperFigure(
            6,
            _comparison(found, "initial settling velocity", "mm/day"),
            "Initial settling velocity as printed, as computed here, and as measured by "
            "Fang et al. (2005).",
        ),
        PaperFigure(
            7,
            _comparison(found, "final sedimentation ratio", "%", errors if starts > 1 else None),
            "Final sedimentation ratio as printed, as computed here (dropped without drag, "
            f"{_starts(starts)}), and as measured by Fang et al. (2005).",
        ),
        _configurations(8, "case3", runs),
    ]


def _starts(count: int) -> str:
    if count == 1:
        return "one random start"
    return f"mean and standard error of {count} random starts"


def _configurations(number: int, case: str, runs: Simulated) -> PaperFigure:
    start, bed = runs.dispersed[case], jax.tree.map(lambda leaf: leaf[0], runs.beds[case])
    size = " x ".join(f"{1e6 * length:g}" for length in bed.box.size)
    return PaperFigure(
        number,
        configurations(start.position, bed.state.position, bed.radius, bed.box.size),
        f"{start.particles} spheres of {2e6 * float(bed.radius.max()):g} um in a box of "
        f"{size} um, at random and at rest: dropped without drag, with a friction coefficient of "
        f"{INFERRED_FRICTION:g}.",
    )


def _comparison(
    found: Sequence[Row], quantity: str, unit: str, errors: Sequence[float] | None = None
) -> Figure:
    row = {(one.case, one.quantity): one for one in found}
    return bars(
        {
            "Son (2018)": [row[case, quantity].printed for case in COMPARED],
            "this work": [row[case, quantity].computed for case in COMPARED],
            "Fang et al. (2005)": [row[case, f"{quantity}, measured"].printed for case in COMPARED],
        },
        [f"case {case[-1]}" for case in COMPARED],
        f"{quantity}, {unit}",
        {"this work": errors} if errors else None,
    )


def wall_factor(exact: Mapping[float, float]) -> Figure:
    """f_w against the diameter ratio: Eq. 14, what it was fitted to, and its alternatives (Fig. 2).

    Args:
      exact: factor by diameter ratio, as tabulated.
    """
    ratio = np.linspace(1e-3, 1.0, 500)
    fraction = drag.volume_fraction_at(ratio)
    inside = ratio <= drag.HABERMAN_SAYRE_LIMIT
    figure = Figure(figsize=(COLUMN, 2.7), layout="constrained")
    axes = figure.subplots()
    axes.plot(list(exact), list(exact.values()), "ks", ms=4, label="Haberman & Sayre, exact")
    axes.plot(
        ratio[inside],
        drag.haberman_sayre(fraction[inside]),
        color="0.55",
        linestyle="-.",
        label="their rational formula",
    )
    axes.plot(ratio, drag.son2018(fraction), "k-", linewidth=1.2, label="Eq. 14 with its cap")
    axes.plot(ratio, drag.son2018_smooth(fraction), "k:", linewidth=1.4, label="smooth cap")
    axes.set_xlabel("diameter ratio λ")
    axes.set_ylabel("wall correction factor $f_w$")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 80.0)
    axes.legend(frameon=False, fontsize=SMALL, loc="upper left")
    return figure


def sedimentation_curve(times: np.ndarray, ratio: np.ndarray, lines: Asymptotes) -> Figure:
    """A sedimentation curve and its initial and final asymptotes (Fig. 4).

    Args:
      times: (F,) in s.
      ratio: sedimentation ratio, (F,).
      lines: the asymptotes of that curve.
    """
    final, crossing = 100 * float(lines.final_ratio), float(lines.crossing_time)
    figure = Figure(figsize=(COLUMN, 2.5), layout="constrained")
    axes = figure.subplots()
    # Each line reaches a little beyond the corner, as in the paper.
    descent = (100 * ratio[0] - final) / crossing
    beyond = 1.15 * crossing
    axes.plot([0.0, beyond], [100 * ratio[0], 100 * ratio[0] - descent * beyond], "-", color="0.6")
    axes.plot([0.85 * crossing, times[-1]], [final, final], "-", color="0.6", label="asymptotes")
    axes.plot(times, 100 * ratio, "k:", linewidth=1.8, label="simulated")
    axes.set_xlabel("time, s")
    axes.set_ylabel("sedimentation ratio, %")
    axes.set_xlim(0.0, times[-1])
    axes.legend(frameon=False, fontsize=SMALL)
    return figure


def configurations(
    start: np.ndarray, end: np.ndarray, radius: np.ndarray, size: Sequence[float]
) -> Figure:
    """The particles before and after, in their box (Figs. 5 and 8).

    Args:
      start, end: centres, (N, 3) in m.
      radius: of the coated particles, () or (N,) in m.
      size: of the box, (3,) in m.
    """
    figure = Figure(figsize=(COLUMN, 2.92), layout="constrained")
    for axes, centres, when in zip(
        figure.subplots(1, 2), (start, end), ("initial", "final"), strict=True
    ):
        _spheres(axes, np.asarray(centres), np.asarray(radius), np.asarray(size))
        axes.set_title(when, fontsize=9)
    return figure


def bars(
    values: Mapping[str, Sequence[float]],
    cases: Sequence[str],
    label: str,
    errors: Mapping[str, Sequence[float]] | None = None,
) -> Figure:
    """Groups of bars, one for each case, one bar of each source in it (Figs. 6 and 7).

    Args:
      values: of each source, one for each case.
      cases: below the groups.
      label: of the vertical axis.
      errors: of some of the sources, half lengths of their error bars.
    """
    figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
    axes = figure.subplots()
    width, middle = 0.26, np.arange(len(cases))
    looks = (("0.85", ""), ("0.45", ""), ("1.0", "////"))
    for place, ((source, heights), (shade, hatch)) in enumerate(
        zip(values.items(), looks, strict=True)
    ):
        drawn = axes.bar(
            middle + (place - 1) * width,
            heights,
            width,
            yerr=(errors or {}).get(source),
            capsize=2,
            color=shade,
            hatch=hatch,
            edgecolor="k",
            linewidth=0.7,
            label=source,
        )
        axes.bar_label(drawn, fmt="%.1f", fontsize=SMALL, padding=2)
    axes.set_xticks(middle, cases)
    axes.set_ylabel(label, fontsize=9)
    # Room for the numbers above the bars.
    axes.set_ylim(0.0, 1.15 * max(max(heights) for heights in values.values()))
    figure.legend(frameon=False, fontsize=SMALL, ncols=3, loc="outside upper center")
    return figure


def _spheres(axes: Axes, centres: np.ndarray, radius: np.ndarray, size: np.ndarray) -> None:
    """Spheres and their box in parallel projection, nearer ones in front and lighter."""
    corners = _seen(size * np.array(list(product((0, 1), repeat=3))))
    low, high = corners.min(axis=0), corners.max(axis=0)
    shades, extent = _image(_seen(centres), np.broadcast_to(radius, len(centres)), low, high)
    farthest = corners[:, 2].argmin()
    for one, other in product(range(8), repeat=2):
        # Corners are numbered in binary: an edge joins two that differ in one digit.
        if one < other and (one ^ other).bit_count() == 1:
            behind = farthest in (one, other)
            ends = corners[[one, other]]
            axes.plot(*ends[:, :2].T, "k-", linewidth=0.7, zorder=0 if behind else 2)
    axes.imshow(shades, cmap="gray", vmin=0, vmax=1, origin="lower", extent=extent, zorder=1)
    margin = 0.01 * size.max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal", anchor="S")  # leaves room for the title
    axes.set_axis_off()


def _seen(points: np.ndarray) -> np.ndarray:
    """Points (..., 3) as the eye has them: to the right, up, towards it."""
    right = [np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0]
    back = [-np.sin(AZIMUTH), np.cos(AZIMUTH)]
    up = [*(np.sin(ELEVATION) * np.array(back)), np.cos(ELEVATION)]
    return points @ np.array([right, up, np.cross(right, up)]).T


def _image(
    centres: np.ndarray, radius: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ma.MaskedArray, tuple[float, float, float, float]]:
    """Shades of the foremost surfaces, (rows, columns) from 0 to 1, and the picture's extent.

    Lambert's law in parallel light, and darker with depth. Masked where there is no sphere.
    """
    pixel = radius.max() / FINENESS
    columns, rows = np.ceil((high - low)[:2] / pixel).astype(int)
    x = low[0] + (np.arange(columns) + 0.5) * pixel
    y = low[1] + (np.arange(rows) + 0.5) * pixel
    front, shades = np.full((rows, columns), -np.inf), np.zeros((rows, columns))
    sun = SUN / np.linalg.norm(SUN)
    for centre, own in zip(centres, radius, strict=True):
        across = slice(*np.searchsorted(x, (centre[0] - own, centre[0] + own)))
        along = slice(*np.searchsorted(y, (centre[1] - own, centre[1] + own)))
        normal_x = (x[None, across] - centre[0]) / own
        normal_y = (y[along, None] - centre[1]) / own
        square = 1.0 - normal_x**2 - normal_y**2
        normal_z = np.sqrt(np.maximum(square, 0.0))
        depth = centre[2] + own * normal_z
        visible = (square > 0.0) & (depth > front[along, across])
        light = np.maximum(normal_x * sun[0] + normal_y * sun[1] + normal_z * sun[2], 0.0)
        nearness = (centre[2] - low[2]) / (high[2] - low[2])
        shade = (0.25 + 0.75 * light) * (0.45 + 0.55 * nearness)
        front[along, across] = np.where(visible, depth, front[along, across])
        shades[along, across] = np.where(visible, shade, shades[along, across])
    extent = (low[0], low[0] + columns * pixel, low[1], low[1] + rows * pixel)
    return np.ma.masked_where(np.isinf(front), shades), extent
