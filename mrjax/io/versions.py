"""Versions of the packages that made a result."""

import importlib.metadata

RECORDED_PACKAGES = ("mrjax", "jax", "jaxlib", "jax-md", "optax", "scipy", "numpy")
"""Packages whose versions results record."""


def versions() -> dict[str, str]:
    """Returns the installed versions of the recorded packages, by name."""
    return {name: importlib.metadata.version(name) for name in RECORDED_PACKAGES}
