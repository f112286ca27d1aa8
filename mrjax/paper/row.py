"""A row of the table of printed and computed numbers."""

from dataclasses import asdict, dataclass
from decimal import Decimal

from mrjax.core.text import with_error


@dataclass(frozen=True)
class Row:
    """A printed or measured number and the number computed here."""

    case: str
    quantity: str
    printed: float
    computed: float | None
    unit: str
    status: str
    """`reproduced`, `corrected`, `not reproducible` or `beyond the paper`."""
    reason: str
    standard_error: float | None = None
    """Standard error of a computed number that is a mean of random starts."""

    @property
    def computed_text(self) -> str:
        """The computed number with the digits that its error allows, or with six."""
        if self.computed is None:
            return ""
        if self.standard_error is None:
            return f"{self.computed:.6g}"
        return with_error(self.computed, self.standard_error)


def row(
    case: str,
    quantity: str,
    printed: str,
    computed: float | None,
    unit: str,
    reason: str = "",
    otherwise: str = "corrected",
    within: float | None = None,
    standard_error: float | None = None,
) -> Row:
    """Makes a row and determines its status.

    Args:
      case: name of the case.
      quantity: name of the quantity.
      printed: number as printed in the paper.
      computed: number computed here, or None.
      unit: unit of both numbers.
      reason: explanation of the status.
      otherwise: status of a number that is not reproduced.
      within: tolerance of a reproduced number; by default the computed number must round to the
        printed one.
    """
    number = Decimal(printed)
    half_digit = 0.5 * 10.0 ** int(number.as_tuple().exponent) * (1 + 1e-9)
    tolerance = half_digit if within is None else within
    agrees = computed is not None and abs(computed - float(number)) <= tolerance
    return Row(
        case,
        quantity,
        float(number),
        None if computed is None else float(computed),
        unit,
        "reproduced" if agrees else otherwise,
        reason,
        standard_error,
    )


def as_tables(rows: list[Row]) -> list[dict]:
    """Returns the rows as dicts, for JSON."""
    return [asdict(row) for row in rows]
