"""Notes on the magnetism of particles: their pull over weight and over heat, in words."""

import numpy as np

from mrjax.core.numpy_evaluation import evaluate_with_numpy
from mrjax.core.parameters import Parameters
from mrjax.laws import magnetism, particle

WEAK, STICKY = 0.1, 1.0
"""Magnetic Bond numbers below which magnetism does not matter, and from which it holds weights."""
COUPLED = 1.0
"""Dipolar coupling above which moments form chains against heat."""
SUITABLE = 500
"""Number of particles up to which all pairs of dipoles suit a run."""


def notes(parameters: Parameters, temperature: float, particles: int = 0) -> list[str]:
    """Returns notes on magnetic particles; none if nothing is magnetic.

    Args:
      parameters: particles and fluid, leaves () or (N,).
      temperature: temperature of the fluid, K.
      particles: number of particles in the box.
    """
    magnetisation = evaluate_with_numpy(magnetism.magnetisation, parameters)
    if not np.any(magnetisation):
        return []
    coupling = np.asarray(evaluate_with_numpy(magnetism.dipolar_coupling, parameters, temperature))
    chains = "chains form" if coupling.max() > COUPLED else "heat keeps chains from forming"
    words = [
        f"particles alone are magnetised to {_range(magnetisation)} A/m: the dipolar coupling "
        f"(magnetic energy of a touching pair over kT) is {_range(coupling)}, and {chains}"
    ]
    if np.any(evaluate_with_numpy(particle.net_weight, parameters)):
        bonds = np.asarray(evaluate_with_numpy(magnetism.magnetic_bond_number, parameters))
        largest = float(bonds.max())
        effect = "a touching pair holds together against its weight"
        if largest < STICKY:
            effect = "magnetism is weaker than gravity"
        if largest < WEAK:
            effect = "magnetism hardly matters beside gravity"
        words.append(
            "the magnetic Bond number (pull of two touching particles in line over net weight) is "
            f"{_range(bonds)}: {effect}"
        )
    if particles > SUITABLE:
        words.append(
            f"dipoles act on all pairs of {particles} particles, so that a step takes "
            f"{(particles / SUITABLE) ** 2:.3g} times as long as with {SUITABLE}; a smaller box "
            "is faster"
        )
    return words


def _range(numbers: np.ndarray) -> str:
    """Returns the least and the largest number in words."""
    least, largest = f"{np.min(numbers):.2g}", f"{np.max(numbers):.2g}"
    return least if least == largest else f"{least} to {largest}"
