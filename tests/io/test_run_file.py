"""The file of a run: which array stands under which name, and in which unit."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.state import ContactHistory
from tests.builders.runs import run_of

BOX = mrjax.Box((10.0, 12.0, 14.0), (True, False, False))


@pytest.fixture(scope="module")
def run():
    """Numbers that all differ, of three particles that touch each other at four times."""
    random = np.random.default_rng(0)

    def some(*shape):
        return jnp.asarray(random.uniform(0.1, 0.9, shape))

    places, speeds, spins = (random.uniform(1.0, 9.0, (3, 3)) for _ in range(3))
    history = ContactHistory(
        jnp.array([[1, -2], [0, 2], [1, -1]], jnp.int32), some(3, 2, 3), some(3, 2, 3)
    )
    return run_of(
        np.cumsum(random.uniform(0.1, 1.0, 4)),
        some(4, 3),
        BOX,
        radius=some(3),
        mean_velocity=some(4),
        mean_speed=some(4),
        state=replace(mrjax.place(places, speeds, spins), contacts=history),
        deepest_overlap=some(),
        coating_overlap=some(),
        trajectory=mrjax.Trajectory(some(4, 3, 3), some(4, 3, 3), some(4, 3, 3)),
        rising=jnp.asarray(True),
    )


def test_every_array_has_the_name_of_what_it_is(run, tmp_path):
    """By the raw file: a round trip does not see two names that are exchanged in both ways."""
    path = tmp_path / "run.npz"
    mrjax.save_run(path, run, {"seed": 1})
    last, along = run.state, run.trajectory
    expected = {
        "times_s": run.times,
        "heights_m": run.heights,
        "radius_m": run.radius,
        "mean_velocity_m_per_s": run.mean_velocity,
        "mean_speed_m_per_s": run.mean_speed,
        "deepest_overlap_radii": run.deepest_overlap,
        "deepest_overlap_coatings": run.coating_overlap,
        "fault": run.fault,
        "rising": 1,
        "position_m": along.position,
        "velocity_m_per_s": along.velocity,
        "spin_rad_per_s": along.spin,
        "last_position_m": last.position,
        "last_velocity_m_per_s": last.velocity,
        "last_spin_rad_per_s": last.spin,
        "contact_partner": last.contacts.partner,
        "contact_sliding_m": last.contacts.sliding,
        "contact_rolling_rad": last.contacts.rolling,
    }
    with np.load(path, allow_pickle=False) as stored:
        for name, array in expected.items():
            np.testing.assert_array_equal(stored[name], array, err_msg=name)
            alike = [
                other
                for other, held in expected.items()
                if np.shape(held) == np.shape(array) and np.array_equal(held, array)
            ]
            assert alike == [name]


def test_a_run_whose_times_go_back_is_refused(run, tmp_path):
    path = tmp_path / "run.npz"
    mrjax.save_run(path, replace(run, times=run.times[::-1]), {})
    with pytest.raises(mrjax.InputError, match="its times decrease"):
        mrjax.load_run(path)
