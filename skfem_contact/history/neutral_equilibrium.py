r"""Bodies that nothing loads: their place is indifferent, the forces are not.

A body without net load may stand anywhere in a gap, and a block on a smooth floor anywhere along it:
equilibrium leaves a motion free against which neither a load nor a contact force works. The forces
are the same at each of these places. They are found in three steps, each only where it is needed:

1. Weak springs on all nodes of bodies that supports do not hold; twice, one set ten times weaker. Point
   forces that the springs alone have made fall with them, the others stay: these *carry*.
2. Motions that carrying points leave free are indifferent. As many single DOFs are held as there are
   such motions, a support without reaction, the points that these motions open and close are left
   out, and the step is solved: exact forces, and deformations up to the free motion.
   Where contact slides far, points may meet others at another place: there single DOFs are held and
   led, by solving again, to where the nodes have moved the least, and it counts only if the hold
   carries nothing. A motion that is driven by strains alone, to second order, is refused.
3. Of all places without overlap the one is taken from which the nodes have moved the least, in the
   mean square, since the last result: a least-distance problem in the few free motions (Lawson and
   Hanson, Solving Least Squares Problems, 1974, chapter 23).
"""

from __future__ import annotations

from dataclasses import replace
from operator import mul

import numpy as np

from skfem_contact.arrays import Array, Mask, size_of
from skfem_contact.conditions.motions import NEAR, NOWHERE, RigidMotions, drives
from skfem_contact.conditions.state import OPEN, State
from skfem_contact.digits import COMPUTED, NEWTON_STEPS, SINGLE, SOLVED
from skfem_contact.history.load_step import Advance, Attempt, LoadStep, Recovery
from skfem_contact.history.stepper import TURNED, Stepper, pins
from skfem_contact.history.stepping import advance
from skfem_contact.linalg.dense_factors import nonnegative_least_squares
from skfem_contact.problem.model import LinearModel
from skfem_contact.records import dataclass

# Weak springs, over the largest stiffness of a body: forces are found to six digits, and a factor of
# ten between the two is far from one.
WEAK = (1e-6, 1e-7)

# Where contact slides far and strains drive a body, to second order, weaker ones let it run off.
FIRM = (1e-3, 1e-4)

# Share of a point's force that is left with the weaker springs: 0.1 of what they make, 1 of the rest.
FALLS = 0.5


@dataclass(frozen=True, eq=False)
class Rest:
    """An answer that leaves motions free.

    Attributes
    ----------
    advance : Advance
    free : ndarray, shape (k, j)
        Combinations of the model's free motions that are indifferent.
    recover : Recovery
        Of its displacements.
    pull : float
        What it takes to hold the bodies there, over the largest point force: no answer if there is any.
    why : str
        Why a body stands where it stands.
    """

    advance: Advance
    free: Array
    recover: Recovery
    pull: float = 0.0
    why: str = NOWHERE


def nearest_place(
    motions: RigidMotions, free: Array, barred: Mask, advance: Advance, u_last: Array
) -> Rest | None:
    """Move an answer along its free motions to where it has moved least; None if bodies overlap.

    Parameters
    ----------
    motions : RigidMotions
    free : ndarray, shape (k, j)
    barred : ndarray of bool, shape (m,)
        Points without force that these motions open and close.
    advance : Advance
        That has arrived, which is moved.
    u_last : ndarray, shape (n,)
        Displacements from which movement counts [length].
    """
    attempt = advance.attempt
    u = Recovery.of(attempt)()
    # motions of unit size in the mean square: the distance is that of their coefficients
    Q, R = np.linalg.qr(motions.modes @ free)
    open_ = barred & np.isfinite(attempt.local.gap)
    A = np.linalg.solve(R.T, (motions.normal[open_] @ free).T).T
    wanted = Q.T @ (u_last - u)
    y = nearest(A, -attempt.local.gap[open_], wanted)
    if y is None:
        return None
    gap = attempt.local.gap.copy()
    gap[open_] += A @ y
    if np.min(gap[open_], initial=0.0) < -SOLVED * max(motions.system.extent, np.max(np.abs(u_last))):
        return None
    local, shift = attempt.local, Q @ y
    slip = local.slip
    if slip.size and motions.kin.tangents:
        moved = (motions.kin.B_t @ shift).reshape(slip.shape)
        slip = np.where(barred[:, None], slip + moved, slip)
    reference = np.where(barred[:, None], slip, local.reference)
    local = replace(local, slip=slip, reference=reference, gap=gap)
    advance.attempt = replace(attempt, local=local)
    return Rest(advance, free, Recovery.of(attempt, shift))


def nearest(A: Array, b: Array, wanted: Array) -> Array | None:
    """The point nearest to the one wanted with ``A y >= b``; None where there is none.

    Examples
    --------
    >>> nearest(np.array([[1.0, 0.0]]), np.array([2.0]), np.array([0.0, 3.0]))
    array([2., 3.])
    """
    h = b - A @ wanted
    scale = float(np.max(h, initial=0.0))
    if scale <= 0.0:  # the place that is wanted is free
        return wanted
    E = np.vstack([A.T, h / scale])
    target = np.zeros(len(E))
    target[-1] = 1.0
    r = E @ nonnegative_least_squares(E, target) - target
    if not abs(r[-1]) > COMPUTED:
        return None
    return np.asarray(wanted - scale * r[:-1] / r[-1])


@dataclass(frozen=True, eq=False)
class NeutralEquilibrium:
    """A load step whose answer may leave motions free.

    Parameters
    ----------
    stepper : Stepper
    step : LoadStep
    u_last : ndarray, shape (n,)
        Displacements of the last result, from which movement counts [length].
    """

    stepper: Stepper
    step: LoadStep
    u_last: Array

    @property
    def model(self) -> LinearModel:
        """The bodies without springs."""
        return self.stepper.model

    @property
    def terms(self) -> float:
        """The largest load, or product of stiffness and prescribed displacement [force]."""
        model, case = self.model, self.step.target
        return max(size_of(case.f), *map(mul, model.stiffest, model.moves(case)))

    def settle(self, last: bool) -> Rest | None:
        """The answer to a load of which nothing else came; None where there is none to be found.

        Parameters
        ----------
        last : bool
            Whether smaller steps have failed as well: only then, where contact slides far, firmer
            springs are asked, which may find another answer than the way of small steps leads to.
        """
        rest = self._settle(WEAK)
        if rest is None and last and self.model.geometry.follows:
            rest = self._settle(FIRM)
        return rest

    def _settle(self, weak: tuple[float, float]) -> Rest | None:
        soft = self._soft(weak)
        if soft is None:
            return None
        carrying, known, motions = soft
        interface, follows = self.model.interface, self.model.geometry.follows
        near = TURNED if follows else SOLVED
        free = motions.free(carrying, carrying & interface.slipping, near)
        if free.shape[1] == 0:  # what the springs found is held by what carries: no more is needed
            way = self._advance(self.model, self.step, known)
            return Rest(way, free, Recovery.of(way.attempt)) if way.attempt.good else None
        if drives(motions, self.step.target.f, free, near):
            return None
        if follows and not carrying.any():
            # what friction may hold on its way is not let go elsewhere
            held = interface.frictional.any() and self.step.state.normal_force.any()
            return None if held else self._park(free)
        if follows:
            return self._lead(known, free)
        barred = motions.kin.paired & ~carrying & self._moved(motions, free)
        twin = self.model.with_springs(pins(self.model, free))
        way = self._advance(twin, self.step, known, barred)
        return nearest_place(motions, free, barred, way, self.u_last) if way.attempt.good else None

    def _lead(self, known: State, free: Array) -> Rest | None:
        """Hold single DOFs and lead them to where the nodes move least; None if none is found.

        Where contact slides far a motion takes the points elsewhere, and every place is solved for.
        Just where points change their partners no place may be that of its own answer: then the nearest
        of those that were solved for, and that takes no force, will do.
        """
        springs = pins(self.model, free)
        twin, held = self.model.with_springs(springs), springs > 0
        Q = np.linalg.qr(self.model.motions.modes @ free)[0]
        centre, floor = self.u_last, COMPUTED * self.terms
        best: Rest | None = None
        nearest_left = np.inf
        for _ in range(NEWTON_STEPS):
            way = self._pulled(twin, springs * centre, known)
            attempt = way.attempt
            if not attempt.good:
                return None
            recover = Recovery.of(attempt)
            u = recover()
            left = Q @ (Q.T @ (self.u_last - u))
            reaction = np.max(np.abs(springs * (centre - u))[held])
            largest = np.max(np.abs(attempt.local.normal_force), initial=0.0)
            if reaction > max(TURNED * largest, floor):  # no strain's doing
                return None
            pull = float(reaction / largest) if reaction > max(SINGLE * largest, floor) else 0.0
            way.attempt = self._without_pull(attempt)
            rest, away = Rest(way, free, recover, pull), float(np.max(np.abs(left)))
            if away <= SOLVED * np.max(np.abs(u)):
                return best if pull and best else rest
            if pull == 0.0 and away < nearest_left:
                best, nearest_left = replace(rest, why=NEAR), away
            centre, known = centre + left, attempt.state
        return best

    def _park(self, free: Array) -> Rest | None:
        """The place where no bodies overlap and no force acts that is nearest; None if none is found.

        Where contact slides far the gaps are those of the pairing at a place: the nearest one is looked
        for with the gaps linear in the motion, as by `nearest_place`, and again with the pairing
        that is met there. That nothing overlaps where nothing presses is an equilibrium, however it
        was found.
        """
        springs = pins(self.model, free)
        twin, everywhere = self.model.with_springs(springs), np.ones(self.model.kin.m, dtype=bool)
        Q, R = np.linalg.qr(self.model.motions.modes @ free)
        centre = self.u_last
        for _ in range(NEWTON_STEPS):
            way = self._pulled(twin, springs * centre, None, everywhere)
            attempt = way.attempt
            if not attempt.good:
                return None
            recover = Recovery.of(attempt)
            u, gap = recover(), attempt.local.gap
            seen = np.isfinite(gap)
            normal = self.model.motions.seen_by(attempt.problem.kin).normal[seen]
            A = np.linalg.solve(R.T, (normal @ free).T).T
            y = nearest(A, -gap[seen], Q.T @ (self.u_last - u))
            if y is None:
                return None
            size = max(self.model.system.extent, np.max(np.abs(u)))
            if (
                np.min(gap[seen], initial=0.0) >= -SOLVED * size
                and np.max(np.abs(Q @ y)) <= SOLVED * size
            ):
                way.attempt = self._without_pull(attempt)
                return Rest(way, free, recover)
            centre = centre + Q @ y
        return None

    def _moved(self, motions: RigidMotions, free: Array) -> Mask:
        """Points whose gap, or modelled slip, these motions change."""
        frictional = self.model.interface.frictional
        moved = np.any(np.abs(motions.normal @ free) > SOLVED, axis=1)
        if frictional.any():
            slides = np.any(np.abs(motions.tangential @ free) > SOLVED, axis=(1, 2))
            moved |= slides & frictional
        return np.asarray(moved)

    def _soft(self, pair: tuple[float, float]) -> tuple[Mask, State, RigidMotions] | None:
        """Points that carry forces, the state on weak springs that found them, the motions there."""
        forces: list[Array] = []
        known: State | None = None
        for weak in pair:
            springs = weak_springs(self.model, weak)
            twin = self.model.with_springs(springs)
            attempt = self._pulled(twin, springs * self.u_last, known).attempt
            if not attempt.good:
                return None
            known = attempt.state
            forces.append(np.where(known.status != OPEN, known.normal_force, 0.0))
        floor = COMPUTED * max(np.max(np.abs(forces)), self.terms)
        carrying = forces[1] > np.maximum(FALLS * forces[0], floor)
        kin = attempt.problem.kin
        motions = self.model.motions.seen_by(kin)  # those of the springs' own model are held
        held = self.model.interface.bilateral & kin.paired
        return None if known is None else (carrying | held, known, motions)

    def _pulled(
        self, model: LinearModel, pull: Array, known: State | None, barred: Mask | None = None
    ) -> Advance:
        """Advance under the load and the pull of springs that are moved, (n,)."""
        before, target = self.step.before, self.step.target
        pulled = replace(
            self.step,
            before=replace(before, f=before.f + pull),
            target=replace(target, f=target.f + pull),
        )
        return self._advance(model, pulled, known, barred)

    def _without_pull(self, attempt: Attempt) -> Attempt:
        """An attempt that springs have not pulled in the end, under the load itself."""
        target = self.step.target
        return replace(attempt, case=target, seen=replace(attempt.seen, f=target.f))

    def _advance(
        self, model: LinearModel, step: LoadStep, known: State | None, barred: Mask | None = None
    ) -> Advance:
        options = self.stepper.options
        if model.geometry.follows:  # a body that is driven runs off on weak springs, cut by cut
            options = replace(options, max_cuts=0)
        stepper = replace(self.stepper, model=model, barred=barred, options=options)
        return advance(stepper, replace(step, known=known, callback=None))


def weak_springs(model: LinearModel, weak: float) -> Array:
    """Springs on all DOFs of bodies with free motions, together `weak` of their stiffness, (n,)."""
    springs = np.zeros(model.system.n)
    moves = np.any(model.motions.modes != 0, axis=1)
    for body, stiffest in zip(model.system.bodies, model.stiffest, strict=True):
        part = model.system.slice(body)
        if moves[part].any():
            springs[part] = weak * stiffest / body.n
    return springs
