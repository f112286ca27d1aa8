"""Runs that fail: when, which particle, why, what to change, and a state from which to go on."""

import re
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.cli import resume
from mrjax.core.state import allocate_history
from mrjax.dem.plan import System
from mrjax.io import npz, results
from mrjax.simulation import follow
from mrjax.simulation.failure import refuse_deep_start
from tests.builders.particles import glass

ROOM = mrjax.Box((1e-2, 1e-2, 1e-2))
RADIUS = 5e-4
SOFT = glass(radius=RADIUS, elastic_modulus=5e5, poisson_ratio=0.25, friction=0.0, restitution=1.0)
APART = [[2e-3, 2e-3, 5e-3], [5e-3, 5e-3, 5e-3], [8e-3, 2e-3, 5e-3]]


def failed(state, parameters=SOFT, **given) -> mrjax.SimulationError:
    with pytest.raises(mrjax.SimulationError) as caught:
        mrjax.follow(state, parameters, ROOM, **given)
    return caught.value


def goes_on(error: mrjax.SimulationError, folder, **remedy) -> mrjax.Run:
    """From the file that a command leaves."""
    with (
        pytest.raises(mrjax.SimulationError, match=r"last good state, at .* is in"),
        resume.checkpointed(folder, False, True, seed=0),
    ):
        raise error
    assert {path.name for path in folder.iterdir()} == {resume.LAST_GOOD, results.LIST}
    state = mrjax.load_state(folder / resume.LAST_GOOD)
    parameters = SOFT.replace(**remedy.pop("parameters", {}))
    return mrjax.follow(state, parameters, ROOM, **remedy)


def when(error: mrjax.SimulationError) -> float:
    """The time that the message names, s."""
    return float(re.match(r"at (\S+) s, ", str(error))[1])


@pytest.mark.parametrize("larger", [0, 1])
def test_a_start_is_too_deep_by_the_smaller_of_two_radii(larger):
    """Nothing is compiled; up to a quarter of it the contact law describes the overlap."""
    radius = np.full(2, RADIUS)
    radius[larger] = 3.0 * RADIUS
    unlike = SOFT.replace(radius=jnp.asarray(radius))

    def start(overlap):
        apart = 4.0 * RADIUS - overlap * RADIUS
        return mrjax.place([[5e-3, 5e-3, 3e-3], [5e-3, 5e-3, 3e-3 + apart]])

    refuse_deep_start(System.of(start(0.24), unlike, ROOM))
    with pytest.raises(mrjax.SimulationError) as error:
        mrjax.follow(start(0.26), unlike, ROOM, duration=1e-4)
    assert str(error.value).startswith("at 0 s, particles 0 and 1, 0.26 radii deep: ")
    assert error.value.time == 0.0 and error.value.faults == mrjax.Fault.TOO_DEEP


def test_two_particles_too_deep(tmp_path):
    """They meet 0.1 radii apart, at 4 m/s, and are too soft for that."""
    gap, speed = 0.1 * RADIUS, 2.0
    positions = [*APART[:2], [5e-3, 5e-3, 6e-3 + gap]]
    state = mrjax.place(positions, [[0, 0, 0], [0, 0, speed], [0, 0, -speed]])
    # In a single frame, at whose beginning they do not touch yet.
    error = failed(state, duration=1e-4, frames=1, time_step=1e-6, skin=0.3)
    met, deep = gap / (2 * speed), (gap + 0.25 * RADIUS) / (2 * speed)
    assert deep < when(error) < 1.1 * deep + 1e-6 and met < when(error)
    assert "particles 1 and 2, 0.2" in str(error) and "a stiffer material" in str(error)
    stiffer = {"elastic_modulus": 5e8}
    after = goes_on(error, tmp_path, duration=6e-5, time_step=1e-8, parameters=stiffer, skin=0.3)
    np.testing.assert_allclose(after.state.velocity[1:, 2], [-speed, speed], rtol=1e-3)


@pytest.mark.parametrize("call", ["plain", pytest.param("differentiated", marks=pytest.mark.slow)])
def test_a_single_call_tells_as_much(call):
    """A differentiated one begins at its start again; a plain one keeps its frames."""
    state = mrjax.place([*APART[:2], [5e-3, 5e-3, 6.05e-3]], [[0.0] * 3, [0, 0, 2.0], [0, 0, -2.0]])
    given = dict(duration=1e-4, frames=10, time_step=1e-6, skin=0.3)

    def end(modulus):
        weak = SOFT.replace(elastic_modulus=modulus)
        return mrjax.simulate(state, weak, ROOM, **given).state.position[1, 2]

    with pytest.raises(mrjax.SimulationError) as caught:
        end(SOFT.elastic_modulus) if call == "plain" else jax.grad(end)(SOFT.elastic_modulus)
    assert str(caught.value) == str(failed(state, **given))
    assert "s, particles 1 and 2, 0.2" in str(caught.value) and when(caught.value) > 0.0
    assert caught.value.faults == mrjax.Fault.TOO_DEEP
    if call == "plain":
        met = when(caught.value)
        assert caught.value.time == pytest.approx(1e-5 * int(met / 1e-5))
        moved = caught.value.state.position - state.position
        np.testing.assert_allclose(moved[1:, 2] / caught.value.time, [2.0, -2.0], rtol=0.3)
    else:
        assert caught.value.time == 0.0
        np.testing.assert_array_equal(caught.value.state.position, state.position)


@pytest.mark.slow
def test_a_particle_too_deep_in_a_wall():
    state = mrjax.place([*APART, [5e-3, 9.4e-3, 5e-3]], [*[[0.0] * 3] * 3, [0.0, 4.0, 0.0]])
    error = failed(state, duration=1e-4, frames=10, time_step=1e-6, skin=0.3)
    assert "particle 3 and the upper wall in y, 0.2" in str(error)


def test_a_particle_through_a_wall(tmp_path):
    """In one step, from where it does not touch the wall to where it is beyond; the second of 3."""
    speed = 20.0
    positions = [APART[0], [8e-3, 5e-3, 5e-3], APART[2]]
    state = mrjax.place(positions, [[0.0] * 3, [speed, 0.0, 0.0], [0.0] * 3])
    given = dict(duration=2.4e-4, frames=4, time_step=6e-5, skin=3.0, rebuild_every=1)
    error = failed(state, SOFT.replace(elastic_modulus=1.0), **given)
    beyond = (ROOM.size[0] - 8e-3) / speed
    assert beyond < when(error) < beyond + 2 * 6e-5
    assert "s, particle 1: " in str(error) and error.faults & mrjax.Fault.ESCAPED
    assert "a particle went through a wall" in str(error) and "a smaller time_step" in str(error)
    stiff = {"elastic_modulus": 5e8}
    after = goes_on(error, tmp_path, duration=2.4e-4, time_step=2e-8, parameters=stiff)
    assert after.state.velocity[1, 0] == pytest.approx(-speed, rel=1e-3)


@pytest.mark.slow
def test_a_particle_that_is_nowhere():
    state = mrjax.place(APART, [[0.0] * 3, [0.0] * 3, [0.0, np.nan, 0.0]])
    error = failed(state, duration=1e-5, frames=1, time_step=1e-6)
    assert "at 1e-06 s, particle 2: a position or velocity is not finite" in str(error)
    assert "check the parameters" in str(error) and error.faults == mrjax.Fault.NOT_FINITE


def test_the_last_good_state_is_that_of_the_last_good_frame(tmp_path, monkeypatch):
    """Not that of the start; and a failure met again, resumed, is told in the same words."""
    monkeypatch.setattr(follow, "STEPS_IN_A_PART", 3 * 10)
    state = mrjax.place(APART, [[0.0] * 3, [0.0] * 3, [0.0, 0.0, 4.0]])
    given = dict(duration=1.5e-3, frames=15, time_step=1e-5, skin=0.3, checkpoint=tmp_path)
    first, again = failed(state, **given), failed(state, **given)
    reached = (ROOM.size[2] - RADIUS - 5e-3) / 4.0
    assert first.time == pytest.approx(1.1e-3) and first.time < reached < when(first)
    assert first.state.position[2, 2] == pytest.approx(5e-3 + 4.0 * first.time)
    assert str(first) == str(again) and again.time == first.time
    np.testing.assert_array_equal(first.state.position, again.state.position)


def test_a_bed_that_fails_tells_its_time_and_particle(case2):
    """As runs of given duration do: one too soft for its own weight."""
    recipe = case2.model_copy(update={"box": mrjax.Box((10e-6, 10e-6, 20e-6))})
    state = mrjax.disperse(recipe, seed=0)
    parameters = mrjax.softened(recipe.parameters(), recipe.box, state.particles, 0.05)
    modulus = 0.03 * parameters.elastic_modulus
    weak = parameters.replace(elastic_modulus=modulus, wall_elastic_modulus=modulus)
    with pytest.raises(
        mrjax.SimulationError, match=r"s, particle.* radii deep: two surf"
    ) as caught:
        mrjax.settle(state, weak, recipe.box, frames=50)
    error = caught.value
    assert 0.0 < error.time < when(error) and error.state.particles == 20
    assert float(jnp.abs(error.state.velocity).max()) > 0.0


def test_a_state_comes_back_to_the_last_bit(tmp_path, case2):
    """With what its contacts remember."""
    state = mrjax.disperse(case2, seed=1)
    contacts = allocate_history(state.particles, 5, float, sliding=True, rolling=False)
    contacts = replace(contacts, sliding=contacts.sliding + 0.1)
    for one in (
        replace(state, contacts=contacts),
        mrjax.place(APART, materials=[0, 1, 0], dtype=jnp.float32),
    ):
        mrjax.save_state(tmp_path / "one.npz", one, time=3.0)
        again = mrjax.load_state(tmp_path / "one.npz")
        assert jax.tree.structure(again) == jax.tree.structure(one)
        for left, right in zip(jax.tree.leaves(again), jax.tree.leaves(one), strict=True):
            assert left.dtype == right.dtype
            np.testing.assert_array_equal(left, right)
    npz.write(tmp_path / "other.npz", {"x": np.ones(1)}, {})
    with pytest.raises(mrjax.InputError, match="give a file that save_state wrote"):
        mrjax.load_state(tmp_path / "other.npz")
