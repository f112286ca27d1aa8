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
from mrjax.dem.kinematics import PairKinematics
from mrjax.laws import attraction, effective, normal, particle
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
        attraction.hamaker_constant(parameters)
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
        """Pull-off force F_c and range eps of pairs.

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
        """Attraction along the normal, and the new history."""
        if self.law == "jkr":
            contact = coefficients["pull_off"], coefficients["modulus"], coefficients["radius"]
            neck = attraction.tear_off_gap(*contact)
            held = (pair.overlap > 0.0) | ((memory["touched"] > 0.0) & (pair.gap < neck))
            size = attraction.attraction_in_contact("jkr", pair.overlap, *contact)
            wrench = Wrench(times(-jnp.where(held, size, 0.0), pair.normal))
            return wrench, {"touched": jnp.where(held, 1.0, 0.0)}
        force = attraction.attraction(pair.gap, coefficients["pull_off"], coefficients["range"])
        return Wrench(times(-force, pair.normal)), memory


def _longest_neck(parameters: Parameters) -> Array:
    """Largest gap of tear-off, m: of two like particles, or of a particle and a wall."""
    between, at_wall = attraction.pull_off_of_like_particles(parameters)
    radius = particle.outer_radius(parameters)
    surface = parameters.elastic_modulus, parameters.poisson_ratio
    wall = parameters.wall_elastic_modulus, parameters.wall_poisson_ratio
    necks = (
        attraction.tear_off_gap(0.75 * force, normal.effective_modulus(*surface, *other), r)
        for force, other, r in ((between, surface, radius / 2.0), (at_wall, wall, radius))
    )
    return 1.001 * jnp.max(jnp.maximum(*necks))
