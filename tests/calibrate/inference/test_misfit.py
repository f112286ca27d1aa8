"""Readings that do not agree: what is said of them, and from where on a fit is not trusted."""

from types import SimpleNamespace

import numpy as np
import pytest

import calibrate
from calibrate import Experiment, Problem, report
from calibrate.inference import misfit

VELOCITY = """
[[sample]]
name = "{name}"
recipe = "case2"
initial_velocity = {{value = {value}, standard_deviation = {error}, unit = "mm/day"}}
"""
PARAMETER = '[[parameter]]\nname = "{name}"\nmedian = {median}\n'


def fitted(folder, readings, parameters=(("f_w", 50.0),), **options):
    """A fit of velocities in mm/day with their errors."""
    samples = "".join(
        VELOCITY.format(name=f"S{place}", value=value, error=error)
        for place, (value, error) in enumerate(readings)
    )
    asked = "".join(PARAMETER.format(name=name, median=median) for name, median in parameters)
    (folder / "mine.toml").write_text(f'name = "mine"\n{samples}{asked}')
    problem = Problem.prepare(Experiment.load(folder / "mine.toml"), "closed-form")
    fit = calibrate.fit(problem.residuals, problem.start, bounds=problem.bounds, **options)
    return problem, fit, calibrate.identify(fit), np.asarray(problem.predict(fit.theta))


@pytest.mark.parametrize(
    "readings, misfits, contradicts",
    [
        ([(8.0, 0.1), (8.1, 0.1), (8.2, 0.1)], False, False),
        # Errors that are stated too small for a spread of a percent of what was measured.
        ([(8.00, 0.001), (8.05, 0.001), (8.10, 0.001)], True, True),
        ([(8.0, 0.001), (16.0, 0.001)], True, True),
        # The same residuals beside readings that span far more.
        ([(8.0, 0.5), (16.0, 0.5)], True, True),
        ([(8.0, 4.0), (16.0, 4.0)], False, False),
    ],
)
def test_readings_contradict_where_their_residuals_are_large_by_themselves(
    tmp_path, readings, misfits, contradicts
):
    found = misfit.agreement(*fitted(tmp_path, readings))
    assert (found.misfit, found.contradicts) == (misfits, contradicts)
    assert found.degrees_of_freedom == len(readings) - 1
    assert (found.error_scale > 2.0) == misfits


@pytest.mark.parametrize(
    "p, share, contradicts", [(1e-7, 0.06, True), (1e-7, 0.04, False), (1e-5, 0.06, False)]
)
def test_readings_contradict_by_chance_and_size_together(p, share, contradicts):
    assert misfit.Agreement(5, 9.0, p, share, 3.0).contradicts == contradicts


def test_a_misfit_that_chance_may_bring_is_no_contradiction(tmp_path):
    problem, fit, said, predicted = fitted(tmp_path, [(1.0, 0.01), (1.02, 0.01), (1.05, 0.01)])
    found = misfit.agreement(problem, fit, said, predicted)
    assert found.p_value == pytest.approx(0.0019, rel=0.1)  # chi-squared 12.7 of 2
    assert found.misfit and not found.contradicts


def test_what_outliers_count_has_no_p_value(tmp_path):
    found = misfit.agreement(*fitted(tmp_path, [(8.0, 0.001), (16.0, 0.001)], robust=2.0))
    assert found.p_value is None and not found.contradicts


def test_as_many_values_as_readings_have_no_p_value(tmp_path):
    found = misfit.agreement(*fitted(tmp_path, [(8.0, 0.1)]))
    assert (found.degrees_of_freedom, found.p_value, found.error_scale) == (0, None, 1.0)


def test_a_misfit_is_said_first(tmp_path):
    problem, fit, said, predicted = fitted(tmp_path, [(8.0, 0.001), (16.0, 0.001)])
    result = report.summary(problem, fit, said, predicted)
    first = report.in_words(result)[0]
    assert first.startswith("The data do not agree with the model, or with each other")
    assert "p < 1e-12" in first and "0.5 of the range of the readings" in first
    assert result["contradicts"] and result["errors"] == "stated"


def test_a_suspension_faster_than_its_particles_is_a_warning(tmp_path):
    problem, fit, said, predicted = fitted(tmp_path, [(8.64e7, 1e6)])
    result = report.summary(problem, fit, said, predicted)
    assert "check unit" in result["warnings"][0]
    assert any("times faster than one of its particles alone" in one for one in result["warnings"])


def test_what_nothing_determines_is_not_printed_as_known(tmp_path):
    """Two velocities of one suspension, and three values: their product alone is known."""
    asked = (("f_w", 50.0), ("f_s", 1.1), ("f_v", 1.0))
    problem, fit, said, predicted = fitted(tmp_path, [(8.0, 0.1), (8.1, 0.1)], asked)
    result = report.summary(problem, fit, said, predicted)
    page = report.markdown("mine", "closed-form", result | {"wall_seconds": 0.0}, {})
    assert result["undetermined"] == ["f_w", "f_s", "f_v"]
    for name, one in result["parameters"].items():
        assert one["status"] == "free" and one["determined"] is False
        (row,) = [line for line in page.splitlines() if line.startswith(f"| `{name}`")]
        assert "±" not in row and "no, free" in row


def test_a_value_that_is_loosely_bounded_has_a_factor_for_an_error(tmp_path):
    """8 +- 4.8: half the logarithm of 12.8 over 3.2 is that of a factor of two."""
    problem, fit, said, predicted = fitted(tmp_path, [(8.0, 4.8)])
    result = report.summary(problem, fit, said, predicted)
    page = report.markdown("mine", "closed-form", result | {"wall_seconds": 0.0}, {})
    assert result["loosely_bounded"] == ["f_w"] and "within a factor of 1.99" in page
    assert "only loosely" in "\n".join(report.in_words(result))


def test_a_value_at_the_end_of_its_meaning_is_noted(tmp_path):
    """A velocity of nearly nothing: f_w ends at the largest factor that a sheet may have."""
    problem, fit, said, predicted = fitted(tmp_path, [(1e-9, 1e-12)])
    result = report.summary(problem, fit, said, predicted)
    assert fit.converged and fit.values[0] == pytest.approx(1e9)
    assert any("f_w ended at 1e+09" in note for note in result["notes"])


def readings_of(*rows):
    """As much of a problem as `misfit` reads, of observables, values and units in SI."""
    measurements = [
        (None, SimpleNamespace(observable=observable, value=value, si=si))
        for observable, value, si in rows
    ]
    measured = np.array([value for _, value, _ in rows])
    return SimpleNamespace(measurements=measurements, measured=measured)


def test_residuals_are_measured_by_the_range_of_their_own_kind():
    """Mudlines of 10 cm and 60 mm span 40 mm, whatever their units; ratios span 0.5."""
    problem = readings_of(
        ("mudline", 10.0, 1e-2), ("mudline", 60.0, 1e-3), ("final_ratio", 0.9, 1.0),
        ("final_ratio", 0.4, 1.0),
    )  # fmt: skip
    off = np.array([0.4, 0.0, 0.0, 0.1])
    share = misfit._share(problem, problem.measured + off)
    assert share == pytest.approx(np.sqrt((0.1**2 + 0.2**2) / 4))


def test_the_range_of_one_reading_is_its_size():
    problem = readings_of(("mudline", -10.0, 1e-2))
    assert misfit._share(problem, np.array([-9.0])) == pytest.approx(0.1)
    assert misfit._share(readings_of(("mudline", 0.0, 1.0)), np.array([0.5])) == pytest.approx(0.5)


@pytest.mark.parametrize("determined, near", [(("a * b",), ()), ((), ("a * b",))])
@pytest.mark.parametrize("robust", [None, 2.0])
def test_degrees_of_freedom_are_readings_less_what_they_determine(robust, determined, near):
    """Of three values two readings of four determine one product, everywhere or near the fit."""
    problem = readings_of(*[("mudline", value, 1.0) for value in (1.0, 2.0, 3.0, 4.0)])
    fit = SimpleNamespace(chi_squared=12.0, robust=robust, values=np.ones(3))
    known = SimpleNamespace(combinations=determined, near_combinations=near)
    found = misfit.agreement(problem, fit, known, np.ones(4))
    assert (found.degrees_of_freedom, found.reduced_chi_squared) == (3, 4.0)
    assert found.error_scale == 2.0 and not found.misfit
    if robust is None:
        assert found.p_value == pytest.approx(0.00738316, rel=1e-5)  # tables of chi-squared
    else:
        assert found.p_value is None
