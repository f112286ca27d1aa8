"""The compressive yield stress: its law from exact curves, its scaling, and small boxes."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.interruption import interruptible
from mrjax.dem.plan import System
from mrjax.simulation.compression_fit import fit_compression
from mrjax.simulation.options import RunOptions
from mrjax.simulation.pieces import PiecewiseRun
from mrjax.simulation.plan import plan_run

PHI = np.geomspace(0.1, 0.55, 40)
ATTRACTION = {"hamaker": 1e-19, "layer_thickness": 14e-9, "range": 0.03}


@pytest.fixture(scope="module")
def sticky():
    return mrjax.Recipe.load("case2").replace(attraction=ATTRACTION)


def law(gel=0.22, stress=0.01, exponent=6.0):
    return mrjax.Compression(gel_fraction=gel, stress=stress, exponent=exponent)


def test_an_exact_curve_gives_its_law_back():
    exact = np.asarray(law().solid_stress(PHI))
    fit = fit_compression(PHI, np.stack([exact, exact]), 1e-3)
    # The search ends at relative changes of 1e-8.
    assert fit.compression.gel_fraction == pytest.approx(0.22, rel=1e-5)
    assert fit.compression.stress == pytest.approx(0.01, rel=1e-4)
    assert fit.compression.exponent == pytest.approx(6.0, rel=1e-4)
    assert not fit.fitted[exact <= 1e-3].any() and fit.fitted[exact > 1e-3].all()
    assert np.sqrt(np.diag(fit.covariance)) == pytest.approx(0.0, abs=1e-4)


def test_starts_that_differ_by_a_factor_have_its_standard_error():
    factors = np.array([0.9, 1.0, 1.1])
    exact = np.asarray(law().solid_stress(PHI))
    fit = fit_compression(PHI, factors[:, None] * exact, 1e-3)
    # Jackknife of the logarithm of the mean; gel point and exponent are those of every start.
    left_out = np.log([np.delete(factors, one).mean() for one in range(3)])
    expected = np.sqrt(2 / 3 * ((left_out - left_out.mean()) ** 2).sum())
    assert np.sqrt(fit.covariance[1, 1]) == pytest.approx(expected, rel=1e-3)
    assert np.sqrt(fit.covariance[0, 0]) < 1e-4 and np.sqrt(fit.covariance[2, 2]) < 1e-3


def test_a_curve_without_stress_is_refused():
    with pytest.raises(mrjax.SimulationError, match="only 0 volume fractions carry a stress"):
        fit_compression(PHI, np.zeros((2, 40)), 1e-3)


def test_a_curve_that_does_not_grow_as_the_law_is_refused():
    steps = np.where(PHI > 0.3, 1.0, 0.0) * (1.0 + 0.01 * PHI)
    with pytest.raises(mrjax.SimulationError, match="does not grow as the law"):
        fit_compression(PHI, np.stack([steps, steps]), 1e-3)


def result(recipe, stress=2.0):
    """A result as of a measurement with this F_c / d^2."""
    return mrjax.CompressiveYield(
        volume_fraction=PHI,
        stresses=np.stack([np.full(40, 1.0), np.full(40, 3.0)]),
        lateral_stresses=np.zeros((2, 40)),
        coordination=np.zeros((2, 40)),
        unbalanced=np.zeros((2, 40)),
        compression=law(stress=stress),
        covariance=np.diag([4.0, 9.0, 16.0]),
        fitted=np.ones(40, bool),
        pull_off=2.1258503401360544e-11,  # A R / (12 h_0^2) of the recipe
        diameter=4e-6,
        seeds=(0, 1),
    )


def test_the_law_of_other_particles_scales_with_pull_off_force_over_area(sticky):
    known = result(sticky)
    same = known.of(sticky.parameters())
    assert float(same.stress) == pytest.approx(2.0, rel=1e-12)
    thin = sticky.parameters().replace(layer_thickness=7e-9)
    assert float(known.of(thin).stress) == pytest.approx(8.0, rel=1e-12)
    small = sticky.parameters().replace(radius=1e-6)
    assert float(known.of(small).stress) == pytest.approx(4.0, rel=1e-12)  # F_c ~ d
    assert known.of(thin).exponent == 6.0 and known.of(thin).gel_fraction == 0.22
    assert known.stress == pytest.approx(2.0) and known.standard_error == pytest.approx(1.0)
    assert known.standard_errors == {"gel_fraction": 2.0, "stress": 3.0, "exponent": 4.0}
    one = replace(known, stresses=known.stresses[:1])
    assert np.isnan(one.standard_error).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"particles": 20}, "particles = 20: give at least 60"),
        ({"start": 0.5, "end": 0.4}, "start = 0.5, end = 0.4"),
        ({"end": 0.7}, "end = 0.7"),
        ({"strain": 0.3}, "strain = 0.3"),
        ({"overlap": 0.2}, "overlap = 0.2"),
        ({"seeds": ()}, "give at least one"),
        ({"seeds": (1, 1)}, "each once"),
    ],
)
def test_what_cannot_be_compressed_is_refused(sticky, options, message):
    with pytest.raises(mrjax.InputError, match=message):
        mrjax.compressive_yield(sticky, **options)


def test_particles_without_attraction_are_refused():
    with pytest.raises(mrjax.InputError, match="no attraction: without it a network carries no"):
        mrjax.compressive_yield(mrjax.Recipe.load("case2"))


@pytest.mark.slow
def test_a_stretched_run_is_that_of_the_box_of_its_size(sticky):
    parameters = sticky.parameters().replace(
        elastic_modulus=1e3, restitution=1.0, dissipation=0.0, tangential_dissipation=0.0
    )
    rng = np.random.default_rng(2)
    centres = 4.1e-6 * np.stack(np.meshgrid(*[np.arange(4)] * 3), -1).reshape(-1, 3)
    state = mrjax.place(centres + rng.uniform(-2e-7, 2e-7, centres.shape), contact_diameter=4e-6)
    periodic = (True, True, True)
    large = mrjax.Box((1.64e-5, 1.64e-5, 1.8e-5), periodic)
    small = mrjax.Box((1.64e-5, 1.64e-5, 1.64e-5), periodic)
    options = {"duration": 0.2, "frames": 2, "time_step": 1e-4}
    forces = [mrjax.Contact(), mrjax.VanDerWaals()]
    plain = mrjax.simulate(state, parameters, large, forces=forces, **options)
    system = System.of(state, parameters, small, forces=forces)
    plan = plan_run(system, RunOptions(time_step=1e-4), duration=0.2, frames=2, touch=True)
    with interruptible() as stop:
        stretch = jnp.array([1.0, 1.0, 1.8 / 1.64])
        stretched = PiecewiseRun(system, plan, stop=stop, stretch=stretch)
        stretched.advance(2)
    moved = np.abs(np.asarray(plain.state.position) - np.asarray(state.position)).max()
    # Roundings, over 2,000 steps of an overdamped motion that does not amplify them much.
    assert np.asarray(stretched.run().state.position) == pytest.approx(
        np.asarray(plain.state.position), abs=1e-6 * moved
    )
    assert moved > 1e-8


@pytest.mark.slow
def test_small_boxes_of_two_bond_numbers_carry_the_same_stress_over_their_scale(sticky):
    thin = sticky.replace(attraction=ATTRACTION | {"layer_thickness": 5e-9})
    options = {"particles": 60, "start": 0.4, "end": 0.52, "strain": 0.06}
    first, second = (mrjax.compressive_yield(one, 0, **options) for one in (sticky, thin))
    assert second.scale / first.scale == pytest.approx((14 / 5) ** 2, rel=1e-12)
    # Paths that differ by roundings at first may part; one start varies by some tenths.
    ratio = second.stress / second.scale / (first.stress / first.scale)
    assert np.abs(np.log(ratio[-2:])).max() < 0.5
    assert (np.diff(first.stress[-3:]) > 0.0).all()
    assert first.unbalanced.max() < 0.1
