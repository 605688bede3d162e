"""Matrices without entries: LAPACK calls them illegal on stderr, and nobody is to hear of it."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy.linalg
import skfem as fem
from quick_elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.linalg import cholesky, lu


def test_no_equations(capfd):
    """A dense factorisation of no equations has a solution without entries, and says nothing."""
    for factorise in (lu, cholesky):
        known = factorise(np.zeros((0, 0)))
        assert known.solve(np.zeros(0)).shape == (0,) and known.solve(np.zeros((0, 3))).shape == (0, 3)
        assert factorise(np.eye(2)).solve(np.zeros((2, 0))).shape == (2, 0)
    assert cholesky(np.zeros((0, 0))).inverse().shape == (0, 0)
    assert capfd.readouterr() == ("", "")


def test_a_pivot_that_is_missing():
    """Both factorisations name the row without a pivot: of the definite one it has to be positive."""
    for factorise, A in ((cholesky, np.diag([1.0, -1.0])), (lu, np.diag([1.0, 0.0]))):
        with pytest.raises(scipy.linalg.LinAlgError, match="row 1 has no pivot"):
            factorise(A)


@pytest.mark.parametrize("factorise", [cholesky, lu])
def test_even_pivots(factorise):
    """The pivots of a diagonal matrix are its entries; Cholesky's diagonal has their roots."""
    diagonal = np.array([4.0, 1.0, 100.0])
    known = factorise(np.diag(diagonal))
    wanted = np.sqrt(diagonal) if factorise is cholesky else diagonal
    np.testing.assert_allclose(known.diagonal, wanted, rtol=1e-15)
    share = wanted.min() / wanted.max()
    assert known.even(0.99 * share) and not known.even(1.01 * share)
    for unit in (1e-30, 1e30):  # of the stiffness
        known = factorise(unit * np.diag(diagonal))
        assert known.even(0.99 * share) and not known.even(1.01 * share)
    assert factorise(np.zeros((0, 0))).even(1.0)


@pytest.mark.parametrize("n", range(6))
def test_the_sign_of_a_determinant(n):
    """That of NumPy's own, whatever rows are exchanged; of Cholesky's factor it is 1."""
    rng = np.random.default_rng(n)
    for _ in range(8):
        A = rng.standard_normal((n, n))
        assert lu(A).sign == np.linalg.slogdet(A)[0]
        assert cholesky(A @ A.T + np.eye(n)).sign == 1


def test_an_inverse_is_symmetric_to_the_last_bit():
    """The inverse from the factors is that of the matrix, and equal to its transpose."""
    A = np.random.default_rng(1).standard_normal((6, 6))
    A = A @ A.T + np.eye(6)
    inverse = cholesky(A).inverse()
    np.testing.assert_allclose(inverse @ A, np.eye(6), atol=1e-12)  # condition number below 1e3
    np.testing.assert_array_equal(inverse, inverse.T)


@pytest.fixture
def strict(monkeypatch):
    """Earlier versions of SciPy hand empty matrices on to LAPACK; here whoever does so is found out."""

    def guarded(function):
        def call(*args, **settings):
            arrays = [a for arg in args for a in (arg if isinstance(arg, tuple) else (arg,))]
            assert all(np.size(a) for a in arrays), f"{function.__name__} of an empty matrix"
            return function(*args, **settings)

        return call

    for name in ("lu_factor", "lu_solve", "cho_factor", "cho_solve", "qr", "solve_triangular"):
        monkeypatch.setattr(scipy.linalg, name, guarded(getattr(scipy.linalg, name)))


@pytest.mark.pairwise
@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "direct"])
@pytest.mark.parametrize("law", [None, sc.Coulomb(0.3), sc.Coulomb(0.3, stiffness=1e2)], ids=str)
@pytest.mark.parametrize("D", ["top", "all", "none"])
@pytest.mark.parametrize("height", [-0.01, 0.5])
def test_a_report_is_all_that_is_printed(D, law, linear, height, strict, capfd):
    """Held at its top, everywhere or nowhere, on a floor or above it: no word but ours."""
    basis = fem.Basis(
        fem.MeshQuad().refined(1).with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2
    )
    down = basis.project(lambda x: np.stack([0 * x[0], height + 0 * x[0]]))
    held = {"top": "top", "all": np.arange(basis.N), "none": None}[D]
    body = sc.Body(
        basis, linear_elasticity(0.0, 0.5), D=held, x=None if held is None else down, name="block"
    )
    floor = sc.RigidPlane((0, 0), (0, 1))
    solver = sc.ContactSolver(
        body, sc.Contact(body.surface("bottom"), floor, friction=law), linear=linear
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)
        result = solver.solve(throw=False)
        text = str(solver) + str(result)
        result.certificate, result.validity, result.uniqueness, result.u  # noqa: B018
    assert result.converged and "Certificate" in text
    assert capfd.readouterr() == ("", "")
