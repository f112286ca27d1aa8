"""Greatest overlaps of contacts in a bed at rest, in contact radii."""

OVERLAP = 0.025
"""With half of it, 314 particles rest as high but for the standard error of six starts; with twice
of it, one to two points lower."""
MOST_OVERLAP = 0.1
"""Beyond it the height of a bed would show it."""
