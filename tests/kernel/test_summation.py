"""Laws summed over pairs: the compiled loop and its derivatives against gathers and scatters."""

import os
import re
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir, partial_eval

import mrjax
from mrjax.dem import engine, neighbours, pairs, scan
from mrjax.dem.forces import ActiveLaws
from mrjax.dem.pair_forces import contact_law
from mrjax.dem.pairs import Pairs
from mrjax.kernel import arrays, pair_sum, primitive, summation
from mrjax.kernel.llvm import codegen
from tests.builders import ROOT
from tests.builders.particles import unit_spheres

BOTH = ("float64", "float32")


@contextmanager
def standing_in(other, with_change=None):
    """Every loop that is met meanwhile goes to another primitive, also beside its change."""
    kept = primitive.pair_sum_p, primitive.with_change_p
    summation.pair_sum_p = primitive.pair_sum_p = other
    primitive.with_change_p = with_change
    try:
        yield
    finally:
        primitive.pair_sum_p, primitive.with_change_p = kept
        summation.pair_sum_p = primitive.pair_sum_p


class Arrays:
    """Gathers and scatters in place of a loop, with the derivatives that JAX gives them."""

    @staticmethod
    def bind(*operands, loop):
        return arrays.evaluate_with_arrays(loop, *operands)


def by_arrays(function):
    """The same function without loops: its derivatives owe nothing to those of a loop."""

    def evaluated(*arguments):
        with standing_in(Arrays):
            return function(*arguments)

    return evaluated


def not_compiled(name, shapes, by_arrays, jvp, batched) -> Primitive:
    """An operation of gathers and scatters on every platform."""
    made = Primitive(name)
    made.multiple_results = True
    made.def_abstract_eval(shapes)
    ad.primitive_jvps[made] = jvp
    batching.primitive_batchers[made] = batched
    mlir.register_lowering(made, mlir.lower_fun(by_arrays, multiple_results=True))
    return made


elsewhere = not_compiled(
    "pair_sum_elsewhere", primitive._shapes, Arrays.bind, primitive._jvp, primitive._batched
)
ad.primitive_transposes[elsewhere] = primitive._transpose
both_elsewhere = not_compiled(
    "both_elsewhere",
    primitive._both_shapes,
    primitive._both_in_arrays,
    primitive._both_jvp,
    primitive._both_batched,
)
partial_eval.custom_partial_eval_rules[both_elsewhere] = primitive._both_split


def on_another_processor(function):
    """The same function, a derivative maybe, with the loops it has, but none of them compiled."""

    def evaluated(*arguments):
        with standing_in(elsewhere, both_elsewhere):
            return jax.jit(lambda *of: function(*of))(*arguments)

    return evaluated


def check(found, expected, roundings=1000):
    """Compares trees of arrays, to roundings of the largest number of each.

    Both do the same operations, but contract some, and add what a particle gets in another order.
    Differences that cancel, as an overlap of 0.02 between spheres of radius 1, and the quotients
    of derivatives make ten to a hundred of one rounding.
    """
    found, expected = jax.tree.leaves(found), jax.tree.leaves(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.shape == other.shape and one.dtype == other.dtype
        assert np.isfinite(other).all()
        allowed = roundings * np.finfo(other.dtype).eps * np.abs(other).max(initial=0.0)
        np.testing.assert_allclose(one, other, rtol=0, atol=allowed)


def made(first, second, separation, particles: int, room: int) -> Pairs:
    """A list by hand, the rest of its places filled with what must not be read as pairs."""
    spare = room - len(first)
    assert spare >= 0
    return Pairs(
        jnp.asarray([*first, *[0] * spare], jnp.int32),
        jnp.asarray([*second, *[1] * spare], jnp.int32),
        jnp.arange(room) < len(first),
        jnp.asarray([*second, *[1] * spare]) >= particles,
        tuple(jnp.pad(part, (0, spare), constant_values=0.1) for part in jnp.asarray(separation).T),
        jnp.zeros((1, particles), jnp.int32),
        jnp.zeros((), jnp.int32),
    )


def ends(listed: Pairs) -> tuple:
    """What the sum is told of a list: ids of both ends and the number of pairs."""
    return listed.first, listed.second, listed.count


# --- the law of contacts --------------------------------------------------------------------------

PARTICLES = 5
ROUGH = mrjax.Parameters(
    radius=1.0,
    particle_density=0.3,
    fluid_density=0.1,
    viscosity=0.1,
    gravity=0.5,
    elastic_modulus=30.0,
    poisson_ratio=0.3,
    friction=0.4,
    rolling_friction=0.1,
    rolling_damping=0.3,
    restitution=0.6,
    dissipation=0.02,
    tangential_dissipation=0.03,
)
ALL = ActiveLaws(sliding=True, rolling=True, damped=True)
EVERY_LAW = [
    ActiveLaws(sliding, rolling, damped)
    for sliding in (False, True)
    for rolling in (False, True)
    for damped in (False, True)
]


def meeting(touches, laws=ALL, dtype="float64", seed=0, spare=3, mixed=False):
    """Pairs that touch or not, as told, each by 0.02 to 0.1, and their motion.

    Few particles, each in many pairs, every third of them with a wall.

    Returns:
      The law, of a list, what moves and the parameters; and these.
    """
    random = np.random.default_rng(seed)
    parameters = ROUGH.astype(dtype)
    if mixed:
        table = random.uniform(0.2, 0.6, (3, 3))
        table = jnp.asarray(table + table.T, dtype) / 2
        radius = jnp.asarray(random.uniform(0.7, 1.0, PARTICLES), dtype)
        parameters = parameters.replace(radius=radius, friction=table, restitution=table)
    radius = np.broadcast_to(np.asarray(parameters.radius, float), PARTICLES)
    first, second, separation = [], [], np.zeros((len(touches), 3))
    for number, touching in enumerate(touches):
        one, other = random.choice(PARTICLES, 2, replace=False)
        gap = random.uniform(0.02, 0.1) * (-1 if touching else 1)
        if number % 3 == 2:
            axis, end = random.integers(3), random.integers(2)
            other = PARTICLES + 2 * axis + end
            separation[number, axis] = (radius[one] + gap) * (1 - 2 * end)
        else:
            vector = random.normal(size=3)
            vector *= (radius[one] + radius[other] + gap) / np.linalg.norm(vector)
            separation[number] = vector
        first.append(one)
        second.append(other)
    room = len(touches) + spare
    listed = made(first, second, np.asarray(separation, dtype), PARTICLES, room)

    def array(size: float, *shape: int):
        return jnp.asarray(size * random.uniform(-1.0, 1.0, shape), dtype)

    acting = {"sliding": laws.sliding, "rolling": laws.rolling}
    memory = {name: array(0.02, 3, room) for name, acts in acting.items() if acts}
    of_each = 3, PARTICLES
    # What has been travelled makes no gap an overlap, and no overlap one less deep than any before:
    # 0.02 > 2 sqrt(3) 0.005 + 0.002.
    before = jnp.abs(array(0.002, room))
    gains = 1.5 + (array(0.5, 2, PARTICLES) if mixed else array(0.5, 2))
    moving = (
        array(0.005, *of_each),
        array(1.0, *of_each),
        array(1.0, *of_each),
        memory,
        before,
        gains,
    )
    return law_of(laws, mixed), listed, moving, parameters


@cache
def law_of(laws, mixed):
    material = jnp.array([0, 1, 0, 1, 1], jnp.int32) if mixed else None

    def loads(listed, moving, parameters):
        law = contact_law(parameters, laws=laws, material=material, time_step=0.01)
        return law(listed)(*moving)

    return loads


@cache
def both_ways(function):
    """Compiled."""
    return jax.jit(function), jax.jit(by_arrays(function))


def compare(case):
    """What a case gives, as it gives it by gathers and scatters too."""
    function, *given = case
    compiled, arrays = both_ways(function)
    found, expected = compiled(*given), arrays(*given)
    check(found, expected)
    return found


@pytest.mark.parametrize(
    "laws, mixed, dtype",
    [
        *((laws, False, "float64") for laws in EVERY_LAW),
        *((ALL, mixed, dtype) for mixed, dtype in [(True, "float64"), (False, "float32")]),
        (ALL, True, "float32"),
        (EVERY_LAW[0], True, "float32"),
    ],
    ids=str,
)
def test_contacts_are_what_gathers_and_scatters_give(laws, mixed, dtype):
    touches = np.random.default_rng(1).uniform(size=40) < 0.6
    case = meeting(touches, laws, dtype, seed=2, mixed=mixed)
    found = compare(case)
    assert np.abs(found.force).max() > 0.1
    *_, before, _ = case[2]
    np.testing.assert_array_equal((found.deepest > before)[:40], touches)
    assert found.torque.any() == (laws.sliding or laws.rolling)


MOST = 12
TAILS = [
    *([True] * k + [False] * 2 for k in (0, 1, 2, 3, 4, 5, 7, 8, 9, 10)),
    [False, True, False, False, True, True, False, True, True, False, True, True],
    [],
]


@pytest.mark.parametrize("dtype", BOTH)
@pytest.mark.parametrize("touches", TAILS, ids=lambda of: "".join(".x"[each] for each in of))
def test_any_number_of_pairs_that_touch(touches, dtype):
    """Vectors that are full, begun or empty; room for more pairs, or for none."""
    case = meeting(touches, dtype=dtype, seed=len(touches), spare=MOST - len(touches))
    found = compare(case)
    *_, memory, before, _ = case[2]
    np.testing.assert_array_equal(
        found.deepest != before, touches + [False] * (MOST - len(touches))
    )
    apart = ~np.array(touches, bool)
    for name in ("sliding", "rolling"):
        kept, had = found.history[name], memory[name]
        assert not kept[:, : len(touches)][:, apart].any()
        np.testing.assert_array_equal(kept[:, len(touches) :], had[:, len(touches) :])
    assert np.isfinite(found.force).all()


def test_what_pairs_add_to_the_same_particle_is_not_lost():
    """Nine pairs of the same two, so that all lanes of a vector add to the same place."""
    listed = made([0] * 9, [1] * 9, np.ones((9, 3)), 2, 9)

    def law(first, second, pair, *_):
        return [pair], [2.0 * pair], None

    value = jnp.arange(1.0, 10.0)
    (found,), _ = pair_sum(
        law, lambda *of: of[2] > 0.0, *ends(listed), particles=jnp.zeros(2), pairs=value
    )
    np.testing.assert_array_equal(found, [45.0, 90.0])


class Numbers(NamedTuple):
    """A tree of a law's own."""

    size: jax.Array
    way: jax.Array


def test_trees_in_and_out():
    """Dictionaries, named tuples, lists; a plain tuple is a vector."""
    listed = made([0, 1], [1, 2], np.ones((2, 3)), 3, 3)

    def law(particle, partner, pair, shared, memory):
        apart = tuple(a - b for a, b in zip(particle.way, partner.way, strict=True))
        force = tuple(shared["factor"] * pair["spring"] * a for a in apart)
        to_partner = {"force": tuple(-f for f in force), "count": 1.0}
        return {"force": force, "count": 1.0}, to_partner, [memory[0] + particle.size, apart]

    sums, (tally, apart) = pair_sum(
        law,
        lambda particle, partner, pair, shared, memory: pair["spring"] > 0.0,
        *ends(listed),
        particles=Numbers(jnp.arange(3.0), jnp.array([[0.0, 1.0, 3.0], [0.0, 0.0, 5.0]])),
        pairs={"spring": jnp.array([2.0, 3.0, 9.0])},
        shared={"factor": 10.0},
        memory=[jnp.array([7.0, 8.0, 9.0]), jnp.zeros((2, 3))],
    )
    np.testing.assert_array_equal(sums["force"], [[-20.0, -40.0, 60.0], [0.0, -150.0, 150.0]])
    np.testing.assert_array_equal(sums["count"], [1.0, 2.0, 1.0])
    np.testing.assert_array_equal(tally, [7.0, 9.0, 9.0])
    np.testing.assert_array_equal(apart, [[-1.0, -2.0, 0.0], [0.0, -5.0, 0.0]])


@pytest.mark.parametrize(
    "result, words",
    [
        (lambda x, m: (x, [x], m), "to its partner"),
        (lambda x, m: ((x, x), x, m), "to its partner"),
        (lambda x, m: (x, x, (m, m)), "new memory"),
        (lambda x, m: (x, x, None), "new memory"),
    ],
)
def test_a_law_whose_trees_do_not_fit_is_refused(result, words):
    listed = made([0], [1], np.ones((1, 3)), 2, 1)

    def law(particle, partner, pair, shared, memory):
        return result(particle, memory)

    with pytest.raises(ValueError, match=words):
        pair_sum(law, lambda *_: True, *ends(listed), particles=jnp.ones(2), memory=jnp.zeros(1))
    with pytest.raises(ValueError, match="one array"):
        pair_sum(law, lambda *_: True, *ends(listed), particles=None)


@pytest.mark.slow
def test_pairs_beyond_the_room_are_neither_read_nor_written():
    """More pairs than places: those that are listed count, and the flag is the list's."""
    box = mrjax.Box((10.0, 10.0, 10.0))
    position = jnp.asarray(np.random.default_rng(3).uniform(4.0, 6.0, (8, 3)))
    plan = neighbours.plan_list(box, 8, 2.0, 2.0, 0.2)
    found = neighbours.build(plan, box, position)
    radius = jnp.ones(8)

    def law(first, second, pair, shared, memory):
        return [1.0 + 0.0 * first], [1.0 + 0.0 * first], 1.0 + memory

    for room in (1, 3, 5, 28):
        listed = pairs.list_pairs(found, box, position.T, radius, jnp.asarray(10.0), room)
        assert int(listed.overflow) == (neighbours.PAIRS_DROPPED if room < 28 + 6 * 8 else 0)
        (met,), kept = pair_sum(
            law, lambda *of: of[4] == 0.0, *ends(listed), particles=radius, memory=jnp.zeros(room)
        )
        walls = int(jnp.sum(listed.second >= 8))
        assert met.sum() == 2 * room - walls
        np.testing.assert_array_equal(kept, np.ones(room))


# --- derivatives ----------------------------------------------------------------------------------

COUNT, PLACES = 6, 11
NAMES = ("place", "weight", "spring", "width", "both", "one", "tally")


def law_of_all_kinds():
    """Of arrays with and without rows, of particles, of pairs and of all; results likewise."""
    random = np.random.default_rng(4)
    first = random.integers(COUNT, size=9)
    second = np.where(np.arange(9) % 4 == 3, COUNT + 1, (first + random.integers(1, COUNT, 9)))
    second = np.where(second > COUNT + 1, second % COUNT, second)
    second = np.where((second >= COUNT) & (np.arange(9) % 4 != 3), second % COUNT, second)
    listed = made(first, second, np.ones((9, 3)), COUNT, PLACES)

    def law(mine, theirs, width, shared, memory):
        (x, m), (y, k), (spring, tally, _), (both, one) = mine, theirs, memory, shared
        apart = x[0] - y[0], x[1] - y[1]
        distance = jnp.sqrt(1.0 + apart[0] ** 2 + apart[1] ** 2)
        push = jnp.maximum(width, 0.1) * (m + 2.0 * k) * one / distance
        new = spring[0] + push * apart[1] * both[0], spring[1] * one - apart[0] * both[1]
        force = push * new[0], apart[1] / (1.0 + new[1] ** 2)
        counted = tally * one + 0.5 * push
        kept = [new, counted, push**2]
        return [force, m * k * one], [(-force[0], force[1] * both[1]), push], kept

    def touching(mine, theirs, *_):
        return (mine[0][0] - theirs[0][0]) < 0.8

    def results(place, weight, spring, width, both, one, tally):
        sums, kept = pair_sum(
            law,
            touching,
            *ends(listed),
            particles=[place, weight],
            pairs=width,
            memory=[spring, tally, jnp.zeros_like(tally)],
            shared=[both, one],
            lasting=[False, True, False],
        )
        return *sums, *kept

    return results


of_all_kinds = law_of_all_kinds()


def arguments(seed=5, dtype="float64", several=()):
    """Of the law, those named with a leading axis of so many."""
    random = np.random.default_rng(seed)
    shapes = (2, COUNT), (COUNT,), (2, PLACES), (PLACES,), (2,), (), (PLACES,)
    several = dict(several)
    return [
        jnp.asarray(random.uniform(0.2, 1.5, (*several.get(name, ()), *shape)), dtype)
        for name, shape in zip(NAMES, shapes, strict=True)
    ]


def scalar(*given):
    """One number of all results, in which each weighs differently."""
    found = of_all_kinds(*given)
    return sum(
        jnp.sum(of**2 * jnp.linspace(1.0, 2.0, of.size, dtype=of.dtype).reshape(of.shape))
        for of in found
    )


def compare_derivative(transform, function, *given, elsewhere=False, roundings=1000):
    """The derived loops against JAX's derivative of arrays; not compiled, too, if told."""
    expected = jax.jit(transform(by_arrays(function)))(*given)
    found = jax.jit(transform(function))(*given)
    check(found, expected, roundings)
    if elsewhere:
        check(on_another_processor(transform(function))(*given), expected)
    return found


EVERY = tuple(range(7))
SOME = [(0,), (2,), (5,), (6,), (2, 3), (1, 4), EVERY]


def along(which, several=()):
    """Forwards, with changes of some arguments."""

    def transform(function):
        def changed(given, changes):
            def of_some(*some):
                full = list(given)
                for index, value in zip(which, some, strict=True):
                    full[index] = value
                return function(*full)

            return jax.jvp(of_some, [given[i] for i in which], changes)

        return changed

    return transform


def named(which) -> str:
    return "-".join(NAMES[i] for i in which) if isinstance(which, tuple) else str(which)


@pytest.mark.parametrize(
    "which, dtype", [*((which, "float64") for which in SOME), (EVERY, "float32")], ids=named
)
def test_forwards(which, dtype):
    given, other = arguments(dtype=dtype), arguments(6, dtype=dtype)
    changes = [other[i] for i in which]
    _, found = compare_derivative(
        along(which), of_all_kinds, given, changes, elsewhere=which == EVERY
    )
    assert any(of.any() for of in found)


@pytest.mark.parametrize("which", SOME, ids=named)
def test_backwards(which):
    gradient = partial(jax.grad, argnums=which)
    found = compare_derivative(gradient, scalar, *arguments(), elsewhere=which == EVERY)
    assert all(of.any() for of in found)


def test_backwards_from_some_results():
    """What does not matter has no cotangent, and what no result moves has none to give."""
    for kept in [(0,), (1,), (2,), (3,), (1, 4)]:

        def some(*given, kept=kept):
            found = of_all_kinds(*given)
            return sum(jnp.sum(jnp.sin(found[i])) for i in kept)

        compare_derivative(partial(jax.grad, argnums=EVERY), some, *arguments())


def test_central_differences():
    given, other = arguments(), arguments(7)
    step = 1e-5

    def beyond(by):
        return of_all_kinds(*(a + by * b for a, b in zip(given, other, strict=True)))

    _, found = jax.jvp(of_all_kinds, given, other)
    slope = [(a - b) / (2 * step) for a, b in zip(beyond(step), beyond(-step), strict=True)]
    for one, expected in zip(found, slope, strict=True):
        # Third derivatives of some hundreds times step^2, and 1e-16 of some tens over the step.
        np.testing.assert_allclose(one, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    gradient = jax.grad(scalar, argnums=EVERY)(*given)
    uphill = sum(jnp.sum(a * b) for a, b in zip(gradient, other, strict=True))
    ends = [
        scalar(*(a + by * b for a, b in zip(given, other, strict=True))) for by in (step, -step)
    ]
    np.testing.assert_allclose(uphill, (ends[0] - ends[1]) / (2 * step), rtol=1e-6)


@pytest.mark.parametrize(
    "directions, several",
    [*((number, ("place", "spring")) for number in (1, 2, 3, 4, 5, 9)), (3, ("place", "tally"))],
)
def test_many_directions_at_once(directions, several):
    """As many changes of some arguments; those of others are the same in all."""
    which, at = (0, 1, 2, 5, 6), {name: (directions,) for name in several}
    given, other = arguments(), arguments(8, several=at.items())

    def transform(function):
        each = along(which)(function)
        axes = [0 if NAMES[i] in several else None for i in which]
        return jax.vmap(each, in_axes=(None, axes))

    changes = [other[i] for i in which]
    compare_derivative(transform, of_all_kinds, given, changes, elsewhere=directions in (3, 5))


@pytest.mark.parametrize("matrix, number", [(jax.jacfwd, 4), (jax.jacfwd, 3), (jax.jacrev, 1)])
def test_the_whole_matrix_of_derivatives(matrix, number):
    """By columns, one direction for each number, and by rows."""
    compare_derivative(partial(matrix, argnums=number), of_all_kinds, *arguments())


@pytest.mark.parametrize("outer, inner", [(jax.jacfwd, jax.jacrev), (jax.jacrev, jax.jacfwd)])
def test_second_derivatives(outer, inner):
    def hessian(function):
        return outer(inner(function, argnums=(4, 5)), argnums=(4, 5))

    (a, b), (c, d) = compare_derivative(hessian, scalar, *arguments())
    check((a, b), (a.T, c), roundings=1e4)
    assert a.any() and b.any() and d.any()


@pytest.mark.parametrize(
    "batched, members",
    [(NAMES, 3), (NAMES, 6), (("place",), 1), (("weight", "one"), 3), (("spring",), 2)],
    ids=lambda of: "-".join(of) if isinstance(of, tuple) else str(of),
)
def test_several_at_once(batched, members):
    at = {name: (members,) for name in batched}
    given, axes = arguments(several=at.items()), [0 if name in at else None for name in NAMES]

    def gradients(function):
        def transformed(*given):
            slope = jax.grad(function, argnums=EVERY)
            return jax.vmap(slope, in_axes=axes)(*given)

        return transformed

    found = compare_derivative(gradients, scalar, *given)
    assert all(of.shape[0] == members for of in found)

    def gradient_of_all(function):
        return jax.grad(lambda *given: jnp.sum(jax.vmap(function, in_axes=axes)(*given)), (0, 2, 4))

    compare_derivative(gradient_of_all, scalar, *given)


def test_axes_that_are_not_the_first():
    given = arguments(several={name: (3,) for name in NAMES}.items())
    last = [jnp.moveaxis(of, 0, -1) for of in given]
    found = jax.jit(jax.vmap(of_all_kinds, in_axes=-1, out_axes=-1))(*last)
    expected = jax.jit(jax.vmap(of_all_kinds))(*given)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(jnp.moveaxis(one, -1, 0), other)


@pytest.mark.slow
def test_the_derivatives_of_contacts():
    """Forwards and backwards, in all that moves and in the parameters.

    Some of these are sums over contacts of what cancels but for a hundredth.
    """
    law, listed, moving, parameters = meeting([True] * 7 + [False] * 2, seed=9, mixed=True)
    ones = jax.tree.map(lambda leaf: jnp.ones_like(leaf) * 0.01, (moving, parameters))

    def loads(moving, parameters):
        return law(listed, moving, parameters)

    def forwards(function):
        return lambda moving, parameters: jax.jvp(function, (moving, parameters), ones)[1]

    compare_derivative(forwards, loads, moving, parameters, roundings=1e5)

    def backwards(function):
        return jax.grad(
            lambda *of: sum(jnp.sum(leaf**2) for leaf in jax.tree.leaves(function(*of))), (0, 1)
        )

    compare_derivative(backwards, loads, moving, parameters, roundings=1e5)


def test_what_a_change_does_not_read_is_not_kept_for_it():
    law, listed, (displacement, velocity, *more, deepest, gains), parameters = meeting([True] * 5)

    def loads(velocity):
        return law(listed, (displacement, velocity, *more, deepest, gains), parameters).force

    _, back = jax.vjp(loads, velocity)
    kept = [leaf for leaf in jax.tree.leaves(back) if leaf.shape == deepest.shape]
    assert any(np.array_equal(leaf, listed.first) for leaf in kept)
    assert not any(np.array_equal(leaf, deepest) for leaf in kept)


def test_long_vectors_are_kept_on_an_aligned_stack(monkeypatch):
    """A stack's alignment is left out by llvmlite where a function has no other attribute."""
    sources, compiled = [], codegen._compiled

    def noted(source):
        sources.append(source)
        return compiled(source)

    monkeypatch.setattr(codegen, "_compiled", noted)
    # A number of places that no other test has, so that it is compiled here.
    law, listed, (displacement, *more), parameters = meeting([True] * 5, spare=37)

    def size(displacement):
        return jnp.sum(law(listed, (displacement, *more), parameters).force ** 2)

    jax.jit(jax.grad(size))(displacement)
    wide = [source for source in sources if "<8 x double>" in source]
    assert wide
    for source in wide:
        defined = [line for line in source.splitlines() if line.startswith("define internal")]
        assert len(defined) == 2 and all("alignstack(64)" in line for line in defined)


def test_what_nothing_moves_has_no_derivative():
    """A scan that carries it carries no derivative of it, forwards; nor is it a loop backwards."""
    listed = made([0, 1, 2], [1, 2, 0], np.ones((3, 3)), 3, 4)

    def law(first, second, pair, shared, memory):
        return [first * pair], [second * pair], pair**2 + 0.0 * memory

    def followed(value):
        def step(carry, _):
            value, greatest = carry
            (value,), kept = pair_sum(
                law,
                lambda *of: of[2] > 1.0,
                *ends(listed),
                particles=value,
                pairs=jnp.arange(4.0),
                memory=jnp.zeros(4),
            )
            return (value, jnp.maximum(greatest, kept)), None

        return jax.lax.scan(step, (value, jnp.zeros(4)), length=3)[0]

    def moved(value):
        return jax.jvp(followed, (value,), (value,))

    value = jnp.arange(1.0, 4.0)
    (scan,) = (of for of in jax.make_jaxpr(moved)(value).jaxpr.eqns if of.primitive.name == "scan")
    assert scan.params["num_carry"] == 3  # value, its change, and greatest
    _, (change, nothing) = moved(value)
    assert change.any() and not nothing.any()
    backwards = jax.make_jaxpr(jax.grad(lambda value: jnp.sum(followed(value)[1])))(value)
    assert str(backwards).count("pair_sum") <= 1
    # With everything stopped there is no second loop at all.
    stopped = jax.make_jaxpr(
        lambda value: jax.jvp(lambda of: followed(jax.lax.stop_gradient(of)), (value,), (value,))
    )(value)
    assert str(stopped).count("pair_sum") == 1


# --- a loop beside its change ---------------------------------------------------------------------


def followed(wrapped=lambda step: step):
    """A number after three steps of a scan, each of them wrapped."""

    def after(place, weight):
        others = arguments()[2:]

        @wrapped
        def step(place, weight):
            force, *_ = of_all_kinds(place, weight, *others)
            return place + 0.1 * force * weight[None], jnp.cos(weight)

        def carried(carry, _):
            return step(*carry), None

        (place, weight), _ = jax.lax.scan(carried, (place, weight), length=3)
        return jnp.sum(place**2) + jnp.sum(weight)

    return after


def only_sometimes(step):
    def either(place, weight):
        return jax.lax.cond(jnp.sum(weight) > 0.0, step, lambda *of: of, place, weight)

    return either


WRAPPED = {
    "plain": followed(),
    "jit": followed(jax.jit),
    "checkpoint": followed(jax.checkpoint),
    "kept": followed(partial(jax.checkpoint, policy=jax.checkpoint_policies.everything_saveable)),
    "cond": followed(only_sometimes),
    # A new one each time: it remembers what it has traced, gathers and scatters too.
    "outside": lambda *given: jax.checkpoint(followed())(*given),
    "twice": lambda *given: jax.checkpoint(followed(jax.checkpoint))(*given),
}
BOTH_ARGUMENTS = (0, 1)


@pytest.mark.parametrize("name", WRAPPED)
def test_one_loop_forwards_and_two_backwards(name):
    """What is known and what is linear in changes fall apart wherever reverse mode meets them."""
    given = arguments()[:2]

    def along_both(function):
        return lambda *given: jax.jvp(function, given, given)

    def gradient(function):
        return jax.grad(function, BOTH_ARGUMENTS)

    def along_three(function):
        each = along(BOTH_ARGUMENTS)(function)
        changes = [jnp.stack([of, -of, 2.0 * of]) for of in given]
        return lambda *given: jax.vmap(each, (None, 0))(given, changes)

    for transform, loops in ((along_both, 1), (along_three, 1), (gradient, 2)):
        compare_derivative(transform, WRAPPED[name], *given)
        assert len(set(names_of_loops(transform(WRAPPED[name]), *given))) == loops
    backwards = str(jax.make_jaxpr(gradient(WRAPPED[name]))(*given))
    assert "pair_sum[" in backwards and "pair_sum_with_change" not in backwards


@pytest.mark.parametrize(
    "name",
    ["plain", *(pytest.param(name, marks=pytest.mark.slow) for name in ("checkpoint", "outside"))],
)
def test_derivatives_of_derivatives_in_a_scan(name):
    """Forwards over backwards, backwards over forwards, and both of several at once."""
    place, weight = arguments()[:2]

    def slope(function):
        return lambda *given: jax.jvp(function, given, given)[1]

    def changed(function):
        return slope(lambda *of: jnp.sum(jax.grad(function)(*of) ** 2))

    def of_changes(function):
        return jax.grad(slope(function), BOTH_ARGUMENTS)

    for transform in (changed, of_changes):
        compare_derivative(transform, WRAPPED[name], place, weight, roundings=1e4)
    several = jnp.stack([place, 0.9 * place, 1.1 * place])
    for transform in (slope, of_changes):
        compare_derivative(
            lambda function, of=transform: jax.vmap(of(function), (0, None)),
            WRAPPED[name],
            several,
            weight,
            roundings=1e4,
        )


def test_the_change_alone_can_be_transposed():
    given = arguments()

    def pulled(function):
        def back(*given):
            def pushed(change):
                return jax.jvp(lambda place: function(place, *given[1:]), given[:1], (change,))[1]

            (found,) = jax.linear_transpose(pushed, given[0])(1.0)
            return found

        return back

    compare_derivative(pulled, scalar, *given)


# --- the compiled loop ----------------------------------------------------------------------------


def names_of_loops(function, *given, platform="cpu") -> list[str]:
    lowered = jax.jit(function).trace(*given).lower(lowering_platforms=(platform,))
    return re.findall(r"mrjax_[0-9a-f]{32}", lowered.as_text())


def test_other_platforms_have_no_custom_call():
    gradient = jax.grad(scalar, EVERY)
    assert len(names_of_loops(scalar, *arguments())) == 1
    assert len(set(names_of_loops(gradient, *arguments()))) == 2
    for platform in ("cuda", "tpu"):
        for function in (scalar, gradient):
            assert not names_of_loops(
                lambda *of, f=function: f(*of), *arguments(), platform=platform
            )


SHOWN = """
import sys
sys.path.insert(0, sys.argv[1])
import jax
jax.config.update("jax_enable_x64", True)
from tests.kernel import test_summation as tests
from tests.builders.particles import unit_spheres
if sys.argv[2] == "late":  # another has been named before
    tests.names_of_loops(tests.scalar, *tests.arguments(dtype="float32"))
law, *given = tests.meeting([True, False, True], mixed=True)
print(*tests.names_of_loops(law, *given))
print(*tests.names_of_loops(jax.grad(tests.scalar, tests.EVERY), *tests.arguments()))
"""


def test_loops_have_the_same_names_in_every_process():
    """Programs are kept between processes, and know their loops by name."""
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", SHOWN, ROOT, when],
            env=os.environ | {"PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for when, seed in (("early", "1"), ("late", "2"))
    ]
    one, other = (process.communicate()[0].split() for process in processes)
    assert all(process.returncode == 0 for process in processes)
    assert one == other and len(set(one)) == 3


def test_different_loops_have_different_names():
    given = arguments()
    one = names_of_loops(lambda *of: of_all_kinds(*of), *given)
    again = names_of_loops(lambda *of: law_of_all_kinds()(*of), *given)
    single = names_of_loops(lambda *of: of_all_kinds(*of), *arguments(dtype="float32"))
    assert one == again and one != single


FUNCTIONS = {
    **{name: getattr(jnp, name) for name in ("exp", "exp2", "expm1", "log", "log1p", "cbrt")},
    **{name: getattr(jnp, name) for name in ("sin", "cos", "tan", "arcsin", "arccos", "arctan")},
    **{name: getattr(jnp, name) for name in ("sinh", "cosh", "tanh", "arcsinh", "arctanh")},
    **{name: getattr(jnp, name) for name in ("sign", "floor", "ceil", "isfinite")},
    "arccosh": lambda of: jnp.arccosh(1.0 + of),
    "arctan2": lambda of: jnp.arctan2(of, 0.3),
    "power": lambda of: of**2.3,
    "rem": lambda of: jax.lax.rem(of, jnp.full_like(of, 0.3)),
    "rsqrt": jax.lax.rsqrt,
    "logistic": jax.nn.sigmoid,
    "clip": lambda of: jnp.clip(of, 0.2, 0.5),
    "erf": jax.scipy.special.erf,
    "erfc": jax.scipy.special.erfc,
    "lgamma": jax.lax.lgamma,
}


@pytest.mark.parametrize("dtype", BOTH)
def test_functions_of_the_library_are_those_of_jax(dtype):
    """All of them in one law, from 0.1 to 0.9, beside what JAX computes for arrays."""
    value = jnp.linspace(0.1, 0.9, 9, dtype=dtype)
    listed = made(range(8), range(1, 9), np.ones((8, 3)), 9, 8)

    def law(first, *_):
        values = [jnp.asarray(function(first), dtype) for function in FUNCTIONS.values()]
        return values, [jnp.zeros_like(one) for one in values], None

    found, _ = jax.jit(
        lambda value: pair_sum(law, lambda *of: of[0] > 0.0, *ends(listed), particles=value)
    )(value)
    for name, one in zip(FUNCTIONS, found, strict=True):
        expected = FUNCTIONS[name](value[:8])
        # XLA's own functions err by a few roundings, more where they end at a pole.
        roundings = 40.0 * np.finfo(dtype).eps
        np.testing.assert_allclose(one[:8], expected, rtol=roundings, atol=roundings, err_msg=name)


TABLE = jnp.arange(16.0)
LACKING = {
    "round": lambda of: jnp.round(2.3 * of),
    "cond": lambda of: jax.lax.cond(of > 0.5, jnp.sin, jnp.cos, of),
    "table": lambda of: jnp.interp(of, jnp.linspace(0.0, 1.0, 16), TABLE.astype(of.dtype)),
}


@pytest.mark.parametrize("name", LACKING)
def test_an_operation_without_machine_code_takes_the_path_of_arrays(name):
    """With one warning, however often; forwards and backwards."""
    operation = LACKING[name]
    value = jnp.linspace(0.1, 0.9, 4)
    listed = made([0, 1, 2], [1, 2, 3], np.ones((3, 3)), 4, 3)

    def law(first, *_):
        value = operation(first)
        return value, value, None

    def pushed(value):
        return pair_sum(law, lambda *of: of[0] > 0.0, *ends(listed), particles=value)[0]

    primitive._warn_once.cache_clear()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = jax.jit(pushed)(value)
        slope = jax.grad(lambda value: jnp.sum(jax.jit(pushed)(value)))(value)
        jax.jit(lambda value: 2.0 * pushed(value))(value)
    alone = jax.vmap(operation)(value[:3])
    expected = jnp.zeros(4).at[:3].add(alone).at[1:].add(alone)
    np.testing.assert_allclose(found, expected, rtol=1e-15)
    each = jax.vmap(jax.grad(operation))(value[:3])
    np.testing.assert_allclose(slope[:3], 2.0 * each, rtol=1e-14)
    about = [str(one.message) for one in said if "evaluated with arrays" in str(one.message)]
    assert len(about) == len(set(about)) >= 1


def test_laws_with_other_tables_are_not_confused():
    """A table of a thousand entries is the same to the eye where only its middle differs."""
    listed = made([0], [1], np.ones((1, 3)), 2, 1)
    value = jnp.array([0.5, 0.5])

    def pushed(table):
        def law(first, *_):
            value = jnp.asarray(table)[(2000 * first).astype(int)]
            return value, value, None

        return jax.jit(
            lambda value: pair_sum(law, lambda *_: True, *ends(listed), particles=value)[0]
        )(value)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        plain, other = np.zeros(2001), np.zeros(2001)
        other[1000] = 1.0
        assert pushed(plain)[0] == 0.0 and pushed(other)[0] == 1.0


def test_backwards_over_devices():
    """A law that JAX transposes for a mesh of devices sums some scalars over no axis."""
    others = arguments()

    def of_one(one):
        return scalar(*others[:5], one, others[6])

    def total(by):
        return jnp.sum(mrjax.ensemble(of_one, by * jnp.array([1.0, 2.0])))

    alone = sum(factor * jax.grad(of_one)(1.3 * factor) for factor in (1.0, 2.0))
    np.testing.assert_allclose(jax.grad(total)(1.3), alone, rtol=1e-13)


def test_threads_do_not_disturb_each_other():
    """Of one compiled function, and of loops that are compiled meanwhile."""
    touches = [True, False, True] * 400
    law, listed, moving, parameters = meeting(touches, seed=10)
    compiled = jax.jit(lambda moving: law(listed, moving, parameters))
    several = [jax.tree.map(lambda leaf, by=by: leaf * by, moving) for by in (1.0, 0.9, 0.5, 0.2)]
    alone = [compiled(moving) for moving in several]
    with ThreadPoolExecutor(4) as pool:
        for _ in range(5):
            for found, expected in zip(pool.map(compiled, several), alone, strict=True):
                jax.tree.map(np.testing.assert_array_equal, found, expected)
        fresh = [jax.jit(lambda *of, by=by: scalar(*of) * by) for by in (1.0, 2.0, 4.0, 8.0)]
        values = list(pool.map(lambda of: float(of(*arguments(11))), fresh))
    assert values == [values[0] * by for by in (1.0, 2.0, 4.0, 8.0)]


# --- the list of a run, rebuilt only where it is stale --------------------------------------------

BOX = mrjax.Box((12.0, 12.0, 12.0), (True, True, False))
BALLS = unit_spheres(particle_density=0.3, elastic_modulus=1e4, friction=0.3)


@pytest.fixture
def builds(monkeypatch):
    """How often lists are built in compiled runs."""
    seen, build = [], neighbours.build

    def counted(*given):
        jax.debug.callback(lambda: seen.append(1))
        return build(*given)

    monkeypatch.setattr(neighbours, "build", counted)
    scan.advance.clear_cache()
    yield seen
    scan.advance.clear_cache()


def flight(monkeypatch, parameters, state, hurry, duration=1.0, steps=400):
    monkeypatch.setattr(engine, "SPEED_MARGIN", hurry)
    scan.advance.clear_cache()
    run = mrjax.simulate(
        state,
        parameters,
        BOX,
        duration=duration,
        time_step=duration / steps,
        rebuild_every=1,
        skin=0.1,
    )
    jax.effects_barrier()
    return run


RANDOM = np.random.default_rng(12)
GRID = 2.5 * np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3) + 1.5
FLYING = mrjax.place(GRID, RANDOM.uniform(-3.0, 3.0, GRID.shape))
RESTING = mrjax.place(GRID + RANDOM.uniform(-0.2, 0.2, GRID.shape))


@pytest.mark.parametrize(
    "start, gravity", [(FLYING, 0.0), (RESTING, 8.0)], ids=["flying", "from rest"]
)
def test_lists_that_are_kept_give_what_those_built_anew_give(builds, monkeypatch, start, gravity):
    """They cross many skins of 0.2, and collide; built anew, after every step."""
    parameters = BALLS.replace(gravity=gravity)
    kept = flight(monkeypatch, parameters, start, engine.SPEED_MARGIN)
    of_kept = len(builds)
    anew = flight(monkeypatch, parameters, start, 1e9)
    of_anew = len(builds) - of_kept
    assert of_anew >= 100 and 5 < of_kept < 0.5 * of_anew
    assert np.linalg.norm(kept.state.position - start.position, axis=1).max() > 5 * 0.2
    assert np.abs(kept.state.spin).max() > 0.1
    for name in ("position", "velocity", "spin"):
        found, expected = (getattr(run.state, name) for run in (kept, anew))
        # Roundings of 400 steps, 1e-16 of 10 each, that collisions spread a hundredfold each.
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)


def test_a_traced_run_that_outruns_its_list_says_so():
    """From rest the first list is taken to serve for a whole interval."""

    @jax.jit
    def run(pull, velocity):
        state = mrjax.place(GRID[:2], velocity, contact_diameter=2.0)
        return mrjax.simulate(
            state,
            BALLS.replace(gravity=pull),
            BOX,
            duration=0.4,
            time_step=1e-3,
            rebuild_every=100,
        )

    still = jnp.zeros((2, 3))
    assert int(run(1.0, still).fault) == 0
    outran = run(100.0, still)
    assert int(outran.fault) & mrjax.Fault.OUTRAN_LIST
    assert np.isnan(outran.state.position).all()
