"""Agreement of chains and what their draws are worth, by `arviz-stats`.

Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Analysis 16, 667 (2021). Ranks make R-hat
finite for any tail; half chains find one that drifts; distances from the median, folded, find
chains that agree in their middle and not in their spread, such as one that never moves.
"""

import numpy as np


def r_hat(draws: np.ndarray) -> np.ndarray:
    """The greater of R-hat of values and of folded values, (P,); not a number where none moved.

    Args:
      draws: of C chains of N draws each, (C, N, P).
    """
    from arviz_stats.base import array_stats

    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(array_stats.rhat(draws, chain_axis=0, draw_axis=1))


def effective(draws: np.ndarray) -> np.ndarray:
    """Independent draws that draws, (C, N, P), are worth, in their middle or tails; (P,)."""
    from arviz_stats.base import array_stats

    axes = {"chain_axis": 0, "draw_axis": 1}
    middle = array_stats.ess(draws, **axes)
    return np.minimum(middle, array_stats.ess(draws, **axes, method="tail", prob=(0.05, 0.95)))
