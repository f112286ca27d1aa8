"""Physical bounds of the free parameters: the values that a lab sheet accepts.

They keep a quantity that the data leave open from values such as 1e43.
"""

from functools import cache
from typing import Any

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import BED, CLOSURE, LARGEST_TILT, SPREAD, TILT
from mrjax.laws import drag
from mrjax.laws.closures.carman_kozeny import SPARSEST_PACKING
from mrjax.recipe.plausibility import LARGEST_BOX
from mrjax.recipe.recipe import Recipe
from mrjax.recipe.sheets import LARGEST, SMALLEST, Sheet
from mrjax.recipe.tables import (
    LARGEST_FACTOR,
    LEAST_FACTOR,
    Attraction,
    Coating,
    Contact,
    Drag,
    Fluid,
    Magnetism,
    Particle,
)

OF_SHEET: dict[str, tuple[type[Sheet], str]] = {
    "particle_density": (Particle, "density"),
    "elastic_modulus": (Particle, "elastic_modulus"),
    "poisson_ratio": (Particle, "poisson_ratio"),
    "fluid_density": (Fluid, "density"),
    "viscosity": (Fluid, "viscosity"),
    "yield_stress": (Fluid, "yield_stress"),
    "flow_index": (Fluid, "flow_index"),
    "yield_growth": (Fluid, "yield_growth"),
    "coating_density": (Coating, "density"),
    "f_r": (Coating, "radius_factor"),
    "wall_elastic_modulus": (Particle, "elastic_modulus"),
    "wall_poisson_ratio": (Particle, "poisson_ratio"),
    **{key: (Contact, key) for key in Contact.model_fields},
    "hamaker": (Attraction, "hamaker"),
    "layer_thickness": (Attraction, "layer_thickness"),
    "wall_layer_thickness": (Attraction, "layer_thickness"),
    "attraction_range": (Attraction, "range"),
    "remanence": (Magnetism, "remanence"),
    "susceptibility": (Magnetism, "susceptibility"),
    "saturation": (Magnetism, "saturation"),
    "temperature": (Recipe, "temperature"),
    "added_mass": (Drag, "added_mass"),
    "gravity": (Recipe, "gravity"),
}
"""Table and entry of a lab sheet, by leaf of `mrjax.Parameters`."""
FACTORS = ("f_w", "f_s", "f_v")
FLOC_VOLUME = f"{CLOSURE}floc_volume"
TUBE_BOUNDS = {
    "compression.gel_fraction": (1e-5, 1.0),
    "compression.stress": (1e-6, 1e9),
    "compression.exponent": (0.1, 100.0),
    "delay": (1e-3, 1e9),
    TILT: (1e-3, LARGEST_TILT),
    SPREAD: (1.0, 10.0),
}
"""Bounds of the quantities of a tube, and of the spread of sizes, in SI."""
DENSER = 1e-3
"""Least relative excess of the volume fraction of a bed over that of its suspension."""
NEAREST = 1e-9
"""Least distance of a value to its bounds, over the distance between them."""


def bounds(experiment: Experiment, parameter: FreeParameter) -> tuple[float, float]:
    """Smallest and largest x of a fitted quantity."""
    lower, upper = _value_bounds(experiment, parameter)
    if not parameter.bounds:
        return lower, upper
    return _odds(parameter, lower), _odds(parameter, upper)


def _odds(parameter: FreeParameter, value: float) -> float:
    """The odds of a value, or of the nearest one between the bounds."""
    lower, upper = parameter.bounds or (0.0, 1.0)
    share = (value - lower) / (upper - lower)
    share = min(max(share, NEAREST), 1.0 - NEAREST)
    return share / (1.0 - share)


def _value_bounds(experiment: Experiment, parameter: FreeParameter) -> tuple[float, float]:
    if parameter.name == BED:
        thickest = max(
            sample.recipe.coated_volume_fraction
            for sample in experiment.samples
            if sample.name in parameter.samples
        )
        return (1.0 + DENSER) * float(thickest), 1.0
    if parameter.name in TUBE_BOUNDS:
        return TUBE_BOUNDS[parameter.name]
    if parameter.name == FLOC_VOLUME:
        return _floc_volume_bounds(
            [sample for sample in experiment.samples if sample.name in parameter.samples]
        )
    if parameter.name in FACTORS or parameter.name.startswith(CLOSURE):
        return LEAST_FACTOR, LARGEST_FACTOR
    if parameter.name in OF_SHEET:
        return _entry_bounds(*OF_SHEET[parameter.name])
    return SMALLEST, LARGEST_BOX if parameter.name == "radius" else LARGEST


def _floc_volume_bounds(samples: list[Sample]) -> tuple[float, float]:
    """Volumes of flocs over volumes of solids at which the closure holds in all samples.

    With local drag it holds up to a bed of known volume fraction.
    """
    fractions = [
        fraction * sample.recipe.radius_factor**3
        for sample in samples
        for fraction in (sample.recipe.volume_fraction, *sample.fractions)
    ]
    beds = [
        sample.bed_fraction
        for sample in samples
        if sample.recipe.drag.local and isinstance(sample.bed_fraction, float)
    ]
    networks = any(
        sample.recipe.closure is not None and sample.recipe.closure.func is drag.rigid_network
        for sample in samples
    )
    least = SPARSEST_PACKING / min(fractions) if networks else 1.0
    return max(1.0, (1.0 + DENSER) * least), (1.0 - DENSER) / max(fractions + beds)


@cache
def _entry_bounds(sheet: type[Sheet], entry: str) -> tuple[float, float]:
    """Bounds of a positive number in a lab sheet."""

    def rule_or(names: tuple[str, ...], otherwise: float) -> float:
        for rule in sheet.model_fields[entry].metadata:
            for name in names:
                value: Any = getattr(rule, name, None)
                if value is not None:
                    return float(value)
        return otherwise

    return max(SMALLEST, rule_or(("ge", "gt"), SMALLEST)), rule_or(("le", "lt"), LARGEST)
