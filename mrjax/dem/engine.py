"""The motion of N particles, one interval of the neighbour list after another.

Reduced units: the largest contact radius is the unit of length, the step is the unit of time. An
interval begins with a look at the list, which is rebuilt if need be, and takes a fixed number of
steps. Compiled loops over intervals and frames are in `scan` and `pieces`.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from jax.typing import DTypeLike

from mrjax.core.box import Box
from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.run import Fault
from mrjax.core.trajectory import Trajectory
from mrjax.core.units import Units
from mrjax.dem import contact_history, integrator, neighbours, pairs, stability
from mrjax.dem.contact_history import PairHistory, ParticleHistory
from mrjax.dem.forces import ActiveLaws, contact_law, net_weight
from mrjax.dem.integrator import Kick
from mrjax.dem.neighbours import Plan
from mrjax.dem.pairs import Pairs
from mrjax.dem.stability import ModeEstimate
from mrjax.laws import effective, particle
from mrjax.laws.hindrance import Hindrance, hindered_parameters

MAX_OVERLAP = 0.25
"""Overlap, as a fraction of the radius, beyond which Hertz's law is not a description."""
SPEED_MARGIN = 2.0
"""By how much a particle may be faster in the next interval than the fastest is now. One that
becomes faster still outruns the list, which a run does not pass over."""


class Motion(NamedTuple):
    """What one interval hands to the next, in reduced units."""

    listed: Pairs
    origin: Array  # positions when the list was built, (3, N)
    travelled: Array  # since then, (3, N)
    velocity: Array  # (3, N)
    spin: Array  # (3, N)
    memory: PairHistory
    overlap: Array  # deepest of each particle so far, (N,)
    swing: ModeEstimate
    fault: Array  # ()

    @property
    def position(self) -> Array:
        """(3, N)."""
        return self.origin + self.travelled


class Observed(NamedTuple):
    """What is recorded of a motion at one time, in reduced units."""

    heights: Array  # (N,)
    descent: Array  # mean velocity, downwards, ()
    speed: Array  # mean speed, ()
    moved: Trajectory | None  # (N, 3) each

    def in_lab_units(self, units: Units, sound: Array) -> "Observed":
        """Reduced units to SI, times a factor, (): 1, or NaN for a run not to be trusted."""
        return Observed(
            sound * units.length * self.heights,
            sound * units.velocity * self.descent,
            sound * units.velocity * self.speed,
            None if self.moved is None else self.moved.in_lab_units(units, sound),
        )


class Outcome(NamedTuple):
    """What a whole motion comes to."""

    notes: ParticleHistory
    overlap: Array  # deepest, radii, ()
    coating: Array  # deepest, thicknesses of the coating, ()
    fault: Array  # ()


class Engine:
    """The laws by which a motion goes on: begun, interval after interval, looked at."""

    def __init__(
        self,
        parameters: Parameters,
        material: Array | None,
        hindrance: Hindrance | None,
        particles: int,
        dtype: DTypeLike,
        *,
        box: Box,
        plan: Plan,
        steps: int,
        laws: ActiveLaws,
        trajectory: bool,
    ) -> None:
        """All in reduced units.

        Args:
          parameters, material, hindrance: of the particles.
          particles: N.
          dtype: of the motion.
          box: the container.
          plan: of the neighbour list.
          steps: in an interval.
          laws: those that act at a contact.
          trajectory: whether positions, velocities and spins are observed.
        """
        self.parameters, self.material, self.hindrance = parameters, material, hindrance
        self.particles, self.dtype = particles, dtype
        self.box, self.plan, self.steps = box, plan, steps
        self.laws, self.trajectory = laws, trajectory
        self.law = contact_law(parameters, laws=laws, material=material)
        self.pull = net_weight(parameters, particles)
        self.radius = per_particle(particle.outer_radius(parameters), particles)
        self.skin_left = plan.cutoff - 2.0 * jnp.max(self.radius)
        # Without hindrance they do not depend on where the particles are.
        self.everywhere = self._pushes() if hindrance is None else None

    def begun(
        self, position: Array, velocity: Array, spin: Array, notes: ParticleHistory
    ) -> Motion:
        """A motion from where the particles are; (3, N) each, and what their contacts remember."""
        listed, origin, travelled = self._list_at(position)
        return Motion(
            listed,
            origin,
            travelled,
            velocity,
            spin,
            contact_history.pairs_from_particles(notes, listed),
            jnp.zeros(self.particles, self.dtype),
            stability.unknown(self.particles, self.dtype),
            listed.overflow,
        )

    def interval(self, motion: Motion) -> Motion:
        """The next steps, after a look at the list."""
        if self.particles > 1:
            motion = lax.cond(self._stale(motion), self._listed_anew, lambda motion: motion, motion)
        listed, origin = motion.listed, motion.origin
        loads = self.law(listed)

        def step(carry, looked_at):
            half_way, velocity, spin, memory, deepest, farthest = carry

            def kick(half_way: Array, velocity: Array):
                now = self.everywhere
                if now is None:
                    now = self._pushes(origin + half_way)
                keep, spin_keep, gains, falling = now
                found = loads(half_way, velocity, spin, memory, deepest, gains)
                return keep, falling + found.force, (found, spin_keep)

            half_way, velocity, (found, spin_keep) = integrator.step(half_way, velocity, kick, 1.0)
            spin = integrator.kicked(spin, spin_keep, found.torque)
            gone = lax.stop_gradient(sum(half_way**2))
            farthest = jnp.maximum(farthest, jnp.where(looked_at, gone, 0.0))
            return (half_way, velocity, spin, found.history, found.deepest, farthest), None

        half_way = integrator.drifted(motion.travelled, motion.velocity, 0.5)
        begin = (
            half_way,
            motion.velocity,
            motion.spin,
            motion.memory,
            jnp.zeros_like(motion.travelled, shape=self.plan.pairs),
            lax.stop_gradient(sum(half_way**2)),
        )
        # Contacts are looked at half-way; where the last step leads, the next interval looks.
        looked_at = np.arange(self.steps) < self.steps - 1
        (half_way, velocity, spin, memory, deepest, farthest), _ = lax.scan(step, begin, looked_at)
        travelled = integrator.drifted(half_way, velocity, -0.5)
        outran = (2.0 * jnp.sqrt(jnp.max(farthest)) > self.skin_left) & (self.particles > 1)
        fault = motion.fault | jnp.where(outran, int(Fault.OUTRAN_LIST), 0)
        constants = effective.per_pair(self.parameters, self.material, *listed.surfaces)
        kicks = self._kicks(origin + travelled)
        bed = (motion.swing, listed, constants, deepest, self.radius, *kicks)
        swing = stability.swing(*lax.stop_gradient(bed), sliding=self.laws.sliding)
        fault |= jnp.where(swing.rate > stability.STABILITY_LIMIT, int(Fault.UNSTABLE), 0)
        deepest = jnp.maximum(motion.overlap, listed.deepest(deepest))
        return Motion(listed, origin, travelled, velocity, spin, memory, deepest, swing, fault)

    def observed(self, motion: Motion) -> Observed:
        """What is recorded of it."""
        speed = jnp.sqrt(lax.stop_gradient(sum(motion.velocity**2)))
        moved = None
        if self.trajectory:
            moved = Trajectory(motion.position.T, motion.velocity.T, motion.spin.T)
        descent = 0.0 - jnp.mean(motion.velocity[2])
        return Observed(motion.position[2], descent, jnp.mean(speed), moved)

    def checked(self, motion: Motion) -> Motion:
        """The same with every fault that shows by now."""
        return motion._replace(fault=self._faults(motion, *self._depths(motion)))

    def outcome(self, motion: Motion) -> Outcome:
        """What it comes to, with every fault that shows by now."""
        overlap, coating = self._depths(motion)
        fault = self._faults(motion, overlap, coating)
        return Outcome(
            contact_history.particles_from_pairs(motion.memory, motion.listed),
            overlap,
            coating,
            fault,
        )

    def _depths(self, motion: Motion) -> tuple[Array, Array]:
        """Deepest overlap, in radii and in thicknesses of the coating, () each."""
        overlap = jnp.max(motion.overlap / self.radius)
        thickness = particle.coating_thickness(self.parameters)
        coated = thickness > 0.0
        depth = jnp.where(coated, motion.overlap / jnp.where(coated, thickness, 1.0), 0.0)
        return overlap, jnp.max(depth)

    def _faults(self, motion: Motion, overlap: Array, coating: Array) -> Array:
        return motion.fault | _faults_of_motion(self.box, motion, overlap, coating)

    def _kicks(self, position: Array | None = None) -> tuple[Kick, Kick]:
        felt = self.parameters
        if self.hindrance is not None and position is not None:
            felt = hindered_parameters(
                self.parameters, self.hindrance, self.box, position, spacing=2.0
            )
        return integrator.kick(felt, 1.0), integrator.spin_kick(felt, 1.0)

    def _pushes(self, position: Array | None = None) -> tuple[Array, Array, Array, Array]:
        """What a step keeps of velocities and of spins, its gains, and what gravity adds."""
        straight, turning = self._kicks(position)
        gains = jnp.stack(jnp.broadcast_arrays(straight.gain, turning.gain))
        return straight.keep, turning.keep, gains, jnp.atleast_2d(straight.gain) * self.pull

    def _list_at(self, position: Array) -> tuple[Pairs, Array, Array]:
        """A list, where it was built, and what has been travelled since: nothing.

        All that is differentiated of a position is what is travelled, particle by particle, not
        also the separation of every pair.
        """
        origin = lax.stop_gradient(position)
        # A lone particle has room for every wall, and may go where it likes.
        gap = self.skin_left if self.particles > 1 else jnp.asarray(jnp.inf, self.dtype)
        found = neighbours.build(self.plan, self.box, origin.T)
        listed = pairs.listed(found, self.box, origin, self.radius, gap, self.plan.pairs)
        return listed, origin, position - origin

    def _stale(self, motion: Motion) -> Array:
        """Whether a particle may leave the skin before the end of the next interval."""
        gone, speed = (
            jnp.sqrt(jnp.max(sum(lax.stop_gradient(of) ** 2)))
            for of in (motion.travelled, motion.velocity)
        )
        return (2.0 * (gone + SPEED_MARGIN * self.steps * speed) > self.skin_left) & (gone > 0.0)

    def _listed_anew(self, motion: Motion) -> Motion:
        listed, origin, travelled = self._list_at(motion.position)
        return motion._replace(
            listed=listed,
            origin=origin,
            travelled=travelled,
            memory=contact_history.pairs_from_particles(
                contact_history.particles_from_pairs(motion.memory, motion.listed), listed
            ),
            fault=motion.fault | listed.overflow,
        )


def _faults_of_motion(box: Box, end: Motion, deepest: Array, coating: Array) -> Array:
    """What a motion shows of a step that was too long, ()."""
    escaped = jnp.zeros((), bool)
    for axis in box.walled_axes:
        outside = (end.position[axis] < 0.0) | (end.position[axis] > box.size[axis])
        escaped = escaped | jnp.any(outside)
    moved = (end.position, end.velocity, end.spin)
    finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(part)) for part in moved]))
    found = (
        (deepest > MAX_OVERLAP, Fault.TOO_DEEP),
        (escaped, Fault.ESCAPED),
        (coating > 1.0, Fault.THROUGH_COATING),
        (~finite, Fault.NOT_FINITE),
    )
    faults = [jnp.where(here, int(fault), 0) for here, fault in found]
    return sum(faults[1:], faults[0]).astype(jnp.int32)
