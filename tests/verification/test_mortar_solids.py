"""Dual mortar contact of solids: patch tests, glue against one mesh, symmetry, supports, Hertz."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from skfem.models.elasticity import lame_parameters

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import KINDS, at, elastic, shuffled

import skfem_contact as sc
from skfem_contact.reference import hertz_point

EXACT = 1e-10
E, NU = 2.0, 0.3
ROLLERS = (at(0, 0.0), (0,)), (at(1, 0.0), (1,))
TURN = Rotation.from_rotvec([0.5, -0.7, 0.4]).as_matrix()
PAIRS = [("quad4", "tri3"), ("tri3", "quad9"), ("tri6", "quad4"), ("quad8", "tri6"), ("quad9", "quad8")]
every_pair = pytest.mark.parametrize("kinds", [*PAIRS, *((kind, kind) for kind in KINDS)], ids="-".join)


def grid(kind, x, y, z, moved=None, seed=None):
    """Cells between lines; vertices off the sides moved by up to a quarter of them along x and y."""
    linear, curved, _ = KINDS[kind]
    lines = [np.linspace(0, 1, n + 1) if isinstance(n, int) else np.asarray(n, float) for n in (x, y)]
    mesh = linear.init_tensor(*lines, np.asarray(z, float))
    if moved is not None:
        p, rng = mesh.p.copy(), np.random.default_rng(moved)
        inside = [(q > line[0]) & (q < line[-1]) for q, line in zip(p, lines, strict=False)]
        inner = np.all(inside, axis=0)
        size = np.array([np.diff(line).min() for line in lines])[:, None]
        p[:2, inner] += rng.uniform(-0.25, 0.25, (2, np.count_nonzero(inner))) * size
        mesh = linear(p, mesh.t)
    mesh = mesh if seed is None else shuffled(mesh, seed)
    return mesh if curved is linear else curved.from_mesh(mesh)


def turned(mesh):
    return type(mesh)(np.ascontiguousarray(TURN @ mesh.doflocs), mesh.t)


def facets(mesh, z):
    return mesh.facets_satisfying(lambda x: np.isclose(x[2], z))


def stretched(body, strain):
    """Displacement of a body under a uniform strain (3, 3)."""
    return np.sum(np.eye(3)[body.dof_component] * (body.dof_points @ strain), axis=1)


@every_pair
@pytest.mark.pairwise
@pytest.mark.parametrize("moved", [None, 7])
@pytest.mark.parametrize("tied", [False, True])
def test_a_uniform_stress_crosses_any_meshes_at_any_angle(kinds, moved, tied):
    """Blocks under tension or pressure along a turned axis: stress and displacements are exact.

    The far ends move as the uniform stress has it; the sides are free.
    """
    axis = TURN @ [0, 0, 1]
    pressure = 0.01 if not tied else -0.01
    strain = -pressure / E * ((1 + NU) * np.outer(axis, axis) - NU * np.eye(3))
    bodies, sides = [], []
    for kind, n, z, name in ((kinds[0], 4, (1, 2), "high"), (kinds[1], 3, (0, 1), "low")):
        flat = grid(kind, n, n, z, None if moved is None else moved + n)
        end = facets(flat, 2 if name == "high" else 0)
        basis = fem.Basis(turned(flat), fem.ElementVector(KINDS[kind][2]()), intorder=4)
        form = linear_elasticity(*lame_parameters(E, NU))
        free = sc.Body(basis, form)
        D = basis.get_dofs(end).flatten()
        x = np.zeros(basis.N)
        x[D] = stretched(free, strain)[D]
        bodies.append(sc.Body(basis, form, D=D, x=x, name=name))
        sides.append(bodies[-1].surface(facets(flat, 1.0), name="side"))
    result = sc.ContactSolver(bodies, [sc.Contact(*sides, tied=tied, name="joint")]).solve()
    values = result["joint"]
    assert_allclose(
        values.traction, np.tile(pressure * axis, (len(values.points), 1)), atol=EXACT * 0.01
    )
    for body in bodies:
        expected = stretched(body, strain)
        assert_allclose(
            result.displacement(body), expected, rtol=0, atol=EXACT * np.abs(expected).max()
        )
    assert result.certificate.worst < EXACT


@pytest.mark.parametrize("kind", KINDS)
def test_glued_blocks_of_one_mesh_are_one_body(kind):
    """Pulled, sheared and bent: cut in two along matching faces and glued, nothing changes."""
    load = (0.003, 0.001, -0.01)
    n = 2 if kind in ("quad8", "quad9") else 3
    halves, z = [np.linspace(0, 0.5, n + 1), np.linspace(0.5, 1, n + 1)], np.linspace(0, 1, 2 * n + 1)
    floor = (at(2, 0.0), (0, 1, 2))
    whole = elastic(grid(kind, n, n, z), kind, "whole", held=(floor,), press=(at(2, 1.0), load))
    u = fem.solve(*fem.condense(whole.K, whole.f, D=whole.D))
    low = elastic(grid(kind, n, n, halves[0]), kind, "low", held=(floor,))
    high = elastic(grid(kind, n, n, halves[1]), kind, "high", press=(at(2, 1.0), load))
    contact = sc.Contact(high.surface(at(2, 0.5)), low.surface(at(2, 0.5)), tied=True)
    result = sc.ContactSolver([low, high], [contact]).solve()
    scale = np.abs(u).max()
    keys = [tuple(row) for row in np.column_stack([np.round(whole.dof_points, 9), whole.dof_component])]
    known = dict(zip(keys, u, strict=True))
    for body in (low, high):
        places = np.column_stack([np.round(body.dof_points, 9), body.dof_component])
        expected = np.array([known[tuple(row)] for row in places])
        assert_allclose(result.displacement(body), expected, rtol=0, atol=EXACT * scale)


def test_glue_between_other_meshes_is_nearly_one_body():
    """The energy of glued blocks that do not match, against one mesh: less stiff by a percent or so."""
    load = (0.003, 0.001, -0.01)
    floor = (at(2, 0.0), (0, 1, 2))
    whole = elastic(
        grid("quad4", 8, 8, np.linspace(0, 1, 9)),
        "quad4",
        "whole",
        held=(floor,),
        press=(at(2, 1.0), load),
    )
    exact = whole.f @ fem.solve(*fem.condense(whole.K, whole.f, D=whole.D))
    for n_low, n_high in ((6, 8), (8, 6)):
        low = elastic(
            grid("quad4", n_low, n_low, np.linspace(0, 0.5, 5)), "quad4", "low", held=(floor,)
        )
        mesh = grid("quad4", n_high, n_high, np.linspace(0.5, 1, 5))
        high = elastic(mesh, "quad4", "high", press=(at(2, 1.0), load))
        contact = sc.Contact(high.surface(at(2, 0.5)), low.surface(at(2, 0.5)), tied=True)
        result = sc.ContactSolver([low, high], [contact]).solve()
        # meshes with 6 and 8 elements differ by 1 % themselves
        assert high.f @ result.displacement(high) == pytest.approx(exact, rel=0.012)


@pytest.mark.every_value
@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize(
    "kinds", [("quad4", "quad4"), ("quad8", "quad4"), ("quad9", "quad8")], ids="-".join
)
def test_a_quarter_is_a_quarter_of_the_whole(kinds, tied):
    """Blocks that do not match, symmetric about two planes through the joint: forces of the whole.

    At the planes of symmetry rows across them must carry nothing, glued ones too.
    """
    found = []
    for whole in (False, True):
        own, other = np.array([0, 0.3, 0.65, 1.0]), np.array([0, 0.5, 1.0])
        wide = np.array([0, 0.45, 0.9, 1.3])
        if whole:
            own, other, wide = (np.concatenate([-line[:0:-1], line]) for line in (own, other, wide))
        held = ROLLERS if not whole else ()
        low = elastic(
            grid(kinds[1], wide, wide, [-1, -0.4, 0]),
            kinds[1],
            "low",
            held=(*held, (at(2, -1.0), (0, 1, 2))),
        )
        # of the whole, one node on each axis of symmetry is kept from drifting by the supports above
        high = elastic(
            grid(kinds[0], own, other, [0, 0.5, 1]),
            kinds[0],
            "high",
            E=3.0,
            held=(*held, (at(2, 1.0), (0, 1, 2))),
            push=(at(2, 1.0), (0.0, 0.0, -0.02)),
        )
        contact = sc.Contact(high.surface(at(2, 0.0)), low.surface(at(2, 0.0)), tied=tied, name="joint")
        values = sc.ContactSolver([low, high], [contact]).solve()["joint"]
        part = np.all(values.points[:, :2] > -1e-9, axis=1)
        order = np.lexsort(np.round(values.points[part], 9).T)
        found.append((values.points[part][order], values.traction[part][order]))
    (points, quarter), (same, full) = found
    assert_allclose(points, same, atol=1e-12)
    scale = np.abs(full).max()
    assert_allclose(quarter, full, rtol=0, atol=1e-9 * scale)


@pytest.mark.every_value
@pytest.mark.parametrize(
    "kinds", [("quad4", "quad4"), ("tri3", "quad4"), ("quad8", "quad8")], ids="-".join
)
@pytest.mark.parametrize("n", [(4, 5), (5, 4), (4, 4)])
def test_gripped_blocks_pushed_together(kinds, n):
    """Clamped on one wall and pressed together by an interference: as node to segment, within 10 %."""
    force = []
    for method in ("mortar", "node"):
        wall = (at(0, 0.0), (0, 1, 2))
        low = elastic(
            grid(kinds[1], n[1], 2, [-0.5, 0]), kinds[1], "low", held=(wall, (at(2, -0.5), (2,)))
        )
        high = elastic(
            grid(kinds[0], n[0], 2, [0, 0.5]), kinds[0], "high", held=(wall, (at(2, 0.5), (2,)))
        )
        contact = sc.Contact(
            high.surface(at(2, 0.0)),
            low.surface(at(2, 0.0)),
            method=method,
            interference=1e-3,
            name="joint",
        )
        # at the wall the overlap is what supports make it, and is said to stay
        with pytest.warns(sc.ContactWarning, match="Prescribed displacements win"):
            result = sc.ContactSolver([low, high], [contact]).solve()
        force.append(result["joint"].normal_force.sum())
    # 1e-3 over a height of 1 on an area of 1, but for what the wall holds
    assert 0.3e-3 < force[0] < 1.5e-3
    assert force[0] == pytest.approx(force[1], rel=0.1)


def test_order_of_nodes_and_bodies_turned_do_not_matter():
    """A block pressed on part of a larger one: the same pressures for shuffled and turned meshes."""
    found = []
    for seed, turn in ((None, np.eye(3)), (5, TURN)):
        meshes = {
            "low": grid("tri3", [-0.3, 0.2, 0.7, 1.2], 3, [-1, 0], seed=seed),
            "high": grid("quad4", 4, [0.1, 0.5, 0.8, 1.25], [0, 0.5, 1], moved=2, seed=seed),
        }
        bodies, sides = [], []
        for (name, mesh), end, push in zip(meshes.items(), (-1.0, 1.0), (0.0, -0.01), strict=True):
            lists = facets(mesh, end), facets(mesh, 0.0)
            placed = type(mesh)(np.ascontiguousarray(turn @ mesh.doflocs), mesh.t)
            kind = "tri3" if name == "low" else "quad4"
            basis = fem.Basis(placed, fem.ElementVector(KINDS[kind][2]()), intorder=2)
            D, x = basis.get_dofs(lists[0]).flatten(), np.zeros(basis.N)
            free = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)))
            x[D] = (push * turn[:, 2])[free.dof_component[D]]
            bodies.append(sc.Body(basis, free.K, D=D, x=x, name=name))
            sides.append(bodies[-1].surface(lists[1], name="side"))
        result = sc.ContactSolver(bodies, [sc.Contact(*sides[::-1], name="joint")]).solve()
        values = result["joint"]
        order = np.lexsort(np.round(values.points @ turn, 8).T)
        found.append((result.iterations, values.pressure[order], (values.forces @ turn)[order]))
    assert found[0][0] == found[1][0]
    for one, other in zip(found[0][1:], found[1][1:], strict=True):
        assert_allclose(other, one, rtol=0, atol=1e-9 * np.abs(one).max())


@pytest.mark.parametrize("kinds", [("quad4", "tri3"), ("quad9", "quad8")], ids="-".join)
def test_a_block_that_overhangs(kinds):
    """A block that hangs over the edge of another: forces as the supports have them, none outside."""
    floor, lid = (at(2, -1.0), (0, 1, 2)), (at(2, 1.0), (0, 1, 2))
    low = elastic(grid(kinds[1], [-0.3, 0.1, 0.6], 3, [-1, 0]), kinds[1], "low", held=(floor,))
    mesh = grid(kinds[0], 4, 3, [0, 0.5, 1])
    high = elastic(mesh, kinds[0], "high", held=(lid,), push=(at(2, 1.0), (0.0, 0.0, -0.01)))
    contact = sc.Contact(high.surface(at(2, 0.0)), low.surface(at(2, 0.0)), name="joint")
    result = sc.ContactSolver([low, high], [contact]).solve()
    values = result["joint"]
    reaction = (low.K @ result.displacement(low))[low.D]
    component = low.dof_component[low.D]
    force = [reaction[component == k].sum() for k in range(3)]
    assert force[2] > 1e-3
    assert_allclose(force, values.force, rtol=0, atol=1e-12)
    assert np.all(values.normal_force[values.points[:, 0] > 0.8] == 0)


# --- Hertz ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kinds", "n", "across"),
    [
        (("quad4", "quad4"), 10, 5),
        pytest.param(("quad4", "quad4"), 16, 10, marks=pytest.mark.slow),
        pytest.param(("quad8", "quad8"), 7, 4, marks=pytest.mark.slow),
        pytest.param(("quad9", "quad8"), 8, 4, marks=pytest.mark.slow),
    ],
)
def test_hertz_of_two_elastic_bodies(kinds, n, across):
    """A sphere, as its parabola, pressed on a half-space by a mesh that does not match: width, peak."""
    R, a = 8.0, 1.0
    plane = 1000 / (1 - 0.3**2) / 2  # of both
    bodies = []
    for kind, sign, h in zip(kinds, (1, -1), (a / across, 1.3 * a / across), strict=True):
        q = ratio_of_steps(n, 12 * a, h)
        t = np.concatenate([[0.0], np.cumsum(h * q ** np.arange(n))])
        z = t if sign > 0 else -t[::-1]
        linear, curved, _ = KINDS[kind]
        mesh = linear.init_tensor(t, t, z)
        mesh = mesh if curved is linear else curved.from_mesh(mesh)
        end = at(2, sign * t[-1])
        p = mesh.doflocs.copy()
        if sign > 0:
            p[2] += (1 - p[2] / t[-1]) * (p[0] ** 2 + p[1] ** 2) / (2 * R)
        body = elastic(
            type(mesh)(p, mesh.t),
            kind,
            "ball" if sign > 0 else "block",
            E=1000.0,
            held=(*ROLLERS, (end, (2,))),
            push=(end, (0.0, 0.0, -0.5 * sign * a**2 / R)),
        )
        side = mesh.facets_satisfying(lambda x: np.isclose(x[2], 0))
        bodies.append((body, body.surface(side)))
    contact = sc.Contact(bodies[0][1], bodies[1][1], name="joint")
    result = sc.ContactSolver([body for body, _ in bodies], [contact]).solve()
    values = result["joint"]
    exact = hertz_point(4 * values.normal_force.sum(), R, plane)
    assert 0.8 < exact.a < 1.2
    r = np.hypot(*values.points[:, :2].T)
    # of Hertz's pressure the mean of r² is 2/5 a²
    width = np.sqrt(2.5 * (values.normal_force @ r**2) / values.normal_force.sum())
    assert width == pytest.approx(exact.a, rel=0.05)  # a face is a fifth of a
    assert values.pressure[np.argmin(r)] == pytest.approx(exact.p0, rel=0.04)
    assert result.certificate.worst < 1e-9


def ratio_of_steps(n, size, h):
    """Ratio of a geometric series of n steps from h to size."""
    return brentq(lambda q: h * np.sum(q ** np.arange(n)) - size, 1.0, 5.0)


# --- curved interfaces ------------------------------------------------------------------------------


def ring(kind, n, inner, outer):
    """A quarter of a ring, one element thick, with its inner and its outer face by name."""
    linear, curved, _ = KINDS[kind]
    lines = np.linspace(inner, outer, max(1, n * 2 // 3) + 1), np.linspace(0, np.pi / 2, n + 1)
    mesh = linear.init_tensor(*lines, np.array([0, 0.2]))
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    named = {
        name: mesh.facets_satisfying(lambda x, r=r: np.isclose(x[0], r))
        for name, r in (("inner", inner), ("outer", outer))
    }
    r, angle, z = mesh.doflocs
    return type(mesh)(np.stack([r * np.cos(angle), r * np.sin(angle), z]), mesh.t).with_boundaries(
        named
    )


def pressure_error(kind, n_inner, n_outer):
    """Largest relative error of the pressure between two rings in plane strain, under 1e7 outside."""
    held = (*ROLLERS, (at(2, 0.0), (2,)), (at(2, 0.2), (2,)))
    inside = elastic(ring(kind, n_inner, 0.2, 0.6), kind, "inside", E=1e11, held=held)
    around = elastic(ring(kind, n_outer, 0.6, 1.0), kind, "around", E=1e11, held=held)
    rim = fem.FacetBasis(around.basis.mesh, around.basis.elem, facets="outer", intorder=6)
    f = fem.LinearForm(lambda v, w: -1e7 * sum(w.n[i] * v[i] for i in range(3))).assemble(rim)
    around = sc.Body(around.basis, around.K, f, D=around.D, name="around")
    contact = sc.Contact(inside.surface("outer"), around.surface("inner"), gap=0.0, name="joint")
    result = sc.ContactSolver([inside, around], [contact]).solve()
    exact = 1e7 / (1 - 0.2**2) * (1 - 0.2**2 / 0.6**2)  # Lamé
    return np.abs(result["joint"].pressure / exact - 1).max()


def test_pressure_between_rings_that_do_not_match():
    """Linear faces: order 1, where matching ones have 2, as polyhedra are no curves."""
    errors = [pressure_error("quad4", n, n * 2 // 3) for n in (6, 12, 24)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert errors[-1] < 0.0023
    assert np.all(orders > 1.4)  # falling from 1.7 to 1.1 on finer meshes
    matching = [pressure_error("quad4", n, n) for n in (6, 12)]
    assert matching[1] < 0.0018 and matching[0] / matching[1] > 3.8


@pytest.mark.slow
def test_quadratic_faces_need_not_match():
    """27-node hexahedra: between rings the same error and order whether meshes match or not."""
    errors = np.array(
        [[pressure_error("quad9", n, m) for n, m in ((k, k), (k, k * 2 // 3))] for k in (6, 12)]
    )
    assert np.all(errors[1] < 0.0012)
    assert np.all(errors[:, 1] < 1.1 * errors[:, 0])
    assert np.all(errors[0] / errors[1] > 3.7)
