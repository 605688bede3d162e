"""Derivatives of answers as users ask for them: of one answer, of a history, and those that they give.

`Sensitivity` has all derivatives of a result by one number. Those of a history by any number of
parameters go backwards, `gradient`: the history is solved, the user's function says how its number
depends on each result, and from the last result to the first every step takes one more solve with its
own conditions, transposed. Forwards, `jacobian`: one such solve for every parameter and step, for any
number of values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import issparse

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.tangent.changes import LOADS, Parameter, change, contracted, parameters
from skfem_contact.answers.tangent.rates import Maps, Rates, Verge, backward, forward, take
from skfem_contact.answers.tangent.tangent import Tangent, Values, add
from skfem_contact.arguments import Named, NamesAttributes, check_kind, number, numbers, shown
from skfem_contact.arrays import Array, Index
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.problem.seam import Workspace
from skfem_contact.records import dataclass

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


class Sensitivity(NamesAttributes):
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

    def __init__(self, by: Parameter, side: int, answer: Answer, rates: Rates) -> None:
        self.by, self.side, self._answer = by, side, answer
        self._sign, (self._values, self._recover) = -1.0 if side < 0 else 1.0, rates

    @property
    def u(self) -> Array:
        """The derivatives of the displacements of all bodies, shape (n,)."""
        return self._sign * self._recover() / self._answer.system.units

    @property
    def bolts(self) -> dict[str, BoltRates]:
        """The derivatives of the forces and stretches of bolts, by name."""
        values, names = self._values, self._answer.bolt_names
        known = [(self._sign * values[name]).tolist() for name in ("tension", "stretch") if names]
        return {name: BoltRates(*own) for name, *own in zip(names, *known, strict=True)}

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
        maps, at, shape = _quantity(self._answer, quantity, contact)
        found = self._sign * take(maps, dict(self._values))[ASKED][at]
        found = found.sum(axis=0) if quantity in SUMS else found
        return found.reshape(shape) if shape else float(found[0])

    gap: Array = _its("gap", "The derivatives of the gaps of the only contact, (m,).")
    normal_force: Array = _its("normal_force", "The derivatives of the normal forces, (m,).")
    pressure: Array = _its("pressure", "The derivatives of the pressures, (m,).")
    slip: Array = _its("slip", "The derivatives of the slips, (m, d-1).")
    tangential_force: Array = _its("tangential_force", "The derivatives of friction, (m, d-1).")
    force: Array = _its("force", "The derivatives of the resultant on the secondary, (d,).")
    dissipation: float = _its("dissipation", "The derivative of the energy lost in the step.")

    def dot(self, weights: Mapping[str, Any]) -> float:
        """Derivative of a function of the result, given as for `ContactSolver.gradient`."""
        found = weights_of(self._answer, weights)
        values = self._values | ({"u": self._recover()} if "u" in found else {})
        return self._sign * sum(float(np.sum(w * values.get(name, 0.0))) for name, w in found.items())


def sensitivity(tangent: Tangent, by: Any, after: Sensitivity | None, side: int) -> Sensitivity:
    """Derivatives of an answer; see `ContactResult.sensitivity`."""
    by, *more = parameters(by, many=False)
    if more:
        raise InputError("sensitivity(by) is by one parameter; gradient(..., by=[...]) by several")
    if after is not None:
        check_kind(after, Sensitivity, "after", "give result.sensitivity(...) of the step before")
    if side not in (-1, 0, 1):
        raise InputError(f"side = {shown(side)}; it may be 1, -1, or 0 for the statuses that hold")
    if after is not None and not (_same(after.by, by) and after.side == side):
        words = f"after is by {after.by!r}, side {after.side}; here by {by!r}, side {side}"
        raise InputError(f"{words}: give the sensitivity of the step before by the same parameter")
    sign, last = -1.0 if side < 0 else 1.0, {} if after is None else after._values
    found = {name: sign * own for name, own in change(by, tangent).items()}
    at_kink = side and len(tangent.kinks)
    rates = Verge(tangent, found, last).rates() if at_kink else forward(tangent, found, last)
    return Sensitivity(by, side, tangent.answer, rates)


def _same(one: Parameter, other: Parameter) -> bool:
    """Whether two parameters are one: what is printed of them leaves scenes and long arrays out."""
    a, b, same = one.along, other.along, (repr(one), one.between) == (repr(other), other.between)
    # matrices stay sparse: what is printed has their shape
    return same and (not (a != b).nnz if issparse(a) else np.array_equal(a, b))


# -- histories ------------------------------------------------------------------------------------

#: Solves the load steps, for results.
History = Callable[[], Iterable[Any]]
#: What a user asks of the results: a value, or several, and derivatives by each result.
Asked = Callable[[list[Any]], Any]


@dataclass(eq=False)
class Gradient(NamesAttributes):
    """A number that follows from a history, and its derivatives: of `ContactSolver.gradient`.

    Attributes
    ----------
    value : float
    by : tuple of Parameter
    parts : list
        The derivative by each of `by`: a number or the array of a field, and of what is another
        parameter in each step the array of these, steps first.
    results : list of ContactResult
        The history.

    Examples
    --------
    >>> import numpy as np
    >>> found = Gradient(1.0, (), [2.0, np.array([3.0, 4.0])], [])
    >>> found.vector
    array([2., 3., 4.])
    """

    value: float
    by: tuple[Parameter, ...]
    parts: list[Any]
    results: list[Any]

    @property
    def vector(self) -> Array:
        """All derivatives one after the other, as optimisers take them."""
        return np.concatenate([np.ravel(part) for part in self.parts])


@dataclass(eq=False)
class Jacobian(NamesAttributes):
    """Values that follow from a history, and their derivatives: of `ContactSolver.jacobian`.

    Attributes
    ----------
    values : ndarray, shape (r,)
    matrix : ndarray, shape (r, p)
        As `scipy.optimize.least_squares` takes it from ``jac``.
    by : tuple of Parameter
    results : list of ContactResult

    Examples
    --------
    Two values that depend on one of two parameters:

    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> by = sc.answers.Parameter("gap"), sc.answers.Parameter("load")
    >>> found = sc.history.Jacobian(np.zeros(2), np.array([[1.0, 0.0], [2.0, 0.0]]), by, [])
    >>> found.rank, found.words[:48]
    (1, "The values do not depend on Parameter('load'). S")
    """

    values: Array
    matrix: Array
    by: tuple[Parameter, ...]
    results: list[Any]

    @property
    def rank(self) -> int:
        """Return how many combinations of the parameters the values tell."""
        size = np.linalg.norm(self.matrix, axis=0)
        s = np.linalg.svd(self.matrix / np.where(size > 0, size, 1.0), compute_uv=False)
        return int(np.sum(s > SOLVED * s.max(initial=0.0)))

    @property
    def words(self) -> str:
        """Say what the values do not tell, in words; empty where they tell every parameter."""
        told = np.any(self.matrix != 0, axis=0)
        slips = any(np.any(values.status == 2) for result in self.results for values in result)
        said = [f"The values do not depend on {self.by[i]!r}." for i in np.flatnonzero(~told)]
        if not slips and any(by.kind == "friction" for by in self.by):
            said.append("No point slips in this history.")
        if alike := int(told.sum()) - self.rank:
            said.append(f"{alike} combinations of the other parameters have no effect on them.")
        if said:
            said.append("Start where they do, measure something else, or leave parameters out.")
        return " ".join(said)


def _linearised(
    history: History, asked: Asked, by: tuple[Parameter, ...], recover: Any, work: Workspace
) -> tuple[list[Any], Any, list[tuple[Tangent, Any]]]:
    """A history, a user's value of it, and the tangent of each result with the derivatives by it.

    The tangents borrow the memory of the load steps for as long as `work` is open.
    """
    results = list(history())
    if not results:
        raise InputError("steps are empty: there is nothing to differentiate")
    answers = [answer_of(result) for result in results]
    for answer, after in pairwise(answers):
        # a step on the same pairing began with what this one ended with, along the same tangents
        begin, state = after.before, answer.state
        if begin is not None and begin.status is state.status and after.kin is answer.kin:
            vars(answer)["local"] = begin
    tangents = [Tangent(answer, work) for answer in answers]
    if any(p.kind in ("stiffness", "scene") for p in by):
        recover(results)
    given = asked(results)
    try:
        value, derivatives = given
        return results, value, list(zip(tangents, derivatives, strict=True))
    except (TypeError, ValueError):
        words = f"the function gave {shown(given)}; it has to return (value, derivatives), these a dict"
        each = f"for each of {len(results)} results, in a list, None where it does not depend on it"
        raise InputError(f"{words} {each}") from None


def gradient(history: History, objective: Asked, by: Any, recover: Any) -> Gradient:
    """See `ContactSolver.gradient`."""
    by = parameters(by, many=True)
    loads, parts, after = any(p.kind in LOADS for p in by), list[list[Any]](), Values()
    with Workspace() as work:
        results, value, given = _linearised(history, objective, by, recover, work)
        with single_threaded:
            for tangent, own in reversed(given):
                duals, after = backward(tangent, weights_of(tangent.answer, own), after, loads)
                parts.insert(0, [contracted(p, tangent, duals) for p in by])
    each = zip(by, zip(*parts, strict=True), strict=True)
    found = [np.array(own) if p.each_step else sum(own) for p, own in each]
    value = number(value, "value of the objective", "several values are for solver.jacobian")
    return Gradient(value, by, found, results)


def jacobian(history: History, observe: Asked, by: Any, side: int, recover: Any) -> Jacobian:
    """See `ContactSolver.jacobian`."""
    by = parameters(by, many=False)
    with Workspace() as work:
        results, values, given = _linearised(history, observe, by, recover, work)
        values = np.ravel(numbers(values, "values of observe", "give a vector"))
        matrix = np.zeros((len(values), len(by)))
        for j, p in enumerate(by):
            known: Sensitivity | None = None
            for tangent, own in given:
                known = sensitivity(tangent, p, known, side)
                for i, weights in _rows(own, len(values)):
                    matrix[i, j] += known.dot(weights)
    return Jacobian(values, matrix, by, results)


def _rows(given: Any, count: int) -> list[tuple[int, Any]]:
    """The values that depend on a result, each with its derivatives."""
    given = {} if given is None else given
    if not isinstance(given, dict) or not all(key in range(count) for key in given):
        words = f"derivatives of observe are {shown(given)}; give for each result a dict by the number"
        raise InputError(f"{words} of the value, 0 to {count - 1}: {{3: {{'force': (1.0, 0.0)}}}}")
    return list(given.items())


# -- quantities -----------------------------------------------------------------------------------


def _quantity(answer: Answer, what: str, contact: Any) -> tuple[Maps, At, tuple[int, ...]]:
    """A quantity of a contact as maps of values at points, which points have it, and its shape.

    Of a resultant each point has its share.
    """
    if what not in AT_CONTACT:
        there = ", ".join([*AT_CONTACT, *ELSEWHERE])
        raise InputError(f"no quantity is named {what!r}; there are {there}")
    if contact is None and len(answer.names) != 1 and what != "dissipation":
        raise InputError(f"{what}: there are several contacts; name one of {', '.join(answer.names)}")
    i = 0 if contact is None else Named(answer.contacts, answer.names, "contacts").index_of(contact)
    kin, local = answer.kin, answer.local
    part = answer.model.interface.point_slices[i]
    heir: At = kin.heir[part] if kin.inherits else part
    m, t, d = part.stop - part.start, kin.tangents, kin.normal.shape[1]
    if what == "dissipation":
        if not all(law.steady for _, law in answer.model.interface.laws):
            words = "dissipation has derivatives with Coulomb, OrthotropicCoulomb and Tresca: bounds of"
            raise InputError(
                f"{words} other laws may change with the slip. Leave dissipation out of it."
            )
        return [(ASKED, "lost", 1.0)], slice(None) if contact is None else part, ()
    if what in ("gap", "normal_force"):
        return [(ASKED, what, 1.0)], heir if what == "gap" else part, (m,)
    normal_force = local.normal_force[:, None]
    if what == "pressure":
        per = kin.per_area[:, None]
        return [(ASKED, "normal_force", per), (ASKED, "area", -(per**2) * normal_force)], heir, (m,)
    if what == "slip":
        if not answer.model.interface.slipping[part].any():
            words = f"slip of contact {answer.names[i]!r}: without friction it is no unknown"
            raise InputError(f"{words}. Take the displacements of the bodies.")
        turned = 1.0 if kin.scaled is None else np.einsum("ikd,ild->ilk", kin.duals, kin.tangent)
        return [(ASKED, "slipped", turned)], heir, (m, t)
    if what == "tangential_force":
        turned = 1.0 if kin.scaled is None else np.einsum("ikd,ild->ilk", kin.axes, kin.tangent)
        return [(ASKED, "friction", -turned)], part, (m, t)
    by_axes = -np.einsum("it,de->idte", local.tangential_force, np.eye(d)).reshape(kin.m, d, -1)
    maps: Maps = [(ASKED, "normal_force", kin.normal[:, :, None]), (ASKED, "normal", normal_force)]
    maps += [(ASKED, "friction", -kin.axes.swapaxes(1, 2)), (ASKED, "axes", by_axes)]
    return maps, part, (d,)  # force = sum of lambda n - tau . axes


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
            if not named and what in ELSEWHERE:
                ELSEWHERE[what](found, answer, own)
                continue
            maps, at, shape = _quantity(answer, what, key if named else None)
            own = _shaped(own, shape, what)
            own = own if what in SUMS else own.reshape(shape[0], -1)
            found[ASKED] = np.zeros((answer.kin.m, own.shape[-1] if own.shape else 1))
            if isinstance(at, slice):
                found[ASKED][at] = own
            else:
                np.add.at(found[ASKED], at, own)
            take(maps, found, back=True)
            del found[ASKED]
    return found


def _by_bolts(found: Values, answer: Answer, given: Any) -> None:
    names, parts = answer.bolt_names, {"force": "tension", "stretch": "stretch"}
    for name, own in given.items() if isinstance(given, Mapping) else [(given, {})]:
        if name not in names or not isinstance(own, Mapping) or not set(own) <= set(parts):
            words = f"the derivative by bolts is {shown(given)}; give one by force or stretch, as"
            raise InputError(f"{words} {{'bolt 1': {{'force': 1.0}}}}. Bolts of the solver: {[*names]}")
        for what, value in own.items():
            add(found, parts[what], float(value) * (np.array(names) == name))


def _by_displacement(found: Values, answer: Answer, given: Any) -> None:
    whole = np.zeros(answer.system.n)
    for body, value in given.items() if isinstance(given, Mapping) else [(None, given)]:
        at = slice(None) if body is None else answer.system.slice(body)
        whole[at] = _shaped(value, whole[at].shape, "u" if body is None else "displacement")
    add(found, "u", whole / answer.system.units)


#: Quantities that no point of a contact has.
ELSEWHERE = {"u": _by_displacement, "displacement": _by_displacement, "bolts": _by_bolts}


def _shaped(value: Any, shape: tuple[int, ...], what: str) -> Array:
    if type(value) is np.ndarray and value.dtype == float and value.shape == shape:
        return value  # as a rule
    found = numbers(value, f"the derivative by {what}", f"give an array of shape {shape}", copy=False)
    if found.shape != shape:
        raise InputError(f"the derivative by {what} has shape {found.shape}, not {shape}")
    return found
