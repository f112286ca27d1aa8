"""Numbers of a result as text: errors, times, intervals, priors."""

from typing import Any

import numpy as np

from calibrate.experiment.readings import concentrations
from calibrate.experiment.sample import Point
from calibrate.experiment.units import CURVES, HEIGHT_UNITS, TIME_UNITS
from calibrate.inference.identify import WITHOUT_PRIOR
from mrjax.core.text import with_error as with_error

SMALLEST_P = 1e-12
"""Smallest p-value that is printed as a number."""


def spelled(observable: str) -> str:
    """An observable in words."""
    return observable.replace("_", " ")


def by_chance(p: float) -> str:
    """A p-value as text behind the letter p: `= 0.02`, or `< 1e-12`."""
    return f"= {p:.2g}" if p > SMALLEST_P else f"< {SMALLEST_P:g}"


def off(row: dict[str, Any], form: str = "{}") -> str:
    """Relative difference of prediction and measurement as text; empty if zero was measured."""
    if not row["measured"]:
        return ""
    return form.format(f"{row['predicted'] / row['measured'] - 1:+.0%}")


def when(row: dict[str, Any]) -> str:
    """Position of a reading as text: its time, concentration, height, or that of a simulator."""
    if "at" in row:
        quantity, _, unit = row["axis"].partition(",")
        return " " + " ".join(f"at {quantity} {row['at']:.6g} {unit}".split())
    if row["observable"] in CURVES and "time_s" in row:
        value, unit = in_unit(row["time_s"], row["time_unit"])
        return f" at {value:.4g} {unit}"
    if "height_m" in row:
        height = row["height_m"] / HEIGHT_UNITS[row["height_unit"]]
        value, unit = in_unit(row["time_s"], row["time_unit"])
        return f" at {height:.4g} {row['height_unit']} and {value:.4g} {unit}"
    if "concentration" not in row:
        return ""
    return f" at {concentrations.said(row['concentration_kind'], row['concentration'])}"


def place_of_point(point: Point) -> dict[str, Any]:
    """The height and time of a local concentration, as `fit.json` has them."""
    return {
        "table": point.table,
        "height_m": point.height,
        "height_unit": point.height_unit,
        "time_s": point.time,
        "time_unit": point.time_unit,
    }


def in_unit(seconds: float, unit: str) -> tuple[float, str]:
    """A time in a unit, and the word for it: 3 days, 1 day, 90 min."""
    value = seconds / TIME_UNITS[unit]
    plural = unit in ("day", "week") and value != 1.0
    return value, f"{unit}s" if plural else unit


def interval(parameter: dict[str, Any], coverage: str) -> str:
    """Profile interval of a value at a coverage as text; for an open end, the searched limit."""
    if parameter["profile"] is None:
        return "unbounded"
    low, high = parameter["profile"][coverage]
    first, last = parameter["profile_within"]
    if not (first <= low or high <= last):
        return f"not bounded within {first:.4g} to {last:.4g}"
    lower = f"{low:.4g}" if first <= low else f"beyond {first:.4g}"
    upper = f"{high:.4g}" if high <= last else f"beyond {last:.4g}"
    return f"{lower} to {upper}"


def prior(parameter: dict[str, Any]) -> str:
    """A prior: median, factor of one standard deviation, bounds."""
    spread = parameter["prior_log_standard_deviation"]
    within = (
        f", {parameter['bounds'][0]:g} to {parameter['bounds'][1]:g}" if parameter["bounds"] else ""
    )
    if spread is None:
        return f"none{within}"
    return f"{parameter['prior_median']:g}, {np.exp(spread):.3g}{within}"


def determination(parameter: dict[str, Any], misfit: bool = False) -> str:
    """Entry of a value in the column `determined`."""
    if parameter["determined"]:
        return "if the model is right" if misfit else "yes"
    if parameter["status"] == "free":
        by_prior = np.isinf(parameter["data_standard_error"]) and np.isfinite(
            parameter["standard_error"]
        )
        return "no, prior only" if by_prior else "no, free"
    return f"no, {parameter['status']}"


def fitted_value(parameter: dict[str, Any]) -> str:
    """A value with its error, or with a factor if the error is as large as the value."""
    error = parameter["data_standard_error"]
    loose = (
        parameter["status"] == "free" and WITHOUT_PRIOR < error < np.inf and not parameter["bounds"]
    )
    if loose and np.isfinite(parameter["standard_error"]):
        return f"{parameter['value']:.3g}, within a factor of {np.exp(error):.3g}"
    return with_error(parameter["value"], parameter["standard_error"])


def scaled_error(parameter: dict[str, Any]) -> str:
    """Error of a value if the errors of the readings are scaled to cover the residuals."""
    error = parameter["scaled_standard_error"]
    return f"± {error:.2g}" if np.isfinite(error) else "unbounded"


def sampled_value(posterior: dict[str, float] | None) -> str:
    """Median and standard deviation of samples of a value."""
    if posterior is None:
        return ""
    return with_error(posterior["median"], posterior["standard_deviation"])
