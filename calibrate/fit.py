"""A search by optax and a second-order finish, over any residuals of positive quantities.

Knows nothing of the physics: `residuals` maps a pytree of positive numbers to a vector of
(prediction - measurement) / standard deviation. All work is done in logarithms, where a product of
factors is a sum and a log-normal prior one more residual. The search finds the valley; error bars
and the last digits need the Levenberg-Marquardt finish.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox
import jax
import jax.numpy as jnp
import numpy as np
import optax
import optimistix
from jax import Array
from jax.flatten_util import ravel_pytree
from tqdm import tqdm

from mrjax.permissive import permissive

CONVERGED_BELOW = 1e-8
"""Expected gain in chi-squared of one more Gauss-Newton step at which a fit counts as converged:
1e-4 of a standard deviation."""

SEARCH_ENDS_BELOW = 1.0
"""The same gain at which the search has found the valley: one standard deviation."""


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
    """Whether a further Gauss-Newton step would gain next to nothing."""
    model_runs: int
    """Evaluations of the residuals, each with their Jacobian or alone."""

    @property
    def chi_squared(self) -> float:
        """Sum of squares of the residuals of the measurements, without the priors."""
        return float(self.residuals @ self.residuals)


def fit(
    residuals: Callable[[Any], Array],
    start: Any,
    *,
    priors: dict[str, LogNormal] | None = None,
    optimizer: optax.GradientTransformation | None = None,
    search_steps: int = 60,
    finish_steps: int = 50,
    progress: bool = False,
) -> Fit:
    """Least squares with log-normal priors.

    Args:
      residuals: from a pytree like `start` to a vector (M,), in standard deviations. Traced by
        `jit` and differentiated forwards.
      start: a pytree of positive numbers, such as {"f_w": 49.0, "f_s": 1.1}.
      priors: by name, where there are any.
      optimizer: of the search, over the logarithms; left out, `optax.adam(0.05)`.
      search_steps: most steps of the search; it ends sooner within a standard deviation of the
        optimum.
      finish_steps: most steps of Levenberg-Marquardt.
      progress: whether to show a bar.

    Returns:
      a Fit; look at `converged` before using it.

    Raises:
      ValueError: a start or prior that is not positive, or a prior for no parameter.
    """
    optimizer = optax.with_extra_args_support(optimizer or optax.adam(0.05))
    names = _names(start)
    values, unravel = ravel_pytree(jax.tree.map(lambda leaf: jnp.asarray(leaf, float), start))
    _refuse_unusable(names, values, priors or {})
    median, precision = _prior_arrays(names, values, priors or {})
    held = np.flatnonzero(precision)
    weight = jnp.sqrt(precision[held])
    measured = jax.jit(lambda logs: jnp.atleast_1d(residuals(unravel(jnp.exp(logs)))))

    def everything(logs: Array) -> Array:
        return jnp.concatenate([measured(logs), weight * (logs[held] - jnp.log(median[held]))])

    def with_value(logs: Array) -> tuple[Array, Array]:
        value = everything(logs)
        return value, value

    linearised = jax.jit(jax.jacfwd(with_value, has_aux=True))

    with permissive():
        logs, losses, runs = _search(
            linearised, everything, jnp.log(values), optimizer, search_steps, progress
        )
        logs, finish_runs = _finish(everything, logs, finish_steps)
        jacobian, value = linearised(logs)
    gain = _expected_gain(jacobian, value)
    count = value.shape[0] - len(held)
    return Fit(
        theta=unravel(jnp.exp(logs)),
        names=names,
        values=np.exp(np.asarray(logs)),
        residuals=np.asarray(value[:count]),
        jacobian=np.asarray(jacobian[:count]),
        prior_precision=np.asarray(precision),
        loss=np.array([*losses, 0.5 * float(value @ value)]),
        converged=bool(np.isfinite(gain) and gain < CONVERGED_BELOW),
        model_runs=runs + finish_runs + 1,
    )


def _search(linearised, everything, logs, optimizer, most_steps, progress):
    """Optax over the logarithms, one value and Jacobian a step; logs, losses and runs."""
    state = optimizer.init(logs)
    losses, runs = [], 0

    def loss_of(logs: Array) -> Array:
        value = everything(logs)
        return 0.5 * value @ value

    @jax.jit
    def update(logs, state, value, jacobian):
        gradient = jacobian.T @ value
        change, state = optimizer.update(
            gradient, state, logs, value=0.5 * value @ value, grad=gradient, value_fn=loss_of
        )
        return optax.apply_updates(logs, change), state

    bar = tqdm(range(most_steps), desc="search", disable=not progress, leave=False)
    for _ in bar:
        jacobian, value = linearised(logs)
        runs += 1
        losses.append(0.5 * float(value @ value))
        bar.set_postfix(loss=f"{losses[-1]:.3g}")
        if not np.isfinite(losses[-1]) or _expected_gain(jacobian, value) < SEARCH_ENDS_BELOW:
            break
        logs, state = update(logs, state, value, jacobian)
    return logs, losses, runs


def _finish(everything, logs, most_steps):
    """Levenberg-Marquardt (optimistix); logs and runs."""
    solver = optimistix.LevenbergMarquardt(rtol=1e-10, atol=1e-10)

    @equinox.filter_jit
    def solve(logs: Array):
        return optimistix.least_squares(
            lambda logs, _: everything(logs),
            solver,
            logs,
            options={"jac": "fwd"},
            max_steps=most_steps,
            throw=False,
        )

    solution = solve(logs)
    better = solution.value
    usable = bool(jnp.all(jnp.isfinite(better)))
    return (better if usable else logs), int(solution.stats["num_steps"])


def _expected_gain(jacobian: Array, value: Array) -> float:
    """Decrease in the sum of squares that one more Gauss-Newton step promises."""
    jacobian, value = np.asarray(jacobian, float), np.asarray(value, float)
    if not (np.isfinite(jacobian).all() and np.isfinite(value).all()):
        return np.inf
    step, *_ = np.linalg.lstsq(jacobian, -value, rcond=1e-10)
    return float(np.sum((jacobian @ step) ** 2))


def _names(start: Any) -> tuple[str, ...]:
    """`f_w` for a leaf start["f_w"], `f_w[1]` for its second element if it is an array."""
    names = []
    for path, leaf in jax.tree.leaves_with_path(start):
        label = jax.tree_util.keystr(path, simple=True, separator=".") or "theta"
        indices = np.ndindex(np.shape(leaf))
        names += [f"{label}[{','.join(map(str, index))}]" if index else label for index in indices]
    return tuple(names)


def _prior_arrays(names, values, priors):
    median = np.array([priors[n].median if n in priors else 1.0 for n in names])
    spread = np.array([priors[n].log_standard_deviation if n in priors else np.inf for n in names])
    return jnp.asarray(median, values.dtype), jnp.asarray(spread**-2.0, values.dtype)


def _refuse_unusable(names, values, priors) -> None:
    for name, value in zip(names, np.asarray(values), strict=True):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"start of {name} = {value}: must be a positive number")
    for name, prior in priors.items():
        if name not in names:
            raise ValueError(
                f"prior for {name!r}: no such parameter; the start has {', '.join(names)}"
            )
        if not (prior.median > 0 and prior.log_standard_deviation > 0):
            raise ValueError(f"prior of {name} = {prior}: both numbers must be positive")
