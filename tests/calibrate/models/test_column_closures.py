"""Coefficients of closures of flocs, fitted to the synthetic mudline of a column."""

from collections import OrderedDict
from types import SimpleNamespace

import numpy as np
import pytest

import calibrate
import mrjax
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.physical_bounds import bounds
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import suspension
from calibrate.models.column import column

HEIGHT = 0.3


def slurry(initial, **f_w):
    return mrjax.Recipe(
        name="slurry",
        particle={"density": 2700.0, "diameter": 3e-6},
        fluid={"density": 998.0, "viscosity": 1e-3},
        composition={"volume_fraction": initial},
        drag={"f_w": f_w, "local": True},
    )


@pytest.mark.parametrize(
    "initial, bed, start, true",
    [
        (
            0.02,
            0.06,
            {"closure": "floc-richardson-zaki", "floc_volume": 8.0},
            {"floc_volume": 14.0, "exponent": 5.5},
        ),
        (0.02, 0.06, {"closure": "vesilind", "rate": 40.0}, {"rate": 90.0}),
        (0.2, 0.4, {"closure": "rigid-network", "floc_volume": 1.5}, {"floc_volume": 2.0}),
    ],
    ids=["flocs", "Vesilind", "network"],
)
def test_a_fit_finds_the_coefficients_of_a_synthetic_mudline(initial, bed, start, true):
    recipe = slurry(initial, **start)
    truth = {f"f_w.{name}": value for name, value in true.items()}
    fall = HEIGHT / float(mrjax.terminal_velocity(suspension(recipe, bed, truth).parameters))
    sample = Sample("A", recipe, HEIGHT, bed, (), times=tuple(fall * np.linspace(0.05, 1.2, 12)))
    predict = column(sample, suspension(recipe, bed, {}))
    readings = predict(suspension(recipe, bed, truth))["mudline"]

    def residuals(theta):
        return (predict(suspension(recipe, bed, theta))["mudline"] - readings) / (1e-3 * HEIGHT)

    known = recipe.closure.keywords
    begin = OrderedDict((f"f_w.{name}", known.get(name, 4.65)) for name in true)
    fitted = calibrate.fit(residuals, begin)
    assert fitted.converged
    assert dict(fitted.theta) == pytest.approx(truth, rel=1e-5)


def test_bounds_keep_flocs_apart_in_all_samples():
    """C phi < 1 in the thickest suspension and in the bed, and at least 0.2 in a network."""
    samples = tuple(
        Sample(name, slurry(initial, closure=closure, floc_volume=3.0), HEIGHT, bed, ())
        for name, initial, bed, closure in (
            ("thin", 0.1, 0.2, "floc-richardson-zaki"),
            ("dense", 0.25, None, "floc-richardson-zaki"),
            ("network", 0.1, 0.3, "rigid-network"),
        )
    )
    experiment = SimpleNamespace(samples=samples)

    def ends(*names):
        return bounds(experiment, FreeParameter("C", "f_w.floc_volume", names, 4.0, None))

    assert ends("thin") == pytest.approx((1.001, 0.999 / 0.2))
    assert ends("thin", "dense") == pytest.approx((1.001, 0.999 / 0.25))
    assert ends("network") == pytest.approx((2.002, 0.999 / 0.3))
