"""The hold of bodies at an answer, and springs that hold them while one is looked for."""

from __future__ import annotations

from functools import cached_property
from operator import mul

import numpy as np
from scipy.linalg import qr

from skfem_contact.arrays import Array, Mask, largest, lengths
from skfem_contact.conditions.friction_rule import resisting_slips
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.motions import BARELY, RigidMotions, null_space
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import COMPUTED, GIVEN, SOLVED
from skfem_contact.history.load_step import Attempt
from skfem_contact.history.thresholds import ACROSS, TINY, TURNED
from skfem_contact.problem.model import LinearModel
from skfem_contact.records import dataclass


@dataclass(eq=False)
class Grip:
    """The hold of the bodies at an answer: points that carry a force, and friction.

    Attributes
    ----------
    motions : RigidMotions
        Those that supports leave free, as the pairing of the answer sees them.
    attempt : Attempt
    carrying : ndarray of bool, shape (m,)
        Points with more than round-off of a force, glued ones too.
    stick : ndarray of bool, shape (m,)
        Of these the ones that friction or glue holds, also where it grows with the slip.
    largest : float
        Largest normal force, or what is round-off of the loads where nothing presses [force].
    firmly : float
        What holds a motion, see `RigidMotions.free`.
    """

    motions: RigidMotions
    attempt: Attempt
    carrying: Mask
    stick: Mask
    largest: float
    firmly: float

    @classmethod
    def of(cls, model: LinearModel, attempt: Attempt) -> Grip:
        """Say that of an attempt."""
        motions, state = attempt.problem.motions, attempt.local
        if attempt.model is not model:  # there DOFs are held that nothing holds
            motions = model.motions.seen_by(attempt.problem.kin)
        most = largest(np.abs(state.normal_force))
        floor = max(SOLVED * most, COMPUTED * force_terms(model, attempt.case))
        carrying = (state.status != OPEN) & (state.normal_force > floor)
        carrying |= motions.kin.never_opens
        stick = carrying & model.interface.slipping & (state.status == STICK)
        slips = carrying & (state.status == SLIP)
        if np.count_nonzero(slips):
            stick |= resisting_slips(model.interface.laws, state, slips)
        firmly = TURNED if model.geometry.follows else SOLVED
        return cls(motions, attempt, carrying, stick, max(most, floor, TINY), firmly)

    @cached_property
    def idles(self) -> bool:
        """Whether an answer rests on points that carry nothing: some motion is held by nothing else.

        A point holds a motion by the work of its force: one that hardly moves on it and hardly carries
        anything (a point of an arc, that a body has rolled to by several widths) holds by round-off.
        """
        motions, carrying, stick = self.motions, self.carrying, self.stick
        share = self.attempt.local.normal_force / self.largest
        share[motions.kin.bilateral] = 1.0
        enough = motions.held(carrying, stick, self.firmly)
        if enough and motions.held(carrying * share**2, stick, GIVEN):
            return False
        rows, across = motions.rows(carrying, stick), self._across()
        if null_space(np.concatenate([rows, across]), self.firmly).shape[1]:
            return True
        rows[: np.count_nonzero(carrying)] *= share[carrying, None]
        return null_space(np.concatenate([rows, across]), GIVEN).shape[1] > 0

    def _across(self, full: Mask | None = None) -> Array:
        """Rows (r, k) by which friction at its bound holds motions across its direction.

        At carrying points that slip, and at sticking ones whose friction is at its bound too, `full`.
        In space it turns with the slip, and so resists what turns it. How stiffly falls with the square
        of the angle between the motion and the friction, and with the way that has been slid.
        """
        motions, local = self.motions, self.attempt.local
        if motions.kin.tangents < 2:
            return np.zeros((0, motions.k))
        at = self.carrying & (local.status == SLIP) & np.any(local.tangential_force != 0, axis=1)
        if full is not None:
            at |= full
        friction = local.tangential_force[at]
        d = friction / lengths(friction)[:, None]
        slip = motions.tangential[at]
        left = slip - d[:, :, None] * np.einsum("pt,ptk->pk", d, slip)[:, None]
        return ACROSS * left.reshape(-1, motions.k)

    def adrift(self, interface: Interface) -> tuple[str, ...]:
        """Sentences on bodies whose place an answer does not decide, and that were not settled.

        A point that sticks with friction at its bound holds nothing: it may as well slip on, while
        others that slipped do so less, and all forces stay. On which of them the body comes to rest is
        a matter of the iterations. So it is where forces are round-off and contact slides far. A
        body that has slid over many of its lengths has round-off of that motion in its forces.
        """
        motions, state, full = self.motions, self.attempt.local, np.zeros(len(self.stick), dtype=bool)
        if np.count_nonzero(self.stick) and state.tangential_force.size:
            friction = lengths(state.tangential_force)
            full = self.stick & interface.frictional & (friction > 0) & (state.status == STICK)
            bound = self.attempt.friction_bound
            moved = max(self.attempt.model.stiffest) * largest(np.abs(state.slip))
            full &= friction >= (1 - SOLVED) * bound - COMPUTED * moved
        if not (np.count_nonzero(full) or self.idles):  # all that sticks holds, and that is enough
            return ()
        free = motions.free(self.carrying, self.stick & ~full, more=self._across(full))
        if not free.shape[1]:
            return ()
        if free.shape[1] == 1 and full.any():  # all of them have to slip against their friction at once
            slip = (motions.tangential[full] @ free)[..., 0]
            work = np.einsum("pt,pt->p", slip, state.tangential_force[full])
            if np.min(work) < 0 < np.max(work):
                return ()
        return motions.indifferent(free, BARELY)


def force_terms(model: LinearModel, case: LoadCase) -> float:
    """The largest load, or product of stiffness and prescribed displacement [force]."""
    return max(case.largest_force, *map(mul, model.stiffest, model.moves(case)))


def weak_springs(model: LinearModel, weak: float) -> Array:
    """Springs on all DOFs of bodies with free motions, together `weak` of their stiffness, (n,)."""
    springs = np.zeros(model.system.n)
    moves = np.any(model.motions.modes != 0, axis=1)
    for body, stiffest in zip(model.system.bodies, model.stiffest, strict=True):
        part = model.system.slice(body)
        if moves[part].any():
            springs[part] = weak * stiffest / body.n
    return springs


def pins(model: LinearModel, free: Array) -> Array:
    """Springs on as many single DOFs as there are motions (k, j) to hold, (n,)."""
    U = model.motions.modes @ free
    chosen = qr(U.T, mode="economic", pivoting=True)[2][: U.shape[1]]
    springs = np.zeros(len(U))
    diagonal = np.concatenate(model.diagonals)
    springs[chosen] = diagonal[chosen]
    return springs
