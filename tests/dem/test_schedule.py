"""How a run is cut: equal steps that fill the frames, lists rebuilt in time, bounds on the step."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mrjax
from mrjax.dem import neighbours, schedule
from mrjax.dem.schedule import MOST_STEPS, MOST_STEPS_BETWEEN_REBUILDS, Schedule
from mrjax.laws import particle, time_scales
from tests.builders.particles import unit_spheres

near = partial(pytest.approx, rel=1e-12, abs=0.0)
BOX = mrjax.Box((10.0, 10.0, 40.0))


@given(st.floats(1e-3, 1e4), st.floats(1e-2, 10.0), st.integers(1, 50), st.integers(1, 200))
def test_equal_steps_fill_the_frames(duration, time_step, frames, rebuild_every):
    found = schedule.plan_steps(duration, time_step, frames, rebuild_every)
    assert found.frames == frames and found.total == frames * found.intervals * found.steps
    assert 1 <= found.steps <= rebuild_every
    assert duration / found.total <= time_step * (1 + 1e-11)
    # No more than the fewest, and one for each interval where these do not divide them.
    fewest = max(1, math.ceil(duration / frames / time_step * (1 - 1e-12)))
    assert fewest <= found.intervals * found.steps < fewest + found.intervals


def test_the_fewest_steps_where_the_intervals_divide_them():
    assert schedule.plan_steps(24.0, 1.0, 2, 5) == Schedule(2, 3, 4)
    assert schedule.plan_steps(24.1, 1.0, 2, 5) == Schedule(2, 3, 5)  # 13: a prime
    assert schedule.plan_steps(0.1, 1.0, 1, 5) == Schedule(1, 1, 1)


@pytest.mark.parametrize("duration, time_step, steps", [(1.1, 0.1, 11), (0.3, 0.1, 3), (7, 1, 7)])
def test_a_whole_number_of_steps_is_not_missed_by_rounding(duration, time_step, steps):
    assert schedule.plan_steps(duration, time_step, 1, 128).total == steps


def test_more_steps_than_can_be_counted_are_refused():
    assert schedule.plan_steps(float(MOST_STEPS), 1.0, MOST_STEPS, 128).total == MOST_STEPS
    for duration, frames in ((1.001 * MOST_STEPS, MOST_STEPS), (1.001 * MOST_STEPS, 1), (1e300, 1)):
        with pytest.raises(mrjax.InputError, match=f"more than {MOST_STEPS}; give a shorter"):
            schedule.plan_steps(duration, 1.0, frames, 128)


@given(st.integers(1, 5), st.integers(1, 40), st.integers(1, MOST_STEPS_BETWEEN_REBUILDS))
def test_rebuilt_more_often_no_step_is_lost(frames, intervals, steps):
    before = Schedule(frames, intervals, steps)
    after = before.rebuilt_more_often()
    assert after.frames == frames and after.steps == max(1, steps // 4)
    assert before.total <= after.total < before.total + frames * after.steps


RADII = np.array([0.5, 1.0])


def state(contact_diameter=None, particles=2):
    places = 2.5 * np.arange(1, particles + 1)[:, None] * [1.0, 0.0, 0.0] + 1.5
    return mrjax.place(places, contact_diameter=contact_diameter)


def test_the_contact_diameter_of_concrete_radii_is_theirs():
    assert schedule.contact_diameter(state(), RADII, 0.1) == 2.0


def test_that_of_the_state_serves_within_the_slack():
    """From a little too short on, up to the slack of the skin."""
    edge = 2.0 / 1.1
    for given_, found in ((edge * 1.0001, edge * 1.0001), (edge * 0.9999, 2.0), (2.0, 2.0)):
        assert schedule.contact_diameter(state(given_), RADII, 0.1) == near(found)


def test_traced_radii_need_that_of_the_state():
    assert schedule.contact_diameter(state(1.7), None, 0.1) == 1.7
    with pytest.raises(mrjax.InputError, match=r"give place\(\.\.\., contact_diameter="):
        schedule.contact_diameter(state(), None, 0.1)


def test_the_list_reaches_as_far_as_contacts_and_the_skin():
    """In contact radii; one capacity for all where it is given."""
    many = state(particles=30)
    plan = schedule.plan_neighbour_list(many, np.ones(30), BOX, 2.0, 0.1)
    assert plan.cutoff == near(2.2)
    assert plan == neighbours.plan_list(BOX, 30, 2.0, 2.0, 0.2)
    given_ = schedule.plan_neighbour_list(many, np.ones(30), BOX, 2.0, 0.1, capacity=7)
    assert given_.capacity == 7 and given_.pairs >= 7 * 30 / 2 + 3 * 30
    assert (
        schedule.plan_neighbour_list(many, np.ones(30), BOX, 2.0, 0.1, capacity=50).capacity == 29
    )


def test_contacts_that_came_along_have_room():
    """Walls have slots of their own, two for each axis."""
    one = state(particles=30)
    history = mrjax.core.state.allocate_history(30, 26, float, sliding=True, rolling=False)
    held = mrjax.State(one.position, one.velocity, one.spin, history)
    assert schedule.plan_neighbour_list(held, np.ones(30), BOX, 2.0, 0.1, capacity=7).capacity == 20


def test_no_one_is_faster_than_the_bound():
    """Drag, the duration or the height of a fall ends it, whichever comes first."""
    velocity = np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]])
    alone = unit_spheres(gravity=2.0, fluid_density=0.0, viscosity=0.0)  # falls with gravity
    assert schedule.greatest_speed(velocity, alone, BOX, 1.5) == near(5.0 + 2.0 * 1.5)
    assert schedule.greatest_speed(velocity, alone, BOX, 1e3) == near(5.0 + np.sqrt(2 * 2.0 * 40.0))
    endless = mrjax.Box(BOX.size, (False, False, True))
    assert schedule.greatest_speed(velocity, alone, endless, 1e3) == near(5.0 + 2.0 * 1e3)
    slow = unit_spheres(gravity=2.0, fluid_density=0.0, viscosity=10.0)
    terminal = float(mrjax.terminal_velocity(slow))
    assert schedule.greatest_speed(velocity, slow, BOX, 1e3) == near(5.0 + terminal)
    upwards = unit_spheres(gravity=-2.0, fluid_density=0.0, viscosity=0.0)
    assert schedule.greatest_speed(velocity, upwards, BOX, 1.5) == near(5.0 + 2.0 * 1.5)
    assert schedule.greatest_speed(None, alone, BOX, 1.0) is None


@given(st.floats(1e-6, 1e3), st.floats(1e-6, 1.0), st.floats(1e-3, 1.0))
def test_the_list_is_rebuilt_before_a_quarter_of_the_skin_is_crossed(speed, time_step, skin):
    steps = schedule.steps_within_skin(speed, time_step, skin)
    step, quarter = speed * time_step, 0.25 * skin
    assert 1 <= steps <= MOST_STEPS_BETWEEN_REBUILDS
    assert steps == 1 or steps * step <= quarter * (1 + 1e-12)
    assert steps == MOST_STEPS_BETWEEN_REBUILDS or (steps + 1) * step > quarter * (1 - 1e-12)


@pytest.mark.parametrize("speed", [None, 0.0, math.nan])
def test_where_no_speed_is_known_the_list_is_rebuilt_after_the_most_steps(speed):
    assert schedule.steps_within_skin(speed, 1.0, 0.1) == MOST_STEPS_BETWEEN_REBUILDS


def test_a_column_as_high_as_the_box_is_borne():
    heavy = unit_spheres(gravity=2.0, fluid_density=0.0, viscosity=0.0)
    load = float(particle.net_weight(heavy)) * 40.0 / 2.0
    overlap = float(time_scales.expected_overlap(heavy, load, 0.0))
    expected = float(time_scales.largest_stable_step(heavy, overlap, time_scales.CLOSE_PACKED))
    for gravity in (2.0, -2.0):
        pulled = heavy.replace(gravity=np.float64(gravity))
        assert schedule.largest_stable_step(pulled, BOX, 2.0, 0.0) == near(expected)


def test_the_first_step_into_a_contact_may_go_deeper_than_its_impact():
    """Where drag allows steps in which a free particle goes further than an impact does."""
    damped = unit_spheres(viscosity=100.0)
    speed = 0.05
    overlap = float(time_scales.expected_overlap(damped, 0.0, 2.0 * speed))
    limit = partial(time_scales.largest_stable_step, damped, arrangement=time_scales.CLOSE_PACKED)
    step = float(limit(overlap))
    deeper = 2.0 * speed * step
    assert deeper > 10.0 * overlap
    assert schedule.largest_stable_step(damped, BOX, 2.0, speed) == near(float(limit(deeper)))
    assert float(limit(deeper)) < 0.5 * step


def test_what_is_traced_has_no_bound():
    assert schedule.largest_stable_step(unit_spheres(), BOX, 2.0, None) is None
