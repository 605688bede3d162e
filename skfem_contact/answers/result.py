"""`ContactResult`: the answer of one load step, per contact and for all bodies, and its certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.certificate import Certificate, certify
from skfem_contact.answers.error.estimate import estimate
from skfem_contact.answers.uniqueness import Uniqueness, uniqueness
from skfem_contact.answers.validity.rotation import rigid_rotations
from skfem_contact.answers.validity.validity import Validity, assess
from skfem_contact.answers.validity.watched import Watched
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.inputs import suggest
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.identity import Identity
from skfem_contact.conditions.interface import can_carry
from skfem_contact.errors import InputError
from skfem_contact.sealed import seal, sealed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ContactResult(Answer):
    """The answer of one load step.

    What a contact knows (`ContactValues`: pressure, traction, slip, status, ...) is reached by
    ``result[contact]`` or ``result["name"]``, and directly on the result when there is one contact.

    Attributes
    ----------
    converged : bool
    message : str
    iterations : int
    trace : tuple of Record
    timings : dict
        Seconds by stage.
    tangential_stiffness : ndarray, shape (m,)
        Of sticking points, ``inf`` where they stick exactly [force/length].
    factor : float or None
        The number of the load step, where it was one.
    plastic_slip : ndarray, shape (m, d-1)
        What friction acts on: slip of this step, or of its last part where it was cut, less what a
        finite tangential stiffness gives back; positive as the resisting force is [length].
    settings : Settings
        The loads in force, from which the next step of a history begins.
    indifferent : tuple of str
        A sentence per motion that nothing loads and nothing holds: the forces are those of every
        place along it, and the body stands where it has moved least since the last result.
    watched : Watched
        What every step tells of the bounds of the model; `validity` has more.
    """

    def __post_init__(self) -> None:
        # points without a multiplier of their own show the gap of the point that has it
        object.__setattr__(self, "gap", self.gap[self.kin.heir])
        self._seal()

    def watch(self, watched: Watched) -> None:
        """What was seen of the model's validity; set while the result is made, which seals it once."""
        object.__setattr__(self, "watched", watched)

    def _seal(self) -> None:
        for part in (self, self.state, self.case, self.settings):
            seal(part)
        if self.seen is not self.case:
            seal(self.seen)
        if "u" in vars(self):
            sealed(self.u)

    def __getstate__(self) -> dict[str, Any]:
        """All that reports and pictures need, without the factors of the bodies.

        What the bodies' factors and functions are needed for is computed before they stay behind.
        """
        self.u  # noqa: B018
        for values in self.values:
            values.contact_area  # noqa: B018
            if values.points.shape[1] == 2 and np.any(values.status != 0):
                values.error_estimate  # noqa: B018
        parts = self.slices()
        given = tuple(self.case.interference[part] for part in parts)
        return {**vars(self), "settings": replace(self.settings, interference=given)}

    def __setstate__(self, known: dict[str, Any]) -> None:
        vars(self).update(known)
        self._seal()
        seal(self.kin)  # a pairing that is solved on has been

    def __getitem__(self, key: Contact | str | int) -> ContactValues:
        return self.values[self._position(key)]

    def _position(self, key: Contact | str | int) -> int:
        if isinstance(key, str):
            if key in self.names:
                return self.names.index(key)
            raise InputError(f"there is no contact {key!r}{suggest(key, self.names, 'contacts')}")
        if isinstance(key, int):
            if not -len(self.names) <= key < len(self.names):
                raise InputError(f"there is no contact number {key}, only {len(self.names)} from 0 on")
            return range(len(self.names))[key]
        for i, contact in enumerate(self.contacts):
            if contact is key:
                return i
        raise InputError("this contact is not one of those of the solver: pass the same object")

    @cached_property
    def values(self) -> tuple[ContactValues, ...]:
        """The answer of every contact, in the order given."""
        return tuple(self._values(i, part) for i, part in enumerate(self.slices()))

    def _values(self, i: int, part: slice) -> ContactValues:
        kin, state, contact = self.kin, self.state, self.contacts[i]
        status = state.status[part]
        status = np.where(self._smooth(i, part) & (status != 0), 2, status)
        heir = kin.heir[part] - part.start
        own = heir == np.arange(len(heir))
        return ContactValues(
            name=self.names[i],
            points=contact.secondary.points,  # those of kin have moved, where contact slides far
            normal=kin.normal[part],
            tangent=kin.tangent[part],
            gap=self.gap[part][heir],
            status=status[heir],
            normal_force=state.normal_force[part],
            tangential_force=-state.tangential_force[part],
            area=np.where(own, kin.area[part], 0.0),
            surface=contact.secondary,
            heir=heir,
            action=kin.action[part],
            dissipation=float(self.dissipation_by_contact[i]),
            dissipation_total=float(self.dissipation_before[i] + self.dissipation_by_contact[i]),
            energy_residual=float(self.residual_by_contact[i]),
            assess=partial(estimate, self),
            slips=partial(self._slip, i, part),
        )

    def _smooth(self, i: int, part: slice) -> NDArray[np.bool_]:
        """Points without friction or glue: nothing tangential is solved for."""
        contact = self.contacts[i]
        carries = can_carry(contact.friction, part.stop - part.start)
        return ~carries & (not contact.tied and self.kin.tangents > 0)

    def _slip(self, i: int, part: slice) -> Array:
        kin, state, t = self.kin, self.state, self.kin.tangents
        slip, smooth = (state.slip - state.reference)[part], self._smooth(i, part)
        if smooth.any():
            rows = slice(part.start * t, part.stop * t)
            moved = (kin.B_t[rows] @ self.u).reshape(-1, t) + self.seen.slip0[part]
            moved = np.where((state.status[part] != 0)[:, None], moved, 0.0)
            slip = np.where(smooth[:, None], moved, slip)
        return slip[kin.heir[part] - part.start]

    @property
    def identity(self) -> Identity:
        """The bodies and contacts that this is a state of."""
        known: Identity = self.recover.model.geometry.identity
        return known

    @property
    def own_interference(self) -> tuple[bool, ...]:
        """Of which contacts the interference in force is the contact's own, and not that of a step."""
        pairs = zip(self.settings.interference, self.contacts, strict=True)
        return tuple(given is contact.interference for given, contact in pairs)

    @property
    def dissipation(self) -> float:
        """Energy lost by friction in this step, all contacts [energy]."""
        return float(self.dissipation_by_contact.sum())

    @property
    def dissipation_total(self) -> float:
        """Energy lost by friction since the start of the history, all contacts [energy]."""
        return float(self.dissipation_before.sum() + self.dissipation_by_contact.sum())

    @property
    def energy_residual(self) -> float:
        """What the energy balance of this step misses, all contacts [energy]; see `ContactValues`."""
        return float(self.residual_by_contact.sum())

    @cached_property
    def rotations(self) -> dict[str, float]:
        """Mean rotation of the surfaces that slide far, by body [rad]; empty for small sliding.

        Linear bodies are good for rotations well below 0.1 rad.
        """
        return rigid_rotations(self.system, self.contacts, self.state.surface)

    @cached_property
    def certificate(self) -> Certificate:
        """Dimensionless numbers measured from the answer, for all degrees of freedom."""
        return certify(self)

    @cached_property
    def validity(self) -> Validity:
        """Whether the model holds at the answer; computed when first asked for, see `Validity`.

        Warns
        -----
        ContactWarning
            What is beyond its bound and has not been said in this history.
        """
        return assess(self)

    @cached_property
    def uniqueness(self) -> Uniqueness | None:
        """Whether this load, or loads like it, have other answers; computed when first asked for.

        The critical friction of every point, and the index of this answer, see `Uniqueness`. None
        where it is not computed: on the sparse route, and where contact rows depend on each other.
        """
        return uniqueness(self)

    def __getattr__(self, name: str) -> Any:
        # only reached when the result itself has no such attribute
        if name.startswith("_") or name not in FORWARDED:
            raise AttributeError(f"ContactResult has no attribute {name!r}")
        if len(self.names) != 1:
            raise AttributeError(
                f"'{name}' belongs to a contact and there are {len(self.names)} of them "
                f"({', '.join(self.names)}): write result['{self.names[0]}'].{name}"
            )
        return getattr(self.values[0], name)

    def __repr__(self) -> str:
        contacts = "; ".join(map(repr, self.values))
        return f"<ContactResult: {self.message}; {contacts}>"

    def __str__(self) -> str:
        from skfem_contact.answers.report import (
            report,
        )  # the report is about results, and stands after them

        return report(self)


FORWARDED = frozenset(
    {
        "area",
        "contact_area",
        "contact_edges",
        "error_estimate",
        "force",
        "force_on_primary",
        "forces",
        "friction_stress",
        "integrate",
        "interpolate",
        "moment",
        "normal",
        "normal_force",
        "points",
        "pressure",
        "slip",
        "status",
        "tangent",
        "tangential_force",
        "traction",
    }
)
