"""The forward models by name.

Each takes a sample, the suspension it is prepared for, a seed, the names of the varied parameters,
and a folder that stores a simulated bed. It gives a function from a `Suspension` to predictions in
SI units. Work that does not depend on the varied parameters is done once.
"""

from calibrate.models.closed_form import closed_form
from calibrate.models.column import column
from calibrate.models.particles import particles
from calibrate.models.prediction import ForwardModelMaker
from calibrate.models.quick_column import quick_column
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
"""For each model a cheap one with nearly the same predictions, which a search runs thousands of
times."""

HOLD_EVERYWHERE: tuple[ForwardModelMaker, ...] = (closed_form, column)
"""Models that hold far from the values they are prepared for, too."""


def cheap_model(make: ForwardModelMaker, costly: bool = False) -> ForwardModelMaker | None:
    """The cheap model of a forward model; None for a user's own model.

    Args:
      make: the forward model.
      costly: True if a sample has particles of several sizes, or a bed that yields: `column` then
        solves for the layers of its tube.
    """
    if costly and make is column:
        return quick_column
    return next((cheap for expensive, cheap in CHEAP.items() if expensive is make), None)


def forward_model(model: str | ForwardModelMaker) -> ForwardModelMaker:
    """The forward model of a name; a function is returned as it is.

    Raises:
      InputError: no such model.
    """
    if not isinstance(model, str):
        return model
    if model not in FORWARD_MODELS:
        raise InputError(f"model = {model!r}: must be one of {', '.join(FORWARD_MODELS)}")
    return FORWARD_MODELS[model]
