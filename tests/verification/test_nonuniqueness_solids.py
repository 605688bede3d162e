"""Other answers in three dimensions: all of them for one point, determinants, and what is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters
from statuses import OPEN, SLIP, STICK

import skfem_contact as sc
from skfem_contact.answers import critical_friction, orientation, turning_springs, unique_up_to
from skfem_contact.conditions import radial_return
from skfem_contact.problem import PointSpace

EXACT = np.inf


def random_space(rng, m, coupling=1.0):
    """A positive definite matrix of gaps and slips; rows in any order."""
    A = rng.standard_normal((3 * m, 3 * m))
    S = A @ A.T + 0.3 * m * np.eye(3 * m)
    rows = rng.permutation(3 * m)
    n, t = rows[:m], rows[m:].reshape(m, 2)
    S[np.ix_(n, t.ravel())] *= coupling
    S[np.ix_(t.ravel(), n)] *= coupling
    # what was scaled down may leave a matrix less definite, never more: shown by its eigenvalues
    assert np.linalg.eigvalsh(S)[0] > 0
    return PointSpace(S, n, t)


def all_answers(space, h, mu, count=1000):
    """Every ``(gap, slip, normal force, friction)`` of one point under a load ``S z = h + p``.

    Slip has one unknown, the angle of friction: its size follows, and the equation across is scanned.
    """
    n, t = space.normal_rows[0], space.tangential_rows[0]
    S, found = space.S, []
    z = np.linalg.solve(S, h)
    if z[n] > 0:
        found.append((z[n], z[t], 0.0, np.zeros(2)))
    K, k = S[np.ix_(t, t)], S[t, n]
    lam, tau = -h[n], h[t]
    if lam > 0 and np.linalg.norm(tau) < mu * lam:
        found.append((0.0, np.zeros(2), lam, tau))
    # K s + mu d (k . s - h_n) = h_t with s = r d

    def across(angle):
        d = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        side = np.stack([-d[..., 1], d[..., 0]], axis=-1)
        # r (d' K d + mu k . d) = h_t . d + mu h_n, and the equation across d, times what r is over
        over = np.einsum("...i,ij,...j->...", d, K, d) + mu * d @ k
        r = d @ h[t] + mu * h[n]
        return np.einsum("...i,ij,...j->...", side, K, d) * r - (side @ h[t]) * over, r, over, d

    angles = np.linspace(0, 2 * np.pi, count + 1)
    value = across(angles)[0]
    for i in np.flatnonzero(value[:-1] * value[1:] < 0):
        low, high = angles[i], angles[i + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if across(low)[0] * across(middle)[0] > 0 else (low, middle)
        _, r, over, d = across(low)
        if r * over > 0 and (lam := r / over * (k @ d) - h[n]) > 0:
            found.append((0.0, r / over * d, lam, mu * lam * d))
    return found


def index_of(space, status, tau, slip, mu, G):
    springs = turning_springs(tau, slip, G, space)
    return orientation(space, status, tau, mu, G, springs)


def status_of(answer):
    _, slip, lam, _ = answer
    return OPEN if lam == 0 else SLIP if np.linalg.norm(slip) > 0 else STICK


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 30), marks=pytest.mark.slow)])
def test_all_answers_of_one_point(seeds):
    """Below the critical coefficient one, above it loads with three; indices add up to one."""
    several = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        space = random_space(rng, 1)
        inf = np.full(1, EXACT)
        critical = [
            critical_friction(space, np.array([status]), np.ones(1), inf)[0] for status in (OPEN, STICK)
        ]
        assert critical[0] == pytest.approx(critical[1], rel=1e-9)
        shown = unique_up_to(space, np.ones(1), inf, np.zeros(1, dtype=bool))
        assert 0.3 * critical[0] < shown < critical[0]
        n, t = space.normal_rows[0], space.tangential_rows[0]
        for mu in (0.98 * critical[0], 1.05 * critical[0], 3 * critical[0]):
            counts = set()
            for _ in range(3):
                # a load inside the piece where the determinant changes first
                K, k = space.S[np.ix_(t, t)], space.S[t, n]
                angle = np.linspace(0, np.pi, 721)
                d = np.column_stack([np.cos(angle), np.sin(angle)])
                ratio = np.einsum("qi,ij,qj->q", d, K, d) / np.abs(d @ k)
                first = d[np.argmin(ratio)]
                over = np.linalg.solve(K, k)
                if 1 / np.linalg.norm(over) < ratio.min():
                    first, size = over / np.linalg.norm(over), 100.0
                else:
                    size = 0.01
                first = -np.sign(first @ k) * first
                z, lam = np.zeros(3), rng.uniform(0.5, 2.0)
                z[t] = size * lam / np.diag(K).mean() * (first + 1e-3 * rng.standard_normal(2))
                d = z[t] / np.linalg.norm(z[t])
                p = np.zeros(3)
                p[n], p[t] = lam, -mu * lam * d
                for h in (space.S @ z - p, rng.standard_normal(3)):
                    known = all_answers(space, h, mu)
                    signs = [
                        index_of(
                            space, np.array([status_of(a)]), a[3][None], a[1][None], np.array([mu]), inf
                        )
                        for a in known
                    ]
                    assert sum(signs) == 1
                    counts.add(len(known))
            assert counts == {1} if mu < critical[0] else counts >= {3}
            several += 3 in counts
    assert several == 2 * len(seeds)


def test_a_point_that_nothing_else_holds():
    """Without coupling, or without stiffness along its slips, no friction is critical."""
    for tangential in ((0.0, 0.0), (1e-13, 0.0), (1.0, 0.0), (1.0, 2.0)):
        space = PointSpace(np.diag([1.0, *tangential]), np.array([0]), np.array([[1, 2]]))
        found = critical_friction(space, np.array([STICK]), np.ones(1), np.full(1, EXACT))
        assert found.tolist() == [np.inf]


def residual(space, p, h, mu, last, G, rho):
    """Alart and Curnier's, written with forces as unknowns: gaps and slips follow from them."""
    z = np.linalg.solve(space.S, h + p)
    n, t = space.normal_rows, space.tangential_rows
    a = np.maximum(p[n] - rho * z[n], 0.0)
    soft = np.isfinite(G)
    trial = np.where(soft[:, None], np.where(soft, G, 0.0)[:, None] * z[t] + last, rho * z[t] - p[t])
    length = np.linalg.norm(trial, axis=1)
    tau = trial * np.minimum(1.0, mu * a / np.where(length > 0, length, 1.0))[:, None]
    out = np.zeros_like(p)
    out[n], out[t] = p[n] - a, p[t] + tau
    return out


@pytest.mark.parametrize("stiffness", [EXACT, 0.7])
def test_index_is_the_sign_of_a_determinant(stiffness):
    """Of Alart and Curnier's residual, differentiated numerically, at random answers."""
    seen = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        m = 1 + seed % 4
        space = random_space(rng, m)
        S, n, t = space.S, space.normal_rows, space.tangential_rows
        G = np.full(m, stiffness * np.diag(S).mean() if np.isfinite(stiffness) else np.inf)
        mu = rng.choice([0.3, 2.0, 8.0]) * np.ones(m)
        status = rng.integers(0, 3, m)
        z, p = np.zeros(3 * m), np.zeros(3 * m)
        z[n] = np.where(status == OPEN, rng.uniform(0.5, 2.0, m), 0.0)
        p[n] = np.where(status == OPEN, 0.0, rng.uniform(0.5, 2.0, m) * np.diag(S).mean())
        plastic = np.where((status == STICK)[:, None], 0.0, rng.standard_normal((m, 2)))
        d = rng.standard_normal((m, 2))
        way = np.where((status == SLIP)[:, None], plastic, d)
        d = way / np.linalg.norm(way, axis=1)[:, None]
        share = np.select([status == SLIP, status == STICK], [1.0, 0.6], 0.0)
        tau = (share * mu * p[n])[:, None] * d
        last = tau.copy() if np.isfinite(stiffness) else np.zeros((m, 2))
        p[t] = -tau
        z[t] = plastic
        h = S @ z - p
        rho = np.diag(S).mean()
        assert np.abs(residual(space, p, h, mu, last, G, rho)).max() < 1e-9 * np.abs(h).max()
        eps = 1e-6 * rho
        J = np.column_stack(
            [
                residual(space, p + eps * e, h, mu, last, G, rho)
                - residual(space, p - eps * e, h, mu, last, G, rho)
                for e in np.eye(3 * m)
            ]
        )
        expected = int(np.linalg.slogdet(J / (2 * eps))[0])
        assert index_of(space, status, tau, plastic, mu, G) == expected
        seen.append(expected)
    assert {-1, 1} == set(seen) and seen.count(-1) > 5


def test_what_is_shown_holds():
    """Up to the coefficient shown every index is 1, far above it some is -1."""
    worst = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        m = 6
        space = random_space(rng, m, coupling=0.5)
        inf, free = np.full(m, EXACT), np.zeros(m, dtype=bool)
        shape = rng.uniform(0.2, 1.0, m)
        shape[0] = 0.0
        shown = unique_up_to(space, shape, inf, free)
        assert shown > 0
        for factor in (1.0, 40.0):
            mu, signs = factor * shown * shape, []
            for _ in range(150):
                status = rng.integers(0, 3, m)
                force = 10 ** rng.uniform(-2, 2, m) * np.diag(space.S).mean()
                slip = rng.standard_normal((m, 2))
                tau = (mu * force / np.linalg.norm(slip, axis=1))[:, None] * slip
                signs.append(index_of(space, status, tau, slip, mu, inf))
            assert min(signs) == 1 or factor > 1
            worst.append(min(signs))
        tied = np.arange(m) < 2
        assert unique_up_to(space, shape, inf, tied) > shown  # fewer points do less together
        assert unique_up_to(space, shape, np.full(m, 2.0), free) > shown
    assert worst[1::2].count(-1) >= 3


def test_unlike_points_are_shown_as_far_as_each_alone():
    """Nothing couples two points, one of them much stiffer: critical is the coefficient of each, 6."""
    one, shown = np.array([[2.0, 1.0], [1.0, 3.0]]), []
    for stiffer in (1.0, 1e4):
        S = np.kron(np.diag([1.0, stiffer]), one)
        space = PointSpace(S, np.array([0, 2]), np.array([[1], [3]]))
        inf, free = np.full(2, EXACT), np.zeros(2, dtype=bool)
        shown.append(unique_up_to(space, np.full(2, 0.5), inf, free))
    assert 5.7 < shown[0] < 6 and shown[1] == pytest.approx(shown[0], rel=1e-3)


def tetrahedron(mu, loop="newton", **options):
    """One element, clamped but for a corner on a plane; and the stiffness of that corner."""
    p = np.array([[0.0, 1.2, -0.6, -0.3], [0.0, 0.3, 1.1, -0.9], [0.0, 0.7, 0.5, 0.9]])
    t = np.arange(4)[:, None]
    mesh = fem.MeshTet(p, t if np.linalg.det(p[:, 1:] - p[:, :1]) > 0 else t[[0, 2, 1, 3]])
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTetP1()))
    dofs = basis.nodal_dofs[:, 0]
    D = np.setdiff1d(np.arange(basis.N), dofs)
    body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), D=D, name="tip")
    faces = np.flatnonzero((mesh.facets == 0).any(axis=0))
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    surface = body.surface(faces[:1])
    away = 100.0 * (np.abs(surface.points).max(axis=1) > 0)  # the corners that are clamped
    contact = sc.Contact(surface, floor, friction=sc.Coulomb(mu, **options), gap=away)
    K = body.K.toarray()[np.ix_(dofs, dofs)]
    return sc.ContactSolver(body, contact, loop=loop), dofs, K


def test_a_single_tetrahedron():
    """Critical coefficient, index and proof of a result are those of its corner's 3 x 3 matrix."""
    solver, dofs, K = tetrahedron(0.1)
    space = PointSpace(K, np.array([2]), np.array([[0, 1]]))
    angle = np.linspace(0, np.pi, 100001)
    d = np.column_stack([np.cos(angle), np.sin(angle)])
    k_tt, k_tn = K[:2, :2], K[:2, 2]
    critical = min(
        1 / np.linalg.norm(np.linalg.solve(k_tt, k_tn)),
        np.min(np.einsum("qi,ij,qj->q", d, k_tt, d) / np.abs(d @ k_tn)),
    )
    for mu, text in (
        (0.4 * critical, "this load has no other answer: shown for friction up to"),
        (0.99 * critical, "other answers is not known; that it has none is shown for friction up to"),
        (1.1 * critical, "the load may have several answers"),
    ):
        solver, dofs, _ = tetrahedron(mu)
        result = solver.solve({"tip": load(dofs, (-0.02, 0.01, -1.0), solver)})
        known = result.uniqueness
        free = np.isfinite(known.friction)
        assert free.sum() == 1 and known.held and known.index == 1
        # a grid of directions, fine to four digits, from above
        assert known.critical_friction[free][0] == pytest.approx(critical, rel=1e-4)
        shown = unique_up_to(space, np.array([mu]), np.full(1, np.inf), np.zeros(1, dtype=bool))
        assert known.unique_up_to == pytest.approx(shown, rel=1e-9)
        assert known.only_one == (mu <= 0.4 * critical)
        assert text in result.report()
    assert (
        "answers" not in tetrahedron(0.0)[0].solve({"tip": load(dofs, (0, 0, -1.0), solver)}).report()
    )


@pytest.mark.parametrize(
    ("law", "separation", "shown"),
    [
        (sc.Coulomb(0.1), True, True),
        (sc.Coulomb(0.1, tau_max=1.0), True, True),
        (sc.Coulomb(0.1, cohesion=0.1), True, False),  # what opens loses its bound at once
        (sc.Coulomb(0.1, cohesion=0.1), False, True),
        (sc.Tresca(0.1), True, False),
        (sc.Tresca(0.1), False, True),
    ],
)
def test_bounds_that_jump_show_nothing(law, separation, shown):
    """An open point has no friction: nothing follows where its bound is not zero without pressure."""
    solver, dofs, _ = tetrahedron(0.1)
    contact = replace(solver.contacts[0], friction=law, separation=separation)
    if not separation:  # given gaps count as they are
        contact = replace(contact, gap=0.0)
    solver = sc.ContactSolver(solver.system.bodies, contact)
    known = solver.solve({"tip": load(dofs, (-0.01, 0.01, -1.0), solver)}).uniqueness
    assert (known.unique_up_to > 0) == shown and (known.index != 0) == shown


def load(dofs, force, solver):
    f = np.zeros(solver.system.n)
    f[dofs] = force
    return f


@pytest.mark.parametrize("G", [0.5, 40.0])
def test_springs_of_friction_that_turns(G):
    """The derivative of friction by the slip, where a stiffness G leads to it, by differences."""
    rng = np.random.default_rng(2)
    space = random_space(rng, 3)
    before, slip, bound = rng.standard_normal((3, 2)), rng.standard_normal((3, 2)), np.full(3, 0.2)

    def friction(s):
        return radial_return(before + G * s, bound)[0]

    tau, eps = friction(slip), 1e-6
    plastic = slip - (tau - before) / G
    exact = np.stack(
        [(friction(slip + eps * e) - friction(slip - eps * e)) / (2 * eps) for e in np.eye(2)], axis=2
    )
    found = turning_springs(tau, plastic, np.full(3, G), space)
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-8)
