"""Numbers of the answers: what each is relative to, and where it comes from."""

from __future__ import annotations

# -- certificate -------------------------------------------------

# -- values ------------------------------------------------------

# Energy that the balance of a step misses, over the energy lost, from which on it is said: the loss of
# the README's scene, pressed and released, is then wrong by a third of that.
COARSE = 0.05

# Errors are told relative to the computed traction, from what it shows beside its edges. Up to this
# share of it they are within a factor of three; beyond, points are too few to say by how much.
ESTIMATED = 0.3

# -- fields ------------------------------------------------------

# Open nodes up to so many faces away tell where contact ends: two beyond those next to closed ones.
REACH = 3

# -- surface_error -----------------------------------------------

# At the end of stick a square root misfits its nodes at least ten times as much as those beside
# them, a smooth function with a jump in its curvature about as much.
SHARPER = 3.0

# -- uniqueness, pieces ------------------------------------------

# Directions of friction in half a turn that are tried in 3-D: the least coefficient to four digits.
DIRECTIONS = 720

# What is shown of one answer is shown for this much less than eigenvalues say, so that their own error
# and round-off of the matrices do not count. Eigenvalues of more than so few rows are iterated.
SHOWN, FEW = 1e-3, 100

# Shares of the normal compliance that are tried for the proof: each is as valid, one is the best.
SHARES = (0.0, 0.5, 2.0, 8.0, 32.0, 1024.0)

# Printed reports look for other answers up to so many gaps and slips: three seconds at most.
MOST_ROWS = 2000

# The fall of friction, over the share by which slip is lengthened, from which on friction falls: three
# digits above the round-off of the bounds.
FALLING = 1e-3

# -- validity ----------------------------------------------------

# What may be off without a word, relative to what it is a part of, so that forces are 10 % off: slip
# over the width of the contact, where that is more than a facet (moments); the angle between the normal
# that is used and the true one [rad]; the error of gaps over the elastic approach of the bodies; force
# of points beyond the end of the primary over that of the contact; strain or rotation, of which linear
# elasticity leaves out the square; what moments of second order change of the motion of a tool; what
# friction by stress on the deformed area differs from that on the area before.
A_TENTH = 0.1

# -- validity.validity: `Drift` ----------------------------------

# Slip over a facet of the primary: below one the mesh does not resolve where a force acts.
FACETS = 1.0

# Height of curves over one facet, over the elastic approach: forces are up to 15 % off by mortar and
# 23 % node by node, half of that in general (`chords`); on balls, by 21 % with either.
SAGITTA = 0.2

# Of a bound, from which on a step measures strains and rotations. Mean pressure over modulus and
# approach over extent are .8 times the strain where the energy is, or more, and .9 of the turn of a
# cantilever; what supports and surfaces are off a rigid motion is .3 of the turn of a beam that is bent
# on three points.
PRESSED, SUSPECTED = 0.5, 0.25

# -- validity.deformed_boundaries -----------------------------------------

# Straight pieces that a quadratic facet is drawn with: they miss 1/256 of its sagitta.
PIECES = 8

# -- validity.strain ---------------------------------------------

# Bulk over shear modulus from which on a body is looked at: a Poisson's ratio of .46, where four
# elements of first order under a contact give forces that are 6 % larger, over true ones, than at .3.
STIFF_BULK = 12.0

# Share of the energy that an average of the change of volume over neighbouring elements takes away:
# forces are 9 % too large. Second-order elements have up to .05 where four of them meet a contact.
LOCKED = 0.08

# Quotient of bulk and shear modulus, times the share of the energy and times that of the shear that
# averages take away, both: first-order elements that lock altogether. 860 where forces are 120 times
# too large and nearly all shear is smooth, 4 000 and more else; 100 where they are right by 6 %.
ALTERNATING = 800.0

# -- validity.support --------------------------------------------

# Singular values of unit motions at the prescribed DOFs below which these hold no motion: a support
# a thousandth as wide as the body says nothing about its turn.
SUPPORTED = 1e-3

# -- validity.validity -------------------------------------------

# Overlap beyond what chords explain, over the elastic approach: contact conditions hold at the
# points of one side, between them unlike meshes overlap by a part of what they are pressed in. At the
# end of a wedge that is driven in it is 0.28, whatever the mesh, with forces that are right to 1e-3.
OVERLAP = 0.35

# -- tangent.rates -----------------------------------------------

# Changes of states, by point with a kink, before a derivative to one side is given up: directions of
# friction are found in a handful.
MOST_CHANGES = 50
