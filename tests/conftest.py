"""Strict JAX for every test: double precision, no silent promotion of dtypes or ranks."""

import jax
import pytest

import mrjax
from mrjax import reproduce

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(scope="session", params=["case1", "case2", "case3"])
def case(request) -> mrjax.Recipe:
    """Each of the paper's three cases."""
    return mrjax.Recipe.load(request.param)


@pytest.fixture(scope="session")
def case2() -> mrjax.Recipe:
    return mrjax.Recipe.load("case2")


@pytest.fixture(scope="session")
def case3() -> mrjax.Recipe:
    return mrjax.Recipe.load("case3")


@pytest.fixture(scope="session")
def paper_runs() -> reproduce.Simulated:
    """What `mrjax reproduce` simulates, each kind of bed dropped once instead of thrice."""
    return reproduce.simulated(seed=2, starts=1)


@pytest.fixture(scope="module", autouse=True)
def compiled_programs_are_forgotten():
    """After every file: each holds memory maps, of which Linux allows a process some 65,000."""
    yield
    jax.clear_caches()
