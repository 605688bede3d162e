"""Bodies that nothing loads: forces as if they were held, a place by rule, and words that say so."""

from __future__ import annotations

import re
import warnings
from functools import partial

import numpy as np
import pytest
import rectangles
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.conditions import escape
from skfem_contact.history import nearest

FLOOR = sc.RigidPlane((0, 0), (0, 1), name="floor")
LINEAR = {"auto": "auto", "sparse": sc.linalg.Direct()}
# Rigid motions of order 0.01, solved with stiffnesses of order one.
EXACT = 1e-13


block = partial(rectangles.block, n=3, order=2)


def quiet(solve, *args, **settings):
    """An answer and the words of its warnings."""
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        result = solve(*args, **settings)
    return result, " ".join(str(w.message) for w in seen)


@pytest.mark.parametrize("linear", LINEAR)
def test_a_smooth_floor_leaves_the_place_along_it(linear):
    """Pressed straight down on a smooth floor a block rests, wherever it stands; and it is said."""
    punch = block("punch", force=(0.0, -1e-3))
    contact = sc.Contact(punch.surface("bottom"), FLOOR)
    solver = sc.ContactSolver(punch, contact, linear=LINEAR[linear])
    result, words = quiet(solver.solve)
    assert_allclose(result.force, [0.0, 1e-3], atol=1e-15)
    assert result.certificate.worst < 1e-10
    # the answer of the same block held at one node, less its mean movement along the floor
    held = block("punch", force=(0.0, -1e-3), D=punch.basis.nodal_dofs[0, :1])
    known = sc.ContactSolver(held, sc.Contact(held.surface("bottom"), FLOOR)).solve().u.copy()
    along = punch.basis.nodal_dofs[0]
    known[along] -= known[along].mean()
    assert_allclose(result.u, known, atol=EXACT)
    assert "'punch' is indifferent (translation along x): nothing loads it" in words
    assert result.indifferent and result.indifferent[0] in str(result).replace("\n", " ")


@pytest.mark.pairwise
@pytest.mark.parametrize("friction", [None, sc.Coulomb(0.0), sc.Coulomb(0.4)], ids=str)
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_a_block_in_a_gap_stays_where_it_is(n, linear, friction, sliding):
    """An unloaded block between a floor 0.01 below and a punch 0.02 above: it stays until the punch
    carries it along, is squeezed, and stays on the floor when the punch is withdrawn."""
    loose = block("loose", y=(0.01, 1.01), n=n)
    punch = block("punch", y=(1.03, 2.03), n=n, D="top")
    contacts = [
        sc.Contact(loose.surface("bottom"), FLOOR, friction=friction, sliding=sliding, name="below"),
        sc.Contact(
            punch.surface("bottom"),
            loose.surface("top"),
            friction=friction,
            sliding=sliding,
            name="above",
        ),
    ]
    solver = sc.ContactSolver([loose, punch], contacts, linear=LINEAR[linear])
    down = np.isin(np.arange(punch.n), punch.basis.nodal_dofs[1]).astype(float)
    levels = [-0.015, -0.025, -0.04, 0.0]
    if sliding == "finite" and friction is not None and friction.mu:
        levels = levels[:3]  # friction may hold what was squeezed: the step that lets go is refused
    results, words = quiet(
        lambda: list(solver.history([{"x": {"punch": level * down}} for level in levels]))
    )
    places = [r.displacement("loose")[loose.basis.nodal_dofs] for r in results]
    for result, y in zip(results, [0.0, -0.005, None, -0.01][: len(levels)], strict=True):
        u = places.pop(0)
        assert result.certificate.worst < 1e-9
        if y is None:
            assert result["above"].force[1] > 1e-3
            assert_allclose(result["below"].force[1], result["above"].force[1], rtol=1e-9)
            assert not any(re.search("along (x and )?y", text) for text in result.indifferent)
        else:
            assert_allclose(u[1], y, atol=1e-9)
            assert_allclose(u[0], 0.0, atol=1e-9)
            assert max(np.abs(v.forces).max() for v in result.values) < 1e-13
            assert any(re.search("along (x and )?y", text) for text in result.indifferent)
    assert "'loose' is indifferent" in words


@pytest.mark.every_value
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("linear", LINEAR)
def test_a_place_goes_on_from_a_file(tmp_path, linear, sliding):
    """A block that a punch has pushed aside and left stays there, also in a new solver from a file:
    counted from no displacement it would be back where it was meshed."""

    def pushed():
        loose = block("loose", force=(0.0, -1e-3))
        punch = block("punch", x=(-1.1, -0.1), D="left")
        contacts = [
            sc.Contact(loose.surface("bottom"), FLOOR, sliding=sliding, name="below"),
            sc.Contact(loose.surface("left"), punch.surface("right"), name="beside"),
        ]
        along = np.isin(np.arange(punch.n), punch.basis.nodal_dofs[0]).astype(float)
        steps = [{"x": {"punch": level * along}} for level in (0.3, 0.0)]
        return sc.ContactSolver([loose, punch], contacts, linear=LINEAR[linear]), steps

    solver, (push, back) = pushed()
    (there,), _ = quiet(lambda: list(solver.history([push])))
    path = solver.save_state(tmp_path / "there", there)
    (kept,), _ = quiet(lambda: list(solver.history([back], start=there)))
    again, _ = pushed()
    state = again.load_state(again.save_state(tmp_path / "again", again.load_state(path)))
    (result,), words = quiet(lambda: list(again.history([back], start=state)))
    along = solver.system.bodies[0].basis.nodal_dofs[0]
    place = result.displacement("loose")[along].mean()
    # pushed by 0.3 less the gap of 0.1; its own weight makes it wider by some 1e-4
    assert_allclose(place, 0.2, atol=1e-3)
    assert_allclose(place, there.displacement("loose")[along].mean(), atol=1e-9)
    assert_allclose(result.u, kept.u, atol=1e-12)
    assert "'loose' is indifferent (translation along x)" in words


def test_no_friction_at_all_is_no_friction_law():
    """A coefficient of zero models nothing tangential: the answers are the same to the last bit."""
    answers = []
    for friction in (None, sc.Coulomb(0.0), sc.Coulomb(0.3, tau_max=0.0), sc.Tresca(0.0)):
        base = block("base", (-1.0, 2.0), (-1.0, 0.0), n=6, D="bottom")
        tilted = block("tilted", force=(0.0, -1e-3), D=[0])
        joint = sc.Contact(tilted.surface("bottom"), base.surface("top"), friction=friction)
        result = sc.ContactSolver([base, tilted], joint).solve()
        answers.append((result.u, result.slip, result.normal_force, result.status))
        assert not result.tangential_force.any()
    for other in answers[1:]:
        for one, two in zip(answers[0], other, strict=True):
            assert np.array_equal(one, two)


def test_statics_shows_that_there_is_no_equilibrium():
    """Pulled off a floor, or pushed beyond friction: the words say that this is shown, and the motion
    is a certificate: the load drives it and no force within the law works against it."""
    for f, mu in [((0.0, 1e-3), 0.3), ((0.31e-3, -1e-3), 0.3)]:
        punch = block("punch", force=f)
        joint = sc.Contact(punch.surface("bottom"), FLOOR, friction=sc.Coulomb(mu))
        solver = sc.ContactSolver(punch, joint)
        with pytest.raises(
            sc.errors.NoEquilibrium, match="friction at its bound included: there is no"
        ):
            solver.solve()
        motions, kin = solver.linear_model.motions, solver.kin
        c = escape(motions, solver.interface, kin.paired, punch.f)
        assert (motions.modes @ c) @ punch.f > 0
        for side in (-mu, mu):
            assert np.min((motions.normal + side * motions.tangential[:, 0]) @ c) > -1e-12
    rests = 0.29 * np.where(punch.dof_component == 0, 1e-3 / 16, 0.0) - np.where(
        punch.dof_component == 1, 1e-3 / 16, 0.0
    )
    assert escape(motions, solver.interface, kin.paired, rests) is None


def test_the_nearest_place_that_is_free():
    """Against all sets of touching conditions in two dimensions."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        A, wanted = rng.standard_normal((5, 2)), rng.standard_normal(2)
        b = A @ rng.standard_normal(2) - rng.random(5)  # so that some place is free
        y = nearest(A, b, wanted)
        tried = [wanted] + [wanted + a * (h - a @ wanted) / (a @ a) for a, h in zip(A, b, strict=True)]
        tried += [np.linalg.solve(A[[i, j]], b[[i, j]]) for i in range(5) for j in range(i)]
        free = [x for x in tried if np.min(A @ x - b) > -1e-9]
        best = min(free, key=lambda x: np.linalg.norm(x - wanted))
        assert_allclose(y, best, atol=1e-9)
    assert nearest(np.array([[1.0], [-1.0]]), np.array([1.0, 1.0]), np.zeros(1)) is None


# The bodies of a stack that nothing holds along the smooth joint.
MOVE = ("smooth", "rough")


def stack(order=(0, 1, 2), linear="auto", sliding="finite"):
    """A rough block on a smooth one on a base; the rough joint slides far, the smooth one does not."""
    bodies = [
        block("base", y=(-1.0, 0.0), n=2, D="bottom"),
        block("smooth", n=2),
        block("rough", y=(1.0, 2.0), n=3, force=(0.0, -1e-3)),
    ]
    base, smooth, rough = bodies
    contacts = [
        sc.Contact(smooth.surface("bottom"), base.surface("top"), name="below"),
        sc.Contact(
            rough.surface("bottom"),
            smooth.surface("top"),
            friction=sc.Coulomb(0.5),
            sliding=sliding,
            name="above",
        ),
    ]
    return sc.ContactSolver([bodies[i] for i in order], contacts, linear=LINEAR[linear])


@pytest.mark.parametrize("linear", [pytest.param("auto", marks=pytest.mark.slow), "sparse"])
def test_a_smooth_joint_beside_one_that_slides_far(linear):
    """Two blocks that friction holds together rest anywhere along a smooth joint: they move least
    together, whatever the order of bodies, and with the forces of small sliding."""
    known, _ = quiet(stack(linear=linear, sliding="small").solve)
    for order in [(0, 1, 2), (2, 1, 0), (1, 2, 0)]:
        solver = stack(order, linear)
        bodies = dict(zip(solver.system.names, solver.system.bodies, strict=True))
        first, words = quiet(solver.solve)
        second, _ = quiet(solver.solve, start=first, f={"rough": 0.5 * bodies["rough"].f})
        assert "'smooth' is indifferent (translation along x)" in words
        assert "'rough' is indifferent (translation along x)" in words
        for result in (first, second):
            assert result.certificate.worst < 1e-8
            along = [result.displacement(n)[bodies[n].basis.nodal_dofs[0]] for n in MOVE]
            assert abs(np.concatenate(along).mean()) < 1e-12
        for name in ("base", *MOVE):
            off = np.abs(first.displacement(name) - known.displacement(name)).max()
            assert off < 1e-5 * np.abs(known.u).max()  # the turn of the joint that slides far
        assert_allclose(first["below"].force, [0.0, 1e-3], atol=1e-12)
        if order == (0, 1, 2):
            answer = first
        for name in ("base", *MOVE):
            assert_allclose(first.displacement(name), answer.displacement(name), atol=1e-12)


@pytest.mark.parametrize("linear", ["auto", pytest.param("sparse", marks=pytest.mark.slow)])
def test_a_smooth_pad_that_slides_far(linear):
    """In the middle of a base a pad rests by symmetry, also on a joint that slides far; pushed along
    it by a thousandth of its load nothing holds it there."""
    base = block("base", (-1.0, 2.0), (-1.0, 0.0), n=6, D="bottom")
    pad = block("pad", force=(0.0, -1e-3), n=4)
    joint = sc.Contact(pad.surface("bottom"), base.surface("top"), sliding="finite", name="joint")
    for bodies in ([base, pad], [pad, base]):
        solver = sc.ContactSolver(bodies, joint, linear=LINEAR[linear])
        result, words = quiet(solver.solve)
        assert "'pad' is indifferent (translation along x): nothing loads it" in words
        assert_allclose(result["joint"].force, [0.0, 1e-3], atol=1e-11)
        along = result.displacement("pad")[pad.basis.nodal_dofs]
        assert abs(along[0].mean()) < 1e-12
    pushed = np.where(pad.dof_component == 0, 1e-6, -1e-3) / pad.n * 2
    with pytest.raises((sc.errors.NoEquilibrium, sc.errors.NotConverged)):
        quiet(solver.solve, f={"pad": pushed})


@pytest.mark.parametrize("off", [0.05, pytest.param(0.3, marks=pytest.mark.slow)])
def test_what_strains_drive_is_said(off):
    """Beside the middle of its base, which dishes under it, a smooth pad slides: no load works along
    that motion. The refusal says what it takes to hold it, and that is what a support takes."""
    base = block("base", (-1.0, 2.0), (-1.0, 0.0), n=6, D="bottom")
    pad = block("pad", (off, 1 + off), force=(0.0, -1e-3), n=4)
    held = block("pad", (off, 1 + off), force=(0.0, -1e-3), n=4, D=pad.basis.nodal_dofs[0, :1])
    solvers = [
        sc.ContactSolver(
            [base, body],
            sc.Contact(body.surface("bottom"), base.surface("top"), sliding="finite", name="joint"),
        )
        for body in (pad, held)
    ]
    with pytest.raises(
        sc.errors.NoEquilibrium, match=r"'pad' is free to move: translation along x.*strains"
    ) as e:
        quiet(solvers[0].solve)
    joint = solvers[1].solve()["joint"]
    takes = abs(joint.force[0]) / joint.normal_force.max()
    said = float(re.search("takes ([0-9.e-]+) of the largest force", str(e.value)).group(1))
    assert said == pytest.approx(takes, rel=0.05)  # two digits, and the place of another node


@pytest.mark.every_value
@pytest.mark.parametrize("linear", LINEAR)
@pytest.mark.parametrize("swap", [False, True])
def test_a_round_pad_on_a_smooth_base(linear, swap):
    """A round pad could roll on a smooth base as it likes; it stands where symmetry has it."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-0.5, 0.5, 21), np.linspace(0.0, 1.0, 8))
    x, y = mesh.p
    arc = 16.7 - np.sqrt(16.7**2 - x**2)
    mesh = fem.MeshQuad(np.vstack([x, y + (1 - y) * arc]), mesh.t).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    K = linear_elasticity(*lame_parameters(27.0, 0.13)).assemble(basis)
    top = fem.FacetBasis(mesh, basis.elem, facets=mesh.boundaries["top"])
    load = fem.LinearForm(lambda v, w: -2.8e-4 * v[1]).assemble(top)
    pad = sc.Body(basis, K, load, name="pad")
    base = block("base", (-0.75, 0.75), (-1.0, 0.0), n=10, D="bottom")
    joint = sc.Contact(pad.surface("bottom"), base.surface("top"), method="mortar")
    bodies = [pad, base] if swap else [base, pad]
    solver = sc.ContactSolver(bodies, joint, linear=LINEAR[linear])
    result, words = quiet(solver.solve)
    assert "'pad' is indifferent (translation along x with rotation)" in words
    u = result.displacement("pad")[basis.nodal_dofs]
    assert np.abs(u).max() < 1e-2
    # the pad, the base and the load are their own mirror image, and so is the least movement
    mirror = np.argmin(
        np.abs(-mesh.p[0] - mesh.p[0][:, None]) + np.abs(mesh.p[1] - mesh.p[1][:, None]), 1
    )
    assert_allclose(u[0], -u[0][mirror], atol=1e-9 * np.abs(u).max())
    assert_allclose(u[1], u[1][mirror], atol=1e-9 * np.abs(u).max())
    assert result.certificate.worst < 1e-8


def test_a_place_is_said_to_be_indifferent_once_in_a_history():
    """Three steps of one history: one warning; another history: another one."""
    punch = block("punch", force=(0.0, -1e-3))
    solver = sc.ContactSolver(punch, sc.Contact(punch.surface("bottom"), FLOOR))
    for _ in range(2):
        results, words = quiet(lambda: list(solver.history([0.5, 1.0, 0.7])))
        assert words.count("is indifferent") == 1
        assert all(len(r.indifferent) == 1 for r in results)
        # it is not what the model is beyond the bounds of
        assert "Validity of the model: holds" in str(results[-1]), str(results[-1])


def test_an_overlap_of_prescribed_points_is_said_once_in_a_history():
    """And again where it has doubled."""
    punch = block("punch", D="bottom")
    solver = sc.ContactSolver(punch, sc.Contact(punch.surface("bottom"), FLOOR))
    down = np.where(punch.dof_component == 1, -1.0, 0.0)
    depths = [0.01, 0.01, 0.005, 0.011, 0.045, 0.045]
    results, words = quiet(lambda: list(solver.history([{"x": {"punch": d * down}} for d in depths])))
    assert len(results) == len(depths)
    assert words.count("push 4 of 4 points") == 2
    assert "Validity of the model: DOES NOT HOLD (overlap of" in str(results[-1]), str(results[-1])


@pytest.mark.parametrize("order", [1, -1], ids=["block first", "pad first"])
def test_a_place_is_said_where_weak_springs_find_no_answer(order):
    """A smooth pad, off the middle of a stiff block that tilts on a cylinder, may slide along it.

    On weak springs the block rolls off, and what remains is the answer with a DOF of the pad held: seen
    with that DOF held nothing is free, and yet nothing but the hold is against sliding.
    """
    stiff, soft = (linear_elasticity(*lame_parameters(E, 0.3)) for E in (1e3, 1.0))
    lower = fem.MeshQuad.init_tensor(np.linspace(-0.5, 0.5, 3), np.array([0.0, 0.7])).with_defaults()
    upper = fem.MeshQuad.init_tensor(np.array([-0.4, 0.45]), np.array([0.7, 1.3])).with_defaults()
    element = fem.ElementVector(fem.ElementQuad1())
    base = sc.Body(fem.Basis(lower, element), stiff, name="base")
    pad = sc.Body(fem.Basis(upper, element), soft, {"top": (0.0, -3e-5)}, name="pad")
    contacts = [
        sc.Contact(
            base.surface("bottom"),
            sc.RigidCylinder((0, -4.5), 4.5),
            friction=sc.Coulomb(0.1),
            name="floor",
        ),
        sc.Contact(pad.surface("bottom"), base.surface("top"), name="joint"),
    ]
    solver = sc.ContactSolver([base, pad][::order], contacts[::order])
    result, words = quiet(solver.solve)
    assert result.converged
    # by K and f alone: no spring and no load is against the pad's translation
    along = np.zeros(pad.n)
    along[pad.basis.nodal_dofs[0]] = 1.0
    assert np.abs(pad.K @ along).max() < 1e-15
    assert abs(along @ pad.f) < 1e-20
    assert_allclose(result["joint"].force, [0.0, 0.85 * 3e-5], atol=1e-15)  # nor the joint's force
    assert len(result.indifferent) == 1
    assert "'pad' is indifferent (translation along x): nothing holds it there" in result.indifferent[0]
    assert result.indifferent[0] in words
    # the scene is still one where the answer is found with a DOF held
    assert answer_of(result).recover.model is not solver.linear_model


class Hardening(sc.conditions.FrictionLaw):
    """A coefficient of friction that grows with the slip, ``mu + rise |s|``."""

    def __init__(self, mu, rise):
        self.mu, self.rise = mu, rise

    def limit(self, normal_force, area, slip):
        return self.slope(normal_force, area, slip) * normal_force

    def slope(self, normal_force, area, slip):
        return self.mu + self.rise * np.linalg.norm(slip, axis=1)


@pytest.mark.parametrize("loop", ["newton", "direct", "fictitious"])
def test_friction_that_grows_with_the_slip_holds_a_body(loop):
    """A load beyond the friction at rest, nothing else along it: the slip at which both are equal."""
    mesh = fem.MeshQuad.init_tensor(*np.linspace((0, 0), (2, 0.5), 5).T).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    stiff = linear_elasticity(*lame_parameters(1e6, 0.3))
    sledge = sc.Body(basis, stiff, f={"top": (0.5, -1.0)}, name="sledge")
    contact = sc.Contact(sledge.surface("bottom"), FLOOR, friction=Hardening(0.2, 3.0))
    result = sc.ContactSolver(sledge, contact, loop=loop).solve()  # without a warning
    assert result.indifferent == () and result.certificate.worst < 1e-9
    assert set(result.status) == {2}
    # 0.5 = 0.2 + 3 s; the block is strained by 1e-6 or so
    assert_allclose(np.abs(result.slip), 0.1, rtol=0, atol=1e-5)
    # `fictitious` stops at 1e-10 of the largest force at each of five points
    assert_allclose(result.force, [-1.0, 2.0], rtol=5e-10)


def test_friction_that_grows_with_the_slip_holds_a_solid():
    """The same in space, askew: the slip is along the load."""
    t = np.linspace(0.0, 1.0, 3)
    mesh = fem.MeshHex.init_tensor(2 * t, 2 * t, 0.5 * t).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    stiff = linear_elasticity(*lame_parameters(1e6, 0.3))
    low = mesh.facets_satisfying(lambda x: np.isclose(x[2], 0.0))
    load, top = np.zeros(basis.N), np.isclose(mesh.p[2], 0.5)
    load[basis.nodal_dofs[:, top]] = np.array([[0.3], [0.4], [-1.0]]) / np.count_nonzero(top)
    sledge = sc.Body(basis, stiff, load, name="sledge")
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    contact = sc.Contact(sledge.surface(low), floor, friction=Hardening(0.2, 3.0))
    result = sc.ContactSolver(sledge, contact).solve()
    assert result.indifferent == () and result.certificate.worst < 1e-9
    slip = answer_of(result).state.slip
    assert_allclose(slip[:, :2], np.tile([0.06, 0.08], (len(slip), 1)), rtol=0, atol=1e-5)
