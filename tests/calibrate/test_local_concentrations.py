"""Concentrations in a tube, fitted: synthetic profiles, and readings at a height."""

import json

import numpy as np
import pytest

import calibrate
from calibrate import Experiment, Problem
from calibrate.experiment.repeats import BEFORE_THE_FIT
from calibrate.inference.forecast import forecast
from calibrate.problem.solve import fit_experiment
from calibrate.report import tables, words
from calibrate.report.fronts import unresolved_fronts
from tests.builders.result_keys import undocumented

RECIPE = """
name = "beads"
particle = {density = 2450.0, diameter = 60e-6}
fluid = {density = 998.0, viscosity = 1e-3}
composition = {volume_fraction = 0.3}
drag = {f_w = "richardson-zaki", local = true}
"""
SHEET = """
name = "tube"
[[sample]]
name = "A"
recipe = "beads.toml"
height = 0.3
bed_fraction = 0.7
[[sample.concentration]]
file = "profile.csv"
time = 3
time_unit = "min"
thickness = 0.01
[[sample.concentration]]
file = "coil.csv"
height = 0.06
thickness = 0.01
[[parameter]]
name = "f_w.exponent"
median = 4.0
log_standard_deviation = 0.3
"""
F_S = """
[[parameter]]
name = "f_s"
median = 1.0
log_standard_deviation = 0.3
"""
TRUTH = {"f_w.exponent": 4.65, "f_s": 1.2}
LEVELS = np.linspace(1.0, 29.0, 29)
MINUTES = np.linspace(0.5, 12.0, 24)


def written(folder, profile, coil, sheet=SHEET):
    """An experiment of volume percent by height in cm, and of g/L by time in min."""
    rows = zip(LEVELS, 100.0 * np.asarray(profile), strict=True)
    lines = "".join(f"{one},{value}\n" for one, value in rows)
    (folder / "profile.csv").write_text(f"z (cm),vol%\n{lines}")
    rows = zip(MINUTES, 2450.0 * np.asarray(coil), strict=True)
    lines = "".join(f"{one},{value}\n" for one, value in rows)
    (folder / "coil.csv").write_text(f"time (min),c (g/L)\n{lines}")
    (folder / "beads.toml").write_text(RECIPE)
    (folder / "tube.toml").write_text(sheet)
    return folder / "tube.toml"


def synthetic(folder, scatter, model, sheet):
    """An experiment with a scatter of volume fractions, of the profile and of the coil."""
    nothing = [np.full(LEVELS.size, 0.3), np.full(MINUTES.size, 0.3)]
    problem = Problem.prepare(Experiment.load(written(folder, *nothing, sheet)), model)
    exact = np.asarray(problem.predict(TRUTH)) * np.repeat([0.01, 1.0], [29, 24])
    noise = np.random.default_rng(0).standard_normal(exact.size)
    noisy = np.abs(exact + np.repeat(scatter, [29, 24]) * noise)
    return written(folder, noisy[:29], noisy[29:], sheet)


@pytest.mark.parametrize(
    "model, sheet",
    [("closed-form", SHEET), pytest.param("column", SHEET + F_S, marks=pytest.mark.slow)],
)
def test_synthetic_profiles_give_their_exponent_and_scatter(tmp_path, model, sheet):
    """Each scatter and each value within three of its standard errors; the report has both."""
    experiment = Experiment.load(synthetic(tmp_path, [0.004, 0.008], model, sheet))
    done = calibrate.run(experiment, model=model)
    out = tmp_path / "out"
    done.write(out)
    said = json.loads((out / "fit.json").read_text("utf-8"))
    assert said["converged"] and not said["misfit"] and said["errors"] == "estimated"
    assert undocumented(said) == set()
    for name, found in said["parameters"].items():
        truth = TRUTH[name]
        assert found["determined"]
        assert abs(found["value"] - truth) < 3.0 * found["standard_error"] < 0.1 * truth
    # Profile in %, coil as a number.
    scatters = {"A, profile at time 3 min": 0.4, "A, concentration at height 0.06 m": 0.008}
    assert list(said["scatter"]) == list(scatters) == list(said["data_as_understood"])
    for name, scatter in scatters.items():
        found = said["scatter"][name]
        assert found["source"] == "fit" and found["degrees_of_freedom"] > 20.0
        assert abs(found["value"] - scatter) < 3.0 * found["standard_error"]
        rows = [one for one in said["predictions"] if name.endswith(one["table"])]
        squares = sum(((one["predicted"] - one["measured"]) / one["sigma"]) ** 2 for one in rows)
        assert squares == pytest.approx(found["degrees_of_freedom"], rel=5e-3)  # errors stay
    free = sum(one["degrees_of_freedom"] for one in said["scatter"].values())
    assert free == pytest.approx(
        29 + 24 - len(said["parameters"]), abs=0.05
    )  # and little by the priors
    first, last = said["predictions"][0], said["predictions"][-1]
    assert (first["height_m"], first["time_s"], first["unit"]) == (0.01, 180.0, "%")
    assert (first["height_unit"], first["time_unit"]) == ("cm", "min")
    assert (last["height_m"], last["time_s"], last["unit"]) == (0.06, 720.0, "1")
    assert last["table"] == "concentration at height 0.06 m" and last["row"] == 25
    assert [one["readings"] for one in said["runs"]] == [29, 24]
    text = (out / "report.md").read_text("utf-8")
    assert "volume fraction at 1 cm and 3 min" in text and "concentrations.png" in text
    assert "volume fraction at 0.06 m and 12 min" in text
    assert "from g/L in 'c (g/L)', at height 0.06 m, mean over 0.01 m" in text.replace("\\", "")
    assert (out / "concentrations.png").is_file() and not (out / "curves.png").exists()
    assert not (out / "predictions.png").exists()


def test_a_scatter_is_told_with_its_unit_and_doubted_where_it_is_large(tmp_path):
    table = {
        "sample": "A",
        "observable": "volume_fraction",
        "unit": "%",
        "table": "profile at time 3 min",
        "source": "fit",
        "value": 12.0,
    }
    table |= {"degrees_of_freedom": 9.0, "standard_error": 2.8}
    said = words._absolute_scatter(table | {"of_initial": 0.4}, str)
    assert "the volume fraction of sample A, profile at time 3 min, 12.0 ± 2.8 %" in said
    assert "It is 40% of the concentration of the suspension: rather a front" in said
    assert "rather" not in words._absolute_scatter(table | {"of_initial": 0.1}, str)


def repeated(folder, noise):
    """A profile of four readings at each height, of which the model misses the shape."""
    levels = np.repeat([2.0, 6.0, 10.0, 25.0], 4)
    lines = "".join(f"{one},{0.3 + off}\n" for one, off in zip(levels, noise, strict=True))
    sheet = SHEET.partition("[[sample.concentration]]")[0]
    sheet += '[[sample.concentration]]\nfile = "r.csv"\ntime = 60\n'
    (folder / "r.csv").write_text(f"z (cm),phi\n{lines}")
    (folder / "beads.toml").write_text(RECIPE)
    (folder / "tube.toml").write_text(f"{sheet}[[parameter]]{SHEET.split('[[parameter]]')[-1]}")
    return Experiment.load(folder / "tube.toml")


def test_repeats_give_the_scatter_before_the_fit(tmp_path):
    noise = 0.01 * np.random.default_rng(3).standard_normal(16)
    experiment = repeated(tmp_path, noise)
    (table,) = experiment.samples[0].concentrations
    mean = noise.reshape(4, 4).mean(1, keepdims=True)
    exact = np.sqrt(np.sum((noise.reshape(4, 4) - mean) ** 2) / 12)
    assert (table.scatter.source, table.scatter.degrees_of_freedom) == ("repeats", 12.0)
    assert table.scatter.value == pytest.approx(exact, rel=1e-12)
    assert all(
        one.standard_deviation == table.scatter.value for one in experiment.samples[0].measurements
    )
    problem, fit = fit_experiment(experiment, "closed-form")
    (sample,) = problem.experiment.samples
    assert sample.concentrations == (table,)
    every = forecast(experiment, fit, sample, "closed-form")
    assert {(one.time, one.time_unit) for one in every} == {(60.0, "s")}
    row = tables.forecasts(every)[-1]
    assert (row["height_m"], row["height_unit"], row["time_s"]) == (0.25, "cm", 60.0)
    assert "volume fraction at 25 cm and 60 s" in words.line(row)


def test_stated_errors_stay_and_few_readings_tell_no_scatter(tmp_path):
    """Two values take all that two readings tell: 10 % of the suspension is assumed."""
    head = SHEET.partition("[[sample.concentration]]")[0].replace("bed_fraction = 0.7\n", "")
    table = '[[sample.concentration]]\nfile = "r.csv"\ntime = 180\nthickness = 0.2\n'
    free = F_S + '[[parameter]]\nname = "bed_fraction"\nmedian = 0.6\n'
    free = free.replace("log_standard_deviation = 0.3\n", "")
    (tmp_path / "r.csv").write_text("z (cm),phi\n3,0.5\n15,0.275\n")
    (tmp_path / "beads.toml").write_text(RECIPE)
    for error, expected in (("", BEFORE_THE_FIT * 0.3), ("standard_deviation = 0.02\n", 0.02)):
        (tmp_path / "tube.toml").write_text(head + table + error + free)
        experiment = Experiment.load(tmp_path / "tube.toml")
        problem, _ = fit_experiment(experiment, "closed-form")
        (sample,) = problem.experiment.samples
        scatter = sample.concentrations[0].scatter
        assert (scatter is None) == bool(error) == (problem.experiment.errors == "stated")
        assert scatter is None or scatter.source == "assumed"
        for one in sample.measurements:
            assert one.standard_deviation == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "minutes, thickness, told", [(1.0, 0.003, 1), (1.0, 0.1, 0), (0.05, 0.003, 0)]
)
def test_a_front_between_readings_is_told(tmp_path, minutes, thickness, told):
    """A mudline at 0.2 m of 0.3 m after four minutes goes 2 cm in one, and 1 mm in 3 s."""
    times = 4.0 + minutes * np.arange(-2, 3)
    lines = "".join(f"{one},0.3\n" for one in times)
    sheet = SHEET.partition("[[sample.concentration]]")[0]
    sheet += f'[[sample.concentration]]\nfile = "c.csv"\nheight = 0.2\nthickness = {thickness}\n'
    (tmp_path / "c.csv").write_text(f"t (min),phi\n{lines}")
    (tmp_path / "beads.toml").write_text(RECIPE)
    (tmp_path / "tube.toml").write_text(sheet + F_S)
    (sample,) = Experiment.load(tmp_path / "tube.toml").samples
    found = list(unresolved_fronts(sample, [0.3, 0.3, 0.3, 0.0, 0.0]))
    assert len(found) == told
    assert not told or "at 0.2 m and 4 min and at 0.2 m and 5 min, and wherever" in found[0]
    assert not list(unresolved_fronts(sample, [0.3, 0.28, 0.25, 0.2, 0.1]))
