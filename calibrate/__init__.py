"""Fits the simulator to measurements, and says what the data determine."""

import mrjax  # noqa: F401 - has to come before JAX, so that it can hush it
from calibrate.data import Experiment
from calibrate.fit import Fit, LogNormal, fit
from calibrate.identify import Identification, identify
from calibrate.predict import FORWARD_MODELS
from calibrate.residuals import Problem

__all__ = [
    "FORWARD_MODELS",
    "Experiment",
    "Fit",
    "Identification",
    "LogNormal",
    "Problem",
    "fit",
    "identify",
]
