"""Environment variables: those that JAX cannot use are refused, others change no result."""

import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from mrjax.core import randomness
from tests.builders.commands import COMPILED, ENVIRONMENT, SMALL

GENERATORS = {
    "JAX_DEFAULT_PRNG_IMPL": "rbg",
    "JAX_THREEFRY_PARTITIONABLE": "0",
    "JAX_RANDOM_SEED_OFFSET": "7",
    "JAX_ENABLE_CUSTOM_PRNG": "1",
    "JAX_LEGACY_PRNG_KEY": "error",
    "JAX_DEBUG_KEY_REUSE": "1",
}
"""All that chooses JAX's random numbers."""


def start(*arguments, folder: Path, **environment) -> tuple[int, str, str]:
    """Starts Python with these variables: exit status, standard output and error."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=folder,
        env={
            **ENVIRONMENT,
            "JAX_PLATFORMS": "cpu",
            "JAX_COMPILATION_CACHE_DIR": COMPILED.name,
            **environment,
        },
        timeout=300,
    )
    return done.returncode, done.stdout, done.stderr


WRONG = {
    "no such platform": ("JAX_PLATFORMS", "nonsense"),
    "no such device here": ("JAX_PLATFORMS", "rocm"),
    "no such flag": ("XLA_FLAGS", "--nonsense"),
    "no value of a flag": ("XLA_FLAGS", "--xla_cpu_enable_fast_math=perhaps"),
    "no file of flags": ("XLA_FLAGS", "nowhere"),
    "not a truth value": ("JAX_ENABLE_X64", "maybe"),
    "not a number": ("JAX_NUM_CPU_DEVICES", "x"),
    "no devices": ("JAX_NUM_CPU_DEVICES", "0"),
    "no such precision": ("JAX_DEFAULT_MATMUL_PRECISION", "nonsense"),
    "no such generator": ("JAX_DEFAULT_PRNG_IMPL", "nonsense"),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("module", ["mrjax", "calibrate"])
def test_a_variable_that_jax_cannot_use_is_one_line(tmp_path, name, module):
    variable, value = WRONG[name]
    command = {"mrjax": ("check", "case2"), "calibrate": ("fang2005",)}[module]
    status, out, err = start("-m", module, *command, folder=tmp_path, **{variable: value})
    assert (status, out, err.count("\n")) == (2, "", 1), err
    assert variable.lower() in err.lower() and value.strip("-").split("=")[0] in err
    assert "unset it" in err and len(err) < 420 and not list(tmp_path.iterdir())


PARTICLES = """
import hashlib, jax, numpy, mrjax
jax.config.update("jax_enable_x64", True)
position = numpy.asarray(mrjax.disperse(mrjax.Recipe.load("small.toml"), 3).position)
print(hashlib.sha256(position.tobytes()).hexdigest())
"""


def test_a_seed_has_its_particles_in_every_environment(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    here = start("-c", PARTICLES, folder=tmp_path)
    assert here[0] == 0, here
    assert start("-c", PARTICLES, folder=tmp_path, **GENERATORS)[1] == here[1]


@pytest.mark.parametrize("seed", [0, 3, 2**31 - 1, -1])
def test_numbers_are_those_of_the_default_generator(seed, monkeypatch):
    usual = np.asarray(jax.random.normal(jax.random.key(seed), (5, 3)))
    names = ("jax_default_prng_impl", "jax_threefry_partitionable", "jax_random_seed_offset")
    before = {name: getattr(jax.config, name) for name in names}
    try:
        for name, value in zip(names, ("rbg", False, 7), strict=True):
            jax.config.update(name, value)
        with randomness.ordered():
            drawn = np.asarray(jax.random.normal(randomness.key(seed), (5, 3)))
        other = np.asarray(jax.random.normal(jax.random.key(seed), (5, 3)))
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
    np.testing.assert_array_equal(drawn, usual)
    assert (other != usual).all()


CHANGING = {
    "JAX_ENABLE_X64": "0",
    "JAX_NUMPY_DTYPE_PROMOTION": "strict",
    "JAX_NUMPY_RANK_PROMOTION": "raise",
    "JAX_DEFAULT_MATMUL_PRECISION": "bfloat16",
    "JAX_DEBUG_NANS": "1",
    "JAX_DEBUG_INFS": "1",
    "JAX_DISABLE_JIT": "1",
    "JAX_CHECK_TRACER_LEAKS": "1",
    "JAX_TRANSFER_GUARD": "disallow",
    "PYTHONWARNINGS": "error",
    "PYTHONIOENCODING": "ascii",
    "LC_ALL": "C",
    "COLUMNS": "0",
    "NO_COLOR": "1",
    "MPLBACKEND": "nonsense",
    "MPLCONFIGDIR": "/proc/none",
    "HOME": "/proc/none",
    "XDG_CACHE_HOME": "/dev/null",
    "TMPDIR": "/nowhere",
} | GENERATORS
"""What would change numbers, or end a command."""


@pytest.mark.skipif(sys.platform != "linux", reason="/proc and /dev")
def test_a_run_has_its_bits_in_every_environment(tmp_path):
    (tmp_path / "small.toml").write_text(SMALL)
    short = ("simulate", "small.toml", "--duration", "1e-7", "--frames", "4", "--out")
    found = []
    for number, changed in enumerate(({}, CHANGING)):
        status, out, err = start("-m", "mrjax", *short, number, folder=tmp_path, **changed)
        # Nothing but progress, whatever letters the terminal knows.
        assert status == 0 and "arning" not in err and "Traceback" not in err, err
        assert err.isascii() or not changed, err
        found.append((out.replace("Results: 1", "Results: 0"), curve(tmp_path / str(number))))
    assert found[0] == found[1]


def curve(folder: Path) -> bytes:
    return (folder / "curve.csv").read_bytes()
