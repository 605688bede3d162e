r"""Cells: nearly plane parts of facets, each with a plane of its own and the normal field over it.

A line is one cell, whether it is straight or not, a plane face with straight edges, too; a curved face
is four (in its reference coordinates: cut between the middles of its edges). A cell is a line, a
triangle or a quadrilateral, and its *plane*, for lines itself a line, goes through the mean of its
corners. The points x of a surface meet what lies on the lines

    y = x + alpha n(x),        n = sum_k N_k n_k,

along the normals at the corners, interpolated over the cell. `Cells.images` answers where in the plane
the lines begin that go through given points y: with ``v`` and ``c``, the parts of n in the plane and
across it, as functions of the place X in the plane, and ``w`` the height of the surface above
it (zero but for warped quadrilaterals and curved lines), that is

    X + alpha v(X) = Y,      w(X) + alpha c(X) = H

for y at the place Y and the height H. Where normals are parallel this is the projection itself. The
functions are linear on lines and triangles. On quadrilaterals they are bilinear like the faces; beyond
the edges they go on linearly, as fitted to the corners: only where edges of the primary enter a cell
matters there. The place of a point of a curved line is its reference coordinate along the chord; it
lies at ``X + u(X)``, by which the first equation grows, and u and w are parabolas.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, across, cross, dot, ragged, sizes, unit
from skfem_contact.bodies.facet_kinds import FacetKind
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, NEWTON_STEPS, SOLVED
from skfem_contact.pairing.clipping import signed_areas
from skfem_contact.pairing.search import FACING, MARGIN, FacetTree, Nodes
from skfem_contact.records import dataclass

# With these signs the corners of a parallelogram add up to zero.
SADDLE = np.array([1.0, -1.0, 1.0, -1.0])


# Shapes of cells; of a pair the larger counts.
AFFINE, PART, SKEW = range(3)


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a surface, corners counter-clockwise seen from outside.

    Attributes
    ----------
    kind : FacetKind
        That of a linear facet with the corners of a cell, "line2", "tri3" or "quad4".
    facet : ndarray of int, shape (nc,)
        The facet that each cell is part of.
    reference : ndarray, shape (nc, c, d-1)
        Corners in the reference coordinates of the facet.
    origin, axes : ndarray, shapes (nc, d) and (nc, d, d)
        Of each cell's coordinates: axes in its plane, and its outward normal.
    corners, normals : ndarray, shape (nc, c, d)
        Positions of the corners and outward unit normals there, both in the cell's coordinates.
    plane : ndarray of bool, shape (nc,)
        Whether the facet is plane with straight edges.
    shape : ndarray of int, shape (nc,)
        `AFFINE`: a line, plane triangle or parallelogram, on which shape functions are polynomials;
        `PART`: a curved line, or a part of a curved face; or `SKEW`: another quadrilateral.
    bow : ndarray, shape (nc, d), or None
        Of lines from the middles of the chords to the middle nodes, in the cells' coordinates; None
        where all are straight, as those without middle nodes are.
    """

    kind: FacetKind
    facet: Index
    reference: Array
    origin: Array
    axes: Array
    corners: Array
    normals: Array
    plane: Mask
    shape: Index
    bow: Array | None

    @classmethod
    def of(cls, surface: ContactSurface) -> Cells:
        """Cut the facets of a surface into cells."""
        kind, c = surface.kind, surface.kind.corners
        straight = _straight(surface)
        facet = np.arange(len(surface.facets))
        reference = np.broadcast_to(kind.locations[:c], (len(facet), c, kind.dim))
        x, normals = surface.points[surface.facets[:, :c]], surface.facet_node_normals[:, :c]
        if kind.dim == 2 and not straight.all():
            whole, cut, parts = np.flatnonzero(straight), np.flatnonzero(~straight), quarters(kind)
            facet = np.concatenate([whole, np.repeat(cut, len(parts))])
            reference = np.concatenate([reference[whole], np.tile(parts, (len(cut), 1, 1))])
            N, _ = kind.shapes(reference)
            x = N @ surface.points[surface.facets[facet]]
            normals = unit(N @ surface.facet_node_normals[facet])
        origin, axes = _planes(x)
        turn = np.swapaxes(axes, 1, 2)
        corners = (x - origin[:, None]) @ turn
        round_off = SOLVED * sizes(corners).max(axis=1)
        plane = straight[facet] & (np.abs(corners[:, :, -1]).max(axis=1) <= round_off)
        shape = np.where(straight[facet], AFFINE, PART)
        if c == 4:
            skew = np.linalg.norm(np.einsum("c,ncd->nd", SADDLE, corners), axis=1) > round_off
            shape[straight[facet] & skew] = SKEW
        normals, bow = normals @ turn, None
        if kind.dim == 1 and not straight.all():
            bow = ((surface.points[surface.facets[:, 2]] - origin)[:, None] @ turn)[:, 0]
        return cls(kind.linear, facet, reference, origin, axes, corners, normals, plane, shape, bow)

    @cached_property
    def positions(self) -> Array:
        """Corners in space, shape (nc, c, d)."""
        return self.origin[:, None] + self.corners @ self.axes

    def local(self, cell: Index, y: Array) -> Array:
        """Points (p, d) or (p, n, d) in the coordinates of cells (p,)."""
        origin, turns = self.origin.take(cell, axis=0), self._turns.take(cell, axis=0)
        if y.ndim == 2:
            return np.einsum("pi,pij->pj", y - origin, turns)
        return np.asarray((y - origin[:, None]) @ turns)

    @cached_property
    def _turns(self) -> Array:
        """The axes as columns, next to each other in memory: products take a third of the time."""
        return np.ascontiguousarray(np.swapaxes(self.axes, 1, 2))

    @cached_property
    def areas(self) -> Array:
        """Areas in the planes, of lines lengths, shape (nc,)."""
        return signed_areas(self.corners[..., :-1])

    @cached_property
    def sizes(self) -> Array:
        """Sides of squares of these areas, shape (nc,) [length]."""
        return np.sqrt(self.areas) if self.kind.dim == 2 else self.areas

    @cached_property
    def parallel(self) -> Mask:
        """Cells whose normals are all that of their plane, shape (nc,)."""
        return np.asarray(np.abs(self.normals[..., :-1]).max(axis=(1, 2)) <= COMPUTED)

    @cached_property
    def _fields(self) -> tuple[Array, Array]:
        """v, c and w: values at the origin and slopes (d, d+1, nc); corners have more (d+1, c, nc).

        The origin is the mean of the corners: there is the mean of the values, too.
        """
        at = self.corners.T[:-1]
        values = np.concatenate([self.normals, self.corners[:, :, -1:]], axis=2).T
        zero = values.mean(axis=1)
        metric, right = np.einsum("icn,jcn->ijn", at, at), np.einsum("icn,vcn->ivn", at, values)
        slopes = _solve(metric, right)
        more = values - zero[:, None] - np.einsum("icn,ivn->vcn", at, slopes)
        return np.concatenate([zero[None], slopes]), more

    def images(self, cell: Index, local: Array) -> Array:
        """Return where lines begin that go along the normals through points.

        Parameters
        ----------
        cell : ndarray of int, shape (p,)
        local : ndarray, shape (p, n, d)
            Points in the coordinates of the cells.

        Returns
        -------
        ndarray, shape (p, n, d-1)
            Places in the planes; ``nan`` beyond the focus of a hollow surface, where normals have
            crossed.
        """
        if self.bow is None and self.parallel.all():
            return local[..., :-1]
        local = np.ascontiguousarray(local.T)  # component by component: long sums
        Y, H, dim = local[:-1], local[-1], self.kind.dim
        linear, more, limits = (
            np.take(x, cell, axis=-1) for x in (*self._fields, self._limits.transpose(1, 2, 0))
        )
        at_zero, slope, (least, most) = linear[0, :, None], linear[1:, :, None], limits[:, :, None]
        size = self.sizes[cell]
        bow, half = None if self.bow is None else self.bow.take(cell, axis=0).T[:, None], 0.5 * size
        bent = self.kind.corners == 4 and np.abs(more).max(initial=0.0) > COMPUTED
        alpha, X = H, Y
        eye = np.eye(dim)[..., None, None]
        ways, rises = np.swapaxes(slope[:, :dim], 0, 1), slope[:, dim:]
        for _ in range(NEWTON_STEPS):
            field = at_zero
            if bent:
                inside = np.clip(
                    local_coordinates(self.corners[cell, :, :-1], np.moveaxis(X, 0, -1)), 0.0, 1.0
                )
                field = at_zero + np.einsum("npk,ckp->cnp", self.kind.shapes(inside)[0], more)
            turn = eye + alpha * ways
            there = Y - alpha * field[:dim]
            if bow is not None:  # beyond the ends goes on what is there, straight
                height = np.maximum(1 - (X / half) ** 2, 0.0)
                rise = np.where(height > 0, X * (-2 / half**2), 0.0) * bow[:1]
                turn = turn + rise
                there = there + rise * X - height * bow[:1]
            new_X = _solve(turn, there)
            # beyond a cell only its own lines matter: their slopes and heights are no others there
            there = field[dim:] + sum(x * rise for x, rise in zip(new_X, rises, strict=True))
            there = np.minimum(np.maximum(there, least), most)
            if bow is not None:
                there[1] = np.maximum(1 - (new_X[0] / half) ** 2, 0.0) * bow[1]
            new = (H - there[1]) / there[0]
            change = np.maximum(np.abs(new - alpha), np.abs(new_X - X).max(axis=0))
            alpha, X = new, new_X
            if not np.any(change > COMPUTED * size):  # nan is beyond the focus
                break
        return np.ascontiguousarray(X.T)

    @cached_property
    def _limits(self) -> Array:
        """Least and largest c and w at the corners, shape (nc, 2, 2)."""
        values = np.stack([self.normals[..., -1], self.corners[..., -1]], axis=2)
        values[..., 0] = np.maximum(values[..., 0], FACING)
        return np.stack([values.min(axis=1), values.max(axis=1)], axis=1)


def _straight(surface: ContactSurface) -> Mask:
    """Facets whose edges are straight, the other nodes and faces' normals in the middles, (nf,)."""
    kind = surface.kind
    if not kind.quadratic:
        return np.ones(len(surface.facets), dtype=bool)
    N, _ = kind.linear.shapes(kind.locations)
    x, normals = surface.points[surface.facets], surface.facet_node_normals
    straight = sizes(x - N @ x[:, : kind.corners]).max(axis=1) <= SOLVED * surface.lengths
    if kind.dim == 2:
        bend = sizes(normals - unit(N @ normals[:, : kind.corners])).max(axis=1)
        straight &= bend <= SOLVED
    return np.asarray(straight)


def quarters(kind: FacetKind) -> Array:
    """Reference coordinates of the corners of the parts of a curved face, (4, c, 2).

    >>> from skfem_contact.bodies.facet_kinds import kind_of
    >>> quarters(kind_of(3, 6))[3].tolist()
    [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]
    """
    corner = kind.locations[: kind.corners]
    middle = 0.5 * (corner + np.roll(corner, -1, axis=0))
    if kind.corners == 3:
        return np.array([*([corner[i], middle[i], middle[i - 1]] for i in range(3)), middle])
    centre = corner.mean(axis=0)
    return np.array([[corner[i], middle[i], centre, middle[i - 1]] for i in range(4)])


def _solve(matrix: Array, right: Array) -> Array:
    """Solve (d-1, d-1, ...) equations; ``nan`` unless all eigenvalues are positive."""
    if len(matrix) == 1:
        return np.asarray(right / np.where(matrix[0] > 0, matrix[0], np.nan))
    (a, b), (c, d) = matrix
    size = a * d - b * c
    size = np.where((size > 0) & (a + d > 0), size, np.nan)
    x, y = right
    return np.stack([(d * x - b * y) / size, (a * y - c * x) / size])


def _planes(corners: Array) -> tuple[Array, Array]:
    """Means of corners (nc, c, d), and the axes in the plane there and its normal, (nc, d, d)."""
    x, c = corners - corners[:, :1], corners.shape[1]
    first, last = (x[:, 2], x[:, 3] - x[:, 1]) if c == 4 else (x[:, 1], x[:, -1])
    if c == 2:
        axes = [along := unit(first), across(along[:, None])]
    else:
        normal = unit(across(np.stack([first, last], axis=1)))
        along = unit(first - dot(first, normal)[:, None] * normal)
        axes = [along, cross(normal, along), normal]
    return corners.mean(axis=1), np.stack(axes, axis=1)


def local_coordinates(corners: Array, points: Array) -> Array:
    """Reference coordinates of points in intervals, plane triangles and quadrilaterals.

    Parameters
    ----------
    corners : ndarray, shape (..., c, d-1)
        Two corners, three, or four; in either direction.
    points : ndarray, shape (..., d-1)

    Returns
    -------
    ndarray, shape (..., d-1)
        Of the linear or bilinear shape functions; beyond the corners they are continued.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [2.0, 0.0], [3.0, 2.0], [0.0, 1.0]])
    >>> local_coordinates(corners, np.array([1.25, 0.75])).tolist()
    [0.5, 0.5]
    """
    if corners.shape[-2] == 2:
        first = corners[..., 0, :]
        return np.asarray((points - first) / (corners[..., 1, :] - first))
    x, y = np.moveaxis(corners, -1, 0)
    r = points[..., 0] - x[..., 0], points[..., 1] - y[..., 0]
    a = x[..., 1] - x[..., 0], y[..., 1] - y[..., 0]
    b = x[..., -1] - x[..., 0], y[..., -1] - y[..., 0]

    def cross(v: tuple[Array, Array], w: tuple[Array, Array]) -> Array:
        return v[0] * w[1] - v[1] * w[0]

    if corners.shape[-2] == 3:
        area = cross(a, b)
        return np.stack([cross(r, b) / area, cross(a, r) / area], axis=-1)
    d = x[..., 2] - x[..., 1] - b[0], y[..., 2] - y[..., 1] - b[1]
    # r = s a + t b + s t d: with r - t b along a + t d, a quadratic equation for t. Of its roots
    # the one where the area element, its slope, has the sign of the face's
    constant, linear, square = cross(r, a), cross(r, d) + cross(a, b), -cross(b, d)
    turn = np.where(cross(a, b) + 0.5 * (cross(a, d) + cross(d, b)) < 0, -1.0, 1.0)
    root = turn * np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        t = -2 * constant / (linear + root)
        other = turn * linear < 0
        if other.any():
            t = np.where(other, (root - linear) / (2 * square), t)
    ahead = a[0] + t * d[0], a[1] + t * d[1]
    over = (r[0] - t * b[0]) * ahead[0] + (r[1] - t * b[1]) * ahead[1]
    return np.stack([over / (ahead[0] ** 2 + ahead[1] ** 2), t], axis=-1)


def cells_along_normals(
    secondary: Cells, surface: ContactSurface, primary: Cells, reach: float
) -> tuple[Index, Index]:
    """Pairs of cells that may meet along the normals of the secondary.

    What a cell sees is a cone about its own normal, as wide as its normals are apart. The tree over the
    facets of the primary answers for all of them: no pair is left out, and the work is proportional to
    the cells and the pairs found, whatever the distance between the surfaces.

    Parameters
    ----------
    secondary, primary : Cells
    surface : ContactSurface
        The primary.
    reach : float
        Longest distance along the normal [length].

    Returns
    -------
    e, f : ndarray of int
        Cells of the secondary and of the primary, ordered by both.
    """
    height = np.abs(secondary.corners[..., -1]).max(axis=1)
    radius = np.linalg.norm(secondary.corners[..., :-1], axis=2).max(axis=1)
    lean = np.linalg.norm(secondary.normals[..., :-1], axis=2).max(axis=1)
    lean /= np.maximum(secondary.normals[..., -1].min(axis=1), FACING)

    def seen(e: Index, nodes: Nodes) -> Mask:
        local = secondary.local(e, nodes.centre)
        away, across = np.abs(local[:, -1]), np.linalg.norm(local[:, :-1], axis=1) - nodes.radius
        far, near = (away + sign * (nodes.radius + height[e]) for sign in (1, -1))
        return (across <= (radius[e] + far * lean[e]) * (1 + MARGIN)) & (near <= reach)

    count = len(secondary.facet)
    found = list(FacetTree.build(surface, count, cones=False).descend(count, seen))
    e, f = (np.concatenate(column) for column in zip(*found, strict=True))
    if len(primary.facet) > len(surface.facets):  # all cells of a facet
        order = np.argsort(primary.facet, kind="stable")
        first = np.searchsorted(primary.facet[order], np.arange(len(surface.facets) + 1))
        cells = np.diff(first)[f]
        e, f = np.repeat(e, cells), order[ragged(first[f], cells)]
    order = np.lexsort((f, e))
    return e[order], f[order]
