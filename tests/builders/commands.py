"""Commands in processes of their own, and a small recipe for them."""

import os
import subprocess
import sys
from pathlib import Path


class Folder:
    """A folder whose name a test session chooses."""

    name: str


COMPILED = Folder()
"""Programs that these commands keep for each other, in all processes of a session."""
# JAX sets the level at which XLA speaks, here; a command sets its own where none is given.
ENVIRONMENT = {name: text for name, text in os.environ.items() if name != "TF_CPP_MIN_LOG_LEVEL"}


def start(*arguments, module="mrjax", folder: Path, environment=None) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", module, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**ENVIRONMENT, "JAX_PLATFORMS": "cpu", "JAX_COMPILATION_CACHE_DIR": COMPILED.name}
        | (environment or {}),
    )


SMALL = """
name = "small"
gravity = 9.81
[particle]
density = 7470.0
diameter = 4e-6
elastic_modulus = 211e9
poisson_ratio = 0.31
[fluid]
density = 950.0
viscosity = 0.01
[composition]
particle = 0.80
fluid = 0.20
[drag]
f_w = 48.985
f_s = 1.1
[box]
size = [10e-6, 10e-6, 20e-6]
"""
"""Twenty particles without friction: a bed in seconds."""
