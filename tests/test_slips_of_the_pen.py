"""Input that is of the right kind and yet not what is meant: units, degrees, what a mesh lost."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix
from skfem.helpers import ddot, sym_grad
from skfem.models.elasticity import linear_elasticity as elastic_form

import skfem_contact as sc


def basis_of(mesh: fem.Mesh) -> fem.Basis:
    return fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)


def square(size: float, x: float = 0.0, y: float = 0.0) -> fem.Basis:
    mesh = fem.MeshQuad().refined(2).scaled(size).translated((x, y))
    return basis_of(mesh.with_defaults())


def pressed(friction: sc.conditions.FrictionLaw) -> sc.ContactSolver:
    """A block pressed on a floor."""
    down = {"top": (0.0, -0.01)}
    block = sc.Body(square(1.0), linear_elasticity(), D="top", x=down, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1))
    return sc.ContactSolver(block, sc.Contact(block.surface("bottom"), floor, friction=friction))


@pytest.mark.parametrize(
    ("mu", "words"),
    [
        (30, "up to 88.1 degrees off the normal (mu = 30)"),  # degrees, per cent, or sticking
        (np.array([0.3, 0.3, 1e3, 0.3, 0.3]), "up to 89.9 degrees off the normal (mu = 1000)"),
        (3.0, ""),  # rubber has it
    ],
)
def test_steep_friction_is_said_as_an_angle(mu: float | np.ndarray, words: str) -> None:
    """Coefficients that no materials have are no mistake for certain: told, and not warned of."""
    solver = pressed(sc.Coulomb(mu))
    for text in (str(solver), solver.solve().report()):
        assert words in text
        assert ("degrees" in text) == bool(words)


def test_steep_friction_with_a_direction_is_said_as_an_angle() -> None:
    """The larger coefficient counts."""
    from skfem_contact.conditions import steep_words

    law = sc.conditions.OrthotropicCoulomb((20, 45), (1, 0, 0))
    assert steep_words(law) == "up to 88.7 degrees off the normal (mu = 45)"


@pytest.mark.parametrize(("size", "said"), [(0.01, True), (1.0, False)])
def test_bodies_of_unlike_size_are_told(size: float, said: bool) -> None:
    """A tool in metres on a block in millimetres: 4000 times as small, said before solving."""
    block = sc.Body(square(40.0), linear_elasticity(), D="bottom", name="block")
    tool = sc.Body(square(size, 20.0, 40.0), linear_elasticity(), D="top", name="tool")
    solver = sc.ContactSolver([block, tool], sc.Contact(tool.surface("bottom"), block.surface("top")))
    words = "body block is 4000 times as large as body tool (40 and 0.01): as meant, if all lengths"
    assert (words in str(solver)) == said
    edge = sc.RigidPolyline([(20 - size, 40), (20 + size, 40)], name="edge")
    solver = sc.ContactSolver(block, sc.Contact(block.surface("top"), edge))
    words = "body block is 2000 times as large as edge (40 and 0.02)"
    assert (words in str(solver)) == said


def test_nodes_without_elements_are_refused() -> None:
    """As centres of arcs in mesh files: their DOFs have no stiffness, and numpy said so in its way."""
    mesh = fem.MeshQuad().refined(2)
    stray = fem.MeshQuad(np.hstack([[[0.3], [0.3]], mesh.p]), mesh.t + 1)
    with pytest.raises(sc.errors.InputError, match="2 of 52 DOFs of body 'block' belong to no element"):
        sc.Body(basis_of(stray), linear_elasticity(), name="block")
    sc.Body(basis_of(stray.remove_unused_nodes()), linear_elasticity(), name="block")


def test_what_stands_on_an_empty_boundary_is_not_lost() -> None:
    """Loads, displacements and supports on a boundary without facets are refused; no load is none."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    basis = basis_of(mesh.with_boundaries({**mesh.boundaries, "none": np.zeros(0, dtype=int)}))
    held = {"basis": basis, "K": linear_elasticity(), "D": "top", "name": "block"}
    for key in ("f", "x"):
        with pytest.raises(sc.errors.InputError, match="'none': this boundary has no facets"):
            sc.Body(**held, **{key: {"none": (0.0, 1.0)}})
        sc.Body(**held, **{key: {"none": (0.0, 0.0)}})
    block = sc.Body(**held, x={"none": (None, 0.0)})
    with pytest.raises(
        sc.errors.InputError, match="has no facets: boundary 'none' of the mesh is empty"
    ):
        block.surface("none")
    for D in ("none", ["top", "none"]):
        with pytest.raises(sc.errors.InputError, match="boundary 'none' has no facets in the mesh"):
            sc.Body(**held | {"D": D})


@fem.BilinearForm
def rings(u: fem.DiscreteField, v: fem.DiscreteField, w: fem.FormExtraParams) -> np.ndarray:
    """Elasticity without lateral contraction around the axis, of whole rings."""
    strain, virtual = sym_grad(u), sym_grad(v)
    r = np.asarray(w.x[0])
    return 2 * np.pi * (r * ddot(strain, virtual) + u[0] * v[0] / r)


def whole(x: np.ndarray) -> np.ndarray:
    """The length of the ring through a point."""
    return np.asarray(2 * np.pi * x[0])


def one(x: np.ndarray) -> np.ndarray:
    """A thickness."""
    return np.ones_like(x[0])


def two(x: np.ndarray) -> np.ndarray:
    """Twice the thickness."""
    return 2 * one(x)


@pytest.mark.parametrize(
    ("low", "up", "words"),
    [
        ((rings, whole), (rings, whole), ""),
        ((rings, whole), (rings, lambda x: 2 * np.pi * np.maximum(x[0], 0.0)), ""),
        ((linear_elasticity(), None), (linear_elasticity(), lambda x: 2.0 + 0 * x[0]), ""),
        ((linear_elasticity(), two), (linear_elasticity(), one), ""),
        (
            (linear_elasticity(), one),
            (linear_elasticity(), two),
            "'up/bottom' has the thickness 2, and meets 'low/top' over 1 of it",
        ),
        (
            (linear_elasticity(), whole),
            (rings, whole),
            "measure of body 'low' grows .* no hoop strains",
        ),
        (
            (linear_elasticity(), None),
            (rings, whole),
            "'up/bottom' is of an axisymmetric body .*'low/top'",
        ),
        (
            (rings, whole),
            (rings, lambda x: x[0]),
            r"the measure of 'up/bottom' is 0\.159155 times that",
        ),
    ],
)
def test_rings_that_meet_what_is_none(low: tuple, up: tuple, words: str) -> None:
    """A plane stiffness with the weight of rings, rings on a plane body, or on those of a radian.

    And a secondary that is thicker than what it meets: its pressures are too small.
    """
    bodies = [
        sc.Body(square(1.0, 0.5, y), form, D=D, measure=measure, name=name)
        for (form, measure), y, D, name in ((low, -1.0, "bottom", "low"), (up, 0.0, "top", "up"))
    ]
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"))
    if not words:
        sc.ContactSolver(bodies, contact)
        return
    with pytest.warns(sc.ContactWarning, match=words):
        sc.ContactSolver(bodies, contact)


def test_a_form_for_another_number_of_components_is_refused_in_words() -> None:
    """Elasticity on a scalar basis ended in numpy's words about shapes."""
    mesh = fem.MeshQuad().refined(1).with_defaults()
    scalar = fem.Basis(mesh, fem.ElementQuad1())
    with pytest.raises(
        sc.errors.InputError, match=r"K of body 's' is a form .* needs skfem.ElementVector"
    ):
        sc.Body(scalar, elastic_form(), name="s")
    flux = fem.LinearForm(lambda v, w: np.array([1.0, 0.0]) @ v)
    with pytest.raises(sc.errors.InputError, match=r"f of body 's' is a form .* one of a scalar field"):
        sc.Body(scalar, fem.models.poisson.laplace, flux, name="s")


@pytest.mark.parametrize(
    ("of", "wrong", "right"),
    [
        (lambda solver, result: result, "presure", "pressure"),
        (lambda solver, result: result, "contact_pressure", "pressure"),
        (lambda solver, result: result[0], "slipp", "slip"),
        (lambda solver, result: result.certificate, "wors", "worst"),
        (lambda solver, result: result.validity, "problem", "problems"),
        (lambda solver, result: result.joints()[0], "stickng", "sticking"),
        (lambda solver, result: solver, "solv", "solve"),
        (lambda solver, result: solver.system.bodies[0], "surfaces", "surface"),
        (lambda solver, result: solver.contacts[0], "frictions", "friction"),
        (lambda solver, result: solver.contacts[0].friction, "Mu", "mu"),
        (lambda solver, result: solver.contacts[0].primary, "norml", "normal"),
        (lambda solver, result: solver.contacts[0].secondary, "point", "points"),
    ],
)
def test_a_misspelt_attribute_names_the_nearest(
    of: Callable[[Any, Any], Any], wrong: str, right: str
) -> None:
    """Whatever is printed, Jupyter and pytest too: Python itself helps at its prompt alone."""
    solver = pressed(sc.Coulomb(0.3))
    thing = of(solver, solver.solve())
    with pytest.raises(AttributeError, match=f"no attribute '{wrong}'; did you mean '{right}'"):
        getattr(thing, wrong)
    assert not hasattr(thing, wrong)


def test_attributes_that_are_like_nothing_are_told_which_there_are() -> None:
    """Names of other codes are like none of ours."""
    result = pressed(sc.Coulomb(0.3)).solve()
    with pytest.raises(AttributeError, match=r"it has area, .* pressure,"):
        _ = result.CPRESS
    copied = pickle.loads(pickle.dumps(copy.copy(result)))
    assert_allclose(copied.pressure, result.pressure)


def test_a_property_that_fails_says_why() -> None:
    """Its own error is not taken for a name that there is not."""

    class Failing(sc.Coulomb):
        @property
        def broken(self) -> float:
            raise AttributeError("its own words")

    with pytest.raises(AttributeError, match="its own words"):
        _ = Failing(0.3).broken


def held_top() -> tuple[fem.Basis, Any, np.ndarray, Any]:
    """The system of a block as scikit-fem's scripts have it: basis, K, f and D."""
    basis = square(1.0)
    return basis, linear_elasticity().assemble(basis), basis.zeros(), basis.get_dofs("top")


@pytest.mark.parametrize(
    "wrong",
    [
        lambda basis, K, f, D: sc.Body(basis, *fem.condense(K, f, D=D)),
        lambda basis, K, f, D: sc.Body(*fem.condense(K, f, D=D)),
        lambda basis, K, f, D: sc.Body(basis, *fem.condense(K, f, D=D, expand=False)),
        lambda basis, K, f, D: sc.Body(*fem.condense(K, f, D=D, expand=False)),
        lambda basis, K, f, D: sc.Body(basis, *fem.enforce(K, f, D=D)),
        lambda basis, K, f, D: sc.Body(basis, twice_enforced(K, D), f),
    ],
)
def test_displacements_prescribed_by_scikit_fem_are_to_be_given_by_D(wrong: Any) -> None:
    """What condense and enforce return is no stiffness of the whole body any more."""
    with pytest.raises(
        sc.errors.InputError, match=r"pass the plain K .* sc\.Body\(basis, K, f, D=D, x=x\)"
    ):
        wrong(*held_top())


def twice_enforced(K: Any, D: Any) -> Any:
    """The same rows and columns set to the identity: symmetric."""
    return fem.enforce(fem.enforce(K, D=D).T.tocsr(), D=D)


def test_displacements_prescribed_by_penalty_are_warned_of() -> None:
    """The answer is right, but tells no reaction."""
    basis, K, f, D = held_top()
    with pytest.warns(
        sc.ContactWarning, match=r"10 entries .*penalize.* sc\.Body\(basis, K, f, D=D, x=x\)"
    ):
        sc.Body(basis, *fem.penalize(K, f, D=D))


@pytest.mark.parametrize(("factor", "said"), [(0.7e8, False), (1.4e8, True)])
def test_springs_are_told_from_penalties_by_their_size(factor: float, said: bool) -> None:
    """Springs to the ground are what they are, unless no digit of the body is left beside them."""
    basis, K, f, D = held_top()
    largest = K.diagonal().max()
    penalty = {"epsilon": 1 / (factor * largest)}
    if said:
        with pytest.warns(sc.ContactWarning, match="penalize"):
            sc.Body(basis, *fem.penalize(K, f, D=D, **penalty))
    else:
        sc.Body(basis, *fem.penalize(K, f, D=D, **penalty))


def test_forms_that_read_their_displacements_are_told_to_be_nonlinear_bodies() -> None:
    """As K, as f, and by both ways in which scikit-fem's forms read fields."""
    basis = square(1.0)
    stiffening = (
        lambda u, v, w: (1 + w["u"][0] ** 2) * ddot(sym_grad(u), sym_grad(v)),
        lambda u, v, w: (1 + w.u[0] ** 2) * ddot(sym_grad(u), sym_grad(v)),
    )
    words = r"w\['u'\], is not linear: sc\.NonlinearBody\(basis, residual=\.\.\., tangent=\.\.\.\)"
    for form in stiffening:
        with pytest.raises(sc.errors.InputError, match=f"K of body 'b' .* {words}"):
            sc.Body(basis, fem.BilinearForm(form), name="b")
    load = fem.LinearForm(lambda v, w: w["u"][0] * v[0])
    with pytest.raises(sc.errors.InputError, match=f"f of body 'b' .* {words}"):
        sc.Body(basis, linear_elasticity(), load, name="b")


def test_too_many_arguments_without_names_are_told_in_their_order() -> None:
    """Python counts them, and does not say which they are."""
    basis, K, f, D = held_top()
    with pytest.raises(
        sc.errors.UnknownKeyword, match=r"given 4 .* takes 3: Body\(basis, K, f, D=\.\.\."
    ):
        sc.Body(basis, K, f, D)


def test_loads_that_do_not_balance_are_told_by_how_much() -> None:
    """Two rings, the one shrunk onto the other; the pressures on their rims differ by pi in all."""

    def ring(inside: float, name: str, below: float) -> sc.Body:
        x = np.linspace(inside, inside + 1, 5)
        basis = basis_of(fem.MeshQuad.init_tensor(x, x - inside).with_defaults())
        loads = {"top": (0.0, -1.0), "bottom": (0.0, below)}
        return sc.Body(basis, sc.Elastic(1e3, 0.3), loads, measure=whole, name=name)

    inner, outer = ring(1.0, "inner", 1.0), ring(2.0, "outer", 1.2)
    fit = sc.Contact(inner.surface("right"), outer.surface("left"), interference=0.01)
    excess = np.pi * (3**2 - 2**2) * 0.2
    with pytest.raises(
        sc.errors.NoEquilibrium, match=f"The loads on it add up to {excess:.6g} along the axis"
    ):
        sc.ContactSolver([inner, outer], fit).solve()
    rough = sc.Contact(fit.secondary, fit.primary, friction=sc.Coulomb(0.5), interference=0.01)
    with pytest.raises(
        sc.errors.NoEquilibrium, match=f"The loads on them add up to {excess:.6g} along the axis"
    ):
        sc.ContactSolver([inner, outer], rough).solve()


def test_rows_of_one_entry_are_what_is_meant_where_nothing_contradicts_it() -> None:
    """Points on springs of their own, and rows of DOFs that are prescribed by D as well."""
    basis, K, f, D = held_top()
    sc.Body(basis, csr_matrix(np.diag(np.full(basis.N, 3.0))), f)
    sc.Body(basis, twice_enforced(K, D), f, D=D)
    sc.Body(basis, *fem.penalize(K, f, D=D), D=D)
