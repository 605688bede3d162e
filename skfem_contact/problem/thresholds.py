"""Numbers of the contact problem: what each is relative to, and where it comes from."""

from __future__ import annotations

# -- choice ------------------------------------------------------

# Cubes of contact DOFs per byte of the bound of the factors and load step from which on iterated forces
# take less time. Condensing takes three operations for each, at the peak of a processor; a load step
# some 60 products with the factors, each of which reads all bytes twice, a third of the bound: with
# 2 200 points on solids of 100 000 DOFs the two meet at 2.6 load steps, and by this number at 2.7.
PER_BYTE = 100.0

# Cubes of DOFs between halves of bodies, per entry of K and load step, up to which multigrid takes less
# time than factors. One step on two blocks takes as long by both at 300 (24 500 DOFs), half as long by
# multigrid at 970 (92 600), a quarter at 4 000 (362 600): twice what is even, as elements of second
# order, thin ones and a Poisson's ratio of .49 take twice as many cycles.
CUBES_PER_ENTRY = 600.0

# Cycles of multigrid in one linear problem after which factors are made, where both are at hand. Well
# posed problems take 10 to 60.
CYCLES = 60

# -- condensed ---------------------------------------------------

# Results whose interior is recovered at a time: enough for matrix products, few enough for memory.
RECOVERED_AT_ONCE = 32

# -- condensed ---------------------------------------------------

# Matrices of the size of all gaps and slips that are there at once: the stiffness, its factorisation,
# and half of one for the columns of points that slip, or for what is eliminated of open ones.
PER_ROWS = 2.5

# Pivot of a contact row (of unit diagonal) below which it depends on the others: its square is what
# the inverse loses of its digits, six here. A beam 20 times as long as high is at 1e-2.
DEPENDENT = 1e-3

# -- iterated ----------------------------------------------------

# Residual over the motion by loads to which forces are iterated, and that by springs on anchors:
# round-off of the factors. Above `SOLVED` there is no answer. A solve takes 15 to 30 products, up to 60
# where most points slip.
ITERATED, MOST_PRODUCTS = 1e-13, 400

# -- whole -------------------------------------------------------

# Couplings of K from the surface to the bottom of its layer: elements, in effect.
LAYERS = 4

# -- forces ------------------------------------------------------

# What an answer on the way may leave of the residual: points change by more than a hundredth from one
# of Newton's iterations to the next, and what is left is taken up there. An increment takes half as
# long as with all digits in all iterations; with a third of it, or three times, as long as with this.
ROUGHLY = 1e-2

# -- iterated ----------------------------------------------------

# Share of the residual that a solve leaves at most of that of the iteration before.
CLOSER = 0.1

# Of one operation, relative: half a unit in the last place.
ROUNDING = 2.0**-53

# -- model -------------------------------------------------------

# Sets of springs whose twins are kept: two weak ones, and some of single DOFs.
MOST_TWINS = 6

# -- zone ------------------------------------------------------

# Points kept besides those that are closed, as a share of these, and at least so many.
SPARE, FEWEST = 0.1, 8

# Pivot of the bodies without the springs on their anchors, over the largest stiffness with them, below
# which the points of a zone hardly hold them: taking away the springs costs forces as many digits.
LOOSE = 1e-5

# Size of the compliance of all points up to which its inverse stays beside it [bytes]. Of a larger one,
# of 2 800 rows, it takes half a second and more, and is formed where somebody asks. Dense matrices of
# this size altogether are made however few load steps there are.
KEPT_BESIDE = 64_000_000

# -- springs -----------------------------------------------------

# K's diagonal knows nothing of what gives way around a node: of the resistance of a contact point it
# makes 1.2 to 3.6 times along the normal and 1.6 to 6.4 times across (hexahedra, thick and thin blocks,
# matching or not). On all DOFs, where nothing better is at hand, a third of it is taken.
STIFFER = 3.0

# -- springs -----------------------------------------------------

# Compliance of the springs of points whose rows depend on each other, over that of the points. With a
# hundredth of it Newton stalls where several contacts with friction share a node; with a hundred times
# as much, springs lose their strain in twice as many passes.
GIVE = 3e-3

# -- substructure ------------------------------------------------

# Ratio of singular values of the rigid modes on some DOFs above which these hold the body firmly.
HELD_FIRMLY = 1e-2

# Load directions that are remembered; a history of more is condensed step by step.
MOST_DIRECTIONS = 12
