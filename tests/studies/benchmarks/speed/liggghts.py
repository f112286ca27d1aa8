"""The same bed in LIGGGHTS, where that is installed (Debian package `liggghts`, 3.8)."""

import os
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mrjax.core.box import Box
from mrjax.core.parameters import Parameters
from mrjax.paper.dry_beds import ELASTIC_MODULUS, RESTITUTION

from . import process, states

INPUT = Path(__file__).with_name("in.bed")
MARGIN = 1e-6
"""m, of its domain beyond the walls: it loses what leaves the domain."""
MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMP_NUM_THREADS": "1",
}
"""Open MPI asks for these where it counts cores in its own way; others ignore them."""


@dataclass(frozen=True)
class Result:
    """One run."""

    seconds: float  # its own loop time, without what it does before and after
    builds: int  # of the neighbour list
    position: np.ndarray  # (N, 3), m
    velocity: np.ndarray  # (N, 3), m/s


def available(number_of_cores: int = 1) -> bool:
    """Whether it can be run here."""
    wanted = ["liggghts"] + ["mpirun"] * (number_of_cores > 1)
    return all(shutil.which(name) for name in wanted)


def version() -> str | None:
    """As it says itself."""
    if not available():
        return None
    with tempfile.TemporaryDirectory() as folder:
        command = ["liggghts", "-log", "none"]
        said = subprocess.run(command, cwd=folder, input="", capture_output=True, text=True)
    return said.stdout.split("LIGGGHTS-PUBLIC ")[1].split(",")[0]


def run(
    position: np.ndarray,
    velocity: np.ndarray,
    box: Box,
    *,
    steps: int,
    warm: int = 0,
    number_of_cores: int = 1,
    time_step: float = states.TIME_STEP,
    drag: float = 0.0,
) -> Result:
    """Follows the particles of `states.dry`; drag in kg/s.

    Raises:
      RuntimeError: it did not end well.
    """
    own = states.dry()
    diameter = 2.0 * float(own.radius)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "data").write_text(_data(position, velocity, box, own), encoding="utf-8")
        variables = {
            "data": "data",
            "dump": "dump",
            **dict(zip(("Lx", "Ly", "Lz"), box.size, strict=True)),
            "skin": states.SKIN * diameter,
            "E": ELASTIC_MODULUS,
            "nu": own.poisson_ratio,
            "e": RESTITUTION,
            "mu": states.FRICTION,
            "g": own.gravity,
            "dt": time_step,
            "warm": warm,
            "steps": steps,
            "drag": drag,
        }
        command = ["mpirun", "-np", str(number_of_cores)] if number_of_cores > 1 else []
        command += ["liggghts", "-in", str(INPUT), "-log", "log", "-screen", "none"]
        for key, value in variables.items():
            text = value if isinstance(value, str) else f"{float(value):.12g}"
            command += ["-var", key, text]
        with process.pinned(number_of_cores):
            done = subprocess.run(
                command,
                cwd=folder,
                env={**os.environ, **MPI},
                capture_output=True,
                errors="replace",
            )
        # Where it fails it may leave bytes that are not text.
        log = (folder / "log").read_bytes().decode("utf-8", "replace")
        if done.returncode or not (folder / "dump").exists():
            raise RuntimeError(f"LIGGGHTS: {(log + done.stdout + done.stderr)[-400:]}")
        table = np.loadtxt(folder / "dump", skiprows=9, ndmin=2)
    table = table[table[:, 0].argsort()]
    # The last run of the input has no steps and writes the positions.
    seconds = re.findall(r"Loop time of (\S+) on", log)[-2]
    builds = re.findall(r"Neighbor list builds = (\d+)", log)[-2]
    return Result(float(seconds), int(builds), table[:, 1:4], table[:, 4:7])


def _data(position: np.ndarray, velocity: np.ndarray, box: Box, own: Parameters) -> str:
    """Its data file."""
    lines = ["spheres", "", f"{len(position)} atoms", "2 atom types", ""]
    for axis, length in zip("xyz", box.size, strict=True):
        lines.append(f"{-MARGIN:.10g} {length + MARGIN:.10g} {axis}lo {axis}hi")
    lines += ["", "Atoms", ""]
    sphere = f"1 {2.0 * float(own.radius):.10g} {float(own.particle_density):.10g}"
    for number, place in enumerate(position, start=1):
        lines.append(f"{number} {sphere} " + " ".join(f"{x:.15g}" for x in place))
    lines += ["", "Velocities", ""]
    for number, rate in enumerate(velocity, start=1):
        lines.append(f"{number} " + " ".join(f"{x:.15g}" for x in rate) + " 0 0 0")
    return "\n".join(lines) + "\n"
