"""A settling column on disk: its fields as CSV, or all of its arrays as `.npz`."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from mrjax.continuum.profile import Column
from mrjax.continuum.sizes.profile import PolydisperseColumn
from mrjax.core.errors import InputError
from mrjax.io import files, npz

FIELDS = {
    "volume_fraction": "volume_fraction",
    "settling_velocity_m_per_s": "settling_velocity",
    "solid_stress_Pa": "solid_stress",
}
"""Fields of both results, (T, C), by their names in a file."""
CLASS_FIELDS = {
    "volume_fraction_class": "class_fractions",
    "settling_velocity_m_per_s_class": "class_velocities",
}
"""Fields of each class, (T, K, C), by the beginning of their names in a CSV file."""
DIGITS = 8
"""Significant digits in a CSV file."""
CURVES = {"mudline_m": "mudline", "bed_front_m": "bed_front"}
FURTHER = (
    *("class_fractions", "class_velocities", "bed_composition", "supernatant_fractions"),
    *("initial_fractions", "bed_fraction", "threshold"),
)
"""Further arrays of several classes in an `.npz` file; `class_velocities` are in m/s."""


def save_column(
    path: str | Path, column: Column | PolydisperseColumn, made_by: Mapping[str, Any] | None = None
) -> None:
    """Writes a settling column as CSV or `.npz`, by the suffix of the path.

    A CSV file has a row for each time and cell, and a header with units: `time_s`, `height_m`, the
    fields, and those of each class, to eight digits. An `.npz` file has all arrays, with units in
    their names, and needs no pickle.

    Args:
      path: path of the file, ending in `.csv` or `.npz`; an old file is replaced.
      column: settling column, not traced.
      made_by: recipe and versions in types that JSON has, stored in the metadata of an `.npz` file.

    Raises:
      InputError: the path has another suffix.
    """
    path = Path(path)
    if path.suffix == ".csv":
        files.write_csv(path, _rows(column))
    elif path.suffix == ".npz":
        npz.write(path, _arrays(column), {"made_by": dict(made_by or {})})
    else:
        raise InputError(f"{path}: give a name that ends in .csv or .npz")


def _rows(column: Column | PolydisperseColumn) -> dict[str, Iterable[float]]:
    """Returns the columns of the CSV file, (T * C,) each, by name."""
    times, levels = np.meshgrid(column.times, column.levels, indexing="ij")
    columns = {"time_s": times, "height_m": levels}
    columns |= {name: np.asarray(getattr(column, field)) for name, field in FIELDS.items()}
    if isinstance(column, PolydisperseColumn):
        for name, field in CLASS_FIELDS.items():
            values = np.moveaxis(np.asarray(getattr(column, field)), 1, 0)
            columns |= {f"{name}_{number}": value for number, value in enumerate(values)}
    return {name: [float(f"{x:.{DIGITS}g}") for x in value.flat] for name, value in columns.items()}


def _arrays(column: Column | PolydisperseColumn) -> dict[str, ArrayLike]:
    """Returns the arrays of the `.npz` file, by name."""
    arrays = {"times_s": column.times, "levels_m": column.levels}
    arrays |= {name: getattr(column, field) for name, field in (CURVES | FIELDS).items()}
    arrays["initial_height_m"] = column.initial_height
    if isinstance(column, PolydisperseColumn):
        units = {"class_velocities": "class_velocities_m_per_s"}
        arrays |= {units.get(field, field): getattr(column, field) for field in FURTHER}
    return arrays
