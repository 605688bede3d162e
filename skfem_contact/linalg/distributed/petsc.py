"""`PETSc`: linear problems distributed over MPI ranks."""

from __future__ import annotations

import logging
import time
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import repeat
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arguments import number, shown, with_known_keywords
from skfem_contact.errors import InputError
from skfem_contact.linalg.backend import Backend, Factorisation, LinearSolveError, by_column
from skfem_contact.linalg.distributed.layout import Layout, directions
from skfem_contact.linalg.distributed.ranks import Ranks, ranks
from skfem_contact.linalg.distributed.share import PREFIX, Settings, Solved, direct_package
from skfem_contact.linalg.singular import check_eigenvalue, singular
from skfem_contact.linalg.thresholds import ACCEPTED

logger = logging.getLogger("skfem_contact")

METHODS = ("iterative", "direct")

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
class LinearSolve:
    """How one linear problem was solved.

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
    """

    unknowns: int
    method: str
    iterations: int
    residual: float
    ranks: int
    setup: float
    seconds: float
    memory: int


@with_known_keywords(tolerance="write tol", maxiter="write max_iterations")
@dataclass(frozen=True)
class PETSc(Backend):
    """Linear problems distributed over MPI ranks, by PETSc: ``mpirun -n 4 python script.py``.

    Every rank runs the script as far as the first `PETSc()`. From there rank 0 goes on alone, and the
    others hold rows of its matrices and solve with them, until it ends. So make it at the top of the
    script: the others then hold nothing else. Without ``mpirun`` there is one rank.

    Parameters
    ----------
    method : str
        ``"iterative"``: conjugate gradients, or GMRES where slipping points of the loop newton make
        the matrix unsymmetric, preconditioned by smoothed aggregation (GAMG) with rigid motions;
        ``"direct"``: MUMPS, where PETSc has it, else SuperLU_DIST, else on one rank PETSc's own LU.
    tol : float
        Largest ``|b - A x| / |b|`` accepted of an iteration.
    max_iterations : int
        More raise `LinearSolveError`. Well posed problems need 10 to 40.
    options : mapping, optional
        Of PETSc's options database, without prefix: ``{"pc_type": "hypre"}``. On the command line,
        which comes last and wins, the prefix is ``sc_``: ``-sc_pc_type hypre``.

    Attributes
    ----------
    solves : list of LinearSolve
        Iterations, residual, time and memory of all solves so far.

    Raises
    ------
    InputError
        If petsc4py and mpi4py are not installed.

    Examples
    --------
    At the top of a script that ``mpirun -n 4`` starts::

        linear = sc.PETSc()
        ...
        result = sc.ContactSolver(bodies, contacts, linear=linear).solve()
        print(linear.solves[-1].iterations)

    A script that is to run where there is no PETSc as well:

    >>> import skfem_contact as sc
    >>> try:
    ...     linear = sc.PETSc(tol=1e-9)
    ... except sc.InputError as error:  # says how to install it
    ...     linear = sc.AMG(tol=1e-9)
    >>> linear.tol
    1e-09
    """

    method: str = "iterative"
    tol: float = 1e-10
    max_iterations: int = 500
    options: Mapping[str, str] = field(default_factory=dict, hash=False)
    solves: list[LinearSolve] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.method, str) or self.method not in METHODS:
            raise InputError(f"PETSc(method={self.method!r}): known are 'iterative' and 'direct'.")
        tol = number(self.tol, "tol of PETSc", "give a share of the load, such as 1e-10")
        if not 0 < tol < 1:
            raise InputError(f"tol of PETSc is {tol}; give a share of the load, such as 1e-10")
        if not isinstance(self.max_iterations, int | np.integer) or self.max_iterations < 1:
            raise InputError(f"max_iterations of PETSc is {shown(self.max_iterations)}; give a number")
        object.__setattr__(self, "options", _checked(self.options))
        object.__setattr__(self, "uses_modes", self.method == "iterative")
        own = ranks()
        if self.method == "direct" and own.size > 1 and not direct_package(own.PETSc):
            raise InputError(
                f"PETSc(method='direct') on {own.size} ranks needs MUMPS or SuperLU_DIST, and this "
                "PETSc has neither: use method='iterative', or one rank."
            )

    @property
    def ranks(self) -> int:
        """How many ranks there are."""
        return ranks().size

    def memory(self) -> list[int]:
        """Largest memory that each rank has had so far, all of the process [bytes]."""
        return ranks().memory()

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        begin, own, A = time.perf_counter(), ranks(), csr_matrix(A)
        layout = Layout.of(A.shape[0], points, modes, own.size)
        _check_size(layout, A, own)
        settings = Settings(
            spd, self.method, float(self.tol), int(self.max_iterations), layout.block, self.options
        )
        near = repeat(None, own.size) if modes is None else layout.vectors(directions(modes))
        key = own.factorize(layout.matrices(A), near, settings)
        share, scale = own.shares[key], abs(A).max(axis=1).toarray().ravel()
        spent, memory = time.perf_counter() - begin, share.memory

        def solve(b: np.ndarray) -> np.ndarray:
            nonlocal spent
            start = time.perf_counter()
            x, how = own.solve(key, layout.vectors(b))
            seconds = time.perf_counter() - start
            told = LinearSolve(
                len(b), share.name, how.iterations, how.residual, own.size, spent, seconds, memory
            )
            spent = 0.0
            logger.info("PETSc on %d ranks: %s", own.size, told)
            self.solves.append(told)
            self._check(how, share.name)
            return x[layout.slot]

        if self.method == "direct":
            check_eigenvalue(scale, solve)
        weakref.finalize(solve, own.drop, key)
        return Factorisation(f"PETSc, {share.name} on {own.size} ranks", memory, by_column(solve))

    def _check(self, how: Solved, name: str) -> None:
        """Raise what a solve that failed has to say."""
        direct = self.method == "direct"
        if direct and (how.reason < 0 or not how.residual <= ACCEPTED):
            raise singular(-1, 0.0)
        if direct or how.residual <= self.tol:
            return
        known = REASONS.get(how.reason, f"PETSc's reason is {how.reason}")
        why = f"{known[0].upper()}{known[1:]}. " if how.reason < 0 else ""
        raise LinearSolveError(
            f"PETSc, {name}: the residual is {how.residual:.1e} of the load after {how.iterations} "
            f"iterations, above tol={self.tol:.1e}. {why}Usually a rigid motion is "
            "left free, or springs are much stiffer than the bodies. Try PETSc(method='direct'), or a "
            "larger tol or max_iterations.",
            how.residual,
            how.iterations,
        )


def _checked(options: Any) -> dict[str, str]:
    """Options of the database by plain names."""
    if not isinstance(options, Mapping):
        raise InputError(
            f"options of PETSc is {shown(options)}; give a dict such as {{'pc_type': 'hypre'}}"
        )
    checked = {}
    for name, value in options.items():
        if not isinstance(name, str) or not isinstance(value, str | int | float | None):
            raise InputError(
                f"options of PETSc has {name!r}: {value!r}; names are strings, values plain"
            )
        text = "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
        checked[name.lstrip("-").removeprefix(PREFIX)] = text
    return checked


def _check_size(layout: Layout, A: csr_matrix, own: Ranks) -> None:
    most = np.iinfo(own.PETSc.IntType).max
    if max(layout.size, A.nnz // own.size) > most:
        raise InputError(
            f"{A.nnz} entries in {layout.size} rows on {own.size} ranks are more than the integers of "
            f"this PETSc can count, {most} on each: use more ranks, or a PETSc with 64-bit indices."
        )
