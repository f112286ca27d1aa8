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

The paper's boxes: 314 particles of 4 um (case2) and 292 of 4.4 um (case3) in 25 x 25 x 50 um.
Ratios are heights over the initial one, means of {beds.STARTS} random starts with their standard
errors, in per cent. Made by `python -m tests.studies.settling` from `beds.csv`, `gradients.json`
and `kynch.json` beside this page, which the same command measures where they are missing.
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
    columns = ["sample", "sides", "friction", "LIGGGHTS, top", "mrjax, top"]
    table = markdown_table(columns + [f"difference, {name}" for name in interface.HEIGHTS], rows)
    return f"""## Dropped without a fluid, beside LIGGGHTS 3.8

Both let the particles fall in a vacuum: E = 1e7 Pa, restitution 0.5, steps of 5e-8 s, own random
starts (three of LIGGGHTS). Differences in percentage points; the bar is {LIKE_FOR_LIKE} for the
top of the highest particle. The other columns are other definitions of height: half-concentration
differs by up to 0.2 by how the two look for the level.

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
        ["height", "friction", *(f"{s} (printed {100 * PRINTED[s]:.1f})" for s in SAMPLES), "miss"],
        rows,
    )
    return f"""## Friction and definition of height, inferred

The paper prints final ratios of 69.3 and 86.4 % and gives neither the friction coefficient nor what
it calls the height nor the sides of its box. All definitions and coefficients, for beds between
walls; "miss" is the larger distance of the two samples. Nearest: **{best[0]} with a friction
coefficient of {best[1]:g}**. Between periodic sides no coefficient reaches 86.4 % by any
definition: the largest is {periodic:.1f} %. This is an inference, not a statement of the paper.

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
    columns = ["sample", "friction", "dropped, top", "settled, top", f"settled with {TWICE}, top"]
    table = markdown_table(columns + [f"difference, {name}" for name in interface.HEIGHTS], rows)
    return f"""## What slow settling makes of a bed

The same boxes between walls, settled at their true viscosity with contacts softened to an overlap
of {OVERLAP:g} radii, against those dropped: settled minus dropped, in percentage points.

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
            "moved, same starts",
            "moved, mass-quantile",
            "curve moved by at most",
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
    return f"""## What must not matter

Case2 between walls at its true viscosity, friction {SCANNED[0]:g}: {base.shown()} by the top with
the default overlap of {OVERLAP:g} radii; the standard error of the curve is at most {widest:.2f}.
The same starts with one thing changed. The overlap matters: a softer bed packs more densely, by
more than its contacts yield. Step, skin, rebuilds and precision were changed with twice the
overlap, at half the cost, and are compared with that.

{table}"""


def _of_gradients() -> str:
    found = json.loads((FOLDER / "gradients.json").read_text("utf-8"))

    def row(name: str, values: list[float], form: str = ".1e") -> list[str]:
        return [name, *(format(value, form) for value in values)]

    law = markdown_table(
        row("time, s", found["times"], ".0f"),
        [
            row("sedimentation ratio", [h / 50e-6 for h in found["height"]], ".4f"),
            row("off the law", found["law"]),
            row("off the law, a quarter of the step", found["law_finer"]),
            row("off the law, without friction", found["law_without_friction"]),
            *(
                row(f"central difference over ±{one['by']:g}, off", one["error"])
                for one in found["differences"]
            ),
        ],
    )
    late = markdown_table(
        row("time, s", found["late_times"], ".0f"), [row("off the law", found["late_law"])]
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

Without inertia the suspension knows of time only t / (f_w f_s f_v mu), so that
dh / d ln f = -t dh/dt for each of these and any height h. Here h is the mudline of case2 with
friction, its derivative that of forward mode through every step, dh/dt the velocity of the
highest particle.

{law}
Reverse mode gives the same derivative of the sum of these heights to {abs(found["reverse"]):.0e}.

Later, while the bed takes in the last particles and creeps, sticking and slipping:

{late}
**Where the curve stops being smooth.** A spring of friction stretches from the moment at which its
surfaces meet, wherever in a step that is, and yields without a jump: the derivative sees both, and
its error falls with the step as long as the mudline falls. When the highest particles have come to
the bed, particles creep, stick and slip; single avalanches decide, at moments that small changes
move, and the derivative of one history is nothing like that of the mean. There use the law itself,
-t dh/dt from the curve; for what has no law, differences between means of ensembles.

Memory that the compiled programs hold at once (314 particles):

{memory}
Twice the viscosity: all {doubled["frames"]} frames at twice the time to {doubled["times"]:.0e},
with the same ratios to {doubled["ratios"]:.0e}.
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

Means of {found["starts"]} random suspensions of {found["particles"]} particles in a periodic
column {kynch.WIDTH} by {kynch.WIDTH} by {kynch.HEIGHT} diameters, phi = {kynch.FRACTION}, local
drag by Richardson & Zaki with n = {kynch.EXPONENT}, no friction. The bed packs to
{found["bed_fraction"]:.3f} while it grows. Here suspension and bed meet in one shock; at phi = 0.2
they would not, as the flux then dips below the chord, and a bed grows through a fan of fractions.

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
