r"""Assembly of forms that see gradients alone, all functions of an element at a time.

A form that is bilinear in the gradients of u and v, with coefficients that are the same everywhere,

    ``a(u, v) = ∫ A_cjek ∂_j v_c ∂_k u_e``,

is known by its tensor A, and elasticity is of this kind. Calling the form with unit gradients
gives A. The stiffness is then a sum of matrices that depend on the mesh alone,

    ``K_(ac)(be) = A_cjek L^jk_ab``,     ``L^jk_ab = ∫ ∂_j N_a ∂_k N_b``,

with the scalar shape functions N: d (d + 1) / 2 assemblies of scalar matrices, in place of a call
of the form for every two functions of an element, 576 for a linear hexahedron and 6561 for a quadratic
one. Sums are in the same order on both sides of the diagonal: K is symmetric where A is, to the last
digit.

Other forms are found out by two calls: the values of u and v are NaN, then some numbers, and the third
argument raises, and remembers it, when something is read from it. scikit-fem assembles those.

**Points**: a basis of scikit-fem keeps values and gradients of all shape functions at all points of
integration, 18 kB for each linear hexahedron, a multiple of the stiffness. Here gradients are made when
they are needed, for some elements at a time, from the element and the mapping of the mesh.

**Moduli**: bulk and shear modulus of a body are read from its form, or from its stiffness.

A form is asked for its values under unit gradients: an even expansion gives the bulk modulus, unit
shears the shear modulus. Of a matrix they are the means over the body: displacements linear in the
position have these gradients everywhere. In plane strain they are those of the plane, ``lambda + mu``
and ``mu``, whose quotient ``1 / (1 - 2 nu)`` has no bound, as that of solids; in plane stress it has.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import combinations, combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
import skfem
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm, CellBasis
from skfem.assembly.basis.abstract_basis import AbstractBasis
from skfem.assembly.form.form import FormExtraParams
from skfem.element import DiscreteField

from skfem_contact.arrays import Array, Index, runs
from skfem_contact.digits import COMPUTED
from skfem_contact.records import Lock

#: Elements of degree one; the others are of degree two.
LINEAR = (skfem.ElementTriP1, skfem.ElementQuad1, skfem.ElementTetP1, skfem.ElementHex1)


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


class NeedsMore(Exception):
    """A form needs more than the gradients of u and v; the message says what."""


class Assembled(NamedTuple):
    """A stiffness that was assembled here.

    Attributes
    ----------
    K : csr_matrix, shape (n, n)
        What ``form.assemble(basis)`` gives, to round-off.
    by_skfem : str
        Why scikit-fem assembled it; empty if it was assembled from its tensor.
    symmetric : bool
        Whether it is known to be symmetric, to the last digit.
    tensor : ndarray, shape (c, d, c, d), or None
        What it was assembled from, see `tensor`.
    """

    K: csr_matrix
    by_skfem: str
    symmetric: bool
    tensor: Array | None


def assembled(form: BilinearForm, basis: Any) -> Assembled:
    """Assemble a bilinear form on a basis.

    Parameters
    ----------
    form : BilinearForm
    basis : skfem.CellBasis

    Returns
    -------
    Assembled

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> basis = fem.Basis(fem.MeshQuad().refined(2), fem.ElementVector(fem.ElementQuad1()))
    >>> made = assembled(linear_elasticity(), basis)
    >>> bool(abs(made.K - linear_elasticity().assemble(basis)).max() < 1e-14), made.symmetric
    (True, True)
    >>> mass = fem.BilinearForm(lambda u, v, w: u[0] * v[0] + u[1] * v[1])
    >>> assembled(mass, basis).by_skfem
    'the form uses values of u or v, not their gradients alone'
    """
    try:
        A = tensor(form, basis)
        check_numbering(basis)
        _check(form, A, basis)
    except NeedsMore as error:
        first, *others = (form.assemble(part) for part in parts(basis))
        return Assembled(sum(others, start=first), str(error), False, None)
    return Assembled(_summed(A, basis), "", np.array_equal(A, A.transpose(2, 3, 0, 1)), A)


def tensor(form: BilinearForm, basis: Any) -> Array:
    """Return the tensor ``A[c, j, e, k]`` of a form, its value for ``∂_j v_c = 1`` and ``∂_k u_e = 1``.

    Raises
    ------
    NeedsMore
        If the form needs values, coordinates or parameters, or is not bilinear.
    """
    own = any(
        name in vars(form) or getattr(type(form), name) is not getattr(BilinearForm, name)
        for name in ("assemble", "_assemble", "_kernel")
    )
    if own or np.dtype(form.dtype) != np.float64:
        raise NeedsMore("the form has an assembly or a type of numbers of its own")
    c, d = _components(basis), basis.mesh.dim()
    size = c * d
    unit = np.eye(size)
    # every pair of unit gradients, and some pairs of others, by which bilinear forms are told apart
    other = np.cos(np.arange(1, 2 * size * size + 1)).reshape(2, size, size) * [[[2.0]], [[3.0]]]
    U = np.concatenate([np.tile(unit, (size, 1)), other[0]])
    V = np.concatenate([np.repeat(unit, size, axis=0), other[1]])
    shape = (d,) if c == 1 else (c, d)
    slopes = [G.T.reshape(*shape, len(G), 1) for G in (U, V)]
    values, again = (
        _called(form, *(DiscreteField(np.full((*shape[:-1], len(U), 1), at), G) for G in slopes))
        for at in (np.nan, 0.7)
    )
    if values.shape != (len(U), 1):
        raise NeedsMore("the form depends on arrays of its own")
    if not np.array_equal(values, again):  # NaN, or what a form makes of it
        raise NeedsMore("the form uses values of u or v, not their gradients alone")
    A, found = values[: size * size, 0].reshape(size, size), values[size * size :, 0]
    expected = np.einsum("pi,ij,pj->p", other[1], A, other[0])
    scale = np.einsum("pi,ij,pj->p", abs(other[1]), abs(A), abs(other[0]))
    if not np.all(np.abs(found - expected) <= COMPUTED * scale):
        raise NeedsMore("the form is not bilinear in the gradients of u and v")
    return np.asarray(A.reshape(c, d, c, d))


def _called(form: BilinearForm, u: DiscreteField, v: DiscreteField) -> Array:
    """Values of a form that may use nothing but u and v."""
    w = _NoParameters()
    try:
        with np.errstate(all="ignore"):
            values = np.asarray(form.form(u, v, w), dtype=float)
    except NeedsMore:
        raise
    except Exception as error:  # whatever a user's function does with arrays that are not a basis'
        raise NeedsMore(
            "the form depends on arrays of its own, or can not be evaluated for gradients alone"
        ) from error
    if vars(w):  # and the form went on without what it had asked for
        raise NeedsMore(USED)
    return values


#: Why forms that read from their third argument are not assembled here.
USED = "the form uses its third argument: coordinates, sizes of elements, or fields"


class _NoParameters:
    """The third argument of a form that may not use it; it has an attribute once something was read."""

    def _refuse(self, *_: Any) -> Any:
        vars(self)["read"] = True
        raise NeedsMore(USED)

    __getattr__ = __getitem__ = __contains__ = __iter__ = __len__ = __bool__ = __eq__ = _refuse
    __hash__ = None  # type: ignore[assignment]


def _components(basis: Any) -> int:
    return 1 if basis.elem is scalar_element(basis.elem) else int(basis.elem.dim)


def check_numbering(basis: Any) -> None:
    """Refuse a numbering in which the components of a node do not follow each other."""
    c, dofs = _components(basis), basis.element_dofs
    if (dofs[::c] % c).any() or not all(np.array_equal(dofs[i::c], dofs[::c] + i) for i in range(c)):
        raise NeedsMore("the components of a node are not numbered one after the other")


def _check(form: BilinearForm, A: Array, basis: Any) -> None:
    """Compare a tensor with what scikit-fem integrates on two elements, with each function once.

    The functions of u meet those of v of all components. A form may read arrays of its own, with a
    number for each element or point of integration.
    """
    elements = np.unique([0, basis.nelems - 1])
    if basis.tind is not None:
        elements = np.asarray(basis.tind)[elements]
    some = some_elements(basis, elements)
    G, count = shape_gradients(some, elements), some.Nbfun
    local = np.einsum("cjfk,xjaq,xkbq,xq->xacbf", A, G, G, some.dx, optimize=True)
    local = local.reshape(len(elements), count, count)
    scale = np.abs(local).max(axis=(1, 2))
    w = FormExtraParams(some.default_parameters())
    for j in range(count):
        i = (j + 1 + j // len(A)) % count
        try:
            expected = form._kernel(some.basis[j], some.basis[i], w, some.dx)
        except Exception as error:  # such as arrays that have the size of the whole basis
            raise NeedsMore("the form depends on arrays of its own") from error
        if not np.all(np.abs(local[:, i, j] - expected) <= COMPUTED * scale):
            raise NeedsMore("the form is not the same on all elements")


def _summed(A: Array, basis: Any) -> csr_matrix:
    """Return ``K_(ac)(be) = A_cjek L^jk_ab``, summed over all elements."""
    c = len(A)
    indptr, indices, place = pattern(basis.element_dofs[::c] // c, basis.N // c)
    L = _gradient_products(basis, place, len(indices))
    # the rows of a node's components follow each other, each with all blocks of the node; what is as
    # large as K is made once: memory that is touched for the first time costs more than the sums
    count = np.diff(indptr)
    first = (c * (np.arange(len(indices)) + (c - 1) * np.repeat(indptr[:-1], count))).astype(
        place.dtype
    )
    step = np.repeat(c * count, count).astype(place.dtype)
    data, columns = np.empty(c * c * len(indices)), np.empty(c * c * len(indices), dtype=place.dtype)
    for row, column in np.ndindex(c, c):
        at = first + (row * step + column)
        terms = (A[row, j, column, k] * L[j, k] for j, k in np.argwhere(A[row, :, column]))
        data[at] = sum(terms, start=np.zeros(len(indices)))
        columns[at] = c * indices + column
    starts = np.concatenate([[0], np.cumsum(np.repeat(c * count, c))])
    K = csr_matrix((data, columns, starts), shape=(basis.N, basis.N))
    K.has_canonical_format = True
    K.eliminate_zeros()  # as scikit-fem has it: regular grids have many
    return K


def pattern(dofs: Index, n: int) -> tuple[Index, Index, Index]:
    """Return the pattern of a scalar matrix, and where the entries of element matrices go in it.

    Parameters
    ----------
    dofs : ndarray of int, shape (k, e)
        Scalar DOFs of each element.
    n : int
        Number of scalar DOFs.

    Returns
    -------
    indptr, indices : ndarray of int
        Of a csr_matrix with sorted indices.
    place : ndarray of int, shape (e, k, k)
        Entry of the matrix that an entry of an element matrix belongs to.

    Examples
    --------
    Two rods, 0 - 1 - 2:

    >>> indptr, indices, place = pattern(np.array([[0, 1], [1, 2]]), 3)
    >>> indptr.tolist(), indices.tolist()
    ([0, 2, 5, 7], [0, 1, 0, 1, 2, 1, 2])
    >>> place.tolist()
    [[[0, 1], [2, 3]], [[3, 4], [5, 6]]]
    """
    k, e = dofs.shape
    nodes = np.ascontiguousarray(dofs.T)
    by_node = np.argsort(nodes.ravel(), kind="stable").astype(
        np.int32 if e * k * k < 2**31 else np.int64
    )
    # one row for each node, of all nodes of all its elements; the data say where each comes from
    starts = np.concatenate([[0], np.cumsum(k * np.bincount(nodes.ravel(), minlength=n))])
    origin = (k * by_node[:, None] + np.arange(k, dtype=by_node.dtype)).ravel()
    met = csr_matrix((origin, nodes[by_node // k].ravel(), starts), shape=(n, n))
    met.sort_indices()
    first = np.empty(len(met.indices), dtype=bool)
    first[:1] = True
    np.not_equal(met.indices[1:], met.indices[:-1], out=first[1:])
    first[starts[:-1][starts[:-1] < starts[1:]]] = True
    group = np.cumsum(first, dtype=by_node.dtype)
    place = np.empty(e * k * k, dtype=by_node.dtype)
    place[met.data] = group - 1
    ends = np.concatenate([[0], group])[starts]
    return ends, met.indices[first], place.reshape(e, k, k)


def _gradient_products(basis: Any, place: Index, count: int) -> Array:
    """Return ``L^jk_ab = ∫ ∂_j N_a ∂_k N_b`` on a pattern of `count` entries, shape (d, d, count)."""
    d, k = basis.mesh.dim(), place.shape[1]
    L = np.zeros((d, d, count))
    begin = 0
    # gradients, weighted ones and the Jacobian's inverse; products, their transpose and places
    for elements in chunks(basis, 8 * (3 * d * k * basis.X.shape[1] + 4 * k * k)):
        G = shape_gradients(basis, elements)
        dx = point_volumes(basis, elements)
        weighted = G * dx[:, None, None]
        where = place[begin : begin + len(G)].ravel()
        begin += len(G)
        low, high = int(where.min()), int(where.max()) + 1  # elements near each other are numbered so
        where = where - low
        for i, j in combinations_with_replacement(range(d), 2):
            product = weighted[:, i] @ G[:, j].swapaxes(1, 2)
            other = product.swapaxes(1, 2)
            if i == j:  # symmetric, to the last digit
                L[i, i, low:high] += np.bincount(where, (0.5 * (product + other)).ravel())
            else:
                L[i, j, low:high] += np.bincount(where, product.ravel())
                L[j, i, low:high] += np.bincount(where, other.ravel())
    return L


# -- moduli ----------------------------------------------------------------------------------------


class Moduli(NamedTuple):
    """Of every element, shape (e,), or of all of them, shape (1,) [stress]."""

    bulk: Array
    shear: Array

    @property
    def quotient(self) -> float:
        """The largest bulk over shear modulus of an element; 0 where none resists shear."""
        there = self.shear > 0
        return float(np.max(self.bulk[there] / self.shear[there], initial=0.0))


def moduli(form: BilinearForm, basis: Any, tensor: Array | None) -> Moduli | None:
    """Return the moduli of the material of every element; None if the form does not tell.

    Parameters
    ----------
    form : BilinearForm
        Of displacements. Weights of the area, such as ``2 pi r``, are in both moduli.
    basis : skfem.CellBasis
    tensor : ndarray, shape (d, d, d, d), or None
        Of a form that is the same everywhere and sees gradients alone, see `assembly`.

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity, lame_parameters
    >>> basis = fem.Basis(fem.MeshHex(), fem.ElementVector(fem.ElementHex1()))
    >>> found = moduli(linear_elasticity(*lame_parameters(1.0, 0.49)), basis, None)
    >>> found.bulk.round(3).tolist(), found.shear.round(3).tolist(), round(found.quotient, 3)
    ([16.667], [0.336], 49.667)
    """
    d = basis.mesh.dim()
    gradients = [np.eye(d), *(_shear(d, i, j) for i, j in combinations(range(d), 2))]
    if tensor is not None:
        energies = np.array([[np.einsum("cj,cjek,ek", G, tensor, G)] for G in gradients])
    else:
        try:
            some = [_energies(form, part, gradients) for part in parts(basis)]
        except Exception:  # whatever a user's function does with fields that no basis has made
            return None
        energies = np.concatenate(some, axis=1)
    if not np.isfinite(energies).all():
        return None
    return Moduli(energies[0] / d**2, energies[1:].mean(axis=0) / 4)


def mean_moduli(K: csr_matrix, points: Array, component: Index, volume: float) -> Moduli:
    """Return the moduli of a stiffness, as means over the body.

    Parameters
    ----------
    K : csr_matrix, shape (n, n)
        Without supports.
    points : ndarray, shape (n, d)
        Where each DOF is [length].
    component : ndarray of int, shape (n,)
        The component of the displacement that each DOF is.
    volume : float
        Of the body [length^d].

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity, lame_parameters
    >>> basis = fem.Basis(fem.MeshTri().refined(2), fem.ElementVector(fem.ElementTriP1()))
    >>> K = linear_elasticity(*lame_parameters(1.0, 0.49)).assemble(basis)
    >>> found = mean_moduli(K, basis.doflocs.T, np.arange(basis.N) % 2, 1.0)
    >>> found.bulk.round(3).tolist(), found.shear.round(3).tolist(), round(found.quotient, 3)
    ([16.779], [0.336], 50.0)
    """
    d = points.shape[1]
    at, unit = points - points.mean(axis=0), np.eye(d)[component]
    gradients = [np.eye(d), *(_shear(d, i, j) for i, j in combinations(range(d), 2))]
    fields = np.column_stack([np.sum(unit * (at @ G), axis=1) for G in gradients])
    energies = np.einsum("ng,ng->g", fields, K @ fields) / volume
    return Moduli(energies[:1] / d**2, energies[1:].mean(keepdims=True) / 4)


def _shear(d: int, i: int, j: int) -> Array:
    out = np.zeros((d, d))
    out[i, j] = out[j, i] = 1.0
    return out


def _energies(form: BilinearForm, basis: Any, gradients: list[Array]) -> Array:
    """Means of the form over every element under uniform gradients (d, d), shape (g, e)."""
    d, dx = basis.mesh.dim(), np.asarray(basis.dx)
    w = FormExtraParams(basis.default_parameters())
    out = []
    for gradient in gradients:
        at = np.array(np.broadcast_to(gradient[:, :, None, None], (d, d, *dx.shape)))
        field = DiscreteField(np.zeros((d, *dx.shape)), at)
        values = np.broadcast_to(np.asarray(form.form(field, field, w), dtype=float), dx.shape)
        out.append((values * dx).sum(axis=1) / dx.sum(axis=1))
    return np.array(out)
