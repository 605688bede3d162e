"""`Placed`: where bodies that are not linear are, what they resist with, and what they remember."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.arrays import Array, largest
from skfem_contact.bodies.member import State
from skfem_contact.bodies.system import System, slices
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.state import LoadCase, LocalState
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.records import copied, dataclass, sealed

if TYPE_CHECKING:
    from skfem_contact.problem.model import LinearModel


@dataclass(frozen=True, eq=False)
class Placed:
    """All bodies at some displacements.

    Attributes
    ----------
    u : ndarray, shape (n,)
        [length]
    stiffness : tuple of csr_matrix
        The tangent of each body; of linear ones the very matrix that they always have.
    internal : ndarray, shape (n,)
        Internal forces, less `beyond` [force].
    beyond : ndarray, shape (n,)
        By how much the load of fluids is another than on the undeformed boundary [force].
    material : tuple of State
        Internal variables of each body there; none of linear ones.
    trend : ndarray, shape (n,)
        How the displacements changed in the last part of a load step, over its share of it [length].
    rims : csr_matrix, shape (n, n), or None
        The part of the derivative of the load of fluids that is not symmetric: it belongs to the rims
        of the pressed surfaces. Without what supports bear; None where nothing is left.
    """

    u: Array
    stiffness: tuple[csr_matrix, ...]
    internal: Array
    beyond: Array
    material: tuple[State, ...]
    trend: Array
    rims: csr_matrix | None = None

    @classmethod
    def of_start(cls, system: System, stiffness: Sequence[csr_matrix], start: Any) -> Placed:
        """Where a load step begins: undeformed, or at the end of a step before; not linearised yet."""
        states = tuple(body.initial_state for body in system.bodies)
        u = trend = zero = np.zeros(system.n)
        if start is not None:
            u, states, trend = start.u, start.material, start.trend
            if not states:
                raise InputError(
                    "start has no internal variables of the bodies that are not linear here: it is a "
                    "state of linear ones. Begin without start, or with a state of this kind of bodies."
                )
        return cls(u, tuple(stiffness), zero, zero, states, trend)

    def moved(self, system: System, u: Array, apart: Mapping[int, Array]) -> Placed:
        """The bodies at other displacements, from what they remember here, pressed by fluids.

        Raises
        ------
        MaterialError
            A body has no answer.
        """
        stiffness, states = list(self.stiffness), list(self.material)
        internal, beyond = np.zeros((2, system.n))
        bodies: tuple[Any, ...] = system.bodies
        odd = [csr_matrix((body.n, body.n)) for body in bodies]
        for i, body in enumerate(bodies):
            part = system.slice(body)
            if body.nonlinear:
                stiffness[i], internal[part], states[i] = body.linearize(u[part], self.material[i])
            else:
                internal[part] = stiffness[i] @ u[part]
            if body.nonlinear and i in apart:
                beyond[part], slope = fluid_beyond(body, apart[i], u[part])
                stiffness[i] = csr_matrix(stiffness[i] - 0.5 * (slope + slope.T))
                odd[i] = _of_rims(body, slope)
        rims = csr_matrix(block_diag(odd)) if any(half.nnz for half in odd) else None
        forces = sealed(internal - beyond), sealed(beyond)
        return Placed(sealed(u), tuple(stiffness), *forces, tuple(states), self.trend, rims)

    def stiffened(self, undeformed: Sequence[csr_matrix], share: float) -> Placed:
        """With a share of the tangents of the undeformed bodies added to those of here."""
        if not share:
            return self
        pairs = zip(self.stiffness, undeformed, strict=True)
        stiffness = tuple(K if K is own else csr_matrix(K + share * own) for K, own in pairs)
        return replace(self, stiffness=stiffness)

    def origin(self, model: LinearModel) -> Placed:
        """What the unknowns of the linear problem near here count from.

        Here: what is left near an answer is small, and so is its round-off, however far bodies have
        come and however soft their tangents are. Of linear condensed bodies zero, which remember what
        their loads do: that is the same in all iterates.
        """
        system = model.system
        u, forces = np.array(self.u), np.array(self.internal)
        for body in system.bodies:
            if not body.nonlinear and model.route == "condensed":
                u[system.slice(body)] = forces[system.slice(body)] = 0.0
        return replace(self, u=u, internal=forces)

    def seen(self, case: LoadCase, kin: Kinematics, model: LinearModel) -> LoadCase:
        """A load case for what is beyond here; springs that a model has besides resist `u` as well."""
        forces = self.internal.copy()
        parts = slices(model.system.offsets), self.stiffness, model.stiffness
        for part, own, other in zip(*parts, strict=True):
            if own is not other and self.u[part].any():
                forces[part] += (other - own) @ self.u[part]
        slipped = (kin.B_t @ self.u).reshape(case.slip0.shape)
        slipped[~model.interface.slipping] = 0.0  # their slips are no unknowns
        gap, slip = case.gap0 + kin.B_n @ self.u, case.slip0 + slipped
        return copied(case, f=case.f - forces, x=case.x - self.u, gap0=gap, slip0=slip)


def fluid_beyond(body: Any, pressures: Array, u: Array) -> tuple[Array, csr_matrix]:
    """What a fluid has on the boundary at u beyond its load on the undeformed one; the derivative."""
    load, slope = body.pressed(pressures, u)
    return load - body.pressed(pressures)[0], slope


def _of_rims(body: Any, slope: csr_matrix) -> csr_matrix:
    """The half of the derivative of a body's load that is not symmetric, but what supports bear."""
    odd = csr_matrix(0.5 * (slope - slope.T))
    row = np.repeat(np.arange(body.n), np.diff(odd.indptr))
    odd.data[np.isin(row, body.D) | (np.abs(odd.data) <= COMPUTED * largest(np.abs(slope.data)))] = 0.0
    odd.eliminate_zeros()
    return odd


def point_forces(kin: Kinematics, state: LocalState) -> Array:
    """Forces of all contacts on the DOFs, ``B_n' lambda - B_t' tau``, shape (n,) [force]."""
    contact: Array = kin.B_n.T @ state.normal_force
    if state.tangential_force.any():
        contact = contact - kin.B_t.T @ state.tangential_force.ravel()
    return contact


# -- the log of a load step ------------------------------------------------------------------------


@dataclass(frozen=True)
class Iteration:
    """One linearisation of the bodies, and the step that it led to.

    Attributes
    ----------
    number : int
        Within its part of the load step.
    aim : float
        Share of the load step at the end of that part; 1 where it was not cut.
    residual : float
        Largest force that is missing to equilibrium after it, over the largest force that acts.
    step : float
        Share of the step that was taken: 1 where the residual fell at once.
    contact : int
        Iterations of contact.
    """

    number: int
    aim: float
    residual: float
    step: float
    contact: int

    def __str__(self) -> str:
        words = f"{self.number:3d}  residual {self.residual:8.1e}  contact {self.contact:3d}"
        words += "" if self.step == 1.0 else f"  {self.step:.3g} of a step"
        return words + ("" if self.aim == 1.0 else f"  to {self.aim:.4g} of the load step")


class Newton(tuple[Iteration, ...]):
    """The linearisations of a load step, in their order; printed, a line for each.

    Examples
    --------
    >>> print(Newton([Iteration(1, 1.0, 2e-3, 1.0, 4), Iteration(2, 1.0, 5e-12, 1.0, 1)]))
      1  residual  2.0e-03  contact   4
      2  residual  5.0e-12  contact   1
    """

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(map(str, self))
