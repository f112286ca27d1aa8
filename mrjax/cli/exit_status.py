"""Runs a command: one clear line for every failure, and an exit status that tells its kind."""

import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import NoReturn

import click

from mrjax.cli import exit_at_once, streams
from mrjax.cli.terminal import echo
from mrjax.core import refusals
from mrjax.core.errors import InputError, SimulationError
from mrjax.core.text import in_message

UNTRUSTED, WRONG_INPUT, REFUSED, INTERRUPTED = 1, 2, 3, 130
"""Exit statuses beside 0."""
EXIT_STATUS = (
    "Exit status: 0 done, 1 a result that is not to be trusted, 2 wrong input, 3 refused by the "
    "operating system (go on with --resume), 130 interrupted."
)
"""The last lines of every help."""


def _no_checkpoint() -> bool:
    return False


resumable: Callable[[], bool] = _no_checkpoint
"""Tells whether the command has kept something by now that `--resume` would go on with."""


def run(command: click.Command, name: str) -> None:
    """Runs a command and exits, with one line for every failure; the statuses: `EXIT_STATUS`."""
    streams.guard()
    exit_at_once.watch(lambda: _exit_interrupted(name, resumable()))
    status, text = _outcome(command, name)
    if text:
        echo(in_message(f"{name}: {text}"), err=True)
    if status == 0 and streams.lost_messages():
        status = REFUSED
    sys.exit(status)


def _outcome(command: click.Command, name: str) -> tuple[int, str]:
    """Runs a command; returns its exit status and the message for it, empty if there is none."""
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
        _exit_interrupted(name, resumable())
    except Exception as error:
        line = refusals.in_one_line(error)
        if line is None:
            raise
        return REFUSED, line


def _exit_interrupted(name: str, resumable: bool) -> NoReturn:
    """Ends the process, from any thread; says whether --resume would go on."""
    advice = "; go on with --resume" if resumable else ""
    click.echo(err=True)
    echo(f"{name}: interrupted; no results were written{advice}", err=True)
    with suppress(OSError):
        sys.stdout.flush()
    sys.stderr.flush()
    # After an interrupted compilation jaxlib 0.10.1 crashes while the interpreter shuts down.
    os._exit(INTERRUPTED)
