"""How soft bodies are at the nodes of their surfaces, read off the stiffness K."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from skfem_contact.bodies.areas import area_integrals
from skfem_contact.bodies.bare import NoBody
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.pairing.faces.joints import rim_points
from skfem_contact.pairing.faces.moduli import strained
from skfem_contact.pairing.thresholds import ALONG, NO_NORMAL
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import Tree

Array = NDArray[np.float64]

# Of the undeformed surfaces that are still in use: the stiffness of a body does not change.
_COMPLIANCES: WeakKeyDictionary[ContactSurface, Array] = WeakKeyDictionary()


def compliances(surface: ContactSurface) -> Array:
    """One over `plane_moduli`, and zero at nodes that are prescribed altogether or rigid, (m,)."""
    if isinstance(surface.body, NoBody):
        return np.zeros(len(surface.points))
    first = surface.original
    if first not in _COMPLIANCES:
        _COMPLIANCES[first] = np.where(first.held.all(axis=1), 0.0, 1.0 / plane_moduli(first))
    return _COMPLIANCES[first]


def plane_moduli(surface: ContactSurface) -> Array:
    r"""Plane modulus ``E* = E / (1 - nu^2)`` of the body at the nodes of a surface, shape (m,).

    Read off the stiffness, whatever mesh and element: under a displacement linear in the position
    the stress is uniform around a node, and its nodal force is ``sigma a`` with the vector
    ``a = int N n dA`` of the boundary. A dilatation gives ``P = 2 (lambda + mu) |a|``, shears
    ``Q = 2 mu |a|``, and the plane modulus is ``4 mu (lambda + mu) / (lambda + 2 mu)``. (Of solids P is
    ``(3 lambda + 2 mu) |a|``, see `faces.moduli`.) For plane stress lambda is the one of plane stress,
    as it stands in K. Bodies need not be homogeneous but around a node; springs to the ground do not
    matter.

    Where K is not that of an elastic body, its diagonal stands in for the modulus, which it is but
    for a factor of the order of one. The ends of a surface, whose nodes have other boundaries too,
    take the value of the node next to them.

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity, lame_parameters
    >>> from skfem_contact.bodies.body import Body
    >>> basis = fem.Basis(
    ...     fem.MeshTri().refined(2).with_defaults(), fem.ElementVector(fem.ElementTriP2())
    ... )
    >>> top = Body(basis, linear_elasticity(*lame_parameters(0.91, 0.3))).surface("top")
    >>> bool(abs(plane_moduli(top) - 1.0).max() < 1e-12)
    True
    """
    kind, measure = surface.kind, surface.body.measure
    area, length = area_integrals(surface.points, surface.facets, kind, measure)
    length **= 1 / kind.dim
    if surface.dim == 3:
        dilated, Q = strained(surface)
    else:
        dilated, stretched, sheared = _strained(surface)
        Q = np.sqrt(0.5 * np.sum(stretched**2 + sheared**2, axis=1))
    size, P = np.linalg.norm(area, axis=1), np.linalg.norm(dilated, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        if surface.dim == 3:
            # on a plane of symmetry the force has a part across that plane, from the boundary there
            p, ratio = dot(dilated, area) / size**2, Q / P
            modulus = ratio * (2 + ratio) / (1 + 2 * ratio) * p
        else:
            modulus = 2 * P * Q / ((P + Q) * size)
        diagonal = surface.body.K.diagonal()[surface.dofs].mean(axis=1) * length / size
    elastic = (dot(dilated, area) > ALONG * P * size) & np.isfinite(modulus) & (modulus > 0)
    if surface.dim == 3:  # at corners of quadratic triangles a is round-off
        elastic &= size > NO_NORMAL * length**2
    inner = _inner(surface)
    known = elastic & inner
    if not known.any():
        return np.where(np.isfinite(diagonal) & (diagonal > 0), diagonal, 1.0)
    modulus = np.where(elastic, modulus, diagonal)
    borrowed = ~inner | ~np.isfinite(modulus) | ~(modulus > 0)
    _, nearest = Tree(surface.points[known]).query(surface.points[borrowed])
    modulus[borrowed] = modulus[known][nearest]
    return modulus


def _inner(surface: ContactSurface) -> NDArray[np.bool_]:
    """Nodes that have no other boundaries than the surface, planes of symmetry apart, shape (m,)."""
    if surface.dim == 3:
        return ~rim_points(surface, mirrored=False)
    facets = np.bincount(surface.facets[:, :2].ravel(), minlength=len(surface.points))
    facets[surface.facets[:, 2:]] = 2
    return np.asarray(facets == 2)


def _strained(surface: ContactSurface) -> tuple[Array, Array, Array]:
    """Nodal forces of K under a dilatation, a stretch and a shear around each node, each (m, 2)."""
    body, centre = surface.body, surface.points.mean(axis=0)
    unit_x = (np.arange(2) == body.dof_component[:, None]).astype(float)
    at = body.dof_points - centre
    fields = [at, at * [1.0, -1.0], at[:, ::-1]]
    columns = [np.sum(unit_x * field, axis=1) for field in fields]
    forces = body.K[surface.dofs.ravel()] @ np.column_stack([*columns, unit_x])
    forces = forces.reshape(len(surface.points), 2, 5)
    # the fields vanish at the node itself: less their value there, a translation
    x, y = (surface.points - centre).T[:, :, None]
    by_x, by_y = forces[:, :, 3], forces[:, :, 4]
    return (
        forces[:, :, 0] - x * by_x - y * by_y,
        forces[:, :, 1] - x * by_x + y * by_y,
        forces[:, :, 2] - y * by_x - x * by_y,
    )
