"""`PETSc`: linear problems distributed over MPI ranks."""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from skfem.assembly import CellBasis

from skfem_contact.arguments import number, shown, whole_number, with_known_keywords
from skfem_contact.bodies.member import Member
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError
from skfem_contact.linalg.backend import Backend, BodyFactor, Factorisation, by_column
from skfem_contact.linalg.direct import Direct
from skfem_contact.linalg.singular import check_diagonal, check_eigenvalue, singular
from skfem_contact.linalg.thresholds import ACCEPTED
from skfem_contact.petsc.assembly import assembled, collected, numbering
from skfem_contact.petsc.condensation import DistributedFactor
from skfem_contact.petsc.ranks import ranks
from skfem_contact.petsc.share import (
    NOT_CONDENSING,
    PREFIX,
    LinearSolve,
    Settings,
    Solved,
    chosen_package,
    direct_package,
    not_solved,
)
from skfem_contact.petsc.stacked import ReducedStiffness, StackedStiffness
from skfem_contact.petsc.stiffness import DistributedStiffness, Layout, directions

METHODS = ("iterative", "direct")


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
        With these each body is condensed to its contact DOFs once, as by default without PETSc
        (SuperLU_DIST does not); iteratively, contact is eliminated from all DOFs in every iteration.
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

        linear = sc.petsc.PETSc()
        ...
        result = sc.ContactSolver(bodies, contacts, linear=linear).solve()
        print(linear.solves[-1].iterations)

    A script that is to run where there is no PETSc as well:

    >>> import skfem_contact as sc
    >>> try:
    ...     linear = sc.petsc.PETSc(tol=1e-9)
    ... except sc.errors.InputError as error:  # says how to install it
    ...     linear = sc.linalg.AMG(tol=1e-9)
    >>> linear.tol
    1e-09
    """

    distributed = True  # takes stiffness that is held rank by rank
    complements = 1  # MUMPS keeps what it leaves on rank 0

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
        whole_number(self.max_iterations, "max_iterations of PETSc", 1)
        object.__setattr__(self, "options", _checked(self.options))
        object.__setattr__(self, "uses_modes", self.method == "iterative")
        own = ranks()
        able = chosen_package(own.database, self.options) not in NOT_CONDENSING
        object.__setattr__(self, "condenses", self.method == "direct" and able)
        if self.method == "direct" and own.size > 1 and not direct_package(own.PETSc):
            raise InputError(
                f"PETSc(method='direct') on {own.size} ranks needs MUMPS or SuperLU_DIST, and this "
                "PETSc has neither: use method='iterative', or one rank."
            )

    @property
    def ranks(self) -> int:
        """The number of ranks."""
        return ranks().size

    def numbering(self, mesh: Any, element: Any) -> CellBasis:
        """A basis without points of integration: what a body needs whose K is assembled elsewhere.

        Shape functions at points of integration are what fills rank 0, some kB for each DOF of a
        solid. Nothing can be integrated on this basis; forms are refused.
        """
        return numbering(mesh, element)

    def assemble(self, function: Callable[[Any], Any], basis: CellBasis) -> DistributedStiffness:
        """The stiffness of a body, assembled rank by rank on pieces of its mesh.

        Parameters
        ----------
        function : callable
            ``function(mesh)``: the stiffness (sparse) of a piece of the mesh, in the numbering of
            ``Basis(mesh, element)``. Each rank calls it with its own piece, which has the boundaries
            and subdomains of the mesh by name. By def above the first `PETSc()`, where all ranks
            find it, or in a module; settings go with functools.partial.
        basis : skfem.CellBasis
            Of the body, see `numbering`.

        Returns
        -------
        DistributedStiffness
            `K` of a `Body`.

        Raises
        ------
        InputError
            A function without name, matrices that are not symmetric, or of another size.

        Examples
        --------
        In a script that ``mpirun -n 4`` starts::

            def stiffness(mesh):
                basis = fem.Basis(mesh, ELEMENT, intorder=2)
                return linear_elasticity().assemble(basis)


            linear = sc.petsc.PETSc()
            basis = linear.numbering(mesh, ELEMENT)
            body = sc.Body(basis, linear.assemble(stiffness, basis), D="bottom")
        """
        return assembled(ranks(), function, basis)

    def collect(self, function: Callable[[int, int], Any]) -> DistributedStiffness:
        """The stiffness of a body, from matrices that each rank has.

        Parameters
        ----------
        function : callable
            ``function(rank, ranks)``: DOFs of the body (k,), each once, and a symmetric sparse matrix
            (k, k) over them; K is the sum over all ranks. Found by its name, as for `assemble`.

        Returns
        -------
        DistributedStiffness

        Raises
        ------
        InputError
            A function without name, matrices that are not symmetric, DOFs that no rank has.
        """
        return collected(ranks(), function)

    def stacked(self, bodies: Sequence[Member], stiffness: Sequence[Any]) -> StackedStiffness:
        """The stiffness of all bodies, of which some were assembled rank by rank."""
        return StackedStiffness.of(bodies, stiffness, self.uses_modes)

    def condensed(self, body: Member, K: Any, free: np.ndarray, keep: np.ndarray) -> BodyFactor:
        """Factors of one body over all ranks; of a rigid one, all of which is kept, on rank 0."""
        if len(keep) == len(free):
            return Direct().condensed(body, K, free, keep)
        settings = self._settings(spd=True, block=1)
        return DistributedFactor(ranks(), body, K, free, keep, settings, self.solves.append)

    def memory(self) -> list[int]:
        """Largest memory that each rank has had so far, all of the process [bytes]."""
        return ranks().memory()

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        begin, own = time.perf_counter(), ranks()
        if not A.shape[0]:  # all DOFs are prescribed or eliminated
            return Factorisation("PETSc, nothing to solve", 0, np.zeros_like)
        if spd:  # what PETSc makes of such a row says nothing of it, or ends all ranks
            check_diagonal(A.diagonal())
        if isinstance(A, ReducedStiffness):
            layout, scale = A.layout, A.diagonal()
            layout.check_size(A.nnz, own.largest_integer)
            key = A.factorize(self._settings(spd, layout.block))
        else:
            A = csr_matrix(A)
            layout = Layout.of(A.shape[0], points, modes, own.size)
            scale = np.asarray(abs(A).max(axis=1).toarray().ravel())  # the largest entry of each row
            layout.check_size(A.nnz, own.largest_integer)
            near = repeat(None, own.size) if modes is None else layout.vectors(directions(modes))
            key = own.factorize(layout.matrices(A), near, self._settings(spd, layout.block))
        share = own.shares[key]
        spent, memory = time.perf_counter() - begin, share.memory

        def solve(b: np.ndarray) -> np.ndarray:
            nonlocal spent
            start = time.perf_counter()
            x, how = own.solve(key, layout.vectors(b))
            seconds = time.perf_counter() - start
            self.solves.append(share.told(how, len(b), own.size, spent, seconds, memory))
            spent = 0.0
            self._check(how, share.name)
            return x[layout.slot]

        if self.method == "direct":
            check_eigenvalue(scale, solve)
        weakref.finalize(solve, own.drop, key)
        return Factorisation(f"PETSc, {share.name} on {own.size} ranks", memory, by_column(solve))

    def _settings(self, spd: bool, block: int) -> Settings:
        tol, most = float(self.tol), int(self.max_iterations)
        return Settings(spd, self.method, tol, most, block, self.options)

    def _check(self, how: Solved, name: str) -> None:
        """Raise what a solve that failed has to say."""
        direct = self.method == "direct"
        if direct and (how.reason < 0 or not how.residual <= ACCEPTED):
            raise singular(-1, 0.0)
        if direct or (how.residual <= self.tol and how.local <= GIVEN):
            return
        raise not_solved(name, how, self.tol)


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
