"""Figures of a run for papers: legible in greyscale, one or two columns wide, with units."""

from mrjax.figures.animation import refuse_without_writer, save_animation
from mrjax.figures.column_fields import column_field
from mrjax.figures.compression import compressive_yield
from mrjax.figures.contacts import force_chains, force_distribution
from mrjax.figures.curves import sedimentation, settling
from mrjax.figures.heat_map import concentration
from mrjax.figures.packings import (
    clusters,
    contact_directions,
    coordination_distribution,
    stress_profile,
)
from mrjax.figures.sensitivities import sensitivities, sensitivity_curves
from mrjax.figures.spheres import particles
from mrjax.figures.style import COLUMN, PAGE, STYLE

__all__ = [
    "COLUMN",
    "PAGE",
    "STYLE",
    "clusters",
    "column_field",
    "compressive_yield",
    "concentration",
    "contact_directions",
    "coordination_distribution",
    "force_chains",
    "force_distribution",
    "particles",
    "refuse_without_writer",
    "save_animation",
    "sedimentation",
    "sensitivities",
    "sensitivity_curves",
    "settling",
    "stress_profile",
]
