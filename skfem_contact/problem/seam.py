r"""The seam between bodies and contact: `ContactProblem`.

Whatever the bodies are and however they are solved, contact knows them by five questions. A load step
is put to a problem (`load`); an iteration asks for gaps, slips and forces under given conditions
(`solve`); at its end the problem says what the displacements follow from (`source`), those of the
surfaces at once (`surface`), those of the bodies by ``model.bodies.recover`` when somebody asks.

Four problems answer them, each exactly:

=================  =====================  ==========================================================
problem            unknowns               in
=================  =====================  ==========================================================
`PointProblem`     gaps and slips         `zone`: small and dense
`IteratedProblem`  forces on points       `iterated`: the same where there are very many, by products
                                          with the factors of the bodies
`MultigridProblem` displacements, forces  `iterated`: for bodies too large to be factorised
`FullProblem`      all DOFs               `full`: sparse, with any linear solver
=================  =====================  ==========================================================

`ContactProblem` is what all have in common, `OnContactDofs` what those of bodies reduced to their
contact DOFs have.

A contact problem keeps the factors of its last iteration, what it has left out, and more, as most
iterations of a load history ask for the set of the last one. That changes while a loop runs, so it must
not be shared: threads that solve at once on one solver would take each other's. Each solve borrows
problems with a memory of their own and gives them back when it ends. Solves that follow each other
borrow the same ones; only where several run at once there are several.

All that such problems of one pairing share, the stiffness S above all, does not change. What one
solve has borrowed is its `Workspace`.

Where rows depend on each other, at corners, along edges that contacts share, on tools that supports
hold and that are finer than what they press, forces of contact are not unique. Each point is then seen
through a spring with the compliance E, ``W + E`` in place of ``W = B S^-1 B'``, whose rest forces are
moved until no spring has a strain (`skfem_contact.loops.multipliers`). What is left of the springs is a
choice: forces p with the least ``p'E p``. With

    ``E_i = eps mean(c_j a_j) / a_i``,

a the areas and c the compliances of the points, that is the least square of the pressure over the
surface, whatever the order of contacts and the numbering of nodes. The mean is over points whose rows
are connected: rows of others do not depend on each other.

What each contact point resists by itself are the diagonal blocks of the compliance of all points, or of
what K's diagonal makes of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.conditions.kinematics import (
    Kinematics,
    without_columns,
)
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.rows import stacked_rows
from skfem_contact.conditions.state import LoadCase
from skfem_contact.digits import GIVEN
from skfem_contact.errors import ContactError
from skfem_contact.problem.points import LinearProblem, Load, Resistance, Response
from skfem_contact.records import dataclass

P = TypeVar("P", bound="ContactProblem")


@dataclass(eq=False)
class Source:
    """The forces or displacements that the displacements of the bodies follow from.

    Attributes
    ----------
    values : ndarray, shape (n_c,) or (n_c, r), or with n in place of n_c
        Forces on the contact DOFs, contact forces included; or displacements of the contact DOFs; or
        of all DOFs.
    forces : bool
    """

    values: Array
    forces: bool


# Pivot of a contact row (of unit diagonal) below which it depends on the others: its square is what
# the inverse loses of its digits, six here. A beam 20 times as long as high is at 1e-2.
DEPENDENT = 1e-3


# K's diagonal knows nothing of what gives way around a node: of the resistance of a contact point it
# makes 1.2 to 3.6 times along the normal and 1.6 to 6.4 times across (hexahedra, thick and thin blocks,
# matching or not). On all DOFs, where nothing better is at hand, a third of it is taken.
STIFFER = 3.0


# Compliance of the springs of points whose rows depend on each other, over that of the points. With a
# hundredth of it Newton stalls where several contacts with friction share a node; with a hundred times
# as much, springs lose their strain in twice as many passes.
GIVE = 3e-3


def spring_compliance(kin: Kinematics, slips: bool, softness: Array) -> Array:
    """Compliance of the spring of each point, along its normal and its tangents, (m,) [length/force].

    Parameters
    ----------
    kin : Kinematics
        With the columns of DOFs that can move.
    slips : bool
        Whether tangential rows are modelled.
    softness : ndarray, shape (n,)
        How far a unit force on each DOF moves it, by its own stiffness [length/force].
    """
    own, area = kin.B_n.multiply(kin.B_n) @ softness, np.asarray(kin.area, dtype=float)
    pattern = abs(kin.B_n)
    for B in _tangential(kin) if slips else ():
        pattern = pattern + abs(B)
        own = np.where(own > 0, own, B.multiply(B) @ softness)
    large = area > 0
    area = np.where(large, area, np.mean(area[large]) if large.any() else 1.0)
    count, group = connected_components(pattern @ pattern.T, directed=False)
    moves = own > 0
    weight = np.bincount(group[moves], (own * area)[moves], minlength=count)
    mean = weight / np.maximum(np.bincount(group[moves], minlength=count), 1)
    mean = np.where(mean > 0, mean, mean.max(initial=0.0) or 1.0)  # of rows that nothing moves
    return np.asarray(GIVE * mean[group] / area)


def _tangential(kin: Kinematics) -> list[csr_matrix]:
    """Rows of the slips along each tangent."""
    return [csr_matrix(kin.B_t[k :: kin.tangents]) for k in range(kin.tangents)]


def independent(rows: csr_matrix, softness: Array, size: Array | None = None) -> bool:
    """Return whether no row depends on others as far as DOFs show that move each by itself.

    Parameters
    ----------
    rows : csr_matrix, shape (r, n)
    softness : ndarray, shape (n,)
        Of the DOFs. Not above the true flexibility F, it proves it of ``B F B'``: no pivot of that is
        below that of ``B diag(softness) B'``.
    size : ndarray, shape (r,), optional
        What pivots are relative to; by default the diagonal of the latter [length/force].
    """
    Q = csr_matrix(rows @ diags(softness) @ rows.T)
    size = Q.diagonal() if size is None else size
    if not np.all(size > 0.0):
        return False
    scale = diags(1.0 / np.sqrt(size))
    order = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
    try:
        pivots = splu((scale @ Q @ scale).tocsc(), diag_pivot_thresh=0.0, **order).U.diagonal()
    except RuntimeError:  # exactly singular
        return False
    return bool(np.min(pivots, initial=1.0) >= DEPENDENT**2)


def point_resistance(kin: Kinematics, slips: bool, softness: Array) -> Resistance:
    """Resistance of each point by the stiffness of its DOFs, as if they were bodies of their own.

    K's diagonal knows nothing of what gives way around a node: a third of it is taken (`STIFFER`).

    Parameters
    ----------
    kin : Kinematics
    slips : bool
        Whether tangential rows are modelled.
    softness : ndarray, shape (n,)
        As of `spring_compliance`.
    """
    of_normals, of_tangents = (
        STIFFER * np.array([[A.multiply(B) @ softness for B in rows] for A in rows]).transpose(2, 0, 1)
        for rows in ([kin.B_n], (_tangential(kin) if slips else []) or [kin.B_n])
    )
    return _resistance(of_normals, of_tangents)


def resistance_by(W: Array, normal_rows: Index, tangential_rows: Index) -> Resistance:
    """Resistance of each point from the compliance of all rows; -1 where a point has none."""
    rows = (
        normal_rows[:, None],
        tangential_rows if (tangential_rows >= 0).any() else normal_rows[:, None],
    )
    W = W if W.size else np.zeros((1, 1))  # whose last row is looked at for points that have none
    normal, tangential = (
        np.where((on[:, :, None] >= 0) & (on[:, None, :] >= 0), W[on[:, :, None], on[:, None, :]], 0.0)
        for on in rows
    )
    return _resistance(normal, tangential)


def _resistance(normal: Array, tangential: Array) -> Resistance:
    # of a body that is about to buckle it may be negative: how stiff it is is a size all the same
    softest = np.max(np.abs(np.linalg.eigvalsh(tangential)), axis=1)
    return Resistance(_inverse(np.abs(normal[:, 0, 0])), _inverse(softest))


def _inverse(compliance: Array) -> Array:
    """One over it; what can not move at all resists like the stiffest of the others."""
    moves = compliance > 0
    if not moves.any():
        return np.ones_like(compliance)
    return 1.0 / np.where(moves, compliance, np.min(compliance[moves]))


@dataclass(frozen=True, eq=False)
class PosedOn:
    """The pairing that a contact problem is posed on, and what belongs to it.

    Attributes
    ----------
    kin, motions, u
        As of `ContactProblem`.
    slipping : ndarray of bool, shape (m,)
        Points with tangential rows.
    prefer : ndarray of bool, shape (n,), optional
        DOFs of the secondary surfaces, which are eliminated first.
    independent : callable, optional
        Says that rows do not depend on each other, whatever the digits of a tangent make of them.
    """

    kin: Kinematics
    motions: RigidMotions
    u: Array | None
    slipping: Mask
    prefer: Mask | None = None
    independent: Callable[[], bool] = lambda: False


class ContactProblem(LinearProblem):
    """Bodies and the points of one pairing.

    Attributes
    ----------
    bodies
        The bodies without contact: `Condensed`, `IteratedBodies`, `MultigridBodies` or `FullSystem`.
    kin : Kinematics
        The pairing; its `gap0` are the gaps at the displacements `u`.
    motions : RigidMotions
        Those that supports leave free, seen from these points.
    u : ndarray, shape (n,) or None
        Displacements of the surfaces at which the pairing was made; None for the undeformed bodies.
    slips : bool
        Whether any point has tangential rows.
    idle : list of ContactProblem
        Of those that `anew` has made the ones that no solve has at the moment, see `Workspace`.
    steps : WeakKeyDictionary
        What loops know of the points, by whom they are asked; of this problem's memory.
    on_points : ContactProblem or None
        The same on gaps and slips, where somebody has asked for it; of this problem's memory.
    unknowns : int
        Gaps and slips of `points`; zero where there is none.
    """

    springs: Array | None = None
    unknowns = 0

    def __init__(self, bodies: Any, on: PosedOn) -> None:
        self.bodies, self.slips = bodies, bool(on.slipping.any())
        self.kin, self.motions, self.u = on.kin, on.motions, on.u
        self.idle: list[Any] = []
        self._begin_anew()

    def anew(self: P) -> P:
        """The same problem with a memory of its own: for one solve at a time."""
        new = copy(self)
        new._begin_anew()
        return new

    def _begin_anew(self) -> None:
        """Forget all that follows from what was solved before."""
        self.steps: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
        self.on_points: ContactProblem | None = None

    @property
    def points(self) -> Any:
        """None, but of `PointProblem`."""
        return None

    @property
    def resistance(self) -> Resistance:
        """Return what each point resists by itself: how gaps and slips count beside forces."""
        raise NotImplementedError

    def in_series(self, C: Resistance) -> LinearProblem:
        """The same problem with springs of the stiffness C in series with its points, and no others."""
        new = copy(self)
        new.springs = None  # that are to lose their strain
        new._give_way(1.0 / C.normal, 1.0 / C.tangential[:, None])
        return new

    def _give_way(self, normal: Array, tangential: Array) -> None:
        """See all points through springs of these compliances, (m,) and (m, d-1), and no others."""
        raise NotImplementedError

    def load(self, case: LoadCase) -> Load:
        """A load case in the unknowns of the problem."""
        raise NotImplementedError

    def other_load(self, case: LoadCase) -> Load:
        """A load case that is like no other, or one of its derivatives: nothing of it is remembered."""
        return self.load(case)

    def source(self, load: Load, response: Response) -> Source:
        """Return what the displacements of the bodies follow from."""
        return self.sources([(load, response)])[0]

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """The same for many answers."""
        raise NotImplementedError

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) as far as they are known without the interior [length]."""
        return np.asarray(self.bodies.surface(source, case))


class OnContactDofs(ContactProblem):
    """The rows of contact problems on contact DOFs, and on prescribed ones.

    Attributes
    ----------
    G : csr_matrix, shape (q, n_c)
        Rows of gaps and slips that can change, those of gaps first.
    normal_rows, tangential_rows : ndarray of int, shapes (m,) and (m, d-1)
        Where in them each point has its own; -1 where it has none.
    give : ndarray, shape (q,)
        Compliance of the springs in series with each row; zero without [length/force].
    """

    def __init__(self, bodies: Any, on: PosedOn) -> None:
        super().__init__(bodies, on)
        self.rows = without_columns(on.kin, bodies.columns)
        self.G, self.normal_rows, self.tangential_rows = self._changing_rows(on)
        self.q = self.G.shape[0]
        self.give = np.zeros(self.q)

    @cached_property
    def prescribed(self) -> Kinematics:
        """The rows on prescribed DOFs."""
        return without_columns(self.kin, self.bodies.system.D)

    @cached_property
    def onto_dofs(self) -> tuple[csc_matrix, csc_matrix]:
        """From forces on gaps and on slips to those on the contact DOFs: the rows transposed."""
        kin = self.rows
        return kin.B_n.T, kin.B_t.T if self.slips else csc_matrix((len(self.bodies.columns), 0))

    def _changing_rows(self, on: PosedOn) -> tuple[csr_matrix, Index, Index]:
        kin, m, t = self.rows, len(on.kin.paired), on.kin.tangents
        normal = np.flatnonzero(kin.paired & (_row_sizes(kin.B_n) > GIVEN))
        tangential, rows = np.zeros(0, dtype=np.intp), [_chosen(kin.B_n, normal)]
        if self.slips:
            may_slip = np.repeat(kin.paired & on.slipping, t)
            tangential = np.flatnonzero(may_slip & (_row_sizes(kin.B_t) > GIVEN))
            rows.append(_chosen(kin.B_t, tangential))
        normal_rows, tangential_rows = np.full(m, -1), np.full(m * t, -1)
        normal_rows[normal] = np.arange(len(normal))
        tangential_rows[tangential] = len(normal) + np.arange(len(tangential))
        return stacked_rows(rows), normal_rows, tangential_rows.reshape(m, t)

    def constant(self, case: LoadCase) -> tuple[Array, Array]:
        """Initial gaps and slips with what prescribed displacements add."""
        gap0, slip0, known = case.gap0, case.slip0, self.prescribed
        x = case.x[self.bodies.system.D]
        if known.B_n.nnz:
            gap0 = gap0 + known.B_n @ x
        if self.slips and known.B_t.nnz:
            slip0 = slip0 + (known.B_t @ x).reshape(slip0.shape)
        return gap0, slip0

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs in series have no strain."""
        assert load.moved is not None
        moved = load.moved.copy()
        moved[: self.q] -= self.give * self.on_rows(normal_force, -tangential_force)
        return replace(load, moved=moved)

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Forces on the contact DOFs: loads, contact, and the springs on the anchors.

        Those of many answers: sparse matrices are quick where they meet many vectors at once.
        """
        from_gaps, from_slips = self.onto_dofs
        loads, responses = [load for load, _ in found], [response for _, response in found]
        force = np.column_stack([load.prescribed for load in loads])
        force += from_gaps @ np.column_stack([r.normal_force for r in responses])
        force += self.bodies.P @ np.column_stack([r.solution[self.q :] for r in responses])
        if self.slips:
            force -= from_slips @ np.column_stack([r.tangential_force.ravel() for r in responses])
        return [Source(column.copy(), forces=True) for column in force.T]

    def on_rows(self, normal: Array, tangential: Array) -> Array:
        """Values of points (m,) and of their tangents (m, d-1), on the q rows that there are."""
        return on_rows((normal, tangential), self.normal_rows, self.tangential_rows, self.q)


def on_rows(values: tuple[Array, ...], normal_rows: Index, tangential_rows: Index, q: int) -> Array:
    """Values of points (m,) and of their tangents (m, d-1), on the q rows that there are."""
    out = np.zeros(q + 1)  # the last for rows of -1, which there are not
    out[normal_rows], out[tangential_rows] = values
    return out[:q]


def _row_sizes(B: csr_matrix) -> Array:
    """Euclidean norm of each row; SciPy's takes twenty times as long for a few rows."""
    row = np.repeat(np.arange(B.shape[0]), np.diff(B.indptr))
    return np.sqrt(np.bincount(row, B.data**2, B.shape[0]))


def _chosen(B: csr_matrix, rows: Index) -> csr_matrix:
    """Some rows, in their order; usually all."""
    return B if len(rows) == B.shape[0] else csr_matrix(B[rows])


class Workspace:
    """The contact problems that a solve has borrowed; for one thread.

    Used as a context it gives them back at the end, and after errors that say something of the load.
    After any other, such as an interrupt, nobody knows what was being written: they are left.
    """

    def __init__(self) -> None:
        self._borrowed: dict[Any, Any] = {}

    def borrowed(self, shared: P) -> P:
        """A contact problem on the pairing of the undeformed bodies, for this solve alone."""
        own: P | None = self._borrowed.get(shared)
        if own is None:
            try:
                own = shared.idle.pop()
            except IndexError:
                own = shared.anew()
            self._borrowed[shared] = own
        return own

    def __enter__(self) -> Workspace:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        if kind is None or issubclass(kind, ContactError):
            for shared, own in self._borrowed.items():
                shared.idle.append(own)
        self._borrowed = {}
