"""The numbers that `mrjax simulate` writes: summary.json and curve.csv."""

from typing import Any

import jax

import mrjax
from mrjax import ContactNetwork, Run, Sedimentation
from mrjax.cli import provenance
from mrjax.cli.simulate.run import Plan, Result
from mrjax.laws import dimensionless
from mrjax.observables import packing


def made_by(plan: Plan) -> dict[str, Any]:
    """Returns the provenance: lab sheet, seed, versions and, for a run to rest, the overlap."""
    request = plan.request
    origin = provenance.made_by(plan.sheet, request.seed, request.dtype)
    return origin | ({"overlap_radii": request.overlap} if request.to_rest else {})


def dimensionless_numbers(plan: Plan, result: Result) -> tuple[dimensionless.Number, ...]:
    """Returns the dimensionless numbers of the suspension at its simulated velocity."""
    return dimensionless.numbers(plan.parameters, result.velocity, plan.sheet.temperature)


def summary(plan: Plan, result: Result, made_by: dict[str, Any]) -> dict[str, Any]:
    """Returns the content of summary.json, without the wall time."""
    sheet, run = plan.sheet, result.run
    numbers = dimensionless_numbers(plan, result)
    return {
        "recipe": sheet.name,
        "settling_velocity_mm_per_day": mrjax.MM_PER_DAY * result.velocity,
        "closed_form_mm_per_day": mrjax.MM_PER_DAY
        * mrjax.terminal_velocity(plan.parameters).mean(),
        **{f"{number.name.lower()}_number": number.value for number in numbers},
        "particles": result.initial.state.particles,
        "volume_fraction": sheet.volume_fraction,
        "coated_volume_fraction": sheet.coated_volume_fraction,
        "f_w": sheet.f_w,
        "f_w_is_local": sheet.drag.local,
        "f_s": sheet.f_s,
        "f_v": sheet.drag.f_v,
        "f_r": sheet.radius_factor,
        **({} if result.to_rest is None else _at_rest(result.to_rest)),
        "duration_s": float(run.times.max()),
        "time_step_s": run.time_step,
        "steps": run.steps,
        "deepest_overlap_radii": run.deepest_overlap.max(),
        "deepest_overlap_coatings": run.coating_overlap.max(),
        "notes": plan.notes,
        "warnings": dimensionless.warnings(numbers),
        "steady": plan.steady,
        **made_by,
    }


def curve(result: Result) -> dict[str, Any]:
    """Returns the columns of curve.csv."""
    if result.to_rest is None:
        return _run_curve(result.initial)
    return _ensemble_curve(result.to_rest)


def _run_curve(run: Run) -> dict[str, Any]:
    return {
        "time_s": run.times,
        "mudline_m": run.mudline,
        "sedimentation_ratio": mrjax.sedimentation_ratio(run),
        "mean_velocity_m_per_s": run.mean_velocity,
    }


def _ensemble_curve(whole: Sedimentation) -> dict[str, Any]:
    """Returns means over the starts, with the standard error of the ratio for several starts."""
    columns = {
        "time_s": whole.run.times[0],
        "mudline_m": whole.run.mudline.mean(axis=0),
        "sedimentation_ratio": whole.ratio().mean(axis=0),
        "mean_velocity_m_per_s": whole.run.mean_velocity.mean(axis=0),
    }
    if len(whole.seeds) > 1:
        columns["standard_error_of_ratio"] = mrjax.standard_error(whole.ratio())
    return columns


def _at_rest(whole: Sedimentation) -> dict[str, Any]:
    """Returns the numbers that a run to rest adds to the summary."""
    final = {name: whole.ratio(name)[:, -1] for name in mrjax.HEIGHTS}
    # jit compiles one program for each; without it there would be some 400.
    lines = jax.jit(jax.vmap(mrjax.asymptotes))(whole.run)

    return {
        "final_ratio": final["top"].mean(),
        "final_ratio_standard_error": mrjax.standard_error(final["top"]),
        "final_ratios": final["top"],
        "final_ratio_by_height": {name: values.mean() for name, values in final.items()},
        "initial_slope_mm_per_day": mrjax.MM_PER_DAY * lines.initial_slope.mean(),
        "asymptotes_cross_at_s": lines.crossing_time.mean(),
        "speed_at_rest_over_initial": (
            whole.run.mean_speed[:, -1] / whole.run.mean_speed.max(axis=1)
        ).max(),
        **_packings(whole),
        "softening": whole.softening,
        "ensemble": len(whole.seeds),
    }


def _packings(whole: Sedimentation) -> dict[str, Any]:
    """Returns the numbers of the beds at rest, as means over the starts."""
    beds = []
    for start in range(len(whole.seeds)):
        run = jax.tree.map(lambda leaf, start=start: leaf[start], whole.run)
        network = mrjax.contact_network(run.state, whole.parameters, run.box)
        largest = mrjax.cluster_sizes(network)[0] / network.particles
        beds.append(_packing(run, network) | {"largest_cluster": largest})
    means = {key: float(sum(bed[key] for bed in beds) / len(beds)) for key in beds[0]}
    return means | {"bed": packing.name(means["bed_fraction"])}


@jax.jit
def _packing(run: Run, network: ContactNetwork) -> dict[str, jax.Array]:
    """Returns the numbers of one bed, by one compiled program."""
    bed, numbers = mrjax.bed_packing(run, network), mrjax.coordination(network)
    return {
        "coordination_number": numbers.mean,
        "coordination_without_rattlers": numbers.mean_without_rattlers,
        "rattlers": numbers.rattlers,
        "bed_fraction": bed.volume_fraction,
        "bed_openness": bed.openness,
        "vertical_contact_stress_pa": mrjax.stress_tensor(network)[2, 2],
        "vertical_contacts": mrjax.fabric_tensor(network)[2, 2],
    }
