"""Arcs of long facets that are hardly pressed: contact within a facet is warned of, and only that.

An arc of radius 1 with the facets of a polygon of 36 sides is pressed on a flat block by a multiple of
the height of its chords. The reference is the arc itself, on a mesh that resolves the contact.
"""

from __future__ import annotations

import itertools
import warnings
from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace

import internals
import numpy as np
import pytest
import skfem as fem
from scenes import elastic
from unlike_meshes import KINDS

import skfem_contact as sc
from skfem_contact.answers import answer_of, bends, facet_words, sagittas

SAGITTA = internals.original("answers.SAGITTA")

SIZE = 0.6
CHORD = np.pi / 18
HEIGHT = CHORD**2 / 8
WORDS = "over the length of one facet the curves stand"


def block(name, facet, kind, shift=0.0, straight=True):
    """Basis of a block, with an arc of radius 1 as the bottom of the upper one."""
    steps = np.arange(-round(2 * SIZE / facet), round(2 * SIZE / facet) + 1)
    x = (steps + shift) * facet
    x = np.concatenate([[-SIZE], x[np.abs(x) < SIZE - 0.3 * facet], [SIZE]])
    y = np.linspace(0, SIZE, max(2, round(SIZE / facet)) + 1)
    mesh = fem.MeshQuad.init_tensor(x, y if name == "arc" else -y[::-1])
    mesh = (mesh.to_meshtri() if kind.startswith("P") else mesh).with_defaults()
    if not straight:
        mesh = fem.MeshQuad2.from_mesh(mesh).with_boundaries(mesh.boundaries)
    if name == "arc":
        p = mesh.doflocs.copy()
        p[1] += (1 - np.sqrt(1 - p[0] ** 2)) * (1 - p[1] / SIZE)
        mesh = type(mesh)(p, mesh.t).with_boundaries(mesh.boundaries)
    return fem.Basis(mesh, fem.ElementVector(KINDS[kind]()), intorder=4)


def pressed(
    heights,
    facets=(CHORD, CHORD),
    secondary="flat",
    method="mortar",
    kind="Q1",
    shift=(0.0, 0.0),
    **settings,
):
    """Force and result of the arc pressed by a multiple of the height of the coarse chords."""
    upper, lower = (
        block(*args) for args in zip(("arc", "flat"), facets, (kind, kind), shift, strict=True)
    )
    x = np.zeros(upper.N)
    x[upper.get_dofs("top").all("u^2")] = -heights * HEIGHT
    bodies = [
        sc.Body(upper, elastic(1.0, 0.3), D="top", x=x, name="arc"),
        sc.Body(lower, elastic(1.0, 0.3), D="bottom", name="flat"),
    ]
    pair = bodies[0].surface("bottom"), bodies[1].surface("top")
    contact = sc.Contact(*pair[:: 1 if secondary == "arc" else -1], method=method, **settings)
    result = sc.ContactSolver(bodies, [contact]).solve()
    return abs(result.force[1]), result


@lru_cache
def fine(heights):
    """The force where facets are 100 times too short for a warning; .1 heights: 15 times."""
    facet = 0.006 if heights < 1 else 0.012
    return pressed(heights, (facet, facet))[0]


def said(heights, *args, **settings):
    """Force over that of the fine mesh; whether it was warned of; and the result."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        force, result = pressed(heights, *args, **settings)
    texts = [str(w.message) for w in caught]  # of large strains as well
    return force / fine(heights), any(WORDS in text for text in texts), result


QUICK = [("mortar", "flat", "P1"), ("node", "arc", "Q1")]
# how nodes of one side lie to those of the other; the last two in the slow run only
PLACES = [(0.5, 0.0), (0.25, 0.5), (0.0, 0.0), (0.5, 0.5)]


@pytest.mark.parametrize(
    ("method", "secondary", "kind", "places"),
    [
        *((*case, PLACES[:2]) for case in QUICK),
        *(
            pytest.param(*case, PLACES[2:] if case in QUICK else PLACES, marks=pytest.mark.slow)
            for case in itertools.product(("mortar", "node"), ("flat", "arc"), ("Q1", "P1"))
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{len(value)} places",
)
def test_a_force_that_is_wrong_is_warned_of(method, secondary, kind, places):
    """Whatever the meshes, and how nodes lie to each other: silent forces are right within a fifth."""
    settings = {"method": method, "secondary": secondary, "kind": kind}
    for shift, other in itertools.product(places, (0.06, CHORD, 0.3)):
        for heights in (1.02, 3, 10, 30):
            ratio, warned, result = said(heights, (CHORD, other), shift=shift, **settings)
            if result.normal_force.any():
                # node by node a coarser secondary is wrong by more than its facets say (up to 17 %)
                assert warned or abs(ratio - 1) <= SAGITTA, (shift, other, heights, ratio)
            if heights == 30:  # some three facets on the half width
                assert not warned


def test_ten_times_too_large():
    """The case that nobody saw: mortar with a coarse flat side that is pressed by little."""
    ratio, warned, result = said(0.1, (CHORD, 0.3))
    # the weighted gap of a parabola between two nodes is an overlap, of 20 times the approach
    assert ratio > 20 and warned
    assert not result.validity.holds
    assert "facets" in {kind for kind, _ in result.validity.problems}
    assert result.validity.worst == pytest.approx(
        result.validity.contacts["contact 1"].drift.sagitta_share / SAGITTA
    )
    assert "of the elastic approach (up to 20 %)" in str(result.validity)
    assert "DOES NOT HOLD (facets of 'contact 1')" in str(result)
    # refined, it is right and silent
    ratio, warned, _ = said(0.1, (0.006, 0.012))
    assert ratio == pytest.approx(1.0, abs=0.05) and not warned


@pytest.mark.parametrize("pressed_by", ["displacement", "force"])
def test_what_presses_on_a_plane_is_seen_by_what_it_takes_up(pressed_by):
    """One node has all of the force, whether a displacement or that force is given: both are told."""
    basis = block("arc", CHORD, "Q1")
    top, plane = basis.get_dofs("top"), sc.RigidPlane(point=(0, 0), normal=(0, 1))
    steel, x = elastic(1.0, 0.3), np.zeros(basis.N)
    x[top.all("u^2")] = -0.5 * HEIGHT
    arc = sc.Body(basis, steel, D="top", x=x, name="arc")
    if pressed_by == "force":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            held = sc.ContactSolver([arc], [sc.Contact(arc.surface("bottom"), plane)]).solve()
        width = np.ptp(basis.doflocs[0])
        load = {"top": (0.0, -held.force[1] / width)}
        arc = sc.Body(basis, steel, D={"top": "x", "left": "x"}, f=load, name="arc")
    with pytest.warns(sc.ContactWarning, match="over the length of one facet the two sides stand"):
        result = sc.ContactSolver([arc], [sc.Contact(arc.surface("bottom"), plane)]).solve()
    assert np.count_nonzero(result.status) == 1
    drift = result.validity.contacts["contact 1"].drift
    assert drift.facets_too_long and not result.validity.holds


def test_a_given_gap_knows_the_arc():
    """Who gives the gap has it measured on no chord."""
    pressed(1.02, shift=(0.5, 0.0), gap=lambda x: 0.5 * x[0] ** 2)


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_the_height_over_a_facet(sliding):
    """The sagitta of the longer facet, also where points have slid on."""
    for facets in ((CHORD, 0.06), (0.06, CHORD)):
        _, _, result = said(3, facets, sliding=sliding)
        assert answer_of(result).diagnostics.drifts[0].sagitta == pytest.approx(HEIGHT, rel=0.02)


def test_facets_are_those_that_points_have_slid_to():
    """Dragged from short facets of the track to long ones, an arc stands higher above each of them."""
    x = np.concatenate([np.linspace(-0.9, 0.06, 25), np.linspace(0.06, 1.5, 9)[1:]])
    mesh = fem.MeshQuad.init_tensor(x, np.linspace(-0.6, 0, 11)).with_defaults()
    lower = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    upper = block("arc", 0.06, "Q1")
    bodies = [
        sc.Body(upper, elastic(1.0, 0.3), D="top", name="arc"),
        sc.Body(lower, elastic(1.0, 0.3), D="bottom", name="flat"),
    ]
    pair = bodies[0].surface("bottom"), bodies[1].surface("top")
    solver = sc.ContactSolver(bodies, [sc.Contact(*pair, sliding="finite")])
    top, heights = upper.get_dofs("top"), []
    for way in (-0.3, 0.0, 0.4, 0.6):
        x = np.zeros(upper.N)
        x[top.all("u^1")], x[top.all("u^2")] = way, -0.05
        heights.append(answer_of(solver.solve(x={"arc": x})).diagnostics.drifts[0].sagitta)
    # facets of equal steps in x are longer along the arc, by 2 % where it stands
    np.testing.assert_allclose(np.array(heights)[[0, 3]], np.array([0.06, 0.18]) ** 2 / 8, rtol=0.03)
    assert (np.diff(heights) > -1e-6).all()


def test_curves_that_fit_and_facets_that_are_curved():
    """Two arcs of one curvature stand nowhere off each other; a curved facet counts as its halves."""
    arc, flat = (block(name, CHORD, "Q1") for name in ("arc", "flat"))
    bodies = [sc.Body(basis, elastic(1.0, 0.3)) for basis in (arc, flat)]
    bottom, top = bodies[0].surface("bottom"), bodies[1].surface("top")
    inner = slice(2, -2)
    bend, edges = bends(bottom)
    np.testing.assert_allclose(bend[inner, 0, 0], 1.0, rtol=0.02)
    np.testing.assert_allclose(np.linalg.norm(edges[:, 0], axis=1), bottom.lengths, rtol=1e-15)
    assert not bends(top)[0].any()
    lowest = np.argmin(bottom.points[:, 1])
    facet = np.full(len(bottom.points), np.flatnonzero(bottom.facets[:, 0] == lowest)[0])
    # two like arcs: their curvatures add
    double = sagittas(bottom, bottom, facet)[lowest]
    assert double == pytest.approx(2 * bottom.lengths[facet[0]] ** 2 / 8, rel=0.02)
    n, m = bottom.facet_node_normals, bottom.facet_normals[:, None]
    hollow = replace(bottom, facet_node_normals=2 * np.sum(n * m, axis=2, keepdims=True) * m - n)
    assert sagittas(bottom, hollow, facet)[lowest] == pytest.approx(0.0, abs=1e-12)
    for straight, pieces in ((True, 1.0), (False, 0.5)):
        basis = block("arc", CHORD, "Q2", straight=straight)
        side = sc.Body(basis, elastic(1.0, 0.3)).surface("bottom")
        bend, edges = bends(side)
        np.testing.assert_allclose(bend[inner, 0, 0], 1.0, rtol=0.02)
        length = np.linalg.norm(edges[inner, 0], axis=1)
        np.testing.assert_allclose(length, pieces * side.lengths[inner])


@pytest.mark.parametrize("other", ["node", "mortar", "obstacle", "tool"])
def test_a_touch_without_force_is_no_light_contact(other):
    """Pressed, drawn aside and lifted to where they touch, bodies press with round-off or not at all.

    There is nothing to resolve, and no force that gaps beside an arc could be wrong by.
    """
    way, basis = 1e-3, block("flat", CHORD / 4, "Q1")
    low = sc.Body(basis, elastic(1.0, 0.3), D="bottom", name="flat")
    disc, rough = sc.RigidCylinder((0, 1), 1, name="disc"), {"friction": sc.Coulomb(0.3), "name": "c"}
    if other == "obstacle":
        solver = sc.ContactSolver([low], sc.Contact(low.surface("top"), disc, **rough))
    elif other == "tool":
        tool = sc.RigidBody(disc, D=("x", "y", "rotation"), name="arc")
        solver = sc.ContactSolver([low, tool], sc.Contact(low.surface("top"), tool, **rough))
    else:
        arc = sc.Body(block("arc", CHORD / 4, "Q1"), elastic(1.0, 0.3), D="top", name="arc")
        pair = sc.Contact(low.surface("top"), arc.surface("bottom"), method=other, **rough)
        solver = sc.ContactSolver([low, arc], pair)

    def step(x, y):
        if other == "obstacle":
            return {"motion": {"disc": (x, y)}}
        return {"x": {"arc": (x, y, 0.0) if other == "tool" else {"top": (x, y)}}}

    *_, aside, lifted = solver.history([step(0, -0.01), step(way, -0.01), step(way, 0)])
    assert aside.force[1] < -1e-3 and abs(lifted.force[1]) < 1e-10  # and no warning is given
    assert np.any(lifted.status != 0) and lifted.validity.holds
    # pressed by a tenth of what small sliding does not see of the arc
    unseen = way**2 / 2
    with pytest.warns(sc.ContactWarning, match="gaps are wrong by up to 5e-07"):
        next(solver.history([step(way, -0.1 * unseen)], start=aside))


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_contact_within_one_facet_may_have_several_answers(share):
    """A roller, hardly pressed, rests on a facet or on a vertex: the order decided which."""
    drift = SimpleNamespace(sagitta=share * 1e-3, sagitta_share=share, approach=1e-3)
    assert ("may be several answers" in facet_words(drift)) == (share > 1)
