"""What the commands share of `--resume`: a folder for checkpoints, and what a failure leaves."""

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mrjax.cli import commands
from mrjax.core import refusals
from mrjax.core.errors import InputError, SimulationError, SystemRefusal
from mrjax.io import checkpoint, results, state_file
from mrjax.io.checkpoint import Checkpoint

FOLDER = "checkpoint"
LAST_GOOD = "last_good_state.npz"


@contextmanager
def kept(
    folder: Path, resume: bool, quiet: bool, writes: Iterable[str] = (), **work: Any
) -> Iterator[Path]:
    """A folder for checkpoints among the results, for as long as they are not written.

    A run that fails leaves its last good state among the results instead. Of the results' folder
    nothing is overwritten or deleted that mrjax did not write.

    Args:
      folder: of the results.
      resume: whether to go on with what is kept there.
      quiet: whether to say nothing of it.
      writes: names of results that are known beforehand.
      work: all that decides the results, by name.

    Raises:
      InputError: it keeps an unfinished run and `resume` was not given, or other work; or something
        of these names is not of mrjax.
      SimulationError: what was raised inside, with the name of the file of the last good state.
      SystemRefusal: the system refused something inside; what is kept stays, and it says so.
    """
    path = folder / FOLDER
    with results.guarded(folder, writes) as ours, _telling():
        checkpoint.refuse_foreign(path)
        if not resume and checkpoint.holds_anything(path):
            raise InputError(
                f"{path}: keeps an unfinished run; go on with --resume, or take it away, or give "
                "another --out, to begin anew"
            )
        Checkpoint.of_work(path, **work).claim()
        with checkpoint.locked(path), _leaving(path, ours):
            if checkpoint.holds_anything(path) and not quiet:
                commands.echo(f"Going on with what {path} keeps.", err=True)
            ours.discard(LAST_GOOD)
            commands.resumable = lambda: checkpoint.holds_anything(path)
            yield path


@contextmanager
def _leaving(path: Path, ours: results.Results) -> Iterator[None]:
    """What becomes of a checkpoint as its work ends, fails, or is stopped."""
    last_good = ours.folder / LAST_GOOD
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
    """Takes the checkpoint away, and says what of others stays."""
    if left := checkpoint.remove(path):
        more = "" if len(left) <= checkpoint.LISTED else ", ..."
        names = ", ".join(left[: checkpoint.LISTED]) + more
        commands.echo(f"mrjax: warning: {path}: left there what is not of mrjax: {names}", err=True)


@contextmanager
def _telling() -> Iterator[None]:
    """What the log warns of is a line on standard error."""
    log, telling = logging.getLogger("mrjax"), _Telling(logging.WARNING)
    log.addHandler(telling)
    try:
        yield
    finally:
        log.removeHandler(telling)


class _Telling(logging.Handler):
    """Prints what is logged."""

    def emit(self, record: logging.LogRecord) -> None:
        """Prints one line."""
        commands.echo(f"mrjax: warning: {record.getMessage()}", err=True)
