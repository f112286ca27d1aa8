"""The composition of a suspension, stated in one of four ways, and its volume fraction."""

from typing import Any, NamedTuple, Self

from pydantic import Field, model_validator

from mrjax.recipe.sheets import Sheet

WEIGHTS = ("particle", "fluid", "coating")
"""Keys of the weight fractions, which together state the composition."""
ALONE = ("volume_fraction", "concentration", "solids_ratio")
"""Keys that state the composition alone."""
WAYS = (
    "weight fractions particle and fluid (and coating), volume_fraction, concentration (kg/m^3), "
    "or solids_ratio (kg of particles per kg of fluid)"
)
"""List of the four ways for messages."""


class Phases(NamedTuple):
    """Densities of particle, fluid and coating, and the volume of the coating."""

    particle: float
    """Density of the uncoated particle, kg/m^3."""
    fluid: float
    """Density of the fluid, kg/m^3."""
    coating: float | None
    """Density of the coating, kg/m^3; None without a coating."""
    layer: float
    """Volume of the coating over that of its particle, f_r^3 - 1."""


class Composition(Sheet):
    """Amount of particles in the suspension, stated in one of four ways.

    Particles are always counted without their coating. Weight fractions include one for the
    coating. With `volume_fraction` and `concentration` the coating is part of the rest of the
    suspension. A `solids_ratio` is that of particles and fluid as weighed; the layer of [coating]
    adds its volume to them.
    """

    particle: float | None = Field(
        default=None, gt=0, lt=1, description="the weight fraction of particles, 0 to 1"
    )
    fluid: float | None = Field(
        default=None, gt=0, lt=1, description="the weight fraction of the fluid, 0 to 1"
    )
    coating: float = Field(
        default=0.0, ge=0, lt=1, description="the weight fraction of the coating, 0 to 1"
    )
    volume_fraction: float | None = Field(
        default=None, gt=0, lt=1, description="the volume fraction of particles, 0 to 1"
    )
    concentration: float | None = Field(
        default=None, gt=0, le=1e5, description="kg of particles per m^3 of suspension, above zero"
    )
    solids_ratio: float | None = Field(
        default=None, gt=0, le=1e6, description="kg of particles per kg of fluid, above zero"
    )

    @property
    def by_weight(self) -> bool:
        """True if weight fractions are stated."""
        return self.particle is not None

    @property
    def key(self) -> str:
        """The key that states the amount of particles."""
        return next(key for key in ("particle", *ALONE) if getattr(self, key) is not None)

    def changed(self, changes: dict[str, Any]) -> dict[str, Any]:
        """Returns the stated keys with some changed; another way replaces the earlier one."""
        if any(changes.get(key) is not None for key in ALONE):
            return changes
        if not self.by_weight and any(
            changes.get(key) is not None for key in ("particle", "fluid")
        ):
            return changes
        return super().changed(changes)

    def fraction(self, phases: Phases) -> float:
        """Returns the volume fraction of the uncoated particles; 1."""
        if self.volume_fraction is not None:
            return self.volume_fraction
        if self.concentration is not None:
            return self.concentration / phases.particle
        if self.solids_ratio is not None:
            solid = self.solids_ratio / phases.particle
            return solid / (solid * (1.0 + phases.layer) + 1.0 / phases.fluid)
        solid = (self.particle or 0.0) / phases.particle
        return solid / (solid + self._rest(phases))

    def stating(self, fraction: float, phases: Phases) -> float:
        """Returns the value of `key` for a volume fraction, with the rest in the same proportions.

        Args:
          fraction: volume fraction of the uncoated particles; 1.
          phases: densities of particle, fluid and coating.
        """
        if self.volume_fraction is not None:
            return fraction
        solid = fraction * phases.particle  # kg per m^3 of suspension
        if self.concentration is not None:
            return solid
        if self.solids_ratio is not None:
            return solid / (phases.fluid * (1.0 - fraction * (1.0 + phases.layer)))
        rest = self._rest(phases) / (1.0 - (self.particle or 0.0))
        return solid / (solid + (1.0 - fraction) / rest)

    def _rest(self, phases: Phases) -> float:
        """Returns the volume of fluid and coating in a kg of suspension, m^3."""
        coating = self.coating / phases.coating if phases.coating else 0.0
        return (self.fluid or 0.0) / phases.fluid + coating

    @model_validator(mode="after")
    def _stated_once(self) -> Self:
        alone = [key for key in ALONE if getattr(self, key) is not None]
        weights = [key for key in WEIGHTS if getattr(self, key)]
        if not alone and not weights:
            raise ValueError(f"composition: states no amount of particles; give one of {WAYS}")
        if len(alone) + bool(weights) > 1:
            keys = " and ".join(f"{key} = {getattr(self, key):g}" for key in [*weights, *alone])
            raise ValueError(f"composition.{keys}: stated in more than one way; keep one of {WAYS}")
        for key in ("particle", "fluid") if weights else ():
            if getattr(self, key) is None:
                remedy = type(self).model_fields[key].description
                raise ValueError(f"composition.{key} is missing; give {remedy}")
        return self

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.particle is None or self.fluid is None:
            return self
        total = self.particle + self.fluid + self.coating
        if abs(total - 1.0) > 1e-6:
            raise ValueError(
                f"particle + fluid + coating = {self.particle} + {self.fluid} + {self.coating} = "
                f"{total:.6g}; weight fractions must sum to 1"
            )
        return self
