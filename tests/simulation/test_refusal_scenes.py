"""Faults of the operating system amid a run: one line, status 3, and on to the same bits after."""

import errno
import itertools
import json
import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import mrjax.__main__
from mrjax.cli import environment, exit_status
from tests.builders.commands import SMALL

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits and mounts of Linux")

OPTIONS = (
    "--duration",
    "1e-7",
    "--frames",
    "4",
    "--quiet",
    "--trajectory",
    "vtk",
    "--trajectory",
    "gsd",
)
slow = pytest.mark.slow


@pytest.fixture
def simulate(monkeypatch, capsys, tmp_path) -> Callable[..., tuple[int, str]]:
    """`mrjax simulate` in this process, which keeps its programs: exit status, standard error."""
    monkeypatch.setattr(environment, "start_jax", lambda *_, **__: None)

    def run(folder: Path, *options: str) -> tuple[int, str]:
        sheet = tmp_path / "small.toml"
        sheet.write_text(SMALL)
        words = ["mrjax", "simulate", str(sheet), "--out", str(folder), *OPTIONS, *options]
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as end:
            exit_status.run(mrjax.__main__.cli, "mrjax")
        out, err = capsys.readouterr()
        assert out == ""
        return end.value.code or 0, err

    return run


def results(folder: Path) -> dict:
    """All numbers among the results."""
    summary = json.loads((folder / "summary.json").read_text()) | {"wall_seconds": None}
    with np.load(folder / "run.npz") as arrays:
        run = {name: arrays[name].tobytes() for name in arrays.files if name != "metadata"}
    names = {path.name for path in folder.iterdir()}
    return {"summary": summary, "run": run, "names": names} | {
        name: (folder / name).read_bytes() for name in ("curve.csv", "trajectory.gsd")
    }


EXPECTED: list[dict] = []


@pytest.fixture
def holds(simulate, tmp_path) -> Callable[[Path, Iterator, str], None]:
    """Refused within the scene, with the words; after it, on to what nothing disturbed gives."""
    if not EXPECTED:
        assert simulate(tmp_path / "whole") == (0, "")
        EXPECTED.append(results(tmp_path / "whole"))

    def check(folder: Path, scene: Iterator, words: str, expected: int = 3) -> None:
        with scene:
            status, err = simulate(folder)
        assert (status, err.count("\n")) == (expected, 1) and words in err, err
        assert not list(folder.rglob(".mrjax-*"))
        assert simulate(folder, "--resume") == (0, "")
        assert results(folder) == EXPECTED[0]

    return check


@contextmanager
def largest(size: int) -> Iterator[None]:
    """No file of more bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("size", [4000, 20000, 40000])
def test_files_that_may_not_grow(holds, tmp_path, size):
    holds(tmp_path / "out", largest(size), "(File too large); raise the limit of file sizes")


@contextmanager
def in_place(path: Path) -> Iterator[None]:
    """A folder of the user's where a file is to be."""
    path.mkdir(parents=True)
    yield
    path.rmdir()


NAMES = ["summary.json", "run.npz", "trajectory.gsd", "trajectory/000003.vtu"]
LATER = ["curve.csv", "settling.png", "trajectory.pvd"]


@pytest.mark.parametrize("name", [*NAMES, *(pytest.param(name, marks=slow) for name in LATER)])
def test_a_folder_in_the_place_of_a_file(holds, tmp_path, name):
    """Found before any work."""
    holds(tmp_path / "out", in_place(tmp_path / "out" / name), "is not overwritten", 2)


@contextmanager
def appearing(path: Path) -> Iterator[None]:
    """A folder that comes to be there right before the file."""
    replace = os.replace

    def replaced(source, target, **options):
        if Path(target) == path:
            path.mkdir()
        replace(source, target, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", replaced)
        yield
    path.rmdir()


@pytest.mark.parametrize("name", [*NAMES, *(pytest.param(name, marks=slow) for name in LATER)])
def test_a_folder_that_comes_to_be_in_the_place_of_a_file(holds, tmp_path, name):
    words = "(Is a directory); take the folder of that name away"
    holds(tmp_path / "out", appearing(tmp_path / "out" / name), words)


@contextmanager
def refusing(number: int, reason: int) -> Iterator[None]:
    """The system refuses to put the files from this one on in their places."""
    replace, written = os.replace, itertools.count(1)

    def replaced(source, target, **options):
        if next(written) >= number:
            raise OSError(reason, os.strerror(reason), str(source))
        replace(source, target, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", replaced)
        yield


REASONS = ["EDQUOT", "EACCES", "EMFILE", "EROFS", "EIO"]


@pytest.mark.parametrize(
    "reason", [REASONS[0], *(pytest.param(r, marks=slow) for r in REASONS[1:])]
)
def test_whatever_the_system_refuses(holds, tmp_path, reason):
    number = getattr(errno, reason)
    holds(tmp_path / "out", refusing(5, number), f"({os.strerror(number)})")


@contextmanager
def mounted(folder: Path, options: str) -> Iterator[None]:
    """A small file system on a folder; skips where mounting is not allowed."""
    folder.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], check=False)
    if made.returncode:
        pytest.skip("mounting is not allowed here")
    try:
        yield
    finally:
        subprocess.run(["umount", folder], check=True)


@contextmanager
def remounted(folder: Path, roomy: str) -> Iterator[None]:
    """Gives it other options in the end."""
    yield
    subprocess.run(["mount", "-o", f"remount,{roomy}", folder], check=True)


FULL = {
    "few bytes": ("size=8k", "size=64m"),
    "more bytes": ("size=48k", "size=64m"),
    "few files": ("size=64m,nr_inodes=8", "nr_inodes=1000"),
}


@pytest.mark.parametrize("name", FULL)
def test_a_disk_that_fills(holds, tmp_path, name):
    disk, (tight, roomy) = tmp_path / "disk", FULL[name]
    with mounted(disk, tight):
        holds(disk / "out", remounted(disk, roomy), "(No space left on device); free some space")


def test_a_disk_that_may_only_be_read(holds, tmp_path):
    disk = tmp_path / "disk"
    with mounted(disk, "size=64m"):
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        holds(disk / "out", remounted(disk, "rw"), "cannot be written to (Read-only file system)")
