r"""Error of tractions along a surface, a curve or faces: at edges, between nodes, of straight facets.

* *Edges of contact.* On the facets around the edge (`fields.contour`) the nodal field is compared
  with the square root of the distance from the edge that goes through the values of the second nodes
  inside, which does not depend on where between two nodes the edge lies.
* *Between nodes* with the parabola through a node and those around it, by least squares: on each facet
  its difference to its own interpolation.
* *Ends of stick, ends of the surface*: a node less the plane through its neighbours, where that is much
  more than beside it. Of first order it is the error itself.
* *Scatter*: that misfit taken once and twice more, which leaves what jumps from node to node.

Second-order facets are cut into linear ones where contact, stick and the surface end. Elsewhere they
have one part in place of the second and the last: what their nodal values are off smooth ones.

Multipliers of second-order facets scatter between corners and middles of edges, by some percent where
both sides are curved. What a facet makes of it depends on its shape functions: serendipity ones have
the fourfold opposite of the corners' in the middle, corners of quadratic triangles count next to
nothing. So the difference of the nodal values to parabolas through those around, by least squares with
the areas of the nodes, is interpolated on each facet as the traction is, and integrated.

*Chords.* Nodal forces act along the boundary's normals, straight facets do not. The pressure p of a
chord that spans the angle a acts along the normal of the chord. Along the normal of the curve, at the
node between two, it has the force ``p L cos(a / 2)``: the nodal force over the length L shows a
pressure that is ``1 - cos(a / 2)`` too low, on matching meshes as well. Between two bodies it is the
mean of both sides (more or less, by their stiffness). Facets have at each of their corners the angle
between their own normal and that of the boundary in the place of ``a / 2``.

*Around a node*, least squares tell what the values there say of its own, on curves and on faces.

A node less the line or plane through its neighbours (`Net.misfit`) is how it differs from a mesh of
twice the size. The curvatures of the parabola through all nodes up to two edges away tell how far
traction and shape functions differ between the nodes (`between`).

Where contact or sticking ends, and at ends of the surface, tractions are no smooth functions: there the
misfit itself is the error (`sharp`). Taken again and again it leaves of a traction what scatters from
node to node (`scatter`): it enlarges waves by one minus the mean cosine of their phases per node, 2 for
a zigzag, 1 for waves of four nodes. Longer ones are as good as smooth.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.fields import (
    Contour,
    NormalEquations,
    contour,
    simplex_areas,
    weighed_areas,
    with_centres,
)
from skfem_contact.answers.validity.deformed_boundaries import Boundary
from skfem_contact.answers.values import ContactValues
from skfem_contact.arrays import Array, Index, Mask, tangents
from skfem_contact.bodies.facet_kinds import kind_of, tributary_areas
from skfem_contact.bodies.normal_field import sizes_and_normals, twin_edges
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.pairing.projection import rim_points
from skfem_contact.records import dataclass
from skfem_contact.trees import Tree

#: At the end of stick a square root misfits its nodes at least ten times as much as those beside
#: them, a smooth function with a jump in its curvature about as much.
SHARPER = 3.0

#: Degrees of the quadrature of a root that begins within a facet, by the dimension: in the plane one
#: facet has all of the kink, to a percent; in space it is at another place of each face.
ROOT = {2: 24, 3: 8}


class SurfaceError:
    """Errors of tractions on the facets of one contact.

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
        # at prescribed nodes the support bears what contact would, and nobody knows how much of it
        self.net = Net(surface, np.asarray(~surface.held.all(axis=1)))
        self.closed = np.asarray(values.status != OPEN)
        self.rim = self.closed & self.net.beside(~self.closed)
        self.at_rim = np.asarray(self.rim[surface.facets].any(axis=1))

    def __call__(self, traction: Array) -> tuple[tuple[float, float, float], Array]:
        """By edges, facets and scatter over the norm of a traction (m, k); the share of each point."""
        surface, net, closed, rim = self.surface, self.net, self.closed, self.rim
        area = surface.area
        size = float(np.sum(area[:, None] * traction**2))
        first = net.misfit(traction)
        ends = sharp(net, self.values.status, first)
        # a hat has a third of the square of its height over its area
        of_edges = area / 3.0 * np.sum(first**2, axis=1) * (ends & ~rim)
        if self.edge is not None:
            of_edges += self.edge.misfit(traction)
        if self.whole.kind.quadratic:
            of_facets, (scattered, told) = np.zeros(len(area)), self._ripple(traction, ends)
        else:
            smooth = ~self.at_rim & ~ends[surface.facets].any(axis=1)
            of_facets = between(surface, net, smooth & closed[surface.facets].any(axis=1), traction)
            left_out = near_ends(net, ends | rim)
            scattered, told = area * scatter(net, first, left_out), not left_out[closed].all()
        parts = of_edges, of_facets, scattered
        total = of_edges + of_facets + scattered
        share = total / total.sum() if total.sum() > SOLVED**2 * size else np.zeros(len(total))
        edges, facets, jumps = (
            float(np.sqrt(part.sum() / size)) if size > 0 else 0.0 for part in parts
        )
        return (edges, facets, np.nan if self.unlike and not told else jumps), share

    def _ripple(self, traction: Array, ends: Mask) -> tuple[Array, bool]:
        """Of second-order facets, by nodes: what values are off smooth ones; whether any tells."""
        known = self.net.known & self.closed & ~self.rim & ~ends
        net = Net(self.surface, known, np.maximum(self.values.area, 0.0))
        known &= net.parabolas.there
        facets = np.asarray(known[self.whole.facets].all(axis=1))
        off = np.where(known[:, None], traction - net.parabolas(traction)[:, 0], 0.0)
        inner = np.einsum("qa,fak->fqk", self.whole.kind.gauss[0], off[self.whole.facets[facets]])
        return squares(self.whole, facets, inner), bool(facets.any())

    @cached_property
    def edge(self) -> Edge | None:
        """The edge of contact on the facets around it; None where there is none."""
        found = contour(self.surface, self.closed, self.values.gap)
        if not (self.at_rim.any() and len(found.segments)):
            return None
        # how steep the root is at the nodes of the edge, by the values of those behind them
        behind = np.flatnonzero(self.closed & ~self.rim)
        if not len(behind):
            behind = np.flatnonzero(self.rim)
        return Edge(self.surface, found, self.rim, np.flatnonzero(self.at_rim), behind)


class Edge:
    """The edge of contact as the facets around it see it, whatever the traction.

    Parameters
    ----------
    surface : ContactSurface
    found : Contour
    rim : ndarray of bool, shape (m,)
        Closed nodes beside open ones.
    facets, behind : ndarray of int
        The facets with such nodes, and the closed nodes behind these.
    """

    def __init__(
        self, surface: ContactSurface, found: Contour, rim: Mask, facets: Index, behind: Index
    ) -> None:
        self.surface, self.facets, self.behind = surface, facets, behind
        self.corners, d, pieces = surface.kind.simplices, surface.dim, found.segments
        # points of the plane as pieces, and segments of space as triangles, without size
        edge = Boundary(pieces[:, [0, *range(d - 1)]], pieces[:, 0])
        x = with_centres(surface, surface.points)[:, self.corners]
        self.area = simplex_areas(surface).reshape(len(surface.facets), -1)[facets]
        kind = kind_of(d, d)
        xi, self.weight = kind.quadrature(ROOT[d])
        self.N = kind.shapes(xi)[0]
        h = with_centres(surface, found.heights)[facets][:, self.corners]
        h = np.where(np.isfinite(h), h, np.abs(h[np.isfinite(h)]).max(initial=1.0))
        inside = (np.einsum("qa,fta->ftq", self.N, h) < 0).ravel()
        places = np.einsum("qa,ftad->ftqd", self.N, x[facets])
        self.shape, places = places.shape[:3], places.reshape(-1, d)
        self.depth = edge.distance(surface.points[behind])
        self.near = Tree(surface.points[behind]).query(places)[1]
        self.root = np.zeros((len(places), 1))
        self.root[inside, 0] = np.sqrt(edge.distance(places[inside]))
        self.mine = rim[surface.facets[facets]]

    def misfit(self, traction: Array) -> Array:
        """Squares of the nodal field less a root of the distance from the edge, by nodes, (m,)."""
        out = np.zeros(len(self.surface.points))
        t = with_centres(self.surface, traction)[self.facets][:, self.corners]
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
        np.add.at(out, self.surface.facets[self.facets], part)
        return out


def cut(surface: ContactSurface) -> ContactSurface:
    """The linear facets between the nodes of a second-order surface; a linear one as it is."""
    if not surface.kind.quadratic:
        return surface
    parts = surface.kind.linear_parts
    facets = np.concatenate([surface.facets[:, part] for part in parts])
    kind = kind_of(surface.dim, facets.shape[1])
    points, twins = surface.points, twin_edges(facets)
    return replace(
        surface,
        facets=facets,
        twins=twins,
        mesh_facets=np.tile(surface.mesh_facets, len(parts)),
        area=tributary_areas(points, facets, kind, surface.body.measure, surface.label),
        **sizes_and_normals(points, facets, kind, surface.held, twins),
    )


def squares(surface: ContactSurface, facets: Mask, off: Array) -> Array:
    """Square integrals over facets of what is off (f, q, k) at Gauss points, by nodes, (m,)."""
    out, nodes = np.zeros(len(surface.points)), surface.facets[facets]
    weight = surface.kind.gauss[2]
    square = np.einsum("q,fqk->f", weight / weight.sum(), off**2) * weighed_areas(surface)[facets]
    np.add.at(out, nodes, square[:, None] / nodes.shape[1])
    return out


# -- straight facets of curved surfaces -----------------------------------------------------------


def chords_error(result: Answer, values: ContactValues) -> float:
    """By which part pressures are too low; zero on straight and on quadratic facets."""
    contact, part = values.contact, result.slices()[result.names.index(values.name)]
    forces = result.kin.B_n[part].T @ values.normal_force
    sides = [contact.secondary]
    if isinstance(contact.primary, ContactSurface):
        sides.append(contact.primary)
    return float(np.mean([_lost(side, forces[result.system.slice(side.body)]) for side in sides]))


def _lost(surface: ContactSurface, forces: Array) -> float:
    """Root of the mean square of ``1 - cos(a / 2)`` over a surface, weighted as the pressure is."""
    if surface.quadratic or surface.dofs.shape[1] != surface.dim:
        return 0.0  # what flows from chord to chord has no direction
    along = np.einsum("fkd,fkd->fk", surface.own_normals, surface.facet_node_normals)
    low = np.maximum(1 - along.mean(axis=1), 0.0)
    size = np.linalg.norm(forces[surface.dofs], axis=1)
    pressure = np.divide(size, surface.area, out=np.zeros_like(size), where=surface.area > 0)
    weight = weighed_areas(surface) * np.sum(pressure[surface.facets] ** 2, axis=1)
    total = float(weight.sum())
    return float(np.sqrt(weight @ low**2 / total)) if total > 0 else 0.0


def net_of(result: Answer, bodies: float, chords: float) -> tuple[float, float]:
    """Return what is left of both where they are known to have opposite signs.

    Meshes are too stiff, so what interference presses is too high, and chords show too little of it.
    Loads and supports leave the sign of the first open: then the squares of both count.
    """
    driven = np.any(result.case.f) or np.any(result.case.x)
    if driven or np.isnan(bodies):
        return bodies, chords
    return max(bodies - chords, 0.0), max(chords - bodies, 0.0)


# -- what the values around a node tell ------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Fits:
    """Polynomials around every node, by least squares.

    Attributes
    ----------
    normal : NormalEquations
    node : ndarray of int, shape (p,)
        Whose value stands in each row of these.
    scale : ndarray, shape (terms,)
        From coefficients of coordinates without a unit to those of lengths.
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
    """The nodes of a surface of linear facets, joined by lines or by the edges of faces.

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
        """Return which known nodes are the ends of one edge, (m, m), zeros and ones."""
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
    def _neighbours(self) -> Fits:
        return self._fits(self.joined, quadratic=False)

    @property
    def amid(self) -> Mask:
        """Nodes whose neighbours alone determine a line or plane; those at ends of curves do not."""
        return self._neighbours.there

    @cached_property
    def planes(self) -> Fits:
        """Through the values of the neighbours, and of theirs where these are not enough."""
        if self.amid.all():
            return self._neighbours
        further = csr_matrix(diags_array(np.where(self.amid, 0.0, 1.0)) @ self.joined @ self.joined)
        further = csr_matrix(further - diags_array(further.diagonal()))
        further.eliminate_zeros()
        return self._fits(csr_matrix(self.joined + further), quadratic=False)

    @cached_property
    def parabolas(self) -> Fits:
        """Through the values of a node, its neighbours and theirs."""
        pairs = self.joined @ self.joined + self.joined  # each with itself
        return self._fits(csr_matrix(pairs), quadratic=True)

    @cached_property
    def _seconds(self) -> list[tuple[int, int]]:
        """The products of coordinates that a parabola has, by their two directions."""
        ways = range(self.surface.kind.dim)
        return [(i, j) for i in ways for j in ways if i <= j]

    def _fits(self, pairs: csr_matrix, quadratic: bool) -> Fits:
        entries = pairs.tocoo()
        row, node = entries.row, entries.col
        x, t = self.surface.points, tangents(self.surface.normals)
        size = float(self.surface.lengths.mean())  # numbers of order one in all units
        u = np.einsum("pd,pkd->kp", x[node] - x[row], t[row]) / size
        terms = [np.ones(len(row)), *u]
        if quadratic:
            terms += [u[i] * u[j] for i, j in self._seconds]
        scale = size ** -np.minimum(np.ceil(np.arange(len(terms)) / len(u)), 2.0)
        weight = self.weight[node] if quadratic and self.weight is not None else np.ones(len(row))
        normal = NormalEquations(np.column_stack(terms), weight, row, len(x))
        return Fits(normal, node, scale)

    def misfit(self, values: Array) -> Array:
        """Values (m, k) less the plane through the neighbours; zero where these are no plane.

        Of a parabola over equal segments a straight line misses half the second difference.
        """
        plane = self.planes(values)[:, 0]
        return np.where((self.planes.there & self.known)[:, None], values - plane, 0.0)

    def curvatures(self, values: Array) -> Array:
        """Second derivatives (m, d, d, k) of the values in space, across the normals."""
        second = self.parabolas(values)[:, 1 + self.surface.kind.dim :]
        t = tangents(self.surface.normals)
        H = np.zeros((*t.shape[::2], t.shape[2], values.shape[1]))
        for k, (i, j) in enumerate(self._seconds):
            both = t[:, i, :, None] * t[:, j, None, :]
            H += np.einsum("mk,mij->mijk", second[:, k], both + np.swapaxes(both, 1, 2))
        return np.where(self.parabolas.there[:, None, None, None], H, 0.0)


def between(surface: ContactSurface, net: Net, smooth: Mask, traction: Array) -> Array:
    """Squares of the parabolas less their interpolation on facets, by their nodes, (m,)."""
    N = surface.kind.gauss[0]
    nodes = surface.facets[smooth]
    x = surface.points[nodes]
    H = net.curvatures(traction)[nodes].mean(axis=1)
    x = x - x.mean(axis=1, keepdims=True)
    at_nodes = 0.5 * np.einsum("fai,fijk,faj->fak", x, H, x)
    inner = np.einsum("qa,fai->fqi", N, x)
    off = 0.5 * np.einsum("fqi,fijk,fqj->fqk", inner, H, inner) - np.einsum("qa,fak->fqk", N, at_nodes)
    return squares(surface, smooth, off)


def sharp(net: Net, status: Index, first: Array) -> Mask:
    """Nodes where tractions are no smooth functions: at ends of stick, and of the surface.

    Where slip begins they may well be smooth, and then are misfits not larger than beside it. At the
    end of a surface stress may be singular, but not on a line of symmetry or at a support.
    """
    stick, closed = status == STICK, status != OPEN
    border = closed & (net.beside(stick & closed) & net.beside(closed & ~stick))
    size = np.linalg.norm(first, axis=1)
    inner = np.where(border | net.beside(~closed), 0.0, size)
    beside = np.asarray(net.joined.multiply(inner).tocsr().max(axis=1).toarray()).ravel()
    ends = rim_points(net.surface, mirrored=False) & ~net.surface.held.any(axis=1)
    return np.asarray((border & (size > SHARPER * beside)) | (ends & closed))


def near_ends(net: Net, marked: Mask) -> Mask:
    """Nodes whose misfits, or their neighbours', know marked points or an end of the surface."""
    out = marked | rim_points(net.surface, mirrored=False) | ~net.amid
    for _ in range(2):
        out = net.beside(out)
    return out


def scatter(net: Net, first: Array, left_out: Mask) -> Array:
    """Mean squares (m,) of hats as high as what jumps from node to node.

    A field of hats with heights ``a cos(i phase)`` has the mean square ``a^2 (2 + cos) / 6``, that of
    ``a cos(i) cos(j)`` on faces ``a^2 (2 + cos)^2 / 36``.
    """
    second = np.where(left_out[:, None], 0.0, net.misfit(first))
    third = np.where(left_out[:, None], 0.0, net.misfit(second))
    scale = float(np.sum(second**2))
    growth = min(float(np.sqrt(np.sum(third**2) / scale)), 2.0) if scale > 0 else 1.0
    of_hats = ((3.0 - growth) / 3.0) ** net.surface.kind.dim
    return np.asarray(of_hats * np.sum((second / max(growth, 1.0) ** 2) ** 2, axis=1))
