r"""Error of pressures on straight facets of curves: nodal forces act along the curve, facets do not.

The pressure p of a chord that spans the angle a acts along the normal of the chord. Along the normal
of the curve, at the node between two, it has the force ``p L cos(a / 2)``: the nodal force over the
length L shows a pressure that is ``1 - cos(a / 2)`` too low, on matching meshes as well. Between two
bodies it is the mean of both sides (more or less, by their stiffness). Faces have at each of their
corners the angle between their own normal and that of the boundary in the place of ``a / 2``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.surface import ContactSurface

Array = NDArray[np.float64]


def chords_error(result: Answer, values: ContactValues) -> float:
    """By which part pressures are too low; zero on straight and on quadratic facets."""
    i = result.names.index(values.name)
    contact, part = result.contacts[i], result.slices()[i]
    forces = result.kin.B_n[part].T @ values.normal_force
    sides = [contact.secondary]
    if isinstance(contact.primary, ContactSurface):
        sides.append(contact.primary)
    return float(np.mean([_lost(side, forces[result.system.slice(side.body)]) for side in sides]))


def _lost(surface: ContactSurface, forces: Array) -> float:
    """Root of the mean square of ``1 - cos(a / 2)`` over a surface, weighted as the pressure is."""
    if surface.quadratic or surface.dofs.shape[1] != surface.dim:
        return 0.0  # what flows from chord to chord has no direction
    if surface.dim == 3:
        along = np.einsum("fkd,fkd->fk", surface.own_normals, surface.facet_node_normals)
        low, extent = np.maximum(1 - along.mean(axis=1), 0.0), surface.facet_areas
    else:
        half = np.arctan(0.5 * (surface.slopes[:, 0] - surface.slopes[:, 1]))
        low, extent = 1 - np.cos(half), surface.lengths
    size = np.linalg.norm(forces[surface.dofs], axis=1)
    pressure = np.divide(size, surface.area, out=np.zeros_like(size), where=surface.area > 0)
    weight = extent * np.sum(pressure[surface.facets] ** 2, axis=1)
    total = float(weight.sum())
    return float(np.sqrt(weight @ low**2 / total)) if total > 0 else 0.0


def net(result: Answer, bodies: float, chords: float) -> tuple[float, float]:
    """What is left of both where they are known to have opposite signs.

    Meshes are too stiff, so what interference presses is too high, and chords show too little of it.
    Loads and supports leave the sign of the first open: then the squares of both count.
    """
    driven = np.any(result.case.f) or np.any(result.case.x)
    if driven or np.isnan(bodies):
        return bodies, chords
    return max(bodies - chords, 0.0), max(chords - bodies, 0.0)
