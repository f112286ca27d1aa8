"""Van der Waals attraction of two surfaces, in F_W of Eq. 1; see `mrjax.laws.attraction`."""

from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.parameters import Parameters
from mrjax.dem.forces.force import Memory, PairForce, Wrench
from mrjax.dem.kinematics import PairKinematics
from mrjax.laws import attraction, effective, particle
from mrjax.laws.effective import SurfacePairs
from mrjax.laws.vectors import times


class VanDerWaals(PairForce):
    """Attraction of surfaces, constant in contact and decreasing with the gap (DMT).

    Its coefficients are those of `Parameters`: `hamaker`, `layer_thickness`,
    `wall_layer_thickness` and `attraction_range`. `Contact` in the same list adds twice the
    pull-off force to the net normal force in the limits of friction and rolling resistance.
    """

    in_si = False

    def active(self, parameters: Parameters) -> "VanDerWaals":
        """Returns the force.

        Raises:
          InputError: the parameters have no Hamaker constant or no thickness of layers.
        """
        attraction.hamaker_constant(parameters)
        attraction.layer_thickness(parameters)
        return self

    def reach(self, parameters: Parameters) -> ArrayLike:
        """Gap at which the force ends, m: ten ranges of the pair with the longest range."""
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
        return {
            "pull_off": attraction.pull_off(parameters, surfaces),
            "range": attraction.attraction_range(parameters, surfaces),
        }

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
        """Attraction along the normal; it has no history."""
        force = attraction.attraction(pair.gap, coefficients["pull_off"], coefficients["range"])
        return Wrench(times(-force, pair.normal)), memory
