"""An experiment: samples that were measured, and the parameters that are fitted to them."""

import math
from collections import Counter, OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from jax.typing import ArrayLike

from calibrate.experiment import plausibility
from calibrate.experiment.consistency import odd_readings, refuse_a_file_twice, refuse_parameters
from calibrate.experiment.free_parameters import FreeParameter, free_parameters
from calibrate.experiment.readings.understood import FileUnderstood
from calibrate.experiment.sample import Measurement as Measurement
from calibrate.experiment.sample import Sample
from calibrate.experiment.sample_reading import read_sample
from calibrate.experiment.sheets import ExperimentSheet
from calibrate.experiment.suspension import Suspension, suspension
from mrjax import Recipe
from mrjax.recipe import sheets


@dataclass(frozen=True)
class Experiment:
    """Samples, and the parameters that are fitted to them."""

    name: str
    """Name, as in its file."""
    samples: tuple[Sample, ...]
    """Samples that were measured."""
    parameters: tuple[FreeParameter, ...]
    """Free parameters, in the order of the values of a fit."""
    held: tuple[tuple[str, str, float], ...] = ()
    """Sample, name and value of each quantity that is held at another value than in the recipe."""
    warnings: tuple[str, ...] = ()
    """Warnings about odd readings, which may still be right."""

    @classmethod
    def load(cls, source: str | Path) -> "Experiment":
        """Loads a bundled experiment by name (`fang2005`), or a TOML file by path.

        Raises:
          InputError: the file, a value in it, a recipe or a curve cannot be used, or readings are
            impossible in their tube.

        Example:
          >>> experiment = calibrate.Experiment.load("fang2005")
          >>> [parameter.label for parameter in experiment.parameters]
          ['f_w', 'f_s', 'f_v', 'bed_fraction[A]', 'bed_fraction[B]']
        """
        table, path = sheets.read(source, "calibrate.experiment.bundled", "experiment")
        sheet = sheets.validated(ExperimentSheet, table, str(source))
        recipes: dict[Path, Recipe] = {}
        samples = tuple(
            read_sample(sample, path.parent, str(source), recipes) for sample in sheet.sample
        )
        refuse_a_file_twice(sheet, path.parent, str(source))
        warnings = tuple(odd_readings(sheet, samples, str(source)))
        names = [sample.name for sample in samples]
        count_of = Counter(parameter.name for parameter in sheet.parameter)
        refuse_parameters(sheet, samples, str(source))
        experiment = cls(
            sheet.name,
            samples,
            tuple(
                free
                for parameter in sheet.parameter
                if parameter.value is None
                for free in free_parameters(parameter, names, once=count_of[parameter.name] == 1)
            ),
            tuple(
                (name, parameter.name, parameter.value)
                for parameter in sheet.parameter
                if parameter.value is not None
                for name in parameter.samples or names
            ),
        )
        suspensions = (experiment.suspension_of(sample, experiment.medians) for sample in samples)
        oddities = plausibility.oddities(samples, suspensions)
        return replace(experiment, warnings=(*warnings, *oddities))

    @property
    def start(self) -> OrderedDict[str, float]:
        """Start of the search, by variable: the medians, unless stated otherwise."""
        return OrderedDict((parameter.variable, parameter.start) for parameter in self.parameters)

    @property
    def data_as_understood(self) -> dict[str, FileUnderstood]:
        """Records of how files were read, by sample.

        The tables of sample A have keys such as `A, velocities` and
        `A, concentration at height 0.05 m`.
        """
        files: dict[str, FileUnderstood] = {}
        for sample in self.samples:
            if sample.curve is not None:
                files[sample.name] = sample.curve
            if sample.velocities is not None:
                files[f"{sample.name}, velocities"] = sample.velocities
            for table in sample.concentrations:
                files[f"{sample.name}, {table.name}"] = table.understood
        return files

    @property
    def errors(self) -> str:
        """`stated`, or `estimated` if the errors of any file are."""
        all_stated = all(file.errors == "stated" for file in self.data_as_understood.values())
        return "stated" if all_stated else "estimated"

    @property
    def scatter_freedom(self) -> float:
        """Least degrees of freedom of an estimated scatter; infinite without one."""
        scatters = [scatter for sample in self.samples for scatter in sample.scatters]
        return min(
            (scatter.degrees_of_freedom or math.inf for scatter in scatters), default=math.inf
        )

    @property
    def medians(self) -> OrderedDict[str, float]:
        """Medians of the priors, by variable."""
        return OrderedDict((parameter.variable, parameter.middle) for parameter in self.parameters)

    def by_sample(self) -> Iterator[tuple[Sample, slice]]:
        """Each sample, with the slice of its measurements among all of them."""
        first = 0
        for sample in self.samples:
            yield sample, slice(first, first + len(sample.measurements))
            first += len(sample.measurements)

    def varied(self, sample: Sample) -> tuple[str, ...]:
        """Names of the fitted quantities of a sample."""
        return tuple(
            parameter.name for parameter in self.parameters if sample.name in parameter.samples
        )

    def suspension_of(self, sample: Sample, theta: Mapping[str, ArrayLike]) -> Suspension:
        """The suspension of a sample, with the held and the fitted values.

        Args:
          sample: a sample of the experiment, or one that shares its parameters.
          theta: the fitted values, by variable.
        """
        held = {quantity: value for name, quantity, value in self.held if name == sample.name}
        changes = {
            parameter.name: parameter.value(theta[parameter.variable])
            for parameter in self.parameters
            if sample.name in parameter.samples
        }
        if sample.rotor is not None:
            changes["gravity"] = sample.rotor.floor_acceleration
        bed = None if sample.bed_fraction == "particles" else sample.bed_fraction
        return suspension(sample.recipe, bed, {**sample.tube, **held, **changes})
