"""Long lists of pairs in parts, which threads share: the sums of one, and always the same."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mrjax.dem.pairs import Pairs
from mrjax.kernel import pair_sum
from mrjax.kernel.llvm import codegen, threads
from tests.builders import ROOT

PARTICLES = 300
LISTS = ["none", "few", "many", "ordered"]


def listed(kind: str, room: int = 3000) -> Pairs:
    """Of particles far apart in the arrays or in their order, a seventh of them with walls."""
    random = np.random.default_rng(1)
    count = {"none": 0, "few": 3}.get(kind, room - 77)
    first = random.integers(PARTICLES, size=room)
    second = (first + random.integers(1, PARTICLES, room)) % PARTICLES
    if kind == "ordered":
        first = np.sort(first)
        second = np.minimum(first + random.integers(1, 20, room), PARTICLES)
    second[::7] = PARTICLES + 3
    ends = (jnp.asarray(of, jnp.int32) for of in (first, second))
    return Pairs(
        *ends,
        jnp.arange(room) < count,
        None,
        (jnp.zeros(room),) * 3,
        jnp.zeros((1, PARTICLES), jnp.int32),
        jnp.zeros((), jnp.int32),
    )


def given(room: int = 3000, seed: int = 2, dtype="float64") -> list:
    """Of particles with and without rows, of pairs, and of all."""
    random = np.random.default_rng(seed)
    shapes = (3, PARTICLES), (PARTICLES,), (2, room), (2,)
    return [jnp.asarray(random.uniform(0.2, 1.5, shape), dtype) for shape in shapes]


def evaluated(pairs: Pairs):
    """A law of all that, as a function."""

    def law(mine, theirs, pair, both, spring):
        (x, m), (y, k) = mine, theirs
        apart = x[0] - y[0], x[1] - y[1], x[2] - y[2]
        new = spring[0] + apart[1] * both[0], spring[1] - apart[0] * m * k
        force = apart[0] * new[0], apart[1] * both[1], apart[2] / (1.0 + new[1] ** 2)
        return [force, m * k], [tuple(-of for of in force), m + both[0]], new

    def touching(mine, theirs, *_):
        return mine[0][0] - theirs[0][0] < 0.4

    def results(place, weight, spring, both):
        ends = pairs.first, pairs.second, pairs.count
        particles = [place, weight]
        sums, kept = pair_sum(law, touching, *ends, particles=particles, shared=both, memory=spring)
        return *sums, kept

    return results


def everything(pairs: Pairs):
    """Values, a change of them, and all slopes of one number that they make."""
    function = evaluated(pairs)

    def number(*of):
        return sum(jnp.sum(jnp.sin(found)) for found in function(*of))

    def all_of_it(arguments, changes):
        changed = jax.jvp(function, arguments, changes)
        return changed, jax.grad(number, argnums=(0, 1, 2, 3))(*arguments)

    return all_of_it


def in_parts(monkeypatch, several: bool):
    """From here on every list is divided, or none."""
    monkeypatch.setattr(codegen, "LONG_LIST", 1 if several else sys.maxsize)
    codegen.registered.cache_clear()


@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("kind", LISTS)
def test_parts_add_up_to_the_whole(monkeypatch, kind, dtype):
    changes = given(seed=3, dtype=dtype)
    found = {}
    for several in (True, False):
        in_parts(monkeypatch, several)
        function = jax.jit(everything(listed(kind)))
        text = function.lower(given(dtype=dtype), changes).as_text()
        assert (f"tensor<{codegen.CHUNKS}x" in text) == several
        found[several] = function(given(dtype=dtype), changes)
    for one, other in zip(*(jax.tree.leaves(found[of]) for of in (True, False)), strict=True):
        # Sums of up to 3000 numbers, taken in another order.
        allowed = 100 * np.finfo(dtype).eps * np.abs(other).max(initial=0.0)
        np.testing.assert_allclose(one, other, rtol=0, atol=allowed)
    assert all(np.any(of) for of in found[True][0][0]) == (kind != "none")


def test_a_list_of_pairs_that_add_to_nothing_has_parts_too(monkeypatch):
    in_parts(monkeypatch, True)

    def kept(spring):
        pairs = listed("many")
        ends = pairs.first, pairs.second, pairs.count
        law = lambda mine, *_: (None, None, mine * _[-1])  # noqa: E731
        touching = lambda *of: of[-1] > 0.5  # noqa: E731
        twos = 2.0 * jnp.ones(PARTICLES)
        return pair_sum(law, touching, *ends, particles=twos, memory=spring)[1]

    spring = given()[2][0]
    present = np.asarray(listed("many").present)
    expected = np.where(present & (spring <= 0.5), 0.0, 2.0 * spring)
    np.testing.assert_array_equal(
        jax.jit(kept)(spring),
        np.where(present, expected, spring),  # places without a pair stay
    )


def test_the_numbers_do_not_depend_on_who_does_what(monkeypatch):
    """Again and again, and by more callers at once than can have help."""
    in_parts(monkeypatch, True)
    function = jax.jit(everything(listed("many")))
    arguments = given(), given(seed=3)
    expected = jax.tree.leaves(function(*arguments))

    def same(_) -> bool:
        found = jax.tree.leaves(function(*arguments))
        return all(np.array_equal(one, other) for one, other in zip(found, expected, strict=True))

    assert all(map(same, range(100)))
    with ThreadPoolExecutor(2 * threads.JOBS) as pool:
        assert all(pool.map(same, range(300)))


DIGEST = """
import hashlib, os, sys
if sys.argv[1] == "one":
    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
sys.path.insert(0, sys.argv[2])
import jax
jax.config.update("jax_enable_x64", True)
from tests.kernel import test_chunks
from mrjax.kernel.llvm import codegen as machine_code
machine_code.LONG_LIST = 1
function = jax.jit(test_chunks.everything(test_chunks.listed("many")))
found = jax.tree.leaves(function(test_chunks.given(), test_chunks.given(seed=3)))
print(hashlib.sha256(b"".join(of.tobytes() for of in map(jax.device_get, found))).hexdigest())
"""


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores cannot be chosen here")
def test_one_core_gives_the_numbers_of_all():
    one, all_cores = (
        subprocess.run(
            [sys.executable, "-c", DIGEST, cores, ROOT], capture_output=True, text=True, check=True
        ).stdout
        for cores in ("one", "all")
    )
    assert len(one.strip()) == 64 and one == all_cores
