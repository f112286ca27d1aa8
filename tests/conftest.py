"""Strict JAX for every test: double precision, no silent promotion of dtypes or ranks."""

import os
import signal
from pathlib import Path

import jax
import pytest

import mrjax
from mrjax.paper import runs
from tests.builders.commands import COMPILED

QUICKLY = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
"""XLA without its optimisations: two thirds of an ordinary run are compilation otherwise."""
COMPILED_ROOMS = ("kernel", "physics", "simulation")
"""Rooms whose tests run whole compiled programs, and are marked `compiled`.

These programs contain the rooms below, laws and `dem` above all. The slow tests of every room are
compiled as the programs of users are, too.
"""


def pytest_addoption(parser):
    parser.addoption(
        "--optimised",
        action="store_true",
        help="compile what tests run as the programs of users are: two and a half times as long",
    )


def pytest_configure(config):
    """Before anything is compiled; what tests start inherits both."""
    if not config.getoption("--optimised"):
        os.environ.setdefault("XLA_FLAGS", QUICKLY)
    # What a shell starts in the background ignores Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.relative_to(Path(__file__).parent).parts[0] in COMPILED_ROOMS:
            item.add_marker(pytest.mark.compiled)


jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")
jax.config.update("jax_numpy_rank_promotion", "raise")


@pytest.fixture(scope="session", autouse=True)
def programs_are_kept(tmp_path_factory, worker_id):
    """What one process of the suite compiled is read by the others, and after `clear_caches`."""
    own = tmp_path_factory.getbasetemp()
    of_all = own if worker_id == "master" else own.parent
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_compilation_cache_dir", str(of_all / "programs"))
    COMPILED.name = str(of_all / "programs-of-commands")


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
def paper_runs() -> runs.Simulated:
    """What `mrjax reproduce` simulates, each kind of bed dropped once instead of thrice."""
    return runs.simulated(seed=2, starts=1)


@pytest.fixture(scope="module", autouse=True)
def compiled_programs_are_forgotten():
    """After every file: each holds memory maps, of which Linux allows a process some 65,000."""
    yield
    jax.clear_caches()
