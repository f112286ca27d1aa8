"""The page of the compressive yield stress: what was measured, in words, tables and a figure."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mrjax.core.text import with_error
from mrjax.figures.style import LINES, PAGE, STYLE
from mrjax.io.files import markdown_table
from tests.studies.compressive_yield import curves, tubes
from tests.studies.compressive_yield.curves import CONDITIONS, Curve

FOLDER = Path(__file__).parent
TEXT, FIGURE = FOLDER / "README.md", FOLDER / "yield.png"
SHOWN = (0.35, 0.4, 0.45, 0.5, 0.55)
"""Volume fractions of the tables."""

ABOUT = """# Compressive yield stress of particles that attract each other

`mrjax.compressive_yield` compresses a periodic box of case 2's particles along one axis: 4 µm,
friction 0.3, a Hamaker constant of 1e-19 J and layers of 14 nm (Bond number 9.9, range of the
softened attraction 0.03 radii). There are 300 particles, from a random start at a volume
fraction of 0.1 up to 0.55 in steps of 3 %. Each step ends when the mean net force on a particle
is 0.003 times the pull-off force F_c and the load. Moduli are lowered until F_c makes an
overlap of 0.02 radii. Stresses are along the axis, over F_c / d², which is 1.33 Pa at this Bond
number: mean of the starts with its standard error.

"""
LAW = """
The law of a column, sigma_0 ((phi / phi_gel)^k - 1), fits the mean of the starts above 0.01 F_c
/ d²; errors are from leaving out one start at a time:

"""
ROBUST = """
## What it depends on

Without gravity, and with overdamped motion, the paths of the particles depend on F_c only
through the time that they take, so that stress over F_c / d² is the same for all Bond numbers,
sizes and viscosities. That holds while overlaps are small: moduli do not matter. It does not
hold where gravity forms the network (Bond numbers below 1), nor for another friction, rolling
friction or range. One thing was changed at a time; ratios are to the means of the same two
starts, and the standard error is that of this ratio for starts that are independent:

"""
TUBES = """
## A tube of 10 cm

`CompressiveYield.of` scales the law to other layers on the particles, and `mrjax.column` takes
it. The suspension of case 2 (volume fraction 0.337, 100 mm) weighs {load:.0f} Pa on the floor
of its tube. A bed does not exceed 0.634, the densest random packing. Above 0.55 the law is
extrapolated; real stresses grow without bound towards 0.634.

"""
FIGURE_TEXT = """
![Stress over F_c / d² against volume fraction, and mudlines of a tube of 10 cm](yield.png)

At a Bond number of 10 the tube is a rigid one: its weight is {heavy:.0f} times F_c / d². Only
bare particles carry it in a loose bed. The box of the paper, 12.5 layers high, cannot tell
these tubes apart.

`python -m tests.studies.compressive_yield` makes this page, and measures the curves, some 20
minutes on two cores; names of conditions measure these alone.
"""


def at(curve: Curve, fraction: float) -> np.ndarray:
    """Stress of each start at a volume fraction, from the logarithm between steps; (M,)."""
    positive = np.log(np.maximum(curve.stress, 1e-6))
    place = np.log(curve.volume_fraction)
    return np.exp([np.interp(np.log(fraction), place, start) for start in positive])


def text(settled: list[tubes.Tube]) -> str:
    """The whole page."""
    measured = curves.curves()
    load = settled[0].load
    pull_off = 2.125850340136054e-11
    return (
        ABOUT
        + _stresses(measured)
        + LAW
        + _laws(measured)
        + ROBUST
        + _ratios(measured)
        + TUBES.format(load=load)
        + _tubes(settled)
        + FIGURE_TEXT.format(heavy=load / (pull_off / 4e-6**2))
    )


def _stresses(measured: dict[str, Curve]) -> str:
    rows = []
    for name in ("base", "rolling"):
        if name in measured:
            values = [at(measured[name], fraction) for fraction in SHOWN]
            cells = [with_error(one.mean(), _error(one)) for one in values]
            rows.append([CONDITIONS[name].words, f"{len(values[0])}", *cells])
    return markdown_table(["", "starts", *(f"φ = {one:g}" for one in SHOWN)], rows)


def _laws(measured: dict[str, Curve]) -> str:
    rows = []
    for name in ("base", "rolling"):
        if name in measured:
            fit = curves.fit(measured[name])
            errors = np.sqrt(np.diag(fit.covariance))
            law = fit.compression
            rows.append(
                [
                    CONDITIONS[name].words,
                    with_error(law.gel_fraction, errors[0]),
                    with_error(law.stress, law.stress * errors[1]),
                    with_error(law.exponent, errors[2]),
                ]
            )
    return markdown_table(["", "phi_gel", "sigma_0 d² / F_c", "k"], rows)


def _ratios(measured: dict[str, Curve]) -> str:
    rows = []
    base = measured["base"]
    for name in (one for one in CONDITIONS if one not in ("base", "rolling") and one in measured):
        cells = []
        for fraction in SHOWN[1:]:
            ours, theirs = at(measured[name], fraction), at(base, fraction)
            same = theirs[: len(ours)]
            ratio = ours.mean() / same.mean()
            spread = theirs.std(ddof=1) / theirs.mean()
            cells.append(with_error(ratio, ratio * spread * np.sqrt(2.0 / len(ours))))
        rows.append([CONDITIONS[name].words, *cells])
    return markdown_table(["", *(f"φ = {one:g}" for one in SHOWN[1:])], rows)


def _tubes(settled: list[tubes.Tube]) -> str:
    rows = [
        [
            tube.words,
            "" if not tube.strength else f"{tube.load / tube.strength:.3g}",
            f"{100.0 * tube.ratio[-1]:.1f}",
        ]
        for tube in settled
    ]
    return markdown_table(
        ["Bond number", "load over strength at the start", "height at rest, %"], rows
    )


def _error(values: np.ndarray) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))


@STYLE
def figure(settled: list[tubes.Tube]) -> Figure:
    """Stress against volume fraction, and the mudlines of the tubes."""
    drawn = Figure(figsize=(PAGE, 2.8), layout="constrained")
    left, right = drawn.subplots(1, 2)
    measured = curves.curves()
    for name, marker in (("base", "o"), ("rolling", "^")):
        if name not in measured:
            continue
        curve, fit = measured[name], curves.fit(measured[name])
        mean = curve.stress.mean(axis=0)
        error = curve.stress.std(axis=0, ddof=1) / np.sqrt(len(curve.stress))
        seen = mean > 1e-3
        label = CONDITIONS[name].words
        shade = "0.0" if name == "base" else "0.5"
        left.errorbar(
            curve.volume_fraction[seen], mean[seen], error[seen],
            fmt=marker, ms=2.5, color=shade, elinewidth=0.7, label=label,
        )  # fmt: skip
        smooth = np.linspace(float(fit.compression.gel_fraction) * 1.005, 0.6, 200)
        left.plot(smooth, fit.compression.solid_stress(smooth), color=shade, linewidth=0.8)
    left.set_yscale("log")
    left.set_ylim(1e-3, 1e1)
    left.set_xlim(0.15, 0.6)
    left.set_xlabel("volume fraction")
    left.set_ylabel("stress / ($F_c/d^2$)")
    left.legend(loc="upper left")
    for tube, line in zip(settled, LINES, strict=False):
        right.plot(tube.hours / 24.0, tube.ratio, label=tube.words, **line)
    right.set_xlim(0.0, 20.0)
    right.set_ylim(0.5, 1.0)
    right.set_xlabel("time, days")
    right.set_ylabel("height / initial height")
    right.legend(title="Bond number", title_fontsize=7.0)
    return drawn
