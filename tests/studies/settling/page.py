"""The settling page, from the beds and numbers that were measured."""

import json
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mrjax.core.text import with_error
from mrjax.io.files import markdown_table
from mrjax.observables import interface
from mrjax.simulation.overlap import OVERLAP

from . import beds, kynch
from .beds import AS_IS, FRICTIONS, SAMPLES, SCANNED, SIDES, TWICE, VARIANTS

FOLDER = Path(__file__).parent
PRINTED = {"case2": 0.693, "case3": 0.864}
"""Final ratios of Son (2018), section 3.1."""
LIKE_FOR_LIKE, NEAR_PRINTED = 1.5, 2.0
"""Bars, in percentage points of the initial height."""

HEADER = f"""# Settling of whole boxes

The boxes are those of the paper: 314 particles of 4 µm (case2) and 292 of 4.4 µm (case3) in
25 x 25 x 50 µm. A ratio is a height over the initial height, in per cent: the mean of
{beds.STARTS} random starts with its standard error.

`python -m tests.studies.settling` makes this page from `beds.csv`, `gradients.json` and
`kynch.json` beside it. It measures those of them that are missing.
"""


class Ensemble:
    """The beds of one kind, from either code."""

    def __init__(self, lines: list[beds.Bed], **of):
        self.lines = [bed for bed in lines if all(bed[key] == value for key, value in of.items())]

    def values(self, column: str) -> np.ndarray:
        """Of every start, in per cent; (M,)."""
        return 100.0 * np.array([bed[column] for bed in self.lines])

    def mean(self, column: str = "top") -> float:
        """Over the starts, per cent."""
        return float(self.values(column).mean())

    def error(self, column: str = "top") -> float:
        """Standard error of the mean, per cent."""
        values = self.values(column)
        return float(values.std(ddof=1) / len(values) ** 0.5)

    def shown(self, column: str = "top") -> str:
        """Mean and standard error."""
        return with_error(self.mean(column), self.error(column))


_lines = cache(beds.known)


def ours(how: str, sample: str, sides: str, friction: float, variant: str = AS_IS) -> Ensemble:
    """An ensemble of this project."""
    return Ensemble(
        _lines(beds.FILE),
        how=how,
        sample=sample,
        sides=sides,
        friction=friction,
        variant=variant,
    )


def peers(sample: str, sides: str, friction: float) -> Ensemble:
    """An ensemble of LIGGGHTS."""
    return Ensemble(_lines(beds.PEER), sample=sample, sides=sides, friction=friction)


def difference(one: Ensemble, other: Ensemble, column: str = "top") -> tuple[float, float]:
    """Of the means of independent ensembles, and its standard error; percentage points."""
    return (
        one.mean(column) - other.mean(column),
        float(np.hypot(one.error(column), other.error(column))),
    )


def paired(one: Ensemble, other: Ensemble, column: str = "top") -> tuple[float, float]:
    """Mean difference of the same starts, and its standard error; percentage points."""
    apart = one.values(column) - other.values(column)
    return float(apart.mean()), float(apart.std(ddof=1) / len(apart) ** 0.5)


def signed(pair: tuple[float, float]) -> str:
    """A difference with its error."""
    return "+" * (pair[0] > 0) + with_error(*pair)


def like_for_like() -> dict[tuple[str, str, float], tuple[float, float]]:
    """Difference of the tops of dropped beds to LIGGGHTS', percentage points."""
    return {
        key: difference(ours("dropped", *key), peers(*key))
        for key in (
            (sample, sides, friction)
            for sample in SAMPLES
            for sides in SIDES
            for friction in FRICTIONS
        )
    }


def _against_liggghts() -> str:
    rows = [
        [
            sample,
            sides,
            f"{friction:g}",
            peers(sample, sides, friction).shown(),
            ours("dropped", sample, sides, friction).shown(),
            *(
                signed(
                    difference(
                        ours("dropped", sample, sides, friction),
                        peers(sample, sides, friction),
                        column,
                    )
                )
                for column in interface.HEIGHTS
            ),
        ]
        for sample, sides, friction in like_for_like()
    ]
    columns = ["sample", "sides", "friction", "top, LIGGGHTS", "top, mrjax"]
    table = markdown_table(columns + [f"Δ {name}" for name in interface.HEIGHTS], rows)
    return f"""## Dropped without a fluid, beside LIGGGHTS 3.8

In both codes the particles fall in a vacuum, with E = 1e7 Pa, restitution 0.5 and steps of 5e-8 s.
Each code has random starts of its own, LIGGGHTS three.

The last columns are mrjax minus LIGGGHTS in percentage points, for each definition of the height.
The top of the highest particle must agree within {LIKE_FOR_LIKE}. Half-concentration differs by up
to 0.2 because the two codes search for the level in different ways.

{table}"""


def _inferred() -> str:
    frictions = sorted(FRICTIONS + SCANNED)

    def miss(column: str, friction: float) -> float:
        return max(
            abs(ours("dropped", sample, "walls", friction).mean(column) - 100 * PRINTED[sample])
            for sample in SAMPLES
        )

    rows = [
        [
            column,
            f"{friction:g}",
            *(ours("dropped", sample, "walls", friction).shown(column) for sample in SAMPLES),
            f"{miss(column, friction):.1f}",
        ]
        for column in interface.HEIGHTS
        for friction in frictions
    ]
    best = min(
        ((column, friction) for column in interface.HEIGHTS for friction in frictions),
        key=lambda one: miss(*one),
    )
    periodic = max(
        ours("dropped", "case3", "periodic", friction).mean(column)
        for column in interface.HEIGHTS
        for friction in FRICTIONS
    )
    table = markdown_table(
        [
            "height",
            "friction",
            *(f"{s} (printed {100 * PRINTED[s]:.1f})" for s in SAMPLES),
            "deviation",
        ],
        rows,
    )
    return f"""## Friction coefficient and definition of the height

The paper prints final ratios of 69.3 and 86.4 %. It states neither the friction coefficient nor the
definition of the height nor the sides of the box. They are inferred here from the two ratios.

The table has beds between walls. The deviation is the larger one of the two samples, in percentage
points. The smallest is that of the **{best[0]} with a friction coefficient of {best[1]:g}**.
Between periodic sides no bed reaches 86.4 % by any definition: the highest is {periodic:.1f} %.

{table}"""


def _slow() -> str:
    rows = [
        [
            sample,
            f"{friction:g}",
            ours("dropped", sample, "walls", friction).shown(),
            ours("settled", sample, "walls", friction).shown(),
            ours("settled", sample, "walls", friction, TWICE).shown(),
            *(
                signed(
                    difference(
                        ours("settled", sample, "walls", friction),
                        ours("dropped", sample, "walls", friction),
                        column,
                    )
                )
                for column in interface.HEIGHTS
            ),
        ]
        for sample in SAMPLES
        for friction in sorted(FRICTIONS + SCANNED)
    ]
    columns = ["sample", "friction", "top, dropped", "top, settled", f"top, settled with {TWICE}"]
    table = markdown_table(columns + [f"Δ {name}" for name in interface.HEIGHTS], rows)
    return f"""## Settled beds beside dropped ones

The settled boxes have walls, their true viscosity, and contacts softened to an overlap of
{OVERLAP:g} radii. The last columns are settled minus dropped, in percentage points.

{table}"""


def independence() -> dict[str, dict[str, float]]:
    """How far each change moves the mean final ratio and the curve, percentage points."""

    def of(variant: str) -> Ensemble:
        return ours("settled", "case2", "walls", SCANNED[0], variant)

    found = {}
    for variant in (TWICE, *VARIANTS):
        varied, base = of(variant), of(TWICE if variant.startswith(f"{TWICE},") else AS_IS)
        moved, error = paired(varied, base)
        mass, mass_error = paired(varied, base, "mass-quantile")
        curve = [abs(paired(varied, base, f"top_{at}")[0]) for at in range(1, beds.MOMENTS + 1)]
        found[variant] = {
            "ratio": varied.mean(),
            "ratio_error": varied.error(),
            "moved": moved,
            "error": error,
            "mass": mass,
            "mass_error": mass_error,
            "curve": max(curve),
        }
    return found


def _independent() -> str:
    base = ours("settled", "case2", "walls", SCANNED[0])
    widest = max(base.error(f"top_{at}") for at in range(1, beds.MOMENTS + 1))
    table = markdown_table(
        [
            "changed",
            "final ratio",
            "change of the top",
            "change of the mass-quantile",
            "largest change of the curve",
        ],
        (
            [
                variant,
                with_error(one["ratio"], one["ratio_error"]),
                signed((one["moved"], one["error"])),
                signed((one["mass"], one["mass_error"])),
                f"{one['curve']:.2g}",
            ]
            for variant, one in independence().items()
        ),
    )
    return f"""## Numerical parameters

Overlap, step, skin, rebuilds and precision should not change a bed. The reference is case2 between
walls at its true viscosity, with a friction coefficient of {SCANNED[0]:g} and the default overlap
of {OVERLAP:g} radii. Its final ratio is {base.shown()} by the top of the highest particle, and the
standard error of its curve is at most {widest:.2f}.

Each row changes one parameter and has the same random starts. Step, skin, rebuilds and precision
are changed in runs with twice the overlap, which cost half as much, and are compared with that run.
Only the overlap has an effect: a softer bed packs more densely, by more than its contacts yield.

{table}"""


def _of_gradients() -> str:
    found = json.loads((FOLDER / "gradients.json").read_text("utf-8"))

    def row(name: str, values: list[float], form: str = ".1e") -> list[str]:
        return [name, *(format(value, form) for value in values)]

    law = markdown_table(
        row("time, s", found["times"], ".0f"),
        [
            row("sedimentation ratio", [h / 50e-6 for h in found["height"]], ".4f"),
            row("error", found["law"]),
            row("error, a quarter of the step", found["law_finer"]),
            row("error, without friction", found["law_without_friction"]),
            *(
                row(f"error of the central difference over ±{one['by']:g}", one["error"])
                for one in found["differences"]
            ),
        ],
    )
    late = markdown_table(
        row("time, s", found["late_times"], ".0f"), [row("error", found["late_law"])]
    )
    memory = markdown_table(
        ["steps", "run, MB", "forward, MB", "reverse, MB"],
        (
            [one["steps"], *(f"{one[name] / 1e6:.1f}" for name in ("run", "forward", "reverse"))]
            for one in found["memory"]
        ),
    )
    doubled = found["doubled"]
    return f"""## Gradients of the whole curve

Without inertia a suspension depends on time only through t / (f_w f_s f_v mu). Every height h
therefore obeys dh / d ln f = -t dh/dt, where f is any of the three factors or the viscosity.

The table compares derivatives with this law. The height is the mudline of case2 with friction. Its
derivative is that of forward mode through every step, and dh/dt is the velocity of the highest
particle.

{law}
Reverse mode gives the derivative of the sum of these heights. It agrees with forward mode to
{abs(found["reverse"]):.0e}.

Later the last particles reach the bed, and the bed creeps:

{late}
**The derivative is right while the mudline falls.** A friction spring stretches from the moment at
which its surfaces touch, at any point of a step, and begins to slide without a jump. The derivative
includes both, and its error falls with the step.

**The derivative is wrong in the creeping bed.** Particles stick and slip there, and single
avalanches determine the height. A small change of a parameter shifts the moments of the avalanches.
The derivative of one run is therefore not that of the mean. Use the law there: -t dh/dt from the
curve. For a quantity without such a law, use differences between means of ensembles.

Memory of the compiled programs for 314 particles:

{memory}
With twice the viscosity all {doubled["frames"]} frames are at twice the time to
{doubled["times"]:.0e}, and have the same ratios to {doubled["ratios"]:.0e}.
"""


def _of_kynch() -> str:
    found = json.loads((FOLDER / "kynch.json").read_text("utf-8"))
    table = markdown_table(
        ["quantity", "particles / Kynch"],
        [
            ["speed of the interface", f"{found['interface']:.4f}"],
            ["speed of the bed's front", f"{found['front']:.4f}"],
            ["time at which they meet", f"{found['meeting']:.4f}"],
        ],
    )
    return f"""## Kynch's theory

The particles are compared with Kynch's theory: means of {found["starts"]} random suspensions of
{found["particles"]} particles in a periodic column of {kynch.WIDTH} x {kynch.WIDTH} x
{kynch.HEIGHT} diameters. The volume fraction is {kynch.FRACTION}. The drag is local, by Richardson
and Zaki with n = {kynch.EXPONENT}, and there is no friction. The bed packs to
{found["bed_fraction"]:.3f} while it grows.

At this volume fraction one shock separates suspension and bed. At 0.2 the flux lies below the chord
between the two, and the bed grows through a fan of volume fractions instead.

{table}
![Kynch](kynch.png)
"""


def figures() -> dict[str, Figure]:
    """The figures of the page, by the name of their file."""
    return {"friction.png": _friction_figure(), "kynch.png": _kynch_figure()}


def _friction_figure() -> Figure:
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    for axes, sample in zip(figure.subplots(1, 2), SAMPLES, strict=True):
        for how, marker in (("dropped", "o"), ("settled", "D")):
            frictions = sorted(FRICTIONS + SCANNED)
            found = [ours(how, sample, "walls", friction) for friction in frictions]
            axes.errorbar(
                frictions,
                [one.mean() for one in found],
                [one.error() for one in found],
                fmt=f"{marker}-",
                capsize=3,
                label=f"mrjax, {how}",
            )
        found = [peers(sample, "walls", friction) for friction in FRICTIONS]
        axes.errorbar(
            FRICTIONS,
            [one.mean() for one in found],
            [one.error() for one in found],
            fmt="s--",
            color="0.4",
            capsize=3,
            label="LIGGGHTS, dropped",
        )
        axes.axhline(100 * PRINTED[sample], color="black", lw=0.8, label="printed")
        axes.set_xlabel("friction coefficient")
        axes.set_ylabel("final sedimentation ratio, %")
        axes.set_title(f"{sample}, between walls")
    axes.legend(frameon=False)
    return figure


def _kynch_figure() -> Figure:
    found = json.loads((FOLDER / "kynch.json").read_text("utf-8"))
    figure = Figure(figsize=(5.0, 3.6), layout="constrained")
    axes = figure.subplots()
    meets = kynch.FRACTION / found["bed_fraction"]
    axes.plot([0, 1], [1, meets], color="0.6", label="Kynch")
    axes.plot([0, 1, max(found["times"])], [0, meets, meets], color="0.6")
    axes.plot(found["times"], found["mudline"], ".", ms=3, label="interface, particles")
    axes.plot(found["times"], found["bed"], ".", ms=3, label="front of the bed, particles")
    axes.set_xlabel("time / t*")
    axes.set_ylabel("height / H")
    axes.legend(frameon=False)
    return figure


def text() -> str:
    """The page as Markdown."""
    return "\n".join(
        [
            HEADER,
            _against_liggghts(),
            _inferred(),
            "![friction](friction.png)\n",
            _slow(),
            _independent(),
            _of_gradients(),
            _of_kynch(),
        ]
    )
