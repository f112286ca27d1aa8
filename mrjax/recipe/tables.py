"""The tables of a lab sheet, with their keys, bounds and remedies."""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, SkipValidation, field_validator, model_validator

from mrjax.core.box import Box
from mrjax.core.errors import InputError, shown, shown_key
from mrjax.laws.attraction import BARE_LAYER
from mrjax.recipe import closures, sizes
from mrjax.recipe.materials import MATERIALS
from mrjax.recipe.sheets import UNSTATED, Sheet, above_zero
from mrjax.recipe.size_checks import refuse_tiny
from mrjax.recipe.sizes import Sizes

LEAST_FACTOR, LARGEST_FACTOR = 1e-6, 1e9
"""Bounds of a drag factor."""
LARGEST_HAMAKER = 1e-16
"""Bound in J, hundreds of times that of metals; a larger number was given in another unit."""
LARGEST_MAGNETISATION = 1e7
"""Bound in A/m of magnetisations and fields; a larger number was given in another unit."""
MODULI = ("elastic_modulus", "poisson_ratio")
"""Keys of a solid that only contacts use."""


def _diameter(value: Any) -> float | Sizes:
    if isinstance(value, int | float) and not isinstance(value, bool):
        diameter = above_zero("particle.diameter", value, "the diameter in m")
        refuse_tiny("particle.diameter", diameter)
        return diameter
    try:
        return sizes.parse(value)
    except InputError as error:
        raise ValueError(f"particle.diameter.{error}") from None


class Solid(Sheet):
    """The material of a particle or its coating."""

    density: float = Field(gt=0, le=1e5, description="the density in kg/m^3, above zero")
    elastic_modulus: float | None = Field(
        default=None, gt=0, le=1e15, description="the elastic modulus in Pa, above zero"
    )
    poisson_ratio: float | None = Field(
        default=None, gt=-1, le=0.5, description="Poisson's ratio, -1 to 0.5"
    )
    material: Literal["metal", "mineral", "polymer"] | None = Field(
        default=None, description=f"one of {', '.join(MATERIALS)}, for moduli that are not stated"
    )

    def changed(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Returns the stated keys with some changed; another material replaces stated moduli."""
        others = {key: value for key, value in self.stated.items() if key not in MODULI}
        return (others if "material" in changes else self.stated) | changes

    @model_validator(mode="after")
    def _assume_moduli(self) -> Self:
        if self.material is not None:
            moduli = MATERIALS[self.material]
            for key in MODULI:
                if getattr(self, key) is None:
                    self.assume(**{key: getattr(moduli, key)})
        return self


class Particle(Solid):
    """The uncoated particle."""

    diameter: Annotated[SkipValidation[float | Sizes], BeforeValidator(_diameter)] = Field(
        description="the diameter in m, a list of them, or a table of a distribution"
    )


class Fluid(Sheet):
    """The carrier fluid without additives: its density and viscosity, or the name of a liquid.

    Properties that are not stated are those of the liquid at the temperature of the sheet.
    """

    density: float = Field(
        default=UNSTATED, gt=0, le=1e5, description="the density in kg/m^3, above zero"
    )
    viscosity: float = Field(
        default=UNSTATED, ge=1e-9, le=1e15, description="the viscosity in Pa s, above zero"
    )
    liquid: Literal["water"] | None = Field(default=None, description='"water"')
    yield_stress: float | None = Field(
        default=None, ge=0, le=1e9, description="the yield stress in Pa, at least 0"
    )
    consistency: float | None = Field(
        default=None,
        ge=1e-9,
        le=1e15,
        description="the consistency in Pa s^n, above zero, in place of the viscosity",
    )
    flow_index: float | None = Field(
        default=None, ge=0.1, le=2, description="the flow index n, 0.1 to 2; 1 for a Bingham fluid"
    )
    yield_growth: float | None = Field(
        default=None, ge=0, le=1e9, description="the growth of the yield stress in Pa/s, at least 0"
    )

    def changed(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Returns the stated keys with some changed; another liquid replaces stated properties."""
        return changes if "liquid" in changes else self.stated | changes

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.flow_index is not None and self.consistency is None:
            raise ValueError(
                f"fluid.flow_index = {self.flow_index}: needs consistency, in Pa s^n, in place of "
                "the viscosity"
            )
        if self.consistency is not None:
            if self.viscosity is not None:
                raise ValueError(
                    f"fluid.consistency = {self.consistency}: stands in place of viscosity; leave "
                    "out one of the two"
                )
            self.assume(viscosity=self.consistency)
        for key in ("density", "viscosity") if self.liquid is None else ():
            if getattr(self, key) is None:
                remedy = type(self).model_fields[key].description
                raise ValueError(f'fluid.{key} is missing; give {remedy}, or liquid = "water"')
        return self


class Coating(Solid):
    """The layer of surfactant around each particle."""

    radius_factor: float = Field(
        ge=1, le=100, description="f_r, coated over uncoated radius, at least 1"
    )


class Wall(Sheet):
    """The walls; missing keys are taken from the surfaces of the particles."""

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
    hamaker: float | None = Field(
        default=None,
        ge=0,
        le=LARGEST_HAMAKER,
        description="the Hamaker constant of particles and walls in J, at least 0",
    )
    layer_thickness: float | None = Field(
        default=None, gt=0, le=1e-3, description="the thickness of the layer on the walls in m"
    )


class Drag(Sheet):
    """The corrections of Stokes' drag."""

    f_w: float | str | dict[str, float | str] = Field(
        default="son2018",
        description="a closure's name, a table {closure = name, ...}, or a number above zero",
    )
    local: bool = Field(
        default=False,
        description="true or false: true if f_w follows the local volume fraction",
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
        return closures.checked(f_w)

    @field_validator("f_s", mode="before")
    @classmethod
    def _a_factor_or_dimensions(cls, f_s: Any) -> float | list[float]:
        if isinstance(f_s, int | float):
            return above_zero("drag.f_s", f_s, "[d_max, d_med, d_min] or a number")
        try:
            largest, medium, smallest = (above_zero("drag.f_s", value) for value in f_s)
            if not largest >= medium >= smallest:
                raise ValueError
        except (TypeError, ValueError):
            raise ValueError(
                f"drag.f_s = {shown(f_s)}: must be a number above zero, or [d_max, d_med, "
                "d_min] in m, largest first, above zero"
            ) from None
        return [largest, medium, smallest]


class Contact(Sheet):
    """Friction, damping and rolling resistance of surfaces that touch."""

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


class Attraction(Sheet):
    """Van der Waals attraction of surfaces."""

    hamaker: float = Field(
        ge=0,
        le=LARGEST_HAMAKER,
        description="the Hamaker constant in J, at least 0: 100 zJ are 1e-19",
    )
    layer_thickness: float = Field(
        default=BARE_LAYER,
        gt=0,
        le=1e-3,
        description="the thickness of the layer on one surface in m, above zero",
    )
    range: float | None = Field(
        default=None, ge=0, le=1, description="the range of the attraction in radii, 0 to 1"
    )


class Magnetism(Sheet):
    """Remanent moments of the particles, and a uniform field that induces others."""

    remanence: float | None = Field(
        default=None,
        ge=0,
        le=LARGEST_MAGNETISATION,
        description="the remanence of a particle in A/m, at least 0: 1 emu/cm^3 is 1e3",
    )
    field: list[float] | None = Field(
        default=None, description="three components of the field in A/m: 1 Oe is 79.6"
    )
    susceptibility: float | None = Field(
        default=None, ge=0, le=1e7, description="the susceptibility of the solid, at least 0"
    )
    saturation: float | None = Field(
        default=None,
        gt=0,
        le=LARGEST_MAGNETISATION,
        description="the saturation magnetisation of the solid in A/m, above zero: iron has 1.7e6",
    )

    @field_validator("field")
    @classmethod
    def _three_components(cls, value: list[float] | None) -> list[float] | None:
        if value is not None and (
            len(value) != 3 or not max(map(abs, value)) <= LARGEST_MAGNETISATION
        ):
            raise ValueError(
                f"magnetism.field = {shown(value)}: must be three components in A/m, at most "
                f"{LARGEST_MAGNETISATION:g} in size; 1 T in air is 7.96e5"
            )
        return value

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.remanence is None and self.field is None:
            raise ValueError(
                "magnetism.remanence is missing; give it in A/m, or a field and a susceptibility"
            )
        if self.field is not None and not self.remanence and self.susceptibility is None:
            raise ValueError(
                "magnetism.susceptibility is missing, without which the field does nothing; give "
                "that of the solid, or a remanence in A/m"
            )
        if self.saturation is not None and self.susceptibility is None:
            raise ValueError(
                f"magnetism.saturation = {self.saturation}: needs susceptibility; give it, or "
                "remove the key"
            )
        if self.saturation is not None and (self.remanence or 0.0) > self.saturation:
            raise ValueError(
                f"magnetism.remanence = {self.remanence}: is above the saturation of "
                f"{self.saturation:g} A/m; give less"
            )
        return self


class BrownianMotion(Sheet):
    """Brownian motion at the temperature of the sheet."""

    on: bool = Field(description="true or false: true for random kicks by the fluid")


def box(table: Any) -> Box:
    """Returns the box of a table with the keys size and periodic."""
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
