"""The zip archive of a file: its directory, the headers of its arrays, and their bytes.

Directory and headers are checked against the size of the file before memory is allocated.
"""

import math
import re
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from pydantic import BaseModel

from mrjax.core.errors import shown
from mrjax.io.markers import ForeignError, parse
from mrjax.io.npz.schema import DamagedError, Schema

M = TypeVar("M", bound=BaseModel)

METADATA = "metadata"
"""Name of the JSON entry, which describes the arrays."""
MAX_BYTES = 2**33
"""Default for the largest size of all arrays of a file, unpacked."""
MOST_METADATA = 2**26
"""Largest size of the JSON of a file, unpacked, in bytes."""
MOST_ENTRIES = 1000
MOST_HEADER = 10_000
"""Largest size of the header of an array in bytes, as in numpy."""
AT_ONCE = 2**22
"""Number of bytes unpacked at a time."""
ENCRYPTED = 0x1 | 0x40
"""Flags of an encrypted entry."""
HEADER = re.compile(
    rb"\{\s*'descr':\s*'([<>|=]?[biufcU]\d{1,9})',\s*'fortran_order':\s*(False|True),"
    rb"\s*'shape':\s*\(((?:\d{1,19},\s*)*(?:\d{1,19})?)\),?\s*\}\s*"
)
"""The header of an array as every version of numpy writes it; it is matched, never evaluated."""


@dataclass(frozen=True)
class Entry:
    """The header of an array in a file."""

    name: str
    info: zipfile.ZipInfo
    offset: int  # byte of the entry at which the numbers begin
    shape: tuple[int, ...]
    dtype: np.dtype
    order: Any  # "C" or "F", as numpy's type stubs have it


def refuse_directory(archive: zipfile.ZipFile, schema: Schema, length: int, max_bytes: int) -> None:
    """Refuses an archive whose directory is inconsistent, or unpacks to more than `max_bytes`."""
    infos = archive.infolist()
    names = [info.filename for info in infos]
    if len(names) > MOST_ENTRIES or len(set(names)) < len(names):
        raise DamagedError("it has an entry twice, or too many entries")
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


def read_entry(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> Entry:
    """Reads the header of an array; refuses one that does not match the size of the entry."""
    name = info.filename.removesuffix(".npy")
    with archive.open(info) as entry:
        version = np.lib.format.read_magic(entry)
        size = {(1, 0): 2, (2, 0): 4}.get(version, 0)
        header_length = int.from_bytes(entry.read(size), "little")
        text = entry.read(min(header_length, MOST_HEADER + 1))
    header = HEADER.fullmatch(text)
    if not size or len(text) != header_length or header is None:
        raise DamagedError(f"the header of {shown(name)} is not numpy's")
    shape = tuple(int(axis) for axis in header[3].split(b",") if axis.strip())
    dtype = np.dtype(header[1].decode())
    offset = np.lib.format.MAGIC_LEN + size + header_length
    if dtype.itemsize == 0 or offset + math.prod(shape) * dtype.itemsize != info.file_size:
        raise DamagedError(f"{shown(name)} has shape {shown(shape)}, but not as many numbers")
    return Entry(name, info, offset, shape, dtype, "F" if header[2] == b"True" else "C")


def read_metadata(archive: zipfile.ZipFile, entry: Entry, schema: Schema[M]) -> M:
    """Reads the JSON entry as the model of the schema."""
    if entry.shape or entry.dtype.kind != "U" or entry.dtype.itemsize > MOST_METADATA:
        raise DamagedError("its metadata are not text")
    raw = b"".join(_read_blocks(archive, entry))
    byte_order = "utf-32-be" if entry.dtype.str.startswith(">") else "utf-32-le"
    try:
        return parse(raw.decode(byte_order).rstrip("\0"), schema.metadata)
    except ForeignError as error:
        raise DamagedError(f"its metadata: {error}") from None


def read_numbers(archive: zipfile.ZipFile, entry: Entry) -> np.ndarray:
    """Reads the numbers of an array, in the byte order of this machine."""
    if entry.dtype.kind == "U":
        raise DamagedError(f"{shown(entry.name)} is text")
    buffer = np.empty(entry.info.file_size - entry.offset, np.uint8)
    filled = 0
    for block in _read_blocks(archive, entry):
        buffer[filled : filled + len(block)] = np.frombuffer(block, np.uint8)
        filled += len(block)
    array = buffer.view(entry.dtype).reshape(entry.shape, order=entry.order)
    return array.astype(entry.dtype.newbyteorder("="), copy=False)


def _read_blocks(archive: zipfile.ZipFile, entry: Entry) -> Iterator[bytes]:
    """Yields the bytes of an array, in blocks; compares their number and their checksum."""
    remaining = entry.info.file_size - entry.offset
    with archive.open(entry.info) as stored:
        stored.read(entry.offset)
        while remaining:
            block = stored.read(min(remaining, AT_ONCE))
            if not block:
                raise DamagedError(f"{shown(entry.name)} ends early")
            remaining -= len(block)
            yield block
        stored.read(1)  # zipfile compares the checksum at the end
