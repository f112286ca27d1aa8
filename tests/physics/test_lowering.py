"""Whole runs and their gradients compile for GPUs and TPUs, without a call that only a CPU has."""

import jax
import jax.numpy as jnp
import pytest

import mrjax

BOX = mrjax.Box((6e-3, 6e-3, 6e-3))
BALLS = mrjax.Parameters(
    radius=1e-3,
    particle_density=2500.0,
    fluid_density=1000.0,
    viscosity=0.1,
    elastic_modulus=1e6,
    poisson_ratio=0.3,
    friction=0.3,
    rolling_friction=0.1,
    restitution=0.7,
).astype(float)
START = mrjax.place([[3e-3, 3e-3, 0.999e-3], [3e-3, 3.1e-3, 2.99e-3]], contact_diameter=2e-3)


def height(friction):
    run = mrjax.simulate(
        START,
        BALLS.replace(friction=friction),
        BOX,
        duration=1e-3,
        frames=2,
        time_step=1e-5,
        rebuild_every=10,
        hindrance=lambda fraction: (1.0 - fraction) ** -4.65,
    )
    return jnp.sum(run.heights[-1])


def pushed(friction):
    return jax.jvp(height, (friction,), (1.0,))


@pytest.mark.parametrize("function", [height, jax.grad(height), pushed], ids=["run", "grad", "jvp"])
def test_no_call_of_a_cpu(function):
    traced = jax.jit(lambda friction: function(friction)).trace(0.3)
    text = traced.lower(lowering_platforms=("cuda", "tpu")).as_text()
    assert "mrjax_" not in text and "lapack" not in text
    assert "mrjax_" in traced.lower(lowering_platforms=("cpu",)).as_text()
