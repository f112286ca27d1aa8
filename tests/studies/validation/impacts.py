"""Impacts of single spheres on a wall and of pairs, many side by side in one run of the package.

x runs along the surface, z out of it; spins are about y.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat

import jax
import numpy as np
from numpy.typing import ArrayLike

import mrjax

from . import reference
from .reference import RIGID, Material

ROOM = 8.0  # of each impact, radii of the largest sphere
SKIN = 0.5  # diameters; no sphere travels as far while it rebounds
FRICTIONLESS, ELASTIC = 0.0, 1.0
NO_FLUID = dict(fluid_density=0.0, viscosity=0.0)


@dataclass(frozen=True)
class Spheres:
    """N spheres at the moment when they meet something below or above them."""

    material: Sequence[Material]
    radius: ArrayLike
    """m, () or (N,)."""
    velocity: ArrayLike
    """Along x and z, (N, 2) in m/s."""
    spin: ArrayLike = 0.0
    """About y, () or (N,) in rad/s."""

    def contacts_with(self, other: "Spheres | None", wall: Material = RIGID) -> reference.Contact:
        """With the spheres below, or with a wall; (N,)."""
        materials = repeat(wall) if other is None else other.material
        radii = repeat(np.inf) if other is None else other.radii
        return reference.stacked(
            [
                reference.contact(*both)
                for both in zip(self.material, self.radii, materials, radii, strict=False)
            ]
        )

    @property
    def radii(self) -> np.ndarray:
        """m, (N,)."""
        return np.broadcast_to(self.radius, len(self.material)).astype(float)


@dataclass(frozen=True)
class Scene:
    """A run that is ready to start."""

    state: mrjax.State
    parameters: mrjax.Parameters
    box: mrjax.Box
    duration: float
    time_step: float
    skin: float = SKIN


@dataclass(frozen=True)
class Moments:
    """Particles along time; SI."""

    time: np.ndarray  # (T,)
    position: np.ndarray  # (T, N, 3)
    velocity: np.ndarray  # (T, N, 3)
    spin: np.ndarray  # (T, N, 3)
    force: np.ndarray | None = None  # of the contacts, (T, N, 3)


def scene(
    upper: Spheres,
    lower: Spheres | None = None,
    *,
    wall: Material = RIGID,
    friction: ArrayLike = FRICTIONLESS,
    restitution: ArrayLike = ELASTIC,
    steps: int = 1000,
    durations: float = 2.0,
) -> Scene:
    """Each upper sphere above its lower one, or above the floor, ten steps before they touch.

    Args:
      upper, lower: N spheres each; without lower ones there is a floor.
      wall: of the floor.
      friction, restitution: of each impact, () or (N,).
      steps: in the shortest elastic impact.
      durations: of the run, in those of the longest elastic impact.
    """
    count, radius = len(upper.material), upper.radii
    largest = max(radius.max(), 0.0 if lower is None else lower.radii.max())
    velocity, spin = _vectors(upper)
    closing = -velocity[:, 2]
    if lower is not None:
        below_velocity, below_spin = _vectors(lower)
        closing = closing + below_velocity[:, 2]
    elastic = reference.hertz_duration(upper.contacts_with(lower, wall), closing)
    time_step = elastic.min() / steps
    position = np.stack(
        [
            np.full(count, 0.5 * ROOM * largest),
            ROOM * largest * (np.arange(count) + 0.5),
            radius + 10.0 * closing * time_step,
        ],
        axis=1,
    )
    material = np.arange(count)
    if lower is not None:
        below = position.copy()
        below[:, 2] = 0.5 * ROOM * largest - lower.radii
        position[:, 2] += 0.5 * ROOM * largest
        position = np.concatenate([position, below])
        velocity = np.concatenate([velocity, below_velocity])
        spin = np.concatenate([spin, below_spin])
        material = np.tile(material, 2)
    spheres = [upper] if lower is None else [upper, lower]
    return Scene(
        mrjax.place(position, velocity, spin, materials=material),
        mrjax.Parameters(
            radius=np.concatenate([some.radii for some in spheres]),
            **solids([solid for some in spheres for solid in some.material]),
            wall_elastic_modulus=wall.modulus,
            wall_poisson_ratio=wall.poisson,
            friction=table(friction, count),
            restitution=table(restitution, count),
            gravity=0.0,
            **NO_FLUID,
        ).astype(float),
        mrjax.Box(
            (ROOM * largest, ROOM * largest * count, ROOM * largest),
            periodic=(True, True, lower is not None),
        ),
        duration=durations * elastic.max(),
        time_step=time_step,
    )


def solids(materials: Sequence[Material]) -> dict[str, np.ndarray]:
    """Moduli, Poisson's ratios and densities of particles, as `Parameters` names them."""
    return dict(
        elastic_modulus=np.array([solid.modulus for solid in materials]),
        poisson_ratio=np.array([solid.poisson for solid in materials]),
        particle_density=np.array([solid.density for solid in materials]),
    )


def table(values: ArrayLike, count: int) -> np.ndarray:
    """One value for each of a number of materials, with itself and with the walls.

    Impacts that are far from each other are told apart by material: each has its own.
    """
    values = np.broadcast_to(values, count)
    found = np.full((count + 1, count + 1), values[0], float)
    np.fill_diagonal(found[:count, :count], values)
    found[-1, :count] = found[:count, -1] = values
    return found


def after(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Velocities along x and z, (N, 2) in m/s, and spins about y, (N,) in rad/s, at the end.

    Raises:
      RuntimeError: some surfaces are still in contact.
    """
    run = mrjax.simulate(
        scene.state,
        scene.parameters,
        scene.box,
        duration=scene.duration,
        time_step=scene.time_step,
        skin=scene.skin,
        rebuild_every=int(2 * scene.duration / scene.time_step),
        capacity=1,
    )
    state, radius = run.state, np.asarray(scene.parameters.radius)
    height = np.asarray(state.position)[:, 2]
    if scene.box.periodic[2]:
        upper, lower = np.split(height, 2)
        gap = upper - lower - sum(np.split(radius, 2))
    else:
        gap = height - radius
    if np.any(gap <= 0.0):
        raise RuntimeError("the run ends before all surfaces have parted")
    return np.asarray(state.velocity)[:, ::2], np.asarray(state.spin)[:, 1]


def film(scene: Scene, frames: int, *, forces: bool = False) -> Moments:
    """The run with all its states at equal intervals.

    Raises:
      RuntimeError: the run is not to be trusted.
    """
    interval = scene.duration / frames

    @jax.jit
    def onward(state: mrjax.State) -> mrjax.State:
        return mrjax.simulate(
            state,
            scene.parameters,
            scene.box,
            duration=interval,
            time_step=scene.time_step,
            skin=scene.skin,
            rebuild_every=int(2 * interval / scene.time_step) + 1,
        ).state

    force = jax.jit(lambda state: mrjax.contact_forces(state, scene.parameters, scene.box)[0])
    states = [scene.state]
    for _ in range(frames):
        states.append(onward(states[-1]))
    moments = Moments(
        np.linspace(0.0, scene.duration, frames + 1),
        np.array([state.position for state in states]),
        np.array([state.velocity for state in states]),
        np.array([state.spin for state in states]),
        np.array([force(state) for state in states]) if forces else None,
    )
    if not np.all(np.isfinite(moments.position)):
        raise RuntimeError("the package does not trust this run")
    return moments


def vertex(before: np.ndarray, at: np.ndarray, behind: np.ndarray) -> np.ndarray:
    """Extreme of the parabola through three samples at equal distances."""
    return at + (behind - before) ** 2 / (8.0 * (2.0 * at - before - behind))


def _vectors(spheres: Spheres) -> tuple[np.ndarray, np.ndarray]:
    """Velocities and spins, (N, 3)."""
    along = np.broadcast_to(spheres.velocity, (len(spheres.material), 2))
    still = np.zeros(len(along))
    spin = np.broadcast_to(spheres.spin, len(along))
    return (
        np.stack([along[:, 0], still, along[:, 1]], axis=1),
        np.stack([still, spin, still], axis=1),
    )
