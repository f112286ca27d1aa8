"""What the data determine: which combinations of the fitted values, and which not at all.

Read from the Jacobian J of the residuals with respect to the logarithms of the values. A product
of powers, exp(c . ln theta), is determined by the data where c lies in the row space of J; moving
along the null space of J changes no prediction, and only the priors say where on it to be.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from calibrate.fit import Fit

RANK_TOLERANCE = 1e-6
"""Singular values below this part of the largest count as zero: a direction in which the data
would have to be a million times better to say anything."""

SIMPLE = 6
"""Largest denominator of an exponent that is read as a fraction."""

SIMPLE_WITHIN = 1e-6
"""How close to it: a simulated velocity follows a power law to better than this."""


@dataclass(frozen=True)
class Combination:
    """A product of powers of the fitted values."""

    expression: str
    """In words, such as `f_w * f_s`."""
    exponents: dict[str, float]
    """Of the values that occur in it, by name."""
    value: float
    """At the end of the fit."""
    standard_error: float
    """From the measurements alone."""


@dataclass(frozen=True)
class Identification:
    """What the data of a fit determine, and how well."""

    singular_values: np.ndarray
    """Of the Jacobian, (min(M, P),)."""
    combinations: tuple[Combination, ...]
    """As many independent products of powers as the data determine."""
    null_directions: tuple[str, ...]
    """Products of powers of which the data say nothing."""
    determined: dict[str, bool]
    """Whether the data determine this value by itself."""
    standard_errors: dict[str, float]
    """Of each value, data and prior together; infinite where neither says anything."""


def identify(fit: Fit) -> Identification:
    """Reads off a fit what its data determine.

    Example:
      >>> def residuals(theta):
      ...     return (theta["a"] * theta["b"] - jnp.array([5.9, 6.1])) / 0.1
      >>> found = calibrate.identify(calibrate.fit(residuals, {"a": 1.0, "b": 1.0}))
      >>> [one.expression for one in found.combinations], found.null_directions
      (['a * b'], ('a / b',))
    """
    jacobian, values = fit.jacobian, fit.values
    _, singular, rows = np.linalg.svd(jacobian, full_matrices=True)
    rank = int(np.sum(singular > RANK_TOLERANCE * max(singular[0], np.finfo(float).tiny)))
    seen, unseen = rows[:rank], rows[rank:]
    from_data = np.linalg.pinv(jacobian.T @ jacobian, rcond=RANK_TOLERANCE**2, hermitian=True)

    def combination(exponents: np.ndarray) -> Combination:
        value = float(np.exp(exponents @ np.log(values)))
        return Combination(
            expression(fit.names, exponents),
            {n: float(e) for n, e in zip(fit.names, exponents, strict=True) if e},
            value,
            value * float(np.sqrt(exponents @ from_data @ exponents)),
        )

    in_row_space = np.sum(seen**2, axis=0)
    return Identification(
        singular_values=singular,
        combinations=tuple(combination(row) for row in _tidy(seen)),
        null_directions=tuple(expression(fit.names, row) for row in _tidy(unseen)),
        determined={
            name: bool(share > 1 - RANK_TOLERANCE)
            for name, share in zip(fit.names, in_row_space, strict=True)
        },
        standard_errors=_standard_errors(fit),
    )


def expression(names: tuple[str, ...], exponents: np.ndarray) -> str:
    """A product of powers in words: `f_w * f_s / f_v`."""

    def power(name: str, exponent: float) -> str:
        size = abs(exponent)
        return name if size == 1 else f"{name}^{_readable(size)}"

    over = [power(n, e) for n, e in zip(names, exponents, strict=True) if e > 0]
    under = [power(n, e) for n, e in zip(names, exponents, strict=True) if e < 0]
    text = " * ".join(over) or "1"
    if not under:
        return text
    return f"{text} / {under[0]}" if len(under) == 1 else f"{text} / ({' * '.join(under)})"


def _readable(number: float) -> str:
    fraction = Fraction(number).limit_denominator(SIMPLE)
    if abs(number - float(fraction)) > SIMPLE_WITHIN:
        return f"{number:.3g}"
    return str(fraction) if fraction.denominator == 1 else f"({fraction})"


def _tidy(basis: np.ndarray) -> np.ndarray:
    """The same space, in the basis with most zeros and simple numbers (reduced row echelon)."""
    rows = np.array(basis, float)
    done = 0
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        pivot = done + int(np.argmax(np.abs(rows[done:, column])))
        if abs(rows[pivot, column]) < RANK_TOLERANCE:
            continue
        rows[[done, pivot]] = rows[[pivot, done]]
        rows[done] /= rows[done, column]
        for other in range(len(rows)):
            if other != done:
                rows[other] -= rows[other, column] * rows[done]
        done += 1
    fractions = [float(Fraction(x).limit_denominator(SIMPLE)) for x in rows.flat]
    simple = np.array(fractions).reshape(rows.shape)
    return np.where(np.abs(simple - rows) < SIMPLE_WITHIN, simple, rows)


def information(fit: Fit) -> np.ndarray:
    """Half the curvature of chi-squared, data and priors together, in the logarithms; (P, P)."""
    return fit.jacobian.T @ fit.jacobian + np.diag(fit.prior_precision)


def covariance(information: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the logarithms, (P, P), and the directions that nothing bounds and it leaves out, (P, K).

    Args:
      information: (P, P).
    """
    strength, directions = np.linalg.eigh(information)
    lost = strength < RANK_TOLERANCE**2 * max(strength[-1], np.finfo(float).tiny)
    variance = np.where(lost, 0.0, 1.0 / np.where(lost, 1.0, strength))
    return (directions * variance) @ directions.T, directions[:, lost]


def _standard_errors(fit: Fit) -> dict[str, float]:
    """From the curvature of data and priors together; logarithmic errors times the values."""
    spread, unbounded = covariance(information(fit))
    unknown = np.sum(unbounded**2, axis=1) > RANK_TOLERANCE
    return {
        name: float(np.inf if none else value * error)
        for name, value, error, none in zip(
            fit.names, fit.values, np.sqrt(np.diag(spread)), unknown, strict=True
        )
    }
