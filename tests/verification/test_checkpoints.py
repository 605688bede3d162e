"""Histories that are interrupted, and go on from a result or from a file."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from sliding_scenes import dragged_block, elastic, rectangle

import skfem_contact as sc
from skfem_contact.answers import answer_of


def same(a, b, tolerance=1e-14):
    """Whether two results are one state, to round-off of another order of the same operations."""
    scale = np.max(np.abs(a.normal_force))
    assert_allclose(b.normal_force, a.normal_force, rtol=0, atol=tolerance * scale)
    assert_allclose(b.tangential_force, a.tangential_force, rtol=0, atol=tolerance * scale)
    assert_allclose(b.slip, a.slip, rtol=0, atol=tolerance)
    assert_allclose(b.dissipation_total, a.dissipation_total, rtol=tolerance)


def roller(sliding="finite"):
    """A block under pressure, met from below by a rigid roller that moves and turns."""
    basis = rectangle(np.linspace(0, 2, 21), np.linspace(0, 0.5, 6))
    body = sc.Body(basis, elastic(1e3), D="top", name="block")
    obstacle = sc.RigidSphere((0.6, -1.0), 1.0, name="roller")
    contact = sc.Contact(
        body.surface("bottom"),
        obstacle,
        friction=sc.Coulomb(0.3),
        sliding=sliding,
        interference=lambda x: 0.0 * x[0] + 1e-3,
    )
    return sc.ContactSolver([body], contact)


STEPS = [
    {"motion": {"roller": (0.0, 0.01)}},
    {"motion": {"roller": ((0.05, 0.01), 0.1, (0.6, -1.0))}},
    {"interference": {"contact 1": 0.002}},
    {"motion": {"roller": ((0.1, 0.012), 0.2, (0.6, -1.0))}},
    {"motion": {"roller": ((0.05, 0.012), 0.2, (0.6, -1.0))}},
]


@pytest.mark.parametrize("k", range(1, 5))
def test_history_goes_on_from_a_result(k):
    """Settings that no later step names stay as the state that a history starts from has them."""
    whole = list(roller().history(STEPS))
    solver = roller()
    *_, last = solver.history(STEPS[:k])
    rest = list(solver.history(STEPS[k:], start=last))
    for a, b in zip(whole[k:], rest, strict=True):
        same(a, b)


@pytest.mark.parametrize("k", range(1, 5))
def test_history_goes_on_from_a_file(tmp_path, k):
    """A new solver that reads the file of step k goes on as if nothing had happened."""
    whole = list(roller().history(STEPS))
    solver = roller()
    path = solver.save_state(tmp_path / "state", whole[k - 1])
    assert path.name == "state.npz"
    rest = list(solver.history(STEPS[k:], start=solver.load_state(path)))
    for a, b in zip(whole[k:], rest, strict=True):
        same(a, b)


def test_deformable_bodies_go_on_from_a_file(tmp_path):
    """Dragging over an elastic track: friction, surfaces and their trend come back from the file."""
    steps = [{"x": {"block": d}} for d in np.linspace(0, 0.6, 7)]
    whole = list(dragged_block(rigid=False).history(steps))
    solver = dragged_block(rigid=False)
    start = solver.load_state(solver.save_state(tmp_path / "drag.npz", whole[3]))
    rest = list(solver.history(steps[4:], start=start))
    # condensed loads are remembered in the order they came: in both histories round-off of each step,
    # sums of as many terms as DOFs, times the condition, apart from motions that contact alone resists
    least, most = np.inf, 0.0
    for body in solver.system.bodies:
        free = np.setdiff1d(np.arange(body.n), body.D)
        values = np.linalg.eigvalsh(body.K.toarray()[np.ix_(free, free)])
        least = min(least, values[values > 1e-10 * values[-1]][0])
        most = max(most, values[-1])
    known = 2 * len(steps) * np.finfo(float).eps * np.sqrt(solver.system.n) * most / least
    for a, b in zip(whole[4:], rest, strict=True):
        same(a, b, known)
    # a state that was loaded may be saved again
    again = solver.save_state(tmp_path / "again.npz", start)
    assert_allclose(solver.load_state(again).state.slip, start.state.slip, rtol=0, atol=0)


def test_load_factor_and_own_loads_persist(tmp_path):
    """A history that starts from half the load keeps it while a step moves something else."""
    basis = rectangle(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    load = fem.LinearForm(lambda v, w: -v[1]).assemble(basis.boundary("top"))
    body = sc.Body(basis, elastic(1e3), f=load, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver([body], contact)
    half = next(solver.history([0.5]))
    start = solver.load_state(solver.save_state(tmp_path / "half", half))
    for before in (half, start):
        lifted = next(solver.history([{"motion": {"floor": (0.0, 0.1)}}], start=before))
        # equilibrium: half the load, one unit wide
        assert_allclose(lifted.force, [0.0, 0.5], rtol=0, atol=1e-12)
        # in solve() as well, and all of the body's own load where that is named
        assert_allclose(solver.solve(start=lifted).force, [0.0, 0.5], rtol=0, atol=1e-12)
        full = solver.solve(f={"block": 1.0}, start=lifted)
        assert_allclose(full.force, [0.0, 1.0], rtol=0, atol=1e-12)
        assert_allclose(np.mean(full.u[1::2]), 0.1, rtol=0, atol=1e-3)


def test_loads_by_name_are_no_multiple_of_a_number_before():
    """What an exception carries has the loads of its step, not those of the last number."""
    basis = rectangle(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    body = sc.Body(basis, elastic(1e3), f={"top": (0.0, -1.0)}, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3))
    steps = [0.5, {"f": {"block": 0.8}}, {"motion": {"floor": (0.0, 0.1)}}, "no step"]
    with pytest.raises(sc.errors.InputError) as failure:
        for _ in sc.ContactSolver([body], [contact]).history(steps):
            pass  # nobody keeps them
    results = failure.value.results
    assert [result.factor for result in results] == [0.5, None, None]
    assert_allclose([result.force[1] for result in results], [0.5, 0.8, 0.8], rtol=1e-12)
    assert (
        max(result.certificate.worst for result in results) < 1e-12
    )  # its loads are those of the step


def test_nothing_is_lost_when_a_step_fails():
    """When a step has no equilibrium, the results before it are there and good to go on from."""
    solver = dragged_block(rigid=True)
    lift = {"f": {"block": -1.0}}
    steps = [{"x": {"block": 0.1}}, {"x": {"block": 0.2}}, lift, {"x": {"block": 0.4}}]
    kept = []
    with pytest.raises((sc.errors.NoEquilibrium, sc.errors.NotConverged)) as failure:
        for result in solver.history(steps):
            kept.append(result)
    assert len(kept) == 2
    assert failure.value.result is not None and not failure.value.result.converged
    after = list(solver.history([{"x": {"block": 0.3}}], start=kept[-1]))[-1]
    assert_allclose(after.force, [-0.3, 1.0], rtol=0, atol=1e-10)


def test_wrong_files_are_refused(tmp_path):
    """A file of other bodies, of another program, or none at all is refused in words."""
    solver = roller()
    *_, last = solver.history(STEPS[:1])
    path = solver.save_state(tmp_path / "state.npz", last)
    with pytest.raises(sc.errors.InputError, match="a state of 252 DOFs, 21 contact points"):
        dragged_block(rigid=True).save_state(tmp_path / "none.npz", last)
    with pytest.raises(sc.errors.InputError, match="a state of 252 DOFs, 21 contact points"):
        dragged_block(rigid=True).load_state(path)
    np.savez(tmp_path / "other.npz", a=1)
    with pytest.raises(sc.errors.InputError, match="save_state"):
        roller().load_state(tmp_path / "other.npz")
    with pytest.raises(sc.errors.InputError, match="no file"):
        roller().load_state(tmp_path / "none.npz")


def tilted(angle):
    """A block on a plane, both turned by an angle from where they were meshed."""
    basis = rectangle(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    D = basis.get_dofs("top")
    points = basis.doflocs
    moved = (turn - np.eye(2)) @ points
    x = np.zeros(basis.N)
    for k in range(2):
        at = D.nodal[f"u^{k + 1}"]
        x[at] = moved[k, at]
    x = x - 1e-3 * np.isin(np.arange(basis.N), D.nodal["u^2"])
    block = sc.Body(basis, elastic(1e3), D=D, x=x, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), sliding="finite")
    solver = sc.ContactSolver([block], contact)
    return solver, {"x": {"block": x}, "motion": {"floor": ((0.0, 0.0), angle, (0.0, 0.0))}}


def test_large_rotations_are_told():
    """A body that turns by 0.3 rad raises one warning with its name, the angle and what it means."""
    solver, step = tilted(0.3)
    with pytest.warns(sc.ContactWarning) as caught:
        result = solver.history([step]).__next__()
    words = [str(w.message) for w in caught]
    assert len(words) == 1 and "'block' has turned by" in words[0]
    # the surface is pressed and held by friction a little: the angle is that of the block to 1 %
    assert_allclose(result.rotations["block"], 0.3, rtol=0.05)
    assert "rotation of the contact surfaces" in str(result)


def test_small_rotations_are_not_told():
    """Below 0.1 rad the report has the angle and nobody is warned."""
    solver, step = tilted(0.01)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = next(solver.history([step]))
    assert_allclose(result.rotations["block"], 0.01, rtol=0.05)


def test_sliding_is_no_rotation():
    """A block that is dragged far without turning has no rotation."""
    *_, last = dragged_block(rigid=True).history([{"x": {"block": d}} for d in (0.1, 0.2)])
    # its edges are lifted by a little more at the rear than at the front: p/E
    assert abs(last.rotations["block"]) < 5e-3


def on_a_plane(mesh_of=None, *, swap=False, sliding="small", **given):
    """Two blocks side by side on a plane; `mesh_of` changes the mesh of the second."""
    bodies = []
    for i in range(2):
        basis = rectangle(np.linspace(2 * i, 2 * i + 1, 5), np.linspace(0, 1, 5))
        if i and mesh_of is not None:
            basis = fem.Basis(mesh_of(basis.mesh), basis.elem, intorder=2)
        x = np.zeros(basis.N)
        x[basis.get_dofs("top").nodal["u^2"]] = -1e-3
        bodies.append(sc.Body(basis, elastic(1e3), D="top", x=x, name=f"block {i}", **given))
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contacts = [
        sc.Contact(
            b.surface("bottom"), floor, friction=sc.Coulomb(0.3), sliding=sliding, name=f"on {b.name}"
        )
        for b in (bodies[::-1] if swap else bodies)
    ]
    return sc.ContactSolver(bodies, contacts)


def bent(mesh):
    """The same connectivity, one inner node elsewhere."""
    p = mesh.p.copy()
    inside = np.flatnonzero((p[0] > p[0].min()) & (p[1] == 0.5))[0]
    p[0, inside] += 1e-3
    return type(mesh)(p, mesh.t, sort_t=False).with_defaults()


def mirrored(mesh):
    """As many nodes and elements, numbered the other way."""
    return type(mesh)(mesh.p[:, ::-1], mesh.nvertices - 1 - mesh.t, sort_t=False).with_defaults()


def rounded(mesh):
    """What another machine makes of the same script: the last bits of the coordinates differ."""
    rng = np.random.default_rng(0)
    p = mesh.p * (1 + 4e-16 * rng.integers(-1, 2, mesh.p.shape))
    return type(mesh)(p, mesh.t, sort_t=False).with_defaults()


OTHERS = {
    "nodes": ({"mesh_of": bent}, "a mesh whose nodes are elsewhere: body 'block 1'"),
    "numbers": ({"mesh_of": mirrored}, "another mesh: body 'block 1'"),
    "order": ({"swap": True}, "contact 'on block 0' there is not contact 'on block 1'"),
    "sliding": ({"sliding": "finite"}, "another sliding"),
}


@pytest.mark.parametrize("other", OTHERS)
def test_states_of_other_meshes_are_refused(tmp_path, other):
    """Equal numbers of DOFs, points and contacts do not make a state fit: in memory and in a file."""
    settings, words = OTHERS[other]
    here = on_a_plane()
    result = here.solve()
    path = here.save_state(tmp_path / "state", result)
    solver = on_a_plane(**settings)
    assert solver.system.n == result.system.n and solver.kin.m == answer_of(result).kin.m
    with pytest.raises(sc.errors.InputError, match=words):
        solver.load_state(path)
    for what in ("start", "guess"):
        with pytest.raises(sc.errors.InputError, match=words):
            solver.solve(**{what: result})
    with pytest.raises(sc.errors.InputError, match=words):
        next(solver.history([1.0], start=result))


def test_states_of_the_same_mesh_are_taken(tmp_path):
    """Other loads, stiffness, friction and obstacles, and the round-off of another machine."""
    here = on_a_plane()
    result = here.solve()
    path = here.save_state(tmp_path / "state", result)
    for solver in (
        on_a_plane(f=np.ones(50)),
        on_a_plane(rounded),
        on_a_plane().with_friction(sc.Coulomb(0.1)),
        on_a_plane().with_stiffness("block 0", 2.0 * on_a_plane().system.bodies[0].K),
    ):
        assert solver.solve(start=solver.load_state(path)).converged
        assert solver.solve(start=result).converged


def test_interference_of_another_solver_stays_and_is_told(tmp_path):
    """What a state has in force stays; an interference of the solver's own has no effect, aloud."""

    def fitted(interference):
        block = on_a_plane().system.bodies[0]
        floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        pair = sc.Contact(block.surface("bottom"), floor, interference=interference, name="joint")
        return sc.ContactSolver([block], [pair])

    here, there = fitted(1e-3), fitted(2e-3)
    result = here.solve()
    saved = here.save_state(tmp_path / "state", result)
    words = r"'joint' has an interference of 0\.002 here and of 0\.001 in the state"
    for state in (result, there.load_state(saved)):
        with pytest.warns(sc.ContactWarning, match=words):
            kept = there.solve(start=state)
        assert_allclose(kept.force, result.force, rtol=1e-9)
        with pytest.warns(sc.ContactWarning, match=words):
            (changed,) = there.history([{"interference": {"joint": 2e-3}}], start=state)
        assert_allclose(changed.force, there.solve().force, rtol=1e-9)
        for known in (kept, changed):  # said once
            there.solve(start=known)
        # the same interference, by another object, and one that a step gave
        fitted(np.full(len(result.points), 1e-3)).solve(start=state)
    (stepped,) = here.history([{"interference": {"joint": 2e-3}}])
    for solver in (here, there):
        state = solver.load_state(solver.save_state(tmp_path / "stepped", stepped))
        assert_allclose(solver.solve(start=state).force, changed.force, rtol=1e-9)
        solver.solve(start=stepped)


@pytest.mark.parametrize("by_file", [False, True])
def test_a_new_support_holds_the_body_where_it_finds_it(tmp_path, by_file):
    """A tool is pressed, moved and locked: what no step names stays, its place and its force too."""
    basis = rectangle(np.linspace(0, 1, 11), np.linspace(-0.5, 0, 6))
    block = sc.Body(basis, elastic(1.0), D="bottom", name="block")

    def with_tool(*D):
        tool = sc.RigidBody(sc.RigidCylinder((0.5, 1.0), 1.0), D=("x", *D), name="tool")
        contact = sc.Contact(block.surface("top"), tool, friction=sc.Coulomb(0.3))
        return sc.ContactSolver([block, tool], contact)

    free, locked = with_tool(), with_tool("y", "rotation")
    pressed, start = free.history([{"f": {"tool": {"y": -0.01}}}, {"x": {"tool": {"x": 1e-4}}}])
    force, place = start.force, start.displacement("tool")
    assert place[1] < -0.01
    if by_file:
        start = locked.load_state(free.save_state(tmp_path / "pressed", start))
    kept = locked.solve(start=start)
    # nothing but the support holds it in later steps, and from its own state as well
    rest = list(locked.history([{"f": {"tool": {"y": 0.0}}}, {}], start=kept))
    again = locked.solve(start=locked.load_state(locked.save_state(tmp_path / "again", kept)))
    for result in (kept, *rest, again):
        assert_allclose(result.force, force, rtol=0, atol=1e-12 * abs(force[1]))
        assert_allclose(result.displacement("tool"), place, rtol=0, atol=1e-12 * abs(place[1]))
    # what is named goes there, and a number is a multiple of the bodies' own
    (lifted,) = locked.history([{"x": {"tool": {"y": 0.01}}}], start=kept)
    assert lifted.displacement("tool")[1] == 0.01 and not lifted.force.any()
    (back,) = locked.history([1.0], start=kept)
    assert not back.displacement("tool").any()
    # so are displacements that no step has named, unless one does
    assert not locked.solve(start=pressed).displacement("tool").any()
    held = locked.solve(x={"tool": pressed.displacement("tool")}, start=pressed)
    assert_allclose(held.force, pressed.force, rtol=0, atol=1e-12 * abs(force[1]))


def test_states_that_did_not_converge_are_no_history(tmp_path):
    """Refused as a start, in memory and from a file, which keeps the flag; good as a guess."""
    solver = on_a_plane()
    whole = solver.solve()

    def stop(record):
        raise StopIteration

    broken = solver.solve({"block 0": np.ones(50)}, callback=stop, throw=False)
    assert not broken.converged
    with pytest.warns(sc.ContactWarning, match=r"did not converge .* no history can start"):
        path = solver.save_state(tmp_path / "broken", broken)
    loaded = solver.load_state(path)
    assert not loaded.converged and loaded.message == broken.message
    for state in (broken, loaded):
        with pytest.raises(sc.errors.InputError, match=r"start did not converge .*guess"):
            solver.solve(start=state)
        with pytest.raises(sc.errors.InputError, match="start did not converge"):
            next(solver.history([1.0], start=state))
        guessed = solver.solve(guess=state)
        assert_allclose(guessed["on block 0"].forces, whole["on block 0"].forces, atol=1e-13)


def test_damaged_files_are_refused_in_words(tmp_path):
    """Garbage, a file cut off anywhere, another format, an earlier version: no error of NumPy's."""
    solver = on_a_plane()
    path = solver.save_state(tmp_path / "state.npz", solver.solve())
    content = path.read_bytes()
    files = {
        "garbage": b"\x80\x04garbage" * 50,
        "empty": b"",
        "text": b"load factor 1\n",
        "cut": content[: len(content) // 2],
        "cut at the end": content[:-10],
        "flipped": content[:300] + bytes(255 - b for b in content[300:340]) + content[340:],
    }
    for name, damaged in files.items():
        wrong = tmp_path / f"{name}.npz"
        wrong.write_bytes(damaged)
        with pytest.raises(sc.errors.InputError, match="can not be read as a state") as caught:
            solver.load_state(wrong)
        assert "allow_pickle" not in str(caught.value)  # NumPy's way to read garbage all the same
    assert solver.load_state(tmp_path / "state").converged  # the name that save_state takes
    np.save(tmp_path / "array.npy", np.zeros(3))
    with pytest.raises(sc.errors.InputError, match="a single array"):
        solver.load_state(tmp_path / "array.npy")
    with np.load(path) as file:
        data = dict(file)
    np.savez(tmp_path / "old.npz", **{**data, "format": 4})
    with pytest.raises(sc.errors.InputError, match="has format 4, this version reads 9"):
        solver.load_state(tmp_path / "old.npz")
    del data["state_slip"]
    np.savez(tmp_path / "part.npz", **data)
    with pytest.raises(sc.errors.InputError, match=r"can not be read as a state .*state_slip"):
        solver.load_state(tmp_path / "part.npz")


def test_states_are_saved_whole_or_not_at_all(tmp_path, monkeypatch):
    """A missing folder is named; a disk that is full leaves the old file and nothing else."""
    solver = on_a_plane()
    result = solver.solve()
    with pytest.raises(sc.errors.InputError, match=r"there is no folder .*mkdir"):
        solver.save_state(tmp_path / "none" / "state", result)
    path = solver.save_state(tmp_path / "state", result)
    content = path.read_bytes()

    def full(file, **data):
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(sc.errors.InputError, match=r"could not be written .*No space left"):
        solver.save_state(path, result)
    assert path.read_bytes() == content and list(tmp_path.iterdir()) == [path]


FAILING = [{"x": {"block": 0.1}}, {"x": {"block": 0.2}}, {"f": {"block": -1.0}}]


def test_the_exception_carries_the_results():
    """``list(history)`` gives all before the step that fails; a loop that keeps nothing, equal ones."""
    solver = dragged_block(rigid=True)
    good = list(solver.history(FAILING[:2]))
    with pytest.raises(sc.ContactError) as failure:
        list(solver.history(FAILING))
    with pytest.raises(sc.ContactError) as other:
        [result.force for result in solver.history(FAILING)]
    for error in (failure.value, other.value):
        assert len(error.results) == 2 and all(r.converged for r in error.results)
        for a, b in zip(good, error.results, strict=True):
            same(a, b, 1e-12)
            assert_allclose(b.u, a.u, atol=1e-12)
        after = next(solver.history([{"x": {"block": 0.3}}], start=error.results[-1]))
        assert_allclose(after.force, [-0.3, 1.0], atol=1e-10)


@pytest.mark.parametrize("wrong", ["two", KeyboardInterrupt(), ZeroDivisionError()], ids=str)
def test_any_end_of_a_history_keeps_its_results(wrong):
    """A wrong step, an error of the user's own, Ctrl-C: the results of numeric steps, with loads."""
    solver = on_a_plane(f=np.linspace(0.0, 0.1, 50))

    def steps():
        yield from (0.5, 1.0)
        if isinstance(wrong, BaseException):
            raise wrong
        yield wrong

    kept = []
    with pytest.raises((sc.errors.InputError, KeyboardInterrupt, ZeroDivisionError)) as failure:
        for result in solver.history(steps()):
            kept.append(str(result.certificate))
            del result
    results = failure.value.results
    assert [r.factor for r in results] == [0.5, 1.0]
    assert [str(r.certificate) for r in results] == kept
    assert_allclose(answer_of(results[0]).case.f, 0.5 * answer_of(results[1]).case.f)
    assert_allclose(results[1].u, solver.solve().u, atol=1e-14)


def test_results_so_far_are_light():
    """What a history keeps for its exception does not grow with the bodies, if nobody else keeps it."""
    solver = on_a_plane()
    history = solver.history(np.linspace(0.1, 1.0, 10))
    for result in history:
        assert result.u.any()
    yielded = history.gi_frame.f_locals["yielded"] if history.gi_frame else None
    assert yielded is None  # and nothing at all after its end
    history = solver.history([0.5, 1.0])
    first = next(history)
    assert first.u.any()
    light, _ = history.gi_frame.f_locals["yielded"]._light[0]
    assert (
        "u" not in vars(light)
        and not len(answer_of(light).case.f)
        and answer_of(light).recover.case is answer_of(light).case
    )
