"""Is the model valid at the answer? Scenes far beyond it, each with a twin that is within."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters

import skfem_contact as sc
from skfem_contact.answers import Boundary, Rim, Track, answer_of, boundary, curvatures, node_lengths
from skfem_contact.conditions import pair

QUAD = fem.ElementVector(fem.ElementQuad1())
E = 1e3


def rectangle(x, y, *, nu=0.3, modulus=E, cut=None, D=None, move=None, name=None, element=QUAD):
    """A body of Q1 elements on a tensor grid, its prescribed side moved by a vector."""
    mesh = fem.MeshQuad.init_tensor(np.asarray(x, float), np.asarray(y, float))
    if cut is not None:
        middle = mesh.p[:, mesh.t].mean(axis=1)
        mesh = mesh.remove_elements(np.flatnonzero(cut(middle)))
    basis = fem.Basis(mesh.with_defaults(), element)
    x = None
    if move is not None:
        x = basis.project(lambda x: np.stack([move[0] + 0 * x[0], move[1] + 0 * x[0]]))
    return sc.Body(basis, linear_elasticity(*lame_parameters(modulus, nu)), D=D, x=x, name=name)


def dragged(way, mu=0.3, sliding="small", steps=None, method="mortar"):
    """A unit block pressed on a track of 4 and dragged along it; the last result of the history."""
    track = rectangle(np.linspace(0, 4, 33), np.linspace(-1, 0, 5), D="bottom", name="track")
    up = np.linspace(0, 1, 5)
    block = rectangle(np.linspace(0, 1, 9), up, D="top", move=(1.0, 0.0), name="block")
    contact = sc.Contact(
        block.surface("bottom"),
        track.surface("top"),
        friction=sc.Coulomb(mu) if mu else None,
        sliding=sliding,
        method=method,
        interference=0.005,
        name="joint",
    )
    solver = sc.ContactSolver([block, track], [contact])
    return list(solver.history([way] if steps is None else np.linspace(0, way, steps + 1)[1:]))[-1]


def under_disc(*motions, mu=0.0, sliding="small", disc=None):
    """A steel block (200 mm by 100 mm) under a rigid disc of radius 50 mm, pressed in by 0.1 mm."""
    block = rectangle(
        np.linspace(-0.1, 0.1, 161), np.linspace(-0.1, 0, 11), modulus=210e9, D="bottom", name="block"
    )
    disc = disc or sc.RigidCylinder((0, 0.05), 0.05, name="disc")
    friction = sc.Coulomb(mu) if mu else None
    contact = sc.Contact(block.surface("top"), disc, friction=friction, sliding=sliding, name="joint")
    solver = sc.ContactSolver([block], [contact])
    steps = [((0.0, -1e-4), 0.0, (0, 0.05)), *motions]
    return list(solver.history([{"motion": {"joint": motion}} for motion in steps]))


def moved(x, angle=0.0):
    return ((x, -1e-4), angle, (0, 0.05))


def squeezed(strain, by="displacement", mu=0.0):
    """A unit block without lateral contraction on a plane, pressed by a share of its height."""
    grid = np.linspace(0, 1, 5)
    if by == "displacement":
        block = rectangle(grid, grid, nu=0.0, D="top", move=(0.0, -strain), name="block")
    else:
        mesh = fem.MeshQuad.init_tensor(grid, grid).with_defaults()
        basis = fem.Basis(mesh, QUAD)
        load = fem.LinearForm(lambda v, w: -strain * E * v[1]).assemble(basis.boundary("top"))
        D = basis.get_dofs("left").all("u^1")
        block = sc.Body(basis, linear_elasticity(0.0, E / 2), f=load, D=D, name="block")
    floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    friction = sc.Coulomb(mu) if mu else None
    contact = sc.Contact(block.surface("bottom"), floor, friction=friction, name="joint")
    return sc.ContactSolver([block], [contact]).solve()


def poked(radius):
    """A block of facets 0.1 with a rigid disc 0.02 deep between two of its nodes."""
    block = rectangle(np.linspace(-1, 1, 21) + 0.05, np.linspace(-1, 0, 11), D="bottom", name="block")
    disc = sc.RigidCylinder((0.0, radius - 0.02), radius, name="disc")
    return sc.ContactSolver(block, sc.Contact(block.surface("top"), disc, name="joint")).solve()


@pytest.mark.parametrize(
    ("radius", "said"),
    [
        (0.03, "presses on nothing"),
        (0.1, "over the length of one facet the two sides stand 0.0125 off"),
    ],
)
def test_obstacle_between_the_nodes_of_a_facet(radius, said):
    """It presses on nothing, or by its rim at the nearest nodes only: no chord is to blame."""
    with pytest.warns(sc.ContactWarning, match=said):
        result = poked(radius)
    lost = 0.02 - (radius - np.hypot(radius - 0.02, 0.05))  # nodes 0.05 aside are that far outside
    assert result.certificate.worst < 1e-10 and lost > 0.01
    with warnings.catch_warnings(record=True) as more:
        warnings.simplefilter("always")
        validity = result.validity
    # what presses on nothing has been said
    assert len(more) == (radius == 0.1) and not validity.holds
    way = "four nodes or more under it" if radius < 0.1 else "Refine the surface, whose facets"
    assert way in validity.problems["overlap", "joint"]
    part = validity.contacts["joint"]
    # the middle of the facet stays that deep, the more what its ends take up is left out
    assert part.chords == 0 and 0.01 < part.overlap < 0.0201
    assert poked(2.0).validity.holds  # a contact of several facets


@pytest.mark.parametrize(
    ("n", "method", "part", "way"),
    [
        (2, "node", 1.0, "is the coarser: swap the two, or take method='mortar'; and see that both"),
        (8, "mortar", 0.5, "See that both surfaces cover all that may touch, and refine them"),
    ],
)
def test_what_to_do_about_an_overlap_that_no_slip_has_made(n, method, part, way):
    """Coarse nodes, or half of a side: finite sliding would change nothing."""
    low = rectangle(np.linspace(0, 1, 17), np.linspace(-1, 0, 9), modulus=1.0, D="bottom", name="low")
    grid = np.linspace(0, 1, n + 1), np.linspace(0, 1, 9)
    up = rectangle(*grid, modulus=1.0, D="top", move=(0, -0.01), name="up")
    foot = up.surface(lambda x: (x[1] == 0) & (x[0] < part))
    contact = sc.Contact(foot, low.surface("top"), method=method, name="joint")
    result = sc.ContactSolver([up, low], contact).solve()
    with pytest.warns(sc.ContactWarning, match=f"overlap by up to .* {way}"):
        assert not result.validity.holds


def fitted(n, method, interference=1e-3, **settings):
    """Two quarter rings, radii 0.5, 1 and 2, with an interference; secondary and primary facets n."""
    bodies = []
    for name, low, high, count in (("shaft", 0.5, 1.0, n[0]), ("hub", 1.0, 2.0, n[1])):
        grid = np.linspace(low, high, 9), np.linspace(0, np.pi / 2, count + 1)
        mesh = fem.MeshQuad.init_tensor(*grid).with_defaults()
        tags = {"left": "inner", "right": "outer", "bottom": "x axis", "top": "y axis"}
        marked = {tags[key]: facets for key, facets in mesh.boundaries.items()}
        r, angle = mesh.p
        mesh = fem.MeshQuad(np.array([r * np.cos(angle), r * np.sin(angle)]), mesh.t)
        basis = fem.Basis(mesh.with_boundaries(marked), QUAD)
        D = [basis.get_dofs("x axis").all("u^2"), basis.get_dofs("y axis").all("u^1")]
        form = linear_elasticity(*lame_parameters(E, 0.3))
        bodies.append(sc.Body(basis, form, D=np.concatenate(D), name=name))
    pair = bodies[0].surface("outer"), bodies[1].surface("inner")
    contact = sc.Contact(*pair, method=method, interference=interference, name="joint", **settings)
    return sc.ContactSolver(bodies, [contact]).solve()


def test_gaps_are_those_of_curves():
    """Node by node, too, a press fit of unlike meshes has no sagitta of facets for interference."""
    right = fitted((24, 24), "node")
    for other in (
        fitted((24, 16), "node"),
        fitted((24, 16), "mortar"),
        fitted((24, 16), "node", gap=0.0),
    ):
        assert other.validity.holds
        # a mean over nodes of unlike patterns; the estimate says 1 % (bodies) and more (scatter)
        assert_allclose(other.pressure.mean(), right.pressure.mean(), rtol=0.01)


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_incompressible_bodies_take_up_more_than_their_diagonal_says(sliding):
    """Steel pressed into rubber (nu = 0.499), 1e-3 deep: the approach is that, and all is well."""
    grid = np.linspace(0, 1, 9)
    punch = rectangle(grid, grid, modulus=2e5, D="top", move=(0, -1e-3), name="punch")
    x, y = np.linspace(-0.5, 1.5, 33), np.linspace(-1, 0, 17)
    second = fem.ElementVector(fem.ElementQuad2())  # the first order locks
    rubber = rectangle(x, y, modulus=1.0, nu=0.499, D="bottom", name="rubber", element=second)
    pair = punch.surface("bottom"), rubber.surface("top")
    contact = sc.Contact(*pair, sliding=sliding, name="joint")
    validity = sc.ContactSolver([punch, rubber], [contact]).solve().validity
    assert validity.holds
    assert_allclose(validity.contacts["joint"].drift.approach, 1e-3, rtol=1e-3)


# -- scenes that have to warn without being asked, each with a twin that must not --------------


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("method", ["mortar", "node"])
def test_block_dragged_off_its_track(mu, method):
    """It presses where it began, also with the half of it that is beyond the end of the track."""
    with pytest.warns(sc.ContactWarning, match=r"'joint' \(block/bottom on track/top\)") as caught:
        result = dragged(3.5, mu, method=method)
    (warning,) = caught
    assert "28 facets of the primary" in str(warning.message)
    assert "sliding='finite'" in str(warning.message)
    # nodes at 3.5 .. 4.5 with facets of 0.125: four of nine lie on or beyond 4.0625, half a facet
    # beyond the end; elastic slip is below half a facet
    assert "4 of 9 closed points lie beyond the end" in str(warning.message)
    assert result.force[1] > 0  # still presses
    (drift,) = answer_of(result).diagnostics.drifts
    assert_allclose(drift.slip, 3.5, rtol=0.01)
    assert_allclose(drift.overhang, 0.5, atol=0.01)


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_block_dragged_by_less_than_a_facet(mu):
    """What the mesh does not resolve is no cause for a warning; the exact slip is the measured one."""
    result = dragged(0.1, mu)
    assert result.validity.holds and 0 < result.validity.worst < 1
    # drag stretches the block a little: slips of its nodes differ by strains of 1e-3
    assert_allclose(result.validity.contacts["joint"].drift.slip, 0.1, atol=0.01)


def test_block_dragged_with_finite_sliding():
    """The same way, followed."""
    result = dragged(2.0, sliding="finite", steps=3)
    assert result.validity.holds
    assert (
        result.validity.contacts["joint"].overlap
        < 0.2 * answer_of(result).diagnostics.drifts[0].approach
    )


def test_points_that_come_into_contact_on_the_way_are_watched():
    """The long side is the secondary one: none of the points closed at the end had a partner before."""
    track = rectangle(np.linspace(0, 5, 41), np.linspace(-1, 0, 5), D="bottom", name="track")
    block = rectangle(1 + np.linspace(0, 1, 9), [0, 0.5, 1], D="top", move=(1.0, 0.0), name="block")
    contact = sc.Contact(
        track.surface("top"), block.surface("bottom"), interference=5e-3, sliding="finite", name="joint"
    )
    before, after = sc.ContactSolver([block, track], [contact]).history([0.0, 2.0])
    assert not np.any((before.status != 0) & (after.status != 0))
    # the same two bodies two block lengths on, and 2 from either end: as strained as before
    (here,), (there,) = answer_of(before).diagnostics.drifts, answer_of(after).diagnostics.drifts
    assert there.closed == here.closed
    assert_allclose([there.approach, there.strain], [here.approach, here.strain], rtol=1e-6)
    assert after.validity.holds


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_disc_moved_away(mu):
    """30 mm aside the disc presses a hundred times as hard as it should: along its old normals."""
    with pytest.warns(
        sc.ContactWarning, match="gaps are wrong by .* Give the contact sliding='finite'"
    ):
        before, after = under_disc(moved(0.03), mu=mu)
    assert after.force[1] < 50 * before.force[1] < 0
    assert answer_of(after).diagnostics.drifts[0].tilt > 0.3
    assert_allclose(answer_of(after).diagnostics.drifts[0].motion, 0.03, rtol=1e-3)


def test_disc_moved_a_little():
    """0.5 mm aside its gaps are off by s^2/2R: 2.5 % of the 0.1 mm that it is pressed in."""
    result = under_disc(moved(0.5e-3))[-1]
    # the distance to a circle, to second order of s/R = 0.01
    assert_allclose(
        answer_of(result).diagnostics.drifts[0].gap_share, 0.5 * 0.5e-3**2 / 0.05 / 1e-4, rtol=1e-3
    )
    assert result.validity.holds


def test_disc_moved_away_with_finite_sliding():
    """Followed, the disc presses as before."""
    before, after = under_disc(moved(0.03), sliding="finite")
    assert_allclose(after.force[1], before.force[1], rtol=0.1)  # 30 mm nearer to the side of the block
    assert after.validity.holds


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("angle", [0.03, 1.0])
def test_spinning_disc_loses_its_force(angle, mu):
    """Its points move along chords, so its gap opens by R(1 - cos): in part, or all at once."""
    with pytest.warns(sc.ContactWarning, match="gaps are wrong by .* sliding='finite'"):
        before, after = under_disc(moved(0.0, angle), mu=mu)
    assert abs(after.force[1]) < 0.8 * abs(before.force[1])
    error = min(0.05 * (1 - np.cos(angle)), 1e-4)  # no more than it was pressed in
    # friction drags the points along by its share of the force: 1e-5 of the radius
    assert_allclose(answer_of(after).diagnostics.drifts[0].gap_error, error, rtol=1e-3)


def test_a_whole_turn_is_no_rest():
    """With small sliding a whole turn ends where it began, and drags nothing along."""
    with pytest.warns(sc.ContactWarning, match="slip, .* along the chord .* is 100 % off the arc"):
        before, after = under_disc(moved(0.0, 2 * np.pi), mu=0.3)
    assert_allclose(after.force, before.force, rtol=0, atol=1e-9 * abs(before.force[1]))


def test_spinning_disc_keeps_its_force():
    """Turned a little, or with finite sliding."""
    turned = under_disc(moved(0.0, 0.01))[-1]
    assert turned.validity.holds
    # the arc that has passed: the lowest point of the disc is 0.1 mm below the surface
    assert_allclose(answer_of(turned).diagnostics.drifts[0].slip, 0.05 * 0.01, rtol=5e-3)
    before, after = under_disc(moved(0.0, 1.0), mu=0.3, sliding="finite")
    assert_allclose(after.force[1], before.force[1], rtol=0.01)  # friction lifts it a little


def test_level_set_is_watched_like_the_disc():
    """An obstacle given by a function is looked at to first order: right where it touches."""
    circle = sc.obstacles.LevelSet(lambda x: x[0] ** 2 + (x[1] - 0.05) ** 2 - 0.05**2, name="disc")
    plain = answer_of(under_disc(moved(0.5e-3))[-1]).diagnostics.drifts[0]
    drift = answer_of(under_disc(moved(0.5e-3), disc=circle)[-1]).diagnostics.drifts[0]
    # the second order of the gap over the radius
    assert_allclose(drift.gap_error, plain.gap_error, rtol=1e-2)
    with pytest.warns(sc.ContactWarning, match="gaps are wrong by"):
        under_disc(moved(2e-3), disc=circle)


@pytest.mark.parametrize("by", ["displacement", "force"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_squeeze(by, mu):
    """90 % is no linear elasticity, 5 % is; the strain of a square is what is prescribed."""
    with pytest.warns(sc.ContactWarning, match=r"strained by about 0\.9 .* errors are"):
        result = squeezed(0.9, by, mu)
    assert result.converged
    assert result.validity.strain["block"] == pytest.approx(0.9)
    assert squeezed(0.05, by, mu).validity.holds


def at_a_wall(way):
    """A block on a floor with a step, followed by the pairing of its bottom; its side is in none."""
    floor = rectangle(
        np.linspace(0, 3, 25),
        np.linspace(-0.5, 0.5, 9),
        cut=lambda x: (x[0] < 2) & (x[1] > 0),
        D="bottom",
        name="floor",
    )
    half = np.linspace(0, 0.5, 5)
    block = rectangle(np.linspace(0.5, 1.5, 9), half, D="top", move=(1.0, 0.0), name="block")
    ground = floor.surface(lambda x: (np.abs(x[1]) < 1e-9) & (x[0] < 2), name="ground")
    sides = block.surface(["bottom", "right"], name="skin")
    contact = sc.Contact(sides, ground, interference=1e-3, sliding="finite", name="joint")
    return list(sc.ContactSolver([block, floor], [contact]).history([0.1, way]))[-1]


def test_overlap_that_no_pairing_sees():
    """The block is driven into the step by 0.1: the conditions hold at all points with a partner."""
    with pytest.warns(
        sc.ContactWarning, match=r"overlap by up to 0\.1.* Contact conditions do not see"
    ):
        result = at_a_wall(0.6)
    assert result.converged and result.certificate.worst < 1e-9
    validity = result.validity  # said already
    assert not validity.holds and validity.worst > 1
    assert "4 points without partner" in validity.problems["overlap", "joint"]
    assert_allclose(validity.contacts["joint"].overlap, 0.1, rtol=0.05)  # elastic strain of 1e-3
    assert "DOES NOT HOLD" in result.report()


def test_no_overlap_before_the_wall():
    result = at_a_wall(0.4)
    assert result.validity.holds
    assert result.validity.contacts["joint"].unseen == 0


def ring(inner, outer, name, **settings):
    """A ring of 96 by 2 elements, held at the boundary away from the contact."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 2 * np.pi, 97), np.linspace(inner, outer, 3))
    a, r = mesh.p
    p, at = np.unique(np.round([r * np.cos(a), r * np.sin(a)], 9), axis=1, return_inverse=True)
    mesh = fem.MeshQuad(p, at.reshape(-1)[mesh.t])
    middle = 0.5 * (inner + outer)
    tags = {
        "inner": mesh.facets_satisfying(lambda x: np.hypot(*x) < middle - 0.2 * (outer - inner), True),
        "outer": mesh.facets_satisfying(lambda x: np.hypot(*x) > middle + 0.2 * (outer - inner), True),
    }
    basis = fem.Basis(mesh.with_boundaries(tags), QUAD)
    return sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), name=name, **settings)


@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_shaft_turned_in_its_hub(mu):
    """Turned by 0.2 its normals are off by that, and its gaps by half the square times the radius."""
    hub = ring(1.0, 1.5, "hub", D="outer")
    shaft = ring(0.5, 1.0, "shaft", D="inner")
    contact = sc.Contact(
        shaft.surface("outer"),
        hub.surface("inner"),
        friction=sc.Coulomb(mu) if mu else None,
        interference=2e-3,
        name="fit",
    )
    solver = sc.ContactSolver([shaft, hub], [contact])
    for turn in (0.2, 0.01):
        x = shaft.basis.project(lambda x, a=turn: np.stack([-a * x[1], a * x[0]]))
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = solver.solve(x={"shaft": x})
        # friction holds back by a bound over a shear stiffness: 1e-3 of the radius; chords: 5e-4
        (drift,) = answer_of(result).diagnostics.drifts
        assert_allclose(drift.tilt, turn, atol=2e-3)
        assert_allclose(drift.gap_error, turn**2 / 2, rtol=0.3 if mu else 0.01)
        said = " ".join(str(w.message) for w in caught)
        assert ("normals are off by up to" in said) == (turn > 0.1)
        # friction strains what turns, by a thousandth
        words = re.search(r"'shaft' has turned by ([\d.]+) rad", said)
        assert bool(words) == (turn > 0.1)
        assert not words or float(words[1]) == pytest.approx(0.2, abs=2e-3)
        assert ("gaps are wrong" in said) == (turn > 0.1)


def test_turned_plane():
    """A plane turned by 0.2 about a point of it has other normals; by 0.02 it is followed well."""
    grid = np.linspace(0, 1, 5)
    for turn in (0.2, 0.02):
        block = rectangle(grid, grid, D="top", move=(0, -0.05), name="block")
        floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        solver = sc.ContactSolver([block], [sc.Contact(block.surface("bottom"), floor, name="joint")])
        steps = [{"motion": {"floor": ((0.0, 0.0), turn * s, (0.5, 0.0))}} for s in (0.5, 1.0)]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            *_, last = solver.history(steps)
        assert_allclose(answer_of(last).diagnostics.drifts[0].tilt, turn, rtol=1e-12)
        said = " ".join(str(w.message) for w in caught)
        assert (f"normals are off by up to {turn:.3g} rad" in said) == (turn > 0.1)


def test_interference_of_a_step_is_no_error():
    """Gaps of a disc are measured with the interference in force, whatever the contact's own."""
    block = rectangle(
        np.linspace(-0.1, 0.1, 161), np.linspace(-0.1, 0, 11), modulus=210e9, D="bottom", name="block"
    )
    disc = sc.RigidCylinder((0, 0.05), 0.05, name="disc")
    contact = sc.Contact(block.surface("top"), disc, interference=5e-5, name="joint")
    solver = sc.ContactSolver([block], [contact])
    for result in solver.history(
        [{"interference": {"joint": 1e-4}}, {"interference": {"joint": 4e-5}}]
    ):
        # elastic displacements along the surface squared over the radius
        assert answer_of(result).diagnostics.drifts[0].gap_error < 1e-8
        assert result.validity.holds


# -- once in a history ------------------------------------------------------------------------


def test_said_once_in_a_history():
    """Twenty steps beyond the bound make one warning; who goes on hears nothing new."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        last = dragged(3.0, steps=20)
    assert len(caught) == 1
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        last.validity, str(last)
    assert not caught


def test_a_new_history_says_it_again():
    """A history that begins anew knows nothing of the one before."""
    for _ in range(2):
        with pytest.warns(sc.ContactWarning, match="small sliding"):
            dragged(3.0)


def turned(angle):
    """A block on a plane, the support of which turns it."""
    block = rectangle(np.linspace(0, 1, 5), np.linspace(0, 1, 5), D="top", name="block")
    x = block.basis.project(lambda x: np.stack([-angle * (x[1] - 1), angle * (x[0] - 0.5) - 0.001]))
    contact = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), name="joint")
    return sc.ContactSolver([block], [contact]).solve(x={"block": x})


def test_prescribed_turn_is_a_rotation():
    """Supports that turn a body by 0.3 say so, also with small sliding."""
    for angle in (0.3, 0.05):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = turned(angle)
        said = [str(w.message) for w in caught if "has turned by" in str(w.message)]
        assert len(said) == (angle > 0.1)
        assert_allclose(answer_of(result).diagnostics.turns["block"], angle, rtol=1e-9)


# -- the line of print(result) ------------------------------------------------------------------


def judged(result):
    """What `print` says of the validity of the model, in one line."""
    (line,) = [line for line in str(result).splitlines() if line.startswith("Validity of the model")]
    return line.removeprefix("Validity of the model: ")


WITHIN = "holds"


@pytest.mark.parametrize(
    "key, beyond, within",
    [
        ("sliding of 'joint'", lambda: dragged(3.5), lambda: dragged(0.02)),
        ("overlap of 'joint'", lambda: at_a_wall(0.6), lambda: at_a_wall(0.4)),
        ("strain of 'block'", lambda: squeezed(0.9), lambda: squeezed(0.05)),
        ("rotation of 'block'", lambda: turned(0.3), lambda: turned(0.05)),
        # `facets` needs two curves that hardly touch, see verification/test_light_contact.py
    ],
)
def test_printed_result_says_what_was_warned_of(key, beyond, within):
    """Each bound that a step looks at, by its kind and whose it is; and that all are kept."""
    with pytest.warns(sc.ContactWarning):
        result = beyond()
    words, found = judged(result).rstrip(")").split(" (")
    assert words == "DOES NOT HOLD"
    assert key in found.split(", ")
    assert judged(within()) == WITHIN


def test_what_was_said_stays_in_the_line_of_its_history():
    """Also where the block is back, and the bound kept again; a new history knows nothing of it."""
    block = rectangle(np.linspace(0, 1, 5), np.linspace(0, 1, 5), nu=0.0, D="top", name="block")
    press = block.basis.project(lambda x: np.stack([0 * x[0], -0.05 + 0 * x[0]]))
    contact = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), name="joint")
    solver = sc.ContactSolver([block], [contact])
    with pytest.warns(sc.ContactWarning, match="is strained by"):
        steps = list(solver.history([{"x": {"block": a * press}} for a in (1, 10, 1)]))
    lines = [judged(result) for result in steps]
    before = f"{WITHIN}; warned of before in this history: strain of 'block'"
    assert lines == [WITHIN, "DOES NOT HOLD (strain of 'block')", before]
    assert steps[2].validity.before == (("strain", "block"),)
    assert judged(solver.solve(x={"block": press}, start=steps[-1])) == lines[-1]
    assert judged(solver.solve(x={"block": press})) == WITHIN


def test_what_is_no_bound_is_not_in_the_line():
    """Places that nothing decides say nothing of the model; overlaps that supports prescribe do."""
    low = rectangle(np.linspace(-1, 2, 7), np.linspace(-1, 0, 3), D=["bottom", "top"], name="low")
    top = rectangle(
        np.linspace(0, 1, 5), np.linspace(0, 1, 5), D="bottom", move=(0.0, -1e-3), name="top"
    )
    contact = sc.Contact(top.surface("bottom"), low.surface("top"), name="joint")
    with pytest.warns(sc.ContactWarning, match="prescribed displacements push") as caught:
        result = sc.ContactSolver([low, top], [contact]).solve()
        assert judged(result) == "DOES NOT HOLD (overlap of 'joint')"
    assert len(caught) == 1 and "take their points out" in result.report()

    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 1, 5)).with_defaults()
    loose = sc.Body(fem.Basis(mesh, QUAD), linear_elasticity(0.0, E / 2), {"top": (0.0, -1.0)})
    solver = sc.ContactSolver(loose, sc.Contact(loose.surface("bottom"), sc.RigidPlane((0, 0), (0, 1))))
    with pytest.warns(sc.ContactWarning, match="is indifferent"):
        result = solver.solve()
    assert result.indifferent and judged(result) == WITHIN


# -- one verdict ------------------------------------------------------------------------------


def squeezed_disc(nu, share):
    """A unit disc between two plates, whose distance is less by a share of its diameter."""
    mesh = fem.MeshTri.init_circle(4)
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTriP2()))
    middle = basis.get_dofs(lambda x: np.abs(x[0]) < 1e-9).all("u^1")
    disc = sc.Body(basis, linear_elasticity(*lame_parameters(1.0, nu)), D=middle, name="disc")
    contacts = [
        sc.Contact(
            disc.surface(lambda x, s=sign: s * x[1] > 0, name=name),
            sc.RigidPlane((0, sign), (0, -sign), name=f"{name} plate"),
            name=name,
        )
        for sign, name in ((-1, "low"), (1, "high"))
    ]
    solver = sc.ContactSolver(disc, contacts)
    return next(iter(solver.history([{"motion": {"high": (0.0, -2 * share)}}])))


def bent(sag):
    """A beam of 10 to 1 on two ends, a stamp in the middle."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 41), np.linspace(0, 0.1, 5))
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad2()))
    middle = basis.get_dofs(lambda x: np.isclose(x[0], 0.5)).all("u^1")
    beam = sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), D=middle, name="beam")
    ends = beam.surface(lambda x: np.isclose(x[1], 0) & (np.abs(x[0] - 0.5) > 0.46), name="ends")
    top = beam.surface(lambda x: np.isclose(x[1], 0.1) & (np.abs(x[0] - 0.5) < 0.03), name="top")
    supports = sc.Contact(ends, sc.RigidPlane((0, 0), (0, 1)), name="supports")
    stamp = sc.Contact(top, sc.RigidPlane((0, 0.1), (0, -1)), name="stamp")
    solver = sc.ContactSolver(beam, [supports, stamp])
    return next(iter(solver.history([{"motion": {"stamp": (0.0, -sag)}}])))


def pushed_down(sag):
    """A cantilever of 10 to 1, and a stamp at its end."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 41), np.linspace(0, 0.1, 5)).with_defaults()
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad2()))
    beam = sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), D="left", name="beam")
    end = beam.surface(lambda x: np.isclose(x[1], 0.1) & (x[0] > 0.97), name="end")
    stamp = sc.Contact(end, sc.RigidPlane((0, 0.1), (0, -1)), name="stamp")
    return next(iter(sc.ContactSolver(beam, stamp).history([{"motion": {"stamp": (0.0, -sag)}}])))


#: What each scene is to say.
VERDICTS = {
    "disc, 2 %": (lambda: squeezed_disc(0.3, 0.02), []),
    "disc, 20 %": (lambda: squeezed_disc(0.3, 0.2), ["strain"]),
    "disc of nu .45, 20 %": (lambda: squeezed_disc(0.45, 0.2), ["strain"]),
    "disc of nu .49, 2 %": (lambda: squeezed_disc(0.49, 0.02), []),
    "disc of nu .49, 20 %": (lambda: squeezed_disc(0.49, 0.2), ["strain"]),
    "disc of nu .49, 40 %": (lambda: squeezed_disc(0.49, 0.4), ["strain"]),
    "beam, 3 %": (lambda: bent(0.03), []),
    "beam, 5 %": (lambda: bent(0.05), ["rotation"]),
    "cantilever, 7 %": (lambda: pushed_down(0.07), []),
    "cantilever, 9.5 %": (lambda: pushed_down(0.095), ["rotation"]),
    "block, 90 %": (lambda: squeezed(0.9), ["strain"]),
    "turned block": (lambda: turned(0.3), ["rotation", "strain"]),
    "off its track": (lambda: dragged(3.5), ["sliding"]),
    "into a wall": (lambda: at_a_wall(0.6), ["overlap"]),
    "by a wall": (lambda: at_a_wall(0.4), []),
}


@pytest.mark.parametrize("name", VERDICTS)
def test_steps_and_validity_say_the_same(name):
    """What a step has warned of is what is beyond its bound, printed or asked for; nothing is added."""
    make, kinds = VERDICTS[name]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", sc.ContactWarning)
        result = make()
    said = [str(w.message) for w in caught if w.category is sc.ContactWarning]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        validity, text, report = result.validity, str(result), result.report()
    assert sorted(kind for kind, _ in validity.problems) == kinds
    assert len(said) == len(kinds)
    assert all(words in " ".join(said) for words in validity.problems.values())
    for words in (text, report):
        assert ("Validity of the model: holds" in words) == (not kinds) == validity.holds
    assert (validity.worst > 1) == bool(kinds)


# -- the numbers grow when an answer is spoiled ------------------------------------------------


def spoiled(result, name, shift):
    """The answer with one body displaced."""
    u = result.u.copy()
    body = result.system.bodies[result.system.names.index(name)]
    part = u[result.system.slice(name)]
    part += np.asarray(shift)[body.dof_component]
    wrong = replace(answer_of(result), recover=lambda: u)
    wrong.diagnostics = replace(wrong.diagnostics, meetings={})  # what the step has measured
    return sc.answers.ContactResult(wrong)


@pytest.fixture(scope="module")
def fine():
    """The block where it began, whose validity holds."""
    return dragged(0.02)


@pytest.mark.parametrize(
    "shift, number",
    [((0.0, -1e-3), "overlap"), ((0.0, 1e-3), "opening"), ((0.05, 0.0), "slip")],
)
def test_shifted_body(fine, shift, number):
    """Into the other body, off it, along it: the number that tells grows by the shift."""

    def read(result):
        part = result.validity.contacts["joint"]
        return part.drift.slip if number == "slip" else getattr(part, number)

    # the interference of 5e-3 is no gap: of the meshes the bodies are apart by it
    grown = read(spoiled(fine, "block", shift)) - read(fine)
    assert_allclose(grown, np.abs(shift).max(), rtol=0.25)  # deepest elsewhere, by elastic waviness


def test_strained_and_turned_body(fine):
    """A strain of 0.2 and a turn by 0.2 added to the answer are seen, and nothing else."""
    body = fine.system.bodies[0]
    for gradient, kind in (([[0, 0], [0, 0.2]], "strain"), ([[0, -0.2], [0.2, 0]], "rotation")):
        added = body.basis.project(lambda x, H=gradient: np.einsum("ij,j...->i...", H, x))
        u = fine.u.copy()
        u[fine.system.slice("block")] += added
        spoilt = sc.answers.ContactResult(replace(answer_of(fine), recover=lambda u=u: u))
        with pytest.warns(sc.ContactWarning):
            validity = spoilt.validity
        assert_allclose(getattr(validity, kind)["block"], 0.2, rtol=0.05)  # its own strain is 5e-3
        assert (kind, "block") in validity.problems


# -- the parts --------------------------------------------------------------------------------


def test_hole_is_outside():
    """A ring: inside the material, in the hole, outside; depths against radii."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 2 * np.pi, 65), np.linspace(1, 2, 5))
    angle, r = mesh.p
    ring = fem.MeshQuad(np.array([r * np.cos(angle), r * np.sin(angle)]), mesh.t)
    joined, at = np.unique(np.round(ring.p, 9), axis=1, return_inverse=True)
    ring = fem.MeshQuad(joined, at.reshape(-1)[ring.t])
    body = sc.Body(fem.Basis(ring, QUAD), linear_elasticity())
    line = boundary(body, np.zeros(body.n))
    points = np.array([[1.5, 0.0], [0.5, 0.1], [2.5, 0.0], [0.0, -1.2]])
    assert line.inside(points).tolist() == [True, False, False, True]
    # chords of 64 sides miss the circle by R (1 - cos(pi / 64)) = 2.4e-3 at the most
    assert_allclose(line.signed(points), [-0.5, 1 - np.hypot(0.5, 0.1), 0.5, -0.2], atol=2.5e-3)


def test_curved_facets_are_followed():
    """Quadratic facets of a disc: eight pieces miss 1/64 of the sagitta of one chord."""
    mesh = fem.MeshTri2.init_circle(2)
    body = sc.Body(fem.Basis(mesh, fem.ElementVector(fem.ElementTriP2())), linear_elasticity())
    line = boundary(body, np.zeros(body.n))
    start, end = np.moveaxis(line.corners, 1, 0)
    r = np.linalg.norm(start, axis=1)
    middle = np.linalg.norm(0.5 * (start + end), axis=1)
    chord = np.linalg.norm(end - start, axis=1)
    # a parabola through three points of the circle, and its chords
    assert_allclose(r, 1.0, atol=1e-4)
    assert_allclose(middle, 1 - chord**2 / 8, atol=1e-4)
    assert np.max(1 - middle) < (1 - np.cos(np.pi / len(mesh.boundary_facets()))) / 50  # PIECES


def test_many_points_go_in_blocks(monkeypatch):
    """What does not fit into one block is done in several, with the same result."""
    corners = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 100)[:-1]])
    circle = Boundary(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), corners)
    points = np.random.default_rng(1).uniform(-1.2, 1.2, (500, 2))
    whole = circle.signed(points)
    internals.replace(monkeypatch, "arrays.AT_ONCE", 100_000)
    np.testing.assert_array_equal(circle.signed(points), whole)
    assert_allclose(whole, np.linalg.norm(points, axis=1) - 1, atol=1e-3)  # chords: 5e-4


def test_ways_to_the_ends_of_surfaces():
    """Along two pieces that have ends, and round a circle that has none."""
    grid = np.linspace(0, 2, 5)
    body = rectangle(grid, grid, name="block")
    both = body.surface(["bottom", "top"], name="both")
    middles = both.points[both.facets].mean(axis=1)
    ends = Rim.of(both)
    assert_allclose(-ends.beyond(middles), np.minimum(middles[:, 0], 2.0 - middles[:, 0]))
    assert_allclose(ends.at_least(middles), -ends.beyond(middles))
    assert_allclose(ends.beyond(middles + [2.0, 0.0]), middles[:, 0])
    assert_allclose(ends.beyond(middles - [2.0, 0.0]), 2.0 - middles[:, 0])
    floor = sc.RigidPlane((0, 0), (0, 1))
    bottom = body.surface("bottom")
    assert_allclose(node_lengths(bottom, pair(sc.Contact(bottom, floor))).sum(), 2.0)
    disc = fem.MeshTri.init_circle(3)
    rim = sc.Body(fem.Basis(disc, fem.ElementVector(fem.ElementTriP1())), linear_elasticity())
    rim = rim.surface(lambda x: x[0] ** 2 + x[1] ** 2 > 0.9, name="rim")
    assert np.isinf(Rim.of(rim).at_least(rim.points)).all()
    assert np.isneginf(Rim.of(rim).beyond(rim.points)).all()
    assert_allclose(curvatures(rim)[:, 0, 0], 1.0, rtol=0.01)  # facets of 0.1


def test_ends_are_looked_at_where_a_point_may_have_passed_them():
    """Points that keep all of their share above the surface lose nothing: both ways say so."""
    grid = np.linspace(0, 1, 9)
    low, up = rectangle(grid, grid - 1.0, D="bottom"), rectangle(grid, grid, D="top")
    contact = sc.Contact(up.surface("bottom"), low.surface("top"), friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver([low, up], contact)
    short, long = (Track(contact, solver.geometry.pairings[0], solver.kin.gap0) for _ in range(2))
    long.room = np.full(9, -np.inf)
    order = np.argsort(short.points[:, 0])
    for first in range(5):
        closed = np.zeros(9, dtype=bool)
        closed[order[first : 9 - first]] = True
        for slip in (0.0, 0.02, 0.06, 0.07, 0.13, -0.19, 0.4, -0.5):
            given = closed, slip * short.tangent[:, 0], np.ones(9), 1e-3
            found = short.drift(*given)
            assert found == long.drift(*given)
            # a point counts with the 1/8 of the surface around it, of which the slip takes its part
            lost = [np.clip(abs(slip) - (k - 0.5) / 8, 0, 1 / 8) * 8 for k in range(first, 9 - first)]
            lost[0] = min(8 * abs(slip), 0.5) / 0.5 if first == 0 else lost[0]
            assert_allclose(found["beyond_share"], sum(lost) / len(lost), atol=1e-12)


def test_angle_between_the_sides(fine):
    """Flat on flat it is zero; of an elastic disc on a block the arc sine of where contact ends."""
    assert fine.validity.contacts["joint"].angle == pytest.approx(0.0, abs=1e-12)
    angle, r = np.linspace(-0.3, 0.3, 25) - np.pi / 2, np.linspace(0.6, 1.0, 5)
    mesh = fem.MeshQuad.init_tensor(angle, r)
    a, r = mesh.p
    rim, inner = (mesh.facets_satisfying(lambda x, at=at: np.isclose(x[1], at)) for at in (1.0, 0.6))
    mesh = fem.MeshQuad(np.array([r * np.cos(a), 1 + r * np.sin(a)]), mesh.t)
    mesh = mesh.with_boundaries({"rim": rim, "inner": inner})
    move = np.array([0.0, -2e-3])
    basis = fem.Basis(mesh, QUAD)
    x = basis.project(lambda x: np.stack([move[0] + 0 * x[0], move[1] + 0 * x[0]]))
    arc = sc.Body(basis, linear_elasticity(*lame_parameters(E, 0.3)), D="inner", x=x, name="arc")
    grid = np.linspace(-0.3, 0.3, 25)
    block = rectangle(grid, np.linspace(-0.4, 0, 9), D="bottom", name="block")
    contact = sc.Contact(
        arc.surface("rim"), block.surface("top"), friction=sc.Coulomb(0.3), method="node", name="joint"
    )
    result = sc.ContactSolver([arc, block], [contact]).solve()
    edge = np.abs(result.points[result.status != 0, 0]).max()
    part = result.validity.contacts["joint"]
    assert edge > 0
    assert_allclose(part.angle, np.arcsin(edge), rtol=1e-3)
    assert_allclose(part.angle_over_mu, part.angle / 0.3)


def test_scalar_fields_have_no_validity():
    """Heat moves nothing: nothing is looked at, and nothing is said."""
    mesh = fem.MeshQuad().refined(2).with_defaults()
    conduct = fem.BilinearForm(lambda u, v, w: u.grad[0] * v.grad[0] + u.grad[1] * v.grad[1])
    low = sc.Body(fem.Basis(mesh, fem.ElementQuad1()), conduct, D="bottom", name="low")
    top = fem.Basis(mesh.translated((0, 1)).with_defaults(), fem.ElementQuad1())
    x = np.zeros(top.N)
    x[top.get_dofs("top").all()] = 1.0
    top = sc.Body(top, conduct, D="top", x=x, name="top")
    glue = sc.Contact(top.surface("bottom"), low.surface("top"), tied=True)
    validity = sc.ContactSolver([low, top], [glue]).solve().validity
    assert validity.holds and validity.worst == 0.0 and not validity.contacts


@pytest.mark.parametrize("held", [True, False])
def test_force_beyond_an_end_within_a_facet(held):
    """Half a facet over the end of an equally wide block: a tenth of the force presses on nothing.

    By its supports, or dragged by a floor under a body that nothing holds.
    """
    grid = np.linspace(0, 1, 9)
    above = rectangle(grid, 1 + grid, nu=0.0, D="top", move=(0.0, -1e-3), name="above")
    block = rectangle(grid, grid, nu=0.0, name="block", **({"D": "bottom"} if held else {}))
    joint = sc.Contact(block.surface("top"), above.surface("bottom"), name="joint")
    bodies, contacts = [block, above], [joint]
    if not held:
        floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
        grip = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.5), name="grip")
        contacts.append(grip)
    solver = sc.ContactSolver(bodies, contacts)

    def step(way):
        if not held:
            return {"motion": {"grip": (way, 0.0)}}
        move = block.basis.zeros()
        move[block.basis.get_dofs("bottom").all("u^1")] = way
        return {"x": {"block": move}}

    # of the end node the surface has half a facet: 1/16 of the width, lost when it has slid as far
    for way, lost in ((0.03, 0.03), (0.0625, 0.0625), (0.16, 0.16)):
        history = solver.history([step(0.0), step(way)])
        first = next(history)
        assert answer_of(first).diagnostics.drifts[0].beyond_share < 1e-6
        if lost < 0.1:
            share = answer_of(next(history)).diagnostics.drifts[0].beyond_share
        else:
            with pytest.warns(sc.ContactWarning, match="% of the normal force acts beyond the end"):
                share = answer_of(next(history)).diagnostics.drifts[0].beyond_share
        assert abs(share - lost) < 0.005


@pytest.mark.parametrize("linear", ["auto", sc.linalg.Direct()])
@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_a_body_on_springs_slides_off_in_every_direction(linear, angle):
    """Smooth contact along an axis knows no displacements across it; they are looked at anyway."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    bodies = []
    for name, y, n in (("low", -1.0, 6), ("up", 0.0, 5)):
        mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, n), np.linspace(y, y + 1, n)).with_defaults()
        mesh = type(mesh)(turn @ mesh.p, mesh.t, mesh._boundaries)
        basis = fem.Basis(mesh, QUAD)
        K = linear_elasticity(*lame_parameters(E, 0.3)).assemble(basis)
        if name == "low":
            bodies.append(sc.Body(basis, K, D="bottom", name=name))
            continue
        springs = fem.BilinearForm(lambda u, v, w: u[0] * v[0] + u[1] * v[1]).assemble(basis)
        load = turn @ np.array([0.8, -1.0])
        push = fem.LinearForm(lambda v, w, load=load: load[0] * v[0] + load[1] * v[1]).assemble(basis)
        bodies.append(sc.Body(basis, K + 2.0 * springs, push, name=name))
    contact = sc.Contact(bodies[1].surface("bottom"), bodies[0].surface("top"))
    with pytest.warns(sc.ContactWarning, match="beyond the end"):
        sc.ContactSolver(bodies, [contact], linear=linear).solve()


@pytest.mark.parametrize("soft_is_secondary", [True, False])
def test_what_supports_take_up_is_no_strain(soft_is_secondary, recwarn):
    """A stiff body on a soft one whose support reaches into the contact: the corner carries it all."""
    bodies = []
    for name, y, E_, held in (("soft", -1.0, 1e-4, "left"), ("stiff", 0.0, 1.0, "top")):
        mesh = fem.MeshQuad.init_tensor(np.linspace(0, 1, 5), np.linspace(y, y + 1, 5)).with_defaults()
        basis = fem.Basis(mesh, QUAD)
        K = linear_elasticity(*lame_parameters(E_, 0.0)).assemble(basis)
        bodies.append(sc.Body(basis, K, D=held, name=name))
    sides = [bodies[0].surface("top"), bodies[1].surface("bottom")]
    contact = sc.Contact(*(sides if soft_is_secondary else sides[::-1]), method="node")
    down = np.where(bodies[1].dof_component == 1, -1e-4, 0.0)
    result = sc.ContactSolver(bodies, [contact]).solve(x={"stiff": down})
    drift = answer_of(result).diagnostics.drifts[0]
    assert result.normal_force.max() > 1e-5  # of which the soft body would give by a tenth of itself
    assert 0.5e-4 < drift.approach < 2e-4
    assert not recwarn
