"""The answer over all contact points, split into the values of each contact."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.error.estimate import estimate
from skfem_contact.answers.values import ContactValues
from skfem_contact.conditions.interface import can_carry
from skfem_contact.conditions.state import OPEN, SLIP

Array = NDArray[np.float64]


def values_of(answer: Answer) -> tuple[ContactValues, ...]:
    """The values of every contact, in the order given."""
    return tuple(_values(answer, i, part) for i, part in enumerate(answer.slices()))


def _values(answer: Answer, i: int, part: slice) -> ContactValues:
    kin, state, contact = answer.kin, answer.local, answer.contacts[i]
    status = state.status[part]
    status = np.where(_smooth(answer, i, part) & (status != OPEN), SLIP, status)
    heir = kin.heir[part] - part.start
    own = heir == np.arange(len(heir))
    lost, before = answer.dissipation_by_contact[i], answer.dissipation_before[i]
    return ContactValues(
        name=answer.names[i],
        contact=contact,
        points=contact.secondary.points,  # those of kin have moved, where contact slides far
        normal=kin.normal[part],
        tangent=kin.tangent[part],
        gap=answer.gap[part][heir],
        status=status[heir],
        normal_force=state.normal_force[part],
        tangential_force=-kin.friction_along(state.tangential_force[part], part),
        area=np.where(own, kin.area[part], 0.0),
        surface=contact.secondary,
        heir=heir,
        action=answer.action[part],
        dissipation=float(lost),
        dissipation_total=float(before + lost),
        energy_residual=float(answer.residual_by_contact[i]),
        wear_depth=state.wear[part][heir],
        worn_volume=float(state.worn[part].sum()),
        assess=partial(estimate, answer),
        slips=partial(_slip, answer, i, part),
    )


def _smooth(answer: Answer, i: int, part: slice) -> NDArray[np.bool_]:
    """Points without friction or glue: nothing tangential is solved for."""
    contact = answer.contacts[i]
    carries = can_carry(contact.friction, part.stop - part.start)
    return ~carries & (not contact.tied and answer.kin.tangents > 0)


def _slip(answer: Answer, i: int, part: slice) -> Array:
    kin, state, t = answer.kin, answer.local, answer.kin.tangents
    slip, smooth = (state.slip - state.reference)[part], _smooth(answer, i, part)
    if smooth.any():
        rows = slice(part.start * t, part.stop * t)
        moved = (kin.B_t[rows] @ answer.u).reshape(-1, t) + answer.seen.slip0[part]
        moved = np.where((state.status[part] != OPEN)[:, None], moved, 0.0)
        slip = np.where(smooth[:, None], moved, slip)
    return kin.slip_along(slip, part)[kin.heir[part] - part.start]
