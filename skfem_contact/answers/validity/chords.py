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
(`SAGITTA`).

In the plane and in space, curvatures are tensors K: how the averaged normals at the corners of a facet
change along it. An edge that is straight, beside a kink, or of a polygon of less than 16
sides does not bend (`bodies.normal_field.of_curves`), and a face not along it.
Between two sides

    e = max |x' (K_s + K_p) x| / 8

over the edges x of the facets that meet is the height of the gap's paraboloid over the longest of them.
A long face along the axis of a cylinder has none: it is straight there. Node by node nothing is known
of what comes down in the middle of a face of the secondary: there it is the height over the whole
face, ``tr(K S) / 2`` with the mean S of ``x x'`` over its corners x seen from its middle, twice that
over the edge of a square. What the secondary itself bends does not count in it, as its nodes are on it.
Middle nodes halve the edges, but where corners take of the middles (control points, `pairing.node`,
and functions of mortar): under a curve these touch early by e of the whole edge, and nothing comes
down between them.

A rigid cylinder, sphere or plane is met node by node: K_p is its own. The pieces of an outline or an
STL bend as facets do; its flats are met as they are. Where the bodies are pressed in by a given d that
is not large beside e, forces depend on where the nodes are: on a disc that is pressed into a block by
up to 15 % at ``e / d = .25``, 30 % at .5 (`tests/verification/test_coarse_tools.py`).
"""

from __future__ import annotations

import numpy as np

from skfem_contact.answers.validity.deformed_boundaries import PIECES
from skfem_contact.answers.validity.validity import A_TENTH
from skfem_contact.arrays import Array, Index, Mask, dot
from skfem_contact.bodies.normal_field import BENT, of_curves
from skfem_contact.bodies.quadrics import bowed_facets
from skfem_contact.bodies.surface import ContactSurface, NoBody
from skfem_contact.digits import COMPUTED, GIVEN

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
        Zero where no side is a curve: on straight sides, kinks and polygons of less than 16 sides.
    """
    m, facets, d = len(secondary.points), secondary.facets, secondary.dim
    # nothing comes down unseen between control points, which touch early by the height over an edge
    control = secondary.kind.taken > 0
    own, edges = bends(secondary, halves=not control)
    if isinstance(primary, ContactSurface):
        assert facet is not None
        met, of_point = np.unique(facet, return_inverse=True)
        of_primary, others = (found[of_point] for found in bends(primary, met))
        if isinstance(primary.body, NoBody):  # its flats are met as they are, however long
            others = others * of_primary.any(axis=(1, 2))[:, None, None]
    else:
        of_primary, others = np.broadcast_to(primary, (m, d, d)), np.zeros((m, 1, d))
    if not (own.any() or of_primary.any()):
        return np.zeros(m)
    mean = np.zeros((m, d, d))
    np.add.at(mean, facets, own[:, None])
    mean /= np.bincount(facets.ravel(), minlength=m)[:, None, None]
    bend = mean + of_primary
    out = _rise(others, bend)
    around = _rise(edges[:, None], bend[facets])
    if by_node and not control:
        # the mean of x x' over corners seen from the middle, of triangles and parallelograms
        count = {2: 4, 3: 9, 4: 8}[secondary.kind.corners]
        spread = np.einsum("fcd,fce->fde", edges, edges) / count
        whole = [np.abs(np.einsum("fkde,fde->fk", K[facets], spread)) for K in (bend, of_primary)]
        around = np.maximum(around, 4 * np.minimum(*whole))
    np.maximum.at(out, facets, around)
    # what normals of plane faces differ by
    return np.where(out > 8 * COMPUTED * np.abs(secondary.points).max(), out / 8, 0.0)


def drawn_off(surface: ContactSurface) -> float:
    """Largest distance between a surface and the straight pieces that stand for it where it is drawn.

    Second-order facets are parabolas: over one of n pieces by the nth part squared as high as over
    the whole. Straight ones are off the curve by the height of their chords.
    """
    kind, x, n = surface.kind, surface.points[surface.facets], surface.facet_node_normals
    i, j = np.tril_indices(kind.corners, -1)
    height = np.linalg.norm(n[:, i] - n[:, j], axis=2) * np.linalg.norm(x[:, i] - x[:, j], axis=2) / 8
    height = height.max(axis=1)
    if surface.quadratic:
        start, end, middle = ([0], [1], [2]) if surface.dim == 2 else kind.edges.T
        off = np.linalg.norm(x[:, middle] - 0.5 * (x[:, start] + x[:, end]), axis=2).max(axis=1)
        parts = PIECES if surface.dim == 2 else 2
        straight = np.where(kinked_edges(surface).any(axis=1), 0.0, height)
        curved = bowed_facets(surface.points, surface.facets, kind)
        height = np.where(curved, off / parts**2, straight)
    return float(np.max(height))


def straight_words(surface: ContactSurface, some: Index | slice = EVERY) -> str:
    """Whether some second-order facets stand straight for a curve, in words; empty where none does.

    They press on their corners and not on their middles, and pressures alternate from one to the other.
    """
    side = surface.original
    if not side.quadratic or not _straight(side)[some].any():
        return ""
    return (
        f"second-order facets of {side.label!r} stand straight for a curve, and pressures alternate; "
        "move their middle nodes to it, or take linear elements"
    )


def _straight(side: ContactSurface) -> Mask:
    """Second-order facets of a curve whose middle nodes are on straight edges, (nf,)."""
    if side.dim == 3:
        return np.asarray(side.quadrics.curved & ~side.quadrics.bowed)
    bend, edges = bends(side, halves=False)
    turns = bend[:, 0, 0] * np.linalg.norm(edges[:, 0], axis=1)
    return np.asarray((np.abs(turns) > BENT) & ~bowed_facets(side.points, side.facets, side.kind))


def _rise(edges: Array, bend: Array) -> Array:
    """Largest |x' K x| of edges (..., c, d) and tensors (..., d, d)."""
    return np.abs(np.einsum("...cd,...de,...ce->...c", edges, bend, edges)).max(axis=-1)


def bends(
    surface: ContactSurface, some: Index | slice = EVERY, halves: bool = True
) -> tuple[Array, Array]:
    """Return how every facet, or some, bends, and the edges of the pieces that stand for it.

    Returns
    -------
    bend : ndarray, shape (nf, d, d)
        Tensors K; ``x' K x / |x|^2`` is the curvature along x, positive where the surface is convex, in
        the plane the same along all x [1/length].
    edges : ndarray, shape (nf, c, d)
        Of a facet of the plane its chord. Of a quadratic facet, if halves are asked for, those of its
        halves or quarters, unless it is straight and stands for a curved boundary even so [length].

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
    facets = surface.facets[some]
    x = surface.points[facets[:, : surface.kind.corners]]
    edges, bend = np.roll(x, -1, axis=1) - x, curvatures(surface, some)
    if surface.dim == 2:
        edges = (
            edges[:, :1] * (surface.lengths[some] / np.linalg.norm(edges[:, 0], axis=1))[:, None, None]
        )
    bowed: Mask = np.zeros(len(facets), dtype=bool)
    if surface.quadratic:
        bowed = bowed_facets(surface.points, facets, surface.kind)
    if bend.any():
        # middle nodes that are on a curve say that a facet is a piece of one, however far it turns
        kinked = kinked_edges(surface, some) & ~bowed[:, None]
        bend = _across(bend, kinked, edges)
    if not (surface.quadratic and halves):
        return bend, edges
    # a facet with its middle nodes on the curve has two parts
    halved = np.asarray(bowed | (surface.dim == 3 and not bend.any()))
    return bend, np.where(halved[:, None, None], 0.5, 1.0) * edges


def _across(bend: Array, kinked: Mask, edges: Array) -> Array:
    """Tensors (nf, d, d) of facets without what bends across kinked edges (nf, c), parallel or not."""
    if bend.shape[1] == 2:
        bend[kinked.any(axis=1)] = 0.0
        return bend
    bent = np.broadcast_to(np.eye(3), bend.shape)
    for way in np.moveaxis(kinked[..., None] * edges, 1, 0):
        left = np.einsum("fab,fb->fa", bent, way)
        size, length = np.linalg.norm(left, axis=1), np.linalg.norm(way, axis=1)
        left /= np.where(size > A_TENTH * length, size, np.inf)[:, None]
        bent = bent - left[:, :, None] * left[:, None, :]
    return np.asarray(bent @ bend @ bent)


def curvatures(surface: ContactSurface, some: Index | slice = EVERY) -> Array:
    """Return how normals change along each facet, by those at its corners, (nf, d, d) [1/length].

    Normals are averaged with the neighbours', except over corners.

    >>> import numpy as np
    >>> import skfem as fem
    >>> from skfem_contact.bodies.body import Body
    >>> mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 4)]).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> cube = Body(basis, np.eye(basis.N)).surface("top")
    >>> bool(curvatures(cube).any())
    False
    """
    c, d = surface.kind.corners, surface.dim
    x = surface.points[surface.facets[some, :c]]
    n, across = surface.facet_node_normals[some, :c], surface.facet_normals[some]
    if np.max(np.abs(n - across[:, None]), initial=0.0) < COMPUTED**0.5:
        return np.zeros((len(x), d, d))
    if d == 2:  # of a curve as that of a circle, whose normal turns along all ways by as much
        along = x[:, 1] - x[:, 0]
        turn = dot(n[:, 1] - n[:, 0], along) / dot(along, along)
        return np.asarray(turn[:, None, None] * np.eye(2))
    x, n = x - x.mean(axis=1, keepdims=True), n - n.mean(axis=1, keepdims=True)
    square = np.einsum("fkd,fke->fde", x, x)
    change = np.einsum("fkd,fke->fde", n, x)
    K = change @ np.linalg.pinv(square, rcond=GIVEN, hermitian=True)
    plane = np.eye(d) - across[:, :, None] * across[:, None, :]
    K = plane @ K @ plane
    return np.asarray(0.5 * (K + np.swapaxes(K, 1, 2)))


def kinked_edges(surface: ContactSurface, some: Index | slice = EVERY) -> Mask:
    """Edges of facets, of lines both ends, that are no pieces of a curve and not straight, (nf, c).

    Those of a polygon of less than 16 sides, and those that the smooth boundary leaves at one end
    alone: beside a kink, and where the surface ends.
    """
    corners = surface.facets[some, : surface.kind.corners]
    n, up = surface.facet_node_normals[some, : corners.shape[1]], surface.facet_normals[some, None]
    edges = np.roll(surface.points[corners], -1, axis=1) - surface.points[corners]
    edges /= np.linalg.norm(edges, axis=2, keepdims=True)
    up = np.maximum(dot(n, up), COMPUTED)
    ends = dot(n, edges) / up, dot(np.roll(n, -1, axis=1), edges) / np.roll(up, -1, axis=1)
    curve = of_curves(ends[0], -ends[1])
    return np.asarray(~curve & (np.maximum(*np.abs(ends)) > GIVEN))
