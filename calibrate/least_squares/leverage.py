"""Leverages: the share of each fitted value that comes from its own measurement."""

import numpy as np

RANK_TOLERANCE = 1e-6
"""Singular values below this share of the largest count as zero."""


def leverages(jacobian: np.ndarray, prior_precision: np.ndarray) -> np.ndarray:
    """Leverages, (M,): the diagonal of the matrix that maps measurements to their predictions.

    H = J (J^T J + Lambda)^-1 J^T (Hoaglin & Welsch 1978, with priors as further rows). Each is
    between 0 and 1. Without priors their sum is the number of values that the data determine.

    Args:
      jacobian: derivative of the residuals with respect to the logarithms, (M, P).
      prior_precision: 1 / log_standard_deviation^2 of each prior, 0 without one, (P,).
    """
    rows = np.vstack([jacobian, np.diag(np.sqrt(prior_precision))])
    if not np.isfinite(rows).all():
        return np.zeros(len(jacobian))
    directions, singular, _ = np.linalg.svd(rows, full_matrices=False)
    known = singular > RANK_TOLERANCE * max(singular.max(initial=0.0), np.finfo(float).tiny)
    return np.asarray(np.sum(directions[: len(jacobian), known] ** 2, axis=1))
