"""Options that `simulate`, `follow` and `settle` share: one set, documented once."""

import dataclasses
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypedDict, TypeVar

from mrjax.dem.forces import Force
from mrjax.laws.hindrance import Hindrance

F = TypeVar("F", bound=Callable)


@dataclass(frozen=True)
class RunOptions:
    """Options of a run: the keywords that `simulate`, `follow` and `settle` share.

    Args:
      time_step: longest step, s; it is shortened so that the steps fill the frames. The default is
        `mrjax.time_step(parameters)` (Eq. 29), or less if contacts are strongly damped. If nothing
        can touch before the end, the default leaves out t_c. For `settle` it is a step at which a
        random bed under its weight is stable. No derivative goes through the step.
      skin: reach of the neighbour list beyond contact, as a fraction of the contact diameter.
      rebuild_every: number of steps after which the list is checked, and rebuilt if need be; by
        default so few that no particle crosses the skin in between.
      capacity: room in the neighbour list of each particle; by default for a random close packing.
      cell_capacity: room in a search cell of the list; by default for a random close packing.
      hindrance: f_w for volume fractions, such as `recipe.hindrance` or
        `lambda phi: (1 - phi) ** -4.65`. Each particle then has the f_w of its own height
        (`mrjax.laws.hindrance`) in place of that of the parameters.
      forces: the forces on the particles, such as `[mrjax.Gravity(), mrjax.Contact()]` and forces
        of your own (`mrjax.PairForce`, `mrjax.BodyForce`); by default gravity, contact and,
        where the parameters have coefficients of them, attraction and magnetic dipoles. Drag is
        part of the integrator.
      trajectory: whether to record all positions, velocities and spins (`Run.trajectory`).
      progress: whether to show a progress bar, on standard error (plain calls).
    """

    time_step: float | None = None
    skin: float = 0.1
    rebuild_every: int | None = None
    capacity: int | None = None
    cell_capacity: int | None = None
    hindrance: Hindrance | None = None
    forces: Sequence[Force] | None = None
    trajectory: bool = False
    progress: bool = False


class RunKeywords(TypedDict, total=False):
    """The fields of `RunOptions` as keywords, for type checkers."""

    time_step: float | None
    skin: float
    rebuild_every: int | None
    capacity: int | None
    cell_capacity: int | None
    hindrance: Hindrance | None
    forces: Sequence[Force] | None
    trajectory: bool
    progress: bool


def takes_run_options(function: F) -> F:
    """Shows the shared options in the signature of a function, in place of `**options`."""
    signature = inspect.signature(function)
    own = [
        parameter
        for parameter in signature.parameters.values()
        if parameter.kind is not parameter.VAR_KEYWORD
    ]
    shared = [
        inspect.Parameter(
            field.name, inspect.Parameter.KEYWORD_ONLY, default=field.default, annotation=field.type
        )
        for field in dataclasses.fields(RunOptions)
    ]
    function.__signature__ = signature.replace(parameters=own + shared)  # type: ignore[attr-defined] # read by inspect
    return function
