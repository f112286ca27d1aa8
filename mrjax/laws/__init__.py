"""The formulas of the model, one law in each module, with the numbers of their equations.

All are elementwise functions of `Parameters` or of arrays, in any coherent system of units: coated
particle, drag, contacts, time scales, closed forms, dimensionless numbers, water, yield stress.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=(
        "closed_forms",
        "dimensionless",
        "dipoles",
        "drag",
        "effective",
        "hindrance",
        "induced_moments",
        "magnetism",
        "normal",
        "particle",
        "rolling",
        "tangential",
        "time_scales",
        "vectors",
        "water",
        "yield_stress",
    ),
)
