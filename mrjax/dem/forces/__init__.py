"""The forces on every particle, one file a force: contact, gravity.

Drag is linear in velocity and spin and part of the integrator, which solves it exactly. Of Eq. 1
(Son 2018) the magnetic and the weak forces are left out, as in the paper.
"""

from mrjax.dem.forces.contact import (
    ActiveLaws,
    ContactForces,
    active_laws,
    contact_force,
    contact_law,
)
from mrjax.dem.forces.gravity import net_weight

# Their names of before.
of_contacts = contact_law
pull = net_weight
Laws = ActiveLaws
laws = active_laws
Loads = ContactForces

__all__ = [
    "ActiveLaws",
    "ContactForces",
    "active_laws",
    "contact_force",
    "contact_law",
    "net_weight",
]
