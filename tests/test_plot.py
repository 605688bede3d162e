"""Pictures: what is drawn is the answer; judged by the data of the artists, not by pixels."""

from __future__ import annotations

import builtins
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.output import arc_length

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


def ring() -> sc.bodies.ContactSurface:
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
    lines = [c for c in ax.collections if isinstance(c, matplotlib.collections.LineCollection)]
    (outline,) = (c for c in lines if c.get_gid() is None)  # the obstacle has one
    ends = np.array(outline.get_segments())
    assert_allclose(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum(), 2 + 2 * 0.99, rtol=1e-12)
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


def magnified(result: sc.answers.ContactResult) -> float:
    """How many times displacements are drawn, as the title says."""
    words = sc.plot_deformed(result).get_title().splitlines()[0]
    return 1.0 if words == "true positions" else float(words.split("magnified ")[1].split(" times")[0])


def test_scale_is_round_and_keeps_gaps_small() -> None:
    """Displacements are shown up to 6 % of the extent; a closed gap, overlapping, up to 1 %."""
    assert magnified(pressed(depth=0.001).solve()) == 50.0
    assert magnified(pressed(depth=1e-6).solve()) == 50_000.0
    # a gap of 0.005 closed first: at a factor above three it would overlap by more than 0.01
    assert magnified(pressed(depth=0.01, gap=0.005).solve()) == 2.0
    # (0.06, shown in true size)
    assert magnified(pressed(depth=0.06).solve()) == 1.0


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
    with pytest.raises(sc.errors.InputError, match="no results"):
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
    with pytest.raises(sc.errors.InputError, match="there are 2 contacts"):
        sc.plot_history([result])
    with pytest.raises(sc.errors.InputError, match=r"write plot_contact\(result, 'wall'\)"):
        sc.plot_contact(result["wall"])


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
    assert sc.plot_deformed(result).get_title() == "true positions"
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
    with pytest.raises(sc.errors.InputError, match=r"pip install 'skfem-contact\[plot\]'"):
        sc.plot_contact(result)


# -- obstacles, views, units ----------------------------------------------------------------------


def obstacle_lines(ax: Any) -> np.ndarray:
    """Ends of the lines of all obstacles, (s, 2, 2)."""
    drawn = [c for c in ax.collections if c.get_gid() == "obstacle"]
    return np.concatenate([np.array(c.get_segments()) for c in drawn])


def slid(x: float, y: float, mu: float | None = None) -> sc.answers.ContactResult:
    """The square moved as a whole by (x, y) over its floor at 0."""
    solver = pressed(levels=2, friction=sc.Coulomb(mu) if mu else None, sliding="finite")
    body = solver.system.bodies[0]
    move = np.array(body.x)
    top = body.basis.get_dofs("top")
    move[top.all("u^1")], move[top.all("u^2")] = x, y
    return solver.solve(x={"block": move})


def test_obstacles_are_drawn_where_they_are() -> None:
    """A floor that has been moved up by 0.3 is a line at 0.3, with strokes below it."""
    solver = pressed(depth=0.0, gap=None)
    result = list(solver.history([{"motion": {"floor": (0.0, 0.01)}}]))[-1]
    ax = sc.plot_deformed(result, scale=1.0)
    assert_allclose(obstacle_lines(ax)[..., 1], 0.01, rtol=0, atol=1e-12)
    (strokes,) = (c for c in ax.collections if c.get_gid() == "obstacle strokes")
    ends = np.array(strokes.get_segments())
    assert_allclose(ends[:, 0, 1], 0.01, rtol=0, atol=1e-12)
    assert (ends[:, 1, 1] < 0.01).all()
    # magnified with the bodies, so that the two touch in the picture as well
    ax = sc.plot_deformed(result, scale=5.0)
    (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
    assert colours._triangulation.y.min() == pytest.approx(0.05)
    assert_allclose(obstacle_lines(ax)[..., 1], 0.05, rtol=0, atol=1e-12)


def test_what_moves_far_is_where_it_is() -> None:
    """A block 24 along a rail that is its floor: never below true size, and all at 24."""
    ax = sc.plot_deformed(slid(24.0, -0.01))
    (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
    assert_allclose(
        [colours._triangulation.x.min(), colours._triangulation.x.max()], [24, 25], atol=0.1
    )
    low, high = ax.get_xlim()
    assert 23 < low < 24 and 25 < high < 26 and np.ptp(obstacle_lines(ax)[..., 0]) > high - low


def test_bodies_that_are_far_from_each_other_are_in_true_size() -> None:
    """A floor that has gone down by 5 is five below: it was drawn at 0.05, "magnified 0.01 times"."""
    solver = pressed(levels=1, depth=0.0)
    result = next(solver.history([{"motion": {"floor": (0.0, -5.0)}}]))
    assert magnified(result) == 1.0
    ax = sc.plot_deformed(result)
    assert_allclose(obstacle_lines(ax)[..., 1], -5.0)
    assert ax.get_ylim()[0] < -5.0


def test_a_shared_translation_is_not_magnified() -> None:
    """The same block is squeezed by 0.001: 50 times as in place, though it has moved by 24."""

    def drawn(result: sc.answers.ContactResult) -> list[float]:
        ax = sc.plot_deformed(result)
        (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
        x, y = colours._triangulation.x, colours._triangulation.y
        return [x.min(), x.max(), y.min(), y.max()]

    moved, still = slid(24.0, -0.001), slid(0.0, -0.001)
    assert magnified(moved) == 100.0  # with the middle of all displacements taken off, twice as much
    # y - 0.0005 + 100 (-0.001 y + 0.0005): the middle, (24, -0.0005), is where it is
    assert_allclose(drawn(moved), [24.0, 25.0, 0.0495, 0.9495], rtol=0, atol=1e-7)
    assert magnified(still) == 50.0
    # the place of what is nearly at rest is not changed by it
    assert_allclose(drawn(still), [0.0, 1.0, 0.0, 0.95], rtol=0, atol=1e-9)


def test_open_contacts_are_said_to_be_open() -> None:
    """Pictures of a contact that does not touch say so, and how far it is open."""
    result = pressed(levels=1, depth=0.0, gap=0.1).solve()
    texts = [text.get_text() for text in sc.plot_contact(result, units={"length": "mm"}).texts]
    assert texts == ["contact 1 is open, the smallest gap is 0.1 mm"]
    assert [t.get_text() for t in sc.plot_deformed(result).texts] == ["contact 1 is open"]


def test_arrows_have_a_scale() -> None:
    """The largest traction is in the picture, with its unit."""
    ax = sc.plot_deformed(pressed().solve(), units={"stress": "MPa", "length": "mm"})
    assert [text.get_text() for text in ax.texts] == ["longest arrow: 0.01 MPa"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [mm]", "y [mm]")
    assert ax.figure.axes[1].get_ylabel() == "displacement [mm]"
    with pytest.raises(sc.errors.InputError, match="no kind 'strss'; did you mean 'stress'"):
        sc.plot_deformed(pressed().solve(), units={"strss": "MPa"})


def test_a_window_is_what_is_shown() -> None:
    """Limits are those of the window, and arrows have its size: a tenth, a tenth of the length."""
    result = pressed().solve()
    lengths = []
    for window in ((-1.0, 2.0, -1.0, 2.0), (0.3, 0.6, -0.1, 0.2)):
        ax = sc.plot_deformed(result, scale=1.0, window=window)
        assert (*ax.get_xlim(), *ax.get_ylim()) == window
        (arrows,) = (c for c in ax.collections if isinstance(c, matplotlib.quiver.Quiver))
        lengths.append(np.abs(arrows.V).max())
        x = arrows.get_offsets()[:, 0]
        assert np.all((x >= window[0]) & (x <= window[1]))
    assert lengths[0] == pytest.approx(10 * lengths[1])
    with pytest.raises(sc.errors.InputError, match="left, right, bottom, top"):
        sc.plot_deformed(result, window=(1.0, 0.0, 0.0, 1.0))


def test_obstacles_can_be_left_out() -> None:
    """Neither lines nor room for them, and a switch is one."""
    result = next(pressed(levels=1, depth=0.0).history([{"motion": {"floor": (0.0, -5.0)}}]))
    ax = sc.plot_deformed(result, obstacles=False)
    assert not [c for c in ax.collections if c.get_gid()] and ax.get_ylim()[0] > -1
    with pytest.raises(sc.errors.InputError, match="obstacles is 'no'; it is a switch"):
        sc.plot_deformed(result, obstacles="no")  # type: ignore[arg-type]


def test_components_of_tensors_are_drawn() -> None:
    """A bar of modulus 1 carries -0.01 along y and nothing across; colours are one of these."""
    result = pressed(levels=1).solve()

    def sigma(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return sc.nodal_stress(body, u, E=1.0, nu=0.0)

    ax = sc.plot_deformed(result, stress=sigma, component="yy", units={"stress": "Pa"})
    (colours,) = (c for c in ax.collections if hasattr(c, "_triangulation"))
    assert_allclose(colours.get_array(), -0.01, rtol=1e-9)
    assert ax.figure.axes[1].get_ylabel() == "sigma yy [Pa]"
    with pytest.raises(
        sc.errors.InputError, match="component=None of 'sigma': a picture shows one of 'xx'"
    ):
        sc.plot_deformed(result, stress=sigma)
    with pytest.raises(sc.errors.InputError, match="one number per node"):
        sc.plot_deformed(result, stress=lambda body, u: np.zeros(9), component="xx")


def test_history_over_time_and_of_any_quantity() -> None:
    """Over times given, or a function of the result; a name, a number or a vector of it."""
    solver = pressed(friction=sc.Coulomb(0.3))
    results = list(solver.history([0.5, 1.0, 1.5]))
    ax = sc.plot_history(
        results, over=[0.0, 2.0, 5.0], units={"time": "s", "energy": "J", "area": "m²"}
    )
    assert ax.get_xlim() == (0.0, 5.0) and ax.get_xlabel() == "time [s]"
    assert ax.get_ylabel() == "area in contact [m²]"
    ax = sc.plot_history(
        results, quantity="force", over=lambda r: r.factor, xlabel="load", ylabel="F [N]"
    )
    _, y = ax.get_lines()
    assert_allclose(y.get_xdata(), [0.5, 1.0, 1.5])
    assert_allclose(y.get_ydata(), [0.005, 0.01, 0.015])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("load", "F [N]")
    ax = sc.plot_history(results, quantity=lambda r: r.pressure.max())
    assert_allclose(ax.get_lines()[0].get_ydata(), [0.005, 0.01, 0.015])
    with pytest.raises(sc.errors.InputError, match=r"over has shape \(2,\), but there are 3 results"):
        sc.plot_history(results, over=[0.0, 1.0])
    with pytest.raises(sc.errors.InputError, match="no quantity 'presure'; did you mean 'pressure'"):
        sc.plot_history(results, quantity="presure")
    with pytest.raises(sc.errors.InputError, match="one number per step"):
        sc.plot_history(results, quantity="pressure")


def test_force_over_displacement() -> None:
    """Modulus and height are one: the force on the top is how far it is pressed, as is the floor's."""
    solver = pressed(friction=sc.Coulomb(0.3))
    results = list(solver.history([0.5, 1.0, 1.5]))
    ax = sc.output.plot_force(results, "block", "top", units={"length": "mm", "force": "N"})
    x, y = ax.get_lines()[0].get_data()
    assert_allclose(x, [0.005, 0.01, 0.015])
    assert_allclose(y, x, rtol=1e-9)
    assert ax.get_xlabel() == "displacement of block/top along -y [mm]"
    assert ax.get_ylabel() == "force along -y [N]"
    lifted = list(pressed(depth=0.0).history([{"motion": {"floor": (0.0, 0.004 * k)}} for k in (1, 2)]))
    x, y = sc.output.plot_force(lifted, "floor").get_lines()[0].get_data()
    assert_allclose(y, x, rtol=1e-9)
    assert_allclose(x, [0.004, 0.008])
    # contact forces are no loads and no supports: none acts on the bottom from outside
    x, y = sc.output.plot_force(results, "block", "bottom", component="y").get_lines()[0].get_data()
    assert_allclose(y, 0.0, atol=1e-15)
    with pytest.raises(sc.errors.InputError, match="boundary='top'"):
        sc.output.plot_force(results, "block")
    with pytest.raises(sc.errors.InputError, match="no body 'flor'; did you mean 'floor'"):
        sc.output.plot_force(results, "flor")


@pytest.mark.parametrize("depth", [1e-2, 3.3e-5, 3.3e-9])
def test_numbers_of_a_force_are_short(depth: float) -> None:
    """At most seven at an axis, of at most five characters, and beside each other and the labels."""
    from matplotlib.cbook import strip_math

    ax = sc.output.plot_force(list(pressed(depth=depth).history([0.1, 0.6, 1.03])), "block", "top")
    ax.figure.canvas.draw()
    words = [ax.xaxis.label, ax.yaxis.label]
    for axis in (ax.xaxis, ax.yaxis):
        low, high = axis.get_view_interval()
        ticks = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
        assert 3 <= len(ticks) <= 7
        assert max(len(strip_math(t.label1.get_text())) for t in ticks) <= 5
        words += [t.label1 for t in ticks] + [axis.get_offset_text()]
    boxes = [word.get_window_extent() for word in words if word.get_text()]
    for i, a in enumerate(boxes):
        for b in boxes[:i]:
            assert min(a.x1, b.x1) - max(a.x0, b.x0) < 1 or min(a.y1, b.y1) - max(a.y0, b.y0) < 1


def test_a_colour_bar_has_the_name_of_its_function() -> None:
    """A function's own name in words, that of a partial, "stress" for a lambda, or the user's words."""

    def _hoop_stress(body: sc.Body, u: np.ndarray) -> np.ndarray:
        return sc.von_mises(body, u, E=1.0, nu=0.0)

    result, units = pressed(levels=1).solve(), {"stress": "MPa"}
    names = {
        "hoop stress [MPa]": _hoop_stress,
        "von Mises stress [MPa]": partial(sc.von_mises, E=1.0, nu=0.0),
        "stress [MPa]": lambda body, u: _hoop_stress(body, u),
        "stress_xx, rough [MPa]": {"stress_xx, rough": _hoop_stress},
    }
    for name, stress in names.items():
        ax = sc.plot_deformed(result, stress=stress, units=units)
        assert ax.figure.axes[-1].get_ylabel() == name


def test_gaps_that_are_not_magnified_are_said() -> None:
    """A disc of radius 2 pressed 0.02 into the square: at 10 times the picture shows an overlap."""
    body = pressed(levels=4).system.bodies[0]
    disc = sc.RigidCylinder((0.5, -2.0), 2.0, name="disc")
    contact = sc.Contact(body.surface("bottom"), disc)
    (result,) = sc.ContactSolver(body, contact).history([{"motion": {"disc": (0.0, 0.02)}}])

    def said(scale: float) -> bool:
        return any("not magnified" in t.get_text() for t in sc.plot_deformed(result, scale).texts)

    # the last closed point is within the chord of 0.02: its gap was at most that, and not nothing
    closed = result.status != 0
    gap = 2.0 - np.sqrt(4.0 - (result.points[closed, 0] - 0.5) ** 2)
    assert 0.002 < gap.max() < 0.02
    assert said(1.0 + 1.2 * 0.002 / gap.max())  # the bodies extend by 1
    assert not said(1.0 + 0.5 * 0.002 / gap.max())
    assert not said(1.0)
    # a floor that lies on the square has no gap, whatever the factor
    flat = pressed(levels=2, gap=None).solve()
    assert not any("not magnified" in t.get_text() for t in sc.plot_deformed(flat, 50.0).texts)
