"""The particles in their box: shaded spheres with their true radii, in parallel projection."""

from collections.abc import Mapping
from itertools import product

import numpy as np
from jax.typing import ArrayLike
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.text import in_figure
from mrjax.figures.style import COLUMN, PAGE, STYLE

AZIMUTH, ELEVATION = np.radians(25.0), np.radians(12.0)
"""Direction of view: from the right of the front of the box, and from above."""
SUN = np.array([-0.45, 0.55, 0.70])
"""Direction of the light: to the right, up, towards the viewer."""
FINENESS = 30.0
"""Pixels per radius."""
MOST_PIXELS = 2000
"""Largest number of pixels along a side of the picture, enough for print."""


@STYLE
def particles(positions: Mapping[str, ArrayLike], radius: ArrayLike, box: Box) -> Figure:
    """Draws the particles in their box, in one panel for each moment.

    Nearer surfaces hide others and are lighter. On periodic axes, centres are wrapped into the box.

    Args:
      positions: centres by the title of the panel, (N, 3) in m, such as
        `{"dispersed": state.position, "at rest": run.state.position}`.
      radius: radius of the coated particles, () or (N,) in m, such as `run.radius`.
      box: box of the run.

    Raises:
      InputError: there are no positions, or an array has another shape.
    """
    centres = {title: np.asarray(values, float) for title, values in positions.items()}
    radius = np.asarray(radius, float)
    if not centres:
        raise InputError("positions is empty: give at least one moment")
    for title, points in centres.items():
        if points.ndim != 2 or points.shape[1] != 3 or radius.shape not in ((), points.shape[:1]):
            raise InputError(
                f"positions[{title!r}] have shape {points.shape} and radius {radius.shape}; give "
                "(N, 3), and () or (N,)"
            )
    low, high = bounds(np.asarray(box.size))
    width, height = (high - low)[:2]
    panel_width = min(COLUMN / 2, PAGE / len(centres))
    figure = Figure(
        figsize=(panel_width * len(centres), 0.2 + panel_width * height / width),
        layout="constrained",
    )
    panels = figure.subplots(1, len(centres), squeeze=False)[0]
    for axes, (title, points) in zip(panels, centres.items(), strict=True):
        draw(axes, inside(points, box), radius, np.asarray(box.size))
        axes.set_title(in_figure(title))
    return figure


def draw(
    axes: Axes,
    centres: np.ndarray,
    radius: np.ndarray,
    size: np.ndarray,
    fineness: float = FINENESS,
) -> AxesImage:
    """Draws spheres and their box.

    Args:
      axes: axes to draw in.
      centres: centres within the box, (N, 3) in m.
      radius: radii, () or (N,) in m.
      size: size of the box, (3,) in m.
      fineness: pixels per largest radius; fewer if the picture would become too large.
    """
    picture = axes.imshow(
        image(centres, radius, size, fineness),
        cmap="gray",
        vmin=0,
        vmax=1,
        origin="lower",
        extent=tuple(bounds(size)[:, :2].T.ravel()),
        zorder=1,
    )
    draw_box(axes, size)
    return picture


def draw_box(axes: Axes, size: np.ndarray) -> None:
    """Draws the edges of a box, behind and in front of its content."""
    corners = project(size * np.array(list(product((0, 1), repeat=3))))
    low, high = bounds(size)
    farthest = corners[:, 2].argmin()
    for first, second in product(range(8), repeat=2):
        # Corners are numbered in binary; an edge joins two whose numbers differ in one digit.
        if first < second and (first ^ second).bit_count() == 1:
            behind = farthest in (first, second)
            ends = corners[[first, second]]
            axes.plot(*ends[:, :2].T, "k-", linewidth=0.7, zorder=0 if behind else 3)
    margin = 0.01 * size.max()
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_aspect("equal", anchor="S")  # leaves room for the title
    axes.set_axis_off()


def inside(position: ArrayLike, box: Box) -> np.ndarray:
    """Moves positions into the box along its periodic axes; (..., 3) in m."""
    return box.inside(np.asarray(position, float))


def project(points: np.ndarray) -> np.ndarray:
    """Projects points (..., 3) on the axes of the viewer: to the right, up, towards the viewer."""
    right = [np.cos(AZIMUTH), np.sin(AZIMUTH), 0.0]
    back = [-np.sin(AZIMUTH), np.cos(AZIMUTH)]
    up = [*(np.sin(ELEVATION) * np.array(back)), np.cos(ELEVATION)]
    return points @ np.array([right, up, np.cross(right, up)]).T


def bounds(size: np.ndarray) -> np.ndarray:
    """Returns the lower and upper bounds of a box on the axes of the viewer; (2, 3)."""
    corners = project(size * np.array(list(product((0, 1), repeat=3))))
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def image(
    centres: np.ndarray, radius: np.ndarray, size: np.ndarray, fineness: float
) -> np.ma.MaskedArray:
    """Returns the shades of the foremost surfaces, (rows, columns) from 0 to 1.

    The shading is Lambert's law in parallel light, and darker with depth. Pixels without a sphere
    are masked.
    """
    centres, radius = project(centres), np.broadcast_to(radius, len(centres))
    low, high = bounds(size)
    pixel = max(radius.max() / fineness, (high - low)[:2].max() / MOST_PIXELS)
    (columns, width), (rows, height) = (
        (count, length / count)
        for length, count in ((length, int(np.ceil(length / pixel))) for length in (high - low)[:2])
    )
    x = low[0] + (np.arange(columns) + 0.5) * width
    y = low[1] + (np.arange(rows) + 0.5) * height
    front, shades = np.full((rows, columns), -np.inf), np.zeros((rows, columns))
    sun = SUN / np.linalg.norm(SUN)
    for centre, r in zip(centres, radius, strict=True):
        covered_x = slice(*np.searchsorted(x, (centre[0] - r, centre[0] + r)))
        covered_y = slice(*np.searchsorted(y, (centre[1] - r, centre[1] + r)))
        normal_x = (x[None, covered_x] - centre[0]) / r
        normal_y = (y[covered_y, None] - centre[1]) / r
        square = 1.0 - normal_x**2 - normal_y**2
        normal_z = np.sqrt(np.maximum(square, 0.0))
        depth = centre[2] + r * normal_z
        visible = (square > 0.0) & (depth > front[covered_y, covered_x])
        light = np.maximum(normal_x * sun[0] + normal_y * sun[1] + normal_z * sun[2], 0.0)
        nearness = (centre[2] - low[2]) / (high[2] - low[2])
        shade = (0.25 + 0.75 * light) * (0.45 + 0.55 * nearness)
        front[covered_y, covered_x] = np.where(visible, depth, front[covered_y, covered_x])
        shades[covered_y, covered_x] = np.where(visible, shade, shades[covered_y, covered_x])
    return np.ma.masked_where(np.isinf(front), shades)
