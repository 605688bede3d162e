"""Linear problems distributed over MPI ranks, solved by PETSc.

Nothing else imports it; it plugs in as a backend (skfem_contact/linalg/backend.py), and bodies have its
stiffness as one that is held elsewhere (`bodies.member.RemoteStiffness`).

* `backend`: what users choose, ``sc.petsc.PETSc``, and a body condensed over all ranks;
* `ranks`: rank 0 runs the script, the others serve it;
* `assembly`: bodies assembled rank by rank, of pieces of their meshes; `stiffness`: the rows of
  one, and which of them each rank holds;
* `stacked`: the rows of all bodies, and their ``V'KT``;
* `share`: what one rank holds of a matrix, and how all ranks together solve with it, with which
  options; `body_share`: the same of a body that is condensed.
"""

from typing import TYPE_CHECKING

from skfem_contact.records import entrances

if TYPE_CHECKING:
    from skfem_contact.petsc.backend import PETSc as PETSc

__all__ = ["PETSc"]

__getattr__, __dir__ = entrances(
    __name__,
    __all__,
    {
        "assembly": "assembled collected numbering",
        "backend": "PETSc",
        "ranks": "csr_of",
        "share": "Share command_line",
        "stacked": "StackedStiffness",
        "stiffness": "Layout bisected directions orthonormal together",
    },
)
