"""Bounds on the motion by random forces: of the neighbour list, and of the time step.

Random kicks displace a particle along an axis by a standard deviation of

    s(t) = (F t / gamma) tanh(alpha t / 2)^(1/2)

within a time t, for a random force F that is held for this time. For Brownian motion it is
(2 D t)^(1/2) where drag is fast, and (k T / m)^(1/2) t where it is slow; for a step of the
exponential leapfrog it is exact. A kick beyond `DEVIATIONS` times s(t) is not expected in any run.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.core.tracing import drop_tracers, evaluated_or_none
from mrjax.dem.forces import Force, Noise, noises
from mrjax.dem.noise import NUMBERS
from mrjax.laws import drag, particle, time_scales
from mrjax.laws.brownian import IMPACT
from mrjax.laws.hindrance import Hindrance

DEVIATIONS = 6.0
"""Largest expected displacement by kicks, in standard deviations; a larger one has a probability of
2e-9."""
LARGEST_KICK = 0.03
"""Largest expected displacement in a step, in radii: that of the overlap of softened contacts."""
RESOLVED = 1e-3
"""Time in which random velocities do not decay, in relaxation times."""
ITERATIONS = 16
"""Iterations that find a step; each brings it more than twice as close, in its logarithm."""


def spread(forces: Sequence[Noise], parameters: Parameters, time: ArrayLike) -> Array:
    """Standard deviation s(t) of the displacement of the fastest particle along an axis, m.

    Args:
      forces: random forces.
      parameters: parameters, in the units of the forces.
      time: t, s.
    """
    resistance, inertia = drag.coefficient(parameters), particle.inertia(parameters)
    ones = jnp.ones((NUMBERS, 1), jnp.result_type(inertia))
    square = sum(
        jnp.sum(jnp.asarray(force(parameters, ones, time).force) ** 2, axis=0) / 3.0
        for force in forces
    )
    dragged = resistance > 0.0
    gamma = jnp.where(dragged, resistance, 1.0)
    share = jnp.sqrt(jnp.tanh(0.5 * gamma / inertia * time)) / gamma
    return jnp.max(jnp.sqrt(square) * time * jnp.where(dragged, share, time / inertia))


@dataclass(frozen=True)
class RandomMotion:
    """Bounds on the motion by the random forces of a run; None where values are traced."""

    forces: tuple[Noise, ...]
    """Random forces in SI, at least one, without tracers."""
    parameters: Parameters
    """Parameters of the run, without tracers."""

    @staticmethod
    def of_run(
        forces: Sequence[Force], numbers: Parameters, hindrance: Hindrance | None
    ) -> "RandomMotion | None":
        """Returns the random motion of a run; None without random forces.

        With local drag it is that of a particle alone, which moves most.

        Args:
          forces: forces of the run, in SI.
          numbers: its parameters without tracers.
          hindrance: f_w against volume fraction; None without local drag.
        """
        random = noises(forces)
        if not random:
            return None
        if hindrance is not None:
            alone = evaluated_or_none(drop_tracers(hindrance), 0.0)
            numbers = numbers if alone is None else numbers.replace(f_w=alone)
        return RandomMotion(drop_tracers(random), numbers)

    def kick(self, time: float) -> float | None:
        """Largest expected displacement within a time, m."""
        deviation = evaluated_or_none(spread, self.forces, self.parameters, time)
        return None if deviation is None else DEVIATIONS * float(deviation)

    @property
    def speed(self) -> float | None:
        """Speed of an impact in random motion that the step resolves, m/s."""
        relaxation = evaluated_or_none(time_scales.relaxation_time, self.parameters)
        if relaxation is None:
            return None
        short = RESOLVED * float(np.min(np.where(np.isfinite(relaxation), relaxation, 1.0)))
        deviation = evaluated_or_none(spread, self.forces, self.parameters, short)
        return None if deviation is None else IMPACT * float(deviation) / short

    def longest_step(self, step: float, stable: Callable[[float], float | None]) -> float | None:
        """Longest step at which kicks neither make contacts unstable nor pass through them, s.

        A kick may press surfaces onto each other by its whole length, and a deeper contact is
        stiffer. No kick is longer than `LARGEST_KICK` of the least radius.

        Args:
          step: longest step without kicks, s.
          stable: longest stable step, s, of contacts with an overlap in m; None if traced.
        """
        radius = evaluated_or_none(particle.outer_radius, self.parameters)
        if radius is None:
            return None
        longest, largest = step, LARGEST_KICK * float(np.min(radius))
        for _ in range(ITERATIONS):
            kick = self.kick(step)
            limit = None if kick is None else stable(kick)
            if kick is None or limit is None:
                return None
            shorter = step * (largest / kick) ** 2 if kick > 0.0 else longest
            step = float(np.sqrt(step * min(longest, limit, shorter)))
        return step
