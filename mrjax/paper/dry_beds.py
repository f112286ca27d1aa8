"""Final beds as in Son (2018): the dispersed particles are dropped without a fluid.

Section 3.1: "a settling simulation excluding hydrodynamic interactions for computational
efficiency". The paper gives neither friction, restitution nor stiffness of that simulation.
"""

from collections.abc import Iterable
from pathlib import Path

import mrjax
from mrjax.core.box import Box
from mrjax.core.run import Run
from mrjax.recipe.recipe import Recipe

INFERRED_FRICTION = 0.2
"""Friction coefficient inferred here, because the paper gives none. Beds between walls then have
the printed final ratios of both samples within 1.2 points, by the top of the highest particle; 0.3
does as well (six starts each, `tests/studies/settling/README.md`)."""

ELASTIC_MODULUS = 1e7
"""Modulus of particles and walls, Pa, with which the largest overlap is 0.3 % of a radius."""
RESTITUTION = 0.5
"""Coefficient of restitution. From 0.1 to 0.9 the height of a bed changes by about a point only."""
TIME_STEP, LONGEST = 5e-8, 0.05
"""Step and longest duration, s."""
REST, REST_WITHOUT_FRICTION = 3e-4, 5e-3
"""Mean speed below which a bed is at rest, over that of a free fall. Without friction, loose
particles roll on for long: beds of LIGGGHTS had 1e-3 to 1e-2 of it after 9 ms."""


def dropped(
    recipe: Recipe,
    seeds: Iterable[int],
    friction: float = INFERRED_FRICTION,
    periodic: bool = False,
    progress: bool = False,
    checkpoint: Path | None = None,
) -> Run:
    """Simulates the particles of a recipe falling in a vacuum until their bed is at rest.

    Args:
      recipe: lab sheet, whose fluid, friction and stiffness are not used.
      seeds: seeds of the M random starts, one run for each.
      friction: Coulomb's coefficient between particles and on the walls.
      periodic: True for a box with periodic sides in place of walls.
      progress: True to show progress bars on standard error.
      checkpoint: folder for a checkpoint, as for `mrjax.settle`.

    Returns:
      All runs, with a leading axis of M in every array.

    Raises:
      SimulationError: a bed does not come to rest, or a run has a fault.
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
