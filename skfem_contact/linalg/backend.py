"""The interface of linear solvers: settings that factorise, and what they return."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.member import Member, RemoteStiffness, check_whole
from skfem_contact.errors import InputError
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.linalg.singular import Solve
from skfem_contact.records import dataclass

if TYPE_CHECKING:
    from skfem_contact.elimination.constraint import AffineConstraint


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
    `multifrontal.factor.MultifrontalCholesky`.

    Attributes
    ----------
    keep : ndarray of int, shape (n_c,)
        DOFs that are not eliminated.
    order : ndarray of int, shape (n,)
        The DOFs in the order of elimination; the kept ones come last.
    S : ndarray, shape (n_c, n_c)
        ``K_cc - K_ci K_ii^-1 K_ic``, symmetric, in the order of `keep`; empty once it was taken.
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

    def take_S(self) -> Array:
        """`S` for the caller alone, who may change it; from now on `S` is empty here.

        Solving and recovering do not need it.
        """
        S, self.S = self.S, np.zeros((0, 0))
        return S

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
