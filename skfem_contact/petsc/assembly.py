"""Stiffness assembled rank by rank: each rank calls a function of the user's for its part.

A DOF belongs to the lowest rank that has it in its contribution. Rows of others' DOFs are sent
there, once.
"""

from __future__ import annotations

import logging
import pickle
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, issparse
from skfem.assembly import CellBasis
from skfem.generic_utils import OrientedBoundary

from skfem_contact.arrays import Index, dof_numbers
from skfem_contact.bodies.inputs import stiffness_of
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.petsc.ranks import Ranks, csr_of
from skfem_contact.petsc.stiffness import RankedStiffness, Rows, bisected

Contribution = tuple[Index, csr_matrix]

# Elements of the pieces of a mesh that a rank assembles one after the other: scikit-fem takes some
# 40 kB for a hexahedron of 8 nodes, so this is 80 MB, and a call takes milliseconds.
ELEMENTS_AT_ONCE = 2000


def numbering(mesh: Any, element: Any) -> CellBasis:
    """A basis without points of integration."""
    none = np.zeros((mesh.dim(), 0)), np.zeros(0)
    return skfem.Basis(mesh, element, quadrature=none)


# -- on rank 0 --------------------------------------------------------------------------------


def assembled(own: Ranks, function: Callable[[Any], Any], basis: CellBasis) -> RankedStiffness:
    """Of a mesh that rank 0 has, by pieces of it."""
    if not isinstance(basis, CellBasis) or basis.nelems != basis.mesh.nelements:
        raise InputError(
            "assemble(function, basis): give the basis of a body, PETSc().numbering(mesh, element)"
        )
    return _made(own, by_name(function), _on_piece, int(basis.N), _pieces(basis, own.size))


def collected(own: Ranks, function: Callable[[int, int], Any]) -> RankedStiffness:
    """Of matrices that the ranks have."""
    return _made(own, by_name(function), _local, None, None)


def adopted(own: Ranks, K: csr_matrix) -> RankedStiffness:
    """A matrix of rank 0, which keeps all its rows."""
    K = csr_matrix(K)
    pieces = [[K.indptr, K.indices, K.data], *([] for _ in range(own.size - 1))]
    return _made(own, b"", _kept, K.shape[0], pieces)


def by_name(function: Any) -> bytes:
    """A function as the other ranks find it: by its name."""
    if not callable(function):
        raise InputError(f"a {type(function).__name__} is no function that each rank can call")
    try:
        return pickle.dumps(function)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            f"the other ranks can not find the function by its name ({error}): define it by def at "
            "the top of the script, above PETSc(), or in a module; settings go with "
            "functools.partial. Lambdas, forms and functions within functions have no name."
        ) from None


def _pieces(basis: CellBasis, count: int) -> Iterator[list[Any]]:
    """For each rank its piece of the mesh with the element, and the numbers of its DOFs."""
    mesh = basis.mesh
    part = parted(mesh, count)
    for rank in range(count):
        elements = np.flatnonzero(part == rank)
        if not len(elements):  # fewer elements than ranks
            yield []
            continue
        yield [piece(mesh, elements), basis.elem, basis.element_dofs[:, elements]]


def parted(mesh: Any, count: int) -> Index:
    """Number of the part of each element, of so many compact ones."""
    return bisected(np.ascontiguousarray(mesh.p[:, mesh.t].mean(axis=1).T), count)


def _made(
    own: Ranks,
    name: bytes,
    how: Callable[..., Contribution],
    n: int | None,
    pieces: Iterable[list[Any]] | None,
) -> RankedStiffness:
    key = own.number()
    told = own.together(_contribute, (key, name, how, n), pieces)
    if len(told[0]) == 1:
        raise InputError(*told[0])
    return RankedStiffness(own, key, told)


# -- on every rank ----------------------------------------------------------------------------


def _contribute(own: Ranks, given: tuple[Any, ...], parts: list[Any]) -> list[Any]:
    """Make this rank's contribution and its rows; on rank 0 alone what is wrong with them, if it is."""
    key, name, how, n = given
    found: tuple[str, Any]
    try:
        dofs, matrix = how(own, _found(name), parts)
        found = "", dofs
    except InputError as error:
        found = f"rank {own.rank} of {own.size}: {error}", None
    owners = _owners(own, found, n)
    if isinstance(owners, str):
        return [owners]
    rows = Rows.gathered(own.comm, dofs, matrix, owners)
    own.held[key] = rows
    return [rows.rows, rows.columns, rows.diagonal(), rows.matrix.nnz]


def _found(name: bytes) -> Any:
    if not name:
        return None
    try:
        return pickle.loads(name)
    except AttributeError as error:
        raise InputError(
            f"it does not know the function: {error}. What stands below PETSc() in the script is not "
            "there on the other ranks; define it above."
        ) from None


def _owners(own: Ranks, found: tuple[str, Any], n: int | None) -> Any:
    """The rank that each DOF of this rank's contribution belongs to, or words."""
    told = own.comm.gather(found)
    if own.rank:
        return own.comm.scatter(None)
    words = "; ".join(complaint for complaint, _ in told if complaint)
    answers: list[Any] = [words] * own.size
    if not words:
        largest = max((int(dofs.max(initial=-1)) for _, dofs in told), default=-1)
        owner = np.full(largest + 1 if n is None else n, -1, dtype=np.int32)
        for rank in reversed(range(own.size)):
            owner[told[rank][1]] = rank
        missing = np.flatnonzero(owner < 0)
        words = (
            f"{len(missing)} of {len(owner)} DOFs are in no rank's matrix, the first is {missing[0]}"
            if len(missing)
            else ""
        )
        answers = [words] * own.size if words else [owner[dofs] for _, dofs in told]
    return own.comm.scatter(answers)


def _on_piece(own: Ranks, function: Any, parts: list[Any]) -> Contribution:
    """Of a piece of the mesh, in the numbering of the whole.

    Some thousand elements at a time, as scikit-fem takes several times the memory of a matrix to
    assemble it.
    """
    if not parts:
        return np.zeros(0, dtype=np.intp), csr_matrix((0, 0))
    mesh, element, element_dofs = parts
    parts.clear()
    dofs, numbers = np.unique(element_dofs, return_inverse=True)
    numbers = numbers.reshape(element_dofs.shape).astype(np.int32)

    def assemble(elements: Index) -> csr_matrix:
        some = piece(mesh, elements)
        basis = numbering(some, element)
        place = np.empty(basis.N, dtype=np.int32)
        place[basis.element_dofs] = numbers[:, elements]
        with no_facets():
            given = function(some)
        K = _checked(given, basis.N, "a piece of the mesh").tocoo()
        return csr_matrix((K.data, (place[K.row], place[K.col])), shape=(len(dofs), len(dofs)))

    whole = csr_matrix((len(dofs), len(dofs)))
    count = -(-mesh.nelements // ELEMENTS_AT_ONCE)
    part = parted(mesh, count)
    for number in range(count):
        elements = np.flatnonzero(part == number)
        if number == 0:
            some = elements[sample(piece(mesh, elements))]
            _check_sum(assemble(some), [assemble(some[i : i + 1]) for i in range(len(some))])
        whole = whole + assemble(elements)
    return dofs, csr_matrix(whole)


def _check_sum(K: csr_matrix, parts: list[csr_matrix]) -> None:
    """Check that the stiffness of some elements is the sum of those of each."""
    off, largest = abs(K - sum(parts)).max(), abs(K).max()
    if off > COMPUTED * largest:
        raise InputError(
            "K of some elements is not the sum of those of each of them: off by "
            f"{off / largest:.1e} of its largest entry. The function sees pieces of the mesh, which "
            "end where the mesh goes on: it may integrate over elements, and over facets of named "
            "boundaries, facets=mesh.boundaries[name], but not over all ends of what it is given nor "
            "across facets between elements. What depends on the whole mesh, such as its extent, goes "
            "in by functools.partial"
        )


def _local(own: Ranks, function: Any, parts: list[Any]) -> Contribution:
    """The matrix of this rank, as the function has it."""
    given = function(own.rank, own.size)
    if not isinstance(given, tuple) or len(given) != 2:
        raise InputError(f"the function gave a {type(given).__name__}, not (dofs, matrix)")
    numbers, what = np.asarray(given[0]), "dofs that the function gave"
    if numbers.ndim != 1:
        raise InputError(f"{what} have shape {numbers.shape}: give one number for each row")
    most = int(numbers.max()) + 1 if numbers.size and numbers.dtype.kind in "iu" else 1
    dofs = dof_numbers(numbers, most, what, "", "") if numbers.size else np.zeros(0, dtype=np.intp)
    if len(dofs) != len(numbers):
        raise InputError(f"{what} have numbers twice: add the rows up")
    return numbers.astype(np.intp), _checked(given[1], len(numbers), "this rank")


def _kept(own: Ranks, function: Any, parts: list[Any]) -> Contribution:
    if not parts:
        return np.zeros(0, dtype=np.intp), csr_matrix((0, 0))
    n = len(parts[0]) - 1
    return np.arange(n), csr_of(parts, (n, n))


def _checked(matrix: Any, n: int, what: str) -> csr_matrix:
    """A symmetric matrix (n, n) of numbers, or why it is none."""
    if not issparse(matrix):
        raise InputError(f"K of {what} is a {type(matrix).__name__}, not a sparse matrix")
    if not n:
        return csr_matrix((0, 0))
    try:
        return csr_matrix(stiffness_of(matrix, SimpleNamespace(N=n), what))
    except InputError as error:
        if "symmetric" not in str(error):
            raise
        raise InputError(
            f"{error}. Each rank gives what its own elements make of all their DOFs, which is "
            "symmetric, not rows of the whole"
        ) from None


def piece(mesh: Any, elements: Index) -> Any:
    """Some elements (ascending), with the boundaries and subdomains of the mesh by name.

    A facet inside the mesh that has a name belongs to the piece that has the element from which
    scikit-fem looks at it, so that what is integrated over it counts once.

    Examples
    --------
    Three elements side by side, the first two of which meet at "joint":

    >>> import skfem
    >>> mesh = skfem.MeshQuad.init_tensor(np.arange(4.0), np.arange(2.0))
    >>> mesh = mesh.with_boundaries({"joint": lambda x: x[0] == 1.0}, boundaries_only=False)
    >>> [len(piece(mesh, np.array(some)).boundaries["joint"]) for some in ([0], [1, 2], [0, 1])]
    [0, 1, 1]
    """
    some = mesh.restrict(elements, skip_boundaries=True)
    if mesh.doflocs.shape[1] > mesh.nvertices:  # middle nodes
        doflocs = np.empty((len(mesh.doflocs), some.dofs.N))
        doflocs[:, some.dofs.element_dofs] = mesh.doflocs[:, mesh.dofs.element_dofs[:, elements]]
        some = replace(some, doflocs=doflocs)
    if not mesh.boundaries:
        return some
    facets = np.unique(mesh.t2f[:, elements])
    here = np.zeros(mesh.nelements, dtype=bool)
    here[elements] = True
    return replace(
        some, _boundaries={name: _own(mesh, at, facets, here) for name, at in mesh.boundaries.items()}
    )


def sample(mesh: Any) -> Index:
    """The elements at the ends of a mesh along the axes, and one beside each of them.

    >>> import skfem
    >>> sample(skfem.MeshQuad.init_tensor(np.arange(9.0), np.arange(2.0))).tolist()
    [0, 1, 6, 7]
    """
    middle = mesh.p[:, mesh.t].mean(axis=1)
    ends = np.concatenate([middle.argmin(axis=1), middle.argmax(axis=1)])
    beside = mesh.f2t[:, mesh.t2f[:, ends]]
    other = np.where(beside[0] == ends, beside[1], beside[0]).max(axis=0)  # -1 where there is none
    return np.unique(np.concatenate([ends, other[other >= 0]]))


@contextmanager
def no_facets() -> Iterator[None]:
    """Without scikit-fem's warning of bases without facets: most pieces have none of a boundary."""
    logger = logging.getLogger("skfem.assembly.basis.facet_basis")
    logger.addFilter(_other)
    try:
        yield
    finally:
        logger.removeFilter(_other)


def _other(record: logging.LogRecord) -> bool:
    return "with no facets" not in record.getMessage()


def _own(mesh: Any, at: Index, facets: Index, here: NDArray[np.bool_]) -> Any:
    """Facets of a boundary whose element is here, in the numbering of the piece's `facets`."""
    side = getattr(at, "ori", None)
    sides = np.zeros(len(at), dtype=np.intp) if side is None else np.asarray(side)
    at = np.asarray(at)
    mine = here[mesh.f2t[sides, at]]
    at, sides = at[mine], sides[mine]
    number = np.searchsorted(facets, at).astype(np.int32)
    if side is None:
        return number
    # where the other element is elsewhere, this one is the first that the facet has in the piece
    other = mesh.f2t[1 - sides, at]
    both = (other >= 0) & here[other]
    return OrientedBoundary(number, np.where(both, sides, 0))
