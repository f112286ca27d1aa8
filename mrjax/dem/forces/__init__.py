"""Forces on the particles, one file each; `force` has the base classes.

Drag is linear in velocity and spin, and the integrator solves it exactly. The magnetic force of
Eq. 1 (Son 2018) acts between dipoles; of the weak forces there are the attraction of surfaces and
Brownian motion. The simulations of the paper leave out all three.
"""

import importlib
import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.dem.contact_history import Remembered
from mrjax.dem.forces.brownian import Brownian
from mrjax.dem.forces.contact import ActiveLaws, Contact, active_laws, acts
from mrjax.dem.forces.dipoles import Dipoles, is_magnetic
from mrjax.dem.forces.force import (
    BodyForce,
    Force,
    Noise,
    PairForce,
    Particles,
    Stiffness,
    Wrench,
)
from mrjax.dem.forces.gravity import Gravity, net_weight
from mrjax.dem.forces.van_der_waals import VanDerWaals

# Their names of before.
pull = net_weight
Laws = ActiveLaws
laws = active_laws


def pair_forces(forces: Sequence[Force]) -> tuple[PairForce, ...]:
    """Returns the forces of a list that act between two surfaces."""
    return tuple(force for force in forces if isinstance(force, PairForce))


def body_forces(forces: Sequence[Force]) -> tuple[BodyForce, ...]:
    """Returns the forces of a list that act on each single particle."""
    return tuple(force for force in forces if isinstance(force, BodyForce))


def particle_memory(forces: Sequence[Force]) -> dict[str, Remembered]:
    """Size and unit of each value that a particle remembers, by name, for all forces together."""
    return {name: kind for force in body_forces(forces) for name, kind in force.memory().items()}


def noises(forces: Sequence[Force]) -> tuple[Noise, ...]:
    """Returns the random forces of a list."""
    return tuple(force for force in forces if isinstance(force, Noise))


def greatest_overlap(forces: Sequence[Force]) -> float:
    """Largest overlap for which all forces of a list are valid, in radii."""
    return min((force.greatest_overlap for force in pair_forces(forces)), default=math.inf)


def bundled_forces(parameters: Parameters) -> tuple[Force, ...]:
    """Returns gravity and contact, and attraction, magnetism and Brownian motion where they act.

    They act unless what they need is missing, or known to be zero.
    """
    others = (
        (VanDerWaals(), acts(parameters.hamaker)),
        (Dipoles(), is_magnetic(parameters)),
        (Brownian(), acts(parameters.temperature)),
    )
    return (Gravity(), Contact(), *(force for force, acting in others if acting))


def active_forces(forces: Sequence[Force] | None, parameters: Parameters) -> tuple[Force, ...]:
    """Returns the forces of a run, without the parts whose coefficients are known to be zero.

    Args:
      forces: the list of forces; None for `bundled_forces`.
      parameters: parameters of the run.

    Raises:
      InputError: an entry is not a force, two forces use the same name in the contact history, or
        a parameter that a force needs is missing.
    """
    given = bundled_forces(parameters) if forces is None else forces
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise InputError(
            f"forces = {shown(given)}: give a list, [mrjax.Gravity(), mrjax.Contact()]"
        )
    for place, force in enumerate(given):
        if not isinstance(force, Force):
            raise InputError(
                f"forces[{place}] = {shown(force)}: give a force such as mrjax.Contact(), or one "
                "of a class of your own, derived from mrjax.PairForce, mrjax.BodyForce or "
                "mrjax.Noise"
            )
    active = tuple(force.active(parameters) for force in given)
    for law in (force.law for force in active if isinstance(force, VanDerWaals)):
        active = tuple(
            force.with_attraction(law) if isinstance(force, Contact) else force for force in active
        )
    for kind in (pair_forces(active), body_forces(active)):
        names = Counter(name for force in kind for name in force.memory())
        for name, times in names.items():
            if times > 1:
                raise InputError(
                    f"forces: {times} of them remember {name!r}; give each memory a name of its own"
                )
    return active


def with_gravity_of(forces: Sequence[Force], parameters: Parameters) -> Parameters:
    """Returns the parameters with the gravity along z of the list, zero if it has no `Gravity`."""
    for force in forces:
        if isinstance(force, Gravity):
            return force.parameters(parameters)
    return parameters.replace(gravity=0.0)


def __getattr__(name: str) -> Any:
    """Looks up former names, which now belong to `mrjax.dem.pair_forces`."""
    if name in ("of_contacts", "contact_law", "ContactForces", "Loads"):
        return getattr(importlib.import_module("mrjax.dem.pair_forces"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "ActiveLaws",
    "BodyForce",
    "Brownian",
    "Contact",
    "Dipoles",
    "Force",
    "Gravity",
    "Noise",
    "PairForce",
    "Particles",
    "Stiffness",
    "VanDerWaals",
    "Wrench",
    "active_forces",
    "active_laws",
    "body_forces",
    "bundled_forces",
    "greatest_overlap",
    "net_weight",
    "noises",
    "pair_forces",
    "particle_memory",
    "with_gravity_of",
]
