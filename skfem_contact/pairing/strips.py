"""Which facets can meet along the normals of the secondary? Strips of normals in a tree of balls.

(The search of `search` is for closest points, this one for the facets that a normal line hits.)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def candidate_pairs(
    secondary: ContactSurface, primary: ContactSurface, reach: float
) -> tuple[Index, Index]:
    """Pairs of facets that may meet: the strip of normals of the one reaches a ball of the other.

    The primary facets hang in a binary tree of balls that all secondary facets descend together,
    level by level; the work is proportional to the facets and the pairs found, whatever the
    distance between the surfaces (a search by radius would need ``reach``).

    Returns
    -------
    e, f : ndarray of int
        Secondary and primary facets.
    """
    centre, radius = _balls(primary)
    order, blocks = _bisect(centre)
    own_centre, own_radius = _balls(secondary)
    normals = facet_normal_field(secondary)
    ends = secondary.points[secondary.facets[:, :2]]
    along = turned(normals[:, :2])
    along = along / np.linalg.norm(along, axis=2, keepdims=True)

    def may_meet(e: Index, centre: Array, radius: Array) -> NDArray[np.bool_]:
        past_start = dot(centre - ends[e, 0], along[e, 0]) >= -radius
        before_end = dot(centre - ends[e, 1], along[e, 1]) <= radius
        distance = np.linalg.norm(centre - own_centre[e], axis=1)
        return past_start & before_end & (distance <= reach + own_radius[e] + radius)

    e: Index = np.arange(len(secondary.facets))
    block = np.zeros_like(e)
    for level, first in enumerate(blocks):
        if level > 0:
            e, block = np.repeat(e, 2), np.stack([2 * block, 2 * block + 1], axis=1).ravel()
        ball, reached = _enclosing(centre[order], radius[order], first)
        keep = may_meet(e, ball[block], reached[block])
        e, block = e[keep], block[keep]
    size = np.diff(np.append(blocks[-1], len(order)))
    f = order[ragged(blocks[-1][block], size[block])]
    e = np.repeat(e, size[block])
    keep = may_meet(e, centre[f], radius[f])
    return e[keep], f[keep]


def _balls(surface: ContactSurface) -> tuple[Array, Array]:
    """A ball around each facet: centre of the chord, half its length, and the sagitta."""
    nodes = surface.points[surface.facets]
    centre = 0.5 * (nodes[:, 0] + nodes[:, 1])
    radius = 0.5 * np.linalg.norm(nodes[:, 1] - nodes[:, 0], axis=1)
    if nodes.shape[1] == 3:
        radius = radius + np.linalg.norm(nodes[:, 2] - centre, axis=1)
    return centre, radius


def _bisect(centre: Array) -> tuple[Index, list[Index]]:
    """Order of points by repeated halving along the longest side, and the blocks of each level."""
    n = len(centre)
    depth = int(np.log2(n))
    order: Index = np.arange(n)
    blocks = []
    for level in range(depth + 1):
        first = np.arange(2**level) * n // 2**level
        blocks.append(first)
        at = centre[order]
        extent = np.maximum.reduceat(at, first) - np.minimum.reduceat(at, first)
        block = np.repeat(np.arange(2**level), np.diff(np.append(first, n)))
        key = at[np.arange(n), extent.argmax(axis=1)[block]]
        order = order[np.lexsort((key, block))]
    return order, blocks


def _enclosing(centre: Array, radius: Array, first: Index) -> tuple[Array, Array]:
    """A ball around all balls of each block."""
    size = np.diff(np.append(first, len(centre)))
    mean = np.add.reduceat(centre, first) / size[:, None]
    distance = np.linalg.norm(centre - np.repeat(mean, size, axis=0), axis=1)
    return mean, np.maximum.reduceat(distance + radius, first)


def facet_normal_field(surface: ContactSurface) -> Array:
    """Normals at the nodes of each facet, shape (nf, k, d), to be interpolated over it."""
    normals = surface.facet_node_normals
    if surface.facets.shape[1] == 2:
        return normals
    return np.concatenate([normals, surface.facet_normals[:, None]], axis=1)


def dot(v: Array, w: Array) -> Array:
    """Scalar products along the last axis."""
    return np.einsum("...d,...d->...", v, w)


def turned(v: Array) -> Array:
    """Vectors turned by +90 degrees: outward normals become the direction of travel."""
    return np.stack([-v[..., 1], v[..., 0]], axis=-1)


def ragged(start: Index, count: Index) -> Index:
    """``start[0], start[0] + 1, ...`` (count[0] of them), ``start[1], ...``.

    >>> ragged(np.array([5, 0]), np.array([2, 3]))
    array([5, 6, 0, 1, 2])
    """
    before = np.cumsum(count) - count
    return np.arange(count.sum()) + np.repeat(start - before, count)
