"""`Member`: what a `System` knows of each of its bodies, whether it has a mesh or not."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arguments import NamesAttributes
from skfem_contact.digits import SOLVED
from skfem_contact.sealed import sealed

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

    @property
    def initial_state(self) -> State:
        """Internal variables of the undeformed body: none of a linear one."""
        return {}

    @abstractmethod
    def linearize(self, u: np.ndarray | None = None, state: State | None = None) -> Linearized:
        """Stiffness, internal forces and internal variables at displacements u; changes nothing.

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

    @abstractmethod
    def stiffness(self, K: Any, what: str) -> csr_matrix:
        """The stiffness (n, n) that a user means."""

    @abstractmethod
    def load(self, f: Any, what: str) -> np.ndarray:
        """The load (n,) that a user means: a vector, or a dict by what it acts on."""

    def fluid(self, f: Any) -> np.ndarray | None:
        """Pressures in a load that follow the deformed boundary, by facet; none of a linear body."""
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
