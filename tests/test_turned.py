"""Bodies that turn: what linear ones leave out is measured, glue turns with what it is glued to."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc

QUADS = fem.ElementVector(fem.ElementQuad1())
RADIUS, CLEARANCE, MU, FORCE = 8.0, 0.03, 0.12, 300.0


def ring(inner: float, outer: float, n: int, around: int, y: float = 0.0) -> fem.MeshQuad:
    half = fem.MeshQuad.init_tensor(
        np.linspace(inner, outer, n + 1), np.linspace(0, np.pi, around // 2 + 1)
    )
    left, right = (
        half.morphed(lambda p, a=a: p[0] * np.cos(p[1] + a), lambda p, a=a: p[0] * np.sin(p[1] + a) + y)
        for a in (0, np.pi)
    )
    return (left + right).with_boundaries(
        {
            "in": lambda x: np.hypot(x[0], x[1] - y) < inner + 0.1,
            "out": lambda x: np.hypot(x[0], x[1] - y) > outer - 0.1,
        }
    )


@cache
def pin(kind: str, sliding: str, angle: float = 0.05) -> tuple[Any, list[str]]:
    """A pin in a bush under a force, turned by its core; the answer, and what was warned of."""
    bush = sc.Body.from_mesh(ring(RADIUS, 12, 3, 72), QUADS, sc.Elastic(3e3, 0.4), D="out", name="bush")
    mesh = ring(3, RADIUS - CLEARANCE, 3, 60, -CLEARANCE)
    if kind == "linear":
        body: Any = sc.Body.from_mesh(mesh, QUADS, sc.Elastic(210e3, 0.3), name="pin")
    else:
        steel = sc.materials.SaintVenantKirchhoff(210e3, 0.3)
        body = sc.NonlinearBody.from_mesh(mesh, QUADS, steel, name="pin")
    core = sc.RigidBody(
        sc.RigidCylinder((0, -CLEARANCE), 3), force=(0, -FORCE), D="rotation", name="core"
    )
    glue = "small" if kind == "glued small" else "finite"
    contacts = [
        sc.Contact(body.surface("in"), core, tied=True, sliding=glue, name="glue"),
        sc.Contact(
            bush.surface("in"),
            body.surface("out"),
            friction=sc.Coulomb(MU),
            sliding=sliding,
            name="joint",
        ),
    ]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solver = sc.ContactSolver([bush, body, core], contacts)
        *_, last = solver.history([{"x": {"core": {"rotation": a}}} for a in (0.0, angle)])
    # 60 chords on 72: of a whole facet the curves are off each other by less than the clearance
    return last, [str(w.message) for w in caught]


def test_a_pin_of_finite_strain_has_the_torque_of_friction() -> None:
    """All points slip: the torque is mu R times the normal forces, and nothing is warned of."""
    result, words = pin("finite strain", "finite")
    assert not words and result.validity.holds
    # the moments of the chords' normals: (pi / 60)² of the radius
    torque = MU * RADIUS * result["joint"].normal_force.sum()
    assert_allclose(abs(result.reaction("core")[2]), torque, rtol=6e-3)


def test_a_linear_pin_leaves_out_what_is_told() -> None:
    """Contact and core have torques that differ by the share that the warning has."""
    result, words = pin("linear", "finite")
    told = [text for text in words if "'pin' is linear and has turned" in text]
    assert len(told) == 1 and not result.validity.holds
    share = result.validity.second_order["pin"]
    passed, torque = abs(result.reaction("core")[2]), MU * RADIUS * result["joint"].normal_force.sum()
    # of the torque of friction, and the moments of the chords' normals
    assert_allclose(passed / torque - 1, share, atol=0.02)
    assert share > 1.0


def test_small_sliding_leads_no_linear_body_that_turns_astray() -> None:
    """Finite sliding is no way out for it, and the warning names what is."""
    _, words = pin("linear", "small")
    assert any("'pin' does" in text and "take a NonlinearBody" in text for text in words)


def test_glue_that_stretches_what_turns_is_told() -> None:
    """With small sliding a turn is linear, and widens a pin of finite strain: its torque is wrong."""
    _, words = pin("glued small", "finite")
    assert any("'glue'" in text and text.count("sliding='finite'") == 1 for text in words)


@pytest.mark.parametrize(("nu", "told_at"), [(0.3, 0.4), (0.49, 0.2)])
def test_moment_of_what_a_glued_sleeve_stretches_is_told(nu: float, told_at: float) -> None:
    """Its share of the torque is what the torque is off that of finite sliding; told from 10 % on."""
    angles, rubber = (0.05, 0.1, 0.2, 0.4), sc.materials.NeoHooke.of(1.0, nu)
    torques, told = [], []
    for sliding in ("small", "finite"):
        bush = sc.NonlinearBody.from_mesh(ring(RADIUS, 12, 2, 32), QUADS, rubber, D="out", name="bush")
        sleeve = sc.RigidBody(sc.RigidCylinder((0, 0), RADIUS), D=("x", "y", "rotation"), name="sleeve")
        glue = sc.Contact(bush.surface("in"), sleeve, tied=True, sliding=sliding, name="glue")
        way = [{"x": {"sleeve": {"rotation": a}}} for a in angles]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            results = list(sc.ContactSolver([bush, sleeve], glue).history(way))
        torques.append(np.array([r.reaction("sleeve")[2] for r in results]))
        told.append([str(w.message) for w in caught])
        if sliding == "small":
            drifts = [r.validity.contacts["glue"].drift for r in results]
            holds = [r.validity.holds for r in results]
    small, finite = torques
    share = np.array([drift.stretch_share for drift in drifts])
    assert_allclose(share, 1 - finite / small, rtol=0.25)
    assert holds == (share <= 0.1).tolist() and angles[holds.index(False)] == told_at
    assert not told[1] and len(told[0]) == 1
    assert "stretches what is glued to it" in told[0][0] and "sliding='finite'" in told[0][0]


@pytest.mark.parametrize("mu", [0.01, 0.2])
def test_a_linear_roller_leaves_out_what_is_told_with_small_sliding(mu: float) -> None:
    """Its points turn away from where it touches the floor, with their forces: N times their way."""
    roller = sc.Body.from_mesh(ring(3, RADIUS, 3, 1440), QUADS, sc.Elastic(210e3, 0.3), name="roller")
    core = sc.RigidBody(
        sc.RigidCylinder((0, 0), 3), force=(0, -FORCE), D=("x", "rotation"), name="core"
    )
    floor = sc.RigidPlane((0, -RADIUS), (0, 1))
    contacts = [
        sc.Contact(roller.surface("in"), core, tied=True, name="glue"),
        sc.Contact(roller.surface("out"), floor, friction=sc.Coulomb(mu), name="foot"),
    ]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        steps = [{"x": {"core": {"rotation": a}}} for a in (0.0, 0.01)]
        *_, last = sc.ContactSolver([roller, core], contacts).history(steps)
    assert np.all(last["foot"].status != 1)
    passed, torque = last.reaction("core")[2], mu * FORCE * RADIUS
    share = last.validity.second_order["roller"]
    # where in a facet of 0.035 contact begins and ends: a tenth of that, on a way of 0.08
    assert_allclose(passed / torque - 1, share, rtol=0.05)
    told = any("'roller' is linear and has turned" in str(w.message) for w in caught)
    assert told == (share > 0.1) == (mu < 0.1)


def tilted(angle: float, sliding: str = "finite") -> Any:
    """A block that supports press on a plane by a thousandth, both turned by an angle."""
    mesh = fem.MeshQuad.init_tensor(*2 * [np.linspace(0, 1, 5)]).with_defaults()
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    block = sc.Body.from_mesh(mesh, QUADS, sc.Elastic(1e3, 0.0), D="top", name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(block.surface("bottom"), floor, sliding=sliding)
    moved = (turn - np.eye(2)) @ mesh.p + turn @ [[0.0], [-1e-3]]
    x = block.basis.zeros()
    x[block.basis.nodal_dofs] = moved
    step = {"x": {"block": x}, "motion": {"floor": ((0.0, 0.0), angle, (0.0, 0.0))}}
    return next(sc.ContactSolver([block], contact).history([step]))


@pytest.mark.parametrize("angle", [0.01, 0.02, 0.05])
def test_growth_of_a_linear_body_is_told(angle: float) -> None:
    """The force has to be that of the block that has not turned; what it is more is measured."""
    straight = tilted(0.0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = tilted(angle)
    more = 1 - straight.normal_force.sum() / result.normal_force.sum()
    # without lateral strain pressure is even; the share is of first order in the growth
    assert_allclose(result.validity.second_order["block"], more, rtol=0.01)
    assert bool(caught) == (more > 0.1) == (not result.validity.holds)


@pytest.mark.parametrize(("steps", "of_body"), [(2, True), (4, True), (3, False)])
def test_glue_carries_a_body_as_its_obstacle_turns(steps: int, of_body: bool) -> None:
    """As if nodes that are glued were prescribed where a turn brings them, in few steps or many."""
    mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 3)]).with_defaults()
    mesh = mesh.with_boundaries({"low": lambda x: x[2] == 0, "high": lambda x: x[2] == 1})
    rubber, cubes = sc.materials.NeoHooke.of(1.0, 0.3), fem.ElementVector(fem.ElementHex1())
    centre, angle = np.array([0.3, 0.5, 1.0]), 0.6
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    block = sc.NonlinearBody.from_mesh(mesh, cubes, rubber, D="low", name="block")
    plane = sc.RigidPlane(centre, (0, 0, -1), name="plate")
    others = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
    plate = sc.RigidBody(plane, about=centre, D=others, name="plate")
    glue = sc.Contact(
        block.surface("high"), plate if of_body else plane, tied=True, sliding="finite", name="glue"
    )
    turns = angle * np.arange(1, steps + 1) / steps
    way: list[Any] = [{"motion": {"plate": ((0, 0, 0), (0, 0, a), centre)}} for a in turns]
    if of_body:
        way = [{"x": {"plate": {"rotation z": a}}} for a in turns]
    *_, last = sc.ContactSolver([block, plate] if of_body else [block], glue).history(way)
    assert last.validity.holds

    told = sc.NonlinearBody.from_mesh(mesh, cubes, rubber, D=["low", "high"], name="block")
    x, high = told.basis.zeros(), np.flatnonzero(mesh.p[2] == 1)
    x[told.basis.nodal_dofs[:, high]] = (turn - np.eye(3)) @ (mesh.p[:, high] - centre[:, None])
    none = sc.Contact(told.surface("left"), sc.RigidPlane((-9, 0, 0), (1, 0, 0)))
    *_, other = sc.ContactSolver([told], none).history([{"x": {"block": q * x}} for q in (0.5, 1.0)])
    # Newton's method on both
    assert_allclose(last.displacement("block"), other.displacement("block"), atol=1e-8)
    assert_allclose(last["glue"].force, other.reaction("block", "high"), atol=1e-8)


def test_glue_that_nothing_faces_is_told() -> None:
    """Both faces of a slab are said to be glued to one plate; `reach` says which points are meant."""
    mesh = fem.MeshQuad.init_tensor(*2 * [np.linspace(0, 1, 4)]).with_defaults()
    slab = sc.Body.from_mesh(mesh, QUADS, sc.Elastic(1.0, 0.3), name="slab")
    disc = sc.RigidCylinder((0.5, -5), 5, name="disc")
    both = slab.surface(lambda x: (x[1] == 0) | (x[1] == 1))
    with pytest.warns(sc.ContactWarning, match=r"on disc glues 4 of 8 points.* faces 4, .*`reach`"):
        sc.ContactSolver([slab], sc.Contact(both, disc, tied=True))
    sc.ContactSolver([slab], sc.Contact(both, disc, tied=True, reach=0.5))


@pytest.mark.parametrize("of_body", [False, True], ids=["motion", "rigid body"])
@pytest.mark.parametrize("dim", [2, 3])
def test_what_turns_with_its_grips_feels_nothing(dim: int, of_body: bool) -> None:
    """A pressed square that two planes grip and turn by 30 degrees: frames change, and no force.

    A grip at a distance R that turns by a slips by R a^3 / 12 in a step, and so by 2e-4 of the square
    in each of these; it is pressed in by 1e-2.
    """
    x = np.linspace(-1, 1, 7)
    if dim == 2:
        mesh, element = fem.MeshQuad.init_tensor(x, x), fem.ElementQuad1()
    else:
        mesh, element = fem.MeshHex.init_tensor(x, x, np.array([0.0, 1.0])), fem.ElementHex1()
    ends = {"low": lambda x: x[1] < -0.999, "high": lambda x: x[1] > 0.999}
    body = sc.NonlinearBody.from_mesh(
        mesh.with_boundaries(ends),
        fem.ElementVector(element),
        sc.materials.SaintVenantKirchhoff(1000.0, 0.3),
        D=lambda basis: basis.nodal_dofs[2] if dim == 3 else [],
        name="square",
    )
    up, zero = np.eye(dim)[1], (0.0,) * dim
    tools: list[Any] = [sc.RigidPlane(-up, up, name="low"), sc.RigidPlane(up, -up, name="high")]
    if of_body:
        held = range(3 if dim == 2 else 6)
        tools = [sc.RigidBody(tool, about=zero, D=held, name=tool.name) for tool in tools]
    settings: dict[str, Any] = {"friction": sc.Coulomb(0.9), "sliding": "finite"}
    solver = sc.ContactSolver(
        [body, *tools] if of_body else body,
        [sc.Contact(body.surface(t.name), t, name=t.name, **settings) for t in tools],
    )

    def step(angle: float, depth: float) -> dict[str, Any]:
        turn: Any = angle if dim == 2 else (0.0, 0.0, angle)
        way = (depth * np.sin(angle), -depth * np.cos(angle), 0.0)[:dim]
        if not of_body:
            return {"motion": {"low": (zero, turn, zero), "high": (way, turn, zero)}}
        return {"x": {"low": (*zero, *np.atleast_1d(turn)), "high": (*way, *np.atleast_1d(turn))}}

    angles = np.radians([10.0, 20.0, 30.0])
    pressed, *_, last = solver.history([step(0.0, 0.01), *(step(a, 0.01) for a in angles)])
    assert np.all(last["high"].status == 1)
    slipped = 3 * (angles[0] ** 3 / 12) / 0.01  # over what is pressed in
    force, turned = (np.linalg.norm(r["high"].force) for r in (pressed, last))
    assert_allclose(turned, force, rtol=slipped)
    assert_allclose(last["high"].pressure.max(), pressed["high"].pressure.max(), rtol=3 * slipped)
