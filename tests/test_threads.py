"""One solver asked by several threads: the answers of one thread, whatever the others do meanwhile.

A thread gives way to another every 10 microseconds here, in place of 5 milliseconds: in the middle of
iterations, and between the two lines that write what belongs together.
"""

from __future__ import annotations

import copy
import pickle
import sys
import threading
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from scipy.linalg import lapack
from skfem.mapping import MappingAffine
from skfem.models.elasticity import lame_parameters
from threadpoolctl import threadpool_info, threadpool_limits

import skfem_contact as sc
from skfem_contact.linalg import Direct, lu, single_threaded
from skfem_contact.problem import Substructure, Workspace
from skfem_contact.records import Lock, once

THREADS = 8
LOADS, FEW = 96, 24  # the other loops and routes take ten times as long
# Which set was solved before decides what is eliminated first: sums of some hundred terms differ by
# their round-off, as they do between two orders of the same loads in one thread.
ROUND_OFF = 1e-12
# Iterated to a tolerance of their own, from the same beginnings: forces differ by round-off that
# the iterations have carried on.
ITERATED = 1e-8


@pytest.fixture(autouse=True)
def hurried():
    """Threads give way as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def at_once(job, items):
    """What a function gives for all items, by as many threads as may be, which begin together."""
    together, begin = threading.local(), threading.Barrier(min(THREADS, len(items)))

    def called(item):
        if not hasattr(together, "begun"):
            together.begun = begin.wait(60)
        return job(item)

    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(called, items))


def block(mesh, element, y=0.0, **given):
    basis = fem.Basis(mesh.translated((0.0,) * (mesh.dim() - 1) + (y,)), fem.ElementVector(element))
    return sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), **given)


def plane(nx=16, ny=4, **settings):
    """A block on a floor, more of which closes the deeper it is pressed: its lower side is an arc."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-1, 1, nx + 1), np.linspace(0, 1, ny + 1))
    body = block(mesh.with_defaults(), fem.ElementQuad1(), D="top", name="block")
    foot = sc.Contact(
        body.surface("bottom"),
        sc.RigidPlane((0, 0), (0, 1), name="floor"),
        friction=sc.Coulomb(0.3),
        gap=lambda x: 0.01 * x[0] ** 2,
        name="foot",
    )
    return sc.ContactSolver(body, foot, **settings)


def solid(**settings):
    """The same in space, where the direction of friction turns with the load."""
    mesh = fem.MeshHex.init_tensor(np.linspace(-1, 1, 6), np.linspace(-1, 1, 5), np.linspace(0, 1, 4))
    mesh = mesh.with_boundaries({"bottom": lambda x: x[2] == 0, "top": lambda x: x[2] == 1})
    body = block(mesh, fem.ElementHex1(), D="top", name="block")
    foot = sc.Contact(
        body.surface("bottom"),
        sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor"),
        friction=sc.Coulomb(0.3),
        gap=lambda x: 0.01 * (x[0] ** 2 + x[1] ** 2),
        name="foot",
    )
    return sc.ContactSolver(body, foot, **settings)


SCENES = {"plane": plane, "solid": solid}


def moves(solver, count=LOADS):
    """So many ways to move the top, no two of them alike; every fourth with a load as well."""
    d, n = solver.system.bodies[0].dim, solver.system.n
    rng, found = np.random.default_rng(1), []
    for k in range(count):
        aside = 0.006 * np.array([np.sin(1.3 * k), np.cos(2.1 * k)])[: d - 1]
        load = {"x": {"block": {"top": (*aside, -0.008 - 0.004 * np.cos(k))}}}
        if k % 4 == 0:
            load["f"] = {"block": 1e-5 * rng.standard_normal(n)}
        found.append(load)
    return found


def numbers(result):
    """What users ask of a result, each with its size."""
    return {"u": result.u, "pressure": result.pressure, "traction": result.traction}


def assert_same(found, alone, within=ROUND_OFF, certified=1e-9):
    """The answers are those of one thread, and right by their own certificates."""
    for result, expected in zip(found, alone, strict=True):
        assert result.converged
        assert result.certificate.worst < certified
        assert_array_equal(result.status, expected.status)
        of = numbers(expected)
        for name, values in numbers(result).items():
            size = np.abs(of[name]).max()
            assert_allclose(values, of[name], rtol=0, atol=within * size, err_msg=name)


@cache
def alone(scene, loop, linear, count=LOADS):
    """The answers to all loads in one thread, on a solver of their own."""
    solver = SCENES[scene](loop=loop, linear=linear)
    return [solver.solve(**load) for load in moves(solver, count)]


@pytest.mark.parametrize("scene", ["plane", "solid"])
def test_eight_threads_have_the_answers_of_one(scene):
    """96 load steps on one solver, none of which has been prepared."""
    solver = SCENES[scene]()
    found = at_once(lambda load: solver.solve(**load), moves(solver))
    assert len({len(r.trace) for r in found}) > 1  # loads that differ
    assert_same(found, alone(scene, "newton", "auto"))


WAYS = [
    ("plane", "direct", "condensed"),
    ("plane", "fictitious", "condensed"),
    ("plane", "newton", sc.linalg.Direct()),
    ("plane", "newton", "iterated"),
    ("plane", "newton", sc.linalg.AMG()),
    ("solid", "direct", "condensed"),
    ("solid", "fictitious", "condensed"),
    ("solid", "newton", sc.linalg.Direct()),
    ("solid", "direct", sc.linalg.Direct()),
    ("solid", "newton", "iterated"),
    ("solid", "newton", sc.linalg.AMG()),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    "way", WAYS, ids=[f"{s}-{loop}-{str(linear).split('(')[0]}" for s, loop, linear in WAYS]
)
def test_all_loops_and_routes(way):
    """The other loops, and the other ways to solve linear problems."""
    scene, loop, linear = way
    solver = SCENES[scene](loop=loop, linear=linear)
    found = at_once(lambda load: solver.solve(**load), moves(solver, FEW))
    exact = loop != "fictitious" and linear in ("condensed", sc.linalg.Direct())
    assert_same(found, alone(*way, FEW), ROUND_OFF if exact else ITERATED, 1e-9 if exact else ITERATED)


def cyclic(count, d, phase):
    """Load steps that press and pull to and fro, each history in its own order."""
    t = np.linspace(0, 2 * np.pi, count) + phase
    aside = [0.004 * np.sin(t), 0.004 * np.sin(2 * t)][: d - 1]
    down = -0.008 - 0.002 * np.cos(3 * t)
    return [{"x": {"block": {"top": tuple(way)}}} for way in np.column_stack([*aside, down])]


@pytest.mark.parametrize("scene", ["plane", "solid"])
def test_histories_do_not_mix(scene):
    """Friction remembers: each thread goes its own way, a part of it from a state of another one."""
    solver, lonely = SCENES[scene](), SCENES[scene]()
    d = solver.system.bodies[0].dim
    pressed = solver.solve(x={"block": {"top": (*[0.0] * (d - 1), -0.008)}})

    def history(k, by=solver):
        return list(by.history(cyclic(6, d, 0.7 * k), start=pressed if k % 2 else None))

    for k, found in enumerate(at_once(history, range(THREADS))):
        assert_same(found, history(k, lonely))


def two_blocks(**given):
    """A small block on a large one."""
    low = fem.MeshQuad.init_tensor(np.linspace(-2, 2, 17), np.linspace(-1, 0, 5)).with_defaults()
    up = fem.MeshQuad.init_tensor(np.linspace(-0.4, 0.4, 6), np.linspace(0, 1, 5)).with_defaults()
    low = block(low, fem.ElementQuad1(), D="bottom", name="low")
    up = block(up, fem.ElementQuad1(), D="top", name="block")
    given.setdefault("friction", sc.Coulomb(0.2))
    foot = sc.Contact(up.surface("bottom"), low.surface("top"), name="foot", **given)
    return sc.ContactSolver([low, up], foot)


def wearing():
    return two_blocks(wear=sc.conditions.Archard(2e-3))


def far():
    return two_blocks(sliding="finite")


def tool():
    """A rigid cylinder, pressed down by a force, whose turns its force alone holds."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-2, 2, 17), np.linspace(-1, 0, 5)).with_defaults()
    low = block(mesh, fem.ElementQuad1(), D="bottom", name="low")
    roll = sc.RigidBody(sc.RigidCylinder((0, 2.0), 2.0), force=(0, -0.02), D=("x",), name="block")
    foot = sc.Contact(low.surface("top"), roll, friction=sc.Coulomb(0.4), name="foot")
    return sc.ContactSolver([low, roll], foot)


def floating():
    """A block that nothing but friction holds: springs find the answer, and are taken away."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(-1, 1, 9), np.linspace(0, 1, 5)).with_defaults()
    body = block(mesh, fem.ElementQuad1(), name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(body.surface("bottom"), floor, name="foot")
    return sc.ContactSolver(body, foot)


def sliding_steps(k):
    way = [(0.03 * (j + 1) * (-1) ** k, -0.02 - 0.002 * k) for j in range(3)]
    return [{"x": {"block": {"top": place}}} for place in way]


def rolling_steps(k):
    down = [{"f": {"block": {"y": -0.02 - 0.002 * k}}}]
    return down + [{"x": {"block": {"x": 0.004 * (j + 1) * (-1) ** k}}} for j in range(3)]


def resting_steps(k):
    return [{"f": {"block": {"top": (0.0, -0.01 * (1 + j + k))}}} for j in range(3)]


@pytest.mark.parametrize(
    ("make", "steps"),
    [
        pytest.param(wearing, sliding_steps, id="wear", marks=pytest.mark.slow),
        pytest.param(far, sliding_steps, id="finite", marks=pytest.mark.slow),
        pytest.param(tool, rolling_steps, id="tool"),
        pytest.param(floating, resting_steps, id="floating"),
    ],
)
@pytest.mark.filterwarnings("ignore::skfem_contact.ContactWarning")
def test_other_histories_do_not_mix(make, steps):
    """Wear, pairings that follow, rigid tools under forces, and bodies that only springs hold."""
    solver, lonely = make(), make()
    found = at_once(lambda k: list(solver.history(steps(k))), range(THREADS))
    for k, mine in enumerate(found):
        assert_same(mine, list(lonely.history(steps(k))), within=1e-9)


def test_variants_for_other_friction():
    """Solvers for other laws share bodies and contact problem, and each has its own answer."""
    solver, lonely = plane(), plane()
    laws = [sc.Coulomb(0.05 + 0.02 * k) for k in range(24)]
    load = {"x": {"block": {"top": (0.03, -0.008)}}}
    found = at_once(lambda law: solver.with_friction(law).solve(**load), laws)
    assert_same(found, [lonely.with_friction(law).solve(**load) for law in laws])
    assert len({result.force[0] for result in found}) == len(laws)


def test_variants_for_other_loads():
    """Directions of loads are shared by all solvers over the same bodies, and come from all threads."""
    solver, lonely = plane(), plane()
    rng = np.random.default_rng(2)
    loads = 1e-5 * rng.standard_normal((40, solver.system.n))
    down = {"x": {"block": {"top": (0.001, -0.008)}}}

    def solved(f, by):
        *_, last = by.with_load("block", f).history([1.0, down, 0.5, down])
        return last

    found = at_once(lambda f: solved(f, solver), list(loads))
    assert_same(found, [solved(f, lonely) for f in loads])


def triangles():
    """A block of triangles on a floor, pressed down."""
    mesh = fem.MeshTri.init_tensor(np.linspace(-1, 1, 9), np.linspace(0, 1, 5)).with_defaults()
    body = block(mesh, fem.ElementTriP1(), D="top", x={"top": (0.0, -0.01)}, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3)))


def test_tractions_are_read_by_all_threads_at_once(monkeypatch):
    """What a mapping of scikit-fem makes at its first use is seen by no thread before it is whole."""
    whole = MappingAffine._init_boundary_mapping

    def held_up(mapping):
        shape = mapping.mesh.facets.shape[1]
        mapping._B, mapping._c, mapping._detB = (np.zeros((*d, shape)) for d in ((2, 1), (2,), ()))
        time.sleep(0.05)
        whole(mapping)

    steps = [{"f": {"block": {"right": (1e-4 * k, 0.0)}}} for k in range(THREADS)]
    lonely = triangles()
    expected = [lonely.solve(**step) for step in steps]
    monkeypatch.setattr(MappingAffine, "_init_boundary_mapping", held_up)
    solver = triangles()
    assert_same(at_once(lambda step: solver.solve(**step), steps), expected)


# -- what is made once --------------------------------------------------------------------------


@pytest.mark.parametrize("linear", ["condensed", "iterated", sc.linalg.Direct()])
@pytest.mark.parametrize("prepared", [True, False], ids=["prepare", "solve"])
def test_bodies_are_factorised_once(monkeypatch, linear, prepared):
    """All threads want the factors at once: one makes them, the others wait for it."""
    made = []
    condensed = Direct.condensed

    def counted(*given):
        made.append(threading.get_ident())
        return condensed(*given)

    monkeypatch.setattr(Direct, "condensed", counted)
    solver = plane(linear=linear)
    load = moves(solver, 1)[0]
    if prepared:
        at_once(lambda _: solver.prepare(), range(THREADS))
    found = at_once(lambda _: solver.solve(**load), range(THREADS))
    # with all DOFs in every iteration they are condensed for complementary pivoting alone
    assert len(made) == 1 or (not made and linear == sc.linalg.Direct())
    assert len({id(solver.linear_model.problem_on(None, None)) for _ in found}) == 1
    assert_same(found, [found[0]] * THREADS, ROUND_OFF if linear != "iterated" else ITERATED)


def test_bodies_are_factorised_once_where_pairings_follow(monkeypatch):
    """There is no contact problem that all share, only the bodies."""
    made, condensed = [], Direct.condensed
    monkeypatch.setattr(Direct, "condensed", lambda *given: made.append(1) or condensed(*given))
    solver = far()
    bodies = at_once(lambda _: solver.prepare().model, range(THREADS))
    assert len(set(map(id, bodies))) == 1
    at_once(lambda _: [part.flexibility for part in bodies[0].substructures], range(THREADS))
    assert len(made) == 2


class Between:
    """A lock before which another thread comes, once."""

    def __init__(self, first):
        self.first, self.lock = first, Lock()

    def __enter__(self):
        first, self.first = self.first, None
        if first:
            first()
        self.lock.__enter__()

    def __exit__(self, *failed):
        self.lock.__exit__(*failed)


@pytest.mark.parametrize("places", [(3, 3), (3, 5)], ids=["there", "elsewhere"])
def test_directions_that_two_threads_add(places):
    """While one waits to add a direction the other has added one, at the same DOFs or at others."""
    body = plane().system.bodies[0]
    part = Substructure(body, body.K, body.surface("bottom").dofs.ravel())
    span, own, other = part._spans[0], np.zeros(body.n), np.zeros(body.n)
    known = np.zeros(body.n)
    known[part.free[:4]] = 1.0
    eliminate = part._factor.eliminate
    span.components(known, eliminate)
    own[part.free[places[0]]], other[part.free[[places[1], 2]]] = 1.0, (0.5, 2.0)
    found = []
    span._lock = Between(lambda: found.append(span.components(other, eliminate)))
    found.append(span.components(own, eliminate))
    for load, c in zip((other, own), found, strict=True):
        expected = part._factor.reduce_load(load[part.free])
        assert_allclose(span.along(len(c)) @ c, expected, rtol=0, atol=1e-13)
        acting = np.zeros(body.n)
        acting[span._known.places] = span._known.values[:, : len(c)] @ c
        assert_allclose(acting, load, rtol=0, atol=1e-14)
    assert span.eliminated.shape[1] == 3


class Overtaken:
    """What loads are known along: another solve comes each time before it is read."""

    def __init__(self):
        self.others = []

    def __get__(self, bodies, kind):
        if bodies is not None and self.others:
            self.others.pop(0)()
        return None if bodies is None else vars(bodies).get("known")

    def __set__(self, bodies, value):
        vars(bodies)["known"] = value


@pytest.mark.parametrize("after", range(4))
def test_what_is_known_along_loads_is_that_of_one_solve(monkeypatch, after):
    """While one thread has found that it fits its load, another one has put more directions there."""
    known, solver, loads = Overtaken(), plane(), moves(plane(), 12)
    expected = [plane().solve(**load) for load in (loads[0], loads[4])]
    internals.replace(monkeypatch, "problem.Condensed._along", known)
    solver.solve(**loads[0])
    other = lambda: solver.solve(**loads[8])  # noqa: E731 (with a force that is unlike the others)
    known.others = [*after * [lambda: None], other]
    assert_same([solver.solve(**loads[0])], expected[:1])
    assert_same([solver.solve(**loads[4])], expected[1:])


def test_a_failure_is_every_thread_s(monkeypatch):
    """Where the factorisation fails all threads hear of it, and none waits for ever."""

    def failing(*given):
        raise sc.errors.SingularMatrix("no pivot")

    monkeypatch.setattr(Direct, "condensed", failing)
    solver = plane()

    def asked(_):
        with pytest.raises(sc.errors.InputError, match="not positive definite"):
            solver.prepare()
        return True

    assert all(at_once(asked, range(THREADS)))


def test_a_result_is_asked_by_several_threads(monkeypatch):
    """Displacements, certificate, validity and the rest: computed once, the same for all."""
    counts = dict.fromkeys(("certify", "assess", "uniqueness"), 0)

    def counting(name):
        function = internals.original(f"answers.{name}")

        def counted(answer):
            counts[name] += 1
            return function(answer)

        internals.replace(monkeypatch, f"answers.{name}", counted)

    for name in counts:
        counting(name)
    solver = plane()
    [*_, result] = solver.history(cyclic(3, 2, 0.3))
    others = list(solver.history(cyclic(3, 2, 1.3)))
    names = ("u", "certificate", "validity", "uniqueness")

    def asked(k):
        if k % 2:
            solver.recover([result, *others])
        found = [getattr(result, name) for name in (names if k % 3 else names[::-1])]
        return found if k % 3 else found[::-1]

    found = at_once(asked, range(THREADS))
    assert all(a is b for mine in found for a, b in zip(mine, found[0], strict=True))
    assert counts == dict.fromkeys(counts, 1)
    reports = at_once(lambda _: result.report(), range(THREADS))
    assert set(reports) == {reports[0]}
    for name in ("slip", "contact_edges", "contact_area", "gap", "error_estimate"):
        values = at_once(lambda _, name=name: getattr(result, name), range(THREADS))
        assert len({repr(value) for value in values}) == 1
    lonely = plane()
    assert_same(
        [result, *others],
        [*lonely.history(cyclic(3, 2, 0.3))][2:] + [*lonely.history(cyclic(3, 2, 1.3))],
    )


def test_of_several_threads_one_warns():
    """What is beyond its bound is said by the thread that measures it."""
    body = plane().system.bodies[0]
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    foot = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    solver = sc.ContactSolver(body, foot)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = solver.solve(x={"block": {"top": (0.0, -0.3)}})
    said = []

    def asked(_):
        return result.validity

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = lambda message, *rest: said.append(str(message))
        found = at_once(asked, range(THREADS))
    assert all(one is found[0] for one in found)
    assert len(said) == len(set(said))


# -- memory -------------------------------------------------------------------------------------


def test_solves_in_turn_hand_on_what_they_remember(monkeypatch):
    """One thread has one memory: the factor of a step serves the next one, as long as the set holds."""
    solver, made = plane(), []
    factorised = internals.original("linalg.factorised")

    def counted(*given, **settings):
        made.append(1)
        return factorised(*given, **settings)

    internals.replace(monkeypatch, "linalg.factorised", counted)
    steps = [{"x": {"block": {"top": (0.0, -0.008 - 1e-9 * k)}}} for k in range(20)]
    first, *_ = solver.history(steps)
    for step in steps:  # and so it does where every step is a solve
        first = solver.solve(**step, start=first)
    assert len(made) < 10  # the first step changes the set
    base = solver.linear_model.problem_on(None, None)
    assert len(base.idle) == 1
    [left] = base.idle
    solver.gradient(lambda results: (0.0, [{"pressure": r.pressure} for r in results]), steps, by="gap")
    assert base.idle == [left]  # derivatives are taken with it, and it is given back
    at_once(lambda load: solver.solve(**load), moves(solver, 16))
    assert len(base.idle) <= THREADS


def test_a_solve_within_a_solve():
    """A callback may ask the very solver that calls it."""
    solver, inner = plane(), []
    loads = moves(solver, 2)

    def ask(record):
        inner.append(solver.solve(**loads[1]))

    outer = solver.solve(**loads[0], callback=ask)
    lonely = plane()
    assert_same([outer], [lonely.solve(**loads[0])])
    assert_same(inner, [lonely.solve(**loads[1])] * len(inner))


def test_an_interrupted_solve_leaves_nothing_behind():
    """What was being written when a solve broke off is not handed on; after a refusal it is."""
    solver = plane()
    load, base = moves(solver, 1)[0], solver.prepare().linear_model.problem_on(None, None)

    def interrupt(record):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        solver.solve(**load, callback=interrupt)
    assert not base.idle

    def refuse(record):
        raise StopIteration

    with pytest.raises(sc.errors.NotConverged):
        solver.solve(**load, callback=refuse)
    assert len(base.idle) == 1
    assert_same([solver.solve(**load)], [plane().solve(**load)])


def test_solvers_are_pickled_and_copied_while_they_work():
    """Locks stay behind: elsewhere a solver has its own."""
    solver = plane()
    loads = moves(solver, 16)

    def job(k):
        if k % 4 == 0:
            return pickle.loads(pickle.dumps(solver)).solve(**loads[k])
        if k % 4 == 1:
            return copy.copy(solver).solve(**loads[k])
        return solver.solve(**loads[k])

    del_gap = at_once(job, [k for k in range(16) if k % 4])
    lonely = plane()
    assert_same(del_gap, [lonely.solve(**loads[k]) for k in range(16) if k % 4])


# -- the pieces ---------------------------------------------------------------------------------


def threads_of_blas():
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_blas_has_one_thread_until_the_last_has_left():
    """The setting is one of the process: it comes back with the last who needed it, not the first."""
    with threadpool_limits(2, user_api="blas"):
        before = threads_of_blas()
        if before == {1}:
            pytest.skip("this BLAS has one thread in any case")
        first = second = single_threaded
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert threads_of_blas() == {1}
        second.__exit__(None, None, None)
        assert threads_of_blas() == before

        def limited(_):
            with single_threaded, single_threaded:
                return threads_of_blas()

        assert set().union(*at_once(limited, range(64))) == {1}
        assert threads_of_blas() == before


class Counted:
    """Something that takes its time."""

    def __init__(self):
        self.made = []

    @once
    def value(self):
        """The value."""
        self.made.append(threading.get_ident())
        sum(range(20_000))
        return object()

    @once
    def failing(self):
        self.made.append(None)
        raise ZeroDivisionError


def test_once_is_once():
    """All threads have one value; an error is raised for each, and nothing is kept."""
    things = [Counted() for _ in range(20)]
    for thing in things:
        values = at_once(lambda _, thing=thing: thing.value, range(THREADS))
        assert len(set(map(id, values))) == len(thing.made) == 1
    assert Counted.value.__doc__ == "The value."

    def failing(_):
        with pytest.raises(ZeroDivisionError):
            things[0].failing  # noqa: B018
        return True

    assert all(at_once(failing, range(THREADS)))
    assert "failing" not in vars(things[0])
    with pickle.loads(pickle.dumps(Lock())), copy.deepcopy(Lock()):
        pass


def test_workspaces_lend_each_problem_once():
    """Two solves at the same time have two problems over one stiffness, which is not copied."""
    model = plane().prepare().linear_model
    shared = model.problem_on(None, None)
    with Workspace() as one, Workspace() as other:
        first, second = one.borrowed(shared), other.borrowed(shared)
        assert one.borrowed(shared) is first is not second is not shared
        assert first.points is not second.points
        assert first.points.S is second.points.S is shared.points.S
    assert {id(first), id(second)} == set(map(id, shared.idle))


@pytest.mark.parametrize("columns", [(), (3,)])
def test_lapack_gets_row_exchanges_of_its_own(monkeypatch, columns):
    """SciPy counts them from one while LAPACK works, in the array that it is given, with the GIL free.

    What several threads solve with at once would be counted up twice: rows that are others, or none.
    """
    A = np.random.default_rng(3).standard_normal((6, 6))
    factors, given = lu(A), []
    dgetrs = lapack.dgetrs

    def seen(values, exchanged, b, **settings):
        given.append(exchanged)
        return dgetrs(values, exchanged, b, **settings)

    monkeypatch.setattr(lapack, "dgetrs", seen)
    b = np.ones((6, *columns))
    assert_allclose(A @ factors.solve(b), b, rtol=0, atol=1e-12)
    factors.solve(b)
    assert len(given) == 2
    assert not np.shares_memory(given[0], factors.exchanged)
    assert not np.shares_memory(given[1], factors.exchanged)
