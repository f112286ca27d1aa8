"""The result of a settling column: profiles of volume fraction, and heights read off them."""

from dataclasses import dataclass, field

import jax
from jax import Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Column:
    """A settling column at T times, in C cells from the floor to the initial height.

    Where a traced call was given too few steps, or what cannot be, every number but the times and
    `courant` is NaN.
    """

    times: Array
    """Times as given, (T,) in s."""
    mudline: Array
    """Height of the interface to the clear fluid, (T,) in m.

    What follows is of particles that sink; of those that rise it is the lower interface, in the
    mirror.

    Every cell counts with its share below the interface: all of it where the cell above is at least
    as dense as the suspension was, else its solid over what it would hold at the fraction of the
    cell below it, or at the initial one if that is more. So a front is read by its solid, not by a
    threshold: exactly, however many cells it is smeared over, while it is one from the uniform
    suspension, and at rest; to first order in between; continuous, with a slope but for kinks. It
    starts at the height, and rests on a rigid bed at height x volume_fraction / bed_fraction.
    """
    bed_front: Array
    """Height of the top of the bed, or of the bottom of one under the lid; (T,) in m.

    By its solid, too: the excess over the fraction that meets the bed
    (`kynch.bed_contact_fraction`). Less than a cell of suspension over it is none, and the front is
    the mudline; from there to two cells it is led over linearly. Exact under a uniform suspension;
    where a fan of concentrations hangs on the bed it lags by a cell or two. A compressible bed
    begins at its gel fraction.
    """
    sedimentation_ratio: Array
    """Share of the initial height that the suspension and its bed still fill; 1, (T,)."""
    volume_fraction: Array
    """Mean of every cell, (T, C); 1."""
    levels: Array
    """Heights of the middles of the cells, (C,) in m."""
    initial_height: Array
    """Height of the suspension at the start, m, ()."""
    courant: Array
    """Cells that the fastest front crosses in a step; 1, ()."""
    steps: int = field(metadata={"static": True})
    """Number of equal steps; each of the times adds one by cutting another."""
