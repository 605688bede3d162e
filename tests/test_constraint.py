"""Affine constraints, checked against dense saddle-point systems with multipliers."""

from __future__ import annotations

import inspect
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.elimination import AffineConstraint, condense, eliminate, find_pivots
from skfem_contact.errors import ConstraintError, InputError

# Systems below are well conditioned (< 1e3) and of order one: what elimination and the dense
# oracle lose is round-off times that.
TIGHT = 1e-12


def spd(n, rng):
    """A symmetric positive definite matrix with eigenvalues between 1 and 10, and a load."""
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return Q @ np.diag(np.linspace(1.0, 10.0, n)) @ Q.T, rng.normal(size=n)


def saddle(K, f, C, b, D, x):
    """Oracle: u and C'p of [[K, C', E'], [C, 0, 0], [E, 0, 0]] by least squares (rows may repeat).

    Of the forces of rows and of prescribed DOFs only the sum is unique if a row is satisfied by
    prescribed values alone, so C'p is returned without its part on D.
    """
    n, E = len(f), np.eye(len(f))[D]
    B = np.vstack([C, E])
    A = np.block([[K, -B.T], [B, np.zeros((len(B), len(B)))]])
    solution, *_ = np.linalg.lstsq(A, np.concatenate([f, b, x[D]]), rcond=1e-13)
    force = C.T @ solution[n : n + len(C)]
    return solution[:n], np.delete(force, D)


def check(C, b, D=(), x=None, *, rng=0, tolerance=TIGHT, **options) -> AffineConstraint:
    """Everything that must hold for any rows, against the oracle; returns the constraint."""
    rng = np.random.default_rng(rng)
    C, b, D = np.atleast_2d(np.asarray(C, float)), np.asarray(b, float), np.asarray(D, int)
    n = C.shape[1]
    x = np.zeros(n) if x is None else x
    K, f = spd(n, rng)
    a = eliminate(sp.csr_matrix(C), b, D, x, **options)

    rank = np.linalg.matrix_rank(np.vstack([C, np.eye(n)[D]]), tol=1e-9)
    assert a.T.shape == (n, n - rank)
    assert np.all(np.diff(a.independent) > 0)
    assert_allclose(a.T[a.independent].toarray(), np.eye(n - rank), rtol=0, atol=0)
    assert a.T[a.prescribed].nnz == 0
    assert_allclose(a.c[a.prescribed], x[a.prescribed], rtol=0, atol=0)
    groups = np.concatenate([a.independent, a.dependent, a.prescribed])
    assert np.array_equal(np.sort(groups), np.arange(n))
    assert np.array_equal(np.sort(np.append(a.rows_kept, a.redundant)), np.arange(len(C)))
    size = np.abs(C).max(axis=1, initial=0.0)
    size[size == 0] = 1.0
    assert_allclose(C @ a.T / size[:, None], 0.0, atol=tolerance)
    scale = np.abs(x).max(initial=0.0) + np.abs(b / size).max(initial=0.0)
    assert_allclose((C @ a.c - b) / size, 0.0, atol=tolerance * scale)

    K_r, f_r = a.reduce(sp.csr_matrix(K), f)
    K_r = K_r.toarray()
    assert_allclose(K_r, K_r.T, rtol=0, atol=TIGHT * np.abs(K_r).max(initial=0.0))
    u = a.expand(np.linalg.solve(K_r, f_r))
    p = a.multipliers(K @ u - f)
    # rows of size one: the round-off of a saddle point grows with the ratio of its rows
    u_oracle, force = saddle(K, f, C / size[:, None], b / size, D, x)
    assert_allclose(u, u_oracle, rtol=0, atol=tolerance * np.abs(u_oracle).max())
    # forces are K u - f: ten times u (K) and f, of which they are the difference
    load = 10 * np.abs(u_oracle).max() + np.abs(f).max()
    assert_allclose(np.delete(C.T @ p, D), force, rtol=0, atol=tolerance * load)
    assert np.all(p[a.redundant] == 0.0)
    balance = K @ u - f - C.T @ p
    balance[a.prescribed] -= a.reactions(K @ u - f, p)
    assert_allclose(balance, 0.0, atol=tolerance * load)
    return a


# ---------------------------------------------------------------------------- the common cases


def test_no_rows():
    """Without rows only the prescribed DOFs leave the system."""
    a = check(np.zeros((0, 5)), [], D=[1, 3], x=np.arange(5.0))
    assert a.independent.tolist() == [0, 2, 4]
    assert "5 DOFs = 3 independent + 0 dependent + 2 prescribed" in repr(a)


def test_largest_coefficient_is_given_up():
    """Rows that share nothing give up the DOF of their largest coefficient."""
    a = check([[0.6, 0.8, -0.3, 0, 0], [0, 0, 0, -0.2, 2.0]], [0.1, 0.2])
    assert a.dependent.tolist() == [1, 4]


def test_preferred_side_is_given_up():
    """A preferred DOF is the pivot although another coefficient is larger, but not a tiny one."""
    prefer = np.array([True, False, False])
    assert check([[0.2, 1.0, 0.5]], [1.0], prefer=prefer).dependent.tolist() == [0]
    assert check([[0.05, 1.0, 0.5]], [1.0], prefer=prefer).dependent.tolist() == [1]


def test_pivot_leaves_the_secondary_side_on_a_roller():
    """With the secondary x held, a normal nearly along x takes its pivot from the primary side."""
    n = np.array([np.sqrt(1 - 0.05**2), 0.05])
    prefer = np.array([True, True, False, False])
    a = check([[*n, *-n]], [0.3], D=[0], prefer=prefer)
    assert a.dependent.tolist() == [2]


def test_chain_of_three_bodies():
    """Springs in three bodies, each resting on the next: a primary node is secondary elsewhere."""
    C = np.zeros((2, 9))
    C[0, [2, 3]] = 1, -1
    C[1, [3, 6]] = 1, -1  # node 3 is primary above and secondary here
    for prefer in (None, np.isin(np.arange(9), [2, 3])):
        a = check(C, [0.1, -0.2], D=[8], x=np.full(9, 0.5), prefer=prefer)
    assert sorted(a.dependent) == [2, 3]


@pytest.mark.parametrize("length", [2, 5, 33])
def test_long_chain_of_preferred_nodes(length):
    """A chain is eliminated through all its links, whatever the order of its rows."""
    C = np.eye(length, length + 1) - np.eye(length, length + 1, 1)
    order = np.random.default_rng(length).permutation(length)
    prefer = np.arange(length + 1) < length
    a = check(C[order], np.ones(length), prefer=prefer, tolerance=1e-11)
    assert a.independent.tolist() == [length]
    assert_allclose(a.T.toarray(), 1.0, rtol=0, atol=TIGHT)


def test_corner_node_in_two_rows():
    """A node held by two walls, not at right angles, gives up both components."""
    C = np.zeros((2, 6))
    C[0, :4] = 0.8, 0.6, -0.8, -0.6
    C[1, [0, 1, 4, 5]] = 0.9, 0.1, -0.9, -0.1
    prefer = np.arange(6) < 2
    assert sorted(check(C, [0.1, 0.2], prefer=prefer).dependent) == [0, 1]


@pytest.mark.parametrize("prefer", [None, [True, True, False, False], [False, False, True, True]])
def test_largest_components_coincide(prefer):
    """Two independent rows with the same largest component have rank two, not one."""
    prefer = None if prefer is None else np.array(prefer)
    check([[0.8, 0.6, -0.8, -0.6], [-0.9, -0.436, 0.9, 0.436]], [0.1, 0.2], prefer=prefer)


@pytest.mark.parametrize("degrees", [0, 20, 45, 90, 135, 225])
def test_tied_nodes(degrees):
    """Normal and tangential rows of one node are eliminated together at every angle."""
    angle = np.radians(degrees)
    n, t = [np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]
    C = np.zeros((6, 14))
    for i in range(3):  # nodes 0..2 on segments of nodes 3..6
        for row, v in ((2 * i, n), (2 * i + 1, t)):
            C[row, 2 * i : 2 * i + 2] = v
            C[row, 6 + 2 * i : 8 + 2 * i] = -0.3 * np.array(v)
            C[row, 8 + 2 * i : 10 + 2 * i] = -0.7 * np.array(v)
    a = check(C, np.arange(6.0), prefer=np.arange(14) < 6)
    assert sorted(a.dependent) == list(range(6))
    # the map of a tied node is its interpolation, whatever the frame it is written in
    assert_allclose(a.T[0].toarray().ravel()[[0, 2]], [0.3, 0.7], rtol=0, atol=TIGHT)


def test_sticking_nodes_in_three_dimensions():
    """Three rows per node in a common frame along (1, 1, 1), where all components tie."""
    frame = np.array([[1, 1, 1], [1, -1, 0], [1, 1, -2]])
    frame = frame / np.linalg.norm(frame, axis=1)[:, None]
    C = np.kron(np.array([[1, 0, -0.5, -0.5], [0, 1, -0.2, -0.8]]), frame)
    assert sorted(check(C, np.ones(6), prefer=np.arange(12) < 6).dependent) == list(range(6))


def test_both_pass_contact():
    """Surfaces that are secondary to each other: rows are coupled in cycles."""
    C = np.zeros((6, 6))
    for i in range(3):
        C[i, i], C[i, 3 + i], C[i, 3 + (i + 1) % 3] = 1, -0.6, -0.4
    C[3, [3, 0]], C[4, [4, 1]], C[5, [5, 2]] = (1, -1), (1, -1), (1, -1)
    a = check(C, np.zeros(6), prefer=np.ones(6, bool))
    assert len(a.redundant) == 1  # everything moves together, and only that


@pytest.mark.parametrize("prefer", [None, np.ones(4, bool)])
def test_cycle(prefer):
    """u0 = u1 = u2 = u0: the third row follows from the others."""
    C = np.array([[1, -1, 0, 0], [0, 1, -1, 0], [-1, 0, 1, 0]])
    assert len(check(C, [1, 2, -3], prefer=prefer).redundant) == 1
    with pytest.raises(ConstraintError) as error:
        eliminate(C, [1, 2, 3], prefer=prefer)
    assert sorted(error.value.rows) == [0, 1, 2]


# ------------------------------------------------------------ redundant, contradictory, prescribed


def test_redundant_rows_are_dropped():
    """A repeated, a scaled and a combined row change nothing and carry no force."""
    C = np.array([[1.0, 2, 0, 0, -1], [0, 1, 1, 0, 0]])
    rows = np.vstack([C, C[0], 1e6 * C[1], C[0] - 3 * C[1], np.zeros(5)])
    b = np.array([0.1, 0.2, 0.1, 0.2e6, -0.5, 0.0])
    assert len(check(rows, b).redundant) == 4


def test_contradictory_rows_are_named():
    """Rows that cannot hold together are named, and those that do not matter are not."""
    C = [[1, -1, 0, 0], [0, 0, 1, 1], [2, -2, 0, 0]]
    with pytest.raises(ConstraintError, match=r"row 2 asks for 0\.4, but with row 0 it is 0\.2"):
        eliminate(C, [0.1, 0.0, 0.4], prefer=np.array([1, 0, 0, 0], bool))
    with pytest.raises(ConstraintError, match=r"tip.*toe.*Usually a node is constrained twice") as e:
        eliminate(C, [0.1, 0.0, 0.4], labels=["toe", "heel", "tip"])
    assert sorted(e.value.rows) == [0, 2]
    with pytest.raises(ConstraintError, match="point 0"):
        eliminate(C, [0.1, 0.0, 0.4], labels=lambda row: f"point {row}")


def test_contradiction_by_a_small_amount():
    """A difference of 1e-8 of the values is a contradiction, one of 1e-14 is round-off."""
    C, b = np.array([[1.0, -1.0], [1.0, -1.0]]), 7.0
    assert len(eliminate(C, [b, b * (1 + 1e-14)]).redundant) == 1
    with pytest.raises(ConstraintError):
        eliminate(C, [b, b * (1 + 1e-8)])


def test_scale_tells_round_off_from_gaps():
    """Gaps of 1e-17 contradict each other unless they came from coordinates of order one."""
    C = np.array([[1.0, -1.0], [1.0, -1.0]])
    with pytest.raises(ConstraintError, match="pass their size as scale"):
        eliminate(C, [1e-17, -2e-17])
    assert len(eliminate(C, [1e-17, -2e-17], scale=1.0).redundant) == 1


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_units_do_not_matter(unit):
    """Metres to nanometres: the same rows are redundant, the same contradict."""
    C = unit**0.5 * np.array([[0.6, 0.8, -1.0], [0.6, 0.8, -1.0]])
    assert len(eliminate(C, unit * np.array([1.0, 1.0 + 1e-13])).redundant) == 1
    with pytest.raises(ConstraintError):
        eliminate(C, unit * np.array([1.0, 1.0 + 1e-7]))


def test_round_off_of_many_rows_adds_up():
    """Rows round a ring that are each as good as their numbers say are no contradiction."""
    n = 100
    C = sp.eye(n, format="csr") - sp.csr_matrix(np.roll(np.eye(n), 1, axis=1))
    b = np.where(np.arange(n) % 2, 1.0, -1.0)  # around the ring they add up to zero
    assert len(eliminate(C, b).redundant) == 1
    # every value is good to some 1e-10 of the largest, and the last row adds them all up
    assert len(eliminate(C, b + 5e-11).redundant) == 1
    with pytest.raises(ConstraintError):
        eliminate(C, b + 1e-8)


def test_a_column_of_few_rows_is_given_up():
    """Of coefficients alike, that one which no other row has: nothing is coupled that need not be."""
    star = [[1.0, 1, 0, 0], [1.0, 0, 1, 0], [1.0, 0, 0, 1]]
    a = check(star, [0.0, 0.1, 0.2])
    assert a.independent.tolist() == [0]
    assert set(find_pivots(sp.csr_matrix(np.array(star)), None).columns) == {1, 2, 3}


def test_partly_prescribed_rows():
    """Prescribed DOFs are no pivots and their values move to the right-hand side."""
    x = np.array([3.0, 0, 0, -1.0, 0])
    a = check([[5.0, 1, -1, 0, 0], [0, 0, 1, 2, 1]], [1.0, 2.0], D=[0, 3], x=x)
    assert set(a.dependent) <= {1, 2, 4}


def test_fully_prescribed_rows():
    """A row over prescribed DOFs only is checked: satisfied, or named."""
    C, x = [[1, -1, 0, 0], [0, 0, 1, 1]], np.array([0.5, 0.2, 0, 0])
    assert check(C, [0.3, 1.0], D=[0, 1], x=x).redundant.tolist() == [0]
    with pytest.raises(
        ConstraintError,
        match=r"row 0 asks for 0\.4, but its DOFs are all prescribed and make it 0\.3",
    ) as error:
        eliminate(C, [0.4, 1.0], D=[0, 1], x=x)
    assert error.value.rows == (0,)


def test_free_part_of_round_off_is_no_free_part():
    """A normal of (1, 1e-16) on rollers in x is checked, not solved for a y of 1e16."""
    C = [[1.0, 1e-16, -1.0, -1e-16]]
    assert eliminate(C, [0.0], D=[0, 2]).redundant.tolist() == [0]
    with pytest.raises(ConstraintError):
        eliminate(C, [0.1], D=[0, 2])


def test_rows_that_become_dependent_by_prescribing():
    """Independent rows whose free parts coincide are compared through the prescribed values."""
    C, x = [[1, 1, 0], [0, 1, 1]], np.array([0.4, 0, 0.7])
    assert len(check(C, [1.0, 1.3], D=[0, 2], x=x).redundant) == 1
    with pytest.raises(ConstraintError):
        eliminate(C, [1.0, 1.0], D=[0, 2], x=x)


# --------------------------------------------------------------------------------- properties


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.05, 0.9), hint=st.booleans())
def test_random_sparse_rows(seed, share, hint):
    """Random rows, some repeated or combined, random D and x: as the saddle-point system."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 25))
    k = int(rng.integers(1, max(2, n // 2)))
    # small integers: dependent rows are exactly so, and frequent
    C = rng.integers(-2, 3, (k, n)) * (rng.random((k, n)) < share)
    C = np.vstack([C, rng.integers(-1, 2, (2, k)) @ C]) * 2.0 ** rng.integers(-3, 4, (k + 2, 1))
    u = rng.integers(-5, 6, n)  # one vector that satisfies them all
    D = rng.choice(n, rng.integers(0, n // 2), replace=False)
    free = np.delete(C, D, axis=1)
    values = np.linalg.svd(free, compute_uv=False)
    nonzero = values[values > 1e-9]
    if len(nonzero) and nonzero[-1] < 1e-2 * nonzero[0]:
        return  # ill-conditioned by chance: the bounds of `check` are not meant for these
    prefer = rng.random(n) < 0.4 if hint else None
    check(C, C @ u, D, u.astype(float), rng=rng, prefer=prefer, tolerance=1e-11)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_order_of_rows_does_not_matter(seed):
    """Permuted rows and DOFs span the same vectors."""
    rng = np.random.default_rng(seed)
    C = rng.normal(size=(5, 12)) * (rng.random((5, 12)) < 0.5)
    b = C @ rng.normal(size=12)
    rows, columns = rng.permutation(5), rng.permutation(12)
    a = eliminate(C, b)
    permuted = eliminate(C[rows][:, columns], b[rows])
    assert permuted.T.shape == a.T.shape
    # b was made from C, so both satisfy each other's rows; pivots of random rows may be poor
    assert_allclose(C[:, columns] @ permuted.T, 0.0, atol=1e-9)
    assert_allclose(C[:, columns] @ permuted.c, b, rtol=0, atol=1e-9)


# ------------------------------------------------------------------------- unsymmetric reduction


def test_petrov_galerkin():
    """Trial from B_n, test from B_n - mu B_t: gaps along the former, forces along the latter."""
    rng = np.random.default_rng(3)
    n, m, mu = 16, 3, 0.4
    K, f = spd(n, rng)
    B_n, B_t = rng.normal(size=(2, m, n))
    W = B_n - mu * B_t
    D, x = np.array([2, 9]), np.linspace(0, 1, n)
    trial = eliminate(B_n, np.ones(m), D, x, prefer=np.arange(n) < n // 2)
    test = eliminate(W, np.zeros(m), D, prefer=np.arange(n) >= n // 2)
    assert not np.array_equal(trial.independent, test.independent)
    K_r, f_r = trial.reduce(K, f, test=test)
    u = trial.expand(np.linalg.solve(K_r.toarray(), f_r))
    p = test.multipliers(K @ u - f)

    E = np.eye(n)[D]
    A = np.zeros((n + m + 2, n + m + 2))
    A[:n, :n], A[:n, n:], A[n:, :n] = K, -np.vstack([W, E]).T, np.vstack([B_n, E])
    solution = np.linalg.solve(A, np.concatenate([f, np.ones(m), x[D]]))
    assert_allclose(u, solution[:n], rtol=0, atol=1e-11)
    assert_allclose(p, solution[n : n + m], rtol=0, atol=1e-10)
    assert_allclose(test.reactions(K @ u - f, p), solution[n + m :], rtol=0, atol=1e-10)


def test_petrov_galerkin_needs_equal_ranks():
    """A test space of another size is refused."""
    trial, test = eliminate([[1, -1, 0]], [0]), eliminate([[1, -1, 0], [0, 1, -1]], [0, 0])
    with pytest.raises(InputError, match="would not be square"):
        trial.reduce(np.eye(3), test=test)


def test_contact_rows_of_closed_points_only():
    """Points that are open have no row, whether the mask is of bools or of zeros and ones."""
    e = fem.ElementVector(fem.ElementQuad1())
    low = fem.Basis(fem.MeshQuad().refined(2).with_defaults(), e)
    top = fem.Basis(fem.MeshQuad().refined(2).translated((0.0, 1.25)).with_defaults(), e)
    a, b = (sc.Body(basis, linear_elasticity(), name=n) for basis, n in ((low, "low"), (top, "top")))
    system, contact = sc.bodies.stack([a, b]), sc.Contact(b.surface("bottom"), a.surface("top"))
    every = sc.elimination.contact_rows(system, contact)
    closed = np.array([True, False, True, True, False])
    for mask in (closed, closed.astype(int)):
        rows = sc.elimination.contact_rows(system, contact, mask)
        assert_allclose(rows.C.toarray(), every.C.toarray()[closed], atol=0)
        assert_allclose(rows.b, -0.25, rtol=1e-12)
        assert list(rows.labels) == [
            label for label, on in zip(every.labels, closed, strict=True) if on
        ]


# -------------------------------------------------------------------------------- scikit-fem


@pytest.fixture(scope="module")
def blocks():
    """Two blocks of steel in one stacked system, the upper on the lower: K, M, rows, D, x."""
    lower = fem.MeshQuad.init_tensor(np.linspace(0, 2, 7), np.linspace(0, 1, 4))
    upper = fem.MeshQuad.init_tensor(np.linspace(0, 2, 7), np.linspace(1, 2, 4))
    bases = [fem.Basis(m, fem.ElementVector(fem.ElementQuad1())) for m in (lower, upper)]
    stiffness = linear_elasticity(*lame_parameters(1.0, 0.3))
    mass = fem.BilinearForm(lambda u, v, w: fem.helpers.dot(u, v))
    K = sp.block_diag([stiffness.assemble(basis) for basis in bases], format="csr")
    M = sp.block_diag([mass.assemble(basis) for basis in bases], format="csr")
    half, n = bases[0].N, K.shape[0]
    top = bases[0].get_dofs(lambda x: x[1] == 1.0).flatten()
    bottom = bases[1].get_dofs(lambda x: x[1] == 1.0).flatten() + half
    C = sp.csr_matrix((len(top), n))
    C = sp.eye(n, format="csr")[bottom] - sp.eye(n, format="csr")[top]
    ground = bases[0].get_dofs(lambda x: x[1] == 0.0)
    lid = bases[1].get_dofs(lambda x: x[1] == 2.0).all("u^2") + half
    x = np.zeros(n)
    x[lid] = -0.1
    rows = SimpleNamespace(C=C, b=np.zeros(len(top)), prefer=np.arange(n) >= half)
    return SimpleNamespace(K=K, M=M, rows=rows, ground=ground, lid=lid, x=x, n=n, half=half)


@pytest.mark.parametrize(
    ("solver", "tolerance"),
    [
        (None, 1e-12),
        # the residual is 1e-13 of the load, K_r has a condition of order 1e3
        (fem.solver_iter_pcg(rtol=1e-13, maxiter=5000), 1e-9),
    ],
)
def test_skfem_solve(blocks, solver, tolerance):
    """skfem.solve(*condense(...)) solves the tied system, by direct and iterative solvers."""
    D = np.union1d(blocks.ground.flatten(), blocks.lid)
    f = 1e-3 * np.sin(np.arange(blocks.n))
    system = condense(blocks.K, f, rows=blocks.rows, D=D, x=blocks.x)
    assert isinstance(system[0], sp.csr_matrix)
    assert system[0].indices.dtype == system[0].indptr.dtype == np.int32
    u = fem.solve(*system, solver=solver)
    oracle, _ = saddle(blocks.K.toarray(), f, blocks.rows.C.toarray(), blocks.rows.b, D, blocks.x)
    assert_allclose(u, oracle, rtol=0, atol=tolerance)


def test_condense_takes_dofs_of_scikit_fem(blocks):
    """D may be an array, a DofsView, a dict of them or a mask; rows a tuple; f may be missing."""
    views = {"ground": blocks.ground}
    mask = np.isin(np.arange(blocks.n), blocks.ground.flatten())
    rows = (blocks.rows.C, blocks.rows.b)
    u = [fem.solve(*condense(blocks.K, np.ones(blocks.n), rows=rows, D=D))
         for D in (blocks.ground.flatten(), blocks.ground, views, mask)]  # fmt: skip
    for other in u[1:]:
        assert_allclose(other, u[0], rtol=0, atol=0)
    assert not fem.solve(*condense(blocks.K, None, rows=rows, D=views)).any()
    plain = fem.solve(*fem.condense(blocks.K + blocks.M, np.ones(blocks.n), D=blocks.ground))
    ours = fem.solve(*condense(blocks.K + blocks.M, np.ones(blocks.n), D=blocks.ground))
    assert_allclose(ours, plain, rtol=1e-10)


@pytest.mark.parametrize(
    "solver", [fem.solver_eigen_scipy_sym(sigma=0, k=4), fem.solver_eigen_scipy(sigma=0, k=4)]
)
def test_eigenmodes(blocks, solver):
    """Tied blocks vibrate as the eigenvectors of the system restricted to the null space."""
    from scipy.linalg import eigh, null_space

    L, modes = fem.solve(
        *condense(blocks.K, blocks.M, rows=blocks.rows, D=blocks.ground, x=blocks.x), solver=solver
    )
    E = np.eye(blocks.n)[blocks.ground.flatten()]
    Z = null_space(np.vstack([blocks.rows.C.toarray(), E]))
    oracle = eigh(Z.T @ blocks.K @ Z, Z.T @ blocks.M @ Z, eigvals_only=True)[:4]
    assert_allclose(np.sort(L.real), oracle, rtol=1e-9)  # ARPACK at its default tolerance
    assert modes.shape == (blocks.n, 4)
    assert np.isrealobj(modes)
    assert_allclose(blocks.rows.C @ modes, 0.0, atol=TIGHT)
    assert not modes[blocks.ground.flatten()].any()


def test_complex_modes_of_a_real_system_are_refused():
    """A rotation has complex modes, which do not fit into real vectors; a complex K takes them."""
    K, M = sp.csr_matrix([[0.0, 1.0], [-1.0, 0.0]]), sp.identity(2, format="csr")
    modes = np.array([1.0, 1.0j])
    with pytest.raises(InputError, match="solver_eigen_scipy_sym"):
        condense(K, M)[3][1](modes)
    assert_allclose(condense(K.astype(complex), M)[3][1](modes), modes, rtol=0, atol=0)


# ---------------------------------------------------------------------------------- input


def test_inputs_are_not_modified():
    """float32, integer and read-only inputs give the same answer and stay as they are."""
    C = sp.csr_matrix(np.array([[1.0, 0, -1, 0], [0, 2, 0, -1]]))
    b, x = np.array([1.0, 2.0]), np.array([0, 0, 0, 0.5])
    a = eliminate(C, b, [3], x)
    for kind in (np.float32, np.int64):
        other = eliminate(C.astype(kind), b.astype(kind), np.array([3], dtype=np.int32), x)
        assert_allclose(other.T.toarray(), a.T.toarray(), rtol=0, atol=0)
    # duplicate entries and explicit zeros, unsorted, in read-only memory
    entries = (np.array([-1.0, 0.25, 0.75, 0, -1, 2]), np.array([2, 0, 0, 1, 3, 1]), [0, 4, 6])
    messy = sp.csr_matrix((entries[0].copy(), entries[1].copy(), entries[2]), shape=(2, 4))
    for array in (messy.data, messy.indices, messy.indptr, b, x):
        array.flags.writeable = False
    other = eliminate(messy, b, [3], x)
    assert_allclose(other.T.toarray(), a.T.toarray(), rtol=0, atol=0)
    assert_allclose(other.c, a.c, rtol=0, atol=0)
    assert np.array_equal(messy.data, entries[0])
    assert np.array_equal(messy.indices, entries[1])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"b": [1.0]}, r"b has shape \(1,\), but \(2,\) is needed"),
        ({"b": [1.0, np.nan]}, "b holds NaN or infinite numbers: 1 of 2 entries, the first in entry 1"),
        ({"b": [1.0, 1j]}, "b is complex"),
        (
            {"C": np.array([[1, 0, 0, 0], [0, np.inf, 0, 0]])},
            "C holds NaN or infinite numbers: 1 of 2 entries, the first in row 1",
        ),
        ({"C": 1j * np.ones((2, 4))}, "C is complex"),
        ({"D": [4]}, "D has numbers from 4 to 4, but there are DOFs 0 to 3"),
        ({"D": [-1]}, "D has numbers from -1 to -1"),
        ({"D": [0.5]}, "D is an array of float64, .* not of DOF numbers"),
        ({"D": [0], "x": [1.0]}, r"x has shape \(1,\)"),
        ({"D": [3], "x": [0, 0, 0, np.nan]}, "x holds NaN or infinite numbers: .* in entry 3"),
        ({"prefer": [0, 1]}, "give a mask"),
        ({"labels": ["one"]}, "labels has 1 names for 2 rows"),
        ({"scale": -1.0}, "scale = -1.0, but it is a length"),
    ],
)
def test_wrong_input(change, message):
    """Wrong shapes, numbers and DOFs are named."""
    given = {"C": np.eye(2, 4), "b": [0.0, 0.0], **change}
    with pytest.raises(InputError, match=message):
        eliminate(**given)


def test_condense_is_that_of_scikit_fem(blocks):
    """The same arguments in the same order: without rows the same solutions, with I as well as D."""
    f, D = np.ones(blocks.n), blocks.ground.flatten()
    I = np.setdiff1d(np.arange(blocks.n), D)
    A = blocks.K + blocks.M
    expected = fem.solve(*fem.condense(A, f, blocks.x, D=D))
    for system in (
        condense(A, f, blocks.x, None, D),
        condense(A, f, blocks.x, I),
        condense(A, f, x=blocks.x, I=I),
    ):
        assert_allclose(fem.solve(*system), expected, rtol=1e-12, atol=1e-14)
    theirs = list(inspect.signature(fem.condense).parameters)
    assert list(inspect.signature(condense).parameters)[: len(theirs)] == theirs
    A_r, b_r = condense(A, f, D=D, expand=False)
    assert A_r.shape == (len(I), len(I)) and b_r.shape == I.shape
    with pytest.raises(InputError, match="I and D are both given"):
        condense(A, f, I=I, D=D)
    with pytest.raises(InputError, match="write rows="):
        condense(A, f, blocks.rows)
    for old in ("K", "f"):
        with pytest.raises(TypeError, match=f"no argument '{old}': write {'A' if old == 'K' else 'b'}"):
            condense(**{"A": A, old: A})


def test_wrong_system():
    """K and f that do not fit the constraint, or are not finite, are named."""
    a = eliminate(np.eye(2, 4), [0, 0])
    with pytest.raises(InputError, match=r"K has shape \(3, 3\), but the constraint is for n = 4"):
        a.reduce(np.eye(3))
    with pytest.raises(InputError, match=r"f holds NaN or infinite numbers: .* in entry 2"):
        a.reduce(np.eye(4), [0, 0, np.inf, 0])
    with pytest.raises(InputError, match="u_r has shape"):
        a.expand([1.0])
    with pytest.raises(InputError, match="A has NaN"):
        condense(np.diag([1.0, np.nan]))
    with pytest.raises(InputError, match="mass matrix has NaN"):
        condense(np.eye(2), sp.csr_matrix(np.diag([1.0, np.nan])))
    with pytest.raises(InputError, match=r"K has shape \(3, 3\)"):
        condense(np.eye(3), None, rows=(np.eye(2, 4), [0, 0]))
    # values of x away from D are not read
    assert eliminate(np.eye(1, 3), [0], [2], [np.nan, np.nan, 1.0]).c.tolist() == [0, 0, 1]


# ---------------------------------------------------------------------------------- pivoting


def test_pivot_columns_are_inverted():
    """The inverse is that of the pivot columns, for a triangle of blocks of size one and two."""
    rng = np.random.default_rng(5)
    A = np.zeros((6, 12))
    A[:4, :4] = np.kron(np.eye(2), [[0.8, 0.6], [-0.6, 0.8]])
    A[0, 2], A[2, 4], A[4, 4], A[5, 5], A[4, 5] = 0.3, -0.4, 1, 1, 0.5
    A[:, 6:] = 0.05 * rng.normal(size=(6, 6))
    pivots = find_pivots(sp.csr_matrix(A), np.arange(12) < 6)
    assert sorted(pivots.columns) == list(range(6))
    dense = A[pivots.rows][:, pivots.columns]
    assert_allclose(pivots.inverse @ dense, np.eye(6), rtol=0, atol=TIGHT)
    # the blocks stay apart: the third node's rows do not see the first's
    assert np.all(pivots.inverse.toarray()[2:, :2] == 0)


def test_many_tied_rows_stay_small_blocks():
    """Tied nodes in a 45 degree frame on a matching mesh do not grow into one large block."""
    m = 200
    nodes = np.kron(sp.eye(m).toarray(), [[1, 1], [-1, 1]]) / np.sqrt(2)
    C = sp.csr_matrix(np.hstack([nodes, -nodes]))
    for prefer in (None, np.arange(4 * m) < 2 * m, np.arange(4 * m) >= 2 * m):
        a = eliminate(C, np.zeros(2 * m), prefer=prefer)
        assert a.pivot_inverse.nnz <= 4 * m
        assert a.T.nnz == 4 * m  # each dependent DOF is that of its partner


def test_blocks_leave_pivots_of_others_alone():
    """Two rows that want the same column settle it without the larger entry of a third row's."""
    A = np.array([[1.0, 0.5, 0.8, 0.0], [1.0, -0.4, -0.8, 0.0], [0.0, 0.0, 0.9, 1.0]])
    pivots = find_pivots(sp.csr_matrix(A), np.array([True, True, True, False]))
    assert sorted(pivots.columns[:2]) == [0, 1]
    assert pivots.columns[2] == 2
    assert_allclose(pivots.inverse @ A[:, pivots.columns], np.eye(3), rtol=0, atol=TIGHT)


def test_chained_tied_rows_stay_small_blocks():
    """In a tied chain in a 45 degree frame every pair of rows gives up its own node."""
    m = 20
    frame = np.array([[1, 1], [-1, 1]]) / np.sqrt(2)
    C = np.kron(np.eye(m, m + 1) - np.eye(m, m + 1, 1), frame)
    pivots = find_pivots(sp.csr_matrix(C), np.arange(2 * m + 2) < 2 * m)
    assert np.array_equal(pivots.columns // 2, np.arange(2 * m) // 2)
    # a sum of up to m terms of order one
    assert_allclose(pivots.inverse @ C[:, pivots.columns], np.eye(2 * m), rtol=0, atol=m * TIGHT)
