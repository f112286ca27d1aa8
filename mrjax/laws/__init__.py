"""The formulas of the model, one law a module, each named by its equation.

Functions of `Parameters` or of plain arrays, elementwise, in any coherent system of units: the
coated particle, drag, contacts, time scales, closed forms, dimensionless numbers, water.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=(
        "closed_forms",
        "dimensionless",
        "drag",
        "effective",
        "hindrance",
        "normal",
        "particle",
        "rolling",
        "tangential",
        "time_scales",
        "vectors",
        "water",
    ),
)
