"""`BodyShare`: what one rank holds of a body that is condensed, and what all ranks do with it.

All ranks together have K by rows, on the DOFs that are not prescribed. Its interior i is factorised,
what is kept, c, is not. Every function here is called by all ranks at once.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np

from skfem_contact.arrays import Array, Index
from skfem_contact.errors import LinearSolveError
from skfem_contact.petsc.share import AGAIN, Database, Settings, Share, Solved, entries

# Right-hand sides that go through the factors together: 16 take 0.6 to 0.7 of the time that each takes
# alone, 64 take 0.55, 256 as much (16 000 and 49 000 DOFs of a solid, one rank; two of them 0.5).
# As many kept DOFs are few: what follows from each is kept, and no complement asked for.
COLUMNS_AT_ONCE = 64

# Packages that solve for several right-hand sides at once; with the Schur complement of MUMPS, PETSc
# has no blocks on several ranks.
BLOCKS = ("mumps", "petsc")

# What MUMPS says of a factorisation that failed, by its INFOG(1).
FAILED = {
    -5: "MUMPS could not get the memory for its analysis",
    -7: "MUMPS could not get the memory for its analysis",
    -8: "the workspace that MUMPS had estimated was too small: PETSc('direct', options={"
    "'mat_mumps_icntl_14': 100}) gives it twice as much",
    -9: "the workspace that MUMPS had estimated was too small: PETSc('direct', options={"
    "'mat_mumps_icntl_14': 100}) gives it twice as much",
    -10: "a pivot is zero",
    -13: "MUMPS could not get the memory for the factors",
    -19: "the memory that mat_mumps_icntl_23 allows is too small for the factors",
}


class BodyShare(Share):
    """The rows of one rank of a body whose interior is factorised.

    Parameters
    ----------
    database, comm, parts, settings
        As of `Share`; `settings.keep` are the rows of all ranks that are not eliminated.

    Attributes
    ----------
    mine : ndarray of int
        Rows of this rank that are kept, in the order of `settings.keep`.
    has_complement : bool
        Whether the factorisation leaves the Schur complement on rank 0.
    """

    def __init__(self, database: Database, comm: Any, parts: list[Array], settings: Settings) -> None:
        super().__init__(database, comm, parts, settings)
        assert settings.keep is not None
        begin, end = self.A.getOwnershipRange()
        keep = settings.keep
        self.mine = keep[(begin <= keep) & (keep < end)] - begin
        self.has_complement = False
        self._interior: Any = None

    def _before_set_up(self) -> None:
        keep, pc = self.settings.keep, self.ksp.getPC()
        assert keep is not None
        if not len(keep):
            return
        mumps = pc.getType() == "cholesky" and self._package == "mumps"
        if mumps and len(keep) > COLUMNS_AT_ONCE and schur_available(self.PETSc):
            pc.setFactorSetUpSolverType()
            rows = keep if self.A.comm.rank == 0 else keep[:0]
            leave_schur(self.PETSc, pc.getFactorMatrix(), rows)
            self.has_complement = True
            return
        self._interior = self._without(keep)
        self.ksp.setOperators(self._interior)

    def _without(self, keep: Index) -> Any:
        """K with nothing but a diagonal entry in each row and column that is kept."""
        indptr, columns, values = self.A.getValuesCSR()
        (here, _), (begin, _) = self.A.getLocalSize(), self.A.getOwnershipRange()
        gone = np.zeros(self.A.getSize()[1], dtype=bool)
        gone[keep] = True
        rows = np.repeat(np.arange(here), np.diff(indptr))
        alone = gone[columns] | gone[begin + rows]
        left = ~alone | (columns == begin + rows)  # all rows of K have a diagonal entry
        length = np.bincount(rows[left], minlength=here)
        start = np.concatenate([[0], np.cumsum(length)]).astype(self.PETSc.IntType)
        return self.assembled(self.A.comm, self.A.getSizes(), (start, columns[left], values[left]))

    def set_up(self) -> None:
        """Factorise the interior."""
        super().set_up()
        if self.has_complement:
            # which part of solutions is asked for: that of the eliminated rows alone
            self.ksp.getPC().getFactorMatrix().setMumpsIcntl(26, 0)

    @property
    def _package(self) -> str:
        """Of the factors; nothing where there are none, which users' options may bring about."""
        pc = self.ksp.getPC()
        return str(pc.getFactorSolverType()) if pc.getType() in ("lu", "cholesky") else ""

    def _memory(self) -> int:
        if self._interior is None:
            return super()._memory()
        return super()._memory() + (8 + self.index_bytes) * entries(self._interior)

    @property
    def factorises(self) -> bool:
        """The interior is factorised; users' options may have it iterated."""
        return bool(self._package)

    def trouble(self) -> tuple[str, int]:
        """Why the factorisation failed, in words, or none; and how many pivots are negative."""
        if self._package != "mumps":
            return "", 0
        pc = self.ksp.getPC()
        factors = pc.getFactorMatrix()
        code = int(factors.getMumpsInfog(1))
        words = FAILED.get(code, f"MUMPS returned the error {code}") if code < 0 else ""
        return words, int(factors.getMumpsInfog(12)) if pc.getType() == "cholesky" else 0

    def complement(self) -> Array:
        """Return the Schur complement of the kept rows, on rank 0, one triangle of it, (n_c, n_c)."""
        assert self.settings.keep is not None
        factors = self.ksp.getPC().getFactorMatrix()
        return schur_complement(self.PETSc, factors, len(self.settings.keep))

    def eliminated(self, F: Array) -> tuple[Array, Solved]:
        """This rank's rows of ``K_ii^-1 F_i``, and where they are kept ``F_c - K_ci K_ii^-1 F_i``.

        Both (here, r).
        """
        B = F.copy()
        B[self.mine] = 0.0
        X, how = self._columns(B)
        X[self.mine] = F[self.mine] - self._times(X)[self.mine]
        return X, how

    def coupled(self, U: Array) -> tuple[Array, Array, Solved]:
        """This rank's rows of what follows displacements of its kept rows, and the forces on these.

        ``-K_ii^-1 K_ic U``, with U itself in the rows that are kept, (here, r); and ``S U`` (k, r).
        """
        Y = np.zeros((self.A.getLocalSize()[0], U.shape[1]))
        Y[self.mine] = U
        B = -self._times(Y)
        B[self.mine] = 0.0
        X, how = self._columns(B)
        X[self.mine] = U
        return X, self._times(X)[self.mine], how

    def _times(self, X: Array) -> Array:
        """Rows of ``K X``."""
        out = np.empty_like(X)
        vector, product = self.A.createVecs()
        for x, row in zip(X.T, out.T, strict=True):
            vector.array[:] = x
            self.A.mult(vector, product)
            row[:] = product.array
        vector.destroy()
        product.destroy()
        return out

    def _only_eliminated(self, r: Any) -> None:
        r.array[self.mine] = 0.0

    def _columns(self, B: Array) -> tuple[Array, Solved]:
        """Rows of ``K_ii^-1 B``, which are zero where they are kept, as in B; and the worst column."""
        if B.shape[1] > 1 and self._package in BLOCKS and not self.has_complement:
            return self._block(B)
        found = [self.solve(np.ascontiguousarray(b)) for b in B.T]
        if not found:
            return B.copy(), Solved(0, 0.0, 1, 0.0)
        ways = [how for _, how in found]
        worst = max(ways, key=lambda how: np.nan_to_num(how.residual, nan=np.inf))
        most = max(how.iterations for how in ways)
        local = max(how.local for how in ways)
        how = Solved(most, worst.residual, worst.reason, local)
        return np.column_stack([x for x, _ in found]), how

    def _block(self, B: Array) -> tuple[Array, Solved]:
        """All columns at once, which goes through the factors once for all of them."""
        comm, factors = self.A.comm.tompi4py(), self.ksp.getPC().getFactorMatrix()
        X, R, best = np.zeros_like(B), B, 1.0
        size = np.sqrt(comm.allreduce(np.sum(B**2, axis=0)))
        size[size == 0.0] = 1.0
        tries = 0
        while tries <= AGAIN:
            tries += 1
            right, found = self._dense(R), self._dense(X)
            factors.matSolve(right, found)
            better = X + found.getDenseArray()
            right.destroy()
            found.destroy()
            R = B - self._times(better)
            R[self.mine] = 0.0
            left = np.sqrt(comm.allreduce(np.sum(R**2, axis=0))) / size
            worst = float(np.max(left))
            if not worst < best:  # or NaN
                break
            X, best = better, worst
            if best <= self.settings.tol:
                break
        each = np.array(
            [np.abs(R / self.scale.array[:, None]).max(initial=0.0), np.abs(X).max(initial=0.0)]
        )
        moved, most = np.max(comm.allgather(each), axis=0)
        return X, Solved(tries, best, 1, float(moved / most) if most > 0.0 else 0.0)

    def _dense(self, columns: Array) -> Any:
        shape = self.A.getSizes()[0], (None, columns.shape[1])
        array = np.array(columns, order="F")
        return self.PETSc.Mat().createDense(shape, array=array, comm=self.A.comm)

    def destroy(self) -> None:
        """Give the memory back."""
        super().destroy()
        if self._interior is not None:
            self._interior.destroy()


NAMES = (
    "MatFactorSetSchurIS",
    "MatFactorGetSchurComplement",
    "MatFactorRestoreSchurComplement",
    "MatDenseGetArrayRead",
    "MatDenseRestoreArrayRead",
)


@lru_cache(maxsize=1)
def _library(path: str) -> Any:
    return ctypes.CDLL(path)


def schur_available(PETSc: Any) -> bool:
    """Return whether all functions are there."""
    try:
        library = _library(PETSc.__file__)
    except OSError:
        return False
    return all(hasattr(library, name) for name in NAMES)


def _call(PETSc: Any, name: str, *given: Any) -> None:
    code = getattr(_library(PETSc.__file__), name)(*given)
    if code:
        raise LinearSolveError(f"PETSc's function {name} returned the error {code}.")


def leave_schur(PETSc: Any, factors: Any, rows: Index) -> None:
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


def schur_complement(PETSc: Any, factors: Any, n: int) -> Array:
    """A copy of what is left, (n, n), on rank 0: of its two triangles only one is good."""
    held, matrix, status = (ctypes.c_void_p(factors.handle), ctypes.c_void_p(), ctypes.c_int())
    _call(PETSc, "MatFactorGetSchurComplement", held, ctypes.byref(matrix), ctypes.byref(status))
    start = ctypes.POINTER(ctypes.c_double)()
    _call(PETSc, "MatDenseGetArrayRead", matrix, ctypes.byref(start))
    copy = np.array(np.ctypeslib.as_array(start, (n, n)))
    _call(PETSc, "MatDenseRestoreArrayRead", matrix, ctypes.byref(start))
    _call(PETSc, "MatFactorRestoreSchurComplement", held, ctypes.byref(matrix), status)
    return copy
