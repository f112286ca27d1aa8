"""Products of powers of parameters as text, and the simplest basis of a space of them."""

from fractions import Fraction

import numpy as np

from calibrate.inference.curvature import RANK_TOLERANCE

SIMPLE = 6
"""Largest denominator of an exponent that is read as a fraction."""

SIMPLE_WITHIN = 1e-6
"""Largest distance to such a fraction; simulated velocities follow power laws more closely."""

NEGLIGIBLE = 0.01
"""Exponent, over the largest one of its product, below which a factor is left out."""


def expression(names: tuple[str, ...], exponents: np.ndarray) -> str:
    """A product of powers as text: `f_w * f_s / f_v`."""

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


def without_negligible(exponents: np.ndarray) -> np.ndarray:
    """Exponents of a product, (P,), with negligible ones set to zero."""
    return np.where(np.abs(exponents) < NEGLIGIBLE * np.abs(exponents).max(), 0.0, exponents)


def simplest_basis(basis: np.ndarray) -> np.ndarray:
    """The basis of a space with most zeros and simplest numbers (reduced row echelon form)."""
    rows = np.array(basis, float)
    done = 0
    for column in range(rows.shape[1]):
        if done == len(rows):
            break
        size = np.abs(rows[done:])
        share = size[:, column] / np.maximum(size.max(axis=1), np.finfo(float).tiny)
        pivot = done + int(np.argmax(size[:, column]))
        last = rows.shape[1] - column == len(rows) - done  # every column left has to be a pivot
        if abs(rows[pivot, column]) < RANK_TOLERANCE or (share.max() < NEGLIGIBLE and not last):
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
