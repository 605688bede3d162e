"""Checks of what users pass for a body: matrices, vectors, forms, sets of DOFs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

import numpy as np
import skfem
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix, issparse
from skfem.assembly import BilinearForm, CellBasis, DofsView, LinearForm
from skfem.helpers import inner

from skfem_contact.arguments import number, shown, suggest
from skfem_contact.arrays import check_finite, check_size, check_type, dof_numbers, rectangular
from skfem_contact.bodies.assembly import (
    Assembled,
    DeferredBasis,
    assembled,
    integrates,
    parts,
    scalar_element,
)
from skfem_contact.bodies.member import RemoteStiffness
from skfem_contact.digits import COMPUTED, GIVEN, ROUND_OFF
from skfem_contact.errors import InputError, warn
from skfem_contact.materials.material import Material
from skfem_contact.records import sealed_matrix

# A number on the diagonal of K that is larger than all others by this factor prescribes a displacement.
# skfem.penalize writes 1e10. Springs that are meant as springs are far below: beside one as stiff as
# this half of the digits of the body are lost.
PENALTY = 1e8

#: What loads, prescribed DOFs and their values may be, see `Body`.
Load: TypeAlias = ArrayLike | LinearForm | Mapping[str, ArrayLike]
Loads: TypeAlias = Load | Sequence[Load]
Dofs: TypeAlias = ArrayLike | DofsView | Mapping[str, DofsView] | Callable[[CellBasis], Any]
Values: TypeAlias = ArrayLike | Mapping[str, Any]

#: Lagrange elements whose DOFs are values at the nodes of the mesh: only these have contact nodes. With
#: what meshio calls their cells.
SUPPORTED: dict[type[skfem.Element], str] = {
    skfem.ElementTriP1: "triangle",
    skfem.ElementTriP2: "triangle6",
    skfem.ElementQuad1: "quad",
    skfem.ElementQuad2: "quad9",
    skfem.ElementQuadS2: "quad8",
    skfem.ElementTetP1: "tetra",
    skfem.ElementTetP2: "tetra10",
    skfem.ElementHex1: "hexahedron",
    skfem.ElementHexS2: "hexahedron20",
    skfem.ElementHex2: "hexahedron27",
}


#: What to write in place of what scikit-fem made of a system whose displacements are prescribed.
PLAIN = (
    "pass the plain K and f, the prescribed DOFs by D and their values by x: "
    "sc.Body(basis, K, f, D=D, x=x)"
)
CONDENSED = f"What skfem.condense returns leaves out the prescribed DOFs: {PLAIN}"
REAL = "contact needs real numbers"
TAKEN = (
    "; it may be boundary names, components by boundary, {'left': 'x'}, an array, basis.get_dofs(...), "
    "a dict of those, or a function of the basis that returns one of them"
)

#: Names of `skfem.Mesh.with_defaults`: both ends of the body along x, y and z.
ENDS = "left", "right", "bottom", "top", "front", "back"


SECOND_ORDER = skfem.MeshTri2, skfem.MeshQuad2, skfem.MeshTet2, skfem.MeshHex2


def facets_named(name: str, mesh: Any, what: str = "") -> Any:
    """Facets of a boundary of the mesh; `what` begins the messages.

    Raises
    ------
    InputError
        The mesh does not have it, or `skfem.Mesh.with_defaults` gave the same facets to both ends.
    """
    known = mesh.boundaries or {}
    if name not in known:
        tail = suggest(name, known, "boundaries")
        if name in ENDS:
            tail += " (default names need mesh.with_defaults(); joining meshes by + drops names)"
        if not known and isinstance(mesh, SECOND_ORDER):
            tail += ". scikit-fem drops the names of second-order files: sc.read_bodies keeps them"
        raise InputError(f"{what}boundary {name!r} not found in the mesh{tail}")
    if name in ENDS:
        _check_end(name, mesh, what)
    return known[name]


def _check_end(name: str, mesh: Any, what: str) -> None:
    """Refuse what `skfem.Mesh.with_defaults` takes for an end of the mesh besides it.

    It takes all facets within a hundredth of the smallest diameter of an element: where elements are
    thin, or coordinates were angles until the mesh was bent, that reaches those behind the end.
    """
    axis, known = ENDS.index(name) // 2, mesh.boundaries
    low, high = ENDS[2 * axis : 2 * axis + 2]
    both = np.intersect1d(known[low], known[high]) if low in known and high in known else ()
    x, behind = mesh.doflocs[axis], mesh.f2t[1, known[name]] >= 0
    if len(both):
        raise InputError(
            f"{what}boundaries {low!r} and {high!r} of the mesh share {len(both)} facets: "
            "mesh.with_defaults() takes both ends for one where elements are far wider than the "
            "body is thick. Name both by position: mesh.with_boundaries("
            f"{{{low!r}: lambda x: np.isclose(x[{axis}], {x.min():g}), "
            f"{high!r}: lambda x: np.isclose(x[{axis}], {x.max():g})}})"
        )
    if behind.any() and not behind.all():
        raise InputError(
            f"{what}{np.count_nonzero(behind)} of the {len(behind)} facets of boundary {name!r} are "
            "inside the mesh: mesh.with_defaults() also takes facets that are nearer to the end than a "
            "hundredth of the smallest element's diameter. Name it by position, before the mesh is "
            f"bent: mesh.with_boundaries({{{name!r}: lambda x: np.isclose(x[{axis}], end)}}), end "
            "being the coordinate there; or, of facets inside that are meant, by a name of your own"
        )


def check_basis(basis: Any, whose: str) -> None:
    if not isinstance(basis, CellBasis):
        condensed = f". {CONDENSED}" if issparse(basis) else ""
        raise InputError(
            f"the basis of {whose} is a {type(basis).__name__}, not a skfem.CellBasis; pass the "
            f"basis on which K was assembled: skfem.Basis(mesh, element){condensed}"
        )
    element, mesh = basis.elem, basis.mesh
    inner = element.elem if isinstance(element, skfem.ElementVector) else element
    if not isinstance(inner, tuple(SUPPORTED)):
        raise InputError(
            f"{whose} uses {type(inner).__name__}: contact needs elements whose DOFs are values "
            f"at nodes ({', '.join(kind.__name__ for kind in SUPPORTED)}), alone or in an "
            "ElementVector"
        )
    if not np.isfinite(scalar_element(element).doflocs).all():
        raise InputError(
            f"{whose} uses {type(inner).__name__}, some of whose DOFs are values at no node (bubbles): "
            "its doflocs are NaN there. Take one whose DOFs are values at nodes"
        )
    if element.dim != mesh.dim():
        raise InputError(
            f"{whose} has {element.dim} components in {mesh.dim()}-D; use skfem.ElementVector(element)"
        )
    if basis.nelems != mesh.nelements:
        raise InputError(
            f"the basis of {whose} covers {basis.nelems} of {mesh.nelements} elements of its "
            "mesh, which leaves DOFs without stiffness; restrict the mesh instead: "
            "mesh.restrict(elements)"
        )
    used = np.zeros(basis.N, dtype=bool)
    used[basis.dofs.element_dofs] = True
    if not used.all():
        first = int(np.flatnonzero(~used)[0])
        raise InputError(
            f"{np.count_nonzero(~used)} of {basis.N} DOFs of {whose} belong to no element, the first "
            f"is DOF {first}, and have no stiffness. Nodes without elements come with meshes from "
            "files: make the basis on mesh.remove_unused_nodes()"
        )
    bad = np.flatnonzero(~np.isfinite(mesh.doflocs).all(axis=0))
    if bad.size:
        raise InputError(
            f"{bad.size} nodes of the mesh of {whose} have NaN or infinite coordinates, the first "
            f"is node {bad[0]} at {tuple(mesh.doflocs[:, bad[0]].tolist())}"
        )
    flat = np.flatnonzero(_without_volume(mesh))
    if flat.size:
        where = ", ".join(f"{x:.6g}" for x in mesh.p[:, mesh.t[:, flat[0]]].mean(axis=1))
        raise InputError(
            f"{flat.size} elements of the mesh of {whose} have no volume, the first is element "
            f"{flat[0]} at ({where}): its nodes lie on each other, or in line. Usually a coordinate "
            "was given twice, or the mesh is one of a surface"
        )


def _without_volume(mesh: Any) -> np.ndarray:
    """Elements whose vertices lie in a plane, in 2-D on a line, (ne,)."""
    local = np.vstack([np.ones(len(mesh.t)), mesh.refdom.p])
    slope = np.linalg.pinv(local.T)[1:]  # of the linear function nearest to the vertices
    J = np.einsum("ike,jk->eij", mesh.p[:, mesh.t], slope, optimize=True)
    size = np.abs(J).max(axis=(1, 2))
    return np.asarray(np.abs(np.linalg.det(J)) <= ROUND_OFF * size ** mesh.dim())


def deferred_basis(mesh: Any, element: Any, intorder: Any, whose: str) -> DeferredBasis:
    """Return the basis of a body that is given by mesh and element."""
    if not isinstance(mesh, skfem.Mesh):
        raise InputError(
            f"mesh of {whose} is {shown(mesh)}, not a skfem.Mesh: from_mesh takes the mesh, then the "
            "element, then K; Body(basis, K) takes a basis"
        )
    if not isinstance(element, skfem.Element):
        raise InputError(
            f"element of {whose} is {shown(element)}, not a skfem.Element such as "
            "skfem.ElementVector(skfem.ElementHex1())"
        )
    if element.refdom != mesh.refdom:
        raise InputError(
            f"{type(scalar_element(element)).__name__} of {whose} does not belong to "
            f"{type(mesh).__name__}: take an element of the shape of the mesh's"
        )
    if intorder is not None and (not isinstance(intorder, int | np.integer) or intorder < 0):
        raise InputError(
            f"intorder of {whose} is {shown(intorder)}; give the degree of the polynomials that are "
            "integrated exactly, such as 2, or leave it out"
        )
    return DeferredBasis(mesh, element, intorder=None if intorder is None else int(intorder))


def check_points(basis: Any, what: str) -> None:
    """Refuse to integrate on a basis that has the numbering alone, where all integrals are zero."""
    if not integrates(basis):
        raise InputError(
            f"{what} is a form, and its basis has no points of integration, see PETSc.numbering: "
            "assemble the form on a basis that has some, and pass what comes out"
        )


def stiffness_of(K: Any, basis: Any, whose: str) -> Any:
    """Return the stiffness (n, n) that a user means: a matrix, or a form that is assembled here."""
    return assembled_stiffness(K, basis, whose)[0]


def mass_of(mass: Any, basis: Any, measure: Any, whose: str) -> Any:
    """Return the mass (n, n) that a user means: a density, a form, or a matrix."""
    if np.ndim(mass) == 0 and not isinstance(mass, BilinearForm) and not issparse(mass):
        density = number(mass, f"mass of {whose}", "give the mass by volume, a form or a matrix")
        if not 0.0 < density < np.inf:
            raise InputError(f"mass of {whose} is {density:g}; the mass by volume is positive")

        def inertia(u: Any, v: Any, w: Any) -> Any:
            return density * inner(u, v) * (1.0 if measure is None else measure(w.x))

        mass = BilinearForm(inertia)
    return stiffness_of(mass, basis, f"the mass of {whose}")


def assembled_stiffness(K: Any, basis: Any, whose: str) -> tuple[Any, Assembled | None]:
    """Return the same, and what a form was assembled to."""
    if not isinstance(K, BilinearForm):
        return _checked(K, basis, whose), None
    check_points(basis, f"K of {whose}")
    with _on_its_basis(basis, f"K of {whose}"):
        made = assembled(K, basis)
    return _checked(made.K, basis, whose, own=True, symmetric=made.symmetric), made


def _checked(K: Any, basis: Any, whose: str, own: bool = False, symmetric: bool = False) -> Any:
    """Return a checked stiffness; a copy, unless the matrix is our `own`."""
    elsewhere = isinstance(K, RemoteStiffness)
    if not (elsewhere or issparse(K) or (isinstance(K, np.ndarray) and K.ndim == 2)):
        hint = " (decorate the function with @skfem.BilinearForm)" if callable(K) else ""
        if isinstance(K, Material):
            hint = ", a linear stiffness: take sc.NonlinearBody for this material"
        elif isinstance(K, list | tuple) and len(K) == 2 and all(map(np.isscalar, K)):
            hint = f": write sc.Elastic({K[0]}, {K[1]}) if these are E and nu"
        raise InputError(
            f"K of {whose} is a {type(K).__name__}, not a sparse matrix or a skfem.BilinearForm{hint}"
        )
    if K.shape != (basis.N, basis.N):
        smaller = f", or is condensed. {CONDENSED}" if K.shape[0] < basis.N else ""
        raise InputError(
            f"K of {whose} has shape {K.shape}, its basis has {basis.N} DOFs; K belongs to "
            f"another basis{smaller}"
        )
    if elsewhere:  # the rest was checked where it was assembled
        return K
    check_type(K, f"K of {whose}", REAL)
    matrix = csr_matrix(K, dtype=np.float64)
    if not matrix.has_canonical_format:
        matrix = matrix.copy()  # summing duplicates works in place, and the matrix may be the user's
        matrix.sum_duplicates()
    matrix = csr32(matrix)
    if not own and issparse(K) and K.format == "csr" and np.may_share_memory(K.data, matrix.data):
        matrix = matrix.copy()  # what the user does to the matrix later stays outside
    rows = np.repeat(np.arange(basis.N, dtype=np.int32), np.diff(matrix.indptr))
    check_finite(matrix.data, f"K of {whose}", "row", rows)
    del rows  # of the size of K, as what follows
    if symmetric:
        return sealed_matrix(matrix)
    scale = np.abs(matrix.data).max(initial=0.0)
    difference = _less_its_transpose(matrix)
    largest = np.abs(difference.data).max(initial=0.0)
    if largest > GIVEN * scale:
        raise InputError(
            f"K of {whose} is not symmetric: the largest entry of K - K' is {largest:.3g}, of K "
            f"{scale:.3g}. Boundary conditions imposed by skfem.enforce do that: {PLAIN}"
        )
    if largest > COMPUTED * scale:
        matrix = csr32(matrix - 0.5 * difference)
    return sealed_matrix(matrix)


def check_unprescribed(K: Any, D: np.ndarray, whose: str) -> None:
    """Find a matrix, given by the user, that has displacements prescribed in it.

    In rows of prescribed DOFs `skfem.enforce` leaves the diagonal alone, and
    `skfem.penalize` puts one large number there.

    Raises
    ------
    InputError
        Rows of one entry: these DOFs belong to the body no more.

    Warns
    -----
    ContactWarning
        Large numbers hold the body, which does not know where: it has no reactions.
    """
    if isinstance(K, RemoteStiffness) or not K.nnz:
        return
    filled = np.concatenate([[0], np.cumsum(K.data != 0, dtype=K.indptr.dtype)])[K.indptr]
    diagonal = K.diagonal()
    alone = (np.diff(filled) == 1) & (diagonal != 0)
    points = alone.all()  # on springs of their own
    alone[D] = False
    if alone.any() and not points:
        raise InputError(
            f"{np.count_nonzero(alone)} rows of K of {whose} have one entry, on the diagonal, the "
            f"first is row {int(np.argmax(alone))}: nothing connects these DOFs with the body. "
            f"Boundary conditions imposed by skfem.enforce do that: {PLAIN}"
        )
    large = diagonal == diagonal.max()
    large[D] = False
    others = np.abs(diagonal[~large]).max(initial=0.0)
    if others > 0 and diagonal.max() > PENALTY * others:
        warn(
            f"{np.count_nonzero(large)} entries on the diagonal of K of {whose} are "
            f"{diagonal.max():.3g}, all others at most {others:.3g}. Boundary conditions "
            "imposed by skfem.penalize do that: "
            f"the body does not know that it is held there, and tells no reaction. Instead {PLAIN}"
        )


@contextmanager
def _on_its_basis(basis: Any, what: str) -> Iterator[None]:
    """Say of a form that can not be assembled what it asks for, or for how many components it is."""
    try:
        yield
    except InputError as error:  # of what the form is made of
        raise InputError(f"{what}: {error}") from error
    except (KeyError, AttributeError) as error:
        raise InputError(
            f"{what} is a form that reads what is not there ({error}). A body whose form reads its own "
            "displacements, w['u'], is not linear: sc.NonlinearBody(basis, residual=..., tangent=...). "
            "For another field assemble here and pass what comes out: K=form.assemble(basis, u=...)"
        ) from error
    except (ValueError, IndexError) as error:
        vector = isinstance(basis.elem, skfem.ElementVector)
        made = "displacements, skfem.ElementVector(...)" if vector else "a scalar field"
        raise InputError(
            f"{what} is a form that can not be assembled on its basis ({error}). The basis is one of "
            f"{made}: elasticity needs skfem.ElementVector(element), heat the element alone"
        ) from error


def _less_its_transpose(matrix: csr_matrix) -> csr_matrix:
    """``K - K'`` of a matrix in canonical format, made in ``K'`` where both have one pattern."""
    transpose = csr_matrix(matrix.T)
    patterns = ("indptr", "indices")
    if all(np.array_equal(getattr(transpose, p), getattr(matrix, p)) for p in patterns):
        np.subtract(matrix.data, transpose.data, out=transpose.data)
        return transpose
    return matrix - transpose


def load_of(f: Any, basis: Any, what: str) -> np.ndarray:
    if f is None:
        return np.zeros(basis.N)
    if isinstance(f, LinearForm):
        check_points(basis, what)
        with _on_its_basis(basis, what):
            f = sum(f.assemble(part) for part in parts(basis))
    return dof_values(f, basis, what)


def is_load(f: Any) -> bool:
    """Return whether f is a load by itself, and no vector and no factor."""
    return isinstance(f, Mapping | LinearForm) or several(f)


def several(f: Any) -> bool:
    """Return whether a load is a list of loads, whose sum counts; a list of numbers is a vector."""
    return isinstance(f, list | tuple) and any(isinstance(part, Mapping | LinearForm) for part in f)


def dof_values(values: Any, basis: Any, what: str, used: Any = True) -> np.ndarray:
    """A vector of a user, one number for each DOF of a basis, checked; NaN where it is not used."""
    if callable(values):
        raise InputError(f"{what} is a function; assemble a skfem.LinearForm or pass a vector")
    array = rectangular(values, what, f"not a vector of {basis.N} numbers")
    check_size(array, basis.N, what, f"its basis has {basis.N} DOFs; it belongs to another basis")
    check_type(array, what, REAL)
    array = array.astype(np.float64)  # a copy: what the user does to the vector later stays outside
    check_finite(np.where(used, array, 0.0), what, "DOF")
    return array


def prescribed_dofs(D: Any, basis: Any, whose: str) -> np.ndarray:
    """Sorted DOF numbers from everything that `skfem.condense` takes and from boundary names."""
    if D is None:
        return np.zeros(0, dtype=np.int64)
    if callable(D) and not isinstance(D, DofsView):
        return prescribed_dofs(D(basis), basis, whose)
    if isinstance(D, str):
        if not len(facets_named(D, basis.mesh, f"D of {whose}: ")):
            raise InputError(
                f"D of {whose}: boundary {D!r} has no facets in the mesh, so that nothing would be "
                "held. Look at how it was selected: a function of position has to hold at the "
                "midpoints of facets"
            )
        return prescribed_dofs(basis.get_dofs(D), basis, whose)
    if isinstance(D, DofsView):
        if D.obj.N != basis.N:
            raise InputError(
                f"D of {whose} was taken from a basis with {D.obj.N} DOFs, its basis has {basis.N}"
            )
        return np.unique(D.flatten()).astype(np.int64)
    if isinstance(D, dict):
        D = [_components(name, held, basis, whose) for name, held in D.items()]
    if isinstance(D, list | tuple | set | frozenset):
        D = list(D)
        if any(isinstance(part, str) or not np.isscalar(part) for part in D):
            parts = [prescribed_dofs(part, basis, whose) for part in D]
            return np.unique(np.concatenate(parts))
    what = f"D of {whose}"
    numbers = np.atleast_1d(rectangular(D, what, "not DOF numbers or boundary names"))
    dofs = dof_numbers(numbers, basis.N, what, TAKEN, "; D belongs to another basis")
    _warn_other_numbers(dofs, basis, what)
    return dofs


def _components(boundary: str, held: Any, basis: Any, whose: str) -> Any:
    """DOFs of the components of a boundary that are named, "x" or ("x", "z"); other values are DOFs."""
    names = held if isinstance(held, list | tuple) else (held,)
    axes = "xyz"[: basis.mesh.dim()]
    kinds = {int if isinstance(name, np.integer) else type(name) for name in names}
    if kinds == {int} and len(names) <= len(axes) and all(0 <= k < len(axes) for k in names):
        meant = ", ".join(f'"{axes[k]}"' for k in names)
        meant = meant if len(names) == 1 else f"({meant})"
        raise InputError(
            f"D of {whose} has {held!r} for {boundary!r}, which would be numbers of DOFs. Components "
            f"are named: write {{{boundary!r}: {meant}}}. DOFs by number are an array, without a name"
        )
    if kinds != {str}:
        return held
    for name in names:
        if name not in tuple(axes):
            known = suggest(name, axes, "components")
            raise InputError(f"D of {whose} holds {name!r} of boundary {boundary!r}{known}")
    of_components = [basis.split_indices()[axes.index(name)] for name in names]
    return np.intersect1d(prescribed_dofs(boundary, basis, whose), np.concatenate(of_components))


def _warn_other_numbers(D: np.ndarray, basis: Any, what: str) -> None:
    """Warn of numbers of nodes or facets in the place of DOFs: those are anywhere in the body.

    Three or less may lie on the boundary by chance.
    """
    mesh = basis.mesh
    if len(D) < 4 or len(basis.nodal_dofs) == 1:
        return
    inside = int(np.sum(~np.isin(D, basis.get_dofs(mesh.boundary_facets()).flatten())))
    if not inside:
        return
    known = {"nodes": mesh.boundary_nodes(), "facets": mesh.boundary_facets()}
    for kind, there in known.items():
        if np.isin(D, there).all():
            warn(
                f"{what}: all {len(D)} numbers are those of {kind} on the boundary, but as DOFs "
                f"{inside} of them are inside the body, where it is held now. The DOFs of nodes are "
                "basis.nodal_dofs[:, nodes], those of facets basis.get_dofs(facets)."
            )
            return


def prescribed_values(x: Any, D: np.ndarray, no_D: bool, basis: Any, whose: str) -> np.ndarray:
    values = np.zeros(basis.N)
    if x is None:
        return values
    if no_D:
        raise InputError(f"x of {whose} prescribes values, but D does not say at which DOFs")
    values[D] = dof_values(x, basis, f"x of {whose}", np.isin(np.arange(basis.N), D))[D]
    return values


def csr32(matrix: Any) -> csr_matrix:
    """`csr_matrix` with int32 indices, as scikit-fem has them, where they fit."""
    matrix = csr_matrix(matrix)
    largest = max(matrix.nnz, *matrix.shape)
    if matrix.indices.dtype != np.int32 and largest <= np.iinfo(np.int32).max:
        parts = (matrix.data, matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32))
        return csr_matrix(parts, shape=matrix.shape)
    return matrix
