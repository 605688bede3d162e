"""Linear problems distributed over MPI ranks, solved by PETSc.

* `petsc`: the backend;
* `layout`: which rows each rank holds;
* `share`: what one rank holds of a matrix, and how all ranks together solve with it;
* `ranks`: rank 0 runs the script, the others serve it;
* `thresholds`: numbers, and where they come from.
"""
