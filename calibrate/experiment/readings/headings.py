"""Cells of a header: the role of a column, and its unit."""

import re
import unicodedata
from typing import Literal, NamedTuple

from calibrate.experiment.readings import vocabulary
from calibrate.experiment.readings.vocabulary import FOREIGN, HOURS_FIRST, MEAN, MINUTES_FIRST
from calibrate.experiment.units import HEIGHT, RATIO, READINGS, TIME, VOLUME

Role = Literal["time", "mudline", "sedimentation_ratio", "supernatant", "standard_deviation"]
OF_READINGS: tuple[Role, ...] = ("mudline", "sedimentation_ratio", "supernatant")
Kind = tuple[Role, int]
"""A role and a rank: of several columns that may be the mudline, the one of lowest rank is."""
INITIAL = re.compile(r"[a-z][\s_]?[0o]")
"""The symbol of an initial value: `h0`."""
RATIO_OF_SYMBOLS = re.compile(r"(h|v|z)\s*/\s*(h|v|z)[\s_]*[0o]?(?:[\s_#.]+\d+)?")
"""`h/h0`, and `h/h0 2` of repeats."""
ALONE_NO_UNIT = ("h", "1", "y", "-", "in")
"""Headers that are names or empty, although units have these names, too."""
DASHES = ("-", "\N{EN DASH}", "\N{MINUS SIGN}")
"""Marks in place of a unit for numbers without one."""
NO_UNIT_BEHIND = ("1", "-", "in")
"""Last words of a header that are not its unit."""
_IN_BRACKETS = re.compile(r"[(\[{<]\s*([^()\[\]{}<>]*?)\s*[)\]}>]")
_BRACKETS = re.compile(r"[\(\[].*?[\)\]]")


class Heading(NamedTuple):
    """A cell of a header."""

    written: str
    """Text in the file."""
    name: str
    """Name without the unit, in small letters."""
    unit: str
    """Word in place of the unit, "" if there is none."""
    explicit: bool
    """True if the unit stands in brackets or behind a slash, where nothing else does."""

    @property
    def words(self) -> set[str]:
        """The words of its name."""
        return set(re.findall(r"[^\W\d_]+", self.name))

    @property
    def kind(self) -> Kind | None:
        """Role of its column, and rank among others of the role; None if it has no role."""
        words = self.words
        if words & vocabulary.ERROR or self.name in ("±", "+/-"):
            return None if words & vocabulary.TIME else ("standard_deviation", 0)
        if self.name == "t" or (words & vocabulary.TIME and not words & vocabulary.OTHER):
            foreign = self.unit in FOREIGN and self.name == "t"
            return None if foreign else ("time", 1 if self.of_dates else 0)
        if not self.name:
            return _kind_of_unit(self.unit)
        if words & vocabulary.OTHER - {"initial", "total", "liquid", "water", "number"}:
            return None
        if words & vocabulary.CLEAR and not words & vocabulary.INTERFACE:
            return "supernatant", 6
        heights = vocabulary.HEIGHT | vocabulary.INTERFACE
        relative = words & vocabulary.RELATIVE and words & heights
        if words & vocabulary.RATIO or relative or RATIO_OF_SYMBOLS.fullmatch(self.name):
            return "sedimentation_ratio", 5
        return _kind_of_height(self.name, words, self.unit)

    @property
    def of_dates(self) -> bool:
        """True if its name says that it holds dates."""
        return bool(self.words & vocabulary.DATE)

    @property
    def of_day(self) -> bool:
        """True if its name says that it holds times of the day, and not elapsed ones."""
        return "of day" in self.name or bool(self.words & vocabulary.OF_DAY)

    @property
    def base(self) -> str:
        """The name without marks of a repeat: numbers, a letter, words in brackets."""
        words = re.findall(r"[^\W\d_]+", _BRACKETS.sub(" ", self.name))
        own = [word for word in words if word not in vocabulary.REPEAT]
        longer = [word for word in own if len(word) > 1]
        return " ".join(longer or own[:1] if own == words else longer)


def heading(written: str) -> Heading:
    """Splits a cell of a header into its name and its unit.

    `Time (min)`, `h [mm]`, `t/d`, `mudline_mm`, `height in cm`, `min`.
    """
    plain = unicodedata.normalize("NFKC", written).casefold().strip(" *:\"'")
    for bracket in _IN_BRACKETS.finditer(plain):
        unit = bracket[1].removeprefix("in ").strip()
        unit = "%" if unit.startswith(("%", "percent")) else "1" if unit in DASHES else unit
        if _is_unit(unit):
            name = f"{plain[: bracket.start()].strip()} {plain[bracket.end() :].strip()}"
            return Heading(written, name.strip(" _"), unit, True)
    match = re.fullmatch(r"(.+?)\s*/\s*([^/\s]+)", plain)
    if match and _is_unit(match[2]) and not _is_unit(f"{match[1].strip()}/{match[2]}"):
        return Heading(written, match[1], match[2], True)
    if _is_unit(plain) and plain not in ALONE_NO_UNIT:
        return Heading(written, "", plain, True)
    whole = Heading(written, plain.replace("_", " "), "", False)
    match = re.fullmatch(r"(.+?)([\s_,;.\-]+(?:in[\s_]+)?|(?=%))([^\s_,;\-]+)", plain)
    loose = match is not None and match[2] == " " and not match[1].endswith(" in")
    if (
        match
        and _is_unit(match[3])
        and match[3] not in NO_UNIT_BEHIND
        and not (loose and "of " in plain)
    ):
        with_unit = Heading(written, match[1].removesuffix(" in"), match[3], False)
        if with_unit.kind is None and whole.kind is not None:
            return whole
        if _fits(with_unit):
            return with_unit
    return whole


def _fits(head: Heading) -> bool:
    """True if the unit suits the role of the column: `min` of `h_min` is no unit of a height."""
    if head.kind is None:
        return True
    of_time = TIME.named(head.unit) is not None or head.unit in HOURS_FIRST | MINUTES_FIRST
    return of_time == (head.kind[0] == "time")


def is_unit_cell(text: str) -> bool:
    """True if a cell holds a unit and nothing else, with or without brackets, or no unit."""
    unit = unit_of_cell(text)
    return not unit or _is_unit(unit)


def unit_of_cell(text: str) -> str:
    """The unit of a cell below a header."""
    unit = unicodedata.normalize("NFKC", text).casefold().strip(" ()[]")
    return "" if unit in DASHES else unit


def _is_unit(word: str) -> bool:
    known = TIME.named(word) or READINGS.named(word)
    return bool(known) or word in HOURS_FIRST | MINUTES_FIRST | FOREIGN


def _kind_of_unit(unit: str) -> Kind | None:
    """The kind of a column whose header is a unit: `min`, `(mm)`."""
    if TIME.named(unit) or unit in HOURS_FIRST | MINUTES_FIRST:
        return "time", 1
    if RATIO.named(unit):
        return "sedimentation_ratio", 5
    return ("mudline", 4) if READINGS.named(unit) else None


def _kind_of_height(name: str, words: set[str], unit: str) -> Kind | None:
    """The kind of a column that may be a mudline by its words."""
    if words & vocabulary.INTERFACE or "mud line" in name:
        return "mudline", 1
    if words & vocabulary.OTHER:
        return None
    plain = " ".join(word for word in _BRACKETS.sub("", name).split() if word not in MEAN)
    letter = re.sub(r"[\d\s_#.]+", "", plain)
    if letter in vocabulary.SYMBOLS:
        fits = not vocabulary.SYMBOLS[letter] or not unit or VOLUME.named(unit)
        rank = 2 if unit or not vocabulary.SYMBOLS[letter] else 4
        return ("mudline", rank) if fits and not INITIAL.fullmatch(name) else None
    if words & vocabulary.HEIGHT:
        rank = 3 if words & vocabulary.BED else 2
        of_vessel = words & vocabulary.VESSEL and not re.search(r"\d|\b[a-z]\b", name)
        return None if of_vessel else ("mudline", rank)
    if words & (vocabulary.BED | vocabulary.READING):
        return "mudline", 3 if words & vocabulary.BED else 4
    if words & vocabulary.REPEAT:
        return ("mudline", 7) if len(words) < 3 else None
    return ("mudline", 8) if HEIGHT.named(unit) or VOLUME.named(unit) else None
