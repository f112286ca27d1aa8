"""Particles that many tests use."""

import numpy as np

import mrjax


def unit_spheres(**changes) -> mrjax.Parameters:
    """Of 1 m in radius and 1 kg, soft, without fluid and gravity; leaves as arrays."""
    leaves = dict(
        radius=1.0,
        particle_density=3 / (4 * np.pi),
        fluid_density=0.0,
        viscosity=0.0,
        gravity=0.0,
        elastic_modulus=1000.0,
        poisson_ratio=0.3,
    )
    return mrjax.Parameters(**{**leaves, **changes}).astype(float)
