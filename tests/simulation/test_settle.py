"""Runs to rest: what a bed is at rest, what its curve may depend on, ensembles, and refusals."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.laws import particle
from tests.builders.beds import OVERLAP, WALLED, dispersed, soft
from tests.builders.particles import light_balls, unit_spheres

near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
REST, FRAMES = 1e-3, 100
PERIODIC = mrjax.Box((10e-6, 10e-6, 20e-6), (True, True, False))


@pytest.fixture(scope="module")
def walled(case2):
    """Twenty particles with friction between walls: parameters, starts, and all of their runs."""
    parameters = soft(case2, WALLED)
    states = [dispersed(case2, WALLED, seed) for seed in (0, 1, 2)]
    return parameters, states, mrjax.settle(states, parameters, WALLED, frames=FRAMES)


@pytest.fixture(scope="module")
def first(walled):
    """The first of them by itself."""
    parameters, states, _ = walled
    return mrjax.settle(states[0], parameters, WALLED, frames=FRAMES)


@pytest.fixture(scope="module")
def smooth(case2):
    """The same without friction and with periodic sides."""
    parameters = soft(case2, PERIODIC, friction=0.0)
    state = dispersed(case2, PERIODIC, 0)
    return parameters, state, mrjax.settle(state, parameters, PERIODIC, frames=FRAMES)


def test_a_bed_rests(walled, first, smooth):
    for run, parameters in ((first, walled[0]), (smooth[2], smooth[0])):
        falling = float(mrjax.terminal_velocity(parameters))
        speed = np.asarray(run.mean_speed)
        greatest = np.minimum(falling, speed.max())
        assert (speed[-3:] < REST * greatest).all()
        # It ends within ten frames of when it first had been so slow for three.
        slow = speed < REST * greatest
        assert not (slow[1:-12] & slow[2:-11] & slow[3:-10])[10::10].any()
        assert speed.max() <= falling * (1 + 1e-9)
        assert len(run.times) == len(run.heights) == len(run.mean_velocity) == len(speed)
        assert (len(run.times) - 1) % 10 == 0
        # Times of the frames: equal, and those of the steps taken.
        np.testing.assert_allclose(np.diff(run.times), run.times[1], rtol=1e-9)
        assert run.steps * run.time_step == near(float(run.times[-1]), rel=1e-9)


def test_the_mudline_only_sinks(first):
    """Up to what particles below may lift the highest by: 1e-4 of the box."""
    assert float(jnp.diff(first.mudline).max()) < 1e-4 * WALLED.height
    # It has come down by more than that.
    assert first.mudline[0] == near(20e-6, rel=1e-3)
    assert first.mudline[-1] < 0.95 * first.mudline[0]


def test_the_first_slope_is_the_terminal_velocity(walled, first, smooth):
    """Of the highest particle before it meets another; half of a step is lost at the start."""
    for run, parameters in ((first, walled[0]), (smooth[2], smooth[0])):
        falling = float(mrjax.terminal_velocity(parameters))
        slope = (run.mudline[1] - run.mudline[4]) / (run.times[4] - run.times[1])
        assert float(slope) == near(falling, rel=1e-9)
        lost = float(run.times[1] * falling - (run.mudline[0] - run.mudline[1]))
        assert lost == near(0.5 * run.time_step * falling, rel=1e-6)
        assert float(mrjax.asymptotes(run).initial_slope) == near(falling, rel=0.25)


def test_the_bed_is_as_soft_as_asked(walled, smooth):
    """`softened` foresees the deepest of some fifty random contacts, within a factor of 1.6.

    The deepest of the ensemble: where walls hold a bed by friction, 5 radii apart, one in three
    has hardly more than half of it.
    """
    for run in (walled[2], smooth[2]):
        deepest = np.asarray(run.deepest_overlap)
        assert OVERLAP / 1.6 < deepest.max() < OVERLAP * 1.6
        assert deepest.min() > OVERLAP / 2.5


def test_a_bed_at_rest_carries_its_weight(walled, first, smooth):
    """Contact forces add up to the weight of each particle, but for what still moves."""
    for run, parameters in ((first, walled[0]), (smooth[2], smooth[0])):
        force, _ = mrjax.contact_forces(run.state, parameters, run.box)
        weight = float(mrjax.laws.particle.net_weight(parameters))
        lift = np.asarray(force)[:, 2] / weight
        assert lift.mean() == near(1.0, abs=REST)  # drag bears what is not borne: 1e-3 of it
        assert np.abs(lift - 1.0).max() < 20 * REST


def test_a_list_of_another_skin_and_interval_gives_the_same_curve(walled, first):
    """As many steps of one length; only the order of sums differs, 1e-16, and grows in a bed."""
    parameters, states, _ = walled
    in_frame = first.steps // (len(first.times) - 1)
    assert in_frame % 6 == 0  # so that no step is added to fill the intervals
    again = mrjax.settle(
        states[0],
        parameters,
        WALLED,
        frames=FRAMES,
        time_step=first.time_step * (1 + 1e-9),
        skin=0.1,
        rebuild_every=in_frame // 6,
    )
    assert again.steps == first.steps
    np.testing.assert_allclose(again.heights, first.heights, rtol=0, atol=1e-6 * WALLED.height)


def test_twice_the_viscosity_takes_twice_as_long_and_gives_the_same_bed(smooth):
    """Exactly: moduli do not depend on it, frames and steps double, inertia is e^(-1e6).

    Powers of two are exact, so that nothing differs but what a compiler makes of other constants.
    """
    parameters, state, run = smooth
    thick = parameters.replace(viscosity=2.0 * parameters.viscosity)
    slow = mrjax.settle(state, thick, PERIODIC, frames=FRAMES)
    assert slow.steps == run.steps
    np.testing.assert_allclose(slow.times, 2.0 * run.times, rtol=1e-9)
    np.testing.assert_allclose(slow.heights, run.heights, rtol=1e-9)
    np.testing.assert_allclose(
        2.0 * slow.mean_velocity, run.mean_velocity, rtol=1e-9, atol=1e-9 * run.mean_speed.max()
    )


def test_an_ensemble_is_its_single_runs_with_the_early_ones_padded(walled):
    parameters, states, whole = walled
    lengths = []
    for index, state in enumerate(states):
        run = mrjax.settle(state, parameters, WALLED, frames=FRAMES)
        frames = len(run.times)
        lengths.append(frames)
        for name in ("heights", "mean_velocity", "mean_speed"):
            of_whole, of_run = (np.asarray(getattr(of, name)) for of in (whole, run))
            np.testing.assert_array_equal(of_whole[index, :frames], of_run)
            last = np.broadcast_to(of_run[-1], of_whole[index, frames:].shape)
            np.testing.assert_array_equal(of_whole[index, frames:], last)
        np.testing.assert_array_equal(whole.times[index, :frames], run.times)
        for name in ("position", "velocity", "spin"):
            np.testing.assert_array_equal(
                getattr(whole.state, name)[index], getattr(run.state, name)
            )
        assert whole.deepest_overlap[index] == run.deepest_overlap
    assert whole.heights.shape == (3, max(lengths), 20)
    assert min(lengths) < max(lengths)  # one was padded
    assert whole.mudline.shape == (3, max(lengths))


def test_a_plain_run_of_its_duration_frames_and_step_is_the_same_curve(walled, first):
    """As promised for gradients; parts hand over contacts in SI units, with a rounding each."""
    (parameters, states, _), run = walled, first
    frames = len(run.times) - 1
    plain = mrjax.simulate(
        states[0],
        parameters,
        WALLED,
        duration=float(run.times[-1]),
        frames=frames,
        time_step=run.time_step,
        skin=0.05,  # as `settle` has it: the list is rebuilt as often, and the steps are the same
    )
    assert plain.steps == run.steps
    np.testing.assert_allclose(plain.times, run.times, rtol=1e-12)
    np.testing.assert_allclose(plain.heights, run.heights, rtol=0, atol=1e-6 * WALLED.height)


def test_coordination_number_is_what_overlaps(walled, first, smooth):
    for run, parameters in ((first, walled[0]), (smooth[2], smooth[0])):
        position, size = np.asarray(run.state.position), np.array(run.box.size)
        apart = position[:, None, :] - position[None, :, :]
        sides = np.array(run.box.periodic)
        apart = np.where(sides, apart - size * np.round(apart / size), apart)
        touching = np.linalg.norm(apart, axis=-1) < 4e-6
        np.fill_diagonal(touching, False)
        count = mrjax.coordination_number(run.state, parameters, run.box)
        np.testing.assert_array_equal(count, touching.sum(axis=1))
        assert 2.0 < count.mean() < 6.5  # a bed; walls and the floor are not counted
        # Sides that are crossed count.
        assert (
            run.box is WALLED
            or (touching & (np.abs(position[:, None] - position[None]) > 5e-6).any(axis=-1)).any()
        )


def test_a_bed_that_does_not_come_to_rest_in_time_is_refused(walled):
    parameters, states, whole = walled
    short = 0.2 * float(whole.times.max())
    with pytest.raises(mrjax.SimulationError, match=r"after .* s the particles still move") as late:
        mrjax.settle(states[0], parameters, WALLED, frames=FRAMES, longest=short)
    assert "give a larger `longest` or `rest`" in str(late.value)
    # With a rest that asks for less it is in time.
    bold = mrjax.settle(states[0], parameters, WALLED, frames=FRAMES, longest=short, rest=0.9)
    assert float(bold.times[-1]) <= short * 1.5
    assert (bold.mean_speed[-3:] < 0.9 * mrjax.terminal_velocity(parameters)).all()


def test_a_step_that_is_too_long_is_shortened_until_the_bed_is_stable(walled, first):
    """0.7 times as long, again and again, with all that had been followed done anew."""
    parameters, states, _ = walled
    long = first.time_step / 0.7**1.5
    again = mrjax.settle(states[0], parameters, WALLED, frames=FRAMES, time_step=long)
    shorter = np.log(again.time_step / long) / np.log(0.7)
    assert 0.9 < shorter < 3.2  # rounded down to fill the frames, each time
    assert again.steps * again.time_step == near(float(again.times[-1]), rel=1e-9)
    assert (again.mean_speed[-3:] < REST * mrjax.terminal_velocity(parameters)).all()
    assert float(again.mudline[-1]) == near(float(first.mudline[-1]), rel=0.02)


def test_a_particle_that_turns_does_not_rest():
    """Thrown upwards, it stands still as the tenth frame is taken: three in a row must be slow."""
    box = mrjax.Box((10.0, 10.0, 40.0))
    parameters = unit_spheres(gravity=1.0, viscosity=1e-3, restitution=0.1, elastic_modulus=1e4)
    # The duration that is expected: of a fall from the top, at 31, onto what it fills itself.
    fall = np.sqrt(2.0 * (31.0 - 4 / 3 * np.pi / (0.64 * 100.0)))
    state = mrjax.place([[5.0, 5.0, 30.0]], [[0.0, 0.0, 0.1 * fall]])
    run = mrjax.settle(state, parameters, box, frames=100, rest=0.02)
    assert float(run.times[10]) == near(0.1 * fall, rel=1e-6)
    speed = np.asarray(run.mean_speed)
    assert speed[10] < 0.02 * speed[:11].max() < speed[9]
    assert len(speed) > 100 and float(run.mudline[-1]) < 2.5  # on the floor


SOFT = dict(elastic_modulus=1e3, wall_elastic_modulus=1e3)  # what is not refused ends soon
ONE, TWO = ([[5e-6, 5e-6, 15e-6]], [[5e-6, 5e-6, 15e-6], [5e-6, 5e-6, 8e-6]])


@pytest.mark.parametrize(
    "change, places, keywords, words",
    [
        (dict(gravity=0.0), [ONE], {}, "nothing pulls the particles down"),
        (dict(particle_density=950.0), [ONE], {}, "nothing pulls the particles down"),
        (SOFT, [ONE, TWO], dict(longest=1e-9), "states differ in their number of particles"),
        ({}, [], {}, "or there are none"),
        ({}, [ONE], dict(rest=0.0), "rest = 0.0"),
        ({}, [ONE], dict(frames=0), "frames = 0"),
        ({}, [ONE], dict(longest=-1.0), "longest = -1.0"),
    ],
)
def test_what_cannot_settle_is_refused(case2, change, places, keywords, words):
    parameters = case2.parameters().replace(**{k: jnp.asarray(v) for k, v in change.items()})
    with pytest.raises(mrjax.InputError, match=words):
        mrjax.settle([mrjax.place(of) for of in places], parameters, WALLED, **keywords)


@pytest.mark.parametrize("leaf", ["viscosity", "radius", "gravity"])
def test_traced_parameters_are_refused(case2, leaf):
    parameters, state = case2.parameters(), mrjax.place(ONE, contact_diameter=4e-6)

    @jax.jit
    def of(value):
        return mrjax.settle(state, parameters.replace(**{leaf: value}), WALLED).heights

    with pytest.raises(mrjax.InputError, match="traced by jit or vmap"):
        of(getattr(parameters, leaf))


def test_a_suspension_in_brownian_motion_ends_at_its_equilibrium():
    # A weight of 30 k T / R: the bed thins within a thirtieth of a radius.
    radius = 1e-7
    water = light_balls(temperature=300.0, radius=radius, gravity=1.0, viscosity=1e-2).astype(float)
    weight = 30.0 * 1.380649e-23 * 300.0 / radius
    heavy = water.replace(gravity=weight / float(particle.net_weight(water)))
    box = mrjax.Box((4e-7, 4e-7, 20 * radius))
    layers = np.arange(8)[:, None] * 2.1 * radius + 1.5 * radius
    places = np.array([[1e-7, 1e-7], [3e-7, 3e-7]]) + 0.01 * radius
    start = [[x, y, z + i * radius / 4] for i, (x, y) in enumerate(places) for (z,) in layers]
    soft = mrjax.softened(heavy, box, len(start), 0.025)
    run = mrjax.settle(mrjax.place(start, seed=5), soft, box, frames=40)
    # Its particles never rest: their mean speed stays far above 1e-3 of that of their fall.
    assert run.mean_speed[-1] > float(mrjax.terminal_velocity(heavy))
    # They have sunk, by the height of the start less that of any packing, and are not squeezed.
    assert jnp.mean(run.heights[-1]) < 0.75 * jnp.mean(run.heights[0])
    assert run.deepest_overlap < 0.06
