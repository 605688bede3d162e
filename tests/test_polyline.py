"""`RigidPolyline`: outlines as obstacles, against planes, discs, meshes and polygons in polygons."""

from __future__ import annotations

import itertools
import pickle
import tracemalloc
import warnings

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from rectangles import rectangle

import skfem_contact as sc
from skfem_contact.answers import Boundary
from skfem_contact.pairing import node_to_segment


def block(x0=-1.0, x1=1.0, y0=-1.0, y1=0.0, n=20, E=1.0, **given):
    basis = rectangle(np.linspace(x0, x1, n + 1), np.linspace(y0, y1, n // 2 + 1))
    given = {"D": "bottom", "name": "block"} | given
    return sc.Body(basis, linear_elasticity(E * 0.6, E * 0.4), **given)


def circle(n, radius=1.0, centre=(0.1, 1.0), **given):
    angle = 2 * np.pi * np.arange(n) / n + 0.3
    points = np.asarray(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return sc.RigidPolyline(points, closed=True, **{"name": "die"} | given)


def pressed(shape, steps=((0.0, -0.02), (0.004, -0.02)), n=40, **given):
    body = block(n=n)
    contact = sc.Contact(body.surface("top"), shape, **({"friction": sc.Coulomb(0.3)} | given))
    return list(sc.ContactSolver([body], [contact]).history([{"motion": {"die": v}} for v in steps]))[
        -1
    ]


def test_a_long_edge_is_a_plane():
    """A polyline of one edge gives what a plane gives, to round-off."""
    line = sc.RigidPolyline([(-3.0, -0.06), (3.0, 0.06)], name="die")
    plane = sc.RigidPlane((0, 0), (0.02, -1.0), name="die")
    assert_allclose(line.outline.facet_normals, [plane.normal], atol=1e-15)
    one, other = (pressed(shape, ((0.0, -0.02), (0.001, -0.021))) for shape in (line, plane))
    assert_allclose(one.forces, other.forces, rtol=0, atol=1e-12 * np.abs(other.forces).max())


@pytest.mark.parametrize("hollow", [False, True])
def test_polygons_of_ever_more_edges_approach_a_circle(hollow):
    """The error of chords falls with the square of the edge; the body may also be inside."""
    if not hollow:
        disc = sc.RigidCylinder((0.1, 1.0), 1.0, name="die")
        known = pressed(disc)
        errors = [np.abs(pressed(circle(n)).force - known.force).max() for n in (180, 360, 720)]
    else:
        bowl = sc.RigidCylinder((0.1, -20.0), 20.0, hollow=True, name="die")
        known = pressed(bowl, ((0.0, -0.02),))
        bowls = [circle(n, 20.0, (0.1, -20.0), hollow=True) for n in (400, 800, 1600)]
        errors = [np.abs(pressed(shape, ((0.0, -0.02),)).force - known.force).max() for shape in bowls]
    assert known.force[1] < 0
    # nodes meet edges at any place along them: the factor of four is met in the mean
    assert errors[2] < errors[0] / 8 and errors[2] < 1e-3 * abs(known.force[1])


def test_partners_are_those_on_a_mesh_with_the_same_boundary():
    """A polygon is paired as the surface of a body is, by the same search."""
    points = np.array([(1.3, 1.0), (-1.5, 1.2), (-1.2, 0.26), (-0.3, -0.02), (0.2, 0.01), (1.1, 0.4)])
    shape = sc.RigidPolyline(points[::-1], closed=True)  # either direction will do
    points = shape.outline.points  # with those at the ends of straight edges
    n, middle = len(points), points.mean(axis=0)
    fan = fem.MeshTri(
        np.vstack([points, middle]).T, np.array([(i, (i + 1) % n, n) for i in range(n)]).T
    ).with_boundaries({"all": lambda x: np.ones(x.shape[1], dtype=bool)})
    basis = fem.Basis(fan, fem.ElementVector(fem.ElementTriP1()))
    mesh = sc.Body(basis, linear_elasticity(), name="mesh").surface("all")
    top = block().surface("top")
    one, other = node_to_segment(top, shape.outline), node_to_segment(top, mesh)
    assert one.paired.sum() > 15
    assert np.array_equal(one.paired, other.paired)
    for name in ("gap", "normal", "miss"):
        assert_allclose(getattr(one, name), getattr(other, name), atol=1e-14, err_msg=name)


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("angle", [10, 27, 40])
def test_a_flat_between_chamfers_is_flat(angle, sliding):
    """Friction on it is mu times the pressure; it leant by up to half of the angle of the chamfers."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-0.5, 0.5, 5), np.linspace(0, 1, 5)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    body = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", name="block")
    low = -3 * np.tan(np.radians(angle))
    table = sc.RigidPolyline([(-6, low), (-6, -9), (6, -9), (6, low), (3, 0), (-3, 0)], closed=True)
    contact = sc.Contact(body.surface("bottom"), table, friction=sc.Coulomb(0.2), sliding=sliding)
    steps = [{"x": {"block": {"top": (way, -0.01)}}} for way in (0.0, 0.5, 1.0, 1.5, -1.5)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)  # of small sliding that does not follow
        results = list(sc.ContactSolver(body, contact).history(steps))
    for result, sign in zip(results[1:], (-1, -1, -1, 1), strict=True):
        assert_allclose(result.force, result.force[1] * np.array([0.2 * sign, 1.0]), rtol=1e-9)


def test_which_edges_are_cut():
    """Those of a curve are not, nor a straight line; flats are, beside bends that are no corners."""

    def cut(points, **given):
        outline = sc.RigidPolyline(points, **given).outline
        return len(outline.points) - len(points)

    angle = np.radians(np.arange(0, 181, 10))
    arc = np.column_stack([np.cos(angle), np.sin(angle)])
    assert circle(36).outline.points.shape == (36, 2) and cut(arc) == 0
    assert cut(arc[::-1] * (1, -1)) == cut([(2, 0), (1, 0), (0, 0)]) == 0
    assert cut([(1, 1), (0, 1), (0, 0), (1, 0)][::-1], closed=True) == 0  # corners
    assert cut([(2, -0.2), (1, 0), (0, 0), (-1, -0.2)]) == 4  # one flat between two
    # a rounded punch: its flat side turns no more than its arcs, and at its ends only
    punch = np.vstack([arc[:10] + (1, 0), arc[9:] - (1, 0)])
    outline = sc.RigidPolyline(punch, closed=True).outline
    flat = np.isclose(outline.facet_normals[:, 1], 1.0)
    level = np.isclose(outline.facet_node_normals[flat][..., 1], 1.0).all(axis=1)
    assert outline.lengths[flat][level].sum() > 0.9 * 2


def test_a_very_stiff_body_is_the_limit_also_at_its_corner():
    """A wedge that presses between two nodes: as a polyline, and as a mesh 1e8 times as stiff."""
    corners = np.array([(0.033, -0.02), (0.6, 0.5), (-0.5, 0.5)])
    body = block()
    fan = fem.MeshTri(corners.T, np.array([[0], [1], [2]])).refined(1)
    fan = fan.with_boundaries({"all": lambda x: np.ones(x.shape[1], dtype=bool)})
    basis = fem.Basis(fan, fem.ElementVector(fem.ElementTriP1()))
    stiff = sc.Body(
        basis, linear_elasticity(1e8, 1e8), D=basis.get_dofs(lambda x: x[1] > 0.4).all(), name="w"
    )
    rigid = sc.RigidPolyline(corners, closed=True, name="w")
    answers = []
    for bodies, primary in (([body, stiff], stiff.surface("all")), ([body], rigid)):
        contact = sc.Contact(body.surface("top"), primary, method="node", friction=sc.Coulomb(0.2))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sc.ContactWarning)  # of a body of four elements
            answers.append(sc.ContactSolver(bodies, [contact]).solve())
    there, here = answers
    assert here.force[1] < -1e-3
    assert_allclose(here.forces, there.forces, rtol=0, atol=1e-6 * np.abs(there.forces).max())
    # the vertex presses between its two neighbours
    u = here.displacement("block")[here.contacts[0].secondary.dofs] + here.points
    left, right = u[np.abs(here.points[:, 0]) < 1e-9][0], u[np.abs(here.points[:, 0] - 0.1) < 1e-9][0]
    at = left + (corners[0, 0] - left[0]) / (right[0] - left[0]) * (right - left)
    assert_allclose(at[1], corners[0, 1], atol=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_signed_distances_are_those_of_polygons_in_polygons(seed):
    """Against rays and brute force over random stars, from both sides and at vertices."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 40))
    radius = rng.uniform(0.3, 2.0, 40)
    points = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    shape = sc.RigidPolyline(points, closed=True, hollow=bool(seed % 2))
    x = np.vstack([rng.uniform(-2.2, 2.2, (500, 2)), points + 1e-3 * rng.normal(size=points.shape)])
    outline = Boundary(np.stack([points, np.roll(points, -1, axis=0)], axis=1), points)
    known = outline.signed(x) * (-1 if seed % 2 else 1)
    assert_allclose(shape.signed_distance(x), known, atol=1e-14)


def star(seed):
    """A random star that just touches the top of a block, as a rigid mesh and as a polyline."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(4, 12))
    turn = np.array([30.0])
    while np.any((turn > 22) & (turn < 46)):  # there only an outline has corners, and no mesh
        angle = 2 * np.pi * (np.arange(k) + rng.uniform(0.0, 0.8, k)) / k
        points = rng.uniform(0.25, 0.5, k)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        along = np.array([1, 1j]) @ (np.roll(points, -1, axis=0) - points).T
        turn = np.degrees(np.abs(np.angle(np.roll(along, -1) / along)))
    centre = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.003, -0.001) - points[:, 1].min()])
    rigid = sc.RigidPolyline(points + centre, closed=True, name="die")
    points = rigid.outline.points
    k = len(points)
    cells = np.array([(i, (i + 1) % k, k) for i in range(k)]).T
    mesh = fem.MeshTri(np.vstack([points, centre]).T, cells)
    mesh = mesh.with_boundaries({"all": lambda x: np.ones(x.shape[1], dtype=bool)})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTriP1()))
    held = sc.Body(basis, linear_elasticity(), D=np.arange(basis.N), name="die")
    return held, rigid, rng


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize(
    "seed", [0, 1, *(pytest.param(k, marks=pytest.mark.slow) for k in range(2, 16))]
)
def test_a_mesh_all_of_whose_nodes_are_led_is_a_polyline(seed, sliding):
    """Random stars pressed in and dragged: as bodies without a free DOF, and as obstacles."""
    held, rigid, rng = star(seed)
    body = block(n=int(rng.integers(12, 26)))
    ends = [(0, 0), *((rng.uniform(-0.01, 0.01), -rng.uniform(0.002, 0.015)) for _ in range(3))]
    # in short steps: which corners press is found from the step before, in rounds that begin elsewhere
    path = np.concatenate([np.linspace(a, b, 5)[1:] for a, b in itertools.pairwise(ends)])
    law = sc.Coulomb(0.3) if seed % 2 else None
    settings = {"friction": law, "sliding": sliding, "method": "node"}
    options = sc.Options(placement_tolerance=1e-11)
    answers = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)  # corners press deep into coarse meshes
        for bodies, primary in (([body, held], held.surface("all")), ([body], rigid)):
            contact = sc.Contact(body.surface("top"), primary, **settings)
            steps = [{"motion": {"die": v}} for v in path]
            if primary is not rigid:  # vertex by vertex, x and y in turn
                steps = [{"x": {"die": np.tile(v, held.n // 2)}} for v in path]
            answers.append(list(sc.ContactSolver(bodies, [contact], options=options).history(steps)))
    for there, here in zip(*answers, strict=True):
        assert there.force[1] <= 0
        assert_allclose(
            here.forces, there.forces, rtol=0, atol=1e-8 * max(np.abs(there.forces).max(), 1e-9)
        )


def test_motions_are_those_of_the_points():
    """Turned about a point and moved; the centroid goes along, and nothing is checked again."""
    shape = sc.RigidPolyline([(0, 0), (2, 0), (2, 1), (0, 1)], closed=True, name="box")
    moved = shape.moved(((1.0, 0.0), np.pi / 2, (0.0, 0.0)))
    assert_allclose(moved.points, [(1, 0), (1, 2), (0, 2), (0, 0)], atol=1e-15)
    assert_allclose(shape.reference, (1, 0.5)), assert_allclose(moved.reference, (0.5, 1))
    assert moved.closed and moved.name == "box" and not moved.points.flags.writeable
    twin = pickle.loads(pickle.dumps(moved))
    assert np.array_equal(twin.outline.points, moved.points)
    assert_allclose(sc.RigidPolyline([(0, 0), (2, 0), (2, 1)]).reference, (4 / 3, 1 / 6))


@pytest.mark.parametrize(
    ("points", "given", "words"),
    [
        ([(0, 0)], {}, "at least 2 finite points"),
        ([(0, 0), (1, 0)], {"closed": True}, "3 of a closed polyline"),
        ([(0, 0), (np.nan, 1)], {}, "not finite"),
        ([(0, 0, 0), (1, 1, 1)], {}, "points of 'rigid polyline' have shape"),
        ("square", {}, "not made of real numbers"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], {}, "1 edges of 'rigid polyline' have no length"),
        ([(0, 0), (2, 2), (2, 0), (0, 2)], {"closed": True}, "crosses itself"),
        ([(0, 0), (2, 0), (2, 1), (1, 0), (0, 1)], {}, "crosses itself"),
        ([(0, 0), (2, 0), (1, 0)], {}, "goes back on itself at point 1"),
        ([(0, 0), (2, 0)], {"hollow": True}, "an open polyline has no inside"),
        ([(0, 0), (2, 0)], {"closed": 1}, "it is a switch"),
        ([(0, 0), (2, 0)], {"name": 1}, "name of a RigidPolyline"),
    ],
)
def test_outlines_that_are_none_are_refused(points, given, words):
    """Too few points, edges without length, outlines that cross or touch themselves."""
    with pytest.raises(sc.errors.InputError, match=words):
        sc.RigidPolyline(points, **given)


def test_long_edges_beside_many_short_ones_cost_little():
    """Edges are looked at near each other, not in all pairs; one that crosses is found all the same."""
    arc = np.pi * (1 + np.arange(1000) / 999)
    points = np.vstack([np.column_stack([np.cos(arc), np.sin(arc)]), [(1, 5), (-1, 5)]])
    tracemalloc.start()
    sc.RigidPolyline(points, closed=True)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1000**2  # all pairs take tens of bytes each
    points[-1] = (0.0, -1 - 1e-9)
    with pytest.raises(sc.errors.InputError, match="crosses itself"):
        sc.RigidPolyline(points, closed=True)


def test_an_outline_that_comes_back_to_its_first_point_is_closed():
    """The first point repeated at the end closes it; the direction of a closed one is found."""
    shape = sc.RigidPolyline([(0, 0), (0, 1), (1, 0), (0, 0)])
    assert shape.closed and len(shape.points) == 3
    assert_allclose(shape.outline.facet_normals @ [1, 1], [np.sqrt(2), -1, -1], atol=1e-15)


def test_sides_and_ends_of_open_polylines():
    """The solid is on the left; the wrong way round is refused, and beyond its ends nothing is met."""
    body = block()
    right = sc.RigidPolyline([(-0.51, 0.0), (0.51, 0.0)], name="die")
    contact = sc.Contact(body.surface("top"), right)
    solver = sc.ContactSolver([body], [contact])
    assert "10 of 21 points" in str(solver) and "The farthest" not in str(solver)
    result = next(solver.history([{"motion": {"die": (0, -0.01)}}]))
    assert np.array_equal(np.isfinite(result.gap), np.abs(result.points[:, 0]) < 0.52)
    wrong = sc.RigidPolyline([(2, 0.0), (-2, 0.0)], name="die")
    with pytest.raises(sc.errors.InputError, match="None of the 21 points"):
        sc.ContactSolver([body], [sc.Contact(body.surface("top"), wrong)])
    far = sc.Contact(body.surface("top"), circle(90), reach=0.01)
    assert np.isfinite(sc.ContactSolver([body], [far]).kin.gap0).sum() < 5


def test_a_wedge_is_dragged_along_by_finite_sliding():
    """Over three facets the force of a blunt wedge ripples little, its drag is mu and its slope's."""
    body = block(-1, 2, n=90)
    blunt = sc.RigidPolyline([(-0.6, 0.3), (0.0, 0.0), (0.6, 0.3)], name="die")
    contact = sc.Contact(body.surface("top"), blunt, friction=sc.Coulomb(0.3), sliding="finite")
    steps = [(0.01, -0.004), *[(0.01 + s, -0.004) for s in np.linspace(0.02, 0.1, 5)]]
    results = list(sc.ContactSolver([body], [contact]).history([{"motion": {"die": v}} for v in steps]))
    forces = np.array([r.force_on_primary for r in results[2:]])
    assert max(r.certificate.worst for r in results) < 1e-9
    ratio = -forces[:, 0] / forces[:, 1]
    assert np.all((ratio > 0.25) & (ratio < 0.5))
    assert np.ptp(forces[:, 1]) < 0.2 * forces[:, 1].mean()


@pytest.mark.every_value
@pytest.mark.parametrize("route", ["condensed", sc.linalg.Direct()])
@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_a_die_of_edges_under_its_force_balances(route, sliding):
    """A rigid trapezium under a force beside its middle tilts until statics holds."""
    body = block(n=40)
    shape = sc.RigidPolyline([(-0.35, 0), (0.35, 0), (0.6, 0.5), (-0.6, 0.5)], closed=True, name="die")
    die = sc.RigidBody(shape, force=(0.0005, -0.01), about=(0.05, 0.4), moment=2e-4)
    contact = sc.Contact(body.surface("top"), die, friction=sc.Coulomb(0.3), sliding=sliding)
    solver = sc.ContactSolver([body, die], [contact], linear=route)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)  # edges press deep into a mesh
        result = solver.solve()
    assert_allclose(result.force, die.f[:2], atol=1e-14)
    # rows of corners act between nodes: the moment of the balance is that of their place
    assert result.certificate.worst < 1e-9 and result.certificate.moment_balance < 1e-12
    assert result.motion("die")[1] < 0


def test_a_corner_row_moves_with_the_vertex_of_a_turning_tool():
    """The row of a vertex: gap and slip change as the vertex itself moves, about any point."""
    body = block()
    shape = sc.RigidPolyline([(0.033, -0.004), (0.6, 0.5), (-0.5, 0.5)], closed=True, name="die")
    die = sc.RigidBody(shape, about=(1.3, 0.9))
    contact = sc.Contact(body.surface("top"), die, friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver([body, die], [contact])
    kin, arm = solver.kin, np.array([0.033, -0.004]) - die.about
    row = int(np.flatnonzero(kin.vertex >= 0)[0])
    columns = slice(solver.system.n - 3, None)
    scale = solver.system.extent
    n, t = kin.normal[row], kin.tangent[row, 0]
    spin = np.array([-arm[1], arm[0]]) / scale
    assert_allclose(kin.B_n[row].toarray().ravel()[columns], -np.array([*n, n @ spin]), atol=1e-12)
    assert_allclose(kin.B_t[row].toarray().ravel()[columns], -np.array([*t, t @ spin]), atol=1e-12)


def test_corners_that_press_little_are_no_reason_to_warn():
    """A wedge anywhere between two nodes: small sliding follows, and nothing is said."""
    for x in (0.033, 0.05, 0.089):
        wedge = sc.RigidPolyline([(x - 0.9, 0.9), (x, -0.0005), (x + 0.9, 0.9)], name="die")
        body = block()
        contact = sc.Contact(body.surface("top"), wedge)
        solver = sc.ContactSolver([body], [contact])
        assert (solver.kin.vertex >= 0).any()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = next(solver.history([{"motion": {"die": (0, -0.0005)}}]))
            result.report()
        assert result.force[1] < -1e-5


@pytest.mark.parametrize("n, error", [(8, sc.ContactWarning), (0, sc.errors.InputError)])
def test_points_the_wrong_way_round_are_named(n, error):
    """A groove with the solid on the right of its points: a disc, or a square, lies in the solid."""
    mesh = fem.MeshQuad.init_tensor(*[np.linspace(-1, 1, (n or 4) + 1)] * 2)
    x, y = mesh.p
    if n:
        round_ = np.array([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2)])
        mesh = fem.MeshQuad(round_, mesh.t)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    body = sc.Body(basis, linear_elasticity(1.0, 1.0), name="ring")
    groove = sc.RigidPolyline([(-1.1, 1.6), (-1.1, -1), (1.1, -1), (1.1, 1.6)], name="groove")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(error, match=r"it is solid on their left"):
            contact = sc.Contact(body.surface(lambda x: x[1] < 0.6), groove)
            sc.ContactSolver(body, contact).solve()


@pytest.mark.parametrize("turn", np.linspace(0.0, 0.7, 8))
def test_edges_at_exactly_45_degrees_are_corners(turn):
    """However the octagon is turned: round-off of its normals has no say in it."""
    angle = turn + 2 * np.pi * np.arange(8) / 8
    outline = sc.RigidPolyline(np.column_stack([np.cos(angle), np.sin(angle)]), closed=True).outline
    # every edge has its own normal at both ends
    ends = outline.points[outline.facets[:, :2]]
    along = np.diff(ends, axis=1)[:, 0]
    for k in range(2):
        across = np.einsum("fd,fd->f", along, outline.facet_node_normals[:, k])
        assert_allclose(across, 0.0, atol=1e-12)
