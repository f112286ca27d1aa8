"""The run: free fall, the paper's velocities from all particles, transformations, refusals."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.laws import time_scales
from tests.builders.particles import head_on

near = partial(pytest.approx, rel=1e-6, abs=0.0)  # its own abs passes all within 1e-12

MM_PER_DAY = 86400e3


def relaxation(parameters) -> float:
    return float(time_scales.relaxation_time(parameters))


@pytest.fixture(scope="module")
def one(case2):
    """A single particle far from the walls, and its parameters."""
    return mrjax.place([[12.5e-6, 12.5e-6, 25e-6]]), case2.parameters().replace(f_w=48.49)


@pytest.mark.parametrize("rise_times", [0.01, 0.3, 1.0, 30.0, 1000.0])
def test_free_fall_is_exact_at_any_step(one, case2, rise_times):
    state, parameters = one
    rate = 9 * 48.49 * 1.1 * 0.01 / ((2 * 7470 + 950) * (2e-6) ** 2)  # Eq. 13 with added mass
    final = 2 * (7470 - 950) * 9.81 * (2e-6) ** 2 / (9 * 0.01 * 48.49 * 1.1)
    step = rise_times * np.log(100) / rate
    run = mrjax.simulate(state, parameters, case2.box, duration=8 * step, frames=8, time_step=step)
    expected = final * -np.expm1(-rate * np.asarray(run.times))
    np.testing.assert_allclose(run.mean_velocity, expected, rtol=1e-9, atol=1e-12 * final)
    assert run.steps == 8


def test_terminal_velocity(one, case2):
    state, parameters = one
    run = mrjax.simulate(
        state, parameters, case2.box, duration=40 * relaxation(parameters), frames=2
    )
    final = 2 * (7470 - 950) * 9.81 * (2e-6) ** 2 / (9 * 0.01 * 48.49 * 1.1)
    assert float(mrjax.settling_velocity(run)) == near(final, rel=1e-10)


@pytest.mark.parametrize(
    "name, f_w, expected",
    [
        ("case1", None, 491.22),
        ("case2", 48.49, 9.2094),
        ("case2", None, 9.1164),
        ("case3", None, 4.8955),
    ],
)
def test_paper_velocities_from_all_particles(name, f_w, expected):
    """Closed forms: Son (2018), Eqs. 13 and 19-24 with their misprints corrected."""
    recipe = mrjax.Recipe.load(name)
    parameters = recipe.parameters()
    if f_w is not None:
        parameters = parameters.replace(f_w=f_w)
    run = mrjax.simulate(
        mrjax.disperse(recipe, seed=3),
        parameters,
        recipe.box,
        duration=20 * relaxation(parameters),
        time_step=relaxation(parameters) / 5,
    )
    assert run.state.particles == (292 if name == "case3" else 314)
    velocity = MM_PER_DAY * float(mrjax.settling_velocity(run))
    assert velocity == near(expected, rel=1e-4)


def test_a_recipe_of_other_materials(tmp_path):
    """Nothing of the paper is wired in: zirconia in glycerol, another closure and exponent."""
    path = tmp_path / "zirconia.toml"
    path.write_text(
        """
        name = "zirconia"
        [particle]
        density = 5680.0
        diameter = 30e-6
        elastic_modulus = 200e9
        poisson_ratio = 0.32
        [fluid]
        density = 1260.0
        viscosity = 1.4
        [composition]
        particle = 0.3
        fluid = 0.7
        [drag]
        f_w = {closure = "richardson-zaki", exponent = 5.1}
        f_s = [40e-6, 30e-6, 25e-6]
        [box]
        size = [300e-6, 200e-6, 400e-6]
        periodic = [true, true, false]
        """
    )
    recipe = mrjax.Recipe.load(path)
    fraction = (0.3 / 5680) / (0.3 / 5680 + 0.7 / 1260)
    factors = (1 - fraction) ** -5.1 * (40 * 30 / 25**2) ** 0.09
    expected = 2 * (5680 - 1260) * 9.81 * (15e-6) ** 2 / (9 * 1.4 * factors)
    parameters = recipe.parameters()
    run = mrjax.simulate(
        mrjax.disperse(recipe),
        parameters,
        recipe.box,
        duration=20 * relaxation(parameters),
        time_step=relaxation(parameters),
    )
    assert float(mrjax.settling_velocity(run)) == near(expected, rel=1e-6)


def test_particles_of_different_size_each_fall_at_their_own_speed():
    radius = jnp.array([1e-6, 2e-6, 3e-6])
    parameters = mrjax.Parameters(
        radius=radius,
        particle_density=jnp.array([7000.0, 8000.0, 3000.0]),
        fluid_density=900.0,
        viscosity=0.01,
        elastic_modulus=1e9,
        poisson_ratio=0.3,
    )
    state = mrjax.place([[10e-6, 10e-6, 20e-6], [10e-6, 20e-6, 20e-6], [20e-6, 10e-6, 20e-6]])
    slowest = float(time_scales.relaxation_time(parameters).max())
    run = mrjax.simulate(
        state, parameters, mrjax.Box((30e-6,) * 3), duration=30 * slowest, time_step=slowest
    )
    expected = (
        2 * (np.array([7000.0, 8000.0, 3000.0]) - 900) * 9.81 * np.asarray(radius) ** 2 / 0.09
    )
    np.testing.assert_allclose(-run.state.velocity[:, 2], expected, rtol=1e-9)


def test_no_drag_and_no_gravity_are_finite_and_differentiable(one, case2):
    state, parameters = one

    def fallen(gravity, viscosity):
        run = mrjax.simulate(
            state,
            parameters.replace(gravity=gravity, viscosity=viscosity),
            case2.box,
            duration=1e-4,
            time_step=1e-5,
        )
        return state.position[0, 2] - run.state.position[0, 2]

    inertia = 7470 + 950 / 2
    drop = (7470 - 950) / inertia * 1e-8 / 2  # for each m/s^2
    assert float(fallen(9.81, 0.0)) == near(9.81 * drop, rel=1e-9)
    assert abs(float(fallen(0.0, 0.0))) < 1e-20  # 25 um there and back between units
    slopes = jax.grad(fallen, argnums=(0, 1))(0.0, 0.0)
    assert float(slopes[0]) == near(drop, rel=1e-9)
    assert float(slopes[1]) == 0.0
    assert float(jax.grad(fallen, argnums=(0, 1))(9.81, 0.0)[1]) < 0


def test_equal_spheres_exchange_their_velocities():
    state, parameters, box = head_on()
    run = mrjax.simulate(state, parameters, box, duration=3e-6, time_step=1e-10)
    np.testing.assert_allclose(run.state.velocity, state.velocity[::-1], atol=1e-7 * 0.01)


def test_a_collision_across_a_periodic_boundary_is_the_same_collision():
    state, parameters, box = head_on()
    periodic = mrjax.Box(box.size, (True, True, True))
    moved = mrjax.place(
        state.position + jnp.array([[5e-6, 5e-6, 5e-6]]), state.velocity, state.spin
    )
    here = mrjax.simulate(state, parameters, box, duration=1.5e-6, time_step=1e-9)
    there = mrjax.simulate(moved, parameters, periodic, duration=1.5e-6, time_step=1e-9)
    # Positions of 5 and 10 micrometres round differently in the sixteenth digit.
    np.testing.assert_allclose(there.state.velocity, here.state.velocity, atol=1e-10)


def test_relabelling_the_particles_relabels_the_result(case2):
    parameters = case2.parameters().replace(viscosity=0.0)
    box = mrjax.Box((12e-6, 12e-6, 30e-6))
    generator = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*[[3e-6, 8e-6]] * 2, [4e-6, 9e-6, 14e-6]), axis=-1).reshape(-1, 3)
    velocity = 0.05 * generator.standard_normal(grid.shape)
    order = generator.permutation(len(grid))

    def final(rows):
        run = mrjax.simulate(
            mrjax.place(grid[rows], velocity[rows]),
            parameters.replace(elastic_modulus=1e8),
            box,
            duration=4e-5,
            time_step=5e-9,
        )
        assert float(run.deepest_overlap) > 1e-3  # they did collide
        return np.asarray(run.state.position)

    straight = final(np.arange(len(grid)))
    # Sums over neighbours in another order round differently; collisions spread the difference.
    np.testing.assert_allclose(final(order), straight[order], atol=1e-6 * 2e-6)


def test_the_rebuild_interval_does_not_change_the_trajectory():
    state, parameters, box = head_on()

    def final(every):
        run = mrjax.simulate(
            state, parameters, box, duration=2e-6, time_step=1e-9, rebuild_every=every
        )
        return np.asarray(run.state.position)

    # 125 as in the other collisions, which are compiled for it.
    np.testing.assert_allclose(final(1), final(125), rtol=1e-12)


def test_frames_record_the_run(case2):
    state, parameters = mrjax.place([[5e-6, 5e-6, 20e-6], [15e-6, 5e-6, 30e-6]]), None
    parameters = case2.parameters()
    step = relaxation(parameters)
    run = mrjax.simulate(
        state, parameters, case2.box, duration=20 * step, frames=10, time_step=step
    )
    assert run.times.shape == run.mudline.shape == run.mean_velocity.shape == (11,)
    np.testing.assert_allclose(run.times, np.linspace(0, 20 * step, 11))
    assert float(run.mudline[0]) == near(32e-6, rel=1e-12)
    assert float(run.mudline[-1]) == near(float(run.state.position[1, 2]) + 2e-6)
    np.testing.assert_allclose(mrjax.sedimentation_ratio(run), run.mudline / 50e-6)
    # The mudline descends as fast as the topmost particle; 1e-5 is left of the transient, and
    # 50 um in double precision are good to 1e-20 m of the 2e-14 m of a frame.
    assert float(mrjax.mudline_descent(run)[-1]) == near(float(run.mean_velocity[-1]), rel=1e-4)


@pytest.mark.slow
def test_jit_vmap_and_float32(case2):
    state, parameters = mrjax.disperse(case2), case2.parameters()
    step = relaxation(parameters)
    keywords = {"duration": 20 * step, "time_step": step}

    def velocity(f_w, state=state):
        run = mrjax.simulate(state, parameters.replace(f_w=f_w), case2.box, **keywords)
        return mrjax.settling_velocity(run)

    plain = float(velocity(48.49))
    assert float(jax.jit(velocity)(48.49)) == near(plain, rel=1e-12)
    factors = jnp.array([40.0, 48.49, 60.0])
    np.testing.assert_allclose(
        jax.vmap(velocity)(factors), plain * 48.49 / np.asarray(factors), rtol=1e-6
    )
    single = mrjax.disperse(case2, dtype=jnp.float32)
    of_single = parameters.replace(f_w=48.49).astype(jnp.float32)
    run = mrjax.simulate(single, of_single, case2.box, **keywords)
    assert run.state.position.dtype == run.mudline.dtype == jnp.float32
    assert float(mrjax.settling_velocity(run)) == near(plain, rel=1e-5)


@pytest.mark.slow
def test_vmap_over_random_states(case2):
    parameters = case2.parameters()
    step = relaxation(parameters)
    positions = jnp.stack([mrjax.disperse(case2, seed).position for seed in (0, 1)])

    def velocity(position):
        state = mrjax.place(position, contact_diameter=4e-6)
        run = mrjax.simulate(state, parameters, case2.box, duration=20 * step, time_step=step / 4)
        return mrjax.settling_velocity(run)

    expected = float(mrjax.terminal_velocity(parameters))
    np.testing.assert_allclose(jax.vmap(velocity)(positions), expected, rtol=1e-6)


def test_what_is_traced_is_asked_for(case2):
    state, parameters = mrjax.place([[5e-6, 5e-6, 20e-6]]), case2.parameters()

    def run(parameters, **keywords):
        return mrjax.simulate(state, parameters, case2.box, duration=1e-8, **keywords).mudline

    with pytest.raises(mrjax.InputError, match=r"give time_step=float\(mrjax.time_step"):
        jax.jit(lambda f: run(parameters.replace(f_w=f)))(50.0)
    with pytest.raises(mrjax.InputError, match="contact_diameter"):
        jax.jit(lambda r: run(parameters.replace(radius=r), time_step=1e-9))(2e-6)
    with pytest.raises(mrjax.InputError, match="duration is traced"):
        jax.jit(lambda t: mrjax.simulate(state, parameters, case2.box, duration=t, time_step=1e-9))(
            1e-8
        )


@pytest.mark.parametrize(
    "keywords, words",
    [
        ({"duration": -1.0}, r"duration = -1.0 must be a positive number of s"),
        ({"duration": float("nan")}, "duration = nan"),
        ({"duration": "1"}, "duration = '1' must be a positive number"),
        ({"duration": 1e-8, "frames": 0}, "frames = 0"),
        ({"duration": 1e-8, "frames": "a"}, "frames = 'a' must be a whole number"),
        ({"duration": 1e-8, "frames": float("nan")}, "frames = nan"),
        ({"duration": 1e-8, "skin": -1}, "skin = -1"),
        ({"duration": 1e-8, "time_step": 0.0}, "time_step = 0.0"),
        ({"duration": 1e6}, "more than 2147483647"),
    ],
)
def test_arguments_that_cannot_be_used(one, case2, keywords, words):
    state, parameters = one
    with pytest.raises(mrjax.InputError, match=words):
        mrjax.simulate(state, parameters, case2.box, **keywords)


def test_a_particle_outside_the_walls_is_refused(case2):
    state = mrjax.place([[5e-6, 5e-6, 20e-6], [5e-6, 26e-6, 20e-6]])
    with pytest.raises(mrjax.InputError, match=r"particle 1 is at y = 2.6e-05 m, outside"):
        mrjax.simulate(state, case2.parameters(), case2.box, duration=1e-8)


@pytest.mark.slow
def test_an_overfull_list_grows_in_a_plain_call_and_poisons_a_traced_one(case2):
    state, parameters = mrjax.disperse(case2), case2.parameters()
    keywords = {"duration": 1e-8, "time_step": 1e-9, "capacity": 1}
    run = mrjax.simulate(state, parameters, case2.box, **keywords)
    assert int(run.fault) == 0 and bool(jnp.all(jnp.isfinite(run.mudline)))

    def last(f_w):
        run = mrjax.simulate(state, parameters.replace(f_w=f_w), case2.box, **keywords)
        return run.mean_velocity[-1], run

    (velocity, run), slope = jax.jit(jax.value_and_grad(last, has_aux=True))(50.0)
    assert jnp.isnan(velocity) and jnp.isnan(slope) and int(run.fault) == mrjax.Fault.PAIRS_DROPPED
    with pytest.raises(mrjax.SimulationError, match="give a larger capacity"):
        mrjax.settling_velocity(run)


def test_a_radius_that_outgrows_the_list_is_an_error_not_a_missed_contact(case2):
    state, parameters = mrjax.disperse(case2), case2.parameters()
    step = relaxation(parameters)

    @jax.jit
    def run(f_r):
        return mrjax.simulate(
            state, parameters.replace(f_r=f_r), case2.box, duration=step, time_step=step
        )

    assert int(run(1.001).fault) == 0
    assert int(run(1.2).fault) & mrjax.Fault.OUTRAN_LIST
    with pytest.raises(mrjax.SimulationError, match="radius grew, beyond the skin"):
        mrjax.settling_velocity(run(1.2))


def test_a_step_too_long_for_a_collision_poisons_a_traced_run():
    state, parameters, box = head_on()
    stiff = jax.jit(
        lambda modulus: mrjax.simulate(
            mrjax.place(state.position, state.velocity, contact_diameter=2e-6),
            parameters.replace(elastic_modulus=modulus),
            box,
            duration=4e-6,
            time_step=2e-7,
        )
    )(1e11)
    assert int(stiff.fault) & (mrjax.Fault.UNSTABLE | mrjax.Fault.TOO_DEEP)
    assert jnp.isnan(stiff.mudline[-1])


def test_a_fast_particle_makes_the_list_rebuild_more_often():
    """Plain calls find an interval that serves; the result is that of the shortest one."""
    state, parameters, box = head_on()
    fast = mrjax.place(state.position, 30 * state.velocity)
    coarse = mrjax.simulate(
        fast, parameters, box, duration=2e-7, time_step=1e-10, rebuild_every=2000
    )
    fine = mrjax.simulate(fast, parameters, box, duration=2e-7, time_step=1e-10, rebuild_every=10)
    assert int(coarse.fault) == 0
    # A few more steps may be taken where the interval is cut: second order in a small step.
    np.testing.assert_allclose(coarse.state.velocity, fine.state.velocity, rtol=1e-4)


@pytest.mark.parametrize(
    "damped, rebound",
    [
        ({"restitution": 1.0}, 1.0),
        ({"restitution": 0.01}, 0.01),
        pytest.param({"restitution": 0.2}, 0.2, marks=pytest.mark.slow),
        pytest.param({"dissipation": 1e-7}, None, marks=pytest.mark.slow),
    ],
)
def test_the_largest_step_named_keeps_damped_impacts_passive(damped, rebound):
    """A dashpot takes its force from the velocity before the step: too long a step would drive."""
    state, parameters, box = head_on()
    parameters = parameters.replace(**damped)
    with pytest.raises(mrjax.InputError, match="unstable") as refusal:
        mrjax.simulate(state, parameters, box, duration=1e-5, time_step=1e-6)
    largest = float(str(refusal.value).split()[-2])

    def returned(step):
        run = mrjax.simulate(state, parameters, box, duration=5e-6, time_step=step)
        return float(run.state.velocity[1, 0]) / 0.01

    converged = returned(largest / 16)
    if rebound is not None:
        assert converged == near(rebound, rel=0.02)
    assert converged < 0.2 or rebound is not None
    # A dozen steps to a contact.
    assert returned(largest) == near(converged, rel=0.15)


@pytest.mark.parametrize(
    "leaf, words",
    [
        ({"radius": float("nan")}, "radius = nan must be above 0, in m"),
        ({"radius": -2e-6}, "radius = -2e-06 must be above 0, in m"),
        ({"radius": [2e-6, 2e-6]}, "radius is a list; give a number or an array"),
        ({"f_w": np.ones(3)}, r"f_w has shape \(3,\); give one number, or one for each of the 1 "),
        ({"viscosity": -0.01}, "viscosity = -0.01 must be at least 0, in Pa s"),
        ({"restitution": 1.5}, "restitution = 1.5 must be above 0, at most 1"),
        ({"poisson_ratio": 0.7}, "poisson_ratio = 0.7 must be above -1, at most 0.5"),
        ({"elastic_modulus": np.inf}, "elastic_modulus = inf must be above 0, in Pa"),
    ],
)
def test_parameters_that_describe_nothing_are_refused(one, case2, leaf, words):
    state, parameters = one
    with pytest.raises(mrjax.InputError, match=words):
        mrjax.simulate(state, parameters.replace(**leaf), case2.box, duration=1e-8)


@pytest.mark.parametrize(
    "positions, keywords, words",
    [
        ([[1e-6, 2e-6]], {}, "shape"),
        ([[1e-6, 2e-6, 3e-6], [1e-6]], {}, "not an array of numbers"),
        ([[1e-6, 2e-6, 3e-6]], {"velocities": [[1.0, 2.0]]}, "velocities have shape"),
        ([[1e-6, 2e-6, 3e-6]], {"dtype": int}, "must be float32 or float64"),
    ],
)
def test_particles_that_cannot_be_placed(positions, keywords, words):
    with pytest.raises(mrjax.InputError, match=words):
        mrjax.place(positions, **keywords)


def test_a_run_goes_on_from_the_state_of_another():
    state, parameters, box = head_on()
    whole = mrjax.simulate(state, parameters, box, duration=2e-6, frames=2, time_step=1e-9)
    half = mrjax.simulate(state, parameters, box, duration=1e-6, time_step=1e-9)
    rest = mrjax.simulate(half.state, parameters, box, duration=1e-6, time_step=1e-9)
    np.testing.assert_allclose(rest.state.position, whole.state.position, rtol=1e-9)
    assert rest.state.spin.shape == (2, 3)


def test_a_place_that_is_not_finite_is_an_error_of_the_run():
    """Also where no wall refuses it, and a search among places would fail with words of its own."""
    parameters, box = mrjax.Recipe.load("case2").parameters(), mrjax.Box((25e-6,) * 3, (True,) * 3)
    state = mrjax.place([[float("inf"), 1e-5, 1e-5], [2e-5, 2e-5, 2e-5]])
    with pytest.raises(mrjax.SimulationError, match="not finite"):
        mrjax.simulate(state, parameters, box, duration=1e-7)
