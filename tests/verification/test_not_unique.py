"""Contact forces that are not unique: the same whatever the order, and symmetric where the scene is.

Where rows depend on each other the forces are those of least friction, and of these the ones of least
pressure norm, which the result says.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.loops import least_friction

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import judge_mirror as judge

LAW = linear_elasticity(*lame_parameters(1000.0, 0.3))
SEEDS = range(24)


@pytest.mark.parametrize("seed", SEEDS)
def test_random_scenes_are_their_own_mirror_image(seed):
    """Tools prescribed on their surface, channels, foundations: mirrored, renumbered, reordered."""
    s = judge.scene(seed)
    apart, result, _ = judge.differences(s)
    assert max(apart.values()) < s.tolerance, apart
    assert result.certificate.worst < 1e-9


def solid_tool(n, fineness, mu):
    """A held tool pressed into a block, both of hexahedra."""
    kind = judge.Scene("solid tool", n, fineness, 1.0, mu, "mortar", True, 0.01, 0.0, 1.0)
    return judge.build(kind, judge.Way())


@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("route", judge.BY_ROUTE)
@pytest.mark.parametrize("fineness", [1, 2, 3, 4])
def test_a_tool_prescribed_on_its_surface(fineness, route, method):
    """The finer side is the secondary one: more rows than the block has free DOFs."""
    s = judge.Scene("tool", 10, fineness, 1.0, 0.0, method, True, 0.01, 0.0, 1.0)
    found, result = judge.pressures(judge.build(s, judge.Way(route=route)))
    turned = judge.mirrored(found)["tool"]
    largest = result.pressure.max()
    assert_allclose(found["tool"], turned, rtol=0, atol=1e-8 * largest)
    assert np.all(result.pressure > 0)
    # the block answers with a pressure that its own mesh can carry: no point has more than its share
    assert largest < 3 * result.pressure.mean()
    assert bool(result.undetermined) == (fineness > 1)
    if fineness > 1:
        more = f"of {10 * fineness + 1} conditions at points that press {10 * (fineness - 1)} follow"
        assert more in result.undetermined[0] and more in result.report() and more in str(result)
    # the other way about there is one split only, with the same resultant
    other = judge.build(replace(s, tool_first=False), judge.Way()).solve()
    assert not other.undetermined
    assert_allclose(result.force[1], -other.force[1], rtol=0.02)


def test_the_forces_are_those_of_least_pressure():
    """What could be added to them without any displacement is orthogonal to the pressure."""
    s = judge.Scene("tool", 6, 3, 1.0, 0.0, "mortar", True, 0.01, 0.0, 1.0)
    result = judge.build(s, judge.Way()).solve()
    answer = answer_of(result)
    free = np.setdiff1d(np.arange(answer.system.n), answer.system.D)
    B = answer.kin.B_n[result.pressure > 0][:, free].toarray()
    _, values, vectors = np.linalg.svd(B.T)
    null = vectors[np.count_nonzero(values > 1e-10 * values[0]) :]
    assert len(null)
    pressure = result.pressure[result.pressure > 0]
    assert_allclose(null @ pressure, 0.0, atol=1e-8 * np.linalg.norm(pressure))


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_many_points_on_a_held_tool(mu):
    """441 points in space, which was 69 s of CPU time and no answer."""
    solver = solid_tool(10, 2, mu)
    result = solver.solve()
    assert len(result.pressure) == 441
    assert result.certificate.worst < 1e-10
    assert result.iterations < 40


def pushed_tool(mu, method, linear):
    """A block, and a tool twice as fine that is held on its surface, pressed and pushed at once."""
    way, across = judge.Way(), np.linspace(0, 1, 11)
    half = np.linspace(0, 1, 6)
    block = judge._body(judge._block(way, half, half, np.linspace(-0.5, 0, 4)), "block")
    basis = judge._block(way, across, across, np.linspace(0, 0.2, 3))
    x = np.zeros(basis.N)
    x[basis.nodal_dofs[0]], x[basis.nodal_dofs[2]] = 0.004, -0.003
    tool = sc.Body(basis, LAW, D="bottom", x=x, name="tool")
    pair = tool.surface("bottom"), block.surface("top")
    joint = sc.Contact(*pair, friction=sc.Coulomb(mu), method=method, name="joint")
    return sc.ContactSolver([block, tool], joint, linear=linear)


@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("mu", [0.5, 0.8])
def test_points_next_to_stuck_know_their_digits(mu, method):
    """Springs across friction that hardly gives: a tool moved by far more than they do."""
    found = [pushed_tool(mu, method, linear).solve() for linear in ("auto", sc.linalg.Direct())]
    first, other = (result.forces for result in found)
    assert_allclose(first, other, rtol=0, atol=1e-9 * np.abs(other).max())
    assert all(result.iterations < 40 for result in found)


def smooth_channel(route):
    """A heavy block wedged between two walls, all without friction."""
    basis = judge._block(
        judge.Way(), np.linspace(0, 1, 5), np.linspace(0, 1, 3), np.linspace(0, 0.7, 3)
    )
    f = np.zeros(basis.N)
    f[basis.nodal_dofs[2]] = -0.1
    body = sc.Body(basis, LAW, f=f, name="block")
    places = {"left": (0.0, 0, 1.0), "right": (1.0, 0, -1.0), "bottom": (0.0, 2, 1.0)}
    contacts = [
        sc.Contact(
            body.surface(side),
            sc.RigidPlane(at * np.eye(3)[k], way * np.eye(3)[k], name=side),
            interference=1e-3 if k == 0 else 0.0,
            name=side,
        )
        for side, (at, k, way) in places.items()
    ]
    return sc.ContactSolver(body, contacts, **judge.BY_ROUTE[route])


def test_a_smooth_channel_leaves_a_block_loose():
    """All its nodes touch, those that springs hold as well: nothing is along the channel."""
    results = []
    for route in judge.BY_ROUTE:
        with pytest.warns(sc.ContactWarning, match="translation along y"):
            results.append(smooth_channel(route).solve())
        assert results[-1].certificate.worst < 1e-11
        for found, expected in zip(results[-1], results[0], strict=True):
            at = 1e-9 * expected.normal_force.max()
            assert_allclose(found.normal_force, expected.normal_force, rtol=0, atol=at)


def corner(mu, seed, order, linear="auto", loads=(-1.0, -1.3, -2.0)):
    """A block in a corner of three planes, pushed into it by three unlike loads."""
    l = np.linspace(0, 1, 5)
    way = judge.Way(seed=seed)
    basis = judge._block(way, l, l, l)
    top = basis.mesh.p.max(axis=1)
    f = np.zeros(basis.N)
    for k, load in enumerate(loads):
        side = basis.mesh.facets_satisfying(lambda x, k=k: np.abs(x[k] - top[k]) < 1e-9, True)
        form = fem.LinearForm(lambda v, w, k=k, load=load: load * v[k])
        f += form.assemble(fem.FacetBasis(basis.mesh, basis.elem, facets=side))
    body = sc.Body(basis, LAW, f=f, name="block")
    contacts = [
        sc.Contact(
            body.surface(lambda x, k=k: np.abs(x[k]) < 1e-9),
            sc.RigidPlane(np.zeros(3), np.eye(3)[k], name=name),
            friction=sc.Coulomb(mu),
            name=name,
        )
        for k, name in enumerate(("west", "south", "floor"))
    ]
    return sc.ContactSolver(body, [contacts[i] for i in order], linear=linear)


def tractions(result):
    """Of all walls, at the points in the order of their places."""
    found = []
    for name in ("west", "south", "floor"):
        order = np.lexsort(np.round(result[name].points, 9).T)
        found.append(result[name].forces[order])
    return np.concatenate(found)


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "direct"])
def test_a_block_in_a_corner_of_three_planes(linear):
    """Seven numberings and two orders of contacts: no refusal, and one answer."""
    first = tractions(corner(0.3, 0, (0, 1, 2)).solve())
    for seed in range(7):
        for order in ((0, 1, 2), (2, 0, 1)):
            result = corner(0.3, seed, order, linear).solve()
            assert_allclose(tractions(result), first, rtol=0, atol=1e-8 * np.abs(first).max())
            assert result.certificate.worst < 1e-9
    assert any("'floor'" in words and "not unique" in words for words in result.undetermined)


@pytest.mark.parametrize("mu", [0.1, 0.3, 1.0])
def test_friction_is_asked_for_only_where_it_is_needed(mu):
    """What could be added to the forces without any displacement is orthogonal to the friction."""
    answer = answer_of(corner(mu, 0, (0, 1, 2)).solve())
    state, kin = answer.state, answer.kin
    free = np.setdiff1d(np.arange(answer.system.n), answer.system.D)
    sticks = np.repeat(state.status == 1, 2)
    rows = [kin.B_n[state.status == 1][:, free], -kin.B_t[sticks][:, free]]
    B = np.concatenate([some.toarray() for some in rows])
    _, values, vectors = np.linalg.svd(B.T)
    null = vectors[np.count_nonzero(values > 1e-10 * values[0]) :, -np.count_nonzero(sticks) :]
    assert len(null)
    along = np.einsum("mkd,md->mk", kin.tangent, state.tangential_force).ravel()
    weighted = along[sticks] / np.repeat(kin.area, 2)[sticks]
    assert_allclose(null @ weighted, 0.0, atol=1e-8 * np.linalg.norm(weighted))
    assert np.abs(null).max() > 0.1  # it is friction that could be added


@pytest.mark.parametrize("tilt", [1e-4, 1e-8, 1.5e-12])
def test_less_friction_does_the_same_to_the_bodies(tilt):
    """What is left to friction alone stays with it, however little: a wall is tilted."""
    rows = csr_matrix([[1.0, 0.0], [1.0, tilt], [0.0, 1.0]])
    friction = np.array([False, True, True])
    [(of, forces)] = least_friction(rows, friction, np.ones(3), np.array([1.0, 1.0, 0.0]))
    assert_allclose(rows[of].T @ forces, [2.0, tilt], rtol=0, atol=0.1 * tilt)
    assert_allclose(forces, [2.0, 0.0, tilt], rtol=0, atol=2 * tilt**2 + 1e-15)


def test_friction_is_shared_by_area():
    """Two forces of friction along one DOF do so as their areas are, which springs are as stiff as."""
    area = np.array([1.0, 3.0])
    [(_, forces)] = least_friction(csr_matrix([[1.0], [1.0]]), area > 0, 1 / area, np.array([2.0, 2.0]))
    assert_allclose(forces, area, rtol=1e-14)


@pytest.mark.parametrize("mu", [0.3, 0.6])
def test_less_friction_is_not_had_by_pulling(mu):
    """Where points would pull, or others exceed their bound, forces stay those of the springs."""
    first = None
    for seed in range(3):
        for linear in ("auto", sc.linalg.Direct()):
            result = corner(mu, seed, (2, 0, 1), linear, (0.05, 0.05, -1.0)).solve()
            size = max(values.normal_force.max() for values in result.values)
            for values in result.values:
                assert values.normal_force.min() >= -1e-12 * size
                friction = np.linalg.norm(values.tangential_force, axis=1)
                assert np.all(friction <= mu * values.normal_force + 1e-9 * size)
            found = tractions(result)
            first = found if first is None else first
            assert_allclose(found, first, rtol=0, atol=1e-7 * np.abs(first).max())


def wedge(tool, method="node", sliding="small", mu=0.3, linear="auto"):
    """A wedge of 8 degrees whose end face is pushed along, and touches the tool by its edge."""
    lean = np.radians(8.0)
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 7), np.linspace(0, 0.5, 4))
    p = mesh.p.copy()
    p[1] += np.tan(lean) * p[0] * (1 - p[1] / 0.5)
    low = {"low": lambda x: np.abs(x[1] - np.tan(lean) * x[0]) < 1e-9}
    basis = fem.Basis(
        fem.MeshQuad(p, mesh.t).with_boundaries(low), fem.ElementVector(fem.ElementQuad1()), intorder=3
    )
    x, y = basis.nodal_dofs
    end, top = x[p[0] < 1e-9], y[p[1] > 0.5 - 1e-9]
    push = np.zeros(basis.N)
    push[end], push[top] = 0.01, -0.01
    body = sc.Body(basis, LAW, D=np.union1d(end, top), x=push, name="wedge")
    bodies, primary = [body], sc.RigidPlane((0, 0), (-np.sin(lean), np.cos(lean)), name="tool")
    if tool == "held":
        m = fem.MeshQuad.init_tensor(np.linspace(0, 1.2, 8), np.linspace(-0.5, 0, 3))
        q = m.p + np.array([[0.0], [np.tan(lean)]]) * m.p[0]
        up = {"up": lambda x: np.abs(x[1] - np.tan(lean) * x[0]) < 1e-9}
        other = fem.Basis(fem.MeshQuad(q, m.t).with_boundaries(up), basis.elem, intorder=3)
        bodies.append(sc.Body(other, LAW, D=np.arange(other.N), name="tool"))
        primary = bodies[1].surface("up")
    law = sc.Coulomb(mu) if mu else None
    joint = sc.Contact(
        body.surface("low"), primary, friction=law, method=method, sliding=sliding, name="joint"
    )
    return sc.ContactSolver(bodies, joint, linear=linear)


@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "direct"])
def test_a_prescribed_end_face_that_touches_slips(linear, sliding):
    """Supports that contradict sticking make the point slip, whatever the tool is."""
    plane = wedge("plane", sliding=sliding, linear=linear).solve()
    assert np.all(plane.status == 2)
    assert_allclose(plane.tangential_force[:, 0], 0.3 * plane.normal_force, rtol=1e-9)
    assert plane.certificate.worst < 1e-11
    assert not plane.undetermined  # at the bound there is one force
    for method in ("node", "mortar"):
        held = wedge("held", method, sliding, linear=linear).solve()
        assert_allclose(held.forces, plane.forces, rtol=0, atol=1e-9 * np.abs(plane.forces).max())
        assert held.certificate.worst < 1e-11


@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "direct"])
def test_points_that_can_not_all_be_closed_are_named(linear, mu):
    """Nodes pushed into a groove deeper than there is room: forces would grow without end."""
    basis = judge._block(judge.Way(), np.linspace(0, 1, 5), np.linspace(0, 0.5, 4))
    bottom = basis.get_dofs("bottom").all("u^2")
    x = np.zeros(basis.N)
    x[bottom] = -0.01
    D = np.union1d(basis.get_dofs("top").all(), bottom)
    body = sc.Body(basis, LAW, D=D, x=x, name="block")
    law = None if mu is None else sc.Coulomb(mu)
    contacts = [
        sc.Contact(
            body.surface("bottom"),
            sc.RigidPlane((0, 0), (side * np.sin(0.5), np.cos(0.5)), name=name),
            friction=law,
            gap=0.0,
            name=name,
        )
        for name, side in (("west", 1), ("east", -1))
    ]
    with pytest.raises(
        sc.errors.ConstraintError, match=r"contradict each other: point . of block/bottom on"
    ):
        sc.ContactSolver(body, contacts, linear=linear).solve()


def test_a_node_between_a_wall_that_leans_and_the_floor_jams():
    """Where two angles of friction reach over it: forces on the node would grow without end.

    Pushed along the floor by the overlap with the wall it slips on both, as long as the wall pushes
    more than floor and wall hold back: ``cos a (1 - mu^2) > 2 mu sin a``.
    """
    lean = 0.1
    most = np.tan(np.pi / 4 - lean / 2)
    mesh = judge._block(judge.Way(), np.linspace(0, 1, 5), np.linspace(0, 0.7, 4)).mesh
    p = mesh.p.copy()
    p[0] -= 2 * np.tan(lean) * p[1] * (p[0] - 0.5)
    basis = fem.Basis(replace(mesh, doflocs=p), fem.ElementVector(fem.ElementQuad1()), intorder=3)
    walls = {"left": (0.0, 1), "right": (1.0, -1), "bottom": (0.0, 0)}
    body = sc.Body(basis, LAW, name="block")

    def solver(mu):
        contacts = []
        for side, (x, way) in walls.items():
            normal = (way * np.cos(lean), -np.sin(lean)) if way else (0.0, 1.0)
            plane = sc.RigidPlane((x, 0.0), normal, name=side)
            deep = 1e-3 if way else 0.0
            law = sc.Coulomb(mu)
            contacts.append(
                sc.Contact(body.surface(side), plane, friction=law, interference=deep, name=side)
            )
        return sc.ContactSolver(body, contacts)

    result = solver(0.99 * most).solve()
    assert result.certificate.worst < 1e-9
    with pytest.raises(sc.errors.NotConverged, match="these grow without end") as error:
        solver(1.01 * most).solve()
    assert len(error.value.result.trace) < 400


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "direct"])
def test_points_seen_through_springs_hold_no_body(linear):
    """A block that its load pulls along two walls: springs do not hide that nothing holds it."""
    solver = corner(0.3, 0, (0, 1, 2), linear)
    body = solver.system.bodies[0]
    with pytest.raises(sc.errors.NoEquilibrium):
        solver.with_load("block", -np.asarray(body.f)).solve()


def test_regular_contact_has_no_springs():
    """Where rows do not depend on each other nothing is different, to the last bit."""
    s = judge.Scene("tool", 6, 2, 0.5, 0.3, "mortar", False, 0.01, 0.0, 1.0)
    solver = judge.build(s, judge.Way())
    result = solver.solve()
    assert solver.linear_model.problem_on(None, None).springs is None
    assert not any(record.note == "springs have a strain" for record in result.trace)


@pytest.mark.parametrize("route", ["condensed", "full"])
@pytest.mark.parametrize("kind", ["tool", "solid tool"])
def test_the_proximal_point_comes_to_the_same_forces(kind, route, monkeypatch):
    """Its springs take the place of those of the points, and the split is that of least pressure."""
    s = judge.Scene(kind, 4, 2, 1.0, 0.3, "mortar", True, 0.01, 0.0, 1.0)
    usual = judge.build(s, judge.Way()).solve()
    assert usual.undetermined
    internals.replace(monkeypatch, "loops.STARTS", ("proximal", "proximal"))
    result = judge.build(s, judge.Way(route=route)).solve()
    assert any(record.note == "springs in series" for record in result.trace)
    assert result.undetermined and result.certificate.worst < 1e-9
    assert_allclose(result.pressure, usual.pressure, rtol=0, atol=1e-6 * usual.pressure.max())
