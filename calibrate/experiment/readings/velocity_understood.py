"""Record of how a table of velocities was read."""

from dataclasses import dataclass

from calibrate.experiment.readings.understood import FileUnderstood, between


@dataclass(frozen=True, kw_only=True)
class VelocitiesUnderstood(FileUnderstood):
    """Record of how a file of velocities against concentration was read."""

    quantity: str
    """`velocity` or `flux`."""
    concentration: str
    """Kind of the concentrations."""
    unit: str
    """Unit of the readings, with its power of ten."""
    first: str
    """First concentration, in words."""
    last: str
    """Last concentration, in words."""
    velocities: tuple[float, float]
    """First and last velocity."""
    velocity_unit: str
    """Unit of the velocities."""
    standard_deviation: tuple[float, float] | None
    """Smallest and largest stated standard deviation, in the unit of the velocities."""

    def _read(self) -> str:
        of_flux = " as flux over volume fraction" if self.quantity == "flux" else ""
        first, last = (f"{velocity:.6g} {self.velocity_unit}" for velocity in self.velocities)
        return (
            f"{self.concentration} from {self.columns['concentration']}, velocity{of_flux}, in "
            f"{self.unit}, from {self.columns[self.quantity]}; {self.readings} readings, {first} "
            f"at {self.first} to {last} at {self.last}; {self._errors()}"
        )

    def _errors(self) -> str:
        if self.standard_deviation is None:
            return "relative scatter to be estimated"
        ends = between(self.standard_deviation, f" {self.velocity_unit}")
        return f"standard deviation {ends}, stated"
