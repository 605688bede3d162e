"""Numbers of the pairings: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

from skfem_contact.bodies.thresholds import CORNER

# -- closest -----------------------------------------------------

# A facet is a candidate if its normal n_p and that of the node, n_s, have n_s . n_p < -FACING:
# they may be up to 84 degrees off the exactly opposite direction. So much may a direction be off the
# free one along which a node at a roller still moves, as in `elimination.pivoting`.
FACING = 0.1

# Up to this part of a facet the sloping side of a body at the end of a surface decides what is above
# the end; what lies farther beyond it is another part of the boundary. With finite sliding surfaces go
# on by this part of a facet beyond where they end, as "extension zones" of contact codes do: ends that
# are flush in the mesh slip past each other by strains, a hundredth of a facet at most, and a block
# that slides off has lost its last point a tenth of a facet later.
EXTENDED = 0.1

# -- corners -----------------------------------------------------

# Angle [rad] between a facet and the end of the other surface from which on the vertex carries.
# Below, the vertex is at most this times a facet length deeper than the last node, which is less
# than the chords of a curve explain. For means over facets, too: one of zero over a facet that leans
# by 0.09 lets the vertex in by 0.07 of its length. A smaller turn beside a straight part may be that of
# a curve which begins there.
LEAN = 0.04

# Angle [rad] beyond the normal of a facet that was not selected up to which the vertex still carries:
# corners turn with the strains of their body.
SLACK = 0.1

# What leans farther beyond an end than this [rad] is another part of the boundary.
CROSS = 0.5 * np.pi

# -- diagnosis ---------------------------------------------------

# Facets this much smaller, and bodies this much stiffer, than those of the other side make the choice
# of the secondary worth a line.
FINER, STIFFER = 0.75, 3.0

# Normals of two surfaces that are all closer together than this [rad] would have to turn towards each
# other by half a radian before any of them faced another; bodies are linear, and turn by 0.1 at most.
ALIKE = float(np.pi / 3)

# -- dual --------------------------------------------------------

# A multiplier of its own needs this share of the node's integral over the whole facet.
SHARE_KEPT = 1 / 4

# The weights of a row are bounded by this times those of whole facets: the number at which two
# multipliers become one on a line whose middle third is covered. On lines the sum of |weights| is then
# below 5 (linear) and 7 (quadratic) however they are cut; uncut it is 1.7 and 2.2.
WEIGHTS_KEPT = float(np.sqrt(7))

# Facets on whose covered part the mass matrix has a worse condition have one multiplier: what it
# would do to the rows is round-off times this, times the part of the area that is covered, which
# then is small.
WORST_CONDITION = 1e8

# -- node, mortar: normals of both sides -------------------------

# The spread of normals at which a surface has a corner, 45 degrees [rad].
SPREAD = float(np.arccos(CORNER))

# -- overlaps of solids (answers.validity.edges) ------------------

# Turn of a boundary from which on an edge is sharp [rad]: with less it may stand for a curve of 16
# faces to the circle (`bodies.thresholds.STEEPEST`), also just that and round-off.
SHARP = float(np.pi / 8 * (1 + 1e-6))

# -- search of quadratic faces ------------------------------------

# By which part of its box, and of the turn of its normals at the nodes, a quadratic face may go beyond
# them: a parabola with its middle node at a quarter of the edge goes beyond its nodes by 1/24.
BULGE = 0.1

# -- frames ------------------------------------------------------

# A nodal force under an isotropic strain that is more than 60 degrees off the normal shows that K is
# not that of an elastic body there.
ALONG = 0.5

# -- mortar ------------------------------------------------------

# -- search ------------------------------------------------------

# To ask about so many pairs takes no longer than to go through the upper levels of a tree.
FEW_PAIRS = 1 << 12

# Balls are larger by this fraction of their radius, for round-off and for tolerances at the ends.
MARGIN = 1e-5

# -- supports ----------------------------------------------------

# A surface moves at a point if nodes that move have this part of the weights there. To close a gap by
# less is to tear the body: a node next to a clamped one, with a fifth of the weight, by five times
# the gap, and the force is 30 times too large.
MOVING_SHARE = 0.5

# The primary lies opposite to a node if it ends no farther from it than this part of a facet; and by
# this part of its length two edges that touch may do so beyond the end of one.
OVERHANG = 0.25

# -- cells -------------------------------------------------------

# -- segmentation ------------------------------------------------

# Newton steps at most on a curved facet or to an image along normals.
NEWTON_STEPS = 12
