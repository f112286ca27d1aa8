"""Readings of a run: velocities, heights by several definitions, sedimentation ratios.

Velocities are positive downwards. Where particles rise (`Run.rising`) the clear layer is below and
the bed under the lid: all is then read in the mirror, and heights are those of the lower interface.
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
"""Length of a run that gives the initial settling velocity to eight digits, in relaxation times:
e^-20 of the start is left."""


def settling_velocity(run: Run) -> Array:
    """Initial settling velocity: the fastest mean descent of the frames after the start.

    Positive downwards, while velocities of a `State` point up. Negative where particles rise: the
    fastest is the one of the greatest magnitude. Particles reach it after a few relaxation times
    (Eq. 27: 99 % after ln 100 = 4.6 of them) and keep it until a bed has grown under them: at least
    one frame must lie in between, and a run that is shorter has no settling velocity yet. m/s, ().

    Raises:
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    down, up = jnp.max(run.mean_velocity[1:]), jnp.min(run.mean_velocity[1:])
    return jnp.where(down >= -up, down, up)


def top(run: Run) -> Array:
    """The mudline: top of the highest particle; m, (frames + 1,).

    Of particles that rise, bottom of the lowest.

    Raises:
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    return run.mudline


def mean_of_top(run: Run, fraction: float = 0.05) -> Array:
    """Mean of the tops of the highest particles; m, (frames + 1,).

    Of rising ones, of the bottoms of the lowest.

    Args:
      run: at least one frame.
      fraction: how many of the particles, rounded down to at least one; a number.

    Raises:
      InputError: a fraction not in (0, 1].
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    fraction = checks.fraction(fraction, "fraction", allow_one=True)
    tops = from_bed(run, run.heights) + run.radius[None, :]
    highest, _ = lax.top_k(tops, max(1, int(fraction * run.radius.size)))
    return from_bed(run, jnp.mean(highest, axis=1))


def mass_quantile(run: Run, fraction: float = 0.95) -> Array:
    """Level below which a fraction of the solid volume lies, exact; m, (frames + 1,).

    Above which, where particles rise. Of the mass, too, where all particles have one density.
    It lies below the top of a uniform bed by that fraction of its height. If a gap between
    particles makes the quantile ambiguous, a point of the gap, with zero derivative.

    Args:
      run: at least one frame.
      fraction: of the solid; a number.

    Raises:
      InputError: a fraction not in (0, 1).
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    fraction = checks.fraction(fraction, "fraction")
    return from_bed(run, _mass_quantile(from_bed(run, run.heights), run.radius, fraction))


def twice_centre_of_mass(run: Run) -> Array:
    """Twice the height of the solid's centre, which is the top of a uniform bed; m, (frames + 1,).

    As far from the lid where particles rise. Weighted by volume: the centre of mass, where all
    particles have one density.

    Raises:
      SimulationError: the run is not to be trusted.
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
"""Definitions of the height of a suspension or its bed, each (frames + 1,) in m."""


def sedimentation_ratio(run: Run, height: str = "top") -> Array:
    """Height over the initial height of the suspension, which filled the box; 1, (frames + 1,).

    Where particles rise, what lies above the lower interface, (H - height) / H of the box' H.

    Args:
      run: at least one frame.
      height: one of `HEIGHTS`; the mudline.

    Raises:
      InputError: there is no such height.
      SimulationError: the run is not to be trusted.

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
    """Rate of descent of the mudline from each frame to the next; m/s, (frames,).

    Negative where particles rise, and the lower interface with them.

    Raises:
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    return -jnp.diff(run.mudline) / jnp.diff(run.times)


class Asymptotes(NamedTuple):
    """The two straight lines of a sedimentation curve (Son 2018, Fig. 4)."""

    initial_slope: Array
    """Rate of descent of the first, negative where particles rise; m/s, ()."""
    final_ratio: Array
    """Sedimentation ratio at rest, the level of the second; 1, ()."""
    crossing_time: Array
    """When they meet, s, ()."""


def asymptotes(run: Run) -> Asymptotes:
    """Initial and final asymptotes of the mudline h(t), for a run to rest (Son 2018, Fig. 4).

    The first line is h(0) - s t, with the slope of least squares over the frames before the mudline
    has descended more than a quarter of its whole way (the first frame after the start in any
    case); the second is the mudline of the last frame. Where particles rise the same of the lower
    interface. Undefined where nothing has settled: not a number in a traced call.

    Raises:
      InputError: a run in which nothing has settled.
      SimulationError: the run is not to be trusted.
    """
    checks.require_good_run(run)
    filled = from_bed(run, run.mudline)
    descent = filled[0] - filled
    whole = value_or_none(descent[-1])
    if whole is not None and whole == 0.0:
        raise InputError("the mudline has not moved: give a run in which something settles")
    early = lax.cummax(descent) <= 0.25 * descent[-1]
    time = jnp.where(early.at[1].set(True), run.times - run.times[0], 0.0)
    slope = jnp.sum(descent * time) / jnp.sum(time**2)
    return Asymptotes(
        jnp.where(run.rising, -slope, slope),
        filled[-1] / run.initial_height,
        descent[-1] / slope,
    )


@jax.jit
def _mass_quantile(heights: Array, radius: Array, fraction: ArrayLike) -> Array:
    """`mass_quantile` by bisection, with the derivative of the implicit equation."""
    solid = fraction * jnp.sum(4.0 / 3.0 * jnp.pi * radius**3)

    @jax.checkpoint
    def one_frame(heights: Array) -> Array:
        def missing(level: Array) -> Array:
            return solid_below(heights, radius, level[None])[0] - solid

        def bisection(missing: Callable, _: Array) -> Array:
            def halved(_, bracket: tuple[Array, Array]) -> tuple[Array, Array]:
                low, high = bracket
                middle = 0.5 * (low + high)
                enough = missing(middle) > 0.0
                return jnp.where(enough, low, middle), jnp.where(enough, middle, high)

            ends = jnp.min(heights - radius), jnp.max(heights + radius)
            low, high = lax.fori_loop(0, 1 + jnp.finfo(heights.dtype).nmant, halved, ends)
            return 0.5 * (low + high)

        def divided_by_slope(line: Callable, value: Array) -> Array:
            slope = line(jnp.ones_like(value))  # the area that the level cuts through particles
            return jnp.where(slope > 0.0, value / jnp.where(slope > 0.0, slope, 1.0), 0.0)

        start = jnp.zeros((), heights.dtype)
        return lax.custom_root(missing, start, bisection, divided_by_slope)

    return lax.map(one_frame, heights)
