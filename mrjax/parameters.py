"""The physical quantities every law reads: one pytree of SI values, any of which can be fitted.

A leaf is one number for all particles, shape (), or one number for each, shape (N,); what belongs
to a pair of surfaces is one number, or a table by material.
Nothing is validated here: the leaves are traced by jit, grad and vmap. `Recipe` validates.
"""

import dataclasses
import math
import sys
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from mrjax.units import Units


def _quantity(
    unit: str,
    mass: int = 0,
    length: int = 0,
    time: int = 0,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = sys.float_info.max,
    pair: bool = False,
    **keywords: Any,
) -> Any:
    """A leaf with its unit, its dimension in kg, m and s, and the values that have a meaning.

    `pair`: it belongs to two surfaces, not to one.
    """
    metadata = {"unit": unit, "dimension": (mass, length, time), "pair": pair}
    return field(metadata={**metadata, "above": above, "least": least, "most": most}, **keywords)


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Particles, fluid, coating, contact and drag factors of one suspension; shapes () or (N,).

    What belongs to two surfaces in contact (`friction`, `restitution`, `dissipation`,
    `tangential_dissipation`, `rolling_friction`, `rolling_damping`) is one number for all pairs,
    shape (), or a symmetric table by the materials of `State.material`, the walls last: shape
    (M + 1, M + 1) for M materials of particles.

    `elastic_modulus` and `poisson_ratio` belong to the surface in contact: to the coating where
    there is one (Son 2018, section 2.4). With no fluid in the way (`viscosity=0, gravity=0`) the
    same parameters describe a dry collision.
    """

    radius: ArrayLike = _quantity("m", length=1, above=0.0)
    """R, radius of the uncoated particle."""
    particle_density: ArrayLike = _quantity("kg/m^3", mass=1, length=-3, above=0.0)
    """rho_p, density of the uncoated particle."""
    fluid_density: ArrayLike = _quantity("kg/m^3", mass=1, length=-3, least=0.0)
    """rho_f."""
    viscosity: ArrayLike = _quantity("Pa s", mass=1, length=-1, time=-1, least=0.0)
    """mu of the base fluid, without additives."""
    elastic_modulus: ArrayLike = _quantity("Pa", mass=1, length=-1, time=-2, above=0.0)
    """E of the surfaces in contact."""
    poisson_ratio: ArrayLike = _quantity("1", above=-1.0, most=0.5)
    """nu of the surfaces in contact."""
    wall_elastic_modulus: ArrayLike = _quantity(
        "Pa", mass=1, length=-1, time=-2, default=jnp.inf, above=0.0, most=math.inf
    )
    """E of the walls; infinite for rigid ones."""
    wall_poisson_ratio: ArrayLike = _quantity("1", default=0.0, above=-1.0, most=0.5)
    """nu of the walls."""
    friction: ArrayLike = _quantity("1", default=0.0, least=0.0, pair=True)
    """mu, Coulomb's coefficient."""
    restitution: ArrayLike = _quantity("1", default=1.0, above=0.0, most=1.0, pair=True)
    """Rebound speed over impact speed of a dry normal impact, 0 < e <= 1."""
    dissipation: ArrayLike = _quantity("s", time=1, default=0.0, least=0.0, pair=True)
    """A of Eq. 4."""
    tangential_dissipation: ArrayLike = _quantity("s", time=1, default=0.0, least=0.0, pair=True)
    """B of Eq. 7."""
    rolling_friction: ArrayLike = _quantity("1", default=0.0, least=0.0, pair=True)
    """mu_r, largest torque against rolling over normal force and R*; 0 for perfect spheres."""
    rolling_damping: ArrayLike = _quantity("1", default=0.0, least=0.0, pair=True)
    """h_r, fraction of critical damping of rolling; without effect where mu_r = 0."""
    gravity: ArrayLike = _quantity("m/s^2", length=1, time=-2, default=9.81)
    """g, along -z."""
    added_mass: ArrayLike = _quantity("1", default=0.5, least=0.0)
    """Added mass over displaced fluid mass: 1/2 for a sphere (Eq. 11), 0 to leave it out."""
    coating_density: ArrayLike = _quantity("kg/m^3", mass=1, length=-3, default=0.0, least=0.0)
    """rho_c; without effect where f_r = 1."""
    f_w: ArrayLike = _quantity("1", default=1.0, above=0.0)
    """Wall and crowding factor of the drag (Eq. 14)."""
    f_s: ArrayLike = _quantity("1", default=1.0, above=0.0)
    """Shape factor of the drag (Eq. 16)."""
    f_v: ArrayLike = _quantity("1", default=1.0, above=0.0)
    """Viscosity of the fluid with additives over that of the base fluid."""
    f_r: ArrayLike = _quantity("1", default=1.0, above=0.0)
    """Coated radius over uncoated radius."""

    def replace(self, **changes: ArrayLike) -> "Parameters":
        """The same parameters with some leaves changed.

        Raises:
          TypeError: a name that is not a parameter.

        Example:
          >>> parameters = mrjax.Recipe.load("case2").parameters()
          >>> float(parameters.replace(f_w=1.0).f_w)
          1.0
        """
        return dataclasses.replace(self, **changes)

    def astype(self, dtype: DTypeLike) -> "Parameters":
        """Every leaf as an array of `dtype`."""
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), self)

    def reduced(self, units: Units) -> "Parameters":
        """Every leaf in the reduced units of a run."""
        return dataclasses.replace(
            self,
            **{
                quantity.name: getattr(self, quantity.name)
                * (1.0 / units.of(quantity.metadata["dimension"]))
                for quantity in dataclasses.fields(self)
            },
        )


def per_particle(leaf: Array, particles: int) -> Array:
    """A leaf as one value for each particle, shape (N,)."""
    return jnp.broadcast_to(leaf, (particles,))
