"""Linear problems distributed over MPI ranks, solved by PETSc.

* `petsc`: the backend;
* `layout`: which rows each rank holds;
* `assembly`: bodies assembled rank by rank, of pieces of their meshes; `rows`: what one rank holds of
  one; `stiffness`: what rank 0 knows of it;
* `stack`, `stacked`: the same of all bodies; `reduction`: their ``T'KT``;
* `share`: what one rank holds of a matrix, and how all ranks together solve with it;
* `database`: PETSc's options;
* `condensation`: a body condensed over all ranks; `body_share`: what one rank holds of it;
* `ranks`: rank 0 runs the script, the others serve it;
* `record`: how a linear problem was solved;
* `thresholds`: numbers, and where they come from.
"""

from skfem_contact.entrances import entrances

__getattr__ = entrances(
    __name__,
    {
        "assembly": "assembled collected numbering",
        "database": "command_line",
        "layout": "Layout bisected directions together",
        "reduction": "reduced",
        "share": "Share",
        "stack": "csr_of orthonormal",
        "stacked": "StackedStiffness",
    },
)
