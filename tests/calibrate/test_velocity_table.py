"""One table of velocities at many concentrations: fitted with one exponent, by each model."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import t

import calibrate
import mrjax
from calibrate import Experiment, Problem
from calibrate.__main__ import cli
from calibrate.experiment.repeats import BEFORE_THE_FIT, LEAST_SCATTER
from calibrate.problem.solve import fit_experiment
from tests.builders.result_keys import undocumented

GLASS_BEADS = """# Glass beads in water: flux of solid (volume per area and time, downwards)
# Source: https://github.com/CERNN/Batch-Settling (BKSP/Dataset2.csv)
volume_fraction,flux_1e-2_cm_per_s
0.05405,1.38429
0.09904,2.10409
0.14189,2.45746
0.18657,2.55615
0.22221,2.48727
0.26127,2.30654
0.29772,2.06995
0.34613,1.67789
0.39703,1.29201
0.43954,1.00564
0.48093,0.76897
0.52851,0.53842
"""
RECIPE = """
name = "glass beads"
particle = {density = 2450.0, diameter = 66.5e-6}
fluid = {density = 998.0, viscosity = 1e-3}
composition = {volume_fraction = 0.1}
drag = {f_w = "richardson-zaki"}
"""
SAMPLE = """
name = "glass"
[[sample]]
name = "beads"
recipe = "beads.toml"
velocities = {file = "beads.csv"}
"""
FREE = """
[[parameter]]
name = "f_w.exponent"
median = 5.5
[[parameter]]
name = "f_s"
median = 1.3
"""


def written(folder, table=GLASS_BEADS, sheet=SAMPLE + FREE, recipe=RECIPE):
    (folder / "beads.csv").write_text(table)
    (folder / "beads.toml").write_text(recipe)
    (folder / "glass.toml").write_text(sheet)
    return folder / "glass.toml"


def by_hand(table):
    """Exponent, single-bead velocity in m/s, scatter, and their errors: a line in logarithms."""
    rows = np.array([row.split(",") for row in table.splitlines()[3:]], float)
    fraction, velocity = rows[:, 0], rows[:, 1] * 1e-4 / rows[:, 0]
    design = np.stack([np.ones(len(rows)), np.log(1.0 - fraction)], 1)
    best, (square,), *_ = np.linalg.lstsq(design, np.log(velocity))
    scatter = np.sqrt(square / (len(rows) - 2))
    errors = scatter * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    return best[1], np.exp(best[0]), scatter, errors


def test_glass_beads_have_one_exponent_with_the_error_of_their_scatter(tmp_path, capsys):
    """n = 4.70 +- 0.04, as a line through ln v against ln (1 - phi) gives it."""
    path, out = written(tmp_path), tmp_path / "out"
    cli.main([str(path), "--model", "closed-form", "--out", str(out)], standalone_mode=False)
    said = json.loads((out / "fit.json").read_text("utf-8"))
    exponent, speed, scatter, errors = by_hand(GLASS_BEADS)
    assert undocumented(said) == set()
    found = said["parameters"]["f_w.exponent"]
    assert (round(found["value"], 2), round(found["standard_error"], 2)) == (4.70, 0.04)
    # The logarithm of a velocity and its relative difference part by half the scatter, 1 %.
    assert found["value"] == pytest.approx(exponent, abs=0.1 * errors[1])
    assert found["standard_error"] == pytest.approx(errors[1], rel=0.02)
    assert found["determined"] and said["converged"]
    f_s = said["parameters"]["f_s"]
    stokes = 2.0 / 9.0 * (2450.0 - 998.0) * 9.81 * (33.25e-6) ** 2 / 1e-3
    assert f_s["value"] == pytest.approx(stokes / speed, rel=0.1 * errors[0])
    assert f_s["standard_error"] == pytest.approx(f_s["value"] * errors[0], rel=0.02)
    told = said["scatter"]["beads"]
    assert told["value"] == pytest.approx(scatter, rel=0.02) and told["source"] == "fit"
    assert told["degrees_of_freedom"] == pytest.approx(10.0)
    assert told["standard_error"] == pytest.approx(told["value"] / np.sqrt(20.0))
    assert (said["errors"], said["p_value"], said["misfit"]) == ("estimated", None, False)
    assert said["reduced_chi_squared"] == pytest.approx(1.0, rel=0.01)
    assert said["runs"][0]["readings"] == 12
    low, high = found["profile"]["95 %"]
    # A parabola in the logarithm: wider than two standard errors by Student's t.
    reach = t.ppf(0.975, 10) * found["standard_error"]
    assert (low, high) == pytest.approx((found["value"] - reach, found["value"] + reach), rel=2e-3)
    row = said["predictions"][0]
    assert (row["concentration"], row["concentration_kind"]) == (0.05405, "volume fraction")
    assert row["unit"] == "cm/s" and row["measured"] == pytest.approx(1.38429e-2 / 0.05405)
    assert row["sigma"] == pytest.approx(told["value"] * row["predicted"], rel=2e-3)
    text = (out / "report.md").read_text("utf-8")
    assert "initial velocity at volume fraction 0.5285" in text and "velocities.png" in text
    assert (out / "velocities.png").is_file() and not (out / "predictions.png").exists()
    printed = capsys.readouterr().out
    assert "Sample beads, velocities: 'beads.csv'" in printed
    assert "relative scatter of the velocities of sample beads" in printed
    assert "with 10 degrees of freedom" in printed and "varies as" not in printed


def test_the_column_predicts_the_same_velocities(tmp_path):
    experiment = Experiment.load(written(tmp_path))
    first, second = (
        Problem.prepare(experiment, model).predict(experiment.start)
        for model in ("closed-form", "column")
    )
    np.testing.assert_allclose(first, second, rtol=1e-12)


def test_each_row_is_predicted_as_a_sample_of_its_concentration(tmp_path):
    """Eq. 27 of the same recipe with that composition, and with the fitted values."""
    experiment = Experiment.load(written(tmp_path))
    predicted = Problem.prepare(experiment, "closed-form").predict(experiment.start)
    recipe = mrjax.Recipe.load(tmp_path / "beads.toml")
    for place, fraction in ((0, 0.05405), (11, 0.52851)):
        own = recipe.replace(
            composition={"volume_fraction": fraction},
            drag={"f_w": {"closure": "richardson-zaki", "exponent": 5.5}, "f_s": 1.3},
        )
        velocity = mrjax.terminal_velocity(own.parameters())
        assert float(predicted[place]) == pytest.approx(float(velocity) * 100.0, rel=1e-12)


BOX = """
name = "fine beads in oil"
particle = {density = 2450.0, diameter = 4e-6, material = "mineral"}
fluid = {density = 998.0, viscosity = 0.1}
composition = {volume_fraction = 0.1}
drag = {f_w = "richardson-zaki"}
box = {size = [25e-6, 25e-6, 25e-6]}
"""


def test_particles_fall_at_each_concentration_in_a_box_of_their_own(tmp_path):
    table = "phi,v (mm/s)\n0.05,2\n0.1,1.5\n"
    experiment = Experiment.load(written(tmp_path, table, recipe=BOX))
    closed, run = (
        Problem.prepare(experiment, model).predict(experiment.start)
        for model in ("closed-form", "particles")
    )
    np.testing.assert_allclose(run, closed, rtol=1e-4)


def test_particles_of_too_dense_a_row_are_refused_with_it(tmp_path):
    table = "phi,v (mm/s)\n0.05,2\n0.63,0.1\n"
    experiment = Experiment.load(written(tmp_path, table, recipe=BOX))
    with pytest.raises(mrjax.InputError, match=r"'beads': at the volume fraction 0\.63 of one"):
        Problem.prepare(experiment, "particles")


def synthetic(folder, scatter, seed=0, repeats=1, more="", errors=None, fractions=None):
    """An experiment whose velocities have an exponent of 5 and f_s 1.2, and a relative scatter."""
    path = written(folder, "phi,v (mm/s)\n0.1,1\n0.2,1\n", SAMPLE + FREE)
    problem = Problem.prepare(Experiment.load(path), "closed-form")
    sample = problem.experiment.samples[0]
    theta = {"f_w.exponent": jnp.asarray(5.0), "f_s": jnp.asarray(1.2)}
    suspension = problem.experiment.suspension_of(sample, theta)
    noise = np.random.default_rng(seed)
    lines = ["phi,v (mm/s)" + (",sd (%)" if errors else "")]
    for fraction in np.repeat(fractions or np.linspace(0.05, 0.5, 40), repeats):
        speed = float(mrjax.terminal_velocity(suspension.at(fraction).parameters)) * 1e3
        speed *= 1.0 + scatter * noise.standard_normal()
        lines.append(f"{fraction},{speed}" + (f",{errors}" if errors else ""))
    return Experiment.load(written(folder, "\n".join(lines) + "\n", SAMPLE + FREE + more))


def test_a_known_scatter_is_found(tmp_path):
    """Of 40 readings with 5 %: within three of its standard errors, and so the values."""
    problem, fit = fit_experiment(synthetic(tmp_path, 0.05), "closed-form")
    scatter = problem.experiment.samples[0].scatter
    assert scatter.degrees_of_freedom == pytest.approx(38.0)
    assert abs(scatter.value - 0.05) < 3.0 * scatter.standard_error
    assert fit.converged and np.abs(fit.residuals).max() < 4.0
    spread = np.sqrt(np.diag(np.linalg.inv(fit.jacobian.T @ fit.jacobian)))
    assert (np.abs(np.log(fit.values / [5.0, 1.2])) < 3.0 * spread).all()


def test_a_robust_fit_has_the_scatter_of_readings_without_outliers(tmp_path):
    experiment = synthetic(tmp_path, 0.02)
    lines = (tmp_path / "beads.csv").read_text().splitlines()
    fraction, speed = lines[20].split(",")
    lines[20] = f"{fraction},{2.0 * float(speed)}"
    (tmp_path / "beads.csv").write_text("\n".join(lines))
    experiment = Experiment.load(tmp_path / "glass.toml")
    plain, robust = (
        fit_experiment(experiment, "closed-form", robust=robust)[0].experiment.samples[0].scatter
        for robust in (None, 1.5)
    )
    # One reading off by 1, or 50 scatters: alone it makes sqrt(50^2 / 38) = 8 of one. A median of
    # 40 has an error of 1.17 / sqrt(40), a fifth, of which two are allowed.
    assert plain.value > 0.1 and robust.value == pytest.approx(0.02, rel=0.4)


def test_readings_without_scatter_have_the_least_that_is_believed(tmp_path):
    problem, fit = fit_experiment(synthetic(tmp_path, 0.0), "closed-form")
    assert problem.experiment.samples[0].scatter.value == LEAST_SCATTER
    np.testing.assert_allclose(fit.values, [5.0, 1.2], rtol=1e-6)


def test_where_nothing_is_left_to_tell_it_the_scatter_is_assumed(tmp_path):
    experiment = synthetic(tmp_path, 0.0, fractions=[0.1, 0.3])
    done = calibrate.run(experiment, model="closed-form")
    said = done.tables()
    assert said["scatter"]["beads"]["source"] == "assumed"
    assert said["scatter"]["beads"]["value"] == BEFORE_THE_FIT
    assert done.fit.converged and said["errors"] == "estimated"


def test_repeats_give_the_scatter_before_the_fit(tmp_path):
    """Six of each of five: 25 degrees of freedom, whatever the model; a misfit shows."""
    experiment = synthetic(tmp_path, 0.03, repeats=6, fractions=[0.1, 0.2, 0.3, 0.4, 0.5])
    scatter = experiment.samples[0].scatter
    assert (scatter.source, scatter.degrees_of_freedom) == ("repeats", 25.0)
    assert abs(scatter.value - 0.03) < 3.0 * scatter.standard_error
    problem, fit = fit_experiment(experiment, "closed-form")
    assert problem.experiment.samples[0].scatter == scatter and fit.converged


def test_stated_errors_are_taken_as_they_are(tmp_path):
    experiment = synthetic(tmp_path, 0.05, errors=5.0)
    assert experiment.errors == "stated" and experiment.samples[0].scatter is None
    said = calibrate.run(experiment, model="closed-form").tables()
    assert said["p_value"] > 1e-3 and said["scatter"] == {} and said["runs"] == []


def test_a_prior_counts_among_the_degrees_of_freedom(tmp_path):
    """An exponent that its prior holds takes nothing from the readings."""
    experiment = synthetic(tmp_path, 0.05)
    sheet = (SAMPLE + FREE).replace("5.5\n", "5.0\nlog_standard_deviation = 1e-6\n")
    (tmp_path / "glass.toml").write_text(sheet)
    experiment = Experiment.load(tmp_path / "glass.toml")
    problem, _ = fit_experiment(experiment, "closed-form")
    freedom = problem.experiment.samples[0].scatter.degrees_of_freedom
    assert freedom == pytest.approx(39.0, abs=1e-3)


def test_a_wrong_shape_shows_in_runs(tmp_path):
    """An exponent held far from its own: residuals of one sign, then of the other."""
    synthetic(tmp_path, 0.01)
    sheet = (SAMPLE + FREE).replace("median = 5.5", "value = 3.0")
    (tmp_path / "glass.toml").write_text(sheet)
    experiment = Experiment.load(tmp_path / "glass.toml")
    said = calibrate.run(experiment, model="closed-form").tables()
    assert said["runs"][0]["runs"] <= 3 and said["runs"][0]["p_value"] < 1e-6


@pytest.mark.parametrize(
    "sheet, recipe, words",
    [
        (SAMPLE + FREE, RECIPE.replace('"richardson-zaki"', "20.0"), ["f_w = 20", "closure"]),
        (
            SAMPLE + FREE.replace("f_w.exponent", "f_w"),
            RECIPE,
            ["parameter.name = 'f_w'", "the same at all concentrations", "f_w.exponent"],
        ),
        (
            SAMPLE + SAMPLE.partition("[[sample]]")[2].join(["[[sample]]", ""]).replace(
                '"beads"\n', '"more"\n'
            ) + FREE,
            RECIPE,
            ["velocities.file = 'beads.csv' is that of sample 'beads', too"],
        ),
        (SAMPLE.replace("beads.csv", "no.csv") + FREE, RECIPE, ["no.csv: no such file"]),
        (
            SAMPLE.replace('csv"', 'csv", concentration = "wt%"') + FREE,
            RECIPE,
            ["'volume_fraction' is of volume fraction, and concentration = 'weight percent'"],
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_fitted_is_one_line(tmp_path, sheet, recipe, words):
    with pytest.raises(mrjax.InputError) as refusal:
        Experiment.load(written(tmp_path, sheet=sheet, recipe=recipe))
    message = str(refusal.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_a_slurry_by_its_liquid_ratio(tmp_path):
    """Water and solid by weight: 1.5 kg of water per kg of solid is a volume fraction of 0.198."""
    table = "water_kg_per_kg_solid,velocity_m_per_s\n1.5,2e-4\n1.0,9.4e-5\n0.5,5e-5\n"
    recipe = RECIPE.replace("2450.0", "2700.0").replace("998.0", "1000.0")
    experiment = Experiment.load(written(tmp_path, table, recipe=recipe))
    found = [one.concentration for one in experiment.samples[0].measurements]
    expected = [1.0 / (1.0 + 2.7 * ratio) for ratio in (1.5, 1.0, 0.5)]
    np.testing.assert_allclose([one.volume_fraction for one in found], expected, rtol=1e-12)
    assert found[0].said == "1.5 kg of liquid per kg of solid"


def test_a_speed_out_of_proportion_names_its_concentration(tmp_path):
    path = written(tmp_path, GLASS_BEADS.replace("_cm_", "_m_").replace("1e-2", "1e2"))
    (warning,) = Experiment.load(path).warnings
    assert "at volume fraction 0.05405 is" in warning and "check unit" in warning


def test_a_left_out_table_is_predicted_with_its_scatter(tmp_path):
    other = '[[sample]]\nname = "alone"\nrecipe = "beads.toml"\n'
    other += 'initial_velocity = {value = 1.9, standard_deviation = 0.1, unit = "mm/s"}\n'
    prior = FREE.replace("median = 1.3", "median = 1.3\nlog_standard_deviation = 0.3")
    prior = prior.replace("median = 5.5", "median = 4.7\nlog_standard_deviation = 0.1")
    experiment = Experiment.load(written(tmp_path, sheet=SAMPLE + other + prior))
    done = calibrate.run(experiment, model="closed-form", leave_one_out=True)
    rows = [one for one in done.tables()["left_out"] if one["sample"] == "beads"]
    assert len(rows) == 12 and rows[0]["concentration"] == 0.05405
    scatter = done.problem.experiment.samples[0].scatter.value
    assert rows[0]["sigma"] == pytest.approx(scatter * rows[0]["measured"], rel=4.0 * scatter)
