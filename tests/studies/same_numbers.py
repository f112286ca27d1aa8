"""Computes a set of results of one checkout, and compares two sets to the last bit.

Two checkouts of one machine, each with its own environment or `PYTHONPATH`:

    python same_numbers.py compute before.npz
    python same_numbers.py compute after.npz
    python same_numbers.py compare before.npz after.npz

Only names that the package promises are used, so that one script serves both.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import calibrate
import mrjax

jax.config.update("jax_enable_x64", True)

SMALL = mrjax.Box((14e-6, 14e-6, 28e-6))
RESULTS: dict[str, Callable[[], dict]] = {}


def result(function: Callable[[], dict]) -> Callable[[], dict]:
    RESULTS[function.__name__] = function
    return function


def of_run(run: mrjax.Run) -> dict[str, object]:
    """All that a run has, by name."""
    return {
        "times": run.times,
        "heights": run.heights,
        "mean_velocity": run.mean_velocity,
        "mean_speed": run.mean_speed,
        "radius": run.radius,
        "mudline": run.mudline,
        "overlap": run.deepest_overlap,
        "fault": run.fault,
        "steps": run.steps,
        "time_step": run.time_step,
        "position": run.state.position,
        "velocity": run.state.velocity,
        "spin": run.state.spin,
        "contacts": run.state.contacts,
        "trajectory": run.trajectory,
    }


def recipe(name: str, box: mrjax.Box | None = SMALL) -> mrjax.Recipe:
    sheet = mrjax.Recipe.load(name)
    return sheet if box is None else sheet.model_copy(update={"box": box})


def soft(sheet: mrjax.Recipe, **changes: object) -> mrjax.Parameters:
    parameters = sheet.parameters()
    return mrjax.softened(parameters, sheet.box, sheet.particle_count, 0.05).replace(**changes)


def before_contact(name: str, dtype: type) -> dict:
    """The paper's case at its own stiffness, before anything touches."""
    sheet = mrjax.Recipe.load(name)
    state = mrjax.disperse(sheet, seed=0, dtype=dtype)
    run = mrjax.simulate(
        state, sheet.parameters(), sheet.box, duration=2e-6, frames=4, trajectory=True
    )
    return {**of_run(run), "slope": mrjax.settling_velocity(run)}


def settling(name: str, dtype: type) -> dict:
    sheet = recipe(name)
    state = mrjax.disperse(sheet, seed=1, dtype=dtype)
    run = mrjax.settle(state, soft(sheet, friction=0.3), sheet.box, frames=40, rest=0.02)
    parameters = soft(sheet, friction=0.3)
    touching = mrjax.normal_forces(run.state, parameters, sheet.box)
    return {
        **of_run(run),
        "forces": mrjax.contact_forces(run.state, parameters, sheet.box),
        "coordination": mrjax.coordination_number(run.state, parameters, sheet.box),
        "touching": tuple(touching),
        "ratio": mrjax.sedimentation_ratio(run),
        "front": mrjax.bed_front(run, 0.5),
        "concentration": mrjax.concentration(run, jnp.linspace(1e-6, 27e-6, 9), 2e-6),
    }


for _name in ("case1", "case2", "case3"):
    for _dtype in (np.float32, np.float64):
        _tag = f"{_name}_{np.dtype(_dtype).name}"
        RESULTS[f"before_contact_{_tag}"] = lambda n=_name, d=_dtype: before_contact(n, d)
        RESULTS[f"settling_{_tag}"] = lambda n=_name, d=_dtype: settling(n, d)


def dropped_bed(particles: int, box: mrjax.Box, duration: float) -> dict:
    sheet = recipe("case2", box)
    parameters = sheet.parameters().replace(
        elastic_modulus=1e7,
        wall_elastic_modulus=1e7,
        viscosity=0.0,
        fluid_density=0.0,
        friction=0.2,
        restitution=0.5,
    )
    state = mrjax.disperse(sheet, seed=2)
    assert state.particles > particles, state.particles
    return of_run(
        mrjax.simulate(state, parameters, sheet.box, duration=duration, frames=3, time_step=5e-8)
    )


@result
def dropped_5000() -> dict:
    """Many particles, which are sorted in space, in parts."""
    return dropped_bed(4900, mrjax.Box((100e-6, 100e-6, 50e-6)), 2.5e-4)


@result
def dropped_300() -> dict:
    return dropped_bed(300, mrjax.Box((25e-6, 25e-6, 50e-6)), 3e-3)


@result
def periodic() -> dict:
    sheet = recipe("case2", mrjax.Box(SMALL.size, (True, True, False)))
    run = mrjax.settle(
        mrjax.disperse(sheet, seed=3), soft(sheet, friction=0.3), sheet.box, frames=20, rest=0.05
    )
    return of_run(run)


@result
def periodic_everywhere() -> dict:
    sheet = recipe("case2", mrjax.Box(SMALL.size, (True, True, True)))
    return of_run(
        mrjax.simulate(
            mrjax.disperse(sheet, seed=3),
            soft(sheet),
            sheet.box,
            duration=2.0,
            frames=2,
            time_step=0.002,
            hindrance=lambda phi: (1 - phi) ** -4.65,
        )
    )


def polydisperse_bed() -> tuple[mrjax.State, mrjax.Parameters, mrjax.Box]:
    sheet = recipe("case2")
    state = mrjax.disperse(sheet, seed=4)
    count = state.particles
    radius = 2e-6 * (1.0 - 0.3 * np.linspace(0.0, 1.0, count))
    parameters = soft(sheet, friction=0.3, rolling_friction=0.1, rolling_damping=0.2)
    return state, parameters.replace(radius=jnp.asarray(radius)), sheet.box


@result
def polydisperse_and_rolling() -> dict:
    state, parameters, box = polydisperse_bed()
    run = mrjax.settle(state, parameters, box, frames=30, rest=0.05)
    return {**of_run(run), "forces": mrjax.contact_forces(run.state, parameters, box)}


@result
def local_drag() -> dict:
    sheet = recipe("case2")
    run = mrjax.settle(
        mrjax.disperse(sheet, seed=5),
        soft(sheet),
        sheet.box,
        frames=20,
        rest=0.05,
        hindrance=sheet.hindrance,
    )
    return of_run(run)


@result
def two_materials() -> dict:
    state, parameters, box = polydisperse_bed()
    materials = np.arange(state.particles) % 2
    table = jnp.asarray([[0.1, 0.2, 0.3], [0.2, 0.4, 0.5], [0.3, 0.5, 0.0]])
    state = mrjax.place(
        state.position, materials=materials, contact_diameter=state.contact_diameter
    )
    run = mrjax.settle(state, parameters.replace(friction=table), box, frames=20, rest=0.1)
    return of_run(run)


@result
def several_starts_and_a_checkpoint() -> dict:
    sheet = recipe("case2", mrjax.Box((10e-6, 10e-6, 20e-6)))
    states = [mrjax.disperse(sheet, seed) for seed in range(3)]
    with tempfile.TemporaryDirectory() as folder:
        call = lambda: mrjax.settle(  # noqa: E731
            states, soft(sheet), sheet.box, frames=20, rest=0.05, checkpoint=Path(folder) / "kept"
        )
        return {"first": of_run(call()), "again": of_run(call())}


@result
def followed() -> dict:
    sheet = recipe("case2")
    state = mrjax.disperse(sheet, seed=6)
    run = mrjax.follow(
        state, soft(sheet), sheet.box, duration=100.0, frames=5, time_step=0.01, trajectory=True
    )
    return of_run(run)


@result
def whole_sedimentation() -> dict:
    found = mrjax.sedimentation(recipe("case2", mrjax.Box((12e-6, 12e-6, 24e-6))), seeds=(0, 1))
    return {"ratio": found.ratio(), "softening": found.softening, "run": found.run}


@cache
def settled_bed() -> tuple[mrjax.Recipe, mrjax.Parameters, mrjax.State]:
    sheet = recipe("case2")
    parameters = soft(sheet, friction=0.3)
    run = mrjax.settle(mrjax.disperse(sheet, seed=7), parameters, sheet.box, frames=20, rest=0.1)
    return sheet, parameters, run.state


def height(theta: jax.Array) -> jax.Array:
    """A number of a run with contacts, from factors on its parameters and its start."""
    sheet, parameters, state = settled_bed()
    changed = parameters.replace(
        f_w=parameters.f_w * theta[0],
        friction=0.3 * theta[1],
        elastic_modulus=parameters.elastic_modulus * theta[2],
        radius=parameters.radius * theta[3],
        restitution=0.9 * theta[4],
        rolling_friction=0.05 * theta[5],
    )
    run = mrjax.simulate(
        state, changed, sheet.box, duration=3.0, frames=3, time_step=0.01, rebuild_every=20
    )
    # Something of everything that a run has.
    return jnp.sum(run.heights[-1] ** 2) * 1e9 + jnp.sum(run.state.spin**2) + run.mudline[-1] * 1e5


ONE = jnp.ones(6)


@result
def reverse_gradient() -> dict:
    value, slope = jax.value_and_grad(height)(ONE)
    return {"value": value, "slope": slope}


@result
def forward_gradient() -> dict:
    value, change = jax.jvp(height, (ONE,), (jnp.arange(1.0, 7.0),))
    return {"value": value, "change": change, "all": jax.jacfwd(height)(ONE)}


@result
def compiled_reverse_gradient() -> dict:
    settled_bed()  # outside of what is traced
    return {"slope": jax.jit(jax.grad(height))(ONE)}


@result
def gradient_of_start() -> dict:
    sheet, parameters, state = settled_bed()

    def total(position: jax.Array) -> jax.Array:
        start = mrjax.place(position, contact_diameter=state.contact_diameter)
        run = mrjax.simulate(
            start, parameters, sheet.box, duration=1.0, time_step=0.01, rebuild_every=20
        )
        return jnp.sum(run.heights[-1] ** 2)

    return {"slope": jax.grad(total)(state.position)}


@result
def before_contact_gradient() -> dict:
    sheet = mrjax.Recipe.load("case2")
    state = mrjax.disperse(sheet, seed=0)

    def velocity(theta: jax.Array) -> jax.Array:
        parameters = sheet.parameters().replace(f_w=theta[0], f_s=theta[1], f_v=theta[2])
        run = mrjax.simulate(state, parameters, sheet.box, duration=3e-7, time_step=1e-10)
        return mrjax.settling_velocity(run)

    theta = jnp.asarray([48.985, 1.1, 1.0])
    return {"reverse": jax.grad(velocity)(theta), "forward": jax.jacfwd(velocity)(theta)}


def with_factor(f_w: jax.Array) -> mrjax.Run:
    sheet, parameters, state = settled_bed()
    return mrjax.simulate(
        state,
        parameters.replace(f_w=f_w),
        sheet.box,
        duration=2.0,
        frames=2,
        time_step=0.01,
        rebuild_every=20,
    )


@result
def ensembles() -> dict:
    settled_bed()  # outside of what is traced
    factors, run = jnp.linspace(40.0, 60.0, 4), with_factor
    return {
        "ensemble": of_run_leaves(mrjax.ensemble(run, factors)),
        "vmap": of_run_leaves(jax.vmap(run)(factors)),
    }


@result
def gradient_of_an_ensemble() -> dict:
    settled_bed()  # outside of what is traced
    factors = jnp.linspace(40.0, 60.0, 4)
    total = lambda by: jnp.sum(mrjax.ensemble(with_factor, by * factors).heights)  # noqa: E731
    return {"slope": jax.grad(total)(1.0)}


def of_run_leaves(run: mrjax.Run) -> list:
    return jax.tree.leaves(run)


def columns(compression: mrjax.Compression | None) -> dict:
    sheet = mrjax.Recipe.load("case2")
    parameters = sheet.parameters()

    def tube(factor: jax.Array) -> mrjax.Column:
        return mrjax.column(
            parameters.replace(f_s=1.1 * factor),
            height=0.1,
            volume_fraction=0.2,
            bed_fraction=0.6,
            times=jnp.linspace(1e4, 2e6, 30),
            hindrance=jax.tree_util.Partial(mrjax.drag.richardson_zaki),
            compression=compression,
            cells=60,
            steps=8000,
        )

    one = jnp.asarray(1.0)
    found = tube(one)
    return {
        "tube": jax.tree.leaves(found),
        "steps": mrjax.column_steps(
            parameters,
            height=0.1,
            volume_fraction=0.2,
            bed_fraction=0.6,
            times=jnp.linspace(1e4, 2e6, 30),
            hindrance=jax.tree_util.Partial(mrjax.drag.richardson_zaki),
            compression=compression,
            cells=60,
        ),
        "slope": jax.jvp(lambda factor: tube(factor).mudline, (one,), (one,)),
        "reverse": jax.grad(lambda factor: tube(factor).mudline[-1])(one),
    }


@result
def column() -> dict:
    return columns(None)


@result
def column_with_a_compressible_bed() -> dict:
    return columns(mrjax.Compression(gel_fraction=0.3, stress=50.0, exponent=3.0))


@result
def fit() -> dict:
    times = jnp.linspace(0.0, 3.0, 30)
    truth = 2.0 * jnp.exp(-0.7 * times) + 0.3
    noise = 0.01 * np.random.default_rng(0).standard_normal(30)

    def residuals(theta: dict) -> jax.Array:
        curve = theta["a"] * jnp.exp(-theta["rate"] * times) + theta["floor"]
        return (curve - truth - noise) / 0.01

    found = calibrate.fit(residuals, {"a": 1.0, "rate": 0.3, "floor": 0.1})
    return {
        "values": found.values,
        "runs": found.model_runs,
    }


@result
def fit_of_a_simulation() -> dict:
    sheet = mrjax.Recipe.load("case2")
    state = mrjax.disperse(sheet, seed=0)

    def residuals(theta: dict) -> jax.Array:
        parameters = sheet.parameters().replace(f_s=theta["f_s"])
        run = mrjax.simulate(state, parameters, sheet.box, duration=3e-7, time_step=1e-9)
        return jnp.atleast_1d((86400e3 * mrjax.settling_velocity(run) - 8.0) / 0.1)

    found = calibrate.fit(residuals, {"f_s": 1.5})
    return {"value": found.values, "runs": found.model_runs}


def flat(name: str, tree: object) -> dict[str, np.ndarray]:
    leaves, _ = jax.tree.flatten_with_path(tree)
    return {name + jax.tree_util.keystr(path): np.asarray(leaf) for path, leaf in leaves}


def compute(out: Path, wanted: list[str]) -> None:
    """Every result that the file does not hold yet."""
    found = dict(np.load(out)) if out.exists() else {}
    done = {name.split("[")[0] for name in found}
    for name, function in RESULTS.items():
        if name in done or (wanted and name not in wanted):
            continue
        began = time.perf_counter()
        try:
            found |= flat(name, function())
        except Exception as error:  # of which the comparison tells
            found |= {f"{name}[failed]": np.asarray(type(error).__name__)}
        np.savez(out, **found)
        print(f"{name}: {time.perf_counter() - began:.1f} s", flush=True)


def compare(before: Path, after: Path) -> int:
    """Prints what differs, and how much; the number of arrays that do."""
    one, other = dict(np.load(before)), dict(np.load(after))
    different = sorted(set(one) ^ set(other))
    for name in different:
        print(f"{name}: only {'before' if name in one else 'after'}")
    count = len(different)
    for name in sorted(set(one) & set(other)):
        a, b = one[name], other[name]
        if a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes():
            continue
        count += 1
        if a.shape != b.shape or a.dtype != b.dtype:
            print(f"{name}: {a.dtype}{a.shape} before, {b.dtype}{b.shape} after")
            continue
        scale = np.nanmax(np.abs(a)) or 1.0
        print(f"{name}: differs by {np.nanmax(np.abs(a - b)) / scale:.2g} of the largest")
    print(f"{len(set(one) & set(other))} arrays compared, {count} differ")
    return count


if __name__ == "__main__":
    if sys.argv[1] == "compute":
        compute(Path(sys.argv[2]), sys.argv[3:])
    else:
        sys.exit(1 if compare(Path(sys.argv[2]), Path(sys.argv[3])) else 0)
