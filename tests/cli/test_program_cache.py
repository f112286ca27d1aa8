"""Programs kept from one start of a command to the next, and who must not notice."""

import gc
import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

import mrjax
from mrjax.cli import program_cache
from mrjax.dem import neighbours

SHORT = ("-m", "mrjax", "simulate", "case2", "--duration", "1.5e-7", "--frames", "2", "--quiet")
CLOSED = ("-m", "calibrate", "fang2005", "--model", "closed-form", "--quiet")


def start(*arguments, folder: Path, **environment) -> str:
    """Starts Python in a folder; what it says on standard error."""
    ours = {"JAX_PLATFORMS": "cpu", "HOME": str(folder), "XDG_CACHE_HOME": str(folder / "home")}
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ("JAX_COMPILATION_CACHE_DIR", "TF_CPP_MIN_LOG_LEVEL")
    }
    done = subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env={"MPLCONFIGDIR": "/tmp", **kept, **ours, **environment},
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stderr


def programs(folder: Path) -> set[Path]:
    return set(folder.glob("home/mrjax/jaxlib-*/*-cache"))


def uses(folder: Path) -> dict[Path, bytes]:
    """When each kept program was last used."""
    return {file: file.read_bytes() for file in folder.glob("home/mrjax/jaxlib-*/*-atime")}


linux = pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the folder cannot be moved")


@linux
@pytest.mark.parametrize("command", [SHORT, CLOSED], ids=["mrjax", "calibrate"])
def test_the_second_start_compiles_nothing(tmp_path, command):
    start(*command, folder=tmp_path)
    kept, before = programs(tmp_path), uses(tmp_path)
    assert len(kept) > 10 and len(before) == len(kept)
    # Nor does it say what XLA has to say of each program that it loads.
    assert start(*command, folder=tmp_path) == ""
    assert programs(tmp_path) == kept
    after = uses(tmp_path)
    assert sum(after[file] != before[file] for file in before) > 10


@linux
def test_a_library_keeps_nothing_and_hushes_nothing(tmp_path):
    seen = (
        "import os, mrjax, jax; jax.numpy.arange(3.0).sum();"
        "assert os.environ.get('TF_CPP_MIN_LOG_LEVEL') != '3';"
        "assert jax.config.jax_compilation_cache_dir is None"
    )
    start("-c", seen, folder=tmp_path)
    assert not (tmp_path / "home").exists()


@pytest.mark.parametrize("name", ["mrjax", "mrjax-calibrate"])
def test_scripts_are_hushed_like_modules(tmp_path, name):
    """As the installed scripts start."""
    seen = (
        f"import sys, os; sys.argv = ['/bin/{name}'];"
        "import mrjax; assert os.environ['TF_CPP_MIN_LOG_LEVEL'] == '3'"
    )
    start("-c", seen, folder=tmp_path)


@linux
@pytest.mark.parametrize(
    "name, value", [("JAX_COMPILATION_CACHE_DIR", "mine"), ("JAX_ENABLE_COMPILATION_CACHE", "0")]
)
def test_the_environment_decides(tmp_path, name, value):
    start(*CLOSED, folder=tmp_path, **{name: value})
    assert not (tmp_path / "home").exists()
    kept = len(list((tmp_path / "mine").glob("*-cache")))
    assert kept > 10 if value == "mine" else kept == 0


@linux
def test_a_folder_that_cannot_be_written_to_is_no_fault(tmp_path):
    (tmp_path / "home").write_text("not a folder")
    assert start(*CLOSED, folder=tmp_path) == ""


def test_what_was_written_by_half_is_taken_away(tmp_path):
    whole, half = (f"jit_f-{digit * 64}" for digit in "0f")
    for name in (f"{whole}-cache", f"{whole}-atime", f"{half}-cache", "mine-cache"):
        (tmp_path / name).write_text("")
    program_cache._remove_unfinished(tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == {
        f"{whole}-cache",
        f"{whole}-atime",
        "mine-cache",  # of somebody else
    }


def test_a_search_is_one_program_whenever_the_collector_comes_by():
    """Else what nobody uses stays in it or not, and the next start compiles it once more."""
    box = mrjax.Box((10.0, 10.0, 10.0))
    plan = neighbours.plan_list(box, 50, 1.0, 1.0, 0.1)
    positions = jax.ShapeDtypeStruct((50, 3), jnp.float64)

    def traced(*, collected: bool) -> str:
        def search(position):
            found = neighbours.build(plan, box, position)
            if collected:
                gc.collect()
            return found

        gc.disable()
        try:
            return str(jax.jit(search).trace(positions).jaxpr)
        finally:
            gc.enable()

    assert traced(collected=False) == traced(collected=True)
