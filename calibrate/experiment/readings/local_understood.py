"""Record of how a table of local concentrations was read."""

from dataclasses import dataclass

from calibrate.experiment.readings.understood import FileUnderstood, between


@dataclass(frozen=True, kw_only=True)
class LocalUnderstood(FileUnderstood):
    """Record of how a file of concentrations against time or height was read."""

    at: str
    """Height or time of the readings, in words."""
    thickness: float
    """Thickness of the layer that a reading averages over, m."""
    axis: str
    """`time` or `height`."""
    axis_form: str
    """Unit of the times or heights, or form of the times: `hh:mm`, `dates`."""
    axis_unit: str
    """Unit of times or heights in reports."""
    concentration: str
    """Kind of the concentrations in the file."""
    unit: str
    """Unit of the volume fractions: `1` or `%`."""
    first: tuple[float, float]
    """Time or height and volume fraction of the first reading, in their units."""
    last: tuple[float, float]
    """Time or height and volume fraction of the last reading, in their units."""
    standard_deviation: tuple[float, float] | None
    """Smallest and largest stated standard deviation, in the unit of the volume fractions."""

    def _read(self) -> str:
        form = f"in {self.axis_form}" if self.axis_form == self.axis_unit else self.axis_form
        (start, first), (end, last) = self.first, self.last
        unit = "" if self.unit == "1" else f" {self.unit}"
        return (
            f"{self.axis} {form} from {self.columns[self.axis]}, volume fraction of the particles "
            f"from {self.concentration} in {self.columns['concentration']}, {self.at}, mean over "
            f"{self.thickness:.3g} m; {self.readings} readings, {first:.4g}{unit} at {start:.6g} "
            f"{self.axis_unit} to {last:.4g}{unit} at {end:.6g} {self.axis_unit}; "
            f"{self._errors(unit)}"
        )

    def _errors(self, unit: str) -> str:
        if self.standard_deviation is None:
            return "scatter to be estimated"
        return f"standard deviation {between(self.standard_deviation, unit)}, stated"
