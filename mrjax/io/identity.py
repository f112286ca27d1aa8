"""The identity of a function when work goes on: a digest of its code and of all that it reads."""

import hashlib
import inspect
from collections.abc import Callable, Iterator
from types import CodeType, ModuleType
from typing import Any

import jax
import numpy as np

from mrjax.core.errors import InputError, shown

VERSIONED_PACKAGES = ("mrjax", "jax", "jaxlib", "numpy", "builtins", "math")
"""Packages whose functions are identified by name: their versions are recorded besides."""


def identity(function: Callable) -> str:
    """The name of a function and a digest of what it does; of one of ours the name alone.

    Raises:
      InputError: it reads what cannot be told from another.
    """
    name = getattr(function, "__qualname__", type(function).__qualname__)
    if _package(function) == "mrjax":
        return name
    digest = hashlib.sha256()
    for part in _parts(function, set()):
        digest.update(f"{part}\n".encode())
    return f"{name} {digest.hexdigest()[:16]}"


def _parts(value: Any, seen: set[int]) -> Iterator[str]:
    """Every part of a value, as text."""
    if isinstance(value, str | bytes | bool | int | float | complex) or value is None:
        yield f"{type(value).__name__} {value!r}"
    elif isinstance(value, np.ndarray | np.generic | jax.Array):
        array = np.asarray(value)
        yield f"array {array.dtype} {array.shape} {array.tobytes().hex()}"
    elif isinstance(value, tuple | list | frozenset):
        yield f"{type(value).__name__} {len(value)}"
        for item in sorted(value, key=repr) if isinstance(value, frozenset) else value:
            yield from _parts(item, seen)
    elif isinstance(value, CodeType):
        yield f"code {value.co_code.hex()} {value.co_names} {value.co_varnames}"
        yield from _parts(value.co_consts, seen)
    elif isinstance(value, ModuleType):
        yield f"module {value.__name__}"
    elif _package(value) in VERSIONED_PACKAGES:
        yield f"{value.__module__}.{getattr(value, '__qualname__', type(value).__qualname__)}"
    elif inspect.isfunction(value):
        yield "function"
        if id(value) not in seen:
            seen.add(id(value))
            yield from _parts_of_function(value, seen)
    else:
        raise InputError(
            f"{shown(value)}: is read by a function, and cannot be told from another when the work "
            "goes on; give the function numbers and arrays, or leave checkpoint out"
        )


def _parts_of_function(function: Callable, seen: set[int]) -> Iterator[str]:
    """Code, defaults, and what it finds outside itself."""
    everywhere = function.__globals__
    read = {name: everywhere[name] for name in _names(function.__code__) if name in everywhere}
    enclosed = inspect.getclosurevars(function).nonlocals
    yield from _parts(function.__code__, seen)
    yield from _parts(function.__defaults__, seen)
    for names in (function.__kwdefaults__ or {}, enclosed, read):
        for name in sorted(names):
            yield name
            yield from _parts(names[name], seen)


def _names(code: CodeType) -> set[str]:
    """Names that a function, and those within it, may read from outside."""
    inner = (item for item in code.co_consts if isinstance(item, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _package(value: Any) -> str:
    return str(getattr(value, "__module__", None)).partition(".")[0]
