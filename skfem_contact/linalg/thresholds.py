"""Numbers of the linear solvers: what each is relative to, and where it comes from."""

from __future__ import annotations

# -- direct ------------------------------------------------------

# Residual over load up to which a solver of the user's own is trusted: conjugate gradients of
# skfem.utils leave some 1e-6 at their default tolerance.
ACCEPTED = 1e-4

# -- dense_factors -----------------------------------------------

# Rows of a dense matrix that are worked on at once: enough for matrix products, few beside the matrix.
ROWS_AT_ONCE = 1024

# Rows of a triangle that are copied at once: few operations, and a block that caches hold.
MIRRORED_AT_ONCE = 128

# -- resources ---------------------------------------------------

# Twice the bytes of the factors of squares over n log2 n, and of cubes over n^1.37: 3.2 GB are taken by
# a million DOFs in the plane; 0.21, 0.98 and 2.8 GB for 30 000, 95 000 and 202 000 in space.
FACTORS_2D, FACTORS_3D = 240.0, 300.0

# -- krylov ------------------------------------------------------

# Directions that there is memory for at first: as many as most solves take. Memory that the system
# gives out anew takes longer to be touched than these take to be orthogonalised.
AT_FIRST = 12

# Length of a direction over that before others were taken away from it, below which their round-off
# is a share of it that counts, and they are taken away once more (Daniel and others, 1976).
CANCELS = 0.5

# -- multifrontal.factor -----------------------------------------

LEAF = 120  # DOFs: below, the calls cost more than the arithmetic; above, the fill-in

# -- singular ----------------------------------------------------

# A pivot divided by its diagonal entry: 0.1 in a body that is well held, 1e-9 in a cantilever of
# 1000 elements, round-off where a rigid motion is free: up to 1e-12, as it grows with the mesh.
# So suspicious pivots are followed by an estimate of the smallest eigenvalue of K scaled to a unit
# diagonal. That is below 1e-16 for a rigid motion, and 1e-12 for the same cantilever.
LOST, SUSPICIOUS, NEGLIGIBLE = 1e-13, 1e-8, 1e-15

# -- multifrontal.fronts -----------------------------------------
