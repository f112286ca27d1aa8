"""What the operating system refuses: one line, exit status 3, and work that goes on afterwards."""

import errno
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mrjax import SystemRefusal
from mrjax.core import refusals
from mrjax.io import files
from tests.builders.commands import COMPILED, ENVIRONMENT, SMALL

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits and mounts of Linux")


def command(
    *arguments,
    folder: Path,
    module: str = "mrjax",
    out=subprocess.PIPE,
    err=subprocess.PIPE,
    closed: str = "",
) -> tuple[int, str, str]:
    """Exit status, standard output and error of a command.

    Args:
      arguments: of the command.
      folder: where it runs.
      module: which command.
      out, err: its standard output and error.
      closed: what the shell closes of it, such as `>&-`.
    """
    line = f'exec "$0" "$@" {closed}'

    done = subprocess.run(
        ["sh", "-c", line, sys.executable, "-m", module, *map(str, arguments)],
        stdout=out,
        stderr=err,
        text=True,
        cwd=folder,
        env={**ENVIRONMENT, "JAX_PLATFORMS": "cpu", "JAX_COMPILATION_CACHE_DIR": COMPILED.name},
        timeout=300,
    )
    return done.returncode, done.stdout or "", done.stderr or ""


def is_refused(ended: tuple[int, str, str], *words: str) -> None:
    """Status 3 and one line of the command's own, with these words."""
    status, _, err = ended
    assert status == 3, ended
    assert err.count("\n") == 1 and err.startswith("mrjax"), err
    for word in words:
        assert word in err


CHECK = ("check", "case2")


@pytest.fixture
def full() -> Iterator:
    with open("/dev/full", "w") as file:
        yield file


@pytest.mark.parametrize("options", [(), ("--json",)], ids=["text", "json"])
def test_a_full_standard_output(tmp_path, full, options):
    ended = command(*CHECK, *options, folder=tmp_path, out=full)
    is_refused(ended, "standard output: cannot be written (No space left on device)")


def test_a_closed_standard_output(tmp_path):
    ended = command(*CHECK, folder=tmp_path, closed=">&-")
    is_refused(ended, "standard output: cannot be written (Bad file descriptor)")


def test_a_pipe_that_nobody_reads(tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    try:
        is_refused(command(*CHECK, folder=tmp_path, out=writing), "(Broken pipe)")
    finally:
        os.close(writing)


@pytest.mark.parametrize("words", [("check", "none"), ("--help",)], ids=["fault", "help"])
def test_standard_error_that_fails_hides_no_other_status(tmp_path, full, words):
    for how in ({"err": full}, {"closed": "2>&-"}):
        status, out, _ = command(*words, folder=tmp_path, **how)
        assert status == (0 if words == ("--help",) else 2)
        assert ("Exit status" in out) == (status == 0)


def test_lost_messages_are_told_by_the_status(tmp_path, full):
    """A box so narrow that `check` warns."""
    (tmp_path / "warns.toml").write_text(SMALL.replace("viscosity = 0.01", "viscosity = 1e-9"))
    told = command("check", "warns.toml", folder=tmp_path)
    assert told[0] == 0 and "warning" in told[2]
    for how in ({"err": full}, {"closed": "2>&-"}):
        status, out, _ = command("check", "warns.toml", folder=tmp_path, **how)
        assert (status, out) == (3, told[1])


def test_closed_streams_are_not_those_of_the_next_file(tmp_path):
    """Else what libraries log is written into it."""
    seen = (
        "import os, sys; from mrjax import streams; streams.guard();"
        "file = os.open('file', os.O_CREAT | os.O_WRONLY);"
        "sys.exit(0 if file > 2 else 1)"
    )
    line = 'exec "$0" -c "$1" <&- >&- 2>&-'
    done = subprocess.run(["sh", "-c", line, sys.executable, seen], cwd=tmp_path, timeout=100)
    assert done.returncode == 0


LONG = "n" * 300
OUT = ("simulate", "case2", "--out")
PLACES = {
    "name too long": ((*OUT, LONG), errno.ENAMETOOLONG),
    "a file": ((*OUT, "file"), errno.EEXIST),
    "under a file": ((*OUT, "file/x"), errno.ENOTDIR),
    "in the system's own": ((*OUT, "/proc/here"), errno.ENOENT),
    "a link to itself": ((*OUT, "link"), errno.EEXIST),
    "new, name too long": (("new", f"{LONG}.toml"), errno.ENAMETOOLONG),
    "new, nowhere": (("new", "nowhere/a.toml"), errno.ENOENT),
}


@pytest.mark.parametrize("name", PLACES)
def test_places_that_cannot_be_written_to(tmp_path, name):
    (tmp_path / "file").write_text("a user's")
    (tmp_path / "link").symlink_to("link")
    arguments, number = PLACES[name]
    ended = command(*arguments, folder=tmp_path)
    is_refused(ended, arguments[-1][-10:], refusals.REMEDIES[number])
    assert len(ended[2]) < 400
    assert (tmp_path / "file").read_text() == "a user's" and len(list(tmp_path.iterdir())) == 2


def test_what_is_refused_names_its_file_in_python(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(SystemRefusal, match=r"cannot be written .*take the folder") as found:
        files.write_text(tmp_path / "folder", "text")
    assert isinstance(found.value.__cause__, IsADirectoryError)
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]
    with pytest.raises(OSError, match="ffmpeg"), files.replacing(tmp_path / "film.mp4"):
        raise subprocess.CalledProcessError(1, "ffmpeg")


@pytest.mark.parametrize(
    "error, words",
    [
        (MemoryError("Unable to allocate 1 TiB"), "memory: refused (Unable to allocate 1 TiB)"),
        (RuntimeError("RESOURCE_EXHAUSTED: Out of memory\nand more"), "(RESOURCE_EXHAUSTED: Out"),
        (RuntimeError("can't start new thread"), "ulimit -u"),
        (OSError(errno.EIO, "Input/output error", "run"), "run: refused (Input/output error)"),
    ],
)
def test_what_else_is_refused(error, words):
    assert words in refusals.in_one_line(error)
    assert refusals.in_one_line(RuntimeError("a fault of our own")) is None
