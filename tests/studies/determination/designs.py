"""Designs of synthetic problems: what is fitted, how believed, when and how well it is read.

A design is an experiment whose readings are placeholders; a problem is a design with a truth drawn
from its priors, and readings from the model at that truth with noise.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from calibrate.experiment.experiment import Experiment

RECIPE = """
name = "powder {fraction}"
[particle]
density = 2500.0
diameter = 20e-6
[fluid]
liquid = "water"
[composition]
volume_fraction = {fraction}
[drag]
f_w = {{closure = "richardson-zaki", exponent = {exponent}}}
local = true
"""
HEIGHT = 0.3
"""Of every tube, m."""
FALL = 4.0e-4
"""Velocity that times are counted by, m/s: that of the medians, about."""
SPANS = {"fall": (0.05, 0.6), "whole": (0.1, 3.0), "rest": (1.5, 4.0), "long": (0.1, 30.0)}
"""First and last reading, over the time of a fall through the tube."""


class Design(NamedTuple):
    """One kind of problem."""

    model: str
    parameters: tuple[str, ...]
    spread: float
    """Scale of the widths of the priors."""
    fraction: float
    """Volume fraction of the suspension."""
    span: str
    readings: int
    error: float
    """Standard deviation of a reading over the height."""
    viscosity: bool
    """True if the viscosity ratio was measured, too."""
    samples: int

    @property
    def name(self) -> str:
        """All of it in a line."""
        more = (" + viscosity" if self.viscosity else "") + f" of {self.samples}"
        return (
            f"{self.model}: {', '.join(self.parameters)}; priors {self.spread:g}; "
            f"{self.readings} readings {self.span}{more} at {self.fraction:g} +- {self.error:g}"
        )


MEDIANS = {"f_s": 1.2, "f_v": 1.5, "f_w.exponent": 4.65, "bed_fraction": 0.5}
WIDTHS = {"f_s": 0.6, "f_v": 0.6, "f_w.exponent": 0.5, "bed_fraction": 0.2}
"""Standard deviations of the logarithms, for a spread of 1."""
SETS_OF_PARAMETERS = (
    ("f_s", "bed_fraction"),
    ("f_s", "f_v"),
    ("f_s", "f_v", "bed_fraction"),
    ("f_w.exponent", "f_s"),
    ("f_w.exponent", "f_s", "bed_fraction"),
    ("f_w.exponent", "bed_fraction"),
)


OF_PARTICLES = Design("particles", ("f_s", "f_v"), 0.5, 0.2, "fall", 1, 0.1, True, 1)
"""Simulated particles, of which the initial velocity is read."""


def designs(number: int, seed: int = 0) -> list[Design]:
    """So many designs, three fifths of the closed form and the others of the column; one more."""
    random = np.random.default_rng(seed)
    drawn = []
    for place in range(number):
        parameters = SETS_OF_PARAMETERS[int(random.integers(len(SETS_OF_PARAMETERS)))]
        drawn.append(
            Design(
                model="column" if place % 5 in (1, 3) else "closed-form",
                parameters=parameters,
                spread=float(random.choice([0.1, 0.5, 1.0, 2.0])),
                fraction=float(random.choice([0.04, 0.1, 0.2])),
                span=str(random.choice(list(SPANS))),
                readings=int(random.choice([2, 3, 5, 8, 12])),
                error=float(random.choice([0.003, 0.01, 0.03, 0.1])),
                viscosity="f_v" in parameters and bool(random.integers(2)),
                samples=int(random.choice([1, 1, 2])),
            )
        )
    return [*drawn, OF_PARTICLES]


def experiment(design: Design, folder: Path) -> Experiment:
    """The experiment of a design, with placeholders as readings.

    Args:
      design: what it is.
      folder: an empty one, for its files.
    """
    lines = [f'name = "{design.name}"']
    if design.model == "particles":
        lines += _of_particles(design)
    for number in range(0 if design.model == "particles" else design.samples):
        fraction = design.fraction * (1.0 + 0.8 * number)
        (folder / f"{number}.toml").write_text(
            RECIPE.format(fraction=fraction, exponent=MEDIANS["f_w.exponent"])
        )
        first, last = SPANS[design.span]
        times = np.geomspace(first, last, design.readings) * HEIGHT / FALL
        rows = [f"{time:.6g},{HEIGHT * (1.0 - 1e-3 * place)}" for place, time in enumerate(times)]
        (folder / f"{number}.csv").write_text("\n".join(["time (s),mudline (m)", *rows]))
        lines += [
            f'[[sample]]\nname = "{number}"\nrecipe = "{number}.toml"\nheight = {HEIGHT}',
            f'curve = {{file = "{number}.csv", standard_deviation = {design.error * HEIGHT}}}',
        ]
        if "bed_fraction" not in design.parameters:
            lines.append("bed_fraction = 0.5")
        if design.viscosity:
            lines.append("viscosity_ratio = {value = 1.5, standard_deviation = 0.15}")
    for name in design.parameters:
        width = WIDTHS[name] * design.spread
        lines.append(
            f'[[parameter]]\nname = "{name}"\nmedian = {MEDIANS[name]}\n'
            f"log_standard_deviation = {width}"
        )
    (folder / "experiment.toml").write_text("\n".join(lines))
    return Experiment.load(folder / "experiment.toml")


def _of_particles(design: Design) -> list[str]:
    """The sample of the bundled recipe `case2` whose initial velocity is read, in mm/day."""
    speed = 10.0  # about
    velocity = f'{{value = {speed}, unit = "mm/day", standard_deviation = {design.error * speed}}}'
    return [
        f'[[sample]]\nname = "0"\nrecipe = "case2"\ninitial_velocity = {velocity}',
        "viscosity_ratio = {value = 1.5, standard_deviation = 0.15}",
    ]
