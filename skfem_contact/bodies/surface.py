"""`ContactSurface`: nodes, DOFs, facets, normals and tributary areas of one boundary."""

from __future__ import annotations

from dataclasses import field, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from skfem_contact.arguments import NamesAttributes, check_name, numbers
from skfem_contact.bodies.facet_kinds import (
    FacetKind,
    kind_of,
    node_shares,
    own_normals,
    tributary_areas,
)
from skfem_contact.bodies.member import Meshed
from skfem_contact.bodies.normal_field import (
    BENT,
    CORNER,
    POLYGON,
    end_slopes,
    end_turns,
    kink_angles,
    order_along,
    sharp_edges,
    sizes_and_normals,
    twin_edges,
)
from skfem_contact.bodies.quadrics import Quadrics, mirrors
from skfem_contact.bodies.selection import (
    as_met,
    check_facets,
    facet_nodes,
    held_components,
    name_of,
    node_dofs,
    seen_from_outside,
    select_facets,
)
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass, seal, sealed

T = TypeVar("T")


class _as_undeformed(cached_property[T]):
    """A cached property that a surface which has moved takes from the undeformed one."""

    def __get__(self, surface: Any, owner: type[Any] | None = None) -> Any:
        if surface is None or surface.undeformed is None:
            return super().__get__(surface, owner)
        return getattr(surface.undeformed, str(self.attrname))


@dataclass(frozen=True, eq=False)
class ContactSurface(NamesAttributes):
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
    facet_node_normals : ndarray, shape (nf, k, d)
        Outward unit normals at the nodes of each facet: averaged with the neighbours, but the
        facet's own where the surface turns by 45 degrees or more, or ends.
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
    twins : ndarray of int, shape (nf, c)
        The same edge seen from the facet across it; -1 where the surface ends. Edge i of facet f has
        the number ``c f + i``; the edges of a line are its start and its end.
    slopes : ndarray, shape (nf, 2)
        Slopes of the smooth boundary against the chord at start and end of each linear facet of a
        curve, of the undeformed body (`normal_field.end_slopes`); zero elsewhere.
    end_turns : ndarray, shape (nf, c)
        Where a curve ends before or after a facet: by how much the boundary of the body turns there,
        > 0 at a convex corner [rad]; 0 elsewhere. From the undeformed mesh.
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

    body: Meshed
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
    twins: np.ndarray
    slopes: np.ndarray
    end_turns: np.ndarray
    undeformed: ContactSurface | None = field(default=None, kw_only=True)

    def __repr__(self) -> str:
        kind = "quadratic" if self.quadratic else "linear"
        sizes = f"{len(self.points)} points, {len(self.facets)} {kind} facets"
        return f"<ContactSurface {self.label}: {sizes}>"

    @property
    def label(self) -> str:
        """ "body/name" for messages."""
        return f"{self.body.name}/{self.name}" if self.body.name else self.name

    @cached_property
    def dim(self) -> int:
        """Dimension of space."""
        return self.points.shape[1]

    @_as_undeformed
    def kind(self) -> FacetKind:
        """Nodes and shape functions of the facets."""
        return kind_of(self.dim, self.facets.shape[1])

    @cached_property
    def quadratic(self) -> bool:
        """Facets have middle nodes."""
        return self.kind.quadratic

    @_as_undeformed
    def held(self) -> np.ndarray:
        """The components of each node that are prescribed, shape (m, d)."""
        return held_components(self.body, self.dofs)

    @_as_undeformed
    def held_nodes(self) -> np.ndarray:
        """Nodes with prescribed DOFs, of a scalar field too, shape (m,)."""
        return np.asarray(np.isin(self.dofs, self.body.D).any(axis=1))

    def moved(self, u: np.ndarray) -> ContactSurface:
        """Return the surface displaced: same nodes and facets, new positions and normals.

        Of bodies of finite strain it has its areas there; small strains change none.

        Parameters
        ----------
        u : ndarray, shape (n,)
            Displacement of the body [length].
        """
        what, usage = f"the displacement of surface {self.label!r}", "give the body's vector"
        u = numbers(u, what, usage, copy=False)
        if self.dofs.shape[1] != self.dim:
            raise InputError(f"surface {self.label!r} belongs to a scalar field, it can not move")
        if u.shape != (self.body.n,):
            raise InputError(
                f"displacement of shape {u.shape} for surface {self.label!r}, whose body has "
                f"{self.body.n} DOFs"
            )
        points = self.points + u[self.dofs]
        normals = sizes_and_normals(points, self.facets, self.kind, self.held, self.twins, self.corner)
        moved = replace(self, points=points, undeformed=self.original, **normals)
        if not getattr(self.body, "finite_strain", False):
            return moved
        return replace(moved, area=sealed(tributary_areas(points, self.facets, *moved._weighed)))

    @property
    def original(self) -> ContactSurface:
        """The undeformed surface: itself, unless it has `moved`."""
        return self if self.undeformed is None else self.undeformed

    @_as_undeformed
    def quadrics(self) -> Quadrics:
        """The smooth boundary that the nodes of the undeformed surface lie on."""
        ends = self.sharp_points | (self.kinks > BENT)
        return Quadrics.of(self.points, self.facets, self.kind, self.normals, ends, self.mirrored)

    @_as_undeformed
    def mirrored_rim(self) -> np.ndarray:
        """Components across which it goes on as its mirror image, at each of the `_rim`, (r, d).

        As the undeformed surface does: strains tilt what ends there.
        """
        return mirrors(self.points, self._rim, self.held, self.normals)

    @cached_property
    def mirrored(self) -> np.ndarray:
        """Components across which it goes on as its mirror image at nodes of the rim, shape (m, d)."""
        found = np.zeros(self.points.shape, dtype=bool)
        for node in self._rim.T:
            np.logical_or.at(found, node, self.mirrored_rim)
        return found

    @property
    def measured_at(self) -> np.ndarray:
        """Positions of the nodes that the `measure` of the body is asked at, shape (m, d) [length].

        Rings are as long as their radius is now; a thickness goes with the body, and is that of the
        undeformed place.
        """
        return self.points if self.body.axisymmetric else self.original.points

    @property
    def _weighed(self) -> tuple[Any, ...]:
        return self.kind, self.body.measure, self.label, self.measured_at

    @cached_property
    def shares(self) -> np.ndarray:
        """Integrals of the shape functions, times the `measure`, over each facet, (nf, k) [area]."""
        return node_shares(self.points, self.facets, *self._weighed)

    @property
    def facet_areas(self) -> np.ndarray:
        """Lengths of lines, areas of faces, shape (nf,), without a `measure`."""
        return self.lengths**self.kind.dim

    @_as_undeformed
    def neighbours(self) -> np.ndarray:
        """Facets before and after each line, (nf, 2), or across each edge of a face, (nf, c); or -1."""
        return self.twins // self.kind.corners

    @cached_property
    def own_normals(self) -> np.ndarray:
        """The facets' own outward unit normals at their nodes, (nf, k, d), not averaged."""
        return own_normals(self.points, self.facets, self.kind)[0]

    @property
    def corner(self) -> float:
        """Cosine of the turn from which on lines meet at a corner; see `normal_field`."""
        return corner_of(self.body)

    @cached_property
    def sharp_edges(self) -> np.ndarray:
        """Edges (nf, c) where facets meet at a corner, 45 degrees or more, at one end at least."""
        return sharp_edges(self.own_normals[:, : self.kind.corners], self.twins, self.corner)

    @cached_property
    def sharp_points(self) -> np.ndarray:
        """Nodes on sharp edges, shape (m,)."""
        sharp = np.zeros(len(self.points), dtype=bool)
        sharp[self.facets[:, self.kind.edges][self.sharp_edges]] = True
        return sharp

    @_as_undeformed
    def kinks(self) -> np.ndarray:
        """Angle by which it turns at a node beside a straight part or a flat, (m,); 0 elsewhere [rad].

        That of the undeformed surface: strains bend flats, and would make kinks come and go.
        """
        return kink_angles(self.points, self.facets, self.kind, self.twins)

    @property
    def _rim(self) -> np.ndarray:
        """Find the rim of the surface: end nodes of curves (r, 1), edges of faces (r, 2)."""
        return self.facets[:, self.kind.edges[:, :2]][self.twins < 0]

    @cached_property
    def mirror_edges(self) -> np.ndarray:
        """Components across which it goes on as its mirror image at edges of facets, (nf, c, d)."""
        found = np.zeros((*self.twins.shape, self.dim), dtype=bool)
        found[self.twins < 0] = self.mirrored_rim
        return found


def extract_surface(
    body: Meshed, where: Any, nodes: bool = False, name: str | None = None
) -> ContactSurface:
    """Take a surface out of the mesh of a body; the function behind `Body.surface`."""
    check_name(name, "name of a surface")
    name = name or name_of(where)
    label = f"{body.name}/{name}" if body.name else name
    return surface_on(body, select_facets(body.basis.mesh, where, nodes, label), name, label)


def surface_on(body: Any, numbers: np.ndarray, name: str, label: str | None = None) -> ContactSurface:
    """The surface of some facets of the boundary; with a label for messages, they are checked."""
    basis, mesh = body.basis, body.basis.mesh
    numbers, vertices = seen_from_outside(mesh, numbers)
    if body.dim == 2:
        order = order_along(vertices)
        numbers, vertices = numbers[order], vertices[order]
    given = facet_nodes(mesh, basis, numbers, vertices)
    kind, twins = kind_of(body.dim, given.shape[1]), twin_edges(vertices)
    met = np.argsort(kind.locations[:, 0]) if kind.dim == 1 else np.arange(kind.nodes)
    unique, facets = as_met(given[:, met])
    facets = facets[:, np.argsort(met)]
    dofs = node_dofs(basis, unique, body.components)
    points = np.ascontiguousarray(basis.doflocs[:, dofs[:, 0]].T)
    if label is not None:
        check_facets(points, facets, kind, numbers, mesh, label)
    turns = end_turns(basis, points, facets, vertices, twins) if body.dim == 2 else None
    return surface_of(body, name, points, dofs, facets, twins, mesh_facets=numbers, end_turns=turns)


def surface_of(
    body: Any,
    name: str,
    points: np.ndarray,
    dofs: np.ndarray,
    facets: np.ndarray,
    twins: np.ndarray,
    **given: Any,
) -> ContactSurface:
    """The surface of some facets, with the fields that are not `given`, or None, from its geometry."""
    kind = kind_of(points.shape[1], facets.shape[1])
    held = held_components(body, dofs)
    normals = sizes_and_normals(points, facets, kind, held, twins, corner_of(body))
    label = f"{body.name}/{name}" if body.name else name
    fields = {
        "area": tributary_areas(points, facets, kind, body.measure, label),
        "slopes": end_slopes(points, facets, normals["facet_node_normals"]),
        "end_turns": np.zeros(twins.shape),
        **{key: value for key, value in given.items() if value is not None},
    }
    surface = ContactSurface(body, name, points, dofs, facets, twins=twins, **fields, **normals)
    seal(surface)
    return surface


# -- surfaces of no body ---------------------------------------------------------------------------


class NoBody:
    """In place of a body: it does not give way, and no other surface belongs to it."""

    name = None
    measure = None
    axisymmetric = False
    D = np.zeros(0, dtype=np.int64)

    def __init__(self, d: int) -> None:
        self.dim = self.components = d


def corner_of(body: Any) -> float:
    """Cosine of the turn from which on the surface of a body has a corner; see `normal_field`."""
    return POLYGON if isinstance(body, NoBody) and body.dim == 2 else CORNER


def bare_surface(points: np.ndarray, facets: np.ndarray, name: str) -> ContactSurface:
    """A surface of given facets: lines with the solid on the left, one after the other, or faces.

    It is the polygon or polyhedron that it is, no piece of a curve.

    Parameters
    ----------
    points : ndarray, shape (m, d)
        [length]
    facets : ndarray of int, shape (nf, k)
        Corners of faces counter-clockwise seen from outside.
    name : str

    Examples
    --------
    >>> points = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    >>> square = bare_surface(points, np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), "square")
    >>> square.facet_normals.tolist()[0]
    [0.0, -1.0]
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    >>> bare_surface(points, np.array([[0, 1, 2]]), "floor").facet_normals.tolist()
    [[0.0, 0.0, 1.0]]
    """
    dofs, count = np.arange(points.size).reshape(points.shape), len(facets)
    twins = twin_edges(facets[:, : kind_of(points.shape[1], facets.shape[1]).corners])
    given = {"mesh_facets": np.arange(count), "slopes": np.zeros((count, 2))}
    return surface_of(NoBody(points.shape[1]), name, points, dofs, facets, twins, **given)
