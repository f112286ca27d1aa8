"""Chains of NUTS (blackjax), side by side and in pieces.

One compiled program advances all chains by a number of steps. The number is an argument of the
program, so that the draws do not depend on the pieces. Every step has a random key of its own. The
warm-up is Stan's: it adapts the step size and, in growing windows, the mass matrix.
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
"""Approximate duration of a piece, s. Ctrl-C is noticed between two pieces."""
MOST = 50
"""Most steps of a piece."""
FASTER = 4
"""Largest ratio of the steps of a piece to those of the piece before."""
ACCEPTANCE = 0.95
"""Target acceptance rate. At 0.8 some steps diverge in valleys that bend, or at bounds."""


Home = Callable[[Array, Array], tuple[Array, Array]]
"""Function from a position and its gradient, (P,) each, to an equivalent position and gradient."""


class Chain(NamedTuple):
    """State of a chain, or of several, between two steps."""

    state: Any
    step_size: Any  # dual averaging
    mass: Any  # mass matrix, and the state of its adaptation


class Piece(NamedTuple):
    """K steps of C chains."""

    positions: np.ndarray
    """Positions after each step, (C, K, P)."""
    divergent: np.ndarray
    """True for divergent steps, (C, K)."""


class Sampler:
    """A sampler of a density by chains of NUTS.

    Args:
      log_density: function from a position, (P,), to the log-density.
      positions: first positions of the chains, (C, P).
      seed: seed of all random numbers.
      warm_up: number of steps that adapt the chains.
      draws: number of steps after the warm-up.
      home: function that moves a position and its gradient into the bounds, to a position of the
        same density.
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
        self._begin = jax.jit(jax.vmap(partial(_first_chain, log_density)))
        self._advance = jax.jit(partial(_advance_chains, log_density, home, size, warm_up))
        self._first = jnp.asarray(positions, float)

    def begin(self) -> Chain:
        """The chains before their first step."""
        return self._begin(self._first)

    def restored(self, arrays: dict[str, np.ndarray]) -> Chain:
        """Chains from their stored arrays."""
        like = jax.eval_shape(self._begin, self._first)
        leaves = [jnp.asarray(arrays[str(place)]) for place in range(len(arrays))]
        return jax.tree.unflatten(jax.tree.structure(like), leaves)

    def pieces(self, chains: Chain, done: int, most: int = MOST) -> Iterator[tuple[Chain, Piece]]:
        """Yields all further steps of the chains, piece by piece.

        A piece ends at a multiple of `most` steps at the latest.

        Args:
          chains: the chains.
          done: number of steps that they have done.
          most: most steps of a piece.
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
            # The time of the first piece includes its compilation.
            longest = FASTER * number if known else 1
            number, known = max(1, min(longest, int(DURATION / took), most)), took


def arrays(chains: Chain) -> dict[str, np.ndarray]:
    """Chains as arrays, for a checkpoint."""
    return {str(place): np.asarray(leaf) for place, leaf in enumerate(jax.tree.leaves(chains))}


def _adaptations() -> tuple[tuple, tuple]:
    """The initial, update and final functions of step size and mass matrix."""
    from blackjax.adaptation.mass_matrix import mass_matrix_adaptation
    from blackjax.adaptation.step_size import dual_averaging_adaptation

    return dual_averaging_adaptation(ACCEPTANCE), mass_matrix_adaptation(False)


def _first_chain(log_density: Callable, position: Array) -> Chain:
    """The state of a chain at its first position, (P,)."""
    import blackjax

    (step_size, *_), (mass, *_) = _adaptations()
    state = blackjax.nuts.init(position, log_density)
    return _strongly_typed(Chain(state, step_size(1.0), mass(position.size)))


def _strongly_typed(chains: Chain) -> Chain:
    """The same numbers with strong types: weak types would be compiled again."""
    return jax.tree.map(lambda leaf: jnp.asarray(leaf, jnp.result_type(leaf)), chains)


def _advance_chains(
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
    """Advances chains by `number` steps.

    Returns:
      the chains, the positions after each step, (MOST, C, P), and divergences, (MOST, C).
    """
    step = jax.vmap(partial(_step_chain, log_density, home), in_axes=(0, 0, None, None))
    count = keys.shape[1]

    def body(place: Array, carried: tuple[Chain, Array, Array]) -> tuple[Chain, Array, Array]:
        chains, positions, divergent = carried
        at = done + place
        chains, ended = step(chains, keys[at], windows[at], at < warm_up)
        positions = positions.at[place].set(chains.state.position)
        return _strongly_typed(chains), positions, divergent.at[place].set(ended)

    empty = jnp.zeros((MOST, count, size)), jnp.zeros((MOST, count), bool)
    return jax.lax.fori_loop(0, number, body, (chains, *empty))


def _step_chain(
    log_density: Callable, home: Home, chain: Chain, key: Array, window: Array, adapting: Array
) -> tuple[Chain, Array]:
    """Advances a chain by one step, and adapts it in the warm-up; True for a divergent step.

    `window` has two flags: the mass matrix learns from this step; it is replaced after this step.
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
    learnt = learnt[0], _select(window[0], learnt[1], mass)
    replaced = da_init(da_final(learnt[0])), mm_final(learnt[1])
    adapted = _select(window[1], replaced, learnt)
    return Chain(state, *_select(adapting, adapted, (step_size, mass))), info.is_divergent


def _select(condition: Array, new: Any, old: Any) -> Any:
    return jax.tree.map(partial(jnp.where, condition), new, old)
