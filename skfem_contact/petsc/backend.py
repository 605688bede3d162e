"""`PETSc`: linear problems distributed over MPI ranks, and bodies condensed over them.

The ranks hold K by rows and factorise its interior once, ``K_ii``. Of the kept DOFs c MUMPS leaves
``S = K_cc - K_ci K_ii^-1 K_ic`` on rank 0, in the same factorisation; other packages do not, and then
S is ``n_c`` solves, in blocks. All else is a solve with ``K_ii`` and a product with K,

    x_i = K_ii^-1 f_i,  f_c - K_ci x_i;      w_i = -K_ii^-1 K_ic u_c,  S u_c = K_ci w_i + K_cc u_c,

for loads and for displacements of the kept DOFs. Where few are kept, as the anchors of a body whose
contact is iterated, what follows from each of them is known once and for all, and costs no more solves
(`DistributedFactor`, as rank 0 sees it).
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import repeat
from typing import Any, cast

import numpy as np
from scipy.linalg.blas import dsymv
from scipy.sparse import csr_matrix
from skfem.assembly import CellBasis

from skfem_contact.arguments import number, shown, whole_number, with_known_keywords
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.member import Member
from skfem_contact.digits import GIVEN
from skfem_contact.errors import InputError, LinearSolveError, SingularMatrix
from skfem_contact.linalg.backend import (
    NEGLIGIBLE,
    Backend,
    BodyFactor,
    Factorisation,
    by_column,
    check_diagonal,
    check_eigenvalue,
    singular,
    smallest_eigenvalue,
)
from skfem_contact.linalg.dense_factors import mirror, symmetrise
from skfem_contact.linalg.direct import ACCEPTED, Direct
from skfem_contact.petsc.assembly import assembled, collected, numbering
from skfem_contact.petsc.body_share import COLUMNS_AT_ONCE, BodyShare
from skfem_contact.petsc.ranks import Ranks, ranks
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
from skfem_contact.petsc.stiffness import DistributedStiffness, Layout, RankedStiffness, directions

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
            self.solves.append(share.told(how, len(b), spent, seconds, memory))
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


class DistributedFactor(BodyFactor):
    """A `BodyFactor` over MPI ranks.

    Parameters
    ----------
    own : Ranks
    body : Member
    K : csr_matrix or RankedStiffness, shape (n_all, n_all)
        Its stiffness, here or held rank by rank.
    free : ndarray of int, shape (n,)
        DOFs that are not prescribed, ascending.
    keep : ndarray of int, shape (n_c,)
        Which of these are kept, as positions in `free`; not all of them.
    settings : Settings
        How to factorise.
    tell : callable
        Takes a `LinearSolve` of every solve.

    Raises
    ------
    SingularMatrix
        The interior is not positive definite.
    LinearSolveError
        The package has failed, with its reason.
    """

    def __init__(
        self,
        own: Ranks,
        body: Member,
        K: Any,
        free: Index,
        keep: Index,
        settings: Settings,
        tell: Callable[[LinearSolve], None],
    ) -> None:
        begin = time.perf_counter()
        self.keep, self._own, self._settings, self._tell = keep, own, settings, tell
        self.interior = np.delete(np.arange(len(free)), keep)
        self.order = np.concatenate([self.interior, keep])
        self._key, self._layout = _held(own, body, K, free, keep, settings)
        weakref.finalize(self, own.drop, self._key)
        self._share = _share(own, self._key)
        self._kept_by = _owners(self._layout, self._layout.slot[keep])
        self._spent = time.perf_counter() - begin
        self.S = np.zeros((0, 0))
        self._check(K.diagonal()[free[self.interior]], body.dof_points[free[self.interior]])
        self.S = self._complement()

    @property
    def memory(self) -> int:
        """Factors and rows of all ranks, and what MUMPS keeps of the kept rows [bytes]."""
        left = 8 * len(self.keep) ** 2 if self._share.has_complement else 0
        return self._share.memory + left + self.S.nbytes

    def eliminate(self, f: Array) -> Array:
        """``K_ii^-1 f_i``, then ``f_c - K_ci K_ii^-1 f_i``, (n,) or (n, r) -> (n, r)."""
        f = np.asarray(f, dtype=float).reshape(len(f), -1)
        start = time.perf_counter()
        parts = self._own.together(
            _eliminated, (self._key,), ([rows] for rows in self._layout.vectors(f))
        )
        self._said(parts, f.shape[1], start)
        whole = np.concatenate([rows for rows, _ in parts])
        return whole[self._layout.slot[self.order]]

    def substitute(self, u_keep: Array, eliminated: Array) -> Array:
        """Displacements (n, r) of the DOFs `order`, in the place of `eliminated`."""
        inner = len(self.interior)
        if len(self.keep):
            if len(self.keep) <= COLUMNS_AT_ONCE:
                eliminated[:inner] += self._followers[self.interior] @ u_keep
            else:
                eliminated[:inner] += self._coupled(u_keep, True)[0][self.interior]
        eliminated[inner:] = u_keep
        return eliminated

    def response(self, dofs: Index) -> DistributedResponse:
        """Return the displacements that forces on some DOFs (m,) cause there."""
        return DistributedResponse(self, dofs)

    # -- what rank 0 asks of all --------------------------------------------------------------

    @cached_property
    def _followers(self) -> Array:
        """Return the displacements that follow each kept DOF where the others are held, (n, n_c)."""
        return self._coupled(np.eye(len(self.keep)), True)[0]

    def _coupled(self, u_keep: Array, wanted: bool) -> tuple[Array, Array]:
        """Return what follows kept DOFs (n_c, r): displacements (n, r) if wanted, and ``S u``."""
        start, r = time.perf_counter(), u_keep.shape[1]
        ranks = range(self._own.size)
        pieces = ([u_keep[self._kept_by == rank]] for rank in ranks)
        parts = self._own.together(_coupled, (self._key, wanted), pieces)
        self._said(parts, r, start)
        forces = np.empty((len(self.keep), r))
        for rank, (_, rows, _) in enumerate(parts):
            forces[self._kept_by == rank] = rows
        u = np.concatenate([rows for rows, _, _ in parts])
        return (u[self._layout.slot] if wanted else u), forces

    def _complement(self) -> Array:
        n = len(self.keep)
        if not self._share.has_complement:
            S = np.empty((n, n))
            for first in range(0, n, COLUMNS_AT_ONCE):
                some = slice(first, min(first + COLUMNS_AT_ONCE, n))
                unit = np.zeros((n, some.stop - first))
                np.fill_diagonal(unit[some], 1.0)
                S[:, some] = self._coupled(unit, False)[1]
            symmetrise(S)
            return S
        S = self._share.complement()
        # which of its triangles is good depends on the number of ranks: the one whose product is right
        u = np.random.default_rng(0).standard_normal(n)
        expected = self._coupled(u[:, None], False)[1][:, 0]
        for triangle in (S, S.T):  # the upper one, which LAPACK takes for the lower one
            found = dsymv(1.0, triangle.T, u, lower=1)
            if np.linalg.norm(found - expected) <= GIVEN * np.linalg.norm(expected):
                mirror(triangle.T)
                return S
        raise LinearSolveError("what MUMPS leaves of the kept rows is not their Schur complement")

    def _check(self, diagonal: Array, points: Array) -> None:
        """Refuse an interior that is not positive definite."""
        words, negative = self._share.trouble()
        if words and "pivot" not in words:
            raise LinearSolveError(f"PETSc, {self._share.name}: {words}.")
        dof, smallest = int(np.argmin(diagonal)), 0.0
        if diagonal[dof] > 0 and not words:
            with suppress(SingularMatrix):
                smallest, dof = smallest_eigenvalue(diagonal, self._interior_solve)
        if negative or not smallest >= NEGLIGIBLE:
            raise singular(self.interior[dof], 0.0 if negative else smallest, points[dof])

    def _interior_solve(self, b: Array) -> Array:
        f = np.zeros(len(self.order))
        f[self.interior] = b
        return self.eliminate(f)[: len(b), 0]

    def _said(self, parts: list[list[Any]], columns: int, start: float) -> None:
        """Record how a solve went, which the last array of rank 0 tells; and raise where it failed."""
        how: Solved = parts[0][-1]
        share, seconds, spent = self._share, time.perf_counter() - start, self._spent
        self._spent = 0.0
        told = share.told(how, len(self.order), spent, seconds, self.memory, columns)
        self._tell(told)
        if share.factorises and (how.reason < 0 or not how.residual <= ACCEPTED):
            raise singular(-1, 0.0)
        if not share.factorises and not how.residual <= self._settings.tol:
            raise not_solved(share.name, how, self._settings.tol)


class DistributedResponse:
    """Displacements of some DOFs under forces on them, by one solve over all ranks.

    Messages have the size of these DOFs, not that of the body.
    """

    def __init__(self, factor: DistributedFactor, dofs: Index) -> None:
        self._factor, self._kept = factor, np.isin(dofs, factor.keep)
        slots = factor._layout.slot[dofs]
        owner = _owners(factor._layout, slots)
        self._of_rank = [np.flatnonzero(owner == rank) for rank in range(factor._own.size)]
        starts = factor._layout.starts
        self._rows = [slots[own] - starts[rank] for rank, own in enumerate(self._of_rank)]
        self._followers = factor._followers[dofs] if len(factor.keep) else np.zeros((len(dofs), 0))

    def __call__(self, force: Array, flexibility: Array | None = None) -> Array:
        """See `Surface`."""
        factor, start = self._factor, time.perf_counter()
        pieces = zip(self._rows, (force[own] for own in self._of_rank), strict=True)
        parts = factor._own.together(_responded, (factor._key,), map(list, pieces))
        factor._said(parts, 1, start)
        u, left = np.empty(len(force)), np.empty(len(factor.keep))
        for rank, (moved, reduced, _) in enumerate(parts):
            u[self._of_rank[rank]] = moved
            left[factor._kept_by == rank] = reduced
        u[self._kept] = 0.0
        if flexibility is not None:
            u += self._followers @ (flexibility @ left)
        return u


def _held(
    own: Ranks, body: Member, K: Any, free: Index, keep: Index, settings: Settings
) -> tuple[int, Layout]:
    """Let the ranks hold K on its free DOFs and factorise its interior: number, and layout of rows."""
    if isinstance(K, RankedStiffness):
        A = StackedStiffness([body], [K], uses_modes=False).among(free)
        layout = A.layout
        layout.check_size(A.nnz, own.largest_integer)
        return A.factorize(replace(settings, block=layout.block, keep=layout.slot[keep])), layout
    A = csr_matrix(K[free][:, free])
    layout = Layout.of(len(free), body.dof_points[free], None, own.size)
    layout.check_size(A.nnz, own.largest_integer)
    settings = replace(settings, block=layout.block, keep=layout.slot[keep])
    return own.factorize(layout.matrices(A), repeat(None, own.size), settings), layout


def _owners(layout: Layout, slots: Index) -> Index:
    """The rank that has each of some rows."""
    return np.searchsorted(layout.starts, slots, side="right") - 1


def _share(own: Ranks, key: int) -> BodyShare:
    return cast(BodyShare, own.shares[key])


def _eliminated(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    return [*_share(own, given[0]).eliminated(parts[0])]


def _coupled(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    key, wanted = given
    X, forces, how = _share(own, key).coupled(parts[0])
    return [X if wanted else X[:0], forces, how]


def _responded(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    rows, force = parts
    share = _share(own, given[0])
    F = np.zeros((share.A.getLocalSize()[0], 1))
    F[rows, 0] = force
    X, how = share.eliminated(F)
    return [X[rows, 0], X[share.mine, 0], how]
