"""Nodal forces of solids under uniform strains, from which `pairing.frames` reads their modulus."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]


def strained(surface: ContactSurface) -> tuple[Array, Array]:
    """Nodal forces ``(3 lambda + 2 mu) a`` of K under a dilatation (m, 3), and ``2 mu |a|``, (m,).

    With ``a`` from `areas.area_integrals`. The five shears are an orthonormal basis of the strains
    without a trace; their squares add up to 5/3 of the identity, those of the forces to
    ``5/3 (2 mu)^2 |a|^2``.
    """
    body, centre = surface.body, surface.points.mean(axis=0)
    own = body.dof_component[:, None]
    unit_x = (np.arange(3) == own).astype(float)
    at = body.dof_points - centre
    shears = np.zeros((5, 3, 3))
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        shears[k, i, j] = shears[k, j, i] = np.sqrt(0.5)
    shears[3] = np.diag([1.0, -1.0, 0.0]) / np.sqrt(2)
    shears[4] = np.diag([1.0, 1.0, -2.0]) / np.sqrt(6)
    strains = np.concatenate([np.eye(3)[None], shears])
    columns = [np.take_along_axis(at @ strain, own, axis=1)[:, 0] for strain in strains]
    forces = body.K[surface.dofs.ravel()] @ np.column_stack([*columns, unit_x])
    forces = forces.reshape(len(surface.points), 3, 9)
    # the fields vanish at the node itself: less their value there, a translation
    here = np.einsum("sij,mj->mis", strains, surface.points - centre)
    found = forces[:, :, :6] - np.einsum("mci,mis->mcs", forces[:, :, 6:], here)
    return found[:, :, 0], np.sqrt(3 / 5 * np.sum(found[:, :, 1:] ** 2, axis=(1, 2)))
