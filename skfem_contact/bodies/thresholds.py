"""Numbers of the bodies: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

# -- inputs ------------------------------------------------------

# An entry of K - K' above this fraction of the largest entry of K is not round-off of assembly, which
# is 1e-7 in single precision; below the other one nothing that factorises K sees it.
UNSYMMETRIC, SYMMETRIC = 1e-6, 1e-13

# -- normals -----------------------------------------------------

# Two facets that meet at 45 degrees or more form a corner: no normal is averaged over it. Chamfers of
# 45 degrees are common, and it is not left to round-off, of files in single precision neither.
CORNER = np.cos(np.pi / 4) * (1 + 1e-6)

# An edge lies in a plane if its ends differ by less than this part of its length across it.
SAME_PLACE = 1e-6

# A facet stands for a piece of a curve if the smooth boundary leaves it by no more than 11.25 degrees:
# 16 facets to the circle. With fewer the polygon is meant, as it is of a chamfer of 30 degrees. Of 16
# it is not left to round-off.
STEEPEST = np.tan(np.pi / 16) * (1 + 1e-9)

# ... and by about as much at both ends: where a straight side passes into an arc, one end turns by
# half of the other, and beside a kink in a straight side one end does not turn at all.
ALIKE = 2 / 3

# A facet is straight beside a kink if the surface turns at its other end by less than this part.
STRAIGHT = 1 / 4

# Turns by less [rad] are no kink: a weighted gap is then wrong by a ten thousandth of a facet.
BENT = 1e-3

# -- body, curves, face_normals, normals, facets, faces, projection ---

# A measure is that of axisymmetry if its quotient by the radius is constant to the digits of a function
# that a user writes.
SAME_QUOTIENT = 1e-9

# A turn this close to half a circle [rad] is that of the two lips of a slit.
BACK_TO_BACK = 1e-6

# Normals that cancel to this part of their sum have none in common.
CANCELLED = 1e-9

# Coordinates carry 16 digits of the mesh's extent: what is smaller than this part of it has no
# direction. And middles of facets closer than this part of the shortest one are the same facet's.
NO_EXTENT, SAME_FACET = 1e-12, 1e-9

# Second derivatives of shape functions on a reference facet that differ by less are constant.
SAME_SECOND = 1e-12

# Newton steps to the nearest point of a parabola end at this change of its coordinate, of which 1 is
# the whole facet; and the least curvature of the distance, over that of a chord, that they believe.
NEAREST, LEAST_SLOPE = 1e-14, 0.1
