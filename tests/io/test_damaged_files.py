"""Damaged, foreign, missing and swapped files: refused in one line, or nothing else comes of them.

Thousands of each in a slow run, and some hundreds of the same in a quick one.
"""

import os
import random
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax import InputError
from mrjax.io import files, markers, npz
from mrjax.io.checkpoint import work as work_of_checkpoint
from mrjax.io.checkpoint.marker import MARKER, OLD_MARKER
from mrjax.simulation import follow as parts_of_runs
from tests.builders import damage
from tests.builders.runs import straight_run
from tests.builders.walks import BALLS, BOX, PIECES, START, walk

LONGEST_MESSAGE = 400


def few_or(many: int, few: int):
    """A number of trials, in a quick and in a slow run."""
    return pytest.mark.parametrize("trials", [few, pytest.param(many, marks=pytest.mark.slow)])


def refused(call):
    """What a call gives; None where it refuses in one line."""
    try:
        return call()
    except InputError as refusal:
        message = str(refusal)
        assert message.isprintable() and 0 < len(message) <= LONGEST_MESSAGE, message
        return None


def alike(one, other) -> bool:
    pairs = zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True)
    return all(np.array_equal(*pair) and pair[0].dtype == pair[1].dtype for pair in pairs)


# Files of a state and of a run -------------------------------------------------------------------


@pytest.fixture(scope="module")
def good(tmp_path_factory) -> dict[str, bytes]:
    """A state with what its contacts remember, and a run with its trajectory, as files."""
    folder = tmp_path_factory.mktemp("good")
    places = np.asarray(START.position)
    run = straight_run(places, 0.1 * places, BOX, [0.0, 5e-7, 1e-6], radius=jnp.full(3, 2e-6))
    contacts = mrjax.core.state.allocate_history(3, 2, float, sliding=True, rolling=True)
    state = mrjax.State(*(0.1 + x for x in (START.position,) * 3), contacts, np.zeros(3, np.int32))
    mrjax.save_state(folder / "state.npz", state)
    mrjax.save_run(folder / "run.npz", run, {"seed": 1})
    return {name: (folder / f"{name}.npz").read_bytes() for name in ("state", "run")}


@pytest.mark.parametrize("kind", ["state", "run"])
@few_or(5000, 150)
def test_a_damaged_npz_is_refused_or_gives_what_it_holds(good, tmp_path, kind, trials):
    load, schema = {
        "state": (mrjax.load_state, mrjax.io.state_file.SCHEMA),
        "run": (mrjax.load_run, mrjax.io.run_file.SCHEMA),
    }[kind]
    path, accepted = tmp_path / "one.npz", 0
    whole = damage.unpacked(good[kind])
    for number in range(trials):
        content = damage.damaged(good[kind], random.Random(f"{kind} {number}"))
        path.write_bytes(content)
        if (got := refused(lambda: load(path))) is None:
            continue
        accepted += 1
        # It may hold other numbers, but those that it holds, and of the same shapes and kinds.
        arrays, _ = npz.read(path, schema)
        for name, array in damage.unpacked(content).items():
            if name != "metadata":
                assert np.array_equal(array, arrays[name])
                assert arrays[name].shape[-1:] == whole[name].shape[-1:]
                assert arrays[name].dtype == whole[name].dtype and np.isfinite(array).all()
        state = got if kind == "state" else got[0].state
        assert state.position.shape == state.velocity.shape == state.spin.shape == (3, 3)
    assert accepted < trials / 2


def test_what_is_larger_than_the_limit_is_refused_before_it_is_unpacked(good, tmp_path):
    path = tmp_path / "one.npz"
    path.write_bytes(good["run"])
    with pytest.raises(InputError, match="max_bytes = 1000"):
        mrjax.load_run(path, max_bytes=1000)
    path.write_bytes(good["state"])
    with pytest.raises(InputError, match="max_bytes = 1000"):
        mrjax.load_state(path, max_bytes=1000)


def test_pipes_and_folders_are_no_files(tmp_path):
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "link.npz").symlink_to(tmp_path / "link.npz")
    for name in ("pipe", "folder", "link", "none"):
        for load in (mrjax.load_state, mrjax.load_run):
            with pytest.raises(InputError):
                load(tmp_path / f"{name}.npz")


def test_a_state_that_could_not_be_read_again_is_not_written(tmp_path):
    path = tmp_path / "one.npz"
    for changes in ({"time": np.nan}, {"state": mrjax.place([[np.inf] * 3])}):
        with pytest.raises(InputError, match="is not finite"):
            mrjax.save_state(path, **{"state": START, **changes})
    several = jax.tree.map(lambda leaf: leaf[None], START)
    with pytest.raises(InputError, match="states of several runs"):
        mrjax.save_state(path, several)
    with pytest.raises(InputError, match=r"give a name that ends in \.npz"):
        mrjax.save_state(tmp_path / "one", START)
    assert list(tmp_path.iterdir()) == []


def test_numbers_beyond_single_precision_are_refused_there(tmp_path):
    path = tmp_path / "one.npz"
    mrjax.save_state(path, mrjax.place([[1e300] * 3]))
    assert mrjax.load_state(path).position[0, 0] == 1e300
    with jax.enable_x64(False), pytest.raises(InputError, match="is beyond single precision"):
        mrjax.load_state(path)


# Checkpoints -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """Checkpoints of a walk after each of its pieces, and of another; what the first gave."""
    folder = tmp_path_factory.mktemp("walked")
    whole = [walk(folder / str(count), 0, count) for count in range(PIECES + 1)][-1]
    walk(folder / "other", seed=1)
    return folder, whole


def piece_names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.glob("*.npz"))


def wreck(copy: Path, others: list[Path], chance: random.Random) -> None:
    """Damages a checkpoint in one way: pieces away, swapped, replaced, from elsewhere, cut."""
    names = piece_names(copy)
    path, second = copy / chance.choice(names), copy / chance.choice(names)
    other = chance.choice(others)
    foreign = other / chance.choice(piece_names(other))
    kind = chance.randrange(9)
    if kind == 0:
        for name in chance.sample(names, chance.randrange(1, len(names))):
            (copy / name).unlink()
    elif kind == 1:
        here, there = path.read_bytes(), second.read_bytes()
        path.write_bytes(there)
        second.write_bytes(here)
    elif kind == 2:
        path.write_bytes(second.read_bytes())
    elif kind == 3:
        path.write_bytes(foreign.read_bytes())
    elif kind == 4:  # the piece of the same place, of other work or of another moment
        name = path.name.split(".")[0]
        for same in other.glob(f"{name}.*.npz"):
            path.write_bytes(same.read_bytes())
    elif kind == 5:
        path.write_bytes(damage.damaged(path.read_bytes(), chance))
    elif kind == 6:
        path.write_bytes(chance.choice(damage.BYTES)(path.read_bytes(), chance))
    elif kind == 7:
        marker = copy / MARKER
        text = chance.choice(damage.BYTES)(marker.read_bytes(), chance)
        marker.write_bytes(chance.choice([text, chance.choice(damage.TEXTS).encode()]))
    else:
        path.unlink()
        chance.choice(
            [path.mkdir, lambda: path.symlink_to(second), lambda: path.symlink_to(path)]
        )()


@few_or(10_000, 300)
def test_a_wrecked_checkpoint_gives_no_other_result(walked, tmp_path, monkeypatch, trials):
    folder, whole = walked
    others = [folder / "other", *(folder / str(count) for count in range(1, PIECES + 1))]
    monkeypatch.setattr(files, "_flush", lambda path: None)  # no power fails here
    told = work_of_checkpoint.environment()
    monkeypatch.setattr(work_of_checkpoint, "environment", lambda: told)
    copy, same = tmp_path / "copy", 0
    for number in range(trials):
        chance = random.Random(number)
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder / str(chance.randrange(1, PIECES + 1)), copy)
        if chance.random() < 0.2:  # two faults at once
            (copy / chance.choice(piece_names(copy))).unlink()
        wreck(copy, others, chance)
        got = refused(lambda: walk(copy))
        if got is not None:
            same += 1
            assert np.array_equal(got, whole), number
    assert trials / 5 < same < trials


@few_or(300, 12)
def test_a_wrecked_checkpoint_of_a_run_gives_no_other_run(tmp_path, monkeypatch, trials):
    monkeypatch.setattr(
        parts_of_runs, "STEPS_IN_A_PART", 150
    )  # so that a short run has several parts

    def follow(folder: Path | None = None, **changes):
        given = dict(duration=4e-5, frames=8, time_step=1e-7, checkpoint=folder) | changes
        return mrjax.follow(START, BALLS, BOX, **given)

    whole = follow(tmp_path / "kept")
    follow(tmp_path / "other", frames=4)
    assert len(piece_names(tmp_path / "kept")) > 4
    copy, same = tmp_path / "copy", 0
    for number in range(trials):
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(tmp_path / "kept", copy)
        wreck(copy, [tmp_path / "other", tmp_path / "kept"], random.Random(number))
        got = refused(lambda: follow(copy))
        if got is not None:
            same += 1
            assert alike(got, whole), number
    assert same


def test_each_piece_missing_is_found_and_told(walked, tmp_path, caplog):
    """At the end the work goes on from before it; in the middle it is refused."""
    folder, whole = walked
    last = [f"part-0000{PIECES - 1}", f"part-state-{PIECES % 2}"]
    for name in piece_names(folder / str(PIECES)):
        copy = tmp_path / name
        shutil.copytree(folder / str(PIECES), copy)
        (copy / name).unlink()
        caplog.clear()
        if name.split(".")[0] in (*last, "first", f"part-state-{1 - PIECES % 2}"):
            assert np.array_equal(walk(copy), whole)
            assert ("is missing; the work goes on" in caplog.text) == name.startswith(last[0])
        else:
            with pytest.raises(InputError, match=r"is missing; put it back, or take .* away"):
                walk(copy)
    copy = tmp_path / "states"
    shutil.copytree(folder / str(PIECES), copy)
    for path in copy.glob("part-state-*"):
        path.unlink()
    with pytest.raises(InputError, match="the states of part are missing; put it back"):
        walk(copy)


def test_a_damaged_piece_on_which_nothing_hangs_is_done_again(walked, tmp_path, caplog):
    folder, whole = walked
    copy = tmp_path / "copy"
    shutil.copytree(folder / str(PIECES), copy)
    path = next(copy.glob("first.*.npz"))
    path.write_bytes(path.read_bytes()[:-9])
    assert np.array_equal(walk(copy), whole)
    assert "first." in caplog.text and "it is computed again" in caplog.text


def test_a_marker_that_is_not_ours_is_refused_in_one_line(walked, tmp_path):
    folder, whole = walked
    copy = tmp_path / "copy"
    shutil.copytree(folder / "3", copy)
    marker = copy / MARKER
    text = marker.read_text()
    for body in (*damage.TEXTS, "", text[:-5], text.replace('"work"', '"Work"'), "\x00", "\udcff"):
        marker.write_bytes(body.encode(errors="surrogateescape"))
        with pytest.raises(InputError, match="is not a marker that mrjax wrote, or is damaged"):
            walk(copy)
    marker.unlink()
    with pytest.raises(InputError, match="is no checkpoint that mrjax made, and not empty"):
        walk(copy)
    (copy / OLD_MARKER).write_text("{}")
    with pytest.raises(InputError, match="is a checkpoint of an earlier version"):
        walk(copy)
    (copy / OLD_MARKER).unlink()
    marker.write_text(text)
    assert np.array_equal(walk(copy), whole)


def test_markers_are_read_strictly(tmp_path):
    class Two(markers.Strict):
        a: float
        b: bool

    path = tmp_path / "two.json"
    assert markers.read(path, Two) is None
    path.write_text('{"a": 1, "b": true}')
    assert markers.read(path, Two) == Two(a=1.0, b=True)
    for text in ('{"a": "1", "b": true}', '{"a": 1, "b": 1}', '{"a": 1, "b": true, "c": 0}'):
        path.write_text(text)
        with pytest.raises(markers.ForeignError):
            markers.read(path, Two)
    path.unlink()
    path.symlink_to(path)
    with pytest.raises(markers.ForeignError, match="no file"):
        markers.read(path, Two)


def test_a_run_written_before_some_could_rise_sinks(good, tmp_path):
    """Its file has no such array."""
    path = tmp_path / "one.npz"
    path.write_bytes(good["run"])
    arrays, told = npz.read(path, mrjax.io.run_file.SCHEMA)
    del arrays["rising"]
    npz.write(path, arrays, told.model_dump())
    run, _ = mrjax.load_run(path)
    assert run.rising.dtype == bool and not run.rising.any()
