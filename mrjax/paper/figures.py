"""The figures of Son (2018), drawn from the results of this code: in greyscale, one column wide.

Fig. 2 is the wall factor, Fig. 4 the sedimentation curve. Figs. 5 and 8 are the particles at the
start and at the end of a run. Figs. 6 and 7 compare with measurements. Figs. 1 and 3 of the paper
are sketches without data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from matplotlib.figure import Figure

from mrjax.figures import COLUMN, STYLE, particles
from mrjax.laws import drag
from mrjax.observables.interface import Asymptotes, asymptotes, sedimentation_ratio
from mrjax.paper.dry_beds import INFERRED_FRICTION
from mrjax.paper.eq_14 import HABERMAN_SAYRE_EXACT
from mrjax.paper.row import Row
from mrjax.paper.runs import Simulated
from mrjax.simulation.sedimentation import Sedimentation, standard_error

COMPARED = ("case2", "case3")
"""Cases that the paper compares with measurements."""


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper, drawn from the results of this code."""

    number: int
    figure: Figure
    caption: str

    @property
    def name(self) -> str:
        """Name of the files of the figure, without suffix."""
        return f"figure-{self.number}"


def paper_figures(
    rows: Sequence[Row], runs: Simulated, settled: Sedimentation
) -> list[PaperFigure]:
    """Returns Figs. 2 and 4 to 8 with their captions.

    Args:
      rows: printed and computed numbers.
      runs: simulations from which the rows were computed.
      settled: case2 at its own viscosity; the first of its runs is drawn.
    """
    curve = jax.tree.map(lambda leaf: leaf[0], settled.run)
    lines = asymptotes(curve)
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
                np.asarray(curve.times), np.asarray(sedimentation_ratio(curve)), lines
            ),
            "The whole sedimentation curve of case 2 at its own viscosity, with a friction "
            f"coefficient of {np.max(settled.parameters.friction):g}, and its initial and final "
            f"asymptotes, which meet after {float(lines.crossing_time):.0f} s; it ends at "
            f"{100 * float(lines.final_ratio):.1f} %. In the paper this figure is a sketch.",
        ),
        _configurations(5, "case1", runs),
        PaperFigure(
            6,
            _comparison(rows, "initial settling velocity", "mm/day"),
            "Initial settling velocity as printed, as computed here, and as measured by "
            "Fang et al. (2005).",
        ),
        PaperFigure(
            7,
            _comparison(rows, "final sedimentation ratio", "%", errors if starts > 1 else None),
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
        particles({"initial": start.position, "final": bed.state.position}, bed.radius, bed.box),
        f"{start.particles} spheres of {2e6 * float(bed.radius.max()):g} um in a box of "
        f"{size} um, at random and at rest: dropped without drag, with a friction coefficient of "
        f"{INFERRED_FRICTION:g}.",
    )


def _comparison(
    rows: Sequence[Row], quantity: str, unit: str, errors: Sequence[float] | None = None
) -> Figure:
    by_name = {(row.case, row.quantity): row for row in rows}
    return bars(
        {
            "Son (2018)": [by_name[case, quantity].printed for case in COMPARED],
            "this work": [float(by_name[case, quantity].computed or np.nan) for case in COMPARED],
            "Fang et al. (2005)": [
                by_name[case, f"{quantity}, measured"].printed for case in COMPARED
            ],
        },
        [f"case {case[-1]}" for case in COMPARED],
        f"{quantity}, {unit}",
        {"this work": errors} if errors else None,
    )


@STYLE
def wall_factor(exact: Mapping[float, float]) -> Figure:
    """Draws f_w against the diameter ratio: Eq. 14, its data, and its alternatives (Fig. 2).

    Args:
      exact: tabulated drag factor, by diameter ratio.
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
    axes.legend(loc="upper left")
    return figure


@STYLE
def sedimentation_curve(times: np.ndarray, ratio: np.ndarray, lines: Asymptotes) -> Figure:
    """Draws a sedimentation curve with its initial and final asymptotes (Fig. 4).

    Args:
      times: times, (F,) in s.
      ratio: sedimentation ratio, (F,).
      lines: asymptotes of the curve.
    """
    final, crossing = 100 * float(lines.final_ratio), float(lines.crossing_time)
    figure = Figure(figsize=(COLUMN, 2.5), layout="constrained")
    axes = figure.subplots()
    # Each line extends a little beyond the intersection, as in the paper.
    descent = (100 * ratio[0] - final) / crossing
    beyond = 1.15 * crossing
    axes.plot([0.0, beyond], [100 * ratio[0], 100 * ratio[0] - descent * beyond], "-", color="0.6")
    axes.plot([0.85 * crossing, times[-1]], [final, final], "-", color="0.6", label="asymptotes")
    axes.plot(times, 100 * ratio, "k:", linewidth=1.8, label="simulated")
    axes.set_xlabel("time, s")
    axes.set_ylabel("sedimentation ratio, %")
    axes.set_xlim(0.0, times[-1])
    axes.legend()
    return figure


@STYLE
def bars(
    values: Mapping[str, Sequence[float]],
    cases: Sequence[str],
    label: str,
    errors: Mapping[str, Sequence[float]] | None = None,
) -> Figure:
    """Draws a group of bars for each case, with a bar for each source (Figs. 6 and 7).

    Args:
      values: one value for each case, by source.
      cases: labels of the groups.
      label: label of the vertical axis.
      errors: half lengths of the error bars, by source; None without error bars.
    """
    figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
    axes = figure.subplots()
    width, middle = 0.26, np.arange(len(cases))
    styles = (("0.85", ""), ("0.45", ""), ("1.0", "////"))
    for column, ((source, heights), (shade, hatch)) in enumerate(
        zip(values.items(), styles, strict=True)
    ):
        group = axes.bar(
            middle + (column - 1) * width,
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
        axes.bar_label(group, fmt="%.1f", padding=2)
    axes.set_xticks(middle, cases)
    axes.set_ylabel(label)
    # Room for the numbers above the bars.
    axes.set_ylim(0.0, 1.15 * max(max(heights) for heights in values.values()))
    figure.legend(ncols=3, loc="outside upper center")
    return figure
