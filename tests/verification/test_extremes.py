"""Extreme inputs: what is physically right, or a clear refusal, for each; the rows X1 to X33."""

from __future__ import annotations

from dataclasses import replace

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from scenes import Pose, block_basis, elastic, field, stress_load
from sheared import Sheared

import skfem_contact as sc
from skfem_contact.reference import uniform_shear

EXACT = 1e-10  # round-off of a direct solution on a mesh of this size, with four digits to spare
SLIP = Sheared(U=3e-3)
STICK = Sheared(U=3e-4)
FLOOR = sc.RigidPlane((0, 0), (0, 1), name="floor")
LINEAR = {"auto": "auto", "sparse": sc.linalg.Direct()}


def even(n):
    return np.linspace(0.0, 1.0, n + 1)


def block_on_floor(D="top", x=None, f=None, *, n=4, E=1.0, nu=0.3, floor=FLOOR, **settings):
    """Unit square upon a rigid floor; `x` a displacement and `f` a stress on its top."""
    basis = block_basis(even(n), even(n))
    u = None if x is None else field(basis, lambda at: np.broadcast_arrays(*x, at[0])[:2])
    load = None if f is None else stress_load(basis, "top", [[0.0, f[0]], [f[0], f[1]]])
    body = sc.Body(basis, elastic(E, nu), load, D=D, x=u, name="block")
    linear = settings.pop("linear", "auto")
    contact = sc.Contact(body.surface("bottom"), floor, name="joint", **settings)
    return sc.ContactSolver(body, contact, linear=linear)


# -- stiffness, friction, units, loads ------------------------------------------------------


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("way", ["stick", "slip"])
@pytest.mark.parametrize("k", range(-8, 9))
def test_X1_moduli_of_any_ratio(k, way, linear):
    """Blocks whose moduli differ by up to 1e8 either way have the stress of two springs in series."""
    ratio = 10.0**k
    limit = 0.5 * 1e-3 / (1 + 1 / ratio)
    U = (0.6 if way == "stick" else 3.0) * limit * (2 + 2 / ratio)
    case = Sheared(U=U, layers=((1.0, 1.0), (1.0, ratio)))
    assert case.state.status == way
    # on the sparse route the contact forces are K u of the secondary side: where that is the
    # stiffer one, as many digits cancel as the ratio has
    rtol = EXACT if linear == "auto" else max(EXACT, 1e-13 * ratio)
    case.check(case.solve(linear=LINEAR[linear]), rtol)


@pytest.mark.every_value
@pytest.mark.parametrize("k", range(-8, 9, 2))
def test_X1_press_fit_of_any_ratio(k):
    """The pressure of a press fit has hub and sleeve in series, up to a sleeve that is rigid."""
    from scenes import ring_basis

    def pressure(inner, outer):
        turn = 2 * np.pi * np.arange(24) / 24
        bodies = []
        for radii, E, name in (((0.5, 0.75, 1.0), inner, "hub"), ((1.0, 1.4, 2.0), outer, "sleeve")):
            basis = ring_basis(radii, turn, closed=True)
            soft = (
                1e-9 * E * fem.BilinearForm(lambda u, v, w: u[0] * v[0] + u[1] * v[1]).assemble(basis)
            )
            bodies.append(sc.Body(basis, elastic(E, 0.3).assemble(basis) + soft, name=name))
        contact = sc.Contact(bodies[0].surface("outer"), bodies[1].surface("inner"), interference=1e-3)
        return sc.ContactSolver(bodies, [contact]).solve().pressure

    # p = delta / (C_hub / E_hub + C_sleeve / E_sleeve) holds on any mesh, with its own two numbers
    a, b = 1e-3 / pressure(1.0, 1.0).mean(), 1e-3 / pressure(1.0, 2.0).mean()
    sleeve = 2 * (a - b)
    hub = a - sleeve
    found = pressure(1.0, 10.0**k)
    # springs of 1e-9 E hold the rings in place
    assert_allclose(found, 1e-3 / (hub + sleeve / 10.0**k), rtol=1e-6)


@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
def test_X2_any_tangential_stiffness(loop):
    """Shear grows with the tangential stiffness, in series with the blocks, and never beyond mu p."""
    kappas = [1e-8, 1e-4, 1.0, 1e4, 1e8, 1e12]
    for U in (3e-4, 3e-3):
        case = Sheared(U=U, n=1, width=0.25)
        found = []
        for kappa in kappas:
            state = uniform_shear(case.d, case.U, case.layers, case.mu, k_t=kappa)
            # one element wide: both points have the same area, and the sides the shear of this state
            law = case.law(stiffness=kappa * case.width / 2)
            bodies = case.bodies()
            loads = {b.name: b.f * (state.tau / case.state.tau) for b in bodies}
            result = sc.ContactSolver(bodies, [case.contact(bodies, friction=law)], loop=loop).solve(
                loads
            )
            p, tau, _ = case.measured(result)
            # tau is kappa times a difference of displacements: eps kappa of it is lost
            rtol = max(EXACT, 1e-15 * kappa)
            assert_allclose(p, state.p, rtol=rtol)
            assert_allclose(tau, state.tau, rtol=rtol)
            # never beyond the bound, and no smaller than with a softer law: to the same digits
            assert tau.max() <= case.mu * case.state.p * (1 + rtol)
            assert tau.max() >= max(found, default=0.0) * (1 - rtol)
            found.append(tau.max())


@pytest.mark.every_value
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_X3_zero_friction_is_no_friction(loop, linear):
    """A coefficient of zero gives the frictionless answer, with shear of exactly zero."""
    case = Sheared(U=3e-3, mu=0.0)
    with_law = case.solve(loop=loop, linear=LINEAR[linear])
    without = case.solve(loop=loop, linear=LINEAR[linear], friction=None)
    assert not with_law.tangential_force.any()
    scale = np.abs(without.normal_force).max()
    assert_allclose(with_law.normal_force, without.normal_force, rtol=0, atol=1e-14 * scale)
    assert_allclose(with_law.u, without.u, rtol=0, atol=1e-14 * 3e-3)
    case.check(with_law, EXACT)


def test_X4_next_to_no_friction():
    """With mu = 1e-12 every point slips, with a friction force of mu p."""
    case = Sheared(U=1.5e-3, mu=1e-12)
    result = case.solve()
    case.check(result, EXACT)
    assert (result.status == 2).all()
    assert_allclose(np.abs(result.tangential_force[:, 0]), 1e-12 * result.normal_force, rtol=1e-6)


@pytest.mark.parametrize("mu", [1e-12, 1.0, 10.0, 1e6])
def test_X5_any_coefficient_of_friction(mu):
    """Tiny coefficients slip with mu p, large ones stick, and neither takes many iterations."""
    case = Sheared(U=1.5e-3, mu=mu)
    result = case.solve()
    case.check(result, EXACT)
    assert (result.status == (1 if case.state.status == "stick" else 2)).all()
    assert result.iterations <= 5
    assert result.certificate.friction <= EXACT


@pytest.mark.parametrize("mu", [1e-12, 1e-3, 1.0, 10.0, 1e6])
def test_X5_large_friction_on_a_block_that_lifts(mu):
    """Pushed sideways at its top, a block lifts off at one end whatever the friction; the law holds."""
    result = block_on_floor(x=(0.1, -0.02), n=6, friction=sc.Coulomb(mu)).solve()
    assert (result.status == 0).any() or mu < 1
    assert result.certificate.worst < 1e-10
    assert result.iterations <= 50


UNITS = [(-9, 0), (0, -9), (-9, 9), (-6, 12), (3, 9), (9, -9), (9, 9)]


@pytest.mark.every_value
@pytest.mark.parametrize(("length", "stress"), UNITS)
@pytest.mark.parametrize("case", [STICK, SLIP], ids=["stick", "slip"])
def test_X6_any_units(case, length, stress):
    """Nanometres or gigametres, micropascals or gigapascals: the same numbers times the units."""
    scaled = replace(case, length=10.0**length, stress=10.0**stress)
    result, reference = scaled.solve(), case.solve()
    scaled.check(result, EXACT)
    assert_array_equal(result.status, reference.status)
    assert result.iterations == reference.iterations
    # the same operations on scaled numbers; powers of ten are rounded
    assert_allclose(result.u / 10.0**length, reference.u, rtol=0, atol=1e-12 * case.U)


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize("size", [1e-30, 1e-6, 1e30])
def test_X7_any_load(size, mu, linear):
    """From conforming surfaces the answer is proportional to the load, however small or large."""

    def press(size):
        basis = block_basis(4 * even(16), even(3))
        middle = basis.get_dofs(lambda x: (x[1] == 1) & (abs(x[0] - 2) < 0.6)).all("u^2")
        f = np.zeros(basis.N)
        f[middle] = -1e-3 * size
        friction = None if mu is None else sc.Coulomb(mu)
        one = basis.nodal_dofs[0, np.argmin(np.abs(basis.mesh.p - [[2], [1]]).sum(axis=0))]
        body = sc.Body(basis, elastic(1.0, 0.3), f, D=[one], name="layer")
        contact = sc.Contact(body.surface("bottom"), FLOOR, friction=friction)
        return sc.ContactSolver(body, contact, linear=LINEAR[linear]).solve()

    one, other = press(1.0), press(size)
    assert (one.status == 0).any() and (one.status != 0).any()  # it recedes
    assert_array_equal(one.status, other.status)
    assert one.iterations == other.iterations
    assert_allclose(other.u / size, one.u, rtol=0, atol=1e-12 * np.abs(one.u).max())
    assert_allclose(
        other.normal_force / size, one.normal_force, rtol=0, atol=1e-12 * one.normal_force.max()
    )


# -- gaps, meshes ---------------------------------------------------------------------------


@pytest.mark.every_value
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("gap", [-1e-15, 0.0, 1e-15, 1e-6, 10.0, -1e-6, -1e-2])
def test_X8_any_gap(gap, linear):
    """An open gap carries exactly nothing, an overlap exactly E |g| / H."""
    result = block_on_floor(nu=0.0, gap=gap, linear=LINEAR[linear]).solve()
    if gap >= 0:
        assert not result.normal_force.any() and not result.u.any()
    else:
        assert_allclose(result.pressure, -gap, rtol=1e-9)


def test_X8_huge_interference():
    """An overlap of ten times the body is computed linearly, with a warning."""
    solver = block_on_floor(nu=0.0, interference=10.0)
    with pytest.warns(sc.ContactWarning, match=r"'joint' starts with an overlap of 10, 10 times"):
        result = solver.solve()
    assert_allclose(result.pressure, 10.0, rtol=1e-9)


# the end of the slender column slides over .8 of its facets, past the end of the other: rightly said
@pytest.mark.filterwarnings("ignore:.*small sliding:skfem_contact.ContactWarning")
@pytest.mark.every_value
@pytest.mark.parametrize(
    ("width", "rtol"),
    # a slender column bends: (H/W)^4 eps = 2e-8 of its digits go to the condition of K, where the row
    # asks for 1e-9
    [(1e4, EXACT), (1e2, EXACT), (1e-1, 1e-9), (1e-2, 2e-8)],
)
@pytest.mark.parametrize("linear", LINEAR)
def test_X9_any_aspect(width, rtol, linear):
    """Elements 1e4 times as wide as high, or slender ones, do not disturb a uniform state."""
    case = replace(SLIP, width=width)
    case.check(case.solve(linear=LINEAR[linear]), rtol)


@pytest.mark.every_value
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("n", [(2, 200), (200, 2)], ids=str)
def test_X10_meshes_of_very_different_size(n, method):
    """Facets a hundred times longer on either side: mortar is exact, nodes carry the load.

    Node by node with the coarse side secondary, three nodes dent two hundred facets between them. Under
    a load the resultant is that load all the same; but the joint is softer by a sixth, so that under a
    prescribed displacement the force is as much too small. The row's 1 % holds for the other choice.
    """
    bodies = []
    for count, y, side, down in ((n[0], 0.0, "bottom", 0.0), (n[1], 1.0, "top", -0.02)):
        basis = block_basis(even(count), y + even(3))
        x = field(basis, lambda x, down=down: [0 * x[0], down + 0 * x[0]])
        bodies.append(sc.Body(basis, elastic(1.0, 0.0), D=side, x=x, name=side))
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), method=method)
    result = sc.ContactSolver(bodies, [contact]).solve()
    if method == "mortar" or n[1] > n[0]:
        # elements 67 times as high as wide
        assert_allclose(result.pressure, 0.01, rtol=1e-9)
    else:
        # measured .836: a dent grows with the logarithm of the ratio of the facets
        assert_allclose(result.normal_force.sum(), 0.836 * 0.01, rtol=5e-3)
        top = bodies[1]
        load = stress_load(top.basis, "top", [[0.0, 0.0], [0.0, -0.01]])
        side = top.basis.get_dofs("top").all("u^1")
        free = sc.Body(top.basis, elastic(1.0, 0.0), load, D=side, name="top")
        contact = sc.Contact(free.surface("bottom"), bodies[0].surface("top"), method=method)
        loaded = sc.ContactSolver([bodies[0], free], [contact]).solve()
        assert_allclose(loaded.force, [0.0, 0.01], rtol=0, atol=EXACT * 0.01)
    assert result.certificate.worst < 1e-12


FEW = [
    0.0,
    37.5,
    90.0,
    135.0,
    180.0,
    217.5,
    270.0,
    322.5,
    90 - 1e-9,
    90 + 1e-9,
    180 - 1e-9,
    270 + 1e-9,
    89.999999,
]
OTHERS = np.setdiff1d(np.arange(0.0, 360.0, 7.5), FEW)


@pytest.mark.parametrize(
    "angles", [FEW, pytest.param(OTHERS, marks=pytest.mark.slow)], ids=["few", "many"]
)
@pytest.mark.parametrize("case", [STICK, SLIP], ids=["stick", "slip"])
def test_X11_normals_in_all_directions(case, angles):
    """The joint may lie at any angle, along an axis or a hair off it."""
    for angle in angles:
        turned = replace(case, n=2, pose=Pose(float(angle)))
        turned.check(turned.solve(), 1e-9)


def test_X11_integer_coordinates():
    """Surfaces on integer coordinates are paired and solved as all others."""
    bodies = []
    for y, side, down in ((0, "bottom", 0), (4, "top", -1)):
        mesh = fem.MeshQuad.init_tensor(np.arange(5), np.arange(y, y + 5)).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
        x = field(basis, lambda x, down=down: [0 * x[0], down + 0 * x[0]])
        bodies.append(sc.Body(basis, elastic(1.0, 0.0), D=side, x=x))
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"))
    assert_allclose(sc.ContactSolver(bodies, contact).solve().pressure, 1 / 8, rtol=EXACT)


@pytest.mark.parametrize("nu", [0.499, 0.4999, 0.49999])
def test_X12_nearly_incompressible(nu):
    """A confined block of rubber has the stiffness of its bulk: 1667.111141 E at nu = 0.4999."""
    basis = block_basis(even(4), even(4))
    D = [basis.get_dofs(["left", "right"]).all("u^1"), basis.get_dofs("top")]
    x = field(basis, lambda x: [0 * x[0], -1e-4 + 0 * x[0]])
    body = sc.Body(basis, elastic(1.0, nu), D=D, x=x)
    result = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR)).solve()
    factor = (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    if nu == 0.4999:
        assert_allclose(factor, 1667.111141, rtol=1e-9)
    assert_allclose(result.pressure, factor * 1e-4, rtol=1e-9)


# -- one point, all slip, all open, nothing at all -------------------------------------------

CLAMPED = [[1.3533216244792285, -0.4105125828971653], [0.4105125828971653, 1.3533216244792285]]


def triangle(f, mu, **settings):
    """A triangle with one free node at the origin upon the floor, its other nodes clamped."""
    mesh = fem.MeshTri(np.column_stack([[0.0, 0.0], *np.transpose(CLAMPED)]), [[0], [1], [2]])
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTriP1()))
    load = np.zeros(6)
    load[basis.nodal_dofs[:, 0]] = f
    body = sc.Body(basis, elastic(1.0, 0.3), load, D=basis.nodal_dofs[:, 1:].ravel())
    contact = sc.Contact(body.surface(None), FLOOR, friction=sc.Coulomb(mu))
    return sc.ContactSolver(body, contact, **settings), basis.nodal_dofs[:, 0]


@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize(
    ("mu", "f", "u"),
    [
        (1.0, (-1.75, -1.0), (-3.05568975, 0.1955985)),  # opens
        (1.0, (-0.9, -1.0), (0.0, 0.0)),  # sticks
        (1.4, (-1.45, -1.0), (-1.29396273, 0.0)),  # slips
    ],
)
def test_X13_one_point(mu, f, u, linear):
    """A single point on the floor takes the only one of its four states that is admissible."""
    solver, node = triangle(f, mu, linear=LINEAR[linear])
    found = solver.solve().u[node]
    K = np.array([[0.5982905983, 0.3997497208], [0.3997497208, 1.1324786325]])
    assert_allclose(found, u, rtol=0, atol=2e-8)  # printed with nine digits
    assert solver.solve().certificate.worst < 1e-12
    if u[1] > 0:
        assert_allclose(K @ found, f, rtol=1e-9)


def test_X13_stick_is_the_continuous_branch():
    """With three solutions (mu = 2) a ramped load stays on the one that it started on: stick."""
    solver, node = triangle((-1.75, -1.0), 2.0)
    for result in solver.history(np.linspace(0.1, 1.0, 10)):
        assert_allclose(result.u[node], 0.0, atol=1e-12)


def test_X13_jump_is_found_or_reported():
    """At mu = 2 a tangential load beyond 2 N leaves only separation: found, or said to be lost."""
    solver, node = triangle((-1.0, 0.0), 2.0)
    down = np.zeros(6)
    down[node] = (0, -1.0)
    side = np.zeros(6)
    side[node] = (-1.0, 0)
    last = None
    for t in (1.0, 1.9, 1.99, 2.1):
        last = solver.solve(down + t * side, start=last)
        if t < 2:
            assert_allclose(last.u[node], 0.0, atol=1e-12)
    assert last.u[node][1] > 0 and last.certificate.worst < 1e-12


@pytest.mark.parametrize("linear", LINEAR)
def test_X14_all_points_slip(linear):
    """Where every point slips the friction force is mu N, on supports that hold the body."""
    result = SLIP.solve(linear=LINEAR[linear])
    assert (result.status == 2).all()
    assert_allclose(np.abs(result.force[0]), 0.5 * result.force[1], rtol=EXACT)


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.5])
@pytest.mark.parametrize("gap", [0.0, 0.3])
def test_X15_points_that_never_touch_change_nothing(gap, mu, linear):
    """Lifted off, or out of reach, the answer is that without any contact."""
    friction = None if mu is None else sc.Coulomb(mu)
    solver = block_on_floor(
        f=(1e-3, 2e-3), x=(0.0, 0.01), gap=gap, friction=friction, linear=LINEAR[linear]
    )
    [body] = solver.system.bodies
    result = solver.solve()
    free = fem.solve(*fem.condense(body.K, body.f, D=body.D, x=body.x))
    assert (result.status == 0).all() and not result.normal_force.any()
    assert_allclose(result.u, free, rtol=0, atol=1e-12 * np.abs(free).max())


@pytest.mark.pairwise
@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.5])
@pytest.mark.parametrize("gap", [0.0, 0.1])
def test_X16_no_load_at_all(gap, mu, linear, loop):
    """Without any load nothing moves, at once and without a division by zero."""
    friction = None if mu is None else sc.Coulomb(mu)
    solver = block_on_floor(gap=gap, friction=friction, linear=LINEAR[linear])
    result = sc.ContactSolver(solver.system.bodies, solver.contacts, loop=loop).solve()
    assert result.converged and result.iterations <= 1
    assert not result.u.any() and not result.normal_force.any() and not result.slip.any()
    assert result.certificate.worst == 0.0
    assert "nan" not in result.report().replace("moment balance", "")


@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("share", [0.0, 0.5, 0.99, 1 - 1e-6])
def test_X17_held_by_friction_alone(share, linear):
    """A block that nothing but the floor supports rests under any push below mu N."""
    solver = block_on_floor(
        None, f=(share * 1e-4, -1e-3), friction=sc.Coulomb(0.1), linear=LINEAR[linear]
    )
    result = solver.solve()
    assert_allclose(result.force, [-share * 1e-4, 1e-3], rtol=0, atol=1e-12)
    assert result.certificate.worst < 1e-9


@pytest.mark.parametrize("f", [(1.01e-4, -1e-3), (0.0, 1e-3), (1e-3, 0.0)])
def test_X17_more_than_friction_holds(f, refused):
    """Pushed beyond mu N, pulled off, or pushed without pressure, it moves freely: said so."""
    solver = block_on_floor(None, f=f, friction=sc.Coulomb(0.1))
    with refused(sc.errors.NoEquilibrium, match=r"'block' is free to move: .*translation"):
        solver.solve()


# -- prescribed contact nodes, several contacts ----------------------------------------------


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize("held", ["normal", "tangential", "both", "all"])
def test_X18_prescribed_contact_nodes(held, mu, linear):
    """Prescribed contact DOFs stay where they are; the force there is their reaction."""
    basis = block_basis(even(4), even(4))
    low = basis.get_dofs("bottom")
    D = {"normal": low.all("u^2"), "tangential": low.all("u^1"), "both": low.all(), "all": basis}
    D = np.arange(basis.N) if held == "all" else np.concatenate([basis.get_dofs("top").all(), D[held]])
    x = field(basis, lambda x: [0 * x[0], -0.01 * x[1]])
    body = sc.Body(basis, elastic(1.0, 0.0), D=D, x=x, name="block")
    friction = None if mu is None else sc.Coulomb(mu)
    contact = sc.Contact(body.surface("bottom"), FLOOR, friction=friction)
    result = sc.ContactSolver(body, contact, linear=LINEAR[linear]).solve()
    assert_allclose(result.u, x, rtol=0, atol=1e-12)
    reaction = (body.K @ result.u - body.f)[low.all("u^2")].sum()
    assert_allclose(reaction, 0.01, rtol=EXACT)
    assert_allclose(result.force[1], 0.01 if held == "tangential" else 0.0, rtol=0, atol=EXACT)


@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.3])
def test_X18_prescribed_into_the_obstacle(mu, linear):
    """A prescribed displacement wins over the floor, and says by how much it is pushed into it."""
    basis = block_basis(even(4), even(4))
    D = np.concatenate([basis.get_dofs("top").all(), basis.get_dofs("bottom").all("u^2")])
    x = field(basis, lambda x: [0 * x[0], -0.01 + 0 * x[1]])
    body = sc.Body(basis, elastic(1.0, 0.0), D=D, x=x, name="block")
    friction = None if mu is None else sc.Coulomb(mu)
    contact = sc.Contact(body.surface("bottom"), FLOOR, friction=friction)
    solver = sc.ContactSolver(body, contact, linear=LINEAR[linear])
    with pytest.warns(sc.ContactWarning, match=r"push 5 of 5 points .* into 'floor', .* by 0\.01"):
        result = solver.solve()
    assert_allclose(result.u, x, rtol=0, atol=1e-14)
    assert not result.normal_force.any()
    assert_allclose(result.gap, -0.01, rtol=1e-12)


def junction(*, mu=None, order=(0, 1, 2), linear="auto", n=3):
    """Two blocks side by side on a long one, squeezed from all sides: uniform strain."""
    strain = np.array([1e-3, 2e-3])
    boxes = {
        "base": (2 * even(2 * n), even(n), [("left", 0), ("right", 0), ("bottom", 1)]),
        "west": (even(n), 1 + even(n), [("left", 0), ("top", 1)]),
        "east": (1 + even(n), 1 + even(n), [("right", 0), ("top", 1)]),
    }
    bodies = []
    for name, (x, y, held) in boxes.items():
        basis = block_basis(x, y)
        D = [basis.get_dofs(side).all(f"u^{k + 1}") for side, k in held]
        u = field(basis, lambda x: [-strain[0] * x[0], -strain[1] * x[1]])
        bodies.append(sc.Body(basis, elastic(1.0, 0.3), D=D, x=u, name=name))
    base, west, east = bodies
    # all four surfaces meet in one point, where forces are not unique: node by node they are uniform
    settings = {"friction": None if mu is None else sc.Coulomb(mu), "method": "node"}
    contacts = [
        sc.Contact(west.surface("bottom"), base.surface("top"), name="west on base", **settings),
        sc.Contact(east.surface("bottom"), base.surface("top"), name="east on base", **settings),
        sc.Contact(west.surface("right"), east.surface("left"), name="west on east", **settings),
    ]
    return sc.ContactSolver([bodies[i] for i in order], contacts, linear=linear), strain


@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.3])
def test_X19_junction_of_three_blocks(mu, linear):
    """Where three blocks meet a node is in two pairs, primary in one of them: stress stays uniform.

    At the node that all share three forces along x, one normal and two of friction, do the work of one:
    friction is not needed.
    """
    solver, (ex, ey) = junction(mu=mu, linear=LINEAR[linear])
    result = solver.solve()
    lam, G = 0.3 / (1.3 * 0.4), 1 / 2.6
    p_x, p_y = (lam + 2 * G) * ex + lam * ey, (lam + 2 * G) * ey + lam * ex
    assert_allclose(result["west on base"].pressure, p_y, rtol=EXACT)
    assert_allclose(result["east on base"].pressure, p_y, rtol=EXACT)
    assert_allclose(result["west on east"].pressure, p_x, rtol=EXACT)
    assert bool(result.undetermined) == (mu is not None)
    for values in result.values:
        assert_allclose(values.tangential_force, 0.0, rtol=0, atol=EXACT * p_y)
    for body in result.system.bodies:
        u = field(body.basis, lambda x: [-ex * x[0], -ey * x[1]])
        assert_allclose(result.displacement(body), u, rtol=0, atol=EXACT * ey)


@pytest.mark.parametrize("linear", LINEAR)
def test_X19_both_surfaces_secondary_of_one_another(linear, monkeypatch):
    """Two passes over matching surfaces ask the same twice: the displacements are those of one.

    Solvers refuse them; with that check taken away, rows that are there twice stay judged.
    """
    bodies = Sheared(U=0.0).bodies()
    a, b = bodies[1].surface("bottom"), bodies[0].surface("top")
    contacts = [sc.Contact(a, b, name="there"), sc.Contact(b, a, name="back")]
    with pytest.raises(
        sc.errors.InputError, match=r"'there' .* and 'back' .* pair the same facets, the one from"
    ):
        sc.ContactSolver(bodies, contacts, linear=LINEAR[linear])
    internals.replace(monkeypatch, "conditions.check_passes", lambda *_: None)
    two = sc.ContactSolver(bodies, contacts, linear=LINEAR[linear]).solve()
    one = sc.ContactSolver(bodies, contacts[:1]).solve()
    assert_allclose(two.u, one.u, rtol=0, atol=1e-12 * 1e-3)
    both = two["there"].force - two["back"].force
    assert_allclose(both, one.force, rtol=0, atol=EXACT * one.force[1])


@pytest.mark.parametrize("linear", LINEAR)
def test_X19_secondary_above_that_is_primary_below(linear):
    """In a stack of thin plates every plate is pressed from both sides with the same pressure."""
    bodies, contacts = [], []
    for k in range(4):
        basis = block_basis(even(3), k + even(1))
        side = {0: "bottom", 3: "top"}.get(k)
        x = field(basis, lambda x, k=k: [0 * x[0], -0.04 * (k == 3) + 0 * x[0]])
        bodies.append(sc.Body(basis, elastic(1.0, 0.0), D=side, x=x if side else None, name=f"{k}"))
        if k:
            pair = bodies[k].surface("bottom"), bodies[k - 1].surface("top")
            contacts.append(sc.Contact(*pair, friction=sc.Coulomb(0.2)))
    result = sc.ContactSolver(bodies, contacts, linear=LINEAR[linear]).solve()
    for values in result.values:
        assert_allclose(values.pressure, 0.01, rtol=EXACT)


# -- joints, ends and corners ------------------------------------------------------------------


def shifted(delta, width=3.0, n=6, method="node", **settings):
    """A unit block on a wide one, pressed and sheared by its top; moved along by `delta`."""
    low = block_basis(width * even(n), even(3))
    up = block_basis(1.0 + even(4), 1 + even(4), shape=lambda x: x + np.array([[delta], [0.0]]))
    x = field(up, lambda x: [1e-3 + 0 * x[0], -1e-2 + 0 * x[0]])
    bodies = [sc.Body(low, elastic(1.0, 0.3), D="bottom"), sc.Body(up, elastic(1.0, 0.3), D="top", x=x)]
    contact = sc.Contact(
        bodies[1].surface("bottom"),
        bodies[0].surface("top"),
        friction=sc.Coulomb(0.3),
        method=method,
        **settings,
    )
    return sc.ContactSolver(bodies, [contact])


@pytest.mark.every_value
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("delta", [1e-12, -1e-12, 1e-8, -1e-8])
def test_X20_nodes_on_joints(delta, method):
    """A node exactly on a joint, or a hair to either side of it, belongs to one facet, alike."""
    here, there = shifted(0.0, method=method), shifted(delta, method=method)
    weights = there.geometry.pairings[0].primary_weights
    own = there.geometry.pairings[0].secondary_weights
    assert_allclose(weights.sum(axis=1), own.sum(axis=1), rtol=1e-12)
    a, b = here.solve(), there.solve()
    assert_array_equal(a.status, b.status)
    assert_allclose(b.forces, a.forces, rtol=0, atol=1e-6 * np.abs(a.forces).max())


@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("angle", [0.0, 33.0])
def test_X21_overhang_carries_nothing(angle, method):
    """A beam that overhangs its support on both sides is carried by the support alone."""
    pose = Pose(angle)
    low = block_basis(1.0 + even(5), even(3), pose=pose)
    up = block_basis(3 * even(17), 1 + even(4), pose=pose)
    f = stress_load(up, "top", [[0.0, 0.0], [0.0, -1e-3]], pose)
    bodies = [
        sc.Body(low, elastic(1.0, 0.3), D="bottom", name="support"),
        sc.Body(up, elastic(1.0, 0.3), f, name="beam"),
    ]
    contact = sc.Contact(
        bodies[1].surface("bottom"), bodies[0].surface("top"), friction=sc.Coulomb(0.5), method=method
    )
    result = sc.ContactSolver(bodies, contact).solve()
    x = pose.back(result.points)[:, 0]
    # mortar: a point is an average over its two facets, which may reach beyond the end
    reach = 3 / 17 if method == "mortar" else 1e-6
    assert not result.normal_force[(x < 1 - reach) | (x > 2 + reach)].any()
    assert_allclose(pose.back(result.force), [0.0, 3e-3], rtol=0, atol=1e-12)


@pytest.mark.parametrize("slope", [0.3, -0.3])
def test_X22_corners(slope):
    """In a groove and over a ridge the node at the corner finds one partner, and steadily so."""

    def solve(delta):
        def bent(x):
            return np.array([x[0], x[1] + slope * np.abs(x[0] - 0.5) * (1 - np.abs(x[1] - 1))])

        low = block_basis(even(6), even(3), shape=bent)
        up = block_basis(even(6), 1 + even(3), shape=lambda x: bent(x) + np.array([[delta], [0.0]]))
        x = field(up, lambda x: [0 * x[0], -1e-2 + 0 * x[0]])
        bodies = [
            sc.Body(low, elastic(1.0, 0.3), D="bottom"),
            sc.Body(up, elastic(1.0, 0.3), D="top", x=x),
        ]
        contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"))
        return sc.ContactSolver(bodies, contact).solve()

    results = [solve(delta) for delta in (0.0, 1e-12, -1e-12, 1e-8, -1e-8)]
    peak = results[0].normal_force.max()
    assert peak > 0
    assert_allclose(results[0].force[0], 0.0, atol=1e-9 * peak)  # symmetry
    for other in results[1:]:
        assert_array_equal(other.status, results[0].status)
        assert_allclose(other.forces, results[0].forces, rtol=0, atol=1e-6 * peak)


def test_X23_facets_in_any_order_or_twice():
    """Facets given in any order or twice are the same surface."""
    basis = block_basis(even(4), even(4))
    body = sc.Body(basis, elastic(1.0, 0.3), D="top")
    facets = basis.mesh.boundaries["bottom"]
    plain = body.surface(facets)
    other = body.surface(np.concatenate([facets[::-1], facets]))
    assert_array_equal(plain.points, other.points)
    assert_array_equal(plain.facets, other.facets)


def test_X23_facet_without_length(refused):
    """A facet whose two nodes coincide is named."""
    basis = block_basis(even(4), even(4))
    mesh, facets = basis.mesh, basis.mesh.boundaries["bottom"]
    p = mesh.p.copy()
    on = np.flatnonzero(p[1] == 0)
    p[:, on[1]] = p[:, on[0]]
    flat = sc.Body(fem.Basis(fem.MeshQuad(p, mesh.t), basis.elem), np.eye(basis.N))
    with refused(sc.errors.InputError, match=r"no length, .* mesh facet"):
        flat.surface(facets)


BAD = [np.nan, np.inf, -np.inf]


@pytest.mark.every_value
@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize(
    "where",
    [
        "mesh",
        "K",
        "f",
        "x",
        "gap",
        "interference",
        "step f",
        "step x",
        "step",
        "motion",
        "step interference",
    ],
)
def test_X24_not_a_number_anywhere(where, bad, refused):
    """A NaN or an infinite number is refused as a ValueError before anything is solved."""
    basis = block_basis(even(2), even(2))
    data = {"f": np.zeros(basis.N), "x": np.zeros(basis.N), "K": elastic(1.0, 0.3).assemble(basis)}
    settings = {}
    if where == "mesh":
        p = basis.mesh.p.copy()
        p[0, 3] = bad
        with np.errstate(invalid="ignore"):
            basis = fem.Basis(replace(basis.mesh, doflocs=p, sort_t=False), basis.elem)
    elif where == "K":
        data["K"].data[5] = bad
    elif where in data:
        data[where][basis.get_dofs("top").all()[0]] = bad
    elif where in ("gap", "interference"):
        settings[where] = bad
    step = {
        "step f": {"f": {"block": np.full(basis.N, bad)}},
        "step x": {"x": {"block": np.full(basis.N, bad)}},
        "step": bad,
        "motion": {"motion": {"floor": (0.0, bad)}},
        "step interference": {"interference": {"joint": bad}},
    }.get(where, 1.0)
    with refused(sc.errors.InputError, match=r"NaN|nan|inf"):
        body = sc.Body(basis, data["K"], data["f"], D="top", x=data["x"], name="block")
        contact = sc.Contact(body.surface("bottom"), FLOOR, name="joint", **settings)
        list(sc.ContactSolver(body, contact).history([step]))


@pytest.mark.parametrize(
    ("name", "make"),
    [
        ("mu", lambda: sc.Coulomb(-0.1)),
        ("mu", lambda: sc.Coulomb(np.nan)),
        ("mu", lambda: sc.Coulomb(np.inf)),
        ("tau_max", lambda: sc.Coulomb(0.1, tau_max=-1.0)),
        ("tau_max", lambda: sc.Coulomb(0.1, tau_max=np.nan)),
        ("cohesion", lambda: sc.Coulomb(0.1, cohesion=-1.0)),
        ("cohesion", lambda: sc.Coulomb(0.1, cohesion=np.inf)),
        ("stiffness", lambda: sc.Coulomb(0.1, stiffness=0.0)),
        ("stiffness", lambda: sc.Coulomb(0.1, stiffness=np.nan)),
        ("tau_max", lambda: sc.Tresca(-1.0)),
        ("tau_max", lambda: sc.Tresca(np.inf)),
        ("point", lambda: sc.RigidPlane((0, np.nan), (0, 1))),
        ("normal", lambda: sc.RigidPlane((0, 0), (0, 0))),
        ("radius", lambda: sc.RigidCylinder((0, 0), -1.0)),
        ("adjust", lambda: block_on_floor(adjust=np.nan)),
        ("adjust", lambda: block_on_floor(adjust=np.inf)),
        ("reach", lambda: block_on_floor(reach=np.nan)),
    ],
)
def test_X24_parameters_out_of_range(name, make, refused):
    """Coefficients, caps and radii out of range are refused by name, with the value given."""
    value = r"-1\.0|-0\.1|nan|infinite|inf|0\.0|\(0, 0\)"
    with (
        np.errstate(all="ignore"),
        refused(sc.errors.InputError, match=rf"\b{name} ?(=|is) ?.*({value})"),
    ):
        make()


def test_X24_no_stiffness(refused):
    """A body without stiffness is free to move in any way, and that is what the message says."""
    with refused(match=r"stiffness|free to move"):
        block_on_floor(E=0.0, f=(0.0, -1.0)).solve()


# -- cycles, caps, limits ---------------------------------------------------------------------


def path(case, points, **settings):
    """Results along (U, d) with the exact shear on the sides, and their closed form."""
    bodies = case.bodies()
    solver = sc.ContactSolver(bodies, [case.contact(bodies)], **settings)
    unit = [b.f / case.state.tau for b in bodies]
    steps, states, plastic = [], [], 0.0
    for U, d in points:
        state = uniform_shear(d, U, case.layers, case.mu, plastic_slip=plastic, tau_max=case.tau_max)
        plastic = state.plastic_slip
        states.append(state)
        x = field(bodies[1].basis, lambda x, U=U, d=d: [U + 0 * x[0], -d + 0 * x[0]])
        loads = {b.name: state.tau * f for b, f in zip(bodies, unit, strict=True)}
        steps.append({"x": {"up": x}, "f": loads})
    return solver, steps, states


def test_X25_reversed_three_times():
    """Sheared to and fro, every cycle dissipates the same, four times mu p (U - the elastic part)."""
    points = [(U, 1e-3) for _ in range(3) for U in (3e-3, 0.0, -3e-3, 0.0)]
    solver, steps, states = path(SLIP, points)
    results = list(solver.history(steps))
    for result, state in zip(results, states, strict=True):
        _, tau, _ = SLIP.measured(result)
        assert_allclose(tau, state.tau, rtol=EXACT)
    total = np.array([r.dissipation_total for r in results])
    cycle = np.diff(total[[0, 4, 8]])
    assert_allclose(cycle[1], cycle[0], rtol=1e-9)
    mu_p = SLIP.mu * SLIP.state.p
    elastic_part = mu_p * sum(2 * H / E for H, E in SLIP.layers)
    loop = 4 * mu_p * (3e-3 - elastic_part)
    # bound times slip, at constant pressure: exact, though steps stick first and then slip
    assert_allclose(cycle[0], loop, rtol=1e-9)


@pytest.mark.every_value
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 2.0, np.inf])
@pytest.mark.parametrize("linear", LINEAR)
def test_X26_shear_cap(share, linear):
    """A cap below mu p bounds the shear, one above does nothing, at mu p both agree."""
    case = replace(SLIP, tau_max=share * SLIP.mu * SLIP.state.p if share else 0.0)
    result = case.solve(linear=LINEAR[linear])
    case.check(result, EXACT)
    if share == 0:
        assert not result.tangential_force.any()
    if share >= 1:
        other = SLIP.solve(linear=LINEAR[linear])
        assert_allclose(result.forces, other.forces, rtol=0, atol=1e-12 * np.abs(other.forces).max())


@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
def test_X27_pressure_falls_while_sliding(loop):
    """The friction bound is that of the pressure at the end of the step, not of the one before."""
    solver, steps, states = path(
        SLIP, [(3e-3, 1e-3), (3.5e-3, 6e-4), (4e-3, 2e-4), (4.5e-3, -1e-4)], loop=loop
    )
    for result, state in zip(solver.history(steps), states, strict=True):
        p, tau, _ = SLIP.measured(result)
        assert_allclose(p, state.p, rtol=1e-9, atol=0)
        assert_allclose(tau, state.tau, rtol=1e-8, atol=0)


@pytest.mark.parametrize("margin", [-1e-12, 0.0, 1e-12])
@pytest.mark.parametrize("linear", LINEAR)
def test_X29_exactly_at_the_limit(margin, linear):
    """A push of mu P to the last digit may stick or slip, with the same forces and no hesitation."""
    U = SLIP.mu * SLIP.state.p * sum(2 * H / E for H, E in SLIP.layers)
    case = replace(SLIP, U=U * (1 + margin))
    result = case.solve(linear=LINEAR[linear])
    case.check(result, 1e-9)
    assert result.iterations <= 50


# at the limit itself any place will do, and the solver says so
@pytest.mark.filterwarnings("ignore:.*is indifferent:skfem_contact.ContactWarning")
@pytest.mark.parametrize("margin", [-1e-12, 0.0, 1e-12])
def test_X29_free_body_exactly_at_the_limit(margin, refused):
    """A free block pushed with mu N (1 +- 1e-12) rests with these forces, or is said to slide."""
    solver = block_on_floor(None, f=(1e-4 * (1 + margin), -1e-3), friction=sc.Coulomb(0.1))
    with refused(
        (sc.errors.NoEquilibrium, sc.errors.NotConverged), match="free to move|equilibrium", either=True
    ) as seen:
        result = solver.solve()
    if seen.happened:
        assert seen.error.result.iterations <= 50 * 2**3
        return
    assert_allclose(result.force, [-1e-4, 1e-3], rtol=1e-9)
    assert result.iterations <= 50


# -- numbering, types, restart ------------------------------------------------------------------


@pytest.mark.parametrize("case", [STICK, SLIP], ids=["stick", "slip"])
def test_X28_numbering_order_and_division(case):
    """Renumbered nodes, exchanged bodies and a joint cut in two contacts give the same answer."""
    plain = case.solve()
    renumbered = replace(case, pose=Pose(0.0, 3))
    renumbered.check(renumbered.solve(), EXACT)
    bodies = case.bodies()
    swapped = sc.ContactSolver(bodies[::-1], [case.contact(bodies)]).solve()
    for body in bodies:
        name = body.name
        assert_allclose(swapped.displacement(name), plain.displacement(name), rtol=0, atol=1e-13)
    west = bodies[1].surface(lambda x: (x[1] < 1 + 1e-9) & (x[0] < 0.5))
    east = bodies[1].surface(lambda x: (x[1] < 1 + 1e-9) & (x[0] > 0.5))
    parts = [
        sc.Contact(side, bodies[0].surface("top"), friction=case.law(), name=name)
        for side, name in ((west, "west"), (east, "east"))
    ]
    # the node in the middle is in both: it carries its force once, in shares
    divided = sc.ContactSolver(bodies, parts).solve()
    for body in bodies:
        assert_allclose(
            divided.displacement(body), plain.displacement(body.name), rtol=0, atol=1e-10 * 1e-3
        )
    total = divided["west"].force + divided["east"].force
    assert_allclose(total, plain.force, rtol=EXACT)


def test_X28_order_of_bodies_at_a_junction():
    """The order in which bodies are given does not matter where three of them meet."""
    results = [junction(mu=0.3, order=order)[0].solve() for order in ((0, 1, 2), (2, 0, 1))]
    for name in ("base", "west", "east"):
        u = [r.displacement(name) for r in results]
        assert_allclose(u[1], u[0], rtol=0, atol=EXACT * 2e-3)


def test_X30_no_contact(refused):
    """A solver without any contact is a clear error."""
    body = block_on_floor().system.bodies[0]
    with refused(sc.errors.InputError, match="There is no contact"):
        sc.ContactSolver(body, [])


def test_X30_surface_without_facets(refused):
    """A surface that a condition finds nowhere is a clear error."""
    body = block_on_floor().system.bodies[0]
    with refused(sc.errors.InputError, match="has no facets"):
        body.surface(lambda x: x[0] > 5)


@pytest.mark.slow
def test_X30_a_hundred_thousand_points():
    """A contact of 1e5 points on a rigid floor is solved on the sparse route."""
    basis = block_basis(even(100_000), 1e-5 * even(1))
    x = field(basis, lambda x: [0 * x[0], -1e-9 + 0 * x[0]])
    D = basis.nodal_dofs[:, basis.mesh.p[1] > 0.5e-5].ravel()
    body = sc.Body(basis, elastic(1.0, 0.0), D=D, x=x)
    surface = body.surface(lambda x: x[1] < 1e-7)
    result = sc.ContactSolver(body, sc.Contact(surface, FLOOR)).solve()
    assert_allclose(result.pressure, 1e-4, rtol=1e-9)


@pytest.mark.parametrize("kind", ["float32", "integers", "strided", "read-only"])
def test_X31_types_of_arrays(kind):
    """Single precision, integers, strided and read-only arrays mean what their numbers mean."""
    basis = block_basis(even(4), even(4))
    K = (2.0**20 * elastic(1.0, 0.0).assemble(basis)).tocsr()
    K.data = np.round(K.data)  # numbers that every type can represent
    f = np.round(2.0**10 * stress_load(basis, "top", [[0.0, 0.25], [0.25, -4.0]]))
    x = np.zeros(basis.N)
    D = basis.get_dofs("left").all()
    x[D] = 0.0
    gap = np.zeros(5)
    mu = np.full(5, 0.5)

    def convert(a, exact=True):
        if kind == "float32":
            return a.astype(np.float32)
        if kind == "integers" and exact:
            return a.astype(np.int64)
        if kind == "strided":
            return np.stack([a, a + 1], axis=1).ravel()[::2]
        a = a.copy()
        a.flags.writeable = kind != "read-only"
        return a

    def solve(change):
        A = K.copy()
        A.data = np.ascontiguousarray(change(K.data))
        given = [change(f), change(x), change(gap), change(mu, False), change(D.astype(float))]
        given[4] = given[4].astype(np.int32 if kind == "float32" else np.int64)
        before = [a.copy() for a in (*given, A.data, A.indices)]
        body = sc.Body(basis, A, given[0], D=given[4], x=given[1])
        contact = sc.Contact(body.surface("bottom"), FLOOR, gap=given[2], friction=sc.Coulomb(given[3]))
        result = sc.ContactSolver(body, contact).solve(given[0])
        for a, b in zip((*given, A.data, A.indices), before, strict=True):
            assert_array_equal(a, b)
        return result

    plain, other = solve(lambda a, exact=True: a), solve(convert)
    assert_array_equal(other.u, plain.u)
    assert_array_equal(other.forces, plain.forces)


@pytest.mark.parametrize("linear", LINEAR)
def test_X32_restart_in_the_middle(linear):
    """A path continued by another solver from a result half-way is the path itself."""
    points = [(3e-3, 1e-3), (2.5e-3, 8e-4), (1e-3, 8e-4), (0.0, 5e-4), (-1e-3, 9e-4)]
    solver, steps, _ = path(SLIP, points, linear=LINEAR[linear])
    whole = list(solver.history(steps))
    first = list(solver.history(steps[:3]))
    fresh, same, _ = path(SLIP, points, linear=LINEAR[linear])
    rest = list(fresh.history(same[3:], start=first[-1]))
    for a, b in zip(whole[3:], rest, strict=True):
        assert_allclose(b.u, a.u, rtol=0, atol=1e-14 * 3e-3)
        assert_allclose(b.forces, a.forces, rtol=0, atol=1e-14 * np.abs(a.forces).max())
        assert_array_equal(b.status, a.status)
        assert_allclose(b.dissipation_total, a.dissipation_total, rtol=1e-13)


@pytest.mark.parametrize("case", [STICK, SLIP], ids=["stick", "slip"])
def test_X33_moved_as_a_whole(case):
    """Both bodies translated together after loading: pressure and friction stay."""
    bodies = case.bodies()
    solver = sc.ContactSolver(bodies, [case.contact(bodies)])
    by = np.array([0.3, -0.2])
    moved = {b.name: b.x.copy() for b in bodies}
    for b in bodies:
        moved[b.name][b.D] += by[b.dof_component[b.D]]
    first, second = solver.history([1.0, {"x": moved}])
    assert_allclose(second.forces, first.forces, rtol=0, atol=1e-10 * np.abs(first.forces).max())
    assert_allclose(second.dissipation, 0.0, atol=1e-10 * 1e-3 * np.abs(first.forces).max())
