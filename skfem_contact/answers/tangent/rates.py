r"""From changes of a load step to those of its answer, and backwards.

What a step hands on to the next are slips, friction forces, the slips that points closed at, and, for
the energy that friction takes, its bounds. So the derivative of a history goes from step to step with
these four (`Rates`), and that of a number by all that happened before comes back with theirs (`Duals`).

In both directions a step is one linear solve with the factor of its own points. Displacements inside
the bodies follow by reciprocity: with ``u = U z + V f`` and ``h = U'f`` (z gaps and slips, h the load
on them) the derivative of ``g . u`` by f is the displacement ``U h* + V g`` under g as a load.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.changes import Change
from skfem_contact.answers.tangent.tangent import Tangent
from skfem_contact.arrays import lengths
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.errors import InputError
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.problem.response import Conditions, Load, Response, Source
from skfem_contact.records import dataclass

Array = NDArray[np.float64]


@dataclass(eq=False)
class Weights:
    """How a number depends on one answer: its derivatives by what the answer consists of.

    Attributes
    ----------
    gap, normal_force, area : ndarray, shape (m,)
    slip, friction : ndarray, shape (m, d-1)
        By the slip since points closed, and by the force that resists.
    axes : tuple of ndarray
        By normals (m, d) and tangents (m, d-1, d).
    u : ndarray, shape (n,), or None
    lost : ndarray, shape (c,)
        By the energy that friction takes at each contact in the step.
    """

    gap: Array
    normal_force: Array
    area: Array
    slip: Array
    friction: Array
    axes: tuple[Array, Array]
    u: Array | None
    lost: Array

    @classmethod
    def none(cls, answer: Answer) -> Weights:
        """Those of a number that does not depend on it."""
        m, t = answer.local.slip.shape
        still, none = np.zeros((m, t)), np.zeros(m)
        d = answer.kin.normal.shape[1]
        axes = np.zeros((m, d)), np.zeros((m, t, d))
        lost = np.zeros(len(answer.contacts))
        return cls(none, none.copy(), none.copy(), still, still.copy(), axes, None, lost)

    def directly(self, change: Change) -> float:
        """What a change makes of the number while gaps, slips and forces stay."""
        found = 0.0 if change.area is None else float(self.area @ change.area)
        if change.axes is not None:
            found += sum(float(np.vdot(a, b)) for a, b in zip(self.axes, change.axes, strict=True))
        return found


@dataclass(eq=False)
class Rates:
    """Derivatives of one answer by a number.

    Attributes
    ----------
    gap, normal_force, bound : ndarray, shape (m,)
    slip, tangential_force, reference : ndarray, shape (m, d-1)
        As of the state (`conditions.state.LocalState`): the friction is that which resists.
    lost : ndarray, shape (c,)
        Of the energy that friction takes at each contact in the step.
    """

    answer: Answer
    tangent: Tangent
    change: Change
    load: Load
    response: Response
    reference: Array
    bound: Array
    lost: Array

    @property
    def slip(self) -> Array:
        return self.response.slip

    @property
    def tangential_force(self) -> Array:
        return self.response.tangential_force

    @cached_property
    def u(self) -> Array:
        """Of the displacements of all bodies, (n,)."""
        problem = self.tangent.problem
        with single_threaded():
            source = problem.source(self.load, self.response)
            found: Array = problem.bodies.recover(
                source_column(source), [None], [case_of(self.change)]
            )[0]
        return found

    def dot(self, weights: Weights) -> float:
        """The derivative of a number that depends on the answer by these weights."""
        found = weights.directly(self.change) + float(weights.lost @ self.lost)
        found += float(weights.gap @ self.response.gap)
        found += float(weights.normal_force @ self.response.normal_force)
        found += float(np.vdot(weights.slip, self.slip - self.reference))
        found += float(np.vdot(weights.friction, self.tangential_force))
        return found if weights.u is None else found + float(weights.u @ self.u)


@dataclass(eq=False)
class Carried:
    """Derivatives of a number by what a step hands on, see `Rates`."""

    slip: Array
    tangential_force: Array
    reference: Array
    bound: Array


def source_column(source: Source) -> Source:
    """One source as `recover` takes many."""
    return replace(source, values=source.values[:, None])


def case_of(change: Change) -> LoadCase:
    """The loads of a change."""
    return LoadCase(change.f, change.x, change.gap0, change.slip0, np.zeros(len(change.gap0)), ())


def driven(tangent: Tangent, change: Change, before: Rates | None) -> Conditions:
    """The conditions of a step with what a change and the step before make of anchors and offsets."""
    slopes, offset = tangent.slopes, np.einsum("ikl,il->ik", tangent.slopes.by_map, change.friction)
    if before is None:
        return replace(tangent.conditions, offset=offset)
    offset += np.einsum("ikl,il->ik", slopes.by_trial, before.tangential_force)
    offset += np.einsum("ikl,il->ik", slopes.by_slip, before.slip - before.reference)
    return replace(tangent.conditions, offset=offset, anchor=before.slip)


def forward(tangent: Tangent, change: Change, before: Rates | None) -> Rates:
    """Derivatives of an answer by a number, from those of the answer before (None: it has none)."""
    conditions = driven(tangent, change, before)
    with single_threaded():
        load = tangent.problem.other_load(case_of(change))
        zone, key = tangent.zone
        response = zone.solve(conditions, load, key)
    return followed(tangent, change, before, load, response)


def followed(
    tangent: Tangent, change: Change, before: Rates | None, load: Load, response: Response
) -> Rates:
    """What follows from gaps, slips and forces."""
    answer, closed = tangent.answer, tangent.closed
    still = np.zeros(response.slip.shape)
    reference = np.where(closed[:, None], still if before is None else before.reference, response.slip)
    bound = tangent.bound_slope * response.normal_force + np.where(closed, change.bound, 0.0)
    way, along, G = _lost(tangent)
    moved = response.slip - (still if before is None else before.slip)
    moved = (
        moved - (response.tangential_force - (still if before is None else before.tangential_force)) / G
    )
    rate = 0.5 * (bound + (0.0 if before is None else before.bound)) * way + np.sum(
        along * moved, axis=1
    )
    lost = np.array([rate[part].sum() for part in answer.model.interface.point_slices])
    return Rates(answer, tangent, change, load, response, reference, bound, lost)


def _lost(tangent: Tangent) -> tuple[Array, Array, Array]:
    """Of the energy lost: length of the way, mean of both bounds along it, and stiffness G (m, 1)."""
    answer = tangent.answer
    interface = answer.model.interface
    way = lengths(answer.plastic_slip)
    mean = 0.5 * (tangent.bound + answer.bound_before)
    along = answer.plastic_slip * (mean / np.where(way > 0, way, 1.0))[:, None]
    return way, along, interface.stiffness[:, None]


def backward(
    tangent: Tangent, weights: Weights, after: Carried | None, loads: bool
) -> tuple[Change, Carried]:
    """Derivatives of a number by all changes of a step, and by what the step before hands on.

    Parameters
    ----------
    tangent : Tangent
    weights : Weights
        How the number depends on the answer itself.
    after : Carried or None
        How it depends on what the answer hands on.
    loads : bool
        Whether derivatives by loads and displacements are wanted, for which the interior is recovered.
    """
    answer, problem, slopes = tangent.answer, tangent.problem, tangent.slopes
    m, t = answer.local.slip.shape
    closed, is_open = tangent.closed, ~tangent.closed[:, None]
    slip, friction, bound = weights.slip, weights.friction, np.zeros(m)
    reference = -weights.slip
    if after is not None:
        slip, friction = slip + after.slip, friction + after.tangential_force
        reference, bound = reference + after.reference, after.bound
    slip = slip + np.where(is_open, reference, 0.0)
    reference = np.where(is_open, 0.0, reference)
    known, handed, along = np.zeros(m), np.zeros((m, t)), np.zeros((m, t))
    if np.count_nonzero(weights.lost):
        way, along, G = _lost(tangent)
        share = np.zeros(m)
        for part, w in zip(answer.model.interface.point_slices, weights.lost, strict=True):
            share[part] = w
        along = along * share[:, None]
        slip, friction, handed = slip + along, friction - along / G, along / G
        known = 0.5 * share * way
        bound = bound + known
    normal_force = weights.normal_force + tangent.bound_slope * bound
    u, given, z = weights.u, None, np.zeros(len(problem.compliance.W))
    if u is not None:
        f = np.array(u)
        f[answer.system.D] = 0.0
        given = problem.other_load(case_of(replace(Change.none(answer), f=f)))
        assert given.moved is not None
        z = given.moved
    zone, key = tangent.zone
    found = zone.adjoint(
        tangent.conditions, Response(weights.gap, slip, normal_force, friction, z), key
    )
    back = Carried(found.anchor - along, handed, reference, known)
    if not tangent.rule.steady:
        by_slip = np.einsum("ikl,ik->il", slopes.by_slip, found.offset)
        back.slip, back.reference = back.slip + by_slip, reference - by_slip
    if np.count_nonzero(slopes.by_trial):
        back.tangential_force = handed + np.einsum("ikl,ik->il", slopes.by_trial, found.offset)
    by_map = np.einsum("ikl,ik->il", slopes.by_map, found.offset)
    nothing = np.zeros(answer.system.n)
    out = Change(nothing, nothing, found.gap0, found.slip0, by_map, np.where(closed, bound, 0.0))
    if loads:
        out.f, out.x = _by_loads(tangent, given, out, found.load, u)
    return out, back


def _by_loads(
    tangent: Tangent, given: Load | None, found: Change, z: Array, u: Array | None
) -> tuple[Array, Array]:
    """Derivatives by loads and displacements (n,), from those by the load on gaps and slips."""
    answer, problem = tangent.answer, tangent.problem
    nothing = Change.none(answer)
    if u is not None:
        nothing.f[:] = u
        nothing.f[answer.system.D] = 0.0
    force = problem.G.T @ z
    if given is not None:
        force = force + given.prescribed
    with single_threaded():
        f = problem.bodies.recover(Source(force[:, None], True), [None], [case_of(nothing)])[0]
    kin, x, D = answer.kin, np.zeros(answer.system.n), answer.system.D
    borne = [
        K @ f[answer.system.slice(b)]
        for K, b in zip(answer.stiffness, answer.system.bodies, strict=True)
    ]
    whole = kin.B_n.T @ np.where(kin.paired, found.gap0, 0.0) - np.concatenate(borne)
    if found.slip0.size and problem.slips:
        whole = whole + kin.B_t.T @ found.slip0.ravel()
    x[D] = whole[D] if u is None else whole[D] + u[D]
    return f, x


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
