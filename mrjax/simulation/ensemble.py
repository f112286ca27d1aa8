"""Evaluates one function for many members, spread over all devices of all processes."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from mrjax.core.errors import InputError


def ensemble(function: Callable[[Any], Any], members: Any) -> Any:
    """Evaluates a function for every member, in one compiled call.

    Members are divided among the devices; each device takes its members one after another. Results
    do not depend on the number of members, nor on the processes to which the devices belong. They
    can be differentiated with respect to the members and to values that the function closes over.
    If `jax.distributed` is initialised, every process makes this call with the same members, and
    gets all results.

    A CPU is one device, unless `jax.config.update("jax_num_cpu_devices", cores)` comes before the
    first computation.

    Args:
      function: function of one member, such as a run with its parameters. It is traced, and
        compiled once for as long as it is the same object.
      members: a pytree of arrays with a leading axis (M, ...).

    Returns:
      The results of the function, each array with a leading axis (M, ...).

    Raises:
      InputError: arrays of the members differ in length, or there are no members.

    Example:
      >>> mrjax.ensemble(lambda member: member**2, jnp.arange(3.0))
      Array([0., 1., 4.], dtype=float64)
    """
    counts = {np.shape(leaf)[:1] for leaf in jax.tree.leaves(members)}
    if len(counts) != 1 or counts & {(), (0,)}:
        raise InputError("members must be arrays with one leading axis, of the same length, not 0")
    mesh = Mesh(np.array(jax.devices()), ("members",))
    return jax.tree.map(_at_hand, _everywhere(function, mesh, members))


@partial(jax.jit, static_argnames=("function", "mesh"))
def _everywhere(function: Callable, mesh: Mesh, members: Any) -> Any:
    """Evaluates all members in one compiled call; the results are on every device."""
    count = len(jax.tree.leaves(members)[0])
    missing = -count % mesh.size  # filled with copies of the last member

    def padded(leaf: Array) -> Array:
        return jnp.concatenate([leaf, jnp.repeat(leaf[-1:], missing, axis=0)])

    axis = PartitionSpec("members")
    results = jax.shard_map(
        partial(lax.map, function), mesh=mesh, in_specs=axis, out_specs=axis, check_vma=False
    )(jax.tree.map(padded, members))
    everywhere = NamedSharding(mesh, PartitionSpec())
    return jax.tree.map(
        lambda leaf: lax.with_sharding_constraint(leaf[:count], everywhere), results
    )


def _at_hand(leaf: Any) -> Any:
    """The copy on the first device of this process; a traced value stays as it is."""
    return leaf if isinstance(leaf, jax.core.Tracer) else leaf.addressable_data(0)
