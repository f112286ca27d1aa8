"""What a fit found: JSON for programs, Markdown and one HTML page for people."""

import base64
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from markdown_it import MarkdownIt
from matplotlib.figure import Figure
from tqdm import tqdm

from calibrate.experiment.free_parameters import FreeParameter
from calibrate.experiment.units import CURVES, TIME_UNITS
from calibrate.inference.forecast import Forecast
from calibrate.inference.identify import (
    WITHOUT_PRIOR,
    Identification,
    covariance,
    expression,
    information,
)
from calibrate.inference.misfit import agreement
from calibrate.inference.posterior import Posterior
from calibrate.inference.profile import LEVELS, Profile
from calibrate.least_squares.fit import Fit
from calibrate.least_squares.programs import pseudo_huber
from calibrate.problem.problem import Problem
from calibrate.report.figures import spelled
from mrjax import Parameters, terminal_velocity
from mrjax.core.text import in_code, in_html, in_markdown, in_terminal
from mrjax.io import files
from mrjax.laws import dimensionless

SMALLEST_P = 1e-12
"""Below which a p-value says nothing more."""
FASTER = 2.0
"""How many times faster than one of its particles alone a suspension may fall as fitted."""

MADE_BY = ("experiment", "lab_sheets", "model", "seed", "dtype", "versions")
"""What of a result is told in the metadata of its figures, too."""
PIXELS_PER_INCH = 144
"""Of figures on the page."""


class Language(NamedTuple):
    """What names of samples and of values are put into."""

    text: Callable[[str], str]
    code: Callable[[str], str]


MARKDOWN = Language(in_markdown, in_code)
TERMINAL = Language(in_terminal, lambda name: f"`{in_terminal(name)}`")


SAID = {
    "carried_by_priors_alone": (
        "The individual value of {} is carried by the prior alone.",
        "The individual values of {} are carried by the priors alone.",
    ),
    "informed_by_data": (
        "The data narrow what the prior says of {}, and do not determine it.",
        "The data narrow what the priors say of {}, and do not determine them.",
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
KINK = (
    "the optimum is where slopes jump, as where a mudline meets its bed at the time of a "
    "measurement: it was found without slopes, and errors and intervals are those of one side"
)


def summary(
    problem: Problem,
    fit: Fit,
    found: Identification,
    predicted: np.ndarray,
    profiles: tuple[Profile, ...] = (),
    samples: Posterior | None = None,
) -> dict[str, Any]:
    """Everything a fit found, as plain tables. `predicted` is `problem.predict`, (M,)."""
    agreed = agreement(problem, fit, found, predicted)
    labels = {one.variable: one.label for one in problem.experiment.parameters}
    open_values: dict[str, list[str]] = {key: [] for key in SAID}
    for name in fit.names:
        if not found.determined[name]:
            open_values[_why_open(found, name)].append(labels[name])
    validity_of = {
        sample.name: _validity(problem.experiment.suspension_of(sample, fit.theta).parameters)
        for sample in problem.experiment.samples
    }
    return {
        "converged": fit.converged,
        "on_a_kink": fit.on_a_kink,
        "parameters": _parameters(problem, fit, found, profiles, samples),
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
        "weak_combinations": list(found.weak_combinations),
        **open_values,
        "predictions": _predictions(problem, fit, predicted),
        "validity": {
            name: {one.name: {"value": one.value, "holds": one.holds} for one in numbers}
            for name, numbers in validity_of.items()
        },
        "warnings": [
            *problem.experiment.warnings,
            *(
                f"sample {name}: {warning}"
                for name, numbers in validity_of.items()
                for warning in dimensionless.warnings(numbers)
            ),
            *_too_fast(problem, fit),
        ],
        "notes": [
            f"sample {sample.name}: {note}"
            for sample in problem.experiment.samples
            for note in sample.recipe.notes
        ]
        + [KINK] * fit.on_a_kink
        + _at_bounds(problem, fit),
        "chi_squared": fit.chi_squared,
        "degrees_of_freedom": agreed.degrees_of_freedom,
        "reduced_chi_squared": agreed.reduced_chi_squared,
        "p_value": agreed.p_value,
        "residuals_over_range": agreed.share,
        "misfit": agreed.misfit,
        "contradicts": agreed.contradicts,
        "errors": "stated",
        "error_scale": agreed.error_scale,
        "robust": fit.robust,
        "singular_values": found.singular_values,
        "model_runs": fit.model_runs,
        "other_optima": [
            {"half_sum_of_squares": loss, "values": dict(zip(fit.names, values, strict=True))}
            for loss, values in fit.other_optima
        ],
        "posterior": None
        if samples is None
        else {
            "converged": samples.converged,
            "r_hat": samples.r_hat.max(),
            "effective_samples": samples.effective.min(),
            "divergences": samples.divergences,
        },
    }


def _why_open(found: Identification, name: str) -> str:
    """Of a value that is not determined: which of `SAID` is said of it."""
    if found.status[name] == "informed":
        return "informed_by_data"
    if not np.isfinite(found.standard_errors[name]):
        return "undetermined"
    by_data_alone = found.status[name] == "free" and np.isfinite(found.data_standard_errors[name])
    return "loosely_bounded" if by_data_alone else "carried_by_priors_alone"


def _too_fast(problem: Problem, fit: Fit) -> Iterator[str]:
    """Of samples that fall faster as fitted than one of their particles would alone."""
    for sample in problem.experiment.samples:
        parameters = problem.experiment.suspension_of(sample, fit.theta).parameters
        drag = float(np.mean(parameters.f_w * parameters.f_s * parameters.f_v))
        if drag * FASTER < 1.0:
            yield (
                f"sample {sample.name}: as fitted it falls {1.0 / drag:.3g} times faster than one "
                f"of its particles alone, f_w f_s f_v = {drag:.3g}: flocs, or check units, "
                "viscosity and diameter"
            )


def _at_bounds(problem: Problem, fit: Fit) -> list[str]:
    """Of values that end where they would lose their meaning."""
    logs, labels = np.log(fit.values), problem.experiment.parameters
    lower, upper = np.broadcast_arrays(*fit.box, logs)[:2]
    return [
        f"{one.label} ended at {one.value(x):.4g}, the last value that has a meaning"
        for one, x, log, low, high in zip(labels, fit.values, logs, lower, upper, strict=True)
        if min(log - low, high - log) < 1e-9
    ]


def _validity(parameters: Parameters) -> tuple[dimensionless.Number, ...]:
    """Of a suspension that falls as fitted."""
    return dimensionless.numbers(parameters, terminal_velocity(parameters))


def _parameters(
    problem: Problem,
    fit: Fit,
    found: Identification,
    profiles: tuple[Profile, ...],
    samples: Posterior | None,
) -> dict[str, dict[str, Any]]:
    """Of every fitted value, in its own unit, by label."""
    profile_of = {one.name: one for one in profiles}
    table = {}
    for place, one in enumerate(problem.experiment.parameters):
        x = fit.values[place]
        row = {
            "value": one.value(x),
            "standard_error": found.standard_errors[one.variable] * one.per_log(x) / x,
            "determined": found.determined[one.variable],
            "status": found.status[one.variable],
            "data_standard_error": found.data_standard_errors[one.variable],
            "samples": list(one.samples),
            "prior_median": one.median,
            "prior_log_standard_deviation": one.log_standard_deviation,
            "bounds": one.bounds,
            "profile": None,
            "posterior": None,
        }
        if one.variable in profile_of:
            row["profile"] = {
                coverage: [_at_end(one, end) for end in ends]
                for coverage, ends in profile_of[one.variable].intervals.items()
            }
        if samples is not None:
            drawn = one.value(samples.samples[:, place])
            row["posterior"] = {
                "median": np.median(drawn),
                "standard_deviation": drawn.std(),
                **{f"{q:g} %": np.percentile(drawn, q) for q in (2.5, 16, 84, 97.5)},
            }
        table[one.label] = row
    return table


def _at_end(one: FreeParameter, x: float) -> float:
    if np.isfinite(x):
        return float(one.value(x))
    return one.bounds[1] if one.bounds else np.inf


def _predictions(problem: Problem, fit: Fit, predicted: np.ndarray) -> list[dict[str, Any]]:
    """A line for each measurement, both in its unit."""
    spreads = np.array([one.standard_deviation for _, one in problem.measurements])
    exponents = fit.jacobian * (spreads / predicted)[:, None]
    known, _ = covariance(information(fit))
    slopes = fit.jacobian
    if (longest := fit.robust) is not None:  # back from how residuals count to what they are
        of = jnp.asarray((predicted - problem.measured) / spreads)
        counts = jax.vmap(jax.grad(lambda one: pseudo_huber(one, longest)))(of)
        slopes = slopes / np.asarray(counts)[:, None]
    errors = spreads * np.sqrt(np.einsum("mp,pq,mq->m", slopes, known, slopes))
    return [
        {
            "sample": sample.name,
            "observable": one.observable,
            "measured": one.value,
            "sigma": one.standard_deviation,
            "predicted": value,
            "predicted_error": error,
            "unit": one.unit,
            **({} if one.place is None else {"time_s": sample.times[one.place]}),
            **(
                {"varies_as": expression(fit.names, np.round(row, 6))}
                if one.place is None and fit.robust is None
                else {}
            ),
        }
        for (sample, one), value, error, row in zip(
            problem.measurements, predicted, errors, exponents, strict=True
        )
    ]


def in_words(result: dict[str, Any], language: Language = TERMINAL) -> list[str]:
    """What the data determine and what they do not, a sentence a line."""
    text, code = language
    parameters, combinations = result["parameters"], result["determined_combinations"]
    lines = [_misfit(result)] if result["misfit"] else []
    lines += [
        f"The {spelled(one['observable'])} of sample {text(one['sample'])} varies as "
        f"{text(one['varies_as'])}: only that product of powers can be read from it."
        for one in result["predictions"]
        if one.get("varies_as", "1") != "1"
    ]
    lines.append(
        f"Of the {len(parameters)} fitted values the data determine {len(combinations)} "
        f"independent combination{'s' if len(combinations) != 1 else ''}"
        f"{':' if combinations else '.'}"
    )
    lines += [
        f"- {code(one['expression'])} = {_with_error(one['value'], one['standard_error'])}"
        for one in combinations
    ]
    lines += [
        f"{code(f'odds({label})')} is ({text(label)} - {one['bounds'][0]:g}) / "
        f"({one['bounds'][1]:g} - {text(label)}), which runs from 0 to infinity."
        for label, one in parameters.items()
        if one["bounds"]
    ]
    lines += [
        f"No measurement says anything of {code(direction)} near this fit: changing it there, with "
        "the combinations above held, changes no prediction."
        for direction in result["null_directions"]
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
    return lines


def _misfit(result: dict[str, Any]) -> str:
    """How far the data are from the model."""
    p = "" if result["p_value"] is None else f", p {by_chance(result['p_value'])}"
    return (
        f"The data do not agree with the model, or with each other: chi-squared is "
        f"{result['chi_squared']:.3g} for {len(result['predictions'])} measurements, "
        f"{result['reduced_chi_squared']:.3g} for each degree of freedom{p}; residuals are "
        f"{result['residuals_over_range']:.2g} of the range of the readings. Stated errors would "
        f"have to be {result['error_scale']:.3g} times as large."
    )


def by_chance(p: float) -> str:
    """A p-value, as it follows the letter."""
    return f"= {p:.2g}" if p > SMALLEST_P else f"< {SMALLEST_P:g}"


def markdown(name: str, model: str, result: dict[str, Any], figures: dict[str, Figure]) -> str:
    """The report of a fit."""

    def shown(*names: str) -> str:
        return "\n".join(f"![{name}]({name}.png)" for name in names if name in figures)

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
    if result["other_optima"]:
        verdict += f" {len(result['other_optima'])} of the starts ended in worse optima."
    predictions = files.markdown_table(
        ["sample", "observable", "measured", "predicted", "unit", "difference / sigma"],
        (
            [
                one["sample"],
                spelled(one["observable"]) + _when(one),
                f"{one['measured']:g} ± {one['sigma']:g}",
                _with_error(one["predicted"], one["predicted_error"]),
                one["unit"],
                f"{(one['predicted'] - one['measured']) / one['sigma']:+.2f}",
            ]
            for one in result["predictions"]
        ),
    )
    parameters = files.markdown_table(
        ["parameter", "one value for", "fitted", *LEVELS, "prior", "posterior", "determined"],
        (
            [
                in_code(label),
                f"sample{'s' if len(one['samples']) > 1 else ''} {', '.join(one['samples'])}",
                _fitted(one),
                *(_range(one["profile"], coverage) for coverage in LEVELS),
                _prior(one),
                _sampled(one["posterior"]),
                _determined(one),
            ]
            for label, one in result["parameters"].items()
        ),
    )
    numbers = files.markdown_table(
        ["sample", "number", "as fitted", "the model holds"],
        (
            [sample, name, f"{number['value']:.2g}", number["holds"]]
            for sample, of_sample in result["validity"].items()
            for name, number in of_sample.items()
        ),
    )
    beyond = "".join(f"\n**Warning:** {in_markdown(warning)}.\n" for warning in result["warnings"])
    notes = "".join(f"\nNote: {in_markdown(note)}.\n" for note in result["notes"])
    said = in_words(result, MARKDOWN)
    words = "\n".join(line if line.startswith("-") else f"\n{line}" for line in said)
    return f"""# {in_markdown(name)}, fitted with the {model} model

{verdict} chi-squared {result["chi_squared"]:.3g} from {len(result["predictions"])} measurements
and {result["degrees_of_freedom"]} degrees of freedom; {result["model_runs"]} model runs,
{result["wall_seconds"]:.0f} s.

## Predicted against measured

{predictions}
{shown("predictions", "curves", "residuals")}

## What the data determine
{words}

## Fitted values

{parameters}
Errors are one standard deviation; of the values, data and priors together; of the combinations,
the data alone. Intervals are those of the profile likelihood. A prior's second number is the factor
of one standard deviation. A fitted drag factor is a calibration constant: what the recipe leaves
out, such as flocculation or a spread of sizes, is in it.

{shown("profiles", "posterior")}
{_of_samples(result["posterior"])}{_left_out(result.get("left_out", []))}{_new(result.get("new"))}
## Where the model holds

{numbers}{beyond}
## The search

{shown("loss")}

The search looks for the valley; Levenberg-Marquardt finishes it, or on a kink a simplex.
{notes}"""


def write(
    folder: Path,
    text: str,
    result: dict[str, Any],
    figures: dict[str, Figure],
    pdf: bool,
    progress: bool = False,
) -> None:
    """Writes `fit.json`, `report.md` with its figures, and `report.html` with all in one file.

    `progress`: whether to show a progress bar, on standard error.
    """
    files.write_json(folder / "fit.json", result)
    files.write_text(folder / "report.md", text)
    made_by = {name: result[name] for name in MADE_BY}
    page = _html(f"{result['experiment']}, fitted with the {result['model']} model", text)
    for name, figure in tqdm(figures.items(), desc="figures", disable=not progress, leave=False):
        files.write_figure(folder, name, figure, made_by, pdf)
        image = base64.b64encode((folder / f"{name}.png").read_bytes()).decode("ascii")
        # So wide that the figure's letters are as large as those of the page.
        width = round(PIXELS_PER_INCH * figure.get_figwidth())
        page = page.replace(
            f'src="{name}.png"', f'src="data:image/png;base64,{image}" width="{width}"'
        )
    files.write_text(folder / "report.html", page)


def _html(title: str, text: str) -> str:
    """The report as a page."""
    renderer = MarkdownIt("commonmark", {"html": False}).enable("table")
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{in_html(title)}</title>
<style>
body {{ font: 16px/1.5 sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }}
table {{ border-collapse: collapse; }}
td, th {{ border-bottom: 1px solid #ccc; padding: 0.2rem 0.8rem; text-align: left; }}
img {{ max-width: 100%; }}
</style></head>
<body>
{renderer.render(text)}</body>
</html>
"""


def forecasts(found: list[Forecast]) -> list[dict[str, Any]]:
    """Predictions of samples that were not fitted, as plain tables."""
    return [
        {
            "sample": one.sample,
            "observable": one.measurement.observable,
            "measured": one.measurement.value,
            "sigma": one.measurement.standard_deviation,
            "predicted": one.predicted,
            "predicted_error": one.standard_error,
            "unit": one.measurement.unit,
            "difference_over_both_errors": one.off,
            **({} if one.time is None else {"time_s": one.time}),
        }
        for one in found
    ]


def line(one: dict[str, Any]) -> str:
    """A prediction of `forecasts`, as a sentence."""
    text = (
        f"{one['sample']}, not fitted: {spelled(one['observable'])}{_when(one)} "
        f"{_with_error(one['predicted'], one['predicted_error'])} {one['unit']} predicted"
    )
    if not np.isfinite(one["measured"]):
        return f"{text}."
    return f"{text}, {one['measured']:g} ± {one['sigma']:g} measured{_off(one, ' ({})')}."


def _off(one: dict[str, Any], form: str = "{}") -> str:
    """How far a prediction is off; nothing where zero was measured."""
    if not one["measured"]:
        return ""
    return form.format(f"{one['predicted'] / one['measured'] - 1:+.0%}")


def _left_out(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return ""
    table = files.markdown_table(
        ["sample", "observable", "measured", "predicted", "unit", "error", "difference / errors"],
        (
            [
                one["sample"],
                spelled(one["observable"]) + _when(one),
                f"{one['measured']:g} ± {one['sigma']:g}",
                _with_error(one["predicted"], one["predicted_error"]),
                one["unit"],
                _off(one),
                f"{one['difference_over_both_errors']:+.2f}",
            ]
            for one in rows
        ),
    )
    return f"""
## Each sample predicted from the others

What only this sample would tell is taken from its prior.

{table}"""


def _new(rows: list[dict[str, Any]] | None) -> str:
    if not rows:
        return ""
    table = files.markdown_table(
        ["recipe", "observable", "predicted", "unit"],
        (
            [
                one["sample"],
                spelled(one["observable"]) + _when(one),
                _with_error(one["predicted"], one["predicted_error"]),
                one["unit"],
            ]
            for one in rows
        ),
    )
    return f"\n## A new recipe\n\n{table}"


def _of_samples(posterior: dict[str, Any] | None) -> str:
    if posterior is None:
        return ""
    verdict = (
        "The samples of the posterior agree between chains"
        if posterior["converged"]
        else "**The samples of the posterior have not converged: do not use them**"
    )
    return (
        f"{verdict} (R-hat {posterior['r_hat']:.3f}, {posterior['effective_samples']:.0f} "
        f"effective samples, {posterior['divergences']} divergences).\n"
    )


def _when(one: dict[str, Any]) -> str:
    return (
        f" at {one['time_s'] / TIME_UNITS['day']:.4g} days" if one["observable"] in CURVES else ""
    )


def _range(profile: dict[str, list[float]] | None, coverage: str) -> str:
    if profile is None:
        return "unbounded"
    low, high = profile[coverage]
    return f"{low:.4g} to {high:.4g}"


def _prior(one: dict[str, Any]) -> str:
    spread = one["prior_log_standard_deviation"]
    within = f", {one['bounds'][0]:g} to {one['bounds'][1]:g}" if one["bounds"] else ""
    if spread is None:
        return f"none{within}"
    return f"{one['prior_median']:g}, {np.exp(spread):.3g}{within}"


def _determined(one: dict[str, Any]) -> str:
    if one["determined"]:
        return "yes"
    if one["status"] == "free":
        by_prior = np.isinf(one["data_standard_error"]) and np.isfinite(one["standard_error"])
        return "no, prior only" if by_prior else "no, free"
    return f"no, {one['status']}"


def _fitted(one: dict[str, Any]) -> str:
    """A value with its error: as a factor, where that is as large as the value."""
    error = one["data_standard_error"]
    loose = one["status"] == "free" and WITHOUT_PRIOR < error < np.inf and not one["bounds"]
    if loose and np.isfinite(one["standard_error"]):
        return f"{one['value']:.3g}, within a factor of {np.exp(error):.3g}"
    return _with_error(one["value"], one["standard_error"])


def _sampled(posterior: dict[str, float] | None) -> str:
    if posterior is None:
        return ""
    return _with_error(posterior["median"], posterior["standard_deviation"])


def _with_error(value: float, error: float) -> str:
    """Value and error with two digits of the error."""
    if not np.isfinite(error):
        return f"{value:.4g} (error unbounded)"
    if error == 0.0:  # such as the height before anything has settled
        return f"{value:.4g}"
    digits = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{digits}f} ± {error:.{digits}f}"
