"""Names of before keep working: modules by one table, and what was in them."""

import importlib
import pkgutil

import pytest

import calibrate
from calibrate import aliases


@pytest.mark.parametrize("old", aliases.OLD_NAMES)
def test_a_module_of_before_is_the_one_that_took_over(old):
    new = importlib.import_module(f"calibrate.{aliases.OLD_NAMES[old]}")
    assert importlib.import_module(f"calibrate.{old}") is new
    if old in aliases.FUNCTIONS:
        assert callable(getattr(calibrate, old))
    else:
        assert getattr(calibrate, old) is new


@pytest.mark.parametrize(
    "name",
    [
        "data.Sample",
        "data.Measurement",
        "data.Experiment",
        "fitted.Fitted",
        "fitted.fitted",
        "predict.closed_form",
        "predict.column",
        "predict.particles",
        "predict.FORWARD_MODELS",
        "suspension.Suspension",
        "calibration.calibrated",
        "levenberg.Bounds",
        "identify.Combination",
        "identify.Identification",
        "fit.Fit",
        "fit.LogNormal",
        "residuals.Problem",
        "report.summary",
        "report.markdown",
        "report.in_words",
        "report.write",
    ],
)
def test_what_was_in_it_is_there(name):
    module, attribute = name.split(".")
    found = getattr(importlib.import_module(f"calibrate.{module}"), attribute)
    if callable(found):
        assert pkgutil.resolve_name(f"{found.__module__}:{found.__name__}") is found


def test_there_is_no_module_of_any_other_name():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("calibrate.nothing")
    with pytest.raises(AttributeError, match="nothing"):
        _ = calibrate.nothing
