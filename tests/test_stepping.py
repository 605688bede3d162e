"""Load histories: what a step remembers, how it is cut, and what a guess may not do."""

from __future__ import annotations

from dataclasses import replace

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from rectangles import block
from statuses import SLIP, STICK

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.history import Bisection, grown
from skfem_contact.loops import as_guess


def scene(sliding="small", **settings):
    """A block on a floor, held and moved at its top, with friction.

    Steps are halved only where no loading machine can tell how far they come: with finite sliding.
    """
    body = block(y=(0.0, 0.5), n=(6, 3), D="top", move=(0.01, -0.01))
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="joint")
    contact = replace(contact, sliding=sliding)
    return sc.ContactSolver(body, contact, **settings), body


def failing(monkeypatch, refuses):
    """Make every attempt fail for which `refuses(number of the attempt)` says so.

    The proximal point, which iterates by itself, is none of them.
    """
    real, count = internals.original("loops.drive"), [0]
    starts = [start for start in internals.original("loops.STARTS") if start != "proximal"]
    internals.replace(monkeypatch, "loops.STARTS", starts)

    def drive(*arguments):
        outcome = real(*arguments)
        count[0] += 1
        if refuses(count[0]):
            return replace(outcome, converged=False, message="refused by the test")
        return outcome

    internals.replace(monkeypatch, "loops.drive", drive)
    return count


def test_a_failed_step_is_cut_and_recovered(monkeypatch):
    """Half a step and then the rest end where the whole step would, with the dissipation of both."""
    solver, _ = scene("finite")
    halves = list(solver.history([0.5, 1.0]))
    # from nothing known, there is no warm start, and the proximal point is none of the loop's
    attempts = len(solver._answering.stepper.starts) - 2
    failing(monkeypatch, lambda count: count <= attempts)
    [result] = list(scene("finite")[0].history([1.0]))
    assert result.converged and "step cut once" in result.message
    assert_allclose(result.u, halves[-1].u, rtol=0, atol=1e-14)
    assert_allclose(result.dissipation, sum(r.dissipation for r in halves), rtol=1e-12)
    assert result.factor == 1.0


def test_substeps_grow_after_a_success(monkeypatch):
    """A step that was cut to an eighth goes on in steps of 1, 2, 4 and what is left of eight."""
    solver, _ = scene("finite")
    attempts = len(solver._answering.stepper.starts) - 2
    # the whole, the half and the quarter fail from every start, cold or warm
    failing(monkeypatch, lambda count: count <= 3 * attempts)
    [result] = list(scene("finite")[0].history([1.0]))
    assert "step cut 3 times, substep 4" in result.message
    assert [grown(0.1, travel) for travel in (0.0, 0.4, 0.95, 1.9)] == pytest.approx(
        [0.2, 0.2, 0.1, 0.05]
    )


def test_cutting_ends(monkeypatch):
    """A step that fails however small is given up after max_cuts, and says how often it was cut."""
    count = failing(monkeypatch, lambda count: True)
    solver, _ = scene("finite", options=sc.Options(max_cuts=2))
    with pytest.raises(sc.errors.NotConverged, match=r"refused by the test, step cut 2 times"):
        solver.solve()
    assert count[0] <= 3 * len(internals.original("loops.STARTS"))


def test_points_that_snap_end_a_step(monkeypatch):
    """Where points slide too far from some place on, however small the step, parts of it are not cut to
    the round-off of their sum: every part up to there succeeds and begins the count of cuts anew."""
    real, snap, shares = internals.original("history.attempted"), 0.6875, []

    def attempted(by, part, start):
        attempt = real(by, part, start)
        shares.append(part.share)
        done = part.target.x[np.argmax(np.abs(part.target.x))] / 0.01
        return attempt if abs(done) < snap else replace(attempt, failure="snaps", travel=2.24)

    internals.replace(monkeypatch, "history.attempted", attempted)
    with pytest.raises(sc.errors.NotConverged, match="snaps"):
        list(scene()[0].history([1.0]))
    assert 1e-10 < min(shares) < 2e-9 and len(shares) < 100


def test_results_already_yielded_are_kept(monkeypatch):
    """A history that fails half-way has yielded the steps before."""
    solver, _ = scene(options=sc.Options(max_cuts=0))
    first = list(solver.history([0.3, 0.6]))
    count = failing(monkeypatch, lambda count: count > 2)
    run, seen = scene(options=sc.Options(max_cuts=0))[0].history([0.3, 0.6, 0.9]), []
    with pytest.raises(sc.errors.NotConverged):
        for result in run:
            seen.append(result)
    assert len(seen) == 2 and count[0] >= 3
    assert_allclose(seen[1].u, first[1].u, rtol=0, atol=1e-15)


def test_the_callback_stops():
    """StopIteration in the callback ends the solve where it stands; other exceptions pass."""
    solver, _ = scene()
    records = []

    def stop(record):
        records.append(record)
        raise StopIteration

    result = solver.solve(callback=stop, throw=False)
    assert not result.converged and "stopped by the callback" in result.message
    assert len(records) == 1 == result.iterations
    with pytest.raises(sc.errors.NotConverged, match="stopped by the callback"):
        solver.solve(callback=stop)

    def fail(record):
        raise KeyError(record.iteration)

    with pytest.raises(KeyError):
        solver.solve(callback=fail)


def test_a_guess_is_never_part_of_the_answer():
    """From any other state as a guess, the answer is that without one."""
    solver, body = scene()
    plain = solver.solve()
    others = [solver.solve(x=scale * body.x) for scale in (-1.0, 0.1, 3.0)]
    pushed = solver.solve(x=np.where(body.dof_component == 0, -5 * body.x, body.x))
    for guess in (*others, pushed, plain):
        result = solver.solve(guess=guess)
        assert_allclose(result.u, plain.u, rtol=0, atol=1e-13)
        assert_array_equal(result.status, plain.status)
        assert_allclose(result.dissipation, plain.dissipation, rtol=1e-10)


def test_a_start_is_part_of_the_answer():
    """The state that a step starts from is remembered by friction."""
    solver, body = scene()
    pushed = solver.solve(x=np.where(body.dof_component == 0, 3 * body.x, body.x))
    after = solver.solve(start=pushed)
    assert np.abs(after.u - solver.solve().u).max() > 1e-3 * np.abs(after.u).max()


def test_steps_keep_what_they_do_not_name():
    """A dict replaces what it names; loads, displacements, interference and motion else stay."""
    solver, body = scene()
    f = np.zeros(body.n)
    f[body.basis.get_dofs("left").all("u^1")] = 1e-4
    steps = [
        {"x": {"block": 1.0}},
        {"f": {"block": f}},
        {"interference": {"joint": 1e-3}},
        {"motion": {"floor": (0.0, -1e-3)}},
        {"x": {"block": 0.5}},
    ]
    cases = [answer_of(result).case for result in solver.history(steps)]
    assert_array_equal(cases[0].x, body.x)
    assert_array_equal(cases[1].x, body.x)
    for case in cases[1:]:
        assert_array_equal(case.f, f)
    assert_array_equal(cases[2].gap0, -1e-3)
    # the floor falls by as much as the interference was
    assert_allclose(cases[3].gap0, 0.0, atol=1e-18)
    assert_allclose(cases[4].gap0, 0.0, atol=1e-18)
    assert_array_equal(cases[4].x, 0.5 * body.x)
    # a number is a factor on the bodies' own f and x again, and leaves the rest
    [*_, last] = solver.history([*steps, 0.7])
    assert_allclose(answer_of(last).case.x, 0.7 * body.x)
    assert not answer_of(last).case.f.any() and last.factor == 0.7


def test_histories_start_anew():
    """Two histories of the same solver know nothing of one another."""
    solver, _ = scene()
    first, again = (list(solver.history([0.4, 1.0, 0.2])) for _ in range(2))
    for a, b in zip(first, again, strict=True):
        assert_allclose(a.u, b.u, rtol=0, atol=1e-15)


def test_loads_may_come_in_every_form():
    """A dict by name, a factor by name and a stacked vector are the same load."""
    solver, body = scene()
    x = 0.5 * body.x
    answers = [solver.solve(x=given).u for given in (x, {"block": x}, {"block": 0.5})]
    for u in answers[1:]:
        assert_allclose(u, answers[0], rtol=0, atol=1e-15)


def test_starting_values_from_a_state():
    """Slipping points without friction force start as sticking: they have no direction."""
    solver, _ = scene()
    state = answer_of(solver.solve()).local
    bare = replace(state, tangential_force=np.zeros_like(state.tangential_force))
    assert SLIP in state.status
    guess = as_guess(bare)
    assert SLIP not in guess.status and not guess.direction.any()
    assert_array_equal(guess.status[state.status == SLIP], STICK)
    size = np.linalg.norm(as_guess(state).direction, axis=1)
    assert_allclose(size[state.status == SLIP], 1.0)


def pressed(**settings):
    """A frictionless block, nu = 0: an overlap d of its height h presses with E d / h."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 4), np.linspace(0, 0.5, 3)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    x = basis.project(lambda x: np.stack([0 * x[0], -0.01 + 0 * x[0]]))
    body = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", x=x, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, name="joint", **settings))


def test_an_interference_of_a_step_replaces_that_of_the_contact():
    """Steps give the whole interference, and the contact has its own again where none is named."""
    solver = pressed(interference=4e-3)
    steps = [1.0, {"interference": {"joint": 1e-3}}, {"x": {"block": 0.5}}]
    overlaps = [0.014, 0.011, 0.006]
    for result, overlap in zip(solver.history(steps), overlaps, strict=True):
        assert_allclose(result.pressure, overlap / 0.5, rtol=1e-12)
    field = {"interference": {"joint": lambda x: 2e-3 + 0 * x[0]}}
    [result] = solver.history([field])
    assert_allclose(result.pressure, 0.012 / 0.5, rtol=1e-12)


def test_a_number_leaves_the_interference_of_a_step_as_it_is():
    """A factor is on loads and prescribed displacements alone, whichever interference there is."""
    steps = [{"interference": {"joint": 1e-3}}, 0.5, {"interference": {"joint": 2e-3}}, 1.0]
    overlaps = [0.011, 0.006, 0.007, 0.012]
    for result, overlap in zip(pressed(interference=4e-3).history(steps), overlaps, strict=True):
        assert_allclose(result.pressure, overlap / 0.5, rtol=1e-12)


def test_a_number_leaves_obstacles_where_they_are():
    """A factor is on loads and prescribed displacements; a floor that has risen stays where it is."""
    steps = [{"motion": {"floor": (0, 2e-3)}}, 0.5, {"motion": {"floor": (0, 0)}}, 1.0]
    overlaps = [0.012, 0.007, 0.005, 0.01]
    for result, overlap in zip(pressed().history(steps), overlaps, strict=True):
        assert_allclose(result.pressure, overlap / 0.5, rtol=1e-12)


def test_parts_of_a_step() -> None:
    """Halved three times at most; what distances tell does not count; then twice as much each time."""
    parts = Bisection(most=3, smallest=0.5**3)
    for share in (0.5, 0.25, 0.125):
        assert not parts.spent
        parts.cut(travel=0.0)
        assert parts.share == share
    assert parts.spent
    parts.go_on(travel=0.0)
    assert (parts.done, parts.share, parts.fails) == (0.125, 0.25, 0)
    parts.go_on(travel=10.0)  # ten times too far: the next goes over the tenth of it
    assert parts.done == 0.375 and parts.share == pytest.approx(0.25 * 0.095)
    far = Bisection(most=3, smallest=0.5**3)
    far.cut(travel=100.0)
    assert far.share == pytest.approx(0.0095) and not far.spent
    last = Bisection(most=3, smallest=0.5**3, done=0.75, share=0.5)
    assert last.aim == 1.0
