"""Van der Waals attraction of two surfaces: DMT for hard ones, JKR for soft ones.

The law of Derjaguin, Muller and Toporov (DMT) is

    F = F_c s(h / eps) / (1 + h / eps)^2,    F_c = A R* / (6 h_0^2)

with gap h (zero in contact), pull-off force F_c, Hamaker constant A and steric gap h_0, the sum of
the layers on both surfaces. The force is a term F_W of Eq. 1, which the simulations of Son (2018)
leave out. The work of adhesion is w = A / (12 pi h_0^2), so that F_c = 2 pi w R*.

The range eps is h_0 by default, which gives Derjaguin's F = A R* / (6 (h + h_0)^2). Softened
contacts need a longer range, since the slope of the force limits the step. They keep F_c.

The factor s(x) = (1 - (x / 10)^4)^3 ends the force smoothly at a gap of ten ranges, where it would
be less than 1 % of F_c. The work of separation is 14 % less than F_c eps.

The law of Johnson, Kendall and Roberts (JKR) is, for a contact radius a and an overlap d,

    F = 4 E* a^3 / (3 R*) - sqrt(8 pi w E* a^3),    d = a^2 / R* - sqrt(2 pi a w / E*)

with F_c = 3/2 pi w R*. It acts from the first touch on, d = 0, until the surfaces are apart by
3/4 (pi^2 w^2 R* / E*^2)^(1/3), where a neck tears. It has no tail.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.laws import dimensionless, normal, particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.roots import finite_root

CUT_OFF = 10.0
"""Gap at which the force ends, in ranges."""
BARE_LAYER = 2e-10
"""Half of the closest gap between bare surfaces, m."""
SHARES = {"dmt": 1.0, "jkr": 0.75}
"""Pull-off force of each law over 2 pi w R*."""


def refuse_without_hamaker_constant(parameters: Parameters) -> None:
    """Refuses parameters without a Hamaker constant.

    Raises:
      InputError: there is none.
    """
    if parameters.hamaker is None:
        raise InputError("hamaker is missing, which attraction needs: give J, such as 1e-19")


def hamaker_constant(parameters: Parameters) -> Array:
    """Hamaker constants A, J; one number or a table by material.

    Raises:
      InputError: there is none.
    """
    refuse_without_hamaker_constant(parameters)
    return jnp.asarray(parameters.hamaker)


def layer_thickness(parameters: Parameters) -> Array:
    """Thickness of the layers on the particles, m; () or (N,)."""
    if parameters.layer_thickness is None:
        raise InputError(
            "layer_thickness is missing, which attraction needs: give m, "
            f"{BARE_LAYER:g} for a bare surface"
        )
    return jnp.asarray(parameters.layer_thickness)


def attraction(gap: ArrayLike, pull_off: ArrayLike, range_: ArrayLike) -> Array:
    """Attraction of two surfaces, N; elementwise. Its first two derivatives are finite.

    Args:
      gap: h, m; negative in contact.
      pull_off: F_c, N.
      range_: eps, m; 0 for an attraction in contact only.
    """
    far = range_ > 0.0
    gaps = jnp.maximum(gap, 0.0) / jnp.where(far, range_, 1.0)
    square = jnp.minimum(gaps / CUT_OFF, 1.0) ** 2
    left = 1.0 - square * square
    tail = left * left * left / ((1.0 + gaps) * (1.0 + gaps))
    return pull_off * jnp.where(far | (gap <= 0.0), tail, 0.0)


def jkr_force(
    overlap: ArrayLike, pull_off: ArrayLike, modulus: ArrayLike, radius: ArrayLike
) -> Array:
    """Normal force of a contact after JKR, N; positive if it repels; elementwise.

    The contact radius in units of its value at tear-off is the square of s, the root of
    s^4 - 4 s = 3 D not below 1, with the overlap D in units of the gap of tear-off.

    Args:
      overlap: d, m; not below that of tear-off, which is negative.
      pull_off: F_c, above 0, N.
      modulus: E* of Eq. 5, Pa.
      radius: R* of Eq. 6, m.
    """
    depth = jnp.asarray(overlap / tear_off_gap(pull_off, modulus, radius))
    # The slope is infinite at tear-off: end a few roundings before it.
    depth = jnp.maximum(depth, -1.0 + 8.0 * float(jnp.finfo(depth.dtype).eps))
    cubic = jnp.cbrt(1.0 + finite_root(1.0 + depth * depth * depth))
    ratio = depth / cubic
    resolvent = 2.0 / (cubic * cubic + depth + ratio * ratio)
    root = jnp.sqrt(2.0 * resolvent)
    size = 0.5 * (root + finite_root(8.0 / root - 2.0 * resolvent))
    cube = size * size * size
    return pull_off * cube * (cube - 6.0) / 9.0


def tear_off_gap(pull_off: ArrayLike, modulus: ArrayLike, radius: ArrayLike) -> Array:
    """Gap at which a contact after JKR tears, 3/4 (pi^2 w^2 R* / E*^2)^(1/3), m.

    Args:
      pull_off: F_c = 3/2 pi w R*, N.
      modulus: E* of Eq. 5, Pa.
      radius: R* of Eq. 6, m.
    """
    # The square of F_c / E* in SI is below the range of float32.
    ratio = pull_off / modulus / (radius * radius)
    return 0.75 * radius * jnp.cbrt(4.0 / 9.0 * ratio * ratio)


def attraction_in_contact(
    law: str, overlap: ArrayLike, pull_off: ArrayLike, modulus: ArrayLike, radius: ArrayLike
) -> ArrayLike:
    """Attraction of surfaces that touch: Hertz's force less the net force; N.

    Args:
      law: `dmt` or `jkr`.
      overlap: d, m.
      pull_off: F_c, N.
      modulus: E* of Eq. 5, Pa.
      radius: R* of Eq. 6, m.
    """
    if law == "dmt":
        return pull_off
    attracts = pull_off > 0.0
    net = jkr_force(overlap, jnp.where(attracts, pull_off, modulus * radius**2), modulus, radius)
    hertz = normal.normal_force(overlap, 0.0, modulus, radius, 1.0, damped=False)
    # The limit of a weak attraction, for the derivative by F_c at 0.
    weak = jnp.where(overlap > 0.0, 2.0 / 3.0 * pull_off, 0.0)
    return jnp.where(attracts, hertz - net, weak)


def pull_off(parameters: Parameters, surfaces: SurfacePairs, law: str = "dmt") -> Array:
    """Pull-off force F_c of pairs, N; (P,), or () if equal for all pairs.

    It is A R* / (6 h_0^2) = 2 pi w R* by DMT, and three quarters of it by JKR.

    Args:
      parameters: physical parameters, in any coherent system of units.
      surfaces: surfaces of the pairs.
      law: `dmt` or `jkr`.
    """
    hamaker = surfaces.by_material(hamaker_constant(parameters))
    gap = _steric_gap(parameters, surfaces)
    return SHARES[law] * dimensionless.pull_off(hamaker, surfaces.reduced_radius, gap)


def _steric_gap(parameters: Parameters, surfaces: SurfacePairs) -> Array:
    """Steric gap h_0 of pairs: the sum of the layers on both surfaces, m; (P,) or ()."""
    layer, wall = layer_thickness(parameters), parameters.wall_layer_thickness
    mine, theirs = surfaces.sides(layer, wall)
    if wall is None and surfaces.wall is not None and jnp.ndim(layer):
        theirs = jnp.where(surfaces.wall, mine, theirs)
    return mine + theirs


def attraction_range(parameters: Parameters, surfaces: SurfacePairs) -> Array:
    """Range eps of the force of pairs, m; (P,) or ().

    It is given in radii: in those of a particle at a wall, in 2 R* of two particles.
    """
    if parameters.attraction_range is None:
        return _steric_gap(parameters, surfaces)
    radius = 2.0 * surfaces.reduced_radius
    if surfaces.wall is not None:
        radius = jnp.where(surfaces.wall, 0.5 * radius, radius)
    return surfaces.by_material(parameters.attraction_range) * radius


def bond_number(parameters: Parameters) -> Array:
    """Granular Bond number: pull-off force of two equal particles over their net weight; 1.

    The shape is () or (N,). With several materials, the largest Hamaker constant counts. The number
    is infinite for particles as dense as the fluid.

    Args:
      parameters: physical parameters, with a Hamaker constant and a thickness of layers.

    Raises:
      InputError: the parameters have no Hamaker constant or no thickness of layers.

    Example:
      >>> coated = mrjax.Recipe.load("case2").parameters().replace(
      ...     hamaker=1e-19, layer_thickness=2e-9
      ... )
      >>> print(f"{mrjax.bond_number(coated):.2g}")
      4.9e+02
    """
    hamaker = hamaker_constant(parameters)
    largest = jnp.max(hamaker[:-1, :-1]) if hamaker.ndim else hamaker
    gap = 2.0 * layer_thickness(parameters)
    return dimensionless.granular_bond_number(parameters, largest, gap)


def largest_pull_off(parameters: Parameters, law: str = "dmt") -> tuple[Array, Array]:
    """Upper bounds on the pull-off forces of two particles, like or not, and at a wall; N, ().

    Args:
      parameters: physical parameters, in any coherent system of units.
      law: `dmt` or `jkr`.
    """
    hamaker, wall_layer = hamaker_constant(parameters), parameters.wall_layer_thickness
    table = hamaker if hamaker.ndim else jnp.broadcast_to(hamaker, (2, 2))
    radius = jnp.max(particle.outer_radius(parameters))
    layer = jnp.min(layer_thickness(parameters))
    gap_at_wall = layer + (layer if wall_layer is None else wall_layer)
    between = dimensionless.pull_off(jnp.max(table[:-1, :-1]), radius / 2.0, 2.0 * layer)
    at_wall = dimensionless.pull_off(jnp.max(table[:-1, -1]), radius, gap_at_wall)
    return SHARES[law] * between, SHARES[law] * at_wall
