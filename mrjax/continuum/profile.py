"""The result of a settling column: profiles of volume fraction, and the heights of fronts."""

from dataclasses import dataclass, field

import jax
from jax import Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Column:
    """A settling column at T times, in C cells from the floor to the initial height.

    If a traced call has too few steps or impossible arguments, every number except the times and
    `courant` is NaN.
    """

    times: Array
    """Output times, (T,) in s."""
    mudline: Array
    """Height of the interface to the clear fluid, (T,) in m.

    It is the sum of the filled part of every cell. A cell is full if the cell above is at least as
    dense as the initial suspension. Otherwise its filled part is its volume fraction over that of
    the cell below, or over the initial one if that is larger. A front is thus located by particle
    volume, not by a threshold. Its height is exact, over however many cells it is smeared, for a
    front from the uniform suspension and at rest; in between it is accurate to first order. It is
    continuous, and differentiable except at kinks. It starts at `initial_height`, and comes to rest
    on a rigid bed at height x volume_fraction / bed_fraction.

    With a compression it is the upper end of the material cells, accurate to second order.

    If the particles rise, it is the height of the lower interface.
    """
    bed_front: Array
    """Height of the top of the bed, (T,) in m; of its bottom, if it is under the lid.

    It is located by particle volume, too: by the excess over the volume fraction just above the bed
    (`kynch.bed_contact_fraction`). With less than one cell of suspension above the bed, the front
    is the mudline; from one cell to two cells the two are interpolated linearly. The height is
    exact under a uniform suspension. Under a fan of volume fractions it lags by a cell or two. A
    compressible bed begins at its gel fraction.
    """
    sedimentation_ratio: Array
    """Height of the mudline over the initial height; 1, (T,)."""
    volume_fraction: Array
    """Mean volume fraction of every cell; 1, (T, C)."""
    settling_velocity: Array
    """Velocity of the particles in the middle of every cell, positive downwards; m/s, (T, C).

    It is zero above the mudline and in a rigid bed.
    """
    solid_stress: Array
    """Effective solid stress in the middle of every cell; Pa, (T, C).

    It is the part of the net weight above that touching particles carry; the fluid carries the
    rest. At rest they carry all of it. A suspension that is no network carries no stress.
    """
    levels: Array
    """Heights of the middles of the cells, (C,) in m."""
    initial_height: Array
    """Height of the suspension at the start, m, ()."""
    courant: Array
    """Number of cells that the fastest front crosses in a step, with a compression in the first
    step; 1, ()."""
    steps: int = field(metadata={"static": True})
    """Number of steps. With a rigid bed they are equal, and each output time cuts one in two."""
