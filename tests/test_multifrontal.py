"""The multifrontal factorisation against dense linear algebra and SciPy's sparse solver."""

from __future__ import annotations

import tracemalloc
from functools import cache

import internals
import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from scipy.linalg import block_diag
from scipy.sparse.linalg import spsolve
from scipy.spatial import Delaunay
from skfem.models.elasticity import lame_parameters

from skfem_contact.errors import InputError, SingularMatrix
from skfem_contact.linalg import (
    MultifrontalCholesky,
    analyse,
    dissect,
    dissection_order,
    factor_size,
    find_runs,
)

_halves = internals.original("linalg._halves")


def irregular(dim: int) -> fem.Mesh:
    """Delaunay mesh of random points: no two nodes have the same number of neighbours."""
    rng = np.random.default_rng(1)
    p = rng.random((400 if dim == 2 else 120, dim))
    p[:20, -1], p[20:50, -1] = 0.0, 1.0
    t = Delaunay(p).simplices
    corners = p[t]
    size = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    return (fem.MeshTri if dim == 2 else fem.MeshTet)(p.T.copy(), t[size > 1e-6].T.copy())


GRID = np.linspace(0.0, 1.0, 9)
CASES = {
    "P1, irregular": (irregular(2), fem.ElementTriP1()),
    "P2, irregular": (irregular(2), fem.ElementTriP2()),
    "Q1": (fem.MeshQuad.init_tensor(np.linspace(0, 3, 31), GRID), fem.ElementQuad1()),
    "Q2": (fem.MeshQuad.init_tensor(GRID, GRID), fem.ElementQuad2()),
    "tetrahedra, irregular": (irregular(3), fem.ElementTetP1()),
    "hexahedra": (fem.MeshHex.init_tensor(GRID[::2], GRID[::2], GRID[::2]), fem.ElementHex1()),
}


def assemble(name: str, held: bool = True) -> tuple[sp.csr_matrix, np.ndarray, np.ndarray]:
    """Stiffness, positions and contact DOFs (at the top) of a body, held at its base or not."""
    mesh, element = CASES[name]
    order = 4 if name == "Q2" else 2  # 2 leaves Q2 one motion without energy
    basis = fem.Basis(mesh, fem.ElementVector(element), intorder=order)
    K = linear_elasticity(*lame_parameters(210e9, 0.3)).assemble(basis)
    points = basis.doflocs.T
    height = points[:, -1]
    free = np.flatnonzero(height > 1e-9) if held else np.arange(basis.N)
    return K[free][:, free], points[free], np.flatnonzero(height[free] > 1.0 - 1e-9)


@cache
def exact_schur(name: str) -> np.ndarray:
    """The Schur complement of a body at its contact DOFs, from dense matrices."""
    K, _, keep = assemble(name)
    return schur(K, keep)


def schur(K: sp.csr_matrix, keep: np.ndarray) -> np.ndarray:
    dense = K.toarray()
    inside = np.setdiff1d(np.arange(len(dense)), keep)
    K_ik = dense[np.ix_(inside, keep)]
    return dense[np.ix_(keep, keep)] - K_ik.T @ np.linalg.solve(dense[np.ix_(inside, inside)], K_ik)


@pytest.mark.parametrize("name", CASES)
def test_schur_complement(name):
    """S is the Schur complement that dense algebra gives, and symmetric to the last bit."""
    K, points, keep = assemble(name)
    S = MultifrontalCholesky(K, points, keep, leaf=30).S
    # round-off times a condition number of some thousands
    assert_allclose(S, exact_schur(name), rtol=0, atol=1e-11 * abs(S).max())
    assert_array_equal(S, S.T)


@pytest.mark.every_value
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("columns", [(), (1,), (7,)])
def test_condense_solve_recover(name, columns):
    """Reducing the load, solving with S and substituting back solves the whole system."""
    K, points, keep = assemble(name)
    f = np.random.default_rng(0).standard_normal((len(points), *columns))
    factor = MultifrontalCholesky(K, points, keep)
    u = factor.recover(np.linalg.solve(factor.S, factor.reduce_load(f)), f)
    exact = spsolve(K.tocsc(), f).reshape(f.shape)
    assert u.shape == f.shape
    assert_allclose(u, exact, rtol=0, atol=1e-11 * abs(exact).max())
    # without anything kept, and the interior alone, what is kept being held
    assert_allclose(
        MultifrontalCholesky(K, points).solve(f), exact, rtol=0, atol=1e-11 * abs(exact).max()
    )
    inside = np.setdiff1d(np.arange(len(points)), keep)
    interior = spsolve(K[inside][:, inside].tocsc(), f[inside]).reshape(f[inside].shape)
    found = factor.recover(np.zeros((len(keep), *columns)), f)[inside]
    assert_allclose(found, interior, rtol=0, atol=1e-11 * abs(interior).max())


@pytest.mark.every_value
@pytest.mark.parametrize("before", [(np.nan,), (np.inf, -np.inf, 1e308)], ids=["nan", "inf"])
@pytest.mark.parametrize("name", CASES)
def test_memory_of_fronts_is_written_before_it_is_read(name, before, monkeypatch):
    """Fronts share memory that nobody clears: what was there before never shows, nor warns."""

    class Unknown(internals.original("linalg.Leftovers")):
        def __init__(self, fronts, S):
            super().__init__(fronts, S)
            self._memory[:] = np.resize(before, self._memory.size)

    internals.replace(monkeypatch, "linalg.Leftovers", Unknown)
    K, points, keep = assemble(name)
    for leaf in (5, 120):
        factor = MultifrontalCholesky(K, points, keep, leaf=leaf)
        assert_allclose(factor.S, exact_schur(name), rtol=0, atol=1e-11 * abs(factor.S).max())
        inside = np.setdiff1d(np.arange(len(points)), keep)
        u = factor.recover(np.zeros(len(keep)), np.ones(len(points)))[inside]
        exact = spsolve(K[inside][:, inside].tocsc(), np.ones(len(inside)))
        assert_allclose(u, exact, rtol=0, atol=1e-11 * abs(exact).max())


def test_recover_without_load():
    """With no load, the interior follows the contact DOFs: a rigid motion stays one."""
    K, points, keep = assemble("P1, irregular", held=False)
    factor = MultifrontalCholesky(K, points, keep)
    motion = np.zeros(len(points))
    motion[0::2], motion[1::2] = 1.0 - 2.0 * points[0::2, 1], 3.0 + 2.0 * points[1::2, 0]
    assert_allclose(factor.recover(motion[keep]), motion, rtol=0, atol=1e-11)
    two = np.stack((motion, 2.0 * motion), axis=1)
    assert_allclose(factor.recover(two[keep]), two, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", CASES)
def test_floating_body(name):
    """Of a floating body S has three zero eigenvalues (six in 3-D) to round-off, and no more."""
    K, points, keep = assemble(name, held=False)
    values = np.linalg.eigvalsh(MultifrontalCholesky(K, points, keep).S)
    rigid = 3 if points.shape[1] == 2 else 6
    assert np.all(abs(values[:rigid]) < 1e-12 * values[-1])
    assert values[rigid] > 1e-4 * values[-1]


def test_contrast():
    """A foundation 1e12 times stiffer than the body on it costs no digits."""
    mesh, element = CASES["Q1"]
    basis = fem.Basis(mesh, fem.ElementVector(element), intorder=2)
    form = linear_elasticity(*lame_parameters(1.0, 0.3))
    upper = mesh.p[1, mesh.t].mean(axis=0) > 0.5
    free = np.flatnonzero(basis.doflocs[1] > 0.0)
    points = basis.doflocs.T[free]
    K_upper, K_lower = (
        form.assemble(basis.with_elements(np.flatnonzero(where)))[free][:, free]
        for where in (upper, ~upper)
    )
    K = sp.csr_matrix(K_upper + 1e12 * K_lower)
    # A load on the body moves it as if its base were held, up to 1e-12.
    body = np.flatnonzero(points[:, 1] > 0.5)
    f = np.zeros(len(free))
    f[body] = np.random.default_rng(0).standard_normal(body.size)
    factor = MultifrontalCholesky(K, points)
    exact = spsolve(K_upper[body][:, body].tocsc(), f[body])
    assert_allclose(factor.solve(f)[body], exact, rtol=0, atol=1e-10 * abs(exact).max())
    assert factor.pivot_ratio > 1e-2
    top = np.flatnonzero(points[:, 1] == 1.0)
    S = MultifrontalCholesky(K, points, top).S
    held = schur(sp.csr_matrix(K_upper[body][:, body]), np.searchsorted(body, top))
    assert_allclose(S, held, rtol=0, atol=1e-10 * abs(held).max())


@pytest.mark.parametrize("leaf", [1, 2, 10, 77, 10_000])
def test_leaf_does_not_matter(leaf):
    """The size of the boxes changes the work, not the answer."""
    K, points, keep = assemble("P2, irregular")
    S = MultifrontalCholesky(K, points, keep, leaf=leaf).S
    assert_allclose(S, exact_schur("P2, irregular"), rtol=0, atol=1e-11 * abs(S).max())


def test_positions_only_guide():
    """Positions that have nothing to do with the mesh, or are all equal, still give S."""
    K, points, keep = assemble("Q1")
    exact = schur(K, keep)
    for wrong in (np.random.default_rng(0).random(points.shape), np.zeros(points.shape)):
        S = MultifrontalCholesky(K, wrong, keep, leaf=20).S
        assert_allclose(S, exact, rtol=0, atol=1e-11 * abs(exact).max())


def test_keep_is_taken_as_given():
    """DOFs are kept in the order given, also single components of a node."""
    K, points, keep = assemble("Q1")
    some = np.random.default_rng(0).permutation(keep[keep % 2 == 1])
    S = MultifrontalCholesky(K, points, some).S
    assert_allclose(S, schur(K, some), rtol=0, atol=1e-11 * abs(S).max())


def test_everything_kept():
    """With nothing to eliminate, S is K."""
    K, points, _ = assemble("hexahedra")
    factor = MultifrontalCholesky(K, points, np.arange(len(points)))
    f = np.ones(len(points))
    assert_allclose(factor.S, K.toarray(), rtol=1e-12, atol=1e-12 * abs(factor.S).max())
    assert_array_equal(factor.reduce_load(f), f)
    assert_array_equal(factor.recover(f, f), f)
    assert factor.pivot_ratio == 1.0


def test_separate_bodies_with_coincident_nodes():
    """Two bodies in one matrix, touching at equal points, stay uncoupled."""
    K, points, keep = assemble("Q1")
    both = sp.block_diag((K, K), format="csr")
    mirrored = points * (1.0, -1.0) + (0.0, 2.0)
    ends = np.concatenate((keep, keep + len(points)))
    S = MultifrontalCholesky(both, np.concatenate((points, mirrored)), ends, leaf=40).S
    one = schur(K, keep)
    assert_allclose(S, block_diag(one, one), rtol=0, atol=1e-11 * abs(one).max())


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 40), st.integers(1, 12), st.floats(0.0, 0.4))
def test_any_pattern(seed, n, leaf, density):
    """Whatever the pattern, the positions and what is kept: S and the solution are right."""
    rng = np.random.default_rng(seed)
    A = sp.csr_matrix(rng.random((n, n)) * (rng.random((n, n)) < density))
    A = sp.csr_matrix(A + A.T)
    A = sp.csr_matrix(A + sp.diags_array(1.0 + np.asarray(abs(A).sum(axis=1)).ravel()))
    points = rng.integers(0, 4, (n, int(rng.integers(1, 4)))).astype(float)
    keep = rng.permutation(n)[: rng.integers(0, n + 1)]
    factor = MultifrontalCholesky(A, points, keep, leaf=leaf)
    assert_allclose(factor.S, schur(A, keep), rtol=0, atol=1e-12 * abs(A).max())
    f = rng.standard_normal((n, 2))
    u = factor.recover(np.linalg.solve(factor.S, factor.reduce_load(f)), f)
    assert_allclose(u, np.linalg.solve(A.toarray(), f), rtol=0, atol=1e-11)


def test_separators_separate():
    """No entry couples two boxes of which neither is above the other."""
    K, points, _ = assemble("P2, irregular")
    tree = dissect(K, points, leaf=25)
    above = np.eye(tree.parent.size + 1, dtype=bool)  # above[a, b]: a is b, or above it
    for box in range(tree.parent.size - 1, -1, -1):
        above[:, box] |= above[:, tree.parent[box]]
    i, j = K.nonzero()
    a, b = tree.owner[i], tree.owner[j]
    assert np.all(above[a, b] | above[b, a])
    assert np.all(tree.parent > np.arange(tree.parent.size))
    assert_array_equal(tree.owner[0::2], tree.owner[1::2])  # the DOFs of a node stay together
    assert_array_equal(np.sort(dissection_order(K, points)), np.arange(len(points)))


def test_some_dofs_are_dissected_as_their_own_matrix():
    """DOFs that are kept have no part in the boxes: as if their rows and columns were not there."""
    K, points, _ = assemble("P2, irregular")
    inside = np.setdiff1d(np.arange(len(points)), np.arange(0, len(points), 7))
    one = dissect(K, points[inside], 25, inside)
    other = dissect(K[inside][:, inside], points[inside], 25)
    for name in ("owner", "parent", "levels", "along"):
        assert_array_equal(getattr(one, name), getattr(other, name))


def test_rows_that_are_no_dofs_are_not_there():
    """Of a matrix with rows of prescribed DOFs the others are factorised as their own matrix."""
    K, points, _ = assemble("P2, irregular")
    free = np.setdiff1d(np.arange(len(points)), np.arange(0, len(points), 9))
    keep = np.arange(len(free))[::-13]
    one = MultifrontalCholesky(K, points[free], keep, free=free, leaf=25)
    other = MultifrontalCholesky(K[free][:, free], points[free], keep, leaf=25)
    assert one.pivot_ratio == other.pivot_ratio
    assert_array_equal(one.order, other.order)
    assert_array_equal(one.S, other.S)
    f = np.ones(len(free))
    assert_array_equal(one.recover(f[keep], f), other.recover(f[keep], f))
    size = factor_size(K, points[free], keep, free=free, leaf=25)
    assert size == factor_size(K[free][:, free], points[free], keep, leaf=25)
    with pytest.raises(InputError, match="do not belong together"):
        MultifrontalCholesky(K, points, keep, free=free)


def test_halves_are_never_empty():
    """However many nodes are level with the middle, or all but one: both halves have some."""
    for x in ([0, 1, 1, 1, 1], [0, 0, 0, 0, 1], [0, 1], [0, 0, 1, 1, 1], [0, 1, 1, 1, 2]):
        for side in (1.0, -1.0, 1e-300):
            centres = np.stack([side * np.array(x, dtype=float), np.zeros(len(x))])
            _, half = _halves(np.arange(len(x)), np.zeros(len(x), dtype=int), centres)
            assert sorted(set(half)) == [0, 1]


def test_separator_comes_from_the_smaller_side():
    """A hub coupled with everything beyond the cut separates alone."""
    spokes = np.arange(5, 10)
    A = sp.coo_matrix((np.ones(5), (np.full(5, 4), spokes)), shape=(10, 10))
    for points in (np.arange(10.0), -np.arange(10.0)):
        tree = dissect(sp.csr_matrix(A + A.T), points[:, None], leaf=5)
        assert_array_equal(np.flatnonzero(tree.owner == tree.owner[4]), [4])
        assert tree.parent[tree.owner[4]] == tree.parent.size


@pytest.mark.parametrize("name", CASES)
def test_runs_are_the_borders(name):
    """Cut into runs, each border is consecutive in its parent, on one side of the pivots."""
    K, points, keep = assemble(name)
    fronts = analyse(K, points, keep, leaf=8)
    pivots = np.append(np.diff(fronts.start), 0)
    for front, runs in enumerate(find_runs(fronts)):
        target = fronts.target[fronts.first[front] : fronts.first[front + 1]]
        reached = 0
        for begin, end, row in runs:
            assert begin == reached
            reached, run = end, target[begin:end]
            assert_array_equal(run, np.arange(row, row + run.size))
            assert (run[0] < pivots[fronts.parent[front]]) == (run[-1] < pivots[fronts.parent[front]])
        assert reached == target.size


def test_fill_in_grows_as_nested_dissection_has_it():
    """In 2-D, the factors of four times as many DOFs take some five times the memory."""
    sizes = []
    for cells in (60, 120):
        mesh = fem.MeshQuad.init_tensor(*[np.linspace(0.0, 1.0, cells + 1)] * 2)
        basis = fem.Basis(mesh, fem.ElementQuad1(), intorder=2)
        K = fem.models.poisson.laplace.assemble(basis)
        sizes.append(factor_size(K, basis.doflocs.T).memory)
    # n log n: 4 log(14641) / log(3721) = 4.7; a band matrix would take eight times as much
    assert 4.0 < sizes[1] / sizes[0] < 5.5


def test_estimate_is_the_truth():
    """Memory is known before: exactly what is kept then, and about the highest that is seen."""
    mesh = fem.MeshQuad.init_tensor(*[np.linspace(0.0, 1.0, 101)] * 2)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    points = basis.doflocs.T
    keep = np.flatnonzero(points[:, 1] == 1.0)
    size = factor_size(K, points, keep)
    assert (size.n, size.kept) == (basis.N, keep.size)
    tracemalloc.start()
    factor = MultifrontalCholesky(K, points, keep)
    held, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert factor.memory == size.memory
    # beyond the arrays: views, lists and the temporaries of the analysis
    assert size.memory < held < 1.25 * size.memory
    assert size.peak < most < 1.5 * size.peak
    assert size.flops > 2.0 * size.memory / 8.0


def test_input_is_not_changed():
    """Neither K, points, loads nor displacements are written to; the same input, the same S."""
    K, points, keep = assemble("Q1")
    f = np.ones((len(points), 3))
    copies = K.copy(), points.copy(), f.copy()
    factor = MultifrontalCholesky(K, points, keep)
    u_keep = factor.reduce_load(f)
    before = u_keep.copy()
    factor.recover(u_keep, f)
    assert_array_equal(u_keep, before)
    assert_array_equal(K.data, copies[0].data)
    assert_array_equal(points, copies[1])
    assert_array_equal(f, copies[2])
    assert_array_equal(MultifrontalCholesky(K, points, keep).S, factor.S)


def test_entries_given_twice_are_added():
    """A matrix in coordinate format with repeated entries is their sum."""
    K, points, keep = assemble("Q1")
    once = sp.coo_matrix(K)
    i, j, v = once.row, once.col, 0.5 * once.data
    twice = sp.coo_matrix((np.tile(v, 2), (np.tile(i, 2), np.tile(j, 2))), shape=K.shape)
    S = MultifrontalCholesky(twice, points, keep).S
    assert_allclose(S, schur(K, keep), rtol=0, atol=1e-11 * abs(S).max())


@pytest.mark.parametrize("name", CASES)
def test_rigid_motion_left_free(name):
    """A floating body with nothing kept is refused, and the message says where."""
    K, points, _ = assemble(name, held=False)
    with pytest.raises(SingularMatrix, match=r"stiffness left at DOF \d+ at \(") as info:
        MultifrontalCholesky(K, points)
    where = ", ".join(f"{x:.6g}" for x in points[info.value.dof])
    assert f"at DOF {info.value.dof} at ({where})" in str(info.value)
    assert info.value.ratio < 1e-10


def test_one_contact_node_does_not_stop_rotation():
    """With a single node kept, a floating body still turns about it."""
    K, points, keep = assemble("Q1", held=False)
    with pytest.raises(SingularMatrix, match="rigid motion is left"):
        MultifrontalCholesky(K, points, keep[:2])


def test_slender_cantilever_is_not_singular():
    """A cantilever of 1000 elements has pivots of 1e-9 and is solved all the same."""
    mesh = fem.MeshQuad.init_tensor(np.arange(1001.0), np.array([0.0, 1.0]))
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    free = np.flatnonzero(basis.doflocs[0] > 0.0)
    K, points = K[free][:, free], basis.doflocs.T[free]
    assert MultifrontalCholesky(K, points).pivot_ratio < 1e-8
    f = K @ np.ones(len(free))
    # a condition number of 1e12 leaves four digits of the displacement, and all of the load
    assert_allclose(K @ MultifrontalCholesky(K, points).solve(f), f, rtol=0, atol=1e-12 * abs(K).max())


def test_barely_held():
    """A chain of 4001 springs on a ground of 5e-12 has pivots of 1e-12, yet moves as a whole."""
    n = 4001
    points = np.arange(float(n))[:, None]
    diagonal = np.full(n, 2.0)
    diagonal[[0, -1]] = 1.0
    for ground, held in ((1e-6, True), (1.2e-11, None), (5.6e-12, False)):
        ends = diagonal.copy()
        ends[0] += ground
        K = sp.diags_array([-np.ones(n - 1), ends, -np.ones(n - 1)], offsets=[-1, 0, 1])
        if held is None:
            MultifrontalCholesky(K, points)  # an eigenvalue of 1.5e-15 is one (NEGLIGIBLE)
        elif held:
            u = MultifrontalCholesky(K, points).solve(np.ones(n))
            assert_allclose(u[0], n / ground, rtol=1e-5)
        else:
            # the smallest eigenvalue, ground / n / 2, is no more than the round-off of the rest
            with pytest.raises(SingularMatrix) as info:
                MultifrontalCholesky(K, points)
            assert_allclose(info.value.ratio, ground / n / 2, rtol=0.1)


def test_indefinite():
    """A negative pivot, a zero matrix and NaN are refused."""
    K, points, _ = assemble("Q1")
    for wrong in (-K, 0.0 * K, np.nan * K):
        with pytest.raises(SingularMatrix, match="not positive definite"):
            MultifrontalCholesky(wrong, points)


def test_messages():
    """Shapes, repeated DOFs, half-stored matrices and solve with DOFs kept are explained."""
    K, points, keep = assemble("Q1")
    with pytest.raises(InputError, match="do not belong together"):
        MultifrontalCholesky(K, points[:-1])
    with pytest.raises(InputError, match=rf"DOFs from 0 to {len(points) - 1}, each once"):
        MultifrontalCholesky(K, points, [3, 3])
    with pytest.raises(InputError, match="each once"):
        factor_size(K, points, [len(points)])
    with pytest.raises(InputError, match="K is not symmetric"):
        MultifrontalCholesky(sp.triu(K), points)
    with pytest.raises(InputError, match=f"{keep.size} DOFs are kept"):
        MultifrontalCholesky(K, points, keep).solve(np.ones(len(points)))
