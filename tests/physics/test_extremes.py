"""Every public call, one argument after the other replaced by what it cannot be: one line, no more.

Numbers of 1e300 and 1e-300, none, not finite, of another kind or shape; arguments swapped. What is
refused is an `InputError` in one line; what is accepted ends with finite numbers.
"""

import dataclasses
import warnings

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core import checks
from tests.builders.particles import light_balls

BOX = mrjax.Box((2e-5,) * 3)
PARAMETERS = light_balls()
START = mrjax.place([[1e-5] * 3, [5e-6] * 3])
TABLE = np.ones((3, 2))
EXTREMES = [1e300, 1e-300, -1e300, -1, 0, float("nan"), float("inf"), 10**400]
OTHERS = ["1", None, {}, object(), TABLE, [1, [2, 3]], mrjax.Parameters, START, PARAMETERS, BOX]
SHORT = dict(duration=1e-7, time_step=1e-8)


@pytest.fixture(scope="module")
def run():
    return mrjax.simulate(START, PARAMETERS, BOX, frames=2, **SHORT)


def refused(call) -> bool:
    """Whether a call is refused in one line; else it has to end with finite numbers."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = call()
    except (mrjax.InputError, mrjax.SimulationError) as error:
        line = str(error)
        assert line.isprintable() and 0 < len(line) <= 400
        return True
    for leaf in jax.tree.leaves(found):
        if np.asarray(leaf).dtype.kind == "f":
            assert np.isfinite(leaf).all()
    return False


def tube(**changes):
    given = dict(height=0.1, volume_fraction=0.1, bed_fraction=0.6, times=[10.0, 20.0], cells=20)
    return mrjax.column_steps(**(dict(parameters=PARAMETERS) | given | changes))


CALLS = {
    "simulate": (
        lambda **k: mrjax.simulate(START, PARAMETERS, BOX, **(SHORT | k)),
        ["duration", "time_step", "skin"],
        ["frames", "rebuild_every", "capacity", "cell_capacity"],
    ),
    "follow": (
        lambda **k: mrjax.follow(START, PARAMETERS, BOX, **(SHORT | k)),
        ["duration", "time_step", "skin"],
        ["frames", "rebuild_every"],
    ),
    "settle": (
        lambda **k: mrjax.settle(START, PARAMETERS, BOX, **(dict(longest=1e-9) | k)),
        ["rest", "longest", "time_step", "skin"],
        ["frames", "rebuild_every"],
    ),
    "softened": (
        lambda **k: mrjax.softened(PARAMETERS, BOX, **(dict(particles=2, overlap=0.02) | k)),
        ["overlap"],
        ["particles"],
    ),
    "column": (
        tube,
        ["height", "volume_fraction", "bed_fraction"],
        ["cells"],
    ),
}


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        pytest.param(call, argument, id=f"{name}-{argument}")
        for name, (call, numbers, counts) in CALLS.items()
        for argument in (*numbers, *counts)
    ],
)
@pytest.mark.parametrize("value", [1e300, 1e-300, -1, 0, float("nan"), float("inf"), 10**400])
def test_an_extreme_number_is_refused(call, argument, value):
    assert refused(lambda: call(**{argument: value}))


@pytest.mark.parametrize("value", ["1", {}, object(), TABLE, [1, [2, 3]], START, PARAMETERS, BOX])
def test_what_is_no_number_is_refused(value):
    for call, numbers, counts in CALLS.values():
        for argument in (*numbers, *counts):
            assert refused(lambda call=call, argument=argument: call(**{argument: value}))


def test_more_steps_than_can_be_counted_are_refused():
    for duration, step in ((1e10, 1e-25), (1e30, 1e-30), (1.0, 1e-12)):
        with pytest.raises(mrjax.InputError, match=r"takes .* steps of .*, more than"):
            mrjax.simulate(START, PARAMETERS, BOX, duration=duration, time_step=step)


@pytest.mark.parametrize("leaf", [one.name for one in dataclasses.fields(mrjax.Parameters)])
def test_a_leaf_is_refused_or_gives_finite_forces(leaf):
    """Contacts of a pair that touches, which read every leaf but those of the drag."""
    touching = mrjax.place([[1e-5] * 3, [1e-5, 1e-5, 1.399e-5]])
    for value in (*EXTREMES, "1", None, {}, [1.0, 2.0], TABLE, jnp.ones(5), START):
        parameters = PARAMETERS.replace(**{leaf: value})
        if refused(lambda: checks.refuse_bad_parameters(parameters, 2, None)):  # noqa: B023
            assert refused(lambda: mrjax.contact_forces(touching, parameters, BOX))  # noqa: B023
            assert refused(lambda: mrjax.simulate(touching, parameters, BOX, duration=1e-9))  # noqa: B023


@pytest.mark.parametrize("value", [1e300, 1e-300, -1.0, 0.0, float("nan"), float("inf"), "1", None])
def test_a_box_of_other_lengths_is_refused(value):
    assert refused(lambda: mrjax.Box((1e-5, 1e-5, value)))
    assert refused(lambda: mrjax.Box(value))
    assert refused(lambda: mrjax.Box((1e-5,) * 3, (True, False, value)))


@pytest.mark.parametrize("argument", ["positions", "velocities", "spins"])
def test_particles_that_are_none_are_refused(argument):
    for value in ("1", {}, object(), [1, [2, 3]], [[10**400] * 3] * 2, 3.0, START, np.ones((2, 2))):
        given = {"positions": [[1e-5] * 3, [5e-6] * 3], argument: value}
        assert refused(lambda: mrjax.place(**given))  # noqa: B023
    far = [[1e300, 0.0, 0.0], [0.0, 0.0, 0.0]]
    state = mrjax.place(**({"positions": [[1e-5] * 3, [5e-6] * 3]} | {argument: far}))
    assert refused(lambda: mrjax.simulate(state, PARAMETERS, BOX, **SHORT))


@pytest.mark.parametrize("value", [1e300, 1e-300, -1, 0, float("nan"), "1", [1], TABLE])
def test_other_arguments_of_place_are_refused(value):
    for argument in ("contact_diameter", "materials", "dtype"):
        assert refused(lambda argument=argument: mrjax.place([[1e-5] * 3] * 2, **{argument: value}))


@pytest.mark.parametrize(
    "times", [[], [0.0], [2.0, 1.0], ["1"], "1", [1, [2]], [1e300], [1e-300], {}]
)
def test_times_of_a_column_are_refused(times):
    assert refused(lambda: tube(times=times))


@pytest.mark.parametrize("value", [1e300, -1, 0, float("nan"), float("inf"), "1", None, [1], BOX])
def test_what_is_read_off_a_run_is_refused(run, value):
    for call in (
        lambda: mrjax.HEIGHTS["mean-of-top"](run, value),
        lambda: mrjax.HEIGHTS["mass-quantile"](run, value),
        lambda: mrjax.sedimentation_ratio(run, value),
        lambda: mrjax.concentration(run, [1e-5], value if value != 1e300 else -1.0),
    ):
        assert refused(call)


OF_MOMENT = [mrjax.contact_forces, mrjax.coordination_number, mrjax.normal_forces]
OF_RUN = [
    *(mrjax.asymptotes, mrjax.bed_front, mrjax.concentration, mrjax.mudline_descent),
    *(mrjax.sedimentation_ratio, mrjax.settling_velocity, *mrjax.HEIGHTS.values()),
]


def test_swapped_arguments_are_refused():
    """A recipe for parameters, a tuple for a box, an array for a state, and any other order."""
    recipe = mrjax.Recipe.load("case2")
    right = START, PARAMETERS, BOX
    wrong = [recipe, (2e-5,) * 3, START.position, "case2", None, 3.0, mrjax.Box]
    for place in range(3):
        others = [*wrong, *(one for one in right if one is not right[place])]
        for other in others:
            given = [*right[:place], other, *right[place + 1 :]]
            for call in OF_MOMENT:
                assert refused(lambda call=call, given=given: call(*given))
            for call in (mrjax.simulate, mrjax.follow):
                assert refused(lambda call=call, given=given: call(*given, **SHORT))
            assert refused(lambda given=given: mrjax.settle(*given))
    for other in (START, PARAMETERS, (1, 2, 3), "run", None, np.ones(3), mrjax.Run):
        for call in OF_RUN:
            extra = {mrjax.bed_front: [0.6], mrjax.concentration: [[1e-5], 1e-6]}.get(call, [])
            assert refused(lambda call=call, extra=extra, other=other: call(other, *extra))
        if other is not PARAMETERS:
            assert refused(lambda other=other: mrjax.terminal_velocity(other))
            assert refused(lambda other=other: mrjax.time_step(other))
            assert refused(lambda other=other: mrjax.reynolds_number(1.0, other))
            assert refused(lambda other=other: mrjax.softened(other, BOX, 2, 0.02))
            assert refused(lambda other=other: tube(parameters=other))
        assert refused(lambda other=other: mrjax.disperse(other))
        assert refused(lambda other=other: mrjax.sedimentation(other))
    assert refused(lambda: mrjax.softened(PARAMETERS, (1, 2, 3), 2, 0.02))


@pytest.mark.parametrize("seeds", [[0, 0], (3, 1, 2, 1), [], np.array([1, 1])])
def test_the_same_seed_twice_is_refused(seeds):
    assert refused(lambda: mrjax.sedimentation(mrjax.Recipe.load("case2"), seeds))


@pytest.mark.parametrize("value", [3.0, "son2018", [1.0], BOX])
def test_a_hindrance_that_is_no_function_is_refused(value):
    for call in (mrjax.simulate, mrjax.follow):
        assert refused(lambda call=call: call(START, PARAMETERS, BOX, hindrance=value, **SHORT))
    assert refused(lambda: mrjax.settle(START, PARAMETERS, BOX, hindrance=value))
    assert refused(lambda: tube(hindrance=value))
