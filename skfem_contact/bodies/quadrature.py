"""Integration over the elements of a body: points, and gradients at them for some elements at a time.

A basis of scikit-fem keeps values and gradients of all shape functions at all points of integration:
18 kB for each linear hexahedron, a multiple of the stiffness. Here gradients are made when they are
needed, for some elements at a time, from the element and the mapping of the mesh.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
import skfem
from skfem.assembly import CellBasis
from skfem.assembly.basis.abstract_basis import AbstractBasis

from skfem_contact.arrays import Array, Index, runs
from skfem_contact.records import Lock

#: Elements of degree one; the others are of degree two.
LINEAR = (
    skfem.ElementTriP1,
    skfem.ElementQuad1,
    skfem.ElementTetP1,
    skfem.ElementHex1,
)


# Mappings of scikit-fem make their arrays at the first use and fill them one component after the other:
# a thread that asked meanwhile would integrate over what is not there yet.
_MAPPED = Lock()


def boundary_basis(basis: Any, facets: Any) -> Any:
    """The basis on facets, as `skfem.CellBasis.boundary` makes it; threads make theirs in turn."""
    with _MAPPED:
        return basis.boundary(facets)


class DeferredBasis(CellBasis):
    """A basis of scikit-fem whose shape functions are evaluated when somebody asks for them.

    The numbering of the DOFs, their places, the mapping and the points of integration are there at
    once; ``basis`` and ``dx``, which take nearly all time and memory, at the first use.

    Parameters
    ----------
    mesh : skfem.Mesh
    elem : skfem.Element
    mapping : skfem.Mapping, optional
        That of the mesh if not given.
    intorder : int, optional
        Degree of the polynomials that are integrated exactly; `needed_degree` if not given.
    elements, quadrature, dofs, disable_doflocs
        As in `skfem.CellBasis`, which makes bases on other elements or facets through them.

    Examples
    --------
    >>> mesh, element = skfem.MeshHex().refined(2), skfem.ElementVector(skfem.ElementHex1())
    >>> basis = DeferredBasis(mesh, element)
    >>> int(basis.N), basis.X.shape[1], "basis" in vars(basis)
    (375, 8, False)
    >>> float(basis.dx.sum().round(12))
    1.0
    """

    def __init__(
        self,
        mesh: Any,
        elem: Any,
        mapping: Any = None,
        intorder: int | None = None,
        elements: Any = None,
        quadrature: tuple[Array, Array] | None = None,
        dofs: Any = None,
        disable_doflocs: bool = False,
    ) -> None:
        if intorder is None and quadrature is None:
            intorder = needed_degree(elem)
        # as CellBasis does, up to the point where it evaluates the shape functions
        AbstractBasis.__init__(
            self, mesh, elem, mapping, intorder, quadrature, mesh.refdom, dofs, disable_doflocs
        )
        self.nelems = mesh.nelements
        if elements is not None:
            self.tind = mesh.normalize_elements(elements)
            self.nelems = len(self.tind)

    @cached_property
    def basis(self) -> list[Any]:
        """Shape functions at the points of integration, as in `skfem.CellBasis`."""
        return [self.elem.gbasis(self.mapping, self.X, j, tind=self.tind) for j in range(self.Nbfun)]

    @cached_property
    def dx(self) -> Array:
        """Determinant times weight at the points of integration, as in `skfem.CellBasis`."""
        return point_volumes(self, self.tind)

    def __getstate__(self) -> dict[str, Any]:
        # a copy in another process evaluates them again, if it needs them
        return {key: value for key, value in vars(self).items() if key not in ("basis", "dx")}


def needed_degree(element: Any) -> int:
    """Degree of the polynomials that a stiffness and a load need to be integrated exactly.

    Twice the degree k of the element: products of two shape functions. On straight simplices those of
    two gradients have degree 2 k - 2; on quadrilaterals and hexahedra 2 k in each coordinate, and the
    stiffness of a parallelepiped is exact.

    Examples
    --------
    >>> needed_degree(skfem.ElementVector(skfem.ElementHex1())), needed_degree(skfem.ElementTetP2())
    (2, 4)
    """
    return 2 if isinstance(scalar_element(element), LINEAR) else 4


def scalar_element(element: Any) -> Any:
    """Return the element of one component of an `ElementVector`, or the element itself."""
    return element.elem if isinstance(element, skfem.ElementVector) else element


def integrates(basis: Any) -> bool:
    """Return whether a basis has points of integration (that of `PETSc.numbering` has none)."""
    return bool(basis.X.shape[1])


def chunks(basis: Any, bytes_each: int) -> Iterator[Index | None]:
    """Yield element numbers in `runs`; None for all elements."""
    parts = runs(basis.nelems, bytes_each)
    if len(parts) < 2:
        yield basis.tind  # the mapping knows what it has evaluated for all elements
        return
    elements = np.arange(basis.nelems) if basis.tind is None else np.asarray(basis.tind)
    yield from (elements[part] for part in parts)


def parts(basis: Any) -> Iterator[Any]:
    """Yield bases that together cover the elements of a basis: several of a `DeferredBasis`."""
    if not isinstance(basis, DeferredBasis) or "basis" in vars(basis):
        yield basis
        return
    each = 8 * basis.Nbfun * (1 + basis.mesh.dim()) * basis.elem.dim * basis.X.shape[1]
    for elements in chunks(basis, each):
        yield some_elements(basis, elements)


def some_elements(basis: Any, elements: Index | None) -> CellBasis:
    """Return a basis on some elements with the numbering and the points of another one."""
    return CellBasis(
        basis.mesh,
        basis.elem,
        mapping=basis.mapping,
        quadrature=(basis.X, basis.W),
        elements=elements,
        dofs=basis.dofs,
        disable_doflocs=True,
    )


def shape_gradients(basis: Any, elements: Index | None) -> Array:
    """Return the gradients of the scalar shape functions at the points of integration of elements.

    Parameters
    ----------
    basis : skfem.CellBasis
        Of an element with values at nodes, or of an `ElementVector` of it.
    elements : ndarray of int, shape (e,), or None
        All elements of the mesh if None.

    Returns
    -------
    ndarray, shape (e, d, k, q)
        Derivatives by the coordinates of space [1/length] of the k shape functions.
    """
    element, X, d = scalar_element(basis.elem), basis.X, basis.mesh.dim()
    count = len(element.doflocs)
    local = np.stack([element.lbasis(X, i)[1] for i in range(count)], axis=1)  # (d, k, q)
    inverse = basis.mapping.invDF(X, elements)  # (d, d, e, q)
    out = np.empty((inverse.shape[2], d, count, X.shape[1]))
    for j in range(d):
        # in place: products as large as the result take as long to allocate as to compute
        np.multiply(inverse[0, j][:, None], local[0], out=out[:, j])
        for i in range(1, d):
            out[:, j] += inverse[i, j][:, None] * local[i]
    return out


def with_points(basis: Any) -> Any:
    """Return the basis, with points of integration if it has the numbering alone."""
    if integrates(basis):
        return basis
    return DeferredBasis(basis.mesh, basis.elem, mapping=basis.mapping, dofs=basis.dofs)


def point_volumes(basis: Any, elements: Index | None) -> Array:
    """Return what the points of integration of elements stand for, shape (e, q) [length^d]."""
    return np.asarray(np.abs(basis.mapping.detDF(basis.X, elements)) * basis.W)


def element_values(basis: Any, u: Array, elements: Index | None) -> Array:
    """Return a vector field by shape functions, components and elements, shape (k, d, e)."""
    dofs = basis.dofs.element_dofs if elements is None else basis.dofs.element_dofs[:, elements]
    return u[dofs].reshape(-1, basis.mesh.dim(), dofs.shape[1])


def hoop_strain(basis: Any, u: Array, elements: Index | None) -> Array:
    """Return the strain u / r of an axisymmetric body at points of integration, shape (e, q)."""
    radial, element = element_values(basis, u, elements)[:, 0], scalar_element(basis.elem)
    values = np.stack([element.lbasis(basis.X, i)[0] for i in range(len(radial))])
    r = basis.mapping.F(basis.X, elements)[0]
    return np.asarray(radial.T @ values / np.maximum(r, np.finfo(float).tiny))


def volume(basis: Any) -> float:
    """Return the volume of the elements of a basis [length^d]."""
    basis = with_points(basis)
    some = chunks(basis, 8 * basis.X.shape[1])
    return float(sum(point_volumes(basis, part).sum() for part in some))
