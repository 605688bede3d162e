"""The contacts of a result: the answer over all points, split by contact, and found by name or number.

Where a result has one contact, the properties of its `ContactValues` stand on the result itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.values import ContactValues
from skfem_contact.arguments import suggest
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.interface import can_carry
from skfem_contact.conditions.state import OPEN, SLIP
from skfem_contact.errors import InputError

if TYPE_CHECKING:
    from skfem_contact.answers.error.sources import ErrorEstimate

Array = NDArray[np.float64]


class OfTheContact(ABC):
    """Properties of the contact itself, for results with one contact.

    With several contacts they are AttributeErrors that name the contacts: nothing is joined.
    """

    @abstractmethod
    def _only(self, name: str) -> ContactValues:
        """The values of the only contact; `name` is the property that is asked for."""

    @property
    def points(self) -> Array:
        """Positions on the undeformed secondary surface, shape (m, d) [length]."""
        return self._only("points").points

    @property
    def normal(self) -> Array:
        """Unit normals from primary to secondary, shape (m, d)."""
        return self._only("normal").normal

    @property
    def tangent(self) -> Array:
        """Unit tangents, shape (m, d-1, d)."""
        return self._only("tangent").tangent

    @property
    def area(self) -> Array:
        """Tributary area of the points, shape (m,) [area]."""
        return self._only("area").area

    @property
    def gap(self) -> Array:
        """Positive where open, ``inf`` where a point has no partner, shape (m,) [length]."""
        return self._only("gap").gap

    @property
    def slip(self) -> Array:
        """Of the secondary relative to the primary, (m, d-1) [length]; see `ContactValues.slip`."""
        return self._only("slip").slip

    @property
    def slip_vector(self) -> Array:
        """The slip in global axes, shape (m, d) [length]; see `ContactValues.slip_vector`."""
        return self._only("slip_vector").slip_vector

    @property
    def status(self) -> NDArray[np.intp]:
        """0 open, 1 stick, 2 slip, shape (m,)."""
        return self._only("status").status

    @property
    def pressure(self) -> Array:
        """Not negative in compression, shape (m,) [stress]; see `ContactValues.pressure`."""
        return self._only("pressure").pressure

    @property
    def traction(self) -> Array:
        """Stress vector on the secondary, in global axes, shape (m, d) [stress]."""
        return self._only("traction").traction

    @property
    def friction_stress(self) -> Array:
        """Friction over tributary area along the tangents, shape (m, d-1) [stress]."""
        return self._only("friction_stress").friction_stress

    @property
    def normal_force(self) -> Array:
        """Compressive force of each point, shape (m,) [force]."""
        return self._only("normal_force").normal_force

    @property
    def tangential_force(self) -> Array:
        """Friction on the secondary along the tangents, shape (m, d-1) [force]."""
        return self._only("tangential_force").tangential_force

    @property
    def tangential_force_vector(self) -> Array:
        """Friction on the secondary in global axes, shape (m, d) [force]."""
        return self._only("tangential_force_vector").tangential_force_vector

    @property
    def forces(self) -> Array:
        """Force on the secondary at each point, in global axes, shape (m, d) [force]."""
        return self._only("forces").forces

    @property
    def force(self) -> Array:
        """Resultant on the secondary body, shape (d,) [force]."""
        return self._only("force").force

    @property
    def force_on_primary(self) -> Array:
        """Resultant on the other side, a body or a rigid obstacle, shape (d,) [force]."""
        return self._only("force_on_primary").force_on_primary

    @property
    def moment(self) -> Callable[..., Any]:
        """``moment(about)`` of the forces on the secondary; see `ContactValues.moment`."""
        return self._only("moment").moment

    @property
    def contact_area(self) -> float:
        """Area in contact, up to the edges between nodes [area]."""
        return self._only("contact_area").contact_area

    @property
    def wear_depth(self) -> Array:
        """Depth worn off so far, shape (m,) [length]; see `Archard`."""
        return self._only("wear_depth").wear_depth

    @property
    def worn_volume(self) -> float:
        """Volume worn off so far [volume]; see `Archard`."""
        return self._only("worn_volume").worn_volume

    @property
    def contact_edges(self) -> Array:
        """Where contact ends, within a facet: points (k, 2), in 3-D segments (s, 2, 3) [length]."""
        return self._only("contact_edges").contact_edges

    @property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated error of pressure and friction, in 3-D a part of it; computed when asked for."""
        return self._only("error_estimate").error_estimate

    @property
    def interpolate(self) -> Callable[[ArrayLike, ArrayLike], Array]:
        """``interpolate(values, points)`` between the points; see `ContactValues.interpolate`."""
        return self._only("interpolate").interpolate

    @property
    def integrate(self) -> Callable[[ArrayLike], Any]:
        """``integrate(values)`` over the points; see `ContactValues.integrate`."""
        return self._only("integrate").integrate


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
        lost=_lost(answer, i, part),
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
        assess=partial(_estimate, answer),
        slips=partial(_slip, answer, i, part),
    )


def _estimate(answer: Answer, values: ContactValues) -> ErrorEstimate:
    from skfem_contact.answers.error.estimate import estimate  # most results are never asked for it

    return estimate(answer, values)


def _smooth(answer: Answer, i: int, part: slice) -> NDArray[np.bool_]:
    """Points without friction or glue: nothing tangential is solved for."""
    contact = answer.contacts[i]
    carries = can_carry(contact.friction, part.stop - part.start)
    return ~carries & (not contact.tied and answer.kin.tangents > 0)


def _lost(answer: Answer, i: int, part: slice) -> NDArray[np.bool_]:
    """See `ContactValues.lost`."""
    contact, tracks = answer.contacts[i], answer.diagnostics.tracks
    if contact.sliding == "small" or not tracks:
        return np.zeros(part.stop - part.start, dtype=bool)
    # a node that handed its multiplier on has a partner
    own = answer.kin.heir[part] == np.arange(part.start, part.stop)
    gone = tracks[i].paired & ~answer.kin.paired[part] & own
    facets, presses = contact.secondary.facets, answer.state.normal_force[part] > 0
    beside = np.zeros(len(gone), dtype=bool)
    beside[facets[presses[facets].any(axis=1)]] = True
    return gone & beside


def _slip(answer: Answer, i: int, part: slice) -> Array:
    kin, state, t = answer.kin, answer.local, answer.kin.tangents
    slip, smooth = (state.slip - state.reference)[part], _smooth(answer, i, part)
    if smooth.any():
        rows = slice(part.start * t, part.stop * t)
        moved = (kin.B_t[rows] @ answer.u).reshape(-1, t) + answer.seen.slip0[part]
        moved = np.where((state.status[part] != OPEN)[:, None], moved, 0.0)
        slip = np.where(smooth[:, None], moved, slip)
    return kin.slip_along(slip, part)[kin.heir[part] - part.start]


class ByContact(OfTheContact):
    """A result as its contacts; what is one contact's is also the result's where there is only one."""

    _answer: Answer

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts, in the order given to the solver."""
        return self._answer.names

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts themselves."""
        return self._answer.contacts

    @cached_property
    def values(self) -> tuple[ContactValues, ...]:
        """The answer of every contact, in the order given."""
        return values_of(self._answer)

    def __getitem__(self, key: Contact | str | int) -> ContactValues:
        return self.values[self._position(key)]

    def __iter__(self) -> Iterator[ContactValues]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.names)

    def __bool__(self) -> bool:
        return True  # of a result with `if result:` nobody asks how many contacts it has

    def __contains__(self, key: object) -> bool:
        known = isinstance(key, str) and key in self.names
        return known or number_of(key, self.contacts) is not None or any(key is own for own in self)

    def _position(self, key: Contact | str | int) -> int:
        if isinstance(key, str):
            if key in self.names:
                return self.names.index(key)
            raise InputError(f"there is no contact {key!r}{suggest(key, self.names, 'contacts')}")
        if isinstance(key, int | np.integer):
            if not -len(self.names) <= key < len(self.names):
                raise InputError(f"there is no contact number {key}, only {len(self.names)} from 0 on")
            return range(len(self.names))[key]
        i = number_of(key, self.contacts)
        if i is None:
            raise InputError("this contact is not one of those of the solver: pass the same object")
        return i

    def _only(self, name: str) -> ContactValues:
        if len(self.names) != 1:
            raise AttributeError(
                f"'{name}' belongs to a contact and there are {len(self.names)} of them "
                f"({', '.join(self.names)}): write result['{self.names[0]}'].{name}"
            )
        return self.values[0]
