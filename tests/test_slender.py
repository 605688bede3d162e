"""Slender linear bodies: what large displacements would change, beside bodies that follow them."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc

E, NU = 210e3, 0.3
#: What the expansion leaves out is of fourth order: this much of the share where that is about one.
NEXT_ORDER = 0.08


def body(mesh: Any, kind: str, element: Any = None, **settings: Any) -> Any:
    """A body of steel, linear or not."""
    quadratic = {2: fem.ElementQuad2, 3: fem.ElementHex2}[mesh.dim()]()
    basis = fem.Basis(mesh, fem.ElementVector(element or quadratic))
    if kind == "nonlinear":
        return sc.NonlinearBody(basis, sc.materials.SaintVenantKirchhoff(E, NU), **settings)
    if kind == "matrix":
        K = sc.Elastic(E, NU).form().assemble(basis)
        return sc.Body(basis, K, **settings)
    return sc.Body(basis, sc.Elastic(E, NU), **settings)


def pressed(
    way: float, kind: str = "linear", ends: Any = ("left", "right"), angle: float = 0.0, **options: Any
) -> tuple[list[sc.answers.ContactResult], list[str]]:
    """A strip of 40 by 1, held at its ends, under a cylinder; all answers, and the words of warnings.

    Half of it by its symmetry, with ``ends=("left", {"right": "x"})``.
    """
    half = len(ends) == 2 and isinstance(ends[1], dict)
    x = np.linspace(0, 20 if half else 40, 13 if half else 25)
    mesh = fem.MeshQuad.init_tensor(x, np.linspace(0, 1, 3)).with_defaults()
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mesh = type(mesh)(turn @ mesh.p, mesh.t, _boundaries=mesh.boundaries)
    held = {"left": ("x", "y"), **ends[1]} if half else list(ends)
    strip = body(mesh, kind, D=held, name="strip")
    tool = sc.RigidCylinder(turn @ [20, 31], 30, name="tool")
    solver = sc.ContactSolver(strip, sc.Contact(strip.surface("top"), tool), **options)
    steps = [{"motion": {"tool": tuple(turn @ (0, -way * k / 4))}} for k in range(1, 5)]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        results = list(solver.history(steps))
    return results, [str(w.message) for w in caught if "large displacements" in str(w.message).lower()]


def share(result: sc.answers.ContactResult, name: str = "strip") -> float:
    """The share that is told, whatever else is warned of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)
        return result.validity.displacement[name]


@pytest.mark.parametrize("ends", [("left", "right"), ("left", {"right": "x"})], ids=["whole", "half"])
@pytest.mark.parametrize("way", [0.5, 1.0])
def test_a_strip_stretches_as_it_bends(way: float, ends: Any) -> None:
    """Von Karman: its force grows by the cube of the way as well; a half tells what the whole does."""
    (*_, linear), _ = pressed(way, ends=ends)
    (*_, true), _ = pressed(way, "nonlinear", ends=ends)
    more = true.normal_force.sum() / linear.normal_force.sum() - 1
    assert_allclose(share(linear), more, rtol=NEXT_ORDER * max(more, 0.5))
    assert more > way**2 / 2
    assert true.validity.displacement == {}


def test_it_is_said_once_from_a_tenth_on() -> None:
    """At the first step that is looked at and is beyond, once; before and in a stiff strip never."""
    results, said = pressed(1.0)
    shares = [share(result) for result in results]
    assert shares[0] == 0.0 or shares[0] < 0.1 < shares[2]
    assert (
        len(said) == 1 and said[0].startswith("Body 'strip' is linear") and "NonlinearBody" in said[0]
    )
    assert ("displacement", "strip") in results[-1].validity.problems
    assert f"large displacements change {100 * shares[-1]:.2g} %" in str(results[-1].validity)
    _, said = pressed(0.2)
    assert not said


@pytest.mark.parametrize("height", [0.3, 1.0])
def test_a_disc_spring_loses_its_height(height: float) -> None:
    """As Almen and Laszlo have it: the force falls below that of the undeformed cone."""
    forces, told = [], 0.0
    for kind in ("linear", "nonlinear"):
        mesh = fem.MeshQuad.init_tensor(np.linspace(15, 30, 13), np.linspace(0, 0.6, 3))
        mesh = mesh.with_defaults()
        cone = mesh.morphed(lambda p: p[0], lambda p: p[1] + height * (30 - p[0]) / 15)
        disc = body(cone, kind, measure=lambda x: 2 * np.pi * x[0], name="disc")
        planes = sc.RigidPlane((0, 0.6 + height), (0, -1), name="tool"), sc.RigidPlane((0, 0), (0, 1))
        sides = zip(("top", "bottom"), planes, strict=True)
        contacts = [sc.Contact(disc.surface(side), plane, name=side) for side, plane in sides]
        steps = [{"motion": {"tool": (0, -0.75 * height * k / 3)}} for k in (1, 2, 3)]
        *_, last = sc.ContactSolver(disc, contacts).history(steps)
        forces.append(last["top"].normal_force.sum())
        told = told or share(last, "disc")
    assert_allclose(told, 1 - forces[1] / forces[0], rtol=0.03)
    assert told > 0.1


def test_a_shallow_arch_gives_way_at_once() -> None:
    """Its force falls in proportion to its way, where rotations are small beside strains."""
    forces, told = [], 0.0
    for kind in ("linear", "nonlinear"):
        mesh = fem.MeshQuad.init_tensor(np.linspace(-20, 20, 33), np.linspace(0, 1, 3)).with_defaults()
        mesh = mesh.morphed(lambda p: p[0], lambda p: p[1] + 1 - (p[0] / 20) ** 2)
        arch = body(mesh, kind, D=["left", "right"], name="arch")
        tool = sc.RigidCylinder((0, 32), 30, name="tool")
        solver = sc.ContactSolver(arch, sc.Contact(arch.surface("top"), tool))
        result = solver.solve(motion={"tool": (0, -0.1)})
        forces.append(result.normal_force.sum())
        told = share(result, "arch") if kind == "linear" else told
    assert_allclose(told, 1 - forces[1] / forces[0], rtol=0.03)
    assert told > 0.05


@pytest.mark.parametrize(
    "other",
    [
        {"linear": "condensed"},
        {"linear": "iterated"},
        pytest.param({"linear": sc.linalg.Direct()}, id="Direct"),
        pytest.param({"linear": sc.linalg.AMG()}, marks=pytest.mark.slow, id="AMG"),
        {"kind": "matrix"},
        {"angle": 0.5},
    ],
    ids=str,
)
def test_the_share_is_that_of_the_scene(other: dict[str, Any]) -> None:
    """Whatever solves the linear problem, whatever gives the stiffness, wherever the axes point."""
    one, two = (share(pressed(1.0, **given)[0][-1]) for given in ({}, other))
    assert_allclose(two, one, rtol=1e-6)  # multigrid solves to 1e-10 of what is off by 1e4 of it


def test_a_cantilever_becomes_shorter_and_is_as_stiff_as_before() -> None:
    """Most of what its rotations stretch is taken up: with all of it, it were 458 times as stiff."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 100, 51), np.linspace(0, 1, 3)).with_defaults()
    beam = body(mesh, "linear", D="left", name="beam")
    tool = sc.RigidCylinder((90, 5), 4, name="tool")
    contact = sc.Contact(beam.surface("top"), tool, sliding="finite")
    steps = [{"motion": {"tool": (0, -k)}} for k in range(1, 6)]
    with warnings.catch_warnings():
        warnings.filterwarnings("error", ".*arge displacements")
        *_, last = sc.ContactSolver(beam, contact).history(steps)
        # its end comes nearer by .6 theta^2 L, with theta = 1.5 * 5 / 90 there, of a way of 5.6
        assert 0.02 < last.validity.displacement["beam"] < 0.05
        assert last.validity.holds


@pytest.mark.parametrize("what", ["yields", "warmed", "loose"])
def test_what_is_not_known_is_no_number(what: str) -> None:
    """Stress is not that of strain in what yields or is warm, and a loose body may stand elsewhere."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 40, 25), np.linspace(0, 1, 3)).with_defaults()
    basis, steel = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad2())), sc.Elastic(E, NU)
    held: dict[str, Any] = {"D": ["left", "right"], "name": "strip"}
    if what == "loose":
        held["D"] = None
        strip: Any = sc.Body(basis, steel, **held)
    elif what == "yields":
        strip = sc.NonlinearBody(basis, sc.J2(E, NU, [(1e6, 0)]), **held)
    else:
        steel = sc.Elastic(E, NU, expansion=1e-5)
        strip = sc.Body(basis, steel, steel.warmed(1.0), **held)
    contacts = [sc.Contact(strip.surface("top"), sc.RigidCylinder((20, 30.5), 30, name="tool"))]
    if what == "loose":
        ends = [sc.RigidCylinder((x, -5), 5) for x in (5, 35)]
        contacts += [sc.Contact(strip.surface("bottom"), end, name=f"end {end}") for end in ends]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sc.ContactWarning)
        result = sc.ContactSolver(strip, contacts, linear="iterated").solve()
        assert np.isnan(result.validity.displacement["strip"])
        assert "displacement" not in dict(result.validity.problems)


@pytest.mark.slow
def test_a_plate_under_a_ball_stretches_too() -> None:
    """A quarter of one that is clamped all around, pressed by .4 of its thickness."""
    last = {}
    for kind in ("linear", "nonlinear"):
        x = np.linspace(0, 20, 5)
        mesh = fem.MeshHex.init_tensor(x, x, [0, 1]).with_defaults()
        held = {"right": ("x", "y", "z"), "top": ("x", "y", "z"), "left": "x", "bottom": "y"}
        plate = body(mesh, kind, D=held, name="plate")
        ball = sc.RigidSphere((0, 0, 9), 8, name="ball")
        solver = sc.ContactSolver(plate, sc.Contact(plate.surface("back"), ball))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sc.ContactWarning)
            *_, last[kind] = solver.history([{"motion": {"ball": (0, 0, -z)}} for z in (0.2, 0.4)])
    force = {kind: result.normal_force.sum() for kind, result in last.items()}
    more = force["nonlinear"] / force["linear"] - 1
    assert more > 0.05
    assert_allclose(share(last["linear"], "plate"), more, rtol=0.02)
