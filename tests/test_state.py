"""What friction remembers is in space: it does not depend on the frames that it is seen in."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from scipy.spatial.transform import Rotation
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import answer_of
from skfem_contact.bodies import tangents
from skfem_contact.conditions import LocalState, transport

# a handful of roundings of numbers of size one
DIGITS = 1e-14


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def frames(normal, rng):
    """A pairing's frames with tangents turned at random about the normals."""
    if normal.shape[1] == 2:
        along = tangents(normal)
    else:
        first = unit(np.cross(normal, rng.standard_normal(normal.shape)))
        along = np.stack([first, np.cross(normal, first)], axis=1)
    return pairing(normal, along)


def pairing(normal, along):
    """What a state asks of a pairing whose slips have components along unit tangents."""
    same = dict.fromkeys(("tangent", "axes", "duals"), along)
    return SimpleNamespace(normal=normal, tangents=along.shape[1], scaled=None, **same)


def state(kin, rng):
    """A state along the tangents of a pairing, of random numbers."""
    m, t = kin.tangent.shape[:2]
    slip, force, reference = rng.standard_normal((3, m, t))
    none = np.zeros(0)
    rest = (
        np.zeros(m),
        reference,
        np.zeros(m),
        np.ones(m),
        none,
        none,
        np.full(m, -1),
        np.zeros(m),
        np.ones(m),
    )
    return LocalState(np.ones(m, dtype=int), slip, force, *rest)


@pytest.mark.parametrize("d", [2, 3])
def test_transport_is_the_smallest_rotation(d):
    """About the axis across both normals, by the angle between them: as SciPy's rotations do it."""
    rng = np.random.default_rng(0)
    old, new = unit(rng.standard_normal((2, 50, d)))
    vectors = rng.standard_normal((50, d))
    vectors -= np.sum(vectors * old, axis=1)[:, None] * old
    found = transport(vectors, old, new)
    in_3d = [np.pad(a, ((0, 0), (0, 3 - d))) for a in (old, new, vectors)]
    axis = np.cross(in_3d[0], in_3d[1])
    angle = np.arctan2(np.linalg.norm(axis, axis=1), np.sum(old * new, axis=1))
    turned = Rotation.from_rotvec(unit(axis) * angle[:, None]).apply(in_3d[2])
    assert_allclose(found, turned[:, :d], rtol=0, atol=1e3 * DIGITS)  # normals as good as opposite
    assert_allclose(np.linalg.norm(found, axis=1), np.linalg.norm(vectors, axis=1), rtol=1e3 * DIGITS)
    assert_allclose(np.sum(found * new, axis=1), 0.0, atol=1e3 * DIGITS)


def test_half_a_turn_keeps_the_length():
    """Between opposite normals a vector is turned round; in the plane that is what half a turn does."""
    for d in (2, 3):
        normal = np.eye(d)[:1]
        for near in (0.0, 1e-14):
            other = unit(-normal + near * np.eye(d)[1:2])
            vector = np.eye(d)[1:2]
            assert_allclose(transport(vector, normal, other), -vector, rtol=0, atol=DIGITS)


def test_in_the_plane_components_stay_what_they_are():
    """However the normals turn: the tangent turns with them, and the history with the point."""
    rng = np.random.default_rng(1)
    angle = np.linspace(0.0, 3.1, 40)  # 0.04 from half a turn, where roundings count 50 times
    old = frames(np.tile([0.6, 0.8], (40, 1)), rng)
    c, s = np.cos(angle), np.sin(angle)
    new = frames(np.stack([0.6 * c - 0.8 * s, 0.6 * s + 0.8 * c], axis=1), rng)
    local = state(old, rng)
    again = local.in_space(old).along(new)
    for name in ("slip", "tangential_force", "reference"):
        assert_allclose(getattr(again, name), getattr(local, name), rtol=0, atol=50 * DIGITS)


@pytest.mark.parametrize("d", [2, 3])
def test_a_state_is_the_same_in_other_frames(d):
    """Written in one set of tangents, read in another, and written again: the same vectors."""
    rng = np.random.default_rng(2)
    one = frames(unit(rng.standard_normal((30, d))), rng)
    other = replace_tangents(one, rng)
    remembered = state(one, rng).in_space(one)
    seen = remembered.along(other)
    if d == 3:  # other components: the frames do differ
        assert np.abs(seen.slip - remembered.along(one).slip).max() > 0.1
    back = seen.in_space(other)
    for name in ("slip", "tangential_force", "reference"):
        assert_allclose(getattr(back, name), getattr(remembered, name), rtol=0, atol=10 * DIGITS)
    assert_array_equal(back.normal, one.normal)


def replace_tangents(kin, rng):
    if kin.tangents == 1:
        return pairing(kin.normal, -kin.tangent)
    return frames(kin.normal, rng)


def slope(angle):
    """A block that is pushed along an inclined plane, and a shear that leaves part of it stuck."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 7), np.linspace(0, 0.4, 4)).with_defaults()
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    mesh = type(mesh)(turn @ mesh.p, mesh.t).with_boundaries(mesh.boundaries)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    body = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, 0.3)), D="top", name="block")
    plane = sc.RigidPlane((0, 0), (-s, c))
    solver = sc.ContactSolver(body, sc.Contact(body.surface("bottom"), plane, friction=sc.Coulomb(0.4)))
    steps = []
    for push in (0.0, 2e-3, 6e-3, 3e-3):
        x = np.zeros(basis.N)
        shift = turn @ np.array([push, -5e-3])
        for k in (0, 1):
            x[basis.get_dofs("top").all(f"u^{k + 1}")] = shift[k]
        steps.append({"x": {"block": x}})
    return list(solver.history(steps)), turn


def test_results_in_global_axes_turn_with_the_bodies():
    """The same history on a slope: components stay, vectors turn; both say the same."""
    flat, _ = slope(0.0)
    tilted, turn = slope(0.7)
    assert {1, 2} <= {int(k) for result in flat for k in result.status}
    for one, two in zip(flat, tilted, strict=True):
        for name in ("slip", "tangential_force"):
            vectors = getattr(one, name + "_vector"), getattr(two, name + "_vector")
            size = np.abs(vectors[0]).max() + 1e-6
            # round-off of the stiffness of the block, in another position
            assert_allclose(vectors[1], vectors[0] @ turn.T, rtol=0, atol=1e-9 * size)
            along = np.einsum("id,ikd->ik", vectors[1], two.tangent)
            assert_allclose(along, getattr(two, name), rtol=0, atol=DIGITS * size)
        held = answer_of(two).state
        assert_allclose(held.slip - held.reference, two.slip_vector, rtol=0, atol=DIGITS)
        assert_allclose(-held.tangential_force, two.tangential_force_vector, rtol=0, atol=DIGITS)
        pressing = two.normal_force[:, None] * two.normal
        assert_allclose(two.forces, pressing + two.tangential_force_vector, rtol=0, atol=0)


def test_a_field_without_direction_has_no_slip():
    """Glued temperatures: vectors of friction and slip are zero, and the history has no components."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 3)).with_defaults()
    bases = [fem.Basis(part, fem.ElementQuad1()) for part in (mesh, mesh.translated((0.0, 1.0)))]
    laplace = fem.BilinearForm(
        lambda u, v, w: fem.helpers.dot(fem.helpers.grad(u), fem.helpers.grad(v))
    )
    low = sc.Body(bases[0], laplace, D="bottom", name="low")
    up = sc.Body(bases[1], laplace, D="top", x=bases[1].ones(), name="up")
    glue = sc.Contact(up.surface("bottom"), low.surface("top"), tied=True)
    result = sc.ContactSolver([low, up], glue).solve()
    answer = answer_of(result)
    assert answer.local.slip.shape == (3, 0) and answer.state.slip.shape == (3, 2)
    assert not result.tangential_force_vector.any()
    assert_allclose(result.u[low.basis.get_dofs("top").all()], 0.5, rtol=0, atol=1e-12)


def test_history_goes_on_from_vectors_and_not_from_components():
    """A state whose normals are given turned is turned back: what counts is where it points."""
    results, _ = slope(0.3)
    answer = answer_of(results[2])
    remembered, kin = answer.state, answer.kin
    c, s = np.cos(0.2), np.sin(0.2)
    turn = np.array([[c, -s], [s, c]])
    names = ("slip", "tangential_force", "reference", "normal")
    turned = replace(remembered, **{name: getattr(remembered, name) @ turn.T for name in names})
    for name in ("slip", "tangential_force", "reference"):
        seen = getattr(turned.along(kin), name)
        assert_allclose(seen, getattr(answer.local, name), rtol=0, atol=DIGITS)


def test_a_history_that_is_handed_on_keeps_the_normal_it_is_across():
    """A vertex goes from one point to the next, whose normal is another: its vectors turn with it."""
    rng = np.random.default_rng(3)
    kin = frames(unit(rng.standard_normal((3, 2))), rng)
    local = replace(state(kin, rng), vertex=np.array([7, -1, -1]))
    moved = local.in_space(kin).handed_on(np.array([-1, 7, -1]), [slice(0, 3)])
    assert_array_equal(moved.vertex, [-1, 7, -1])
    seen = moved.along(kin)
    for name in ("slip", "tangential_force", "reference"):
        assert_allclose(getattr(seen, name), getattr(local, name)[[1, 0, 2]], rtol=0, atol=1e2 * DIGITS)
