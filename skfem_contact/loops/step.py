"""Values that the loops pass around: steps, guesses, iterates and records."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.state import LocalState
from skfem_contact.problem.seam import Conditions, LinearProblem, Load, Resistance, Response
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

    def under(self, load: Load, last: LocalState, noise: float, far: float) -> Step:
        """The same points under another load; what is known of the points by themselves is shared."""
        step = object.__new__(Step)
        friction = self.friction.since(last.reference)
        vars(step).update(vars(self), load=load, last=last, noise=noise, far=far, friction=friction)
        return step

    # What is remembered from here on depends on nothing that `under` changes.

    @cached_property
    def turns(self) -> bool:
        """Directions of friction can turn: there is friction along more than one tangent."""
        return bool(self.friction.laws) and self.last.slip.shape[1] > 1

    @cached_property
    def exact(self) -> Mask:
        """Points that stick without any give, where they stick, (m,)."""
        return np.isinf(self.stiffness)

    @cached_property
    def all_exact(self) -> bool:
        """All points are `exact`."""
        return bool(self.exact.all())

    @cached_property
    def all_paired(self) -> bool:
        """All points have a partner."""
        return bool(self.paired.all())

    @cached_property
    def gripped(self) -> Mask:
        """Points whose slip is held where they stick: exactly, by friction or glue, (m,)."""
        return self.exact & self.frictional | self.tied

    @cached_property
    def resisting(self) -> Mask:
        """Points that hold a motion along their tangents where they stick, (m,)."""
        return self.frictional | self.tied

    @cached_property
    def modelled(self) -> Mask:
        """Those of them that have a partner, (m,)."""
        return self.paired & self.resisting

    @cached_property
    def closed_for_good(self) -> Mask | None:
        """Points that never open, (m,); None where there are none."""
        closed = (self.bilateral | self.tied) & self.paired
        return closed if np.count_nonzero(closed) else None

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
