"""Notes on a carrier with a yield stress: it may hold particles, the suspension, or both."""

import numpy as np

from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.laws import closed_forms, particle, yield_stress

USUAL_TUBE = 0.02
"""Diameter of a laboratory's tube, m, for the threshold of its wall if the tube is not known."""


def notes(
    parameters: Parameters, volume_fraction: float, tube_diameter: float | None = None
) -> list[str]:
    """Returns notes on the parts that a yield stress holds, and on the distance to each threshold.

    The list is empty for a carrier without a yield stress, and without gravity.

    Args:
      parameters: particles and fluid, leaves () or (N,).
      volume_fraction: of the coated particles; 1.
      tube_diameter: inner diameter of the tube, m; None if it is not known.
    """
    stress = float(parameters.yield_stress or 0.0)
    if stress == 0.0 and not parameters.yield_growth:
        return []
    critical = np.ravel(evaluate_with_numpy(yield_stress.critical_yield_stress, parameters))
    if not critical.max():
        return []  # nothing pulls the particles
    diameter = tube_diameter or USUAL_TUBE
    plug = float(
        np.max(
            evaluate_with_numpy(
                yield_stress.plug_yield_stress, parameters, volume_fraction, diameter
            )
        )
    )
    lines = [_of_particles(parameters, stress, critical), _of_the_wall(stress, plug, tube_diameter)]
    if stress >= max(critical.max(), plug):
        lines.append(f"nothing moves in a tube of {1e3 * diameter:.3g} mm")
    return lines + _of_age(parameters, stress, critical.max())


def _of_particles(parameters: Parameters, stress: float, critical: np.ndarray) -> str:
    """A note on single particles, which move or stand still."""
    diameter = 2e6 * np.ravel(particle.outer_radius(parameters))
    largest, least = float(critical.max()), float(critical.min())
    if stress >= largest:
        subject = "particles" if diameter.size == 1 else "even the largest particles"
        return (
            f"{subject} of {diameter.max():.3g} um stand still: the yield stress, {stress:.3g} Pa, "
            f"is {stress / largest:.3g} times the {largest:.3g} Pa that hold a single one"
        )
    factor = np.ravel(evaluate_with_numpy(yield_stress.velocity_factor, parameters)).max()
    if stress >= least:
        limit = float(diameter.max()) * stress / largest
        return (
            f"particles of less than {limit:.3g} um stand still in the yield stress of "
            f"{stress:.3g} Pa; the largest, of {diameter.max():.3g} um, move, and stop at "
            f"{largest:.3g} Pa"
        )
    speed = float(np.mean(evaluate_with_numpy(closed_forms.terminal_velocity, parameters)))
    return (
        f"single particles move, at {abs(speed):.3g} m/s, {factor:.2g} of their velocity in a "
        f"Newtonian carrier: the yield stress, {stress:.3g} Pa, is {stress / least:.2g} of the "
        f"{least:.3g} Pa that hold {'one' if diameter.size == 1 else 'the smallest'}"
    )


def _of_the_wall(stress: float, plug: float, tube_diameter: float | None) -> str:
    """A note on the suspension as a plug, which slides along the wall or is held."""
    tube = tube_diameter or USUAL_TUBE
    holds = stress >= plug
    widest = tube * stress / plug if plug else np.inf
    compared = f"{stress / plug:.3g} of" if not holds else f"{stress / plug:.3g} times"
    known = "" if tube_diameter else ", the usual one,"
    return (
        f"as a plug the suspension {'is held by' if holds else 'can slide along'} the wall of a "
        f"tube of {1e3 * tube:.3g} mm{known} whose threshold is {plug:.3g} Pa: the yield stress is "
        f"{compared} it; the wall holds it in tubes of up to {1e3 * widest:.3g} mm"
    )


def _of_age(parameters: Parameters, stress: float, largest: float) -> list[str]:
    """A note on the time at which an ageing carrier stops the last particles."""
    growth = 0.0 if parameters.yield_growth is None else float(parameters.yield_growth)
    if growth == 0.0 or stress >= largest:
        return []
    return [
        f"the yield stress grows by {growth:.3g} Pa/s and stops the last particles after "
        f"{(largest - stress) / growth:.3g} s"
    ]
