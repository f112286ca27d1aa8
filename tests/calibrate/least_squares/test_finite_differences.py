"""Slopes by differences: as exact as the residuals let them be, and known where they are not."""

import jax.numpy as jnp
import numpy as np
import pytest

import calibrate
from calibrate import LogNormal
from calibrate.least_squares.finite_differences import SMALLEST, FiniteDifferences
from calibrate.least_squares.programs import given_with
from calibrate.least_squares.unknowns import unknowns
from mrjax import InputError

TIMES = np.linspace(0.0, 5.0, 12)
START = {"a": 1.0, "k": 1.0}
MEASURED = 3.0 * np.exp(-0.7 * TIMES) + 0.05 * np.cos(7.0 * np.arange(12))


def residuals(theta, module=np):
    return (theta["a"] * module.exp(-theta["k"] * TIMES) - MEASURED) / 0.05


def rounded(digits):
    def predicted(theta):
        exact = theta["a"] * np.exp(-theta["k"] * TIMES)
        return (np.array([float(f"{one:.{digits}g}") for one in exact]) - MEASURED) / 0.05

    return predicted


def slopes_at_the_start(function, step=None, priors=None):
    unknown = unknowns(START, priors or {}, {})
    differences = FiniteDifferences(function, unknown, None, step)
    given, logs = given_with(unknown, None), np.log(unknown.values)
    differences.choose_steps(logs, given)
    return differences, *differences.linearised(logs, given)


def exact_slopes():
    falls = np.exp(-TIMES) / 0.05
    return np.stack([falls, -TIMES * falls], axis=1)


@pytest.mark.parametrize(
    "function, within, step",
    # (eps / h + h^2 / 6) times some curvature; of rounded ones half a digit of four, over 2 h.
    [
        (residuals, 1e-8, 2.4e-5),
        (rounded(7), 2e-4, 6e-3),
        (rounded(4), 2e-2, 0.1),
        (rounded(3), 0.1, 0.1),
    ],
)
def test_the_step_follows_from_the_digits_of_the_residuals(function, within, step):
    differences, jacobian, value = slopes_at_the_start(function)
    exact = exact_slopes()
    assert np.abs(jacobian - exact).max() < within * np.abs(exact).max()
    np.testing.assert_allclose(value, function(START), rtol=1e-14)
    assert differences.steps[0] == pytest.approx(step, rel=0.05)


def test_slopes_are_of_second_order():
    errors = [
        np.abs(slopes_at_the_start(residuals, step)[1] - exact_slopes()).max()
        for step in (0.1, 0.05)
    ]
    assert np.log2(errors[0] / errors[1]) > 1.9


def test_a_prior_is_one_more_row():
    prior = {"a": LogNormal(1.0, 0.1), "k": LogNormal(2.0, 0.5)}
    _, jacobian, value = slopes_at_the_start(residuals, priors=prior)
    np.testing.assert_allclose(jacobian[-2:], [[10.0, 0.0], [0.0, 2.0]])
    assert value[-1] == pytest.approx(-np.log(2.0) / 0.5)


@pytest.mark.parametrize("options", [{}, {"robust": 2.0}, {"starts": 3}, {"bounds": {"k": (0, 1)}}])
def test_the_fit_is_that_of_the_traced_function(options):
    prior = {"a": LogNormal(2.0, 0.1)}
    start = {"a": 1.0, "k": 0.9}
    ours = calibrate.fit(residuals, start, priors=prior, differentiable=False, **options)
    traced = calibrate.fit(lambda theta: residuals(theta, jnp), start, priors=prior, **options)
    assert ours.converged and traced.converged
    # A fit ends where a step promises 1e-8 in chi-squared: 1e-4 standard errors.
    errors = np.array(list(calibrate.identify(traced).standard_errors.values()))
    assert (np.abs(ours.values - traced.values) < 1e-4 * errors).all()
    np.testing.assert_allclose(ours.jacobian, traced.jacobian, atol=1e-4)
    assert ours.places == traced.places and traced.slopes is None


def test_data_are_handed_on_and_arrays_are_parameters():
    def of_data(theta, data):
        return (theta["both"][0] * np.exp(-theta["both"][1] * TIMES) - data) / 0.05

    start = {"both": np.array([1.0, 1.0])}
    fit = calibrate.fit(of_data, start, data=MEASURED, differentiable=False)
    alone = calibrate.fit(residuals, START, differentiable=False)
    np.testing.assert_allclose(fit.values, alone.values, rtol=1e-12)
    assert fit.names == ("both[0]", "both[1]")


def test_the_search_turns_back_where_the_function_fails():
    def fails(theta):
        if theta["k"] > 1.2:
            raise RuntimeError("diverged")
        return np.full(12, np.nan) if theta["a"] > 4.0 else residuals(theta)

    fit = calibrate.fit(fails, START, differentiable=False)
    alone = calibrate.fit(residuals, START, differentiable=False)
    assert fit.converged and fit.slopes.failures > 0
    np.testing.assert_allclose(fit.values, alone.values, rtol=1e-9)


def test_a_slope_at_the_end_of_what_can_be_called_is_of_one_side():
    def fails(theta):
        return np.full(12, np.nan) if theta["k"] > 1.0 else residuals(theta)

    _, jacobian, _ = slopes_at_the_start(fails, step=1e-5)
    np.testing.assert_allclose(jacobian, exact_slopes(), atol=1e-5 * np.abs(exact_slopes()).max())


def test_noise_is_told():
    random = np.random.default_rng(0)

    def noisy(theta):
        return residuals(theta) * (1.0 + 1e-3 * random.normal(size=12))

    fit = calibrate.fit(noisy, START, differentiable=False, step=SMALLEST)
    assert fit.slopes.unreliable.all()
    assert not calibrate.fit(residuals, START, differentiable=False).slopes.unreliable.any()


def test_a_value_that_changes_nothing_has_no_slope():
    fit = calibrate.fit(residuals, START | {"z": 1.0}, differentiable=False)
    assert fit.converged and not fit.jacobian[:, 2].any() and fit.values[2] == 1.0
    assert not fit.slopes.unreliable.any()


def test_a_checkpoint_keeps_what_was_called(tmp_path):
    calls = []

    def counted(theta):
        calls.append(1)
        return residuals(theta)

    first = calibrate.fit(counted, START, differentiable=False, step=1e-5, checkpoint=tmp_path)
    done = len(calls)
    again = calibrate.fit(counted, START, differentiable=False, step=1e-5, checkpoint=tmp_path)
    assert (again.values == first.values).all() and len(calls) - done < done / 3


@pytest.mark.parametrize(
    "function, said",
    [
        (lambda theta: 1 / 0, "raise ZeroDivisionError at the start: division by zero"),
        (lambda theta: np.ones((2, 2)), r"have shape \(2, 2\)"),
        (lambda theta: np.zeros(0), r"have shape \(0,\)"),
    ],
)
def test_residuals_that_cannot_be_had_are_refused(function, said):
    with pytest.raises(InputError, match=said):
        calibrate.fit(function, START, differentiable=False)


def test_residuals_of_numpy_are_refused_with_the_remedy():
    with pytest.raises(InputError, match="differentiable=False"):
        calibrate.fit(residuals, START)


def test_residuals_whose_number_changes_are_refused():
    with pytest.raises(InputError, match="as long at all values"):
        calibrate.fit(
            lambda theta: np.ones(3 if theta["a"] == 1.0 else 4), START, differentiable=False
        )


def test_a_function_that_is_flat_over_small_steps_is_not_flat():
    """Two numbers with one decimal: they stay over steps up to some percent."""

    def coarse(theta):
        return np.round(theta["a"] * np.array([3.017, 5.041]), 1) - 1.0

    fit = calibrate.fit(coarse, {"a": 1.0}, differentiable=False, finish_steps=1)
    assert fit.slopes.steps[0] > 0.05 and fit.jacobian.any()
