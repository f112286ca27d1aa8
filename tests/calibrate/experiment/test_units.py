"""Units and bounds of what is measured and fitted, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

import mrjax
from calibrate.experiment import physical_bounds, plausibility, units
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter, ParameterSheet, free_parameters
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import suspension

near = pytest.approx


def test_units_of_velocity_are_those_of_length_over_time():
    for name, si in units.VELOCITY_UNITS.items():
        length, time = name.split("/")
        assert si == near(units.HEIGHT_UNITS[length] / units.TIME_UNITS[time], rel=1e-15)
    days = {"day": 24 * 3600.0, "week": 7 * 24 * 3600.0}
    assert {"s": 1.0, "min": 60.0, "h": 60.0 * 60.0} | days == units.TIME_UNITS
    assert units.RATIO_UNITS["%"] == 0.01


def test_units_of_height_and_volume_are_those_of_their_prefixes():
    heights, volumes = units.HEIGHT_UNITS, units.VOLUME_UNITS
    assert [heights[one] for one in ("m", "dm", "cm", "mm", "um")] == [1, 0.1, 0.01, 1e-3, 1e-6]
    assert heights["ft"] == near(12 * heights["in"]) and heights["in"] == 25.4 * heights["mm"]
    for volume, edge in (("m3", "m"), ("L", "dm"), ("mL", "cm"), ("uL", "mm")):
        assert volumes[volume] == near(heights[edge] ** 3, rel=1e-12)
    assert volumes["cL"] == near(10 * volumes["mL"]) and volumes["dL"] == near(0.1 * volumes["L"])


@pytest.mark.parametrize(
    "dimension, words, unit",
    [
        (units.TIME, "s Sec SECONDS", "s"),
        (units.TIME, "d Days day.", "day"),
        (units.HEIGHT, "µm μm um micron Micrometres", "um"),
        (units.VOLUME, "ml mL ML cm3 cm³ cm^3 cc Millilitres", "mL"),
        (units.READINGS, "% percent PCT", "%"),
        (units.READINGS, "in inch Inches", "in"),
    ],
)
def test_a_unit_has_many_spellings(dimension, words, unit):
    assert {dimension.named(word) for word in words.split()} == {unit}
    assert dimension.named("furlong") is None and dimension.named("") is None


def test_a_prior_between_bounds_is_that_of_the_odds():
    """At a third of the way, d ln x = d value 3 / (b - a) 3 / 2: 0.01 is 0.225 of 0.2."""
    sheet = ParameterSheet(
        name="bed_fraction", median=0.5 + 0.2 / 3, bounds=[0.5, 0.7], standard_deviation=0.01
    )
    (one,) = free_parameters(sheet, ["A"])
    assert one.start == near(0.5) and one.prior.median == near(0.5)
    assert one.prior.log_standard_deviation == near(0.01 * 4.5 / 0.2)
    assert one.value(one.start) == near(0.5 + 0.2 / 3)
    step = 1e-6
    slope = (one.value(0.5 * np.exp(step)) - one.value(0.5 * np.exp(-step))) / (2 * step)
    assert one.per_log(0.5) == near(slope, rel=1e-6)
    assert one.variable == "odds(bed_fraction)"


def samples_of(*fractions):
    return tuple(
        SimpleNamespace(name=name, recipe=SimpleNamespace(coated_volume_fraction=fraction))
        for name, fraction in zip("ABC", fractions, strict=False)
    )


def test_a_bed_is_denser_than_the_thickest_of_its_own_samples():
    experiment = SimpleNamespace(samples=samples_of(0.3, 0.4, 0.5))
    bed = FreeParameter("bed_fraction", "bed_fraction", ("A", "B"), 0.6, None)
    assert physical_bounds.bounds(experiment, bed) == (near(0.4004), 1.0)


def test_bounds_of_odds_are_those_of_the_value_or_next_to_its_own():
    """Beyond the sheet's bounds 1e-9 of their distance is left: odds of 1e-9 and 1e9."""
    experiment = SimpleNamespace(samples=samples_of(0.55))
    inside = FreeParameter("bed_fraction", "bed_fraction", ("A",), 0.6, None, (0.5, 0.7))
    lower, upper = physical_bounds.bounds(experiment, inside)
    assert lower == near((0.55055 - 0.5) / (0.7 - 0.55055), rel=1e-6)
    assert upper == near(1e9, rel=1e-6)
    above = FreeParameter("bed_fraction", "bed_fraction", ("A",), 0.65, None, (0.6, 0.7))
    assert physical_bounds.bounds(experiment, above) == (near(1e-9), near(1e9, rel=1e-6))


def test_a_leaf_has_the_bounds_of_its_lab_sheet():
    experiment = SimpleNamespace(samples=())

    def bounds(name):
        return physical_bounds.bounds(experiment, FreeParameter(name, name, ("A",), 1.0, None))

    assert bounds("poisson_ratio")[1] == 0.5
    assert bounds("restitution")[1] == 1.0
    assert bounds("f_s") == bounds("f_w.exponent") == (1e-6, 1e9)
    assert bounds("f_r")[0] == 1.0
    assert bounds("radius")[1] < bounds("viscosity")[1]


def test_a_suspension_is_as_thick_as_its_coated_particles(case3):
    """f_r cubed, also where f_r is what varies; the closure follows it."""
    grown = suspension(case3, None, {"f_r": 1.2})
    assert float(grown.volume_fraction) == near(case3.volume_fraction * 1.2**3, rel=1e-12)
    as_given = suspension(case3, None, {})
    assert float(as_given.volume_fraction) == near(case3.coated_volume_fraction, rel=1e-12)
    closed = case3.replace(drag={"f_w": "richardson-zaki"})
    grown = suspension(closed, None, {"f_r": 1.2, "f_w.exponent": 2.0})
    assert float(grown.parameters.f_w) == near((1 - float(grown.volume_fraction)) ** -2, rel=1e-9)
    assert float(suspension(closed, None, {"f_r": 1.2, "f_w": 7.0}).parameters.f_w) == 7.0


def test_what_is_fitted_comes_before_what_is_held(case2):
    sample = Sample("A", case2, 0.1, 0.5, ())
    f_s = FreeParameter("f_s", "f_s", ("A",), 1.1, None)
    held = (("A", "f_s", 5.0), ("A", "f_v", 2.0), ("B", "f_v", 9.0))
    experiment = Experiment("mine", (sample,), (f_s,), held)
    made = experiment.suspension_of(sample, {"f_s": 1.3})
    assert (float(made.parameters.f_s), float(made.parameters.f_v)) == (1.3, 2.0)
    assert made.bed_fraction == 0.5


@pytest.mark.parametrize("observable, value", [("mudline", 0.09), ("sedimentation_ratio", 0.9)])
def test_the_speed_of_a_reading_is_that_of_its_mudline(case2, observable, value):
    """1 cm of 10 in 100 s, less three errors of a millimetre: 70 um/s."""
    scale = value / 0.09
    one = Measurement(observable, value, 1e-3 * scale, "1", 1.0, 1)
    sample = Sample("A", case2, 0.1, None, (one,), (0.0, 100.0))
    assert plausibility._speed(sample, one) == near(70e-6, rel=1e-9)
    assert plausibility._speed(sample, one._replace(place=0)) == 0.0
    assert plausibility._speed(sample, one._replace(observable="final_ratio")) == 0.0


def readings(ratio, error, times=None, recipe=None):
    """Readings of a tube of 1 m, in rows 2, 3 and so on."""
    times = np.arange(float(len(ratio))) if times is None else np.array(times)
    curve = [
        Measurement("mudline", one, error[place], "m", 1.0, int(np.unique(times).searchsorted(at)))
        for place, (one, at) in enumerate(zip(ratio, times, strict=True))
    ]
    curve = [one._replace(row=row) for row, one in enumerate(curve, 2)]
    sample = Sample("A", recipe, 1.0, None, tuple(curve), tuple(np.unique(times)))
    return plausibility.Readings(sample, curve, np.array(ratio), np.array(error), times)


@pytest.mark.parametrize("rise, refused", [(0.5, False), (0.7, True)])
def test_a_rise_counts_beside_the_errors_of_both_readings(rise, refused):
    """Errors of 0.1 and 0.1: three times their sum is 0.6."""
    given = readings([1.0, 0.2, 0.2 + rise], [0.5, 0.1, 0.1])
    if refused:
        words = "mudline = 0.9 m at 2 s is above mudline = 0.2 m at 1 s"
        with pytest.raises(mrjax.InputError, match=words):
            plausibility._refuse_rise(given)
    else:
        plausibility._refuse_rise(given)


def test_repeats_of_one_time_are_no_rise():
    """Two tubes that differ by more than their errors fall side by side."""
    ratio, times = [1.0, 1.0, 0.8, 0.9, 0.7, 0.8], [0.0, 0.0, 1.0, 1.0, 2.0, 2.0]
    plausibility._refuse_rise(readings(ratio, [0.01] * 6, times))
    with pytest.raises(mrjax.InputError, match=r"mudline = 0.9 m at 2 s is above"):
        plausibility._refuse_rise(readings([*ratio[:4], 0.9, 1.0], [0.01] * 6, times))


@pytest.mark.parametrize("drop, told", [(0.019, "told"), (0.021, "refused"), (0.0014, "taken")])
def test_a_first_reading_may_be_a_little_low(drop, told, case2):
    """An error of 0.0005 allows 0.0015; up to 0.02 it is told, beyond refused."""
    given = readings([1.0 - drop, 0.5], [5e-4, 5e-4], recipe=case2)
    if told == "refused":
        with pytest.raises(mrjax.InputError, match="nothing has settled yet"):
            plausibility._start(given)
    else:
        assert len(plausibility._start(given)) == (told == "told")
    assert plausibility._start(given._replace(times=given.times + 1e9)) == []


def test_a_first_reading_soon_after_the_start_is_like_one_at_it(case2):
    """A drop may be true once 100 times the speed of a single particle gives it."""
    parameters = case2.parameters()
    alone = float(mrjax.terminal_velocity(parameters.replace(f_w=1.0, f_s=1.0, f_v=1.0)))
    late = 0.1 / (plausibility.FASTER_AT_FIRST * alone)
    given = readings([0.9, 0.5], [5e-4, 5e-4], [0.0, 1e9], recipe=case2)
    assert plausibility._start(given._replace(times=np.array([1.01 * late, 1e9]))) == []
    with pytest.raises(mrjax.InputError, match="nothing has settled yet"):
        plausibility._start(given._replace(times=np.array([0.99 * late, 1e9])))
