"""Argument checks of the functions that run a simulation, on concrete values."""

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

LARGEST_COUNT = 2**31 - 1
"""Largest count of particles, steps or frames."""

REMEDIES = {
    "State": "a state of particles, from mrjax.place or mrjax.disperse",
    "Parameters": "mrjax.Parameters, such as recipe.parameters()",
    "Box": "mrjax.Box((x, y, z)), in m",
    "Recipe": 'mrjax.Recipe, such as mrjax.Recipe.load("case2")',
    "Run": "a run, from mrjax.simulate or mrjax.settle",
}
"""Remedy for an argument of the wrong class, by the name of the right class."""


def require_class(cls: type, **arguments: Any) -> None:
    """Checks the class of arguments, so that swapped arguments are found.

    Args:
      cls: class that `REMEDIES` names.
      arguments: values by name.

    Raises:
      InputError: an argument is of another class; the message names the first.
    """
    for name, value in arguments.items():
        if not isinstance(value, cls):
            fault = f"{name} is {type(value).__module__}.{type(value).__qualname__}, {shown(value)}"
            raise InputError(f"{fault.removeprefix('builtins.')}: give {REMEDIES[cls.__name__]}")


def require_good_run(run: Any) -> None:
    """Checks that the argument is a run without faults.

    Raises:
      InputError: the argument is no run.
      SimulationError: the run has a fault.
    """
    check = getattr(run, "check", None)
    if check is None or isinstance(run, type):
        raise InputError(f"run is {type(run).__name__}, {shown(run)}: give {REMEDIES['Run']}")
    check()


def require_run_inputs(state: Any, parameters: Any, box: Any) -> None:
    """Checks the classes of the three arguments that every run needs.

    Raises:
      InputError: an argument is of another class; the message names the first.
    """
    require_class(State, state=state)
    require_class(Parameters, parameters=parameters)
    require_class(Box, box=box)


def numeric(value: Any) -> np.ndarray | None:
    """Returns a number or an array of numbers as a numpy array; None if it is traced.

    Raises:
      ValueError: the value is no number.
    """
    try:
        array = value_or_none(value)
    except (TypeError, OverflowError) as error:  # such as an integer of hundreds of digits
        raise ValueError(error) from None
    if array is not None and array.dtype.kind not in "fiu":
        raise ValueError(f"{type(value).__name__} is no number")
    return array


def positive(value: ArrayLike, name: str, unit: str) -> float:
    """Checks a positive number and returns it as a float.

    Raises:
      InputError: the value is traced, or no positive number.
    """
    try:
        number = numeric(value)
    except ValueError:
        raise InputError(f"{name} = {shown(value)} must be a positive number of {unit}") from None
    if number is None:
        raise InputError(
            f"{name} is traced by jit or vmap; it fixes the number of steps, so give a number in "
            f"{unit}"
        )
    if number.ndim or not np.isfinite(number) or number <= 0:
        raise InputError(f"{name} = {shown(value)} must be a positive number of {unit}")
    if not SMALLEST <= number <= LARGEST:
        raise InputError(
            f"{name} = {float(number):.6g}: must be between {SMALLEST:g} and {LARGEST:g} {unit}"
        )
    return float(number)


def whole(value: int, name: str, most: int = LARGEST_COUNT) -> int:
    """Checks a whole number, at least 1, and returns it as an int.

    Raises:
      InputError: the value is no such number, or more than `most`.
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or value != value or not value >= 1 or (value <= most and int(value) != value):
        raise InputError(f"{name} = {shown(value)} must be a whole number, at least 1")
    if value > most:
        raise InputError(f"{name} = {shown(value)}: more than {most}; give fewer")
    return int(value)


def fraction(value: float, name: str, *, allow_one: bool = False) -> float:
    """Checks a number above 0 and below 1, or up to 1, and returns it as a float.

    Raises:
      InputError: the value is no such number.
    """
    bound = "at most 1" if allow_one else "below 1"
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not 0.0 < value <= 1.0 or (value == 1.0 and not allow_one):
        raise InputError(f"{name} = {shown(value)} must be a number above 0 and {bound}")
    return float(value)


def refuse_bad_parameters(
    parameters: Parameters, particles: int, material: Array | None, *, contacts: bool = True
) -> None:
    """Refuses leaves with a wrong shape or a value out of range; traced values pass unchecked.

    Args:
      parameters: parameters of the particles.
      particles: number of particles N.
      material: material of each particle, (N,); None if all are of one material.
      contacts: True if particles may touch; otherwise leaves that only contacts use may be NaN.

    Raises:
      InputError: a leaf has a wrong shape or is out of range; the message names the first.
    """
    index = None if material is None else value_or_none(material)
    if material is not None and material.shape != (particles,):
        raise InputError(f"materials have shape {material.shape}; give one for each particle")
    materials = 1 if material is None else None if index is None else int(index.max()) + 1
    for quantity in dataclasses.fields(parameters):
        leaf = getattr(parameters, quantity.name)
        if leaf is None and quantity.metadata["optional"]:
            continue
        values = _numbers(leaf, quantity.name)
        if quantity.metadata["pair"]:
            _refuse_table(leaf, quantity.name, materials, material is None)
        elif quantity.metadata["wall"]:
            if np.shape(leaf) != ():
                raise InputError(
                    f"{quantity.name} has shape {np.shape(leaf)}; all walls are of one material: "
                    "give one number"
                )
        elif quantity.metadata["vector"]:
            if np.shape(leaf) != (3,):
                raise InputError(
                    f"{quantity.name} has shape {np.shape(leaf)}; give three components, x, y, z"
                )
        elif np.shape(leaf) not in ((), (particles,)):
            raise InputError(
                f"{quantity.name} has shape {np.shape(leaf)}; give one number, or one for each of "
                f"the {particles} particles"
            )
        if values is None or (np.isnan(values).all() and quantity.metadata["contact"] > contacts):
            continue
        _refuse_values(quantity, values)


def refuse_out_of_range(parameters: Parameters) -> None:
    """Refuses leaves that are no numbers or out of range; traced values pass unchecked.

    Raises:
      InputError: there is such a leaf; the message names the first.
    """
    for quantity in dataclasses.fields(parameters):
        leaf = getattr(parameters, quantity.name)
        if leaf is None and quantity.metadata["optional"]:
            continue
        values = _numbers(leaf, quantity.name)
        if values is not None:
            _refuse_values(quantity, values)


def _numbers(leaf: Any, name: str) -> np.ndarray | None:
    """Returns the values of a leaf as a numpy array; None if it is traced.

    Raises:
      InputError: the values are no numbers.
    """
    if isinstance(leaf, list | tuple):
        raise InputError(f"{name} is a list; give a number or an array")
    try:
        return numeric(leaf)
    except ValueError:
        raise InputError(f"{name} = {shown(leaf)}: give a number or an array of numbers") from None


def _refuse_values(quantity: dataclasses.Field, values: np.ndarray) -> None:
    """Refuses values of a leaf that are out of its range.

    Raises:
      InputError: there is such a value; the message shows the first.
    """
    values = np.asarray(values, float)  # float32 cannot hold the bounds
    above, least, most = (quantity.metadata[key] for key in ("above", "least", "most"))
    valid = (values > above) & (values >= least) & (values <= most)
    if quantity.metadata["contact"] and np.isnan(values).any():
        raise InputError(
            f"{quantity.name} is not known (nan), and particles in contact need it; give it in "
            f"{quantity.metadata['unit']}, or give the particles of the lab sheet a material"
        )
    if not np.all(valid):
        bound = f"above {above:g}" if np.isfinite(above) else "finite"
        bound = f"at least {least:g}" if np.isfinite(least) else bound
        bound += f", at most {most:g}" if most < 1e300 else ""
        unit = quantity.metadata["unit"]
        raise InputError(
            f"{quantity.name} = {values[~valid][0] if values.ndim else values} must be {bound}"
            + (f", in {unit}" if unit != "1" else "")
        )
    size = np.abs(values)
    # A quantity that may be zero has no lower bound of its size.
    extreme = (size > LARGEST) & ~(np.isinf(values) & math.isinf(most))
    extreme |= (size < SMALLEST) & (above == 0.0)
    if np.any(extreme):
        raise InputError(
            f"{quantity.name} = {values[extreme][0] if values.ndim else values}: no quantity "
            f"in {quantity.metadata['unit']} is so large or small; give one between "
            f"{SMALLEST:g} and {LARGEST:g}"
        )


def _refuse_table(leaf: ArrayLike, name: str, materials: int | None, single: bool) -> None:
    """Refuses a leaf that is neither one number nor a table by material with the walls last.

    Args:
      leaf: value of the parameter.
      name: name of the parameter.
      materials: least number of materials; None if the materials are traced.
      single: True if all particles are of one material, without an index into a larger table.
    """
    shape = np.shape(leaf)
    if shape == ():
        return
    square = len(shape) == 2 and shape[0] == shape[1] and shape[0] >= 2
    if not square or (materials is not None and shape[0] <= materials) or (single and shape[0] > 2):
        expected = "" if materials is None else f", here {(materials + 1,) * 2}"
        raise InputError(
            f"{name} has shape {shape}; give one number, or a table with a row and a column for "
            f"each material and a last one for the walls{expected}"
        )
    values = value_or_none(leaf)
    if values is None:
        return
    for i, j in np.argwhere(values != values.T):
        raise InputError(
            f"{name}[{i}, {j}] = {values[i, j]:g} and {name}[{j}, {i}] = {values[j, i]:g}: two "
            "values for the same two materials; give a symmetric table"
        )


def refuse_overflow(state: State) -> None:
    """Refuses positions, velocities and spins beyond `LARGEST`, which would overflow.

    Raises:
      InputError: there is such a value; the message names the first particle.
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


def refuse_outside(position: np.ndarray | None, box: Box) -> None:
    """Refuses particles whose centre is beyond a wall.

    Args:
      position: centres, (N, 3) in m; None if they are traced, and pass unchecked.
      box: container.

    Raises:
      InputError: there is such a particle; the message names the first.
    """
    if position is None:
        return
    for axis in box.walled_axes:
        for row in np.flatnonzero((position[:, axis] < 0) | (position[:, axis] > box.size[axis])):
            raise InputError(
                f"particle {row} is at {AXES[axis]} = {position[row, axis]:.4g} m, outside the "
                f"walls at 0 and {box.size[axis]:.4g} m; move it inside or make the axis periodic"
            )


def refuse_close_walls(box: Box, diameter: float) -> None:
    """Refuses opposite walls that a particle of this diameter, m, would touch at once.

    Raises:
      InputError: there are such walls; the message names the first axis.
    """
    for axis in box.walled_axes:
        if box.size[axis] <= diameter:
            raise InputError(
                f"box size = {box.size[axis]:.4g} m along {AXES[axis]} is not larger than a "
                f"particle of {diameter:.4g} m; give a larger box"
            )


def refuse_short_period(box: Box, particles: int, cutoff: float) -> None:
    """Refuses a periodic axis on which two images of one neighbour are within the cutoff, m.

    Raises:
      InputError: there is such an axis; the message names the first.
    """
    for axis in set(range(3)) - set(box.walled_axes):
        if particles > 1 and box.size[axis] < 2 * cutoff:
            raise InputError(
                f"box size = {box.size[axis]:.4g} m along {AXES[axis]} is periodic but too narrow: "
                "a particle could reach two images of one neighbour, of which the list holds only "
                f"the nearest; give at least {2 * cutoff:.4g} m, or walls"
            )


def may_touch(
    position: np.ndarray | None,
    radius: np.ndarray | None,
    box: Box,
    travel: float | None,
    diameter: float,
) -> bool:
    """True if surfaces may come into contact while they approach each other by `travel`.

    The answer is True, too, if a value is traced (None) or a position is not finite.

    Args:
      position: centres, (N, 3) in m.
      radius: radii, () or (N,) in m.
      box: container.
      travel: distance by which two surfaces approach each other, m.
      diameter: approximate largest contact diameter, m.
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
    side = np.where(box.periodic, box.size, 0.0)  # scipy's sign for an axis without images
    wrapped = box.inside(np.asarray(position, float), below=True)
    from scipy.spatial import KDTree  # its import takes a third of a second; few calls need it

    tree = KDTree(wrapped, boxsize=side)
    distance, partner = map(np.asarray, tree.query(wrapped, k=2))
    if np.any(distance[:, 1] - radius - radius[partner[:, 1]] <= travel):
        return True
    # The nearest of unequal spheres need not be the first to touch; few pairs are in reach here.
    pairs = tree.sparse_distance_matrix(tree, reach, output_type="ndarray")
    pairs = pairs[pairs["i"] < pairs["j"]]
    return bool(np.any(pairs["v"] - radius[pairs["i"]] - radius[pairs["j"]] <= travel))
