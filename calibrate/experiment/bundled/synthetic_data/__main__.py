"""Makes the curves of the experiment `synthetic`: those of the column, with noise.

python -m calibrate.experiment.bundled.synthetic_data
"""

from pathlib import Path

import jax
import numpy as np

import mrjax
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.suspension import suspension

TRUTH = {"f_w.exponent": 5.3, "f_s": 1.25, "bed_fraction": 0.58}
VISCOSITY_RATIO = {"coated": 1.9}
ERROR = 0.5e-3
"""Standard deviation of a reading, m."""
HOURS = {"thin": 10.0, "dense": 24.0, "coated": 60.0}
READINGS, CELLS, SEED = 24, 400, 2005


def main() -> None:
    """Writes a CSV for each sample beside this file."""
    jax.config.update("jax_enable_x64", True)
    random = np.random.default_rng(SEED)
    for sample in Experiment.load("synthetic").samples:
        changes = TRUTH | {"f_v": VISCOSITY_RATIO.get(sample.name, 1.0)}
        true = suspension(sample.recipe, None, changes)
        hours = np.linspace(0.0, HOURS[sample.name], READINGS + 1)[1:]
        settled = mrjax.column(
            true.parameters,
            height=sample.height,
            volume_fraction=float(true.volume_fraction),
            bed_fraction=true.bed_fraction,
            times=3600.0 * hours,
            hindrance=true.hindrance,
            cells=CELLS,
        )
        readings = np.asarray(settled.mudline) + ERROR * random.standard_normal(READINGS)
        lines = [
            f"{hour:.4g},{1e3 * height:.1f}" for hour, height in zip(hours, readings, strict=True)
        ]
        text = "\n".join(["# Synthetic: no laboratory measured this.", "time,mudline", *lines, ""])
        (Path(__file__).parent / f"{sample.name}.csv").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
