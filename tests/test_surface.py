"""Contact surfaces: selection, orientation, normals, areas."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem

from skfem_contact import Body
from skfem_contact.bodies import KINDS
from skfem_contact.errors import InputError


def facet_shapes(xi, k):
    """Shape functions of a line and their slopes, (..., k) each."""
    N, dN = KINDS[f"line{k}"].shapes(np.asarray(xi)[..., None])
    return N, dN[..., 0]


def body(mesh, element=None, **options):
    element = element or {3: fem.ElementTriP1, 4: fem.ElementQuad1}[mesh.t.shape[0]]()
    basis = fem.Basis(mesh, fem.ElementVector(element))
    return Body(basis, sp.eye(basis.N), **options)


SQUARE = fem.MeshQuad().refined(2).with_defaults()
DISC = fem.MeshTri.init_circle(3)
DISC2 = fem.MeshTri2.init_circle(3)
ALL = [
    (SQUARE, fem.ElementQuad1()),
    (SQUARE, fem.ElementQuad2()),
    (SQUARE, fem.ElementQuadS2()),
    (fem.MeshQuad2().refined(2), fem.ElementQuad2()),
    (fem.MeshTri().refined(2), fem.ElementTriP2()),
    (DISC, fem.ElementTriP1()),
    (DISC, fem.ElementTriP2()),
    (DISC2, fem.ElementTriP2()),
    (DISC2, fem.ElementTriP1()),
]


@pytest.mark.parametrize("mesh, element", ALL)
def test_the_body_is_on_the_left_and_normals_point_out(mesh, element):
    """On a convex body every normal points away from its centre, and is square to its facet."""
    surface = body(mesh, element).surface(None)
    centre = surface.points.mean(axis=0)
    start, end = (surface.points[surface.facets[:, i]] for i in (0, 1))
    assert np.all(np.sum((0.5 * (start + end) - centre) * surface.facet_normals, axis=1) > 0)
    turned = np.stack([(end - start)[:, 1], -(end - start)[:, 0]], axis=1)
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    np.testing.assert_allclose(surface.facet_normals, turned, rtol=0, atol=1e-12)
    for normals in (surface.normals, surface.facet_node_normals):
        np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1.0, rtol=0, atol=1e-12)
    assert np.all(np.sum((surface.points - centre) * surface.normals, axis=1) > 0)


@pytest.mark.parametrize("mesh, element", ALL)
def test_facets_follow_one_another(mesh, element):
    """A closed boundary is one line: each facet starts where the last one ends."""
    surface = body(mesh, element).surface(None)
    facets, m = surface.facets, len(surface.points)
    assert np.array_equal(facets[:, 1], np.roll(facets[:, 0], -1))
    assert np.array_equal(np.unique(facets), np.arange(m))
    step = facets.shape[1] - 1
    assert np.array_equal(facets[:, 0], np.arange(0, m, step))
    count = np.arange(len(facets))
    assert np.array_equal(surface.neighbours, np.c_[np.roll(count, 1), np.roll(count, -1)])


@pytest.mark.parametrize("mesh, element", ALL)
def test_dofs_belong_to_the_points(mesh, element):
    """Interpolating the position gives the points back through the DOF numbers."""
    one = body(mesh, element)
    surface = one.surface(None)
    u = one.dof_points[np.arange(one.n), one.dof_component]
    assert np.array_equal(u[surface.dofs], surface.points)
    assert np.array_equal(one.dof_component[surface.dofs], np.tile([0, 1], (len(u[surface.dofs]), 1)))


@pytest.mark.parametrize("mesh, element", ALL[:-1])
@pytest.mark.parametrize("measure", [None, lambda x: 1 + x[0] ** 2])
def test_areas_are_loads_of_unit_pressure(mesh, element, measure):
    """The tributary areas are what scikit-fem assembles for a unit traction on the boundary."""
    one = body(mesh, element, measure=measure)
    surface = one.surface(None)
    where = mesh.boundary_facets()
    facet_basis = fem.FacetBasis(mesh, one.basis.elem, facets=where, intorder=10)
    load = fem.LinearForm(lambda v, w: v[0] * (measure(w.x) if measure else 1.0))
    expected = load.assemble(facet_basis)[surface.dofs[:, 0]]
    # a curved facet's length element is no polynomial; both quadratures are far below this
    np.testing.assert_allclose(surface.area, expected, rtol=1e-9, atol=1e-12)


def test_areas_of_curved_facets_converge_to_the_circle():
    """The perimeter of quadratic facets is 2 pi with an error of fourth order."""
    errors = [
        abs(body(fem.MeshTri2.init_circle(k), fem.ElementTriP2()).surface(None).area.sum() - 2 * np.pi)
        for k in (2, 3)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4, abs=0.1)


def test_axisymmetric_areas():
    """The top of a cylinder of radius 1 has area pi; a quadratic node on its axis has none."""
    for element in (fem.ElementQuad1(), fem.ElementQuad2()):
        top = body(SQUARE, element, measure=lambda x: 2 * np.pi * x[0]).surface("top")
        assert top.area.sum() == pytest.approx(np.pi)
    assert top.area[-1] == pytest.approx(0, abs=1e-15)
    with pytest.raises(InputError, match="measure is -1 to -1 on surface 'cylinder/top'"):
        body(SQUARE, name="cylinder", measure=lambda x: -1 + 0 * x[0]).surface("top")


def test_corners_are_not_averaged():
    """At the corner of a square facets keep their normals; on a disc they share the average."""
    square = body(SQUARE).surface(["top", "right"])
    assert square.name == "top+right"
    for side in (0, 1):
        np.testing.assert_allclose(square.facet_node_normals[:, side], square.facet_normals)
    corner = np.flatnonzero(np.all(square.points == 1, axis=1))
    np.testing.assert_allclose(square.normals[corner], [[0.5**0.5] * 2])
    disc = body(DISC).surface(None)
    shared = disc.facet_node_normals[disc.neighbours[:, 1], 0]
    np.testing.assert_allclose(disc.facet_node_normals[:, 1], shared, rtol=0, atol=1e-14)
    # equal chords: the average is the radius
    np.testing.assert_allclose(disc.normals, disc.points, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        disc.facet_node_normals[:, 0], disc.points[disc.facets[:, 0]], rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("element", [fem.ElementQuad1(), fem.ElementQuad2()])
def test_moved_surfaces_turn_their_normals(element):
    """A rotation by 90 degrees rotates points and normals, and keeps lengths, areas, numbering."""
    one = body(SQUARE, element)
    before = one.surface(["top", "right"])
    x, turn = one.dof_points, np.array([[0, -1], [1, 0]])
    u = (x @ turn.T - x)[np.arange(one.n), one.dof_component]
    after = before.moved(u)
    for key in ("points", "normals", "facet_normals", "facet_node_normals"):
        np.testing.assert_allclose(
            getattr(after, key), getattr(before, key) @ turn.T, rtol=0, atol=1e-14
        )
    np.testing.assert_allclose(after.lengths, before.lengths)
    assert after.area is before.area and after.facets is before.facets
    with pytest.raises(InputError, match=r"displacement of shape \(3,\)"):
        before.moved(np.zeros(3))


@pytest.mark.parametrize(
    "where",
    [
        "top",
        ["top"],
        {"top"},
        lambda x: x[1] > 0.999,
        lambda x: np.isclose(x[1], 1) | np.isclose(x[1], 0.5),
        SQUARE.boundaries["top"],
        [*SQUARE.boundaries["top"].tolist(), int(SQUARE.boundaries["top"][0])],
        np.isin(np.arange(SQUARE.nfacets), SQUARE.boundaries["top"]),
        SQUARE.boundaries["top"].astype(np.uint8),
    ],
)
def test_selection_in_every_form(where):
    """Names, callables (without inner facets), numbers, masks, lists select the same facets."""
    surface = body(SQUARE).surface(where)
    assert np.array_equal(np.sort(surface.mesh_facets), np.sort(SQUARE.boundaries["top"]))
    assert surface.points[:, 0].tolist() == [1.0, 0.75, 0.5, 0.25, 0.0]


@pytest.mark.parametrize(
    "mesh, element",
    [(DISC, fem.ElementTriP1()), (DISC, fem.ElementTriP2()), (DISC2, fem.ElementTriP2())],
)
def test_circles_are_selected_by_their_nodes(mesh, element):
    """Nodes lie on a circle, midpoints of chords do not: only nodes=True finds the boundary."""
    one = body(mesh, element)

    def on_circle(x):
        return np.isclose(np.hypot(x[0], x[1]), 1.0)

    assert len(one.surface(on_circle, nodes=True).facets) == len(mesh.boundary_facets())
    assert one.surface(on_circle, nodes=True).name == "on_circle"
    with pytest.raises(InputError, match=r"no facet midpoint satisfies .* try nodes=True"):
        one.surface(on_circle)


@pytest.mark.parametrize(
    "where, message",
    [
        ("topp", "boundary 'topp' not found .* did you mean 'top'"),
        (lambda x: x[1] > 2, r"no facet midpoint satisfies .* from \(0, 0\) to \(1, 1\)"),
        (lambda x: np.isclose(x[1], 0.5), "4 facets selected are inside the mesh"),
        (lambda x: x[1], "must return one bool for each position"),
        (lambda x: True, "must return one bool for each position"),
        ([10**6], "the mesh has facets 0 to 39"),
        (np.array([-1]), "facet numbers -1 to -1"),
        (np.array([0.5]), "may be a boundary name"),
        ([], "has no facets"),
    ],
)
def test_selections_of_nothing_say_why(where, message):
    """An empty or senseless selection is an error with the reason."""
    with pytest.raises(InputError, match=message):
        body(SQUARE).surface(where)


def test_two_bodies_in_one_mesh_and_lips_of_a_slit():
    """Two squares with a common line but nodes of their own give one surface for each lip."""
    lower = fem.MeshQuad().refined(1)
    upper = lower.translated((0.0, 1.0))
    p = np.hstack([lower.p, upper.p])
    mesh = fem.MeshQuad(p, np.hstack([lower.t, upper.t + lower.p.shape[1]]))
    one = body(mesh, name="slit")
    both = np.flatnonzero(np.isclose(mesh.p[1, mesh.facets], 1).all(axis=0))
    below = mesh.p[1, mesh.t].mean(axis=0)[mesh.f2t[0, both]] < 1
    lip, other = one.surface(both[below]), one.surface(both[~below])
    assert np.allclose(lip.facet_normals, [0, 1]) and np.allclose(other.facet_normals, [0, -1])
    assert not np.intersect1d(lip.dofs, other.dofs).size
    with pytest.raises(InputError, match="'slit/surface': 2 facets lie twice at the same place"):
        one.surface(both)


def test_degenerate_facets_are_named():
    """A facet without length has no normal: the error names it."""
    p = np.array([[0.0, 1.0, 0.5, 0.5], [0.0, 0.0, 1.0, 1.0]])
    mesh = fem.MeshQuad(p, np.array([[0], [1], [2], [3]]))
    with pytest.raises(InputError, match=r"1 facets have no length, .* at \(0.5, 1\)"):
        body(mesh).surface(lambda x: x[1] > 0.9)


def test_several_pieces_stay_apart():
    """Two opposite sides are two pieces, each with free ends."""
    surface = body(SQUARE).surface(["left", "right"])
    assert np.count_nonzero(surface.neighbours < 0) == 4
    assert np.abs(np.diff(surface.points[:5], axis=0)[:, 0]).max() == 0


def test_scalar_surfaces_have_one_dof_per_node_and_do_not_move():
    """A temperature has no displacement."""
    basis = fem.Basis(SQUARE, fem.ElementQuad1())
    top = Body(basis, sp.eye(basis.N)).surface("top")
    assert top.dofs.shape == (5, 1)
    with pytest.raises(InputError, match="scalar field"):
        top.moved(np.zeros(basis.N))


@pytest.mark.parametrize("k", [2, 3])
def test_shape_functions_are_a_partition_with_the_right_derivatives(k):
    """Shape functions add up to one, their derivatives to zero, and are those of the functions."""
    xi, h = np.linspace(0, 1, 7), 1e-6
    N, dN = facet_shapes(xi, k)
    np.testing.assert_allclose(N.sum(axis=1), 1.0)
    np.testing.assert_allclose(dN.sum(axis=1), 0.0, atol=1e-14)
    central = (facet_shapes(xi + h, k)[0] - facet_shapes(xi - h, k)[0]) / (2 * h)
    np.testing.assert_allclose(dN, central, rtol=0, atol=1e-9)  # round-off over the step


def sector(element=None, squeeze=0.0):
    """A quarter of a ring 1-2 with unequal facets; `squeeze` makes it a straight inclined strip."""
    t = np.linspace(0, 1, 6) ** 1.3
    flat = fem.MeshQuad.init_tensor(np.linspace(1, 2, 3), t).with_defaults()

    def place(x):
        angle = 0.5 * np.pi * x[1]
        if squeeze:
            return np.array([x[0] + squeeze * x[1], x[1]])
        return np.array([x[0] * np.cos(angle), x[0] * np.sin(angle)])

    mesh = type(flat)(place(flat.p), flat.t)
    rim = np.intersect1d(flat.boundaries["right"], np.arange(mesh.nfacets))
    basis = fem.Basis(mesh, fem.ElementVector(element or fem.ElementQuad1()))
    ends = [basis.get_dofs(flat.boundaries[k]).all(c) for k, c in (("bottom", "u^2"), ("top", "u^1"))]
    return Body(basis, sp.eye(basis.N), D=np.concatenate(ends)).surface(rim)


def test_a_curved_surface_continues_beyond_a_line_of_symmetry():
    """At rollers on both cuts of a quarter circle all nodal normals are radial, the end ones too."""
    surface = sector()
    radial = surface.points / np.linalg.norm(surface.points, axis=1, keepdims=True)
    np.testing.assert_allclose(surface.normals[[0, -1]], radial[[0, -1]], rtol=0, atol=1e-12)
    at_nodes = np.stack([radial[surface.facets[:, i]] for i in (0, 1)], axis=1)
    # in between the average is of second order, (0.3 rad)² over some ten
    np.testing.assert_allclose(surface.facet_node_normals, at_nodes, rtol=0, atol=0.01)
    np.testing.assert_allclose(surface.facet_node_normals[0, 0], at_nodes[0, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(surface.facet_node_normals[-1, 1], at_nodes[-1, 1], rtol=0, atol=1e-12)
    # moved as a whole, it still does
    moved = surface.moved(np.zeros(surface.body.n))
    np.testing.assert_array_equal(moved.facet_node_normals, surface.facet_node_normals)


def test_a_straight_inclined_surface_keeps_its_normal_at_a_roller():
    """A wedge that ends at a prescribed side is no curve: its end normals are those of the slope."""
    surface = sector(squeeze=0.1)
    normal = np.array([1.0, -0.1]) / np.hypot(1.0, 0.1)
    np.testing.assert_allclose(surface.facet_node_normals, np.broadcast_to(normal, (5, 2, 2)))
    np.testing.assert_allclose(surface.normals, np.broadcast_to(normal, (6, 2)))
