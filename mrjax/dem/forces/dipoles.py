"""Magnetic dipoles, the force F_M of Eq. 1: remanent moments, and moments that a field induces.

    m_i = V (M_r u_i + k H_i),    H_i = H_0 + sum_j H_ij
    F_i = sum_j F_ij,    torque mu_0 V M_r u_i x H_i

with a unit vector u_i that is fixed in the turning particle; H_ij and F_ij are those of
`mrjax.laws.dipoles`, and k that of `mrjax.laws.magnetism`. An induced moment points along the
local field, which exerts no torque on it.
"""

from collections.abc import Mapping
from dataclasses import field, replace

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import Box
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.quantities import quantity
from mrjax.core.state import State
from mrjax.core.tracing import value_or_none
from mrjax.dem.contact_history import Remembered
from mrjax.dem.forces.contact import acts
from mrjax.dem.forces.force import BodyForce, Particles, Wrench
from mrjax.laws import dipoles, magnetism, particle
from mrjax.laws.dipoles import VACUUM_PERMEABILITY
from mrjax.laws.induced_moments import Sphere, local_fields
from mrjax.laws.vectors import rotated

DIRECTION = "remanence_direction"
"""Name of the direction u of the remanent moment of each particle, (N, 3), in `State.memory`."""
UNIT = 1e-3
"""Largest deviation of the length of a direction from 1."""
MISSING = (
    f"the state has no {DIRECTION}, which a remanence needs: give a state of disperse with the "
    "remanence in its recipe, or mrjax.magnetised(state, seed=0)"
)


class Dipoles(BodyForce):
    """Magnetic forces and torques between all particles, as dipoles, and those of a uniform field.

    Its coefficients are those of `Parameters`: `remanence`, `field`, `susceptibility` and
    `saturation`. Remanent moments turn with the particles; their directions are in
    `State.memory["remanence_direction"]`, from `disperse` or `magnetised`. Induced moments are
    self-consistent at every step.

    Every particle acts on every other, so that the cost grows as N^2: a run suits some 500
    particles. On periodic axes only the nearest image acts. Each particle then sees the others as a
    sample of the size of the box, whose mean field -N M is not that of a layer without sides; N
    is 1/3 for a cube, and M the mean magnetisation. Walls and fluid are not magnetic. Spheres of
    high permeability that touch pull each other several times more than dipoles do.
    """

    permeability: ArrayLike = quantity("N/A^2", "mu_0", default=VACUUM_PERMEABILITY)
    """mu_0, N/A^2."""
    period: ArrayLike | None = quantity("m", "of the box, (3,)", default=None)
    """Length of the period on each axis, 0 on walled axes, (3,) in m; a run sets it by its box."""
    remanent: bool = field(default=True, metadata={"static": True})
    """True if particles have remanent moments; a run leaves them out if the remanence is zero."""
    induced: bool = field(default=True, metadata={"static": True})
    """True if fields induce moments; a run leaves them out if the susceptibility is zero."""

    in_si = False

    def active(self, parameters: Parameters) -> "Dipoles":
        """Returns the force without the moments whose coefficients are known to be zero.

        Raises:
          InputError: there are neither remanent nor induced moments.
        """
        if not is_magnetic(parameters):
            raise InputError(
                "nothing is magnetic, which Dipoles need: give a remanence in A/m, or a field in "
                "A/m, (3,), and a susceptibility; or leave the force out"
            )
        return replace(
            self, remanent=acts(parameters.remanence), induced=acts(parameters.susceptibility)
        )

    def within(self, box: Box) -> "Dipoles":
        """Returns the force with the periods of a box."""
        if not any(box.periodic):
            return replace(self, period=None)
        return replace(self, period=np.where(box.periodic, box.size, 0.0))

    def refuse(self, state: State) -> None:
        """Refuses a state without directions of remanent moments, or whose length is not 1.

        Raises:
          InputError: there is such a fault.
        """
        if not self.remanent:
            return
        if DIRECTION not in state.memory:
            raise InputError(MISSING)
        refuse_directions(state.memory[DIRECTION], state.particles)

    def memory(self) -> dict[str, Remembered]:
        """Direction of the remanent moment of each particle, a unit vector."""
        return {DIRECTION: Remembered(3, "1")} if self.remanent else {}

    def moved(
        self, parameters: Parameters, particles: Particles, time: float
    ) -> Mapping[str, Array]:
        """Returns the directions, turned by the spins; their length stays 1.

        Args:
          parameters: parameters of the run.
          particles: particles, with their directions before that time.
          time: duration, s; negative for half a step back.
        """
        if not self.remanent:
            return particles.memory
        return {DIRECTION: rotated(particles.memory[DIRECTION], time * particles.spin)}

    def __call__(self, parameters: Parameters, particles: Particles) -> Wrench:
        """Returns force and torque on every particle, (3, N) each.

        Raises:
          InputError: the particles have no directions of remanent moments.
        """
        position = particles.position
        remanent = self._remanent_moments(parameters, particles)
        applied = jnp.zeros_like(position, shape=3)
        if parameters.field is not None:
            applied = jnp.asarray(parameters.field)
        if self.induced:
            sphere = spheres(parameters)
            local = local_fields(position, remanent, applied, sphere, self.period)
            moment = remanent + sphere.moment(local)
        else:
            local = applied[:, None] + dipoles.fields(position, remanent, self.period)
            moment = remanent
        force = dipoles.forces(position, moment, self.permeability, self.period)
        if not self.remanent:
            return Wrench(force)
        return Wrench(force, dipoles.torques(remanent, local, self.permeability))

    def between_surfaces(self, parameters: Parameters) -> tuple[ArrayLike, ArrayLike]:
        """Upper bounds on stiffness, N/m, and force, N, of two touching particles of a chain."""
        return (
            magnetism.largest_stiffness(parameters, self.permeability),
            magnetism.largest_pull(parameters, self.permeability),
        )

    def _remanent_moments(self, parameters: Parameters, particles: Particles) -> Array:
        """Remanent moments, (3, N)."""
        if not self.remanent:
            return jnp.zeros_like(particles.position)
        if DIRECTION not in particles.memory:
            raise InputError(MISSING)
        size = particle.core_volume(parameters) * jnp.asarray(parameters.remanence)
        sizes = per_particle(size, particles.position.shape[1])
        return sizes[None, :] * particles.memory[DIRECTION]


def spheres(parameters: Parameters) -> Sphere:
    """Volumes, susceptibility and saturation of the particles."""
    volume = particle.core_volume(parameters)
    assert parameters.susceptibility is not None  # else nothing is induced
    return Sphere(volume, parameters.susceptibility, parameters.saturation)


def is_magnetic(parameters: Parameters) -> bool:
    """True if particles have remanent moments, or a field that induces some."""
    induced = acts(parameters.field) and acts(parameters.susceptibility)
    return acts(parameters.remanence) or induced


def refuse_directions(directions: Array, particles: int) -> None:
    """Refuses directions of another shape or length; traced values pass unchecked.

    Raises:
      InputError: there are such directions.
    """
    if np.shape(directions)[-2:] != (particles, 3):
        raise InputError(
            f"{DIRECTION} has shape {np.shape(directions)}: give a vector of length 1 for each of "
            f"the {particles} particles, (N, 3)"
        )
    values = value_or_none(directions)
    if values is None:
        return
    length = np.sqrt((np.asarray(values, float) ** 2).sum(axis=-1))
    wrong = ~(np.abs(length - 1.0) <= UNIT)
    if wrong.any():
        place = int(np.flatnonzero(wrong.ravel())[0])
        raise InputError(
            f"{DIRECTION} of particle {place} is of length {shown(float(length.ravel()[place]))}: "
            "give vectors of length 1"
        )
