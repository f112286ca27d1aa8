"""Measures sigma(phi) of case 2's particles under several conditions, into `curves.csv`."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import mrjax
from mrjax.simulation import compression_fit
from mrjax.simulation.compressive_yield import LEAST_STRESS

DATA = Path(__file__).parent / "curves.csv"
COLUMNS = (
    "condition",
    "seed",
    "volume_fraction",
    "stress",
    "lateral",
    "coordination",
    "unbalanced",
)
RANGE = 0.03
"""Range of the attraction of the softened contacts, in radii."""
LAYER = 14e-9
"""Thickness of the layer on a particle, m: Bond number 9.9."""


class Condition(NamedTuple):
    """Conditions of some starts."""

    words: str
    rolling: float = 0.0
    layer: float = LAYER
    seeds: tuple[int, ...] = (0, 1)
    options: dict[str, Any] = {}  # noqa: RUF012 - never changed


CONDITIONS = {
    "base": Condition("Bond number 10, friction 0.3", seeds=(0, 1, 2, 3)),
    "rolling": Condition("rolling friction 0.1", rolling=0.1, seeds=(0, 1, 2, 3)),
    "bond_100": Condition("Bond number 100", layer=LAYER / np.sqrt(10.0)),
    "overlap": Condition("half the overlap", options={"overlap": 0.01}),
    "strain": Condition("half the strain step", options={"strain": 0.015}),
    "rest": Condition("a third of the unbalanced force", options={"rest": 1e-3}),
    "many": Condition("800 particles", options={"particles": 800}),
}
"""The first is what the others are compared with, in one thing each."""


def recipe(condition: Condition) -> mrjax.Recipe:
    """Case 2 with attraction, and rolling friction if the condition has it."""
    sheet = mrjax.Recipe.load("case2")
    attraction = {"hamaker": 1e-19, "layer_thickness": condition.layer, "range": RANGE}
    contact = sheet.contact.model_copy(update={"rolling_friction": condition.rolling})
    return sheet.replace(attraction=attraction).model_copy(update={"contact": contact})


def measure(name: str) -> mrjax.CompressiveYield:
    """The curve of a condition."""
    condition = CONDITIONS[name]
    return mrjax.compressive_yield(recipe(condition), condition.seeds, **condition.options)


def rows(name: str, result: mrjax.CompressiveYield) -> Iterator[list[Any]]:
    """Rows of the data; stresses are over F_c / d^2."""
    for start, seed in enumerate(result.seeds):
        for place, fraction in enumerate(result.volume_fraction):
            yield [
                name,
                seed,
                f"{fraction:.6f}",
                f"{result.stresses[start, place] / result.scale:.5g}",
                f"{result.lateral_stresses[start, place] / result.scale:.5g}",
                f"{result.coordination[start, place]:.4g}",
                f"{result.unbalanced[start, place]:.3g}",
            ]


def write(names: list[str]) -> None:
    """Measures conditions, and replaces their rows of the data."""
    kept = []
    for name in names:
        new = list(rows(name, measure(name)))
        kept = [row for row in _stored() if row[0] != name] + new
        order = list(CONDITIONS)
        kept.sort(key=lambda row: order.index(row[0]))
        with DATA.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([COLUMNS, *kept])


def _stored() -> list[list[str]]:
    if not DATA.exists():
        return []
    with DATA.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))[1:]


class Curve(NamedTuple):
    """The data of a condition; stresses over F_c / d^2."""

    volume_fraction: np.ndarray  # (K,)
    stress: np.ndarray  # (M, K)
    lateral: np.ndarray  # (M, K)
    coordination: np.ndarray  # (M, K)


def curves() -> dict[str, Curve]:
    """The stored curves by condition."""
    stored = _stored()
    found = {}
    for name in dict.fromkeys(row[0] for row in stored):
        own = np.array([[float(cell) for cell in row[1:]] for row in stored if row[0] == name])
        by_seed = [own[own[:, 0] == seed] for seed in np.unique(own[:, 0])]
        columns = (np.stack([one[:, place] for one in by_seed]) for place in (2, 3, 4))
        found[name] = Curve(by_seed[0][:, 1], *columns)
    return found


def fit(curve: Curve) -> compression_fit.CompressionFit:
    """The law of a curve; its stress over F_c / d^2."""
    return compression_fit.fit_compression(curve.volume_fraction, curve.stress, LEAST_STRESS)
