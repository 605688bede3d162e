"""What was returned never changes: not by updates, nor by what users do to their own arrays."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from rectangles import rectangle
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import answer_of


def block(f=None, K=None, **given):
    """A block whose top is moved, and a load on its side."""
    basis = rectangle(np.linspace(0, 1, 9), np.linspace(0, 0.5, 5))
    form = linear_elasticity(*lame_parameters(1e3, 0.3))
    x = np.zeros(basis.N)
    x[basis.nodal_dofs] = [[0.002], [-0.001]]
    K = form if K is None else K(form.assemble(basis))
    return sc.Body(basis, K, f=f, D="top", x=x, name="block", **given)


def solver_of(body, **contact):
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact.setdefault("friction", sc.Coulomb(0.3))
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, name="joint", **contact))


def side_load(body, size=-5.0):
    edge = body.basis.boundary("left")
    return fem.LinearForm(lambda v, w: size * v[1]).assemble(edge)


def numbers(result):
    """All that a user may ask of a result, computed anew from what it keeps."""
    kept = [
        answer_of(result).state.normal_force,
        answer_of(result).state.tangential_force,
        result.gap,
        answer_of(result).case.f,
    ]
    return [
        *kept,
        answer_of(result).recover(),
        sc.answers.ContactResult(answer_of(result)).certificate.worst,
        result.dissipation,
    ]


def test_update_leaves_results_as_they_are():
    """Another load or stiffness of the solver is none of the results it has returned."""
    body = block()
    solver = solver_of(body)
    load = side_load(body)
    solver.update("block", f=load)
    first = solver.solve()
    [second] = solver.history([0.5])
    moved = next(solver.history([{"motion": {"floor": (0.0, 1e-4)}}]))  # keeps the load in force
    before = [numbers(r) for r in (first, second, moved)]
    assert first.certificate.worst < 1e-10
    solver.update("block", f=-3.0 * load)
    solver.update(body, K=2.0 * body.K)
    assert abs(solver.solve().force[1] / first.force[1] - 1.0) > 0.05  # it has an effect
    for result, known in zip((first, second, moved), before, strict=True):
        for a, b in zip(numbers(result), known, strict=True):
            assert_allclose(a, b, rtol=1e-12, atol=1e-15)
    # and they are good to go on from
    assert solver.solve(start=first).converged


def test_the_users_stiffness_is_copied():
    """K and its parts may be changed or thrown away after the body is made."""
    mine = []

    def remember(K):
        mine.append(K)
        return K

    body = block(K=remember)
    [K] = mine
    solver = solver_of(body)
    first = solver.solve()
    K.data *= 0.1
    K.indices[:] = 0
    again = solver.solve()
    assert_array_equal(again.u, first.u)
    assert first.certificate.worst < 1e-10 and again.certificate.worst < 1e-10
    assert_array_equal(body.K.toarray(), block().K.toarray())
    # a symmetric matrix in another format, or of other numbers, is converted in any case
    for other in (lambda K: K.tocsc(), lambda K: K.tocoo(), lambda K: K.toarray()):
        assert_allclose(block(K=other).K.toarray(), body.K.toarray(), rtol=1e-15)


def test_the_users_other_arrays_are_copied():
    """Loads, interference, coefficients, gaps, motions: what they were when they were given."""
    m = 9
    f, delta, mu, gap = np.zeros(90), np.full(m, 1e-4), np.full(m, 0.3), np.full(m, 5e-5)
    body = block(f=f)
    law = sc.Coulomb(mu)
    solver = solver_of(body, friction=law, interference=delta, gap=gap)
    steps_delta, motion, load = np.full(m, 2e-4), np.array([0.0, 1e-4]), side_load(body)
    steps = [
        {"f": load, "interference": {"joint": steps_delta}, "motion": {"floor": motion}},
        {"f": {"block": load}},
        {"motion": {"floor": [0.0, 2e-4]}},
    ]
    results, known = [], []
    for result in solver.history(steps):
        results.append(result)
        known.append(numbers(result))
        for array in (f, delta, mu, gap, steps_delta, motion, load):
            array *= 3.0  # what a user's own loop may do
    again = solver.solve(start=results[0])
    assert again.certificate.worst < 1e-10
    for result, expected in zip(results, known, strict=True):
        for a, b in zip(numbers(result), expected, strict=True):
            assert_allclose(a, b, rtol=1e-12, atol=1e-15)
    # the second step names no interference and no motion: those of the first, as they were then
    assert_allclose(answer_of(results[1]).case.interference, 2e-4)
    assert_allclose(answer_of(results[1]).case.motion[0].translation, [0.0, 1e-4])
    assert_allclose(law.mu, 0.3)


def test_what_is_returned_can_not_be_written_to():
    """Nobody spoils a result, a body or a surface by accident: NumPy refuses at once."""
    body = block()
    solver = solver_of(body)
    result = solver.solve()
    arrays = {
        "u": result.u,
        "displacement": result.displacement("block"),
        "points": result.points,
        "normal": result.normal,
        "slip": result.slip,
        "status": result.status,
        "gap": result.gap,
        "normal_force": result.normal_force,
        "state": answer_of(result).state.tangential_force,
        "conditions": answer_of(result).conditions.offset,
        "case": answer_of(result).case.f,
        "K": body.K.data,
        "f": body.f,
        "x": body.x,
        "surface": solver.contacts[0].secondary.points,
        "system": solver.system.f,
        "kin": answer_of(result).kin.B_n.data,
        "obstacle": solver.contacts[0].primary.point,
    }
    for name, array in arrays.items():
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 1.0
            pytest.fail(name)
    body.K @ result.u  # read-only matrices work as others
    assert abs(body.K - body.K.T).max() < 1e-9
    copy = body.K.copy()
    copy.data *= 2.0


def test_twins_leave_the_solver_as_it_is():
    """Other loads and stiffnesses in solvers of their own, which agree with solvers made anew."""
    body = block()
    solver = solver_of(body)
    base = solver.solve()
    load = side_load(body)
    loaded = solver.with_load("block", load)
    stiffer = loaded.with_stiffness(body, 2.0 * body.K)
    assert loaded.linear_model is solver.linear_model  # nothing is computed again
    for twin, f, scale in ((loaded, load, 1.0), (stiffer, load, 2.0), (solver, None, 1.0)):
        fresh = solver_of(block(f=f, K=lambda K, scale=scale: scale * K))
        expected, found = fresh.solve(), twin.solve()
        assert_allclose(found.u, expected.u, atol=1e-14)
        assert_allclose(found.forces, expected.forces, atol=1e-12)
        [half], [other] = twin.history([0.5]), fresh.history([0.5])
        assert_allclose(half.forces, other.forces, atol=1e-12)
    # the loads of the twins are directions of loads now, along which this one has round-off: of sums
    # over three directions and nine points
    assert_allclose(
        solver.solve().u, base.u, rtol=0, atol=27 * np.finfo(float).eps * np.abs(base.u).max()
    )
    assert_allclose(stiffer.with_friction(None).solve().force[0], 0.0, atol=1e-12)
    with pytest.raises(sc.errors.InputError, match="f of body 'block' has shape"):
        solver.with_load("block", np.zeros(3))
    with pytest.raises(sc.errors.InputError, match="no body 'blok'"):
        solver.with_stiffness("blok", body.K)


def test_only_the_changed_body_is_condensed_again():
    """A twin with another stiffness of one body shares the factors of the others."""
    low, top = block(), block()
    object.__setattr__(top, "name", "top")
    contact = sc.Contact(top.surface("bottom"), low.surface("top"), gap=0.0)
    solver = sc.ContactSolver([low, top], contact).prepare()
    twin = solver.with_stiffness("top", 3.0 * top.K).prepare()
    assert twin.linear_model.bodies.substructures[0] is solver.linear_model.bodies.substructures[0]
    assert twin.linear_model.bodies.substructures[1] is not solver.linear_model.bodies.substructures[1]
