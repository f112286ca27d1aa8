"""Messages of a long call: a notice before it begins, a progress bar while it runs."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm

from mrjax.core.units import time_in_words
from mrjax.simulation.pieces import PiecewiseRun

LONG = 60.0
"""Expected length of a call above which it is announced, s."""
_log = logging.getLogger("mrjax.progress")


def expected_seconds(steps: float, particles: int) -> float:
    """Expected time of steps on one core of a processor of 2024, s.

    A step costs 2 us and 80 ns a particle in a bed; a suspension takes half of it
    (`python -m tests.studies.benchmarks.speed`).
    """
    return steps * (2e-6 + 8e-8 * particles)


def announce(call: str, steps: float, particles: int) -> None:
    """Announces a call of more than a minute, through the logger `mrjax.progress`.

    Args:
      call: name of the function.
      steps: approximate number of steps.
      particles: N.
    """
    seconds = expected_seconds(steps, particles)
    if seconds > LONG:
        _log.warning(
            "%s takes %.2g steps of %d particles, about %s on one core; a longer step (softer "
            "contacts, mrjax.softened), a shorter duration or fewer particles make it shorter",
            call,
            steps,
            particles,
            time_in_words(seconds),
        )


@contextmanager
def watched(call: str, pieces: PiecewiseRun, progress: bool) -> Iterator[Callable[[int], object]]:
    """Shows a progress bar for a run of given duration: steps, physical time and remaining time.

    It yields a function that is called with the number of steps of every piece.

    Args:
      call: name of the function.
      pieces: the run, at its start or resumed.
      progress: whether to show the bar.
    """
    total = pieces.plan.schedule.total
    announce(call, total - pieces.steps, pieces.particles)
    with tqdm(
        total=total,
        initial=pieces.steps,
        desc=call,
        unit=" steps",
        disable=not progress,
        bar_format="{desc} {percentage:3.0f} % |{bar:20}| {n_fmt} of {total_fmt} steps, "
        "{remaining} left{postfix}",
        unit_scale=True,
    ) as bar:

        def watch(steps: int) -> None:
            bar.set_postfix_str(f"{pieces.done * pieces.frame_length:.3g} s", False)
            bar.update(steps)

        yield watch
