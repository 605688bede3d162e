r"""Heights of curved boundaries over facets that are long for a light contact, or drawn by pieces.

Between two nodes a curve stands off its chord, and off the other side of the interface more than at
the nodes: over a facet of length h by the sagitta

    e = k h^2 / 8,        k = k_s + k_p,

with the curvatures of both sides (convex ones positive, so that curves that fit have none) and the
longer of the facets that meet. Contact that is pressed in by less ends within one facet. Then polygons
touch where curves do not, or do not touch where curves do; gaps at the nodes of a flat side do not see
an arc that comes down between them; and a weighted gap, which knows a parabola as a mean only, has an
overlap of 2/3 of e where the curve just touches. Forces that follow from a prescribed approach d are
wrong by ``d / e`` or its inverse. So e is compared with what the bodies take up elastically: forces are
wrong by as large a part of them at most, and by less than half of that in general
(`answers.thresholds.SAGITTA`).

In the plane and in space, curvatures are tensors K. Along a facet of the plane, or an edge or diagonal
of a face, a smooth boundary is a curve over a chord: its slopes at both ends follow from the averaged
normals, and say how it bends, ``k h`` of a chord of length h, by the rules of
`bodies.normal_field.end_slopes` (what is straight, a kink, or a polygon of less than 16 sides does not
bend). The tensor of a face takes what all its chords say. Between two sides

    e = max |x' (K_s + K_p) x| / 8

over the edges x of the facets that meet is the height of the gap's paraboloid over the longest of them.
A long face along the axis of a cylinder has none: it is straight there. Node by node nothing is known
of what comes down in the middle of a face of the secondary: there it is the height over the whole
face, ``tr(K S) / 2`` with the mean S of ``x x'`` over its corners x seen from its middle, twice that
over the edge of a square. What the secondary itself bends does not count in it, as its nodes are on it.

A rigid cylinder, sphere or plane is met node by node: K_p is its own. The pieces of an outline or an
STL bend as facets do. Where the bodies are pressed in
by a given d that is not large beside e, forces depend on where the nodes are: on a disc that is pressed
into a block by up to 15 % at ``e / d = .25``, 30 % at .5 (`tests/verification/test_coarse_tools.py`).
"""

from __future__ import annotations

import numpy as np

from skfem_contact.answers.thresholds import PIECES, TWIST
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.normal_field import end_slopes, of_curves
from skfem_contact.bodies.quadrics import bowed_facets
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.pairing.thresholds import FACING
from skfem_contact.pairing.vectors import dot

#: All facets.
EVERY = slice(None)


def sagittas(
    secondary: ContactSurface,
    primary: ContactSurface | Array,
    facet: Index | None = None,
    by_node: bool = True,
) -> Array:
    """Height of the gap's paraboloid over the edges of the facets that meet, shape (m,) [length].

    Parameters
    ----------
    secondary : ContactSurface
    primary : ContactSurface, or ndarray of shape (d, d)
        How an obstacle bends, `Obstacle.bend` [1/length].
    facet : ndarray of int, shape (m,)
        Primary facets that the points meet.
    by_node : bool
        Whether only the nodes of the secondary see the primary; matters for faces.

    Returns
    -------
    ndarray, shape (m,)
        Zero where no side is a curve: on straight sides, kinks and polygons of less than 16 sides. What
        two sides of curved second-order faces leave, or these and an obstacle, is not known.
    """
    m, facets, d = len(secondary.points), secondary.facets, secondary.dim
    own, edges = bends(secondary)
    if isinstance(primary, ContactSurface):
        assert facet is not None
        met, of_point = np.unique(facet, return_inverse=True)
        of_primary, others = (found[of_point] for found in bends(primary, met))
        curved = primary.quadratic
    else:
        of_primary, others = np.broadcast_to(primary, (m, d, d)), np.zeros((m, 1, d))
        curved = bool(own.any())
    # curved faces that fit are known to differ little; which of them bend is not known well enough
    fit = d == 3 and secondary.quadratic and curved
    if fit or not (own.any() or of_primary.any()):
        return np.zeros(m)
    mean = np.zeros((m, d, d))
    np.add.at(mean, facets, own[:, None])
    mean /= np.bincount(facets.ravel(), minlength=m)[:, None, None]
    bend = mean + of_primary
    out = _rise(others, bend)
    around = _rise(edges[:, None], bend[facets])
    if by_node:
        spread = _spread(edges, secondary.kind)
        whole = [np.abs(np.einsum("fkde,fde->fk", K[facets], spread)) for K in (bend, of_primary)]
        around = np.maximum(around, 4 * np.minimum(*whole))
    np.maximum.at(out, facets, around)
    # what normals of plane faces differ by
    return np.where(out > 8 * COMPUTED * np.abs(secondary.points).max(), out / 8, 0.0)


def drawn_off(surface: ContactSurface) -> float:
    """Largest distance between a surface and the straight pieces that stand for it where it is drawn.

    Second-order facets are parabolas: over one of n pieces by the nth part squared as high as over
    the whole. Straight ones are off the curve with the normals at their ends by the height of their
    chords.
    """
    x, corners = surface.points[surface.facets], surface.kind.corners
    if not surface.quadratic:
        n = surface.facet_node_normals
        pairs = [(i, j) for i in range(corners) for j in range(i)]
        rises = [
            np.linalg.norm(n[:, i] - n[:, j], axis=1) * np.linalg.norm(x[:, i] - x[:, j], axis=1)
            for i, j in pairs
        ]
        return float(np.max(rises) / 8)
    edges, parts = (1, PIECES) if surface.dim == 2 else (corners, 2)
    rises = [
        np.linalg.norm(x[:, corners + i] - 0.5 * (x[:, i] + x[:, (i + 1) % corners]), axis=1)
        for i in range(edges)
    ]
    return max(float(np.max(rises) / parts**2), _height_of_plane_facets(surface))


def _height_of_plane_facets(surface: ContactSurface) -> float:
    """Height of the smooth boundary over straight facets, by the curvature at their corners."""
    quadrics = surface.quadrics
    corners = surface.facets[quadrics.curved & ~quadrics.bowed, : surface.kind.corners]
    if not len(corners):
        return 0.0
    edges = surface.points[np.roll(corners, -1, axis=1)] - surface.points[corners]
    rises = [
        np.abs(np.einsum("fed,fedc,fec->fe", edges, quadrics.tensor[ends], edges)) / 8
        for ends in (corners, np.roll(corners, -1, axis=1))
    ]
    return float(np.max(rises))


def _rise(edges: Array, bend: Array) -> Array:
    """Largest |x' K x| of edges (..., c, d) and tensors (..., d, d)."""
    return np.abs(np.einsum("...cd,...de,...ce->...c", edges, bend, edges)).max(axis=-1)


def _spread(edges: Array, kind: FacetKind) -> Array:
    """Mean of ``x x'`` over corners seen from the middle, by the edges of triangles, parallelograms."""
    count = {2: 4, 3: 9, 4: 8}[kind.corners]
    return np.einsum("fcd,fce->fde", edges, edges) / count


def bends(surface: ContactSurface, some: Index | slice = EVERY) -> tuple[Array, Array]:
    """Return how every facet, or some, bends, and the edges of the pieces that stand for it.

    Returns
    -------
    bend : ndarray, shape (nf, d, d)
        Tensors K; ``x' K x / |x|^2`` is the curvature along x, positive where the surface is convex, in
        the plane the same along all x [1/length].
    edges : ndarray, shape (nf, c, d)
        Of a facet of the plane its chord. Of a quadratic facet those of its halves or quarters, unless
        it is straight and stands for a curved boundary nevertheless [length].

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem_contact.bodies.body import Body
    >>> mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 3)]).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> bend, edges = bends(Body(basis, np.eye(basis.N)).surface("top"))
    >>> bool(bend.any()), edges.shape
    (False, (4, 4, 3))
    """
    if surface.dim == 2:
        rise, edges = _curve_rises(surface, some)
        bend = (rise / surface.lengths[some, None] ** 2)[:, :, None] * np.eye(2)
    else:
        rise, edges, bend = _face_bends(surface, some)
        if not rise.any():
            return bend, (0.5 if surface.quadratic else 1.0) * edges
    if not surface.quadratic:
        return bend, edges
    # a facet with its middle nodes on the curve has two parts
    curved = bowed_facets(surface.points, surface.facets[some], surface.kind)
    return bend, np.where(curved[:, None, None], 0.5, 1.0) * edges


def _curve_rises(surface: ContactSurface, some: Index | slice) -> tuple[Array, Array]:
    """Curvature times length squared of facets of the plane, (nf, 1), and chords of their length."""
    chain, lengths = surface.facets[some, :2], surface.lengths[some]
    slopes = end_slopes(surface.points, chain, surface.facet_node_normals[some])
    rise = (slopes[:, 0] - slopes[:, 1]) * lengths
    along = surface.points[chain[:, 1]] - surface.points[chain[:, 0]]
    along *= (lengths / np.linalg.norm(along, axis=1))[:, None]
    return rise[:, None], along[:, None]


def _face_bends(surface: ContactSurface, some: Index | slice) -> tuple[Array, Array, Array]:
    """Curvature times the square of the length of chords, edges and tensors of faces; see `bends`."""
    kind, corners = surface.kind, surface.facets[some, : surface.kind.corners]
    chords = _chords(kind)
    x, n = surface.points[corners], surface.facet_node_normals[some, : kind.corners]
    start, end = chords.T
    along = x[:, end] - x[:, start]
    across = surface.facet_normals[some]
    rise, kinked = _rises(along, across, n[:, start], n[:, end])
    # a diagonal is longer than the edges: beside a kink it turns by less, and is no curve either
    smooth = ~kinked[:, : kind.corners].any(axis=1)
    rise[:, kind.corners :][~smooth] = 0.0
    edges = along[:, : kind.corners]
    if not rise.any():
        return rise, edges, np.zeros((len(x), 3, 3))
    # in the plane of each face, in sizes of a face: the least tensor of those that say so
    first = edges[:, 0] - dot(edges[:, 0], across)[:, None] * across
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = np.stack([first, np.cross(across, first)], axis=1)
    size = surface.lengths[some, None]
    s, t = np.moveaxis(np.einsum("fad,fcd->fca", axes, along) / size[..., None], -1, 0)
    asked = np.stack([s * s, 2 * s * t, t * t], axis=2)
    asked[:, kind.corners :][~smooth] = 0.0
    # edges that are nearly parallel in pairs do not tell the twist: without diagonals it is none
    unit = asked / np.maximum((s * s + t * t)[..., None], np.finfo(float).tiny)
    asked[np.linalg.svd(unit, compute_uv=False)[:, -1] < TWIST, :, 1] = 0.0
    found = np.linalg.pinv(asked) @ rise[..., None]
    a, b, c = np.moveaxis(found[..., 0] / size**2, -1, 0)
    plane = np.stack([np.stack([a, b], axis=-1), np.stack([b, c], axis=-1)], axis=-1)
    return rise, edges, np.einsum("fad,fab,fbe->fde", axes, plane, axes)


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

    Zero where a chord is no piece of a curve, as in `normal_field.end_slopes`; and those which are
    neither that nor straight.
    """
    length = np.linalg.norm(along, axis=2)
    # slopes of the smooth boundary over the plane of the face
    start, end = (
        sign * dot(n, along) / length / np.maximum(dot(n, across[:, None]), FACING)
        for sign, n in ((-1.0, first), (1.0, last))
    )
    curve, most = of_curves(start, end), np.maximum(np.abs(start), np.abs(end))
    return np.where(curve, (start + end) * length, 0.0), ~curve & (most > GIVEN)
