"""Node-to-segment pairing: closest facet, local coordinate, shape weights, frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, identity
from scipy.spatial import cKDTree

from skfem_contact.errors import InputError
from skfem_contact.facets import facet_shapes
from skfem_contact.normals import CORNER
from skfem_contact.search import FacetTree
from skfem_contact.selection import place
from skfem_contact.surface import ContactSurface

#: A facet is a candidate if its normal n_p and that of the node, n_s, have n_s . n_p < -FACING:
#: they may be up to 84 degrees off the exactly opposite direction.
FACING = 0.1

#: A point beyond the end of a surface by this fraction of a facet length still counts as above its
#: end.
END = 1e-6

#: Facets whose distances differ by less than this fraction of a facet length are equally near.
TIE = 1e-9


@dataclass(frozen=True, eq=False)
class Pairing:
    """Which point meets what: the same for every discretisation and every obstacle.

    Attributes
    ----------
    points : ndarray, shape (m, d)
        Positions of the contact points, on the secondary surface [length].
    normal : ndarray, shape (m, d)
        Unit normals, from primary to secondary.
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

    def __repr__(self) -> str:
        return f"<Pairing: {np.count_nonzero(self.paired)} of {len(self.gap)} points paired>"


def tangents(normal: np.ndarray) -> np.ndarray:
    """Tangents (m, 1, 2) to normals (m, 2): rotated by +90 degrees.

    >>> tangents(np.array([[0.0, 1.0]])).tolist()
    [[[-1.0, 0.0]]]
    """
    return np.stack([-normal[:, 1], normal[:, 0]], axis=1)[:, None, :]


def node_to_segment(
    secondary: ContactSurface, primary: ContactSurface, *, reach: float | None = None
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

    Returns
    -------
    Pairing

    Notes
    -----
    The closest point is taken among the facets that face the node (`FACING`) and hold a stationary
    point of the distance to the *whole* primary surface. So a node beyond the end of an open
    surface has no partner (tolerance: `END` facet lengths), and one outside a smooth convex vertex
    is paired with that vertex. Around a corner sharper than 45 degrees it is paired with the
    vertex, along the normal of the facet most opposite to the node, as long as it lies at most 45
    degrees off that normal; farther out it overhangs. Of equally near facets (a concave corner)
    the most opposite one is taken, then the first.

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
    >>> from skfem_contact.body import Body
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
    point, facet, xi = _closest(secondary, primary, outside, inside)

    m = len(secondary.points)
    paired = np.zeros(m, dtype=bool)
    paired[point] = True
    # where there is no partner the frame is the node's own, turned round
    normal = -secondary.normals
    normal[point] = interpolated_normals(primary, facet, xi)
    N, _ = facet_shapes(xi, primary.facets.shape[1])
    nodes = primary.facets[facet]
    gap = np.full(m, np.inf)
    foot = np.einsum("pk,pkd->pd", N, primary.points[nodes])
    gap[point] = np.einsum("pd,pd->p", normal[point], secondary.points[point] - foot)
    weights = csr_matrix(
        (N.ravel(), (np.repeat(point, N.shape[1]), nodes.ravel())),
        shape=(m, len(primary.points)),
    )
    weights.eliminate_zeros()
    miss, end_facet = _overhang(secondary, primary, ~paired, outside, inside)
    end_facet[point] = facet
    return Pairing(
        points=secondary.points,
        normal=normal,
        tangent=tangents(normal),
        gap=gap,
        area=secondary.area,
        secondary_weights=identity(m, format="csr"),
        primary_weights=weights,
        paired=paired,
        miss=miss,
        facet=end_facet,
    )


def interpolated_normals(surface: ContactSurface, facet: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Continuous unit normal field at local coordinates `xi` of facets, shape (len(facet), d)."""
    ends = surface.facet_node_normals[facet]
    normal = (1 - xi)[:, None] * ends[:, 0] + xi[:, None] * ends[:, 1]
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def project(
    surface: ContactSurface, facet: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Closest points of facets to points, one facet for each point.

    Parameters
    ----------
    surface : ContactSurface
    facet : ndarray of int, shape (p,)
    points : ndarray, shape (p, d)

    Returns
    -------
    xi : ndarray, shape (p,)
        Local coordinate, in [0, 1].
    foot : ndarray, shape (p, d)
        The closest point.
    over : ndarray, shape (p,)
        By how much the point lies beyond the nearer end, along the tangent there [length]; else 0.
    """
    corners = surface.points[surface.facets[facet]]
    k = corners.shape[1]
    chord = corners[:, 1] - corners[:, 0]
    xi = np.einsum("pd,pd->p", points - corners[:, 0], chord) / np.einsum("pd,pd->p", chord, chord)
    xi = np.clip(xi, 0.0, 1.0)
    if k == 3:
        xi = _newton(corners, points, xi)
    N, dN = facet_shapes(xi, k)
    foot = np.einsum("pk,pkd->pd", N, corners)
    along = np.einsum("pk,pkd->pd", dN, corners)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    beyond = np.einsum("pd,pd->p", points - foot, along)
    over = np.where(xi >= 1, beyond, np.where(xi <= 0, -beyond, 0.0))
    return xi, foot, np.maximum(over, 0.0)


def _newton(corners: np.ndarray, points: np.ndarray, xi: np.ndarray) -> np.ndarray:
    """Minimise the distance to quadratic facets: projected Newton steps, best of six starts."""
    fixed = np.broadcast_to(np.linspace(0.0, 1.0, 5)[:, None], (5, len(xi)))
    starts = np.vstack([fixed, xi])
    where = np.einsum("spk,pkd->spd", facet_shapes(starts, 3)[0], corners)
    best = np.argmin(np.sum((where - points) ** 2, axis=2), axis=0)
    xi = starts[best, np.arange(len(xi))]
    second = 4 * corners[:, 0] + 4 * corners[:, 1] - 8 * corners[:, 2]
    for _ in range(12):
        N, dN = facet_shapes(xi, 3)
        apart = np.einsum("pk,pkd->pd", N, corners) - points
        first = np.einsum("pk,pkd->pd", dN, corners)
        squared = np.einsum("pd,pd->p", first, first)
        # beyond the centre of curvature the second derivative is negative: keep descending
        slope = np.maximum(squared + np.einsum("pd,pd->p", apart, second), 0.1 * squared)
        new = np.clip(xi - np.einsum("pd,pd->p", apart, first) / slope, 0.0, 1.0)
        change, xi = np.abs(new - xi).max(initial=0.0), new
        if change <= 1e-14:
            break
    return xi


def search_range(
    secondary: ContactSurface, primary: ContactSurface, reach: float | None
) -> tuple[float, float]:
    """Largest distances at which partners are looked for: of open points, of overlapping ones."""
    if reach is None:
        boxes = [np.linalg.norm(np.ptp(s.points, axis=0)) for s in (secondary, primary)]
        return np.inf, 0.5 * float(min(boxes))
    if not isinstance(reach, int | float | np.number) or not reach > 0:
        raise InputError(f"reach={reach!r} is not a positive length")
    return float(reach), float(reach)


def _closest(
    secondary: ContactSurface, primary: ContactSurface, outside: float, inside: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Point numbers, facets and local coordinates of all pairs."""

    def valid_pairs(point: np.ndarray, facet: np.ndarray) -> tuple[np.ndarray, ...]:
        xi, distance, valid = _judge(secondary, primary, point, facet, outside, inside)
        return point[valid], facet[valid], xi[valid], distance[valid]

    # a first guess among the nearest facets bounds the distance, the exact search then is short
    m = len(secondary.points)
    bound = np.full(m, np.inf)
    few = min(4, len(primary.facets))
    _, guess = cKDTree(primary.points[primary.facets].mean(axis=1)).query(secondary.points, k=few)
    point, facet, _, distance = valid_pairs(np.repeat(np.arange(m), few), guess.reshape(-1))
    np.minimum.at(bound, point, distance + 2 * TIE * primary.lengths[facet])

    blocks = FacetTree.build(primary).candidates(
        secondary.points,
        secondary.normals,
        facing=float(np.arccos(FACING)),
        bound=bound,
        outside=outside,
        inside=inside,
    )
    found = [valid_pairs(point, facet) for point, facet in blocks]
    point, facet, xi, distance = (np.concatenate(column) for column in zip(*found, strict=True))
    nearest = np.full(m, np.inf)
    np.minimum.at(nearest, point, distance)
    near = distance <= nearest[point] + TIE * primary.lengths[facet]
    point, facet, xi = point[near], facet[near], xi[near]
    facing = np.einsum("pd,pd->p", secondary.normals[point], primary.facet_normals[facet])
    # rounded, so that round-off does not decide between two sides of a symmetric corner
    order = np.lexsort((facet, np.round(facing, 6), point))
    _, first = np.unique(point[order], return_index=True)
    chosen = order[first]
    return point[chosen], facet[chosen], xi[chosen]


def _judge(
    secondary: ContactSurface,
    primary: ContactSurface,
    point: np.ndarray,
    facet: np.ndarray,
    outside: float,
    inside: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Local coordinate and distance of each pair, and whether the facet may be the partner."""
    x = secondary.points[point]
    xi, foot, over = project(primary, facet, x)
    apart = x - foot
    distance = np.linalg.norm(apart, axis=1)
    height = np.einsum("pd,pd->p", apart, interpolated_normals(primary, facet, xi))
    facing = np.einsum("pd,pd->p", secondary.normals[point], primary.facet_normals[facet]) < -FACING
    above_facet = over <= END * primary.lengths[facet]

    # beyond an end: the vertex is the closest point only if it is that of the next facet, too
    side = (xi >= 0.5).astype(int)
    other = primary.neighbours[facet, side]
    own_normal = primary.end_normals[facet, side]
    next_normal = primary.end_normals[other, 1 - side]
    into_next = np.where(side == 1, 1.0, -1.0)[:, None] * tangents(next_normal)[:, 0]
    beyond_next = np.einsum("pd,pd->p", apart, into_next) > END * primary.lengths[other]
    smooth = np.einsum("pd,pd->p", own_normal, next_normal) >= CORNER
    in_cone = over <= np.abs(np.einsum("pd,pd->p", apart, own_normal)) * (1 + END)
    at_vertex = (other >= 0) & ~beyond_next & (smooth | in_cone)

    within = np.where(height >= 0, distance <= outside, distance <= inside)
    itself = np.zeros(len(point), dtype=bool)
    if secondary.body is primary.body:  # the tip of a slit belongs to both lips
        mine = secondary.dofs[point, 0]
        itself = (primary.dofs[primary.facets[facet], 0] == mine[:, None]).any(axis=1)
    return xi, distance, facing & (above_facet | at_vertex) & within & ~itself


def _overhang(
    secondary: ContactSurface,
    primary: ContactSurface,
    lonely: np.ndarray,
    outside: float,
    inside: float,
) -> tuple[np.ndarray, np.ndarray]:
    """By how much points without a partner lie beyond the nearest end or corner facing them."""
    miss = np.where(lonely, np.inf, 0.0)
    end_facet = np.full(len(miss), -1)
    other = primary.neighbours
    bend = np.einsum("fsd,fsd->fs", primary.end_normals, primary.end_normals[other, [1, 0]])
    facet, side = np.nonzero((other < 0) | (bend < CORNER))
    point = np.flatnonzero(lonely)
    if not (len(facet) and len(point)):
        return miss, end_facet
    vertex = primary.points[primary.facets[facet, side]]
    few = min(8, len(facet))
    _, near = cKDTree(vertex).query(secondary.points[point], k=few)
    near = near.reshape(len(point), few)
    apart = secondary.points[point][:, None] - vertex[near]
    normal = primary.end_normals[facet, side][near]
    outward = np.where(side == 1, 1.0, -1.0)[:, None] * tangents(primary.end_normals[facet, side])[:, 0]
    along = np.einsum("pkd,pkd->pk", apart, outward[near])
    height = np.einsum("pkd,pkd->pk", apart, normal)
    faces = np.einsum("pd,pkd->pk", secondary.normals[point], primary.facet_normals[facet][near])
    within = (height <= outside) & (height >= -inside)
    good = (faces < -FACING) & (along > 0) & within
    first = np.argmax(good, axis=1)
    rows = np.flatnonzero(good.any(axis=1))
    miss[point[rows]] = along[rows, first[rows]]
    end_facet[point[rows]] = facet[near[rows, first[rows]]]
    return miss, end_facet


def diagnose(pairing: Pairing, secondary: ContactSurface, primary: Any) -> list[str]:
    """Say in sentences what looks wrong with a pairing; an empty list if nothing does.

    Parameters
    ----------
    pairing : Pairing
    secondary : ContactSurface
    primary : ContactSurface or rigid obstacle

    Returns
    -------
    list of str
        Points beyond the end of the primary surface, points without any partner, surfaces that
        face the same way, a primary surface finer than the secondary one.
    """
    lines = []
    beyond = ~pairing.paired & np.isfinite(pairing.miss)
    lost = ~pairing.paired & ~beyond
    m = len(pairing.paired)
    if beyond.any():
        lines.append(_say_beyond(pairing, secondary, primary, beyond))
    if not pairing.paired.any():
        lines.append(
            f"None of the {m} points of surface {secondary.label!r} finds a partner on "
            f"{primary.label!r}" + _say_why(secondary, primary)
        )
    elif lost.any():
        worst = int(np.flatnonzero(lost)[0])
        lines.append(
            f"{np.count_nonzero(lost)} of {m} points of surface {secondary.label!r} find nothing "
            f"of {primary.label!r} that faces them within reach; the first is point {worst} at "
            f'{place(secondary.points[worst])}. They can never touch (outside="open"). Fine where '
            "the surface curves away; else enlarge `reach`, or the primary surface."
        )
    if isinstance(primary, ContactSurface) and pairing.paired.any():
        coarse, fine = _facet_sizes(pairing, secondary, primary)
        # closer than this the choice makes no difference worth a line
        if fine < 0.75 * coarse:
            lines.append(
                f"The primary surface {primary.label!r} is finer than the secondary one, "
                f"{secondary.label!r}: facets of {fine:.3g} against {coarse:.3g}. Nodes of the "
                "primary surface between those of the secondary one are not held; swap secondary "
                "and primary, "
                'or use method="mortar".'
            )
    return lines


def _say_beyond(pairing: Pairing, secondary: ContactSurface, primary: Any, beyond: np.ndarray) -> str:
    worst = int(np.argmax(np.where(beyond, pairing.miss, -1.0)))
    miss = pairing.miss[worst]
    facets = ""
    if isinstance(primary, ContactSurface):
        facets = f" ({miss / primary.lengths[pairing.facet[worst]]:.2g} facet lengths)"
    return (
        f"{np.count_nonzero(beyond)} of {len(beyond)} points of surface {secondary.label!r} "
        f"project outside surface {primary.label!r}; the farthest, point {worst} at "
        f"{place(secondary.points[worst])}, misses by {miss:.3g}{facets}. They can never touch "
        '(outside="open"). If they should: the primary surface may be too short, or the two are '
        "swapped; enlarge it, or swap secondary and primary."
    )


def _say_why(secondary: ContactSurface, primary: Any) -> str:
    if not isinstance(primary, ContactSurface):
        return "; see its position, the side it is on, and `hollow`."
    middle = primary.points[primary.facets].mean(axis=1)
    nearest, facet = map(np.asarray, cKDTree(middle).query(secondary.points))
    facing = np.einsum("md,md->m", secondary.normals, primary.facet_normals[facet])
    if np.median(facing) > FACING:
        return (
            f": the two face the same way (normals {place(secondary.normals[0])} and "
            f"{place(primary.facet_normals[facet[0]])} where they are close). Usually one of them "
            "is on the wrong side of its body: check the two `where`."
        )
    return (
        f": the closest point is {nearest.min():.3g} away. Check the units and positions of the "
        "two meshes, and `reach`."
    )


def _facet_sizes(
    pairing: Pairing, secondary: ContactSurface, primary: ContactSurface
) -> tuple[float, float]:
    """Median lengths of the secondary facets with a partner, and of the primary ones they meet."""
    both = pairing.paired[secondary.facets[:, :2]].all(axis=1)
    mine = secondary.lengths[both] if both.any() else secondary.lengths
    met = primary.lengths[pairing.facet[pairing.paired]]
    return float(np.median(mine)), float(np.median(met))
