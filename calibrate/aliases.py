"""Old names of modules, so that old imports keep working.

`import calibrate.fitted` and `from calibrate.fitted import Fitted` give the module that took over.
New code uses the new names.
"""

OLD_NAMES = {
    "chains": "inference.chains",
    "curve": "experiment.curve",
    "data": "experiment.experiment",
    "diagnostics": "inference.diagnostics",
    "experiments": "experiment.bundled",
    "fit": "least_squares.fit",
    "fitted": "experiment.free_parameters",
    "forecast": "inference.forecast",
    "identify": "inference.identify",
    "levenberg": "least_squares.levenberg",
    "meaningful": "experiment.physical_bounds",
    "misfit": "inference.misfit",
    "plots": "report.figures",
    "posterior": "inference.posterior",
    "predict": "models.forward_models",
    "profile": "inference.profile",
    "residuals": "problem.problem",
    "sense": "experiment.plausibility",
    "suspension": "experiment.suspension",
    "units": "experiment.units",
    "waiting": "least_squares.interruptible",
}
"""Current name within the package, by old name."""
FUNCTIONS = ("fit", "identify")
"""Old names of modules that are also functions of the package; the function has priority."""
