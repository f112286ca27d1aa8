"""Units of what is measured, and the one way in which a sheet names them."""

from collections.abc import Iterable

from pydantic import AfterValidator, ValidationInfo

VELOCITY_UNITS = {
    "m/s": 1.0,
    "um/s": 1e-6,
    "mm/s": 1e-3,
    "mm/h": 1e-3 / 3600,
    "mm/day": 1e-3 / 86400,
}
"""SI value of one unit."""
TIME_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "day": 86400.0}
"""Seconds in one unit."""
HEIGHT_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
"""Metres in one unit of the mudline."""
RATIO_UNITS = {"1": 1.0, "%": 1e-2}
"""One unit of the sedimentation ratio."""

CURVES = {"mudline": HEIGHT_UNITS, "sedimentation_ratio": RATIO_UNITS}
"""What a curve may be of, and in which units."""


def one_of(units: Iterable[str]) -> AfterValidator:
    """A validator for a field that names one of these units."""
    known = ", ".join(units)

    def check(unit: str, field: ValidationInfo) -> str:
        if unit not in known.split(", "):
            raise ValueError(f"{field.field_name} = {unit!r}: must be one of {known}")
        return unit

    return AfterValidator(check)
