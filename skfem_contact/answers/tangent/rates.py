r"""From changes of a load step to those of its answer, backwards, and to one side of a kink.

What a step hands on to the next are slips, friction forces, the slips that points closed at, for the
energy that friction takes its bounds, and the stretch of bolts. So the derivative of a history goes
from step to step with these five (`HANDED_ON`), and that of a number by all that happened before comes
back with theirs.

A step is a row of linear maps at each point with one linear solve among them: `_before` and `_after`
it. Forwards they are taken one after the other, and backwards transposed, from the last to the first;
the solve has the factor of its own points in both directions. Displacements inside the bodies follow by
reciprocity: contact forces move a body by ``U p``, and ``U'g`` are the gaps and slips that g as a load
makes; so ``g . u`` depends on p by those.

At a kink (`Tangent.kinks`) points are about to change, and which way they go follows from the change
itself: rates of gaps g and pressures, of slips and of friction, are complementary as gaps and pressures
themselves are. So each of these points is in one of few states, with which the tangent is that of any
other answer:

* open, ``p = 0`` while ``g >= 0``, or closed, ``g = 0`` while ``lambda >= 0``;
* at its bound, friction having the direction d: it sticks while ``d . tau`` grows no more than the
  bound, or slips on along d; across d it sticks either way, as a slip has to begin along d;
* touching, with no friction yet: with Coulomb's law for the rates, in any direction, linearised as the
  return map is; and where it has slid in this step already, friction against that slip.

States are changed all at once, and one at a time once they repeat, until none contradicts.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import block_diag, issparse

from skfem_contact.answers.tangent.tangent import Slopes, Tangent, Values, add, mapped_slopes
from skfem_contact.arrays import Array, lengths, size_of, unit_vectors
from skfem_contact.conditions.friction_rule import Derivatives
from skfem_contact.digits import NEWTON_STEPS, SOLVED
from skfem_contact.errors import InputError, NotConverged

TINY = np.finfo(float).tiny
HANDED_ON = "slip", "friction", "reference", "bound", "stretch"
#: What is added to a name, and the name of what that is a multiple of: by a block at each point, by a
#: number at each or at all, or by a sparse matrix.
Maps = list[tuple[str, str, Any]]
#: Derivatives of an answer by name, and what finds those of displacements, (n,).
Rates = tuple[Values, Callable[[], Array]]


def _before(tangent: Tangent) -> Maps:
    """What loads and conditions of a linear solve follow from.

    What bodies bear, friction of the law, and what came before.
    """
    slopes = tangent.slopes
    maps = [("f", "borne", -1.0), ("anchor", "last slip", 1.0), ("offset", "mapped", slopes.by_map)]
    if np.count_nonzero(slopes.by_trial):
        maps.append(("offset", "last friction", slopes.by_trial))
    if not tangent.rule.steady:
        maps += [("offset", "last slip", slopes.by_slip), ("offset", "last reference", -slopes.by_slip)]
    if bolts := tangent.bolts:
        maps += [("tension", "borne", bolts.slides), ("drive", "tension", tangent.by_pull)]
        maps += [("drive", "last stretch", 1.0 * tangent.locked), ("f", "drive", -bolts.pulls.T)]
    return maps


def _after(tangent: Tangent, lost: bool) -> Maps:
    """What follows from gaps, slips and forces; the energy lost has the mean of two bounds."""
    shut = tangent.closed.astype(float)[:, None]
    maps: Maps = [
        ("reference", "slip", 1.0 - shut),
        ("reference", "last reference", shut),
        ("slipped", "slip", 1.0),
        ("slipped", "reference", -1.0),
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
    if bolts := tangent.bolts:
        maps += [("pull", "u", bolts.pulls), ("tension", "pull", 1.0), ("stretch", "drive", 1.0)]
        maps += [("stretch", "pull", tangent.by_pull), ("tension", "stretch", bolts.k)]
    return maps


def take(maps: Maps, values: Values, back: bool = False) -> Values:
    """Take maps one after the other; or, `back`, their transposes from the last to the first.

    What comes of them is added to the values, which are returned.
    """
    for out, of, block in reversed(maps) if back else maps:
        to, by = (of, out) if back else (out, of)
        if (own := values.get(by)) is None:
            continue
        kind = getattr(block, "ndim", 0)
        if kind == 3 and block.size != len(block):
            add(values, to, np.einsum("ikl,ik->il" if back else "ikl,il->ik", block, own))
        elif not issparse(block):
            add(values, to, (block[:, 0] if kind == 3 else block) * own)
        else:
            add(values, to, (block.T if back else block) @ own)
    return values


def forward(tangent: Tangent, change: Values, last: Values) -> Rates:
    """Derivatives of an answer by a number.

    Parameters
    ----------
    tangent : Tangent
    change : dict of ndarray
        What the number changes of the load step, see `changes.change`.
    last : dict of ndarray
        Values of the answer before, of which those `HANDED_ON` count; none if it does not depend on the
        number.
    """
    values = change | {f"last {name}": last[name] for name in HANDED_ON if name in last}
    recover = cache(tangent.solved(take(_before(tangent), values)))
    if tangent.bolts:
        values["u"] = recover()
    return take(_after(tangent, True), values), recover


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
    duals = {key: np.add(weights.get(key, 0.0), after.get(key, 0.0)) for key in {**weights, **after}}
    take(_after(tangent, "lost" in duals), duals, back=True)
    recover = tangent.solved(duals, back=True)
    if loads or tangent.bolts:
        duals["f"] = recover()
        duals["x"] = _by_supports(tangent, duals)
    take(_before(tangent), duals, back=True)
    return duals, {name[5:]: own for name, own in duals.items() if name.startswith("last ")}


def _by_supports(tangent: Tangent, duals: Values) -> Array:
    """Derivatives of a number by prescribed displacements (n,), from those by all else."""
    answer, kin = tangent.answer, tangent.answer.kin
    x = duals.get("u", 0.0) - block_diag(answer.stiffness, format="csr") @ duals["f"]
    x += kin.B_n.T @ np.where(kin.paired, duals["gap0"][:, 0], 0.0)
    x += kin.B_t.T @ duals["slip0"].ravel()
    return np.where(np.isin(np.arange(len(x)), answer.system.D), x, 0.0)


class Verge:
    """The points of a tangent that are about to change to one side, and their states.

    Raises
    ------
    InputError
        Bounds of friction at the kink change with the slip.
    """

    def __init__(self, tangent: Tangent, change: Values, last: Values) -> None:
        self.tangent, self.change, self.last = tangent, change, last
        answer, local, resistance = tangent.answer, tangent.local, tangent.problem.resistance
        there, changes = tangent.problem.compliance, tangent.margin <= SOLVED
        has_slip = np.all(there.tangential_rows >= 0, axis=1)
        self.rubs = rubs = changes & answer.model.interface.frictional & has_slip
        self.touches = changes & (tangent.margins[0] <= SOLVED) & (there.normal_rows >= 0)
        if rubs.any() and not tangent.rule.steady:
            words = "side: bounds of friction that change with the slip have no one-sided derivatives"
            raise InputError(f"{words}. Take Coulomb or Tresca, or a load a little off the kink.")
        self.slope = tangent.rule.slope(local.normal_force, local.slip)
        slid = tangent.slid & rubs
        self.open, self.slips = self.touches & ~tangent.closed, slid.copy()
        self.decides = rubs & ~slid  # whether it sticks
        self.turns = self.decides & self.touches  # has no direction of friction yet
        toward = np.where(slid[:, None], answer.plastic_slip, local.tangential_force)
        self.direction, stiffness = unit_vectors(toward), answer.tangential_stiffness[:, None]
        self.give = 1.0 / stiffness  # a finite stiffness gives back a part of the slip
        # with exact sticking any stiffness does, see `tangent`
        self.exact = np.isinf(stiffness)
        own = np.where(self.exact, resistance.tangential[:, None], stiffness)
        self.stiffness = np.where(rubs[:, None], own, 0.0)
        self.hardness = np.where(self.touches, resistance.normal, 0.0)
        bound = change["bound"][:, 0] if "bound" in change else 0.0
        self.bound, self.least = np.where(self.turns, 0.0, bound), np.zeros(2)
        self._read(forward(tangent, change, last)[0])

    def rates(self) -> Rates:
        """Change states until none contradicts: all, and the last alone once they repeat (Murty).

        Raises
        ------
        NotConverged
            No statuses fit.
        """
        seen, whole = set[bytes](), True
        for _ in range(NEWTON_STEPS * len(self.tangent.kinks)):  # directions are found in a handful
            rates = self._solved()
            self._read(rates[0])
            key = self.open.tobytes() + self.slips.tobytes()
            whole = whole and key not in seen
            if not self._change(whole):
                return rates
            seen.add(key)
        raise NotConverged("no statuses of the points with a kink fit the change to this side", None)

    def _solved(self) -> Rates:
        """Rates with the states that the points have."""
        change, tangent, slips, way = dict(self.change), self.tangent, self.slips, self.direction
        sticks, exact = self.rubs & ~(slips | self.open), self.exact[:, 0]
        # what decides is held across its direction, and by the return map where that turns
        bound = self.slope * np.maximum(self.normal_force, 0.0)
        size = np.maximum(np.maximum(lengths(self.trial), bound), TINY)
        turn = np.minimum(np.where(self.turns, bound / size, 1.0 * self.decides), 1.0 - SOLVED)
        J = turn[:, None, None] * (np.eye(way.shape[1]) - way[:, :, None] * way[:, None])
        by = Derivatives(J, self.slope[:, None] * way, 0.0 * J)
        new = mapped_slopes(by, slips, sticks & ~exact, self.stiffness, self.exact, way)
        pairs = zip(new, tangent.slopes, strict=True)
        slopes = Slopes(*(np.where(self.rubs[(...,) + (None,) * (a.ndim - 1)], a, b) for a, b in pairs))
        closed = np.where(self.touches, ~self.open, tangent.closed)
        stick = np.where(self.rubs, sticks & exact, tangent.stick) & closed
        if "bound" in change:
            mapped = np.where(self.rubs[:, None], self.bound[:, None] * way, change["mapped"])
            change |= {"bound": change["bound"] * closed[:, None], "mapped": mapped}
        return forward(tangent.holding(closed, stick, slopes), change, self.last)

    def _read(self, values: Values) -> None:
        """What the points do, and what of it is more than round-off."""
        self.gap = np.where(self.touches, values["gap"][:, 0], 0.0)
        self.normal_force, friction = values["normal_force"][:, 0], values["friction"]
        since = values["slip"] - self.last.get("slip", 0.0)
        # trial forces of a stiffness of each point, with what a finite one gives back of the slip
        given_back = self.give * (friction - self.last.get("friction", 0.0))
        self.trial = friction + self.stiffness * (since - given_back)
        kinds = ("normal_force", "friction"), ("gap", "slip")
        sizes = [max(size_of(values[name][np.isfinite(values[name])]) for name in own) for own in kinds]
        self.least = np.maximum(self.least, SOLVED * np.array(sizes))

    def _change(self, whole: bool) -> bool:
        """Other states of the points, by their rates; return whether there are any.

        Within round-off states stay as they are.
        """
        force, way = self.least
        pressed, trial = self.normal_force - self.hardness * self.gap, self.trial
        little = force + self.hardness * way
        open_ = self.touches & (pressed < np.where(self.open, little, -little))
        little = force + self.stiffness[:, 0] * way
        size = np.where(self.turns, lengths(trial), np.sum(trial * self.direction, axis=1))
        beyond = size - self.slope * self.normal_force - self.bound
        slips = np.where(self.decides, beyond > np.where(self.slips, -little, little), True)
        slips = slips & self.rubs & ~open_
        new = np.flatnonzero((open_ != self.open) | (slips != self.slips))
        new = new if whole else new[-1:]
        self.open[new], self.slips[new] = open_[new], slips[new]
        last, turns = self.direction, self.turns & self.slips
        self.direction = np.where(turns[:, None], unit_vectors(trial), last)
        turned = np.any(lengths(self.direction - last) > SOLVED)
        return bool(turned) or len(new) > 0
