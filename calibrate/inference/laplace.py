"""Laplace's approximation about every optimum of a fit: where importance sampling begins.

About an optimum of half the sum of squares L the posterior is a normal distribution of the
curvature there, with the weight exp(-L) |C|^(1/2) of its covariance C.
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
"""Weight of an optimum, of all, that is left out."""
REFINED = 8
"""Steps of Levenberg and Marquardt from an optimum that only a cheap model found."""


class Optima(NamedTuple):
    """The optima of a fit as a proposal."""

    proposal: Proposal
    """A component for each that has a weight, the best first."""
    weights: np.ndarray
    """Weight of each by Laplace's approximation, (K,)."""
    lost: int
    """Optima of the cheap model at which the model itself gives no numbers, or goes on falling."""


def approximated(fit: Fit, density: Density) -> Optima:
    """Laplace's approximation of the posterior of a fit.

    Runs the model and its slopes once at every other optimum, a few times where only the cheap
    model found it.
    """
    best = Point(fit.optima[0].loss, np.log(fit.values), fit.jacobian, fit.residuals)
    centres, curved, losses, lost = [best.logs], [information(fit)], [best.loss], 0
    for optimum in fit.optima[1:]:
        end = _refined(fit, np.log(optimum.values), 0 if optimum.finished else REFINED)
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


def _refined(fit: Fit, logs: np.ndarray, steps: int) -> Point:
    """The optimum of the model near logarithms, (P,)."""

    def at(places: list[np.ndarray]) -> list[Point]:
        return list(map(fit.at, places))

    return levenberg.minimise(at, at([logs]), fit.box, steps)[0][0]
