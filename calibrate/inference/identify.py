"""Identifiability: which values, and which products of powers, the data determine.

The singular directions of the Jacobian J of the residuals with respect to the logarithms of the
values are the products of powers to look at. Each is determined where the error that the data alone
leave its logarithm (`data_errors`) is small by itself, or beside what a prior says of it; and so is
each value. Moving along the null space of J changes no prediction near the fit, and only the priors
say where on it to be.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtrc

from calibrate.inference.curvature import RANK_TOLERANCE, UNKNOWN, standard_errors
from calibrate.inference.data_errors import data_errors
from calibrate.inference.products import expression, simplest_basis, without_negligible
from calibrate.least_squares.fit import Fit

DETERMINED, INFORMED = 1.0 / 3.0, 2.0
"""Largest error by the data alone over a prior's standard deviation of what is called so."""

LARGEST_CHI_SQUARED = 4.0
"""Of a degree of freedom, two standard deviations each: beyond it a fit is called a misfit."""
MUCH_WIDER = 1.5
"""Error by a profile over that by slopes from which slopes mislead."""
NOT_EXCLUDED = 3.84
"""Rise of chi-squared up to which the data exclude no other optimum, in 95 % of cases."""
BY_CHANCE = 1e-3
"""p-value from which a large chi-squared of few degrees of freedom is chance."""
WITHOUT_PRIOR = 0.5
"""Largest error of a logarithm by the data alone of what is determined and has no prior."""


@dataclass(frozen=True)
class Combination:
    """A product of powers of the fitted values."""

    expression: str
    """In words, such as `f_w * f_s`."""
    exponents: dict[str, float]
    """Exponents of the values that occur in it, by name."""
    value: float
    """At the end of the fit."""
    standard_error: float
    """From the measurements alone."""


@dataclass(frozen=True)
class Identification:
    """Identifiability of the values of a fit."""

    singular_values: np.ndarray
    """Singular values of the Jacobian, (min(M, P),)."""
    combinations: tuple[Combination, ...]
    """As many independent products of powers as the data determine."""
    null_directions: tuple[str, ...]
    """Products of powers of which the data say nothing."""
    determined: dict[str, bool]
    """True where the data determine this value by itself."""
    standard_errors: dict[str, float]
    """Standard error of each value, data and prior together; infinite where both are silent. By
    slopes, or wider where a profile or another optimum is."""
    data_standard_errors: dict[str, float]
    """Standard error of each logarithm by the data alone: half of its 68 % profile interval, or the
    distance to another optimum that the data do not exclude, where that is farther; infinite where
    one end of the interval is not found."""
    status: dict[str, str]
    """Status of each value.

    With a prior, by the error that the data alone leave: `determined` up to a third of the prior's,
    `informed` up to twice, else `prior only`; without: `determined` up to 0.5 in the logarithm,
    else `free`.
    """
    weak_combinations: tuple[str, ...] = ()
    """Products of powers of which the data say something, and too little to determine them."""
    near_combinations: tuple[Combination, ...] = ()
    """Products of powers that the data determine near this fit alone: the valley bends."""
    null_exponents: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    """Exponents of the null directions, (K, P)."""
    error_scale: float = 1.0
    """By what the errors by the data alone are scaled: above 1 where the data do not fit."""
    widening: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """How many times wider profiles, by data and priors, are than slopes say, (P,); 1 or more."""


def identify(fit: Fit) -> Identification:
    """Reads off a fit what its data determine; nothing, where a residual or slope is no number.

    Example:
      >>> def residuals(theta):
      ...     return (theta["a"] * theta["b"] - jnp.array([5.9, 6.1])) / 0.1
      >>> found = calibrate.identify(calibrate.fit(residuals, {"a": 1.0, "b": 1.0}))
      >>> [one.expression for one in found.combinations], found.null_directions
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
    by_profile = np.maximum(by_profile, _between_optima(fit, directions, scale))
    errors[known] = by_profile[size:]
    widening = _widening(fit, by_profile[:size], scale * np.sqrt(np.diag(from_data)))
    limits = np.array([_limit(direction, fit.prior_precision) for direction in rows])
    seen = errors <= limits
    near = ~seen & (near_by <= limits)

    def combination(exponents: np.ndarray) -> Combination:
        exponents_in_words = without_negligible(exponents)
        value = float(np.exp(exponents_in_words @ np.log(values)))
        return Combination(
            expression(fit.names, exponents_in_words),
            {n: float(e) for n, e in zip(fit.names, exponents_in_words, strict=True) if e},
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
    """By what errors are too small where the data contradict the model; else 1."""
    free = fit.residuals.size - rank
    if free < 1 or chdtrc(free, fit.chi_squared) > BY_CHANCE:
        return 1.0
    reduced = fit.chi_squared / free
    return float(reduced**0.5) if reduced > LARGEST_CHI_SQUARED else 1.0


def widened_errors(fit: Fit, widening: np.ndarray, error_scale: float = 1.0) -> dict[str, float]:
    """Standard errors of values: by slopes, or wider where profiles or other optima are.

    Args:
      fit: where it ended.
      widening: that of `Identification`, (P,).
      error_scale: how many times as large as stated the errors of the readings are.
    """
    apart = _between_optima(fit, np.eye(fit.values.size), error_scale)
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
    """How many times wider profiles, by data and priors, are than slopes say, (P,); 1 or more.

    A reading on the edge of a front has a steep slope, and says little: beyond it nothing changes.
    Looked at where the profile of the data alone is much wider than their slopes say.

    Args:
      fit: where it ended.
      by_data, by_slopes: errors of the logarithms by the data alone, (P,).
    """
    wider = np.ones(by_data.size)
    slopes = np.array(list(standard_errors(fit).values())) / fit.values
    chosen = np.isfinite(by_data) & np.isfinite(slopes) & (by_slopes > 0.0)
    chosen &= by_data > MUCH_WIDER * by_slopes
    if not chosen.any():
        return wider
    end = fit.at(np.log(fit.values))
    with_priors = replace(fit, residuals=end.value, jacobian=end.jacobian)  # as if measured, too
    profile = data_errors(with_priors, np.eye(by_data.size)[chosen], 1.0)
    wider[chosen] = np.maximum(profile / slopes[chosen], 1.0)
    return wider


def _between_optima(fit: Fit, directions: np.ndarray, scale: float) -> np.ndarray:
    """Distances of products, (K,), from the fit to the optima that the data do not exclude."""
    most = fit.chi_squared + NOT_EXCLUDED * scale**2
    ways = [
        np.log(optimum.values / fit.values)
        for optimum in fit.optima[1:]
        if optimum.finished and optimum.chi_squared < most
    ]
    apart = np.abs(directions @ np.reshape(ways, (-1, fit.values.size)).T)
    return np.asarray(apart.max(axis=1, initial=0.0))


def _limit(direction: np.ndarray, precision: np.ndarray) -> float:
    """Largest error by the data of a determined product of powers, in its logarithm."""
    if np.any(np.abs(direction[precision == 0.0]) > RANK_TOLERANCE):
        return WITHOUT_PRIOR
    return DETERMINED * float(np.sqrt(np.sum(direction**2 / np.where(precision, precision, 1.0))))


def _status(error: float, precision: float) -> str:
    if not precision:
        return "determined" if error <= WITHOUT_PRIOR else "free"
    share = error * np.sqrt(precision)
    return (
        "determined" if share <= DETERMINED else "informed" if share <= INFORMED else "prior only"
    )
