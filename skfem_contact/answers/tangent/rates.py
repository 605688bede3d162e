r"""From changes of a load step to those of its answer, and backwards.

What a step hands on to the next are slips, friction forces, the slips that points closed at, for the
energy that friction takes its bounds, and the stretch of bolts. So the derivative of a history goes
from step to step with these five (`HANDED_ON`), and that of a number by all that happened before comes
back with theirs.

A step is a row of linear maps at each point with one linear solve among them: `_before` and `_after`
it. Forwards they are taken one after the other, and backwards transposed, from the last to the first;
the solve has the factor of its own points in both directions. Displacements inside the bodies follow by
reciprocity: contact forces move a body by ``U p``, and ``U'g`` are the gaps and slips that g as a load
makes; so ``g . u`` depends on p by those.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.tangent.tangent import Tangent, Values
from skfem_contact.arrays import Array, lengths
from skfem_contact.errors import InputError
from skfem_contact.problem.points import Duals
from skfem_contact.problem.seam import Response

HANDED_ON = "slip", "friction", "reference", "bound", "stretch"
#: Of one name to be added to, and the name of what a block at each point is multiplied with.
Maps = list[tuple[str, str, NDArray[Any]]]


class Way(NamedTuple):
    """What points do whose statuses are not those of the tangent, which holds them.

    Attributes
    ----------
    gap : ndarray, shape (m,), slip : ndarray, shape (m, d-1)
        Their rates; zero, and those of the step before, at all other points.
    closed : ndarray of bool, shape (m,)
    """

    gap: Array
    slip: Array
    closed: NDArray[np.bool_]


def _before(tangent: Tangent) -> Maps:
    """What conditions of a linear solve follow from: friction of the law, and what came before."""
    slopes = tangent.slopes
    maps: Maps = [
        ("anchor", "last slip", np.ones((1, 1))),
        ("offset", "mapped", slopes.by_map),
        ("offset", "last friction", slopes.by_trial),
    ]
    if not tangent.rule.steady:
        by_slip = slopes.by_slip
        maps += [("offset", "last slip", by_slip), ("offset", "last reference", -by_slip)]
    if tangent.bolts:
        maps.append(("drive", "last stretch", 1.0 * tangent.locked))
    return maps


def _after(tangent: Tangent, closed: NDArray[np.bool_], lost: bool) -> Maps:
    """What follows from gaps, slips and forces; the energy lost has the mean of two bounds."""
    one, shut = np.ones((1, 1)), 1.0 * closed[:, None]
    maps: Maps = [
        ("reference", "slip", 1.0 - shut),
        ("reference", "last reference", shut),
        ("slipped", "slip", one),
        ("slipped", "reference", -one),
        ("bound", "normal_force", tangent.bound_slope[:, None]),
    ]
    if lost:
        plastic, G = tangent.answer.plastic_slip, tangent.answer.model.interface.stiffness
        way, mean = lengths(plastic), 0.5 * (tangent.bound + tangent.answer.bound_before)
        along = (plastic * (mean / np.where(way > 0, way, 1.0))[:, None])[:, None]
        half, given_back = 0.5 * way[:, None], along / G[:, None, None]
        maps += [("lost", "bound", half), ("lost", "last bound", half)]
        maps += [("lost", "slip", along), ("lost", "last slip", -along)]
        maps += [("lost", "friction", -given_back), ("lost", "last friction", given_back)]
    if tangent.bolts:  # those with a force that is given slide
        k, each = tangent.bolts.k, np.ones(1)
        maps += [
            ("stretch", "drive", each),
            ("stretch", "pull", np.where(tangent.tightened, -1 / k, 0.0)),
        ]
        maps += [("tension", "stretch", k), ("tension", "pull", each)]
    return maps


def _take(maps: Maps, values: Values, back: bool = False) -> None:
    """Take maps one after the other; or, `back`, their transposes from the last to the first."""
    for out, of, block in reversed(maps) if back else maps:
        to, by = (of, out) if back else (out, of)
        if by in values:
            product = "ikl,ik->il" if back else "ikl,il->ik"
            full = block.ndim == 3
            own = np.einsum(product, block, values[by]) if full else block * values[by]
            values[to] = values[to] + own if to in values else own


class Rates:
    """Derivatives of one answer by a number.

    Parameters
    ----------
    tangent : Tangent
    change : dict of ndarray
        What the number changes of the load step, see `changes.change`.
    last : dict of ndarray, optional
        What the answer before has `handed_on`; None if it does not depend on the number.
    way : Way, optional

    Attributes
    ----------
    values : dict of ndarray
        By name.
    """

    def __init__(
        self, tangent: Tangent, change: Values, last: Values | None = None, way: Way | None = None
    ) -> None:
        bolts, self.tangent = tangent.bolts, tangent
        self.values = values = change | {"last " + name: own for name, own in (last or {}).items()}
        _take(_before(tangent), values)
        if bolts and "drive" in values:
            values["f"] = values.get("f", 0.0) - bolts.pulls.T @ values["drive"]
        if way:
            values["anchor"] = way.slip
            values["gap0"] = values.get("gap0", 0.0) - way.gap[:, None]
        self._found = tangent.respond(values)
        found = self.response = self._found[-1]
        if way:
            found.gap = found.gap + way.gap
        values |= {"gap": found.gap[:, None], "normal_force": found.normal_force[:, None]}
        values |= {"slip": found.slip, "friction": found.tangential_force}
        if bolts:
            values["pull"] = bolts.pulls @ self.u
        _take(_after(tangent, way.closed if way else tangent.closed, True), values)

    @property
    def handed_on(self) -> Values:
        """What the next step begins with."""
        return {name: self.values[name] for name in HANDED_ON if name in self.values}

    @cached_property
    def u(self) -> Array:
        """Of the displacements of all bodies, (n,)."""
        return self.tangent.displacements(*self._found)

    def dot(self, weights: Values) -> float:
        """The derivative of a number that depends on the answer by these weights."""
        own = (self.u if name == "u" else self.values.get(name, 0.0) for name in weights)
        return sum(float(np.sum(w * by)) for w, by in zip(weights.values(), own, strict=True))


def backward(tangent: Tangent, weights: Values, after: Values, loads: bool) -> tuple[Values, Values]:
    """Derivatives of a number by all changes of a step, and by what the step before hands on.

    Parameters
    ----------
    tangent : Tangent
    weights : dict of ndarray
        How the number depends on the answer itself.
    after : dict of ndarray
        How it depends on what the answer hands on.
    loads : bool
        Whether derivatives by loads and displacements are wanted, for which the interior is recovered.
    """
    answer, problem, bolts = tangent.answer, tangent.problem, tangent.bolts
    (m, t), duals = answer.local.slip.shape, dict(weights)
    for name, own in after.items():
        duals[name] = duals[name] + own if name in duals else own
    if "lost" in duals:
        check_lost(tangent)
    _take(_after(tangent, tangent.closed, "lost" in duals), duals, back=True)
    if bolts and "pull" in duals:
        duals["u"] = duals.get("u", 0.0) + bolts.pulls.T @ duals["pull"]
    forces, pulled, u = np.zeros(len(problem.compliance.W)), None, duals.get("u")
    case = tangent.case({} if u is None else {"f": u})
    if u is not None:
        pulled = problem.other_load(case)
        forces = np.asarray(pulled.moved)
    gap, normal_force = (np.ravel(duals.get(name, np.zeros(m))) for name in ("gap", "normal_force"))
    slip, friction = (duals.get(name, np.zeros((m, t))) for name in ("slip", "friction"))
    zone, key = tangent.zone
    found = zone.adjoint(tangent.conditions, Response(gap, slip, normal_force, friction, forces), key)
    duals |= {"gap0": found.gap0[:, None], "slip0": found.slip0}
    duals |= {"anchor": found.anchor, "offset": found.offset}
    if loads or bolts:
        force = problem.G.T @ found.moved + (0.0 if pulled is None else pulled.prescribed)
        duals["f"] = tangent.recovered(force, case)
        duals["x"] = _by_supports(tangent, duals["f"], found, u)
    if bolts:
        duals["drive"] = duals.get("drive", 0.0) - bolts.pulls @ duals["f"]
    _take(_before(tangent), duals, back=True)
    return duals, {name[5:]: own for name, own in duals.items() if name.startswith("last ")}


def _by_supports(tangent: Tangent, f: Array, found: Duals, u: Array | None) -> Array:
    """Derivatives of a number by prescribed displacements (n,), from those by all else."""
    answer, kin = tangent.answer, tangent.answer.kin
    system, x = answer.system, np.zeros(answer.system.n)
    borne = [K @ f[system.slice(b)] for K, b in zip(answer.stiffness, system.bodies, strict=True)]
    whole = kin.B_n.T @ np.where(kin.paired, found.gap0, 0.0) - np.concatenate(borne)
    if found.slip0.size and tangent.problem.slips:
        whole = whole + kin.B_t.T @ found.slip0.ravel()
    x[system.D] = (whole if u is None else whole + u)[system.D]
    return x


def check_lost(tangent: Tangent) -> None:
    """Refuse the energy lost under laws whose bounds change with the slip.

    Raises
    ------
    InputError
    """
    if not tangent.rule.steady:
        raise InputError(
            "the energy that friction takes has derivatives with Coulomb, OrthotropicCoulomb and "
            "Tresca: bounds of other laws may change with the slip. Leave dissipation out of it."
        )
