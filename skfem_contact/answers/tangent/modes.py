r"""Modes of vibration about a state of contact: of an assembly that is pressed together, or slides.

Small vibrations leave the statuses of all points as they are: closed gaps stay closed, and what
sticks sticks. With ``u = T u_r`` under these constraints

    T'KT u_r = omega^2 T'MT u_r.

Where points slide on steadily, friction follows the pressure of the vibration: its forces do no work on
virtual displacements W that go with ``B_n - mu d B_t`` in the place of ``B_n``, and the pencil
``W'KT, W'MT`` is not symmetric. Two of its modes may meet at some friction, and one of them grow:
squeal.

The lowest modes are those nearest to a shift below zero, at which the stiffness of free bodies too has
a factor. It is of the size of the first eigenvalues: the ratio of the diagonals of K and M is that of
the highest ones, and over the number of DOFs it is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig
from scipy.sparse import block_diag, csc_matrix, csr_matrix
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs, eigsh

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.tangent import Tangent, left_free
from skfem_contact.arguments import shown, whole_number
from skfem_contact.arrays import Array
from skfem_contact.bodies.system import System
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.errors import InputError, SingularMatrix
from skfem_contact.linalg.direct import Direct
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.records import dataclass

SLIPPING = "stuck", "free", "steady"
MASSLESS = (
    "modes were not found: the mass matrix is singular on what is free to move, or not positive. "
    "Give mass to all of the bodies, Body(..., mass=density), or ask for fewer modes."
)


@dataclass(frozen=True, eq=False, repr=False)
class Modes:
    """Modes of vibration about a state of contact, of `ContactSolver.modes`; the lowest first.

    Attributes
    ----------
    frequency : ndarray, shape (k,)
        Over full turns, zero for rigid motions [1/time].
    growth : ndarray, shape (k,)
        A mode grows as ``exp(growth t)``: zero, but where points slide on or bodies buckle [1/time].
    shapes : ndarray, shape (k, n)
        Displacements of all bodies, with ``u' M u = 1``. Where modes grow, points move out of phase:
        complex, with one as the largest component.
    slipping : str
        What slipping points do.
    system : System
        The bodies.

    Examples
    --------
    A square that floats has three rigid motions:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> basis = fem.Basis(
    ...     fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1())
    ... )
    >>> block = sc.Body(basis, sc.Elastic(1.0, 0.3, density=1.0), name="block")
    >>> far = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, -1), (0, 1)))
    >>> solver = sc.ContactSolver(block, far)
    >>> modes = solver.modes(solver.solve(), 4)
    >>> modes.frequency.round(3).tolist(), modes.shapes.shape
    ([0.0, 0.0, 0.0, 0.413], (4, 50))
    """

    frequency: Array
    growth: Array
    shapes: NDArray[Any]
    slipping: str
    system: System

    def displacement(self, i: int, body: Any) -> NDArray[Any]:
        """The shape of one mode at the DOFs of one body, (n_body,)."""
        return np.asarray(self.shapes[i, self.system.slice(body)])

    def __repr__(self) -> str:
        lines = [f"{len(self.frequency)} modes, slipping points {self.slipping}"]
        for i, (frequency, growth) in enumerate(zip(self.frequency, self.growth, strict=True)):
            lines.append(f"  {i:3d}  {frequency:.6g}" + (f", grows by {growth:.4g}" if growth else ""))
        return "\n".join(lines)


def modes(answer: Answer, stiffness: Sequence[csr_matrix], n: int, slipping: str) -> Modes:
    """See `ContactSolver.modes`; `stiffness` is that of each body."""
    if slipping not in SLIPPING:
        raise InputError(f"slipping={shown(slipping)}; slipping points may be {', '.join(SLIPPING)}")
    whole_number(n, "n", 1)
    if not answer.converged:
        raise InputError(f"this result did not converge ({answer.message}): no state to vibrate in")
    system, M = answer.system, mass(answer.system)
    K = csr_matrix(block_diag(stiffness, format="csr"))
    closed, interface = answer.local.status != OPEN, answer.model.interface
    stick = closed & (interface.frictional | interface.tied)
    if slipping != "stuck":
        stick &= answer.local.status == STICK
    slope = Tangent(answer).slope if slipping == "steady" else 0.0
    trial, test = left_free(answer, closed, stick, slope)
    count = len(trial.independent)
    if n > count:
        raise InputError(f"n = {n} modes of {count} DOFs that are free to move")
    K_r, M_r, placed = trial.T.T @ K @ trial.T, trial.T.T @ M @ trial.T, answer.placed
    heavy = M_r.diagonal().sum()
    if not heavy > 0:
        raise InputError(MASSLESS)
    shift = float(K_r.diagonal().sum() / heavy) / count
    rims = None if placed is None else placed.rims
    symmetric = test is trial and rims is None
    if not symmetric:
        K = K if rims is None else K - rims
        K_r, M_r = test.T.T @ K @ trial.T, test.T.T @ M @ trial.T
    points = np.concatenate([body.dof_points for body in system.bodies])[trial.independent]
    try:
        with single_threaded:
            squares, found = _nearest(K_r, M_r, shift, n, points if symmetric else None)
        _check(K_r, M_r, squares, found, shift)
    except (ArpackError, SingularMatrix) as error:
        raise InputError(f"{MASSLESS} ({error})") from None
    # rigid motions are found to round-off of the shift
    squares = np.where(np.abs(squares) <= SOLVED * shift, 0.0, squares)
    turns, least = np.sqrt(-squares.astype(complex)), SOLVED * np.sqrt(shift)  # as exp(turns t)
    turns = np.where(turns.imag < 0, -turns, turns)
    order = np.lexsort((-turns.real, np.round(turns.imag / least)))[:n]
    whole, turns = np.asarray(trial.T @ found[:, order]).T, turns[order]
    growth = np.where(np.abs(turns.real) > least, turns.real, 0.0)
    return Modes(np.abs(turns.imag) / (2 * np.pi), growth, _sized(whole, M, system), slipping, system)


def _check(K: csr_matrix, M: csr_matrix, squares: Array, found: Array, shift: float) -> None:
    """Refuse what a singular mass makes of modes: vectors that solve nothing.

    Raises
    ------
    InputError
    """
    resisted, moved = (np.einsum("ij,ij->j", found.conj(), A @ found) for A in (K, M))
    with np.errstate(invalid="ignore"):
        left = np.abs(resisted - squares * moved)
        good = left <= SOLVED * (np.abs(resisted) + shift * np.abs(moved))
    if not np.all(good & (moved.real > 0)):
        raise InputError(MASSLESS)


def mass(system: System) -> csr_matrix:
    """Of all bodies, (n, n), in the numbering of the system."""
    mass = [getattr(body, "mass", None) for body in system.bodies]
    bare = [name for name, own in zip(system.names, mass, strict=True) if own is None]
    if bare:
        raise InputError(
            f"no mass is given of {', '.join(map(repr, bare))}: give Body(..., mass=density), a form "
            "or a matrix, or a material with a density; RigidBody(..., mass=(m, m, J)), or an obstacle "
            "that is held."
        )
    scaled = [system.scaled(body, own) for body, own in zip(system.bodies, mass, strict=True)]
    return csr_matrix(block_diag(scaled, format="csr"))


def _nearest(
    K: csr_matrix, M: csr_matrix, shift: float, n: int, points: Array | None
) -> tuple[Array, Array]:
    """Eigenvalues and vectors nearest to the shift: by ARPACK, or of the few DOFs that have a mass.

    Of a symmetric pencil, whose DOFs are at `points`; or of any, and one more then, as conjugates come
    in pairs.
    """
    if points is not None:
        factor = Direct().factorize(csr_matrix(K + shift * M), points=points)
    else:
        factor = Direct().factorize(csc_matrix(K + shift * M), spd=False)
    heavy = np.flatnonzero(abs(M).sum(axis=0))
    if len(heavy) <= max(20, 2 * n + 2):  # what ARPACK takes as its own space
        moved = factor.solve(M[:, heavy].toarray())
        found, vectors = eig(moved[heavy])
        some = np.argsort(-np.abs(found))[: n + 1]
        some = some[np.abs(found[some]) > COMPUTED * np.abs(found[some[0]])]
        found, vectors = found[some], moved @ (vectors[:, some] / found[some])
    elif points is not None:
        inverse = LinearOperator(K.shape, factor.solve, dtype=float)
        start = M @ np.ones(len(points))
        return eigsh(K, n, M, -shift, which="LM", OPinv=inverse, v0=start)
    else:
        operator = LinearOperator(K.shape, lambda v: factor.solve(M @ v), dtype=float)
        found, vectors = eigs(operator, n + 1, v0=np.ones(K.shape[0]))
    if len(found) < n:
        raise InputError(MASSLESS)
    return 1.0 / found - shift, vectors


def _sized(shapes: NDArray[Any], M: csr_matrix, system: System) -> NDArray[Any]:
    """Shapes of a unit modal mass where they are real; with one as the largest component else."""
    largest = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=1)[:, None], axis=1)
    shapes = shapes / largest
    if not np.any(np.abs(shapes.imag) > SOLVED):
        shapes = shapes.real
        shapes = shapes / np.sqrt(np.einsum("ij,ji->i", shapes, M @ shapes.T))[:, None]
    return np.asarray(shapes / system.units)
