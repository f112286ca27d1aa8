"""Final beds as Son (2018) made them: the dispersed particles dropped without a fluid.

Section 3.1: "a settling simulation excluding hydrodynamic interactions for computational
efficiency". Neither friction, restitution nor stiffness of that run is printed.
"""

from collections.abc import Iterable
from pathlib import Path

import mrjax
from mrjax.core.box import Box
from mrjax.core.run import Run
from mrjax.recipe.recipe import Recipe

INFERRED_FRICTION = 0.2
"""Friction coefficient that the paper does not give, inferred: beds between walls have the printed
final ratios of both samples within 1.2 points, by the top of the highest particle; 0.3 does as well
(six starts each, `tests/studies/settling/README.md`)."""

ELASTIC_MODULUS = 1e7
"""Modulus of particles and walls, Pa: the deepest impact is then 0.3 % of a radius."""
RESTITUTION = 0.5
"""Its value hardly matters: the height of a bed changes by about a point from 0.1 to 0.9."""
TIME_STEP, LONGEST = 5e-8, 0.05
"""s, s."""
REST, REST_WITHOUT_FRICTION = 3e-4, 5e-3
"""Mean speed at which a bed rests, over that of a free fall. Without friction loose particles roll
on for long: LIGGGHTS' beds were left, after 9 ms, at 1e-3 to 1e-2 of it."""


def dropped(
    recipe: Recipe,
    seeds: Iterable[int],
    friction: float = INFERRED_FRICTION,
    periodic: bool = False,
    progress: bool = False,
    checkpoint: Path | None = None,
) -> Run:
    """Lets the recipe's particles fall in a vacuum until their bed rests.

    Args:
      recipe: the lab sheet; its fluid and its surfaces' friction and stiffness are not used.
      seeds: of the M random starts, one run for each.
      friction: Coulomb's coefficient between particles and on the walls.
      periodic: whether the sides of the box are periodic images in place of walls.
      progress: whether to show progress bars, on standard error.
      checkpoint: folder that keeps the runs as they go, as for `mrjax.settle`.

    Returns:
      All runs, each of the arrays with a leading axis (M, ...).

    Raises:
      SimulationError: a bed that does not come to rest, or a run not to be trusted.
    """
    if periodic:
        recipe = recipe.model_copy(update={"box": Box(recipe.box.size, (True, True, False))})
    parameters = recipe.parameters().replace(
        elastic_modulus=ELASTIC_MODULUS,
        wall_elastic_modulus=ELASTIC_MODULUS,
        viscosity=0.0,
        fluid_density=0.0,
        friction=friction,
        restitution=RESTITUTION,
    )
    return mrjax.settle(
        [mrjax.disperse(recipe, seed) for seed in seeds],
        parameters,
        recipe.box,
        time_step=TIME_STEP,
        rest=REST if friction > 0.0 else REST_WITHOUT_FRICTION,
        longest=LONGEST,
        progress=progress,
        checkpoint=checkpoint,
    )
