"""The interface as users meet it: what is public, unknown keywords, printing, replacing, going on."""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from quick_elasticity import linear_elasticity
from rectangles import rectangle

import skfem_contact as sc

FLOOR = sc.RigidPlane((0, 0), (0, 1), name="floor")


def block(**given):
    basis = rectangle(np.linspace(0, 2, 7), np.linspace(0, 1, 4))
    return sc.Body(basis, linear_elasticity(0.0, 0.5), name="block", **given)


def solver_of(body, **contact):
    contact.setdefault("friction", sc.Coulomb(0.3))
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR, name="joint", **contact))


def joined():
    return solver_of(block(D="top"))


SURFACE = block().surface("bottom")
UNKNOWN = {
    "Contact mu": (lambda: sc.Contact(SURFACE, FLOOR, mu=0.3), r"friction=Coulomb\(mu"),
    "Contact slave": (lambda: sc.Contact(slave=SURFACE, primary=FLOOR), "write secondary"),
    "Elastic plane": (lambda: sc.Elastic(1.0, 0.3, plane="stress"), "recipes/plane_stress.md"),
    "Contact slidng": (lambda: sc.Contact(SURFACE, FLOOR, slidng="finite"), "did you mean 'sliding'"),
    "Options tol": (lambda: sc.Options(tol=1e-8), "did you mean 'tolerance'"),
    "Options maxiter": (lambda: sc.Options(maxiter=8), "did you mean 'max_iterations'"),
    "ContactSolver tol": (lambda: sc.ContactSolver([], [], tol=1), r"Options\(tolerance=\.\.\.\)"),
    "ContactSolver max_cuts": (lambda: sc.ContactSolver([], [], max_cuts=1), r"Options\(max_cuts="),
    "ContactSolver f": (lambda: sc.ContactSolver([], [], f=1), r"solver\.solve"),
    "Coulomb f": (lambda: sc.Coulomb(f=0.3), "mu"),
    "Coulomb taumax": (lambda: sc.Coulomb(0.3, taumax=1.0), "did you mean 'tau_max'"),
    "Tresca limit": (lambda: sc.Tresca(limit=3.0), "write tau_max"),
    "Body displacement": (lambda: block(displacement=0), r"Known arguments: 'D', 'K', 'basis'"),
    "RigidPlane normla": (lambda: sc.RigidPlane((0, 0), normla=(0, 1)), "did you mean 'normal'"),
    "LevelSet grad": (lambda: sc.obstacles.LevelSet(abs, grad=abs), "did you mean 'gradient'"),
    "AMG tolerance": (lambda: sc.linalg.AMG(tolerance=1e-8), "write tol"),
    "history star": (lambda: solver_of(block(D="top")).history([1.0], star=1), "'start'"),
    "history tol": (
        lambda: joined().history([1.0], tol=1e-8),
        r"Options\(tolerance=.* of ContactSolver",
    ),
    "history f": (lambda: joined().history([1.0], f=1.0), "it belongs to the steps"),
    "history motion": (lambda: joined().history([1.0], motion={}), "it belongs to the steps"),
    "history throw": (lambda: joined().history([1.0], throw=False), r"solver\.solve\("),
    "solve tol": (lambda: joined().solve(tol=1e-8), r"Options\(tolerance=.* of ContactSolver"),
    "solve max_cuts": (lambda: joined().solve(max_cuts=0), r"Options\(max_cuts=.* of ContactSolver"),
    "solve mu": (lambda: joined().solve(mu=0.3), r"solver\.with_friction\(Coulomb\(mu\)\)"),
    "solve strat": (lambda: joined().solve(strat=None), "did you mean 'start'"),
    "with_friction mu": (lambda: joined().with_friction(mu=0.3), r"friction=Coulomb\(mu\)"),
    "update k": (lambda: joined().update("block", k=1), "Known arguments: 'K', 'body', 'f'"),
    "surface points": (lambda: block().surface("bottom", points=1), "Known arguments"),
    "eliminate prefers": (
        lambda: sc.elimination.eliminate(None, None, prefers=1),
        "did you mean 'prefer'",
    ),
    "write strss": (lambda: sc.write("x.vtu", None, strss=None), "'stress'"),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_unknown_keywords_are_answered(case):
    """What was meant is named; an InputError of this library, and a TypeError as everywhere."""
    call, words = UNKNOWN[case]
    name, key = case.split()
    for kind in (sc.errors.InputError, TypeError):
        with pytest.raises(kind, match=f"{name} has no argument '{key}'.*{words}"):
            call()


@pytest.mark.parametrize("cls", [sc.Contact, sc.Coulomb, sc.Options, sc.Body, sc.ContactSolver])
def test_signatures_are_seen_through(cls):
    """What answers unknown keywords hides no argument from help and editors."""
    names = list(inspect.signature(cls).parameters)
    assert names and "args" not in names and "kwargs" not in names


@dataclasses.dataclass(frozen=True, eq=False)
class Mine(sc.conditions.FrictionLaw):
    """A law of a user's own, who says nothing of printing."""

    mu: float
    length: float = 2.0

    def limit(self, normal_force, area, slip):
        return self.mu * normal_force


PRINTED = {
    "Coulomb(mu=0.3)": sc.Coulomb(0.3),
    "Coulomb(mu=0.3, tau_max=2.0, cohesion=1.0, stiffness=inf)": sc.Coulomb(
        0.3, 2.0, 1.0, stiffness=np.inf
    ),
    "Coulomb(mu=<5 numbers>)": sc.Coulomb(np.full(5, 0.3)),
    "Tresca(tau_max=3.0, stiffness=2.0)": sc.Tresca(3.0, stiffness=2.0),
    "Mine(mu=0.3, stiffness=7.0)": Mine(0.3, stiffness=7.0),
    "RigidPlane(point=(0.0, 0.0), normal=(0.0, 1.0), name='floor')": FLOOR,
    "RigidCylinder(centre=(0.0, 1.0), radius=1.0, hollow=True)": sc.RigidCylinder(
        (0, 1), 1, hollow=True
    ),
    "RigidSphere(centre=(0.0, 1.0), radius=1.0)": sc.RigidSphere((0, 1), 1.0),
}


@pytest.mark.parametrize("printed", PRINTED)
def test_values_print_as_the_call_that_makes_them(printed):
    """In the order of the call; evaluated, it makes the same value."""
    value = PRINTED[printed]
    assert repr(value) == printed
    if "<" not in printed:
        again = eval(printed, {**vars(sc), "Mine": Mine, "inf": np.inf})
        assert repr(again) == printed


CHANGES = {
    "Coulomb": (sc.Coulomb(0.3, cohesion=1.0, stiffness=2.0), {"mu": 0.4}),
    "Tresca": (sc.Tresca(3.0, stiffness=2.0), {"tau_max": 4.0}),
    "Mine": (Mine(0.3, stiffness=2.0), {"length": 4.0}),
    "RigidPlane": (FLOOR, {"point": (0.0, 1.0)}),
    "RigidCylinder": (sc.RigidCylinder((0, 1), 1.0, hollow=True), {"radius": 2.0}),
    "RigidSphere": (sc.RigidSphere((0, 1), 1.0, name="ball"), {"hollow": True}),
    "LevelSet": (sc.obstacles.LevelSet(abs), {"name": "bowl"}),
    "Contact": (sc.Contact(SURFACE, FLOOR, friction=sc.Coulomb(0.3)), {"adjust": 0.1}),
    "Body": (block(D="top"), {"name": "other"}),
    "Options": (sc.Options(tolerance=1e-8), {"max_cuts": 3}),
}


@pytest.mark.parametrize("name", CHANGES)
def test_replace_works(name):
    """dataclasses.replace changes what is named and keeps the rest."""
    value, change = CHANGES[name]
    other = dataclasses.replace(value, **change)
    for f in dataclasses.fields(value):
        found, expected = getattr(other, f.name), change.get(f.name, getattr(value, f.name))
        if isinstance(found, np.ndarray):
            assert_array_equal(found, expected)
        else:
            assert found is expected or found == expected


def test_start_means_the_same_in_solve_and_history():
    """What is not named stays as in the state: loads, displacements, motions."""
    solver = solver_of(block(D="top", x={"top": (0.0, -0.02)}))
    first = next(
        solver.history(
            [{"x": {"block": {"top": (0.001, -0.03)}}, "f": {"block": {"left": (0.0, -0.01)}}}]
        )
    )
    moved = {"motion": {"floor": (0.0, 1e-3)}}
    (there,) = solver.history([moved], start=first)
    for by_history, by_solve in (
        (next(solver.history([{}], start=there)), solver.solve(start=there)),
        (
            next(solver.history([{"x": {"block": 1.0}}], start=there)),
            solver.solve(x={"block": 1.0}, start=there),
        ),
        (
            next(solver.history([{"f": {"block": {}}}], start=there)),
            solver.solve(f={"block": {}}, start=there),
        ),
    ):
        # condensed loads are remembered in the order they came: round-off of K
        assert_allclose(by_history.u, by_solve.u, rtol=0, atol=1e-15)
        assert_allclose(by_history.forces, by_solve.forces, rtol=0, atol=1e-15)
    assert_allclose(solver.solve(start=there).force, there.force, rtol=1e-12)


def test_own_loads_are_those_of_the_solver_that_goes_on(tmp_path):
    """A multiple of the bodies' own loads stays one, of what they are in the solver at hand."""
    solver = solver_of(block(f={"top": (0.0, -0.01)}))
    half = next(solver.history([0.5]))
    twin = solver.with_load("block", {"top": (0.0, -0.03)})
    for start in (half, solver.load_state(solver.save_state(tmp_path / "half", half))):
        assert_allclose(solver.solve(start=start).force, [0.0, 0.01], atol=1e-14)
        for result in (twin.solve(start=start), next(twin.history([{}], start=start))):
            assert_allclose(result.force, [0.0, 0.03], atol=1e-14)
    named = solver.solve(f={"block": {"top": (0.0, -0.02)}})  # a load that was named is nobody's own
    assert_allclose(twin.solve(start=named).force, [0.0, 0.04], atol=1e-14)
    # released: the supports of the second solver are its own
    clamped = solver_of(block(D="top", x={"top": (0.0, -0.02)}))
    freed = solver_of(block(D="left")).solve(start=clamped.solve())
    assert_allclose(freed.u, 0.0, atol=1e-14)  # what it is without its clamp and without a load


def vars_of(place):
    """What stands in a module under its public names."""
    return {name: getattr(place, name) for name in place.__all__}


def test_only_what_is_listed_is_public():
    """dir shows the names of __all__ and the version, and nothing of how the package is built."""
    packages = [value for value in map(vars_of(sc).get, sc.__all__) if inspect.ismodule(value)]
    assert len(packages) > 10 and len(sc.__all__) - len(packages) < 30
    for place in (sc, *packages):
        shown = {name for name in dir(place) if not name.startswith("__")}
        if place not in (sc.errors, sc.reference):  # modules that are what they show
            assert shown == set(place.__all__)
        assert all(hasattr(place, name) for name in place.__all__) and set(place.__all__) <= shown
    with pytest.raises(AttributeError, match=r"no attribute 'AMG': it is in skfem_contact\.linalg"):
        _ = sc.AMG
    with pytest.raises(AttributeError, match="no attribute 'Contat'; did you mean 'Contact'"):
        _ = sc.Contat


def test_the_page_names_what_is_public():
    """The page on the interface lists every public name once, and no other."""
    page = (Path(__file__).parents[1] / "docs" / "interface.md").read_text()
    table = page.split("## What is public")[1].split("## ")[0]
    first = {name for name, value in vars_of(sc).items() if not inspect.ismodule(value)}
    others = {
        f"{package}.{name}"
        for package, value in vars_of(sc).items()
        if inspect.ismodule(value) and package not in ("reference", "materials")
        for name in value.__all__
    }
    others |= {f"materials.{name}" for name in sc.materials.__all__ if name not in first}
    assert sorted(re.findall(r"`sc\.([\w.]+)`", table)) == sorted(first | others)
