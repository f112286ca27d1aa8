"""How long a call takes, and the spread of several."""

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np


def seconds(call: Callable[[], Any]) -> float:
    """Until its result is there."""
    began = time.perf_counter()
    jax.block_until_ready(call())
    return time.perf_counter() - began


def spread(values: list[float]) -> dict[str, float]:
    """Median, least and greatest."""
    return {
        "median": float(np.median(values)),
        "least": float(np.min(values)),
        "greatest": float(np.max(values)),
    }


def ratios(one: list[float], other: list[float]) -> dict[str, float]:
    """Of pairs that were measured one right after the other."""
    return spread([a / b for a, b in zip(one, other, strict=True)])
