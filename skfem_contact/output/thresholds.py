"""Numbers of the pictures: chosen by eye, each relative to what is drawn."""

from __future__ import annotations

# -- plot_bodies -------------------------------------------------

# Displacements over the extent of the bodies: seen at a glance, and bodies keep their shapes.
DISPLACED = 0.06

# Overlap of gaps that have closed, over the extent: magnified further, bodies would be seen in each
# other.
OVERLAPPING = 0.01

# A factor is rounded down to one of these times a power of ten, or is none where it is close to one.
ROUND = (1.0, 2.0, 5.0)
NEARLY_TRUE = 0.5

# Factors that differ by less are equal but for round-off.
SAME_FACTOR = 1e-12

# The longest arrow over the extent, the shortest that has a head over the longest, and how many there
# are at most of one contact: more would cover each other.
LONGEST, SHORTEST, ARROWS = 0.08, 0.03, 60

# -- solids ------------------------------------------------------

# The viewer stands aside of the x axis and above the floor by these angles, or so far off the normal of
# a contact [rad]: far enough to see that it is no plane picture.
ASIDE, TILTED = -1.0, 0.5

# What is shown beside the points that touch, over the longest side of the box round them.
WINDOW_3D = 0.25

# -- plot_contacts -----------------------------------------------

# What is shown beside the points that touch, over their width.
MARGIN = 0.15
