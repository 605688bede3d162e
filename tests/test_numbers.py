"""Named numbers that decide, each on the least scene that shows it: doubled or halved, a test fails.

Most numbers are noticed by the tests of what they are for; `benchmarks/named_numbers.py` asks which.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.linalg import LinAlgError
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from statuses import STICK

import skfem_contact as sc
from skfem_contact.answers import Form, Support, critical_friction
from skfem_contact.bodies import kind_of, kink_angles
from skfem_contact.conditions import escape, steep_words
from skfem_contact.elimination import find_pivots
from skfem_contact.linalg import as_linear_solver, definite_inverse
from skfem_contact.problem import Conditions, PointSpace, Response

rested, size_words = internals.original("loops.rested"), internals.original("history._size_words")
balanced = internals.original("conditions.balanced")


def springs_that_keep(share):
    """A step whose springs keep shares of their forces from a solve to the next; and its solves."""
    share = np.asarray(share, dtype=float)
    m, solved = len(share), []

    def solve(conditions, forces):
        solved.append(forces)
        none = np.zeros((m, 0))
        return Response(np.zeros(m), none, 1.0 + share * forces, none, np.zeros(0))

    problem = SimpleNamespace(springs=np.ones(m), solve=solve, at_forces=lambda load, n, t: n)
    load = SimpleNamespace(gap0=np.ones(m), slip0=np.zeros((m, 0)))
    points = np.column_stack([np.arange(m), np.zeros(m)])
    motions = SimpleNamespace(kin=SimpleNamespace(points=points))
    step = SimpleNamespace(problem=problem, load=load, motions=motions, paired=np.ones(m, dtype=bool))
    none, closed = np.zeros((m, 0)), np.ones(m, dtype=bool)
    conditions = Conditions(closed, closed, none, np.zeros((m, 0, 0)), none, none)
    iterate = SimpleNamespace(conditions=conditions, direction=none)
    return step, iterate, solved


@pytest.mark.parametrize("share", [[0.4, 0.35, 0.1], [0.75, 0.7, 0.1]], ids=["plain", "gmres"])
def test_springs_come_to_rest(share):
    """Plain solves do it where half of a change is gone each time (MOST_MOVES); else GMRES (SLOW)."""
    step, iterate, solved = springs_that_keep(share)
    found = rested(step, iterate)
    assert_allclose(found.response.normal_force, 1 / (1 - np.asarray(share)), rtol=2e-9)
    assert not found.strained
    assert len(solved) < 30


def test_springs_that_lose_half_are_left_to_themselves():
    """GMRES would take a solve for each kind of point and more: it is for rows that are slow (SLOW)."""
    share = np.linspace(0.1, 0.4, 40)
    step, iterate, solved = springs_that_keep(share)
    found = rested(step, iterate)
    plain = [p for p in solved if np.ptp(p) == 0]
    assert len(plain) == 2  # the first two have equal forces; GMRES begins again from none
    assert_allclose(found.response.normal_force, 1 / (1 - share), rtol=2e-9)


def test_springs_without_rest_are_told():
    """Of rows that contradict each other forces grow by the same from solve to solve; others rest."""
    step, iterate, solved = springs_that_keep([1.0, 0.1])
    found = rested(step, iterate)
    assert found.strained and len(solved) < 15
    assert_allclose(found.growth, [[1.0], [0.0]], atol=1e-6)
    assert_allclose(found.response.normal_force, [0.0, 1 / 0.9], atol=1e-5)  # without what has grown


# -- bounds that are told to users, or decide what is told -----------------------------------------


def test_steep_friction_is_said_beyond_that_of_materials():
    """Rubber on rock has 3 to 4: five is said (STEEP)."""
    assert steep_words(sc.Coulomb(4.5)) == ""
    assert steep_words(sc.Coulomb(5.5)).startswith("up to 79.7 degrees")


@pytest.mark.parametrize(("scale", "said"), [(200.0, 0), (400.0, 1)])
def test_bodies_in_other_units_are_said(scale, said):
    """A bolt beside a bridge may be meant; metres beside millimetres are more (UNLIKE)."""
    mesh = fem.MeshQuad()
    sizes = {"small": mesh, "large": mesh.scaled(scale)}
    solids = {n: SimpleNamespace(basis=SimpleNamespace(mesh=m)) for n, m in sizes.items()}
    solver = SimpleNamespace(system=SimpleNamespace(solids=solids), contacts=())
    assert len(size_words(solver)) == said


def test_coefficients_a_thousand_times_apart_are_refused():
    """As `OrthotropicCoulomb` promises (SMOOTHEST)."""
    sc.conditions.OrthotropicCoulomb((1.0, 1.5e-3), (1, 0, 0))
    with pytest.raises(sc.errors.InputError, match="more than 1000 times"):
        sc.conditions.OrthotropicCoulomb((1.0, 0.7e-3), (1, 0, 0))


@pytest.mark.parametrize(("turned", "refused"), [(0.7e-3, False), (1.5e-3, True)])
def test_gradients_may_be_off_by_a_thousandth(turned, refused):
    """Of their direction: a table that is interpolated is, a wrong formula is off by more (OFF)."""
    gradient = lambda x: np.array([np.full_like(x[0], np.sin(turned)), np.full_like(x[0], 1.0)])  # noqa: E731
    plane = sc.obstacles.LevelSet(lambda x: x[1], gradient=gradient)
    points = np.array([[0.0, 0.0], [1.0, 0.1]])
    if refused:
        with pytest.raises(sc.errors.InputError, match="is not that of its function"):
            plane._check_gradient(points, 1.0)
    else:
        plane._check_gradient(points, 1.0)


@pytest.mark.parametrize(("left", "refused"), [(0.7e-4, False), (1.5e-4, True)])
def test_solvers_may_leave_a_ten_thousandth(left, refused):
    """Of the load: conjugate gradients at a loose tolerance do; failures leave more (ACCEPTED)."""
    factors = as_linear_solver(lambda A, b: (1 - left) * spsolve(A.tocsc(), b))
    solve = factors.factorize(csr_matrix(np.diag([2.0, 3.0]))).solve
    if refused:
        with pytest.raises(sc.errors.LinearSolveError, match="as residual"):
            solve(np.array([1.0, 2.0]))
    else:
        solve(np.array([1.0, 2.0]))


# -- digits: how much of what users give may be off -----------------------------------------------


@pytest.mark.parametrize(("off", "refused"), [(0.7e-6, False), (1.5e-6, True)])
def test_what_is_given_has_six_digits(off, refused):
    """Springs of a rigid body, read from a file, are symmetric to these (GIVEN)."""
    springs = np.array([[1.0, 0.5, 0.0], [0.5 + off, 1.0, 0.0], [0.0, 0.0, 1.0]])
    body = lambda: sc.RigidBody(sc.RigidSphere((0, 0), 1.0), K=springs)  # noqa: E731
    refused_or_not(refused, body, "is not symmetric")


@pytest.mark.parametrize(("off", "refused"), [(0.7e-9, False), (1.5e-9, True)])
def test_what_is_solved_for_has_nine_digits(off, refused):
    """An ellipse that a user computed from another keeps its shape to these (SOLVED)."""
    law = lambda: sc.conditions.OrthotropicCoulomb(  # noqa: E731
        (0.1, 0.2), (1, 0, 0), tau_max=(1.0, 2.0 * (1 + off))
    )
    refused_or_not(refused, law, "does not fit mu")


@pytest.mark.parametrize(("height", "refused"), [(0.7e-7, True), (1.5e-7, False)])
def test_triangles_of_single_precision_have_an_area(height, refused):
    """Surfaces in STL have seven digits: what is lower is a line (SINGLE)."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0.5, height, 0)])
    tool = lambda: sc.RigidSurface(points, [(0, 1, 2)])  # noqa: E731
    refused_or_not(refused, tool, "have no area")


@pytest.mark.parametrize(("height", "refused"), [(0.7e-14, True), (1.5e-14, False)])
def test_elements_that_are_round_off_have_no_volume(height, refused):
    """Beside lengths of one (ROUND_OFF)."""
    mesh = fem.MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, height]]), np.array([[0], [1], [2]]))
    body = lambda: sc.Body.from_mesh(mesh, fem.ElementVector(fem.ElementTriP1()), sc.Elastic(1.0, 0.3))  # noqa: E731
    refused_or_not(refused, body, "no volume")


def refused_or_not(refused, make, words):
    """Make something, which is refused in these words, or not."""
    if not refused:
        make()
        return
    with pytest.raises(sc.errors.InputError, match=words):
        make()


@pytest.mark.parametrize(("along", "refused"), [(0.7e-2, True), (1.5e-2, False)])
def test_a_direction_of_friction_is_half_a_degree_off_the_normal(along, refused):
    """Nearer, turns under load decide where it points (NO_PROJECTION)."""
    mesh = fem.MeshHex().with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    block = sc.Body(basis, sc.Elastic(1.0, 0.3), D="top", name="block")
    law = sc.conditions.OrthotropicCoulomb((0.1, 0.3), (along, 0, 1))
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    contact = sc.Contact(block.surface("bottom"), floor, friction=law)
    refused_or_not(refused, lambda: sc.ContactSolver(block, contact), "normal to the surface")


# -- rows and pivots -------------------------------------------------------------------------------


@pytest.mark.parametrize(("apart", "rank"), [(0.7e-10, 1), (1.5e-10, 2)])
def test_rows_agree_to_ten_digits(apart, rank):
    """What is left of a row after elimination is nothing below these (AGREEMENT)."""
    assert len(find_pivots(csr_matrix([[1.0, 1.0], [1.0, 1.0 - apart]])).rows) == rank


@pytest.mark.parametrize(("entry", "column"), [(0.15, 1), (0.07, 0)])
def test_a_pivot_costs_no_more_than_one_digit(entry, column):
    """The side that is preferred is given up 81 degrees off the free direction (WORTH_PIVOTING)."""
    pivots = find_pivots(csr_matrix([[1.0, entry]]), np.array([False, True]))
    assert pivots.columns.tolist() == [column]


@pytest.mark.parametrize(("apart", "kept"), [(1.5e-3, True), (0.7e-3, False)])
def test_pivots_of_coupled_rows_cost_no_more_than_three_digits(apart, kept):
    """Beyond, the rows choose again (WELL_CONDITIONED)."""
    rows = csr_matrix([[1.0, 1.0 - apart, 0.5], [1.0 - apart, 1.0, -0.5]])
    pivots = find_pivots(rows)
    assert (set(pivots.columns.tolist()) == {0, 1}) == kept
    assert abs(pivots.inverse).max() < 1e3


@pytest.mark.parametrize(("pivot", "refused"), [(0.7e-3, True), (1.5e-3, False)])
def test_contact_rows_depend_on_others_where_six_digits_are_lost(pivot, refused):
    """Of the inverse of their compliance (DEPENDENT)."""
    least = internals.original("problem.DEPENDENT")
    W = np.array([[1.0, np.sqrt(1 - pivot**2)], [np.sqrt(1 - pivot**2), 1.0]])
    if not refused:
        assert_allclose(definite_inverse(W.copy(), least) @ W, np.eye(2), atol=1e-9)
        return
    with pytest.raises(LinAlgError, match="dependent"):
        definite_inverse(W, least)


# -- what holds a body -----------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "free"), [(0.7e-3, 1), (1.5e-3, 0)])
def test_a_support_a_thousandth_as_wide_holds_no_turn(share, free):
    """Two nodes in the middle of a square (SUPPORTED); the arm of a square is its diagonal."""
    half = share  # nodes that are apart by w turn by sqrt(1/2) w / sqrt(2)
    x = np.array([0.0, 0.5 - half, 0.5 + half, 1.0])
    basis = fem.Basis(
        fem.MeshQuad.init_tensor(x, np.array([0.0, 0.5, 1.0])), fem.ElementVector(fem.ElementQuad1())
    )
    near = basis.get_dofs(nodes=np.flatnonzero(np.abs(basis.mesh.p - 0.5).max(axis=0) < 0.1))
    support = Support.of(sc.Body(basis, sc.Elastic(1.0, 0.3), D=near.all()), 0)
    assert_allclose(support.arm, np.sqrt(2.0), rtol=1e-3)
    assert support.free.shape[1] == free


@pytest.mark.parametrize(("left", "balances"), [(1.4e-4, True), (3e-4, False)])
def test_forces_along_a_free_motion_balance_to_four_digits(left, balances):
    """Of load and contact force together (LEFT_ALONG): the digits of the contact problem."""
    one, none = np.ones((1, 1)), np.zeros((1, 0))
    motions = SimpleNamespace(k=1, normal=one, modes=one, tangential=np.zeros((1, 0, 1)))
    state = SimpleNamespace(normal_force=np.ones(1), tangential_force=none)
    assert balanced(motions, np.array([left - 1.0]), state, 0.0) == balances


def test_friction_in_space_holds_a_body_up_to_its_bound():
    """A hundredth beyond what Coulomb's law can hold is told from statics alone (DIRECTIONS)."""
    basis = fem.Basis(fem.MeshHex().with_defaults(), fem.ElementVector(fem.ElementHex1()), intorder=2)
    block = sc.Body(basis, sc.Elastic(1.0, 0.3), name="block")
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    contact = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.2))
    model = sc.ContactSolver(block, contact).linear_model
    bottom = basis.get_dofs("bottom")
    for share, slides in ((0.99, False), (1.01, True)):
        f = np.zeros(basis.N)
        f[bottom.all("u^3")], f[bottom.all("u^1")] = -1.0, 0.2 * share
        found = escape(model.motions, model.interface, model.kin.paired, f)
        assert (found is not None) == slides


# -- what is shown of other answers ----------------------------------------------------------------


@pytest.mark.parametrize(("held", "refused"), [(0.7e-5, True), (1.5e-5, False)])
def test_a_body_that_hardly_holds_its_points_shows_nothing(held, refused):
    """Forces lose as many digits (LOOSE)."""
    space = PointSpace(np.diag([1.0, held**2]), np.array([0]), np.array([[1]]))
    form = lambda: Form(space, np.array([0]), np.array([1]), np.full(1, np.inf))  # noqa: E731
    if not refused:
        form()
        return
    with pytest.raises(LinAlgError, match="nothing but contact"):
        form()


def test_what_is_shown_is_known_to_a_thousandth():
    """Of unit springs the form is twice half of one (SHOWN): more would be round-off, less is lost."""
    space = PointSpace(np.eye(2), np.array([0]), np.array([[1]]))
    form = Form(space, np.array([0]), np.array([1]), np.full(1, np.inf))
    found, _ = form.estimate(0.0, form.balance(np.ones(1), np.ones(1)))
    assert 0.9985 < found / 2.0 < 1.0


def test_critical_friction_in_space_has_four_digits():
    """Where slips are 20 times as stiff one way as the other, across the way gaps couple (DIRECTIONS).

    The least of ``d' K d / (k . d)`` over directions d is ``2 sqrt(s (1 - s)) / k`` with K = diag(1, s)
    and k along the first axis.
    """
    s, k, worst = 1 / 20, 0.1, 0.0
    for angle in np.linspace(0.0, 0.1, 41):
        R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        S = np.eye(3)
        S[1:, 1:] = R @ np.diag([1.0, s]) @ R.T
        S[0, 1:] = S[1:, 0] = R @ [k, 0.0]
        space = PointSpace(S, np.array([0]), np.array([[1, 2]]))
        found = critical_friction(space, np.array([STICK]), np.ones(1), np.full(1, np.inf))[0]
        worst = max(worst, abs(found * k / (2 * np.sqrt(s * (1 - s))) - 1))
    assert 0 < worst < 1e-4


# -- kinks of a boundary ---------------------------------------------------------------------------


def turns_of(*turns):
    """The kinks of a line in the plane that turns by these angles at its inner nodes."""
    angle = np.cumsum([0.0, *turns])
    points = np.vstack(
        [[0.0, 0.0], np.cumsum(np.column_stack([-np.cos(angle), np.sin(angle)]), axis=0)]
    )
    facets = np.column_stack([np.arange(len(angle)), np.arange(1, len(angle) + 1)])
    twins = np.array([[2 * i - 1, 2 * i + 2] for i in range(len(angle))])
    twins[-1, 1] = -1
    return kink_angles(points, facets, kind_of(2, 2), twins)[2:-2]


@pytest.mark.parametrize(("turn", "kinks"), [(0.7e-3, 0), (1.5e-3, 1)])
def test_a_turn_of_a_thousandth_is_a_kink(turn, kinks):
    """Less makes gaps wrong by less than a ten thousandth of a facet (BENT)."""
    assert np.count_nonzero(turns_of(0, 0, turn, 0, 0)) == kinks


@pytest.mark.parametrize(("share", "kinks"), [(0.015, 1), (0.03, 0)])
def test_a_side_that_bends_has_no_kink(share, kinks):
    """A straight one turns by round-off of files, a curve by a few per cent of the rest (STRAIGHT)."""
    turn = 0.1
    assert (
        np.count_nonzero(turns_of(share * turn, share * turn, turn, share * turn, share * turn))
        == kinks
    )


# -- the list --------------------------------------------------------------------------------------


def test_the_list_is_that_of_the_library(monkeypatch):
    """docs/checks/numbers.md; else write it anew by `python benchmarks/named_numbers.py --write`."""
    root = Path(__file__).parents[1]
    monkeypatch.syspath_prepend(str(root / "benchmarks"))
    made = importlib.import_module("named_numbers").page()
    assert made == (root / "docs" / "checks" / "numbers.md").read_text(encoding="utf-8")


def test_up_to_where_an_estimate_is_told_as_a_number():
    """Errors of a fifth of the traction are told, those of two fifths only as larger (ESTIMATED)."""
    for share, words in ((0.2, "pressure 20 %"), (0.4, "beyond what can be estimated")):
        part = sc.answers.ErrorSources(edges=share)
        known = sc.answers.ErrorEstimate(part, part, np.zeros(1), {}, 0, "")
        assert words in known.words


@pytest.mark.parametrize(
    ("numbers", "within"),
    [
        ({"sagitta": 0.15, "approach": 1.0}, True),  # SAGITTA
        ({"sagitta": 0.3, "approach": 1.0}, False),
        ({"facets": 0.7, "widths": 1.0}, True),  # FACETS
        ({"facets": 1.5, "widths": 1.0}, False),
    ],
)
def test_what_a_drift_may_be(numbers, within):
    """Curves over a facet may stand out by a fifth of the approach, points may slip a facet."""
    drift = sc.answers.Drift(closed=1, **numbers)
    assert (drift.small_sliding_holds and not drift.facets_too_long) == within


@pytest.mark.parametrize(("overlap", "within"), [(0.28, True), (0.5, False)])
def test_how_deep_unlike_meshes_may_overlap(overlap, within):
    """At the end of a wedge that is driven in .28 of the approach, with right forces (OVERLAP)."""
    drift = sc.answers.Drift(closed=1, approach=1.0)
    nothing = {"chords": 0.0, "unseen": 0, "opening": 0.0, "angle": 0.0, "angle_over_mu": 0.0}
    measured = sc.answers.ContactValidity(drift=drift, overlap=overlap, **nothing)
    assert (measured.excess <= 1.0) == within


def test_the_energy_balance_of_a_step_that_is_too_long():
    """What it misses is told from a twentieth of the energy lost on (COARSE)."""
    mesh = fem.MeshQuad().refined(1).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    block = sc.Body(basis, sc.Elastic(1.0, 0.3), D="top", x={"top": (0.02, -0.01)}, name="block")
    foot = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.3))
    values = sc.ContactSolver(block, foot).solve().values[0]
    for share, told in ((0.035, False), (0.07, True)):
        words = str(replace(values, energy_residual=share * values.dissipation))
        assert ("energy balance misses" in words) == told
