"""The dense contact problem, and its reduction to the points that matter."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import LinAlgError

from skfem_contact.linalg import cholesky, lu
from skfem_contact.problem import (
    Conditions,
    Load,
    PointsInSeries,
    PointSpace,
    Reduction,
    Resistance,
    definite_inverse,
)

m = 60  # of them 10 closed: enough for the reduction to be worth its while


@pytest.fixture
def space() -> PointSpace:
    rng = np.random.default_rng(1)
    A = rng.standard_normal((2 * m, 2 * m))
    return PointSpace(A @ A.T + m * np.eye(2 * m), np.arange(m), m + np.arange(m)[:, None])


def load(seed: int = 2) -> Load:
    rng = np.random.default_rng(seed)
    gap0, slip0 = rng.uniform(0.1, 1.0, m), rng.standard_normal((m, 1))
    return Load(rng.standard_normal(2 * m), gap0, slip0, np.zeros(0))


def conditions(closed: np.ndarray, *, mu: float = 0.3) -> Conditions:
    """The first half of the closed points sticks, the others slip."""
    rng = np.random.default_rng(3)
    mask, stick = np.zeros(m, dtype=bool), np.zeros(m, dtype=bool)
    mask[closed], stick[closed[: len(closed) // 2]] = True, True
    slides = (mask & ~stick)[:, None]
    return Conditions(
        mask,
        stick,
        rng.standard_normal((m, 1)),
        np.where(slides[:, None], 0.7, 0.0),
        np.where(slides, 0.1, 0.0),
        np.where(slides, mu, 0.0),
    )


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_reduction_changes_nothing(space: PointSpace, mu: float) -> None:
    """With far points eliminated, all gaps, slips and forces are those of the whole problem."""
    case, here = conditions(np.arange(20, 30), mu=mu), load()
    z, p, _ = space.unknowns(case, here)
    response = space.solve(case, here)
    assert space._reduction is not None
    assert space._reduction.keep.sum() < m / 2
    # the matrix is well conditioned: round-off
    assert_allclose(response.solution, z, rtol=0, atol=1e-13 * abs(z).max())
    force = np.where(case.closed, p[:m], 0.0)
    assert_allclose(response.normal_force, force, rtol=0, atol=1e-12 * abs(p).max())


def test_reduction_follows_the_zone(space: PointSpace) -> None:
    """Points that close outside the zone kept, and zones that shrink, are met by a new reduction."""
    for closed in (np.arange(10), np.arange(8), np.arange(40, 55), np.arange(3)):
        case, here = conditions(closed), load(len(closed))
        z, *_ = space.unknowns(case, here)
        assert_allclose(space.solve(case, here).solution, z, rtol=0, atol=1e-13 * abs(z).max())
        assert space._reduction is not None
        assert space._reduction.keep[closed].all()
    assert space._reduction.keep.sum() < 15


def test_one_reduction_serves_many_loads(space: PointSpace) -> None:
    """As long as the zone does not grow, nothing is eliminated again."""
    space.solve(conditions(np.arange(10)), load(1))
    first = space._reduction
    for seed in range(2, 6):
        case, here = conditions(np.arange(seed, 10)), load(seed)
        z, *_ = space.unknowns(case, here)
        assert_allclose(space.solve(case, here).solution, z, rtol=0, atol=1e-13 * abs(z).max())
    assert space._reduction is first


def test_far_points_that_hold_nothing(space: PointSpace) -> None:
    """Where the bodies move freely without the points kept, the whole problem is solved."""
    # one rigid motion along all gaps: S has it as its null space
    rigid = np.concatenate([np.ones(m), np.zeros(m)]) / np.sqrt(m)
    S = space.S - np.outer(space.S @ rigid, rigid @ space.S) / (rigid @ space.S @ rigid)
    floating = PointSpace(S, space.normal_rows, space.tangential_rows)
    few = np.zeros(m, dtype=bool)
    assert not Reduction(floating, few).good
    few[:2] = True
    assert Reduction(floating, few).good


def test_a_tangent_that_supports_hold_has_no_spring() -> None:
    """Of two tangents one may be held: springs act on the other, and on no other point's row."""
    rng = np.random.default_rng(6)
    n, rows = 3, np.array([[3, -1], [4, 6], [-1, 5]])
    A = rng.standard_normal((7, 7))
    S, spring = A @ A.T + np.eye(7), np.array([[2.0, 0.7], [0.7, 1.0]]) * np.ones((n, 1, 1))
    gap0, slip0, offset = rng.random(n), rng.random((n, 2)), rng.random((n, 2))
    coupling = 0.3 * rng.random((n, 2))
    force, every = rng.standard_normal(7), np.ones(n, dtype=bool)
    case = Conditions(every, ~every, 0 * offset, spring, offset, coupling)
    found = PointSpace(S, np.arange(n), rows).solve(case, Load(force, gap0, slip0, np.zeros(0)))
    # by hand: what can slip has friction offset + spring (slip0 + z) + coupling (S z - f), gaps are 0
    K, f = S.copy(), force.copy()
    for i, k in np.argwhere(rows >= 0):
        f[rows[i, k]] -= offset[i, k] + spring[i, k] @ slip0[i] - coupling[i, k] * force[i]
        K[rows[i, k]] += coupling[i, k] * S[i]
        for j in np.flatnonzero(rows[i] >= 0):
            K[rows[i, k], rows[i, j]] += spring[i, k, j]
    z = np.append(-gap0, np.linalg.solve(K[n:, n:], f[n:] + K[n:, :n] @ gap0))
    slip = slip0 + np.where(rows >= 0, z[rows], 0.0)
    assert_allclose(found.slip, slip, rtol=1e-10)
    assert_allclose(found.normal_force, S[:n] @ z - force[:n], rtol=1e-10)


@pytest.mark.parametrize("shape", [(7,), (7, 3)])
def test_dense_solves(shape: tuple[int, ...]) -> None:
    """LAPACK called directly solves what NumPy solves, and leaves its arguments as they were."""
    rng = np.random.default_rng(4)
    A, b = rng.standard_normal((7, 7)), rng.standard_normal(shape)
    S, given = A @ A.T + np.eye(7), b.copy()
    two = lu(A), cholesky(S)
    kept = [known.factors.copy() for known in two]
    for known, matrix, factors in zip(two, (A, S), kept, strict=True):
        # condition numbers below 1e3
        assert_allclose(known.solve(b), np.linalg.solve(matrix, b), rtol=1e-11)
        assert_array_equal(b, given)
        assert_array_equal(known.factors, factors)


def test_springs_in_series_take_the_place_of_others() -> None:
    """``W + 1/C`` whatever springs there were; at rest under the right forces they have no strain."""
    rng = np.random.default_rng(5)
    n, q = 4, 8
    A = rng.standard_normal((q, q))
    W, own, free = A @ A.T + np.eye(q), np.full(n, 0.3), rng.standard_normal(q)
    normal, tangential = np.arange(n), n + np.arange(n)[:, None]
    C = Resistance(1 / rng.random(n), 1 / rng.random(n))
    give = np.concatenate([1 / C.normal, 1 / C.tangential])
    closed, zero = np.ones(n, dtype=bool), np.zeros((n, 1))
    held = Conditions(closed, closed, zero, np.zeros((n, 1, 1)), zero, zero)
    p = -np.linalg.solve(W, free)  # what closes all and lets nothing slip
    for E in (None, own):
        S = np.linalg.inv(W + (0 if E is None else np.diag(np.tile(E, 2))))
        series = PointsInSeries(PointSpace(S, normal, tangential), C, E)
        assert_allclose(np.linalg.inv(series.points.S), W + np.diag(give), rtol=1e-9)
        load = Load(S @ free, np.zeros(n), zero, np.zeros(0))
        at = series.at_forces(load, p[:n], -p[n:, None])
        assert_allclose(series.solve(held, at).normal_force, p[:n], rtol=1e-9)
        strained = series.solve(held, series.at_forces(load, 0 * p[:n], 0 * zero))
        assert_allclose(strained.normal_force, -np.linalg.solve(W + np.diag(give), free)[:n], rtol=1e-9)


@pytest.mark.parametrize("count", [6, m])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_points_whose_gap_can_not_change_keep_their_friction(mu: float, count: int) -> None:
    """Supports may hold the gap of a point and not its slip: friction there is what its conditions say.

    No normal force follows from a row that is not there, and far from what is closed the point is no
    one that may be left out (`count` points are many enough for that, or few). By hand.
    """
    rng = np.random.default_rng(7)
    held = np.arange(count) % 3 == 2
    gaps = np.where(held, -1, np.cumsum(~held) - 1)
    q = int((~held).sum())
    slips = q + np.arange(count)[:, None]
    A = rng.standard_normal((q + count, q + count))
    S, force = A @ A.T + count * np.eye(q + count), rng.standard_normal(q + count)
    gap0 = np.where(held, 9.0, rng.uniform(0.1, 1.0, count))
    slip0, zero = rng.standard_normal((count, 1)), np.zeros((count, 1))
    closed = held | (np.arange(count) < 4)
    stick = np.arange(count) == count - 1  # one that supports hold, the last
    slides = (closed & ~stick)[:, None]
    case = Conditions(
        closed,
        stick,
        zero,
        np.zeros((count, 1, 1)),
        np.where(slides, 0.5, 0.0),
        np.where(slides, mu, 0.0),
    )
    found = PointSpace(S, gaps, slips).solve(case, Load(force, gap0, slip0, np.zeros(0)))
    # forces on slips are -(offset + mu lambda), where lambda is a row of S z - force
    K, f = S.copy(), force.copy()
    for i in np.flatnonzero(slides):
        f[slips[i, 0]] -= 0.5
        if not held[i]:
            f[slips[i, 0]] += mu * force[gaps[i]]
            K[slips[i, 0]] += mu * S[gaps[i]]
    known = np.append(gaps[closed & ~held], slips[stick, 0])
    z = np.zeros(q + count)
    z[known] = np.append(-gap0[closed & ~held], -slip0[stick, 0])
    free = np.setdiff1d(np.arange(q + count), known)
    z[free] = np.linalg.solve(K[np.ix_(free, free)], f[free] - K[np.ix_(free, known)] @ z[known])
    assert_allclose(found.slip, slip0 + z[slips], rtol=0, atol=1e-11)
    p = S @ z - force
    pressed = np.where(closed & ~held, p[gaps], 0.0)
    assert_allclose(found.normal_force, pressed, rtol=0, atol=1e-9)
    friction = np.where(slides, 0.5 + mu * pressed[:, None], np.where(stick[:, None], -p[slips], 0.0))
    assert_allclose(found.tangential_force, friction, rtol=0, atol=1e-9)


def test_springs_stiffer_than_the_bodies_have_the_forces_of_equilibrium() -> None:
    """A spring 1e14 times as stiff as its body: its length has two digits left, its force has all.

    A soft spring beside it has the force of its own length.
    """
    stiff, soft = 1e14, 1e-3
    rows = np.array([0, 1]), np.array([[2], [3]])
    S, zero = np.diag([1.0, 1.0, 2.0, 2.0]), np.zeros((2, 1))
    spring = np.array([[[stiff]], [[soft]]])
    slip0 = np.array([[1.0 / 3.0], [1.0 / 3.0]])
    every = np.ones(2, dtype=bool)
    case = Conditions(every, ~every, slip0, spring, zero, zero)  # at rest where they are
    load = Load(np.array([0.0, 0.0, 0.7, 0.7]), np.zeros(2), slip0, np.zeros(0))
    found = PointSpace(S, *rows).solve(case, load)
    for k, stiffness in enumerate((stiff, soft)):
        moved = 0.7 / (2.0 + stiffness)
        assert_allclose(found.tangential_force[k, 0], stiffness * moved, rtol=1e-12)


def test_what_is_left_out_has_to_be_stable(space: PointSpace) -> None:
    """Where points that carry nothing would buckle by themselves all are solved for, every time."""
    far = np.zeros(2 * m)
    far[50:m] = 1.0 / np.sqrt(m - 50)
    S = space.S - (far @ space.S @ far + 0.5) * np.outer(far, far)
    assert np.linalg.eigvalsh(S[50:m, 50:m])[0] < 0.0
    buckling = PointSpace(S, space.normal_rows, space.tangential_rows)
    for seed, closed in ((4, np.arange(10)), (5, np.arange(9)), (6, np.arange(8))):
        here = load(seed)
        here.gap0[50:] += 10.0  # these are the farthest
        case = conditions(closed)
        z, *_ = buckling.unknowns(case, here)
        found = buckling.solve(case, here).solution
        # condition numbers below 1e6
        assert_allclose(found, z, rtol=0, atol=1e-9 * abs(z).max())
        residual = S @ z - here.force
        assert_allclose(residual[10:m], 0.0, atol=1e-9 * abs(z).max())


def test_rows_that_depend_on_each_other_are_refused_unless_springs_part_them() -> None:
    """Pivots below 1e-3 cost the inverse six digits and more; seen through springs they are taken."""
    W = np.array([[1.0, 1.0 - 5e-9], [1.0 - 5e-9, 1.0]])
    with pytest.raises(LinAlgError, match="dependent"):
        definite_inverse(W.copy())
    inverse = definite_inverse(W.copy(), refuses=False)
    assert_allclose(inverse @ W, np.eye(2), atol=1e-6)  # the condition is 4e8
    apart = np.array([[1.0, 0.9], [0.9, 1.0]])
    assert_allclose(definite_inverse(apart.copy()), np.linalg.inv(apart), rtol=1e-12)
