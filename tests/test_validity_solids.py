"""Validity in 3-D: what small sliding of solids does not follow is seen, and nothing else."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity
from scipy.spatial.transform import Rotation
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters
from solid_meshes import KINDS, at, body, cube, elastic, onto_ball

import skfem_contact as sc
from skfem_contact.answers import Rim, Support, Track, answer_of, boundary, curvatures
from skfem_contact.conditions import pair

every_kind = pytest.mark.parametrize("kind", KINDS)


def brick(name, n, low, high, kind="quad4", **settings):
    """An elastic box between two corners."""
    low, high = np.array(low, dtype=float)[:, None], np.array(high, dtype=float)[:, None]
    return elastic(cube(kind, n, lambda x: low + (high - low) * x), kind, name, **settings)


def dragged(by, kind="quad4", turn=None):
    """A block pressed on a track by 0.01 and dragged along it; both 1 high, without friction."""
    track = brick("track", 4, (-1, 0, -1), (3, 1, 0), kind, held=((at(2, -1.0), (0, 1, 2)),))
    top = at(2, 1.0)
    move = (*by, -0.01)
    block = brick(
        "block", 2, (0, 0.2, 0), (1, 0.8, 1), kind, held=((top, (0, 1, 2)),), push=(top, move)
    )
    contact = sc.Contact(
        block.surface(at(2, 0.0)), track.surface(at(2, 0.0)), method="node", name="joint"
    )
    return sc.ContactSolver([block, track], [contact])


def quiet(solver, **step):
    """The result, and what was warned of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = solver.solve(**step)
    return result, " ".join(str(w.message) for w in caught if w.category is sc.ContactWarning)


def test_a_block_dragged_along_its_track():
    """By 1.5 lengths: seen in the step, with the slip, the facets and the widths that it is."""
    result, said = quiet(dragged((1.5, 0.0)))
    assert "small sliding" in said and "sliding='finite'" in said
    drift = result.validity.contacts["joint"].drift
    assert result.validity.holds is False and not drift.small_sliding_holds
    assert drift.slip == pytest.approx(1.5, rel=0.02)
    # faces of the track are 1 by 0.25, the contact 1 by 0.6
    assert drift.facets == pytest.approx(1.5 / 0.5, rel=0.02)
    assert drift.widths == pytest.approx(1.5 / np.sqrt(0.6), rel=0.02)
    assert drift.beyond == 0


def test_a_block_dragged_off_its_track():
    """Across the track, whose rim it passes by half of its width."""
    result, said = quiet(dragged((0.0, 0.5)))
    assert "beyond the end of the primary" in said
    drift = result.validity.contacts["joint"].drift
    assert drift.beyond == 3 and drift.overhang == pytest.approx(0.3, rel=0.05)
    # nodes at 0.2, 0.5, 0.8 with shares 0.15, 0.3, 0.15, squares of the same area: of the last all
    # is lost, of the middle one, which is at the rim, half
    assert 0.3 < drift.beyond_share < 0.7


@pytest.mark.parametrize("by", [(0.0, 0.0), (0.05, 0.0), (0.0, -0.05)])
def test_a_block_that_hardly_moves(by):
    """No warning, and every bound of the model holds."""
    result, said = quiet(dragged(by))
    assert not said
    validity = result.validity
    assert validity.holds and validity.worst < 1.0 and not validity.problems
    part = validity.contacts["joint"]
    assert part.overlap < 0.25 * part.drift.approach and part.unseen == 0
    # what is given is taken up, to round-off of places of the order of one
    assert 0.01 - 1e-12 <= part.drift.approach < 0.015
    assert "Validity of the model: holds" in result.report()


def drilled(turn, sliding):
    """A block pressed on a plane that turns under its middle: its torque over the force, and words."""
    top = at(2, 1.0)
    block = brick(
        "block", 3, (-1, -1, 0), (1, 1, 1), held=((top, (0, 1, 2)),), push=(top, (0, 0, -0.01))
    )
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    foot = sc.Contact(
        block.surface(at(2, 0.0)), floor, friction=sc.Coulomb(0.1), sliding=sliding, name="foot"
    )
    motions = [((0, 0, 0), (0, 0, angle), (0, 0, 0)) for angle in (0.0, turn)]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = list(
            sc.ContactSolver(block, foot).history([{"motion": {"floor": motion}} for motion in motions])
        )[-1]
    words = " ".join(str(w.message) for w in caught if w.category is sc.ContactWarning)
    return result, result.moment((0, 0, 0))[2] / result.force[2], words


def test_a_floor_that_turns_under_a_block():
    """Small sliding drags along the chord: half a turn has no torque, where all points slip round."""
    known = drilled(np.pi, "finite")[1]
    assert known > 0.05
    for turn in (0.1, 0.3, np.pi, 2 * np.pi):
        result, torque, words = drilled(turn, "small")
        # arc and chord of a circle of radius one, an angle of half the turn between them
        chord = 2 * abs(np.sin(turn / 2))
        off = np.sqrt(turn**2 + chord**2 - 2 * turn * 2 * np.sin(turn / 2) * np.cos(turn / 2)) / turn
        drift = result.validity.contacts["foot"].drift
        assert drift.off_arc == pytest.approx(off, rel=1e-6)
        told = off > 0.1
        assert ("friction points the wrong way" in words) == told == (not result.validity.holds)
        assert told or torque == pytest.approx(known, rel=0.02)
        if turn > 3:
            assert abs(torque) < 0.01 * known
    assert not drilled(np.pi, "finite")[2]


def test_rolling_of_a_ball_on_a_block():
    """A sphere moved aside by its radius of contact: gaps and normals are not what they were."""
    block = brick("block", 8, (-1, -1, -1), (1, 1, 0), held=((at(2, -1.0), (0, 1, 2)),))
    ball = sc.RigidSphere((0, 0, 2.0), 2.0, name="ball")
    solver = sc.ContactSolver([block], [sc.Contact(block.surface(at(2, 0.0)), ball, name="joint")])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        steps = [{"motion": {"joint": (0, 0, -0.05)}}, {"motion": {"joint": (0.3, 0, -0.05)}}]
        first, second = solver.history(steps)
    assert len(caught) == 1 and "gaps are wrong by up to" in str(caught[0].message)
    assert first.validity.holds and first.validity.worst < 1
    drift = second.validity.contacts["joint"].drift
    # the normal has turned by s / R; small sliding knows that gaps change in proportion with s, not
    # their s² / 2 R
    assert drift.tilt == pytest.approx(0.15, rel=0.1)
    assert drift.gap_error == pytest.approx(0.3**2 / 4, rel=0.12)


def test_a_rigid_body_is_followed_like_an_obstacle():
    """The same with the ball as a body of its own: moved by its DOFs, the same drift."""
    block = brick("block", 8, (-1, -1, -1), (1, 1, 0), held=((at(2, -1.0), (0, 1, 2)),))
    found = []
    shape = sc.RigidSphere((0, 0, 2.0), 2.0, name="ball")
    names = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
    ball = sc.RigidBody(shape, D=names, name="ball")
    for rigid in (True, False):
        contact = sc.Contact(block.surface(at(2, 0.0)), ball if rigid else shape, name="joint")
        solver = sc.ContactSolver([block, ball] if rigid else [block], [contact])
        moved = {"x": {"ball": {"x": 0.1, "z": -0.05}}}
        (result,) = solver.history([moved if rigid else {"motion": {"joint": (0.1, 0, -0.05)}}])
        drift = result.validity.contacts["joint"].drift
        found.append([drift.slip, drift.tilt, drift.gap_error, drift.approach])
    # of an obstacle the path of its surface counts, of a body the motion that the answer has
    np.testing.assert_allclose(found[0], found[1], rtol=0.05)


def test_an_overlap_that_no_pairing_sees():
    """A block runs into a wall that no contact has: by 0.1, and the search from outside says so."""
    low = brick("low", 2, (0, 0, -1), (2, 1, 0), held=((at(2, -1.0), (0, 1, 2)),))
    top = at(2, 1.0)
    wall = cube("quad4", 2, lambda x: np.array([[1.1], [0.0], [0.0]]) + x)
    both = fem_join(low, wall)
    block = brick(
        "block", 3, (0, 0.1, 0), (1.2, 0.9, 1), held=((top, (0, 1, 2)),), push=(top, (0, 0, -0.01))
    )
    contact = sc.Contact(
        block.surface(at(2, 0.0)),
        both.surface(lambda x: np.isclose(x[2], 0) & (x[0] < 1.05)),
        method="node",
        name="joint",
    )
    result, said = quiet(sc.ContactSolver([block, both], [contact]))
    assert "overlap" in said
    validity = result.validity  # said already
    part = validity.contacts["joint"]
    assert part.overlap == pytest.approx(0.1, rel=0.1)
    assert ("overlap", "joint") in validity.problems and validity.holds is False


def fem_join(low, wall):
    """A body of two meshes that do not touch, held at its lowest and its rightmost side."""
    import skfem as fem

    plain = fem.MeshHex.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 3), np.linspace(0, 1, 3))
    floor = type(plain)(np.array([[1.0], [1], [1]]) * plain.p + np.array([[0.0], [0], [-1]]), plain.t)
    p = np.hstack([floor.p, wall.p])
    mesh = fem.MeshHex(p, np.hstack([floor.t, wall.t + floor.p.shape[1]]))
    held = (at(2, -1.0), (0, 1, 2)), (at(0, 2.1), (0, 1, 2))
    return elastic(mesh, "quad4", "both", held=held)


def test_a_closed_point_opened_and_a_body_turned():
    """Displacements spoiled on purpose: the true gap, the strain and the rotation grow with them."""
    result, _ = quiet(dragged((0.0, 0.0)))
    answer = answer_of(result)
    before = result.validity
    block = result.system.bodies[0]
    u = result.u.copy()
    part = result.system.slice(block)
    node = result.contacts[0].secondary.dofs[np.argmax(result["joint"].normal_force)]
    u[part.start + node[2]] += 0.02
    opened = spoiled(answer, u)
    assert opened.contacts["joint"].opening == pytest.approx(0.02, rel=0.05)
    assert before.contacts["joint"].opening < 1e-12

    turn = Rotation.from_rotvec([0.0, 0.15, 0.0]).as_matrix() - np.eye(3)
    x = block.dof_points
    u = result.u.copy()
    u[part] += np.einsum("nd,nd->n", turn[block.dof_component], x - [0.5, 0.5, 0.5])
    turned = spoiled(answer, u)
    # the skew part of a turn is its sine
    assert turned.rotation["block"] == pytest.approx(np.sin(0.15), rel=0.05)
    assert ("rotation", "block") in turned.problems
    # the lower side, at 0.5 below the middle and 0.5 long to each side, dips into the track
    assert turned.contacts["joint"].overlap > 0.05
    stretched = spoiled(answer, result.u + pulled(block, part, result.u))
    assert stretched.strain["block"] == pytest.approx(0.2, rel=0.1)
    assert ("strain", "block") in stretched.problems


def pulled(block, part, u):
    """Of a stretch by 0.2 along z, about the lower side."""
    out = np.zeros_like(u)
    out[part] = np.where(block.dof_component == 2, 0.2 * block.dof_points[:, 2], 0.0)
    return out


def spoiled(answer, u):
    wrong = replace(answer)
    vars(wrong)["u"] = u
    wrong.diagnostics = replace(answer.diagnostics, meetings={})  # what the step has measured
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sc.answers.ContactResult(wrong).validity


def test_a_support_that_turns_its_body_is_a_rotation():
    """A block whose top is turned by 0.2 rad about the vertical: said in the step."""
    top = at(2, 1.0)
    block = brick("block", 2, (0, 0, 0), (1, 1, 1), held=((top, (0, 1, 2)),))
    solver = sc.ContactSolver(
        [block], [sc.Contact(block.surface(at(2, 0.0)), sc.RigidPlane((0, 0, 0), (0, 0, 1)))]
    )
    turn = Rotation.from_rotvec([0, 0, 0.2]).as_matrix() - np.eye(3)
    arm = block.dof_points - [0.5, 0.5, 0.0]
    x = np.einsum("nd,nd->n", turn[block.dof_component], arm) - 0.01 * (block.dof_component == 2)
    result, said = quiet(solver, x={"block": x})
    assert "has turned by 0.199" in said  # its skew part is the sine
    assert ("rotation", "block") in result.validity.problems


# -- the parts ------------------------------------------------------------------------------------


@every_kind
@pytest.mark.every_value
@pytest.mark.parametrize("seed", [0, 1])
def test_depths_in_a_box(kind, seed):
    """Of a unit cube, turned in space: the distance from the nearest side, inside and outside."""
    turn = Rotation.random(random_state=seed).as_matrix()
    mesh = cube(kind, 2)
    mesh = type(mesh)(turn @ mesh.doflocs, mesh.t)
    box = boundary(body(mesh, kind), np.zeros(body(mesh, kind).n))
    x = np.random.default_rng(seed).uniform(-0.5, 1.5, (500, 3))
    inside = np.all((x > 0) & (x < 1), axis=1)
    outward = np.linalg.norm(np.maximum(np.maximum(-x, x - 1), 0.0), axis=1)
    expected = np.where(inside, -np.minimum(x, 1 - x).min(axis=1), outward)
    np.testing.assert_allclose(box.signed(x @ turn.T), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(box.depth(x @ turn.T), np.maximum(-expected, 0.0), rtol=0, atol=1e-12)
    assert inside.any() and not inside.all()


def test_points_on_the_grid_of_a_mesh():
    """Aligned with edges and corners of the triangles, where a ray along an axis would hit them."""
    solid = body(cube("quad4", 4), "quad4")
    shape = boundary(solid, np.zeros(solid.n))
    t = np.linspace(0.125, 0.875, 7)
    x = np.stack(np.meshgrid(t, t, t), axis=-1).reshape(-1, 3)
    assert shape.inside(x).all() and not shape.inside(x + [1.0, 0, 0]).any()
    expected = np.minimum(x, 1 - x).min(axis=1)
    np.testing.assert_allclose(shape.depth(x), expected, rtol=0, atol=1e-12)


def test_displacements_move_the_boundary():
    """A cube shifted by its displacement."""
    solid = body(cube("quad8", 1), "quad8")
    u = np.where(solid.dof_component == 0, 2.0, 0.0)
    shape = boundary(solid, u)
    assert shape.inside(np.array([[2.5, 0.5, 0.5], [0.5, 0.5, 0.5]])).tolist() == [True, False]


@every_kind
def test_curvature_of_a_ball_and_of_a_plane(kind):
    """1 / R along every tangent of a ball, zero on a plane."""
    ball = body(cube(kind, 4, lambda x: 2.0 * onto_ball(x)), kind).surface(None)
    K = curvatures(ball)
    size = np.linalg.eigvalsh(K)
    # along the normal nothing; edges of the mapped cube bend the grid, not the ball
    np.testing.assert_allclose(np.abs(size).min(axis=1), 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.median(size[:, 1:]), 0.5, rtol=0.03)
    flat = body(cube(kind, 2), kind).surface(at(2, 1.0))
    assert not curvatures(flat).any()


def test_beyond_a_corner_is_beyond_the_rim():
    """The corner of a triangle is as far from both sides: the one counts that the point is out of.

    Behind an acute corner a point may be on the inner side of the line of one of them.
    """
    rng = np.random.default_rng(0)
    x = np.array([[0.0, 0, 0], [1, -0.2, 0], [1, 0.2, 0]])
    for turn in Rotation.from_rotvec(rng.normal(size=(50, 3))).as_matrix():
        start, end = x @ turn.T, np.roll(x, -1, axis=0) @ turn.T
        rim = Rim(np.stack([start, end], axis=1), np.cross(end - start, turn[:, 2]))
        points = np.array([[-0.1, 0.0, 0], [-0.1, 0.3, 0], [-0.1, -0.3, 0], [0.9, 0.0, 0]]) @ turn.T
        away = np.linalg.norm(points[:3], axis=1)
        np.testing.assert_allclose(rim.beyond(points), [*away, -0.1], rtol=1e-12)


def test_the_way_to_the_rim():
    """Of a square: inside negative, beyond positive, past a corner the distance from it."""
    rim = Rim.of(body(cube("quad4", 3), "quad4").surface(at(2, 1.0)))
    x = np.array(
        [[0.5, 0.5, 1.0], [0.9, 0.5, 1.0], [1.25, 0.5, 1.0], [1.3, 1.4, 1.0], [0.5, -0.1, 1.0]]
    )
    np.testing.assert_allclose(rim.beyond(x), [-0.5, -0.1, 0.25, 0.5, 0.1], rtol=0, atol=1e-12)
    assert np.all(rim.at_least(x) <= np.abs(rim.beyond(x)) + 1e-12)
    ball = Rim.of(body(cube("quad4", 2, onto_ball), "quad4").surface(None))
    assert np.all(np.isinf(ball.at_least(x)))
    # level with the corner of a square hole, from where both of its sides are equally far
    x = np.linspace(-3, 3, 7)
    plate = fem.MeshHex.init_tensor(x, x, [0.0, 1.0])
    plate = plate.restrict(plate.elements_satisfying(lambda x: abs(x[:2]).max(axis=0) > 1))
    rim = Rim.of(body(plate, "quad4").surface(at(2, 1.0)))
    level = np.array([[1.8, 1.0 + side, 1.0] for side in (-1e-6, 0.0, 1e-6)])
    np.testing.assert_allclose(rim.beyond(level), -0.8, rtol=1e-9)


def test_a_body_that_turns_as_it_slides_far():
    """With finite sliding the surface tells the rotation, by its polar factor, whatever the axis."""
    top = at(2, 1.0)
    block = brick("block", 2, (0, 0, 0), (1, 1, 1), held=((top, (0, 1, 2)),))
    floor = brick("floor", 3, (-1, -1, -1), (2, 2, 0), held=((at(2, -1.0), (0, 1, 2)),))
    contact = sc.Contact(
        block.surface(at(2, 0.0)), floor.surface(at(2, 0.0)), sliding="finite", name="joint"
    )
    solver = sc.ContactSolver([block, floor], [contact])
    turn = Rotation.from_rotvec([0, 0, 0.2]).as_matrix() - np.eye(3)
    arm = block.dof_points - [0.5, 0.5, 0.0]
    x = np.einsum("nd,nd->n", turn[block.dof_component], arm) - 0.01 * (block.dof_component == 2)
    result, said = quiet(solver, x={"block": x})
    assert "has turned by 0.19" in said  # strained by the turn, the lower side is a little behind
    assert result.rotations["block"] == pytest.approx(0.2, rel=0.03)
    assert result.rotations["floor"] == pytest.approx(0.0, abs=0.01)
    part = result.validity.contacts["joint"]
    # it follows: nothing overlaps but what is pressed in
    assert part.excess < 1 and part.opening < 1e-3 and part.drift.small_sliding_holds


def test_a_support_knows_the_motion_of_its_body():
    """A rigid motion of the held side is found as it is, and moves all other points with it."""
    top = at(2, 1.0)
    block = brick("block", 2, (0, 0, 0), (1, 1, 1), held=((top, (0, 1, 2)),))
    support = Support.of(block, 0)
    shift, spin = np.array([0.1, -0.2, 0.3]), np.array([0.01, 0.02, -0.03])
    every = shift + np.cross(spin, block.dof_points)
    x = every[np.arange(block.n), block.dof_component]
    motion = support.motion(x)
    np.testing.assert_allclose(support.at(block.dof_points, motion), every, rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion[3:] / support.arm, spin, rtol=0, atol=1e-12)
    unit, up = support.unit_at(block.dof_points), np.tile([0.0, 0.0, 1.0], (block.n, 1))
    assert support.free.shape == (6, 0) and support.holds(unit, up)


def test_what_tall_bodies_take_up():
    """Between its support and the plane a column of height 4 takes up all of the approach."""
    top = at(2, 4.0)
    column = brick(
        "column", 4, (0, 0, 0), (1, 1, 4), held=((top, (0, 1, 2)),), push=(top, (0, 0, -0.01))
    )
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    result = sc.ContactSolver([column], [sc.Contact(column.surface(at(2, 0.0)), floor)]).solve()
    (drift,) = answer_of(result).diagnostics.drifts
    assert drift.approach == pytest.approx(0.01, rel=1e-6)
    assert drift.strain == pytest.approx(0.0025, rel=0.2)


def test_slips_of_friction_are_vectors_less_what_obstacles_give():
    """Whatever the tangents: slip (1, 2, 0), of which the obstacle has given 0.5 along the first."""
    contact = dragged((0.0, 0.0)).solve().contacts[0]
    pairing = pair(contact)
    track = Track(contact, pairing, np.zeros(len(pairing.gap)))
    m = len(pairing.gap)
    given = np.tile([0.5, 0.0], (m, 1))
    still, closed = np.zeros((m, 3)), np.ones(m, dtype=bool)
    vectors = np.tile([1.0, 2.0, 0.0], (m, 1))
    slip, spread = track.slip(vectors, given, still, closed)
    np.testing.assert_allclose(slip, [1.0, 2.0, 0.0] - 0.5 * pairing.tangent[:, 0])
    assert spread == pytest.approx(0.0, abs=1e-15)
    still[0] = [-0.3, -0.4, 0.0]  # supports drag the first one back
    assert track.slip(vectors, given, still, closed)[1] == pytest.approx(0.5)


@pytest.mark.parametrize("numbers", [(5, 7), (3, 4)])
def test_curved_faces_of_second_order_do_not_overlap(numbers, recwarn):
    """Rings of curved 27-node hexahedra, glued: the overlap is that of the triangles that stand for
    their faces where it is measured, and no overlap of the bodies."""
    bodies = []
    for (a, b), n, name in zip(((10.0, 20.0), (20.0, 35.0)), numbers, ("inner", "outer"), strict=True):
        sides = {
            "inside": lambda x, a=a: x[0] == a,
            "outside": lambda x, b=b: x[0] == b,
            "start": lambda x: x[1] == 0,
            "end": lambda x: x[1] == np.pi / 2,
            "flat": lambda x: (x[2] == 0) | (x[2] == 2),
        }
        steps = np.linspace(a, b, 2), np.linspace(0, np.pi / 2, n + 1), np.linspace(0, 2, 2)
        flat = fem.MeshHex.init_tensor(*steps).with_boundaries(sides)
        mesh = fem.MeshHex2.from_mesh(flat)
        r, turn, z = mesh.doflocs
        places = np.stack([r * np.cos(turn), r * np.sin(turn), z])
        mesh = replace(mesh, doflocs=places, _boundaries=flat.boundaries)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex2()), intorder=4)
        held = [
            basis.get_dofs(s).all(u) for s, u in (("start", "u^2"), ("end", "u^1"), ("flat", "u^3"))
        ]
        steel, D = linear_elasticity(*lame_parameters(210e3, 0.3)), np.concatenate(held)
        bodies.append(sc.Body(basis, steel, D=D, name=name))
    inside, outside = bodies
    facets = fem.FacetBasis(outside.basis.mesh, outside.basis.elem, facets="outside", intorder=4)
    squeeze = fem.LinearForm(lambda v, w: -100.0 * dot(w.n, v)).assemble(facets)
    joint = sc.Contact(inside.surface("outside"), outside.surface("inside"), tied=True)
    solver = sc.ContactSolver(bodies, joint)
    result = solver.solve(f={"outer": squeeze})
    assert not [w for w in recwarn if "overlap" in str(w.message)]
    assert result.validity.holds


def test_boundaries_are_compared_once_for_the_warning_and_the_measure():
    """What a step has measured of the overlaps of two solids its validity does not measure again."""
    result, _ = quiet(dragged((0.0, 0.0)))
    answer = answer_of(result)
    seen = answer.diagnostics.meetings[0]
    answer.diagnostics = replace(answer.diagnostics, meetings={0: replace(seen, overlap=0.25)})
    with pytest.warns(sc.ContactWarning, match="overlap by up to 0.25"):
        assert result.validity.contacts["joint"].overlap == 0.25
