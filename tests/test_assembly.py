"""Bodies whose stiffness is a form: known from one call where it sees gradients alone; from a mesh."""

from __future__ import annotations

import pickle
import re
import tracemalloc

import internals
import numpy as np
import pytest
import skfem as fem
from skfem.helpers import ddot, dot, grad, sym_grad
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.bodies import assembled

#: Mesh, mesh with nodes between the vertices, element, degree that integrates a straight element.
ELEMENTS = {
    "tri3": (fem.MeshTri, fem.MeshTri2, fem.ElementTriP1, 2),
    "tri6": (fem.MeshTri, fem.MeshTri2, fem.ElementTriP2, 4),
    "quad4": (fem.MeshQuad, fem.MeshQuad2, fem.ElementQuad1, 2),
    "quad8": (fem.MeshQuad, fem.MeshQuad2, fem.ElementQuadS2, 4),
    "quad9": (fem.MeshQuad, fem.MeshQuad2, fem.ElementQuad2, 4),
    "tet4": (fem.MeshTet, fem.MeshTet2, fem.ElementTetP1, 2),
    "tet10": (fem.MeshTet, fem.MeshTet2, fem.ElementTetP2, 4),
    "hex8": (fem.MeshHex, fem.MeshHex2, fem.ElementHex1, 2),
    "hex20": (fem.MeshHex, fem.MeshHex2, fem.ElementHexS2, 4),
    "hex27": (fem.MeshHex, fem.MeshHex2, fem.ElementHex2, 4),
}


def mesh_of(kind, n=2, curved=False):
    """A square or cube; `curved` bends its elements, and their edges where they have nodes between."""
    straight, second, element, _ = ELEMENTS[kind]
    t = np.linspace(0, 1, n + 1)
    mesh = straight.init_tensor(*[t] * element().dim)
    if not curved:
        return mesh.with_defaults()
    mesh = second.from_mesh(mesh)
    x = mesh.doflocs
    return type(mesh)(x + 0.1 * np.sin(3 * x[::-1]) * x, mesh.t).with_defaults()


def vector(kind):
    return fem.ElementVector(ELEMENTS[kind][2]())


def assert_same(K, expected):
    # sums of some hundred products, none larger than the largest entry
    assert abs(K - expected).max() <= 1e-13 * abs(expected).max()


@pytest.mark.parametrize("curved", [False, True])
@pytest.mark.parametrize("kind", ELEMENTS)
def test_the_stiffness_is_that_of_scikit_fem(kind, curved):
    """On a basis of the user's, with its points, and from mesh and element; no call of scikit-fem's."""
    mesh, form, degree = mesh_of(kind, 2, curved), linear_elasticity(1.3, 0.7), ELEMENTS[kind][3]
    basis = fem.Basis(mesh, vector(kind), intorder=degree + 1)
    body = sc.Body(basis, form)
    assert_same(body.K, form.assemble(basis))
    assert body.by_skfem == ""
    assert (body.K != body.K.T).nnz == 0  # to the last digit
    assert_same(
        sc.Body.from_mesh(mesh, vector(kind), form).K,
        form.assemble(fem.Basis(mesh, vector(kind), intorder=degree)),
    )


def anisotropic(d, seed, major=True):
    """A form with every coefficient, with or without the symmetry of an energy."""
    A = np.random.default_rng(seed).standard_normal((d, d, d, d))
    A = A + np.transpose(A, (2, 3, 0, 1)) if major else A

    def form(u, v, w):
        return np.einsum("cjek,cj...,ek...", A, grad(v), grad(u))

    return fem.BilinearForm(form)


@pytest.mark.parametrize("kind", ["tri6", "quad4", "tet4", "hex20"])
@pytest.mark.parametrize("major", [True, False])
def test_any_constant_tensor_is_known_from_one_call(kind, major):
    """Anisotropic, with gradients that are not symmetric, without an energy."""
    basis = fem.Basis(mesh_of(kind, 2, True), vector(kind), intorder=4)
    form = anisotropic(basis.mesh.dim(), 3, major)
    made = assembled(form, basis)
    assert made.by_skfem == ""
    assert_same(made.K, form.assemble(basis))
    if not major:
        with pytest.raises(sc.errors.InputError, match="not symmetric"):
            sc.Body(basis, form)


@pytest.mark.parametrize("kind", ["tri3", "hex8"])
def test_conduction_is_known_from_one_call(kind):
    """Scalar elements."""
    basis = fem.Basis(mesh_of(kind, 2, True), ELEMENTS[kind][2](), intorder=3)
    form = fem.BilinearForm(lambda u, v, w: 2.5 * dot(grad(u), grad(v)))
    body = sc.Body(basis, form)
    assert body.by_skfem == ""
    assert_same(body.K, form.assemble(basis))


def test_the_form_is_called_twice_and_then_for_each_function():
    """Beside the two calls that give the tensor, each function is compared with scikit-fem once."""
    calls = []

    @fem.BilinearForm
    def form(u, v, w):
        calls.append(u.shape)
        return ddot(sym_grad(u), sym_grad(v))

    sc.Body.from_mesh(mesh_of("hex8", 3), vector("hex8"), form)
    assert len(calls) == 2 + 24


THIRD = "third argument"
VALUES = "values of u or v"
OWN = "arrays of its own"
FIELD = np.linspace(1.0, 2.0, 9)[:, None] * np.ones((9, 4))


def _energy(u, v):
    return ddot(sym_grad(u), sym_grad(v))


REFUSED = {
    "coordinates": (lambda u, v, w: (1 + w.x[0]) * _energy(u, v), THIRD),
    "size of elements": (lambda u, v, w: w["h"] * _energy(u, v), THIRD),
    "looked for": (lambda u, v, w: (2.0 if "x" in w else 1.0) * _energy(u, v), THIRD),
    "compared": (lambda u, v, w: (2.0 if w == {} else 1.0) * _energy(u, v), THIRD),
    "foundation": (lambda u, v, w: _energy(u, v) + dot(u, v), VALUES),
    "axisymmetric": (lambda u, v, w: _energy(u, v) * w.x[0] + u[0] * v[0] / w.x[0], THIRD),
    "value of one": (lambda u, v, w: _energy(u, v) + 0 * u[0], VALUES),
    "field by element": (lambda u, v, w: FIELD * _energy(u, v), OWN),
    "field by element alone": (lambda u, v, w: FIELD[:, :1] * _energy(u, v), OWN),
    "field by point": (lambda u, v, w: np.array([1.0, 2.0, 1.0, 1.0]) * _energy(u, v), OWN),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_form_that_needs_more_is_assembled_by_scikit_fem(case):
    """And the dry run says so, with the reason."""
    function, why = REFUSED[case]
    basis = fem.Basis(mesh_of("quad4", 3), vector("quad4"), intorder=2)
    form = fem.BilinearForm(function)
    body = sc.Body(basis, form, D="top", name="block")
    assert_same(body.K, form.assemble(basis))
    assert why in body.by_skfem
    floor = sc.RigidPlane((0, 0), (0, 1))
    said = str(sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor)))
    assert f"K was assembled by scikit-fem: {body.by_skfem}" in said


def test_a_form_with_a_number_for_each_of_few_elements_is_compared_with_scikit_fem():
    """Two elements, two numbers: as many as are compared, so that no size tells them apart."""
    stiff = np.array([[1.0], [2.0]])
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 2, 3), np.linspace(0, 1, 2))
    basis = fem.Basis(mesh, vector("quad4"), intorder=2)
    form = fem.BilinearForm(lambda u, v, w: (stiff if u.shape[1] == 2 else 1.0) * _energy(u, v))
    body = sc.Body(basis, form)
    assert "not the same on all elements" in body.by_skfem
    assert_same(body.K, form.assemble(basis))


def test_a_form_that_asks_whether_there_is_a_field_is_assembled_by_scikit_fem():
    """It takes another way where its question is answered, so that it was asked is remembered."""

    def function(u, v, w):
        try:
            stiff = 2.0 + 0 * w.x[0]
        except Exception:
            stiff = 1.0
        return stiff * _energy(u, v)

    basis = fem.Basis(mesh_of("tri3", 2), vector("tri3"), intorder=2)
    body = sc.Body(basis, fem.BilinearForm(function))
    assert THIRD in body.by_skfem
    assert_same(body.K, fem.BilinearForm(function).assemble(basis))


@pytest.mark.parametrize(("share", "known"), [(0.6e-12, True), (1.6e-12, False)])
def test_bilinear_is_meant_to_twelve_digits(share, known):
    """A part that is not bilinear is told from round-off at 1e-12 of the form."""

    @fem.BilinearForm
    def form(u, v, w):
        du, dv = grad(u), grad(v)
        terms = sum(abs(du[i, j] * dv[i, j]) for i in range(2) for j in range(2))
        return sum(du[i, j] * dv[i, j] for i in range(2) for j in range(2)) + share * terms * (
            (du**2 > 1).any(axis=(0, 1)) | (dv**2 > 1).any(axis=(0, 1))
        )

    basis = fem.Basis(mesh_of("quad4", 1), vector("quad4"), intorder=2)
    assert (assembled(form, basis).by_skfem == "") == known


def test_forms_of_another_kind_keep_their_own_assembly():
    """A subclass that assembles by itself; a numbering that keeps no order of components."""

    class Double(fem.BilinearForm):
        def _assemble(self, *given, **more):
            indices, data, *others = super()._assemble(*given, **more)
            return indices, 2 * data, *others

    basis = fem.Basis(mesh_of("quad4"), vector("quad4"), intorder=2)
    plain = linear_elasticity()
    assert_same(sc.Body(basis, Double(plain.form)).K, 2 * plain.assemble(basis))
    shuffled = np.random.default_rng(1).permutation(basis.N).astype(np.int32)
    for name in ("nodal_dofs", "element_dofs"):
        setattr(basis.dofs, name, shuffled[getattr(basis.dofs, name)])
    other = fem.Basis(basis.mesh, basis.elem, intorder=2, dofs=basis.dofs)
    made = assembled(plain, other)
    assert "numbered" in made.by_skfem
    assert_same(made.K, plain.assemble(other))


def test_elements_in_another_order_are_summed_to_the_same_stiffness():
    """A basis may list the elements of its mesh in any order."""
    mesh = mesh_of("tri6", 3, True)
    order = np.random.default_rng(0).permutation(mesh.nelements)
    basis = fem.Basis(mesh, vector("tri6"), intorder=4, elements=order)
    body = sc.Body(basis, linear_elasticity())
    assert body.by_skfem == ""
    assert_same(body.K, linear_elasticity().assemble(basis))


@pytest.mark.parametrize("kind", ["tet10", "quad9"])
def test_elements_are_summed_some_at_a_time(kind, monkeypatch):
    """Whatever their number: large meshes would fill the memory with gradients."""
    mesh, form = mesh_of(kind, 2, True), linear_elasticity(1.3, 0.7)
    mass = fem.BilinearForm(lambda u, v, w: _energy(u, v) + dot(u, v))
    weight = fem.LinearForm(lambda v, w: w.x[0] * v[0])
    whole = [sc.Body.from_mesh(mesh, vector(kind), K, weight) for K in (form, mass)]
    internals.replace(monkeypatch, "arrays.AT_ONCE", 100_000)
    for K, one in zip((form, mass), whole, strict=True):
        body = sc.Body.from_mesh(mesh, vector(kind), K, weight)
        assert_same(body.K, one.K)
        np.testing.assert_allclose(body.f, one.f, rtol=0, atol=1e-14)


@pytest.mark.slow
def test_a_body_from_a_mesh_takes_little_memory():
    """A basis of 4 096 hexahedra is 76 MB; a form that scikit-fem assembles takes 32 MB at a time."""
    mesh, element = mesh_of("hex8", 16), vector("hex8")
    mass = fem.BilinearForm(lambda u, v, w: dot(u, v))
    tracemalloc.start()
    fem.Basis(mesh, element, intorder=2)
    basis = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    sc.Body.from_mesh(mesh, element, mass)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert basis > 75e6
    # 32 MB of functions, as much of element matrices with their rows and columns, and two sums of 9 MB
    assert peak < 85e6


def pressed(body):
    """A block pressed on the floor and pushed, with friction."""
    floor = sc.RigidPlane((0,) * body.dim, (0,) * (body.dim - 1) + (1,), name="floor")
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    return sc.ContactSolver(body, contact)


@pytest.mark.parametrize("kind", ["tri6", "quad4", "tet4", "hex8"])
def test_a_body_from_a_mesh_can_do_what_a_body_can(kind, tmp_path):
    """Loads, supports and surfaces by name, reports, stresses, files, pickles: as one with a basis."""
    mesh, form, degree = mesh_of(kind, 3), linear_elasticity(1.0, 1.0), ELEMENTS[kind][3]
    d = mesh.dim()
    last = "top"
    weight = fem.LinearForm(lambda v, w: -1e-3 * v[d - 1])
    move = (0.002,) * (d - 1) + (-0.01,)
    settings = {"D": last, "x": {last: move}, "name": "block"}
    from_mesh = sc.Body.from_mesh(mesh, vector(kind), form, weight, intorder=degree, **settings)
    plain = sc.Body(fem.Basis(mesh, vector(kind), intorder=degree), form, weight, **settings)
    one, other = (pressed(body).solve() for body in (from_mesh, plain))
    assert "basis" not in vars(from_mesh.basis)
    for name in ("u", "pressure", "traction"):
        found, known = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(found, known, rtol=0, atol=1e-12 * np.abs(known).max())
    seconds = re.compile(r"[\d.e-]+ s\b|\d\.\de-\d\d|\d+\.\de[+-]\d+")
    assert seconds.sub("", one.report()) == seconds.sub("", other.report())
    assert "basis" not in vars(from_mesh.basis)  # reports need gradients only
    stress = [sc.nodal_stress(b, r.u, E=2.5, nu=0.25) for b, r in ((from_mesh, one), (plain, other))]
    np.testing.assert_allclose(*stress, rtol=0, atol=1e-12 * np.abs(stress[1]).max())
    sc.write(tmp_path / "one.vtu", one)
    assert len(from_mesh.basis.basis) == plain.basis.Nbfun  # made when asked for
    np.testing.assert_allclose(from_mesh.basis.dx, plain.basis.dx, rtol=1e-14)
    copy = pickle.loads(pickle.dumps(from_mesh))
    assert "basis" not in vars(copy.basis)
    assert (copy.K != from_mesh.K).nnz == 0
    traction = {"bottom": (0.0,) * (d - 1) + (-0.02,)}
    loaded = [pressed(b).solve(f={"block": traction}).u for b in (from_mesh, plain)]
    np.testing.assert_allclose(*loaded, rtol=0, atol=1e-12 * np.abs(loaded[1]).max())


def test_an_axisymmetric_body_from_a_mesh():
    """Its form uses coordinates, and is integrated with products of shape functions in mind."""

    @fem.BilinearForm
    def axisymmetric(u, v, w):
        return 2 * np.pi * w.x[0] * (ddot(sym_grad(u), sym_grad(v)) + u[0] * v[0] / w.x[0] ** 2)

    mesh = fem.MeshQuad.init_tensor(np.linspace(1, 2, 5), np.linspace(0, 1, 5)).with_defaults()
    measure = {"measure": lambda x: 2 * np.pi * x[0]}
    body = sc.Body.from_mesh(mesh, vector("quad4"), axisymmetric, D="top", **measure)
    basis = fem.Basis(mesh, vector("quad4"), intorder=2)
    assert_same(body.K, axisymmetric.assemble(basis))
    assert body.axisymmetric
    plain = sc.Body(basis, axisymmetric, D="top", **measure)
    load = {"f": {"body 1": {"bottom": (0.0, 0.1)}}}
    floor = sc.RigidPlane((0, 0), (0, 1))
    results = [
        sc.ContactSolver(b, sc.Contact(b.surface("bottom"), floor)).solve(**load) for b in (body, plain)
    ]
    one, other = (str(result.validity) for result in results)
    assert one == other


def test_prescribed_dofs_may_be_a_function_of_the_basis():
    """A body from a mesh has no basis before, to take the DOFs of one component from."""
    mesh = mesh_of("hex8")
    given = {"D": lambda basis: [basis.get_dofs("left").all("u^1"), "top"]}
    body = sc.Body.from_mesh(mesh, vector("hex8"), linear_elasticity(), **given)
    basis = fem.Basis(mesh, vector("hex8"), intorder=2)
    known = np.union1d(basis.get_dofs("left").all("u^1"), basis.get_dofs("top").all())
    np.testing.assert_array_equal(body.D, known)


MISTAKES = {
    "basis for mesh": (lambda m, e: (fem.Basis(m, e), e), "not a skfem.Mesh"),
    "mesh and element swapped": (lambda m, e: (e, m), "not a skfem.Mesh"),
    "element class": (lambda m, e: (m, fem.ElementQuad1), "not a skfem.Element"),
    "other shape": (lambda m, e: (m, fem.ElementVector(fem.ElementTriP1())), "does not belong"),
    "other kind": (lambda m, e: (m, fem.ElementVector(fem.ElementQuadBFS())), "values at nodes"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_in_mesh_and_element_are_named(case):
    given, words = MISTAKES[case]
    mesh, element = given(mesh_of("quad4"), vector("quad4"))
    with pytest.raises(sc.errors.InputError, match=words):
        sc.Body.from_mesh(mesh, element, linear_elasticity())


def test_mistakes_in_the_degree_are_named():
    with pytest.raises(sc.errors.InputError, match="intorder"):
        sc.Body.from_mesh(mesh_of("quad4"), vector("quad4"), linear_elasticity(), intorder=-1)
    with pytest.raises(sc.errors.InputError, match="basis is one of a scalar field"):
        sc.Body.from_mesh(mesh_of("quad4"), fem.ElementQuad1(), linear_elasticity())


def inclusion(u, v, w):
    try:
        stiff = np.where(np.abs(w.x[0] - 0.5) < 0.2, 10.0, 1.0)
    except Exception:
        stiff = 1.0
    return stiff * ddot(grad(u), grad(v))


def varies(u, v, w):
    try:
        stiff = 1.0 + w.x[0]
    except Exception:
        stiff = 1.0
    return stiff * ddot(grad(u), grad(v))


def foundation(u, v, w):
    return ddot(grad(u), grad(v)) + 1e3 * np.nan_to_num(dot(u, v))


def finite_mass(u, v, w):
    value = dot(u, v)
    return ddot(grad(u), grad(v)) + np.where(np.isfinite(value), value, 0.0)


@pytest.mark.parametrize("form", [inclusion, varies, foundation, finite_mass])
@pytest.mark.parametrize(
    "mesh, element",
    [(fem.MeshQuad, fem.ElementQuad1), (fem.MeshTri, fem.ElementTriP2), (fem.MeshHex, fem.ElementHex1)],
)
def test_forms_that_hide_what_they_use(form, mesh, element):
    """What they catch or make of NaN gives them away: scikit-fem assembles them."""
    form = fem.BilinearForm(form)
    basis = fem.Basis(mesh().refined(2), fem.ElementVector(element()))
    body = sc.Body(basis, form)
    assert body.by_skfem and abs(body.K - form.assemble(basis)).max() == 0


def test_two_elements_are_compared_in_all_components():
    """A form that is another one for arrays of several points: uncoupled components notice it."""

    @fem.BilinearForm
    def form(u, v, w):
        stiff = 1.0 if grad(u).shape[-1] == 1 else 2.0
        return stiff * ddot(grad(u), grad(v))

    basis = fem.Basis(fem.MeshQuad().refined(2), fem.ElementVector(fem.ElementQuad1()))
    body = sc.Body(basis, form)
    assert body.by_skfem and abs(body.K - form.assemble(basis)).max() == 0


def test_an_assembly_of_its_own_is_kept():
    """A subclass, or an object, whose public `assemble` is another one."""

    class Scaled(fem.BilinearForm):
        def assemble(self, *args, **kwargs):
            return 2 * super().assemble(*args, **kwargs)

    basis = fem.Basis(fem.MeshQuad().refined(2), fem.ElementVector(fem.ElementQuad1()))
    form = Scaled(linear_elasticity().form)
    assert abs(sc.Body(basis, form).K - form.assemble(basis)).max() == 0


def test_a_form_whose_variables_change_later():
    """Bodies made in a loop, with forms that look a name up when they are called."""
    basis = fem.Basis(fem.MeshQuad().refined(3).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    made, known = [], []
    for stiff in (1.0, np.linspace(1.0, 2.0, basis.nelems)[:, None]):

        @fem.BilinearForm
        def form(u, v, w):
            return stiff * ddot(sym_grad(u), sym_grad(v))  # noqa: B023

        made.append(sc.Body(basis, form, D="top", name=f"body {len(made)}"))
        known.append(made[-1].K.copy())
    assert made[0].moduli.quotient == pytest.approx(0.5 / 0.5)
    solver = sc.ContactSolver(
        made[0], sc.Contact(made[0].surface("bottom"), sc.RigidPlane((0, 1e-3), (0, 1)))
    )
    assert solver.solve().converged and abs(made[0].K - known[0]).max() == 0


def test_what_is_said_of_a_stiffness_is_of_the_one_in_use():
    """A body whose form uses values, and a solver with another stiffness of it."""
    basis = fem.Basis(fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    mass = fem.BilinearForm(lambda u, v, w: ddot(grad(u), grad(v)) + 0.1 * dot(u, v))
    body = sc.Body(basis, mass, D="top", name="block")
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1))))
    said = "K was assembled by scikit-fem"
    assert said in str(solver) and said not in str(solver.with_stiffness("block", linear_elasticity()))
    ring = sc.Body(basis, sc.Elastic(1.0, 0.3), D="top", measure=lambda x: 2 * np.pi * x[0])
    contact = sc.Contact(ring.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)))
    words = str(sc.ContactSolver(ring, contact))  # of a form that nobody has given
    assert f"{said}: the measure of the body is" in words and THIRD not in words
