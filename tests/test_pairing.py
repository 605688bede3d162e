"""Node-to-segment pairing: closest points, corners, ends, normals, and what is said about them."""

from __future__ import annotations

import time
from dataclasses import replace

import internals
import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import minimize_scalar

from skfem_contact import Body
from skfem_contact.bodies import KINDS
from skfem_contact.errors import InputError
from skfem_contact.pairing import (
    Corners,
    closest_facets,
    corner_contacts,
    diagnose,
    dual_mortar,
    node_to_segment,
    project,
    unselected_sides,
)

FACING, COINCIDENT = internals.original("pairing.FACING"), internals.original("pairing.GIVEN")


def facet_shapes(xi, k):
    """Shape functions of a line and their slopes, (..., k) each."""
    N, dN = KINDS[f"line{k}"].shapes(np.asarray(xi)[..., None])
    return N, dN[..., 0]


def body(mesh, element=None, name=None):
    element = element or {3: fem.ElementTriP1, 4: fem.ElementQuad1}[mesh.t.shape[0]]()
    basis = fem.Basis(mesh, fem.ElementVector(element))
    return Body(basis, sp.eye(basis.N), name=name)


def block(nx, left, right, bottom, top, element=None, name=None, wave=None):
    x = np.linspace(left, right, nx + 1) if np.ndim(nx) == 0 else np.asarray(nx)
    mesh = fem.MeshQuad.init_tensor(x, np.array([bottom, top])).with_defaults()
    if wave is not None:
        p = mesh.p.copy()
        p[1] += wave(p[0])
        mesh = fem.MeshQuad(p, mesh.t).with_boundaries(mesh.boundaries)
    return body(mesh, element, name)


def feet(pairing, primary):
    return pairing.primary_weights @ primary.points


def turned(surface, angle, shift):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    one = surface.body
    u = (one.dof_points @ turn.T + shift - one.dof_points)[np.arange(one.n), one.dof_component]
    return surface.moved(u), turn


@pytest.mark.pairwise
@pytest.mark.parametrize("lower", [fem.ElementQuad1(), fem.ElementQuad2()])
@pytest.mark.parametrize("upper", [fem.ElementQuad1(), fem.ElementQuad2()])
@pytest.mark.parametrize("height", [0.3, 0.0, -0.2])
def test_flat_surfaces_pair_vertically(lower, upper, height):
    """Over a flat block the foot is below the node, the gap the height, the normal vertical."""
    primary = block(5, 0, 1, 0, 1, lower).surface("top")
    secondary = block(7, 0, 1, 1 + height, 2.5, upper).surface("bottom")
    pairing = node_to_segment(secondary, primary)
    assert pairing.paired.all() and np.all(pairing.miss == 0)
    np.testing.assert_allclose(pairing.gap, height, rtol=0, atol=1e-14)
    np.testing.assert_allclose(
        pairing.normal, np.tile([0, 1], (len(pairing.gap), 1)), rtol=0, atol=1e-14
    )
    np.testing.assert_allclose(pairing.tangent[:, 0], np.tile([-1, 0], (len(pairing.gap), 1)))
    np.testing.assert_allclose(feet(pairing, primary), pairing.points - [0, height], rtol=0, atol=1e-14)
    np.testing.assert_allclose(pairing.primary_weights.sum(axis=1), 1.0)
    assert abs(pairing.secondary_weights - sp.eye(len(pairing.gap))).max() == 0
    assert np.array_equal(pairing.area, secondary.area)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    angle=st.floats(0, 6.28),
    quadratic=st.booleans(),
    scale=st.sampled_from([1.0, 1e-4]),
)
def test_closest_facets_are_those_of_an_exhaustive_search(seed, angle, quadratic, scale):
    """On rough, graded surfaces no facet that faces a point is nearer than its partner."""
    random = np.random.default_rng(seed)
    x = np.r_[0, np.sort(random.random(11)) + 0.01 * np.arange(1, 12), 1.5]
    element = fem.ElementQuad2() if quadratic else fem.ElementQuad1()
    y = 0.3 * random.random(13)
    lower = block(
        x * scale, 0, 1, -1 * scale, 0, element, wave=lambda p: np.interp(p, x * scale, y * scale)
    )
    upper = block(30, -0.2 * scale, 1.7 * scale, 0.25 * scale, 2 * scale)
    primary, _ = turned(lower.surface("top"), angle, 0)
    secondary, _ = turned(upper.surface("bottom"), angle, 0)
    pairing = node_to_segment(secondary, primary)
    m, nf = len(pairing.gap), len(primary.facets)
    point, facet = np.divmod(np.arange(m * nf), nf)
    found = project(primary, facet, secondary.points[point])
    foot, over = found.foot, found.over
    distance = np.linalg.norm(foot - secondary.points[point], axis=1)
    faces = np.sum(secondary.normals[point] * primary.facet_normals[facet], axis=1) < -FACING
    above = faces & (over == 0)  # an inner stationary point, whatever the neighbours are
    best = np.full(m, np.inf)
    np.minimum.at(best, point[above], distance[above])
    mine = np.linalg.norm(feet(pairing, primary) - secondary.points, axis=1)
    deep = 0.5 * np.linalg.norm(np.ptp(primary.points, axis=0))
    assert np.all(pairing.paired[best < deep])
    assert np.all(mine[pairing.paired] <= best[pairing.paired] * (1 + 1e-9))
    # and it is a facet that faces the point
    back = np.sum(secondary.normals * primary.facet_normals[pairing.facet], axis=1)
    assert np.all(back[pairing.paired] < -FACING)


def test_feet_on_curved_facets_minimise_the_distance():
    """On a quadratic facet the foot is the minimum that a scalar optimiser finds."""
    surface = body(fem.MeshTri2.init_circle(1), fem.ElementTriP2()).surface(None)
    points = np.array([[1.4, 0.3], [0.2, 1.05], [-0.8, -0.4], [0.1, -2.5]])
    for point in points:
        facet = np.arange(len(surface.facets))
        feet = project(surface, facet, np.tile(point, (len(facet), 1)))
        xi, foot = feet.xi[:, 0], feet.foot
        for f in facet[
            np.linalg.norm(foot - point, axis=1) < 1.2 * np.linalg.norm(foot - point, axis=1).min()
        ]:
            corners = surface.points[surface.facets[f]]

            def distance(s, corners=corners, point=point):
                return np.linalg.norm(facet_shapes(np.array(s), 3)[0] @ corners - point)

            found = minimize_scalar(distance, bounds=(0, 1), method="bounded", options={"xatol": 1e-10})
            assert distance(xi[f]) <= found.fun * (1 + 1e-12)


@pytest.mark.parametrize("quadratic, order", [(False, 2), (True, 6)])
def test_gaps_to_a_circle_converge(quadratic, order):
    """Gaps between a line and polygons (quadratic arcs) in a circle converge to the true ones.

    To quadratic arcs by order 4; to the circles through their nodes by order 6.
    """
    errors = []
    for level in (3, 4):
        mesh = (fem.MeshTri2 if quadratic else fem.MeshTri).init_circle(level)
        disc = body(mesh, fem.ElementTriP2() if quadratic else fem.ElementTriP1())
        line = block(60, -1, 1, 1.1, 2).surface("bottom")
        pairing = node_to_segment(line, disc.surface(None))
        assert pairing.paired.all()
        errors.append(np.abs(pairing.gap - (np.hypot(*line.points.T) - 1)).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4)


@pytest.mark.parametrize("few", [0, 200, 10**6])
def test_search_may_begin_at_any_level_of_the_tree(few, monkeypatch):
    """From the root, from nodes of some facets each, and from the facets themselves: one answer."""
    disc = body(fem.MeshTri.init_circle(4).translated((0.5, 2.03))).surface(None)
    floor = block(60, -2.0, 3.0, 0.0, 1.0).surface("top")
    expected = node_to_segment(disc, floor), dual_mortar(disc, floor)
    assert expected[0].paired.sum() > 20
    internals.replace(monkeypatch, "pairing.FEW_PAIRS", few)
    found = node_to_segment(disc, floor), dual_mortar(disc, floor)
    for pairing, usual in zip(found, expected, strict=True):
        assert np.array_equal(pairing.facet, usual.facet)
        assert np.array_equal(pairing.gap, usual.gap)
        assert (pairing.primary_weights != usual.primary_weights).nnz == 0


def test_corners_that_overlap_are_those_of_all_that_do():
    """Whatever the place: for small sliding corners are left out unseen where none overlaps."""
    random = np.random.default_rng(4)
    floor = block(9, -2.0, 2.0, -1.0, 0.0, wave=lambda x: 0.05 * np.sin(3 * x)).surface("top")
    square = block(3, -0.5, 0.5, 0.0, 1.0).surface(None)
    counts = set()
    for _ in range(40):
        own = turned(square, random.uniform(-0.7, 0.7), (0.0, random.uniform(-0.1, 0.4)))[0]
        every, deep = (corner_contacts(own, floor, only_overlaps=only) for only in (False, True))
        for (_, met), (_, seen), other in (
            (every.own, deep.own, floor),
            (every.other, deep.other, own),
        ):
            inside = met.gap < -COINCIDENT * other.lengths[met.facet]
            assert np.array_equal(met.corner[inside], seen.corner)
            assert np.array_equal(met.facet[inside], seen.facet)
            counts.add(len(seen.corner))
    assert {0, 1} <= counts


def test_normals_are_continuous_along_a_smooth_surface():
    """Sliding along a disc the normal turns steadily, at most 1.5 times as fast as the point."""
    disc = body(fem.MeshTri.init_circle(3)).surface(None)
    ring = fem.MeshTri.init_circle(7)  # its own boundary, turned inside out, is a very fine secondary
    outer = body(ring.scaled(1.05)).surface(None)
    inward = outer.__class__(**{**vars(outer), "normals": -outer.normals})
    pairing = node_to_segment(inward, disc)
    assert pairing.paired.all()
    angle = np.unwrap(np.arctan2(*pairing.normal.T[::-1]))
    around = np.unwrap(np.arctan2(*pairing.points.T[::-1]))
    assert np.all(np.abs(np.diff(angle)) <= 1.5 * np.abs(np.diff(around)))


def test_matching_curved_surfaces_have_the_averaged_normals():
    """A node on a joint gets the averaged normal; round-off of its place does not change it."""
    disc = body(fem.MeshTri.init_circle(3)).surface(None)
    random = np.random.default_rng(1)
    noisy = disc.points * (1 + 1e-12 * random.standard_normal(disc.points.shape))
    other = body(fem.MeshTri.init_circle(3))
    inward = disc.__class__(**{**vars(disc), "normals": -disc.normals, "points": noisy, "body": other})
    pairing = node_to_segment(inward, disc)
    np.testing.assert_allclose(
        pairing.normal, disc.points, rtol=0, atol=1e-10
    )  # equal chords: the radius
    np.testing.assert_allclose(pairing.gap, 0, atol=1e-11)


def test_overhang_is_measured_along_the_surface():
    """Nodes beyond the end of an open surface have no partner and miss it by their overhang."""
    primary = block(5, 0, 1, 0, 1, name="block").surface("top")
    secondary = block(6, 0.4, 1.6, 1.5, 2, name="punch").surface("bottom")
    pairing = node_to_segment(secondary, primary)
    x = pairing.points[:, 0]
    assert np.array_equal(pairing.paired, x <= 1 + 1e-9)
    np.testing.assert_allclose(pairing.miss, np.maximum(x - 1, 0), rtol=0, atol=1e-14)
    assert np.all(np.isinf(pairing.gap[~pairing.paired]))
    assert pairing.primary_weights[~pairing.paired].nnz == 0
    np.testing.assert_allclose(pairing.normal[~pairing.paired], [[0, 1]] * 3)


@pytest.mark.every_value
@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2])
def test_a_corner_above_a_corner_is_paired(scale, angle):
    """Equal widths: the end nodes stay paired under round-off, at any scale and angle."""
    lower = block(4, 0, scale, 0, scale).surface("top")
    for sign in (-1, 1):
        upper = block(3, 0, scale, scale, 2 * scale).surface("bottom")
        shift = sign * 1e-12 * scale * np.array([np.cos(angle), np.sin(angle)])
        pairing = node_to_segment(turned(upper, angle, shift)[0], turned(lower, angle, 0)[0])
        assert pairing.paired.all()
        assert np.abs(pairing.gap).max() <= 1e-11 * scale
    outside = 10 * COINCIDENT * 0.25 * scale
    upper = block(1, -outside, scale, scale, 2 * scale).surface("bottom")
    assert node_to_segment(upper, lower).paired.tolist() == [False, True]


@pytest.mark.parametrize("meet", [node_to_segment, dual_mortar])
@pytest.mark.parametrize("degrees, faces", [(0, True), (82, True), (86, False), (93, False)])
def test_surfaces_face_each_other_up_to_84_degrees(meet, degrees, faces):
    """A facet that is 82 degrees off the opposite direction is met, one at 86 degrees is not."""
    primary = block([0.0, 20.0], 0, 1, -1, 0).surface("top")
    upper = block([9.9, 10.1], 0, 1, 0.0, 0.1).surface("bottom")
    for sign in (-1, 1):
        middle = np.array([10.0, 0.0])
        angle = sign * np.radians(degrees)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        secondary, _ = turned(upper, angle, middle - turn @ middle + [0.0, 0.2])
        assert meet(secondary, primary).paired.any() == faces


@pytest.mark.parametrize("beyond, held", [(1e-7, True), (2e-6, False)])
def test_a_node_is_above_the_end_up_to_a_millionth_of_a_facet(beyond, held):
    """Round-off does not decide at the end of a surface, and nothing larger than it does either."""
    primary = block([0.0, 2.0], 0, 1, -1, 0).surface("top")
    secondary = block([1.0, 2.0 + 2.0 * beyond], 0, 1, 0.5, 1).surface("bottom")
    pairing = node_to_segment(secondary, primary)
    assert pairing.paired[np.argmax(secondary.points[:, 0])] == held


@pytest.mark.parametrize("lift", [-1e-3, 1e-3])
@pytest.mark.parametrize("slope", [-0.3, 0.03, 0.3])
def test_ends_of_inclined_joints_of_equal_width_meet(slope, lift):
    """The feet of a joint that overlaps or is open lie aside by gap times slope: not beyond an end."""
    kinds = {"wave": lambda x: slope * x}
    primary = block(6, 0, 1, -1, 0, **kinds).surface("top")
    secondary = block(6, 0, 1, lift, 1, **kinds).surface("bottom")
    pairing = node_to_segment(secondary, primary)
    assert pairing.paired.all() and (pairing.miss == 0).all()
    np.testing.assert_allclose(pairing.gap, lift / np.hypot(1, slope), rtol=1e-9)
    # a node that is a hundredth of a facet farther out is beyond the end
    wider = np.r_[-2e-3, np.linspace(0, 1, 7)[1:-1], 1 + 2e-3]
    secondary = block(wider, 0, 1, lift, 1, **kinds).surface("bottom")
    x = node_to_segment(secondary, primary).points[~node_to_segment(secondary, primary).paired][:, 0]
    assert sorted(x.tolist()) == [-2e-3, 1 + 2e-3]


def test_surfaces_of_different_dimensions_are_refused():
    """A curve in the plane and one in space can not be paired."""
    lower = block(2, 0, 1, 0, 1, name="low").surface("top")
    upper = block(2, 0, 1, 1, 2, name="up").surface("bottom")
    space = replace(upper, points=np.column_stack([upper.points, np.zeros(len(upper.points))]))
    with pytest.raises(InputError, match="'up/bottom' is 3-D, surface 'low/top' 2-D"):
        node_to_segment(space, lower)


@pytest.mark.parametrize("angle", [0.0, 1.1])
def test_convex_vertices_hold_the_nodes_around_them(angle):
    """Outside a blunt convex vertex the vertex is the partner, with its averaged normal."""
    lower = block([0, 1.0, 2.0], 0, 2, -1, 0, wave=lambda x: 0.2 * (1 - np.abs(x - 1)))
    upper = block([0.99, 1.0, 1.01], 0, 1, 0.5, 1)
    primary, turn = turned(lower.surface("top"), angle, 0)
    pairing = node_to_segment(turned(upper.surface("bottom"), angle, 0)[0], primary)
    vertex = np.flatnonzero(np.isclose(primary.points @ turn, [1, 0.2]).all(axis=1))
    np.testing.assert_allclose(pairing.primary_weights[:, vertex].toarray(), 1.0)
    np.testing.assert_allclose(pairing.normal @ turn, [[0, 1]] * 3, rtol=0, atol=1e-14)
    np.testing.assert_allclose(pairing.gap, 0.3)


def test_sharp_corners_take_the_normal_of_the_opposite_side():
    """Near a block's corner the normal is that of the top; beyond 45 degrees a node overhangs."""
    primary = block(2, 0, 1, 0, 1).surface(None)
    pairing = node_to_segment(block([1.0, 1.05, 1.2], 0, 1, 1.1, 2).surface("bottom"), primary)
    by_x = np.argsort(pairing.points[:, 0])
    assert pairing.paired[by_x].tolist() == [True, True, False]
    np.testing.assert_allclose(pairing.normal[by_x[:2]], [[0, 1]] * 2, rtol=0, atol=1e-14)
    np.testing.assert_allclose(pairing.gap[by_x[:2]], 0.1)
    assert pairing.miss[by_x[2]] == pytest.approx(0.2)


def test_concave_corners_choose_the_nearer_side_and_ties_the_more_opposite():
    """In a groove nodes go to the nearer flank; on its axis where the flanks are decides."""
    groove = block([-1.0, 0.0, 1.0], 0, 1, -2, 0, wave=lambda x: np.abs(x)).surface("top")
    tip = block([-0.3, 0.0, 0.3], 0, 1, 1, 2).surface("bottom")
    for noise in (0.0, 1e-12, -1e-12):
        pairing = node_to_segment(turned(tip, 0.0, np.array([noise, 0]))[0], groove)
        assert pairing.paired.all()
        x, foot = pairing.points[:, 0], feet(pairing, groove)
        side = np.abs(x) > 0.1
        assert np.all(np.sign(foot[side, 0]) == np.sign(x[side]))
        np.testing.assert_allclose(pairing.gap, (1 - np.abs(x)) / np.sqrt(2), rtol=0, atol=1e-11)
        np.testing.assert_allclose(foot[~side], [[-0.5, 0.5]], rtol=0, atol=1e-11)


@pytest.mark.parametrize("tilt", [-0.3, 0.3])
def test_of_equally_near_flanks_the_more_opposite_is_taken(tilt):
    """A node on the axis of a groove that looks to one side meets the flank on that side."""
    groove = block([-1.0, 0.0, 1.0], 0, 1, -2, 0, wave=lambda x: np.abs(x)).surface("top")
    tip = block([-0.3, 0.0, 0.3], 0, 1, 0, 1).surface("bottom")
    pairing = node_to_segment(turned(tip, tilt, np.array([0.0, 1.0]))[0], groove)
    middle = np.argmin(np.abs(pairing.points[:, 0]))
    np.testing.assert_allclose(feet(pairing, groove)[middle], [0.5 * np.sign(tilt), 0.5])


def test_overlaps_do_not_reach_the_far_side():
    """A node that penetrates by 5 % pairs with the near face, not with the back or the sides."""
    primary = block(4, 0, 1, 0, 1).surface(None)
    pairing = node_to_segment(block(3, 0.1, 0.9, 0.95, 2).surface("bottom"), primary)
    np.testing.assert_allclose(pairing.gap, -0.05, rtol=0, atol=1e-14)
    deep = block(3, 0.1, 0.9, 0.3, 2).surface("bottom")
    # looked for down to half the box of the smaller surface, here the secondary one: 0.4
    assert not node_to_segment(deep, block(4, 0, 1, 0, 1).surface("top")).paired.any()


def test_reach_limits_gaps_and_overlaps():
    """Nothing farther than `reach` is a partner."""
    primary = block(4, 0, 1, 0, 1).surface("top")
    for height in (0.2, -0.2):
        secondary = block(3, 0, 1, 1 + height, 2).surface("bottom")
        assert node_to_segment(secondary, primary, reach=0.21).paired.all()
        assert not node_to_segment(secondary, primary, reach=0.19).paired.any()
    for reach in (0, -1, np.nan, "far"):
        with pytest.raises(InputError, match="is not a positive length"):
            node_to_segment(secondary, primary, reach=reach)


def test_a_step_between_open_pieces_is_looked_past():
    """A node beyond the upper tread of a stair meets the lower one, though that is farther."""
    upper, lower = fem.MeshQuad().scaled([1, 2]), fem.MeshQuad().translated((1.0, 0.0))
    mesh = fem.MeshQuad(np.hstack([upper.p, lower.p]), np.hstack([upper.t, lower.t + 4]))
    stair = body(mesh).surface(lambda x: ((x[1] == 2) & (x[0] < 1)) | ((x[1] == 1) & (x[0] > 1)))
    pairing = node_to_segment(block([1.05, 1.5], 0, 1, 2.1, 3).surface("bottom"), stair)
    assert pairing.paired.all()
    np.testing.assert_allclose(pairing.gap, 1.1)


def test_the_tip_of_a_slit_is_not_its_own_partner():
    """A node shared by both surfaces would constrain itself; it is left alone."""
    lower = fem.MeshQuad().refined(1)
    upper = lower.translated((0.0, 1.0))
    p = np.hstack([lower.p, upper.p])
    t = np.hstack([lower.t, upper.t + lower.p.shape[1]])
    twin = [int(np.flatnonzero((p == np.array([[0.0], [1.0]])).all(axis=0))[i]) for i in (0, 1)]
    t[t == twin[1]] = twin[0]
    keep = np.setdiff1d(np.arange(p.shape[1]), twin[1])
    one = body(fem.MeshQuad(p[:, keep], np.searchsorted(keep, t)))
    mesh = one.basis.mesh
    slit = np.flatnonzero(np.isclose(mesh.p[1, mesh.facets], 1).all(axis=0))
    below = mesh.p[1, mesh.t].mean(axis=0)[mesh.f2t[0, slit]] < 1
    pairing = node_to_segment(one.surface(slit[~below]), one.surface(slit[below]))
    assert np.array_equal(pairing.paired, pairing.points[:, 0] > 0)


def test_pairing_moves_with_the_bodies():
    """Rotating and translating both surfaces changes neither gaps, weights nor misses."""
    lower = body(fem.MeshTri.init_circle(3)).surface(None)
    upper = block(20, -1.5, 1.5, 1.02, 2).surface("bottom")
    before = node_to_segment(upper, lower)
    shift = np.array([3.0, -2.0])
    after = node_to_segment(turned(upper, 2.1, shift)[0], turned(lower, 2.1, shift)[0])
    assert np.array_equal(before.paired, after.paired)
    np.testing.assert_allclose(after.gap, before.gap, rtol=0, atol=1e-12)
    np.testing.assert_allclose(after.miss, before.miss, rtol=0, atol=1e-12)
    assert abs(after.primary_weights - before.primary_weights).max() < 1e-12


def test_diagnosis_of_an_overhang():
    """The sentence counts the points and names the worst, its place and how far it misses."""
    primary = block(20, 0, 1, 0, 1, name="block").surface("top")
    secondary = block([0, 0.5, 1.02], 0, 1, 1, 2, name="punch").surface("bottom")
    worst = int(np.argmax(secondary.points[:, 0]))
    (line,) = (
        text
        for text in diagnose(node_to_segment(secondary, primary), secondary, primary)
        if "project" in text
    )
    assert line.startswith(
        "1 of 3 points of surface 'punch/bottom' project outside surface 'block/top'; the "
        f"farthest, point {worst} "
        "at (1.02, 1), misses by 0.02 (0.4 facet lengths)."
    )
    assert line.endswith(
        "too short, or the two are swapped; enlarge it, or swap secondary and primary."
    )


def test_diagnosis_of_swapped_and_distant_surfaces():
    """Surfaces facing the same way, a finer primary one, a short reach have their sentences."""
    lower, upper = block(20, 0, 1, 0, 1, name="a"), block(4, 0, 1, 1.5, 2, name="b")
    top, bottom = lower.surface("top"), upper.surface("bottom")

    def said(secondary, primary, **options):
        return " ".join(diagnose(node_to_segment(secondary, primary, **options), secondary, primary))

    assert "'b/top' finds a partner on 'a/top': the two face the same way" in said(
        upper.surface("top"), top
    )
    assert "the closest point is 0.5" in said(bottom, top, reach=0.1)
    finer = "'a/top' is finer than the secondary one, 'b/bottom': facets of 0.05 against 0.25"
    assert finer in said(bottom, top)
    assert said(top, bottom) == ""
    ball = fem.MeshTri.init_circle(3).scaled(0.4).translated((0.5, 1.5))
    disc = body(ball, name="disc").surface(None)
    assert "find nothing of 'a/top' that faces them" in said(disc, lower.surface("top"))


@pytest.mark.slow
def test_a_hundred_thousand_points_take_seconds():
    """Pairing costs n log n also where half of the points overhang; all pairs would take hours."""
    n = 100_000
    lower = block(n, 0, 10, 0, 1).surface("top")
    upper = block(n - 1, 5, 15, 1.01, 2).surface("bottom")
    start = time.perf_counter()
    pairing = node_to_segment(upper, lower)
    # measured 0.5 s on one core; the margin is for busy machines
    assert time.perf_counter() - start < 15
    assert np.count_nonzero(pairing.paired) == n // 2


def test_feet_on_a_bulge_are_the_closest_of_several():
    """Inside a strongly curved facet the distance has several minima: the foot is the smallest.

    Judged by the distance to two thousand points of the facet.
    """
    mesh = fem.MeshTri2.from_mesh(fem.MeshTri())
    points = mesh.doflocs.copy()
    bottom = np.isclose(points[1], 0.0) & np.isclose(points[0], 0.5)
    points[1, bottom] = -1.0
    surface = body(fem.MeshTri2(points, mesh.t), fem.ElementTriP2()).surface(lambda x: x[1] < 0.1)
    x = np.random.default_rng(3).uniform([-0.2, -1.2], [1.2, 0.3], (400, 2))
    facet = np.flatnonzero(surface.points[surface.facets[:, 2], 1] < -0.9)
    assert len(facet) == 1
    foot = project(surface, np.repeat(facet, len(x)), x).foot
    corners = surface.points[surface.facets[facet[0]]]
    along = facet_shapes(np.linspace(0.0, 1.0, 2001), 3)[0] @ corners
    least = np.linalg.norm(x[:, None] - along, axis=2).min(axis=1)
    # points of the facet are 2e-3 apart: beside the foot they are farther by the square of that
    np.testing.assert_array_less(np.linalg.norm(x - foot, axis=1), least + 1e-9)


def test_only_convex_ends_of_a_surface_are_corners():
    """Of an L: a ledge has none where the other leg stands on it, nor half a side where it goes on."""
    mesh = fem.MeshQuad.init_tensor(np.arange(3.0), np.arange(3.0))
    ell = body(mesh.restrict(np.flatnonzero(mesh.p[:, mesh.t].mean(axis=1).sum(axis=0) < 2.5)))
    ledge = ell.surface(lambda x: (x[1] == 1) & (x[0] > 1))
    np.testing.assert_allclose(np.sort(ledge.end_turns.ravel()), [-np.pi / 2, np.pi / 2], atol=1e-14)
    half = ell.surface(lambda x: (x[1] == 0) & (x[0] < 1))
    for surface, place in ((ledge, (2, 1)), (half, (0, 0))):
        np.testing.assert_allclose(surface.points[Corners.of(surface).node], [place], atol=1e-14)


def foundations(dim, fine):
    """A surface of two foundations side by side that are not joined, as one body."""
    steps = np.linspace(-2, 0, fine + 1), np.linspace(-1, 0, 3), np.linspace(-0.5, 1.5, fine + 1)
    if dim == 2:
        left, kind, element = fem.MeshQuad.init_tensor(*steps[:2]), fem.MeshQuad, fem.ElementQuad1()
        right = left.translated((2, 0))
    else:
        left, kind = fem.MeshHex.init_tensor(*steps), fem.MeshHex
        right, element = left.translated((2, 0, 0)), fem.ElementHex1()
    mesh = kind(np.hstack([left.p, right.p]), np.hstack([left.t, right.t + left.p.shape[1]]))
    mesh = mesh.with_boundaries({"up": lambda x: x[1] == 0})
    return body(mesh, element), left.p.shape[1]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("fine", [3, 4])
def test_seams_carry_on_both_sides(dim, fine):
    """A node over the seam of two foundations is carried by both alike, whatever their numbering; nodes
    beside it by one, with weights that are those of their facet."""
    below, first = foundations(dim, fine)
    spaces = np.linspace(-1, 1, 5), np.linspace(0, 1, 3), np.linspace(0, 1, 4)
    mesh = fem.MeshQuad.init_tensor(*spaces[:2]) if dim == 2 else fem.MeshHex.init_tensor(*spaces)
    element = fem.ElementQuad1() if dim == 2 else fem.ElementHex1()
    mesh = mesh.with_boundaries({"down": lambda x: x[1] == 0})
    above = body(mesh, element)
    secondary, primary = above.surface("down"), below.surface("up")
    pairing = node_to_segment(secondary, primary)
    left = primary.points[:, 0] < 1e-9
    left &= primary.dofs[:, 0] < np.sort(below.basis.nodal_dofs[:, :first].ravel())[-1] + 1
    share = np.asarray(pairing.primary_weights[:, left].sum(axis=1)).ravel()
    x = secondary.points[:, 0]
    assert_allclose(share[x < -1e-9], 1.0, rtol=0, atol=1e-12)
    assert_allclose(share[x > 1e-9], 0.0, rtol=0, atol=1e-12)
    assert_allclose(share[np.abs(x) < 1e-9], 0.5, rtol=0, atol=1e-12)
    assert_allclose(pairing.primary_weights @ primary.points, secondary.points, rtol=0, atol=1e-12)


@pytest.mark.parametrize("height", [0.1, 1.0, -0.1, -1.0])
def test_points_beyond_an_end_miss_it_only_within_reach(height):
    """Beside the end of a surface, no farther above or below it than `reach`, a point misses it.

    Farther off the end is no partner that was missed.
    """
    primary = block(4, 0, 1, -2, 0).surface("top")
    secondary = block([1.1, 1.2, 1.3], 0, 1, height, 3).surface("bottom")
    pairing = node_to_segment(secondary, primary, reach=0.3)
    assert not pairing.paired.any()
    beside = pairing.points[:, 0] - 1.0
    expected = beside if abs(height) < 0.3 else np.full(3, np.inf)
    assert_allclose(pairing.miss, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("slope", [-0.3, 0.3])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_free_end_has_no_next_facet(side, slope):
    """A point above and beyond a free end has no partner there, however the last facet of all leans.

    An end without a neighbour is nothing that the numbers of facets could stand in for.
    """
    flat = fem.MeshQuad.init_tensor([0.0, 1.0], [-1.0, 0.0])
    far = fem.MeshQuad.init_tensor([10.0, 11.0], [-1.0, 0.0])
    lean = far.p + np.array([[0.0], [slope]]) * (far.p[0] - 10.5) * (far.p[1] > -0.5)
    mesh = fem.MeshQuad(np.hstack([flat.p, lean]), np.hstack([flat.t, far.t + 4]))
    stair = body(mesh).surface(lambda x: x[1] > -0.4)
    assert len(stair.facets) == 2 and np.all(stair.neighbours < 0)
    place = np.array([1.1, 1.2]) if side > 0 else np.array([-0.2, -0.1])
    pairing = node_to_segment(block(place, 0, 1, 0.5, 1).surface("bottom"), stair)
    assert not pairing.paired.any()
    beside = pairing.points[:, 0] - 1.0 if side > 0 else -pairing.points[:, 0]
    assert_allclose(pairing.miss, beside, rtol=0, atol=1e-12)


@pytest.mark.parametrize("shift", [0.0, 0.25])
def test_a_corner_in_a_corner_keeps_its_normal(shift):
    """A wedge in a groove: the tip has its own normal on the bottom of the groove, a flank's beside it.

    Where both sides have a corner neither has a field of normals that the other could follow.
    """
    wave = lambda x: 1.2 * np.abs(x)  # noqa: E731
    groove = block(8, -1, 1, -2, 0, wave=wave).surface("top")
    tip = block(4, -0.5, 0.5, 0, 3, wave=wave).surface("bottom")
    above = turned(tip, 0.0, np.array([shift, 1.2 * shift]))[0]
    pairing = node_to_segment(above, groove)
    middle = int(np.argmin(np.abs(pairing.points[:, 0] - shift)))
    flank = np.array([-1.2, 1.0]) / np.hypot(1.2, 1.0)
    expected = [0.0, 1.0] if shift == 0.0 else flank
    assert_allclose(pairing.secondary_normal[middle], expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("left", "right"), [(10, 10), (60, 10), (10, 60), (60, 60)])
def test_a_vertex_presses_on_the_next_facets_that_it_faces(left, right):
    """A wedge of 90 degrees over a flat facet: the next ones take part that lean by less than 45.

    On either side: a facet that leans by more looks past the vertex, at its flank.
    """
    heights = [-np.tan(np.radians(left)), 0.0, 0.0, -np.tan(np.radians(right))]
    wave = lambda x: np.interp(x, [-1.0, 0.0, 1.0, 2.0], heights)  # noqa: E731
    low = block([-1.0, 0.0, 1.0, 2.0], 0, 1, -9, 0, wave=wave).surface("top")
    wedge = block([-0.5, 0.5, 1.5], 0, 1, 0, 3, wave=lambda x: np.abs(x - 0.5)).surface("bottom")
    pressed = corner_contacts(low, wedge).pressed
    middle = np.round(low.points[low.facets[pressed, :2]].mean(axis=1)[:, 0], 9)
    expected = [x for x, lean in ((-0.5, left), (0.5, 0), (1.5, right)) if lean < 45]
    assert sorted(middle) == expected


@pytest.mark.parametrize("mirrored", [False, True])
def test_sides_that_are_not_selected_are_told_where_they_overlap(mirrored):
    """A block beside a wall, of which only the lower side is selected: its end is in the wall, or not.

    Touching the wall, apart from it, or with that side selected too, nothing is overlooked.
    """
    sign = -1.0 if mirrored else 1.0

    def placed(x):
        return sorted(sign * np.asarray(x))

    def found(wall, sides):
        other = block(placed([wall, 3.0]), 0, 1, -1, 1).surface("right" if mirrored else "left")
        return unselected_sides(block(placed([0.0, 0.5, 1.0]), 0, 1, 0, 1).surface(sides), other)

    beside = "left" if mirrored else "right"
    (told,) = found(0.9, "bottom")
    assert_allclose(told[1], 0.1, rtol=1e-12)
    assert found(1.0, "bottom") == found(1.2, "bottom") == found(0.9, ["bottom", beside]) == []


@pytest.mark.parametrize(("lean", "carries"), [(0.07, 1), (0.15, 0)])
def test_a_corner_carries_on_a_wall_that_leans_over_by_strains(lean, carries):
    """Of its two sides the lower one alone is selected (SLACK): by more the wall faces the other."""
    y = np.linspace(-2.0, 2.0, 5)
    p = np.array([np.r_[1.05 - np.tan(lean) * y, np.full(5, 4.0)], np.r_[y, y]])
    mesh = fem.MeshQuad(p, np.array([np.r_[i, i + 5, i + 6, i + 1] for i in range(4)]).T)
    wall = body(mesh.with_boundaries({"left": lambda x: x[0] < 3})).surface("left")
    found = corner_contacts(block(2, 0, 1, 0, 1).surface("bottom"), wall)
    assert len(found.own[1].corner) == carries


@pytest.mark.parametrize(("bend", "beyond"), [(90, False), (20, True)])
def test_a_vertex_beyond_both_facets_meets_a_smooth_joint_alone(bend, beyond):
    """A wedge that points down past the end of a flat top, outside of both facets there.

    Where the boundary goes on smoothly the joint is the closest point of a curve, and is met; a sharp
    corner is none. Over the flat part the wedge meets it in either case.
    """
    fall = np.tan(np.radians(bend)) if bend < 90 else None
    if fall is None:
        low = block(2, 0, 1, 0, 1).surface(["top", "right"])
    else:
        wave = lambda x: -fall * np.maximum(x - 1.0, 0.0)  # noqa: E731
        low = block([0.0, 0.5, 1.0, 2.0], 0, 1, 0, 1, wave=wave).surface("top")
    wedge = block([-1.0, 0.0, 1.0], 0, 1, 0, 3, wave=np.abs).surface("bottom")
    # 10 degrees from the vertical is between the normals of both facets
    past = np.array([1.0, 1.0]) + 0.05 * np.array([np.sin(np.radians(10)), np.cos(np.radians(10))])
    for place, met in ((past, beyond), (np.array([0.8, 1.05]), True)):
        tip = turned(wedge, 0.0, place)[0]
        names = corner_contacts(tip, low).names
        middle = int(np.argmin(tip.points[:, 1]))
        assert ((0, middle) in names) == met


@pytest.mark.parametrize("deep", [0.0, 0.01])
@pytest.mark.parametrize("steep", [5.0, 100.0])
def test_a_needle_on_a_node_presses_that_node(steep, deep):
    """The point of a needle at a node: the node carries it, with its own row if that says the same.

    Flanks that are nearly upright face no node: the node has no partner of its own, and takes the row
    of the needle's point.
    """
    low = block([-1.0, -0.5, 0.0, 0.5, 1.0], 0, 1, -1, 0).surface("top")
    needle = block([-0.1, 0.0, 0.1], 0, 1, 0, 300, wave=lambda x: steep * np.abs(x)).surface("bottom")
    tip = turned(needle, 0.0, np.array([0.0, -deep]))[0]
    own = node_to_segment(low, tip)
    middle = int(np.argmin(np.abs(low.points[:, 0])))
    assert own.paired[middle] == (steep < 10)
    found = corner_contacts(low, tip).rows(own, False)
    assert found.paired[middle]
    if deep == 0.0 or steep > 10:
        assert_allclose(found.gap[middle], -deep, rtol=0, atol=1e-12)
        vertex = int(np.argmin(tip.points[:, 1]))
        assert found.vertex[middle] == vertex


@pytest.mark.parametrize(
    ("beyond", "height", "met"),
    [(0.02, 0.0, True), (0.03, 0.0, False), (0.2, 0.1, False), (0.02, 0.1, True), (0.02, -0.03, False)],
)
def test_a_surface_goes_on_by_a_tenth_of_a_facet(beyond, height, met):
    """With finite sliding, for what is flush with its end and not as deep in it; else not at all."""
    low = block(4, 0, 1, 0, 1).surface("top")
    up = block([0.2, 0.6, 1 + beyond], 0, 1, 1 + height, 2).surface("bottom")
    for extended in (False, True):
        point, *_ = closest_facets(up, low, np.inf, 0.5, extended)
        assert point.tolist() == ([0, 1, 2] if met and extended else [0, 1])


@pytest.mark.parametrize("steep", [1.0, 5.0])
def test_a_needle_on_a_sharp_node_leaves_its_row(steep):
    """The node is a corner itself, and its own row holds the point of the needle already."""
    roof = block([-1.0, -0.5, 0.0, 0.5, 1.0], 0, 1, -9, 0, wave=lambda x: -0.6 * np.abs(x)).surface(
        "top"
    )
    needle = block([-0.1, 0.0, 0.1], 0, 1, 0, 9, wave=lambda x: steep * np.abs(x)).surface("bottom")
    own, found = node_to_segment(roof, needle), corner_contacts(roof, needle)
    found = found.rows(own, False)
    assert_allclose(found.normal[2], own.normal[2], atol=1e-12)
    assert found.gap[2] == 0.0 and found.vertex[2] == int(np.argmin(needle.points[:, 1]))
