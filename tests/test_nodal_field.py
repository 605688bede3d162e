"""Fields of materials at nodes, in pictures and in files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose

import skfem_contact as sc
from skfem_contact.materials import FromFunction

RADIUS = {"measure": lambda x: 2 * np.pi * x[0]}


def rectangle(y: float, element: Any = None, x: float = 0.0) -> fem.Basis:
    mesh = fem.MeshQuad.init_tensor(np.linspace(x, x + 1, 5), np.linspace(y, y + 1, 5))
    return fem.Basis(mesh.with_defaults(), fem.ElementVector(element or fem.ElementQuad1()), intorder=4)


@pytest.fixture(scope="module")
def pressed() -> sc.answers.ContactResult:
    """A billet that yields under an elastic tool."""
    billet = sc.NonlinearBody(rectangle(0), sc.J2(1000.0, 0.3, 1.0), D="bottom", name="billet")
    tool = sc.Body(rectangle(1, x=0.1), sc.Elastic(2000.0, 0.3), D="top", name="tool")
    contact = sc.Contact(billet.surface("top"), tool.surface("bottom"), friction=sc.Coulomb(0.2))
    return sc.ContactSolver([billet, tool], [contact]).solve(x={"tool": {"top": (0.0, -0.01)}})


def test_an_elastic_body_as_by_its_displacements(pressed: sc.answers.ContactResult) -> None:
    """Projected stresses of points are the stresses of projected strains, as Hooke's law is linear."""
    tool = pressed.system.solids["tool"]
    expected = sc.nodal_stress(tool, pressed.displacement(tool), E=2000.0, nu=0.3)
    found = sc.output.nodal_field(pressed, "tool", "stress")
    assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    mises = sc.von_mises(tool, pressed.displacement(tool), E=2000.0, nu=0.3)
    assert_allclose(sc.output.nodal_field(pressed, tool, "von_mises"), mises, atol=1e-12 * mises.max())


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize(
    ("kind", "material"),
    [
        (sc.Body, sc.Elastic(2e5, 0.3)),
        (sc.NonlinearBody, sc.Elastic(2e5, 0.3)),
        (sc.NonlinearBody, sc.J2(2e5, 0.3, 1000.0)),
    ],
)
def test_a_free_body_that_is_warmed(kind: Any, material: Any, own: bool, tmp_path: Path) -> None:
    """Strains of a temperature that is linear in x fit: -E alpha T along the thickness, no more."""
    basis = rectangle(0, fem.ElementQuad2())
    right = np.flatnonzero((basis.mesh.p == [[1], [0]]).all(axis=0))
    D = np.concatenate([basis.nodal_dofs[:, 0], basis.nodal_dofs[1, right]])
    warm = sc.Elastic(2e5, 0.3, expansion=1e-5).warmed(lambda x: 10.0 * (1 + x[0]))
    body = kind(basis, material, f=warm if own else None, D=D, name="b")
    far = sc.Contact(body.surface("top"), sc.RigidPlane((0, 2), (0, -1)))
    steps = [0.5, 1.0] if own else [{"f": {"b": 0.5 * warm.assemble(basis)}}, {"f": {"b": warm}}]
    solver = sc.ContactSolver(body, far)
    half, hot = solver.history(steps)
    saved = solver.load_state(solver.save_state(tmp_path / "hot.npz", hot))
    (again,) = solver.history([{"x": None}], start=saved)
    for result, T in ((half, 5.0), (hot, 10.0), (again, 10.0)) if own else ((hot, 10.0),):
        found = sc.output.nodal_field(result, "b", "stress")
        expected = np.zeros_like(found)
        x = basis.with_element(fem.ElementQuad2()).doflocs[0]
        expected[:, 2, 2] = -2.0 * T * (1 + x)
        assert_allclose(found, expected, atol=1e-8)
        assert abs(result.reaction("b")).max() < 1e-8
        ax = sc.output.plot_force([result], "b", "left")
        assert abs(ax.get_lines()[0].get_ydata()).max() < 1e-8


@pytest.mark.parametrize("kind", [sc.Body, sc.NonlinearBody])
def test_a_list_of_loads_is_their_sum(kind: Any) -> None:
    """Pressed and warmed between walls: ``(1 - nu) s = -nu p - E alpha T`` across, also in steps."""
    steel = sc.Elastic(1000.0, 0.3, expansion=1e-3)
    warm, press = steel.warmed(5.0), {"top": 2.0}
    walls = {"left": "x", "right": "x"}
    body = kind(rectangle(0), steel, f=[warm, press], D=walls, name="b")
    floor = sc.Contact(body.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)))
    solver = sc.ContactSolver(body, floor)
    steps = [0.5, {"f": {"b": [press, warm, np.zeros(body.n)]}}, {"f": {"b": press}}]
    results = [*solver.history(steps), solver.with_load("b", (warm, warm, press)).solve()]
    for result, p, T in zip(results, (1, 2, 2, 2), (2.5, 5, 0, 10), strict=True):
        across = -(0.3 * p + T) / 0.7
        stress = sc.output.nodal_field(result, "b", "stress")
        assert_allclose(stress - np.diag([across, -p, across]), 0.0, atol=1e-9)
        assert_allclose(result.reaction("b", "right")[0], across, rtol=1e-9)


def test_large_strains_and_a_temperature_are_warned_of() -> None:
    """Its load is that of small strains."""
    warm = sc.Elastic(1.0, 0.3, expansion=1e-5).warmed(10.0)
    with pytest.warns(sc.ContactWarning, match="the load of a temperature is that of small strains"):
        sc.NonlinearBody(rectangle(0), sc.materials.NeoHooke.of(1.0, 0.3), f=warm, D="left")


@pytest.mark.parametrize("given", [{}, RADIUS])
@pytest.mark.parametrize("element", [fem.ElementQuad1(), fem.ElementQuad2()])
def test_large_homogeneous_strain(given: dict[str, Any], element: Any) -> None:
    """Rubber that a smooth plate presses by a fifth: Cauchy's stress is the pressure, at every node."""
    basis = rectangle(0, element)
    D = np.union1d(basis.get_dofs("left").all("u^1"), basis.get_dofs("bottom").all("u^2"))
    rubber = sc.NonlinearBody(basis, sc.materials.NeoHooke.of(1.0, 0.3), D=D, name="rubber", **given)
    plate = sc.RigidPlane((0, 1), (0, -1), name="plate")
    contact = sc.Contact(rubber.surface(["top", "right"]), plate, sliding="finite")
    result = sc.ContactSolver(rubber, contact).solve(motion={"plate": (0, -0.2)})
    assert not result.rotations  # of two faces that are stretched, and do not turn
    stress = sc.output.nodal_field(result, rubber, "stress")
    side = 1 + result.displacement(rubber)[basis.get_dofs("right").all("u^1")].mean()
    area = np.pi * side**2 if given else side
    expected = np.zeros((3, 3))
    expected[1, 1] = result.force[1] / area
    if not given:  # held along the thickness: the same material without contact knows how much
        expected[2, 2] = stress[0, 2, 2]
    assert_allclose(stress - expected, 0.0, atol=1e-9)


def test_what_a_material_remembers(pressed: sc.answers.ContactResult, tmp_path: Path) -> None:
    """Internal variables by name, never below zero where they are not; NaN, and grey, elsewhere."""
    names = ["stress", "equivalent_plastic_strain", "plastic_strain"]
    path, _ = sc.write(tmp_path / "pressed.vtu", pressed, stress=names, units={"stress": "MPa"})
    meshio = pytest.importorskip("meshio")
    found = meshio.read(path).point_data
    strain = sc.output.nodal_field(pressed, "billet", "equivalent_plastic_strain")
    points = pressed.state["billet"]["equivalent_plastic_strain"]
    assert strain.min() >= 0.0 and strain.max() > points.mean() > 0
    assert_allclose(found["equivalent_plastic_strain"][: len(strain)], strain)
    assert np.isnan(found["equivalent_plastic_strain"][len(strain) :]).all()
    assert found["plastic_strain"].shape == (2 * len(strain), 6)
    assert np.isfinite(found["stress"]).all()
    text = path.read_text(encoding="latin-1")
    assert text.count("MPa") == 1  # strains have no unit
    pytest.importorskip("matplotlib")
    ax = sc.plot_deformed(pressed, stress="equivalent_plastic_strain")
    bar = ax.figure.axes[-1]
    assert bar.get_ylabel() == "equivalent plastic strain"
    assert bar.get_ylim() == pytest.approx((0.0, strain.max()), abs=1e-12)
    ax = sc.plot_deformed(pressed, stress="plastic_strain", component="yy", units={"stress": "MPa"})
    assert ax.figure.axes[-1].get_ylabel() == "plastic strain yy"


def test_words(pressed: sc.answers.ContactResult) -> None:
    """Fields that are unknown, and bodies that keep no material."""
    with pytest.raises(sc.errors.InputError, match=r"did you mean 'equivalent_plastic_strain'\?"):
        sc.output.nodal_field(pressed, "billet", "equivalent_plastic")
    with pytest.raises(sc.errors.InputError, match="'tool' has no field 'plastic_strain'"):
        sc.output.nodal_field(pressed, "tool", "plastic_strain")
    with pytest.raises(sc.errors.InputError, match="has no field 'p'"):
        sc.plot_deformed(pressed, stress="p")
    tool = pressed.system.solids["tool"]
    plain = sc.Body(tool.basis, tool.K, D="bottom", name="plain")
    floor = sc.RigidPlane((0, 2), (0, -1))
    solver = sc.ContactSolver(plain, sc.Contact(plain.surface("top"), floor))
    assert plain.material is None
    with pytest.raises(
        sc.errors.InputError, match="'plain' has no field 'stress'; it keeps no material"
    ):
        sc.output.nodal_field(solver.solve(), "plain", "stress")


def test_a_stiffness_that_was_replaced_has_no_material() -> None:
    """The stress of an elastic body is no longer that of its material once its stiffness is another."""
    body = sc.Body(rectangle(0), sc.Elastic(2000.0, 0.3), D="bottom", name="body")
    floor = sc.RigidPlane((0, 1), (0, -1), name="plate")
    solver = sc.ContactSolver(body, sc.Contact(body.surface("top"), floor))
    step = {"motion": {"plate": (0, -0.01)}}
    assert solver.solve(**step).stress("body").shape == (3, 3, 16, 9)
    with pytest.raises(sc.errors.InputError, match="keeps no material"):
        solver.with_stiffness("body", 2.0 * body.K).solve(**step).stress("body")


def test_variables_of_other_shapes_are_refused() -> None:
    """A picture or a file takes numbers, vectors and tensors."""
    elastic = sc.Elastic(100.0, 0.3)
    law = FromFunction(lambda H, state: (*elastic(H, {})[:2], state), {"five": np.zeros(5)})
    body = sc.NonlinearBody(rectangle(0), law, D="bottom", name="body")
    floor = sc.RigidPlane((0, 1), (0, -1))
    result = sc.ContactSolver(body, sc.Contact(body.surface("top"), floor)).solve()
    with pytest.raises(sc.errors.InputError, match=r"shape \(25, 5\)"):
        sc.plot_deformed(result, stress="five")
