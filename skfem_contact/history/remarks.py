"""What is to be said of an answer of bodies that are not linear, though it is one."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.answers.placed import Placed
from skfem_contact.answers.thresholds import A_TENTH
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import GIVEN
from skfem_contact.errors import ContactError
from skfem_contact.history.load_step import Attempt
from skfem_contact.linalg.multifrontal.factor import MultifrontalCholesky

UNSTABLE = (
    "The answer is in equilibrium, but not stable: its tangent stiffness is not positive definite with "
    "contact as it is, and the least disturbance lets the bodies go elsewhere. Usually a slender part "
    "is beyond its buckling load, or one is about to snap. To see where it goes, add a small "
    "disturbance: a load of a millionth of the others, or nodes that are moved by as little."
)
TURNED = (
    "The surfaces of contact '{}' have turned by {:.2g} rad, and sliding=\"small\" keeps contact as it "
    "is on the undeformed ones: gaps, normals and areas are those of before. Say "
    'Contact(..., sliding="finite") for contact on the deformed surfaces.'
)


def remarks(attempt: Attempt, placed: Placed) -> dict[str, str]:
    """Return what is to be said, in words, by what it is about: each is said once in a history."""
    found = {}
    if unstable(attempt, placed):
        found["unstable"] = UNSTABLE
    names = attempt.model.interface.contacts
    for i, contact in enumerate(names):
        angle = turned(attempt, placed, i)
        if angle > A_TENTH:
            found[f"turned {i}"] = TURNED.format(contact.name or i + 1, angle)
    return found


def unstable(attempt: Attempt, placed: Placed) -> bool:
    """Whether the tangents at an answer are not positive definite with its points closed and sticking.

    Asked only where the tangent of a body was none of a stable body by itself, or nobody has looked:
    other bodies, and contact, may hold it. Springs against what contact holds, far stiffer than the
    bodies, leave Cholesky's method pivots that are negative only if a motion is left that nothing
    resists.
    """
    model = attempt.model
    parts = [part for part in model.substructures if part is not None and part.body.nonlinear]
    if model.route != "full" and not any(part.shaky for part in parts):
        return False
    if not all(isinstance(body, Body) for body in model.system.bodies):
        return False
    kin, local = attempt.problem.kin, attempt.local
    closed = local.status != OPEN
    sticks = np.repeat((local.status == STICK) & model.interface.slipping, kin.tangents)
    B = csr_matrix(kin.B_n[closed]), csr_matrix(kin.B_t[sticks])
    stiff = max(model.stiffest) / GIVEN
    K = csr_matrix(block_diag(placed.stiffness)) + stiff * sum(rows.T @ rows for rows in B)
    free = np.setdiff1d(np.arange(model.system.n), model.system.D)
    points = np.concatenate([body.dof_points for body in model.system.bodies])
    try:
        MultifrontalCholesky(csr_matrix(csr_matrix(K)[free][:, free]), points[free])
    except LinAlgError:
        return True
    return False


def turned(attempt: Attempt, placed: Placed, i: int) -> float:
    """By how much the normals of a contact with small sliding have turned, where points press [rad].

    Of two bodies one of which may strain and turn by any amount: others have bounds of their own.
    """
    model = attempt.model
    system, contact = model.system, model.interface.contacts[i]
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    part = model.interface.point_slices[i]
    presses = attempt.local.normal_force[part] != 0
    follows = contact.sliding != "small" or not any(side.body.finite_strain for side in sides)
    if follows or len(sides) < 2 or not presses.any():
        return 0.0
    try:
        there = pair(contact, moved=[placed.u[system.slice(side.body)] for side in sides])
    except ContactError:  # they are folded over: no normal
        return 0.0
    both = presses & np.isfinite(there.gap)
    along = np.einsum("id,id->i", there.normal, attempt.problem.kin.normal[part])[both]
    return float(np.max(np.arccos(np.clip(along, -1.0, 1.0)), initial=0.0))
