"""Contacts whose forces are not unique: conditions of points that press depend on each other.

Forces v with ``B'v = 0`` can then be added to those of an answer, as long as all points still press and
no friction exceeds its bound: displacements stay what they are. So it is between contacts that share an
edge, with friction or walls at an acute angle, where a tool that supports hold is finer than what it
presses, and where supports and friction hold the same node.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from skfem_contact.answers.answer import Answer
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.state import SLIP, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.elimination.eliminate import eliminate

Index = NDArray[np.intp]


def undetermined(answer: Answer) -> tuple[str, ...]:
    """A sentence per group of contacts whose forces are not unique; see `ContactResult.undetermined`.

    Points that hardly press count for nothing: what is left of them decides on no force.
    """
    if not answer.springs:
        return ()
    rows, points = _rows(answer)
    redundant = eliminate(rows, np.zeros(len(points))).redundant
    _, group = connected_components(abs(rows) @ abs(rows).T, directed=False)
    of_point = np.concatenate([np.full(len(kin), i) for i, kin in enumerate(_parts(answer))])
    found: dict[tuple[int, ...], list[int]] = {}
    for g in np.unique(group[redundant]):
        contacts = tuple(np.unique(of_point[points[group == g]]).tolist())
        counts = found.setdefault(contacts, [0, 0])
        counts[0] += np.count_nonzero(group == g)
        counts[1] += np.count_nonzero(group[redundant] == g)
    return tuple(_words(answer, *item) for item in found.items())


def _words(answer: Answer, contacts: tuple[int, ...], counts: list[int]) -> str:
    *first, last = [f"'{answer.names[i]}'" for i in contacts]
    names = f"{', '.join(first)} and {last}" if first else last
    total, more = counts
    return (
        f"The contact forces of {names} are not unique: of {total} conditions at points that press "
        f"{more} follow from the others. Displacements are the same for all forces that fulfil them; "
        "these are chosen by the least squares of friction and of pressure over the surfaces, whatever "
        "the order of contacts and nodes."
    )


def _rows(answer: Answer) -> tuple[csr_matrix, Index]:
    """What the forces of points act along, over the free DOFs, and which point each is of.

    A point that slips has one row, as its friction follows the normal force.
    """
    system, state, conditions = answer.system, answer.state, answer.conditions
    free = np.setdiff1d(np.arange(system.n), system.D)
    kin = without_columns(answer.kin, free)
    m, t = kin.m, kin.tangents
    largest = np.max(np.abs(state.normal_force), initial=0.0)
    presses = kin.paired & (kin.bilateral | (state.normal_force > SOLVED * largest))
    presses &= state.status != 0
    rows, points = [kin.B_n], [np.arange(m)]
    if t:
        slips = np.where((state.status == SLIP)[:, None], conditions.coupling, 0.0)
        at = np.arange(m * t)
        spread = csr_matrix((slips.ravel(), (at // t, at)), shape=(m, m * t))
        rows[0] = csr_matrix(kin.B_n - spread @ kin.B_t)
        sticks = np.repeat(presses & (state.status == STICK) & conditions.stick, t)
        rows.append(kin.B_t[sticks])
        points.append(at[sticks] // t)
    rows[0], points[0] = rows[0][presses], points[0][presses]
    all_rows, all_points = csr_matrix(vstack(rows)), np.concatenate(points)
    moves = np.diff(all_rows.indptr) > 0  # the others are data: supports make them
    return csr_matrix(all_rows[moves]), all_points[moves]


def _parts(answer: Answer) -> list[Index]:
    """The points of each contact."""
    return [np.arange(answer.kin.m)[part] for part in answer.slices()]
