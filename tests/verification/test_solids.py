"""Frictionless contact of solids: closed forms, symmetry, and the same scene turned or renumbered."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import KINDS, at, cube, elastic, in_tetrahedra, octant_shell, onto_ball, shuffled

import skfem_contact as sc
from skfem_contact.errors import InputError
from skfem_contact.reference import hertz_point

every_kind = pytest.mark.parametrize("kind", KINDS)
# quadratic hexahedra take seconds: the other kinds are in the default run
some_kinds = pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=[pytest.mark.slow] * (k in ("quad8", "quad9"))) for k in KINDS]
)
ROLLERS = (at(0, 0.0), (0,)), (at(1, 0.0), (1,))


def raised(kind, n, z, name="high", **settings):
    """A unit cube whose lower side is at z."""
    mesh = cube(kind, n, lambda x: x + np.array([[0.0], [0.0], [z]]))
    return elastic(mesh, kind, name, **settings)


@every_kind
@pytest.mark.every_value
@pytest.mark.parametrize("seed", [None, 0])
def test_a_block_pressed_on_a_plane_is_under_uniform_pressure(kind, seed):
    """E d / H everywhere, to round-off: also at corners of quadratic faces, without nodal forces."""
    mesh = cube(kind, 3)
    mesh = mesh if seed is None else shuffled(mesh, seed)
    held = (*ROLLERS, (at(2, 1.0), (2,)))
    block = elastic(mesh, kind, "block", held=held, push=(at(2, 1.0), (0.0, 0.0, -0.01)))
    foot = block.surface(at(2, 0.0), name="foot")
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    result = sc.ContactSolver([block], [sc.Contact(foot, floor, name="joint")]).solve()
    values = result["joint"]
    assert result.converged and np.all(values.status != 0)
    np.testing.assert_allclose(values.pressure, 0.01, rtol=1e-10)
    np.testing.assert_allclose(
        values.traction, np.tile([0, 0, 0.01], (len(foot.points), 1)), atol=1e-12
    )
    np.testing.assert_allclose(values.force, [0, 0, 0.01], rtol=0, atol=1e-13)
    np.testing.assert_allclose(values.moment(), [0.005, -0.005, 0.0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(values.contact_area, 1.0)
    assert result.certificate.worst < 1e-12
    # consistent nodal forces on the body: those of a uniform traction, whatever sign they have
    nodal = block.K @ result.displacement("block")
    np.testing.assert_allclose(nodal[foot.dofs[:, 2]], 0.01 * foot.area, rtol=0, atol=1e-14)


@every_kind
@pytest.mark.every_value
@pytest.mark.parametrize("E", [1.0, 1e4])
def test_matching_blocks_pass_a_uniform_pressure(kind, E):
    """A loose block on another, pressed uniformly: the same pressure in the joint, both bulge alike."""
    low = elastic(cube(kind, 2), kind, "low", held=(*ROLLERS, (at(2, 0.0), (2,))))
    high = raised(kind, 2, 1.0, E=E, held=ROLLERS, press=(at(2, 2.0), (0.0, 0.0, -0.01)))
    contact = sc.Contact(high.surface(at(2, 1.0)), low.surface(at(2, 1.0)), method="node", name="joint")
    result = sc.ContactSolver([low, high], [contact]).solve()
    np.testing.assert_allclose(result["joint"].pressure, 0.01, rtol=1e-9)
    for body, modulus in ((low, 1.0), (high, E)):
        x = body.dof_points[:, 2]
        u = result.displacement(body)
        if body is low:
            expected = np.where(body.dof_component == 2, -0.01 * x, 0.3 * 0.01 * body.dof_points.T[0])
            chosen = body.dof_component != 1
            np.testing.assert_allclose(u[chosen], expected[chosen], rtol=0, atol=1e-11)
        strain = -0.01 / modulus
        side = body.surface(at(0, 1.0)).dofs[:, 0]
        np.testing.assert_allclose(u[side], -0.3 * strain, rtol=1e-8)


@pytest.mark.parametrize(
    "kinds", [("tri3", "quad4"), ("quad9", "tri6"), ("quad8", "quad4"), ("tri6", "tri3")]
)
def test_resultants_between_meshes_that_do_not_match(kinds):
    """Node-to-face contact errs in the pressure there, but the force is the load."""
    low = elastic(cube(kinds[0], 2), kinds[0], "low", held=(*ROLLERS, (at(2, 0.0), (2,))))
    press = at(2, 2.0), (0.0, 0.0, -0.01)
    high = raised(kinds[1], 3, 1.0, held=ROLLERS, press=press)
    contact = sc.Contact(high.surface(at(2, 1.0)), low.surface(at(2, 1.0)), method="node", name="joint")
    result = sc.ContactSolver([low, high], [contact]).solve()
    np.testing.assert_allclose(result["joint"].force, [0, 0, 0.01], rtol=0, atol=1e-13)
    np.testing.assert_allclose(result["joint"].pressure.mean(), 0.01, rtol=0.2)
    assert result.certificate.worst < 1e-10


def half_space(kind, n, size, h, E=1000.0, nu=0.3):
    """A quarter of a block under z = 0 whose elements grow from h at the origin."""
    q = brentq(lambda q: h * (q**n - 1) / (q - 1) - size, 1.0001, 4.0)
    t = np.concatenate([[0.0], np.cumsum(h * q ** np.arange(n))])
    linear, curved, _ = KINDS[kind]
    mesh = linear.init_tensor(t, t, size - t[::-1] - size)
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    held = (*ROLLERS, (at(2, -t[-1]), (2,)))
    return elastic(mesh, kind, "block", E=E, nu=nu, held=held)


@pytest.mark.parametrize(
    "kind, n, across",
    [
        ("quad4", 11, 5),
        pytest.param("quad4", 18, 10, marks=pytest.mark.slow),
        pytest.param("quad8", 8, 3, marks=pytest.mark.slow),
        pytest.param("quad9", 8, 3, marks=pytest.mark.slow),
        pytest.param("tri6", 9, 4, marks=pytest.mark.slow),
    ],
)
def test_hertz_sphere_on_a_half_space(kind, n, across):
    """R = 8, E = 1000, F = 60 pi (VM63): width by the second moment and peak, on coarse meshes."""
    F, R = 60 * np.pi, 8.0
    exact = hertz_point(F, R, 1000 / (1 - 0.3**2))
    assert exact.a == pytest.approx(1.0096, abs=1e-4)
    block = half_space(kind, n, 12 * exact.a, exact.a / across)
    ball = sc.RigidSphere((0, 0, R), R, name="ball")
    contact = sc.Contact(block.surface(at(2, 0.0), name="top"), ball, name="joint")
    solver = sc.ContactSolver([block], [contact])
    depth = 0.95 * exact.a**2 / R
    for _ in range(2):
        (result,) = solver.history([{"motion": {"joint": (0, 0, -depth)}}])
        found = -4 * result["joint"].force[2]
        depth *= (F / found) ** (2 / 3)
    values = result["joint"]
    np.testing.assert_allclose(found, F, rtol=2e-3)
    r = np.hypot(*values.points[:, :2].T)
    # of Hertz's pressure the mean of r² is 2/5 a²; a facet is a third to a sixth of a
    width = np.sqrt(2.5 * (values.normal_force @ r**2) / values.normal_force.sum())
    assert width == pytest.approx(exact.a, rel=0.05)
    peak = values.pressure[np.argmin(r)]
    assert peak == pytest.approx(exact.p0, rel=0.04)
    # of a quarter the rollers take what the curved sides press outward: alike along x and y
    np.testing.assert_allclose(values.force[0], values.force[1], rtol=1e-6)
    assert result.certificate.worst < 1e-9


def dome(kind, n, name="dome", turn=None, **settings):
    """A cube whose lower side bulges down towards the origin, turned with `turn`."""

    def place(x):
        y = np.stack([x[0] - 0.5, x[1] - 0.5, x[2]])
        y[2] += (1 - x[2]) * 0.15 * (y[0] ** 2 + 1.3 * y[1] ** 2 + 0.4 * y[0] * y[1])
        return y if turn is None else turn @ y

    return elastic(cube(kind, n, place), kind, name, **settings)


def slab(kind, n, turn=None, **settings):
    """A block under the dome, wider than it."""

    def place(x):
        y = np.stack([1.4 * x[0] - 0.7, 1.4 * x[1] - 0.7, 0.6 * x[2] - 0.6])
        return y if turn is None else turn @ y

    return elastic(cube(kind, n, place), kind, "slab", **settings)


def unturned(where, turn):
    return lambda x: where(np.einsum("ji,j...->i...", turn, x))


def pressed_dome(kind, turn, rigid=False, **solver):
    """The dome pressed on the slab by 0.02, all of it turned: points, pressures and displacements."""
    top, bottom = unturned(at(2, 1.0), turn), unturned(at(2, -0.6), turn)
    down = tuple(turn @ [0.01, 0.0, -0.02])
    high = dome(kind, 3, turn=turn, held=((top, (0, 1, 2)),), push=(top, down), E=3.0)
    low = slab(kind, 3, turn=turn, held=((bottom, (0, 1, 2)),))
    foot = high.surface(
        lambda x: unturned(lambda y: y[2] < 0.16 * (y[0] ** 2 + 2 * y[1] ** 2) + 0.02, turn)(x),
        nodes=True,
    )
    if rigid:
        primary = sc.RigidPlane((0, 0, 0), turn @ [0, 0, 1])
        bodies = [high]
    else:
        primary, bodies = low.surface(unturned(at(2, 0.0), turn)), [low, high]
    contact = sc.Contact(foot, primary, method="node", name="joint")
    with warnings.catch_warnings():  # faces are as large as the contact
        warnings.filterwarnings("ignore", ".*over the length of one facet", sc.ContactWarning)
        result = sc.ContactSolver(bodies, [contact], **solver).solve()
    assert result.converged and result.certificate.worst < 1e-9
    return foot, result


@some_kinds
@pytest.mark.every_value
@pytest.mark.parametrize("rigid", [False, True])
def test_bodies_turned_in_space_have_the_same_answer(kind, rigid):
    """A curved body pressed askew, turned as a whole at random: pressures, forces and displacements."""
    foot, first = pressed_dome(kind, np.eye(3), rigid=rigid)
    assert 0 < np.count_nonzero(first["joint"].status) < len(foot.points)
    turn = Rotation.random(random_state=2).as_matrix()
    _, second = pressed_dome(kind, turn, rigid=rigid)
    scale = first["joint"].pressure.max()
    np.testing.assert_allclose(second["joint"].pressure, first["joint"].pressure, atol=1e-9 * scale)
    force = first["joint"].forces
    np.testing.assert_allclose(second["joint"].forces @ turn, force, atol=1e-9 * np.abs(force).max())
    assert np.array_equal(second["joint"].status, first["joint"].status)
    # a point that closes with next to no force does so by the round-off of the smooth boundary
    assert abs(second.iterations - first.iterations) <= 1
    np.testing.assert_allclose(
        turn.T @ second["joint"].moment(), first["joint"].moment(), atol=1e-9 * np.abs(force).max()
    )


@pytest.mark.parametrize("kind", ["tri3", "quad4"])
def test_routes_agree(kind):
    """Condensed to the contact points, by a sparse direct solver and by AMG: one answer."""
    _, first = pressed_dome(kind, np.eye(3))
    scale = first["joint"].pressure.max()
    for linear in (sc.linalg.Direct(), sc.linalg.AMG()):
        for loop in ("newton", "direct", "fictitious"):
            _, other = pressed_dome(kind, np.eye(3), linear=linear, loop=loop)
            np.testing.assert_allclose(
                other["joint"].pressure, first["joint"].pressure, rtol=0, atol=1e-7 * scale
            )


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
@some_kinds
def test_a_quarter_with_rollers_is_a_quarter_of_the_whole(kind):
    """Planes of symmetry through the contact: half, and a quarter, give the pressures of the whole."""

    def body(low_x, low_y, n):
        def place(x):
            y = np.stack([low_x + (1 - low_x) * x[0], low_y + (1 - low_y) * x[1], x[2]])
            y[2] += (1 - x[2]) * 0.15 * (y[0] ** 2 + 1.5 * y[1] ** 2)
            return y

        linear, curved, _ = KINDS[kind]
        nx, ny = (2 * n if low_x < 0 else n), (2 * n if low_y < 0 else n)
        mesh = fem.MeshHex.init_tensor(*(np.linspace(0, 1, k + 1) for k in (nx, ny, 2)))
        if linear is fem.MeshTet:  # cut alike on both sides of the planes
            mesh = in_tetrahedra(mesh)
        mesh = mesh if curved is linear else curved.from_mesh(mesh)
        mesh = type(mesh)(np.ascontiguousarray(place(mesh.doflocs)), mesh.t)
        held = [(at(2, 1.0), (0, 1, 2))]
        held += [(at(0, 0.0), (0,))] if low_x == 0 else []
        held += [(at(1, 0.0), (1,))] if low_y == 0 else []
        push = at(2, 1.0), (0.0, 0.0, -0.03)
        return elastic(mesh, kind, "dome", held=tuple(held), push=push)

    found = {}
    for low_x, low_y in ((-1.0, -1.0), (0.0, -1.0), (0.0, 0.0)):
        dome_ = body(low_x, low_y, 3)
        limit = lambda x: x[2] < 0.151 * (x[0] ** 2 + 1.5 * x[1] ** 2) + 1e-3  # noqa: E731
        foot = dome_.surface(limit, nodes=True)
        floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
        result = sc.ContactSolver([dome_], [sc.Contact(foot, floor, name="joint")]).solve()
        values = result["joint"]
        keep = (foot.points[:, 0] > -1e-9) & (foot.points[:, 1] > -1e-9)
        order = np.lexsort(np.round(foot.points[keep], 7).T)
        found[low_x, low_y] = foot.points[keep][order], values.pressure[keep][order], values.force[2]
    whole = found[-1.0, -1.0]
    assert 0 < np.count_nonzero(whole[1]) < len(whole[1])
    for key, parts in (((0.0, -1.0), 2), ((0.0, 0.0), 4)):
        np.testing.assert_allclose(found[key][0], whole[0], atol=1e-12)
        np.testing.assert_allclose(found[key][1], whole[1], rtol=0, atol=1e-9 * whole[1].max())
        assert parts * found[key][2] == pytest.approx(whole[2], rel=1e-10)


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
def test_obstacles_of_all_shapes():
    """A ball in a hollow cylinder, on a level set and on a plane of the same place and curvature."""
    ball = {"held": ((lambda x: np.linalg.norm(x, axis=0) < 0.5, (0, 1, 2)),)}
    bodies = [elastic(cube("quad4", 6, onto_ball), "quad4", name, **ball) for name in "abcd"]
    hollow = sc.RigidCylinder((0, 0, 0), 1.5, axis=(0, 3, 0), hollow=True, name="tube")
    level = sc.obstacles.LevelSet(lambda x: 1.5**2 - x[0] ** 2 - x[2] ** 2, name="level")
    sphere = sc.RigidSphere((0.3, 0, 0), 1.31, hollow=True)
    results = []
    for body, obstacle in zip(bodies, (hollow, level, sphere), strict=False):
        surface = body.surface(None, name="skin")
        contact = sc.Contact(surface, obstacle, name="joint", interference=0.0)
        shift = (-0.52, 0.0, 0.0) if obstacle is not sphere else (0.0, 0.0, 0.0)
        (result,) = sc.ContactSolver([body], [contact]).history([{"motion": {"joint": shift}}])
        results.append(result["joint"])
        assert result.certificate.worst < 1e-9
    tube, level_, _ = results
    assert 0 < np.count_nonzero(tube.status) < len(tube.points)
    np.testing.assert_allclose(level_.pressure, tube.pressure, rtol=0, atol=1e-6 * tube.pressure.max())
    assert np.all(tube.force[0] < 0) and abs(tube.force[1]) < 1e-9


def test_glued_cubes_are_one_body():
    """Tied matching blocks under shear: the displacements of one block of both."""
    kind = "quad4"
    base = (at(2, 0.0), (0, 1, 2))
    pull = at(2, 2.0), (0.01, 0.02, 0.03)
    low, high = elastic(cube(kind, 3), kind, "low", held=(base,)), raised(kind, 3, 1.0, press=pull)
    glue = sc.Contact(high.surface(at(2, 1.0)), low.surface(at(2, 1.0)), method="node", tied=True)
    t = np.linspace(0, 1, 4)
    mesh = fem.MeshHex.init_tensor(t, t, np.linspace(0, 2, 7))
    whole = elastic(mesh, kind, "whole", held=(base,), press=pull)
    expected = fem.solve(*fem.condense(whole.K, whole.f, D=whole.D))
    for linear in ("condensed", sc.linalg.Direct()):
        result = sc.ContactSolver([low, high], [glue], linear=linear).solve()
        for body in (low, high):
            u = result.displacement(body)
            for i in range(body.n):
                same = np.all(np.isclose(whole.dof_points, body.dof_points[i]), axis=1)
                same &= whole.dof_component == body.dof_component[i]
                assert u[i] == pytest.approx(expected[same][0], abs=1e-11)


def test_mixed_dimensions_are_refused():
    """A solid does not meet a plane body."""
    foot = raised("quad4", 1, 1.0).surface(at(2, 1.0), name="foot")
    plane = fem.MeshQuad()
    basis = fem.Basis(plane, fem.ElementVector(fem.ElementQuad1()))
    flat = sc.Body(basis, np.eye(basis.N), name="flat").surface(None)
    with pytest.raises(InputError, match="is 3-D, surface 'flat/surface' 2-D"):
        from skfem_contact.conditions import pair

        pair(sc.Contact(foot, flat, method="node"))


@pytest.mark.parametrize("kind", ["quad4", "quad9"])
def test_error_estimates_say_what_is_missing(kind):
    """The bodies' part falls with the mesh; on second-order faces all parts have a number, too."""
    found = []
    for n in (4, 8) if kind == "quad4" else (2,):
        block = half_space(kind, n, 1.0, 0.9 / n, E=1.0)
        ball = sc.RigidSphere((0, 0, 2.0), 2.0, name="ball")
        contact = sc.Contact(block.surface(at(2, 0.0), name="top"), ball, name="joint")
        (result,) = sc.ContactSolver([block], [contact]).history([{"motion": {"joint": (0, 0, -0.1)}}])
        estimate = result.error_estimate
        assert estimate.points_across is None
        shares = estimate.elements["block"][1]
        np.testing.assert_allclose(shares.sum(), 1.0)
        found.append(estimate.traction.bodies)
        assert estimate.traction.missing == () and not estimate.unrated
        assert estimate.traction.total > estimate.traction.bodies
        np.testing.assert_allclose(estimate.indicator.sum(), 1.0)
        assert "refine block/top" in str(estimate)
    # the square of an energy error of order one: a fourth, in the end
    assert kind != "quad4" or found[1] < 0.5 * found[0]


def test_straight_faces_of_curved_sides():
    """Of second order they are not rated, and it says why; linear ones are, and curved ones."""
    for kind, bent, rated in (("quad4", True, True), ("quad9", True, True), ("quad9", False, False)):
        mesh = octant_shell(kind, 3, 2, 1.0, 2.0)
        if not bent:
            mesh = type(mesh).from_mesh(fem.MeshHex(mesh.doflocs[:, : mesh.nvertices], mesh.t))
        rollers = tuple((at(i, 0.0), (i,)) for i in range(3))
        shell = elastic(mesh, kind, "shell", held=rollers)
        facets = mesh.boundary_facets()
        inner = facets[(np.linalg.norm(mesh.p[:, mesh.facets[:, facets]], axis=0) < 1.01).all(axis=0)]
        ball = sc.RigidSphere((0, 0, 0), 1.0, name="ball")
        contact = sc.Contact(shell.surface(inner, name="inside"), ball, gap=0.0, interference=1e-3)
        result = sc.ContactSolver(shell, contact).solve()
        estimate = result.error_estimate
        assert np.isfinite(estimate.pressure.total) == rated == (not estimate.unrated)
        text = " ".join(result.report().split())
        assert ("not rated" in text and "move their middle nodes" in text) is not rated


def test_results_of_solids():
    """What is too coarse is said; moments are vectors; values are known between the nodes."""
    _, result = pressed_dome("quad4", np.eye(3))
    assert set(result.validity.problems) == {("facets", "joint")}
    assert result.validity.strain["slab"] > 0
    assert "DOES NOT HOLD (facets of 'joint')" in str(result)
    assert "Validity of the model: DOES NOT HOLD" in str(result.report())
    values = result["joint"]
    assert values.moment().shape == (3,)
    about = np.array([0.1, -0.2, 0.3])
    np.testing.assert_allclose(values.moment(about), values.moment() - np.cross(about, values.force))
    inside = values.surface.points[values.surface.facets].mean(axis=1)
    linear = values.surface.points @ [1.0, 2.0, -1.0]
    np.testing.assert_allclose(values.interpolate(linear, inside), inside @ [1.0, 2.0, -1.0], atol=1e-9)


@pytest.mark.parametrize("kind", ["tri3", "quad4", "quad9"])
def test_a_stack_cut_out_of_one_mesh_by_its_tags(kind):
    """Three blocks, subdomains of one mesh with named boundaries: E d / H in both joints."""
    linear, curved, _ = KINDS[kind]
    t = np.linspace(0, 1, 3)
    mesh = linear.init_tensor(t, t, np.linspace(0, 3, 7))
    joints = {"one": at(2, 1.0), "two": at(2, 2.0), "floor": at(2, 0.0), "roof": at(2, 3.0)}
    mesh = mesh.with_subdomains(
        {name: (lambda x, i=i: (x[2] > i) & (x[2] < i + 1)) for i, name in enumerate(("a", "b", "c"))}
    ).with_boundaries(joints, boundaries_only=False)
    bodies = []
    for name in "abc":
        part = mesh.restrict(name)
        tags = part.boundaries
        part = part if curved is linear else curved.from_mesh(part).with_boundaries(tags)
        held = list(ROLLERS)
        held += [(at(2, 0.0), (2,))] if name == "a" else []
        held += [(at(2, 3.0), (2,))] if name == "c" else []
        push = (at(2, 3.0), (0.0, 0.0, -0.03)) if name == "c" else None
        bodies.append(elastic(part, kind, name, held=tuple(held), push=push))
    a, b, c = bodies
    for first, second in (((b, a), (c, b)), ((a, b), (b, c))):
        contacts = [
            sc.Contact(one.surface(joint), other.surface(joint), method="node", name=joint)
            for joint, (one, other) in zip(("one", "two"), (first, second), strict=True)
        ]
        result = sc.ContactSolver(bodies, contacts).solve()
        for joint in ("one", "two"):
            np.testing.assert_allclose(result[joint].pressure, 0.01, rtol=1e-9)


def test_two_lips_of_one_body():
    """A block cut half through, its lips pressed together: two surfaces of one body."""
    t = np.linspace(0, 1, 5)
    low = fem.MeshHex.init_tensor(t, t[::2], t[::2])
    high = fem.MeshHex.init_tensor(t, t[::2], 1 + t[::2])
    p = np.hstack([low.p, high.p])
    number = np.arange(p.shape[1])
    for i in np.flatnonzero((p[2] == 1.0) & (p[0] <= 0.5) & (number >= low.nvertices)):
        number[i] = np.flatnonzero(np.all(p[:, [i]] == p, axis=0))[0]
    used, cells = np.unique(number[np.hstack([low.t, high.t + low.nvertices])], return_inverse=True)
    mesh = fem.MeshHex(p[:, used], cells.reshape(8, -1))
    held = (at(2, 0.0), (0, 1, 2))
    block = elastic(
        mesh, "quad4", "block", held=(held, (at(2, 2.0), (2,))), push=(at(2, 2.0), (0, 0, -0.02))
    )
    level = np.all(np.isclose(mesh.p[2, mesh.facets], 1.0), axis=0) & (
        mesh.p[0, mesh.facets].max(axis=0) > 0.5
    )
    above = mesh.p[2, mesh.t[:, mesh.f2t[0]]].mean(axis=0) > 1
    lips = [
        block.surface(np.flatnonzero(level & (above == side)), name=str(side)) for side in (True, False)
    ]
    contact = sc.Contact(*lips, method="node", name="crack")
    result = sc.ContactSolver([block], [contact]).solve()
    values = result["crack"]
    tip = np.isclose(values.points[:, 0], 0.5)
    assert np.array_equal(values.status != 0, ~tip)
    # the same block without the cut, in compression: the crack is not there
    whole = elastic(
        fem.MeshHex.init_tensor(t, t[::2], np.linspace(0, 2, 5)),
        "quad4",
        "whole",
        held=(held, (at(2, 2.0), (2,))),
        push=(at(2, 2.0), (0, 0, -0.02)),
    )
    u = fem.solve(*fem.condense(whole.K, whole.f, D=whole.D, x=whole.x))
    forces = whole.K @ u
    top = whole.surface(at(2, 2.0)).dofs[:, 2]
    reaction = (block.K @ result.displacement(block))[block.surface(at(2, 2.0)).dofs[:, 2]]
    # frictionless lips slide where one block would shear: a little softer
    assert reaction.sum() == pytest.approx(forces[top].sum(), rel=0.02)
    assert abs(reaction.sum()) <= abs(forces[top].sum()) * (1 + 1e-12)
