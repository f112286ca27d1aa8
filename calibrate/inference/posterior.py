"""Samples of the posterior, with what tells whether they are to be trusted.

Importance sampling comes first: it needs some hundred runs of the model where the posterior is near
what the curvature at its optima says. Where Pareto's k says that it is not, chains of NUTS follow
(blackjax), which need gradients by the ten thousand.
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
"""Samples of a chain whose halves can be compared."""
LARGEST_R_HAT = 1.01
"""Vehtari et al. (2021): beyond it the samples are not to be used."""
IMPORTANCE, NUTS = "importance sampling", "NUTS"
METHODS = IMPORTANCE, NUTS

SEPARATED = (
    "the optima are separated: chains do not go from one to another, so that their weights are not "
    "known"
)
LOST = (
    "an optimum that a cheap model found could not be looked at by the model itself, so that a "
    "part of the posterior may be missing"
)
WITHOUT_GRADIENT = (
    "weights are too uneven, and JAX does not trace the model, so that NUTS cannot take over"
)


@dataclass(frozen=True)
class Posterior:
    """Draws of all fitted values, of equal weight."""

    names: tuple[str, ...]
    samples: np.ndarray
    """Values, not logarithms; (CHAINS * SAMPLES, P), by NUTS chain after chain."""
    r_hat: np.ndarray
    """Spread between chains over that within them, 1 when they agree: split, by ranks, and the
    greater of that of values and of their distances from the median; (P,). 1 by importance
    sampling, which has no chains."""
    effective: np.ndarray
    """Independent samples that they are worth, in their middle or tails, the less; (P,). By
    importance sampling (sum w)^2 / sum w^2 of the weights w before they were made equal."""
    divergences: int
    """Steps that left the posterior; not 0: a part of it may be missing."""
    method: str = NUTS
    """`importance sampling` or `NUTS`."""
    pareto_k: float | None = None
    """Shape of the tail of the weights of importance sampling, also where NUTS followed it."""
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

    By importance sampling about all of its optima, and where that is not enough by NUTS. Both stop
    between two runs of the model, or pieces of half a second.

    Args:
      fit: converged.
      seed: of all random numbers.
      samples: a quarter of those that are given; 4 at least. NUTS has four chains.
      checkpoint: folder that keeps every fifty draws. Called again with it and the same arguments,
        on the same machine, the work goes on, and ends with the same bits.
      progress: whether to show a progress bar, and before it how long it may take, on standard
        error.
      method: `importance sampling` or `NUTS` alone; left out, the one and if need be the other.
      scatter: places of the measurements whose common scale was estimated, by group: the scale is
        not taken as known.
      uniform: names of odds without a prior, whose shares may be anywhere alike.

    Raises:
      InputError: a package is not installed, the posterior has no end, no such method, or a
        checkpoint of another.

    Example:
      >>> import jax.numpy as jnp
      >>> def residuals(theta):
      ...     return (jnp.log(theta["a"])[None] - 1.0) / 0.1
      >>> found = calibrate.inference.posterior.posterior(calibrate.fit(residuals, {"a": 2.0}))
      >>> found.method, found.converged, round(float(np.log(found.samples).std()), 2)
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
        stored = Checkpoint.of_work(
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
            return _of_arrays(fit, *done)
    with stoppable(), relaxed_promotion():
        optima = approximated(fit, density)
        with ModelRuns(density, stored, progress, importance.FIRST) as runs:
            work = _Work(fit, density, optima, runs, seed, samples, stored, progress)
            arrays, scalars = _sampled(work, method)
    if stored is not None:
        stored.save("samples", arrays, scalars)
    return _of_arrays(fit, arrays, scalars)


class _Work(NamedTuple):
    """What both ways of sampling need."""

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
        """Faults of both ways."""
        return [LOST] * bool(self.optima.lost)


Fields = tuple[dict[str, np.ndarray], dict[str, Any]]
"""Fields of a posterior: arrays, and the others."""


def _sampled(work: _Work, method: str | None) -> Fields:
    """The fields of a posterior, by importance sampling if that is asked for or enough."""
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
    # Moved, so that it is not recalled from the fit.
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
    """Sentences on values beyond whose samples, (N, P), the posterior goes on."""
    if len(logs) < importance.FEWEST:
        return []
    middle = np.average(logs, axis=0, weights=weights)
    covariance = np.atleast_2d(np.cov(logs.T, aweights=weights))
    names = ends_early(work.fit, work.density, middle, covariance)
    return [f"the posterior goes on beyond the samples of {', '.join(names)}"] * bool(names)


def _of_arrays(fit: Fit, arrays: dict[str, np.ndarray], scalars: dict[str, Any]) -> Posterior:
    """A posterior from its fields, kept or new."""
    k = float(arrays["pareto_k"])
    scalars = scalars | {"faults": tuple(scalars["faults"]), "pareto_k": None if np.isnan(k) else k}
    return Posterior(fit.names, **(arrays | scalars))


def refuse_without_sampler() -> None:
    """Refuses to sample where an optional package is not installed.

    Raises:
      InputError: one is missing.
    """
    for package in ("blackjax", "corner", "arviz_stats"):
        if importlib.util.find_spec(package) is None:
            name = package.replace("_", "-")
            raise InputError(f"posterior samples need {name}: pip install 'mrjax[posterior]'")
