"""Nearly incompressible bodies: where elements lock it is said, and what to do; elsewhere nothing is.

A rigid cylinder or ball is pressed into a block of rubber; the same with elements of second order is
the truth.
"""

from __future__ import annotations

import pickle
import warnings
from functools import lru_cache

import internals
import numpy as np
import pytest
import skfem as fem
from skfem.helpers import ddot, dot, sym_grad, trace, transpose
from skfem.models.elasticity import lame_parameters, linear_elasticity

import skfem_contact as sc
from skfem_contact.answers import answer_of

KINDS = {
    "quadrilaterals": (fem.MeshQuad, fem.ElementQuad1),
    "triangles": (fem.MeshTri, fem.ElementTriP1),
    "hexahedra": (fem.MeshHex, fem.ElementHex1),
    "tetrahedra": (fem.MeshTet, fem.ElementTetP1),
    "9-node quadrilaterals": (fem.MeshQuad, fem.ElementQuad2),
    "8-node quadrilaterals": (fem.MeshQuad, fem.ElementQuadS2),
    "6-node triangles": (fem.MeshTri, fem.ElementTriP2),
    "27-node hexahedra": (fem.MeshHex, fem.ElementHex2),
    "20-node hexahedra": (fem.MeshHex, fem.ElementHexS2),
    "10-node tetrahedra": (fem.MeshTet, fem.ElementTetP2),
}
TRUE = {2: "9-node quadrilaterals", 3: "27-node hexahedra"}


def rubber(kind, n, nu, form=None):
    """A block of 2 by 1 (2 by 2 by 1), 1 / n the size of its elements, held at its bottom."""
    mesh, element = KINDS[kind]
    side, height = np.linspace(-1, 1, 2 * n + 1), np.linspace(-1, 0, n + 1)
    d = 3 if mesh in (fem.MeshHex, fem.MeshTet) else 2
    basis = fem.Basis(mesh.init_tensor(*[side] * (d - 1), height), fem.ElementVector(element()))
    stiffness = (form or (lambda _, *moduli: linear_elasticity(*moduli)))(
        basis, *lame_parameters(1.0, nu)
    )
    bottom = lambda basis: basis.get_dofs(lambda x: np.isclose(x[-1], -1))  # noqa: E731
    return sc.Body(basis, stiffness, D=bottom, name="rubber")


def pressed(body, depth=0.04, R=4.0):
    """A rigid cylinder or ball pressed into its top; the result, and what was warned of."""
    d = body.dim
    centre = (0.0,) * (d - 1) + (R - depth,)
    tool = sc.RigidCylinder(centre, R) if d == 2 else sc.RigidSphere(centre, R)
    top = body.surface(lambda x: np.isclose(x[-1], 0), name="top")
    solver = sc.ContactSolver(body, sc.Contact(top, tool, name="joint"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", sc.ContactWarning)
        result = solver.solve()
    return result, [str(w.message) for w in caught if w.category is sc.ContactWarning]


@lru_cache
def force(d, nu, n):
    """The true force."""
    return pressed(rubber(TRUE[d], n, nu))[0].force[-1]


@pytest.mark.parametrize(
    ("kind", "n", "nu", "least", "most"),
    [
        # several times the force
        pytest.param("hexahedra", 4, 0.4999, 8, 20, marks=pytest.mark.slow),
        ("quadrilaterals", 8, 0.4999, 5, 8),
        ("triangles", 8, 0.4999, 8, 13),
        pytest.param("tetrahedra", 4, 0.499, 4, 7, marks=pytest.mark.slow),
        # and the least, from both sides of the bounds: 9 %, and what is just above nu = .46
        ("quadrilaterals", 8, 0.49, 1.08, 1.11),
        ("triangles", 4, 0.465, 1.14, 1.17),
        pytest.param("tetrahedra", 4, 0.46, 1.1, 1.25, marks=pytest.mark.slow),
    ],
)
def test_first_order_locks(kind, n, nu, least, most):
    """Forces are too large by the factor that is said, or more: named in the step, once."""
    body = rubber(kind, n, nu)
    result, said = pressed(body)
    factor = result.force[-1] / force(body.dim, nu, 4 if body.dim == 3 else 16)
    assert least < factor < most
    (words,) = (w for w in said if "locks" in w)
    assert words.startswith("Body 'rubber' locks") and "elements of second order" in words
    told = float(words.split("are about ")[1].split(" times")[0])
    assert 0.45 * factor < told < 1.05 * factor  # "or more"
    assert ("locking", "rubber") in result.validity.problems and not result.validity.holds
    assert result.validity.worst >= result.validity.locking["rubber"] / 0.08 > 1
    assert "locking of 'rubber'" in str(result)
    # an error relative to an answer that is many times too large says nothing
    estimate = result.error_estimate
    assert np.isnan(estimate.pressure.total) and "locks" in estimate.unrated


@pytest.mark.parametrize(("kind", "locks"), [("hexahedra", True), ("20-node hexahedra", False)])
def test_coarse_solids(kind, locks):
    """Two elements to the height of a block that is pressed as a whole."""
    result, said = pressed(rubber(kind, 2, 0.4999), 0.02, 1e3)
    assert any("locks" in words for words in said) == locks
    assert (result.validity.locking["rubber"] > 0.5) == locks


@pytest.mark.parametrize("nu", [0.49, 0.4999])
@pytest.mark.parametrize(
    "kind",
    [pytest.param(k, marks=pytest.mark.slow if "hedra" in k else ()) for k in list(KINDS)[4:]],
)
def test_second_order_does_not(kind, nu):
    """Within 12 % of finer meshes with three elements to the height, and nothing is said."""
    body = rubber(kind, 3 if "hedra" in kind else 6, nu)
    result, said = pressed(body)
    assert result.force[-1] == pytest.approx(force(body.dim, nu, 4 if body.dim == 3 else 16), rel=0.12)
    assert not said and result.validity.holds
    assert 0 < result.validity.locking["rubber"] < 0.05
    assert np.isfinite(result.error_estimate.pressure.total)


def one_point(basis, lam, mu):
    """The stiffness with the part of the bulk modulus integrated at the middle of each element."""
    shear = fem.BilinearForm(lambda u, v, w: 2 * mu * ddot(sym_grad(u), sym_grad(v)))
    bulk = fem.BilinearForm(lambda u, v, w: lam * trace(sym_grad(u)) * trace(sym_grad(v)))
    middle = np.full((basis.mesh.dim(), 1), 0.5), np.ones(1)
    reduced = fem.Basis(basis.mesh, basis.elem, quadrature=middle)
    return shear.assemble(basis) + bulk.assemble(reduced)


@pytest.mark.parametrize("kind", ["quadrilaterals", pytest.param("hexahedra", marks=pytest.mark.slow)])
def test_the_way_out_that_is_named(kind):
    """Reduced integration of the bulk modulus: the force is right, and nothing is said.

    As far as nodes see the ball: at nu .3, too, six hexahedra to the height have 4 % less.
    """
    body = rubber(kind, 8 if kind == "quadrilaterals" else 6, 0.4999, one_point)
    result, said = pressed(body)
    true = force(body.dim, 0.4999, 4 if body.dim == 3 else 16)
    assert result.force[-1] == pytest.approx(true, rel=0.06 if body.dim == 2 else 0.12)
    assert not said and result.validity.holds


@pytest.mark.parametrize("kind", ["quadrilaterals", "triangles", "hexahedra", "tetrahedra"])
@pytest.mark.parametrize("nu", [0.0, 0.3, 0.45])
def test_ordinary_materials_are_not_looked_at(kind, nu, monkeypatch):
    """Nothing is measured, and nothing said."""
    internals.replace(monkeypatch, "answers.locked_share", None)
    result, said = pressed(rubber(kind, 4, nu))
    assert not said and result.validity.holds and not result.validity.locking


def test_fine_first_order_meshes_are_not_named():
    """At nu .49 sixteen quadrilaterals to the height give 2 % too much."""
    result, said = pressed(rubber("quadrilaterals", 16, 0.49))
    assert result.force[-1] == pytest.approx(force(2, 0.49, 16), rel=0.025)
    assert not said and result.validity.locking["rubber"] < 0.05


def test_histories_look_once_each_doubling():
    """Sixteen steps of one size: whole bodies are needed in five of them."""
    body = rubber("quadrilaterals", 16, 0.49)
    tool = sc.RigidPlane((0, 0), (0, -1), name="tool")
    top = body.surface(lambda x: np.isclose(x[1], 0), name="top")
    solver = sc.ContactSolver(body, sc.Contact(top, tool, name="joint"))
    steps = list(solver.history([{"motion": {"joint": (0.0, -1e-4 * k)}} for k in range(1, 17)]))
    assert sum("u" in vars(answer_of(result)) for result in steps) in (4, 5)


def test_a_body_keeps_its_material():
    """Where its form stays behind, in another process, its moduli go along."""
    copy = pickle.loads(pickle.dumps(rubber("quadrilaterals", 4, 0.4999)))
    assert copy.form is None
    result, said = pressed(copy)
    assert "locks" in said[0] and result.validity.locking["rubber"] > 0.9


def test_a_form_of_several_materials():
    """Rubber under steel: by elements, from a form that reads coordinates."""

    @fem.BilinearForm
    def layers(u, v, w):
        lam, mu = lame_parameters(
            np.where(w.x[1] < -0.5, 1.0, 1e3), np.where(w.x[1] < -0.5, 0.499, 0.3)
        )
        e = 0.5 * (u.grad + transpose(u.grad))
        return 2 * mu * ddot(e, sym_grad(v)) + lam * trace(e) * trace(sym_grad(v))

    body = rubber("quadrilaterals", 4, 0.3, lambda *_: layers)
    assert body.by_skfem
    K = (body.moduli.bulk / body.moduli.shear).round(6)
    assert sorted(set(K)) == pytest.approx([2.5, 500.0])  # 1 / (1 - 2 nu)
    _, said = pressed(body)
    assert any("locks" in w and "500 times" in w for w in said)


@pytest.mark.parametrize(
    ("kind", "cells", "nu", "least"),
    [
        ("tetrahedra", (4, 2, 2), 0.499, 1.8),
        pytest.param("tetrahedra", (8, 4, 4), 0.499999, 3.5, marks=pytest.mark.slow),
    ],
)
def test_where_hardly_any_change_of_volume_is_left(kind, cells, nu, least):
    """Elements that lock altogether: forces are several times too large, the share is small."""
    results = []
    for element in (fem.ElementTetP1(), fem.ElementTetP2()):
        ends = (2.0, 1.0, 1.0)
        mesh = fem.MeshTet.init_tensor(
            *(np.linspace(0, s, n + 1) for s, n in zip(ends, cells, strict=True))
        )
        basis = fem.Basis(mesh, fem.ElementVector(element))
        bottom = basis.get_dofs(lambda x: np.isclose(x[2], 0))
        body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, nu)), D=bottom, name="rubber")
        ball = sc.RigidSphere((1, 0.5, 4 - 0.03), 3)
        contact = sc.Contact(body.surface(lambda x: np.isclose(x[2], 1)), ball)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sc.ContactWarning)
            results.append(sc.ContactSolver(body, contact).solve())
    first, second = results
    assert first.force[2] < least * second.force[2] < 0  # downwards
    assert first.validity.locking["rubber"] == 1 and "locking of 'rubber'" in str(first)
    assert second.validity.locking["rubber"] < 0.05 and "locks" in first.error_estimate.unrated


@pytest.mark.parametrize(
    ("mesh", "element", "nu"),
    [(fem.MeshTri, fem.ElementTriP1, 0.49999), (fem.MeshQuad, fem.ElementQuad1, 0.499999)],
)
def test_bending_that_locks_altogether(mesh, element, nu):
    """A cantilever whose forces are 84 and 123 times too large; the share is .02 and .01."""
    mesh = mesh.init_tensor(np.linspace(0, 6, 25), np.linspace(0, 0.5, 4))
    basis = fem.Basis(mesh, fem.ElementVector(element()))
    end = basis.get_dofs(lambda x: np.isclose(x[0], 0))
    body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, nu)), D=end, name="rubber")
    tool = sc.RigidCylinder((5.9, 1.4), 1)
    contact = sc.Contact(body.surface(lambda x: np.isclose(x[1], 0.5)), tool)
    with pytest.warns(sc.ContactWarning, match="locks: pressure and shear take turns"):
        result = sc.ContactSolver(body, contact).solve()
    assert result.validity.locking["rubber"] == 1


@pytest.mark.parametrize(("kind", "n", "nu"), [("quadrilaterals", 32, 0.499), ("triangles", 36, 0.49)])
def test_fine_meshes_are_right_at_any_quotient(kind, n, nu):
    """Forces 6 and 3 % too large: the share is below its bound as it should be, and nothing is said."""
    result, said = pressed(rubber(kind, n, nu))
    assert not said and 0.01 < result.validity.locking["rubber"] < 0.08


def assembled(basis, *moduli):
    return linear_elasticity(*moduli).assemble(basis)


@pytest.mark.parametrize("kind", list(KINDS)[:4])
@pytest.mark.parametrize("nu", [0.3, 0.4999])
def test_a_matrix_tells_as_its_form_does(kind, nu):
    """The moduli and the share of a body whose stiffness was assembled by the user."""
    forms, matrices = (rubber(kind, 4, nu, f) for f in (None, assembled))
    assert matrices.form is None
    np.testing.assert_allclose(
        np.ravel(matrices.moduli),
        np.ravel(forms.moduli),
        rtol=1e-9,  # quotients of 1e4, round-off
    )
    (one, said), (other, told) = pressed(forms), pressed(matrices)
    assert other.validity.locking == pytest.approx(one.validity.locking, rel=1e-6)
    assert [w for w in told if "locks" in w] == [w for w in said if "locks" in w]
    assert any("locks" in w for w in told) == (nu > 0.4)


def test_matrices_of_more_than_one_material():
    """Rubber on a foundation still locks; means over rubber and steel are the moduli of neither."""
    plain, on_springs, beside = (
        pressed(rubber("quadrilaterals", 4, 0.4999, make))
        for make in (assembled, on_foundation, half_steel)
    )
    share = plain[0].validity.locking["rubber"]
    assert on_springs[0].validity.locking["rubber"] == pytest.approx(share, rel=0.01)
    assert any("locks" in words for words in on_springs[1])
    assert not any("locks" in words for words in beside[1])


def on_foundation(basis, lam, mu):
    """Springs on all of it, of a twentieth of its stiffness."""
    return assembled(basis, lam, mu) + fem.BilinearForm(lambda u, v, w: 0.1 * dot(u, v)).assemble(basis)


def half_steel(basis, lam, mu):
    left = basis.mesh.elements_satisfying(lambda x: x[0] < 0)
    parts = (
        fem.Basis(basis.mesh, basis.elem, elements=e) for e in (left, np.setdiff1d(range(32), left))
    )
    moduli = ((lam, mu), lame_parameters(10.0, 0.3))
    assert basis.mesh.nelements == 32
    return sum(assembled(part, *m) for part, m in zip(parts, moduli, strict=True))


def test_forms_that_do_not_tell():
    """Of a form that only works on its own basis, nothing is known."""
    values = np.ones(32)

    @fem.BilinearForm
    def own(u, v, w):
        return dot(u, v) * 0 + ddot(sym_grad(u), sym_grad(v)) * values[:, None]

    body = rubber("quadrilaterals", 4, 0.3, lambda *_: own)
    assert body.moduli is None or body.moduli.quotient <= 1
