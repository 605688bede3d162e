"""`RigidSurface`: surfaces of triangles as obstacles, from arrays and files."""

from __future__ import annotations

import pickle
import warnings

import meshio
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from solid_meshes import KINDS

import skfem_contact as sc
from skfem_contact.bodies import bare_surface
from skfem_contact.pairing import node_to_segment

TIP = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
SIDES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]


def block(kind="quad4", n=6):
    """A block below z = 0, held at its base."""
    linear, curved, element = KINDS[kind]
    t = np.linspace(-1, 1, n + 1)
    mesh = linear.init_tensor(t, t, np.linspace(-1, 0, n // 2 + 1))
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    sides = {"top": lambda x: x[2] > -1e-9, "ground": lambda x: x[2] < -1 + 1e-9}
    basis = fem.Basis(mesh.with_boundaries(sides), fem.ElementVector(element()), intorder=4)
    return sc.Body(basis, linear_elasticity(0.6, 0.4), D="ground", name="block")


def hull(points, **given):
    """The convex hull of points, all triangles outwards."""
    found = ConvexHull(points)
    cells = found.simplices.copy()
    x = points[cells]
    up = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    inwards = np.einsum("fd,fd->f", up, found.equations[:, :3]) < 0
    cells[inwards] = cells[inwards][:, ::-1]
    return sc.RigidSurface(points, cells, **given)


def ball(n, radius=4.0, centre=(0.1, 0.05, 4.0), **given):
    """A sphere of triangles, its nodes spread by Fibonacci's spiral."""
    k = np.arange(n) + 0.5
    z, angle = 1 - 2 * k / n, np.pi * (1 + np.sqrt(5)) * k
    r = np.sqrt(1 - z**2)
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    return hull(np.asarray(centre) + radius * points, **{"name": "die"} | given)


def pressed(shape, motion, kind="quad4", **given):
    body = block(kind)
    contact = sc.Contact(body.surface("top"), shape, **given)
    return next(sc.ContactSolver([body], [contact]).history([{"motion": {"die": motion}}]))


def brute(x, points, cells):
    """Distances to all triangles, by planes, edges and corners one after the other."""
    out = np.full(len(x), np.inf)
    for a, b, c in points[cells]:
        n = np.cross(b - a, c - a)
        n /= np.linalg.norm(n)
        foot = x - ((x - a) @ n)[:, None] * n
        inside = np.ones(len(x), dtype=bool)
        for p, q in ((a, b), (b, c), (c, a)):
            inside &= np.cross(q - p, foot - p) @ n >= 0
            t = np.clip((x - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            out = np.minimum(out, np.linalg.norm(x - p - t[:, None] * (q - p), axis=1))
        out = np.where(inside, np.minimum(out, np.abs((x - a) @ n)), out)
    return out


def winding(x, points, cells):
    """How often a closed surface goes round each point: the sum of solid angles."""
    total = np.zeros(len(x))
    for corners in points[cells]:
        a, b, c = (corner - x for corner in corners)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        top = np.einsum("pd,pd->p", a, np.cross(b, c))
        dots = [np.einsum("pd,pd->p", u, v) for u, v in ((a, b), (b, c), (c, a))]
        total += 2 * np.arctan2(top, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
    return total / (4 * np.pi)


@pytest.mark.parametrize("seed", range(4))
def test_signed_distances_by_solid_angles_and_all_triangles(seed):
    """Random stars, not convex: inside is where the surface goes round once; also beside corners."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    cells = hull(directions).triangles
    sphere = hull(directions)
    radius = np.random.default_rng(seed + 9).uniform(0.5, 1.5, len(sphere.points))
    points = radius[:, None] * sphere.points
    shape = sc.RigidSurface(points, cells, hollow=bool(seed % 2))
    x = np.vstack([rng.uniform(-1.6, 1.6, (400, 3)), points + 1e-3 * rng.normal(size=points.shape)])
    inside = np.abs(winding(x, points, cells)) > 0.5
    known = np.where(inside, -1, 1) * brute(x, points, cells) * (-1 if seed % 2 else 1)
    assert inside[:400].any() and not inside[:400].all()
    assert_allclose(shape.signed_distance(x), known, atol=1e-13)


def test_one_large_triangle_is_a_plane():
    """A tilted triangle over the whole block gives what the plane through it gives."""
    n = np.array([0.02, -0.01, -1.0])
    xy = np.array([(-9.0, -9.0), (0.0, 9.0), (9.0, -9.0)])
    corners = np.column_stack([xy, 0.02 * xy[:, 0] - 0.01 * xy[:, 1]])
    flat = sc.RigidSurface(corners, [(0, 1, 2)], name="die")
    plane = sc.RigidPlane((0, 0, 0), n, name="die")
    assert not flat.closed
    motion = ((0.01, 0, -0.03), (0.001, 0.002, 0.0), (0, 0, 0))
    one, other = (pressed(shape, motion) for shape in (flat, plane))
    assert_allclose(one.forces, other.forces, rtol=0, atol=1e-12 * np.abs(other.forces).max())
    # what is measured afterwards, between the nodes and at the turned die, too
    seen, known = (result.validity.contacts["contact 1"] for result in (one, other))
    for number in ("overlap", "opening"):
        assert_allclose(getattr(seen, number), getattr(known, number), rtol=1e-9, atol=1e-12)
    assert seen.opening > 0 and "Validity" in one.report()


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")
@pytest.mark.parametrize("kind", ["quad4", "tri6"])
def test_spheres_of_ever_more_triangles_approach_one(kind):
    """The error falls as the triangles' areas do."""
    known = pressed(sc.RigidSphere((0.1, 0.05, 4.0), 4.0, name="die"), (0, 0, -0.1), kind)
    found = [pressed(ball(n), (0, 0, -0.1), kind) for n in (500, 2000, 8000)]
    errors = [np.abs(result.force - known.force).max() for result in found]
    assert errors[2] < errors[0] / 6 and errors[2] < 0.02 * abs(known.force[2])


@pytest.mark.parametrize("seed", range(3))
def test_a_mesh_all_of_whose_nodes_are_led_is_a_surface_of_triangles(seed):
    """A convex solid without a free DOF and its surface: the same partners.

    Triangles are taken as they are; the boundary of a body is the smooth one that its nodes lie on.
    """
    turned = Rotation.random(random_state=seed).as_matrix()
    surface = hull(ball(150, radius=3.0, centre=(0, 0, 0)).points @ turned)  # all of it is curved
    assert len(surface.outline.facets) == len(surface.triangles)
    lift = np.array([0.05, 0.02, -surface.points[:, 2].min() - 0.03])
    shape = sc.RigidSurface(surface.points + lift, surface.triangles, name="die")
    fan = fem.MeshTet(
        np.vstack([shape.points, lift]).T,
        np.column_stack([shape.triangles, np.full(len(shape.triangles), len(shape.points))]).T,
    ).with_boundaries({"all": lambda x: np.ones(x.shape[1], dtype=bool)})
    basis = fem.Basis(fan, fem.ElementVector(fem.ElementTetP1()))
    held = sc.Body(basis, linear_elasticity(), D=np.arange(basis.N), name="die")
    body = block(n=8)
    top = body.surface("top")
    one, other = node_to_segment(top, shape.outline), node_to_segment(top, held.surface("all"))
    assert np.array_equal(one.paired, other.paired) and one.paired.any()
    assert np.array_equal(one.facet, other.facet)
    move = (0.003, -0.002, -0.02)
    led = sc.ContactSolver([body, held], [sc.Contact(top, held.surface("all"), method="node")])
    told = sc.ContactSolver([body], [sc.Contact(top, shape)])
    with warnings.catch_warnings():
        # normals are no longer those of facets, and a ball of 60 nodes is a coarse one
        warnings.simplefilter("ignore", sc.ContactWarning)
        there = led.solve(x={"die": np.tile(move, held.n // 3)})
        here = next(told.history([{"motion": {"die": move}}]))
    assert there.force[2] < 0 and here.force[2] < 0


@pytest.mark.parametrize("binary", [True, False])
def test_files_of_triangles(tmp_path, binary):
    """STL gives the corners of each triangle anew, in single precision: they are joined."""
    known = ball(200, radius=0.7, centre=(1.0, 2.0, 3.0))
    soup = known.points[known.triangles].reshape(-1, 3)
    mesh = meshio.Mesh(soup, [("triangle", np.arange(len(soup)).reshape(-1, 3))])
    meshio.write(tmp_path / "bead.stl", mesh, file_format="stl", binary=binary)
    read = sc.RigidSurface.from_file(tmp_path / "bead.stl", scale=1e-3)
    assert read.closed and read.name == "bead" and len(read.points) == 200
    assert len(read.triangles) == len(known.triangles)
    assert_allclose(read.reference, 1e-3 * known.reference, rtol=1e-6)
    x = np.random.default_rng(0).uniform(-1, 1, (50, 3)) + (1, 2, 3)
    assert_allclose(read.signed_distance(1e-3 * x), 1e-3 * known.signed_distance(x), atol=1e-9)


def test_files_that_are_none(tmp_path):
    """Missing files, files of other things, and names that are none."""
    with pytest.raises(sc.errors.InputError, match="there is no file"):
        sc.RigidSurface.from_file(tmp_path / "none.stl")
    with pytest.raises(sc.errors.InputError, match="give the name of a file"):
        sc.RigidSurface.from_file(3)
    (tmp_path / "bad.stl").write_text("solid nothing\n facet normal of the earth\n")
    with pytest.raises(sc.errors.InputError, match=r"can not be read as a surface|has no triangles"):
        sc.RigidSurface.from_file(tmp_path / "bad.stl")
    meshio.Mesh(np.eye(3), [("line", np.array([[0, 1]]))]).write(tmp_path / "line.vtk")
    with pytest.raises(sc.errors.InputError, match="has no triangles, only line"):
        sc.RigidSurface.from_file(tmp_path / "line.vtk")
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)], dtype=float)
    cells = [("quad", np.array([[0, 1, 2, 3]])), ("triangle", np.array([[1, 4, 2]]))]
    meshio.Mesh(square, cells).write(tmp_path / "mixed.vtu")
    with pytest.raises(sc.errors.InputError, match=r"faces besides its triangles: quad, .*holes"):
        sc.RigidSurface.from_file(tmp_path / "mixed.vtu")
    meshio.Mesh(square, cells[1:]).write(tmp_path / "plain.vtu")
    for scale in (0, -1.0, np.nan):
        with pytest.raises(sc.errors.InputError, match=r"scale is .*give a finite number > 0"):
            sc.RigidSurface.from_file(tmp_path / "plain.vtu", scale=scale)


@pytest.mark.parametrize("hollow", [False, True])
def test_closed_parts_that_look_to_opposite_sides(hollow):
    """A ball beside another one, inside out: refused; inside of it, it is a cavity, which may be."""
    big, small = ball(60, radius=1.0, centre=(0, 0, 0)), ball(60, radius=0.4, centre=(0, 0, 0))
    outwards, inwards = small.triangles, small.triangles[:, ::-1]

    def both(place, triangles):
        corners = np.vstack([big.points, small.points + np.asarray(place)])
        cells = np.vstack([big.triangles, triangles + len(big.points)])
        return sc.RigidSurface(corners, cells, hollow=hollow, name="two")

    with pytest.raises(sc.errors.InputError, match=r"2 closed parts.*opposite side"):
        both((2.0, 0, 0), inwards)
    beside, cavity = both((2.0, 0, 0), outwards), both((0, 0, 0), inwards)
    inside = -1 if hollow else 1
    assert_array_equal(np.sign(beside.signed_distance([(2, 0, 0), (0, 0, 3)])), [-inside, inside])
    assert_array_equal(np.sign(cavity.signed_distance([(0, 0, 0), (0.7, 0, 0)])), [inside, -inside])


# both sides of a square, cut along either diagonal
SHEET = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
FOLDED = [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]


def test_a_foil_has_an_inside():
    """Its sheets are told apart as long as their corners are."""
    corners = [*SHEET, (0, 0, 1e-5), (1, 0, 1e-5), (1, 1, 1e-5), (0, 1, 1e-5)]
    sides = [(a, b, b + 4) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    sides += [(a, b + 4, a + 4) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    foil = sc.RigidSurface(corners, [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), *sides])
    assert_allclose(foil.reference, [0.5, 0.5, 0.5e-5], rtol=1e-9)
    assert_allclose(foil.signed_distance([(0.5, 0.4, 0.5e-5), (0.5, 0.4, 1.0)]), [-0.5e-5, 1 - 1e-5])


@pytest.mark.parametrize(
    ("points", "triangles", "given", "words"),
    [
        ([(0, 0)], [(0, 0, 0)], {}, "points of 'rigid surface' have shape"),
        ([*TIP[:3], (0, 0, np.inf)], SIDES, {}, "not finite"),
        (TIP, [(0, 1)], {}, "triangles of 'rigid surface' have shape"),
        (TIP, [(0, 1, 4)], {}, "none of its 4 points"),
        (TIP, [(0, 1, 1.5)], {}, "give numbers of points"),
        (TIP, [], {}, "triangles of 'rigid surface'"),
        (TIP, [(0, 1, 1)], {}, "1 triangles of 'rigid surface' have no area"),
        ([*TIP, (0.5, 0, 0)], [(0, 1, 4)], {}, "have no area"),
        (TIP, [*SIDES, (1, 0, 2)], {}, "1 triangles of 'rigid surface' are given twice"),
        (TIP, [*SIDES[:3], (0, 2, 3)], {}, "two triangles look to opposite sides"),
        ([*TIP, (1, 1, 1)], [*SIDES, (0, 1, 4)], {}, "edges of 'rigid surface' have more than two"),
        (SHEET, FOLDED, {}, "at .* no volume"),
        ([(x + 0.7, y, 0.3 * x + 0.1) for x, y, _ in SHEET], FOLDED, {}, "at .* no volume"),
        (TIP, SIDES[:3], {"hollow": True}, "it has a rim"),
        (TIP, SIDES, {"hollow": 1}, "it is a switch"),
        (TIP, SIDES, {"name": 1}, "name of a RigidSurface"),
    ],
)
def test_surfaces_that_are_none_are_refused(points, triangles, given, words):
    """Shapes, flat and repeated triangles, crowded edges, triangles of unlike orientation."""
    with pytest.raises(sc.errors.InputError, match=words):
        sc.RigidSurface(points, triangles, **given)


def test_closed_surfaces_are_turned_outwards():
    """Listed inwards or outwards a closed surface is the same solid; hollow, what is around it."""
    one = sc.RigidSurface(TIP, SIDES)
    other = sc.RigidSurface(TIP, np.array(SIDES)[:, ::-1])
    hole = sc.RigidSurface(TIP, SIDES, hollow=True)
    x = np.array([(0.1, 0.2, 0.3), (1, 1, 1)])
    assert_allclose(one.signed_distance(x), other.signed_distance(x))
    assert_allclose(one.signed_distance(x), -hole.signed_distance(x))
    assert_allclose(one.reference, (0.25, 0.25, 0.25)), assert_allclose(hole.reference, one.reference)
    assert_allclose(sc.RigidSurface(TIP, SIDES[:1]).reference, (1 / 3, 1 / 3, 0), atol=1e-15)
    moved = one.moved(((1.0, 0, 0), (0, 0, np.pi / 2), (0, 0, 0)))
    assert_allclose(moved.points[np.argmax(moved.points[:, 1])], (1, 1, 0), atol=1e-15)
    twin = pickle.loads(pickle.dumps(moved))
    assert np.array_equal(twin.outline.points, moved.points) and twin.closed


def test_dimensions_have_to_agree():
    """A polyline meets no solid, and triangles no plane body."""
    plane_mesh = fem.MeshQuad().with_defaults()
    plane = sc.Body(fem.Basis(plane_mesh, fem.ElementVector(fem.ElementQuad1())), linear_elasticity())
    line = sc.RigidPolyline([(0, 0), (1, 0)])
    with pytest.raises(sc.errors.InputError, match="'block/top' is 3-D, 'rigid polyline' 2-D"):
        sc.ContactSolver([body := block()], [sc.Contact(body.surface("top"), line)])
    with pytest.raises(sc.errors.InputError, match="is 2-D, 'rigid surface' 3-D"):
        contact = sc.Contact(plane.surface("top"), sc.RigidSurface(TIP, SIDES))
        sc.ContactSolver([plane], [contact])


@pytest.mark.parametrize("route", ["condensed", sc.linalg.Direct()])
def test_a_die_of_triangles_under_its_force(route):
    """A rigid slab of triangles under a force beside its middle tilts until statics holds."""
    corners = [(x, y, z) for z in (0.0, 0.4) for y in (-0.7, 0.7) for x in (-0.7, 0.7)]
    shape = hull(np.array(corners), name="die")
    about, load = (0.1, -0.05, 0.3), np.array([0.0, 0.0, -0.02])
    die = sc.RigidBody(shape, force=load, about=about, D=("x", "y", "rotation z"))
    body = block()
    solver = sc.ContactSolver([body, die], [sc.Contact(body.surface("top"), die)], linear=route)
    result = solver.solve()
    assert_allclose(result.force, load, atol=1e-15)
    assert_allclose(result.moment(about)[:2], 0.0, atol=1e-15)
    _, turn, _ = result.motion("die")
    assert turn[0] > 0 and turn[1] > 0  # down where the force is: at positive x and negative y
    assert result.certificate.worst < 1e-12


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_a_tip_between_the_nodes_is_told(sliding):
    """A pyramid that stands in a face of the block: nothing presses, and a warning says where."""
    tip = [(0.17, 0.16, 0.0), (0.5, 0.5, 1), (-0.5, 0.5, 1), (-0.5, -0.5, 1), (0.5, -0.5, 1)]
    shape = hull(np.array(tip), name="die")
    with pytest.warns(
        sc.ContactWarning, match="0.16, -0.03., where 'die' lies in the body of 'block/top'"
    ):
        result = pressed(shape, (0, 0, -0.03), sliding=sliding)
    assert result.force[2] > -1e-3
    with warnings.catch_warnings():  # a dent between nodes is no corner
        warnings.simplefilter("error")
        pressed(ball(2000), (0, 0, -0.1), sliding=sliding)


def table(angle, cuts=1, chamfer=3.0, half=3.0):
    """A flat between two chamfers, of few triangles."""
    x = np.r_[-half - chamfer, np.linspace(-half, half, cuts + 1), half + chamfer]
    z = -np.maximum(np.abs(x) - half, 0) * np.tan(np.radians(angle))
    y = np.linspace(-9, 9, cuts + 1)
    points = [(a, b, c) for a, c in zip(x, z, strict=True) for b in y]
    i, j = np.divmod(np.arange((len(x) - 1) * cuts), cuts)
    first = i * (cuts + 1) + j
    ahead, beside = first + cuts + 1, first + 1
    cells = [[first, ahead, ahead + 1], [first, ahead + 1, beside]]
    return sc.RigidSurface(points, np.concatenate([np.transpose(c) for c in cells]), name="table")


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize(("angle", "cuts"), [(5, 1), (15, 3), (40, 1)])
def test_a_flat_between_chamfers_is_flat(angle, cuts, sliding):
    """Friction on it is mu times the pressure; it leant by up to half of the angle of the chamfers."""
    t = np.linspace(-0.5, 0.5, 4)
    mesh = fem.MeshHex.init_tensor(t, t, np.linspace(0, 1, 3))
    mesh = mesh.with_boundaries({"top": lambda x: x[2] == 1, "bottom": lambda x: x[2] == 0})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    body = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", name="block")
    shape = table(angle, cuts)
    contact = sc.Contact(body.surface("bottom"), shape, friction=sc.Coulomb(0.2), sliding=sliding)
    ways = (0.0, 1.0, 1.5, -1.5) if sliding == "finite" else (0.0, 0.02, 0.04, -0.04)
    steps = [{"x": {"block": {"top": (way, 0, -0.01)}}} for way in ways]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, *results = sc.ContactSolver(body, contact).history(steps)
    for result, way in zip(results, ways[1:], strict=True):
        known = result.force[2] * np.array([-0.2 * np.sign(way), 0.0, 1.0])
        assert_allclose(result.force, known, rtol=1e-9, atol=1e-9 * result.force[2])


def test_standing_over_a_bend_leans_which_is_said():
    """Beside a bend normals turn over an eighth of a flat: what stands there is told so."""
    below = table(40)
    points = below.points * (1, 1, -1) - (2.7, 0, 0)
    shape = sc.RigidSurface(points, below.triangles[:, ::-1], name="die")
    with pytest.warns(sc.ContactWarning, match=r"normals of 'die' lean by 0\.\d+ rad in the mean"):
        pressed(shape, (0, 0, -0.01))


def revolved(r, z, n=36, digits=np.float64):
    """A surface of revolution, each strip of two triangles a side."""
    angle = 2 * np.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([np.column_stack([a * ring, np.full(n, b)]) for a, b in zip(r, z, strict=True)])
    k, i = np.divmod(np.arange((len(r) - 1) * n), n)
    a, b = k * n + i, k * n + (i + 1) % n
    cells = np.vstack([np.column_stack([a, b, b + n]), np.column_stack([a, b + n, a + n])])
    return sc.RigidSurface(points.astype(digits), cells)


def test_which_triangles_are_cut():
    """Curved surfaces are not; flats beside bends are, unless these are corners."""

    def added(shape):
        return len(shape.outline.facets) - len(shape.triangles)

    box = np.array([(x, y, z) for z in (0.0, 1) for y in (0.0, 2) for x in (0.0, 3)])
    assert added(hull(box)) == 0
    assert added(ball(300)) == added(hull(ball(900).points * (1, 1, 0.5))) == 0
    for digits in (np.float64, np.float32):
        assert added(revolved([1, 1], [0, 3], digits=digits)) == 0
        assert added(revolved([1, 0.4], [0, 3], digits=digits)) == 0
    torus = np.radians(np.arange(0, 361, 15))
    assert added(revolved(3 + np.cos(torus), np.sin(torus))) == 0
    roof = revolved([1, 1], [0, 3])  # open along two of its strips
    assert added(sc.RigidSurface(roof.points, np.delete(roof.triangles, [3, 39], axis=0))) == 0
    scattered = np.random.default_rng(1).normal(size=(1500, 3))
    assert added(hull(scattered / np.linalg.norm(scattered, axis=1)[:, None])) <= 6  # of 2996
    assert added(revolved([1, 1], [0, 3], n=12)) > 0 and added(table(10)) > 0
    # the flat top of a punch with a fillet is level but for its rim; the fillet stays as it is
    turn = np.radians(np.arange(0, 91, 9))
    punch = revolved(np.r_[4 + np.sin(turn[::-1]), 0.5], np.r_[np.cos(turn[::-1]), 1.0], n=60)
    outline = punch.outline
    flat = np.isclose(outline.facet_normals[:, 2], 1.0)
    off = np.linalg.norm(outline.facet_node_normals - outline.facet_normals[:, None], axis=2).max(
        axis=1
    )
    level = flat & (off < 1e-9)
    assert added(punch) == 4 * 60
    assert outline.facet_areas[level].sum() > 0.95 * outline.facet_areas[flat].sum()


# a box with a chamfer of 20 degrees along one edge of its top
CHAMFERED = hull(
    np.array([(x, y, z) for y in (0.0, 2.0) for x, z in [(0, 0), (4, 0), (4, 1.6), (2.9, 2), (0, 2)]])
)


@pytest.mark.parametrize(
    "shape",
    [table(20, 2), table(20, 1, chamfer=0.1), revolved([1, 1], [0, 3], n=12), CHAMFERED],
    ids=["wide", "narrow", "polygon", "closed"],
)
def test_cut_triangles_are_the_same_surface(shape):
    """Its area and its rim, no edges that do not fit together; and the same cut after a motion."""
    plain = bare_surface(shape.points, shape.triangles, "plain")
    cut = shape.outline
    assert len(cut.facets) > len(plain.facets)
    assert_allclose(cut.facet_areas.sum(), plain.facet_areas.sum(), rtol=1e-12)

    def rim(surface):
        x = surface.points[surface.facets]
        return np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=2)[surface.twins < 0].sum()

    assert_allclose(rim(cut), rim(plain), rtol=1e-12)
    moved = shape.moved(((1.0, 2.0, 3.0), (0.3, -0.2, 0.5), (0, 0, 0)))
    assert_array_equal(moved.outline.facets, cut.facets)
    turn = Rotation.from_rotvec((0.3, -0.2, 0.5)).as_matrix()
    assert_allclose(moved.outline.facet_node_normals, cut.facet_node_normals @ turn.T, atol=1e-9)


@pytest.mark.parametrize("turn", np.linspace(0.0, 0.7, 8))
@pytest.mark.parametrize("digits", [np.float64, np.float32])
def test_edges_at_exactly_45_degrees_are_sharp(turn, digits):
    """Eight sides of a prism however it is turned, also in the single precision of a file."""
    angle = turn + 2 * np.pi * np.arange(8) / 8
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.vstack([np.column_stack([ring, np.full(8, z)]) for z in (0.0, 2.0)]).astype(digits)
    i, j = np.arange(8), (np.arange(8) + 1) % 8
    cells = np.vstack([np.column_stack([i, j, j + 8]), np.column_stack([i, j + 8, i + 8])])
    outline = sc.RigidSurface(points, cells).outline
    upright = np.abs(np.diff(outline.points[outline.facets][:, [0, 1, 2, 0], 2], axis=1)) > 1
    # of each triangle one side is upright, one is the diagonal within a flat side, one at the rim
    assert_array_equal(outline.sharp_edges.sum(axis=1), np.ones(16))
    assert np.all(upright[outline.sharp_edges])
