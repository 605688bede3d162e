"""Finite sliding of solids: an answer far along is that of bodies which were meshed there."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import KINDS, at, cube, elastic, extruded

import skfem_contact as sc

# Pairings are iterated to 1e-8 of the largest force, and errors of two rounds add up.
EXACT = sc.Options.accurate()
SETTLED = 3e-8


def box(kind, lower, upper, n, place=None):
    """A box of n^3 hexahedra, or of the tetrahedra that they are cut into."""
    lower, upper = np.array(lower)[:, None], np.array(upper)[:, None]
    fill = lambda x: lower + (upper - lower) * x  # noqa: E731
    return cube(kind, n, (lambda x: place(fill(x))) if place else fill)


def slider(kind, shift=(0.0, 0.0), n=2):
    """A box above a wavy table, its upper side to be moved."""
    x, y = shift
    mesh = box(kind, (0.3 + x, 0.4 + y, 0.6), (1.3 + x, 1.4 + y, 1.2), n)
    return elastic(mesh, kind, "slider", E=3.0, held=((at(2, 1.2), (0, 1, 2)),))


def table(kind, n=3):
    wavy = lambda x: np.array([x[0], x[1], x[2] + 0.02 * x[2] * np.cos(2 * x[0]) * np.cos(x[1])])  # noqa: E731
    mesh = box(kind, (0, 0, 0), (3, 2, 0.6), n, wavy)
    return elastic(mesh, kind, "table", held=((at(2, 0.0), (0, 1, 2)),))


def moved(body, by):
    """Prescribed displacements by which the held side of a body moves."""
    x = np.zeros(body.basis.N)
    for dofs, value in zip(body.basis.split_indices(), by, strict=True):
        x[np.intersect1d(dofs, body.D)] = value
    return {"x": {body.name: x}}


def pressed(upper, lower, method, steps, **settings):
    """The answers of a history, of a box on a table."""
    contact = sc.Contact(
        upper.surface(at(2, 0.6)), lower.surface(lambda x: x[2] > 0.55), method=method, **settings
    )
    solver = sc.ContactSolver([lower, upper], contact, options=EXACT)
    return list(solver.history([moved(upper, by) for by in steps]))


@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("kind", ["quad4", "tri3"])
def test_dragged_far_is_as_pressed_there(kind, method):
    """Without friction nothing of the way is left: the answer of a box that was meshed at the end."""
    end = np.array([1.1, 0.43])
    way = [(*(share * end), -0.04) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    far = pressed(slider(kind), table(kind), method, way, sliding="finite")[-1]
    there = pressed(slider(kind, end), table(kind), method, [(0, 0, -0.04)], sliding="finite")[-1]
    assert np.count_nonzero(there.status) > 4
    assert_allclose(far.force, there.force, atol=SETTLED * np.abs(there.force).max())
    assert_allclose(far.pressure, there.pressure, atol=SETTLED * there.pressure.max())
    assert far.certificate.worst < 1e-8  # the placement is what was asked for
    # and near is another answer: the table is wavy
    near = pressed(slider(kind), table(kind), method, way[:1], sliding="finite")[-1]
    assert np.abs(near.pressure - there.pressure).max() > 0.1 * there.pressure.max()


@pytest.mark.parametrize("friction", [None, sc.Coulomb(0.4)], ids=["smooth", "rough"])
def test_the_history_of_a_plane_problem_extruded(friction):
    """A stamp that is pressed into a block and dragged over two facets: the plane answer.

    Point by point; in the plane mortar rows know the curves through the nodes as well.
    """
    height = 0.3
    grid = fem.MeshQuad.init_tensor(np.linspace(-0.85, 0.65, 7), np.linspace(0, 0.8, 4))
    p = grid.p + [[0.0], [0.2]] * (0.8 - grid.p[1]) * grid.p[0] ** 2
    stamp = extruded(fem.MeshQuad(p, grid.t), "quad4", height, 2.0, 0.3, "stamp", at(1, 0.8))
    grid = fem.MeshQuad.init_tensor(np.linspace(-1.2, 1.6, 9), np.linspace(-1, 0, 4))
    block = extruded(grid, "quad4", height, 1.0, 0.25, "block", at(1, -1.0))

    def inside(x):
        return len(x) == 2 or (x[-1] > 0.01) & (x[-1] < height - 0.01)

    forces, pressures = [], []
    for upper, lower in zip(stamp, block, strict=True):
        foot = upper.surface(lambda x: inside(x) & (x[1] < 0.2) & (np.abs(x[0] + 0.1) < 0.49))
        roof = lower.surface(lambda x: inside(x) & (x[1] > -0.1) & (x[0] > -1.19) & (x[0] < 1.59))
        contact = sc.Contact(foot, roof, method="node", sliding="finite", friction=friction)
        solver = sc.ContactSolver([upper, lower], contact, options=EXACT)
        steps = [moved(upper, (share, -0.05, 0.0)[: upper.dim]) for share in (0.0, 0.2, 0.4, 0.65)]
        results = list(solver.history(steps))
        forces.append(np.array([r.force[:2] for r in results]))
        pressures.append(np.array([r.pressure.max() for r in results]))
    assert_allclose(forces[1], forces[0] * height, atol=SETTLED * np.abs(forces[0]).max())
    assert_allclose(pressures[1], pressures[0], rtol=SETTLED)


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
@pytest.mark.parametrize("kind", list(KINDS))
def test_a_rigid_ball_that_moves(kind):
    """A ball pushed into a block and moved over its faces: that of a ball which was put there."""
    mesh = box(kind, (0, 0, 0), (2, 1.5, 0.6), 3 if kind in ("tri3", "quad4") else 2)
    block = elastic(mesh, kind, "block", held=((at(2, 0.0), (0, 1, 2)),))

    def force(way, start):
        ball = sc.RigidSphere((*start, 0.6 + 2.0), 2.0)
        contact = sc.Contact(block.surface(at(2, 0.6)), ball, sliding="finite", name="joint")
        solver = sc.ContactSolver(block, contact, options=EXACT)
        return [r.force for r in solver.history([{"motion": {"joint": by}} for by in way])][-1]

    far = force([(0, 0, -0.05), (0.2, 0.1, -0.05), (0.45, 0.2, -0.05)], (0.7, 0.6))
    assert_allclose(far, force([(0, 0, -0.05)], (1.15, 0.8)), atol=SETTLED * abs(far[2]))


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
def test_a_rough_ball_that_turns():
    """A ball that spins in place drags the block by the moment of its pressures; and the slip goes on.

    About the axis of its pressure every point slips across its radius by as much as it is turned.
    """
    block = elastic(
        box("quad4", (0, 0, 0), (2, 2, 0.8), 6), "quad4", "block", held=((at(2, 0.0), (0, 1, 2)),)
    )
    ball = sc.RigidSphere((1, 1, 0.8 + 2.0), 2.0)
    contact = sc.Contact(
        block.surface(at(2, 0.8)), ball, sliding="finite", friction=sc.Coulomb(0.3), name="joint"
    )
    solver = sc.ContactSolver(block, contact, options=EXACT)
    down, centre = np.array([0, 0, -0.06]), np.array([1, 1, 2.8])
    steps = [{"motion": {"joint": (down, np.array([0, 0, turn]), centre)}} for turn in (0.0, 0.3, 1.5)]
    first, *results = solver.history(steps)
    for result in results:
        closed = result.status > 0
        arm = np.linalg.norm(result.points[:, :2] - 1, axis=1)
        # near the axis slips are small, and what the block gives turns them off the circle a little
        bound = 0.3 * np.sum((result.normal_force * arm)[closed])
        moment = result.moment((1, 1, 0))[2]
        assert abs(moment) == pytest.approx(bound, rel=4e-3)
        assert result.certificate.worst < 1e-8
    assert_allclose(results[0].force, first.force, atol=1e-2 * abs(first.force[2]))


@pytest.mark.parametrize("method", ["node", "mortar"])
def test_an_end_that_nodes_have_slid_past(method):
    """Two blocks of one width: nodes that leave the end by a hair press on, farther ones are told."""
    lower = elastic(
        box("quad4", (0, 0, 0), (1, 1, 1), 2), "quad4", "low", held=((at(2, 0.0), (0, 1, 2)),)
    )
    upper = elastic(
        box("quad4", (0, 0, 1), (1, 1, 2), 2), "quad4", "up", held=((at(2, 2.0), (0, 1, 2)),)
    )
    forces, told = {}, []
    for sliding, way in (("small", 1e-4), ("finite", 1e-4), ("finite", 0.06)):
        sides = upper.surface(at(2, 1.0)), lower.surface(at(2, 1.0))
        contact = sc.Contact(*sides, method=method, sliding=sliding)
        solver = sc.ContactSolver([lower, upper], contact)
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            result = solver.solve(**moved(upper, (way, 0.0, -1e-3)))
        forces[sliding, way] = result.force[2]
        told += [str(w.message) for w in seen if "'low/surface' lies in the body of" in str(w.message)]
        assert ("past the end of the primary" in repr(result)) == (method == "node" and way > 0.05)
    lost = 1 - np.array([forces["finite", way] for way in (1e-4, 0.06)]) / forces["small", 1e-4]
    assert abs(lost[0]) < 1e-3
    # beyond a tenth of a facet; 6 % of the width press no more, node by node the end of a facet
    assert (lost[1] > 0.15) == (len(told) == 1) == (method == "node")
    assert method == "mortar" or "method='mortar'" in told[0]
