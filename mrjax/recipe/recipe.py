"""The lab sheet: what a suspension is made of, and what follows from it.

Weight fractions become volume fractions, a number of particles in the box, and the `Parameters`
that every law reads. Everything is checked here, once.
"""

import inspect
import math
from pathlib import Path
from typing import Annotated, Any, Self

import jax
import numpy as np
from jax.tree_util import Partial
from jax.typing import DTypeLike
from pydantic import (
    BeforeValidator,
    Field,
    SkipValidation,
    ValidationError,
    field_validator,
    model_validator,
)

from mrjax.core.box import AXES, Box
from mrjax.core.errors import InputError, shown, shown_key
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.laws import drag
from mrjax.laws.hindrance import LARGEST_FRACTION, Hindrance
from mrjax.recipe import sheets, sizes
from mrjax.recipe.sheets import Name, Sheet
from mrjax.recipe.sizes import Sizes

RANDOM_CLOSE_PACKING = 0.64
"""Volume fraction above which equal spheres cannot be dispersed (Desmond & Weeks, 0903.0864)."""

LEAST_DENSITY, LEAST_MODULUS, LARGEST_DIAMETER = 10.0, 1e3, 0.1
"""kg/m^3, Pa and m: beyond these a number was given in another unit."""

NEUTRAL = 1e-9
"""Difference of densities, of their own size, that is of rounding."""

MOST_PARTICLES = 10**7
"""More than a machine can hold: a box in micrometres, taken for metres."""
LARGEST_BOX = 1e3
"""m."""
LEAST_FACTOR, LARGEST_FACTOR = 1e-6, 1e9
"""Of the drag."""


def _above_zero(key: str, value: object, what: str = "a number") -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value < math.inf:
        raise ValueError(f"{key} = {shown(value)}: must be {what} above zero, finite")
    if not sheets.SMALLEST <= value <= sheets.LARGEST:
        raise ValueError(f"{key} = {shown(value)}: must be {what} between 1e-30 and 1e30")
    return float(value)


def _diameter(value: Any) -> float | Sizes:
    if isinstance(value, int | float) and not isinstance(value, bool):
        diameter = _above_zero("particle.diameter", value, "the diameter in m")
        sizes.refuse_tiny("particle.diameter", diameter)
        return diameter
    try:
        return sizes.parse(value)
    except InputError as error:
        raise ValueError(f"particle.diameter.{error}") from None


class Particle(Sheet):
    """The uncoated particle."""

    density: float = Field(gt=0, le=1e5, description="the density in kg/m^3, above zero")
    diameter: Annotated[SkipValidation[float | Sizes], BeforeValidator(_diameter)] = Field(
        description="the diameter in m, a list of them, or a table of a distribution"
    )
    elastic_modulus: float = Field(
        gt=0, le=1e15, description="the elastic modulus in Pa, above zero"
    )
    poisson_ratio: float = Field(gt=-1, le=0.5, description="Poisson's ratio, -1 to 0.5")


class Fluid(Sheet):
    """The carrier fluid without additives."""

    density: float = Field(gt=0, le=1e5, description="the density in kg/m^3, above zero")
    viscosity: float = Field(ge=1e-9, le=1e15, description="the viscosity in Pa s, above zero")


class Coating(Sheet):
    """The layer of surfactant around each particle."""

    density: float = Field(gt=0, le=1e5, description="the density in kg/m^3, above zero")
    elastic_modulus: float = Field(
        gt=0, le=1e15, description="the elastic modulus in Pa, above zero"
    )
    poisson_ratio: float = Field(gt=-1, le=0.5, description="Poisson's ratio, -1 to 0.5")
    radius_factor: float = Field(
        ge=1, le=100, description="f_r, coated over uncoated radius, at least 1"
    )


class Wall(Sheet):
    """The walls; what is left out is as for the surfaces of the particles."""

    elastic_modulus: float | None = Field(
        default=None, gt=0, le=1e15, description="the elastic modulus in Pa, above zero"
    )
    poisson_ratio: float | None = Field(
        default=None, gt=-1, le=0.5, description="Poisson's ratio, -1 to 0.5"
    )
    friction: float | None = Field(
        default=None, ge=0, le=1e3, description="Coulomb's coefficient on the walls, at least 0"
    )
    restitution: float | None = Field(
        default=None, ge=1e-3, le=1, description="rebound over impact speed at a wall, 0.001 to 1"
    )
    rolling_friction: float | None = Field(
        default=None,
        ge=0,
        le=1e3,
        description="the coefficient of rolling on the walls, at least 0",
    )


class Composition(Sheet):
    """Weight fractions of the whole suspension."""

    particle: float = Field(gt=0, lt=1, description="the weight fraction of particles, 0 to 1")
    fluid: float = Field(gt=0, lt=1, description="the weight fraction of the fluid, 0 to 1")
    coating: float = Field(
        default=0.0, ge=0, lt=1, description="the weight fraction of the coating, 0 to 1"
    )

    @model_validator(mode="after")
    def _whole(self) -> Self:
        total = self.particle + self.fluid + self.coating
        if abs(total - 1.0) > 1e-6:
            raise ValueError(
                f"particle + fluid + coating = {self.particle} + {self.fluid} + {self.coating} = "
                f"{total:.6g}; weight fractions must sum to 1"
            )
        return self


class Drag(Sheet):
    """The corrections of Stokes' drag."""

    f_w: float | str | dict[str, float | str] = Field(
        default="son2018",
        description="a closure's name, a table {closure = name, ...}, or a number above zero",
    )
    local: bool = Field(
        default=False,
        description="true or false: whether f_w follows the local volume fraction",
    )
    f_s: float | list[float] = Field(
        default=1.0, description="a number above zero, or [d_max, d_med, d_min] in m"
    )
    f_v: float = Field(
        default=1.0,
        ge=LEAST_FACTOR,
        le=LARGEST_FACTOR,
        description="a viscosity ratio above zero",
    )
    added_mass: float = Field(
        default=0.5, ge=0, le=1e3, description="added over displaced mass, 0.5 for a sphere"
    )

    @field_validator("f_w", mode="before")
    @classmethod
    def _a_closure_or_a_factor(cls, f_w: Any) -> float | str | dict[str, float | str]:
        names = ", ".join(drag.CLOSURES)
        if isinstance(f_w, int | float):
            return _above_zero("drag.f_w", f_w, f"a closure's name ({names}) or a number")
        if not isinstance(f_w, str | dict):
            raise ValueError(
                f"drag.f_w = {shown(f_w)}: must be a closure's name, a table "
                f"{{closure = name, ...}} or a number above zero"
            )
        sheet = {"closure": f_w} if isinstance(f_w, str) else f_w
        if "closure" not in sheet:
            raise ValueError(
                f"drag.f_w = {shown(f_w)}: names no closure; add closure = one of {names}"
            )
        closure = drag.CLOSURES.get(str(sheet["closure"]))
        if closure is None:
            hint = sheets.did_you_mean(str(sheet["closure"]), drag.CLOSURES)
            raise ValueError(
                f"drag.f_w = {shown(f_w)}: no such closure; {hint}give a number or one of {names}"
            )
        known = list(inspect.signature(closure).parameters)[1:]
        for key in [key for key in sheet if key not in ("closure", *known)]:
            raise ValueError(
                f"drag.f_w.{shown_key(key)} = {shown(sheet[key])}: {sheet['closure']} has no such "
                f"coefficient; known: {', '.join(known) or 'none'}"
            )
        if isinstance(f_w, str):
            return f_w
        numbers = {key: _above_zero(f"drag.f_w.{key}", f_w[key]) for key in f_w if key != "closure"}
        return {"closure": f_w["closure"], **numbers}

    @field_validator("f_s", mode="before")
    @classmethod
    def _a_factor_or_dimensions(cls, f_s: Any) -> float | list[float]:
        if isinstance(f_s, int | float):
            return _above_zero("drag.f_s", f_s, "[d_max, d_med, d_min] or a number")
        try:
            largest, medium, smallest = (_above_zero("drag.f_s", value) for value in f_s)
            if not largest >= medium >= smallest:
                raise ValueError
        except (TypeError, ValueError):
            raise ValueError(
                f"drag.f_s = {shown(f_s)}: must be a number above zero, or [d_max, d_med, "
                "d_min] in m, largest first, above zero"
            ) from None
        return [largest, medium, smallest]


class Contact(Sheet):
    """What happens when particles touch."""

    friction: float = Field(
        default=0.0, ge=0, le=1e3, description="Coulomb's coefficient, at least 0"
    )
    restitution: float = Field(
        default=1.0, ge=1e-3, le=1, description="rebound over impact speed when dry, 0.001 to 1"
    )
    dissipation: float = Field(default=0.0, ge=0, le=1e3, description="A of Eq. 4 in s, at least 0")
    tangential_dissipation: float = Field(
        default=0.0, ge=0, le=1e3, description="B of Eq. 7 in s, at least 0"
    )
    rolling_friction: float = Field(
        default=0.0, ge=0, le=1e3, description="the coefficient of rolling friction, at least 0"
    )
    rolling_damping: float = Field(
        default=0.0,
        ge=0,
        le=1e3,
        description="the fraction of critical damping of rolling, at least 0",
    )


def _box(table: Any) -> Box:
    if isinstance(table, Box):
        return table
    if not isinstance(table, dict):
        raise ValueError(
            f"box = {shown(table)}: must be a table; give [box] with size and periodic"
        )
    unknown = [key for key in table if key not in ("size", "periodic")]
    if unknown:
        raise ValueError(
            f"box.{shown_key(unknown[0])} = {shown(table[unknown[0]])}: unknown key; "
            "known here: size, periodic"
        )
    if "size" not in table:
        raise ValueError("box.size is missing; give three lengths in m")
    try:
        return Box(**table)
    except InputError as error:
        raise ValueError(f"box.{error}") from None


def _closure(f_w: str | dict[str, float | str]) -> Partial:
    """A closure with the coefficients of a sheet."""
    coefficients = {} if isinstance(f_w, str) else dict(f_w)
    name = f_w if isinstance(f_w, str) else coefficients.pop("closure")
    return Partial(drag.CLOSURES[str(name)], **coefficients)


class Recipe(Sheet):
    """A suspension in a box, as written on a lab sheet; SI units, weight fractions.

    `Recipe.load` reads one, `Recipe(name=..., particle={...}, ...)` takes its tables; a wrong one
    is an `InputError` in one line.
    """

    name: Name = Field(description="a name for the recipe")
    particle: Particle = Field(description="a table [particle]")
    fluid: Fluid = Field(description="a table [fluid]")
    coating: Coating | None = Field(default=None, description="a table [coating]")
    wall: Wall | None = Field(default=None, description="a table [wall]")
    composition: Composition = Field(description="a table [composition]")
    drag: Drag = Field(default=Drag(), description="a table [drag]")
    contact: Contact = Field(default=Contact(), description="a table [contact]")
    box: Annotated[Box, BeforeValidator(_box)] = Field(description="a table [box] with size in m")
    gravity: float = Field(default=9.81, ge=0, le=1e9, description="g in m/s^2, at least zero")

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
        """The same sheet with some of it changed, and checked again.

            recipe.replace(gravity=1.62, fluid={"viscosity": 0.1}, coating=None)

        Args:
          changes: by key; of a table that the sheet has, only the keys to change.

        Raises:
          InputError: a value that cannot be used.
        """
        tables = {
            name: vars(table) | changes[name]
            for name, table in vars(self).items()
            if isinstance(changes.get(name), dict) and isinstance(table, Sheet | Box)
        }
        return Recipe(**vars(self) | changes | tables)

    @property
    def volume_fraction(self) -> float:
        """Phi of the uncoated particles, from the weight fractions; 1."""
        solid = self.composition.particle / self.particle.density
        liquid = self.composition.fluid / self.fluid.density
        shell = self.composition.coating / self.coating.density if self.coating else 0.0
        return solid / (solid + liquid + shell)

    @property
    def radius_factor(self) -> float:
        """f_r, coated over uncoated radius; 1 without a coating."""
        return self.coating.radius_factor if self.coating else 1.0

    @property
    def coated_volume_fraction(self) -> float:
        """Phi f_r^3 of the coated particles, which the closures of f_w read; 1."""
        return self.volume_fraction * self.radius_factor**3

    @property
    def particle_count(self) -> int:
        """N in the box, to the nearest whole number."""
        volume = self.volume_fraction * self.box.volume * 6.0 / math.pi
        diameter = self.particle.diameter
        if isinstance(diameter, float):
            return round(volume / diameter**3)
        count = round(volume / diameter.mean_cube)
        # The largest of few particles are smaller than those of many.
        for _ in range(3 if 0 < count <= MOST_PARTICLES else 0):
            count = max(1, round(volume / np.mean(diameter.sample(count) ** 3)))
        return count

    @property
    def diameters(self) -> np.ndarray:
        """Diameters of the uncoated particles in the box, (N,) in m; ascending."""
        diameter = self.particle.diameter
        if isinstance(diameter, float):
            return np.full(self.particle_count, diameter)
        return diameter.sample(self.particle_count)

    @property
    def largest_diameter(self) -> float:
        """Of the coated particles, m."""
        diameter = self.particle.diameter
        largest = diameter if isinstance(diameter, float) else float(self.diameters[-1])
        return largest * self.radius_factor

    @property
    def apparent_density(self) -> float:
        """(rho_p + rho_c (f_r^3 - 1)) / f_r^3 of the coated particle (Eqs. 20 and 27); kg/m^3."""
        shell = self.radius_factor**3 - 1.0
        coating = self.coating.density * shell if self.coating else 0.0
        return (self.particle.density + coating) / self.radius_factor**3

    @property
    def f_w(self) -> float:
        """The wall and crowding factor that the sheet asks for (Eqs. 14 and 15)."""
        if isinstance(self.drag.f_w, float):
            return self.drag.f_w
        with jax.ensure_compile_time_eval():  # a sheet holds numbers, also where jit is tracing
            return float(evaluate_with_numpy(_closure(self.drag.f_w), self.coated_volume_fraction))

    @property
    def hindrance(self) -> Hindrance | None:
        """f_w for the volume fraction of each particle's height, for `mrjax.simulate`.

        None unless the sheet asks for it with `local = true`.
        """
        return self.closure if self.drag.local else None

    @property
    def closure(self) -> Partial | None:
        """f_w for volume fractions, with the coefficients of the sheet; None where f_w is a number.

        A `jax.tree_util.Partial` of one of `mrjax.laws.drag.CLOSURES`.
        """
        if isinstance(self.drag.f_w, float):
            return None
        return _closure(self.drag.f_w)

    @property
    def f_s(self) -> float:
        """The shape factor that the sheet asks for (Eqs. 16 and 17)."""
        if isinstance(self.drag.f_s, float):
            return self.drag.f_s
        with jax.ensure_compile_time_eval():
            return float(evaluate_with_numpy(drag.shape_factor, *self.drag.f_s))

    @property
    def notes(self) -> list[str]:
        """What the sheet says that does not add up, though it can be simulated."""
        if not self.coating:
            return []
        layer = self.coating.density * (self.radius_factor**3 - 1.0)
        needed = self.composition.particle * layer / self.particle.density
        if needed <= self.composition.coating * (1 + 1e-9):
            return []
        available = self.composition.coating / self.composition.particle
        largest = (1.0 + available * self.particle.density / self.coating.density) ** (1 / 3)
        return [
            f"a coating of radius_factor {self.radius_factor:g} takes {needed:.2%} of the weight, "
            f"the composition holds {self.composition.coating:.2%}, enough for {largest:.3f}"
        ]

    def parameters(self, dtype: DTypeLike = float) -> Parameters:
        """The physical quantities every law reads: a pytree in SI units.

        Leaves have shape (); the radius (N,) where sizes are distributed, and what belongs to two
        surfaces (2, 2) where it differs between particles and walls.

        Args:
          dtype: of the leaves; `float` is JAX's default.
        """
        surface = self.coating or self.particle
        wall = self.wall or Wall()
        diameter, touch = self.particle.diameter, self.contact

        def table(between: float, at_wall: float | None) -> float | np.ndarray:
            if at_wall is None or at_wall == between:
                return between
            return np.array([[between, at_wall], [at_wall, at_wall]])

        parameters = Parameters(
            radius=(diameter if isinstance(diameter, float) else self.diameters) / 2,
            particle_density=self.particle.density,
            fluid_density=self.fluid.density,
            viscosity=self.fluid.viscosity,
            elastic_modulus=surface.elastic_modulus,
            poisson_ratio=surface.poisson_ratio,
            wall_elastic_modulus=_or(wall.elastic_modulus, surface.elastic_modulus),
            wall_poisson_ratio=_or(wall.poisson_ratio, surface.poisson_ratio),
            friction=table(touch.friction, wall.friction),
            restitution=table(touch.restitution, wall.restitution),
            dissipation=touch.dissipation,
            tangential_dissipation=touch.tangential_dissipation,
            rolling_friction=table(touch.rolling_friction, wall.rolling_friction),
            rolling_damping=touch.rolling_damping,
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
    def _can_be_made(self) -> Self:
        self._check_units()
        self._check_coating()
        self._check_settles()
        self._check_packing()
        self._check_closure()
        self._check_factors()
        self._check_box()
        return self

    def _check_units(self) -> None:
        solids = {"particle": self.particle, "coating": self.coating, "wall": self.wall}
        materials = {name: table for name, table in solids.items() if table}
        for name, table in {**materials, "fluid": self.fluid}.items():
            density = getattr(table, "density", LEAST_DENSITY)
            if density < LEAST_DENSITY:
                raise ValueError(
                    f"{name}.density = {density}: no solid or liquid is so light; give kg/m^3: "
                    "7.47 g/cm^3 is 7470"
                )
        for name, table in materials.items():
            if _or(table.elastic_modulus, LEAST_MODULUS) < LEAST_MODULUS:
                raise ValueError(
                    f"{name}.elastic_modulus = {table.elastic_modulus}: no solid is so soft; give "
                    "Pa: 211 GPa is 211e9"
                )
        largest = max(self.box.size)
        if largest > LARGEST_BOX:
            raise ValueError(
                f"box.size = {shown(list(self.box.size))}: too large for a suspension; give m: "
                "25 um is 25e-6"
            )
        diameter = self.particle.diameter
        typical = diameter if isinstance(diameter, float) else diameter.mean_cube ** (1 / 3)
        if typical > LARGEST_DIAMETER:
            raise ValueError(
                f"particle.diameter = {shown(diameter)}: too large for a suspension; give m: 4 "
                "um is 4e-6"
            )

    def _check_coating(self) -> None:
        if self.radius_factor > 1 and self.composition.coating == 0:
            raise ValueError(
                "composition.coating is missing or 0, though [coating] has radius_factor = "
                f"{self.radius_factor}; give its weight fraction, or remove [coating]"
            )
        if self.composition.coating > 0 and not self.coating:
            raise ValueError(
                f"composition.coating = {self.composition.coating}: there is no table [coating]; "
                "add one, or set the fraction to 0"
            )

    def _check_packing(self) -> None:
        limit = RANDOM_CLOSE_PACKING
        if self.volume_fraction >= limit:
            made_of = self.composition
            rest = made_of.fluid / self.fluid.density  # volume of all else, for each kg
            rest += made_of.coating / self.coating.density if self.coating else 0.0
            packed = limit * self.particle.density
            most = packed / (packed + (1 - limit) * (1 - made_of.particle) / rest)
            raise ValueError(
                f"composition.particle = {self.composition.particle}: a volume fraction of "
                f"{self.volume_fraction:.3f} is denser than random close packing ({limit}); give "
                f"less than {most:.3f}"
            )
        if self.coated_volume_fraction >= limit:
            most = (limit / self.volume_fraction) ** (1 / 3)
            raise ValueError(
                f"coating.radius_factor = {self.radius_factor}: the coated particles would take a "
                f"volume fraction of {self.coated_volume_fraction:.3f}, denser than random close "
                f"packing ({limit}); give less than {most:.3f}"
            )

    def _check_settles(self) -> None:
        """Lighter particles cream; of equal density they do neither."""
        if math.isclose(self.apparent_density, self.fluid.density, rel_tol=NEUTRAL):
            coated = " with their coating" if self.coating else ""
            raise ValueError(
                f"fluid.density = {self.fluid.density}: the particles, at "
                f"{self.apparent_density:.5g} kg/m^3{coated}, would neither sink nor rise; give "
                "another fluid or particle"
            )

    def _check_closure(self) -> None:
        sheet = self.drag.f_w
        name = sheet.get("closure") if isinstance(sheet, dict) else sheet
        if self.drag.local and (not isinstance(name, str) or name == "haberman-sayre"):
            raise ValueError(
                "drag.local = true: needs a closure that holds in the bed, not f_w = "
                f"{shown(name)}; give one of "
                + ", ".join(closure for closure in drag.CLOSURES if closure != "haberman-sayre")
            )
        if name != "haberman-sayre":
            return
        limit = float(drag.volume_fraction_at(drag.HABERMAN_SAYRE_LIMIT))
        if self.coated_volume_fraction > limit:
            raise ValueError(
                f"drag.f_w = {shown(name)}: holds up to a volume fraction of {limit:.4f} (lambda = "
                f"{drag.HABERMAN_SAYRE_LIMIT}), not at {self.coated_volume_fraction:.4f}; give "
                "another closure or a number"
            )

    def _check_factors(self) -> None:
        factors = {"f_w": [self.f_w], "f_s": [self.f_s]}
        if self.hindrance:
            factors["f_w"].append(float(evaluate_with_numpy(self.hindrance, LARGEST_FRACTION)))
        for name, values in factors.items():
            for value in values:
                if not LEAST_FACTOR <= value <= LARGEST_FACTOR:
                    raise ValueError(
                        f"drag.{name} = {shown(getattr(self.drag, name))}: a factor of "
                        f"{value:.3g}; give one between {LEAST_FACTOR:g} and {LARGEST_FACTOR:g}"
                    )

    def _check_box(self) -> None:
        count, size = self.particle_count, list(self.box.size)
        if count > MOST_PARTICLES:
            raise ValueError(
                f"box.size = {size}: holds {count:.3g} particles; give a smaller box, in m: 25 um "
                "is 25e-6"
            )
        if count < 1:
            raise ValueError(
                f"box.size = {size}: holds {self.volume_fraction:.3g} of its volume in particles, "
                "less than one particle; give a larger box"
            )
        diameter = self.largest_diameter
        for axis, length, periodic in zip(AXES, self.box.size, self.box.periodic, strict=True):
            if periodic and length < 2.0 * diameter:
                raise ValueError(
                    f"box.size = {size}: periodic along {axis} but narrower than two particles of "
                    f"{diameter:.4g} m: one would touch two images of another; give a wider box, "
                    "or walls"
                )
            if length <= diameter:
                raise ValueError(
                    f"box.size = {size}: not larger along {axis} than a particle of "
                    f"{diameter:.4g} m; give a larger box"
                )


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
