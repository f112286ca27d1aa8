"""What a command loads before it answers, and public names that are imported when they are used.

Fresh interpreters, since this one has imported everything already.
"""

import json
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
import mrjax
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.laws import drag, normal, time_scales
from mrjax.simulation import softening

ENDING = """
import json, sys
from {module}.__main__ import main
sys.argv = {arguments}
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print("loaded:", json.dumps([name for name in sys.modules if "." not in name or "mrjax" in name]))
"""


def printed(code: str, **environment: str) -> str:
    ended = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        | {"JAX_ENABLE_COMPILATION_CACHE": "false", **environment},
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def loaded_by(module: str, *arguments: str) -> tuple[str, set[str]]:
    """What a command says, and what it has loaded at its end."""
    said = printed(ENDING.format(module=module, arguments=[module, *arguments]))
    said, _, names = said.rpartition("loaded:")
    return said, set(json.loads(names))


HEAVY = {
    "jax",
    "numpy",
    "scipy",
    "pydantic",
    "matplotlib",
    "llvmlite",
    "optax",
    "mrjax.core._jax_md",
}


@pytest.mark.parametrize(
    "module, arguments",
    [
        ("mrjax", ["--help"]),
        ("mrjax", ["simulate", "--help"]),
        ("mrjax", ["reproduce", "--help"]),
        ("mrjax", ["check", "--help"]),
        ("mrjax", ["column", "--help"]),
        ("mrjax", ["--version"]),
        ("calibrate", ["--help"]),
        ("calibrate", ["--version"]),
    ],
)
def test_a_help_loads_no_library_of_numbers(module, arguments):
    said, loaded = loaded_by(module, *arguments)
    assert said and "click" in loaded
    assert not HEAVY & loaded


def test_a_check_loads_jax_and_little_more():
    said, loaded = loaded_by("mrjax", "check", "case2")
    assert "9.1164 mm/day" in said
    assert {"jax", "numpy", "pydantic"} <= loaded
    assert not {"scipy", "matplotlib", "llvmlite", "optax", "tqdm", "mrjax.core._jax_md"} & loaded


COMPILED = """
import jax
jax.config.update("jax_enable_x64", True)
seen = []
jax.monitoring.register_event_duration_secs_listener(lambda event, *_, **__: seen.append(event))
import mrjax
from mrjax.simulation import derived
recipe = mrjax.Recipe.load({recipe!r}).replace(drag={{"local": {local}}})
derived.derived(recipe), derived.warnings(recipe)
print(seen.count("/jax/core/compile/backend_compile_duration"))
jax.jit(lambda x: x + 1)(1.0)
print(seen.count("/jax/core/compile/backend_compile_duration"))
"""


@pytest.mark.parametrize("recipe, local", [("case2", False), ("case3", True)])
def test_what_follows_from_a_recipe_is_not_compiled(recipe, local):
    """It was some sixty programs of one operation each, 20 ms apiece."""
    compiled, one_more = map(int, printed(COMPILED.format(recipe=recipe, local=local)).split())
    assert compiled <= 4
    assert one_more == compiled + 1  # they are counted at all


CLOSED_FORM = """
import sys
import jax
jax.config.update("jax_enable_x64", True)
import calibrate
from calibrate.problem.solve import fit_experiment
_, fit = fit_experiment(calibrate.Experiment.load("fang2005"), "closed-form")
assert fit.converged
assert "jax" in sys.modules and "optax" in sys.modules
unused = {"mrjax.core._jax_md", "mrjax.simulation.simulate"}
unused |= {"jax_md", "llvmlite", "matplotlib", "blackjax"}
print(sorted(unused & set(sys.modules)))
"""


def test_a_closed_form_fit_is_done_without_jax_md():
    assert printed(CLOSED_FORM).strip() == "[]"


NAMES = """
import importlib, pathlib, pkgutil, re, sys, types
import {package} as package
assert "jax" not in sys.modules and "numpy" not in sys.modules
names = package.__all__
assert set(names) <= set(dir(package))
folder = pathlib.Path(package.__file__).parent
stub = (folder / "__init__.pyi").read_text()
modules = [
    name
    for room, name in re.findall(r"^from \\.([\\w.]*) import (\\w+) as", stub, re.M)
    if any((folder / room.replace(".", "/") / end).exists() for end in (name, name + ".py"))
]
files = [m.name for m in pkgutil.iter_modules(package.__path__)]
aliases = importlib.import_module("{aliases}")
files += aliases.OLD_NAMES
shadowed = [name for name in files if name in names and name not in modules]
assert len(shadowed) >= 2
for name in shadowed[::2]:  # the file first, or the name first
    module = importlib.import_module("{package}." + name)
    assert isinstance(module, types.ModuleType)
for name in names:
    found = getattr(package, name)
    assert isinstance(found, types.ModuleType) == (name in modules), name
    assert found is vars(importlib.import_module("{package}")).get(name, found)
for name in shadowed:
    importlib.import_module("{package}." + name)
    assert callable(getattr(package, name)), name
from {package} import *
assert all(eval(name) is getattr(package, name) for name in names)
try:
    package.nothing
except AttributeError as error:
    assert "nothing" in str(error)
else:
    raise AssertionError
"""


@pytest.mark.parametrize("package", ["mrjax", "calibrate"])
def test_a_public_name_is_what_it_says_and_not_the_file_of_that_name(package):
    aliases = {"mrjax": "mrjax.core.aliases", "calibrate": "calibrate.aliases"}[package]
    printed(NAMES.format(package=package, aliases=aliases))


def test_the_public_names_are_all_there():
    assert {"Recipe", "Parameters", "simulate", "settle", "sedimentation"} < set(mrjax.__all__)
    assert {"Experiment", "fit", "identify", "FORWARD_MODELS"} < set(calibrate.__all__)
    assert mrjax.MM_PER_DAY == 86400e3


# Numbers without XLA ----------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [jnp.float64, jnp.float32])
def test_numbers_by_numpy_are_those_of_jax(dtype):
    parameters = mrjax.Recipe.load("case3").parameters(dtype)
    radius = np.linspace(1e-6, 3e-6, 7).astype(dtype)
    many = parameters.replace(radius=jnp.asarray(radius))
    overlap = dtype(1e-8)
    for law, *arguments in (
        (normal.damping_ratio, parameters.restitution),  # a loop
        (drag.coefficient, many),
        (mrjax.terminal_velocity, many),
        (time_scales.largest_stable_step, many, overlap),
        (time_scales.time_step, parameters),
        (lambda parameters: softening.resting_overlap(parameters, mrjax.Box((1e-5,) * 3), 7), many),
        (drag.son2018, dtype(0.3)),
        (drag.haberman_sayre, dtype(0.3)),
    ):
        found, expected = evaluate_with_numpy(law, *arguments), law(*arguments)
        assert isinstance(found, np.ndarray)
        assert found.dtype == expected.dtype == dtype and found.shape == expected.shape
        # Powers and logarithms of two libraries: some units in the last place.
        np.testing.assert_allclose(found, expected, rtol=16 * np.finfo(dtype).eps)


def test_what_numpy_does_not_know_is_left_to_jax():
    def law(tree, times):
        counted = jax.lax.fori_loop(0, times, lambda _, x: x * 1.5, tree["a"])
        return {"b": jnp.sort(jnp.sin(counted)), "c": (jnp.sum(tree["a"]) > 2.0, times // 2)}

    tree = {"a": jnp.array([3.0, 1.0, 2.0])}
    found, expected = evaluate_with_numpy(law, tree, 3), law(tree, 3)
    np.testing.assert_allclose(found["b"], expected["b"], rtol=1e-15)
    assert found["c"] == (True, 1)


def test_by_numpy_neither_warns_nor_hides_what_is_no_number():
    assert evaluate_with_numpy(jnp.sqrt, -1.0) != evaluate_with_numpy(jnp.sqrt, -1.0)
    assert evaluate_with_numpy(lambda x: 1.0 / x, 0.0) == np.inf
    assert np.isnan(evaluate_with_numpy(lambda x: jnp.max(jnp.array([1.0, x])), np.nan))


def test_by_numpy_knows_numbers_while_others_are_traced():
    @jax.jit
    def traced(x):
        with jax.ensure_compile_time_eval():
            known = float(evaluate_with_numpy(drag.son2018, 0.2))
        return x * known

    assert float(traced(2.0)) == pytest.approx(2 * float(drag.son2018(0.2)), rel=1e-14)
