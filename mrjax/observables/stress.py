"""Stress that contacts carry: the mean over a box, and across horizontal planes.

    sigma_ab = (1/V) sum over contacts f_a l_b

is the mean stress of a packing at rest, with the force f on a particle and the branch l from its
partner's centre, or from the wall, to its own (Love 1927; Christoffersen, Mehrabadi & Nemat-Nasser,
J. Appl. Mech. 48, 1981). Compression is positive. All forces between two surfaces count: attraction
and friction, too, and pairs that attract each other across a gap.

Across a plane at height z the vertical stress is that of all contacts whose branch crosses it,

    sigma_zz(z) = (1/A) sum over crossing contacts |f_z|, signed,

which at rest is the net weight above z over the area, less what walls at the sides carry.
"""

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.errors import InputError
from mrjax.core.network import ContactNetwork


def stress_tensor(network: ContactNetwork) -> Array:
    """Mean contact stress of the box, (3, 3) in Pa; compression is positive.

    The first index is that of the force. In a box with walls, the forces on the walls count, too,
    and the mean is over the whole box. It can be differentiated.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.

    Example:
      >>> glass = mrjax.Recipe.load("case2").parameters().replace(elastic_modulus=1e5)
      >>> pair = mrjax.place([[5e-6, 5e-6, 3e-6], [5e-6, 5e-6, 6.9e-6]])
      >>> network = mrjax.contact_network(pair, glass, mrjax.Box((1e-5, 1e-5, 1e-5)))
      >>> stress = mrjax.stress_tensor(network)
      >>> bool(stress[2, 2] > 0.0), float(stress[0, 0])
      (True, 0.0)
    """
    return jnp.sum(network.force[:, :, None] * network.branch[:, None, :], axis=0) / network.volume


def vertical_stress(network: ContactNetwork, levels: ArrayLike) -> Array:
    """Contact stress sigma_zz across horizontal planes, (Z,) in Pa; compression is positive.

    Args:
      network: contact network of a state in a box with a floor.
      levels: heights of the planes, (Z,) in m.

    Raises:
      InputError: the box has no floor, or `levels` is not a row of heights.
    """
    if network.box.periodic[2]:
        raise InputError(
            "the box is periodic along z, where contacts cross a plane through their images, too: "
            "take stress_tensor, or Box(..., periodic=(..., ..., False))"
        )
    plane = jnp.asarray(levels, network.centre.dtype)
    if plane.ndim != 1:
        raise InputError(f"levels have shape {plane.shape}; give one row of heights, shape (Z,)")
    mine = network.centre[:, 2]
    theirs = mine - network.branch[:, 2]
    # Half of the difference of signs: 1 where the first is above the plane and its partner below.
    crossing = 0.5 * (
        jnp.sign(mine[None, :] - plane[:, None]) - jnp.sign(theirs[None, :] - plane[:, None])
    )
    area = network.box.size[0] * network.box.size[1]
    return jnp.sum(crossing * network.force[None, :, 2], axis=1) / area
