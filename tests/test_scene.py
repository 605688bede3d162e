"""Pictures in space by PyVista: what is in them, judged by the meshes that are drawn and by pixels."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from solid_meshes import KINDS, at, cube, elastic

import skfem_contact as sc

HINT = "PyVista is not installed: pip install pyvista (the extras 'scene' and 'test' have it)"


def pressed(kind: str = "quad4", friction: Any = None) -> sc.answers.ContactResult:
    """A cube whose floor has been moved up by 0.01, and to the side by friction."""
    block = elastic(cube(kind, 2), kind, "block", held=((at(2, 1.0), (0, 1, 2)),), nu=0.0)
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    contact = sc.Contact(block.surface(at(2, 0.0)), floor, name="joint", friction=friction)
    return next(sc.ContactSolver([block], contact).history([{"motion": {"floor": (0, 0, 0.01)}}]))


def drawn(plotter: Any) -> list[Any]:
    """The meshes of a scene."""
    found = [getattr(getattr(a, "mapper", None), "dataset", None) for a in plotter.actors.values()]
    return [mesh for mesh in found if mesh is not None]


def pressed_ball() -> sc.answers.ContactResult:
    """A ball of tetrahedra whose top has been pressed down by 0.05, on a plane below it."""
    mesh = fem.MeshTet.init_ball(2).with_boundaries({"low": lambda x: x[2] < -0.6})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTetP1()), intorder=2)
    top = basis.get_dofs(lambda x: x[2] > 0.9)
    x = basis.zeros()
    x[top.all("u^3")] = -0.05
    ball = sc.Body(basis, linear_elasticity(1.0, 1.0), D=top, x=x, name="ball")
    floor = sc.RigidPlane((0, 0, -1), (0, 0, 1), name="floor")
    return sc.ContactSolver(ball, sc.Contact(ball.surface("low"), floor)).solve()


@pytest.mark.parametrize("kind", KINDS)
def test_bodies_are_where_they_are(kind: str) -> None:
    """The skin of the cube, a hundredth shorter, and the floor below it; arrows beneath the floor."""
    pytest.importorskip("pyvista", reason=HINT)
    plotter = sc.output.scene(pressed(kind), scale=1.0, off_screen=True)
    skin, _, floor, arrows = drawn(plotter)
    assert_allclose(skin.bounds, [0, 1, 0, 1, 0.01, 1], atol=1e-7)  # in single precision
    assert skin.triangulate().area == pytest.approx(2 + 4 * 0.99, rel=1e-5)
    assert_allclose(floor.points[:, 2], 0.01, atol=1e-7)
    assert arrows.bounds[4] < 0.0 and arrows.bounds[5] == pytest.approx(0.01, abs=1e-6)
    plotter.close()


def test_plane_bodies_are_where_they_are() -> None:
    """A square on a floor that has been moved up: cells, outline and floor in the plane z = 0."""
    pytest.importorskip("pyvista", reason=HINT)
    basis = fem.Basis(fem.MeshQuad().refined(1).with_defaults(), fem.ElementVector(fem.ElementQuad2()))
    block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="top", name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    contact = sc.Contact(block.surface("bottom"), floor)
    (result,) = sc.ContactSolver(block, contact).history([{"motion": {"floor": (0, 0.01)}}])
    plotter = sc.output.scene(result, scale=1.0, off_screen=True)
    skin, outline, ground = drawn(plotter)
    for mesh in (skin, outline):
        assert_allclose(mesh.bounds, [0, 1, 0.01, 1, 0, 0], atol=1e-7)
    assert skin.area == pytest.approx(0.99, rel=1e-6)
    assert_allclose(ground.points[:, 1:], np.tile([0.01, 0.0], (2, 1)), atol=1e-7)
    plotter.close()


def test_bodies_are_chosen_by_name_or_object_alone_or_in_a_list() -> None:
    """All four ways draw the same body, and leave out the second."""
    pytest.importorskip("pyvista", reason=HINT)
    upper, lower = (elastic(cube("quad4", 1), "quad4", name) for name in ("upper", "lower"))
    planes = sc.RigidPlane((0, 0, 0), (0, 0, 1)), sc.RigidPlane((0, 0, 1), (0, 0, -1))
    lower_glue = sc.Contact(lower.surface(at(2, 0.0)), planes[0], tied=True)
    upper_glue = sc.Contact(upper.surface(at(2, 1.0)), planes[1], tied=True)
    result = sc.ContactSolver([upper, lower], [lower_glue, upper_glue]).solve()
    for bodies in ("upper", ["upper"], upper, (upper,)):
        plotter = sc.output.scene(result, bodies=bodies, arrows=False, off_screen=True)
        assert len(drawn(plotter)) == 4  # skin and edges, and the two planes
        plotter.close()


def test_a_scene_is_a_picture() -> None:
    """Off-screen, on a white ground: the cube covers a good part of it, in its colours."""
    pytest.importorskip("pyvista", reason=HINT)
    plotter = sc.output.scene(pressed(), units={"length": "mm", "stress": "MPa"}, off_screen=True)
    plotter.window_size = 200, 200
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    ground = np.all(image == 255, axis=2)
    assert 0.2 < ground.mean() < 0.9


def test_a_body_without_edges_is_drawn() -> None:
    """No face of a ball meets another at 30 degrees: it is drawn without lines, and nothing else."""
    pytest.importorskip("pyvista", reason=HINT)
    plotter = sc.output.scene(pressed_ball(), scale=1.0, off_screen=True)
    skin, floor, arrows = drawn(plotter)
    assert_allclose((skin.bounds[4], skin.bounds[5]), (-1.0, 0.95), atol=1e-6)
    assert_allclose(floor.points[:, 2], -1.0, atol=1e-7)
    assert arrows.bounds[4] < -1.1
    plotter.window_size = 200, 200
    image = np.asarray(plotter.screenshot(return_img=True)).astype(int)
    plotter.close()
    blue = image[:, :, 2] > image[:, :, 0] + 30  # the ball moves down nearly as a whole
    assert 0.05 < blue.mean() < 0.5


def test_what_can_not_be_shown_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies that there are not; PyVista that is not there, with what draws instead."""
    result = pressed()
    if "pyvista" in sys.modules:
        with pytest.raises(sc.errors.InputError, match="blok"):
            sc.output.scene(result, bodies=["blok"], off_screen=True)
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(sc.errors.InputError, match=r"skfem-contact\[scene\]'; plot_deformed draws"):
        sc.output.scene(result)
