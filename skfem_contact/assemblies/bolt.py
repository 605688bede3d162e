r"""Bolts that are tightened: pretension sections, without a cut in the mesh.

A section divides the elements of a bolt in two sides. If the nodes beyond it move by one along the
axis (``m``, zero at all other nodes), only the layer of elements next to the section is strained. A
bolt that is drawn shorter by ``d`` has the stresses of ``u + d m``, with ``u`` what its nodes move by:

    ``K u = f - d K m``,    ``N = m' K (u + d m)``,    ``k = m' K m``.

So the shift is a load on the bolt as it is, and ``N`` is the sum of all forces on the nodes beyond the
section along the axis: the force in the bolt, whatever the shape of the section. Where ``N`` is given
and ``d`` is not, elimination of ``d`` leaves

    ``(K - K m m' K / k) u = f - N K m / k``,    ``d = (N - m' K u) / k``.

One solve finds ``d``, with contact and friction. That stiffness lets the two sides of the section slide
along the axis, ``m``, as if they were two bodies. Later steps keep ``d``: the bolt is locked.

A temperature strains without stress. Its load ``f_T`` holds the stress that is not there, so that the
force in the bolt is ``N = m' (K (u + d m) - f_T)``: ``N + m' f_T`` stands in the place of ``N`` above.

References
----------
ABAQUS Analysis User's Guide, Prescribed assembly loads: a section by nodes and elements on one side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix, vstack

from skfem_contact.arguments import (
    NamesAttributes,
    check_kind,
    check_name,
    finite,
    members,
    names_of,
    shown,
    with_known_keywords,
)
from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.selection import pieces, written
from skfem_contact.bodies.system import System
from skfem_contact.conditions.state import BoltLoads, LoadCase
from skfem_contact.digits import COMPUTED, GIVEN, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.records import copied, dataclass, sealed

#: Shift and force of each bolt, by name.
ByBolt = dict[str, tuple[float, float]]


@with_known_keywords(
    preload="name it in a step of history(...)", force="name it in a step of history(...)"
)
@dataclass(frozen=True, eq=False, init=False, repr=False)
class Bolt(NamesAttributes):
    """A bolt that can be tightened: a section of a body across an axis.

    Load steps tighten it: ``{"bolt": {"bolt 1": {"force": 15e3}}}`` gives the force in the bolt,
    ``{"bolt": {"bolt 1": {"stretch": 0.02}}}`` the length by which it is drawn shorter than it was
    made, as by a nut that is turned. A bolt that a step does not name is locked: it keeps its length,
    and its force follows from the loads. Before the first step that names it, it is as it was made.

    Parameters
    ----------
    body : Body
        That the section cuts in two, such as the shank of a bolt with its head.
    point : array, shape (d,)
        On the axis, where the section is; bending is told about it [length].
    axis : array, shape (d,)
        Direction of the axis, of any length. That of axisymmetric bodies is ``(0, 1)``.
    name : str, optional
        For load steps and results; numbered if it is not given.

    Attributes
    ----------
    beyond : ndarray of bool, shape (n_body,)
        DOFs of the nodes beyond the section, without those on it.

    Raises
    ------
    InputError
        The plane through `point` passes no elements, or does not cut the body in two.

    Notes
    -----
    The mesh is not cut: the section follows sides of elements near the plane, and need not be plane. It
    cuts what is connected around `point` alone; other parts of the body may lie in the same plane.
    Springs to the ground in K beyond the section count as loads on the bolt.

    Examples
    --------
    A rod between two walls, of stiffness 20, tightened to a force of 10; then a wall moves by .05:

    >>> import numpy as np
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 50, 11)).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> rod = sc.Body(basis, linear_elasticity(0.0, 500.0), D=["bottom", "top"], name="rod")
    >>> side = sc.Contact(rod.surface("right"), sc.RigidPlane((2, 0), (-1, 0)))  # never touches
    >>> bolt = sc.Bolt(rod, point=(0.5, 25), axis=(0, 1))
    >>> solver = sc.ContactSolver([rod], [side], bolts=[bolt])
    >>> steps = [{"bolt": {"bolt 1": {"force": 10.0}}}, {"x": {"rod": {"top": (0, 0.05)}}}]
    >>> for result in solver.history(steps):
    ...     print(f"{result.bolts['bolt 1'].force:.9f}, {result.bolts['bolt 1'].stretch:.9f}")
    10.000000000, 0.500000000
    11.000000000, 0.500000000

    With the bolt drawn together the rod is strained alike all along:

    >>> u = result.stretched("rod")[basis.nodal_dofs[1]]
    >>> float((np.ptp(u) / 50).round(9))
    0.011
    """

    body: Body
    point: Array
    axis: Array
    name: str | None
    beyond: Mask

    def __init__(
        self, body: Body, *, point: ArrayLike, axis: ArrayLike, name: str | None = None
    ) -> None:
        check_name(name, "name of a Bolt")
        check_kind(body, Body, "body of a Bolt", "give the Body that the section cuts")
        whose = f"bolt {name!r}" if name else "a bolt"
        if body.components == 1:
            raise InputError(f"{whose} is of a body with a scalar field, which carries no force")
        if body.nonlinear:
            raise InputError(
                f"{whose} is in a body that is not linear, whose stiffness changes in every step; give "
                "the shank a sc.Body, or move the end of the bolt by prescribed displacements"
            )
        d = body.dim
        for what, value in (("point", point), ("axis", axis)):
            wanted = f"{d} finite coordinates"
            vars(self)[what] = sealed(finite(value, (d,), f"{what} of {whose}", wanted))
        way, length = self.axis, np.linalg.norm(self.axis)
        if length == 0 or (body.axisymmetric and way[0] != 0):
            along = "(0, 1), as the body is axisymmetric" if body.axisymmetric else "a direction"
            raise InputError(f"axis of {whose} is {shown(way)}; give {along}")
        vars(self).update(body=body, axis=sealed(way / length), name=name)
        vars(self)["beyond"] = sealed(_beyond(body, self.point, self.axis, whose))

    def __repr__(self) -> str:
        whose = self.body.name or "(no name)"
        return f"<Bolt {self.name or '(no name)'}: {whose} at {written(self.point)}>"

    @property
    def motions(self) -> Array:
        """Rigid motions of the nodes beyond the section: along the axes, then turns about `point`.

        Shape (n_body, k), of unit size per length and angle; of axisymmetric bodies the one along y.
        """
        body, d = self.body, self.body.dim
        shifts = np.eye(d)[body.dof_component] * self.beyond[:, None]
        if body.axisymmetric:
            return shifts[:, 1:]
        arm = body.dof_points - self.point
        planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
        turns = [shifts[:, j] * arm[:, i] - shifts[:, i] * arm[:, j] for i, j in planes]
        return np.column_stack([shifts, *turns])

    @property
    def slide(self) -> Array:
        """The nodes beyond the section moved by one along the axis, ``m``, shape (n_body,)."""
        return np.where(self.beyond, self.axis[self.body.dof_component], 0.0)


def _beyond(body: Body, point: Array, axis: Array, whose: str) -> Mask:
    """DOFs of the nodes beyond the section alone, (n_body,)."""
    mesh, elements = body.basis.mesh, body.basis.dofs.element_dofs
    upper = axis @ (mesh.p[:, mesh.t].mean(axis=1) - point[:, None]) > 0
    inner = np.flatnonzero(mesh.f2t[1] >= 0)
    a, b = mesh.f2t[:, inner]
    cut = inner[upper[a] != upper[b]]
    if not len(cut):
        raise InputError(
            f"the section of {whose} at {written(point)} across {written(axis)} passes between no "
            f"elements of {body!r}. Usually the point is outside of the body, or of another unit."
        )
    # of all that the plane passes through, what is connected to the facet next to the point
    corners = mesh.facets[:, cut]
    part = pieces(corners, mesh.p.shape[1])
    away = np.linalg.norm(mesh.p[:, corners].mean(axis=1) - point[:, None], axis=0)
    cut = cut[part[corners[0]] == part[corners[0, np.argmin(away)]]]
    nodes = mesh.p[:, np.unique(mesh.facets[:, cut])] - point[:, None]
    across = nodes - np.outer(axis, axis @ nodes)
    given = GIVEN * np.ptp(nodes)
    if (across.min(axis=1) > given).any() or (across.max(axis=1) < -given).any():
        raise InputError(
            f"the point {written(point)} of {whose} lies beside {body!r}, where its section passes. "
            "Usually it is that of another bolt, or of another unit; give one within the shank."
        )
    # sides of elements join them, but those of the section; DOFs of facets would leave corners out
    side = pieces(mesh.f2t[:, np.setdiff1d(inner, cut)], mesh.t.shape[1])
    a, b = mesh.f2t[:, cut]
    above, below = side[np.where(upper[a], a, b)], side[np.where(upper[a], b, a)]
    if np.intersect1d(above, below).size:
        raise InputError(
            f"the section of {whose} at {written(point)} does not cut {body!r} in two: its sides are "
            "connected elsewhere. Give the shank of the bolt as a body of its own, with its head, or a "
            "point where the plane cuts nothing but the shank."
        )
    mine = np.isin(side, above)
    beyond = np.zeros(body.n, dtype=bool)
    beyond[elements[:, mine]] = True
    beyond[elements[:, ~mine]] = False
    return beyond


@dataclass(frozen=True, eq=False)
class BoltValues(NamesAttributes):
    """Force, stretch and moments of a bolt after a load step.

    Attributes
    ----------
    name : str
    force : float
        Along the axis, positive in tension [force].
    stretch : float
        By how much the bolt is drawn shorter than it was made [length].
    shear : ndarray, shape (d,)
        Force across the axis on the part beyond the section [force].
    bending : float
        Moment about `Bolt.point` across the axis, its size; NaN if axisymmetric [force length].
    torsion : float
        Moment about the axis; zero in the plane [force length].

    Examples
    --------
    >>> import numpy as np
    >>> print(BoltValues("M8", 15e3, 0.02, np.zeros(3), 120.0, 0.0))
    M8: force 15000, stretch 0.02, bending 120
    """

    name: str
    force: float
    stretch: float
    shear: Array
    bending: float
    torsion: float

    def __str__(self) -> str:
        carried = f"force {self.force:.6g}, stretch {self.stretch:.6g}, bending {self.bending:.3g}"
        return f"{self.name}: {carried}"


class Bolts:
    """The bolts of a solver, with the stiffness of their bodies.

    Parameters
    ----------
    bolts : sequence of Bolt
    names : tuple of str
    system : System
    stiffness : sequence of csr_matrix
        Of each body, with its bolts locked.

    Attributes
    ----------
    pulls, slides : csr_matrix, shape (b, n)
        ``m' K``, the forces in the bolts by the displacements of all bodies [force/length], and ``m'``.
    k : ndarray, shape (b,)
        ``m' K m`` [force/length].
    """

    def __init__(
        self, bolts: Sequence[Bolt], names: tuple[str, ...], system: System, stiffness: Sequence[Any]
    ) -> None:
        self.bolts, self.names = tuple(bolts), names
        self._body = [system.index(bolt.body) for bolt in bolts]
        self._span = [system.slice(bolt.body) for bolt in bolts]
        rows = []
        for bolt, i, span in zip(bolts, self._body, self._span, strict=True):
            K, motion = stiffness[i], np.column_stack([bolt.slide, bolt.motions])
            forces = np.asarray(K @ motion)
            # but next to the section: products with round-off elsewhere would have no zeros
            forces[np.abs(forces) < COMPUTED * (abs(K) @ np.abs(motion))] = 0.0
            own = csr_matrix(np.column_stack([bolt.slide, forces]).T)
            placed = own.data, own.indices + span.start, own.indptr
            rows.append(csr_matrix(placed, shape=(own.shape[0], system.n)))
        none = csr_matrix((0, system.n))
        self.slides = vstack([none, *(some[:1] for some in rows)], format="csr")
        self.pulls = vstack([none, *(some[1:2] for some in rows)], format="csr")
        self._resisted = [some[2:] for some in rows]
        shared = (self.pulls @ self.slides.T).toarray()
        self.k = np.diagonal(shared).copy()
        for j, i in combinations(range(len(names)), 2):
            if abs(shared[j, i]) > SOLVED * self.k[i]:
                raise InputError(
                    f"the sections of bolts {names[j]!r} and {names[i]!r} share elements: move one of "
                    "them along its axis by a few elements"
                )

    def posed(self, case: LoadCase, shift: Array, force: Array, kept: Mask | None = None) -> LoadCase:
        """A load case with shifts, or forces where these are not NaN, in its load."""
        drawn = np.where(np.isnan(force), shift, (force + self.slides @ self.thermal(case)) / self.k)
        f = case.applied - self.pulls.T @ drawn
        return copied(case, f=f, bolts=BoltLoads(shift, force, case.applied, kept))

    def step(
        self, before: LoadCase, target: LoadCase, known: Callable[[], ByBolt]
    ) -> tuple[LoadCase, LoadCase]:
        """The loads before and after a step, `known` telling shift and force of bolts before it.

        It is not asked where the bolts are locked and stay so, as it takes all displacements.
        """
        locked = np.full(len(self.names), np.nan)
        asked = target.bolts or BoltLoads(locked, locked)
        given = asked.given
        if before.bolts is not None and not (given | before.bolts.given).any():
            shift, force = before.bolts.shift, locked
        else:
            found = known()
            shift, force = np.array([found.get(name, (0.0, 0.0)) for name in self.names]).T
        goal = np.where(given, np.nan, np.where(np.isnan(asked.shift), shift, asked.shift))
        begin = np.where(given, np.nan, shift), np.where(given, force, np.nan)
        kept = ~given & np.isnan(asked.shift)
        return self.posed(before, *begin), self.posed(target, goal, asked.force, kept)

    def loosened(self, given: Mask, stiffness: Sequence[Any]) -> dict[int, Any]:
        """The stiffness of the bodies whose bolts have a given force, by their number."""
        changed: dict[int, Any] = {}
        for b in np.flatnonzero(given):
            i, p = self._body[b], self.pulls[b, self._span[b]]
            changed[i] = changed.get(i, stiffness[i]) + csr_matrix(p.T @ p) * (-1.0 / self.k[b])
        return changed

    def found(self, case: LoadCase, u: Array) -> ByBolt:
        """Shift and force of each bolt from all displacements, (n,)."""
        held, pulled = case.bolts, self.pulls @ u - self.slides @ self.thermal(case)
        assert held is not None
        shift = np.where(held.given, (held.force - pulled) / self.k, held.shift)
        both = zip(shift.tolist(), (pulled + self.k * shift).tolist(), strict=True)
        return dict(zip(self.names, both, strict=True))

    def thermal(self, case: LoadCase) -> Array:
        """The loads of temperatures on bodies with bolts, (n,) [force]."""
        loads = np.zeros(self.slides.shape[1])
        for i, span in zip(self._body, self._span, strict=True):
            loads[span] = case.apart[i][: span.stop - span.start] if i in case.apart else 0.0
        return loads

    def stretched(self, u: Array, known: ByBolt) -> Array:
        """All displacements (n,) that have the strains of bodies: with the bolts drawn together."""
        return np.asarray(u + self.slides.T @ np.array([known[name][0] for name in self.names]))

    def values(self, case: LoadCase, u: Array, known: ByBolt) -> dict[str, BoltValues]:
        """Return what each bolt carries, from all displacements (n,)."""
        out, drawn = {}, self.stretched(u, known)
        each = zip(self.names, self.bolts, self._body, self._resisted, strict=True)
        for name, bolt, i, rows in each:
            d, axis, (shift, force) = bolt.body.dim, bolt.axis, known[name]
            if bolt.body.axisymmetric:
                out[name] = BoltValues(name, force, shift, np.zeros(d), np.nan, 0.0)
                continue
            load = rows @ drawn
            load[np.abs(load) < COMPUTED * (abs(rows) @ np.abs(drawn))] = 0.0
            if i in case.apart:
                load = load - bolt.motions.T @ case.apart[i][: bolt.body.n]
            across, moment = load[:d] - axis * (axis @ load[:d]), load[d:]
            torsion = float(axis @ moment) if d == 3 else 0.0
            bending = float(np.linalg.norm(moment - torsion * axis if d == 3 else moment))
            out[name] = BoltValues(name, force, shift, sealed(across), bending, torsion)
        return out


def bolted(system: System, bolts: Any) -> tuple[System, tuple[Bolt, ...], tuple[str, ...]]:
    """The bodies with what bolts let them do, the bolts that a user means, and their names."""
    found = tuple(members(bolts, Bolt, "bolts", "make each by Bolt(body, point=..., axis=...)"))
    names = names_of(found, "bolt", "bolts")
    slides: dict[int, tuple[Array, tuple[str, ...]]] = {}
    for bolt, name in zip(found, names, strict=True):
        i = system.index(bolt.body)
        modes, words = slides.get(i, (np.zeros((bolt.body.n, 0)), ()))
        slides[i] = np.column_stack([modes, bolt.slide]), (*words, f"stretch of {name!r}")
    return copied(system, slides=slides) if found else system, found, names
