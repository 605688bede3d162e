"""The certificate has eyes: answers spoiled on purpose show in the number that is made for them.

Each number is small for the answer as solved, and large for one that is wrong in its own way; so a
number that is left out, or always zero, is noticed here.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from placed import Placement, everywhere
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import Certificate, answer_of

# Answers are exact to round-off of the condition number of bodies of some hundred DOFs.
SOLVED = 1e-11
# Forces are changed by a tenth or more, gaps by a hundredth of the bodies: nothing of it is lost in
# the ratio to the largest force (each point carries some per cent of it) or to the extent.
SEEN = 1e-3


PLAIN = Placement("plain")


def block(name, x, y, placed=PLAIN, E=1.0, **data):
    """A block of 6 by 4 squares, in its place."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(*x, 7), np.linspace(*y, 5)).with_defaults()
    basis = fem.Basis(placed.mesh(mesh), fem.ElementVector(fem.ElementQuad1()))
    if "move" in data:
        data["x"] = np.zeros(basis.N)
        move = placed.unit * placed.vectors(data.pop("move"))
        data["x"][basis.nodal_dofs] = np.reshape(move, (2, 1))
    return sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), name=name, **data)


def solved(sliding="small", gap=0.0, placed=PLAIN, E=1.0):
    """A block on a rough floor, another pressed on it and dragged, and a third glued to its side.

    The upper one hangs over at the right, so that it lifts there: points are open, stick and slip.
    """
    where = {"placed": placed, "E": E}
    low = block("low", (0, 1), (0, 1), **where)
    up = block("up", (0.3, 1.3), (1 + gap, 2 + gap), D="top", move=(0.02, -0.02 - gap), **where)
    side = block("side", (-0.5, 0), (0.2, 1), **where)
    floor = sc.RigidPlane(placed.points([(0, 0)])[0], placed.vectors((0, 1)))
    contacts = [
        sc.Contact(low.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="base"),
        sc.Contact(
            up.surface("bottom"),
            low.surface("top"),
            friction=sc.Coulomb(0.2),
            name="joint",
            sliding=sliding,
        ),
        sc.Contact(low.surface("left"), side.surface("right"), tied=True, name="glue"),
    ]
    return sc.ContactSolver([low, up, side], contacts).solve()


@pytest.fixture(scope="module")
def result():
    return solved()


def spoiled(result, u=None, seen=None, slip0=None, mismatch=None, plastic=None, **state):
    """The result with parts of its state, its gaps or its displacements replaced."""
    parts = {"state": replace(answer_of(result).state, **state)}
    if plastic is not None:
        parts["plastic_slip"] = plastic
    if seen is not None:
        parts["seen"] = replace(answer_of(result).seen, gap0=seen)
    if slip0 is not None:
        parts["seen"] = replace(answer_of(result).seen, slip0=slip0)
    if mismatch is not None:
        parts["mismatch"] = mismatch
    wrong = replace(answer_of(result), **parts)
    vars(wrong)["u"] = result.u if u is None else u
    return sc.answers.ContactResult(wrong).certificate


def size(result):
    """The unit of length, which the lower block is long."""
    return float(result.contacts[0].secondary.lengths.sum())


def part(result, name):
    return answer_of(result).slices()[result.names.index(name)]


def largest(result, name):
    """The point of a contact that carries most."""
    where = part(result, name)
    return where.start + int(np.argmax(answer_of(result).state.normal_force[where]))


def forces_by_a_tenth(result):
    return spoiled(result, normal_force=1.1 * answer_of(result).state.normal_force)


def friction_by_half(result):
    return spoiled(result, tangential_force=0.5 * answer_of(result).state.tangential_force)


def no_friction_where_it_slips(result):
    """Equilibrium with half the friction would be fine with a law that is an upper bound only."""
    force = answer_of(result).state.tangential_force
    return spoiled(
        result, tangential_force=np.where(answer_of(result).state.status[:, None] == 2, 0.0, force)
    )


def friction_along_the_slip(result):
    """Forces within their bounds that drive the slip instead of resisting it."""
    return spoiled(result, plastic=-answer_of(result).plastic_slip)


def friction_beyond_its_bound(result):
    wrong = answer_of(result).state.tangential_force.copy()
    wrong[answer_of(result).state.status == 2] *= 1.2
    return spoiled(result, tangential_force=wrong)


def friction_on_an_open_point(result):
    status = answer_of(result).state.status.copy()
    status[largest(result, "joint")] = 0
    return spoiled(result, status=status)


def a_point_that_pulls(result):
    wrong, i = answer_of(result).state.normal_force.copy(), largest(result, "joint")
    wrong[i] = -wrong[i]
    return spoiled(result, normal_force=wrong)


def lifted(result, name, by):
    """Displacements with the secondary node of the most loaded point moved along the normal."""
    i = largest(result, name)
    contact = result.contacts[result.names.index(name)]
    body = contact.secondary.body
    u = result.u.copy()
    dofs = contact.secondary.dofs[i - part(result, name).start]
    u[result.system.slice(body).start + dofs] += by * answer_of(result).kin.normal[i]
    return u


def a_closed_point_opened(result):
    return spoiled(result, u=lifted(result, "base", 0.01 * size(result)))


def an_open_point_with_force(result):
    """Called open, apart, and yet it presses: equilibrium alone would not mind."""
    status, i = answer_of(result).state.status.copy(), largest(result, "joint")
    status[i] = 0
    gap0 = answer_of(result).seen.gap0.copy()
    gap0[i] += 0.01 * size(result)
    return spoiled(result, seen=gap0, status=status)


def a_gap_closed_too_far(result):
    gap0 = answer_of(result).seen.gap0.copy()
    gap0[largest(result, "joint")] -= 0.01 * size(result)
    return spoiled(result, seen=gap0)


def glue_apart(result):
    gap0 = answer_of(result).seen.gap0.copy()
    gap0[part(result, "glue")] += 0.01 * size(result)
    return spoiled(result, seen=gap0)


def glue_that_slid(result):
    slip0 = answer_of(result).seen.slip0.copy()
    slip0[part(result, "glue")] += 0.01 * size(result)
    return spoiled(result, slip0=slip0)


def slip_of_no_displacements(result):
    """Friction that has followed another slip than that of the bodies."""
    slip, kin = answer_of(result).state.slip.copy(), answer_of(result).kin
    slip[part(result, "base")] *= 1.5
    slip += 1e-3 * size(result) * kin.axes[:, 0]
    return spoiled(result, slip=slip)


def forces_moved_along(result):
    """Normal forces of the floor each at its neighbour: the resultant stays, its moment does not."""
    wrong, where = answer_of(result).state.normal_force.copy(), part(result, "base")
    wrong[where] = np.roll(wrong[where], 1)
    return spoiled(result, normal_force=wrong)


def an_old_placement(result):
    return spoiled(result, mismatch=0.02)


CASES = [
    (forces_by_a_tenth, {"equilibrium", "force_balance"}),
    (friction_by_half, {"equilibrium", "force_balance", "friction"}),
    (no_friction_where_it_slips, {"equilibrium", "friction"}),
    (friction_along_the_slip, {"friction"}),
    (friction_beyond_its_bound, {"equilibrium", "friction"}),
    (friction_on_an_open_point, {"friction"}),
    (a_point_that_pulls, {"equilibrium", "tension"}),
    (a_closed_point_opened, {"equilibrium", "complementarity"}),
    (an_open_point_with_force, {"complementarity"}),
    (a_gap_closed_too_far, {"penetration"}),
    (glue_apart, {"penetration"}),
    (glue_that_slid, {"slip"}),
    (slip_of_no_displacements, {"slip"}),
    (forces_moved_along, {"equilibrium", "moment_balance"}),
    (an_old_placement, {"placement"}),
]


@pytest.mark.parametrize(("spoil", "numbers"), CASES, ids=lambda v: getattr(v, "__name__", ""))
def test_what_is_wrong_shows(result, spoil, numbers):
    """The numbers made for a defect see it."""
    certificate = spoil(result)
    seen = {name for name in numbers if getattr(certificate, name) > SEEN}
    assert seen == numbers
    if numbers != {"placement"}:  # which the size of a step decides, no round-off
        assert certificate.worst > SEEN


@everywhere
@pytest.mark.parametrize("E", [1.0, 210e9, 1e-9])
def test_numbers_are_alike_wherever_a_scene_lies(result, placed, E):
    """Moved, turned, stiff and soft, in any unit: a defect has the number of the plain view.

    Each number is made for something: of a spoiled answer it is a share of forces or of the extent,
    which no place, modulus or unit changes.
    """
    there = solved(placed=placed, E=E)
    # coordinates of a thousand sizes leave 13 digits of a gap of a hundredth: 11 of forces
    lost = 1e-10 if placed.move else 1e-12
    values = {f.name: getattr(there.certificate, f.name) for f in fields(Certificate)}
    assert max(values.values()) < max(SOLVED, lost)
    assert np.array_equal(answer_of(there).state.status, answer_of(result).state.status)
    # of what was changed by a tenth: the digits of forces, and those that cancelling takes
    alike = 1e-7 if placed.move else 1e-9
    turned = result if placed.turn == 0 else solved(placed=Placement("turned", placed.turn))
    for spoil, _ in CASES:
        plain, known, found = (vars(spoil(each)) for each in (result, turned, there))
        for name, value in found.items():
            assert abs(value - known[name]) <= alike * max(known[name], SEEN), (spoil, name)
            # forces are compared entry by entry, with the largest entry, and the extent is along an
            # axis: a turn may change each by the root of two
            assert known[name] < SEEN or 0.5 <= known[name] / plain[name] <= 2.0, (spoil, name)


@everywhere
@pytest.mark.parametrize("E", [1.0, 210e9, 1e-9])
def test_forces_and_moments_balance_with_K(placed, E):
    """What a body's K makes of the displacements is what its contacts and its supports press with.

    By numbers that users see: the forces and moments of contacts, reactions, and ``K u``.
    """
    there = solved(gap=0.2, placed=placed, E=E)
    centre, size = placed.points([(0.4, 0.9)])[0], placed.unit
    scale = np.abs(there["joint"].force).max()
    assert scale > 1e-3 * E * size
    # a gap is a difference of coordinates: of them 13 digits are left after the move
    lost = (1e-9 if placed.move else 1e-12) * scale
    pressed = {name: np.zeros(2) for name in ("low", "up", "side")}
    for name, sides in {"base": ("low",), "joint": ("up", "low"), "glue": ("low", "side")}.items():
        for sign, of in zip((1.0, -1.0), sides, strict=False):
            pressed[of] += sign * there[name].force
    pressed["up"] += there.reaction("up")
    for body, K in zip(there.system.bodies, answer_of(there).stiffness, strict=True):
        nodal = (K @ there.displacement(body.name))[body.basis.nodal_dofs]
        assert np.abs(nodal.sum(axis=1)).max() < lost  # no support is part of K
        assert np.abs(pressed[body.name]).max() < lost
    # what K makes of the nodes that only the joint touches has the moment of the joint
    up = there.system.bodies[1]
    nodal = (up.K @ there.displacement("up"))[up.basis.nodal_dofs].T
    free = ~np.isin(up.basis.nodal_dofs[0], up.D)
    arm = up.basis.mesh.p.T - centre
    turning = (arm[:, 0] * nodal[:, 1] - arm[:, 1] * nodal[:, 0])[free].sum()
    assert abs(turning - there["joint"].moment(centre)) < lost * size
    # moved by friction across a gap: the certificate says as much in any unit
    plain = solved(gap=0.2, placed=Placement("turned", placed.turn)).certificate
    for name in ("moment_gap", "moment_normal"):
        assert abs(getattr(there.certificate, name) - getattr(plain, name)) < 1e-9
    assert there.certificate.worst < (1e-10 if placed.move else SOLVED)


def test_the_answer_as_solved(result):
    """All numbers are round-off, but for the moment of friction on tilted and parted surfaces."""
    values = {f.name: getattr(result.certificate, f.name) for f in fields(Certificate)}
    assert set(answer_of(result).state.status) == {0, 1, 2}
    assert max(values.values()) < SOLVED
    assert result.certificate.worst == max(values.values())


def test_every_number_is_seen():
    """No number of the certificate is without a defect of its own, here or in the next test."""
    made_for = set().union(*(numbers for _, numbers in CASES)) | {"moment_gap", "moment_normal"}
    assert made_for == {f.name for f in fields(Certificate)}


def test_moments_of_gaps_and_of_normals():
    """Friction across an initial gap of .2 has the moment Q .2; in the scene without one it has none.

    Over the sum of the forces times the extent, as the certificate says.
    """
    apart = solved(gap=0.2)
    joint = apart["joint"]
    f = answer_of(apart).case.f
    K_u = np.concatenate(
        [
            K @ apart.displacement(name)
            for K, name in zip(answer_of(apart).stiffness, apart.system.names, strict=True)
        ]
    )
    contact = answer_of(apart).kin.B_n.T @ answer_of(apart).state.normal_force
    contact -= answer_of(apart).kin.B_t.T @ answer_of(apart).local.tangential_force.ravel()
    reactions = (K_u - f - contact)[apart.system.D]
    total = max(np.abs(reactions).sum(), np.abs(contact).sum())
    expected = abs(0.2 * joint.force[0]) / (total * apart.system.extent)
    assert expected > SEEN
    assert abs(apart.certificate.moment_gap - expected) < 1e-12  # round-off
    assert apart.certificate.moment_balance < SOLVED


def quarter(name, r, facets, **data):
    """A quarter of a ring, of straight facets."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(*r, 4), np.linspace(0, np.pi / 2, facets + 1))
    mesh = mesh.with_defaults()
    radius, angle = mesh.p
    turned = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    mesh = type(mesh)(turned, mesh.t, _boundaries=mesh.boundaries)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    return sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), name=name, **data)


def test_moment_of_normals_that_are_not_the_facets_own():
    """Nodes of a polygon on the facets of another are apart across the normal that is a mean."""
    shaft, hub = quarter("shaft", (0.5, 1), 5, D="left"), quarter("hub", (1, 2), 8, D="right")
    more_to_the_right = lambda x: 0.01 * x[0]  # noqa: E731
    press = sc.Contact(
        hub.surface("left"),
        shaft.surface("right"),
        method="node",
        interference=more_to_the_right,
        gap=0.0,
    )
    certificate = sc.ContactSolver([shaft, hub], [press]).solve().certificate
    assert certificate.moment_normal > 1e-6
    assert certificate.moment_balance < SOLVED


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_moments_balance_where_slip_has_rows_of_its_own(mu):
    """On lines of symmetry the slip is that of the nodes: the vector of a row is that of its weights.

    Taken from both rows at once they were wrong by the difference, and the balance by 1e-6.
    """

    def rollers(name, r, facets):
        basis = quarter(name, r, facets).basis
        D = [basis.get_dofs("bottom").all("u^2"), basis.get_dofs("top").all("u^1")]
        return basis, np.concatenate(D)

    basis, D = rollers("shaft", (0.5, 1), 8)
    shaft = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), D=D, name="shaft")
    basis, D = rollers("hub", (1, 2), 5)
    rim = fem.FacetBasis(basis.mesh, basis.elem, facets="right")
    f = fem.LinearForm(lambda v, w: -1e-3 * (1 + w.x[0] ** 3) * v[0]).assemble(rim)
    hub = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), f=f, D=D, name="hub")
    press = sc.Contact(
        shaft.surface("right"),
        hub.surface("left"),
        method="mortar",
        interference=1e-3,
        friction=sc.Coulomb(mu) if mu else None,
    )
    certificate = sc.ContactSolver([shaft, hub], [press]).solve().certificate
    # between smooth boundaries the vector of a gap is along its normal
    assert certificate.moment_normal < SOLVED
    assert certificate.moment_balance < SOLVED


def test_a_contact_that_carries_round_off_has_no_digits():
    """Forces of 1e-14 of those of another contact may be anything within the law's own round-off."""
    result = solved()
    where = part(result, "joint")
    normal, along = (
        answer_of(result).state.normal_force.copy(),
        answer_of(result).state.tangential_force.copy(),
    )
    small = 1e-14
    normal[where] *= small
    along[where] = 2 * small * np.abs(along[where]).max()
    certificate = spoiled(result, normal_force=normal, tangential_force=along)
    assert certificate.friction < 1e-3


def test_springs_inside_K_bear_their_part() -> None:
    """A block on an inclined floor that uneven springs alone hold: they balance force and moment."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    springs = np.zeros(basis.N)
    springs[basis.get_dofs("top").all()] = np.linspace(0.1, 0.9, 10)  # stiffness of order one
    K = linear_elasticity(1.0, 1.0).assemble(basis)
    body = sc.Body(basis, K + sp.diags(springs), f={"left": (0.003, -0.01)}, name="block")
    floor = sc.RigidPlane((0.0, 0.0), (0.1, 1.0), name="floor")
    contact = sc.Contact(body.surface("bottom"), floor, gap=0.0, friction=sc.Coulomb(0.3))
    result = sc.ContactSolver(body, contact).solve()
    pull = springs * result.u
    # without the springs the balance would miss this: more than a thousandth of the load of 0.01
    assert abs(pull.sum()) > SEEN * 0.01
    assert result.certificate.force_balance < 1e-12
    assert result.certificate.moment_balance < 1e-12


@pytest.mark.parametrize("loop", ["fictitious", "direct"])
def test_springs_do_not_count_an_error_twice(loop: str) -> None:
    """Forces known to 1e-6 make slips of springs wrong by 1e-6 over G: that is no second violation.

    Turned back a little from full slip all points stick, and what their soft springs give back is
    all there is of plastic slip; the certificate said 4e-3 of it.
    """
    body = block("body", (0, 1), (0, 1), D="top")
    floor = sc.RigidPlane((0, 0), (0, 1))
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.2, stiffness=0.01))
    solver = sc.ContactSolver(body, contact, loop=loop, options=sc.Options(tolerance=1e-6))
    path = [(0.0, 0.01), (0.3, 0.02), (2.0, 0.02), (1.97, 0.02)]
    results = list(solver.history({"x": {"body": {"top": (a, -b)}}} for a, b in path))
    slips, back = results[2], results[3]
    assert (slips.status == 2).all() and (back.status == 1).all()
    assert back.certificate.friction <= 1e-6
    # and what slips is held to its bound, and against the slip, as without springs
    assert friction_by_half(slips).friction > SEEN
    assert friction_along_the_slip(slips).friction > SEEN


def test_what_is_no_round_off_stands_under_its_own_heading():
    """The moment of friction across a gap: large, though the equations are solved."""
    apart = solved(gap=2.0)
    assert apart.certificate.worst < SOLVED and apart.certificate.moment_gap > 0.03
    report = apart.report()
    head, model = report.index("round-off where everything holds"), report.index("(not round-off)")
    for name in ("equilibrium", "penetration", "slip", "force balance", "moment balance"):
        assert head < report.index(f"  {name} ", head) < model
    for name in ("moment gap", "moment normal", "placement"):
        assert report.index(f"  {name} ") > model


@pytest.mark.parametrize("name", [f.name for f in fields(Certificate)])
def test_the_worst_is_any_of_the_numbers_that_have_to_be_round_off(name):
    """Each number alone makes the worst, but for the three that measure the model."""
    values = {f.name: 1e-15 for f in fields(Certificate)}
    modelled = name in ("moment_gap", "moment_normal", "placement")
    assert Certificate(**{**values, name: 0.5}).worst == (1e-15 if modelled else 0.5)
    # problems without moments have none to balance; any other number that is missing is the worst
    missing = Certificate(**{**values, name: np.nan}).worst
    assert np.isnan(missing) != (modelled or name == "moment_balance")


def test_loads_of_a_rigid_tool_balance():
    """A tool on a block, by a force off its centre and a moment, and one that a support keeps upright.

    What a tool presses with is a force between bodies: only its own load and its supports are external.
    The supports of a block see both, forces and moments.
    """
    for held in ({}, {"D": "rotation"}):
        body = block("block", (0, 2), (-1, 0), D="bottom")
        box = [(0.3, 0.0), (1.7, 0.0), (1.7, 0.5), (0.3, 0.5)]
        shape = sc.RigidPolyline(box, closed=True, name="die")
        die = sc.RigidBody(shape, force=(0.002, -0.02), moment=0.003, about=(0.8, 0.4), **held)
        touch = sc.Contact(body.surface("top"), die, friction=sc.Coulomb(0.3), name="touch")
        result = sc.ContactSolver([body, die], [touch]).solve()
        certificate = result.certificate
        assert certificate.worst < SOLVED and certificate.moment_balance < SOLVED
        # the support of the block bears all of the force, and the moment about the tool's point
        assert np.abs(result.reaction("block") + [0.002, -0.02]).max() < 1e-13
        # forces of another size balance neither
        spoilt = spoiled(result, normal_force=1.1 * answer_of(result).state.normal_force)
        assert spoilt.equilibrium > SEEN


def test_axisymmetric_bodies_balance_along_their_axis():
    """A shaft pressed into a rigid wall: radial forces balance around the axis, and have no moment."""

    @fem.BilinearForm
    def ring(u, v, w):
        du, dv, r = u.grad, v.grad, w.x[0]
        strain = du[0, 0] * dv[0, 0] + du[1, 1] * dv[1, 1] + u[0] * v[0] / r**2
        shear = 0.5 * (du[0, 1] + du[1, 0]) * (dv[0, 1] + dv[1, 0])
        return 2 * np.pi * r * (strain + shear)

    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 2, 7)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=4)
    D = np.union1d(basis.get_dofs("left").all("u^1"), basis.get_dofs("bottom").all("u^2"))
    shaft = sc.Body(basis, ring, D=D, measure=lambda x: 2 * np.pi * x[0], name="shaft")
    wall = sc.RigidPlane((1.0, 0.0), (-1.0, 0.0), name="wall")
    fit = sc.Contact(shaft.surface("right"), wall, interference=0.01, name="fit")
    result = sc.ContactSolver(shaft, fit).solve()
    assert abs(result["fit"].force[0]) > 0.01
    assert result.certificate.worst < SOLVED
    assert np.isnan(result.certificate.moment_balance) and np.isnan(result.certificate.moment_gap)


def test_glue_without_shear_has_not_slid_either(result):
    """Slip counts where friction holds, and where glue does, though the glue may carry no shear."""
    none = np.zeros_like(answer_of(result).state.tangential_force)
    slip0 = answer_of(result).seen.slip0.copy()
    slip0[part(result, "glue")] += 0.01
    assert spoiled(result, tangential_force=none, slip0=slip0).slip > SEEN
    # what neither holds may slide as it likes
    slip0 = answer_of(result).seen.slip0.copy()
    slip0[part(result, "base")] += 0.01
    assert spoiled(result, tangential_force=none, slip0=slip0).slip < SOLVED
    assert spoiled(result, slip0=slip0).slip > SEEN


def test_slips_without_digits_turn_no_force(result):
    """Plastic slips of 1e-17, where displacements are a hundredth, are none that friction would follow.

    Counted as slips they would turn forces at points that stick by as much as the largest force.
    """
    zero = np.zeros_like(answer_of(result).plastic_slip)
    slips = answer_of(result).state.status == 2
    own = np.where(slips[:, None], 0.0, answer_of(result).state.tangential_force)
    still = spoiled(result, plastic=zero, tangential_force=own)
    noise = np.where(slips[:, None], 0.0, 1e-17)
    for sign in (1.0, -1.0):
        found = spoiled(result, plastic=sign * noise, tangential_force=own)
        assert abs(found.friction - still.friction) < 1e-6  # 1e-17 over 1e-6 of a hundredth


@pytest.mark.filterwarnings("ignore::skfem_contact.ContactWarning")
@pytest.mark.parametrize(("aside", "down"), [(1.0, 1e-8), (0.0, 1e-18)], ids=["far", "little"])
def test_light_forces_of_large_and_of_small_motions_have_a_scale(aside, down):
    """Supports that press by little are answered by light forces, and these are the scale.

    A body moved aside by its own size has forces of 1e-8 in sums of the order of one: eight digits
    are left. One pressed by 1e-18 has no larger force than that either. Neither force is the round-off
    of no load.
    """
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    form = linear_elasticity(*lame_parameters(1.0, 0.3))
    body = sc.Body(basis, form, D="top", x={"top": (aside, -down)}, name="body")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    result = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, gap=0.0)).solve()
    assert 0.5 * down < result.force[1] < 2 * down
    assert result.certificate.worst < 1e-6
    assert forces_by_a_tenth(result).equilibrium > 0.01
    assert forces_by_a_tenth(result).force_balance > 0.01
