"""The number of digits that count, by where a number comes from: relative to the largest.

What is smaller is zero, and what differs by less is equal. Most thresholds are one of these five; one
that is not has a name and a reason of its own, at the top of its module.
"""

from __future__ import annotations

import math

#: Of what users give: coordinates, materials and loads, often read from files, have six digits.
GIVEN = 1e-6

#: Of solutions of equations: 16 digits less those that a stiffness of condition 1e7 takes.
SOLVED = 1e-9

#: Of numbers in single precision, and of the root of round-off: quotients of differences, and steps
#: that square the error, have half of the digits.
SINGLE = 1e-7

#: Of what is computed from given numbers by some sums and products.
COMPUTED = 1e-12

#: Of sums and products of a few numbers in double precision: some tens of units in the last place.
ROUND_OFF = 1e-14

#: Decimals to which numbers of order one are told apart (weights of a row, above all): those of
#: `SOLVED`. What symmetry makes alike differs in its last digits, and no choice may hang on those.
DECIMALS = -round(math.log10(SOLVED))

#: Steps at most of Newton's method and of fits, each of which gains digits until all are there: warped
#: faces take five, what lies beyond centres of curvature more, and some have no end.
NEWTON_STEPS = 30
