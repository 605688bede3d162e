r"""Error of tractions on faces of solids: at edges, between nodes, and what scatters from node to node.

As on curves (`surface`), with what neighbours tell in the tangent plane.

* *Edges of contact.* Around the edge (`fields.contour`) the nodal field is compared with the square
  root of the distance from the edge that goes through the values of the second nodes inside.
* *Between nodes* with the parabola through a node and those around it, by least squares: on each face
  its difference to its own interpolation.
* *Ends of stick, ends of the surface*: a node less the plane through its neighbours, where that is much
  more than beside it. Of first order it is the error itself.
* *Scatter*: that misfit taken once and twice more, which leaves what jumps from node to node.

Second-order faces are cut into linear ones where contact, stick and the surface end. Elsewhere they
have one part in place of the second and the last: what their nodal values are off smooth ones.

Multipliers of second-order faces scatter between corners and middles of edges, by some percent where
both sides are curved. What a face makes of it depends on its shape functions: serendipity ones have the
fourfold opposite of the corners' in the middle, corners of quadratic triangles count next to nothing.
So the difference of the nodal values to parabolas through those around, by least squares with the areas
of the nodes, is interpolated on each face as the traction is, and integrated. Where contact ends shape
functions matter less: there the faces are cut into linear ones along their nodes.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.answers.error.sources import Three, relative
from skfem_contact.answers.fields import (
    Contour,
    NormalEquations,
    displaced,
    triangle_areas,
    with_centres,
)
from skfem_contact.answers.fields import contour as contour_of
from skfem_contact.answers.thresholds import SEGMENTS_NEAR, SHARPER
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.areas import tributary_areas
from skfem_contact.bodies.facet_kinds import KINDS, kind_of
from skfem_contact.bodies.facets import twin_edges
from skfem_contact.bodies.normal_field import sizes_and_normals
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.joints import rim_points
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Fits:
    """Polynomials around every node, by least squares.

    Attributes
    ----------
    normal : NormalEquations
    node : ndarray of int, shape (p,)
        Whose value stands in each row of these.
    scale : ndarray, shape (terms,)
        From coefficients of coordinates without a unit to derivatives.
    """

    normal: NormalEquations
    node: Index
    scale: Array

    @property
    def there(self) -> Mask:
        """Nodes around which values determine the polynomial, (m,)."""
        return self.normal.enough

    def __call__(self, values: Array) -> Array:
        """Coefficients (m, terms, k) by values (m, k)."""
        fits = [self.normal.fit(value[self.node]) for value in values.T]
        return np.stack(fits, axis=2) * self.scale[:, None]


@dataclass(frozen=True, eq=False)
class Net:
    """The nodes of a surface of linear faces, joined by the edges of its faces.

    Attributes
    ----------
    surface : ContactSurface
    known : ndarray of bool, shape (m,)
        Nodes with a value; the others are no neighbours.
    weight : ndarray, shape (m,), optional
        How much each node counts in parabolas.
    """

    surface: ContactSurface
    known: Mask
    weight: Array | None = None

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

    @cached_property
    def planes(self) -> Fits:
        """Through the values of the neighbours."""
        return self._fits(self.joined, quadratic=False)

    @cached_property
    def parabolas(self) -> Fits:
        """Through the values of a node, its neighbours and theirs."""
        pairs = self.joined @ self.joined + self.joined  # each with itself
        return self._fits(csr_matrix(pairs), quadratic=True)

    def _fits(self, pairs: csr_matrix, quadratic: bool) -> Fits:
        entries = pairs.tocoo()
        row, node = entries.row, entries.col
        x, t = self.surface.points, tangents(self.surface.normals)
        size = float(self.surface.lengths.mean())  # numbers of order one in all units
        u, v = np.einsum("pd,pkd->kp", x[node] - x[row], t[row]) / size
        terms = [np.ones(len(u)), u, v]
        terms += [0.5 * u**2, 0.5 * v**2, u * v] if quadratic else []
        scale = size ** -np.array([0.0, 1, 1, 2, 2, 2][: len(terms)])
        weight = self.weight[node] if quadratic and self.weight is not None else np.ones(len(row))
        normal = NormalEquations(np.column_stack(terms), weight, row, len(x))
        return Fits(normal, node, scale)

    def misfit(self, values: Array) -> Array:
        """Values (m, k) less the plane through the neighbours; zero where these are no plane."""
        plane = self.planes(values)[:, 0]
        return np.where((self.planes.there & self.known)[:, None], values - plane, 0.0)

    def curvatures(self, values: Array) -> Array:
        """Second derivatives (m, 3, 3, k) of the values in space, across the normals."""
        parabola, there = self.parabolas(values), self.parabolas.there
        t = tangents(self.surface.normals)
        uu, vv, uv = np.moveaxis(parabola[:, 3:], 1, 0)
        first, second = t[:, 0], t[:, 1]
        mixed = first[:, :, None] * second[:, None, :]
        H = np.einsum("mk,mi,mj->mijk", uu, first, first)
        H += np.einsum("mk,mi,mj->mijk", vv, second, second)
        H += np.einsum("mk,mij->mijk", uv, mixed + np.swapaxes(mixed, 1, 2))
        return np.where(there[:, None, None, None], H, 0.0)


class FacesError:
    """Errors of tractions on the faces of one contact.

    Parameters
    ----------
    values : ContactValues
    unlike : bool
        Whether nodes press between others, so that values scatter; this part is NaN where all points
        are so near to an end that none tells by how much.
    """

    def __init__(self, values: ContactValues, unlike: bool) -> None:
        self.whole, surface = values.surface, cut(values.surface)
        self.values, self.surface, self.unlike = values, surface, unlike
        self.net = Net(surface, np.asarray(~surface.held.all(axis=1)))
        self.closed = np.asarray(values.status != OPEN)
        self.rim = self.closed & self.net.beside(~self.closed)
        self.at_rim = np.asarray(self.rim[surface.facets].any(axis=1))

    def __call__(self, traction: Array) -> tuple[Three, Array]:
        """By edges, facets and scatter over the norm of a traction (m, k); the share of each point."""
        surface, net, closed, rim = self.surface, self.net, self.closed, self.rim
        area = surface.area
        size = float(np.sum(area[:, None] * traction**2))
        first = net.misfit(traction)
        sharp = _sharp(net, self.values.status, first)
        of_edges = area / 3.0 * np.sum(first**2, axis=1) * (sharp & ~rim)
        if self.edge is not None:
            of_edges += self.edge.misfit(traction)
        if self.whole.kind.quadratic:
            of_facets, (scatter, told) = np.zeros(len(area)), self._ripple(traction, sharp)
        else:
            smooth = ~self.at_rim & ~sharp[surface.facets].any(axis=1)
            of_facets = _between(surface, net, smooth & closed[surface.facets].any(axis=1), traction)
            left_out = _near_ends(net, sharp | rim)
            scatter, told = area * _scatter(net, first, left_out), not left_out[closed].all()
        (edges, facets, scattered), share = relative(of_edges, of_facets, scatter, size)
        untold = self.unlike and not told
        return (edges, facets, np.nan if untold else scattered), share

    def _ripple(self, traction: Array, sharp: Mask) -> tuple[Array, bool]:
        """Of second-order faces, by nodes: what values are off smooth ones; whether any face tells."""
        known = self.net.known & self.closed & ~self.rim & ~sharp
        net = Net(self.surface, known, np.maximum(self.values.area, 0.0))
        known &= net.parabolas.there
        faces = np.asarray(known[self.whole.facets].all(axis=1))
        off = np.where(known[:, None], traction - net.parabolas(traction)[:, 0], 0.0)
        return ripple(self.whole, faces, off), bool(faces.any())

    @cached_property
    def edge(self) -> Edge | None:
        """The edge of contact on the faces around it; None where there is none."""
        contour = self.values._contour
        if self.whole.kind.quadratic:
            placed = displaced(self.surface, self.values.points)
            contour = contour_of(placed, self.closed, self.values.gap)
        if not (self.at_rim.any() and len(contour.segments)):
            return None
        # how steep the root is at the nodes of the edge, by the values of those behind them
        behind = np.flatnonzero(self.closed & ~self.rim)
        if not len(behind):
            behind = np.flatnonzero(self.rim)
        return Edge(self.surface, contour, self.rim, np.flatnonzero(self.at_rim), behind)


def _between(surface: ContactSurface, net: Net, smooth: Mask, traction: Array) -> Array:
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


class Edge:
    """The edge of contact as the faces around it see it, whatever the traction.

    Parameters
    ----------
    surface : ContactSurface
    contour : Contour
    rim : ndarray of bool, shape (m,)
        Closed nodes beside open ones.
    faces, behind : ndarray of int
        The faces with such nodes, and the closed nodes behind these.
    """

    def __init__(
        self, surface: ContactSurface, contour: Contour, rim: Mask, faces: Index, behind: Index
    ) -> None:
        self.surface, self.faces, self.behind = surface, faces, behind
        self.corners = surface.kind.triangles
        x = with_centres(surface, surface.points)[:, self.corners]
        area = triangle_areas(surface, x.reshape(-1, 3, 3))
        self.area = area.reshape(len(surface.facets), -1)[faces]
        xi, self.weight = KINDS["tri3"].quadrature(8)
        self.N = KINDS["tri3"].shapes(xi)[0]
        h = with_centres(surface, contour.heights)[faces][:, self.corners]
        h = np.where(np.isfinite(h), h, np.abs(h[np.isfinite(h)]).max(initial=1.0))
        inside = (np.einsum("qa,fta->ftq", self.N, h) < 0).ravel()
        places = np.einsum("qa,ftad->ftqd", self.N, x[faces])
        self.shape, places = places.shape[:3], places.reshape(-1, 3)
        self.depth = _distance(contour.segments, surface.points[behind])
        self.near = Tree(surface.points[behind]).query(places)[1]
        self.root = np.zeros((len(places), 1))
        self.root[inside, 0] = np.sqrt(_distance(contour.segments, places[inside]))
        self.mine = rim[surface.facets[faces]]

    def misfit(self, traction: Array) -> Array:
        """Squares of the nodal field less a root of the distance from the edge, by nodes, (m,)."""
        out = np.zeros(len(self.surface.points))
        t = with_centres(self.surface, traction)[self.faces][:, self.corners]
        steep = np.sqrt(self.depth)[:, None]
        inside = steep > SOLVED * steep.max(initial=0.0)  # on the edge itself no root is told
        slope = np.divide(
            traction[self.behind], steep, out=np.zeros_like(traction[self.behind]), where=inside
        )[self.near]
        root = (slope * self.root).reshape(*self.shape, -1)
        nodal = np.einsum("qa,ftak->ftqk", self.N, t)
        weight = self.weight / self.weight.sum()
        square = np.einsum("q,ftqk,ft->f", weight, (nodal - root) ** 2, self.area)
        part = np.where(self.mine, (square / self.mine.sum(axis=1))[:, None], 0.0)
        np.add.at(out, self.surface.facets[self.faces], part)
        return out


def _distance(segments: Array, points: Array) -> Array:
    """Distances of points (p, 3) from the nearest of segments (s, 2, 3), (p,)."""
    few = min(SEGMENTS_NEAR, len(segments))
    near = Tree(segments.mean(axis=1)).query(points, k=few)[1].reshape(len(points), few)
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


def cut(surface: ContactSurface) -> ContactSurface:
    """The linear faces between the nodes of a second-order surface; a linear one as it is."""
    if not surface.kind.quadratic:
        return surface
    parts = surface.kind.linear_parts
    facets = np.concatenate([surface.facets[:, part] for part in parts])
    kind = kind_of(3, facets.shape[1])
    points, twins = surface.points, twin_edges(facets)
    return replace(
        surface,
        facets=facets,
        twins=twins,
        mesh_facets=np.tile(surface.mesh_facets, len(parts)),
        area=tributary_areas(points, facets, kind, surface.body.measure, surface.label),
        **sizes_and_normals(points, facets, kind, surface.held, twins),
    )


def ripple(surface: ContactSurface, faces: Mask, off: Array) -> Array:
    """Square integrals over faces of what nodal values (m, k) are off, by nodes, (m,)."""
    out = np.zeros(len(surface.points))
    at, weight = surface.kind.quadrature(4)
    nodes = surface.facets[faces]
    between = np.einsum("qa,fak->fqk", surface.kind.shapes(at)[0], off[nodes])
    square = np.einsum("q,fqk->f", weight / weight.sum(), between**2) * surface.facet_areas[faces]
    np.add.at(out, nodes, square[:, None] / nodes.shape[1])
    return out
