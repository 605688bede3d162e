"""Bodies that are not linear by every route of the linear problem: one answer."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc

E, NU, YIELD, H = 210e3, 0.3, 300.0, 2100.0
OTHERS = [pytest.param("iterated", id="iterated"), pytest.param(sc.linalg.Direct(), id="full")]
OTHERS.append(pytest.param(sc.linalg.AMG(), id="multigrid"))


def plane(linear: Any) -> tuple[sc.ContactSolver, list[Any]]:
    """A billet under an elastic tool: pressed, pushed aside, drawn back."""
    bases = []
    for x, y, nx, ny in (((0, 1), (0, 1), 4, 4), ((-0.25, 1.15), (1, 1.5), 5, 2)):
        mesh = fem.MeshQuad.init_tensor(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1))
        bases.append(fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2))
    law = sc.J2(E, NU, [[YIELD, 0.0], [YIELD + H, 1.0]])
    billet = sc.NonlinearBody(bases[0], law, D="bottom", name="billet")
    tool = sc.Body(bases[1], sc.Elastic(E, NU), D="top", name="tool")
    contact = sc.Contact(billet.surface("top"), tool.surface("bottom"), friction=sc.Coulomb(0.2))
    ways = [(0.006, 0.0), (0.01, 0.003), (0.0095, 0.002)]
    steps = [{"x": {"tool": {"top": (along, -down)}}} for down, along in ways]
    return sc.ContactSolver([billet, tool], [contact], linear=linear), steps


def solid(linear: Any) -> tuple[sc.ContactSolver, list[Any]]:
    """The same in space, where directions of friction turn, of rubber that is softer than its tool."""
    bases = []
    for low, high, n, m in ((0.0, 1.0, 2, 2), (1.0, 1.5, 3, 1)):
        side = np.linspace(0, 1, n + 1)
        mesh = fem.MeshHex.init_tensor(side, side, np.linspace(low, high, m + 1))
        bases.append(fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2))
    foot = bases[0].get_dofs(lambda x: x[2] < 1e-9)
    head = bases[1].get_dofs(lambda x: x[2] > 1.5 - 1e-9)
    move = bases[1].zeros()
    move[head.all("u^3")], move[head.all("u^1")] = -0.1, 0.04
    pad = sc.NonlinearBody(bases[0], sc.materials.NeoHooke.of(20.0, 0.4), D=foot, name="pad")
    tool = sc.Body(bases[1], sc.Elastic(2000.0, 0.3), D=head, x=move, name="tool")
    sides = [body.surface(lambda x: np.abs(x[2] - 1) < 1e-9) for body in (pad, tool)]
    contact = sc.Contact(*sides, friction=sc.Coulomb(0.2))
    return sc.ContactSolver([pad, tool], [contact], linear=linear), [0.5, 1.0, 0.7]


def found(scene: Any, linear: Any) -> tuple[np.ndarray, float, int]:
    """Displacements after the history, the worst certificate, and the number of linearisations."""
    solver, steps = scene(linear)
    results = list(solver.history(steps))
    worst = max(result.certificate.worst for result in results)
    return results[-1].u, worst, sum(len(result.newton) for result in results)


@pytest.fixture(scope="module")
def condensed() -> dict[Any, tuple[np.ndarray, float, int]]:
    return {scene: found(scene, "auto") for scene in (plane, solid)}


@pytest.mark.parametrize("linear", OTHERS)
@pytest.mark.parametrize("scene", [plane, solid])
def test_every_route_has_the_same_answer(condensed: Any, scene: Any, linear: Any) -> None:
    """Condensed, by products with the factors, with all DOFs, and without any factors."""
    u, worst, count = found(scene, linear)
    expected, _, others = condensed[scene]
    assert_allclose(u, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert worst < 1e-9  # the tolerance of equilibrium, and a digit
    assert abs(count - others) <= 2


def billet(friction: float, linear: Any) -> sc.ContactSolver:
    """Half of a cylinder as high as its radius, without hardening, under a rough platen; yield 1."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 0.5, 5)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    D = np.union1d(basis.get_dofs("left").all("u^1"), basis.get_dofs("bottom").all("u^2"))
    law, measure = sc.J2(1000.0, 0.3, 1.0), lambda x: 2 * np.pi * x[0]
    body = sc.NonlinearBody(basis, law, D=D, measure=measure, name="billet")
    platen = sc.RigidPlane((0, 0.5), (0, -1), name="platen")
    limit = sc.Tresca(friction / 3**0.5) if friction else None
    contact = sc.Contact(body.surface("top"), platen, friction=limit)
    return sc.ContactSolver(body, contact, linear=linear)


@pytest.mark.parametrize(
    "linear", ["auto", "iterated", sc.linalg.Direct()], ids=["auto", "iterated", "full"]
)
@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_limit_load_costs_no_digits(friction: float, linear: Any) -> None:
    """Tangents are singular in plastic flow; contact and equilibrium hold to ten digits all the same.

    And a step that goes on takes as few linearisations as any: its first one is not just where the
    material begins to yield, where round-off would choose between two tangents.
    """
    steps = [{"motion": {"platen": (0, -down)}} for down in (0.0005, 0.001, 0.002, 0.004, 0.0039)]
    *results, back = billet(friction, linear).history(steps)
    assert max(result.certificate.worst for result in [*results, back]) < 1e-10
    assert max(len(result.newton) for result in results) <= 5
    assert len(back.newton) <= 2  # elastic
    if not friction:
        assert_allclose(-results[-1].force[1], np.pi, rtol=1e-9)  # the yield stress on the area


def column(push: float) -> tuple[sc.ContactSolver, list[Any]]:
    """A column of rubber under a plate that is glued to it, and pressed beyond its buckling load."""
    bases = []
    for x, y, nx, ny in (((-0.5, 0.5), (0, 9.5), 2, 19), ((-2, 2), (9.5, 10.5), 4, 1)):
        mesh = fem.MeshQuad.init_tensor(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1))
        bases.append(fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2))
    f = bases[0].zeros()
    f[bases[0].get_dofs(lambda x: abs(x[1] - 4.75) < 0.3).all("u^1")] = push
    rubber = sc.NonlinearBody(
        bases[0], sc.materials.NeoHooke.of(1.0, 0.3), f=f, D="bottom", name="column"
    )
    head = sc.Body(bases[1], sc.Elastic(1000.0, 0.3), D="top", name="head")
    glue = sc.Contact(rubber.surface("top"), head.surface("bottom"), tied=True)
    steps = [{"x": {"head": {"top": (0.0, -down)}}} for down in (0.2, 0.35, 0.45)]
    return sc.ContactSolver([rubber, head], [glue]), steps


def test_an_answer_that_is_not_stable_is_named() -> None:
    """A column that nothing pushes aside stays straight beyond Euler's load, and the answer says so.

    It strains it by (pi b / L)^2 / 3, 3.7 %, and so shortens it by .35.
    """
    solver, steps = column(0.0)
    list(solver.history(steps[:1]))  # stable, without a word
    with pytest.warns(sc.ContactWarning, match="not stable"):
        list(solver.history(steps))
    solver, steps = column(1e-3)  # gives way, and is stable where it comes to
    list(solver.history(steps))


def test_surfaces_that_turn_under_small_sliding_are_named() -> None:
    """Contact is on the deformed surfaces with sliding="finite" alone: with "small" a word is said."""
    bases = []
    for x, y, nx, ny in (((0, 10), (0, 1), 20, 2), ((7, 8), (1, 2), 4, 4)):
        mesh = fem.MeshQuad.init_tensor(np.linspace(*x, nx + 1), np.linspace(*y, ny + 1))
        bases.append(fem.Basis(mesh.with_defaults(), fem.ElementVector(fem.ElementQuad1()), intorder=2))
    beam = sc.NonlinearBody(bases[0], sc.materials.NeoHooke.of(1000.0, 0.3), D="left", name="beam")
    tool = sc.Body(bases[1], sc.Elastic(1e5, 0.3), D="top", name="tool")
    tip = sc.Contact(tool.surface("bottom"), beam.surface("top"), name="tip")
    solver = sc.ContactSolver([beam, tool], [tip])
    solver.solve(x={"tool": {"top": (0.0, -0.2)}})  # by .04: without a word
    with pytest.warns(sc.ContactWarning, match="'tip' have turned by 0.2"):
        solver.solve(x={"tool": {"top": (0.0, -1.0)}})


def test_memory_of_factors_is_used_again_when_nobody_reads_it() -> None:
    """A tangent is factorised where the one before was; not while a response still reads that."""
    mesh = fem.MeshQuad().refined(3).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    body = sc.NonlinearBody(basis, sc.Elastic(1.0, 0.3), D="bottom")
    free = np.setdiff1d(np.arange(body.n), body.D)
    top = np.searchsorted(free, basis.get_dofs("top").flatten())
    inside = np.setdiff1d(np.arange(len(free)), top)
    given = np.cos(inside), np.zeros((len(top), len(top)))  # forces; what is kept is held

    def condensed(scale: float) -> Any:
        return sc.linalg.Direct().condensed(body, scale * body.K, free, top)

    factor = condensed(1.0)
    response = factor.response(inside)
    found = response(*given)
    where = factor.panels[0][0].ctypes.data
    del factor
    other = condensed(2.0)
    assert np.array_equal(response(*given), found)
    assert other.panels[0][0].ctypes.data != where
    del response
    again = condensed(4.0)
    assert again.panels[0][0].ctypes.data == where
    np.testing.assert_allclose(4 * again.response(inside)(*given), found, rtol=1e-13)


def test_factors_go_with_their_iterate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the garbage collector, which comes by the number of objects and not by their size."""
    made: list[weakref.ref[Any]] = []
    condensed = sc.linalg.Direct.condensed

    def noted(self: Any, body: Any, *given: Any) -> Any:
        factor = condensed(self, body, *given)
        if body.nonlinear:
            made.append(weakref.ref(factor))
        return factor

    monkeypatch.setattr(sc.linalg.Direct, "condensed", noted)
    solver, steps = plane("auto")
    gc.collect()
    gc.disable()
    try:
        for number, result in enumerate(solver.history(steps), start=1):
            assert len(made) >= 2 * number
            assert sum(factor() is not None for factor in made) <= 2, result
    finally:
        gc.enable()
