"""JAX and matplotlib as the commands use them, whatever the environment says.

A variable that makes JAX fail is refused in one line: some raise while JAX is imported, some at its
first computation, and `XLA_FLAGS` end the process.
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
"""JAX's defaults: of what changes numbers, or ends what is no fault of a run."""
PARSES_FLAGS = "from jaxlib import _jax; _jax.CompileOptions()"


def start_jax(dtype: str, devices: bool = True) -> None:
    """Makes `dtype` JAX's default for the rest of the process, and keeps what it compiles.

    Comes before all that imports JAX.

    Args:
      dtype: float64 or float32.
      devices: whether to have JAX find its devices now.

    Raises:
      InputError: an environment variable that JAX cannot use.
    """
    _import_jax(dtype)
    if devices:
        find_devices()
    from mrjax.cli import program_cache

    program_cache.keep()


def _import_jax(dtype: str) -> None:
    """Imports JAX with `SETTINGS`, and makes `dtype` its default for the rest of the process.

    Raises:
      InputError: an environment variable that JAX cannot use.
    """
    os.environ["MPLBACKEND"] = "agg"  # pictures are drawn into files alone
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # not where it keeps its fonts
    _refuse_flags()
    try:
        import jax
    except ValueError as error:
        raise InputError(f"{_reason(error)}; correct that variable, or unset it") from None
    for name, value in {**SETTINGS, "jax_enable_x64": dtype == "float64"}.items():
        jax.config.update(name, value)


def find_devices() -> None:
    """Has JAX find its devices.

    Raises:
      InputError: there are none, or the environment asks for others.
    """
    import jax

    try:
        jax.devices()
    except Exception as error:  # of any kind: an assertion where CUDA is asked for
        asked = ", ".join(
            f"{name} = {shown(os.environ[name])}"
            for name in ("JAX_PLATFORMS", "JAX_PLATFORM_NAME", "JAX_NUM_CPU_DEVICES", FLAGS)
            if os.environ.get(name)
        )
        raise InputError(
            f"{asked or 'no device'}: JAX cannot compute with that here ({_reason(error)}); "
            "unset it, or set JAX_PLATFORMS=cpu"
        ) from None


def _refuse_flags() -> None:
    """Has another process read `XLA_FLAGS`, where there are any: XLA ends one that cannot.

    Raises:
      InputError: it was ended.
    """
    if not (flags := os.environ.get(FLAGS)):
        return
    command = [sys.executable, "-c", PARSES_FLAGS]
    done = subprocess.run(command, capture_output=True, check=False, text=True, errors="replace")
    if done.returncode:
        match = re.search(r"^[EF]\d.*?\] (.*)", done.stderr, re.MULTILINE)
        reason = f" ({match[1].rstrip('.')})" if match else ""
        raise InputError(
            f"{FLAGS} = {shown(flags)}: XLA cannot read that{reason}; correct it, or unset it"
        )


def _reason(error: Exception) -> str:
    """The first line of an error of JAX, without its advice."""
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0].partition(" (set JAX_PLATFORMS")[0].rstrip(".")
