"""A user's own simulator as residuals, and the fit of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike

from calibrate.experiment.physical_bounds import NEAREST
from calibrate.experiment.sample import Measurement, Sample, Scatter
from calibrate.experiment.simulator import SimulatedExperiment, Simulator
from calibrate.least_squares.fit import Fit, fit
from calibrate.least_squares.leverage import leverages
from calibrate.problem.problem import Problem
from calibrate.problem.scatter import FEWEST_FREE, fit_with_scatter, scale_of, uncapped
from mrjax import InputError
from mrjax.core.errors import shown
from mrjax.core.promotion import relaxed_promotion
from mrjax.io.checkpoint import refuse_foreign

LEAST_SCATTER = 1e-6
"""Least estimated scatter, over the largest reading; smaller residuals are rounding."""
AGREES_WITHIN = 1e-3
"""Largest difference of traced and plain predictions, over the largest prediction."""
MOVED = 1.01
"""Factor on a value, to check a slope of zero."""


@dataclass(frozen=True)
class SimulatorProblem(Problem):
    """A simulator as residuals."""

    experiment: SimulatedExperiment
    traced: bool = False
    """True if JAX traces the function."""

    @classmethod
    def of_simulator(cls, simulator: Simulator) -> "SimulatorProblem":
        """Calls the function at the start, and checks whether JAX can trace it.

        Raises:
          InputError: the function fails there, its predictions do not match the readings, or it
            cannot be traced although `differentiable` is true.
        """
        experiment = SimulatedExperiment.of_simulator(simulator)
        problem = cls(experiment, (), experiment.start, everywhere=True)
        problem._refuse_the_start()
        return replace(problem, traced=problem._is_traceable())

    def _refuse_the_start(self) -> None:
        """Refuses a function without finite predictions at the start."""
        values = self._values(self.start)
        values_text = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
        try:
            predicted = self.predict(self.start)
        except InputError as error:
            raise InputError(f"{error} (at the start, {values_text})") from None
        except Exception as error:
            raise InputError(
                f"predict raises {type(error).__name__} at the start, {values_text}: {error}; "
                "mend it, or give a start where it predicts"
            ) from error
        if not np.isfinite(predicted).all():
            place = int(np.argmin(np.isfinite(predicted)))
            raise InputError(
                f"predict: prediction {place} is {predicted[place]} at the start, {values_text}; "
                "give a start where it predicts"
            )

    def _is_traceable(self) -> bool:
        """True if JAX can trace the function.

        Raises:
          InputError: it cannot, although `differentiable` is true.
        """
        if self.simulator.differentiable is False:
            return False
        try:
            with relaxed_promotion():
                jax.eval_shape(partial(self._traced, errors=None), dict(self.start))
        except Exception as error:
            if self.simulator.differentiable:
                reason = type(error).__name__
                raise InputError(
                    f"predict: JAX cannot trace it ({reason}); write it with jax.numpy, without "
                    "float() and without `if` on values, or give differentiable=False"
                ) from error
            return False
        return True

    @property
    def simulator(self) -> Simulator:
        """The function and its readings."""
        return self.experiment.simulator

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of the odds of bounded parameters, by variable."""
        ends = NEAREST / (1.0 - NEAREST), (1.0 - NEAREST) / NEAREST
        return {
            parameter.variable: ends for parameter in self.experiment.parameters if parameter.bounds
        }

    @property
    def measurements(self) -> Sequence[tuple[Sample | None, Measurement]]:
        """The readings as measurements without a sample."""
        return [(None, measurement) for measurement in self.experiment.measurements]

    def _values(self, theta: Mapping[str, Any]) -> dict[str, Any]:
        """Parameter values by name, held ones included, from the variables of the fit."""
        free = {
            parameter.name: parameter.value(theta[parameter.variable])
            for parameter in self.experiment.parameters
        }
        return free | self.simulator.held

    def predict(self, theta: Mapping[str, ArrayLike]) -> Any:
        """Predictions of the plain function for values by variable, (M,).

        Raises:
          InputError: predictions that are not one real number for each reading.
        """
        numbers = {name: float(x) for name, x in self._values(theta).items()}
        with np.errstate(all="ignore"), relaxed_promotion():
            predicted = self.simulator.predict(numbers)
        try:
            array = np.atleast_1d(np.asarray(predicted))
            if np.iscomplexobj(array):
                raise ValueError("complex numbers are no predictions of real readings")
            array = array.astype(float)
        except (TypeError, ValueError):
            raise InputError(f"predict: gives {shown(predicted)}; give real numbers") from None
        self._refuse_shape(array.shape)
        return array

    def _refuse_shape(self, shape: tuple[int, ...]) -> None:
        if shape != self.measured.shape:
            raise InputError(
                f"predict: gives shape {shape} for readings of shape {self.measured.shape}; give "
                "one prediction for each reading"
            )

    def residuals_with(self, theta: Mapping[str, Any], errors: Any) -> Any:
        """(prediction - reading) / error, (M,); traced by JAX if the function can be.

        Args:
          theta: values by variable.
          errors: standard deviations of the readings, (M,).
        """
        if self.traced:
            return self._traced(theta, errors)
        return (self.predict(theta) - self.measured) / np.asarray(errors)

    def _traced(self, theta: Mapping[str, Any], errors: Any) -> Array:
        predicted = jnp.atleast_1d(jnp.asarray(self.simulator.predict(self._values(theta)), float))
        self._refuse_shape(predicted.shape)
        return predicted if errors is None else (predicted - jnp.asarray(self.measured)) / errors

    def with_scatter(self, fitted: Fit) -> "SimulatorProblem":
        """The problem with the scatter estimated from the residuals of a fit.

        Raises:
          InputError: as many values are fitted as there are readings.
        """
        free = self.measured.size - float(leverages(fitted.jacobian, fitted.prior_precision).sum())
        if free < FEWEST_FREE - 1e-6:
            raise InputError(
                f"errors: are left out, and {self.measured.size} readings are too few to "
                "estimate their scatter beside the fitted values; state errors, or give more "
                "readings"
            )
        least = LEAST_SCATTER * (float(np.abs(self.measured).max()) or 1.0)
        estimated = scale_of(uncapped(fitted) * self.errors, free, fitted.robust is not None)
        scatter = Scatter(max(estimated, least), free, "fit")
        errors = np.full(self.measured.shape, scatter.value)
        experiment = replace(self.experiment, standard_deviations=errors, scatter=scatter)
        return replace(self, experiment=experiment)

    def with_freedom(self, estimated: "SimulatorProblem") -> "SimulatorProblem":
        """The problem with its own errors, and with the scatter of the final residuals."""
        experiment = replace(self.experiment, scatter=estimated.experiment.scatter)
        return replace(self, experiment=experiment)

    def refuse_untrue_slopes(self, fitted: Fit) -> None:
        """Refuses a traced function that differs from the plain one.

        A function that stops gradients, or keeps values of its first trace, has slopes of zero.

        Raises:
          InputError: predictions, or a slope that is zero, differ from those of plain calls.
        """
        if not self.traced or not np.isfinite(fitted.values).all():
            return
        remedy = "give differentiable=False for slopes by finite differences"
        plain_predictions = self.predict(fitted.theta)
        traced = self.measured + uncapped(fitted) * self.errors
        allowed = AGREES_WITHIN * np.abs(plain_predictions).max()
        if np.abs(plain_predictions - traced).max() > allowed:
            place = int(np.argmax(np.abs(plain_predictions - traced)))
            raise InputError(
                f"predict: gives {plain_predictions[place]:.6g} when called and "
                f"{traced[place]:.6g} when JAX traces it; {remedy}"
            )
        for parameter, slopes in zip(self.experiment.parameters, fitted.jacobian.T, strict=True):
            if slopes.any():
                continue
            changed_predictions = self.predict(
                {**fitted.theta, parameter.variable: fitted.theta[parameter.variable] * MOVED}
            )
            if np.abs(changed_predictions - plain_predictions).max() > 1e-3 * allowed:
                raise InputError(
                    f"predict: depends on {parameter.name}, but its derivative by JAX is zero; "
                    f"{remedy}"
                )


def fit_simulator(
    simulator: Simulator,
    *,
    starts: int = 1,
    seed: int = 0,
    robust: float | None = None,
    progress: bool = False,
    checkpoint: str | Path | None = None,
) -> tuple[SimulatorProblem, Fit]:
    """Fits a simulator.

    Args:
      simulator: the function and its readings.
      starts, seed, robust, progress: as for `fit`.
      checkpoint: folder that stores the results of the function, as for `fit`.

    Returns:
      the problem with the errors of the fit, and the fit.

    Raises:
      InputError: a function that cannot be fitted, or a checkpoint of another fit.
    """
    refuse_foreign(checkpoint)
    problem = SimulatorProblem.of_simulator(simulator)
    residuals, near, places = problem.residuals_with, problem.start, starts

    def fit_errors(with_errors: SimulatorProblem, number: int) -> Fit:
        nonlocal near, places
        result = fit(
            residuals,
            near,
            data=with_errors.errors,  # as data: one compiled program for all rounds
            priors=problem.priors,
            bounds=problem.bounds,
            starts=places,
            seed=seed,
            robust=robust,
            differentiable=problem.traced,
            step=simulator.step,
            progress=progress,
            checkpoint=checkpoint and Path(checkpoint) / f"scatter-{number}",
        )
        near, places = result.theta, 1
        return replace(result, places=starts)

    if simulator.errors is None:
        problem, result = fit_with_scatter(
            problem, fit_errors, SimulatorProblem.with_scatter, SimulatorProblem.with_freedom
        )
    else:
        result = fit_errors(problem, 0)
    problem.refuse_untrue_slopes(result)
    return problem, result
