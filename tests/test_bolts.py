"""Bolts: tightened by force or stretch, locked, one after the other; what they carry."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
import skfem as fem
from bolted import STEEL, TIGHTEN, clamped, grid, parts, pull_of, pulled, stack, upright
from skfem.helpers import grad
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.conditions import LoadCase

ROUTES = [
    "condensed",
    "iterated",
    sc.linalg.Direct(),
    pytest.param(sc.linalg.AMG(), marks=pytest.mark.slow),
]


@pytest.mark.parametrize("linear", ROUTES, ids=["condensed", "iterated", "direct", "multigrid"])
def test_clamped_stack(linear):
    """kb 2, kp 8, preload 10: the bolt has 11, 12.48, 12.6 at loads of 5, 12.4, 12.6."""
    solver = stack(linear=linear)
    loads = [{"f": {"head": {"y": pull}}} for pull in (5.0, 12.4, 12.49, 12.51)]
    with pytest.warns(sc.ContactWarning, match="'plate' is indifferent"):  # the last load opens it
        results = list(solver.history([TIGHTEN, *loads]))
    found = [result.bolts["M"].force for result in results]
    # GMRES with multigrid solves to 1e-10
    np.testing.assert_allclose(found, [10, 11, 12.48, 12.498, 12.51], rtol=1e-9)
    joint = [result["joint"].force[1] for result in results]
    np.testing.assert_allclose(joint, [-10, -6, -0.08, -0.008, 0], atol=1e-8)
    assert [bool(result["joint"].status.any()) for result in results] == [True] * 4 + [False]
    # d = F (1 / kb + 1 / kp)
    assert results[0].bolts["M"].stretch == pytest.approx(10 / 2e5 + 10 / 8e5, rel=1e-9)
    assert results[-1].bolts["M"].stretch == pytest.approx(results[0].bolts["M"].stretch, rel=1e-9)
    assert max(result.certificate.worst for result in results) < 1e-9


def test_multigrid_of_bodies_of_few_nodes():
    """Their coarsest grids are singular: three rigid motions of two nodes depend on each other."""
    (tight,) = stack(linear=sc.linalg.AMG()).history([TIGHTEN])
    assert tight.bolts["M"].force == pytest.approx(10.0, rel=1e-9)
    assert tight["joint"].force[1] == pytest.approx(-10.0, rel=1e-9)


def test_a_saved_state_goes_on_by_another_solver(tmp_path):
    """Tightened with factors, saved, loaded by multigrid."""
    solver, other = stack(), stack(linear=sc.linalg.AMG())
    (tight,) = solver.history([TIGHTEN])
    state = other.load_state(solver.save_state(tmp_path / "tight.npz", tight))
    (pulled,) = other.history([{"f": {"head": {"y": 5.0}}}], start=state)
    assert pulled.bolts["M"].force == pytest.approx(11.0, rel=1e-9)
    assert pulled.joints()["joint"].force[1] == pytest.approx(-6.0, rel=1e-8)


@pytest.mark.parametrize("loop", ["direct", "fictitious"])
def test_other_loops_tighten_alike(loop):
    """All loops find the same bolt."""
    *_, last = stack(loop=loop).history([TIGHTEN, {"f": {"head": {"y": 5.0}}}])
    assert last.bolts["M"].force == pytest.approx(11.0, rel=1e-9)


def test_a_stretch_is_the_same_as_the_force_that_it_makes():
    """By force, by stretch, and by a path of stretches the bolt ends at the same."""
    solver = stack()
    tight = solver.history([TIGHTEN])
    d = next(tight).bolts["M"].stretch
    for path in ([1.0], [0.3, 1.4, 1.0]):
        *_, last = solver.history([{"bolt": {"M": {"stretch": share * d}}} for share in path])
        assert last.bolts["M"].force == pytest.approx(10.0, rel=1e-10)
    with pytest.warns(sc.ContactWarning, match="'plate' is indifferent"):
        *_, loose = solver.history([TIGHTEN, {"bolt": {"M": {"force": 0.0}}}])
    assert abs(loose.bolts["M"].force) < 1e-12 * 10
    assert abs(loose["joint"].force).max() < 1e-12 * 10


def test_locked_bolts_stay_as_they_are():
    """A step that names no bolt, with the same loads, moves nothing; so does a solver with one more."""
    solver = stack()
    tight, again = solver.history([TIGHTEN, {"x": {}}])
    assert abs(again.u - tight.u).max() < 1e-12 * abs(tight.u).max()
    assert again.bolts["M"].stretch == tight.bolts["M"].stretch
    softer = solver.with_stiffness("plate", 0.5 * solver.system.bodies[1].K)
    *_, last = softer.history([TIGHTEN, {"f": {"head": {"y": 5.0}}}])
    assert last.bolts["M"].force == pytest.approx(10 + 5 * 2 / 6, rel=1e-10)


def test_saved_states_keep_bolts(tmp_path):
    """From a file, and by pickle, a history goes on with the bolt as it was."""
    solver = stack()
    (tight,) = solver.history([TIGHTEN])
    start = solver.load_state(solver.save_state(tmp_path / "tight.npz", tight))
    pull = {"f": {"head": {"y": 5.0}}}
    for begin in (tight, start):
        (found,) = solver.history([pull], start=begin)
        assert found.bolts["M"].force == pytest.approx(11.0, rel=1e-10)
        (more,) = solver.history([{"bolt": {"M": {"force": 20.0}}}], start=begin)
        assert more.bolts["M"].force == pytest.approx(20.0, rel=1e-10)
        assert more.bolts["M"].stretch == pytest.approx(2 * tight.bolts["M"].stretch, rel=1e-10)
    # with a load that a step has named, which stays as well
    saved = solver.load_state(solver.save_state(tmp_path / "pulled.npz", found))
    for begin in (found, saved):
        again = solver.solve(start=begin)
        assert abs(again.u - found.u).max() < 1e-12 * abs(found.u).max()
        assert again.bolts["M"].force == pytest.approx(11.0, rel=1e-10)
        assert solver.solve({"head": {"y": 5.0}}, start=begin).bolts["M"].force == pytest.approx(11.0)
    with pytest.raises(sc.errors.InputError) as stopped:  # results before what failed are as they were
        for _ in solver.history([TIGHTEN, 1.0, pull, {"bolt": 1.0}]):
            pass  # nobody holds them
    kept = [result.bolts["M"].force for result in stopped.value.results]
    np.testing.assert_allclose(kept, [10.0, 10.0, 11.0], rtol=1e-10)
    assert max(result.certificate.worst for result in stopped.value.results) < 1e-9
    copy = pickle.loads(pickle.dumps(tight))
    assert copy.bolts["M"].force == tight.bolts["M"].force
    assert str(copy.joints()) == str(tight.joints())


# -- solids: a bolt with head and nut through two plates ------------------------------------------


@pytest.mark.parametrize(
    ("kind", "plates", "at"),
    [
        (fem.MeshHex, fem.MeshHex, 2.4),
        (fem.MeshTet, fem.MeshTet, -2.6),
        (fem.MeshTet, fem.MeshTet, 0.1),
        (fem.MeshTet, fem.MeshHex, 0.1),
        (fem.MeshTet2, fem.MeshTet, 0.1),
    ],
)
def test_head_and_nut_carry_the_given_force(kind, plates, at):
    """On any mesh and any jagged section, to nine digits; and what balances it under a load."""
    first = fem.MeshTet if kind is fem.MeshTet2 else kind
    meshes = [parts(first)[0], *parts(plates)[1:]]
    if kind is fem.MeshTet2:
        meshes[0] = fem.MeshTet2.from_mesh(meshes[0])
    solver = clamped(meshes, at=at)
    tight, loaded = pulled(solver)
    for name, sign in (("head", 1), ("nut", -1), ("joint", 1)):
        assert sign * tight[name].force[2] == pytest.approx(8e3, rel=1e-9)
    bolt = loaded.bolts["M"]
    assert loaded["head"].force[2] == pytest.approx(bolt.force, rel=1e-9)
    assert -loaded["nut"].force[2] == pytest.approx(bolt.force, rel=1e-9)
    assert bolt.force == pytest.approx(loaded["joint"].force[2] + 1500, rel=1e-9)
    # on the part beyond the section: the force and the moment of the head about the point
    np.testing.assert_allclose(bolt.shear[:2], loaded["head"].force[:2], atol=1e-9 * bolt.force)
    moment = loaded["head"].moment((0, 0, at))
    assert bolt.bending == pytest.approx(np.hypot(*moment[:2]), abs=1e-8 * bolt.force)
    assert bolt.torsion == pytest.approx(moment[2], abs=1e-8 * bolt.force)
    assert max(tight.certificate.worst, loaded.certificate.worst) < 1e-9


def test_a_section_is_a_mesh_that_is_cut():
    """Two halves, glued with an interference at the section, are the bolt with that stretch."""
    meshes = parts(fem.MeshHex)
    solver = clamped(meshes, at=0.4)
    tight, loaded = upright()
    d = tight.bolts["M"].stretch
    # the section is at z = 0, as the middles of the elements below are below the plane
    whole = solver.system.bodies[0].basis.mesh
    above = whole.restrict(whole.elements_satisfying(lambda x: x[2] > 0))
    below = whole.restrict(whole.elements_satisfying(lambda x: x[2] < 0))
    element = fem.ElementVector(fem.ElementHex1())
    halves = [
        sc.Body(fem.Basis(mesh, element, intorder=2), STEEL, name=name)
        for mesh, name in ((above, "above"), (below, "below"))
    ]
    _, upper, lower = solver.system.bodies
    joint = solver.contacts[2]

    def on(z):
        return lambda x: abs(x[2] - z) < 1e-6

    friction = sc.Coulomb(0.2)
    contacts = [
        sc.Contact(halves[0].surface(on(3)), upper.surface(on(3)), friction=friction, name="head"),
        sc.Contact(halves[1].surface(on(-3)), lower.surface(on(-3)), friction=friction, name="nut"),
        joint,
        sc.Contact(halves[0].surface(on(0)), halves[1].surface(on(0)), tied=True, name="cut"),
    ]
    cut = sc.ContactSolver([*halves, upper, lower], contacts)
    f = pull_of(upper)
    steps = [{"interference": {"cut": -d}}, {"f": {"upper": f}}]
    for ours, theirs in zip((tight, loaded), cut.history(steps), strict=True):
        scale = abs(ours["head"].normal_force).max()
        for name in ("head", "joint"):
            np.testing.assert_allclose(
                ours[name].forces, theirs[name].forces, atol=1e-8 * scale, err_msg=name
            )
        assert -theirs["cut"].force[2] == pytest.approx(ours.bolts["M"].force, rel=1e-8)


@pytest.mark.slow
def test_a_step_that_is_cut_ends_at_the_given_force(monkeypatch):
    """Parts of the step have parts of the force, from the one that the bolt had."""
    seen, whole_way = [], LoadCase.towards

    def watched(case, other, share):
        found = whole_way(case, other, share)
        seen.append((share, case.bolts.force[0], found.bolts.force[0]))
        return found

    monkeypatch.setattr(LoadCase, "towards", watched)
    whole = clamped(parts(fem.MeshHex))
    far = [replace(contact, sliding="finite") for contact in whole.contacts]
    hasty, bodies = sc.Options(max_iterations=4), whole.system.bodies
    bolt = sc.Bolt(bodies[0], point=(0, 0, 0.4), axis=(0, 0, 1))
    solver = sc.ContactSolver(bodies, far, bolts=[bolt], options=hasty)
    steps = [{"bolt": {"bolt 1": {"force": force}}} for force in (8e3, 2e4)]
    for before, force, tight in zip((0.0, 8e3), (8e3, 2e4), solver.history(steps), strict=True):
        assert "step cut" in tight.message
        assert tight["head"].force[2] == pytest.approx(force, rel=1e-9)
        assert tight.certificate.worst < 1e-9
        share, at_first, there = seen[0]
        assert at_first == pytest.approx(before, abs=1e-9)
        assert there == pytest.approx(before + share * (force - before))
        seen.clear()


def rotation():
    """By .7 about (1, 2, 3)."""
    a = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    return np.eye(3) + np.sin(0.7) * cross + (1 - np.cos(0.7)) * cross @ cross


@pytest.mark.parametrize(
    ("settings", "unit"),
    [
        ({"turn": rotation()}, 1.0),
        ({"seed": 5}, 1.0),
        ({"axis": -3.0}, 1.0),
        ({"at": -2.4}, 1.0),
        ({"unit": 1e-3, "form": linear_elasticity(*lame_parameters(210e9, 0.3))}, 1e-3),
        ({"turn": np.diag([-1.0, 1.0, 1.0])}, 1.0),
    ],
    ids=["turned", "renumbered", "other end", "elsewhere", "metres", "mirrored"],
)
def test_bolts_do_not_depend_on_axes_numbers_and_units(settings, unit):
    """Force, stretch, shear and bending are what they were, turned with the bodies."""
    meshes, first = parts(fem.MeshHex), upright()
    if "turn" in settings and np.linalg.det(settings["turn"]) < 0:  # sides of elements keep theirs
        meshes = [fem.MeshHex(m.p, m.t[[1, 0, 4, 5, 2, 3, 7, 6]]) for m in meshes]
    turn = settings.get("turn")
    other = pulled(clamped(meshes, **settings), turn, unit)
    sign = -1.0 if settings.get("axis", 1.0) < 0 else 1.0
    turn = np.eye(3) if turn is None else turn
    for a, b in zip(first, other, strict=True):
        a, b = a.bolts["M"], b.bolts["M"]
        assert b.force == pytest.approx(a.force, rel=1e-9)
        assert b.stretch == pytest.approx(unit * a.stretch, rel=1e-9)
        np.testing.assert_allclose(b.shear, sign * turn @ a.shear, atol=1e-9 * a.force)
        if "at" not in settings:  # bending is about the point
            assert b.bending == pytest.approx(unit * a.bending, abs=unit * 1e-8 * a.force)


# -- several bolts ---------------------------------------------------------------------------------


@fem.BilinearForm
def fibres(u, v, w):
    """Fibres along z of modulus 1e4 that do not feel each other: a bed of springs."""
    return 1e4 * sum(grad(u)[i, 2] * grad(v)[i, 2] for i in range(3))


def bedded(places, names):
    """A rigid flange on a bed of springs, held down by bolts at some places; and its closed form.

    The flange moves by q: up, and by turns about x and y. A spring at (x, y) of stiffness c is drawn by
    a q with a = (1, y, -x); springs over an area resist by the integral of c a a' over it.
    """

    def column(x, y, half, cells, height, name):
        mesh = grid(*(np.linspace(c - half, c + half, cells + 1) for c in (x, y)), [0, 1.5, 3, 4])
        mesh = mesh.scaled((1, 1, height / 4)).with_defaults()
        floor, top = (lambda x: x[2] < 1e-9), (lambda x, h=height: x[2] > h - 1e-9)
        mesh = mesh.with_boundaries({"floor": floor, "upper": top})
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
        a = np.array([1.0, y, -x])
        turns = np.diag([0.0, 1.0, 1.0]) * (2 * half) ** 2 / 12
        k = 1e4 * (2 * half) ** 2 / height
        return sc.Body(basis, fibres, D="floor", name=name), k * np.outer(a, a), k * turns, a, k

    bed, K, own, _, _ = column(0.0, 0.0, 5.0, 4, 4.0, "bed")
    resists = K + own
    shanks, arms = [], []
    for (x, y), name in zip(places, names, strict=True):
        body, _, bends, a, k = column(x, y, 0.5, 1, 4.0, name)
        resists = resists + bends
        shanks.append(body)
        arms.append(a)
    down = sc.RigidPlane((0, 0, 4), (0, 0, -1))
    D = ("x", "y", "rotation z")
    flange = sc.RigidBody(down, about=(0, 0, 4), D=D, name="flange")
    contacts = [sc.Contact(bed.surface("upper"), flange, separation=False, name="gasket")]
    contacts += [sc.Contact(b.surface("upper"), flange, tied=True, name=b.name) for b in shanks]
    bolts = [
        sc.Bolt(b, point=(*p, 1.0), axis=(0, 0, 1), name=b.name)
        for b, p in zip(shanks, places, strict=True)
    ]
    solver = sc.ContactSolver([bed, *shanks, flange], contacts, bolts=bolts)
    return solver, resists, np.array(arms), k


def test_a_tightening_sequence_is_that_of_springs_under_a_rigid_flange():
    """Each bolt that is tightened takes off the others what its flange gives way.

    A force that changes by dF at bolt j moves the flange by dq = -(R + sum_k!=j k a_k a_k')^-1 a_j dF,
    with R the bed, and the bolts k change by k a_k dq.
    """
    places = [(6.0, 1.0), (-2.0, 6.0), (-6.0, -1.0), (1.0, -5.0), (6.0, -4.0)]
    names = [f"b{i}" for i in range(len(places))]
    solver, R, arms, k = bedded(places, names)
    order = [(i, 30.0) for i in range(5)] + [(0, 100.0), (2, 100.0), (1, 100.0), (3, 100.0), (4, 100.0)]
    N = np.zeros(5)
    steps = [{"bolt": {names[i]: {"force": force}}} for i, force in order]
    for (j, force), result in zip(order, solver.history(steps), strict=True):
        others = [i for i in range(5) if i != j]
        held = R + k * arms[others].T @ arms[others]
        dq = -np.linalg.solve(held, arms[j]) * (force - N[j])
        N = N + k * arms @ dq
        N[j] = force
        found = [result.bolts[name].force for name in names]
        np.testing.assert_allclose(found, N, rtol=1e-9)
        assert result["gasket"].force[2] == pytest.approx(-N.sum(), rel=1e-9)
    assert N[0] < 99  # it has lost a part
    # all at once: none loses anything
    at_once = {"bolt": {name: {"force": 100.0} for name in names}}
    (last,) = solver.history([at_once], start=result)
    np.testing.assert_allclose([last.bolts[name].force for name in names], 100.0, rtol=1e-10)


def test_bolts_of_an_axisymmetric_body():
    """The force is that of the full circle: what the head presses with."""
    lam, G = lame_parameters(210e3, 0.3)

    @fem.BilinearForm
    def steel(u, v, w):
        du, dv, r = grad(u), grad(v), w.x[0]
        e = np.array([du[0, 0], du[1, 1], u[0] / r, (du[0, 1] + du[1, 0]) / np.sqrt(2)])
        d = np.array([dv[0, 0], dv[1, 1], v[0] / r, (dv[0, 1] + dv[1, 0]) / np.sqrt(2)])
        return 2 * np.pi * r * (2 * G * (e * d).sum(0) + lam * e[:3].sum(0) * d[:3].sum(0))

    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 8, 9), np.linspace(0, 15, 16))
    mesh = mesh.restrict(mesh.elements_satisfying(lambda x: (x[0] < 4) | (x[1] > 10)))
    mesh = mesh.with_boundaries(
        {"head": lambda x: (x[1] == 10) & (x[0] > 4), "cut": lambda x: x[1] == 0}
    )
    element = fem.ElementVector(fem.ElementQuad1())
    basis = fem.Basis(mesh, element, intorder=4)
    D = np.append(basis.get_dofs("cut").all("u^2"), basis.get_dofs(lambda x: x[0] == 0).all("u^1"))
    full = lambda x: 2 * np.pi * x[0]  # noqa: E731
    bolt = sc.Body(basis, steel, D=D, measure=full, name="bolt")
    ring = fem.MeshQuad.init_tensor(np.linspace(5, 15, 11), np.linspace(0, 10, 6)).with_defaults()
    plate = sc.Body(fem.Basis(ring, element, intorder=4), steel, measure=full, name="plate")
    contacts = [
        sc.Contact(bolt.surface("head"), plate.surface("top"), name="head"),
        sc.Contact(plate.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), name="joint"),
    ]
    section = sc.Bolt(bolt, point=(0, 5), axis=(0, 1))
    solver = sc.ContactSolver([bolt, plate], contacts, bolts=section)
    (tight,) = solver.history([{"bolt": {"bolt 1": {"force": 10e3}}}])
    assert tight["head"].force[1] == pytest.approx(10e3, rel=1e-9)
    assert -tight.reaction("bolt", "cut")[1] == pytest.approx(10e3, rel=1e-9)
    assert np.isnan(tight.bolts["bolt 1"].bending)
    with pytest.raises(
        sc.errors.InputError, match=r"axis of a bolt .* give \(0, 1\), as the body is axisymm"
    ):
        sc.Bolt(bolt, point=(0, 5), axis=(1, 0))


def test_stresses_are_those_of_the_bolt_drawn_together():
    """Without Poisson's ratio the shank has the stress N / A all along, next to the section as well."""
    (tight,) = stack().history([TIGHTEN])
    bolt = tight.system.solids["bolt"]
    stress = sc.nodal_stress(bolt, tight.stretched("bolt"), E=2e6, nu=0.0)
    np.testing.assert_allclose(stress[:, 1, 1], 10.0, rtol=1e-9)
    plate = tight.system.solids["plate"]
    assert np.array_equal(tight.stretched(plate), tight.displacement(plate))
    assert tight.validity.holds
    assert tight.validity.strain["bolt"] == pytest.approx(10 / 2e6, rel=1e-9)


# -- bad input -------------------------------------------------------------------------------------


def test_sections_that_are_none():
    """Where the plane misses the body, or does not cut it in two, the message says so."""
    bolt = stack().system.solids["bolt"]
    with pytest.raises(sc.errors.InputError, match="passes between no elements"):
        sc.Bolt(bolt, point=(0.5, 40), axis=(0, 1))
    with pytest.raises(sc.errors.InputError, match=r"axis of bolt 'M' is .* give a direction"):
        sc.Bolt(bolt, point=(0.5, 4), axis=(0, 0), name="M")
    with pytest.raises(sc.errors.InputError, match=r"point of a bolt is .* give 2 finite coordinates"):
        sc.Bolt(bolt, point=(0.5, 4, 1), axis=(0, 1))
    ring = fem.MeshQuad.init_tensor(np.arange(5.0), np.arange(5.0))
    ring = ring.restrict(ring.elements_satisfying(lambda x: np.hypot(x[0] - 2, x[1] - 2) > 1))
    frame = sc.Body(fem.Basis(ring, fem.ElementVector(fem.ElementQuad1())), linear_elasticity())
    with pytest.raises(sc.errors.InputError, match=r"does not cut .* in two"):
        sc.Bolt(frame, point=(0.5, 2), axis=(0, 1))
    heat = sc.Body(fem.Basis(ring, fem.ElementQuad1()), fem.models.poisson.laplace)
    with pytest.raises(sc.errors.InputError, match="carries no force"):
        sc.Bolt(heat, point=(0.5, 2), axis=(0, 1))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"N": {"force": 1.0}}, "there is no bolt 'N'"),
        ({"M": 15.0}, "bolt 'M' in a load step is 15.0; give"),
        ({"M": {"force": 1.0, "stretch": 2.0}}, "give {'force': 15e3} or"),
        ({"M": {"force": -1.0}}, "force of bolt 'M' is -1: a bolt pulls"),
        ({"M": {"stretch": np.inf}}, "stretch of bolt 'M' is inf"),
        (15.0, "has to be a dict by name"),
    ],
)
def test_steps_that_tighten_nothing(given, words):
    """What a step says of bolts is a force or a stretch, by name."""
    with pytest.raises(sc.errors.InputError, match=words):
        next(stack().history([{"bolt": given}]))


def test_bolts_that_do_not_belong_together():
    """Names once, sections apart, and states only between solvers with the same bolts."""
    solver = stack()
    bolt, bodies, contacts = solver.system.solids["bolt"], solver.system.bodies, solver.contacts
    near = [sc.Bolt(bolt, point=(0.5, y), axis=(0, 1)) for y in (4.7, 4.8)]
    with pytest.raises(sc.errors.InputError, match="'bolt 1' and 'bolt 2' share elements"):
        sc.ContactSolver(bodies, contacts, bolts=near)
    twins = [sc.Bolt(bolt, point=(0.5, y), axis=(0, 1), name="M") for y in (3, 7)]
    with pytest.raises(sc.errors.InputError, match="several bolts are named 'M'"):
        sc.ContactSolver(bodies, contacts, bolts=twins)
    (tight,) = solver.history([TIGHTEN])
    with pytest.raises(
        sc.errors.InputError, match="a state with bolts 'M', which this solver does not have"
    ):
        sc.ContactSolver(bodies, contacts).solve(start=tight)
    again = solver.solve(bolt=TIGHTEN["bolt"])
    assert again.bolts["M"].force == pytest.approx(tight.bolts["M"].force, rel=1e-12)
    with pytest.raises(sc.errors.InputError, match=r"make each by Bolt\(body"):
        sc.ContactSolver(bodies, contacts, bolts=[bolt])


def test_two_sections_of_one_bolt_add_up():
    """Two sections are two springs with strains: each stretch is a part of the whole."""
    solver = stack()
    bolt, bodies, contacts = solver.system.solids["bolt"], solver.system.bodies, solver.contacts
    two = [sc.Bolt(bolt, point=(0.5, y), axis=(0, 1)) for y in (2, 8)]
    both = sc.ContactSolver(bodies, contacts, bolts=two)
    (tight,) = solver.history([TIGHTEN])
    d = tight.bolts["M"].stretch
    steps = [{"bolt": {"bolt 1": {"stretch": 0.25 * d}}}, {"bolt": {"bolt 2": {"force": 10.0}}}]
    *_, last = both.history(steps)
    assert last.bolts["bolt 2"].stretch == pytest.approx(0.75 * d, rel=1e-9)
    assert last.bolts["bolt 1"].force == pytest.approx(10.0, rel=1e-9)


def bowed():
    """A bow whose two feet are glued to the ground, over a column: a bolt in each leg."""
    frame = fem.MeshQuad.init_tensor(np.linspace(0, 6, 13), np.linspace(0, 10, 11))
    frame = frame.restrict(frame.elements_satisfying(lambda x: (abs(x[0] - 3) > 2) | (x[1] > 8)))
    column = fem.MeshQuad.init_tensor(np.linspace(2, 4, 4), np.linspace(0, 8, 6)).with_defaults()
    element, form = fem.ElementVector(fem.ElementQuad1()), linear_elasticity(0.0, 1e5)
    bow = sc.Body.from_mesh(frame, element, form, name="bow")
    column = sc.Body.from_mesh(column, element, form, D="bottom", name="column")
    under = bow.surface(lambda x: (x[1] == 8) & (abs(x[0] - 3) < 2), name="under")
    feet = bow.surface(lambda x: x[1] == 0, name="feet")
    contacts = [
        sc.Contact(column.surface("top"), under, name="joint"),
        sc.Contact(feet, sc.RigidPlane((0, 0), (0, 1)), tied=True, name="feet"),
    ]
    bolts = [
        sc.Bolt(bow, point=(x, 4.2), axis=(0, 1), name=name) for x, name in ((0.5, "A"), (5.5, "B"))
    ]
    return sc.ContactSolver([bow, column], contacts, bolts=bolts)


def test_two_bolts_in_one_body():
    """One after the other: balance, mirrored, and the same as both lengths at once."""
    solver = bowed()
    *_, last = solver.history([{"bolt": {name: {"force": 10.0}}} for name in "AB"])
    A, B = last.bolts["A"], last.bolts["B"]
    assert B.force == pytest.approx(10.0, rel=1e-9) and A.force > 11.0  # a see-saw
    assert -last["joint"].force[1] == pytest.approx(A.force + B.force, rel=1e-9)
    *_, other = solver.history([{"bolt": {name: {"force": 10.0}}} for name in "BA"])
    assert other.bolts["B"].force == pytest.approx(A.force, rel=1e-9)
    (both,) = solver.history([{"bolt": {b.name: {"stretch": b.stretch} for b in (A, B)}}])
    assert both.bolts["A"].force == pytest.approx(A.force, rel=1e-9)
    (even,) = solver.history([{"bolt": {name: {"force": 10.0} for name in "AB"}}])
    assert even.bolts["A"].stretch == pytest.approx(even.bolts["B"].stretch, rel=1e-9)
    assert even.bolts["A"].bending == pytest.approx(even.bolts["B"].bending, rel=1e-9)


def test_a_bolt_that_nothing_holds_is_named():
    """A force on a bolt whose head touches nothing: no equilibrium, and the motion in words."""
    solver = stack()
    bodies, contacts = solver.system.bodies, solver.contacts
    loose = [contact for contact in contacts if solver.names[contacts.index(contact)] != "seat"]
    with pytest.raises(sc.errors.NoEquilibrium, match="stretch of 'M'"):
        next(
            sc.ContactSolver(
                bodies, loose, bolts=[sc.Bolt(bodies[0], point=(0.5, 4), axis=(0, 1), name="M")]
            ).history([TIGHTEN])
        )


def test_a_bolt_of_many_elements_stays_sparse():
    """What a given force adds to the stiffness is in the layer of elements next to the section."""
    bolt = clamped([mesh.refined(1) for mesh in parts(fem.MeshHex)]).system.solids["bolt"]
    floor = sc.RigidPlane((0, 0, -3), (0, 0, 1))
    nut = sc.Contact(bolt.surface(lambda x: abs(x[2] + 3) < 1e-6), floor, tied=True)
    head = sc.RigidBody(sc.RigidPlane((0, 0, 3), (0, 0, -1)), about=(0, 0, 3), K=[1e5] * 6)
    seat = sc.Contact(bolt.surface(lambda x: abs(x[2] - 3) < 1e-6), head, tied=True)
    section = sc.Bolt(bolt, point=(0, 0, 0.4), axis=(0, 0, 1), name="M")
    (tight,) = sc.ContactSolver([bolt, head], [nut, seat], bolts=[section]).history([TIGHTEN])
    (loose, _) = answer_of(tight).stiffness
    assert loose.nnz < 1.5 * bolt.K.nnz


def test_a_bolt_in_a_body_that_yields_is_refused():
    """Its stiffness is another one in every step: in words, before anything is computed."""
    basis = fem.Basis(fem.MeshQuad().refined(2), fem.ElementVector(fem.ElementQuad1()))
    yielding = sc.NonlinearBody(basis, sc.J2(210e3, 0.3, 200.0), name="shank")
    with pytest.raises(sc.errors.InputError, match="a body that is not linear"):
        sc.Bolt(yielding, point=(0.5, 0.5), axis=(0, 1), name="M")


def test_a_point_beside_the_shank_is_refused():
    """In the plane of the section, but not within it; on its rim is well."""
    bolt = stack().system.solids["bolt"]
    for x in (0.0, 1.0):
        assert sc.Bolt(bolt, point=(x, 4), axis=(0, 1)).point[0] == x
    for x in (-0.1, 1.1):
        with pytest.raises(sc.errors.InputError, match=r"lies beside <Body bolt"):
            sc.Bolt(bolt, point=(x, 4), axis=(0, 1))


# -- heat ------------------------------------------------------------------------------------------

E, NU, WARM = 500.0, 0.3, 1e-3  # of a rod of 1 x 50 between walls, thermal strain by degree
PRESS, SPRING = E * WARM / (1 - NU), E / (1 - NU**2) / 50


def held_rod(own=False):
    """A rod in plane strain with free sides, held at both ends, and its bolt off the axis."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 50, 11)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    steel = sc.Elastic(E, NU, expansion=WARM)
    D = {"left": "x", "bottom": "y", "top": "y"}
    heat = {"f": {"rod": steel.warmed(1.0)}}
    rod = sc.Body(basis, steel, D=D, name="rod", f=heat["f"]["rod"] if own else None)
    side = sc.Contact(rod.surface("right"), sc.RigidPlane((9, 0), (-1, 0)))  # never touches
    bolt = sc.Bolt(rod, point=(0.25, 25), axis=(0, 1), name="M")
    return sc.ContactSolver([rod], [side], bolts=[bolt]), heat


def carried(result):
    """Force, stretch and bending of the bolt, and the force of the wall on the rod."""
    bolt = result.bolts["M"]
    return [bolt.force, bolt.stretch, bolt.bending, result.reaction("rod", "top")[1]]


def of(force, stretch=0.0):
    """The same of a rod under a force, in the middle of its width."""
    return pytest.approx([force, stretch, 0.25 * abs(force), force], rel=1e-10, abs=1e-12)


def test_heat_strains_a_bolt_and_is_no_force(tmp_path):
    """Warmed between walls it bears -E alpha T / (1 - nu), tightened cold or hot what is given."""
    solver, heat = held_rod()
    draw = {"bolt": {"M": {"force": 10.0}}}
    cold, warm = solver.history([draw, heat])
    assert carried(cold) == of(10.0, 10 / SPRING)
    assert carried(warm) == of(10.0 - PRESS, 10 / SPRING)
    hot, tight, half = solver.history([heat, draw, {"bolt": {"M": {"force": 5.0}}}])
    assert carried(hot) == of(-PRESS)
    assert carried(tight) == of(10.0, (10 + PRESS) / SPRING)
    assert carried(half) == of(5.0, (5 + PRESS) / SPRING)
    # by the load, which is the heat: of a locked bolt the force, of one with a given force the stretch
    assert hot.sensitivity("load").bolts["M"] == pytest.approx([-PRESS, 0.0], rel=1e-9, abs=1e-12)
    assert tight.sensitivity("load").bolts["M"] == pytest.approx([0.0, PRESS / SPRING], abs=1e-9)
    again = solver.load_state(solver.save_state(tmp_path / "tight.npz", tight))
    (moved,) = solver.history([{"x": {"rod": {"top": (None, 0.01)}}}], start=again)
    assert carried(moved) == of(10.0 + 0.01 * SPRING, (10 + PRESS) / SPRING)


def test_heat_of_the_own_load_is_scaled_with_it():
    """By numbers of load steps, and by `with_load` of a body that had none."""
    solver, heat = held_rod(own=True)
    other = held_rod()[0].with_load("rod", heat["f"]["rod"])
    for warmed in (solver, other):
        half, whole, none = warmed.history([0.5, 1.0, {"f": {"rod": np.zeros(warmed.system.n)}}])
        assert [carried(half), carried(whole)] == [of(-PRESS / 2), of(-PRESS)]
        assert carried(none) == of(0.0)
    ax = sc.output.plot_force([half, whole], "rod", "right")  # a free side
    assert abs(ax.get_lines()[0].get_ydata()).max() < 1e-12
