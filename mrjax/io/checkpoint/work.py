"""Descriptions of the work of a checkpoint: everything that its numbers depend on, as text."""

import dataclasses
import hashlib
import importlib.metadata
import json
from collections.abc import Iterator, Mapping
from typing import Any

import jax
import numpy as np
from jax.typing import ArrayLike
from pydantic import BaseModel

from mrjax.io.identity import identity
from mrjax.io.machine import machine

NUMERIC_PACKAGES = ("mrjax", "jax", "jaxlib", "llvmlite", "numpy", "scipy")
"""Packages whose version can change the last digits."""


def describe(work: Mapping[str, Any]) -> dict[str, str]:
    """Returns the description of a work, by name, and of the environment."""
    return {**dict(_entries("", work)), **environment()}


def environment() -> dict[str, str]:
    """Returns versions, processor and device, on which the last digits depend."""
    versions = {f"version of {name}": importlib.metadata.version(name) for name in NUMERIC_PACKAGES}
    return versions | {"machine": machine(), "device": jax.default_backend()}


def digest(*arrays: ArrayLike) -> str:
    """Returns a digest of arrays, to the last bit."""
    return sha256("", *map(np.asarray, arrays)).hexdigest()[:16]


def work_digest(work: dict[str, str]) -> str:
    """Returns a digest of the description of a work."""
    return sha256(json.dumps(work, sort_keys=True)).hexdigest()


def sha256(text: str, *arrays: np.ndarray) -> Any:
    """Returns the hash of a text, and of arrays with their types and shapes."""
    digest = hashlib.sha256(text.encode())
    for array in arrays:
        digest.update(f"{array.dtype}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
    return digest


def _entries(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yields the name and the text of every part of a value; an array is given by a digest."""
    if isinstance(value, jax.tree_util.Partial):
        value = {"law": identity(value.func), "arguments": value.args, **value.keywords}
    elif isinstance(value, BaseModel):
        value = dict(value)
    elif dataclasses.is_dataclass(value):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        value = {"law": identity(type(value)), **fields} if callable(value) else fields
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif isinstance(value, list | tuple):
        value = {str(number): item for number, item in enumerate(value)}
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _entries(f"{name}.{key}" if name else str(key), inner)
    elif isinstance(value, str | bool | int | float) or value is None:
        yield name, str(value)
    elif np.ndim(value):
        yield name, f"array {digest(value)}"
    else:
        yield name, str(np.asarray(value).item())
