"""A differentiable simulator for the settling of magnetorheological fluids (Son 2018).

The public names are those of `__init__.pyi`. Each is imported when it is first used: a command's
`--help` needs no JAX. A function wins over the file of its name (`mrjax.settle`).
"""

from importlib.metadata import version

import lazy_loader

import mrjax.core.quiet_xla  # noqa: F401 - has to come before JAX

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

__version__ = version("mrjax")
