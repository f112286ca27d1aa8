"""A tube of 10 cm with case 2's particles, whose bed yields as the compressed box does."""

from typing import NamedTuple

import numpy as np

import mrjax
from mrjax.laws import dimensionless, particle
from tests.studies.compressive_yield import curves

HEIGHT = 0.1
"""Height of the suspension, m."""
DENSEST = 0.634
"""Volume fraction that a bed does not exceed: random close packing."""
HOURS = 24.0 * 40.0
FRAMES = 161
TUBES = {
    "10": 14e-9,
    "490, oleic acid": 2e-9,
    "49,000, bare": 2e-10,
}
"""Thickness of the layer on a particle, m, by Bond number in words."""


class Tube(NamedTuple):
    """A tube that has settled."""

    words: str
    hours: np.ndarray  # (frames,)
    ratio: np.ndarray  # height of the mudline over that of the suspension, (frames,)
    load: float  # net weight of all particles over the area, Pa
    strength: float  # sigma of the dispersed suspension's volume fraction, Pa


def settled(name: str = "base") -> list[Tube]:
    """The rigid tube, and one for each Bond number."""
    sheet = curves.recipe(curves.CONDITIONS[name])
    law = curves.fit(curves.curves()[name]).compression  # over F_c / d^2
    parameters, fraction = sheet.parameters(), sheet.coated_volume_fraction
    weight = float(particle.net_weight(parameters)) / (
        4 / 3 * np.pi * float(parameters.radius) ** 3
    )
    load = weight * fraction * HEIGHT
    tubes = [_tube("rigid", sheet, None, load, 0.0)]
    for words, layer in TUBES.items():
        radius = float(parameters.radius)
        pull_off = float(dimensionless.pull_off(1e-19, radius / 2.0, 2.0 * layer))
        scale = pull_off / (2.0 * radius) ** 2
        scaled = mrjax.Compression(
            gel_fraction=law.gel_fraction, stress=law.stress * scale, exponent=law.exponent
        )
        strength = float(scaled.solid_stress(fraction))
        tubes.append(_tube(words, sheet, scaled, load, strength))
    return tubes


def _tube(
    words: str,
    sheet: mrjax.Recipe,
    compression: mrjax.Compression | None,
    load: float,
    strength: float,
) -> Tube:
    times = np.linspace(0.0, 3600.0 * HOURS, FRAMES)
    tube = mrjax.column(
        sheet.parameters(),
        height=HEIGHT,
        volume_fraction=sheet.coated_volume_fraction,
        bed_fraction=DENSEST,
        times=times,
        hindrance=sheet.hindrance,
        compression=compression,
    )
    return Tube(words, times / 3600.0, np.asarray(tube.sedimentation_ratio), load, strength)
