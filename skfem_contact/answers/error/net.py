r"""What the values around a node tell of the one at it: on curves and on faces, by least squares.

A node less the line or plane through its neighbours (`Net.misfit`) is how it differs from a mesh of
twice the size. The curvatures of the parabola through all nodes up to two edges away tell how far
traction and shape functions differ between the nodes (`between`).

Where contact or sticking ends, and at ends of the surface, tractions are no smooth functions: there the
misfit itself is the error (`sharp`). Taken again and again it leaves of a traction what scatters from
node to node (`scatter`): it enlarges waves by one minus the mean cosine of their phases per node, 2 for
a zigzag, 1 for waves of four nodes. Longer ones are as good as smooth.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from skfem_contact.answers.fields import NormalEquations
from skfem_contact.answers.thresholds import SHARPER
from skfem_contact.bodies.normals import tangents
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.pairing.projection import rim_points
from skfem_contact.records import dataclass

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
    out = np.zeros(len(surface.points))
    facets = np.flatnonzero(smooth)
    if not len(facets):
        return out
    at, weight = surface.kind.quadrature(4)
    N, _ = surface.kind.shapes(at)
    nodes = surface.facets[facets]
    x = surface.points[nodes]
    H = net.curvatures(traction)[nodes].mean(axis=1)
    x = x - x.mean(axis=1, keepdims=True)
    at_nodes = 0.5 * np.einsum("fai,fijk,faj->fak", x, H, x)
    inner = np.einsum("qa,fai->fqi", N, x)
    off = 0.5 * np.einsum("fqi,fijk,fqj->fqk", inner, H, inner) - np.einsum("qa,fak->fqk", N, at_nodes)
    square = np.einsum("q,fqk->f", weight / weight.sum(), off**2) * surface.facet_areas[facets]
    np.add.at(out, nodes, square[:, None] / nodes.shape[1])
    return out


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
