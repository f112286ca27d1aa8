"""Draws the picture at the head of the README: `python notebooks/overview.py`."""

from pathlib import Path

import jax
import numpy as np
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

import calibrate
import mrjax
from mrjax.laws import closed_forms

MM_PER_DAY = 86400e3
jax.config.update("jax_enable_x64", True)


def suspension(axes) -> None:
    """The 314 particles of case 2, seen from the side; nearer ones lighter."""
    recipe = mrjax.Recipe.load("case2")
    position = 1e6 * np.asarray(mrjax.disperse(recipe, seed=0).position)
    order = np.argsort(-position[:, 1])
    shade = 0.35 + 0.6 * (1 - position[order, 1] / 25)
    diameters = np.full(len(order), 1e6 * recipe.particle.diameter)
    axes.add_collection(
        EllipseCollection(
            diameters,
            diameters,
            np.zeros_like(diameters),
            units="xy",
            offsets=position[order][:, [0, 2]],
            offset_transform=axes.transData,
            facecolors=[str(s) for s in shade],
            edgecolors="black",
            linewidths=0.4,
        )
    )
    axes.set(xlim=(0, 25), ylim=(0, 50), aspect="equal", xlabel="µm", ylabel="µm")
    axes.set_title("314 particles")


def velocity(axes) -> None:
    """Mean settling velocity of cases 2 and 3, simulated, with Eq. 27."""
    for name, marker in (("case2", "o"), ("case3", "s")):
        recipe = mrjax.Recipe.load(name)
        parameters = recipe.parameters()
        run = mrjax.simulate(
            mrjax.disperse(recipe, seed=0), parameters, recipe.box, duration=100e-9, frames=25
        )
        times = np.linspace(0, 100e-9, 200)
        exact = closed_forms.free_fall_velocity(parameters, times)
        axes.plot(1e9 * times, MM_PER_DAY * np.asarray(exact), color="0.6")
        axes.plot(
            1e9 * np.asarray(run.times),
            MM_PER_DAY * np.asarray(run.mean_velocity),
            f"k{marker}",
            markersize=3.5,
            label="coated, thicker oil" if name == "case3" else "bare",
        )
    axes.set(xlabel="time, ns", ylabel="settling velocity, mm/day", xlim=(0, 100), ylim=(0, None))
    axes.legend(frameon=False)
    axes.set_title("simulated; line: Eq. 27")


def calibrated(axes) -> None:
    """Fang's two samples: measured, and predicted before and after the fit."""
    problem = calibrate.Problem.prepare(calibrate.Experiment.load("fang2005"), "particles")
    fit = calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
    product = calibrate.identify(fit).combinations[0]
    velocities = [
        place
        for place, (_, one) in enumerate(problem.measurements)
        if one.observable == "initial_velocity"
    ]
    measured = [problem.measurements[place][1] for place in velocities]
    before, after = (
        np.asarray(problem.predict(theta))[velocities] for theta in (problem.start, fit.theta)
    )
    places = np.arange(len(measured))
    axes.errorbar(
        places,
        [one.value for one in measured],
        [one.standard_deviation for one in measured],
        fmt="ko",
        capsize=4,
        label="measured (Fang 2005)",
    )
    axes.plot(places - 0.15, before, "^", color="0.6", label="before")
    axes.plot(places + 0.15, after, "D", color="0.6", mec="black", label="fitted")
    axes.set_xticks(places, ["sample A", "sample B"])
    axes.set(xlim=(-0.6, 1.6), ylim=(0, 11), ylabel="settling velocity, mm/day")
    axes.legend(frameon=False)
    axes.set_title(f"f_w f_s = {product.value:.1f} ± {product.standard_error:.1f}")


def main() -> None:
    """Draws the three panels."""
    figure = Figure(figsize=(9.5, 3.6), layout="constrained")
    panels = figure.subplots(1, 3, width_ratios=[0.8, 1.1, 1.1])
    for draw, axes in zip((suspension, velocity, calibrated), panels, strict=True):
        draw(axes)
    figure.savefig(Path(__file__).with_name("overview.png"), dpi=110)


if __name__ == "__main__":
    main()
