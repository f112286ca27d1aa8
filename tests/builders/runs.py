"""Runs put together by hand, for what reads them: nothing is simulated."""

import jax.numpy as jnp
import numpy as np

import mrjax


def run_of(times, heights, box: mrjax.Box, **fields) -> mrjax.Run:
    """Particles of radius 1 at these times, (F,), and heights, (F, N); other fields as given."""
    times, heights = jnp.asarray(times, float), jnp.asarray(heights, float)
    count = heights.shape[1]
    last = jnp.stack([jnp.full(count, 0.5 * side) for side in box.size[:2]] + [heights[-1]], axis=1)
    nothing = jnp.zeros(())
    given = dict(
        radius=jnp.ones(count),
        mean_velocity=jnp.zeros(len(times)),
        mean_speed=jnp.zeros(len(times)),
        state=mrjax.place(np.asarray(last)),
        deepest_overlap=nothing,
        coating_overlap=nothing,
        fault=jnp.zeros((), jnp.int32),
        time_step=0.1,
        steps=100,
    )
    return mrjax.Run(times=times, heights=heights, box=box, **{**given, **fields})
