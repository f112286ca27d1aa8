"""Draws the pictures of the documentation's gallery: `python notebooks/gallery.py` [NAME ...].

Each function below makes one picture, docs/gallery/NAME.png; all of them take some minutes.
"""

import sys
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path

import jax
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import calibrate
import mrjax
from calibrate.report import figures as figures_of_fits
from mrjax.figures.style import COLUMN, LINES, STYLE

FOLDER = Path(__file__).parents[1] / "docs" / "gallery"
DOTS_PER_INCH = 130
DAY = 86400.0


@cache
def settled() -> mrjax.Sedimentation:
    """Case 2 from dispersed to rest, from three random starts."""
    return mrjax.sedimentation(mrjax.Recipe.load("case2"), seeds=range(3), trajectory=True)


def first_run() -> mrjax.Run:
    """The first of the three runs."""
    return jax.tree.map(lambda leaf: leaf[0], settled().run)


def particles() -> Figure:
    """Particles at the beginning, half-way and at rest."""
    run = first_run()
    positions = run.trajectory.position
    falling = int(np.argmin(np.abs(run.mudline - 0.5 * (run.mudline[0] + run.mudline[-1]))))
    moments = {"dispersed": 0, "falling": falling, "at rest": -1}
    return mrjax.figures.particles(
        {name: positions[frame] for name, frame in moments.items()}, run.radius, run.box
    )


def curve() -> Figure:
    """The sedimentation curve with its asymptotes, and profiles of the volume fraction."""
    return mrjax.figures.sedimentation(settled())


def concentration() -> Figure:
    """The volume fraction over height and time."""
    return mrjax.figures.concentration(first_run())


def force_chains() -> Figure:
    """The normal forces of the bed at rest."""
    run = first_run()
    return mrjax.figures.force_chains(run.state, settled().parameters, run.box)


@STYLE
def tube() -> Figure:
    """The volume fraction along a tube of 10 cm, day by day, with drag that follows it."""
    recipe = mrjax.Recipe.load("case2").replace(
        composition={"volume_fraction": 0.2}, drag={"f_w": "richardson-zaki", "local": True}
    )
    days = np.array([0.0, 0.1, 0.2, 0.3, 0.5])
    column = mrjax.column(
        recipe.parameters(),
        height=0.1,
        volume_fraction=recipe.volume_fraction,
        bed_fraction=0.58,
        times=days * DAY,
        hindrance=recipe.hindrance,
    )
    figure = Figure(figsize=(COLUMN, 2.6), layout="constrained")
    axes = figure.subplots()
    for day, line, profile in zip(days, LINES, column.volume_fraction, strict=False):
        axes.plot(profile, 1e2 * column.levels, **line, label=f"{day:g} days")
    axes.set(xlabel="volume fraction", ylabel="height, cm", xlim=(0, None), ylim=(0, 10.2))
    axes.legend()
    return figure


def fitted_curves() -> Figure:
    """Three synthetic tubes, fitted with one exponent."""
    found = calibrate.run(calibrate.Experiment.load("synthetic"), model="column")
    return figures_of_fits.curves_figure(found.tables())


def posterior() -> Figure:
    """Samples of the posterior: the drag factors of Fang's suspensions."""
    experiment = calibrate.Experiment.load("fang2005")
    found = calibrate.run(experiment, model="closed-form", posterior=True)
    drag = len(("f_w", "f_s", "f_v"))
    names, samples = found.posterior.names[:drag], found.posterior.samples[:, :drag]
    return figures_of_fits.corner_figure(replace(found.posterior, names=names, samples=samples))


PICTURES = (particles, curve, concentration, force_chains, tube, fitted_curves, posterior)


def main(names: list[str]) -> None:
    """Draws the pictures of these names, or all of them."""
    jax.config.update("jax_enable_x64", True)
    FOLDER.mkdir(exist_ok=True)
    for picture in PICTURES:
        if not names or picture.__name__ in names:
            drawn, file = BytesIO(), FOLDER / f"{picture.__name__}.png"
            picture().savefig(drawn, dpi=DOTS_PER_INCH)
            # Lines and shades of grey look the same in 32 colours, at a third of the size.
            image = Image.open(drawn).convert("RGB").quantize(32, dither=Image.Dither.NONE)
            image.save(file, optimize=True)
            print(file.name, file.stat().st_size)


if __name__ == "__main__":
    main(sys.argv[1:])
