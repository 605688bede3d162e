"""Numbers of distributed linear problems: what each is relative to, and where it comes from."""

from __future__ import annotations

# -- layout ------------------------------------------------------

# Diagonal entry of the triangular factor over the largest one below which a rigid motion follows from
# the others on the DOFs that are left, and is no direction of its own for multigrid.
SAME_MOTION = 1e-8

# -- ranks -------------------------------------------------------

# Seconds between two looks for the next command, at first and after a while: a rank that waits takes
# no core from the one that works. A linear problem that is worth distributing takes 1000 times as long.
SOON, LATER = 5e-4, 1e-2

# Looks for a command after which a rank looks less often: one second.
PATIENT = 2000

# Seconds after which rank 0 says that it waits for ranks that have not come to `PETSc()`.
MISSED_AFTER = 60.0

# Array entries that are sent in one message, whose length MPI counts in 32 bits.
AT_ONCE = 2**28

# -- assembly ----------------------------------------------------

# Elements of the pieces of a mesh that a rank assembles one after the other: scikit-fem takes some
# 40 kB for a hexahedron of 8 nodes, so this is 80 MB, and a call takes milliseconds.
ELEMENTS_AT_ONCE = 2000

# Difference between the stiffness of some elements and the sum of those of each, over its largest
# entry, above which the user's function is no sum over elements: round-off of sums of some ten entries
# is 1e-15, and springs that are softer than this change no answer.
SAME_SUM = 1e-10

# -- share -------------------------------------------------------

# The residual that conjugate gradients carry along drifts from the true one; an iteration is begun
# again from where it ended so many times, asked for this part of what it has to gain.
AGAIN, SURPLUS = 3, 0.5

# -- body_share, condensation ------------------------------------

# Right-hand sides that go through the factors together: 16 take 0.6 to 0.7 of the time that each takes
# alone, 64 take 0.55, 256 as much (16 000 and 49 000 DOFs of a solid, one rank; two of them 0.5).
# As many kept DOFs are few: what follows from each is kept, and no complement asked for.
COLUMNS_AT_ONCE = 64
