"""Histories that are interrupted, and go on from a result or from a file."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from sliding_scenes import dragged_block, elastic, rectangle

import skfem_contact as sc


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
    path = sc.save_state(tmp_path / "state", whole[k - 1])
    assert path.name == "state.npz"
    solver = roller()
    rest = list(solver.history(STEPS[k:], start=solver.load_state(path)))
    for a, b in zip(whole[k:], rest, strict=True):
        same(a, b)


def test_deformable_bodies_go_on_from_a_file(tmp_path):
    """Dragging over an elastic track: friction, surfaces and their trend come back from the file."""
    steps = [{"x": {"block": d}} for d in np.linspace(0, 0.6, 7)]
    whole = list(dragged_block(rigid=False).history(steps))
    solver = dragged_block(rigid=False)
    start = solver.load_state(sc.save_state(tmp_path / "drag.npz", whole[3]))
    rest = list(solver.history(steps[4:], start=start))
    for a, b in zip(whole[4:], rest, strict=True):
        same(a, b, 1e-12)  # condensed loads are remembered in the order they came: round-off of K
    # a state that was loaded may be saved again
    again = sc.save_state(tmp_path / "again.npz", start)
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
    start = solver.load_state(sc.save_state(tmp_path / "half", half))
    for before in (half, start):
        lifted = next(solver.history([{"motion": {"floor": (0.0, 0.1)}}], start=before))
        # equilibrium: half the load, one unit wide
        assert_allclose(lifted.force, [0.0, 0.5], rtol=0, atol=1e-12)
        # and solve() without f is the body's own load, on the floor where it is
        full = solver.solve(start=lifted)
        assert_allclose(full.force, [0.0, 1.0], rtol=0, atol=1e-12)
        assert_allclose(np.mean(full.u[1::2]), 0.1, rtol=0, atol=1e-3)


def test_nothing_is_lost_when_a_step_fails():
    """When a step has no equilibrium, the results before it are there and good to go on from."""
    solver = dragged_block(rigid=True)
    lift = {"f": {"block": -1.0}}
    steps = [{"x": {"block": 0.1}}, {"x": {"block": 0.2}}, lift, {"x": {"block": 0.4}}]
    kept = []
    with pytest.raises((sc.NoEquilibrium, sc.NotConverged)) as failure:
        for result in solver.history(steps):
            kept.append(result)
    assert len(kept) == 2
    assert failure.value.result is not None and not failure.value.result.converged
    after = list(solver.history([{"x": {"block": 0.3}}], start=kept[-1]))[-1]
    assert_allclose(after.force, [-0.3, 1.0], rtol=0, atol=1e-10)


def test_wrong_files_are_refused(tmp_path):
    """A file of other bodies, of another program, or none at all is refused in words."""
    *_, last = roller().history(STEPS[:1])
    path = sc.save_state(tmp_path / "state.npz", last)
    with pytest.raises(sc.InputError, match="a state of 252 DOFs, 21 contact points"):
        dragged_block(rigid=True).load_state(path)
    np.savez(tmp_path / "other.npz", a=1)
    with pytest.raises(sc.InputError, match="save_state"):
        roller().load_state(tmp_path / "other.npz")
    with pytest.raises(sc.InputError, match="no file"):
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
    solver, step = tilted(0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = next(solver.history([step]))
    assert_allclose(result.rotations["block"], 0.05, rtol=0.05)


def test_sliding_is_no_rotation():
    """A block that is dragged far without turning has no rotation."""
    *_, last = dragged_block(rigid=True).history([{"x": {"block": d}} for d in (0.1, 0.2)])
    # its edges are lifted by a little more at the rear than at the front: p/E
    assert abs(last.rotations["block"]) < 5e-3
