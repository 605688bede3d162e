"""Manufactured solution with stick and slip (M1): errors, orders, resultants, dissipation.

Unit square on y = 0 with exact displacements on its other three sides. The contact surface ends in
two nodes that are also prescribed: their reactions can not be divided between contact and support,
so resultants are compared over the half-cells of all other nodes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import POSES, UPRIGHT, Pose, block_basis, elastic, field, in_axes

import skfem_contact as sc
from skfem_contact.reference import ManufacturedSlip

UPPER = ManufacturedSlip()
# the same tractions on y = 0 without any motion there: a foundation to slip on, of any material
LOWER = ManufacturedSlip(E=0.6, nu=0.2, c=0.0)
MESHES = (16, 32, 64)
INNER = slice(1, -1)


def square(exact, n, y, *, kind="Q1", pose=UPRIGHT, name="square", free="bottom"):
    """A unit square that carries the exact body force, and the exact motion on three sides."""
    basis = block_basis(np.linspace(0, 1, n + 1), y, kind=kind, pose=pose)
    turn = pose.matrix

    def body_force(v, w):
        local = exact.body_force(np.einsum("ji,j...->i...", turn, w.x))
        return np.einsum("ij,j...,i...", turn, local, v)

    # polynomials of degree 4 at most, times linear shape functions
    f = fem.LinearForm(body_force).assemble(fem.Basis(basis.mesh, basis.elem, intorder=5))
    sides = {"left", "right", "bottom", "top"} - {free}
    D = np.unique(np.concatenate([basis.get_dofs(side).all() for side in sides]))
    x = field(basis, exact.displacement, pose)
    return sc.Body(basis, elastic(exact.E, exact.nu), f=f, D=D, x=x, name=name)


def error(result, name, exact, pose=UPRIGHT):
    """Relative nodal L2 error of the displacement of one body."""
    body = result.system.bodies[result.system.index(name)]
    true = field(body.basis, exact.displacement, pose)
    return np.linalg.norm(result.displacement(name) - true) / np.linalg.norm(true)


def problem(n, kind="Q1", pose=UPRIGHT, **settings):
    body = square(UPPER, n, np.linspace(0, 1, n + 1), kind=kind, pose=pose)
    floor = sc.RigidPlane(pose.turn((0, 0)), pose.turn((0, 1)))
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(UPPER.mu))
    return sc.ContactSolver([body], [contact], **settings)


@lru_cache
def on_plane(n, kind="Q1", pose=UPRIGHT):
    return problem(n, kind, pose).solve()


def tractions(result, pose=UPRIGHT):
    """Abscissae, pressure and shear traction (towards -x) in the local frame, by position."""
    values = in_axes(result.values[0], pose)
    force = values["forces"] / values["area"][:, None]
    return values["points"][:, 0], force[:, 1], -force[:, 0], values


def orders(errors):
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def nodal_integrals(function, n):
    """Integrals over y = 0 with the shape functions of the inner contact nodes, and of the ends."""
    points, weights = np.polynomial.legendre.leggauss(4)
    x = (np.arange(n)[:, None] + 0.5 * (points + 1)) / n
    ends = np.clip(1 - n * x, 0, 1) + np.clip(1 - n * (1 - x), 0, 1)
    values = 0.5 / n * weights * function([x, 0 * x])
    return np.sum((1 - ends) * values), np.sum(ends * values)


@pytest.mark.every_value
@pytest.mark.parametrize("pose", [UPRIGHT, Pose(33.0)], ids=str)
@pytest.mark.parametrize(("kind", "factor"), [("Q1", 1.0), ("P1", 3.0)])
def test_M1_displacement_is_of_second_order(kind, factor, pose):
    """Displacements with stick, slip and Dirichlet corners converge as in smooth elasticity."""
    errors = [error(on_plane(n, kind, pose), "square", UPPER, pose) for n in MESHES]
    # an independent Q4 code has 2.1e-4 at n = 32; linear triangles are known to be 3 times worse
    assert errors[1] <= 3e-4 * factor
    # second order less what the stick-slip joint, one element wide, takes on these meshes
    assert orders(errors).min() >= 1.85


@pytest.mark.parametrize(("kind", "finest"), [("Q1", 32), ("P1", 64)])
def test_M1_tractions(kind, finest):
    """Pressure and shear traction of every node converge to p and to its stick-slip law."""
    errors_p, errors_t = [], []
    for n in MESHES:
        x, p, tau, _ = tractions(on_plane(n, kind))
        errors_p.append(np.abs(p - UPPER.pressure([x]))[INNER].max() / UPPER.p0)
        errors_t.append(np.abs(tau - UPPER.traction([x]))[INNER].max() / UPPER.p0)
    at = MESHES.index(finest)
    # three parts in a thousand of p0: a wrong tributary area at one node would cost 0.5 of it
    assert errors_t[at] <= 3e-3
    assert errors_p[at] <= 4e-3
    # consistent nodal forces of a smooth traction are its values up to h²
    assert orders(errors_p).min() >= 1.5
    assert orders(errors_t).min() >= 1.5


@pytest.mark.parametrize("kind", ["Q1", "P1"])
def test_M1_slip_and_status(kind):
    """Points beyond x0 slide to +x by S(x), those well before it do not move at all."""
    n = 64
    x, p, tau, values = tractions(on_plane(n, kind))
    status, slip = values["status"][INNER], values["slip"][INNER, 0]
    x, p, tau = x[INNER], p[INNER], tau[INNER]
    assert np.all(status[x < UPPER.x0] == 1)
    assert_allclose(slip[status == 1], 0.0, atol=1e-14)
    # sliding is detected where S exceeds the error of the displacements, 2e-5 here at worst:
    # c (x - x0)^4 does so from x0 + 0.18 on
    assert np.all(status[x > UPPER.x0 + 0.18] == 2)
    assert np.all(slip[status == 2] > 0)
    # slip is a displacement: second order, three times worse for triangles
    assert_allclose(slip, UPPER.slip([x]), rtol=0, atol=1e-3 * UPPER.slip([1.0]))
    assert_allclose(tau[status == 2], UPPER.mu * p[status == 2], rtol=1e-12)


@pytest.mark.parametrize("kind", ["Q1", "P1"])
def test_M1_resultants(kind):
    """Resultant pressure and friction converge, less what the corners hold."""
    for n in MESHES:
        result = on_plane(n, kind)
        N, at_ends = nodal_integrals(UPPER.pressure, n)
        assert_allclose(N + at_ends, 0.0125, rtol=1e-9)
        T, at_ends = nodal_integrals(UPPER.traction, n)
        assert_allclose(T + at_ends, 4.735466667e-3, rtol=1e-6)
        # resultants are reactions, quadratic in h; the Lamé constants and widths are of order one
        assert_allclose(result.force[1], N, rtol=1.5 / n**2)
        assert_allclose(-result.force[0], T, rtol=1.5 / n**2)
        # equilibrium, the law, and the balance with what the plane takes
        assert result.certificate.worst <= 1e-11


def test_M1_dissipation():
    """A load that grows in proportion dissipates half of traction times slip, in any steps."""
    errors = []
    for n in MESHES:
        work, at_ends = nodal_integrals(lambda x: 0.5 * UPPER.traction(x) * UPPER.slip(x), n)
        # the corner at x = 1, which is prescribed, holds 7 % of it at n = 64
        assert_allclose(work + at_ends, 9.02016e-7, rtol=1e-6)
        errors.append(abs(on_plane(n).dissipation / work - 1))
    # traction and slip are of second order, and nodal sums instead of integrals cost h² as well;
    # S is so curved (S''/S = 33 at x = 1) that this takes 7 h²
    assert errors[-1] <= 2e-3
    assert orders(errors).min() >= 1.85
    steps = list(problem(16).history([0.25, 0.5, 0.75, 1.0]))
    once = on_plane(16)
    # everything scales with the load, so the path is straight and the trapezoidal rule exact
    assert_allclose(steps[-1].dissipation_total, once.dissipation, rtol=1e-10)
    assert_allclose(steps[-1].u, once.u, rtol=0, atol=1e-12 * np.abs(once.u).max())


@pytest.mark.parametrize("pose", POSES[1:], ids=str)
@pytest.mark.parametrize("kind", ["Q1", "P1"])
def test_M1_turned_and_renumbered(kind, pose):
    """The square does not know how it lies in space or how its nodes are numbered."""
    here = in_axes(on_plane(16, kind, pose).values[0], pose)
    there = in_axes(on_plane(16, kind).values[0], UPRIGHT)
    # round-off of two solutions that differ in every operation
    assert_allclose(here["forces"], there["forces"], rtol=0, atol=1e-9 * UPPER.p0 / 16)
    assert_allclose(here["slip"], there["slip"], rtol=0, atol=1e-9 * UPPER.slip([1.0]))
    assert np.array_equal(here["status"], there["status"])


@pytest.mark.parametrize(
    "settings", [{"loop": "direct"}, {"linear": sc.linalg.Direct()}], ids=["direct", "sparse"]
)
def test_M1_does_not_depend_on_the_algorithm(settings):
    """The paper's loop and the sparse route find the solution of the condensed Newton loop."""
    once, other = on_plane(16), problem(16, **settings).solve()
    # the loop "direct" sticks with 1e3 times the diagonal of K: one thousandth of the slip
    scale = UPPER.slip([1.0]) * (1e-3 if "loop" in settings else 1e-8)
    assert_allclose(other.u, once.u, rtol=0, atol=scale)


def test_slip_that_is_prescribed_is_no_contradiction():
    """A block dragged by its side slips where its nodes are held, on both linear routes alike."""
    basis = block_basis(np.linspace(0, 1, 7), np.linspace(0, 1, 7))
    down = basis.get_dofs("top").all("u^2")
    across = basis.get_dofs("left").all("u^1")
    x = np.zeros(basis.N)
    x[down], x[across] = -0.01, 1e-3
    block = sc.Body(basis, elastic(1.0, 0.3), D=np.concatenate([down, across]), x=x, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1))
    contact = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.9))
    results = [
        sc.ContactSolver([block], [contact], linear=linear).solve()
        for linear in ("auto", sc.linalg.Direct())
    ]
    corner = np.argmin(results[0].points[:, 0])
    for result in results:
        # the tangent is (-1, 0); the motion is the support's, and so is the force that it takes
        assert_allclose(result.slip[corner], -1e-3, rtol=1e-12)
        assert result.certificate.worst <= 1e-10
        # it slips with mu p all the same, and not with the nothing that equilibrium asks for there
        assert result.status[corner] == 2
        assert_allclose(result.tangential_force[corner], 0.9 * result.normal_force[corner], rtol=1e-12)
    assert_allclose(results[1].u, results[0].u, rtol=0, atol=1e-10 * 0.01)


@pytest.mark.parametrize("stiffness", [np.inf, 1.0])
def test_friction_of_a_face_moved_by_its_supports(stiffness):
    """A block whose whole side is led to and fro rubs with mu p there, as its energy tells.

    Every node of the face is prescribed along the floor: friction turns with the motion, stays where
    the face rests, and the energy lost is mu N times the way.
    """
    basis = block_basis(np.linspace(0, 1, 4), np.linspace(0, 1, 4))
    across = np.append(basis.get_dofs("bottom").all("u^1"), basis.get_dofs("top").all("u^1"))
    down = basis.get_dofs("top").all("u^2")
    x = np.zeros(basis.N)
    x[down] = -0.01
    block = sc.Body(basis, elastic(1.0, 0.0), D=np.append(across, down), x=x, name="block")
    law = sc.Coulomb(0.5, stiffness=stiffness)
    contact = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    steps = []
    for way in (0.0, 0.1, 0.1, 0.3, 0.2):
        moved = x.copy()
        moved[across] = way
        steps.append({"x": {"block": moved}})
    results = list(sc.ContactSolver([block], contact).history(steps))
    N = results[0].force[1]
    share = np.array([r.force[0] for r in results]) / (0.5 * N)
    assert_allclose(share, [0.0, -1.0, -1.0, -1.0, 1.0], rtol=0, atol=1e-12)
    # a finite stiffness gives its elastic slip L/G back, twice where the motion turns
    L = 0.5 * results[0].normal_force
    plastic = [
        np.maximum(way - back * L / stiffness, 0) for way, back in ((0.1, 1), (0.2, 0), (0.1, 2))
    ]
    expected = [0.0, L @ plastic[0], 0.0, L @ plastic[1], L @ plastic[2]]
    assert_allclose([r.dissipation for r in results], expected, rtol=0, atol=1e-12 * N)
    assert all(r.certificate.worst < 1e-10 for r in results)


# -- two deformable squares ------------------------------------------------------------------------


@lru_cache
def on_square(n, lower, method):
    top = square(UPPER, n, np.linspace(0, 1, n + 1), name="top")
    low = square(LOWER, lower, np.linspace(-1, 0, lower + 1), name="low", free="top")
    contact = sc.Contact(
        top.surface("bottom"), low.surface("top"), friction=sc.Coulomb(UPPER.mu), method=method
    )
    return sc.ContactSolver([top, low], [contact]).solve()


@lru_cache
def without_contact(exact, n, y, free):
    """Relative error of one square alone under the exact tractions: as good as it gets."""
    body = square(exact, n, np.linspace(y, y + 1, n + 1), free=free)
    side = fem.FacetBasis(body.basis.mesh, body.basis.elem, facets=free, intorder=6)
    pull = fem.LinearForm(lambda v, w: np.einsum("ij...,j...,i...", exact.stress(w.x), w.n, v))
    system = fem.condense(body.K, body.f + pull.assemble(side), x=body.x, D=body.D)
    true = field(body.basis, exact.displacement)
    return np.linalg.norm(fem.solve(*system) - true) / np.linalg.norm(true)


@pytest.mark.parametrize(
    ("method", "share"),
    [("node", 1.0), pytest.param("mortar", 1.0, marks=pytest.mark.slow), ("mortar", 0.75)],
)
def test_M1_on_a_deformable_square(method, share):
    """Against a softer square, matching or (mortar) 3 elements to 4, the orders are the same."""
    results = [on_square(n, round(n * share), method) for n in MESHES]
    for name, exact in (("top", UPPER), ("low", LOWER)):
        errors = [error(result, name, exact) for result in results]
        for n, found in zip(MESHES, errors, strict=True):
            alone = without_contact(UPPER, n, 0, "bottom")
            below = without_contact(LOWER, round(n * share), -1, "top")
            # the interface adds next to nothing to what the worse of the two squares has alone
            assert found <= 1.05 * max(alone, below)
        assert orders(errors).min() >= 1.85
    x, _, tau, _ = tractions(results[-1])
    # as on the rigid plane; the prescribed corners disturb the mortar forces of their neighbours
    near = slice(2, -2)
    assert np.abs(tau - UPPER.traction([x]))[near].max() <= 3e-3 * UPPER.p0
