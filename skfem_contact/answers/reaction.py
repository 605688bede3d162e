"""Forces of the supports: what equilibrium misses at prescribed DOFs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.boundaries import boundary_dofs
from skfem_contact.bodies.member import Member
from skfem_contact.errors import InputError

Array = NDArray[np.float64]


def contact_forces(answer: Answer) -> Array:
    """Forces of all contacts on the DOFs, ``B_n' lambda - B_t' tau``, shape (n,) [force]."""
    kin, state = answer.kin, answer.local
    contact: Array = kin.B_n.T @ state.normal_force
    if state.tangential_force.any():
        contact = contact - kin.B_t.T @ state.tangential_force.ravel()
    return contact


def reaction(answer: Answer, body: Member | str, boundary: str | None) -> Array:
    """Resultant of ``K u - f`` less the contact forces at prescribed DOFs of a body, by component.

    Parameters
    ----------
    answer : Answer
    body : Body, RigidBody or str
    boundary : str or None
        Of the body's mesh; None for all of it.
    """
    i, span = answer.system.index(body), answer.system.slice(body)
    own, name = answer.system.bodies[i], answer.system.names[i]
    where = own.D
    if boundary is not None and not isinstance(own, Body):
        raise InputError(f"rigid body {name!r} has no boundary {boundary!r}: its supports are its D")
    if boundary is not None and isinstance(own, Body):
        where = np.intersect1d(where, boundary_dofs(own.basis, boundary, f"reaction of body {name!r}"))
    if not len(where):
        place = "" if boundary is None else f" on its boundary {boundary!r}"
        raise InputError(
            f"body {name!r} has no prescribed DOFs{place}, so no support pushes there. Forces of a "
            "contact are in result[contact].force."
        )
    residual = answer.stiffness[i] @ answer.displacement(body) - answer.case.f[span]
    residual -= contact_forces(answer)[span]
    if not isinstance(own, Body):  # force and moment: rotations are lengths in the system, see `scale`
        supports = np.zeros(own.n)
        supports[where] = residual[where]
        return np.asarray(supports * answer.system.scale(own))
    component = own.dof_component[where]
    return np.array([residual[where][component == k].sum() for k in range(own.components)])
