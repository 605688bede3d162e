r"""The positions of the contact points: a pairing that stays for small sliding, and follows for finite.

With small sliding the pairing of the undeformed bodies serves for ever. With finite sliding it is
renewed at the displacements of an iterate, for the whole contact problem at once, and the load step
is solved again until the two agree; the bodies themselves are not touched. At a placement ``u_k``

    gap   g = g(u_k) + B_n (u - u_k),        slip  s = s_n + B_t (u - u_n),

with ``u_n, s_n`` the end of the last load step. What friction remembers, ``s_n`` and ``tau_n``, are
vectors that are brought into the tangent plane of the new pairing with their length
(`state.transport`), so that the history turns with the point; and since the normals of a surface are
interpolated along it, a node passes from one facet to the next without a jump of its frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags, identity, kron

from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.checks import (
    check_pairing,
    check_side,
    warn_bridged,
    warn_measures,
    warn_redundant_glue,
)
from skfem_contact.conditions.contact import Contact, field_values
from skfem_contact.conditions.discretisation import pair
from skfem_contact.conditions.interface import Identity, contact_names, point_slices
from skfem_contact.conditions.kinematics import (
    Kinematics,
    initial_gap,
    join,
    kinematics,
    prescribed_rows,
)
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.rows import as_motion
from skfem_contact.conditions.state import OPEN, LoadCase, LocalState, Motion, swept, transport
from skfem_contact.digits import GIVEN
from skfem_contact.obstacles.obstacle import Obstacle, spin_rate
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.pairing.node import Pairing


class Geometry:
    """Pairs all contacts, and pairs those that slide again where the bodies have moved."""

    def __init__(self, system: System, contacts: Sequence[Contact]) -> None:
        self.system, self.contacts = system, tuple(contacts)
        self.point_slices = point_slices(contacts)
        warn_measures(self.contacts)
        self.pairings: list[Pairing] = [pair(contact) for contact in contacts]
        for contact, pairing in zip(contacts, self.pairings, strict=True):
            check_pairing(contact, pairing, undeformed=True)
            check_side(contact, pairing)
            warn_redundant_glue(contact, pairing)
            warn_bridged(contact, pairing)
        self._first = [
            kinematics(system, contact, pairing)
            for contact, pairing in zip(contacts, self.pairings, strict=True)
        ]
        self.kin = join(self._first)
        # those of the contacts themselves, [length]; asked for once: functions may stay behind
        self.interference = [
            field_values(
                contact.interference, contact.secondary.points, f"interference of contact '{name}'"
            )
            for contact, name in zip(contacts, contact_names(self.contacts), strict=True)
        ]
        counts = [part.m for part in self._first]
        self.finite = np.repeat([contact.sliding == "finite" for contact in contacts], counts)
        self.follows = bool(self.finite.any())  # whether any contact slides far
        # points that meet the same wherever they slide to: a plane; and those that do not
        self.on_plane = np.repeat([_on_plane(contact) for contact in contacts], counts)
        self.changing = self.finite & ~self.on_plane
        stretches = [getattr(contact.secondary.body, "finite_strain", False) for contact in contacts]
        self.stretches = self.finite & np.repeat(stretches, counts)  # points whose areas change
        self.surface_dofs = surface_dofs(system, contacts)
        # points of the undeformed bodies whose gap is prescribed, (m,)
        self.prescribed = self.kin.paired & prescribed_rows(self.kin.B_n, system.D)
        # places of the points in an order that their positions and normals make, and not that in which
        # bodies, contacts and nodes were given, (m,)
        order = np.lexsort(np.column_stack([self.kin.normal, self.kin.points]).T)
        self.rank = np.empty_like(order)
        self.rank[order] = np.arange(len(order))

    @cached_property
    def identity(self) -> Identity:
        """The identity of the problem, which a state has to share."""
        return Identity.of(self.system, self.contacts)

    def __getstate__(self) -> dict[str, Any]:
        if self.follows:
            self._offsets  # noqa: B018 (of given gaps, whose functions may stay behind)
        return dict(vars(self))

    def with_laws(self, contacts: Sequence[Contact]) -> Geometry:
        """The same pairings under other friction laws.

        Itself, unless friction has or had a direction, which the axes of the slips are made of.
        """
        directed = [
            any(isinstance(c.friction, OrthotropicCoulomb) for c in both)
            for both in zip(self.contacts, contacts, strict=True)
        ]
        if not any(directed):
            return self
        twin = copy(self)
        twin.contacts = tuple(contacts)
        twin._first = [
            kinematics(self.system, contact, pairing, first.gap0) if other else first
            for contact, pairing, first, other in zip(
                contacts, self.pairings, self._first, directed, strict=True
            )
        ]
        twin.kin = join(twin._first)
        return twin

    def at(self, u: Array, case: LoadCase, before: Kinematics | None = None) -> Kinematics:
        """Gaps, rows and frames at displacements u of the surfaces, shape (n,).

        Vertices that carried on the pairing `before` go on to do so: where a round would take them
        and the next leave them none is that of its own answer.
        """
        parts = []
        for i, contact in enumerate(self.contacts):
            if contact.sliding == "small":
                parts.append(self._first[i])
                continue
            moved = [u[self.system.slice(contact.secondary.body)]]
            primary = contact.primary
            if isinstance(primary, ContactSurface):
                moved.append(u[self.system.slice(primary.body)])
            known = before.corners[i] if before else frozenset()
            tool, motion, about = contact.rigid_body, None, None
            if tool is not None:
                motion = as_motion(self.system, tool, u)
                about = motion[0]
            elif len(moved) == 1:
                motion = case.motion[i].as_argument()
            pairing = pair(contact, moved=moved, motion=motion, known=known)
            check_pairing(contact, pairing)
            gap = pairing.gap + self._offsets[i] - case.interference[self.point_slices[i]]
            kin = kinematics(self.system, contact, pairing, gap, about)
            parts.append(replace(kin, corners=(pairing.corners | known,)))
        return join(parts)

    def _torn(self, i: int, kin: Kinematics, u: Array, case: LoadCase) -> Array:
        """How far glued points are from where an obstacle has carried them, along its face, (m, d-1).

        From the start: sums of slips would lead away from there, turn by turn.
        """
        first, tool = self.pairings[i], self.contacts[i].rigid_body
        motion = case.motion[i] if tool is None else Motion(*as_motion(self.system, tool, u))
        moved, axes = self._points_moved(i, u), kin.axes[self.point_slices[i]]
        return np.einsum("ikd,id->ik", axes, moved - motion.shift(first.action))

    @cached_property
    def _offsets(self) -> list[Array]:
        """For each contact, where one slides far."""
        return [self._offset(i) for i in range(len(self.contacts))]

    def _offset(self, i: int) -> Array:
        """Return what a given or adjusted gap adds to the measured one, without interference."""
        contact, first = self.contacts[i], self.pairings[i]
        given = initial_gap(contact, first, 0.0)
        both = np.isfinite(given) & np.isfinite(first.gap)
        return np.where(both, given - np.where(both, first.gap, 0.0), 0.0)

    def case(
        self, kin: Kinematics, u: Array, case: LoadCase, last: LocalState, before: LoadCase
    ) -> LoadCase:
        """Initial gaps and slips of a load case, seen from the pairing at displacements u."""
        if not self.follows:
            return case
        finite = self.finite
        gap0 = np.where(finite, kin.gap0 - kin.B_n @ u, case.gap0)
        u_n = self.spread(last.surface)
        slip0 = last.slip - (kin.B_t @ u_n).reshape(last.slip.shape)
        for i, part in enumerate(self.point_slices):
            if self.contacts[i].rigid and self.contacts[i].tied:
                rows = slice(part.start * kin.tangents, part.stop * kin.tangents)
                torn = self._torn(i, kin, u, case)
                slip0[part] = torn - (kin.B_t[rows] @ u).reshape(torn.shape)
            elif self.contacts[i].rigid:
                at = kin.action[part]
                halfway = at - 0.5 * self._points_moved(i, u - u_n)
                tool = self.contacts[i].rigid_body
                if tool is None:
                    step = case.motion[i].slid(before.motion[i], halfway)
                else:
                    old, new = (Motion(*as_motion(self.system, tool, v)) for v in (u_n, u))
                    step = _beyond_rows(old, new, at, halfway)
                slip0[part] -= np.einsum("ikd,id->ik", kin.axes[part], step)
        slip0 = np.where(finite[:, None], slip0, case.slip0)
        return replace(case, gap0=gap0, slip0=slip0)

    def _points_moved(self, i: int, u: Array) -> Array:
        """Displacements (m, d) of the points of the secondary, by those of all DOFs (n,)."""
        side = self.contacts[i].secondary
        moved = self.pairings[i].secondary_weights @ u[self.system.slice(side.body)][side.dofs]
        return np.asarray(moved)

    def turned(self, at: Array, u: Array) -> tuple[Array, float]:
        """Displacements u (n,) with rigid bodies turned as rows mean it; how much that differs [rad].

        In space rows take the spin beyond their pairing, made `at` other displacements (n,), for the
        change of the rotation vector. Nothing differs where the pairing is that of the answer.
        """
        out = np.array(u)
        for body in {c.rigid_body for c in self.contacts if c.sliding == "finite"}:
            if body is None or body.dim == 2:
                continue
            free = np.setdiff1d(body.rotations, body.D)
            if not len(free):
                continue
            own, scale = self.system.slice(body), self.system.scale(body)
            old, new = (v[own] / scale for v in (at, u))
            k = free - body.rotations[0]
            rate = spin_rate(old[body.rotations])[np.ix_(k, k)]
            new[free] = old[free] + np.linalg.lstsq(rate, (new - old)[free], rcond=GIVEN)[0]
            out[own] = scale * new
        return out, float(np.max(np.abs(out - u), initial=0.0)) / self.system.extent

    def slip(
        self, kin: Kinematics, seen: LoadCase, surface: Array, slip: Array, modelled: Mask
    ) -> Array:
        """Slips (m, d-1), also of points that slide far without friction: no unknown is theirs."""
        missing = self.finite & ~modelled
        if not missing.any():
            return slip
        moved = (kin.B_t @ self.spread(surface)).reshape(slip.shape)
        return np.where(missing[:, None], seen.slip0 + moved, slip)

    def spread(self, surface: Array) -> Array:
        """Displacements of the surfaces in a vector over all DOFs."""
        u = np.zeros(self.system.n)
        u[self.surface_dofs] = surface
        return u

    def predicted(self, surface: Array, case: LoadCase) -> Array:
        """The same at the beginning of a load step: rigid bodies are where they are told to be."""
        u = self.spread(surface)
        for body in {c.rigid_body for c in self.contacts if c.rigid_body is not None}:
            dofs = self.system.slice(body).start + body.D
            u[dofs] = case.x[dofs]
        return u

    def mismatch(
        self, old: Kinematics, new: Kinematics, state: LocalState, barred: Mask | None = None
    ) -> float:
        """Measure how far the contact conditions on a pairing are from those at its own answer.

        The largest of the gaps of closed points and the overlaps of open ones, over the extent of
        the bodies, and the change of the contact forces' distribution over the largest of them.
        Points that are left out may overlap.
        """
        closed = (state.status != OPEN) & self.finite
        if not (closed | self.finite & new.paired).any():
            return 0.0
        # where supports hold both bodies no pairing mends an overlap; it is warned of
        judged = self.finite & new.paired & ~new.tied
        if barred is not None:
            judged &= ~barred
        if judged.any():
            judged &= ~prescribed_rows(new.B_n, self.system.D)
        gap = np.where(judged, _wrong_gaps(new, closed), 0.0)
        normal = state.normal_force
        change = self._on_surfaces(new.B_n, normal) - self._on_surfaces(old.B_n, normal)
        if state.tangential_force.any():
            before, after = _along_both(old, new, state.tangential_force)
            change -= self._on_surfaces(new.B_t, after) - self._on_surfaces(old.B_t, before)
        scale = np.max(np.abs(state.normal_force), initial=0.0)
        moved = np.max(np.abs(change), initial=0.0) / scale if scale > 0 else 0.0
        return float(np.maximum(np.max(gap, initial=0.0) / self.system.extent, moved))

    def stretched(self, old: Kinematics, new: Kinematics, state: LocalState) -> Array:
        """Change of areas that bodies of finite strain bear forces on, by the largest force, (m,)."""
        force = np.where(self.stretches & (new.area > 0), np.abs(state.normal_force), 0.0)
        change = force * np.abs(1.0 - old.area / np.where(force > 0, new.area, 1.0))
        return np.asarray(change / np.max(force, initial=np.finfo(float).tiny))

    def _on_surfaces(self, B: csr_matrix, forces: Array) -> Array:
        """Forces along rows as those on the DOFs of surfaces that slide far, ``B' forces``.

        Without the other DOFs, whose rows stay what they are: of many bodies they are nearly all.
        """
        place, value = self._places[B.indices], B.data * np.repeat(forces.ravel(), np.diff(B.indptr))
        return np.asarray(np.bincount(place, value, len(self.surface_dofs) + 1)[:-1], dtype=np.float64)

    @cached_property
    def _places(self) -> Index:
        """Of each DOF among `surface_dofs`; one more for all others, (n,)."""
        place = np.full(self.system.n, len(self.surface_dofs))
        place[self.surface_dofs] = np.arange(len(self.surface_dofs))
        return place

    def least_settled(self, old: Kinematics, new: Kinematics, state: LocalState) -> int:
        """The point that makes most of the `mismatch`: by its gap, or by where its force goes."""
        closed = state.status != OPEN
        wrong = _wrong_gaps(new, closed) / self.system.extent
        wrong = np.where(self.finite & new.paired & old.paired, wrong, 0.0)
        forces = np.column_stack([state.normal_force, state.tangential_force])
        scale = np.max(np.abs(forces), initial=np.finfo(float).tiny)
        moved = _largest(diags(state.normal_force) @ (new.B_n - old.B_n))
        if state.tangential_force.any():  # without friction nobody has made these rows
            before, after = _along_both(old, new, state.tangential_force)
            rows = diags(after.ravel()) @ new.B_t - diags(before.ravel()) @ old.B_t
            moved = moved + _largest(kron(identity(old.m), np.ones((1, old.tangents))) @ rows)
        moved = moved / scale
        return int(np.argmax(np.maximum(wrong, moved)))


def _on_plane(contact: Contact) -> bool:
    """Return whether a contact is with a plane that no rigid body carries."""
    bend = contact.primary.bend if isinstance(contact.primary, Obstacle) else None
    return bend is not None and not bend.any() and contact.rigid_body is None


def _wrong_gaps(kin: Kinematics, closed: Mask) -> Array:
    """Gaps of closed points and overlaps of open ones, (m,) [length].

    An open point may lie in the other body: on the pairing that was solved it was elsewhere.
    """
    return np.where(closed, np.abs(kin.gap0), np.maximum(-kin.gap0, 0.0))


def _along_both(old: Kinematics, new: Kinematics, forces: Array) -> tuple[Array, Array]:
    """Components of friction forces (m, d-1) on the one pairing, and on the other.

    In the plane they are the same. In space axes may be another choice on the new pairing.
    """
    if old.tangents < 2 or np.array_equal(old.axes, new.axes):
        return forces, forces
    vectors = np.einsum("ik,ikd->id", forces, old.axes)
    turned = transport(vectors, old.normal, new.normal)
    return forces, np.einsum("id,ikd->ik", turned, new.duals)


def _largest(rows: Any) -> Array:
    """The largest entry of every row of a sparse matrix."""
    return np.asarray(abs(csr_matrix(rows)).max(axis=1).toarray()).ravel()


def surface_dofs(system: System, contacts: Sequence[Contact]) -> Index:
    """DOFs (stacked) of the surfaces of contacts that slide far."""
    dofs = [np.zeros(0, dtype=int)]
    for contact in contacts:
        if contact.sliding == "small":
            continue
        for surface in (contact.secondary, contact.primary):
            if isinstance(surface, ContactSurface):
                dofs.append(system.slice(surface.body).start + surface.dofs.ravel())
            elif isinstance(surface, RigidBody):
                dofs.append(np.arange(system.n)[system.slice(surface)])
    return np.unique(np.concatenate(dofs))


def secondary_dofs(system: System, contacts: Sequence[Contact]) -> Mask:
    """Mask of the DOFs on the secondary surfaces, shape (n,)."""
    mask = np.zeros(system.n, dtype=bool)
    for contact in contacts:
        surface = contact.secondary
        mask[system.offsets[system.index(surface.body)] + surface.dofs] = True
    return mask


def _beyond_rows(old: Motion, new: Motion, points: Array, halfway: Array) -> Array:
    """Return how far a rigid body has moved points (m, d) along itself beyond the rows, (m, d).

    These know the arms of the end, and take the spin in space for the change of the rotation vector,
    which it is about a fixed axis.
    """
    by_rows = swept(new.angle - old.angle, points - new.centre - new.translation)
    return new.slid(old, halfway) - (new.translation - old.translation) - by_rows
