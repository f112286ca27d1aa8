"""Stokes drag and its corrections (Son 2018, Eqs. 14-17 and 24)."""

import inspect
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.tree_util import Partial
from scipy.optimize import curve_fit

from mrjax import Parameters
from mrjax.laws import drag
from mrjax.laws.closures import table

EXACT = 1e-13  # a handful of roundings in double precision
near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12

# Wall factors of a sphere in a tube of still liquid. Haberman & Sayre (1958) tabulate their exact
# solution and approximate it by a rational function; multipole collocation (residual 5e-10) gives
# the exact one today. Last, Eq. 14 of Son (2018) without its cap.
#   lambda  tabulated  collocation  approximation  Eq. 14
WALL_FACTORS = np.array(
    [
        (0.1, 1.263, 1.26321, 1.2633, 1.0000),
        (0.2, 1.680, 1.67948, 1.6797, 1.0020),
        (0.3, 2.371, 2.37009, 2.3697, 1.0434),
        (0.4, 3.596, 3.59137, 3.5816, 1.3819),
        (0.5, 5.970, 5.94737, 5.8700, 3.0632),
        (0.6, 11.135, 11.0919, 10.593, 9.1865),
        (0.7, 24.955, 24.6759, 21.425, 27.252),
        (0.8, 73.555, 74.6696, 49.023, 73.036),
    ]
)
RATIO, TABULATED, SOLUTION, APPROXIMATION, EQUATION_14 = WALL_FACTORS.T
LAST_DIGIT = 5e-5  # five digits are printed: half of the last, relative to the leading ones

# 314 spheres of 4 um in 25 x 25 x 50 um, and 292 of 4.4 um: samples A and B.
SAMPLE_A = 314 * 4 / 3 * np.pi * 2.0**3 / 31250
SAMPLE_B = 292 * 4 / 3 * np.pi * 2.2**3 / 31250
CAP = 48.985

COEFFICIENTS = {"floc_volume": 1.6, "rate": 12.0, "size_ratio": 0.8}
"""Values of coefficients that have no default, or one that hides a derivative."""
CLOSURES = {"uncapped": drag.son2018_uncapped, **drag.CLOSURES}


def at(ratio):
    return drag.volume_fraction_at(jnp.asarray(ratio))


def test_drag_coefficient():
    parameters = Parameters(
        radius=2e-6,
        particle_density=7470.0,
        fluid_density=950.0,
        viscosity=0.01,
        elastic_modulus=3.12e9,
        poisson_ratio=0.25,
        f_w=48.985,
        f_s=1.1,
        f_v=1.68,
        f_r=1.1,
    ).astype(float)
    # Eq. 24: 48.985 * 1.1 * 1.68 * 1.1 = 99.576708; 6 pi * 0.01 * 2e-6 = 3.7699111843e-7.
    assert drag.carrier_viscosity(parameters) == near(0.0168, rel=EXACT)
    assert drag.coefficient(parameters) == near(99.576708 * 3.7699111843077517e-7, 1e-12)
    for factor in ("f_w", "f_s", "f_v", "f_r", "viscosity", "radius"):
        doubled = parameters.replace(**{factor: 2.0 * getattr(parameters, factor)})
        ratio = drag.coefficient(doubled) / drag.coefficient(parameters)
        assert ratio == near(2.0, rel=EXACT), factor


def test_diameter_ratio_by_hand():
    # 4 pi / 3 phi = 8 gives 1 / (2 - 1), 27 gives 1 / (3 - 1).
    phi = jnp.array([np.pi / 6, 4 * np.pi / 81])
    np.testing.assert_allclose(drag.diameter_ratio(phi), [1.0, 0.5], rtol=EXACT)


@settings(deadline=None)  # the first call compiles
@given(st.floats(1e-3, 10.0))
def test_volume_fraction_inverts_the_diameter_ratio(ratio):
    # Rounding of lambda grows as (1 + 1/lambda) when a long distance loses its leading 1.
    assert drag.diameter_ratio(drag.volume_fraction_at(ratio)) == near(ratio, rel=1e-12)


def test_equation_14_at_the_tabulated_ratios():
    np.testing.assert_allclose(drag.son2018_uncapped(at(RATIO)), EQUATION_14, rtol=LAST_DIGIT)
    capped = np.minimum(EQUATION_14, CAP)
    np.testing.assert_allclose(drag.son2018(at(RATIO)), capped, rtol=LAST_DIGIT)


def test_equation_14_is_a_fit_to_the_tabulated_solution():
    fit, _ = curve_fit(lambda x, a, b: a * x**b + 1.0, RATIO, TABULATED, p0=(300.0, 7.0))
    signature = inspect.signature(drag.son2018_uncapped).parameters
    printed = [signature["coefficient"].default, signature["exponent"].default]
    # Half of the table's last digit at lambda = 0.8, 5e-4 of 73.6, moves the fit by 7e-6.
    np.testing.assert_allclose(printed, fit, rtol=1e-5)


def test_errors_of_the_wall_factors():
    low = 1.0 - np.asarray(drag.son2018_uncapped(at(RATIO))) / SOLUTION
    assert low[:5].min() == pytest.approx(0.208, abs=5e-4)
    assert low[:5].max() == pytest.approx(0.615, abs=5e-4)
    low = 1.0 - np.asarray(drag.haberman_sayre(at(RATIO))) / SOLUTION
    assert abs(low[1]) < 3e-4
    assert low[6:] == pytest.approx([0.132, 0.343], abs=5e-4)


def test_haberman_sayre_at_the_tabulated_ratios():
    np.testing.assert_allclose(drag.haberman_sayre(at(RATIO)), APPROXIMATION, rtol=LAST_DIGIT)


@pytest.mark.parametrize(
    "volume_fraction, uncapped, digit",
    [(SAMPLE_A, 49.518, 5e-4), (0.31312, 36.3, 0.05), (SAMPLE_B, 129.3, 0.05)],
)
def test_equation_14_at_the_papers_volume_fractions(volume_fraction, uncapped, digit):
    assert drag.son2018_uncapped(volume_fraction) == pytest.approx(uncapped, abs=digit)
    assert drag.son2018(volume_fraction) == pytest.approx(min(CAP, uncapped), abs=digit)


def test_the_papers_volume_fractions():
    found = [SAMPLE_A, SAMPLE_B, SAMPLE_B / 1.331]
    np.testing.assert_allclose(found, [0.33671, 0.41676, 0.31312], atol=5e-6)


def test_the_recipes_ask_for_the_cap(case):
    expected = {"case1": 1.0, "case2": CAP, "case3": CAP}[case.name]
    assert case.parameters().f_w == near(expected, rel=EXACT)


def test_the_hard_cap_has_no_slope_where_the_samples_are():
    slope = jax.vmap(jax.grad(drag.son2018, (0, 1, 2)))
    samples = jnp.array([SAMPLE_A, SAMPLE_B])
    for derivative in slope(samples, jnp.full(2, 389.1530), jnp.full(2, 7.5593)):
        np.testing.assert_array_equal(derivative, 0.0)


def test_the_smooth_cap_becomes_the_hard_one():
    phi = jnp.array([0.05, 0.2, 0.3, SAMPLE_A, SAMPLE_B])
    hard = drag.son2018(phi)
    gaps = [
        float(jnp.max(jnp.abs(drag.son2018_smooth(phi, sharpness=p) / hard - 1.0)))
        for p in (4.0, 16.0, 64.0)
    ]
    # The widest gap is 1 - 2^(-1/p), about ln(2)/p, where law and cap meet: near sample A.
    assert gaps[0] > 3.5 * gaps[1] > 12 * gaps[2]
    assert gaps[2] < np.log(2) / 64


def test_the_smooth_cap_keeps_the_slope_it_states():
    def slope(law, phi):
        return jax.grad(lambda phi: jnp.log(law(phi)))(phi)

    meeting = at(((CAP - 1.0) / 389.1530) ** (1 / 7.5593))
    # f = cap 2^(-1/4), and d ln f / d ln f_uncapped = 1 / (1 + (f_uncapped/cap)^4).
    assert drag.son2018_smooth(meeting) == near(CAP * 2**-0.25, rel=EXACT)
    for phi, share, precision in ((meeting, 0.5, 1e-12), (SAMPLE_B, 0.02, 0.05)):
        kept = slope(drag.son2018_smooth, phi) / slope(drag.son2018_uncapped, phi)
        assert kept == near(share, rel=precision)  # 0.0202 is stated as 2 %


def test_richardson_zaki():
    assert drag.richardson_zaki(0.5, 2.0) == near(4.0, rel=EXACT)
    assert drag.richardson_zaki(0.2) == near(1.25**4.65, rel=EXACT)


def test_shape_factor():
    assert drag.shape_factor(6e-6, 4.8e-6, 3.1622776601683795e-6) == near(2.88**0.09, rel=EXACT)
    assert drag.shape_factor(4e-6, 4e-6, 4e-6) == 1.0
    assert drag.shape_factor(2.88, 1.0, 1.0) == pytest.approx(1.10, abs=5e-4)  # Table 2


@pytest.mark.parametrize("name", CLOSURES)
def test_derivatives_are_central_differences(name):
    """First and second, with respect to the volume fraction and every coefficient."""
    coefficients = {
        key: COEFFICIENTS.get(key, default)
        for key, default in table.coefficients(CLOSURES[name]).items()
    }
    defaults = list(coefficients.values())
    # On both sides of the cap's kink at 0.3359.
    phi = np.array([0.05, 0.25, 0.32, SAMPLE_A, SAMPLE_B])
    if holds := table.valid_range(Partial(CLOSURES[name], **coefficients)):
        # The formula of a tube has derivatives a little beyond its range, too.
        phi = phi[(phi > holds.least) & (phi < max(holds.most, 0.45))]
        assert phi.size >= 4
    phi = jnp.asarray(phi)
    points = jnp.stack([phi, *(jnp.full_like(phi, value) for value in defaults)], axis=1)

    def law(point):
        return CLOSURES[name](*point)

    @jax.jit
    @jax.vmap
    def value_and_slope(point):
        return law(point), jax.grad(law)(point)

    slope = value_and_slope(points)[1]
    curvature = jax.jit(jax.vmap(jax.hessian(law)))(points)
    for axis in range(points.shape[1]):
        step = 1e-5 * points[:, axis]
        change = jnp.zeros_like(points).at[:, axis].set(step)
        above, below = value_and_slope(points + change), value_and_slope(points - change)
        # The differences err by h^2 times a third logarithmic derivative, up to 1e-10 * 30^3, and
        # by rounding over h, 1e-11 of value over argument.
        for exact, of, more, less in zip(
            (slope[:, axis], curvature[:, axis]), value_and_slope(points), above, below, strict=True
        ):
            central = (more - less) / (2 * step.reshape(-1, *(1,) * (of.ndim - 1)))
            scale = jnp.max(jnp.abs(of)) / jnp.min(points[:, axis])
            np.testing.assert_allclose(exact, central, rtol=3e-6, atol=float(1e-10 * scale))


@pytest.mark.parametrize("phi", [SAMPLE_A, SAMPLE_B])
def test_the_smooth_cap_has_a_slope_where_the_samples_are(phi):
    h = 1e-6
    slope = float(jax.grad(drag.son2018_smooth)(phi))
    central = float(drag.son2018_smooth(phi + h) - drag.son2018_smooth(phi - h)) / (2 * h)
    assert slope > 10.0  # d ln f / d ln phi of 0.09 or more, where the hard cap has none
    assert slope == near(central, rel=1e-7)
