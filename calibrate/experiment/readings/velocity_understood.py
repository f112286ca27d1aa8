"""What was understood of a table of velocities: one line for people, and a table for `fit.json`."""

from dataclasses import asdict, dataclass
from typing import Any

from calibrate.experiment.readings.understood import some
from mrjax.core.errors import shown


@dataclass(frozen=True)
class VelocitiesUnderstood:
    """How a file of velocities by concentration was read."""

    file: str
    """As the experiment has it."""
    read_as: dict[str, str]
    """Encoding and delimiter, or sheet, and decimal mark."""
    columns: dict[str, str]
    """Names in the header by what they hold; several repeats are joined."""
    quantity: str
    """`velocity` or `flux`."""
    concentration: str
    """What the concentrations are."""
    unit: str
    """Unit of the readings, with its power of ten."""
    readings: int
    first: str
    """First concentration, in words."""
    last: str
    """Last concentration, in words."""
    velocities: tuple[float, float]
    """First and last velocity."""
    velocity_unit: str
    """Unit of the velocities."""
    errors: str
    """`stated` or `estimated`."""
    standard_deviation: tuple[float, float] | None
    """Least and greatest stated one, in the unit of the velocities."""
    ignored_columns: tuple[str, ...] = ()
    left_out: tuple[int, ...] = ()
    """Numbers of rows without a concentration or a reading."""
    row_word: str = "line"
    """What a row is called: `line` of a text, `row` of a workbook."""

    @property
    def line(self) -> str:
        """The line for people."""
        of_flux = " as flux over volume fraction" if self.quantity == "flux" else ""
        first, last = (f"{one:.6g} {self.velocity_unit}" for one in self.velocities)
        parts = [
            f"{shown(self.file)} ({', '.join(self.read_as.values())}): {self.concentration} from "
            f"{self.columns['concentration']}, velocity{of_flux}, in {self.unit}, from "
            f"{self.columns[self.quantity]}",
            f"{self.readings} readings, {first} at {self.first} to {last} at {self.last}",
            self._errors(),
        ]
        if self.ignored_columns:
            parts.append(f"not used: {some([shown(one) for one in self.ignored_columns])}")
        if self.left_out:
            plural = "s" if len(self.left_out) > 1 else ""
            numbers = some([str(one) for one in self.left_out])
            parts.append(f"without a reading: {self.row_word}{plural} {numbers}")
        return "; ".join(parts)

    def table(self) -> dict[str, Any]:
        """The entries of `fit.json`, with the line itself."""
        return asdict(self) | {"line": self.line}

    def _errors(self) -> str:
        if self.standard_deviation is None:
            return "relative scatter to be estimated"
        least, most = (f"{one:.3g}" for one in self.standard_deviation)
        between = least if least == most else f"{least} to {most}"
        return f"standard deviation {between} {self.velocity_unit}, stated"
