"""A tube with a yielding bed, and a delay: predictions, a fit of synthetic readings, refusals."""

from collections import OrderedDict
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.experiment import particle_network
from calibrate.experiment.experiment import Experiment
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import COMPRESSION, suspension
from calibrate.inference.forecast import sample_like
from calibrate.models.closed_form import closed_form
from calibrate.models.column import column

HEIGHT = 0.3
TRUTH = {
    "compression.gel_fraction": 0.08,
    "compression.stress": 3.0,
    "compression.exponent": 2.5,
    "f_s": 1.2,
}
RECIPE = mrjax.Recipe(
    name="slurry",
    particle={"density": 2700.0, "diameter": 3e-6},
    fluid={"density": 998.0, "viscosity": 1e-3},
    composition={"volume_fraction": 0.03},
    drag={"f_w": {"closure": "richardson-zaki", "exponent": 12.0}, "local": True},
)


def tube(**changes):
    return suspension(RECIPE, None, TRUTH | changes)


FALL = HEIGHT / float(mrjax.terminal_velocity(tube().parameters))
SAMPLE = Sample("A", RECIPE, HEIGHT, None, (), times=tuple(FALL * np.geomspace(0.1, 200.0, 14)))


@pytest.fixture(scope="module")
def predict():
    return column(SAMPLE, tube())


def test_the_mudline_is_that_of_the_column(predict):
    prediction = predict(tube())
    exact = mrjax.column(
        tube().parameters,
        height=HEIGHT,
        volume_fraction=0.03,
        bed_fraction=0.74,
        times=np.array(SAMPLE.times),
        hindrance=RECIPE.hindrance,
        compression=tube().compression,
    )
    np.testing.assert_allclose(prediction["mudline"], exact.mudline, atol=2e-3 * HEIGHT)
    assert float(prediction["final_ratio"]) == pytest.approx(
        float(exact.sedimentation_ratio[-1]), rel=1e-3
    )
    assert float(prediction["sedimentation_ratio"][-1]) < 0.7 * 0.03 / 0.08  # it has yielded


def test_a_delay_is_a_clock_that_lags(predict):
    times = np.array(SAMPLE.times)
    delay = 0.3 * FALL
    later = predict(tube(delay=delay), times)
    lagging = mrjax.delayed_times(times, delay)
    np.testing.assert_allclose(lagging, times - delay * (1.0 - np.exp(-times / delay)), rtol=1e-12)
    np.testing.assert_allclose(later["mudline"], predict(tube(), lagging)["mudline"], rtol=1e-9)
    by_closed_form = closed_form(
        Sample("A", RECIPE, HEIGHT, 0.1, (), times=SAMPLE.times), tube_rigid()
    )
    slower = by_closed_form(tube_rigid(delay=delay))["mudline"]
    assert float(slower[0]) > float(by_closed_form(tube_rigid())["mudline"][0])
    slope = jax.grad(lambda delay: predict(tube(delay=delay))["mudline"][2])(delay)
    step = 1e-4 * delay
    central = [float(predict(tube(delay=delay + side))["mudline"][2]) for side in (step, -step)]
    assert float(slope) == pytest.approx((central[0] - central[1]) / (2 * step), rel=1e-5)


def tube_rigid(**changes):
    return suspension(RECIPE, 0.1, changes)


def test_a_gel_point_above_the_densest_bed_is_refused():
    with pytest.raises(mrjax.InputError, match=r"gel_fraction = 0.9 must be below 0.74") as refusal:
        column(SAMPLE, tube(**{"compression.gel_fraction": 0.9}))
    assert "\n" not in str(refusal.value)


def test_a_fit_finds_the_coefficients_of_a_synthetic_mudline(predict):
    readings = predict(tube())["mudline"]

    def residuals(theta):
        return (predict(tube(**theta))["mudline"] - readings) / (1e-3 * HEIGHT)

    # Far above the gel point gel_fraction and exponent are confounded with the stress.
    varied = {name: TRUTH[name] for name in ("compression.stress", "f_s")}
    start = OrderedDict((name, 1.15 * value) for name, value in varied.items())
    fit = calibrate.fit(residuals, start)
    assert fit.converged
    assert dict(fit.theta) == pytest.approx(varied, rel=1e-4)


SHEET = """
name = "slurry"
particle = {{density = 2700.0, diameter = 3e-6}}
fluid = {{density = 998.0, viscosity = 1e-3{fluid}}}
composition = {{volume_fraction = 0.03}}
"""
EXPERIMENT = """
name = "tube"
[[sample]]
name = "A"
recipe = "recipe.toml"
height = 0.3
{sample}
final_ratio = {{value = 0.5, standard_deviation = 0.01}}
{parameters}
"""


def experiment(folder, sample, *names, fluid=""):
    parameters = "".join(
        f'[[parameter]]\nname = "{name}"\nmedian = 0.5\nlog_standard_deviation = 0.3\n'
        for name in names
    )
    (folder / "recipe.toml").write_text(SHEET.format(fluid=fluid), "utf-8")
    path = folder / "tube.toml"
    path.write_text(EXPERIMENT.format(sample=sample, parameters=parameters), "utf-8")
    return Experiment.load(path)


def test_an_experiment_states_and_fits_a_bed_and_a_delay(tmp_path):
    stated = "compression = {gel_fraction = 0.08, exponent = 2.5}\ndelay = 20.0"
    loaded = experiment(tmp_path, stated, "compression.stress")
    sample = loaded.samples[0]
    assert sample.tube == {
        "delay": 20.0, "compression.gel_fraction": 0.08, "compression.exponent": 2.5,
    }  # fmt: skip
    of_sample = loaded.suspension_of(sample, loaded.start)
    assert float(of_sample.compression.stress) == 0.5 and float(of_sample.delay) == 20.0
    with pytest.raises(mrjax.InputError, match="the model closed-form is rigid"):
        closed_form(sample, of_sample)


def test_a_bed_may_be_that_of_particles(tmp_path, monkeypatch):
    calls = []

    def simulated(recipe):
        calls.append(recipe.name)
        law = mrjax.Compression(gel_fraction=0.25, stress=3.0, exponent=7.0)
        return SimpleNamespace(compression=law)

    monkeypatch.setattr(mrjax, "compressive_yield", simulated)
    monkeypatch.setattr(particle_network, "_known", {})
    for _ in range(2):
        (sample,) = experiment(tmp_path, 'compression = "particles"', "f_s").samples
    assert sample.tube == {
        "compression.gel_fraction": 0.25, "compression.stress": 3.0, "compression.exponent": 7.0,
    }  # fmt: skip
    assert calls == ["slurry"]  # once for each recipe


def test_a_bed_of_particles_without_attraction_is_refused(tmp_path):
    with pytest.raises(mrjax.InputError, match=r"sample 'A': compression: .*no attraction"):
        experiment(tmp_path, 'compression = "particles"', "f_s")


@pytest.mark.parametrize(
    "sample, names, message",
    [
        ("", ("compression.stress",), "compression.gel_fraction is missing; state it"),
        ("delay = 5.0", ("delay", *COMPRESSION), "has delay = 5 of its own"),
        ('bed_fraction = "particles"', COMPRESSION, "is that of a rigid bed"),
        ("compression = {stress = -1.0}", ("f_s",), "stress.*above zero"),
        ("delay = 0.0", ("f_s",), "delay.*above 0"),
    ],
)
def test_refused_in_one_line(tmp_path, sample, names, message):
    with pytest.raises(mrjax.InputError, match=message) as refusal:
        experiment(tmp_path, sample, *names)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("sample, names", [("", COMPRESSION), ("delay = 5.0", ("f_s",))])
def test_an_ageing_carrier_has_neither_delay_nor_yielding_bed(tmp_path, sample, names):
    with pytest.raises(mrjax.InputError, match="a yield stress that grows are not combined"):
        experiment(tmp_path, sample, *names, fluid=", yield_growth = 1e-6")


def test_a_forecast_has_the_tube_of_its_sample(tmp_path):
    stated = "compression = {gel_fraction = 0.08, exponent = 2.5}"
    loaded = experiment(tmp_path, stated, "compression.stress")
    joined, sample = sample_like(loaded, RECIPE, "A")
    assert sample.tube == loaded.samples[0].tube
    assert [one.observable for one in sample.measurements] == ["initial_velocity", "final_ratio"]
    assert joined.suspension_of(sample, joined.start).compression is not None
