"""Lemke's method against enumeration, and as starting values that are already the answer."""

from __future__ import annotations

from itertools import product

import internals
import numpy as np
import pytest
from quick_elasticity import linear_elasticity
from rectangles import rectangle
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.loops.lemke import lemke


def is_solution(M: np.ndarray, q: np.ndarray, z: np.ndarray) -> bool:
    """Whether both vectors are nonnegative and complementary, to round-off of the larger."""
    w = M @ z + q
    return bool(np.abs(np.minimum(w, z)).max() < 1e-9 * max(np.abs(z).max(), np.abs(q).max()))


def exists(M: np.ndarray, q: np.ndarray) -> bool:
    """Whether one of the 2^n complementary bases is feasible."""
    n = len(q)
    for basic in product((False, True), repeat=n):
        on = np.array(basic)
        A = np.where(on, -M, np.eye(n))
        if abs(np.linalg.det(A)) > 1e-12 and np.linalg.solve(A, q).min() >= 0:
            return True
    return n == 0


def coulomb(rng: np.random.Generator, m: int, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """A frictional contact problem with a random compliance between m points."""
    B = rng.standard_normal((2 * m, 2 * m))
    W = B @ B.T + 0.1 * np.eye(2 * m)
    W_nn, W_nt, W_tt = W[:m, :m], W[:m, m:], W[m:, m:]
    one, none = np.eye(m), np.zeros((m, m))
    M = np.block(
        [
            [W_nn, -W_nt, W_nt, none],
            [-W_nt.T, W_tt, -W_tt, one],
            [W_nt.T, -W_tt, W_tt, one],
            [mu * one, -one, -one, none],
        ]
    )
    gap, slip = rng.standard_normal((2, m))
    return M, np.concatenate([gap, -slip, slip, np.zeros(m)])


def test_positive_definite_problems_are_solved() -> None:
    """A positive definite matrix has one solution for every vector, and it is found."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        n = int(rng.integers(1, 30))
        B = rng.standard_normal((n, n))
        M, q = B @ B.T + 0.1 * np.eye(n), rng.standard_normal(n)
        z = lemke(M, q)
        assert z is not None
        assert is_solution(M, q, z)


@pytest.mark.parametrize("mu", [0.0, 0.3, 2.0, 50.0])
def test_friction_problems_are_solved_for_every_coefficient(mu: float) -> None:
    """The copositive matrix of Coulomb friction never ends on a ray, however large mu is."""
    rng = np.random.default_rng(1)
    for _ in range(60):
        M, q = coulomb(rng, int(rng.integers(1, 12)), mu)
        z = lemke(M, q)
        assert z is not None
        assert is_solution(M, q, z)


def test_a_problem_without_solution_ends_on_a_ray() -> None:
    """Where no complementary basis is feasible, there is no answer instead of a wrong one."""
    assert lemke(np.array([[-1.0]]), np.array([-1.0])) is None
    rng = np.random.default_rng(2)
    without = 0
    for _ in range(200):
        M, q = rng.standard_normal((3, 3)), rng.standard_normal(3)
        z = lemke(M, q)
        if z is not None:
            assert is_solution(M, q, z)
        without += not exists(M, q)
        assert z is None or exists(M, q)
    assert without > 10


def test_degenerate_problem_with_many_ties() -> None:
    """Points that all move alike and never touch: every ratio is tied, and the method still ends."""
    rng = np.random.default_rng(3)
    for m in (2, 5, 9):
        M, q = coulomb(rng, m, 2.0)
        q[:m] = 5.0
        q[m : 2 * m], q[2 * m : 3 * m] = 1.0, -1.0
        z = lemke(M, q)
        assert z is not None
        assert is_solution(M, q, z)
        assert np.abs(z[:m]).max() < 1e-9  # no contact force


def test_no_unknowns_and_no_violation() -> None:
    """Nothing to do is no error."""
    assert lemke(np.zeros((0, 0)), np.zeros(0)).shape == (0,)
    assert (lemke(np.eye(2), np.array([1.0, 0.0])) == 0).all()


def block(n: int = 8, side: int = 1) -> sc.Body:
    """A block pressed down and dragged along on one side of its top; or its mirror image."""
    basis = rectangle(np.linspace(0, 2, n + 1), np.linspace(0, 1, 4), order=2)
    away = lambda x: 0.02 * np.abs(x[0] - 1 + side)  # noqa: E731
    x = basis.project(lambda x: np.array([side * away(x), -0.015 + away(x)]))
    form = linear_elasticity(*lame_parameters(1.0, 0.3))
    return sc.Body(basis, form, D="top", x=x, name="block")


LAWS = [
    sc.Coulomb(0.4, stiffness=np.inf),
    sc.Coulomb(1.5, stiffness=np.inf),
    sc.Coulomb(0.4, stiffness=0.7),
    sc.Coulomb(0.4, cohesion=1e-4, stiffness=np.inf),
    sc.Coulomb(0.8, tau_max=2e-3, stiffness=np.inf),
    sc.Tresca(2e-3, stiffness=np.inf),
    None,
]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("law", LAWS)
def test_the_starting_values_are_the_answer(
    law: object, side: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Started by pivoting, the loop has nothing left to change, whatever the friction law and side."""
    body = block(side=side)
    contact = sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    usual = sc.ContactSolver(body, contact).solve()
    assert {0, 2} <= set(usual.status.tolist())  # open and sliding at least
    internals.replace(monkeypatch, "loops.STARTS", ("pivoting", "pivoting"))
    result = sc.ContactSolver(body, contact).solve()
    assert result.iterations == 1
    assert (result.status == usual.status).all()
    # both are exact: round-off of one dense solve
    assert np.abs(result.u - usual.u).max() < 1e-10 * np.abs(usual.u).max()


@pytest.mark.parametrize("law", [LAWS[0], LAWS[-1]])
def test_points_without_a_partner_are_left_out(law: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """The others start as they end: a block that overhangs its support, with friction or without."""
    basis = rectangle(np.linspace(-0.5, 1.6, 9), np.linspace(-1, 0, 4), order=2)
    low = sc.Body(basis, linear_elasticity(1.0, 1.0), D="bottom", name="low")
    body = block()

    def solve() -> sc.answers.ContactResult:
        contact = sc.Contact(body.surface("bottom"), low.surface("top"), friction=law)
        return sc.ContactSolver([low, body], contact).solve()

    usual = solve()
    assert not np.isfinite(usual.gap).all()
    internals.replace(monkeypatch, "loops.STARTS", ("pivoting", "pivoting"))
    assert solve().iterations == 1


@pytest.mark.parametrize("law", LAWS)
def test_the_proximal_point_is_the_last_start(law: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the plane as in space; by a chain of softer problems it comes to the same answer."""
    most, starts = internals.original("loops.MOST_POINTS"), internals.original("loops.possible_starts")
    for points in (most, most + 1):
        found = starts(points, "newton", False, True)
        assert found[-1] == "proximal" and ("pivoting" in found) == (points == most)
    body = block()
    contact = sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    usual = sc.ContactSolver(body, contact).solve()
    internals.replace(monkeypatch, "loops.STARTS", ("proximal", "proximal"))
    result = sc.ContactSolver(body, contact).solve()
    assert any(record.note == "springs in series" for record in result.trace)
    assert (result.status == usual.status).all()
    assert np.abs(result.u - usual.u).max() < 1e-10 * np.abs(usual.u).max()


def test_a_bond_starts_as_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Points that never open have friction and no gap to find, beside others that may open."""
    body = block()
    left = body.surface(lambda x: (x[1] < 1e-9) & (x[0] < 0.6))
    right = body.surface(lambda x: (x[1] < 1e-9) & (x[0] > 0.9))
    law, floor = sc.Tresca(0.015, stiffness=np.inf), sc.RigidPlane((0, 0), (0, 1))
    both = [
        sc.Contact(right, floor, friction=law, separation=False),
        sc.Contact(left, floor, friction=sc.Coulomb(0.4, stiffness=np.inf)),
    ]
    usual = sc.ContactSolver(body, both).solve()
    assert {0, 1, 2} == {int(k) for values in usual for k in values.status}
    assert usual[0].pressure.min() < 0 < usual[1].pressure.max()
    internals.replace(monkeypatch, "loops.STARTS", ("pivoting", "pivoting"))
    result = sc.ContactSolver(body, both).solve()
    assert result.iterations == 1
    assert np.abs(result.u - usual.u).max() < 1e-10 * np.abs(usual.u).max()


def test_a_history_starts_from_the_state_of_friction(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pivoting knows the friction of the step before: a reversed load ends where the loop ends."""
    body = block()
    contact = sc.Contact(
        body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.4)
    )
    way = (1.0, 0.6, 0.9)
    usual = list(sc.ContactSolver(body, contact).history(way))
    internals.replace(monkeypatch, "loops.STARTS", ("pivoting", "pivoting"))
    for a, b in zip(usual, sc.ContactSolver(body, contact).history(way), strict=True):
        assert np.abs(a.u - b.u).max() < 1e-10 * np.abs(a.u).max()
        assert b.iterations <= a.iterations


def test_what_the_method_does_not_cover_is_declined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where pivoting ends on a ray: no starting values, and the loop goes on with others."""
    answers = []
    own = internals.original("loops.lemke_guess")
    internals.replace(monkeypatch, "loops.STARTS", ("pivoting", "pivoting"))
    monkeypatch.setitem(own.__globals__, "lemke", lambda M, q: None)

    def guess(*given: object) -> object:
        answers.append(own(*given))
        return answers[-1]

    internals.replace(monkeypatch, "loops.lemke_guess", guess)
    body = block()
    contact = sc.Contact(
        body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.4)
    )
    assert sc.ContactSolver(body, contact).solve().converged
    assert answers == [None]
