"""Measures and writes the comparison: `python -m tests.studies.benchmarks.grainlearning`.

It takes two minutes. GrainLearning runs in a temporary environment that is installed for it.
"""

import json
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

import jax

from mrjax.io import files

from . import ours, page, problem

VERSION = "2.0.5"


def main() -> None:
    """Writes results.json and README.md beside this file."""
    jax.config.update("jax_enable_x64", True)
    data = [problem.measured(seed) for seed in problem.SEEDS]
    results = {
        "version": VERSION,
        "theirs": theirs([one.tolist() for one in data]),
        "ours": [ours.calibrated(one, seed) for seed, one in enumerate(data)],
        "uniform": [vars(problem.uniform_posterior(one)) for one in data],
        "log_normal": [
            vars(problem.log_normal_posterior(one, ours.LOG_STANDARD_DEVIATION)) for one in data
        ],
    }
    files.write_json(page.RESULTS, results)
    files.write_text(page.PAGE, page.text())


def theirs(data: list[list[float]]) -> list[dict]:
    """What GrainLearning states of each data set."""
    bounds = {
        name: [value / problem.RANGE, value * problem.RANGE]
        for name, value in problem.TRUTH.items()
    }
    given = {"fractions": problem.FRACTIONS.tolist(), "bounds": bounds, "data": data}
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        python = Path(folder) / ("Scripts" if sys.platform == "win32" else "bin") / "python"
        wanted = f"grainlearning=={VERSION}"
        subprocess.run([python, "-m", "pip", "install", "--quiet", wanted], check=True)
        peer = Path(__file__).with_name("peer.py")
        done = subprocess.run(
            [python, peer], input=json.dumps(given), capture_output=True, text=True, check=True
        )
    return json.loads(done.stdout)


if __name__ == "__main__":
    main()
