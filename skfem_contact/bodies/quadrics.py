r"""Osculating quadrics: the smooth boundary that the nodes of a surface lie on, as far as they tell.

A mesh knows a curved boundary by its nodes. Round each of them one quadric passes through it and, in
the mean of least squares, through the nodes of its ring (`rings`),

    f_k(x) = n_k . d + d' K_k d / 2 = 0,      d = x - x_k,      K_k = T' k T + kappa n n',

with the tangents T, the curvatures k, positive where the boundary is convex, and kappa, the principal
one of larger size. With it spheres and cylinders are met exactly by any mesh, and in the plane the
quadric is the circle through three nodes. Over a facet they are blended by its shape functions,

    f(x) = sum_k N_k f_k(x) = 0 :

at the nodes this is the boundary's own point, and in between it is off by the third power of the size
of the facet. At sharp edges and kinks (`normal_field`) a node has no quadric: rings do not go beyond
it, and the others are blended without it, whereby flats stay flat and fillets are exact.

A second-order facet that is straight has the quadrics of its corners, blended by the linear functions;
a curved one those of all its nodes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from skfem_contact.arrays import Array, Index, Mask, cross, runs, tangents
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.normal_field import BENT
from skfem_contact.digits import COMPUTED, GIVEN, NEWTON_STEPS, ROUND_OFF, SOLVED
from skfem_contact.records import dataclass

# Neighbours that a quadric is fitted to, at least; where a node has less, theirs count, too. In the
# plane these two tell all; in space five numbers are sought, and six nodes round one may lie on a cone.
ENOUGH = {2: 2, 3: 7}


@dataclass(frozen=True, eq=False)
class Quadrics:
    """The quadrics of the nodes of an undeformed surface, summed up facet by facet.

    Attributes
    ----------
    normal : ndarray, shape (m, d)
        Outward unit normals of the quadrics at their nodes.
    tensor : ndarray, shape (m, d, d)
        K of each [1/length].
    known : ndarray of bool, shape (m,)
        Nodes that have a quadric.
    bowed : ndarray of bool, shape (nf,)
        Facets that are curved themselves.
    curved : ndarray of bool, shape (nf,)
        Facets that the smooth boundary leaves between their nodes.
    """

    normal: Array
    tensor: Array
    known: Mask
    bowed: Mask
    curved: Mask

    @classmethod
    def of(
        cls, points: Array, facets: Index, kind: FacetKind, normals: Array, ends: Mask, mirrored: Mask
    ) -> Quadrics:
        """Fit the quadrics of a surface.

        Parameters
        ----------
        points : ndarray, shape (m, d)
        facets : ndarray of int, shape (nf, k)
        kind : FacetKind
        normals : ndarray, shape (m, d)
            To start from: averaged over the facets at each node.
        ends : ndarray of bool, shape (m,)
            Nodes at sharp edges and kinks.
        mirrored : ndarray of bool, shape (m, d)
            Components across which the surface goes on as its mirror image at a node.
        """
        m, d = points.shape
        bowed = bowed_facets(points, facets, kind)
        used = np.zeros(m, dtype=bool)
        used[facets[:, : kind.corners]] = True
        used[facets[bowed]] = True
        normal, tensor, known = normals.copy(), np.zeros((m, d, d)), used & ~ends
        chosen = np.flatnonzero(known)
        away, there = rings(points, around(facets, kind, bowed, m), ~ends, mirrored, chosen)
        rise = np.abs(np.einsum("qrd,qd->qr", away, normals[chosen])).max(axis=1, initial=0.0)
        size = np.abs(away).max(axis=(1, 2), initial=0.0)
        some = np.flatnonzero(rise > COMPUTED * size)
        for run in runs(len(some), 4000):  # what a fit of one node takes, about
            part = some[run]
            at = chosen[part]
            normal[at], tensor[at], known[at] = fitted(normals[at], away[part], there[part])
        bent = np.zeros(m, dtype=bool)
        bent[chosen[some]] = True
        curved = np.any((bent & known)[facets], axis=1)
        return cls(normal, tensor, known, bowed, curved)


def bowed_facets(points: Array, facets: Index, kind: FacetKind) -> Mask:
    """Facets whose middle nodes are off the straight or bilinear facet through the corners, (nf,)."""
    if not kind.quadratic:
        return np.zeros(len(facets), dtype=bool)
    x = points[facets]
    straight = corner_weights(kind) @ x[:, : kind.corners]
    off = np.linalg.norm(x - straight, axis=2).max(axis=1)
    size = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    return np.asarray(8 * off > BENT * size)  # what a parabola turns by from end to end


def corner_weights(kind: FacetKind) -> Array:
    """The functions of the corners alone at all nodes, (k, c): ``N @ it`` are they at any place."""
    return np.asarray(kind.linear.shapes(kind.locations)[0])


def fitted(normal: Array, away: Array, there: Mask) -> tuple[Array, Array, Mask]:
    """Normals (q, d), tensors (q, d, d) and success of the fit of quadrics to rings.

    Gauss-Newton steps for the tilt of the normal and the curvatures, with distances from the quadric
    that count by one over the squared distance from the node: as errors of a curvature.

    Parameters
    ----------
    normal : ndarray, shape (q, d)
        To start from.
    away : ndarray, shape (q, r, d)
        The ring of each node, seen from there [length].
    there : ndarray of bool, shape (q, r)

    Examples
    --------
    Three nodes of a circle of radius 2:

    >>> t = np.radians([10.0, -25.0])
    >>> away = 2 * np.stack([np.sin(t), np.cos(t) - 1], axis=1)[None]
    >>> n, K, _ = fitted(np.array([[0.1, 1.0]]) / np.sqrt(1.01), away, np.ones((1, 2), dtype=bool))
    >>> bool(abs(n - [0, 1]).max() < 1e-14), bool(abs(K - np.eye(2) / 2).max() < 1e-13)
    (True, True)
    """
    d, (one, other) = normal.shape[1], np.triu_indices(normal.shape[1] - 1)
    # component by component, node after node: long sums in place of many short ones
    ring, start = np.ascontiguousarray(away.T), np.ascontiguousarray(normal.T)
    squared = np.einsum("drq,drq->rq", ring, ring)
    weight = np.divide(1.0, squared, out=np.zeros_like(squared), where=there.T)
    size = np.sqrt(squared.max(axis=0))
    n, T = start.copy(), np.ascontiguousarray(tangents(normal).transpose(1, 2, 0))
    k = np.zeros((d - 1, d - 1, len(normal)))
    left, before = np.arange(len(normal)), np.zeros(len(normal))
    for _ in range(NEWTON_STEPS):
        tilted, old, curvatures = (np.take(x, left, axis=-1) for x in (n, T, k))
        change = _step(tilted, old, curvatures, ring, weight)
        tilted += np.einsum("aq,adq->dq", change[: d - 1], old)
        tilted /= np.sqrt(np.einsum("dq,dq->q", tilted, tilted))
        n[:, left], T[..., left] = tilted, _orthonormal(tilted, old)
        curvatures[one, other] += change[d - 1 :]
        curvatures[other, one] = curvatures[one, other]
        k[..., left] = curvatures
        change[d - 1 :] *= size[left]
        last, before[left] = before[left], np.abs(change).max(axis=0, initial=0.0)
        # what steps that shrink like this one will still add: meshes of one surface meet to 12 digits
        more = before[left] ** 2 > ROUND_OFF * np.maximum(last - before[left], ROUND_OFF)
        if not more.any():
            break
        if not more.all():
            left, ring, weight = (np.compress(more, x, axis=-1) for x in (left, ring, weight))
    kappa, _ = _largest(k)
    K = np.einsum("adq,aeq->deq", T, np.einsum("abq,beq->aeq", k, T)) + kappa * n[:, None] * n
    good = np.isfinite(K).all(axis=(0, 1)) & (there.sum(axis=1) >= d - 1 + len(one))
    good &= np.einsum("dq,dq->q", n, start) > 0.5
    return np.where(good, n, start).T, np.where(good, K, 0.0).transpose(2, 0, 1), good


def _step(n: Array, T: Array, k: Array, ring: Array, weight: Array) -> Array:
    """Changes of the tilts and of the curvatures (u, q), for rings (d, r, q) with weights (r, q)."""
    kappa, axis = _largest(k)
    s, z = np.einsum("adq,drq->arq", T, ring), np.einsum("dq,drq->rq", n, ring)
    off = weight * z
    zz = off * z
    off += 0.5 * kappa * zz
    pairs = [(i, j) for i in range(len(T)) for j in range(i, len(T))]
    columns = np.empty((len(T) + len(pairs), *z.shape))
    tilts, curvatures = columns[: len(T)], columns[len(T) :]
    np.multiply(weight, s, out=tilts)
    # of what the ring does not tell the least is taken: the norm of k, whatever the tangents
    mixed = np.array([[1.0 if i == j else np.sqrt(0.5)] for i, j in pairs])
    for column, (i, j), part in zip(curvatures, pairs, mixed[:, 0], strict=True):
        np.multiply(tilts[i], s[j], out=column)
        factor = 0.5 if i == j else 1.0
        off += factor * k[i, j] * column
        column += axis[i] * axis[j] * zz
        column *= factor * part
    change = _least_squares(columns, -off, len(T))
    change[len(T) :] *= mixed
    return change


def _least_squares(columns: Array, right: Array, tilts: int) -> Array:
    """Least solutions (u, q), tilts and curvatures, of equations (u, r, q) by least squares."""
    u = len(columns)
    normal = np.empty((u, u, columns.shape[2]))
    for i, j in zip(*np.tril_indices(u), strict=True):
        normal[i, j] = normal[j, i] = np.einsum("rq,rq->q", columns[i], columns[j])
    right = np.einsum("urq,rq->uq", columns, right)
    means = np.empty_like(right)
    for part in (slice(tilts), slice(tilts, None)):
        means[part] = np.einsum("uuq->uq", normal)[part].mean(axis=0)
    size = np.sqrt(np.where(means > 0, means, 1.0))
    normal, right = normal / size[:, None] / size, right / size
    found, pivot = _eliminated(normal, right)
    some = np.flatnonzero(pivot < SOLVED)
    if len(some):
        inverse = np.linalg.pinv(normal[..., some].transpose(2, 0, 1), rcond=SOLVED, hermitian=True)
        found[:, some] = np.einsum("quv,vq->uq", inverse, right[:, some])
    return found / size


def _eliminated(A: Array, b: Array) -> tuple[Array, Array]:
    """Solutions (u, q) of small positive definite systems (u, u, q), and their least pivots (q,)."""
    A, x, u = A.copy(), b.copy(), len(b)
    for j in range(u):
        A[j, j] += COMPUTED
        A[j + 1 :, j] /= A[j, j]
        A[j + 1 :, j + 1 :] -= A[j + 1 :, None, j] * A[None, j, j + 1 :]
        x[j + 1 :] -= A[j + 1 :, j] * x[j]
    pivots = np.einsum("uuq->uq", A)
    x /= pivots
    for j in reversed(range(u - 1)):
        x[j] -= np.einsum("uq,uq->q", A[j + 1 :, j], x[j + 1 :])
    return x, pivots.min(axis=0)


def _orthonormal(n: Array, T: Array) -> Array:
    """Tangents (d-1, d, q) turned with the normal (d, q)."""
    first = T[0] - np.einsum("dq,dq->q", T[0], n) * n
    first /= np.sqrt(np.einsum("dq,dq->q", first, first))
    return first[None] if len(T) == 1 else np.stack([first, cross(n.T, first.T).T])


def _largest(k: Array) -> tuple[Array, Array]:
    """The principal curvature of larger size (q,) and its direction (d-1, q)."""
    if len(k) == 1:
        return k[0, 0], np.ones((1, k.shape[2]))
    mean, half = 0.5 * (k[0, 0] + k[1, 1]), 0.5 * (k[0, 0] - k[1, 1])
    radius = np.hypot(half, k[0, 1])
    sign = np.where(mean >= 0, 1.0, -1.0)
    turn = 0.5 * np.arctan2(sign * k[0, 1], sign * half)
    return mean + sign * radius, np.stack([np.cos(turn), np.sin(turn)])


def principal(k: Array) -> Array:
    """Principal directions of curvatures (d-1, d-1, q), as columns; the larger one's first."""
    _, axis = _largest(k)
    return axis[:, None] if len(k) == 1 else np.stack([axis, np.stack([-axis[1], axis[0]])], axis=1)


def around(facets: Index, kind: FacetKind, bowed: Mask, m: int) -> csr_matrix:
    """Return which nodes share a facet, (m, m); those of `bowed` facets share the part between them.

    Parameters
    ----------
    facets : ndarray of int, shape (nf, k)
    kind : FacetKind
    bowed : ndarray of bool, shape (nf,)
        Facets that are curved themselves; of others the corners count.
    m : int
        Number of nodes.
    """
    whole = [list(range(kind.corners))]
    rows, columns = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    for some, parts in ((facets[~bowed], whole), (facets[bowed], kind.parts)):
        for part in parts:
            for shift in range(1, len(part)):
                rows.append(some[:, part].ravel())
                columns.append(some[:, np.roll(part, shift)].ravel())
    row, column = np.concatenate(rows), np.concatenate(columns)
    shared = csr_matrix((np.ones(len(row)), (row, column)), shape=(m, m))
    shared.sum_duplicates()
    return shared


def mirrors(points: Array, edges: Index, held: Mask, normals: Array) -> Mask:
    """Components across which a surface goes on as its mirror image, where it ends, shape (r, d).

    There it ends in a plane across an axis, that component is prescribed, and the normals have none
    of it.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    edges : ndarray of int, shape (r, d-1)
        Where the surface ends: nodes in the plane, edges in space.
    held : ndarray of bool, shape (m, d)
    normals : ndarray, shape (m, d)
    """
    across = np.ptp(points[edges], axis=1)
    in_plane = across <= GIVEN * np.linalg.norm(across, axis=1, keepdims=True)
    ends = held[edges] & (np.abs(normals[edges]) <= GIVEN)
    clamped = np.all(held[edges], axis=(1, 2), keepdims=True)[:, 0]
    return np.asarray(in_plane & ends.all(axis=1) & ~clamped)


def rings(
    points: Array, shared: csr_matrix, passable: Mask, mirrored: Mask, chosen: Index
) -> tuple[Array, Mask]:
    """Return the neighbours of nodes, seen from them, and their neighbours where these are few.

    Parameters
    ----------
    points : ndarray, shape (m, d)
    shared : csr_matrix, shape (m, m)
        From `around`.
    passable : ndarray of bool, shape (m,)
        Nodes beyond which a surface is the same piece; not those at edges and kinks.
    mirrored : ndarray of bool, shape (m, d)
        Components across which the surface goes on as its mirror image at a node.
    chosen : ndarray of int, shape (q,)
        Nodes that are asked for.

    Returns
    -------
    away : ndarray, shape (q, r, d)
        Padded with zeros [length].
    there : ndarray of bool, shape (q, r)
    """
    away, there = _offsets(points, shared[chosen], mirrored, chosen)
    few = np.flatnonzero(there.sum(axis=1) < ENOUGH[points.shape[1]])
    if len(few):
        own = shared[chosen[few]]
        second = own + own @ diags(passable.astype(float)) @ shared
        wider, more = _offsets(points, csr_matrix(second), mirrored, chosen[few])
        r = max(away.shape[1], wider.shape[1])
        away, there = _padded(away, r), _padded(there, r)
        away[few], there[few] = _padded(wider, r), _padded(more, r)
    return away, there


def _offsets(points: Array, matrix: csr_matrix, mirrored: Mask, chosen: Index) -> tuple[Array, Mask]:
    """Offsets of the columns of rows, one row for each node chosen, and of their images."""
    count = np.diff(matrix.indptr)
    r = int(count.max(initial=0))
    place = np.arange(matrix.nnz) - np.repeat(matrix.indptr[:-1], count)
    row = np.repeat(np.arange(len(chosen)), count)
    away = np.zeros((len(chosen), r, points.shape[1]))
    there = np.zeros((len(chosen), r), dtype=bool)
    away[row, place] = points[matrix.indices] - points[chosen[row]]
    there[row, place] = matrix.indices != chosen[row]
    away[~there] = 0.0
    for axis in np.flatnonzero(mirrored[chosen].any(axis=0)):
        sign = np.where(np.arange(points.shape[1]) == axis, -1.0, 1.0)
        size = np.abs(away).max(axis=(1, 2), initial=0.0)[:, None]
        image = there & mirrored[chosen, axis, None] & (np.abs(away[..., axis]) > GIVEN * size)
        away = np.concatenate([away, np.where(image[..., None], sign * away, 0.0)], axis=1)
        there = np.concatenate([there, image], axis=1)
    return away, there


def _padded(values: NDArray[Any], r: int) -> NDArray[Any]:
    """An array (q, r', ...) with zeros up to r columns."""
    out = np.zeros((len(values), r, *values.shape[2:]), dtype=values.dtype)
    out[:, : values.shape[1]] = values
    return out
