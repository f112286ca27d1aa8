"""A tilted tube, as a clock that runs faster: clear fluid forms along the whole upper wall.

dh/dt = -v (cos theta + (L / b) sin theta)     (Ponder 1925; Nakamura & Kuroda 1937)

h is measured along the tube, which leans by theta from the vertical and has the gap b between its
upper and its lower wall. L is the length of suspension along the upper wall, from the top of the
bed to the mudline. Clear fluid forms at v under every area that faces down, and collects at the
top.

The concentration of the suspension does not change, and all fronts are faster by the same factor.
The tilted column therefore passes through the states of the upright one, at the times tau(t) of

d tau / dt = cos theta + (L(tau) / b) sin theta,   t = INTEGRAL of d tau / (d tau / dt).

Between nodes the rate is linear in tau, so that both t(tau) and tau(t) are in closed form. They are
exact while mudline and bed move at constant speeds.
"""

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.continuum.mean_inverse import mean_inverse
from mrjax.laws.closed_forms import phi_1

EQUAL, LONGER = 32, 128
"""Intervals of the clock up to the first bend of a curve, and from there to rest."""
LARGEST_ANGLE = 90.0
"""Degrees below which a tilt must be."""
SHOWN = (1.0, 2.0, 5.0)
"""Angles of `warning`, degrees."""
NOTABLE = 0.1
"""Increase of the rate by one degree from which on `warning` warns."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True, kw_only=True)
class Tilt:
    """A tube that leans, in which suspensions settle faster (the effect of Boycott, 1920).

    The rate is that of Ponder (1925) and of Nakamura and Kuroda (1937). It is an upper limit, from
    kinematics alone. It holds where the flow is laminar and without waves, the layer of clear fluid
    under the upper wall is thin against the gap, and the sediment slides down the lower wall
    (Acrivos & Herbolzheimer 1979): in wide tubes of thin liquids, up to some 60 degrees. At a tilt
    of a few degrees sediment may stay on the lower wall.

    A bed carries its weight as in an upright tube. Along the tube it is less by cos theta: 0.4 % at
    5 degrees.
    """

    angle: ArrayLike
    """Angle theta between the tube and the vertical, degrees, (), from 0 to below 90."""
    gap: ArrayLike
    """Gap b between upper and lower wall, m, (): of a round tube of diameter D, pi D / 4, its
    section over its width."""

    def rate(self, length: ArrayLike) -> Array:
        """Rate of settling over that in an upright tube; 1, of the shape of the length.

        Args:
          length: L, length of the suspension along the tube, m.
        """
        angle = jnp.deg2rad(jnp.asarray(self.angle, float))
        return jnp.cos(angle) + jnp.asarray(length) / self.gap * jnp.sin(angle)


def gap_of_round_tube(diameter: float) -> float:
    """Returns the gap of a round tube: its section over its width; m.

    Args:
      diameter: inner diameter, m.
    """
    return math.pi / 4.0 * diameter


def clock_nodes(bend: Array, rest: Array, last: Array) -> Array:
    """Returns times of an upright column from 0 to the last, s, (EQUAL + LONGER + 2,).

    They are equidistant up to the bend, and from there on in a constant ratio up to rest.

    Args:
      bend: first time at which the curve bends, s, ().
      rest: time from which on it is level, at least that of the bend; s, ().
      last: last time, s, ().
    """
    equal = bend * jnp.arange(EQUAL + 1, dtype=bend.dtype) / EQUAL
    later = bend * (rest / bend) ** (jnp.arange(1, LONGER + 1, dtype=bend.dtype) / LONGER)
    return jnp.append(jnp.minimum(jnp.concatenate([equal, later]), last), last)


def clock_times(times: Array, tilt: Tilt, nodes: Array, lengths: Array) -> Array:
    """Returns the times at which the upright column has the same state; s, (T,).

    Args:
      times: times of the tilted column, s, (T,).
      tilt: tilt and gap of the tube.
      nodes: times of the upright column, s, (N,), from 0, not decreasing. After the last node the
        rate stays.
      lengths: L at these times, m, (N,).
    """
    rates = tilt.rate(lengths)
    low, high = rates[:-1], rates[1:]
    steps = jnp.diff(nodes)
    durations = steps * mean_inverse(low, high)
    starts = jnp.concatenate([jnp.zeros_like(durations[:1]), jnp.cumsum(durations)])
    number = jnp.searchsorted(starts, jax.lax.stop_gradient(times), side="right") - 1
    number = jnp.clip(number, 0, nodes.size - 1)
    some = steps > 0.0
    slopes = jnp.append((high - low) / jnp.where(some, steps, 1.0), 0.0)
    since = times - starts[number]
    return nodes[number] + rates[number] * since * phi_1(-slopes[number] * since)


def warning(height: float, gap: float) -> str | None:
    """Returns a warning of a tall, narrow tube, which settles much faster if it leans.

    Args:
      height: height of the suspension, m.
      gap: gap of the tube, m.
    """
    if float(Tilt(angle=1.0, gap=gap).rate(height)) < 1.0 + NOTABLE:
        return None
    faster = ", ".join(
        f"{100.0 * (float(Tilt(angle=angle, gap=gap).rate(height)) - 1.0):.0f} % at {angle:g}"
        for angle in SHOWN
    )
    return (
        f"the suspension is {height / gap:.2g} times as tall as the gap of its tube: a tilt makes "
        f"it settle faster, by {faster} degrees; keep the tube upright, or fit its tilt"
    )
