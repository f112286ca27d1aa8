"""The cache of compiled programs in the user's cache folder, for later commands."""

import tempfile
import warnings
from pathlib import Path

import jax
import platformdirs

from mrjax.io.machine import machine

MOST_BYTES = 2**28
"""Largest size of the cache, enough for some fifty commands; beyond it the longest unused programs
are removed."""


def keep() -> None:
    """Turns on JAX's cache of compiled programs, unless the environment turns it off.

    The environment may also name the folder. If the folder cannot be written to, programs are
    compiled in every command.
    """
    if not jax.config.jax_enable_compilation_cache:  # type: ignore[attr-defined] # made at run time
        return
    # JAX would warn if the disk is full.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")
    # Most programs compile fast, but there are many of them.
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
    """Removes entries of the cache that an interrupted process left without a time of use.

    JAX writes the time of use last, and cannot make room for new entries if one lacks it.
    """
    for entry in folder.glob(f"*-{'[0-9a-f]' * 64}-cache"):  # only names that JAX gives
        if not entry.with_name(entry.name.removesuffix("-cache") + "-atime").exists():
            entry.unlink(missing_ok=True)
