"""The oblique impacts that Kharaz, Gorham & Salman measured, Powder Technology 120:281 (2001).

A sphere of aluminium oxide, 5 mm across, hits an anvil of soda-lime glass at 3.9 m/s and many
angles; here simulated, in closed form where the surfaces slide, and measured. Two readings of their
figures are known, for two benchmarks.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import impacts, reference
from .impacts import Spheres
from .reference import Material

RADIUS, SPEED, FRICTION, RESTITUTION = 2.5e-3, 3.9, 0.092, 0.98
READINGS = ("chung_ooi_2011.toml", "mfix_dem05.toml")


@dataclass(frozen=True)
class Oblique:
    """What comes out of impacts at `SPEED` and an angle; each (N,)."""

    angle: np.ndarray
    """Of impact, degrees from the normal."""
    velocity: np.ndarray
    """Along and away from the wall, (N, 2) in m/s."""
    spin: np.ndarray
    """Of the sign that the authors give it, rad/s."""

    @property
    def tangential_restitution(self) -> np.ndarray:
        """e_t, tangential velocity of the centre over that before."""
        return self.velocity[:, 0] / (SPEED * np.sin(np.radians(self.angle)))

    @property
    def centre_angle(self) -> np.ndarray:
        """Angle at which the centre leaves, degrees."""
        return np.degrees(np.arctan2(self.velocity[:, 0], self.velocity[:, 1]))

    @property
    def contact_angle(self) -> np.ndarray:
        """Angle at which the point of contact leaves, degrees."""
        surface = self.velocity[:, 0] + RADIUS * self.spin
        return np.degrees(np.arctan2(surface, self.velocity[:, 1]))


UNITS = {"tangential_restitution": "1", "spin": "rad/s", "centre_angle": "deg"}
LABELS = {
    "tangential_restitution": "tangential restitution $e_t$",
    "spin": "spin after impact, rad/s",
    "centre_angle": "rebound angle of the\ncentre, deg",
    "contact_angle": "rebound angle of the\ncontact point, deg",
}
IMPULSE = {"tangential_restitution": lambda value: 1.0 - value, "spin": np.abs}
"""What is proportional to the tangential impulse of an impact at an angle."""


def simulated(
    material: list[Material],
    angle: np.ndarray,
    *,
    restitution: float,
    wall: Material = reference.RIGID,
) -> Oblique:
    """Impacts of spheres of `RADIUS` at `SPEED` with `FRICTION`, side by side."""
    theta = np.radians(angle)
    before = SPEED * np.stack([np.sin(theta), -np.cos(theta)], axis=1)
    velocity, spin = impacts.after(
        impacts.scene(
            Spheres(material, RADIUS, before),
            wall=wall,
            friction=FRICTION,
            restitution=restitution,
        )
    )
    return Oblique(angle, velocity, -spin)


def slid(angle: np.ndarray, restitution: float) -> Oblique:
    """The same where they slide throughout.

    e_t = 1 - mu (1 + e) / tan(theta), spin -5/2 mu (1 + e) v cos(theta) / R.
    """
    theta = np.radians(angle)
    lost = FRICTION * (1.0 + restitution) * SPEED * np.cos(theta)
    along, away = SPEED * np.sin(theta) - lost, restitution * SPEED * np.cos(theta)
    return Oblique(angle, np.stack([along, away], axis=1), -2.5 * lost / RADIUS)


def slides(angle: np.ndarray, restitution: float) -> np.ndarray:
    """Whether the surfaces slide to the end: tan(theta) > 7/2 mu (1 + e)."""
    return np.tan(np.radians(angle)) > 3.5 * FRICTION * (1.0 + restitution)


@cache
def measured(reading: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Angles and values of every quantity that was read."""
    found = reference.load(reading)["kharaz_2001"]
    return {key: (np.array(of["angle"]), np.array(of["value"])) for key, of in found.items()}


@cache
def scatter() -> float:
    """Standard deviation of the measurements, as a fraction of the tangential impulse.

    Of all points where the surfaces slide, about Coulomb's law, which holds there whatever the
    stiffness: for e_t the impulse is what it lacks of 1, and the spin is proportional to it.
    """
    departures = []
    for reading in READINGS:
        for quantity, impulse in IMPULSE.items():
            angle, value = measured(reading)[quantity]
            theory = impulse(getattr(slid(angle, RESTITUTION), quantity))
            departures.append((theory / impulse(value) - 1.0)[slides(angle, RESTITUTION)])
    return float(np.sqrt(np.mean(np.concatenate(departures) ** 2)))


def words(quantity: str) -> str:
    """A quantity's name, as the page prints it."""
    return quantity.replace("_", " ")


def panels(figure: Figure, *quantities: str, widest: float) -> dict[str, Axes]:
    """An empty diagram for each quantity, against impact angles up to the widest."""
    found = dict(zip(quantities, figure.subplots(1, len(quantities)), strict=True))
    for quantity, axes in found.items():
        axes.set_xlabel("impact angle, deg")
        axes.set_ylabel(LABELS[quantity])
        axes.set_xticks(range(0, 81, 20))
        axes.set_xlim(0, widest)
    return found
