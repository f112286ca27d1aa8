"""Sum of all pair forces in one compiled loop.

Each force is written for one pair, with vectors as tuples of three components. The kernel evaluates
each pair of a list once and adds the result to both of its surfaces.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jax import Array, lax

from mrjax.core.parameters import Parameters
from mrjax.dem.coefficients import CoefficientArrays
from mrjax.dem.contact_history import History, Remembered
from mrjax.dem.forces import ActiveLaws, Contact, Force, PairForce, Wrench, pair_forces
from mrjax.dem.kinematics import PairKinematics, ParticleState, pair_kinematics, separation
from mrjax.dem.pairs import Pairs
from mrjax.kernel import pair_sum
from mrjax.laws import particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.particle import CoatedParticle
from mrjax.laws.vectors import Vector, dot, plus, times

Tree = TypeVar("Tree")


class PairForceSums(NamedTuple):
    """Sums of pair forces and torques on every particle at one moment, and the new history."""

    force: Array  # force in N, times the gain, (3, N)
    torque: Array  # torque in N m, times the gain, (3, N)
    history: History
    deepest: Array  # deepest overlap of each pair so far, m; (P,)


SumOverPairs = Callable[[Array, Array, Array, History, Array, Array], PairForceSums]


class PairForces:
    """Pair forces of a run, with everything that stays constant during the run computed once."""

    def __init__(
        self,
        forces: Sequence[PairForce],
        parameters: Parameters,
        *,
        reach: Sequence[float] = (),
        material: Array | None = None,
        coated: CoatedParticle | None = None,
        time_step: float = 1.0,
    ) -> None:
        """Prepares the forces between the surfaces of these particles.

        Args:
          forces: the pair forces, in the units of the parameters.
          parameters: physical parameters, in any coherent system of units.
          reach: largest gap at which each force acts; if left out, all act in contact only.
          material: material index of each particle, (N,); None if all have the same material.
          coated: the coated particles; if left out, they are computed from the parameters.
          time_step: time by which the history advances at every evaluation.
        """
        self.forces, self.parameters, self.material = tuple(forces), parameters, material
        self.reach = tuple(reach) or (0.0,) * len(self.forces)
        self.coated = particle.coated_particle(parameters) if coated is None else coated
        self.time_step = time_step

    def on(self, pairs: Pairs) -> SumOverPairs:
        """Returns the function that sums the forces over the pairs of a list.

        The arguments of the function are: displacements since the list was built, velocities and
        spins, (3, N) each; the history of the pairs; the deepest overlap of each pair so far, (P,);
        and the gains, factors of forces and torques, (2,) or (2, N). With the gains of a step, the
        sums are the changes of velocity and spin in it. So reverse mode need not store forces.
        """
        return _SumOverList(self, pairs).forces


class _Particles(NamedTuple):
    """Operands that each particle has."""

    displacement: Vector
    velocity: Vector
    spin: Vector
    radius: Array | None  # None if all radii are equal
    gains: Vector | None  # None if all gains are equal


class _Pairs(NamedTuple):
    """Operands that each pair has."""

    separation: Vector  # when the list was built
    axis: Array
    coefficients: Sequence[Vector | None]  # of each force; None if equal for all pairs or by kind


class _Shared(NamedTuple):
    """Operands that all pairs share."""

    coefficients: Sequence[Sequence[Vector]]  # of each force
    gains: Vector | None  # None if each particle has its own


class _Memory(NamedTuple):
    """Values that each pair carries from one evaluation to the next."""

    history: Sequence[Sequence[Vector]]  # of each force, in the order of its names
    deepest: Array  # deepest overlap so far


class _SumOverList:
    """Pair forces with their coefficients for one pair list."""

    def __init__(self, law: PairForces, pairs: Pairs) -> None:
        self.law, self.pairs = law, pairs
        self.coefficients = [
            CoefficientArrays.of_pairs(force, law.parameters, law.coated, law.material, pairs)
            for force in law.forces
        ]
        self.names = [tuple(force.memory()) for force in law.forces]
        self.radius = law.coated.radius if jnp.ndim(law.coated.radius) else None
        self.separation = jnp.stack(pairs.separation)

    def forces(
        self,
        displacement: Array,
        velocity: Array,
        spin: Array,
        history: History,
        deepest: Array,
        gains: Array,
    ) -> PairForceSums:
        """Sums forces and torques at one moment, and advances the history of the pairs."""
        if not self.law.forces:
            nothing = jnp.zeros_like(velocity)
            return PairForceSums(nothing, nothing, history, deepest)
        alike = gains.ndim == 1
        sums, memory = pair_sum(
            self._law,
            self._in_reach,
            self.pairs.first,
            self.pairs.second,
            self.pairs.count,
            particles=_Particles(
                displacement, velocity, spin, self.radius, None if alike else gains
            ),
            pairs=_Pairs(
                self.separation, self.pairs.axis, [one.by_pair for one in self.coefficients]
            ),
            memory=_Memory([[history[name] for name in names] for names in self.names], deepest),
            shared=_Shared([one.shared for one in self.coefficients], gains if alike else None),
            lasting=_Memory(False, True),  # type: ignore[arg-type] # bools in place of arrays
        )
        torque = sums["torque"] if "torque" in sums else jnp.zeros_like(sums["force"])
        later = {
            name: value
            for names, values in zip(self.names, memory.history, strict=True)
            for name, value in zip(names, values, strict=True)
        }
        return PairForceSums(sums["force"], torque, later, memory.deepest)

    def _state(self, operands: _Particles, shared: _Shared) -> ParticleState:
        """Motion and radius of one of the two surfaces of a pair."""
        displacement, velocity, spin, radius, gains = operands
        if radius is None:
            radius = self.coefficients[0].equal_radius(shared.coefficients[0])
        multiplied = shared.gains if gains is None else gains
        assert multiplied is not None  # gains are either per particle or shared
        return ParticleState(displacement, velocity, spin, radius, multiplied)

    def _in_reach(
        self, first: _Particles, second: _Particles, pair: _Pairs, shared: _Shared, _: _Memory
    ) -> Array:
        """True if the surfaces overlap, or the gap is within the reach of a force."""
        particle, partner = self._state(first, shared), self._state(second, shared)
        between = separation(particle, partner, pair.separation, pair.axis)
        distance = particle.radius + jnp.where(pair.axis < 0, partner.radius, 0.0)
        if gap := max(self.law.reach):
            distance = distance + gap
        return dot(between, between) < distance**2

    def _law(
        self, first: _Particles, second: _Particles, pair: _Pairs, shared: _Shared, memory: _Memory
    ) -> tuple[dict[str, Vector], dict[str, Vector], _Memory]:
        """Forces and torques on both particles of a pair, times their gains, and its new memory."""
        particle, partner = self._state(first, shared), self._state(second, shared)
        terms = [
            coefficients.of_pair(shared.coefficients[n], pair.coefficients[n], pair.axis)
            for n, coefficients in enumerate(self.coefficients)
        ]
        kinematics = pair_kinematics(particle, partner, pair.separation, pair.axis)
        wrenches, history = [], []
        for n, (force, own) in enumerate(terms):
            remembered = dict(zip(self.names[n], memory.history[n], strict=True))
            wrench, new = force(kinematics, own, remembered, self.law.time_step)
            if self.law.reach[n] < max(self.law.reach):
                acts = kinematics.gap < self.law.reach[n]
                wrench, new = _where(acts, wrench), _where(acts, dict(new))
            wrenches.append(wrench)
            history.append([new[name] for name in self.names[n]])
        total, torque, partner_torque = _total(wrenches)
        on_particle = {"force": times(particle.gains[0], total)}
        on_partner = {"force": times(-partner.gains[0], total)}
        if torque is not None and partner_torque is not None:
            on_particle["torque"] = times(particle.gains[1], torque)
            on_partner["torque"] = times(partner.gains[1], partner_torque)
        # Only recorded: no force reads it.
        deepest = lax.stop_gradient(jnp.maximum(memory.deepest, kinematics.overlap))
        return on_particle, on_partner, _Memory(history, deepest)


def _total(wrenches: Sequence[Wrench]) -> Wrench:
    """Sum of forces and torques; the result has both torques or none."""
    total, *others = wrenches
    for wrench in others:
        total = Wrench(
            plus(total.force, 1.0, wrench.force),
            _sum(total.torque, wrench.torque),
            _sum(total.partner_torque, wrench.partner_torque),
        )
    force, torque, partner_torque = total
    if torque is None and partner_torque is None:
        return total
    zero = (jnp.zeros_like(force[0]),) * 3
    return Wrench(
        force,
        zero if torque is None else torque,
        zero if partner_torque is None else partner_torque,
    )


def _sum(first: Vector | None, second: Vector | None) -> Vector | None:
    """Sum of two vectors; None stands for zero."""
    if first is None:
        return second
    return first if second is None else plus(first, 1.0, second)


def _where(acts: Array, tree: Tree) -> Tree:
    """Replaces the scalars of a tree by zeros unless a force acts."""
    return jax.tree.map(lambda leaf: jnp.where(acts, leaf, 0.0), tree)


def memory_of(forces: Sequence[Force]) -> dict[str, Remembered]:
    """Size and unit of each entry of the contact history, by name, for all forces together."""
    return {name: kind for force in pair_forces(forces) for name, kind in force.memory().items()}


def over_pairs(
    law: Callable[[PairKinematics, Any], Tree], kinematics: PairKinematics, coefficients: Any
) -> Tree:
    """Evaluates a law of one pair for P pairs, with array operations.

    Args:
      law: function of the kinematics and the coefficients of one pair.
      kinematics: kinematics of the pairs, (P,) each.
      coefficients: a pytree of arrays, (P,) or ().
    """
    axes = jax.tree.map(lambda leaf: 0 if jnp.ndim(leaf) else None, coefficients)
    return jax.vmap(law, (0, axes))(kinematics, coefficients)


def total_stiffness(
    law: PairForces, pairs: Pairs, kinematics: PairKinematics
) -> tuple[Array, Array]:
    """Sum of dt K + 2 c over all forces for every pair, normal and tangential; (P,) each."""
    surfaces = SurfacePairs(*pairs.surfaces, law.material, law.coated)
    nothing = jnp.zeros_like(kinematics.overlap)
    in_normal, in_plane = nothing, nothing
    for force, reach in zip(law.forces, law.reach, strict=True):
        acts = pairs.present & (kinematics.gap < reach)
        along, across = over_pairs(
            partial(force.for_one_pair().stiffness, time_step=law.time_step),
            kinematics,
            force.coefficients(law.parameters, surfaces),
        )
        in_normal += jnp.where(acts, along, 0.0)
        in_plane += jnp.where(acts, across, 0.0)
    return in_normal, in_plane


def contact_law(
    parameters: Parameters,
    *,
    laws: ActiveLaws,
    material: Array | None = None,
    coated: CoatedParticle | None = None,
    time_step: float = 1.0,
) -> Callable[[Pairs], SumOverPairs]:
    """Former name of `PairForces.on`, for `Contact` alone."""
    arguments = {"material": material, "coated": coated, "time_step": time_step}
    return PairForces((Contact(laws),), parameters, **arguments).on  # type: ignore[arg-type]


of_contacts = contact_law
ContactForces = Loads = PairForceSums
