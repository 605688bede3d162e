"""`ContactSurface`: nodes, DOFs, facets, normals and tributary areas of one boundary."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from skfem_contact.arguments import check_name, numbers
from skfem_contact.bodies.curves import end_turns
from skfem_contact.bodies.face_kinks import kink_angles as face_kinks
from skfem_contact.bodies.face_kinks import sharp_edges
from skfem_contact.bodies.face_normals import area_elements, areas_and_normals, face_areas
from skfem_contact.bodies.faces import check_faces, seen_from_outside, twin_edges
from skfem_contact.bodies.facet_kinds import FacetKind, kind_of
from skfem_contact.bodies.facets import check_facets, facet_neighbours, order_along, oriented
from skfem_contact.bodies.nodes import as_met, curve_nodes, face_nodes, held_components, node_dofs
from skfem_contact.bodies.normals import (
    end_slopes,
    kink_angles,
    lengths_and_normals,
    normals_at,
    tributary_areas,
)
from skfem_contact.bodies.quadrics import Quadrics
from skfem_contact.bodies.rings import mirrors
from skfem_contact.bodies.selection import name_of, select_facets
from skfem_contact.bodies.thresholds import BENT, CORNER
from skfem_contact.errors import InputError
from skfem_contact.sealed import seal

if TYPE_CHECKING:
    from skfem_contact.bodies.body import Body

Moved = TypeVar("Moved", bound="ContactSurface")


@dataclass(frozen=True, eq=False)
class ContactSurface(ABC):
    """One boundary of a body as contact sees it: a curve of a plane body, or faces of a solid.

    Facets of a curve are listed along it with the body on their left, and the nodes in the order in
    which the facets meet them; so a plot over the nodes of one piece is a line. The corners of a face
    are listed counter-clockwise seen from outside, and faces in the order of their elements.

    Attributes
    ----------
    body : Body
    name : str
    points : ndarray, shape (m, d)
        Positions of the surface nodes [length].
    dofs : ndarray of int, shape (m, c)
        DOF (of the body) of each component at each node; ``c = d``, or 1 for a scalar field.
    facets : ndarray of int, shape (nf, k)
        Numbers of points: of lines (start, end), of quadratic ones (start, end, middle); of faces the
        corners, then the middles of the edges, edge i from corner i to the next, then the centre.
    facet_normals : ndarray, shape (nf, d)
        Outward unit normals, at the middle of a curved facet.
    normals : ndarray, shape (m, d)
        Outward unit normals at the nodes: average over the adjacent facets, the smaller counting
        more (weights 1/length in 2-D, ``sin(angle) / (length length)`` of the two edges in 3-D). At a
        corner this is the direction between the two sides, good to tell which way the node looks;
        the normals to constrain along are `facet_node_normals`.
    facet_node_normals : ndarray, shape (nf, 2, d), of faces (nf, k, d)
        Outward unit normals at start and end of each line, at all nodes of each face: averaged with
        the neighbours, but the facet's own where the surface turns by 45 degrees or more, or ends.
        A curved surface that ends on a line or plane of symmetry (one component of its last nodes is
        prescribed) is averaged with its mirror image.
    area : ndarray, shape (m,)
        Tributary areas: integrals of the shape functions times the `measure` of the body. They add
        up to the area of the surface. (The end of a quadratic facet on the axis of symmetry has
        area zero, as corners of quadratic triangles have; those of 8-node faces are negative.)
    lengths : ndarray, shape (nf,)
        Lengths of lines, roots of the areas of faces: the size of a facet [length].
    mesh_facets : ndarray of int, shape (nf,)
        Facet numbers in the mesh.
    kinks : ndarray, shape (m,)
        Angle by which the undeformed surface turns at a node beside a straight part or a flat; 0
        elsewhere, so on curves [rad]. Strains bend flats, and would make kinks come and go.
    undeformed : ContactSurface or None
        Of a surface that has `moved` the one where it came from.

    Examples
    --------
    The top of a unit square; the body is on the left, so the facet runs from right to left:

    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity
    >>> from skfem_contact.bodies.body import Body
    >>> basis = fem.Basis(fem.MeshQuad().with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    >>> top = Body(basis, linear_elasticity(), name="block").surface("top")
    >>> top.label, top.points.tolist(), top.area.round(12).tolist()
    ('block/top', [[1.0, 1.0], [0.0, 1.0]], [0.5, 0.5])
    >>> top.facet_normals.tolist()
    [[0.0, 1.0]]

    The top of a unit cube (in scikit-fem the side of the largest y), whose area is shared out evenly:

    >>> basis = fem.Basis(fem.MeshHex().with_defaults(), fem.ElementVector(fem.ElementHex1()))
    >>> top = Body(basis, linear_elasticity(), name="cube").surface("top")
    >>> top.kind.name, top.facet_normals.tolist(), top.area.round(12).tolist()
    ('quad4', [[0.0, 1.0, 0.0]], [0.25, 0.25, 0.25, 0.25])
    """

    body: Body
    name: str
    points: np.ndarray
    dofs: np.ndarray
    facets: np.ndarray
    facet_normals: np.ndarray
    normals: np.ndarray
    facet_node_normals: np.ndarray
    area: np.ndarray
    lengths: np.ndarray
    mesh_facets: np.ndarray
    kinks: np.ndarray
    undeformed: ContactSurface | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        kind = "quadratic" if self.quadratic else "linear"
        sizes = f"{len(self.points)} points, {len(self.facets)} {kind} facets"
        return f"<ContactSurface {self.label}: {sizes}>"

    @property
    def label(self) -> str:
        """ "body/name" for messages."""
        return f"{self.body.name}/{self.name}" if self.body.name else self.name

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return self.points.shape[1]

    @property
    def kind(self) -> FacetKind:
        """Nodes and shape functions of the facets."""
        return kind_of(self.dim, self.facets.shape[1])

    @property
    def quadratic(self) -> bool:
        """Whether facets have middle nodes."""
        return self.kind.quadratic

    @cached_property
    def held(self) -> np.ndarray:
        """Which components of each node are prescribed, shape (m, d)."""
        return held_components(self.body, self.dofs)

    def moved(self: Moved, u: np.ndarray) -> Moved:
        """Return the surface displaced: same nodes, facets and areas, new positions and normals.

        Parameters
        ----------
        u : ndarray, shape (n,)
            Displacement of the body [length].
        """
        u = numbers(u, f"the displacement of surface {self.label!r}", "give the body's vector")
        if self.dofs.shape[1] != self.dim:
            raise InputError(f"surface {self.label!r} belongs to a scalar field, it can not move")
        if u.shape != (self.body.n,):
            raise InputError(
                f"displacement of shape {u.shape} for surface {self.label!r}, whose body has "
                f"{self.body.n} DOFs"
            )
        points = self.points + u[self.dofs]
        return replace(self, points=points, undeformed=self.original, **self._normals_at(points))

    @property
    def original(self) -> ContactSurface:
        """The undeformed surface: itself, unless it has `moved`."""
        return self if self.undeformed is None else self.undeformed

    @cached_property
    def quadrics(self) -> Quadrics:
        """The smooth boundary that the nodes of the undeformed surface lie on."""
        if self.undeformed is not None:
            return self.undeformed.quadrics
        ends = self.sharp_points | (self.kinks > BENT)
        return Quadrics.of(self.points, self.facets, self.kind, self.normals, ends, self.mirrored)

    @cached_property
    def mirrored_rim(self) -> np.ndarray:
        """Components across which it goes on as its mirror image, at each of the `_rim`, (r, d).

        As the undeformed surface does: strains tilt what ends there.
        """
        if self.undeformed is not None:
            return self.undeformed.mirrored_rim
        return mirrors(self.points, self._rim, self.held, self.normals)

    @cached_property
    def mirrored(self) -> np.ndarray:
        """Components across which it goes on as its mirror image at nodes of the rim, shape (m, d)."""
        found = np.zeros(self.points.shape, dtype=bool)
        for node in self._rim.T:
            np.logical_or.at(found, node, self.mirrored_rim)
        return found

    @property
    @abstractmethod
    def _rim(self) -> np.ndarray:
        """Where the surface ends: end nodes of curves (r, 1), edges of faces (r, 2)."""

    @property
    @abstractmethod
    def sharp_points(self) -> np.ndarray:
        """Nodes where facets meet at 45 degrees or more, shape (m,)."""

    @property
    @abstractmethod
    def neighbours(self) -> np.ndarray:
        """Facets before and after each line, (nf, 2), or across each edge of a face, (nf, c); or -1."""

    @abstractmethod
    def _normals_at(self, points: np.ndarray) -> dict[str, Any]:
        """Lengths and normals with the nodes at other positions."""


@dataclass(frozen=True, eq=False, repr=False)
class CurveSurface(ContactSurface):
    """A boundary of a plane or axisymmetric body, see `ContactSurface`.

    Attributes
    ----------
    slopes : ndarray, shape (nf, 2)
        Slopes of the smooth boundary against the chord at start and end of each linear facet of a
        curve, of the undeformed body (`normals.end_slopes`); zero elsewhere.
    end_turns : ndarray, shape (nf, 2)
        Where the surface ends before or after a facet: by how much the boundary of the body turns
        there, > 0 at a convex corner [rad]; 0 elsewhere. From the undeformed mesh.
    """

    slopes: np.ndarray
    end_turns: np.ndarray

    @cached_property
    def neighbours(self) -> np.ndarray:
        """Facets before and after each facet, shape (nf, 2); -1 where the surface ends."""
        return facet_neighbours(self.facets)

    @cached_property
    def end_normals(self) -> np.ndarray:
        """The facets' own outward unit normals at start and end, (nf, 2, d), not averaged."""
        return normals_at(self.points, self.facets, np.array([0.0, 1.0]))[0]

    @cached_property
    def sharp_points(self) -> np.ndarray:
        """Nodes where facets meet at 45 degrees or more, shape (m,)."""
        sharp = np.zeros(len(self.points), dtype=bool)
        ends, other = self.end_normals, self.neighbours
        along = np.einsum("fsd,fsd->fs", ends, ends[other, [1, 0]])
        sharp[self.facets[:, :2][(other >= 0) & (along < CORNER)]] = True
        return sharp

    @property
    def _rim(self) -> np.ndarray:
        return self.facets[:, :2][self.neighbours < 0][:, None]

    def _normals_at(self, points: np.ndarray) -> dict[str, Any]:
        return lengths_and_normals(points, self.facets, self.held, self.neighbours)


@dataclass(frozen=True, eq=False, repr=False)
class FaceSurface(ContactSurface):
    """Faces of a solid, see `ContactSurface`.

    Attributes
    ----------
    twins : ndarray of int, shape (nf, c)
        The same edge seen from the face across it; -1 where the surface ends. Edge i of face f has the
        number ``c f + i``.
    """

    twins: np.ndarray

    @property
    def facet_areas(self) -> np.ndarray:
        """Areas of the faces, shape (nf,), without a `measure`."""
        return self.lengths**2

    @property
    def neighbours(self) -> np.ndarray:
        """The face across edge i of each face, shape (nf, c); -1 where the surface ends."""
        return np.where(self.twins >= 0, self.twins // self.kind.corners, -1)

    @cached_property
    def own_normals(self) -> np.ndarray:
        """The faces' own outward unit normals at their nodes, (nf, k, 3), not averaged."""
        normals = area_elements(self.points, self.facets, self.kind, self.kind.locations)
        return normals / np.linalg.norm(normals, axis=2, keepdims=True)

    @cached_property
    def sharp_edges(self) -> np.ndarray:
        """Edges (nf, c) where faces meet at 45 degrees or more, at one end at least."""
        return sharp_edges(self.own_normals[:, : self.kind.corners], self.twins)

    @cached_property
    def sharp_points(self) -> np.ndarray:
        """Nodes on sharp edges, shape (m,)."""
        sharp = np.zeros(len(self.points), dtype=bool)
        sharp[self.facets[:, self.kind.edges][self.sharp_edges]] = True
        return sharp

    @property
    def _rim(self) -> np.ndarray:
        return self.facets[:, self.kind.edges[:, :2]][self.twins < 0]

    @cached_property
    def mirror_edges(self) -> np.ndarray:
        """Components across which it goes on as its mirror image at edges of faces, (nf, c, 3)."""
        found = np.zeros((*self.twins.shape, 3), dtype=bool)
        found[self.twins < 0] = self.mirrored_rim
        return found

    def _normals_at(self, points: np.ndarray) -> dict[str, Any]:
        return areas_and_normals(points, self.facets, self.kind, self.held, self.twins)


def extract_surface(
    body: Body, where: Any, nodes: bool = False, name: str | None = None
) -> CurveSurface | FaceSurface:
    """Take a surface out of the mesh of a body; the function behind `Body.surface`."""
    check_name(name, "name of a surface")
    name = name or name_of(where)
    label = f"{body.name}/{name}" if body.name else name
    numbers = select_facets(body.basis.mesh, where, nodes, label)
    make = _curve if body.dim == 2 else _faces
    surface = make(body, name, label, numbers)
    seal(surface)
    return surface


def _curve(body: Body, name: str, label: str, numbers: np.ndarray) -> CurveSurface:
    basis, mesh = body.basis, body.basis.mesh
    numbers, facets_v = oriented(mesh, numbers)
    order = order_along(facets_v)
    numbers, facets_v = numbers[order], facets_v[order]
    unique, facets = as_met(curve_nodes(basis, numbers, facets_v))
    if facets.shape[1] == 3:
        facets = facets[:, [0, 2, 1]]
    dofs = node_dofs(basis, unique, body.components)
    points = np.ascontiguousarray(basis.doflocs[:, dofs[:, 0]].T)
    check_facets(points, facets, numbers, mesh, label)
    neighbours = facet_neighbours(facets)
    normals = lengths_and_normals(points, facets, held_components(body, dofs), neighbours)
    return CurveSurface(
        body=body,
        name=name,
        points=points,
        dofs=dofs,
        facets=facets,
        area=tributary_areas(points, facets, body.measure, label),
        mesh_facets=numbers,
        slopes=end_slopes(points, facets, normals["facet_node_normals"]),
        end_turns=end_turns(basis, points, facets, facets_v, neighbours),
        kinks=kink_angles(points, facets, neighbours),
        **normals,
    )


def _faces(body: Body, name: str, label: str, numbers: np.ndarray) -> FaceSurface:
    basis, mesh = body.basis, body.basis.mesh
    numbers, vertices = seen_from_outside(mesh, numbers)
    unique, facets = as_met(face_nodes(basis, numbers, vertices))
    dofs = node_dofs(basis, unique, body.components)
    points = np.ascontiguousarray(basis.doflocs[:, dofs[:, 0]].T)
    kind = kind_of(3, facets.shape[1])
    check_faces(points, facets, kind, numbers, mesh, label)
    twins = twin_edges(facets[:, : kind.corners])
    return FaceSurface(
        body=body,
        name=name,
        points=points,
        dofs=dofs,
        facets=facets,
        area=face_areas(points, facets, kind, body.measure, label),
        mesh_facets=numbers,
        kinks=face_kinks(points, facets, kind, twins),
        twins=twins,
        **areas_and_normals(points, facets, kind, held_components(body, dofs), twins),
    )
