"""Draws the picture at the head of the README: `python notebooks/overview.py`.

It shows readings of a tube in a laboratory (`chalk/chalk.csv`) and the fitted curve.
"""

from pathlib import Path

import jax
import matplotlib
from matplotlib.figure import Figure

import calibrate

HERE = Path(__file__).parent
MINUTE, MILLIMETRE = 60.0, 1e-3
INK, BLUE, PALE = "#222222", "#1f5f99", "#bcd4ea"
LARGE_ENOUGH_FOR_A_PHONE = {"font.size": 12.0, "axes.spines.top": False, "axes.spines.right": False}


def draw(calibration: calibrate.Calibration) -> Figure:
    """Draws readings with their errors, and the fitted curve with two standard errors."""
    (curve,) = calibration.curves
    (sample,) = calibration.experiment.samples
    rows = calibration.tables()["predictions"]
    times = curve.times / MINUTE
    figure = Figure(figsize=(6.0, 3.9), layout="constrained")
    axes = figure.subplots()
    band = 2.0 * curve.standard_error
    axes.fill_between(
        times,
        curve.predicted - band,
        curve.predicted + band,
        color=PALE,
        lw=0,
        label="± two standard errors",
    )
    axes.plot(times, curve.predicted, color=BLUE, lw=2.0, label="fitted curve")
    axes.errorbar(
        [row["time_s"] / MINUTE for row in rows],
        [row["measured"] for row in rows],
        [row["sigma"] for row in rows],
        fmt="o",
        ms=5.5,
        capsize=3,
        color=INK,
        label="readings, ± one standard deviation",
    )
    axes.set(
        xlabel="time, min",
        ylabel="height of the mudline, mm",
        xlim=(-0.6, 30.6),
        ylim=(0.0, 1.05e3 * sample.height),
    )
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], frameon=False, loc="upper right")
    return figure


def main() -> None:
    """Fits the readings and saves the picture."""
    jax.config.update("jax_enable_x64", True)
    experiment = calibrate.Experiment.load(HERE / "chalk" / "tube.toml")
    calibration = calibrate.run(experiment, model="column")
    for name, error in calibration.identification.standard_errors.items():
        print(name, float(calibration.fit.theta[name]), "±", error)
    with matplotlib.rc_context(LARGE_ENOUGH_FOR_A_PHONE):
        draw(calibration).savefig(HERE / "overview.png", dpi=130)


if __name__ == "__main__":
    main()
