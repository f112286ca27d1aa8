"""Time scales and stable steps (Son 2018, section 2.5; stability of the exponential leapfrog).

The functions take `Parameters` in any coherent system of units; with SI, times are in s.
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
"""h_t of Eq. 29. The steps of the paper's cases 2 and 3 give 20.6 and 16.3."""


class Mode(NamedTuple):
    """A mode of vibration of touching spheres: omega^2 m over the stiffness of one contact."""

    normal: float
    """Factor of the normal stiffness K_n."""
    tangential: float
    """Factor of the tangential stiffness K_t; the moment of inertia of a sphere is 0.4 m R^2."""
    overdamped: float
    """Factor of K_t without inertia; the rotational drag is 4/3 of gamma R^2."""


class ForceBounds(NamedTuple):
    """Upper bounds on the sum of all forces other than weight and contact."""

    stiffness: float = 0.0
    """Stiffness |dF/dh| of a pair, N/m."""
    pair_force: float = 0.0
    """Force of a pair, N."""
    acceleration: float = 0.0
    """Acceleration by body forces at the start, m/s^2."""


NO_OTHER_FORCES = ForceBounds()
"""Weight and contact alone."""

CLOSE_PACKED = (Mode(8.0, 8.0, 8.0), Mode(0.0, 40.0, 12.0))
"""The fastest modes of the face-centred cubic lattice: planes moving apart, and equal spins."""

TOUCHING_PAIR = (Mode(2.0, 0.0, 0.0), Mode(0.0, 7.0, 3.5))
"""The modes of two spheres: normal vibration, and sliding."""


def rayleigh_time(parameters: Parameters) -> Array:
    """Rayleigh time t_c = pi R / (0.1631 nu + 0.8766) sqrt(rho / G) (Eq. 26); s, ().

    It is the least over the particles. R and rho are those of the coated particle, and
    G = E / 2(1 + nu) is that of its surface.
    """
    shear_modulus = parameters.elastic_modulus / (2.0 * (1.0 + parameters.poisson_ratio))
    slowness = jnp.sqrt(particle.apparent_density(parameters) / shear_modulus)
    shape = 0.1631 * parameters.poisson_ratio + 0.8766
    return jnp.min(jnp.pi * particle.outer_radius(parameters) / shape * slowness)


def relaxation_time(parameters: Parameters) -> Array:
    """Relaxation time 1/alpha = (m + m_a) / gamma of Eqs. 13 and 27; s, () or (N,).

    It is infinite without drag. The paper prints alpha without the added mass of Eq. 12 and, for
    coated particles, with the density of the coating. Here the inertia is that of the coated
    particle with its added mass.
    """
    return jnp.divide(particle.inertia(parameters), drag.coefficient(parameters))


def rise_time(parameters: Parameters) -> Array:
    """Rise time t_r = ln(100)/alpha to 99 % of the terminal velocity (Eq. 28); s, ().

    It is the least over the particles, and infinite without drag. The paper prints
    (1/alpha) ln[1 - 0.99 alpha/beta]^-1; 99 % of the terminal velocity is reached when
    exp(-alpha t) = 0.01.
    """
    return jnp.log(100.0) * jnp.min(relaxation_time(parameters))


def time_step(parameters: Parameters, refinement: ArrayLike = REFINEMENT) -> Array:
    """Time step MIN(t_c, t_r) / h_t of Eq. 29, which resolves contacts and the rise; s, ().

    Args:
      parameters: particles, fluid and contact.
      refinement: h_t, the time refinement factor; 1.

    Example:
      >>> print(f"{mrjax.time_step(mrjax.Recipe.load('case2').parameters()):.2g} s")
      1e-10 s

    Raises:
      InputError: `parameters` is no `Parameters`.
    """
    checks.require_class(Parameters, parameters=parameters)
    return jnp.minimum(rayleigh_time(parameters), rise_time(parameters)) / refinement


def expected_overlap(parameters: Parameters, load: ArrayLike, speed: ArrayLike) -> Array:
    """Largest overlap under a static load or in an impact; m, ().

    Args:
      parameters: particles and contact.
      load: force on one contact, at least 0, N.
      speed: speed of approach, m/s.
    """
    modulus, _, radius, mass = _pair(parameters)
    resting = (3.0 * load / (4.0 * modulus * jnp.sqrt(radius))) ** (2 / 3)
    impact = normal.impact_overlap(modulus, radius, mass, speed)
    return jnp.max(jnp.maximum(resting, impact))


def largest_stable_step(
    parameters: Parameters,
    overlap: ArrayLike,
    arrangement: tuple[Mode, ...] = CLOSE_PACKED,
    stiffness: ArrayLike = 0.0,
) -> Array:
    """Largest step at which contacts with this overlap are stable, at any drag; s, ().

    A particle of mass m and drag coefficient gamma on a spring K with a dashpot c, whose force
    takes the velocity before the step, is stable while

        tanh(alpha dt / 2) (dt K + 2 c) / gamma < 2.

    Two steps satisfy it, and the larger one is returned: (sqrt(c^2 + 4 m K) - c) / K, the limit of
    the leapfrog without drag, and 2 (gamma - c) / K, the limit of Euler's method with much drag. K
    and c are those of one contact, normal and, with friction, tangential, weighted by the modes of
    the `arrangement`, in which touching particles move and spin against each other. Rolling
    resistance is softer than friction and needs no limit of its own. The step is infinite at zero
    overlap.

    Args:
      parameters: particles, fluid and contact.
      overlap: overlap of a contact, m.
      arrangement: modes of vibration of the touching particles.
      stiffness: of other forces along the normal, N/m.
    """
    modulus, shear_modulus, radius, mass = _pair(parameters)
    stiffness_n = normal.stiffness(modulus, radius, overlap) + stiffness
    frictional = jnp.any(_without_walls(parameters.friction) > 0.0)
    stiffness_t = jnp.where(frictional, tangential.stiffness(shear_modulus, radius, overlap), 0.0)
    dashpot_n, dashpot_t = _dashpots(parameters, overlap)
    dashpot_t = jnp.where(frictional, dashpot_t, 0.0)

    def limit(mode: Mode) -> Array:
        spring = mode.normal * stiffness_n + mode.tangential * stiffness_t
        dashpot = mode.normal * dashpot_n + mode.tangential * dashpot_t
        vibrates = spring > 0.0
        spring = jnp.where(vibrates, spring, 1.0)
        inertial = (jnp.sqrt(dashpot**2 + 4.0 * mass * spring) - dashpot) / spring
        spring = mode.normal * stiffness_n + mode.overdamped * stiffness_t
        dashpot = mode.normal * dashpot_n + mode.overdamped * dashpot_t
        spring = jnp.where(vibrates, spring, 1.0)
        overdamped = 2.0 * (drag.coefficient(parameters) - dashpot) / spring
        return jnp.min(jnp.where(vibrates, jnp.maximum(inertial, overdamped), jnp.inf))

    return jnp.min(jnp.stack([limit(mode) for mode in arrangement]))


def dashpots(parameters: Parameters, overlap: ArrayLike) -> Array:
    """Largest damping coefficient of a contact, normal or tangential; N s/m, () or (N,).

    It is an upper bound over all particles and walls that a particle may touch.

    Args:
      parameters: particles and contact.
      overlap: overlap of the contact, m.
    """
    return jnp.maximum(*_dashpots(parameters, overlap))


def _dashpots(parameters: Parameters, overlap: ArrayLike) -> tuple[Array, Array]:
    modulus, shear_modulus, radius, mass = _pair(parameters)
    damping = normal.damping_ratio(parameters.restitution)
    contact = (radius, mass, overlap)
    return (
        _largest(normal.damping_coefficient, modulus, *contact, parameters.dissipation, damping),
        _largest(
            tangential.damping_coefficient,
            shear_modulus,
            *contact,
            parameters.tangential_dissipation,
            damping,
        ),
    )


def _largest(
    law: Callable,
    modulus: Array,
    radius: Array,
    mass: Array,
    overlap: ArrayLike,
    dissipation: Array,
    damping: Array,
) -> Array:
    """Largest damping coefficient of each particle, () or (N,), over a table of pairs."""
    shape = jnp.broadcast_shapes(*map(jnp.shape, (modulus, radius, mass)))
    columns = (jnp.reshape(leaf, (-1, 1)) for leaf in (modulus, radius, mass))
    rows = (jnp.reshape(_without_walls(leaf), (1, -1)) for leaf in (dissipation, damping))
    return jnp.max(law(*columns, overlap, *rows), axis=-1).reshape(shape)


def _without_walls(table: Array) -> Array:
    """A number, or a table without the row of the walls, which do not touch each other."""
    return table if jnp.ndim(table) == 0 else table[:-1]


def _pair(parameters: Parameters) -> tuple[Array, Array, Array, Array]:
    """Upper bounds of E*, G*, R* and m* over contacts with a like particle and with a wall."""
    surface = (parameters.elastic_modulus, parameters.poisson_ratio)
    wall = (parameters.wall_elastic_modulus, parameters.wall_poisson_ratio)
    elastic, shear = (
        jnp.maximum(law(*surface, *surface), law(*surface, *wall))
        for law in (normal.effective_modulus, tangential.effective_shear_modulus)
    )
    return (elastic, shear, particle.outer_radius(parameters), particle.inertia(parameters))
