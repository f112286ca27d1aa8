"""The fit: a search by optax and a second-order finish, for any residuals of positive quantities.

The fit knows no physics: `residuals` maps a pytree of positive numbers to a vector of
(prediction - measurement) / standard deviation. All work is done in logarithms. There a product of
factors is a sum, and a log-normal prior is one more residual. The search finds the valley. Standard
errors and the last digits need the Levenberg-Marquardt finish. Only the model is compiled, as one
program for residuals and Jacobian; the rest is arithmetic of numpy on a few numbers. Python answers
Ctrl-C between two calls of the program.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import optax
from jax import Array
from jax.typing import ArrayLike

from calibrate.least_squares.bounds import Bounds
from calibrate.least_squares.evaluator import Evaluator, half_square, progress_bar
from calibrate.least_squares.finish import SETTLED_BELOW, finish, is_converged, is_settled
from calibrate.least_squares.finite_differences import FiniteDifferences, Slopes
from calibrate.least_squares.interruptible import stoppable
from calibrate.least_squares.kinks import without_slopes
from calibrate.least_squares.levenberg import Point
from calibrate.least_squares.optima import Optimum, distinct, optimum
from calibrate.least_squares.priors import LogNormal
from calibrate.least_squares.programs import (
    Programs,
    count_residuals,
    given_with,
    one_by_one,
    over_starts,
    prepared,
    recalled,
    remembered,
)
from calibrate.least_squares.search import Searched, search
from calibrate.least_squares.unknowns import Unknowns, unknowns
from mrjax.core.promotion import relaxed_promotion
from mrjax.io.checkpoint import Checkpoint, refuse_foreign

RECALLED = 4
"""Results of the model in memory, for each start."""


@dataclass(frozen=True)
class Fit:
    """The result of a fit: the values, and residuals and Jacobian there."""

    theta: Any
    """The fitted values, in the structure of the start."""
    names: tuple[str, ...]
    """A name for each of the P values, in their order in the arrays below."""
    values: np.ndarray
    """The fitted values, (P,)."""
    residuals: np.ndarray
    """Residuals of the M measurements, in standard deviations, (M,)."""
    jacobian: np.ndarray
    """Derivatives of the residuals with respect to the logarithms of the values, (M, P)."""
    prior_precision: np.ndarray
    """1 / log_standard_deviation^2 of each prior, 0 without one, (P,)."""
    loss: np.ndarray
    """Half the sum of squares, priors included, before each search step and at the end."""
    converged: bool
    """True if another Gauss-Newton step (at a kink, a simplex restart) gains nothing measurable."""
    on_a_kink: bool
    """True if slopes jump at the optimum: the Jacobian here is then that of one side."""
    model_runs: int
    """Number of evaluations of the residuals, with or without their Jacobian."""
    everything: Callable[[ArrayLike, Any], Array]
    """Function from logarithms of the values, (P,), and `given` to the residuals of measurements
    and priors, (M + K,)."""
    linearised: Callable[[ArrayLike, Any], tuple[Array, Array]]
    """Compiled function of the same arguments to the Jacobian, (M + K, P), and the residuals."""
    given: Any
    """Data and priors, as both functions take them."""
    robust: float | None = None
    """Standard deviations beyond which residuals count linearly; None if all are squared. Residuals
    and Jacobian here are those that count."""
    optima: tuple[Optimum, ...] = ()
    """All optima that were found, this fit first."""
    places: int = 1
    """Number of points from which an optimum was searched."""
    box: Bounds = Bounds(np.array(-np.inf), np.array(np.inf))
    """Bounds of the logarithms, (P,)."""
    slopes: Slopes | None = None
    """Record of slopes by finite differences; None if JAX gives them."""

    def at(self, logs: np.ndarray) -> Point:
        """Residuals and slopes, priors included, at logarithms of the values, (P,)."""
        jacobian, value = map(np.asarray, self.linearised(logs, self.given))
        return Point(half_square(value), logs, jacobian, value)

    @property
    def chi_squared(self) -> float:
        """Sum of squares of the residuals of the measurements, without the priors."""
        return float(self.residuals @ self.residuals)

    @property
    def other_optima(self) -> tuple[tuple[float, np.ndarray], ...]:
        """Half the sum of squares and the values, (P,), of all optima but this fit."""
        return tuple((optimum.loss, optimum.values) for optimum in self.optima[1:])


def fit(
    residuals: Callable[..., Array],
    start: Any,
    *,
    data: Any = None,
    priors: dict[str, LogNormal] | None = None,
    bounds: dict[str, tuple[float, float]] | None = None,
    optimizer: optax.GradientTransformation | None = None,
    starts: int = 1,
    also: Sequence[Any] = (),
    seed: int = 0,
    robust: float | None = None,
    differentiable: bool = True,
    step: float | None = None,
    search_steps: int = 60,
    finish_steps: int = 20,
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> Fit:
    """Fits positive values by least squares with log-normal priors.

    Every step is the shortest that fits. So a value stays at its start if neither residuals nor
    priors determine it.

    Args:
      residuals: function from a pytree like `start` to a vector (M,), in standard deviations. It is
        traced by `jit` and differentiated in forward mode.
      start: a pytree of positive numbers, such as {"f_w": 49.0, "f_s": 1.1}.
      data: second argument of `residuals`, a pytree of arrays; by default there is none. Fits to
        other data of the same shapes share their compiled programs.
      priors: priors by name.
      bounds: smallest and largest value by name; 0 and infinity are no bounds.
      optimizer: optax optimizer of the search, over the logarithms; by default `optax.adam(0.3)`.
      starts: number of searches side by side: the first from `start`, the others drawn from the
        priors, or about `start` without a prior. The best is kept, and all optima are reported.
      also: further pytrees like `start` from which searches begin, one after another.
      seed: seed of the drawn starts.
      robust: residuals beyond this many standard deviations count linearly, not squared
        (pseudo-Huber); by default all are squared.
      differentiable: False for residuals that JAX cannot trace, such as those of numpy or of
        another program. They are called with numbers, and their slopes are central differences. The
        search turns back where they raise or are not finite.
      step: step of those differences in each logarithm; by default it is chosen at the start.
      search_steps: most steps of the search, which ends as soon as Gauss-Newton steps can be
        trusted; that may be at once.
      finish_steps: most steps of Levenberg-Marquardt.
      progress: whether to show iterations and chi-squared, on standard error.
      checkpoint: folder that stores the results of the residuals. A later call with the same
        arguments, on the same machine, goes on from there, and gives the same bits; so do profiles
        of the fit. The folder stays until it is removed.

    Returns:
      a Fit; look at `converged` before using it.

    Raises:
      InputError: a start, prior or bound that cannot be used, or one for no parameter; two
        parameters of one name; no residuals, or ones that are no vector of one size; a checkpoint
        of another fit.

    Example:
      >>> at = jnp.array([1.0, 2.0, 4.0])
      >>> def residuals(theta):
      ...     return (theta["slope"] * at - jnp.array([6.1, 12.0, 23.9])) / 0.1
      >>> fit = calibrate.fit(residuals, {"slope": 1.0})
      >>> fit.converged, fit.values.round(3)
      (True, array([5.986]))
    """
    refuse_foreign(checkpoint)
    optimizer = optax.with_extra_args_support(optimizer or optax.adam(0.3))
    unknown = unknowns(start, priors or {}, bounds or {})
    differences = None if differentiable else FiniteDifferences(residuals, unknown, robust, step)
    programs = differences.programs if differences else prepared(residuals, unknown, data, robust)
    given = given_with(unknown, data)
    further = [unknowns(other_start, {}, bounds or {}).starts(1, seed) for other_start in also]
    all_starts = np.vstack([unknown.starts(starts, seed), *further])
    with stoppable(), relaxed_promotion(), progress_bar(progress) as bar:
        count = count_residuals(programs, all_starts[0], given) - len(unknown.with_prior)
        keeping = _storage(
            checkpoint,
            start=dict(zip(unknown.names, unknown.values, strict=True)),
            priors=priors,
            bounds=bounds,
            starts=all_starts,
            seed=seed,
            robust=robust,
            search_steps=search_steps,
            finish_steps=finish_steps,
            step=step,
            data=jax.tree.leaves(data),
            # These tell this fit from all others.
            residuals_at_the_start=lambda: programs.linearised(all_starts[0], given)[1],
        )
        jacobian = recalled(keeping("jacobian", programs.linearised), RECALLED * len(all_starts))
        storing = Programs(programs.traceable, keeping("residuals", programs.everything), jacobian)
        together = len(all_starts) if starts > 1 and differentiable else 1
        linear = _linearise_all(programs, storing, given, together, keeping)
        evaluator = Evaluator(storing, given, unknown.box, bar)
        searched = search(programs, evaluator, all_starts, linear, optimizer, search_steps)
        end = _end(evaluator, _with_better_points(evaluator, searched), all_starts[0], finish_steps)
    return Fit(
        **_at_the_end(end, unknown, count, searched.losses),
        model_runs=searched.runs + end.model_runs,
        places=len(all_starts),
        robust=robust,
        everything=programs.traceable,
        linearised=storing.linearised,
        given=given,
        slopes=differences.slopes_at(end.best.logs, given) if differences else None,
    )


def _linearise_all(
    programs: Programs, storing: Programs, given: Any, together: int, keeping: Callable
) -> Callable:
    """Function from logarithms of all searches, (S, P), to their Jacobians and residuals.

    Args:
      programs: the programs of the fit.
      storing: the same programs, with their results stored.
      given: arguments beside the logarithms. They are passed by position: JAX would compile again
        for keywords.
      together: number of searches that one program runs side by side; 1 to run them in turn.
      keeping: function that stores the results of a program under a label.
    """
    if together == 1:
        return one_by_one(lambda logs: storing.linearised(logs, given))
    return keeping(
        "jacobians", over_starts(lambda logs: programs.linearised(logs, given), together)
    )


class _End(NamedTuple):
    """The result of all searches."""

    best: Point
    others: list[Point]
    """Ends at other optima."""
    converged: bool
    on_a_kink: bool
    model_runs: int

    def optima(self, count: int) -> tuple[Optimum, ...]:
        """All optima; the first `count` residuals are those of measurements."""
        return tuple(optimum(end, count) for end in (self.best, *self.others))


def _with_better_points(evaluator: Evaluator, searched: Searched) -> np.ndarray:
    """Ends of the searches, (S, P), and points that they met before and that are better.

    At an optimum rounding hides the expected gain of a step, so that a search may leave it.
    """
    better_points = [
        best
        for end, best, least in zip(searched.ends, searched.best, searched.least, strict=True)
        if least < evaluator.at(end).loss
    ]
    return np.vstack([searched.ends, *better_points])


def _end(evaluator: Evaluator, places: np.ndarray, start: np.ndarray, most_steps: int) -> _End:
    """The best end of the searches, (S, P), found without slopes if need be."""
    ends: list[Point] = []
    first_points, runs = sorted(map(evaluator.at, places), key=lambda end: end.loss), 0
    for end in first_points:
        # A settled end that is worse than the best stays worse.
        settled = bool(ends) and is_settled(end, evaluator.box)
        if not settled or end.loss - 0.5 * SETTLED_BELOW < ends[0].loss:
            end, more_runs = finish(evaluator, end.logs, most_steps)
            runs += more_runs - 1
        runs += 1
        ends.append(end)
    best, *others = distinct(ends, start, evaluator.box, evaluator.at)
    converged, on_a_kink = is_converged(best, evaluator.box), False
    if not converged and best.finite:
        best, on_a_kink, more_runs = without_slopes(evaluator, best)
        converged = on_a_kink or is_converged(best, evaluator.box)
        runs += more_runs
    return _End(best, others, converged, on_a_kink, runs)


def _at_the_end(end: _End, unknown: Unknowns, count: int, losses: list[float]) -> dict[str, Any]:
    """Fields of a `Fit` at its end; its first `count` residuals are those of measurements."""
    loss, logs, jacobian, value = end.best
    with np.errstate(over="ignore"):
        values = np.exp(logs)
    # If no prediction depends on any value, the end is an optimum of the priors alone.
    informed = bool(np.any(jacobian[:count] != 0.0)) or bool((unknown.precision > 0.0).all())
    return {
        "theta": unknown.tree(values),
        "names": unknown.names,
        "values": values,
        "residuals": value[:count],
        "jacobian": jacobian[:count],
        "prior_precision": unknown.precision,
        "loss": np.array([*losses, loss]),
        "converged": end.converged and bool(np.isfinite(values).all()) and informed,
        "on_a_kink": end.on_a_kink,
        "optima": end.optima(count),
        "box": unknown.box,
    }


def _storage(
    checkpoint: str | Path | None, residuals_at_the_start: Callable[[], Array], **work: Any
) -> Callable[[str, Callable], Callable]:
    """A wrapper that stores results of a program under a label; none without a checkpoint.

    Args:
      checkpoint: the folder.
      residuals_at_the_start: function that gives them; it is called only with a checkpoint.
      work: arguments that tell this fit from others.
    """
    if checkpoint is None:
        return lambda _, function: function
    at_start = residuals_at_the_start()
    stored = Checkpoint.open(Path(checkpoint), **work, residuals_at_the_start=at_start)
    return partial(remembered, stored)
