"""Van der Waals attraction of two surfaces, in F_W of Eq. 1; see `mrjax.laws.attraction`."""

from dataclasses import field
from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.dem.contact_history import Remembered
from mrjax.dem.forces.force import Memory, PairForce, Wrench
from mrjax.dem.kinematics import PairKinematics, share_in_contact
from mrjax.laws import attraction, effective, particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.vectors import times

LAWS = ("dmt", "jkr")


class VanDerWaals(PairForce):
    """Attraction of surfaces, by default constant in contact and decreasing with the gap (DMT).

    Its coefficients are those of `Parameters`: `hamaker`, `layer_thickness`,
    `wall_layer_thickness` and `attraction_range`. `Contact` in the same list adds twice the
    pull-off force to the net normal force in the limits of friction and rolling resistance.

    `VanDerWaals(law="jkr")` is for soft surfaces. The contact history knows whether a pair has
    touched, since its neck holds until it tears. There is no friction at a neck without overlap.

    The reach fixes the neighbour list, so that `jit` and `vmap` may not trace what it depends on:
    radii, and for DMT `attraction_range`, or the layers without one; for JKR the Hamaker constant,
    the layers and the elastic constants. Derivatives do not hold where a pair parts at which the
    force jumps: with JKR, or with a range of 0.
    """

    law: str = field(default="dmt", metadata={"static": True})
    """`dmt` for hard surfaces, `jkr` for soft ones."""

    in_si = False

    def active(self, parameters: Parameters) -> "VanDerWaals":
        """Returns the force.

        Raises:
          InputError: the law is unknown, or the Hamaker constant or the layers are missing.
        """
        if self.law not in LAWS:
            raise InputError(f"law = {shown(self.law)}: give {' or '.join(map(repr, LAWS))}")
        attraction.refuse_without_hamaker_constant(parameters)
        attraction.layer_thickness(parameters)
        return self

    def reach(self, parameters: Parameters) -> ArrayLike:
        """Gap at which the force ends, m: ten ranges (DMT), or that of tear-off (JKR)."""
        if self.law == "jkr":
            return _longest_neck(parameters)
        if parameters.attraction_range is not None:
            longest = jnp.max(parameters.attraction_range)
            return attraction.CUT_OFF * longest * jnp.max(particle.outer_radius(parameters))
        layer, wall = attraction.layer_thickness(parameters), parameters.wall_layer_thickness
        thickest = jnp.max(layer)
        partner = thickest if wall is None else jnp.maximum(thickest, wall)
        return attraction.CUT_OFF * (thickest + partner)

    def coefficients(self, parameters: Parameters, surfaces: SurfacePairs) -> dict[str, Array]:
        """Pull-off force F_c of pairs with their range eps (DMT), or with E* and R* (JKR).

        Args:
          parameters: parameters of the run.
          surfaces: surfaces of the pairs.
        """
        pull_off = attraction.pull_off(parameters, surfaces, self.law)
        if self.law == "jkr":
            contact = effective.of_surfaces(parameters, surfaces)
            return {"pull_off": pull_off, "modulus": contact.modulus, "radius": contact.radius}
        return {"pull_off": pull_off, "range": attraction.attraction_range(parameters, surfaces)}

    def memory(self) -> dict[str, Remembered]:
        """For JKR, `touched` is 1 for a pair that has touched and has not been torn apart since."""
        return {"touched": Remembered(1, "1")} if self.law == "jkr" else {}

    def alike(self, parameters: Parameters, material: Array | None) -> bool:
        """True if all particles have the same material, size and layer.

        Args:
          parameters: parameters of the run.
          material: material index of each particle, (N,); None if all have the same material.
        """
        layer = attraction.layer_thickness(parameters)
        return effective.alike(parameters, material) and not layer.ndim

    def __call__(
        self, pair: PairKinematics, coefficients: Any, memory: Memory, time_step: ArrayLike
    ) -> tuple[Wrench, Memory]:
        """Attraction along the normal, and the new history.

        A force that begins at first touch acts for the share of the step since then. Otherwise it
        would not depend on the moment of touch, and derivatives would lack a contribution.
        """
        first = share_in_contact(pair, time_step)
        if self.law == "jkr":
            contact = coefficients["pull_off"], coefficients["modulus"], coefficients["radius"]
            neck = attraction.tear_off_gap(*contact)
            old = memory["touched"] > 0.0
            bound = (pair.overlap > 0.0) | (old & (pair.gap < neck))
            size = attraction.attraction_in_contact("jkr", pair.overlap, *contact)
            share = jnp.where(old, 1.0, first)
            wrench = Wrench(times(-jnp.where(bound, share * size, 0.0), pair.normal))
            return wrench, {"touched": jnp.where(bound, 1.0, 0.0)}
        force = attraction.attraction(pair.gap, coefficients["pull_off"], coefficients["range"])
        share = jnp.where(coefficients["range"] > 0.0, 1.0, first)
        return Wrench(times(-share * force, pair.normal)), memory


def _longest_neck(parameters: Parameters) -> Array:
    """Upper bound on the gap of tear-off of two particles, or of a particle and a wall; m.

    Unlike surfaces may touch, so that each factor is the largest of its own.
    """
    compliance = jnp.max((1.0 - parameters.poisson_ratio**2) / parameters.elastic_modulus)
    wall = (1.0 - parameters.wall_poisson_ratio**2) / parameters.wall_elastic_modulus
    radius = jnp.max(particle.outer_radius(parameters))
    forces = attraction.largest_pull_off(parameters, "jkr")
    necks = (
        attraction.tear_off_gap(force, 1.0 / (compliance + other), r)
        for force, other, r in zip(
            forces, (compliance, jnp.max(wall)), (radius / 2.0, radius), strict=True
        )
    )
    return 1.001 * jnp.maximum(*necks)
