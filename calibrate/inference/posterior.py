"""Samples of the posterior by NUTS (blackjax), with what tells whether they are to be trusted.

The posterior of the logarithms is exp(-chi^2 / 2) with the priors among the residuals. It often
is a long ridge: the mass matrix is dense, and begins as the curvature at the optimum.
"""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jax import Array
from tqdm import tqdm

from calibrate.inference import diagnostics
from calibrate.inference.chains import MOST, Piece, Sampler, arrays
from calibrate.inference.curvature import information
from calibrate.inference.identify import identify
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from mrjax import InputError
from mrjax.core import randomness
from mrjax.core.promotion import relaxed_promotion
from mrjax.io.checkpoint import Checkpoint, refuse_foreign

CHAINS, WARM_UP, SAMPLES = 4, 300, 500
FEWEST = 4
"""Samples of a chain whose halves can be compared."""
LARGEST_R_HAT, LEAST_EFFECTIVE = 1.01, 400.0
"""Vehtari et al. (2021): beyond these the samples are not to be used."""


@dataclass(frozen=True)
class Posterior:
    """Draws of all fitted values."""

    names: tuple[str, ...]
    samples: np.ndarray
    """Values, not logarithms; (CHAINS * SAMPLES, P), chain after chain."""
    r_hat: np.ndarray
    """Spread between chains over that within them, 1 when they agree: split, by ranks, and the
    greater of that of values and of their distances from the median; (P,)."""
    effective: np.ndarray
    """Independent samples that they are worth, in their middle or tails, the less; (P,)."""
    divergences: int
    """Steps that left the posterior; not 0: a part of it may be missing."""

    @property
    def converged(self) -> bool:
        """True if the samples may be used: all chains agree, and none diverged."""
        with np.errstate(divide="ignore"):
            logs = np.log(self.samples)
        chains = logs.reshape(CHAINS, -1, len(self.names))
        return bool(
            (self.r_hat < LARGEST_R_HAT).all()
            and (diagnostics.r_hat(chains) < LARGEST_R_HAT).all()
            and (self.effective > LEAST_EFFECTIVE).all()
            and self.divergences == 0
        )


def posterior(
    fit: Fit,
    seed: int = 0,
    samples: int = SAMPLES,
    checkpoint: str | Path | None = None,
    progress: bool = False,
) -> Posterior:
    """Samples the posterior of a fit.

    The chains go on piece by piece, of half a second or one draw, and stop between two.

    Args:
      fit: converged.
      seed: of the chains.
      samples: of each of the four chains, 4 at least.
      checkpoint: folder that keeps every fifty draws. Called again with it and the same arguments,
        on the same machine, the chains go on, and end with the same bits.
      progress: whether to show a progress bar, on standard error.

    Raises:
      InputError: blackjax is not installed, the posterior has no end, or a checkpoint of another.
    """
    refuse_foreign(checkpoint)
    if samples < FEWEST:
        raise InputError(f"samples = {samples}: must be at least {FEWEST}, to compare two halves")
    refuse_without_sampler()
    _refuse_without_end(fit)
    work = None
    if checkpoint is not None:
        work = Checkpoint.of_work(
            Path(checkpoint),
            names=fit.names,
            values=fit.values,
            seed=seed,
            samples=samples,
            information=information(fit),
        )
        if (kept := work.load("samples")) is not None:
            return _of_arrays(fit, kept[0])
    whitened, best = _whitening(fit)

    def log_density(position: Array) -> Array:
        return -0.5 * jnp.sum(fit.everything(best + whitened @ position, fit.given) ** 2)

    with stoppable(), relaxed_promotion(), randomness.ordered():
        sampler = Sampler(
            log_density, best.size, chains=CHAINS, seed=seed, warm_up=WARM_UP, draws=samples
        )
        drawn = _drawn(sampler, work, progress)
        logs = np.asarray(best) + drawn.positions[:, WARM_UP:] @ np.asarray(whitened).T
        summary = {
            "samples": np.exp(logs).reshape(-1, best.size),
            "r_hat": diagnostics.r_hat(logs),
            "effective": _effective(logs),
            "divergences": drawn.divergent[:, WARM_UP:].sum(),
        }
    if work is not None:
        work.save("samples", summary)
    return _of_arrays(fit, summary)


def _drawn(sampler: Sampler, work: Checkpoint | None, progress: bool) -> Piece:
    """All steps of the chains, those that were kept and the others."""
    kept = None if work is None else work.sequence("chains")
    earlier, left = ([], None) if kept is None else kept.resumed()
    pieces = [Piece(piece["positions"], piece["divergent"]) for piece in earlier]
    done = sum(piece.positions.shape[1] for piece in pieces)
    chains = sampler.begin() if left is None else sampler.restored(left)
    unkept: list[Piece] = []
    with tqdm(
        desc="posterior", total=sampler.length, initial=done, disable=not progress, leave=False
    ) as bar:
        for state, piece in sampler.pieces(chains, done):
            done += piece.positions.shape[1]
            bar.set_postfix_str("warm-up" if done < sampler.warm_up else "draws", refresh=False)
            bar.update(piece.positions.shape[1])
            unkept.append(piece)
            if kept is not None and (done % MOST == 0 or done == sampler.length):
                whole = _joined(unkept)
                kept.append(whole._asdict(), arrays(state))
                pieces, unkept = [*pieces, whole], []
    return _joined([*pieces, *unkept])


def _joined(pieces: list[Piece]) -> Piece:
    return Piece(*(np.concatenate(arrays, axis=1) for arrays in zip(*pieces, strict=True)))


def _effective(draws: np.ndarray) -> np.ndarray:
    """Independent samples that draws, (C, N, P), are worth, in their middle or tails; (P,)."""
    from blackjax.diagnostics import effective_sample_size

    halves = diagnostics.split(draws)
    each = (diagnostics.normalised(halves), *diagnostics.tails(halves))
    sizes = [np.asarray(effective_sample_size(jnp.asarray(numbers))) for numbers in each]
    return np.min(sizes, axis=0)


def _of_arrays(fit: Fit, arrays: dict[str, np.ndarray]) -> Posterior:
    """A posterior from its arrays."""
    return Posterior(
        fit.names,
        arrays["samples"],
        arrays["r_hat"],
        arrays["effective"],
        int(arrays["divergences"]),
    )


def refuse_without_sampler() -> None:
    """Refuses to sample where an optional package is not installed.

    Raises:
      InputError: one is missing.
    """
    for package in ("blackjax", "corner"):
        if importlib.util.find_spec(package) is None:
            raise InputError(f"posterior samples need {package}: pip install 'mrjax[posterior]'")


def _refuse_without_end(fit: Fit) -> None:
    unbounded = [name for name, error in identify(fit).standard_errors.items() if np.isinf(error)]
    if unbounded:
        raise InputError(
            f"the posterior of {', '.join(unbounded)} has no end: no measurement and no prior "
            "bounds it; give log_standard_deviation, or standard_deviation with bounds"
        )


def _whitening(fit: Fit) -> tuple[Array, Array]:
    """A square root of the covariance at the optimum, (P, P), and the optimum, (P,), in logs."""
    strength, directions = np.linalg.eigh(information(fit))
    return jnp.asarray(directions / np.sqrt(strength)), jnp.log(jnp.asarray(fit.values))
