"""A column in a rotor: closed forms, the mudline without a grid, mass, gradients and refusals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.tree_util import Partial
from scipy.integrate import solve_ivp

import mrjax
from mrjax.continuum import centrifuge, characteristics, kynch
from mrjax.laws import drag

TOP, FLOOR, RPM = 0.1, 0.13, 1000.0
HEIGHT = FLOOR - TOP
OMEGA = RPM * 2 * np.pi / 60
PARAMETERS = mrjax.Recipe.load("case2").parameters().replace(f_w=1.0, f_s=1.0).astype(float)
SVEDBERG = float(mrjax.terminal_velocity(PARAMETERS) / PARAMETERS.gravity)  # u / g, s
RATE = SVEDBERG * OMEGA**2  # 1/s
ZAKI = Partial(drag.richardson_zaki, exponent=4.65)


def rotor(shape="straight", speed=RPM, **radii):
    return mrjax.Rotor(
        **{"speed": speed, "top_radius": TOP, "floor_radius": FLOOR, "shape": shape} | radii
    )


def settled(times, initial, bed, shape="straight", parameters=PARAMETERS, **options):
    return mrjax.column(
        parameters, height=HEIGHT, volume_fraction=initial, bed_fraction=bed, times=times,
        rotor=rotor(shape), **options,
    )  # fmt: skip


def gridless(times, initial, bed, shape="straight", hindrance=ZAKI, factor=1.0, speed=RPM):
    tube = rotor(shape, speed)
    parameters = PARAMETERS.replace(gravity=tube.floor_acceleration, f_s=factor)
    return centrifuge.mudline(
        parameters, hindrance, jnp.asarray(initial), jnp.asarray(bed), tube, jnp.asarray(times)
    )


@pytest.mark.parametrize("shape, exponent", [("straight", 1), ("sector", 2)])
def test_a_dilute_suspension_thins_and_falls_by_the_closed_forms(shape, exponent):
    """phi_0 exp(-k s omega^2 t) and r_0 exp(s omega^2 t), by 200 cells to 1e-3, from 10 % down."""
    times = np.linspace(0.1, 0.7, 6) * np.log(FLOOR / TOP) / RATE
    column = settled(times, 1e-4, 0.6, shape)
    radius = TOP * np.exp(RATE * times)
    np.testing.assert_allclose(FLOOR - column.mudline, radius, rtol=1e-4)
    thinned = 1e-4 * np.exp(-exponent * RATE * times)
    np.testing.assert_allclose(column.volume_fraction[:, 5], thinned, rtol=1e-3)
    velocity = RATE * (FLOOR - float(column.levels[5]))
    np.testing.assert_allclose(column.settling_velocity[:, 5], velocity, rtol=1e-6)
    exact = FLOOR - np.asarray(gridless(times, 1e-4, 0.6, shape, None))
    np.testing.assert_allclose(exact, radius, rtol=1e-9)
    # All particles are there, in A dr.
    faces = np.linspace(FLOOR, TOP, 201) ** exponent
    solids = np.asarray(column.volume_fraction) @ -np.diff(faces)
    np.testing.assert_allclose(solids, 1e-4 * (faces[0] - faces[-1]), rtol=1e-12)


def test_a_hindered_suspension_follows_its_differential_equation():
    """dphi/dt = -2 omega^2/g f(phi) and dr/dt = omega^2/g r v(phi) until waves arrive."""
    times = np.linspace(0.1, 1.3, 8) * HEIGHT / (RATE * FLOOR)

    def slopes(_, state):
        falling = RATE * (1.0 - state[0]) ** 4.65
        return [-2.0 * falling * state[0], falling * state[1]]

    exact = solve_ivp(slopes, [0, times[-1]], [0.1, TOP], t_eval=times, rtol=1e-11, atol=1e-14).y
    assert exact[1][-1] < FLOOR - HEIGHT * 0.1 / 0.6
    np.testing.assert_allclose(FLOOR - gridless(times, 0.1, 0.6, "sector"), exact[1], rtol=1e-7)
    tube = rotor("sector")
    parameters = PARAMETERS.replace(gravity=tube.floor_acceleration)
    thinned = centrifuge.suspended_fraction(parameters, ZAKI, jnp.asarray(0.1), tube, times)
    np.testing.assert_allclose(thinned, exact[0], rtol=1e-6)


def test_velocities_are_in_proportion_to_the_radius_up_to_the_mudline():
    """Also in the cell that the mudline crosses, which is thinner than the suspension."""
    times = np.array([0.5, 1.0]) * HEIGHT / (RATE * FLOOR)
    column = settled(times, 0.1, 0.6, "sector", hindrance=ZAKI, cells=60)
    relative = np.asarray(column.settling_velocity) / (FLOOR - np.asarray(column.levels))
    for row in relative:
        falling = row[row > 0.0]
        np.testing.assert_allclose(falling[1:], falling[1], rtol=2e-3)  # the first is in the bed


@pytest.mark.parametrize("initial, bed, latest", [(0.15, 0.75, 5.0), (0.5, 0.6, 6.0)])
def test_the_scheme_comes_to_the_mudline_without_a_grid(initial, bed, latest):
    """In a straight mudline, through the fan of a bed, and at rest; within a third of a cell."""
    times = np.linspace(0.05, 1.0, 24) * latest * HEIGHT / (RATE * FLOOR)
    exact = np.asarray(gridless(times, initial, bed, "sector"))
    column = settled(times, initial, bed, "sector", hindrance=ZAKI, cells=150)
    np.testing.assert_allclose(column.mudline, exact, atol=3e-3 * HEIGHT)
    if initial < 0.2:  # the kink where the fan arrives, and a mudline that bends after it
        late = exact[12:20]
        assert (np.diff(exact)[:4] < 4 * np.diff(late).mean()).all() and np.ptp(
            late
        ) > 1e-3 * HEIGHT
    share = 1.0 - initial / bed * (1.0 - (TOP / FLOOR) ** 2)
    rest = FLOOR * (1.0 - np.sqrt(share))
    assert float(rotor("sector").final_ratio(initial / bed)) == pytest.approx(rest / HEIGHT)
    very_late = gridless([1e3 * times[-1]], initial, bed, "sector")
    assert float(very_late[0]) == pytest.approx(rest, rel=1e-9)
    # A bed at rest carries the weight of the particles above.
    weight = float(mrjax.particle.net_weight_density(PARAMETERS) / PARAMETERS.gravity)
    if initial > 0.2:
        low = float(column.levels[0])
        exact_stress = weight * bed * OMEGA**2 * ((FLOOR - low) ** 2 - (FLOOR - rest) ** 2) / 2
        assert float(column.solid_stress[-1, 0]) == pytest.approx(exact_stress, rel=1e-3)


def test_a_denser_bed_is_lower_at_every_time():
    """Also where the uniform suspension becomes thin enough to lie on its bed."""
    flocs = Partial(drag.floc_richardson_zaki, floc_volume=4.0, exponent=5.0)
    times = np.array([1.5, 2.0, 2.03, 2.05, 2.07, 2.09, 2.2, 3.0]) * HEIGHT / (RATE * FLOOR)
    heights = jax.jit(lambda bed: gridless(times, 0.05, bed, "sector", flocs))
    curves = np.array([heights(bed) for bed in np.linspace(0.147, 0.153, 13)])
    # Interpolation between nodes, which move with the bed, is within 4e-8.
    assert (np.diff(curves, axis=0) <= 1e-6 * HEIGHT).all()
    assert (np.ptp(curves[:, -3:], axis=0) > 1e-3 * HEIGHT).all()


def test_a_rotor_of_large_radius_is_gravity():
    """In a tube that is short against its radius the acceleration is that of its floor."""
    tube = mrjax.Rotor(speed=10.0, top_radius=1e3 - 0.1, floor_radius=1e3)
    acceleration = float(tube.floor_acceleration)
    assert acceleration == pytest.approx((np.pi / 3) ** 2 * 1e3)
    parameters = PARAMETERS.replace(gravity=acceleration)
    times = np.linspace(0.1, 5.0, 15) * 0.1 / (SVEDBERG * acceleration)
    found = centrifuge.mudline(
        parameters, ZAKI, jnp.asarray(0.15), jnp.asarray(0.75), tube, jnp.asarray(times)
    )
    table = kynch.table(parameters, ZAKI, jnp.asarray(0.15), jnp.asarray(0.75))
    exact = characteristics.mudline(table, jnp.asarray(0.1), jnp.asarray(times))
    np.testing.assert_allclose(found, exact, atol=3e-4 * 0.1)
    assert np.ptp(exact[-6:]) > 1e-3 * 0.1


def test_derivatives_are_those_of_central_differences():
    """By drag, concentration, bed and speed, in the straight part, in the fan and at rest."""
    times = np.array([0.5, 1.8, 2.5, 9.0]) * HEIGHT / (RATE * FLOOR)

    def heights(theta):
        return gridless(times, theta[0], theta[1], "sector", ZAKI, theta[2], theta[3]) / HEIGHT

    at = jnp.array([0.15, 0.75, 1.0, RPM])
    slope = jax.jit(lambda theta, unit: jax.jvp(heights, (theta,), (unit,)))
    for number, value in enumerate(at):
        unit = value * jnp.zeros(4).at[number].set(1.0)
        exact = slope(at, unit)[1]
        central = (slope(at + 1e-6 * unit, unit)[0] - slope(at - 1e-6 * unit, unit)[0]) / 2e-6
        # The flux is linear between nodes, so that derivatives jump at them.
        np.testing.assert_allclose(exact, central, rtol=1e-4, atol=1e-6)
        assert np.max(np.abs(exact)) > 0.1


def test_derivatives_of_the_scheme_are_those_of_central_differences():
    times = np.array([0.5, 1.5]) * HEIGHT / (RATE * FLOOR)

    def heights(factor):
        parameters = PARAMETERS.replace(f_s=factor)
        column = settled(times, 0.15, 0.6, "sector", parameters, hindrance=ZAKI, cells=20, steps=60)
        return column.mudline / HEIGHT

    slope = jax.jit(lambda factor: jax.jvp(heights, (factor,), (jnp.ones(()),)))
    _, exact = slope(jnp.asarray(1.0))
    above, below = (slope(jnp.asarray(1.0 + side))[0] for side in (1e-6, -1e-6))
    np.testing.assert_allclose(exact, (above - below) / 2e-6, rtol=1e-5)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"rotor": rotor(top_radius=0.14)}, "rotor.top_radius = 0.14: must be below floor_radius"),
        ({"rotor": rotor(top_radius=0.01)}, "rotor.top_radius = 0.01.*at least 0.1 of it"),
        ({"rotor": rotor(speed=0.0)}, "rotor.speed = 0.0: give one number above 0, in rpm"),
        ({"rotor": rotor("round")}, "rotor.shape = 'round': must be one of sector, straight"),
        ({"height": 0.05}, "height = 0.05: must be that between the radii of the rotor, 0.03"),
        ({"tilt": mrjax.Tilt(angle=1.0, gap=0.01)}, "a column in a rotor has no tilt"),
        (
            {"compression": mrjax.Compression(gel_fraction=0.3, stress=1.0, exponent=3.0)},
            "a column in a rotor has no compression",
        ),
        ({"parameters": PARAMETERS.replace(yield_stress=1e-3)}, "has a Newtonian carrier"),
        ({"parameters": PARAMETERS.replace(fluid_density=2e4)}, "lighter than the fluid"),
        (
            {"hindrance": Partial(drag.rigid_network, floc_volume=1.2), "volume_fraction": 0.2},
            "thins down to a volume fraction of .*, where the closure does not hold",
        ),
        ({"hindrance": lambda phi: 2.0 - phi}, "falls faster than a thinner one; in a rotor"),
    ],
)
def test_refused_in_one_line(changes, message):
    given = {
        "parameters": PARAMETERS, "height": HEIGHT, "volume_fraction": 0.2, "bed_fraction": 0.6,
        "times": [10.0], "rotor": rotor(),
    } | changes  # fmt: skip
    with pytest.raises(mrjax.InputError, match=message) as refusal:
        mrjax.column(given.pop("parameters"), **given)
    assert "\n" not in str(refusal.value)
