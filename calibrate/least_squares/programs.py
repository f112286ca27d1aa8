"""The compiled programs of a fit: residuals with priors, and their Jacobian."""

from collections import OrderedDict
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from calibrate.least_squares.interruptible import watched
from calibrate.least_squares.unknowns import Unknowns, tree
from mrjax import InputError
from mrjax.io.checkpoint import Checkpoint, digest

AT_ONCE = 8
"""Most models that run side by side, one for each start."""


class Given(NamedTuple):
    """The arguments of a compiled fit beside the values."""

    data: Any
    median: np.ndarray  # logarithms of the priors' medians, (K,)
    weight: np.ndarray  # 1 / log_standard_deviation of the priors, (K,)


class Programs(NamedTuple):
    """The programs of a fit, functions of logarithms, (P,), and `Given`."""

    traceable: Callable[[ArrayLike, Given], Array]  # for use within other programs
    everything: Callable[[ArrayLike, Given], Array]  # residuals and priors, (M + K,)
    linearised: Callable[[ArrayLike, Given], tuple[Array, Array]]  # Jacobian and residuals
    traced: bool = True  # False where all three are called with numbers


@lru_cache(maxsize=16)
def compiled(
    residuals: Callable[..., Array],
    structure: Any,
    shapes: tuple[tuple[int, ...], ...],
    with_prior: tuple[int, ...],
    robust: float | None,
    without_data: bool,
) -> Programs:
    """Compiles the programs for residuals of a pytree.

    Args:
      residuals: as for `fit`.
      structure, shapes: structure of the pytree, and shapes of its leaves.
      with_prior: places of the values that have a prior.
      robust: as for `fit`.
      without_data: whether the residuals take no data.
    """
    places = np.array(with_prior, int)

    @jax.jit
    def everything(logs: Array, given: Given) -> Array:
        theta = tree(jnp.exp(logs), structure, shapes)
        vector = jnp.atleast_1d(residuals(theta) if without_data else residuals(theta, given.data))
        if vector.ndim != 1 or not vector.size:
            raise InputError(
                f"residuals: have shape {vector.shape}; give a vector of at least one, "
                "(prediction - measurement) / standard deviation of each measurement"
            )
        if robust is not None:
            vector = pseudo_huber(vector, robust)
        return jnp.concatenate([vector, given.weight * (logs[places] - given.median)])

    def with_value(logs: Array, given: Given) -> tuple[Array, Array]:
        value = everything(logs, given)
        return value, value

    linearised = watched(jax.jit(jax.jacfwd(with_value, has_aux=True)))
    return Programs(everything, watched(everything), linearised)


def prepared(
    residuals: Callable[..., Array], unknown: Unknowns, data: Any, robust: float | None
) -> Programs:
    """The programs of a fit.

    Args:
      residuals, data, robust: as for `fit`.
      unknown: the fitted values.
    """
    with_prior, without_data = unknown.with_prior, data is None
    return compiled(residuals, unknown.structure, unknown.shapes, with_prior, robust, without_data)


def given_with(unknown: Unknowns, data: Any) -> Given:
    """The arguments of the programs of a fit beside the logarithms."""
    places = np.array(unknown.with_prior, int)
    return Given(data, np.log(unknown.median[places]), np.sqrt(unknown.precision[places]))


def pseudo_huber(residuals: Any, longest: float) -> Any:
    """Pseudo-Huber residuals: near 0 they are r, far away sqrt(2 d r).

    Their squares are 2 d^2 (sqrt(1 + (r/d)^2) - 1).

    Args:
      residuals: residuals r, an array of JAX or of numpy.
      longest: distance d beyond which residuals count linearly.
    """
    size = (1.0 + (residuals / longest) ** 2) ** 0.5
    return residuals * (2.0 / (1.0 + size)) ** 0.5


def count_residuals(programs: Programs, logs: np.ndarray, given: Given) -> int:
    """The number of residuals, priors included.

    Raises:
      InputError: there are none, or their number is not constant.
    """
    if not programs.traced:
        return int(np.asarray(programs.everything(logs, given)).size)
    try:
        shape = jax.eval_shape(programs.traceable, logs, given).shape
    except (jax.errors.ConcretizationTypeError, jax.errors.NonConcreteBooleanIndexError) as error:
        raise InputError(
            "residuals: their number, or a choice in them, depends on the values, so that JAX "
            "cannot compile them; give as many for all values, with jnp.where in place of `if` "
            "and of boolean indices, or differentiable=False"
        ) from error
    except jax.errors.TracerArrayConversionError as error:
        raise InputError(
            "residuals: are of numpy, which JAX cannot differentiate; write them with jax.numpy, "
            "or give differentiable=False for slopes by finite differences"
        ) from error
    return int(shape[0])


def over_starts(function: Callable, starts: int) -> Callable:
    """A compiled function mapped over the leading axis of its arguments; gives numpy arrays.

    At most `AT_ONCE` rows run in one call, since Python sees signals between two calls.
    """
    mapped = watched(jax.jit(jax.vmap(function)))

    def over_all(*arguments: Any) -> Any:
        if starts == 1:
            return one_by_one(function)(*arguments)
        if starts <= AT_ONCE:
            return jax.tree.map(np.asarray, mapped(*arguments))
        results = []
        for first in range(0, starts, AT_ONCE):
            # The last rows are filled up, so that one program serves all.
            rows = np.minimum(np.arange(first, first + AT_ONCE), starts - 1)
            results_of_rows = mapped(
                *jax.tree.map(partial(np.take, indices=rows, axis=0), arguments)
            )
            results.append(jax.tree.map(np.asarray, results_of_rows))
        return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:starts], *results)

    return over_all


@lru_cache(maxsize=16)
def side_by_side(linearised: Callable) -> Callable:
    """The program of a cheap model mapped over many points, (S, P), with the same other arguments.

    It is compiled once for all searches that share `linearised`.
    """
    return watched(jax.jit(jax.vmap(linearised, in_axes=(0, None))))


def one_by_one(function: Callable) -> Callable:
    """Calls a compiled function row by row, since a mapped forward model may be slower."""

    def over_all(*arguments: Any) -> Any:
        rows = len(jax.tree.leaves(arguments)[0])
        results = [
            function(*jax.tree.map(lambda leaf, row=row: leaf[row], arguments))
            for row in range(rows)
        ]
        return jax.tree.map(
            lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *results
        )

    return over_all


def recalled(function: Callable[..., Any], most: int) -> Callable[..., Any]:
    """A compiled function of logarithms that remembers its last results, since stages repeat calls.

    Args:
      function: function of logarithms, (P,), and of arguments that never change.
      most: most results in memory.
    """
    results: OrderedDict[bytes, Any] = OrderedDict()

    def recall_or_call(logs: ArrayLike, *given: Given) -> Any:
        key = np.asarray(logs).tobytes()
        if key not in results:
            results[key] = function(logs, *given)
            if len(results) > most:
                results.popitem(last=False)
        return results[key]

    return recall_or_call


def remembered(work: Checkpoint, name: str, function: Callable) -> Callable:
    """A compiled function of logarithms, with its results stored in a checkpoint."""

    def recall_or_call(logs: np.ndarray, *given: Given) -> Any:
        label = f"{name}-{digest(logs)}"
        if (stored := work.load(label)) is not None:
            leaves = list(stored[0].values())
        else:
            leaves = jax.tree.leaves(function(logs, *given))
            work.save(label, {str(place): array for place, array in enumerate(leaves)})
        return leaves[0] if len(leaves) == 1 else tuple(leaves)

    return recall_or_call
