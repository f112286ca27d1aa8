"""Effects that a plain column leaves out, each as a change of an experiment.

An effect that the experiment's file has keeps its parameters and priors from there. Any other gets
the wide priors of this file.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.sample import Sample
from calibrate.experiment.suspension import BED, COMPRESSION, SPREAD
from mrjax import Parameters, Recipe
from mrjax.laws import particle
from mrjax.laws.closures.brzinski_durian import brzinski_durian
from mrjax.laws.closures.floc_richardson_zaki import floc_richardson_zaki
from mrjax.laws.closures.richardson_zaki import richardson_zaki

FLOC_VOLUME = "f_w.floc_volume"
DELAY = "delay"
MOST_FILLED = 0.9
"""Largest share of a bed that flocs fill where the search begins."""
WIDE = 2.0
"""Standard deviation of the logarithm of a value of which nothing is known: a factor of 7."""


class Effect(NamedTuple):
    """An effect beyond the plain column."""

    name: str
    """Name in tables and results."""
    quantities: tuple[str, ...]
    """Quantities of a suspension that only this effect has."""
    apply: Callable[[Experiment], Experiment]
    """Function that gives an experiment the effect, with the wide priors of this file."""
    remark: str
    """Sentence that says what the effect is."""
    hardly: float | None = None
    """Value of its one quantity at which the effect hardly acts; None if there is none."""


def plain(experiment: Experiment) -> Experiment:
    """The experiment without any effect: equal hard spheres that settle onto a rigid bed."""
    names = {name for effect in EFFECTS for name in effect.quantities}
    if _yields(experiment):
        experiment = _without_bed(experiment)  # what its file states is the densest that it can be
    samples = tuple(_plain_sample(sample, names) for sample in experiment.samples)
    bare = replace(
        experiment,
        samples=samples,
        parameters=tuple(one for one in experiment.parameters if one.name not in names),
        held=tuple(one for one in experiment.held if one[1] not in names),
    )
    without_bed = [
        sample
        for sample in samples
        if sample.bed_fraction is None and not _varies(bare, sample, BED)
    ]
    return replace(bare, parameters=(*bare.parameters, *map(_rigid_bed, without_bed)))


def with_effects(experiment: Experiment, effects: Iterable[Effect]) -> Experiment:
    """The plain experiment with some effects; their order does not matter.

    Args:
      experiment: the experiment as its file has it.
      effects: effects, which can be combined.
    """
    changed = plain(experiment)
    for effect in sorted(effects, key=EFFECTS.index):
        stated = _restored(changed, experiment, effect)
        changed = effect.apply(changed) if stated is None else stated
    return changed


def refusal(experiment: Experiment, effect: Effect) -> str | None:
    """The reason why an effect cannot be tried on an experiment; None if it can."""
    if effect is FLOCS:
        for sample in experiment.samples:
            closure = sample.recipe.closure
            if closure is None or not sample.recipe.drag.local:
                return (
                    f"f_w of sample {sample.name} is not local; give it a closure of [drag] f_w, "
                    "with local = true"
                )
            if closure.func not in (richardson_zaki, brzinski_durian, floc_richardson_zaki):
                return (
                    f"the closure of sample {sample.name} has no flocs as a further step; give "
                    '[drag] f_w = {closure = "richardson-zaki"}'
                )
    if effect in (SIZES, YIELDING_BED) and any(
        sample.rotor is not None for sample in experiment.samples
    ):
        return "a tube in a rotor has one size and a rigid bed"
    if effect is SIZES and any(sample.recipe.fluid.yield_growth for sample in experiment.samples):
        return "classes of several sizes do not settle in an ageing carrier"
    if effect in (YIELDING_BED, DELAY_AT_START) and any(
        sample.recipe.fluid.yield_growth is not None for sample in experiment.samples
    ):
        return "it is not combined with a yield stress that grows"
    return None


def combine(effects: Iterable[Effect]) -> bool:
    """True if effects can act together: several sizes have no yielding bed."""
    return not {SIZES.name, YIELDING_BED.name} <= {effect.name for effect in effects}


def _plain_sample(sample: Sample, names: set[str]) -> Sample:
    tube = {name: value for name, value in sample.tube.items() if name not in names}
    return replace(sample, tube=tube, recipe=_of_one_size(_without_flocs(sample.recipe)))


def _has_flocs(recipe: Recipe) -> bool:
    return recipe.closure is not None and recipe.closure.func is floc_richardson_zaki


def _without_flocs(recipe: Recipe) -> Recipe:
    if recipe.closure is None or not _has_flocs(recipe):
        return recipe
    stated = recipe.closure.keywords
    exponent = {name: value for name, value in stated.items() if name == "exponent"}
    return recipe.replace(drag={"f_w": {"closure": "richardson-zaki", **exponent}})


def _of_one_size(recipe: Recipe) -> Recipe:
    diameter = recipe.particle.diameter
    if isinstance(diameter, float):
        return recipe
    return recipe.replace(particle={"diameter": float(diameter.settling_diameter)})


def _yields(experiment: Experiment) -> bool:
    """True if the bed of a sample yields in the file of the experiment."""
    return any(
        name in sample.tube or _varies(experiment, sample, name)
        for sample in experiment.samples
        for name in COMPRESSION
    )


def _restored(changed: Experiment, stated: Experiment, effect: Effect) -> Experiment | None:
    """The effect as the file of the experiment has it; None if it does not have it."""
    names = effect.quantities
    sample_of = {sample.name: sample for sample in stated.samples}
    samples = []
    has_it = False
    if effect is YIELDING_BED and _yields(stated):
        names = (*names, BED)
        changed = _without_bed(changed)
    for sample in changed.samples:
        original = sample_of[sample.name]
        recipe = sample.recipe
        if effect is FLOCS and _has_flocs(original.recipe):
            recipe = recipe.replace(drag={"f_w": original.recipe.drag.f_w})
            has_it = True
        if effect is SIZES and not isinstance(original.recipe.particle.diameter, float):
            recipe = recipe.replace(particle={"diameter": original.recipe.particle.diameter})
            has_it = True
        own = {name: value for name, value in original.tube.items() if name in names}
        bed = original.bed_fraction if BED in names else sample.bed_fraction
        tube = {**sample.tube, **own}
        samples.append(replace(sample, recipe=recipe, tube=tube, bed_fraction=bed))
        has_it = has_it or bool(own)
    parameters = tuple(one for one in stated.parameters if one.name in names)
    held = tuple(one for one in stated.held if one[1] in names)
    if not (has_it or parameters or held):
        return None
    return replace(
        changed,
        samples=tuple(samples),
        parameters=(*changed.parameters, *parameters),
        held=(*changed.held, *held),
    )


def _varies(experiment: Experiment, sample: Sample, name: str) -> bool:
    held = any(one == sample.name and quantity == name for one, quantity, _ in experiment.held)
    return held or name in experiment.varied(sample)


def _rigid_bed(sample: Sample) -> FreeParameter:
    """A volume fraction of the bed to be fitted, from that of the last reading."""
    return _free(f"{BED}[{sample.name}]", BED, (sample.name,), _last_fraction(sample), 0.5)


def _free(
    label: str, name: str, samples: tuple[str, ...], median: float, spread: float
) -> FreeParameter:
    return FreeParameter(label, name, samples, median, spread)


def _names(experiment: Experiment) -> tuple[str, ...]:
    return tuple(sample.name for sample in experiment.samples)


def _with(experiment: Experiment, *parameters: FreeParameter) -> Experiment:
    return replace(experiment, parameters=(*experiment.parameters, *parameters))


def _fallen(sample: Sample) -> tuple[np.ndarray, np.ndarray]:
    """Times, s, and heights of the mudline over that of the suspension, (T,) each."""
    readings = sample.readings_of_curve
    scale = 1.0 if readings[0].observable == "sedimentation_ratio" else sample.height
    times = np.array([sample.times[reading.place or 0] for reading in readings])
    ratios = np.array([reading.value * reading.si / scale for reading in readings])
    return times, ratios


def _last_fraction(sample: Sample) -> float:
    """Mean volume fraction below the lowest reading."""
    fraction = float(sample.recipe.coated_volume_fraction)
    if not sample.readings_of_curve:
        return min(1.5 * fraction, 0.5 * (1.0 + fraction))
    lowest = float(_fallen(sample)[1].min())
    return float(np.clip(fraction / max(lowest, 1e-3), 1.01 * fraction, 0.74))


def _with_flocs(experiment: Experiment) -> Experiment:
    samples = []
    for sample in experiment.samples:
        closure = sample.recipe.closure
        assert closure is not None
        flocs = {"closure": "floc-richardson-zaki", "floc_volume": 1.0, **closure.keywords}
        samples.append(replace(sample, recipe=sample.recipe.replace(drag={"f_w": flocs})))
    with_closure = replace(experiment, samples=tuple(samples))
    # Flocs fill a bed at 1 / C, and the closure must hold in the bed where the search begins.
    densest = max(_densest(with_closure, sample) for sample in samples)
    median = min(4.0, densest**-0.5, MOST_FILLED / densest)
    return _with(with_closure, _free(FLOC_VOLUME, FLOC_VOLUME, _names(experiment), median, WIDE))


def _densest(experiment: Experiment, sample: Sample) -> float:
    """Volume fraction of the bed where the search begins, or of the suspension without a bed."""
    bed = experiment.suspension_of(sample, experiment.start).bed_fraction
    fraction = float(sample.recipe.coated_volume_fraction)
    return fraction if bed is None else max(fraction, float(bed))


def _with_yielding_bed(experiment: Experiment) -> Experiment:
    fractions = [float(sample.recipe.coated_volume_fraction) for sample in experiment.samples]
    beds = [_last_fraction(sample) for sample in experiment.samples]
    weights = [
        _weight(sample.recipe.parameters(), fraction, sample.height)
        for sample, fraction in zip(experiment.samples, fractions, strict=True)
    ]
    medians = (
        float(np.sqrt(np.mean(fractions) * np.mean(beds))),
        float(np.exp(np.mean(np.log(weights)))) / 3.0,
        3.0,
    )
    parameters = (
        _free(name, name, _names(experiment), median, spread)
        for name, median, spread in zip(COMPRESSION, medians, (0.7, WIDE, 0.5), strict=True)
    )
    return _without_bed(_with(experiment, *parameters))


def _without_bed(experiment: Experiment) -> Experiment:
    """The experiment without stated, fitted, held or simulated volume fractions of beds."""
    return replace(
        experiment,
        samples=tuple(replace(sample, bed_fraction=None) for sample in experiment.samples),
        parameters=tuple(one for one in experiment.parameters if one.name != BED),
        held=tuple(one for one in experiment.held if one[1] != BED),
    )


def _weight(parameters: Parameters, fraction: float, height: float) -> float:
    """Net weight of all particles on the floor, Pa."""
    return abs(float(np.mean(particle.net_weight_density(parameters)))) * fraction * height


def _with_delay(experiment: Experiment) -> Experiment:
    halfway = []
    for sample in experiment.samples:
        if sample.readings_of_curve:
            times, ratios = _fallen(sample)
            half = 0.5 * (1.0 + ratios.min())
            below = times[(ratios <= half) & (times > 0.0)]
            halfway.append(float(below.min()) if below.size else float(times.max()))
    median = 0.1 * float(np.mean(halfway))
    return _with(experiment, _free(DELAY, DELAY, _names(experiment), median, WIDE))


def _with_sizes(experiment: Experiment) -> Experiment:
    # Bounds alone: the spread of a powder is seldom above three.
    spread = FreeParameter(SPREAD, SPREAD, _names(experiment), 1.3, None, bounds=(1.0, 3.0))
    return _with(experiment, spread)


FLOCS = Effect(
    "flocs",
    (FLOC_VOLUME,),
    _with_flocs,
    "the volume that settles is that of flocs with liquid",
    1.05,
)
YIELDING_BED = Effect(
    "yielding bed", COMPRESSION, _with_yielding_bed, "the bed yields under its own weight"
)
DELAY_AT_START = Effect(
    "delay",
    (DELAY,),
    _with_delay,
    "aggregates form first, and settle slowly at the start",
    1.0,
)
SIZES = Effect(
    "sizes",
    (SPREAD,),
    _with_sizes,
    "particles of several sizes settle apart",
    1.05,
)
EFFECTS = (FLOCS, YIELDING_BED, DELAY_AT_START, SIZES)
"""All effects."""
