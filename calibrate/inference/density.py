"""The density of a posterior in the logarithms of the values, up to a constant factor.

With known errors it is exp(-chi^2 / 2), with the priors among the residuals. Two cases differ. If
the common scale s of n readings was estimated with the fit, s is integrated over Jeffreys' prior
1 / s; this leaves (sum r^2)^(-n / 2) of their residuals r, Student's t. A parameter with bounds and
without a prior is uniform between its bounds: with the odds x = share / (1 - share), ln x has the
density share (1 - share).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from calibrate.inference.curvature import RANK_TOLERANCE, UNKNOWN, covariance, information
from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.fit import Fit

WIDEST = float(np.log(1e6))
"""Largest distance of two bounds, in logarithms, at which they count as information on a value.
Physical bounds of most quantities are farther apart, and say nothing about it."""
VARIANCE_OF_LOGISTIC = np.pi**2 / 3.0
"""Variance of the log-odds of a share that is uniform between 0 and 1."""


class Density(NamedTuple):
    """The posterior of a fit in P logarithms, for M measurements and K priors."""

    everything: Callable[..., Array]
    """Function from logarithms, (P,), and `given` to residuals and priors, (M + K,)."""
    given: Any
    """Data and priors, as `everything` takes them."""
    box: Bounds
    """Bounds of the logarithms."""
    scatter: tuple[np.ndarray, ...] = ()
    """Indices of the measurements of each group whose common scale was estimated."""
    uniform: np.ndarray = np.zeros(0, int)
    """Indices of the log-odds without a prior."""

    def holds(self, logs: np.ndarray) -> np.ndarray:
        """True for logarithms, (..., P), within the bounds; (...,)."""
        return np.all((logs >= self.box.lower) & (logs <= self.box.upper), axis=-1)

    def log_density(self, logs: ArrayLike, residuals: ArrayLike) -> Array:
        """Log-density, (...,), of logarithms, (..., P), with their residuals, (..., M + K)."""
        logs, residuals = jnp.asarray(logs), jnp.asarray(residuals)
        total = -0.5 * (residuals**2).sum(-1)
        for places in self.scatter:
            squares = (residuals[..., places] ** 2).sum(-1)
            total += 0.5 * (squares - len(places) * jnp.log(squares))
        odds = logs[..., self.uniform]
        return total + (odds - 2.0 * jnp.logaddexp(0.0, odds)).sum(-1)

    def differentiable(self) -> Callable[[Array], Array]:
        """The log-density as a function of logarithms, (P,), with a gradient for NUTS.

        The gradient is taken in forward mode, as in the fit: some models have no reverse mode.
        """

        def plain(logs: Array) -> Array:
            return self.log_density(logs, self.everything(logs, self.given))

        def with_value(logs: Array) -> tuple[Array, Array]:
            value = plain(logs)
            return value, value

        def forwards(logs: Array) -> tuple[Array, Array]:
            gradient, value = jax.jacfwd(with_value, has_aux=True)(logs)
            return value, gradient

        def backwards(gradient: Array, change: Array) -> tuple[Array]:
            return (change * gradient,)

        log_density = jax.custom_vjp(plain)
        log_density.defvjp(forwards, backwards)
        return log_density

    def bounded_information(self, information: np.ndarray) -> np.ndarray:
        """Half the curvature of chi-squared, (P, P), with the information of the bounds added."""
        width = np.broadcast_to(self.box.upper - self.box.lower, len(information))
        precision = np.where(width <= WIDEST, 12.0 / width**2, 0.0)
        precision[self.uniform] = 1.0 / VARIANCE_OF_LOGISTIC
        return information + np.diag(precision)

    def reflected(self, logs: Array) -> Array:
        """Logarithms, (P,), reflected into the bounds.

        The density of the reflected logarithms is even about every bound, so that chains cross a
        bound as they cross any other point.
        """
        lower, upper = (np.broadcast_to(end, logs.shape) for end in self.box)
        width = upper - lower
        period = np.where(np.isfinite(width), 2.0 * width, 1.0)
        above = logs - np.where(np.isfinite(lower), lower, 0.0)
        below = np.where(np.isfinite(upper), upper, 0.0) - logs
        within = jnp.abs(jnp.mod(above + 0.5 * period, period) - 0.5 * period)
        folded = jnp.where(np.isfinite(upper), upper - jnp.abs(below), logs)
        folded = jnp.where(np.isfinite(lower), lower + jnp.abs(above), folded)
        return jnp.where(np.isfinite(width), lower + within, folded)


def unbounded(fit: Fit, density: Density) -> list[str]:
    """Names of the values that no measurement, prior or bound limits."""
    spread, free = covariance(density.bounded_information(information(fit)))
    return [
        name
        for name, error, share_of_free in zip(
            fit.names, np.sqrt(np.diag(spread)), free, strict=True
        )
        if share_of_free @ share_of_free > RANK_TOLERANCE or error > UNKNOWN
    ]
