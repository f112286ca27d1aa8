"""Cheap work for checkpoints: a walk in pieces, and three balls in a box."""

from pathlib import Path

import numpy as np

import mrjax
from mrjax.io.checkpoint import Checkpoint
from tests.builders.particles import light_balls

BALLS = light_balls()
START = mrjax.place([[2e-5] * 3, [1e-5] * 3, [3e-5] * 3])
BOX = mrjax.Box((4e-5,) * 3)
PIECES = 5


def walk(folder: Path, seed: int = 0, until: int = PIECES) -> np.ndarray:
    """Cheap work in pieces: numbers that hang on all before them; and one piece of its own."""
    work = Checkpoint.open(folder, seed=seed)
    if (first := work.load("first")) is None:
        work.save("first", {"x": np.array([0.1 + seed])}, {"of": "walk"})
        first = work.load("first")
    sequence = work.sequence("part")
    pieces, state = sequence.resumed()
    now = first[0]["x"] if state is None else state["now"]
    walked = [piece["x"] for piece in pieces]
    while len(walked) < until:
        steps = np.array([now, now := 3.9 * now * (1.0 - now)])
        sequence.append({"x": steps, "n": np.arange(3)}, {"now": now})
        walked.append(steps)
    return np.concatenate([first[0]["x"][None], *walked])
