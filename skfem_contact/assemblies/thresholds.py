"""Numbers of assemblies: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

# -- facing ------------------------------------------------------

# Least cosine between a normal and the opposite of the other: half a right angle, beyond which two
# surfaces stand beside each other rather than opposite.
OPPOSITE = float(np.cos(np.pi / 4))

# Where a facet is asked beside its middle: this part of the way to its corners and the middles of its
# edges. There themselves lines of sight run along edges, and would find what lies beside.
TOWARDS_RIM = 0.85

# Which part of the chord heights of two facets a gap may be wrong by: a ball comes nearer between the
# places that are asked by .2 of a facet off, .16 of the height; at rims half of a height is missing.
UNSURE = 0.25

# What is farther apart than `within`, but not than this times it, is told as near and not taken.
NEARLY = 2.0

# -- finding -----------------------------------------------------

# A pair that covers less of both patches, and on one of them the rim alone, is a sliver.
SLIVER = 0.05

# Nodes of one body that are asked whether they lie in another: overlaps of bodies that are misplaced
# hold more than a few per cent of the nodes in the box of both.
ASKED = 200
