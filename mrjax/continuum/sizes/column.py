"""A settling column of several classes of particles, which differ in size and density.

d phi_i/dt = d/dz f_i(phi_1, ..., phi_K)

z is measured from the floor towards the clear fluid, and both ends are closed. The fluxes f_i are
those of Masliyah, Lockett and Bassoon (`masliyah`), with any closure of f_w. The bed is rigid at
phi_m. The numerical scheme is in `scheme`.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jax import Array, lax
from jax.typing import ArrayLike

from mrjax.continuum.case import Case
from mrjax.continuum.sizes import class_checks, masliyah, profile, scheme
from mrjax.continuum.sizes.profile import PolydisperseColumn as PolydisperseColumn
from mrjax.continuum.tilt import Tilt, clock_nodes, clock_times
from mrjax.core import checks
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import value_or_none
from mrjax.laws.hindrance import Hindrance

MOST_CELLS = 10**5
MOST_STEPS = 10**8


def polydisperse_column(
    parameters: Parameters,
    *,
    height: ArrayLike,
    volume_fraction: ArrayLike,
    bed_fraction: ArrayLike,
    times: ArrayLike,
    hindrance: Hindrance | None = None,
    threshold: ArrayLike = 0.5,
    tilt: Tilt | None = None,
    cells: int = 200,
    steps: int | None = None,
) -> PolydisperseColumn:
    """Simulates the settling, or creaming, of a uniform suspension of several classes of particles.

    The function is pure: it works under `jit`, `jvp` and `vmap`, in the dtype of
    `parameters.radius`, and takes as many steps as it needs. Reverse mode (`grad`) needs a given
    number of steps; it stores twice its square root, in profiles.

    Args:
      parameters: particles and fluid, such as those of `recipe.size_classes`; each leaf is one
        number, or one for each of K classes. Contact properties have no effect.
      height: height of the suspension, m, ().
      volume_fraction: initial volume fraction of the coated particles of each class; 1, (K,).
      bed_fraction: phi_m, volume fraction of the packed coated particles of all classes; 1, ().
      times: output times, s, increasing, of any spacing, (T,); a step ends at each of them.
      hindrance: f_w as a function of the total volume fraction, such as `recipe.hindrance`; it must
        not fall with the volume fraction. By default the f_w of the parameters holds at all volume
        fractions.
      threshold: share of the initial total volume fraction that the suspension below the mudline
        exceeds; the eye sees 0.5, an optical instrument 0.01; 1, ().
      tilt: tilt and gap of the tube, as for `column`.
      cells: number C of cells of equal height.
      steps: largest number of steps, which reverse mode needs; `steps` of a result without it, with
        a margin. By default the number follows from the speeds.

    Raises:
      InputError: an argument cannot be used, or there are too few steps (in plain calls).

    Example:
      >>> recipe = mrjax.Recipe.load("case2").replace(
      ...     particle={"diameter": {"d10": 2.6e-6, "d50": 4e-6, "d90": 6.2e-6}}
      ... )
      >>> powder = recipe.size_classes(10)
      >>> tube = mrjax.polydisperse_column(
      ...     powder.parameters,
      ...     height=0.1,
      ...     volume_fraction=powder.volume_fraction,
      ...     bed_fraction=0.6,
      ...     times=[86400.0, 864000.0],
      ... )
    """
    threshold = jnp.asarray(threshold, float)
    case = Case(parameters, height, volume_fraction, bed_fraction, times, hindrance, None, tilt)
    case, cells = case.as_arrays(), checks.whole(cells, "cells", MOST_CELLS)
    if steps is not None:
        steps = checks.whole(steps, "steps", MOST_STEPS)
    class_checks.refuse(case, threshold)
    case = case.astype(jnp.asarray(parameters.radius).dtype)
    sinking, _ = case.sinking()
    law = masliyah.classes(sinking.parameters, case.hindrance)
    class_checks.refuse_not_settling(case, law, scheme.nodes(jnp.asarray(case.bed_fraction)))
    settled = _solve(case, threshold, cells=cells, steps=steps)
    if steps is not None:
        end = value_or_none(settled.mudline[-1])
        if end is not None and end != end:
            raise InputError(
                f"steps = {steps}: too few to reach the last of the times; give those of a call "
                "without steps, with a margin"
            )
    return settled


@partial(jax.jit, static_argnames=("cells", "steps"))
def _solve(case: Case, threshold: Array, *, cells: int, steps: int | None) -> PolydisperseColumn:
    """Simulates a column; internally the unit of length is a cell."""
    case, rising = case.sinking()
    initial, densest = jnp.asarray(case.volume_fraction), jnp.asarray(case.bed_fraction)
    height, times = jnp.asarray(case.height), jnp.asarray(case.times)
    law = masliyah.classes(case.parameters, case.hindrance)
    law = law._replace(mobility=jnp.broadcast_to(law.mobility, initial.shape))
    possible = class_checks.possible(case, threshold, law, scheme.nodes(densest))
    in_cells = law._replace(mobility=law.mobility * (cells / height))
    tube = scheme.column(in_cells, initial, densest)
    if case.tilt is not None:
        times, enough = _tilted_times(case, tube, threshold, possible, cells, steps)
        possible = possible & enough
    if steps is None:
        # Impossible arguments take no steps.
        until = jnp.where(possible, times, 0.0)
        profiles, taken = scheme.profiles(tube, until, cells)
    else:
        profiles, taken, enough = scheme.profiles_of_steps(tube, times, cells, steps)
        possible = possible & enough
    # A factor, not a `where`: derivatives of an invalid result are NaN, too.
    valid = jnp.where(possible, 1.0, jnp.nan).astype(initial.dtype)
    fields = profile.polydisperse_column(profiles, law, case, threshold, rising)
    return PolydisperseColumn(
        times=jnp.asarray(case.times),
        **{name: valid * value for name, value in fields.items()},
        initial_height=valid * height,
        initial_fractions=initial,
        bed_fraction=densest,
        threshold=threshold,
        rising=rising,
        steps=taken,
    )


def _tilted_times(
    case: Case,
    tube: scheme.Column,
    threshold: Array,
    possible: Array,
    cells: int,
    steps: int | None,
) -> tuple[Array, Array]:
    """Returns the times at which an upright column has the state of a tilted one, s, (T,).

    A run of the upright column gives the length of its suspension, up to a last time that is late
    enough.

    Returns:
      The times, and True, (), if the number of steps suffices.
    """
    assert case.tilt is not None
    times, height = jnp.asarray(case.times), jnp.asarray(case.height)
    initial, densest = jnp.asarray(case.volume_fraction), jnp.asarray(case.bed_fraction)
    last = times[-1] * case.tilt.rate(height)
    total = jnp.sum(initial)
    flux = masliyah.fluxes(tube.law, initial[:, None], total)
    velocity = jnp.sum(flux) / total * (height / cells)
    moves = velocity > 0.0
    settled = height * (1.0 - total / densest) / jnp.where(moves, velocity, 1.0)
    settled = lax.stop_gradient(jnp.where(moves, settled, last))
    nodes = clock_nodes(settled, jnp.maximum(settled, last), last)
    nodes = jnp.where(possible, nodes, 0.0)  # impossible arguments take no steps
    enough = jnp.asarray(True)
    if steps is None:
        profiles, _ = scheme.profiles(tube, nodes, cells)
    else:
        profiles, _, enough = scheme.profiles_of_steps(tube, nodes, cells, steps)
    mudline, bed = profile.fronts(profiles, case, threshold)
    length = height / cells * jnp.maximum(mudline - bed, 0.0)
    return clock_times(times, case.tilt, nodes, length), enough
