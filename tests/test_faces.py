"""Surfaces of solids: orientation, areas, normals, neighbours, selection, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from scipy.spatial.transform import Rotation
from solid_meshes import KINDS, body, cube, onto_ball, onto_octant, shuffled

import skfem_contact as sc
from skfem_contact import Body
from skfem_contact.bodies import KINDS as FACETS
from skfem_contact.bodies import tangents
from skfem_contact.errors import InputError

every_kind = pytest.mark.parametrize("kind", KINDS)


def warped(x):
    """A smooth map of the cube that bends all of its faces and edges."""
    return x + 0.08 * np.sin(2.0 * x[[1, 2, 0]] + 1.0) * np.cos(1.5 * x[[2, 0, 1]])


@pytest.mark.parametrize("name", FACETS)
def test_shape_functions_belong_to_their_nodes(name):
    """One at their own node and zero at the others; they add up to one; derivatives by differences."""
    kind = FACETS[name]
    N, _ = kind.shapes(kind.locations)
    np.testing.assert_allclose(N, np.eye(kind.nodes), rtol=0, atol=1e-14)
    xi = 0.4 * np.random.default_rng(1).random((2, 5, kind.dim))
    N, dN = kind.shapes(xi)
    assert N.shape == (2, 5, kind.nodes) and dN.shape == (2, 5, kind.nodes, kind.dim)
    np.testing.assert_allclose(N.sum(axis=-1), 1.0)
    for j, h in enumerate(1e-6 * np.eye(kind.dim)):
        central = (kind.shapes(xi + h)[0] - kind.shapes(xi - h)[0]) / 2e-6
        np.testing.assert_allclose(dN[..., j], central, rtol=0, atol=1e-9)  # round-off over the step


@every_kind
@pytest.mark.every_value
@pytest.mark.parametrize("seed", [None, 0, 1])
def test_faces_look_outward_however_the_mesh_is_numbered(kind, seed):
    """On a convex body turned at random all normals, and the sense of all corners, point out."""
    turn = Rotation.random(random_state=3).as_matrix()
    mesh = cube(kind, 2)
    mesh = mesh if seed is None else shuffled(mesh, seed)
    mesh = type(mesh)(turn @ (mesh.doflocs - 0.5), mesh.t)
    surface = body(mesh, kind).surface(None)
    assert surface.kind.name == kind and surface.facets.shape[1] == surface.kind.nodes
    corners = surface.points[surface.facets[:, : surface.kind.corners]]
    middle = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    np.testing.assert_allclose(np.abs(middle @ turn).max(axis=1), 0.5)
    np.testing.assert_allclose(surface.facet_normals, normal, rtol=0, atol=1e-12)
    # the normal is that of the side of the cube on which the face lies
    own = (np.abs(np.abs(middle @ turn) - 0.5) < 1e-9) * np.sign(middle @ turn)
    np.testing.assert_allclose(normal @ turn, own, rtol=0, atol=1e-12)
    # nothing is averaged over the edges of the cube
    np.testing.assert_allclose(
        surface.facet_node_normals,
        np.broadcast_to(normal[:, None], surface.own_normals.shape),
        atol=1e-12,
    )


@every_kind
def test_nodes_stand_where_the_shape_functions_have_them(kind):
    """On straight faces every node is where its reference coordinates are."""
    surface = body(shuffled(cube(kind, 2)), kind).surface(None)
    c = surface.kind.corners
    linear = FACETS["tri3" if c == 3 else "quad4"]
    N, _ = linear.shapes(surface.kind.locations)
    expected = np.einsum("qk,fkd->fqd", N, surface.points[surface.facets[:, :c]])
    np.testing.assert_allclose(surface.points[surface.facets], expected, rtol=0, atol=1e-14)


@every_kind
def test_dofs_belong_to_the_points(kind):
    """Interpolating the position gives the points back through the DOF numbers; scalars have one."""
    one = body(
        shuffled(cube(kind, 2, warped)) if kind in ("tri3", "quad4") else cube(kind, 2, warped), kind
    )
    surface = one.surface(None)
    u = one.dof_points[np.arange(one.n), one.dof_component]
    assert np.array_equal(u[surface.dofs], surface.points)
    basis = fem.Basis(one.basis.mesh, KINDS[kind][2](), intorder=2)
    field = Body(basis, sp.eye(basis.N)).surface(None)
    assert field.dofs.shape == (len(surface.points), 1)
    assert np.array_equal(field.points, surface.points)
    assert not field.held.any()
    with pytest.raises(InputError, match="scalar field"):
        field.moved(np.zeros(basis.N))


@every_kind
@pytest.mark.parametrize("measure", [None, lambda x: 1 + x[0] ** 2])
def test_areas_are_loads_of_unit_pressure(kind, measure):
    """The tributary areas are what scikit-fem assembles for a unit flux on curved boundaries."""
    one = body(cube(kind, 2, warped), kind, measure=measure)
    surface = one.surface(None)
    where = one.basis.mesh.boundary_facets()
    element = KINDS[kind][2]()
    facet_basis = fem.FacetBasis(one.basis.mesh, element, facets=where, intorder=12)
    load = fem.LinearForm(lambda v, w: v * (measure(w.x) if measure else 1.0))
    expected = load.assemble(facet_basis)
    scalar = fem.Basis(one.basis.mesh, element, intorder=2)
    found = Body(scalar, sp.eye(scalar.N), measure=measure).surface(None)
    assert np.array_equal(found.points, surface.points)
    # area elements of bent faces are no polynomials; both rules are far below the faces' own error
    scale = expected.max()
    np.testing.assert_allclose(found.area, expected[found.dofs[:, 0]], rtol=0, atol=3e-5 * scale)
    np.testing.assert_allclose(surface.area.sum(), expected.sum(), rtol=1e-6)
    assert np.array_equal(found.area, surface.area)
    if measure is None:
        np.testing.assert_allclose(surface.facet_areas.sum(), surface.area.sum())
        np.testing.assert_allclose(surface.lengths**2, surface.facet_areas)


@every_kind
def test_areas_of_a_cube(kind):
    """Each side of the unit cube has area one; corners of 8-node faces carry -1/12 of a face each."""
    surface = body(cube(kind, 2), kind).surface(lambda x: x[2] == 1.0, name="top")
    assert surface.area.sum() == pytest.approx(1.0, rel=1e-14)
    share = {"tri3": 1 / 3, "tri6": 0.0, "quad4": 1 / 4, "quad8": -1 / 12, "quad9": 1 / 36}[kind]
    corner = np.flatnonzero(np.isclose(surface.points[:, :2].sum(axis=1), 0.0))
    faces = np.count_nonzero(surface.facets == corner[0])
    area = surface.facet_areas[0]
    np.testing.assert_allclose(surface.area[corner], share * area * faces, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    "kind, order", [("tri3", 2), ("tri6", 4), ("quad4", 2), ("quad8", 4), ("quad9", 4)]
)
def test_areas_of_spheres_converge(kind, order):
    """The area of the unit sphere is 4 pi, by order 2 of flat faces and 4 of curved ones."""
    sizes = (4, 8) if order == 2 else (2, 4)
    errors = [
        abs(body(cube(kind, n, onto_ball), kind).surface(None).area.sum() - 4 * np.pi) for n in sizes
    ]
    assert np.log2(errors[0] / errors[1]) > order - 0.5  # the map bends less on finer meshes
    assert errors[1] < 0.02 * 4 * np.pi


@pytest.mark.parametrize("kind", ["tri3", "quad4"])
@pytest.mark.parametrize("n", [2, 5])
def test_normals_on_a_sphere_are_exact_for_flat_faces(kind, n):
    """All faces round a vertex have theirs on one sphere: the weighted mean is the radius, always."""
    rng = np.random.default_rng(n)
    mesh = cube(kind, n, onto_ball)
    p = mesh.p + 0.1 / n * rng.standard_normal(mesh.p.shape)  # nodes anywhere, but on the sphere
    rim = mesh.boundary_nodes()
    p[:, rim] /= np.linalg.norm(p[:, rim], axis=0)
    p[:, mesh.interior_nodes()] = mesh.p[:, mesh.interior_nodes()]
    surface = body(type(mesh)(p, mesh.t), kind).surface(None)
    np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1), 1.0)
    smooth = n > 2  # on few faces edges bend by more than 45 degrees
    if smooth:
        np.testing.assert_allclose(surface.normals, surface.points, rtol=0, atol=1e-12)
        at = surface.points[surface.facets]
        np.testing.assert_allclose(surface.facet_node_normals, at, rtol=0, atol=1e-12)
    else:
        assert np.abs(surface.facet_node_normals - surface.points[surface.facets]).max() > 0.1


def tube(kind, n):
    """A quarter of a tube between the radii 1 and 2, of height 1, with unequal facets."""

    def place(x):
        angle, radius = 0.5 * np.pi * x[0] ** 1.2, 1 + x[1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), x[2]])

    linear, curved, _ = KINDS[kind]
    t = np.linspace(0, 1, n + 1)
    mesh = linear.init_tensor(t, np.linspace(0, 1, 3), np.linspace(0, 1, n // 2 + 1))
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    return type(mesh)(place(mesh.doflocs), mesh.t)


def outer(x):
    return np.hypot(x[0], x[1]) > 1.999


@every_kind
def test_normals_on_a_cylinder_are_of_second_order_at_least(kind):
    """Averaged normals on a tube of unequal faces, away from its ends, and those at its edges."""
    errors = []
    for n in (8, 16):
        surface = body(tube(kind, n), kind).surface(outer, nodes=True)
        radial = surface.points * [1.0, 1.0, 0.0]
        radial /= np.linalg.norm(radial, axis=1, keepdims=True)
        angle = np.arctan2(surface.points[:, 1], surface.points[:, 0])
        inner = (angle > 0.3) & (angle < 1.2)
        assert inner.any()
        errors.append(np.abs(surface.normals - radial)[inner].max())
        assert np.abs(surface.normals - radial).max() < (0.12 if errors[1:] == [] else 0.06)
    # flat faces of a tube are exact, as the facets of a circle are
    assert errors[1] < 1e-14 or np.log2(errors[0] / errors[1]) > 1.7
    assert errors[1] < 2e-3


def test_curves_that_are_meshed_unevenly_have_no_kinks():
    """Here one edge on a cylinder turns and the opposite one happens not to: no line of kinks."""
    angle, z = np.linspace(0, 1.2, 9), np.linspace(0, 1, 6)
    mesh = fem.MeshHex.init_tensor(np.array([0.8, 1.0]), angle, z)
    p = mesh.p.copy()
    inner = np.all((p[1:] > 1e-9) & (p[1:] < [[1.2 - 1e-9], [1 - 1e-9]]), axis=0)
    p[1:, inner] += np.random.default_rng(1).uniform(-0.2, 0.2, (2, inner.sum())) * [[0.15], [0.2]]
    x = np.stack([p[0] * np.cos(p[1]), p[0] * np.sin(p[1]), p[2]])
    shell = body(fem.MeshHex(x, mesh.t), "quad4").surface(lambda x: np.hypot(x[0], x[1]) > 0.95)
    assert not shell.kinks.any()


@every_kind
def test_a_curved_surface_continues_beyond_planes_of_symmetry(kind):
    """On an eighth of a ball with rollers on its three cuts all normals are as those of the ball."""
    n = 4
    mesh = cube(kind, n, onto_octant)
    basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=2)
    D = np.unique(
        np.concatenate(
            [
                dofs[np.abs(basis.doflocs[i, dofs]) < 1e-9]
                for i in range(3)
                for dofs in [np.concatenate([basis.split_indices()[i]])]
            ]
        )
    )
    octant = Body(basis, sp.eye(basis.N), D=D).surface(
        lambda x: np.linalg.norm(x, axis=0) > 0.999, nodes=True
    )
    np.testing.assert_allclose(octant.area.sum(), np.pi / 2, rtol=0.02)
    at = octant.points[octant.facets]
    on_plane = np.abs(at) < 1e-9
    assert on_plane.any()
    # components that a mirror image takes away are gone
    np.testing.assert_allclose(octant.facet_node_normals[on_plane], 0.0, atol=1e-14)
    limit = 1e-12 if kind in ("tri3", "quad4") else 0.02
    assert np.abs(octant.facet_node_normals - at).max() < limit
    assert np.abs(octant.normals - octant.points).max() < limit
    # without supports the rim keeps what its own faces have
    free = body(mesh, kind).surface(lambda x: np.linalg.norm(x, axis=0) > 0.999, nodes=True)
    assert np.abs(free.facet_node_normals[on_plane]).max() > (0.05 if limit < 1e-9 else 1e-4)
    moved = octant.moved(np.zeros(basis.N))
    np.testing.assert_array_equal(moved.facet_node_normals, octant.facet_node_normals)


@every_kind
def test_a_plane_inclined_surface_keeps_its_normal_at_a_roller(kind):
    """A wedge that ends at a prescribed side is no curve: its end normals are those of the slope."""
    mesh = cube(kind, 3, lambda x: np.stack([x[0], x[1], x[2] * (1 + 0.3 * x[0])]))
    basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=2)
    left = basis.split_indices()[0]
    D = left[np.abs(basis.doflocs[0, left]) < 1e-9]
    top = Body(basis, sp.eye(basis.N), D=D).surface(lambda x: x[2] > 1 + 0.3 * x[0] - 1e-9, nodes=True)
    assert top.held.any()
    slope = np.array([-0.3, 0.0, 1.0]) / np.hypot(1.0, 0.3)
    np.testing.assert_allclose(top.normals, np.broadcast_to(slope, top.normals.shape), atol=1e-12)
    shape = top.facet_node_normals.shape
    np.testing.assert_allclose(top.facet_node_normals, np.broadcast_to(slope, shape), atol=1e-12)


@every_kind
def test_neighbours_share_edges(kind):
    """A closed boundary has no ends; faces across an edge name each other and share its nodes."""
    closed = body(shuffled(cube(kind, 2)), kind).surface(None)
    assert np.all(closed.neighbours >= 0)
    flat = closed.twins.ravel()
    assert np.array_equal(flat[flat], np.arange(len(flat)))
    edges = closed.facets[:, closed.kind.edges].reshape(len(flat), -1)
    assert np.array_equal(edges[flat][:, [1, 0, *range(2, edges.shape[1])]], edges)
    side = body(cube(kind, 2), kind).surface(lambda x: x[0] == 0.0)
    assert np.count_nonzero(side.neighbours < 0) == 8
    assert np.all(side.neighbours[side.neighbours >= 0] < len(side.facets))


def test_bodies_that_touch_along_an_edge_are_two_surfaces():
    """Two cubes of one mesh with a common edge: across it each face has the other of its own cube."""
    mesh = fem.MeshHex.init_tensor(*[np.linspace(0, 1, 3)] * 3)
    keep = np.flatnonzero((mesh.p[:, mesh.t].mean(axis=1)[:2] < 0.5).sum(axis=0) != 1)
    surface = body(mesh.restrict(keep), "quad4").surface(None)
    centre = surface.points[surface.facets].mean(axis=1)
    mine = centre[:, 0] + centre[:, 1] < 1.0
    assert np.array_equal(mine[surface.neighbours], np.broadcast_to(mine[:, None], (len(mine), 4)))


@every_kind
def test_nodes_selects_by_all_nodes(kind):
    """On a ball no midpoint of a face is on the sphere, but all nodes are, middle ones included."""
    mesh = cube({"quad8": "quad9"}.get(kind, kind), 2, onto_ball)
    ball = body(mesh, kind)
    on_sphere = lambda x: np.abs(np.linalg.norm(x, axis=0) - 1) < 1e-9  # noqa: E731
    assert len(ball.surface(on_sphere, nodes=True).facets) == len(mesh.boundary_facets())
    with pytest.raises(InputError, match="try nodes=True"):
        ball.surface(on_sphere)
    if kind not in ("tri3", "quad4"):
        p = mesh.doflocs.copy()
        p[:, mesh.dofs.edge_dofs[0, mesh.boundary_edges()[0]]] *= 0.9
        fewer = body(type(mesh)(p, mesh.t), kind).surface(on_sphere, nodes=True)
        assert len(fewer.facets) == len(mesh.boundary_facets()) - 2


@every_kind
def test_tags_of_a_mesh_with_subdomains(kind):
    """Boundaries and subdomains named in one mesh are found again on the part that is a body."""
    linear, curved, _ = KINDS[kind]
    mesh = linear.init_tensor(*[np.linspace(0, 1, 5)] * 3)
    mesh = mesh.with_subdomains({"low": lambda x: x[2] < 0.5, "high": lambda x: x[2] > 0.5})
    mesh = mesh.with_boundaries({"roof": lambda x: x[2] == 1.0, "joint": lambda x: x[0] == 0.0})

    def part(name):
        """scikit-fem restricts linear meshes only, and drops the tags where it adds nodes."""
        one = mesh.restrict(name)
        tags = one.boundaries
        return (one if curved is linear else curved.from_mesh(one)).with_boundaries(tags)

    high = body(part("high"), kind, name="high")
    roof = high.surface("roof")
    assert roof.label == "high/roof"
    np.testing.assert_allclose(roof.points[:, 2], 1.0)
    assert roof.area.sum() == pytest.approx(1.0)
    joint = high.surface("joint")
    np.testing.assert_allclose(joint.facet_normals, np.tile([-1.0, 0, 0], (len(joint.facets), 1)))
    assert joint.area.sum() == pytest.approx(0.5)
    both = high.surface(["roof", "joint"])
    assert both.name == "roof+joint" and both.area.sum() == pytest.approx(1.5)
    low = body(part("low"), kind, name="low")
    # tags are written for the mesh as it was: of the part without the roof nothing is left
    with pytest.raises(InputError, match="low/roof"):
        low.surface("roof")


@every_kind
def test_surfaces_move_with_the_body(kind):
    """Turned by a displacement the surface has the turned points and normals, areas stay."""
    one = body(cube(kind, 2, warped), kind)
    surface = one.surface(None)
    turn = Rotation.from_rotvec([0.3, -0.5, 0.7]).as_matrix()
    u = (one.dof_points @ (turn - np.eye(3)).T)[np.arange(one.n), one.dof_component]
    moved = surface.moved(u)
    np.testing.assert_allclose(moved.points, surface.points @ turn.T, rtol=0, atol=1e-9)
    for name in ("normals", "facet_normals", "facet_node_normals", "own_normals"):
        np.testing.assert_allclose(getattr(moved, name), getattr(surface, name) @ turn.T, atol=1e-8)
    np.testing.assert_allclose(moved.lengths, surface.lengths, rtol=1e-8)
    assert np.array_equal(moved.area, surface.area)


def test_degenerate_faces_are_named():
    """Faces without area, faces that fold over, and both lips of a crack are refused in words."""
    mesh = cube("quad4", 1)
    p = mesh.p.copy()
    p[:, mesh.t[7]] = p[:, mesh.t[4]]
    with pytest.raises(
        InputError, match=r"cube/surface': \d faces have no area, the first is mesh facet"
    ):
        body(fem.MeshHex(p, mesh.t), "quad4", name="cube").surface(None)
    p = mesh.p.copy()
    p[:, mesh.t[7]] = [[1.0], [0.2], [0.2]]
    with pytest.raises(InputError, match="faces fold over"):
        body(fem.MeshHex(p, mesh.t), "quad4").surface(None)
    one = fem.MeshHex.init_tensor([0, 1], [0, 1], [0, 1])
    two = fem.MeshHex(np.hstack([one.p, one.p + [[1.0], [0], [0]]]), np.hstack([one.t, one.t + 8]))
    with pytest.raises(InputError, match="1 faces lie twice at the same place"):
        body(two, "quad4").surface(lambda x: x[0] == 1.0)


def test_tangents_are_a_right_handed_frame():
    """Unit tangents across the normal and each other; normal, first, second are right-handed."""
    rng = np.random.default_rng(0)
    normal = np.vstack([rng.standard_normal((20, 3)), np.eye(3), -np.eye(3), [[1, 1, 1]]])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    frame = np.concatenate([normal[:, None], tangents(normal)], axis=1)
    np.testing.assert_allclose(
        frame @ np.swapaxes(frame, 1, 2), np.tile(np.eye(3), (27, 1, 1)), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(frame), 1.0)


def test_serendipity_bodies_and_measures():
    """20-node bricks are bodies; a measure proportional to x makes no solid axisymmetric."""
    one = body(cube("quad8"), "quad8", measure=lambda x: 2 * np.pi * x[0])
    assert not one.axisymmetric and one.rigid_modes.shape == (one.n, 6)
    assert sc.bodies.stack([one]).n == one.n
