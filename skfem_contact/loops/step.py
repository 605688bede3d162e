"""A load step as loops see it, what they are given and return, and the points that hold a body in it.

A body that only contact and friction hold makes the matrix singular while all its points are open or
all slip, even if the answer is neither: `stabilise` keeps just so many closed and sticking.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, lengths
from skfem_contact.conditions.friction_rule import BEYOND, FrictionRule
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.state import OPEN, SLIP, STICK, LocalState
from skfem_contact.digits import DECIMALS, GIVEN, ROUND_OFF, SINGLE
from skfem_contact.problem.points import Conditions, LinearProblem, Load, Resistance, Response
from skfem_contact.records import dataclass


@dataclass(eq=False)
class Step:
    """One load step as a loop sees it: a linear world, a load, the laws and the history.

    `tied` points are glued; `bilateral` ones, glued or not, never open. `far`: largest prescribed
    displacement [length].
    `noise`: forces up to this are round-off of loads and stiffness, whatever the contact forces are;
    where nothing presses it is all there is. `rank`: a number for every point that does not depend on
    the order in which bodies, contacts and nodes were given; where points have to be taken one after
    the other, or two are alike, it decides. `resistance`: of each point, as far as it is known.
    `slip_prescribed`: points with friction whose slip supports prescribe, which `frictional` leaves
    out. `slip_prescribed_along`: tangents, (m, d-1), along which supports prescribe the slip of points
    that are free along the other. Both are None where there are none.

    Points that follow from these, (m,): `exact` ones stick without any give, where they stick;
    `resisting` ones hold a motion along their tangents there; `gripped` ones hold their slip there,
    exactly by friction or glue; `modelled` ones resist and have a partner; `closed_for_good` ones never
    open, None where there are none. `turns`: there is friction along more than one tangent.
    """

    problem: LinearProblem
    load: Load
    motions: RigidMotions
    paired: Mask
    tied: Mask
    bilateral: Mask
    friction: FrictionRule
    frictional: Mask
    stiffness: Array
    last: LocalState
    rank: Index
    noise: float = 0.0
    far: float = 0.0
    resistance: Resistance | None = None
    slip_prescribed: Mask | None = None
    slip_prescribed_along: Mask | None = None
    exact: Mask = field(init=False)
    all_exact: bool = field(init=False)
    turns: bool = field(init=False)
    all_paired: bool = field(init=False)
    resisting: Mask = field(init=False)
    gripped: Mask = field(init=False)
    modelled: Mask = field(init=False)
    closed_for_good: Mask | None = field(init=False)

    def __post_init__(self) -> None:
        # nothing of it depends on what `under` changes
        self.exact = np.isinf(self.stiffness)
        self.all_exact, self.all_paired = bool(self.exact.all()), bool(self.paired.all())
        self.turns = bool(self.friction.laws) and self.last.slip.shape[1] > 1
        self.resisting = self.frictional | self.tied
        self.gripped = self.exact & self.frictional | self.tied
        self.modelled = self.paired & self.resisting
        closed = (self.bilateral | self.tied) & self.paired
        self.closed_for_good = closed if np.count_nonzero(closed) else None

    def under(self, load: Load, last: LocalState, noise: float, far: float) -> Step:
        """The same points under another load; what is known of the points by themselves is shared."""
        step = object.__new__(Step)
        friction = self.friction.since(last.reference)
        vars(step).update(vars(self), load=load, last=last, noise=noise, far=far, friction=friction)
        return step

    def trial(self, slip: Array) -> Array:
        """Elastic predictor ``tau_n + G (s - s_n)`` of points with a finite stiffness."""
        G = np.where(self.exact, 0.0, self.stiffness)[:, None]
        return self.last.tangential_force + G * (slip - self.last.slip)


@dataclass(eq=False)
class Iterate:
    """One iterate of a loop.

    Attributes
    ----------
    status : ndarray of int, shape (m,)
        The set that was solved for: 0 open, 1 stick, 2 slip.
    direction : ndarray, shape (m, d-1)
        Unit friction direction of slipping points.
    response : Response
    conditions : Conditions
        What the linear solve held every point to: at the answer its derivative is that of this solve.
    changes : int
        Points whose status or slip direction the iterate itself contradicts.
    residual : float
        Largest violation of the friction law, relative to the largest contact force.
    converged : bool
    note : str
        What the loop did besides its rule: damping, a point held, acceleration.
    held : ndarray
        Combination of rigid modes that only a held point resists, shape (k, j).
    nearer : bool
        Whether the iterate before left over less of the conditions than ever, though as many points
        changed.
    jammed : bool
        Whether forces grow without end, and no point opens or slips however large they are.
    """

    status: Index
    direction: Array
    response: Response
    conditions: Conditions
    changes: int
    residual: float
    converged: bool
    note: str = ""
    held: Array | None = None
    nearer: bool = False
    jammed: bool = False


@dataclass(eq=False)
class Guess:
    """Starting values of a loop; never part of the answer.

    `pivoted` says whether complementary pivoting found the values: work that the iterations of the loop
    do not count. `reach` is the size of the trial forces of slipping points, (m,): how firmly friction
    resists across its direction; without it, not at all [force]. `driven`: points that supports move,
    so that exact sticking gives way, (m,). `near`: the forces are nearly those of the answer: springs
    through which points are seen begin at rest under them.
    """

    status: Index
    direction: Array
    normal_force: Array
    tangential_force: Array
    slip: Array
    pivoted: bool = False
    reach: Array | None = None
    driven: Mask | None = None
    near: bool = False


@dataclass(frozen=True)
class Record:
    """One iteration: a line of the log.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> last = result.trace[-1]
    >>> last.changes, last.residual < 1e-10
    (0, True)
    """

    iteration: int
    open: int
    stick: int
    slip: int
    changes: int
    residual: float
    note: str = ""

    def __str__(self) -> str:
        return (
            f"{self.iteration:4d}  open {self.open:5d}  stick {self.stick:5d}  slip {self.slip:5d}"
            f"  changes {self.changes:5d}  law {self.residual:8.1e}  {self.note}".rstrip()
        )


# Where in a unit of the last of `DECIMALS` by which points are told apart one number begins and the
# other ends: at no fraction that meshes have. At a half it is at 2^-10, among others, and round-off
# tells equal points apart.
BETWEEN = (3 - 5**0.5) / 2


@dataclass(frozen=True, eq=False)
class Stabilised:
    """Points kept closed or sticking because a body would be free without them."""

    points: Mask
    motion: Array


def stabilise(step: Step, current: Guess, coupled: bool = True) -> tuple[Index, Stabilised | None]:
    """Keep just so many points closed and sticking that no rigid motion is free.

    A body that only contact and friction hold makes the matrix singular while all its points are
    open or all slip, even if the answer is neither. The points nearest to what is needed are kept:
    those farthest below their friction limit, then those with the smallest gap. If the answer goes
    on contradicting them, there is no equilibrium; the driver says so. Friction that grows with the
    slip holds as well where it does so within the linear solve, `coupled`.
    """
    status, motions = current.status, step.motions
    if motions.k == 0:
        return status, None
    holds = step.resisting
    springs = np.zeros(len(status), dtype=bool)
    if coupled and np.count_nonzero(rubs := (status == SLIP) & step.frictional):
        springs = rubs & step.friction.hardens(current.direction, current.normal_force, current.slip)

    def still_free() -> Array:
        closed, stick = status != OPEN, (status == STICK) & holds | springs
        return motions.free(closed, stick, SINGLE, _across(step, current, status))

    free = still_free()
    if free.shape[1] == 0:
        return status, None
    status, first = status.copy(), free
    points = np.zeros(len(status), dtype=bool)
    limit = step.friction.bound(current.normal_force, current.slip)
    excess = lengths(current.tangential_force) - limit
    # a gap is no more exact than the coordinates that it is a difference of
    known = ROUND_OFF * float(np.abs(motions.kin.points).max(initial=0.0))
    slipping = _by(excess, status == SLIP, step)
    opened = _by(step.load.gap0, status == OPEN, step, known)
    order = np.concatenate([slipping, opened])
    for i in order:
        if free.shape[1] == 0:
            break
        resists = np.abs(motions.normal[i] @ free).max(initial=0.0) > GIVEN
        slid = motions.tangential[i] @ free
        turns = holds[i] and np.sqrt((slid**2).sum(axis=0)).max(initial=0.0) > GIVEN
        if (status[i] == OPEN and resists) or turns:
            status[i] = STICK
            points[i] = True
            free = still_free()
    return status, Stabilised(points, first)


def _across(step: Step, current: Guess, status: Index) -> Array | None:
    """Rows (r, k) by which slipping points hold rigid motions, across the direction of friction."""
    if not step.turns or current.reach is None:
        return None
    at = (status == SLIP) & step.frictional & (current.reach < BEYOND)
    d = current.direction[at]
    bound = step.friction.bound(current.normal_force, current.slip)[at]
    share = bound / current.reach[at]
    firm = np.sqrt(np.minimum(share / (1 - share), 1.0))  # stiffnesses are squares of rows
    across = np.eye(d.shape[1]) - d[:, :, None] * d[:, None, :]
    return ((firm[:, None, None] * across) @ step.motions.tangential[at]).reshape(-1, step.motions.k)


def _by(value: Array, mask: Mask, step: Step, known: float = 0.0) -> Index:
    """Points from the smallest value to the largest; those alike up to round-off by their rank.

    `known`: what values are uncertain by, however small they are.
    """
    chosen = np.flatnonzero(mask & step.paired)
    largest = max(float(np.max(np.abs(value[chosen]), initial=0.0)), known * 10**DECIMALS)
    share = value[chosen] / largest if largest > 0 else value[chosen]
    alike = np.floor(share * 10.0**DECIMALS + BETWEEN)
    return chosen[np.lexsort((step.rank[chosen], alike))]
