"""Ensembles of beds, dropped or settled, and their heights: one line for each bed."""

import csv
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import jax
import numpy as np

import mrjax
from mrjax.core.box import Box
from mrjax.core.run import Run
from mrjax.observables import interface
from mrjax.paper.dry_beds import dropped
from mrjax.recipe.recipe import Recipe
from mrjax.simulation.sedimentation import OVERLAP

FILE = Path(__file__).parent / "beds.csv"
PEER = Path(__file__).parent.parent / "data" / "liggghts" / "beds.csv"

SAMPLES, SIDES = ("case2", "case3"), ("walls", "periodic")
FRICTIONS = (0.0, 0.1, 0.3, 0.5)
"""Those of the beds of LIGGGHTS."""
SCANNED = (0.2,)
"""Between them, for the printed final ratios; the first is that of the variants."""
PEER_TIME = 9e-3
"""When they were looked at, s; most of ours rest before."""
STARTS = 6
"""Random starts of an ensemble."""

AS_IS = "as is"
TWICE, HALF = "twice the overlap", "half the overlap"
VARIANTS: dict[str, dict] = {
    HALF: {"overlap": 0.5 * OVERLAP},
    f"{TWICE}, half the step": {"overlap": 2.0 * OVERLAP, "shorter": 0.5},
    f"{TWICE}, twice the skin": {"overlap": 2.0 * OVERLAP, "skin": 0.1},
    f"{TWICE}, rebuilds four times as often": {"overlap": 2.0 * OVERLAP, "rebuild_every": 32},
    f"{TWICE}, float32": {"overlap": 2.0 * OVERLAP, "dtype": np.float32},
}
"""What must not matter; but for the overlap, at half the cost."""
MOMENTS = 10
"""At which the curve is kept, up to the time of an unhindered fall through what is not bed."""

KEYS = ("how", "sample", "sides", "friction", "variant")
Bed = dict[str, str | float]


def missing(have: list[Bed]) -> Iterator[list[Bed]]:
    """Every ensemble that is not yet there, one after the other."""
    done = {tuple(bed[key] for key in KEYS) for bed in have}
    for key, ensemble in _ensembles():
        if key not in done:
            of = dict(zip(KEYS, key, strict=True))
            until = PEER_TIME if of["how"] == "dropped" else None
            yield [{**of, **row} for row in _rows(ensemble(), until)]


def _ensembles() -> Iterator[tuple[tuple, Callable[[], Run]]]:
    """What each is called, by `KEYS`, and how it is run."""
    for sides in SIDES:
        for friction in FRICTIONS + (SCANNED if sides == "walls" else ()):
            for sample in SAMPLES:
                recipe, periodic = _recipe(sample, sides, friction), sides == "periodic"
                run = partial(dropped, recipe, range(STARTS), friction, periodic)
                yield ("dropped", sample, sides, friction, AS_IS), run
    for friction in SCANNED + FRICTIONS:
        for sample in SAMPLES:
            recipe = _recipe(sample, "walls", friction)
            key = ("settled", sample, "walls", friction)
            yield (*key, AS_IS), partial(_settled, recipe)
            yield (*key, TWICE), partial(_settled, recipe, 2.0 * OVERLAP)
    for variant, options in VARIANTS.items():
        recipe = _recipe("case2", "walls", SCANNED[0])
        yield (
            ("settled", "case2", "walls", SCANNED[0], variant),
            partial(_settled, recipe, **options),
        )


def known(file: Path) -> list[Bed]:
    """The lines of a file of beds, numbers as such; none where there is no file."""
    if not file.exists():
        return []
    with file.open(encoding="utf-8", newline="") as lines:
        table = csv.DictReader(line for line in lines if not line.startswith("#"))
        return [{key: _number(value) for key, value in row.items()} for row in table]


def _recipe(sample: str, sides: str, friction: float) -> Recipe:
    recipe = Recipe.load(sample)
    contact = recipe.contact.model_copy(update={"friction": friction})
    box = Box(recipe.box.size, (sides == "periodic", sides == "periodic", False))
    return recipe.model_copy(update={"contact": contact, "box": box})


def _settled(
    recipe: Recipe, overlap: float = OVERLAP, shorter: float = 1.0, dtype=float, **options
) -> Run:
    """As `mrjax.sedimentation`, with a shorter step or the options of `settle`."""
    soft = mrjax.softened(recipe.parameters(dtype), recipe.box, recipe.particle_count, overlap)
    states = [mrjax.disperse(recipe, seed, dtype=dtype) for seed in range(STARTS)]
    if shorter != 1.0:
        options["time_step"] = shorter * mrjax.settle(states[0], soft, recipe.box).time_step
    return mrjax.settle(states, soft, recipe.box, **options)


def _rows(run: Run, until: float | None) -> list[Bed]:
    """A line for each start, at rest or at a time, s."""
    ratios = {
        name: np.asarray(
            jax.vmap(lambda one, name=name: interface.sedimentation_ratio(one, name))(run)
        )
        for name in interface.HEIGHTS
    }
    frames = len(run.times[0]) - 1
    end = frames if until is None else min(frames, round(until / float(run.times[0, 1])))
    expected = min(200, frames)
    moments = [round(expected * (part + 1) / MOMENTS) for part in range(MOMENTS)]
    return [
        {
            "seed": seed,
            **{name: float(ratio[seed, end]) for name, ratio in ratios.items()},
            "end": float(run.times[seed, end]),
            "time_step": run.time_step,
            "deepest_overlap": float(run.deepest_overlap[seed]),
            **{
                f"top_{part + 1}": float(ratios["top"][seed, at]) for part, at in enumerate(moments)
            },
        }
        for seed in range(STARTS)
    ]


def add(beds: Iterable[Bed]) -> None:
    """Adds lines to the file, under a header where it is new."""
    beds, new = list(beds), not FILE.exists()
    with FILE.open("a", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, list(beds[0]), lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in bed.items()} for bed in beds
        )


def _number(text: str) -> str | float:
    try:
        return float(text)
    except ValueError:
        return text
