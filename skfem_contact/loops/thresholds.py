"""Numbers of the loops: what each is relative to, and where it comes from."""

from __future__ import annotations

# -- guided ------------------------------------------------------

# A change of the slip below this part of it is the round-off of prescribed displacements.
SAME_SLIP = 1e-12

# -- lemke -------------------------------------------------------

# More points than this are left to step cutting: the tableau has 4 m rows and 8 m columns.
MOST_POINTS = 250

# Springs that hold a free rigid motion, over the largest stiffness: weak enough to disturb nothing, or,
# where pivots drown in the round-off of that, less weak. The loop takes them away again.
WEAK_SPRINGS = (1e-9, 1e-6)

# Relinearisations of a law that is not linear in the normal force (a cap, a user's own).
SWEEPS = 5

# -- fictitious --------------------------------------------------

# In the loop `fictitious` points open and close freely so often; after that only once the friction of
# the present set has settled to this share of the largest force, or a point could open and close
# for ever because of friction forces that lag behind.
FREE_CHANGES, SETTLED = 12, 1e-6

# -- rules -------------------------------------------------------

# Round-off of a force or a gap relative to the largest one: a violation below it is no violation.
# Condensation loses some digits to the condition number of the bodies (1e-16 times 1e3 or so).
ROUND_OFF = 1e-11

# Digits to which two points are told apart: fewer than round-off leaves of any number, so that points
# which symmetry makes alike are so in whatever order they are numbered.
DIGITS_ALIKE = 9

# A set of points that holds a body by less than this is none that can be solved for: stiffnesses are
# squares of it, and those have sixteen digits.
FIRMLY = 1e-7

# -- starts ------------------------------------------------------

# Iterations that Newton may take where another loop begins from its answer.
NEWTON_ITERATIONS = 80
