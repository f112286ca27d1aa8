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
from mrjax import _jax_md
loaded = {name for name in sys.modules if name.split(".")[0] == "jax_md"}
assert "jax_md" not in loaded, "a half-made package is left behind"
assert not any(name.startswith(("jax_md.nn", "jax_md.rigid_body", "jax_md.energy")) for name in
               loaded), loaded
assert not {"flax", "e3nn_jax"} & set(sys.modules), "neural networks are loaded"
assert callable(_jax_md.partition.neighbor_list)
assert callable(_jax_md.minimize.fire_descent)
"""

AFTERWARDS = """
import mrjax, mrjax._jax_md
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
import mrjax._jax_md
import jax_md, jax_md.quantity
assert callable(jax_md.quantity.temperature)
"""

BEFORE = """
import sys
import jax_md
package = sys.modules["jax_md"]
import mrjax
from mrjax import _jax_md
assert sys.modules["jax_md"] is package is jax_md
assert callable(jax_md.energy.soft_sphere_pair) and callable(jax_md.quantity.temperature)
assert _jax_md.space is jax_md.space, "a second copy of what was there"
"""


@pytest.fixture(scope="module")
def interpreters():
    """All of them at once: importing the whole of jax-md takes seconds."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    started = {
        name: subprocess.Popen(
            [sys.executable, "-c", code],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
        )
        for name, code in (
            ("light", LIGHT),
            ("afterwards", AFTERWARDS),
            ("attributes", ATTRIBUTES),
            ("before", BEFORE),
        )
    }
    yield started
    for process in started.values():
        process.kill()


def succeeds(process) -> None:
    output, _ = process.communicate(timeout=100)
    assert process.returncode == 0, output


def test_mrjax_loads_only_what_it_uses(interpreters):
    succeeds(interpreters["light"])


@pytest.mark.slow
def test_jax_md_imports_whole_after_mrjax(interpreters):
    succeeds(interpreters["afterwards"])


def test_submodules_are_attributes_of_jax_md_after_mrjax(interpreters):
    succeeds(interpreters["attributes"])


def test_jax_md_may_be_imported_before_mrjax(interpreters):
    succeeds(interpreters["before"])
