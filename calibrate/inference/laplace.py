"""Laplace's approximation about every optimum of a fit, the first proposal of importance sampling.

About an optimum with the loss L the posterior is nearly normal. Its covariance C follows from the
curvature at the optimum, and its weight is exp(-L) |C|^(1/2).
"""

from typing import NamedTuple

import numpy as np

from calibrate.inference.curvature import information
from calibrate.inference.density import Density
from calibrate.inference.proposal import LEAST_SHARE, Proposal
from calibrate.least_squares import levenberg
from calibrate.least_squares.finish import is_settled
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.levenberg import Point

NEGLIGIBLE = 1e-6
"""Share of all weights below which an optimum is left out."""
REFINED = 8
"""Levenberg-Marquardt steps of the model from an optimum of the cheap model."""


class Optima(NamedTuple):
    """The optima of a fit as components of a proposal."""

    proposal: Proposal
    """Mixture with a component for each optimum that is not left out, the best first."""
    weights: np.ndarray
    """Weight of each component by Laplace's approximation, (K,)."""
    lost: int
    """Number of optima of the cheap model that are none of the model itself: it gives no numbers
    there, or its loss goes on falling."""


def approximated(fit: Fit, density: Density) -> Optima:
    """Laplace's approximation of the posterior of a fit.

    It runs the model with its slopes once at every other optimum, and a few times at an optimum of
    the cheap model.
    """
    best = Point(fit.optima[0].loss, np.log(fit.values), fit.jacobian, fit.residuals)
    centres, curved, losses, lost = [best.logs], [information(fit)], [best.loss], 0
    for optimum in fit.optima[1:]:
        end = _refine(fit, np.log(optimum.values), 0 if optimum.finished else REFINED)
        if not end.finite or not (optimum.finished or is_settled(end, fit.box)):
            lost += 1
            continue
        centres.append(end.logs)
        curved.append(end.jacobian.T @ end.jacobian)
        losses.append(end.loss)
    informations = [density.bounded_information(curvature) for curvature in curved]
    volumes = -0.5 * np.array([np.linalg.slogdet(matrix)[1] for matrix in informations])
    logs = volumes - np.array(losses)
    weights = np.exp(logs - logs.max())
    relevant = weights / weights.sum() > NEGLIGIBLE
    weights = weights[relevant] / weights[relevant].sum()
    shares = np.maximum(weights, LEAST_SHARE)
    scales = np.stack([np.linalg.inv(matrix) for matrix in informations])
    proposal = Proposal(shares / shares.sum(), np.stack(centres)[relevant], scales[relevant])
    return Optima(proposal, weights, lost)


def _refine(fit: Fit, logs: np.ndarray, steps: int) -> Point:
    """The optimum of the model near logarithms, (P,)."""

    def at(places: list[np.ndarray]) -> list[Point]:
        return list(map(fit.at, places))

    return levenberg.minimise(at, at([logs]), fit.box, steps)[0][0]
