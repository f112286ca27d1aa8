"""mrjax loads a part of jax-md, and leaves the whole of it to whoever asks for it.

Fresh interpreters, since this one has imported everything already.
"""

import os
import subprocess
import sys

import pytest

LIGHT = """
import sys
import mrjax
from mrjax.core import _jax_md
loaded = {name for name in sys.modules if name.split(".")[0] == "jax_md"}
assert "jax_md" not in loaded, "a half-made package is left behind"
assert not any(name.startswith(("jax_md.nn", "jax_md.rigid_body", "jax_md.energy")) for name in
               loaded), loaded
assert not {"flax", "e3nn_jax"} & set(sys.modules), "neural networks are loaded"
assert callable(_jax_md.partition.neighbor_list)
assert callable(_jax_md.minimize.fire_descent)
"""

AFTERWARDS = """
import mrjax, mrjax.core._jax_md
import jax_md
from jax_md import quantity, space
assert callable(jax_md.energy.soft_sphere_pair)
assert callable(jax_md.nn.GraphNetEncoder)
for name in ("space", "partition", "minimize", "simulate", "util", "smap", "dataclasses"):
    assert hasattr(jax_md, name), name
assert callable(quantity.temperature) and callable(space.periodic)
mrjax.Box((1.0, 1.0, 1.0)).space()
"""

ATTRIBUTES = """
import mrjax.core._jax_md
import jax_md, jax_md.quantity
assert callable(jax_md.quantity.temperature)
"""

BEFORE = """
import sys
import jax_md
package = sys.modules["jax_md"]
import mrjax
from mrjax.core import _jax_md
assert sys.modules["jax_md"] is package is jax_md
assert callable(jax_md.energy.soft_sphere_pair) and callable(jax_md.quantity.temperature)
assert _jax_md.space is jax_md.space, "a second copy of what was there"
"""


def succeeds(code: str) -> None:
    """In an interpreter of its own."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=100,
    )
    assert done.returncode == 0, done.stdout


def test_mrjax_loads_only_what_it_uses():
    succeeds(LIGHT)


@pytest.mark.slow
def test_jax_md_imports_whole_after_mrjax():
    succeeds(AFTERWARDS)


def test_submodules_are_attributes_of_jax_md_after_mrjax():
    succeeds(ATTRIBUTES)


def test_jax_md_may_be_imported_before_mrjax():
    succeeds(BEFORE)
