"""Pictures and files of solids: what is drawn is the answer, judged by the data of the artists."""

from __future__ import annotations

from collections.abc import Iterator
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


def faces(ax: Any) -> Any:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    drawn = [c for c in ax.collections if isinstance(c, Poly3DCollection)]
    (found,) = [c for c in drawn if c.get_gid() is None]  # obstacles have one
    ax.figure.canvas.draw()
    return found


def corners(collection: Any) -> np.ndarray:
    """Corners of the triangles, (t, 3, 3)."""
    if hasattr(collection, "_faces"):
        return np.asarray(collection._faces)
    return collection._vec[:3].T.reshape(-1, 3, 3)  # before matplotlib 3.11


def areas(x: np.ndarray) -> np.ndarray:
    return 0.5 * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1)


@every_kind
def test_contact_faces_have_the_colour_of_their_pressure(kind: str) -> None:
    """A uniform pressure is one colour, that of its value on the bar, over all of the surface."""
    result = pressed(kind)
    ax = sc.plot_contact(result)
    drawn = faces(ax)
    assert_allclose(areas(corners(drawn)).sum(), 1.0, rtol=1e-12)
    assert_allclose(corners(drawn)[..., 2], 0.0, rtol=0, atol=1e-12)
    bar = ax.figure.axes[-1]
    assert bar.get_ylabel() == "pressure"
    assert_allclose(bar.get_ylim(), [0.0, 0.01], rtol=1e-9)
    # seen from below, where the floor is
    assert ax.elev < 0 and "block/foot" in ax.get_title()


@pytest.mark.filterwarnings("ignore:.*over the length of one facet")  # few faces are enough here
def test_the_darkest_is_the_largest_pressure() -> None:
    """Under a sphere: the middle."""
    result = pressed("quad4", radius=4.0)
    drawn = faces(sc.plot_contact(result))
    middle = corners(drawn).mean(axis=1)
    # in the order given: what is drawn is sorted by depth
    colours = np.asarray(drawn._facecolor3d)
    darkest = middle[np.argsort(colours[:, :3].sum(axis=1))[:5]]
    assert_allclose(darkest[:, :2], 0.5, rtol=0, atol=0.1)


def test_sticking_points_and_slipping_arrows() -> None:
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
    found = np.stack(points._offsets3d, axis=1)
    expected = values.points[status == 1]
    assert_allclose(found[np.lexsort(found.T)], expected[np.lexsort(expected.T)])
    assert "slips" not in " ".join(sc.plot_contact(result).get_legend_handles_labels()[1])


@every_kind
def test_bodies_are_drawn_displaced(kind: str) -> None:
    """The outer faces that look at the viewer: three sides of a cube, shorter by its strain."""
    result = pressed(kind)
    ax = sc.plot_deformed(result, scale=10.0)
    x = corners(faces(ax))
    flat = areas(x)
    # the top and two sides, one of whose lengths has shrunk by 10 times 0.01; lines have no area
    assert_allclose(flat.sum(), 1.0 + 2 * 0.9, rtol=1e-9)
    assert x[flat > 0][..., 2].max() == pytest.approx(0.9)
    assert "magnified 10 times" in ax.get_title()
    assert_allclose(ax.figure.axes[-1].get_ylim(), [0.0, 0.01], rtol=1e-9, atol=1e-12)


def test_stress_of_solids() -> None:
    """Colours by a function of the user, at the nodes of the boundary."""

    def height(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return body.dof_points[body.dof_component == 2, 2]

    ax = sc.plot_deformed(pressed("quad4"), stress=height)
    assert ax.figure.axes[-1].get_ylabel() == "height"
    assert_allclose(ax.figure.axes[-1].get_ylim(), [0.0, 1.0])


def test_plane_axes_are_refused() -> None:
    """Axes of a user have to be in space; those that are, are used."""
    from matplotlib import pyplot

    result = pressed("quad4")
    with pytest.raises(InputError, match="projection='3d'"):
        sc.plot_contact(result, ax=pyplot.subplots()[1])
    ax = pyplot.figure().add_subplot(projection="3d")
    assert sc.plot_contact(result, ax=ax) is ax and sc.plot_deformed(result, ax=ax) is ax


def test_nothing_touches() -> None:
    """All of the surface is drawn, with no pressure and no edge."""
    block = elastic(cube("quad4", 2), "quad4", "block", held=((at(2, 1.0), (0, 1, 2)),))
    floor = sc.RigidPlane((0, 0, -0.1), (0, 0, 1))
    result = sc.ContactSolver([block], [sc.Contact(block.surface(at(2, 0.0)), floor)]).solve()
    ax = sc.plot_contact(result)
    assert_allclose(areas(corners(faces(ax))).sum(), 1.0)
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
    boxes = {"title": ax.title, **{f"note {i}": text for i, text in enumerate(ax.texts)}}
    if ax.get_legend() is not None:
        boxes["legend"] = ax.get_legend()
    for name in "xyz":
        axis = getattr(ax, f"{name}axis")
        low, high = axis.get_view_interval()
        ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        boxes |= {f"{name} = {tick.get_loc()}": tick.label1 for tick in ticks}
        boxes |= {f"{name} label": axis.label} if axis.label.get_text() else {}
    boxes = {name: artist.get_window_extent() for name, artist in boxes.items()}
    boxes["colour bar"] = ax.figure.axes[-1].get_tightbbox()
    drawn = np.concatenate([path.vertices for path in faces(ax).get_paths()])
    at = ax.transData.transform(drawn)
    boxes["faces"] = Bbox([at.min(axis=0), at.max(axis=0)])
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
def test_words_do_not_cover_each_other(scene: str, draw: Any) -> None:
    """No legend, label, number or colour bar on another, nor on the faces, nor beyond the figure."""
    ax = draw(pushed(scene), units={"length": "mm", "stress": "MPa"})
    boxes = stands(ax)
    labels = {name for name in boxes if name[0] in "xyz"}
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        if other == "faces" and one in labels | {"note 0"}:
            continue  # the box of a turned face is larger than the face
        wide, high = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert wide < 1 or high < 1, f"{one} and {other} overlap by {wide:.0f} x {high:.0f} pixels"
    edge = ax.figure.bbox
    for name, box in boxes.items():
        assert box.x0 > -1 and box.y0 > -1 and box.x1 < edge.x1 + 1 and box.y1 < edge.y1 + 1, name


def test_a_bar_of_one_value_names_it() -> None:
    """Where nothing presses the bar says 0, and has no negative pressures."""
    ax = sc.plot_contact(pushed("open"))
    assert ax.figure.axes[-1].get_yticks().tolist() == [0.0]


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
