"""A printed number of the paper beside the one computed here."""

from dataclasses import asdict, dataclass
from decimal import Decimal


@dataclass(frozen=True)
class Row:
    """One printed number beside the one computed here."""

    case: str
    quantity: str
    printed: float
    computed: float | None
    unit: str
    status: str
    """reproduced, corrected or not reproducible."""
    reason: str


def row(
    case: str,
    quantity: str,
    printed: str,
    computed: float | None,
    unit: str,
    reason: str = "",
    otherwise: str = "corrected",
    within: float | None = None,
) -> Row:
    """A row; `reproduced` where the computed number rounds to the printed one, or is `within`."""
    number = Decimal(printed)
    half_a_digit = 0.5 * 10.0 ** int(number.as_tuple().exponent) * (1 + 1e-9)
    tolerance = half_a_digit if within is None else within
    agrees = computed is not None and abs(computed - float(number)) <= tolerance
    return Row(
        case,
        quantity,
        float(number),
        None if computed is None else float(computed),
        unit,
        "reproduced" if agrees else otherwise,
        reason,
    )


def as_tables(rows: list[Row]) -> list[dict]:
    """The rows as plain tables, for JSON."""
    return [asdict(row) for row in rows]
