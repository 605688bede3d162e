"""Pictures in space by PyVista: what is in them, judged by the meshes that are drawn and by pixels."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from solid_meshes import KINDS, at, cube, elastic

import skfem_contact as sc

HINT = "PyVista is not installed: pip install pyvista (the extras 'scene' and 'test' have it)"


def pressed(kind: str = "quad4", friction: Any = None) -> sc.ContactResult:
    """A cube whose floor has been moved up by 0.01, and to the side by friction."""
    block = elastic(cube(kind, 2), kind, "block", held=((at(2, 1.0), (0, 1, 2)),), nu=0.0)
    floor = sc.RigidPlane((0, 0, 0), (0, 0, 1), name="floor")
    contact = sc.Contact(block.surface(at(2, 0.0)), floor, name="joint", friction=friction)
    return next(sc.ContactSolver([block], contact).history([{"motion": {"floor": (0, 0, 0.01)}}]))


@pytest.mark.parametrize("kind", KINDS)
def test_bodies_are_where_they_are(kind: str) -> None:
    """The skin of the cube, a hundredth shorter, and the floor below it; arrows beneath the floor."""
    pytest.importorskip("pyvista", reason=HINT)
    plotter = sc.scene(pressed(kind), scale=1.0, off_screen=True)
    drawn = [getattr(getattr(a, "mapper", None), "dataset", None) for a in plotter.actors.values()]
    skin, _, floor, arrows = [mesh for mesh in drawn if mesh is not None]
    assert_allclose(skin.bounds, [0, 1, 0, 1, 0.01, 1], atol=1e-7)  # in single precision
    assert skin.triangulate().area == pytest.approx(2 + 4 * 0.99, rel=1e-5)
    assert_allclose(floor.points[:, 2], 0.01, atol=1e-7)
    assert arrows.bounds[4] < 0.0 and arrows.bounds[5] == pytest.approx(0.01, abs=1e-6)
    plotter.close()


def test_a_scene_is_a_picture() -> None:
    """Off-screen, on a white ground: the cube covers a good part of it, in its colours."""
    pytest.importorskip("pyvista", reason=HINT)
    plotter = sc.scene(pressed(), units={"length": "mm", "stress": "MPa"}, off_screen=True)
    plotter.window_size = 200, 200
    image = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    ground = np.all(image == 255, axis=2)
    assert 0.2 < ground.mean() < 0.9


def test_what_can_not_be_shown_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bodies that there are not; PyVista that is not there, with what draws instead."""
    result = pressed()
    if "pyvista" in sys.modules:
        with pytest.raises(sc.InputError, match="blok"):
            sc.scene(result, bodies=["blok"], off_screen=True)
    monkeypatch.setitem(sys.modules, "pyvista", None)
    with pytest.raises(sc.InputError, match=r"skfem-contact\[scene\]'; plot_deformed draws"):
        sc.scene(result)
