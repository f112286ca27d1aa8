"""Starts of searches, spread evenly over the priors and within the bounds, by Sobol's points."""

import math

import numpy as np
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from calibrate.least_squares.bounds import Bounds

SPREAD = math.pi / math.sqrt(3.0)
"""Standard deviation of the starts in a logarithm without a prior: a factor of 6, and that of the
log-odds of a uniform share."""

WIDER = 2.0
"""Width of the starts over that of the priors: the data may favour values that a prior
disfavours."""


def draw(middle: np.ndarray, spread: np.ndarray, box: Bounds, number: int, seed: int) -> np.ndarray:
    """Draws logarithms from normal distributions cut off at the bounds, evenly spread; (S, P).

    Their standard deviations are `WIDER` times the given ones.

    Args:
      middle, spread: median and standard deviation of each logarithm, (P,).
      box: bounds of the logarithms.
      number: number of draws, S.
      seed: seed of the scrambled points.
    """
    points = qmc.Sobol(middle.size, seed=np.random.default_rng(seed))
    even = points.random_base2(math.ceil(math.log2(max(number, 1))))[:number]
    wide = WIDER * spread
    lower, upper = (ndtr((end - middle) / wide) for end in box)
    with np.errstate(divide="ignore"):
        logs = middle + wide * ndtri(lower + even * (upper - lower))
    return box.clip(logs)
