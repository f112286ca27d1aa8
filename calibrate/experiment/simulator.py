"""A user's own simulator: a function from parameters to predictions, and the readings."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from calibrate.experiment.experiment import Experiment
from calibrate.experiment.free_parameters import FreeParameter, PriorSheet, free_parameter
from calibrate.experiment.sample import Measurement, Scatter
from calibrate.least_squares.priors import LogNormal
from mrjax import InputError
from mrjax.core.errors import shown
from mrjax.recipe import sheets
from mrjax.recipe.sheets import Name

ParameterTable = Mapping[str, Any] | LogNormal | float
"""A parameter: a table with the keys of `[[parameter]]`, a prior, or a start if it has no prior."""

BEFORE_THE_FIT = 0.1
"""First guess of a scatter that the fit estimates, over the standard deviation of the readings."""


class SimulatorParameter(PriorSheet):
    """A parameter of a simulator; with bounds it may have either sign."""

    name: Name = Field(description="a name, such as viscosity")
    value: float | None = Field(default=None, description="the value it is held at")
    median: float | None = Field(default=None, description="the prior's median")
    start: float | None = Field(default=None, description="where the search begins, or leave out")

    @model_validator(mode="after")
    def _positive(self) -> Self:
        for key in ("median", "start"):
            value = getattr(self, key)
            if self.bounds is None and value is not None and not value > 0.0:
                raise ValueError(
                    f"parameter {shown(self.name)}: {key} = {value:g}: must be above zero, or give "
                    "bounds, between which a value may have either sign"
                )
        return self


@dataclass(frozen=True)
class Simulator:
    """A function from parameters to predictions, with the readings that it is fitted to.

    With `at`, figures show the readings along an axis; `labels` name them one by one.

    Example:
      >>> simulator = calibrate.Simulator(
      ...     lambda theta: theta["slope"] * np.array([1.0, 2.0, 4.0]),
      ...     readings=[6.1, 12.0, 23.9],
      ...     errors=0.1,
      ...     parameters={"slope": 1.0},
      ... )
      >>> calibration = calibrate.run(simulator)
      >>> calibration.fit.converged, calibration.fit.values.round(3)
      (True, array([5.986]))
    """

    predict: Callable[[dict[str, Any]], ArrayLike]
    """Function from values by name to predictions, (M,): of JAX, of numpy, or one that calls
    another program."""
    readings: ArrayLike
    """Measured values, (M,)."""
    parameters: Mapping[str, ParameterTable]
    """Parameters by name: a table with the keys of `[[parameter]]` (median,
    log_standard_deviation, start, value, or bounds and standard_deviation), a
    `calibrate.LogNormal`, or a number where the search begins without a prior. Positive, unless
    they have bounds."""
    errors: ArrayLike | None = None
    """Standard deviations of the readings, one number or (M,); None to estimate one scatter."""
    name: str = "simulator"
    """Name in the report."""
    quantity: str = "reading"
    """Name of the measured quantity."""
    unit: str = "1"
    """Unit of the readings and of the predictions."""
    at: ArrayLike | None = None
    """Position or time of each reading, (M,)."""
    axis: str = ""
    """Name and unit of `at`, such as "time, s"."""
    labels: Sequence[str] | None = None
    """A name for each reading, in place of `at`."""
    differentiable: bool | None = None
    """True for a function that JAX traces, False for one whose slopes are finite differences; None
    to try which it is."""
    step: float | None = None
    """Step of finite differences in the logarithm; None to choose it at the start of a fit."""

    def __post_init__(self) -> None:
        """Converts to arrays of numbers.

        Raises:
          InputError: readings, errors or parameters that cannot be used.
        """
        if not callable(self.predict):
            raise InputError(
                f"predict = {shown(self.predict)}: must be a function of a table of parameters"
            )
        readings = _numbers(self.readings, "readings")
        if not readings.size:
            raise InputError("readings: are none; give one at least")
        object.__setattr__(self, "readings", readings)
        if self.errors is not None:
            errors = _numbers(self.errors, "errors", readings.shape)
            if not (errors > 0.0).all():
                raise InputError(
                    f"errors = {errors.min():g}: must be above zero; leave them out to have the "
                    "scatter estimated"
                )
            object.__setattr__(self, "errors", errors)
        if not isinstance(self.name, str):
            raise InputError(f"name = {shown(self.name)}: must be a text")
        if self.at is not None:
            object.__setattr__(self, "at", _numbers(self.at, "at", readings.shape))
        if self.labels is not None and len(self.labels) != readings.size:
            raise InputError(
                f"labels: are {len(self.labels)} for {readings.size} readings; give each a name"
            )
        if self.labels is not None and self.at is not None:
            raise InputError("labels: are given beside at; give one of the two")
        if self.step is not None and not (
            isinstance(self.step, float | int) and 0.0 < self.step < 1.0
        ):
            raise InputError(
                f"step = {shown(self.step)}: must be between 0 and 1, a change of a parameter over "
                "its value"
            )
        if not isinstance(self.parameters, Mapping):
            raise InputError(
                f"parameters = {shown(self.parameters)}: must be a table by name, such as "
                '{"a": 1.0}'
            )
        if not self.free:
            raise InputError("parameters: none is free; give one at least without a value")

    @property
    def _sheets(self) -> dict[str, SimulatorParameter]:
        """The parameters, by name.

        Raises:
          InputError: one that cannot be used.
        """
        return {name: _sheet(name, table) for name, table in self.parameters.items()}

    @property
    def free(self) -> tuple[FreeParameter, ...]:
        """Free parameters, in the order of the values of a fit."""
        tables = self._sheets.items()
        return tuple(free_parameter(table, name) for name, table in tables if table.value is None)

    @property
    def held(self) -> dict[str, float]:
        """Values that are held, by name."""
        return {
            name: table.value for name, table in self._sheets.items() if table.value is not None
        }

    @property
    def model(self) -> str:
        """Name of the function in the report."""
        name = getattr(self.predict, "__name__", type(self.predict).__name__)
        return name if name.isidentifier() else "own"

    def place(self, number: int) -> dict[str, Any]:
        """Position of a reading, as in `fit.json`; empty for readings with labels."""
        if self.labels is not None:
            return {}
        if self.at is None:
            return {"at": number + 1, "axis": "number"}
        return {"at": float(np.asarray(self.at)[number]), "axis": self.axis}


@dataclass(frozen=True, kw_only=True)
class SimulatedExperiment(Experiment):
    """An experiment without samples, whose only model is a user's own function."""

    simulator: Simulator
    standard_deviations: np.ndarray
    """Standard deviations of the readings, stated or estimated so far, (M,)."""
    scatter: Scatter | None = None
    """Scatter that a fit has estimated."""

    @classmethod
    def of_simulator(cls, simulator: Simulator) -> "SimulatedExperiment":
        """The experiment before a fit."""
        readings = np.asarray(simulator.readings)
        errors = simulator.errors
        if errors is None:
            spread = float(readings.std()) or float(np.abs(readings).max()) or 1.0
            errors = np.full(readings.shape, BEFORE_THE_FIT * spread)
        return cls(
            simulator.name,
            (),
            simulator.free,
            simulator=simulator,
            standard_deviations=np.asarray(errors),
        )

    @property
    def errors(self) -> str:
        """`stated` or `estimated`."""
        return "estimated" if self.simulator.errors is None else "stated"

    @property
    def scatter_freedom(self) -> float:
        """Degrees of freedom of an estimated scatter; infinite without one."""
        return math.inf if self.scatter is None else self.scatter.degrees_of_freedom

    @property
    def measurements(self) -> list[Measurement]:
        """The readings with their errors."""
        simulator = self.simulator
        readings = np.asarray(simulator.readings)
        names = simulator.labels or [simulator.quantity] * readings.size
        return [
            Measurement(name, float(value), float(error), simulator.unit, 1.0, row=place)
            for place, (name, value, error) in enumerate(
                zip(names, readings, self.standard_deviations, strict=True)
            )
        ]


def _sheet(name: str, parameter: ParameterTable) -> SimulatorParameter:
    """The validated table of a parameter.

    Raises:
      InputError: it cannot be used.
    """
    if isinstance(parameter, LogNormal):
        parameter = parameter._asdict()
    elif not isinstance(parameter, Mapping):
        parameter = {"median": parameter}
    table = {
        key: list(x) if isinstance(x, tuple | np.ndarray) else x for key, x in parameter.items()
    }
    if table.get("value") is None and table.get("median") is None:
        table["median"] = table.get("start")
    bounds = table.get("bounds")
    if table.get("value") is None and table.get("median") is None and isinstance(bounds, list):
        ends = [end for end in bounds if isinstance(end, float | int)]
        table["median"] = 0.5 * sum(ends) if len(ends) == 2 else None
    table = {key: float(x) if isinstance(x, np.number) else x for key, x in table.items()}
    at = f"parameters[{shown(name)}]"
    try:
        return sheets.validated(SimulatorParameter, table | {"name": name}, at)
    except InputError as error:
        raise InputError(str(error).replace(f"parameter {shown(name)}: ", "", 1)) from None


def _numbers(numbers: Any, name: str, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """A vector of finite numbers.

    Args:
      numbers: as the user gave them; a single number is repeated to the shape.
      name: of the array, as messages name it.
      shape: required shape; None for any array of one axis.

    Raises:
      InputError: it is no such vector.
    """
    try:
        array = np.array(numbers, float)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {shown(numbers)}: must be numbers") from None
    if shape is not None and not array.ndim:
        array = np.full(shape, array)
    if array.ndim != 1 or (shape is not None and array.shape != shape):
        wanted = "one axis" if shape is None else f"shape {shape}, as the readings have"
        raise InputError(f"{name}: have shape {array.shape}; give an array of {wanted}")
    if not np.isfinite(array).all():
        place = int(np.argmin(np.isfinite(array)))
        raise InputError(
            f"{name}[{place}] = {array[place]}: must be a finite number; leave that reading out"
        )
    return array
