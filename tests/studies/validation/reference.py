"""What the simulations are compared with: closed forms of impacts, and the law integrated anew.

Nothing here uses the package. Along the contact's normal (Hertz, with Tsuji's damping, no tension),

    F_n = 4/3 E* sqrt(R* d) d + z sqrt(5 m* k) d^(1/4) d' >= 0,    k = 4/3 E* sqrt(R*)

and along its plane (Mindlin, with the same damping ratio, within Coulomb's limit),

    F_t = -K_t s - z sqrt(10/3 m* K_t) s',    K_t = 8 G* sqrt(R* d),    |F_t|, |K_t s| <= mu F_n

with overlap d and tangential displacement s. x runs along the surface, z out of it; spins are
about y, so that the lowest point of a sphere moves with v - R w.
"""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.special import beta, betainc

DATA = Path(__file__).parents[1] / "data"


def load(name: str) -> dict:
    """A table of published numbers."""
    return tomllib.loads((DATA / name).read_text("utf-8"))


@dataclass(frozen=True)
class Material:
    """An elastic solid."""

    modulus: float
    """E, Pa."""
    poisson: float
    """nu."""
    density: float
    """kg/m^3."""

    @property
    def shear_modulus(self) -> float:
        """G = E / 2(1 + nu), Pa."""
        return self.modulus / (2.0 * (1.0 + self.poisson))


RIGID = Material(modulus=np.inf, poisson=0.0, density=np.inf)
"""Of a wall; its radius is infinite too."""


@dataclass(frozen=True)
class Contact:
    """What two surfaces have in common; each () or (N,)."""

    modulus: np.ndarray
    """E*: 1/E* = sum of (1 - nu^2)/E, Pa."""
    shear_modulus: np.ndarray
    """G*: 1/G* = sum of (2 - nu)/G, Pa."""
    radius: np.ndarray
    """R*, m."""
    mass: np.ndarray
    """m*, kg."""

    @property
    def stiffness(self) -> np.ndarray:
        """k = 4/3 E* sqrt(R*) of F = k d^(3/2), N/m^1.5."""
        return 4 / 3 * self.modulus * np.sqrt(self.radius)


def mass(material: Material, radius: float) -> float:
    """Of a sphere, kg."""
    return 4 / 3 * np.pi * radius**3 * material.density


def contact(
    material: Material, radius: float, other: Material = RIGID, other_radius: float = np.inf
) -> Contact:
    """Of a sphere with another, or with a wall; radii in m."""

    def harmonic(first: float, second: float) -> float:
        return 1.0 / (1.0 / first + 1.0 / second)

    sides = (material, other)
    return Contact(
        modulus=1.0 / sum((1.0 - side.poisson**2) / side.modulus for side in sides),
        shear_modulus=1.0 / sum((2.0 - side.poisson) / side.shear_modulus for side in sides),
        radius=harmonic(radius, other_radius),
        mass=harmonic(mass(material, radius), mass(other, other_radius)),
    )


def stacked(contacts: Sequence[Contact]) -> Contact:
    """Many contacts as one of arrays, (N,)."""
    names = ("modulus", "shear_modulus", "radius", "mass")
    return Contact(*(np.array([getattr(one, name) for one in contacts]) for name in names))


# --- closed forms ---------------------------------------------------------------------------------


def hertz_depth(contact: Contact, speed: float) -> float:
    """Deepest overlap of an elastic impact, (15 m* v^2 / (16 E* sqrt(R*)))^(2/5); m."""
    return (
        15.0 * contact.mass * speed**2 / (16.0 * contact.modulus * np.sqrt(contact.radius))
    ) ** 0.4


def hertz_force(contact: Contact, overlap: float) -> float:
    """k d^(3/2), N."""
    return contact.stiffness * np.maximum(overlap, 0.0) ** 1.5


def hertz_duration(contact: Contact, speed: float) -> float:
    """2 d_max / v times the integral of (1 - x^(5/2))^(-1/2) from 0 to 1; s."""
    return 0.8 * beta(0.4, 0.5) * hertz_depth(contact, speed) / speed


def hertz_rise(share: np.ndarray) -> np.ndarray:
    """When an elastic impact has reached this share of its deepest overlap, in durations; 1.

    Half the integral of (1 - x^(5/2))^(-1/2) from 0 to the share over that to 1.
    """
    return 0.5 * betainc(0.4, 0.5, share**2.5)


def sliding_loss(contact: Contact, own_mass: float, mu: float, e: float, speed: float) -> float:
    """Tangential velocity lost where an impact slides throughout, mu (1 + e) v_n m*/m; m/s.

    The spin changes by 5/2 of it over R.
    """
    return mu * (1.0 + e) * speed * contact.mass / own_mass


# --- the law, integrated ------------------------------------------------------------------------


def damping_ratio(restitution: float) -> float:
    """z with -ln e = 2 z arccos(z) / sqrt(1 - z^2), for e above exp(-2).

    Tsuji's damping without tension: Schwager & Poeschel (2007) for an oscillator in d^(5/4).
    """
    if restitution == 1.0:
        return 0.0

    def surplus(z: float) -> float:
        return 2.0 * z * np.arccos(z) / np.sqrt(1.0 - z**2) + np.log(restitution)

    return brentq(surplus, 0.0, 1.0 - 1e-12, xtol=1e-15)


def rebound(
    contact: Contact,
    radius: np.ndarray,
    *,
    normal: np.ndarray,
    tangential: np.ndarray,
    spin: np.ndarray,
    friction: float,
    restitution: float,
    steps: int = 4000,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A sphere and something that does not move, by the classical Runge-Kutta method.

    Args:
      contact: the pair; its m* is the mass of the sphere.
      radius: of the sphere, m, (N,).
      normal, tangential: speeds of its centre towards the partner and along it, m/s, (N,).
      spin: rad/s, (N,).
      friction, restitution: of all.
      steps: in twice the duration of an elastic impact, after which the surfaces have parted.

    Returns:
      The same three after the impact; the normal speed away from the partner.
    """
    damping = damping_ratio(restitution)
    own = contact.mass
    moment = 0.4 * own * radius**2
    mindlin = 8.0 * contact.shear_modulus * np.sqrt(contact.radius)

    def forces(state: np.ndarray) -> tuple[np.ndarray, ...]:
        overlap, closing, along, spin, stretch = state
        depth = np.maximum(overlap, 0.0)
        spring, arm = mindlin * np.sqrt(depth), radius - 0.5 * depth
        viscous = damping * np.sqrt(5.0 * own * contact.stiffness) * depth**0.25 * closing
        push = np.maximum(contact.stiffness * depth**1.5 + viscous, 0.0)
        limit, slip = friction * push, along - arm * spin
        # The spring yields so that it bears no more than Coulomb's limit.
        longest = limit / np.where(spring > 0.0, spring, 1.0)
        stretch = np.clip(stretch, -longest, longest)
        borne = spring * stretch + damping * np.sqrt(10 / 3 * own * spring) * slip
        return push, -np.clip(borne, -limit, limit), arm, slip, stretch

    def rates(state: np.ndarray) -> np.ndarray:
        push, grip, arm, slip, _ = forces(state)
        return np.stack([state[1], -push / own, grip / own, -arm * grip / moment, slip])

    step = 2.0 * hertz_duration(contact, normal) / steps
    start = (np.zeros_like(normal), normal, tangential, spin, np.zeros_like(normal))
    state = np.stack(np.broadcast_arrays(*start)).astype(float)
    for _ in range(steps):
        first = rates(state)
        second = rates(state + 0.5 * step * first)
        third = rates(state + 0.5 * step * second)
        fourth = rates(state + step * third)
        state = state + step / 6.0 * (first + 2.0 * second + 2.0 * third + fourth)
        state[4] = forces(state)[4]
    if np.any(forces(state)[0] > 0.0):
        raise RuntimeError("the integration ends before the surfaces have parted")
    return -state[1], state[2], state[3]
