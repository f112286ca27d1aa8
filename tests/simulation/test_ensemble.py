"""Many runs in one compiled call, over devices and processes: the numbers of one by one."""

import json
import os
import pickle
import socket
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.simulation import partners, processes
from tests.builders.processes import SMALL, free_port

RUNS = """
import pickle, sys
import jax

jax.config.update("jax_enable_x64", True)
number, count, port, devices = map(int, sys.argv[1:])
jax.config.update("jax_num_cpu_devices", devices)
import mrjax
from mrjax.simulation import processes

if count > 1:
    jax.distributed.initialize(f"127.0.0.1:{port}", count, number)
import jax.numpy as jnp

assert len(jax.devices()) == count * devices and jax.process_count() == count
recipe = mrjax.Recipe.load("case2").model_copy(update={"box": mrjax.Box((10e-6, 10e-6, 20e-6))})
parameters = mrjax.softened(recipe.parameters(), recipe.box, recipe.particle_count, 0.05)
state = mrjax.disperse(recipe, 0)


def run(f_w):
    changed = parameters.replace(f_w=f_w)
    return mrjax.simulate(
        state, changed, recipe.box, duration=30.0, frames=3, time_step=0.01, rebuild_every=20
    )


def total(by):
    return mrjax.ensemble(lambda f_w: by * f_w**2, factors).sum()


factors = jnp.linspace(40.0, 60.0, 5)
found = {
    "five": mrjax.ensemble(run, factors),
    "two": mrjax.ensemble(run, factors[:2]),
    "slope": jax.grad(total)(2.0),
    "divided": processes.divided(lambda some: [2 * one for one in some], (1, 2, 3)),
}
assert processes.is_first() == (number == 0)
with open(f"found-{number}", "wb") as file:
    pickle.dump(jax.device_get(found), file)
"""


def together(*commands: list[str], folder: Path) -> list[tuple[int, str, str]]:
    """Starts processes side by side: exit status, standard output and error of each."""
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "JAX_ENABLE_COMPILATION_CACHE": "false"}
    started = [
        subprocess.Popen(
            [sys.executable, *map(str, command)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder,
            env=environment,
        )
        for command in commands
    ]
    said = [process.communicate(timeout=300) for process in started]
    return [(one.returncode, *text) for one, text in zip(started, said, strict=True)]


def found(folder: Path, count: int, devices: int) -> list[dict]:
    """What each of `count` processes with so many devices finds."""
    port = free_port()
    commands = (["-c", RUNS, number, count, port, devices] for number in range(count))
    ended = together(*commands, folder=folder)
    assert [status for status, _, _ in ended] == [0] * count, ended
    return [pickle.loads((folder / f"found-{number}").read_bytes()) for number in range(count)]


@pytest.fixture(scope="module")
def three_devices(tmp_path_factory):
    """One process with three devices: they divide neither two members nor five."""
    return found(tmp_path_factory.mktemp("devices"), 1, 3)[0]


def same(one, other) -> None:
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for left, right in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(left, right, strict=True)


@pytest.mark.slow
def test_processes_change_no_number(tmp_path, three_devices):
    """Five members in two shares: the last place is filled. Two: one in each."""
    for each in found(tmp_path, 2, 1):
        same(each, three_devices)


def test_members_are_what_they_are_alone(three_devices, case2):
    """Whatever their number; rounded otherwise by another program, of which contacts make more."""
    five, two = three_devices["five"], three_devices["two"]
    same(two, jax.tree.map(lambda leaf: leaf[:2], five))
    assert five.heights.shape == (5, 4, 20) and not five.fault.any()
    box = mrjax.Box((10e-6, 10e-6, 20e-6))
    recipe = case2.model_copy(update={"box": box})
    parameters = mrjax.softened(recipe.parameters(), box, 20, 0.05)
    state = mrjax.disperse(recipe, 0)
    for place, f_w in enumerate(np.linspace(40.0, 60.0, 5)):
        changed = parameters.replace(f_w=f_w)
        lone = mrjax.simulate(
            state, changed, box, duration=30.0, frames=3, time_step=0.01, rebuild_every=20
        )
        np.testing.assert_allclose(five.heights[place], lone.heights, rtol=1e-9)
    assert len({float(height) for height in five.heights[:, -1, 0]}) == 5


def test_an_ensemble_is_differentiated_with_what_it_holds(three_devices):
    """By all members, and by a value that they share."""
    members = {"x": jnp.arange(6.0).reshape(3, 2), "k": jnp.array([1, 2, 3])}

    def total(by, x):
        def one(member):
            return {"y": by * member["k"].astype(float) * jnp.sum(member["x"] ** 2)}

        return jnp.sum(mrjax.ensemble(one, members | {"x": x})["y"])

    by, x = jax.grad(total, argnums=(0, 1))(2.0, members["x"])
    np.testing.assert_allclose(by, (0 + 1) + 2 * (4 + 9) + 3 * (16 + 25))
    np.testing.assert_allclose(x, 4.0 * np.array([[1], [2], [3]]) * members["x"])
    np.testing.assert_allclose(three_devices["slope"], np.sum(np.linspace(40.0, 60.0, 5) ** 2))


@pytest.mark.parametrize("members", [{}, {"x": np.ones(3), "k": np.ones(2)}, np.ones(0), 1.0])
def test_members_must_be_equally_many(members):
    with pytest.raises(mrjax.InputError, match="leading axis"):
        mrjax.ensemble(lambda member: member, members)


@pytest.mark.slow
def test_the_command_divides_an_ensemble(tmp_path):
    """Two processes, of which the first alone writes and speaks."""
    (tmp_path / "small.toml").write_text(SMALL)
    command = ["-m", "mrjax", "simulate", "small.toml", "--ensemble", "3", "--frames", "20"]
    where = f"127.0.0.1:{free_port()},2"
    ended = together(
        [*command, "--out", "alone", "--quiet"],
        [*command, "--out", "divided", "--distributed", f"{where},0"],
        [*command, "--out", "elsewhere", "--distributed", f"{where},1"],
        folder=tmp_path,
    )
    assert [status for status, _, _ in ended] == [0, 0, 0], ended
    assert not (tmp_path / "elsewhere").exists()
    assert "Results: divided" in ended[1][1] and "Results" not in ended[2][1]
    assert "settling" in ended[1][2] and "settling" not in ended[2][2]
    summaries = [
        json.loads((tmp_path / folder / "summary.json").read_text()) | {"wall_seconds": None}
        for folder in ("alone", "divided")
    ]
    assert summaries[0] == summaries[1] and summaries[0]["ensemble"] == 3
    curves = [(tmp_path / folder / "curve.csv").read_bytes() for folder in ("alone", "divided")]
    assert curves[0] == curves[1]


def test_a_fault_of_one_process_is_told_by_all(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    where = f"127.0.0.1:{free_port()},2"
    command = ["-m", "mrjax", "simulate", "case2", "--out", "file", "--distributed"]
    ended = together(*([*command, f"{where},{number}"] for number in (0, 1)), folder=tmp_path)
    for status, _, err in ended:
        assert status == 3 and "--out file: cannot be written to" in err


@pytest.mark.parametrize("number", [0, 1])
def test_an_address_that_cannot_be_used_is_refused(monkeypatch, number):
    """Taken, or with nobody there: JAX would crash."""
    monkeypatch.setattr(partners.timing, "PATIENCE", 0.0)
    with socket.socket() as taken:
        taken.bind(("", 0))
        where = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(mrjax.InputError, match="did not find each other"):
            processes.join(where, 2, number)
    with pytest.raises(mrjax.InputError, match="did not find each other"):
        processes.join("127.0.0.1:99999", 2, number)


def test_work_of_one_process_is_not_divided():
    assert processes.divided(lambda some: [2 * one for one in some], (1, 2, 3)) == [2, 4, 6]
    assert processes.by_first(lambda: "here") == "here" and processes.is_first()
    assert 1 <= processes.usable_cores() <= os.cpu_count()
