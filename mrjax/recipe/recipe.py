"""The lab sheet: the composition of a suspension, and the `Parameters` that follow from it.

The sheet gives volume fractions, a number of particles in the box, and the `Parameters` that the
laws read. Everything is checked here, once. Keys that only particles in contact use may be missing;
a simulation of particles then refuses the sheet.
"""

from pathlib import Path
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike
from pydantic import ValidationError, model_validator

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.recipe import assumptions, contacts, plausibility, sheets, size_classes
from mrjax.recipe.sheets import Sheet
from mrjax.recipe.size_classes import SizeClasses
from mrjax.recipe.suspension import Suspension
from mrjax.recipe.tables import MODULI, Magnetism, Wall


class Recipe(Suspension):
    """A suspension in a box, as on a lab sheet, in SI units.

    `Recipe.load` reads a sheet; `Recipe(name=..., particle={...}, ...)` takes its tables. A fault
    raises an `InputError` in one line.
    """

    def __init__(self, /, **tables: Any):
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise InputError(sheets.first_fault(Recipe, error)) from None

    @classmethod
    def load(cls, source: str | Path) -> "Recipe":
        """Loads a bundled recipe by name (`case1`, `case2`, `case3`) or a TOML file by path.

        Raises:
          InputError: the file or a value in it cannot be used.

        Example:
          >>> recipe = mrjax.Recipe.load("case2")
          >>> recipe.particle_count, round(recipe.volume_fraction, 4)
          (314, 0.3372)
        """
        table, _ = sheets.read(source, "mrjax.recipe.bundled", "recipe")
        return sheets.validated(cls, table, str(source))

    def replace(self, **changes: Any) -> "Recipe":
        """Returns a copy of the sheet with some keys changed, and checked again.

            recipe.replace(gravity=1.62, fluid={"viscosity": 0.1}, coating=None)

        Args:
          changes: new values by key; for a table that the sheet has, a dict of the changed keys.

        Raises:
          InputError: a value cannot be used.
        """
        tables = {}
        for name, table in vars(self).items():
            change = changes.get(name)
            if isinstance(change, dict) and isinstance(table, Sheet):
                tables[name] = table.changed(change)
            elif isinstance(change, dict) and isinstance(table, Box):
                tables[name] = vars(table) | change
        return Recipe(**self.stated | changes | tables)

    @property
    def notes(self) -> list[str]:
        """Notes on assumed values, and on inconsistent values that do not prevent a simulation."""
        return [*assumptions.notes(self), *plausibility.notes(self)]

    @property
    def contact_notes(self) -> list[str]:
        """Notes on values assumed for particles in contact, which no other model uses."""
        return contacts.notes(self)

    def parameters(self, dtype: DTypeLike = float) -> Parameters:
        """Returns the physical quantities that the laws read, as a pytree in SI units.

        Leaves have shape (). With a size distribution the radius has shape (N,). A property of two
        surfaces has shape (2, 2) if it differs between particles and walls. Moduli that the sheet
        does not state are NaN; only particles in contact need them, and their simulation refuses
        NaN.

        Args:
          dtype: dtype of the leaves; `float` is JAX's default.
        """
        surface = self.coating or self.particle
        wall = self.wall or Wall()
        elastic_modulus, poisson_ratio = (
            _value_or(getattr(surface, key), np.nan) for key in MODULI
        )
        diameter, contact, attraction = self.particle.diameter, self.contact, self.attraction

        def value_or_table(name: str, table: Sheet = contact) -> float | np.ndarray:
            particles, walls = getattr(table, name), getattr(wall, name, None)
            if walls is None or walls == particles:
                return particles
            return np.array([[particles, walls], [walls, walls]])

        parameters = Parameters(
            radius=(diameter if isinstance(diameter, float) else self.diameters) / 2,
            particle_density=self.particle.density,
            fluid_density=self.fluid.density,
            viscosity=self.fluid.viscosity,
            yield_stress=self.fluid.yield_stress,
            flow_index=self.fluid.flow_index,
            yield_growth=self.fluid.yield_growth,
            elastic_modulus=elastic_modulus,
            poisson_ratio=poisson_ratio,
            wall_elastic_modulus=_value_or(wall.elastic_modulus, elastic_modulus),
            wall_poisson_ratio=_value_or(wall.poisson_ratio, poisson_ratio),
            # Every key of [contact] is a leaf.
            **{name: value_or_table(name) for name in vars(contact)},
            hamaker=value_or_table("hamaker", attraction) if attraction else None,
            layer_thickness=attraction.layer_thickness if attraction else None,
            wall_layer_thickness=wall.layer_thickness if attraction else None,
            attraction_range=attraction.range if attraction else None,
            **_magnetic(self.magnetism),
            temperature=self.temperature if self.brownian_motion else None,
            gravity=self.gravity,
            added_mass=self.drag.added_mass,
            # Without a coating, a layer that f_r adds consists of fluid.
            coating_density=self.coating.density if self.coating else self.fluid.density,
            f_w=self.f_w,
            f_s=self.f_s,
            f_v=self.drag.f_v,
            f_r=self.radius_factor,
        )
        with jax.ensure_compile_time_eval():
            return parameters.astype(dtype)

    def size_classes(self, count: int = 10, dtype: DTypeLike = float) -> SizeClasses:
        """Returns the particles as classes of equal volume, for `mrjax.polydisperse_column`.

        Diameters that the sheet lists stay as they are, each one a class. All classes have the
        coating's f_r, and therefore one density.

        Args:
          count: number K of classes of a log-normal distribution or of percentiles.
          dtype: dtype of the leaves; `float` is JAX's default.

        Raises:
          InputError: `count` is no number of classes.

        Example:
          >>> powder = mrjax.Recipe.load("case2").replace(
          ...     particle={"diameter": {"median": 4e-6, "geometric_standard_deviation": 1.5}}
          ... )
          >>> print(1e6 * powder.size_classes(3).diameters.round(8))
          [ 4.38  6.62 10.76]
        """
        diameters, shares = size_classes.divide(self.particle.diameter, count)
        with jax.ensure_compile_time_eval():
            parameters = self.parameters(dtype).replace(radius=jnp.asarray(diameters / 2, dtype))
            fractions = jnp.asarray(self.coated_volume_fraction * shares, dtype)
        return SizeClasses(parameters, fractions, diameters)

    @model_validator(mode="after")
    def _whole_and_plausible(self) -> Self:
        self.assume(fluid=assumptions.fluid(self.fluid, self.temperature))
        plausibility.refuse_implausible(self)
        if "box" in self.stated:
            plausibility.refuse_box(self)
        else:
            self.assume(box=assumptions.box(self))
        return self


def _magnetic(table: Magnetism | None) -> dict[str, Any]:
    """The leaves of magnetism that the sheet states; the others are None."""
    stated = {} if table is None else table.stated
    return {name: np.asarray(value, float) for name, value in stated.items()}


def _value_or(value: float | None, default: float) -> float:
    return default if value is None else value
