"""Edges of two solids that cross: depth, place and direction, from positions and normals alone."""

from __future__ import annotations

import internals
import numpy as np
import pytest
import skfem as fem
from scipy.spatial.transform import Rotation
from solid_meshes import body

from skfem_contact.answers import crossings, sharp_edges_of

Edges = internals.beside(crossings, "Edges")


def ridge(normals, ends, room=1.0):
    """One edge between two faces with these normals."""
    normals = np.array(normals, dtype=float)
    return Edges(
        ends=np.array([[0, 1]]),
        corners=np.zeros((1, 2, 4), dtype=int),
        face=np.array([[0, 1]]),
        normal=(normals / np.linalg.norm(normals, axis=1)[:, None])[None],
        points=np.array([ends], dtype=float),
        room=np.array([room]),
    )


LOW = [(-1, 0, 0), (1, 0, 0)]
HIGH = [(0, -1, -0.1), (0, 1, -0.1)]
UP = [(0, 1, 1), (0, -1, 1)]
DOWN = [(1, 0, -1), (-1, 0, -1)]


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, -1.1, 0.7)])
@pytest.mark.parametrize("first", [1, -1])
@pytest.mark.parametrize("second", [1, -1])
def test_direction_and_order_of_the_ends_do_not_matter(first, second, turn):
    """A roof under a roof turned over, crossing by a tenth: the same from wherever edges begin."""
    R = Rotation.from_rotvec(turn).as_matrix()
    one = ridge(np.array(UP) @ R.T, np.array(LOW[::first]) @ R.T)
    other = ridge(np.array(DOWN) @ R.T, np.array(HIGH[::second]) @ R.T)
    depth, place, across = crossings(one, other)
    np.testing.assert_allclose(depth, [0.1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(place, [R @ [0, 0, -0.05]], rtol=0, atol=1e-12)
    np.testing.assert_allclose(across, [R @ [0, 0, 1]], rtol=0, atol=1e-12)
    depth, _, across = crossings(other, one)
    np.testing.assert_allclose(depth, [0.1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(across, [R @ [0, 0, -1]], rtol=0, atol=1e-12)


def test_edges_that_do_not_face_each_other_do_not_cross():
    """Of either body the direction across has to lead out between its two faces."""
    sideways = [(1, 0, 1), (1, 0, -1)]  # a body to the left of its edge
    assert len(crossings(ridge(UP, LOW), ridge(sideways, HIGH))[0]) == 0
    sideways = [(0, 1, 1), (0, 1, -1)]
    assert len(crossings(ridge(sideways, LOW), ridge(DOWN, HIGH))[0]) == 0
    # past the end of one of them, deeper than their room, and parallel
    beside = [(2.5, -1, -0.1), (2.5, 1, -0.1)]
    assert len(crossings(ridge(UP, LOW), ridge(DOWN, beside))[0]) == 0
    assert len(crossings(ridge(UP, LOW, room=0.05), ridge(DOWN, HIGH))[0]) == 0
    assert len(crossings(ridge(UP, LOW), ridge(UP, [(-1, 0, -0.1), (1, 0, -0.1)]))[0]) == 0


@pytest.mark.parametrize("turn", np.linspace(0.0, 0.7, 8))
def test_16_faces_to_the_circle_have_no_sharp_edges(turn):
    """Only the edges at which a quarter of a wall ends are sharp, however it is turned."""
    mesh = fem.MeshHex.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 1, 2), np.linspace(0, 1, 3))
    angle, radius = turn + 0.5 * np.pi * mesh.p[0], 1 + mesh.p[1]
    place = np.array([-radius * np.cos(angle), radius * np.sin(angle), mesh.p[2]])
    wall = body(fem.MeshHex(place, mesh.t), "quad4", name="wall")
    outside = wall.surface(lambda x: np.hypot(x[0], x[1]) > 1.9, name="outside")
    edges = sharp_edges_of(outside)
    # four below, four above, two at either side
    assert len(edges.face) == 12 and np.all((edges.face < 0).any(axis=1))
