"""Messages between processes: JSON and the bytes of arrays, without executable content.

A message is the length of its JSON (8 bytes), the JSON, and all arrays one after another.
"""

import dataclasses
import json
import math
import struct
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mrjax.core.box import Box
from mrjax.core.errors import InputError, SimulationError, SystemRefusal
from mrjax.core.randomness import RandomStream
from mrjax.core.run import Run
from mrjax.core.state import ContactHistory, State
from mrjax.core.trajectory import Trajectory
from mrjax.recipe.recipe import Recipe

TABLES = {
    table.__name__: table for table in (Box, ContactHistory, RandomStream, Run, State, Trajectory)
}
"""Dataclasses by name."""
ERRORS = {error.__name__: error for error in (InputError, SimulationError, SystemRefusal)}
LENGTH = struct.Struct("!Q")
KINDS = "biufc"
"""Kinds of numbers, as in numpy's `dtype.kind`."""


def encode(value: Any) -> bytes:
    """Encodes a value as a message.

    Args:
      value: a value of numbers, text, arrays, lists, dictionaries, paths, recipes, `TABLES` and
        `ERRORS`.

    Raises:
      TypeError: the value holds anything else.
    """
    arrays: list[np.ndarray] = []
    text = json.dumps(_plain(value, arrays)).encode("ascii")
    contents = (np.ascontiguousarray(array).tobytes() for array in arrays)
    return b"".join((LENGTH.pack(len(text)), text, *contents))


def decode(message: bytes) -> Any:
    """Decodes a message; its arrays become arrays of JAX.

    Raises:
      ValueError: it is no message, or ends too early.
    """
    try:
        (length,) = LENGTH.unpack_from(message)
        tree = json.loads(message[LENGTH.size : LENGTH.size + length].decode("ascii"))
        return _Reader(message, LENGTH.size + length).value(tree)
    except (ValueError, struct.error, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"is no message of mrjax ({type(error).__name__})") from None


def _plain(value: Any, arrays: list[np.ndarray]) -> Any:
    """The value in forms that JSON has; its arrays go to `arrays`, in the order of reading."""
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return {type(value).__name__: [_plain(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": {key: _plain(item, arrays) for key, item in value.items()}}
    if isinstance(value, np.ndarray | jax.Array):
        array = np.asarray(value)
        if array.dtype.kind not in KINDS:
            raise TypeError(f"an array of {array.dtype} is not sent")
        arrays.append(array)
        return {"array": [array.dtype.str, list(array.shape)]}
    if isinstance(value, Path):
        return {"path": str(value)}
    if isinstance(value, Recipe):
        return {"recipe": value.model_dump(mode="json", exclude_unset=True)}
    if (name := type(value).__name__) in TABLES:
        fields = dataclasses.fields(value)
        return {name: {field.name: _plain(getattr(value, field.name), arrays) for field in fields}}
    if isinstance(value, Exception) and name in ERRORS:
        more = {key: _plain(getattr(value, key, None), arrays) for key in _MORE_OF_ERROR}
        return {name: {"text": str(value), **more}}
    raise TypeError(f"a {name} is not sent")


_MORE_OF_ERROR = ("state", "time", "faults")
"""Attributes of a `SimulationError` beside its text."""


class _Reader:
    """Reads arrays from a message, one after another."""

    def __init__(self, message: bytes, offset: int) -> None:
        self.message, self.offset = message, offset

    def value(self, tree: Any) -> Any:
        """The value that JSON stands for."""
        if not isinstance(tree, dict):
            return tree
        ((kind, content),) = tree.items()
        match kind:
            case "list":
                return [self.value(item) for item in content]
            case "tuple":
                return tuple(self.value(item) for item in content)
            case "dict":
                return {key: self.value(item) for key, item in content.items()}
            case "array":
                return jnp.asarray(self._array(*content))
            case "path":
                return Path(content)
            case "recipe":
                return Recipe.model_validate(content)
        fields = {name: self.value(item) for name, item in content.items()}
        if kind in TABLES:
            return TABLES[kind](**fields)
        error = ERRORS[kind](fields["text"])
        if isinstance(error, SimulationError):
            error.state, error.time = fields["state"], fields["time"]
            error.faults = fields["faults"]
        return error

    def _array(self, dtype: str, shape: list[int]) -> np.ndarray:
        """The next array; numpy refuses one that is longer than the message."""
        kind = np.dtype(dtype)
        if kind.kind not in KINDS or min(shape, default=0) < 0:
            raise TypeError(dtype)
        array = np.frombuffer(self.message, kind, math.prod(shape), self.offset)
        self.offset += array.nbytes
        return array.reshape(shape)
