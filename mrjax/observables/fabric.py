"""Contacts by direction: the fabric tensor, and the share of contacts along an axis.

    Phi_ab = (1/C) sum over contacts n_a n_b

with the unit normal n of each of C contacts (Satake 1982). Its trace is 1; an isotropic packing has
1/3 on the diagonal, chains along z have 1 in Phi_zz. Contacts with walls, whose direction is that
of the box, do not count.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.errors import InputError, shown
from mrjax.core.network import ContactNetwork


def fabric_tensor(network: ContactNetwork) -> Array:
    """Fabric tensor of the contacts of particles, (3, 3); 1. It is zero if nothing touches.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.
    """
    normal, weight = _normals(network)
    total = jnp.sum(weight[:, None, None] * normal[:, :, None] * normal[:, None, :], axis=0)
    return total / jnp.maximum(jnp.sum(weight), 1.0)


def share_along(network: ContactNetwork, axis: int = 2, angle: ArrayLike = 30.0) -> Array:
    """Share of the contacts whose normal is within an angle of an axis; 1, ().

    An isotropic packing has 1 - cos(angle), 0.134 for 30 degrees; chains along the axis have 1. The
    share is zero if nothing touches, and has no derivative.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.
      axis: 0, 1 or 2 for x, y or z.
      angle: degrees, ().

    Raises:
      InputError: `axis` is none of these.
    """
    if axis not in (0, 1, 2):
        raise InputError(f"axis = {shown(axis)}: give 0, 1 or 2 for x, y or z")
    normal, weight = _normals(network)
    near = jnp.abs(normal[:, axis]) >= jnp.cos(jnp.deg2rad(angle))
    return jnp.sum(jnp.where(near, weight, 0.0)) / jnp.maximum(jnp.sum(weight), 1.0)


def _normals(network: ContactNetwork) -> tuple[Array, Array]:
    """Unit normals, (P, 3), and 1 for contacts of particles, 0 for other places, (P,)."""
    weight = network.between_particles.astype(network.branch.dtype)
    square = jnp.sum(network.branch**2, axis=1)
    length = jnp.sqrt(jnp.where(square > 0.0, square, 1.0))
    return network.branch / length[:, None], weight
