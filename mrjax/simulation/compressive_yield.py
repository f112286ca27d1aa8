"""The compressive yield stress of a network of particles that attract each other.

    sigma(phi) = sigma_zz of a box at rest, compressed along z to the volume fraction phi

is what a bed of that volume fraction carries without yielding: the `Compression` of a column. A
box is a dozen layers high and a tube thousands, so that a bed may yield in a tube that stands in a
box.

Attraction, friction and rolling resistance fix sigma / (F_c / d^2) as a function of phi, with the
pull-off force F_c and the diameter d. Neither gravity nor inertia plays a part, nor do moduli while
overlaps are small. One curve therefore serves all Bond numbers, all sizes and all fluids with the
same friction, rolling friction and range of attraction.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import jax.numpy as jnp
import numpy as np
from jax.typing import DTypeLike

from mrjax.continuum.compression import Compression
from mrjax.core import checks
from mrjax.core.box import Box
from mrjax.core.errors import InputError, shown
from mrjax.core.interruption import Stop, interruptible, side_by_side
from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.laws import attraction, drag, particle, time_scales
from mrjax.recipe import contacts
from mrjax.recipe.recipe import Recipe
from mrjax.simulation import processes
from mrjax.simulation.compression_fit import fit_compression
from mrjax.simulation.compression_run import PERIODIC, Compaction, Strained, compress
from mrjax.simulation.softening import RANGE

FEWEST = 60
"""Least number of particles: a box of some four diameters at its end."""
DENSEST = 0.6
"""Highest volume fraction to which a box is compressed; overlaps carry the stress beyond it."""
MOST_OVERLAP = 0.05
"""Largest overlap under the pull-off force, in radii; loads deepen it about tenfold."""
LEAST_STRESS = 0.01
"""Stress from which a point is fitted, over F_c / d^2; unbalanced forces make up a tenth of it."""
SAFETY = 0.8
"""Share of the stable step of a bed whose contacts are twice as deep as at rest."""


@dataclass(frozen=True)
class CompressiveYield:
    """Compressive yield stress of M random starts at K volume fractions, and its law."""

    volume_fraction: np.ndarray
    """Volume fraction of the coated particles, ascending; 1, (K,)."""
    stresses: np.ndarray
    """Stress sigma_zz of each start; Pa, (M, K)."""
    lateral_stresses: np.ndarray
    """Mean of sigma_xx and sigma_yy of each start; Pa, (M, K)."""
    coordination: np.ndarray
    """Mean coordination number of each start; 1, (M, K)."""
    unbalanced: np.ndarray
    """Mean net force on a particle at the end of each step, over F_c and the load; 1, (M, K)."""
    compression: Compression
    """Law fitted to the mean over the starts, above the first stress that is clear of noise."""
    covariance: np.ndarray
    """Covariance of (gel_fraction, log stress, exponent), (3, 3), by leaving out one start at a
    time; NaN for a single start."""
    fitted: np.ndarray
    """True for the volume fractions that were fitted, (K,)."""
    pull_off: float
    """Pull-off force F_c of two mean particles, N."""
    diameter: float
    """Mean contact diameter d, m."""
    seeds: tuple[int, ...]
    """Seeds of the random starts, (M,)."""

    @property
    def stress(self) -> np.ndarray:
        """Mean stress over the starts; Pa, (K,)."""
        return self.stresses.mean(axis=0)

    @property
    def standard_error(self) -> np.ndarray:
        """Standard error of `stress`; Pa, (K,). NaN for a single start."""
        starts = len(self.stresses)
        if starts == 1:
            return np.full(self.volume_fraction.shape, np.nan)
        return self.stresses.std(axis=0, ddof=1) / np.sqrt(starts)

    @property
    def scale(self) -> float:
        """F_c / d^2, Pa: `stress` over it is the same for all Bond numbers."""
        return self.pull_off / self.diameter**2

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors of `gel_fraction` (1), `stress` (relative) and `exponent` (1)."""
        names = ("gel_fraction", "stress", "exponent")
        return dict(zip(names, map(float, np.sqrt(np.diag(self.covariance))), strict=True))

    def of(self, parameters: Parameters) -> Compression:
        """The law for other particles with the same friction, rolling friction and range.

        Args:
          parameters: parameters with a Hamaker constant; their F_c / d^2 scales the stress.

        Raises:
          InputError: the parameters have no attraction.
        """
        pull_off, diameter = _bond(parameters)
        law, factor = self.compression, pull_off / diameter**2 / self.scale
        return Compression(
            gel_fraction=law.gel_fraction, stress=law.stress * factor, exponent=law.exponent
        )


def compressive_yield(
    recipe: Recipe,
    seeds: int | Iterable[int] = (0, 1, 2),
    *,
    particles: int = 300,
    start: float = 0.1,
    end: float = 0.55,
    strain: float = 0.03,
    rest: float = 3e-3,
    overlap: float = 0.02,
    dtype: DTypeLike = float,
) -> CompressiveYield:
    """Compresses a periodic box of the particles of a recipe, and gives its stress sigma(phi).

    Start: particles at random without overlap, at `start`; they meet and stick as the box is
    compressed. Step: box and centres are compressed along z until the volume fraction has grown by
    `strain`; then the particles move with contact, attraction and drag, and without gravity, until
    they rest. Rest: the mean net force on a particle is `rest` times the pull-off force and the
    load sigma d^2; after 20,000 time steps a step ends with up to thirty times of it. End: a cube,
    at `end`. The stress is that of contacts along z.

    The attraction is that of DMT, with the range of the sheet or 0.03 radii. Dipoles are left out.

    Cost: about 330,000 time steps of 300 particles a start: some 35 s each of one core, and 20 s to
    compile. Starts run side by side on several cores. The call cannot be traced.

    Args:
      recipe: lab sheet with `[attraction]`; friction and rolling friction are its own.
      seeds: seeds of the random starts, one for each; two or more give standard errors.
      particles: number of particles N, about; the stress of 800 is the same within its errors.
      start: volume fraction of the start, of coated particles; 1.
      end: highest volume fraction; 1.
      strain: relative growth of the volume fraction in a step; 1.
      rest: criterion of rest; 1.
      overlap: overlap of two particles under the pull-off force, in radii; moduli are lowered so.
      dtype: dtype of the runs; `float` is JAX's default.

    Raises:
      InputError: an argument cannot be used, or the recipe has no attraction.
      SimulationError: a box does not come to rest, overlaps are too deep, or too few volume
        fractions carry a stress.
    """
    checks.require_class(Recipe, recipe=recipe)
    _refuse_range(start, end, strain)
    seeds = tuple(seeds) if isinstance(seeds, Iterable) else (seeds,)
    if not seeds or len(set(seeds)) < len(seeds):
        raise InputError(f"seeds = {shown(seeds)}: give at least one, and each once")
    compaction = _compaction(recipe, particles, start, end, strain, rest, overlap, dtype)
    with interruptible() as stop:
        packings = _all_starts(compaction, seeds, stop)

    def each(value: str) -> np.ndarray:
        return np.array([[getattr(one, value) for one in start] for start in packings])

    tensors = each("stress")
    stresses = tensors[..., 2, 2]
    diameter = float(np.sqrt(compaction.area))
    least = LEAST_STRESS * compaction.pull_off / compaction.area
    fit = fit_compression(compaction.fractions, stresses, least)
    return CompressiveYield(
        compaction.fractions,
        stresses,
        0.5 * (tensors[..., 0, 0] + tensors[..., 1, 1]),
        each("coordination"),
        each("unbalanced"),
        fit.compression,
        fit.covariance,
        fit.fitted,
        compaction.pull_off,
        diameter,
        seeds,
    )


def _all_starts(compaction: Compaction, seeds: tuple[int, ...], stop: Stop) -> list[list[Strained]]:
    """The packings of every start; the starts run side by side on several cores."""
    runs = [partial(compress, compaction, seed, stop) for seed in seeds]
    if len(runs) == 1:
        return [runs[0]()]
    return side_by_side(runs, processes.usable_cores(), stop)


def _refuse_range(start: float, end: float, strain: float) -> None:
    """Refuses volume fractions and a strain step that cannot be used.

    Raises:
      InputError: they cannot.
    """
    start, end = checks.fraction(start, "start"), checks.fraction(end, "end")
    if not 0.01 <= start < end <= DENSEST:
        raise InputError(
            f"start = {start:.3g}, end = {end:.3g}: give 0.01 <= start < end <= {DENSEST}"
        )
    if not 0.0 < checks.fraction(strain, "strain") <= 0.1:
        raise InputError(f"strain = {strain:.3g}: give at most 0.1, better 0.03")


def _compaction(
    recipe: Recipe,
    particles: int,
    start: float,
    end: float,
    strain: float,
    rest: float,
    overlap: float,
    dtype: DTypeLike,
) -> Compaction:
    """What all starts share.

    Raises:
      InputError: an argument cannot be used, or the recipe lacks attraction or contact input.
    """
    if checks.whole(particles, "particles") < FEWEST:
        raise InputError(f"particles = {particles}: give at least {FEWEST}, better 300")
    rest = checks.positive(rest, "rest", "pull-off forces")
    if not checks.positive(overlap, "overlap", "radii") <= MOST_OVERLAP:
        raise InputError(f"overlap = {overlap:g} radii: give at most {MOST_OVERLAP}, better 0.02")
    _bond(recipe.parameters())  # refuses particles without attraction
    contacts.refuse_missing(recipe)
    sheet = _resized(recipe, particles)
    stiff = sheet.parameters(dtype)
    pull_off, _ = _bond(stiff)
    soft = _softened(stiff, overlap, pull_off)
    outer = np.asarray(evaluate_with_numpy(particle.outer_radius, soft))
    radius = np.broadcast_to(outer, sheet.particle_count)
    side = float((4.0 / 3.0 * np.pi * np.sum(radius**3) / end) ** (1 / 3))
    steps = int(np.ceil(np.log(end / start) / np.log1p(strain)))
    deep = 2.0 * overlap * float(radius.max())
    stable = evaluate_with_numpy(partial(time_scales.largest_stable_step, overlap=deep), soft)
    return Compaction(
        parameters=soft,
        box=Box((side, side, side), PERIODIC),
        radius=radius,
        fractions=np.geomspace(start, end, steps + 1),
        pull_off=pull_off,
        drag=float(np.max(evaluate_with_numpy(drag.coefficient, soft))),
        time_step=SAFETY * float(stable),
        rest=rest,
        dtype=jnp.dtype(dtype),
    )


def _resized(recipe: Recipe, particles: int) -> Recipe:
    """The recipe with a cube that holds about so many particles, at its own composition."""
    volume = recipe.box.volume * particles / max(1, recipe.particle_count)
    return recipe.model_copy(update={"box": Box((volume ** (1 / 3),) * 3)})


def _bond(parameters: Parameters) -> tuple[float, float]:
    """Pull-off force of two mean particles, N, and mean contact diameter, m.

    Raises:
      InputError: the parameters have no attraction.
    """
    if parameters.hamaker is None or not np.any(np.asarray(parameters.hamaker) > 0.0):
        raise InputError(
            "the recipe has no attraction: without it a network carries no stress below the volume "
            "fraction at which spheres jam, and beyond it only that of their elastic overlap; give "
            "[attraction] hamaker and layer_thickness"
        )
    outer = float(np.mean(evaluate_with_numpy(particle.outer_radius, parameters)))
    mean = parameters.replace(radius=outer, f_r=1.0)
    pull_off = evaluate_with_numpy(attraction.largest_pull_off, mean)[0]
    return float(pull_off), 2.0 * outer


def _softened(stiff: Parameters, overlap: float, pull_off: float) -> Parameters:
    """The parameters with moduli at which the pull-off force gives an overlap, in radii."""
    radius = float(np.max(evaluate_with_numpy(particle.outer_radius, stiff)))
    expected = evaluate_with_numpy(
        partial(time_scales.expected_overlap, load=pull_off, speed=0.0), stiff
    )
    factor = min(1.0, (float(expected) / (overlap * radius)) ** 1.5)
    soft = stiff.replace(
        elastic_modulus=stiff.elastic_modulus * factor,
        restitution=1.0,
        dissipation=0.0,
        tangential_dissipation=0.0,
    )
    return soft if stiff.attraction_range is not None else soft.replace(attraction_range=RANGE)
