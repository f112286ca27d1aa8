"""Fits the simulator to measurements, and reports what the data determine.

The public names are in `__init__.pyi`; each is imported at its first use.
"""

import importlib
from typing import Any

import lazy_loader

import mrjax  # noqa: F401 - sets up JAX before JAX is imported
from calibrate import aliases
from mrjax.core.aliases import install

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

install("calibrate", aliases.OLD_NAMES, aliases.FUNCTIONS)


def __getattr__(name: str) -> Any:
    """A public name, or the module that an old name stands for."""
    if name in aliases.OLD_NAMES and name not in __all__:
        return importlib.import_module(f"calibrate.{name}")
    return _public(name)
