"""What the answer of a linear problem near an iterate is worth: its digits, and what is to be said.

Beyond yield and about to buckle bodies move far under small forces. Displacements that follow from
forces then have few digits, and so have gaps and slips. They are solved for once more, and looked at.
What is an answer may be one that no body stays in, and on surfaces that are no longer where contact
is: that is said.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import LinAlgError
from scipy.sparse import block_diag, csr_matrix

from skfem_contact.answers.placed import Placed, point_forces
from skfem_contact.answers.validity.validity import A_TENTH
from skfem_contact.arrays import Array, largest
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.friction_rule import friction_bound
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import GIVEN, SOLVED
from skfem_contact.errors import ContactError, LinearSolveError, SingularMatrix
from skfem_contact.history.load_step import Attempt, Recovery
from skfem_contact.linalg.multifrontal.factor import MultifrontalCholesky
from skfem_contact.records import copied

#: Routes whose linear problems are iterated.
ROUGH = "iterated", "multigrid"
#: What a linear problem raises that has no answer, or none that is found.
UNSOLVED = SingularMatrix, LinearSolveError, LinAlgError

UNSTABLE = (
    "The answer is in equilibrium, but not stable: its tangent stiffness is not positive definite with "
    "contact as it is, and the least disturbance lets the bodies go elsewhere. Usually a slender part "
    "is beyond its buckling load, or one is about to snap. To see where it goes, add a small "
    "disturbance: a load of a millionth of the others, or nodes that are moved by as little."
)
TURNED = (
    "The surfaces of contact '{}' have {}, and sliding=\"small\" keeps contact as it "
    "is on the undeformed ones: gaps, normals and areas are those of before. Say "
    'Contact(..., sliding="finite") for contact on the deformed surfaces.'
)


def refined(attempt: Attempt, u: Array, at: Placed) -> tuple[Attempt, Array]:
    """An attempt and its displacements (n,), with points closed and in place as far as digits go.

    Where displacements follow from forces on a body that is about to flow, or to buckle, their
    round-off moves it far. What is wrong with gaps, slips and friction then is solved for once more,
    with the same points closed (iterative refinement); where the linear problem itself was iterated,
    with the forces that are missing to its equilibrium as well.
    """
    problem, rough = attempt.problem, attempt.model.route in ROUGH
    answer, given = attempt.outcome.iterate.response, attempt.outcome.iterate.conditions
    if not (rough or problem.source(attempt.load, answer).forces):
        return attempt, u
    kin, f = problem.kin, np.zeros(len(u))
    if rough:
        f = attempt.case.f - at.internal - block_diag(at.stiffness) @ (u - at.u)
        f += point_forces(kin, attempt.local)
        f[attempt.model.system.D] = 0.0
    gap = kin.B_n @ u + attempt.seen.gap0
    slip = (kin.B_t @ u).reshape(answer.slip.shape) + attempt.seen.slip0 - given.anchor
    law = given.offset + given.coupling * answer.normal_force[:, None] - answer.tangential_force
    case = copied(attempt.seen, f=f, x=np.zeros(len(u)), gap0=gap, slip0=slip)
    load = problem.load(case)
    conditions = replace(given, anchor=np.zeros(slip.shape), offset=law, rough=False)
    try:
        left = problem.solve(conditions, load)
    except UNSOLVED:  # what is left is round-off of iterated problems
        return attempt, u
    more = replace(Recovery.of(attempt), found=problem.source(load, left), components=load.components)
    du = replace(more, case=case, shift=None)()
    local, dofs = attempt.local, attempt.model.geometry.surface_dofs
    closed = local.status != OPEN
    modelled = attempt.model.interface.slipping[:, None]  # of others slips are no unknowns
    slip = local.slip + np.where(modelled, left.slip + given.anchor - answer.slip, 0.0)
    local = replace(
        local,
        gap=np.where(closed, local.gap, left.gap),
        slip=slip,
        reference=np.where(closed[:, None], local.reference, slip),
        normal_force=local.normal_force + np.where(closed, left.normal_force, 0.0),
        tangential_force=local.tangential_force + np.where(closed[:, None], left.tangential_force, 0.0),
        surface=local.surface + du[dofs] if len(local.surface) else local.surface,
    )
    return replace(attempt, local=local), u + du


def usable(attempt: Attempt, u: Array) -> bool:
    """Return whether displacements (n,) may be gone on from.

    They follow from matrices that may have no digits, where bodies flow or buckle. What is seen
    through springs comes to its place by and by, in the iterates that follow.
    """
    ends = attempt.outcome.converged and attempt.problem.springs is None
    return bool(np.isfinite(u).all()) and (not ends or holds(attempt, u))


def holds(attempt: Attempt, u: Array) -> bool:
    """Return whether displacements (n,) have the gaps and slips of the points that carry forces."""
    kin, local, seen = attempt.problem.kin, attempt.local, attempt.seen
    closed = local.status != OPEN
    wrong = (kin.B_n @ u)[closed] + seen.gap0[closed] - local.gap[closed]
    slip = (kin.B_t @ u).reshape(seen.slip0.shape) + seen.slip0 - local.slip
    wrong = np.append(wrong, slip[local.tangential_force != 0])
    return largest(np.abs(wrong)) <= SOLVED * max(attempt.model.system.extent, largest(np.abs(u)))


def remarks(attempt: Attempt, placed: Placed) -> dict[str, str]:
    """Return what is to be said, in words, by what it is about: each is said once in a history."""
    found = {"unstable": UNSTABLE} if unstable(attempt, placed) else {}
    interface = attempt.model.interface
    for i, (contact, part) in enumerate(zip(interface.contacts, interface.point_slices, strict=True)):
        if contact.sliding != "small" or not attempt.local.normal_force[part].any():
            continue
        angle, change = turned(attempt, placed, i), stretched(attempt, placed, i)
        if angle > A_TENTH:
            found[f"turned {i}"] = TURNED.format(contact.name or i + 1, f"turned by {angle:.2g} rad")
        if abs(change) > A_TENTH:
            how = f"changed their area, and friction by stress with it by {100 * change:+.2g} %"
            found[f"stretched {i}"] = TURNED.format(contact.name or i + 1, how)
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
    except SingularMatrix:
        return True
    return False


def turned(attempt: Attempt, placed: Placed, i: int) -> float:
    """By how much the normals of a contact with small sliding have turned, where points press [rad].

    Of two bodies one of which may strain and turn by any amount: others have bounds of their own.
    """
    contact, part = attempt.model.interface.contacts[i], attempt.model.interface.point_slices[i]
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    if len(sides) < 2 or not any(side.body.finite_strain for side in sides):
        return 0.0
    system = attempt.model.system
    try:
        there = pair(contact, moved=[placed.u[system.slice(side.body)] for side in sides])
    except ContactError:  # they are folded over: no normal
        return 0.0
    both = (attempt.local.normal_force[part] != 0) & np.isfinite(there.gap)
    along = np.einsum("id,id->i", there.normal, attempt.problem.kin.normal[part])[both]
    return float(np.max(np.arccos(np.clip(along, -1.0, 1.0)), initial=0.0))


def stretched(attempt: Attempt, placed: Placed, i: int) -> float:
    """By which part friction would be larger on the deformed area, under small sliding.

    Of bodies of finite strain, by what facets that press have grown: laws by stress take the area
    before, as pressures do.
    """
    model = attempt.model
    contact, part = model.interface.contacts[i], model.interface.point_slices[i]
    side, local, laws = contact.secondary, attempt.local, model.interface.laws
    bound = friction_bound(laws, local)[part].sum() if side.body.finite_strain else 0.0
    if not bound > 0:
        return 0.0
    own = (local.normal_force[part] != 0)[side.facets].any(axis=1)
    moved = side.moved(placed.u[model.system.slice(side.body)])
    before, now = (float(on.shares[own].sum()) for on in (side, moved))
    grown = replace(local, area=local.area * (now / before if before > 0 else 1.0))
    return float(friction_bound(laws, grown)[part].sum() / bound - 1.0)
