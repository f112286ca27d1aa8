"""Brownian motion in runs: diffusion at any step, equal paths of equal seeds, derivatives."""

import math
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.dem import kick_bounds, sorting
from mrjax.laws import brownian, drag, particle, time_scales
from tests.builders.particles import light_balls


def near(value, rel):
    """Equal to a number within a relative tolerance."""
    return pytest.approx(float(value), rel=rel, abs=0.0)


RADIUS = 1e-7
WATER = light_balls(temperature=300.0, radius=RADIUS, gravity=0.0, viscosity=1e-2).astype(float)
D, D_R = (
    float(law(WATER))
    for law in (brownian.diffusion_coefficient, brownian.rotational_diffusion_coefficient)
)
ALPHA = float(drag.coefficient(WATER) / particle.inertia(WATER))
BOX = mrjax.Box((2e-5, 2e-5, 2e-5))
MIDDLE = 1e-5
FREE = [mrjax.Brownian()]


def walks(count, decay, steps):
    """Runs of single particles in steps of `decay` relaxation times, recorded at every step."""

    @jax.vmap
    def walk(seed):
        state = mrjax.place([[MIDDLE] * 3], seed=seed)
        return mrjax.simulate(
            state,
            WATER,
            BOX,
            duration=steps * decay / ALPHA,
            frames=steps,
            time_step=decay / ALPHA,
            forces=FREE,
            trajectory=True,
        )

    return walk(jnp.arange(count))


@pytest.mark.parametrize(
    "decay, steps", [(0.01, 2000), (1.0, 200), (1e2, 100), (1e5, 100)], ids=lambda value: f"{value}"
)
def test_particles_diffuse_by_stokes_and_einstein_at_any_step(decay, steps):
    count = 1000
    run = walks(count, decay, steps)
    time = steps * decay / ALPHA
    # The exact <x^2> of Ornstein and Uhlenbeck from rest; 2 D t once the start is forgotten.
    start = 3.0 - 4.0 * math.exp(-ALPHA * time) + math.exp(-2.0 * ALPHA * time)
    expected = 2.0 * D * time - D / ALPHA * start
    moved = np.asarray(run.state.position)[:, 0] - MIDDLE
    # Four standard errors of a mean square of normal numbers.
    error = 4.0 * math.sqrt(2.0 / count)
    np.testing.assert_allclose((moved**2).mean(axis=0), expected, rtol=error)
    velocity = np.asarray(run.state.velocity)[:, 0]
    thermal = float(brownian.thermal_speed(WATER)) ** 2
    np.testing.assert_allclose(
        (velocity**2).mean(axis=0), thermal * 2.0 / decay * math.tanh(decay / 2.0), rtol=error
    )
    # The angle by the trapezium rule, as positions are.
    spin = np.asarray(run.trajectory.spin)[:, :, 0]
    angle = (spin[:, 1:] + spin[:, :-1]).sum(axis=1) / 2.0 * decay / ALPHA
    spin_decay = ALPHA * float(
        drag.rotational_coefficient(WATER) / particle.moment_of_inertia(WATER) / ALPHA
    )
    start = 3.0 - 4.0 * math.exp(-spin_decay * time) + math.exp(-2.0 * spin_decay * time)
    expected = 2.0 * D_R * time - D_R / spin_decay * start
    np.testing.assert_allclose((angle**2).mean(axis=0), expected, rtol=error)
    # Kicks along different axes, and of particle and spin, are independent.
    both = np.concatenate([velocity, spin[:, -1]], axis=1)
    correlation = np.corrcoef(both.T) - np.eye(6)
    assert abs(correlation).max() < 5.0 / math.sqrt(count)


FOUR = mrjax.place(
    [[4e-7, 5e-7, 2e-7], [7e-7, 5e-7, 3e-7], [5e-7, 8e-7, 4e-7], [3e-7, 2e-7, 6e-7]], seed=3
)
SMALL = mrjax.Box((1e-6, 1e-6, 1e-6))
# In contacts of this stiffness a step of 1e-8 s is stable: 0.06 relaxation times.
SOFT = WATER.replace(elastic_modulus=1e5, gravity=1e5, viscosity=1e-3)
GIVEN = dict(time_step=2e-9)


def positions(state, parameters=SOFT, duration=4e-7, **options):
    run = mrjax.simulate(state, parameters, SMALL, duration=duration, **GIVEN, **options)
    return np.asarray(run.state.position)


def test_a_seed_gives_the_same_path_however_a_run_is_divided():
    once = positions(FOUR)
    np.testing.assert_array_equal(once, positions(FOUR))
    assert abs(once - positions(FOUR.with_seed(4))).max() > 1e-9
    # The same steps in parts differ by rounding, which 200 steps do not amplify by more.
    tolerance = dict(rtol=0.0, atol=1e-9 * RADIUS)
    np.testing.assert_allclose(once, positions(FOUR, frames=4), **tolerance)
    np.testing.assert_allclose(once, positions(FOUR, rebuild_every=25), **tolerance)
    half = mrjax.simulate(FOUR, SOFT, SMALL, duration=2e-7, **GIVEN).state
    assert half.random.step == 100
    np.testing.assert_allclose(once, positions(half, duration=2e-7), **tolerance)
    whole = mrjax.follow(FOUR, SOFT, SMALL, duration=4e-7, **GIVEN)
    np.testing.assert_array_equal(once, whole.state.position)


def test_a_state_on_disk_continues_with_its_random_numbers(tmp_path):
    half = mrjax.simulate(FOUR, SOFT, SMALL, duration=2e-7, **GIVEN).state
    mrjax.save_state(tmp_path / "half.npz", half)
    loaded = mrjax.load_state(tmp_path / "half.npz")
    np.testing.assert_array_equal(positions(half, duration=2e-7), positions(loaded, duration=2e-7))


def test_a_path_does_not_depend_on_the_order_of_the_particles(monkeypatch):
    once = positions(FOUR)
    order = np.array([2, 0, 3, 1])
    other = positions(sorting.permute_state(FOUR, jnp.asarray(order)))
    # Forces are summed in another order.
    tolerance = dict(rtol=0.0, atol=1e-9 * RADIUS)
    np.testing.assert_allclose(once[order], other, **tolerance)
    monkeypatch.setattr(sorting, "SORT_FROM", 2)
    np.testing.assert_allclose(once, positions(FOUR), **tolerance)


def test_single_precision_gets_the_same_numbers():
    single = replace(
        jax.tree.map(jnp.asarray, FOUR),
        **{
            name: getattr(FOUR, name).astype(jnp.float32)
            for name in ("position", "velocity", "spin")
        },
    )
    # 200 roundings of single precision, in contacts that do not amplify them much.
    np.testing.assert_allclose(positions(FOUR), positions(single), rtol=0.0, atol=1e-2 * RADIUS)


@pytest.mark.parametrize("name", ["temperature", "viscosity", "radius", "particle_density"])
def test_derivatives_at_a_fixed_seed_are_central_differences(name):
    state = replace(FOUR, contact_diameter=2 * RADIUS)
    value = float(getattr(SOFT, name))

    weights = jnp.asarray(np.random.default_rng(0).normal(size=(4, 3)))

    def moved(factor):
        changed = SOFT.replace(**{name: value * factor})
        run = mrjax.simulate(state, changed, SMALL, duration=1e-5, time_step=1e-8)
        return jnp.sum(weights * (run.state.position - state.position)) / RADIUS

    forward = jax.jvp(moved, (1.0,), (1.0,))[1]
    assert jax.grad(moved)(1.0) == near(forward, rel=1e-10)
    step = 1e-5
    # Truncation is of order step^2, rounding of 1e-15 / step over a value of 0.1.
    difference = (moved(1.0 + step) - moved(1.0 - step)) / (2.0 * step)
    assert difference == near(forward, rel=1e-6)
    assert jnp.isfinite(jax.jvp(jax.grad(moved), (1.0,), (1.0,))[1])


def test_displacements_are_proportional_to_the_root_of_the_temperature():
    def moved(temperature):
        run = mrjax.simulate(
            mrjax.place([[MIDDLE] * 3], seed=2),
            WATER.replace(temperature=temperature),
            BOX,
            duration=100 / ALPHA,
            time_step=1 / ALPHA,
            forces=FREE,
        )
        return run.state.position[0] - MIDDLE

    value, slope = jax.jvp(moved, (300.0,), (1.0,))
    # The exact law, x = sqrt(T) f(seed), to the rounding of a position.
    np.testing.assert_allclose(slope, value / 600.0, rtol=1e-8)
    np.testing.assert_array_equal(moved(0.0), 0.0)
    np.testing.assert_array_equal(jax.jacfwd(moved)(0.0), 0.0)


def test_local_drag_sets_the_kicks():
    given = dict(duration=1e-6, time_step=1e-8, forces=FREE)
    constant = mrjax.simulate(FOUR, WATER.replace(f_w=4.0), SMALL, **given)
    local = mrjax.simulate(
        FOUR, WATER, SMALL, hindrance=lambda fraction: 4.0 + 0.0 * fraction, **given
    )
    np.testing.assert_allclose(
        constant.state.position, local.state.position, rtol=0.0, atol=1e-9 * RADIUS
    )


class OwnKicks(mrjax.Noise):
    """Brownian motion written in SI."""

    energy: float = mrjax.quantity("J", "k T")

    def __call__(self, parameters, numbers, time_step):
        force = jnp.sqrt(2.0 * self.energy * drag.coefficient(parameters) / time_step)
        torque = jnp.sqrt(2.0 * self.energy * drag.rotational_coefficient(parameters) / time_step)
        return mrjax.Wrench(force * numbers[:3], torque * numbers[3:])


def test_a_noise_of_ones_own_in_si_is_the_bundled_one():
    own = OwnKicks(brownian.BOLTZMANN * 300.0)
    forces = [mrjax.Gravity(), mrjax.Contact()]
    np.testing.assert_allclose(
        positions(FOUR, forces=[*forces, mrjax.Brownian()]),
        positions(FOUR, SOFT.replace(temperature=None), forces=[*forces, own]),
        rtol=0.0,
        atol=1e-9 * RADIUS,
    )
    # A second one has numbers of its own: variances add up, amplitudes do not.
    twice = positions(FOUR, forces=[*forces, mrjax.Brownian(), own])
    assert abs(twice - positions(FOUR, SOFT.replace(temperature=1200.0))).max() > 1e-9


def test_a_missing_temperature_is_refused():
    with pytest.raises(mrjax.InputError, match="temperature is missing"):
        positions(FOUR, SOFT.replace(temperature=None), forces=FREE)


def test_the_step_of_a_run_knows_the_kicks():
    stiff = SOFT.replace(elastic_modulus=1e9, gravity=9.81, viscosity=10.0)
    random = kick_bounds.RandomMotion.of_run(FREE, stiff, None)
    # One step of Brownian motion at full drag spreads by sqrt(2 D dt).
    spread = math.sqrt(2.0 * float(brownian.diffusion_coefficient(stiff)) * 1e-3)
    assert random.kick(1e-3) == near(kick_bounds.DEVIATIONS * spread, rel=1e-6)
    assert random.speed == near(brownian.IMPACT * float(brownian.thermal_speed(stiff)), rel=1e-3)

    def stable(overlap):
        return float(time_scales.largest_stable_step(stiff, overlap))

    step = random.longest_step(stable(1e-12), lambda kick: stable(max(1e-12, kick)))
    kick = random.kick(step)
    # The step is the largest of those that both limits allow.
    assert max(kick / (kick_bounds.LARGEST_KICK * RADIUS), step / stable(kick)) == near(
        1.0, rel=1e-3
    )


@pytest.mark.slow
def test_a_dilute_layer_thins_with_height_by_the_barometric_law():
    # A weight of k T / R: the layer is one radius thick. Steps of 4 % of a radius.
    weight = brownian.BOLTZMANN * 300.0 / RADIUS
    heavy = SOFT.replace(viscosity=1.0, elastic_modulus=1e4)
    heavy = heavy.replace(
        gravity=9.81 * weight / float(particle.net_weight(heavy.replace(gravity=9.81)))
    )
    length = float(brownian.sedimentation_length(heavy))
    assert length == near(RADIUS, rel=1e-12)
    step = (0.04 * RADIUS) ** 2 / (2.0 * float(brownian.diffusion_coefficient(heavy)))
    count, steps, frames = 512, 8_000, 16
    box = mrjax.Box((1e-4, 1e-4, 30 * RADIUS))
    share = (np.arange(count) + 0.5) / count
    heights = RADIUS - length * np.log(1.0 - share)

    @partial(jax.vmap, in_axes=(0, 0))
    def layer(height, seed):
        state = mrjax.place(jnp.array([[5e-5, 5e-5, 0.0]]).at[0, 2].set(height), seed=seed)
        return mrjax.simulate(
            state, heavy, box, duration=steps * step, frames=frames, time_step=step
        ).heights

    z = np.asarray(layer(jnp.asarray(heights), jnp.arange(count)))[:, 1:]
    # Above the soft floor an exponential has the same mean from any height on. Some 370 particles
    # are there, at two independent times: 0.1 is three standard errors.
    floor = 1.3 * RADIUS
    above = z[z > floor] - floor
    assert above.mean() == near(length, rel=0.1)
