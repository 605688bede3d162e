"""Numbers of load stepping: what each is relative to, and where it comes from."""

from __future__ import annotations

import numpy as np

# -- dry_run -----------------------------------------------------

# Forces of a rigid motion over those that the diagonal of K alone gives: round-off of a motion that K
# does not resist is 1e-15 to 1e-12; a mesh that has been scaled by 1.001 is far above both.
UNRESISTED, RESISTED = 1e-10, 1e-7

# -- dry_run -----------------------------------------------------

# Bodies that are so many times as large as others may be meant, or metres beside millimetres (1000
# times, where the bodies themselves are alike within a factor of three).
UNLIKE = 300.0

# -- stepping ----------------------------------------------------

# A step that fails is halved, and after a success the next part is twice as large: what one cut too
# many costs is won back by one that succeeds.
SHORTER, LONGER = 0.5, 2.0

# What a step is cut to, of the distance that points may slide; and from which multiple of it on the
# first round, on a pairing that is only predicted, is believed.
AIM, FAR = 0.95, 1.3

# Iterations of contact on one linearisation of bodies that are not linear, after the first of a step:
# three took as many linearisations as an exact solution of contact each time, and two fewer of ten.
CONTACT_ITERATIONS = 3

# Shares of the undeformed tangents that are added where an iterate has no answer: in the sixth digit
# what flows resists; beside once and ten times of them the pressures of rubber that keeps its volume
# are small. Five squeezed cylinders took 714 iterates (1 079 without the two; 744 with the last alone).
SHIFTS = (1e-6, 1.0, 10.0)

# Rounds of plain repetition, which suffice where pressures are small against the modulus.
PLAIN = 3

# Round from which on a point that has left the primary surface is not taken back in the same step:
# at its very end there is no pairing that is that of its own answer.
EDGE = 5

# -- stepping ----------------------------------------------------

# The share of the depth worn off in a step that the bodies may answer by another pressure is at most
# one: beyond it a point would wear until it is open, where it has only got lighter. Secants need less.
ANSWERED_BY_SECANTS = 0.3
# What a step is shortened by where pressures have become zero: how far it is too long is not known.
FAR_TOO_LONG = 4.0

WEAR_ROUNDS = 20

# -- stepper -----------------------------------------------------

# Round-off of contact forces over the terms that cancel where nothing presses.
NOISE = 10 * float(np.finfo(float).eps)

# How many points that can not all be closed a message names.
NAMED = 4

# -- solve_step --------------------------------------------------

# Sway and turn of a tool over the way that it moves, below which what changes them is compared with
# this part of the way: a press down by 1 with a shift of 0.001 is one without.
HARDLY_MOVES = 0.01

# Contact force on a tool over the sum of its parts, from which on it has a direction.
PRESSED = 0.1

# -- grip, neutral_equilibrium -----------------------------------

# Weak springs, over the largest stiffness of a body: forces are found to six digits, and a factor of
# ten between the two is far from one.
WEAK = (1e-6, 1e-7)

# Where contact slides far and strains drive a body, to second order, weaker ones let it run off.
FIRM = (1e-3, 1e-4)

# Share of a point's force that is left with the weaker springs: 0.1 of what they make, 1 of the rest.
FALLS = 0.5

# Friction holds a motion at an angle to its direction by the square of the angle. Where that is below
# 1e-10, at 1e-5 rad, half of the digits of the place are lost: it counts as free, as what moves by
# `SOLVED` of a unit does.
ACROSS = 1e-4

# The smallest number that is divided by.
TINY = float(np.finfo(float).tiny)

# Where contact slides far its normals turn by the strains of the surfaces: motions that points hold by
# no more than that may be free. Whether they are the reaction of the held DOFs says.
TURNED = 1e-2

# Each round of moving the held DOFs gains the strain's digits: exact motions take two.
ROUNDS = 8

# What is found at rest moves little: no more cuts of the step than one.
FEW_CUTS = 1

# -- damping -----------------------------------------------------

# A loop is closed if its ends are nearer than this part of its width: so much of its area has no
# meaning, two digits of a damping that meshes and friction coefficients tell to one.
CLOSED = 0.01
