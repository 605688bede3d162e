r"""Error of tractions on faces of solids: at edges, between nodes, and what scatters from node to node.

As on curves (`surface`), with what neighbours tell in the tangent plane. For linear faces only: on
quadratic ones the multipliers are others than the shape functions (`pairing.faces.dual`).

* *Edges of contact.* Around the edge (`contours`) the nodal field is compared with the square root of
  the distance from the edge that goes through the values of the second nodes inside.
* *Between nodes* with the parabola through a node and those around it, by least squares: on each face
  its difference to its own interpolation.
* *Ends of stick, ends of the surface*: a node less the plane through its neighbours, where that is much
  more than beside it. Of first order it is the error itself.
* *Scatter*: that misfit taken once and twice more, which leaves what jumps from node to node.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.answers.contours import (
    TRIANGLES,
    heights,
    least_squares,
    triangle_areas,
    with_centres,
)
from skfem_contact.answers.thresholds import NO_MISFIT, SEGMENTS_NEAR, SHARPER
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.facet_kinds import KINDS
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import FaceSurface
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.pairing.faces.joints import rim_points
from skfem_contact.trees import kd_tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Three = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Net:
    """The nodes of a surface of linear faces, joined by the edges of its faces.

    Attributes
    ----------
    surface : FaceSurface
    known : ndarray of bool, shape (m,)
        Nodes with a value; the others are no neighbours.
    """

    surface: FaceSurface
    known: Mask

    @cached_property
    def joined(self) -> csr_matrix:
        """Which known nodes are the ends of one edge, (m, m), zeros and ones."""
        corners = self.surface.facets
        i, j = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
        some = self.known[i] & self.known[j]
        i, j, m = i[some], j[some], len(self.known)
        out = csr_matrix((np.ones(2 * len(i)), (np.r_[i, j], np.r_[j, i])), shape=(m, m))
        out.data[:] = 1.0
        return out

    def beside(self, marked: Mask) -> Mask:
        """The marked nodes and their neighbours."""
        return np.asarray(marked | (self.joined @ marked.astype(float) > 0))

    def fit(self, values: Array, pairs: csr_matrix, quadratic: bool) -> tuple[Array, Mask]:
        """Polynomials (m, terms, k) by the values (m, k) of the nodes that each is paired with."""
        entries = pairs.tocoo()
        row, node = entries.row, entries.col
        x, t = self.surface.points, tangents(self.surface.normals)
        size = float(self.surface.lengths.mean())  # numbers of order one in all units
        u, v = np.einsum("pd,pkd->kp", x[node] - x[row], t[row]) / size
        terms = [np.ones(len(u)), u, v]
        terms += [0.5 * u**2, 0.5 * v**2, u * v] if quadratic else []
        columns = np.column_stack(terms)
        fits = [
            least_squares(columns, np.ones(len(row)), value[node], row, len(x)) for value in values.T
        ]
        scale = size ** -np.array([0.0, 1, 1, 2, 2, 2][: len(terms)])
        return np.stack([f for f, _ in fits], axis=2) * scale[:, None], fits[0][1]

    def misfit(self, values: Array) -> Array:
        """Values (m, k) less the plane through the neighbours; zero where these are no plane."""
        plane, there = self.fit(values, self.joined, quadratic=False)
        return np.where((there & self.known)[:, None], values - plane[:, 0], 0.0)

    def curvatures(self, values: Array) -> Array:
        """Second derivatives (m, 3, 3, k) of the values in space, across the normals."""
        pairs = self.joined @ self.joined + self.joined  # each with itself
        parabola, there = self.fit(values, csr_matrix(pairs), quadratic=True)
        t = tangents(self.surface.normals)
        uu, vv, uv = np.moveaxis(parabola[:, 3:], 1, 0)
        first, second = t[:, 0], t[:, 1]
        mixed = first[:, :, None] * second[:, None, :]
        H = np.einsum("mk,mi,mj->mijk", uu, first, first)
        H += np.einsum("mk,mi,mj->mijk", vv, second, second)
        H += np.einsum("mk,mij->mijk", uv, mixed + np.swapaxes(mixed, 1, 2))
        return np.where(there[:, None, None, None], H, 0.0)


def faces_error(values: ContactValues, traction: Array, unlike: bool) -> tuple[Three, Array]:
    """Errors by edges, facets and scatter over the norm of the traction; the share of each point.

    `unlike`: whether nodes press between others, so that values scatter; the part is NaN where all
    points are so near to an end that none tells by how much.
    """
    surface = values.surface
    assert isinstance(surface, FaceSurface)
    net = Net(surface, np.asarray(~surface.held.all(axis=1)))
    area, closed = surface.area, values.status != OPEN
    size = float(np.sum(area[:, None] * traction**2))
    rim = closed & net.beside(~closed)
    at_rim = rim[surface.facets].any(axis=1)
    first = net.misfit(traction)
    sharp = _sharp(net, values.status, first)
    of_edges = area / 3.0 * np.sum(first**2, axis=1) * (sharp & ~rim)
    of_edges += _at_rim(surface, values, closed, rim, at_rim, traction)
    smooth = ~at_rim & ~sharp[surface.facets].any(axis=1) & closed[surface.facets].any(axis=1)
    of_facets = _between(surface, net, smooth, traction)
    left_out = _near_ends(net, sharp | rim)
    scatter = area * _scatter(net, first, left_out)
    total = of_edges + of_facets + scatter
    share = total / total.sum() if total.sum() > NO_MISFIT**2 * size else np.zeros(len(total))

    def norm(part: Array) -> float:
        return float(np.sqrt(part.sum() / size)) if size > 0 else 0.0

    untold = unlike and bool(left_out[closed].all())
    return (norm(of_edges), norm(of_facets), np.nan if untold else norm(scatter)), share


def _between(surface: FaceSurface, net: Net, smooth: Mask, traction: Array) -> Array:
    """Squares of the parabolas less their interpolation on faces, by their nodes, (m,)."""
    out = np.zeros(len(surface.points))
    faces = np.flatnonzero(smooth)
    if not len(faces):
        return out
    at, weight = surface.kind.quadrature(4)
    N, _ = surface.kind.shapes(at)
    nodes = surface.facets[faces]
    x = surface.points[nodes]
    H = net.curvatures(traction)[nodes].mean(axis=1)
    x = x - x.mean(axis=1, keepdims=True)
    at_nodes = 0.5 * np.einsum("fai,fijk,faj->fak", x, H, x)
    inner = np.einsum("qa,fai->fqi", N, x)
    off = 0.5 * np.einsum("fqi,fijk,fqj->fqk", inner, H, inner) - np.einsum("qa,fak->fqk", N, at_nodes)
    square = np.einsum("q,fqk->f", weight / weight.sum(), off**2) * surface.facet_areas[faces]
    np.add.at(out, nodes, square[:, None] / nodes.shape[1])
    return out


def _at_rim(
    surface: FaceSurface, values: ContactValues, closed: Mask, rim: Mask, at_rim: Mask, traction: Array
) -> Array:
    """Squares of the nodal field less a root of the distance from the edge, by nodes, (m,)."""
    out, segments = np.zeros(len(surface.points)), values.contact_edges
    if not (at_rim.any() and len(segments)):
        return out
    faces = np.flatnonzero(at_rim)
    corners = np.array(TRIANGLES[surface.kind.name])
    h = with_centres(surface, heights(surface, closed, values.gap))[faces][:, corners]
    x = with_centres(surface, surface.points)[faces][:, corners]
    t = with_centres(surface, traction)[faces][:, corners]
    area = triangle_areas(surface, with_centres(surface, surface.points)[:, corners].reshape(-1, 3, 3))
    area = area.reshape(len(surface.facets), -1)[faces]
    xi, weight = KINDS["tri3"].quadrature(8)
    N = KINDS["tri3"].shapes(xi)[0]
    h = np.where(np.isfinite(h), h, np.abs(h[np.isfinite(h)]).max(initial=1.0))
    inside = np.einsum("qa,fta->ftq", N, h) < 0
    places = np.einsum("qa,ftad->ftqd", N, x)
    # how steep the root is at the nodes of the edge, by the values of those behind them
    behind = np.flatnonzero(closed & ~rim)
    if not len(behind):
        behind = np.flatnonzero(rim)
    depth = _distance(segments, surface.points[behind])
    near = kd_tree(surface.points[behind]).query(places.reshape(-1, 3))[1]
    slope = (traction[behind] / np.sqrt(np.maximum(depth, np.finfo(float).tiny))[:, None])[near]
    d = np.where(inside.ravel(), _distance(segments, places.reshape(-1, 3)), 0.0)
    root = (slope * np.sqrt(d)[:, None]).reshape(*places.shape[:3], -1)
    nodal = np.einsum("qa,ftak->ftqk", N, t)
    square = np.einsum("q,ftqk,ft->f", weight / weight.sum(), (nodal - root) ** 2, area)
    mine = rim[surface.facets[faces]]
    part = np.where(mine, (square / mine.sum(axis=1))[:, None], 0.0)
    np.add.at(out, surface.facets[faces], part)
    return out


def _distance(segments: Array, points: Array) -> Array:
    """Distances of points (p, 3) from the nearest of segments (s, 2, 3), (p,)."""
    few = min(SEGMENTS_NEAR, len(segments))
    near = kd_tree(segments.mean(axis=1)).query(points, k=few)[1].reshape(len(points), few)
    start, along = segments[near, 0], segments[near, 1] - segments[near, 0]
    away = points[:, None] - start
    part = np.sum(away * along, axis=2) / np.sum(along**2, axis=2)
    return np.asarray(
        np.linalg.norm(away - np.clip(part, 0.0, 1.0)[..., None] * along, axis=2).min(axis=1)
    )


def _sharp(net: Net, status: Index, first: Array) -> Mask:
    """Nodes where tractions are no smooth functions: at ends of stick, and of the surface."""
    stick, closed = status == STICK, status != OPEN
    border = closed & (net.beside(stick & closed) & net.beside(closed & ~stick))
    size = np.linalg.norm(first, axis=1)
    joined = net.joined
    inner = np.where(border | net.beside(~closed), 0.0, size)
    beside = np.asarray(joined.multiply(inner).tocsr().max(axis=1).toarray()).ravel()
    ends = rim_points(net.surface, mirrored=False) & ~net.surface.held.any(axis=1)
    return np.asarray((border & (size > SHARPER * beside)) | (ends & closed))


def _near_ends(net: Net, sharp: Mask) -> Mask:
    """Nodes whose misfits, or their neighbours', know sharp points or an end of the surface."""
    out = sharp | rim_points(net.surface, mirrored=False)
    for _ in range(2):
        out = net.beside(out)
    return out


def _scatter(net: Net, first: Array, left_out: Mask) -> Array:
    """Mean squares (m,) of hats as high as what jumps from node to node, as `surface` has it on curves.

    A field of hats a cos(i) cos(j) has the mean square ``a^2 (2 + cos)^2 / 9``, and the misfit enlarges
    it by one minus the mean of both cosines.
    """
    second = np.where(left_out[:, None], 0.0, net.misfit(first))
    third = np.where(left_out[:, None], 0.0, net.misfit(second))
    scale = float(np.sum(second**2))
    growth = min(float(np.sqrt(np.sum(third**2) / scale)), 2.0) if scale > 0 else 1.0
    height = (3.0 - growth) / 3.0 * second / max(growth, 1.0) ** 2
    return np.asarray(np.sum(height**2, axis=1))
