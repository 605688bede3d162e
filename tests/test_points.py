"""The dense contact problem, and its reduction to the points that matter."""

from __future__ import annotations

from dataclasses import replace

import internals
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.linalg import LinAlgError
from scipy.sparse import csr_matrix

from skfem_contact.linalg import cholesky, definite_inverse, lu
from skfem_contact.problem import (
    Compliance,
    Conditions,
    Load,
    PointSpace,
    Zone,
    Zones,
    independent,
)

indefinite_inverse = internals.beside(definite_inverse, "indefinite_inverse")

m = 60  # of them 10 closed: enough for the reduction to be worth its while


@pytest.fixture
def space() -> PointSpace:
    rng = np.random.default_rng(1)
    A = rng.standard_normal((2 * m, 2 * m))
    return PointSpace(A @ A.T + m * np.eye(2 * m), np.arange(m), m + np.arange(m)[:, None])


def zones_of(space: PointSpace, stable: bool = True) -> Zones:
    """The same by its compliance, of which a part is inverted at a time."""
    W = np.linalg.inv(space.S)
    rows = space.normal_rows, space.tangential_rows
    return Zones(Compliance(0.5 * (W + W.T), *rows, len(W), stable))


def known_by_motion(here: Load, space: PointSpace) -> Load:
    """A load by what gaps and slips do where contact carries nothing."""
    return replace(here, force=np.zeros(0), moved=np.linalg.solve(space.S, here.force))


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
    case, here, zones = conditions(np.arange(20, 30), mu=mu), load(), zones_of(space)
    z, p, _ = space.unknowns(case, here)
    response = zones.solve(case, known_by_motion(here, space))
    assert zones._part is not None
    assert zones._part.keep.sum() < m / 2
    # the matrix is well conditioned: round-off
    assert_allclose(response.solution, z, rtol=0, atol=1e-13 * abs(z).max())
    force = np.where(case.closed, p[:m], 0.0)
    assert_allclose(response.normal_force, force, rtol=0, atol=1e-12 * abs(p).max())


def test_reduction_follows_the_zone(space: PointSpace) -> None:
    """Points that close outside the zone kept, and zones that shrink, are met by a new reduction."""
    zones = zones_of(space)
    for closed in (np.arange(10), np.arange(8), np.arange(40, 55), np.arange(3)):
        case, here = conditions(closed), load(len(closed))
        z, *_ = space.unknowns(case, here)
        found = zones.solve(case, known_by_motion(here, space)).solution
        assert_allclose(found, z, rtol=0, atol=1e-13 * abs(z).max())
        assert zones._part is not None
        assert zones._part.keep[closed].all()
    assert zones._part.keep.sum() < 15


def test_one_reduction_serves_many_loads(space: PointSpace) -> None:
    """As long as the zone does not grow, nothing is inverted again until open points cost as much."""
    zones, draws = zones_of(space), []
    few = [conditions(np.arange(k, k + 5)) for k in (4, 5)]  # 8 more than the 10 are in it at first
    for seed in range(40):
        case, here = few[seed % 2] if seed else conditions(np.arange(10)), load(seed)
        z, *_ = space.unknowns(case, here)
        found = zones.solve(case, known_by_motion(here, space)).solution
        assert_allclose(found, z, rtol=0, atol=1e-13 * abs(z).max())
        if zones._part not in draws:
            draws.append(zones._part)
    # 13 open points, of which a new zone has 8, cost more than the inverse of 13 at the second time
    assert [zone.count for zone in draws] == [18, 13]


def test_points_without_rows_are_in_no_zone(space: PointSpace) -> None:
    """Half of the points have no partner: the others have a zone of their own size, not the whole."""
    rows = (
        np.where(np.arange(m) < 30, np.arange(m), -1),
        np.where(np.arange(m) < 30, 30 + np.arange(m), -1),
    )
    few = PointSpace(space.S[:60, :60].copy(), rows[0], rows[1][:, None])
    case, here, zones = conditions(np.arange(10)), load(), zones_of(few)
    here = replace(here, force=here.force[:60])
    z, *_ = few.unknowns(case, here)
    found = zones.solve(case, known_by_motion(here, few))
    assert_allclose(found.solution, z, rtol=0, atol=1e-13 * abs(z).max())
    assert_array_equal(found.gap[30:], here.gap0[30:])
    assert zones._part is not None
    assert zones._part.count == zones._part.keep.sum() == 18


def test_slips_of_prescribed_gaps_are_in_every_zone(space: PointSpace) -> None:
    """A point whose gap supports prescribe, and whose slip is free, may rub at any time."""
    far = PointSpace(space.S[1:, 1:].copy(), np.arange(m) - 1, m - 1 + np.arange(m)[:, None])
    case, here, zones = conditions(np.arange(20, 30)), load(), zones_of(far)
    here = replace(here, force=here.force[1:])
    z, *_ = far.unknowns(case, here)
    assert_allclose(zones.solve(case, known_by_motion(here, far)).solution, z, rtol=0, atol=1e-13)
    assert zones._part is not None and zones._part.keep[0] and zones._part.count == 18


def test_a_tenth_of_many_closed_points_is_spare() -> None:
    """Of 100 closed points on springs of their own 110 are in the zone, the nearest ones."""
    n, none = 200, np.zeros((200, 0))
    zones = Zones(Compliance(np.eye(n), np.arange(n), np.full((n, 0), -1), n))
    closed = np.arange(n) < 100
    free = Conditions(closed, closed, none, np.zeros((n, 0, 0)), none, none)
    zones.solve(free, Load(np.zeros(0), np.arange(n) - 100.0, none, np.zeros(0), (), np.zeros(n)))
    assert zones._part is not None
    assert_array_equal(zones._part.keep, np.arange(n) < 110)


def test_far_points_that_hold_nothing(space: PointSpace) -> None:
    """Where the bodies move freely without the points kept, the whole problem is solved."""
    # K of gaps, slips and an anchor has one rigid motion, along all gaps and the anchor
    q = 2 * m
    rigid = np.concatenate([np.ones(m), np.zeros(m), np.ones(1)])
    K = np.zeros((q + 1, q + 1))
    K[:q, :q], K[q, q] = space.S, m
    K -= np.outer(K @ rigid, rigid @ K) / (rigid @ K @ rigid)
    A = K.copy()
    A[q, q] += 1.0  # a spring holds the anchor
    W = np.linalg.inv(A)
    whole = Compliance(0.5 * (W + W.T), space.normal_rows, space.tangential_rows, q)
    S = K[:q, :q] - np.outer(K[:q, q], K[q, :q]) / K[q, q]
    assert_allclose(whole.whole.space.S, S, rtol=0, atol=1e-12 * abs(S).max())
    few = np.zeros(m, dtype=bool)
    assert not Zone(whole, few).good
    few[:2] = True
    assert Zone(whole, few).good


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
    """``W + 1/C`` whatever springs there were before."""
    rng = np.random.default_rng(5)
    n, q = 4, 8
    A = rng.standard_normal((q, q))
    W, own, give = A @ A.T + np.eye(q), np.full(q, 0.3), rng.random(q)
    alone = Compliance(W, np.arange(n), n + np.arange(n)[:, None], q)
    for series in (
        alone.with_springs(give),
        alone.with_springs(own).with_springs(give - own),
    ):
        assert_allclose(np.linalg.inv(series.whole.space.S), W + np.diag(give), rtol=1e-9)


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
    S = 0.5 * (S + S.T)
    assert np.linalg.eigvalsh(S[50:m, 50:m])[0] < 0.0
    buckling = PointSpace(S, space.normal_rows, space.tangential_rows)
    zones = zones_of(buckling, stable=False)
    for seed, closed in ((4, np.arange(10)), (5, np.arange(9)), (6, np.arange(8))):
        here = load(seed)
        here.gap0[50:] += 10.0  # these are the farthest
        case = conditions(closed)
        z, *_ = buckling.unknowns(case, here)
        found = zones.solve(case, known_by_motion(here, buckling)).solution
        assert zones._part is None
        # condition numbers below 1e6
        assert_allclose(found, z, rtol=0, atol=1e-9 * abs(z).max())
        residual = S @ z - here.force
        assert_allclose(residual[10:m], 0.0, atol=1e-9 * abs(z).max())


def test_rows_are_independent_where_a_sparse_bound_shows_it() -> None:
    """By ``W >= G diag(least) G'``; rows that depend on each other are never taken for others."""
    soft = np.array([1.0, 2.0, 3.0])
    for last, found in (([0.0, 1.0, 1.0], True), ([1.0, 1.0, 1e-9], False)):
        G = csr_matrix([[1.0, 1.0, 0.0], last])
        W = (G @ np.diag(soft)) @ G.T.toarray()
        assert independent(G, 0.5 * soft, W.diagonal()) is found


def test_rows_that_depend_on_each_other_are_refused_unless_springs_part_them() -> None:
    """Pivots below 1e-3 cost the inverse six digits and more; seen through springs they are taken."""
    W = np.array([[1.0, 1.0 - 5e-9], [1.0 - 5e-9, 1.0]])
    with pytest.raises(LinAlgError, match="dependent"):
        definite_inverse(W.copy(), 1e-3)
    inverse = definite_inverse(W.copy())
    assert_allclose(inverse @ W, np.eye(2), atol=1e-6)  # the condition is 4e8
    apart = np.array([[1.0, 0.9], [0.9, 1.0]])
    assert_allclose(definite_inverse(apart.copy()), np.linalg.inv(apart), rtol=1e-12)


@pytest.mark.parametrize("spoiled", [0.0, np.inf, np.nan])
def test_a_row_without_a_finite_flexibility_is_refused(spoiled: float) -> None:
    """Bodies that are not stable have one of either sign, and no inverse of a row of zeros or NaN."""
    W = np.diag([1.0, -2.0])
    assert_allclose(indefinite_inverse(W.copy()), np.diag([1.0, -0.5]), rtol=1e-12)
    W[1, 1] = spoiled
    with pytest.raises(LinAlgError, match="finite flexibility"):
        indefinite_inverse(W)
