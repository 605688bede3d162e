"""Uniform states of stress: the contact patch test (P1) and uniform shear (P2), exact on any mesh.

Sources: P1 Taylor and Papadopoulos 1991; Code_Aster SSNP121; MOOSE `simple_contact_rz`. P2 is the
series of springs of `skfem_contact.reference.uniform_shear`.
"""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scenes import (
    POSES,
    UPRIGHT,
    block_basis,
    contact_of,
    elastic,
    field,
    in_axes,
    stress_load,
)
from scipy.sparse import bmat, csr_matrix
from scipy.sparse.linalg import spsolve
from skfem.helpers import ddot, sym_grad
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.reference import uniform_shear

EXACT = 1e-10  # round-off of a direct solution on a mesh of this size, with four digits to spare
SIDES = ["left", "right"]
KINDS = ["Q1", "P1"]


def even(n: int) -> np.ndarray:
    return np.linspace(0.0, 1.0, n + 1)


# -- P1: the contact patch test -------------------------------------------------------------------


def two_blocks(n, kind, nu, *, E=2e6, U0=-0.1, support="roller", pose=UPRIGHT, method="node", mu=None):
    """SSNP121: two blocks of height 1, squeezed by the prescribed motion U0 of the top."""
    low = block_basis(even(n[0]), even(3), kind=kind, pose=pose)
    top = block_basis(even(n[1]), 1 + even(4), kind=kind, pose=pose)

    def exact(x):  # plane strain, free to expand to the sides
        eps = U0 / 2
        return np.array([-nu / (1 - nu) * eps * x[0], eps * x[1]])

    bodies = []
    for basis, side, name in ((low, "bottom", "low"), (top, "top", "top")):
        D = basis.get_dofs(side)
        if support == "roller":  # free of shear; one node stops the translation
            corner = basis.nodal_dofs[
                0, np.argmin(np.hypot(basis.mesh.p[0], basis.mesh.p[1] - 2 * (name == "top")))
            ]
            D = np.append(D.all("u^2"), corner)
        bodies.append(sc.Body(basis, elastic(E, nu), D=D, x=field(basis, exact, pose), name=name))
    friction = None if mu is None else sc.Coulomb(mu)
    contact = sc.Contact(
        bodies[1].surface("bottom"), bodies[0].surface("top"), friction=friction, method=method
    )
    result = sc.ContactSolver(bodies, [contact]).solve()
    return result, exact, E / (1 - nu**2) * abs(U0) / 2


@pytest.mark.pairwise
@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize("nu", [0.0, 0.3])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "method"), [((5, 5), "node"), ((5, 5), "mortar"), ((5, 8), "mortar")])
def test_P1_uniform_pressure_is_transmitted_exactly(n, method, kind, nu, mu):
    """Squeezed blocks are in uniform compression, friction or not, and every node has its share."""
    result, exact, p = two_blocks(n, kind, nu, method=method, mu=mu)
    assert_allclose(result.pressure, p, rtol=EXACT)
    assert_allclose(result.normal_force.sum(), p, rtol=EXACT)
    assert_allclose(result.tangential_force, 0.0, atol=EXACT * p)
    for body in result.system.bodies:
        assert_allclose(
            result.displacement(body.name), field(body.basis, exact), rtol=0, atol=EXACT * 0.1
        )


def test_P1_numbers_of_SSNP121():
    """The numbers of Code_Aster SSNP121: pressure 1e5, the interface goes down by 0.05."""
    result, _, _ = two_blocks((5, 5), "Q1", 0.0, support="fixed", mu=0.3)
    assert_allclose(result.pressure, 1e5, rtol=EXACT)
    low = result.system.bodies[0]
    top = low.basis.get_dofs("top").all("u^2")
    assert_allclose(result.displacement("low")[top], -0.05, rtol=EXACT)


@pytest.mark.every_value
@pytest.mark.parametrize("pose", POSES[1:], ids=str)
@pytest.mark.parametrize("kind", KINDS)
def test_P1_turned_and_renumbered(kind, pose):
    """The patch test does not know how the scene lies in space or how its nodes are numbered."""
    # the base and the top carry the displacement of the exact solution: rollers can not be turned
    for n, method in (((5, 5), "node"), ((5, 8), "mortar")):
        here, _, p = two_blocks(n, kind, 0.3, support="exact", pose=pose, method=method, mu=0.3)
        there, _, _ = two_blocks(n, kind, 0.3, support="exact", method=method, mu=0.3)
        assert_allclose(here.pressure, p, rtol=EXACT)
        a, b = in_axes(here.values[0], pose), in_axes(there.values[0], UPRIGHT)
        # 1e-9: ten times the round-off of two solutions that differ in every operation
        assert_allclose(a["forces"], b["forces"], rtol=0, atol=1e-9 * p)


def inclined_blocks(sigma, n, kind, method, mu, angle=30.0, pose=UPRIGHT, E=1.0, nu=0.3):
    """A rectangle of height 2 cut in two at an angle, loaded by one stress state on all sides."""
    slope = np.tan(np.radians(angle))

    def cut(lower):
        def shape(x):
            line = 1.0 + slope * (x[0] - 0.5)
            y = x[1] * line if lower else 2.0 - (2.0 - x[1]) * (2.0 - line)
            return np.array([x[0], y])

        return shape

    low = block_basis(even(n[0]), even(4), kind=kind, shape=cut(True), pose=pose)
    top = block_basis(even(n[1]), 1 + even(4), kind=kind, shape=cut(False), pose=pose)
    compliance = (1 + nu) / E * (sigma - nu * np.trace(sigma) * np.eye(2))
    bodies = []
    for basis, end, name in ((low, "bottom", "low"), (top, "top", "top")):
        f = stress_load(basis, [*SIDES, end], sigma, pose)
        # one end moves as the exact solution: no reaction but the stress itself
        D = basis.get_dofs(end) if name == "low" or mu is None else None
        x = field(basis, lambda x: compliance @ x, pose) if D is not None else None
        bodies.append(sc.Body(basis, elastic(E, nu), f, D=D, x=x, name=name))
    contact = sc.Contact(
        bodies[1].surface("bottom"),
        bodies[0].surface("top"),
        friction=None if mu is None else sc.Coulomb(mu),
        method=method,
    )
    result = sc.ContactSolver(bodies, [contact]).solve()
    a = np.radians(angle)
    normal, tangent = np.array([-np.sin(a), np.cos(a)]), np.array([-np.cos(a), -np.sin(a)])
    traction = sigma @ -normal  # on the upper body
    return result, traction @ normal, traction @ tangent, compliance


@pytest.mark.pairwise
@pytest.mark.parametrize("pose", [POSES[0], POSES[1], POSES[3], POSES[5]], ids=str)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "method"), [((5, 5), "node"), ((5, 7), "mortar")])
def test_P1_inclined_interface(n, method, kind, pose):
    """Across an interface at 30 degrees a state without shear on it passes, frictionless."""
    a = np.radians(30.0)
    R = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    sigma = R @ np.diag([-2e-3, -1e-2]) @ R.T
    result, p, tau, strain = inclined_blocks(sigma, n, kind, method, None, pose=pose)
    assert abs(tau) < 1e-15
    assert_allclose(result.pressure, p, rtol=EXACT)
    for body in result.system.bodies:
        u = field(body.basis, lambda x: strain @ x, pose)
        assert_allclose(result.displacement(body.name), u, rtol=0, atol=EXACT * np.abs(u).max())


@pytest.mark.pairwise
@pytest.mark.parametrize("pose", [POSES[0], POSES[1], POSES[3], POSES[5]], ids=str)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "method"), [((5, 5), "node"), ((5, 7), "mortar")])
def test_P1_inclined_interface_held_by_friction(n, method, kind, pose):
    """Uniaxial stress across a cut at 30 degrees is carried by friction above tan(30 degrees)."""
    sigma = np.diag([0.0, -1e-2])
    result, p, tau, strain = inclined_blocks(sigma, n, kind, method, 0.58, pose=pose)
    assert_allclose(abs(tau) / p, np.tan(np.radians(30.0)), rtol=1e-14)
    assert (result.status == 1).all()
    assert_allclose(result.pressure, p, rtol=EXACT)
    assert_allclose(result.tangential_force[:, 0] / result.area, tau, rtol=EXACT)
    for body in result.system.bodies:
        u = field(body.basis, lambda x: strain @ x, pose)
        assert_allclose(result.displacement(body.name), u, rtol=0, atol=EXACT * np.abs(u).max())


@pytest.mark.parametrize("kind", KINDS)
def test_P1_inclined_interface_gives_way_below_tan_30(kind):
    """The same column has no equilibrium with a coefficient just below tan(30 degrees)."""
    with pytest.raises(sc.errors.NoEquilibrium, match="'top'"):
        inclined_blocks(np.diag([0.0, -1e-2]), (5, 5), kind, "node", 0.577)


def axisymmetric_form(E, nu):
    """Elasticity per full turn: the hoop strain u_r/r, weight 2 pi r."""
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))

    @fem.BilinearForm
    def form(u, v, w):
        r = w.x[0]
        eu, ev, hu, hv = sym_grad(u), sym_grad(v), u[0] / r, v[0] / r
        trace_u, trace_v = eu[0, 0] + eu[1, 1] + hu, ev[0, 0] + ev[1, 1] + hv
        return 2 * np.pi * r * (lam * trace_u * trace_v + 2 * G * (ddot(eu, ev) + hu * hv))

    return form


@pytest.mark.pairwise
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize(("n", "method"), [((4, 4), "node"), ((4, 6), "mortar")])
def test_P1_axisymmetric_numbers_of_MOOSE(n, method, kind, mu):
    """A core in a sleeve under pressure 100: u_r = -7e-5 r, u_z = 6e-5 z, 100 between them."""
    E, nu, p = 1e6, 0.3, 100.0
    ring = lambda x: 2 * np.pi * x[0]  # noqa: E731
    core = block_basis(even(3), even(n[0]), kind=kind)
    sleeve = block_basis(1 + even(3), even(n[1]), kind=kind)
    outer = fem.FacetBasis(sleeve.mesh, sleeve.elem, facets="right", intorder=4)
    f = fem.LinearForm(lambda v, w: -p * 2 * np.pi * w.x[0] * v[0]).assemble(outer)
    axis = [core.get_dofs("left").all("u^1"), core.get_dofs("bottom").all("u^2")]
    bodies = [
        sc.Body(core, axisymmetric_form(E, nu), D=axis, measure=ring, name="core"),
        sc.Body(
            sleeve,
            axisymmetric_form(E, nu),
            f,
            D=sleeve.get_dofs("bottom").all("u^2"),
            measure=ring,
            name="sleeve",
        ),
    ]
    friction = None if mu is None else sc.Coulomb(mu)
    contact = sc.Contact(
        bodies[1].surface("left"), bodies[0].surface("right"), friction=friction, method=method
    )
    result = sc.ContactSolver(bodies, [contact]).solve()
    assert_allclose(result.pressure, p, rtol=EXACT)
    assert_allclose(result.normal_force.sum(), p * 2 * np.pi, rtol=EXACT)
    for body in bodies:
        u = field(body.basis, lambda x: np.array([-7e-5 * x[0], 6e-5 * x[1]]))
        assert_allclose(result.displacement(body.name), u, rtol=0, atol=EXACT * 1e-4)


def layer_stress(body, u, nu, E):
    """Vertical stress in the middle of every element and the height of that middle."""
    basis = body.basis
    middle = fem.Basis(basis.mesh, basis.elem, intorder=1)
    w = middle.interpolate(u)
    e = sym_grad(w)
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    stress = lam * (e[0, 0] + e[1, 1]) + 2 * G * e[1, 1]
    return stress.mean(axis=-1), middle.global_coordinates()[1].mean(axis=-1)


def loaded_blocks(n, kind, nu, p, method="node"):
    """Two blocks of height 1 under the dead load p on top; the base moves as it would alone."""
    low = block_basis(even(n[0]), even(n[0]), kind=kind)
    top = block_basis(even(n[1]), 1 + even(n[1]), kind=kind)
    strain = -p * (1 - nu**2)  # E = 1

    def exact(x):
        return np.array([-nu / (1 - nu) * strain * x[0], strain * x[1]])

    f = stress_load(top, "top", np.diag([0.0, -p]))
    still = top.get_dofs("left").all("u^1")[:1]
    bodies = [
        sc.Body(low, elastic(1.0, nu), D="bottom", x=field(low, exact), name="low"),
        sc.Body(top, elastic(1.0, nu), f, D=still, x=field(top, exact), name="top"),
    ]
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), method=method)
    return sc.ContactSolver(bodies, [contact]), contact, exact


def point_to_line_forces(system, contact):
    """Forces of node-to-segment contact, all points closed, by interpolation and multipliers.

    Independent of the library's search, elimination and condensation: flat surfaces only.
    """
    top, low = contact.secondary, contact.primary
    rows = np.zeros((len(top.points), system.n))
    order = np.argsort(low.points[:, 0])
    for i, (x, _) in enumerate(top.points):
        rows[i, system.offsets[1] + top.dofs[i, 1]] = 1.0
        for j, node in enumerate(order):
            hat = np.interp(x, low.points[order, 0], np.eye(len(order))[j])
            rows[i, low.dofs[node, 1]] -= hat
    free = np.setdiff1d(np.arange(system.n), system.D)
    C = csr_matrix(rows[:, free])
    f = system.f - system.K @ system.x
    saddle = bmat([[system.K[free][:, free], -C.T], [C, None]]).tocsc()
    solution = spsolve(saddle, np.concatenate([f[free], -rows @ system.x]))
    return solution[len(free) :]


@pytest.mark.every_value
@pytest.mark.parametrize("nu", [0.0, 0.3])
@pytest.mark.parametrize("kind", KINDS)
def test_P1_node_to_segment_errs_near_other_meshes_only(kind, nu):
    """On non-matching meshes node-to-segment gives the exact force and errs near the interface."""
    p, n = 1e-3, (24, 32)
    solver, contact, exact = loaded_blocks(n, kind, nu, p)
    result = solver.solve()
    # equilibrium of the upper block, whatever the discretisation
    assert_allclose(result.force, [0.0, p], rtol=1e-12, atol=1e-12 * p)
    # the local error is that of the method: the same as from rows written down by hand. 1e-9: the
    # saddle-point matrix is solved by plain LU, at a condition number of 1e6
    by_hand = point_to_line_forces(result.system, contact)
    assert_allclose(result.normal_force, by_hand, rtol=1e-9)
    error = np.abs(result.pressure / p - 1)
    assert 0.02 < error.max() < 0.1  # one mesh on another of 3/4: 8 percent at the ends
    for body, count in zip(result.system.bodies, n, strict=True):
        u = result.displacement(body.name) - field(body.basis, exact)
        depth = np.abs(body.basis.mesh.p[1] - 1) * count
        far = body.basis.nodal_dofs[1, depth > 1.5]
        # two elements away the displacement is right to 0.1 percent of the total compression
        assert np.abs(u[far]).max() < 1e-3 * 2 * p * (1 - nu**2)
        # stress is a derivative, and the end of the interface a corner: its error is 5 percent in
        # the first layer, 1.5 in the third, falls by a third at least per layer until it is small,
        # and is below 0.1 percent half a block away
        error, depth = layer_stress(body, result.displacement(body.name), nu, 1.0)
        layer = np.floor(np.abs(depth - 1) * count).astype(int)
        peak = np.array([np.abs(error[layer == k] / -p - 1).max() for k in range(12)])
        assert peak[0] < 0.06
        assert (peak[2:5] < 0.7 * peak[1:4]).all()
        assert peak[11] < 1e-3


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [(4, 8), (4, 12)])
def test_P1_node_to_segment_is_exact_on_nested_meshes(n, kind):
    """Where every primary node meets a secondary one node-to-segment passes the patch test."""
    result = loaded_blocks(n, kind, 0.3, 1e-3)[0].solve()
    assert_allclose(result.pressure, 1e-3, rtol=EXACT)


@pytest.mark.parametrize(
    ("mesh", "element"),
    [
        (fem.MeshQuad, fem.ElementQuad2),
        (fem.MeshTri, fem.ElementTriP1),
        (fem.MeshTet, fem.ElementTetP1),
    ],
)
def test_stiffness_of_these_tests_is_that_of_scikit_fem(mesh, element):
    """The form that all scenes here are made with, against the library's own."""
    basis = fem.Basis(mesh().refined(1), fem.ElementVector(element()))
    K = linear_elasticity(*lame_parameters(2.0, 0.3)).assemble(basis)
    assert abs(elastic(2.0, 0.3).assemble(basis) - K).max() < 1e-14 * abs(K).max()


# -- P2: uniform shear ----------------------------------------------------------------------------


class Shear:
    """One block on a rigid plane, or two, pressed by d and sheared by U at the top; nu = 0.

    The sides carry the shear stress that makes the state uniform. It is a load, so it has to be
    known before: it is that of the closed form, and a wrong friction force shows as a non-uniform
    state with a wrong slip.
    """

    def __init__(
        self,
        layers,
        law,
        *,
        n=(4, 4),
        kind="Q1",
        pose=UPRIGHT,
        swap=False,
        method="node",
        loop="newton",
        linear="auto",
        width=1.0,
        rows=3,
    ):
        self.layers, self.law, self.pose, self.swap = layers, law, pose, swap
        bodies, height = [], 0.0
        for i, (H, E) in enumerate(layers):
            basis = block_basis(width * even(n[i]), height + H * even(rows), kind=kind, pose=pose)
            below = i == 0 and len(layers) == 2
            bodies.append(
                sc.Body(basis, elastic(E, 0.0), D="bottom" if below else "top", name=f"block {i}")
            )
            height += H
        self.bodies = bodies
        settings = {"friction": law, "method": method, "name": "joint"}
        secondary = bodies[-1].surface("bottom")
        if len(layers) == 2:
            self.contact = contact_of(secondary, bodies[0].surface("top"), swap=swap, **settings)
        else:
            floor = sc.RigidPlane(pose.turn((0, 0)), pose.turn((0, 1)), name="floor")
            self.contact = sc.Contact(secondary, floor, friction=law, name="joint")
        self.solver = sc.ContactSolver(bodies, [self.contact], loop=loop, linear=linear)
        self.unit = [stress_load(b.basis, SIDES, [[0.0, 1.0], [1.0, 0.0]], pose) for b in bodies]

    def step(self, U, d, tau):
        """The load step that moves the top by (U, -d), with the shear tau on the sides."""
        top = self.bodies[-1]
        x = field(top.basis, lambda x: np.array([U + 0 * x[0], -d + 0 * x[0]]), self.pose)
        loads = {b.name: tau * f for b, f in zip(self.bodies, self.unit, strict=True)}
        return {"x": {top.name: x}, "f": loads}

    def expected(self, path, **law):
        """States of the closed form along a path of (U, d)."""
        states, plastic = [], 0.0
        for U, d in path:
            states.append(uniform_shear(d, U, self.layers, plastic_slip=plastic, **law))
            plastic = states[-1].plastic_slip
        return states

    def run(self, path, states):
        steps = [self.step(U, d, s.tau) for (U, d), s in zip(path, states, strict=True)]
        return list(self.solver.history(steps))

    def uniform(self, result):
        """Pressure, shear, slip at all points: on the upper side, along the motion of the top."""
        values = in_axes(result["joint"], self.pose)
        sign = -1.0 if self.swap else 1.0
        traction = sign * values["forces"] / values["area"][:, None]
        return traction[:, 1], -traction[:, 0], sign * values["slip"][:, 0], values["status"]

    def check(self, result, state, rtol=EXACT, slip0=0.0):
        p, tau, slip, status = self.uniform(result)
        scale = max(state.p, abs(state.tau))
        assert_allclose(p, state.p, rtol=rtol, atol=0)
        assert_allclose(tau, state.tau, rtol=rtol, atol=EXACT * scale)
        if state.status == "open":
            assert (status == 0).all()
            return
        # a length: the elastic shear itself where nothing slips
        length = max(abs(state.slip - slip0), abs(state.tau) * sum(2 * H / E for H, E in self.layers))
        assert_allclose(slip, state.slip - slip0, rtol=0, atol=rtol * length)


TWO = [(1.0, 1.0), (1.0, 0.7)]
D_STEP, MU = 1e-3, 0.5
NUMBERS = {  # U, cap, tau, slip: as printed in the problem
    "stick": (3e-4, np.inf, 6.1764705882e-5, 0.0),
    "slip": (3e-3, np.inf, 2.0588235294e-4, 2.0e-3),
    "cap": (3e-3, 1e-4, 1e-4, 2.51428571429e-3),
}


@pytest.mark.pairwise
@pytest.mark.parametrize("case", NUMBERS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "method"), [((5, 5), "node"), ((4, 8), "node"), ((4, 7), "mortar")])
@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_P2_numbers(case, kind, n, method, loop):
    """Two blocks stick, slip, or slip at the capped shear, with the printed numbers."""
    U, cap, tau, slip = NUMBERS[case]
    law = sc.Coulomb(MU, tau_max=cap, stiffness=np.inf)  # exact sticking in either loop
    shear = Shear(TWO, law, n=n, kind=kind, method=method, loop=loop)
    [state] = shear.expected([(U, D_STEP)], mu=MU, tau_max=cap)
    # the printed numbers have eleven digits
    assert_allclose(
        [state.p, state.tau, state.slip], [4.1176470588e-4, tau, slip], rtol=3e-11, atol=1e-15
    )
    [result] = shear.run([(U, D_STEP)], [state])
    shear.check(result, state)
    assert (result.status == (1 if case == "stick" else 2)).all()
    if case == "stick":
        assert_allclose(result.slip, 0.0, atol=EXACT * U)


@pytest.mark.every_value
@pytest.mark.parametrize("linear", ["condensed", sc.linalg.Direct()], ids=["condensed", "sparse"])
@pytest.mark.parametrize("swap", [False, True], ids=["", "swapped"])
@pytest.mark.parametrize("pose", POSES, ids=str)
@pytest.mark.parametrize("case", NUMBERS)
def test_P2_turned_renumbered_swapped(case, pose, swap, linear):
    """Uniform shear knows neither direction, numbering, nor which surface is called secondary."""
    U, cap, _, _ = NUMBERS[case]
    law = sc.Coulomb(MU, tau_max=cap)
    here = Shear(TWO, law, pose=pose, swap=swap, linear=linear)
    [state] = here.expected([(U, D_STEP)], mu=MU, tau_max=cap)
    [result] = here.run([(U, D_STEP)], [state])
    here.check(result, state)
    base = Shear(TWO, law)
    [reference] = base.run([(U, D_STEP)], [state])
    mine, theirs = here.uniform(result), base.uniform(reference)
    # 1e-9: ten times the round-off of two solutions that differ in every operation
    for k, scale in enumerate([state.p, state.tau, U]):
        assert_allclose(mine[k], theirs[k], rtol=0, atol=1e-9 * scale)
    assert_allclose(mine[3], theirs[3])
    for a, b in zip(here.bodies, base.bodies, strict=True):
        u = result.displacement(a.name).reshape(-1)[a.basis.nodal_dofs].T
        v = reference.displacement(b.name)[b.basis.nodal_dofs].T
        at_a, at_b = pose.back(a.basis.mesh.p.T), b.basis.mesh.p.T
        a_order, b_order = (np.lexsort(np.round(at, 9).T) for at in (at_a, at_b))
        assert_allclose(pose.back(u)[a_order], v[b_order], rtol=0, atol=1e-9 * U)


K_T = {1e-8: 7.999999e-11, 1e-4: 7.987220e-7, 1.0: 4.705882e-4, 1e4: 4.999969e-4, 1e12: 5.0e-4}


@pytest.mark.every_value
@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
@pytest.mark.parametrize("kappa", K_T)
def test_P2_tangential_stiffness_in_series(kappa, loop):
    """A tangential stiffness acts in series with the block: tau = U/(H/G + 1/k_t)."""
    h, U, d, mu = 1 / 8, 1e-3, 1e-2, 0.3
    k_t = kappa / h
    # one element wide, so that both points have the area h/2 and one stiffness is uniform
    law = sc.Coulomb(mu, stiffness=k_t * h / 2)
    shear = Shear([(1.0, 1.0)], law, n=(1,), width=h, rows=8, loop=loop)
    [state] = shear.expected([(U, d)], mu=mu, k_t=k_t)
    assert_allclose(state.tau, K_T[kappa], rtol=1e-6)  # printed with seven digits
    [result] = shear.run([(U, d)], [state])
    shear.check(result, state)


@pytest.mark.every_value
@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
@pytest.mark.parametrize("kappa", [1e-8, 1.0, 1e4, 1e12])
def test_P2_tangential_stiffness_between_two_bodies(kappa, loop):
    """Between two bodies as well, up to the digits that a stiff spring between them costs."""
    h, U, mu = 1 / 4, 3e-4, 0.5
    law = sc.Coulomb(mu, stiffness=kappa / 2)
    shear = Shear(TWO, law, n=(1, 1), width=h, rows=4, loop=loop)
    [state] = shear.expected([(U, D_STEP)], mu=mu, k_t=kappa / h)
    [result] = shear.run([(U, D_STEP)], [state])
    # tau is k_t times the difference of two displacements: 1e-16 kappa is lost
    shear.check(result, state, rtol=max(EXACT, 1e-15 * kappa))


ONE = [(1.0, 1.0)]
LIMIT = 0.3 * 1e-3  # mu p of one block with E = H = 1 pressed by 1e-3


def walk(path, *, mu=0.3, tau_max=np.inf, k_t=np.inf, pose=UPRIGHT, layers=ONE, **settings):
    """Follow a path of (U, d) and compare every state; return the results and the closed form."""
    law = sc.Coulomb(mu, tau_max=tau_max, stiffness=None if np.isinf(k_t) else k_t / 2)
    shear = Shear(layers, law, pose=pose, **settings)
    states = shear.expected(path, mu=mu, tau_max=tau_max, k_t=k_t)
    results = shear.run(path, states)
    return shear, results, states


@pytest.mark.parametrize("pose", [POSES[0], POSES[5]], ids=str)
@pytest.mark.parametrize("layers", [ONE, TWO], ids=["one", "two"])
def test_P2a_reverse_stick_then_reverse_slip(layers, pose):
    """Unloading sticks until twice the limit has been taken back, and then slips backwards."""
    d = 1e-3
    flexibility = sum(2 * H / E for H, E in layers)
    limit = 0.3 * d / sum(H / E for H, E in layers)
    turn = 2 * limit * flexibility  # DU = 2 mu p H/G
    # just before and just after it slips back, among others
    path = [(U * turn, d) for U in (1.5, 1.0, 0.5 + 1e-6, 0.5 - 1e-6, 0.2, 0.0)]
    shear, results, states = walk(path, pose=pose, layers=layers)
    assert [s.status for s in states] == ["slip", "stick", "stick", "slip", "slip", "slip"]
    for result, state in zip(results, states, strict=True):
        shear.check(result, state)
        assert (result.status == (2 if state.status == "slip" else 1)).all()
    assert_allclose(states[-1].tau, -limit, rtol=1e-14)


@pytest.mark.parametrize("pose", [POSES[0], POSES[5]], ids=str)
def test_P2b_slip_by_falling_pressure(pose):
    """At constant U the block starts to slip exactly where the pressure has fallen to tau/mu."""
    U, mu = 4e-4, 0.3
    tau = U / 2  # H/G = 2
    d = tau / mu  # p = d
    path = [(U, 2 * d), (U, d * (1 + 1e-8)), (U, d * (1 - 1e-8)), (U, 0.5 * d), (U, 0.01 * d)]
    shear, results, states = walk(path, mu=mu, pose=pose)
    assert [s.status for s in states] == ["stick", "stick", "slip", "slip", "slip"]
    for result, state in zip(results, states, strict=True):
        shear.check(result, state)
        assert (result.status == (2 if state.status == "slip" else 1)).all()


def test_P2c_the_limit_follows_the_current_pressure():
    """Pressure and shear that grow in one step: friction is mu times the pressure at its end."""
    path = [(2e-3, 1e-4), (4e-3, 1e-3), (5e-3, 2e-4)]
    shear, results, states = walk(path)
    assert [s.status for s in states] == ["slip", "slip", "slip"]
    for result, state, (_, d) in zip(results, states, path, strict=True):
        assert_allclose(state.tau, 0.3 * d, rtol=1e-14)
        shear.check(result, state)


# all of the block's width away from its partners, which is said: here it is the history that counts
@pytest.mark.filterwarnings("ignore:.*small sliding.*does not follow:skfem_contact.ContactWarning")
@pytest.mark.parametrize("layers", [ONE, TWO], ids=["one", "two"])
def test_P2d_lifting_off_forgets_friction(layers):
    """After lifting off and moving by 1 the block is pressed again without friction or slip."""
    d = 1e-3
    path = [(2e-3, d), (2e-3, -d), (1.0, -d), (1.0, d), (1.0 + 1e-4, d), (1.0 + 3e-3, d)]
    shear, results, states = walk(path, layers=layers)
    for i, (result, state) in enumerate(zip(results, states, strict=True)):
        # slip counts from where it closed: the second time at U = 1. Lengths that are differences
        # of displacements of 1 have lost three digits
        shear.check(result, state, slip0=1.0 if i > 2 else 0.0, rtol=1e-10 if i < 3 else 1e-9)
    assert_allclose(results[3].tangential_force, 0.0, atol=1e-9 * d)
    assert_allclose(results[3].slip, 0.0, atol=1e-12)
    assert_allclose(results[1].normal_force, 0.0, atol=0)
    assert_allclose(results[1].tangential_force, 0.0, atol=0)


@pytest.mark.parametrize("target", [(3e-4, 1e-3), (5e-3, 1e-3)], ids=["stick", "slip"])
@pytest.mark.parametrize("N", [3, 10])
def test_P2e_steps_do_not_matter_on_a_proportional_path(target, N):
    """Ten equal load steps end where one does."""
    U, d = target
    shear, one, states = walk([target])
    shear.check(one[0], states[0])
    path = [(U * k / N, d * k / N) for k in range(1, N + 1)]
    _, many, _ = walk(path)
    for name in ("normal_force", "tangential_force"):
        assert_allclose(getattr(many[-1], name), getattr(one[0], name), rtol=1e-12, atol=1e-12 * d)
    assert_allclose(many[-1].slip, one[0].slip, rtol=1e-12, atol=1e-12 * U)
    assert_allclose(many[-1].u, one[0].u, rtol=0, atol=1e-12 * max(U, d))
    assert_allclose(many[-1].dissipation_total, one[0].dissipation_total, rtol=1e-12, atol=1e-12 * d**2)


def test_P2_a_moving_floor_is_a_moving_block():
    """Dragging the rigid floor backwards is the same as dragging the block."""
    path = [(2e-3, 1e-3), (1e-3, 1e-3), (-1e-3, 1e-3)]
    shear, results, states = walk(path)
    steps = [
        shear.step(0.0, d, s.tau) | {"motion": {"floor": (-U, 0.0)}}
        for (U, d), s in zip(path, states, strict=True)
    ]
    for moved, result in zip(shear.solver.history(steps), results, strict=True):
        assert_allclose(moved.forces, result.forces, rtol=0, atol=1e-12 * 1e-3)
        assert_allclose(moved.slip, result.slip, rtol=0, atol=1e-12 * 1e-3)
