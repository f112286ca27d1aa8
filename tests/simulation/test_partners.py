"""Processes that compute together: none waits for a dead one, and none runs what it is sent."""

import pickle
import random
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.state import ContactHistory
from mrjax.simulation import messages
from tests.builders.commands import start
from tests.builders.processes import SMALL, free_port

ONE = """
import sys, time
from mrjax.simulation import partners
from mrjax.core.errors import InputError, SystemRefusal

timing = partners.timing
timing.PATIENCE, timing.SILENCE, timing.BEAT, timing.GRACE = {times}
number, count, port, busy = map(int, sys.argv[1:])
try:
    group = partners.meet(f"127.0.0.1:{{port}}", count, number)
    print("there", flush=True)
    group.gather(b"%d" % number)
    if number == count - 1:
        time.sleep(60)
    if busy:
        time.sleep(60)
    group.gather(b"again")
except (InputError, SystemRefusal, OSError) as error:
    print(f"{{type(error).__name__}}: {{error}}", file=sys.stderr)
    sys.exit(3)
"""


def process(number: int, count: int, port: int, busy=0, times=(60.0, 60.0, 1.0, 1.0)):
    return subprocess.Popen(
        [sys.executable, "-c", ONE.format(times=times), *map(str, (number, count, port, busy))],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(one: subprocess.Popen, *words: str) -> None:
    _, err = one.communicate(timeout=50)
    assert one.returncode == 3 and err.count("\n") == 1, (one.returncode, err)
    for word in words:
        assert word in err


@pytest.mark.parametrize("busy", [0, 1], ids=["waiting", "busy"])
def test_a_process_that_is_killed_ends_all_others(busy):
    port = free_port()
    three = [process(number, 3, port, busy) for number in range(3)]
    for one in three:
        assert one.stdout.readline() == "there\n"
    three[2].kill()
    for one in three[:2]:
        ended(one, "process 2 of 3 ended before its work was done", "start all of them again")
    three[2].communicate()


def test_the_first_that_is_killed_ends_all_others():
    port = free_port()
    two = [process(number, 2, port) for number in range(2)]
    for one in two:
        assert one.stdout.readline() == "there\n"
    two[0].kill()
    ended(two[1], "process 0 of 2 ended before its work was done")
    two[0].communicate()


def test_a_process_that_falls_silent_ends_all_others():
    """As when its machine loses power."""
    port = free_port()
    two = [process(number, 2, port, times=(60.0, 3.0, 0.5, 1.0)) for number in range(2)]
    for one in two:
        assert one.stdout.readline() == "there\n"
    two[1].send_signal(signal.SIGSTOP)
    try:
        ended(two[0], "process 1 of 2 was silent for 3 s")
    finally:
        two[1].kill()
        two[1].communicate()


def test_who_does_not_come_is_named():
    port = free_port()
    two = [process(number, 3, port, times=(4.0, 60.0, 1.0, 1.0)) for number in range(2)]
    ended(two[0], "process 2 of 3 did not come within 4 s")
    ended(two[1], "process 0 ended before all were there")


def test_strangers_and_others_of_another_count_are_not_let_in():
    port = free_port()
    first = process(0, 2, port)
    other = process(1, 5, port)
    ended(other, "InputError: process 1 has count = 5, process 0 has 2")
    for said in (b"GET / HTTP/1.1\r\n\r\n", b"", pickle.dumps([1]), b"\xff" * 100, b"H" + bytes(8)):
        with socket.create_connection(("127.0.0.1", port), timeout=10) as stranger:
            stranger.sendall(said)
    second = process(1, 2, port)
    assert [one.stdout.readline() for one in (first, second)] == ["there\n"] * 2
    second.kill()
    ended(first, "process 1 of 2 ended")
    second.communicate()


def same(one, other) -> None:
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for left, right in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert type(left) is type(right)
        np.testing.assert_array_equal(left, right, strict=True)


@pytest.fixture(scope="module")
def sent(case2, tmp_path_factory) -> list:
    """All that processes send each other."""
    sheet = tmp_path_factory.mktemp("sheet") / "small.toml"
    sheet.write_text(SMALL)
    recipe = mrjax.Recipe.load(sheet)
    state = mrjax.place([[5e-6, 5e-6, 3e-6], [5e-6, 5e-6, 8e-6]], contact_diameter=4e-6)
    run = mrjax.simulate(state, recipe.parameters(), recipe.box, duration=1e-9, trajectory=True)
    partner, way = jnp.array([[1], [0]], jnp.int32), jnp.array([[[1e-9, 0.0, 2e-9]]] * 2)
    history = ContactHistory(partner, way, None, {"age": jnp.array([[0.1], [0.1]]), "way": -way})
    error = mrjax.SimulationError("the bed is unstable")
    error.state, error.time, error.faults = run.state, 1.5, 8
    return [
        [run, None],
        [state],
        [replace(state, contacts=history)],
        [recipe],
        [Path("é/run")],
        error,
        mrjax.InputError("no"),
        [replace(state, memory={"direction": way[:, 0]}).with_seed(3)],
        [1, 0.1],
    ]


def test_what_is_sent_arrives_to_the_last_bit(sent):
    for value in sent:
        found = messages.decode(messages.encode(value))
        if isinstance(value, Exception):
            assert type(found) is type(value) and str(found) == str(value)
            if isinstance(value, mrjax.SimulationError):
                assert (found.time, found.faults) == (value.time, value.faults)
                same(found.state, value.state)
        elif isinstance(value[0], mrjax.Recipe | Path):
            assert found == value
        else:
            same(found, value)
    assert found[1].hex() == (0.1).hex()
    recipe, arrived = sent[3][0], messages.decode(messages.encode(sent[3]))[0]
    assert arrived.notes == recipe.notes and arrived.parameters() == recipe.parameters()


def test_what_a_recipe_leaves_to_be_assumed_is_not_taken_for_stated():
    recipe = mrjax.Recipe(
        name="chalk",
        particle={"density": 2150.0, "diameter": [1e-5, 2e-5], "material": "mineral"},
        fluid={"liquid": "water"},
        composition={"solids_ratio": 0.1},
    )
    arrived = messages.decode(messages.encode([recipe]))[0]
    assert arrived == recipe and arrived.stated == recipe.stated
    assert (arrived.notes, arrived.contact_notes) == (recipe.notes, recipe.contact_notes)
    assert len(arrived.notes) == 1 and len(arrived.contact_notes) == 2


def test_nothing_that_is_sent_is_run(tmp_path):
    class Harmful:
        def __reduce__(self):
            return open, (str(tmp_path / "made"), "w")

    with pytest.raises(ValueError, match="message"):
        messages.decode(pickle.dumps(Harmful()))
    for value in (Harmful(), [lambda: None], np.array([None]), RuntimeError()):
        with pytest.raises(TypeError):
            messages.encode(value)
    assert not list(tmp_path.iterdir())


def test_damaged_messages_are_no_other_exception(sent):
    chance = random.Random(5)
    for value in sent:
        whole = messages.encode(value)
        for _ in range(200):
            damaged = bytearray(
                whole[: chance.randrange(len(whole))] if chance.random() < 0.3 else whole
            )
            for _ in range(chance.randrange(4)):
                if damaged:
                    damaged[chance.randrange(min(len(damaged), 600))] = chance.randrange(256)
            with suppress(ValueError):
                messages.decode(bytes(damaged))


@pytest.mark.slow
@pytest.mark.parametrize("killed", [0, 1])
def test_a_command_whose_partner_is_killed_ends_with_one_line(tmp_path, killed):
    (tmp_path / "small.toml").write_text(SMALL)
    command = ["simulate", "small.toml", "--ensemble", "4", "--frames", "2000", "--distributed"]
    where = f"127.0.0.1:{free_port()},2"
    two = [start(*command, f"{where},{number}", folder=tmp_path) for number in (0, 1)]
    assert two[0].stderr.read(1)  # progress: both are at work
    two[killed].kill()
    _, err = two[1 - killed].communicate(timeout=100)
    assert two[1 - killed].returncode == 3
    *_, line = err.splitlines()
    assert line.endswith("nothing of this run is kept: start all of them again")
    assert f"mrjax: process {killed} of 2 ended before its work was done" in line
    two[killed].communicate()
