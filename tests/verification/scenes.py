"""Builders shared by the verification problems: plain scikit-fem meshes, loads and fields.

Everything is described in a local frame; a `Pose` then rotates the scene and shuffles the
numbering of nodes and elements, neither of which may change what the physics says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc


@dataclass(frozen=True)
class Pose:
    """How a scene lies in space and how its nodes are numbered."""

    angle: float = 0.0  # degrees
    seed: int | None = None  # of the numbering; None leaves it as the mesh generator made it

    @property
    def matrix(self) -> np.ndarray:
        """Rotation matrix; exact for multiples of 90 degrees."""
        exact = {0.0: (1, 0), 90.0: (0, 1), 180.0: (-1, 0), 270.0: (0, -1)}
        angle = np.radians(self.angle)
        c, s = exact.get(self.angle % 360, (np.cos(angle), np.sin(angle)))
        return np.array([[c, -s], [s, c]], dtype=float)

    def turn(self, vectors: Any) -> np.ndarray:
        """Vectors (..., 2) of the local frame in global axes."""
        return np.asarray(vectors, dtype=float) @ self.matrix.T

    def back(self, vectors: Any) -> np.ndarray:
        """Vectors (..., 2) of global axes in the local frame."""
        return np.asarray(vectors, dtype=float) @ self.matrix


UPRIGHT = Pose()
# as the generator made it, any angle, axes exchanged, axes exchanged and turned round, renumbered
POSES = [Pose(), Pose(33.0), Pose(90.0), Pose(270.0), Pose(0.0, 7), Pose(33.0, 11)]
ELEMENTS = {
    "Q1": (fem.MeshQuad, fem.ElementQuad1),
    "P1": (fem.MeshTri, fem.ElementTriP1),
}


def block_basis(
    x: Any,
    y: Any,
    *,
    kind: str = "Q1",
    pose: Pose = UPRIGHT,
    shape: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Any:
    """Basis on a rectangle ``x`` by ``y`` with the sides left, right, bottom, top named.

    `shape` maps the local positions (2, nodes) to other ones before the pose does. Without it the basis
    is one that was there before: instances of a test begin with the same blocks.
    """
    lines = tuple(np.asarray(x, dtype=float).tolist()), tuple(np.asarray(y, dtype=float).tolist())
    if shape is None:
        return _known_basis(*lines, kind, pose)
    return _new_basis(*lines, kind, pose, shape)


@lru_cache(maxsize=64)
def _known_basis(x: Any, y: Any, kind: str, pose: Pose) -> Any:
    return _new_basis(x, y, kind, pose, None)


def _new_basis(x: Any, y: Any, kind: str, pose: Pose, shape: Any) -> Any:
    mesh_type, element = ELEMENTS[kind]
    mesh = mesh_type.init_tensor(np.array(x), np.array(y))
    if pose.seed is not None:
        mesh = shuffled(mesh, pose.seed)
    mesh = mesh.with_defaults()
    p = mesh.p if shape is None else shape(mesh.p)
    mesh = replace(mesh, doflocs=pose.turn(p.T).T.copy())
    return fem.Basis(mesh, fem.ElementVector(element()), intorder=2)


def shuffled(mesh: Any, seed: int) -> Any:
    """The same mesh with nodes and elements in a random order."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(mesh.p.shape[1])
    p = np.empty_like(mesh.p)
    p[:, order] = mesh.p
    t = order[mesh.t][:, rng.permutation(mesh.t.shape[1])]
    return type(mesh)(p, t)


def elastic(E: float, nu: float) -> Any:
    """Plane strain stiffness form."""
    return linear_elasticity(*lame_parameters(E, nu))


def field(basis: Any, function: Callable[[np.ndarray], Any], pose: Pose = UPRIGHT) -> np.ndarray:
    """Nodal values of a displacement in the local frame, ``function(x (2, n)) -> (2, n)``."""
    nodes = np.asarray(basis.nodal_dofs)
    local = pose.back(basis.mesh.p.T).T
    ux, uy = function(local)
    values = np.zeros(basis.N)
    turned = pose.turn(np.column_stack(np.broadcast_arrays(ux, uy, local[0])[:2]))
    values[nodes[0]], values[nodes[1]] = turned.T
    return values


def stress_load(basis: Any, sides: Any, stress: Any, pose: Pose = UPRIGHT) -> np.ndarray:
    """Load of a uniform stress state in the local frame on some sides: ``∫ v . sigma n``."""
    sigma = pose.matrix @ np.asarray(stress, dtype=float) @ pose.matrix.T
    total = np.zeros(basis.N)
    for side in [sides] if isinstance(sides, str) else sides:
        total += np.einsum("ij,jin->n", sigma, _normals_at(basis, side))
    return total


@lru_cache(maxsize=64)
def _normals_at(basis: Any, side: str) -> np.ndarray:
    """``∫ n_j v_i`` over a side for all functions v, shape (2, 2, basis.N)."""
    facets = fem.FacetBasis(basis.mesh, basis.elem, facets=side, intorder=2)
    form = [[fem.LinearForm(lambda v, w, i=i, j=j: w.n[j] * v[i]) for i in range(2)] for j in range(2)]
    return np.array([[each.assemble(facets) for each in row] for row in form])


def weight_load(basis: Any, force: Any) -> np.ndarray:
    """Load of a uniform body force with this resultant (2,), in global axes."""
    area = fem.Functional(lambda w: 1.0 + 0 * w.x[0]).assemble(basis)
    b = np.asarray(force, dtype=float) / area
    return np.asarray(fem.LinearForm(lambda v, w: b[0] * v[0] + b[1] * v[1]).assemble(basis))


def in_axes(values: Any, pose: Pose) -> dict[str, np.ndarray]:
    """Contact values sorted by position in the local frame, free of numbering, side and frame.

    Traction is that on the body of the secondary surface, slip the vector of its motion over the
    primary; swapping the sides turns both round.
    """
    points = pose.back(values.points)
    order = np.lexsort(np.round(points, 9).T)
    slip = np.einsum("ik,ikd->id", values.slip, values.tangent)
    return {
        "points": points[order],
        "forces": pose.back(values.forces)[order],
        "slip": pose.back(slip)[order],
        "area": values.area[order],
        "status": values.status[order],
    }


def contact_of(
    secondary: sc.bodies.ContactSurface, primary: Any, *, swap: bool = False, **settings: Any
) -> sc.Contact:
    """A contact, or the same with the two sides exchanged."""
    pair = (primary, secondary) if swap else (secondary, primary)
    return sc.Contact(*pair, **settings)


def ring_basis(
    radii: Any,
    angles: Any,
    *,
    closed: bool = False,
    centre: Any = (0.0, 0.0),
    element: Any = None,
) -> Any:
    """Basis on a sector (or, closed, on a whole ring) with quadrilaterals along rays and circles.

    `angles` in radians; of a closed ring without the repeated last one. The sides are named inner,
    outer, start and end.
    """
    r, a = np.asarray(radii, dtype=float), np.asarray(angles, dtype=float)
    i, j = np.meshgrid(np.arange(len(r)), np.arange(len(a)), indexing="ij")
    node = i * len(a) + j
    east = np.roll(node, -1, axis=1)
    corners = np.stack([node[:-1], node[1:], east[1:], east[:-1]])
    if not closed:
        corners = corners[:, :, :-1]
    c = np.asarray(centre, dtype=float)[:, None]
    p = c + np.stack([r[i] * np.cos(a[j]), r[i] * np.sin(a[j])]).reshape(2, -1)
    mesh = fem.MeshQuad(p, corners.reshape(4, -1))
    ring, ray = np.divmod(mesh.facets, len(a))
    sides = {"inner": ring == 0, "outer": ring == len(r) - 1}
    if not closed:
        sides |= {"start": ray == 0, "end": ray == len(a) - 1}
    mesh = mesh.with_boundaries({name: np.flatnonzero(on.all(axis=0)) for name, on in sides.items()})
    return fem.Basis(mesh, fem.ElementVector(element or fem.ElementQuad1()), intorder=2)


def pressure_load(basis: Any, side: str, p: float) -> np.ndarray:
    """Load of a uniform pressure on one side."""
    facets = fem.FacetBasis(basis.mesh, basis.elem, facets=side, intorder=2)
    form = fem.LinearForm(lambda v, w: -p * (w.n[0] * v[0] + w.n[1] * v[1]))
    return np.asarray(form.assemble(facets))


def plane_stress(E: float, nu: float) -> Any:
    """Plane stress stiffness form (unit thickness)."""
    return linear_elasticity(E * nu / (1 - nu**2), E / (2 * (1 + nu)))
