"""Greatest overlaps of contacts in a bed at rest, in contact radii."""

OVERLAP = 0.025
"""Default. With half of it, 314 particles rest at the same height within the standard error of six
starts; with twice of it, they rest one to two points lower."""
MOST_OVERLAP = 0.1
"""Greatest overlap that is accepted; a greater one would show in the height of a bed."""
