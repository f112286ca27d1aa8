"""The lab sheet: what a suspension is made of, and the `Parameters` that follow from it.

A composition becomes volume fractions, a number of particles in the box, and the `Parameters` that
every law reads. Everything is checked here, once; what only particles in contact use is asked for
where they are run.
"""

from pathlib import Path
from typing import Any, Self

import jax
import numpy as np
from jax.typing import DTypeLike
from pydantic import ValidationError, model_validator

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.recipe import assumptions, contacts, plausibility, sheets
from mrjax.recipe.sheets import Sheet
from mrjax.recipe.suspension import Suspension
from mrjax.recipe.tables import MODULI, Wall


class Recipe(Suspension):
    """A suspension in a box, as written on a lab sheet; SI units, weight fractions.

    `Recipe.load` reads one, `Recipe(name=..., particle={...}, ...)` takes its tables; a wrong one
    is an `InputError` in one line.
    """

    def __init__(self, /, **tables: Any):
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise InputError(sheets.first_fault(Recipe, error)) from None

    @classmethod
    def load(cls, source: str | Path) -> "Recipe":
        """A bundled recipe by name (`case1`, `case2`, `case3`) or a TOML file by path.

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
        """Returns the sheet with some of it changed, and checked again.

            recipe.replace(gravity=1.62, fluid={"viscosity": 0.1}, coating=None)

        Args:
          changes: by key; of a table that the sheet has, only the keys to change.

        Raises:
          InputError: a value that cannot be used.
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
        """Remarks on what was assumed, and on what does not add up though it can be simulated."""
        return [*assumptions.notes(self), *plausibility.notes(self)]

    @property
    def contact_notes(self) -> list[str]:
        """Remarks on what was assumed for particles in contact, which no other model uses."""
        return contacts.notes(self)

    def parameters(self, dtype: DTypeLike = float) -> Parameters:
        """The physical quantities every law reads: a pytree in SI units.

        Leaves have shape (); the radius (N,) where sizes are distributed, and what belongs to two
        surfaces (2, 2) where it differs between particles and walls. Moduli that the sheet does not
        give are NaN: only particles in contact need them, and a run of these refuses them.

        Args:
          dtype: of the leaves; `float` is JAX's default.
        """
        surface = self.coating or self.particle
        wall = self.wall or Wall()
        elastic_modulus, poisson_ratio = (_or(getattr(surface, key), np.nan) for key in MODULI)
        diameter, touch = self.particle.diameter, self.contact

        def of_surfaces(name: str) -> float | np.ndarray:
            between, at_wall = getattr(touch, name), getattr(wall, name, None)
            if at_wall is None or at_wall == between:
                return between
            return np.array([[between, at_wall], [at_wall, at_wall]])

        parameters = Parameters(
            radius=(diameter if isinstance(diameter, float) else self.diameters) / 2,
            particle_density=self.particle.density,
            fluid_density=self.fluid.density,
            viscosity=self.fluid.viscosity,
            elastic_modulus=elastic_modulus,
            poisson_ratio=poisson_ratio,
            wall_elastic_modulus=_or(wall.elastic_modulus, elastic_modulus),
            wall_poisson_ratio=_or(wall.poisson_ratio, poisson_ratio),
            # Every key of [contact] is a leaf.
            **{name: of_surfaces(name) for name in vars(touch)},
            gravity=self.gravity,
            added_mass=self.drag.added_mass,
            # Without a coating the layer that f_r would add is one of fluid.
            coating_density=self.coating.density if self.coating else self.fluid.density,
            f_w=self.f_w,
            f_s=self.f_s,
            f_v=self.drag.f_v,
            f_r=self.radius_factor,
        )
        with jax.ensure_compile_time_eval():
            return parameters.astype(dtype)

    @model_validator(mode="after")
    def _whole_and_plausible(self) -> Self:
        self.assume(fluid=assumptions.fluid(self.fluid, self.temperature))
        plausibility.refuse_implausible(self)
        if "box" in self.stated:
            plausibility.refuse_box(self)
        else:
            self.assume(box=assumptions.box(self))
        return self


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
