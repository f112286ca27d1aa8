"""Settings of JAX and matplotlib for the commands, independent of environment variables.

A variable that makes JAX fail is refused in one line. Some raise when JAX is imported, some at the
first computation, and invalid `XLA_FLAGS` end the process.
"""

import logging
import os
import re
import subprocess
import sys

from mrjax.core.errors import InputError, shown

FLAGS = "XLA_FLAGS"
SETTINGS = {
    "jax_numpy_dtype_promotion": "standard",
    "jax_numpy_rank_promotion": "allow",
    "jax_default_matmul_precision": None,
    "jax_disable_jit": False,
    "jax_debug_nans": False,
    "jax_debug_infs": False,
    "jax_check_tracer_leaks": False,
    "jax_transfer_guard": "allow",
}
"""JAX's defaults for settings that change numbers or stop a run without a fault."""
PARSES_FLAGS = "from jaxlib import _jax; _jax.CompileOptions()"


def start_jax(dtype: str, devices: bool = True) -> None:
    """Imports JAX with `dtype` as its default, and turns on the cache of compiled programs.

    Call it before any module that imports JAX.

    Args:
      dtype: float64 or float32.
      devices: True to initialise JAX's devices now.

    Raises:
      InputError: JAX cannot use an environment variable.
    """
    _import_jax(dtype)
    if devices:
        find_devices()
    from mrjax.cli import program_cache

    program_cache.keep()


def _import_jax(dtype: str) -> None:
    """Imports JAX with `SETTINGS` and with `dtype` as its default.

    Raises:
      InputError: JAX cannot use an environment variable.
    """
    os.environ["MPLBACKEND"] = "agg"  # figures are drawn into files only
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # no messages on its font cache
    _refuse_flags()
    try:
        import jax
    except ValueError as error:
        raise InputError(f"{_reason(error)}; correct that variable, or unset it") from None
    for name, value in {**SETTINGS, "jax_enable_x64": dtype == "float64"}.items():
        jax.config.update(name, value)


def find_devices() -> None:
    """Initialises JAX's devices.

    Raises:
      InputError: there is no device, or none of those that the environment selects.
    """
    import jax

    try:
        jax.devices()
    except Exception as error:  # JAX raises various types, an AssertionError for CUDA
        settings = ", ".join(
            f"{name} = {shown(os.environ[name])}"
            for name in ("JAX_PLATFORMS", "JAX_PLATFORM_NAME", "JAX_NUM_CPU_DEVICES", FLAGS)
            if os.environ.get(name)
        )
        raise InputError(
            f"{settings or 'no device'}: JAX cannot compute with that here ({_reason(error)}); "
            "unset it, or set JAX_PLATFORMS=cpu"
        ) from None


def _refuse_flags() -> None:
    """Lets another process parse `XLA_FLAGS`, because XLA ends a process with invalid flags.

    Raises:
      InputError: XLA ended that process.
    """
    if not (flags := os.environ.get(FLAGS)):
        return
    command = [sys.executable, "-c", PARSES_FLAGS]
    child = subprocess.run(command, capture_output=True, check=False, text=True, errors="replace")
    if child.returncode:
        match = re.search(r"^[EF]\d.*?\] (.*)", child.stderr, re.MULTILINE)
        reason = f" ({match[1].rstrip('.')})" if match else ""
        raise InputError(
            f"{FLAGS} = {shown(flags)}: XLA cannot read that{reason}; correct it, or unset it"
        )


def _reason(error: Exception) -> str:
    """Returns the first line of an error of JAX, without its advice."""
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0].partition(" (set JAX_PLATFORMS")[0].rstrip(".")
