r"""One-sided derivatives of an answer that has a kink.

At a kink (`Tangent.kinks`) points are about to change, and which way they go follows from the change
itself: rates of gaps g and pressures, of slips and of friction, are complementary as gaps and pressures
themselves are. So each of these points is in one of few states, with which the tangent is that of any
other answer:

* open, ``p = 0`` while ``g >= 0``, or closed, ``g = 0`` while ``lambda >= 0``;
* at its bound, friction having the direction d: it sticks while ``d . tau`` grows no more than the
  bound, or slips on along d; across d it sticks either way, as a slip has to begin along d;
* touching, with no friction yet: with Coulomb's law for the rates, in any direction, linearised as the
  return map P is; and where it has slid in this step already, friction against that slip.

States are changed all at once, and one at a time once they repeat, until none contradicts.
"""

from __future__ import annotations

import numpy as np

from skfem_contact.answers.tangent.rates import Rates
from skfem_contact.answers.tangent.tangent import Slopes, Tangent, Values
from skfem_contact.answers.thresholds import MOST_CHANGES
from skfem_contact.arrays import Array, Mask, largest, lengths, unit_vectors
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError, NotConverged

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
    return Verge(tangent, found, last).rates() if len(tangent.kinks) else Rates(tangent, found, last)


class Verge:
    """The points of a tangent that are about to change, and their states."""

    def __init__(self, tangent: Tangent, change: Values, last: Values) -> None:
        self.tangent, self.change, self.last = tangent, change, last
        self.at = at = tangent.kinks
        compliance, local = tangent.problem.compliance, tangent.local
        has_slip = np.all(compliance.tangential_rows[at] >= 0, axis=1)
        self.rubs = tangent.answer.model.interface.frictional[at] & has_slip & (local.slip.shape[1] > 0)
        self.touches = tangent.touching[at] & (compliance.normal_rows[at] >= 0)
        if self.rubs.any() and not tangent.rule.steady:
            raise InputError(
                "side: bounds of friction that change with the slip have no one-sided derivatives. "
                "Take Coulomb, OrthotropicCoulomb or Tresca, or move the load a little off the kink."
            )
        still, stiffness = np.zeros(local.slip.shape), tangent.answer.tangential_stiffness[at]
        self.slope = tangent.rule.slope(np.maximum(local.normal_force, 0.0), local.slip)[at]
        slid, way = tangent.slid[at] & self.rubs, unit_vectors(tangent.answer.plastic_slip[at])
        self.direction = np.where(slid[:, None], way, unit_vectors(local.tangential_force[at]))
        self.open, self.slips = self.touches & ~tangent.closed[at], slid
        self.decides = self.rubs & ~slid  # whether it sticks
        self.turns = self.decides & self.touches  # has no direction of friction yet
        # with exact sticking any stiffness does, see `tangent`
        self.exact, own = np.isinf(stiffness), tangent.problem.resistance.tangential[at]
        self.stiffness = np.where(self.exact, own, stiffness)[:, None]
        self.give = 1.0 / stiffness[:, None]  # a finite one gives back a part of the slip
        self.start = last.get("slip", still)[at] - self.give * last.get("friction", still)[at]
        bound = change["bound"][at] if "bound" in change else np.zeros((len(at), 1))
        self.bound = np.where(self.turns[:, None], 0.0, bound)
        self.gap, self.normal_force = np.zeros((2, len(at)))
        self.friction, self.moved = np.zeros((2, *still[at].shape))
        self.least = np.zeros(2)

    def rates(self) -> Rates:
        """Change states until none contradicts: all, and the last alone once they repeat (Murty)."""
        seen, whole = set[bytes](), True
        for _ in range(MOST_CHANGES * len(self.at)):
            rates = self._solved()
            wanted, turned = np.flatnonzero(self._contradicted()), self._turn()
            if len(wanted):
                key = self.open.tobytes() + self.slips.tobytes()
                whole = whole and key not in seen
                seen.add(key)
                self._change(wanted if whole else wanted[-1:])
            elif not turned:
                return rates
        raise NotConverged("no statuses of the points with a kink fit the change to this side", None)

    def _solved(self) -> Rates:
        """Rates with the states that the points have."""
        at, way, slips = self.at, self.direction[:, :, None], self.slips & ~self.open
        bound = self.slope * np.maximum(self.normal_force, 0.0)
        size = np.maximum(np.maximum(lengths(self.trial), bound), TINY)
        turn = np.where(self.turns, bound / size, 1.0 * self.decides)[:, None, None]
        J = turn * (np.eye(len(self.direction.T)) - way * way.swapaxes(1, 2))
        k, exact = self.stiffness[:, :, None], self.exact[:, None, None]
        # a point that slips on sticks across its direction: as far as digits tell where that is exact
        J = np.where(slips[:, None, None], J, np.eye(J.shape[1]) * ~(exact | self.open[:, None, None]))
        spring = J * np.where(exact, k / np.maximum(1.0 - turn, SOLVED), k)
        by_map = slips[:, None, None] * np.eye(J.shape[1])
        by_normal = np.where(slips, self.slope, 0.0)[:, None] * self.direction
        closed, stick = self.tangent.closed.copy(), self.tangent.stick.copy()
        closed[at] = np.where(self.touches, ~self.open, closed[at])
        stick[at] = np.where(self.rubs, self.exact & ~self.slips & ~self.open, stick[at] & closed[at])
        slopes = [own.copy() for own in self.tangent.slopes]
        new = Slopes(spring, np.where(exact, 0.0, J), 0.0 * J, by_map, by_normal, 0.0 * by_normal)
        for own, here in zip(slopes, new, strict=True):
            own[at[self.rubs]] = here[self.rubs]
        change = dict(self.change)
        if "bound" in change:
            change["bound"] = np.where(closed[:, None], change["bound"], 0.0)
            change["mapped"] = change["mapped"].copy()
            change["mapped"][at[self.rubs]] = (self.bound * self.direction)[self.rubs]
        rates = Rates(self.tangent.holding(closed, stick, Slopes(*slopes)), change, self.last)
        self._read(rates)
        return rates

    def _read(self, rates: Rates) -> None:
        """What the points do, and what of it is more than round-off."""
        values, at = rates.values, self.at
        self.gap, self.normal_force = values["gap"][at, 0], values["normal_force"][at, 0]
        self.friction = values["friction"][at]
        # with what a finite stiffness gives back, since the step before
        self.moved = values["slip"][at] - self.give * self.friction - self.start
        sizes = [
            max(largest(np.abs(own[np.isfinite(own)])) for own in (values[normal], values[along]))
            for normal, along in (("normal_force", "friction"), ("gap", "slip"))
        ]
        self.least = np.maximum(self.least, SOLVED * np.array(sizes))

    @property
    def trial(self) -> Array:
        """Trial forces that a stiffness of each point makes of its slip, (k, d-1)."""
        return np.asarray(self.friction + self.stiffness * self.moved)

    def _parts_or_meets(self) -> Mask:
        force, way = self.least
        return np.where(self.open, self.gap < -way, self.normal_force < -force) & self.touches

    def _contradicted(self) -> Mask:
        """Points whose rates contradict their state, (k,)."""
        force, way = self.least
        along = np.sum(self.friction * self.direction, axis=1)
        bound = self.slope * self.normal_force + self.bound[:, 0]
        beyond = np.where(self.turns, lengths(self.friction), along) - bound > force
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

    def _change(self, some: Array) -> None:
        """Other states of some points, by their rates; what closes slips on, as it would by itself."""
        on = np.isin(np.arange(len(self.at)), some)
        normal = self._parts_or_meets() & on
        self.open = self.open ^ normal
        self.slips = np.where(normal, self.rubs & ~self.open, self.slips ^ on)
        way = unit_vectors(np.where(normal[:, None], self.moved, self.friction))
        turns = (on & self.turns)[:, None]
        self.direction = np.where(turns, way * self.slips[:, None], self.direction)
