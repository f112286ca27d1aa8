"""What measured: processor, cores and versions."""

import platform
from pathlib import Path

from mrjax.io.versions import versions

from . import liggghts, process


def described() -> dict[str, str | int | None]:
    """This machine, now."""
    shown = [
        line.split(":")[1].strip()
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        if line.startswith("model name")
    ]
    return {
        "processor": shown[0] if shown else platform.machine(),
        "cores": process.most_cores(),
        "python": platform.python_version(),
        **{name: text for name, text in versions().items() if name in ("mrjax", "jax", "jaxlib")},
        "liggghts": liggghts.version(),
    }
