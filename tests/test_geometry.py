"""How far a pairing is from that of its own answer: gaps, and where contact forces go."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix, identity, kron

import skfem_contact as sc


def block(x, y, name, D, angle=0.0):
    """A rectangle turned by an angle, with sides named as they were before."""
    mesh = fem.MeshQuad.init_tensor(np.asarray(x, float), np.asarray(y, float)).with_defaults()
    c, s = np.cos(angle), np.sin(angle)
    turned = fem.MeshQuad(np.array([[c, -s], [s, c]]) @ mesh.p, mesh.t)
    basis = fem.Basis(turned.with_boundaries(mesh.boundaries), fem.ElementVector(fem.ElementQuad1()))
    return sc.Body(basis, linear_elasticity(), D=D, name=name)


def slid_on(angle):
    """One facet on a track of facets of length one, and slid along it by 0.2: node by node."""
    track = block([-1, 0, 1, 2, 3], [-1, 0], "track", "bottom", angle)
    punch = block([0.25, 1.25], [0, 1], "punch", "top", angle)
    contact = sc.Contact(
        punch.surface("bottom"),
        track.surface("top"),
        friction=sc.Coulomb(0.5),
        sliding="finite",
        method="node",
    )
    solver = sc.ContactSolver([track, punch], [contact])
    u = np.zeros(solver.system.n)
    way = 0.2 * np.array([np.cos(angle), np.sin(angle)])
    u[solver.system.slice("punch")] = way[punch.dof_component]
    case = solver._answering.reader.unloaded()
    return solver.geometry, solver.kin, solver.geometry.at(u, case)


@pytest.fixture(scope="module")
def slid():
    return slid_on(0.0)


def state(normal, tangential):
    return SimpleNamespace(
        status=np.array([2, 2]),
        normal_force=np.array(normal),
        tangential_force=np.array(tangential)[:, None],
    )


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 3.0])
def test_forces_that_move_to_other_nodes(slid, share):
    """A slip of 0.2 facets moves 0.2 of a point's forces to the next node, friction like pressure.

    On a flat track the normal forces are those along y, friction those along x; a law of a user's own
    may have friction that is larger than the pressure.
    """
    geometry, old, new = slid
    found = geometry.mismatch(old, new, state([1.0, 0.0], [share, 0.0]))
    assert_allclose(found, 0.2 * max(share, 1.0), rtol=1e-12)


def test_gaps_count_where_no_force_moves(slid):
    """Without forces only gaps are left, and there are none."""
    geometry, old, new = slid
    assert geometry.mismatch(old, new, state([0.0, 0.0], [0.0, 0.0])) == 0.0


def test_friction_and_pressure_are_the_parts_of_one_force():
    """On a track inclined by 0.5 the force on a point is ``p n - tau t``, and 0.2 of it move on."""
    geometry, old, new = slid_on(0.5)
    normal, tangent = np.array([-np.sin(0.5), np.cos(0.5)]), -np.array([np.cos(0.5), np.sin(0.5)])
    for friction in (0.5, -0.5):
        found = geometry.mismatch(old, new, state([1.0, 0.0], [friction, 0.0]))
        assert_allclose(found, 0.2 * np.abs(normal - friction * tangent).max(), rtol=1e-9)


@pytest.mark.parametrize("friction, worst", [(0.5, 0), (3.0, 1)])
def test_the_point_whose_force_moves_most_is_named(slid, friction, worst):
    """One point carries pressure, the other friction, and 0.2 of each go to the next node."""
    geometry, old, new = slid
    assert geometry.least_settled(old, new, state([1.0, 0.0], [0.0, friction])) == worst


# Solids


@pytest.fixture(scope="module")
def slid_in_space():
    """A face of length one on a track of such faces, slid along it by 0.2: node by node."""
    bodies = []
    for name, x, z, held in (
        ("track", [-1, 0, 1, 2, 3], [-1, 0], 0),
        ("punch", [0.25, 1.25], [0, 1], 1),
    ):
        mesh = fem.MeshHex.init_tensor(*(np.array(v, float) for v in (x, [0, 1], z))).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
        D = basis.get_dofs(mesh.facets_satisfying(lambda x, at=z[held]: np.isclose(x[2], at)))
        bodies.append(sc.Body(basis, linear_elasticity(), D=D, name=name))
    sides = [
        body.surface(body.basis.mesh.facets_satisfying(lambda x: np.isclose(x[2], 0.0)))
        for body in bodies[::-1]
    ]
    contact = sc.Contact(*sides, friction=sc.Coulomb(0.5), sliding="finite", method="node")
    solver = sc.ContactSolver(bodies, [contact])
    u = np.zeros(solver.system.n)
    u[solver.system.slice("punch")] = np.array([0.2, 0.0, 0.0])[bodies[1].dof_component]
    case = solver._answering.reader.unloaded()
    return solver.geometry, solver.kin, solver.geometry.at(u, case)


def other_tangents(kin, angle):
    """The same pairing with tangents turned about the normals."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    tangent = np.einsum("jk,ikd->ijd", turn, kin.tangent)
    rows = kron(identity(kin.m), turn) @ kin.B_t
    return replace(kin, tangent=tangent, tangential=lambda: csr_matrix(rows))


def space_state(normal, tangential):
    return SimpleNamespace(
        status=np.full(4, 2), normal_force=np.array(normal), tangential_force=np.array(tangential)
    )


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 2])
def test_in_space_the_choice_of_tangents_is_no_change(slid_in_space, angle):
    """On a flat track 0.2 of a force moves on, whatever tangents friction is along afterwards."""
    geometry, old, new = slid_in_space
    turned = other_tangents(new, angle)
    friction = np.zeros((4, 2))
    friction[1] = 0.3, -0.4
    along = friction[1] @ old.tangent[1]
    assert geometry.mismatch(old, old, space_state([1.0] * 4, friction)) == 0.0
    assert_allclose(
        geometry.mismatch(old, other_tangents(old, angle), space_state([1.0] * 4, friction)),
        0.0,
        atol=1e-15,
    )
    found = geometry.mismatch(old, turned, space_state([0.0, 1.0, 0.0, 0.0], friction))
    assert_allclose(found, 0.2 * max(1.0, np.abs(along).max()), rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize("friction, worst", [(0.5, 0), (3.0, 2)])
def test_in_space_the_point_whose_force_moves_most_is_named(slid_in_space, angle, friction, worst):
    """One point carries pressure, the other friction along the second tangent."""
    geometry, old, new = slid_in_space
    tau = np.zeros((4, 2))
    tau[2, 1] = friction
    local = space_state([1.0, 0.0, 0.0, 0.0], tau)
    assert geometry.least_settled(old, other_tangents(new, angle), local) == worst
