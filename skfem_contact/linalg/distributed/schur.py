"""The Schur complement that MUMPS leaves of rows it was told not to eliminate.

PETSc has it on any number of ranks, with all of those rows listed by rank 0, which then has the dense
result. petsc4py (3.18) has no names for these functions; they are called in the library that it is
linked with. Where they are missing, `available` says so, and the complement is made by solves.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.linalg.backend import LinearSolveError

Array = NDArray[np.float64]
Index = NDArray[np.intp]

NAMES = (
    "MatFactorSetSchurIS",
    "MatFactorGetSchurComplement",
    "MatFactorRestoreSchurComplement",
    "MatDenseGetArrayRead",
    "MatDenseRestoreArrayRead",
)

# Of MUMPS' settings: which part of the solution is asked for; 0 is that of the eliminated rows alone.
SOLUTION, ELIMINATED = 26, 0


@lru_cache(maxsize=1)
def _library(path: str) -> Any:
    return ctypes.CDLL(path)


def available(PETSc: Any) -> bool:
    """Whether all functions are there."""
    try:
        library = _library(PETSc.__file__)
    except OSError:
        return False
    return all(hasattr(library, name) for name in NAMES)


def _call(PETSc: Any, name: str, *given: Any) -> None:
    code = getattr(_library(PETSc.__file__), name)(*given)
    if code:
        raise LinearSolveError(f"PETSc's function {name} returned the error {code}.")


def leave(PETSc: Any, factors: Any, rows: Index) -> None:
    """Say which rows are not to be eliminated; every rank calls it, and those other than 0 name none.

    Parameters
    ----------
    PETSc : module
    factors : petsc4py.PETSc.Mat
        Of MUMPS, before they are computed.
    rows : ndarray of int
        In the numbering of all ranks.
    """
    wanted = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
    _call(PETSc, "MatFactorSetSchurIS", ctypes.c_void_p(factors.handle), ctypes.c_void_p(wanted.handle))
    wanted.destroy()


def solve_eliminated(factors: Any) -> None:
    """Let solves be with the eliminated rows alone; to be said once the factors are there."""
    factors.setMumpsIcntl(SOLUTION, ELIMINATED)


def complement(PETSc: Any, factors: Any, n: int) -> Array:
    """A copy of what is left, (n, n), on rank 0: of its two triangles only one is good."""
    held, matrix, status = (
        ctypes.c_void_p(factors.handle),
        ctypes.c_void_p(),
        ctypes.c_int(),
    )
    _call(PETSc, "MatFactorGetSchurComplement", held, ctypes.byref(matrix), ctypes.byref(status))
    start = ctypes.POINTER(ctypes.c_double)()
    _call(PETSc, "MatDenseGetArrayRead", matrix, ctypes.byref(start))
    copy = np.array(np.ctypeslib.as_array(start, (n, n)))
    _call(PETSc, "MatDenseRestoreArrayRead", matrix, ctypes.byref(start))
    _call(PETSc, "MatFactorRestoreSchurComplement", held, ctypes.byref(matrix), status)
    return copy
