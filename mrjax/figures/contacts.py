"""The contact forces of a bed: their distribution, and the force chains."""

import numpy as np
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import EngFormatter

from mrjax.core.box import Box
from mrjax.core.errors import InputError
from mrjax.core.parameters import Parameters, per_particle
from mrjax.core.state import State
from mrjax.dem.contact_list import ContactList, normal_forces
from mrjax.figures import spheres
from mrjax.figures.style import COLUMN, STYLE
from mrjax.laws import particle

THICKEST = 3.5
"""Line width of a force of at least `STRONG` times the mean, in points."""
STRONG = 4.0


@STYLE
def force_distribution(state: State, parameters: Parameters, box: Box) -> Figure:
    """Draws the probability density of normal forces over their mean, on a logarithmic axis.

    Forces on walls are included; attraction is not subtracted. An exponential distribution with the
    same mean is drawn for comparison, because the tails of granular packings are compared with it.

    Args:
      state: state of a run at one time.
      parameters: parameters of the run.
      box: box of the run.

    Raises:
      InputError: nothing touches.
    """
    force = _contacts(state, parameters, box).force
    ratio = force / force.mean()
    bins = max(5, round(2.0 * len(ratio) ** (1 / 3)))  # Rice's rule
    density, edges = np.histogram(ratio, bins, (0.0, ratio.max()), density=True)
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    axes = figure.subplots()
    middle = 0.5 * (edges[1:] + edges[:-1])
    filled = density > 0.0
    axes.semilogy(middle[filled], density[filled], "ko", ms=3, label=f"{len(ratio)} contacts")
    smooth = np.linspace(0.0, edges[-1], 100)
    axes.semilogy(smooth, np.exp(-smooth), "--", color="0.5", label="exponential, the same mean")
    axes.set_xlim(0.0, edges[-1])
    axes.set_xlabel(f"{_name(parameters)} / its mean, {_with_prefix(force.mean())}")
    axes.set_ylabel("probability density")
    axes.legend()
    return figure


@STYLE
def force_chains(state: State, parameters: Parameters, box: Box) -> Figure:
    """Draws normal forces as lines between centres; stronger forces have thicker lines.

    Attraction is not subtracted from them.

    Args:
      state: state of a run at one time.
      parameters: parameters of the run.
      box: box of the run.

    Raises:
      InputError: nothing touches.
    """
    contacts = _contacts(state, parameters, box)
    size = np.asarray(box.size)
    centres = spheres.inside(state.position, box)
    radius = np.asarray(per_particle(particle.outer_radius(parameters), state.particles))
    projected = spheres.project(centres)
    ends = spheres.project(centres[contacts.first] + contacts.reach)
    strength = np.minimum(contacts.force / contacts.force.mean(), STRONG) / STRONG
    weakest_first = np.argsort(strength)
    width, height = np.ptp(spheres.bounds(size)[:, :2], axis=0)
    figure = Figure(figsize=(COLUMN, 0.3 + COLUMN * min(height / width, 1.3)), layout="constrained")
    axes = figure.subplots()
    axes.add_collection(
        PatchCollection(
            [Circle(centre, size) for centre, size in zip(projected[:, :2], radius, strict=True)],
            facecolor="none",
            edgecolor="0.85",
            linewidth=0.4,
            zorder=1,
        )
    )
    axes.add_collection(
        LineCollection(
            list(np.stack([projected[contacts.first, :2], ends[:, :2]], axis=1)[weakest_first]),
            linewidths=THICKEST * strength[weakest_first],
            colors=[str(shade) for shade in 0.6 * (1.0 - strength[weakest_first])],
            capstyle="round",
            zorder=2,
        )
    )
    spheres.draw_box(axes, size)
    mean = _with_prefix(contacts.force.mean())
    axes.set_title(f"{len(contacts.force)} contacts, mean {_name(parameters)} {mean}")
    return figure


def _contacts(state: State, parameters: Parameters, box: Box) -> ContactList:
    contacts = normal_forces(state, parameters, box)
    if not len(contacts.force):
        raise InputError("nothing touches in this state: give that of a bed")
    return contacts


def _name(parameters: Parameters) -> str:
    """Name of the force, which is the repulsive part where surfaces attract each other."""
    return "normal force" if parameters.hamaker is None else "repulsive force"


def _with_prefix(force: float) -> str:
    return EngFormatter("N", places=2)(force)
