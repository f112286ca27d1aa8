"""A carrier with a yield stress: which particles move in it, and how fast.

Y = 2 pi tau_y R^2 / W                                    yield number; W is the net weight
Y < 0.143, tau_y < 0.0477 Delta rho g d                   a single sphere moves (Beris et al. 1985)
delta rho g phi D / 4 > tau_y                             a suspension slides as a plug in its tube
f = 1 + [(2.93 Bi^0.83)^p + (c Bi)^p]^(1/p)               drag over Stokes' (Blackery & Mitsoulis)

Bi = tau_y d / (mu v) is the Bingham number. The regression 1 + 2.93 Bi^0.83 has no threshold. It is
joined near Bi = 226, where both are equal, to c Bi with c = 1 / (6 * 0.143) = 1.166, the drag of a
sphere about to stop. With p = 16 the join is 4.4 % above both there.

The force balance W = 3 pi mu d v f(Bi) has one dimensionless number. With z = mu v / (mu v)_Stokes
and Bi = 6 Y / z it is

z + [(2.93 (6 Y)^0.83 z^0.17)^p + (Y / 0.143)^p]^(1/p) = 1,

which has one root between 0 and 1 if Y < 0.143, and z = 0 else.

Herschel & Bulkley's fluid, tau = tau_y + K rate^n, has the effective viscosity K rate^(n - 1). Its
rate around a sphere is taken as v / d, as in the Bingham number of Atapattu, Chhabra & Uhlherr
(1995). This leaves out the factor X(n) of power-law fluids, 1 for n = 1 and up to 1.46 below.

In a crowd the velocity is that of a single sphere over f_w (f_s and f_v likewise): an assumption,
for which no data were found. Ageing is tau_y(t) = tau_y + growth * t, of all fluid at rest or not.

Sources: A. N. Beris, J. A. Tsamopoulos, R. C. Armstrong & R. A. Brown, J. Fluid Mech. 158, 219
(1985); J. Blackery & E. Mitsoulis, J. Non-Newtonian Fluid Mech. 70, 59 (1997); D. D. Atapattu,
R. P. Chhabra & P. H. T. Uhlherr, J. Non-Newtonian Fluid Mech. 59, 245 (1995).
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import value_or_none
from mrjax.laws import drag, particle

LARGEST_YIELD_NUMBER = 0.143
"""Yield number at which a single sphere stops (Beris et al. 1985)."""
LARGE_BINGHAM_SLOPE = 1.0 / (6.0 * LARGEST_YIELD_NUMBER)
"""c, the drag factor over the Bingham number of a sphere that is about to stop; 1.166."""
REGRESSION = 2.93, 0.83
"""Coefficient and exponent of Blackery & Mitsoulis (1997)."""
SHARPNESS = 16.0
"""p, the sharpness of the join between the regression and its limit."""
BISECTIONS = 60
"""Halvings of the bracket of z, down to the rounding of double precision."""
FOREVER = 1e30
"""A time, s, by which an ageing carrier has stopped every particle."""
NODES = 32
"""Nodes of the quadrature over the age of a carrier."""


def is_newtonian(parameters: Parameters) -> bool:
    """True if the carrier has neither a yield stress nor a flow index, and does not age."""
    return (
        parameters.yield_stress is None
        and parameters.flow_index is None
        and parameters.yield_growth is None
    )


def yield_number(parameters: Parameters) -> Array:
    """Yield number Y = 2 pi tau_y R^2 / |W| of a coated particle; 1, () or (N,).

    A single sphere moves if Y < 0.143. Without a weight Y is infinite, or 0 without a yield stress.
    """
    stress = 0.0 if parameters.yield_stress is None else parameters.yield_stress
    held = stress * 2.0 * jnp.pi * particle.outer_radius(parameters) ** 2
    weight = jnp.abs(particle.net_weight(parameters))
    has_weight = weight > 0.0
    number = held / jnp.where(has_weight, weight, 1.0)
    return jnp.where(has_weight, number, jnp.where(held > 0.0, jnp.inf, 0.0))


def critical_yield_stress(parameters: Parameters) -> Array:
    """Yield stress 0.0477 Delta rho g d from which on a single particle stands still; Pa.

    The shape is () or (N,). The viscosity of the carrier has no effect on it.

    Example:
      >>> parameters = mrjax.Recipe.load("case2").parameters()
      >>> stress = mrjax.laws.yield_stress.critical_yield_stress(parameters)
      >>> print(f"{1000 * stress:.1f} mPa")
      12.2 mPa
    """
    weight = jnp.abs(particle.net_weight(parameters))
    area = 2.0 * jnp.pi * particle.outer_radius(parameters) ** 2
    return LARGEST_YIELD_NUMBER * weight / area


def plug_yield_stress(
    parameters: Parameters, volume_fraction: ArrayLike, tube_diameter: ArrayLike
) -> Array:
    """Yield stress Delta rho g phi D / 4 from which on the wall of a tube holds a suspension; Pa.

    Args:
      parameters: particles and fluid, one number each.
      volume_fraction: phi of the coated particles; 1.
      tube_diameter: D, m.
    """
    excess = particle.apparent_density(parameters) - parameters.fluid_density
    return jnp.abs(excess * parameters.gravity) * volume_fraction * tube_diameter / 4.0


def drag_factor(bingham_number: ArrayLike) -> Array:
    """Drag f on a sphere that moves in a Bingham fluid, over that of Stokes; 1.

    Args:
      bingham_number: Bi = tau_y d / (mu v), at least 0; 1.
    """
    coefficient, exponent = REGRESSION
    regression = coefficient * bingham_number**exponent
    return 1.0 + _joined(regression, LARGE_BINGHAM_SLOPE * bingham_number)


@jax.custom_jvp
def slowdown(number: Array) -> Array:
    """z, the velocity of a single sphere in a Bingham fluid over that without a yield stress; 1.

    It is 1 for Y = 0, and exactly 0 for Y >= 0.143. Its slope is infinite at Y = 0, where 0 is
    returned: a carrier without a yield stress has derivatives of its other parameters.

    Args:
      number: yield number Y, at least 0, of any shape.
    """
    moves = (number > 0.0) & (number < LARGEST_YIELD_NUMBER)
    safe = jnp.where(moves, number, 0.5 * LARGEST_YIELD_NUMBER)

    def halve(_: Array, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = bracket
        middle = 0.5 * (low + high)
        too_fast = middle + _joined(*_parts(safe, middle)) > 1.0
        return jnp.where(too_fast, low, middle), jnp.where(too_fast, middle, high)

    bracket = jnp.zeros_like(safe), jnp.ones_like(safe)
    low, high = lax.fori_loop(0, BISECTIONS, halve, bracket)
    still = jnp.where(jnp.isnan(number), number, jnp.where(number > 0.0, 0.0, 1.0))
    return jnp.where(moves, 0.5 * (low + high), still)


@slowdown.defjvp
def _slowdown_jvp(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """Derivative of the root by the implicit function theorem: dz/dY = -g_Y / g_z."""
    (number,), (tangent,) = primals, tangents
    root = slowdown(number)
    moves = (number > 0.0) & (number < LARGEST_YIELD_NUMBER)
    safe_number = jnp.where(moves, number, 0.5 * LARGEST_YIELD_NUMBER)
    safe_root = jnp.where(moves, root, 0.5)
    parts = _parts(safe_number, safe_root)
    total = _joined(*parts)
    share, limit_share = ((part / total) ** SHARPNESS for part in parts)
    exponent = REGRESSION[1]
    by_number = total / safe_number * (exponent * share + limit_share)
    by_root = 1.0 + total * (1.0 - exponent) * share / safe_root
    return root, jnp.where(moves, -by_number / by_root, 0.0) * tangent


def velocity_factor(parameters: Parameters) -> Array:
    """Terminal velocity over that in a Newtonian carrier of the same viscosity; 1, () or (N,).

    It is z of `slowdown` for a Bingham fluid, and z^(1/n) (v_1 / d)^((1 - n)/n) for Herschel &
    Bulkley's, with v_1 / d in 1/s: the velocity of a single particle at the viscosity of a rate of
    1/s, over its diameter.
    """
    return _factor(parameters, yield_number(parameters))


def effective_times(parameters: Parameters, times: ArrayLike) -> Array:
    """Times at which a carrier that does not age would have let particles fall as far; s, (T,).

    They are the integral of v(t) / v(0), with the mean velocity of all particles: the times
    themselves without ageing, and constant from the time at which the last particle stops.

    Args:
      parameters: particles and fluid, leaves () or (N,).
      times: times since the carrier was at its `yield_stress`, s, (T,).
    """
    times = jnp.asarray(times)
    growth = parameters.yield_growth
    if growth is None:
        return times
    start = 0.0 if parameters.yield_stress is None else parameters.yield_stress
    critical = jnp.max(critical_yield_stress(parameters))
    grows = growth > 0.0
    stop = jnp.maximum(critical - start, 0.0) / jnp.where(grows, growth, 1.0)
    end = jnp.where(grows, jnp.minimum(times, stop), times)
    # Nodes are denser at the start, where the drag of a small yield stress has an infinite slope.
    node, weight = (jnp.asarray(row, end.dtype) for row in _quadrature())
    age = end[:, None] * node[None]  # (T, NODES)
    aged = jax.vmap(jax.vmap(partial(_mean_velocity, parameters)))(start + growth * age)
    fresh = _mean_velocity(parameters, jnp.asarray(start, end.dtype))
    moves = fresh != 0.0
    fallen = end * (aged @ weight)
    return jnp.where(moves, fallen / jnp.where(moves, fresh, 1.0), times)


def refuse_particles(parameters: Parameters) -> None:
    """Refuses runs of particles in a carrier with a yield stress; zero or none passes.

    Raises:
      InputError: the carrier is not Newtonian, or this is not known.
    """
    for name, value in (
        ("yield_stress", 0.0),
        ("flow_index", 1.0),
        ("yield_growth", 0.0),
    ):
        leaf = getattr(parameters, name)
        known = None if leaf is None else value_or_none(leaf)
        if leaf is None or (known is not None and np.all(known == value)):
            continue
        raise InputError(
            f"{name} = {'a traced value' if known is None else known}: particles that touch are "
            "simulated in a Newtonian carrier only; use mrjax.column, or fit with the models "
            "column or closed-form"
        )


def _mean_velocity(parameters: Parameters, stress: Array) -> Array:
    """Mean terminal velocity at a yield stress, with f_w = 1; m/s, ()."""
    changed = parameters.replace(yield_stress=stress, f_w=1.0)
    alone = jnp.divide(particle.net_weight(changed), drag.coefficient(changed))
    return jnp.mean(alone * velocity_factor(changed))


def _factor(parameters: Parameters, number: Array) -> Array:
    root = slowdown(number)
    index = parameters.flow_index
    if index is None:
        return root
    alone = drag.coefficient(parameters.replace(f_w=1.0))
    diameter = 2.0 * particle.outer_radius(parameters)
    rate = jnp.abs(particle.net_weight(parameters)) / (alone * diameter)
    moves = (root > 0.0) & (rate > 0.0)
    root, rate = (jnp.where(moves, value, 1.0) for value in (root, rate))
    return jnp.where(moves, root ** (1.0 / index) * rate ** (1.0 / index - 1.0), 0.0)


def _parts(number: Array, root: Array) -> tuple[Array, Array]:
    """Both parts of z f(Bi) - z that `_joined` joins, at Bi = 6 Y / z."""
    coefficient, exponent = REGRESSION
    regression = coefficient * (6.0 * number) ** exponent * root ** (1.0 - exponent)
    return regression, jnp.broadcast_to(number / LARGEST_YIELD_NUMBER, root.shape)


def _joined(first: Array, second: Array) -> Array:
    """Smooth maximum (a^p + b^p)^(1/p) of two numbers of at least 0."""
    larger = jnp.maximum(first, second)
    scale = jnp.where(larger > 0.0, larger, 1.0)
    powers = (first / scale) ** SHARPNESS + (second / scale) ** SHARPNESS
    return larger * jnp.where(larger > 0.0, powers, 1.0) ** (1.0 / SHARPNESS)


def _quadrature() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of an integral from 0 to 1: Gauss & Legendre's in the square root."""
    node, weight = np.polynomial.legendre.leggauss(NODES)
    node = 0.5 * (node + 1.0)
    return node**2, weight * node
