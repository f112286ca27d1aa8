"""Arrays on disk in numpy's format, with what they are as JSON; no pickle.

A file is not believed: its directory and the headers of its arrays are held against a schema and
against the bytes that are there, before room is made for any number.
"""

import json
import math
import os
import re
import stat
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

import jax
import numpy as np
from jax.typing import ArrayLike
from pydantic import BaseModel

from mrjax.core.errors import InputError, shown
from mrjax.io import files
from mrjax.io.markers import ForeignError, parsed

METADATA = "metadata"
"""Entry of a file that says in JSON what its arrays are."""
MAX_BYTES = 2**33
"""Of all arrays of a file, unpacked."""
MOST_METADATA = 2**26
"""Bytes of its JSON, unpacked."""
MOST_ENTRIES = 1000
MOST_HEADER = 10_000
"""Bytes of the header of an array, as numpy has it."""
AT_ONCE = 2**22
"""Bytes unpacked at a time."""
ENCRYPTED = 0x1 | 0x40
"""Flags of an entry."""
HEADER = re.compile(
    rb"\{\s*'descr':\s*'([<>|=]?[biufcU]\d{1,9})',\s*'fortran_order':\s*(False|True),"
    rb"\s*'shape':\s*\(((?:\d{1,19},\s*)*(?:\d{1,19})?)\),?\s*\}\s*"
)
"""What numpy has written since its first version; nothing of it is evaluated."""
SIDE_BY_SIDE = "..."
"""Stands first in a shape for the axes of several runs, as many and as long in all arrays."""

M = TypeVar("M", bound=BaseModel)


class DamagedError(Exception):
    """A file that is not what mrjax wrote."""


@dataclass(frozen=True)
class Numbers:
    """What an array must be."""

    shape: tuple[int | str, ...]
    """Lengths of its axes; those of one name agree in all arrays."""
    kind: str = "float"
    """`float`, of 32 or 64 bits, the same in all arrays; or `int`, of 32 bits."""
    least: float = -math.inf
    most: float = math.inf
    below: str | None = None
    """Name of an axis whose length is beyond all numbers."""
    finite: bool = True
    optional: bool = False
    needs: str | None = None
    """Name of an array that must be there where this one is."""


@dataclass(frozen=True)
class Schema(Generic[M]):
    """What a file must hold."""

    what: str
    """What a message says to give: `a file that save_state wrote`."""
    metadata: type[M]
    arrays: Mapping[str, Numbers] | None
    """By name; None for numbers of any name and shape, which must not be compressed."""
    least: Mapping[str, int] = field(default_factory=dict)
    """Length of axes by name; 1 where not given."""


@dataclass(frozen=True)
class _Entry:
    """An array in a file, by its header."""

    name: str
    info: zipfile.ZipInfo
    begins: int  # of its numbers, byte of the entry
    shape: tuple[int, ...]
    dtype: np.dtype
    order: Any  # "C" or "F", as numpy's type stubs have it


def named(path: str | Path) -> Path:
    """The path of a file to be written.

    Raises:
      InputError: another ending than `.npz`.
    """
    if Path(path).suffix != ".npz":
        raise InputError(f"{path}: give a name that ends in .npz")
    return Path(path)


def write(
    path: Path,
    arrays: Mapping[str, ArrayLike],
    metadata: Mapping[str, Any],
    lasting: files.Lasting = "name",
) -> None:
    """Arrays by name in numpy's format, with all digits, and what they are as JSON; no pickle.

    Args:
      path: ends in `.npz`; replaced at once.
      arrays: of numbers; names tell units, such as `position_m`.
      metadata: what JSON takes, and numpy and JAX numbers as numbers.
      lasting: as for `files.replacing`.

    Raises:
      TypeError: an array of objects, which only pickle could write.
    """
    numbers = {name: np.asarray(array) for name, array in arrays.items()}
    for name, array in numbers.items():
        if array.dtype.hasobject or name == METADATA:
            raise TypeError(f"{name}: an array of objects, or the name of the metadata")
    text = json.dumps(files.plain(metadata))
    with files.replacing(path, lasting) as scratch:
        kept: dict[str, Any] = {**numbers, METADATA: np.asarray(text)}
        np.savez(scratch, **kept)


def read(
    path: Path, schema: Schema[M], max_bytes: int = MAX_BYTES
) -> tuple[dict[str, np.ndarray], M]:
    """The arrays and the metadata that `write` wrote.

    Args:
      path: of the file.
      schema: what it must hold.
      max_bytes: of its arrays, unpacked.

    Raises:
      InputError: there is no such file, or it cannot be read, holds something else, or more than
        `max_bytes`, or is damaged.
    """
    try:
        return examined(path, schema, max_bytes)
    except DamagedError as damage:
        raise InputError(f"{damage}; give {schema.what}") from None


def examined(path: Path, schema: Schema[M], max_bytes: int) -> tuple[dict[str, np.ndarray], M]:
    """As `read`, for those who know what to do where a file is damaged.

    Raises:
      DamagedError: it holds something else, or more, or is damaged.
      InputError: there is no such file, or it is no file, or cannot be read.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):  # a pipe would be waited for
            raise InputError(f"{path}: is not a file that mrjax wrote, nor any file; give another")
        with path.open("rb") as file:
            return _parsed(file, schema, max_bytes)
    except InputError:
        raise
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except DamagedError as damage:
        reason = str(damage)
    except Exception as error:
        # Every byte is untrusted, and the libraries that unpack it state no whole list of what
        # they raise: zipfile and zlib alone have raised nine kinds.
        reason = f"{type(error).__name__}: {shown(str(error))}"
    raise DamagedError(f"{path}: is not a file that mrjax wrote, or damaged ({reason})")


def refuse_beyond_single(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Passes where JAX, as it is set, takes all numbers for finite.

    Raises:
      InputError: it is set to single precision, which has no form for some.
    """
    if jax.config.jax_enable_x64:  # type: ignore[attr-defined] # made at run time
        return
    for name, array in arrays.items():
        if array.size and np.abs(array).max() > np.finfo(np.float32).max:
            raise InputError(
                f"{path}: {name} is beyond single precision; call "
                'jax.config.update("jax_enable_x64", True) first'
            )


def _parsed(file: Any, schema: Schema[M], max_bytes: int) -> tuple[dict[str, np.ndarray], M]:
    """Directory, headers, metadata, then the numbers: each only where all before is right."""
    length = os.fstat(file.fileno()).st_size
    try:
        archive = zipfile.ZipFile(file)
    except OSError as error:  # a damaged directory points before the file's first byte
        raise DamagedError(f"no zip file: {error.strerror}") from None
    with archive:
        _refuse_directory(archive, schema, length, max_bytes)
        entries = {info.filename: _entry(archive, info) for info in archive.infolist()}
        told = entries.pop(f"{METADATA}.npy", None)
        if told is None:
            raise DamagedError("it has no metadata")
        by_name = {entry.name: entry for entry in entries.values()}
        lengths = _refuse_headers(by_name, schema)
        metadata = _metadata(archive, told, schema)
        arrays = {name: _numbers(archive, entry) for name, entry in by_name.items()}
    for name, numbers in (schema.arrays or {}).items():
        if name in arrays:
            _refuse_values(name, arrays[name], numbers, lengths)
    return arrays, metadata


def _refuse_directory(
    archive: zipfile.ZipFile, schema: Schema, length: int, max_bytes: int
) -> None:
    """Refuses by what the directory tells of the entries."""
    infos = archive.infolist()
    names = [info.filename for info in infos]
    if len(names) > MOST_ENTRIES or len(set(names)) < len(names):
        raise DamagedError("it has an entry twice, or too many")
    for info in infos:
        if not info.filename.endswith(".npy") or info.flag_bits & ENCRYPTED:
            raise DamagedError(f"its entry {shown(info.filename)} is encrypted, or no array")
        packed = info.compress_type != zipfile.ZIP_STORED
        if packed and (schema.arrays is None or info.compress_type != zipfile.ZIP_DEFLATED):
            raise DamagedError(
                f"its entry {shown(info.filename)} is compressed by method {info.compress_type}"
            )
        if not packed and info.compress_size != info.file_size:
            raise DamagedError(f"its entry {shown(info.filename)} has two lengths")
    if sum(info.compress_size for info in infos) > length:
        raise DamagedError("its entries are longer than the file")
    if (unpacked := sum(info.file_size for info in infos)) > max_bytes:
        raise DamagedError(f"it unpacks to {unpacked} bytes, max_bytes = {max_bytes}")


def _entry(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> _Entry:
    """What the header of an array tells, where its numbers are as many bytes as are there."""
    name = info.filename.removesuffix(".npy")
    with archive.open(info) as entry:
        version = np.lib.format.read_magic(entry)
        size = {(1, 0): 2, (2, 0): 4}.get(version, 0)
        header_length = int.from_bytes(entry.read(size), "little")
        text = entry.read(min(header_length, MOST_HEADER + 1))
    found = HEADER.fullmatch(text)
    if not size or len(text) != header_length or found is None:
        raise DamagedError(f"the header of {shown(name)} is not numpy's")
    shape = tuple(int(axis) for axis in found[3].split(b",") if axis.strip())
    dtype = np.dtype(found[1].decode())
    begins = np.lib.format.MAGIC_LEN + size + header_length
    if dtype.itemsize == 0 or begins + math.prod(shape) * dtype.itemsize != info.file_size:
        raise DamagedError(f"{shown(name)} has shape {shown(shape)}, and as many numbers not")
    return _Entry(name, info, begins, shape, dtype, "F" if found[2] == b"True" else "C")


def _refuse_headers(entries: Mapping[str, _Entry], schema: Schema) -> dict[str, Any]:
    """Refuses names, kinds and shapes that the schema does not have; the lengths of its axes."""
    arrays = schema.arrays
    if arrays is None:
        return {}
    for name in entries:
        if name not in arrays:
            raise DamagedError(f"it holds {shown(name)} beside what it should")
    lengths: dict[str, Any] = {}
    precisions = set()
    for name, numbers in arrays.items():
        if name not in entries:
            if not numbers.optional:
                raise DamagedError(f"it has no {name}")
            continue
        if numbers.needs is not None and numbers.needs not in entries:
            raise DamagedError(f"it has {name}, and no {numbers.needs}")
        entry = entries[name]
        kind = entry.dtype.newbyteorder("=")
        if kind not in ((np.float32, np.float64) if numbers.kind == "float" else (np.int32,)):
            raise DamagedError(f"{name} is of {kind}, where it must be {numbers.kind}")
        if numbers.kind == "float":
            precisions.add(kind)
        _agree(name, entry.shape, numbers.shape, lengths)
    if len(precisions) > 1:
        raise DamagedError("its numbers are of two precisions")
    for axis, length in lengths.items():
        if axis != SIDE_BY_SIDE and length < schema.least.get(axis, 1):
            raise DamagedError(f"{axis} = {length} is too few")
    return lengths


def _agree(
    name: str, shape: tuple[int, ...], wanted: tuple[int | str, ...], lengths: dict[str, Any]
) -> None:
    """Refuses a shape unless its axes are as long as wanted, and as those of one name before."""
    words = f"{name} has shape {shown(shape)} where it must be ({', '.join(map(str, wanted))})"
    rest = shape
    if wanted[:1] == (SIDE_BY_SIDE,):
        wanted = wanted[1:]
        cut = len(shape) - len(wanted)
        ahead, rest = shape[: max(cut, 0)], shape[max(cut, 0) :]
        if cut < 0 or 0 in ahead or lengths.setdefault(SIDE_BY_SIDE, ahead) != ahead:
            raise DamagedError(words)
    if len(rest) != len(wanted):
        raise DamagedError(words)
    for length, axis in zip(rest, wanted, strict=True):
        expected = axis if isinstance(axis, int) else lengths.setdefault(axis, length)
        if length != expected:
            raise DamagedError(words if isinstance(axis, int) else f"{words}, {axis} = {expected}")


def _metadata(archive: zipfile.ZipFile, entry: _Entry, schema: Schema[M]) -> M:
    """What the JSON tells, as the schema has it."""
    if entry.shape or entry.dtype.kind != "U" or entry.dtype.itemsize > MOST_METADATA:
        raise DamagedError("its metadata are no text")
    raw = b"".join(_unpacked(archive, entry))
    byte_order = "utf-32-be" if entry.dtype.str.startswith(">") else "utf-32-le"
    try:
        return parsed(raw.decode(byte_order).rstrip("\0"), schema.metadata)
    except ForeignError as error:
        raise DamagedError(f"its metadata: {error}") from None


def _numbers(archive: zipfile.ZipFile, entry: _Entry) -> np.ndarray:
    """The numbers of an array, in the byte order of this machine."""
    if entry.dtype.kind == "U":
        raise DamagedError(f"{shown(entry.name)} is text")
    room = np.empty(entry.info.file_size - entry.begins, np.uint8)
    filled = 0
    for some in _unpacked(archive, entry):
        room[filled : filled + len(some)] = np.frombuffer(some, np.uint8)
        filled += len(some)
    array = room.view(entry.dtype).reshape(entry.shape, order=entry.order)
    return array.astype(entry.dtype.newbyteorder("="), copy=False)


def _unpacked(archive: zipfile.ZipFile, entry: _Entry) -> Iterator[bytes]:
    """The bytes of an array, as many as its header tells, and whole by their checksum."""
    left = entry.info.file_size - entry.begins
    with archive.open(entry.info) as stored:
        stored.read(entry.begins)
        while left:
            some = stored.read(min(left, AT_ONCE))
            if not some:
                raise DamagedError(f"{shown(entry.name)} ends early")
            left -= len(some)
            yield some
        stored.read(1)  # at its end, which compares the checksum


def _refuse_values(
    name: str, array: np.ndarray, numbers: Numbers, lengths: Mapping[str, Any]
) -> None:
    """Refuses numbers that are not finite or beyond their bounds."""
    if not array.size:
        return
    if numbers.finite and not np.isfinite(array).all():
        raise DamagedError(f"{name} is not finite")
    low, high = array.min(), array.max()
    most = numbers.most if numbers.below is None else lengths[numbers.below] - 1
    if low < numbers.least or high > most:
        raise DamagedError(
            f"{name} reaches from {low:.4g} to {high:.4g}, beyond {numbers.least:.4g} to {most:.4g}"
        )
