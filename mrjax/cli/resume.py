"""`--resume`: the folder of checkpoints among the results, and what a failure leaves there."""

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mrjax.cli import exit_status
from mrjax.cli.terminal import echo
from mrjax.core import refusals
from mrjax.core.errors import InputError, SimulationError, SystemRefusal
from mrjax.io import checkpoint, results, state_file
from mrjax.io.checkpoint import Checkpoint

FOLDER = "checkpoint"
LAST_GOOD = "last_good_state.npz"


@contextmanager
def checkpointed(
    folder: Path, resume: bool, quiet: bool, writes: Iterable[str] = (), **work: Any
) -> Iterator[Path]:
    """Context with a folder for checkpoints among the results, until these are written.

    A run that fails leaves its last good state among the results instead. Of the results' folder
    nothing is overwritten or deleted that mrjax did not write.

    Args:
      folder: of the results.
      resume: whether to go on with what is kept there.
      quiet: whether to print nothing about it.
      writes: names of results that are known beforehand.
      work: all that decides the results, by name.

    Raises:
      InputError: it keeps an unfinished run and `resume` was not given, or other work; or something
        of these names is not of mrjax.
      SimulationError: what was raised inside, with the name of the file of the last good state.
      SystemRefusal: the system refused something inside; what is kept stays, and it says so.
    """
    path = folder / FOLDER
    with results.guarded(folder, writes) as own_files, _echoed_warnings():
        checkpoint.refuse_foreign(path)
        if not resume and checkpoint.holds_anything(path):
            raise InputError(
                f"{path}: keeps an unfinished run; go on with --resume, or take it away, or give "
                "another --out, to begin anew"
            )
        Checkpoint.open(path, **work).claim()
        with checkpoint.locked(path), _removed_when_done(path, own_files):
            if checkpoint.holds_anything(path) and not quiet:
                echo(f"Going on with what {path} keeps.", err=True)
            own_files.discard(LAST_GOOD)
            exit_status.resumable = lambda: checkpoint.holds_anything(path)
            yield path


@contextmanager
def _removed_when_done(path: Path, own_files: results.Results) -> Iterator[None]:
    """Takes a checkpoint away when its work ends or fails; keeps it when that is stopped."""
    last_good = own_files.folder / LAST_GOOD
    try:
        yield
    except SimulationError as error:
        _remove(path)
        if error.state is None or error.time is None:
            raise
        state_file.save_state(last_good, error.state, error.time)
        raise SimulationError(
            f"{error}; the last good state, of {error.time:.6g} s, is in {last_good}"
        ) from None
    except OSError as error:
        line = refusals.in_one_line(error)
        if checkpoint.holds_anything(path):
            line = f"{line}; then go on with --resume"
        raise SystemRefusal(line) from error
    else:
        _remove(path)
    finally:
        if not checkpoint.holds_anything(path):
            _remove(path)


def _remove(path: Path) -> None:
    """Takes the checkpoint away, and names what stays there because mrjax did not make it."""
    if left := checkpoint.remove(path):
        more = "" if len(left) <= checkpoint.MOST_NAMES else ", ..."
        names = ", ".join(left[: checkpoint.MOST_NAMES]) + more
        echo(f"mrjax: warning: {path}: left there what is not of mrjax: {names}", err=True)


@contextmanager
def _echoed_warnings() -> Iterator[None]:
    """Prints warnings of mrjax's log as lines on standard error."""
    log, handler = logging.getLogger("mrjax"), _EchoHandler(logging.WARNING)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


class _EchoHandler(logging.Handler):
    """Prints log records on standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        """Prints one line."""
        echo(f"mrjax: warning: {record.getMessage()}", err=True)
