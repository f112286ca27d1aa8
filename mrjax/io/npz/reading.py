"""Reading of a file: every byte is validated, and damage is reported in one line."""

import os
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np
from pydantic import BaseModel

from mrjax.core.errors import InputError, shown
from mrjax.io.npz.archive import (
    MAX_BYTES,
    METADATA,
    read_entry,
    read_metadata,
    read_numbers,
    refuse_directory,
)
from mrjax.io.npz.schema import DamagedError, Schema, refuse_headers, refuse_values

M = TypeVar("M", bound=BaseModel)


def read(
    path: Path, schema: Schema[M], max_bytes: int = MAX_BYTES
) -> tuple[dict[str, np.ndarray], M]:
    """Reads the arrays and the metadata that `write` wrote.

    Args:
      path: path of the file.
      schema: requirements on the file.
      max_bytes: largest size of the unpacked arrays.

    Raises:
      InputError: there is no such file, or it cannot be read, is damaged, does not fit the schema,
        or holds more than `max_bytes`.
    """
    try:
        return read_or_damage(path, schema, max_bytes)
    except DamagedError as damage:
        raise InputError(f"{damage}; give {schema.description}") from None


def read_or_damage(
    path: Path, schema: Schema[M], max_bytes: int
) -> tuple[dict[str, np.ndarray], M]:
    """Reads as `read` does, with an error of its own for a damaged file.

    Raises:
      DamagedError: the file is damaged, does not fit the schema, or holds more than `max_bytes`.
      InputError: there is no such file, or the path is no file or cannot be read.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # a pipe would block
            raise InputError(f"{path}: is not a file that mrjax wrote, nor any file; give another")
        with path.open("rb") as file:
            return _parse(file, schema, max_bytes)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except DamagedError as damage:
        reason = str(damage)
    except Exception as error:
        # Every byte is untrusted, and the libraries that unpack it do not document all that they
        # raise: zipfile and zlib alone have raised nine kinds.
        reason = f"{type(error).__name__}: {shown(str(error))}"
    raise DamagedError(f"{path}: is not a file that mrjax wrote, or is damaged ({reason})")


def refuse_beyond_single(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Refuses numbers that would overflow in JAX's current precision.

    Raises:
      InputError: JAX is set to single precision, and a number is too large for it.
    """
    if jax.config.jax_enable_x64:  # type: ignore[attr-defined] # made at run time
        return
    for name, array in arrays.items():
        if array.size and np.abs(array).max() > np.finfo(np.float32).max:
            raise InputError(
                f"{path}: {name} is beyond single precision; call "
                'jax.config.update("jax_enable_x64", True) first'
            )


def _parse(file: Any, schema: Schema[M], max_bytes: int) -> tuple[dict[str, np.ndarray], M]:
    """Reads directory, headers, metadata and numbers; each is checked before the next is read."""
    length = os.fstat(file.fileno()).st_size
    try:
        archive = zipfile.ZipFile(file)
    except OSError as error:  # a damaged directory points before the file's first byte
        raise DamagedError(f"no zip file: {error.strerror}") from None
    with archive:
        refuse_directory(archive, schema, length, max_bytes)
        entries = {info.filename: read_entry(archive, info) for info in archive.infolist()}
        described = entries.pop(f"{METADATA}.npy", None)
        if described is None:
            raise DamagedError("it has no metadata")
        by_name = {entry.name: entry for entry in entries.values()}
        lengths = refuse_headers(by_name, schema)
        metadata = read_metadata(archive, described, schema)
        arrays = {name: read_numbers(archive, entry) for name, entry in by_name.items()}
    for name, numbers in schema.requirements(arrays).items():
        if name in arrays:
            refuse_values(name, arrays[name], numbers, lengths)
    return arrays, metadata
