"""Samples of the posterior by NUTS (blackjax), with what tells whether they are to be trusted.

The posterior of the logarithms is exp(-chi^2 / 2) with the priors among the residuals. It often
is a long ridge: the mass matrix is dense, and begins as the curvature at the optimum.
"""

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from calibrate.fit import Fit
from calibrate.identify import identify, information
from mrjax import InputError, randomness
from mrjax.checkpoint import Checkpoint, refuse_foreign
from mrjax.permissive import permissive

CHAINS, WARM_UP, SAMPLES = 4, 300, 500
LARGEST_R_HAT, LEAST_EFFECTIVE = 1.01, 400.0
"""Vehtari et al. (2021): beyond these the samples are not to be used."""


@dataclass(frozen=True)
class Posterior:
    """Draws of all fitted values."""

    names: tuple[str, ...]
    samples: np.ndarray
    """Values, not logarithms; (CHAINS * SAMPLES, P)."""
    r_hat: np.ndarray
    """Spread between chains over that within them, 1 when they agree; (P,)."""
    effective: np.ndarray
    """Independent samples that they are worth, (P,)."""
    divergences: int
    """Steps that left the posterior; not 0: a part of it may be missing."""

    @property
    def converged(self) -> bool:
        """Whether the samples may be used."""
        return bool(
            (self.r_hat < LARGEST_R_HAT).all()
            and (self.effective > LEAST_EFFECTIVE).all()
            and self.divergences == 0
        )


def posterior(
    fit: Fit, seed: int = 0, samples: int = SAMPLES, checkpoint: str | Path | None = None
) -> Posterior:
    """Samples the posterior of a fit.

    Args:
      fit: converged.
      seed: of the chains.
      samples: of each of the four chains.
      checkpoint: folder that keeps the samples when they are drawn, all at once.

    Raises:
      InputError: blackjax is not installed, the posterior has no end, or a checkpoint of another.
    """
    refuse_foreign(checkpoint)
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
        if (kept := work.kept("samples")) is not None:
            return _of_arrays(fit, kept[0])
    import blackjax

    whitened, best = _whitening(fit)

    def log_density(position: Array) -> Array:
        return -0.5 * jnp.sum(fit.everything(best + whitened @ position, fit.given) ** 2)

    def chain(key: Array) -> tuple[Array, Array]:
        first, adapting, drawing = jax.random.split(key, 3)
        adaptation = blackjax.window_adaptation(
            blackjax.nuts, log_density, is_mass_matrix_diagonal=False
        )
        position = jax.random.normal(first, best.shape, best.dtype)
        (state, tuned), _ = adaptation.run(adapting, position, num_steps=WARM_UP)
        kernel = blackjax.nuts(log_density, **tuned)

        def step(state: Any, key: Array) -> tuple[Any, tuple[Array, Array]]:
            state, info = kernel.step(key, state)
            return state, (state.position, info.is_divergent)

        _, drawn = jax.lax.scan(step, state, jax.random.split(drawing, samples))
        return drawn

    with permissive(), randomness.ordered():
        keys = jax.random.split(randomness.key(seed), CHAINS)
        drawn, divergent = jax.jit(jax.vmap(chain))(keys)
        logs = best + drawn @ whitened.T
        r_hat = blackjax.diagnostics.potential_scale_reduction(logs)
        effective = blackjax.diagnostics.effective_sample_size(logs)
    arrays = {
        "samples": np.exp(np.asarray(logs)).reshape(-1, best.size),
        "r_hat": np.asarray(r_hat),
        "effective": np.asarray(effective),
        "divergences": np.asarray(divergent.sum()),
    }
    if work is not None:
        work.keep("samples", arrays)
    return _of_arrays(fit, arrays)


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
    """Passes where the optional packages are installed.

    Raises:
      InputError: they are not.
    """
    for package in ("blackjax", "corner"):
        if importlib.util.find_spec(package) is None:
            raise InputError(f"posterior samples need {package}: pip install 'mrjax[posterior]'")


def _refuse_without_end(fit: Fit) -> None:
    unbounded = [name for name, one in identify(fit).standard_errors.items() if np.isinf(one)]
    if unbounded:
        raise InputError(
            f"the posterior of {', '.join(unbounded)} has no end: no measurement and no prior "
            "bounds it; give log_standard_deviation, or standard_deviation with bounds"
        )


def _whitening(fit: Fit) -> tuple[Array, Array]:
    """A square root of the covariance at the optimum, (P, P), and the optimum, (P,), in logs."""
    strength, directions = np.linalg.eigh(information(fit))
    return jnp.asarray(directions / np.sqrt(strength)), jnp.log(jnp.asarray(fit.values))
