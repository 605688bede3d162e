"""`Pairing`: which point meets what; and the pairing of node-to-segment contact, of faces too.

**Control points.** A uniform pressure has no force at the corners of a quadratic triangle, and a
negative one at those of an 8-node face: the integrals of their shape functions are zero and -1/12 of
the area. A condition on the sign of nodal forces is none on the pressure there. With the control points
of the quadratic edges,

    g_m' = 2 g_m - (g_a + g_b) / 2    at the middle m between a and b,      g_a' = g_a    at corners,

in place of the gaps at the nodes the same displacements have the forces of Bernstein's polynomials, all
of whose integrals are positive: 1/6 of a triangle each; of an 8-node face 1/12 at corners, 1/6 else.
Where all points of a face are closed the conditions are those at the nodes, combined, and the forces on
the bodies are what they were. At the rim of a contact the control polygon touches a little earlier than
the parabola under it, by the square of the size of a face. Gaps that users give (an interference) are
lengths along the normals of the nodes: `gap_weights` combines them as the rows combine displacements.
Faces with 9 nodes need none of this: the integrals are 1/36, 1/9 and 4/9.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, diags, identity

from skfem_contact.arrays import (
    Array,
    Index,
    Mask,
    angle_between,
    assembled,
    dot,
    entries,
    ragged,
    sizes,
    tangents,
)
from skfem_contact.bodies.facet_kinds import positive_functions
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN
from skfem_contact.errors import InputError
from skfem_contact.pairing.closest import LEAN, closest_facets, overhang, search_range
from skfem_contact.pairing.projection import interpolated_normals
from skfem_contact.pairing.search import FACING
from skfem_contact.pairing.smooth import bulged_nodes
from skfem_contact.records import dataclass
from skfem_contact.trees import ODD

# A multiplier of its own needs this share of the node's integral over the whole facet.
SHARE_KEPT = 1 / 4


@dataclass(frozen=True, eq=False)
class Pairing:
    """The partner of each point, in the same form for every discretisation and every obstacle.

    Attributes
    ----------
    points : ndarray, shape (m, d)
        Positions of the contact points, on the secondary surface [length].
    normal : ndarray, shape (m, d)
        Unit normals, from primary to secondary. A pairing takes them from one side; with small
        sliding `frames.loaded_frames` weights those of both.
    tangent : ndarray, shape (m, d-1, d)
        Unit tangents; in 2-D the normal rotated by +90 degrees.
    gap : ndarray, shape (m,)
        Geometric gap along the normal [length], > 0 open; infinite where not paired.
    area : ndarray, shape (m,)
        Tributary areas.
    secondary_weights : csr_matrix, shape (m, number of secondary nodes)
        Weights of the secondary nodes; the identity for node-to-segment contact.
    primary_weights : csr_matrix, shape (m, number of primary nodes)
        Weights of the primary nodes; no columns for rigid obstacles.
    paired : ndarray of bool, shape (m,)
    miss : ndarray, shape (m,)
        By how much the point lies beyond the end of the primary surface, measured along the
        surface [length]; 0 where paired, infinite where there is nothing it could be beyond of.
    facet : ndarray of int, shape (m,)
        Primary facet; -1 where there is none.
    secondary_normal, primary_normal : ndarray, shape (m, d), optional
        Unit normals of the two sides at the points, both from primary to secondary; None where one
        side has the frame for itself (rigid obstacles).
    slip_weights : (csr_matrix, csr_matrix), optional
        In place of `secondary_weights` and `primary_weights` in the tangential rows that are `still`.
    still : ndarray of bool, shape (m, d-1), optional
        Tangents of points along which the slip is what supports make it: their tangential rows have
        only what is prescribed, see `dual`.
    primary_bulge : bsr_matrix, shape (m d, number of primary nodes d), optional
        A block for each point and primary node: how the height of the smooth boundaries above their
        facets, a vector, moves with the nodes (`smooth`). Blocks of a row sum to zero; applied to the
        positions they give the vector itself. None where no facet stands for a curve.
    smooth : ndarray, shape (m,), optional
        By how much the gap is a distance between smooth boundaries, and not a part of the vector
        between facets: 0 to 1.
    least_gap : ndarray, shape (m,), optional
        Gaps are no less than this, whatever the weights say (`mortar.least_gaps`) [length].
    corners : frozenset
        Vertices that carry by themselves, see `corners.CornerContacts.names`.
    vertex : ndarray of int, shape (m,), optional
        The primary node whose row a point carries in place of its own (`corners`); -1 where it
        carries its own. None where all do.
    control : bool
        Whether rows are at control points, combined of those at the nodes.
    """

    points: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    gap: np.ndarray
    area: np.ndarray
    secondary_weights: csr_matrix
    primary_weights: csr_matrix
    paired: np.ndarray
    miss: np.ndarray
    facet: np.ndarray
    secondary_normal: np.ndarray | None = None
    primary_normal: np.ndarray | None = None
    slip_weights: tuple[csr_matrix, csr_matrix] | None = None
    still: np.ndarray | None = None
    primary_bulge: bsr_matrix | None = None
    smooth: np.ndarray | None = None
    least_gap: np.ndarray | None = None
    corners: frozenset[tuple[int, int]] = frozenset()
    vertex: np.ndarray | None = None
    control: bool = False

    @property
    def action(self) -> np.ndarray:
        """The points where forces act, shape (m, d): mean positions of nodes that share a row."""
        mean = self.secondary_weights @ self.points
        return np.where(self.paired[:, None], mean, self.points)

    @property
    def tilt(self) -> np.ndarray:
        """Angle between the normals of the two sides, shape (m,) [rad]; zero where not paired.

        Sides that are in contact have one normal, so under load both have turned, together by this
        angle. With small sliding the frame is fixed and can only be the expected normal of the
        loaded interface (`conditions.discretisation`): friction is trusted as far as the tilt is small
        against the coefficient of friction. Zero for rigid obstacles, whose normal is exact.
        """
        if self.secondary_normal is None or self.primary_normal is None:
            return np.zeros(len(self.gap))
        angle = angle_between(self.secondary_normal, self.primary_normal)
        return np.where(self.paired, angle, 0.0)

    def __repr__(self) -> str:
        return f"<Pairing: {np.count_nonzero(self.paired)} of {len(self.gap)} points paired>"


def gap_vectors(
    secondary: ContactSurface,
    primary: ContactSurface,
    secondary_weights: csr_matrix,
    primary_weights: csr_matrix,
    primary_bulge: bsr_matrix | None = None,
) -> np.ndarray:
    """From the primary to the secondary at each point of a pairing, shape (m, d) [length]."""
    away = secondary_weights @ secondary.points - primary_weights @ primary.points
    if primary_bulge is None:
        return np.asarray(away)
    return np.asarray(away + (primary_bulge @ primary.points.ravel()).reshape(away.shape))


def node_to_segment(
    secondary: ContactSurface,
    primary: ContactSurface,
    *,
    reach: float | None = None,
    extended: bool = False,
) -> Pairing:
    """Pair every node of the secondary surface with its closest point on the primary surface.

    Parameters
    ----------
    secondary, primary : ContactSurface
        Both are curves, or faces of solids; as a rule the secondary one is the finer.
    reach : float, optional
        Largest distance between a node and its partner [length]. Without it, gaps are unlimited
        and overlaps go up to half the diagonal of the box around the smaller of the two surfaces,
        so that the far side of a body is not taken for an overlap.
    extended : bool
        Whether the primary goes on a little beyond its ends, see `closest.margins`: with finite
        sliding. Points there are paired with the end.

    Returns
    -------
    Pairing

    Notes
    -----
    The closest point is taken among the facets that face the node (`search.FACING`) and hold a
    stationary point of the distance to the *whole* primary surface. So a node beyond the end or rim of
    an open surface has no partner (tolerance: `digits.GIVEN` of the size of a facet), and one
    outside a smooth convex vertex or edge is paired with that vertex or edge. Around a corner of 45
    degrees or more it is paired with it along the normal of the facet most opposite to the node, as
    long as it lies at most 45 degrees off that normal; farther out it overhangs. Of equally near facets
    (a concave corner) the most opposite one is taken; ties do not depend on the numbering.

    The normal is interpolated between the averaged normals at the corners of the facet
    (`bodies.normal_field`). Normals of the facets themselves jump from one facet to the next: a node
    that slides over a joint would be jerked, and between curved surfaces with matching meshes, where
    nodes lie on joints, round-off would choose a normal that is off by half the angle of a facet, an
    error of first order in the mesh size. ``gap = normal . (x_s - x_p)``.

    Examples
    --------
    A small square above a large one; the closest points lie inside the only facet of the large
    one:

    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> from skfem_contact.bodies.body import Body
    >>> def square(side, x, y):
    ...     mesh = fem.MeshQuad().scaled(side).translated((x, y)).with_defaults()
    ...     return Body(fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1())), linear_elasticity())
    >>> pairing = node_to_segment(
    ...     square(1.0, 1.0, 4.5).surface("bottom"), square(4.0, 0.0, 0.0).surface("top")
    ... )
    >>> pairing.points.tolist(), pairing.gap.tolist(), pairing.normal.tolist()
    ([[1.0, 4.5], [2.0, 4.5]], [0.5, 0.5], [[0.0, 1.0], [0.0, 1.0]])
    >>> pairing.primary_weights.toarray().tolist()
    [[0.25, 0.75], [0.5, 0.5]]
    """
    if secondary.dim != primary.dim:
        raise InputError(
            f"surface {secondary.label!r} is {secondary.dim}-D, surface {primary.label!r} "
            f"{primary.dim}-D"
        )
    outside, inside = search_range(secondary, primary, reach)
    point, facet, xi = closest_facets(secondary, primary, outside, inside, extended)
    N, normal = primary.kind.shapes(xi)[0], interpolated_normals(primary, facet, xi)
    foot = np.einsum("pk,pkd->pd", N, primary.points[primary.facets[facet]])
    gap = dot(normal, secondary.points.take(point, axis=0) - foot)
    gap, smooth, bulge = bulged_nodes(secondary, primary, (point, facet, N), normal, gap)
    sides = _node_normals(secondary, primary, point, facet, N, normal)
    m = len(secondary.points)
    paired = np.zeros(m, dtype=bool)
    paired[point] = True
    miss, end_facet = overhang(secondary, primary, ~paired, outside, inside)
    end_facet[point] = facet
    # where there is no partner the frame is the node's own, turned round
    normals, of_secondary, of_primary = (-secondary.normals for _ in range(3))
    normals[point], (of_secondary[point], of_primary[point]) = normal, sides
    gaps = np.full(m, np.inf)
    gaps[point] = gap
    return Pairing(
        points=secondary.points,
        normal=normals,
        tangent=tangents(normals),
        gap=gaps,
        area=secondary.area,
        secondary_weights=identity(m, format="csr"),
        primary_weights=_weights(secondary, primary, point, facet, N),
        paired=paired,
        miss=miss,
        facet=end_facet,
        secondary_normal=of_secondary,
        primary_normal=of_primary,
        primary_bulge=bulge,
        smooth=smooth,
    )


def _weights(
    secondary: ContactSurface, primary: ContactSurface, point: Index, facet: Index, shape: Array
) -> csr_matrix:
    """Shape functions (p, k) at the feet of some nodes as weights of the primary's nodes."""
    size = len(secondary.points), len(primary.points)
    at = np.repeat(point, shape.shape[1]), primary.facets[facet].ravel()
    weights: csr_matrix = assembled(at, shape.ravel(), size)
    weights.eliminate_zeros()
    return shared_at_seams(secondary, primary, weights)


def _node_normals(
    secondary: ContactSurface,
    primary: ContactSurface,
    point: Index,
    facet: Index,
    shape: Array,
    feet: Array,
) -> tuple[Array, Array]:
    """Normals of both sides where nodes stand above feet, from primary to secondary, (p, d) each.

    What they enclose is the tilt of the interface: a pairing takes its frames from one side, and where
    the sides are curved their normals differ as long as a gap is open between them. On a sharp edge or
    corner, and at a kink in a straight side, a side has no normal: there that of the other side stands
    for both.

    Parameters
    ----------
    secondary, primary : ContactSurface
    point, facet : ndarray of int, shape (p,)
        Nodes that have a foot, and the facets with it.
    shape : ndarray, shape (p, k)
        Shape functions at the feet.
    feet : ndarray, shape (p, d)
        Normals of the primary there.
    """
    own, nodes = -secondary.normals[point], primary.facets[facet]
    corner = (secondary.sharp_points | (secondary.kinks > LEAN))[point, None]
    sharp, on = primary.sharp_points | (primary.kinks > LEAN), shape >= 1 - GIVEN
    at_corner = np.any(sharp[nodes] & on, axis=1)
    if primary.dim == 3:
        on_edges = shape[:, primary.kind.edges].sum(axis=2) >= 1 - GIVEN
        at_corner |= np.any(primary.sharp_edges[facet] & on_edges, axis=1)
    # beside a kink the field of normals is on its way to the mean of both parts
    at_corner = (at_corner | np.any(primary.kinks[nodes] > LEAN, axis=1))[:, None]
    return np.where(corner & ~at_corner, feet, own), np.where(at_corner & ~corner, own, feet)


def shared_at_seams(
    secondary: ContactSurface, primary: ContactSurface, weights: csr_matrix
) -> csr_matrix:
    """Weights of feet on seams shared evenly between the parts that meet there, without being joined.

    Two foundations side by side, or the lips of a slit, have nodes of their own at one place. A node
    whose foot lies there is carried by all of them alike: by one of them alone, a symmetric scene would
    have forces that are not.

    Parameters
    ----------
    secondary, primary : ContactSurface
    weights : csr_matrix, shape (m, number of primary nodes)
        Shape functions of one facet each.
    """
    if secondary.body is primary.body:  # the tip of a slit belongs to both lips
        return weights
    place = _places(primary)
    if place is None:
        return weights
    i, node, part = entries(weights)
    kept, several = np.abs(part) > GIVEN, np.bincount(place)[place] > 1
    inside = np.bincount(i, kept, len(weights.indptr) - 1) == primary.facets.shape[1]
    on_seam = (weights @ several.astype(float) > 1.0 - GIVEN) & ~inside
    chosen = np.flatnonzero(kept & on_seam[i])
    # all nodes at these places that face the secondary's
    order = np.argsort(place, kind="stable")
    count = np.bincount(place)[place[node[chosen]]]
    start = np.searchsorted(place[order], place[node[chosen]])
    row, lip, part = np.repeat(i[chosen], count), order[ragged(start, count)], part[chosen]
    faces = dot(primary.normals[lip], secondary.normals[row]) < -FACING
    faces |= lip == np.repeat(node[chosen], count)
    of = np.repeat(np.arange(len(chosen)), count)[faces]
    data = (part / np.bincount(of))[of] / np.bincount(i[chosen], part, len(inside))[row[faces]]
    shared = csr_matrix((data, (row[faces], lip[faces])), shape=weights.shape)
    return csr_matrix(diags(np.where(on_seam, 0.0, 1.0)) @ weights + shared)


def _places(surface: ContactSurface) -> Index | None:
    """The place of each node, by its number; None where no two nodes share one."""
    points, near = surface.points, GIVEN * float(np.min(surface.lengths))
    order = np.argsort(points @ ODD[: points.shape[1]])  # nodes at one place follow each other
    away = sizes(np.diff(points[order], axis=0))
    if not np.count_nonzero(away <= near):
        return None
    place = np.zeros(len(points), dtype=np.intp)
    place[order[1:]] = np.cumsum(away > near)
    return place


def at_control_points(surface: ContactSurface, pairing: Pairing, away: Array) -> Pairing:
    """The pairing of nodes with its rows at control points, where faces ask for it.

    Parameters
    ----------
    surface : ContactSurface
        The secondary.
    pairing : Pairing
        Node by node: its rows have one node of the secondary each.
    away : ndarray, shape (m, 3)
        From the foot of every node to the node; anything where not paired [length].

    Returns
    -------
    Pairing
        The same if no face is of these kinds, as on curves. Middle nodes next to a corner without a
        partner keep their own row.
    """
    if not surface.kind.taken:
        return pairing
    W = control_weights(surface, pairing.paired)
    # the gap of a node is that to the smooth boundary
    rest = np.where(pairing.paired, pairing.gap, 0.0) - dot(pairing.normal, away)
    away = np.where(pairing.paired[:, None], away + rest[:, None] * pairing.normal, 0.0)
    gap = dot(pairing.normal, W @ away)
    # unit pressure has the nodal forces W' area = int N
    share = abs(diags(W.diagonal()) - W)
    own = surface.area / W.diagonal()
    area = np.where(
        W.diagonal() > 1, own, surface.area + share.T @ np.where(W.diagonal() > 1, own, 0.0)
    )
    return replace(
        pairing,
        gap=np.where(pairing.paired, gap, np.inf),
        area=area,
        secondary_weights=W,
        primary_weights=csr_matrix(W @ pairing.primary_weights),
        control=True,
    )


def gap_weights(pairing: Pairing) -> csr_matrix | None:
    """Gaps that are given at the nodes in those of the rows, (m, m); None where rows are at nodes.

    They are lengths along the nodes' own normals: with the angles between these a body that swells
    evenly closes an even gap in all rows at once, on curved surfaces too.
    """
    if not pairing.control:
        return None
    W = pairing.secondary_weights.tocoo()
    turned = dot(pairing.normal[W.row], pairing.normal[W.col])
    return csr_matrix((W.data * turned, (W.row, W.col)), shape=W.shape)


def control_weights(surface: ContactSurface, paired: Mask) -> csr_matrix:
    """Weights of the nodes at control points, (m, m): rows of the identity but for middles of edges."""
    m = len(surface.points)
    edges = np.unique(surface.facets[:, surface.kind.edges].reshape(-1, 3)[:, [2, 0, 1]], axis=0)
    # an edge is met from both of its faces, once in each direction
    _, first = np.unique(edges[:, 0], return_index=True)
    middle, start, end = edges[first][paired[edges[first]].all(axis=1)].T
    own = np.ones(m)
    own[middle] = 2.0
    row = np.concatenate([np.arange(m), middle, middle])
    column = np.concatenate([np.arange(m), start, end])
    data = np.concatenate([own, np.full(2 * len(middle), -0.5)])
    return csr_matrix((data, (row, column)), shape=(m, m))


# -- nodes with next to no area ---------------------------------------------------------------------


def poor_nodes(surface: ContactSurface) -> Mask:
    """Nodes of facets whose function has next to no integral there, shape (nf, k).

    The end of a quadratic line on the axis of symmetry: its integral is zero if the line is straight,
    else that of the curvature, and a force over it is off by the errors of the neighbours' forces.
    """
    return _positive_shares(surface)[2]


def whole_shares(surface: ContactSurface) -> Array:
    """Integrals of what the multipliers are dual to over whole facets, shape (nf, k) [area].

    Where one is next to zero, at `poor_nodes`, it is that of a facet of the same area off the axis:
    every share is a part of something.
    """
    whole, plain, poor = _positive_shares(surface)
    return np.where(poor, plain, whole)


def _positive_shares(surface: ContactSurface) -> tuple[Array, Array, Mask]:
    """Integrals of the positive functions, (nf, k), those on straight facets of the same area, and
    where they are zero; on the axis also where they are less than multipliers need.
    """
    kind, shares, measure = surface.kind, surface.shares, surface.body.measure
    positive = positive_functions(kind)
    whole, plain = shares @ positive.T, np.outer(shares.sum(axis=1), positive @ kind.shares)
    poor = whole <= COMPUTED * plain
    if measure is not None:
        at = np.moveaxis(surface.measured_at[surface.facets], -1, 0)
        weight = np.broadcast_to(measure(at), whole.shape)
        on_axis = weight <= COMPUTED * weight.max(axis=1, keepdims=True)
        poor |= on_axis & (whole < SHARE_KEPT * plain)
    return whole, plain, poor
