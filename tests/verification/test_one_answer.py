"""One problem, one answer: every loop on every linear backend, over scenes of different kinds."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import block_basis, elastic, ring_basis

import skfem_contact as sc

BACKENDS = {
    "condensed": lambda: "condensed",
    "Direct": sc.linalg.Direct,
    "AMG": lambda: sc.linalg.AMG(tol=1e-13),
    "scikit-fem": fem.solver_direct_scipy,
}


def punch(law):
    """A punch held by friction alone, pressed and pushed; meshes that do not match."""
    low = block_basis(np.linspace(-2, 2, 17), np.linspace(-1, 0, 7))
    top = block_basis(np.linspace(-0.5, 0.5, 8), np.linspace(0, 1, 6))
    push = fem.LinearForm(lambda v, w: 0.02 * v[0] - 0.1 * v[1]).assemble(top.boundary("top"))
    block = sc.Body(low, elastic(1.0, 0.3), D="bottom", name="block")
    tool = sc.Body(top, elastic(3.0, 0.2), f=push, name="tool")
    contact = sc.Contact(tool.surface("bottom"), block.surface("top"), friction=law)
    return [block, tool], contact, [0.5, 1.0, 0.3]


def rough_floor(law):
    """Raous' block: sticking, slipping and lifted points on a rigid plane."""
    basis = block_basis(np.linspace(0, 1, 11), np.linspace(0, 1, 11))
    down = fem.LinearForm(lambda v, w: -0.05 * v[1]).assemble(basis.boundary("top"))
    squeeze = fem.LinearForm(lambda v, w: -0.15 * v[0]).assemble(basis.boundary("right"))
    D = basis.get_dofs("left").nodal["u^1"]
    block = sc.Body(basis, elastic(130.0, 0.2), f=down + squeeze, D=D, name="block")
    contact = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=law)
    return [block], contact, [1.0]


def press_fit(law):
    """Two rings with an interference, the outer one turned until part of the joint slips."""
    around = [2 * np.pi * np.arange(n) / n for n in (24, 30)]
    inner = ring_basis(np.linspace(1, 2, 4), around[0], closed=True)
    outer = ring_basis(np.linspace(2, 3, 4), around[1], closed=True)
    x = outer.project(lambda x: 2e-3 * np.stack([-x[1], x[0]]))
    shaft = sc.Body(inner, elastic(1.0, 0.3), D="inner", name="shaft")
    hub = sc.Body(outer, elastic(1.0, 0.3), D="outer", x=x, name="hub")
    sides = [shaft.surface("outer"), hub.surface("inner")]
    contact = sc.Contact(*sides, gap=0.0, interference=2e-3, friction=law)
    return [shaft, hub], contact, [0.0, 0.5, 1.0]


SCENES = {"punch": (punch, 0.3), "rough floor": (rough_floor, 1.0), "press fit": (press_fit, 0.2)}


def answer(scene, mu, loop, linear, stiffness=None):
    bodies, contact, steps = scene(sc.Coulomb(mu, stiffness=stiffness))
    solver = sc.ContactSolver(bodies, contact, loop=loop, linear=linear)
    return list(solver.history(steps))[-1]


@pytest.fixture(scope="module", params=SCENES)
def reference(request):
    """The scene, and its answer by the default loop on the condensed problem."""
    scene, mu = SCENES[request.param]
    return scene, mu, answer(scene, mu, "newton", "condensed")


def assert_same(result, expected, digits):
    scale = expected.normal_force.max()
    assert_allclose(result.normal_force, expected.normal_force, rtol=0, atol=digits * scale)
    assert_allclose(result.tangential_force, expected.tangential_force, rtol=0, atol=digits * scale)
    assert_allclose(result.u, expected.u, rtol=0, atol=digits * np.abs(expected.u).max())


@pytest.mark.pairwise
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("loop", ["newton", "direct"])
def test_every_loop_on_every_backend(reference, loop, backend):
    """With exact sticking, newton and direct give one answer whatever solves the linear systems."""
    scene, mu, expected = reference
    result = answer(scene, mu, loop, BACKENDS[backend](), stiffness=np.inf)
    # the loops stop at 1e-10 of the largest force; a direct solver adds round-off of T'KT, multigrid
    # its own tolerance of 1e-13 times the condition of the small bodies
    assert_same(result, expected, 1e-8 if backend == "AMG" else 1e-9)


def test_scenes_have_all_kinds_of_points():
    """The scenes are worth the comparison: points stick, slip and lift off in them."""
    met = set()
    for scene, mu in SCENES.values():
        met |= set(answer(scene, mu, "newton", "condensed").status.tolist())
    assert met == {0, 1, 2}


@pytest.mark.parametrize("name", SCENES)
def test_fictitious_agrees_at_the_same_stiffness(name):
    """Where the method of fictitious friction forces converges, its answer is that of newton."""
    scene, mu = SCENES[name]
    result = answer(scene, mu, "fictitious", "condensed")
    G = float(
        np.median(sc.ContactSolver(*scene(sc.Coulomb(mu))[:2], loop="fictitious").interface.stiffness)
    )
    by_all = [answer(scene, mu, loop, "condensed", stiffness=G) for loop in ("newton", "fictitious")]
    # the residual of the law is below 1e-10; how far the answer is from it depends on the rate of
    # the iteration, some hundred here
    assert_same(by_all[1], by_all[0], 1e-7)
    assert result.converged
