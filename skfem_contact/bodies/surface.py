"""`ContactSurface`: nodes, DOFs, facets, normals and tributary areas of one boundary."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from skfem_contact.arguments import check_name, numbers
from skfem_contact.bodies.facets import check_facets, facet_neighbours, order_along, oriented
from skfem_contact.bodies.normals import (
    end_slopes,
    kink_angles,
    lengths_and_normals,
    normals_at,
    tributary_areas,
)
from skfem_contact.bodies.selection import name_of, select_facets
from skfem_contact.errors import InputError
from skfem_contact.sealed import seal

if TYPE_CHECKING:
    from skfem_contact.bodies.body import Body


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """One boundary of a body as contact sees it.

    Facets are listed along the surface with the body on their left, and the nodes in the order in
    which the facets meet them; so a plot over the nodes of one piece is a line.

    Attributes
    ----------
    body : Body
    name : str
    points : ndarray, shape (m, d)
        Positions of the surface nodes [length].
    dofs : ndarray of int, shape (m, c)
        DOF (of the body) of each component at each node; ``c = d``, or 1 for a scalar field.
    facets : ndarray of int, shape (nf, k)
        Numbers of points: (start, end) of linear facets, (start, end, middle) of quadratic ones.
    facet_normals : ndarray, shape (nf, d)
        Outward unit normals, at the middle of a curved facet.
    normals : ndarray, shape (m, d)
        Outward unit normals at the nodes: average over the adjacent facets, the shorter counting
        more (weights 1/length). At a
        corner this is the direction between the two sides, good to tell which way the node looks;
        the normals to constrain along are `facet_node_normals`.
    facet_node_normals : ndarray, shape (nf, 2, d)
        Outward unit normals at start and end of each facet: averaged with the neighbour, but the
        facet's own where the surface turns by more than 45 degrees, or ends. A curved surface that
        ends on a line of symmetry (one component of its last node is prescribed) is averaged with
        its mirror image.
    area : ndarray, shape (m,)
        Tributary areas: integrals of the shape functions times the `measure` of the body. They add
        up to the area of the surface. (The end of a quadratic facet on the axis of symmetry has
        area zero.)
    lengths : ndarray, shape (nf,)
        Lengths of the facets [length].
    mesh_facets : ndarray of int, shape (nf,)
        Facet numbers in the mesh.
    slopes : ndarray, shape (nf, 2)
        Slopes of the smooth boundary against the chord at start and end of each linear facet of a
        curve, of the undeformed body (`smooth.end_slopes`); zero elsewhere.
    end_turns : ndarray, shape (nf, 2)
        Where the surface ends before or after a facet: by how much the boundary of the body turns
        there, > 0 at a convex corner [rad]; 0 elsewhere. From the undeformed mesh.
    kinks : ndarray, shape (m,)
        Angle by which the undeformed surface turns at a node beside a straight part; 0 elsewhere, so
        on curves [rad].

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
    slopes: np.ndarray
    end_turns: np.ndarray
    kinks: np.ndarray

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
    def quadratic(self) -> bool:
        """Whether facets have a middle node."""
        return self.facets.shape[1] == 3

    @cached_property
    def neighbours(self) -> np.ndarray:
        """Facets before and after each facet, shape (nf, 2); -1 where the surface ends."""
        return facet_neighbours(self.facets)

    @cached_property
    def held(self) -> np.ndarray:
        """Which components of each node are prescribed, shape (m, d)."""
        return _held(self.body, self.dofs)

    @cached_property
    def end_normals(self) -> np.ndarray:
        """The facets' own outward unit normals at start and end, (nf, 2, d), not averaged."""
        return normals_at(self.points, self.facets, np.array([0.0, 1.0]))[0]

    def moved(self, u: np.ndarray) -> ContactSurface:
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
        return replace(
            self, points=points, **lengths_and_normals(points, self.facets, self.held, self.neighbours)
        )


def extract_surface(
    body: Body, where: Any, nodes: bool = False, name: str | None = None
) -> ContactSurface:
    """Take a surface out of the mesh of a body; the function behind `Body.surface`."""
    basis, mesh = body.basis, body.basis.mesh
    if body.dim != 2:
        raise InputError(f"surfaces of {body.dim}-D bodies are not implemented yet; only 2-D")
    check_name(name, "name of a surface")
    name = name or name_of(where)
    label = f"{body.name}/{name}" if body.name else name
    numbers = select_facets(mesh, where, nodes, label)
    numbers, facets_v = oriented(mesh, numbers)
    order = order_along(facets_v)
    numbers, facets_v = numbers[order], facets_v[order]

    # a node is known by its vertex number, or behind those by the number of its facet
    quadratic = basis.facet_dofs.size > 0
    start, end = facets_v.T
    columns = [start, mesh.nvertices + numbers, end] if quadratic else [start, end]
    ids = np.column_stack(columns)
    unique, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
    met = np.argsort(first)
    rank = np.empty_like(met)
    rank[met] = np.arange(len(met))
    facets = rank[inverse.reshape(ids.shape)]
    if quadratic:
        facets = facets[:, [0, 2, 1]]
    unique = unique[met]
    vertex = unique < mesh.nvertices
    dofs = np.empty((len(unique), body.components), dtype=np.int32)
    dofs[vertex] = basis.nodal_dofs[:, unique[vertex]].T
    if quadratic:
        dofs[~vertex] = basis.facet_dofs[:, unique[~vertex] - mesh.nvertices].T

    points = np.ascontiguousarray(basis.doflocs[:, dofs[:, 0]].T)
    check_facets(points, facets, numbers, mesh, label)
    normals = lengths_and_normals(points, facets, _held(body, dofs), facet_neighbours(facets))
    surface = ContactSurface(
        body=body,
        name=name,
        points=points,
        dofs=dofs,
        facets=facets,
        area=tributary_areas(points, facets, body.measure, label),
        mesh_facets=numbers,
        slopes=end_slopes(points, facets, normals["facet_node_normals"]),
        end_turns=_end_turns(basis, points, facets, facets_v),
        kinks=kink_angles(points, facets, facet_neighbours(facets)),
        **normals,
    )
    seal(surface)
    return surface


def _end_turns(basis: Any, points: np.ndarray, facets: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """By how much the boundary of the mesh turns at the ends of a surface, (nf, 2) [rad]."""
    turns = np.zeros(vertices.shape)
    ends = np.argwhere(facet_neighbours(facets) < 0)
    if not len(ends):
        return turns
    mesh = basis.mesh
    numbers, all_ends = oriented(mesh, mesh.boundary_facets())
    nodes = np.transpose(mesh.p[:, all_ends], (1, 2, 0))
    if basis.facet_dofs.size > 0:
        middle = basis.doflocs[:, basis.facet_dofs[0, numbers]].T
        nodes = np.concatenate([nodes, middle[:, None]], axis=1)
    there = normals_at(
        nodes.reshape(-1, nodes.shape[2]),
        np.arange(nodes[..., 0].size).reshape(nodes.shape[:2]),
        np.array([0.0, 1.0]),
    )[0]
    own = normals_at(points, facets, np.array([0.0, 1.0]))[0]
    for facet, side in ends:
        # the facet that begins where this one ends, or ends where it begins; corners that touch
        # have several
        onward = np.flatnonzero(all_ends[:, 1 - side] == vertices[facet, side])
        if len(onward) != 1:
            continue
        first, second = own[facet, side], there[onward[0], 1 - side]
        if side == 0:
            first, second = second, first
        turn = np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second)
        # two lips of a slit are back to back: its tip is no corner that could touch anything
        turns[facet, side] = turn if turn < np.pi - 1e-6 else -turn
    return turns


def _held(body: Body, dofs: np.ndarray) -> np.ndarray:
    """Prescribed components, (m, d); a scalar field has no directions to hold."""
    held = np.isin(dofs, body.D)
    return held if dofs.shape[1] == body.dim else np.zeros((len(dofs), body.dim), dtype=bool)
