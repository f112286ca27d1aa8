"""Convergence diagnostics of chains, by `arviz-stats`: R-hat and the number of effective samples.

Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Analysis 16, 667 (2021). Ranks make R-hat
finite for any tail. Split chains reveal a drift. Folded values, the distances from the median,
reveal chains that agree in their middle but not in their spread, such as a chain that never moves.
"""

import numpy as np


def r_hat(draws: np.ndarray) -> np.ndarray:
    """R-hat, (P,), the larger one of values and of folded values; NaN if no chain moved.

    Args:
      draws: draws of C chains, N each, (C, N, P).
    """
    from arviz_stats.base import array_stats

    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(array_stats.rhat(draws, chain_axis=0, draw_axis=1))


def effective(draws: np.ndarray) -> np.ndarray:
    """Number of effective draws in middle or tails, the smaller one, (P,), of draws (C, N, P)."""
    from arviz_stats.base import array_stats

    axes = {"chain_axis": 0, "draw_axis": 1}
    middle = array_stats.ess(draws, **axes)
    return np.minimum(middle, array_stats.ess(draws, **axes, method="tail", prob=(0.05, 0.95)))
