"""Fits the simulator to measurements, and says what the data determine.

The public names are those of `__init__.pyi`, each imported when it is first used.
"""

import lazy_loader

import mrjax  # noqa: F401 - has to come before JAX, so that it can hush it

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
