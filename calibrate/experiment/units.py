"""Units of measured quantities, and their spellings in files and sheets."""

import unicodedata
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from pydantic import AfterValidator, ValidationInfo

from mrjax.core.errors import shown

TIME_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "day": 86400.0, "week": 604800.0}
"""Seconds in one unit."""
HEIGHT_UNITS = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "in": 0.0254,
    "ft": 0.3048,
}
"""Metres in one unit of the mudline."""
VELOCITY_UNITS = {
    f"{length}/{time}": metres / seconds
    for length, metres in HEIGHT_UNITS.items()
    for time, seconds in TIME_UNITS.items()
}
"""Metres a second in one unit: a height over a time."""
VOLUME_UNITS = {"m3": 1.0, "L": 1e-3, "dL": 1e-4, "cL": 1e-5, "mL": 1e-6, "uL": 1e-9}
"""Cubic metres in one unit of a volume in the tube."""
RATIO_UNITS = {"1": 1.0, "%": 1e-2}
"""One unit of the sedimentation ratio."""

CURVES = {"mudline": HEIGHT_UNITS | VOLUME_UNITS | RATIO_UNITS, "sedimentation_ratio": RATIO_UNITS}
"""Units of the observables of a curve."""


class Dimension(NamedTuple):
    """Units of one quantity, and further spellings of each."""

    units: Mapping[str, float]
    spellings: Mapping[str, str]

    def named(self, word: str) -> str | None:
        """The unit that a word names, in any case; None if it names none."""
        return self.spellings.get(_plain(word))


def _plain(word: str) -> str:
    """A word without differences of case, width, sign of micro or raised digits."""
    plain = unicodedata.normalize("NFKC", word).casefold().strip()
    return plain.replace("μ", "u").replace("^", "").rstrip(".").strip()


def _dimension(units: Mapping[str, float], more: Mapping[str, str]) -> Dimension:
    spellings = {_plain(name): name for name in units}
    for name, words in more.items():
        spellings |= {_plain(word): name for word in words.split()}
    return Dimension(units, spellings)


TIME = _dimension(
    TIME_UNITS,
    {
        "s": "sec secs second seconds sek sekunde sekunden seconde secondes",
        "min": "mins minute minutes minuten mn",
        "h": "hr hrs hour hours std stunde stunden heure heures",
        "day": "d days tag tage tagen jour jours",
        "week": "w wk wks weeks woche wochen semaine semaines",
    },
)
HEIGHT = _dimension(
    HEIGHT_UNITS,
    {
        "m": "metre metres meter meters",
        "dm": "decimetre decimetres decimeter decimeters",
        "cm": "centimetre centimetres centimeter centimeters zentimeter",
        "mm": "millimetre millimetres millimeter millimeters",
        "um": "micron microns micrometre micrometres micrometer micrometers",
        "in": 'inch inches "',
        "ft": "foot feet",
    },
)
VOLUME = _dimension(
    VOLUME_UNITS,
    {
        "m3": "cbm",
        "L": "litre litres liter liters dm3",
        "dL": "decilitre decilitres deciliter deciliters",
        "cL": "centilitre centilitres centiliter centiliters",
        "mL": "millilitre millilitres milliliter milliliters cm3 cc ccm",
        "uL": "microlitre microlitres microliter microliters mm3",
    },
)
RATIO = _dimension(RATIO_UNITS, {"%": "percent pct prozent", "1": ""})
READINGS = Dimension(
    {**HEIGHT.units, **VOLUME.units, **RATIO.units},
    {**HEIGHT.spellings, **VOLUME.spellings, **RATIO.spellings},
)
"""Units in which a mudline may be read."""
LEVEL = Dimension({**HEIGHT.units, **RATIO.units}, {**HEIGHT.spellings, **RATIO.spellings})
"""Units of a height within a suspension, ratios to the height of the suspension included."""


def one_of(units: Iterable[str]) -> AfterValidator:
    """A validator for a field that names one of these units."""
    known = ", ".join(units)

    def check(unit: str, field: ValidationInfo) -> str:
        if unit not in known.split(", "):
            raise ValueError(f"{field.field_name} = {unit!r}: must be one of {known}")
        return unit

    return AfterValidator(check)


def spelled(dimension: Dimension) -> AfterValidator:
    """A validator for a field that names a unit in any spelling; gives its standard name."""

    def check(word: str, field: ValidationInfo) -> str:
        unit = dimension.named(word)
        if unit is None:
            known = ", ".join(dimension.units)
            raise ValueError(f"{field.field_name} = {shown(word)}: must be one of {known}")
        return unit

    return AfterValidator(check)
