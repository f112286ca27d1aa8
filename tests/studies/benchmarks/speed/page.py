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

Each number is the median of repetitions, with the least and the greatest in brackets. Two codes are
timed in turn on the same cores, and a ratio is that of two successive runs.

Made by `python -m tests.studies.benchmarks.speed`, with these processors and versions:
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
    parts_by_machine: dict[str, list[str]] = {}
    for name, part in results.items():
        machine = part["machine"]
        line = (
            f"{machine['processor']}, {machine['cores']} cores; Python {machine['python']}, "
            f"jax {machine['jax']}, jaxlib {machine['jaxlib']}, mrjax {machine['mrjax']}, "
            + (f"LIGGGHTS {machine['liggghts']} (Debian)" if machine["liggghts"] else "no LIGGGHTS")
        )
        parts_by_machine.setdefault(line, []).append(name)
    if len(parts_by_machine) == 1:
        return f"{next(iter(parts_by_machine))}.\n"
    return "".join(
        f"- {', '.join(parts)}: {machine}.\n" for machine, parts in parts_by_machine.items()
    )


def _throughput(rows: list[dict]) -> str:
    rows = sorted(rows, key=lambda row: (row["phase"], row["particles"], row["cores"]))
    return f"""## Particle-steps

The table has million particle-steps per second. Both codes compute the same bed:

- There is no fluid. E = 1e7 Pa, nu = 0.31, density 7470 kg/m³, diameter 4 µm, friction
  {states.FRICTION}, restitution 0.5, steps of 5e-8 s, rigid walls on all sides. The neighbour list
  reaches 0.4 µm beyond contact.
- 314 particles fill a box of 25 x 25 x 50 µm. A larger bed is this box beside its mirror images.
- A dilute bed is that of `mrjax.disperse`. A settled bed is at rest between walls without friction,
  so that the mirror images support each other, and has no history of friction.
- On two cores LIGGGHTS runs as `mpirun -np 2`, and mrjax as one process.

Times include the rebuilds of the list. That of LIGGGHTS is its loop time. That of mrjax is the
difference between a longer and a shorter run, so the time before the first step is not in it.

{_rates(rows)}
The time before the first step, and the rebuilds of the list during the timed steps. For mrjax they
are the checks of whether a rebuild is needed.

{_before_and_rebuilds(rows)}
Both codes end in nearly the same state: mean height in µm, and contacts of a particle with others.
Beds that still move differ a little, because the contacts of LIGGGHTS pull at their end.

{_end_states(rows)}"""


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


def _before_and_rebuilds(rows: list[dict]) -> str:
    """Time before the first step, and rebuilds of the neighbour list."""
    return markdown_table(
        [*_BED, "steps", "start, s, float64", *(f"builds, {code}" for code in _CODES)],
        [
            [
                *_bed(row),
                f"{row['steps']:,}",
                _span(row["float64"]["start"]),
                *_by_code(row, "builds", 1.0, 0),
            ]
            for row in rows
        ],
    )


def _end_states(rows: list[dict]) -> str:
    """Mean height and coordination number after the timed steps."""
    return markdown_table(
        [*_BED, *(f"{quantity}, {code}" for quantity in ("height", "contacts") for code in _CODES)],
        [
            [
                *_bed(row),
                *_by_code(row, "mean_height", 1e6, 4),
                *_by_code(row, "coordination_number", 1.0, 3),
            ]
            for row in rows
        ],
    )


_BED = ("N", "phase", "cores")
_CODES = ("LIGGGHTS", "float64", "float32")


def _bed(row: dict) -> list:
    return [f"{row['particles']:,}", row["phase"], row["cores"]]


def _by_code(row: dict, key: str, scale: float, digits: int) -> list[str]:
    """A quantity of each code; empty where it was not measured."""
    results = (row.get(code, {}) for code in ("liggghts", *throughput.DTYPES))
    return [f"{scale * one[key]:.{digits}f}" if key in one else "" for one in results]


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

`mrjax.sedimentation` computes {rows[0]["duration"]:.0f} s of settling to rest at the true
viscosity. LIGGGHTS drops the same particles without a fluid, on one core.

{table}"""
    if "dragged" not in rows[0]:
        return body
    drag = rows[0]["dragged"]
    steps = rows[0]["duration"] / drag["largest_step"]
    return f"""{body}
LIGGGHTS with the drag of case2 as `fix viscous` falls correctly up to a step of
{drag["largest_step"]:.3g} s, found by bisection. Twice the mass over the drag coefficient is
{drag["two_masses_over_drag"]:.3g} s. A step of the bed takes {drag["seconds_per_step"]:.2g} s, so
the {steps:.2g} steps of the curve would take {drag["seconds"] / 86400:.3g} days on one core
(extrapolated).
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

The time of compilation is the first call less the second. Each program has a process of its own.

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

The programs compute the mean height at the end of a run, and its gradient, from a bed of case2 at
rest in oil. A gradient by every leaf of `Parameters` includes laws whose coefficients are zero; the
other programs leave them out. "Over its own run" divides by a run with the same laws. Peak memory
is the increase in the first call, and planned memory is that of the compiler.

{table}"""


def _scaling(rows: list[dict]) -> str:
    table = markdown_table(
        [
            "N",
            "ns for a particle-step",
            "a rebuild, in steps",
            "share of rebuilds, %",
            "share if in every step, %",
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
    return f"""## Number of particles

The bed is at rest without a fluid, on one core in float64. The neighbour list is rebuilt every
{MOST_STEPS_BETWEEN_REBUILDS} steps, the largest interval of a run, or in every step. Peak memory is
the increase in a call.

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

One compiled call computes all members, from a bed of case2 at rest in oil. The last column divides
its time by that of one member alone. With two cores there are two devices, and `mrjax.ensemble`
divides the members among them.

{table}"""


def _command(rows: list[dict]) -> str:
    table = markdown_table(
        ["start", "cores", "wall, s", "CPU, s"],
        [[row["start"], row["cores"], f"{row['wall']:.1f}", f"{row['cpu']:.1f}"] for row in rows],
    )
    return f"""## `mrjax-calibrate fang2005`

The command runs in a process of its own: first with an empty cache of compiled programs (cold),
then with the cache that the first run filled (second).

{table}"""


def _span(values: dict[str, float], scale: float = 1.0) -> str:
    median, least, greatest = (scale * values[key] for key in ("median", "least", "greatest"))
    return f"{median:.3g} ({least:.3g} to {greatest:.3g})"


def _megabytes(number: int | None) -> str:
    return "" if number is None else f"{number / 1e6:.3g}"
