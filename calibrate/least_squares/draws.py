"""Starts drawn evenly over what is believed and possible: Sobol's points through the priors."""

import math

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from calibrate.least_squares.bounds import Bounds

SPREAD = math.pi / math.sqrt(3.0)
"""Standard deviation of starts in each logarithm where no prior says: a factor of 6, and that of
log-odds whose share is uniform."""

WIDER = 2.0
"""Times the priors' widths that are searched: data may say what a prior holds unlikely."""


def draw(middle: np.ndarray, spread: np.ndarray, box: Bounds, number: int, seed: int) -> np.ndarray:
    """Logarithms, normal and cut off at the bounds, without clusters and gaps; (S, P).

    They are `WIDER` than the spread.

    Args:
      middle, spread: of each, (P,).
      box: the bounds.
      number: S.
      seed: of the scrambled points.
    """
    points = qmc.Sobol(middle.size, seed=np.random.default_rng(seed))
    even = points.random_base2(math.ceil(math.log2(max(number, 1))))[:number]
    wide = WIDER * spread
    lower, upper = (ndtr((end - middle) / wide) for end in box)
    with np.errstate(divide="ignore"):
        logs = middle + wide * ndtri(lower + even * (upper - lower))
    return box.clip(logs)
