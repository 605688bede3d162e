r"""From changes of a load step to those of its answer, and backwards.

What a step hands on to the next are slips, friction forces, the slips that points closed at, for the
energy that friction takes its bounds, and the stretch of bolts. So the derivative of a history goes
from step to step with these five (`Carried`), and that of a number by all that happened before comes
back with theirs.

In both directions a step is one linear solve with the factor of its own points. Displacements inside
the bodies follow by reciprocity: contact forces move a body by ``U p``, and ``U'g`` are the gaps and
slips that g as a load makes; so ``g . u`` depends on p by those.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.changes import Change
from skfem_contact.answers.tangent.tangent import Tangent
from skfem_contact.arrays import Array, lengths
from skfem_contact.errors import InputError
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.problem.points import Duals
from skfem_contact.problem.response import Load, Response
from skfem_contact.records import dataclass


@dataclass(eq=False)
class Weights:
    """How a number depends on one answer: its derivatives by what the answer consists of.

    Attributes
    ----------
    points : dict of ndarray, shape (m, width)
        By gaps, normal forces, slips since points closed, friction that resists, areas, normals, and
        axes of the tangential components, one after the other; what it does not depend on is not there.
    u : ndarray, shape (n,), or None
    lost : ndarray, shape (c,)
        By the energy that friction takes at each contact in the step.
    tension, stretch : ndarray, shape (b,)
        By the force and the stretch of each bolt.
    """

    points: dict[str, Array]
    u: Array | None
    lost: Array
    tension: Array
    stretch: Array

    @classmethod
    def none(cls, answer: Answer) -> Weights:
        """Those of a number that does not depend on it."""
        bolts = np.zeros((2, len(answer.bolt_names)))
        return cls({}, None, np.zeros(len(answer.contacts)), *bolts)

    def by(self, name: str) -> Any:
        """By one block of numbers, zero where it is not there."""
        return self.points.get(name, 0.0)

    def at(self, points: dict[str, Array]) -> float:
        """Return what changes of these blocks of numbers make of the number."""
        return sum(
            float(np.vdot(by, points[name])) for name, by in self.points.items() if name in points
        )


@dataclass(eq=False)
class Carried:
    """Derivatives of what a step hands on, see `conditions.state.LocalState`, or by it."""

    slip: Array
    tangential_force: Array
    reference: Array
    bound: Array
    shift: Array

    @classmethod
    def none(cls, answer: Answer) -> Carried:
        """Nothing."""
        still = np.zeros(answer.local.slip.shape)
        return cls(still, still, still, np.zeros(len(still)), np.zeros(len(answer.bolt_names)))


@dataclass(eq=False)
class Rates:
    """Derivatives of one answer by a number.

    Attributes
    ----------
    carried : Carried
    lost : ndarray, shape (c,)
        Of the energy that friction takes at each contact in the step.
    """

    answer: Answer
    tangent: Tangent
    change: Change
    load: Load
    response: Response
    carried: Carried
    lost: Array

    @cached_property
    def points(self) -> dict[str, Array]:
        """Blocks of numbers as `Weights` has them."""
        found = self.response
        return self.change.shape | {
            "gap": found.gap[:, None],
            "normal_force": found.normal_force[:, None],
            "slip": found.slip - self.carried.reference,
            "friction": found.tangential_force,
        }

    @cached_property
    def u(self) -> Array:
        """Of the displacements of all bodies, (n,)."""
        source = self.tangent.problem.source(self.load, self.response)
        return self.tangent.recovered(source.values, self.change.case)

    @property
    def tension(self) -> Array:
        """Of the forces in bolts, (b,)."""
        bolts = self.tangent.bolts
        if bolts is None:
            return np.zeros(0)
        return np.asarray(bolts.P @ self.u + bolts.k * self.carried.shift + self.change.tension)

    def dot(self, weights: Weights) -> float:
        """The derivative of a number that depends on the answer by these weights."""
        found = weights.at(self.points) + float(weights.lost @ self.lost)
        found += float(weights.stretch @ self.carried.shift)
        if np.count_nonzero(weights.tension):
            found += float(weights.tension @ self.tension)
        return found if weights.u is None else found + float(weights.u @ self.u)


@dataclass(eq=False)
class Way:
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


def forward(tangent: Tangent, change: Change, before: Carried | None, way: Way | None = None) -> Rates:
    """Derivatives of an answer by a number, from those of the answer before (None: it has none)."""
    answer, last = tangent.answer, before or Carried.none(tangent.answer)
    drive = change.drive
    if bolts := tangent.bolts:
        drive = drive + np.where(bolts.kept, last.shift, 0.0)
        change = replace(change, f=change.f - bolts.P.T @ drive)
    way = way or Way(np.zeros(len(last.slip)), last.slip, tangent.closed)
    closed = way.closed
    offset = tangent.friction(change.friction, last.tangential_force, last.slip - last.reference)
    conditions = replace(tangent.conditions, offset=offset, anchor=way.slip)
    with single_threaded():
        load, (zone, key) = tangent.problem.other_load(change.case), tangent.zone
        load.gap0 = load.gap0 - way.gap
        found = zone.solve(conditions, load, key)
    found.gap = found.gap + way.gap
    reference = np.where(closed[:, None], last.reference, found.slip)
    bound = tangent.bound_slope * found.normal_force + np.where(closed, change.bound, 0.0)
    length, along, G = _lost(tangent)
    moved = found.slip - last.slip - (found.tangential_force - last.tangential_force) / G
    rate = 0.5 * (bound + last.bound) * length + np.sum(along * moved, axis=1)
    lost = np.array([rate[part].sum() for part in answer.model.interface.point_slices])
    carried = Carried(found.slip, found.tangential_force, reference, bound, drive)
    rates = Rates(answer, tangent, change, load, found, carried, lost)
    if bolts and bolts.given.any():
        carried.shift = drive - np.where(bolts.given, bolts.P @ rates.u / bolts.k, 0.0)
    return rates


def _lost(tangent: Tangent) -> tuple[Array, Array, Array]:
    """Of the energy lost: length of the way, mean of both bounds along it, and stiffness G (m, 1)."""
    way = lengths(tangent.answer.plastic_slip)
    mean = 0.5 * (tangent.bound + tangent.answer.bound_before)
    along = tangent.answer.plastic_slip * (mean / np.where(way > 0, way, 1.0))[:, None]
    return way, along, tangent.answer.model.interface.stiffness[:, None]


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
    answer, problem, bolts, by = tangent.answer, tangent.problem, tangent.bolts, weights.by
    after, closed = after or Carried.none(answer), tangent.closed
    slip, friction, bound = (
        by("slip") + after.slip,
        by("friction") + after.tangential_force,
        after.bound,
    )
    normal_force, by_bound = np.ravel(by("normal_force")), np.zeros(len(closed))
    along: Array | float = 0.0
    by_friction: Array | float = 0.0
    if np.count_nonzero(weights.lost):
        way, along, G = _lost(tangent)
        sizes = [part.stop - part.start for part in answer.model.interface.point_slices]
        share = np.repeat(weights.lost, sizes)
        along, by_bound = along * share[:, None], 0.5 * share * way
        by_friction = along / G
        slip, friction, bound = slip + along, friction - by_friction, bound + by_bound
    reference = after.reference - by("slip")
    slip = slip + np.where(closed[:, None], 0.0, reference)
    if np.count_nonzero(bound):
        normal_force = normal_force + tangent.bound_slope * bound
    forces, pulled, u = np.zeros(len(problem.compliance.W)), None, weights.u
    if bolts:
        stretch = weights.stretch + after.shift + bolts.k * weights.tension
        pull = weights.tension - np.where(bolts.given, stretch / bolts.k, 0.0)
        u = bolts.P.T @ pull + (0.0 if u is None else u)
    out = Change.none(answer, loads or u is not None)
    if u is not None:
        out.f[:] = u
        out.f[answer.system.D] = 0.0
        pulled = problem.other_load(out.case)
        forces = np.asarray(pulled.moved)
    zone, key = tangent.zone
    of = Response(np.ravel(by("gap")), slip, normal_force, friction, forces)
    found = zone.adjoint(tangent.conditions, of, key)
    out.friction, by_trial, by_slip = tangent.friction_by(found.offset)
    back = Carried(
        found.anchor - along + by_slip,
        by_friction + by_trial,
        np.where(closed[:, None], reference, 0.0) - by_slip,
        by_bound,
        np.zeros(len(weights.tension)),
    )
    if loads or bolts:
        force = problem.G.T @ found.moved + (0.0 if pulled is None else pulled.prescribed)
        out.f = tangent.recovered(force, out.case)
        out.x = _by_supports(tangent, out.f, found, u)
    out.gap0, out.slip0, out.bound = found.gap0, found.slip0, np.where(closed, bound, 0.0)
    if bolts:
        out.drive, out.tension = stretch - bolts.P @ out.f, weights.tension
        back.shift = np.where(bolts.kept, out.drive, 0.0)
    return out, back


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
