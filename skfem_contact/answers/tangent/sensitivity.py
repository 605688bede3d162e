"""`Sensitivity`: derivatives of a result by one number; and those that a user gives of a function.

Where points are on the verge of a change (`Tangent.kinks`) there is a derivative to either side. Which
statuses hold there follows from the change itself: rates of gaps and pressures, of slips and what
friction lacks to its bound, are complementary as gaps and pressures themselves are. There are few such
points, so that they are changed one after the other until none contradicts.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.changes import Parameter, change, parameter
from skfem_contact.answers.tangent.rates import Rates, Weights, check_lost, forward
from skfem_contact.answers.tangent.tangent import Tangent
from skfem_contact.arguments import numbers, shown
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError, NotConverged

Array = NDArray[np.float64]
AT_CONTACT = "gap", "normal_force", "pressure", "slip", "tangential_force", "force"
AT_ALL = "u", "displacement", "dissipation"


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

    @property
    def dissipation(self) -> float:
        """Of the energy that friction takes in the step [energy over the parameter]."""
        check_lost(self._rates.tangent)
        return self._sign * float(self._rates.lost.sum())

    @property
    def u(self) -> Array:
        """Of the displacements of all bodies, shape (n,)."""
        return self._sign * self._rates.u / self._rates.answer.system.units

    def displacement(self, body: Any) -> Array:
        """Of the displacements of one body, shape (n_body,)."""
        return self.u[self._rates.answer.system.slice(body)]

    def of(self, quantity: str, contact: Any = None) -> Array:
        """Of a quantity of a contact, as its values have it.

        Parameters
        ----------
        quantity : {"gap", "normal_force", "pressure", "slip", "tangential_force", "force"}
        contact : str, optional
            Its name; not needed where there is one.
        """
        i, part = _which(self._rates.answer, contact, quantity)
        return self._sign * _quantity(self._rates, quantity, i, part)

    gap: Array = _its("gap", "Of the gaps of the only contact, (m,).")
    normal_force: Array = _its("normal_force", "Of the normal forces, (m,).")
    pressure: Array = _its("pressure", "Of the pressures, (m,).")
    slip: Array = _its("slip", "Of the slips, (m, d-1).")
    tangential_force: Array = _its("tangential_force", "Of the friction on the secondary, (m, d-1).")
    force: Array = _its("force", "Of the resultant on the secondary, (d,).")

    def dot(self, weights: Mapping[str, Any]) -> float:
        """Derivative of a function of the result, given as for `ContactSolver.gradient`."""
        return self._sign * self._rates.dot(weights_of(self._rates.answer, weights))


def sensitivity(
    answer: Answer, tangent: Tangent, by: Any, after: Sensitivity | None, side: int
) -> Sensitivity:
    """Derivatives of an answer; see `ContactResult.sensitivity`."""
    by = parameter(by)
    if by.field or by.each_step:
        raise InputError(
            f"sensitivity: {by!r} is many numbers; give a direction, along=..., or take solver.gradient"
        )
    if side not in (-1, 0, 1):
        raise InputError(f"side = {shown(side)}; it may be 1, -1, or 0 for the statuses that hold")
    if after is not None and (
        (after.by is not by and repr(after.by) != repr(by)) or after.side != side
    ):
        raise InputError(f"after is by {after.by!r}, side {after.side}; here by {by!r}, side {side}")
    found, before = change(by, tangent, answer), None if after is None else after._rates
    if side:
        return Sensitivity(by, one_sided(tangent, found, before, side), side)
    return Sensitivity(by, forward(tangent, found, before), side)


def one_sided(tangent: Tangent, found: Any, before: Rates | None, side: int) -> Rates:
    """Rates to one side, with the statuses that hold there.

    Raises
    ------
    InputError
        In space, where a direction of friction is about to be found.
    NotConverged
        No statuses fit.
    """
    found = copy(found)
    for name, value in vars(found).items():
        if isinstance(value, np.ndarray):
            setattr(found, name, side * value)
    if found.axes is not None:
        found.axes = tuple(side * a for a in found.axes)
    branch, seen, whole = tangent, set[bytes](), True
    while True:
        own = copy(found)
        switched = branch.switched & branch.slips
        given = branch.direction * found.bound[:, None]
        own.friction = np.where(switched[:, None], given, found.friction)
        rates = forward(branch, own, before)
        wanted = _contradicted(branch, rates, before)
        if not wanted:
            return rates
        key = branch.conditions.matrix_key()
        whole, again = whole and key not in seen, key in seen and not whole
        if again:
            raise NotConverged(
                "no statuses of the points with a kink fit the change to this side", None
            )
        if key in seen:
            seen = set()
        seen.add(key)
        last = max(wanted)  # one at a time, the last: ends where answers are unique (Murty)
        branch = branch.with_statuses(wanted if whole else {last: wanted[last]})


def _contradicted(branch: Tangent, rates: Rates, before: Rates | None) -> dict[int, tuple[int, Array]]:
    """Points with a kink whose rates contradict their status: what they are instead, and which way."""
    response, out = rates.response, dict[int, tuple[int, Array]]()
    gap, force, slip, friction = (
        SOLVED * float(np.max(np.abs(rate), initial=0.0))
        for rate in (response.gap, response.normal_force, rates.slip, rates.tangential_force)
    )
    still = np.zeros(rates.slip.shape[1])
    moved = rates.slip - (0.0 if before is None else before.slip)
    frictional, slid = branch.answer.model.interface.frictional, branch.slid
    for i in branch.kinks:
        if not branch.closed[i]:
            if (
                response.gap[i] < -gap
            ):  # what closes where it has slid slips on, against the way it went
                way = branch.answer.plastic_slip[i]
                slips = frictional[i] and slid[i]
                out[i] = (SLIP, way / np.linalg.norm(way)) if slips else (STICK, still)
        elif branch.touching[i] and response.normal_force[i] < -force:
            out[i] = (OPEN, still)
        elif frictional[i] and branch.slips[i]:
            if not slid[i] and branch.direction[i] @ moved[i] < -slip:
                out[i] = (STICK, still)
        elif frictional[i]:
            toward = branch.toward[i] if branch.toward[i].any() else np.sign(rates.tangential_force[i])
            if toward @ rates.tangential_force[i] - rates.bound[i] > friction:
                out[i] = (SLIP, toward)
    exact = branch.exact[list(out)].all() and len(still) == 1
    if not exact and any(
        frictional[i] and not slid[i] and status != OPEN for i, (status, _) in out.items()
    ):
        raise InputError(
            "side: points at the verge of slipping have derivatives to either side in the plane, with "
            "exact sticking. In space, or with a stiffness, move the load a little off the kink."
        )
    return out


# -- quantities -----------------------------------------------------------------------------------


def _which(answer: Answer, contact: Any, what: str) -> tuple[int, slice]:
    if what not in AT_CONTACT:
        raise InputError(f"{what!r} is none of {', '.join(AT_CONTACT)}")
    if contact is None and len(answer.names) != 1:
        raise InputError(f"{what}: there are several contacts; name one of {', '.join(answer.names)}")
    if contact is not None and contact not in answer.names:
        raise InputError(f"there is no contact {shown(contact)}, only {', '.join(answer.names)}")
    i = 0 if contact is None else answer.names.index(contact)
    return i, answer.model.interface.point_slices[i]


def _quantity(rates: Rates, what: str, i: int, part: slice) -> Array:
    """Rates of a quantity of one contact: that of each number in turn is what weights of it give."""
    answer, kin, response = rates.answer, rates.answer.kin, rates.response
    heir = kin.heir[part]
    if what == "gap":
        return np.asarray(response.gap[heir])
    if what == "normal_force":
        return np.asarray(response.normal_force[part])
    if what == "pressure":
        area, force = kin.area[heir], answer.local.normal_force[heir]
        found = response.normal_force[heir]
        if rates.change.area is not None:
            found = found - force * np.divide(
                rates.change.area[heir], area, out=np.zeros(len(area)), where=area > 0
            )
        return np.divide(found, area, out=np.zeros(len(area)), where=area > 0)
    if what == "slip":
        _check_slip(answer, i)
        slip = kin.slip_along((rates.slip - rates.reference)[part], part)
        return np.asarray(slip[heir - part.start])
    if what == "tangential_force":
        return -kin.friction_along(rates.tangential_force[part], part)
    unit = np.eye(kin.normal.shape[1])
    return np.array([rates.dot(weights_of(answer, {answer.names[i]: {"force": e}})) for e in unit])


def _check_slip(answer: Answer, i: int) -> None:
    if not answer.model.interface.slipping[answer.model.interface.point_slices[i]].any():
        raise InputError(
            f"slip of contact {answer.names[i]!r}: without friction nothing tangential is solved for, "
            "and its slip is no unknown. Take the displacements of the bodies."
        )


def weights_of(answer: Answer, given: Any) -> Weights:
    """A user's derivatives of a function of one result: by quantity, or by contact and quantity.

    Raises
    ------
    InputError
    """
    out = Weights.none(answer)
    if given is None:
        return out
    if not isinstance(given, Mapping):
        raise InputError(f"derivatives by a result are {shown(given)}; give a dict by quantity")
    for key, value in given.items():
        if key in ("u", "displacement"):
            _by_displacement(answer, out, key, value)
        elif key == "dissipation":
            out.lost += float(value)
        elif key in answer.names and isinstance(value, Mapping):
            i = answer.names.index(key)
            for what, own in value.items():
                if what == "dissipation":
                    out.lost[i] += float(own)
                else:
                    _by_quantity(answer, out, what, own, *_which(answer, key, what))
        elif key in AT_CONTACT:
            _by_quantity(answer, out, key, value, *_which(answer, None, key))
        else:
            known = ", ".join((*AT_CONTACT, *AT_ALL, *answer.names))
            raise InputError(f"derivatives by a result name {key!r}; they may name {known}")
    return out


def _by_displacement(answer: Answer, out: Weights, key: str, value: Any) -> None:
    system = answer.system
    if out.u is None:
        out.u = np.zeros(system.n)
    parts = {None: value} if key == "u" else value
    for body, own in parts.items():
        span = slice(None) if body is None else system.slice(system.bodies[system.index(body)])
        out.u[span] += (
            _shaped(own, out.u[span].shape, key) / np.broadcast_to(system.units, system.n)[span]
        )


def _by_quantity(answer: Answer, out: Weights, what: str, value: Any, i: int, part: slice) -> None:
    kin, local = answer.kin, answer.local
    m, t = part.stop - part.start, kin.tangents
    shape = {"slip": (m, t), "tangential_force": (m, t), "force": (kin.normal.shape[1],)}.get(
        what, (m,)
    )
    w, heir = _shaped(value, shape, what), kin.heir[part]
    if what == "gap":
        np.add.at(out.gap, heir, w)
    elif what == "normal_force":
        out.normal_force[part] += w
    elif what == "pressure":
        area = kin.area[heir]
        w = np.divide(w, area, out=np.zeros(m), where=area > 0)
        np.add.at(out.normal_force, heir, w)
        pressure = np.divide(local.normal_force[heir], area, out=np.zeros(m), where=area > 0)
        np.add.at(out.area, heir, -w * pressure)
    elif what == "slip":
        _check_slip(answer, i)
        own = np.zeros((m, t))
        np.add.at(own, heir - part.start, w)
        out.slip[part] += _back(kin, own, kin.duals, part)
    elif what == "tangential_force":
        out.friction[part] -= _back(kin, w, kin.axes, part)
    else:  # force = sum of lambda n - tau . axes
        out.normal_force[part] += kin.normal[part] @ w
        out.friction[part] -= kin.axes[part] @ w
        out.axes[0][part] += local.normal_force[part, None] * w
        out.axes[1][part] -= local.tangential_force[part, :, None] * w


def _back(kin: Any, weights: Array, basis: Array, part: slice) -> Array:
    """`Kinematics.slip_along` and `friction_along` transposed."""
    if kin.scaled is None:
        return weights
    return np.asarray(np.einsum("il,ikd,ild->ik", weights, basis[part], kin.tangent[part]))


def _shaped(value: Any, shape: tuple[int, ...], what: str) -> Array:
    found = numbers(value, f"the derivative by {what}", f"give an array of shape {shape}")
    if found.shape != shape:
        raise InputError(f"the derivative by {what} has shape {found.shape}, not {shape}")
    return found
