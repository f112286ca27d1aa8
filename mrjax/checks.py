"""What can be said against a call of `simulate` before it runs; concrete values only."""

import dataclasses
from numbers import Real

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from mrjax.box import AXES, Box
from mrjax.concrete import concrete
from mrjax.errors import InputError
from mrjax.parameters import Parameters


def positive(value: ArrayLike, name: str, unit: str) -> float:
    """A positive number that is known.

    Raises:
      InputError: it is traced, or not a positive number.
    """
    known = concrete(value)
    if known is None:
        raise InputError(
            f"{name} is traced by jit or vmap; it fixes the number of steps, so give a number in "
            f"{unit}"
        )
    if known.ndim or known.dtype.kind not in "fiu" or not np.isfinite(known) or known <= 0:
        raise InputError(f"{name} = {value} must be a positive number of {unit}")
    return float(known)


def whole(value: int, name: str) -> int:
    """A whole number, at least 1.

    Raises:
      InputError: it is not.
    """
    number = isinstance(value, Real) and not isinstance(value, bool)
    if not number or not np.isfinite(value) or int(value) != value or value < 1:
        raise InputError(f"{name} = {value} must be a whole number, at least 1")
    return int(value)


def meaningful(parameters: Parameters, particles: int, material: Array | None) -> None:
    """Refuses leaves that describe nothing, where they are known.

    Raises:
      InputError: the first leaf of a shape that does not fit, or out of its range.
    """
    index = None if material is None else concrete(material)
    if material is not None and material.shape != (particles,):
        raise InputError(f"materials have shape {material.shape}; give one for each particle")
    materials = 1 if material is None else None if index is None else int(index.max()) + 1
    for quantity in dataclasses.fields(parameters):
        leaf = getattr(parameters, quantity.name)
        if isinstance(leaf, list | tuple):
            raise InputError(f"{quantity.name} is a list; give a number or an array")
        if quantity.metadata["pair"]:
            _table(leaf, quantity.name, materials, material is None)
        elif np.shape(leaf) not in ((), (particles,)):
            raise InputError(
                f"{quantity.name} has shape {np.shape(leaf)}; give one number, or one for each of "
                f"the {particles} particles"
            )
        values = concrete(leaf)
        if values is None:
            continue
        values = np.asarray(values, float)  # float32 cannot hold the bounds
        above, least, most = (quantity.metadata[key] for key in ("above", "least", "most"))
        good = (values > above) & (values >= least) & (values <= most)
        if not np.all(good):
            bound = f"above {above:g}" if np.isfinite(above) else "finite"
            bound = f"at least {least:g}" if np.isfinite(least) else bound
            bound += f", at most {most:g}" if most < 1e300 else ""
            unit = quantity.metadata["unit"]
            raise InputError(
                f"{quantity.name} = {values[~good][0] if values.ndim else values} must be {bound}"
                + (f", in {unit}" if unit != "1" else "")
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
    values = concrete(leaf)
    if values is None:
        return
    for i, j in np.argwhere(values != values.T):
        raise InputError(
            f"{name}[{i}, {j}] = {values[i, j]:g} and {name}[{j}, {i}] = {values[j, i]:g}: the "
            "same two materials; give a symmetric table"
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
    position: np.ndarray | None, radius: np.ndarray, box: Box, travel: float, diameter: float
) -> bool:
    """Whether surfaces may come into contact while they approach each other by `travel`, m.

    True where positions, (N, 3) in m, or the travel are traced or not finite. `radius` is () or
    (N,), in m; `diameter`, m, is about the largest contact diameter.
    """
    if position is None or np.isnan(travel) or not np.isfinite(position).all():
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
    wrapped = np.asarray(position, float)
    wrapped = wrapped - side * np.floor(wrapped / np.where(side > 0.0, side, np.inf))
    wrapped = np.where((side > 0.0) & (wrapped >= side), 0.0, wrapped)  # by rounding
    from scipy.spatial import KDTree  # a third of a second, which most calls need not spend

    tree = KDTree(wrapped, boxsize=side)
    distance, partner = map(np.asarray, tree.query(wrapped, k=2))
    if np.any(distance[:, 1] - radius - radius[partner[:, 1]] <= travel):
        return True
    # Of unequal spheres the nearest need not be the first to touch; here few others are in reach.
    near = tree.sparse_distance_matrix(tree, reach, output_type="ndarray")
    near = near[near["i"] < near["j"]]
    return bool(np.any(near["v"] - radius[near["i"]] - radius[near["j"]] <= travel))
