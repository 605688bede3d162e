"""The part of a matrix that one rank holds, and how all ranks together solve with it.

How a matrix is to be solved with (`Settings`, over PETSc's options, `Database`), the rows of one rank
(`Share`, whose functions all ranks call at once), and how a solve went (`Solved`, `LinearSolve`).
"""

from __future__ import annotations

import ctypes
import logging
import sys
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import Array
from skfem_contact.errors import LinearSolveError
from skfem_contact.records import dataclass

logger = logging.getLogger("skfem_contact")

# Of PETSc's options on the command line.
PREFIX = "sc_"

# The residual that conjugate gradients carry along drifts from the true one; an iteration is begun
# again from where it ended so many times, asked for this part of what it has to gain.
AGAIN, SURPLUS = 3, 0.5

# Packages that do not condense bodies: SuperLU_DIST ended in a segmentation fault where such factors
# were given back, on one rank and on two (PETSc 3.18).
NOT_CONDENSING = ("superlu_dist",)

# Defaults of the options database, by method and symmetry; users' own come after.
MULTIGRID = {"pc_type": "gamg", "ksp_norm_type": "unpreconditioned"}
DEFAULTS: dict[tuple[str, bool], dict[str, str]] = {
    ("iterative", True): {"ksp_type": "cg", **MULTIGRID},
    ("iterative", False): {
        "ksp_type": "gmres",
        "ksp_pc_side": "right",
        "ksp_gmres_restart": "100",
        **MULTIGRID,
    },
    ("direct", True): {"ksp_type": "preonly", "pc_type": "cholesky"},
    ("direct", False): {"ksp_type": "preonly", "pc_type": "lu"},
}

# PETSc's KSPConvergedReason in words.
REASONS = {
    -3: "it did not end within max_iterations",
    -4: "the residual grew without bound",
    -5: "the iteration broke down",
    -6: "the iteration broke down",
    -8: "the preconditioner is not positive definite",
    -9: "a number was not finite",
    -10: "the matrix is not positive definite",
    -11: "the preconditioner could not be set up",
}


@dataclass(frozen=True)
class Settings:
    """The settings by which a matrix is solved with.

    Attributes
    ----------
    spd : bool
        Whether it is symmetric and positive definite.
    method : "iterative" or "direct"
    tol : float
        Largest ``|b - A x| / |b|``.
    max_iterations : int
    block : int
        Rows of a node.
    options : mapping
        Of PETSc, without prefix.
    keep : ndarray of int, optional
        Rows that are not eliminated, in the numbering of all ranks: what a body is condensed to.
    """

    spd: bool
    method: str
    tol: float
    max_iterations: int
    block: int
    options: Mapping[str, str]
    keep: NDArray[np.intp] | None = None


@dataclass(frozen=True)
class Solved:
    """The end of a solve.

    Attributes
    ----------
    iterations : int
    residual : float
        ``|b - A x| / |b|``, measured.
    reason : int
        PETSc's ``KSPConvergedReason``.
    local : float
        How far the residual moves a point that alone gives way, over the largest displacement.
    """

    iterations: int
    residual: float
    reason: int
    local: float


@dataclass(frozen=True)
class LinearSolve:
    """The way in which one linear problem was solved.

    Attributes
    ----------
    unknowns : int
    method : str
        Iteration and preconditioner as PETSc calls them, such as ``cg + gamg``.
    iterations : int
    residual : float
        ``|b - A x| / |b|``, measured.
    ranks : int
    setup, seconds : float
        Time of the preconditioner, of which the first of several solves has all, and of the solve [s].
    memory : int
        Matrices of all ranks together, those of multigrid or the factors included [bytes].
    columns : int
        Right-hand sides that were solved for together; residual and iterations are the largest.
    """

    unknowns: int
    method: str
    iterations: int
    residual: float
    ranks: int
    setup: float
    seconds: float
    memory: int
    columns: int = 1


def not_solved(name: str, how: Solved, tol: float) -> LinearSolveError:
    """The error of an iteration that ended above its tolerance."""
    known = REASONS.get(how.reason, f"PETSc's reason is {how.reason}")
    why = f"{known[0].upper()}{known[1:]}. " if how.reason < 0 else ""
    if how.residual <= tol:
        return LinearSolveError(
            f"PETSc, {name}: the residual is {how.residual:.1e} of the load after {how.iterations} "
            f"iterations, but moves single points by {how.local:.1e} of the largest displacement: "
            "some bodies or springs are much softer than others. Try PETSc(method='direct').",
            how.residual,
            how.iterations,
        )
    return LinearSolveError(
        f"PETSc, {name}: the residual is {how.residual:.1e} of the load after {how.iterations} "
        f"iterations, above tol={tol:.1e}. {why}Usually a rigid motion is "
        "left free, or springs are much stiffer than the bodies. Try PETSc(method='direct'), or a "
        "larger tol or max_iterations.",
        how.residual,
        how.iterations,
    )


class Share:
    """The rows of one rank; ready to solve with after `set_up`.

    Parameters
    ----------
    database : Database
    comm : communicator of mpi4py
    parts : list of ndarray
        Numbers of rows of this rank and of all ranks; ``indptr``, ``indices`` and ``data`` of the rows
        as of a csr_matrix; and, where there are any, rigid motions (rows of this rank, k).
    settings : Settings

    Attributes
    ----------
    memory : int
        Matrices of all ranks together, the coarse ones or the factors included [bytes].
    """

    def __init__(self, database: Database, comm: Any, parts: list[Array], settings: Settings) -> None:
        (here, size), indptr, indices, data, *motions = parts
        self.database, self.PETSc = database, database.PETSc
        PETSc = self.PETSc
        self.settings, self.index_bytes = settings, np.dtype(PETSc.IntType).itemsize
        csr = tuple(a.astype(PETSc.IntType, copy=False) for a in (indptr, indices))
        self.A = self.assembled(comm, ((here, size), (here, size)), (*csr, data))
        if motions and motions[0].shape[1]:
            columns = []
            for column in motions[0].T:
                vector = self.A.createVecLeft()
                vector.array[:] = column
                columns.append(vector)
            self.A.setNearNullSpace(PETSc.NullSpace().create(vectors=columns, comm=comm))
        self.x, self.b = self.A.createVecs()
        self.r, self.dx, self.moved = self.b.duplicate(), self.x.duplicate(), self.b.duplicate()
        self.scale = self.A.getDiagonal()
        if not settings.spd:  # rows of slipping points may have little on the diagonal
            self.scale.array[:] = _largest(indptr, data)
        self.ksp = PETSc.KSP().create(comm)
        self.ksp.setOperators(self.A)
        self.ksp.setOptionsPrefix(PREFIX)
        self.ksp.setTolerances(rtol=settings.tol, atol=0.0, max_it=settings.max_iterations)
        self.memory = 0

    def assembled(self, comm: Any, sizes: Any, csr: tuple[Array, ...]) -> Any:
        """A matrix by its rows on this rank."""
        matrix = self.PETSc.Mat().createAIJ(sizes, bsize=self.settings.block, csr=csr, comm=comm)
        if self.settings.spd:
            matrix.setOption(self.PETSc.Mat.Option.SYMMETRIC, True)
            matrix.setOption(self.PETSc.Mat.Option.SPD, True)
        return matrix

    def set_up(self) -> None:
        """Make the preconditioner."""
        with self._options():
            self.ksp.setFromOptions()
            self._before_set_up()
            self.ksp.setUp()
        self.memory = self._memory()

    def _options(self) -> AbstractContextManager[None]:
        """In the database for as long as PETSc reads them: the last ones when it solves."""
        return self.database.added(self._defaults(), self.settings.options)

    def _before_set_up(self) -> None:
        """Set what has to be set once the options are known."""

    def _defaults(self) -> dict[str, str]:
        defaults = dict(DEFAULTS[self.settings.method, self.settings.spd])
        if self.settings.method == "direct":
            package = direct_package(self.PETSc)
            if package != "mumps":
                defaults["pc_type"] = "lu"  # the others have no parallel Cholesky
            defaults["pc_factor_mat_solver_type"] = package or "petsc"
        return defaults

    @property
    def name(self) -> str:
        """Iteration and preconditioner as PETSc calls them, such as ``cg + gamg``."""
        return f"{self.ksp.getType()} + {self.ksp.getPC().getType()}"

    def told(
        self, how: Solved, unknowns: int, setup: float, seconds: float, memory: int, columns: int = 1
    ) -> LinearSolve:
        """What is kept of a solve, which is logged."""
        ranks = self.A.comm.size
        solve = LinearSolve(
            unknowns, self.name, how.iterations, how.residual, ranks, setup, seconds, memory, columns
        )
        logger.info("PETSc on %d ranks: %s", ranks, solve)
        return solve

    def _memory(self) -> int:
        pc, per_entry = self.ksp.getPC(), 8 + self.index_bytes
        count = entries(self.A)
        if pc.getType() in ("gamg", "mg"):
            for level in range(1, pc.getMGLevels()):
                count += entries(pc.getMGInterpolation(level))
                count += entries(pc.getMGSmoother(level - 1).getOperators()[0])
        elif pc.getType() in ("lu", "cholesky"):
            factors = pc.getFactorMatrix()
            mumps = factors.getType() == "mumps" or pc.getFactorSolverType() == "mumps"
            count += _mumps_entries(factors) if mumps else entries(factors)
        return per_entry * count

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.ksp, self.A, self.x, self.b, self.r, self.dx, self.moved, self.scale):
            part.destroy()

    def solve(self, b: Array) -> tuple[Array, Solved]:
        """This rank's rows of ``A^-1 b``, and how it went."""
        tol, most = self.settings.tol, self.settings.max_iterations
        self.b.array[:] = b
        self.x.set(0.0)
        size = self.b.norm()
        if size == 0.0:
            return self.x.array.copy(), Solved(0, 0.0, 1, 0.0)
        self.b.copy(self.r)
        best, residual, local, iterations, begin = np.inf, 1.0, np.inf, 0, self.ksp.rtol
        for again in range(1 + AGAIN):
            with self._options():
                self.ksp.solve(self.r, self.dx)
            made = int(self.ksp.getIterationNumber())
            iterations += made
            reason = self.ksp.getConvergedReason()
            self.dx.axpy(1.0, self.x)  # what would be the answer now
            self.A.mult(self.dx, self.r)
            self.r.aypx(-1.0, self.b)
            self._only_eliminated(self.r)
            now = self.r.norm() / size, self._moved()
            # the first answer may be far off where bodies are soft: it is what the next ones begin with
            if not now[0] < 1.0 or (again and not max(now) < best):  # or NaN
                break
            self.dx.copy(self.x)
            residual, local = now
            best = max(now)
            if reason < 0 or best <= tol or iterations >= most:
                break
            left = most - iterations if residual > tol else min(most - iterations, 2 * made)
            self.ksp.setTolerances(rtol=SURPLUS * tol / best, max_it=max(left, 1))
        self.ksp.setTolerances(rtol=begin, max_it=most)
        return self.x.array.copy(), Solved(iterations, float(residual), int(reason), float(local))

    def _only_eliminated(self, r: Any) -> None:
        """Without rows that are not eliminated, of which there are none here."""

    def _moved(self) -> float:
        """Return how far the residual moves a point that gives way alone, over the largest movement.

        A residual that is small beside the load of a stiff body may be large for a soft one.
        """
        most = self.dx.norm(self.PETSc.NormType.INFINITY)
        self.r.copy(self.moved)
        self.moved.pointwiseDivide(self.moved, self.scale)
        moved = self.moved.norm(self.PETSc.NormType.INFINITY)
        return float(moved / most) if most > 0.0 else 0.0


def _largest(indptr: Any, data: Array) -> Array:
    """Largest magnitude of each row, 1 where it is empty or zero.

    >>> _largest(np.array([0, 2, 2, 3]), np.array([1.0, -5.0, 2.0])).tolist()
    [5.0, 1.0, 2.0]
    """
    out = np.zeros(len(indptr) - 1)
    there = np.flatnonzero(np.diff(indptr))
    if len(there):
        out[there] = np.maximum.reduceat(np.abs(data), indptr[:-1][there])
    out[out == 0.0] = 1.0
    return out


def entries(matrix: Any) -> int:
    return int(matrix.getInfo(matrix.InfoType.GLOBAL_SUM)["nz_used"])


def _mumps_entries(factors: Any) -> int:
    """Entries of the factors, which MUMPS counts in millions where they are many."""
    entries = int(factors.getMumpsInfog(29))
    return entries if entries >= 0 else -1_000_000 * entries


def direct_package(PETSc: Any) -> str:
    """The package that factorises on these ranks; none is PETSc's own, for one rank."""
    for package in ("mumps", "superlu_dist"):
        if PETSc.Sys.hasExternalPackage(package):
            return package
    return ""


def chosen_package(database: Database, options: Mapping[str, str]) -> str:
    """The same, or what options ask for, of which those of the command line come first."""
    name = "pc_factor_mat_solver_type"
    given = database.PETSc.Options().getAll().get(PREFIX + name, options.get(name))
    return given or direct_package(database.PETSc)


def command_line() -> list[str]:
    """Return what the command line says to PETSc: ``-sc_...`` and its values."""
    given, ours = [sys.argv[0] if sys.argv else ""], False
    for word in sys.argv[1:]:
        if word.startswith("-") and not word[1:2].isdigit():
            ours = word.lstrip("-").startswith(PREFIX)
            word = "-" + word.lstrip("-") if ours else word
        if ours:
            given.append(word)
    return given


class Database:
    """The database of this process.

    Attributes
    ----------
    read : dict
        Of each option that solves have added, without hyphen, whether PETSc has read it so far.
    """

    def __init__(self, PETSc: Any) -> None:
        self.PETSc, self.options = PETSc, PETSc.Options()
        self.read: dict[str, bool] = {}
        # where the script has used petsc4py before, PETSc has not been told of the command line by us
        present = self.options.getAll()
        name = ""
        for word in command_line()[1:]:
            if word.startswith("-" + PREFIX):
                name = word[1:]
                if name not in present:
                    self.options[name] = ""
            elif name and name not in present:
                self.options[name], name = word, ""

    @contextmanager
    def added(self, defaults: Mapping[str, str], options: Mapping[str, str]) -> Iterator[None]:
        """With these, without prefix, as far as the command line does not say otherwise."""
        given = self.options.getAll()  # the command line, and the variable PETSC_OPTIONS
        own = {PREFIX + name: value for name, value in {**defaults, **options}.items()}
        own = {name: value for name, value in own.items() if name not in given}
        for name, value in own.items():
            self.options[name] = value
        try:
            yield
        finally:
            for name in own:
                if name.removeprefix(PREFIX) in options:
                    self.read[name] = self.read.get(name, False) or self._has_read(name)
                self.options.delValue(name)

    def unread(self) -> list[str]:
        """Options of ours that PETSc has never looked for."""
        given = [name for name in self.options.getAll() if name.startswith(PREFIX)]
        names = [name for name in given if not self._has_read(name)]
        return sorted({*names, *(name for name, read in self.read.items() if not read)})

    def _has_read(self, name: str) -> bool:
        """petsc4py does not say so, PETSc does; what can not be asked counts as read."""
        try:
            ask = ctypes.CDLL(self.PETSc.__file__).PetscOptionsUsed
        except (OSError, AttributeError):
            return True
        answer = (ctypes.c_int * 2)()
        ask.argtypes = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p
        return bool(ask(None, name.encode(), answer)) or any(answer)
