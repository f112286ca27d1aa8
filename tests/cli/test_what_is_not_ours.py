"""What mrjax did not make stays as it is: folders, files, links, and what is put among its own."""

import json
import os
import stat
from collections.abc import Callable
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate.__main__
import mrjax.__main__
from calibrate.experiment.experiment import Experiment
from calibrate.inference.forecast import leave_one_out
from calibrate.least_squares.fit import fit
from calibrate.problem.problem import Problem
from calibrate.problem.solve import fit_experiment
from mrjax import InputError
from mrjax.cli import environment, resume
from mrjax.core.trajectory import Trajectory
from mrjax.io import checkpoint, files, results, viewers
from mrjax.io.checkpoint import Checkpoint
from mrjax.io.checkpoint import folder as checkpoint_folder
from mrjax.io.checkpoint.marker import MARKER
from tests.builders.commands import SMALL
from tests.builders.valleys import BENT, bent
from tests.builders.walks import BALLS, BOX, START, walk

COMMANDS = {
    "simulate": (mrjax.__main__.cli, ["simulate", "small.toml", "--duration", "1e-7"]),
    "reproduce": (mrjax.__main__.cli, ["reproduce"]),
    "calibrate": (calibrate.__main__.cli, ["synthetic", "--model", "closed-form"]),
}


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """A folder to work in, with a recipe; the commands leave JAX as the tests have it."""
    (tmp_path / "small.toml").write_text(SMALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(environment, "start_jax", lambda *of, **given: None)
    return tmp_path


def called(command: str, *more: str) -> None:
    cli, arguments = COMMANDS[command]
    cli.main([*arguments, "--quiet", "--out", "out", *more], standalone_mode=False)


def everything(folder: Path) -> dict[str, object]:
    """All that is in a folder: what files hold, where links lead."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = os.readlink(path)
        else:
            found[name] = path.read_bytes() if path.is_file() else None
    return found


def _folder(path: Path) -> None:
    (path / "sub").mkdir(parents=True)
    (path / "model.pt").write_text("weights of another program")
    (path / "sub" / "notes.txt").write_text("notes")


def _file(path: Path) -> None:
    path.write_text("a file of the user's")


def _link(path: Path) -> None:
    elsewhere = path.parent.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "keep.txt").write_text("keep")
    path.symlink_to(elsewhere)


def _link_to_ours(path: Path) -> None:
    """A link to a checkpoint is a link."""
    walk(path.parent.parent / "walked")
    path.symlink_to(path.parent.parent / "walked")


def _dangling(path: Path) -> None:
    path.symlink_to(path.parent / "nowhere")


def _loop(path: Path) -> None:
    path.symlink_to(path.name)


def _npz(path: Path) -> None:
    path.mkdir()
    np.savez(path / "mine.npz", a=np.zeros(2))


def _pipe(path: Path) -> None:
    os.mkfifo(path)


def _marked_by_another(path: Path) -> None:
    path.mkdir()
    (path / MARKER).write_text('{"kind": "checkpoint of another program"}')
    (path / "part-00000.npz").write_text("mine")


def _earlier(path: Path) -> None:
    path.mkdir()
    (path / "of.json").write_text('{"command": "simulate"}')
    np.savez(path / "part-00000.npz", a=np.zeros(2))


def _nested(path: Path) -> None:
    """Our own checkpoint in a folder of the user's."""
    _folder(path)
    walk(path / "sub" / "walked")


KINDS: list[Callable[[Path], None]] = [
    _folder,
    _file,
    _link,
    _link_to_ours,
    _dangling,
    _loop,
    _npz,
    _pipe,
    _marked_by_another,
    _earlier,
    _nested,
]
kinds = pytest.mark.parametrize("make", KINDS, ids=[one.__name__.strip("_") for one in KINDS])


@kinds
@pytest.mark.parametrize("command", COMMANDS)
def test_a_users_own_checkpoint_survives_every_command(here, make, command):
    out = here / "out"
    out.mkdir()
    make(out / "checkpoint")
    before = everything(here)
    for more in ([], ["--resume"]):
        with pytest.raises(InputError, match=r"checkpoint.*(not touched|take it away)"):
            called(command, *more)
        assert everything(here) == before


@kinds
def test_a_users_own_folder_survives_every_function(here, make):
    make(here / "mine")
    before = everything(here)
    experiment, case2 = Experiment.load("synthetic"), mrjax.Recipe.load("case2")
    found = fit(bent, BENT)
    for work in (
        lambda: mrjax.follow(START, BALLS, BOX, duration=1e-6, checkpoint="mine"),
        lambda: mrjax.settle(START, BALLS, BOX, checkpoint="mine"),
        lambda: mrjax.sedimentation(case2, checkpoint="mine"),
        lambda: fit(bent, BENT, checkpoint="mine"),
        lambda: calibrate.inference.posterior.posterior(found, checkpoint="mine"),
        lambda: fit_experiment(experiment, "closed-form", checkpoint="mine"),
        lambda: Problem.prepare(experiment, "closed-form", checkpoint="mine"),
        lambda: leave_one_out(experiment, "closed-form", checkpoint="mine"),
    ):
        with pytest.raises(InputError, match=r"mine.*take it away"):
            work()
        assert everything(here) == before


def test_an_empty_folder_becomes_a_checkpoint(tmp_path):
    (tmp_path / "empty").mkdir()
    whole = walk(tmp_path / "one")
    assert np.array_equal(walk(tmp_path / "empty"), whole)
    assert checkpoint.remove(tmp_path / "empty") == []
    assert not (tmp_path / "empty").exists()


def test_what_a_user_puts_into_a_checkpoint_survives_its_end(tmp_path, capsys):
    """Only pieces and scratch of ours are taken away, and the line says what is left."""
    path = tmp_path / "checkpoint"
    own = {"notes.txt": "a", "part-00000.npz": "b", ".mrjax-notes": "c", "rest/mine.npz": "d"}

    def work(folder):
        walk(folder / "rest")
        walk(folder / "empty" / "nested")
        (folder / "own").mkdir()
        for name, text in own.items():
            (folder / name).write_text(text)
        (folder / ".mrjax-abcd1234.partial.npz").write_text("half")  # of a killed process
        (folder / "rest" / ".mrjax-abcd1234.partial.npz").write_text("half")
        (folder / "link").symlink_to(tmp_path / "nowhere")
        walk(tmp_path / "other")
        (folder / "away").symlink_to(tmp_path / "other")

    with resume.checkpointed(tmp_path, False, True, seed=1) as folder:
        work(folder)
    left = {name for name in everything(path) if name != "rest"}
    assert left == {*own, "own", "link", "away"}
    assert "kept files that mrjax did not make: .mrjax-notes, away, link" in capsys.readouterr().err
    for name, text in own.items():
        assert (path / name).read_text() == text
    walk(tmp_path / "other")  # is whole
    with (
        pytest.raises(InputError, match="not empty; it is not touched"),
        resume.checkpointed(tmp_path, False, True, seed=1),
    ):
        raise AssertionError


def test_a_checkpoint_half_removed_is_none(tmp_path, monkeypatch):
    """A process killed while it takes one away leaves what the next takes away."""
    path = tmp_path / "checkpoint"

    def killed(*of, **given):
        raise KeyboardInterrupt

    with resume.checkpointed(tmp_path, False, True, seed=1) as folder:
        walk(folder)
        with monkeypatch.context() as patch:
            patch.setattr(checkpoint_folder, "clear", killed)
            with pytest.raises(KeyboardInterrupt):
                checkpoint.remove(path)
        assert len(list(path.glob("*.npz"))) > 3 and not checkpoint.holds_anything(path)
        for one in list(path.glob("*.npz"))[::2]:
            one.unlink()
    assert not path.exists()
    walk(path)
    marker = json.loads((path / MARKER).read_text())
    (path / MARKER).write_text(json.dumps(marker | {"done": True}))
    next(path.glob("part-00002*")).unlink()
    with resume.checkpointed(tmp_path, False, True, seed=2) as folder:
        assert [one.name for one in folder.iterdir()] == [MARKER]


def test_what_killed_processes_were_writing_is_taken_away(tmp_path):
    """In the folder of a checkpoint, where it goes on."""
    walk(tmp_path, until=2)
    for name in (".mrjax-abcd1234.partial.npz", ".mrjax-a_cd1234.partial.json"):
        (tmp_path / name).write_text("half")
    (tmp_path / ".mrjax-mine").write_text("mine")
    walk(tmp_path)
    assert [one.name for one in tmp_path.glob(".mrjax*")] == [".mrjax-mine"]


def test_scratch_files_are_new_and_on_the_disk_before_they_replace(tmp_path, monkeypatch):
    """Made exclusively under names that nobody foresees; links are not followed."""
    done, names = [], set()
    opened, synced, replaced = os.open, os.fsync, os.replace

    def open_(path, flags, *more, **given):
        if ".partial" in str(path) and flags & os.O_CREAT:
            assert flags & os.O_EXCL and flags & os.O_NOFOLLOW
            names.add(str(path))
        return opened(path, flags, *more, **given)

    def fsync(handle):
        kind = "folder" if stat.S_ISDIR(os.fstat(handle).st_mode) else "file"
        done.append(f"fsync {kind}")
        return synced(handle)

    def replace(*of):
        done.append("replace")
        return replaced(*of)

    monkeypatch.setattr(os, "open", open_)
    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", replace)
    target = tmp_path / "target"
    target.write_text("a user's")
    (tmp_path / ".a.partial.txt").symlink_to(target)
    (tmp_path / "a.txt").symlink_to(target)
    for _ in range(3):
        files.write_text(tmp_path / "a.txt", "new")
    assert done == ["fsync file", "replace", "fsync folder"] * 3 and len(names) == 3
    assert target.read_text() == "a user's" and not (tmp_path / "a.txt").is_symlink()
    assert (tmp_path / ".a.partial.txt").is_symlink()


# Results -----------------------------------------------------------------------------------------


def finished(folder: Path, text: str = "{}", writes=("summary.json",), more=("more.txt",)) -> None:
    """A command that writes two files."""
    with resume.checkpointed(folder, True, True, writes, seed=1) as kept:
        walk(kept / "rest")
        for name in (*writes, *more):
            files.write_text(folder / name, text)


def test_results_of_a_user_are_not_overwritten(tmp_path):
    """A command overwrites its own, and refuses what is not, or was changed since."""
    finished(tmp_path)
    finished(tmp_path, "[]")
    assert (tmp_path / "summary.json").read_text() == "[]"
    for name in ("summary.json", "more.txt"):
        path = tmp_path / name
        for changed in ("[] # my notes", ""):
            path.write_text(changed)
            with pytest.raises(
                InputError, match=rf"{name}: was not written by mrjax, or has changed"
            ):
                finished(tmp_path)
            assert path.read_text() == changed
        path.unlink()
        path.symlink_to(tmp_path / "nowhere")
        with pytest.raises(InputError, match=f"{name}: was not written by mrjax, or has changed"):
            finished(tmp_path)
        assert path.is_symlink()
        path.unlink()
        finished(tmp_path)
    # What is known beforehand is refused before work; else what was computed is kept.
    (tmp_path / "more.txt").write_text("mine")
    with pytest.raises(InputError):
        finished(tmp_path)
    assert checkpoint.holds_anything(tmp_path / "checkpoint")
    (tmp_path / "summary.json").write_text("mine")
    with (
        pytest.raises(InputError),
        resume.checkpointed(tmp_path, True, True, ["summary.json"], seed=1),
    ):
        raise AssertionError
    (tmp_path / "more.txt").unlink()
    (tmp_path / "summary.json").unlink()
    finished(tmp_path)


@pytest.mark.parametrize("moment", ["before", "after"])
def test_results_of_a_killed_command_are_still_its_own(tmp_path, monkeypatch, moment):
    finished(tmp_path)
    replace, number = os.replace, 0

    class Killed(BaseException):
        pass

    def killed(source, target):
        if moment == "after":
            replace(source, target)
        if Path(target).name == "summary.json":
            raise Killed
        if moment == "before":
            replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", killed)
        with pytest.raises(Killed):
            finished(tmp_path, f"[{number}]")
    finished(tmp_path, "[1]")
    assert (tmp_path / "summary.json").read_text() == "[1]"


def test_a_list_that_is_not_ours_is_refused(tmp_path):
    for text in ("", "[]", "{}", '{"kind": "mrjax results", "digests": {"a": 1}}', "[" * 5000):
        (tmp_path / results.LIST).write_text(text)
        with pytest.raises(InputError, match="is not a list that mrjax wrote, or is damaged"):
            finished(tmp_path)
        assert (tmp_path / results.LIST).read_text() == text


def test_a_users_last_good_state_is_not_deleted(tmp_path):
    """Nor that of a run that failed, before it is known to be ours."""
    path = tmp_path / resume.LAST_GOOD
    mrjax.save_state(path, START)
    before = path.read_bytes()
    with pytest.raises(
        InputError, match=r"last_good_state\.npz: was not written by mrjax, or has changed"
    ):
        finished(tmp_path)
    assert path.read_bytes() == before
    path.unlink()
    error = mrjax.SimulationError("fell")
    error.state, error.time = START, 1.0
    with (
        pytest.raises(mrjax.SimulationError, match="is in"),
        resume.checkpointed(tmp_path, True, True, seed=1),
    ):
        raise error
    assert mrjax.load_state(path).particles == 3
    finished(tmp_path)
    assert not path.exists()


def still() -> mrjax.Run:
    """A run of two frames in which nothing moves."""
    rows = jnp.stack([START.position] * 3)
    speed, one = jnp.zeros(3), jnp.zeros(())
    return mrjax.Run(
        times=jnp.arange(3.0),
        heights=rows[..., 2],
        radius=jnp.full(3, 2e-6),
        mean_velocity=speed,
        mean_speed=speed,
        state=START,
        deepest_overlap=one,
        coating_overlap=one,
        fault=jnp.zeros((), jnp.int32),
        box=BOX,
        time_step=1.0,
        steps=2,
        trajectory=Trajectory(rows, 0.0 * rows, 0.0 * rows),
    )


def test_frames_of_a_user_are_not_overwritten(tmp_path):
    run = still()
    frames = tmp_path / "one"
    frames.mkdir()
    (frames / "000007.vtu").write_text("mine")
    for _ in range(2):
        viewers.write_vtk(tmp_path / "one.pvd", run)
        assert (frames / "000007.vtu").read_text() == "mine"
    (frames / viewers.FRAME_COUNT).unlink()
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "000001.vtu").write_text("mine")
    (tmp_path / "three").symlink_to(frames)
    (tmp_path / "four").mkdir()
    (tmp_path / "four" / viewers.FRAME_COUNT).write_text("[]")
    before = everything(tmp_path)
    for name in ("one", "two", "three", "four"):
        with pytest.raises(InputError, match="give another name"):
            viewers.write_vtk(tmp_path / f"{name}.pvd", run)
        assert everything(tmp_path) == before


def test_new_files_take_the_place_of_none(tmp_path):
    path = tmp_path / "mine.toml"
    path.symlink_to(tmp_path / "nowhere")
    with pytest.raises(FileExistsError):
        files.create_text(path, "new")
    assert path.is_symlink() and not (tmp_path / "nowhere").exists()


def test_a_folder_that_stops_being_ours_is_left_alone(tmp_path):
    """Even in the middle of the work."""
    folder = tmp_path / "kept"
    work = Checkpoint.open(folder, seed=1)
    work.save("one", {"x": np.ones(1)})
    folder.rename(tmp_path / "away")
    _folder(folder)
    before = everything(tmp_path)
    with pytest.raises(InputError, match="is no checkpoint that mrjax made"):
        work.save("two", {"x": np.ones(1)})
    assert everything(tmp_path) == before


def test_two_processes_do_not_share_a_checkpoint(tmp_path):
    with resume.checkpointed(tmp_path, False, True, seed=1) as folder:
        walk(folder / "rest")
        with (
            pytest.raises(InputError, match="another process is at work there"),
            resume.checkpointed(tmp_path, True, True, seed=1),
        ):
            raise AssertionError
        assert checkpoint.holds_anything(folder)
    assert not folder.exists()


def test_a_command_says_in_one_line_where_it_goes_on_from_an_earlier_piece(tmp_path, capsys):
    with (
        pytest.raises(KeyboardInterrupt),
        resume.checkpointed(tmp_path, False, True, seed=1) as folder,
    ):
        whole = walk(folder / "rest")
        raise KeyboardInterrupt
    last = max((folder / "rest").glob("part-0*"))
    last.unlink()
    with resume.checkpointed(tmp_path, True, True, seed=1) as folder:
        assert np.array_equal(walk(folder / "rest"), whole)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mrjax: warning: ") and last.name in line
    assert line.endswith("is missing; the work goes on after 4 pieces")
