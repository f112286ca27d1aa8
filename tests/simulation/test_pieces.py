"""Runs in pieces: the bits do not depend on them, nor on where a run was stopped or mended."""

import logging
import random
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import jax
import numpy as np
import pytest
from jax.tree_util import Partial

import mrjax
from mrjax.cli import exit_status
from mrjax.core import interruption, units
from mrjax.dem import scan, schedule, sorting
from mrjax.simulation import follow, pieces, progress
from tests.builders import ROOT
from tests.builders.beds import WALLED, dispersed, soft
from tests.builders.stopping import Stopped, alike, stopping

DURATION = dict(duration=3.0, frames=6, time_step=0.003, skin=0.05)


@pytest.fixture(scope="module")
def small(case2):
    """Parameters and a start of twenty particles with friction."""
    return soft(case2, WALLED), dispersed(case2, WALLED, 0)


@pytest.fixture(scope="module")
def whole(small):
    parameters, state = small
    return mrjax.simulate(state, parameters, WALLED, **DURATION, trajectory=True)


class Random(pieces._Pace):
    """Pieces of any length."""

    chance = random.Random(0)

    def intervals(self) -> int:
        return self.chance.choice([1, 2, 3, 5, 8, 40])


def test_the_bits_do_not_depend_on_the_pieces(small, whole, monkeypatch):
    """Of one interval, of some, of whole frames, of all of them."""
    parameters, state = small
    assert whole.steps >= 6 * 2 * 64  # several intervals to a frame
    monkeypatch.setattr(pieces, "_Pace", Random)
    for _ in range(3):
        alike(mrjax.simulate(state, parameters, WALLED, **DURATION, trajectory=True), whole)


def test_follow_has_the_bits_of_simulate(small, whole, monkeypatch):
    parameters, state = small
    for most in (1, 20 * 128 * 3, 10**8):  # parts of a frame, and of several
        monkeypatch.setattr(follow, "STEPS_IN_A_PART", most)
        alike(mrjax.follow(state, parameters, WALLED, **DURATION, trajectory=True), whole)


def test_a_traced_call_gives_the_same_run(small, whole):
    """Another program: the same to rounding, which a bed spreads."""
    parameters, state = small

    @jax.jit
    def heights(parameters):
        given = dict(DURATION, time_step=whole.time_step)
        return mrjax.simulate(state, parameters, WALLED, **given).heights

    np.testing.assert_allclose(heights(parameters), whole.heights, rtol=1e-9)


@pytest.fixture
def met(monkeypatch):
    """The faults that were met, each with the frame in which."""
    found, mend = [], pieces.PiecewiseRun._repair

    def seen(self, fault, good):
        mend(self, fault, good)
        found.append((mrjax.Fault(fault), self.place.frame))

    monkeypatch.setattr(pieces.PiecewiseRun, "_repair", seen)
    return found


def test_a_frame_that_is_mended_is_so_whatever_the_pieces(small, monkeypatch, tmp_path, met):
    """The list has room for as many pairs as the suspension has, not for those of the bed."""
    parameters, state = small
    given = dict(duration=300.0, frames=10, time_step=0.0167, skin=0.05)
    plan = schedule.plan_neighbour_list
    monkeypatch.setattr(schedule, "plan_neighbour_list", lambda *of: replace(plan(*of), pairs=58))
    whole = mrjax.simulate(state, parameters, WALLED, **given)
    first = list(met)
    assert {fault for fault, _ in first} == {mrjax.Fault.PAIRS_DROPPED}
    assert 1 < first[0][1] < 9
    monkeypatch.setattr(pieces, "_Pace", Random)
    alike(mrjax.simulate(state, parameters, WALLED, **given), whole)
    assert met == 2 * first
    monkeypatch.setattr(follow, "STEPS_IN_A_PART", 20 * 128 * 9)
    for number in (2, 11, 16):
        folder = tmp_path / str(number)
        with pytest.raises(Stopped), stopping(number):
            mrjax.follow(state, parameters, WALLED, **given, checkpoint=folder)
        alike(mrjax.follow(state, parameters, WALLED, **given, checkpoint=folder), whole)


def test_a_list_that_is_outrun_is_looked_at_more_often(met):
    """From rest the first list is taken to serve for a whole interval."""
    state = mrjax.place([[3.0, 3.0, 9.0], [3.0, 8.0, 9.0]], contact_diameter=2.0)
    run = mrjax.simulate(
        state,
        mrjax.Parameters(
            radius=1.0,
            particle_density=0.3,
            fluid_density=0.0,
            viscosity=0.0,
            gravity=100.0,
            elastic_modulus=1e6,
            poisson_ratio=0.3,
        ),
        mrjax.Box((12.0, 12.0, 12.0), (True, True, False)),
        duration=0.3,
        time_step=1e-3,
        rebuild_every=100,
    )
    assert {fault for fault, _ in met} == {mrjax.Fault.OUTRAN_LIST}
    assert run.state.position[0, 2] == pytest.approx(9.0 - 50.0 * 0.3**2, rel=1e-2)


def test_a_function_that_holds_what_is_differentiated_is_no_plain_call(small):
    """Its coefficient: the same derivative as through the leaf of a bundled closure."""
    parameters, state = small
    given = dict(duration=0.1, time_step=0.01)

    def height(hindrance) -> jax.Array:
        run = mrjax.simulate(state, parameters, WALLED, **given, hindrance=hindrance)
        return run.state.position[:, 2].mean()

    def bundled(exponent):
        return height(Partial(lambda phi, n: 20.0 * (1.0 - phi) ** -n, n=exponent))

    found = jax.grad(lambda n: height(lambda phi: 20.0 * (1.0 - phi) ** -n))(4.65)
    assert found == pytest.approx(float(jax.grad(bundled)(4.65)), rel=1e-9)
    assert found > 0.0  # what is more hindered is higher


def test_a_checkpoint_of_another_layout_is_refused(small, tmp_path, monkeypatch):
    parameters, state = small
    given = dict(duration=0.1, time_step=0.01, checkpoint=tmp_path / "kept")
    kept = pieces.PiecewiseRun.kept

    def older(self):
        recorded, place = kept(self)
        return recorded, {name: place[name] for name in place if name != "faults"}

    monkeypatch.setattr(pieces.PiecewiseRun, "kept", older)
    mrjax.follow(state, parameters, WALLED, **given)
    with pytest.raises(mrjax.InputError, match="'faults' is of another version of mrjax; take"):
        mrjax.follow(state, parameters, WALLED, **given)


def test_many_particles_keep_their_order(monkeypatch, small, whole):
    """In pieces, too: those that a run sorts in space are given back as they came."""
    parameters, state = small
    monkeypatch.setattr(sorting, "SORT_FROM", 2)
    sorted_run = mrjax.simulate(state, parameters, WALLED, **DURATION, trajectory=True)
    np.testing.assert_allclose(sorted_run.heights, whole.heights, rtol=1e-9)
    np.testing.assert_allclose(sorted_run.state.position, whole.state.position, rtol=1e-9)
    np.testing.assert_allclose(sorted_run.trajectory.position, whole.trajectory.position, rtol=1e-9)


# --- a run is stopped -----------------------------------------------------------------------------

INTERRUPTED = ROOT / "tests" / "builders" / "interrupted.py"


def interrupted(call: str, times: int, *options: str) -> list[float]:
    """How long after Ctrl-C a call was back, s, at random moments after compilation."""
    done = subprocess.run(
        [sys.executable, str(INTERRUPTED), call, str(times), *options],
        capture_output=True,
        text=True,
        timeout=550,
    )
    assert done.returncode == 0, done.stderr
    return [float(line) for line in done.stdout.split()]


@pytest.mark.parametrize("call", ["simulate", "settle"])
def test_ctrl_c_ends_a_call(call):
    """Where a call was waited for to its end, this would take half a minute."""
    assert max(interrupted(call, 1)) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("call", ["simulate", "follow", "settle", "sedimentation", "ensemble"])
def test_ctrl_c_ends_any_call_ten_times(call):
    waits = interrupted(call, 10)
    assert len(waits) == 10
    assert max(waits) < 2.0


def test_an_interval_of_very_many_is_not_waited_for(small, monkeypatch):
    """Its call is left to a thread: what an interruption meets is Python's own waiting."""
    parameters, state = small
    threads = []
    advance = scan.advance

    def seen(*arguments, **options):
        threads.append(threading.current_thread())
        return advance(*arguments, **options)

    monkeypatch.setattr(scan, "advance", seen)
    monkeypatch.setattr(pieces, "PATIENCE", 0.0)
    mrjax.simulate(state, parameters, WALLED, duration=0.1, time_step=0.01)
    assert threads and threading.main_thread() not in threads


def test_one_run_that_fails_stops_the_others(small, monkeypatch):
    """And is the one that is told of."""
    parameters, state = small
    stopped = []
    advance = pieces.PiecewiseRun.advance

    def failing(self, frames, *watch):
        if self.original.state is not state:
            raise mrjax.SimulationError("the second fails")
        try:
            while True:
                advance(self, frames, *watch)
        except interruption.StoppedError:
            stopped.append(self)
            raise

    monkeypatch.setattr(pieces.PiecewiseRun, "advance", failing)
    other = replace(state)
    with pytest.raises(mrjax.SimulationError, match="the second fails"):
        mrjax.settle([state, other], parameters, WALLED, frames=40)
    assert len(stopped) == 1


BUSY = """
import click, jax
from mrjax.cli import exit_status

@click.command()
def busy():
    print("begun", flush=True)
    jax.lax.fori_loop(0, 2**31 - 1, lambda _, x: jax.numpy.sin(x), 1.0).block_until_ready()
    jax.lax.fori_loop(0, 2**31 - 1, lambda _, x: jax.numpy.cos(x), 1.0).block_until_ready()

exit_status.run(busy, "busy")
"""


def test_ctrl_c_ends_a_command_that_is_busy_outside_python():
    """As while JAX compiles, or in one run of a model of the user's own: in minutes otherwise."""
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "begun\n"
    time.sleep(1.0)  # it is in the first of the two loops
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=30.0)
    assert process.returncode == exit_status.INTERRUPTED
    assert told.strip() == "busy: interrupted; no results were written"


# --- a run is watched -----------------------------------------------------------------------------


def test_a_long_call_says_so_before_it_starts(caplog):
    """Steps, about how long, and what would make it shorter; a short one says nothing."""
    progress.announce("simulate", 1e4, 314)
    assert not caplog.records
    progress.announce("simulate", 7e7, 314)
    (told,) = caplog.records
    assert told.name == "mrjax.progress" and told.levelno == logging.WARNING
    text = told.getMessage()
    assert "simulate takes 7e+07 steps of 314 particles, about 32 min" in text
    assert "softened" in text and "fewer particles" in text


@pytest.mark.parametrize(
    "seconds, words", [(1.0, "1 s"), (119.0, "1.2e+02 s"), (120.0, "2 min"), (1e5, "28 h")]
)
def test_lengths_of_time_in_words(seconds, words):
    assert units.time_in_words(seconds) == words


def test_progress_shows_steps_time_and_what_is_left(small, capsys):
    parameters, state = small
    mrjax.simulate(state, parameters, WALLED, **DURATION, progress=True)
    last = capsys.readouterr().err.split("\r")[-1]
    assert "simulate 100 %" in last and "steps" in last and "3 s" in last and "left" in last


# --- a start that overlaps ------------------------------------------------------------------------


@pytest.mark.parametrize("way", ["simulate", "follow", "settle"])
def test_a_start_that_overlaps_is_refused_before_anything_is_compiled(small, monkeypatch, way):
    parameters, _ = small
    monkeypatch.setattr(scan, "begin", None)
    position = np.array([[3e-6, 3e-6, 5e-6], [5e-6, 5e-6, 12e-6], [5e-6, 5e-6, 15e-6]])
    deep = mrjax.place(position)
    with pytest.raises(
        mrjax.SimulationError, match=r"at 0 s, particles 1 and 2, 0\.5 radii"
    ) as seen:
        if way == "settle":
            mrjax.settle(deep, parameters, WALLED)
        else:
            getattr(mrjax, way)(deep, parameters, WALLED, duration=1.0, time_step=0.01)
    assert seen.value.time == 0.0 and "a start without overlap" in str(seen.value)
    position[1] = [1e-7, 5e-6, 5e-6]
    with pytest.raises(mrjax.SimulationError, match=r"particle 1 and the lower wall in x, 0\.95"):
        mrjax.simulate(mrjax.place(position), parameters, WALLED, duration=1.0, time_step=0.01)
