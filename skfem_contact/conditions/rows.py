r"""Rows over the DOFs: gaps and slips of contact points as sums over both sides.

Each side gives ``sign direction . (W u_surface)`` with the weights W of a `Pairing`, a rigid body the
rows of its `Lever`; where supports hold a point, its row has only what they prescribe.

Slips are taken along axes: unit tangents, scaled where friction has a material direction, see
`orthotropic`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, diags

from skfem_contact.arrays import Array, Index, Mask, assembled, cross, entries
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.digits import GIVEN
from skfem_contact.obstacles.rigid_body import RigidBody
from skfem_contact.pairing.dual import MOVING_SHARE, held_rows
from skfem_contact.pairing.node import Pairing
from skfem_contact.records import dataclass


@dataclass(frozen=True, eq=False)
class Lever:
    r"""The rigid side of a contact: a point moves by ``v + w x r``.

    Attributes
    ----------
    body : RigidBody
    arm : ndarray, shape (m, d)
        ``r``, from the body's point, where that is now, to the contact points on the obstacle [length].
    start : int
        First DOF of the body in the numbering of the system.
    scale : float
        What rotations are multiplied by in it, `System.scale` [length].
    """

    body: RigidBody
    arm: Array
    start: int
    scale: float

    @classmethod
    def of(
        cls, system: System, contact: Contact, pairing: Pairing, moved: Array | None = None
    ) -> Lever | None:
        """Make the lever of a contact; None where its primary is no rigid body.

        Parameters
        ----------
        system : System
        contact : Contact
        pairing : Pairing
        moved : ndarray, shape (d,), optional
            Translation of the body where the pairing was made [length].
        """
        body = contact.rigid_body
        if body is None:
            return None
        at = pairing.action
        if not contact.bilateral:  # glue holds the points where they are
            gap = np.where(pairing.paired, pairing.gap, 0.0)
            at = at - gap[:, None] * pairing.normal
        about = body.about if moved is None else body.about + moved
        return cls(body, at - about, int(system.slice(body).start), system.extent)

    def rows(self, direction: Array) -> Array:
        """Displacements of the points along directions (m, d) by each DOF, shape (m, n_body)."""
        return np.concatenate([direction, cross(self.arm, direction) / self.scale], axis=1)

    def entries(self, direction: Array, paired: Mask, held: Mask) -> tuple[Array, Index, Index]:
        """Values, rows and columns of ``-direction . (v + w x r)`` for matrices of the system.

        Of rows that are `held` only what is prescribed.
        """
        values = -self.rows(direction)
        free = np.ones(self.body.n, dtype=bool)
        free[self.body.D] = False
        values[np.ix_(held, free)] = 0.0
        some = np.flatnonzero(paired)
        columns = np.tile(np.arange(self.start, self.start + self.body.n), len(some))
        rows: Index = np.repeat(some, self.body.n)
        return np.asarray(values[some].ravel()), rows, columns

    def free(self, direction: Array) -> tuple[Array, Array]:
        """Size of the rows along directions (m, d), of what supports leave free and of all, (m,)."""
        size = np.abs(self.rows(direction))
        return np.delete(size, self.body.D, axis=1).sum(axis=1), size.sum(axis=1)

    def holds(self, direction: Array) -> Mask:
        """Return whether its supports keep points from moving along directions (m, d), shape (m,)."""
        free, size = self.free(direction)
        return np.asarray(free < MOVING_SHARE * size)


def as_motion(system: System, body: RigidBody, u: Array) -> tuple[Array, Any, Array]:
    """Return a rigid body's position at displacements u of the system (n,), as obstacles take it."""
    own: Array = u[system.slice(body)] / system.scale(body)
    return body.motion(own)


#: Weights, surface and sign of one side of a contact.
Side = tuple[csr_matrix, ContactSurface, float]


@dataclass(frozen=True, eq=False)
class Sides:
    """The two sides that the rows of a contact are sums over.

    Attributes
    ----------
    system : System
    contact : Contact
    pairing : Pairing
    weighed : list of Side
        Both surfaces; a rigid obstacle is none.
    bulge : bsr_matrix or None
        `Pairing.primary_bulge`: blocks that add vectors of the primary's displacements.
    lever : Lever or None
        A rigid body on the primary side.
    """

    system: System
    contact: Contact
    pairing: Pairing
    weighed: list[Side]
    bulge: bsr_matrix | None
    lever: Lever | None

    @classmethod
    def of(
        cls, system: System, contact: Contact, pairing: Pairing, moved: Array | None = None
    ) -> Sides:
        """Make the sides of the gaps; `moved` is the translation of a rigid body, see `Lever.of`."""
        weights = pairing.secondary_weights, pairing.primary_weights
        scalar = contact.secondary.dofs.shape[1] == 1
        bulge = None if contact.rigid or scalar else pairing.primary_bulge
        lever = Lever.of(system, contact, pairing, moved)
        return cls(system, contact, pairing, _weighed(contact, *weights), bulge, lever)

    def of_slip(self, still: Mask) -> Sides:
        """Make the sides of the slips along one tangent: other weights where supports make the slip."""
        pairing, bulge = self.pairing, self.bulge
        if pairing.slip_weights is None:
            weighed = self.weighed
        else:
            own, others = diags(still.astype(float)), diags((~still).astype(float))
            weights = pairing.secondary_weights, pairing.primary_weights
            both = zip(weights, pairing.slip_weights, strict=True)
            mixed = (csr_matrix(others @ W + own @ slip) for W, slip in both)
            weighed = _weighed(self.contact, *mixed)
        if bulge is not None and still.any():  # rows of node-to-segment contact stand on the nodes
            bulge = bulge.copy()
            bulge.data[still[block_places(bulge)[0]]] = 0.0
        return replace(self, weighed=weighed, bulge=bulge)

    def held(self, direction: Array, glued: bool) -> Mask:
        """Rows that supports hold. Not of glue: its gap is zero, and its rows agree with supports."""
        if glued:
            return np.zeros(len(direction), dtype=bool)
        held = held_rows(self.weighed, direction)
        return held if self.lever is None else held & self.lever.holds(direction)

    def prescribed(self, along: Array) -> Mask:
        """Slips along tangents (m, d) that supports alone prescribe, shape (m,). Not of glue, as above.

        Nodes that are driven along a slope are left free across their way. On a rigid obstacle friction
        works on that part of the slip, however little: uphill it is what pushes them off. Two bodies
        that are held alike meet on a plane of symmetry, across which there is no shear.
        """
        held = self.held(along, self.contact.tied)
        if not held.any() or len(self.weighed) > 1:
            return held
        free, size = np.zeros((2, len(held))) if self.lever is None else self.lever.free(along)
        ((weights, surface, _),) = self.weighed
        row, node, weight = entries(weights)
        part = np.abs(weight[:, None] * along[row])
        size = size + np.bincount(row, part.sum(axis=1), len(held))
        free = free + np.bincount(row, (part * ~surface.held[node]).sum(axis=1), len(held))
        return held & (self.held(self.pairing.normal, False) | (free <= GIVEN * size))

    def rows(self, direction: Array, held: Mask) -> csr_matrix:
        """Sum over the sides of ``sign direction . (W u_surface)``, zero where a point is not paired.

        Of rows that are `held` only what is prescribed is left: so no route closes them, and checks of
        prescribed values see them.
        """
        found, given, paired, system = [], [], np.array(self.pairing.paired), self.system
        for weights, surface, sign in self.weighed:
            row, node, value = entries(weights)
            given.append((surface, row, node, (sign * value)[:, None] * direction[row]))
        if self.bulge is not None:
            row, node = block_places(self.bulge)
            coefficients = (direction[row][:, None] @ self.bulge.data)[:, 0]
            given.append((self.weighed[1][1], row, node, coefficients))
        for surface, row, node, coefficients in given:
            keep = paired[row]
            row, node, coefficients = row[keep], node[keep], coefficients[keep]
            columns = system.offsets[system.index(surface.body)] + surface.dofs[node]
            rows = np.repeat(row, surface.dofs.shape[1])
            if held.any():
                coefficients[held[row][:, None] & ~surface.held[node]] = 0.0
            found.append((coefficients.ravel(), rows, columns.ravel()))
        if self.lever is not None:
            found.append(self.lever.entries(direction, paired, held))
        data, rows, columns = (np.concatenate(part) for part in zip(*found, strict=True))
        spread = assembled((rows, columns), data, (len(paired), system.n))
        spread.eliminate_zeros()
        return spread


def block_places(blocks: bsr_matrix) -> tuple[Index, Index]:
    """Rows and columns of all blocks."""
    return np.repeat(np.arange(len(blocks.indptr) - 1), np.diff(blocks.indptr)), blocks.indices


def _weighed(contact: Contact, secondary: csr_matrix, primary: csr_matrix) -> list[Side]:
    """Weights, surface and sign of either side; a rigid obstacle has none."""
    sides = [(secondary, contact.secondary, 1.0)]
    if isinstance(contact.primary, ContactSurface):
        sides.append((primary, contact.primary, -1.0))
    return sides


def tangential_rows(
    sides: Sequence[Sides], n: int, tangent: Array, still: Mask, A: Array | None = None
) -> csr_matrix:
    """Rows of the slips along all tangents (m, d-1, d), point by point; none for scalar problems.

    With `A` along the combinations of them that friction with a material direction takes, (m, 2, 2).
    """
    blocks = []
    for own, along, at_rest in zip(sides, np.moveaxis(tangent, 1, 0), still.T, strict=True):
        blocks.append(own.rows(along, at_rest | own.prescribed(along)))
    if not blocks:
        return csr_matrix((0, n))
    rows = _interleave(blocks)
    return rows if A is None else combined_rows(A, rows)


def with_free_part(
    tangential: Callable[[], csr_matrix], B_n: csr_matrix, leaning: Array, left: Array
) -> csr_matrix:
    """Tangential rows (m, n) in 2-D; of points that supports guide with what is free, too.

    Along what is free, gap and slip of such a point are multiples of each other, `leaning` (m,); of the
    rows of what is prescribed a part is `left`, (m,). Both balance by themselves.
    """
    return csr_matrix(diags(left) @ tangential() + diags(leaning) @ B_n)


def stacked_rows(blocks: Sequence[csr_matrix]) -> csr_matrix:
    """Rows of several matrices one after the other; of a single one itself."""
    if len(blocks) == 1:
        return blocks[0]
    data, columns, sizes = (
        np.concatenate(parts)
        for parts in zip(*((B.data, B.indices, np.diff(B.indptr)) for B in blocks), strict=True)
    )
    start = np.concatenate([[0], np.cumsum(sizes)])
    return csr_matrix((data, columns, start), shape=(len(sizes), blocks[0].shape[1]))


def _interleave(blocks: Sequence[csr_matrix]) -> csr_matrix:
    """Rows of several tangents in the order point by point."""
    if len(blocks) == 1:
        return blocks[0]
    m, k = blocks[0].shape[0], len(blocks)
    order = np.arange(m * k).reshape(k, m).T.ravel()
    return csr_matrix(stacked_rows(blocks)[order])


def compliance_scale(B: csr_matrix, diagonal: Array) -> Array:
    """Stiffness of each row as seen by K's diagonal, ``1 / sum(B_ij^2 / K_jj)`` [force/length].

    The softer side decides, so that one multiple of it suits any pair of bodies.
    """
    inverse = np.where(diagonal > 0, 1.0 / np.where(diagonal > 0, diagonal, 1.0), 0.0)
    total = np.asarray((B.multiply(B) @ diags(inverse)).sum(axis=1)).ravel()
    return np.divide(1.0, total, out=np.zeros_like(total), where=total > 0)


def tangential_matrix(B_t: csr_matrix, spring: Array) -> csr_matrix:
    r"""Sum of the tangential contact elements of all points, ``K_t = B_t' diag(G) B_t``.

    Parameters
    ----------
    B_t : sparse matrix, shape (m (d-1), n)
        Each row is ``v = [t, -N_1 t, -N_2 t, ...]`` over the DOFs of a secondary node and of its
        partners, with the tangent `t` and the weights `N` of the primary nodes.
    spring : ndarray, shape (m, d-1, d-1)
        Tangential stiffness of each point; zero where there is none [force/length].

    Notes
    -----
    ``G v v'`` is the second derivative of the energy ``G s^2 / 2`` of [M] eq. (6). The printed 6 x 6
    matrix has its diagonal factor on the wrong side and is not symmetric; this is the one that the
    energy gives. The weights sum to one, so a common translation costs nothing.

    Examples
    --------
    A secondary node over the middle of a horizontal facet:

    >>> import numpy as np
    >>> row = csr_matrix([[1.0, 0.0, -0.5, 0.0, -0.5, 0.0]])
    >>> K_t = tangential_matrix(row, np.array([[[4.0]]])).toarray()
    >>> K_t[0]
    array([ 4.,  0., -2.,  0., -2.,  0.])
    >>> np.allclose(K_t @ np.tile([1.0, 0.0], 3), 0.0)
    True
    """
    m, t = spring.shape[:2]
    if t == 1:
        G = diags(spring[:, 0, 0])
    else:
        G = bsr_matrix((spring, np.arange(m), np.arange(m + 1)), shape=(m * t, m * t)).tocsr()
    return csr_matrix(B_t.T @ (G @ B_t))


def combined_rows(A: Array, rows: csr_matrix) -> csr_matrix:
    """Combinations (m, k, t) of the rows of each point, of a matrix (m t, n), as rows (m k, n)."""
    m = len(A)
    out = csr_matrix(bsr_matrix((A, np.arange(m), np.arange(m + 1))) @ rows)
    out.sum_duplicates()
    out.eliminate_zeros()
    return out
