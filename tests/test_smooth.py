"""Smooth boundaries through the nodes of linear facets: where they are taken, and what rows know."""

from __future__ import annotations

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity

import skfem_contact as sc
from skfem_contact.conditions.kinematics import kinematics
from skfem_contact.pairing import dual_mortar, gap_vectors, node_to_segment

straight_words = internals.original("answers.straight_words")


def body(outline, *, element=None, shrunk=0.5, name="body"):
    """A strip of quadrilaterals below (shrunk < 1) or above a curve of points (n, 2), seen from 0."""
    n = len(outline)
    p = np.concatenate([shrunk * outline, outline]).T
    i = np.arange(n - 1)
    t = np.stack([i, i + 1, i + 1 + n, i + n])
    if shrunk > 1:
        t = t[[3, 2, 1, 0]]
    mesh = fem.MeshQuad(np.ascontiguousarray(p), t)
    on = {tuple(sorted(pair)) for pair in zip(i + n, i + 1 + n, strict=True)}
    face = [k for k, ends in enumerate(mesh.facets.T) if tuple(sorted(ends)) in on]
    mesh = mesh.with_boundaries({"face": np.array(face)})
    basis = fem.Basis(mesh, fem.ElementVector(element or fem.ElementQuad1()))
    return sc.Body(basis, linear_elasticity(1.0, 1.0), name=name)


def arc(n, radius=1.0, start=0.5, stop=2.6, graded=False):
    angle = np.linspace(start, stop, n + 1)
    if graded:
        angle = start + (stop - start) * np.linspace(0, 1, n + 1) ** 1.3
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def sides(n=(12, 16), radii=(1.0, 1.0), **settings):
    inner = body(arc(n[0], radii[0], **settings), name="inner")
    outer = body(arc(n[1], radii[1], **settings), shrunk=1.5, name="outer")
    return inner.surface("face"), outer.surface("face")


@pytest.mark.parametrize("graded", [False, True])
def test_slopes_of_a_circle(graded):
    """On a circle the smooth boundary leaves the chord by half of the angle that it spans."""
    surface = body(arc(20, 3.0, graded=graded)).surface("face")
    half = np.arcsin(surface.lengths / 2 / 3.0)
    inner = np.all(surface.neighbours >= 0, axis=1)
    assert_allclose(surface.slopes[inner], np.tan(half)[inner, None] * [1, -1], rtol=0.02)
    assert not surface.slopes[~inner].any()  # at an open end the direction of the curve is not known


def test_what_is_no_curve():
    """Straight sides, kinks, chamfers of 30 degrees, coarse polygons and quadratic facets have none."""

    def slopes(points, **settings):
        return body(np.array(points, dtype=float), **settings).surface("face").slopes

    x = np.linspace(1.0, -1.0, 9)
    assert not slopes(np.stack([x, 1 + 0 * x], axis=1)).any()
    assert not slopes(np.stack([x, 1 - 0.1 * np.abs(x)], axis=1)).any()
    t = np.tan(np.pi / 6)
    assert not slopes([(2, 0.5), (1.5, 1 - t / 2), (1, 1), (0.5, 1), (-0.5, 1)]).any()
    chamfer = [(2.4, 0.6), (2.1, 1.6), (1.4, 2.3), (0.4, 2.6), (-0.6, 2.6)]  # 30 degrees at each
    assert not slopes(chamfer).any()
    assert not slopes(arc(5)).any()
    assert not slopes(arc(20), element=fem.ElementQuad2()).any()
    assert slopes(arc(20)).any()


def test_facets_of_second_order_that_stand_straight_for_a_curve():
    """An arc does; flats, chamfers, coarse polygons and facets of first order do not."""

    def words(points, element=None):
        return straight_words(body(points, element=element or fem.ElementQuad2()).surface("face"))

    x = np.linspace(1.0, -1.0, 9)
    assert "body/face" in words(arc(20)) and "move their middle nodes" in words(arc(20, graded=True))
    for points in (
        np.stack([x, 1 + 0 * x], axis=1),
        np.stack([x, 1 - 0.1 * np.abs(x)], axis=1),
        arc(5),
    ):
        assert words(points) == ""
    assert words(arc(20), fem.ElementQuad1()) == ""
    # a flat that passes into an arc is not the curve
    after = np.stack([-np.linspace(0.1, 1, 10), np.ones(10)], axis=1)
    both = body(np.concatenate([arc(20, start=0.5, stop=np.pi / 2), after]), element=fem.ElementQuad2())
    flat = np.flatnonzero(both.surface("face").facet_normals[:, 1] > 1 - 1e-12)
    assert len(flat) == 10 and straight_words(both.surface("face"), flat) == ""
    assert straight_words(both.surface("face")) != ""


@pytest.mark.parametrize("start", [0.0, 0.3, 1.1, 2.0])
def test_sixteen_sides_are_a_circle(start):
    """Facets of an eighth of pi, wherever they begin: it is not left to round-off."""
    side = np.pi / 8
    slopes = body(arc(7, start=start, stop=start + 7 * side)).surface("face").slopes[1:-1]
    assert_allclose(slopes, np.tan(side / 2) * np.array([[1, -1]] * 5), rtol=1e-9)
    wider = 1.01 * side
    assert not body(arc(7, start=start, stop=start + 7 * wider)).surface("face").slopes.any()


@pytest.mark.parametrize("swap", [False, True])
def test_gaps_of_two_arcs(swap):
    """The clearance of two arcs, exactly where chords are wrong by a third of it."""
    clearance = 3e-3
    pair = sides(radii=(1.0, 1.0 + clearance))
    secondary, primary = pair[::-1] if swap else pair
    pairing = dual_mortar(secondary, primary)
    away = np.abs(np.arctan2(pairing.points[:, 1], pairing.points[:, 0]) - 1.55) < 0.6
    assert_allclose(pairing.gap[away], clearance, rtol=1e-3)
    weights = pairing.secondary_weights, pairing.primary_weights
    by_chords = np.sum(pairing.normal * gap_vectors(secondary, primary, *weights), axis=1)
    assert np.abs(by_chords[away] / clearance - 1).max() > 0.3


def test_an_arc_on_a_plane_keeps_its_chords():
    """An arc that is pressed flat loses its height: gaps to it stay those of its chords."""
    x = np.linspace(2.0, -2.0, 31)
    flat = body(np.stack([x, 0 * x + 1], axis=1), shrunk=1.5, name="flat")
    one, other = body(arc(20)).surface("face"), flat.surface("face")
    for pair in ((one, other), (other, one)):
        bulge = dual_mortar(*pair).primary_bulge
        assert bulge is None or np.abs(bulge.data).max() < 1e-15


@pytest.mark.parametrize("swap", [False, True])
def test_rows_know_motions_and_dilatations(swap):
    """Gap rows measure what they say: nothing for a common motion, and the growth of one arc."""
    pair = sides()
    secondary, primary = pair[::-1] if swap else pair
    pairing = dual_mortar(secondary, primary)
    assert pairing.primary_bulge is not None
    moved = pairing.primary_bulge @ np.tile(np.eye(2), (len(primary.points), 1))
    assert_allclose(moved, 0.0, atol=1e-15)
    system = sc.bodies.stack([secondary.body, primary.body])
    kin = kinematics(system, sc.Contact(secondary, primary), pairing)
    x = np.concatenate([b.dof_points for b in system.bodies])
    component = np.concatenate([b.dof_component for b in system.bodies])

    def both(field):
        return np.where(component == 0, *field)

    for rows in (kin.B_n, kin.B_t):
        for move in ((1.0, 0.0), (0.0, 1.0)):
            assert_allclose(
                rows @ both(np.broadcast_to(np.array(move)[:, None], x.T.shape)), 0, atol=1e-14
            )
    # turned together, arcs that fit slide in themselves; grown, they grow alike
    inner = np.abs(np.arctan2(kin.points[:, 1], kin.points[:, 0]) - 1.55) < 0.6
    for field in ((-x[:, 1], x[:, 0]), (x[:, 0], x[:, 1])):
        assert_allclose((kin.B_n @ both(field))[inner], 0.0, atol=1e-4)
    # the gap is the rows applied to the positions, but for the turn of the normals over a row ...
    assert_allclose(kin.B_n @ both((x[:, 0], x[:, 1])), kin.gap0, atol=1e-4)
    # ... and a turn of all moves it like any vector between two points: so moments balance
    vector = sum(
        (rows @ both((x[:, 0], x[:, 1])))[:, None] * axis
        for rows, axis in ((kin.B_n, kin.normal), (kin.B_t, kin.tangent[:, 0]))
    )
    turn = np.stack([-vector[:, 1], vector[:, 0]], axis=1)
    for rows, axis in ((kin.B_n, kin.normal), (kin.B_t, kin.tangent[:, 0])):
        moved = rows @ both((-x[:, 1], x[:, 0]))
        assert_allclose(moved, np.sum(axis * turn, axis=1), atol=1e-14)


def arc_on_roller(n, first, step, inner, outer):
    """A side of radius 1 with n facets, from an angle to the axis on, and a roller there."""
    angles = first + step * np.arange(n + 1)
    mesh = fem.MeshQuad.init_tensor(np.array([inner, outer]), angles)
    r, a = mesh.p
    mesh = fem.MeshQuad(np.array([r * np.sin(a), -r * np.cos(a)]), mesh.t)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    D = basis.nodal_dofs[0, np.isclose(a, first)]
    body = sc.Body(basis, linear_elasticity(), D=D)
    facets = mesh.boundary_facets()
    on = np.isclose(np.hypot(*mesh.p[:, mesh.facets[:, facets]]), 1.0).all(axis=0)
    return body.surface(facets[on])


def test_an_arc_that_ends_askew_on_a_roller_is_not_mirrored_there():
    """By a seventh of the turn of a facet: two meshes of the arc have no gap, also at its end."""
    upper = arc_on_roller(6, 0.15 * 0.2, 0.2, 0.8, 1.0)
    lower = arc_on_roller(8, 0.15 * 0.2, 0.15, 1.0, 1.3)
    for pair in (dual_mortar, node_to_segment):
        assert np.abs(pair(upper, lower).gap).max() < 1e-12


def test_coarse_arcs_that_end_on_a_plane_of_symmetry_are_square_to_it():
    """Facets of 44 degrees."""
    surface = arc_on_roller(2, 0.0, np.radians(44), 0.5, 1.0)
    assert surface.facet_node_normals[surface.twins < 0][0] == pytest.approx([0, -1], abs=1e-14)


@pytest.mark.parametrize("method", [dual_mortar, node_to_segment])
def test_rings_that_grow_alike_stay_closed(method):
    """A uniform dilatation of both sides opens no gap: chord heights grow as the facets do."""
    inner, outer = body(arc(7), name="inner"), body(arc(10), shrunk=1.5, name="outer")
    u = [0.2 * b.dof_points[np.arange(b.n), b.dof_component] for b in (inner, outer)]
    pairing = method(inner.surface("face").moved(u[0]), outer.surface("face").moved(u[1]))
    # of the chord height, a ninetieth, the fourth order is left
    assert_allclose(pairing.gap[1:-1], 0.0, atol=1e-5)
