"""Compiled programs, kept in the user's cache folder for the next start of a command line."""

import tempfile
import warnings
from pathlib import Path

import jax
import platformdirs

from mrjax.io.machine import machine

MOST_BYTES = 2**28
"""Size of a folder beyond which programs unused for longest are removed: some fifty commands."""


def keep() -> None:
    """Has JAX keep what it compiles from here on, unless the environment forbids it.

    The environment may also name the folder. A folder that cannot be written to is no fault:
    programs are then compiled at every start.
    """
    if not jax.config.jax_enable_compilation_cache:  # type: ignore[attr-defined] # made at run time
        return
    # A disk may be full, now or later.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
    # Most programs are small, and many.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    if jax.config.jax_compilation_cache_dir:  # type: ignore[attr-defined] # likewise
        return
    folder = platformdirs.user_cache_path("mrjax", appauthor=False) / machine()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        _remove_unfinished(folder)
    except OSError:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_compilation_cache_max_size", MOST_BYTES)


def _remove_unfinished(folder: Path) -> None:
    """Removes programs that an interrupted start left without their time of use, written last.

    Where one entry lacks it, JAX finds no room for further ones.
    """
    for entry in folder.glob(f"*-{'[0-9a-f]' * 64}-cache"):  # JAX's names, and no others
        if not entry.with_name(entry.name.removesuffix("-cache") + "-atime").exists():
            entry.unlink(missing_ok=True)
