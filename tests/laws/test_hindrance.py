"""Drag by the local volume fraction: a double sum over splines, conservation, runs, gradients."""

from functools import partial
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial

import mrjax
from mrjax.io.identity import identity
from mrjax.laws import drag, hindrance
from tests.builders.particles import iron, light_balls

near = partial(pytest.approx, abs=0.0)  # by itself it passes all that is within 1e-12
EXACT = 1e-12  # sums of some hundred terms
FLOOR, LOOP = (False, False, False), (False, False, True)


def spheres(radius):
    return iron(radius=radius).astype(float)


def local(radius, box, height, spacing):
    """Volume fractions at heights, (N,); where the particles are beside each other is nothing."""
    position = jnp.stack([jnp.zeros_like(height), jnp.zeros_like(height), height])
    return hindrance.local_volume_fraction(spheres(radius), box, position, spacing)


def spline(x):
    """The cubic B-spline on levels at distance one."""
    x = np.abs(x)
    return np.where(x < 1, 2 / 3 - x**2 + x**3 / 2, np.where(x < 2, (2 - x) ** 3 / 6, 0.0))


def double_sum(radius, box, height, spacing):
    """Every particle, and its mirror image or images, given to every level and read from it."""
    levels = max(4, round(box.height / spacing))
    spacing = box.height / levels
    share = 4 / 3 * np.pi * np.asarray(radius) ** 3 / (box.size[0] * box.size[1] * spacing)
    x = np.asarray(height) / spacing
    images = [x + n * levels for n in range(-3, 4)] if box.periodic[2] else [x, -x]
    level = np.arange(-20 * levels, 21 * levels)[:, None]
    fraction = sum((share * spline(image - level)).sum(axis=1) for image in images)
    return (fraction[:, None] * spline(x - level)).sum(axis=0)


@pytest.mark.parametrize("periodic", [FLOOR, LOOP])
@pytest.mark.parametrize("height, spacing", [(20.0, 2.0), (17.3, 2.2), (3.0, 2.0)])
def test_the_local_volume_fraction_is_the_double_sum(periodic, height, spacing):
    random = np.random.default_rng(1)
    box = mrjax.Box((7.0, 9.0, height), periodic)
    at = np.concatenate([random.uniform(0, height, 60), [1e-9, 0.5 * height, height - 1e-9]])
    radius = random.uniform(0.4, 0.9, len(at))
    found = local(jnp.array(radius), box, jnp.array(at), spacing)
    np.testing.assert_allclose(found, double_sum(radius, box, at, spacing), rtol=EXACT)


def test_what_rises_is_the_mirror_image_of_what_sinks():
    """A bed under the lid is as dense there as below it, and under it is clear fluid."""
    box = mrjax.Box((8e-6, 8e-6, 24e-6), FLOOR)
    height = jnp.asarray(np.random.default_rng(3).uniform(1e-6, 9e-6, 40))
    rows = jnp.zeros_like(height)
    sinking = iron().astype(float)
    rising = iron(particle_density=500.0).astype(float)
    fraction = hindrance.local_volume_fraction
    below = fraction(sinking, box, jnp.stack([rows, rows, height]), 2e-6)
    above = fraction(rising, box, jnp.stack([rows, rows, 24e-6 - height]), 2e-6)
    np.testing.assert_allclose(above, below, rtol=1e-9)
    near_floor = height < 2e-6
    assert near_floor.any() and below[near_floor].min() > 0.6 * below.mean()


def test_a_uniform_suspension_has_its_mean_fraction_below_its_top():
    """Layers at a fifth of the levels' distance: a spline on levels adds up to one over them."""
    box = mrjax.Box((10.0, 10.0, 40.0))
    height = jnp.array(np.repeat(0.2 + 0.4 * np.arange(100), 3))
    found = local(0.7, box, height, 2.0)
    mean = 300 * 4 / 3 * np.pi * 0.7**3 / 4000.0
    inside = height < 40.0 - 2 * 2 * 2.0  # two levels given to, two levels read from
    np.testing.assert_allclose(found[inside], mean, rtol=EXACT)
    # Over the top is clear fluid, over which the highest average: half of it and less.
    assert 0.4 * mean < found[-1] < 0.6 * mean
    # The floor is no top.
    assert found[0] == near(mean, rel=EXACT)


def test_a_bed_counts_all_its_solid_and_clear_fluid_none():
    """Probes of no size read the profile; its integral is the solid over the width of the box."""
    box = mrjax.Box((10.0, 10.0, 40.0))
    solid = np.random.default_rng(5).uniform(0.0, 20.0, 50)
    probes = 0.05 + 0.1 * np.arange(400)
    radius = np.append(np.full(50, 0.8), np.full(400, 1e-9))
    found = local(jnp.array(radius), box, jnp.array(np.append(solid, probes)), 2.0)[50:]
    # Spacing of the probes: a twentieth of the levels', so that their sum is exact.
    total = 0.1 * float(jnp.sum(found)) * 100.0
    assert total == near(50 * 4 / 3 * np.pi * 0.8**3, rel=1e-9)
    # Two levels given to and two read from above the highest; beyond, but for the probes.
    assert float(found[probes > 20.0 + 8.0].max()) < 1e-20
    assert (found[probes < 20.0] > 0.0).all()


def test_twice_continuously_differentiable_across_the_levels():
    box = mrjax.Box((10.0, 10.0, 20.0))
    others = jnp.array(np.random.default_rng(2).uniform(0, 20, 30))

    @jax.jit
    def profile(z):
        return local(0.8, box, others.at[0].set(z), 2.0)[0]

    slope, curvature = jax.jit(jax.grad(profile)), jax.jit(jax.grad(jax.grad(profile)))
    third = 0.05  # an upper bound on the third derivative here, and on its jumps
    for level in (2.0, 6.0, 10.0, 3.0, 7.0, 0.5, 9.1):  # knots, half-way, and between
        for of, derivative in ((profile, slope), (slope, curvature)):
            central = (of(level + 1e-5) - of(level - 1e-5)) / 2e-5
            # At a knot the third derivative jumps: half of 1e-5 of it.
            assert float(central) == pytest.approx(
                float(derivative(level)), rel=1e-8, abs=1e-5 * third
            )
        jump = curvature(level + 1e-9) - curvature(level - 1e-9)
        assert abs(float(jump)) < 1e-8 * third
    # Not a constant: what is compared is there.
    assert abs(float(slope(6.5))) > 1e-4 and abs(float(curvature(6.5))) > 1e-5


def test_a_periodic_height_wraps():
    box = mrjax.Box((10.0, 10.0, 20.0), LOOP)
    height = jnp.array(np.random.default_rng(4).uniform(0, 20, 40))
    found = local(0.8, box, height, 2.0)
    for moved in (height + 20.0, height - 40.0, height + 6.0):
        np.testing.assert_allclose(local(0.8, box, moved, 2.0), found, rtol=1e-10)
    # A floor is another matter.
    walled = local(0.8, mrjax.Box((10.0, 10.0, 20.0)), height, 2.0)
    assert float(jnp.abs(walled / found - 1).max()) > 0.1


def test_the_factor_of_each_height_and_nothing_denser_than_can_be():
    box = mrjax.Box((10.0, 10.0, 40.0))
    height = jnp.array(np.random.default_rng(6).uniform(0.0, 20.0, 100))
    parameters = spheres(0.8)
    position = jnp.stack([height, height, height])
    law = Partial(drag.richardson_zaki, exponent=3.0)
    felt = hindrance.hindered_parameters(parameters, law, box, position, 2.0)
    fraction = double_sum(np.full(100, 0.8), box, height, 2.0)
    np.testing.assert_allclose(felt.f_w, (1 - fraction) ** -3.0, rtol=1e-11)
    assert felt.f_s == parameters.f_s
    packed = hindrance.hindered_parameters(spheres(3.0), law, box, position, 2.0)
    assert float(packed.f_w.max()) == near((1 - hindrance.LARGEST_FRACTION) ** -3.0, rel=EXACT)


# --- runs ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def column(case2):
    """A few particles of case 2 in a narrow column, far from each other: nothing touches."""
    box = mrjax.Box((10e-6, 10e-6, 40e-6))
    grid = [[3e-6 + 4.4e-6 * (i % 2), 5e-6, 6e-6 + 4.5e-6 * i] for i in range(6)]
    return mrjax.place(grid, contact_diameter=4e-6), case2.parameters().replace(friction=0.0), box


def followed(column, law, f_w=None):
    state, parameters, box = column
    parameters = parameters if f_w is None else parameters.replace(f_w=f_w)
    return mrjax.simulate(
        state, parameters, box, duration=1e-2, frames=4, time_step=1e-4, hindrance=law
    )


def constant(fraction, value):
    return jnp.full_like(fraction, 1.0) * value


def test_a_constant_law_is_the_global_factor_exactly(column):
    everywhere = followed(column, None, jnp.asarray(7.0))
    here = followed(column, Partial(constant, value=7.0))
    # To the last digit but for what a compiler reorders.
    np.testing.assert_allclose(here.heights, everywhere.heights, rtol=1e-14)
    np.testing.assert_allclose(here.mean_velocity[1:], everywhere.mean_velocity[1:], rtol=1e-12)
    assert float(everywhere.mean_velocity[-1]) > 0


def test_the_parameters_own_factor_is_not_felt(column):
    law = Partial(drag.richardson_zaki, exponent=4.65)
    one, other = (followed(column, law, jnp.asarray(f_w)) for f_w in (1.0, 50.0))
    np.testing.assert_array_equal(one.heights, other.heights)


def test_the_first_velocities_are_those_of_the_local_fraction(column):
    _, parameters, box = column
    run = followed(column, Partial(drag.richardson_zaki, exponent=4.65))
    height = np.asarray(run.heights)
    fraction = double_sum(np.full(6, 2e-6), box, 0.5 * (height[1] + height[2]), 4e-6)
    free = parameters.replace(f_w=jnp.array((1 - fraction) ** -4.65))
    # Their changes within a frame, 1e-3, cancel to first order about its middle.
    found = (height[1] - height[2]) / float(run.times[2] - run.times[1])
    np.testing.assert_allclose(found, mrjax.terminal_velocity(free), rtol=1e-5)
    # By a tenth apart, so that each is seen to be its own.
    assert np.ptp(found) > 0.05 * found.max()


def test_gradient_with_respect_to_the_exponent(column):
    def fallen(exponent):
        run = followed(column, Partial(drag.richardson_zaki, exponent=exponent))
        return 1e6 * jnp.sum(run.heights[-1] * jnp.arange(1.0, 7.0))

    slope = jax.jit(jax.grad(fallen))(4.0)
    step = 1e-3  # truncation: step^2 / 6 of a third derivative of about a tenth of the first
    central = (fallen(4.0 + step) - fallen(4.0 - step)) / (2 * step)
    # The heights, 1e2, carry 1e-14 of rounding: over the step and the slope, 1e-8 and less.
    assert float(slope) == near(float(central), rel=1e-6)
    assert float(slope) > 0  # more hindrance, higher particles


def test_the_exponent_may_be_traced_where_particles_touch(case2):
    """The step is then checked without it; only traced here, as compiling takes longer."""
    resting = mrjax.place([[5e-6, 5e-6, 2e-6], [5e-6, 5e-6, 6e-6]], contact_diameter=4e-6)
    box = mrjax.Box((10e-6, 10e-6, 40e-6))
    parameters = mrjax.softened(case2.parameters(), box, 2, 0.05)

    def height(exponent):
        law = Partial(drag.richardson_zaki, exponent=exponent)
        run = mrjax.simulate(resting, parameters, box, duration=1e-3, time_step=1e-4, hindrance=law)
        return run.heights[-1]

    assert jax.eval_shape(jax.jit(height), 4.0).shape == (2,)


# --- the lab sheet ------------------------------------------------------------------------------


def sheet(**factors):
    table = mrjax.Recipe.load("case2").model_dump()
    table["drag"] = {"f_s": 1.1, **factors}
    return mrjax.Recipe.model_validate(table)


def test_a_sheet_asks_for_the_local_fraction():
    assert sheet(f_w="richardson-zaki").hindrance is None
    assert sheet(f_w=48.0).hindrance is None
    plain = sheet(f_w="richardson-zaki", local=True).hindrance
    assert float(plain(jnp.asarray(0.3))) == near(0.7**-4.65, rel=EXACT)
    steep = sheet(f_w={"closure": "richardson-zaki", "exponent": 5.1}, local=True).hindrance
    assert float(steep(jnp.asarray(0.3))) == near(0.7**-5.1, rel=EXACT)
    assert float(sheet(f_w="son2018", local=True).hindrance(jnp.asarray(0.4))) == near(48.985)
    # A program is shared by all coefficients: they are leaves, not part of the structure.
    assert jax.tree.leaves(steep) == [5.1]


@pytest.mark.parametrize(
    "f_w", [48.0, "haberman-sayre", {"closure": "haberman-sayre"}], ids=["number", "name", "table"]
)
def test_laws_that_do_not_hold_in_a_bed_are_refused(f_w):
    with pytest.raises(ValueError, match=r"drag\.local = true: needs a closure that holds in the"):
        sheet(f_w=f_w, local=True)


def test_refused_in_one_line_from_a_file(tmp_path):
    text = resources.files("mrjax.recipe.bundled").joinpath("case2.toml").read_text()
    file = tmp_path / "mine.toml"
    file.write_text(text.replace('f_w = "son2018" ', "local = true\nf_w = 48.0 "))
    with pytest.raises(mrjax.InputError, match=r"drag\.local = true") as refusal:
        mrjax.Recipe.load(file)
    assert "richardson-zaki" in str(refusal.value) and "\n" not in str(refusal.value)


def test_any_function_is_a_hindrance():
    """A lambda gives the bits of the closure that it is, and is told from others by its code."""
    parameters = light_balls()
    start = mrjax.place([[1e-5] * 3, [5e-6] * 3])

    def fallen(law):
        box = mrjax.Box((2e-5,) * 3)
        return mrjax.simulate(start, parameters, box, duration=1e-7, time_step=1e-8, hindrance=law)

    bound = fallen(Partial(drag.richardson_zaki, exponent=4.65)).state.position
    plain = fallen(lambda fraction: (1.0 - fraction) ** -4.65).state.position
    np.testing.assert_array_equal(plain, bound)


def test_functions_are_told_by_what_they_do():
    def power(exponent):
        return lambda fraction: (1.0 - fraction) ** -exponent

    assert identity(power(4.65)) == identity(power(4.65)) != identity(power(5.1))
    assert identity(power(np.ones(2))) != identity(power(np.zeros(2)))
    assert identity(lambda phi: phi + 1.0) != identity(lambda phi: phi + 2.0)
    assert identity(drag.son2018) == "son2018"
    with pytest.raises(mrjax.InputError, match="a checkpoint cannot recognise it"):
        identity(power(object()))
