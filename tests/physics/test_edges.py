"""Physics at the edges: centres at one place or on a wall, weights upwards, none, of both signs."""

import jax
import jax.numpy as jnp
import matplotlib.legend
import numpy as np
import pytest
from pytest import approx as near

import calibrate
import mrjax
from mrjax.core.tracing import drop_tracers, evaluated_or_none
from mrjax.laws import closed_forms, hindrance, particle, time_scales
from mrjax.observables import interface
from mrjax.simulation import softening
from tests.builders.particles import light_balls

DRY = dict(
    particle_density=2500.0,
    fluid_density=0.0,
    viscosity=0.0,
    gravity=0.0,
    elastic_modulus=5e7,
    poisson_ratio=0.25,
)
BOX = mrjax.Box((1e-2,) * 3)
MIDDLE = [5e-3] * 3
WET = dict(
    radius=2e-6, fluid_density=1000.0, viscosity=1e-3, elastic_modulus=1e7, poisson_ratio=0.25
)
SMALL_BOX = mrjax.Box((2e-5,) * 3)


def hertz(radius, overlap):
    """On a particle at a rigid wall."""
    return 4 / 3 * 5e7 / (1 - 0.25**2) * np.sqrt(radius) * overlap**1.5


# --- centres at one place, and on a wall ----------------------------------------------------------


def at(places, radius=5e-4):
    return mrjax.place(places), mrjax.Parameters(radius=radius, **DRY)


ON_WALLS = [[0.0, 5e-3, 5e-3], [5e-3, 5e-3, 1e-2]]
SMALL = jnp.array([2e-4, 2e-4, 5e-4])


@pytest.mark.parametrize(
    ("places", "radius"),
    [
        ([ON_WALLS[0]], 5e-4),
        ([ON_WALLS[1]], 5e-4),
        ([MIDDLE, MIDDLE], 5e-4),
        ([MIDDLE, MIDDLE, [2e-3] * 3], SMALL),
    ],
)
def test_the_deepest_overlap_there_is_is_seen(places, radius):
    """By a run, and by all that looks at the contacts of a moment."""
    state, parameters = at(places, radius)
    with pytest.raises(mrjax.SimulationError, match="more than a quarter of a radius"):
        mrjax.simulate(state, parameters, BOX, duration=1e-6, time_step=2e-8)
    touching = mrjax.normal_forces(state, parameters, BOX)
    assert len(touching.first) == 1 and np.isfinite(touching.force).all() and touching.force > 0
    pairs = len(places) > 1
    number = mrjax.coordination_number(state, parameters, BOX)
    assert number.tolist() == ([1, 1] if pairs else [0]) + [0] * (len(places) - 2)


@pytest.mark.parametrize(("place", "axis", "inwards"), [(ON_WALLS[0], 0, 1), (ON_WALLS[1], 2, -1)])
def test_a_centre_on_a_wall_is_pushed_inside(place, axis, inwards):
    """As one 1e-12 m aside is: the overlap is a whole radius."""
    state, parameters = at([place])
    force = mrjax.contact_forces(state, parameters, BOX)[0][0]
    assert float(force[axis]) == near(inwards * hertz(5e-4, 5e-4), rel=1e-6)
    aside = list(place)
    aside[axis] += inwards * 1e-12
    close = mrjax.contact_forces(mrjax.place([aside]), parameters, BOX)[0][0]
    np.testing.assert_allclose(force, close, rtol=1e-6)


def test_others_keep_their_forces_and_derivatives_beside_centres_at_one_place():
    """Two at one place push nowhere; a third on a wall keeps Hertz's law and its slope."""
    overlap = 1e-5
    places = jnp.array([MIDDLE, MIDDLE, [5e-4 - overlap, 2e-3, 2e-3]])
    parameters = mrjax.Parameters(radius=5e-4, **DRY, friction=0.3)

    def force(places):
        state = mrjax.place(places, contact_diameter=1e-3)
        return mrjax.contact_forces(state, parameters, BOX)[0]

    found, slope = force(places), jax.jacrev(force)(places)
    assert np.isfinite(found).all() and np.isfinite(slope).all()
    assert not found[:2].any()
    assert float(found[2, 0]) == near(hertz(5e-4, overlap), rel=1e-6)
    step = 1e-9
    ends = [force(places.at[2, 0].add(sign * step))[2, 0] for sign in (1.0, -1.0)]
    assert float(slope[2, 0, 2, 0]) == near(float(ends[0] - ends[1]) / (2 * step), rel=1e-6)


# --- shapes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("leaf", ["wall_elastic_modulus", "wall_poisson_ratio"])
@pytest.mark.parametrize("particles", [1, 2, 3])
def test_walls_are_of_one_material(leaf, particles):
    places = [[4.9e-4, 2e-3 + 2e-3 * row, 5e-3] for row in range(particles)]
    parameters = mrjax.Parameters(radius=5e-4, **DRY, **{leaf: jnp.full(particles, 0.3)})
    with pytest.raises(mrjax.InputError, match=rf"{leaf} has shape \({particles},\); all walls"):
        mrjax.contact_forces(mrjax.place(places), parameters, BOX)


# Without those of a carrier that is not Newtonian, in which runs of particles are refused.
OF_EACH = [
    name
    for name, one in mrjax.Parameters.__dataclass_fields__.items()
    if not one.metadata["pair"] and not one.metadata["wall"] and one.default is not None
]


@pytest.mark.parametrize("leaf", OF_EACH)
def test_one_number_for_each_particle_is_that_of_each(leaf):
    """Two particles far from each other, on the floor: as either would move alone."""
    parameters = mrjax.Parameters(
        **(WET | dict(particle_density=1200.0, coating_density=900.0, f_r=1.1, elastic_modulus=1e4))
    )
    places = jnp.array([[5e-6, 5e-6, 2.19e-6], [1.5e-5, 1.5e-5, 2.19e-6]])
    value = float(getattr(parameters, leaf))
    values = jnp.array([value, 0.97 * value])

    def fallen(places, parameters):
        state = mrjax.place(places, contact_diameter=4.4e-6)
        run = mrjax.simulate(state, parameters, SMALL_BOX, duration=1e-7, time_step=1e-8)
        return run.state.velocity

    together = fallen(places, parameters.replace(**{leaf: values}))
    for row in (0, 1):
        alone = fallen(places[row : row + 1], parameters.replace(**{leaf: values[row]}))
        np.testing.assert_allclose(together[row], alone[0], rtol=1e-9, atol=1e-24)


# --- net weight upwards ---------------------------------------------------------------------------


def bounced(gravity, height, speed, dissipation, **keywords):
    parameters = mrjax.Parameters(
        radius=5e-4, **(DRY | dict(gravity=gravity)), dissipation=dissipation
    )
    start = mrjax.place([[5e-3, 5e-3, height]], [[0.0, 0.0, speed]])
    return mrjax.simulate(start, parameters, BOX, duration=8e-4, **keywords)


@pytest.mark.parametrize("dissipation", [1e-4, 1e-3])
def test_the_lid_is_the_mirror_image_of_the_floor(dissipation):
    floor = bounced(9.81, 6e-4, -0.5, dissipation)
    lid = bounced(-9.81, 1e-2 - 6e-4, 0.5, dissipation)
    assert lid.time_step == floor.time_step
    assert float(lid.state.velocity[0, 2]) == near(-float(floor.state.velocity[0, 2]), rel=1e-9)


def test_an_unstable_step_is_refused_at_the_lid_too():
    with pytest.raises(mrjax.InputError, match="unstable for contacts this stiff"):
        bounced(-9.81, 1e-2 - 6e-4, 0.5, 0.0, time_step=1e-4)


@pytest.mark.parametrize("density", [1200.0, 800.0])
@pytest.mark.parametrize("frames", [1, 8, 64])
def test_the_settling_velocity_is_the_terminal_one_whatever_the_frames(density, frames):
    parameters = mrjax.Parameters(**WET, particle_density=density)
    start = mrjax.place([[2e-5] * 3, [1e-5] * 3])
    run = mrjax.simulate(start, parameters, mrjax.Box((4e-5,) * 3), duration=2e-5, frames=frames)
    exact = float(closed_forms.free_fall_velocity(parameters, 2e-5))
    assert float(mrjax.settling_velocity(run)) == near(exact, rel=1e-6)


def test_softened_knows_only_the_size_of_the_weight():
    def modulus(density):
        parameters = mrjax.Parameters(**WET, particle_density=density)
        return float(mrjax.softened(parameters, SMALL_BOX, 2, 0.025).elastic_modulus)

    assert 0.0 < modulus(800.0) < 1e7
    assert modulus(800.0) == near(modulus(1200.0), rel=1e-9)
    with pytest.raises(mrjax.InputError, match="nothing presses the particles into a bed"):
        modulus(1000.0)


LAYERS = [
    [4e-6 + 8e-6 * (n % 2), 4e-6 + 8e-6 * (n // 2 % 2), 3e-6 + 6e-6 * (n // 4)] for n in range(12)
]


@pytest.fixture(scope="module")
def sinking_and_rising():
    """The same suspension, once heavy and once, in the mirror, light by as much, to rest."""
    runs = []
    for density in (1200.0, 800.0):
        places = np.array(LAYERS)
        if density < 1000.0:
            places[:, 2] = 2e-5 - places[:, 2]
        parameters = mrjax.Parameters(
            **(WET | dict(elastic_modulus=1e4)), particle_density=density, added_mass=0.0
        )
        runs.append(mrjax.settle(mrjax.place(places), parameters, SMALL_BOX, frames=20))
    return runs


def test_creaming_is_sedimentation_in_the_mirror(sinking_and_rising):
    """The clear layer is below, and every ratio the same; without inertia to tell them apart."""
    sunk, risen = sinking_and_rising
    assert not bool(sunk.rising) and bool(risen.rising)
    frames = min(len(sunk.times), len(risen.times))
    assert float(risen.mudline[0]) == near(2e-5 - float(sunk.mudline[0]), rel=1e-6)
    assert float(risen.mudline[-1]) > float(risen.mudline[0])
    for height in mrjax.HEIGHTS:
        one, other = (mrjax.sedimentation_ratio(run, height)[:frames] for run in (sunk, risen))
        np.testing.assert_allclose(one, other, atol=3e-3, err_msg=height)
    descent = mrjax.mudline_descent(sunk)[: frames - 1] + mrjax.mudline_descent(risen)[: frames - 1]
    assert float(jnp.abs(descent).max()) < 0.02 * float(mrjax.mudline_descent(sunk).max())
    fall, rise = mrjax.asymptotes(sunk), mrjax.asymptotes(risen)
    assert float(rise.initial_slope) == near(-float(fall.initial_slope), rel=1e-2)
    assert float(rise.final_ratio) == near(float(fall.final_ratio), rel=1e-2)
    assert float(rise.crossing_time) == near(float(fall.crossing_time), rel=1e-2)
    fronts = [mrjax.bed_front(run, 0.5)[:frames] for run in (sunk, risen)]
    np.testing.assert_allclose(fronts[0], 2e-5 - fronts[1], atol=3e-7)


def test_the_gradient_of_a_rising_interface():
    """d mudline / d f_v = -v t / f_v, as for one that falls, less half a step at the start."""
    parameters = mrjax.Parameters(**WET, particle_density=800.0)
    start = mrjax.place([[1e-5] * 3], contact_diameter=4e-6)

    def mudline(f_v):
        run = mrjax.simulate(
            start, parameters.replace(f_v=f_v), SMALL_BOX, duration=1e-2, time_step=1e-4
        )
        return run.mudline[-1]

    speed = -float(closed_forms.terminal_velocity(parameters))
    assert float(mudline(1.0)) == near(1e-5 - 2e-6 + 0.995e-2 * speed, rel=1e-6)
    slope = float(jax.grad(mudline)(1.0))
    assert slope == near(-0.995e-2 * speed, rel=1e-6)
    step = 1e-4
    ends = [float(mudline(1.0 + sign * step)) for sign in (1, -1)]
    assert slope == near((ends[0] - ends[1]) / (2 * step), rel=1e-5)


def test_a_bed_under_the_lid_is_as_dense_as_one_on_the_floor():
    heights = 2e-6 + 4e-6 * np.arange(4)
    places = np.stack([np.full(4, 1e-5), np.full(4, 1e-5), heights])
    mirrored = places.copy()
    mirrored[2] = 2e-5 - heights
    found = [
        hindrance.local_volume_fraction(
            mrjax.Parameters(**WET, particle_density=density), SMALL_BOX, jnp.asarray(of), 4e-6
        )
        for density, of in ((1200.0, places), (800.0, mirrored))
    ]
    np.testing.assert_allclose(*found, rtol=1e-9)


# --- none, and of both signs ----------------------------------------------------------------------

PAIR = [[1e-5] * 3, [5e-6] * 3]


def settled(densities, **keywords):
    parameters = mrjax.Parameters(
        **(WET | dict(elastic_modulus=1e4) | keywords), particle_density=jnp.array(densities)
    )
    return mrjax.settle(mrjax.place(PAIR), parameters, SMALL_BOX, frames=10)


def test_a_neutral_particle_stays_where_it_is_while_others_settle():
    run = settled([1000.0, 1200.0])
    np.testing.assert_allclose(run.state.position[0], PAIR[0], rtol=1e-12)
    assert float(run.state.position[1, 2]) == near(2e-6, rel=0.02)


def test_one_sinks_and_one_rises_until_both_rest():
    run = settled([800.0, 1200.0])
    np.testing.assert_allclose(run.state.position[:, 2], [1.8e-5, 2e-6], rtol=0.02)


@pytest.mark.parametrize("change", [dict(gravity=0.0), dict(fluid_density=1200.0)])
def test_what_nothing_pulls_is_not_settled(change):
    with pytest.raises(mrjax.InputError, match="nothing pulls the particles down or up"):
        settled([1200.0, 1200.0], **change)


def test_nothing_rests_in_a_box_without_a_floor():
    parameters = mrjax.Parameters(**WET, particle_density=1200.0)
    endless = mrjax.Box((2e-5,) * 3, (False, False, True))
    with pytest.raises(mrjax.InputError, match="periodic along z, where nothing comes to rest"):
        mrjax.settle(mrjax.place(PAIR), parameters, endless)


def test_a_run_in_which_nothing_settles_has_no_asymptotes():
    parameters = mrjax.Parameters(**WET, particle_density=1000.0)
    run = mrjax.simulate(mrjax.place(PAIR), parameters, SMALL_BOX, duration=1e-7, frames=2)
    with pytest.raises(mrjax.InputError, match="the mudline has not moved"):
        interface.asymptotes(run)


# --- what is traced is not known, and no number ---------------------------------------------------


def test_what_hangs_on_a_traced_value_is_none():
    seen = []

    def looked(viscosity):
        numbers = drop_tracers(
            mrjax.Parameters(**(WET | dict(viscosity=viscosity)), particle_density=1e3)
        )
        seen.append(evaluated_or_none(particle.outer_radius, numbers))
        seen.append(evaluated_or_none(time_scales.rise_time, numbers))
        return viscosity

    jax.jit(looked)(1e-3)
    jax.vmap(looked)(jnp.ones(2))
    assert [None if one is None else float(one) for one in seen] == [2e-6, None] * 2
    jax.grad(looked)(1e-3)
    assert all(one is not None for one in seen[4:])


def test_traced_parameters_are_told_from_neutral_ones():
    def softened(density):
        return mrjax.softened(
            mrjax.Parameters(**WET, particle_density=density), SMALL_BOX, 2, 0.025
        ).elastic_modulus

    with pytest.raises(mrjax.InputError, match="traced by jit or vmap"):
        jax.jit(softened)(1200.0)


def test_a_bed_of_both_signs_presses_with_the_heavier_side():
    def overlap(*densities):
        numbers = mrjax.Parameters(**WET, particle_density=jnp.array(densities))
        return float(softening.resting_overlap(numbers, SMALL_BOX, len(densities)))

    assert overlap(1200.0, 1200.0, 800.0) == near(overlap(1200.0, 1200.0), rel=1e-12)


# --- a lab sheet of particles lighter than the fluid ----------------------------------------------

CREAM = mrjax.Recipe(
    name="cream",
    particle=dict(density=800.0, diameter=4e-6, elastic_modulus=1e9, poisson_ratio=0.25),
    fluid=dict(density=1000.0, viscosity=1e-3),
    composition=dict(particle=0.1, fluid=0.9),
    drag=dict(f_w="richardson-zaki", local=True),
    box=dict(size=[13e-6, 13e-6, 20e-6], periodic=[False] * 3),
)
TUBE = dict(height=0.1, volume_fraction=0.12, bed_fraction=0.6, cells=20, steps=200)
TIMES = [1e4, 4e4, 1e5]


def test_a_column_creams_in_the_mirror():
    """Bit by bit but for the subtraction, and its derivatives by the fluid's viscosity."""
    light = CREAM.parameters()

    def tube(parameters, f_v=1.0):
        given = dict(TUBE, times=TIMES, hindrance=CREAM.hindrance)
        return mrjax.column(parameters.replace(f_v=f_v), **given)

    risen, sunk = tube(light), tube(light.replace(gravity=-light.gravity))
    np.testing.assert_allclose(risen.mudline, 0.1 - sunk.mudline, rtol=1e-12)
    np.testing.assert_allclose(risen.bed_front, 0.1 - sunk.bed_front, rtol=1e-12)
    np.testing.assert_array_equal(risen.sedimentation_ratio, sunk.sedimentation_ratio)
    np.testing.assert_array_equal(risen.volume_fraction, sunk.volume_fraction[:, ::-1])
    # Before it meets the bed the interface rises at the terminal velocity of its suspension.
    felt = light.replace(f_w=CREAM.hindrance(0.12))
    exact = -float(closed_forms.terminal_velocity(felt)) * TIMES[0]
    assert float(risen.mudline[0]) == near(exact, rel=1e-6)
    slope = jax.jvp(lambda f_v: tube(light, f_v).mudline[0], (1.0,), (1.0,))[1]
    assert float(slope) == near(-exact, rel=1e-6)


def test_a_sheet_of_light_particles_gives_a_curve():
    """From the sheet to rest: the clear layer is below, and figures show it."""
    whole = mrjax.sedimentation(CREAM, 0, frames=10)
    ratio = np.asarray(whole.ratio())[0]
    assert bool(whole.run.rising[0])
    assert ratio[0] > 0.8 and 0.2 < ratio[-1] < 0.6
    assert float(whole.run.mudline[0, -1]) == near(2e-5 * (1.0 - ratio[-1]), rel=1e-12)
    drawn = mrjax.figures.sedimentation(whole)
    assert "bottom of the lowest" in str([line.get_label() for line in drawn.axes[0].lines])


def test_a_fit_to_what_rises_is_refused(tmp_path):
    """It reads mudlines that fall."""
    (tmp_path / "cream.toml").write_text(
        'name = "cream"\ncomposition = {particle = 0.1, fluid = 0.9}\n'
        "box.size = [2e-5, 2e-5, 2e-5]\n"
        "fluid = {density = 1000.0, viscosity = 1e-3}\n"
        "[particle]\ndensity = 800.0\ndiameter = 4e-6\n"
        "elastic_modulus = 1e9\npoisson_ratio = 0.25\n"
    )
    (tmp_path / "curve.csv").write_text("time,mudline\n0,0.1\n100,0.09\n200,0.08\n300,0.07\n")
    (tmp_path / "e.toml").write_text(
        'name = "e"\n[[sample]]\nname = "s"\nrecipe = "cream.toml"\nheight = 0.1\n'
        '[sample.curve]\nfile = "curve.csv"\ntime_unit = "s"\nunit = "m"\n'
        '[[parameter]]\nname = "f_v"\nmedian = 1.0\nlog_standard_deviation = 0.5\n'
    )
    with pytest.raises(mrjax.InputError, match="lighter than the fluid and rise"):
        calibrate.Experiment.load(tmp_path / "e.toml")


@pytest.mark.parametrize("density, place", [(1200.0, "upper right"), (800.0, "lower right")])
def test_the_legend_of_concentrations_is_in_the_clear_layer(density, place):
    """Black letters on the dark of a bed cannot be read."""
    parameters = light_balls(particle_density=density)
    start = mrjax.place([[2e-5] * 3, [1e-5] * 3])
    run = mrjax.simulate(start, parameters, mrjax.Box((4e-5,) * 3), duration=2e-5, frames=4)
    legend = mrjax.figures.concentration(run).axes[0].get_legend()
    assert legend._loc == matplotlib.legend.Legend.codes[place]
