"""The fit, which knows only a function: optimum, priors, convergence, what the data determine."""

from collections import OrderedDict
from dataclasses import replace
from functools import partial

import jax.numpy as jnp
import numpy as np
import optax
import pytest

import calibrate
import mrjax
from calibrate import LogNormal
from calibrate.inference.curvature import covariance, information
from calibrate.inference.identify import widened_errors
from calibrate.least_squares.optima import Optimum

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12


def powers(exponents, measured, relative_error):
    """Residuals of products of powers: ln-linear, so every answer is known exactly."""
    exponents = jnp.asarray(exponents, float)
    measured = jnp.asarray(measured, float)

    def residuals(theta):
        logs = jnp.log(jnp.stack(list(theta.values())))
        return (jnp.exp(exponents @ logs) / measured - 1.0) / relative_error

    return residuals


def test_a_determined_problem_is_solved_to_the_last_digits():
    """a b = 6, a / b = 1.5, c^2 = 16."""
    residuals = powers([[1, 1, 0], [1, -1, 0], [0, 0, 2]], [6, 1.5, 16], 0.01)
    fit = calibrate.fit(residuals, OrderedDict(a=1.0, b=1.0, c=10.0))
    assert fit.converged
    np.testing.assert_allclose(fit.values, [3, 2, 4], rtol=1e-8)
    assert fit.chi_squared < 1e-12
    found = calibrate.identify(fit)
    assert found.null_directions == ()
    assert found.determined == {"a": True, "b": True, "c": True}
    # Half the variance of two 1 % errors; c from its square.
    assert found.standard_errors["a"] == near(3 * 0.01 / np.sqrt(2), rel=1e-6)
    assert found.standard_errors["c"] == near(4 * 0.005, rel=1e-6)


def test_a_prior_is_one_more_measurement():
    """ln x measured as 0 +- 0.1 with prior ln x = 1 +- 0.2: the precision-weighted mean."""

    def residuals(theta):
        return jnp.log(theta["x"])[None] / 0.1

    fit = calibrate.fit(residuals, {"x": 2.0}, priors={"x": LogNormal(float(np.e), 0.2)})
    precision = 1 / 0.1**2 + 1 / 0.2**2
    mean = (1 / 0.2**2) / precision
    assert fit.converged
    assert np.log(fit.values[0]) == near(mean, rel=1e-7)
    errors = calibrate.identify(fit).standard_errors
    assert errors["x"] == near(np.exp(mean) / np.sqrt(precision), rel=1e-6)


def test_degenerate_data_name_the_product_and_the_null_directions():
    """One velocity, three factors: 1/(a b c) is known to 2 %, nothing else is."""
    residuals = powers([[-1, -1, -1]], [1 / 24], 0.02)
    priors = {name: LogNormal(3.0, 0.3) for name in "abc"}
    fit = calibrate.fit(residuals, OrderedDict(a=3.0, b=3.0, c=3.0), priors=priors)
    found = calibrate.identify(fit)
    assert fit.converged
    (product,) = found.combinations
    assert product.expression == "a * b * c"
    assert product.value == near(24, rel=1e-3)
    assert product.standard_error == near(0.02 * product.value, rel=1e-2)
    assert found.null_directions == ("a / c", "b / c")
    assert not any(found.determined.values())


def test_without_priors_the_undetermined_has_no_error():
    residuals = powers([[1, 1, 0]], [6], 0.01)
    fit = calibrate.fit(residuals, OrderedDict(a=2.0, b=2.0, c=5.0))
    found = calibrate.identify(fit)
    assert fit.converged
    assert np.prod(fit.values[:2]) == near(6, rel=1e-6)
    assert fit.values[2] == near(5.0)
    assert all(np.isinf(error) for error in found.standard_errors.values())
    assert found.null_directions == ("a / b", "c")


def test_fractional_and_irrational_exponents_are_written_as_they_are():
    residuals = powers([[1, 0.5, 0], [0, 0, 1]], [2, 3], 0.01)
    fit = calibrate.fit(residuals, OrderedDict(a=1.0, b=1.0, c=1.0))
    found = calibrate.identify(fit)
    assert [one.expression for one in found.combinations] == ["a * b^(1/2)", "c"]
    assert (
        calibrate.identify(
            calibrate.fit(powers([[1, -0.7318]], [2], 0.01), OrderedDict(a=1.0, b=1.0))
        )
        .combinations[0]
        .expression
        == "a / b^0.732"
    )


@pytest.mark.parametrize("optimizer", [optax.sgd(1e-5), optax.adam(0.05), optax.lbfgs()])
def test_any_optimizer_leads_to_the_same_optimum(optimizer):
    residuals = powers([[1, 1], [1, -1]], [6, 1.5], 0.01)
    fit = calibrate.fit(residuals, OrderedDict(a=1.0, b=6.0), optimizer=optimizer)
    assert fit.converged
    np.testing.assert_allclose(fit.values, [3, 2], rtol=1e-8)


def test_contradicting_data_are_a_misfit_not_a_failure():
    residuals = powers([[1], [1]], [1.0, 1.2], 0.01)
    fit = calibrate.fit(residuals, {"a": 1.0})
    assert fit.converged
    # Two measurements 0.18 apart with errors of about 0.01 each: chi-squared near 9^2 2.
    assert fit.chi_squared > 100


def test_a_fit_that_cannot_converge_says_so():
    """A slope that leads out of all numbers: neither it nor a simplex finds an end."""

    def endless(theta):
        return 100.0 - 0.01 * jnp.log(theta["a"])[None]

    fit = calibrate.fit(endless, {"a": 1.0}, search_steps=5, finish_steps=5)
    assert not fit.converged
    broken = calibrate.fit(lambda theta: jnp.log(theta["a"] - 2.0)[None], {"a": 1.0})
    assert not broken.converged


@pytest.mark.parametrize("start", [0.0, -1.0, float("nan"), float("inf")])
def test_a_start_that_is_not_positive_is_refused(start):
    with pytest.raises(ValueError, match=r"start of a = .*: must be a positive number"):
        calibrate.fit(lambda theta: theta["a"][None], {"a": start})


def test_a_prior_for_nothing_is_refused():
    with pytest.raises(ValueError, match="prior for 'b': no such parameter; the start has a"):
        calibrate.fit(lambda t: t["a"][None], {"a": 1.0}, priors={"b": LogNormal(1.0, 1.0)})


def test_names_of_arrays_and_nested_starts():
    start = {"f": jnp.array([1.0, 2.0]), "g": {"h": 3.0}}
    fit = calibrate.fit(
        lambda theta: jnp.concatenate([theta["f"] - 2.0, (theta["g"]["h"] - 1.0)[None]]), start
    )
    assert fit.names == ("f[0]", "f[1]", "g.h")
    np.testing.assert_allclose(fit.values, [2, 2, 1], rtol=1e-4)  # errors are of 1


AT, READ = np.array([1.0, 2.0, 4.0]), np.array([6.1, 12.0, 23.9])
SLOPE = float(AT @ READ / (AT @ AT))


def slope_of_a_product(theta):
    """Of a line through 0: only the product of all values shows."""
    return (jnp.prod(jnp.stack(list(theta.values()))) * AT - READ) / 0.1


@pytest.mark.parametrize("start", [(1.0, 1.0), (5.0, 1.0), (49.0, 1.1, 1.0), (2.3, 38.0, 2.6)])
def test_a_fit_goes_the_shortest_way_where_only_a_product_is_determined(start):
    theta = OrderedDict(zip("abc", start, strict=False))
    fit = calibrate.fit(slope_of_a_product, theta)
    factor = (SLOPE / np.prod(start)) ** (1 / len(start))
    assert fit.converged
    np.testing.assert_allclose(fit.values, np.array(start) * factor, rtol=1e-6)


def test_what_no_residual_knows_of_stays_where_it_began():
    """Whatever of the rest, and where residuals bend: 1000 / (f_w f_s) is measured."""
    measured = jnp.array([9.1, 9.3])

    def residuals(theta):
        return (1000.0 / (theta["f_w"] * theta["f_s"]) - measured) / 0.1 + 0.0 * theta["other"]

    fit = calibrate.fit(residuals, OrderedDict(f_w=49.0, f_s=1.1, other=7.0))
    assert fit.converged and fit.values[2] == near(7.0, rel=1e-14)
    np.testing.assert_allclose(fit.values[:2], [69.58, 1.562], rtol=1e-3)


def test_bounds_hold_during_a_fit_and_at_its_end():
    """a b = 6 and a = 5 are asked for; a is at most 3, so that b is 2."""
    asked = []

    def residuals(theta):
        asked.append(theta)
        return jnp.stack([theta["a"] * theta["b"] - 6.0, theta["a"] - 5.0]) / 0.01

    bounds = {"a": (0.5, 3.0)}
    fit = calibrate.fit(residuals, OrderedDict(a=1.0, b=1.0), bounds=bounds)
    assert fit.converged
    np.testing.assert_allclose(fit.values, [3.0, 2.0], rtol=1e-9)
    inside = calibrate.fit(residuals, OrderedDict(a=1.0, b=1.0), bounds={"a": (0.5, 30.0)})
    np.testing.assert_allclose(inside.values, [5.0, 1.2], rtol=1e-9)
    # From the bound itself, and with further starts drawn beyond it.
    wide = {"a": LogNormal(2.0, 3.0)}
    many = calibrate.fit(residuals, OrderedDict(a=3.0, b=1.0), bounds=bounds, priors=wide, starts=4)
    np.testing.assert_allclose(many.values, [3.0, 2.0], rtol=1e-6)


@pytest.mark.parametrize(
    "bounds, words",
    [
        ({"a": (2.0, 3.0)}, r"start of a = 1: must be within its bounds, 2 to 3"),
        ({"a": (3.0, 2.0)}, r"bounds of a = \(3, 2\): must be two numbers from 0 on"),
        ({"a": (-1.0, 2.0)}, r"bounds of a = \(-1, 2\)"),
        ({"a": (float("nan"), 2.0)}, r"bounds of a = \(nan, 2\)"),
        ({"b": (1.0, 2.0)}, r"bounds for 'b': no such parameter; the start has a"),
    ],
)
def test_bounds_that_cannot_be_kept_are_refused(bounds, words):
    with pytest.raises(mrjax.InputError, match=words):
        calibrate.fit(lambda theta: theta["a"][None], {"a": 1.0}, bounds=bounds)


def grows(theta):
    """As many as there are above zero."""
    both = jnp.stack([theta["a"], theta["a"] - 2.0])
    return both[both > 0.0]


def chooses(theta):
    return jnp.stack([theta["a"]]) if theta["a"] > 1.0 else jnp.zeros(1)


@pytest.mark.parametrize(
    "residuals, words",
    [
        (lambda theta: jnp.zeros(0) * theta["a"], r"residuals: have shape \(0,\); give a vector"),
        (lambda theta: jnp.ones((2, 3)) * theta["a"], r"residuals: have shape \(2, 3\)"),
        (grows, "residuals: their number, or a choice in them, depends on the values"),
        (chooses, "residuals: their number, or a choice in them, depends on the values"),
    ],
)
def test_residuals_that_are_no_vector_of_one_size_are_refused(residuals, words):
    with pytest.raises(mrjax.InputError, match=words) as refusal:
        calibrate.fit(residuals, {"a": 1.0})
    assert "\n" not in str(refusal.value)


def test_two_parameters_of_one_flattened_name_are_refused():
    """A prior by that name would belong to both, and a dictionary of values has but one."""
    for start in (
        {"a.b": 1.0, "a": {"b": 1.0}},
        {"f[0]": 1.0, "f": np.ones(2)},
        {"a.b.c": 1.0, "a": {"b": {"c": 1.0}}},
    ):
        with pytest.raises(mrjax.InputError, match="start: two of its parameters are called"):
            calibrate.fit(lambda theta: jnp.ones(1), start)


def test_residuals_that_are_no_numbers_identify_nothing():
    fit = calibrate.fit(lambda theta: jnp.array([jnp.nan, 1.0]) * theta["a"], {"a": 1.0})
    found = calibrate.identify(fit)
    assert not fit.converged and found.combinations == ()
    assert found.standard_errors == {"a": np.inf} and found.determined == {"a": False}
    assert found.null_directions == ("a",)
    known, unbounded = covariance(information(fit))
    assert not known.any() and unbounded.shape == (1, 1)


def test_an_error_larger_than_the_value_determines_nothing():
    """ln a is known to 0.002, ln b to 250."""

    def residuals(theta):
        return jnp.stack([500 * jnp.log(theta["a"] / 2.0), 0.004 * jnp.log(theta["b"] / 0.5)])

    found = calibrate.identify(calibrate.fit(residuals, {"a": 1.9, "b": 0.13}))
    assert found.determined == {"a": True, "b": False}
    assert found.status == {"a": "determined", "b": "free"}
    assert [one.expression for one in found.combinations] == ["a"]
    assert found.standard_errors["b"] == np.inf
    assert found.data_standard_errors["b"] == np.inf  # not within a factor of e^10


@pytest.mark.parametrize(
    "error, prior, status",
    [
        (0.49, None, "determined"),
        (0.51, None, "free"),
        (0.16, 0.5, "determined"),
        (0.17, 0.5, "informed"),
        (0.99, 0.5, "informed"),
        (1.01, 0.5, "prior only"),
        (1.6, 5.0, "determined"),
    ],
)
def test_the_data_s_own_error_is_judged_beside_the_prior(error, prior, status):
    def residuals(theta):
        return jnp.log(theta["a"])[None] / error

    priors = {} if prior is None else {"a": LogNormal(1.0, prior)}
    found = calibrate.identify(calibrate.fit(residuals, {"a": 1.5}, priors=priors))
    assert found.status == {"a": status} and found.determined["a"] == (status == "determined")
    assert found.data_standard_errors["a"] == near(error, rel=1e-6)
    assert len(found.combinations) == (status == "determined")
    assert found.weak_combinations == (() if status == "determined" else ("a",))


@pytest.mark.parametrize(
    "rise, error, excluded", [(3.0, 0.01, False), (4.5, 0.01, True), (40.0, 0.1, False)]
)
def test_an_optimum_that_the_data_do_not_exclude_is_as_far_as_a_value_is_unknown(
    rise, error, excluded
):
    """The other of two, three times as large; also beside readings that contradict each other."""
    readings = np.array([1.0, -1.0]) * (5.0 if rise > 30 else 0.1)

    def residuals(theta):
        return jnp.log(theta["a"]) / 0.01 + readings

    fit = calibrate.fit(residuals, {"a": 1.0}, priors={"a": LogNormal(1.0, 3.0)})
    other = Optimum(3.0 * fit.values, 9.0, fit.chi_squared + rise)
    for also, far in ((other, not excluded), (other._replace(finished=False), False)):
        told = replace(fit, optima=(*fit.optima, also))
        found = calibrate.identify(told)
        scaled = widened_errors(told, found.widening, found.error_scale)["a"]
        assert (scaled == near(np.log(3.0) * fit.values[0], rel=1e-6)) == far
        apart = near(np.log(3.0), rel=1e-9)
        assert (found.data_standard_errors["a"] == apart) == far
        assert found.determined["a"] != far
        assert [one.expression for one in found.combinations] == ["a"] * (not far)


def test_what_is_determined_near_a_fit_alone_is_told_apart():
    """a exp(-b) = 1 +- 0.01: a product of powers at the fit, and another elsewhere."""

    def residuals(theta):
        return (jnp.log(theta["a"]) - 0.2 * theta["b"])[None] / 0.01

    fit = calibrate.fit(residuals, {"a": 1.0, "b": 1.0}, bounds={"b": (1e-6, 1e9)})
    found = calibrate.identify(fit)
    assert found.combinations == () and found.weak_combinations == ()
    (one,) = found.near_combinations
    ratio = one.exponents["b"] / one.exponents["a"]
    assert ratio == near(-0.2 * fit.theta["b"], rel=1e-6)
    assert len(found.null_directions) == 1


def test_next_to_nothing_is_left_out_of_a_product():
    """f^1 g^0.001: the null direction is g, not f to the power of a thousand."""

    def residuals(theta):
        return (jnp.log(theta["f"]) + 0.001 * jnp.log(theta["g"]))[None] / 0.01

    bounds = {"g": (1e-3, 1e3)}
    found = calibrate.identify(calibrate.fit(residuals, {"f": 1.5, "g": 1.0}, bounds=bounds))
    assert found.null_directions == ("g",)
    (one,) = found.combinations
    assert (one.expression, one.exponents) == ("f", {"f": 1.0})
    assert one.value == near(1.0, rel=1e-6)


def test_a_fit_that_its_priors_alone_determine_converges():
    """Readings that tell nothing: every value ends at its median, and none is determined."""

    def residuals(theta):
        return jnp.array([0.3, -0.2]) + 0.0 * theta["a"]

    priors = {"a": LogNormal(2.0, 0.5)}
    found = calibrate.fit(residuals, {"a": 5.0}, priors=priors)
    assert found.converged and float(found.theta["a"]) == near(2.0)
    assert calibrate.identify(found).status == {"a": "prior only"}
    assert not calibrate.fit(residuals, {"a": 5.0}).converged
