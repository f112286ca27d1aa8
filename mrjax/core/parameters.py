"""The physical quantities that the laws read: one pytree of SI values, any of which can be fitted.

A leaf is one number for all particles, shape (), or one number for each particle, shape (N,). A
property of a pair of surfaces is one number, or a table by material.
Nothing is validated here, because jit, grad and vmap trace the leaves. `Recipe` validates.
"""

import dataclasses
import inspect
import math
import sys
from dataclasses import dataclass, field
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike, DTypeLike

from mrjax.core.quantities import dimension, reduced
from mrjax.core.units import Units

T = TypeVar("T", bound=type)


def _quantity(
    unit: str,
    about: str,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = sys.float_info.max,
    pair: bool = False,
    wall: bool = False,
    contact: bool = False,
    optional: bool = False,
    vector: bool = False,
    **keywords: Any,
) -> Any:
    """Declares a leaf: its unit, from which its dimension follows, its description, and its bounds.

    `pair`: the leaf is a property of two surfaces, not of one. `wall`: it is a property of the
    walls, which are all alike. `contact`: only particles in contact use it; NaN if it is unknown.
    `optional`: None is a carrier without this property, and then no leaf of the tree.
    `vector`: the leaf has three components, x, y and z, shape (3,).
    """
    metadata = {
        "unit": unit,
        "about": about,
        "dimension": dimension(unit),
        "pair": pair,
        "wall": wall,
        "contact": contact,
        "optional": optional,
        "vector": vector,
    }
    return field(metadata={**metadata, "above": above, "least": least, "most": most}, **keywords)


def _document(kind: T) -> T:
    """Adds the description, the unit and the default of each leaf to the docstring."""

    def line(leaf: dataclasses.Field) -> str:
        default = "" if leaf.default is dataclasses.MISSING else f" Default {leaf.default}."
        if isinstance(leaf.default, float):
            default = f" Default {leaf.default:g}."
        return f"  {leaf.name}: [{leaf.metadata['unit']}] {leaf.metadata['about']}{default}"

    leaves = "\n".join(map(line, dataclasses.fields(kind)))
    kind.__doc__ = f"{inspect.cleandoc(kind.__doc__ or '')}\n\nArgs:\n{leaves}\n"
    return kind


@_document
@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Particles, fluid, coating, contact and drag factors of one suspension; shapes () or (N,).

    Properties of two surfaces in contact (`friction`, `restitution`, `dissipation`,
    `tangential_dissipation`, `rolling_friction`, `rolling_damping`) and of their attraction
    (`hamaker`, `attraction_range`) are one number for all pairs, shape (), or a symmetric table by
    the materials of `State.material`, the walls last: shape (M + 1, M + 1) for M materials of
    particles.

    `elastic_modulus` and `poisson_ratio` are those of the surface in contact: of the coating, if
    there is one (Son 2018, section 2.4). They are NaN if they are unknown; only particles in
    contact need them. Without a fluid (`viscosity=0, gravity=0`) the same parameters describe a
    dry collision. `yield_stress`, `flow_index` and `yield_growth` are None in a Newtonian fluid;
    only terminal velocities and columns use them. `hamaker` and `layer_thickness` are None without
    attraction, and `temperature` is None without Brownian motion. `remanence`, `field`,
    `susceptibility` and `saturation` are None without magnetism; `field` is one vector, shape (3,).
    """

    radius: ArrayLike = _quantity("m", "R, radius of the uncoated particle (Eq. 3).", above=0.0)
    particle_density: ArrayLike = _quantity(
        "kg/m^3",
        "rho_p, density of the uncoated particle (Eqs. 3, 20).",
        above=0.0,
    )
    fluid_density: ArrayLike = _quantity(
        "kg/m^3", "rho_f, density of the fluid (Eqs. 9, 11, 21, 23).", least=0.0
    )
    viscosity: ArrayLike = _quantity(
        "Pa s",
        "mu of the base fluid, without additives (Eqs. 10, 18, 24).",
        least=0.0,
    )
    elastic_modulus: ArrayLike = _quantity(
        "Pa",
        "E of the surfaces in contact (Eqs. 5, 8, 26).",
        above=0.0,
        contact=True,
    )
    poisson_ratio: ArrayLike = _quantity(
        "1", "nu of the surfaces in contact (Eqs. 5, 8, 26).", above=-1.0, most=0.5, contact=True
    )
    wall_elastic_modulus: ArrayLike = _quantity(
        "Pa",
        "E of the walls, infinite for rigid ones; one number (Eqs. 5, 8).",
        default=jnp.inf,
        above=0.0,
        most=math.inf,
        wall=True,
        contact=True,
    )
    wall_poisson_ratio: ArrayLike = _quantity(
        "1",
        "nu of the walls; one number (Eqs. 5, 8).",
        default=0.0,
        above=-1.0,
        most=0.5,
        wall=True,
        contact=True,
    )
    friction: ArrayLike = _quantity(
        "1",
        "mu, Coulomb's coefficient: |F_t| <= mu F_n (with Eq. 7).",
        default=0.0,
        least=0.0,
        pair=True,
    )
    restitution: ArrayLike = _quantity(
        "1",
        "e, rebound speed over impact speed of a dry normal impact, 0 < e <= 1: c(e) beside Eq. 4.",
        default=1.0,
        above=0.0,
        most=1.0,
        pair=True,
    )
    dissipation: ArrayLike = _quantity("s", "A of Eq. 4.", default=0.0, least=0.0, pair=True)
    tangential_dissipation: ArrayLike = _quantity(
        "s", "B of Eq. 7.", default=0.0, least=0.0, pair=True
    )
    rolling_friction: ArrayLike = _quantity(
        "1",
        "mu_r of |M_r| <= mu_r R* F_n (mrjax.laws.rolling); 0 for perfect spheres.",
        default=0.0,
        least=0.0,
        pair=True,
    )
    rolling_damping: ArrayLike = _quantity(
        "1",
        "h_r, fraction of critical damping of rolling (mrjax.laws.rolling); no effect if mu_r = 0.",
        default=0.0,
        least=0.0,
        pair=True,
    )
    gravity: ArrayLike = _quantity("m/s^2", "g, along -z (Eqs. 9, 22, 23).", default=9.81)
    added_mass: ArrayLike = _quantity(
        "1",
        "Added mass over displaced fluid mass: 1/2 for a sphere (Eqs. 11, 21), 0 without it.",
        default=0.5,
        least=0.0,
    )
    coating_density: ArrayLike = _quantity(
        "kg/m^3",
        "rho_c, density of the coating (Eq. 20); no effect if f_r = 1.",
        default=0.0,
        least=0.0,
    )
    f_w: ArrayLike = _quantity(
        "1", "Wall and crowding factor of the drag (Eqs. 14, 24).", default=1.0, above=0.0
    )
    f_s: ArrayLike = _quantity(
        "1", "Shape factor of the drag (Eqs. 16, 24).", default=1.0, above=0.0
    )
    f_v: ArrayLike = _quantity(
        "1",
        "Viscosity of the fluid with additives over that of the base fluid (Eq. 24).",
        default=1.0,
        above=0.0,
    )
    f_r: ArrayLike = _quantity(
        "1", "Coated radius over uncoated radius (Eqs. 20, 24).", default=1.0, above=0.0
    )

    hamaker: ArrayLike | None = _quantity(
        "J",
        "A, Hamaker constant of two surfaces across the fluid (mrjax.VanDerWaals).",
        default=None,
        least=0.0,
        pair=True,
        optional=True,
    )
    layer_thickness: ArrayLike | None = _quantity(
        "m",
        "Thickness of the layer on a particle; two of them make the steric gap h_0.",
        default=None,
        above=0.0,
        optional=True,
    )
    wall_layer_thickness: ArrayLike | None = _quantity(
        "m",
        "Thickness of the layer on the walls; None for that of the particles.",
        default=None,
        above=0.0,
        wall=True,
        optional=True,
    )
    attraction_range: ArrayLike | None = _quantity(
        "1",
        "Range of the attraction, in radii; None for h_0, 0 for contact only.",
        default=None,
        least=0.0,
        pair=True,
        optional=True,
    )

    temperature: ArrayLike | None = _quantity(
        "K",
        "T of the fluid (mrjax.Brownian); None without Brownian motion.",
        default=None,
        least=0.0,
        optional=True,
    )

    remanence: ArrayLike | None = _quantity(
        "A/m",
        "M_r, magnetisation of a particle without a field (mrjax.Dipoles).",
        default=None,
        least=0.0,
        optional=True,
    )
    field: ArrayLike | None = _quantity(
        "A/m",
        "H_0, uniform magnetic field, (3,).",
        default=None,
        optional=True,
        vector=True,
    )
    susceptibility: ArrayLike | None = _quantity(
        "1",
        "chi of the solid, by the field inside it; None if a field induces no moments.",
        default=None,
        least=0.0,
        optional=True,
    )
    saturation: ArrayLike | None = _quantity(
        "A/m",
        "M_s, largest magnetisation that a field induces; None for no limit.",
        default=None,
        above=0.0,
        optional=True,
    )

    yield_stress: ArrayLike | None = _quantity(
        "Pa",
        "tau_y of the fluid (mrjax.laws.yield_stress).",
        default=None,
        least=0.0,
        optional=True,
    )
    flow_index: ArrayLike | None = _quantity(
        "1",
        "n of a fluid of Herschel & Bulkley; `viscosity` is then its consistency in Pa s^n.",
        default=None,
        above=0.0,
        most=2.0,
        optional=True,
    )
    yield_growth: ArrayLike | None = _quantity(
        "Pa/s",
        "Growth of the yield stress with time.",
        default=None,
        least=0.0,
        optional=True,
    )

    def replace(self, **changes: ArrayLike | None) -> "Parameters":
        """Returns a copy of the parameters with some leaves changed.

        Raises:
          TypeError: a name is not a parameter.

        Example:
          >>> parameters = mrjax.Recipe.load("case2").parameters()
          >>> float(parameters.replace(f_w=1.0).f_w)
          1.0
        """
        return dataclasses.replace(self, **changes)

    def astype(self, dtype: DTypeLike) -> "Parameters":
        """Returns the parameters with every leaf as an array of `dtype`."""
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), self)

    def reduced(self, units: Units) -> "Parameters":
        """Returns the parameters in the reduced units of a run."""
        return reduced(self, units)


def per_particle(leaf: Array, particles: int) -> Array:
    """Broadcasts a leaf to one value for each particle, shape (N,)."""
    return jnp.broadcast_to(leaf, (particles,))
