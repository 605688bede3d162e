"""Which way the bodies enter the contact problem: what is chosen, and what memory decides."""

from __future__ import annotations

import threading
from functools import cache
from types import SimpleNamespace

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.sparse.linalg import spsolve
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.linalg import Limits
from skfem_contact.problem import Choice

BASIS = fem.Basis(fem.MeshQuad().refined(3).with_defaults(), fem.ElementVector(fem.ElementQuad1()))
BODY = sc.Body(BASIS, linear_elasticity(), D="top", name="block")
SYSTEM = sc.bodies.stack([BODY])
CONDENSES = SimpleNamespace(condenses=True, complements=0)
SOLVES = SimpleNamespace(condenses=False)
MUCH = 1e12


@pytest.mark.parametrize(
    ("linear", "dense", "factors", "route"),
    [
        ("auto", MUCH, MUCH, "condensed"),
        ("auto", 1.0, MUCH, "iterated"),
        ("auto", MUCH, 1.0, "multigrid"),
        ("auto", 1.0, 1.0, "multigrid"),
        # a backend that condenses has factors of its own, and how large they are is its own affair
        (CONDENSES, MUCH, MUCH, "condensed"),
        (CONDENSES, 1.0, MUCH, "iterated"),
        (CONDENSES, MUCH, 1.0, "condensed"),
        (CONDENSES, 1.0, 1.0, "iterated"),
        # what is chosen is taken, whatever memory it needs
        ("condensed", 1.0, 1.0, "condensed"),
        ("iterated", MUCH, 1.0, "iterated"),
        (SOLVES, MUCH, MUCH, "full"),
        (sc.linalg.Direct(), MUCH, MUCH, "full"),
        (sc.linalg.AMG(), MUCH, MUCH, "multigrid"),
    ],
)
def test_the_way_is_what_is_chosen_or_what_memory_allows(linear, dense, factors, route):
    """Dense matrices decide between two ways, and factors, of this library's own alone, on a third."""
    wanted = np.unique(BODY.surface("bottom").dofs)
    given = Choice(linear, Limits(dense, factors), SYSTEM, [BODY.K], 18, lambda: wanted)
    assert given.route == route
    assert (given.reason == "as chosen") == (linear not in ("auto", CONDENSES))


def test_a_limit_is_kept_to_the_byte():
    """Matrices of just as many bytes as are allowed are made; with one byte less they are not."""
    wanted = np.unique(BODY.surface("bottom").dofs)

    def way(dense, linear="auto"):
        return Choice(linear, Limits(dense, MUCH), SYSTEM, [BODY.K], 18, lambda: wanted)

    size = way(MUCH).dense_bytes
    assert way(size).route == "condensed" and way(size - 1).route == "iterated"
    # the flexibility of 18 contact DOFs, and two and a half matrices of 18 gaps and slips
    assert size == 8 * 18**2 + int(2.5 * 8 * 18**2)
    # a backend that keeps what it leaves of the bodies has the first of them once more
    keeps = SimpleNamespace(condenses=True, complements=1)
    assert way(MUCH, keeps).dense_bytes == size + 8 * 18**2


def solve_with_scipy(A, b):
    return spsolve(A.tocsc(), b)


@pytest.mark.parametrize(
    ("linear", "condenses"),
    [
        ("condensed", True),
        (sc.linalg.Direct(), True),
        ("iterated", False),
        (sc.linalg.AMG(), False),
        (solve_with_scipy, False),
    ],
    ids=["condensed", "Direct", "iterated", "AMG", "callable"],
)
def test_what_is_chosen_for_large_bodies_is_not_condensed_beside_it(linear, condenses):
    """Where a step is hard, bodies are condensed for it if they are factorised anyway.

    A solver of the user's, or one without factors, is taken where a factorisation is too much.
    """
    foot = sc.Contact(BODY.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.3))
    model = sc.ContactSolver(BODY, foot, linear=linear).linear_model
    assert model.choice.condenses == condenses
    problem = model.problem_on(None, None)
    assert (model.on_points(problem) is problem) == (linear == "condensed" or not condenses)


@cache
def blocks(nu):
    """Two blocks of solid elements, the upper one lower by a little."""
    bodies = []
    for name, count, low, held in (("block", 8, -0.5, "bottom"), ("punch", 7, 0.0, "top")):
        across, up = np.linspace(0, 1, count + 1), np.linspace(low, low + 0.5, 5)
        mesh = fem.MeshHex.init_tensor(across, across, up).with_boundaries(
            {
                "bottom": lambda x, z=low: np.isclose(x[2], z),
                "top": lambda x, z=low + 0.5: np.isclose(x[2], z),
            }
        )
        form = linear_elasticity(*lame_parameters(1.0, nu))
        x = {"x": {"top": (0.0, 0.0, -5e-3)}} if held == "top" else {}
        vector = fem.ElementVector(fem.ElementHex1())
        bodies.append(sc.Body.from_mesh(mesh, vector, form, D=held, name=name, **x))
    return bodies


def pressed(nu=0.3, **given):
    """A solver of both."""
    block, punch = blocks(nu)
    between = punch.surface("bottom"), block.surface("top")
    gap = {"gap": lambda x: 0.01 * ((x[0] - 0.4) ** 2 + (x[1] - 0.5) ** 2)}
    return sc.ContactSolver([block, punch], [sc.Contact(*between, **gap)], **given)


@pytest.fixture
def quick_multigrid(monkeypatch):
    """Multigrid is worth its time for bodies as small as these."""
    per_entry = internals.original("problem.CUBES_PER_ENTRY")
    share = pressed().linear_model.choice.factors_pay_from / 2.5
    internals.replace(monkeypatch, "problem.CUBES_PER_ENTRY", per_entry * share)


def test_multigrid_pays_as_measured():
    """One step of 92 640 DOFs takes multigrid half as long, of 24 420 as long: it is taken for one."""
    per_entry = internals.original("problem.CUBES_PER_ENTRY")
    for cubes, entries, steps in ((6.67e9, 6.86e6, 1.62), (5.30e8, 1.72e6, 0.51)):
        assert_allclose(cubes / (per_entry * entries), steps, rtol=0.2)
    # of 8 x 8 x 4 and 7 x 7 x 4 elements, cut in the middle of the longer sides
    choice = pressed().linear_model.choice
    cubes = (3 * 9 * 5) ** 3 + (3 * 8 * 5) ** 3
    entries = sum(K.nnz for K in choice.stiffness)
    assert choice.factors_pay_from == cubes / (per_entry * entries)


def test_few_steps_of_solids_are_taken_by_multigrid(quick_multigrid):
    """It says so; those who go on solving have factors in time, and derivatives have theirs at once."""
    assert "factors pay from 3 load steps on" in str(pressed())
    one = pressed()
    result = one.solve()
    assert one.linear_model.route == "multigrid"
    words = "as factors are not worth their time for 1 load step: they pay from 3 load steps on"
    assert words in str(one) and words in str(result.report())
    with_factors = pressed(linear="condensed").solve()
    scale = with_factors.pressure.max()
    assert_allclose(result.pressure, with_factors.pressure, rtol=0, atol=1e-8 * scale)
    slopes = [r.sensitivity("displacement").pressure for r in (result, with_factors)]
    assert_allclose(*slopes, rtol=0, atol=1e-6 * np.abs(slopes[1]).max())
    for route in ("multigrid", "condensed", "condensed"):
        result = one.solve(start=result)
        assert one.linear_model.route == route
    assert pressed().prepare().linear_model.route == "condensed"


def test_bodies_of_one_route_are_not_taken_for_those_of_another(quick_multigrid):
    """One body gets another stiffness, and so many steps follow that all are factorised."""
    one, block = pressed(), blocks(0.3)[0]
    assert one.solve().converged and one.linear_model.route == "multigrid"
    *_, result = one.with_stiffness("block", 2 * block.K).history(4 * [1.0])
    known = pressed(linear="condensed").with_stiffness("block", 2 * block.K).solve()
    assert_allclose(result.pressure, known.pressure, rtol=0, atol=1e-8 * known.pressure.max())


class Begun(list):
    """Load steps that say when a history begins with them, as it knows by then how many there are."""

    def __init__(self, steps):
        super().__init__(steps)
        self.begun = threading.Event()

    def __iter__(self):
        self.begun.set()
        return super().__iter__()


def test_steps_that_become_known_while_bodies_are_made(monkeypatch, quick_multigrid):
    """The step that has begun ends on the route it was begun for; the history has one of its own."""
    solver, steps, others = pressed(), Begun([1.0] * 5), []
    many = threading.Thread(target=lambda: others.extend(solver.history(steps)))
    condition = internals.original("problem.wanted_of")

    def made(*given):
        if not many.ident:
            many.start()
            assert steps.begun.wait(60)
        return condition(*given)

    internals.replace(monkeypatch, "problem.wanted_of", made)
    result = solver.solve()
    many.join(60)
    known = pressed(linear="condensed").solve()
    for found in (result, *others):
        assert_allclose(found.pressure, known.pressure, rtol=0, atol=1e-8 * known.pressure.max())
    assert len(others) == 5 and solver.linear_model.route == "condensed"
    assert "multigrid" in str(result.report()) and "multigrid" not in str(others[-1].report())


def test_steps_that_multigrid_is_not_prepared_for_have_factors(quick_multigrid):
    """Bodies that supports do not hold, and pairings that are renewed."""
    one = pressed()
    bodies, given = one.system.bodies, one.contacts[0]
    far = sc.Contact(given.secondary, given.primary, sliding="finite")
    free = sc.Body(bodies[1].basis, bodies[1].form, f={"top": (0.0, 0.0, -1e-3)}, name="punch")
    loose = sc.Contact(free.surface("bottom"), given.primary, friction=sc.Coulomb(0.3))
    for solver in (
        sc.ContactSolver(bodies, [far]),
        sc.ContactSolver([bodies[0], free], [loose]),
    ):
        choice = solver.linear_model.choice.expecting(1)
        assert choice.route == "condensed"
        choice.plain = True  # nothing else decides
        for found in ("factors_pay_from", "few_steps", "route"):
            choice.__dict__.pop(found, None)
        assert choice.factors_pay_from > 2 and choice.route == "multigrid"


def test_springs_that_hold_a_loose_body_change_no_route(quick_multigrid):
    """Springs hold it while its place is looked for; what was chosen for it holds for them, too."""
    one = pressed()
    bodies, given = one.system.bodies, one.contacts[0]
    free = sc.Body(bodies[1].basis, bodies[1].form, f={"top": (0.0, 0.0, -1e-3)}, name="punch")
    solver = sc.ContactSolver([bodies[0], free], [sc.Contact(free.surface("bottom"), given.primary)])
    sprung = solver.linear_model.expecting(1).with_springs(np.ones(solver.system.n))
    assert not sprung.choice.few_steps and sprung.route == "condensed"
    with pytest.warns(sc.ContactWarning, match="indifferent"):
        assert solver.solve().certificate.worst < 1e-9


def test_light_contact_after_a_long_way_has_factors_after_all(quick_multigrid):
    """Multigrid leaves a share of the load, which moves the body: a large one of small forces."""
    for light, route in ((0.04, "multigrid"), (1e-4, "condensed")):
        found = []
        for given in ({}, {"linear": "condensed"}):
            block, punch = blocks(0.3)
            # all that the supports of the punch move it by but for the last bit is taken up by the gap
            contact = sc.Contact(punch.surface("bottom"), block.surface("top"), gap=1.0)
            solver = sc.ContactSolver([block, punch], [contact], **given)
            found.append(solver.solve(x={"punch": {"top": (0.0, 0.0, -1.0 - light)}}))
            assert given or solver.linear_model.route == route
        result, with_factors = found
        assert result.certificate.equilibrium < 1e-9
        assert_allclose(result.force, with_factors.force, rtol=0, atol=1e-8 * abs(result.force[2]))


def test_answers_that_are_not_taken_warn_of_nothing(quick_multigrid):
    """What has too few digits is found again by factors, and what is to be said is said once."""
    block, punch = blocks(0.49)
    contact = sc.Contact(punch.surface("bottom"), block.surface("top"), gap=1.0)
    solver = sc.ContactSolver([block, punch], [contact])
    with pytest.warns(sc.ContactWarning, match="locks") as said:
        solver.solve(x={"punch": {"top": (0.0, 0.0, -1.0 - 1e-4)}})
    assert solver.linear_model.route == "condensed"
    assert len(said) == 2  # of two bodies


def test_steps_that_tighten_bolts_have_factors_after_all(quick_multigrid):
    """They are solved with the section loose; what is known of steps to come holds for it, too."""
    axes = np.linspace(0, 3, 10), np.linspace(0, 1, 4), np.linspace(-1.5, 0, 7)
    mesh = fem.MeshHex.init_tensor(*axes)
    below = lambda x: (x[0] > 1) & (x[0] < 2) & (x[2] < -0.5)  # noqa: E731
    mesh = mesh.restrict(mesh.elements_satisfying(lambda x: ~below(x)))  # two legs, one is the bolt
    sides = {"feet": lambda x: np.isclose(x[2], -1.5), "top": lambda x: np.isclose(x[2], 0)}
    form, vector = linear_elasticity(*lame_parameters(1.0, 0.3)), fem.ElementVector(fem.ElementHex1())
    frame = sc.Body.from_mesh(mesh.with_boundaries(sides), vector, form, D="feet", name="frame")
    punch = blocks(0.3)[1]
    contact = sc.Contact(punch.surface("bottom"), frame.surface("top"), gap=1.0)
    bolt = sc.Bolt(frame, point=(0.5, 0.5, -0.9), axis=(0, 0, 1), name="leg")
    solver = sc.ContactSolver([frame, punch], [contact], bolts=[bolt])
    step = {"bolt": {"leg": {"force": 1e-7}}, "x": {"punch": {"top": (0.0, 0.0, -1.0 - 1e-4)}}}
    assert solver.linear_model.choice.expecting(1).route == "multigrid"
    for result in [solver.solve(**step), *solver.history([step])]:
        assert result.certificate.equilibrium < 1e-9
        assert "multigrid" not in str(result.report())


@pytest.mark.filterwarnings("ignore:Body '.*' locks")
@pytest.mark.parametrize(("nu", "route"), [(0.49, "multigrid"), (0.495, "condensed")])
def test_what_takes_many_cycles_has_factors_after_all(quick_multigrid, nu, route):
    """Materials that hardly change their volume: 54 cycles are waited for, and 75 are not."""
    solver = pressed(nu)
    results = list(solver.history([1.0]))
    assert solver.linear_model.route == route
    wanted = pressed(nu, linear="condensed").solve().pressure
    assert_allclose(results[0].pressure, wanted, rtol=0, atol=1e-8 * wanted.max())
