"""The interface of linear solvers: settings that factorise, what they return, and singular matrices."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.member import Member, RemoteStiffness, check_whole
from skfem_contact.errors import InputError, SingularMatrix
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.records import dataclass

if TYPE_CHECKING:
    from skfem_contact.elimination.constraint import AffineConstraint


# A pivot divided by its diagonal entry: 0.1 in a body that is well held, 1e-9 in a cantilever of
# 1000 elements, round-off where a rigid motion is free: up to 1e-12, as it grows with the mesh. So
# small pivots are followed by an estimate of the smallest eigenvalue of K scaled to a unit diagonal.
# That is below 1e-16 for a rigid motion, and 1e-12 for the same cantilever.
NEGLIGIBLE = 1e-15

Solve = Callable[[np.ndarray], np.ndarray]


def smallest_eigenvalue(scale: np.ndarray, solve: Solve) -> tuple[float, int]:
    """Estimate for a matrix scaled symmetrically to a unit diagonal, by inverse iteration.

    Parameters
    ----------
    scale : ndarray, shape (n,)
        Diagonal of the matrix.
    solve : callable
        Product of its inverse with a vector.

    Returns
    -------
    smallest : float
    dof : int
        Where the eigenvector is largest.

    Examples
    --------
    >>> import numpy as np
    >>> value, dof = smallest_eigenvalue(np.array([4.0, 9.0]), lambda b: b / np.array([4.0, 9e-6]))
    >>> round(value, 12), dof
    (1e-06, 1)
    """
    size = np.sqrt(scale)
    vector = np.random.default_rng(0).standard_normal(size.size)
    for _ in range(2):
        vector /= np.linalg.norm(vector)
        vector = size * solve(size * vector)
    return float(1.0 / np.linalg.norm(vector)), int(np.argmax(np.abs(vector)))


def check_diagonal(diagonal: np.ndarray) -> None:
    """Raise `SingularMatrix` where a matrix that is to be positive definite can not be.

    >>> try:
    ...     check_diagonal(np.array([2.0, 0.0]))
    ... except SingularMatrix as error:
    ...     print(error.dof)
    1
    """
    wrong = np.flatnonzero(~(diagonal > 0.0))  # finds a NaN as well
    if len(wrong):
        raise singular(int(wrong[0]), 0.0)


def check_eigenvalue(scale: np.ndarray, solve: Solve) -> None:
    """Raise `SingularMatrix` where the scaled matrix has an eigenvalue of zero."""
    smallest, dof = smallest_eigenvalue(scale, solve)
    if not smallest >= NEGLIGIBLE:
        raise singular(dof, smallest)


def singular(dof: int, ratio: float, point: Sequence[float] = ()) -> SingularMatrix:
    """The error for a DOF without stiffness, at a point where that is known; -1 is any DOF."""
    where = f"at DOF {dof}" if dof >= 0 else "somewhere"
    if len(point):
        where += f" at ({', '.join(f'{coordinate:.6g}' for coordinate in point)})"
    return SingularMatrix(
        f"The stiffness left {where}, once the other DOFs are eliminated, is {ratio:.1e} of its "
        "diagonal entry: the matrix is singular to working precision, or not positive definite. "
        "Usually a rigid motion is left free by D, the contacts and the constraints together.",
        dof,
        ratio,
    )


class Stacked(RemoteStiffness):
    """Block diagonal stiffness of all bodies, and sparse terms that one process has."""

    @abstractmethod
    def bordered(self, B: csr_matrix) -> Stacked:
        """With further unknowns ``w = B u``, without stiffness but for what is added to all."""

    @abstractmethod
    def reduced(self, trial: AffineConstraint, f: Array, test: AffineConstraint) -> tuple[Any, Array]:
        """``V'KT``, for the backend to factorise, and ``V'(f - K c)``."""

    @abstractmethod
    def __add__(self, other: Any) -> Stacked:
        """With a symmetric sparse matrix (n, n) added, which one process holds."""


#: What forces (m,) on some DOFs move there, (m,); also by ``(S + ...)^-1``, (n_c, n_c), of what the
#: factorisation keeps, with what holds it besides.
Surface = Callable[..., Array]


class BodyFactor(ABC):
    """A stiffness K (n, n) of which all DOFs i but the kept ones c are eliminated.

    A backend makes them (`backend.Backend.condensed`): in one process they are
    `multifrontal.MultifrontalCholesky`.

    Attributes
    ----------
    keep : ndarray of int, shape (n_c,)
        DOFs that are not eliminated.
    order : ndarray of int, shape (n,)
        The DOFs in the order of elimination; the kept ones come last.
    S : ndarray, shape (n_c, n_c)
        ``K_cc - K_ci K_ii^-1 K_ic``, symmetric, in the order of `keep`. Solutions do not need
        it: who takes it to change it leaves it empty.
    """

    keep: Index
    S: Array
    order: Index

    @property
    @abstractmethod
    def memory(self) -> int:
        """Memory that the factors take, on all ranks together [bytes]."""

    @abstractmethod
    def eliminate(self, f: Array) -> Array:
        """Loads (n,) or (n, r) with the interior eliminated, (n, r), in the order `order`.

        The last rows are ``f_c - K_ci K_ii^-1 f_i``; what the others are is for `substitute` to know.
        """

    @abstractmethod
    def substitute(self, u_keep: Array, eliminated: Array) -> Array:
        """Displacements (n, r), in the order `order`, from those of the kept DOFs (n_c, r).

        `eliminated` is from `eliminate`, or a combination of such; it is overwritten.
        """

    def reduce_load(self, f: Array) -> Array:
        """``f_c - K_ci K_ii^-1 f_i``, the load that belongs to `S`, (n_c,) or (n_c, r)."""
        return self.eliminate(f)[len(f) - len(self.keep) :].reshape(-1, *np.shape(f)[1:])

    def response(self, dofs: Index) -> Surface:
        """Return what forces on some DOFs (m,) move there."""

        def moved(force: Array, flexibility: Array | None = None) -> Array:
            f = np.zeros(len(self.order))
            f[dofs] = force
            x = self.eliminate(f)
            kept = x[len(x) - len(self.keep) :]
            u = np.empty(len(x))
            u[self.order] = self.substitute(kept if flexibility is None else flexibility @ kept, x)[
                :, 0
            ]
            return u[dofs]

        return moved


@dataclass(frozen=True, eq=False)
class Factorisation:
    """A matrix made ready to be solved with.

    Attributes
    ----------
    name : str
        The method, for reports.
    memory : int
        What it keeps [bytes]; 0 where unknown.
    function : callable
        ``A^-1 b`` for b of shape (n,) or (n, r).
    """

    name: str
    memory: int
    function: Solve

    def solve(self, b: np.ndarray) -> np.ndarray:
        """``A^-1 b`` for b of shape (n,) or (n, r)."""
        return self.function(np.asarray(b, dtype=float))


class Backend:
    """Settings of a linear solver; each kind says how it factorises.

    Attributes
    ----------
    uses_modes : bool
        Whether `factorize` looks at the rigid motions; else none are made.
    condenses : bool
        Whether bodies are reduced to their contact DOFs once (`condensed`) where this solver is chosen,
        and not contact eliminated from all DOFs in every iteration.
    complements : int
        How many more matrices of the size of S the factors of `condensed` keep in this process.
    distributed : bool
        Whether it takes bodies whose stiffness is a `RemoteStiffness` of its own (`stacked`).
    """

    uses_modes = True
    condenses = False
    complements = 0
    distributed = False

    def factorize(
        self,
        A: Any,
        *,
        points: np.ndarray | None = None,
        modes: np.ndarray | None = None,
        spd: bool = True,
    ) -> Factorisation:
        """Prepare to solve with `A`.

        Parameters
        ----------
        A : sparse matrix or ndarray, shape (n, n)
        points : ndarray, shape (n, d), optional
            Position of each DOF [length]: guides the order of elimination.
        modes : ndarray, shape (n, k), optional
            Rigid motions of the bodies: what `AMG` must know.
        spd : bool
            Whether `A` is symmetric and positive definite.

        Returns
        -------
        Factorisation

        Raises
        ------
        SingularMatrix
            Where the method can tell.
        """
        if A.ndim != 2 or A.shape[0] != A.shape[1]:
            raise InputError(f"A of shape {A.shape} is not square: pass the matrix of a system.")
        with single_threaded:
            return self._factorize(A, points, modes, spd)

    def _factorize(
        self, A: Any, points: np.ndarray | None, modes: np.ndarray | None, spd: bool
    ) -> Factorisation:
        raise NotImplementedError

    def stacked(self, bodies: Sequence[Member], stiffness: Sequence[Any]) -> Stacked:
        """The stiffness of all bodies, of which some are held elsewhere, by this backend."""
        words = f"{type(self).__name__} needs all of it"
        check_whole(stiffness, words)
        raise InputError(words)

    def condensed(self, body: Member, K: Any, free: np.ndarray, keep: np.ndarray) -> BodyFactor:
        """Factors of one body, of which some DOFs are kept.

        Parameters
        ----------
        body : Member
        K : csr_matrix or RemoteStiffness, shape (n, n)
            Its stiffness.
        free : ndarray of int, shape (n_f,)
            DOFs that are not prescribed, ascending: those that the factors are about.
        keep : ndarray of int, shape (n_c,)
            Which of these are kept, as positions in `free`.

        Raises
        ------
        SingularMatrix
            What is eliminated is not positive definite.
        """
        raise InputError(
            f"{type(self).__name__} factorises no bodies: contact is on all of their DOFs."
        )


def by_column(solve: Solve) -> Solve:
    """Let a solver of vectors take the columns of an array (n, r) one by one."""

    def column(b: np.ndarray) -> np.ndarray:
        return solve(np.ascontiguousarray(b))

    return lambda b: np.apply_along_axis(column, 0, b) if b.size else np.zeros_like(b)
