"""Gradients of the full curve of case2: an exact law, central differences, memory, and scaling.

Without inertia the suspension knows of time only t / (f_w f_s f_v mu): what a factor f does to a
height is what time does, dh / d ln f = -t dh/dt.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

import mrjax
from mrjax.recipe.recipe import Recipe
from mrjax.simulation.sedimentation import OVERLAP

FRAMES = 5
FALL, CREEP = 20.0, 60.0
"""Intervals of the frames, s: the mudline falls for about 130 s, the bed creeps for 700 more."""
STEP = 3.4e-3
"""s; as `settle` finds it."""
DIFFERENCES = (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
LENGTHS = (1_000, 10_000, 100_000)


def measured() -> dict:
    """All numbers of the page's part on gradients."""
    fall = Curve(FALL, STEP)
    height, slope, _ = fall.along(1.0)
    times = FALL * np.arange(1, FRAMES + 1)
    return {
        "times": times,
        "height": height,
        "law": off_the_law(fall),
        "law_finer": off_the_law(Curve(FALL, STEP / 4)),
        "law_without_friction": off_the_law(Curve(FALL, STEP, friction=0.0)),
        "late_times": CREEP * np.arange(1, FRAMES + 1),
        "late_law": off_the_law(Curve(CREEP, STEP)),
        "reverse": fall.reverse() / np.sum(slope) - 1,
        "differences": [{"by": by, "error": fall.difference(by) / slope - 1} for by in DIFFERENCES],
        "memory": [{"steps": steps, **memory(steps)} for steps in LENGTHS],
        "doubled": doubled(),
    }


def off_the_law(curve: "Curve") -> np.ndarray:
    """Relative difference of dh / d ln f from -t dh/dt, (FRAMES,)."""
    _, slope, rate = curve.along(1.0)
    return slope / (-curve.interval * np.arange(1, FRAMES + 1) * rate) - 1


class Curve:
    """The mudline of case2 at five times, as a function of the logarithm of f_w."""

    def __init__(self, interval: float, step: float, friction: float = 0.3):
        recipe = Recipe.load("case2")
        stiff = recipe.parameters().replace(friction=friction)
        self.interval = interval
        self.parameters = mrjax.softened(stiff, recipe.box, recipe.particle_count, OVERLAP)
        self.state = mrjax.disperse(recipe)
        self.follow = partial(mrjax.simulate, box=recipe.box, duration=interval, time_step=step)
        self.heights = jax.jit(self._heights)

    def _heights(self, log: Array) -> tuple[Array, Array]:
        """Of the mudline, m, and its velocity, m/s; (FRAMES,) each."""
        parameters = self.parameters.replace(f_w=self.parameters.f_w * jnp.exp(log))
        state, heights, rates = self.state, [], []
        for _ in range(FRAMES):
            run = self.follow(state, parameters)
            state = run.state
            highest = jnp.argmax(state.position[:, 2] + run.radius)
            heights.append(run.mudline[-1])
            rates.append(state.velocity[highest, 2])
        return jnp.stack(heights), jnp.stack(rates)

    def along(self, direction: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Heights, their derivatives and velocities, (FRAMES,) each."""
        (height, rate), (slope, _) = jax.jvp(self.heights, (0.0,), (direction,))
        return np.asarray(height), np.asarray(slope), np.asarray(rate)

    def reverse(self) -> float:
        """Derivative of the sum of the heights, in reverse mode."""
        return float(jax.jit(jax.grad(lambda log: jnp.sum(self._heights(log)[0])))(0.0))

    def difference(self, by: float) -> np.ndarray:
        """Central differences, (FRAMES,)."""
        up, down = (np.asarray(self.heights(sign * by)[0]) for sign in (1.0, -1.0))
        return (up - down) / (2 * by)


def memory(steps: int) -> dict:
    """Bytes that the compiled programs of a run and its two gradients hold at once."""
    curve = Curve(STEP * steps, STEP)

    def last(log: Array) -> Array:
        parameters = curve.parameters.replace(f_w=curve.parameters.f_w * jnp.exp(log))
        return curve.follow(curve.state, parameters).mudline[-1]

    programs = {
        "run": last,
        "forward": lambda log: jax.jvp(last, (log,), (1.0,)),
        "reverse": jax.grad(last),
    }
    return {
        name: jax.jit(program).lower(0.0).compile().memory_analysis().temp_size_in_bytes
        for name, program in programs.items()
    }


def doubled() -> dict:
    """Twice the viscosity against twice the time: largest differences at all frames."""
    recipe = Recipe.load("case2")
    fluid = recipe.fluid.model_copy(update={"viscosity": 2.0 * recipe.fluid.viscosity})
    thin, thick = (
        mrjax.sedimentation(sheet) for sheet in (recipe, recipe.model_copy(update={"fluid": fluid}))
    )
    assert len(thin.run.times[0]) == len(thick.run.times[0])
    return {
        "times": float(jnp.max(jnp.abs(thick.run.times[0, 1:] / thin.run.times[0, 1:] / 2 - 1))),
        "ratios": float(jnp.max(jnp.abs(thick.ratio() - thin.ratio()))),
        "frames": len(thin.run.times[0]) - 1,
    }
