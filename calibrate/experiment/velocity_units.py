"""Units of a velocity: a length over a time in any spelling, and a power of ten before it.

`cm/s`, `mm per day`, `m s-1`, `1e-2 cm/s`.
"""

import re
import unicodedata
from typing import NamedTuple

from pydantic import AfterValidator, ValidationInfo

from calibrate.experiment.units import HEIGHT, TIME, VELOCITY_UNITS
from mrjax.core.errors import shown

EXAMPLES = "m/s, cm/s, mm/min, mm/h or mm/day"
"""Examples for messages; any length over any time is such a unit."""


def _either(words: list[str]) -> str:
    return "|".join(sorted(map(re.escape, words), key=len, reverse=True))


_LENGTH = _either([word for word in HEIGHT.spellings if word != '"'])
_TIME = _either(list(TIME.spellings))
_POWER = r"(?:[x\u00d7*]?\s*(?P<power>1e[+-]?\d+|10(?:\^\(?[+-]?|[+-])\d+)\)?\s*[·x\u00d7*]?\s*)?"
_UNIT = re.compile(
    rf"(?<![^\W\d_]){_POWER}(?P<length>{_LENGTH})"
    rf"(?:\s*/\s*(?P<over>{_TIME})|\s+per\s+(?P<per>{_TIME})|[\s.·*]+(?P<by>{_TIME})\s*\^?-1)"
    r"(?![\w/^])"
)


class VelocityUnit(NamedTuple):
    """A unit of velocity, with a power of ten as a factor."""

    name: str
    """Such as `cm/s`, one of `VELOCITY_UNITS`."""
    factor: float = 1.0
    """The power of ten before it."""

    @property
    def si(self) -> float:
        """The unit without its factor, m/s."""
        return VELOCITY_UNITS[self.name]

    @property
    def written(self) -> str:
        """The unit with its factor, as `velocity_unit` reads it."""
        return self.name if self.factor == 1.0 else f"{self.factor:.0e} {self.name}"


def plain(text: str) -> str:
    """A text in small letters, without differences of width and sign, underscores as blanks."""
    normalised = unicodedata.normalize("NFKC", text).casefold()
    return normalised.replace("μ", "u").replace("\u2212", "-").replace("_", " ").strip()


def parted(text: str) -> tuple[str, VelocityUnit | None]:
    """A header's cell without its unit of a velocity, and the unit; None if it has none."""
    whole = plain(text)
    match = _UNIT.search(whole)
    if match is None:
        return whole, None
    length = HEIGHT.named(match["length"])
    time = TIME.named(match["over"] or match["per"] or match["by"])
    rest = re.sub(r"[(\[]\s*[)\]]", " ", whole[: match.start()] + " " + whole[match.end() :])
    return rest.strip(" ,;:/"), VelocityUnit(f"{length}/{time}", _power(match["power"]))


def velocity_unit(text: str) -> VelocityUnit | None:
    """The unit of velocity that makes up a whole text; None if the text is anything else."""
    rest, unit = parted(text)
    return None if rest else unit


def _power(text: str | None) -> float:
    if text is None:
        return 1.0
    exponent = text.removeprefix("1e") if text.startswith("1e") else text[2:].strip("^(")
    return float(f"1e{exponent}")


def _checked(word: str, field: ValidationInfo) -> str:
    unit = velocity_unit(word)
    if unit is None:
        raise ValueError(
            f"{field.field_name} = {shown(word)}: must be a length over a time, such as {EXAMPLES}"
        )
    return unit.written


OF_VELOCITY = AfterValidator(_checked)
"""A validator for a field that names a unit of velocity; gives its standard name."""
