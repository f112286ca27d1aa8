"""What each forward model asks of a lab sheet: particles alone need moduli and a box of them."""

import numpy as np
import pytest

import calibrate
import mrjax
from calibrate import Experiment, Problem

FEWEST = """
name = "chalk"
particle = {density = 2150.0, diameter = 2e-5}
fluid = {density = 1000.0, viscosity = 0.001}
composition = {volume_fraction = 1e-6}
drag = {f_w = 1.0}
"""
BOXED = (
    FEWEST.replace("2e-5}", "2e-5, elastic_modulus = 70e9, poisson_ratio = 0.25}")
    + "box = {size = [1.2e-4, 1.2e-4, 2.4e-4], periodic = [true, true, false]}\n"
)
"""In a box that holds less than one particle."""
SPREAD = FEWEST.replace(
    "2e-5}", '{median = 2e-5, geometric_standard_deviation = 1.5, by = "volume"}}'
)
STOKES = 2.0 / 9.0 * 1150.0 * 9.81 * 1e-5**2 / 0.001
"""Velocity of the particle in m/s."""


@pytest.fixture
def experiment(tmp_path):
    """An experiment with a recipe: the velocity and two heights of particles that fall alone."""

    def of(recipe: str, sample: str = "bed_fraction = 0.5") -> Experiment:
        (tmp_path / "recipe.toml").write_text(recipe)
        heights = "".join(f"{time},{100 - 1e3 * STOKES * time}\n" for time in (60, 120, 180))
        (tmp_path / "curve.csv").write_text(f"time,mudline\n{heights}")
        (tmp_path / "experiment.toml").write_text(
            f"""
            name = "fallen"
            [[sample]]
            name = "A"
            recipe = "recipe.toml"
            height = 0.1
            {sample}
            initial_velocity = {{value = {1e3 * STOKES}, unit = "mm/s", standard_deviation = 0.003}}
            curve = {{file = "curve.csv", time_unit = "s", unit = "mm", standard_deviation = 0.5}}
            [[parameter]]
            name = "viscosity"
            median = 0.0015
            log_standard_deviation = 1.0
            """
        )
        return Experiment.load(tmp_path / "experiment.toml")

    return of


@pytest.mark.parametrize("model", ["closed-form", "column"])
@pytest.mark.parametrize("recipe", [FEWEST, BOXED], ids=["fewest", "dilute in a box"])
def test_a_viscosity_is_found_without_moduli_or_particles_in_a_box(recipe, model, experiment):
    problem = Problem.prepare(experiment(recipe), model)
    fit = calibrate.fit(problem.residuals, problem.start, priors=problem.priors)
    assert fit.converged
    assert fit.theta["viscosity"] == pytest.approx(0.001, rel=1e-3)


@pytest.mark.parametrize(
    "model, sample", [("particles", ""), ("column", 'bed_fraction = "particles"')]
)
@pytest.mark.parametrize(
    "recipe, lacks",
    [(FEWEST, "particle.elastic_modulus is missing"), (BOXED, "less than one particle")],
    ids=["fewest", "dilute in a box"],
)
def test_particles_name_what_they_lack(recipe, lacks, model, sample, experiment):
    with pytest.raises(mrjax.InputError) as refusal:
        Problem.prepare(experiment(recipe, sample), model)
    message = str(refusal.value)
    assert message.startswith("recipe 'chalk': ") and lacks in message and "; give " in message


def test_a_column_takes_many_sizes(experiment):
    predicted = Problem.prepare(experiment(SPREAD), "column").predict(OF_WATER)
    assert len(predicted) == 4 and np.isfinite(predicted).all()


OF_WATER = {"viscosity": 0.001}


def test_a_closed_form_takes_many_sizes_in_a_box_that_holds_none(experiment):
    """As many as a chosen box would hold; the mean of d^2 by number is m^2 exp(2 ln^2 s)."""
    box = BOXED.splitlines()[-1]
    problem = Problem.prepare(experiment(SPREAD + box), "closed-form")
    velocity = float(problem.predict(OF_WATER)[0])
    number_median = 2e-5 * np.exp(-3.0 * np.log(1.5) ** 2)
    mean = number_median**2 * np.exp(2.0 * np.log(1.5) ** 2)
    # 300 quantiles leave out the ends.
    assert velocity == pytest.approx(1e3 * STOKES * mean / 2e-5**2, rel=0.02)
