"""Options shared by several commands."""

import math
import re
from collections.abc import Callable
from typing import Any

import click


def out_option(default: str) -> Callable:
    """Returns the option `--out DIR`."""
    return click.option(
        "--out",
        type=str,
        default=default,
        show_default=True,
        metavar="DIR",
        help="Folder for the results; made if it does not exist.",
    )


class Finite(click.FloatRange):
    """A finite number within bounds; click's own type accepts nan with any bounds."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Converts a value to a number, or fails as click does."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{number} is not a finite number.", param, ctx)
        return number


seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**31 - 1),
    default=0,
    show_default=True,
    help="Seed of the random start.",
)

pdf_option = click.option("--pdf", is_flag=True, help="Writes figures as PDF, too.")

dtype_option = click.option(
    "--dtype",
    type=click.Choice(["float64", "float32"]),
    default="float64",
    show_default=True,
    help="Precision of the computation.",
)

quiet_option = click.option("--quiet", is_flag=True, help="Prints only warnings and errors.")

json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Prints the result as JSON on standard output, and nothing else there.",
)

resume_option = click.option(
    "--resume",
    is_flag=True,
    help="Continues a stopped run with the same --out and options, to bit-identical results. "
    "Starts a new run if none was saved.",
)

distributed_option = click.option(
    "--distributed",
    callback=lambda _context, _option, text: _parsed_processes(text),
    metavar="HOST:PORT,COUNT,ID",
    help="Divides the work among COUNT processes, on one machine or several. Run the same command "
    "in each process, with its own ID from 0 to COUNT - 1. HOST:PORT is the address of process 0, "
    "which alone writes results. `auto` asks the scheduler of a cluster (Slurm, Open MPI, ...).",
)


def _parsed_processes(text: str | None) -> tuple[str | None, int | None, int | None] | None:
    """Returns HOST:PORT, COUNT and ID; three times None for `auto`, and None without the option."""
    if text is None:
        return None
    if text == "auto":
        return None, None, None
    fields = re.fullmatch(r"(.+:\d+),(\d+),(\d+)", text)
    if fields is None or not int(fields[3]) < int(fields[2]):
        raise click.BadParameter(
            f"{text!r}: must be HOST:PORT,COUNT,ID with an ID from 0 to COUNT - 1, or auto"
        )
    return fields[1], int(fields[2]), int(fields[3])
