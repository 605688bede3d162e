"""Derivatives of a whole history: backwards for one number, forwards for many.

Backwards: the history is solved, the user's function says how its number depends on each result, and
from the last result to the first every step takes one more solve with its own conditions, transposed.
That gives the derivatives by any number of parameters. Forwards: one such solve for every parameter and
step, for any number of values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any

import numpy as np

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.answers.tangent.changes import LOADS, Parameter, contracted, parameters
from skfem_contact.answers.tangent.rates import backward
from skfem_contact.answers.tangent.sensitivity import Sensitivity, sensitivity, weights_of
from skfem_contact.answers.tangent.tangent import Tangent, Values
from skfem_contact.arguments import numbers, shown
from skfem_contact.arrays import Array
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.history.load_step import recover_all
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.problem.zone import Zones
from skfem_contact.records import dataclass

History = Callable[[], Iterable[ContactResult]]


@dataclass(eq=False)
class Gradient:
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
    results: list[ContactResult]

    @property
    def vector(self) -> Array:
        """All derivatives one after the other, as optimisers take them."""
        return np.concatenate([np.ravel(part) for part in self.parts])


@dataclass(eq=False)
class Jacobian:
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
    results: list[ContactResult]

    @property
    def rank(self) -> int:
        """Return how many combinations of the parameters the values tell."""
        size = np.linalg.norm(self.matrix, axis=0)
        s = np.linalg.svd(self.matrix / np.where(size > 0, size, 1.0), compute_uv=False)
        return int(np.sum(s > SOLVED * s.max(initial=0.0)))

    @property
    def words(self) -> str:
        """Say what the values do not tell, in words; empty where they tell every parameter."""
        told: list[bool] = np.any(self.matrix != 0, axis=0).tolist()
        slips = any(np.any(values.status == 2) for result in self.results for values in result)
        by_told = zip(self.by, told, strict=True)
        said = [f"The values do not depend on {by!r}." for by, on in by_told if not on]
        if not slips and any(by.kind == "friction" for by in self.by):
            said.append("No point slips in this history.")
        alike = sum(told) - self.rank
        if alike:
            said.append(f"{alike} combinations of the other parameters have no effect on them.")
        if said:
            said.append("Start where they do, measure something else, or leave parameters out.")
        return " ".join(said)


def _linearised(
    history: History, asked: Callable[..., Any], by: tuple[Parameter, ...], what: str
) -> tuple[list[ContactResult], list[Tangent], Any, list[Any]]:
    """A history, its tangents, a user's value of it, and the derivatives of that by each result."""
    results, zones = list(history()), dict[int, Zones]()
    if not results:
        raise InputError("steps are empty: there is nothing to differentiate")
    answers = [answer_of(result) for result in results]
    for answer, after in pairwise(answers):
        # a step on the same pairing began with what this one ended with, along the same tangents
        begin, state = after.before, answer.state
        if begin is not None and begin.status is state.status and after.kin is answer.kin:
            vars(answer)["local"] = begin
    tangents = [Tangent(answer, zones) for answer in answers]
    if any(p.kind in ("stiffness", "scene") for p in by):
        recover_all(answers)
    given = asked(results)
    try:
        value, derivatives = given
        derivatives = list(derivatives)
    except (TypeError, ValueError):
        raise InputError(
            f"{what} returned {shown(given)}; it has to return (value, derivatives), these a list with "
            "a dict for each result, None where it does not depend on it"
        ) from None
    if len(derivatives) != len(results):
        raise InputError(
            f"{what} returned {len(derivatives)} derivatives for {len(results)} results: give one dict "
            "for each result, in the order of the steps, None where nothing depends on it"
        )
    return results, tangents, value, derivatives


def gradient(history: History, objective: Callable[..., Any], by: Any) -> Gradient:
    """See `ContactSolver.gradient`."""
    by = parameters(by, many=True)
    results, tangents, value, given = _linearised(history, objective, by, "the objective")
    loads, parts, after = any(p.kind in LOADS for p in by), list[list[Any]](), Values()
    with single_threaded:
        for tangent, own in zip(reversed(tangents), reversed(given), strict=True):
            duals, after = backward(tangent, weights_of(tangent.answer, own), after, loads)
            parts.insert(0, [contracted(p, tangent, duals) for p in by])
    each = zip(by, zip(*parts, strict=True), strict=True)
    found = [np.array(own) if p.each_step else sum(own) for p, own in each]
    return Gradient(float(value), by, found, results)


def jacobian(history: History, observe: Callable[..., Any], by: Any, side: int) -> Jacobian:
    """See `ContactSolver.jacobian`."""
    by = parameters(by, many=False)
    results, tangents, values, given = _linearised(history, observe, by, "observe")
    values = numbers(values, "values of observe", "give a vector")
    matrix, rows = np.zeros((len(values), len(by))), [_rows(own, len(values)) for own in given]
    for j, p in enumerate(by):
        known: Sensitivity | None = None
        for tangent, own in zip(tangents, rows, strict=True):
            known = sensitivity(tangent, p, known, side)
            for i, weights in own:
                matrix[i, j] += known.dot(weights)
    return Jacobian(values, matrix, by, results)


def _rows(given: Any, count: int) -> list[tuple[int, Any]]:
    """The values that depend on a result, each with its derivatives."""
    given = {} if given is None else given
    if not isinstance(given, dict) or not all(key in range(count) for key in given):
        raise InputError(
            f"derivatives of observe are {shown(given)}; give for each result a dict by the number of "
            f"the value, 0 to {count - 1}: {{3: {{'force': (1.0, 0.0)}}}}"
        )
    return list(given.items())
