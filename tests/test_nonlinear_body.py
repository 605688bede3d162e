"""Bodies that are not linear, without contact: their equations, Newton's method on them, and words."""

from __future__ import annotations

import dataclasses
import importlib.util
import pickle
import sys

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from plain_newton import newton
from skfem.helpers import ddot, det, grad, identity, inv, mul, transpose

import skfem_contact as sc
from skfem_contact.materials import J2, FromFunction, MooneyRivlin, NeoHooke, SaintVenantKirchhoff

E, NU, Y = 210e3, 0.3, 300.0
RADIUS = {"measure": lambda x: 2 * np.pi * x[0]}
ELEMENTS = {
    "quad": (fem.MeshQuad, fem.ElementQuad1, {}),
    "ring": (fem.MeshQuad, fem.ElementQuad1, RADIUS),
    "quad9": (fem.MeshQuad, fem.ElementQuad2, {}),
    "quad9 ring": (fem.MeshQuad, fem.ElementQuad2, RADIUS),
    "triangle": (fem.MeshTri, fem.ElementTriP2, {}),
    "hexahedron": (fem.MeshHex, fem.ElementHex1, {}),
    "tetrahedron": (fem.MeshTet, fem.ElementTetP2, {}),
}
MATERIALS = {
    "J2": (J2(E, NU, [(Y, 0.0), (400.0, 0.01)], kinematic=E / 50), 2e-3),
    "NeoHooke": (NeoHooke.of(1.0, 0.3), 0.1),
    "MooneyRivlin": (MooneyRivlin(0.3, 0.2, bulk=50.0), 0.1),
    "SaintVenantKirchhoff": (SaintVenantKirchhoff(1.0, 0.3), 0.1),
}


def shaken(kind, away=0.0, refined=1):
    """A distorted mesh of the unit square or cube; its inner nodes are moved."""
    mesh = kind().refined(refined).with_defaults()
    p = mesh.p.copy()
    inside = np.setdiff1d(np.arange(p.shape[1]), mesh.boundary_nodes())
    p[:, inside] += 0.08 * np.sin(np.arange(1, inside.size * len(p) + 1)).reshape(len(p), -1)
    p[0] += away
    return type(mesh)(p, mesh.t, _boundaries=mesh.boundaries)


def basis_of(name, refined=1):
    kind, element, given = ELEMENTS[name]
    mesh = shaken(kind, 0.5, refined)
    return fem.Basis(mesh, fem.ElementVector(element())), given


# ------------------------------------------------------------------------------------------ equations


@pytest.mark.parametrize("name", ELEMENTS)
def test_elastic_material_gives_the_stiffness_of_the_form(name):
    """By points of integration, and by scikit-fem's forms: one matrix, and K u as internal forces."""
    basis, given = basis_of(name)
    steel = sc.Elastic(E, NU)
    linear, other = sc.Body(basis, steel, **given), sc.NonlinearBody(basis, steel, **given)
    by_hand = steel.form(given.get("measure"), axisymmetric=bool(given)).assemble(basis)
    scale = abs(by_hand).max()
    assert bool(linear.by_skfem) == bool(given)  # plane and solid: assembled from its tensor
    for K in (linear.K, other.K):
        assert abs(K - by_hand).max() < 1e-12 * scale
    u = np.cos(np.arange(basis.N))
    for body in (linear, other):
        assert_allclose(body.linearize(u).internal, by_hand @ u, atol=1e-11 * scale)
        assert body.linearize().internal.tolist() == [0.0] * basis.N
    assert (linear.nonlinear, other.nonlinear) == (False, True)
    assert linear.initial_state == other.initial_state == {}


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("name", ELEMENTS)
def test_tangent_is_the_derivative_of_the_internal_forces(name, material):
    """Central differences along two directions, on distorted elements; K is symmetric."""
    law, size = MATERIALS[material]
    basis, given = basis_of(name)
    body = sc.NonlinearBody(basis, law, **given)
    random = np.random.default_rng(5)
    size *= basis.mesh.param()  # of a strain, not of a displacement
    u, before = size * 0.1 * random.normal(size=(2, body.n))
    state = body.linearize(before).state
    K = body.linearize(u, state).K
    assert abs(K - K.T).max() < 1e-15 * abs(K).max()
    for v in random.normal(size=(2, body.n)):
        step = 1e-5 * size
        ahead, behind = (body.linearize(u + s * step * v, state).internal for s in (1, -1))
        error = (ahead - behind) / (2 * step) - K @ v
        assert abs(error).max() < 1e-6 * abs(K @ v).max()


@pytest.mark.parametrize("name", ["quad", "ring", "hexahedron", "tetrahedron"])
@pytest.mark.parametrize("material", MATERIALS)
def test_patch(material, name):
    """A uniform gradient is in equilibrium on any mesh, and the energy is that of the volume."""
    law, size = MATERIALS[material]
    basis, given = basis_of(name)
    body = sc.NonlinearBody(basis, law, **given)
    gradient = size * np.cos(np.arange(1, body.dim**2 + 1)).reshape(body.dim, body.dim)
    if given:  # the radial stress and the hoop stress are alike only without shear
        gradient = size * np.diag([0.7, -0.5])
    u = (gradient @ basis.doflocs)[body.dof_component, np.arange(body.n)]
    _, internal, state = body.linearize(u)
    inside = np.setdiff1d(np.arange(body.n), basis.get_dofs(basis.mesh.boundary_facets()).flatten())
    assert len(inside)
    assert abs(internal[inside]).max() < 1e-12 * abs(internal).max()
    stress = body.stress(u, state)
    assert np.ptp(stress, axis=(2, 3)).max() < 1e-12 * abs(stress).max()


@pytest.mark.parametrize("material", ["NeoHooke", "MooneyRivlin", "SaintVenantKirchhoff"])
@pytest.mark.parametrize("name", ["quad", "hexahedron"])
def test_rigid_rotation(material, name):
    """Turned by 70 degrees: no force, stress or energy; the tangent holds no rigid motion."""
    basis, _ = basis_of(name)
    body = sc.NonlinearBody(basis, MATERIALS[material][0])
    c, s = np.cos(1.2), np.sin(1.2)
    Q = np.eye(body.dim)
    Q[:2, :2] = [[c, -s], [s, c]]
    u = ((Q - np.eye(body.dim)) @ basis.doflocs)[body.dof_component, np.arange(body.n)]
    K, internal, _ = body.linearize(u)
    scale = abs(K.diagonal()).max()
    assert body.finite_strain
    assert abs(internal).max() < 1e-13 * scale
    assert abs(body.stress(u)).max() < 1e-13 * scale
    assert abs(body.energy(u)[0]) < 1e-13 * scale
    values = np.linalg.eigvalsh(K.toarray())
    motions = body.rigid_modes.shape[1]
    assert abs(values[:motions]).max() < 1e-12 * scale < values[motions]


def test_large_bodies_are_looked_at_in_parts(monkeypatch):
    """Elements a few at a time, or all at once: the same."""
    basis, _ = basis_of("hexahedron", 2)
    body = sc.NonlinearBody(basis, MATERIALS["J2"][0])
    u = 1e-3 * np.cos(np.arange(body.n))
    whole = body.linearize(u)
    internals.replace(monkeypatch, "arrays.AT_ONCE", 100_000)
    parts = body.linearize(u)
    assert (whole.K != parts.K).nnz == 0
    assert_allclose(whole.internal, parts.internal, rtol=0)
    for key, value in whole.state.items():
        assert_allclose(value, parts.state[key], rtol=0)


def test_linearize_changes_nothing():
    """Called twice with the same state it answers the same, to the bit."""
    basis, _ = basis_of("quad")
    body = sc.NonlinearBody(basis, MATERIALS["J2"][0])
    u = 2e-3 * np.cos(np.arange(body.n))
    state = body.linearize(u).state
    kept = {key: value.copy() for key, value in state.items()}
    one, two = body.linearize(2 * u, state), body.linearize(2 * u, state)
    assert (one.K != two.K).nnz == 0 and (one.internal == two.internal).all()
    assert all((state[key] == kept[key]).all() for key in kept)
    assert one.state["equivalent_plastic_strain"].max() > state["equivalent_plastic_strain"].max() > 0
    assert body.initial_state["equivalent_plastic_strain"].max() == 0.0


# -------------------------------------------------------------------------------------------- Newton


@pytest.mark.parametrize("material", ["J2", "NeoHooke", "MooneyRivlin"])
def test_newton_converges_quadratically(material):
    """The last three residuals: each about the square of the one before, printed with ``pytest -s``."""
    basis, _ = basis_of("quad", 3)
    law, size = MATERIALS[material]
    body = sc.NonlinearBody(basis, law, D=["bottom", "top"])
    x = np.zeros(body.n)
    x[basis.get_dofs("top").all("u^1")] = size
    x[basis.get_dofs("top").all("u^2")] = -0.5 * size
    _, state, residuals = newton(body, x)
    print(material, *(f"{r:.1e}" for r in residuals))
    a, b, c = [r for r in residuals if r > 1e-12][-3:]
    assert residuals[-1] < 1e-12
    # quadratic: the exponents of the residuals double, as far as round-off lets them
    assert np.log(c / b) / np.log(b / a) > 1.5
    if material == "J2":
        assert (state["equivalent_plastic_strain"] > 0).mean() > 0.3


def test_confined_rubber():
    """Pressed without lateral strain: P = mu (l - 1/l) + lambda ln(l) / l, on any mesh."""
    basis, _ = basis_of("quad", 2)
    sides = [basis.get_dofs(s).all("u^1") for s in ("left", "right")]
    body = sc.NonlinearBody(
        basis,
        NeoHooke(shear=0.4, bulk=1.1),
        D=[*sides, basis.get_dofs("bottom"), basis.get_dofs("top")],
    )
    x, u = np.zeros(body.n), None
    top = basis.get_dofs("top").all("u^2")
    for low in (0.2, 0.4):
        x[top] = -low
        u, _, _ = newton(body, x, u=u)
    stretch, lam = 0.6, 1.1 - 0.8 / 3
    exact = 0.4 * (stretch - 1 / stretch) + lam * np.log(stretch) / stretch
    assert_allclose(body.linearize(u).internal[top].sum(), exact, rtol=1e-12)


def test_energy_of_a_cycle():
    """Sheared beyond yield and back: work is what is stored and dissipated, by the step's order."""
    basis, _ = basis_of("quad", 2)
    body = sc.NonlinearBody(basis, MATERIALS["J2"][0], D=["bottom", "top"])
    top = basis.get_dofs("top").all("u^1")
    errors = []
    for count in (4, 8):
        ends = np.concatenate([np.linspace(0, 1, count + 1)[1:], np.linspace(1, 0, count + 1)[1:]])
        u, state, work, force = np.zeros(body.n), None, 0.0, 0.0
        for at in ends:
            x = np.zeros(body.n)
            x[top] = 0.01 * at
            before = u[top].mean()
            u, state, _ = newton(body, x, state, u)
            now = body.linearize(u, state).internal[top].sum()
            work += 0.5 * (now + force) * (u[top].mean() - before)
            force = now
        stored, lost = body.energy(u, state)
        errors.append(abs((stored + lost) / work - 1))
        assert 0 < stored < 0.3 * lost
    assert errors[1] < 0.01 and errors[1] < 0.6 * errors[0]


def test_replaced_and_pickled():
    """Another load, or another process: the material and its mean dilatation go along."""
    basis, _ = basis_of("ring")
    body = sc.NonlinearBody(basis, MATERIALS["J2"][0], D="bottom", mean_dilatation=False, name="ring")
    u = 1e-3 * np.cos(np.arange(body.n))
    expected = body.linearize(u)
    for other in (
        dataclasses.replace(body, f={"top": (0.0, -1.0)}),
        pickle.loads(pickle.dumps(body)),
    ):
        assert repr(other) == "<NonlinearBody ring: 18 DOFs, 6 prescribed, MeshQuad1 of 4 elements>"
        found = other.linearize(u)
        assert abs(found.K - expected.K).max() == 0 and not other.mean_dilatation
        assert_allclose(found.internal, expected.internal, rtol=0)
    with pytest.raises(sc.errors.InputError, match="no argument 'K'"):
        sc.NonlinearBody(basis, K=body.K)


# ----------------------------------------------------------------------------------- other entrances


@fem.LinearForm
def residual(v, w):
    F = grad(w["u"]) + identity(w["u"])
    G = transpose(inv(F))
    return ddot(0.4 * (F - G) + 0.6 * np.log(det(F)) * G, grad(v))


@fem.BilinearForm
def tangent(u, v, w):
    F = grad(w["u"]) + identity(w["u"])
    G, log_J = transpose(inv(F)), np.log(det(F))
    turned = mul(mul(G, transpose(grad(u))), G)
    change = 0.4 * grad(u) + (0.4 - 0.6 * log_J) * turned + 0.6 * ddot(G, grad(u)) * G
    return ddot(change, grad(v))


def test_forms_give_what_the_material_gives():
    """Neo-Hooke by hand-written forms, as in scikit-fem's examples."""
    basis, _ = basis_of("quad", 2)
    body = sc.NonlinearBody(basis, residual=residual, tangent=tangent, finite_strain=True, D="bottom")
    other = sc.NonlinearBody(basis, NeoHooke(shear=0.4, bulk=0.6 + 0.8 / 3), D="bottom")
    u = 0.03 * np.cos(np.arange(body.n))
    ours, theirs = body.linearize(u), other.linearize(u)
    assert abs(ours.K - theirs.K).max() < 1e-13
    assert_allclose(ours.internal, theirs.internal, atol=1e-14)
    assert body.finite_strain and body.material is None and body.initial_state == {}


def test_forms_with_internal_variables():
    """J2 by forms that read the state before the step, over two steps."""
    law = MATERIALS["J2"][0]
    names = ["plastic_strain", "equivalent_plastic_strain"]

    def answer(w):
        return law(np.asarray(w["u"].grad), {name: getattr(w["prev"], name) for name in names})

    body = sc.NonlinearBody(
        basis_of("quad")[0],
        residual=fem.LinearForm(lambda v, w: ddot(answer(w)[0][:2, :2], grad(v))),
        tangent=fem.BilinearForm(
            lambda u, v, w: np.einsum("ij...,ijkl...,kl...", grad(v), answer(w)[1], grad(u))
        ),
        state=lambda w: answer(w)[2],
        initial={"plastic_strain": np.zeros((3, 3)), "equivalent_plastic_strain": 0.0},
    )
    other = sc.NonlinearBody(body.basis, law, mean_dilatation=False)
    ours = theirs = None
    for u in 2e-3 * np.random.default_rng(1).normal(size=(2, body.n)):
        ours = body.linearize(u, ours and ours.state)
        theirs = other.linearize(u, theirs and theirs.state)
    assert abs(ours.K - theirs.K).max() < 1e-11 * abs(ours.K).max()
    assert_allclose(ours.internal, theirs.internal, atol=1e-12 * abs(ours.internal).max())
    assert_allclose(ours.state[names[1]], theirs.state[names[1]], rtol=1e-12)


def test_a_function_is_a_material():
    """Small strain without internal variables: St. Venant's law by a function."""
    steel = sc.Elastic(E, NU)
    basis, _ = basis_of("quad")
    body = sc.NonlinearBody(basis, lambda H, state: steel(H, state))
    assert abs(body.K - sc.Body(basis, steel).K).max() < 1e-12 * E
    assert not body.finite_strain


@pytest.mark.skipif(importlib.util.find_spec("jax") is None, reason="needs JAX")
def test_an_energy_is_differentiated():
    """Neo-Hooke from its energy, and from its residual alone."""
    import jax.numpy as jnp

    def det2(F):
        return F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]

    def energy(u, w):
        F = u.grad + jnp.eye(2)[:, :, None, None]
        log_J = jnp.log(det2(F))
        return 0.2 * (jnp.sum(F**2, axis=(0, 1)) - 2) - 0.4 * log_J + 0.3 * log_J**2

    def work(u, v, w):
        F = u.grad + jnp.eye(2)[:, :, None, None]
        J = det2(F)
        cofactor = jnp.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])
        P = 0.4 * F + (0.6 * jnp.log(J) - 0.4) / J * cofactor
        return jnp.sum(P * v.grad, axis=(0, 1))

    basis, _ = basis_of("quad", 2)
    other = sc.NonlinearBody(basis, NeoHooke(shear=0.4, bulk=0.6 + 0.8 / 3))
    u = 0.03 * np.cos(np.arange(basis.N))
    for given in ({"energy": energy}, {"residual": work}):
        body = sc.NonlinearBody(basis, **given, finite_strain=True)
        ours, theirs = body.linearize(u), other.linearize(u)
        assert abs(ours.K - theirs.K).max() < 1e-13
        assert_allclose(ours.internal, theirs.internal, atol=1e-14)
    body = sc.NonlinearBody(basis, energy=energy)
    assert_allclose(body.energy(u), other.energy(u), rtol=1e-13)


def test_without_jax_it_is_said(monkeypatch):
    """An energy needs JAX, and the message says how to get it."""
    for name in [m for m in sys.modules if m.startswith("skfem.autodiff")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(sc.errors.InputError, match=r"pip install skfem-contact\[autodiff\]"):
        sc.NonlinearBody(basis_of("quad")[0], energy=lambda u, w: u.grad[0, 0] ** 2)


# ------------------------------------------------------------------------------------------ refused


def bad(P=None, A=None, state=None):
    """A material function with one part of its answer replaced."""
    one = np.eye(2)
    tangent = np.einsum("ik,jl->ijkl", one, one)[..., None, None]

    def law(H, given):
        return (
            H if P is None else P(H),
            tangent if A is None else A(H),
            given if state is None else state,
        )

    return law


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "needs one of"),
        ({"material": NeoHooke(1.0, 1.0), "residual": residual}, "needs one of"),
        ({"material": NeoHooke(1.0, 1.0), "finite_strain": True}, "belong to a residual"),
        ({"material": 3.0}, "not a function"),
        ({"residual": residual}, "tangent of body 'b' is None"),
        ({"residual": residual, "tangent": tangent, "initial": {"p": 0.0}}, "need both"),
        (
            {
                "residual": residual,
                "tangent": tangent,
                "initial": {"plastic strain": 0.0},
                "state": lambda w: {},
            },
            "words without blanks",
        ),
        ({"material": NeoHooke(1.0, 1.0), "mean_dilatation": True, "name": "c"}, None),
        ({"material": bad(), "mean_dilatation": True}, "does not tell the change of volume"),
        ({"material": bad(P=lambda H: H.transpose(2, 3, 0, 1))}, "components first"),
        (
            {"material": bad(A=lambda H: np.ones((2, 2)))},
            "tangent of the material of body 'b' has shape",
        ),
        ({"material": bad(state={"p": 0.0})}, r"returns the internal variables \['p'\]"),
        ({"material": bad(A=lambda H: np.eye(4).reshape(2, 2, 2, 2, 1, 1)[[0, 0]])}, "not symmetric"),
    ],
)
def test_what_is_refused(given, message):
    """Each message names the body, what was found and what is wanted."""
    given = {"name": "b", **given}
    basis = basis_of("quad")[0]
    if message is None:
        sc.NonlinearBody(basis, **given)
        return
    with pytest.raises(sc.errors.InputError, match=message):
        sc.NonlinearBody(basis, **given)


def test_states_and_displacements_that_are_refused():
    """Of another body, of other names."""
    body = sc.NonlinearBody(basis_of("quad")[0], J2(E, NU, Y), name="billet")
    with pytest.raises(sc.errors.InputError, match="18 DOFs"):
        body.linearize(np.zeros(3))
    with pytest.raises(sc.errors.InputError, match=r"u, .* is a function"):
        body.linearize(fem.LinearForm(lambda v, w: v[0]))
    with pytest.raises(sc.errors.InputError, match="state of body 'billet'"):
        body.linearize(np.zeros(body.n), {})
    with pytest.raises(sc.errors.InputError, match="scalar problem"):
        sc.NonlinearBody(fem.Basis(fem.MeshQuad(), fem.ElementQuad1()), J2(E, NU, Y))
    forms = sc.NonlinearBody(body.basis, residual=residual, tangent=tangent)
    for ask in (forms.stress, forms.energy):
        with pytest.raises(sc.errors.InputError, match="given by forms"):
            ask(np.zeros(body.n))
    own = sc.NonlinearBody(body.basis, bad())
    with pytest.raises(sc.errors.InputError, match="does not say its energy"):
        own.energy(np.zeros(body.n))


def test_an_element_that_turns_inside_out_is_named(monkeypatch):
    """The body and the element, by its number in the mesh, though elements are looked at in parts."""
    internals.replace(monkeypatch, "arrays.AT_ONCE", 50_000)
    basis, _ = basis_of("quad", 2)
    u = np.zeros(basis.N)
    element = 11
    u[basis.element_dofs[0, element]] = 0.6
    outside = []
    for rubber in (NeoHooke(1.0, 1.0), MooneyRivlin(1.0, bulk=10.0)):
        body = sc.NonlinearBody(basis, rubber, name="rubber")
        with pytest.raises(
            sc.errors.MaterialError, match=r"body 'rubber', element .* inside out"
        ) as error:
            body.linearize(u)
        outside.append(error.value.element)
    assert outside[0] == outside[1] > 2
    assert basis.element_dofs[0, element] in basis.element_dofs[:, outside[0]]
    forms = sc.NonlinearBody(basis, residual=residual, tangent=tangent, name="rubber")
    with np.errstate(invalid="ignore"), pytest.raises(sc.errors.MaterialError, match="NaN"):
        forms.linearize(u)


@pytest.mark.parametrize("kind", [(fem.MeshTri, fem.ElementTriP1), (fem.MeshTet, fem.ElementTetP1)])
def test_simplices_of_first_order_lock_and_it_is_said(kind):
    """Of materials that keep their volume; others have them without a word."""
    mesh, element = kind
    basis = fem.Basis(mesh(), fem.ElementVector(element()))
    with pytest.warns(sc.ContactWarning, match="Take elements of second order"):
        sc.NonlinearBody(basis, J2(E, NU, Y))
    sc.NonlinearBody(basis, NeoHooke.of(1.0, 0.3))


def test_a_material_of_two_parts_is_refused():
    """What a function has to return is said, not how many values Python could not unpack."""
    basis = basis_of("quad")[0]
    law = FromFunction(lambda H, state: (H, state))
    with pytest.raises(sc.errors.InputError, match=r"(?s)'odd' .* three, \(stress, tangent, state\)"):
        sc.NonlinearBody(basis, law, name="odd").linearize()


def test_nan_of_a_material_is_an_error():
    """Not passed on into a factorisation."""
    law = FromFunction(bad(P=lambda H: np.where(H > 0.5, np.nan, H)))
    body = sc.NonlinearBody(basis_of("quad")[0], law)
    with pytest.raises(sc.errors.MaterialError, match="NaN"):
        body.linearize(np.ones(body.n) * body.basis.doflocs[0])


@pytest.mark.parametrize("given", [{}, {"measure": lambda x: 2 * np.pi * x[0]}])
def test_small_strains_keep_their_digits(given):
    """Below yield forces are K u to round-off, however small strains are: of J too, which is near 1."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    body = sc.NonlinearBody(basis, sc.J2(210e3, 0.3, 300.0), **given)
    u = 1e-9 * np.random.default_rng(1).standard_normal(body.n)
    internal = body.linearize(u).internal
    assert_allclose(internal, body.K @ u, rtol=0, atol=1e-13 * np.abs(internal).max())
