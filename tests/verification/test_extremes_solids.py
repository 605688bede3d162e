"""Extremes in space: every case is right, or refused by an error that names it.

Rows have numbers of their own (S1 to S10) in `benchmarks/extremes.py`.
"""

from __future__ import annotations

import itertools
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent.parent))
from solid_meshes import at, cube, elastic
from test_gates_solids import sheared_pair
from test_standing import CORNER, reference, slab, tipped

import skfem_contact as sc

METHODS = ("mortar", "node")


def sheared(E, size, mu, method="mortar", n=(3, 2), strain=1e-3, over=0.0, tolerance=1e-10):
    """Two blocks pressed, and sheared so that they stick (over < 0) or slip: tractions by formula."""
    height = size[2]
    law = sc.Coulomb(mu) if mu is not None else None
    solver, load = sheared_pair("quad4", n, method, law, E=E, size=size)
    soft = height / E[0] + height / E[1]
    d = strain * height
    p = d / soft
    # nu = 0: the shear modulus is half of Young's
    tau = (mu or 0.0) * p * min(1.0, 1.0 + over)
    U = 2 * tau * soft + max(over, 0.0) * d
    result = solver.solve(**load((U, 0.0), d, (tau, 0.0)))
    assert_allclose(result.pressure, p, rtol=tolerance)
    expected = np.tile([-tau, 0.0], (len(result.points), 1))
    assert_allclose(result.traction[:, :2], expected, rtol=0, atol=tolerance * max(tau, p))
    return result


@pytest.mark.pairwise
@pytest.mark.parametrize("ratio", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9])
@pytest.mark.parametrize("over", [-0.5, 0.5], ids=["stick", "slip"])
@pytest.mark.parametrize("method", METHODS)
def test_S1_moduli_of_two_solids(ratio, over, method):
    """Springs in series, whatever their stiffness."""
    n = (3, 2) if method == "mortar" else (2, 2)
    # the stiff one takes up a part of 1e-9 of the displacement, of which seven digits are left
    tolerance = max(1e-10, 1e-14 * max(ratio, 1 / ratio))
    sheared((ratio, 1.0), (1.0, 1.0, 1.0), 0.5, method, n, over=over, tolerance=tolerance)


@pytest.mark.every_value
@pytest.mark.parametrize("length", [1e-9, 1e-6, 1e3, 1e6])
@pytest.mark.parametrize("modulus", [1e-6, 1e11])
def test_S2_units_of_solids(length, modulus):
    """Nanometres to megametres, and any unit of stress: the same numbers times the units."""
    sheared((0.7 * modulus, modulus), (length,) * 3, 0.5, over=0.5)


@pytest.mark.every_value
@pytest.mark.parametrize("size", [(1, 1, 1e-2), (1, 1, 1e-3), (1, 1e-2, 1), (0.05, 0.05, 1)], ids=str)
@pytest.mark.parametrize("method", METHODS)
def test_S3_plates_and_bars(size, method):
    """A thousand times as wide as high, walls, and bars: uniform stress."""
    n = (3, 2) if method == "mortar" else (2, 2)
    sheared((0.7, 1.0), size, 0.3, method, n, over=-0.5, tolerance=1e-8)


@pytest.mark.every_value
@pytest.mark.parametrize("mu", [0.0, 1e-12, 1.0, 1e3])
@pytest.mark.parametrize("method", METHODS)
def test_S4_coefficients_of_friction(mu, method):
    """None, next to none, large: slip at mu p or stick."""
    n = (3, 2) if method == "mortar" else (2, 2)
    over = 0.5 if mu < 1 else -0.9999
    result = sheared((0.7, 1.0), (1.0, 1.0, 1.0), mu, method, n, over=over)
    assert np.all(result.status == (2 if mu < 1 else 1))
    if mu == 0.0:
        assert not result.tangential_force.any()


@pytest.mark.every_value
@pytest.mark.parametrize("depth", [1e-12, 1e-6, 1e-2])
@pytest.mark.parametrize("n", [(1, 2), (2, 3)], ids=str)
def test_S5_one_point(depth, n):
    """The corner of a box in a face: one condition, the force by hand."""
    box, flat = tipped(n[0], CORNER, True, depth), slab(n[1])
    solver = sc.ContactSolver([box[0], flat[0]], sc.Contact(box[1], flat[1], method="node"))
    result = solver.solve()
    tip = box[1].dofs[np.argmin(box[1].points[:, 2])]
    assert np.count_nonzero(result.normal_force) == 1
    assert_allclose(result.force[2], reference(box[0], tip[2], flat), rtol=1e-9)


@pytest.mark.parametrize("n", [(1, 8), (8, 1), (2, 7)], ids=str)
def test_S6_one_face_on_many(n):
    """One coarse face on 64 fine ones, either of them the secondary: uniform stress."""
    sheared((0.7, 1.0), (1.0, 1.0, 1.0), 0.5, n=n, over=0.5, tolerance=1e-9)


@pytest.mark.every_value
@pytest.mark.parametrize("gap", [-0.5, -1e-6, -1e-12, 0.0, 1e-12, 1e-6, 0.1, 10.0])
@pytest.mark.parametrize("method", METHODS)
def test_S7_gaps_and_overlaps(gap, method):
    """Blocks apart, or one in the other by half of it: E times what is closed over both heights."""
    blocks = []
    for name, low in (("high", gap), ("low", -1.0)):
        far = at(2, low + (1.0 if name == "high" else 0.0))
        mesh = cube("quad4", 2, lambda x, low=low: x + np.array([[0.0], [0.0], [low]]))
        blocks.append(elastic(mesh, "quad4", name, nu=0.0, held=((far, (0, 1, 2)),)))
    sides = blocks[0].surface(at(2, gap)), blocks[1].surface(at(2, 0.0))
    with warnings.catch_warnings():  # half of a block is a large strain
        warnings.simplefilter("ignore", sc.ContactWarning)
        result = sc.ContactSolver(blocks, sc.Contact(*sides, method=method)).solve()
    # coordinates near one carry 1e-16
    assert_allclose(result.pressure, max(-gap, 0.0) / 2, rtol=1e-9, atol=1e-15)
    if gap > 1e-9:
        assert not result.normal_force.any()


@pytest.mark.parametrize("angle", [1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
def test_S8_edges_that_are_nearly_parallel(angle):
    """Equal squares turned by a hair: pieces of the interface are slivers; the pressure is uniform."""
    blocks = []
    for name, low, n in (("high", 0.0, 3), ("low", -1.0, 3)):
        turn = Rotation.from_rotvec([0, 0, angle if name == "high" else 0.0]).as_matrix()
        place = np.array([[-0.5], [-0.5], [low]])
        mesh = cube("quad4", n, lambda x, turn=turn, place=place: turn @ (x + place))
        far = at(2, 1.0 if name == "high" else -1.0)
        push = (far, (0.0, 0.0, -1e-3)) if name == "high" else None
        blocks.append(elastic(mesh, "quad4", name, nu=0.0, held=((far, (0, 1, 2)),), push=push))
    sides = [block.surface(at(2, 0.0)) for block in blocks]
    result = sc.ContactSolver(blocks, sc.Contact(*sides)).solve()
    # corners that stick out are carried by what is beside them: by the angle
    assert_allclose(result.pressure, 0.5e-3, rtol=20 * angle + 1e-10)
    # of the square a part of angle / 2 is not covered
    assert_allclose(result.force[2], 0.5e-3, rtol=angle + 1e-10)


@pytest.mark.parametrize("cycles", [20, pytest.param(1000, marks=pytest.mark.slow)])
def test_S9_cycles(cycles):
    """To and fro between full slip on either side: every loop is the first, to the last digits."""
    solver, load = sheared_pair("quad4", (1, 1), "node", sc.Coulomb(0.5), E=(0.7, 1.0))
    soft = 1 / 0.7 + 1.0
    p = 1e-3 / soft
    tau = 0.5 * p
    U = 2 * tau * soft + 1e-3
    there, back = load((U, 0.0), 1e-3, (tau, 0.0)), load((-U, 0.0), 1e-3, (-tau, 0.0))
    lost, first = [], None
    for i, result in enumerate(
        solver.history(itertools.islice(itertools.cycle((there, back)), 2 * cycles))
    ):
        sign = -1.0 if i % 2 == 0 else 1.0
        assert_allclose(result.traction[:, 0], sign * tau, rtol=1e-9)
        if i % 2 == 0:
            lost.append(result.dissipation_total)
            first = result.slip_vector if first is None else first
            assert_allclose(result.slip_vector, first, rtol=0, atol=1e-9 * np.abs(first).max())
    # of each loop: the bound times the way there and back, less what is elastic
    assert_allclose(np.diff(lost), 4 * tau * (U - 2 * tau * soft), rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_S10_nothing_to_touch(method, refused):
    """Surfaces that look away from each other: refused by name."""
    one = elastic(cube("quad4", 1), "quad4", "one", held=((at(2, 1.0), (0, 1, 2)),))
    place = np.array([[5.0], [0.0], [-1.0]])
    other = elastic(cube("quad4", 1, lambda x: x + place), "quad4", "other")
    with refused(sc.errors.InputError, match="points of surface 'one/"):
        sc.ContactSolver(
            [one, other], sc.Contact(one.surface(at(2, 0.0)), other.surface(at(2, 0.0)), method=method)
        )


def test_S10_elements_turned_inside_out(refused):
    """A hexahedron whose faces fold over: refused with the face."""
    mesh = fem.MeshHex().refined(1)
    p = mesh.p.copy()
    p[:, np.flatnonzero(np.all(p == 0.0, axis=0))] = 0.9
    basis = fem.Basis(fem.MeshHex(p, mesh.t), fem.ElementVector(fem.ElementHex1()), intorder=2)
    with refused(sc.errors.InputError, match="fold over"):
        sc.Body(basis, np.eye(basis.N), name="cube").surface(None)
