"""Numbers of the pictures: chosen by eye, each relative to what is drawn; and of stresses."""

from __future__ import annotations

# -- projection --------------------------------------------------

# Error that is left of a projection, over its size: round-off; and how many products with the mass
# matrix it may take, of which well-shaped cells need 60 at most.
PROJECTED = 1e-15
PRODUCTS = 400

# -- plot_bodies -------------------------------------------------

# Displacements over the extent of the bodies: seen at a glance, and bodies keep their shapes.
DISPLACED = 0.06

# Overlap of gaps that have closed, over the extent: magnified further, bodies would be seen in each
# other.
OVERLAPPING = 0.01

# Overlap of such gaps in a picture that is seen, over the extent: the width of a line.
SEEN = 0.002

# A factor is rounded down to one of these times a power of ten.
ROUND = (1.0, 2.0, 5.0)

# A translation of all bodies is taken off where the factor then grows by more than this.
TOGETHER = 4.0

# The longest arrow over the extent, the shortest that has a head over the longest, and how many there
# are at most of one contact: more would cover each other.
LONGEST, SHORTEST, ARROWS = 0.08, 0.03, 60

# -- tools -------------------------------------------------------

# What is shown of an obstacle beside the bodies, over their extent; a round one whose radius is so many
# times the extent is shown around the bodies only, others as a whole.
AROUND = 0.08
MUCH_LARGER = 4.0

# Sides of a circle, and points along each side of the grid on which a function's zero is found: as
# smooth as a picture can show.
SIDES = 360
GRID_2D, GRID_3D = 201, 33

# Distance and length of the short strokes on the side of the solid, over the extent.
STROKES = 0.02

# What is left free around all that is drawn, over the extent.
MARGIN_2D = 0.04

# An obstacle up to so many times as long as the bodies is shown as a whole.
WHOLE = 1.5

# -- solids ------------------------------------------------------

# The viewer stands aside of the x axis and above the floor by these angles, or so far off the normal of
# a contact [rad]: far enough to see that it is no plane picture.
ASIDE, TILTED = -1.0, 0.5

# What is shown beside the points that touch, over the longest side of the box round them.
WINDOW_3D = 0.25

# -- plot_contacts -----------------------------------------------

# What is shown beside the points that touch, over their width.
MARGIN = 0.15
