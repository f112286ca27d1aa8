"""The measurements as a page."""

import json
from pathlib import Path

from mrjax.core.text import in_code
from mrjax.dem.schedule import MOST_STEPS_BETWEEN_REBUILDS
from mrjax.io.files import markdown_table

from . import states, throughput

RESULTS = Path(__file__).with_name("speed.json")
PAGE = Path(__file__).with_name("README.md")

HEADER = """# Speed

Made by `python -m tests.studies.benchmarks.speed`. Medians of repetitions, with the least and the
greatest. Runs of two codes take turns on the same cores, and their ratios are those of neighbours
in time.
"""


def known(file: Path) -> dict[str, dict]:
    """What was measured so far, by part; nothing where there is no file."""
    return json.loads(file.read_text("utf-8")) if file.exists() else {}


def text(results: dict[str, dict]) -> str:
    """The page as Markdown, of the parts that are there."""
    written = {
        "throughput": _throughput,
        "curve": _curve,
        "compilation": _compilation,
        "gradients": _gradients,
        "scaling": _scaling,
        "ensemble": _ensemble,
        "command": _command,
    }
    parts = [write(results[name]["rows"]) for name, write in written.items() if name in results]
    return "\n".join([HEADER, _machines(results), *parts])


def _machines(results: dict[str, dict]) -> str:
    """One line for each machine or version that measured a part."""
    found: dict[str, list[str]] = {}
    for name, part in results.items():
        of = part["machine"]
        line = (
            f"{of['processor']}, {of['cores']} cores; Python {of['python']}, jax {of['jax']}, "
            f"jaxlib {of['jaxlib']}, mrjax {of['mrjax']}, "
            + (f"LIGGGHTS {of['liggghts']} (Debian)" if of["liggghts"] else "no LIGGGHTS")
        )
        found.setdefault(line, []).append(name)
    if len(found) == 1:
        return f"{next(iter(found))}.\n"
    return "".join(f"- {', '.join(names)}: {line}.\n" for line, names in found.items())


def _throughput(rows: list[dict]) -> str:
    rows = sorted(rows, key=lambda row: (row["phase"], row["particles"], row["cores"]))
    return f"""## Particle-steps

Million particle-steps in a second. Without a fluid, in both codes: E = 1e7 Pa, nu = 0.31, 7470
kg/m^3, 4 um, mu = {states.FRICTION}, e = 0.5, steps of 5e-8 s, lists that reach 0.4 um beyond
contact, rigid walls on all sides. 314 particles in 25 x 25 x 50 um; larger beds are that state
beside its mirror images. Dispersed as `mrjax.disperse` leaves them, or at rest between walls that
had no friction, so that images hold each other; springs of friction are forgotten.
LIGGGHTS on two cores is `mpirun -np 2`; mrjax is one run with both to be seen. Both are timed from
step to step, rebuilds of the list included: LIGGGHTS' loop time, and the time by which a longer run
of mrjax exceeds a shorter one. What precedes the first step of a run, a list above all, is apart.

{_rates(rows)}
What they leave behind: rebuilds of the list in the steps that were timed (of mrjax, how often it
looked whether one was needed), the mean height, um, and contacts with other particles. LIGGGHTS'
contacts pull at their end where those of mrjax only push, so that beds that still move
differ a little.

{_left_behind(rows)}"""


def _rates(rows: list[dict]) -> str:
    """Particle-steps in a second, and their ratios."""

    def rate(row: dict, code: str) -> str:
        return _span(row[code]["rate"], 1e-6) if code in row else ""

    def ratio(row: dict, code: str) -> str:
        return _span(row[code]["over_liggghts"]) if "liggghts" in row else ""

    return markdown_table(
        ["N", "phase", "cores", "LIGGGHTS", "float64", "over LIGGGHTS", "float32", "over LIGGGHTS"],
        [
            [
                f"{row['particles']:,}",
                row["phase"],
                row["cores"],
                rate(row, "liggghts"),
                *(
                    cell
                    for code in throughput.DTYPES
                    for cell in (rate(row, code), ratio(row, code))
                ),
            ]
            for row in rows
        ],
    )


def _left_behind(rows: list[dict]) -> str:
    """What the beds are after the timed steps, and how often the list was looked at."""
    codes = ("liggghts", *throughput.DTYPES)

    def of_each(row: dict, what: str, scale: float, digits: int) -> list[str]:
        there = (row.get(code, {}) for code in codes)
        return [f"{scale * one[what]:.{digits}f}" if what in one else "" for one in there]

    return markdown_table(
        [
            "N",
            "phase",
            "cores",
            "steps",
            "start, s, float64",
            *(f"{what}, {code}" for what in ("builds", "height", "contacts") for code in _CODES),
        ],
        [
            [
                f"{row['particles']:,}",
                row["phase"],
                row["cores"],
                row["steps"],
                _span(row["float64"]["start"]),
                *of_each(row, "builds", 1.0, 0),
                *of_each(row, "mean_height", 1e6, 4),
                *of_each(row, "coordination_number", 1.0, 3),
            ]
            for row in rows
        ],
    )


_CODES = ("LIGGGHTS", "float64", "float32")


def _curve(rows: list[dict]) -> str:
    table = markdown_table(
        ["cores", "steps", "mrjax in oil, s", "LIGGGHTS dry, s", "LIGGGHTS dry over mrjax in oil"],
        [
            [
                row["cores"],
                f"{row['steps']:,}",
                _span(row["seconds"]),
                _span(row["dry"]["seconds"]) if "dry" in row else "",
                _span(row["dry"]["over_ours"]) if "dry" in row else "",
            ]
            for row in rows
        ],
    )
    body = f"""## The whole curve of case2

{rows[0]["duration"]:.0f} s of settling at the true viscosity to rest, by `mrjax.sedimentation`;
beside LIGGGHTS that drops the same particles without a fluid, on one core.

{table}"""
    if "dragged" not in rows[0]:
        return body
    of = rows[0]["dragged"]
    steps = rows[0]["duration"] / of["largest_step"]
    return f"""{body}
With the drag of case2 as `fix viscous` the largest step at which LIGGGHTS falls as it should is
{of["largest_step"]:.3g} s, found by bisection (twice the mass over the drag:
{of["two_masses_over_drag"]:.3g} s). In a bed it takes {of["seconds_per_step"]:.2g} s a step: the
{steps:.2g} steps of the curve would be {of["seconds"] / 86400:.3g} days on one core, extrapolated.
"""


def _compilation(rows: list[dict]) -> str:
    table = markdown_table(
        ["program", "first call, s", "second, s", "compilation, s"],
        [
            [row["program"], *(f"{row[key]:.3g}" for key in ("first", "second", "compilation"))]
            for row in rows
        ],
    )
    return f"""## Compilation

The first call less the second, each program in a process of its own.

{table}"""


def _gradients(rows: list[dict]) -> str:
    table = markdown_table(
        [
            "steps",
            "cores",
            "program",
            "s",
            "over the run",
            "over its own run",
            "peak, MB",
            "planned, MB",
        ],
        [
            [
                f"{row['steps']:,}",
                row["cores"],
                name,
                _span(one["seconds"]),
                f"{one['over_run']:.3g}",
                f"{one['over_own_run']:.3g}",
                _megabytes(one["peak"]),
                _megabytes(one["planned"]),
            ]
            for row in rows
            for name, one in row["programs"].items()
        ],
    )
    return f"""## Gradients

Value and gradient of the mean height at the end, from a bed of case2 that rests in oil. The
gradient by every leaf of `Parameters` takes all laws, those with coefficients of zero as well, the
others those that act; its own run is that of the same function of the same argument. Memory is what
the first call takes beyond what there was, and what the compiler planned for it.

{table}"""


def _scaling(rows: list[dict]) -> str:
    table = markdown_table(
        [
            "N",
            "ns for a particle-step",
            "a rebuild, in steps",
            "share of rebuilds, %",
            "if in every step, %",
            "peak, MB",
            "bytes for a particle",
        ],
        [
            [
                f"{row['particles']:,}",
                _span(row["seconds_per_particle_step"], 1e9),
                _span(row["rebuild_in_steps"]),
                _span(row["share_of_rebuilds"], 100.0),
                _span(row["share_if_every_step"], 100.0),
                _megabytes(row["peak"]),
                f"{row['bytes_per_particle']:,.0f}",
            ]
            for row in rows
        ],
    )
    return f"""## Size

The bed at rest without a fluid, on one core in float64, with a list that is kept for
{MOST_STEPS_BETWEEN_REBUILDS} steps, the most a run chooses, and with one that is rebuilt in every
step. Memory is what a call takes beyond what there was.

{table}"""


def _ensemble(rows: list[dict]) -> str:
    table = markdown_table(
        ["cores", "way", "members", "steps", "one, s", "all, s", "all over one"],
        [
            [
                row["cores"],
                in_code(row["way"]),
                row["members"],
                f"{row['steps']:,}",
                _span(row["one"]),
                _span(row["seconds"]),
                _span(row["over_one"]),
            ]
            for row in rows
        ],
    )
    return f"""## Ensembles

Members in one compiled call against one alone, from a bed of case2 that rests in oil. With two
cores there are two devices, among which `mrjax.ensemble` divides the members.

{table}"""


def _command(rows: list[dict]) -> str:
    table = markdown_table(
        ["start", "cores", "wall, s", "CPU, s"],
        [[row["start"], row["cores"], f"{row['wall']:.1f}", f"{row['cpu']:.1f}"] for row in rows],
    )
    return f"""## `mrjax-calibrate fang2005`

As a process of its own, with an empty cache, and again with what that left there.

{table}"""


def _span(values: dict[str, float], scale: float = 1.0) -> str:
    median, least, greatest = (scale * values[key] for key in ("median", "least", "greatest"))
    return f"{median:.3g} ({least:.3g} to {greatest:.3g})"


def _megabytes(number: int | None) -> str:
    return "" if number is None else f"{number / 1e6:.3g}"
