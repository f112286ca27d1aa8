"""A posterior by chains of NUTS, which begin apart, with the curvature as their mass matrix.

The posterior often is a long ridge: positions are measured along the directions and in the standard
deviations of the curvature, and the mass matrix is dense. Chains begin at draws of the proposal,
which is wider than the posterior, in turn about each of the optima.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from tqdm import tqdm

from calibrate.inference.chains import MOST, Piece, Sampler, arrays
from calibrate.inference.density import Density
from calibrate.inference.importance import Evaluate
from calibrate.inference.laplace import Optima
from calibrate.inference.proposal import Proposal
from mrjax.core import randomness
from mrjax.io.checkpoint import Checkpoint

CHAINS, WARM_UP, SAMPLES = 4, 300, 500
STEPS = 7
"""Leapfrog steps of a draw, about, where positions are in standard deviations."""
WEIGHTY = 5e-3
"""Weight of an optimum by Laplace's approximation, from which on chains must have been there."""
TRIES = 50
"""Draws among which a chain finds a place with a density."""


class Drawn(NamedTuple):
    """Draws of chains after their warm-up."""

    logs: np.ndarray
    """(C, N, P)."""
    divergences: int
    separated: bool
    """True if each chain stays at one optimum, and not all at the same, or if none is at one of
    some weight."""


def sample(
    density: Density,
    optima: Optima,
    log_densities: Evaluate,
    *,
    seed: int,
    samples: int,
    work: Checkpoint | None,
    progress: bool,
) -> Drawn:
    """Draws of chains.

    Args:
      density: of the posterior.
      optima: of it.
      log_densities: of logarithms, (N, P).
      seed: of the chains.
      samples: of each of them.
      work: keeps every fifty draws.
      progress: whether to show a progress bar, on standard error.
    """
    proposal = optima.proposal
    root, best = whitening(proposal)
    log_density = density.differentiable()

    def at(position: Array) -> Array:
        return log_density(density.reflected(best + root @ position))

    def home(position: Array, gradient: Array) -> tuple[Array, Array]:
        """Within the bounds: chains that wander from image to image seem wide."""
        logs, reflection = jax.vjp(density.reflected, best + root @ position)
        (gradient_within,) = reflection(jnp.linalg.solve(root.T, gradient))
        return jnp.linalg.solve(root, logs - best), root.T @ gradient_within

    first = beginnings(proposal, log_densities, density, seed)
    positions = np.linalg.solve(root, (first - best).T).T
    with randomness.ordered():
        sampler = Sampler(at, positions, seed=seed, warm_up=WARM_UP, draws=samples, home=home)
        piece = _drawn(sampler, work, progress)
    logs = best + piece.positions[:, WARM_UP:] @ root.T
    divergences = int(piece.divergent[:, WARM_UP:].sum())
    return Drawn(logs, divergences, _separated(optima, logs))


def whitening(proposal: Proposal) -> tuple[np.ndarray, np.ndarray]:
    """A square root of the covariance at the best optimum, (P, P), and that optimum, (P,)."""
    variance, directions = np.linalg.eigh(proposal.scales[0])
    return directions * np.sqrt(variance), proposal.centres[0]


def beginnings(
    proposal: Proposal, log_densities: Evaluate, density: Density, seed: int
) -> np.ndarray:
    """Where chains begin, (C, P): each at a draw about an optimum, in turn."""
    random = np.random.default_rng([seed, CHAINS])
    first = []
    for chain in range(CHAINS):
        place = chain % len(proposal.shares)
        about = proposal.component(place)
        position = about.centres[0]
        for candidate in about.draw(TRIES, random):
            if density.holds(candidate) and np.isfinite(log_densities(candidate[None])[0]):
                position = candidate
                break
        first.append(position)
    return np.stack(first)


def _separated(optima: Optima, logs: np.ndarray) -> bool:
    """True if chains, (C, N, P), do not tell the weights of the optima."""
    about = [set(optima.proposal.nearest(chain)) for chain in logs]
    reached = set.union(*about)
    missing = set(np.flatnonzero(optima.weights > WEIGHTY)) - reached
    return bool(missing) or (len(reached) > 1 and all(len(visited) == 1 for visited in about))


def _drawn(sampler: Sampler, work: Checkpoint | None, progress: bool) -> Piece:
    """All steps of the chains, those that were kept and the others."""
    stored = None if work is None else work.sequence("chains")
    earlier, last_state = ([], None) if stored is None else stored.resumed()
    pieces = [Piece(piece["positions"], piece["divergent"]) for piece in earlier]
    done = sum(piece.positions.shape[1] for piece in pieces)
    chains = sampler.begin() if last_state is None else sampler.restored(last_state)
    unkept: list[Piece] = []
    with tqdm(
        desc="posterior", total=sampler.length, initial=done, disable=not progress, leave=False
    ) as bar:
        for state, piece in sampler.pieces(chains, done):
            done += piece.positions.shape[1]
            bar.set_postfix_str("warm-up" if done < sampler.warm_up else "draws", refresh=False)
            bar.update(piece.positions.shape[1])
            unkept.append(piece)
            if stored is not None and (done % MOST == 0 or done == sampler.length):
                joined = _joined(unkept)
                stored.append(joined._asdict(), arrays(state))
                pieces, unkept = [*pieces, joined], []
    return _joined([*pieces, *unkept])


def _joined(pieces: list[Piece]) -> Piece:
    return Piece(*(np.concatenate(arrays, axis=1) for arrays in zip(*pieces, strict=True)))
