"""Records of how files were read: a line of text, and a table for `fit.json`."""

from dataclasses import asdict, dataclass
from typing import Any

from mrjax.core.errors import shown

MOST_NAMED = 5
"""Most columns or rows that the line names."""


@dataclass(frozen=True, kw_only=True)
class FileUnderstood:
    """Record of how a file of any kind was read."""

    file: str
    """Path of the file, as in the experiment."""
    read_as: dict[str, str]
    """Encoding and delimiter, or sheet, and decimal mark."""
    columns: dict[str, str]
    """Names in the header by what they hold; several repeats are joined."""
    readings: int
    """Number of readings."""
    errors: str
    """`stated` or `estimated`."""
    ignored_columns: tuple[str, ...] = ()
    """Names of columns that are not read."""
    left_out: tuple[int, ...] = ()
    """Numbers of rows without a reading."""
    row_word: str = "line"
    """Word for a row: `line` of a text, `row` of a workbook."""

    @property
    def line(self) -> str:
        """The record as a line of text."""
        parts = [f"{shown(self.file)} ({', '.join(self.read_as.values())}): {self._read()}"]
        if self.ignored_columns:
            parts.append(f"not used: {some([shown(column) for column in self.ignored_columns])}")
        if self.left_out:
            plural = "s" if len(self.left_out) > 1 else ""
            numbers = some([str(row) for row in self.left_out])
            parts.append(f"without a reading: {self.row_word}{plural} {numbers}")
        return "; ".join(parts)

    def table(self) -> dict[str, Any]:
        """The entries of `fit.json`, with the line itself."""
        return asdict(self) | {"line": self.line}

    def _read(self) -> str:
        """Columns, first and last reading, and errors in words."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class Understood(FileUnderstood):
    """Record of how the file of a curve was read."""

    observable: str
    """`mudline` or `sedimentation_ratio`."""
    time_form: str
    """Form of the times: a unit, `hh:mm`, `hh:mm:ss`, `mm:ss` or `dates`."""
    time_unit: str
    """Unit of times in reports."""
    unit: str
    """Unit of the readings."""
    first: tuple[float, float]
    """Time and value of the first reading, in their units."""
    last: tuple[float, float]
    """Time and value of the last reading, in their units."""
    standard_deviation: tuple[float, float]
    """Smallest and largest standard deviation, in the unit of the readings."""

    def _read(self) -> str:
        time, unit = self.time_unit, "" if self.unit == "1" else f" {self.unit}"
        roles = [role for role in self.columns if role != "time"]
        form = f"in {time}" if self.time_form == time else f"as {self.time_form}"
        return (
            f"time {form} from {self.columns['time']}, {self._reading(roles[0])} from "
            f"{self.columns[roles[0]]}; {self.readings} readings, {self.first[1]:.6g}{unit} at "
            f"{self.first[0]:.6g} {time} to {self.last[1]:.6g}{unit} at {self.last[0]:.6g} {time}; "
            f"standard deviation {between(self.standard_deviation, unit)}, {self.errors}"
        )

    def _reading(self, role: str) -> str:
        """The readings in words, with their unit."""
        unit = " as a ratio" if self.unit == "1" else f" in {self.unit}"
        if role == "supernatant":
            return f"mudline{unit} as height less supernatant"
        return f"{role}{unit}"


def between(ends: tuple[float, float], unit: str) -> str:
    """The smallest and the largest number in words, or one of them if they are the same."""
    least, most = (f"{end:.3g}" for end in ends)
    return f"{least}{unit}" if least == most else f"{least} to {most}{unit}"


def some(names: list[str]) -> str:
    """The first names of a list, and how many more there are."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
