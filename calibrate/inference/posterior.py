"""Samples of the posterior, with diagnostics of their reliability.

Importance sampling comes first. It needs some hundred runs of the model if the posterior is near
the normal approximation at its optima. If Pareto's k shows that it is not, chains of NUTS follow
(blackjax), which need tens of thousands of gradients.
"""

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from calibrate.inference import diagnostics, importance, nuts
from calibrate.inference.curvature import information
from calibrate.inference.density import Density, unbounded
from calibrate.inference.importance import LEAST_EFFECTIVE, Weighted
from calibrate.inference.laplace import Optima, approximated
from calibrate.inference.model_runs import ModelRuns, say_estimate, seconds_of
from calibrate.inference.nuts import CHAINS, SAMPLES
from calibrate.inference.reach import ends_early
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.interruptible import stoppable
from mrjax import InputError
from mrjax.core.promotion import relaxed_promotion
from mrjax.io.checkpoint import Checkpoint, refuse_foreign

FEWEST = 4
"""Fewest samples of a chain: its halves are compared."""
LARGEST_R_HAT = 1.01
"""R-hat beyond which samples are not to be used (Vehtari et al. 2021)."""
IMPORTANCE, NUTS = "importance sampling", "NUTS"
METHODS = IMPORTANCE, NUTS

SEPARATED = (
    "the optima are separated: chains do not go from one to another, so that their weights are not "
    "known"
)
LOST = (
    "an optimum of the cheap model is none of the model itself, so that a part of the posterior "
    "may be missing"
)
WITHOUT_GRADIENT = (
    "weights are too uneven, and JAX does not trace the model, so that NUTS cannot take over"
)


@dataclass(frozen=True)
class Posterior:
    """Samples of all fitted values, of equal weight."""

    names: tuple[str, ...]
    samples: np.ndarray
    """Values, not logarithms; (CHAINS * SAMPLES, P), by NUTS chain after chain."""
    r_hat: np.ndarray
    """Spread between chains over spread within them, (P,); 1 if the chains agree.

    It is split and rank-normalised, and the larger one of values and of their distances from the
    median. Importance sampling has no chains, and gives 1.
    """
    effective: np.ndarray
    """Number of effective samples, (P,): the smaller one of middle and tails. Importance sampling
    gives (sum w)^2 / sum w^2 of the weights w before resampling."""
    divergences: int
    """Number of divergent steps; unless it is 0, a part of the posterior may be missing."""
    method: str = NUTS
    """`importance sampling` or `NUTS`."""
    pareto_k: float | None = None
    """Shape of the tail of the importance weights; also given if NUTS followed."""
    faults: tuple[str, ...] = ()
    """Sentences on what may be missing."""

    @property
    def converged(self) -> bool:
        """True if the samples may be used.

        By importance sampling: Pareto's k and the effective samples pass. By NUTS: all chains
        agree, and none diverged. By both: no optimum is missing.
        """
        if self.faults:
            return False
        if self.method == IMPORTANCE:
            passes = self.pareto_k is not None and self.pareto_k <= importance.LARGEST_K
            return bool(passes and (self.effective >= LEAST_EFFECTIVE).all())
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
    *,
    method: str | None = None,
    scatter: Sequence[ArrayLike] = (),
    uniform: Sequence[str] = (),
) -> Posterior:
    """Samples the posterior of a fit.

    It uses importance sampling about all optima of the fit, and NUTS if that is not enough. Ctrl-C
    ends the first between two runs of the model, the second within half a second.

    Args:
      fit: a converged fit.
      seed: seed of all random numbers.
      samples: number of samples of each of the four NUTS chains, at least 4; importance sampling
        gives four times as many, too.
      checkpoint: folder that stores every fifty draws. A later call with the same arguments, on the
        same machine, goes on from there, and gives the same bits.
      progress: whether to show a time estimate and a progress bar, on standard error.
      method: `importance sampling` or `NUTS`, to use that one alone; by default NUTS follows if
        importance sampling is not enough.
      scatter: indices of the measurements of each group whose common error was estimated with the
        fit: the posterior allows for the uncertainty of that error.
      uniform: names of odds without a prior: their parameters are uniform between their bounds.

    Raises:
      InputError: a package is missing, the posterior has no end, the method is unknown, or the
        checkpoint is that of another posterior.

    Example:
      >>> import jax.numpy as jnp
      >>> def residuals(theta):
      ...     return (jnp.log(theta["a"])[None] - 1.0) / 0.1
      >>> fit = calibrate.fit(residuals, {"a": 2.0})
      >>> posterior = calibrate.inference.posterior.posterior(fit)
      >>> posterior.method, posterior.converged, round(float(np.log(posterior.samples).std()), 2)
      ('importance sampling', True, 0.1)
    """
    refuse_foreign(checkpoint)
    if samples < FEWEST:
        raise InputError(f"samples = {samples}: must be at least {FEWEST}, to compare two halves")
    if method is not None and method not in METHODS:
        raise InputError(f"method = {method!r}: must be one of {', '.join(map(repr, METHODS))}")
    refuse_without_sampler()
    density = Density(
        fit.everything,
        fit.given,
        fit.box,
        tuple(np.asarray(places, int) for places in scatter),
        np.array([fit.names.index(name) for name in uniform], int),
    )
    if endless := unbounded(fit, density):
        raise InputError(
            f"the posterior of {', '.join(endless)} has no end: no measurement and no prior "
            "bounds it; give log_standard_deviation, or standard_deviation with bounds"
        )
    stored = None
    if checkpoint is not None:
        stored = Checkpoint.open(
            Path(checkpoint),
            names=fit.names,
            values=fit.values,
            optima=[optimum.values for optimum in fit.optima],
            seed=seed,
            samples=samples,
            method=method,
            scatter=density.scatter,
            uniform=density.uniform,
            information=information(fit),
        )
        if (done := stored.load("samples")) is not None:
            return _from_arrays(fit, *done)
    with stoppable(), relaxed_promotion():
        optima = approximated(fit, density)
        with ModelRuns(density, stored, progress, importance.FIRST) as runs:
            work = _Work(fit, density, optima, runs, seed, samples, stored, progress)
            arrays, scalars = _sample(work, method)
    if stored is not None:
        stored.save("samples", arrays, scalars)
    return _from_arrays(fit, arrays, scalars)


class _Work(NamedTuple):
    """Inputs of both sampling methods."""

    fit: Fit
    density: Density
    optima: Optima
    runs: ModelRuns
    seed: int
    samples: int
    kept: Checkpoint | None
    progress: bool

    @property
    def faults(self) -> list[str]:
        """Faults that apply to both methods."""
        return [LOST] * bool(self.optima.lost)


Fields = tuple[dict[str, np.ndarray], dict[str, Any]]
"""Fields of a posterior: the arrays, and all others."""


def _sample(work: _Work, method: str | None) -> Fields:
    """Fields of a posterior, by importance sampling if that is requested or enough, or NUTS."""
    if method == NUTS:
        return _by_nuts(work, np.nan)
    weighted = importance.sample(work.runs, work.optima.proposal, work.fit.box, work.seed)
    faults = _ends_early(work, weighted.logs, weighted.weights)
    if (weighted.good and not faults) or method == IMPORTANCE:
        return _by_importance(work, weighted, faults)
    if work.fit.slopes is not None:
        return _by_importance(work, weighted, [*faults, WITHOUT_GRADIENT])
    return _by_nuts(work, weighted.pareto_k)


def _by_importance(work: _Work, weighted: Weighted, faults: list[str]) -> Fields:
    random = np.random.default_rng([work.seed, 1 + importance.ADAPTATIONS])
    size = work.fit.values.size
    arrays = {
        "samples": np.exp(weighted.equal(CHAINS * work.samples, random)),
        "r_hat": np.ones(size),
        "effective": np.full(size, weighted.effective),
        "pareto_k": np.array(weighted.pareto_k),
    }
    return arrays, {"divergences": 0, "method": IMPORTANCE, "faults": work.faults + faults}


def _by_nuts(work: _Work, pareto_k: float) -> Fields:
    number = CHAINS * (nuts.WARM_UP + work.samples) * nuts.STEPS
    # Off the optimum, so that the call is timed and not answered from memory.
    near = np.log(work.fit.values) * (1.0 - 1e-12) - 1e-12
    seconds_each = seconds_of(work.fit.linearised, near, work.fit.given)
    say_estimate(f"{number} gradients for NUTS", number, seconds_each, work.progress)
    drawn = nuts.sample(
        work.density,
        work.optima,
        work.runs,
        seed=work.seed,
        samples=work.samples,
        work=work.kept,
        progress=work.progress,
    )
    logs = drawn.logs.reshape(-1, work.fit.values.size)
    arrays = {
        "samples": np.exp(logs),
        "r_hat": diagnostics.r_hat(drawn.logs),
        "effective": diagnostics.effective(drawn.logs),
        "pareto_k": np.array(pareto_k),
    }
    faults = work.faults + [SEPARATED] * drawn.separated + _ends_early(work, logs)
    return arrays, {"divergences": drawn.divergences, "method": NUTS, "faults": faults}


def _ends_early(work: _Work, logs: np.ndarray, weights: np.ndarray | None = None) -> list[str]:
    """Sentences on values whose samples, (N, P), do not cover the posterior."""
    if len(logs) < importance.FEWEST:
        return []
    middle = np.average(logs, axis=0, weights=weights)
    covariance = np.atleast_2d(np.cov(logs.T, aweights=weights))
    names = ends_early(work.fit, work.density, middle, covariance)
    return [f"the posterior goes on beyond the samples of {', '.join(names)}"] * bool(names)


def _from_arrays(fit: Fit, arrays: dict[str, np.ndarray], scalars: dict[str, Any]) -> Posterior:
    """A posterior from its fields, stored or new."""
    k = float(arrays["pareto_k"])
    scalars = scalars | {"faults": tuple(scalars["faults"]), "pareto_k": None if np.isnan(k) else k}
    return Posterior(fit.names, **(arrays | scalars))


def refuse_without_sampler() -> None:
    """Refuses to sample without the optional packages.

    Raises:
      InputError: a package is missing.
    """
    for package in ("blackjax", "corner", "arviz_stats"):
        if importlib.util.find_spec(package) is None:
            name = package.replace("_", "-")
            raise InputError(f"posterior samples need {name}: pip install 'mrjax[posterior]'")
