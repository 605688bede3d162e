"""Extreme inputs, continued: products of extremes, long histories, redundant and far contacts."""

from __future__ import annotations

from dataclasses import replace

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from scenes import Pose, block_basis, elastic, field, stress_load
from sheared import Sheared
from test_extremes import EXACT, FLOOR, LINEAR, block_on_floor, even

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.reference import uniform_shear

# -- stiffness, friction, units: more of each, and all at once ------------------------------


@pytest.mark.pairwise
@pytest.mark.parametrize(
    ("length", "stress", "angle"), [(-9, 0, 0.0), (3, 9, 33.0)], ids=["nm", "km, turned"]
)
@pytest.mark.parametrize("mu", [1e-12, 0.5, 10.0])
@pytest.mark.parametrize("ratio", [1e-8, 1.0, 1e8])
@pytest.mark.parametrize("method", ["node", "mortar"])
def test_crossed(ratio, mu, length, stress, angle, method):
    """Ratio of the moduli, friction, units and direction at their extremes at the same time."""
    layers = ((1.0, 1.0), (1.0, ratio))
    p = 1e-3 / (1 + 1 / ratio)
    U = 0.5 * min(mu, 0.5) * p * (2 + 2 / ratio) + 2e-3 * (mu < 0.1)  # the slippery one slips
    case = Sheared(
        U=U, mu=mu, layers=layers, length=10.0**length, stress=10.0**stress, pose=Pose(angle)
    )
    bodies = case.bodies()
    result = sc.ContactSolver(bodies, [case.contact(bodies, method=method)]).solve()
    # turned by 33 degrees the soft block's displacements are differences of numbers 1e8 as large as
    # its strains are in the stiff one
    case.check(result, 1e-9)


@pytest.mark.parametrize("ratio", [1e-8, 1e-4, 1e4, 1e8])
@pytest.mark.parametrize("kinds", [("Q1", "P1"), ("P1", "Q1")], ids=str)
def test_X1_patch_test_of_any_ratio(kinds, ratio):
    """Mortar passes a uniform pressure between unlike meshes whatever the moduli."""
    bodies = []
    for kind, n, y, side, E, down in (
        (kinds[0], 5, 0.0, "bottom", 1.0, 0.0),
        (kinds[1], 7, 1.0, "top", ratio, -1e-3),
    ):
        basis = block_basis(even(n), y + even(3), kind=kind)
        x = field(basis, lambda x, down=down: [0 * x[0], down + 0 * x[0]])
        bodies.append(sc.Body(basis, elastic(E, 0.0), D=side, x=x, name=side))
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"))
    result = sc.ContactSolver(bodies, [contact]).solve()
    # seven nodes on five facets: some forces only the upper block itself resists. Where it is the
    # stiffer one, as many digits as the ratio has are lost of them
    rtol = max(EXACT, 1e-13 * ratio)
    assert_allclose(result.pressure, 1e-3 / (1 + 1 / ratio), rtol=rtol)


def test_X1_very_stiff_is_rigid():
    """A foundation 1e8 times stiffer is a rigid plane, to its own eight digits."""
    case = Sheared(U=3e-3, layers=((1.0, 1e8), (1.0, 0.7)))
    up = case.bodies()[1]
    plane = sc.RigidPlane((0, 1), (0, 1))
    rigid = sc.ContactSolver(up, sc.Contact(up.surface("bottom"), plane, friction=case.law())).solve()
    assert_allclose(case.solve().forces, rigid.forces, rtol=3e-8, atol=3e-8 * 1e-4)


KAPPAS = [(10.0**k, "newton", "auto") for k in range(-8, 13)]
KAPPAS += [
    (k, *way) for k in (1e-8, 1.0, 1e6, 1e12) for way in (("newton", "sparse"), ("direct", "auto"))
]
KAPPAS += [(np.inf, loop, linear) for loop in ("newton", "direct") for linear in LINEAR]


@pytest.mark.every_value
@pytest.mark.parametrize(("kappa", "loop", "linear"), KAPPAS)
def test_X2_stiffness_over_that_of_K(kappa, loop, linear):
    """A spring of kappa times K's diagonal is in series with the blocks, or slips at mu p."""
    for U in (3e-4, 3e-3):
        case = Sheared(U=U, n=1, width=0.25)
        bodies = case.bodies()
        surface = bodies[1].surface("bottom")
        diagonal = bodies[1].K.diagonal()[surface.dofs].max()
        k_t = kappa * diagonal / (case.width / 2)  # both points have the area width / 2
        state = uniform_shear(case.d, U, case.layers, case.mu, k_t=k_t)
        loads = {b.name: b.f * (state.tau / case.state.tau) for b in bodies}
        contact = case.contact(bodies, friction=case.law(stiffness=kappa * diagonal))
        result = sc.ContactSolver(bodies, [contact], loop=loop, linear=LINEAR[linear]).solve(loads)
        p, tau, _ = case.measured(result)
        # tau is kappa times a difference of displacements: eps kappa of it is lost
        rtol = max(EXACT, 4e-15 * kappa) if np.isfinite(kappa) else EXACT
        assert_allclose(p, state.p, rtol=rtol)
        assert_allclose(tau, state.tau, rtol=rtol)


@pytest.mark.parametrize("mu", [10.0, 100.0, 1e3, 1e6])
def test_X5_raous_block_with_large_friction(mu, refused):
    """Squeezed from the side, Raous' block sticks up to where it lifts, but for two points there.

    Nothing but the floor holds it up, and the loop needs pivoting for a start. A coefficient of 1e6
    is too much for the pivots, and may be refused.
    """
    basis = block_basis(even(16), even(16))
    f = stress_load(basis, "top", [[0.0, 0.0], [0.0, -0.05]])
    f += stress_load(basis, "right", [[-0.15, 0.0], [0.0, 0.0]])
    body = sc.Body(basis, elastic(130.0, 0.2), f, D=basis.get_dofs("left").nodal["u^1"])
    contact = sc.Contact(body.surface("bottom"), FLOOR, friction=sc.Coulomb(mu))
    solver = sc.ContactSolver(body, contact, options=sc.Options(max_cuts=0))
    if mu > 1e5:
        with refused(
            sc.errors.NotConverged, match="a large coefficient of friction", either=True
        ) as seen:
            result = solver.solve()
        if seen.happened:
            return
    else:
        result = solver.solve()
    status = result.status[np.argsort(result.points[:, 0])]
    last = np.flatnonzero(status)[-1]
    assert last < len(status) - 1 and not status[last + 1 :].any()
    assert (status[: last - 1] == 1).all()
    # where a point slips its friction is mu times a pressure, which a solve knows to 1.1e-16 of the
    # largest one at best (unit round-off): mu times that is out of balance
    assert result.certificate.worst < max(1e-12, 1e-16 * mu)


@pytest.mark.every_value
@pytest.mark.parametrize("length", [-30, 10])
@pytest.mark.parametrize("stress", [-20, 30])
def test_X6_powers_of_two_change_no_digit(length, stress):
    """In units that are powers of two every number is the same, bit by bit."""
    case = Sheared(U=3e-3)
    scaled = replace(case, length=2.0**length, stress=2.0**stress)
    result, reference = scaled.solve(), case.solve()
    assert_array_equal(result.u / scaled.length, reference.u)
    force = scaled.stress * scaled.length
    assert_array_equal(result.forces / force, reference.forces)


@pytest.mark.every_value
@pytest.mark.parametrize("how", ["gap", "interference"])
@pytest.mark.parametrize("overlap", [1e-15, 1e-12, 1e-9, 1e-3, 1.0])
def test_X8_any_overlap(overlap, how):
    """Given as a gap or as interference, an overlap of 1e-15 of the height or more presses."""
    settings = {"gap": -overlap} if how == "gap" else {"interference": overlap}
    solver = block_on_floor(nu=0.0, friction=sc.Coulomb(0.3), **settings)
    if overlap >= 0.1:
        with (
            pytest.warns(sc.ContactWarning, match="is strained by about 1"),
            pytest.warns(sc.ContactWarning, match=r"'joint' starts with an overlap of 1\b"),
        ):
            result = solver.solve()
    else:
        result = solver.solve()
    assert_allclose(result.pressure, overlap, rtol=1e-9)


@pytest.mark.parametrize("gap", [1e-15, 1e-9, 1e-3])
def test_X8_a_gap_that_just_closes(gap):
    """Pressed by more than its gap, a block has the pressure of the rest of the way."""
    result = block_on_floor(x=(0.0, -2 * gap), nu=0.0, gap=gap).solve()
    assert_allclose(result.pressure, gap, rtol=1e-9)


@pytest.mark.every_value
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("n", [(2, 100), (100, 2)], ids=str)
def test_X10_resultants_of_very_different_facets(n, method):
    """Under a given load the resultants are those of statics, however unlike the facets are."""
    low = block_basis(even(n[0]), even(3))
    up = block_basis(even(n[1]), 1 + even(3))
    f = stress_load(up, "top", [[0.0, 2e-4], [2e-4, -1e-3]])
    bodies = [sc.Body(low, elastic(1.0, 0.3), D="bottom"), sc.Body(up, elastic(1.0, 0.3), f)]
    pair = bodies[1].surface("bottom"), bodies[0].surface("top")
    contact = sc.Contact(*pair, friction=sc.Coulomb(0.5), method=method)
    result = sc.ContactSolver(bodies, [contact]).solve()
    # elements up to 33 times as high as wide, on a body that contact alone holds
    assert_allclose(result.force, [-2e-4, 1e-3], rtol=0, atol=1e-8 * 1e-3)
    assert result.certificate.penetration < 1e-9


def test_X14_all_points_slip_and_nothing_holds(refused):
    """A block that friction alone could hold, pushed so that all points slip, is refused."""
    solver = block_on_floor(None, f=(2e-4, -1e-3), friction=sc.Coulomb(0.1))
    with refused(
        sc.errors.NoEquilibrium, match=r"'block' is free to move: translation along x.*friction"
    ):
        solver.solve()


def test_X16_no_load_after_a_history():
    """Unloaded after sliding and lifting off, a held block is where it was, without forces."""
    solver = block_on_floor(x=(1e-3, -1e-2), friction=sc.Coulomb(0.3))
    loaded, lifted, back = solver.history([1.0, -1.0, 0.0])
    assert loaded.normal_force.any() and not lifted.normal_force.any()
    assert not back.u.any() and not back.normal_force.any() and not back.tangential_force.any()


# -- cycles -----------------------------------------------------------------------------------


def fretting(linear="auto", loop="newton", sliding="small", ways=(0.0, 1.0, 0.0, -1.0)):
    """A punch on a block, pressed and pushed to and fro with 0.9 mu P; a cycle of steps."""
    low = block_basis(np.linspace(-2, 2, 17), np.linspace(-1, 0, 4))
    up = block_basis(np.linspace(-0.5, 0.5, 7), np.linspace(0, 0.5, 3))
    bodies = [sc.Body(low, elastic(1.0, 0.3), D="bottom"), sc.Body(up, elastic(1.0, 0.3), name="up")]
    P = stress_load(up, "top", [[0.0, 0.0], [0.0, -1e-3]])
    Q = stress_load(up, "top", [[0.0, 1e-3], [1e-3, 0.0]])
    pair = bodies[1].surface("bottom"), bodies[0].surface("top")
    contact = sc.Contact(*pair, friction=sc.Coulomb(0.5), sliding=sliding)
    cycle = [{"f": {"up": P + 0.45 * q * Q}} for q in ways]
    return sc.ContactSolver(bodies, [contact], linear=linear, loop=loop), cycle


@pytest.mark.slow
@pytest.mark.parametrize(
    ("linear", "loop", "cycles"),
    [("auto", "newton", 1000), ("auto", "direct", 200), ("sparse", "newton", 200)],
)
def test_X25_a_thousand_cycles_without_drift(linear, loop, cycles):
    """After some cycles the state at the end of each is the same to round-off, a thousand times."""
    solver, cycle = fretting(LINEAR[linear], loop, ways=(1.0, -1.0))
    ends = []
    for number, result in enumerate(solver.history(step for _ in range(cycles) for step in cycle)):
        if number % 2:
            ends.append(
                (
                    answer_of(result).state.slip,
                    answer_of(result).state.tangential_force,
                    answer_of(result).state.normal_force,
                )
            )
    assert {1, 2} <= set(result.status.tolist())  # it slips in part
    # loops stop at 1e-10 of the largest force; a drift would sum over the cycles
    share = {"newton": 1e-11, "direct": 1e-8}[loop]
    for now, last in zip(ends[10], ends[-1], strict=True):
        assert_allclose(now, last, rtol=0, atol=share * np.abs(last).max())
    assert result.certificate.worst < 1e-9


@pytest.mark.slow
def test_X25_drift_of_finite_sliding():
    """With frames that follow the surface forces drift by some 4e-6 per cycle at p/E = 1e-3.

    Slip is a sum of increments, each in the frame of its moment. These tilt by p/E and back, so that
    a way there and back does not cancel to second order: over the forces the drift is linear in p/E.
    """
    plain, cycle = fretting(sliding="finite", ways=(1.0, -1.0))
    exact = sc.Options(placement_tolerance=1e-10)
    solver = sc.ContactSolver(plain.system.bodies, plain.contacts, options=exact)
    drift = []
    for load in (1.0, 0.25):
        steps = [{"f": {"up": load * step["f"]["up"]}} for step in cycle] * 20
        ends = [answer_of(r).state.tangential_force for r in solver.history(steps)][1::2]
        drift.append(np.abs(np.diff(ends[5:], axis=0)).max() / np.abs(ends[-1]).max())
    assert drift[0] < 5e-6
    assert drift[0] / drift[1] == pytest.approx(4.0, rel=0.1)  # the order, not the next one


def test_X25_every_cycle_loses_the_same_energy():
    """Once the first reversal is over, cycles close: each loses the same energy to friction."""
    solver, cycle = fretting()
    lost = [r.dissipation_total for r in solver.history(cycle * 20)]
    per_cycle = np.diff(lost[3::4])
    assert per_cycle[-1] > 0
    assert_allclose(per_cycle[2:], per_cycle[-1], rtol=1e-9)


# -- nearly redundant constraints ----------------------------------------------------------------

TILTS = [0.0, *(10.0**k for k in range(-16, -1))]


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("mu", [None, 0.3])
@pytest.mark.parametrize("tilt", TILTS, ids="{:.0e}".format)
def test_redundant_floor_given_twice(tilt, mu, linear):
    """A floor and another one tilted against it by next to nothing carry the load between them."""
    basis = block_basis(even(4), even(4))
    f = stress_load(basis, "top", [[0.0, 0.0 if mu is None else 2e-4], [0.0, -1e-3]])
    if mu is not None:
        f = stress_load(basis, "top", [[0.0, 2e-4], [2e-4, -1e-3]])
    held = basis.nodal_dofs[0, basis.mesh.p[1] == 1] if mu is None else None
    body = sc.Body(basis, elastic(1.0, 0.3), f, D=held, name="block")
    second = sc.RigidPlane((0.5, 0.0), (np.sin(tilt), np.cos(tilt)), name="second")
    friction = None if mu is None else sc.Coulomb(mu)
    contacts = [
        sc.Contact(body.surface("bottom"), plane, friction=friction, name=plane.name)
        for plane in (FLOOR, second)
    ]
    result = sc.ContactSolver(body, contacts, linear=LINEAR[linear]).solve()
    total = result["floor"].force + result["second"].force
    assert_allclose(total[1], 1e-3, rtol=EXACT)
    if mu is not None:
        assert_allclose(total[0], -2e-4, rtol=EXACT)
    # nearly parallel rows that count as one leave gaps of the tilt's own size, up to 1e-10
    assert result.certificate.worst < 1e-10


SHIFTS = [0.0, 1e-16, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6, 1e-4, 1e-2]


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("shift", SHIFTS)
def test_redundant_two_passes(shift, method, linear, refused, monkeypatch):
    """Surfaces each secondary of the other, nodes a hair apart: the uniform stress, or a refusal.

    The forces of the two passes are as good as undetermined; where they alternate the loop says
    that it does not settle. Solvers refuse the two passes at once; here that check is taken away, so
    that rows as redundant as these stay judged.
    """
    low = block_basis(even(4), even(3))
    up = block_basis(
        even(4), 1 + even(3), shape=lambda x: x + shift * np.array([np.sin(np.pi * x[0]), 0 * x[0]])
    )
    x = field(up, lambda x: [0 * x[0], -1e-3 + 0 * x[0]])
    bodies = [sc.Body(low, elastic(1.0, 0.0), D="bottom"), sc.Body(up, elastic(1.0, 0.0), D="top", x=x)]
    a, b = bodies[1].surface("bottom"), bodies[0].surface("top")
    contacts = [
        sc.Contact(a, b, friction=sc.Coulomb(0.3), method=method, name="there"),
        sc.Contact(b, a, friction=sc.Coulomb(0.3), method=method, name="back"),
    ]
    options = sc.Options(max_cuts=0)  # a smaller step is as undetermined
    with pytest.raises(sc.errors.InputError, match="pair the same facets, the one from one side"):
        sc.ContactSolver(bodies, contacts, linear=LINEAR[linear], options=options)
    internals.replace(monkeypatch, "conditions.check_passes", lambda *_: None)
    solver = sc.ContactSolver(bodies, contacts, linear=LINEAR[linear], options=options)
    with refused(sc.errors.NotConverged, match="points still change", either=True) as seen:
        result = solver.solve()
    if seen.happened:
        return
    total = result["there"].force - result["back"].force
    # the share of either pass is determined to eps / shift of the force, displacements being known to
    free = [np.setdiff1d(np.arange(body.n), body.D) for body in bodies]
    condition = max(
        np.linalg.cond(b.K.toarray()[np.ix_(f, f)]) for b, f in zip(bodies, free, strict=True)
    )
    # eps times the condition of the bodies' stiffness; and the inverse on gaps and slips keeps rows up
    # to `DEPENDENT`, whose square it loses of its digits
    dependent = internals.original("problem.DEPENDENT")
    lost = max(shift, 1e-8) if linear == "sparse" else min(max(shift, 1e-8), dependent**2)
    known = np.finfo(float).eps * condition / lost
    # each of the points of both passes has that error, and they are summed
    known *= sum(len(values.normal_force) for values in result.values)
    assert_allclose(total, [0.0, 5e-4], rtol=0, atol=5e-4 * (EXACT + known))
    y = field(low, lambda x: [0 * x[0], -5e-4 * x[1]])
    assert_allclose(result.displacement(bodies[0]), y, rtol=0, atol=5e-4 * 1e-6)


def test_redundant_contradiction_is_named(refused):
    """Glued to two floors at different heights a block can not be: both rows are named."""
    body = block_on_floor().system.bodies[0]
    plane = sc.RigidPlane((0, -0.01), (0, 1), name="cellar")
    contacts = [
        sc.Contact(body.surface("bottom"), floor, tied=True, gap=gap, name=floor.name)
        for floor, gap in ((FLOOR, 0.0), (plane, 0.01))
    ]
    with refused(sc.errors.ConstraintError, match=r"contradict each other: .*cellar asks for .*floor"):
        sc.ContactSolver(body, contacts).solve()


# -- contact pairs far apart, and far from the origin ---------------------------------------------


def placed(at, name):
    """A small block on a wide one, pressed and pushed; loads made before it is moved away."""
    bodies = []
    for part, x, y, D in (
        ("low", even(4), even(2), "bottom"),
        ("up", 0.25 + 0.5 * even(3), 1 + even(2), None),
    ):
        basis = block_basis(x, y)
        f = stress_load(basis, "top", [[0.0, 2e-4], [2e-4, -1e-3]]) if D is None else None
        mesh = replace(basis.mesh, doflocs=basis.mesh.p + np.array(at)[:, None])
        basis = fem.Basis(mesh, basis.elem, intorder=2)
        bodies.append(sc.Body(basis, elastic(1.0, 0.3), f, D=D, name=part + name))
    pair = bodies[1].surface("bottom"), bodies[0].surface("top")
    return bodies, sc.Contact(*pair, friction=sc.Coulomb(0.3), name=name)


@pytest.mark.every_value
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("distance", [1e1, 1e3, 1e6, 1e9])
def test_far_pairs_do_not_feel_each_other(distance, linear):
    """Two pairs of blocks up to 1e9 times their size apart have the answer of one alone."""
    bodies, contact = placed((0.0, 0.0), "alone")
    alone = sc.ContactSolver(bodies, contact).solve()
    here, c_here = placed((0.0, 0.0), "here")
    there, c_there = placed((distance, distance / 3), "there")
    solver = sc.ContactSolver([*here, *there], [c_here, c_there], linear=LINEAR[linear])
    result = solver.solve()
    scale = np.abs(alone.forces).max()
    # eps times the distance over the size of an element: what coordinates have lost
    lost = max(1e-12, 4e-15 * distance)
    # the one at the origin keeps all digits of its own coordinates
    assert_allclose(result["here"].forces, alone.forces, rtol=0, atol=1e-12 * scale)
    assert_allclose(result["there"].forces, alone.forces, rtol=0, atol=lost * scale)
    assert_array_equal(result["there"].status, alone.status)


@pytest.mark.every_value
@pytest.mark.parametrize("method", ["node", "mortar"])
@pytest.mark.parametrize("distance", [1e3, 1e6, 1e9])
def test_far_from_the_origin(distance, method):
    """Uniform pressure and shear, up to 1e9 times the size of the bodies away from the origin."""
    case = Sheared(U=3e-3)
    bodies = []
    for body in case.bodies():
        mesh = body.basis.mesh
        mesh = replace(mesh, doflocs=mesh.p + distance * np.array([[1.0], [0.3]]))
        basis = fem.Basis(mesh, body.basis.elem, intorder=2)
        E = {"low": 1.0, "up": 0.7}[body.name]
        bodies.append(sc.Body(basis, elastic(E, 0.0), body.f, D=body.D, x=body.x, name=body.name))
    contact = case.contact(bodies, method=method)
    case.check(sc.ContactSolver(bodies, [contact]).solve(), max(EXACT, 4e-15 * distance))


@pytest.mark.parametrize("case", [Sheared(U=3e-4), Sheared(U=3e-3)], ids=["stick", "slip"])
def test_X33_turned_as_a_whole(case):
    """Supports turned together by a small angle after loading: forces change by that angle at most."""
    bodies = case.bodies()
    solver = sc.ContactSolver(bodies, [case.contact(bodies)])
    angle = 1e-9
    turned = {}
    for b in bodies:
        x, y = b.basis.doflocs
        by = angle * np.where(b.dof_component == 0, -y, x)
        turned[b.name] = b.x.copy()
        turned[b.name][b.D] += by[b.D]
    first, second = solver.history([1.0, {"x": turned}])
    # rotations of a linear theory leave no stress, but shift the load's friction by the angle
    assert_allclose(second.forces, first.forces, rtol=0, atol=10 * angle * np.abs(first.forces).max())
