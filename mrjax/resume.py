"""What the commands share of `--resume`: a folder for checkpoints, and what a failure leaves."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mrjax import checkpoint, commands, refusals, state_file
from mrjax.checkpoint import Checkpoint
from mrjax.errors import InputError, SimulationError, SystemRefusal

FOLDER = "checkpoint"
LAST_GOOD = "last_good_state.npz"


@contextmanager
def kept(folder: Path, resume: bool, quiet: bool, **work: Any) -> Iterator[Path]:
    """A folder for checkpoints among the results, for as long as they are not written.

    A run that fails leaves its last good state among the results instead.

    Args:
      folder: of the results.
      resume: whether to go on with what is kept there.
      quiet: whether to say nothing of it.
      work: all that decides the results, by name.

    Raises:
      InputError: it keeps an unfinished run and `resume` was not given, or other work.
      SimulationError: what was raised inside, with the name of the file of the last good state.
      SystemRefusal: the system refused something inside; what is kept stays, and it says so.
      KeyboardInterrupt: likewise, with how to go on.
    """
    path = folder / FOLDER
    checkpoint.refuse_foreign(path)
    if not resume and checkpoint.holds_anything(path):
        raise InputError(
            f"{path}: keeps an unfinished run; go on with --resume, or take it away, or give "
            "another --out, to begin anew"
        )
    Checkpoint.of_work(path, **work).claim()
    if checkpoint.holds_anything(path) and not quiet:
        commands.echo(f"Going on with what {path} keeps.", err=True)
    (folder / LAST_GOOD).unlink(missing_ok=True)
    try:
        yield path
    except SimulationError as error:
        checkpoint.remove(path)
        if error.state is None or error.time is None:
            raise
        state_file.save_state(folder / LAST_GOOD, error.state, error.time)
        raise SimulationError(
            f"{error}; the last good state, of {error.time:.6g} s, is in {folder / LAST_GOOD}"
        ) from None
    except OSError as error:
        line = refusals.in_one_line(error)
        if checkpoint.holds_anything(path):
            line = f"{line}; then go on with --resume"
        raise SystemRefusal(line) from error
    except KeyboardInterrupt:
        if checkpoint.holds_anything(path):
            raise KeyboardInterrupt("go on with --resume") from None
        raise
    else:
        checkpoint.remove(path)
    finally:
        if not checkpoint.holds_anything(path):
            checkpoint.remove(path)
