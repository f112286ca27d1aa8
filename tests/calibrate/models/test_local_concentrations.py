"""Concentrations at a height: the column and the closed form against each other and the scheme."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from calibrate import Experiment, Problem
from calibrate.experiment.sample import Point, Sample
from calibrate.experiment.suspension import suspension
from calibrate.models.closed_form import closed_form
from calibrate.models.column import column
from calibrate.models.prediction import prediction
from mrjax import InputError

HEIGHT, INITIAL, BED, THICKNESS = 0.3, 0.26, 0.75, 0.003


def recipe(local=True, exponent=4.65):
    """Coated beads, of which uncoated ones fill 3 / 4 of the coated volume."""
    return mrjax.Recipe.model_validate(
        {
            "name": "coated",
            "particle": {"density": 2450.0, "diameter": 60e-6, "material": "mineral"},
            "fluid": {"density": 998.0, "viscosity": 1e-3},
            "coating": {"density": 1100.0, "radius_factor": 1.1, "elastic_modulus": 1e9,
                        "poisson_ratio": 0.3},
            "composition": {"volume_fraction": INITIAL},
            "drag": {"f_w": {"closure": "richardson-zaki", "exponent": exponent}, "local": local},
        }
    )  # fmt: skip


def sampled(of, heights, times, thickness=THICKNESS):
    every = zip(*map(np.ravel, np.broadcast_arrays(heights, times)), strict=True)
    points = tuple(
        Point(float(height), float(time), thickness, place, "t", "m", "s")
        for place, (height, time) in enumerate(every)
    )
    return Sample("A", of, HEIGHT, BED, (), points=points)


def fall_time(near):
    return HEIGHT / float(mrjax.terminal_velocity(near.parameters))


def test_the_column_is_what_the_scheme_of_many_cells_comes_to():
    """Of uncoated particles, in a fan too; the scheme smears fronts over some cells."""
    of, cells = recipe(), 150
    near = suspension(of, BED, {})
    times = fall_time(near) * np.array([0.1, 0.3, 0.6, 1.5])
    settled = mrjax.column(
        near.parameters, height=HEIGHT, volume_fraction=near.volume_fraction, bed_fraction=BED,
        times=times, hindrance=near.hindrance, cells=cells,
    )  # fmt: skip
    width = 3  # cells of a layer
    layer = np.asarray(settled.volume_fraction).reshape(4, -1, width).mean(2)
    levels = np.asarray(settled.levels).reshape(-1, width).mean(1)
    sample = sampled(of, levels[None], times[:, None], width * HEIGHT / cells)
    found = np.reshape(column(sample, near)(near)["concentrations"], layer.shape)
    off = np.abs(found - layer / 1.1**3)
    # Of first order: 1.1e-3 with 150 cells, 2.9e-4 with 600.
    assert off.mean() < 2e-3
    assert np.quantile(off, 0.9) < 2e-3
    fan = (found > 1.05 * INITIAL) & (found < 0.95 * BED / 1.1**3)
    assert fan.sum() > 10 and off[fan].mean() < 2.5e-3
    assert found.max() == pytest.approx(BED / 1.1**3, rel=1e-9)
    assert found[0, 30] == pytest.approx(INITIAL, rel=1e-9)


def test_the_closed_form_is_the_exact_column_without_local_drag():
    """Above and below both fronts, in layers with one, and at rest."""
    of = recipe(local=False)
    near = suspension(of, BED, {})
    heights, times = np.linspace(0.0, HEIGHT, 61), fall_time(near) * np.linspace(0.0, 1.2, 13)
    sample = sampled(of, heights[None], times[:, None])
    exact, closed = (make(sample, near)(near)["concentrations"] for make in (column, closed_form))
    np.testing.assert_allclose(closed, exact, rtol=1e-9, atol=1e-12)
    profiles = np.reshape(closed, (13, 61))
    bed = BED / 1.1**3
    np.testing.assert_allclose(profiles[0], INITIAL, rtol=1e-9)
    # After 0.2 of a fall: the mudline, and the front of the bed below it.
    coated = INITIAL * 1.1**3
    mudline, front = 0.8 * HEIGHT, 0.2 * HEIGHT * coated / (BED - coated)
    at = profiles[2]
    above, below = heights > mudline + THICKNESS, heights < front - THICKNESS
    between = (heights > front + THICKNESS) & (heights < mudline - THICKNESS)
    assert above.sum() > 8 and below.sum() > 8 and between.sum() > 30
    assert not np.any(at[above] > 1e-12)
    np.testing.assert_allclose(at[below], bed, rtol=1e-9)
    np.testing.assert_allclose(at[between], INITIAL, rtol=1e-9)


def test_all_that_was_dispersed_is_in_a_profile():
    """Layers that fill the tube hold phi_0 H at any time."""
    for make, of in ((column, recipe()), (closed_form, recipe(local=False))):
        near = suspension(of, BED, {})
        heights = HEIGHT * (np.arange(100) + 0.5) / 100
        sample = sampled(of, heights, 0.7 * fall_time(near))
        assert np.mean(make(sample, near)(near)["concentrations"]) == pytest.approx(
            INITIAL, rel=1e-6
        )


@pytest.mark.parametrize("make, local", [(column, True), (closed_form, False)])
def test_gradients_are_those_of_central_differences(make, local):
    """In a layer that the mudline passes, in the fan or the bed's front, and in the bed."""
    of = recipe(local)
    near = suspension(of, BED, {})
    time = 0.3 * fall_time(near)
    velocity = HEIGHT / fall_time(near)
    sample = sampled(of, [HEIGHT - velocity * time + 2e-4, 0.08, 0.01], time, 0.02)

    model = make(sample, near)

    @jax.jit
    def line(theta):
        changes = {"f_s": theta[0], "f_w.exponent": 4.65 * theta[1], "f_r": 1.1 * theta[2]}
        return model(suspension(of, BED * theta[3], changes))["concentrations"]

    at, step = jnp.ones(4), 1e-5
    forward = jax.jit(jax.jacfwd(line))(at)
    assert (np.abs(forward[0, :3]) > 1e-3).all() and abs(float(forward[2, 3])) > 0.1
    for number in range(4):
        unit = step * jnp.zeros(4).at[number].set(1.0)
        central = (line(at + unit) - line(at - unit)) / (2 * step)
        np.testing.assert_allclose(forward[:, number], central, rtol=3e-6, atol=1e-7)


EXPERIMENT = """
name = "coil"
[[sample]]
name = "A"
recipe = "case3"
height = 0.1
bed_fraction = 0.55
[[sample.concentration]]
file = "c.csv"
height = 0.05
standard_deviation = 0.01
[[parameter]]
name = "f_w"
median = 100.0
"""


def coil(folder, content="t (day),phi\n0,0.33\n5,0.2\n", sheet=EXPERIMENT):
    (folder / "c.csv").write_text(content)
    (folder / "coil.toml").write_text(sheet)
    return Experiment.load(folder / "coil.toml")


def test_models_without_concentrations_are_refused_with_the_remedy(tmp_path):
    experiment = coil(tmp_path)

    def own(sample, near, seed, varied, checkpoint):
        return lambda one: prediction(sample, one, *[jnp.ones(())] * 2, *[jnp.zeros(0)] * 2)

    with pytest.raises(InputError, match=r"'A': a box of few .* column or closed-form"):
        Problem.prepare(experiment, "particles")
    problem = Problem.prepare(experiment, own)
    with pytest.raises(InputError, match=r"column or closed-form, or .* concentrations, \(2,\)"):
        problem.predict(problem.start)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("height = 0.05", "height = 0.15", ["concentration.height = 0.15 m is above", "0.1 m"]),
        ("height = 0.05", "height = 0.05\nthickness = 0.2", ["concentration.thickness = 0.2 m"]),
        ("height = 0.1\n", "", ["sample 'A': height is missing"]),
        ("height = 0.05", "heigt = 0.05", ["heigt"]),
        ("c.csv", "no.csv", ["sample 'A'", "no.csv: no such file"]),
        (
            "[[parameter]]",
            '[[sample.concentration]]\nfile = "c.csv"\nheight = 0.01\n[[parameter]]',
            ["concentration.file = 'c.csv' is that of sample 'A', too"],
        ),
    ],
)
def test_tables_that_cannot_be_are_one_line(tmp_path, old, new, words):
    with pytest.raises(InputError) as refusal:
        coil(tmp_path, sheet=EXPERIMENT.replace(old, new, 1))
    message = str(refusal.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_a_concentration_far_above_the_bed_is_told(tmp_path):
    """The bed of 0.55 is of coated particles, of which 1 / 1.1^3 is iron: 0.413."""
    (warning,) = coil(tmp_path, "t (day),phi\n0,0.33\n5,0.52\n").warnings
    assert "c.csv, line 3" in warning and "0.52 is far above" in warning and "0.413" in warning
    assert not coil(tmp_path, "t (day),phi\n0,0.33\n5,0.45\n").warnings
