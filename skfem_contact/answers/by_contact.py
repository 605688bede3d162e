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
from skfem_contact.arguments import NamesAttributes, suggest
from skfem_contact.arrays import Array
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.state import OPEN, SLIP
from skfem_contact.errors import InputError

if TYPE_CHECKING:
    from skfem_contact.answers.values import ErrorEstimate


class _Its(property):
    """A property of the only contact of a result, by its own name, of the annotated type."""

    def __set_name__(self, owner: type, name: str) -> None:
        def only(result: OfTheContact) -> Any:
            return getattr(result._only(name), name)

        only.__doc__ = f"The `{name}` of the only contact, see `ContactValues.{name}`."
        only.__annotations__["return"] = owner.__annotations__[name]
        super().__init__(only)


def its() -> Any:
    """For type checkers a value of the annotated type."""
    return _Its()


class OfTheContact(NamesAttributes, ABC):
    """Properties of the contact itself, for results with one contact.

    With several contacts they are AttributeErrors that name the contacts: nothing is joined.
    """

    @abstractmethod
    def _only(self, name: str) -> ContactValues:
        """The values of the only contact; `name` is the property that is asked for."""

    points: Array = its()
    normal: Array = its()
    tangent: Array = its()
    area: Array = its()
    gap: Array = its()
    slip: Array = its()
    slip_vector: Array = its()
    status: NDArray[np.intp] = its()
    pressure: Array = its()
    traction: Array = its()
    friction_stress: Array = its()
    normal_force: Array = its()
    tangential_force: Array = its()
    tangential_force_vector: Array = its()
    forces: Array = its()
    force: Array = its()
    force_on_primary: Array = its()
    moment: Callable[..., Any] = its()
    contact_area: float = its()
    wear_depth: Array = its()
    worn_volume: float = its()
    contact_edges: Array = its()
    error_estimate: ErrorEstimate = its()
    interpolate: Callable[[ArrayLike, ArrayLike], Array] = its()
    integrate: Callable[[ArrayLike], Any] = its()


def _values(answer: Answer, i: int, part: slice) -> ContactValues:
    kin, state, contact = answer.kin, answer.local, answer.contacts[i]
    status, smooth = state.status[part], _smooth(answer, part)
    if np.count_nonzero(smooth):
        status = np.where(smooth & (status != OPEN), SLIP, status)
    heir = kin.heir[part] - part.start
    gap, wear, area = answer.gap[part], state.wear[part], kin.area[part]
    if kin.inherits:
        gap, wear, status = gap[heir], wear[heir], status[heir]
        area = np.where(heir == np.arange(len(heir)), area, 0.0)
    lost, before = answer.dissipation_by_contact[i], answer.dissipation_before[i]
    return ContactValues(
        name=answer.names[i],
        contact=contact,
        points=contact.secondary.points,  # those of kin have moved, where contact slides far
        normal=kin.normal[part],
        tangent=kin.tangent[part],
        gap=gap,
        lost=_lost(answer, i, part),
        status=status,
        normal_force=state.normal_force[part],
        tangential_force=-kin.friction_along(state.tangential_force[part], part),
        area=area,
        surface=contact.secondary,
        heir=heir,
        action=answer.action[part],
        dissipation=float(lost),
        dissipation_total=float(before + lost),
        energy_residual=float(answer.residual_by_contact[i]),
        wear_depth=wear,
        worn_volume=float(state.worn[part].sum()),
        assess=partial(_estimate, answer),
        slips=partial(_slip, answer, part),
        placed=partial(_placed, answer, contact),
    )


def _estimate(answer: Answer, values: ContactValues) -> ErrorEstimate:
    from skfem_contact.answers.estimate import estimate  # most results are never asked for it

    return estimate(answer, values)


def _placed(answer: Answer, contact: Contact) -> ContactSurface:
    """The secondary surface whose areas count: the deformed one, where strains may be large."""
    surface = contact.secondary
    if contact.sliding == "small" or not getattr(surface.body, "finite_strain", False):
        return surface
    return surface.moved(answer.displacement(surface.body))


def _smooth(answer: Answer, part: slice) -> NDArray[np.bool_]:
    """Points without friction or glue: nothing tangential is solved for."""
    return ~answer.model.interface.slipping[part] & (answer.kin.tangents > 0)


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


def _slip(answer: Answer, part: slice) -> Array:
    kin, state, t = answer.kin, answer.local, answer.kin.tangents
    slip, smooth = (state.slip - state.reference)[part], _smooth(answer, part)
    if smooth.any():
        rows = slice(part.start * t, part.stop * t)
        moved = (kin.B_t[rows] @ answer.u).reshape(-1, t) + answer.seen.slip0[part]
        moved = np.where((state.status[part] != OPEN)[:, None], moved, 0.0)
        slip = np.where(smooth[:, None], moved, slip)
    slip = kin.slip_along(slip, part)
    return slip[kin.heir[part] - part.start] if kin.inherits else slip


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
        parts = enumerate(self._answer.model.interface.point_slices)
        return tuple(_values(self._answer, i, part) for i, part in parts)

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
