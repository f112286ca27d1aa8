"""A settling column in one dimension: days of a tall tube, from the parameters of a simulation.

d phi/dt = d/dz f(phi),  f(phi) = phi v(phi)                                      (Kynch 1952)

z is measured from the floor towards the clear fluid, and both ends are closed. v is the terminal
velocity with the f_w of each volume fraction. The bed is rigid at phi_m or compressible
(`compression`). Particles lighter than the fluid settle towards the lid in the same way; z is then
measured down from the lid.

The numerical scheme is in `scheme`, and with compression in `consolidation`.
"""

import math

import jax.numpy as jnp
from jax.typing import ArrayLike

from mrjax.continuum import column_checks, rotor_checks, scheme, yielding
from mrjax.continuum.case import Case
from mrjax.continuum.compression import Compression
from mrjax.continuum.profile import Column as Column
from mrjax.continuum.rotor import Rotor
from mrjax.continuum.steps import MOST_STEPS, chosen_steps, fewest_steps
from mrjax.continuum.tilt import Tilt
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
    tilt: Tilt | None = None,
    rotor: Rotor | None = None,
    cells: int = 200,
    steps: int | None = None,
) -> Column:
    """Simulates the settling, or creaming, of a column of uniform suspension.

    The function is pure: it works under `jit`, `grad`, `jvp` and `vmap`, in the dtype of
    `parameters.radius`. Reverse mode with a rigid bed stores twice the square root of the number of
    steps, in profiles.

    Args:
      parameters: particles and fluid, one number each; contact properties have no effect.
      height: height of the suspension, m, ().
      volume_fraction: phi_0, initial volume fraction of the coated particles, such as
        `recipe.coated_volume_fraction`; 1, ().
      bed_fraction: phi_m, volume fraction of the packed coated particles; 1, ().
      times: output times, s, increasing, of any spacing, (T,).
      hindrance: f_w as a function of the volume fraction, such as `recipe.hindrance`. By default
        the f_w of the parameters holds at all volume fractions, and the mudline descends in a
        straight line until it meets the bed.
      compression: effective solid stress of the bed; by default the bed is rigid. With compression,
        phi_m is the volume fraction above which the bed yields no more. The scheme is then that of
        `consolidation`: rest heights are within 1e-4, with exact derivatives, and its cost does not
        depend on the last time.
      tilt: tilt and gap of the tube, in which the suspension settles faster; heights are then
        measured along the tube. By default the tube is upright.
      rotor: speed and radii of a tube in a centrifuge, whose bed is rigid. Heights are then those
        above the floor, towards the axis, and `gravity` has no effect.
      cells: number C of cells of equal height.
      steps: number of steps up to the last of the times, or up to the time at which a rigid bed has
        long been at rest; by default that of `column_steps`. With compression, steps grow after the
        suspension has settled, and traced calls need no number.

    Raises:
      InputError: an argument cannot be used, there are too few steps (in plain calls), or `steps`
        is missing in a traced call.

    Example:
      >>> recipe = mrjax.Recipe.load("case2")
      >>> tube = mrjax.column(
      ...     recipe.parameters(),
      ...     height=0.1,
      ...     volume_fraction=recipe.coated_volume_fraction,
      ...     bed_fraction=0.6,
      ...     times=[86400.0, 864000.0],
      ... )
      >>> (1000 * tube.mudline).round(1)  # 9.116 mm down in a day; at rest after ten days
      Array([90.9, 56.2], dtype=float64)
    """
    case = Case(
        parameters,
        height,
        volume_fraction,
        bed_fraction,
        times,
        hindrance,
        compression,
        tilt,
        rotor,
    )
    case, cells, fewest = _check(case, cells)
    steps = (
        chosen_steps(case, cells, fewest)
        if steps is None
        else checks.whole(steps, "steps", MOST_STEPS)
    )
    if fewest is not None and steps < fewest * (1.0 - 1e-6):
        fault = "a front would cross more than half a cell in a step"
        if compression is not None:
            fault = "too few for a yielding bed"
        raise InputError(
            f"steps = {steps}: {fault}; give at least {math.ceil(fewest)}, or leave steps out"
        )
    case = case.astype(jnp.asarray(parameters.radius).dtype)
    if case.compression is None:
        return scheme.solve(case, cells=cells, steps=steps)
    settled = yielding.solve(case, case.compression, cells=cells, steps=steps)
    column_checks.refuse_unsolved(settled.mudline, case)
    return settled


def column_steps(
    parameters: Parameters,
    *,
    height: ArrayLike,
    volume_fraction: ArrayLike,
    bed_fraction: ArrayLike,
    times: ArrayLike,
    hindrance: Hindrance | None = None,
    compression: Compression | None = None,
    tilt: Tilt | None = None,
    rotor: Rotor | None = None,
    cells: int = 200,
) -> int:
    """Returns a number of steps for `column`.

    With a rigid bed no front crosses more than half a cell in a step. The speed of the fronts is
    that of `kynch.fastest_front`. The number is rounded up to four binary digits, so that similar
    parameters share a compiled program. For traced parameters, as in a fit or a `vmap`, call it
    with all values that may occur, and take the largest number with a margin. With compression the
    number is twice that of the cells.

    Args:
      parameters: as for `column`.
      height: as for `column`.
      volume_fraction: as for `column`.
      bed_fraction: as for `column`.
      times: as for `column`.
      hindrance: as for `column`.
      compression: as for `column`.
      tilt: as for `column`.
      rotor: as for `column`.
      cells: as for `column`.

    Raises:
      InputError: an argument cannot be used, or is traced by jit or vmap.
    """
    case = Case(
        parameters,
        height,
        volume_fraction,
        bed_fraction,
        times,
        hindrance,
        compression,
        tilt,
        rotor,
    )
    case, cells, fewest = _check(case, cells)
    return chosen_steps(case, cells, fewest)


def _check(case: Case, cells: int) -> tuple[Case, int, float | None]:
    """Returns a checked case, its number of cells, and its least number of steps.

    The number of steps is None for traced values.

    Raises:
      InputError: an argument cannot be used.
    """
    case, cells = case.as_arrays(), checks.whole(cells, "cells", MOST_CELLS)
    column_checks.refuse(case)
    rotor_checks.refuse(case)
    return case, cells, fewest_steps(case, cells)
