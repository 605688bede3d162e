"""Every backend against SciPy's sparse solver, and what each says when there is no solution."""

from __future__ import annotations

import dataclasses

import internals
import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from pyamg import smoothed_aggregation_solver
from quick_elasticity import linear_elasticity
from scipy.sparse.linalg import spsolve
from skfem.models.elasticity import lame_parameters
from skfem.utils import solver_direct_scipy, solver_iter_pcg
from threadpoolctl import threadpool_info

from skfem_contact import ContactError
from skfem_contact.errors import InputError, LinearSolveError, SingularMatrix
from skfem_contact.linalg import (
    AMG,
    Backend,
    Direct,
    FromSolver,
    as_linear_solver,
    conjugate_gradients,
    hierarchy,
    single_threaded,
)

_blas = internals.original("linalg._blas")


def modes_of(points: np.ndarray) -> np.ndarray:
    """Translations and rotations of the nodes, whose components are numbered one by one."""
    n, d = points.shape
    component = np.arange(n) % d
    columns = [component == axis for axis in range(d)]
    for a in range(d):
        for b in range(a + 1, d):
            turn = np.where(component == a, -points[:, b], 0.0)
            columns.append(np.where(component == b, points[:, a], turn))
    return np.stack(columns, axis=1).astype(float)


def body(
    dim: int = 2, cells: int = 10, length: float = 1.0, held: bool = True
) -> tuple[sp.csr_matrix, np.ndarray]:
    """Stiffness and positions of a bar of square cells, held at its end x = 0 or not."""
    width = 1.0 if length == 1.0 else length / cells
    side = np.linspace(0.0, width, cells + 1 if length == 1.0 else 2)
    sides = [np.linspace(0.0, length, cells + 1)] + [side] * (dim - 1)
    mesh = (fem.MeshQuad if dim == 2 else fem.MeshHex).init_tensor(*sides)
    element = fem.ElementQuad1() if dim == 2 else fem.ElementHex1()
    basis = fem.Basis(mesh, fem.ElementVector(element), intorder=2)
    K = linear_elasticity(*lame_parameters(210e9, 0.3)).assemble(basis)
    free = np.flatnonzero(basis.doflocs[0] > 0.0) if held else np.arange(basis.N)
    return K[free][:, free], basis.doflocs.T[free]


def unsymmetric(K: sp.csr_matrix) -> sp.csr_matrix:
    """Friction-like: some rows take a share of others."""
    n = K.shape[0]
    return sp.csr_matrix(K + 0.3 * sp.eye_array(n, k=1) @ K @ sp.diags_array(np.arange(n) % 5 / 5))


def name(backend: Backend) -> str:
    """A name that is the same in every process, as running tests in parallel needs it."""
    return "FromSolver" if isinstance(backend, FromSolver) else str(backend)


BACKENDS = [
    Direct(),
    Direct("superlu"),
    FromSolver(solver_direct_scipy()),
    AMG(tol=1e-12),
]


@pytest.mark.pairwise
@pytest.mark.parametrize("backend", BACKENDS, ids=name)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("columns", [(), (1,), (4,), (0,)])
def test_solution(backend, dim, columns):
    """Each backend gives the solution of scipy, for one right-hand side or several."""
    K, points = body(dim, cells=10 if dim == 2 else 4)
    factor = backend.factorize(K, points=points, modes=modes_of(points))
    b = np.random.default_rng(0).standard_normal((len(points), *columns))
    before = b.copy()
    x = factor.solve(b)
    assert x.shape == b.shape
    assert_array_equal(b, before)
    exact = spsolve(K.tocsc(), b).reshape(b.shape) if b.size else b
    # a condition number of 1e3 to 1e4 on top of round-off, or of the tolerance of AMG
    atol = 1e-9 if isinstance(backend, AMG) else 1e-12
    assert_allclose(x, exact, rtol=0, atol=atol * abs(exact).max(initial=0.0))
    assert factor.memory >= 0 and factor.name


@pytest.mark.parametrize("backend", BACKENDS, ids=name)
def test_dense_matrices(backend):
    """An array is a matrix as good as a sparse one, with positions or without."""
    K, points = body(cells=4)
    b = np.random.default_rng(0).standard_normal(len(points))
    exact = spsolve(K.tocsc(), b)
    for given in ({}, {"points": points}):
        x = backend.factorize(K.toarray(), modes=modes_of(points), **given).solve(b)
        assert_allclose(x, exact, rtol=0, atol=1e-9 * abs(exact).max())


@pytest.mark.parametrize("light", [1e-6, 1e-12, 0.0])
@pytest.mark.parametrize("spd", [True, False], ids=["CG", "GMRES"])
def test_amg_counts_a_light_load_beside_a_heavy_one(spd, light):
    """Equations that nothing couples have the digits that they have alone, whatever acts on others."""
    K, points = body(cells=8)
    A = K if spd else unsymmetric(K)
    n, b = len(points), np.random.default_rng(0).standard_normal(len(points))
    shuffled = np.random.default_rng(1).permutation(2 * n)
    both = sp.csr_matrix(sp.block_diag([A, A]))[shuffled][:, shuffled]
    modes = np.kron(np.eye(2), modes_of(points))[shuffled]
    load = np.concatenate([b, light * b[::-1]])
    x = np.empty(2 * n)
    x[shuffled] = AMG(tol=1e-10).factorize(both, modes=modes, spd=spd).solve(load[shuffled])
    for part, of in ((x[:n], b), (x[n:], light * b[::-1])):
        assert np.linalg.norm(A @ part - of) <= 1e-10 * np.linalg.norm(of)


@pytest.mark.parametrize("backend", [Direct(), FromSolver(solver_direct_scipy())], ids=name)
def test_unsymmetric(backend):
    """With spd=False the direct backends solve unsymmetric systems."""
    K, points = body()
    A = unsymmetric(K)
    b = np.random.default_rng(0).standard_normal((len(points), 2))
    exact = spsolve(A.tocsc(), b)
    x = backend.factorize(A, points=points, spd=False).solve(b)
    assert_allclose(x, exact, rtol=0, atol=1e-11 * abs(exact).max())


def test_choice_of_method():
    """Positions and positive definiteness make it multifrontal; otherwise SuperLU steps in."""
    K, points = body()
    assert Direct().factorize(K, points=points).name == "multifrontal Cholesky"
    assert Direct().factorize(K).name == "SuperLU"
    assert Direct().factorize(K, points=points, spd=False).name == "SuperLU"


def test_dissection_beats_minimum_degree_in_3d():
    """In 3-D SuperLU gets its order from the positions, which saves memory."""
    K, points = body(3, cells=9)
    guided = Direct("superlu").factorize(K, points=points).memory
    assert guided < 0.9 * Direct("superlu").factorize(K).memory


@pytest.mark.parametrize("contrast", [1e6, 1e12])
@pytest.mark.parametrize("backend", [Direct(), Direct("superlu")], ids=str)
def test_contrast_is_not_singular(backend, contrast):
    """Stiffnesses that differ by 1e12 are not taken for a free motion, nor cost digits."""
    K, points = body()
    both = sp.block_diag((K, contrast * K), format="csr")
    b = np.ones(2 * len(points))
    b[len(points) :] *= contrast
    x = backend.factorize(both, points=np.concatenate((points, points))).solve(b)
    exact = np.tile(spsolve(K.tocsc(), b[: len(points)]), 2)
    assert_allclose(x, exact, rtol=1e-9, atol=1e-11 * abs(exact).max())


@pytest.mark.parametrize("backend", [Direct(), Direct("superlu")], ids=str)
def test_slender_is_not_singular(backend):
    """A cantilever of 500 elements in a row is soft, not free."""
    K, points = body(cells=500, length=500.0)
    f = np.random.default_rng(0).standard_normal(len(points))
    x = backend.factorize(K, points=points).solve(f)
    # the residual is round-off of |K| |x|, whatever the condition number
    assert np.max(abs(K @ x - f)) < 1e-14 * abs(K).max() * abs(x).max()


@pytest.mark.pairwise
@pytest.mark.parametrize("cells", [3, 10, 40])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("backend", [Direct(), Direct("superlu")], ids=str)
def test_floating_body_is_singular(backend, dim, cells):
    """A free rigid motion is noticed by every direct backend, whatever the mesh."""
    K, points = body(dim, cells=cells if dim == 2 else cells // 5 + 2, held=False)
    with pytest.raises(SingularMatrix, match="rigid motion is left free") as info:
        backend.factorize(K, points=points)
    assert isinstance(info.value, ContactError)
    assert info.value.dof < len(points)
    assert info.value.ratio < 1e-10


def test_one_of_two_bodies_floats():
    """Of two bodies, one of them 1e12 times as stiff, the DOF named is of the one that floats."""
    held, points = body()
    loose, others = body(held=False)
    for factor in (1e-12, 1.0, 1e12):
        K = sp.block_diag((held, factor * loose), format="csr")
        with pytest.raises(SingularMatrix) as info:
            Direct().factorize(K, points=np.concatenate((points, others + (2.0, 0.0))))
        assert info.value.dof >= len(points)


@pytest.mark.parametrize("entry", [0.0, -1.0])
def test_multigrid_refuses_a_dof_without_stiffness(entry):
    """It ended in a residual that is not a number, with divisions by zero on the way."""
    K, points = body()
    K = K.tolil()
    K[7], K[:, 7] = 0.0, 0.0
    K[7, 7] = entry
    with pytest.raises(SingularMatrix) as info:
        AMG().factorize(K.tocsr(), points=points)
    assert info.value.dof == 7


def test_singular_without_symmetry():
    """Equal rows and zero rows are singular for LU as well."""
    A = np.array([[1.0, 2.0, 0.0], [1.0, 2.0, 0.0], [0.0, 1.0, 1.0]])
    for matrix in (A, A * [[0.0], [1.0], [1.0]]):
        with pytest.raises(SingularMatrix, match="singular to working precision"):
            Direct().factorize(sp.csr_matrix(matrix), spd=False)


@pytest.mark.parametrize("dim", [2, 3])
def test_amg_needs_few_iterations_with_rigid_modes(dim):
    """Rigid motions as near-nullspace: 25 iterations for ten digits, far fewer than without."""
    K, points = body(dim, cells=60 if dim == 2 else 10)
    b = np.random.default_rng(0).standard_normal(len(points))
    x = AMG(max_iterations=25).factorize(K, modes=modes_of(points)).solve(b)
    assert np.linalg.norm(K @ x - b) <= 1e-10 * np.linalg.norm(b)
    with pytest.raises(LinearSolveError, match=r"after 25 iterations, above tol=1.0e-10"):
        AMG(max_iterations=25).factorize(K).solve(b)


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_cycle_is_that_of_pyamg(size):
    """With sweeps of whole matrices in double precision, in any unit of the load."""
    K, points = body(3, cells=10)
    K, modes, b = sp.csr_matrix(K), modes_of(points), np.sin(np.arange(len(points)))
    np.random.seed(0)  # noqa: NPY002 (as PyAMG asks for them)
    grids = smoothed_aggregation_solver(
        K,
        B=modes,
        strength=("symmetric", {"theta": 0.0}),
        presmoother=("gauss_seidel", {"sweep": "forward"}),
        postsmoother=("gauss_seidel", {"sweep": "backward"}),
        improve_candidates=None,
    )
    assert len(grids.levels) > 2
    exact = grids.aspreconditioner() @ b
    found = hierarchy(K, modes).cycle(b * size) / size
    # single precision of the finest grid, 6e-8, in sums of some tens of terms
    assert_allclose(found, exact, rtol=0, atol=3e-6 * np.abs(exact).max())


def test_grids_leave_random_numbers_alone_and_repeat():
    """The same matrix has the same grids to the last bit, whatever was drawn before."""
    K, points = body(cells=20)
    cycles = []
    for seed in range(2):
        np.random.seed(seed)  # noqa: NPY002
        state = np.random.get_state()[1].copy()  # noqa: NPY002
        cycles.append(hierarchy(sp.csr_matrix(K), modes_of(points)).cycle(np.ones(len(points))))
        assert_array_equal(np.random.get_state()[1], state)  # noqa: NPY002
    assert_array_equal(*cycles)


def test_amg_does_not_fail_silently():
    """A load that a floating body can not balance is an error with its residual."""
    K, points = body(cells=20, held=False)
    factor = AMG().factorize(K, modes=modes_of(points))
    with pytest.raises(LinearSolveError, match="rigid motion is left free") as info:
        factor.solve(np.ones(len(points)))
    assert info.value.residual > 1e-10
    assert info.value.iterations >= 1
    assert_array_equal(factor.solve(np.zeros(len(points))), 0.0)


def test_amg_does_not_solve_what_is_not_definite():
    """A matrix with a negative eigenvalue has an answer, but not as the stiffness of a body."""
    K, points = body(cells=20)
    one = np.zeros(len(points))
    i, j = len(one) // 2, len(one) // 3
    one[i] = 1.0
    pull = 3.0 * np.sqrt(K[i, i] * K[j, j])  # its diagonal would be refused at once
    negative = sp.csr_matrix(K + sp.csr_matrix(([pull, pull], ([i, j], [j, i])), shape=K.shape))
    with pytest.raises(LinearSolveError, match=r"the residual is") as info:
        AMG(max_iterations=2000).factorize(negative, modes=modes_of(points)).solve(one)
    assert 1 <= info.value.iterations < 2000  # given up at the direction, not after all iterations


def test_conjugate_gradients_end_at_round_off_where_asked():
    """A bar that weak springs alone hold moves by 1e8: its residual is a difference of large terms.

    No iteration makes it smaller. A tolerance of the load alone is then refused; round-off of the terms
    is what can be had, and the springs carry the load.
    """
    K, points = body(cells=20, held=False)
    A = sp.csr_matrix(K / abs(K).max() + 1e-8 * sp.identity(len(points)))
    b = modes_of(points)[:, 0]  # spread over all nodes, along the bar
    cycle = hierarchy(A, modes_of(points)).cycle
    with pytest.raises(LinearSolveError, match=r"above tol=1.0e-13"):
        conjugate_gradients(A, b, cycle, 1e-13, 60)
    x = conjugate_gradients(A, b, cycle, 1e-13, 60, to_round_off=True)
    # the stiffness is of order one, and 1e-16 / 1e-8 of it is round-off beside the springs
    assert_allclose(x, 1e8 * b, rtol=0, atol=1e-6 * 1e8)


@pytest.mark.parametrize("load", [np.nan, np.inf])
def test_conjugate_gradients_do_not_answer_what_is_no_number(load):
    """Zero is no answer to such a load: that nothing converges is said."""
    A = sp.identity(4, format="csr")
    with pytest.raises(LinearSolveError, match="the residual is nan"):
        conjugate_gradients(A, np.array([1.0, load, 0.0, 0.0]), lambda r: r, 1e-10, 10)


def test_amg_solves_unsymmetric():
    """Slipping points make the matrix unsymmetric: GMRES then reaches the same tolerance."""
    K, points = body()
    A = unsymmetric(K)
    factor = AMG(tol=1e-11).factorize(A, spd=False)
    b = np.sin(np.arange(len(points)))
    # the tolerance is on the residual: the condition number of this small body takes some digits
    assert_allclose(factor.solve(b), spsolve(A.tocsc(), b), rtol=1e-6, atol=1e-8)
    assert np.linalg.norm(b - A @ factor.solve(b)) <= 1e-11 * np.linalg.norm(b)


def test_a_solver_that_leaves_a_residual_is_refused():
    """A callable whose answer is far off is named, with the residual, instead of believed."""
    K, points = body()
    factor = as_linear_solver(lambda A, b: 0.5 * spsolve(A.tocsc(), b)).factorize(K)
    with pytest.raises(LinearSolveError, match=r"leaves 5.0e-01 of the load as residual"):
        factor.solve(np.ones(len(points)))


def test_a_stale_preconditioner_is_named():
    """Solvers of scikit-fem keep the preconditioner of the first matrix they saw."""
    solver = as_linear_solver(solver_iter_pcg(rtol=1e-12))
    K, points = body()
    solver.factorize(K).solve(np.ones(len(points)))
    smaller = K.tocsr()[:-4][:, :-4]
    with pytest.raises(LinearSolveError, match="keep the preconditioner of the first matrix"):
        solver.factorize(smaller).solve(np.ones(len(points) - 4))


def test_scikit_fem_solvers():
    """Any solver of scikit-fem will do, as precise as it is."""
    K, points = body()
    b = np.ones((len(points), 2))
    x = as_linear_solver(solver_iter_pcg(rtol=1e-12)).factorize(K).solve(b)
    assert_allclose(x, spsolve(K.tocsc(), b), rtol=1e-8)


def test_bad_solver():
    """NaN, and answers of the wrong shape, are not passed on."""
    K, points = body(cells=2)
    b = np.ones(len(points))
    with pytest.raises(LinearSolveError, match="returned NaN or inf"):
        FromSolver(lambda A, b: b * np.nan).factorize(K).solve(b)
    with pytest.raises(LinearSolveError, match=r"returned shape \(3,\) for \(12,\)"):
        FromSolver(lambda A, b: b[:3]).factorize(K).solve(b)


def test_as_linear_solver():
    """Settings pass, callables are wrapped, anything else is refused with a hint."""
    assert as_linear_solver(Direct()) == Direct()
    assert isinstance(as_linear_solver(solver_direct_scipy()), FromSolver)
    for wrong in ("mumps", Direct, None):
        with pytest.raises(InputError, match="is no linear solver"):
            as_linear_solver(wrong)


def test_messages():
    """Unknown methods, missing positions and matrices that are not square are explained."""
    with pytest.raises(InputError, match="known are 'auto' and 'superlu'"):
        Direct("mumps")
    with pytest.raises(InputError, match=r"shape \(2, 3\) is not square"):
        Direct().factorize(sp.csr_matrix(np.ones((2, 3))))
    with pytest.raises(NotImplementedError):
        Backend().factorize(np.eye(2))


def test_settings_are_values():
    """Backends are frozen and compare by value."""
    assert AMG(tol=1e-6) == AMG(tol=1e-6) != AMG()
    with pytest.raises(dataclasses.FrozenInstanceError):
        Direct().method = "superlu"  # type: ignore[misc]


def test_matrix_is_not_changed():
    """No backend writes to the matrix or the modes, dense or sparse."""
    K, points = body()
    modes = modes_of(points)
    data, before = K.data.copy(), modes.copy()
    for backend in BACKENDS:
        backend.factorize(K, points=points, modes=modes)
    assert_array_equal(K.data, data)
    assert_array_equal(modes, before)


def test_no_blas_is_missed():
    """Extension modules apart, the libraries that are limited are all that threadpoolctl finds."""
    found = {library.filepath for library in _blas().lib_controllers}
    assert found == {pool["filepath"] for pool in threadpool_info() if pool["user_api"] == "blas"}
    assert found


def test_single_threaded():
    """BLAS has one thread inside, and what it had before afterwards."""

    def number() -> list[int]:
        info = threadpool_info()
        return [pool["num_threads"] for pool in info if pool["user_api"] == "blas"]

    before = number()
    with single_threaded:
        assert set(number()) <= {1}
    assert number() == before
