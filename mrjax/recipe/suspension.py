"""The tables of a lab sheet together, and the quantities that follow from them."""

import math
from typing import Annotated

import jax
import numpy as np
from jax.tree_util import Partial
from pydantic import BeforeValidator, Field

from mrjax.core.box import Box
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.laws import dimensionless, drag, particle
from mrjax.laws.hindrance import Hindrance
from mrjax.recipe import closures, tables
from mrjax.recipe.composition import Composition, Phases
from mrjax.recipe.sheets import UNSTATED, Name, Sheet
from mrjax.recipe.tables import (
    Attraction,
    BrownianMotion,
    Coating,
    Contact,
    Drag,
    Fluid,
    Magnetism,
    Particle,
    Wall,
)

MOST_PARTICLES = 10**7
"""Largest number of particles; a larger one means that a box in micrometres was given in metres."""
CHOSEN_PARTICLES = 300
"""Number of particles of a chosen box, about that of the bundled sheets."""


class Suspension(Sheet):
    """A suspension in a box: the tables of its sheet, and derived quantities."""

    name: Name = Field(description="a name for the recipe")
    particle: Particle = Field(description="a table [particle]")
    fluid: Fluid = Field(description="a table [fluid]")
    coating: Coating | None = Field(default=None, description="a table [coating]")
    wall: Wall | None = Field(default=None, description="a table [wall]")
    composition: Composition = Field(description="a table [composition]")
    drag: Drag = Field(default=Drag(), description="a table [drag]")
    contact: Contact = Field(default=Contact(), description="a table [contact]")
    attraction: Attraction | None = Field(default=None, description="a table [attraction]")
    magnetism: Magnetism | None = Field(default=None, description="a table [magnetism]")
    brownian: BrownianMotion | None = Field(default=None, description="a table [brownian]")
    box: Annotated[Box, BeforeValidator(tables.box)] = Field(
        default=UNSTATED, description="a table [box] with size in m"
    )
    temperature: float = Field(
        default=293.15, gt=0, le=1e4, description="the temperature in K: 20 degrees are 293.15"
    )
    gravity: float = Field(default=9.81, ge=0, le=1e9, description="g in m/s^2, at least zero")

    @property
    def phases(self) -> Phases:
        """Densities of particles, fluid and coating, and the relative volume of the coating."""
        return Phases(
            self.particle.density,
            self.fluid.density,
            self.coating.density if self.coating else None,
            self.radius_factor**3 - 1.0,
        )

    @property
    def volume_fraction(self) -> float:
        """Volume fraction of the uncoated particles, from the composition; 1."""
        return self.composition.fraction(self.phases)

    @property
    def radius_factor(self) -> float:
        """f_r, coated over uncoated radius; 1 without a coating."""
        return self.coating.radius_factor if self.coating else 1.0

    @property
    def coated_volume_fraction(self) -> float:
        """Volume fraction of the coated particles, phi f_r^3, which the closures of f_w take; 1."""
        return self.volume_fraction * self.radius_factor**3

    @property
    def particle_count(self) -> int:
        """Number N of particles in the box, to the nearest whole number."""
        volume = self.volume_fraction * self.box.volume * 6.0 / math.pi
        diameter = self.particle.diameter
        if isinstance(diameter, float):
            return round(volume / diameter**3)
        count = round(volume / diameter.mean_cube)
        # The mean of N quantiles depends on N: iterate.
        for _ in range(3 if 0 < count <= MOST_PARTICLES else 0):
            count = max(1, round(volume / np.mean(diameter.sample(count) ** 3)))
        return count

    @property
    def diameters(self) -> np.ndarray:
        """Diameters of the uncoated particles in the box, (N,) in m, ascending.

        If the box holds none, or too many to simulate, N is `CHOSEN_PARTICLES`.
        """
        diameter, count = self.particle.diameter, self.particle_count
        count = count if 1 <= count <= MOST_PARTICLES else CHOSEN_PARTICLES
        return np.full(count, diameter) if isinstance(diameter, float) else diameter.sample(count)

    @property
    def largest_diameter(self) -> float:
        """Largest diameter of the coated particles, m."""
        diameter = self.particle.diameter
        largest = diameter if isinstance(diameter, float) else float(self.diameters[-1])
        return largest * self.radius_factor

    @property
    def apparent_density(self) -> float:
        """Density of the coated particle, (rho_p + rho_c (f_r^3 - 1)) / f_r^3; kg/m^3."""
        coating_density = self.coating.density if self.coating else 0.0
        mass_over_core_volume = particle.mass_over_core_volume(
            self.particle.density, coating_density, self.radius_factor
        )
        return mass_over_core_volume / self.radius_factor**3

    @property
    def peclet_number(self) -> float:
        """Peclet number |m - m_f| g R / (k T) of the coated particle of mean volume; 1."""
        diameter = self.particle.diameter
        if not isinstance(diameter, float):
            diameter = diameter.mean_cube ** (1 / 3)
        radius = self.radius_factor * diameter / 2.0
        excess = abs(self.apparent_density - self.fluid.density)
        weight = 4.0 / 3.0 * math.pi * radius**3 * excess * self.gravity
        return weight * radius / (dimensionless.BOLTZMANN * self.temperature)

    @property
    def brownian_motion(self) -> bool:
        """True if the particles of the sheet are in Brownian motion."""
        return self.brownian is not None and self.brownian.on

    @property
    def f_w(self) -> float:
        """Wall and crowding factor of the drag (Eqs. 14 and 15); 1."""
        closure = self.closure
        if closure is None:
            return float(self.drag.f_w)  # type: ignore[arg-type] # a number without a closure
        with jax.ensure_compile_time_eval():  # a number, even within jit
            return float(evaluate_with_numpy(closure, self.coated_volume_fraction))

    @property
    def hindrance(self) -> Hindrance | None:
        """f_w as a function of the local volume fraction, for `mrjax.simulate`.

        It is None unless the sheet has `local = true`.
        """
        return self.closure if self.drag.local else None

    @property
    def closure(self) -> Partial | None:
        """f_w as a function of the volume fraction, with the coefficients of the sheet.

        It is a `jax.tree_util.Partial` of one of `mrjax.laws.closures.table.CLOSURES`, and None if
        the f_w of the sheet is a number.
        """
        if isinstance(self.drag.f_w, float):
            return None
        return closures.closure(self.drag.f_w, self.peclet_number)

    @property
    def f_s(self) -> float:
        """Shape factor of the drag (Eqs. 16 and 17); 1."""
        if isinstance(self.drag.f_s, float):
            return self.drag.f_s
        with jax.ensure_compile_time_eval():
            return float(evaluate_with_numpy(drag.shape_factor, *self.drag.f_s))
