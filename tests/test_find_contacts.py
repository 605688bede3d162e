"""Contacts that are found: which pairs, their sides and names, and what is said of the others."""

from __future__ import annotations

import dataclasses
import importlib
from pathlib import Path

import internals
import numpy as np
import pytest
import skfem as fem
from quick_elasticity import linear_elasticity

import skfem_contact as sc

STEEL, ALUMINIUM = linear_elasticity(0.4, 0.3), linear_elasticity(0.1, 0.08)
BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


def box(name, low, high, n, material=STEEL, turn=None, **given):
    """A rectangle, or a box, of so many elements along each side."""
    grid = [np.linspace(a, b, k + 1) for a, b, k in zip(low, high, n, strict=True)]
    mesh = (fem.MeshQuad if len(low) == 2 else fem.MeshHex).init_tensor(*grid).with_defaults()
    if turn is not None:
        mesh = dataclasses.replace(mesh, doflocs=turn @ mesh.doflocs)
    element = fem.ElementQuad1() if len(low) == 2 else fem.ElementHex1()
    return sc.Body.from_mesh(mesh, fem.ElementVector(element), material, name=name, **given)


def ring(name, inner, outer, n, length=None, shift=0.0, quadratic=False):
    """A ring of n elements round it in the plane, or a tube; numbered from an angle."""
    turn = np.linspace(0, 2 * np.pi, n + 1) + shift
    radius = np.linspace(inner, outer, 3)
    flat = fem.MeshQuad.init_tensor(turn, radius)
    if length is not None:
        flat = fem.MeshHex.init_tensor(turn, radius, np.linspace(*length))
    p = flat.p.copy()
    p[0], p[1] = flat.p[1] * np.cos(flat.p[0]), flat.p[1] * np.sin(flat.p[0])
    first, last = (np.flatnonzero(np.isclose(flat.p[0], a)) for a in (turn[0], turn[-1]))
    same = np.arange(p.shape[1])
    same[last] = first[np.argmin(((p[:, last, None] - p[:, None, first]) ** 2).sum(axis=0), axis=1)]
    _, number = np.unique(same, return_inverse=True)
    kept = np.unique(same)
    mesh = type(flat)(p[:, kept], number[flat.t])
    if quadratic:  # middle nodes on the circles
        mesh = fem.MeshQuad2.from_mesh(mesh)
        x, corners = mesh.doflocs.copy(), np.hypot(*mesh.p)[mesh.facets]
        wanted = corners.mean(axis=0)
        middle = mesh.dofs.facet_dofs[0]
        x[:, middle] *= wanted / np.hypot(*x[:, middle])
        mesh = dataclasses.replace(mesh, doflocs=x)
    element = {2: fem.ElementQuad1(), 3: fem.ElementHex1()}[mesh.dim()]
    vector = fem.ElementVector(fem.ElementQuad2() if quadratic else element)
    return sc.Body.from_mesh(mesh, vector, STEEL, name=name)


def stack(d, *heights, **given):
    """Plates on each other, from the ground up."""
    z, bodies = 0.0, []
    for i, height in enumerate(heights):
        low, high = (0.0,) * (d - 1) + (z,), (4.0,) * (d - 1) + (z + height,)
        bodies.append(box(f"plate {i}", low, high, (3 + i,) * (d - 1) + (1,), **given))
        z += height
    return bodies


# ------------------------------------------------------------------------------------ which pairs


def test_both_sides_of_a_wall_are_one_body():
    """A thin ring, whose outer boundary does not hang together with the inner one: no pair of it."""
    rings = [ring("thin", 5.0, 5.1, 48), ring("around", 5.1, 6.0, 40)]
    assert sc.find_contacts(rings, within=0.2).names == ("thin - around",)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("within", [0.01, 1.0, 1.5])
def test_a_stack_has_a_pair_for_each_interface(d, within):
    """What stands behind another plate is none, thin as that is; twice `within` is more (NEARLY)."""
    pairs = sc.find_contacts(stack(d, 1.0, 0.2, 0.2, 1.0), within=within)
    assert pairs.names == ("plate 0 - plate 1", "plate 1 - plate 2", "plate 2 - plate 3")
    assert all(pair.gap == (0.0, 0.0, 0.0) for pair in pairs.found)
    np.testing.assert_allclose([pair.area for pair in pairs.found], 4.0 ** (d - 1), rtol=1e-12)


@pytest.mark.parametrize("gap", [-0.02, 0.0, 0.02, 0.04])
@pytest.mark.parametrize("quadratic", [False, True])
@pytest.mark.parametrize("n", [(16, 23), (23, 16)])
def test_chord_heights_are_taken_off_in_the_plane(gap, quadratic, n):
    """A shaft in a bore: chords of 16 differ by .096 on radius 5; the gap is told to a third of .01."""
    bodies = [
        ring("hub", 5 + gap, 8, n[0], quadratic=quadratic),
        ring("shaft", 3, 5, n[1], shift=0.1, quadratic=quadratic),
    ]
    pairs = sc.find_contacts(bodies, within=0.03)
    assert len(pairs) == (abs(gap) < 0.03 or (not quadratic and abs(gap) < 0.03 + 0.25 * 0.15))
    if abs(gap) < 0.03:
        np.testing.assert_allclose(pairs.found[0].gap, gap, atol=3e-3)
        assert pairs.found[0].remark == ""


def test_chord_heights_are_taken_off_in_space():
    """The same of tubes: 20 and 31 facets round a bore, whose chords differ by more than `within`."""
    tubes = [ring("hub", 5, 7, 20, (0, 4, 3)), ring("shaft", 3, 5, 31, (-1, 5, 5), shift=0.1)]
    pairs = sc.find_contacts(tubes, within=0.01)
    assert pairs.names == ("hub - shaft",) and pairs["hub - shaft"].secondary.body.name == "shaft"
    np.testing.assert_allclose(pairs.found[0].gap, 0.0, atol=5e-3)
    length = np.ptp(pairs["hub - shaft"].primary.points[:, 2])
    assert length == 4.0
    # a clearance that is no pair stays none, though chords of both cross over
    loose = [ring("hub", 5.1, 7, 20, (0, 4, 3)), tubes[1]]
    assert len(sc.find_contacts(loose, within=0.05)) == 0


def test_a_chamfer_beside_a_flat_takes_nothing_off():
    """The flat ends straight at a chamfer, whose averaged normals would say that it bulges."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 4, 5), np.linspace(0, 1, 3))
    x = mesh.p.copy()
    x[1, (x[0] == 4) & (x[1] == 0)] = np.tan(np.radians(25))
    element = fem.ElementVector(fem.ElementQuad1())
    block = sc.Body.from_mesh(fem.MeshQuad(x, mesh.t), element, STEEL, name="block")
    (pair,) = sc.find_contacts([block, box("plate", (-1, -1), (5, 0), (6, 2))], within=0.01).found
    np.testing.assert_allclose(pair.gap, 0.0, rtol=0, atol=1e-15)


def test_far_parts_that_are_coarse_are_seen():
    """Two plates of one facet each, which cover a third of each other: middles see nothing."""
    low, high = (
        box("low", (0, 0, 0), (3, 3, 1), (1, 1, 1)),
        box("high", (2, 0, 1), (5, 3, 2), (1, 1, 1)),
    )
    assert sc.find_contacts([low, high], within=0.01).names == ("low - high",)


def test_a_gap_may_be_wider_than_many_facets():
    """Facets of .06 that look over .9: each sees the one that is opposite."""
    low, high = box("low", (0, 0), (4, 1), (64, 1)), box("high", (0, 1.9), (4, 3), (63, 1))
    (pair,) = sc.find_contacts([low, high], within=1.0).found
    assert pair.gap == pytest.approx((0.9, 0.9, 0.9)) and pair.area == pytest.approx(4.0)


def test_a_side_ends_where_the_boundary_that_names_it_ends():
    """A block on a seat of a plate: the facets next to it are smooth, and not of the seat."""
    plate = box("plate", (0, 0), (8, 1), (8, 1))
    whole = sc.find_contacts([plate, box("block", (2, 1), (6, 2), (8, 2))], within=0.01)
    assert whole[0].primary.area.sum() == pytest.approx(6.0)  # a facet more at both ends
    mesh = plate.basis.mesh.with_boundaries({"seat": lambda x: (x[1] == 1) & (abs(x[0] - 4) < 2)})
    seated = sc.Body.from_mesh(mesh, fem.ElementVector(fem.ElementQuad1()), STEEL, name="plate")
    pair = sc.find_contacts([seated, box("block", (2, 1), (6, 2), (8, 2))], within=0.01)[0]
    assert pair.primary.label == "plate/seat" and pair.primary.area.sum() == pytest.approx(4.0)


def test_edges_beside_each_other_are_no_pair():
    """Plates beside each other on one level touch along a side only; at an edge they do not."""
    one, beside = (
        box("one", (0, 0, 0), (2, 2, 1), (2, 2, 1)),
        box("beside", (2, 0, 0), (4, 2, 1), (3, 3, 1)),
    )
    corner = box("corner", (2, 2, 1), (4, 4, 2), (2, 2, 1))
    assert sc.find_contacts([one, beside], within=0.1).names == ("one - beside",)
    assert len(sc.find_contacts([one, corner], within=0.1)) == 0


@pytest.mark.parametrize(("angle", "found"), [(40.0, 2), (50.0, 0)])
def test_what_stands_askew_is_no_partner(angle, found):
    """A point over a plate, whose sides rise by an angle: half a right angle at most (OPPOSITE)."""
    wide = 1 / np.tan(np.radians(angle))
    tip = fem.MeshTri(np.array([[0.0, wide, -wide], [0.0, 1.0, 1.0]]), np.array([[0], [1], [2]]))
    element = fem.ElementVector(fem.ElementTriP1())
    block = sc.Body.from_mesh(tip.refined(3), element, STEEL, name="block")
    plate = box("plate", (-3, -1), (3, 0), (12, 1))
    assert len(sc.find_contacts([plate, block], within=0.05)) == found


def test_a_ball_is_met_where_it_is_nearest():
    """Between the places that are asked it comes nearer: the node under it has the gap of .018."""
    grid = np.linspace(-1, 1, 5)
    mesh = fem.MeshHex.init_tensor(grid, grid, grid)
    p = mesh.p * np.abs(mesh.p).max(axis=0) / np.maximum(np.sqrt((mesh.p**2).sum(axis=0)), 1e-30)
    p[2] += 1.018
    body = sc.Body.from_mesh(
        fem.MeshHex(p, mesh.t), fem.ElementVector(fem.ElementHex1()), STEEL, name="ball"
    )
    plate = box("plate", (-2, -2, -1), (2, 2, 0), (5, 5, 1))
    pairs = sc.find_contacts([plate, body], within=0.02)
    assert pairs.names == ("plate - ball",) and pairs.found[0].remark != "sliver"


@pytest.mark.parametrize(("length", "remark"), [(2.0, "sliver"), (4.0, "")])
def test_slivers_are_named(length, remark):
    """An edge that just reaches over another, along 1/36 and 2/36 of both plates (SLIVER)."""
    one, other = (
        box("one", (0, 0, 0), (6, 6, 1), (12, 12, 1)),
        box("other", (5.6, 6 - length, 1), (12, 12 - length, 2), (13, 12, 1)),
    )
    pairs = sc.find_contacts([one, other], within=0.1)
    assert [pair.remark for pair in pairs.found] == [remark]
    assert len(pairs.drop("sliver")) == (remark == "")


@pytest.mark.parametrize(("gap", "found"), [(0.055, 1), (0.08, 0)])
def test_a_quarter_of_chord_heights_is_left_as_doubt(gap, found):
    """Chords of 16 and 23 in radius 5 have heights of .096 and .047, together .143 (UNSURE)."""
    pairs = sc.find_contacts(
        [ring("hub", 5 + gap, 8, 16), ring("shaft", 3, 5, 23, shift=0.1)], within=0.03
    )
    assert [pair.remark for pair in pairs.found] == ["uncertain"] * found


def test_parts_of_one_body_are_pairs_if_they_do_not_hang_together():
    """Two blocks of one mesh; the two flanks of a slot are not."""
    low, high = (
        box("a", (0, 0), (2, 1), (2, 1)).basis.mesh,
        box("b", (0, 1.01), (2, 2), (2, 1)).basis.mesh,
    )
    both = fem.MeshQuad(np.hstack([low.p, high.p]), np.hstack([low.t, high.t + low.p.shape[1]]))
    body = sc.Body.from_mesh(both, fem.ElementVector(fem.ElementQuad1()), STEEL, name="both")
    assert sc.find_contacts(body, within=0.1).names == ("both - both",)
    slit = fem.MeshQuad.init_tensor(np.linspace(0, 4, 5), np.array([0, 1, 1.05, 2.05]))
    slit = slit.restrict(lambda x: (x[0] < 1) | (np.abs(x[1] - 1.025) > 0.1))
    slotted = sc.Body.from_mesh(slit, fem.ElementVector(fem.ElementQuad1()), STEEL, name="slotted")
    assert sc.find_contacts([slotted, box("on", (0, 2.05), (4, 3), (1, 1))], within=0.1).names == (
        "slotted - on",
    )


# ------------------------------------------------------------------ what is near, and not taken


def test_what_is_near_is_told():
    """A gap beyond `within` and not twice that is a line (NEARLY), and so are overlaps."""
    plates = [box("low", (0, 0), (4, 1), (4, 1)), box("high", (0, 1.15), (4, 2), (3, 1))]
    for within, lines in ((0.1, 1), (0.07, 0)):
        pairs = sc.find_contacts(plates, within=within)
        assert len(pairs) == 0 and len(pairs.not_taken) == lines
    assert sc.find_contacts(plates, within=0.1).not_taken == (
        "low/top and high/bottom: 0.15 apart, within is 0.1",
    )
    deep = [plates[0], box("high", (0, 0.85), (4, 2), (3, 1))]
    assert "overlap by 0.15" in sc.find_contacts(deep, within=0.1).not_taken[0]


def test_bodies_that_overlap_or_repeat_are_named():
    """A bolt that was not cut out of its plate, and a plate that was read twice."""
    plate, pin = box("plate", (0, 0), (8, 3), (16, 6)), box("pin", (3, -1), (4, 4), (3, 9))
    pairs = sc.find_contacts([plate, pin], within=0.01)
    assert len(pairs) == 0 and "'plate' and 'pin' overlap by 1.22" in pairs.not_taken[0]
    twice = sc.find_contacts(
        [*stack(2, 1, 1), dataclasses.replace(stack(2, 1)[0], name="again")], within=0.01
    )
    assert "'plate 0' and 'again' are the same mesh at the same place" in twice.not_taken[0]
    assert twice.names == ("plate 0 - plate 1", "plate 1 - again")


# --------------------------------------------------------------------------- sides and names


@pytest.mark.parametrize(
    "material",
    [sc.materials.NeoHooke(1.0, 2.0), sc.J2(1e3, 0.3, 1.0), sc.Elastic(1.0, 0.3)],
    ids=lambda m: type(m).__name__,
)
def test_bodies_with_materials_are_found_and_compared(material):
    """The softer of two equal meshes is the secondary one, whatever law says how soft it is."""
    mesh = fem.MeshQuad().refined(1).with_defaults()
    bases = [
        fem.Basis(mesh.translated((0, y)), fem.ElementVector(fem.ElementQuad1()), intorder=2)
        for y in (0, 1)
    ]
    stiff = sc.Body(bases[0], sc.Elastic(2e5, 0.3), D="bottom", name="stiff")
    soft = sc.NonlinearBody(bases[1], material, name="soft")
    (pair,) = sc.find_contacts([stiff, soft], within=0.1).found
    assert pair.why == "softer" and pair.contact.secondary.body is soft


def test_pairs_are_in_the_order_of_the_bodies():
    """Whatever the order of the faces: a beam on two feet, which touch a plate behind it first."""
    beam = box("beam", (0, 0), (4, 1), (8, 2))
    around = [
        box("a", (0, 1), (1, 2), (3, 3)), box("b", (3, -1), (4, 0), (3, 3)),
        box("c", (0, -1), (1, 0), (3, 3)), box("d", (3, 1), (4, 2), (3, 3)),
    ]  # fmt: skip
    names = sc.find_contacts([beam, *around], within=0.01).names
    assert names == ("beam - a", "beam - b", "beam - c", "beam - d")


def test_the_secondary_side_has_its_reason():
    """The finer, else the softer, else the smaller, else the first."""
    low = (0, 0), (6, 1)
    for n, size, material, side, why in (
        (9, 6, ALUMINIUM, "upper", "finer"),
        (5, 6, ALUMINIUM, "upper", "softer"),
        (4, 4, STEEL, "upper", "smaller"),
        (6, 6, STEEL, "lower", "first"),
    ):
        upper = box("upper", (0, 1), (size, 2), (n, 1), material)
        (pair,) = sc.find_contacts([box("lower", *low, (6, 1)), upper], within=0.1).found
        assert (pair.contact.secondary.body.name, pair.why) == (side, why)


def test_names_do_not_hang_on_the_secondary_side():
    """Bodies in the order in which they are given, and boundaries where there are several."""
    u = fem.MeshQuad.init_tensor(np.array([0.0, 1, 3, 4]), np.array([0.0, 1, 4])).with_defaults()
    u = u.restrict(lambda x: (x[1] < 1) | (np.abs(x[0] - 2) > 1)).with_boundaries(
        {"inner left": lambda x: np.isclose(x[0], 1), "floor": lambda x: np.isclose(x[1], 1)}
    )
    cup = sc.Body.from_mesh(u, fem.ElementVector(fem.ElementQuad1()), STEEL, name="cup")
    names = []
    for n in (1, 9):
        block = box("block", (1, 1), (3, 3), (n, n))
        pairs = sc.find_contacts([cup, block], within=0.1)
        names.append(set(pairs.names))
        assert pairs["cup - block, floor"].primary.body.name == ("block" if n == 1 else "cup")
    assert names[0] == names[1] == {
        "cup - block, floor",
        "cup - block, inner left",
        "cup - block, at (3, 2.5)",
    } or names[0] >= {"cup - block, floor", "cup - block, inner left"}


def test_nothing_hangs_on_place_order_units_or_turn():
    """The same pairs with bodies in another order, mirrored, turned, in metres."""

    def tubes(scale, turn):
        made = [ring("hub", 5, 7, 20, (0, 4, 3)), ring("shaft", 3, 5, 31, (-1, 5, 5), shift=0.1)]
        moved = [
            dataclasses.replace(b.basis.mesh, doflocs=scale * (turn @ b.basis.mesh.doflocs + 3))
            for b in made
        ]
        element = fem.ElementVector(fem.ElementHex1())
        pairs = zip(moved, made, strict=True)
        return [sc.Body.from_mesh(mesh, element, STEEL, name=b.name) for mesh, b in pairs]

    rotation = np.linalg.qr(np.array([[1.0, 2, 0], [0, 1, 3], [1, 0, 1]]))[0]
    plain = sc.find_contacts(tubes(1.0, np.eye(3)), within=0.01).found[0]
    for scale, turn in ((1e-3, np.eye(3)), (1.0, rotation * np.sign(np.linalg.det(rotation)))):
        (pair,) = sc.find_contacts(tubes(scale, turn)[::-1], within=0.01 * scale).found
        np.testing.assert_allclose(np.array(pair.gap) / scale, plain.gap, atol=1e-12)
        assert np.isclose(pair.area / scale**2, plain.area, rtol=1e-12)
        assert len(pair.contact.secondary.points) == len(plain.contact.secondary.points)


# ------------------------------------------------------------------------------- the list


def test_the_list_is_what_a_solver_takes():
    """Found, changed, solved: the weight of three plates goes down through all of them."""
    plates = stack(3, 1.0, 0.5, 1.0)
    plates[0] = dataclasses.replace(plates[0], D=plates[0].basis.get_dofs(lambda x: x[2] == 0))
    plates[2] = dataclasses.replace(
        plates[2], f={"back": (0.0, 0.0, -1e-3)}
    )  # the side of the largest z
    pairs = sc.find_contacts(plates, within=0.01, friction=lambda a, b: sc.Coulomb(0.2), adjust=0.001)
    assert [p.adjust for p in pairs] == [0.001] * 2 and pairs[0].friction.mu == 0.2
    pairs = pairs.change("plate 1 - *", tied=True)
    assert [p.tied for p in pairs] == [False, True] and pairs[1].friction is None
    result = sc.ContactSolver(plates, pairs).solve()
    for name in pairs.names:
        side = 1.0 if result.contacts[pairs.index_of(name)].secondary.body.name > "plate 1" else None
        force = np.abs(result[name].force[2])
        assert side is None or np.isclose(force, 16e-3, rtol=1e-9)
        assert np.isclose(force, 16e-3, rtol=1e-9)
    assert "tied" in str(pairs) and "plate 0/" in str(pairs)


def test_pairs_are_chosen_by_name_pattern_body_and_function():
    pairs = sc.find_contacts(stack(2, 1, 1, 1, 1), within=0.01, tied=lambda a, b: a == "plate 0")
    assert [p.tied for p in pairs] == [True, False, False]
    assert (
        pairs.drop("plate 3").names == pairs.names[:2] == pairs.keep("plate 0*", pairs.names[1]).names
    )
    assert len(pairs.drop(lambda pair: pair.contact.tied)) == 2
    with pytest.raises(sc.errors.InputError, match="did you mean"):
        pairs.drop("plate 0 - plate2")
    with pytest.raises(sc.errors.InputError, match="did you mean"):
        pairs["plate 0 - plate2"]
    with pytest.raises(sc.errors.InputError, match="give a name"):
        pairs.keep(3)


@pytest.mark.parametrize("d", [2, 3])
def test_pairs_are_drawn(d):
    """A colour and a line of the legend for each."""
    pytest.importorskip("matplotlib")
    from matplotlib import colors, pyplot

    if d == 3:
        pytest.importorskip("pyvista")
    pairs = sc.find_contacts(stack(d, 1, 1, 1), within=0.01)
    ax = sc.output.plot_pairs(pairs)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == list(pairs.names)
    if d == 2:
        assert len(ax.collections) == 3 + 2 * 2
    else:  # one picture of all, which has both colours
        pixels = np.asarray(ax.images[0].get_array())[..., :3].reshape(-1, 3).astype(int)
        for line in ax.get_lines():
            colour = 255 * np.array(colors.to_rgb(line.get_color()))
            assert np.any(np.all(np.abs(pixels - colour) < 40, axis=1))
    ax.figure.canvas.draw()
    pyplot.close("all")
    with pytest.raises(sc.errors.InputError, match="no pairs to draw"):
        sc.output.plot_pairs(pairs.drop("*"))


def test_pairs_of_a_list_are_drawn():
    """Contacts with obstacles are left out, and those without a name are numbered as in a solver."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    both = stack(2, 1, 1)
    side, other = both[1].surface("bottom"), both[0].surface("top")
    pair, tool = sc.Contact(side, other), sc.Contact(side, sc.RigidPlane((0, 0), (0, 1)))
    ax = sc.output.plot_pairs([tool, pair])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["contact 2"]
    pyplot.close("all")


# ------------------------------------------------------------------------------- bad input


def test_bad_input_is_answered():
    plates = stack(2, 1, 1)
    with pytest.raises(sc.errors.InputError, match="within = 0"):
        sc.find_contacts(plates, within=0)
    with pytest.raises(sc.errors.InputError, match="Contact has no argument 'tolerance'"):
        sc.find_contacts(plates, within=0.1, tolerance=0.1)
    with pytest.raises(sc.errors.InputError, match="body 2 have no name"):
        sc.find_contacts([plates[0], dataclasses.replace(plates[1], name=None)], within=1)
    with pytest.raises(sc.errors.InputError, match="several bodies are named 'plate 0'"):
        sc.find_contacts([plates[0], dataclasses.replace(plates[1], name="plate 0")], within=1)
    with pytest.raises(sc.errors.InputError, match="different dimension"):
        sc.find_contacts([plates[0], box("solid", (0, 0, 0), (1, 1, 1), (1, 1, 1))], within=1)
    floor = sc.RigidBody(sc.RigidPlane((0, 0), (0, 1)), name="floor")
    with pytest.raises(sc.errors.InputError, match="no bodies to stack"):
        sc.find_contacts([floor], within=1)
    assert "'floor' is rigid" in sc.find_contacts([*plates, floor], within=1).not_taken[0]
    with pytest.raises(sc.errors.InputError, match="mu"):
        sc.find_contacts(plates, within=0.1, mu=0.3)


# ---------------------------------------------------------------- against lists written by hand


def test_pairs_of_assemblies_are_those_of_the_lists(monkeypatch):
    """Of those of the benchmark that are quick to mesh; the slow test has all."""
    judge(monkeypatch, ("blocks", "shaft, gap .2", "stepped shaft, 2nd order"))


@pytest.mark.slow
def test_pairs_of_all_assemblies_are_those_of_the_lists(monkeypatch):
    """None missed, and at most one in twenty too many."""
    judge(monkeypatch, None)


def judge(monkeypatch, names):
    pytest.importorskip("gmsh")
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    found = importlib.import_module("found_contacts")
    rows = [
        found.judged(name, found.bodies_of(case), case.within, case.touch)
        for name, case in found.ASSEMBLIES.items()
        if names is None or name in names
    ]
    assert sum(row["missed"] for row in rows) == 0, rows
    assert 20 * sum(row["too many"] for row in rows) <= sum(row["pairs"] for row in rows), rows


def test_places_towards_the_rim(monkeypatch):
    """Nearer to the middle they miss what covers a corner, beyond it they see more (TOWARDS_RIM)."""
    low, high = (
        box("low", (0, 0, 0), (3, 3, 1), (1, 1, 1)),
        box("high", (2.3, 0, 1), (5.3, 3, 2), (1, 1, 1)),
    )
    corner = box("corner", (3, 3, 1), (6, 6, 2), (1, 1, 1))
    for factor, found in ((1.0, (1, 0)), (0.5, (0, 0)), (2.0, (1, 3))):
        internals.replace(monkeypatch, "assemblies.TOWARDS_RIM", 0.85 * factor)
        assert tuple(len(sc.find_contacts([low, b], within=0.01)) for b in (high, corner)) == found
