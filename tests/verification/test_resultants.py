"""Problems whose resultants follow from equilibrium: pads, wedges, inclines, corners, energy.

Sources: P3 Code_Aster SSNV503; P4 NAFEMS CGS-4 (FrontISTR deck); P5 Beer & Johnston 8.2 (ANSYS
VM29); P7, P8 and P10 are exact by construction. Closed forms: `skfem_contact.reference`.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import UPRIGHT, Pose, block_basis, elastic, field, stress_load, weight_load
from scipy.sparse import diags

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.reference import corner_pressures, inclined_block, sliding_wedge_force

EXACT = 1e-10  # round-off of a direct solution on a mesh of this size, with four digits to spare
LOOPS = ["newton", "direct"]


def floor_of(pose, name="floor"):
    return sc.RigidPlane(pose.turn((0.0, 0.0)), pose.turn((0.0, 1.0)), name=name)


# -- P3: sliding pad ------------------------------------------------------------------------------


class Pad:
    """SSNV503: a pad 800 by 400 pressed by 300 on an inclined plane, pushed from the left."""

    P, MU = 300.0 * 800.0, 0.3

    def __init__(self, pose, spring=0.0, loop="newton"):
        self.pose = pose
        x, y = np.linspace(0, 800, 9), np.linspace(0, 400, 5)
        self.basis = block_basis(x, y, pose=pose)
        stiffness = elastic(2e5, 0.3).assemble(self.basis)
        if spring:  # to the ground, along both axes, at one node of the top
            at = np.argmin(np.abs(pose.back(self.basis.mesh.p.T) - [400.0, 400.0]).sum(axis=1))
            weak = np.zeros(self.basis.N)
            weak[self.basis.nodal_dofs[:, at]] = spring
            stiffness = stiffness + diags(weak)
            self.spring_dofs = self.basis.nodal_dofs[:, at]
        self.body = sc.Body(self.basis, stiffness, name="pad")
        law = sc.Coulomb(self.MU, stiffness=np.inf)
        contact = sc.Contact(self.body.surface("bottom"), floor_of(pose), friction=law)
        self.solver = sc.ContactSolver([self.body], [contact], loop=loop)

    def solve(self, share):
        """Pushed with this share of mu N."""
        push = self.MU * self.P * share / 400.0
        f = stress_load(self.basis, "top", np.diag([0.0, -300.0]), self.pose)
        f += stress_load(self.basis, "left", np.diag([-push, 0.0]), self.pose)
        return self.solver.solve(f=f)


@pytest.mark.pairwise
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("spring", [1.0, 20.0])
@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_P3_pad_on_weak_springs_sticks_below_and_slides_above(angle, spring, loop):
    """At 0.99 mu N the pad sticks, at 1.01 mu N it slides until the spring takes the rest."""
    pose, N = Pose(angle), Pad.P
    pad = Pad(pose, spring, loop)
    for share in (0.99, 1.01):
        result = pad.solve(share)
        along, across = pose.back(result.force)
        pulled = pose.back(spring * result.u[pad.spring_dofs])
        # N and T balance the load and the spring: SSNV503 gives (-1.2e5, 2.0784e5) for the normal
        # force, which the spring changes by its 1e-5
        assert_allclose(across, N + pulled[1], rtol=EXACT)
        assert_allclose(along, -share * 0.3 * N + pulled[0], rtol=EXACT)
        if share < 1:
            assert (result.status == 1).any()
            assert pulled[0] < 1e-3 * N
        else:
            assert (result.status[result.normal_force > 0] == 2).all()
            assert_allclose(along, -0.3 * across, rtol=EXACT)
            assert pulled[0] > 0.9 * 0.01 * 0.3 * N  # the whole surplus, in the spring


def test_P3_resultant_on_the_incline():
    """On a plane inclined by 30 degrees the resultant of the pressure is (-1.2e5, 2.0784e5)."""
    result = Pad(Pose(30.0)).solve(0.5)
    normal = result.normal_force.sum() * result.normal[0]
    assert_allclose(normal, [-1.2e5, 1.2e5 * np.sqrt(3)], rtol=EXACT)
    assert_allclose(normal, [-1.2e5, 2.0784e5], rtol=4e-5)  # as printed, cut after five digits


@pytest.mark.every_value
@pytest.mark.parametrize("angle", [0.0, 30.0, 270.0])
@pytest.mark.parametrize(
    ("margin", "loop"),
    [
        (1e-2, "newton"),
        (1e-6, "newton"),
        (1e-2, "direct"),
        (1e-6, "direct"),
    ],
)
def test_P3_free_pad_holds_to_the_limit(margin, angle, loop):
    """A pad that friction alone holds rests just below mu N and has no equilibrium just above."""
    pose = Pose(angle)
    pad = Pad(pose, loop=loop)
    result = pad.solve(1 - margin)
    force = pose.back(result.force)
    assert_allclose(force, [-(1 - margin) * 0.3 * Pad.P, Pad.P], rtol=EXACT)
    assert (result.status == 1).any()
    with pytest.raises(sc.errors.NoEquilibrium, match="'pad'") as raised:
        pad.solve(1 + margin)
    assert raised.value.bodies == ("pad",)
    assert "translation" in raised.value.motion


# -- P4: NAFEMS CGS-4 -----------------------------------------------------------------------------


def wedge(mu, *, uphill=True, n=((12, 3), (9, 3)), G=4.0, method="node"):
    """The upper wedge is pushed by 0.2 along a slope of 0.1 under the dead load G on its top."""
    slope, E = 0.1, 1100.0

    def lower_shape(x):
        return np.array([x[0], x[1] * (0.7 + slope * x[0])])

    def upper_shape(x):
        line = 0.7 + slope * x[0]
        return np.array([x[0], line + x[1] * (2.0 - line)])

    one = [np.linspace(0, 1, k[1] + 1) for k in n]
    low = block_basis(np.linspace(0, 6, n[0][0] + 1), one[0], shape=lower_shape)
    top = block_basis(np.linspace(1, 5, n[1][0] + 1), one[1], shape=upper_shape)
    side, push = ("left", 0.2) if uphill else ("right", -0.2)
    pushed = top.get_dofs(side).all("u^1")
    f = stress_load(top, "top", np.diag([0.0, -G / 4.0]))
    bodies = [
        sc.Body(low, elastic(E, 0.0), D="bottom", name="low"),
        sc.Body(top, elastic(E, 0.0), f, D=pushed, x=field(top, lambda x: [push, 0.0]), name="wedge"),
    ]
    friction = sc.Coulomb(mu) if mu else None
    contact = sc.Contact(
        bodies[1].surface("bottom"), bodies[0].surface("top"), friction=friction, method=method
    )
    result = sc.ContactSolver(bodies, [contact]).solve()
    # the pushing force, from the stiffness of the wedge: internal force less what the contact gives
    internal = bodies[1].K @ result.displacement("wedge") - f
    values = result.values[0]
    at = bodies[1].surface("bottom").dofs
    internal[at] -= values.forces
    return result, internal[pushed].sum(), internal


@pytest.mark.pairwise
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("uphill", [True, False], ids=["up", "down"])
@pytest.mark.parametrize("mu", [0.0, 0.1, 0.2, 0.3])
def test_P4_sliding_wedge(mu, uphill, method):
    """Pushing a wedge takes (t + mu)/(1 - mu t) of its load up and (mu - t)/(1 + mu t) down."""
    G = 4.0
    result, F, internal = wedge(mu, uphill=uphill, G=G, method=method)
    assert (result.status[result.normal_force > 0] == 2).all()
    direction = 1.0 if uphill else -1.0
    expected = sliding_wedge_force(mu, 0.1, uphill=uphill)
    if uphill:
        printed = {0.0: 0.1, 0.1: 0.20202, 0.2: 0.306122, 0.3: 0.412371}[mu]
        assert_allclose(expected, printed, rtol=5e-6)
    # statics alone: 1e-9 of the load
    assert_allclose(direction * F, expected * G, rtol=0, atol=1e-9 * G)
    assert_allclose(result.force, [-F, G], rtol=0, atol=1e-9 * G)
    # nothing is left over on the DOFs that are free
    free = np.setdiff1d(np.arange(len(internal)), result.system.bodies[1].D)
    if method == "node":  # a mortar force is spread over the neighbours of its node
        assert_allclose(internal[free], 0.0, atol=1e-9 * G)


# -- P5: block on an incline ----------------------------------------------------------------------


class Incline:
    """Block b by h resting on a plane inclined downwards to the left, held by friction alone."""

    def __init__(self, angle, mu, b=2.0, h=1.0, n=(16, 8), W=100.0, loop="newton", E=1e5):
        self.angle, self.W, self.h = angle, W, h
        self.pose = Pose(np.degrees(angle))
        self.basis = block_basis(
            np.linspace(-b / 2, b / 2, n[0] + 1), np.linspace(0, h, n[1] + 1), pose=self.pose
        )
        self.body = sc.Body(self.basis, elastic(E, 0.3), name="block")
        law = sc.Coulomb(mu, stiffness=np.inf)
        contact = sc.Contact(self.body.surface("bottom"), floor_of(self.pose), friction=law)
        self.solver = sc.ContactSolver([self.body], [contact], loop=loop)

    def solve(self, force=0.0, **settings):
        """Under its weight and a horizontal force into the slope, spread like the weight."""
        return self.solver.solve(f=weight_load(self.basis, [force, -self.W]), **settings)

    def forces(self, result):
        """Normal force, and friction up the slope."""
        T, N = self.pose.back(result.force)
        return N, T


@pytest.mark.parametrize("loop", LOOPS)
def test_P5_holding_force_of_VM29(loop):
    """At 20 degrees and mu = 0.3 the block is held by 5.7674 and slides under 5.7672."""
    block = Incline(np.radians(20.0), 0.3, loop=loop)
    exact = inclined_block(100.0, np.radians(20.0), 0.3, 5.7674)
    assert_allclose(exact.least_force, 5.76729, rtol=1e-6)
    assert_allclose([exact.N, exact.T], [95.942, 28.783], rtol=4e-5)
    result = block.solve(5.7674)
    assert_allclose(block.forces(result), [exact.N, exact.T], rtol=EXACT)
    assert (result.status == 1).any()
    with pytest.raises(sc.errors.NoEquilibrium, match=r"'block'.*translation") as raised:
        block.solve(5.7672)
    assert raised.value.bodies == ("block",)
    assert raised.value.result is not None
    assert not raised.value.result.converged


@pytest.mark.every_value
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("mu", [0.1, 0.3, 0.8])
def test_P5_slides_if_and_only_if_the_slope_exceeds_mu(mu, loop):
    """By its weight alone the block rests at 0.999 atan(mu) and slides at 1.001 atan(mu)."""
    limit = np.arctan(mu)
    block = Incline(0.999 * limit, mu, loop=loop)
    exact = inclined_block(100.0, 0.999 * limit, mu)
    assert_allclose(block.forces(block.solve()), [exact.N, exact.T], rtol=EXACT)
    assert not exact.slides
    with pytest.raises(sc.errors.NoEquilibrium, match=r"'block'.*translation"):
        Incline(1.001 * limit, mu, loop=loop).solve()
    assert inclined_block(100.0, 1.001 * limit, mu).slides


@pytest.mark.parametrize("share", [0.3, 0.9, 0.99])
@pytest.mark.parametrize("shape", [(2.0, 1.0), (1.0, 2.0)], ids=["low", "tall"])
def test_P5_pressure_moves_downhill(shape, share):
    """The resultant pressure lies (h/2) tan(angle) downhill of the middle, on any mesh."""
    b, h = shape
    angle = np.arctan(share * b / h)  # tips at share = 1
    block = Incline(angle, 5.0, b=b, h=h)
    result = block.solve()
    exact = inclined_block(100.0, angle, 5.0)
    assert_allclose(block.forces(result), [exact.N, exact.T], rtol=EXACT)
    x = block.pose.back(result.points)[:, 0]
    centre = np.sum(result.normal_force * x) / result.normal_force.sum()
    assert_allclose(centre, -exact.pressure_offset(h), rtol=1e-9)


@pytest.mark.parametrize("share", [1.001, 1.1])
def test_P5_tips_over_its_lower_edge(share):
    """A tall block on a rough slope tips if and only if tan(angle) exceeds b/h."""
    b, h = 1.0, 2.0
    assert inclined_block(100.0, np.arctan(share * b / h), 5.0).tips(b, h)
    with pytest.raises(sc.errors.NoEquilibrium, match=r"'block'.*rotation"):
        Incline(np.arctan(share * b / h), 5.0, b=b, h=h).solve()


# -- P7: corner with two normals ------------------------------------------------------------------

DX, DY = 1e-3, 2e-3


def squeezed(pose=UPRIGHT, *, mu=None, n=4, kind="Q1", elastic_wall=False, linear="auto"):
    """A unit square squeezed into a rigid corner: its corner node belongs to two contacts.

    With `elastic_wall` the left wall is a body that carries Dirichlet conditions all over.
    """
    even = np.linspace(0.0, 1.0, n + 1)
    basis = block_basis(even, even, kind=kind, pose=pose)
    u = field(basis, lambda x: np.array([-DX + 0 * x[0], -DY + 0 * x[1]]), pose)
    D = [basis.get_dofs("right").all("u^1"), basis.get_dofs("top").all("u^2")]
    if pose.angle in (90.0, 270.0):  # the axes change places
        D[0], D[1] = basis.get_dofs("right").all("u^2"), basis.get_dofs("top").all("u^1")
    bodies = [sc.Body(basis, elastic(1.0, 0.3), D=D, x=u, name="block")]
    friction = None if mu is None else sc.Coulomb(mu)
    floor = sc.RigidPlane(pose.turn((0, 0)), pose.turn((0, 1)), name="floor")
    wall = sc.RigidPlane(pose.turn((0, 0)), pose.turn((1, 0)), name="wall")
    if elastic_wall:
        other = block_basis(np.linspace(-1, 0, 3), even, kind=kind, pose=pose)
        everything = np.arange(other.N)
        bodies.append(sc.Body(other, elastic(1.0, 0.3), D=everything, name="wall"))
        wall = bodies[-1].surface("right")
    contacts = [
        sc.Contact(bodies[0].surface("bottom"), floor, friction=friction, name="below"),
        sc.Contact(bodies[0].surface("left"), wall, friction=friction, name="beside"),
    ]
    return sc.ContactSolver(bodies, contacts, linear=linear)


def check_corner(result, rtol):
    p_x, p_y = corner_pressures(DX, DY, 1.0, 0.3)
    assert_allclose([p_x, p_y], [2.5e-3, 3.26923077e-3], rtol=1e-9)
    assert_allclose(result["beside"].pressure, p_x, rtol=rtol)
    assert_allclose(result["below"].pressure, p_y, rtol=rtol)


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "sparse"])
@pytest.mark.parametrize("kind", ["Q1", "P1"])
@pytest.mark.parametrize("pose", [Pose(), Pose(90.0), Pose(270.0), Pose(0.0, 5)], ids=str)
@pytest.mark.parametrize("elastic_wall", [False, True], ids=["rigid", "prescribed"])
def test_P7_corner_node_carries_both_forces(elastic_wall, pose, kind, linear):
    """Uniform strain in a corner: its node carries half an edge of pressure on each wall."""
    result = squeezed(pose, kind=kind, elastic_wall=elastic_wall, linear=linear).solve()
    check_corner(result, 1e-11)
    p_x, p_y = corner_pressures(DX, DY, 1.0, 0.3)
    for name, p in (("beside", p_x), ("below", p_y)):
        at = np.argmin(np.linalg.norm(result[name].points, axis=1))
        assert_allclose(result[name].normal_force[at], p / 8, rtol=1e-11)  # four elements
    assert result.certificate.worst < 1e-12


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "sparse"])
@pytest.mark.parametrize("elastic_wall", [False, True], ids=["rigid", "prescribed"])
@pytest.mark.parametrize("mu", [0.3])
def test_P7_corner_with_friction(mu, elastic_wall, linear):
    """With friction on both walls the corner still balances, and no point exceeds its limit."""
    result = squeezed(mu=mu, elastic_wall=elastic_wall, linear=linear).solve()
    values = result["below"], result["beside"]
    for v in values:
        # the law, to the tolerance of the loop
        assert (np.abs(v.tangential_force[:, 0]) <= mu * v.normal_force + 1e-9 * 3e-3).all()
        assert (v.gap[v.status != 0] == 0).all()
    # equilibrium of the block: contact and reactions of the rollers
    body = result.system.bodies[0]
    r = body.K @ result.displacement("block")
    for v, side in zip(values, ("bottom", "left"), strict=True):
        np.subtract.at(r, body.surface(side).dofs, v.forces)
    free = np.setdiff1d(np.arange(body.n), body.D)
    assert_allclose(r[free], 0.0, atol=1e-11 * 3e-3)


@pytest.mark.parametrize("mu", [None, 0.3])
def test_P7_corner_that_is_also_prescribed(mu):
    """Where the corner node is prescribed as well, the Dirichlet condition carries its force."""
    even = np.linspace(0.0, 1.0, 5)
    basis = block_basis(even, even)
    corner = basis.nodal_dofs[:, np.argmin(basis.mesh.p.sum(axis=0))]
    u = field(basis, lambda x: np.array([-DX * x[0], -DY * x[1]]))
    D = [basis.get_dofs("right").all("u^1"), basis.get_dofs("top").all("u^2"), corner]
    body = sc.Body(basis, elastic(1.0, 0.3), D=D, x=u, name="block")
    law = None if mu is None else sc.Coulomb(mu)
    floor, wall = sc.RigidPlane((0, 0), (0, 1)), sc.RigidPlane((0, 0), (1, 0))
    contacts = [
        sc.Contact(body.surface("bottom"), floor, friction=law, name="below"),
        sc.Contact(body.surface("left"), wall, friction=law, name="beside"),
    ]
    result = sc.ContactSolver([body], contacts).solve()
    assert result.converged
    assert_allclose(result.u[corner], 0.0, atol=0)
    if mu is None:  # the strain is uniform: all but the corner as before, that one by its support
        for name, p in zip(("beside", "below"), corner_pressures(DX, DY, 1.0, 0.3), strict=True):
            v = result[name]
            inner = np.linalg.norm(v.points, axis=1) > 0
            assert_allclose(v.pressure[inner], p, rtol=1e-11)


# -- P8: release and contact again ----------------------------------------------------------------


@pytest.mark.parametrize("bodies", [1, 2])
def test_P8_release_leaves_nothing_behind(bodies):
    """Pulled off after any history, a body is where it would be without contact; then anew."""
    even = np.linspace(0.0, 1.0, 7)
    top = block_basis(even, 1 + even)
    upper = sc.Body(top, elastic(1.0, 0.3), D="top", name="upper")
    all_bodies, primary = [upper], sc.RigidPlane((0, 1), (0, 1))
    if bodies == 2:
        low = block_basis(even, even)
        all_bodies.append(sc.Body(low, elastic(0.7, 0.2), D="bottom", name="lower"))
        primary = all_bodies[1].surface("top")
    contact = sc.Contact(upper.surface("bottom"), primary, friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver(all_bodies, [contact])
    side = stress_load(top, "left", np.diag([-1e-3, 0.0]))

    def step(U, d, push=0.0):
        x = field(top, lambda x: np.array([U + 0 * x[0], -d + 0 * x[0]]))
        return {"x": {"upper": x}, "f": {"upper": push * side}}

    press = step(5e-4, 2e-3, 0.5)
    path = [
        step(0, 2e-3),
        step(1e-3, 2e-3, 1),
        step(-2e-3, 1e-3, 0.3),
        step(1e-3, -5e-3, 0.7),
        press,
    ]
    first, *_, released, again = list(solver.history(path))
    assert (released.status == 0).all()
    # the same body without any contact
    K, D = upper.K.toarray(), upper.D
    free = np.setdiff1d(np.arange(upper.n), D)
    u = path[3]["x"]["upper"].copy()
    u[free] = np.linalg.solve(
        K[np.ix_(free, free)], (0.7 * side - K @ (u * np.isin(np.arange(upper.n), D)))[free]
    )
    assert_allclose(released.displacement("upper"), u, rtol=0, atol=1e-12 * np.abs(u).max())
    if bodies == 2:
        assert_allclose(released.displacement("lower"), 0.0, atol=1e-12 * np.abs(u).max())
    # and pressed again it is as if for the first time, with slips counted from where it closed
    fresh = list(solver.history([path[3], press]))[-1]
    for name in ("normal_force", "tangential_force"):
        scale = np.abs(fresh.normal_force).max()
        assert_allclose(getattr(again, name), getattr(fresh, name), rtol=0, atol=1e-11 * scale)
    assert_allclose(again.slip, fresh.slip, rtol=0, atol=1e-11 * 5e-3)
    assert (first.status != 0).any()


# -- P10: energy ----------------------------------------------------------------------------------


def energy_scene(law, loop="newton"):
    """Two flat blocks, other materials, pressed, rubbed, pushed at a side: nothing is uniform."""
    x, y = np.linspace(0, 3, 13), np.linspace(0, 1, 5)
    low, top = block_basis(x, y), block_basis(x, 1 + y)
    bodies = [
        sc.Body(low, elastic(1.0, 0.3), D="bottom", name="low"),
        sc.Body(top, elastic(0.7, 0.2), D="top", name="top"),
    ]
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"), friction=law)
    solver = sc.ContactSolver(bodies, [contact], loop=loop)
    side = stress_load(low, "left", np.diag([-2e-4, 0.0]))

    def step(U, d, push):
        x = field(top, lambda x: np.array([U + 0 * x[0], -d + 0 * x[0]]))
        return {"x": {"top": x}, "f": {"low": push * side}}

    return solver, step


def energies(results, solver, f_of):
    """External work by the trapezoidal rule and strain energy of the bodies, step by step."""
    K = solver.system.K
    zero = np.zeros(solver.system.n)
    u, f = [zero], [zero]
    for result in results:
        u.append(result.u)
        f.append(f_of(result))
    work = [0.5 * (f[i] + f[i + 1]) @ (u[i + 1] - u[i]) for i in range(len(results))]
    strain = [0.5 * v @ (K @ v) for v in u]
    return np.array(work), np.diff(strain)


def loads_and_reactions(result):
    """What acts on the bodies from outside: K u less the contact forces, measured at the nodes."""
    kin, state = answer_of(result).kin, answer_of(result).local
    contact = kin.B_n.T @ state.normal_force - kin.B_t.T @ state.tangential_force.ravel()
    return result.system.K @ result.u - contact


# pressed, rubbed until a part slips, farther, and back until all has slipped the other way; the
# shear is kept so small that the corners stay closed
PATH = [
    (1e-4, 3e-3, 0.0),
    (2.5e-3, 3e-3, 0.0),
    (3e-3, 3e-3, 1.0),
    (1e-3, 3.2e-3, 0.5),
    (-2.8e-3, 3.2e-3, 0.0),
    (-3.3e-3, 3.1e-3, 0.2),
]


@pytest.mark.every_value
@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("G", [np.inf, 5.0])
def test_P10_energy_is_conserved(G, loop):
    """External work = strain energy + work of the mean friction force, whatever the step.

    That work is the dissipation and what the balance then misses, two numbers that are never mixed;
    with openings and closings too, see test_energy.py.
    """
    solver, step = energy_scene(sc.Coulomb(0.3, stiffness=G), loop)
    results = list(solver.history([step(*point) for point in PATH]))
    assert all((r.status != 0).all() for r in results)
    if loop == "newton":  # 4 to 7; slips that turn back once cost 80 and a second start
        assert max(r.iterations for r in results) <= 20
    assert any((r.status == 1).any() and (r.status == 2).any() for r in results)
    work, strain = energies(results, solver, loads_and_reactions)
    spring = [0.0] + [0.0 if np.isinf(G) else 0.5 * np.sum(r.tangential_force**2) / G for r in results]
    lost = np.array([r.dissipation + r.energy_residual for r in results])
    # the trapezoidal rule is exact for linear elasticity; 1e-10 of the work exchanged
    scale = np.abs(work).sum()
    assert_allclose(work, strain + np.diff(spring) + lost, rtol=0, atol=1e-10 * scale)
    dissipation = np.array([r.dissipation for r in results])
    assert_allclose(results[-1].dissipation_total, dissipation.sum(), rtol=1e-12)
    assert dissipation.sum() > 1e-3 * scale and np.all(dissipation >= lost - 1e-12 * scale)
    # nothing but friction: checked point by point
    before = np.zeros_like(results[0].slip), np.zeros_like(results[0].tangential_force)
    for r, d in zip(results, lost, strict=True):
        elastic_slip = -(r.tangential_force - before[1]) / G
        by_point = -0.5 * (r.tangential_force + before[1]) * (r.slip - before[0] - elastic_slip)
        assert_allclose(by_point.sum(), d, rtol=0, atol=1e-12 * scale)
        before = r.slip, r.tangential_force


@pytest.mark.parametrize("N", [1, 2, 5, 10])
def test_P10_proportional_dissipation(N):
    """Proportional slip in N steps: tau s/2 by the trapezoidal rule, (N + 1)/N of it by Euler's."""
    solver, step = energy_scene(sc.Coulomb(0.3))
    one = solver.solve(**step(3e-3, 3e-3, 1.0))
    assert (one.status == 2).any()
    exact = -0.5 * np.sum(one.tangential_force * one.slip)
    steps = [step(3e-3 * k / N, 3e-3 * k / N, k / N) for k in range(1, N + 1)]
    results = list(solver.history(steps))
    assert_allclose(results[-1].dissipation_total, exact, rtol=1e-10)
    euler, before = 0.0, np.zeros_like(one.slip)
    for r in results:
        euler += -np.sum(r.tangential_force * (r.slip - before))
        before = r.slip
    assert_allclose(euler, exact * (N + 1) / N, rtol=1e-10)
