"""The examples of docstrings: each gives what it says, and what people begin with has one."""

import doctest
import importlib
import pkgutil

import jax
import jax.numpy as jnp
import pytest

import calibrate
import mrjax

NAMES = {"mrjax": mrjax, "calibrate": calibrate, "jnp": jnp}
"""What every example may use, beside double precision."""
BEGIN_WITH = [
    "mrjax.Recipe.load",
    "mrjax.Parameters.replace",
    "mrjax.disperse",
    "mrjax.place",
    "mrjax.simulate",
    "mrjax.softened",
    "mrjax.time_step",
    "mrjax.terminal_velocity",
    "mrjax.sedimentation_ratio",
    "mrjax.column",
    "mrjax.ensemble",
    "mrjax.kernel.pair_sum",
    "calibrate.Experiment.load",
    "calibrate.Problem.prepare",
    "calibrate.fit",
    "calibrate.identify",
]


def examples() -> list:
    """All of them, by where they stand."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    modules = [
        importlib.import_module(module.name)
        for package in (mrjax, calibrate)
        for module in pkgutil.walk_packages(package.__path__, package.__name__ + ".")
        if not module.name.endswith("__main__")
    ]
    found = [test for module in modules for test in finder.find(module, extraglobs=NAMES)]
    return [pytest.param(test, id=test.name) for test in found if test.examples]


@pytest.mark.parametrize("example", examples())
def test_an_example_gives_what_it_says(example):
    with jax.numpy_rank_promotion("allow"), jax.numpy_dtype_promotion("standard"):
        said = []
        doctest.DocTestRunner().run(example, out=said.append)
    assert not said, "".join(said)


@pytest.mark.parametrize("name", BEGIN_WITH)
def test_what_people_begin_with_has_an_example(name):
    package, _, rest = name.partition(".")
    assert ">>> " in pkgutil.resolve_name(f"{package}:{rest}").__doc__
