"""Numbers as text, and what a report says: signs, digits, units, figures."""

from types import SimpleNamespace

import numpy as np
import pytest

from calibrate.experiment.free_parameters import FreeParameter
from calibrate.report import document, figures, formatting, remarks, tables, words

READING = {
    "sample": "A",
    "observable": "mudline",
    "measured": 80.0,
    "sigma": 0.5,
    "predicted": 81.0,
    "predicted_error": 0.25,
    "unit": "mm",
    "time_s": 43200.0,
    "time_unit": "day",
}
VELOCITY = READING | {"observable": "initial_velocity", "unit": "mm/day", "measured": 8.0}
VELOCITY |= {"predicted": 7.6, "sigma": 0.2}


@pytest.mark.parametrize(
    "value, error, text",
    [
        (61.403, 0.768, "61.40 ± 0.77"),
        (61.403, 7.68, "61.4 ± 7.7"),
        (614.03, 99.0, "614 ± 99"),
        (7.9951, 0.0996, "8.00 ± 0.10"),
        (614.03, 768.0, "614 ± 768"),
        (0.0012345, 0.000123, "0.00123 ± 0.00012"),
    ],
)
def test_a_value_has_two_digits_of_its_error(value, error, text):
    assert formatting.with_error(value, error) == text


def test_a_difference_is_that_of_the_prediction():
    assert formatting.off(VELOCITY) == "-5%"
    assert formatting.off(VELOCITY | {"predicted": 10.0}, " ({})") == " (+25%)"
    assert formatting.off(VELOCITY | {"measured": 0.0}) == ""


def test_a_reading_of_a_curve_has_its_time_in_days():
    assert formatting.when(READING) == " at 0.5 days"
    assert formatting.when(VELOCITY) == ""


def test_a_prior_is_told_by_its_factor():
    row = {"prior_log_standard_deviation": np.log(2.0), "prior_median": 1.1, "bounds": None}
    assert formatting.prior(row) == "1.1, 2"
    assert formatting.prior(row | {"bounds": (0.5, 0.7)}) == "1.1, 2, 0.5 to 0.7"
    assert formatting.prior(row | {"prior_log_standard_deviation": None}) == "none"


@pytest.mark.parametrize("p, text", [(0.0123, "= 0.012"), (2e-12, "= 2e-12"), (1e-13, "< 1e-12")])
def test_a_chance_is_told_down_to_its_least(p, text):
    assert formatting.by_chance(p) == text


@pytest.mark.parametrize(
    "error, bounds, text",
    [
        (0.51, None, "2, within a factor of 1.67"),
        (0.49, None, "2.00 ± 0.10"),
        (0.51, (1, 3), "2.00 ± 0.10"),
    ],
)
def test_a_loose_value_has_a_factor_for_its_error(error, bounds, text):
    row = {"value": 2.0, "standard_error": 0.1, "data_standard_error": error, "status": "free"}
    assert formatting.fitted_value(row | {"bounds": bounds}) == text


@pytest.mark.parametrize(
    "status, data, both, text",
    [
        ("determined", 0.1, 0.1, "yes"),
        ("informed", 0.1, 0.1, "no, informed"),
        ("prior only", 9.0, 0.1, "no, prior only"),
        ("free", np.inf, 0.1, "no, prior only"),
        ("free", 0.9, 0.1, "no, free"),
        ("free", np.inf, np.inf, "no, free"),
    ],
)
def test_a_value_is_called_as_the_data_leave_it(status, data, both, text):
    row = {"determined": status == "determined", "status": status}
    errors = {"data_standard_error": data, "standard_error": both}
    assert formatting.determination(row | errors) == text


def test_a_forecast_is_a_sentence():
    text = "A, not fitted: initial velocity 7.60 ± 0.25 mm/day predicted"
    assert words.line(VELOCITY) == f"{text}, 8 ± 0.2 measured (-5%)."
    assert words.line(VELOCITY | {"measured": np.nan}) == f"{text}."


def test_differences_in_the_tables_of_a_report_are_predicted_minus_measured():
    result = {"predictions": [READING, VELOCITY]}
    first, second = document._predictions(result).splitlines()[2:4]
    assert "80 ± 0.5" in first and "81.00 ± 0.25" in first and "+2.00" in first
    assert "mudline at 0.5 days" in first
    assert "-2.00" in second
    left_out = document._left_out([VELOCITY | {"difference_over_both_errors": -1.25}])
    assert "-5%" in left_out and "-1.25" in left_out
    assert document._left_out([]) == ""


OPTIMUM = {
    "values": {"f_s": 1.25},
    "chi_squared": 105.19,
    "half_sum_of_squares": 52.7,
    "finished": True,
}
OTHER = OPTIMUM | {"values": {"f_s": 0.2155}, "chi_squared": 409.31, "finished": False}


@pytest.mark.parametrize("loss, as_good", [(54.5, True), (54.7, False)])
def test_another_optimum_is_told_with_its_chi_squared(loss, as_good):
    others = [OPTIMUM, OTHER | {"half_sum_of_squares": loss}]
    result = {"chi_squared": 105.19, "optima": others, "parameters": {"f_s": {}}}
    result |= {"misfit": False, "error_scale": 3.6}
    (line,) = words._optima(result, words.TERMINAL.code)
    told = "Another optimum: `f_s` = 0.215, with chi-squared 409.3 where this fit has 105.2"
    assert line.startswith(told)
    assert ("do not tell the two apart" in line) == as_good
    table = document._optima(result)
    assert f"| 409.3 | {2 * loss:.4g} | 0.2155 | the cheap model of the search |" in table
    assert "| 105.2 | 105.4 | 1.25 | the model |" in table
    assert document._optima(result | {"optima": [OPTIMUM]}) == ""
    assert list(words._optima(result | {"optima": [OPTIMUM]}, words.TERMINAL.code)) == []


def test_that_no_prediction_changes_is_said_of_the_neighbourhood_unless_asked_far_away():
    assert "near this fit" in words._null_direction("`a / b`", unchanged=False)
    assert "near" not in words._null_direction("`a / b`", unchanged=True)
    assert "a factor of ten away" in words._null_direction("`a / b`", unchanged=True)


def verdict(**changes):
    result = {"converged": True, "misfit": False, "optima": [OPTIMUM]}
    return document._verdict(result | changes)


def test_a_verdict_says_what_is_wrong():
    assert verdict() == "The fit converged."
    assert "do not use these values" in verdict(converged=False)
    assert "do not agree" in verdict(misfit=True)
    assert "found 1 other optimum, worse" in verdict(optima=[OPTIMUM] * 2)
    assert "found 2 other optima, worse" in verdict(optima=[OPTIMUM] * 3)
    posterior = {
        **{"r_hat": 1.5, "effective_samples": 30.0, "divergences": 2, "converged": False},
        **{"method": "NUTS", "pareto_k": 0.9, "faults": ["the optima are separated"]},
    }
    assert "do not use them** (R-hat 1.500, 30 effective" in document._posterior(posterior)
    assert "agree between chains" in document._posterior(posterior | {"converged": True})
    assert "Not known:** the optima are separated." in document._posterior(posterior)
    weighted = posterior | {"method": "importance sampling", "pareto_k": 0.31, "converged": True}
    said = document._posterior(weighted | {"faults": []})
    assert "rely on them (Pareto's k 0.31, 30 effective samples; importance sampling)." in said
    assert document._posterior(None) == ""


def test_figures_show_residuals_and_curves_as_they_are():
    """Read off the drawn lines: differences in sigmas, days, and a band of two errors."""
    later = READING | {"time_s": 86400.0, "predicted": 70.0, "measured": 72.0}
    result = {"predictions": [READING, later], "curves": {}}
    (axes,) = figures.residuals_figure(result).axes
    drawn = [line for line in axes.lines if line.get_label() == "sample A"]
    np.testing.assert_allclose(drawn[0].get_ydata(), [2.0, -4.0])
    (axes,) = figures.curves_figure(result).axes
    (line,) = [line for line in axes.lines if line.get_label() == "predicted"]
    np.testing.assert_allclose(line.get_xydata(), [[0.5, 81.0], [1.0, 70.0]])
    (band,) = [one for one in axes.collections if one.get_paths()[0].vertices.shape[0] > 4]
    heights = band.get_paths()[0].vertices[:, 1]
    assert (heights.max(), heights.min()) == (81.5, 69.5)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time, days", "mudline, mm")


def test_a_curve_is_drawn_between_its_readings_in_the_unit_of_its_file():
    seconds = {"time_s": [0.0, 1800.0, 3600.0], "predicted": [9.0, 7.0, 3.0]}
    rows = [READING | {"time_s": 3600.0, "time_unit": "min"}]
    curve = seconds | {"standard_error": [0.0, 0.5, 1.0]}
    (axes,) = figures.curves_figure({"predictions": rows, "curves": {"A": curve}}).axes
    (line,) = [line for line in axes.lines if line.get_label() == "predicted"]
    np.testing.assert_allclose(line.get_xydata(), [[0.0, 9.0], [30.0, 7.0], [60.0, 3.0]])
    assert axes.get_xlabel() == "time, min"
    assert axes.get_ylim()[0] == 0.0 and axes.get_ylim()[1] > 1.05 * 80.5  # mm, with its error
    (mark,) = axes.containers[0].lines[0].get_xdata()
    assert float(mark) == 60.0


@pytest.mark.parametrize(
    "seconds, unit, words",
    [
        (43200.0, "day", "0.5 days"),
        (86400.0, "day", "1 day"),
        (1209600.0, "week", "2 weeks"),
        (5400.0, "min", "90 min"),
        (0.5, "s", "0.5 s"),
    ],
)
def test_a_time_is_said_in_the_unit_of_its_file(seconds, unit, words):
    reading = READING | {"time_s": seconds, "time_unit": unit}
    assert formatting.when(reading) == f" at {words}"


def test_a_search_is_drawn_before_its_finish():
    (axes,) = figures.loss_figure(SimpleNamespace(loss=np.array([100.0, 10.0, 1.0]))).axes
    search, finish = axes.lines
    np.testing.assert_allclose(search.get_ydata(), [100.0, 10.0])
    np.testing.assert_allclose(finish.get_xydata(), [[2.0, 1.0]])


@pytest.mark.parametrize("drag, told", [(0.49, True), (0.51, False)])
def test_a_suspension_twice_as_fast_as_its_particles_is_told(drag, told):
    parameters = SimpleNamespace(f_w=np.array(0.7), f_s=np.array(1.0), f_v=np.array(drag / 0.7))
    experiment = SimpleNamespace(
        samples=[SimpleNamespace(name="A")],
        suspension_of=lambda *_: SimpleNamespace(parameters=parameters),
    )
    problem = SimpleNamespace(experiment=experiment)
    told_of = list(remarks._faster_than_alone(problem, SimpleNamespace(theta=None)))
    assert bool(told_of) == told
    if told:
        assert "falls 2.04 times faster" in told_of[0] and "= 0.49" in told_of[0]


@pytest.mark.parametrize(
    "ends, words",
    [
        ((2.0, 5.0), "2 to 5"),
        ((0.0, 5.0), "beyond 1 to 5"),
        ((2.0, np.inf), "2 to beyond 9"),
        ((0.0, np.inf), "not bounded within 1 to 9"),
    ],
)
def test_an_end_that_was_not_found_is_said_with_the_limits_of_the_search(ends, words):
    one = {"profile": {"95 %": ends}, "profile_within": [1.0, 9.0]}
    assert formatting.interval(one, "95 %") == words
    assert formatting.interval({"profile": None}, "95 %") == "unbounded"


def test_a_value_far_from_its_prior_is_told():
    """ln 4 is 2.8 standard deviations of 0.5, ln 5 3.2; odds are told as the value they are of."""
    parameters = (
        FreeParameter("f_s", "f_s", ("A",), 1.0, 0.5),
        FreeParameter("share", "share", ("A",), 0.6, 0.5, (0.5, 0.7)),
        FreeParameter("f_v", "f_v", ("A",), 1.0, None),
    )
    problem = SimpleNamespace(
        experiment=SimpleNamespace(parameters=parameters),
        priors={one.variable: one.prior for one in parameters[:2]},
    )
    middle = np.log(parameters[1].prior.median)
    far = SimpleNamespace(values=np.array([5.0, np.exp(middle - 2.0), 1e9]))
    first, second = remarks._against_priors(problem, far)
    assert first.startswith("f_s = 5 is 3.2 standard deviations of its prior from its median, 1:")
    assert second.startswith("share = 0.5238 is 4 ") and "median, 0.6:" in second
    near = SimpleNamespace(values=np.array([4.0, np.exp(middle + 1.0), 1e9]))
    assert list(remarks._against_priors(problem, near)) == []


@pytest.mark.parametrize(
    "null, key", [(0.0, "bounded_on_one_side"), (0.7, "carried_by_priors_alone")]
)
def test_what_the_data_bound_on_one_side_is_no_prior_s_alone(null, key):
    found = SimpleNamespace(
        status={"a": "prior only"},
        standard_errors={"a": 0.1},
        data_standard_errors={"a": np.inf},
        null_exponents=np.array([[1.0, null]]),
        near_combinations=(SimpleNamespace(exponents={"a": 1.0}),),
    )
    assert tables._why_open(found, "a", 1) == key
    found.near_combinations = (SimpleNamespace(exponents={"a": 1.0, "b": 2.0}),)
    assert tables._why_open(found, "a", 1) == "told_together"


def test_beside_a_misfit_values_are_as_good_as_the_model():
    """Errors are as stated and scaled, and an optimum is as good that such a misfit allows."""
    row = {"determined": True, "status": "determined"}
    assert formatting.determination(row, misfit=True) == "if the model is right"
    result = {"misfit": True, "errors": "stated", "error_scale": 3.0}
    said = words._sentence_before_values(result)
    assert "which does not fit" in said and "about 3 times" in said
    others = [OPTIMUM, OTHER | {"half_sum_of_squares": 52.7 + 1.91 * 9}]
    (line,) = words._optima(result | {"chi_squared": 105.19, "optima": others}, words.TERMINAL.code)
    assert "as good, beside such a misfit: data and priors do not tell the two apart" in line
    assert words._number_of_combinations(1, 1) == "The data determine the fitted value:"
    assert "above held" not in words._null_direction("`a`", unchanged=False, others=False)
