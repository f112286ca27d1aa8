"""Gradients of the sedimentation curve: both modes, central differences, and an exact law.

Without inertia a bed knows of time only t / (f_w f_s f_v mu): what any of the factors does to a
height h is what time does, d h / d ln f = -t dh/dt. A scan over steps keeps to that but for its
first order in the step, and for contacts that begin or yield within one.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax

FACTORS = ("f_w", "f_s", "f_v", "viscosity")
DURATION, FRAMES, STEPS = 90.0, 5, 10_000
"""In 90 s nearly all of the particles have come to lie in a bed, which takes 5000 stable steps."""


@pytest.fixture(scope="module")
def curves(case2):
    """Of twenty particles between walls, as functions of four logarithms."""
    sheet = case2.model_copy(update={"box": mrjax.Box((10e-6, 10e-6, 20e-6))})
    state = mrjax.disperse(sheet)

    def of(logs, steps, friction=0.3):
        parameters = sheet.parameters().replace(friction=friction)
        parameters = mrjax.softened(parameters, sheet.box, sheet.particle_count, 0.05)
        values = jnp.array([getattr(parameters, name) for name in FACTORS])
        changed = dict(zip(FACTORS, values * jnp.exp(logs), strict=True))
        run = mrjax.simulate(
            state,
            parameters.replace(**changed),
            sheet.box,
            duration=DURATION,
            frames=FRAMES,
            time_step=DURATION / steps,
            rebuild_every=50,
        )
        # A smooth mudline: the highest particles, weighted over an eighth of a diameter.
        top = 0.5e-6 * jax.nn.logsumexp(run.heights / 0.5e-6, axis=1)
        return {"mean": jnp.mean(run.heights, axis=1), "top": top}, run.mean_velocity

    return of


@pytest.fixture(scope="module")
def along(curves):
    """Curves, their derivatives along a direction, and the rate of descent of the mean."""

    @partial(jax.jit, static_argnames=("steps", "friction"))
    def both(logs, direction, steps=STEPS, friction=0.3):
        of = partial(curves, steps=steps, friction=friction)
        (found, descent), (slope, _) = jax.jvp(of, (logs,), (direction,))
        return found, slope, descent

    return both


ORIGIN, EACH = np.zeros(4), np.eye(4)


@pytest.fixture(scope="module")
def forward(along):
    """Curves, slopes and descent for each of the factors."""
    found = {name: along(ORIGIN, way) for name, way in zip(FACTORS, EACH, strict=True)}
    assert all(jnp.isfinite(curves["mean"]).all() for curves, _, _ in found.values())
    return found


def off_the_law(slope, descent):
    """Relative difference from -t dh/dt at the frames after the start, (FRAMES,)."""
    times = np.linspace(0.0, DURATION, FRAMES + 1)[1:]
    return np.asarray(slope["mean"])[1:] / (times * np.asarray(descent)[1:]) - 1


def test_the_particles_have_come_down_into_a_bed(forward):
    curves, slopes, descent = forward["f_w"]
    fallen = 1 - np.asarray(curves["mean"] / curves["mean"][0])
    assert (np.diff(fallen) > 0).all() and fallen[-1] > 0.1
    assert 0 < descent[-1] < 0.1 * descent[1]
    assert (slopes["mean"][1:] > 0).all()  # more drag, higher particles


def test_forward_equals_reverse(curves, forward):
    """The mean height at the end, and the top at every time, added up."""
    weights = jnp.arange(1.0, FRAMES + 2.0)

    def observed(found):
        return 1e6 * (found["mean"][-1] + jnp.sum(weights * found["top"]))

    reverse = jax.jit(jax.grad(lambda logs: observed(curves(logs, STEPS)[0])))(ORIGIN)
    directly = [observed(slope) for _, slope, _ in forward.values()]
    np.testing.assert_allclose(reverse, directly, rtol=1e-9)


@pytest.mark.parametrize("name", FACTORS)
def test_every_factor_moves_time(forward, name):
    """d h / d ln f = -t dh/dt at five times, from the fall to the bed that creeps."""
    _, slope, descent = forward[name]
    assert np.abs(off_the_law(slope, descent)).max() < 1e-2  # 6e-3 at the end, where it creeps


def test_factors_are_one_product(forward):
    for name in FACTORS[1:]:
        for curve in ("mean", "top"):
            np.testing.assert_allclose(
                forward[name][1][curve][1:], forward["f_w"][1][curve][1:], rtol=1e-9
            )


@pytest.mark.slow
def test_half_the_step_halves_the_error_of_the_law(along):
    """Without friction, in the first frame; where later contacts begin is another matter."""
    coarse, fine = (
        off_the_law(*along(ORIGIN, EACH[0], steps=steps, friction=0.0)[1:])
        for steps in (STEPS, 2 * STEPS)
    )
    assert coarse[0] / fine[0] == pytest.approx(2.0, rel=0.1)
    assert np.abs(fine).max() < 0.5 * np.abs(coarse).max()


def test_central_differences(along):
    """Of all factors at once.

    Contacts that begin and springs that yield within a step make the curve rough on the scale of
    a step, 1e-4 of the time. Differences over 1e-5 see what the steps in fact do; those over 1e-3
    average over the roughness and see the law instead, up to 0.6 % off.
    """
    together = EACH.sum(axis=0)
    _, slope, _ = along(ORIGIN, together)
    step = 1e-5
    up, down = (along(sign * step * together, together)[0] for sign in (1.0, -1.0))
    for curve in ("mean", "top"):
        central = (up[curve] - down[curve])[1:] / (2 * step)
        np.testing.assert_allclose(central, slope[curve][1:], rtol=5e-3)
