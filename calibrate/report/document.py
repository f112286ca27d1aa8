"""The report of a fit in Markdown."""

from collections.abc import Iterable
from typing import Any

from matplotlib.figure import Figure

from calibrate.inference.posterior import IMPORTANCE
from calibrate.inference.profile import LEVELS
from calibrate.report.formatting import (
    determination,
    fitted_value,
    interval,
    off,
    prior,
    sampled_value,
    scaled_error,
    spelled,
    when,
    with_error,
)
from calibrate.report.words import MARKDOWN, in_words, misfit_in_words
from mrjax.core.text import in_code, in_markdown
from mrjax.io import files

SCALED = "error, scaled"
"""Header of the column of errors that are scaled until they cover the residuals."""

DRAG = (
    " A fitted drag factor is a calibration constant: it includes all\neffects that the "
    "recipe leaves out, such as flocculation or a spread of sizes."
)


def markdown(name: str, model: str, result: dict[str, Any], figures: dict[str, Figure]) -> str:
    """The report of a fit, as Markdown."""

    def shown(*names: str) -> str:
        return "\n".join(f"![{name}]({name}.png)" for name in names if name in figures)

    verdict, predictions = _verdict(result), _predictions(result)
    parameters, numbers = _parameters(result), _validity_table(result)
    left_out, new = _left_out(result.get("left_out", [])), _new_recipe(result.get("new"))
    beyond = "".join(f"\n**Warning:** {in_markdown(warning)}.\n" for warning in result["warnings"])
    notes = "".join(f"\nNote: {in_markdown(note)}.\n" for note in result["notes"])
    first = misfit_in_words(result, MARKDOWN)
    sentences = in_words(result, MARKDOWN)[len(first) :]
    words = "\n".join(line if line.startswith("-") else f"\n{line}" for line in sentences)
    bold = "".join(
        f"**{sentence}**\n\n" if sentence is first[0] else f"{sentence}\n\n" for sentence in first
    )
    return f"""# {in_markdown(name)}, fitted with the {model} model

{bold}{verdict}
chi-squared {result["chi_squared"]:.3g} from {len(result["predictions"])} measurements
and {result["degrees_of_freedom"]} degrees of freedom; {result["model_runs"]} model runs,
{result["wall_seconds"]:.0f} s.

## Predicted against measured

{_reading_records(result)}{predictions}
{shown("predictions", "velocities", "curves", "fields", "concentrations", "readings", "residuals")}

## What the data determine
{words}

## Fitted values

{parameters}
Errors are one standard deviation: of the values from data and priors together, of the combinations
from the data alone. Intervals are those of the profile likelihood. The second number of a prior is
the factor of one standard deviation.{DRAG if numbers else ""}

{shown("profiles", "posterior")}
{_posterior(result["posterior"])}{left_out}{new}
{_validity_section(numbers, beyond)}
## The search

{shown("loss")}

The search looks for valleys, over the whole priors if there is a cheap model.
Levenberg-Marquardt finishes the best one, or a simplex if it is on a kink.
{_optima(result)}{notes}"""


def _verdict(result: dict[str, Any]) -> str:
    """The verdict on the fit: convergence, misfit and other optima."""
    verdict = (
        "The fit converged."
        if result["converged"]
        else "**The fit did not converge: do not use these values.**"
    )
    if result["misfit"]:
        verdict += (
            " **The data do not agree with the model, or with each other, within their errors:** "
            "check values and units; below, only the errors called scaled allow for it."
        )
    if others := len(result["optima"]) - 1:
        verdict += (
            f" The search found {others} other optim{'um' if others == 1 else 'a'}, worse than "
            "this fit: see below."
        )
    return verdict


def _reading_records(result: dict[str, Any]) -> str:
    """Records of how files were read."""
    lines = [
        f"Sample {in_markdown(name)}: {in_markdown(file['line'])}.\n\n"
        for name, file in result["data_as_understood"].items()
    ]
    return "".join(lines)


def _predictions(result: dict[str, Any]) -> str:
    """The table of predicted and measured values."""
    return _without_samples(
        ["sample", "observable", "measured", "predicted", "unit", "difference / sigma"],
        (
            [
                row["sample"],
                spelled(row["observable"]) + when(row),
                f"{row['measured']:g} ± {row['sigma']:.3g}",
                with_error(row["predicted"], row["predicted_error"]),
                row["unit"],
                f"{(row['predicted'] - row['measured']) / row['sigma']:+.2f}",
            ]
            for row in result["predictions"]
        ),
    )


def _parameters(result: dict[str, Any]) -> str:
    """The table of fitted values."""
    return _without_samples(
        [
            "parameter",
            "one value for",
            "fitted",
            SCALED,
            *LEVELS,
            "prior",
            "posterior",
            "determined",
        ],
        (
            [
                in_code(label),
                _sample_names(parameter["samples"]),
                fitted_value(parameter),
                scaled_error(parameter) if result["misfit"] else "",
                *(interval(parameter, coverage) for coverage in LEVELS),
                prior(parameter),
                sampled_value(parameter["posterior"]),
                determination(parameter, result["misfit"]),
            ]
            for label, parameter in result["parameters"].items()
        ),
    )


def _sample_names(names: list[str]) -> str:
    """The samples that share a value, in words; empty without samples."""
    plural = "s" if len(names) > 1 else ""
    return f"sample{plural} {', '.join(names)}" if names else ""


def _without_samples(header: list[str], rows: Iterable[list[Any]]) -> str:
    """A Markdown table, without empty columns of samples and of scaled errors."""
    all_rows = list(rows)
    columns = [
        place
        for place, name in enumerate(header)
        if name not in ("sample", "one value for", SCALED) or any(row[place] for row in all_rows)
    ]
    return files.markdown_table(
        [header[place] for place in columns],
        ([row[place] for place in columns] for row in all_rows),
    )


def _optima(result: dict[str, Any]) -> str:
    """The table of all optima; empty if there is only one."""
    if len(result["optima"]) < 2:
        return ""
    labels = list(result["parameters"])
    table = files.markdown_table(
        ["chi-squared", "with priors", *map(in_code, labels), "by"],
        (
            [
                f"{optimum['chi_squared']:.4g}",
                f"{2.0 * optimum['half_sum_of_squares']:.4g}",
                *(f"{optimum['values'][label]:.4g}" for label in labels),
                "the model" if optimum["finished"] else "the cheap model of the search",
            ]
            for optimum in result["optima"]
        ),
    )
    return f"\n{table}"


def _validity_section(numbers: str, warnings: str) -> str:
    """The section on the validity of the model, or on warnings alone."""
    if not numbers:
        return f"## Warnings\n{warnings}" if warnings else ""
    return f"## Where the model holds\n\n{numbers}{warnings}"


def _validity_table(result: dict[str, Any]) -> str:
    """The table of dimensionless numbers and their valid range; empty without suspensions."""
    if not result["validity"]:
        return ""
    return files.markdown_table(
        ["sample", "number", "as fitted", "the model holds"],
        (
            [sample, name, f"{number['value']:.2g}", number["holds"]]
            for sample, of_sample in result["validity"].items()
            for name, number in of_sample.items()
        ),
    )


def _left_out(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return ""
    table = files.markdown_table(
        ["sample", "observable", "measured", "predicted", "unit", "error", "difference / errors"],
        (
            [
                row["sample"],
                spelled(row["observable"]) + when(row),
                f"{row['measured']:g} ± {row['sigma']:.3g}",
                with_error(row["predicted"], row["predicted_error"]),
                row["unit"],
                off(row),
                f"{row['difference_over_both_errors']:+.2f}",
            ]
            for row in rows
        ),
    )
    return f"""
## Each sample predicted from the others

Values that only the predicted sample would determine are taken from their priors.

{table}"""


def _new_recipe(rows: list[dict[str, Any]] | None) -> str:
    if not rows:
        return ""
    table = files.markdown_table(
        ["recipe", "observable", "predicted", "unit"],
        (
            [
                row["sample"],
                spelled(row["observable"]) + when(row),
                with_error(row["predicted"], row["predicted_error"]),
                row["unit"],
            ]
            for row in rows
        ),
    )
    return f"\n## A new recipe\n\n{table}"


def _posterior(posterior: dict[str, Any] | None) -> str:
    if posterior is None:
        return ""
    weighted = posterior["method"] == IMPORTANCE
    verdict = "The samples of the posterior agree between chains"
    if weighted:
        verdict = "The weights of the samples of the posterior are even enough to rely on them"
    if not posterior["converged"]:
        verdict = "**The samples of the posterior have not converged: do not use them**"
    numbers = f"{posterior['effective_samples']:.0f} effective samples"
    if weighted:
        numbers = f"Pareto's k {posterior['pareto_k']:.2f}, {numbers}; importance sampling"
    else:
        numbers = (
            f"R-hat {posterior['r_hat']:.3f}, {numbers}, {posterior['divergences']} divergences"
        )
    faults = "".join(f" **Not known:** {fault}." for fault in posterior["faults"])
    return f"{verdict} ({numbers}).{faults}\n"
