"""Some elements of a mesh as a mesh of their own, such that sums over pieces are those of the whole.

scikit-fem's `restrict` does it for straight meshes. It drops the middle nodes of curved ones, gives a
named facet between two pieces to both, and forgets on which side of its facets a boundary looks.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skfem.generic_utils import OrientedBoundary

Index = NDArray[np.intp]


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
