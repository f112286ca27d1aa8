"""Loose or dense: the bed of a run at rest, against the limits of random packings.

| packing of equal spheres | volume fraction | coordination |
| --- | --- | --- |
| loosest, strong adhesion | 1/8; 0.135 +- 0.007 | 2; 2.11 +- 0.03 |
| loosest that friction alone holds | 0.536 | 4 |
| densest random | 0.634; 0.639 +- 0.004 | 6; 6.40 +- 0.06 |

The first values are those of theory (Liu, Li, Baule & Makse, Soft Matter 11, 2015; Song, Wang &
Makse, Nature 453, 2008, with phi = Z / (Z + 2 sqrt(3)) without adhesion), the second those of
simulations with adhesion (Liu, Jin, Chen, Makse & Li, Soft Matter 13, 2017, arXiv 1604.05150).
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.core import checks
from mrjax.core.errors import InputError
from mrjax.core.network import ContactNetwork
from mrjax.core.run import Run, from_bed
from mrjax.observables.concentration import solid_below
from mrjax.observables.coordination import coordination

ADHESIVE = 1.0 / 8.0
"""Volume fraction of the loosest packing, of spheres that stick to each other."""
FRICTIONAL = 0.536
"""Volume fraction of the loosest packing that friction alone holds."""
DENSE = 0.634
"""Volume fraction of the densest random packing."""
BULK = 0.6
"""Height of the upper end of the bulk of a bed, over that of its highest particle."""


class BedPacking(NamedTuple):
    """How loose the bed of a run is."""

    volume_fraction: Array
    """Volume fraction of the bulk of the bed; 1, ()."""
    coordination: Array
    """Mean number of particles that a particle touches; 1, ()."""
    openness: Array
    """(0.634 - phi) / (0.634 - 1/8): 0 for the densest random packing, 1 for the loosest; ()."""

    @property
    def name(self) -> str:
        """`loose`, `random loose` or `dense`, by the volume fraction."""
        return name(float(self.volume_fraction))


def name(volume_fraction: float) -> str:
    """Returns `loose`, `random loose` or `dense`.

    A loose bed is looser than any that friction alone holds: attraction or rolling resistance
    holds it, or walls at the sides. A dense one is nearer to the densest random packing than to
    that limit.

    Args:
      volume_fraction: volume fraction of the bulk of a bed; 1.
    """
    if volume_fraction < FRICTIONAL:
        return "loose"
    return "random loose" if volume_fraction < 0.5 * (FRICTIONAL + DENSE) else "dense"


def bed_packing(run: Run, network: ContactNetwork) -> BedPacking:
    """Volume fraction, coordination and openness of the bed at the end of a run.

    The bulk is between one largest diameter above the floor and 0.6 of the height of the highest
    particle. Walls at the sides make a bed looser beside them: a box of six diameters lowers the
    volume fraction by some 0.05. The volume fraction has a derivative.

    Args:
      run: run in a box with a floor, at rest at its end.
      network: contact network of its last state, from `mrjax.contact_network`.

    Raises:
      InputError: the box has no floor, or the network is of other particles.
      SimulationError: the run has a fault.
    """
    checks.require_good_run(run)
    if run.box.periodic[2]:
        raise InputError("the box is periodic along z, where nothing settles into a bed")
    if network.particles != run.radius.shape[-1]:
        raise InputError(
            f"the network has {network.particles} particles, and the run {run.radius.shape[-1]}: "
            "give contact_network(run.state, ...)"
        )
    heights = from_bed(run, run.heights)[-1]
    top = jnp.max(heights + run.radius)
    low = jnp.minimum(2.0 * jnp.max(run.radius), 0.5 * BULK * top)
    ends = jnp.stack([low, BULK * top])
    solid = solid_below(heights, run.radius, ends)
    fraction = (solid[1] - solid[0]) / ((ends[1] - ends[0]) * np.prod(run.box.size[:2]))
    return BedPacking(fraction, coordination(network).mean, (DENSE - fraction) / (DENSE - ADHESIVE))
