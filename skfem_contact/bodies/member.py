"""`Member`: what a `System` knows of each of its bodies, whether it has a mesh or not.

`unit_motions`, `rigid_modes`: motions without strain, and their names; `RemoteStiffness`: the stiffness
of a body that is held elsewhere, by a backend over several processes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arguments import NamesAttributes
from skfem_contact.arrays import Array, Index
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.records import sealed

#: Internal variables of a body by name, each of shape (..., elements, points of integration).
State = Mapping[str, Any]


class Linearized(NamedTuple):
    """The answer of a body to its displacements, see `Member`.

    Attributes
    ----------
    K : csr_matrix, shape (n, n)
        Derivative of the internal forces by the displacements, symmetric [force/length].
    internal : ndarray, shape (n,)
        Internal forces: what holds the body in equilibrium [force].
    state : dict of ndarray
        Internal variables at these displacements. They hold from now on only if the step is accepted.
    """

    K: csr_matrix
    internal: np.ndarray
    state: State


class Member(NamesAttributes, ABC):
    r"""One of the bodies of a contact problem: its equations, and what its DOFs move.

    A `Body` has a mesh; a rigid body has the DOFs of its motion alone. Its equations are linear near
    displacements u: with the internal forces ``f_int(u)``, their derivative ``K(u)`` and the load,

        ``K(u) v = f``,       ``f = f_ext - f_int(u) + K(u) u``.

    A linear body answers the same whatever u is, so it is asked once. One that is not linear is asked
    at every iterate, with its internal variables at the beginning of the step.

    Attributes
    ----------
    name : str or None
    K : csr_matrix, shape (n, n)
    f : ndarray, shape (n,)
    D : ndarray of int
        Prescribed DOFs, sorted.
    x : ndarray, shape (n,)
        Prescribed values; zero where not prescribed.
    nonlinear : bool
        Whether `linearize` depends on u.
    finite_strain : bool
        Whether the body may turn and strain by any amount (total Lagrangian).
    pressures : ndarray or None
        Of fluids, by facet, which follow the deformed boundary [stress].
    thermal : ndarray, shape (n + p,), or None
        Where the load `f` of a body of small strains stands for those of a temperature: the load
        [force], and the pressure at p points of integration that would hold them back [stress].
    """

    name: str | None
    K: csr_matrix
    f: np.ndarray
    D: np.ndarray
    x: np.ndarray

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of DOFs."""

    @property
    @abstractmethod
    def dim(self) -> int:
        """Dimension of space."""

    @property
    @abstractmethod
    def components(self) -> int:
        """Components of a displacement: `dim`, or 1 for a scalar field."""

    @property
    @abstractmethod
    def dof_points(self) -> np.ndarray:
        """Position of every DOF, shape (n, d)."""

    @property
    @abstractmethod
    def dof_component(self) -> np.ndarray:
        """The component that every DOF stands for, shape (n,): 0 for x; from `dim` on, a rotation."""

    @property
    @abstractmethod
    def rigid_modes(self) -> np.ndarray:
        """Motions without strain, shape (n, k)."""

    @property
    @abstractmethod
    def rigid_mode_names(self) -> tuple[str, ...]:
        """The motions of `rigid_modes` in words."""

    @cached_property
    def rotations(self) -> np.ndarray:
        """DOFs that are rotations: angles, loaded by moments; none of a body with a mesh."""
        return sealed(np.flatnonzero(self.dof_component >= self.components))

    nonlinear: bool = False
    finite_strain: bool = False
    pressures: np.ndarray | None = None
    thermal: np.ndarray | None = None

    @property
    def initial_state(self) -> State:
        """Internal variables of the undeformed body: none of a linear one."""
        return {}

    def linearize(self, u: np.ndarray | None = None, state: State | None = None) -> Linearized:
        """Stiffness, internal forces and internal variables at displacements u; changes nothing.

        Here those of a linear body, ``K``, ``K u`` and none.

        Parameters
        ----------
        u : ndarray, shape (n,), optional
            Displacements; zero if not given [length].
        state : dict of ndarray, optional
            Internal variables at the beginning of the step; the initial ones if not given.

        Raises
        ------
        MaterialError
            Where an element turns inside out, or the material has no answer: take a smaller step.
        """
        return Linearized(self.K, np.zeros(self.n) if u is None else self.K @ u, {})

    @abstractmethod
    def stiffness(self, K: Any, what: str) -> csr_matrix:
        """The stiffness (n, n) that a user means."""

    @abstractmethod
    def load(self, f: Any, what: str) -> np.ndarray:
        """The load (n,) that a user means: a vector, or a dict by what it acts on."""

    def apart(self, f: Any, load: np.ndarray) -> np.ndarray | None:
        """Return what has to be known of a load f beside its vector, (n,): None as a rule.

        Of a body of large strains pressures that follow the deformed boundary, by facet [stress]; of
        others what belongs to strains of a temperature, whose load is no force, see `thermal`.
        """
        return None

    @abstractmethod
    def displaced(self, x: Mapping[str, Any], before: np.ndarray, what: str) -> np.ndarray:
        """Prescribed values (n,) with those that a dict names replaced."""


class Meshed(Member):
    """A body with a mesh, whose boundary may come into contact.

    Attributes
    ----------
    basis : skfem.CellBasis
    measure : callable or None
        Weight of areas by position, ``lambda x: 2 * np.pi * x[0]`` of an axisymmetric body.
    """

    basis: Any
    measure: Callable[[np.ndarray], np.ndarray] | None

    @cached_property
    def axisymmetric(self) -> bool:
        """The `measure` of a plane body is proportional to ``x[0]`` (a thickness is not)."""
        if self.measure is None or self.components == 1 or self.dim != 2:
            return False
        radius = self.dof_points[:, 0]
        weight = np.broadcast_to(self.measure(self.dof_points.T), radius.shape)
        # compared at the largest radius, where the quotient has all its digits
        far = np.argmax(np.abs(radius))
        deviation = np.abs(weight * radius[far] - weight[far] * radius)
        return bool(np.all(deviation <= SOLVED * np.abs(weight[far] * radius[far])))


# -- motions without strain ---------------------------------------------------------------------------


def motion_names(dim: int, components: int, axisymmetric: bool = False) -> tuple[str, ...]:
    """The rigid motions of one piece in words.

    Parameters
    ----------
    dim : int
        Of space.
    components : int
        Of a displacement; 1 of a scalar field.
    axisymmetric : bool
        Whether the axis is all that it can move along.

    Examples
    --------
    >>> motion_names(2, 2)
    ('translation along x', 'translation along y', 'rotation')
    """
    if components == 1:
        return ("constant",)
    if axisymmetric:
        return ("translation along the axis",)
    axes = "xyz"[:dim]
    turns = ("rotation",) if dim == 2 else tuple(f"rotation about {a}" for a in axes)
    return tuple(f"translation along {a}" for a in axes) + turns


def rigid_modes(
    points: Array, component: Index, components: int, axisymmetric: bool, parts: Index
) -> Array:
    """Displacements (n, k) by the motions of `motion_names`, for each piece of the mesh.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        Of the DOFs [length].
    component : ndarray of int, shape (n,)
        That each DOF stands for.
    components, axisymmetric
        As for `motion_names`.
    parts : ndarray of int, shape (n,)
        The piece that each DOF belongs to.
    """
    if not parts.any():
        return _of_piece(points, component, components, axisymmetric)
    blocks = []
    for part in range(parts.max() + 1):
        mine = parts == part
        own = _of_piece(points[mine], component[mine], components, axisymmetric)
        block = np.zeros((len(points), own.shape[1]))
        block[mine] = own
        blocks.append(block)
    return np.concatenate(blocks, axis=1)


def _of_piece(points: Array, component: Index, components: int, axisymmetric: bool) -> Array:
    if components == 1:
        return np.ones((len(component), 1))
    arm = points - (centre := points.mean(axis=0))
    modes = unit_motions(points, centre, np.abs(arm).max())[np.arange(len(points)), component]
    return modes[:, 1:2] if axisymmetric else modes


def unit_motions(points: Array, centre: Array, arm: float) -> Array:
    """Displacements (m, d, r) of points by translations and by turns about a centre, over an arm.

    >>> unit_motions(np.array([[3.0, 0.0]]), np.zeros(2), 2.0).tolist()
    [[[1.0, 0.0, -0.0], [0.0, 1.0, 1.5]]]
    """
    d, away = points.shape[1], (points - centre) / arm
    planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    modes = np.zeros((len(points), d, d + len(planes)))
    modes[:, :, :d] = np.eye(d)
    for turn, (i, j) in enumerate(planes, start=d):
        modes[:, i, turn], modes[:, j, turn] = -away[:, j], away[:, i]
    return modes


def largest(modes: Array) -> Array:
    """Largest entry of each of k modes (n, k); of all of them at once NumPy takes ten times as long.

    >>> largest(np.array([[1.0, -3.0], [-2.0, 0.0]])).tolist()
    [2.0, 3.0]
    """
    return np.array([np.max(np.abs(mode), initial=0.0) for mode in modes.T])


# -- a stiffness that is held elsewhere ---------------------------------------------------------------


class RemoteStiffness(ABC):
    """A symmetric matrix (n, n) that is held elsewhere.

    It has what contact asks of a stiffness: products, its diagonal, a few of its rows, sparse terms
    added. What needs all of it in one place is refused in words.

    Attributes
    ----------
    shape : tuple of int
    nnz : int
        Number of entries.
    """

    shape: tuple[int, int]
    nnz: int
    ndim = 2
    __array_ufunc__ = None  # products with arrays from the left are errors, not arrays of objects

    @abstractmethod
    def refused(self, why: str) -> InputError:
        """The error for what needs all of the matrix in one place."""

    @abstractmethod
    def diagonal(self) -> Array:
        """Shape (n,)."""

    @abstractmethod
    def times(self, x: Array, absolute: bool = False) -> Array:
        """``K x``, or ``|K| x``, of x (n,) or (n, k)."""

    @abstractmethod
    def rows(self, dofs: Any) -> csr_matrix:
        """Some rows, (len(dofs), n)."""

    @abstractmethod
    def __add__(self, other: Any) -> RemoteStiffness:
        """With a symmetric sparse matrix (n, n) added, which one process holds."""

    @property
    def T(self) -> RemoteStiffness:
        """Itself."""
        return self

    def __matmul__(self, x: Any) -> Array:
        return self.times(np.asarray(x, dtype=float))

    def __abs__(self) -> Magnitudes:
        return Magnitudes(self)

    def __getitem__(self, dofs: Any) -> csr_matrix:
        if isinstance(dofs, tuple):
            raise self.refused("its columns were asked for: K[dofs] gives rows")
        return self.rows(dofs)


class Magnitudes:
    """``|K|``, to be multiplied with."""

    def __init__(self, K: RemoteStiffness) -> None:
        self.K = K

    def __matmul__(self, x: Any) -> Array:
        return self.K.times(np.asarray(x, dtype=float), absolute=True)


def check_whole(stiffness: Sequence[Any], needs_it: str) -> None:
    """Refuse what is done with whole matrices alone."""
    for K in stiffness:
        if isinstance(K, RemoteStiffness):
            raise K.refused(needs_it)
