"""Numbers of the elimination: what each is relative to, and where it comes from."""

from __future__ import annotations

# Rows agree if they do so to this part of the largest of |b| + |C||x| (rows scaled to a largest
# coefficient of one): that is how exactly redundant rows are known to be redundant; and what is left of
# a row after elimination counts as nothing below it. Round-off of coordinates (1e-16) and of normals
# computed from small facets (1e-16 * size / facet) is far below, angles that mean anything above.
AGREEMENT = 1e-10

# -- eliminate ---------------------------------------------------

# How many rows, and of each how many that it contradicts, a message names.
SHOWN = 4

# -- pivoting ----------------------------------------------------

# An entry counts as a pivot if it is at least this part of the largest one: the coefficients of T
# are quotients by the pivot, so that a looser rule would cost more than one digit and spoil the
# condition of T'KT; a stricter one would leave the secondary side already at a normal 80 degrees
# off the only free direction, and couple rows for no gain.
WORTH_PIVOTING = 0.1

# Proposed pivots of a block are taken as they are if its smallest singular value exceeds this
# (three digits lost at most); otherwise the block chooses again.
WELL_CONDITIONED = 1e-3
