"""The nonlinear loops on two or three springs, where every answer can be written down."""

from __future__ import annotations

import itertools
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import internals
import numpy as np
import pytest
import skfem as fem
from hex_blocks import friction_rule
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters
from statuses import OPEN, SLIP, STICK

import skfem_contact as sc
from skfem_contact import Coulomb, Options
from skfem_contact.conditions import RigidMotions
from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg import Anderson
from skfem_contact.loops import (
    At,
    Guess,
    Projection,
    Record,
    Stagnation,
    Step,
    direct,
    drive,
    fictitious,
    friction_of_prescribed_slip,
    linear_conditions,
    natural_state,
    newton,
    stabilise,
)
from skfem_contact.problem import Conditions, Load, PointSpace, Resistance, Response

_by = internals.original("loops._by")
_go = internals.original("loops._go")
_peak = internals.original("loops.Pull.peak")
_lost = internals.original("loops._lost")

LOOPS = {"newton": newton, "direct": direct, "fictitious": fictitious}
K_N, K_T, MU = 4.0, 3.0, 0.5


def step(normal, tangential, *, gap=0.0, stiffness=np.inf, last=None, tied=False):
    """Separate points on springs K_N and K_T under given forces (positive normal presses)."""
    normal, tangential = np.atleast_1d(normal).astype(float), np.atleast_1d(tangential).astype(float)
    m = len(normal)
    space = PointSpace(
        np.diag(np.r_[np.full(m, K_N), np.full(m, K_T)]), np.arange(m), m + np.arange(m)[:, None]
    )
    load = Load(np.r_[-normal, tangential], np.full(m, gap), np.zeros((m, 1)), np.zeros(0))
    own = np.full(m, -1)  # no point carries the row of a vertex
    along = np.tile([[[-1.0, 0.0]]], (m, 1, 1))
    frame = {"normal": np.tile([0.0, 1.0], (m, 1)), "axes": along, "duals": along, "scaled": None}
    kin = SimpleNamespace(m=m, tangents=1, gap0=np.zeros(m), area=np.ones(m), vertex=own, **frame)
    still = natural_state(kin, 0).along(kin)
    law = None if tied else Coulomb(MU)
    return Step(
        problem=SimpleNamespace(points=space, springs=None, solve=space.solve),
        load=load,
        motions=RigidMotions(np.zeros((2 * m, 0)), None, None),
        paired=np.ones(m, dtype=bool),
        tied=np.full(m, tied),
        bilateral=np.full(m, tied),
        friction=friction_rule(law, np.zeros((m, 2)), np.ones(m), (last or still).reference),
        frictional=np.full(m, not tied),
        stiffness=np.full(m, stiffness),
        last=last or still,
        rank=np.arange(m),
    )


def cold(one):
    m = len(one.paired)
    zero = np.zeros((m, 1))
    return Guess(np.full(m, STICK if one.tied.any() else OPEN), zero, np.zeros(m), zero, zero)


def run(loop, one, limit=400):
    stiff = loop == "fictitious" and np.isinf(one.stiffness).all()
    one = replace(one, stiffness=np.full(len(one.paired), 10 * K_T)) if stiff else one
    return drive(LOOPS[loop], one, cold(one), Options().tolerance, limit)


@pytest.mark.parametrize("loop", LOOPS)
def test_points_open_stick_and_slip(loop):
    """Pulled, pushed a little, and pushed beyond mu N: open, stick, slip, each on its own."""
    outcome = run(loop, step([-1.0, 2.0, 2.0, 2.0], [0.5, 0.5, 3.0, -3.0]))
    assert outcome.converged
    found = outcome.iterate.response
    assert_array_equal(outcome.iterate.status, [OPEN, STICK, SLIP, SLIP])
    assert_allclose(found.normal_force, [0, 2, 2, 2], rtol=0, atol=1e-12)
    spring = 10 * K_T / (11 * K_T) if loop == "fictitious" else 1.0  # in series with K_T
    assert_allclose(found.tangential_force[:, 0], [0, 0.5 * spring, 1.0, -1.0], rtol=0, atol=1e-9)
    assert_allclose(
        found.slip[:, 0], [0.5 / K_T, 0.5 * (1 - spring) / K_T, 2 / K_T, -2 / K_T], rtol=0, atol=1e-9
    )
    assert_allclose(found.gap, [1 / K_N, 0, 0, 0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(("pull", "status"), [(0.7e-11, STICK), (1.5e-11, OPEN)])
def test_a_point_that_is_pulled_by_round_off_stays_closed(pull, status):
    """Beside one that is pressed by one (NO_VIOLATION): condensation loses some digits."""
    one = step([1.0, -pull], [0.0, 0.0])
    zero = np.zeros((2, 1))
    closed = Guess(np.full(2, STICK), zero, np.array([1.0, 0.0]), zero, zero)
    outcome = drive(newton, one, closed, 1e-14, 10)
    assert_array_equal(outcome.iterate.status, [STICK, status])


def test_the_same_points_under_another_load_know_nothing_of_the_first():
    """What a step shares with the next one are its points; bounds are those of its own answers."""
    first = step([2.0, 2.0], [0.5, 3.0])
    run("newton", first)
    force, slip = np.array([2.0, 4.0]), np.array([[1.0], [2.0]])
    trial = np.full((2, 1), 100.0)
    assert_allclose(first.friction.project(trial, force, slip)[0][:, 0], MU * force)
    other = step([-1.0, 2.0], [0.0, 0.0])
    second = first.under(other.load, other.last, 0.25, 0.5)
    assert (second.load, second.last, second.noise) == (other.load, other.last, 0.25)
    assert second.far == 0.5
    assert second.friction.laws is first.friction.laws and second.paired is first.paired
    assert_array_equal(run("newton", second).iterate.status, run("newton", other).iterate.status)
    # the same arrays, then others of the same size
    for normal in (force, 2 * force, force.copy()):
        for _ in range(2):
            assert_allclose(second.friction.project(trial, normal, slip)[0][:, 0], MU * normal)


@pytest.mark.parametrize("share", [0.0, 2.0**-10, 3 * 2.0**-10, 1e-3, 0.25, 1 / 3, 0.3, 0.5e-9, 2 / 3])
def test_points_that_are_alike_but_for_round_off_go_by_rank(share):
    """Whatever part of the largest value theirs is, a binary fraction that ends with a 5 as well."""
    value = np.array([share, np.nextafter(share, 1.0), np.nextafter(share, -1.0), 1.0])
    for first in itertools.permutations(range(3)):
        points = SimpleNamespace(paired=np.ones(4, dtype=bool), rank=np.array([*first, 3]))
        found = _by(value, np.ones(4, dtype=bool), points)
        assert_array_equal(points.rank[found], np.arange(4))


@pytest.mark.parametrize("loop", LOOPS)
def test_gaps_close_when_they_are_used_up(loop):
    """A point with a gap is pressed only with what its spring leaves over."""
    outcome = run(loop, step([1.0, 3.0], [0.0, 0.0], gap=0.5))
    assert_array_equal(outcome.iterate.status, [OPEN, STICK])
    assert_allclose(outcome.iterate.response.normal_force, [0.0, 3.0 - 0.5 * K_N], rtol=0, atol=1e-12)


@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_friction_remembers_the_last_step(loop):
    """Unloaded after slip, a point sticks where it is, and its friction turns round."""
    first = run(loop, step(2.0, 3.0)).iterate
    response = first.response
    last = replace(
        step(0.0, 0.0).last,
        status=first.status,
        slip=response.slip,
        tangential_force=response.tangential_force,
        normal_force=response.normal_force,
    )
    back = run(loop, step(2.0, 1.5, last=last)).iterate
    assert_array_equal(back.status, [STICK])
    assert_allclose(back.response.slip, response.slip)
    assert_allclose(back.response.tangential_force, 1.5 - K_T * response.slip)
    reverse = run(loop, step(2.0, 0.0, last=last)).iterate
    assert_array_equal(reverse.status, [SLIP])
    assert_allclose(reverse.response.tangential_force, -1.0)


@pytest.mark.parametrize("loop", LOOPS)
def test_tied_points_hold_in_tension(loop):
    """A tied point carries tension and shear without limit."""
    outcome = run(loop, step(-2.0, 50.0, tied=True))
    assert_allclose(outcome.iterate.response.normal_force, [-2.0])
    assert_allclose(outcome.iterate.response.tangential_force, [[50.0]])


@pytest.mark.parametrize("loop", LOOPS)
def test_loops_keep_nothing(loop):
    """The same step solved twice, with another in between, gives the same numbers."""
    one, other = step([2.0, 1.0], [3.0, 0.1]), step([-1.0, 5.0], [0.0, 9.0])
    first, _, second = run(loop, one), run(loop, other), run(loop, one)
    assert len(first.trace) == len(second.trace)
    assert_array_equal(
        first.iterate.response.tangential_force, second.iterate.response.tangential_force
    )


def test_proposals_follow_signorini():
    """A closed point in tension opens, an open one that penetrates closes, and nothing is mutated."""
    one = step([-1.0, 2.0], [0.0, 0.0])
    status = np.array([STICK, OPEN])
    guess = replace(cold(one), status=status)
    free = np.zeros((2, 1))
    held = Conditions(status != OPEN, status == STICK, free, np.zeros((2, 1, 1)), free, free)
    response = one.problem.solve(held, one.load)
    proposal = Projection(one, response).proposal(guess)
    assert_array_equal(proposal.status, [OPEN, STICK])
    assert_array_equal(guess.status, [STICK, OPEN])


def test_holding_keeps_just_enough_points():
    """A body free to move up and along keeps the points nearest to contact, no more than it needs."""
    status, held = holding([0.3, 0.1, 0.2])
    assert_array_equal(status, [OPEN, STICK, OPEN])
    assert_array_equal(held.points, [False, True, False])
    assert held.motion.shape == (2, 2)


def test_round_off_of_gaps_does_not_choose_what_holds():
    """Gaps of 1e-15 between points 1 apart are alike: the first by `rank` holds."""
    assert_array_equal(holding([3e-15, 1e-15, -2e-15])[0], [STICK, OPEN, OPEN])
    # over the 9 digits to which gaps are told apart, and over the round-off of coordinates
    assert_array_equal(holding([3e-13, 1e-13, 2e-13])[0], [OPEN, STICK, OPEN])


def holding(gaps):
    """What holds a body of three points, free to move up and along, that are all open."""
    one = step([1.0, 1.0, 1.0], [0.0, 0.0, 0.0])
    load = replace(one.load, gap0=np.array(gaps))
    up, along = np.eye(2)
    place = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    rows = {"B_n": np.tile(up, (3, 1)), "B_t": np.tile(along, (3, 1))}
    points = SimpleNamespace(m=3, tangents=1, points=place, **rows)
    one = replace(one, load=load, motions=RigidMotions(np.eye(2), points, None), rank=np.arange(3))
    return stabilise(one, replace(cold(one), status=np.zeros(3, dtype=int)))


def test_holding_passes_points_that_do_not_resist():
    """A body free to turn about one of its sliding points is not held by the friction of that one."""
    one = step([1.0, 1.0, 1.0], [0.0, 0.0, 0.0])
    rows = {"B_n": np.zeros((3, 1)), "B_t": np.array([[0.0], [1.0], [2.0]])}
    points = SimpleNamespace(m=3, tangents=1, points=np.zeros((3, 2)), **rows)
    one = replace(one, motions=RigidMotions(np.eye(1), points, None))
    # by its friction, which is far below its limit, the first point is asked before the others
    sliding = replace(
        cold(one),
        status=np.full(3, SLIP),
        normal_force=np.array([3.0, 2.0, 1.0]),
        tangential_force=np.zeros((3, 1)),
    )
    status, held = stabilise(one, sliding)
    assert_array_equal(status, [SLIP, STICK, SLIP])
    assert_array_equal(held.points, [False, True, False])


def test_driver_counts_and_stops():
    """The driver stops at its limit, and at the word of the callback, and says which."""
    one = step([2.0], [3.0])
    outcome = drive(newton, one, cold(one), 1e-10, 1)
    assert not outcome.converged and "no convergence in 1 iterations" in outcome.message
    seen = []

    def stop(record):
        seen.append(record)
        raise StopIteration

    outcome = drive(newton, one, cold(one), 1e-10, 50, stop)
    assert outcome.stopped and len(seen) == 1 and "stopped by the callback" in outcome.message


def test_anderson_solves_linear_fixed_points():
    """On a linear map of n unknowns mixing ends after n + 1 steps, where iteration would not."""
    rng = np.random.default_rng(1)
    A, b = np.eye(3) - np.diag([0.01, 0.5, 1.6]), rng.standard_normal(3)
    x, mixing = np.zeros(3), Anderson()
    for _ in range(6):
        x = mixing.next(x, A @ x + b)
    assert_allclose(x, np.linalg.solve(np.eye(3) - A, b), rtol=1e-8)


def test_a_set_that_can_not_be_solved_for_ends_a_run():
    """Points that hold a body too weakly make a singular matrix: the run ends where it stands, and
    other starts are tried; in the first iteration it may be the bodies, and is raised."""
    one = step(1.0, 0.0)

    def breaks(after):
        def loop(given, guess, tolerance):
            for iterate in islice(LOOPS["newton"](given, guess, tolerance), after):
                yield replace(iterate, converged=False)
            raise SingularMatrix("no such set")

        return loop

    outcome = drive(breaks(1), one, cold(one), 1e-10, 10)
    assert not outcome.converged and "too weakly" in outcome.message and len(outcome.trace) == 1
    with pytest.raises(SingularMatrix):
        drive(breaks(0), one, cold(one), 1e-10, 10)


@pytest.mark.pairwise
@pytest.mark.parametrize("loop", ["newton", "direct"])
@pytest.mark.parametrize("method", ["mortar", "node"])
@pytest.mark.parametrize("pressed", [0.0, -4e-3])
def test_blocks_that_touch_slide_without_force(loop, method, pressed):
    """Slid by 2e-3 while just touching, from rest or after a press: no force, no row of refusals."""
    bodies = []
    for name, y, side in (("block", (-10.0, 0.0), "bottom"), ("punch", (0.0, 6.0), "top")):
        half = 20 if name == "block" else 5
        grid = np.linspace(-half, half, 21 if name == "block" else 8), np.linspace(*y, 5)
        mesh = fem.MeshQuad.init_tensor(*grid).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
        form = linear_elasticity(*lame_parameters(210e3, 0.3))
        bodies.append(sc.Body(basis, form, D=side, name=name))
    pair = bodies[1].surface("bottom"), bodies[0].surface("top")
    contact = sc.Contact(*pair, friction=sc.Coulomb(0.3), method=method)
    basis = bodies[1].basis
    steps = [
        {"x": {"punch": basis.project(lambda x, v=v: np.stack([v[0] + 0 * x[0], v[1] + 0 * x[0]]))}}
        for v in ((0.0, pressed), (2e-3, 0.0))
    ]
    results = list(sc.ContactSolver(bodies, contact, loop=loop).history(steps))
    # round-off of K times the displacement, 2e5 * 2e-3
    assert np.abs(results[-1].forces).max() < 1e-10
    assert np.abs(results[-1].displacement("block")).max() < 1e-12


@pytest.mark.parametrize("loop", LOOPS)
def test_an_answer_given_as_guess_is_confirmed(loop):
    """Begun where it ended, each loop needs one iteration and moves nothing."""
    one = step([-1.0, 2.0, 2.0, 2.0], [0.5, 0.5, 3.0, -3.0], stiffness=10 * K_T)
    it = run(loop, one).iterate
    there = it.response
    known = Guess(it.status, it.direction, there.normal_force, there.tangential_force, there.slip)
    again = drive(LOOPS[loop], one, known, Options().tolerance, 2)
    assert again.converged and len(again.trace) == 1
    assert_allclose(again.iterate.response.slip, there.slip, rtol=0, atol=1e-14)


@pytest.mark.parametrize("loop", ["direct", "fictitious"])
def test_a_loop_that_does_not_settle_goes_on_from_newton(loop):
    """Too few iterations for friction that lags: Newton solves the same springs, and it confirms."""
    mesh = fem.MeshQuad().refined(3).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.03, -0.01)}, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(block.surface("bottom"), floor, friction=Coulomb(0.3))
    long = sc.ContactSolver(block, foot, loop=loop).solve()
    few = 4
    assert long.iterations > few and (long.status == SLIP).any()
    short = sc.ContactSolver(block, foot, loop=loop, options=Options(max_iterations=few, max_cuts=0))
    size = np.abs(long.forces).max()
    assert_allclose(short.solve().forces, long.forces, rtol=0, atol=Options().tolerance * size)


@pytest.mark.parametrize("loop", LOOPS)
def test_the_answer_solves_its_last_conditions(loop):
    """The conditions that an iterate keeps are those of its answer: solved again, it comes out."""
    one = step([-1.0, 2.0, 2.0, 2.0], [0.5, 0.5, 3.0, -3.0])
    it = run(loop, one).iterate
    again = one.problem.solve(it.conditions, one.load)
    for name in ("gap", "slip", "normal_force", "tangential_force"):
        assert_allclose(getattr(again, name), getattr(it.response, name), rtol=0, atol=1e-14)
    assert_array_equal(it.conditions.closed, it.status != OPEN)


@pytest.mark.parametrize("loop", LOOPS)
@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_two_tangents_are_one_where_all_acts_along_a_line(loop, angle):
    """The points of the first test, pushed along a line across two tangents: the same along it."""
    line = np.array([np.cos(angle), np.sin(angle)])
    flat = step([-1.0, 2.0, 2.0, 2.0], [0.5, 0.5, 3.0, -3.0])
    m, zero = 4, np.zeros((4, 2))
    rows = m + np.arange(2 * m).reshape(m, 2)
    space = PointSpace(np.diag(np.r_[np.full(m, K_N), np.full(2 * m, K_T)]), np.arange(m), rows)
    push = np.outer(flat.load.force[m:], line)
    last = replace(flat.last, slip=zero, tangential_force=zero, reference=zero)
    one = replace(
        flat,
        problem=SimpleNamespace(points=space, springs=None, solve=space.solve),
        load=Load(np.r_[flat.load.force[:m], push.ravel()], np.zeros(m), zero, np.zeros(0)),
        motions=RigidMotions(np.zeros((3 * m, 0)), None, None),
        last=last,
        resistance=Resistance(np.full(m, K_N), np.full(m, K_T)),
    )
    if loop == "fictitious":
        one, flat = (replace(s, stiffness=np.full(m, 10 * K_T)) for s in (one, flat))
    tangents = Guess(np.full(m, OPEN), zero, np.zeros(m), zero, zero)
    found = drive(LOOPS[loop], one, tangents, Options().tolerance, 400)
    known = drive(LOOPS[loop], flat, cold(flat), Options().tolerance, 400)
    # with each point's own resistance limits that lag know the force of what closes beforehand
    assert found.converged and len(found.trace) <= len(known.trace)
    assert_array_equal(found.iterate.status, known.iterate.status)
    for name in ("slip", "tangential_force"):
        along = getattr(known.iterate.response, name) * line
        assert_allclose(getattr(found.iterate.response, name), along, rtol=0, atol=1e-9)
    assert_allclose(found.iterate.response.normal_force, [0, 2, 2, 2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("before", [0.5, 4.0, 10.0])
def test_friction_where_supports_prescribe_the_slip_resists_it(before):
    """Pressed less and moved back: the bound against the slip, however large the last friction was."""
    one = step([2.0], [0.0])
    last = replace(one.last, slip=np.array([[0.3]]), tangential_force=np.array([[before]]))
    back = Response(np.zeros(1), np.array([[0.1]]), np.array([2.0]), np.zeros((1, 1)), np.zeros(0))
    closed = np.array([STICK])
    status, force = friction_of_prescribed_slip(replace(one, last=last), np.array([True]), closed, back)
    assert_array_equal(status, [SLIP])
    assert_allclose(force, [[-2.0 * MU]], rtol=1e-15)


@pytest.mark.parametrize(
    ("loop", "stiffness", "words"),
    [
        ("newton", None, ""),
        ("fictitious", None, "a stiffness, that of the loop 'fictitious': "),
        ("direct", None, "a stiffness, that of the loop 'direct': "),
        ("newton", 7.0, "a stiffness, its own: 7\n"),
    ],
)
def test_the_solver_says_what_sticking_gives_way_by(loop, stiffness, words):
    """Soft sticking moves bodies that friction holds, by a tenth more with fictitious forces."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    block = sc.Body(basis, linear_elasticity(), D="top", name="block")
    law = sc.Coulomb(0.3, stiffness=stiffness)
    floor = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    said = str(sc.ContactSolver(block, floor, loop=loop))
    assert words in said
    assert ("give way" in said) == bool(words)


def test_progress_is_fewer_changes_or_half_the_violation():
    """Each alone is progress, and so is what a loop says; a run without any is given up in time."""
    line = {"iteration": 1, "open": 0, "stick": 0, "slip": 0}
    fewer = [(9 - k, 1.0, False) for k in range(8)]
    halved = [(3, 0.4**k, False) for k in range(8)]
    nearer = [(3, 1.0, True)] * 8
    for run_of in (fewer, halved, nearer):
        progress = Stagnation()
        assert not any(
            progress.stalled(Record(changes=c, residual=r, **line), 2, n) for c, r, n in run_of
        )
    # by less than half is none
    for run_of in ([(3, 1.0, False)] * 8, [(3, 0.9**k, False) for k in range(8)]):
        progress = Stagnation()
        said = [progress.stalled(Record(changes=c, residual=r, **line), 2, n) for c, r, n in run_of]
        assert said.index(True) == 2


@pytest.mark.parametrize("bilateral", [False, True])
@pytest.mark.parametrize("normal", [2.0, -2.0])
def test_friction_of_what_slips_is_judged_where_a_point_carries(bilateral, normal):
    """Friction off its law counts at points that press, and at those that never open, even if pulled.

    A point that can open and pulls is about to do so: its friction says nothing.
    """
    one = replace(step(2.0, 0.0), bilateral=np.array([bilateral]))
    gap, along = np.zeros(1), np.ones((1, 1))
    response = Response(gap, along, np.array([normal]), 3.0 * along, np.zeros(2))
    lawful = MU * max(normal, 0.0)
    tangential = Projection(one, response).left_over[1]
    # nothing that pulls carries friction, if it may open
    assert_allclose(tangential, [[3.0 - lawful]], rtol=1e-12)


@pytest.mark.parametrize("bilateral", [False, True])
@pytest.mark.parametrize("normal", [2.0, -2.0])
def test_bounds_follow_normal_forces_but_for_bonds_under_tension(bilateral, normal):
    """Within the linear solve friction follows the normal force, but for bonds that are pulled."""
    one = replace(step(2.0, 0.0), bilateral=np.array([bilateral]))
    along = np.ones((1, 1))
    guess = Guess(np.array([SLIP]), along, np.array([normal]), along, along)
    coupling = linear_conditions(one, guess, True).coupling
    assert_allclose(coupling, [[0.0 if bilateral and normal < 0 else MU]])
    assert_allclose(linear_conditions(one, guess, False).coupling, [[0.0]])


def in_space(normal, friction, slip, status, direction, noise=0.0, stiffness=np.inf):
    """One point with two tangents: the step, what is known of it, and a state that was solved for."""
    zero = np.zeros((1, 2))
    flat = step(1.0, 0.0, stiffness=stiffness)
    one = replace(
        flat,
        last=replace(flat.last, slip=zero, tangential_force=zero, reference=zero),
        resistance=Resistance(np.full(1, K_N), np.full(1, K_T)),
        noise=noise,
    )
    state = np.atleast_2d(slip).astype(float), np.array([normal]), np.atleast_2d(friction).astype(float)
    current = Guess(
        np.array([status]), np.atleast_2d(direction).astype(float), state[1], state[2], zero
    )
    return one, current, Response(np.zeros(1), *state, np.zeros(3))


def test_friction_off_the_direction_of_a_small_slip_is_seen():
    """The largest slip counts as much as the largest force, where resistances make nothing of it."""
    off, bound = 0.1, 2.0 * MU
    friction = bound * np.array([np.cos(off), np.sin(off)])
    one, current, response = in_space(2.0, friction, [1e-9, 0.0], SLIP, [1.0, 0.0])
    wrong, residual = Projection(one, response).violations(current, 1e-6)
    assert not wrong.any()
    pushed = friction + np.array([2.0, 0.0])  # the slip, as large as the largest force
    left = friction - bound * pushed / np.linalg.norm(pushed)
    assert_allclose(residual, np.linalg.norm(left) / 2.0, rtol=1e-12)


@pytest.mark.parametrize(("noise", "status"), [(1.0, STICK), (1e-9, SLIP)])
def test_what_sticks_slips_only_where_forces_are_more_than_noise(noise, status):
    """A point that sticks and has slipped: where all forces are round-off that does not let it go."""
    one, current, response = in_space(0.1, [0.05, 0.0], [2.0, 0.0], STICK, [0.0, 0.0], noise)
    assert_array_equal(Projection(one, response).proposal(current).status, [status])
    # what slipped goes on
    slipping = replace(current, status=np.array([SLIP]), direction=np.array([[1.0, 0.0]]))
    assert_array_equal(Projection(one, response).proposal(slipping).status, [SLIP])


@pytest.mark.parametrize(("noise", "direction"), [(1.0, [1.0, 0.0]), (0.0, [0.0, 1.0])])
def test_a_direction_turns_only_with_forces_that_are_more_than_noise(noise, direction):
    """Friction of 1e-3 aside turns the slip of a point without pressure, unless it is round-off."""
    one, current, response = in_space(0.0, [0.0, 1e-3], [0.0, 0.0], SLIP, [1.0, 0.0], noise)
    found = Projection(one, response).proposal(current)
    assert_array_equal(found.status, [SLIP])
    assert_allclose(found.direction, [direction], atol=1e-12)


@pytest.mark.parametrize(
    ("force", "status", "wrong"), [(1.5, STICK, 1), (0.5, STICK, 0), (1.5, SLIP, 0)]
)
def test_springs_beyond_their_bound_are_wrong_however_little_they_moved(force, status, wrong):
    """Where the force of a stiff spring may be round-off of its slip, what sticks obeys its bound.

    What slips has the bound for its force in the next solve, and is judged by what the projection
    leaves over, which is known to no better than the slip.
    """
    # a slip that is known to 1e-12 and a spring of 1e14: forces up to a hundred may be round-off
    slip = np.array([force / 1e14, 0.0])
    one, current, response = in_space(2.0, [force, 0.0], slip, status, [1.0, 0.0], 0.0, 1e14)
    one = replace(one, far=1.0)
    assert Projection(one, response).violations(current, 1e-10)[0].sum() == wrong


@pytest.mark.parametrize(("stiffness", "wrong"), [(7e12, 0), (3.5e12, 1)])
def test_a_spring_is_known_to_a_tenth_of_the_round_off_of_its_slip(stiffness, wrong):
    """Half of the bound is beyond it; slips are known to 1e-12, so it is to .7 or .35 (SOLVED_SLIP)."""
    slip = np.array([1.5 / stiffness, 0.0])
    one, current, response = in_space(2.0, [1.5, 0.0], slip, SLIP, [1.0, 0.0], 0.0, stiffness)
    one = replace(one, far=1.0)
    assert Projection(one, response).violations(current, 1e-10)[0].sum() == wrong


@pytest.mark.parametrize(
    ("strain", "change", "gap", "slow", "lost"),
    [
        (1e-3, 1e-3, 1.0, False, False),  # neither
        (1e-16, 1e-3, 1.0, False, True),  # soft springs: no strain beside the gaps
        (1e-3, 1e-11, 1.0, False, True),  # forces that stay
        (1e-3, 1e-11, 0.0, False, True),  # where no gap says what round-off is
        (1e-16, 1e-3, 0.0, False, False),
        (1e-16, 1e-3, 0.0, True, True),  # slow: what rows are known to, of points one apart
        (1e-3, 1e-3, 0.0, True, False),
    ],
)
def test_springs_are_without_strain_or_forces_stay(strain, change, gap, slow, lost):
    """Either is the end: strains that are round-off of gaps, or forces that change by as little."""
    change = np.array([[change, 0.0]])
    points = SimpleNamespace(points=np.array([[0.0, 0.0], [1.0, 0.0]]))
    one = SimpleNamespace(
        problem=SimpleNamespace(springs=np.array([strain / change[0, 0]])),
        load=SimpleNamespace(gap0=np.array([gap]), slip0=np.zeros((1, 1))),
        motions=SimpleNamespace(kin=points),
        paired=np.array([True, True]),
    )
    response = Response(np.array([gap]), np.zeros((1, 1)), np.ones(1), np.zeros((1, 1)), np.zeros(2))
    assert _lost(one, SimpleNamespace(response=response), change, slow) == lost


@pytest.mark.parametrize(
    ("shares", "peaks"),
    [
        ([0.5, 0.7, 0.9], []),
        ([0.5, 0.9, 0.7, 0.6, 0.5], [0.9]),  # once, where it falls, not while it goes on falling
        ([0.9, 0.4, 0.3], []),  # from the beginning on: nothing before says that it was a peak
    ],
)
def test_a_peak_is_looked_for_where_the_share_begins_to_fall(shares, peaks):
    """Between a state that carries no more than the next, and one after it that carries less."""
    guess, gap, left, looked = None, np.zeros(1), list(shares), []

    def to(pull, start):
        return At(pull, left.pop(0), guess, gap) if left else None

    def peak(low, top, high):
        looked.append(top.share)
        assert low.share <= top.share > high.share
        return top

    way = SimpleNamespace(to=to, peak=peak, tolerance=1e-10, meets=lambda last, at: np.inf)
    found, carried = _go(way, At(0.0, 0.95 if shares[0] == 0.9 else 0.0, guess, gap))
    assert found is None and looked == peaks
    assert carried.share == max(*shares, 0.95 if shares[0] == 0.9 else 0.0)


@pytest.mark.parametrize(("top", "best"), [(0.1, 0.5), (0.9, 0.5), (0.5, 0.3), (0.85, 0.7)])
def test_a_peak_is_found_wherever_it_is_looked_for(top, best):
    """By halving the longer side, ten times: the share to four digits."""

    def to(pull, start=None):
        return At(pull, 1.0 - (pull - best) ** 2, None, np.zeros(1))

    assert to(top).share >= max(to(0.0).share, to(1.0).share)
    found = _peak(SimpleNamespace(to=to), to(0.0), to(top), to(1.0))
    assert found.share == pytest.approx(1.0, abs=1e-4)
