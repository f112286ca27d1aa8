"""A result in sentences, for terminals and for Markdown."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from calibrate.experiment.units import TIME_UNITS
from calibrate.inference.runs import TOO_FEW_BELOW
from calibrate.report.formatting import by_chance, off, spelled, when, with_error
from mrjax.core.text import in_code, in_markdown, in_terminal


class Language(NamedTuple):
    """Functions that escape text and code in one format."""

    text: Callable[[str], str]
    code: Callable[[str], str]


MARKDOWN = Language(in_markdown, in_code)

TOO_LARGE = 0.2
"""Scatter of concentrations, over that of the suspension, above which it rather is a misfit."""
AS_GOOD = 1.92
"""Rise of the loss up to which an optimum is not excluded, at 95 %."""

TERMINAL = Language(in_terminal, lambda name: f"`{in_terminal(name)}`")

TRY = (
    "Possible remedies: another closure, a bed that yields, or a delay; a correction of a unit or "
    "height that is wrong by a power of ten; larger errors."
)
"""Remedies of a misfit."""

SAID = {
    "carried_by_priors_alone": (
        "The individual value of {} follows from the prior alone.",
        "The individual values of {} follow from the priors alone.",
    ),
    "informed_by_data": (
        "The data narrow the prior of {}, but do not determine it.",
        "The data narrow the priors of {}, but do not determine them.",
    ),
    "told_together": (
        "The data determine {} only in a combination; the prior separates it from the other "
        "values.",
        "The data determine {} only in combinations; the priors separate them from each other.",
    ),
    "bounded_on_one_side": (
        "The data bound {} on one side only; the prior or a physical bound limits the other side.",
        "The data bound each of {} on one side only; the priors or physical bounds limit the other "
        "side.",
    ),
    "loosely_bounded": (
        "The data bound {} only loosely, and there is no prior: give one, or other readings.",
        "The data bound {} only loosely, and there are no priors: give some, or other readings.",
    ),
    "undetermined": (
        "Neither data nor a prior determine {}: it is where the search happened to end.",
        "Neither data nor a prior determine {}: they are where the search happened to end.",
    ),
}
"""Sentences on values that the data do not determine: for one value, and for several."""


def in_words(result: dict[str, Any], language: Language = TERMINAL) -> list[str]:
    """The result in sentences, one a line: the misfit, the scatter, and what the data determine."""
    text, code = language
    parameters, combinations = result["parameters"], result["determined_combinations"]
    lines = misfit_in_words(result, language)
    lines += [_scatter(text(name), scatter, text) for name, scatter in result["scatter"].items()]
    lines += [_runs(text, test) for test in result["runs"]]
    lines += [
        f"The {spelled(row['observable'])}{_sample_text(text, row)} varies as "
        f"{text(row['varies_as'])}: only that product of powers can be read from it."
        for row in result["predictions"]
        if row.get("varies_as", "1") != "1"
    ]
    if result["misfit"]:
        lines.append(_sentence_before_values(result))
    lines.append(_number_of_combinations(len(parameters), len(combinations)))
    lines += [_combination(combination, code) for combination in combinations]
    lines += [
        f"{code(f'odds({label})')} is ({text(label)} {_subtraction(parameter['bounds'][0])}) / "
        f"({parameter['bounds'][1]:g} - {text(label)}), which runs from 0 to infinity."
        for label, parameter in parameters.items()
        if parameter["bounds"]
    ]
    if near := [
        combination
        for combination in result["near_combinations"]
        if combination["expression"] not in parameters
    ]:
        lines.append("Near this fit, but not farther away, they also determine:")
        lines += [_combination(combination, code) for combination in near]
    unchanged = result["unchanged_at_a_distance"]
    lines += [
        _null_direction(code(direction), direction in unchanged, bool(combinations))
        for direction in result["null_directions"]
    ]
    lines += [
        f"The data say too little of {code(direction)} to determine it."
        for direction in result["weak_combinations"]
        if direction not in parameters
    ]
    lines += [
        f"One {code(label)} is taken for samples {text(', '.join(parameter['samples']))}."
        for label, parameter in parameters.items()
        if len(parameter["samples"]) > 1
    ]
    for key, (singular, plural) in SAID.items():
        if names := result[key]:
            names_text = ", ".join(map(code, names))
            lines.append((plural if len(names) > 1 else singular).format(names_text))
    return [*lines, *_optima(result, code)]


def _combination(combination: dict[str, Any], code: Callable[[str], str]) -> str:
    """The list item of a combination: its expression, value and standard error."""
    value = with_error(combination["value"], combination["standard_error"])
    return f"- {code(combination['expression'])} = {value}"


def _sentence_before_values(result: dict[str, Any]) -> str:
    """The sentence that precedes the values of a model that does not fit."""
    return (
        "The values below are only as good as the model, which does not fit. Their errors follow "
        f"from the {result['errors']} errors of the readings; they are about "
        f"{result['error_scale']:.3g} times as large if those are scaled to cover the residuals."
    )


def _number_of_combinations(values: int, combinations: int) -> str:
    """The sentence that precedes the combinations that the data determine."""
    if values == 1:
        return (
            "The data determine the fitted value:"
            if combinations
            else ("The data do not determine the fitted value.")
        )
    return (
        f"Of the {values} fitted values the data determine {combinations} independent "
        f"combination{'s' if combinations != 1 else ''}{':' if combinations else '.'}"
    )


def _subtraction(number: float) -> str:
    """The subtraction of a number as text: `- 0.5`, or `+ 1` for -1."""
    return f"{'+' if number < 0.0 else '-'} {abs(number):g}"


def _null_direction(direction: str, unchanged: bool, others: bool = True) -> str:
    """The sentence about a null direction."""
    condition = ", with the combinations above held," if others else ""
    if unchanged:
        return (
            f"No measurement says anything of {direction}: changing it{condition} changes no "
            "prediction, not even a factor of ten away."
        )
    return (
        f"No measurement says anything of {direction} near this fit: changing it there{condition} "
        "changes no prediction; farther away it may."
    )


def _optima(result: dict[str, Any], code: Callable[[str], str]) -> Iterator[str]:
    """Sentences about the other optima."""
    best, *others = result["optima"] or [None]
    for optimum in others:
        values = ", ".join(
            f"{code(name)} = {value:.3g}" for name, value in optimum["values"].items()
        )
        rise = optimum["half_sum_of_squares"] - best["half_sum_of_squares"]
        as_good = rise < AS_GOOD * (result["error_scale"] ** 2 if result["misfit"] else 1.0)
        comparison = "as good, beside such a misfit" if result["misfit"] else "nearly as good"
        yield (
            f"Another optimum: {values}, with chi-squared {optimum['chi_squared']:.4g} where this "
            f"fit has {result['chi_squared']:.4g}"
            f"{f', {comparison}: data and priors do not tell the two apart' if as_good else ''}."
        )


def _absolute_scatter(row: dict[str, Any], text: Callable[[str], str]) -> str:
    """The sentence about the scatter of a curve or table, or of the readings of a simulator."""
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    scatter = "The scatter of the readings"
    if "sample" in row:
        scatter += f" of the {spelled(row['observable'])} of sample {text(row['sample'])}"
    if "table" in row:
        scatter += f", {text(row['table'])}"
        if row["source"] == "assumed":
            value = f"{row['value']:.3g}{unit}"
            return f"{scatter}, is assumed, {value}: too few readings for an estimate."
    if row["source"] == "assumed":
        return (
            f"{scatter}, {row['value']:.3g}{unit}, is that about parabolas through their "
            "neighbours: too few degrees of freedom are left for an estimate by the fit."
        )
    value = with_error(row["value"], row["standard_error"])
    sentence = _estimated_scatter(f"{scatter}, {value}{unit}", row)
    if row["source"] == "repeats" or row.get("of_initial", 0.0) < TOO_LARGE:
        return sentence
    return (
        f"{sentence} It is {row['of_initial']:.0%} of the concentration of the suspension: rather "
        "a front that the model misses than scatter."
    )


def _scatter(name: str, row: dict[str, Any], text: Callable[[str], str]) -> str:
    """The sentence about the scatter of readings without a stated error."""
    if "unit" in row:
        return _absolute_scatter(row, text)
    scatter = f"The relative scatter of the velocities of sample {name}"
    value, error = 100.0 * row["value"], 100.0 * row["standard_error"]
    if row["source"] == "assumed":
        return f"{scatter} is assumed, {value:.3g} %: too few readings for an estimate."
    return _estimated_scatter(f"{scatter}, {with_error(value, error)} %", row)


def _estimated_scatter(scatter: str, row: dict[str, Any]) -> str:
    """The sentence about a scatter that is estimated from repeats or residuals."""
    source = "repeats" if row["source"] == "repeats" else "their residuals"
    return (
        f"{scatter}, is estimated from {source}, with {row['degrees_of_freedom']:.3g} degrees of "
        "freedom: errors of fitted values follow from it, and intervals are those of Student's "
        "distribution."
    )


def _runs(text: Callable[[str], str], row: dict[str, Any]) -> str:
    """The sentence about the runs test of readings without a stated error."""
    changes = row["runs"] - 1
    sentence = (
        f"The residuals of the {row['readings']} readings of the {spelled(row['observable'])}"
        f"{_sample_text(text, row)} change sign {changes} time{'s' if changes != 1 else ''}; "
        f"noise changes sign as seldom with p {by_chance(row['p_value'])}"
    )
    return (
        f"{sentence}: the model misses their shape."
        if row["p_value"] < TOO_FEW_BELOW
        else f"{sentence}."
    )


def _sample_text(text: Callable[[str], str], row: dict[str, Any]) -> str:
    """The sample of a measurement as text; empty for a simulator."""
    return "" if row["sample"] is None else f" of sample {text(row['sample'])}"


def misfit_in_words(result: dict[str, Any], language: Language = TERMINAL) -> list[str]:
    """Sentences about a misfit, or about an agreement that proves nothing; else none."""
    if result["degrees_of_freedom"] <= 0 and not result["misfit"]:
        values, numbers = len(result["parameters"]), len(result["predictions"])
        return [
            f"{values} value{'s' if values > 1 else ''} fitted to {numbers} number"
            f"{'s' if numbers > 1 else ''}: their agreement proves nothing."
        ]
    if not result["misfit"]:
        return []
    lines = [_misfit(result)]
    if result["stands_out"]:
        rows = [result["predictions"][place] for place in result["stands_out"]]
        readings = "; ".join(
            _far_off(row, result["data_as_understood"], language.text) for row in rows
        )
        lines.append(f"Farthest off: {readings}.")
    lines += [
        f"{language.text(sentence[:1].upper() + sentence[1:])}." for sentence in result["advice"]
    ]
    return [*lines, TRY]


def _far_off(
    row: dict[str, Any], files: dict[str, dict[str, Any]], text: Callable[[str], str]
) -> str:
    """Describes a reading that stands out, with its time and line as in its file.

    Args:
      row: its row of `predictions`.
      files: records of how files were read, by sample and table.
      text: function that escapes names.
    """
    table = "velocities" if "concentration" in row else row.get("table")
    file = files.get(f"{row['sample']}, {table}" if table else row["sample"], {})
    line = "" if row["row"] is None else f", {file.get('row_word', 'row')} {row['row']}"
    moment = when(row)
    if "time_s" in row and file and not table:
        moment = f" at {row['time_s'] / TIME_UNITS[file['time_unit']]:.6g} {file['time_unit']}"
    sample = "" if row["sample"] is None else f"sample {text(row['sample'])}, "
    deviations = (row["predicted"] - row["measured"]) / row["sigma"]
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    return (
        f"{sample}{spelled(row['observable'])}{moment}{line}: {row['measured']:.4g}{unit} "
        f"measured, {row['predicted']:.4g} predicted, {abs(deviations):.3g} standard deviations"
    )


def _misfit(result: dict[str, Any]) -> str:
    """The sentence about data that do not agree with the model."""
    p = "" if result["p_value"] is None else f", p {by_chance(result['p_value'])}"
    whose = "Stated" if result["errors"] == "stated" else "Estimated"
    return (
        f"The data do not agree with the model, or with each other: chi-squared is "
        f"{result['chi_squared']:.3g} for {len(result['predictions'])} measurements, "
        f"{result['reduced_chi_squared']:.3g} for each degree of freedom{p}; residuals are "
        f"{result['residuals_over_range']:.2g} of the range of the readings. {whose} errors would "
        f"have to be {result['error_scale']:.3g} times as large."
    )


def line(row: dict[str, Any]) -> str:
    """A prediction of `forecasts`, as a sentence."""
    text = (
        f"{row['sample']}, not fitted: {spelled(row['observable'])}{when(row)} "
        f"{with_error(row['predicted'], row['predicted_error'])} {row['unit']} predicted"
    )
    if not np.isfinite(row["measured"]):
        return f"{text}."
    return f"{text}, {row['measured']:g} ± {row['sigma']:g} measured{off(row, ' ({})')}."
