"""How surfaces curve, by their normals at the nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED, GIVEN

Array = NDArray[np.float64]


def curvatures(surface: ContactSurface) -> Array:
    """Of every facet, by the normals at its ends: averaged, except over corners, (nf,) [1/length]."""
    normal = surface.facet_node_normals
    return np.asarray(np.linalg.norm(normal[:, 1] - normal[:, 0], axis=1) / surface.lengths)


def curvature_tensors(surface: ContactSurface) -> Array:
    """How normals change along each face, by the averaged ones at its corners, (nf, 3, 3) [1/length].

    >>> import numpy as np
    >>> import skfem as fem
    >>> from skfem_contact.bodies.body import Body
    >>> mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 4)]).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> cube = Body(basis, np.eye(basis.N)).surface("top")
    >>> bool(curvature_tensors(cube).any())
    False
    """
    c = surface.kind.corners
    x = surface.points[surface.facets[:, :c]]
    n = surface.facet_node_normals[:, :c]
    if np.max(np.abs(n - surface.facet_normals[:, None])) < COMPUTED**0.5:
        return np.zeros((len(x), 3, 3))
    x, n = x - x.mean(axis=1, keepdims=True), n - n.mean(axis=1, keepdims=True)
    square = np.einsum("fkd,fke->fde", x, x)
    change = np.einsum("fkd,fke->fde", n, x)
    K = change @ np.linalg.pinv(square, rcond=GIVEN, hermitian=True)
    across = surface.facet_normals
    plane = np.eye(3) - across[:, :, None] * across[:, None, :]
    K = plane @ K @ plane
    return np.asarray(0.5 * (K + np.swapaxes(K, 1, 2)))
