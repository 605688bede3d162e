"""Numbers of the bodies: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

# -- inputs ------------------------------------------------------

# An entry of K - K' above this fraction of the largest entry of K is not round-off of assembly, which
# is 1e-7 in single precision; below the other one nothing that factorises K sees it.
UNSYMMETRIC, SYMMETRIC = 1e-6, 1e-13

# -- normals -----------------------------------------------------

# Two facets that meet at a larger angle than 45 degrees form a corner: no normal is averaged over
# it.
CORNER = np.cos(np.pi / 4)

# An edge lies in a plane if its ends differ by less than this part of its length across it.
SAME_PLACE = 1e-6

# A facet stands for a piece of a curve if the smooth boundary leaves it by no more than 11.25 degrees:
# 16 facets to the circle. With fewer the polygon is meant, as it is of a chamfer of 30 degrees.
STEEPEST = np.tan(np.pi / 16)

# ... and by about as much at both ends: where a straight side passes into an arc, one end turns by
# half of the other, and beside a kink in a straight side one end does not turn at all.
ALIKE = 2 / 3

# A facet is straight beside a kink if the surface turns at its other end by less than this part.
STRAIGHT = 1 / 4
