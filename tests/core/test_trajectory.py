"""The trajectory of a run: that of the same run to the last bit, whoever follows it."""

import jax
import numpy as np
import pytest

import mrjax
from mrjax.dem import sorting

SHEET = {
    "name": "small",
    "particle": {
        "density": 7470.0,
        "diameter": [3e-6, 4e-6],
        "elastic_modulus": 211e9,
        "poisson_ratio": 0.31,
    },
    "fluid": {"density": 950.0, "viscosity": 0.01},
    "composition": {"particle": 0.8, "fluid": 0.2},
    "contact": {"friction": 0.3},
    "box": {"size": [10e-6, 10e-6, 20e-6], "periodic": [True, False, False]},
}


@pytest.fixture(scope="module")
def recipe():
    return mrjax.Recipe.model_validate(SHEET)


def same_but_for_the_trajectory(run, plain):
    """All that both have is the same to the last bit."""
    assert plain.trajectory is None
    for one, other in zip(
        jax.tree.leaves(jax.tree.map(np.asarray, run.__dict__ | {"trajectory": None})),
        jax.tree.leaves(jax.tree.map(np.asarray, plain.__dict__)),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
def test_a_run_to_rest_is_the_same_with_and_without(recipe):
    """Several starts, of which one rests before the other; friction, a periodic axis, two sizes."""
    plain, whole = (
        mrjax.sedimentation(recipe, (0, 1), frames=40, trajectory=wanted).run
        for wanted in (False, True)
    )
    same_but_for_the_trajectory(whole, plain)
    found = whole.trajectory
    assert found.position.shape == found.spin.shape == (*whole.heights.shape, 3)
    np.testing.assert_array_equal(found.position[..., 2], whole.heights)
    np.testing.assert_array_equal(found.position[:, -1], whole.state.position)
    np.testing.assert_array_equal(found.velocity[:, -1], whole.state.velocity)
    np.testing.assert_array_equal(found.spin[:, -1], whole.state.spin)
    start = mrjax.disperse(recipe, seed=1)
    np.testing.assert_allclose(found.position[1, 0], start.position, rtol=1e-15)
    # XLA sums a mean in an order of its own.
    np.testing.assert_allclose(
        -np.mean(found.velocity[..., 2], axis=-1),
        whole.mean_velocity,
        rtol=0,
        atol=1e-14 * np.abs(found.velocity).max(),
    )
    assert np.abs(found.spin).max() > 0.0


@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_many_particles_come_back_in_their_own_order(recipe, monkeypatch, dtype):
    """As from 4,096 particles on, whose runs go through them in the order of space."""
    monkeypatch.setattr(sorting, "SORT_FROM", 2)
    parameters = recipe.parameters(dtype)
    state = mrjax.disperse(recipe, seed=0, dtype=dtype)

    def run(trajectory):
        return mrjax.simulate(
            state, parameters, recipe.box, duration=1e-7, frames=3, trajectory=trajectory
        )

    found = run(True)
    same_but_for_the_trajectory(found, run(False))
    assert found.trajectory.position.dtype == dtype
    np.testing.assert_array_equal(found.trajectory.position[..., 2], found.heights)
    np.testing.assert_array_equal(found.trajectory.velocity[-1], found.state.velocity)
    moved = np.abs(found.trajectory.position - state.position[None])
    assert 0.0 < moved.max() < 1e-10


def test_it_is_traced_and_differentiated_as_the_rest():
    """A free fall: all that moves is in proportion to 1 / f_w, once it is steady."""
    parameters = mrjax.Recipe.load("case2").parameters()
    box = mrjax.Box((1e-3, 1e-3, 1e-3), (True, True, False))
    state = mrjax.place([[5e-4, 5e-4, 9e-4]], contact_diameter=4e-6)

    def path(f_w):
        run = mrjax.simulate(
            state,
            parameters.replace(f_w=f_w),
            box,
            duration=1e-3,
            frames=2,
            time_step=1e-4,
            trajectory=True,
        )
        return run.trajectory

    value, slope = jax.jvp(path, (50.0,), (1.0,))
    # The rise, a relaxation time of 1e-8 s, is 1e-5 of the way.
    np.testing.assert_allclose(
        50.0 * slope.velocity[1:, 0, 2], -value.velocity[1:, 0, 2], rtol=1e-4
    )
    fallen = value.position[1:, 0, 2] - 9e-4
    np.testing.assert_allclose(50.0 * slope.position[1:, 0, 2], -fallen, rtol=1e-4)
    several = jax.vmap(path)(jax.numpy.array([50.0, 60.0]))
    assert several.position.shape == (2, 3, 1, 3)
    np.testing.assert_array_equal(several.position[0], value.position)
