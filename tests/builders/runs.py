"""Runs put together by hand, for what reads them: nothing is simulated."""

from dataclasses import replace

import jax
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
        rising=jnp.zeros((), bool),
        time_step=0.1,
        steps=100,
    )
    return mrjax.Run(times=times, heights=heights, box=box, **{**given, **fields})


def straight_run(
    positions, velocities, box: mrjax.Box, times, *, spins=None, dtype: str = "float64", **fields
) -> mrjax.Run:
    """Particles that fly straight on from their positions, (N, 3), with a trajectory."""
    times, places, speeds = (np.asarray(one, float) for one in (times, positions, velocities))
    turning = np.zeros_like(places) if spins is None else np.asarray(spins, float)
    ways = places + times[:, None, None] * speeds
    count = len(times)
    trajectory = mrjax.Trajectory(ways, *(np.stack([one] * count) for one in (speeds, turning)))
    run = run_of(
        times,
        ways[..., 2],
        box,
        mean_velocity=jnp.full(count, -speeds[:, 2].mean()),
        mean_speed=jnp.full(count, np.linalg.norm(speeds, axis=1).mean()),
        trajectory=jax.tree.map(jnp.asarray, trajectory),
        **fields,
    )
    last = replace(run.state, position=ways[-1], velocity=speeds, spin=turning)
    run = replace(run, state=jax.tree.map(jnp.asarray, last))

    def narrow(leaf):
        return leaf.astype(dtype) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf

    return jax.tree.map(narrow, run)
