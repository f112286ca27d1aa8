"""The same data by `calibrate`: search, Levenberg-Marquardt, null directions, posterior samples."""

import jax.numpy as jnp
import numpy as np

from calibrate.inference.identify import identify
from calibrate.inference.posterior import posterior
from calibrate.least_squares.fit import fit
from calibrate.least_squares.priors import LogNormal

from .problem import FRACTIONS, RANGE, TRUTH, Moments, errors

LOG_STANDARD_DEVIATION = float(np.log(RANGE) / np.sqrt(3.0))
"""Of the priors about the truth: that of an even one between a third and three times."""
START = {name: RANGE * value for name, value in TRUTH.items()}


def residuals(theta: dict, data: jnp.ndarray) -> jnp.ndarray:
    """(8,)"""
    velocity = theta["v_0"] / theta["f_s"] * (1.0 - FRACTIONS) ** theta["n"]
    return (velocity - data) / errors()


def calibrated(data: np.ndarray, seed: int) -> dict:
    """Without priors the model runs and what is said of the ridge; with them, the uncertainties."""
    alone = fit(residuals, START, data=jnp.asarray(data))
    said = identify(alone)
    priors = {name: LogNormal(value, LOG_STANDARD_DEVIATION) for name, value in TRUTH.items()}
    found = fit(residuals, START, data=jnp.asarray(data), priors=priors)
    drawn = posterior(found, seed)
    assert alone.converged and found.converged and drawn.converged
    by_name = dict(zip(drawn.names, drawn.samples.T, strict=True))
    values = np.stack([*(by_name[name] for name in TRUTH), by_name["v_0"] / by_name["f_s"]])
    moments = Moments.of(values)
    ratio = next(one for one in said.combinations if set(one.exponents) == {"v_0", "f_s"})
    curvature = [*(identify(found).standard_errors[name] for name in TRUTH), _inverse(ratio)]
    return {
        "runs": found.model_runs,
        "runs_without_priors": alone.model_runs,
        "mean": moments.mean.tolist(),
        "deviation": moments.deviation.tolist(),
        "curvature": curvature,
        "ridge": list(said.null_directions),
        "determined": [one.expression for one in said.combinations],
    }


def _inverse(ratio) -> float:
    """Standard error of v_0 / f_s, whichever way up it was found."""
    if ratio.exponents["v_0"] > 0:
        return ratio.standard_error
    return ratio.standard_error / ratio.value**2
