"""32 members in one compiled call against one, from a settled bed of case2 in oil."""

from collections.abc import Callable, Iterator
from pathlib import Path

import jax
import jax.numpy as jnp
from jax import Array, lax

import mrjax

from . import process, programs, states, timing
from .process import Process

MEMBERS, STEPS = 32, 2_000
SPREAD = 0.05
"""Of the members' f_w to either side."""
ONE = "one"


def ways(function: Callable[[Array], Array]) -> dict[str, Callable[[Array], Array]]:
    """Every way in which a function of one member becomes one of all; another is a line here."""
    return {
        "jax.vmap": jax.vmap(function),
        "lax.map": lambda members: lax.map(function, members),
        "mrjax.ensemble": lambda members: mrjax.ensemble(function, members),
    }


def measured(
    folder: Path, repetitions: int = 3, members: int = MEMBERS, steps: int = STEPS
) -> list[dict]:
    """A row for every number of cores and every way."""
    states.make(folder, states.IN_OIL)
    rows = []
    for cores in process.numbers_of_cores():
        given = {"folder": str(folder), "members": members, "steps": steps}
        with Process("ensemble", given, cores) as asked:
            asked.answer()
            found = [asked.again() for _ in range(repetitions)]
        alone = [one[ONE] for one in found]
        for way in (name for name in found[0] if name != ONE):
            together = [one[way] for one in found]
            rows.append(
                {
                    "cores": cores,
                    "way": way,
                    "members": members,
                    "steps": steps,
                    "one": timing.spread(alone),
                    "seconds": timing.spread(together),
                    "over_one": timing.ratios(together, alone),
                }
            )
    return rows


def here(folder: str, members: int, steps: int) -> Iterator[dict[str, float]]:
    """How long one takes, and all of them in each way, again and again."""
    jax.config.update("jax_num_cpu_devices", process.most_cores())
    function, factors = programs.program(programs.RUN, Path(folder), steps)
    scale = jnp.linspace(1.0 - SPREAD, 1.0 + SPREAD, members)
    every = jnp.tile(factors, (members, 1)).at[:, 0].multiply(scale)
    alone = jax.jit(function)
    together = {name: jax.jit(way) for name, way in ways(function).items()}
    jax.block_until_ready([alone(factors), *(way(every) for way in together.values())])
    yield {}
    while True:
        yield {
            ONE: timing.seconds(lambda: alone(factors)),
            **{name: timing.seconds(lambda way=way: way(every)) for name, way in together.items()},
        }


if __name__ == "__main__":
    process.serve(here)
