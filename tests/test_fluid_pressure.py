"""The pressure of a fluid on a boundary that deforms: closed forms, its derivative, load steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc

AXISYMMETRIC = {"measure": lambda x: 2 * np.pi * x[0]}
FOAM = sc.materials.NeoHooke.of(1.0, 0.3)


def block(mesh: Any, element: Any, **given: Any) -> sc.NonlinearBody:
    return sc.NonlinearBody(fem.Basis(mesh, fem.ElementVector(element), intorder=4), FOAM, **given)


@pytest.mark.parametrize("given", [{}, AXISYMMETRIC])
@pytest.mark.parametrize("element", [fem.ElementQuad1(), fem.ElementQuad2()])
def test_the_load_is_that_on_the_chord(element: Any, given: Any) -> None:
    """Whatever the deformed curve; along the axis that on the area between the radii of its ends."""
    mesh = fem.MeshQuad().refined(3).translated((1.0, 0.0)).with_defaults()
    body = block(mesh, element, **given)
    x, y = body.basis.doflocs
    u = np.where(body.dof_component == 0, 0.1 * y + 0.2 * y**2, 0.3 * x * y)
    f, _ = body.pressed(body.fluid({"right": 0.7}), u)
    expected = 0.7 * np.pi * (2.3**2 - 2.0**2) if given else 0.7 * 0.3
    assert f[body.dof_component == 1].sum() == pytest.approx(expected, rel=1e-12)
    if not given:
        assert f[body.dof_component == 0].sum() == pytest.approx(-0.7 * 1.6, rel=1e-12)


@pytest.mark.parametrize(
    ("mesh", "element", "given"),
    [
        (fem.MeshQuad().translated((1.0, 0.0)), fem.ElementQuad2(), {}),
        (fem.MeshQuad().translated((1.0, 0.0)), fem.ElementQuad1(), AXISYMMETRIC),
        (fem.MeshHex(), fem.ElementHex1(), {}),
        (fem.MeshTet(), fem.ElementTetP2(), {}),
    ],
)
def test_the_derivative_is_exact_all_around(mesh: Any, element: Any, given: Any) -> None:
    """All around a body a fluid has a potential, its pressure times the volume: no part is left out."""
    body = block(mesh.refined(1), element, **given)
    pressures = np.zeros(body.basis.mesh.nfacets)
    pressures[body.basis.mesh.boundary_facets()] = 0.7
    u = 0.02 * np.sin(np.arange(body.n))
    way = np.cos(np.arange(body.n))
    K, h = body.pressed(pressures, u)[1], 1e-6
    change = body.pressed(pressures, u + h * way)[0] - body.pressed(pressures, u - h * way)[0]
    assert_allclose(K @ way, change / (2 * h), rtol=0, atol=1e-8)  # differences of round-off over h


def ring(material: Any, pressure: Any, n: int = 6) -> tuple[sc.ContactSolver, sc.NonlinearBody]:
    """A quarter of a ring of radii 1 and 2 in a fluid; one plane of symmetry is a smooth floor."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(1, 2, n + 1), np.linspace(0, np.pi / 2, 2 * n + 1))
    named = mesh.with_boundaries(
        {
            "outer": lambda x: x[0] > 2 - 1e-9,
            "low": lambda x: x[1] < 1e-9,
            "side": lambda x: x[1] > 1.57,
        }
    )
    r, t = mesh.p
    mesh = fem.MeshQuad(np.array([r * np.cos(t), r * np.sin(t)]), mesh.t, _boundaries=named.boundaries)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    side = basis.get_dofs("side").all("u^1")
    body = sc.NonlinearBody(basis, material, f={"outer": pressure}, D=side, name="ring")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    return sc.ContactSolver(body, sc.Contact(body.surface("low"), floor, sliding="finite")), body


def test_a_ring_in_a_fluid() -> None:
    """Thick, incompressible, neo-Hooke: the pressure at which its inner radius is .9 has a closed form.

    With ``r^2 - R^2 = c`` the difference of principal stresses over r is integrated over the wall.
    """
    inner, c = 0.9, 0.9**2 - 1.0
    outer = np.sqrt(4.0 + c)
    pressure = -0.5 * np.log(4.0) + np.log(outer / inner) + c / 2 * (1 / outer**2 - 1 / inner**2)
    wrong = []
    for n in (6, 12):
        rubber = sc.materials.MooneyRivlin(0.5, bulk=5000.0)
        solver, body = ring(rubber, pressure, n)
        result = solver.solve()
        p, u = body.basis.mesh.p, result.displacement("ring")[body.basis.nodal_dofs]
        radius = np.hypot(*(p + u))[np.hypot(*p) < 1 + 1e-9]
        assert np.ptp(radius) < 1e-10
        wrong.append(radius.mean() - inner)
    # the floor and the other plane of symmetry bear the pressure on the shadow of the outer side, by
    # balance to round-off; the radius comes by the square of the element
    assert_allclose(result.reaction("ring")[0], pressure * result_radius(result, body), rtol=1e-9)
    assert_allclose(result.force[1], pressure * result_radius(result, body), rtol=1e-9)
    assert abs(wrong[0]) < 4e-4
    assert abs(wrong[1]) < abs(wrong[0]) / 4


def result_radius(result: Any, body: Any) -> float:
    """The largest radius of a deformed ring."""
    u = result.displacement("ring")[body.basis.nodal_dofs]
    return float(np.max(np.hypot(*(body.basis.mesh.p + u))))


def test_residuals_fall_quadratically() -> None:
    """With the derivative of the load: the last residuals are as squares of those before."""
    for result in ring(FOAM, 0.06)[0].history([0.5, 1.0]):
        a, b, c = (iteration.residual for iteration in result.newton[-3:])
        assert b < max(10 * a**2, 1e-12)  # round-off, where areas alone were left
        assert c < max(10 * b**2, 1e-12)


def test_residuals_fall_as_fast_where_a_free_rim_ends_the_wet_surface() -> None:
    """Of the derivative what is not symmetric belongs to the rim; without it they fall by .35 each."""
    mesh = fem.MeshQuad().refined(3).with_defaults()
    wet = mesh.with_boundaries({"wet": lambda x: (x[0] == 0) & (x[1] > 0.5)})
    body = block(wet, fem.ElementQuad1(), D="bottom", f={"wet": 0.3}, name="block")
    ceiling = sc.RigidPlane((0, 1), (0, -1), name="ceiling")
    contact = sc.Contact(body.surface("top"), ceiling, friction=sc.Coulomb(0.2))
    result = sc.ContactSolver(body, contact).solve(motion={"ceiling": (0.0, -0.05)})
    print(result.newton)
    a, b, c = (iteration.residual for iteration in result.newton[-3:])
    assert b < 10 * a**2
    assert c < max(10 * b**2, 1e-12)


@pytest.mark.filterwarnings("ignore:The place of body 'ring' is indifferent")  # unloaded it may rise
def test_pressures_of_load_steps(tmp_path: Path, caplog: Any) -> None:
    """By name, as a function, as a multiple, kept where a step does not name loads, and on disk."""
    solver, body = ring(FOAM, 0.06)
    full, kept = solver.history([1.0, {"motion": {"floor": (0.0, 0.0)}}])
    assert_allclose(kept.u, full.u, rtol=0, atol=1e-10)
    by_name = {"f": {"ring": {"outer": lambda x: 0.03 + 0 * x[0]}}}
    half, again = solver.history([by_name, {"f": {"ring": 1.0}}])
    assert_allclose(half.u, solver.solve(f={"ring": {"outer": 0.03}}).u, rtol=0, atol=1e-10)
    assert_allclose(again.u, full.u, rtol=0, atol=1e-9)
    assert_allclose(solver.with_load("ring", {"outer": 0.03}).solve().u, half.u, rtol=0, atol=1e-10)
    path = solver.save_state(tmp_path / "state", half)
    steps = [{"motion": {"floor": (0.0, 0.01)}}]
    (there,) = solver.history(steps, start=half)
    (other,) = ring(FOAM, 0.06)[0].history(steps, start=solver.load_state(path))
    assert np.array_equal(there.u, other.u)
    # taken back, without a word of empty boundaries
    caplog.clear()
    *_, free = solver.history([1.0, 0.0])
    assert abs(free.u).max() < 1e-12
    assert not caplog.records
    # a vector keeps its direction
    dead = solver.solve(f={"ring": body.f})
    assert abs(dead.u - full.u).max() > 0.005


def test_derivatives_of_an_answer_in_a_fluid() -> None:
    """By the pressure and by the radius of a tube, as differences of two answers have them.

    Both differences are by a width of 1e-4: they leave its square.
    """

    def tube(k: float, pressure: float = 0.2) -> sc.ContactSolver:
        axes = np.linspace(1, 2, 7) * (1 + k), np.linspace(0, 1, 5)
        mesh = fem.MeshQuad.init_tensor(*axes).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=3)
        top = basis.get_dofs("top").all("u^2")
        body = sc.NonlinearBody(basis, FOAM, f={"right": pressure}, D=top, name="tube", **AXISYMMETRIC)
        floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, interference=0.02))

    width = 1e-4
    less, more = tube(-width / 2), tube(width / 2)
    result = tube(0.0).solve()
    wider = result.sensitivity(sc.answers.Parameter("scene", between=(less, more, width))).u
    found = (more.solve().u - less.solve().u) / width
    assert_allclose(wider, found, rtol=0, atol=1e-8 * abs(found).max())
    pressed = result.sensitivity("load").u  # by a factor on the pressure
    ends = (tube(0.0, 0.2 * (1 + side * width / 2)).solve().u for side in (1, -1))
    found = np.subtract(*ends) / width
    assert_allclose(pressed, found, rtol=0, atol=1e-8 * abs(found).max())


def test_derivatives_where_a_free_rim_ends_the_wet_surface() -> None:
    """The load of the fluid has no potential there: forwards, backwards, and as modes have it.

    Against differences by a width of 1e-4, which leave its square, and against a dense pencil.
    """
    mesh = fem.MeshQuad().refined(2).with_defaults()
    wet = mesh.with_boundaries({"wet": lambda x: (x[0] == 0) & (x[1] > 0.5)})
    ceiling = sc.RigidPlane((0, 1), (0, -1), name="ceiling")
    steps = [{"motion": {"ceiling": (w, -0.05)}} for w in (0.0, 0.02)]

    def scene(p: float = 0.1, mu: float = 0.2) -> sc.ContactSolver:
        given = {"D": "bottom", "f": {"wet": p}, "mass": 1.0, "name": "block"}
        body = block(wet, fem.ElementQuad1(), **given)
        return sc.ContactSolver(body, sc.Contact(body.surface("top"), ceiling, friction=sc.Coulomb(mu)))

    solver, width, known = scene(), 1e-4, {}
    first, last = solver.history(steps)
    tangent = last.linearized
    assert {1, 2} <= set(tangent.status)
    for by, changed in ("load", {"p": 0.1}), ("friction", {"mu": 0.2}):
        known[by] = last.sensitivity(by, after=first.sensitivity(by))
        size = 1.0 if by == "load" else 0.2
        ends = [
            [*scene(**{k: v * (1 + side * width / 2) for k, v in changed.items()}).history(steps)][-1].u
            for side in (1, -1)
        ]
        found = np.subtract(*ends) / (width * size)
        assert_allclose(known[by].u, found, rtol=0, atol=1e-7 * abs(found).max())
    way = np.cos(np.arange(len(last.u)))
    weights = {"u": way, "normal_force": way[: len(tangent.status)]}
    by_all = solver.gradient(lambda results: (0.0, [None, weights]), steps, by=[*known])
    assert_allclose(by_all.parts, [own.dot(weights) for own in known.values()], rtol=1e-11)
    found = solver.modes(last, 6, slipping="steady")
    M = tangent.W.T @ solver.system.bodies[0].mass @ tangent.T
    squares = scipy.linalg.eigvals(tangent.K_r.toarray(), M.toarray())
    assert_allclose(found.frequency, np.sort(np.sqrt(squares.real))[:6] / (2 * np.pi), rtol=1e-9)


def test_a_small_vibration_in_a_fluid_is_that_of_its_mode() -> None:
    """The fluid follows the boundary when inertia forces are added: their loop has its frequency."""
    body = ring(FOAM, 0.06, 2)[1]
    given = {"f": {"outer": 0.06}, "D": body.D, "mass": 1.0, "name": "ring"}
    body = sc.NonlinearBody(body.basis, FOAM, **given)
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    solver = sc.ContactSolver(body, sc.Contact(body.surface("low"), floor))
    result = solver.solve()
    modes = solver.modes(result, 1)
    # bodies that are not linear are off by the square of the amplitude
    found = solver.damping(result, modes, [1e-5], steps=2)
    assert_allclose(found.frequency, modes.frequency, rtol=1e-6)


def test_what_is_refused() -> None:
    """Functions where nothing follows the boundary or of other shapes, unknown names, no numbers."""
    mesh = fem.MeshQuad().refined(1).with_defaults().with_boundaries({"nowhere": lambda x: x[0] > 2})
    body = block(mesh, fem.ElementQuad1())
    for given, message in (
        ({"rihgt": 1.0}, "did you mean 'right'"),
        ({"rihgt": lambda x: x[0]}, "did you mean 'right'"),
        ({"right": np.nan}, "not finite"),
        ({"right": lambda x: np.nan * x[0]}, "pressure"),
        ({"right": lambda x: 0 * x}, r"has shape \(2, 2\) .* one number for each position"),
        ({"right": lambda x: None}, "not made of real numbers; it must return one number"),
        ({"nowhere": lambda x: x[0]}, "no facets in the mesh"),
    ):
        with pytest.raises(sc.errors.InputError, match=message):
            body.load(given, "f")
    linear = sc.NonlinearBody(body.basis, sc.Elastic(1.0, 0.3), f={"right": 1.0})
    assert linear.pressures is None
    assert_allclose(linear.f, sc.Body(body.basis, sc.Elastic(1.0, 0.3), f={"right": 1.0}).f, rtol=0)
    assert_allclose(linear.load({"right": lambda x: 1.0 + 0 * x[0]}, "f"), linear.f, rtol=0, atol=1e-15)
