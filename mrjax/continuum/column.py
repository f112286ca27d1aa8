"""A settling column in one dimension: days of a tall tube, from the parameters of a simulation.

d phi/dt = d/dz f(phi),  f(phi) = phi v(phi)                                      (Kynch 1952)

with z from the floor towards the clear fluid, both ends closed, v the terminal velocity with the
f_w of each volume fraction, and a bed that is rigid at phi_m or compressible (`compression`).

Particles lighter than the fluid settle towards the lid in the same way: z then points down from it.

Finite volumes: Godunov's flux from a table (`kynch`) between values at the faces of linear
profiles in the cells, Heun's steps (Shu & Osher 1988), the stress implicit. Conservative; keeps the
fractions between 0 and phi_m; first-order, as any scheme is where there are fronts. With a
compressible bed without the lines, for steps of Euler.
"""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import ArrayLike, DTypeLike

from mrjax.continuum import compression, kynch
from mrjax.continuum.compression import Compression
from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.core.tracing import drop_tracers, evaluated_or_none, value_or_none
from mrjax.laws import particle
from mrjax.laws.closed_forms import terminal_velocity
from mrjax.laws.hindrance import Hindrance, as_tree

REACH = 0.5
"""Most cells that a front may cross in a step: each half of a cell is a cell to its own face."""
CHOSEN = 0.95
"""Share of that in a step that is chosen."""
MOST_STEPS, MOST_CELLS = 10**8, 10**6


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Column:
    """What a settling column shows at T times, in C cells from the floor to the initial height.

    Where a traced call was given too few steps, or what cannot be, every number but the times and
    `courant` is NaN.
    """

    times: Array
    """As given, (T,) in s."""
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
    """What the suspension and its bed still fill of the initial height; 1, (T,)."""
    volume_fraction: Array
    """Mean of every cell, (T, C); 1."""
    levels: Array
    """Heights of the middles of the cells, (C,) in m."""
    initial_height: Array
    """Of the suspension, m, ()."""
    courant: Array
    """Cells that the fastest front crosses in a step; 1, ()."""
    steps: int = field(metadata={"static": True})
    """Number of equal steps; each of the times adds one by cutting another."""


Carry = tuple[Array, Array, Array]
"""Volume fractions, what rounding has lost of them, and those at the times so far."""


class _Case(NamedTuple):
    """What settles, in SI."""

    parameters: Parameters
    height: ArrayLike
    volume_fraction: ArrayLike
    bed_fraction: ArrayLike
    times: ArrayLike
    hindrance: Hindrance | None
    compression: Compression | None

    def as_arrays(self) -> "_Case":
        """With the closure and the times as one leaf or tree of arrays."""
        times = self.times
        try:
            checks.numeric(times)
        except ValueError:
            raise InputError(
                f"times = {shown(times)}: give one row of numbers in s, shape (T,)"
            ) from None
        if not isinstance(times, Array):
            times = jnp.asarray(times) if value_or_none(times) is None else np.asarray(times, float)
        return self._replace(times=times, hindrance=as_tree(self.hindrance))

    def sinking(self) -> tuple["_Case", Array]:
        """The mirror image of what rises, else the same; and whether it rises, ()."""
        rising = particle.rises(self.parameters)
        gravity = jnp.where(rising, -self.parameters.gravity, self.parameters.gravity)
        return self._replace(parameters=self.parameters.replace(gravity=gravity)), rising

    def astype(self, dtype: DTypeLike) -> "_Case":
        return jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype), self)


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
      steps: equal ones to the last of the times; left out, `column_steps`.

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
    case, cells, fewest = _accepted(
        _Case(parameters, height, volume_fraction, bed_fraction, times, hindrance, compression),
        cells,
    )
    steps = _chosen(fewest) if steps is None else checks.whole(steps, "steps", MOST_STEPS)
    if fewest is not None and steps < fewest * (1.0 - 1e-6):
        raise InputError(
            f"steps = {steps}: a front would cross more than half a cell in a step; give at least "
            f"{math.ceil(fewest)}, or leave steps out"
        )
    return _settled(case.astype(jnp.asarray(parameters.radius).dtype), cells=cells, steps=steps)


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
    _, _, fewest = _accepted(
        _Case(parameters, height, volume_fraction, bed_fraction, times, hindrance, compression),
        cells,
    )
    return _chosen(fewest)


@partial(jax.jit, static_argnames=("cells", "steps"))
def _settled(case: _Case, *, cells: int, steps: int) -> Column:
    """The compiled whole, with the height of a cell and a step as units."""
    case, rising = case.sinking()
    initial, densest = case.volume_fraction, case.bed_fraction
    cell = case.height / cells
    flux = _flux(case, cells, steps)
    courant = _fastest_front(case, flux)
    profiles = _profiles(case, flux, cells, steps)
    full = densest
    if case.compression is not None:
        full = jnp.minimum(full, case.compression.gel_fraction)
    mudline = _mudline(profiles, jnp.minimum(initial, full), densest)
    bed_front = _bed_front(profiles, mudline, kynch.bed_contact_fraction(flux, full), full)
    # A factor, not a choice: the derivative of what must not be used is NaN too.
    possible = _possible(case, flux) & (courant <= REACH * (1.0 + 1e-5))
    sound = jnp.where(possible, 1.0, jnp.nan).astype(initial.dtype)

    def level(of_cells: Array) -> Array:
        return jnp.where(rising, case.height - cell * of_cells, cell * of_cells)

    return Column(
        times=case.times,
        mudline=sound * level(mudline),
        bed_front=sound * level(bed_front),
        sedimentation_ratio=sound * cell * mudline / case.height,
        volume_fraction=sound * jnp.where(rising, profiles[:, ::-1], profiles),
        levels=sound * cell * (jnp.arange(cells, dtype=initial.dtype) + 0.5),
        initial_height=sound * case.height,
        courant=courant,
        steps=steps,
    )


def _flux(case: _Case, cells: int, steps: int) -> kynch.Table:
    """f(phi) in cells for each step."""
    si = kynch.table(case.parameters, case.hindrance, case.volume_fraction, case.bed_fraction)
    return si._replace(flux=si.flux * (case.times[-1] / steps * cells / case.height))


def _fastest_front(case: _Case, flux: kynch.Table) -> Array:
    """Of those that leave the suspension, or the surface of a compressible bed; ()."""
    front = kynch.fastest_front(flux, case.volume_fraction)
    if case.compression is None:
        return front
    return jnp.maximum(front, kynch.fastest_front(flux, case.compression.gel_fraction))


def _profiles(case: _Case, flux: kynch.Table, cells: int, steps: int) -> Array:
    """Volume fractions at the times, (T, cells): the only scan.

    In chunks of steps: reverse mode keeps the beginning of each, and repeats the rest.
    """
    shares, slots = _merged(case.times, steps)
    count = case.times.size
    chunk = math.isqrt(shares.size - 1) + 1
    missing = -shares.size % chunk
    shares = jnp.pad(shares, (0, missing)).reshape(-1, chunk)
    slots = jnp.pad(slots, (0, missing), constant_values=count).reshape(-1, chunk)
    godunov = kynch.godunov(kynch.slope_limited(flux, jnp.full_like(case.height, REACH)))
    stress, weight = case.compression, _net_weight(case.parameters) * case.height / cells

    def sharp(fraction: Array, share: Array) -> Array:
        """Second order where the profile is smooth (Heun's step)."""
        first = share * _between_faces(godunov, fraction, case.bed_fraction)
        once = fraction + jnp.diff(jnp.pad(first, 1))
        return 0.5 * (first + share * _between_faces(godunov, once, case.bed_fraction))

    def robust(fraction: Array, share: Array) -> Array:
        """First order.

        In a compressible bed at rest fluxes balance for thousands of steps, through which the
        derivative of anything sharper grows without bound.
        """
        return share * kynch.godunov_flux(godunov, fraction[:-1], fraction[1:])

    falling = sharp if stress is None else robust

    def step(carry: Carry, now: tuple[Array, Array]) -> tuple[Carry, None]:
        fraction, rounded, seen = carry
        share, slot = now
        down = falling(fraction, share)
        # Kahan's sum: what rounding loses at rest is the same at every step.
        change = jnp.diff(jnp.pad(down, 1)) + rounded
        settled = fraction + change
        rounded = change - (settled - fraction)
        if stress is not None:
            settled = compression.spread(
                settled, compression.exchange(stress, weight, fraction, down)
            )
        return (settled, rounded, lax.dynamic_update_index_in_dim(seen, settled, slot, 0)), None

    @partial(jax.checkpoint, prevent_cse=False)
    def steps_of_chunk(carry: Carry, now: tuple[Array, Array]) -> tuple[Carry, None]:
        return lax.scan(step, carry, now)

    start = jnp.full(cells, case.volume_fraction)
    nothing = jnp.zeros((count + 1, cells), start.dtype)  # the last row for steps without a time
    carry = start, jnp.zeros_like(start), nothing
    (*_, seen), _ = lax.scan(steps_of_chunk, carry, (shares, slots))
    return seen[:count]


def _between_faces(godunov: kynch.Godunov, fraction: Array, densest: Array) -> Array:
    """Flux between every cell and the one above it, downwards; (cells - 1,).

    Between what lines through the cells give at their faces: each rises by the smaller of the rises
    to its neighbours, a full floor and clear fluid included, and not at all at a peak (minmod).
    Steeper ones, such as van Leer's, find other fans than Kynch's where f has an inflection: with
    more cells their error stays.
    """
    floor = jnp.broadcast_to(densest, (1,))
    rises = jnp.diff(jnp.concatenate([floor, fraction, jnp.zeros_like(floor)]))
    below, above = rises[:-1], rises[1:]
    smaller = jnp.where(jnp.abs(below) < jnp.abs(above), below, above)
    half = jnp.where(below * above > 0.0, 0.5 * smaller, 0.0)
    return kynch.godunov_flux(godunov, (fraction + half)[:-1], (fraction - half)[1:])


def _merged(times: Array, steps: int) -> tuple[Array, Array]:
    """Equal steps, cut so that one ends at each of the times.

    Returns: the length of each as a share of an equal one, and the number of the time at which it
    ends, T for none; (steps + T,).
    """
    count = times.size
    whole = jnp.arange(steps + 1, dtype=times.dtype)
    # Else XLA sorts constant times while it compiles, for seconds.
    looked = lax.optimization_barrier(times / times[-1] * steps)
    shares = jnp.diff(jnp.sort(jnp.concatenate([whole, looked]), stable=True))
    number = jnp.arange(count, dtype=jnp.int32)
    ends = jnp.floor(lax.stop_gradient(looked)).astype(jnp.int32) + number
    return shares, jnp.full(steps + count, count, jnp.int32).at[ends].set(number)


def _mudline(profile: Array, suspended: Array, densest: Array) -> Array:
    """`Column.mudline` in cells, (T,), of profiles (T, cells)."""
    floor, clear = (jnp.full_like(profile[:, :1], value) for value in (densest, 0.0))
    below = jnp.concatenate([floor, profile[:, :-1]], axis=1)
    above = jnp.concatenate([profile[:, 1:], clear], axis=1)
    share = jnp.maximum(profile / jnp.maximum(below, suspended), above / suspended)
    return jnp.sum(jnp.clip(share, 0.0, 1.0), axis=1)


def _bed_front(profile: Array, mudline: Array, meets: Array, full: Array) -> Array:
    """`Column.bed_front` in cells, (T,), of profiles (T, cells)."""
    bed = full > meets  # else all of the suspension is one
    excess = (profile - meets) / jnp.where(bed, full - meets, 1.0)
    suspension = mudline - jnp.sum(jnp.clip(excess, 0.0, 1.0), axis=1)
    return mudline - jnp.where(bed, suspension * jnp.clip(suspension - 1.0, 0.0, 1.0), 0.0)


def _net_weight(parameters: Parameters) -> Array:
    """Delta rho g, of the coated particle in the fluid; N/m^3, ()."""
    excess = particle.apparent_density(parameters) - parameters.fluid_density
    return excess * parameters.gravity


def _possible(case: _Case, flux: kynch.Table) -> Array:
    """What `_refuse` would have passed, ()."""
    ascending = (
        jnp.all(jnp.diff(case.times) > 0.0) & (case.times[0] >= 0.0) & (case.times[-1] > 0.0)
    )
    fractions = (case.volume_fraction > 0.0) & (case.volume_fraction < case.bed_fraction)
    settles = jnp.all(jnp.isfinite(flux.flux) & (flux.flux >= 0.0))
    return ascending & fractions & (case.bed_fraction < 1.0) & (case.height > 0.0) & settles


def _accepted(case: _Case, cells: int) -> tuple[_Case, int, float | None]:
    """A case that can be, its cells, and the fewest steps that it takes; None where it is traced.

    Raises:
      InputError: what describes no column.
    """
    case, cells = case.as_arrays(), checks.whole(cells, "cells", MOST_CELLS)
    _refuse(case)
    return case, cells, _fewest_steps(case, cells)


@jax.jit
def _speeds(case: _Case) -> tuple[kynch.Table, Array]:
    """The flux and the fastest front, m/s."""
    case, _ = case.sinking()
    flux = kynch.table(case.parameters, case.hindrance, case.volume_fraction, case.bed_fraction)
    return flux, _fastest_front(case, flux)


def _fewest_steps(case: _Case, cells: int) -> float | None:
    """In which no front crosses more than half a cell; None where something is traced.

    Raises:
      InputError: particles that do not settle at every volume fraction.
    """
    found = evaluated_or_none(lambda case: (*_speeds(case), case), drop_tracers(case))
    if found is None:
        return None
    flux, speed, numbers = found
    for fraction, solid in zip(np.asarray(flux.fraction), np.asarray(flux.flux), strict=True):
        if not 0.0 <= solid < np.inf:
            raise InputError(
                f"at a volume fraction of {fraction:.3g} the particles would settle at "
                f"{solid / fraction:.3g} m/s; give a hindrance that holds up to bed_fraction = "
                f"{float(numbers.bed_fraction):.3g}, in a viscous fluid"
            )
    last, height = (float(np.ravel(of)[-1]) for of in (numbers.times, numbers.height))
    return float(speed) * last / height * cells / REACH


def _chosen(fewest: float | None) -> int:
    """Not quite the fewest steps, to four binary digits.

    Raises:
      InputError: they are not known, or more than can be waited for.
    """
    if fewest is None:
        raise InputError(
            "what settles is traced by jit or vmap, so column cannot choose its steps; give "
            "steps=mrjax.column_steps(...), computed outside from plain numbers"
        )
    steps = max(1.0, fewest / CHOSEN)
    if steps > MOST_STEPS:
        raise InputError(
            f"times up to the last take {steps:.3g} steps, more than {MOST_STEPS}; give an earlier "
            "last time, fewer cells, or a volume_fraction further from bed_fraction"
        )
    digit = 2 ** max(0, math.frexp(steps)[1] - 4)
    return math.ceil(steps / digit) * digit


def _refuse(case: _Case) -> None:
    """Refuses what describes no column, where it is known.

    Raises:
      InputError: the first such argument.
    """
    checks.of_kind(Parameters, parameters=case.parameters)
    velocity = jnp.shape(terminal_velocity(case.parameters))
    if velocity != ():
        raise InputError(
            f"parameters are those of {velocity} particles; a column settles as equal ones: give "
            "one number for each parameter, such as the radius of the mean settling velocity"
        )
    checks.meaningful(case.parameters, 1, None)
    _number(case.height, "height", math.inf, "m")
    bed = _number(case.bed_fraction, "bed_fraction", 1.0, "1") or 1.0
    _number(case.volume_fraction, "volume_fraction", bed, "1")
    if case.compression is not None:
        _number(case.compression.gel_fraction, "gel_fraction", bed, "1")
        _number(case.compression.stress, "stress", math.inf, "Pa")
        _number(case.compression.exponent, "exponent", math.inf, "1")
    _refuse_times(case.times)


def _number(value: ArrayLike, name: str, below: float, unit: str) -> float | None:
    """A number above zero and below a bound; None where it is traced.

    Raises:
      InputError: it is not.
    """
    try:
        number = checks.numeric(value)
    except ValueError:
        number = np.zeros(2)  # whatever it is, it is not one number
    if number is None and np.shape(value) == ():
        return None
    if number is None or number.ndim:
        raise InputError(f"{name} = {shown(value)}: give one number, in {unit}")
    if not number > 0.0 or not np.isfinite(number) or number >= below:
        bound = ""
        if math.isfinite(below):
            bound = f" and below {below:.6g}" + (", bed_fraction" if below < 1.0 else "")
        raise InputError(f"{name} = {float(number):.6g} must be above 0{bound}, in {unit}")
    return checks.positive(float(number), name, unit)


def _refuse_times(times: Array | np.ndarray) -> None:
    """Refuses times that are no row, or do not increase from 0.

    Raises:
      InputError: the first such time.
    """
    if times.ndim != 1 or times.size == 0:
        raise InputError(f"times have shape {times.shape}; give one row of them in s, shape (T,)")
    numbers = value_or_none(times)
    if numbers is None:
        return
    for number, time in enumerate(numbers):
        if not 0.0 <= time < np.inf:
            raise InputError(f"times[{number}] = {time:.6g} must be at least 0 and finite, in s")
        if time != 0.0:
            checks.positive(time, f"times[{number}]", "s")
        if number > 0 and not time > numbers[number - 1]:
            raise InputError(
                f"times[{number}] = {time:.6g} s is not after {numbers[number - 1]:.6g} s; give "
                "increasing times"
            )
    if numbers[-1] == 0.0:
        raise InputError("times = [0]: nothing settles in no time; give a later last one, in s")
