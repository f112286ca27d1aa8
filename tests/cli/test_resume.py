"""Runs and fits that are stopped at any moment, and go on to the same bits."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import mrjax
from calibrate.inference import posterior, profile
from calibrate.least_squares.fit import fit
from calibrate.least_squares.priors import LogNormal
from mrjax.cli import exit_status, resume
from mrjax.dem import scan, schedule
from mrjax.io.checkpoint import Checkpoint, work
from mrjax.io.results import LIST
from mrjax.simulation import follow
from tests.builders import ROOT
from tests.builders.beds import WALLED, dispersed, soft
from tests.builders.commands import SMALL
from tests.builders.stopping import Stopped, alike, stopping
from tests.builders.valleys import BENT, bent

EXPERIMENT = """
name = "tubes"
[[sample]]
name = "first"
recipe = "small.toml"
bed_fraction = "particles"
initial_velocity = {value = 8.0, unit = "mm/day", standard_deviation = 0.1}
final_ratio = {value = 0.75, standard_deviation = 0.05}
[[sample]]
name = "second"
recipe = "small.toml"
initial_velocity = {value = 8.1, unit = "mm/day", standard_deviation = 0.1}
[[parameter]]
name = "f_w"
median = 20.0
log_standard_deviation = 1.0
[[parameter]]
name = "f_s"
median = 1.1
log_standard_deviation = 0.1
"""
SIMULATION = ("mrjax", "simulate", "small.toml", "--ensemble", "2", "--frames", "300")
FITTING = ("calibrate", "tubes.toml", "--model", "closed-form", "--leave-one-out")


PAIRS = 60
"""Room for fewer pairs than the bed has, and for as many as the suspension."""


def contents(folder: Path) -> dict[str, bytes]:
    """What is kept; the last state of a start takes the place of the one before."""
    return {path.name: path.read_bytes() for path in folder.glob("[!.]*.npz")}


@pytest.fixture(scope="module")
def small(case2):
    """Parameters and two starts of twenty particles with friction."""
    return soft(case2, WALLED), [dispersed(case2, WALLED, seed) for seed in (0, 1)]


def settled(small, **changes) -> mrjax.Run:
    parameters, states = small
    return mrjax.settle(states, parameters, WALLED, frames=40, trajectory=True, **changes)


def test_a_bed_stopped_at_any_part_goes_on_to_the_same_bits(small, tmp_path):
    whole = settled(small)
    for number in (1, 2, 3, 8, 21, 30):
        folder = tmp_path / str(number)
        with pytest.raises(Stopped), stopping(number):
            settled(small, checkpoint=folder)
        kept = contents(folder)
        alike(settled(small, checkpoint=folder), whole)
        assert contents(folder) != kept
    # All of it is kept: nothing is computed any more.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scan, "advance", None)
        alike(settled(small, checkpoint=folder), whole)


@pytest.mark.slow
def test_a_frame_repeated_with_more_room_is_so_again(small, tmp_path):
    """The neighbour list of a bed overflows, grows, and the bed settles on; resumed, too."""
    parameters, (state, _) = small

    def settled(**changes):
        return mrjax.settle(state, parameters, WALLED, frames=40, **changes)

    roomy = settled()
    with pytest.MonkeyPatch.context() as patch:
        plan = schedule.plan_neighbour_list
        patch.setattr(schedule, "plan_neighbour_list", lambda *of: replace(plan(*of), pairs=PAIRS))
        whole = settled()
        # The same contacts in another order.
        np.testing.assert_allclose(whole.mudline[:30], roomy.mudline[:30], rtol=1e-9)
        for number in (16, 17, 18, 19, 20):  # before and after that part
            with pytest.raises(Stopped), stopping(number):
                settled(checkpoint=tmp_path / str(number))
            alike(settled(checkpoint=tmp_path / str(number)), whole)


@pytest.mark.parametrize("most", [20 * 45, 20 * 4], ids=["frames", "parts of frames"])
def test_a_run_of_given_duration_goes_on(small, tmp_path, monkeypatch, most):
    parameters, (state, _) = small
    given = dict(duration=3.0, frames=6, time_step=0.018, rebuild_every=4)
    whole = mrjax.simulate(state, parameters, WALLED, **given)
    assert whole.heights.shape == (7, 20) and whole.times.shape == (7,)
    monkeypatch.setattr(follow, "STEPS_IN_A_PART", most)
    for number in (1, 2, 3):
        folder = tmp_path / str(number)
        with pytest.raises(Stopped), stopping(number):
            mrjax.follow(state, parameters, WALLED, **given, checkpoint=folder)
        alike(mrjax.follow(state, parameters, WALLED, **given, checkpoint=folder), whole)


@pytest.mark.parametrize("starts", [1, 3])
def test_a_fit_stopped_at_any_model_run_goes_on(tmp_path, starts):
    """Through its search, its finish, and its profiles."""
    given = dict(starts=starts, priors={"a": LogNormal(0.5, 2.0), "b": LogNormal(2.0, 2.0)})

    def done(folder=None):
        found = fit(bent, BENT, **given, checkpoint=folder)
        increase = [one.increase for one in profile.profiles(found)]
        return found.model_runs, found.values, found.jacobian, found.loss, increase

    runs, *whole = done()
    for stops in range(100):
        try:
            with stopping(3 + 8 * stops):
                again, *resumed = done(tmp_path / "fit")
            break
        except Stopped:
            pass
    assert stops >= 2 and again == runs
    alike(resumed, whole)


@pytest.mark.slow
def test_samples_are_kept(tmp_path, monkeypatch):
    found = fit(bent, BENT)
    drawn = posterior.posterior(found, samples=10, checkpoint=tmp_path)
    monkeypatch.setattr(posterior, "_sample", None)  # nothing is drawn any more
    again = posterior.posterior(found, samples=10, checkpoint=tmp_path)
    for name in ("samples", "r_hat", "effective", "divergences"):
        np.testing.assert_array_equal(getattr(again, name), getattr(drawn, name))
    with pytest.raises(mrjax.InputError, match="with seed = 0 there and 1 here"):
        posterior.posterior(found, seed=1, samples=10, checkpoint=tmp_path)


def test_a_checkpoint_of_other_work_is_refused(small, tmp_path):
    """In one line that says what differs."""
    parameters, states = small

    def settled(parameters=parameters, states=states, **changes):
        mrjax.settle(states, parameters, WALLED, **changes, checkpoint=tmp_path / "kept")

    # Of two beds side by side, each writes a part and then a state.
    with pytest.raises(Stopped), stopping(6):
        settled()
    with pytest.raises(mrjax.InputError, match=r"friction = 0\.3 there and 0\.4 here; give"):
        settled(parameters.replace(friction=0.4))
    with pytest.raises(mrjax.InputError, match=r"with frames = 200 there and 100 here"):
        settled(frames=100)
    with pytest.raises(mrjax.InputError, match=r"states\.0\.position_m = array"):
        settled(states=states[::-1])
    for name in ("version of jaxlib", "version of mrjax", "machine"):
        with (
            pytest.MonkeyPatch.context() as patch,
            pytest.raises(mrjax.InputError, match=f"with {name} = .* there and another here"),
        ):
            told = work.environment() | {name: "another"}
            patch.setattr(work, "environment", lambda told=told: told)
            settled()
    path = next((tmp_path / "kept").glob("*-00000.*.npz"))
    os.truncate(path, 100)
    with pytest.raises(mrjax.InputError, match=r"damaged .*; put it back, or take .* away"):
        settled()


def test_a_checkpoint_of_another_fit_is_refused(tmp_path):
    fit(bent, BENT, checkpoint=tmp_path)
    with pytest.raises(mrjax.InputError, match=r"with start\.a = .* there and 2\.0 here"):
        fit(bent, {**BENT, "a": 2.0}, checkpoint=tmp_path)
    with pytest.raises(mrjax.InputError, match="with residuals_at_the_start = array"):
        fit(lambda theta: 1.1 * bent(theta), BENT, checkpoint=tmp_path)


def test_what_a_command_keeps(tmp_path, capsys):
    """Kept until the results are written; without --resume not lost, and not gone on with."""
    path = tmp_path / "checkpoint"

    def work(what=lambda folder: None, go_on=False, **options):
        with resume.checkpointed(tmp_path, go_on, False, **options) as folder:
            what(folder)

    def stopped(folder):
        Checkpoint.open(folder / "rest", seed=1).save("part", {"x": np.ones(1)})
        raise KeyboardInterrupt

    with pytest.raises(mrjax.InputError):  # nothing was kept yet: nothing is left
        work(lambda folder: mrjax.Recipe.load("nothing"))
    assert not path.exists()
    with pytest.raises(KeyboardInterrupt):
        work(stopped, seed=1)
    assert exit_status.resumable()  # which the line about the interruption says
    with pytest.raises(mrjax.InputError, match="holds an unfinished run; go on with --resume"):
        work(seed=1)
    with pytest.raises(mrjax.InputError, match="with seed = 1 there and 2 here"):
        work(go_on=True, seed=2)
    assert list((path / "rest").glob("part.*.npz")) and capsys.readouterr().err == ""
    work(go_on=True, seed=1)
    assert "Going on with the checkpoint" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())
    work(go_on=True, seed=2)  # with nothing there, it begins


def ready(folder: Path) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "small.toml").write_text(SMALL)
    (folder / "tubes.toml").write_text(EXPERIMENT)
    return folder


def started(command, folder: Path, how=()) -> subprocess.Popen:
    """A command as a process; compiled programs are kept beside its folder, as a user's are."""
    call = [str(ROOT / "tests" / "builders" / "killed.py"), *how] if how else ["-m"]
    # JAX, which is imported here, makes it speak of the programs that it loads.
    own = {name: value for name, value in os.environ.items() if name != "TF_CPP_MIN_LOG_LEVEL"}
    return subprocess.Popen(
        [sys.executable, *call, *command, "--quiet"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**own, "JAX_PLATFORMS": "cpu", "XDG_CACHE_HOME": str(folder.parent / "cache")},
    )


def results(folder: Path) -> dict[str, object]:
    """The numbers and pictures that a command wrote, but for the time that it took."""
    found = {}
    for path in folder.glob("[!.]*"):  # a kill may leave half of a file, by a name of its own
        if path.name == LIST:  # of digests, that of the time among them
            continue
        if path.suffix == ".json":
            found[path.name] = json.loads(path.read_text())
            found[path.name].pop("wall_seconds")
        elif path.suffix in (".csv", ".npz", ".png"):
            found[path.name] = path.read_bytes()
    return found


def killed_after(seconds: float, command, folder: Path) -> bool:
    """Whether a command was killed so many seconds after its start; it may end before."""
    process = started(command, folder)
    with suppress(subprocess.TimeoutExpired):
        process.wait(seconds)
    process.kill()
    process.communicate(timeout=300)
    assert process.returncode in (0, -signal.SIGKILL)
    return process.returncode != 0


def survives(command, out: str, folder: Path, kills: int, seed: int) -> None:
    """Killed at random moments: of its time, and of its writing; each time it goes on.

    Every kill meets a living process, and has a run of its own, so that the early ones are as
    likely as the late.
    """
    reference = ready(folder / "whole")
    for _ in range(2):  # the second as all others: with its programs compiled
        began = time.perf_counter()
        process = started(command, reference, ("count", "0"))
        told, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
        lasts = time.perf_counter() - began
    whole, written = results(reference / out), int(told.split()[-2])
    assert not (reference / out / "checkpoint").exists() and written > 10
    chance = random.Random(seed)
    for number in range(kills):
        here = folder / f"{number}"
        if number % 2:
            moment, file = chance.choice(["before", "half", "after"]), chance.randint(1, written)
            process = started(command, ready(here), (moment, str(file)))
            process.communicate(timeout=300)
            assert process.returncode == -signal.SIGKILL
            how = f"{moment} file {file} of {written}"
        else:
            while not killed_after(moment := chance.uniform(0.0, lasts), command, ready(here)):
                shutil.rmtree(here)
                lasts = moment  # the machine is faster now than it was
            how = f"after {moment:.3f} s"
        process = started([*command, "--resume"], here)
        _, err = process.communicate(timeout=300)
        assert process.returncode == 0, (how, err)
        found = results(here / out)
        assert found.keys() == whole.keys(), how
        for name, value in whole.items():
            assert found[name] == value, (how, name)
        print(f"kill {number + 1} of {kills}, {how}: the same", flush=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command, out", [(SIMULATION, "run"), (FITTING, "fit")], ids=["simulation", "fit"]
)
def test_twenty_kills(tmp_path, command, out):
    survives(command, out, tmp_path, kills=20, seed=2)
