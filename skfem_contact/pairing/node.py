"""`Pairing`: which point meets what; and the pairing of node-to-segment contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, identity

from skfem_contact.bodies.facets import facet_shapes
from skfem_contact.bodies.normals import angle_between, tangents
from skfem_contact.bodies.projection import interpolated_normals
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.errors import InputError
from skfem_contact.pairing.bulges import bulged_nodes
from skfem_contact.pairing.closest import closest_facets, overhang, search_range
from skfem_contact.pairing.facing import node_normals
from skfem_contact.pairing.seams import shared_at_seams


@dataclass(frozen=True, eq=False)
class Pairing:
    """Which point meets what: the same for every discretisation and every obstacle.

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
        only what is prescribed, see `supports`.
    primary_bulge : bsr_matrix, shape (m d, number of primary nodes d), optional
        A block for each point and primary node: how the height of the smooth boundaries above their
        facets, a vector, moves with the nodes (`smooth`). Blocks of a row sum to zero; applied to the
        positions they give the vector itself. None where no facet stands for a curve.
    smooth : ndarray, shape (m,), optional
        By how much the gap is a distance between smooth boundaries, and not a part of the vector
        between facets: 0 to 1.
    least_gap : ndarray, shape (m,), optional
        Gaps are no less than this, whatever the weights say of them (`kinks`) [length].
    corners : frozenset
        Vertices that carry by themselves, see `corners.CornerContacts.names`.
    vertex : ndarray of int, shape (m,), optional
        The primary node whose row a point carries in place of its own (`corners`); -1 where it
        carries its own. None where all do.
    control : bool
        Whether rows are at control points (`faces.control`), combined of those at the nodes.
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
        """Where forces act, shape (m, d): the weighted position of nodes that share a row."""
        mean = self.secondary_weights @ self.points
        return np.where(self.paired[:, None], mean, self.points)

    @property
    def tilt(self) -> np.ndarray:
        """Angle between the normals of the two sides, shape (m,) [rad]; zero where not paired.

        Sides that are in contact have one normal, so under load both have turned, together by this
        angle. With small sliding the frame is fixed and can only be the expected normal of the
        loaded interface (`frames`): friction is trusted as far as the tilt is small against the
        coefficient of friction. Zero for rigid obstacles, whose normal is exact.
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
        As a rule the secondary one is the finer.
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
    The closest point is taken among the facets that face the node (`closest.FACING`) and hold a
    stationary point of the distance to the *whole* primary surface. So a node beyond the end of an
    open surface has no partner (tolerance: `closest.END` facet lengths), and one outside a smooth
    convex vertex is paired with that vertex. Around a corner of 45 degrees or more it is paired
    with the vertex, along the normal of the facet most opposite to the node, as long as it lies at
    most 45 degrees off that normal; farther out it overhangs. Of equally near facets (a concave
    corner) the most opposite one is taken, then the first.

    The normal is interpolated between the averaged normals at the ends of the facet. Normals of
    the facets themselves jump from one facet to the next: a node that slides over a joint would be
    jerked, and between curved surfaces with matching meshes, where nodes lie on joints, round-off
    would choose a normal that is off by half the angle of a facet, an error of first order in the
    mesh size. ``gap = normal . (x_s - x_p)``.

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

    N, _ = facet_shapes(xi, primary.facets.shape[1])
    nodes = primary.facets[facet]
    normal = interpolated_normals(primary, facet, xi)
    foot = np.einsum("pk,pkd->pd", N, primary.points[nodes])
    gap = np.einsum("pd,pd->p", normal, secondary.points[point] - foot)
    sides = node_normals(secondary, primary, point, normal, N, nodes)
    beyond = overhang(secondary, primary, without(point, secondary), outside, inside)
    return nodes_at_feet(secondary, primary, point, facet, N, gap, normal, sides, beyond)


def without(point: np.ndarray, surface: ContactSurface) -> np.ndarray:
    """All nodes of a surface but these, a mask of shape (m,)."""
    others = np.ones(len(surface.points), dtype=bool)
    others[point] = False
    return others


def nodes_at_feet(
    secondary: ContactSurface,
    primary: ContactSurface,
    point: np.ndarray,
    facet: np.ndarray,
    shape: np.ndarray,
    gap: np.ndarray,
    normal: np.ndarray,
    sides: tuple[np.ndarray, np.ndarray],
    beyond: tuple[np.ndarray, np.ndarray],
) -> Pairing:
    """The pairing of nodes with their closest points.

    Parameters
    ----------
    secondary, primary : ContactSurface
    point, facet : ndarray of int, shape (p,)
        Nodes that have a foot, and the facets with it.
    shape : ndarray, shape (p, k)
        Shape functions at the feet.
    gap : ndarray, shape (p,)
    normal : ndarray, shape (p, d)
        At the feet.
    sides : (ndarray, ndarray), shape (p, d)
        Normals of both sides, see `facing.node_normals`.
    beyond : (ndarray, ndarray), shape (m,)
        `miss` and facets of the nodes without a foot, see `Pairing`.
    """
    m, nodes = len(secondary.points), primary.facets[facet]
    # where there is no partner the frame is the node's own, turned round
    normals, gaps = -secondary.normals, np.full(m, np.inf)
    of_secondary = normals.copy()
    gap, smooth, bulge = bulged_nodes(secondary, primary, (point, facet, shape), normal, gap)
    normals[point], gaps[point] = normal, gap
    of_primary = normals.copy()
    of_secondary[point], of_primary[point] = sides
    weights = csr_matrix(
        (shape.ravel(), (np.repeat(point, shape.shape[1]), nodes.ravel())),
        shape=(m, len(primary.points)),
    )
    weights.eliminate_zeros()
    weights = shared_at_seams(secondary, primary, weights)
    miss, end_facet = beyond
    end_facet[point] = facet
    return Pairing(
        points=secondary.points,
        normal=normals,
        tangent=tangents(normals),
        gap=gaps,
        area=secondary.area,
        secondary_weights=identity(m, format="csr"),
        primary_weights=weights,
        paired=~without(point, secondary),
        miss=miss,
        facet=end_facet,
        secondary_normal=of_secondary,
        primary_normal=of_primary,
        primary_bulge=bulge,
        smooth=smooth,
    )
