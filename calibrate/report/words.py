"""A result in sentences, for terminals and for Markdown."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from calibrate.experiment.units import TIME_UNITS
from calibrate.inference.runs import TOO_FEW_BELOW
from calibrate.report.formatting import by_chance, off, spelled, when, with_error
from mrjax.core.text import in_code, in_markdown, in_terminal


class Language(NamedTuple):
    """Escapes of names of samples and of values."""

    text: Callable[[str], str]
    code: Callable[[str], str]


MARKDOWN = Language(in_markdown, in_code)

TOO_LARGE = 0.2
"""Scatter of concentrations, over that of the suspension, which is rather a misfit."""
AS_GOOD = 1.92
"""Largest rise of the loss of an optimum that 95 % of cases do not exclude."""

TERMINAL = Language(in_terminal, lambda name: f"`{in_terminal(name)}`")

TRY = (
    "What may help: another closure, a bed that yields, a delay; a unit or height that is wrong by "
    "a power of ten; larger errors."
)
"""What a reader may try where data and model do not agree."""

SAID = {
    "carried_by_priors_alone": (
        "The individual value of {} is carried by the prior alone.",
        "The individual values of {} are carried by the priors alone.",
    ),
    "informed_by_data": (
        "The data narrow what the prior says of {}, and do not determine it.",
        "The data narrow what the priors say of {}, and do not determine them.",
    ),
    "told_together": (
        "The data tell of {} in a combination alone: the prior parts it from the others there.",
        "The data tell of {} in combinations alone: the priors part them from each other.",
    ),
    "bounded_on_one_side": (
        "The data bound {} on one side alone: the other is the prior's, or a bound of physics.",
        "The data bound each of {} on one side alone: the other is the prior's, or a bound of "
        "physics.",
    ),
    "loosely_bounded": (
        "The data bound {} only loosely, and no prior says more: give one, or other readings.",
        "The data bound {} only loosely, and no priors say more: give some, or other readings.",
    ),
    "undetermined": (
        "Neither data nor a prior say what {} is: it is where the search happened to end.",
        "Neither data nor a prior say what {} are: they are where the search happened to end.",
    ),
}
"""What is said of values that the data do not determine: of one, and of several."""


def in_words(result: dict[str, Any], language: Language = TERMINAL) -> list[str]:
    """The result in sentences: what the data determine and what they do not; one a line."""
    text, code = language
    parameters, combinations = result["parameters"], result["determined_combinations"]
    lines = misfit_in_words(result, language)
    lines += [_scatter(text(name), one, text) for name, one in result["scatter"].items()]
    lines += [_runs(text, one) for one in result["runs"]]
    lines += [
        f"The {spelled(one['observable'])}{_whose(text, one)} varies as "
        f"{text(one['varies_as'])}: only that product of powers can be read from it."
        for one in result["predictions"]
        if one.get("varies_as", "1") != "1"
    ]
    if result["misfit"]:
        lines.append(_as_far_as_it_is_right(result))
    lines.append(_how_many(len(parameters), len(combinations)))
    lines += [
        f"- {code(one['expression'])} = {with_error(one['value'], one['standard_error'])}"
        for one in combinations
    ]
    lines += [
        f"{code(f'odds({label})')} is ({text(label)} {_less(one['bounds'][0])}) / "
        f"({one['bounds'][1]:g} - {text(label)}), which runs from 0 to infinity."
        for label, one in parameters.items()
        if one["bounds"]
    ]
    if near := [one for one in result["near_combinations"] if one["expression"] not in parameters]:
        lines.append("Near this fit, though not farther away, they determine:")
        lines += [
            f"- {code(one['expression'])} = {with_error(one['value'], one['standard_error'])}"
            for one in near
        ]
    unchanged = result["unchanged_at_a_distance"]
    lines += [
        _null(code(one), one in unchanged, bool(combinations)) for one in result["null_directions"]
    ]
    lines += [
        f"The data say too little of {code(direction)} to determine it."
        for direction in result["weak_combinations"]
        if direction not in parameters
    ]
    lines += [
        f"One {code(label)} is taken for samples {text(', '.join(one['samples']))}."
        for label, one in parameters.items()
        if len(one["samples"]) > 1
    ]
    for key, (one, several) in SAID.items():
        if names := result[key]:
            listed = ", ".join(map(code, names))
            lines.append((several if len(names) > 1 else one).format(listed))
    return [*lines, *_optima(result, code)]


def _as_far_as_it_is_right(result: dict[str, Any]) -> str:
    """The sentence before values of a model that does not fit."""
    return (
        "The values below are as good as the model, which does not fit. Their errors are by the "
        f"{result['errors']} errors of the readings: about {result['error_scale']:.3g} times as "
        "large where these are made to cover the residuals."
    )


def _how_many(values: int, combinations: int) -> str:
    """The sentence before the combinations that the data determine."""
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


def _less(number: float) -> str:
    """A number that is taken away: `- 0.5`, or `+ 1` for -1."""
    return f"{'+' if number < 0.0 else '-'} {abs(number):g}"


def _null(direction: str, unchanged: bool, others: bool = True) -> str:
    """The sentence about a product of powers of which no measurement tells."""
    held = ", with the combinations above held," if others else ""
    if unchanged:
        return (
            f"No measurement says anything of {direction}: changing it{held} changes no "
            "prediction, a factor of ten away either."
        )
    return (
        f"No measurement says anything of {direction} near this fit: changing it there{held} "
        "changes no prediction; farther away it may."
    )


def _optima(result: dict[str, Any], code: Callable[[str], str]) -> Iterator[str]:
    """Sentences about the other optima."""
    best, *others = result["optima"] or [None]
    for one in others:
        values = ", ".join(f"{code(name)} = {value:.3g}" for name, value in one["values"].items())
        rise = one["half_sum_of_squares"] - best["half_sum_of_squares"]
        as_good = rise < AS_GOOD * (result["error_scale"] ** 2 if result["misfit"] else 1.0)
        such = "as good, beside such a misfit" if result["misfit"] else "nearly as good"
        yield (
            f"Another optimum: {values}, with chi-squared {one['chi_squared']:.4g} where this fit "
            f"has {result['chi_squared']:.4g}"
            f"{f', {such}: data and priors do not tell the two apart' if as_good else ''}."
        )


def _absolute_scatter(one: dict[str, Any], text: Callable[[str], str]) -> str:
    """The sentence about the scatter of a curve or table, or of the readings of a simulator."""
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    scatter = "The scatter of the readings"
    if "sample" in one:
        scatter += f" of the {spelled(one['observable'])} of sample {text(one['sample'])}"
    if "table" in one:
        scatter += f", {text(one['table'])}"
        if one["source"] == "assumed":
            return f"{scatter}, is assumed, {one['value']:.3g}{unit}: too few readings tell it."
    if one["source"] == "assumed":
        return (
            f"{scatter}, {one['value']:.3g}{unit}, is that about parabolas through their "
            "neighbours: too few are free to tell it."
        )
    value = with_error(one["value"], one["standard_error"])
    said = _estimated(f"{scatter}, {value}{unit}", one)
    if one["source"] == "repeats" or one.get("of_initial", 0.0) < TOO_LARGE:
        return said
    return (
        f"{said} It is {one['of_initial']:.0%} of the concentration of the suspension: rather a "
        "front that the model misses than scatter."
    )


def _scatter(name: str, one: dict[str, Any], text: Callable[[str], str]) -> str:
    """The sentence about the scatter of readings without a stated error."""
    if "unit" in one:
        return _absolute_scatter(one, text)
    scatter = f"The relative scatter of the velocities of sample {name}"
    value, error = 100.0 * one["value"], 100.0 * one["standard_error"]
    if one["source"] == "assumed":
        return f"{scatter} is assumed, {value:.3g} %: too few readings tell it."
    return _estimated(f"{scatter}, {with_error(value, error)} %", one)


def _estimated(scatter: str, one: dict[str, Any]) -> str:
    """The sentence about a scatter, in words with its value, that repeats or residuals tell."""
    source = "repeats" if one["source"] == "repeats" else "their residuals"
    return (
        f"{scatter}, is estimated from {source}, with {one['degrees_of_freedom']:.3g} degrees of "
        "freedom: errors of fitted values follow from it, and intervals are those of Student's "
        "distribution."
    )


def _runs(text: Callable[[str], str], one: dict[str, Any]) -> str:
    """The sentence about the runs test of readings without a stated error."""
    changes = one["runs"] - 1
    said = (
        f"The residuals of the {one['readings']} readings of the {spelled(one['observable'])}"
        f"{_whose(text, one)} change sign {changes} time{'s' if changes != 1 else ''}; "
        f"noise does so as seldom with p {by_chance(one['p_value'])}"
    )
    return (
        f"{said}: the model misses their shape." if one["p_value"] < TOO_FEW_BELOW else f"{said}."
    )


def _whose(text: Callable[[str], str], one: dict[str, Any]) -> str:
    """The sample of a measurement; nothing of a simulator's."""
    return "" if one["sample"] is None else f" of sample {text(one['sample'])}"


def misfit_in_words(result: dict[str, Any], language: Language = TERMINAL) -> list[str]:
    """Sentences about a misfit, or about agreement that proves nothing; none about another fit."""
    if result["degrees_of_freedom"] <= 0 and not result["misfit"]:
        values, numbers = len(result["parameters"]), len(result["predictions"])
        return [
            f"{values} value{'s' if values > 1 else ''} from {numbers} number"
            f"{'s' if numbers > 1 else ''}: that agreement proves nothing."
        ]
    if not result["misfit"]:
        return []
    lines = [_misfit(result)]
    if result["stands_out"]:
        rows = [result["predictions"][place] for place in result["stands_out"]]
        said = "; ".join(_far_off(row, result["data_as_understood"], language.text) for row in rows)
        lines.append(f"Farthest off: {said}.")
    lines += [f"{language.text(one[:1].upper() + one[1:])}." for one in result["advice"]]
    return [*lines, TRY]


def _far_off(
    one: dict[str, Any], files: dict[str, dict[str, Any]], text: Callable[[str], str]
) -> str:
    """A reading that stands out, as its file has it.

    Args:
      one: the prediction of it.
      files: records of how files were read, by sample and table.
      text: escapes names.
    """
    table = "velocities" if "concentration" in one else one.get("table")
    file = files.get(f"{one['sample']}, {table}" if table else one["sample"], {})
    row = "" if one["row"] is None else f", {file.get('row_word', 'row')} {one['row']}"
    at = when(one)
    if "time_s" in one and file and not table:
        at = f" at {one['time_s'] / TIME_UNITS[file['time_unit']]:.6g} {file['time_unit']}"
    sample = "" if one["sample"] is None else f"sample {text(one['sample'])}, "
    off = (one["predicted"] - one["measured"]) / one["sigma"]
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    return (
        f"{sample}{spelled(one['observable'])}{at}{row}: {one['measured']:.4g}{unit} "
        f"measured, {one['predicted']:.4g} predicted, {abs(off):.3g} standard deviations"
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


def line(one: dict[str, Any]) -> str:
    """A prediction of `forecasts`, as a sentence."""
    text = (
        f"{one['sample']}, not fitted: {spelled(one['observable'])}{when(one)} "
        f"{with_error(one['predicted'], one['predicted_error'])} {one['unit']} predicted"
    )
    if not np.isfinite(one["measured"]):
        return f"{text}."
    return f"{text}, {one['measured']:g} ± {one['sigma']:g} measured{off(one, ' ({})')}."
