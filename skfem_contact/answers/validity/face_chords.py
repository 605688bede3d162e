r"""Heights of curved boundaries over faces that are long for a light contact: `chords` in space.

Along an edge of a face, or a diagonal of a quadrilateral, a smooth boundary is a curve over a chord:
its slopes at both ends follow from the averaged normals, and say how it bends, ``k h`` of a chord of
length h, by the rules of `bodies.kinks.end_slopes` (what is straight, a kink, or a polygon of less
than 16 sides does not bend). The tensor K of a face takes what all its chords say. Between two sides

    e = max |x' (K_s + K_p) x| / 8

over the edges x of the faces that meet is the height of the gap's paraboloid over the longest of them.
A long face along the axis of a cylinder has none: it is straight there. Node by node nothing is known
of what comes down in the middle of a face of the secondary: there it is the height over the whole
face, ``tr(K S) / 2`` with the mean S of ``x x'`` over its corners x seen from its middle, twice that
over the edge of a square. What the secondary itself bends does not count in it, as its nodes are on it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import CURVED, FLAT, TWIST
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.thresholds import ALIKE, STEEPEST
from skfem_contact.digits import COMPUTED
from skfem_contact.pairing.thresholds import FACING
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def face_sagittas(
    secondary: ContactSurface, primary: ContactSurface, facet: Index, by_node: bool
) -> Array:
    """Height of the gap's paraboloid over the edges of the faces that meet, shape (m,) [length].

    Parameters
    ----------
    secondary, primary : ContactSurface
    facet : ndarray of int, shape (m,)
        Primary faces that the points meet.
    by_node : bool
        Whether only the nodes of the secondary see the primary.
    """
    m, faces = len(secondary.points), secondary.facets
    own, edges = face_bends(secondary)
    of_primary, others = face_bends(primary)
    # curved faces that fit are known to differ little; which of them bend is not known well enough
    if not (own.any() or of_primary.any()) or (secondary.quadratic and primary.quadratic):
        return np.zeros(m)
    mean = np.zeros((m, 3, 3))
    np.add.at(mean, faces, own[:, None])
    mean /= np.bincount(faces.ravel(), minlength=m)[:, None, None]
    bend = mean + of_primary[facet]
    out = _heights(others[facet], bend)
    if by_node:
        around = heights_over(edges, bend[faces], of_primary[facet][faces], secondary.kind.triangle)
    else:
        around = _heights(edges[:, None], bend[faces])
    np.maximum.at(out, faces, around)
    # what normals of plane faces differ by
    return np.where(out > 8 * COMPUTED * np.abs(secondary.points).max(), out / 8, 0.0)


def heights_over(edges: Array, bend: Array, of_primary: Array, triangle: bool) -> Array:
    """Eight times the height over faces whose nodes alone see the primary.

    Parameters
    ----------
    edges : ndarray, shape (nf, c, 3)
    bend : ndarray, shape (nf, k, 3, 3) or (nf, 3, 3)
        Of both sides together.
    of_primary : ndarray, shape (nf, k, 3, 3) or (1, 3, 3)
    triangle : bool
        Whether faces are triangles.

    Returns
    -------
    ndarray, shape (nf, k) or (nf,)
    """
    around = _heights(edges[:, None] if bend.ndim > edges.ndim else edges, bend)
    # S by the edges of a triangle, or of a parallelogram
    spread = np.einsum("fcd,fce->fde", edges, edges) / (9 if triangle else 8)
    whole = [np.abs(np.einsum("f...de,fde->f...", K, spread)) for K in (bend, of_primary)]
    return np.maximum(around, 4 * np.minimum(*whole))


def _heights(edges: Array, bend: Array) -> Array:
    """Largest |x' K x| of edges (..., c, 3) and tensors (..., 3, 3)."""
    return np.abs(np.einsum("...cd,...de,...ce->...c", edges, bend, edges)).max(axis=-1)


def face_bends(surface: ContactSurface) -> tuple[Array, Array]:
    """How every face bends, and the edges of the pieces that stand for it.

    Returns
    -------
    bend : ndarray, shape (nf, 3, 3)
        Tensors K in the plane of each face; ``x' K x / |x|^2`` is the curvature along x, positive
        where the surface is convex [1/length].
    edges : ndarray, shape (nf, c, 3)
        Of a quadratic face those of its quarters, unless it is flat and stands for a curved boundary
        nevertheless [length].

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem_contact.bodies.body import Body
    >>> mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 3)]).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> bend, edges = face_bends(Body(basis, np.eye(basis.N)).surface("top"))
    >>> bool(bend.any()), edges.shape
    (False, (4, 4, 3))
    """
    kind, corners = surface.kind, surface.facets[:, : surface.kind.corners]
    chords = _chords(kind)
    x, n = surface.points[corners], surface.facet_node_normals[:, : kind.corners]
    start, end = chords.T
    along = x[:, end] - x[:, start]
    across = surface.facet_normals
    rise, kinked = _rises(along, across, n[:, start], n[:, end])
    # a diagonal is longer than the edges: beside a kink it turns by less, and is no curve either
    smooth = ~kinked[:, : kind.corners].any(axis=1)
    rise[:, kind.corners :][~smooth] = 0.0
    edges = along[:, : kind.corners]
    if not rise.any():
        return np.zeros((len(x), 3, 3)), edges
    # in the plane of each face, in sizes of a face: the least tensor of those that say so
    first = edges[:, 0] - dot(edges[:, 0], across)[:, None] * across
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(across, first)], axis=1)
    size = surface.lengths[:, None]
    s, t = np.moveaxis(np.einsum("fad,fcd->fca", axes, along) / size[..., None], -1, 0)
    asked = np.stack([s * s, 2 * s * t, t * t], axis=2)
    asked[:, kind.corners :][~smooth] = 0.0
    # edges that are nearly parallel in pairs do not tell the twist: without diagonals it is none
    unit = asked / np.maximum((s * s + t * t)[..., None], np.finfo(float).tiny)
    asked[np.linalg.svd(unit, compute_uv=False)[:, -1] < TWIST, :, 1] = 0.0
    said = np.linalg.pinv(asked) @ rise[..., None]
    a, b, c = np.moveaxis(said[..., 0] / size**2, -1, 0)
    plane = np.stack([np.stack([a, b], axis=-1), np.stack([b, c], axis=-1)], axis=-1)
    bend = np.einsum("fad,fab,fbe->fde", axes, plane, axes)
    if kind.quadratic:
        middle = surface.points[surface.facets[:, kind.corners : 2 * kind.corners]]
        away = middle - 0.5 * (x + np.roll(x, -1, axis=1))
        height = np.abs(np.einsum("fcd,fd->fc", away, across)).max(axis=1)
        curved = height >= CURVED * np.abs(rise[:, : kind.corners]).max(axis=1) / 8
        edges = np.where(curved[:, None, None], 0.5, 1.0) * edges
    return bend, edges


def kinked_faces(surface: ContactSurface) -> Mask:
    """Faces at whose edges the surface turns, but not as a curve does, shape (nf,)."""
    corners = surface.facets[:, : surface.kind.corners]
    start, end = np.arange(corners.shape[1]), np.roll(np.arange(corners.shape[1]), -1)
    x, n = surface.points[corners], surface.facet_node_normals[:, : surface.kind.corners]
    kinked = _rises(x[:, end] - x[:, start], surface.facet_normals, n[:, start], n[:, end])[1]
    return np.asarray(kinked.any(axis=1))


def _chords(kind: FacetKind) -> Index:
    """Corners of a face that chords go between: its edges, then the diagonals of a quadrilateral."""
    start = np.arange(kind.corners)
    edges = np.column_stack([start, np.roll(start, -1)])
    return edges if kind.corners == 3 else np.vstack([edges, [[0, 2], [1, 3]]])


def _rises(along: Array, across: Array, first: Array, last: Array) -> tuple[Array, Mask]:
    """Curvature times the square of the length of chords (nf, c, 3), from the normals at their ends.

    Zero where a chord is no piece of a curve, as in `bodies.kinks.end_slopes`; and those which are
    neither that nor straight.
    """
    length = np.linalg.norm(along, axis=2)
    # slopes of the smooth boundary over the plane of the face
    start, end = (
        sign * dot(n, along) / length / np.maximum(dot(n, across[:, None]), FACING)
        for sign, n in ((-1.0, first), (1.0, last))
    )
    least, most = np.minimum(np.abs(start), np.abs(end)), np.maximum(np.abs(start), np.abs(end))
    curve = (start * end > 0) & (most <= STEEPEST) & (least >= ALIKE * most)
    return np.where(curve, (start + end) * length, 0.0), ~curve & (most > FLAT)
