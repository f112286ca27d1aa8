"""Files damaged in seeded ways: as bytes, as zip archives, and as arrays with their headers."""

import io
import json
import random
import struct
import warnings
import zipfile
from collections.abc import Callable

import numpy as np

Arrays = dict[str, np.ndarray | bytes]

SHAPES = ["(10**9, 3)", "(9223372036854775807,)", "(18446744073709551616,)", "(-1, 3)", "(1e3,)"]
"""Of arrays that are not there."""
HEADERS = ["(" * 500, "{'descr': '<f8", "{'descr': '|O', 'fortran_order': False, 'shape': ()}", ""]
TEXTS = ["[]", "3", "null", "{}", "[" * 5000, '{"a": ' * 3000, "NaN", '"\\ud800"', "1" * 5000]
"""Of JSON that is no metadata."""


def npy(header: str, data: bytes = b"") -> bytes:
    """An array in numpy's format with any header."""
    text = header.encode() + b" " * (64 - (len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


def packed(arrays: Arrays, method: int = zipfile.ZIP_STORED) -> bytes:
    """Arrays by name as an archive; bytes are taken for the whole of an entry."""
    whole = io.BytesIO()
    with zipfile.ZipFile(whole, "w", method) as archive:
        for name, array in arrays.items():
            if not isinstance(array, bytes):
                one = io.BytesIO()
                np.save(one, array)
                array = one.getvalue()
            archive.writestr(name + ".npy", array)
    return whole.getvalue()


def unpacked(data: bytes) -> Arrays:
    """All arrays of an archive that is right."""
    with np.load(io.BytesIO(data)) as stored:
        return {name: stored[name] for name in stored.files}


def flipped(data: bytes, chance: random.Random) -> bytes:
    """One bit or up to eight bytes changed."""
    changed = bytearray(data)
    for _ in range(chance.choice([1, 1, 2, 8])):
        changed[chance.randrange(len(changed))] ^= chance.choice([1, 1 << chance.randrange(8), 255])
    return bytes(changed)


def cut(data: bytes, chance: random.Random) -> bytes:
    """The beginning, the end, or all but a stretch in the middle."""
    first, second = sorted(chance.randrange(len(data)) for _ in range(2))
    return chance.choice([data[:first], data[first:], data[:first] + data[second:]])


def overwritten(data: bytes, chance: random.Random) -> bytes:
    """Zeros or noise over a stretch, inserted, or at the end."""
    noise = chance.choice([bytes, chance.randbytes])(chance.randrange(1, 200))
    place = chance.randrange(len(data))
    return chance.choice(
        [
            data[:place] + noise + data[place + len(noise) :],
            data[:place] + noise,
            noise,
            data + noise,
        ]
    )


def in_the_directory(data: bytes, chance: random.Random) -> bytes:
    """One field changed in what the archive tells of an entry: lengths, methods, places."""
    changed, marks = bytearray(data), []
    for mark in (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06"):
        place = -1
        while (place := data.find(mark, place + 1)) >= 0:
            marks.append(place)
    place = chance.choice(marks or [0]) + 4 + chance.randrange(26)
    changed[min(place, len(changed) - 1)] = chance.randrange(256)
    return bytes(changed)


def _one(arrays: Arrays, chance: random.Random) -> tuple[str, np.ndarray]:
    name = chance.choice([name for name in arrays if name != "metadata"])
    array = arrays[name]
    assert isinstance(array, np.ndarray)
    return name, array


def other_array(arrays: Arrays, chance: random.Random) -> Arrays:
    """One array of another shape, kind or value."""
    name, array = _one(arrays, chance)
    rows = len(array) if array.ndim else 1
    bad = array.astype(float).reshape(-1).copy()
    bad[:1] = chance.choice([np.nan, np.inf, -np.inf])
    changed = [
        array[None],
        np.zeros((rows + 2, *array.shape[1:]), array.dtype),
        np.zeros((), array.dtype),
        np.zeros((0, *array.shape[1:]), array.dtype),
        array.astype("U5"),
        array.astype(np.complex128),
        array.astype(np.int64),
        array.astype(np.float16),
        np.zeros(array.shape, "M8[s]"),
        np.zeros(array.shape, [("a", "f8")]),
        bad.reshape(array.shape),
        -1e30 * np.ones(array.shape),
        array.astype(array.dtype.newbyteorder()),
        np.asfortranarray(array),
    ]
    return arrays | {name: chance.choice(changed)}


def other_header(arrays: Arrays, chance: random.Random) -> Arrays:
    """One array whose header tells what is not there, or nothing."""
    name, array = _one(arrays, chance)
    shape = chance.choice([*SHAPES, "(3000000,)", str(array.shape)])
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
    data = chance.choice([b"", bytes(64), array.tobytes()])
    return arrays | {name: npy(chance.choice([header, *HEADERS]), data)}


def other_names(arrays: Arrays, chance: random.Random) -> Arrays:
    """An array missing, beside the others, or in the place of another."""
    name, array = _one(arrays, chance)
    other, second = _one(arrays, chance)
    without = {key: one for key, one in arrays.items() if key != name}
    return chance.choice(
        [
            without,
            arrays | {"a\x1b[31m": array},
            arrays | {f"../{name}": array},
            arrays | {name: second, other: array},
            {key: one for key, one in arrays.items() if key == "metadata"},
            {key: one for key, one in arrays.items() if key != "metadata"},
        ]
    )


def other_metadata(arrays: Arrays, chance: random.Random) -> Arrays:
    """Metadata that are none, or with one value of another kind."""
    told = json.loads(arrays["metadata"].item())
    key = chance.choice(list(told))
    values = [None, "x", -1, 0, 1e400, True, [1], {}, 10**400, [1e-6, -1, 1], [True] * 4, "\x00"]
    changed = [json.dumps(told | {key: chance.choice(values)}), *TEXTS]
    changed.append(json.dumps({name: one for name, one in told.items() if name != key}))
    text = np.asarray(chance.choice(changed))
    return arrays | {"metadata": chance.choice([text, text, text, np.asarray([text.item()] * 2)])}


def archived(arrays: Arrays, chance: random.Random) -> bytes:
    """An archive of another kind: compressed, damaged so, encrypted, or with an entry twice."""
    method = chance.choice([zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
    data = packed(arrays, method)
    name, _ = _one(arrays, chance)
    large = npy("{'descr':'<f8','fortran_order':False,'shape':(300000,)}", bytes(2_400_000))
    twice = io.BytesIO(packed(arrays))
    with zipfile.ZipFile(twice, "a") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        archive.writestr(name + ".npy", b"junk")
    encrypted = bytearray(data)
    for mark, offset in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        place = -1
        while (place := data.find(mark, place + 1)) >= 0:
            encrypted[place + offset] |= 1
    return chance.choice(
        [
            data,
            flipped(data, chance),
            packed(arrays | {name: large}, zipfile.ZIP_DEFLATED),
            twice.getvalue(),
            bytes(encrypted),
        ]
    )


BYTES: list[Callable[[bytes, random.Random], bytes]] = [
    flipped,
    cut,
    overwritten,
    in_the_directory,
]
CONTENTS: list[Callable[[Arrays, random.Random], Arrays]] = [
    other_array,
    other_header,
    other_names,
    other_metadata,
]


def damaged(data: bytes, chance: random.Random) -> bytes:
    """A file damaged in one way, or in two."""
    kind = chance.randrange(3)
    if kind == 0:
        return chance.choice(BYTES)(data, chance)
    arrays = unpacked(data)
    found = (
        archived(arrays, chance) if kind == 2 else packed(chance.choice(CONTENTS)(arrays, chance))
    )
    return flipped(found, chance) if chance.random() < 0.1 else found
