"""The composition of a suspension: four ways of stating it, and the volume fraction of each."""

from typing import Any, NamedTuple, Self

from pydantic import Field, model_validator

from mrjax.recipe.sheets import Sheet

WEIGHTS = ("particle", "fluid", "coating")
"""Keys of the weight fractions, which are one way together."""
ALONE = ("volume_fraction", "concentration", "solids_ratio")
"""Keys that are a way each."""
WAYS = (
    "weight fractions particle and fluid (and coating), volume_fraction, concentration (kg/m^3), "
    "or solids_ratio (kg of particles per kg of fluid)"
)
"""The ways, as messages list them."""


class Phases(NamedTuple):
    """Densities of what a suspension is made of, and how thick its coating is."""

    particle: float  # kg/m^3
    fluid: float  # kg/m^3
    coating: float | None  # kg/m^3; None without one
    layer: float  # volume of the coating over that of its particle, f_r^3 - 1


class Composition(Sheet):
    """Amount of particles in the suspension, stated in one way.

    Particles are without their coating in every way. Weight fractions say how much coating there
    is. In `volume_fraction` and `concentration` the coating is a part of the rest; a `solids_ratio`
    is of particles and fluid as weighed, to which the layer of [coating] adds its volume.
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
        """The key that states how much there is of the particles."""
        return next(key for key in ("particle", *ALONE) if getattr(self, key) is not None)

    def changed(self, changes: dict[str, Any]) -> dict[str, Any]:
        """The stated keys with some changed; another way takes the place of the one before."""
        if any(changes.get(key) is not None for key in ALONE):
            return changes
        if not self.by_weight and any(
            changes.get(key) is not None for key in ("particle", "fluid")
        ):
            return changes
        return super().changed(changes)

    def fraction(self, of: Phases) -> float:
        """Volume fraction of the uncoated particles; 1."""
        if self.volume_fraction is not None:
            return self.volume_fraction
        if self.concentration is not None:
            return self.concentration / of.particle
        if self.solids_ratio is not None:
            solid = self.solids_ratio / of.particle
            return solid / (solid * (1.0 + of.layer) + 1.0 / of.fluid)
        solid = (self.particle or 0.0) / of.particle
        return solid / (solid + self._rest(of))

    def stating(self, fraction: float, of: Phases) -> float:
        """Value of `key` that gives a volume fraction, with all else in the same proportions.

        Args:
          fraction: volume fraction of the uncoated particles; 1.
          of: what the suspension is made of.
        """
        if self.volume_fraction is not None:
            return fraction
        solid = fraction * of.particle  # kg per m^3 of suspension
        if self.concentration is not None:
            return solid
        if self.solids_ratio is not None:
            return solid / (of.fluid * (1.0 - fraction * (1.0 + of.layer)))
        rest = self._rest(of) / (1.0 - (self.particle or 0.0))
        return solid / (solid + (1.0 - fraction) / rest)

    def _rest(self, of: Phases) -> float:
        """Volume of fluid and coating in a kg of suspension, by weight fractions; m^3."""
        return (self.fluid or 0.0) / of.fluid + (self.coating / of.coating if of.coating else 0.0)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        alone = [key for key in ALONE if getattr(self, key) is not None]
        weights = [key for key in WEIGHTS if getattr(self, key)]
        if not alone and not weights:
            raise ValueError(f"composition: states no amount of particles; give one of {WAYS}")
        if len(alone) + bool(weights) > 1:
            found = " and ".join(f"{key} = {getattr(self, key):g}" for key in [*weights, *alone])
            raise ValueError(
                f"composition.{found}: stated in more than one way; keep one of {WAYS}"
            )
        for key in ("particle", "fluid") if weights else ():
            if getattr(self, key) is None:
                what = type(self).model_fields[key].description
                raise ValueError(f"composition.{key} is missing; give {what}")
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
