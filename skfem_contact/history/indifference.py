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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.motions import BARELY, NEAR, NOWHERE, RigidMotions, null_space
from skfem_contact.conditions.state import OPEN, STICK, LocalState, State
from skfem_contact.conditions.statics import drives
from skfem_contact.conditions.thresholds import BALANCED, RESISTS
from skfem_contact.history.attempt import Attempt, Walk, friction_bound
from skfem_contact.history.recovery import Recovery
from skfem_contact.history.stepping import Stepper
from skfem_contact.problem.model import LinearModel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Weak springs, over the largest stiffness of a body: forces are found to six digits, and a factor of
# ten between the two is far from one.
WEAK = (1e-6, 1e-7)
# Where contact slides far and strains drive a body, to second order, weaker ones let it run off.
FIRM = (1e-3, 1e-4)
# Share of a point's force that is left with the weaker springs: 0.1 of what they make, 1 of the rest.
FALLS = 0.5
# A point force below this part of the largest is round-off and holds nothing.
NOTHING = 1e-9
# Work of point forces along a motion, over the largest force, that holds nothing: a moment arm and a
# force that are both small. Asked too often it costs a solve, and the answer of the question stands.
FAINT = 1e-7
# A force that is none whatever made it, over the terms that cancel where nothing presses.
ROUND_OFF = 1e-12
# The smallest number that is divided by.
TINY = float(np.finfo(float).tiny)
# Where contact slides far its normals turn by the strains of the surfaces: motions that points hold by
# no more than that may be free. Whether they are the reaction of the held DOFs says.
TURNED = 1e-2
# Reaction of the held DOFs over the largest point force, and what is left of the way to go over the
# largest displacement, that count as none: the digits of the contact problem with moduli 1e6 apart,
# and two more, as the way is no difference of forces.
NO_REACTION = 1e-8
ARRIVED = 1e-10
# Each round of moving the held DOFs gains the strain's digits: exact motions take two.
ROUNDS = 8
# What is found at rest moves little: no more cuts of the step than one.
FEW_CUTS = 1
# Overlap over the extent of the bodies that counts as none.
TOUCH = 1e-11


@dataclass(frozen=True, eq=False)
class Rest:
    """An answer that leaves motions free.

    Attributes
    ----------
    attempt : Attempt
    walk : Walk
    free : ndarray, shape (k, j)
        Combinations of the model's free motions that are indifferent.
    recover : Recovery
        Of its displacements.
    pull : float
        What it takes to hold the bodies there, over the largest point force: no answer if there is any.
    why : str
        Why a body stands where it stands.
    """

    attempt: Attempt
    walk: Walk
    free: Array
    recover: Recovery
    pull: float = 0.0
    why: str = NOWHERE


@dataclass(frozen=True, eq=False)
class Grip:
    """What holds the bodies at an answer: points that carry a force, and friction.

    Attributes
    ----------
    motions : RigidMotions
        Those that supports leave free, as the pairing of the answer sees them.
    state : LocalState
    carrying : ndarray of bool, shape (m,)
        Points with more than round-off of a force, glued ones too.
    stick : ndarray of bool, shape (m,)
        Of these the ones that friction or glue holds.
    largest : float
        Largest normal force, or what is round-off of the loads where nothing presses [force].
    firmly : float
        What holds a motion, see `RigidMotions.free`.
    """

    motions: RigidMotions
    state: LocalState
    carrying: Mask
    stick: Mask
    largest: float
    firmly: float

    @classmethod
    def of(cls, model: LinearModel, attempt: Attempt, interface: Interface) -> Grip:
        """That of an attempt."""
        motions, state = attempt.problem.motions, attempt.local
        if attempt.model is not model:  # there DOFs are held that nothing holds
            motions = model.motions.seen_by(attempt.problem.kin)
        largest = float(np.max(np.abs(state.normal_force), initial=0.0))
        floor = max(NOTHING * largest, ROUND_OFF * force_terms(model, attempt.case))
        carrying = (state.status != OPEN) & (state.normal_force > floor)
        carrying |= motions.kin.tied & motions.kin.paired
        stick = carrying & interface.slipping & (state.status == STICK)
        firmly = TURNED if model.geometry.follows else RESISTS
        return cls(motions, state, carrying, stick, max(largest, floor, TINY), firmly)

    @cached_property
    def idles(self) -> bool:
        """Whether an answer rests on points that carry nothing: some motion is held by nothing else.

        A point holds a motion by the work of its force: one that hardly moves on it and hardly carries
        anything (a point of an arc, that a body has rolled to by several widths) holds by round-off.
        """
        motions, carrying = self.motions, self.carrying
        if motions.free(carrying, self.stick, self.firmly).shape[1]:
            return True
        tied = motions.kin.tied & motions.kin.paired
        share = np.where(tied, 1.0, self.state.normal_force / self.largest)
        rows = [share[carrying, None] * motions.normal[carrying]]
        if self.stick.any():
            rows.append(motions.tangential[self.stick].reshape(-1, motions.k))
        return null_space(np.concatenate(rows), FAINT).shape[1] > 0

    def adrift(self, interface: Interface) -> tuple[str, ...]:
        """Sentences on bodies whose place an answer does not decide, and that were not settled.

        A point that sticks with friction at its bound holds nothing: it may as well slip on, while
        others that slipped do so less, and all forces stay. On which of them the body comes to rest is
        a matter of the iterations. So it is where forces are round-off and contact slides far.
        """
        motions, state, full = self.motions, self.state, np.zeros_like(self.stick)
        if state.tangential_force.size:
            friction = np.linalg.norm(state.tangential_force, axis=1)
            bound = np.where(interface.frictional, friction_bound(interface, state), np.inf)
            full = self.stick & (friction >= (1 - NOTHING) * bound) & (friction > 0)
        if not (full.any() or self.idles):  # all that sticks holds, and that is enough
            return ()
        free = motions.free(self.carrying, self.stick & ~full)
        if not free.shape[1]:
            return ()
        if free.shape[1] == 1 and full.any():  # all of them have to slip against their friction at once
            slip = (motions.tangential[full] @ free)[..., 0]
            work = np.einsum("pt,pt->p", slip, state.tangential_force[full])
            if np.min(work) < 0 < np.max(work):
                return ()
        return motions.indifferent(free, BARELY)


@dataclass(eq=False)
class Indifference:
    """Finds the answers of one solver that leave motions free.

    Parameters
    ----------
    model : LinearModel
    stepper : Stepper
        That of the model.
    """

    model: LinearModel
    stepper: Stepper

    def settle(self, walk: Walk, target: LoadCase, u_last: Array, last: bool) -> Rest | None:
        """The answer to a load of which nothing else came; None where there is none to be found.

        Parameters
        ----------
        walk : Walk
            At the state and the load before.
        target : LoadCase
        u_last : ndarray, shape (n,)
            Displacements of the last result [length].
        last : bool
            Whether smaller steps have failed as well: only then, where contact slides far, firmer
            springs are asked, which may find another answer than the way of small steps leads to.
        """
        rest = self._settle(WEAK, walk, target, u_last)
        if rest is None and last and self.stepper.geometry.follows:
            rest = self._settle(FIRM, walk, target, u_last)
        return rest

    def _settle(
        self, weak: tuple[float, float], walk: Walk, target: LoadCase, u_last: Array
    ) -> Rest | None:
        soft = self._soft(weak, walk, target, u_last)
        if soft is None:
            return None
        carrying, known, motions = soft
        slipping, follows = self.stepper.interface.slipping, self.stepper.geometry.follows
        near = (TURNED, TURNED) if follows else (RESISTS, BALANCED)
        free = motions.free(carrying, carrying & slipping, near[0])
        if free.shape[1] == 0:  # what the springs found is held by what carries: no more is needed
            attempt, way = self._advance(self.model, None, walk, target, known)
            return Rest(attempt, way, free, Recovery.of(attempt)) if attempt.good else None
        if drives(motions, target.f, free, near[1]):
            return None
        if follows and not carrying.any():
            # what friction may hold on its way is not let go elsewhere
            held = self.stepper.interface.frictional.any() and walk.state.normal_force.any()
            return None if held else self._park(walk, target, u_last, free)
        if follows:
            return self._lead(walk, target, u_last, known, free)
        barred = motions.kin.paired & ~carrying & self._moved(motions, free)
        twin = self.model.with_springs(pins(self.model, free))
        attempt, way = self._advance(twin, barred, walk, target, known)
        return nearest_place(motions, free, barred, attempt, way, u_last) if attempt.good else None

    def _lead(
        self, walk: Walk, target: LoadCase, u_last: Array, known: State, free: Array
    ) -> Rest | None:
        """Hold single DOFs and lead them to where the nodes move least; None if none is found.

        Where contact slides far a motion takes the points elsewhere, and every place is solved for.
        Just where points change their partners no place may be that of its own answer: then the nearest
        of those that were solved for, and that takes no force, will do.
        """
        springs = pins(self.model, free)
        twin, held = self.model.with_springs(springs), springs > 0
        Q = np.linalg.qr(self.model.motions.modes @ free)[0]
        centre, floor = u_last, ROUND_OFF * force_terms(self.model, target)
        best: Rest | None = None
        nearest_left = np.inf
        for _ in range(ROUNDS):
            attempt, way = self._pulled(twin, springs * centre, walk, target, known)
            if not attempt.good:
                return None
            recover = Recovery.of(attempt)
            u = recover()
            left = Q @ (Q.T @ (u_last - u))
            reaction = np.max(np.abs(springs * (centre - u))[held])
            largest = np.max(np.abs(attempt.local.normal_force), initial=0.0)
            if reaction > max(TURNED * largest, floor):  # no strain's doing
                return None
            pull = float(reaction / largest) if reaction > max(NO_REACTION * largest, floor) else 0.0
            there = replace(attempt, case=target, seen=replace(attempt.seen, f=target.f))
            rest, away = Rest(there, way, free, recover, pull), float(np.max(np.abs(left)))
            if away <= ARRIVED * np.max(np.abs(u)):
                return best if pull and best else rest
            if pull == 0.0 and away < nearest_left:
                best, nearest_left = replace(rest, why=NEAR), away
            centre, known = centre + left, attempt.state
        return best

    def _park(self, walk: Walk, target: LoadCase, u_last: Array, free: Array) -> Rest | None:
        """The place where no bodies overlap and no force acts that is nearest; None if none is found.

        Where contact slides far the gaps are those of the pairing at a place: the nearest one is looked
        for with the gaps linear in the motion, as by `nearest_place`, and again with the pairing
        that is met there. That nothing overlaps where nothing presses is an equilibrium, however it
        was found.
        """
        springs = pins(self.model, free)
        twin, everywhere = self.model.with_springs(springs), np.ones(self.model.kin.m, dtype=bool)
        Q, R = np.linalg.qr(self.model.motions.modes @ free)
        centre = u_last
        for _ in range(ROUNDS):
            attempt, way = self._pulled(twin, springs * centre, walk, target, None, everywhere)
            if not attempt.good:
                return None
            recover = Recovery.of(attempt)
            u, gap = recover(), attempt.local.gap
            seen = np.isfinite(gap)
            normal = self.model.motions.seen_by(attempt.problem.kin).normal[seen]
            A = np.linalg.solve(R.T, (normal @ free).T).T
            y = nearest(A, -gap[seen], Q.T @ (u_last - u))
            if y is None:
                return None
            size = max(self.model.system.extent, np.max(np.abs(u)))
            if (
                np.min(gap[seen], initial=0.0) >= -TOUCH * size
                and np.max(np.abs(Q @ y)) <= TOUCH * size
            ):
                attempt = replace(attempt, case=target, seen=replace(attempt.seen, f=target.f))
                return Rest(attempt, way, free, recover)
            centre = centre + Q @ y
        return None

    def _moved(self, motions: RigidMotions, free: Array) -> Mask:
        """Points whose gap, or modelled slip, these motions change."""
        moved = np.any(np.abs(motions.normal @ free) > NOTHING, axis=1)
        if self.stepper.interface.frictional.any():
            slides = np.any(np.abs(motions.tangential @ free) > NOTHING, axis=(1, 2))
            moved |= slides & self.stepper.interface.frictional
        return np.asarray(moved)

    def _soft(
        self, pair: tuple[float, float], walk: Walk, target: LoadCase, u_last: Array
    ) -> tuple[Mask, State, RigidMotions] | None:
        """Points that carry forces, the state on weak springs that found them, the motions there."""
        forces: list[Array] = []
        known: State | None = None
        for weak in pair:
            springs = weak_springs(self.model, weak)
            twin = self.model.with_springs(springs)
            attempt, _ = self._pulled(twin, springs * u_last, walk, target, known)
            if not attempt.good:
                return None
            known = attempt.state
            forces.append(np.where(known.status != OPEN, known.normal_force, 0.0))
        floor = ROUND_OFF * max(np.max(np.abs(forces)), force_terms(self.model, target))
        carrying = forces[1] > np.maximum(FALLS * forces[0], floor)
        kin = attempt.problem.kin
        motions = self.model.motions.seen_by(kin)  # those of the springs' own model are held
        tied = self.stepper.interface.tied & kin.paired
        return None if known is None else (carrying | tied, known, motions)

    def _pulled(
        self,
        model: LinearModel,
        pull: Array,
        walk: Walk,
        target: LoadCase,
        known: State | None,
        barred: Mask | None = None,
    ) -> tuple[Attempt, Walk]:
        """Advance under the load and the pull of springs that are moved, (n,)."""
        before = replace(walk, case=replace(walk.case, f=walk.case.f + pull))
        return self._advance(model, barred, before, replace(target, f=target.f + pull), known)

    def _advance(
        self, model: LinearModel, barred: Mask | None, walk: Walk, target: LoadCase, known: State | None
    ) -> tuple[Attempt, Walk]:
        options = self.stepper.options
        if self.stepper.geometry.follows:  # a body that is driven runs off on weak springs, cut by cut
            options = replace(options, max_cuts=min(options.max_cuts, FEW_CUTS))
        stepper = replace(self.stepper, model=model, barred=barred, options=options)
        return stepper.advance(walk.state, walk.case, target, known, None)


def force_terms(model: LinearModel, case: LoadCase) -> float:
    """The largest load, or product of stiffness and prescribed displacement [force]."""
    largest = case.largest_force
    system = model.system
    for start, body, stiffest in zip(system.offsets[:-1], system.bodies, model.stiffest, strict=True):
        moved = np.max(np.abs(case.x[start + body.D]), initial=0.0)
        largest = max(largest, stiffest * float(moved))
    return largest


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


def nearest_place(
    motions: RigidMotions, free: Array, barred: Mask, attempt: Attempt, walk: Walk, u_last: Array
) -> Rest | None:
    """Move an answer along its free motions to where it has moved least; None if bodies overlap.

    Parameters
    ----------
    motions : RigidMotions
    free : ndarray, shape (k, j)
    barred : ndarray of bool, shape (m,)
        Points without force that these motions open and close.
    attempt : Attempt
    walk : Walk
    u_last : ndarray, shape (n,)
        Displacements from which movement counts [length].
    """
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
    if np.min(gap[open_], initial=0.0) < -TOUCH * max(motions.system.extent, np.max(np.abs(u_last))):
        return None
    local, shift = attempt.local, Q @ y
    slip = local.slip
    if slip.size and motions.kin.tangents:
        moved = (motions.kin.B_t @ shift).reshape(slip.shape)
        slip = np.where(barred[:, None], slip + moved, slip)
    reference = np.where(barred[:, None], slip, local.reference)
    local = replace(local, slip=slip, reference=reference, gap=gap)
    return Rest(replace(attempt, local=local), walk, free, Recovery.of(attempt, shift))


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
    from scipy.optimize import nnls  # half of scipy's import time, for a rare question

    E = np.vstack([A.T, h / scale])
    target = np.zeros(len(E))
    target[-1] = 1.0
    r = E @ nnls(E, target)[0] - target
    if not abs(r[-1]) > 1e-12:
        return None
    return np.asarray(wanted - scale * r[:-1] / r[-1])
