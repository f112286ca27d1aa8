"""The simulation of `mrjax simulate`: the decisions before it, and its results."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import click
import jax

import mrjax
from mrjax import Parameters, Recipe, Run, Sedimentation, State, figures
from mrjax.cli import environment, resume
from mrjax.cli.simulate.request import Request
from mrjax.core import checks
from mrjax.io import files, results
from mrjax.laws import time_scales
from mrjax.observables.interface import RELAXATIONS_TO_STEADY
from mrjax.recipe import contacts
from mrjax.simulation import processes

STEADY_AFTER = 10.0
"""Number of relaxation times after which a velocity is steady to 5e-5."""
WRITES = ("summary.json", "curve.csv", "run.npz", "settling.png")
"""Files that every call writes."""


@dataclass(frozen=True)
class Plan:
    """The decisions before a simulation."""

    request: Request
    sheet: Recipe
    parameters: Parameters
    relaxation_time: float
    """Relaxation time of the slowest particle, s."""
    folder: Path
    """Folder of the results."""
    progress: bool
    """True if this process shows progress bars."""

    @property
    def steady(self) -> bool:
        """True if the run is long enough for a settling velocity."""
        duration = self.request.duration
        return duration is None or duration >= STEADY_AFTER * self.relaxation_time

    @property
    def notes(self) -> list[str]:
        """Notes on the sheet and on the length of the run."""
        notes, duration = self.sheet.notes + self.sheet.contact_notes, self.request.duration
        if duration is not None and not self.steady:
            notes.append(
                f"the run covers {duration / self.relaxation_time:.2g} relaxation times, too few "
                f"for a settling velocity: give --duration "
                f"{STEADY_AFTER * self.relaxation_time:.2g} or more"
            )
        return notes


@dataclass(frozen=True)
class Result:
    """The runs of one call."""

    start: State
    """The first random suspension."""
    initial: Run
    """The first part of the settling, with the real moduli; with --duration, the whole run."""
    velocity: float
    """Initial settling velocity, m/s."""
    to_rest: Sedimentation | None
    """The whole sedimentation curve; None with --duration."""

    @property
    def run(self) -> Run:
        """The run for run.npz: to rest, with a leading axis of random starts, or `initial`."""
        return self.initial if self.to_rest is None else self.to_rest.run

    @cached_property
    def runs(self) -> list[Run]:
        """One run for each random start."""
        if self.to_rest is None:
            return [self.initial]
        whole, starts = self.to_rest.run, len(self.to_rest.seeds)
        return [jax.tree.map(lambda leaf, row=row: leaf[row], whole) for row in range(starts)]


def plan_run(request: Request) -> Plan:
    """Joins the other processes, reads the sheet, and makes the folder of the results.

    Raises:
      click.UsageError: two options exclude each other.
      InputError: the sheet or a value cannot be used.
      SystemRefusal: the folder cannot be made or written to.
    """
    if request.distributed is not None:
        if not request.to_rest:
            raise click.UsageError("--distributed divides an --ensemble: leave out --duration")
        if request.resume:
            raise click.UsageError("--resume works in a single process: leave out --distributed")
        processes.join(*request.distributed)
        environment.find_devices()
    sheet = processes.by_first(lambda: Recipe.load(request.recipe))
    contacts.refuse_missing(sheet)
    for name, value in (("--duration", request.duration), ("--time-step", request.time_step)):
        if value is not None:
            checks.positive(value, name, "s")
    if not request.to_rest and request.ensemble > 1:
        raise click.UsageError("--ensemble goes to rest: leave out --duration")
    for ending in request.animate:
        figures.refuse_without_writer(Path(f"settling.{ending}"))
    folder = processes.by_first(lambda: files.result_folder(Path(request.out)))
    parameters = sheet.parameters()
    return Plan(
        request,
        sheet,
        parameters,
        float(time_scales.relaxation_time(parameters).max()),
        folder,
        progress=not request.quiet and processes.is_first(),
    )


@contextmanager
def checkpointed(plan: Plan) -> Iterator[Path | None]:
    """Context with the checkpoint folder, until the results are written.

    It is None for several processes, which have no checkpoints: all of them would have to stop at
    the same part.
    """
    request = plan.request
    if request.distributed:
        processes.by_first(lambda: results.Results.load(plan.folder).refuse_foreign(WRITES))
        with results.guarded(plan.folder):
            yield None
        return
    with resume.checkpointed(
        plan.folder,
        request.resume,
        request.quiet,
        WRITES,
        command="simulate",
        recipe=plan.sheet,
        duration=request.duration,
        time_step=request.time_step,
        frames=request.frames,
        overlap=request.overlap,
        ensemble=request.ensemble,
        seed=request.seed,
        dtype=request.dtype,
        trajectory=request.records_trajectory,
    ) as checkpoint:
        yield checkpoint


def simulate_recipe(plan: Plan, checkpoint: Path | None) -> Result | None:
    """Simulates the recipe; returns None except in the first process, which writes results."""
    request, sheet = plan.request, plan.sheet
    start = mrjax.disperse(sheet, request.seed)
    initial = mrjax.follow(
        start,
        plan.parameters,
        sheet.box,
        duration=RELAXATIONS_TO_STEADY * plan.relaxation_time
        if request.duration is None
        else request.duration,
        frames=request.frames,
        time_step=None if request.to_rest else request.time_step,
        hindrance=sheet.hindrance,
        trajectory=request.records_trajectory and not request.to_rest,
        progress=plan.progress,
        checkpoint=checkpoint and checkpoint / "rise",
    )
    velocity = float(mrjax.settling_velocity(initial))
    if not request.to_rest:
        return Result(start, initial, velocity, None)
    whole = mrjax.sedimentation(
        sheet,
        request.seeds,
        overlap=request.overlap,
        frames=request.frames,
        time_step=request.time_step,
        progress=plan.progress,
        trajectory=request.records_trajectory,
        checkpoint=checkpoint and checkpoint / "rest",
    )
    processes.leave()
    return Result(start, initial, velocity, whole) if processes.is_first() else None
