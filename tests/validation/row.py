"""One line of the validation page: a number that is known, and the one that was computed."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """A comparison; its error is relative to `scale`, or to the reference itself."""

    case: str
    quantity: str
    reference: float
    computed: float
    unit: str
    bar: float | None
    """Largest relative error that passes; None where none is asked."""
    source: str
    """Where the reference comes from: a closed form, a measurement, another code."""
    scale: float | None = None
    """What the error is relative to where the reference may be zero, or nearly."""

    @property
    def error(self) -> float:
        """|computed - reference| over the scale; 1."""
        return abs(self.computed - self.reference) / abs(self.scale or self.reference)

    @property
    def passes(self) -> bool:
        """Whether the error keeps to the bar."""
        return self.bar is None or self.error <= self.bar
