"""Runs a command, with one line for each failure and an exit status for each kind of failure."""

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
"""Exit statuses other than 0."""
EXIT_STATUS = (
    "Exit status: 0 done, 1 a result that must not be used, 2 wrong input, 3 refused by the "
    "operating system (go on with --resume), 130 interrupted."
)
"""The last lines of every help text."""


def _no_checkpoint() -> bool:
    return False


resumable: Callable[[], bool] = _no_checkpoint
"""Function that returns True if the command has saved work with which `--resume` can go on."""


def run(command: click.Command, name: str) -> None:
    """Runs a command and exits with a status of `EXIT_STATUS`; prints one line for a failure."""
    streams.guard()
    exit_at_once.watch(lambda: _exit_interrupted(name, resumable()))
    status, text = _outcome(command, name)
    if text:
        echo(in_message(f"{name}: {text}"), err=True)
    if status == 0 and streams.lost_messages():
        status = REFUSED
    sys.exit(status)


def _outcome(command: click.Command, name: str) -> tuple[int, str]:
    """Runs a command; returns its exit status and the message of a failure, or an empty text."""
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
    """Ends the process, from any thread; the message names --resume if it can go on."""
    advice = "; go on with --resume" if resumable else ""
    click.echo(err=True)
    echo(f"{name}: interrupted; no results were written{advice}", err=True)
    with suppress(OSError):
        sys.stdout.flush()
    sys.stderr.flush()
    # jaxlib 0.10.1 crashes at the end of the interpreter if a compilation was interrupted.
    os._exit(INTERRUPTED)
