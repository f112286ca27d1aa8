"""The identity of a function in a checkpoint: a digest of its code and of all that it reads."""

import hashlib
import inspect
from collections.abc import Callable, Iterator
from types import CodeType, ModuleType
from typing import Any

import jax
import numpy as np

from mrjax.core.errors import InputError, shown

VERSIONED_PACKAGES = ("mrjax", "jax", "jaxlib", "numpy", "builtins", "math")
"""Packages whose functions are identified by name, because their versions are recorded."""


def identity(function: Callable) -> str:
    """Returns the name of a function with a digest of its code; for mrjax's own, the name alone.

    Raises:
      InputError: the function reads a value that has no digest.
    """
    name = getattr(function, "__qualname__", type(function).__qualname__)
    if _package(function) == "mrjax":
        return name
    digest = hashlib.sha256()
    for part in _parts(function, set()):
        digest.update(f"{part}\n".encode())
    return f"{name} {digest.hexdigest()[:16]}"


def _parts(value: Any, visited: set[int]) -> Iterator[str]:
    """Yields every part of a value as text."""
    if isinstance(value, str | bytes | bool | int | float | complex) or value is None:
        yield f"{type(value).__name__} {value!r}"
    elif isinstance(value, np.ndarray | np.generic | jax.Array):
        array = np.asarray(value)
        yield f"array {array.dtype} {array.shape} {array.tobytes().hex()}"
    elif isinstance(value, tuple | list | frozenset):
        yield f"{type(value).__name__} {len(value)}"
        for item in sorted(value, key=repr) if isinstance(value, frozenset) else value:
            yield from _parts(item, visited)
    elif isinstance(value, CodeType):
        yield f"code {value.co_code.hex()} {value.co_names} {value.co_varnames}"
        yield from _parts(value.co_consts, visited)
    elif isinstance(value, ModuleType):
        yield f"module {value.__name__}"
    elif _package(value) in VERSIONED_PACKAGES:
        yield f"{value.__module__}.{getattr(value, '__qualname__', type(value).__qualname__)}"
    elif isinstance(value, type):
        yield f"class {value.__qualname__}"
        if id(value) not in visited:
            visited.add(id(value))
            for kind in value.__mro__[:-1]:
                yield from _class_parts(kind, visited)
    elif inspect.isfunction(value):
        yield "function"
        if id(value) not in visited:
            visited.add(id(value))
            yield from _function_parts(value, visited)
    else:
        raise InputError(
            f"{shown(value)}: is read by a function, and a checkpoint cannot recognise it later; "
            "give the function numbers and arrays, or leave checkpoint out"
        )


def _function_parts(function: Callable, visited: set[int]) -> Iterator[str]:
    """Yields the code, the defaults, and the outer variables that a function reads."""
    module_names = function.__globals__
    read = {name: module_names[name] for name in _names(function.__code__) if name in module_names}
    enclosed = inspect.getclosurevars(function).nonlocals
    yield from _parts(function.__code__, visited)
    yield from _parts(function.__defaults__, visited)
    for names in (function.__kwdefaults__ or {}, enclosed, read):
        for name in sorted(names):
            yield name
            yield from _parts(names[name], visited)


def _class_parts(kind: type, visited: set[int]) -> Iterator[str]:
    """Yields the methods and plain attributes that a class defines itself."""
    if _package(kind) in VERSIONED_PACKAGES:
        yield f"{kind.__module__}.{kind.__qualname__}"
        return
    for name, value in sorted(vars(kind).items()):
        own = not name.startswith("__") or name == "__call__"
        if own and (inspect.isfunction(value) or isinstance(value, str | bool | int | float)):
            yield name
            yield from _parts(value, visited)


def _names(code: CodeType) -> set[str]:
    """Returns the outer names that a function, and the functions within it, may read."""
    inner = (item for item in code.co_consts if isinstance(item, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _package(value: Any) -> str:
    return str(getattr(value, "__module__", None)).partition(".")[0]
