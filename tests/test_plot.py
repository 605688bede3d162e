"""Pictures: what is drawn is the answer; judged by the data of the artists, not by pixels."""

from __future__ import annotations

import builtins
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from skfem.models.elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.output.drawing import arc_length
from skfem_contact.output.plot_bodies import auto_scale

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def _close_figures() -> Iterator[None]:
    from matplotlib import pyplot

    yield
    pyplot.close("all")


def pressed(
    element: Any = None,
    mesh: Any = fem.MeshQuad,
    levels: int = 3,
    depth: float = 0.01,
    **kwargs: Any,
) -> sc.ContactSolver:
    """A unit square of modulus 1 pressed onto a rigid floor by moving its top."""
    basis = fem.Basis(
        mesh().refined(levels).with_defaults(), fem.ElementVector(element or fem.ElementQuad1())
    )
    top = basis.get_dofs("top")
    x = np.zeros(basis.N)
    x[top.all("u^2")] = -depth
    block = sc.Body(basis, linear_elasticity(0.0, 0.5), D=top, x=x, name="block")
    floor = sc.RigidPlane((0.0, 0.0), (0.0, 1.0), name="floor")
    return sc.ContactSolver([block], [sc.Contact(block.surface("bottom"), floor, **kwargs)])


def ring() -> sc.ContactSurface:
    """The hole of an annulus of 24 elements around: a surface that ends where it starts."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 25), np.linspace(1, 2, 4))
    angle, radius = 2 * np.pi * mesh.p[0], mesh.p[1]
    p = np.array([radius * np.cos(angle), radius * np.sin(angle)])
    seam = np.isclose(mesh.p[0], 1.0)
    same = np.arange(mesh.nvertices)
    for i in np.flatnonzero(seam):
        same[i] = np.flatnonzero(np.isclose(mesh.p[0], 0) & np.isclose(mesh.p[1], mesh.p[1, i]))[0]
    kept, number = np.unique(same, return_inverse=True)
    closed = fem.MeshQuad(p[:, kept], number[mesh.t])
    basis = fem.Basis(closed, fem.ElementVector(fem.ElementQuad1()))
    body = sc.Body(basis, linear_elasticity(), name="ring")
    return body.surface(lambda x: np.hypot(*x) < 1.01, nodes=True)


def test_pressure_is_drawn_over_the_arc() -> None:
    """The line called "pressure" is the pressure, from one end of the side to the other."""
    result = pressed(friction=sc.Coulomb(0.5)).solve()
    ax = sc.plot_contact(result)
    lines = {line.get_label(): line for line in ax.get_lines()}
    s, pressure = lines["pressure"].get_data()
    assert_allclose(s, np.linspace(0.0, 1.0, 9), rtol=0, atol=1e-14)
    assert_allclose(pressure, 0.01, rtol=1e-11)
    bound = lines["bounds of friction"].get_data()[1]
    assert_allclose(bound, 0.005, rtol=1e-11)
    assert "block/bottom" in ax.get_xlabel()


def test_friction_is_drawn_at_merged_points() -> None:
    """All of a side slips: at every closed point the friction drawn is mu times the pressure drawn.

    The primary ends within a facet of the secondary; the mortar method merges the node that is left
    with almost nothing of its shape function.
    """

    def block(x: Any, y: float, **data: Any) -> sc.Body:
        mesh = fem.MeshQuad.init_tensor(x, np.linspace(y, y + 1, 5)).with_defaults()
        basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
        return sc.Body(basis, linear_elasticity(0.0, 0.5), **data)

    upper = block(np.linspace(0, 1, 9), 0.0, D="top", name="upper")
    lower = block(np.linspace(0, 0.755, 7), -1.0, D="bottom", name="lower")
    move = upper.basis.project(lambda x: np.stack([0.03 + 0 * x[0], -0.01 + 0 * x[0]]))
    pair = sc.Contact(upper.surface("bottom"), lower.surface("top"), friction=sc.Coulomb(0.2))
    result = sc.ContactSolver([upper, lower], pair).solve(x={"upper": move})
    values = result.values[0]
    assert (values.heir != np.arange(len(values.heir))).any()
    lines = {line.get_label(): line.get_ydata() for line in sc.plot_contact(result).get_lines()}
    pressed = lines["pressure"] > 0
    assert pressed.sum() == (values.status != 0).sum()
    assert_allclose(np.abs(lines["friction"]), 0.2 * lines["pressure"], atol=1e-9)
    assert_allclose(lines["bounds of friction"], 0.2 * lines["pressure"], atol=1e-9)


def test_stick_and_slip_are_shaded_where_they_are() -> None:
    """Shades of sticking and slipping points fill the surface without gaps, and are named once."""
    solver = pressed(friction=sc.Coulomb(0.3))
    body = solver.system.bodies[0]
    x = np.array(body.x)
    x[body.basis.get_dofs("top").all("u^1")] = 0.0055
    result = solver.solve(x={"block": x})
    assert set(result.status) == {1, 2}
    ax = sc.plot_contact(result)
    spans = [patch for patch in ax.patches if patch.get_height() == 1.0]
    assert_allclose(sum(span.get_width() for span in spans), 1.0)
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert sorted(labels) == ["bounds of friction", "friction", "pressure", "slip", "stick"]
    # the shade of slip covers the area of the slipping points: both own half-way to the neighbours
    slip = [
        span
        for span in spans
        if span.get_facecolor()[:3] == pytest.approx((0.965, 0.839, 0.678), abs=0.01)
    ]
    assert_allclose(sum(span.get_width() for span in slip), result.area[result.status == 2].sum())


@pytest.mark.parametrize(
    ("element", "mesh"),
    [
        (fem.ElementQuad1(), fem.MeshQuad),
        (fem.ElementQuadS2(), fem.MeshQuad),
        (fem.ElementQuad2(), fem.MeshQuad),
        (fem.ElementTriP1(), fem.MeshTri),
        (fem.ElementTriP2(), fem.MeshTri),
    ],
)
def test_triangles_cover_the_deformed_body(element: Any, mesh: Any) -> None:
    """The coloured triangles have the area of the deformed body, which is one per cent lower."""
    result = pressed(element, mesh, levels=1).solve()
    ax = sc.plot_deformed(result, scale=1.0)
    (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
    triangles = colours._triangulation
    corners = np.stack([triangles.x, triangles.y], axis=1)[triangles.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert area.min() > 0
    assert_allclose(area.sum(), 0.99, rtol=1e-12)
    # (triangles that overlap would draw the first moments to one side)
    centre = np.average(corners.mean(axis=1), axis=0, weights=area)
    assert_allclose(centre, [0.5, 0.99 / 2], rtol=1e-12)
    (outline,) = (c for c in ax.collections if isinstance(c, matplotlib.collections.LineCollection))
    assert len(outline.get_segments()) == 8  # two facets on each side
    length = sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in outline.get_segments())
    assert_allclose(length, 2 + 2 * 0.99, rtol=1e-12)


def test_arrows_end_on_the_surface() -> None:
    """The heads of the arrows are on the deformed surface, and point into the secondary body."""
    result = pressed().solve()
    ax = sc.plot_deformed(result, scale=10.0)
    (arrows,) = (c for c in ax.collections if isinstance(c, matplotlib.quiver.Quiver))
    tail, way = arrows.get_offsets(), np.column_stack([arrows.U, arrows.V])
    assert_allclose((tail + way)[:, 1], 0.0, atol=1e-13)
    assert np.all(arrows.V > 0)
    assert ax.get_aspect() == 1.0
    assert not [
        c
        for c in sc.plot_deformed(result, arrows=False).collections
        if isinstance(c, matplotlib.quiver.Quiver)
    ]


def test_colours_are_the_stress_where_given() -> None:
    """Colours are displacements, or the stress asked for, on one scale for all bodies."""
    result = pressed(levels=1).solve()
    ax = sc.plot_deformed(result, stress=lambda body, u: np.arange(9.0), label="stress [Pa]")
    (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
    assert_allclose(colours.get_array(), np.arange(9.0))
    assert ax.figure.axes[1].get_ylabel() == "stress [Pa]"
    ax = sc.plot_deformed(result)
    (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
    assert colours.get_array().max() == pytest.approx(0.01)
    ax = sc.plot_deformed(result, cmap="gray")
    assert [c.get_cmap().name for c in ax.collections if hasattr(c, "_triangulation")] == ["gray"]


def test_scale_is_round_and_keeps_gaps_small() -> None:
    """Displacements are shown up to 6 % of the extent; a closed gap, overlapping, up to 1 %."""
    assert auto_scale(pressed(depth=0.001).solve()) == 50.0
    assert auto_scale(pressed(depth=1e-6).solve()) == 50_000.0
    # a gap of 0.005 closed first: at a factor above three it would overlap by more than 0.01
    assert auto_scale(pressed(depth=0.01, gap=0.005).solve()) == 2.0
    # (0.06, shown in true size)
    assert auto_scale(pressed(depth=0.06).solve()) == 1.0


def test_ring_is_cut_open_where_nothing_touches() -> None:
    """On a closed surface the contact is in one piece, wherever the numbering starts."""
    surface = ring()
    chord = 2 * np.sin(np.pi / 24)
    for turn in range(24):
        start = 2 * np.pi * turn / 24
        angle = (np.arctan2(*surface.points.T[::-1]) - start + 1e-9) % (2 * np.pi)
        closed = angle < np.pi / 2 + 0.01
        arc = arc_length(surface, closed)
        assert np.ptp(arc[closed]) == pytest.approx(6 * chord)  # seven points in a quarter
        assert sorted(arc) == pytest.approx(chord * np.arange(1, 25)) or sorted(arc) == (
            pytest.approx(chord * np.arange(24))
        )


def test_history_shows_what_sticks_and_what_is_lost() -> None:
    """The energy lost is that of the results, over the number of the step."""
    solver = pressed(friction=sc.Coulomb(0.3))
    results = list(solver.history([0.5, 1.0, 1.5]))
    ax = sc.plot_history(results)
    right = next(other for other in ax.figure.axes if other is not ax)
    assert_allclose(right.get_lines()[0].get_ydata(), [r.dissipation_total for r in results])
    with pytest.raises(sc.InputError, match="no results"):
        sc.plot_history([])


def test_history_of_one_contact_of_two() -> None:
    """Of several contacts the one that is named is drawn, and without a name none is guessed."""
    solver = pressed()
    (body,), (floor,) = solver.system.bodies, solver.contacts
    wall = sc.Contact(body.surface("left"), sc.RigidPlane((-1.0, 0.0), (1.0, 0.0)), name="wall")
    result = sc.ContactSolver([body], [floor, wall]).solve()
    drawn = [sc.plot_history([result, result], contact=name) for name in (0, "wall")]
    slipping = [ax.collections[1].get_paths()[0].vertices for ax in drawn]
    areas = [np.ptp(outline[:, 1]) for outline in slipping]
    assert_allclose(areas, [1.0, 0.0], rtol=0, atol=1e-12)
    with pytest.raises(sc.InputError, match="there are 2 contacts"):
        sc.plot_history([result])


def test_axes_of_the_user_are_used() -> None:
    """A picture goes into the axes given, and these are returned."""
    from matplotlib import pyplot

    result = pressed(levels=1).solve()
    _, axes = pyplot.subplots(1, 3)
    assert sc.plot_deformed(result, ax=axes[0]) is axes[0]
    assert sc.plot_contact(result, contact="contact 1", ax=axes[1]) is axes[1]
    assert sc.plot_history([result], ax=axes[2]) is axes[2]


def test_body_without_contact_or_motion_can_be_drawn() -> None:
    """Nothing moves and nothing touches: true size, no arrows, no error."""
    result = pressed(levels=1, depth=0.0, gap=0.1).solve()
    assert sc.plot_deformed(result).get_title() == "true deformation"
    sc.plot_contact(result)


def test_missing_matplotlib_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without matplotlib the message names the extra to install."""
    result = pressed(levels=1).solve()
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(sc.InputError, match=r"pip install 'skfem-contact\[plot\]'"):
        sc.plot_contact(result)
