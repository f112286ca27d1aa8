"""The command lines: the files they write, one clear line for every failure, clean interruption."""

import csv
import json
import re
import signal
from functools import partial
from pathlib import Path

import click
import gsd.hoomd
import numpy as np
import pytest
from PIL import Image

import calibrate.__main__
import mrjax.__main__
from mrjax import Recipe, load_run
from tests.builders.commands import SMALL, start
from tests.builders.result_keys import documented, undocumented

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12


def run(*arguments, module="mrjax", folder: Path, environment=None) -> tuple[int, str, str]:
    process = start(*arguments, module=module, folder=folder, environment=environment)
    out, err = process.communicate(timeout=300)
    return process.returncode, out, err


@pytest.mark.parametrize("dtype", ["float64", pytest.param("float32", marks=pytest.mark.slow)])
def test_simulate_writes_its_files(tmp_path, dtype):
    """With a duration: twenty relaxation times, of the real moduli."""
    arguments = ("case3", "--duration", "1.5e-7", "--out", "made/here", "--frames", "20")
    arguments += ("--seed", "5", "--dtype", dtype, *(("--json",) if dtype == "float32" else ()))
    status, out, err = run("simulate", *arguments, folder=tmp_path)
    assert status == 0 and "follow 100 %" in err and "of 100 steps" in err and "1.5e-07 s" in err
    folder = tmp_path / "made" / "here"
    summary = json.loads((folder / "summary.json").read_text())
    assert set(summary) == documented("summary.json") - documented("Runs to rest")
    if dtype == "float32":
        assert json.loads(out) == summary
    else:
        assert "292 particles settle at 4.895" in out
        assert "2.78% of the weight" in out
        assert "Reynolds 1.4e-08 (below 0.1)" in out and "Peclet 1.2e+03 (above 10)" in out
    assert summary["settling_velocity_mm_per_day"] == near(4.8955, rel=1e-4)
    assert summary["reynolds_number"] == near(1.41e-8, rel=1e-3)
    assert summary["particles"] == 292
    assert summary["volume_fraction"] == near(0.31284, rel=1e-4)
    assert summary["f_w"] == near(48.985, rel=1e-6)
    assert summary["steps"] * summary["time_step_s"] == near(summary["duration_s"])
    assert summary["wall_seconds"] > 0 and summary["seed"] == 5 and summary["dtype"] == dtype
    with (folder / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "time_s",
        "mudline_m",
        "sedimentation_ratio",
        "mean_velocity_m_per_s",
    ]
    assert len(rows) == 21 and float(rows[0]["time_s"]) == 0.0
    assert float(rows[-1]["mudline_m"]) == near(
        float(rows[-1]["sedimentation_ratio"]) * 50e-6, rel=1e-6
    )
    assert sorted(path.name for path in folder.iterdir()) == [
        "curve.csv",
        "mrjax-results.json",
        "run.npz",
        "settling.png",
        "summary.json",
    ]
    # What made it stands in all but the CSV, and makes it again.
    with Image.open(folder / "settling.png") as image:
        drawn_by = json.loads(image.text["Description"])
    kept, made_by = load_run(folder / "run.npz")
    assert made_by == drawn_by == {name: summary[name] for name in made_by}
    assert Recipe.model_validate(made_by["lab_sheet"]) == Recipe.load("case3")
    assert (made_by["seed"], made_by["dtype"]) == (5, dtype) and "jax" in made_by["versions"]
    assert kept.times.dtype == dtype and kept.trajectory is None
    assert [float(row["mudline_m"]) for row in rows] == [float(top) for top in kept.mudline]


@pytest.fixture(scope="module")
def at_rest(tmp_path_factory):
    """`mrjax simulate` of an ensemble of two, to rest: what it says, and the folder it made."""
    folder = tmp_path_factory.mktemp("rest")
    (folder / "small.toml").write_text(SMALL)
    arguments = ("small.toml", "--ensemble", "2", "--seed", "3", "--frames", "25", "--quiet")
    arguments += ("--pdf", "--trajectory", "gsd", "--trajectory", "vtk", "--animate", "gif")
    status, out, err = run("simulate", *arguments, folder=folder)
    assert (status, out, err) == (0, "", "")
    return folder / "run"


def test_a_run_to_rest_is_summarised(at_rest):
    summary = json.loads((at_rest / "summary.json").read_text())
    assert set(summary) == documented("summary.json") | documented("Runs to rest")
    first, second = summary["final_ratios"]
    assert min(first, second) > 0.4 and max(first, second) < 0.95 and first != second
    assert summary["final_ratio"] == near((first + second) / 2)
    # Of two: half of their difference.
    assert summary["final_ratio_standard_error"] == near(abs(first - second) / 2)
    heights = summary["final_ratio_by_height"]
    assert set(heights) == {
        "top",
        "mean-of-top",
        "mass-quantile",
        "half-concentration",
        "twice-centre-of-mass",
    }
    assert heights["top"] == near(summary["final_ratio"])
    # The top is the highest of them, and none is below half of it.
    assert all(0.5 * heights["top"] < height <= heights["top"] for height in heights.values())
    assert summary["ensemble"] == 2 and summary["seed"] == 3 and summary["particles"] == 20
    assert 1e-10 < summary["softening"] < 1e-6
    assert 0.025 / 2 < summary["deepest_overlap_radii"] < 0.025 * 1.6
    assert 3.0 < summary["coordination_number"] < 6.5  # 6 without friction, less at walls
    assert 0 < summary["speed_at_rest_over_initial"] < 2e-3
    assert summary["steady"] is True and summary["notes"] == []
    assert summary["f_w"] == 48.985 and summary["f_w_is_local"] is False
    # The rise is that of the real moduli; the curve begins with its velocity.
    velocity = summary["settling_velocity_mm_per_day"]
    assert velocity == near(summary["closed_form_mm_per_day"], rel=1e-6)
    assert 0.5 * velocity < summary["initial_slope_mm_per_day"] <= velocity * (1 + 1e-6)
    metres_per_second = 1e-3 / 86400 * summary["initial_slope_mm_per_day"]
    crossing = 20e-6 * (1 - summary["final_ratio"]) / metres_per_second
    # A mean of quotients, not a quotient of means.
    assert summary["asymptotes_cross_at_s"] == near(crossing, rel=0.1)
    assert summary["asymptotes_cross_at_s"] < summary["duration_s"]
    assert summary["steps"] * summary["time_step_s"] == near(summary["duration_s"])


def test_a_run_to_rest_writes_the_mean_curve(at_rest):
    summary = json.loads((at_rest / "summary.json").read_text())
    with (at_rest / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        "time_s",
        "mudline_m",
        "sedimentation_ratio",
        "mean_velocity_m_per_s",
        "standard_error_of_ratio",
    ]
    last = {name: float(value) for name, value in rows[-1].items()}
    assert last["time_s"] == near(summary["duration_s"])
    assert last["sedimentation_ratio"] == near(summary["final_ratio"])
    assert last["standard_error_of_ratio"] == near(summary["final_ratio_standard_error"])
    assert last["mudline_m"] == near(20e-6 * summary["final_ratio"])
    ratios = [float(row["sedimentation_ratio"]) for row in rows]
    # Particles that move below may lift the highest: by less than 1e-4 of the box.
    assert ratios[0] == near(1.0, rel=0.05) and ratios[-1] < min(ratios) + 1e-4


def test_a_run_to_rest_is_drawn_and_kept(at_rest):
    summary = json.loads((at_rest / "summary.json").read_text())
    starts = ("seed-3", "seed-4")
    assert {path.name for path in at_rest.iterdir()} == {
        *("summary.json", "curve.csv", "run.npz", "mrjax-results.json"),
        *(f"{name}.png" for name in ("settling", "concentration", "particles")),
        *(f"{name}.pdf" for name in ("settling", "concentration", "particles")),
        *(f"settling-{seed}.gif" for seed in starts),
        *(f"trajectory-{seed}{end}" for seed in starts for end in (".gsd", ".pvd", "")),
    }
    for figure in at_rest.glob("*.pdf"):
        written = figure.read_bytes()
        assert written.startswith(b"%PDF") and b"lab_sheet" in written
    runs, made_by = load_run(at_rest / "run.npz")
    assert made_by["overlap_radii"] == summary["overlap_radii"] == 0.025
    ratio = runs.mudline[:, -1] / runs.initial_height
    assert list(ratio) == near(summary["final_ratios"])
    for number, seed in enumerate(starts):
        frames = len(runs.times[number])
        assert len(list((at_rest / f"trajectory-{seed}").glob("*.vtu"))) == frames
        with Image.open(at_rest / f"settling-{seed}.gif") as film:
            assert film.n_frames > 20
        with gsd.hoomd.open(at_rest / f"trajectory-{seed}.gsd", "r") as read:
            assert len(read) == frames
            assert json.loads(read[0].log["metadata"].tobytes()) == made_by
            height = read[-1].particles.position[:, 2].astype(float) + 10.0
        np.testing.assert_allclose(height, 1e6 * runs.heights[number, -1], rtol=0, atol=2**-20)


def test_a_new_recipe_is_commented_and_its_options_work(tmp_path):
    assert run("new", "mine.toml", folder=tmp_path)[0] == 0
    text = (tmp_path / "mine.toml").read_text()
    Recipe.load(tmp_path / "mine.toml")
    # All at once, and room for the coating.
    lines = text.replace("#? ", "").replace("particle = 0.80", "particle = 0.784").splitlines()
    diameters = [line for line in lines if line.startswith("diameter")]
    weights = [line for line in lines if line.split(" ")[0] in ("particle", "fluid", "coating")]
    alone = ("volume_fraction", "concentration", "solids_ratio")
    ways = [weights, *([line] for line in lines if line.startswith(alone))]
    assert text.count("#? ") > 20 and len(diameters) == 5
    assert len(weights) == 3 and len(ways) == 4
    for way in ways:
        for diameter in diameters:
            dropped = {*diameters, *(line for other in ways for line in other)} - {diameter, *way}
            chosen = [line for line in lines if line not in dropped]
            (tmp_path / "all.toml").write_text("\n".join(chosen))
            found = Recipe.load(tmp_path / "all.toml")
            assert found.volume_fraction == pytest.approx(0.33, abs=0.03)
    status, _, err = run("new", "mine.toml", folder=tmp_path)
    assert status == 2 and "is there already" in err
    status, _, err = run("new", "nowhere/mine.toml", folder=tmp_path)
    assert status == 3 and err.count("\n") == 1 and "cannot be written" in err


def test_check_shows_what_follows(tmp_path):
    status, out, err = run("check", "case2", folder=tmp_path)
    assert status == 0 and err == ""
    assert "particles in the box" in out and "9.1164 mm/day" in out
    status, out, err = run("check", "case3", "--json", folder=tmp_path)
    found = json.loads(out)
    assert found["recipe"] == "case3" and found["warnings"] == []
    particles = {"name": "particles in the box", "value": 292.0, "unit": "1"}
    assert found["derived"]["particles"] == particles
    assert all(key.isidentifier() and key.islower() for key in [*found, *found["derived"]])
    assert run("check", "case3", "--quiet", folder=tmp_path) == (0, "", "")
    status, out, err = run("check", "case4", folder=tmp_path)
    assert status == 2 and err.startswith("mrjax: case4: no such file")


def test_column_settles_a_recipe_and_writes_its_fields(tmp_path):
    """At rest the floor carries Delta rho g phi_0 H, but for half of the lowest cell."""
    asked = ("column", "case2", "--height", "0.1", "--hours", "240", "--out", "tube")
    status, out, err = run(*asked, folder=tmp_path)
    assert (status, err) == (0, "")
    assert "settles at 9.1164 mm/day at first. After 240 h its mudline is at 56.2 of 100 mm" in out
    numbers = json.loads((tmp_path / "tube" / "column.json").read_text())
    assert set(numbers) == documented("column.json")
    assert numbers["sedimentation_ratio"] == near(0.337178 / 0.6, rel=1e-5)
    floor = 6520.0 * 9.81 * (0.337178 * 0.1 - 0.6 * 0.1 / 400)
    assert numbers["solid_stress_Pa"] == near(floor, rel=1e-4)
    with (tmp_path / "tube" / "curve.csv").open(newline="") as file:
        first, *_, last = csv.DictReader(file)
    assert float(first["mudline_m"]) == near(0.1) and float(last["time_s"]) == 864000.0
    with np.load(tmp_path / "tube" / "fields.npz") as arrays:
        assert arrays["volume_fraction"].shape == (101, 200)
    names = {"column.json", "curve.csv", "fields.csv", "fields.npz", "fields.png"}
    assert names < {path.name for path in (tmp_path / "tube").iterdir()}
    status, out, err = run(*asked, "--bed-fraction", "0.2", folder=tmp_path)
    assert (status, out) == (2, "") and "volume_fraction = 0.337178 must be above 0 and" in err


def test_a_sheet_without_moduli_or_box_is_checked_and_not_simulated(tmp_path):
    sheet = """
    name = "chalk"
    particle = {density = 2150.0, diameter = 2e-5}
    fluid = {liquid = "water"}
    composition = {concentration = 89.0}
    """
    (tmp_path / "chalk.toml").write_text(sheet)
    status, out, err = run("check", "chalk.toml", folder=tmp_path)
    assert (status, err) == (0, "")
    assert "settling velocity (Eq. 27)" in out and "Rayleigh time" not in out
    water, box, left_out, _, random, branch = [
        line for line in out.splitlines() if line.startswith("Note: ")
    ]
    assert water.startswith("Note: water at 293.15 K") and "is chosen for 300 particles" in box
    assert "left out: particle.elastic_modulus is missing" in left_out
    assert "Brownian motion, which is off, hardly matters" in random
    assert "at a Peclet number of 1.2e+05, below 1e+08" in branch
    status, out, err = run("simulate", "chalk.toml", folder=tmp_path)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("mrjax: recipe 'chalk': particle.elastic_modulus is missing")
    assert not (tmp_path / "run").exists()


def test_what_is_beyond_the_model_is_told_on_standard_error_whatever_is_printed(tmp_path):
    coarse = SMALL.replace("4e-6", "1e-3").replace("10e-6, 10e-6, 20e-6", "5e-3, 5e-3, 5e-3")
    (tmp_path / "coarse.toml").write_text(coarse)
    _, plain, warned = run("check", "coarse.toml", folder=tmp_path)
    assert "Reynolds number" in warned and "settling velocity" in plain
    status, out, err = run("check", "coarse.toml", "--json", folder=tmp_path)
    assert status == 0 and err == warned and len(json.loads(out)["warnings"]) == err.count("\n")
    assert run("check", "coarse.toml", "--quiet", folder=tmp_path) == (0, "", warned)


def test_calibrate_writes_its_files(tmp_path):
    cheap = ("--model", "particles", "--begin-with", "closed-form")
    cheap += ("--pdf",)
    status, out, err = run("fang2005", "--out", "fit", *cheap, module="calibrate", folder=tmp_path)
    assert status == 0, err
    assert "`f_w * f_s` = 61.4" in out
    assert "No measurement says anything of `f_w / f_s`" in out
    assert "varies as 1 / (f_w * f_s * f_v)" in out
    fit = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert fit["converged"] is True and fit["model"] == "particles"
    beds = ["bed_fraction[A]", "bed_fraction[B]"]
    assert list(fit["parameters"]) == ["f_w", "f_s", "f_v", *beds]
    assert fit["parameters"]["f_w"]["determined"] is False
    assert fit["carried_by_priors_alone"] == ["f_w", "f_s"]
    assert fit["null_directions"] == ["f_w / f_s"]
    first, second, *others = fit["determined_combinations"]
    assert [one["expression"] for one in others] == beds
    assert first["expression"] == "f_w * f_s"
    assert abs(first["value"] - 61.4) < first["standard_error"]
    assert second["expression"] == "f_v"
    units = ("mm/day", "%", "mm/day", "%")
    for prediction, measured, unit in zip(
        fit["predictions"], (8.0, 78.0, 3.6, 90.0), units, strict=True
    ):
        assert prediction["measured"] == measured and prediction["unit"] == unit
        assert abs(prediction["predicted"] - measured) < prediction["sigma"]
    assert fit["begun_with"] == "closed-form" and fit["on_a_kink"] is False
    assert 0 < fit["model_runs"] <= 6  # it begins at the optimum of the closed form, nearly its own
    assert fit["wall_seconds"] > 0
    assert list(fit["validity"]) == ["A", "B"] and fit["warnings"] == []
    # At the measured 8 mm/day: 950 kg/m^3, 4 um, 0.01 Pa s.
    reynolds = 950.0 * 8e-3 / 86400 * 4e-6 / 0.01
    assert fit["validity"]["A"]["Reynolds"]["value"] == near(reynolds, rel=0.02)
    report = (tmp_path / "fit" / "report.md").read_text()
    assert "| B | Peclet | 1.2e+03 | above 10 |" in report
    assert "The fit converged." in report and "61.44 ± 0.77" in report
    page = (tmp_path / "fit" / "report.html").read_text()
    assert "<table>" in page and 'src="http' not in page
    assert not (tmp_path / "fit" / "checkpoint").exists()
    figures = ("predictions.png", "residuals.png", "profiles.png", "loss.png")
    assert page.count('src="data:image/png;base64,') == len(figures)
    for figure in figures:
        assert figure in report
        with Image.open(tmp_path / "fit" / figure) as image:
            assert json.loads(image.text["Description"])["lab_sheets"] == fit["lab_sheets"]
        assert (tmp_path / "fit" / figure).with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert Recipe.model_validate(fit["lab_sheets"]["B"]) == Recipe.load("case3")


@pytest.mark.slow
def test_calibrate_predicts_what_was_not_fitted(tmp_path):
    status, out, err = run(
        *("fang2005", "--model", "closed-form", "--leave-one-out", "--posterior"),
        *("--predict", "case2", "--like", "A"),
        module="calibrate",
        folder=tmp_path,
    )
    assert status == 0, err
    assert "B, not fitted: initial velocity 4.30 ± 0.86 mm/day predicted, 3.6 ± 0.1" in out
    predicted = r"case2, not fitted: initial velocity (7\.99|8\.00) ± 0\.10 mm/day predicted\."
    assert re.search(predicted, out)
    fit = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert [one["sample"] for one in fit["left_out"]] == ["A", "A", "B", "B"]
    assert undocumented(fit) == set() and documented("fit.json") == set(fit)
    assert set(fit["posterior"]) == documented("Posterior")
    assert fit["posterior"]["converged"] is True and fit["posterior"]["r_hat"] < 1.01
    f_s = fit["parameters"]["f_s"]  # all that is known of it is its prior
    assert f_s["posterior"]["standard_deviation"] == near(1.1 * 0.05, rel=0.1)
    low, high = f_s["profile"]["68 %"]
    assert low < f_s["value"] < high
    assert "posterior.png" in (tmp_path / "fit" / "report.md").read_text()


def test_a_fit_of_misfitting_data_says_so_in_its_report(tmp_path):
    (tmp_path / "twice.toml").write_text(
        """
        name = "twice"
        [[sample]]
        name = "first"
        recipe = "case2"
        initial_velocity = {value = 8.0, unit = "mm/day", standard_deviation = 0.1}
        [[sample]]
        name = "second"
        recipe = "case2"
        initial_velocity = {value = 12.0, unit = "mm/day", standard_deviation = 0.1}
        [[parameter]]
        name = "f_w"
        median = 50.0
        log_standard_deviation = 1.0
        """
    )
    arguments = ("twice.toml", "--model", "closed-form", "--quiet", "--json")
    status, out, err = run(*arguments, module="calibrate", folder=tmp_path)
    fit = json.loads((tmp_path / "fit" / "fit.json").read_text())
    assert status == 1 and fit["converged"] and fit["misfit"] and fit["contradicts"]
    assert json.loads(out) == fit
    warning, refusal = err.splitlines()
    assert "warning: the data do not fit; sample" in warning
    assert "the data contradict the model, or each other: p < 1e-12" in refusal
    # Two values 40 of their standard deviations apart: 40^2 / 2.
    assert fit["chi_squared"] == near(800, rel=0.05)
    assert "do not agree with the model" in (tmp_path / "fit" / "report.md").read_text()


def test_calibrate_shows_every_stage_on_standard_error(tmp_path):
    """Not on standard output, and nothing of it with --quiet."""
    work = ("fang2005", "--model", "closed-form", "--leave-one-out", "--pdf")
    status, out, err = run(*work, module="calibrate", folder=tmp_path)
    assert status == 0, err
    for stage in ("fit: search, iteration", "chi-squared", "profiles", "each from the others"):
        assert stage in err and stage not in out
    assert "figures" in err
    status, out, err = run(*work, "--quiet", module="calibrate", folder=tmp_path)
    assert (status, out, err) == (0, "", "")


WRONG = {
    "no such recipe": (["simulate", "nothing"], ["nothing: no such file", "case1, case2, case3"]),
    "a directory": (["simulate", "."], ["is a directory"]),
    "nothing": ([], ["Missing command"]),
    "no command": (["simulat"], ["No such command 'simulat'"]),
    "no such option": (["simulate", "case2", "--ouput", "x"], ["No such option", "--out"]),
    "bad dtype": (["simulate", "case2", "--dtype", "float16"], ["float16", "float64"]),
    "frames": (["simulate", "case2", "--frames", "0"], ["--frames", "1<=x"]),
    "duration": (["simulate", "case2", "--duration", "-1"], ["duration = -1.0 must be"]),
    "text": (["simulate", "case2", "--duration", "soon"], ["--duration", "'soon'"]),
    "too long": (["simulate", "case2", "--duration", "1e9"], ["more than 2147483647"]),
    "ensemble": (
        ["simulate", "case2", "--ensemble", "2", "--duration", "1e-7"],
        ["--ensemble goes to rest: leave out --duration"],
    ),
    "which process": (
        ["simulate", "case2", "--distributed", "here:1234,2,2"],
        ["'here:1234,2,2': must be HOST:PORT,COUNT,ID"],
    ),
    "no scheduler": (
        ["simulate", "case2", "--distributed", "auto"],
        ["the processes did not find each other", "HOST:PORT"],
    ),
    "nothing to divide": (
        ["simulate", "case2", "--distributed", "here:1234,2,1", "--duration", "1e-7"],
        ["--distributed divides an --ensemble: leave out --duration"],
    ),
    "unstable": (
        ["simulate", "case2", "--duration", "100", "--time-step", "1e-3"],
        ["time_step = 0.001 s is unstable", "the largest that would do"],
    ),
    "no such viewer": (["simulate", "case2", "--trajectory", "xyz"], ["'xyz'", "'gsd', 'vtk'"]),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_gets_one_line_and_status_2(tmp_path, name):
    (tmp_path / "file").write_text("not a folder")
    arguments, words = WRONG[name]
    status, out, err = run(*arguments, folder=tmp_path)
    assert status == 2 and out == ""
    assert err.count("\n") == 1 and err.startswith("mrjax: ")
    for word in words:
        assert word in err
    assert (tmp_path / "file").read_text() == "not a folder"


def test_mp4_without_ffmpeg_is_refused_before_any_work(tmp_path):
    (tmp_path / "matplotlibrc").write_text("animation.ffmpeg_path: there-is-none\n")
    status, out, err = run("simulate", "case2", "--animate", "mp4", folder=tmp_path)
    assert status == 2 and out == ""
    assert err == (
        "mrjax: settling.mp4: MP4 needs the program ffmpeg, which is not there; give .gif\n"
    )
    assert not (tmp_path / "run").exists()


def test_a_prediction_must_say_what_it_is_like(tmp_path):
    status, out, err = run("fang2005", "--predict", "case1", module="calibrate", folder=tmp_path)
    assert (status, out) == (2, "") and err.count("\n") == 1
    assert "--predict case1" in err and "--like, one of A, B" in err


def test_a_wrong_experiment_gets_one_line_and_status_2(tmp_path):
    status, out, err = run("fang2006", module="calibrate", folder=tmp_path)
    assert (status, out) == (2, "")
    assert err == (
        "mrjax-calibrate: fang2006: no such file, and no bundled experiment; "
        "did you mean fang2005? give a TOML file or one of fang2005, synthetic\n"
    )


@pytest.mark.slow
def test_a_run_too_short_to_settle_says_so(tmp_path):
    status, out, _ = run("simulate", "case2", "--duration", "1e-8", folder=tmp_path)
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert status == 0 and summary["steady"] is False
    assert "too few for a settling velocity: give --duration 1.3e-07" in out


@pytest.mark.parametrize("module", ["mrjax", "calibrate"])
def test_interruption_ends_cleanly(tmp_path, module):
    arguments = ["simulate", "case1", "--frames", "1000"] if module == "mrjax" else ["fang2005"]
    process = start(*arguments, module=module, folder=tmp_path)
    assert process.stderr.read(1)  # progress: imports are over, the work is not
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "interrupted" in err and "Traceback" not in err


@pytest.mark.parametrize(
    "module, arguments, words",
    [
        ("mrjax", [], ["simulate", "reproduce"]),
        (
            "mrjax",
            ["simulate"],
            ["--duration", "--ensemble", "--overlap", "--out DIR", "--seed", "--frames", "to rest"],
        ),
        ("mrjax", ["reproduce"], ["reproduce.json", "--out DIR"]),
        ("calibrate", [], ["--model", "closed-form", "fang2005", "fit.json"]),
    ],
)
def test_help_tells_enough(tmp_path, module, arguments, words):
    status, out, err = run(*arguments, "--help", module=module, folder=tmp_path)
    assert (status, err) == (0, "")
    for word in [*words, "Exit status: 0 done", "130"]:
        assert word in out


def test_no_number_is_none():
    of = [*mrjax.__main__.cli.commands.values(), calibrate.__main__.cli]
    bounded = [p for c in of for p in c.params if isinstance(p.type, click.FloatRange)]
    of_tubes = {"tube_diameter", "tube_height", "height", "hours", "bed_fraction", "compression"}
    assert {option.name for option in bounded} == {"overlap", "robust", *of_tubes}
    for option in bounded:
        for text in ("nan", "inf", "-inf"):
            with pytest.raises(click.BadParameter):
                option.type.convert(text, option, None)
        assert option.type.convert("0.05", option, None) == 0.05


MODULE = {"mrjax": "mrjax", "mrjax-calibrate": "calibrate"}
COMPLETE = {"mrjax": "_MRJAX_COMPLETE", "mrjax-calibrate": "_MRJAX_CALIBRATE_COMPLETE"}


def completed(name: str, line: str, folder: Path) -> set[str]:
    """What bash is offered for the last word of a line."""
    asked = {"COMP_WORDS": line, "COMP_CWORD": str(line.count(" "))}
    asked[COMPLETE[name]] = "bash_complete"
    status, out, err = run(module=MODULE[name], folder=folder, environment=asked)
    assert (status, err) == (0, "")
    return set(out.split())


def test_a_shell_completes_commands_options_recipes_and_files(tmp_path):
    (tmp_path / "mine.toml").touch()
    (tmp_path / "other.csv").touch()
    cases = {"plain,case1", "plain,case2", "plain,case3"}
    everything = {"plain,simulate", "plain,check", "plain,new", "plain,reproduce", "plain,column"}
    assert completed("mrjax", "mrjax ", tmp_path) == everything
    assert completed("mrjax", "mrjax sim", tmp_path) == {"plain,simulate"}
    assert completed("mrjax", "mrjax simulate --dt", tmp_path) == {"plain,--dtype"}
    types = {"plain,float64", "plain,float32"}
    assert completed("mrjax", "mrjax simulate case2 --dtype ", tmp_path) == types
    for command in ("simulate", "check", "column"):
        assert completed("mrjax", f"mrjax {command} ", tmp_path) == {*cases, "plain,mine.toml"}
        assert completed("mrjax", f"mrjax {command} ca", tmp_path) == cases
        # Left to the shell, which knows paths better.
        assert completed("mrjax", f"mrjax {command} sub/m", tmp_path) == {"file,sub/m"}
    calibrate = partial(completed, "mrjax-calibrate", folder=tmp_path)
    assert calibrate("mrjax-calibrate fa") == {"plain,fang2005"}
    assert "plain,closed-form" in calibrate("mrjax-calibrate fang2005 --model ")
    assert calibrate("mrjax-calibrate fang2005 --predict c") == cases


@pytest.mark.parametrize(
    "shell, word", [("bash", "complete -o"), ("zsh", "compdef"), ("fish", "-f")]
)
def test_every_shell_has_a_line_to_source(tmp_path, shell, word):
    for name, variable in COMPLETE.items():
        environment = {variable: f"{shell}_source"}
        status, out, _ = run(module=MODULE[name], folder=tmp_path, environment=environment)
        assert status == 0 and word in out and f"{variable}={shell}_complete" in out


@pytest.mark.parametrize("module", ["mrjax", "calibrate"])
def test_the_version(tmp_path, module):
    status, out, _ = run("--version", module=module, folder=tmp_path)
    assert status == 0 and out.strip().endswith(mrjax.__version__)
