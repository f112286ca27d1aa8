"""Forces of one's own: in the compiled loop and with arrays, with gradients, memory and limits."""

import dataclasses
import warnings
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.quantities import dimension, quantity, reduced
from mrjax.core.units import Units
from mrjax.dem.forces import active_forces
from mrjax.kernel import primitive
from mrjax.kernel.llvm import codegen
from tests.builders.particles import glass

near = partial(pytest.approx, abs=0.0)
RADIUS, PULL_OFF, RANGE = 1e-3, 2e-4, 5e-5
ROOM = mrjax.Box((1e-2, 1e-2, 1e-2))
OIL = glass(
    gravity=9.81, elastic_modulus=1e5, friction=0.3, viscosity=1.0, fluid_density=900.0
).astype(float)
STEP = 1e-4


class Attraction(mrjax.PairForce):
    """F = -F_c exp(-h / range) along the normal."""

    pull_off: float = mrjax.quantity("N")
    range: float = mrjax.quantity("m")

    def reach(self, parameters):
        return 3e-4

    def __call__(self, pair, coefficients, memory, time_step):
        size = self.pull_off * jnp.exp(-jnp.maximum(pair.gap, 0.0) / self.range)
        return mrjax.Wrench(tuple(-size * part for part in pair.normal)), memory


class FieldGradient(mrjax.BodyForce):
    """F = -K (x - middle) along x, and a torque about y."""

    strength: float = mrjax.quantity("N/m")
    middle: float = mrjax.quantity("m")
    torque: float = mrjax.quantity("N m", default=0.0)

    def __call__(self, parameters, particles):
        x = particles.position[0]
        force = jnp.stack([-self.strength * (x - self.middle), 0.0 * x, 0.0 * x])
        return mrjax.Wrench(force, self.torque * jnp.stack([0.0 * x, 0.0 * x + 1.0, 0.0 * x]))


OWN = (Attraction(PULL_OFF, RANGE), FieldGradient(2e-2, 4e-3, 1e-8))
ALL = [mrjax.Gravity(), mrjax.Contact(), *OWN]
THREE = mrjax.place(
    [[4e-3, 5e-3, 2e-3], [4e-3, 5e-3, 2e-3 + 2.05 * RADIUS], [7.1e-3, 5e-3, 1.1e-3]],
    contact_diameter=2 * RADIUS,
)


def simulate(forces, parameters=OIL, state=THREE, steps=40, **options):
    return mrjax.simulate(
        state, parameters, ROOM, duration=steps * STEP, time_step=STEP, forces=forces, **options
    )


def exerted(forces, state=THREE, parameters=OIL):
    """Forces and torques of all pairs, as numpy has them."""
    return map(np.asarray, mrjax.contact_forces(state, parameters, ROOM, forces=forces))


# --- what they exert ------------------------------------------------------------------------------


def test_a_pair_force_is_that_of_its_formula():
    """The first two are 0.05 R apart, the third 0.1 R above the floor, which attracts as well."""
    forces, torques = exerted([OWN[0]])
    between, floor = PULL_OFF * np.exp([-0.05 * RADIUS / RANGE, -0.1 * RADIUS / RANGE])
    expected = np.array([[0, 0, between], [0, 0, -between], [0, 0, -floor]])
    np.testing.assert_allclose(forces, expected, rtol=1e-9, atol=1e-18)
    assert not torques.any()


def test_in_single_precision_it_is_the_same_to_its_digits():
    single = jax.tree.map(
        lambda leaf: leaf.astype(jnp.float32) if leaf.dtype == float else leaf, THREE
    )
    expected, _ = exerted(ALL)
    forces, _ = exerted(ALL, single)
    assert forces.dtype == np.float32
    # Gaps of 0.05 R, formed from positions of 5 R, have a hundred roundings.
    np.testing.assert_allclose(forces, expected, rtol=2e-5, atol=1e-5 * np.abs(expected).max())


def test_a_force_ends_at_its_reach_beside_one_that_reaches_farther():

    class Short(mrjax.PairForce):
        def reach(self, parameters):
            return 0.07 * RADIUS

        def __call__(self, pair, coefficients, memory, time_step):
            return mrjax.Wrench(tuple(1e-5 * part for part in pair.normal)), memory

    alone, beside, other = (
        next(exerted(forces)) for forces in ([Short()], [Short(), OWN[0]], [OWN[0]])
    )
    np.testing.assert_allclose(alone[:, 2], [-1e-5, 1e-5, 0.0], rtol=1e-12)
    np.testing.assert_allclose(beside, alone + other, rtol=1e-12, atol=1e-18)


def test_forces_of_a_list_add_up():
    touching = dataclasses.replace(THREE, position=THREE.position.at[1, 2].add(-1e-4))
    lists = [mrjax.Contact(), OWN[0]], [mrjax.Contact()], [OWN[0]]
    for sums, contact, own in zip(*(exerted(forces, touching) for forces in lists), strict=True):
        np.testing.assert_allclose(sums, contact + own, rtol=1e-12, atol=1e-18)


def test_coefficients_by_pair_reach_the_law():
    """R* of two spheres and of a sphere at a wall, and a leaf with one number for each."""

    class Scaled(mrjax.PairForce):
        size: jax.Array = mrjax.quantity("N/m")

        def reach(self, parameters):
            return 2e-4

        def coefficients(self, parameters, surfaces):
            mine, theirs = surfaces.sides(self.size)
            return {
                "size": jnp.where(surfaces.wall, mine, mine * theirs),
                "r": surfaces.reduced_radius,
            }

        def __call__(self, pair, coefficients, memory, time_step):
            assert self.size is None
            size = coefficients["size"] * coefficients["r"]
            return mrjax.Wrench(tuple(-size * part for part in pair.normal)), memory

    one, other, third = 2e-3, 3.0, 5e-3
    forces, _ = exerted([Scaled(jnp.array([one, other, third]))])
    between = one * other * RADIUS / 2
    np.testing.assert_allclose(forces[:, 2], [between, -between, -third * RADIUS], rtol=1e-9)


# --- in a run -------------------------------------------------------------------------------------


def test_gravity_and_contact_are_the_default_to_the_last_bit():
    state = dataclasses.replace(THREE, position=THREE.position.at[1, 2].add(-6e-5))
    alone, listed = (
        simulate(None, state=state),
        simulate([mrjax.Gravity(), mrjax.Contact()], state=state),
    )
    assert alone.deepest_overlap > 0.0
    for one, other in zip(*map(jax.tree.leaves, (alone, listed)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_vector_of_gravity_is_that_of_the_parameters_and_may_be_turned():
    down = simulate([mrjax.Gravity(jnp.array([0.0, 0.0, -9.81])), mrjax.Contact()])
    same = simulate(None)
    np.testing.assert_allclose(down.state.position, same.state.position, rtol=1e-13)
    aside = simulate([mrjax.Gravity(jnp.array([9.81, 0.0, 0.0])), mrjax.Contact()])
    moved = aside.state.position - THREE.position
    fallen = float((same.state.position - THREE.position)[1, 2])
    assert float(moved[1, 0]) == near(-fallen, rel=1e-9)
    assert abs(moved[1, 2]) < 1e-12 * moved[1, 0]
    nothing = simulate([mrjax.Contact()])
    np.testing.assert_array_equal(nothing.state.position, THREE.position)


def test_a_body_force_pulls_to_its_equilibrium_and_its_torque_spins():
    field = FieldGradient(2.0, 4e-3, 1e-8)
    run = simulate([field], steps=4000, frames=2)
    assert float(run.state.position[2, 0]) == near(4e-3, rel=1e-6)
    # Against the drag of a spinning sphere, 8 pi mu R^3.
    spin = 1e-8 / (8.0 * np.pi * 1.0 * RADIUS**3)
    np.testing.assert_allclose(run.state.spin[:, 1], spin, rtol=1e-6)


def test_a_steady_force_is_what_it_is_at_every_step_its_torque_too():
    class Steady(mrjax.BodyForce):
        push: float = mrjax.quantity("N")
        torque: float = mrjax.quantity("N m")

        steady = True

        def __call__(self, parameters, particles):
            along = jnp.array([1.0, 0.0, 0.0])[:, None] * jnp.ones_like(particles.position)
            return mrjax.Wrench(self.push * along, self.torque * along)

    class Unsteady(Steady):
        steady = False

    once, always = (simulate([kind(1e-6, 1e-9)]).state for kind in (Steady, Unsteady))
    assert once.spin[0, 0] > 0.0
    for name in ("position", "velocity", "spin"):
        found, expected = getattr(once, name), getattr(always, name)
        np.testing.assert_allclose(found, expected, rtol=1e-13)


def test_contact_keeps_its_friction_where_another_force_brings_it_about():
    """Weight alone would leave the sphere far from the wall until the end."""
    start = mrjax.place([[5e-3, 5e-3, 5e-3]], contact_diameter=2 * RADIUS)

    class Growing(mrjax.BodyForce):
        def __call__(self, parameters, particles):
            x = particles.position[0]
            push = 0.5 * (x - 4.9e-3)
            return mrjax.Wrench(jnp.stack([push, 0.0 * x, -0.1 * push]))

    aside = mrjax.Gravity(jnp.array([300.0, 0.0, -30.0]))
    for forces in ([Growing(), mrjax.Contact()], [aside, mrjax.Contact()]):
        run = simulate(forces, state=start, steps=2000, frames=1)
        assert run.deepest_overlap > 0.0 and abs(float(run.state.spin[0, 1])) > 0.0


@pytest.mark.parametrize("name", ["pull_off", "range", "strength", "middle", "torque"])
def test_gradients_by_every_coefficient_are_those_of_central_differences(name, gradients):
    _, slopes, at = gradients
    number = next(n for n, force in enumerate(ALL) if hasattr(force, name))
    coefficient = getattr(ALL[number], name)
    slope = float(getattr(slopes[number], name))

    def moved(share):
        changed = list(ALL)
        changed[number] = dataclasses.replace(ALL[number], **{name: coefficient * (1.0 + share)})
        return float(at(changed))

    # Of fourth order; 1e-3 of the value, so that roundings are 1e-13 / 1e-3 of it.
    h = 1e-3
    near_by, far = ((moved(n * h) - moved(-n * h)) / coefficient for n in (1, 2))
    assert slope == near((8.0 * near_by - far) / (12.0 * h), rel=1e-6)
    assert slope != 0.0


@pytest.fixture(scope="module")
def gradients():
    """A smooth function of the end of a run, its slopes in reverse mode."""

    @jax.jit
    def at(forces):
        run = simulate(forces, steps=30)
        return 1e3 * (run.state.position[1, 2] + run.state.position[2, 0]) + run.state.spin[0, 1]

    value, slopes = jax.value_and_grad(at)(ALL)
    _, change = jax.jvp(at, (ALL,), (jax.tree.map(lambda leaf: 1e-2 * leaf, ALL),))
    along = sum(
        1e-2 * leaf * slope
        for leaf, slope in zip(jax.tree.leaves(ALL), jax.tree.leaves(slopes), strict=True)
    )
    assert float(change) == near(float(along), rel=1e-10)
    return value, slopes, at


@pytest.fixture
def without_machine_code(monkeypatch):
    """Every law takes the path of arrays."""

    def missing(loop, particles, room):
        raise NotImplementedError("nothing has machine code in this test")

    jax.clear_caches()
    primitive._warn_once.cache_clear()
    monkeypatch.setattr(codegen, "registered", missing)
    yield
    jax.clear_caches()
    primitive._warn_once.cache_clear()


def test_with_arrays_the_numbers_are_the_same(without_machine_code, monkeypatch):
    with pytest.warns(UserWarning, match="with arrays, which takes longer"):
        arrays = simulate(ALL, steps=10)
    monkeypatch.undo()
    jax.clear_caches()
    compiled = simulate(ALL, steps=10)
    for name in ("position", "velocity", "spin"):
        one, other = getattr(arrays.state, name), getattr(compiled.state, name)
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-12 * float(jnp.abs(other).max()))


def test_an_operation_that_the_loop_lacks_warns_once_and_gives_the_same():
    class Rounded(Attraction):
        def __call__(self, pair, coefficients, memory, time_step):
            wrench, memory = super().__call__(pair, coefficients, memory, time_step)
            factor = jax.lax.cond(pair.gap > -1.0, lambda: 1.0, lambda: 2.0)
            return mrjax.Wrench(tuple(factor * part for part in wrench.force)), memory

    primitive._warn_once.cache_clear()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        first = exerted([Rounded(PULL_OFF, RANGE)])
        simulate([mrjax.Contact(), Rounded(PULL_OFF, RANGE)], steps=2)
    assert len([one for one in said if "machine code" in str(one.message)]) == 1
    np.testing.assert_allclose(next(first), next(exerted([OWN[0]])), rtol=1e-12, atol=1e-20)


# --- memory ---------------------------------------------------------------------------------------


class Bond(mrjax.PairForce):
    """A pair that has touched holds together; it counts the time since, and its way along x."""

    strength: float = mrjax.quantity("N")

    def reach(self, parameters):
        return 1e-4

    def memory(self):
        return {"age": mrjax.Remembered(1, "s"), "way": mrjax.Remembered(3, "m")}

    def __call__(self, pair, coefficients, memory, time_step):
        held = (pair.gap < 0.0) | (memory["age"] > 0.0)
        age = jnp.where(held, memory["age"] + time_step, 0.0)
        way = tuple(
            jnp.where(held, old + time_step * part, 0.0)
            for old, part in zip(memory["way"], pair.slip, strict=True)
        )
        force = tuple(jnp.where(held, -self.strength * part, 0.0) for part in pair.normal)
        return mrjax.Wrench(force), {"age": age, "way": way}


def test_what_pairs_remember_is_kept_from_run_to_run_by_name(tmp_path):
    touching = dataclasses.replace(
        THREE,
        position=THREE.position.at[1, 2].set(2e-3 + 1.99 * RADIUS),
        velocity=THREE.velocity.at[1].set([1e-3, 0.0, 0.0]),
    )
    forces = [mrjax.Contact(), Bond(1e-6)]
    whole = simulate(forces, state=touching, steps=60).state
    half = simulate(forces, state=touching, steps=20).state
    held = np.asarray(half.contacts.partner[0]) == 1
    assert float(half.contacts.named["age"][0, held][0]) == near(20 * STEP, rel=1e-9)
    seen = np.asarray(half.contacts.partner[1]) == 0
    for name, sign in (("age", 1.0), ("way", -1.0)):
        rows = half.contacts.named[name]
        np.testing.assert_allclose(rows[0, held], sign * rows[1, seen], rtol=1e-12)
    mrjax.save_state(tmp_path / "half.npz", half)
    rest = simulate(forces, state=mrjax.load_state(tmp_path / "half.npz"), steps=40).state
    for name in ("age", "way"):
        one, other = rest.contacts.named[name], whole.contacts.named[name]
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12 * float(jnp.abs(other).max()))
    np.testing.assert_allclose(rest.position, whole.position, rtol=1e-12)
    assert rest.contacts.sliding is not None


def test_a_run_with_its_own_force_goes_on_from_its_checkpoint_with_the_same_law_only(tmp_path):
    def follow(force, folder):
        return mrjax.follow(
            THREE,
            OIL,
            ROOM,
            duration=4 * STEP,
            time_step=STEP,
            forces=[mrjax.Contact(), force],
            checkpoint=folder,
        )

    class Stronger(Attraction):
        def __call__(self, pair, coefficients, memory, time_step):
            wrench, memory = super().__call__(pair, coefficients, memory, time_step)
            return mrjax.Wrench(tuple(2.0 * part for part in wrench.force)), memory

    first, again = follow(OWN[0], tmp_path / "run"), follow(OWN[0], tmp_path / "run")
    np.testing.assert_array_equal(first.state.position, again.state.position)
    for other in (Attraction(2 * PULL_OFF, RANGE), Stronger(PULL_OFF, RANGE)):
        with pytest.raises(mrjax.InputError, match="other work, with forces"):
            follow(other, tmp_path / "run")


def test_two_forces_cannot_remember_by_one_name():
    with pytest.raises(mrjax.InputError, match="2 of them remember 'age'"):
        simulate([Bond(1e-6), Bond(2e-6)])


# --- limits ---------------------------------------------------------------------------------------


def test_a_stiff_force_shortens_the_step():
    """F = K (L - h) on spheres without drag: the planes of a close packing have 8 K / m."""

    class Spring(mrjax.PairForce):
        spring: float = mrjax.quantity("N/m")

        def reach(self, parameters):
            return 6e-5

        def __call__(self, pair, coefficients, memory, time_step):
            size = self.spring * jnp.maximum(6e-5 - pair.gap, 0.0)
            return mrjax.Wrench(tuple(size * part for part in pair.normal)), memory

    dry = glass(gravity=0.0, elastic_modulus=1.0).astype(float)
    stiff = [mrjax.Contact(), Spring(1e3)]
    run = mrjax.simulate(THREE, dry, ROOM, duration=1e-3, forces=stiff)
    mass = float(mrjax.particle.mass(dry))
    # The fastest mode of a close packing, `time_scales.CLOSE_PACKED`.
    longest = 2.0 * np.sqrt(mass / (8.0 * 1e3))
    assert 0.9 * longest < run.time_step < 1.001 * longest
    with pytest.raises(mrjax.InputError, match="is unstable for contacts this stiff"):
        mrjax.simulate(THREE, dry, ROOM, duration=1e-1, time_step=1e-3, forces=stiff)
    # Without contact it is the only stiffness, and the moduli need not be known.
    unknown = dry.replace(elastic_modulus=jnp.nan, poisson_ratio=jnp.nan)
    alone = mrjax.simulate(THREE, unknown, ROOM, duration=1e-3, forces=stiff[1:])
    assert 0.9 * longest < alone.time_step < 1.001 * longest


@pytest.mark.parametrize(
    "forces, words",
    [
        (mrjax.Contact(), "give a list"),
        ([mrjax.Contact], "forces\\[0\\] = "),
        ([mrjax.Contact(), 3.0], "forces\\[1\\] = 3.0: give a force"),
        ("gravity", "give a list"),
    ],
)
def test_what_is_no_list_of_forces_is_refused(forces, words):
    with pytest.raises(mrjax.InputError, match=words):
        simulate(forces)


def test_a_traced_reach_is_refused():
    class Far(Attraction):
        def reach(self, parameters):
            return 10.0 * self.range

    assert next(exerted([Far(PULL_OFF, RANGE)])).any()
    with pytest.raises(mrjax.InputError, match="the reach of Far is traced"):
        jax.jit(lambda range_: simulate([Far(PULL_OFF, range_)], steps=2).heights)(RANGE)


def test_units_and_dimensions():
    assert dimension("N m^2/s") == (1, 3, -3) and dimension("1/s") == (0, 0, -1)
    assert dimension("kg/m^3") == (1, -3, 0) and dimension("Pa s") == (1, -1, -1)
    with pytest.raises(ValueError, match="unit 'furlong'"):
        quantity("furlong")
    units = Units(mass=2.0, length=3.0, time=5.0)
    smaller = reduced(Attraction(6.0, 9.0), units)
    assert smaller.range == near(3.0) and smaller.pull_off == near(25.0)
    assert active_forces(None, OIL)[0] == mrjax.Gravity()
