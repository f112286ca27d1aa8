"""GrainLearning on data from stdin, in an environment of its own: it needs numpy < 2.

Reads {"fractions", "bounds": {name: [least, most]}, "data": [[...], ...]}; writes what it states of
each data set. Settings as in the example of its class `BayesianCalibration`: ten samples, one
component, a target for the effective sample size of 0.3; ten iterations at most.
"""

import contextlib
import json
import os
import sys

import numpy as np
from grainlearning import BayesianCalibration
from grainlearning.dynamic_systems import DynamicSystem

SAMPLES, ITERATIONS = 10, 10


def calibrated(fractions: np.ndarray, bounds: dict, data: list[float], seed: int) -> dict:
    runs = 0

    def run(calibration) -> None:
        nonlocal runs
        found = []
        for v_0, f_s, n in calibration.system.param_data:
            found.append([v_0 / f_s * (1 - fractions) ** n])
            runs += 1
        calibration.system.set_sim_data(found)

    np.random.seed(seed)
    tool = BayesianCalibration.from_dict(
        {
            "num_iter": ITERATIONS,
            "callback": run,
            "system": {
                "system_type": DynamicSystem,
                "model_name": "settling",
                "param_names": list(bounds),
                "param_min": [low for low, _ in bounds.values()],
                "param_max": [high for _, high in bounds.values()],
                "num_samples": SAMPLES,
                "obs_data": data,
                "ctrl_data": fractions.tolist(),
                "obs_names": ["velocity"],
                "ctrl_name": "fraction",
            },
            "inference": {
                "Bayes_filter": {"ess_target": 0.3},
                "sampling": {"max_num_components": 1, "random_state": seed},
            },
            "save_fig": -1,
        }
    )
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        tool.run()
    values = tool.system.param_data.T  # (3, samples)
    values = np.vstack([values, values[0] / values[1]])
    weights = np.asarray(tool.inference.posterior)
    mean = values @ weights
    stated = np.sqrt((values - mean[:, None]) ** 2 @ weights)
    last = np.asarray(tool.system.estimated_params)[-1]
    np.testing.assert_allclose(mean[:3], last, rtol=1e-6)
    return {"runs": runs, "mean": mean.tolist(), "deviation": stated.tolist()}


def main() -> None:
    given = json.load(sys.stdin)
    fractions = np.asarray(given["fractions"])
    found = [
        calibrated(fractions, given["bounds"], data, seed)
        for seed, data in enumerate(given["data"])
    ]
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
