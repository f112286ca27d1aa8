"""Time scales and stable steps (Son 2018, section 2.5; stability of the exponential leapfrog).

Every function takes `Parameters` and works in any coherent unit; times are in s for SI.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.parameters import Parameters
from mrjax.laws import drag, normal, particle, tangential

REFINEMENT = 20.0
"""h_t of Eq. 29. The paper's cases 2 and 3 come to 20.6 and 16.3."""


class Mode(NamedTuple):
    """omega^2 m of a way in which touching spheres swing, for a stiffness of one contact."""

    normal: float  # factor of K_n
    tangential: float  # factor of K_t, where spheres spin against their inertia, 0.4 m R^2
    overdamped: float  # factor of K_t, where they spin against drag, 4/3 of gamma R^2


CLOSE_PACKED = (Mode(8.0, 8.0, 8.0), Mode(0.0, 40.0, 12.0))
"""The fastest of the face-centred cubic lattice: planes that move apart, and equal spins."""

TOUCHING_PAIR = (Mode(2.0, 0.0, 0.0), Mode(0.0, 7.0, 3.5))
"""Two spheres that bounce, and two that slide."""


def rayleigh_time(parameters: Parameters) -> Array:
    """Eq. 26: t_c = pi R / (0.1631 nu + 0.8766) sqrt(rho / G), least over the particles; s, ().

    R and rho are those of the coated particle, G = E / 2(1 + nu) that of its surface.
    """
    shear_modulus = parameters.elastic_modulus / (2.0 * (1.0 + parameters.poisson_ratio))
    slowness = jnp.sqrt(particle.apparent_density(parameters) / shear_modulus)
    shape = 0.1631 * parameters.poisson_ratio + 0.8766
    return jnp.min(jnp.pi * particle.outer_radius(parameters) / shape * slowness)


def relaxation_time(parameters: Parameters) -> Array:
    """1/alpha of Eqs. 13 and 27: (m + m_a) / gamma; s, () or (N,). Infinite without drag.

    The paper prints alpha without the added mass of Eq. 12 and, for coated particles, with the
    density of the coating; the inertia is that of the coated particle with its added mass.
    """
    return jnp.divide(particle.inertia(parameters), drag.coefficient(parameters))


def rise_time(parameters: Parameters) -> Array:
    """Eq. 28: t_r = ln(100)/alpha, least over the particles; s, (). Infinite without drag.

    The paper prints (1/alpha) ln[1 - 0.99 alpha/beta]^-1; 99 % of the final velocity is reached
    when exp(-alpha t) = 0.01.
    """
    return jnp.log(100.0) * jnp.min(relaxation_time(parameters))


def time_step(parameters: Parameters, refinement: ArrayLike = REFINEMENT) -> Array:
    """Eq. 29: MIN(t_c, t_r) / h_t, which resolves every contact and the rise; s, ().

    Args:
      parameters: of particles, fluid and contact.
      refinement: h_t, the time refinement factor; 1.

    Example:
      >>> print(f"{mrjax.time_step(mrjax.Recipe.load('case2').parameters()):.2g} s")
      1e-10 s

    Raises:
      InputError: parameters that are something else.
    """
    checks.require_class(Parameters, parameters=parameters)
    return jnp.minimum(rayleigh_time(parameters), rise_time(parameters)) / refinement


def expected_overlap(parameters: Parameters, load: ArrayLike, speed: ArrayLike) -> Array:
    """Deepest overlap under a resting load, or from an impact if that is deeper; m, ().

    Args:
      load: force on one contact, at least 0, N.
      speed: of approach, m/s.
    """
    modulus, _, radius, mass = _pair(parameters)
    resting = (3.0 * load / (4.0 * modulus * jnp.sqrt(radius))) ** (2 / 3)
    impact = normal.impact_overlap(modulus, radius, mass, speed)
    return jnp.max(jnp.maximum(resting, impact))


def largest_stable_step(
    parameters: Parameters, overlap: ArrayLike, arrangement: tuple[Mode, ...] = CLOSE_PACKED
) -> Array:
    """Largest step at which contacts of this overlap stay stable, at any drag; s, ().

    A particle of mass m and drag coefficient gamma on a spring K with a dashpot c, whose force is
    taken from the velocity before the step, is stable while

        tanh(alpha dt / 2) (dt K + 2 c) / gamma < 2.

    The larger of (sqrt(c^2 + 4 m K) - c) / K, which is the leapfrog's limit without drag, and
    2 (gamma - c) / K, overdamped Euler's with much, satisfies it. K and c are those of one
    contact, normal and, with friction, tangential, weighted by the modes of the `arrangement`:
    particles that touch move and spin against each other. Rolling resistance is softer than
    friction and needs no limit of its own. Infinite where nothing overlaps.
    """
    modulus, shear_modulus, radius, mass = _pair(parameters)
    in_normal = normal.stiffness(modulus, radius, overlap)
    grips = jnp.any(_of_particles(parameters.friction) > 0.0)
    in_plane = jnp.where(grips, tangential.stiffness(shear_modulus, radius, overlap), 0.0)
    impact, shear = _dashpots(parameters, overlap)
    shear = jnp.where(grips, shear, 0.0)

    def limit(mode: Mode) -> Array:
        spring = mode.normal * in_normal + mode.tangential * in_plane
        dashpot = mode.normal * impact + mode.tangential * shear
        swings = spring > 0.0
        spring = jnp.where(swings, spring, 1.0)
        inertial = (jnp.sqrt(dashpot**2 + 4.0 * mass * spring) - dashpot) / spring
        spring = mode.normal * in_normal + mode.overdamped * in_plane
        dashpot = mode.normal * impact + mode.overdamped * shear
        spring = jnp.where(swings, spring, 1.0)
        overdamped = 2.0 * (drag.coefficient(parameters) - dashpot) / spring
        return jnp.min(jnp.where(swings, jnp.maximum(inertial, overdamped), jnp.inf))

    return jnp.min(jnp.stack([limit(mode) for mode in arrangement]))


def dashpots(parameters: Parameters, overlap: ArrayLike) -> Array:
    """The larger dashpot of a contact, normal or tangential, at an overlap in m; N s/m.

    An upper bound over all that a particle may touch, () or (N,).
    """
    return jnp.maximum(*_dashpots(parameters, overlap))


def _dashpots(parameters: Parameters, overlap: ArrayLike) -> tuple[Array, Array]:
    modulus, shear_modulus, radius, mass = _pair(parameters)
    damping = normal.damping_ratio(parameters.restitution)
    of_contact = (radius, mass, overlap)
    impact = (normal.damping_coefficient, modulus, *of_contact, parameters.dissipation, damping)
    shear = (
        tangential.damping_coefficient,
        shear_modulus,
        *of_contact,
        parameters.tangential_dissipation,
        damping,
    )
    return _largest(*impact), _largest(*shear)


def _largest(
    law: Callable,
    modulus: Array,
    radius: Array,
    mass: Array,
    overlap: ArrayLike,
    dissipation: Array,
    damping: Array,
) -> Array:
    """The largest dashpot of every particle, () or (N,), over a table of pairs."""
    shape = jnp.broadcast_shapes(*map(jnp.shape, (modulus, radius, mass)))
    of_particle = (jnp.reshape(leaf, (-1, 1)) for leaf in (modulus, radius, mass))
    of_pairs = (jnp.reshape(_of_particles(leaf), (1, -1)) for leaf in (dissipation, damping))
    return jnp.max(law(*of_particle, overlap, *of_pairs), axis=-1).reshape(shape)


def _of_particles(table: Array) -> Array:
    """A number, or the rows of a table that hold a particle: walls do not meet walls."""
    return table if jnp.ndim(table) == 0 else table[:-1]


def _pair(parameters: Parameters) -> tuple[Array, Array, Array, Array]:
    """Upper bounds on E*, G*, R* and m* of any contact: with a like particle or with the wall."""
    of_surface = (parameters.elastic_modulus, parameters.poisson_ratio)
    of_wall = (parameters.wall_elastic_modulus, parameters.wall_poisson_ratio)
    elastic, shear = (
        jnp.maximum(law(*of_surface, *of_surface), law(*of_surface, *of_wall))
        for law in (normal.effective_modulus, tangential.effective_shear_modulus)
    )
    return (elastic, shear, particle.outer_radius(parameters), particle.inertia(parameters))
