"""Kinks told from smooth bends, and the steps and simplex that look for them."""

import jax.numpy as jnp
import numpy as np
import pytest

from calibrate.least_squares import kinks
from calibrate.least_squares.evaluator import Evaluator, progress_bar
from calibrate.least_squares.programs import Given, compiled
from calibrate.least_squares.unknowns import unknowns


def evaluator_of(residuals, start, bounds=None):
    unknown = unknowns(start, {}, bounds or {})
    programs = compiled(residuals, unknown.structure, unknown.shapes, (), None, True)
    given = Given(None, np.zeros(0), np.zeros(0))
    return Evaluator(programs, given, unknown.box, progress_bar(False))


def curved(theta):
    """Slopes that change evenly: a third as much at a third of the distance."""
    x = jnp.log(theta["a"])
    return jnp.stack([2.0 * x + 1.5 * x**2, 0.3 + 0.0 * x])


def steep(theta):
    """Slopes that change with the square of the distance: a ninth as much."""
    x = jnp.log(theta["a"])
    return jnp.stack([2.0 * x + 4.0 * x * jnp.abs(x) * x, 0.3 + 0.0 * x])


def kinked(theta):
    x = jnp.log(theta["a"])
    return jnp.stack([jnp.where(x < 0.0, -2.0 * x, 0.5 * x) + 1.0])


@pytest.mark.parametrize("residuals, jump", [(curved, False), (steep, False), (kinked, True)])
def test_slopes_jump_on_a_kink_alone(residuals, jump):
    evaluator = evaluator_of(residuals, {"a": 1.0})
    found, runs = kinks._jumps(evaluator, evaluator.at(np.zeros(1)))
    assert (found, runs) == (jump, 4)


def test_steps_of_one_standard_error_are_as_long_as_the_errors():
    """Errors of 0.1 and 0.25 along two directions; none is longer than a factor of a thousand."""

    def residuals(theta):
        a, b = jnp.log(theta["a"]), jnp.log(theta["b"])
        return jnp.stack([10.0 * (0.6 * a + 0.8 * b), 4.0 * (0.8 * a - 0.6 * b)])

    evaluator = evaluator_of(residuals, {"a": 1.0, "b": 1.0})
    steps = kinks._standard_error_steps(evaluator.at(np.zeros(2)))
    np.testing.assert_allclose(np.linalg.norm(steps, axis=0), [0.1, 0.25], rtol=1e-12)
    np.testing.assert_allclose(np.abs(steps[:, 0]), [0.06, 0.08], rtol=1e-12)
    weak = evaluator_of(lambda theta: 1e-3 * jnp.log(theta["a"])[None], {"a": 1.0})
    (longest,) = kinks._standard_error_steps(weak.at(np.zeros(1))).T
    np.testing.assert_allclose(np.abs(longest), kinks.LONGEST_ERROR)


def test_a_simplex_keeps_within_bounds_and_finds_the_least():
    def residuals(theta):
        return jnp.stack([jnp.abs(jnp.log(theta["a"])) + 1.0])

    evaluator = evaluator_of(residuals, {"a": 1.5}, {"a": (1.2, 3.0)})
    result, logs = kinks._simplex(evaluator, evaluator.at(np.log([1.5])), 0.5)
    assert np.exp(logs[0]) == pytest.approx(1.2, rel=1e-9)
    assert result.fun == pytest.approx((1.0 + np.log(1.2)) ** 2, rel=1e-9)


def test_a_kink_is_found_twice_from_either_side(monkeypatch):
    """Not by the first simplex alone, however well it ends."""
    sizes, simplex = [], kinks._simplex

    def counted(evaluator, end, size):
        sizes.append(size)
        return simplex(evaluator, end, size)

    monkeypatch.setattr(kinks, "_simplex", counted)
    evaluator = evaluator_of(kinked, {"a": 1.0})
    _, on_a_kink, runs = kinks.without_slopes(evaluator, evaluator.at(np.zeros(1)))
    assert on_a_kink and sizes == [kinks.SIMPLEX, -kinks.SIMPLEX]
    assert runs > 8
