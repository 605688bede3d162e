"""Contact that goes over a convex corner: no overlap that is neither refused nor warned of."""

from __future__ import annotations

import itertools
import warnings

import internals
import numpy as np
import pytest
from corner_scenes import CORNER, FACET, HOME, overlap, path, placed, ring, scene, wedge
from sliding_scenes import dragged_block, elastic, travel

import skfem_contact as sc
from skfem_contact.answers import answer_of

OVERLAP = internals.original("answers.OVERLAP")

#: What chords of 0.1 explain on a radius of 0.5: they are 0.0025 off the arc, and twice that where
#: the vertex of one stands between the ends of another.
EXPLAINED = 0.004

WAYS = list(
    itertools.product(
        ("straight", "round"), (False, True), ("disc", "block"), ("node", "mortar"), ("top", "both")
    )
)
QUICK = [
    ("straight", False, "disc", "node", "top"),
    ("straight", True, "block", "mortar", "both"),
    ("round", False, "disc", "mortar", "top"),
    ("round", True, "block", "node", "top"),
    ("round", False, "disc", "node", "both"),
]


def taken_over(kind, rolled, secondary, method, where, steps=12, **settings):
    """The results of taking a tool over the corner."""
    # node by node the secondary has to be the finer, or the other's vertices stand between its nodes
    other = FACET if secondary == "disc" else FACET / 2
    solver, put = scene(secondary, method, where, other=other, **settings)
    return list(solver.history([put(*place) for place in path(kind, steps, rolled=rolled)]))


@pytest.mark.parametrize("shape", ["disc", "square"])
def test_an_open_point_lies_in_no_body(shape):
    """A body that is brought from elsewhere in one step is in contact: no open point overlaps.

    The pairing of a step is first that of where the last one tends to, here far beyond, where nothing
    meets; the answer on it, seen from its own pairing, overlaps by all of the push.
    """
    solver, put = scene(secondary="block", method="mortar", shape=shape)
    places = path("straight")[:3]
    far = (np.array([-2.0, 1.5]), 0.0)
    away, *results = solver.history([put(*place) for place in (far, *places)])
    assert away.normal_force.max() == 0
    assert all(r.normal_force.max() > 0 for r in results)
    # mortar holds weighted gaps: between the points what the chords of 0.1 explain is left
    assert max(overlap(r) for r in results) < 0.0025


# what is beyond the bound is warned of: `test_no_overlap_is_passed_over`; here all steps are measured
@pytest.mark.filterwarnings("ignore:.*the deformed bodies overlap:skfem_contact.ContactWarning")
@pytest.mark.filterwarnings("ignore:.*has turned.*:skfem_contact.ContactWarning")
@pytest.mark.filterwarnings("ignore:.*nothing holds it there:skfem_contact.ContactWarning")
# where the disc leaves the corner it is pressed in by three times the height of its chords
@pytest.mark.filterwarnings("ignore:.*curves stand .* off each other:skfem_contact.ContactWarning")
@pytest.mark.parametrize(
    "way", [pytest.param(w, marks=() if w in QUICK else pytest.mark.slow) for w in WAYS], ids=str
)
def test_a_disc_goes_over_the_corner(way):
    """Rolled and dragged, over and around, both ways round: no step overlaps more than chords do.

    The disc is pushed in by 0.02. It is judged by the deformed polygons of both bodies alone.
    """
    results = taken_over(*way, steps=6 if way in QUICK else 12)
    if way[0] == "round" and way[4] == "top":
        # at the very end the disc lies on the side of the block, which the contact does not have
        results = results[:-1]
    assert max(overlap(r) for r in results) < EXPLAINED
    pressing = np.array([r.normal_force.max() > 0 for r in results])
    # straight on, the way ends 0.2 beyond the corner, of which the disc covers 0.14; by its chords less
    beyond = np.array([place[0][0] - CORNER[0] for place in path(way[0], 6 if way in QUICK else 12)])
    assert pressing[beyond < 0.1].all() if way[0] == "straight" else pressing.all()


@pytest.mark.filterwarnings("ignore:.*has turned.*:skfem_contact.ContactWarning")
@pytest.mark.filterwarnings("ignore:.*take up.*:skfem_contact.ContactWarning")
def test_a_side_that_no_contact_has_is_warned_of():
    """Rolled on until it lies on the side of the block, which "top" does not have: it says so."""
    with pytest.warns(sc.ContactWarning, match=r"inside the body of .*nothing holds it there"):
        results = taken_over("round", True, "block", "node", "top", steps=6)
    assert overlap(results[-1]) > EXPLAINED


#: Chords turned so that no vertex of the disc stands where it does above.
TURNED = [
    ("round", False, side, "mortar", where) for side in ("disc", "block") for where in ("top", "both")
]
#: Rolled on to the side, which "top" does not have, and deep in it at the end.
SIDE = ("round", True, "block", "node", "top")


def said_before(results, caught):
    """How many steps of a history had come before the overlap was warned of."""
    said = [str(w.message) for w in caught if "Contact conditions do not see it" in str(w.message)]
    assert len(said) <= 1  # once per history
    if not said:
        return len(results), ""
    return next(
        k for k, r in enumerate(results) if ("overlap", "c") in answer_of(r).diagnostics.issued
    ), said[0]


@pytest.mark.parametrize(
    ("way", "turn"),
    [
        pytest.param(w, turn, marks=() if w == SIDE and not turn else pytest.mark.slow)
        for turn, ways in ((0.0, WAYS), (0.1, TURNED))
        for w in ways
        if w[0] == "round"
    ],
    ids=str,
)
def test_no_overlap_is_passed_over(way, turn):
    """Nobody asks for `validity`: all overlaps beyond its bound are warned of, once."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", sc.ContactWarning)
        results = taken_over(*way, steps=6 if way == SIDE and not turn else 12, turn=turn)
    first, words = said_before(results, caught)
    # whole bodies only where something seems to overlap, to be strained or to have turned
    for seen in map(answer_of, results):
        turn = max(map(abs, seen.diagnostics.turns.values()))
        if (
            not seen.diagnostics.intrusions
            and seen.diagnostics.drifts[0].strain < 0.05
            and turn < 0.025
        ):
            assert "u" not in vars(seen)
    for r in results[:first]:
        # the one bound, of steps and of `validity`: a third of the elastic approach more than chords;
        # the last step on a side that "top" does not have is within it, at twice the chords
        part = r.validity.contacts["c"]
        assert overlap(r) < max(EXPLAINED, part.chords + OVERLAP * part.drift.approach)
    if way[4] == "both":  # which covers all that touches
        assert not words
    if way == SIDE:
        assert "nothing holds it there" in words
    if words:
        # where it is said it is so, and no other contact but this one is blamed
        assert overlap(results[first]) > 0.9 * EXPLAINED
        assert words.startswith("Contact 'c' (")


def test_flat_tracks_and_rounded_tools_are_silent():
    """Dragged over facets that do not match, by nodes and by means: nothing seems to overlap."""
    for method, facets in itertools.product(("node", "mortar"), (81,)):
        solver = dragged_block(rigid=False, method=method, facets=np.linspace(-0.5, 5, facets))
        results = travel(solver, np.linspace(0, 0.5, 3))
        assert not any(answer_of(r).diagnostics.intrusions for r in results)
    solver, put = scene("disc", "mortar", other=FACET / 2)
    results = list(solver.history([put(*place) for place in path("straight", 2)[1:3]]))
    assert max(r.normal_force.max() for r in results) > 0
    assert not any(answer_of(r).diagnostics.intrusions for r in results)


class Weakening(sc.conditions.FrictionLaw):
    """A coefficient that falls from 0.4 to 0.2 while a point slips by 0.1."""

    def limit(self, normal_force, area, slip):
        return (0.4 - 2 * np.minimum(np.abs(slip[:, 0]), 0.1)) * normal_force

    def slope(self, normal_force, area, slip):
        return 0.4 - 2 * np.minimum(np.abs(slip[:, 0]), 0.1)


@pytest.mark.parametrize("method", ["node", pytest.param("mortar", marks=pytest.mark.slow)])
@pytest.mark.parametrize("law", [sc.Coulomb(0.3, stiffness=0.02), Weakening()], ids=["G", "slip"])
def test_friction_goes_along_with_a_vertex(law, method):
    """A wedge dragged over three facets of a block: its friction is that of one point that slips on.

    The row of the vertex is that of one node of the block after the other. What friction remembers
    goes with it: the forces are those with the sides exchanged, where the vertex is a node of its own.
    """
    way = np.linspace(0, 0.3, 16)
    answers = []
    for secondary in ("block", "wedge"):
        solver, put = wedge(secondary, method, law)
        results = list(solver.history([put(right, 0.004) for right in way]))
        answers.append(np.array([r.force if secondary == "wedge" else -r.force for r in results]))
        hosts = {int(np.argmax(r.normal_force)) for r in results}
        assert len(hosts) >= (3 if secondary == "block" else 1)
    one, other = answers
    # pairings are iterated to 1e-4 of the largest force
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-4 * np.abs(other).max())
    ratio = np.abs(one[:, 0] / one[:, 1])
    # the block tilts below the wedge, by 0.01; Coulomb's bound is reached once, and kept to
    expected = 0.3 if isinstance(law, sc.Coulomb) else 0.4 - 2 * np.minimum(way, 0.1)
    np.testing.assert_allclose(ratio[3:], np.broadcast_to(expected, ratio.shape)[3:], atol=0.01)


@pytest.mark.filterwarnings("ignore::skfem_contact.ContactWarning")
@pytest.mark.parametrize("method", ["node", pytest.param("mortar", marks=pytest.mark.slow)])
def test_a_square_led_round_a_corner_is_refused_by_name(method):
    """Face to face round a square corner is no equilibrium: the words say where, and what to do."""
    solver, put = scene("disc", method, "both", shape="square")
    places = [put(*place) for place in path("round", 6)]
    words = (
        r"point \d+ of contact 'c', now at \(.*\), (slid|meets another partner) .*sharp corners.*"
        r"Round the corners .* behind the corner\. The last state is in `.result`"
    )
    with pytest.raises(sc.errors.NotConverged, match=words) as caught:
        list(solver.history(places))
    # at the corner, in the middle of the way round it, and what came before is not lost
    assert len(caught.value.results) > 6
    assert not caught.value.result.converged


def test_refusals_without_corners_blame_none():
    """A disc on a hill has no corner: where its pairing may not settle, the point is named alone."""
    tool = ring()
    disc = sc.Body(tool, elastic(1.0), D="inner", name="disc")
    ground = sc.RigidCylinder((HOME[0], -5.0), 5.0)
    contact = sc.Contact(disc.surface("outer"), ground, sliding="finite", name="c")
    options = sc.Options(tolerance=0.0, placement_tolerance=0.0, max_placements=2, max_cuts=0)
    solver = sc.ContactSolver(disc, contact, options=options)
    step = {"x": {"disc": placed(tool, disc.D, HOME - [0.0, 0.04])}}
    with pytest.raises(sc.errors.NotConverged, match=r"point \d+ of contact 'c', now at ") as caught:
        list(solver.history([step]))
    assert "corners" not in str(caught.value)
