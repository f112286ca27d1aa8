"""Chains of NUTS (blackjax) side by side, piece by piece.

One compiled program takes so many steps from where the chains are; how many is an argument of it,
so that the draws do not depend on the pieces. Every step has a random key of its own. The warm-up
is Stan's: it adapts the step size, and in growing windows the mass matrix.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from calibrate.least_squares.interruptible import wait_for
from mrjax.core import randomness

DURATION = 0.5
"""Of a piece, s, about: within it nobody looks whether to stop."""
MOST = 50
"""Steps of a piece."""
FASTER = 4
"""How many times longer a piece may be than the one before."""
ACCEPTANCE = 0.95
"""Wanted of the steps: at 0.8 some diverge in valleys that bend, or at bounds."""


Home = Callable[[Array, Array], tuple[Array, Array]]
"""Positions and gradients, (P,), of one place in place of those of another that is like it."""


class Chain(NamedTuple):
    """One chain between two steps."""

    state: Any
    step_size: Any  # dual averaging
    mass: Any  # matrix, and what it is adapted from


class Piece(NamedTuple):
    """Some steps of C chains."""

    positions: np.ndarray
    """(C, K, P)."""
    divergent: np.ndarray
    """(C, K)."""


class Sampler:
    """Chains of a density from a seed.

    Args:
      log_density: of a position, (P,).
      positions: where its chains begin, (C, P).
      seed: of all random numbers.
      warm_up: steps by which the chains are adapted.
      draws: steps after those.
      home: takes a position and the gradient there to where the density is the same, nearer.
    """

    def __init__(
        self,
        log_density: Callable[[Array], Array],
        positions: np.ndarray,
        *,
        seed: int,
        warm_up: int,
        draws: int,
        home: Home = lambda *position_and_gradient: position_and_gradient,
    ) -> None:
        from blackjax.adaptation.window_adaptation import build_schedule

        self.warm_up, self.length = warm_up, warm_up + draws
        chains, size = positions.shape
        keys = jax.random.split(randomness.key(seed), chains)
        adapting, drawing = jnp.moveaxis(jax.vmap(jax.random.split)(keys), 1, 0)
        self._keys = jnp.concatenate(
            [
                jax.vmap(partial(jax.random.split, num=number))(key)
                for key, number in ((adapting, warm_up), (drawing, draws))
            ],
            axis=1,
        ).T  # (steps, C)
        windows = np.asarray(build_schedule(warm_up)).reshape(-1, 2)
        still = np.zeros((draws, 2))
        self._windows = jnp.asarray(np.vstack([windows, still]), bool)
        self._begin = jax.jit(jax.vmap(partial(_begun, log_density)))
        self._advance = jax.jit(partial(_advanced, log_density, home, size, warm_up))
        self._first = jnp.asarray(positions, float)

    def begin(self) -> Chain:
        """The chains before their first step."""
        return self._begin(self._first)

    def restored(self, arrays: dict[str, np.ndarray]) -> Chain:
        """Chains of which `arrays` was kept."""
        like = jax.eval_shape(self._begin, self._first)
        leaves = [jnp.asarray(arrays[str(place)]) for place in range(len(arrays))]
        return jax.tree.unflatten(jax.tree.structure(like), leaves)

    def pieces(self, chains: Chain, done: int, most: int = MOST) -> Iterator[tuple[Chain, Piece]]:
        """All further steps of chains that have done some.

        A piece ends with a multiple of `most` steps, at the latest.
        """
        number, known = 1, 0.0
        while done < self.length:
            number = min(number, most - done % most, self.length - done)
            began = time.perf_counter()
            result = wait_for(self._advance(chains, self._keys, self._windows, done, number))
            took = (time.perf_counter() - began) / number
            chains, positions, divergent = result
            done += number
            yield (
                chains,
                Piece(
                    np.moveaxis(np.asarray(positions)[:number], 0, 1),
                    np.asarray(divergent)[:number].T,
                ),
            )
            # The first piece was compiled, too.
            longest = FASTER * number if known else 1
            number, known = max(1, min(longest, int(DURATION / took), most)), took


def arrays(chains: Chain) -> dict[str, np.ndarray]:
    """Chains as arrays to be kept."""
    return {str(place): np.asarray(leaf) for place, leaf in enumerate(jax.tree.leaves(chains))}


def _adaptations() -> tuple[tuple, tuple]:
    """The initial, update and final functions of step size and mass matrix."""
    from blackjax.adaptation.mass_matrix import mass_matrix_adaptation
    from blackjax.adaptation.step_size import dual_averaging_adaptation

    return dual_averaging_adaptation(ACCEPTANCE), mass_matrix_adaptation(False)


def _begun(log_density: Callable, position: Array) -> Chain:
    """A chain at a position, (P,)."""
    import blackjax

    (step_size, *_), (mass, *_) = _adaptations()
    state = blackjax.nuts.init(position, log_density)
    return _plain(Chain(state, step_size(1.0), mass(position.size)))


def _plain(chains: Chain) -> Chain:
    """The same numbers, of types that stand for themselves: others would be compiled for anew."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.result_type(leaf)), chains)


def _advanced(
    log_density: Callable,
    home: Home,
    size: int,
    warm_up: int,
    chains: Chain,
    keys: Array,
    windows: Array,
    done: Array,
    number: Array,
) -> tuple[Chain, Array, Array]:
    """Chains `number` steps on; positions, (MOST, C, P), and divergences, (MOST, C), on the way."""
    step = jax.vmap(partial(_stepped, log_density, home), in_axes=(0, 0, None, None))
    count = keys.shape[1]

    def body(place: Array, carried: tuple[Chain, Array, Array]) -> tuple[Chain, Array, Array]:
        chains, positions, divergent = carried
        at = done + place
        chains, ended = step(chains, keys[at], windows[at], at < warm_up)
        positions = positions.at[place].set(chains.state.position)
        return _plain(chains), positions, divergent.at[place].set(ended)

    empty = jnp.zeros((MOST, count, size)), jnp.zeros((MOST, count), bool)
    return jax.lax.fori_loop(0, number, body, (chains, *empty))


def _stepped(
    log_density: Callable, home: Home, chain: Chain, key: Array, window: Array, adapting: Array
) -> tuple[Chain, Array]:
    """A chain one step on, adapted in the warm-up, and whether the step was divergent.

    `window`: whether the mass matrix learns from this step, and whether it is replaced after it.
    """
    import blackjax

    (da_init, da_update, da_final), (_, mm_update, mm_final) = _adaptations()
    state, step_size, mass = chain
    log_size = jnp.where(adapting, step_size.log_step_size, step_size.log_step_size_avg)
    state, info = blackjax.nuts.build_kernel()(
        key, state, log_density, jnp.exp(log_size), mass.inverse_mass_matrix
    )
    position, gradient = home(state.position, state.logdensity_grad)
    state = state._replace(position=position, logdensity_grad=gradient)
    learnt = da_update(step_size, info.acceptance_rate), mm_update(mass, state.position)
    learnt = learnt[0], _chosen(window[0], learnt[1], mass)
    replaced = da_init(da_final(learnt[0])), mm_final(learnt[1])
    adapted = _chosen(window[1], replaced, learnt)
    return Chain(state, *_chosen(adapting, adapted, (step_size, mass))), info.is_divergent


def _chosen(condition: Array, new: Any, old: Any) -> Any:
    return jax.tree.map(partial(jnp.where, condition), new, old)
