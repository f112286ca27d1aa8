"""The materials of the tests, and what sliding and sticking impacts are held to."""

from ..reference import Material

GLASS = Material(modulus=48e9, poisson=0.20, density=2800.0)
LIMESTONE = Material(modulus=20e9, poisson=0.25, density=2500.0)
ALUMINIUM = Material(modulus=70e9, poisson=0.30, density=2699.0)
MAGNESIUM = Material(modulus=40e9, poisson=0.35, density=1800.0)
ALUMINA = Material(modulus=380e9, poisson=0.23, density=4000.0)
CAST_IRON = Material(modulus=100e9, poisson=0.25, density=7000.0)
ALLOY = Material(modulus=70e9, poisson=0.33, density=2700.0)  # of aluminium
STEEL = Material(modulus=208e9, poisson=0.30, density=7850.0)
POLYETHYLENE = Material(modulus=1e9, poisson=0.40, density=1400.0)
NYLON = Material(modulus=2.5e9, poisson=0.40, density=1000.0)

SLIDING_BAR, STICKING_BAR = 1e-2, 5e-3
SLIDING = "closed form of gross sliding"
INTEGRATED = "the published law, integrated by Runge-Kutta"
