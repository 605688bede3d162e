"""`Linearizable`: what a load step asks of a body, whether it is linear or not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from scipy.sparse import csr_matrix

from skfem_contact.arrays import Array

#: Internal variables of a body by name, each of shape (..., elements, points of integration).
State = Mapping[str, Any]


class Linearized(NamedTuple):
    """The answer of a body to its displacements, see `Linearizable`.

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
    internal: Array
    state: State


class Linearizable(Protocol):
    r"""A body as the contact problem sees it: linear equations near its displacements u.

    With the internal forces ``f_int(u)``, their derivative ``K(u)`` and the load ``f_ext``,

        ``K(u) v = f``,       ``f = f_ext - f_int(u) + K(u) u``.

    A linear body answers the same whatever u is, so it is asked once. A body that is not linear is
    asked at every iterate, with its internal variables at the beginning of the step.

    Attributes
    ----------
    nonlinear : bool
        Whether `linearize` depends on u.
    finite_strain : bool
        Whether the body may turn and strain by any amount (total Lagrangian).
    initial_state : dict of ndarray
        Internal variables of the undeformed body; empty if there are none.
    """

    nonlinear: bool
    finite_strain: bool

    @property
    def initial_state(self) -> State: ...

    def linearize(self, u: Array | None = None, state: State | None = None) -> Linearized:
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
        ...
