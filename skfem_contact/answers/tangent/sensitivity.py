"""`Sensitivity`: derivatives of a result by one number; and those that a user gives of a function."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.changes import Parameter, change, parameters
from skfem_contact.answers.tangent.rates import Rates, check_lost
from skfem_contact.answers.tangent.sides import one_sided
from skfem_contact.answers.tangent.tangent import Tangent, Values
from skfem_contact.arguments import numbers, shown
from skfem_contact.arrays import Array, Index
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.errors import InputError

AT_CONTACT = "gap", "normal_force", "pressure", "slip", "tangential_force", "force"


class BoltRates(NamedTuple):
    """Derivatives of a bolt: of its force, and of the length by which it is drawn shorter."""

    force: float
    stretch: float


def _its(quantity: str, words: str) -> Any:
    """A property: the rates of a quantity of the only contact."""
    return property(lambda rates: rates.of(quantity), doc=words)


class Sensitivity:
    """Derivatives of a result by one number, as the quantities of the result have them.

    Attributes
    ----------
    by : Parameter
    side : int
        0, or 1 and -1 for the derivative to this side where there is a kink.

    Examples
    --------
    A block that slips as a whole: its friction is proportional to the coefficient.

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(
    ...     basis, linear_elasticity(0, 0.5), D="top", x={"top": (0.2, -0.01)}, name="block"
    ... )
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> by_mu = result.sensitivity("friction")
    >>> (result.force[0] / 0.3).round(9), by_mu.force[0].round(9)
    (..., ...)
    """

    def __init__(self, by: Parameter, rates: Rates, side: int) -> None:
        self.by, self.side, self._rates = by, side, rates
        self._sign = -1.0 if side < 0 else 1.0
        self._answer = rates.tangent.answer

    @property
    def dissipation(self) -> float:
        """The derivative of the energy lost by friction in the step [energy over the parameter]."""
        check_lost(self._rates.tangent)
        return self._sign * float(self._rates.values["lost"].sum())

    @property
    def u(self) -> Array:
        """The derivatives of the displacements of all bodies, shape (n,)."""
        return self._sign * self._rates.u / self._answer.system.units

    @property
    def bolts(self) -> dict[str, BoltRates]:
        """The derivatives of the forces and stretches of bolts, by name."""
        rates, names = self._rates, self._answer.bolt_names
        if not names:
            return {}
        known = self._sign * np.column_stack([rates.values["tension"], rates.values["stretch"]])
        return {name: BoltRates(*own) for name, own in zip(names, known.tolist(), strict=True)}

    def displacement(self, body: Any) -> Array:
        """Return the derivatives of the displacements of one body, shape (n_body,)."""
        return self.u[self._answer.system.slice(body)]

    def of(self, quantity: str, contact: Any = None) -> Array:
        """Return the derivatives of a quantity of a contact, in the shape of its values.

        Parameters
        ----------
        quantity : {"gap", "normal_force", "pressure", "slip", "tangential_force", "force"}
        contact : str, optional
            Its name; not needed where there is one.
        """
        answer, rates = self._answer, self._rates.values
        parts = [
            np.einsum("iw,siwo->io", rates[name][at], by)
            for name, at, by in _terms([answer], quantity, _which(answer, contact, quantity))
            if name in rates
        ]
        found = self._sign * sum(parts)
        if quantity == "force":
            return np.asarray(found.sum(axis=0))
        return np.asarray(found if quantity in ("slip", "tangential_force") else found[:, 0])

    gap: Array = _its("gap", "The derivatives of the gaps of the only contact, (m,).")
    normal_force: Array = _its("normal_force", "The derivatives of the normal forces, (m,).")
    pressure: Array = _its("pressure", "The derivatives of the pressures, (m,).")
    slip: Array = _its("slip", "The derivatives of the slips, (m, d-1).")
    tangential_force: Array = _its(
        "tangential_force", "The derivatives of the friction forces, (m, d-1)."
    )
    force: Array = _its("force", "The derivatives of the resultant on the secondary, (d,).")

    def dot(self, weights: Mapping[str, Any]) -> float:
        """Derivative of a function of the result, given as for `ContactSolver.gradient`."""
        return self._sign * self._rates.dot(weights_of([self._answer], [weights])[0])


def sensitivity(tangent: Tangent, by: Any, after: Sensitivity | None, side: int) -> Sensitivity:
    """Derivatives of an answer; see `ContactResult.sensitivity`."""
    [by] = parameters(by, many=False)
    if side not in (-1, 0, 1):
        raise InputError(f"side = {shown(side)}; it may be 1, -1, or 0 for the statuses that hold")
    if after is not None and (repr(after.by), after.side) != (repr(by), side):
        raise InputError(f"after is by {after.by!r}, side {after.side}; here by {by!r}, side {side}")
    found, last = change(by, tangent), {} if after is None else after._rates.handed_on
    rates = one_sided(tangent, found, last, side) if side else Rates(tangent, found, last)
    return Sensitivity(by, rates, side)


# -- quantities -----------------------------------------------------------------------------------


def _which(answer: Answer, contact: Any, what: str) -> int:
    if what not in AT_CONTACT:
        raise InputError(f"{what!r} is none of {', '.join(AT_CONTACT)}")
    if contact is None and len(answer.names) != 1:
        raise InputError(f"{what}: there are several contacts; name one of {', '.join(answer.names)}")
    if contact is not None and contact not in answer.names:
        raise InputError(f"there is no contact {shown(contact)}, only {', '.join(answer.names)}")
    return 0 if contact is None else answer.names.index(contact)


def _terms(answers: Sequence[Answer], what: str, i: int) -> list[tuple[str, Index, Array]]:
    """A quantity of a contact as a linear map of values at points, to be summed.

    Of s results of one pairing at once. Each term has its name, its points (k,), and what a number of
    these makes of the quantity, (s or 1, k or 1, width, o); of a resultant at each point its share.
    """
    kin, part = answers[0].kin, answers[0].model.interface.point_slices[i]
    heir, own, one = kin.heir[part], np.arange(part.start, part.stop), np.ones((1, 1, 1, 1))
    if what == "gap":
        return [("gap", heir, one)]
    if what == "normal_force":
        return [("normal_force", own, one)]
    if what == "slip":
        _check_slip(answers[0], i)
        return [("slipped", heir, _along_tangents(kin, kin.duals, heir)[None])]
    if what == "tangential_force":
        return [("friction", own, -_along_tangents(kin, kin.axes, own)[None])]
    normal_force = np.array([answer.local.normal_force for answer in answers])[..., None, None]
    if what == "pressure":
        area = kin.area[heir]
        per = np.divide(1.0, area, out=np.zeros(len(area)), where=area > 0)[:, None, None]
        return [("normal_force", heir, per[None]), ("area", heir, -(per**2) * normal_force[:, heir])]
    normal, axes, unit = kin.normal[part, None], kin.axes[part], np.eye(kin.normal.shape[1])
    friction = np.array([answer.local.tangential_force[part] for answer in answers])
    by_axes = -np.einsum("sik,de->sikde", friction, unit)
    return [  # force = sum of lambda n - tau . axes
        ("normal_force", own, normal[None]),
        ("friction", own, -axes[None]),
        ("normal", own, normal_force[:, own] * unit),
        ("axes", own, by_axes.reshape(len(answers), len(own), -1, len(unit))),
    ]


def _along_tangents(kin: Kinematics, basis: Array, at: Index) -> Array:
    """Components along unit tangents from those along a basis, (k, d-1, d-1) or (1, d-1, d-1)."""
    if kin.scaled is None:
        return np.eye(kin.tangents)[None]
    return np.asarray(np.einsum("ikd,ild->ikl", basis[at], kin.tangent[at]))


def _check_slip(answer: Answer, i: int) -> None:
    if not answer.model.interface.slipping[answer.model.interface.point_slices[i]].any():
        raise InputError(
            f"slip of contact {answer.names[i]!r}: without friction nothing tangential is solved for, "
            "and its slip is no unknown. Take the displacements of the bodies."
        )


def weights_of(answers: Sequence[Answer], given: Sequence[Any]) -> list[Values]:
    """A user's derivatives of a function of results: by quantity, or by contact and quantity.

    Raises
    ------
    InputError
    """
    found = [Values() for _ in answers]
    asked: dict[tuple[int, int, str], list[tuple[Answer, Values, Any]]] = {}
    for answer, out, own in zip(answers, found, given, strict=True):
        for contact, what, value in _named(answer, {} if own is None else own):
            if what == "dissipation" or (what in ELSEWHERE and contact is None):
                ELSEWHERE[what](answer, out, contact, value)
            else:
                key = id(answer.kin), _which(answer, contact, what), what
                asked.setdefault(key, []).append((answer, out, value))
    for (_, i, what), some in asked.items():
        _by_quantity(some, what, i)
    return found


def _named(answer: Answer, given: Any) -> Iterator[tuple[str | None, str, Any]]:
    """Contacts, quantities and derivatives that a user gives of one result."""
    if not isinstance(given, Mapping):
        raise InputError(f"derivatives by a result are {shown(given)}; give a dict by quantity")
    known = *AT_CONTACT, *ELSEWHERE, *answer.names
    for key, value in given.items():
        contact = key if key in answer.names and isinstance(value, Mapping) else None
        if contact is None and key not in (*AT_CONTACT, *ELSEWHERE):
            raise InputError(f"derivatives by a result name {key!r}; they may name {', '.join(known)}")
        for what, own in value.items() if contact else [(key, value)]:
            yield contact, what, own


def _by_energy(answer: Answer, out: Values, contact: str | None, value: Any) -> None:
    parts = answer.model.interface.point_slices
    at = slice(None) if contact is None else parts[answer.names.index(contact)]
    out.setdefault("lost", np.zeros((answer.kin.m, 1)))[at] += float(value)


def _by_bolts(answer: Answer, out: Values, _: None, given: Any) -> None:
    names, parts = answer.bolt_names, {"force": "tension", "stretch": "stretch"}
    for name, own in given.items() if isinstance(given, Mapping) else [(given, {})]:
        if name not in names or not isinstance(own, Mapping) or not set(own) <= set(parts):
            raise InputError(
                f"the derivative by bolts is {shown(given)}; give one by force or stretch, "
                f"{{'bolt 1': {{'force': 1.0}}}}. Bolts of the solver: {', '.join(names) or 'none'}"
            )
        for what, value in own.items():
            out.setdefault(parts[what], np.zeros(len(names)))[names.index(name)] += float(value)


def _by_all(answer: Answer, out: Values, _: None, value: Any) -> None:
    u, n = out.setdefault("u", np.zeros(answer.system.n)), answer.system.n
    u += _shaped(value, (n,), "u") / answer.system.units


def _by_displacement(answer: Answer, out: Values, _: None, given: Any) -> None:
    system = answer.system
    if not isinstance(given, Mapping):
        raise InputError(
            f"the derivative by displacement is {shown(given)}; give one for each body, "
            "{'block': array}, or by u for all of them"
        )
    for body, value in given.items():
        member = system.bodies[system.index(body)]
        whole = np.zeros(system.n)
        whole[system.slice(member)] = _shaped(value, (member.n,), "displacement")
        _by_all(answer, out, None, whole)


#: Quantities that no point of a contact has.
ELSEWHERE: dict[str, Callable[[Answer, Values, Any, Any], None]] = {
    "u": _by_all,
    "displacement": _by_displacement,
    "dissipation": _by_energy,
    "bolts": _by_bolts,
}


def _by_quantity(given: list[tuple[Answer, Values, Any]], what: str, i: int) -> None:
    """Derivatives by one quantity of results that have the same pairing, all at once."""
    answers, found, values = zip(*given, strict=True)
    kin, part = answers[0].kin, answers[0].model.interface.point_slices[i]
    m, t, d = part.stop - part.start, kin.tangents, kin.normal.shape[1]
    shape = {"slip": (m, t), "tangential_force": (m, t), "force": (d,)}.get(what, (m,))
    w = np.array([_shaped(value, shape, what) for value in values])
    w = np.broadcast_to(w[:, None], (len(w), m, d)) if what == "force" else w.reshape(len(w), m, -1)
    for name, at, by in _terms(answers, what, i):
        blocks = np.zeros((len(w), kin.m, by.shape[2]))
        np.add.at(blocks.swapaxes(0, 1), at, np.einsum("sio,siwo->isw", w, by))
        for out, block in zip(found, blocks, strict=True):
            out[name] = out[name] + block if name in out else block


def _shaped(value: Any, shape: tuple[int, ...], what: str) -> Array:
    found = numbers(value, f"the derivative by {what}", f"give an array of shape {shape}", copy=False)
    if found.shape != shape:
        raise InputError(f"the derivative by {what} has shape {found.shape}, not {shape}")
    return found
