"""What a fit found: JSON for programs, Markdown and figures for people."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from calibrate.fit import Fit
from calibrate.identify import Identification, expression
from calibrate.residuals import Problem
from mrjax import files

CHI_SQUARED_PER_MEASUREMENT = 4.0
"""Above this, two standard deviations each, a fit is called a misfit."""


def summary(
    problem: Problem, fit: Fit, found: Identification, predicted: np.ndarray
) -> dict[str, Any]:
    """Everything a fit found, as plain tables. `predicted` is `problem.predict`, (M,)."""
    spreads = np.array([one.standard_deviation for _, one in problem.measurements])
    exponents = fit.jacobian * (spreads / predicted)[:, None]
    samples = {one.label: list(one.samples) for one in problem.experiment.parameters}
    return {
        "converged": fit.converged,
        "parameters": {
            name: {
                "value": value,
                "standard_error": found.standard_errors[name],
                "determined": found.determined[name],
                "samples": samples[name],
                "prior_median": problem.priors[name].median,
                "prior_log_standard_deviation": problem.priors[name].log_standard_deviation,
            }
            for name, value in zip(fit.names, fit.values, strict=True)
        },
        "determined_combinations": [
            {
                "expression": one.expression,
                "value": one.value,
                "standard_error": one.standard_error,
                "exponents": one.exponents,
            }
            for one in found.combinations
        ],
        "null_directions": list(found.null_directions),
        "carried_by_priors_alone": [name for name in fit.names if not found.determined[name]],
        "predictions": [
            {
                "sample": sample.name,
                "observable": one.observable,
                "measured": one.value,
                "sigma": one.standard_deviation,
                "predicted": value,
                "unit": one.unit,
                "varies_as": expression(fit.names, np.round(row, 6)),
            }
            for (sample, one), value, row in zip(
                problem.measurements, predicted, exponents, strict=True
            )
        ],
        "notes": [
            f"sample {sample.name}: {note}"
            for sample in problem.experiment.samples
            for note in sample.recipe.notes
        ],
        "chi_squared": fit.chi_squared,
        "misfit": fit.chi_squared > CHI_SQUARED_PER_MEASUREMENT * len(predicted),
        "singular_values": found.singular_values,
        "model_runs": fit.model_runs,
    }


def in_words(result: dict[str, Any]) -> list[str]:
    """What the data determine and what they do not, a sentence a line."""
    parameters, combinations = result["parameters"], result["determined_combinations"]
    lines = [
        f"The {_spelled(one['observable'])} of sample {one['sample']} varies as "
        f"{one['varies_as']}: only that product of powers can be read from it."
        for one in result["predictions"]
    ]
    lines.append(
        f"Of the {len(parameters)} fitted values the data determine {len(combinations)} "
        f"independent combination{'s' if len(combinations) != 1 else ''}:"
    )
    lines += [
        f"- `{one['expression']}` = {_with_error(one['value'], one['standard_error'])}"
        for one in combinations
    ]
    lines += [
        f"No measurement says anything of `{direction}`: changing it, with the combinations above "
        "held, changes no prediction."
        for direction in result["null_directions"]
    ]
    if result["misfit"]:
        lines.append(
            f"The data do not agree with the model, or with each other: chi-squared is "
            f"{result['chi_squared']:.3g} for {len(result['predictions'])} measurements."
        )
    lines += [
        f"One `{label}` is taken for samples {', '.join(one['samples'])}."
        for label, one in parameters.items()
        if len(one["samples"]) > 1
    ]
    if carried := result["carried_by_priors_alone"]:
        names = ", ".join(f"`{name}`" for name in carried)
        lines.append(
            f"The individual value{'s' if len(carried) > 1 else ''} of {names} "
            f"{'are' if len(carried) > 1 else 'is'} carried by the prior"
            f"{'s' if len(carried) > 1 else ''} alone."
        )
    return lines


def markdown(name: str, model: str, result: dict[str, Any]) -> str:
    """The report of a fit."""
    verdict = (
        "The fit converged."
        if result["converged"]
        else "**The fit did not converge: do not use these values.**"
    )
    if result["misfit"]:
        verdict += (
            " **The data do not agree with the model, or with each other, within their errors:** "
            "check values and units; the errors below do not allow for it."
        )
    predictions = files.markdown_table(
        ["sample", "observable", "measured", "predicted", "unit", "difference / sigma"],
        (
            [
                one["sample"],
                _spelled(one["observable"]),
                f"{one['measured']:g} ± {one['sigma']:g}",
                f"{one['predicted']:.4g}",
                one["unit"],
                f"{(one['predicted'] - one['measured']) / one['sigma']:+.2f}",
            ]
            for one in result["predictions"]
        ),
    )
    parameters = files.markdown_table(
        [
            "parameter",
            "one value for",
            "fitted",
            "prior: median, factor for one sigma",
            "determined by the data",
        ],
        (
            [
                f"`{label}`",
                f"sample{'s' if len(one['samples']) > 1 else ''} {', '.join(one['samples'])}",
                _with_error(one["value"], one["standard_error"]),
                f"{one['prior_median']:g}, {np.exp(one['prior_log_standard_deviation']):.3g}",
                "yes" if one["determined"] else "no, prior only",
            ]
            for label, one in result["parameters"].items()
        ),
    )
    notes = "".join(f"\nNote: {note}.\n" for note in result["notes"])
    words = "\n".join(line if line.startswith("-") else f"\n{line}" for line in in_words(result))
    return f"""# {name}, fitted with the {model} model

{verdict} chi-squared {result["chi_squared"]:.3g} from {len(result["predictions"])} measurements;
{result["model_runs"]} model runs, {result["wall_seconds"]:.0f} s.

## Predicted against measured

{predictions}
![predicted against measured](predictions.png)

## What the data determine
{words}

## Fitted values

{parameters}
Errors are one standard deviation; of the values, data and priors together; of the combinations,
the data alone. A fitted drag factor is a calibration constant: what the recipe leaves out, such as
flocculation or a spread of sizes, is in it.

## The search

![loss](loss.png)

The search overshoots and comes back, as Adam does; Levenberg-Marquardt finishes it.
{notes}"""


def predictions_figure(result: dict[str, Any]) -> Figure:
    """Measured values with their uncertainty, predicted ones beside them."""
    rows = result["predictions"]
    units = list(dict.fromkeys(one["unit"] for one in rows))
    figure = Figure(figsize=(1.8 + 2.4 * len(units), 3.0), layout="constrained")
    for axes, unit in zip(figure.subplots(1, len(units), squeeze=False)[0], units, strict=True):
        of_unit = [one for one in rows if one["unit"] == unit]
        places = np.arange(len(of_unit))
        axes.errorbar(
            places - 0.08,
            [one["measured"] for one in of_unit],
            [one["sigma"] for one in of_unit],
            fmt="o",
            color="black",
            capsize=4,
            label="measured",
        )
        axes.plot(
            places + 0.08,
            [one["predicted"] for one in of_unit],
            "D",
            color="0.55",
            markeredgecolor="black",
            label="predicted",
        )
        axes.set_xticks(
            places, [f"{one['sample']}\n{_spelled(one['observable'])}" for one in of_unit]
        )
        axes.set_xlim(-0.6, len(of_unit) - 0.4)
        highest = max(max(one["measured"] + one["sigma"], one["predicted"]) for one in of_unit)
        axes.set_ylim(0, 1.15 * highest)  # room above the error bars
        axes.set_ylabel("ratio" if unit == "1" else unit)
    axes.legend(frameon=False)
    return figure


def loss_figure(fit: Fit) -> Figure:
    """Half the sum of squares against the step of the search, and after the finish."""
    figure = Figure(figsize=(4.2, 3.0), layout="constrained")
    axes = figure.subplots()
    search, end = fit.loss[:-1], fit.loss[-1]
    axes.semilogy(search, ".-", color="0.4", label="search")
    axes.semilogy([len(search)], [end], "D", color="black", label="finish")
    axes.set_xlabel("step")
    axes.set_ylabel("half the sum of squares,\ndata and priors")
    axes.legend(frameon=False)
    return figure


def write(folder: Path, name: str, model: str, fit: Fit, result: dict[str, Any]) -> None:
    """Writes `fit.json`, `report.md` and the figures."""
    files.write_json(folder / "fit.json", result)
    files.write_text(folder / "report.md", markdown(name, model, result))
    predictions_figure(result).savefig(folder / "predictions.png", dpi=150)
    loss_figure(fit).savefig(folder / "loss.png", dpi=150)


def _spelled(observable: str) -> str:
    return observable.replace("_", " ")


def _with_error(value: float, error: float) -> str:
    """Value and error with two digits of the error."""
    if not (np.isfinite(error) and error > 0):
        return f"{value:.4g} (error unbounded)"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"
