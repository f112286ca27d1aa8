"""The option `--resume`: the checkpoint in the folder of the results, and the last good state."""

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
    """Context with a checkpoint folder among the results, which is removed once they are written.

    If a run fails, its last good state is saved among the results. No file that mrjax did not write
    is overwritten or deleted.

    Args:
      folder: folder of the results.
      resume: True to continue the work saved in the checkpoint.
      quiet: True to print nothing about it.
      writes: names of result files that are known beforehand.
      work: everything that the results depend on, by name.

    Raises:
      InputError: the checkpoint holds an unfinished run and `resume` is False, or it holds other
        work; or mrjax did not write one of the files in `writes`.
      SimulationError: a run failed; the message names the file of the last good state.
      SystemRefusal: the system refused a file; the checkpoint stays, and the message says so.
    """
    path = folder / FOLDER
    with results.guarded(folder, writes) as own_files, _echoed_warnings():
        checkpoint.refuse_foreign(path)
        if not resume and checkpoint.holds_anything(path):
            raise InputError(
                f"{path}: holds an unfinished run; go on with --resume, or take it away, or give "
                "another --out, to begin anew"
            )
        Checkpoint.open(path, **work).claim()
        with checkpoint.locked(path), _removing_checkpoint(path, own_files):
            if checkpoint.holds_anything(path) and not quiet:
                echo(f"Going on with the checkpoint {path}.", err=True)
            own_files.discard(LAST_GOOD)
            exit_status.resumable = lambda: checkpoint.holds_anything(path)
            yield path


@contextmanager
def _removing_checkpoint(path: Path, own_files: results.Results) -> Iterator[None]:
    """Context that removes a checkpoint if the work ends or fails, but not if it is stopped."""
    last_state = own_files.folder / LAST_GOOD
    try:
        yield
    except SimulationError as error:
        _remove(path)
        if error.state is None or error.time is None:
            raise
        state_file.save_state(last_state, error.state, error.time)
        raise SimulationError(
            f"{error}; the last good state, at {error.time:.6g} s, is in {last_state}"
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
    """Removes the checkpoint; warns of files that stay because mrjax did not make them."""
    if remaining := checkpoint.remove(path):
        more = "" if len(remaining) <= checkpoint.MOST_NAMES else ", ..."
        names = ", ".join(remaining[: checkpoint.MOST_NAMES]) + more
        echo(f"mrjax: warning: {path}: kept files that mrjax did not make: {names}", err=True)


@contextmanager
def _echoed_warnings() -> Iterator[None]:
    """Context that prints warnings of mrjax's log on standard error."""
    log, handler = logging.getLogger("mrjax"), _EchoHandler(logging.WARNING)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


class _EchoHandler(logging.Handler):
    """Prints log records on standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        """Prints a log record as one line."""
        echo(f"mrjax: warning: {record.getMessage()}", err=True)
