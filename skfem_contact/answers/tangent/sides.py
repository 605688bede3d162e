r"""One-sided derivatives of an answer that has a kink.

At a kink (`Tangent.kinks`) points are about to change, and which way they go follows from the change
itself: rates of gaps g and pressures, of slips s and of friction, are complementary as gaps and
pressures themselves are. Where all else is linear, the forces of these points, of which there are few,
follow from what they do,

    p = p0 + S v,    p = (lambda, tau),    v = (g, s),

with S from the factor of the answer, all of them held. Then each is in one of few states:

* open, ``p = 0`` while ``g >= 0``, or closed, ``g = 0`` while ``lambda >= 0``;
* at its bound, friction having the direction d: it sticks while ``d . tau`` grows no more than the
  bound, or slips on along d; across d it sticks either way, as a slip has to begin along d;
* touching, with no friction yet: with Coulomb's law for the rates, in any direction; and where it has
  slid in this step already, friction against that slip.

States are changed all at once, and one at a time once they repeat, until none contradicts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from skfem_contact.answers.tangent.rates import Rates, Way
from skfem_contact.answers.tangent.tangent import Tangent, Values
from skfem_contact.answers.thresholds import MOST_CHANGES
from skfem_contact.arrays import Array, Mask, largest, lengths, unit_vectors
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError, NotConverged
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.problem.seam import Response

TINY = np.finfo(float).tiny


def one_sided(tangent: Tangent, found: Values, last: Values, side: int) -> Rates:
    """Rates to one side, with the statuses that hold there.

    Raises
    ------
    InputError
        Bounds of friction at the kink change with the slip.
    NotConverged
        No statuses fit.
    """
    found = {name: side * own for name, own in found.items()}
    if not len(tangent.kinks):
        return Rates(tangent, found, last)
    verge = Verge(tangent, found, last)
    way = verge.way()
    if "bound" in found:
        found["bound"] = np.where(way.closed[:, None], found["bound"], 0.0)
    return Rates(verge.held, found, last, way)


class Verge:
    """The points of a tangent that are about to change, and the small problem of their rates."""

    def __init__(self, tangent: Tangent, change: Values, last: Values) -> None:
        at, interface = tangent.kinks, tangent.answer.model.interface
        compliance = tangent.problem.compliance
        has_slip = np.all(compliance.tangential_rows[at] >= 0, axis=1)
        self.rubs = interface.frictional[at] & has_slip & (tangent.answer.kin.tangents > 0)
        self.touches = tangent.touching[at] & (compliance.normal_rows[at] >= 0)
        if self.rubs.any() and not tangent.rule.steady:
            raise InputError(
                "side: bounds of friction that change with the slip have no one-sided derivatives. "
                "Take Coulomb, OrthotropicCoulomb or Tresca, or move the load a little off the kink."
            )
        still = np.zeros(tangent.local.slip.shape)
        self.at, self.held = at, tangent.holding(at, at[self.rubs])
        self.last_slip = last.get("slip", still)
        force = np.maximum(tangent.local.normal_force, 0.0)
        self.slope = tangent.rule.slope(force, tangent.local.slip)[at]
        self.bound = change["bound"][at, 0] if "bound" in change else np.zeros(len(at))
        slid = tangent.slid[at] & self.rubs
        way = unit_vectors(tangent.answer.plastic_slip[at])
        self.direction = np.where(slid[:, None], way, tangent.toward[at])
        self.open = self.touches & ~tangent.closed[at]
        self.slips = slid.copy()
        self.decides = self.rubs & ~slid  # whether it sticks
        self.turns = self.decides & self.touches  # has no direction of friction yet
        # what a point is moved by with what a finite stiffness gives back
        self.give = np.where(self.rubs, 1.0 / interface.stiffness[at], 0.0)[:, None]
        before = self.last_slip[at] - self.give * last.get("friction", still)[at]
        self.start = np.where(self.rubs[:, None], before, 0.0)
        self._factorise(Rates(self.held, change, last).response)
        self._find()

    def _factorise(self, base: Response) -> None:
        """The forces of the points from what they do, ``p0 + S v``."""
        held, k = self.held, len(self.at)
        still, t = held.conditions, held.local.slip.shape[1]
        S = np.zeros((k, 1 + t, k, 1 + t))
        moves = np.column_stack([self.touches, *[self.rubs] * t])
        with single_threaded:
            load, (zone, key) = held.problem.other_load(held.case({})), held.zone
            for i, c in zip(*np.nonzero(moves), strict=True):
                unit = np.zeros((len(held.closed), 1 + t))
                unit[self.at[i], c] = 1.0
                load.gap0 = -unit[:, 0]
                response = zone.solve(replace(still, anchor=unit[:, 1:]), load, key)
                S[:, :, i, c] = self._forces(response)
        self.S = S.reshape(k * (1 + t), -1)
        # friction resists
        self.stiffness = -np.diag(self.S).reshape(k, 1 + t)[:, 1] if t else np.zeros(k)
        held_by = np.column_stack([np.zeros(k), self.last_slip[self.at] * self.rubs[:, None]])
        self.p0 = self._forces(base).ravel() - self.S @ held_by.ravel()
        self.v, self.p = held_by, self._forces(base)
        forces = np.abs(np.column_stack([base.normal_force, base.tangential_force]))
        ways = np.column_stack([base.gap, base.slip])
        self.least = SOLVED * np.array([largest(forces), largest(ways[np.isfinite(ways)])])

    def _forces(self, response: Response) -> Array:
        """Normal forces and friction of the points, (k, d)."""
        forces = np.column_stack([response.normal_force, response.tangential_force])
        return np.asarray(forces[self.at])

    def _find(self) -> None:
        """Change states until none contradicts: all, and the last alone once they repeat (Murty)."""
        seen, whole = set[bytes](), True
        for _ in range(MOST_CHANGES * len(self.at)):
            self._solve()
            sizes = largest(np.abs(self.p)), largest(np.abs(self.v))
            self.least = np.maximum(self.least, SOLVED * np.array(sizes))
            wanted, turned = np.flatnonzero(self._contradicted()), self._turn()
            if len(wanted):
                key = self.open.tobytes() + self.slips.tobytes()
                whole = whole and key not in seen
                seen.add(key)
                self._change(wanted if whole else wanted[-1:])
            elif not turned:
                return
        raise NotConverged("no statuses of the points with a kink fit the change to this side", None)

    def _solve(self) -> None:
        """What the points do, and their forces, with the states that they have.

        Along some directions a point is held, ``H (s - s_last) = 0``, along the others its friction is
        given. In any direction it is ``L x / |x|`` with x the trial force, linearised.
        """
        (k, d), unit, way = self.v.shape, np.eye(self.v.shape[1] - 1), self.direction
        slips = self.slips & ~self.open
        decided, turns = slips & self.decides, slips & self.turns
        free = self.rubs & (self.open | ~self.decides)
        across = decided[:, None, None] * way[:, :, None] * way[:, None]
        held = np.where(free[:, None, None], 0.0, unit - across)
        bound = self.slope * np.maximum(self.p[:, 0], 0.0)
        size = np.maximum(np.maximum(lengths(self.trial), bound), TINY)
        turn = np.where(turns, bound / size, 1.0)[:, None, None]
        spring = np.where(turns, -turn[:, 0, 0] * self.stiffness, 1.0)[:, None, None] * held
        E, F, r = np.zeros((k, d, d)), np.zeros((k, d, d)), np.zeros((k, d))
        F[:, 0, 0], E[:, 0, 0] = self.open, ~self.open
        E[:, 1:, 1:], F[:, 1:, 1:] = spring, unit - turn * held - self.give[:, None] * spring
        F[:, 1:, 0] = -(self.slope * slips)[:, None] * way
        r[:, 1:] = np.einsum("ikl,il->ik", spring, self.start)
        r[:, 1:] += (self.bound * (decided & ~turns))[:, None] * way
        E, F = block_diag(*E), block_diag(*F)
        self.v = np.linalg.solve(E + F @ self.S, r.ravel() - F @ self.p0).reshape(k, d)
        self.p = (self.p0 + self.S @ self.v.ravel()).reshape(k, d)

    @property
    def trial(self) -> Array:
        """Trial forces that a stiffness of each point makes of its slip, (k, d-1)."""
        return np.asarray(self.p[:, 1:] + self.stiffness[:, None] * self.moved)

    @property
    def moved(self) -> Array:
        """Rates of the slip that is not given back, since the step before, (k, d-1)."""
        return np.asarray(self.v[:, 1:] - self.give * self.p[:, 1:] - self.start)

    def _parts_or_meets(self) -> Mask:
        force, way = self.least
        return np.where(self.open, self.v[:, 0] < -way, self.p[:, 0] < -force) & self.touches

    def _contradicted(self) -> Mask:
        """Points whose rates contradict their state, (k,)."""
        force, way = self.least
        along = np.sum(self.p[:, 1:] * self.direction, axis=1)
        bound = self.slope * self.p[:, 0] + np.where(self.turns, 0.0, self.bound)
        beyond = np.where(self.turns, lengths(self.p[:, 1:]), along) - bound > force
        back = np.sum(self.moved * self.direction, axis=1) < -way
        slides = np.where(self.slips, back, beyond) & self.decides & ~self.open
        return np.asarray(self._parts_or_meets() | slides)

    def _turn(self) -> bool:
        """Let friction be along the trial force where points slip; return whether any turned."""
        on = self.turns & self.slips & ~self.open
        way = np.where(on[:, None], unit_vectors(self.trial), self.direction)
        turned = np.any(lengths(way - self.direction) > SOLVED)
        self.direction = way
        return bool(turned)

    def _change(self, some: NDArray[np.intp]) -> None:
        """Other states of some points, by their rates; what closes slips on, as it would by itself."""
        on = np.isin(np.arange(len(self.at)), some)
        normal = self._parts_or_meets() & on
        self.open = self.open ^ normal
        self.slips = np.where(normal, self.rubs & ~self.open, self.slips ^ on)
        way = unit_vectors(np.where(normal[:, None], self.moved, self.p[:, 1:]))
        turns = (on & self.turns)[:, None]
        self.direction = np.where(turns, way * self.slips[:, None], self.direction)

    def way(self) -> Way:
        """What the points do, as `Rates` takes it."""
        slip, closed = self.last_slip.copy(), self.held.closed.copy()
        gap = np.zeros(len(slip))
        gap[self.at], closed[self.at] = self.v[:, 0], ~self.open
        slip[self.at[self.rubs]] = self.v[self.rubs, 1:]
        return Way(gap, slip, closed)
