"""The whole sedimentation curve of a lab sheet, of one random start or an ensemble."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import DTypeLike

from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.core.run import Run
from mrjax.dem.forces import Force
from mrjax.io.checkpoint import refuse_foreign
from mrjax.observables import interface
from mrjax.recipe.recipe import Recipe
from mrjax.simulation import processes
from mrjax.simulation.disperse import disperse
from mrjax.simulation.overlap import OVERLAP
from mrjax.simulation.settle import settle
from mrjax.simulation.softening import softened


@dataclass(frozen=True)
class Sedimentation:
    """M runs to rest of one recipe."""

    run: Run
    """All runs; each array has a leading axis (M, ...)."""
    parameters: Parameters
    """Parameters of the runs, softened."""
    softening: float
    """Factor on the elastic moduli of particles and walls."""
    seeds: tuple[int, ...]
    """Seeds of the random starts, (M,)."""

    def ratio(self, height: str = "top") -> Array:
        """Sedimentation ratio by one of `HEIGHTS`; 1, (M, frames + 1)."""
        return jax.vmap(lambda run: interface.sedimentation_ratio(run, height))(self.run)


def sedimentation(
    recipe: Recipe,
    seeds: int | Iterable[int] = 0,
    *,
    overlap: float = OVERLAP,
    frames: int = 200,
    time_step: float | None = None,
    dtype: DTypeLike = float,
    progress: bool = False,
    forces: Sequence[Force] | None = None,
    trajectory: bool = False,
    checkpoint: str | Path | None = None,
) -> Sedimentation:
    """Disperses a recipe and lets it settle to rest at its own viscosity.

    Contacts are softened to an overlap (`softened`). The drag is that of the sheet, local if the
    sheet says so. If `jax.distributed` is initialised, the starts are divided among its processes;
    every process makes this call with the same arguments, and gets all runs.

    Args:
      recipe: the lab sheet.
      seeds: seeds of the random starts, one run for each.
      overlap: greatest overlap of a contact at rest, in contact radii.
      frames: number of frames recorded in the expected duration.
      time_step: longest step, s; by default one at which the bed is stable.
      dtype: dtype of the runs; `float` is JAX's default.
      progress: whether to show progress bars, on standard error.
      forces: the forces on the particles; by default those of `RunOptions`.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).
      checkpoint: folder that keeps the runs every ten frames, as for `settle`.

    Raises:
      InputError: an argument cannot be used, or the checkpoint is of other runs.
      SimulationError: a bed does not come to rest, or a run is not to be trusted.
    """
    refuse_foreign(checkpoint)
    checks.require_class(Recipe, recipe=recipe)
    seeds = tuple(seeds) if isinstance(seeds, Iterable) else (seeds,)
    if not seeds:
        raise InputError("seeds is empty: give at least one")
    counts = Counter(map(str, seeds))
    for seed, times in counts.items():
        if times > 1:
            raise InputError(
                f"seeds: {shown(seed)} is given {times} times, and the same start counts once; "
                "give seeds that differ"
            )
    states = processes.divided(
        lambda share: [disperse(recipe, seed, dtype=dtype) for seed in share], seeds
    )
    stiff = recipe.parameters(dtype)
    parameters = softened(stiff, recipe.box, recipe.particle_count, overlap)
    run = settle(
        states,
        parameters,
        recipe.box,
        frames=frames,
        time_step=time_step,
        hindrance=recipe.hindrance,
        forces=forces,
        progress=progress,
        trajectory=trajectory,
        checkpoint=checkpoint,
    )
    factor = np.ravel(parameters.elastic_modulus / stiff.elastic_modulus)[0]
    return Sedimentation(run, parameters, float(factor), seeds)


def standard_error(values: Array) -> Array:
    """Standard error of the mean over the first axis, (M, ...) to (...); NaN for a single one."""
    count = values.shape[0]
    spread = jnp.sqrt(jnp.sum((values - jnp.mean(values, axis=0)) ** 2, axis=0))
    return spread / jnp.sqrt(count * (count - 1.0)) if count > 1 else jnp.nan * spread
