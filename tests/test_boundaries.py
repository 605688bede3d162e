"""Loads and prescribed values by the names of boundaries, against forms and vectors written out."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from rectangles import rectangle
from skfem.models.poisson import laplace

import skfem_contact as sc

ELEMENTS = {"Q1": fem.ElementQuad1(), "Q2": fem.ElementQuad2(), "S2": fem.ElementQuadS2()}
FLOOR = sc.RigidPlane((0, 0), (0, 1), name="floor")


def basis_of(element="Q1"):
    return rectangle(np.linspace(0, 2, 7), np.linspace(0, 1, 4), element=ELEMENTS[element])


def body_of(element="Q1", **given):
    return sc.Body(basis_of(element), linear_elasticity(0.0, 0.5), name="block", **given)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("measure", [None, lambda x: 2 * np.pi * x[0]], ids=["plane", "axisymmetric"])
def test_tractions_are_what_a_linear_form_is(element, measure):
    """Assembled by scikit-fem, with the weight of the area written into the form."""
    given = {"top": (0.3, -5.0), "right": (-1.0, 0.0)}
    body = body_of(element, f=given, measure=measure)
    expected = np.zeros(body.n)
    for name, (a, b) in given.items():
        weight = measure or (lambda x: 1.0)
        form = fem.LinearForm(lambda v, w, a=a, b=b, m=weight: (a * v[0] + b * v[1]) * m(w.x))
        expected += form.assemble(body.basis.boundary(name))
    assert_allclose(body.f, expected, rtol=1e-13, atol=1e-15)
    area = [2.0 if measure is None else np.pi * 4, 1.0 if measure is None else 4 * np.pi]
    total = [body.f[body.dof_component == k].sum() for k in range(2)]
    assert_allclose(total, np.array([[0.3, -5.0], [-1.0, 0.0]]).T @ area, rtol=1e-13)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("measure", [None, lambda x: 2 * np.pi * x[0]], ids=["plane", "axisymmetric"])
def test_a_pressure_all_round_is_what_a_change_of_volume_feels(element, measure):
    """Gauss: a pressure of 3 on the whole boundary of a skew body is -3 times the divergence."""
    basis = basis_of(element)
    x, y = basis.mesh.doflocs
    mesh = dataclasses.replace(basis.mesh, doflocs=np.array([1 + x + 0.2 * x * y, y + 0.1 * x]))
    form = linear_elasticity(0.0, 0.5)
    f = dict.fromkeys(["left", "right", "top", "bottom"], 3.0)
    body = sc.Body.from_mesh(mesh, fem.ElementVector(ELEMENTS[element]), form, f=f, measure=measure)

    def volume(v, w):
        change = v.grad[0, 0] + v.grad[1, 1]
        return -3.0 * (change if measure is None else 2 * np.pi * (w.x[0] * change + v[0]))

    basis = fem.Basis(mesh, fem.ElementVector(ELEMENTS[element]), intorder=6)
    expected = fem.LinearForm(volume).assemble(basis)
    assert_allclose(body.f, expected, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("measure", [None, lambda x: 2 * np.pi * x[0]], ids=["plane", "axisymmetric"])
def test_tractions_that_vary_are_functions_of_the_position(measure):
    """A fluid stands at a wall of height 1: half of its weight pushes, at a third of the height."""
    body = body_of("Q2", f={"right": lambda x: 3.0 * (1 - x[1])}, measure=measure)
    width = 1.0 if measure is None else 4 * np.pi
    push, x = body.f[body.dof_component == 0], body.dof_points[body.dof_component == 0]
    assert_allclose([push.sum(), push @ x[:, 1]], [-1.5 * width, -0.5 * width], rtol=1e-13)
    assert np.all(body.f[body.dof_component == 1] == 0)
    ways = [
        lambda x: (3.0 * (x[1] - 1), 0.0),
        lambda x: [3.0 * (x[1] - 1), 0 * x[1]],
        lambda x: np.array([3.0 * (x[1] - 1), 0 * x[1]]),
    ]
    for way in ways:
        assert_allclose(body.load({"right": way}, "f"), body.f, atol=1e-15 * np.abs(body.f).max())


@pytest.mark.parametrize(
    "function, message",
    [
        (lambda x: x[0][:, :1], r"has the shapes .* one for a pressure"),
        (lambda x: (x[0], x[0], x[0]), r"return 2 numbers for each position"),
        (lambda x: None, "not made of real numbers"),
        (lambda x: np.nan * x[0], "NaN"),
    ],
)
def test_functions_of_tractions_that_return_something_else(function, message):
    with pytest.raises(sc.errors.InputError, match=message):
        body_of(f={"right": function})


def test_a_flux_of_a_scalar_field_is_a_number():
    """One number per boundary, into the body; and one prescribed value."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = fem.Basis(mesh, fem.ElementQuad1())
    body = sc.Body(basis, laplace, f={"left": 3.0}, D="right", x={"right": 20.0})
    assert_allclose(body.f, 3.0 * fem.LinearForm(lambda v, w: v).assemble(basis.boundary("left")))
    assert_array_equal(body.x, np.where(mesh.p[0] == 1.0, 20.0, 0.0))


@pytest.mark.parametrize("element", ELEMENTS)
def test_displacements_are_those_of_the_boundary(element):
    """All nodes of the boundary, midpoints included, and no others."""
    body = body_of(element, D=["top", "left"], x={"top": (0.1, -0.2), "left": (0.1, -0.2)})
    x, y = body.dof_points.T
    on = np.isclose(y, 1.0) | np.isclose(x, 0.0)
    assert_array_equal(body.x, np.where(on, np.where(body.dof_component == 0, 0.1, -0.2), 0.0))


def test_none_is_free():
    """The vertical component alone, on a boundary that a symmetry plane shares a corner with."""
    dofs = basis_of()
    D = np.union1d(dofs.get_dofs("left").nodal["u^1"], dofs.get_dofs("top").nodal["u^2"])
    body = body_of(D=D, x={"top": (None, -0.2), "left": (0.0, None)})
    assert_array_equal(np.flatnonzero(body.x), dofs.get_dofs("top").nodal["u^2"])


WRONG = {
    "name": ({"tpo": (0, 0)}, "did you mean 'top'"),
    "free": ({"bottom": (0, 0)}, r"boundary 'bottom': component x is 0, but D .* 6 of its 7 DOFs"),
    "held": ({"top": (None, 0)}, "component x is None, which means free, but D prescribes it"),
    "clash": ({"top": (0, 1), "right": (0, 2)}, r"y is 2, but boundary 'top', which shares 1 DOFs"),
    "number": ({"top": 1.0}, "'top' is 1.0; give a displacement of 2 numbers"),
    "count": ({"top": (1.0, 2.0, 3.0)}, "give a displacement of 2 numbers"),
    "word": ({"top": ("a", 1.0)}, "not made of real numbers"),
    "nan": ({"top": (np.nan, 1.0)}, "not finite"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_can_not_be_meant_is_refused(case):
    """In words, with the boundary and the component; by a body and by a step."""
    given, words = WRONG[case]
    with pytest.raises(sc.errors.InputError, match=words):
        body_of(D=["top", "right"], x=given)
    body = body_of(D=["top", "right"])
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR))
    with pytest.raises(sc.errors.InputError, match=words):
        next(solver.history([{"x": {"block": given}}]))


def test_steps_take_names_as_they_take_vectors():
    """A history by names is the history by vectors, to the last bit."""
    body = body_of(D="top")
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR, friction=sc.Coulomb(0.3)))
    side = fem.LinearForm(lambda v, w: 0.001 * v[0]).assemble(body.basis.boundary("left"))
    move = body.basis.project(lambda x: np.stack([0.01 + 0 * x[0], -0.02 + 0 * x[0]]))
    by_name = [
        {"x": {"block": {"top": (0.0, -0.02)}}},
        {"x": {"block": {"top": (0.01, -0.02)}}, "f": {"block": {"left": (0.001, 0.0)}}},
        {"f": {"block": {}}},
    ]
    by_vector = [
        {"x": {"block": np.where(body.dof_component == 0, 0.0, move)}},
        {"x": {"block": move}, "f": {"block": side}},
        {"f": {"block": np.zeros(body.n)}},
    ]
    for a, b in zip(solver.history(by_name), solver.history(by_vector), strict=True):
        assert_allclose(a.u, b.u, rtol=0, atol=1e-15)
        assert_allclose(a.forces, b.forces, rtol=0, atol=1e-15)
    once = solver.solve(x={"block": {"top": (0.0, -0.02)}})
    assert_allclose(once.reaction("block", "top"), -once.force, rtol=0, atol=1e-15)


def test_other_boundaries_stay_as_they_were():
    """A step that names one boundary's displacement leaves those of the others."""
    body = body_of(D=["left", "right"], x={"left": (0.0, 0.01), "right": (0.0, 0.01)})
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR))
    result = solver.solve(x={"block": {"left": (0.0, 0.02)}})
    u = result.displacement("block")
    for name, up in (("left", 0.02), ("right", 0.01)):
        assert_array_equal(u[body.basis.get_dofs(name).nodal["u^2"]], up)


def test_replace_makes_bodies_of_bodies():
    """A part is replaced, the rest is the same object, the form that K came from included."""
    body = body_of(D="top", x={"top": (0.0, -0.02)})
    other = dataclasses.replace(body, name="other", D=["top", "left"])
    assert other.K is body.K and other.form is body.form and other.name == "other"
    assert_array_equal(other.x, body.x)
    del body
    assert dataclasses.replace(other, f={"top": (0.0, 1.0)}).form is other.form
    assert dataclasses.replace(other, K=2.0 * other.K).form is None  # nobody knows what it came from
    with pytest.raises(TypeError):
        sc.Body(other.basis, other.K, None, "top")


WIDE = np.linspace(0, 100, 9)
LAYERS = {
    # both ends are one where elements are 50 times as wide as a layer is thick
    "both": ((WIDE, WIDE, [-0.1, 0]), r"'front' and 'back' .* share .*x\[2\], -0\.1\)"),
    # sides of the elements behind an end are as near to it as that
    "inside": (
        (WIDE, WIDE, [-0.4, -0.2, 0]),
        r"112 of the 208 facets .* 'front' are inside .*x\[2\], end\)",
    ),
}


@pytest.mark.parametrize("use", ["D", "D by component", "f", "surface"])
@pytest.mark.parametrize("which", LAYERS)
def test_names_of_ends_that_take_more_than_the_end_are_refused(which, use):
    """scikit-fem takes all facets within a hundredth of an element's diameter for the end."""
    lines, words = LAYERS[which]
    mesh = fem.MeshHex.init_tensor(*lines).with_defaults()

    def layer(mesh, **given):
        given = given or {"D": "left"}
        return sc.Body.from_mesh(
            mesh, fem.ElementVector(fem.ElementHex1()), sc.Elastic(1.0, 0.3), name="layer", **given
        )

    def used(mesh):
        if use == "surface":
            return layer(mesh).surface("front")
        given = {"D": "front"}, {"D": {"front": "z"}}, {"f": {"front": 1.0}}
        return layer(mesh, **given[("D", "D by component", "f").index(use)])

    with pytest.raises(sc.errors.InputError, match=words):
        used(mesh)
    ends = {"front": lambda x: np.isclose(x[2], lines[2][0]), "back": lambda x: np.isclose(x[2], 0)}
    mesh = mesh.with_boundaries(ends)
    used(mesh)
    if use != "surface":  # a contact needs nodes of its own
        used(mesh.with_boundaries({"front": np.flatnonzero(mesh.f2t[1] >= 0)[:3]}))


def test_elements_without_volume_are_named():
    """A coordinate that is given twice makes elements of no size, of each shape."""
    twice, once = np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 1.0])
    shapes = {
        fem.MeshTri: fem.ElementTriP1(),
        fem.MeshQuad: fem.ElementQuad1(),
        fem.MeshTet: fem.ElementTetP1(),
        fem.MeshHex: fem.ElementHex1(),
    }
    for kind, element in shapes.items():
        others = [once] * (kind.elem.refdom.dim() - 1)
        for lines, fits in (((once, *others), True), ((twice, *others), False)):
            mesh = kind.init_tensor(*lines)
            given = mesh, fem.ElementVector(element), sc.Elastic(1.0, 0.3)
            if fits:
                sc.Body.from_mesh(*given)
                continue
            with pytest.raises(
                sc.errors.InputError, match=r"'block' have no volume.* element 1 at \(1, "
            ):
                sc.Body.from_mesh(*given, name="block")
    needle = fem.MeshHex.init_tensor(once, 1e-4 * once, 1e-5 * once)
    sc.Body.from_mesh(needle, fem.ElementVector(fem.ElementHex1()), sc.Elastic(1.0, 0.3))
