"""Figures of a packing: coordination, clusters, contacts by direction, vertical stress."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, MaxNLocator

from mrjax.core.errors import InputError
from mrjax.core.network import ContactNetwork
from mrjax.figures.style import COLUMN, STYLE
from mrjax.observables.clusters import cluster_sizes
from mrjax.observables.coordination import coordination
from mrjax.observables.stress import vertical_stress

SECTORS = 10
"""Number of intervals of the cosine between a contact and the vertical."""


@STYLE
def coordination_distribution(network: ContactNetwork) -> Figure:
    """Draws the share of the particles by their number of contacts, with the two means.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.
    """
    result = coordination(network)
    share = np.asarray(result.distribution)
    last = int(np.max(np.nonzero(share)))
    figure, axes = _figure()
    axes.bar(np.arange(last + 1), share[: last + 1], color="0.75", edgecolor="0.0", linewidth=0.6)
    mean, held = float(result.mean), float(result.mean_without_rattlers)
    axes.axvline(mean, color="0.0", label=f"mean {mean:.2f}")
    axes.axvline(held, color="0.4", linestyle="--", label=f"without rattlers {held:.2f}")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("particles that a particle touches")
    axes.set_ylabel("share of the particles")
    axes.set_ylim(0.0, 1.3 * share.max())
    axes.legend()
    return figure


@STYLE
def clusters(network: ContactNetwork) -> Figure:
    """Draws the number of clusters of at least each size, on logarithmic axes.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.
    """
    sizes = cluster_sizes(network)
    figure, axes = _figure()
    axes.loglog(sizes, np.arange(1, len(sizes) + 1), "ko-", ms=3, drawstyle="steps-post")
    axes.set_xlabel("particles in a cluster")
    axes.set_ylabel("clusters of at least this size")
    largest = sizes[0] / network.particles
    axes.set_title(f"{len(sizes)} clusters; the largest has {100 * largest:.3g} % of the particles")
    return figure


@STYLE
def contact_directions(network: ContactNetwork) -> Figure:
    """Draws the density of contacts by their direction to the vertical, isotropic ones beside.

    Args:
      network: contact network of a state, from `mrjax.contact_network`.

    Raises:
      InputError: no two particles touch.
    """
    touching = np.asarray(network.between_particles)
    if not touching.any():
        raise InputError("no two particles touch in this state: give that of a bed")
    branch = np.asarray(network.branch)[touching]
    cosine = np.abs(branch[:, 2]) / np.linalg.norm(branch, axis=1)
    count, edges = np.histogram(cosine, SECTORS, (0.0, 1.0))
    share, middle = SECTORS * count / len(cosine), 0.5 * (edges[1:] + edges[:-1])
    error = SECTORS * np.sqrt(count) / len(cosine)
    figure, axes = _figure()
    axes.errorbar(middle, share, error, fmt="ko", ms=3, label=f"{len(cosine)} contacts")
    axes.axhline(1.0, color="0.5", linestyle="--", label="isotropic")
    axes.set_xlabel("cosine of a contact to the vertical (0 level, 1 upright)")
    axes.set_ylabel("density of contacts")
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.3 * max(1.0, float((share + error).max())))
    axes.legend()
    return figure


@STYLE
def stress_profile(network: ContactNetwork, weight: float | None = None) -> Figure:
    """Draws the vertical contact stress against height, beside the weight above.

    Args:
      network: contact network of a state in a box with a floor, from `mrjax.contact_network`.
      weight: net weight of all particles, N. The line drawn for it falls from weight over area at
        the floor to zero at the highest contact; None to leave it out.

    Raises:
      InputError: the box has no floor.
    """
    height = network.box.height
    levels = np.linspace(0.0, height, 201)[1:]
    stress = np.asarray(vertical_stress(network, levels))
    figure, axes = _figure()
    axes.plot(stress, levels, "k-", label="contacts")
    if weight is not None:
        above = float(weight) / (network.box.size[0] * network.box.size[1])
        carrying = levels[np.abs(stress) > 1e-3 * np.abs(stress).max()]
        top = carrying.max() if carrying.size else height
        axes.plot([above, 0.0], [0.0, top], "--", color="0.5", label="weight above, even bed")
    axes.xaxis.set_major_formatter(EngFormatter("Pa"))
    axes.yaxis.set_major_formatter(EngFormatter("m"))
    axes.set_xlabel("vertical contact stress")
    axes.set_ylabel("height")
    axes.set_ylim(0.0, height)
    axes.legend()
    return figure


def _figure() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(COLUMN, 2.4), layout="constrained")
    return figure, figure.subplots()
