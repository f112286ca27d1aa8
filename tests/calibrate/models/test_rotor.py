"""A centrifuge in fits: predictions, a fit of a synthetic curve, what an experiment states."""

from collections import OrderedDict
from dataclasses import replace

import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.comparison import effects
from calibrate.experiment import consistency
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.plausibility import refuse_senseless
from calibrate.experiment.sample import Measurement, Sample
from calibrate.experiment.suspension import suspension
from calibrate.models import tube
from calibrate.models.closed_form import closed_form
from calibrate.models.column import column
from calibrate.models.particles import particles

ROTOR = mrjax.Rotor(speed=1500.0, top_radius=0.10, floor_radius=0.13, shape="sector")
HEIGHT, BED = 0.03, 0.3
RECIPE = mrjax.Recipe(
    name="slurry",
    particle={"density": 2700.0, "diameter": 3e-6},
    fluid={"density": 998.0, "viscosity": 1e-3},
    composition={"volume_fraction": 0.1},
    drag={"f_w": "richardson-zaki", "local": True},
)


def spun(theta):
    return suspension(
        RECIPE, theta.get("bed_fraction", BED), theta | {"gravity": ROTOR.floor_acceleration}
    )


FALL = HEIGHT / float(mrjax.terminal_velocity(spun({}).parameters))
SAMPLE = Sample(
    "A", RECIPE, HEIGHT, None, (), tuple(FALL * np.linspace(0.05, 3.0, 14)), rotor=ROTOR
)


@pytest.fixture(scope="module")
def predict():
    return column(SAMPLE, spun({}))


def test_the_prediction_is_the_column_in_a_rotor(predict):
    """The mudline, and with it the fields that a report draws; initial velocity and final ratio."""
    prediction = predict(spun({}))
    fields = tube.tube(SAMPLE, spun({}), BED)
    at_readings = np.interp(SAMPLE.times, fields.times, fields.mudline)
    np.testing.assert_allclose(prediction["mudline"], at_readings, atol=5e-3 * HEIGHT)
    first = SAMPLE.times[0]
    fallen = HEIGHT - float(prediction["mudline"][0])
    assert fallen / first == pytest.approx(float(prediction["initial_velocity"]), rel=0.03)
    gravity = float(mrjax.terminal_velocity(RECIPE.parameters()))
    relative = (1500.0 * np.pi / 30) ** 2 * 0.10 / 9.81
    assert float(prediction["initial_velocity"]) == pytest.approx(gravity * relative, rel=2e-3)
    rest = 0.13 - np.sqrt(0.13**2 - 0.1 / BED * (0.13**2 - 0.10**2))
    assert float(prediction["final_ratio"]) == pytest.approx(rest / HEIGHT, rel=1e-9)
    assert float(prediction["sedimentation_ratio"][-1]) == pytest.approx(rest / HEIGHT, rel=1e-6)
    delay = FALL / 2
    later = predict(spun({}), mrjax.delayed_times(np.array(SAMPLE.times), delay))
    np.testing.assert_allclose(predict(spun({"delay": delay}))["mudline"], later["mudline"])


def test_a_fit_finds_drag_and_bed_of_a_synthetic_curve(predict):
    truth = {"f_s": 1.3, "bed_fraction": 0.27, "f_w.exponent": 5.2}
    readings = predict(spun(truth))["mudline"]
    fitted = calibrate.fit(
        lambda theta: (predict(spun(theta))["mudline"] - readings) / (1e-3 * HEIGHT),
        OrderedDict({"f_s": 1.0, "bed_fraction": 0.3, "f_w.exponent": 4.65}),
    )
    assert fitted.converged and dict(fitted.theta) == pytest.approx(truth, rel=1e-4)


def test_other_models_refuse_a_rotor():
    for make, word in ((closed_form, "closed-form"), (particles, "particles")):
        with pytest.raises(mrjax.InputError, match=f"the model {word} has no rotor; fit with col"):
            make(SAMPLE, spun({}))


def test_a_bed_in_a_sector_may_be_lower_than_its_particles_in_a_straight_tube():
    """At 0.12 of a long sector; without the rotor that is below the volume of the particles."""
    long = replace(ROTOR, top_radius=0.04)
    low = Measurement("sedimentation_ratio", 0.095, 1e-3, "1", 1.0, 1)
    curve = (low._replace(value=1.0, place=0), low)
    sample = Sample("A", RECIPE, 0.09, BED, curve, (0.0, 1e3), rotor=long)
    assert refuse_senseless(sample) == []
    with pytest.raises(mrjax.InputError, match="less than the particles alone would fill"):
        refuse_senseless(replace(sample, rotor=None))


SHEET = """
name = "slurry"
particle = {{density = 2700.0, diameter = {diameter}}}
fluid = {{density = 998.0, viscosity = 1e-3{fluid}}}
composition = {{volume_fraction = 0.1}}
"""
EXPERIMENT = """
name = "centrifuge"
[[sample]]
name = "A"
recipe = "recipe.toml"
rotor = {{speed = 1500, top_radius = {top}, floor_radius = 0.13, shape = "{shape}"}}
{sample}
final_ratio = {{value = 0.3, standard_deviation = 0.01}}
[[parameter]]
name = "{name}"
median = 0.5
log_standard_deviation = 0.3
"""


def experiment(folder, sample="", name="f_s", top=0.10, shape="sector", fluid="", diameter="3e-6"):
    (folder / "recipe.toml").write_text(SHEET.format(fluid=fluid, diameter=diameter), "utf-8")
    text = EXPERIMENT.format(sample=sample, name=name, top=top, shape=shape)
    (folder / "spun.toml").write_text(text, "utf-8")
    return Experiment.load(folder / "spun.toml")


def test_an_experiment_states_a_rotor(tmp_path):
    """Its height is that between the radii, and gravity the acceleration of its floor."""
    stated = 'initial_velocity = {value = 2.6, unit = "mm/s", standard_deviation = 0.1}'
    loaded = experiment(tmp_path, f"bed_fraction = 0.3\ntube_diameter = 0.002\n{stated}")
    sample = loaded.samples[0]
    assert sample.rotor == ROTOR and sample.height == pytest.approx(HEIGHT)
    of_sample = loaded.suspension_of(sample, loaded.start)
    assert float(of_sample.parameters.gravity) == pytest.approx((50 * np.pi) ** 2 * 0.13)
    assert not loaded.warnings  # neither of the speed nor of a narrow tube
    assert experiment(tmp_path, "height = 0.03000001").samples[0].height == pytest.approx(HEIGHT)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"sample": "height = 0.05"}, "height = 0.05: must be that between the radii"),
        ({"top": 0.14}, "rotor.top_radius = 0.14: must be below floor_radius, 0.13"),
        ({"shape": "round"}, "shape"),
        ({"sample": "tube = {tilt = 1.0, gap = 0.01}"}, "a rotor and a tilt are not combined"),
        ({"sample": "compression = {stress = 1.0}"}, "a rotor and a compression are not"),
        ({"name": "gravity"}, "a rotor and gravity as a parameter are not"),
        ({"sample": 'bed_fraction = "particles"'}, 'a rotor and bed_fraction = "particles"'),
        ({"diameter": "[3e-6, 4e-6]"}, "a rotor and particles of several sizes"),
        ({"name": "geometric_standard_deviation"}, "a rotor and particles of several sizes"),
        ({"fluid": ", yield_stress = 0.01"}, "a rotor and a carrier with a yield stress"),
    ],
)
def test_refused_in_one_line(tmp_path, given, message):
    with pytest.raises(mrjax.InputError, match=message) as refusal:
        experiment(tmp_path, **given)
    assert "\n" not in str(refusal.value)


def test_a_yielding_bed_and_a_spread_of_sizes_are_refused_in_a_rotor():
    """Also where no file was read, as in a comparison of models."""
    soft = mrjax.Compression(gel_fraction=0.2, stress=10.0, exponent=3.0)
    for changes, words in (({"compression": soft}, "its bed yields"), ({"spread": 1.5}, "sizes")):
        with pytest.raises(mrjax.InputError, match=words):
            column(SAMPLE, replace(spun({}), **changes))
    experiment = Experiment("spun", (SAMPLE,), ())
    assert "in a rotor" in effects.refusal(experiment, effects.YIELDING_BED)
    assert "in a rotor" in effects.refusal(experiment, effects.SIZES)
    assert effects.refusal(experiment, effects.DELAY_AT_START) is None


def test_volumes_in_a_sector_tube_are_refused():
    """They are not in proportion to heights; those of a straight tube are."""
    readings = tuple(
        Measurement("mudline", volume, 0.1, "mL", 1e-3, place)
        for place, volume in enumerate((9.0, 5.0))
    )
    sample = replace(SAMPLE, measurements=readings, times=SAMPLE.times[:2])
    with pytest.raises(mrjax.InputError, match=r"volumes of a sector tube \(give heights\)"):
        consistency._refuse_rotor(sample, [], "spun.toml")
    straight = replace(ROTOR, shape="straight")
    consistency._refuse_rotor(replace(sample, rotor=straight), [], "spun.toml")
