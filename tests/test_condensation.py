"""The condensed routes against the sparse one: same answer, and cheaper ways to reach it."""

from __future__ import annotations

import re
import tracemalloc

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix
from skfem.models.elasticity import lame_parameters
from statuses import OPEN, STICK

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.problem import (
    Conditions,
    FullProblem,
    IteratedProblem,
    PointProblem,
    Substructure,
    delassus_compliance,
)

MESH = {"Q1": (fem.MeshQuad, fem.ElementQuad1), "P1": (fem.MeshTri, fem.ElementTriP1)}


def block(name, x, y, n, *, kind="Q1", E=1.0, D=None, move=(0.0, 0.0), push=(0.0, 0.0)):
    mesh_type, element = MESH[kind]
    mesh = mesh_type.init_tensor(np.linspace(*x, n[0] + 1), np.linspace(*y, n[1] + 1)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(element()))
    u, f = np.zeros(basis.N), np.zeros(basis.N)
    u[basis.nodal_dofs] = np.reshape(move, (2, 1))
    f[basis.nodal_dofs] = np.reshape(push, (2, 1)) / mesh.p.shape[1]
    K = linear_elasticity(*lame_parameters(E, 0.3))
    return sc.Body(basis, K, f, D=D, x=None if D is None else u, name=name)


def scene(kind="Q1", floating=False, linear="auto", method="node", mu=0.3):
    """A punch with an overhang on a block: open, sticking and slipping points, or a free punch."""
    low = block("low", (0, 2), (-1, 0), (10, 4), kind=kind, D="bottom")
    if floating:
        up = block("up", (0.5, 1.7), (0, 0.6), (7, 3), kind=kind, E=3.0, push=(1e-3, -8e-3))
    else:
        up = block("up", (0.5, 1.7), (0, 0.6), (7, 3), kind=kind, E=3.0, D="top", move=(0.004, -0.01))
    contact = sc.Contact(
        up.surface("bottom"),
        low.surface("top"),
        friction=None if mu is None else sc.Coulomb(mu),
        method=method,
        name="joint",
        gap=lambda x: 0.03 * (x[0] - 0.9) ** 2,
    )
    return sc.ContactSolver([low, up], [contact], linear=linear)


@pytest.mark.pairwise
@pytest.mark.parametrize("route", ["condensed", "iterated"])
@pytest.mark.parametrize("kind", MESH)
@pytest.mark.parametrize("floating", [False, True], ids=["held", "floating"])
@pytest.mark.parametrize(("method", "mu"), [("node", 0.3), ("mortar", 0.3)])
def test_routes_agree(kind, floating, method, mu, route):
    """Gaps and slips, forces, or all DOFs as unknowns: the same displacements and forces on a path."""
    settings = {"kind": kind, "floating": floating, "method": method, "mu": mu}
    dense, sparse = scene(**settings, linear=route), scene(**settings, linear=sc.linalg.Direct())
    problem = dense.linear_model.problem_on(None, None)
    assert isinstance(problem, PointProblem if route == "condensed" else IteratedProblem)
    for a, b in zip(dense.history([0.5, 1.0, 0.3]), sparse.history([0.5, 1.0, 0.3]), strict=True):
        # round-off times the condition number of the bodies
        assert_allclose(a.u, b.u, rtol=0, atol=1e-9 * np.abs(b.u).max())
        assert_allclose(a.forces, b.forces, rtol=0, atol=1e-9 * np.abs(b.forces).max())
        assert_array_equal(a.status, b.status)
        assert a.certificate.worst < 1e-10


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["points", "displacements"])
def test_laws_of_points_that_stick_or_are_open_are_not_heard(linear):
    """Only a point that slides has a spring, a force and a share of the pressure, whatever is said."""
    solver = scene(linear=linear)
    result = solver.solve()
    problem = solver.linear_model.problem_on(None, None)
    load = problem.load(answer_of(result).case)
    closed, stick = result.status != OPEN, result.status == STICK
    slides = closed & ~stick
    assert stick.any() and slides.any() and not closed.all()
    rng = np.random.default_rng(5)
    m = len(closed)
    law = rng.random((m, 1, 1)), 1e-3 * rng.random((m, 1)), 0.3 * rng.random((m, 1))
    anchor = 1e-3 * rng.random((m, 1))
    own = [
        np.where(slides[:, None, None], law[0], 0),
        *(np.where(slides[:, None], v, 0) for v in law[1:]),
    ]
    said, meant = (problem.solve(Conditions(closed, stick, anchor, *v), load) for v in (law, own))
    for key in ("gap", "slip", "normal_force", "tangential_force", "solution"):
        wanted = getattr(meant, key)
        assert_allclose(getattr(said, key), wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["points", "displacements"])
def test_a_gap_that_supports_prescribe_is_what_it_is(linear):
    """Asked to close a point both sides of which are prescribed, a problem leaves its gap alone."""
    low, up = block("low", (0, 1), (-1, 0), (4, 4)), block("up", (0, 1), (0, 1), (4, 4))
    end = {}
    for body, side in ((low, "top"), (up, "bottom")):
        surface = body.surface(side)
        end[body] = surface.dofs[surface.points[:, 0] < 0.1].ravel()
    x = np.zeros(up.n)
    x[end[up][1]] = -0.001  # pushed in by a thousandth
    held = [
        sc.Body(low.basis, low.K, D=[low.basis.get_dofs("bottom"), end[low]], name="low"),
        sc.Body(up.basis, up.K, D=[up.basis.get_dofs("top"), end[up]], x=x, name="up"),
    ]
    contact = sc.Contact(held[1].surface("bottom"), held[0].surface("top"), method="node")
    solver = sc.ContactSolver(held, [contact], linear=linear)
    problem = solver.linear_model.problem_on(None, None)
    with pytest.warns(sc.ContactWarning, match="prescribed displacements push"):
        load = problem.load(answer_of(solver.solve()).case)
    there = contact.secondary.points[:, 0] < 0.1
    nothing = np.zeros((5, 1))
    conditions = Conditions(
        np.ones(5, bool), np.zeros(5, bool), nothing, nothing[..., None], nothing, nothing
    )
    found = problem.solve(conditions, load)
    assert_allclose(found.gap, np.where(there, -0.001, 0.0), rtol=1e-12, atol=1e-15)
    assert_array_equal(found.normal_force != 0, ~there)


def test_update_of_one_body_is_a_new_solver():
    """A new stiffness and load of one body give what a solver made with them gives."""
    solver = scene(floating=True)
    solver.solve()
    kept = solver.model.substructures[0]
    stiffer = linear_elasticity(*lame_parameters(7.0, 0.2))
    load = 1.5 * solver.system.bodies[1].f
    solver.update("up", K=stiffer, f=load)
    low, up = solver.system.bodies
    new = sc.Body(up.basis, stiffer, load, name="up")
    contact = sc.Contact(
        new.surface("bottom"),
        low.surface("top"),
        friction=sc.Coulomb(0.3),
        gap=lambda x: 0.03 * (x[0] - 0.9) ** 2,
        method="node",
    )
    result, fresh = solver.solve(), sc.ContactSolver([low, new], [contact]).solve()
    assert_allclose(result.u, fresh.u, rtol=0, atol=1e-12 * np.abs(fresh.u).max())
    assert_allclose(result.forces, fresh.forces, rtol=0, atol=1e-11 * np.abs(fresh.forces).max())
    assert result.certificate.worst < 1e-10  # measured with the new stiffness
    assert solver.model.substructures[0] is kept  # the other body is not condensed again
    solver.update(low, f=low.f)
    assert_allclose(solver.solve().u, fresh.u, rtol=0, atol=1e-12 * np.abs(fresh.u).max())


def test_updates_are_checked():
    """What is no stiffness of this body is refused, and the solver stays as it was."""
    solver = scene()
    before = solver.solve().u
    with pytest.raises(sc.errors.InputError, match=r"K of body 'up' has shape \(3, 3\)"):
        solver.update("up", K=np.eye(3))
    with pytest.raises(sc.errors.InputError, match="there is no body 'upp'; did you mean 'up'"):
        solver.update("upp", K=np.eye(3))
    assert_allclose(solver.solve().u, before, rtol=0, atol=1e-15)


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "sparse"])
def test_many_displacements_at_once_are_those_one_by_one(linear):
    """Recovering many results in one go gives each its own displacements, in order."""
    factors = np.linspace(0.1, 1.0, 40)
    alone = [r.u for r in scene(linear=linear).history(factors)]
    solver = scene(linear=linear)
    results = list(solver.history(factors))
    some = results[3].u.copy()  # recovered before
    together = solver.recover(results)
    for a, b, result in zip(together, alone, results, strict=True):
        assert_allclose(a, b, rtol=0, atol=1e-13 * np.abs(b).max())
        assert result.u is a
    assert_allclose(together[3], some, rtol=0, atol=0)


def corner(linear="auto", mu=None, D=None, size=1):
    """A block in a corner: its corner node is in two contacts, whose rows meet two DOFs."""
    D = "top" if D else None
    body = block("block", (0, size), (0, size), (4, 4), D=D, push=(-1e-3, -2e-3))
    law = None if mu is None else sc.Coulomb(mu)
    floor, wall = sc.RigidPlane((0, 0), (0, 1)), sc.RigidPlane((0, 0), (1, 0))
    contacts = [
        sc.Contact(body.surface("bottom"), floor, friction=law, name="floor"),
        sc.Contact(body.surface("left"), wall, friction=law, name="wall"),
    ]
    return sc.ContactSolver(body, contacts, linear=linear)


def chain(linear="auto", mu=0.2):
    """Both lips of a joint secondary of one another: every row is there twice."""
    low = block("low", (0, 1), (-1, 0), (4, 3), D="bottom")
    up = block("up", (0, 1), (0, 1), (4, 3), D="top", move=(0.0, -0.01))
    a, b = up.surface("bottom"), low.surface("top")
    law = None if mu is None else sc.Coulomb(mu)
    contacts = [
        sc.Contact(a, b, friction=law, name="there"),
        sc.Contact(b, a, friction=law, name="back"),
    ]
    return sc.ContactSolver([low, up], contacts, linear=linear)


@pytest.mark.parametrize(
    ("make", "mu"), [(corner, 0.3), (chain, None), (chain, 0.2)], ids=["corner", "chain", "chain-mu"]
)
def test_rows_that_depend_on_each_other(make, mu, monkeypatch):
    """Corners with friction and doubled rows are seen through springs, as by the sparse route.

    Solvers refuse two passes over one interface at once; here that check is taken away, so that rows
    that are there twice stay judged.
    """
    if make is chain:
        with pytest.raises(sc.errors.InputError, match="pair the same facets, the one from one side"):
            make(mu=mu)
        internals.replace(monkeypatch, "conditions.check_passes", lambda *_: None)
    dense, sparse = make(mu=mu), make(mu=mu, linear=sc.linalg.Direct())
    problems = [solver.linear_model.problem_on(None, None) for solver in (dense, sparse)]
    assert isinstance(problems[0], PointProblem) and problems[0].springs is not None
    a, b = dense.solve(), sparse.solve()
    # by either route the springs are the same, and so is the split of forces
    assert_allclose(problems[1]._compliance(), problems[0].springs, rtol=1e-12)
    assert_allclose(a.u, b.u, rtol=0, atol=1e-9 * np.abs(b.u).max())
    forces = [np.concatenate([v.forces for v in r.values]) for r in (a, b)]
    assert_allclose(forces[0], forces[1], rtol=0, atol=1e-8 * np.abs(forces[1]).max())
    assert max(a.certificate.worst, b.certificate.worst) < 1e-10


def test_the_proximal_point_of_forces_that_are_not_unique(monkeypatch):
    """The forces are those that springs come to from none, whatever a loop began with."""
    usual = corner(mu=0.3).solve()
    internals.replace(monkeypatch, "loops.STARTS", ("proximal", "proximal"))
    result = corner(mu=0.3).solve()
    assert any(record.note == "springs in series" for record in result.trace)
    for one, other in zip(result.values, usual.values, strict=True):
        assert_allclose(one.forces, other.forces, rtol=0, atol=1e-8 * np.abs(other.forces).max())


def test_springs_of_rows_have_no_unit():
    """A plane body gives way by as much in any size, and so do the springs of its points."""
    one, many = (corner(mu=0.3, size=s).linear_model.problem_on(None, None) for s in (1, 1000))
    assert_allclose(many.springs, one.springs, rtol=1e-9)


def test_iterated_problems_hand_over_dependent_rows():
    """Rows that depend on each other are solved with all DOFs."""
    solver, sparse = corner(mu=0.3, linear="iterated"), corner(mu=0.3, linear=sc.linalg.Direct())
    assert isinstance(solver.linear_model.problem_on(None, None), FullProblem)
    a, b = solver.solve(), sparse.solve()
    assert_allclose(a.u, b.u, rtol=0, atol=1e-12 * np.abs(b.u).max())
    assert_allclose(solver.recover([a])[0], a.u, rtol=0, atol=0)


def test_frictionless_corners():
    """Without friction a corner node has one row per direction, and both walls their force."""
    held = corner(D=True)
    assert isinstance(held.linear_model.problem_on(None, None), PointProblem)
    for solver in (corner(), corner(linear=sc.linalg.Direct())):
        result = solver.solve()
        assert_allclose(result["floor"].force, [0, 2e-3], rtol=0, atol=1e-14)
        assert_allclose(result["wall"].force, [1e-3, 0], rtol=0, atol=1e-14)


def test_the_route_follows_the_memory_of_dense_matrices():
    """Above max_dense_bytes "auto" iterates; "condensed" never does. Both are said."""
    plain = scene()
    bodies, contacts, few = plain.system.bodies, plain.contacts, sc.Options(max_dense_bytes=3000)
    many = sc.ContactSolver(bodies, contacts, options=few, linear="auto")
    assert (plain.linear_model.route, many.linear_model.route) == ("condensed", "iterated")
    forced = sc.ContactSolver(bodies, contacts, options=few, linear="condensed")
    assert forced.linear_model.route == "condensed"
    # on either side 16 contact DOFs, 16 gaps and slips: 8 (2 16^2 + 2.5 16^2)
    assert plain.linear_model.choice.dense_bytes == 9216
    assert "at most 9.22 kB of dense matrices, max_dense_bytes allows 3 GB" in str(plain)
    assert "because dense matrices would take 9.22 kB: max_dense_bytes allows 3 kB" in str(many)
    assert "at most 9.22 kB of dense matrices, as chosen" in str(forced)
    with pytest.raises(sc.errors.UnknownKeyword, match=r"max_candidates.*write max_dense_bytes"):
        sc.Options(max_candidates=3)
    with pytest.raises(sc.errors.UnknownKeyword, match=r"no argument 'loop': write ContactSolver\("):
        sc.Options(loop="newton")
    large = sc.ContactSolver(bodies, contacts, options=sc.Options(max_factor_bytes=3000))
    assert large.linear_model.route == "multigrid"
    assert re.search(r"because factors would take \S+ kB: max_factor_bytes allows 3 kB", str(large))
    assert "linear problems" not in str(plain.solve())
    words = "displacements and forces by GMRES with multigrid, because factors would take"
    assert f"linear problems: {words}" in large.solve().report()
    u = plain.solve().u
    assert_allclose(many.solve().u, u, rtol=0, atol=1e-12 * np.abs(u).max())
    assert_allclose(large.solve().u, u, rtol=0, atol=1e-8 * np.abs(u).max())  # AMG's tolerance


@pytest.mark.parametrize("floating", [False, True], ids=["held", "floating"])
def test_dense_matrices_take_no_more_memory_than_said(floating, monkeypatch):
    """Where they are large, there are four and a half matrices of all gaps and slips at most.

    Small enough for a test, with the sizes set to match at which matrices change in place, in blocks.
    """
    low = block("low", (0, 2), (-0.2, 0), (400, 3), D="bottom")
    push = (1e-4, -1e-3)
    if floating:
        up = block("up", (0, 2), (0, 0.2), (400, 3), E=3.0, push=push)
    else:
        up = block("up", (0, 2), (0, 0.2), (400, 3), E=3.0, D="top", move=push)
    contact = sc.Contact(
        up.surface("bottom"),
        low.surface("top"),
        friction=sc.Coulomb(0.3),
        method="node",
        gap=lambda x: 2e-3 * (x[0] - 0.9) ** 2,  # closed, open, sticking and slipping points
    )
    usual = sc.ContactSolver([low, up], [contact]).solve()
    internals.replace(monkeypatch, "problem.KEPT_BESIDE", 0)
    internals.replace(monkeypatch, "linalg.ROWS_AT_ONCE", 50)
    solver = sc.ContactSolver([low, up], [contact])
    tracemalloc.start()
    kept = [len(part.S) for part in solver.model.substructures]
    others = tracemalloc.get_traced_memory()[0] - 8 * sum(n**2 for n in kept)
    tracemalloc.reset_peak()
    result = solver.solve()
    most = tracemalloc.get_traced_memory()[1] - others
    tracemalloc.stop()
    choice = solver.linear_model.choice
    matrix = 8 * choice.rows**2
    assert choice.rows == 802 and choice.dense_bytes == 4.5 * matrix
    assert most < choice.dense_bytes + 0.2 * matrix  # sparse rows, blocks of rows, vectors
    assert most > 3.5 * matrix
    assert set(result.status) == {0, 1, 2}
    # round-off times the condition of slender bodies
    assert_allclose(result.forces, usual.forces, rtol=0, atol=1e-8 * np.abs(usual.forces).max())
    # what has become its own inverse is found again where somebody asks
    for part, n in zip(solver.model.substructures, kept, strict=True):
        assert part._factor.S.size == 0
        S = part.S.copy()
        at = np.searchsorted(part.kept, part.anchors)
        S[at, at] += part.springs
        assert_allclose(S @ part.flexibility, np.eye(n), rtol=0, atol=1e-8)


def test_a_load_that_comes_again_is_reduced_as_if_it_were_new():
    """Loads that repeat, return, or lie between others, however many are known: f on the kept DOFs."""
    body = block("low", (0, 2), (-1, 0), (6, 3), D="bottom")
    part = Substructure(body, body.K, np.setdiff1d(body.basis.get_dofs("top").flatten(), body.D))
    rng = np.random.default_rng(0)
    a, b, none = *rng.standard_normal((2, body.n)), np.zeros(body.n)
    moved = np.zeros(body.n)
    moved[body.D] = rng.standard_normal(len(body.D))
    # on few DOFs, on others, on one more than before; a prescribed one, which no force is felt at
    few, other, more = np.zeros((3, body.n))
    few[part.free[3:6]], other[part.free[10:12]] = (1.0, -2.0, 3.0), 0.5
    more[[*part.free[4:6], body.D[0]]] = 2.0
    tip = np.where(np.arange(body.n) == body.D[-1], 0.7, 0.0)
    elsewhere = np.where(few + other == 0, b, 0.0)
    loads = [
        (few, none),
        (few + other, none),
        (other, tip),
        (more, none),
        (elsewhere, none),
        (a, none),
        (a, moved),
        (2 * a, moved),
        (b, moved),
        (a, none),
        (a - b, 2 * moved),
        (none, moved),
    ]
    for f, x in [*loads, *loads]:
        components = part.components(f, x)
        reduced = part.along(components) @ np.concatenate(components)
        assert part.components(f, x) == components  # the very arrays of the question before
        # independent of the directions: the interior eliminated from this one load
        u = np.zeros(body.n)
        K, free = body.K.toarray(), np.setdiff1d(part.free, part.kept)
        inside = np.linalg.solve(K[np.ix_(free, free)], (f - K @ x)[free])
        u[free] = inside
        expected = (f - K @ x - K @ u)[part.kept]
        # a handful of products of numbers of order one, and a condition number of 1e3
        assert_allclose(reduced, expected, rtol=0, atol=1e-12 * np.abs(expected).max() + 1e-14)
        assert components is not None
    # few, other, more, elsewhere, a, b; tip, moved
    assert part.along(components).shape[1] == 6 + 2


def test_anchors_hold_a_body_in_all_directions():
    """Only one edge is in no contact: on springs at three of its nodes the body would turn."""
    mesh = fem.MeshHex.init_tensor(*(np.linspace(0, 1, n + 1) for n in (4, 4, 1)))
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    edge = basis.nodal_dofs[:, np.isclose(mesh.p[1], 0) & np.isclose(mesh.p[2], 1)]
    part = Substructure(sc.Body(basis, K), K.tocsr(), np.setdiff1d(np.arange(basis.N), edge))
    S, at = part.S.copy(), np.searchsorted(part.kept, part.anchors)
    S[at, at] += part.springs
    values = np.linalg.eigvalsh(S)
    assert values[0] > 1e-4 * values[-1]


def test_compliance_of_rows_that_touch_few_columns_or_all():
    """What is left out of the flexibility is what no row touches."""
    rng = np.random.default_rng(5)
    for touched in (slice(40, 50), slice(0, 60)):
        F = rng.normal(size=(60, 60))
        F += F.T
        G = np.zeros((7, 60))
        G[:, touched] = rng.normal(size=G[:, touched].shape)
        W = np.ones((7, 7))
        delassus_compliance(W, csr_matrix(G), F)
        assert_allclose(W, 1 + G @ F @ G.T, rtol=0, atol=1e-12)


def test_the_number_of_load_steps_chooses_the_route(monkeypatch):
    """Few load steps are iterated, many condensed; who goes on solving is condensed in time, too."""
    first, per_byte = scene(), internals.original("problem.PER_BYTE")
    bodies, contacts = first.system.bodies, first.contacts
    # matrices as small as these are always made
    assert first.linear_model.choice.expecting(1).route == "condensed"
    internals.replace(monkeypatch, "problem.KEPT_BESIDE", 0)
    share = scene().linear_model.choice.pays_from / 2.5
    # measured with 2209 points between 46 x 46 x 6 and 50 x 50 x 6 hexahedra: 2.6 load steps
    assert_allclose((6627**3 + 5292**3) / (per_byte * 1.62e9), 2.6, rtol=0.2)
    internals.replace(monkeypatch, "problem.PER_BYTE", per_byte * share)

    def solver():
        return sc.ContactSolver(bodies, contacts)

    assert "they pay from 3 load steps on" in str(solver())
    few = [0.5, 1.0]
    for steps, route in ((few, "iterated"), ([*few, 1.0], "condensed"), (iter(few), "condensed")):
        one = solver()
        result = list(one.history(steps))[-1]
        assert one.linear_model.route == route
        words = "as dense matrices are not worth their time for 2 load steps: they pay from 3"
        assert (words in str(one)) == ("forces by GMRES" in result.report()) == (route == "iterated")
    assert solver().prepare().linear_model.route == "condensed"
    again, routes, results = solver(), [], []
    for load in (0.25, 0.5, 1.0, 1.0):
        given = {"up": load * bodies[1].x}
        results.append(again.solve(x=given, start=results[-1] if results else None))
        routes.append((again.linear_model.route, type(again.model).__name__))
    few, many = ("iterated", "IteratedBodies"), ("condensed", "Condensed")
    assert routes == [few, few, many, many]
    usual = list(first.history([0.25, 0.5, 1.0]))
    for found, known in zip(results, usual, strict=False):  # also those of before
        assert_allclose(found.u, known.u, rtol=0, atol=1e-11 * np.abs(known.u).max())
