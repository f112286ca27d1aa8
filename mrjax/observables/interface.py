"""Observables of a run: velocities, heights by several definitions, sedimentation ratios.

Velocities are positive downwards. If the particles rise (`Run.rising`), the clear layer is at the
floor and the bed under the lid; heights are then those of the lower interface.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.run import Run, from_bed
from mrjax.core.tracing import value_or_none
from mrjax.observables.concentration import half_concentration, solid_below

RELAXATIONS_TO_STEADY = 20.0
"""Length of a run that gives the initial settling velocity to eight digits, in relaxation times.
The initial velocity has then decayed to e^-20 of its value."""


def settling_velocity(run: Run) -> Array:
    """Returns the initial settling velocity: the fastest mean velocity after the start; m/s, ().

    It is positive downwards, whereas velocities of a `State` are positive upwards. If the particles
    rise it is negative, and is the value of the greatest magnitude. Particles reach it after a few
    relaxation times (Eq. 27: 99 % after ln 100 = 4.6 of them) and keep it until the bed has grown
    to them. The run must have at least one frame within this period.

    Raises:
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    down, up = jnp.max(run.mean_velocity[1:]), jnp.min(run.mean_velocity[1:])
    return jnp.where(down >= -up, down, up)


def top(run: Run) -> Array:
    """Returns the mudline: the top of the highest particle; m, (frames + 1,).

    If the particles rise, it is the bottom of the lowest particle.

    Raises:
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    return run.mudline


def mean_of_top(run: Run, fraction: float = 0.05) -> Array:
    """Returns the mean of the tops of the highest particles; m, (frames + 1,).

    If the particles rise, it is the mean of the bottoms of the lowest particles.

    Args:
      run: run with at least one frame.
      fraction: fraction of the particles, rounded down to at least one particle; not traced.

    Raises:
      InputError: `fraction` is not in (0, 1].
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    fraction = checks.fraction(fraction, "fraction", allow_one=True)
    tops = from_bed(run, run.heights) + run.radius[None, :]
    highest, _ = lax.top_k(tops, max(1, int(fraction * run.radius.size)))
    return from_bed(run, jnp.mean(highest, axis=1))


def mass_quantile(run: Run, fraction: float = 0.95) -> Array:
    """Returns the level below which a fraction of the particle volume lies; m, (frames + 1,).

    If the particles rise, that fraction lies above the level. If all particles have one density, it
    is a quantile of the mass, too. In a uniform bed it is this fraction of the height of the bed.
    The level is exact. If a gap between particles makes the quantile ambiguous, the level is a
    point in the gap, with zero derivative.

    Args:
      run: run with at least one frame.
      fraction: fraction of the particle volume; not traced.

    Raises:
      InputError: `fraction` is not in (0, 1).
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    fraction = checks.fraction(fraction, "fraction")
    return from_bed(run, _mass_quantile(from_bed(run, run.heights), run.radius, fraction))


def twice_centre_of_mass(run: Run) -> Array:
    """Returns twice the height of the centre of volume of the particles; m, (frames + 1,).

    It is the top of a uniform bed. If all particles have one density, the centre of volume is the
    centre of mass. If the particles rise, heights are measured from the lid.

    Raises:
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    volume = run.radius**3
    return from_bed(run, 2.0 * (from_bed(run, run.heights) @ volume) / jnp.sum(volume))


HEIGHTS: dict[str, Callable[[Run], Array]] = {
    "top": top,
    "mean-of-top": mean_of_top,
    "mass-quantile": mass_quantile,
    "half-concentration": half_concentration,
    "twice-centre-of-mass": twice_centre_of_mass,
}
"""Definitions of the height of a suspension or its bed, by name; each gives (frames + 1,) in m."""


def sedimentation_ratio(run: Run, height: str = "top") -> Array:
    """Returns the height over the initial height of the suspension; 1, (frames + 1,).

    The suspension fills the box at the start. If the particles rise, the ratio is (H - height) / H,
    with the height H of the box.

    Args:
      run: run with at least one frame.
      height: name of a definition in `HEIGHTS`; by default the mudline.

    Raises:
      InputError: there is no such height.
      SimulationError: the run has a fault.

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> state = mrjax.disperse(recipe, seed=0)
      >>> run = mrjax.simulate(state, recipe.parameters(), recipe.box, duration=3e-7)
      >>> mrjax.sedimentation_ratio(run).round(1)  # nothing has settled yet
      Array([1., 1.], dtype=float64)
    """
    if not isinstance(height, str) or height not in HEIGHTS:
        raise InputError(f"height = {shown(height)} must be one of {', '.join(HEIGHTS)}")
    return from_bed(run, HEIGHTS[height](run)) / run.initial_height


def mudline_descent(run: Run) -> Array:
    """Returns the rate of descent of the mudline between successive frames; m/s, (frames,).

    It is negative if the particles rise.

    Raises:
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    return -jnp.diff(run.mudline) / jnp.diff(run.times)


class Asymptotes(NamedTuple):
    """The two straight lines of a sedimentation curve (Son 2018, Fig. 4)."""

    initial_slope: Array
    """Rate of descent of the initial asymptote, negative if the particles rise; m/s, ()."""
    final_ratio: Array
    """Sedimentation ratio at rest, the level of the final asymptote; 1, ()."""
    crossing_time: Array
    """Time at which the asymptotes cross; s, ()."""


def asymptotes(run: Run) -> Asymptotes:
    """Returns the initial and final asymptotes of the mudline h(t) of a run to rest.

    See Son (2018), Fig. 4. The initial asymptote is h(0) - s t. Its slope is fitted by least
    squares to the frames in which the mudline has descended at most a quarter of its whole descent,
    and at least to the first frame after the start. The final asymptote is the mudline of the last
    frame. If the particles rise, they are those of the lower interface. In a traced call the result
    is NaN if nothing has settled.

    Raises:
      InputError: nothing has settled in the run.
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    height = from_bed(run, run.mudline)
    descent = height[0] - height
    total = value_or_none(descent[-1])
    if total is not None and total == 0.0:
        raise InputError("the mudline has not moved: give a run in which something settles")
    early = lax.cummax(descent) <= 0.25 * descent[-1]
    time = jnp.where(early.at[1].set(True), run.times - run.times[0], 0.0)
    slope = jnp.sum(descent * time) / jnp.sum(time**2)
    return Asymptotes(
        jnp.where(run.rising, -slope, slope),
        height[-1] / run.initial_height,
        descent[-1] / slope,
    )


@jax.jit
def _mass_quantile(heights: Array, radius: Array, fraction: ArrayLike) -> Array:
    """Computes `mass_quantile` by bisection; its derivative is that of the implicit equation."""
    solid = fraction * jnp.sum(4.0 / 3.0 * jnp.pi * radius**3)

    @jax.checkpoint
    def quantile(heights: Array) -> Array:
        def excess(level: Array) -> Array:
            return solid_below(heights, radius, level[None])[0] - solid

        def bisection(excess: Callable, _: Array) -> Array:
            def halved(_, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
                low, high = bracket
                middle = 0.5 * (low + high)
                enough = excess(middle) > 0.0
                return jnp.where(enough, low, middle), jnp.where(enough, middle, high)

            ends = jnp.min(heights - radius), jnp.max(heights + radius)
            low, high = lax.fori_loop(0, 1 + jnp.finfo(heights.dtype).nmant, halved, ends)
            return 0.5 * (low + high)

        def divided_by_slope(line: Callable, value: Array) -> Array:
            slope = line(jnp.ones_like(value))  # area of the particles' cross-sections at the level
            return jnp.where(slope > 0.0, value / jnp.where(slope > 0.0, slope, 1.0), 0.0)

        start = jnp.zeros((), heights.dtype)
        return lax.custom_root(excess, start, bisection, divided_by_slope)

    return lax.map(quantile, heights)
