"""The only import of jax-md: the three modules that are used, without the rest.

`import jax_md` runs the package's `__init__`, which loads its neural networks and rigid bodies:
about 6 to 9 s, against milliseconds for `space`, `partition` and `minimize`. Those three are loaded
here under a temporary package object that runs no `__init__`. Afterwards they are removed from
`sys.modules`, so that a user's own `import jax_md`, before or after, finds the whole package.
"""

import importlib
import importlib.util
import sys
import types


def _load(*names: str) -> list[types.ModuleType]:
    if "jax_md" in sys.modules:
        return [importlib.import_module(f"jax_md.{name}") for name in names]
    package = types.ModuleType("jax_md")
    spec = importlib.util.find_spec("jax_md")
    if spec is None:
        raise ModuleNotFoundError("jax_md", name="jax_md")
    package.__path__ = list(spec.submodule_search_locations or ())
    sys.modules["jax_md"] = package
    try:
        return [importlib.import_module(f"jax_md.{name}") for name in names]
    finally:
        for name in [name for name in sys.modules if name.split(".")[0] == "jax_md"]:
            del sys.modules[name]


space, partition, minimize = _load("space", "partition", "minimize")
