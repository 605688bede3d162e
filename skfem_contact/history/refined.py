"""The answer of a linear problem near an iterate, with as many digits as it can have.

Beyond yield and about to buckle bodies move far under small forces. Displacements that follow from
forces then have few digits, and so have gaps and slips. They are solved for once more, and looked at.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import LinAlgError

from skfem_contact.answers.placed import Placed, point_forces
from skfem_contact.arrays import Array, largest
from skfem_contact.carried import copied
from skfem_contact.conditions.state import OPEN, LocalState
from skfem_contact.digits import SOLVED
from skfem_contact.errors import LinearSolveError, SingularMatrix
from skfem_contact.history.load_step import Attempt, Recovery
from skfem_contact.problem.response import Response

#: Routes whose linear problems are iterated.
ROUGH = "iterated", "multigrid"
#: What a linear problem raises that has no answer, or none that is found.
UNSOLVED = SingularMatrix, LinearSolveError, LinAlgError


def refined(attempt: Attempt, u: Array, at: Placed) -> tuple[Attempt, Array]:
    """An attempt and its displacements (n,), with points closed and in place as far as digits go.

    Where displacements follow from forces on a body that is about to flow, or to buckle, their
    round-off moves it far. What is wrong with gaps, slips and friction then is solved for once more,
    with the same points closed (iterative refinement); where the linear problem itself was iterated,
    with the forces that are missing to its equilibrium as well.
    """
    problem, it, rough = attempt.problem, attempt.outcome.iterate, attempt.model.route in ROUGH
    answer, given = it.response, it.conditions
    by_forces = rough or problem.source(attempt.load, answer).forces
    if problem.springs is not None or not by_forces:
        return attempt, u
    kin, f = problem.kin, np.zeros(len(u))
    if rough:
        f = attempt.case.f - at.resisting(attempt.model.system, u) + point_forces(kin, attempt.local)
        f[attempt.model.system.D] = 0.0
    slip = (kin.B_t @ u).reshape(answer.slip.shape) + attempt.seen.slip0
    law = given.offset + given.coupling * answer.normal_force[:, None] - answer.tangential_force
    case = copied(
        attempt.seen,
        f=f,
        x=np.zeros(len(u)),
        gap0=kin.B_n @ u + attempt.seen.gap0,
        slip0=slip - given.anchor,
    )
    load = problem.load(case)
    conditions = replace(given, anchor=np.zeros(slip.shape), offset=law, rough=False)
    try:
        left = problem.solve(conditions, load)
    except UNSOLVED:  # what is left is round-off of iterated problems
        return attempt, u
    more = replace(Recovery.of(attempt), found=problem.source(load, left), components=load.components)
    du = replace(more, case=case, shift=None)()
    return replace(attempt, local=_moved(attempt, left, du)), u + du


def usable(attempt: Attempt, u: Array) -> bool:
    """Return whether displacements (n,) may be gone on from.

    They follow from matrices that may have no digits, where bodies flow or buckle. What is seen
    through springs comes to its place by and by, in the iterates that follow.
    """
    if not np.all(np.isfinite(u)):
        return False
    return not attempt.outcome.converged or attempt.problem.springs is not None or holds(attempt, u)


def holds(attempt: Attempt, u: Array) -> bool:
    """Return whether displacements (n,) have the gaps and slips of the points that carry forces."""
    kin, local, seen = attempt.problem.kin, attempt.local, attempt.seen
    closed = local.status != OPEN
    wrong = (kin.B_n @ u)[closed] + seen.gap0[closed] - local.gap[closed]
    slip = (kin.B_t @ u).reshape(seen.slip0.shape) + seen.slip0 - local.slip
    wrong = np.append(wrong, slip[local.tangential_force != 0])
    return largest(np.abs(wrong)) <= SOLVED * max(attempt.model.system.extent, largest(np.abs(u)))


def _moved(attempt: Attempt, left: Response, du: Array) -> LocalState:
    """The state of an attempt after what was left has been solved for as well."""
    local, it = attempt.local, attempt.outcome.iterate
    closed, dofs = local.status != OPEN, attempt.model.geometry.surface_dofs
    modelled = attempt.model.interface.slipping[:, None]  # of others slips are no unknowns
    slip = left.slip + it.conditions.anchor - it.response.slip
    slip = local.slip + np.where(modelled, slip, 0.0)
    surface = local.surface + du[dofs] if len(local.surface) else local.surface
    return replace(
        local,
        gap=np.where(closed, local.gap, left.gap),
        slip=slip,
        reference=np.where(closed[:, None], local.reference, slip),
        normal_force=local.normal_force + np.where(closed, left.normal_force, 0.0),
        tangential_force=local.tangential_force + np.where(closed[:, None], left.tangential_force, 0.0),
        surface=surface,
    )
