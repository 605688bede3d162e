r"""`Tangent`: the equations of contact and friction linearised at an answer.

At an answer every point is open, stuck or slipping. As long as none changes, gaps g, slips s and forces
follow linear equations: an open point carries nothing, a closed one keeps its gap, a stuck one its
slip, and the friction of a slipping one follows from the return map P (`return_map`) at its trial force
``t = tau + k (s - s_n)``,

    d tau = J dt + c d lambda + B d(s - s_0) + dP,      J, c, B = dP/dt, dP/d lambda, dP/ds.

With a finite tangential stiffness ``k = G`` and tau in t is the one of the step before. Where sticking
is exact it is that of this step, for any k, and the equation is solved for it,

    d tau = M (k J d(s - s_n) + c d lambda + B d(s - s_0) + dP),      M = (1 - J)^-1.

With Coulomb's law ``M k J = L / |s - s_n| (1 - d d')``, whatever k is: the spring across the direction
d of friction is that of the answer itself. The last linear solve of an iteration has that of an iterate
before, which is why it is not taken from there.

These are the conditions of one more linear solve (`problem.points.Conditions`), in which anchors and
offsets are what the step before and the parameter make of them.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import block_diag, csr_matrix, vstack

from skfem_contact.answers.answer import Answer
from skfem_contact.arguments import NamesAttributes, numbers
from skfem_contact.arrays import Array, Index, Mask, check_size, lengths, unit_vectors
from skfem_contact.conditions.friction import FrictionLaw
from skfem_contact.conditions.friction_rule import BEYOND, Derivatives, FrictionRule
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.rows import combined_rows, tangential_matrix
from skfem_contact.conditions.state import OPEN, SLIP, STICK, LoadCase
from skfem_contact.digits import COMPUTED, SOLVED
from skfem_contact.elimination.constraint import AffineConstraint, eliminate
from skfem_contact.errors import InputError, NotConverged
from skfem_contact.linalg.dense_factors import single_threaded
from skfem_contact.linalg.krylov import gmres
from skfem_contact.loops.active_set import largest_force
from skfem_contact.problem.points import Conditions
from skfem_contact.problem.seam import Source, Workspace

#: Derivatives by name, of loads or points: (n,) or (m, width). What is not there is zero.
Values = dict[str, Array]


def add(values: Values, name: str, own: Array) -> None:
    """Add to the values of a name, which may not be there yet."""
    values[name] = values[name] + own if name in values else own


class Slopes(NamedTuple):
    """Derivatives of the friction forces of slipping points; zero at all others.

    Attributes
    ----------
    spring, by_trial, by_slip, by_map : ndarray, shape (m, d-1, d-1)
        By the slip since the last step, ``M k J + M B``; by the friction of the last step; by the slip
        that bounds follow, ``M B``; and by the return map itself, M.
    by_normal : ndarray, shape (m, d-1)
        By the normal force.
    trial : ndarray, shape (m, d-1)
        The trial forces at which the return map is asked [force].
    """

    spring: Array
    by_trial: Array
    by_slip: Array
    by_map: Array
    by_normal: Array
    trial: Array


def mapped_slopes(
    by: Derivatives, slips: Mask, elastic: Mask, k: Array, exact: Mask, trial: Array
) -> Slopes:
    """The derivatives of friction that follow from those of the return map.

    With the stiffness k, (m, 1), where sticking is exact, (m, 1), any; `elastic` points stick with it.
    """
    unit, some = np.eye(trial.shape[1]), slips[:, None, None]
    sticks, J = unit * elastic[:, None, None], np.where(some, by.trial, 0.0)
    left = np.where(exact[:, None], 0.0, J)
    M = unit * some @ np.linalg.inv(unit - (J - left))
    spring, B = M @ (k[:, :, None] * J) + k[:, :, None] * sticks, M @ by.slip
    return Slopes(spring + B, sticks + left, B, M, np.einsum("ikl,il->ik", M, by.normal_force), trial)


class Tangent(NamesAttributes):
    r"""The equations of contact and friction linearised at an answer, which `result.linearized` is.

    It holds while no point changes its status: `margin` says how far each is from that, and `kinks` are
    the points that are on the verge, where the answer has a derivative to either side only.

    Attributes
    ----------
    status : ndarray of int, shape (m,)
        0 open, 1 stick, 2 slip, of all points, one contact after the other.
    direction : ndarray, shape (m, d-1)
        Unit direction of the force that resists at a slipping point; zero at the others.
    slope : ndarray, shape (m, d-1)
        Derivative of that force by the normal force, ``mu d``: the part of friction that follows the
        pressure, and makes the equations unsymmetric.
    spring : ndarray, shape (m, d-1, d-1)
        Its derivative by the slip: in space ``L / |ds| (1 - d d')``, as the direction of friction turns
        with the slip ``ds`` of the step; of a point that sticks with a finite stiffness that stiffness
        [force/length].

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
    >>> tangent = sc.ContactSolver(block, foot).solve().linearized
    >>> tangent.status.tolist(), tangent.kinks.tolist()
    ([2, 1, 1, 1, 2], [])
    >>> tangent.slope[tangent.status == 2].round(12).tolist()
    [[0.3], [-0.3]]
    """

    def __init__(self, answer: Answer, workspace: Workspace | None = None) -> None:
        refuse(answer)
        problem, interface = answer.model.for_tangents, answer.model.interface
        assert problem is not None
        self.answer, self.problem = answer, problem
        # of a history the zone that its load steps have drawn
        self.zones = (problem.anew() if workspace is None else workspace.borrowed(problem)).zones
        self.local = local = answer.local
        self.rims = None if answer.placed is None else answer.placed.rims
        self.rule = FrictionRule(interface.laws, local.area, local.reference)
        # bolts in the step: with a force that is given, and with the stretch of the step before
        self.bolts, bolts, tight = None, answer.bolts, answer.case.bolts
        if bolts and bolts.names and tight is not None and tight.kept is not None:
            self.bolts, self.tightened, self.locked = bolts, tight.given, tight.kept
            # stretch by the pull, of those with a force that is given, which slide
            self.by_pull = np.where(tight.given, -1.0 / bolts.k, 0.0)
        self.closed, sticks = local.status != OPEN, local.status == STICK
        exact = np.isinf(interface.stiffness)
        self.slips = (local.status == SLIP) & interface.frictional
        self.stick = sticks & (interface.frictional & exact | interface.tied)
        self.elastic = sticks & interface.frictional & ~exact
        if local.slip.shape[1] > 1:
            # where nothing has slipped yet no direction turns: as if it stuck, and a kink
            still = self.slips & exact & ~self.slid
            self.slips, self.stick = self.slips & ~still, self.stick | still

    @property
    def status(self) -> Index:
        """See the class: closed points without friction or glue count as slipping."""
        return np.where(~self.answer.model.interface.slipping & self.closed, SLIP, self.local.status)

    @cached_property
    def direction(self) -> Array:
        """See the class."""
        along, way = self.local.tangential_force, self.answer.plastic_slip
        size = lengths(along)
        # nearly without a bound friction has a direction all the same: that of the slip
        faint = self.slips & way.any(axis=1) & (size <= SOLVED * size.max(initial=0.0))
        return unit_vectors(np.where(self.slips[:, None], np.where(faint[:, None], way, along), 0.0))

    @cached_property
    def slopes(self) -> Slopes:
        """Derivatives of the friction of slipping points."""
        local, (m, t) = self.local, self.local.slip.shape
        stiffness, slips = self.answer.tangential_stiffness[:, None], self.slips[:, None, None]
        if t == 1 and self.rule.steady:  # nothing turns
            by_normal, by_map = self.direction * self.bound_slope[:, None], slips.astype(float)
            by_trial, none = self.elastic.astype(float)[:, None, None], np.zeros((m, 1, 1))
            spring = np.where(by_trial, stiffness[:, None], 0.0) if np.count_nonzero(by_trial) else none
            return Slopes(spring, by_trial, none, by_map, by_normal, BEYOND * self.direction)
        force, moved = lengths(local.tangential_force), lengths(way := self.answer.plastic_slip)
        # with exact sticking any stiffness does: one that makes the trial force twice the bound
        k = np.where(force > 0, force, 1.0) / np.where(moved > 0, moved, 1.0)
        k = np.where(np.isinf(stiffness), k[:, None], stiffness)
        trial = local.tangential_force + k * way if t > 1 else BEYOND * self.direction
        by = self.rule.mapped(trial, local.normal_force, local.slip)[2]
        # the bound of glue that is pulled stays as it is
        by = by._replace(normal_force=np.where(self.presses[:, None], by.normal_force, 0.0))
        return mapped_slopes(by, self.slips, self.elastic, k, np.isinf(stiffness), trial)

    slope = property(lambda self: self.slopes.by_normal, doc="See the class.")
    spring = property(lambda self: self.slopes.spring, doc="See the class.")

    @property
    def conditions(self) -> Conditions:
        """Return what a linear solve holds every point to, with nothing that drives it."""
        still, slopes = np.zeros(self.local.slip.shape), self.slopes
        return Conditions(self.closed, self.stick, still, slopes.spring, still, slopes.by_normal)

    # -- how far it holds -----------------------------------------------------------------------

    @cached_property
    def bound(self) -> Array:
        """Bound of the friction force, zero at open points, (m,) [force]."""
        return np.where(self.closed, self.rule.bound(self.local.normal_force, self.local.slip), 0.0)

    @property
    def presses(self) -> Mask:
        """Closed points whose bound follows the normal force: not of glue that is pulled, (m,)."""
        return self.closed & ~(self.answer.model.interface.bilateral & (self.local.normal_force < 0))

    @cached_property
    def bound_slope(self) -> Array:
        """Derivative of the bounds by the normal force, zero at open points, (m,)."""
        return np.where(self.presses, self.rule.slope(self.local.normal_force, self.local.slip), 0.0)

    @cached_property
    def margins(self) -> tuple[Array, Array]:
        """Return how far points are from opening or closing, and from sticking or slipping."""
        local, interface, resistance = self.local, self.answer.model.interface, self.problem.resistance
        apart = np.where(self.closed, local.normal_force, self._opened)
        never = interface.bilateral | ~(self.closed | np.isfinite(local.gap))
        along = np.sum(self.answer.plastic_slip * unit_vectors(local.tangential_force), axis=1)
        lacking = self.bound - lengths(local.tangential_force)
        slides = np.where(local.status == SLIP, resistance.tangential * along, lacking)
        rubs = self.closed & interface.frictional
        found = np.where(never, np.inf, apart), np.where(rubs, slides, np.inf)
        return found[0] / self.largest_force, found[1] / self.largest_force

    @cached_property
    def margin(self) -> Array:
        """Return how far each point is from its next change, shape (m,): a force over the largest one.

        Of a closed point its normal force, or what friction lacks to its bound; of an open one its gap,
        and of a slipping one its slip in the step, times what the point resists by itself. Infinite
        where nothing can change.
        """
        return np.maximum(np.minimum(*self.margins), 0.0)

    @cached_property
    def kinks(self) -> Index:
        """Points at which the answer has a kink: a derivative to either side, which may differ."""
        return np.flatnonzero(self.margin <= SOLVED)

    @cached_property
    def slid(self) -> Mask:
        """Points whose slip in the step is more than round-off, (m,): it tells where friction acts."""
        resisted = self.problem.resistance.tangential * lengths(self.answer.plastic_slip)
        return np.asarray(resisted > SOLVED * self.largest_force)

    @cached_property
    def largest_force(self) -> float:
        """The largest force of a point; without any, what would close the largest gap [force]."""
        return largest_force(self.local) or float(self._opened.max(initial=0.0)) or 1.0

    @property
    def _opened(self) -> Array:
        """What would close the gaps by itself, zero of points without a partner, (m,) [force]."""
        gap = np.where(np.isfinite(self.local.gap), self.local.gap, 0.0)
        return np.asarray(gap * self.problem.resistance.normal)

    # -- solves, through the factors that are there ---------------------------------------------

    def holding(self, closed: Mask, stick: Mask, slopes: Slopes) -> Tangent:
        """The same with other points closed and stuck, and other friction."""
        new = copy(self)
        for name in ("bound", "bound_slope"):
            vars(new).pop(name, None)
        vars(new).update(closed=closed, stick=stick, slopes=slopes)
        return new

    def solve(self, force: ArrayLike) -> Array:
        """Changes of displacements (n,) under those of loads (n,), ``T (W'KT)^-1 W'``, by factors."""
        system = self.answer.system
        f = numbers(force, "force", "give a load (n,)")
        check_size(f, system.n, "force", f"and has to be a load on all DOFs, ({system.n},)")
        return self.solved({"f": f / system.units})() / system.units

    def solved(self, values: Values, back: bool = False) -> Callable[[], Array]:
        """Add what follows from changes f, x, gap0, slip0, anchor, offset: gaps, slips and forces.

        Or, `back`, derivatives of a number by those, from these that it depends on and from u; but by f
        and x. What is returned finds u (n,), or those by f. Loads that follow the free rims of what a
        fluid presses are not symmetric: they stand beside the factors, ``f = rims (u + moved(f))``.

        Raises
        ------
        InputError
            Conditions of points depend on each other: with springs between them derivatives are others.
        NotConverged
            A fluid pushes rims more than the bodies resist.
        """
        if self.problem.springs is not None:
            refuse(self.answer, springs=True)
        once, name, rims = (self._back, "u", self.rims) if back else (self._forth, "f", self.rims)
        if rims is not None:
            rims = rims.T if back else rims
            b = rims @ once(dict(values))()
            size = float(np.linalg.norm(b))
            own = gmres(lambda f: f - rims @ once({name: f})(), b, np.copy, b, COMPUTED * size, len(b))
            if own.residual > SOLVED * size:
                raise NotConverged("derivatives at free rims that a fluid presses were not found", None)
            add(values, name, own.x)
        with single_threaded:
            return once(values)

    def _forth(self, values: Values) -> Callable[[], Array]:
        """`solved` without rims."""
        zone, key = self.zones.fitting(held := self.conditions, self.local.gap)
        anchor, offset = (values.get(name, held.anchor) for name in ("anchor", "offset"))
        load = self.problem.other_load(case := self._case(values))
        found = zone.solve(replace(held, anchor=anchor, offset=offset), load, key)
        values |= {"gap": found.gap[:, None], "normal_force": found.normal_force[:, None]}
        values |= {"slip": found.slip, "friction": found.tangential_force}
        return lambda: self._recovered(self.problem.source(load, found).values, case)

    def _back(self, values: Values) -> Callable[[], Array]:
        """`solved` backwards, without rims: by reciprocity.

        What a number depends on drives the transposed problem: by normal forces gaps are held open, by
        friction slips and where springs begin, and by gaps and slips there are forces on them.
        """
        (m, t), problem, given = self.local.slip.shape, self.problem, Values()
        zone, key = self.zones.fitting(held := self.conditions, self.local.gap)
        moved, fixed, one = np.zeros(len(problem.compliance.W)), np.zeros(1), np.zeros((m, 1))
        if "u" in values:
            given["f"] = values["u"]
            load = problem.other_load(self._case(given))
            moved, fixed = np.array(load.moved), load.prescribed
        gap, pulled = values.get("gap", one)[:, 0], values.get("normal_force", one)[:, 0]
        slip, friction = values.get("slip", held.anchor), values.get("friction", held.anchor)
        by_law, drawn, rows = held.offset, slip, problem.tangential_rows
        # where supports prescribe gaps or slips there is no row for them, and of friction the law alone
        if lacks := problem.q < m * (1 + t):
            bare, prescribed = rows < 0, problem.normal_rows < 0
            by_law = np.where(bare, friction, 0.0)
            pulled = pulled + np.einsum("ik,ik->i", held.coupling, by_law)
            drawn = slip + np.einsum("ikl,ik->il", held.spring, by_law)
        start, forces = problem.on_rows(-pulled, friction), problem.on_rows(gap, drawn)
        total, since = zone.transposed(held, start, forces, moved, key)
        offset = (self.closed & ~self.stick).astype(float)[:, None] * (by_law - since[rows])
        gap0, slip0 = total[problem.normal_rows], total[rows]
        if lacks:
            drawn = slip + np.einsum("ikl,ik->il", held.spring, offset)
            gap0, slip0 = np.where(prescribed, gap, gap0), np.where(bare, drawn, slip0)
        values |= {"gap0": gap0[:, None], "slip0": slip0, "anchor": slip - slip0, "offset": offset}
        return lambda: self._recovered(problem.G.T @ total[:-1] + fixed, self._case(given))

    def _case(self, given: Values) -> LoadCase:
        """Return the load case of changes of the loads f, x, and of gap0 and slip0."""
        n, (m, t) = self.answer.system.n, self.local.slip.shape
        f, x = (given.get(name, np.zeros(n)) for name in "fx")
        gap0, slip0 = given.get("gap0", np.zeros((m, 1))), given.get("slip0", np.zeros((m, t)))
        return LoadCase(f, x, gap0[:, 0], slip0, np.zeros(m), ())

    def _recovered(self, force: Array, case: LoadCase) -> Array:
        """Displacements (n,) under such changes and forces on the contact DOFs (n_c,)."""
        with single_threaded:
            return self.problem.bodies.recover(Source(force[:, None], True), [None], [case])[0]

    # -- matrices, on request -------------------------------------------------------------------

    @cached_property
    def K(self) -> csr_matrix:
        """Stiffness of all bodies with the springs of slipping points, (n, n) [force/length]."""
        stiffness = csr_matrix(block_diag(self.answer.stiffness, format="csr"))
        if self.conditions.gives:
            stiffness = csr_matrix(stiffness + tangential_matrix(self.answer.kin.B_t, self.spring))
        return stiffness if self.rims is None else csr_matrix(stiffness - self.rims)

    @property
    def rows(self) -> csr_matrix:
        """Rows whose product with rates of u is zero: closed gaps, then slips that stick, (k, n)."""
        return held_rows(self.answer.kin, self.closed, self.stick)

    @cached_property
    def T(self) -> csr_matrix:
        """Rates of u that `rows` and supports leave free, ``u = T u_r``, (n, r)."""
        return left_free(self.answer, self.closed, self.stick).T

    @cached_property
    def W(self) -> csr_matrix:
        """Virtual displacements on which contact forces do no work, friction included, (n, r).

        Of as many columns as `T`, and T itself where no friction follows the pressure.
        """
        follows = np.any(self.slope)
        return left_free(self.answer, self.closed, self.stick, self.slope).T if follows else self.T

    @property
    def K_r(self) -> csr_matrix:
        """Stiffness of what is free to move, ``W' K T``, (r, r) [force/length]."""
        return csr_matrix(self.W.T @ self.K @ self.T)

    @property
    def K_friction(self) -> csr_matrix:
        """The part of `K_r` by friction that follows the pressure, ``(W - T)' K T``, (r, r)."""
        return csr_matrix((self.W - self.T).T @ self.K @ self.T)

    def __repr__(self) -> str:
        count = [int(np.sum(self.status == k)) for k in (OPEN, STICK, SLIP)]
        kinks = "no kinks" if not len(self.kinks) else f"kinks at points {self.kinks.tolist()}"
        return "<Tangent: {} open, {} stick, {} slip; {}>".format(*count, kinks)


def held_rows(kin: Kinematics, closed: Mask, stick: Mask, slope: ArrayLike = 0.0) -> csr_matrix:
    """Rows of closed gaps, then of slips that stick, (k, n).

    With the slope of friction by the normal force, (m, d-1): rows of what contact forces work on.
    """
    normal = kin.B_n
    if np.any(slope):
        normal = csr_matrix(normal - combined_rows(np.asarray(slope)[:, None], kin.B_t))
    return csr_matrix(vstack([normal[closed], kin.B_t[np.repeat(stick, kin.tangents)]]))


def left_free(posed: Any, closed: Mask, stick: Mask, slope: ArrayLike = 0.0) -> AffineConstraint:
    """Displacements that `held_rows` and supports leave free, of an answer or a solver.

    With the slope virtual ones, on which contact forces do no work.
    """
    rows, system = held_rows(posed.kin, closed, stick, slope), posed.system
    return eliminate(rows, np.zeros(rows.shape[0]), system.D, np.zeros(system.n))


def refuse(answer: Answer, springs: bool = False) -> None:
    """Raise `InputError` for an answer that has no tangent, with the reason.

    Or no derivatives, as its points are seen through springs there.

    Raises
    ------
    InputError
    """
    model, interface = answer.model, answer.model.interface
    wears = bool(interface.wear) or bool(np.count_nonzero(answer.state.wear))
    problem = None if answer.indifferent else model.for_tangents  # where bodies are free there is none
    remembers = [getattr(body, "initial_state", None) for body in model.system.bodies]
    bare = [
        f"{type(own.law).__name__} of contact '{own.contact}'"
        for _, own in interface.laws
        if own.by_bound and type(own.law).slope is FrictionLaw.slope
    ]
    reasons = {
        "it did not converge ({answer.message})": not answer.converged,
        'contact slides far (sliding="finite"): how its pairing changes is not differentiated. Where '
        'slips are short, sliding="small" has derivatives': model.geometry.follows,
        "surfaces wear: the depth worn off is not differentiated. Leave wear out of the contact": wears,
        "its load step was cut into {answer.parts} parts. Give the history smaller steps": answer.parts
        > 1,
        "conditions of its points depend on each other, so that forces are not unique. Let contacts "
        "share no edge, and make a held tool no finer than what it presses": answer.springs or springs,
        "a body may stand elsewhere as well. Prescribe a DOF (D=...)": bool(answer.indifferent),
        "a material has internal variables, which are not differentiated": any(remembers),
        "the law {bare} has no slopes of its own, and difference quotients leave six digits. Give it "
        "slope(...), the derivative of its limit by the normal force, or a return_map(...)": bool(bare),
        "this route ({model.route}) has no matrix. Take linear='condensed'": problem is None,
    }
    for words, wrong in reasons.items():
        if wrong:  # words are put together where they are needed: a history asks at every step
            known = {"answer": answer, "model": model, "bare": ", ".join(bare)}
            raise InputError(f"this result has no derivatives: {words.format(**known)}.")
