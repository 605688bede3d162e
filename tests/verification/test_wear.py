"""Wear by Archard's law: closed forms of springs, blocks and a cylinder, volumes, energies."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from scenes import block_basis, elastic, field
from solid_meshes import at, cube
from solid_meshes import elastic as solid
from test_energy import energies, spring_sliders

import skfem_contact as sc
from skfem_contact.answers import answer_of

MU = 0.3


def worn_springs(k, way, steps, down=0.02, sliding="small"):
    """Nodes pressed by springs of stiffness 2 and an overlap `down`, drawn along: slips and forces."""
    solver, step = spring_sliders(sc.Coulomb(1e-9), sliding)
    contact = solver.contacts[0]
    worn = sc.Contact(
        contact.secondary,
        contact.primary,
        friction=contact.friction,
        wear=sc.conditions.Archard(k),
        sliding=sliding,
    )
    solver = sc.ContactSolver(solver.system.bodies, worn, options=sc.Options(max_travel=np.inf))
    return list(
        solver.history([step(0.0, down), *(step(s, down) for s in np.linspace(0, way, steps + 1)[1:])])
    )


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_rigid_blocks_on_springs_wear_exponentially(sliding):
    """``dF/ds = -c F``, ``c = stiffness k / A``: ``F = F_0 exp(-c s)``; the rule is of second order."""
    errors = []
    for steps in (4, 8):
        *_, last = worn_springs(0.05, 1.0, steps, sliding=sliding)
        c = 2.0 * 0.05 / last.area
        exact = 0.04 * np.exp(-c)
        errors.append(np.max(np.abs(last.normal_force - exact)) / 0.04)
        # what a node has lost of its overlap is what has worn off
        assert_allclose(last.wear_depth, 0.02 - last.normal_force / 2.0, atol=1e-9)
        assert "cut" not in last.message
    assert errors[1] < 4e-4 and 3.5 < errors[0] / errors[1] < 4.5
    # each step by the rule of the trapezoid, to what rounds leave of it
    z = c / 16
    assert_allclose(last.normal_force, 0.04 * ((1 - z) / (1 + z)) ** 8, rtol=1e-6)


def test_steps_that_wear_too_much_are_cut():
    """A step in which springs would answer all of the wear many times over: cut, and right."""
    _, once = worn_springs(5.0, 1.0, 1)
    assert "step cut" in once.message
    c = 2.0 * 5.0 / once.area
    # forces that are nearly gone, to some thousandths of what they were
    assert np.max(np.abs(once.normal_force - 0.04 * np.exp(-c))) < 0.005 * 0.04
    assert np.all(once.wear_depth <= 0.02 * (1 + 1e-12)) and once.wear_depth.min() > 0.0199


def pushed(law=None, method="mortar", sliding="small", linear="auto", nx=12, k=2e-3, **settings):
    """An elastic block on another one of a different mesh, and a step of its top."""
    low = block_basis(np.linspace(-1, 3, 17), np.linspace(-1, 0, 5))
    top = block_basis(np.linspace(0, 2, nx + 1), np.linspace(0, 1, 5))
    bodies = [
        sc.Body(low, elastic(1.0, 0.3), D="bottom", name="low"),
        sc.Body(top, elastic(2.0, 0.2), D="top", name="top"),
    ]
    sides = bodies[1].surface("bottom"), bodies[0].surface("top")
    given = {"wear": sc.conditions.Archard(k), "friction": law or sc.Coulomb(MU), "name": "foot"}
    contact = sc.Contact(*sides, method=method, sliding=sliding, **(given | settings))
    solver = sc.ContactSolver(bodies, [contact], linear=linear)

    def step(along, down, turn=0.0):
        return {"x": {"top": field(top, lambda x: [along + 0 * x[0], -down + turn * (x[0] - 1)])}}

    return solver, step


WAYS = ((0.0, 0.01), (0.02, 0.01), (0.05, 0.02), (-0.03, 0.015), (-0.02, 0.004), (0.04, 0.01))


@pytest.mark.parametrize(
    "method, sliding", [("mortar", "small"), ("node", "small"), ("mortar", "finite")]
)
def test_the_volume_is_k_times_the_friction_work_over_mu(method, sliding):
    """With slip to and fro, points that stick and points that open, also cut: to round-off."""
    solver, step = pushed(method=method, sliding=sliding)
    last, ways = None, WAYS[: 3 if sliding == "finite" else 6]
    for result in solver.history([step(*way, 1e-3) for way in ways]):
        assert_allclose(
            result.worn_volume, 2e-3 / MU * result.dissipation_total, rtol=1e-12, atol=1e-30
        )
        if last is not None:
            assert np.all(result.wear_depth >= last.wear_depth)
        last = result
        # gaps are those of the worn surface
        assert np.abs(result.gap[result.status > 0]).max() < 1e-6 and result.certificate.worst < 1e-8
    if sliding == "small":
        assert_allclose(last.integrate(last.wear_depth), last.worn_volume, rtol=1e-12)
    assert (
        f"worn off                 {last.worn_volume:.6g}, {last.wear_depth.max():.6g} deep at"
        in str(last)
    )


@pytest.mark.parametrize("method", ["mortar", "node"])
def test_energies_balance_with_wear(method):
    """What presses on the depth worn off takes energy too: mean force times depth, point by point."""
    solver, step = pushed(method=method, k=0.5)
    last, taken = None, 0.0
    for result in solver.history([step(*way, 2e-3) for way in WAYS]):
        assert "cut" not in result.message
        work, strain = energies(result, last, solver.system.K)
        now, was = (0.0 if r is None else answer_of(r).local for r in (result, last))
        force = now.normal_force + (0.0 if last is None else was.normal_force)
        worn = now.wear - (0.0 if last is None else was.wear)
        missing = work - strain - result.dissipation - result.energy_residual - 0.5 * force @ worn
        # gaps settle to 1e-6 of the depth of a step
        assert abs(missing) <= 1e-6 * (abs(work) + 0.5 * force @ worn)
        taken += 0.5 * force @ worn
        last = result
    assert taken > 1e-3 * last.dissipation_total


@pytest.mark.parametrize("linear", [sc.linalg.Direct(), "iterated"], ids=str)
def test_other_routes_wear_alike(linear):
    """Secants in place of Newton's method for the depth; both settle to 1e-6 of a step's wear."""
    steps = WAYS[:4]
    solver, step = pushed()
    *_, one = solver.history([step(*way) for way in steps])
    solver, step = pushed(linear=linear)
    *_, other = solver.history([step(*way) for way in steps])
    assert_allclose(other.wear_depth, one.wear_depth, atol=1e-4 * one.wear_depth.max())
    assert_allclose(other.worn_volume, one.worn_volume, rtol=1e-4)


def test_an_interrupted_history_goes_on_worn(tmp_path):
    """From a file, from a pickled result, and in a solver whose contact wears no more."""
    solver, step = pushed()
    steps = [step(*way) for way in WAYS]
    whole = list(solver.history(steps))
    half = whole[2]
    solver.save_state(tmp_path / "worn.npz", half)
    for start in (solver.load_state(tmp_path / "worn.npz"), pickle.loads(pickle.dumps(half))):
        *_, again = solver.history(steps[3:], start=start)
        assert np.array_equal(again.wear_depth, whole[-1].wear_depth)
        assert again.worn_volume == whole[-1].worn_volume and np.array_equal(again.u, whole[-1].u)
    kept, _ = pushed(wear=None)
    *_, later = kept.history(steps[3:], start=half)
    assert np.array_equal(later.wear_depth, half.wear_depth) and later.worn_volume == half.worn_volume
    unworn = next(iter(kept.history(steps[3:])))
    assert np.abs(later.pressure - unworn.pressure).max() > 1e-4  # the gaps stay as they were worn


def test_a_step_that_fails_wears_nothing():
    """A load that nothing holds: the state before it is untouched, and a history goes on from it."""
    low = block_basis(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    load = np.zeros(low.N)
    load[low.get_dofs("top").all("u^2")] = -0.01 / 5
    away = np.zeros(low.N)
    away[low.get_dofs("top").all("u^1")] = 0.01 / 5
    body = sc.Body(low, elastic(1.0, 0.3), load, name="body")
    floor = sc.RigidPlane((0, 0), (0, 1))
    contact = sc.Contact(
        body.surface("bottom"), floor, friction=sc.Coulomb(0.3), wear=sc.conditions.Archard(1.0)
    )
    solver = sc.ContactSolver(body, contact)
    with pytest.raises(sc.errors.NoEquilibrium) as error:
        list(solver.history([{}, {"f": {"body": load + 0.2 * away}}, {"f": {"body": load + away}}]))
    kept = error.value.results[-1]
    depth = kept.wear_depth.copy()
    again = solver.solve(f={"body": load}, start=kept)
    assert np.array_equal(kept.wear_depth, depth) and np.all(again.wear_depth >= depth)


def test_a_cylinder_wears_flat():
    """``a = (3/2 R k P s)^(1/3)``, depth ``a^2 / 2R``, pressure ``P / 2a`` far beyond Hertz.

    A cylinder drawn over a plate: the volume worn off is the segment that is missing. What is
    elastic of it falls with (a_H / a)^2 as the way grows; here a is six times that of Hertz.
    """
    R, P, k, E, nu = 1000.0, 100.0, 1e-6, 210e3, 0.3
    basis = block_basis(np.linspace(-9, 9, 31), np.linspace(0, 9, 9))
    top = fem.FacetBasis(basis.mesh, basis.elem, facets="top", intorder=2)
    load = fem.LinearForm(lambda v, w: -P / 18 * v[1]).assemble(top)
    held = basis.get_dofs("top").all("u^1")
    body = sc.Body(basis, elastic(E, nu), load, D=held, name="cylinder")
    plate = sc.RigidPlane((0, 0), (0, 1), name="plate")
    contact = sc.Contact(
        body.surface("bottom"),
        plate,
        gap=lambda x: x[0] ** 2 / (2 * R),
        friction=sc.Coulomb(1e-6),
        wear=sc.conditions.Archard(k),
    )
    places = [0.0, 30.0, -550.0]
    *_, result = sc.ContactSolver(body, contact).history(
        [{"motion": {"plate": (place, 0.0)}} for place in places]
    )
    total = np.abs(np.diff(places)).sum()
    assert_allclose(result.worn_volume, k * P * total, rtol=1e-5)  # all of the force, all of the way
    half = (1.5 * R * k * P * total) ** (1 / 3)
    assert abs(result.wear_depth.max() / (half**2 / (2 * R)) - 1) < 0.01
    # the shape is what is missing of the parabola, and at its edges within a tenth of an element
    x = result.points[:, 0]
    shape = np.maximum(half**2 - x**2, 0) / (2 * R)
    assert np.max(np.abs(result.wear_depth - shape)) < 0.1 * 0.6 * half / R
    inside = np.abs(x) < 0.3 * half  # it falls off to what has come into contact last
    assert_allclose(result.pressure[inside], P / (2 * half), rtol=0.02)


def test_a_solid_block_wears_evenly():
    """Uniform pressure in space, dragged obliquely: depth ``k p s`` at every point, of any area."""
    block = solid(
        cube("quad4", 3),
        "quad4",
        "block",
        nu=0.0,
        held=((at(2, 1.0), (0, 1, 2)),),
        push=(at(2, 1.0), (0.0, 0.0, -0.01)),
    )
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    bottom = block.surface(lambda x: np.isclose(x[2], 0))
    contact = sc.Contact(bottom, floor, friction=sc.Coulomb(1e-9), wear=sc.conditions.Archard(0.5))
    steps = [{"motion": {"floor": s * np.array([0.3, 0.4, 0])}} for s in (0.0, 0.1, 0.2)]
    first, second, third = sc.ContactSolver(block, contact).history(steps)
    z = 0.5 * 0.05 * 0.5  # k s / 2 over the length of the block, whose modulus is one
    pressures = 0.01 * np.array([1, (1 - z) / (1 + z), ((1 - z) / (1 + z)) ** 2])
    for result, p in zip((first, second, third), pressures, strict=True):
        assert_allclose(result.pressure, p, rtol=1e-6)
    assert_allclose(third.wear_depth, 0.01 - pressures[2], rtol=1e-6)
    assert_allclose(third.worn_volume, 0.01 - pressures[2], rtol=1e-6)


def test_words():
    """What is modelled and what is refused."""
    solver, _ = pushed()
    assert "wear Archard(k=0.002) of top/bottom" in str(solver)
    surface, plane = solver.contacts[0].secondary, solver.contacts[0].primary
    for settings, words in {
        "friction": ({}, r"without friction nothing tangential is modelled.*Coulomb\(1e-6\)"),
        "tied": ({"tied": True}, "glued surfaces do not slip"),
        "law": ({"friction": sc.Coulomb(0.1), "wear": 1e-6}, "write Archard"),
    }.values():
        with pytest.raises(sc.errors.InputError, match=words):
            sc.Contact(surface, plane, **({"wear": sc.conditions.Archard(1e-6)} | settings))
    for k in (-1.0, np.nan, np.inf, [[1.0]], []):
        with pytest.raises(sc.errors.InputError, match="Archard: k"):
            sc.conditions.Archard(k)
    with pytest.raises(sc.errors.InputError, match="k of its Archard law has shape"):
        pushed(wear=sc.conditions.Archard(np.ones(3)))
    with pytest.raises(sc.errors.InputError, match="friction is zero at 13 points"):
        pushed(friction=sc.Coulomb(0.0))
    with pytest.raises(sc.errors.InputError, match="wear"):
        solver.with_friction(None)
    with pytest.raises(TypeError, match="K / H"):
        sc.conditions.Archard(hardness=3.0)


def test_wear_that_another_contact_does_not_feel():
    """Two tools on one surface: each has it unworn by the other, and that is said once."""
    basis = block_basis(np.linspace(-2, 2, 9), np.linspace(-1, 0, 3))
    body = sc.Body(basis, elastic(1.0, 0.3), D="bottom", name="block")
    tools = [sc.RigidCylinder((x, 1.0), 1.0) for x in (-0.5, 0.5)]

    def solver(*wear, where=("top", "top")):
        contacts = [
            sc.Contact(body.surface(side), tool, friction=sc.Coulomb(0.2), wear=k, name=name)
            for k, tool, name, side in zip(wear, tools, "ab", where, strict=True)
        ]
        return sc.ContactSolver(body, contacts)

    k = sc.conditions.Archard(1e-3)
    with pytest.warns(sc.ContactWarning, match="wears in contact 'a' and is in contact 'b'") as told:
        solver(k, k)
    assert len(told) == 1 and told[0].filename == __file__
    with pytest.warns(sc.ContactWarning, match="wears in contact 'b' and is in contact 'a'"):
        solver(None, k)
    middles = basis.mesh.p[0, basis.mesh.facets].mean(axis=0)
    top = basis.mesh.boundaries["top"]
    halves = [top[s * middles[top] > 0] for s in (-1, 1)]
    solver(k, k, where=halves)  # warnings are errors here
    solver(None, None)


def test_files_have_the_depth(tmp_path):
    """Where something wears, from the first step on; elsewhere there is no such field."""
    meshio = pytest.importorskip("meshio")
    for wear, wanted in ((sc.conditions.Archard(0.1), True), (None, False)):
        solver, step = pushed(wear=wear)
        first, last = solver.history([step(*way) for way in WAYS[:2]])
        for result in (first, last):
            data = meshio.read(sc.write(tmp_path / "worn.vtu", result)[1]).point_data
            assert ("wear_depth" in data) == wanted
            if wanted:
                assert_allclose(data["wear_depth"], result.wear_depth)
