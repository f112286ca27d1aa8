"""The workflow as a call: what is asked for is done, and what goes wrong later is collected."""

import dataclasses
import json

import numpy as np
import pytest

import mrjax
from calibrate import Experiment, calibration, run
from calibrate.__main__ import cli
from calibrate.calibration import Options


@pytest.fixture(scope="module")
def fang() -> Experiment:
    return Experiment.load("fang2005")


def test_a_calibration_holds_all_that_was_asked_for(fang, tmp_path):
    done = run(
        fang,
        model="closed-form",
        leave_one_out=True,
        predict=mrjax.Recipe.load("case2"),
        like="A",
        checkpoint=tmp_path,
    )
    assert done.fit.converged and done.faults == () and done.posterior is None
    assert {one.name for one in done.profiles} >= {"f_w", "f_s", "f_v"}
    assert [one.sample for one in done.new] == ["case2", "case2"]
    assert {one.sample for one in done.left_out} == {"A", "B"}
    assert {path.name for path in tmp_path.iterdir()} >= {"fit", "left-out"}
    result = done.tables()
    assert (result["experiment"], result["model"], result["begun_with"], result["seed"]) == (
        "fang2005",
        "closed-form",
        None,
        0,
    )
    assert len(result["left_out"]) == 4 and len(result["new"]) == 2
    np.testing.assert_allclose(done.predictions, [8.0, 78.0, 3.6, 90.0], rtol=0.02)
    assert result["dtype"] == "float64" and "jax" in result["versions"]
    assert 0.0 < result["wall_seconds"] == done.wall_seconds
    done.write(tmp_path / "made" / "here")
    tmp_path = tmp_path / "made" / "here"
    assert {"fit.json", "report.md", "report.html"} <= {path.name for path in tmp_path.iterdir()}


@pytest.mark.parametrize("model, assumed", [("closed-form", 0), ("particles", 2)])
def test_what_is_assumed_for_contacts_is_noted_where_particles_are_run(fang, model, assumed):
    stated = fang.samples[0].recipe.stated
    recipe = mrjax.Recipe(**{key: value for key, value in stated.items() if key != "box"})
    moduli = {"elastic_modulus": None, "poisson_ratio": None, "material": "metal"}
    recipe = recipe.replace(particle=moduli)
    sample = dataclasses.replace(fang.samples[0], recipe=recipe)
    done = run(fang, model="closed-form")
    problem = dataclasses.replace(
        done.problem, experiment=dataclasses.replace(fang, samples=(sample, *fang.samples[1:]))
    )
    changed = dataclasses.replace(
        done, experiment=problem.experiment, problem=problem, options=Options(model)
    )
    before, after = done.tables()["notes"], changed.tables()["notes"]
    assert after[: len(before)] == before and len(after) == len(before) + assumed
    assert all(note.startswith("sample A: ") for note in after[len(before) :])


READ = """
name = "read"
[[sample]]
name = "A"
recipe = "case2"
height = 0.1
bed_fraction = 0.5
curve = {file = "a.csv"}
[[parameter]]
name = "f_w"
median = 50.0
"""


def with_a_curve(folder, content, sheet=READ):
    (folder / "a.csv").write_text(content)
    (folder / "one.toml").write_text(sheet)
    return folder / "one.toml"


def test_a_fit_says_how_it_read_its_data(tmp_path, capsys):
    """One line before the work, and the same in fit.json and the report."""
    content = "# by eye\nTime (d);h [mm];sd;T\n0;100;0,5;20\n1;92;0,5;20\n2;-;;\n3;75,9;0,5;20\n"
    path, out = with_a_curve(tmp_path, content), tmp_path / "out"
    asked = [str(path), "--model", "closed-form", "--out", str(out)]
    cli.main(asked, standalone_mode=False)
    line = (
        "'a.csv' (UTF-8, semicolons, decimal commas): time in day from 'Time (d)', mudline in mm "
        "from 'h [mm]'; 3 readings, 100 mm at 0 day to 75.9 mm at 3 day; standard deviation "
        "0.5 mm, stated; not used: 'T'; without a reading: line 5"
    )
    assert capsys.readouterr().out.splitlines()[0] == f"Sample A: {line}"
    said = json.loads((out / "fit.json").read_text("utf-8"))
    table = said["data_as_understood"]["A"]
    assert (table["line"], table["unit"], table["time_unit"]) == (line, "mm", "day")
    assert (table["first"], table["last"]) == ([0.0, 100.0], [3.0, 75.9])
    assert (table["ignored_columns"], table["left_out"]) == (["T"], [5])
    assert said["errors"] == "stated" and said["p_value"] is not None
    assert "decimal commas" in (out / "report.md").read_text("utf-8")
    for silent in ("--quiet", "--json"):
        cli.main([*asked, silent], standalone_mode=False)
        assert "Sample A:" not in capsys.readouterr().out


def test_without_stated_errors_there_is_no_p(tmp_path):
    content = "time (d),h (mm)\n0,100\n1,92\n2,84.2\n3,75.9\n4,68\n"
    experiment = Experiment.load(with_a_curve(tmp_path, content))
    said = run(experiment, model="closed-form").tables()
    assert said["errors"] == experiment.errors == "estimated" and said["p_value"] is None
    assert not said["contradicts"] and said["data_as_understood"]["A"]["errors"] == "estimated"


def test_of_a_fit_that_did_not_converge_nothing_is_derived(fang, monkeypatch):
    def stuck(*arguments, **options):
        problem, fit = fit_experiment(*arguments, **options)
        return problem, dataclasses.replace(fit, converged=False)

    fit_experiment = calibration.fit_experiment
    monkeypatch.setattr(calibration, "fit_experiment", stuck)
    monkeypatch.setattr(calibration, "sample_posterior", None)  # nothing to be called
    monkeypatch.setattr(calibration, "refuse_without_sampler", lambda: None)
    recipe = mrjax.Recipe.load("case2")
    done = run(fang, model="closed-form", posterior=True, predict=recipe, like="A")
    assert (done.profiles, done.posterior, done.new, done.faults) == ((), None, None, ())


def test_what_goes_wrong_after_the_fit_is_collected_in_its_order(fang, monkeypatch):
    def refused(*_, **__):
        raise mrjax.InputError("no samples")

    def failed(*_, **__):
        raise mrjax.SimulationError("no forecast")

    monkeypatch.setattr(calibration, "sample_posterior", refused)
    monkeypatch.setattr(calibration, "refuse_without_sampler", lambda: None)
    monkeypatch.setattr(calibration.forecast, "leave_one_out", failed)
    done = run(fang, model="closed-form", posterior=True, leave_one_out=True)
    assert list(map(str, done.faults)) == ["no samples", "no forecast"]
    assert done.fit.converged and done.left_out is None
    assert "left_out" not in done.tables()


def test_options_that_an_experiment_cannot_have_are_refused_before_the_fit(fang, monkeypatch):
    monkeypatch.setattr(calibration, "fit_experiment", None)
    recipe = mrjax.Recipe.load("case2")
    with pytest.raises(mrjax.InputError, match="'Z': no such sample"):
        run(fang, model="closed-form", predict=recipe, like="Z")
    alone = dataclasses.replace(fang, samples=fang.samples[:1])
    with pytest.raises(mrjax.InputError, match="has one sample"):
        run(alone, model="closed-form", leave_one_out=True)


def test_a_fit_that_ends_without_numbers_is_no_calibration(fang, monkeypatch):
    def lost(*arguments, **options):
        problem, fit = fit_experiment(*arguments, **options)
        return problem, dataclasses.replace(fit, jacobian=np.nan * fit.jacobian)

    fit_experiment = calibration.fit_experiment
    monkeypatch.setattr(calibration, "fit_experiment", lost)
    with pytest.raises(mrjax.SimulationError, match="where nothing can be predicted"):
        run(fang, model="closed-form")
