"""`Sensitivity`: derivatives of a result by one number; and those that a user gives of a function."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.changes import Parameter, change, parameters
from skfem_contact.answers.tangent.rates import Maps, Rates, Verge, check_lost, take
from skfem_contact.answers.tangent.tangent import Tangent, Values, add
from skfem_contact.arguments import numbers, shown
from skfem_contact.arrays import Array, Index
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.errors import InputError

AT_CONTACT = "gap", "normal_force", "pressure", "slip", "tangential_force", "force", "dissipation"
#: Of which each point has a share.
SUMS = "force", "dissipation"
At = Index | slice
#: The name of the values of a quantity.
ASKED = "asked"


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

    def of(self, quantity: str, contact: Any = None) -> Any:
        """Return the derivatives of a quantity of a contact, in the shape of its values.

        Parameters
        ----------
        quantity : str
            "gap", "normal_force", "pressure", "slip", "tangential_force", "force" or "dissipation".
        contact : str, optional
            Its name; not needed where there is one, nor for the energy that all of them lose.
        """
        maps, at = _quantity(self._answer, quantity, contact)
        if quantity == "dissipation":
            check_lost(self._rates.tangent)
        values = dict(self._rates.values)
        take(maps, values)
        found = self._sign * values[ASKED][at]
        found = found.sum(axis=0) if quantity in SUMS else found
        if quantity in ("slip", "tangential_force", "force"):
            return found
        return found[..., 0] if found.ndim > 1 else float(found[0])

    gap: Array = _its("gap", "The derivatives of the gaps of the only contact, (m,).")
    normal_force: Array = _its("normal_force", "The derivatives of the normal forces, (m,).")
    pressure: Array = _its("pressure", "The derivatives of the pressures, (m,).")
    slip: Array = _its("slip", "The derivatives of the slips, (m, d-1).")
    tangential_force: Array = _its("tangential_force", "The derivatives of friction, (m, d-1).")
    force: Array = _its("force", "The derivatives of the resultant on the secondary, (d,).")
    dissipation: float = _its("dissipation", "The derivative of the energy lost in the step.")

    def dot(self, weights: Mapping[str, Any]) -> float:
        """Derivative of a function of the result, given as for `ContactSolver.gradient`."""
        return self._sign * self._rates.dot(weights_of(self._answer, weights))


def sensitivity(tangent: Tangent, by: Any, after: Sensitivity | None, side: int) -> Sensitivity:
    """Derivatives of an answer; see `ContactResult.sensitivity`."""
    [by] = parameters(by, many=False)
    if side not in (-1, 0, 1):
        raise InputError(f"side = {shown(side)}; it may be 1, -1, or 0 for the statuses that hold")
    if after is not None and (repr(after.by), after.side) != (repr(by), side):
        raise InputError(f"after is by {after.by!r}, side {after.side}; here by {by!r}, side {side}")
    found, last = change(by, tangent), {} if after is None else after._rates.handed_on
    if side < 0:
        found = {name: -own for name, own in found.items()}
    at_kink = side and len(tangent.kinks)
    rates = Verge(tangent, found, last).rates() if at_kink else Rates(tangent, found, last)
    return Sensitivity(by, rates, side)


# -- quantities -----------------------------------------------------------------------------------


def _quantity(answer: Answer, what: str, contact: Any) -> tuple[Maps, At]:
    """A quantity of a contact as maps of values at points, and which points have it.

    Of a resultant each point has its share.
    """
    if what not in AT_CONTACT:
        raise InputError(
            f"no quantity is named {what!r}; there are {', '.join([*AT_CONTACT, *ELSEWHERE])}"
        )
    if contact is None and len(answer.names) != 1 and what != "dissipation":
        raise InputError(f"{what}: there are several contacts; name one of {', '.join(answer.names)}")
    if contact is not None and contact not in answer.names:
        raise InputError(f"there is no contact {shown(contact)}, only {', '.join(answer.names)}")
    i, kin, local = answer.names.index(contact or answer.names[0]), answer.kin, answer.local
    part = answer.model.interface.point_slices[i]
    heir: At = kin.heir[part] if kin.inherits else part
    if what == "dissipation":
        return [(ASKED, "lost", np.ones((1, 1)))], slice(None) if contact is None else part
    normal_force = local.normal_force[:, None]
    if what in ("gap", "normal_force"):
        return [(ASKED, what, np.ones((1, 1)))], heir if what == "gap" else part
    if what == "pressure":
        per = kin.per_area[:, None]
        return [(ASKED, "normal_force", per), (ASKED, "area", -(per**2) * normal_force)], heir
    if what == "slip":
        if not answer.model.interface.slipping[part].any():
            raise InputError(
                f"slip of contact {answer.names[i]!r}: without friction nothing tangential is solved "
                "for, and its slip is no unknown. Take the displacements of the bodies."
            )
        return [(ASKED, "slipped", _along_tangents(kin, kin.duals))], heir
    if what == "tangential_force":
        return [(ASKED, "friction", -_along_tangents(kin, kin.axes))], part
    unit = np.eye(kin.normal.shape[1])
    by_axes = -np.einsum("it,de->idte", local.tangential_force, unit)
    return [  # force = sum of lambda n - tau . axes
        (ASKED, "normal_force", kin.normal[:, :, None]),
        (ASKED, "friction", -kin.axes.swapaxes(1, 2)),
        (ASKED, "normal", normal_force),
        (ASKED, "axes", by_axes.reshape(kin.m, len(unit), -1)),
    ], part


def _along_tangents(kin: Kinematics, basis: Array) -> Array:
    """Components along unit tangents from those along a basis, (m, d-1, d-1), or one number."""
    if kin.scaled is None:
        return np.ones((1, 1))
    return np.asarray(np.einsum("ikd,ild->ilk", basis, kin.tangent))


def weights_of(answer: Answer, given: Any) -> Values:
    """A user's derivatives of a function of a result: by quantity, or by contact and quantity.

    Raises
    ------
    InputError
    """
    found, given = Values(), {} if given is None else given
    if not isinstance(given, Mapping):
        raise InputError(f"derivatives by a result are {shown(given)}; give a dict by quantity")
    for key, value in given.items():
        named = key in answer.names and isinstance(value, Mapping)
        for what, own in value.items() if named else [(key, value)]:
            _add(found, answer, what, key if named else None, own)
    return found


def _add(found: Values, answer: Answer, what: str, contact: str | None, value: Any) -> None:
    """Add the derivatives by one quantity."""
    if contact is None and what in ELSEWHERE:
        ELSEWHERE[what](found, answer, value)
        return
    maps, at = _quantity(answer, what, contact)
    m, d, t = len(answer.kin.heir[at]), answer.kin.normal.shape[1], answer.kin.tangents
    shapes = {"slip": (m, t), "tangential_force": (m, t), "force": (d,), "dissipation": ()}
    own = _shaped(value, shapes.get(what, (m,)), what)
    own = (np.broadcast_to(own, (m, *own.shape)) if what in SUMS else own).reshape(m, -1)
    found[ASKED] = np.zeros((answer.kin.m, own.shape[1]))
    if isinstance(at, slice):
        found[ASKED][at] = own
    else:
        np.add.at(found[ASKED], at, own)
    take(maps, found, back=True)
    del found[ASKED]


def _by_bolts(found: Values, answer: Answer, given: Any) -> None:
    names, parts = answer.bolt_names, {"force": "tension", "stretch": "stretch"}
    for name, own in given.items() if isinstance(given, Mapping) else [(given, {})]:
        if name not in names or not isinstance(own, Mapping) or not set(own) <= set(parts):
            raise InputError(
                f"the derivative by bolts is {shown(given)}; give one by force or stretch, "
                f"{{'bolt 1': {{'force': 1.0}}}}. Bolts of the solver: {', '.join(names) or 'none'}"
            )
        for what, value in own.items():
            add(found, parts[what], float(value) * (np.array(names) == name))


def _by_displacement(found: Values, answer: Answer, given: Any) -> None:
    if not isinstance(given, Mapping):  # of all bodies
        add(found, "u", _shaped(given, (answer.system.n,), "u") / answer.system.units)
        return
    whole = np.zeros(answer.system.n)
    for body, value in given.items():
        at = answer.system.slice(body)
        whole[at] = _shaped(value, (at.stop - at.start,), "displacement")
    _by_displacement(found, answer, whole)


#: Quantities that no point of a contact has.
ELSEWHERE = {"u": _by_displacement, "displacement": _by_displacement, "bolts": _by_bolts}


def _shaped(value: Any, shape: tuple[int, ...], what: str) -> Array:
    if type(value) is np.ndarray and value.dtype == float and value.shape == shape:
        return value  # as a rule
    found = numbers(value, f"the derivative by {what}", f"give an array of shape {shape}", copy=False)
    if found.shape != shape:
        raise InputError(f"the derivative by {what} has shape {found.shape}, not {shape}")
    return found
