"""The kind of processor and of compiled programs: those of one crash on another."""

import hashlib
import importlib.metadata
import platform

import numpy as np


def machine() -> str:
    """A name for what compiled programs hang on: another processor may crash on them."""
    features = np.show_config(mode="dicts")["SIMD Extensions"]
    digest = hashlib.sha256(repr(features).encode()).hexdigest()[:12]
    return f"jaxlib-{importlib.metadata.version('jaxlib')}-{platform.machine()}-{digest}"
