"""Motions of obstacles in space: rotation vectors, the way of a surface under a point, steps, files."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

import skfem_contact as sc
from skfem_contact.conditions import Motion
from skfem_contact.obstacles import rotation_matrix, spin

VECTORS = [(0, 0, 0), (0.3, -0.2, 0.5), (0, 0, 2.5), (1e-9, 0, 1e-9), (2.0, -3.0, 4.0), (np.pi, 0, 0)]


@pytest.mark.parametrize("vector", VECTORS)
def test_rotations_are_those_of_scipy(vector):
    """Rodrigues' formula, for no angle, tiny ones and more than a turn."""
    known = Rotation.from_rotvec(vector).as_matrix()
    # a dozen roundings of numbers up to two, by either formula, and that of an angle of up to five
    assert_allclose(rotation_matrix(np.array(vector, dtype=float)), known, rtol=0, atol=4e-15)


def test_the_spin_is_the_angular_velocity_on_the_way():
    """Against differences of rotation matrices; about a fixed axis the difference itself."""
    start, end = np.array([0.3, -0.2, 0.5]), np.array([-0.4, 0.6, 0.9])

    def velocity(s, h=1e-5):
        at = [rotation_matrix(start + (s + k * h) * (end - start)) for k in (-1, 0, 1)]
        W = (at[2] - at[0]) @ at[1].T / (2 * h)
        return np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]]) / 2

    assert_allclose(spin(start, end), quad_vec(velocity, 0, 1)[0], atol=1e-8)
    axis = np.array([1.0, 2.0, -2.0])
    assert_allclose(spin(-3.0 * axis, 5.0 * axis), 8.0 * axis, rtol=1e-14)
    tiny = 1e-9 * axis
    assert_allclose(spin(tiny, 3 * tiny), 2 * tiny, rtol=1e-14)


def test_motions_in_space():
    """Displacements, other centres, ways between motions, and how far a surface passes a point."""
    motion = Motion(np.array([0.1, 0, 0]), np.array([0.2, 0.1, -0.3]), np.array([1.0, 2.0, 3.0]))
    x = np.random.default_rng(0).normal(size=(5, 3))
    R = Rotation.from_rotvec(motion.angle).as_matrix()
    moved = (x - motion.centre) @ R.T + motion.centre + motion.translation
    assert_allclose(x + motion.shift(x), moved, atol=1e-14)
    assert_allclose(motion.about(np.zeros(3)).shift(x), motion.shift(x), atol=1e-14)
    still = Motion.none(3)
    assert not still.turns and motion.turns and np.array_equal(still.shift(x), 0 * x)
    assert_allclose(still.towards(motion, 1.0).shift(x), motion.shift(x), atol=1e-14)
    # a drum that turns thrice about its axis drags what lies on it by the length of the arc
    axis, R = np.array([0.0, 1.0, 0.0]), 0.5
    turned = Motion(np.zeros(3), 6 * np.pi * axis, np.zeros(3))
    top = np.array([[0.0, 0.3, R]])
    assert_allclose(turned.slid(still, top), [[6 * np.pi * R, 0, 0]], atol=1e-12)
    half = still.towards(turned, 0.5)
    assert_allclose(turned.slid(half, top), [[3 * np.pi * R, 0, 0]], atol=1e-12)
    assert_allclose(Motion(axis, np.zeros(3), axis).slid(still, top), [axis])


OBSTACLES = [
    sc.RigidPlane((0.2, 0.1, 1.1), (0.1, -0.2, -1.0)),
    sc.RigidCylinder((0.2, 0.0, 2.2), 1.15, axis=(1.0, 0.3, 0.1)),
    sc.RigidSphere((0.4, 0.6, 2.0), 1.02),
    sc.obstacles.LevelSet(lambda x: (x[0] - 0.2) ** 2 + 2 * x[1] ** 2 + 3 * (x[2] - 2.2) ** 2 - 4.0),
]


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda o: o.label)
def test_moving_an_obstacle_in_space_is_moving_the_body_back(obstacle):
    """Gaps to a moved obstacle are those of the oppositely moved body; normals turn along."""
    angle, centre, shift = (
        np.array([0.2, -0.4, 0.3]),
        np.array([0.3, -0.5, 0.2]),
        np.array([0.05, -0.1, 0.02]),
    )
    R = Rotation.from_rotvec(angle).as_matrix()
    body = cube()
    top = body.surface("up")
    back = (body.dof_points - shift - centre) @ R + centre - body.dof_points
    moved = obstacle.pair(top, motion=(shift, angle, centre))
    still = obstacle.pair(top.moved(back[np.arange(body.n), body.dof_component]))
    assert np.array_equal(moved.paired, still.paired) and moved.paired.any()
    on = moved.paired
    assert_allclose(moved.gap[on], still.gap[on], rtol=0, atol=1e-8)  # a level set's gradients
    assert_allclose(moved.normal[on], still.normal[on] @ R.T, rtol=0, atol=1e-8)


def cube(n=4):
    t = np.linspace(0, 1, n + 1)
    mesh = fem.MeshHex.init_tensor(t, t, t)
    mesh = mesh.with_boundaries({"up": lambda x: x[2] > 1 - 1e-9, "down": lambda x: x[2] < 1e-9})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    return sc.Body(basis, linear_elasticity(0.6, 0.4), D="down", name="cube")


def on_plane(body=None):
    body = body or cube()
    plane = sc.RigidPlane((0.5, 0.5, 1.0), (0, 0, -1), name="lid")
    return sc.ContactSolver([body], [sc.Contact(body.surface("up"), plane, method="node")])


def test_a_lid_that_tilts_presses_where_it_comes_down():
    """A plane turned about a horizontal line closes gaps by the arm, to second order in the angle."""
    solver, angle = on_plane(), 0.01
    steps = [{"motion": {"lid": ((0, 0, -0.001), (0, angle, 0), (0.5, 0.5, 1.0))}}]
    result = next(solver.history(steps))
    closed = result.status > 0
    # about +y the side of the large x goes down
    assert result.points[closed, 0].min() > 0.3 and result.points[~closed, 0].max() < 0.6
    shift = (result.points[:, 0] - 0.5) * np.sin(angle) + 0.001
    u = result.displacement("cube")[result.contacts[0].secondary.dofs]
    assert_allclose(u[closed, 2], -shift[closed], atol=1e-15)
    assert result.certificate.worst < 1e-12


def test_steps_and_files_know_rotation_vectors(tmp_path):
    """A number is no turn in space, unless zero; a saved state has the vector."""
    solver = on_plane()
    with pytest.raises(sc.errors.InputError, match="rotation vector"):
        next(solver.history([{"motion": {"lid": ((0, 0, 0), 0.1, (0, 0, 0))}}]))
    with pytest.raises(sc.errors.InputError, match="angle in radians"):
        sc.RigidPlane((0, 0), (0, 1)).moved(((0, 0), (0, 0, 0.1), (0, 0)))
    first = next(solver.history([{"motion": {"lid": ((0, 0, -0.01), 0.0, (0, 0, 0))}}]))
    assert_allclose(first.force, next(solver.history([{"motion": {"lid": (0, 0, -0.01)}}])).force)
    turned = {"motion": {"lid": ((0, 0, -0.01), (0.002, 0, 0), (0.5, 0.5, 1))}}
    second = next(solver.history([turned]))
    file = solver.save_state(tmp_path / "lid", second)
    again = on_plane()
    kept = next(again.history([{"f": {}}], start=again.load_state(file)))
    assert np.array_equal(kept.forces, second.forces) and not np.array_equal(
        first.forces, second.forces
    )


def test_what_small_sliding_does_not_follow_on_obstacles_in_space_is_said():
    """A lid turned by 0.2, a ball led aside; not where it is pressed, nor a plane shifted far."""
    body = cube()
    ball = sc.RigidSphere((0.5, 0.5, 3.0), 2.0, name="ball")
    lid = sc.RigidPlane((0.5, 0.5, 1.0), (0, 0, -1), name="lid")

    def said(shape, motion):
        solver = sc.ContactSolver([body], [sc.Contact(body.surface("up"), shape, method="node")])
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            next(solver.history([{"motion": {shape.name: motion}}]))
        return " ".join(str(w.message) for w in found)

    assert said(ball, (0, 0, -0.05)) == said(lid, (3.0, 2.0, -0.02)) == ""
    assert said(lid, ((0, 0, -0.02), (0.01, 0.02, 0.03), (0.5, 0.5, 1))) == ""
    assert "normals are off by up to 0.2 rad" in said(lid, ((0, 0, -0.02), (0.2, 0, 0), (0.5, 0.5, 1)))
    assert "gaps are wrong by up to" in said(ball, (0.3, 0, -0.02))
    # a ball that spins recedes from the points it had: nothing presses where it overlaps
    assert "100 %" in said(ball, ((0, 0, -0.02), (1.0, 0, 0), ball.centre))
