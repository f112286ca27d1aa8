"""Writing of a file: arrays by name, with all digits, and JSON metadata."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.io import files
from mrjax.io.npz.archive import METADATA


def npz_path(path: str | Path) -> Path:
    """Returns the path of a file to be written.

    Raises:
      InputError: the suffix is not `.npz`.
    """
    if Path(path).suffix != ".npz":
        raise InputError(f"{path}: give a name that ends in .npz")
    return Path(path)


def write(
    path: Path,
    arrays: Mapping[str, ArrayLike],
    metadata: Mapping[str, Any],
    durability: files.Durability = "name",
) -> None:
    """Writes arrays by name, with all digits, and JSON metadata; no pickle.

    Args:
      path: path of the file, ending in `.npz`; an old file is replaced.
      arrays: arrays of numbers by name; the names have units, such as `position_m`.
      metadata: values in types that JSON has; numbers of numpy and JAX are written as numbers.
      durability: as for `files.replacing`.

    Raises:
      TypeError: an array holds objects, which only pickle could write.
    """
    numbers = {name: np.asarray(array) for name, array in arrays.items()}
    for name, array in numbers.items():
        if array.dtype.hasobject or name == METADATA:
            raise TypeError(f"{name}: an array of objects, or the name of the metadata")
    text = json.dumps(files.plain(metadata))
    with files.replacing(path, durability) as scratch:
        entries: dict[str, Any] = {**numbers, METADATA: np.asarray(text)}
        np.savez(scratch, **entries)
