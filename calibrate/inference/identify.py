"""Identifiability: the values, and the products of powers of values, that the data determine.

Let J be the Jacobian of the residuals with respect to the logarithms of the values. Its singular
directions are products of powers of the values. A product is determined if the error of its
logarithm by the data alone (`data_errors`) is small, or small compared with that of its prior. The
same holds for a single value. A change along the null space of J changes no prediction near the
fit: there the priors alone fix the values.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtrc

from calibrate.inference.curvature import RANK_TOLERANCE, UNKNOWN, standard_errors
from calibrate.inference.data_errors import data_errors
from calibrate.inference.products import expression, simplest_basis, without_negligible
from calibrate.least_squares.fit import Fit

DETERMINED, INFORMED = 1.0 / 3.0, 2.0
"""Largest error by the data alone, over the standard deviation of the prior, for these statuses."""

LARGEST_CHI_SQUARED = 4.0
"""Chi-squared for each degree of freedom beyond which a fit is a misfit: residuals of two standard
deviations."""
MUCH_WIDER = 1.5
"""Ratio of the error by a profile to that by slopes above which the slopes mislead."""
NOT_EXCLUDED = 3.84
"""Rise of chi-squared up to which the data do not exclude another optimum, at 95 %."""
BY_CHANCE = 1e-3
"""p-value above which a large chi-squared with few degrees of freedom is chance."""
WITHOUT_PRIOR = 0.5
"""Largest error of a logarithm by the data alone of a determined value without a prior."""


@dataclass(frozen=True)
class Combination:
    """A product of powers of the fitted values."""

    expression: str
    """The product as text, such as `f_w * f_s`."""
    exponents: dict[str, float]
    """Exponents of the values that occur in it, by name."""
    value: float
    """Value of the product at the fit."""
    standard_error: float
    """Standard error of that value, from the measurements alone."""


@dataclass(frozen=True)
class Identification:
    """Identifiability of the values of a fit."""

    singular_values: np.ndarray
    """Singular values of the Jacobian, (min(M, P),)."""
    combinations: tuple[Combination, ...]
    """Independent products of powers that the data determine."""
    null_directions: tuple[str, ...]
    """Products of powers that change no prediction near the fit."""
    determined: dict[str, bool]
    """True for a value that the data determine by itself."""
    standard_errors: dict[str, float]
    """Standard error of each value, from data and prior together; infinite if neither bounds it. It
    follows from slopes, and is wider if a profile or another optimum is."""
    data_standard_errors: dict[str, float]
    """Error of each logarithm by the data alone: half of its 68 % profile interval, or the distance
    to another optimum that the data do not exclude, if that is larger. It is infinite if one end of
    the interval is not found."""
    status: dict[str, str]
    """Status of each value.

    It follows from the error of the logarithm by the data alone. With a prior a value is
    `determined` up to a third of the prior's standard deviation, `informed` up to twice, and else
    `prior only`. Without a prior it is `determined` up to 0.5, and else `free`.
    """
    weak_combinations: tuple[str, ...] = ()
    """Products of powers of which the data say too little to determine them."""
    near_combinations: tuple[Combination, ...] = ()
    """Products of powers that the data determine only near this fit, because the valley bends."""
    null_exponents: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    """Exponents of the null directions, (K, P)."""
    error_scale: float = 1.0
    """Factor on the errors by the data alone; above 1 if the data do not fit."""
    widening: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """Error of each value by a profile over that by slopes, data and priors together, (P,); at
    least 1."""


def identify(fit: Fit) -> Identification:
    """Finds the values and combinations that the data of a fit determine.

    Nothing is determined if a residual or a slope is not a number.

    Example:
      >>> def residuals(theta):
      ...     return (theta["a"] * theta["b"] - jnp.array([5.9, 6.1])) / 0.1
      >>> result = calibrate.identify(calibrate.fit(residuals, {"a": 1.0, "b": 1.0}))
      >>> [product.expression for product in result.combinations], result.null_directions
      (['a * b'], ('a / b',))
    """
    jacobian, values = fit.jacobian, fit.values
    if not (np.isfinite(jacobian).all() and np.isfinite(fit.residuals).all()):
        jacobian = np.zeros_like(jacobian)
    _, singular, rows = np.linalg.svd(jacobian, full_matrices=True)
    rank = int(np.sum(singular > RANK_TOLERANCE * max(singular[0], np.finfo(float).tiny)))
    from_data = np.linalg.pinv(jacobian.T @ jacobian, rcond=RANK_TOLERANCE**2, hermitian=True)
    errors = np.full(len(rows), np.inf)
    errors[:rank] = 1.0 / singular[:rank]
    known = errors < UNKNOWN
    size = values.size
    scale = _error_scale(fit, rank)
    near_by = scale * errors
    directions = np.vstack([np.eye(size), rows[known]])
    by_profile = data_errors(fit, directions, scale**2)
    by_profile = np.maximum(by_profile, _distances_to_optima(fit, directions, scale))
    errors[known] = by_profile[size:]
    widening = _widening(fit, by_profile[:size], scale * np.sqrt(np.diag(from_data)))
    limits = np.array(
        [_largest_determined_error(direction, fit.prior_precision) for direction in rows]
    )
    seen = errors <= limits
    near = ~seen & (near_by <= limits)

    def combination(exponents: np.ndarray) -> Combination:
        main_exponents = without_negligible(exponents)
        value = float(np.exp(main_exponents @ np.log(values)))
        return Combination(
            expression(fit.names, main_exponents),
            {n: float(e) for n, e in zip(fit.names, main_exponents, strict=True) if e},
            value,
            value * float(np.sqrt(exponents @ from_data @ exponents)),
        )

    by_data = dict(zip(fit.names, map(float, by_profile[:size]), strict=True))
    status = {
        name: _status(by_data[name], precision)
        for name, precision in zip(fit.names, fit.prior_precision, strict=True)
    }
    unseen_directions = simplest_basis(rows[~known])
    return Identification(
        singular_values=singular,
        combinations=tuple(combination(row) for row in simplest_basis(rows[seen])),
        null_directions=tuple(
            expression(fit.names, without_negligible(row)) for row in unseen_directions
        ),
        null_exponents=unseen_directions,
        determined={name: word == "determined" for name, word in status.items()},
        standard_errors=widened_errors(fit, widening),
        data_standard_errors=by_data,
        status=status,
        error_scale=scale,
        widening=widening,
        weak_combinations=tuple(
            expression(fit.names, np.round(without_negligible(row), 2))
            for row in simplest_basis(rows[known & ~seen & ~near])
        ),
        near_combinations=tuple(combination(row) for row in simplest_basis(rows[near])),
    )


def _error_scale(fit: Fit, rank: int) -> float:
    """Factor by which the errors are too small if the data contradict the model; else 1."""
    free = fit.residuals.size - rank
    if free < 1 or chdtrc(free, fit.chi_squared) > BY_CHANCE:
        return 1.0
    reduced = fit.chi_squared / free
    return float(reduced**0.5) if reduced > LARGEST_CHI_SQUARED else 1.0


def widened_errors(fit: Fit, widening: np.ndarray, error_scale: float = 1.0) -> dict[str, float]:
    """Standard errors of the values by slopes, widened by profiles and by other optima.

    Args:
      fit: the fit.
      widening: `Identification.widening`, (P,).
      error_scale: factor on the errors of the measurements.
    """
    apart = _distances_to_optima(fit, np.eye(fit.values.size), error_scale)
    with np.errstate(divide="ignore"):
        widest = fit.prior_precision**-0.5
    by_slopes = standard_errors(fit, error_scale)
    return {
        name: max(error, value * min(max(error / value * factor, distance), most))
        for (name, error), value, factor, distance, most in zip(
            by_slopes.items(), fit.values, widening, apart, widest, strict=True
        )
    }


def _widening(fit: Fit, by_data: np.ndarray, by_slopes: np.ndarray) -> np.ndarray:
    """Ratios of errors by profiles to errors by slopes, data and priors together, (P,); at least 1.

    A reading at the edge of a front has a steep slope and says little, as nothing changes beyond
    the front. A profile is computed only if the profile of the data alone is much wider than their
    slopes say.

    Args:
      fit: the fit.
      by_data, by_slopes: errors of the logarithms by the data alone, by profiles and by slopes,
        (P,).
    """
    wider = np.ones(by_data.size)
    slopes = np.array(list(standard_errors(fit).values())) / fit.values
    chosen = np.isfinite(by_data) & np.isfinite(slopes) & (by_slopes > 0.0)
    chosen &= by_data > MUCH_WIDER * by_slopes
    if not chosen.any():
        return wider
    end = fit.at(np.log(fit.values))
    with_priors = replace(fit, residuals=end.value, jacobian=end.jacobian)  # priors as measurements
    profile = data_errors(with_priors, np.eye(by_data.size)[chosen], 1.0)
    wider[chosen] = np.maximum(profile / slopes[chosen], 1.0)
    return wider


def _distances_to_optima(fit: Fit, directions: np.ndarray, scale: float) -> np.ndarray:
    """Largest distance of each product, (K,), to another optimum that the data do not exclude."""
    most = fit.chi_squared + NOT_EXCLUDED * scale**2
    ways = [
        np.log(optimum.values / fit.values)
        for optimum in fit.optima[1:]
        if optimum.finished and optimum.chi_squared < most
    ]
    apart = np.abs(directions @ np.reshape(ways, (-1, fit.values.size)).T)
    return np.asarray(apart.max(axis=1, initial=0.0))


def _largest_determined_error(direction: np.ndarray, precision: np.ndarray) -> float:
    """Largest error by the data alone of the logarithm of a determined product of powers."""
    if np.any(np.abs(direction[precision == 0.0]) > RANK_TOLERANCE):
        return WITHOUT_PRIOR
    return DETERMINED * float(np.sqrt(np.sum(direction**2 / np.where(precision, precision, 1.0))))


def _status(error: float, precision: float) -> str:
    """Status of a value, from its error by the data alone and the precision of its prior."""
    if not precision:
        return "determined" if error <= WITHOUT_PRIOR else "free"
    share = error * np.sqrt(precision)
    return (
        "determined" if share <= DETERMINED else "informed" if share <= INFORMED else "prior only"
    )
