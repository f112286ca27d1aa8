"""A settling column in one dimension: days of a tall tube, from the parameters of a simulation.

d phi/dt = d/dz f(phi),  f(phi) = phi v(phi)                                      (Kynch 1952)

with z from the floor towards the clear fluid, both ends closed, v the terminal velocity with the
f_w of each volume fraction, and a bed that is rigid at phi_m or compressible (`compression`).

Particles lighter than the fluid settle towards the lid in the same way: z then points down from it.

The numerical scheme is in `scheme`.
"""

import math

import jax.numpy as jnp
from jax.typing import ArrayLike

from mrjax.continuum import column_checks, scheme
from mrjax.continuum.case import Case
from mrjax.continuum.compression import Compression
from mrjax.continuum.profile import Column as Column
from mrjax.continuum.steps import MOST_STEPS, chosen_steps, fewest_steps
from mrjax.core import checks
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.laws.hindrance import Hindrance

MOST_CELLS = 10**6


def column(
    parameters: Parameters,
    *,
    height: ArrayLike,
    volume_fraction: ArrayLike,
    bed_fraction: ArrayLike,
    times: ArrayLike,
    hindrance: Hindrance | None = None,
    compression: Compression | None = None,
    cells: int = 200,
    steps: int | None = None,
) -> Column:
    """Lets a column of uniform suspension settle, or cream.

    Pure: works under `jit`, `grad`, `jvp` and `vmap`, in the dtype of `parameters.radius`. Reverse
    mode stores as many profiles as twice the square root of the number of steps.

    Args:
      parameters: of particles and fluid, one number each; what belongs to contacts has no effect.
      height: of the suspension, m, ().
      volume_fraction: phi_0 of the coated particles at the start, such as
        `recipe.coated_volume_fraction`; 1, ().
      bed_fraction: phi_m of the packed coated particles; 1, ().
      times: at which the column is looked at, by a step that ends there; s, increasing, of any
        spacing, (T,).
      hindrance: f_w for volume fractions, such as `recipe.hindrance`; left out, that of the
        parameters holds everywhere, and the mudline descends in a straight line until it meets the
        bed.
      compression: of the bed; left out, it is rigid. With it phi_m is a limit that nothing passes,
        in the last f dz/dt before which the bed's permeability falls to zero: that changes how fast
        it consolidates, not the end.
      cells: C, of equal height.
      steps: equal ones to the last of the times, or to the one from which a rigid bed has long been
        at rest; left out, `column_steps`.

    Raises:
      InputError: an argument that cannot be used, too few steps (plain calls), or a traced one
        from which steps would have to be chosen.

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> tube = mrjax.column(
      ...     recipe.parameters(),
      ...     height=0.1,
      ...     volume_fraction=recipe.coated_volume_fraction,
      ...     bed_fraction=0.6,
      ...     times=[86400.0, 864000.0],
      ... )
      >>> (1000 * tube.mudline).round(1)  # 9.116 mm in a day, and all in the bed after ten
      Array([90.9, 56.2], dtype=float64)
    """
    case = Case(parameters, height, volume_fraction, bed_fraction, times, hindrance, compression)
    case, cells, fewest = _accepted(case, cells)
    steps = chosen_steps(fewest) if steps is None else checks.whole(steps, "steps", MOST_STEPS)
    if fewest is not None and steps < fewest * (1.0 - 1e-6):
        raise InputError(
            f"steps = {steps}: a front would cross more than half a cell in a step; give at least "
            f"{math.ceil(fewest)}, or leave steps out"
        )
    return scheme.solve(case.astype(jnp.asarray(parameters.radius).dtype), cells=cells, steps=steps)


def column_steps(
    parameters: Parameters,
    *,
    height: ArrayLike,
    volume_fraction: ArrayLike,
    bed_fraction: ArrayLike,
    times: ArrayLike,
    hindrance: Hindrance | None = None,
    compression: Compression | None = None,
    cells: int = 200,
) -> int:
    """Steps for `column` of which none lets a front cross more than half a cell.

    The speed of fronts is that of `kynch.fastest_front`. Rounded up to four binary digits, so that
    neighbouring parameters share a compiled program. For parameters that are traced, those of a fit
    or of a `vmap`, take the most that any of them needs, and some more to be safe.

    Args:
      parameters, height, volume_fraction, bed_fraction: as for `column`.
      times, hindrance, compression, cells: as for `column`.

    Raises:
      InputError: an argument that cannot be used, or is traced by jit or vmap.
    """
    case = Case(parameters, height, volume_fraction, bed_fraction, times, hindrance, compression)
    _, _, fewest = _accepted(case, cells)
    return chosen_steps(fewest)


def _accepted(case: Case, cells: int) -> tuple[Case, int, float | None]:
    """A checked case, its cells, and the fewest steps that it takes, None for traced values.

    Raises:
      InputError: what describes no column.
    """
    case, cells = case.as_arrays(), checks.whole(cells, "cells", MOST_CELLS)
    column_checks.refuse(case)
    return case, cells, fewest_steps(case, cells)
