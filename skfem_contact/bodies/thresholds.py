"""Numbers of the bodies: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

# -- inputs ------------------------------------------------------

# A number on the diagonal of K that is larger than all others by this factor prescribes a displacement.
# skfem.penalize writes 1e10. Springs that are meant as springs are far below: beside one as stiff as
# this half of the digits of the body are lost.
PENALTY = 1e8

# -- facet_kinds -------------------------------------------------

# What corners of a face take of the middles of their edges where their own integrals are not positive.
TAKEN = 0.2

# -- normal_field ------------------------------------------------

# Two facets that meet at 45 degrees or more form a corner: no normal is averaged over it. Chamfers of
# 45 degrees are common, and it is not left to round-off, of files in single precision neither.
CORNER = np.cos(np.pi / 4) * (1 + 1e-6)

# A facet stands for a piece of a curve if the smooth boundary leaves it by no more than 11.25 degrees:
# 16 facets to the circle. With fewer the polygon is meant, as it is of a chamfer of 30 degrees. Of 16
# it is not left to round-off.
STEEPEST = np.tan(np.pi / 16) * (1 + 1e-9)

# ... and by about as much at both ends: where a straight side passes into an arc, one end turns by
# half of the other, and beside a kink in a straight side one end does not turn at all.
ALIKE = 2 / 3

# A facet is straight beside a kink if the surface turns at its other end by less than this part. On
# curves of shaken meshes turns differ, but not by as much.
STRAIGHT = 0.02

# Turns by less [rad] are no kink: a weighted gap is then wrong by a ten thousandth of a facet.
BENT = 1e-3

# -- quadrics ----------------------------------------------------

# Neighbours that a quadric is fitted to, at least; where a node has less, theirs count, too. In the
# plane these two tell all; in space five numbers are sought, and six nodes round one may lie on a cone.
ENOUGH = {2: 2, 3: 7}

# Steps of a fit at most: each gains the square of a facet over the radius of curvature, or better.
FITS = 12

# A surface ends on a plane of symmetry if its normal has none across it there: continued in proportion
# to the distance, this part of its change over the last facet at most. On an arc of 45 degrees a facet
# it is .08; a surface that ends askew by a tenth of the turn of a facet is taken for a mirrored one.
FADES = 0.1

# A facet with middle nodes is straight if they are no farther off than this part of its size.
BOWED = 1e-4
