"""Numbers of the loops: what each is relative to, and where it comes from."""

from __future__ import annotations

# -- complementarity ---------------------------------------------

# The part of slips that are the same but for round-off (`same_slip`) which a solve itself
# leaves, as a rule: what a stiffness makes of it stays below the forces. With ten times as much the
# friction of a ring that is turned by far more than it strains is off.
SOLVED_SLIP = 0.1

# -- lemke -------------------------------------------------------

# More points than this are left to step cutting: the tableau has 4 m rows and 8 m columns.
MOST_POINTS = 250

# Springs that hold a free rigid motion, over the largest stiffness: weak enough to disturb nothing, or,
# where pivots drown in the round-off of that, less weak. The loop takes them away again.
WEAK_SPRINGS = (1e-9, 1e-6)

# Relinearisations of a law that is not linear in the normal force (a cap, a user's own).
SWEEPS = 5

# -- active_set --------------------------------------------------

# In the loop `fictitious` points open and close freely so often; after that only once the friction of
# the present set has settled (to `GIVEN` of the largest force), or a point could open and close for
# ever because of friction forces that lag behind.
FREE_CHANGES = 12

# -- starts ------------------------------------------------------

# Softness of the springs in series over that of the points: at first; and what it is divided by after
# each answer. Where one is not found it is multiplied by the root of that, and divided by no more from
# then on. On 168 load steps with coefficients of 3, 10 and 100 that Newton had failed at, values of
# twice and half as much do as well.
SOFTEST, EASED = 30.0, 4.0

# Iterations for a problem with springs, and for the problem itself, once the forces have changed by
# less than a share from one problem to the next; and for the whole chain, which took 100 on the mean
# and more than this in two of those load steps. Where no softness helps, nothing is to be found.
IN_SERIES, NEAR, MOST_IN_SERIES, TOO_SOFT = 25, 0.1, 600, 1e4

# -- multipliers -------------------------------------------------

# Solves at most until springs have come to rest: moves, and GMRES where rows nearly depend on others.
MOST_MOVES = 40

# Share of the last change of forces beyond which the next one shows that rows contradict each other.
SLOW = 0.5

# -- complementarity ---------------------------------------------

# Where in a unit of the last of `DECIMALS` by which points are told apart one number begins and the
# other ends: at no fraction that meshes have. At a half it is at 2^-10, among others, and round-off
# tells equal points apart.
BETWEEN = (3 - 5**0.5) / 2

# -- starts ------------------------------------------------------

# Iterations that Newton may take where another loop begins from its answer.
NEWTON_ITERATIONS = 80

# -- active_set --------------------------------------------------

# Armijo's rule: the decrease that is asked for over that of the linear model, and how often a step is
# halved for it; as often as the way to the largest share of a load (`pulled`): three digits.
DECREASE, HALVINGS = 1e-4, 10

# -- lemke (the tableau, whose entries are of order one after scaling) ---

# -- starts ------------------------------------------------------

# Friction over the normal force where bounds that jump are made to rise: pressures on the rise are a
# thousandth of the bound, and where an answer is found from there, a hundred thousandth.
RISES = (1e3, 1e5)
