"""Dense and sparse spaces give the answer of the saddle-point problem that they eliminate from."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix

from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg import Direct, factorised
from skfem_contact.problem import Conditions, Load, PointSpace, SparseSpace


class Problem:
    """Random stiffness, rows, prescribed DOFs and load: m points with t tangents on n DOFs."""

    def __init__(self, seed, t, m=5, n=24):
        rng = np.random.default_rng(seed)
        A = rng.standard_normal((n, n))
        self.n, self.m, self.t = n, m, t
        self.K = A @ A.T + n * np.eye(n)
        self.D = np.array([0, 1])
        self.B_n, self.B_t = rng.standard_normal((m, n)), rng.standard_normal((m * t, n))
        self.f = 10 * rng.standard_normal(n)
        self.x = np.zeros(n)
        self.x[self.D] = rng.standard_normal(2)
        self.gap0, self.slip0 = rng.standard_normal(m), rng.standard_normal((m, t))
        self.frictional = np.arange(m) != m - 1  # the last point has no friction
        self.rng = rng

    def conditions(self):
        """Points open, sticking, slipping with a coupled force, on springs, and frictionless."""
        rng, m, t = self.rng, self.m, self.t
        closed = np.array([False, True, True, True, True])
        stick = np.array([False, True, False, False, False])
        spring, coupling = np.zeros((m, t, t)), np.zeros((m, t))
        G = rng.standard_normal((t, t))
        spring[3] = G @ G.T
        coupling[2] = 0.3 * rng.standard_normal(t)
        offset = np.zeros((m, t))
        offset[2:4] = rng.standard_normal((2, t))
        return Conditions(closed, stick, rng.standard_normal((m, t)), spring, offset, coupling)

    def saddle(self, c):
        """All equations at once: unknowns u, lambda, tau."""
        n, m, t = self.n, self.m, self.t
        free = np.setdiff1d(np.arange(n), self.D)
        size = n + m + m * t
        A, b = np.zeros((size, size)), np.zeros(size)
        A[free, :n] = self.K[free]
        A[free, n : n + m] = -self.B_n[:, free].T
        A[free, n + m :] = self.B_t[:, free].T
        b[free] = self.f[free]
        A[self.D, self.D], b[self.D] = 1.0, self.x[self.D]
        for i in range(m):
            if c.closed[i]:
                A[n + i, :n], b[n + i] = self.B_n[i], -self.gap0[i]
            else:
                A[n + i, n + i] = 1.0
            for k in range(t):
                row = n + m + i * t + k
                if c.stick[i]:
                    A[row, :n], b[row] = self.B_t[i * t + k], c.anchor[i, k] - self.slip0[i, k]
                    continue
                A[row, row] = 1.0
                if c.closed[i]:
                    A[row, :n] -= c.spring[i, k] @ self.B_t[i * t : (i + 1) * t]
                    A[row, n + i] -= c.coupling[i, k]
                    b[row] = c.offset[i, k] + c.spring[i, k] @ (self.slip0[i] - c.anchor[i])
        y = np.linalg.solve(A, b)
        return y[:n], y[n : n + m], y[n + m :].reshape(m, t)

    def sparse(self):
        rows = SimpleNamespace(
            B_n=csr_matrix(self.B_n), B_t=csr_matrix(self.B_t), m=self.m, tangents=self.t
        )
        prefer = np.arange(self.n) >= self.n // 2
        space = SparseSpace(csr_matrix(self.K), rows, self.D, prefer, Direct(), 1.0, self.frictional)
        return space, Load(self.f, self.gap0, self.slip0, self.x)

    def dense(self):
        """The same in gaps and slips: S = (B K^-1 B')^-1 on the free DOFs."""
        m, t = self.m, self.t
        free = np.setdiff1d(np.arange(self.n), self.D)
        slips = np.repeat(self.frictional, t)
        B = np.concatenate([self.B_n, self.B_t[slips]])[:, free]
        flexible = np.linalg.inv(self.K[np.ix_(free, free)])
        S = np.linalg.inv(B @ flexible @ B.T)
        f = self.f[free] - self.K[np.ix_(free, self.D)] @ self.x[self.D]
        rows = np.full(m * t, -1)
        rows[slips] = m + np.arange(slips.sum())
        space = PointSpace(0.5 * (S + S.T), np.arange(m), rows.reshape(m, t))
        moved = self.B_t[:, self.D] @ self.x[self.D]
        load = Load(
            S @ B @ flexible @ f,
            self.gap0 + self.B_n[:, self.D] @ self.x[self.D],
            self.slip0 + moved.reshape(m, t),
            np.zeros(0),
        )
        return space, load


@pytest.mark.parametrize("t", [1, 2])
@pytest.mark.parametrize("seed", range(4))
def test_both_spaces_solve_the_saddle_point_problem(seed, t):
    """Elimination, in displacements or in gaps and slips, changes nothing of the answer."""
    problem = Problem(seed, t)
    c = problem.conditions()
    u, lam, tau = problem.saddle(c)
    for space, load in (problem.sparse(), problem.dense()):
        for _ in range(2):  # the second solve uses the factorisation kept from the first
            found = space.solve(c, load)
            scale = np.abs(lam).max()
            assert_allclose(found.normal_force, lam, rtol=0, atol=1e-10 * scale)
            assert_allclose(found.tangential_force, tau, rtol=0, atol=1e-10 * scale)
            assert_allclose(found.gap, problem.gap0 + problem.B_n @ u, rtol=0, atol=1e-10)
            slip = problem.slip0 + (problem.B_t @ u).reshape(tau.shape)
            on = problem.frictional
            assert_allclose(found.slip[on], slip[on], rtol=0, atol=1e-10)
    assert_allclose(problem.sparse()[0].solve(c, problem.sparse()[1]).solution, u, rtol=0, atol=1e-10)


@pytest.mark.parametrize("make", ["sparse", "dense"])
def test_another_load_reuses_and_other_conditions_renew_the_factor(make):
    """What a space keeps from one solve never shows in the next."""
    problem = Problem(7, 1)
    space, load = getattr(problem, make)()
    first = space.solve(problem.conditions(), load)
    c = problem.conditions()
    twice = Load(2 * load.force, load.gap0, load.slip0, load.prescribed)
    used = [space.solve(c, load), space.solve(c, twice), space.solve(c, load)]
    fresh = [getattr(Problem(7, 1), make)()[0].solve(c, one) for one in (load, twice, load)]
    for a, b in zip(used, fresh, strict=True):
        assert_allclose(
            a.normal_force, b.normal_force, rtol=0, atol=1e-11 * np.abs(b.normal_force).max()
        )
    assert not np.allclose(first.normal_force, used[0].normal_force)


def test_dense_matrices_that_can_not_be_factorised():
    """A singular contact problem is an error that says so, symmetric or not."""
    with pytest.raises(SingularMatrix, match="not positive definite"):
        factorised(np.array([[1.0, 2.0], [2.0, 1.0]]), symmetric=True)
    with pytest.raises(SingularMatrix, match="is singular"):
        factorised(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-15]]), symmetric=False)
    with pytest.raises(SingularMatrix, match="is singular"):  # the pivot is zero, and nothing warns
        factorised(np.ones((2, 2)), symmetric=False)
