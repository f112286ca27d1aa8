"""Fits the simulator to measurements, and says what the data determine.

The public names are those of `__init__.pyi`, each imported when it is first used.
"""

import importlib
from typing import Any

import lazy_loader

import mrjax  # noqa: F401 - has to come before JAX, so that it can hush it
from calibrate import aliases
from mrjax.core.aliases import install

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

install("calibrate", aliases.OLD_NAMES, aliases.FUNCTIONS)


def __getattr__(name: str) -> Any:
    """A public name, or the module that an old name stands for."""
    if name in aliases.OLD_NAMES and name not in __all__:
        return importlib.import_module(f"calibrate.{name}")
    return _public(name)
