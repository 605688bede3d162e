"""Problems with friction of the plane, extruded one element thick: the same answers in space.

Raous' block, the manufactured solution with stick and slip, and Cattaneo and Mindlin between blocks:
the solid has the plane mesh at both ends, no displacement across it, and half of every load at each.
A ring in sectors is the axisymmetric one, to the order of the mesh.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parent.parent))
from smooth_contacts import Blocks
from solid_meshes import elastic_form
from test_manufactured import UPPER, square
from test_rings import axisymmetric
from test_structures import RAOUS, raous

import skfem_contact as sc

HEIGHT = 0.37


class Extruded:
    """A plane body of 4-node quadrilaterals, and the solid."""

    def __init__(self, plane, E, nu, height=HEIGHT):
        self.plane, self.height = plane, height
        flat = plane.basis.mesh
        n = flat.nvertices
        low, high = flat.t, flat.t + n
        t = np.stack([low[0], high[0], low[3], low[1], high[3], high[1], low[2], high[2]])
        p = np.vstack([np.hstack([flat.p] * 2), np.repeat([0.0, height], n)])
        mesh = fem.MeshHex(p, t)
        self.basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=4)
        # DOFs of the solid at each DOF of the plane, at both ends
        self.at = np.empty((2, plane.n), dtype=int)
        for end in range(2):
            for i in range(2):
                self.at[end, plane.basis.nodal_dofs[i]] = self.basis.nodal_dofs[
                    i, end * n : (end + 1) * n
                ]
        D = np.concatenate([self.at[:, plane.D].ravel(), self.basis.nodal_dofs[2]])
        self.body = sc.Body(
            self.basis,
            elastic_form(E, nu),
            self.load(plane.f),
            D=D,
            x=self.moved(plane.x),
            name=plane.name,
        )

    def load(self, f):
        """Nodal loads of the solid."""
        out = np.zeros(self.basis.N)
        for at in self.at:
            out[at] = 0.5 * self.height * f
        return out

    def moved(self, u):
        """Displacements of the solid."""
        out = np.zeros(self.basis.N)
        for at in self.at:
            out[at] = u
        return out

    def side(self, name):
        """The faces over a named boundary of the plane mesh."""
        facets = self.plane.basis.mesh.boundaries[name]
        middle = self.plane.basis.mesh.p[:, self.plane.basis.mesh.facets[:, facets]].mean(axis=1)
        tree = cKDTree(np.vstack([middle, np.full(middle.shape[1], self.height / 2)]).T)
        mesh = self.basis.mesh
        faces = mesh.boundary_facets()
        x = mesh.p[:, mesh.facets[:, faces]].mean(axis=1).T
        return self.body.surface(faces[tree.query(x)[0] < 1e-9 * np.ptp(x)], name=name)


def same(flat, solid, extruded):
    """Status, pressure, friction, gaps and slip of two results, to 1e-9; forces times the height."""
    flat, solid = flat.values[0], solid.values[0]
    at = cKDTree(flat.points).query(solid.points[:, :2])[1]
    largest = np.abs(flat.traction).max()
    assert np.count_nonzero(flat.status)
    assert_allclose(solid.traction[:, :2], flat.traction[at], rtol=0, atol=1e-9 * largest)
    assert_allclose(solid.traction[:, 2], 0.0, atol=1e-9 * largest)
    slip = np.abs(flat.slip_vector).max()
    assert_allclose(solid.slip_vector[:, :2], flat.slip_vector[at], rtol=0, atol=1e-9 * slip)
    assert_allclose(
        solid.force[:2], flat.force * extruded.height, rtol=1e-9, atol=1e-9 * abs(flat.force).max()
    )
    return at


def test_the_block_of_raous():
    """R1: sticking, slipping and lifted points, on a plane."""
    flat, *_ = raous(16)
    plane = flat.contacts[0].secondary.body
    solid = Extruded(plane, RAOUS.E, RAOUS.nu, 0.1 * RAOUS.side)
    floor = sc.RigidPlane((0, 0, 0), (0, 1, 0), name="plane")
    contact = sc.Contact(solid.side("bottom"), floor, friction=sc.Coulomb(RAOUS.mu))
    result = sc.ContactSolver(solid.body, contact).solve()
    at = same(flat, result, solid)
    assert np.array_equal(result.status, flat.status[at])
    assert set(flat.status) == {0, 1, 2}


def test_the_manufactured_solution():
    """M1: stick beside slip under exact body forces and motions of the other sides."""
    plane = square(UPPER, 16, np.linspace(0, 1, 17))
    floors = sc.RigidPlane((0, 0), (0, 1)), sc.RigidPlane((0, 0, 0), (0, 1, 0))
    law = sc.Coulomb(UPPER.mu)
    flat = sc.ContactSolver(plane, sc.Contact(plane.surface("bottom"), floors[0], friction=law)).solve()
    solid = Extruded(plane, UPPER.E, UPPER.nu)
    contact = sc.Contact(solid.side("bottom"), floors[1], friction=law)
    same(flat, sc.ContactSolver(solid.body, contact).solve(), solid)


@pytest.mark.parametrize("method", ["mortar", "node"])
def test_cattaneo_and_mindlin(method):
    """H4 between two blocks, pressed, pushed by a load that friction alone holds, and back."""

    def profile(x):
        return x[0] ** 2 / 200

    law = sc.Coulomb(0.4)
    scene = Blocks(0.25, profile, law, fine=1.5, H=6.0, width=1.0)
    plane = scene.bodies
    contact = sc.Contact(
        plane[0].surface("bottom"), plane[1].surface("top"), friction=law, gap=profile, method=method
    )
    solids = [Extruded(body, 1.0, 0.3) for body in plane]
    sides = solids[0].side("bottom"), solids[1].side("top")
    joint = sc.Contact(*sides, friction=law, gap=profile, method=method)
    flat = sc.ContactSolver(plane, contact)
    solid = sc.ContactSolver([s.body for s in solids], joint)
    lowered = scene.lowered(0.02)
    push = scene.push(0.0008)
    pressed = flat.solve(x=lowered)
    assert pressed.force[1] * 0.4 > 0.0008
    steps = [(lowered, 0.0), (lowered, 1.0), (lowered, -0.6)]

    def path(how):
        """Both bases lowered and pushed, as the bodies take it."""
        return [
            {
                "x": {"upper": how[0][0](x["upper"])},
                "f": {b.name: one[1](part * push[b.name]) for b, one in zip(plane, how, strict=True)},
            }
            for x, part in steps
        ]

    itself = [(np.array, np.array)] * 2
    one = flat.history(path(itself))
    other = solid.history(path([(s.moved, s.load) for s in solids]))
    for first, second in zip(one, other, strict=True):
        same(first, second, solids[0])
    assert {1, 2} <= set(first.status)


@pytest.mark.parametrize("kind", ["mortar", "node"])
def test_a_ring_in_sectors_is_axisymmetric(kind):
    """A rough annular foot pressed by its top on a ring: sectors of the quarter, to their order."""
    r, high, low = np.linspace(1.0, 2.0, 6), np.linspace(0, 0.8, 5), np.linspace(-0.8, 0, 5)
    wide = np.concatenate([[0.5, 0.75], r, [2.3, 2.6]])
    law, E, down = sc.Coulomb(0.3), (1.0, 0.6), -0.004
    rings = [(r, high, "foot"), (wide, low, "base")]

    def joined(bodies, where):
        foot, base = bodies
        contact = sc.Contact(
            foot.surface(where), base.surface(where), friction=law, method=kind, name="joint"
        )
        return sc.ContactSolver(bodies, contact).solve()

    plane = []
    for (x, z, name), modulus in zip(rings, E, strict=True):
        mesh = fem.MeshQuad.init_tensor(x, z)
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=4)
        far = z[-1] if name == "foot" else z[0]
        D = basis.get_dofs(lambda x, far=far: np.isclose(x[1], far)).all()
        u = np.zeros(basis.N)
        u[np.intersect1d(D, basis.nodal_dofs[1])] = down if name == "foot" else 0.0
        plane.append(
            sc.Body(
                basis,
                axisymmetric(modulus, 0.3),
                D=D,
                x=u,
                name=name,
                measure=lambda x: 2 * np.pi * x[0],
            )
        )
    flat = joined(plane, lambda x: np.isclose(x[1], 0.0))["joint"]
    scale = flat.pressure.max()
    errors = []
    for sectors in (4, 8):
        solids = []
        for (x, z, name), modulus in zip(rings, E, strict=True):
            angle = np.linspace(0, np.pi / 2, sectors + 1)
            mesh = fem.MeshHex.init_tensor(x, angle, z)
            p = np.stack([mesh.p[0] * np.cos(mesh.p[1]), mesh.p[0] * np.sin(mesh.p[1]), mesh.p[2]])
            basis = fem.Basis(fem.MeshHex(p, mesh.t), fem.ElementVector(fem.ElementHex1()), intorder=4)
            far = z[-1] if name == "foot" else z[0]
            D = [basis.get_dofs(lambda x, far=far: np.isclose(x[2], far)).all()]
            D += [
                basis.get_dofs(lambda x, i=i: np.abs(x[i]) < 1e-9).all(f"u^{i + 1}") for i in range(2)
            ]
            u = np.zeros(basis.N)
            u[np.intersect1d(D[0], basis.nodal_dofs[2])] = down if name == "foot" else 0.0
            solids.append(
                sc.Body(
                    basis, elastic_form(modulus, 0.3), D=np.unique(np.concatenate(D)), x=u, name=name
                )
            )
        solid = joined(solids, lambda x: np.isclose(x[2], 0.0))["joint"]
        radius = np.hypot(*solid.points[:, :2].T)
        at = np.abs(flat.points[:, :1] - radius).argmin(axis=0)
        assert abs(4 * solid.force[2] / flat.force[1] - 1) < 0.8 / sectors**2
        errors.append(np.abs(solid.pressure - flat.pressure[at]).max() / scale)
    assert errors[1] < 0.03 and np.log2(errors[0] / errors[1]) > 1.5, errors
