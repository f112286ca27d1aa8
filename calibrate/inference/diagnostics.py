"""Agreement of chains: rank-normalised split R-hat, of values and of folded values.

Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Analysis 16, 667 (2021). Ranks make R-hat
finite for any tail; half chains find one that drifts; distances from the median, folded, find
chains that agree in their middle and not in their spread, such as one that never moves.
"""

import numpy as np
from scipy.special import ndtri
from scipy.stats import rankdata


def r_hat(draws: np.ndarray) -> np.ndarray:
    """The greater of R-hat of values and of folded values, (P,); not a number where none moved.

    Args:
      draws: of C chains of N draws each, (C, N, P).
    """
    halves = split(draws)
    folded = np.abs(halves - np.median(halves, axis=(0, 1)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.maximum(_r_hat(normalised(halves)), _r_hat(normalised(folded)))


def split(draws: np.ndarray) -> np.ndarray:
    """Every chain as two of half its length, (2 C, N // 2, P)."""
    half = draws.shape[1] // 2
    return np.concatenate([draws[:, :half], draws[:, half : 2 * half]])


def normalised(draws: np.ndarray) -> np.ndarray:
    """Draws, (C, N, P), by their ranks among all, as a normal distribution would have them."""
    chains, number, values = draws.shape
    ranks = rankdata(draws.reshape(-1, values), axis=0)
    return ndtri((ranks - 0.375) / (chains * number + 0.25)).reshape(draws.shape)


def _r_hat(draws: np.ndarray) -> np.ndarray:
    """Root of the variance of all over that within chains, (P,)."""
    number = draws.shape[1]
    within = draws.var(axis=1, ddof=1).mean(axis=0)
    between = draws.mean(axis=1).var(axis=0, ddof=1)
    return np.sqrt((number - 1) / number + between / within)


def tails(draws: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indicators, 0 or 1, of draws up to the 5th and up to the 95th percentile."""
    low, high = np.quantile(draws, [0.05, 0.95], axis=(0, 1))
    return (draws <= low).astype(float), (draws <= high).astype(float)
