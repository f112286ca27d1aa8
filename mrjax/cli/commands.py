"""What the command lines share: options, versions, and one clear line for every failure.

JAX is imported where a command begins its work, so that `--help` and completion need not wait.
"""

import importlib.metadata
import math
import os
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click
from click.shell_completion import CompletionItem

from mrjax.cli import exit_at_once, streams
from mrjax.core import refusals
from mrjax.core.errors import InputError, SimulationError, shown
from mrjax.core.text import in_message, in_terminal

if TYPE_CHECKING:
    from mrjax.recipe.recipe import Recipe

UNTRUSTED, WRONG_INPUT, REFUSED, INTERRUPTED = 1, 2, 3, 130
"""Exit statuses beside 0."""
EXIT_STATUS = (
    "Exit status: 0 done, 1 a result that is not to be trusted, 2 wrong input, 3 refused by the "
    "operating system (go on with --resume), 130 interrupted."
)
"""The last lines of every help."""

PACKAGES = ("mrjax", "jax", "jaxlib", "jax-md", "optax", "scipy", "numpy")


def _nothing_kept() -> bool:
    return False


resumable: Callable[[], bool] = _nothing_kept
"""Whether the command keeps what `--resume` would go on with, by now."""


def out_option(default: str) -> Callable:
    """`--out DIR`."""
    return click.option(
        "--out",
        type=str,
        default=default,
        show_default=True,
        metavar="DIR",
        help="Folder for the results; made if need be.",
    )


class Finite(click.FloatRange):
    """A number within bounds: click's own lets nan pass all of them."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number, or a failure of click's."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{number} is not a finite number.", param, ctx)
        return number


seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**31 - 1),
    default=0,
    show_default=True,
    help="Of the random start.",
)

pdf_option = click.option("--pdf", is_flag=True, help="Writes figures as PDF, too.")

dtype_option = click.option(
    "--dtype",
    type=click.Choice(["float64", "float32"]),
    default="float64",
    show_default=True,
    help="Precision of the computation.",
)

quiet_option = click.option(
    "--quiet", is_flag=True, help="Nothing on the terminal but warnings and errors."
)

json_option = click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="The result as JSON on standard output, and nothing else there.",
)

resume_option = click.option(
    "--resume",
    is_flag=True,
    help="Goes on where a run with the same --out and options was stopped, and ends with the same "
    "bits. Where nothing was kept yet, begins.",
)

distributed_option = click.option(
    "--distributed",
    callback=lambda _context, _option, text: _processes(text),
    metavar="HOST:PORT,COUNT,ID",
    help="One of COUNT processes on one machine or several that divide the work: the same command "
    "for all, but for the ID, 0 to COUNT - 1. HOST:PORT is where process 0, which alone writes "
    "results, can be reached. `auto` asks the scheduler of a cluster (Slurm, Open MPI, ...).",
)


def _processes(text: str | None) -> tuple[str | None, int | None, int | None] | None:
    """HOST:PORT, COUNT and ID; nothing of them for `auto`, and None without the option."""
    if text is None:
        return None
    if text == "auto":
        return None, None, None
    found = re.fullmatch(r"(.+:\d+),(\d+),(\d+)", text)
    if found is None or not int(found[3]) < int(found[2]):
        raise click.BadParameter(
            f"{text!r}: must be HOST:PORT,COUNT,ID with an ID from 0 to COUNT - 1, or auto"
        )
    return found[1], int(found[2]), int(found[3])


def echo(line: str, err: bool = False) -> None:
    """Prints a line, of any text, on standard output, or on standard error."""
    stream = sys.stderr if err else sys.stdout
    click.echo(in_terminal(line, getattr(stream, "encoding", None)), err=err)


def write_new(texts: dict[Path, str]) -> None:
    """Writes files for a user to change.

    Raises:
      InputError: one of them is there already.
      SystemRefusal: one cannot be written.
    """
    from mrjax.io import files

    for path in texts:
        if not str(path).isprintable():
            raise InputError(f"{shown(str(path))}: is no file name; give another")
        if os.path.lexists(path):
            raise InputError(f"{path}: is there already; give another name")
    for path, text in texts.items():
        with refusals.writing(path):
            files.create_text(path, text)


def sheet_names(package: str) -> Callable[..., list[CompletionItem]]:
    """Completes what is bundled in a package or a TOML file here, and other paths where none is.

    Bash completes paths by itself only where it is given nothing else.
    """

    def complete(
        _context: click.Context, _parameter: click.Parameter, begun: str
    ) -> list[CompletionItem]:
        from mrjax.recipe import sheets

        names = [*sorted(sheets.bundled(package)), *sorted(map(str, Path().glob("*.toml")))]
        # One that is no line of text would be another answer to the shell.
        fits = [name for name in names if name.startswith(begun) and name.isprintable()]
        found = [CompletionItem(name) for name in fits]
        return found or [CompletionItem(begun, type="file")]

    return complete


def start_jax(dtype: str, devices: bool = True) -> None:
    """Makes `dtype` JAX's default for the rest of the process, and keeps what it compiles.

    Comes before all that imports JAX.

    Args:
      dtype: float64 or float32.
      devices: whether to have JAX find its devices now.

    Raises:
      InputError: an environment variable that JAX cannot use.
    """
    from mrjax.cli import environment

    environment.start_jax(dtype)
    if devices:
        environment.find_devices()
    from mrjax.cli import program_cache

    program_cache.keep()


def versions() -> dict[str, str]:
    """Versions of the packages that made a result."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def made_by(sheet: "Recipe", seed: int, dtype: str) -> dict[str, Any]:
    """What made a result; `Recipe.model_validate` takes its lab sheet."""
    return {
        "recipe": sheet.name,
        "lab_sheet": sheet.model_dump(mode="json", exclude_none=True),
        "seed": seed,
        "dtype": dtype,
        "versions": versions(),
    }


def run(command: click.Command, name: str) -> None:
    """Runs a command and exits, with one line for every failure; the statuses: `EXIT_STATUS`."""
    streams.guard()
    exit_at_once.watch(lambda: _interrupted(name, resumable()))
    status, text = _outcome(command, name)
    if text:
        echo(in_message(f"{name}: {text}"), err=True)
    if status == 0 and streams.lost_messages():
        status = REFUSED
    sys.exit(status)


def _outcome(command: click.Command, name: str) -> tuple[int, str]:
    """Exit status of a command that has run, and what there is to say of it."""
    try:
        status = command.main(prog_name=name, standalone_mode=False)
        sys.stdout.flush()
        return status or 0, ""
    except click.ClickException as error:
        return WRONG_INPUT, error.format_message()
    except InputError as error:
        return WRONG_INPUT, str(error)
    except SimulationError as error:
        return UNTRUSTED, str(error)
    except (KeyboardInterrupt, click.Abort):
        _interrupted(name, resumable())
    except Exception as error:
        line = refusals.in_one_line(error)
        if line is None:
            raise
        return REFUSED, line


def _interrupted(name: str, resumable: bool) -> NoReturn:
    """Ends the process, from any thread; says whether --resume would go on."""
    advice = "; go on with --resume" if resumable else ""
    click.echo(err=True)
    echo(f"{name}: interrupted; no results were written{advice}", err=True)
    with suppress(OSError):
        sys.stdout.flush()
    sys.stderr.flush()
    # After an interrupted compilation jaxlib 0.10.1 crashes while the interpreter shuts down.
    os._exit(INTERRUPTED)
