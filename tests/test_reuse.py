"""One condensation for many friction laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import answer_of


def scene(friction: Any, **settings: Any) -> sc.ContactSolver:
    """A block on a block, its top moved down and sideways."""
    element = fem.ElementVector(fem.ElementQuad1())
    low = fem.Basis(fem.MeshQuad().refined(3).with_defaults(), element, intorder=2)
    mesh = fem.MeshQuad().refined(2).scaled((0.5, 0.5)).translated((0.2, 1.0)).with_defaults()
    top = fem.Basis(mesh, element, intorder=2)
    move = top.project(lambda x: np.stack([0.01 + 0 * x[0], -0.01 + 0 * x[0]]))
    a = sc.Body(low, linear_elasticity(), D="bottom", name="low")
    b = sc.Body(top, linear_elasticity(), D="top", x=move, name="top")
    contact = sc.Contact(
        b.surface("bottom"), a.surface("top"), friction=friction, name="faces", **settings
    )
    return sc.ContactSolver([a, b], [contact])


@pytest.mark.parametrize("law", [sc.Coulomb(0.1), sc.Coulomb(0.8), sc.Tresca(0.001)])
def test_another_law_gives_what_a_new_solver_gives(law: sc.conditions.FrictionLaw) -> None:
    """A shared condensation changes nothing, and the first solver keeps its own law."""
    first = scene(sc.Coulomb(0.4))
    before = first.solve().traction
    found, fresh = first.with_friction(law).solve(), scene(law).solve()
    # the same arithmetic on the same numbers, but for the zone that is kept
    assert_allclose(found.u, fresh.u, rtol=0, atol=1e-13)
    assert_allclose(found.traction, fresh.traction, rtol=0, atol=1e-12)
    assert_array_equal(first.solve().traction, before)


def test_what_a_step_names_and_leaves_is_the_same_vector() -> None:
    """Loads and displacements that stay as they were are kept once, whatever names them."""
    solver = scene(sc.Coulomb(0.4))
    top = solver.system.bodies[1]
    push = np.where(np.arange(top.n) % 2, -1e-4, 0.0)
    first, second, third = solver.history(
        [{"x": {"top": np.array(top.x)}}, {"f": {"top": push}}, {"f": {"top": 1.0 * push}, "x": {}}]
    )
    cases = [answer_of(result).case for result in (first, second, third)]
    assert cases[0].x is cases[1].x is cases[2].x
    assert cases[1].f is cases[2].f and cases[0].f is not cases[1].f
    assert_array_equal(third.forces, second.forces)
    # as good as steps that hold vectors of their own
    moved = {"x": {"top": 1.5 * top.x}}
    [after] = solver.history([moved], start=third)
    *_, other = scene(sc.Coulomb(0.4)).history([1.0, {"f": {"top": push}}, moved])
    assert_array_equal(after.forces, other.forces)


def test_interference_is_asked_for_once() -> None:
    """A function of the user's gives the interference when the solver is made, and never again."""
    calls = []

    def interference(x: np.ndarray) -> np.ndarray:
        calls.append(x.shape)
        return 1e-3 * x[0]

    solver = scene(sc.Coulomb(0.4), interference=interference)
    made = len(calls)
    *_, last = solver.history([0.5, 1.0])
    assert last.validity is not None and len(calls) == made


def test_condensation_is_shared() -> None:
    """The twin condenses nothing, also when it is made before the first solve."""
    first = scene(sc.Coulomb(0.4))
    twin = first.with_friction(sc.Coulomb(0.2))
    assert twin.model is first.model
    assert "condensation" not in twin.timings


def test_without_friction() -> None:
    """Friction can be taken away; other DOFs then matter, and the answer is that of a new solver."""
    found, fresh = scene(sc.Coulomb(0.4)).with_friction(None).solve(), scene(None).solve()
    assert_allclose(found.u, fresh.u, rtol=0, atol=1e-13)
    assert abs(found.force[0]) == 0.0


def test_friction_alone_holds_a_body() -> None:
    """A solver without friction has no answer and need not look for one: its twin has friction."""
    basis = fem.Basis(fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    body = sc.Body(basis, linear_elasticity(), f={"top": (0.01, -0.1)}, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1))
    smooth = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor))
    assert_allclose(smooth.with_friction(sc.Coulomb(0.5)).solve().force, [-0.01, 0.1], atol=1e-12)
    with pytest.raises(sc.errors.NoEquilibrium):
        smooth.solve()


def test_update_of_one_leaves_the_other() -> None:
    """A body that becomes softer in the twin stays what it is in the first solver."""
    first = scene(sc.Coulomb(0.4))
    before = first.solve().u
    twin = first.with_friction(sc.Coulomb(0.4), "faces")
    twin.update("top", K=0.5 * first.system.bodies[1].K)
    assert abs(twin.solve().u - before).max() > 1e-4
    assert_array_equal(first.solve().u, before)


def test_history_goes_on_with_another_law() -> None:
    """A result of one solver is the start of its twin: friction that rises later changes nothing."""
    first = scene(sc.Coulomb(0.4))
    last = first.solve()
    rougher = first.with_friction(sc.Coulomb(0.9)).solve(start=last)
    assert_allclose(rougher.traction, last.traction, rtol=0, atol=1e-12)


def test_contacts_are_found_by_those_that_were_given() -> None:
    """Whatever friction a solver has taken since, a contact is known by the object of the user's."""
    first = scene(sc.Coulomb(0.4))
    (given,) = first.contacts
    smooth = first.with_friction(sc.Coulomb(0.1), given)
    smoother = smooth.with_friction(sc.Coulomb(0.05), given)
    assert smoother.contacts[0].friction.mu == 0.05 and given.friction.mu == 0.4
    result = smoother.solve()
    assert given in result and result[given] is result["faces"] is result[np.int64(0)]
    floor = sc.RigidPlane((0, 0), (0, 1))
    for other in (sc.Contact(given.secondary, floor), floor, None):
        assert other not in result
        with pytest.raises(sc.errors.InputError, match="not one of"):
            first.with_friction(sc.Coulomb(0.1), other if other else floor)


def test_unknown_contact_is_named() -> None:
    """The message lists the contacts there are."""
    with pytest.raises(
        sc.errors.InputError, match=r"'sides' is not one of this solver: it has 'faces'"
    ):
        scene(sc.Coulomb(0.4)).with_friction(sc.Coulomb(0.1), "sides")


@pytest.mark.parametrize("factor", [1e-16, 1e16])
def test_round_off_is_that_of_the_stiffness_in_use(factor):
    """What counts as round-off follows a stiffness that replaces another one of any size."""
    basis = fem.Basis(fem.MeshQuad().refined(2).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
    K = linear_elasticity(*lame_parameters(1.0, 0.3)).assemble(basis)
    down = basis.project(lambda x: np.stack([0 * x[0], -1e-3 * (1 + x[0])]))

    def solver(K):
        block = sc.Body(basis, K, D="top", x=down, name="block")
        plane = sc.RigidPlane((0, 0), (0, 1))
        contact = sc.Contact(block.surface("bottom"), plane, friction=sc.Coulomb(0.3))
        return sc.ContactSolver([block], [contact])

    result = solver(factor * K).with_stiffness("block", K).solve()
    assert_allclose(result.forces, solver(K).solve().forces, rtol=0, atol=1e-14)
    assert result.certificate.worst < 1e-12


def test_a_stiffness_may_be_an_elastic_material():
    """A solver with another steel is the solver that was made with it, the same thickness and axis."""
    mesh = fem.MeshQuad().refined(2).translated((1.0, 0.0)).with_defaults()
    element = fem.ElementVector(fem.ElementQuad1())
    measures = {"plate": lambda x: 0.2 + 0 * x[0], "ring": lambda x: 2 * np.pi * x[0]}

    def force(name, made, used=None):
        block = sc.Body(fem.Basis(mesh, element), made, D="bottom", measure=measures[name], name=name)
        lid = sc.RigidPlane((0, 1), (0, -1), name="lid")
        solver = sc.ContactSolver([block], [sc.Contact(block.surface("top"), lid)])
        if used is not None:
            solver = solver.with_stiffness(name, used)
        return solver.solve(motion={"lid": (0, -0.01)}).force[1]

    one, other = sc.Elastic(1.0, 0.3), sc.Elastic(7.0, 0.1)
    for name in measures:
        known = force(name, other)
        assert abs(known - force(name, one)) > 0.1 * abs(known)
        # the same arithmetic on the same numbers, but for the bound below which forces are round-off
        assert_allclose(force(name, one, other), known, rtol=1e-12)
