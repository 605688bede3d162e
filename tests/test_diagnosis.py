"""A problem set up wrongly says so: every kind of mistake, and the words that the user reads."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from functools import partial

import internals
import numpy as np
import pytest
import rectangles
import skfem as fem
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc

STIFFNESS = linear_elasticity(*lame_parameters(1.0, 0.3))
FLOOR = sc.RigidPlane((0, 0), (0, 1), name="floor")


block = partial(rectangles.block, order=2)


def pair(**settings):
    """A punch pressed by 1 % onto a table."""
    table = block("table", y=(-1.0, 0.0), D="bottom")
    punch = block("punch", D="top", move=(0.0, -0.01))
    contact = sc.Contact(punch.surface("bottom"), table.surface("top"), name="joint", **settings)
    return sc.ContactSolver([table, punch], [contact])


def on_floor(body, **settings):
    return sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR, name="joint", **settings))


# -- bodies that are not held ----------------------------------------------------------------


def test_a_motion_left_free_is_named():
    """A frictionless block pushed along a floor slides: body and motion are named before solving.

    Pressed straight down it rests, at a place that is indifferent: see test_indifference.
    """
    solver = on_floor(block("punch", force=(1e-6, -1e-3)))
    with pytest.raises(
        sc.errors.NoEquilibrium,
        match=r"Body 'punch' is free to move: translation along x, even with every",
    ) as raised:
        solver.solve()
    assert raised.value.bodies == ("punch",) and raised.value.motion == "translation along x"


def test_bodies_free_together_are_named_together():
    """Two glued blocks that nothing holds move as one."""
    low, up = block("low"), block("up", y=(1.0, 2.0), force=(0.0, -1e-3))
    glue = sc.Contact(up.surface("bottom"), low.surface("top"), tied=True)
    with pytest.raises(
        sc.errors.NoEquilibrium, match=r"Bodies 'low' and 'up' are free to move together: "
    ):
        sc.ContactSolver([low, up], glue).solve()


def test_all_points_open_under_force():
    """A punch pulled off by a force flies away; the last state is in the exception."""
    solver = on_floor(block("punch", force=(0.0, 1e-3)), friction=sc.Coulomb(0.3))
    with pytest.raises(
        sc.errors.NoEquilibrium, match=r"'punch' .*: translation along y.*with the forces"
    ) as raised:
        solver.solve()
    assert raised.value.result is not None and not raised.value.result.converged
    assert not solver.solve(throw=False).converged


def pushed(floor, shear):
    """A block of five by five nodes that slides far, pressed onto a floor and pushed at its top."""
    mesh = fem.MeshQuad.init_tensor(*2 * [np.linspace(0, 1, 5)]).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    top = fem.LinearForm(lambda v, w: shear * v[0] - v[1]).assemble(basis.boundary("top"))
    body = sc.Body(basis, sc.Elastic(200e3, 0.3).form(), f=top, name="block")
    contact = sc.Contact(body.surface("bottom"), floor, friction=sc.Coulomb(0.3), sliding="finite")
    return sc.ContactSolver(body, contact)


def test_a_plane_shows_that_nothing_balances_however_far_a_body_slides():
    """A plane is the same all along the way: statics alone decides, also where the plane has turned."""
    with pytest.raises(sc.errors.NoEquilibrium, match="there is no equilibrium") as raised:
        pushed(FLOOR, 0.5).solve()
    assert raised.value.motion == "translation along x"
    # pushed by 0.298 of what presses it, friction being 0.3: it holds upwards, and not downwards
    for angle in (0.0, 0.004):
        assert pushed(FLOOR, 0.298).solve(motion={"floor": ((0, 0), angle, (0, 0))}).converged
    with pytest.raises(sc.errors.NoEquilibrium, match="there is no equilibrium"):
        pushed(FLOOR, 0.298).solve(motion={"floor": ((0, 0), -0.004, (0, 0))})


def test_a_body_that_slides_off_along_an_outline_is_refused_in_time():
    """Other facets may meet it there, so all starts are tried, and easier problems as far as they help.

    Without an end to how easy, it takes twice as many iterations: 2 651 of 5 276.
    """
    flat = sc.RigidPolyline(np.array([[9.0, 0.0], [-9.0, 0.0]]), name="floor")
    with pytest.raises(sc.errors.NoEquilibrium, match=r"no force at the contact.*not shown") as raised:
        pushed(flat, 0.5).solve()
    assert raised.value.result.iterations < 3000


# -- pairing ----------------------------------------------------------------------------------


def wide(**settings):
    table = block("table", y=(-1.0, 0.0), D="bottom")
    punch = block("punch", x=(0.0, 2.0), D="top", move=(0.0, -0.01))
    contact = sc.Contact(punch.surface("bottom"), table.surface("top"), name="joint", **settings)
    return sc.ContactSolver([table, punch], [contact])


OVERHANG = (
    r"2 of 5 points of surface 'punch/bottom' project outside surface 'table/top'; the farthest, point "
    r"\d at \(2, 0\), misses by 1 \(4 facet lengths\)"
)


def test_points_outside_are_a_line_of_the_dry_run():
    """An overhang is reported with count, farthest point and distance, and solved as open."""
    solver = wide()
    assert re.search(OVERHANG + r"\. They can never touch \(outside=\"open\"\)", str(solver))
    result = solver.solve()
    assert np.isinf(result.gap[result.points[:, 0] > 1]).all()
    assert result.normal_force[result.points[:, 0] > 1].tolist() == [0.0, 0.0]


def test_points_that_come_to_touch_are_not_said_never_to():
    """A punch that slides onto the table: what stood beyond its end presses in the end."""
    table = block("table", y=(-1.0, 0.0), D="bottom")
    punch = block("punch", x=(0.5, 1.5), y=(0.0, 0.5), D="top", move=(0.0, -0.01))
    sides = punch.surface("bottom"), table.surface("top")
    options = sc.Options(max_travel=10.0)
    solver = sc.ContactSolver([table, punch], sc.Contact(*sides, sliding="finite"), options=options)
    assert "never" not in str(solver)
    assert re.search(
        r"at the start they can not touch .*; as bodies move they are paired anew", str(solver)
    )
    inward = np.where(punch.dof_component == 0, -0.5, punch.x)
    beyond = solver.solve().points[:, 0] > 1
    assert beyond.any()
    *_, last = solver.history([{"x": {"punch": punch.x}}, {"x": {"punch": inward}}])
    assert np.all(last.normal_force[beyond] > 0)
    for settings in ({}, {"sliding": "finite", "tied": True}):
        assert "They can never touch" in str(
            sc.ContactSolver([table, punch], sc.Contact(*sides, **settings))
        )


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_points_outside_are_an_error_if_asked(sliding):
    """outside="error" turns the same sentence into an error."""
    with pytest.raises(
        sc.errors.InputError, match=OVERHANG + r"\. If they should.*because of outside=\"error\""
    ):
        wide(outside="error", sliding=sliding)
    assert pair(outside="error").solve().converged


def test_points_that_slide_out_are_an_error_if_asked():
    """With finite sliding the points are watched on their way."""
    table = block("table", y=(-1.0, 0.0), D="bottom")
    punch = block("punch", x=(0.1, 0.6), y=(0.0, 0.5), D="top", move=(0.0, -0.01))
    contact = sc.Contact(
        punch.surface("bottom"), table.surface("top"), sliding="finite", outside="error", name="joint"
    )
    solver = sc.ContactSolver([table, punch], [contact], options=sc.Options(max_travel=10.0))
    along = [np.where(punch.dof_component == 0, s, punch.x) for s in (0.0, 0.3, 0.6)]
    run = solver.history({"x": {"punch": x}} for x in along)
    assert next(run).converged and next(run).converged
    with pytest.raises(sc.errors.InputError, match=r"points of surface 'punch/bottom' project outside"):
        next(run)


def test_surfaces_that_do_not_meet():
    """Surfaces that face the same way, and surfaces out of reach, have no point with a partner."""
    table, punch = block("table", y=(-1.0, 0.0), D="bottom"), block("punch", D="top")
    same = sc.Contact(punch.surface("top"), table.surface("top"))
    with pytest.raises(
        sc.errors.InputError, match=r"None of the 5 points of surface 'punch/top' .*face the same way"
    ):
        sc.ContactSolver([table, punch], same)
    far = block("far", y=(3.0, 4.0), D="top")
    away = sc.Contact(far.surface("bottom"), table.surface("top"), reach=0.5)
    with pytest.raises(
        sc.errors.InputError, match=r"None of the 5 points .*closest point is 3.* `reach`"
    ):
        sc.ContactSolver([table, far], away)


LOOKS = {
    ("top", "bottom"): r"look away from each other.* 2 away at least; overlaps .* `reach`",
    ("left", "right"): r"look away from each other.* 1 away at least",
    ("top", "top"): r"the two face the same way \(normals",
    ("left", "top"): r"the two do not face each other \(normals",
}


@pytest.mark.parametrize(
    "settings", [{}, {"method": "node"}, {"tied": True}, {"outside": "error"}], ids=str
)
@pytest.mark.parametrize("n", [4, 3], ids=["nodes-opposite", "nodes-between"])
@pytest.mark.parametrize("dim", [2, 3])
def test_sides_that_can_not_meet_are_refused(dim, n, settings):
    """Sides picked wrongly carry nothing for ever: refused whatever the method, with what is wrong."""
    table, punch = cube("table", dim, -1.0, 4), cube("punch", dim, 0.0, n)
    for (up, low), words in LOOKS.items():
        contact = sc.Contact(punch.surface(up), table.surface(low), **settings)
        with pytest.raises(sc.errors.InputError, match=rf"None of the \d+ points .*{words}"):
            sc.ContactSolver([table, punch], contact)
    sc.ContactSolver(
        [table, punch], sc.Contact(punch.surface("bottom"), table.surface("top"), **settings)
    )


def cube(name, dim, y, n):
    """A block of size 1 that supports hold below; the second axis points up."""
    grid = [np.linspace(0.0, 1.0, n + 1)] * dim
    grid[1] = grid[1] + y
    kind, element = {
        2: (fem.MeshQuad, fem.ElementQuad1()),
        3: (fem.MeshHex, fem.ElementHex1()),
    }[dim]
    sides = {"left": (0, 0.0), "right": (0, 1.0), "bottom": (1, y), "top": (1, y + 1.0)}
    mesh = kind.init_tensor(*grid).with_boundaries(
        {side: lambda x, i=i, at=at: np.isclose(x[i], at) for side, (i, at) in sides.items()}
    )
    basis = fem.Basis(mesh, fem.ElementVector(element), intorder=2)
    return sc.Body(basis, linear_elasticity(), D="bottom", name=name)


def test_what_slides_far_may_come_to_its_partner():
    """The barb of a snap fit begins behind the edge that it will catch: no error, and told as open.

    Two sides that look the same way never meet, however far they slide.
    """
    latch, hook = block("latch", y=(-1.0, 0.0), D="top"), block("hook", y=(1.0, 2.0), D="top")
    barb = sc.Contact(hook.surface("top"), latch.surface("bottom"), sliding="finite")
    solver = sc.ContactSolver([latch, hook], barb)
    assert "0 of 5 points have a partner" in str(solver)
    assert "0 points closed, 5 open, none with a partner;" in repr(solver.solve())
    assert "none with" not in repr(pair().solve())
    for method in ("node", "mortar"):
        strict = replace(barb, outside="error", method=method)
        with pytest.raises(sc.errors.InputError, match=r"None of the 5 .*because of outside=\"error\""):
            sc.ContactSolver([latch, hook], strict)
    same = sc.Contact(hook.surface("top"), latch.surface("top"), sliding="finite")
    with pytest.raises(sc.errors.InputError, match="face the same way"):
        sc.ContactSolver([latch, hook], same)


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_an_obstacle_out_of_reach(sliding):
    """What is farther off than `reach` has no partner: refused as between bodies."""
    low = sc.RigidPlane((0, -1), (0.2, 1))  # gaps from 0.98 to 1.18
    body = block("punch", D="top")

    def solver(**settings):
        return sc.ContactSolver(
            body, sc.Contact(body.surface("bottom"), low, sliding=sliding, **settings)
        )

    if sliding == "small":
        with pytest.raises(sc.errors.InputError, match=r"None of the 5 points .* and `reach`\."):
            solver(reach=0.5)
    with pytest.raises(
        sc.errors.InputError, match=r"2 of 5 points .*within reach.*because of outside="
    ):
        solver(reach=1.1, outside="error")
    assert "2 of 5 points of surface 'punch/bottom' find nothing" in str(solver(reach=1.1))
    assert solver(reach=1.2, outside="error").kin.paired.all()


def test_an_obstacle_is_never_secondary():
    """Secondary and primary swapped for an obstacle: said so."""
    punch = block("punch", D="top")
    with pytest.raises(sc.errors.InputError, match=r"secondary is an obstacle .*swap the two"):
        sc.Contact(FLOOR, punch.surface("bottom"))
    with pytest.raises(sc.errors.InputError, match="primary is a str"):
        sc.Contact(punch.surface("bottom"), "floor")


@pytest.mark.pairwise
@pytest.mark.parametrize("sliding", ["small", "finite"])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.9])
@pytest.mark.parametrize("gap", [-0.02, 0.0, 0.01])
def test_a_plane_the_wrong_way_round(gap, angle, sliding):
    """A normal into the plane makes gaps overlaps, and is refused at any gap and angle; not so glue."""
    c, s = np.cos(angle), np.sin(angle)
    mesh = fem.MeshQuad().refined(2).with_defaults()
    mesh = type(mesh)(np.array([[c, -s], [s, c]]) @ mesh.p, mesh.t, _boundaries=mesh.boundaries)
    body = sc.Body(fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1())), STIFFNESS, name="punch")
    bottom, up = body.surface("bottom"), np.array([-s, c])
    right, wrong = (sc.RigidPlane(-gap * up, sign * up, name="floor") for sign in (1, -1))
    sc.ContactSolver(body, sc.Contact(bottom, right, sliding=sliding))
    words = "All 5 points of surface 'punch/bottom' that 'floor' takes look away from it"
    with pytest.raises(sc.errors.InputError, match=words):
        sc.ContactSolver(body, sc.Contact(bottom, wrong, sliding=sliding))
    sc.ContactSolver(body, sc.Contact(bottom, wrong, tied=True))


def test_a_plane_takes_points_that_look_elsewhere():
    """The flank of a block may stand on a floor with its last point, a whole outline with a side."""
    body = block("punch")
    for where in ("left", ["left", "bottom", "right", "top"]):
        solver = sc.ContactSolver(body, sc.Contact(body.surface(where), FLOOR))
        assert solver.kin.paired.all()


def test_a_plane_at_right_angles_is_told():
    """All points stand edgewise: not refused, as the last of them may stand on the floor."""
    body, words = (
        block("punch", D="top"),
        "stand edgewise to 'floor': their normals are at right angles",
    )
    for where, told in (("left", True), ("bottom", False), (["left", "bottom"], False)):
        assert (words in str(sc.ContactSolver(body, sc.Contact(body.surface(where), FLOOR)))) == told


def test_empty_and_degenerate_surfaces():
    """A surface without facets, an unknown name, a facet without length."""
    body = block("punch", D="top")
    with pytest.raises(
        sc.errors.InputError, match=r"has no facets: no facet midpoint .* from \(0, 0\) to \(1, 1\)"
    ):
        body.surface(lambda x: x[0] > 9)
    with pytest.raises(
        sc.errors.InputError, match="'botom' not found in the mesh; did you mean 'bottom'"
    ):
        body.surface("botom")
    p = body.basis.mesh.p.copy()
    low = np.flatnonzero(p[1] == 0)
    p[:, low[1]] = p[:, low[0]]
    flat = sc.Body(fem.Basis(fem.MeshQuad(p, body.basis.mesh.t), body.basis.elem), body.K, name="flat")
    with pytest.raises(sc.errors.InputError, match=r"1 facets have no length, the first is mesh facet"):
        flat.surface(body.basis.mesh.boundaries["bottom"])


# -- prescribed DOFs against contact ------------------------------------------------------------


def test_prescribed_overlaps_are_warned_about():
    """Contact nodes prescribed into the floor: count, place and depth are named."""
    body = block("punch", D=["top", "bottom"], move=(0.0, -0.02))
    with pytest.warns(
        sc.ContactWarning, match=r"push 5 of 5 points of surface 'punch/bottom' into 'floor'.* by 0\.02"
    ):
        result = on_floor(body).solve()
    assert result.converged


@pytest.mark.parametrize("move", [(0.0, -0.02), (0.02, 0.0)], ids=["normal", "tangential"])
@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()], ids=["auto", "sparse"])
def test_torn_ties_are_an_error(linear, move):
    """Tied nodes prescribed differently on both sides have no right answer."""
    low, up = (
        block("low", y=(-1.0, 0.0), D=["bottom", "top"]),
        block("up", D=["top", "bottom"], move=move),
    )
    tie = sc.Contact(up.surface("bottom"), low.surface("top"), tied=True, name="glue")
    solver = sc.ContactSolver([low, up], tie, linear=linear)
    with pytest.raises(
        sc.errors.ConstraintError, match=r"'glue' ties 5 points .*differ by 0\.02 at point \d at"
    ):
        solver.solve()


def apart(gap, **settings):
    """A block of half the size above another one."""
    low, up = (
        block("low", y=(-1.0, 0.0), D="bottom"),
        block("up", (0.2, 0.7), (gap, gap + 0.5), D="top"),
    )
    contact = sc.Contact(up.surface("bottom"), low.surface("top"), **settings)
    return sc.ContactSolver([low, up], contact)


def test_glue_that_takes_what_is_far_off_is_warned_of():
    """Without `reach` a wedge is glued all along; a link has one length, an arm on an obstacle any."""
    low = block("low", y=(-1.0, 0.0), D="bottom")
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 1, 5)).with_defaults()
    mesh = fem.MeshQuad(mesh.p + [[0.0], [0.5]] * mesh.p[0], mesh.t, _boundaries=mesh.boundaries)
    wedge = sc.Body(fem.Basis(mesh, low.basis.elem, intorder=2), STIFFNESS, name="wedge")
    foot = wedge.surface("bottom")
    with pytest.warns(
        sc.ContactWarning, match=r"wedge/bottom on low/top glues points that are 0 to 0\.4.* `reach`"
    ):
        sc.ContactSolver([low, wedge], sc.Contact(foot, low.surface("top"), tied=True))
    for settings in ({"tied": True, "reach": 0.2}, {"separation": False}):
        sc.ContactSolver([low, wedge], sc.Contact(foot, low.surface("top"), **settings))
    sc.ContactSolver(wedge, sc.Contact(foot, FLOOR, tied=True))
    apart(5.0, tied=True)


def test_adjust_that_takes_away_the_size_of_a_body_is_warned_of():
    """It is for the round-off of meshes; what it does not reach it leaves alone."""
    with pytest.warns(
        sc.ContactWarning,
        match=r"adjust = 1 takes gaps and overlaps of up to 0\.2 for none, 0\.4 times",
    ):
        apart(0.2, adjust=1.0)
    apart(0.2, adjust=0.1)
    apart(0.11, adjust=1.0)  # .22 times the body: up to .3 (BRIDGED)
    body, floor = block("punch", y=(0.5, 1.5), D="top"), sc.RigidPlane((0, 0), (0, 1))
    with pytest.warns(sc.ContactWarning, match="usually a unit is wrong"):
        sc.ContactSolver(body, sc.Contact(body.surface("bottom"), floor, adjust=0.6))


@pytest.mark.filterwarnings("ignore:.*is strained by:skfem_contact.ContactWarning")
def test_huge_interference_is_warned_about():
    """An overlap of more than a tenth of the body is no press fit (HUGE)."""
    with pytest.warns(
        sc.ContactWarning, match=r"'joint' starts with an overlap of 0\.15, 0\.15 times the extent"
    ):
        pair(interference=0.15).solve()
    for interference in (0.07, 1e-3):
        pair(interference=interference).solve()
    with pytest.warns(sc.ContactWarning, match=r"starts with an overlap of 2, 2 times"):
        list(pair().history([{"interference": {"joint": 2.0}}]))


# -- what is no number, shape, type or name -----------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"K": "nan"},
            r"K of body 'b' holds NaN or infinite numbers: 1 of \d+ entries, the first in row",
        ),
        ({"K": np.eye(3)}, r"K of body 'b' has shape \(3, 3\), its basis has 50 DOFs"),
        ({"K": lambda u, v, w: 0}, r"is a function, .*BilinearForm"),
        ({"f": np.full(50, np.inf)}, r"f of body 'b' holds NaN or infinite numbers: 50 of 50"),
        ({"f": np.zeros(7)}, r"f of body 'b' has shape \(7,\), its basis has 50 DOFs"),
        ({"x": np.full(50, np.nan)}, r"x of body 'b' holds NaN or infinite numbers"),
        ({"x": np.zeros(50), "D": None}, r"x of body 'b' prescribes values, but D does not say"),
        ({"D": "topp"}, r"D of body 'b': boundary 'topp' not found .*did you mean 'top'"),
        ({"D": {"topp": "x"}}, r"D of body 'b': boundary 'topp' not found .*did you mean 'top'"),
        (
            {"D": {"top": ("x", "z")}},
            r"D of body 'b' holds 'z' of boundary 'top'; Known components: 'x', 'y'",
        ),
        ({"D": {"top": 0}}, r"Components are named: write {'top': \"x\"}"),
        (
            {"D": {"top": [1]}},
            r"has \[1\] for 'top', which would be numbers of DOFs.* write {'top': \"y\"}",
        ),
        ({"D": {"top": np.int64(1)}}, r"write {'top': \"y\"}"),
        ({"D": {"top": (0, 1)}}, r"write {'top': \(\"x\", \"y\"\)}"),
        ({"D": [999]}, r"D of body 'b' has numbers from 999 to 999"),
    ],
)
def test_bodies_of_wrong_data(change, message):
    """Wrong shapes, NaN and unknown names are refused where they are given, with the body's name."""
    good = block("b", D="top")
    data = {"K": good.K.copy(), "f": None, "D": "top", "x": None} | change
    if isinstance(data["K"], str):
        data["K"] = good.K.copy()
        data["K"].data[3] = np.nan
    with pytest.raises(sc.errors.InputError, match=message):
        sc.Body(good.basis, data["K"], data["f"], D=data["D"], x=data["x"], name="b")


def test_wrong_elements_and_meshes():
    """Elements without nodal values, and NaN coordinates, are named."""
    mesh = fem.MeshTri().refined(1)
    basis = fem.Basis(mesh, fem.ElementTriArgyris())
    with pytest.raises(
        sc.errors.InputError, match="uses ElementTriArgyris: contact needs elements whose DOFs"
    ):
        sc.Body(basis, np.eye(basis.N))


@pytest.mark.parametrize("what", ["gap", "interference"])
def test_fields_of_wrong_data(what):
    """Gaps and interferences of wrong length or not finite are refused by name."""
    with pytest.raises(sc.errors.InputError, match=rf"{what} of contact .* has NaN or infinite values"):
        pair(**{what: np.nan})
    with pytest.raises(
        sc.errors.InputError, match=rf"{what} of contact .* shape \(3,\), but there are 5 contact"
    ):
        pair(**{what: np.zeros(3)})


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ({"force": {}}, r"a load step names \['force'\]; it may name \['f', 'x'"),
        ("twice", r"a load step is 'twice': it has to be a number"),
        (np.nan, r"a load step is nan: give a finite factor"),
        ({"f": {"puch": 1.0}}, r"there is no body 'puch'; did you mean 'punch'"),
        ({"f": {"punch": np.zeros(3)}}, r"f of body 'punch' has shape \(3,\), but 50 DOFs"),
        (
            {"x": {"punch": np.full(50, np.nan)}},
            r"x of body 'punch' holds NaN or infinite numbers: 50 of 50",
        ),
        ({"x": np.zeros(7)}, r"x of all bodies has shape \(7,\), but 100 DOFs"),
        (
            {"interference": {"jiont": 1.0}},
            r"interference: there is no contact 'jiont'; did you mean 'joint'",
        ),
        ({"interference": 1.0}, r"interference in a load step has to be a dict by name"),
        ({"motion": {"floor": (0, 1)}}, r"motion: there is no obstacle 'floor'"),
    ],
)
def test_steps_of_wrong_data(step, message):
    """A load step that names something unknown, or gives it a wrong shape, is refused by name."""
    with pytest.raises(sc.errors.InputError, match=message):
        list(pair().history([step]))


@pytest.mark.parametrize("motion", [(0, 0, 0, 1), "up", (np.nan, 0)])
def test_motions_of_wrong_data(motion):
    """The motion of an obstacle is a translation, or one with an angle and a centre."""
    solver = on_floor(block("punch", D="top"))
    with pytest.raises(sc.errors.InputError, match=r"motion of 'joint' is"):
        list(solver.history([{"motion": {"floor": motion}}]))


def test_names_of_results():
    """Contacts and attributes that a result does not have: close matches, and what it has."""
    solver = pair()
    result = solver.solve()
    with pytest.raises(sc.errors.InputError, match="there is no contact 'jonit'; did you mean 'joint'"):
        result["jonit"]
    with pytest.raises(AttributeError, match="no attribute 'presure'"):
        result.presure  # noqa: B018
    other = pair().contacts[0]
    with pytest.raises(
        sc.errors.InputError, match="not one of those of the solver: pass the same object"
    ):
        result[other]
    body = block("punch", D="top")
    sides = [sc.Contact(body.surface(s), FLOOR) for s in ("bottom", "left")]
    many = sc.ContactSolver(body, sides).solve()
    with pytest.raises(AttributeError, match=r"'pressure' belongs to a contact and there are 2"):
        many.pressure  # noqa: B018


def test_settings_of_contacts_and_solvers():
    """Tied and friction, unknown options, no contact, foreign surfaces, twice the same name."""
    body, stranger = block("punch", D="top"), block("stranger", D="top")
    surface = body.surface("bottom")
    with pytest.raises(sc.errors.InputError, match=r"tied=True and friction=.* exclude each other"):
        sc.Contact(surface, FLOOR, tied=True, friction=sc.Coulomb(0.3))
    with pytest.raises(
        sc.errors.InputError, match=r"friction = 0\.3 is not a friction law; write friction=Coulomb"
    ):
        sc.Contact(surface, FLOOR, friction=0.3)
    with pytest.raises(sc.errors.InputError, match="method = 'morta' is not one of"):
        sc.Contact(surface, FLOOR, method="morta")
    with pytest.raises(sc.errors.InputError, match="There is no contact: give at least one"):
        sc.ContactSolver(body, [])
    with pytest.raises(sc.errors.InputError, match=r"not one of the stacked bodies \(stranger\)"):
        sc.ContactSolver(stranger, sc.Contact(surface, FLOOR))
    with pytest.raises(sc.errors.InputError, match="several contacts are named 'joint'"):
        sc.ContactSolver(body, [sc.Contact(surface, FLOOR, name="joint") for _ in range(2)])
    with pytest.raises(sc.errors.InputError, match="loop = 'newtn' is not one of"):
        sc.ContactSolver(body, sc.Contact(surface, FLOOR), loop="newtn")
    with pytest.raises(
        sc.errors.InputError, match="linear = 'direct' is neither 'auto' nor 'condensed'"
    ):
        sc.ContactSolver(body, sc.Contact(surface, FLOOR), linear="direct").solve()
    with pytest.raises(
        sc.errors.InputError, match=r"start is a state of 50 DOFs, 5 contact points .* has .*, 9 and 1"
    ):
        fine = block("punch", n=8, D="top")
        on_floor(fine).solve(start=on_floor(body).solve())


# -- loops that do not end -----------------------------------------------------------------------


def test_no_convergence_is_an_error_that_carries_its_state():
    """A loop that runs out of iterations raises with the last state; throw=False returns it."""

    class Late(sc.conditions.FrictionLaw):  # slides as long as it has not, and then should not have
        def limit(self, force, area, slip):
            return np.where(np.linalg.norm(slip, axis=-1) < 0.02, 0.0, 3.0 * force)

    body = block("punch", D="top", move=(0.05, -0.01))
    contact = sc.Contact(body.surface("bottom"), FLOOR, friction=Late())
    options = sc.Options(max_iterations=1, max_cuts=0)
    solver = sc.ContactSolver(body, contact, options=options)
    with pytest.raises(
        sc.errors.NotConverged, match=r"'newton' did not converge: no convergence in 1 iterations"
    ) as raised:
        solver.solve()
    assert not raised.value.result.converged
    assert raised.value.result.certificate.worst > 1e-10
    kept = solver.solve(throw=False)
    assert not kept.converged and "no convergence" in kept.message
    assert str(kept).startswith("Contact result: no convergence")


def test_without_friction_no_word_of_it_is_said(monkeypatch):
    """What is not found then is for want of digits: a load has one answer."""
    starts = internals.original("loops.STARTS")
    internals.replace(
        monkeypatch, "loops.STARTS", [start for start in starts if start in ("warm", "cold")]
    )
    table, punch = block("table", y=(-1.0, 0.0), D="bottom"), block("punch", D="top", move=(0.0, -0.01))
    gap = {"gap": lambda x: 0.02 * (x[0] - 0.5) ** 2}  # some points have to open again
    contact = sc.Contact(punch.surface("bottom"), table.surface("top"), **gap)
    options = sc.Options(max_iterations=1, max_cuts=0)
    with pytest.raises(sc.errors.NotConverged, match=r"law of contact is violated.* digits") as raised:
        sc.ContactSolver([table, punch], contact, options=options).solve()
    assert "friction can hold" not in str(raised.value) and "mu times" not in str(raised.value)


def test_progress_needs_tqdm(monkeypatch):
    """Without tqdm the progress bar is refused, naming the extra that brings it."""
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(sc.errors.InputError, match=r"needs tqdm.*skfem-contact\[progress\]"):
        list(pair().history([1.0], progress=True))
    monkeypatch.undo()
    pytest.importorskip("tqdm")
    assert len(list(pair().history([0.5, 1.0], progress=True))) == 2


def test_progress_has_load_iterations_and_no_condensation(capsys, monkeypatch):
    """The bar counts the steps, whose time is that after the bodies have been condensed."""
    pytest.importorskip("tqdm")
    solver, seen = pair(), []
    prepare = solver.linear_model.prepare

    def prepared():
        seen.append("condensed")
        return prepare()

    monkeypatch.setattr(solver.linear_model, "prepare", prepared)
    for i, result in enumerate(solver.history([0.5, 1.0, 1.5], progress=True)):
        seen.append(result.factor)
        if i == 1:
            break
    assert seen == ["condensed", 0.5, 1.0]
    said = capsys.readouterr().err
    assert "condensing the bodies" in said and "load steps" in said
    assert "2/3" in said and "load factor 1, " in said and "3/3" not in said


def test_log_lines_have_step_and_contact(caplog):
    """At the level INFO every step has a line: which it is, how it ended, what each contact does."""
    with caplog.at_level("INFO", logger="skfem_contact"):
        list(pair().history([0.5, 1.0]))
    lines = [record.getMessage() for record in caplog.records if record.levelname == "INFO"]
    assert [text.split(":")[0] for text in lines] == [
        "step 1 of 2, load factor 0.5",
        "step 2 of 2, load factor 1",
    ]
    assert all(
        "converged in" in text and "joint: frictionless: 5 points closed" in text for text in lines
    )


def test_an_interrupted_history_keeps_what_it_has():
    """Ctrl-C in the third step: two results are in the exception, which says so; the solver goes on."""
    solver, reached = pair(), []

    def steps():
        yield 0.5
        yield 1.0
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as raised:
        reached.extend(solver.history(steps()))
    assert [result.factor for result in raised.value.results] == [0.5, 1.0]
    if sys.version_info >= (3, 11):
        assert raised.value.__notes__[0].startswith("2 load steps were finished before: their results")
    (last,) = solver.history([1.5], start=raised.value.results[-1])
    assert last.converged


def test_notebooks_show_solvers():
    """The dry run, as text that HTML does not take for its own; repr is a line."""
    solver = pair()
    assert solver._repr_html_().startswith("<pre>") and "->" not in solver._repr_html_()
    assert repr(solver) == "<ContactSolver: bodies table, punch; contacts joint; loop 'newton'>"


# -- the dry run ----------------------------------------------------------------------------------


def test_dry_run_says_what_is_modelled():
    """print(solver): sizes, what is free to move, gaps and overlaps, and the better secondary side."""
    table = block("table", y=(-1.0, 0.0), D="bottom", n=8)
    punch = block("punch", y=(0.0, 1.0), force=(0.0, -1e-3), n=4, E=100.0)
    shape = np.array([-0.01, 0.0, 0.0, 0.02, 0.03])
    contact = sc.Contact(
        punch.surface("bottom"),
        table.surface("top"),
        friction=sc.Coulomb(0.3),
        gap=shape,
        method="node",
        name="joint",
    )
    text = str(sc.ContactSolver([table, punch], [contact]))
    for words in (
        "body table: 162 DOFs, 18 prescribed, MeshQuad1, 64 elements",
        "free without contact and friction: punch: translation along x",
        "joint: punch/bottom on table/top",
        "friction Coulomb(mu=0.3)",
        "5 of 5 points have a partner",
        "2 open (largest 0.03), 2 closed, 1 overlap (deepest 0.01)",
        "'table/top' is finer than the secondary one, 'punch/bottom': facets of 0.125 against 0.25",
        "the secondary side is 100 times stiffer than the primary",
        "212 DOFs -> 20 contact DOFs -> 10 gaps and slips of 5 points; ",
    ):
        assert words in text, words


@pytest.mark.parametrize("kind", [{"tied": True}, {"separation": False}])
def test_dry_run_tells_what_is_held_together_across(kind):
    """A tie or bond takes the meshes as they are: how far they are apart is said beforehand."""
    table, punch = block("table", D="bottom"), block("punch", y=(1.1, 2.1))
    contact = sc.Contact(punch.surface("bottom"), table.surface("top"), **kind)
    assert "held together as meshed: up to 0.1 apart, overlapping by up to 0" in str(
        sc.ContactSolver([table, punch], contact)
    )


def test_dry_run_of_other_kinds():
    """Ties, frictionless contact on obstacles, and the sparse route are described as what they are."""
    assert "tied (node): gaps and slips are zero, also in tension" in str(
        pair(tied=True, method="node")
    )
    body = block("punch", D="top")
    text = str(
        sc.ContactSolver(body, sc.Contact(body.surface("bottom"), FLOOR), linear=sc.linalg.Direct())
    )
    assert "no rigid motion is free: supports alone hold all bodies" in text
    assert "method node by node; frictionless: nothing tangential is modelled" in text
    assert "linear solver Direct(method='auto') on all 50 DOFs" in text
