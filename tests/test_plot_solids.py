"""Pictures and files of solids: what is drawn is the answer, judged by the data of the artists."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from ctypes.util import find_library
from dataclasses import replace
from itertools import combinations
from typing import Any

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from solid_meshes import KINDS, at, cube, elastic

import skfem_contact as sc
from skfem_contact.errors import InputError
from skfem_contact.output import draw_contact

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
every_kind = pytest.mark.parametrize("kind", KINDS)


@pytest.fixture(autouse=True)
def _close_figures() -> Iterator[None]:
    from matplotlib import pyplot

    yield
    pyplot.close("all")


def pressed(kind: str, radius: float | None = None) -> sc.answers.ContactResult:
    """A cube pressed by 0.01 on a plane, or a sphere on a cube."""
    held = ((at(2, 1.0), (0, 1, 2)),)
    block = elastic(
        cube(kind, 2), kind, "block", held=held, push=(at(2, 1.0), (0.0, 0.0, -0.01)), nu=0.0
    )
    floor: Any = sc.RigidPlane((0, 0, 0), (0, 0, 1))
    if radius is not None:
        floor = sc.RigidSphere((0.5, 0.5, -radius), radius)
    foot = block.surface(at(2, 0.0), name="foot")
    return sc.ContactSolver([block], [sc.Contact(foot, floor, name="joint")]).solve()


@pytest.fixture
def engine(request: Any, monkeypatch: pytest.MonkeyPatch) -> str:
    """What draws the faces."""
    if request.param == "matplotlib":
        monkeypatch.setitem(sys.modules, "pyvista", None)
    else:
        pytest.importorskip("pyvista")
    return str(request.param)


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures by matplotlib alone."""
    monkeypatch.setitem(sys.modules, "pyvista", None)


def faces(ax: Any) -> Any:
    """What matplotlib has painted: triangles in the plane of view."""
    from matplotlib.collections import PolyCollection

    (found,) = [c for c in ax.collections if type(c) is PolyCollection]
    return found


def covered(ax: Any) -> tuple[float, np.ndarray]:
    """The area that is drawn, and its limits (left, right, low, high), in the plane of view."""
    if ax.images:
        (image,) = ax.images
        left, right, low, high = image.get_extent()
        drawn = image.get_array()[..., 3] > 127
        rows, columns = (np.flatnonzero(drawn.any(axis=k)) for k in (1, 0))
        wide, tall = (right - left) / drawn.shape[1], (high - low) / drawn.shape[0]
        x, y = columns[[0, -1]] + [0, 1], rows[[-1, 0]] + [1, 0]
        return float(drawn.sum() * wide * tall), np.array([*(left + wide * x), *(high - tall * y)])
    x = np.array([path.vertices[:3] for path in faces(ax).get_paths()])
    one, other = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    area = 0.5 * np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()
    low, high = x.min(axis=(0, 1)), x.max(axis=(0, 1))
    return float(area), np.array([low[0], high[0], low[1], high[1]])


@every_kind
def test_contact_faces_have_the_colour_of_their_pressure(kind: str, plain: None) -> None:
    """A uniform pressure is one colour, that of its value on the bar, over all of the surface."""
    result = pressed(kind)
    ax = sc.plot_contact(result)
    # half a radian off from below, where the floor is
    assert_allclose(covered(ax)[0], np.cos(0.5), rtol=1e-12)
    (colour,) = np.unique(faces(ax).get_facecolor(), axis=0)
    assert_allclose(colour, matplotlib.colormaps["YlGnBu"](1.0))
    bar = ax.figure.axes[-1]
    assert bar.get_ylabel() == "pressure" and "block/foot" in ax.get_title()
    assert_allclose(bar.get_ylim(), [0.0, 0.01], rtol=1e-9)


def test_pixels_have_the_colours_of_the_bar() -> None:
    """Faces of a contact are not shaded: a uniform pressure is the last colour of the bar."""
    pytest.importorskip("pyvista")
    ax = sc.plot_contact(pressed("quad4"))
    pixels = ax.images[0].get_array()
    colour = np.median(np.asarray(pixels)[pixels[..., 3] == 255], axis=0)
    # of 256 levels; VTK rounds its 256 colours to whole levels
    assert_allclose(colour, 255 * np.array(matplotlib.colormaps["YlGnBu"](1.0)), rtol=0, atol=2)
    # pixels at the rim: a part of the length of the rim over the width of the picture
    assert_allclose(covered(ax)[0], np.cos(0.5), rtol=0.005)


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
def test_the_darkest_is_the_largest_pressure(plain: None) -> None:
    """Under a sphere: the middle."""
    result = pressed("quad4", radius=4.0)
    drawn = faces(sc.plot_contact(result))
    middle = np.array([path.vertices[:3].mean(axis=0) for path in drawn.get_paths()])
    darkest = middle[np.argsort(drawn.get_facecolor()[:, :3].sum(axis=1))[:5]]
    every = covered(sc.plot_contact(result))[1]
    assert_allclose(darkest, np.tile([every[:2].mean(), every[2:].mean()], (5, 1)), rtol=0, atol=0.1)


def test_sticking_points_and_slipping_arrows(plain: None) -> None:
    """Points of either state have marks of their own, and the legend names them."""
    result = pressed("quad4")
    values = result["joint"]
    status = np.where(values.points[:, 0] > 0.6, 2, 1)
    force = np.zeros((len(status), 2))
    force[:, 0] = 0.3 * values.normal_force
    rough = replace(
        values,
        contact=replace(values.contact, friction=sc.Coulomb(0.3)),
        status=status,
        tangential_force=force,
    )
    ax = draw_contact(rough, None, {"stress": "Pa"})
    assert ax.get_legend_handles_labels()[1] == [
        "sticks",
        "slips: friction on this side, up to 0.003 Pa",
    ]
    (points,) = [c for c in ax.collections if c.get_label() == "sticks"]
    sticking = values.points[status == 1]
    found, step = np.asarray(points.get_offsets()), sticking[1] - sticking[0]
    assert len(found) == len(sticking)
    assert np.linalg.norm(found[1] - found[0]) <= np.linalg.norm(step) * (1 + 1e-12)
    assert "slips" not in " ".join(sc.plot_contact(result).get_legend_handles_labels()[1])


@pytest.mark.parametrize(
    "engine, kind",
    [*(("matplotlib", kind) for kind in KINDS), ("pyvista", "quad4"), ("pyvista", "tri6")],
    indirect=["engine"],
)
def test_bodies_are_drawn_displaced(kind: str, engine: str) -> None:
    """Three sides of a cube as the viewer sees them, its height less by 10 times 0.01."""
    viewer, up = np.array([2.0, -1.0, 2.0]) / 3.0, np.array([0.0, 0.0, 1.0])
    ax = sc.plot_deformed(pressed(kind), scale=10.0, viewer=6 * viewer, obstacles=False)
    right = np.cross(up, viewer) / np.linalg.norm(np.cross(up, viewer))
    sides = np.array([1.0, 1.0, 0.9])
    area = (sides.prod() / sides) @ np.abs(viewer)
    wide, high = sides @ np.abs(right), sides @ np.abs(np.cross(viewer, right))
    found, (left, end, low, top) = covered(ax)
    # the outline is a line of 3 pixels, half of which, or all at its ends, stands beyond the faces
    pixel = (top - low) / ax.images[0].get_array().shape[0] if ax.images else 1e-12
    assert_allclose(found, area, rtol=0, atol=2 * (wide + high) * 2 * pixel)
    assert_allclose((end - left, top - low), (wide, high), rtol=0, atol=2 * 3 * pixel)
    assert "magnified 10 times" in ax.get_title()
    assert_allclose(ax.figure.axes[-1].get_ylim(), [0.0, 0.01], rtol=1e-9, atol=1e-12)


def test_what_is_near_is_painted_last(plain: None) -> None:
    """Of two blocks the one towards the viewer covers the other, from wherever it is seen."""
    bodies = [
        elastic(cube("quad4", 2).translated((0, 0, z)), "quad4", name, held=((at(2, z), (0, 1, 2)),))
        for z, name in ((0.0, "low"), (1.0, "high"))
    ]
    glue = sc.Contact(bodies[1].surface(at(2, 1.0)), bodies[0].surface(at(2, 1.0)), tied=True)
    result = sc.ContactSolver(bodies, glue).solve()
    for viewer, name in (((1, 1, 2), "high"), ((1, 1, -2), "low")):
        mark = {"near": lambda body, u, name=name: np.full(body.n // 3, float(body.name == name))}
        ax = sc.plot_deformed(result, stress=mark, viewer=viewer)
        assert_allclose(faces(ax).get_facecolor()[-1], matplotlib.colormaps["YlGnBu"](1.0))


@pytest.mark.slow
def test_without_opengl_matplotlib_draws() -> None:
    """VTK would end the process where it finds no OpenGL: in a process of its own it is not asked."""
    pytest.importorskip("pyvista")
    if os.environ.get("DISPLAY") or not sys.platform.startswith("linux") or find_library("OSMesa"):
        pytest.skip("OpenGL is there")
    program = "from test_plot_solids import *; print(len(sc.plot_deformed(pressed('quad4')).images))"
    there = {
        "VTK_DEFAULT_OPENGL_WINDOW": "vtkOSOpenGLRenderWindow",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | there, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, "0\n"), done.stderr


def test_a_viewer_is_a_direction_that_up_is_not_along() -> None:
    """Both have three numbers, and are not parallel."""
    result = pressed("quad4")
    with pytest.raises(InputError, match=r"viewer is \[0.0, 0.0, 2.0\].*must not be parallel"):
        sc.plot_deformed(result, viewer=(0, 0, 2))
    with pytest.raises(InputError, match=r"up \(2,\).*give a direction"):
        sc.plot_deformed(result, up=(0, 1))
    with pytest.raises(InputError, match="viewer holds NaN"):
        sc.plot_deformed(result, viewer=(0, np.nan, 1))


def test_stress_of_solids(plain: None) -> None:
    """Colours by a function of the user, at the nodes of the boundary."""

    def height(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return body.dof_points[body.dof_component == 2, 2]

    ax = sc.plot_deformed(pressed("quad4"), stress=height)
    assert ax.figure.axes[-1].get_ylabel() == "height"
    assert_allclose(ax.figure.axes[-1].get_ylim(), [0.0, 1.0])


def test_axes_in_space_are_refused(plain: None) -> None:
    """Axes of a user have to be plain ones; those are used."""
    from matplotlib import pyplot

    result = pressed("quad4")
    with pytest.raises(InputError, match=r"give plain ones, figure.add_subplot\(\)"):
        sc.plot_contact(result, ax=pyplot.figure().add_subplot(projection="3d"))
    ax = pyplot.subplots()[1]
    assert sc.plot_contact(result, ax=ax) is ax and sc.plot_deformed(result, ax=ax) is ax


def test_nothing_touches(plain: None) -> None:
    """All of the surface is drawn, with no pressure and no edge."""
    block = elastic(cube("quad4", 2), "quad4", "block", held=((at(2, 1.0), (0, 1, 2)),))
    floor = sc.RigidPlane((0, 0, -0.1), (0, 0, 1))
    result = sc.ContactSolver([block], [sc.Contact(block.surface(at(2, 0.0)), floor)]).solve()
    ax = sc.plot_contact(result)
    assert_allclose(covered(ax)[0], np.cos(0.5))
    assert ax.get_legend() is None


# -- what stands in a picture stands beside each other --------------------------------------------

#: Sides of a block and the shape below it: flat faces, slender boxes, parts of a face, nothing at all.
SCENES: dict[str, tuple[tuple[float, float, float], Any, float]] = {
    "roller": ((3, 1, 0.6), sc.RigidCylinder((1.5, 0.5, -2), 2.0, axis=(0, 1, 0)), 0.01),
    "slender": ((6, 0.5, 0.3), sc.RigidPlane((0, 0, 0), (0, 0, 1)), 0.002),
    "tall": ((0.3, 0.3, 2), sc.RigidPlane((0, 0, 0), (0, 0, 1)), 0.02),
    "flat": ((1, 1, 0.6), sc.RigidPlane((0, 0, 0), (0, 0, 1)), 0.01),
    "ball": ((1, 1, 0.6), sc.RigidSphere((0.5, 0.5, -2), 2.0), 0.02),
    "open": ((1, 1, 0.6), sc.RigidPlane((0, 0, -0.1), (0, 0, 1)), 0.0),
}


def pushed(scene: str) -> sc.answers.ContactResult:
    """The shape is moved up, and a little aside, against the block, whose upper side is held."""
    sides, shape, up = SCENES[scene]
    mesh = fem.MeshHex.init_tensor(
        *(np.linspace(0, a, n) for a, n in zip(sides, (7, 7, 3), strict=True))
    ).with_boundaries({"low": lambda x: x[2] == 0, "high": lambda x: x[2] == sides[2]})
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    block = sc.Body(basis, linear_elasticity(400.0, 400.0), D="high", name="block")
    shape = replace(shape, name="shape")
    contact = sc.Contact(block.surface("low"), shape, friction=sc.Coulomb(0.3), name="joint")
    step = {"motion": {"shape": (0.3 * up, 0.0, up)}}
    return next(sc.ContactSolver([block], [contact]).history([step]))


def stands(ax: Any) -> dict[str, Any]:
    """The boxes of all words of a picture, of its colour bar, and of the faces."""
    from matplotlib.transforms import Bbox

    ax.figure.canvas.draw()
    boxes = {"title": ax.title, **{f"note {i}": t for i, t in enumerate(ax.texts) if t.get_text()}}
    if ax.get_legend() is not None:
        boxes["legend"] = ax.get_legend()
    boxes = {name: artist.get_window_extent() for name, artist in boxes.items()}
    boxes["colour bar"] = ax.figure.axes[-1].get_tightbbox()
    left, right, low, high = covered(ax)[1]
    boxes["faces"] = Bbox(ax.transData.transform([(left, low), (right, high)]))
    return boxes


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name not in ("roller", "slender")))
        for name in SCENES
    ],
)
@pytest.mark.parametrize("draw", [sc.plot_contact, sc.plot_deformed])
def test_words_do_not_cover_each_other(scene: str, draw: Any, plain: None) -> None:
    """No legend, label, number or colour bar on another, nor on the faces, nor beyond the figure."""
    ax = draw(pushed(scene), units={"length": "mm", "stress": "MPa"})
    boxes = stands(ax)
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        if other == "faces" and one.startswith("note"):
            continue  # the box of a turned face is larger than the face
        wide, high = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert wide < 1 or high < 1, f"{one} and {other} overlap by {wide:.0f} x {high:.0f} pixels"
    edge = ax.figure.bbox
    for name, box in boxes.items():
        assert box.x0 > -1 and box.y0 > -1 and box.x1 < edge.x1 + 1 and box.y1 < edge.y1 + 1, name


def test_a_bar_of_one_value_names_it(plain: None) -> None:
    """Where nothing presses the bar says 0, and has no negative pressures."""
    ax = sc.plot_contact(pushed("open"))
    assert ax.figure.axes[-1].get_yticks().tolist() == [0.0]


def test_letters_of_axes_that_look_alike(plain: None) -> None:
    """From where y and z point the same way in the picture, their letters stand in a row."""
    ax = sc.plot_deformed(pushed("open"), viewer=(6, -62, 61))
    ax.figure.canvas.draw()
    letters = [t.get_window_extent() for t in ax.texts if t.get_text() in ("x", "y", "z")]
    assert len(letters) == 3
    assert not any(a.overlaps(b) for a, b in combinations(letters, 2))


# -- files ----------------------------------------------------------------------------------------


@every_kind
def test_files_of_solids(kind: str, tmp_path: Any) -> None:
    """Both grids of every kind: displacements at their nodes, faces that look out, fields by name."""
    meshio = pytest.importorskip("meshio")
    result = pressed(kind)
    bodies, contacts = (meshio.read(p) for p in sc.write(tmp_path / "block.vtu", result))
    expected = np.zeros_like(bodies.points)
    expected[:, 2] = -0.01 * bodies.points[:, 2]
    assert_allclose(bodies.point_data["displacement"], expected, rtol=0, atol=1e-12)
    names = {
        "tri3": "triangle",
        "tri6": "triangle6",
        "quad4": "quad",
        "quad8": "quad8",
        "quad9": "quad9",
    }
    (block,) = contacts.cells
    assert block.type == names[kind]
    x = contacts.points[block.data]
    up = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 1])
    assert np.all(up[:, 2] < 0)  # out of the block
    c = 3 if kind.startswith("tri") else 4
    if x.shape[1] > c:  # middles of edges follow the corners
        middle = 0.5 * (x[:, :c] + np.roll(x[:, :c], -1, axis=1))
        assert_allclose(x[:, c : 2 * c], middle, rtol=0, atol=1e-12)
    values = result["joint"]
    for name in ("pressure", "traction", "gap", "status", "normal"):
        assert_allclose(contacts.point_data[name], getattr(values, name), rtol=0, atol=1e-14)
    for name in ("slip", "tangential_force"):
        found = contacts.point_data[name]
        assert found.shape == (len(values.points), 3)
        assert_allclose(found, getattr(values, f"{name}_vector"), rtol=0, atol=1e-14)


def test_obstacles_end_at_the_sides_of_the_picture() -> None:
    """Their triangles are cut there: what is left of a plane is all of it in the box, and no more."""
    _inside = internals.original("output._inside")

    low, high = np.array([0.0, 0.0, -1.0]), np.array([2.0, 1.0, 1.0])
    corners = np.array([[-9, -9, 0.1], [9, -9, 0.1], [9, 9, 0.1], [-9, 9, 0.1]])
    tiny = np.array([[0.1, 0.1, 0.9], [0.2, 0.1, 0.9], [0.1, 0.2, 0.9]])
    shown = _inside(np.stack([corners[[0, 1, 2]], corners[[0, 2, 3]], tiny, tiny + 5]), low, high)
    assert np.array_equal(shown[0], tiny) and len(shown) == 3
    area = 0.0
    for polygon in shown[1:]:
        assert np.all((polygon >= low - 1e-12) & (polygon <= high + 1e-12))
        fan = np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0])
        area += 0.5 * np.linalg.norm(fan.sum(axis=0))
    assert area == pytest.approx(2.0, rel=1e-12)
    assert not _inside(corners[None, :3] + [0, 0, 5], low, high)
