"""A name for the processor and compiler version, on which compiled programs depend."""

import hashlib
import importlib.metadata
import platform

import numpy as np


def machine() -> str:
    """Returns a name for this processor and jaxlib; compiled programs may crash on another."""
    features = np.show_config(mode="dicts")["SIMD Extensions"]
    digest = hashlib.sha256(repr(features).encode()).hexdigest()[:12]
    return f"jaxlib-{importlib.metadata.version('jaxlib')}-{platform.machine()}-{digest}"
