"""Evaluation of the model for all stages of a fit, with their common progress bar."""

from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.levenberg import Point
from calibrate.least_squares.programs import Given, Programs


class Evaluator(NamedTuple):
    """Evaluates the model for all stages of a fit, and shows their progress."""

    programs: Programs
    given: Given
    box: Bounds
    bar: tqdm

    def at(self, logs: np.ndarray) -> Point:
        """Residuals and slopes at logarithms, (P,); one run of the model."""
        jacobian, value = map(np.asarray, self.programs.linearised(logs, self.given))
        return Point(half_square(value), logs, jacobian, value)

    def tell(self, stage: str, loss: float) -> None:
        """Shows one more iteration, with the best chi-squared so far."""
        self.bar.set_description_str(stage, refresh=False)
        self.bar.set_postfix_str(f"chi-squared {2.0 * loss:.6g}", refresh=False)
        self.bar.update()


def progress_bar(progress: bool) -> tqdm:
    """The bar of a fit, on standard error."""
    return tqdm(
        desc="search",
        disable=not progress,
        leave=False,
        bar_format="fit: {desc}, iteration {n}, {elapsed}{postfix}",
    )


def half_square(value: np.ndarray) -> float:
    """Half the sum of squares; infinite if it is not a number."""
    with np.errstate(over="ignore", invalid="ignore"):
        loss = 0.5 * float(value @ value)
    return loss if np.isfinite(loss) else np.inf


def finite(*arrays: np.ndarray) -> bool:
    """True if all numbers of all arrays are finite."""
    return all(bool(np.isfinite(array).all()) for array in arrays)
