"""Numbers of the contact conditions: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

# -- checks ------------------------------------------------------

# An overlap of this share of a body is no interference fit: small strains end long before.
HUGE = 0.1

# Gaps that differ by this share of a body are no layer of glue, and none is an inexactness of a mesh.
BRIDGED = 0.3

# -- friction ----------------------------------------------------

# Coefficients from here on are larger than those of any pair of materials, sticky rubber (3) included.
STEEP = 5.0

# -- friction, friction_rule -------------------------------------

# A trial force beyond any bound, for points that slip in a known direction. A power of two, so that the
# force on the bound has no round-off; and its fourth power is still a number.
BEYOND = 2.0**250

# -- interface ---------------------------------------------------

# The tangential stiffness that a loop takes where the law gives none, over K's diagonal at the
# point: exact sticking; an error of 1e-3 in the slip of sticking points; one that still converges.
STIFFNESS = {"newton": np.inf, "direct": 1e3, "fictitious": 1.0}

# -- motions -----------------------------------------------------

# A mode with less than this share of a motion is not named in messages.
NOT_NAMED = 1e-3

# Free motions up to which the products of their rows are kept point by point: those of two bodies in
# space, which take less than the rows' own matrix.
FEW_MODES = 12

# -- orthotropic -------------------------------------------------

# Least ratio of two coefficients of friction. Rows of slips are multiplied by it, and have to stay far
# above GIVEN, below which a row counts as prescribed.
SMOOTHEST = 1e-3

# -- rows --------------------------------------------------------

# Sine of the angle to the normal below which a direction has no projection to speak of: half a degree,
# where the turns that a body makes under load decide where it points.
NO_PROJECTION = 1e-2

# -- statics -----------------------------------------------------

# Directions of friction in 3-D; the polygon lies around the circle of Coulomb's law.
DIRECTIONS = 32

# What may be left of the forces along a free motion: they balance to the digits of the contact problem,
# 1e-8 with moduli 1e6 apart, and where a body ran away nothing of them does.
LEFT_ALONG = 1e-4
