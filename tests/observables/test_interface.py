"""What is read off heights of particles: concentrations, fronts, heights by definition, asymptotes.

Beds here are heights alone: no definition looks at x and y, only at the area of the box.
"""

from functools import partial
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import mrjax
from mrjax.observables import interface
from mrjax.observables.concentration import _column, bed_front, concentration, solid_below

EXACT = 1e-12  # roundings of sums over hundreds of particles
near = partial(pytest.approx, rel=EXACT, abs=0.0)  # its own abs passes all within 1e-12

D = 4e-6
BOX = mrjax.Box((25e-6, 25e-6, 50e-6))
AREA = 25e-6**2
SPHERE = np.pi * D**3 / 6


def recorded(heights, radius=D / 2, box=BOX, times=None):
    """A run that has recorded these heights, (N,) or (frames + 1, N)."""
    heights = jnp.atleast_2d(jnp.asarray(heights))
    radius = jnp.broadcast_to(jnp.asarray(radius, heights.dtype), heights.shape[1:])
    return SimpleNamespace(
        heights=heights,
        radius=radius,
        box=box,
        mudline=jnp.max(heights + radius[None, :], axis=1),
        times=jnp.arange(len(heights), dtype=heights.dtype) if times is None else times,
        initial_height=box.height,
        rising=False,
        check=lambda: None,
    )


def layers(numbers, pitch=D):
    """Heights of that many particles in each layer, from the floor; (N,) in m."""
    return np.repeat(D / 2 + pitch * np.arange(len(numbers)), numbers)


def random_bed(seed, height, particles=300, radius=D / 2):
    """Spheres from the floor to about that height, each at random within its share of it."""
    share = (np.arange(particles) + np.random.default_rng(seed).random(particles)) / particles
    return radius + share * (height - 2 * radius)


def caps(heights, radius, level):
    """Solid below a level by the textbook's cap, (); numpy, particle by particle."""
    depth = level - (heights - radius)
    cut = np.pi * depth**2 * (3 * radius - depth) / 3
    whole = 4 / 3 * np.pi * radius**3
    return np.where(depth <= 0, 0, np.where(depth >= 2 * radius, whole, cut)).sum()


def sizes(seed=3, particles=300):
    """Radii of which one is the largest by far more than differences are taken over."""
    return 1e-6 + 1e-6 * np.random.default_rng(seed).random(particles)


# --- solid and concentration ----------------------------------------------------------------------


def test_solid_below_planes_through_one_sphere():
    at = jnp.array([-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 9.0])  # of a sphere of radius 2 at 2
    # Archimedes: pi u^2 (6 - u) / 3.
    expected = np.pi / 3 * np.array([0, 0, 5, 16, 27, 32, 32])
    solid = solid_below(jnp.array([2.0]), jnp.array([2.0]), at)
    np.testing.assert_allclose(solid, expected, rtol=EXACT)


def test_a_slab_cut_out_of_the_middle_of_one_sphere():
    thickness = 0.6 * D
    phi = concentration(recorded([20e-6]), [20e-6], thickness)
    # pi t (R^2 - t^2 / 12) of a disc with a spherical rim
    disc = np.pi * thickness * ((D / 2) ** 2 - thickness**2 / 12)
    assert phi.shape == (1, 1)
    assert float(phi[0, 0]) == near(disc / (AREA * thickness))


def test_a_lattice_has_the_same_concentration_everywhere():
    """Slabs as thick as the layers are apart hold one layer wherever they lie."""
    pitch = 1.3 * D
    run = recorded(layers([20] * 9, pitch))
    levels = jnp.linspace(0.5 * pitch, 8.0 * pitch, 37)
    phi = concentration(run, levels, pitch)
    np.testing.assert_allclose(phi, 20 * SPHERE / (AREA * pitch), rtol=EXACT)


@pytest.mark.parametrize("thickness", [50e-6, 130e-6])
def test_only_the_part_of_a_slab_within_the_box_counts(thickness):
    run = recorded(random_bed(0, 30e-6), sizes())
    whole = 4 / 3 * np.pi * np.sum(sizes() ** 3) / BOX.volume
    assert float(concentration(run, [25e-6], thickness)[0, 0]) == near(whole)


def test_slabs_that_reach_through_floor_and_lid():
    heights = random_bed(1, 50e-6)
    floor, lid, beyond, under = np.array(
        concentration(recorded(heights), [0.0, 50e-6, 53e-6, -2e-6], 4e-6)
    )[0]
    assert floor == near(caps(heights, D / 2, 2e-6) / (AREA * 2e-6))
    upper = 300 * SPHERE - caps(heights, D / 2, 48e-6)
    assert lid == pytest.approx(upper / (AREA * 2e-6), rel=1e-9)
    assert beyond == 0.0 and under == 0.0


def test_slabs_side_by_side_hold_all_that_is_solid():
    run = recorded([random_bed(seed, height) for seed, height in ((0, 45e-6), (1, 28e-6))], sizes())
    phi = concentration(run, (np.arange(20) + 0.5) * 2.5e-6, 2.5e-6)
    assert phi.shape == (2, 20)
    solid = 4 / 3 * np.pi * np.sum(sizes() ** 3)
    np.testing.assert_allclose(phi.sum(axis=1) * AREA * 2.5e-6, solid, rtol=EXACT)


def test_the_cells_of_a_profile_hold_what_lies_between_their_edges():
    heights, radius = random_bed(4, BOX.height), sizes()
    cell, solid = _column(jnp.asarray(heights), jnp.asarray(radius), BOX)
    assert float(cell) == near(2 * radius.max() / 20)
    edges = float(cell) * np.arange(1, solid.size + 1)
    expected = [caps(heights, radius, edge) for edge in edges]
    assert edges[-1] > BOX.height + 4 * radius.max()  # slabs end beyond the lid
    np.testing.assert_allclose(np.cumsum(solid), expected, rtol=1e-9)


# --- heights of beds that are known ---------------------------------------------------------------


def test_the_mean_of_the_highest_particles():
    run = recorded(np.stack([np.arange(1, 41), 2.0 * np.arange(1, 41)]) * 1e-6)
    tops = interface.mean_of_top(run)  # two of forty
    np.testing.assert_allclose(tops, [39.5e-6 + D / 2, 79e-6 + D / 2], rtol=EXACT)
    # Tops, not centres: the lower of two may reach higher.
    assert float(interface.mean_of_top(recorded([4e-6, 3e-6], [1e-6, 3e-6]))[0]) == near(6e-6)


def test_the_mass_quantile_of_a_column():
    """Of ten spheres on top of each other, 95 % lies below the middle of the tenth."""

    def level(heights, radius):
        return interface.mass_quantile(recorded(heights, radius))[0]

    column, radius = jnp.asarray(layers([1] * 10)), jnp.full(10, D / 2)
    assert float(level(column, radius)) == near(38e-6)
    slopes, of_radii = jax.jit(jax.grad(level, argnums=(0, 1)))(column, radius)
    np.testing.assert_allclose(slopes, [0.0] * 9 + [1.0], atol=EXACT)
    # A change of size by dR adds 4 pi R^2 dR, of which 95 % is to lie below the level; of the nine,
    # all does, of the tenth, half. The level cuts an area of pi R^2.
    np.testing.assert_allclose(of_radii, [-0.2] * 9 + [1.8], rtol=1e-9)


def test_a_mass_quantile_within_a_gap():
    """Half of two spheres lies below any level between them; rounding decides where it ends."""
    random = np.random.default_rng(1)
    lower, upper = random.uniform(1e-6, 2e-6, 4000), random.uniform(6e-6, 20e-6, 4000)
    radii = random.uniform(0.5e-6, 1e-6, 4000)

    def level(heights, radius):
        return interface.mass_quantile(recorded(heights, radius), 0.5)[0]

    pairs = jnp.asarray(np.stack([lower, upper], axis=1))
    both = jax.jit(jax.vmap(jax.value_and_grad(level)))(pairs, jnp.asarray(radii))
    found, slopes = (np.asarray(values) for values in both)
    rounding = 1e-7 * D  # square root of a relative 1e-14
    assert (found > lower + radii - rounding).all()
    assert (found < upper - radii + rounding).all()
    assert np.isfinite(slopes).all()


@pytest.mark.parametrize("fraction", [0.3, 0.95, 0.999])
def test_the_mass_quantile_solves_its_equation(fraction):
    heights, radius = random_bed(2, 30e-6), sizes()
    solid = 4 / 3 * np.pi * np.sum(radius**3)
    root = brentq(lambda h: caps(heights, radius, h) / solid - fraction, 0, 50e-6, xtol=1e-18)
    found = interface.mass_quantile(recorded(heights, radius), fraction)
    assert float(found[0]) == near(root, rel=1e-9)


def test_twice_the_centre_of_mass_is_the_top_of_a_uniform_bed():
    assert float(interface.twice_centre_of_mass(recorded(layers([5] * 7)))[0]) == near(7 * D)
    # A sphere of twice the radius weighs as much as eight.
    unlike = recorded([2e-6, 8e-6], [2e-6, 4e-6])
    assert float(interface.twice_centre_of_mass(unlike)[0]) == near(2 * (2e-6 + 8 * 8e-6) / 9)


def test_half_concentration_is_the_top_of_a_bed():
    """A slab centred at the top of a layered bed holds half a layer, the bulk a whole one."""
    deep, shallow = layers([26] * 10), layers([52] * 5)
    stray = np.concatenate([layers([26] * 9 + [25]), [45e-6]])
    low = layers([260])  # too low for a bulk above one diameter
    run = recorded([deep, shallow, stray, low])
    at = interface.half_concentration(run)
    np.testing.assert_allclose(at[:2], [40e-6, 20e-6], rtol=1e-9)
    assert float(at[2]) == pytest.approx(40e-6, abs=D / 20)  # the mudline is at 47 um
    assert float(at[3]) == pytest.approx(4e-6, abs=1e-6)


def test_half_concentration_of_a_suspension_that_fills_the_box():
    """Slabs reach beyond the lid. The centres end a radius below it, and so does the half."""
    run = recorded(random_bed(0, BOX.height))
    assert float(interface.half_concentration(run)[0]) == pytest.approx(48e-6, abs=D / 20)


def test_the_top_is_the_mudline_and_the_default():
    run = SimpleNamespace(
        mudline=jnp.array([48e-6, 24e-6]),
        initial_height=48e-6,
        rising=False,
        check=lambda: None,
    )
    np.testing.assert_array_equal(interface.top(run), run.mudline)
    np.testing.assert_allclose(interface.sedimentation_ratio(run), [1.0, 0.5], rtol=EXACT)


@pytest.mark.parametrize("name", interface.HEIGHTS)
def test_sedimentation_ratios_by_definition(name):
    run = recorded(random_bed(5, 30e-6))
    expected = interface.HEIGHTS[name](run) / 50e-6
    np.testing.assert_allclose(interface.sedimentation_ratio(run, name), expected, rtol=EXACT)
    assert 0.5 < float(expected[0]) < 0.65


# --- another program's definitions ----------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_heights_of_random_beds_as_published(seed):
    """Final ratios of a comparison with LIGGGHTS: the same definitions, on its grids of levels."""
    heights = random_bed(seed, 25e-6 + 3e-6 * seed)
    run = recorded(heights)
    top = (heights + D / 2).max()

    grid = np.linspace(0.0, 50e-6, 401)
    solid = np.array([caps(heights, D / 2, level) for level in grid])
    published = np.interp(0.95, solid / solid[-1], grid)
    assert float(interface.mass_quantile(run)[0]) == pytest.approx(published, abs=1e-4 * 50e-6)

    levels = np.arange(D / 2, 48e-6, D / 20)
    slabs = [
        (caps(heights, D / 2, level + D / 2) - caps(heights, D / 2, level - D / 2)) / (AREA * D)
        for level in levels
    ]
    phi = np.array(slabs)
    half = 0.5 * phi[(levels > D) & (levels < 0.6 * top)].mean()
    # They take the level, we the crossing on the way to it.
    k = np.flatnonzero((phi < half) & (levels > 0.5 * top))[0]
    crossing = np.interp(-half, -phi[k - 1 : k + 1], levels[k - 1 : k + 1])
    assert float(interface.half_concentration(run)[0]) == pytest.approx(crossing, abs=1e-3 * D)

    highest = np.sort(heights)[-15:]
    assert float(interface.mean_of_top(run)[0]) == near(highest.mean() + D / 2)
    assert float(interface.twice_centre_of_mass(run)[0]) == near(2 * heights.mean())
    assert float(interface.top(run)[0]) == near(top)


# --- the bed's front ------------------------------------------------------------------------------

BED, SUSPENSION = (n * SPHERE / (AREA * D) for n in (24, 12))  # particles in a layer
TALL = mrjax.Box((25e-6, 25e-6, 96e-6))


def two_layers(bed, suspension):
    """Layers of bed with suspension on them, 288 particles."""
    return layers([24] * bed + [12] * suspension)


def test_the_front_between_bed_and_suspension():
    """From a dispersed suspension to a bed that has met the mudline."""
    # With 9 to 11 layers of bed the suspension has half of what is below 0.6 of the height: a tie.
    beds = (0, 1, 2, 4, 7, 8, 12)
    run = recorded([two_layers(bed, 24 - 2 * bed) for bed in beds], box=TALL)
    expected = D * np.array(beds)
    for initial in (None, SUSPENSION):
        front = bed_front(run, BED, initial)
        np.testing.assert_allclose(front, expected, atol=1e-6 * D)
    # Met by the bed, the mudline is the front, however little is left between their concentrations.
    met = bed_front(run, BED, 0.8 * BED)[-1]
    assert float(met) == near(float(interface.half_concentration(run)[-1]))


def test_the_front_in_noise():
    """Particles displaced by up to a radius at random move the front by less than one."""
    beds = (3, 4, 6, 7, 9, 10, 12)
    frames = np.stack([two_layers(bed, 24 - 2 * bed) for bed in beds])
    frames += np.random.default_rng(0).uniform(-D / 2, D / 2, frames.shape)
    front = bed_front(recorded(np.maximum(frames, D / 2), box=TALL), BED)
    np.testing.assert_allclose(front, D * np.array(beds), atol=D / 2)


def test_no_bed_is_found_in_a_suspension():
    def front(heights):
        return bed_front(recorded(heights, box=TALL), 0.6)

    heights = jnp.stack([random_bed(seed, TALL.height, particles=288) for seed in (0, 1)])
    np.testing.assert_array_equal(front(heights), 0.0)
    slopes = jax.jit(jax.grad(lambda heights: jnp.sum(front(heights))))(heights)
    np.testing.assert_array_equal(slopes, 0.0)


# --- asymptotes -----------------------------------------------------------------------------------


def curve(slope, rest, times):
    """A mudline that falls from 48 um and stops."""
    mudline = jnp.maximum(48e-6 - slope * times, rest)
    return SimpleNamespace(
        times=times, mudline=mudline, initial_height=50e-6, rising=False, check=lambda: None
    )


def test_asymptotes_of_two_straight_lines():
    times = jnp.linspace(0.0, 7.0, 30)
    lines = interface.asymptotes(curve(6e-6, 30e-6, times))
    assert float(lines.initial_slope) == near(6e-6)
    assert float(lines.final_ratio) == near(0.6)
    assert float(lines.crossing_time) == near(3.0)
    # The second line starts at rest: the time it takes is the way over the speed.
    of_both = jax.jacfwd(lambda both: interface.asymptotes(curve(both[0], both[1], times)))
    changes = jax.jit(of_both)(jnp.array([6e-6, 30e-6]))
    np.testing.assert_allclose(changes.initial_slope, [1.0, 0.0], atol=EXACT)
    np.testing.assert_allclose(changes.final_ratio, [0.0, 1 / 50e-6], rtol=EXACT)
    np.testing.assert_allclose(changes.crossing_time, [-3.0 / 6e-6, -1 / 6e-6], rtol=EXACT)


def test_the_initial_slope_is_that_of_the_first_quarter():
    """Least squares through the start, over the frames within a quarter of the way of 16 um."""
    times = jnp.arange(6.0)
    mudline = 48e-6 - 1e-6 * jnp.array([0.0, 1.0, 3.0, 8.0, 3.5, 16.0])  # back within it: too late
    run = SimpleNamespace(
        times=times, mudline=mudline, initial_height=50e-6, rising=False, check=lambda: None
    )
    assert float(interface.asymptotes(run).initial_slope) == near((1 + 2 * 3) / 5 * 1e-6)
    # Where frames are too far apart for any to lie within it, the first will have to do.
    run.mudline = 48e-6 - 1e-6 * jnp.array([0.0, 8.0, 12.0, 14.0, 15.0, 16.0])
    assert float(interface.asymptotes(run).initial_slope) == near(8e-6)


# --- derivatives ----------------------------------------------------------------------------------

DEFINITIONS = {
    **interface.HEIGHTS,
    "bed front": lambda run: bed_front(run, BED),
    "concentration": lambda run: concentration(run, jnp.linspace(0.0, 40e-6, 9), 3e-6).sum(axis=1),
    "asymptotes": lambda run: jnp.stack(interface.asymptotes(run)),
}
FRAMES = np.stack([two_layers(bed, 24 - 2 * bed) for bed in (3, 8)])
FRAMES = np.maximum(FRAMES + np.random.default_rng(7).uniform(-1.5e-6, 1.5e-6, FRAMES.shape), 2e-6)
RADII = sizes(particles=288)
RADII[100] = 2.1e-6


@pytest.mark.parametrize("name", DEFINITIONS)
def test_derivatives_with_respect_to_heights_and_radii(name):
    """Along one direction in all of them, in reverse and in forward mode."""
    random = np.random.default_rng(11)
    direction = tuple(random.uniform(0.0, 2.0, values.shape) for values in (FRAMES, RADII))

    def observed(moved):
        run = recorded(FRAMES + moved * direction[0], RADII + moved * direction[1], TALL)
        return jnp.sum(DEFINITIONS[name](run))

    def of_each(heights, radius):
        return jnp.sum(DEFINITIONS[name](recorded(heights, radius, TALL)))

    @jax.jit
    def along(moved):
        return jax.jvp(observed, (moved,), (1.0,))

    step = 1e-6 * D
    difference = (along(step)[0] - along(-step)[0]) / (2 * step)
    slopes = jax.jit(jax.grad(of_each, argnums=(0, 1)))(jnp.asarray(FRAMES), jnp.asarray(RADII))
    assert all(np.isfinite(slope).all() for slope in slopes)
    reverse = sum(np.sum(slope * along) for slope, along in zip(slopes, direction, strict=True))
    assert float(reverse) == near(float(difference), rel=1e-6)
    assert float(along(0.0)[1]) == near(float(reverse), rel=1e-9)


@pytest.mark.parametrize("name", DEFINITIONS)
def test_compiled_and_mapped_over_runs(name):
    """Nothing but shapes and the box is known while it is traced."""

    def observed(heights, radius):
        return DEFINITIONS[name](recorded(heights, radius, TALL))

    runs = jnp.stack([FRAMES, FRAMES[:, ::-1] * 1.1])
    radii = jnp.stack([RADII, 0.9 * RADII])
    mapped = jax.jit(jax.vmap(observed))(runs, radii)
    for each, heights, radius in zip(mapped, runs, radii, strict=True):
        np.testing.assert_allclose(each, observed(heights, radius), rtol=1e-10)


# --- what is refused, and what is not to be trusted -----------------------------------------------


@pytest.mark.parametrize("name", DEFINITIONS)
def test_a_spoilt_run_is_spoilt_in_every_observable(name):
    """A fault in a traced call leaves NaN in all that was recorded."""
    assert np.isnan(DEFINITIONS[name](recorded(FRAMES * np.nan, RADII * np.nan, TALL))).all()


@pytest.mark.parametrize("name", DEFINITIONS)
def test_single_precision_stays_single(name):
    run = recorded(FRAMES, RADII, TALL)
    single = recorded(jnp.asarray(FRAMES, "float32"), jnp.asarray(RADII, "float32"), TALL)
    value = DEFINITIONS[name](single)
    assert value.dtype == jnp.float32
    np.testing.assert_allclose(value, DEFINITIONS[name](run), rtol=1e-3)


@pytest.mark.parametrize("name", [*interface.HEIGHTS, "bed front", "concentration"])
def test_a_run_that_is_not_to_be_trusted_is_refused(name):
    run = recorded(FRAMES)

    def check():
        raise mrjax.SimulationError("broken")

    run.check = check
    with pytest.raises(mrjax.SimulationError, match="broken"):
        DEFINITIONS[name](run)


def test_a_dilute_suspension_has_thicker_slabs():
    """One sphere in a room, at the floor and at the lid: its slabs end half a slab above it."""
    room = mrjax.Box((1.0, 1.0, 1.0))
    slab = (6e-4 / np.pi) ** (1 / 3)

    def height(heights):
        return interface.half_concentration(recorded(heights[:, None], 1e-3, room))

    at = jnp.array([1e-3, 1.0 - 1e-3])
    np.testing.assert_allclose(height(at), slab / 2 + at, atol=4e-3)
    assert np.isfinite(jax.jit(jax.jacfwd(height))(at)).all()


def test_what_cannot_be_observed_is_refused():
    run = recorded(FRAMES)
    with pytest.raises(mrjax.InputError, match="'tip' must be one of top, mean-of-top, mass-q"):
        interface.sedimentation_ratio(run, "tip")
    for fraction in (0.0, 1.5, -1.0):
        with pytest.raises(mrjax.InputError, match=f"fraction = {fraction}"):
            interface.mean_of_top(run, fraction)
    for fraction in (0.0, 1.0, 1.5):
        with pytest.raises(mrjax.InputError, match=f"fraction = {fraction}"):
            interface.mass_quantile(run, fraction)
    for thickness in (0.0, -1e-6, np.nan, [1e-6, 1e-6]):
        with pytest.raises(mrjax.InputError, match=r"thickness = .* must be a positive number"):
            concentration(run, [1e-6], thickness)
    with pytest.raises(mrjax.InputError, match=r"levels have shape \(\)"):
        concentration(run, 1e-6, 1e-6)
    run.box = mrjax.Box(BOX.size, (True, True, True))
    for refused in ("half-concentration", "bed front", "concentration"):
        with pytest.raises(mrjax.InputError, match="periodic along z"):
            DEFINITIONS[refused](run)
