"""Checks that the samples and parameters of an experiment are consistent."""

from collections.abc import Iterator
from pathlib import Path

from calibrate.experiment import plausibility
from calibrate.experiment.sample import Sample
from calibrate.experiment.sheets import ExperimentSheet, SampleSheet
from calibrate.experiment.suspension import BED, CLOSURE, COMPRESSION, SPREAD, TILT, refuse_unknown
from calibrate.experiment.units import VOLUME_UNITS
from mrjax import InputError
from mrjax.core.errors import shown


def refuse_parameters(sheet: ExperimentSheet, samples: tuple[Sample, ...], source: str) -> None:
    """Refuses parameters that a sample does not have, or has twice."""
    names_of: dict[str, list[str]] = {sample.name: [] for sample in samples}
    for parameter in sheet.parameter:
        for name in parameter.samples or names_of:
            names_of[name].append(parameter.name)
    recipes = {id(sample.recipe): sample.recipe for sample in samples}
    leaves = {key: recipe.parameters() for key, recipe in recipes.items()}
    for table, sample in zip(sheet.sample, samples, strict=True):
        _refuse_rotor(sample, names_of[sample.name], source)
        _refuse_tilt(table, sample, names_of[sample.name], source)
        _refuse_tube(sample, names_of[sample.name], source)
        for name in names_of[sample.name]:
            try:
                refuse_unknown(name, sample.recipe, leaves[id(sample.recipe)])
                _refuse_twice(name, sample, names_of[sample.name])
            except InputError as error:
                at = f"parameter.name = {shown(name)}: sample {shown(sample.name)}"
                raise InputError(f"{source}: {at}: {error}") from None


def _refuse_tube(sample: Sample, names: list[str], source: str) -> None:
    """Refuses a yielding bed that lacks a coefficient, and one or a delay in an ageing carrier."""
    given = {*names, *sample.tube}
    missing = [name for name in COMPRESSION if name not in given]
    named = f"{source}: sample {shown(sample.name)}"
    if missing and len(missing) < len(COMPRESSION):
        raise InputError(
            f"{named}: {missing[0]} is missing; state it in [sample.compression], or give it a "
            "[[parameter]]"
        )
    if not missing and sample.bed_fraction == "particles":
        raise InputError(
            f'{named}: bed_fraction = "particles" is that of a rigid bed; leave it or the '
            "compression out"
        )
    if sample.recipe.fluid.yield_growth is None:
        return
    for word, present in (("delay", "delay" in given), ("compression", not missing)):
        if present:
            raise InputError(
                f"{named}: a {word} and a yield stress that grows are not combined; leave one of "
                "them out"
            )


def _refuse_rotor(sample: Sample, names: list[str], source: str) -> None:
    """Refuses what is not combined with a rotor."""
    if sample.rotor is None:
        return
    given, fluid = {*names, *sample.tube}, sample.recipe.fluid
    rheology = fluid.yield_stress, fluid.flow_index, fluid.yield_growth
    not_newtonian = any(value is not None for value in rheology)
    excluded = {
        "a tilt": TILT in given,
        "a compression": bool(given.intersection(COMPRESSION)),
        "gravity as a parameter": "gravity" in given,
        "concentrations in its tube": bool(sample.points),
        "volumes of a sector tube (give heights)": sample.rotor.shape == "sector"
        and any(measurement.unit in VOLUME_UNITS for measurement in sample.measurements),
        'bed_fraction = "particles"': sample.bed_fraction == "particles",
        "particles of several sizes": SPREAD in given
        or not isinstance(sample.recipe.particle.diameter, float),
        "a carrier with a yield stress or a flow index": not_newtonian,
    }
    for words, present in excluded.items():
        if present:
            raise InputError(
                f"{source}: sample {shown(sample.name)}: a rotor and {words} are not combined; "
                "leave one of them out"
            )


def _refuse_tilt(sheet: SampleSheet, sample: Sample, names: list[str], source: str) -> None:
    """Refuses a tilt of a tube whose height or gap is not known."""
    if TILT not in {*names, *sample.tube}:
        return
    named = f"{source}: sample {shown(sample.name)}"
    if sample.gap is None:
        raise InputError(
            f"{named}: a tilt needs the gap of the tube; state gap in [sample.tube] in m, or the "
            "tube_diameter of a round one"
        )
    if sheet.height is None:
        raise InputError(
            f"{named}: height is missing; give that of the suspension along its tube in m, which a "
            "tilt needs"
        )


def _refuse_twice(name: str, sample: Sample, names: list[str]) -> None:
    """Refuses a quantity that another parameter, or the sample itself, sets as well."""
    if name == "f_w" and (clash := sorted(other for other in names if other.startswith(CLOSURE))):
        raise InputError(f"f_w follows from {clash[0]}; fit one of the two")
    if name == "f_w" and sample.velocities is not None:
        raise InputError(
            "would be the same at all concentrations of its velocities; fit a coefficient of the "
            "closure, such as f_w.exponent, or f_s"
        )
    if name in sample.tube:
        raise InputError(f"has {name} = {sample.tube[name]:g} of its own; take one of them away")
    if name == BED and sample.bed_fraction is not None:
        raise InputError(
            f"has bed_fraction = {sample.bed_fraction!r} of its own; take one of them away"
        )


def refuse_a_file_twice(sheet: ExperimentSheet, folder: Path, source: str) -> None:
    """Refuses one file of readings for two samples: they would count twice."""
    sample_of: dict[tuple, str] = {}
    for sample in sheet.sample:
        single = [(key, getattr(sample, key)) for key in ("curve", "velocities")]
        for key, table in [*single, *(("concentration", table) for table in sample.concentration)]:
            if table is None:
                continue
            columns = table.columns.model_dump_json()
            readings = ((folder / table.file).resolve(), table.sheet, columns)
            if readings in sample_of:
                raise InputError(
                    f"{source}: sample {sample.name!r}: {key}.file = {table.file!r} is that of "
                    f"sample {sample_of[readings]!r}, too, and its readings would count twice; "
                    "give each its own"
                )
            sample_of[readings] = sample.name


def odd_readings(sheet: ExperimentSheet, samples: tuple[Sample, ...], source: str) -> Iterator[str]:
    """Warnings about the curve of each sample."""
    for table, sample in zip(sheet.sample, samples, strict=True):
        if table.curve is not None:
            try:
                warnings = plausibility.refuse_senseless(sample)
            except InputError as error:
                raise InputError(f"{source}: sample {sample.name!r}: {error}") from None
            yield from (f"sample {sample.name!r}: {odd}" for odd in warnings)
