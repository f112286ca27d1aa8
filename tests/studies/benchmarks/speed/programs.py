"""The programs whose compilation, time and memory are measured."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array

import mrjax
from mrjax.core.parameters import Parameters

from . import states

VELOCITY, RUN, EVERY_LAW, FORWARD, REVERSE, ALL = (
    "initial velocity",
    "settled bed",
    "settled bed, every law",
    "forward, f_w f_s f_v",
    "reverse, f_w f_s f_v",
    "reverse, every leaf",
)
OWN_RUN = {
    RUN: RUN,
    EVERY_LAW: EVERY_LAW,
    FORWARD: RUN,
    REVERSE: RUN,
    ALL: EVERY_LAW,
}
"""What is differentiated: the same function of the same argument, of a settled bed."""


def program(name: str, folder: Path, steps: int) -> tuple[Callable[[Any], Any], Any]:
    """A function, to be compiled unless it is that of the velocity, and its argument."""
    if name == VELOCITY:
        return _initial_velocity()
    own = states.in_oil()
    state, box = states.load(folder, states.IN_OIL)
    time_step, _ = states.curve(folder)

    def height(parameters: Parameters) -> Array:
        run = mrjax.simulate(
            state, parameters, box, duration=steps * time_step, time_step=time_step
        )
        return jnp.mean(run.heights[-1])

    def of_factors(factors: Array) -> Array:
        return height(own.replace(f_w=factors[0], f_s=factors[1], f_v=factors[2]))

    def with_value(factors: Array) -> tuple[Array, Array]:
        value = of_factors(factors)
        return value, value

    factors = jnp.stack([jnp.asarray(leaf, float) for leaf in (own.f_w, own.f_s, own.f_v)])
    if name in (EVERY_LAW, ALL):
        return height if name == EVERY_LAW else jax.value_and_grad(height), own.astype(float)
    wanted = {
        RUN: of_factors,
        FORWARD: jax.jacfwd(with_value, has_aux=True),
        REVERSE: jax.value_and_grad(of_factors),
    }
    return wanted[name], factors


def _initial_velocity() -> tuple[Callable[[Any], Any], Any]:
    """As a plain call, which leaves out the friction that nothing can feel yet."""
    sheet = states.recipe()
    own, state = sheet.parameters(), mrjax.disperse(sheet)

    def velocity(f_w: float) -> Array:
        run = mrjax.simulate(state, own.replace(f_w=f_w), sheet.box, duration=3e-7)
        return mrjax.settling_velocity(run)

    return velocity, float(own.f_w)
