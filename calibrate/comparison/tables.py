"""A comparison of models as plain tables, as sentences, and as Markdown."""

from pathlib import Path
from typing import Any

import numpy as np

from calibrate.comparison.compare import (
    ASKED_FOR,
    NOT_NEEDED,
    NOT_TRIED,
    UNDECIDED,
    Candidate,
    Comparison,
    Verdict,
)
from calibrate.comparison.deciding import Reading, deciding_readings
from mrjax.core.text import in_code, in_markdown
from mrjax.io import files
from mrjax.io.versions import versions

FLOCCULATED = 10.0
"""Exponent of Richardson and Zaki above which particles settle as flocs."""


def tables(comparison: Comparison) -> dict[str, Any]:
    """The comparison as plain tables: the contents of `compare.json`."""
    return {
        "experiment": comparison.experiment.name,
        "readings": int(comparison.best.fit.residuals.size),
        "errors": comparison.experiment.errors,
        "error_scale": comparison.error_scale,
        "best": comparison.best.name,
        "decided": comparison.decided,
        "effects": {verdict.effect.name: _effect(verdict) for verdict in comparison.verdicts},
        "models": [_model(comparison, one) for one in comparison.candidates],
        "failures": dict(comparison.failures),
        "versions": versions(),
    }


def write(comparison: Comparison, folder: str | Path) -> dict[str, Any]:
    """Writes `compare.json` and `compare.md` to a folder, and gives the tables.

    Raises:
      SystemRefusal: the system refuses a file.
    """
    folder, result = files.result_folder(Path(folder)), tables(comparison)
    files.write_json(folder / "compare.json", result)
    files.write_text(folder / "compare.md", markdown(result))
    return result


def in_words(result: dict[str, Any]) -> list[str]:
    """The verdicts in sentences, one a line, from `tables`."""
    lines = [_verdict(name, row) for name, row in result["effects"].items()]
    for name, row in result["effects"].items():
        lines += [_deciding(name, reading) for reading in row["deciding_readings"]]
        if row["verdict"] == UNDECIDED and not (row["unfitted"] or row["deciding_readings"]):
            lines.append(
                f"No longer or taller tube, and no dilution by half, would decide on {name}: the "
                "two models predict nearly the same there, too."
            )
    if result["error_scale"] > 1.0:
        lines.append(
            f"No model fits within the stated errors; they are taken {result['error_scale']:.3g} "
            "times as large here. An effect that is none of these may be missing."
        )
    plain = next((row for row in result["models"] if not row["effects"]), None)
    exponent = None if plain is None else plain["values"].get("f_w.exponent")
    if exponent is not None and exponent > FLOCCULATED:
        lines.append(
            f"The plain model has an exponent of {exponent:.3g}, and hard spheres have about 5: "
            "the particles settle as flocs, whether or not flocs are a further value of the fit."
        )
    return lines


def markdown(result: dict[str, Any]) -> str:
    """The comparison as Markdown, from `tables`."""
    words = "\n\n".join(in_markdown(line) for line in in_words(result))
    rows = "\n".join(_row(row) for row in result["models"])
    values = "\n".join(
        f"- {in_markdown(row['name'])}: "
        + ", ".join(f"{in_code(name)} = {value:.4g}" for name, value in row["values"].items())
        for row in result["models"]
    )
    failures = "".join(
        f"\n{in_markdown(name)} was not fitted: {in_markdown(reason)}\n"
        for name, reason in result["failures"].items()
    )
    return f"""# {in_markdown(result["experiment"])}: which effects do the data ask for?

{words}

## Models

| model | chi-squared | fitted values | BIC above the best | left out, above the best |
| --- | --- | --- | --- | --- |
{rows}

BIC is the deviance with a penalty of ln N for each fitted value, N = {result["readings"]} readings.
*Left out* is the deviance of readings that are each predicted from all others. A model is preferred
from a difference of {4:g} in BIC, if readings that are left out prefer it, too.
{failures}
## Fitted values

{values}
"""


def _effect(verdict: Verdict) -> dict[str, Any]:
    # No reading decides against a model that was not fitted.
    undecided = verdict.word == UNDECIDED and not verdict.unfitted
    return {
        "verdict": verdict.word,
        "what": verdict.effect.remark,
        "bic_gain": verdict.gain,
        "left_out_gain": verdict.left_out_gain,
        "left_out_gain_error": verdict.left_out_error,
        "best_with": None if verdict.best_with is None else verdict.best_with.name,
        "best_without": None if verdict.best_without is None else verdict.best_without.name,
        "reason": verdict.reason,
        "unfitted": verdict.unfitted,
        "deciding_readings": [
            reading._asdict() for reading in (deciding_readings(verdict) if undecided else [])
        ],
    }


def _model(comparison: Comparison, candidate: Candidate) -> dict[str, Any]:
    best = comparison.best.evidence
    evidence = candidate.evidence
    usable = candidate.usable
    parameters = candidate.problem.experiment.parameters
    return {
        "name": candidate.name,
        "effects": [effect.name for effect in candidate.effects],
        "converged": usable,
        "chi_squared": evidence.chi_squared,
        "deviance": evidence.deviance,
        "parameters": evidence.parameters,
        "bic": evidence.bic,
        "bic_above_best": evidence.bic - best.bic if usable else np.nan,
        "left_out": float(evidence.left_out.sum()),
        "left_out_above_best": float(np.sum(evidence.left_out - best.left_out))
        if usable
        else np.nan,
        "values": {
            parameter.label: float(parameter.value(x))
            for parameter, x in zip(parameters, candidate.fit.values, strict=True)
        },
    }


def _row(row: dict[str, Any]) -> str:
    if not row["converged"]:
        return f"| {in_markdown(row['name'])} | did not converge | {row['parameters']} | | |"
    return (
        f"| {in_markdown(row['name'])} | {row['chi_squared']:.3g} | {row['parameters']} | "
        f"{row['bic_above_best']:.1f} | {row['left_out_above_best']:+.1f} |"
    )


def _verdict(name: str, row: dict[str, Any]) -> str:
    """The sentence on one effect."""
    label = name[0].upper() + name[1:]
    if row["verdict"] == NOT_TRIED:
        return f"{label}: not tried; {row['reason']}."
    gain = f"BIC {abs(row['bic_gain']):.1f} {'better' if row['bic_gain'] > 0 else 'worse'} with it"
    if row["verdict"] == ASKED_FOR:
        return f"{label}: the data ask for it ({gain}); {row['what']}."
    if row["verdict"] == NOT_NEEDED:
        return f"{label}: the data do not need it ({gain})."
    return f"{label}: the data do not decide ({gain}); {row['reason']}."


def _deciding(name: str, reading: dict[str, Any] | Reading) -> str:
    """The sentence on a reading that would decide."""
    row = reading if isinstance(reading, dict) else reading._asdict()
    return (
        f"To decide on {name}, read {row['text']}: {row['having']:.4g} {row['unit']} with it, "
        f"{row['lacking']:.4g} {row['unit']} without, {row['deviations']:.1f} standard deviations "
        "apart."
    )
