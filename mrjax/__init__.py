"""A differentiable simulator for the settling of magnetorheological fluids (Son 2018).

The public names are those of `__init__.pyi`. Each is imported when it is first used: a command's
`--help` needs no JAX.
"""

import importlib
from importlib.metadata import version
from typing import Any

import lazy_loader

import mrjax.core.quiet_xla  # noqa: F401 - has to come before JAX
from mrjax.core import aliases

_public, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = version("mrjax")

aliases.install("mrjax", aliases.OLD_NAMES, aliases.FUNCTIONS)


def __getattr__(name: str) -> Any:
    """Returns a public name, or the module that an old name stands for."""
    if name in aliases.OLD_NAMES and name not in __all__:
        return importlib.import_module(f"mrjax.{name}")
    return _public(name)
