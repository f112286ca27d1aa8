"""A search by optax and a second-order finish, over any residuals of positive quantities.

Knows nothing of the physics: `residuals` maps a pytree of positive numbers to a vector of
(prediction - measurement) / standard deviation. All work is done in logarithms, where a product of
factors is a sum and a log-normal prior one more residual. The search finds the valley; error bars
and the last digits need the Levenberg-Marquardt finish. All but the forward model is arithmetic on
a few numbers and left to numpy: one compiled program, Jacobian and residuals, serves throughout,
and between two calls of it Python answers Ctrl-C.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jax import Array
from jax.typing import ArrayLike
from scipy.optimize import OptimizeResult, minimize
from tqdm import tqdm

from calibrate.least_squares import levenberg
from calibrate.least_squares.interruptible import stoppable, watched
from calibrate.least_squares.levenberg import Bounds, Point
from mrjax import InputError
from mrjax.core import randomness
from mrjax.core.promotion import relaxed_promotion
from mrjax.io.checkpoint import Checkpoint, digest, refuse_foreign

CONVERGED_BELOW = 1e-4
"""Expected gain in chi-squared of one more Gauss-Newton step at which a fit counts as converged:
0.01 standard deviations. A smooth model ends far below it, one with kinks may not."""
FOUND_AGAIN_WITHIN = 1e-2
"""What a second simplex may gain in chi-squared where the optimum is on a kink: 0.1 standard
deviations."""
SIMPLEX, SIMPLEX_ENDS = 0.5, 0.03
"""Size of a simplex at first, and where it has found an optimum; standard errors."""

TRUSTED_FROM = 0.25
"""Part of the decrease that a Gauss-Newton step promises which it must bring for the search to have
found the valley."""
MOST_FOR_EACH = 50
"""Most runs of a simplex, for each value."""
AGAIN = 10
"""Most steps of Levenberg-Marquardt from where a simplex led: few from near a smooth optimum."""
ASIDE = 0.3, 0.1
"""Where slopes are compared; standard errors. Of a smooth model they differ by a third at a third
of the distance."""
LONGEST_ERROR = 7.0
"""Size of a simplex in logarithms, at most."""
HOPELESS = 1e-6
"""Distance in logarithms to where a prediction was possible at which a start is given up."""
AT_ONCE = 8
"""Models that are run side by side, for as many starts."""
SPREAD = 0.7
"""Standard deviation of further starts about the first in each logarithm, where no prior says."""


class LogNormal(NamedTuple):
    """A prior: ln(x / median) is normal with this standard deviation."""

    median: float
    log_standard_deviation: float


@dataclass(frozen=True)
class Fit:
    """Where a fit ended, and what the residuals look like there."""

    theta: Any
    """The fitted values, in the structure of the start."""
    names: tuple[str, ...]
    """A name for each of the P values, in their order in the arrays below."""
    values: np.ndarray
    """The fitted values, (P,)."""
    residuals: np.ndarray
    """Of the M measurements, in standard deviations, (M,)."""
    jacobian: np.ndarray
    """Derivative of those with respect to the logarithms of the values, (M, P)."""
    prior_precision: np.ndarray
    """1 / log_standard_deviation^2 of each prior, 0 without one, (P,)."""
    loss: np.ndarray
    """Half the sum of squares, priors included, before each search step and at the end."""
    converged: bool
    """Whether a further Gauss-Newton step would gain next to nothing, or on a kink a simplex."""
    on_a_kink: bool
    """Whether slopes jump at the optimum, so that the Jacobian here is that of one side."""
    model_runs: int
    """Evaluations of the residuals, each with their Jacobian or alone."""
    everything: Callable[[ArrayLike, Any], Array]
    """Residuals of measurements and priors, (M + K,), for logarithms of the values, (P,), and
    `given`."""
    linearised: Callable[[ArrayLike, Any], tuple[Array, Array]]
    """Their Jacobian and they themselves, of the same; compiled."""
    given: Any
    """Data and priors, as both take them."""
    robust: float | None = None
    """Standard deviations beyond which residuals count linearly; those here are as they count."""
    other_optima: tuple[tuple[float, np.ndarray], ...] = ()
    """Where further starts ended otherwise: half the sum of squares and the values, (P,)."""
    box: Bounds = Bounds(np.array(-np.inf), np.array(np.inf))
    """Bounds of the logarithms, (P,)."""

    @property
    def chi_squared(self) -> float:
        """Sum of squares of the residuals of the measurements, without the priors."""
        return float(self.residuals @ self.residuals)


def fit(
    residuals: Callable[..., Array],
    start: Any,
    *,
    data: Any = None,
    priors: dict[str, LogNormal] | None = None,
    bounds: dict[str, tuple[float, float]] | None = None,
    optimizer: optax.GradientTransformation | None = None,
    starts: int = 1,
    seed: int = 0,
    robust: float | None = None,
    search_steps: int = 60,
    finish_steps: int = 20,
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> Fit:
    """Least squares with log-normal priors.

    What neither residuals nor priors tell of stays where it began: every step is the shortest.

    Args:
      residuals: from a pytree like `start` to a vector (M,), in standard deviations. Traced by
        `jit` and differentiated forwards.
      start: a pytree of positive numbers, such as {"f_w": 49.0, "f_s": 1.1}.
      data: arrays that `residuals` takes as its second argument; left out, it takes none. Fits to
        other data of the same shapes share their compiled programs.
      priors: by name, where there are any.
      bounds: least and greatest value by name, where there are any: 0 and infinity are none.
      optimizer: of the search, over the logarithms; left out, `optax.adam(0.3)`.
      starts: searches side by side, the first from `start`, the others drawn about it from the
        priors; the best is kept.
      seed: of those others.
      robust: residuals beyond this many standard deviations count linearly, not squared
        (pseudo-Huber); left out, all are squared.
      search_steps: most steps of the search; it ends, or is left out, as soon as Gauss-Newton steps
        are to be trusted.
      finish_steps: most steps of Levenberg-Marquardt.
      progress: whether to show iterations and chi-squared, on standard error.
      checkpoint: folder that keeps what the residuals gave. Called again with it and the same
        arguments, on the same machine, the fit goes on, and ends with the same bits; so do
        profiles of it. It stays until it is removed.

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
    names = _names(start)
    leaves, structure = jax.tree.flatten(start)
    values = np.concatenate([np.ravel(leaf).astype(float) for leaf in leaves])
    _refuse_unusable(names, values, priors or {}, bounds or {})
    box = _box(names, bounds or {})
    median, precision = _prior_arrays(names, priors or {})
    held = tuple(int(place) for place in np.flatnonzero(precision))
    places = np.array(held, int)
    given = _Given(data, np.log(median[places]), np.sqrt(precision[places]))
    shapes = tuple(np.shape(leaf) for leaf in leaves)
    compiled = _compiled(residuals, structure, shapes, held, robust, data is None)
    each = box.clip(_starts(np.log(values), precision, starts, seed))
    with stoppable(), relaxed_promotion(), _bar(progress) as bar:
        count = _vector(compiled, each[0], given) - len(held)
        asked, keeping = compiled, lambda _, function: function
        if checkpoint is not None:
            work = Checkpoint.of_work(
                Path(checkpoint),
                start=dict(zip(names, values, strict=True)),
                priors=priors,
                bounds=bounds,
                starts=starts,
                seed=seed,
                robust=robust,
                search_steps=search_steps,
                finish_steps=finish_steps,
                data=jax.tree.leaves(data),
                # What no other fit has in common with this one.
                residuals_at_the_start=compiled.linearised(each[0], given)[1],
            )
            keeping = partial(_remembered, work)
            asked = _Compiled(
                compiled.traceable,
                keeping("residuals", compiled.everything),
                keeping("jacobian", compiled.linearised),
            )
        # By name, the data would be another call to JAX, and compiled again.
        linear = _of_each(lambda logs: asked.linearised(logs, given), 1)
        if starts > 1:
            many = _of_each(lambda logs: compiled.linearised(logs, given), starts)
            linear = keeping("jacobians", many)
        asking = _Asking(asked, given, box, bar)
        each, losses, runs = _search(compiled, asking, each, linear, optimizer, search_steps)
        ends = []
        for logs in each:
            end, finish_runs = _finish(asking, logs, finish_steps)
            runs += finish_runs
            ends.append(end)
        best, *others = sorted(ends, key=lambda end: end.loss)
        converged = _expects_nothing(best, box)
        on_a_kink = False
        if not converged and best.finite:
            best, on_a_kink, more_runs = _without_slopes(asking, best)
            converged = on_a_kink or _expects_nothing(best, box)
            runs += more_runs
    loss, logs, jacobian, value = best
    with np.errstate(over="ignore"):
        fitted = np.exp(logs)
    converged = converged and bool(np.isfinite(fitted).all())
    # Where no prediction depends on anything, the end is no optimum of the data.
    converged = converged and bool(np.any(jacobian[:count] != 0.0))
    return Fit(
        theta=_tree(fitted, structure, shapes),
        names=names,
        values=fitted,
        residuals=value[:count],
        jacobian=jacobian[:count],
        prior_precision=precision,
        loss=np.array([*losses, loss]),
        converged=converged,
        on_a_kink=on_a_kink,
        model_runs=runs,
        robust=robust,
        other_optima=tuple(
            (other.loss, np.exp(other.logs))
            for other in others
            if np.isfinite(other.loss) and other.loss - loss > 0.5  # by chi-squared of one
        ),
        everything=compiled.traceable,
        linearised=asked.linearised,
        given=given,
        box=box,
    )


class _Given(NamedTuple):
    """What a compiled fit takes beside the values."""

    data: Any
    median: np.ndarray  # logarithms of the priors' medians, (K,)
    weight: np.ndarray  # 1 / log_standard_deviation of the priors, (K,)


class _Asking(NamedTuple):
    """What the stages of a fit have in common."""

    compiled: "_Compiled"
    given: _Given
    box: Bounds
    bar: tqdm

    def at(self, logs: np.ndarray) -> Point:
        """Residuals and slopes at logarithms, (P,); one run of the model."""
        jacobian, value = map(np.asarray, self.compiled.linearised(logs, self.given))
        return Point(_half_square(value), logs, jacobian, value)

    def tell(self, stage: str, loss: float) -> None:
        """Shows one more iteration, and how good the best so far is."""
        self.bar.set_description_str(stage, refresh=False)
        self.bar.set_postfix_str(f"chi-squared {2.0 * loss:.6g}", refresh=False)
        self.bar.update()


def _bar(progress: bool) -> tqdm:
    return tqdm(
        desc="search",
        disable=not progress,
        leave=False,
        bar_format="fit: {desc}, iteration {n}, {elapsed}{postfix}",
    )


class _Compiled(NamedTuple):
    """The programs of a fit: of logarithms, (P,), and what is given."""

    traceable: Callable[[ArrayLike, _Given], Array]  # for programs that have it within
    everything: Callable[[ArrayLike, _Given], Array]  # residuals and priors, (M + K,)
    linearised: Callable[[ArrayLike, _Given], tuple[Array, Array]]  # Jacobian and residuals


@lru_cache(maxsize=16)
def _compiled(
    residuals: Callable[..., Array],
    structure: Any,
    shapes: tuple[tuple[int, ...], ...],
    held: tuple[int, ...],
    robust: float | None,
    without_data: bool,
) -> _Compiled:
    """Those of residuals of a pytree of this structure, with priors on the `held` values."""
    places = np.array(held, int)

    @jax.jit
    def everything(logs: Array, given: _Given) -> Array:
        theta = _tree(jnp.exp(logs), structure, shapes)
        found = jnp.atleast_1d(residuals(theta) if without_data else residuals(theta, given.data))
        if found.ndim != 1 or not found.size:
            raise InputError(
                f"residuals: have shape {found.shape}; give a vector of at least one, "
                "(prediction - measurement) / standard deviation of each measurement"
            )
        if robust is not None:
            found = pseudo_huber(found, robust)
        return jnp.concatenate([found, given.weight * (logs[places] - given.median)])

    def with_value(logs: Array, given: _Given) -> tuple[Array, Array]:
        value = everything(logs, given)
        return value, value

    linearised = watched(jax.jit(jax.jacfwd(with_value, has_aux=True)))
    return _Compiled(everything, watched(everything), linearised)


def _tree(values: Array, structure: Any, shapes: tuple[tuple[int, ...], ...]) -> Any:
    """Values, (P,), in a pytree."""
    sizes = [math.prod(shape) for shape in shapes]
    leaves = [
        values[end - size : end].reshape(shape)
        for end, size, shape in zip(np.cumsum(sizes), sizes, shapes, strict=True)
    ]
    return jax.tree.unflatten(structure, leaves)


def pseudo_huber(residuals: Array, longest: float) -> Array:
    """Residuals whose squares are 2 d^2 (sqrt(1 + (r/d)^2) - 1): r near zero, else sqrt(2 d r)."""
    size = jnp.sqrt(1.0 + (residuals / longest) ** 2)
    return residuals * jnp.sqrt(2.0 / (1.0 + size))


def _starts(first: np.ndarray, precision: np.ndarray, starts: int, seed: int) -> np.ndarray:
    """Logarithms where the searches begin, (S, P)."""
    if starts == 1:
        return first[None]
    spread = np.where(precision > 0.0, 1.0 / np.sqrt(np.maximum(precision, 1e-300)), SPREAD)
    with randomness.ordered():
        drawn = np.asarray(jax.random.normal(randomness.key(seed), (starts - 1, first.size)))
    return np.concatenate([first[None], first[None] + spread[None] * drawn])


def _half_square(value: np.ndarray) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        loss = 0.5 * float(value @ value)
    return loss if np.isfinite(loss) else np.inf


def _remembered(work: Checkpoint, name: str, function: Callable) -> Callable:
    """A compiled function of logarithms, and of what is given, that keeps what it gave."""

    def remembered(logs: np.ndarray, *given: _Given) -> Any:
        called = f"{name}-{digest(logs)}"
        if (kept := work.kept(called)) is not None:
            found = list(kept[0].values())
        else:
            found = jax.tree.leaves(function(logs, *given))
            work.keep(called, {str(place): array for place, array in enumerate(found)})
        return found[0] if len(found) == 1 else tuple(found)

    return remembered


def _search(
    compiled: _Compiled,
    asking: _Asking,
    each: np.ndarray,
    linear: Callable,
    optimizer: optax.GradientTransformationExtraArgs,
    most_steps: int,
) -> tuple[np.ndarray, list[float], int]:
    """Optax over the logarithms, (S, P), until all are in a valley; they, best losses and runs."""
    state = jax.jit(jax.vmap(optimizer.init))(each)
    losses: list[float] = []
    runs = 0

    def loss_of(logs: Array) -> Array:
        value = compiled.traceable(logs, asking.given)
        return 0.5 * value @ value

    def updated(logs: Array, state: Any, value: Array, jacobian: Array) -> tuple[Array, Any]:
        gradient = jacobian.T @ value
        change, state = optimizer.update(
            gradient, state, logs, value=0.5 * value @ value, grad=gradient, value_fn=loss_of
        )
        return optax.apply_updates(logs, change), state

    update = _of_each(jax.jit(updated), len(each))
    found = np.zeros(len(each), bool)
    sound = each.copy()  # where something could be predicted last, or Gauss-Newton leads
    for _ in range(most_steps):
        jacobian, value = linear(each)
        runs += int((~found).sum())
        losses.append(min(losses[-1:] + [_half_square(one) for one in value]))
        asking.tell("search", losses[-1])
        finite = np.array([_finite(*one) for one in zip(jacobian, value, strict=True)])
        lost = ~finite & ~found
        for row in np.flatnonzero(finite & ~found):
            here = Point(_half_square(value[row]), each[row], jacobian[row], value[row])
            ahead = _trusted(asking, here)
            runs += 1
            found[row] = ahead is not None
            sound[row] = ahead if found[row] else each[row]
        # From where nothing can be predicted, halfway back to where it could.
        back = 0.5 * (each + sound)
        hopeless = lost & (np.abs(back - sound).max(axis=1) < HOPELESS)
        if (found | hopeless).all():
            break
        moving = finite & ~found
        moved, next_state = update(each, state, value, jacobian)
        state = jax.tree.map(partial(_where, moving), next_state, state)
        each = asking.box.clip(_where(moving, moved, _where(lost, back, sound)))
    return sound, losses, runs


def _where(rows: np.ndarray, new: np.ndarray, old: np.ndarray) -> np.ndarray:
    """New where a row is chosen, (S, ...)."""
    return np.where(rows.reshape(-1, *[1] * (np.ndim(new) - 1)), new, old)


def _finite(*arrays: np.ndarray) -> bool:
    return all(bool(np.isfinite(one).all()) for one in arrays)


def _of_each(function: Callable, starts: int) -> Callable:
    """A compiled function over the leading axis of all that it takes and gives, as numpy arrays.

    So many at once at most: between two calls Python sees signals.
    """
    mapped = watched(jax.jit(jax.vmap(function)))

    def of_each(*arguments: Any) -> Any:
        if starts == 1:  # not mapped: a forward model may be slower that way
            found = function(*jax.tree.map(lambda leaf: leaf[0], arguments))
            return jax.tree.map(lambda leaf: np.asarray(leaf)[None], found)
        if starts <= AT_ONCE:
            return jax.tree.map(np.asarray, mapped(*arguments))
        found = []
        for first in range(0, starts, AT_ONCE):
            # The last of them are filled up, for one program.
            rows = np.minimum(np.arange(first, first + AT_ONCE), starts - 1)
            some = mapped(*jax.tree.map(partial(np.take, indices=rows, axis=0), arguments))
            found.append(jax.tree.map(np.asarray, some))
        return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:starts], *found)

    return of_each


def _expects_nothing(end: Point, box: Bounds) -> bool:
    return abs(levenberg.step(end, box)[1]) < CONVERGED_BELOW


def _finish(asking: _Asking, logs: np.ndarray, most_steps: int) -> tuple[Point, int]:
    """Levenberg-Marquardt; the end and the runs."""
    first = asking.at(logs)
    best = first.loss

    def at(logs: np.ndarray) -> Point:
        nonlocal best
        point = asking.at(logs)
        best = min(best, point.loss)
        asking.tell("finish", best)
        return point

    end, runs = levenberg.minimise(at, first, asking.box, most_steps)
    return end, runs + 1


def _without_slopes(asking: _Asking, end: Point) -> tuple[Point, bool, int]:
    """Nelder & Mead's simplex (scipy) in standard errors, from where slopes led no further.

    Returns: the end; whether it is an optimum on a kink: a second simplex finds no better, slopes
    lead nowhere from it, and differ to either side; and the runs.
    """
    runs, agree = 0, False
    for number, size in enumerate((SIMPLEX, -SIMPLEX, SIMPLEX)):
        found, logs = _simplex(asking, end, size)
        agree = bool(number and found.success and 2.0 * end.loss - found.fun < FOUND_AGAIN_WITHIN)
        end, more = _finish(asking, logs, AGAIN)
        if not 2.0 * end.loss <= found.fun:
            end = asking.at(logs)
        runs += found.nfev + more + 1
        if _expects_nothing(end, asking.box) or not _finite(end.jacobian):
            return end, False, runs
        if agree:
            break
    kink, more = _jumps(asking, end)
    return end, agree and kink, runs + more


def _simplex(asking: _Asking, end: Point, size: float) -> tuple[OptimizeResult, np.ndarray]:
    """What scipy finds about the end, and the logarithms of its best point, (P,)."""
    to_logs = _standard_errors(end)
    best = end.loss

    def at(errors: np.ndarray) -> np.ndarray:
        return asking.box.clip(end.logs + to_logs @ errors)

    def chi_squared(errors: np.ndarray) -> float:
        nonlocal best
        loss = _half_square(np.asarray(asking.compiled.everything(at(errors), asking.given)))
        best = min(best, loss)
        asking.tell("simplex", best)
        return 2.0 * loss

    corners = size * np.vstack([np.zeros(to_logs.shape[1]), np.eye(to_logs.shape[1])])
    most = MOST_FOR_EACH * corners.shape[1]
    options: Any = dict(
        initial_simplex=corners, xatol=SIMPLEX_ENDS, fatol=SIMPLEX_ENDS**2, maxfev=most
    )
    found = minimize(chi_squared, corners[0], method="Nelder-Mead", options=options)
    return found, at(found.x)


def _standard_errors(end: Point) -> np.ndarray:
    """Steps of one standard error along all that the data or priors determine, (P, K).

    None is longer than a factor of a thousand: one of which next to nothing is known has an error
    without end.
    """
    _, size, directions = np.linalg.svd(end.jacobian, full_matrices=False)
    seen = size > levenberg.resolved(end.jacobian) * size[0]
    return directions[seen].T * np.minimum(1.0 / size[seen], LONGEST_ERROR)


def _jumps(asking: _Asking, end: Point) -> tuple[bool, int]:
    """Whether slopes jump near an end: then they differ as much over shorter distances."""
    errors, changes = _standard_errors(end), []
    for step in ASIDE:
        sides = [
            [asking.at(end.logs + sign * step * along).jacobian @ errors for along in errors.T]
            for sign in (1.0, -1.0)
        ]
        after, before = map(np.array, sides)
        changes.append(float(np.abs(after - before).max()))
    far, near = changes
    return near > 0.6 * far, 4 * errors.shape[1]


def _trusted(asking: _Asking, here: Point) -> np.ndarray | None:
    """Where a Gauss-Newton step leads that brings the decrease it promises, else None; one run.

    Nowhere, where it promises nothing.
    """
    change, gain = levenberg.step(here, asking.box, levenberg.LONGEST)
    if gain < levenberg.DONE:
        return here.logs
    ahead = asking.at(here.logs + change)
    return ahead.logs if here.loss - ahead.loss >= TRUSTED_FROM * 0.5 * gain else None


def _names(start: Any) -> tuple[str, ...]:
    """`f_w` for a leaf start["f_w"], `f_w[1]` for its second element if it is an array."""
    names = []
    for path, leaf in jax.tree.leaves_with_path(start):
        label = jax.tree_util.keystr(path, simple=True, separator=".") or "theta"
        indices = np.ndindex(np.shape(leaf))
        names += [f"{label}[{','.join(map(str, index))}]" if index else label for index in indices]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"start: two of its parameters are called {name!r}, one by a key with a dot or "
                "brackets in it; give them names of their own"
            )
    if not names:
        raise InputError("start: has no parameters; give at least one positive number")
    return tuple(names)


def _vector(compiled: "_Compiled", logs: np.ndarray, given: "_Given") -> int:
    """How many residuals there are, priors included.

    Raises:
      InputError: none, or not a vector of one size.
    """
    try:
        shape = jax.eval_shape(compiled.traceable, logs, given).shape
    except (jax.errors.ConcretizationTypeError, jax.errors.NonConcreteBooleanIndexError) as error:
        raise InputError(
            "residuals: their number, or a choice in them, hangs on the values, so that JAX cannot "
            "compile them; give as many for all values, with jnp.where in place of `if` and of "
            "boolean indices"
        ) from error
    return int(shape[0])


def _box(names: tuple[str, ...], bounds: dict[str, tuple[float, float]]) -> Bounds:
    """Bounds of the logarithms, (P,)."""
    ends = np.array([bounds.get(name, (0.0, np.inf)) for name in names], float)
    with np.errstate(divide="ignore"):
        return Bounds(*np.log(ends.T))


def _prior_arrays(
    names: tuple[str, ...], priors: dict[str, LogNormal]
) -> tuple[np.ndarray, np.ndarray]:
    """Medians and precisions, (P,) each."""
    median = np.array([priors[n].median if n in priors else 1.0 for n in names])
    spread = np.array([priors[n].log_standard_deviation if n in priors else np.inf for n in names])
    return median, spread**-2.0


def _refuse_unusable(
    names: tuple[str, ...],
    values: np.ndarray,
    priors: dict[str, LogNormal],
    bounds: dict[str, tuple[float, float]],
) -> None:
    for name, value in zip(names, values, strict=True):
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"start of {name} = {value}: must be a positive number")
    for what, of in (("prior", priors), ("bounds", bounds)):
        for name in of:
            if name not in names:
                raise InputError(
                    f"{what} for {name!r}: no such parameter; the start has {', '.join(names)}"
                )
    for name, prior in priors.items():
        if not (0 < prior.median < np.inf and 0 < prior.log_standard_deviation < np.inf):
            raise InputError(f"prior of {name} = {prior}: both numbers must be positive")
    start = dict(zip(names, values, strict=True))
    for name, (lower, upper) in bounds.items():
        if not 0 <= lower < upper:
            raise InputError(
                f"bounds of {name} = ({lower:g}, {upper:g}): must be two numbers from 0 on, the "
                "lower first"
            )
        if not lower * (1.0 - 1e-9) <= start[name] <= upper * (1.0 + 1e-9):  # but for rounding
            raise InputError(
                f"start of {name} = {start[name]:g}: must be within its bounds, {lower:g} to "
                f"{upper:g}"
            )
