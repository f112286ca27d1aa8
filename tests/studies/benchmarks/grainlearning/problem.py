"""v(phi) = v_0 / f_s (1 - phi)^n from eight velocities: they determine v_0 / f_s and n alone.

Means and standard deviations of the exact posteriors are sums over a grid.
"""

from dataclasses import dataclass

import numpy as np

TRUTH = {"v_0": 8.0, "f_s": 1.25, "n": 4.65}
"""mm/day, 1, 1."""
FRACTIONS = np.linspace(0.02, 0.30, 8)
NOISE = 0.02
"""Standard deviation of every velocity as a part of the true one."""
SEEDS = range(10)
RANGE = 3.0
"""Where the search starts, or how far it goes to either side: this many times too high or low."""
QUANTITIES = ("v_0", "f_s", "n", "v_0 / f_s")
NODES = 101


@dataclass(frozen=True)
class Moments:
    """Of the quantities, in their order; (4,) each."""

    mean: np.ndarray
    deviation: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray, weights: np.ndarray | None = None) -> "Moments":
        """Of values (4, S) with weights (S,)."""
        mean = np.average(values, axis=1, weights=weights)
        spread = np.average((values - mean[:, None]) ** 2, axis=1, weights=weights)
        return cls(mean, np.sqrt(spread))


def velocity(v_0, f_s, n):
    """At all volume fractions, (..., 8) in mm/day."""
    v_0, f_s, n = (np.asarray(one)[..., None] for one in (v_0, f_s, n))
    return v_0 / f_s * (1.0 - FRACTIONS) ** n


def errors() -> np.ndarray:
    """Standard deviations of the velocities, (8,) in mm/day."""
    return NOISE * velocity(**TRUTH)


def measured(seed: int) -> np.ndarray:
    """Synthetic velocities with noise, (8,) in mm/day."""
    return velocity(**TRUTH) + errors() * np.random.default_rng(seed).standard_normal(8)


def uniform_posterior(data: np.ndarray) -> Moments:
    """With a prior that is the same everywhere within `RANGE`."""

    def density(v_0, f_s, n):
        inside = np.abs(np.log(v_0 / TRUTH["v_0"])) <= np.log(RANGE)
        return inside * f_s  # of (v_0 / f_s, f_s), where that of (v_0, f_s) is even

    return _on_a_grid(data, np.linspace(1 / RANGE, RANGE, NODES), density)


def log_normal_posterior(data: np.ndarray, log_standard_deviation: float) -> Moments:
    """With the prior of a fit: log-normal about the truth."""

    def density(v_0, f_s, n):
        off = zip((v_0, f_s, n), TRUTH.values(), strict=True)
        square = sum((np.log(value / true) / log_standard_deviation) ** 2 for value, true in off)
        # Even nodes in v_0 / f_s, f_s and n, and a density of logarithms.
        return np.exp(-0.5 * square) / (v_0 * n)

    return _on_a_grid(data, np.linspace(0.02, 12.0, 3 * NODES), density)


def _on_a_grid(data: np.ndarray, f_s: np.ndarray, density) -> Moments:
    """f_s as multiples of the truth; the others up to where no likelihood is left."""
    ratio = TRUTH["v_0"] / TRUTH["f_s"] * np.linspace(0.85, 1.15, NODES)
    exponent = TRUTH["n"] + np.linspace(-0.6, 0.6, NODES)
    ratio, f_s, n = np.meshgrid(ratio, TRUTH["f_s"] * f_s, exponent, indexing="ij")
    square = sum(
        ((ratio * (1.0 - fraction) ** n - one) / error) ** 2
        for fraction, one, error in zip(FRACTIONS, data, errors(), strict=True)
    )
    v_0 = ratio * f_s
    weight = np.exp(-0.5 * (square - square.min())) * density(v_0, f_s, n)
    return Moments.of(np.stack([one.ravel() for one in (v_0, f_s, n, ratio)]), weight.ravel())
