"""The forward models by name.

Each takes a sample, the suspension near which it will be asked, a seed, the names of what will
vary, and a folder that keeps a bed as it is simulated; it gives a function of a `Suspension` to
predictions in SI units. What does not depend on what varies is done once.
"""

from calibrate.models.closed_form import closed_form
from calibrate.models.column import column
from calibrate.models.particles import particles
from calibrate.models.prediction import ForwardModelMaker
from mrjax import InputError

FORWARD_MODELS: dict[str, ForwardModelMaker] = {
    "closed-form": closed_form,
    "column": column,
    "particles": particles,
}
"""The forward models by the names of the command line."""

CHEAP: dict[ForwardModelMaker, ForwardModelMaker] = {
    closed_form: closed_form,
    column: column,
    particles: closed_form,
}
"""For each, one that predicts nearly the same at no cost: a search asks it thousands of times."""

HOLD_EVERYWHERE: tuple[ForwardModelMaker, ...] = (closed_form, column)
"""Those that hold far from where they are prepared, too."""


def cheap_model(make: ForwardModelMaker) -> ForwardModelMaker | None:
    """The cheap model of another; None of a user's own."""
    return next((cheap for expensive, cheap in CHEAP.items() if expensive is make), None)


def forward_model(model: str | ForwardModelMaker) -> ForwardModelMaker:
    """A forward model by its name, or as it is given.

    Raises:
      InputError: no such model.
    """
    if not isinstance(model, str):
        return model
    if model not in FORWARD_MODELS:
        raise InputError(f"model = {model!r}: must be one of {', '.join(FORWARD_MODELS)}")
    return FORWARD_MODELS[model]
