"""Rigid obstacles: distances, normals, motions, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as fem

from skfem_contact import Body, RigidCylinder, RigidPlane, RigidSphere
from skfem_contact.errors import InputError
from skfem_contact.obstacles import LevelSet
from skfem_contact.pairing import diagnose


def surface(mesh, where=None, name="disc"):
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementTriP1()))
    return Body(basis, sp.eye(basis.N), name=name).surface(where)


DISC = surface(fem.MeshTri.init_circle(4))
PLANE = RigidPlane((0, 0), (0, 1))


FLOOR = surface(
    fem.MeshQuad.init_tensor(np.linspace(-2, 2, 21), np.array([1.0, 2.0])).to_meshtri(),
    lambda x: x[1] < 1 + 1e-9,
)


def same(one, two, tolerance=1e-9):
    """Same partners, gaps and normals (gradients by differences have nine digits or more)."""
    both = one.paired & two.paired
    assert np.array_equal(one.paired, two.paired) and both.any()
    np.testing.assert_allclose(one.gap[both], two.gap[both], rtol=0, atol=tolerance)
    np.testing.assert_allclose(one.normal[both], two.normal[both], rtol=0, atol=tolerance)


def test_planes_take_every_node():
    """The gap to an inclined plane is the distance along its normal, for all nodes of a disc."""
    plane = RigidPlane(point=(0, -2), normal=(3, 4))
    pairing = plane.pair(DISC)
    assert pairing.paired.all() and np.all(pairing.facet == -1) and np.all(pairing.miss == 0)
    np.testing.assert_allclose(pairing.gap, DISC.points @ [0.6, 0.8] + 1.6)
    np.testing.assert_allclose(pairing.normal, [[0.6, 0.8]] * len(DISC.points))
    np.testing.assert_allclose(pairing.tangent[:, 0], [[-0.8, 0.6]] * len(DISC.points))
    assert pairing.primary_weights.shape == (len(DISC.points), 0)
    assert np.array_equal(pairing.area, DISC.area)


@pytest.mark.parametrize("kind", [RigidCylinder, RigidSphere])
def test_discs_hold_the_side_that_faces_them(kind):
    """Gaps to a disc below are differences of radii, and only nodes that look at it are paired."""
    pairing = kind(centre=(0, -3), radius=1.5).pair(DISC)
    arm = DISC.points - [0, -3]
    distance = np.linalg.norm(arm, axis=1)
    sees = np.sum(arm * DISC.normals, axis=1) / distance < -0.1
    assert np.array_equal(pairing.paired, sees) and not sees.all()
    np.testing.assert_allclose(pairing.gap[sees], distance[sees] - 1.5)
    np.testing.assert_allclose(pairing.normal[sees], (arm / distance[:, None])[sees])
    assert np.all(np.isinf(pairing.gap[~sees])) and np.all(np.isinf(pairing.miss[~sees]))


@pytest.mark.parametrize("kind", [RigidCylinder, RigidSphere])
def test_a_hollow_cylinder_holds_a_shaft(kind):
    """A shaft of radius 1, 0.1 off the centre of a hole of radius 1.2, has the least gap 0.1."""
    pairing = kind(centre=(0.1, 0), radius=1.2, hollow=True).pair(DISC)
    assert pairing.paired.all()
    assert pairing.gap.min() == pytest.approx(0.1) and pairing.gap.max() == pytest.approx(0.3)
    left = np.argmin(pairing.points[:, 0])
    np.testing.assert_allclose(pairing.normal[left], [1, 0], rtol=0, atol=1e-12)


@pytest.mark.pairwise
@pytest.mark.parametrize("scale", [1.0, 1e-6])
@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("power", [1, 3])
def test_level_sets_know_discs(scale, given, power):
    """Level sets of discs, also badly scaled ones, pair like the discs themselves."""
    disc = surface(fem.MeshTri.init_circle(4).scaled(scale))
    centre = np.array([0.0, -3.0]) * scale

    def function(x):
        r = (x[0] - centre[0]) ** 2 + (x[1] - centre[1]) ** 2
        return 1e5 * (r**power - (1.5 * scale) ** (2 * power)) / scale ** (2 * power)

    def gradient(x):
        arm = np.stack([x[0] - centre[0], x[1] - centre[1]])
        r = arm[0] ** 2 + arm[1] ** 2
        return 1e5 * 2 * power * r ** (power - 1) * arm / scale ** (2 * power)

    level = LevelSet(function, gradient if given else None)
    same(level.pair(disc), RigidCylinder(centre, 1.5 * scale).pair(disc))


def test_level_sets_find_the_closest_point_of_a_wavy_floor():
    """The distance to a sine is what a fine sampling of it says."""
    level = LevelSet(lambda x: x[1] - 0.1 * np.sin(3 * x[0]) + 1.2)
    pairing = level.pair(DISC)
    s = np.linspace(-3, 3, 200_001)
    curve = np.stack([s, 0.1 * np.sin(3 * s) - 1.2], axis=1)
    low = np.flatnonzero(pairing.paired & (DISC.points[:, 1] < -0.5))
    assert len(low) > 10
    for i in low:
        nearest = np.linalg.norm(curve - DISC.points[i], axis=1).min()
        assert pairing.gap[i] == pytest.approx(nearest, abs=1e-8)  # spacing 3e-5, squared


@pytest.mark.parametrize("radius", [0.01, 0.3])
def test_level_sets_find_sharply_curved_obstacles_from_afar(radius):
    """Closest points are found also where the gap is many times the radius of curvature."""
    level = LevelSet(lambda x: x[0] ** 2 + (x[1] + 3) ** 2 - radius**2)
    same(level.pair(DISC), RigidCylinder((0, -3), radius).pair(DISC), tolerance=1e-8)


def test_overlaps_are_negative():
    """Pushed 0.1 into the disc, every obstacle has the least gap -0.1."""
    for obstacle in (
        RigidPlane((0, -0.9), (0, 1)),
        RigidCylinder((0, -2.9), 2.0),
        LevelSet(lambda x: np.hypot(x[0], x[1] + 2.9) - 2.0),
        LevelSet(lambda x: x[1] + 0.9),
    ):
        assert obstacle.pair(DISC).gap.min() == pytest.approx(-0.1)


OBSTACLES = [
    RigidPlane((0.2, -1.3), (0.3, 1.0)),
    RigidCylinder((0.2, -2.5), 1.4),
    RigidSphere((0.1, 0.1), 1.5, hollow=True),
    LevelSet(lambda x: (x[0] - 0.2) ** 2 + 2 * (x[1] + 2.5) ** 2 - 2),
    LevelSet(lambda x: x[1] + 1.3 + 0.1 * x[0] ** 2, lambda x: np.stack([0.2 * x[0], 1.0 + 0 * x[1]])),
]


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda o: o.label)
def test_moving_the_obstacle_is_moving_the_body_back(obstacle):
    """Gaps to a moved obstacle are those of the oppositely moved body; normals turn along."""
    angle, centre, shift = 0.4, np.array([0.3, -0.5]), np.array([0.05, -0.1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    one = DISC.body
    back = (one.dof_points - shift - centre) @ turn + centre - one.dof_points
    moved = obstacle.pair(DISC, motion=(shift, angle, centre))
    still = obstacle.pair(DISC.moved(back[np.arange(one.n), one.dof_component]))
    assert np.array_equal(moved.paired, still.paired)
    on = moved.paired
    np.testing.assert_allclose(moved.gap[on], still.gap[on], rtol=0, atol=1e-8)
    np.testing.assert_allclose(moved.normal[on], still.normal[on] @ turn.T, rtol=0, atol=1e-8)
    same(obstacle.pair(DISC, motion=shift), obstacle.moved((shift, 0.0, centre)).pair(DISC))
    same(obstacle.moved(np.zeros(2)).pair(DISC), obstacle.pair(DISC))


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: RigidPlane((0, 0), (0, 0), name="floor"), "normal=.* of 'floor' is zero"),
        (lambda: RigidPlane((0, np.nan), (0, 1)), "not a finite point"),
        (lambda: RigidPlane((0, 0, 0), (0, 1)), "point has 3 coordinates, normal 2"),
        (lambda: RigidPlane(0.0, (0, 1)), "not a finite point"),
        (lambda: RigidCylinder((0, 0), 0), "radius=0 of 'rigid cylinder' must be positive"),
        (lambda: RigidSphere((0, 0), -1.0), "use hollow=True"),
        (lambda: RigidSphere((0, 0), np.inf), "positive and finite"),
        (lambda: RigidCylinder((0, 0, 0), 1.0), "axis of 'rigid cylinder': needed in 3-D"),
        (lambda: RigidCylinder((0, 0), 1.0, axis=(0, 0, 1)), "only there"),
        (lambda: LevelSet(3.0), "function of 'rigid obstacle' is a float"),
        (lambda: LevelSet(lambda x: x[0], gradient=1), "gradient of 'rigid obstacle' is a int"),
        (lambda: LevelSet(lambda x: x).pair(DISC), r"function .* shape \(2, 64\)"),
        (lambda: LevelSet(lambda x: np.nan * x[0]).pair(DISC), "64 NaN"),
        (lambda: LevelSet(lambda x: x[0], lambda x: x[0]).pair(DISC), "gradient of"),
        (lambda: RigidPlane((0, 0, 0), (0, 0, 1)).pair(DISC), "'disc/surface' is 2-D, .* is 3-D"),
        (lambda: PLANE.moved((1.0,)), r"motion is \(1.0,\) .* translation of 2 numbers"),
        (lambda: PLANE.moved(((1, 0), 0.1)), r"motion is .*, or \(translation, angle, centre\)"),
        (lambda: PLANE.moved(((1, 0), 0.1, (0,))), "motion is .* angle in radians"),
        (lambda: PLANE.moved([(1, 0), 0.1, (0, 0), 0]), "motion is"),
        (lambda: PLANE.moved((np.inf, 0)), "translation of 2 numbers.*: finite"),
        (
            lambda: RigidPlane((0, 0, 0), (0, 0, 1)).moved(((1, 0, 0), 0.1, (0, 0, 0))),
            "give a translation of 3 numbers, or .translation, rotation vector, centre.*: finite",
        ),
    ],
)
def test_what_is_no_obstacle_is_refused(make, message):
    """Zero normals, radii that are none, wrong dimensions and motions say what was found."""
    with pytest.raises(InputError, match=message):
        make()


def test_solids_in_three_dimensions_are_described_already():
    """A cylinder in space keeps its unit axis and moves with its centre."""
    cylinder = RigidCylinder((0, 0, 0), 1.0, axis=(0, 0, 2), name="roll").moved((1, 2, 3))
    assert cylinder.axis.tolist() == [0, 0, 1] and cylinder.centre.tolist() == [1, 2, 3]
    assert cylinder.label == "roll"


def test_diagnosis_of_an_obstacle_nobody_sees():
    """A body outside a hollow cylinder has no partner, and is told to look at `hollow`."""
    obstacle = RigidCylinder((0, 0), 0.5, name="pin")
    lines = diagnose(obstacle.pair(DISC), DISC, obstacle)
    assert any("finds a partner on 'pin'" in line and "hollow" in line for line in lines)


@pytest.mark.parametrize(
    "function",
    [lambda x: x[1] ** 2 + 1.0, lambda x: np.exp(x[1]), lambda x: x[1] ** 3],
    ids=["no zero", "no zero but far below", "no slope at its zero"],
)
def test_a_level_set_that_is_nowhere_has_no_partner(function):
    """Where Newton's method ends on no surface there is none, whatever gradient it ends with."""
    assert not LevelSet(function).pair(FLOOR).paired.any()


def test_what_is_paired_with_a_level_set_is_at_its_closest_point():
    """Beyond the vertices of a diamond Newton's method may end on the continuation of a face, which is
    on the surface but at no closest point: no partner."""
    pairing = LevelSet(lambda x: np.abs(x[0]) + np.abs(x[1]) - 0.5).pair(FLOOR)
    x, y = np.abs(FLOOR.points.T)
    # the nearest point of the face between the vertices (0.5, 0) and (0, 0.5)
    along = np.clip(0.5 + y - x, 0.0, 1.0)
    distance = np.hypot(x - 0.5 * (1 - along), y - 0.5 * along)
    over_face = x >= y - 0.5
    assert pairing.paired[over_face & (x < 1.4)].all()
    np.testing.assert_allclose(pairing.gap[pairing.paired], distance[pairing.paired], atol=1e-8)


@pytest.mark.parametrize(("height", "meets"), [(2.9, True), (3.1, False)])
def test_level_sets_are_looked_for_as_deep_as_half_the_surface(height, meets):
    """A surface of length 4 at the height 1: an overlap of 1.9 counts, one of 2.1 is another side."""
    pairing = LevelSet(lambda x: x[1] - height).pair(FLOOR)
    assert pairing.paired.all() if meets else not pairing.paired.any()
