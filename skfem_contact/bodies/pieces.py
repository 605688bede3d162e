"""Connected pieces of a mesh."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from skfem_contact.arrays import Index


def pieces(elements: Index, n: int) -> Index:
    """Number of the connected piece that each of n DOFs belongs to, shape (n,).

    Parameters
    ----------
    elements : ndarray of int, shape (k, ne)
        DOFs of each element.
    n : int

    Examples
    --------
    >>> pieces(np.array([[0, 1, 4], [1, 2, 3]]), 5).tolist()
    [0, 0, 0, 1, 1]
    """
    # DOFs are the first nodes of the graph, and elements the last: their rows are what is known
    size = n + elements.shape[1]
    start = np.zeros(size + 1, dtype=elements.dtype)
    start[n:] = np.arange(0, elements.size + 1, len(elements))
    graph = csr_matrix((np.ones(elements.size), elements.T.ravel(), start), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1][:n], dtype=np.intp)
