"""Argument checks of the ways to run, on concrete values."""

import dataclasses
import math
from numbers import Real
from typing import Any

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.core.box import AXES, LARGEST, SMALLEST, Box
from mrjax.core.errors import InputError, shown
from mrjax.core.parameters import Parameters
from mrjax.core.state import State
from mrjax.core.tracing import value_or_none

MOST = 2**31 - 1
"""Largest number of anything that is counted."""

INSTEAD = {
    "State": "a state of particles, from mrjax.place or mrjax.disperse",
    "Parameters": "mrjax.Parameters, such as recipe.parameters()",
    "Box": "mrjax.Box((x, y, z)), in m",
    "Recipe": 'mrjax.Recipe, such as mrjax.Recipe.load("case2")',
    "Run": "a run, from mrjax.simulate or mrjax.settle",
}
"""Remedy where something of another kind was given, by the name of the kind."""


def of_kind(kind: type, **arguments: Any) -> None:
    """Passes arguments that are of a kind: not those that were swapped.

    Args:
      kind: one of `INSTEAD`.
      arguments: by name.

    Raises:
      InputError: the first that is something else.
    """
    for name, value in arguments.items():
        if not isinstance(value, kind):
            given = f"{name} is {type(value).__module__}.{type(value).__qualname__}, {shown(value)}"
            raise InputError(f"{given.removeprefix('builtins.')}: give {INSTEAD[kind.__name__]}")


def good(run: Any) -> None:
    """Passes a run whose numbers may be read.

    Raises:
      InputError: it is no run.
      SimulationError: it is not to be trusted.
    """
    check = getattr(run, "check", None)
    if check is None or isinstance(run, type):
        raise InputError(f"run is {type(run).__name__}, {shown(run)}: give {INSTEAD['Run']}")
    check()


def of_run(state: Any, parameters: Any, box: Any) -> None:
    """Passes what a run begins with.

    Raises:
      InputError: the first that is of another kind.
    """
    of_kind(State, state=state)
    of_kind(Parameters, parameters=parameters)
    of_kind(Box, box=box)


def numeric(value: Any) -> np.ndarray | None:
    """A number or an array of numbers as numpy has it; None where it is traced.

    Raises:
      ValueError: it is none.
    """
    try:
        known = value_or_none(value)
    except (TypeError, OverflowError) as error:  # such as an integer of hundreds of digits
        raise ValueError(error) from None
    if known is not None and known.dtype.kind not in "fiu":
        raise ValueError(f"{type(value).__name__} is no number")
    return known


def positive(value: ArrayLike, name: str, unit: str) -> float:
    """A positive number that is known.

    Raises:
      InputError: it is traced, or not a positive number.
    """
    try:
        known = numeric(value)
    except ValueError:
        raise InputError(f"{name} = {shown(value)} must be a positive number of {unit}") from None
    if known is None:
        raise InputError(
            f"{name} is traced by jit or vmap; it fixes the number of steps, so give a number in "
            f"{unit}"
        )
    if known.ndim or not np.isfinite(known) or known <= 0:
        raise InputError(f"{name} = {shown(value)} must be a positive number of {unit}")
    if not SMALLEST <= known <= LARGEST:
        raise InputError(
            f"{name} = {float(known):.6g}: must be between {SMALLEST:g} and {LARGEST:g} {unit}"
        )
    return float(known)


def whole(value: int, name: str, most: int = MOST) -> int:
    """A whole number, at least 1.

    Raises:
      InputError: it is not, or more than `most`.
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or value != value or not value >= 1 or (value <= most and int(value) != value):
        raise InputError(f"{name} = {shown(value)} must be a whole number, at least 1")
    if value > most:
        raise InputError(f"{name} = {shown(value)}: more than {most}; give fewer")
    return int(value)


def share(value: float, name: str, *, whole: bool = False) -> float:
    """A number above 0 and below 1, or up to 1.

    Raises:
      InputError: it is not.
    """
    bound = "at most 1" if whole else "below 1"
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not 0.0 < value <= 1.0 or (value == 1.0 and not whole):
        raise InputError(f"{name} = {shown(value)} must be a number above 0 and {bound}")
    return float(value)


def meaningful(
    parameters: Parameters, particles: int, material: Array | None, *, contacts: bool = True
) -> None:
    """Refuses leaves that describe nothing, where they are known.

    Args:
      parameters: of the particles.
      particles: N.
      material: of each particle, (N,); None if they are of one.
      contacts: whether particles may meet; otherwise what only contacts use may be unknown.

    Raises:
      InputError: the first leaf of a shape that does not fit, or out of its range.
    """
    index = None if material is None else value_or_none(material)
    if material is not None and material.shape != (particles,):
        raise InputError(f"materials have shape {material.shape}; give one for each particle")
    materials = 1 if material is None else None if index is None else int(index.max()) + 1
    for quantity in dataclasses.fields(parameters):
        leaf = getattr(parameters, quantity.name)
        values = _numbers(leaf, quantity.name)
        if quantity.metadata["pair"]:
            _table(leaf, quantity.name, materials, material is None)
        elif quantity.metadata["wall"]:
            if np.shape(leaf) != ():
                raise InputError(
                    f"{quantity.name} has shape {np.shape(leaf)}; all walls are of one material: "
                    "give one number"
                )
        elif np.shape(leaf) not in ((), (particles,)):
            raise InputError(
                f"{quantity.name} has shape {np.shape(leaf)}; give one number, or one for each of "
                f"the {particles} particles"
            )
        if values is None or (np.isnan(values).all() and quantity.metadata["contact"] > contacts):
            continue
        _in_range(quantity, values)


def in_range(parameters: Parameters) -> None:
    """Refuses leaves that are no numbers or out of their range, where they are known.

    Raises:
      InputError: the first such leaf.
    """
    for quantity in dataclasses.fields(parameters):
        values = _numbers(getattr(parameters, quantity.name), quantity.name)
        if values is not None:
            _in_range(quantity, values)


def _numbers(leaf: Any, name: str) -> np.ndarray | None:
    """The values of a leaf; None where it is traced.

    Raises:
      InputError: they are no numbers.
    """
    if isinstance(leaf, list | tuple):
        raise InputError(f"{name} is a list; give a number or an array")
    try:
        return numeric(leaf)
    except ValueError:
        raise InputError(f"{name} = {shown(leaf)}: give a number or an array of numbers") from None


def _in_range(quantity: dataclasses.Field, values: np.ndarray) -> None:
    """Refuses values of a leaf that mean nothing.

    Raises:
      InputError: the first such value.
    """
    values = np.asarray(values, float)  # float32 cannot hold the bounds
    above, least, most = (quantity.metadata[key] for key in ("above", "least", "most"))
    good = (values > above) & (values >= least) & (values <= most)
    if quantity.metadata["contact"] and np.isnan(values).any():
        raise InputError(
            f"{quantity.name} is not known (nan), and particles in contact need it; give it in "
            f"{quantity.metadata['unit']}, or a material to the particles of the lab sheet"
        )
    if not np.all(good):
        bound = f"above {above:g}" if np.isfinite(above) else "finite"
        bound = f"at least {least:g}" if np.isfinite(least) else bound
        bound += f", at most {most:g}" if most < 1e300 else ""
        unit = quantity.metadata["unit"]
        raise InputError(
            f"{quantity.name} = {values[~good][0] if values.ndim else values} must be {bound}"
            + (f", in {unit}" if unit != "1" else "")
        )
    size = np.abs(values)
    # What may be zero may be as small as it likes.
    extreme = (size > LARGEST) & ~(np.isinf(values) & math.isinf(most))
    extreme |= (size < SMALLEST) & (above == 0.0)
    if np.any(extreme):
        raise InputError(
            f"{quantity.name} = {values[extreme][0] if values.ndim else values}: no quantity "
            f"in {quantity.metadata['unit']} is so large or small; give one between "
            f"{SMALLEST:g} and {LARGEST:g}"
        )


def _table(leaf: ArrayLike, name: str, materials: int | None, one: bool) -> None:
    """Refuses what is neither one number nor a table of materials, the walls last.

    Args:
      leaf, name: of the parameter.
      materials: how many there are at least; None where that is traced.
      one: whether all particles are of one material, and have no index into a larger table.
    """
    shape = np.shape(leaf)
    if shape == ():
        return
    square = len(shape) == 2 and shape[0] == shape[1] and shape[0] >= 2
    if not square or (materials is not None and shape[0] <= materials) or (one and shape[0] > 2):
        wanted = "" if materials is None else f", here {(materials + 1,) * 2}"
        raise InputError(
            f"{name} has shape {shape}; give one number, or a table with a row and a column for "
            f"each material and a last one for the walls{wanted}"
        )
    values = value_or_none(leaf)
    if values is None:
        return
    for i, j in np.argwhere(values != values.T):
        raise InputError(
            f"{name}[{i}, {j}] = {values[i, j]:g} and {name}[{j}, {i}] = {values[j, i]:g}: the "
            "same two materials; give a symmetric table"
        )


def in_reach(state: State) -> None:
    """Refuses positions, velocities and spins so large that they cannot be computed with.

    Raises:
      InputError: the first particle that has one, in m, m/s or rad/s.
    """
    for name in ("position", "velocity", "spin"):
        values = value_or_none(getattr(state, name))
        if values is None:
            continue
        beyond = np.isfinite(values) & (np.abs(values) > LARGEST)
        for row, axis in np.argwhere(beyond):
            raise InputError(
                f"particle {row} has {name} {values[row, axis]:.4g} along {AXES[axis]}: give less "
                f"than {LARGEST:g}, in SI"
            )


def inside_walls(position: np.ndarray | None, box: Box) -> None:
    """Refuses particles whose centre is beyond a wall; positions (N, 3) in m, None if traced.

    Raises:
      InputError: the first such particle.
    """
    if position is None:
        return
    for axis in box.walled_axes:
        for row in np.flatnonzero((position[:, axis] < 0) | (position[:, axis] > box.size[axis])):
            raise InputError(
                f"particle {row} is at {AXES[axis]} = {position[row, axis]:.4g} m, outside the "
                f"walls at 0 and {box.size[axis]:.4g} m; move it inside or make the axis periodic"
            )


def between_walls(box: Box, diameter: float) -> None:
    """Refuses walls so close that a particle of this diameter, m, would touch both at once.

    Raises:
      InputError: the first such axis.
    """
    for axis in box.walled_axes:
        if box.size[axis] <= diameter:
            raise InputError(
                f"box size = {box.size[axis]:.4g} m along {AXES[axis]} is not larger than a "
                f"particle of {diameter:.4g} m; give a larger box"
            )


def wide_enough(box: Box, particles: int, cutoff: float) -> None:
    """Refuses a periodic axis on which two images of one neighbour are within the cutoff, m.

    Raises:
      InputError: the first such axis.
    """
    for axis in set(range(3)) - set(box.walled_axes):
        if particles > 1 and box.size[axis] < 2 * cutoff:
            raise InputError(
                f"box size = {box.size[axis]:.4g} m along {AXES[axis]} is periodic but too narrow: "
                "a particle could touch two images of one neighbour, of which the list holds only "
                f"the nearest; give at least {2 * cutoff:.4g} m, or walls"
            )


def may_touch(
    position: np.ndarray | None,
    radius: np.ndarray | None,
    box: Box,
    travel: float | None,
    diameter: float,
) -> bool:
    """True if surfaces may come into contact while they approach each other by `travel`, m.

    True where positions, (N, 3) in m, radius or travel are traced, None, or where a position is not
    finite. `radius` is () or (N,), in m; `diameter`, m, is about the largest contact diameter.
    """
    if position is None or radius is None or travel is None or not np.isfinite(position).all():
        return True
    radius = np.broadcast_to(radius, position.shape[:1])
    for axis in box.walled_axes:
        nearest = np.minimum(position[:, axis], box.size[axis] - position[:, axis])
        if np.any(nearest - radius <= travel):
            return True
    if len(position) == 1:
        return False
    reach = max(diameter, 2.0 * float(radius.max())) + travel
    if reach > min(box.size):
        return True
    side = np.where(box.periodic, box.size, 0.0)  # no side for axes that end in walls
    wrapped = box.inside(np.asarray(position, float), below=True)
    from scipy.spatial import KDTree  # a third of a second, which most calls need not spend

    tree = KDTree(wrapped, boxsize=side)
    distance, partner = map(np.asarray, tree.query(wrapped, k=2))
    if np.any(distance[:, 1] - radius - radius[partner[:, 1]] <= travel):
        return True
    # Of unequal spheres the nearest need not be the first to touch; here few others are in reach.
    near = tree.sparse_distance_matrix(tree, reach, output_type="ndarray")
    near = near[near["i"] < near["j"]]
    return bool(np.any(near["v"] - radius[near["i"]] - radius[near["j"]] <= travel))
