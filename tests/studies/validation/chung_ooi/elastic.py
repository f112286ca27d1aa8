"""Tests 1 and 2: elastic impacts along the normal, against Hertz' theory."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.figure import Figure

from .. import impacts, reference
from ..impacts import Spheres
from ..row import Row
from .common import ALUMINIUM, GLASS, LIMESTONE, MAGNESIUM

BAR = 1e-4


@dataclass(frozen=True)
class Impacts:
    """Impacts of two materials along time, (T, 2), and what Hertz' theory needs."""

    names: tuple[str, str]
    contacts: reference.Contact
    speed: float
    time: np.ndarray
    overlap: np.ndarray
    force: np.ndarray
    leaving: np.ndarray  # speed at the end, (2,)

    @property
    def duration(self) -> np.ndarray:
        """Between the two moments when the surfaces touch: before and after, flight is straight."""
        return self.time[-1] + self.overlap[-1] / self.leaving - self.touched

    @property
    def touched(self) -> np.ndarray:
        """When the surfaces meet."""
        return -self.overlap[0] / self.speed

    def hertz(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Deepest overlap, m, peak force, N, and duration, s, of each."""
        depth = reference.hertz_depth(self.contacts, self.speed)
        return (
            depth,
            reference.hertz_force(self.contacts, depth),
            reference.hertz_duration(self.contacts, self.speed),
        )


@cache
def pairs() -> Impacts:
    """Test 1: two equal spheres of 10 mm radius, each at 10 m/s."""
    upper, lower = (
        Spheres([GLASS, LIMESTONE], radius=0.01, velocity=[0.0, velocity])
        for velocity in (-10.0, 10.0)
    )
    taken = impacts.film(impacts.scene(upper, lower, durations=1.2), frames=80, forces=True)
    height, speed = taken.position[:, :, 2], taken.velocity[-1, :, 2]
    return Impacts(
        ("glass", "limestone"),
        upper.contacts_with(lower),
        20.0,
        taken.time,
        0.02 - (height[:, :2] - height[:, 2:]),
        taken.force[:, :2, 2],
        speed[:2] - speed[2:],
    )


@cache
def spheres_on_wall() -> Impacts:
    """Test 2: a sphere of 0.1 m radius on a rigid wall at 0.2 m/s."""
    spheres = Spheres([ALUMINIUM, MAGNESIUM], radius=0.1, velocity=[0.0, -0.2])
    taken = impacts.film(impacts.scene(spheres, durations=1.2), frames=80, forces=True)
    return Impacts(
        ("aluminium", "magnesium"),
        spheres.contacts_with(None),
        0.2,
        taken.time,
        0.1 - taken.position[:, :, 2],
        taken.force[:, :, 2],
        taken.velocity[-1, :, 2],
    )


def rows() -> list[Row]:
    """Deepest overlap, peak force and duration."""
    return [*_rows("Chung & Ooi 1", pairs()), *_rows("Chung & Ooi 2", spheres_on_wall())]


def _rows(case: str, test: Impacts) -> list[Row]:
    quantities = ("deepest overlap", "peak force", "duration")
    computed = (_peaks(test.overlap), _peaks(test.force), test.duration)
    return [
        Row(
            case,
            f"{quantity}, {name}",
            float(known[column]),
            float(found[column]),
            unit,
            BAR,
            "Hertz, closed form",
        )
        for column, name in enumerate(test.names)
        for quantity, unit, known, found in zip(
            quantities, ("m", "N", "s"), test.hertz(), computed, strict=True
        )
    ]


def _peaks(values: np.ndarray) -> np.ndarray:
    """The highest of each column."""
    top = np.argmax(values, axis=0)
    around = (np.take_along_axis(values, top[None] + offset, 0)[0] for offset in (-1, 0, 1))
    return impacts.vertex(*around)


def figure() -> Figure:
    """Force along time."""
    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    panels = figure.subplots(1, 2)
    tests = {"1: two spheres": pairs(), "2: a sphere on a wall": spheres_on_wall()}
    share = np.linspace(0.0, 1.0, 200)
    rise = reference.hertz_rise(share)
    for axes, (title, test) in zip(panels, tests.items(), strict=True):
        _, peak, duration = test.hertz()
        for column, (name, marker, face) in enumerate(zip(test.names, "os", "kw", strict=True)):
            for part in (rise, 1.0 - rise):
                axes.plot(
                    1e6 * (test.touched[column] + duration[column] * part),
                    1e-3 * peak[column] * share**1.5,
                    color="0.6",
                    zorder=1,
                )
            axes.plot(
                1e6 * test.time[::2],
                1e-3 * test.force[::2, column],
                f"k{marker}",
                markersize=3,
                markerfacecolor=face,
                label=name,
            )
        axes.plot([], [], color="0.6", label="Hertz")
        axes.set_title(title, fontsize="medium")
        axes.set_xlabel("time, µs")
        axes.set_ylim(bottom=0)
        axes.set_xlim(left=0)
        axes.legend(frameon=False)
    panels[0].set_ylabel("contact force, kN")
    return figure
