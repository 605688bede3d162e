"""Node-to-face pairing: closest points, convex edges and corners, rims, ties, and the search."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import skfem as fem
from scipy.spatial.transform import Rotation
from solid_meshes import KINDS, at, body, cube, elastic, onto_ball, shuffled

import skfem_contact as sc
from skfem_contact.bodies import KINDS as FACETS
from skfem_contact.bodies import ContactSurface, bare_surface, tangents
from skfem_contact.conditions import along_supports
from skfem_contact.pairing import (
    FacetTree,
    closest_candidates,
    closest_facets,
    interpolated_normals,
    node_to_segment,
    project,
    rim_points,
)

every_kind = pytest.mark.parametrize("kind", KINDS)


def warped(x):
    """A smooth map of the cube that bends all of its faces and edges."""
    return x + 0.15 * np.sin(2.0 * x[[1, 2, 0]] + 1.0) * np.cos(3.0 * x[[2, 0, 1]])


def grid(kind, n):
    """Reference coordinates all over a face."""
    t = np.linspace(0, 1, n)
    xi = np.stack(np.meshgrid(t, t), axis=-1).reshape(-1, 2)
    return xi[xi.sum(axis=1) <= 1 + 1e-12] if kind.triangle else xi


@every_kind
def test_projection_finds_the_least_distance(kind):
    """No point of a fine grid over the face, curved and warped as it is, is nearer than the foot."""
    surface = body(cube(kind, 2, warped), kind).surface(None)
    rng = np.random.default_rng(0)
    facet = rng.integers(0, len(surface.facets), 400)
    x = surface.points[surface.facets[facet]].mean(axis=1) + 0.3 * rng.standard_normal((400, 3))
    feet = project(surface, facet, x)
    N, _ = surface.kind.shapes(grid(surface.kind, 41))
    where = np.einsum("qk,pkd->pqd", N, surface.points[surface.facets[facet]])
    nearest = np.linalg.norm(where - x[:, None], axis=2).min(axis=1)
    assert np.all(np.linalg.norm(feet.foot - x, axis=1) <= nearest + 1e-12)
    assert set(range(-1, 2 * surface.kind.corners)) == set(feet.place)  # inside, all edges, all corners
    # inside the line of sight is the normal, and nothing is beyond
    inside = feet.place < 0
    apart = (x - feet.foot)[inside]
    along = apart - np.sum(apart * feet.own[inside], axis=1)[:, None] * feet.own[inside]
    # beyond centres of curvature, where the model is flattened, steps converge linearly
    np.testing.assert_allclose(along, 0.0, rtol=0, atol=1e-9)
    assert np.all(feet.over[inside] == 0.0) and np.all(feet.over[~inside] > 0.0)


@every_kind
def test_projection_of_points_on_the_face(kind):
    """Points that lie on a face are their own feet, and their coordinates are found."""
    surface = body(cube(kind, 2, warped), kind).surface(None)
    xi = grid(surface.kind, 6)
    N, _ = surface.kind.shapes(xi)
    for facet in (0, 5):
        x = N @ surface.points[surface.facets[facet]]
        feet = project(surface, np.full(len(x), facet), x)
        np.testing.assert_allclose(feet.foot, x, rtol=0, atol=1e-13)
        np.testing.assert_allclose(feet.xi, xi, rtol=0, atol=1e-11)


def brute(secondary: ContactSurface, primary: ContactSurface) -> np.ndarray:
    """The least distance of each point to any face that faces it, by projection on all of them."""
    m, nf = len(secondary.points), len(primary.facets)
    point, facet = np.repeat(np.arange(m), nf), np.tile(np.arange(nf), m)
    feet = project(primary, facet, secondary.points[point])
    distance = np.linalg.norm(secondary.points[point] - feet.foot, axis=1)
    facing = np.sum(secondary.normals[point] * primary.facet_normals[facet], axis=1) < -0.1
    return np.where(facing, distance, np.inf).reshape(m, nf).min(axis=1)


@every_kind
@pytest.mark.every_value
@pytest.mark.parametrize("seed", [0, 1])
def test_nodes_round_a_closed_surface_are_paired_with_its_nearest_point(kind, seed):
    """On a ball in a larger hollow ball no partner but the nearest can be right; all nodes have one."""
    turn = Rotation.random(random_state=seed).as_matrix()
    small = cube(kind, 3, onto_ball)
    small = type(small)(turn @ small.doflocs + np.array([[0.05], [-0.1], [0.08]]), small.t)
    primary = body(small, kind).surface(None)

    def shell(x):
        """Two walls of a hollow ball, from the radius 1.2 to 2."""
        y = onto_ball(x)
        return 1.2 * y

    # the inner wall of a hollow ball: a ball whose surface is looked at from inside
    outer = body(cube(kind, 4, shell), kind).surface(None)
    inside_out = type(outer)(**{**vars_of(outer), "normals": -outer.normals})
    pairing = node_to_segment(inside_out, primary)
    assert pairing.paired.all()
    foot = pairing.primary_weights @ primary.points
    distance = np.linalg.norm(inside_out.points - foot, axis=1)
    np.testing.assert_allclose(distance, brute(inside_out, primary), rtol=0, atol=1e-9)
    # n . (x_s - x_p); the normal is interpolated, so it is a little shorter than the distance
    gap = np.sum(pairing.normal * (inside_out.points - foot), axis=1)
    assert np.all(gap <= distance + 1e-14) and np.all(gap > 0.9 * distance)
    # to the sphere it is less, and the gap nearer to that
    centre = turn @ np.zeros(3) + np.array([0.05, -0.1, 0.08])
    true = np.linalg.norm(inside_out.points - centre, axis=1) - 1.0
    assert np.abs(pairing.gap - true).max() <= np.abs(gap - true).max() + 1e-12


def vars_of(surface):
    """The fields of a surface by name."""
    return {name: getattr(surface, name) for name in type(surface).__dataclass_fields__}


@every_kind
def test_the_search_leaves_no_face_out(kind):
    """The tree gives every face that holds the nearest point to any of many points far and near."""
    rng = np.random.default_rng(3)
    surface = body(cube(kind, 3, warped), kind).surface(None)
    x = rng.uniform(-1.0, 2.0, (300, 3))
    facet = np.tile(np.arange(len(surface.facets)), len(x))
    point = np.repeat(np.arange(len(x)), len(surface.facets))
    feet = project(surface, facet, x[point])
    apart = x[point] - feet.foot
    distance = np.linalg.norm(apart, axis=1).reshape(len(x), -1)
    looks = -apart.reshape(len(x), -1, 3)[np.arange(len(x)), distance.argmin(axis=1)]
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    found = np.zeros((len(x), len(surface.facets)), dtype=bool)
    blocks = closest_candidates(
        FacetTree.build(surface),
        x,
        looks,
        facing=np.pi,
        bound=np.full(len(x), np.inf),
        outside=np.inf,
        inside=np.inf,
    )
    for item, face in blocks:
        found[item, face] = True
    nearest = distance <= distance.min(axis=1, keepdims=True) + 1e-12
    # a sharp edge of the body is the nearest point of points that lie beyond 45 degrees, too
    inner = np.abs(np.sum(apart * feet.own, axis=1)).reshape(distance.shape) > 0.75 * distance
    assert np.all(found[nearest & inner])
    assert found.sum() < 0.7 * found.size  # of 54 faces, with sharp edges that open cones by 45 degrees


def plate(kind, n, z, low=0.0, high=1.0):
    """A flat plate over the square from `low` to `high`, its lower side at z."""

    def place(x):
        return np.stack([low + (high - low) * x[0], low + (high - low) * x[1], z + 0.5 * x[2]])

    return body(cube(kind, n, place), kind)


def lower(z):
    return lambda x: np.isclose(x[2], z)


@every_kind
def test_nodes_beyond_the_rim_have_no_partner(kind):
    """A plate that is larger by a tenth all around misses by a tenth, at its corners by a diagonal."""
    primary = plate(kind, 3, 0.0).surface(lower(0.5))
    secondary = plate(kind, 4, 0.7, -0.1, 1.1).surface(lower(0.7))
    pairing = node_to_segment(secondary, primary)
    x, y = secondary.points[:, 0], secondary.points[:, 1]
    beyond = np.hypot(np.maximum(np.maximum(-x, x - 1), 0), np.maximum(np.maximum(-y, y - 1), 0))
    assert np.array_equal(pairing.paired, beyond < 1e-9)
    np.testing.assert_allclose(pairing.miss, beyond, rtol=0, atol=1e-12)
    np.testing.assert_allclose(pairing.gap[pairing.paired], 0.2, rtol=0, atol=1e-12)
    linear = primary.points @ [1.0, 2.0, 0.0]
    own = secondary.points @ [1.0, 2.0, 0.0]
    np.testing.assert_allclose((pairing.primary_weights @ linear)[pairing.paired], own[pairing.paired])


@every_kind
def test_nodes_at_the_rim_are_paired(kind):
    """Plates of one size: nodes on the common rim have partners, round-off or not."""
    primary = plate(kind, 3, 0.0).surface(lower(0.5))
    for noise in (0.0, 1e-12, -1e-12):
        secondary = plate(kind, 4, 0.5, noise, 1.0 - noise).surface(lower(0.5))
        pairing = node_to_segment(secondary, primary)
        assert pairing.paired.all() and np.all(pairing.miss == 0.0)
        np.testing.assert_allclose(pairing.gap, 0.0, rtol=0, atol=1e-14)


@every_kind
def test_reach_and_overlaps(kind):
    """Gaps and overlaps beyond the reach have no partner; without it the far side is none."""
    primary = plate(kind, 2, 0.0).surface(lower(0.5))
    for z in (0.6, 0.4):
        secondary = plate(kind, 3, z).surface(lower(z))
        assert node_to_segment(secondary, primary).paired.all()
        np.testing.assert_allclose(node_to_segment(secondary, primary).gap, z - 0.5, rtol=0, atol=1e-12)
        assert not node_to_segment(secondary, primary, reach=0.05).paired.any()
        assert node_to_segment(secondary, primary, reach=0.2).paired.all()
    deep = plate(kind, 3, 0.5 - 0.8).surface(lower(-0.3))
    assert not node_to_segment(deep, primary).paired.any()


def test_convex_edges_and_corners_take_nodes_up_to_45_degrees():
    """Round the edge of a cube a node is paired along the normal of its side, at 45 degrees at most."""
    cube_ = body(cube("quad4", 2), "quad4").surface(None)
    assert cube_.sharp_points.sum() == 8 + 12 and not rim_points(cube_).any()
    for angle, expected in ((10, True), (44, True), (46, False)):
        # the tip of a small tetrahedron that looks down, beyond the edge x = 1 of the top z = 1
        tan = np.tan(np.radians(angle))
        tip = np.array([1.0 + 0.2 * tan, 0.3, 1.2])
        p = tip[:, None] + 0.1 * np.array([[0, 1, -1, 0], [0, -0.5, -0.5, 1], [0, 0.05, 0.05, 0.05]])
        p = np.hstack([p, tip[:, None] + [[0], [0], [1.0]]])
        mesh = fem.MeshTet(p, np.array([[0, 1, 2, 4], [0, 2, 3, 4], [0, 3, 1, 4]]).T)
        foot = body(mesh, "tri3").surface(lambda x: x[2] < 1.23)
        node = int(np.argmin(foot.points[:, 2]))
        pairing = node_to_segment(foot, cube_)
        assert pairing.paired[node] == expected, angle
        if expected:
            np.testing.assert_allclose(pairing.normal[node], [0, 0, 1], atol=1e-12)
            assert pairing.gap[node] == pytest.approx(0.2)
        else:
            assert pairing.miss[node] == pytest.approx(0.2 * tan)


def test_nodes_slide_over_joints_without_a_jump():
    """Over a ball of few faces the normal and the foot change with the place of a node, never more."""
    ball = body(cube("quad4", 4, onto_ball), "quad4").surface(None)
    t = np.linspace(0.0, 1.0, 400)
    way = np.stack(
        [np.cos(2 * t) * np.sin(1 + t), np.sin(2 * t) * np.sin(1 + t), np.cos(1 + t)], axis=1
    )
    other = body(cube("quad4", 4, onto_ball), "quad4").surface(None)
    probe = type(ball)(**{**vars_of(other), "points": 1.05 * way, "normals": -way})
    point, facet, _ = closest_facets(probe, ball, np.inf, 1.0)
    assert np.array_equal(point, np.arange(len(t)))
    feet = project(ball, facet, probe.points)
    for values in (interpolated_normals(ball, facet, feet.xi), feet.foot):
        jump = np.abs(np.diff(values, axis=0)).max()
        assert jump < 3 * np.abs(np.diff(way, axis=0)).max()


@every_kind
def test_pairing_does_not_depend_on_numbering_or_place(kind):
    """Meshes with other numbers, and all turned and moved, give the same partners, frames and gaps."""
    # touching meshes with many ties: nodes over nodes, edges and the middles of faces
    base, top = cube(kind, 4, lambda x: x - [[0], [0], [1]]), cube(kind, 2)

    def pair(low, high, turn):
        sides = []
        for mesh, look in ((high, lambda x: np.isclose(x[2], 0)), (low, lambda x: np.isclose(x[2], 0))):
            turned = type(mesh)(turn @ mesh.doflocs, mesh.t)
            back = body(turned, kind)
            sides.append(back.surface(lambda x, look=look: look(np.einsum("ji,j...->i...", turn, x))))
        return sides, node_to_segment(*sides)

    (secondary, primary), first = pair(base, top, np.eye(3))
    turn = Rotation.random(random_state=5).as_matrix()
    (other, opposite), second = pair(shuffled(base, 1), shuffled(top, 2), turn)
    own = np.lexsort(np.round(secondary.points, 9).T)
    there = np.lexsort(np.round(other.points @ turn, 9).T)
    np.testing.assert_allclose(other.points[there] @ turn, secondary.points[own], atol=1e-12)
    np.testing.assert_allclose(second.gap[there], first.gap[own], rtol=0, atol=1e-12)
    np.testing.assert_allclose(second.normal[there] @ turn, first.normal[own], atol=1e-12)
    feet = (first.primary_weights @ primary.points)[own]
    np.testing.assert_allclose(
        (second.primary_weights @ opposite.points)[there] @ turn, feet, atol=1e-12
    )


def test_the_tip_of_a_crack_is_no_partner_of_itself():
    """Nodes on the front of a crack belong to both lips and have no partner on the other."""
    t = np.linspace(0, 1, 3)
    low = fem.MeshHex.init_tensor(t, t, np.array([0.0, 1.0]))
    high = fem.MeshHex.init_tensor(t, t, np.array([1.0, 2.0]))
    p = np.hstack([low.p, high.p])
    shared = (p[2] == 1.0) & (p[0] == 0.0)  # the two halves hang together along one edge
    number = np.arange(p.shape[1])
    for i in np.flatnonzero(shared & (number >= low.nvertices)):
        same = np.flatnonzero(shared & (number < low.nvertices) & np.all(p[:, [i]] == p, axis=0))
        number[i] = same[0]
    t_all = number[np.hstack([low.t, high.t + low.nvertices])]
    used, t_all = np.unique(t_all, return_inverse=True)
    mesh = fem.MeshHex(p[:, used], t_all.reshape(8, -1))
    one = body(mesh, "quad4")
    centre = mesh.p[:, mesh.t[:, mesh.f2t[0]]].mean(axis=1)[2]
    level = np.isclose(mesh.p[2, mesh.facets].min(axis=0), 1) & np.isclose(
        mesh.p[2, mesh.facets].max(axis=0), 1
    )
    upper = one.surface(np.flatnonzero(level & (centre > 1)), name="upper")
    under = one.surface(np.flatnonzero(level & (centre < 1)), name="under")
    pairing = node_to_segment(upper, under)
    np.testing.assert_array_equal(pairing.paired, upper.points[:, 0] > 0)
    np.testing.assert_allclose(pairing.gap[pairing.paired], 0.0, atol=1e-14)


def test_an_edge_of_the_primary_between_the_nodes_is_told():
    """A ridge of the primary under the middle of coarse faces; with fine ones it is seen."""

    def ridge(x):
        """A roof over the square, 0.2 high along its middle."""
        return np.stack([x[0], x[1], x[2] * (0.8 + 0.4 * np.minimum(x[0], 1 - x[0]))])

    low = elastic(cube("quad4", 4, ridge), "quad4", "low", held=((at(2, 0.0), (0, 1, 2)),))
    top = low.surface(lambda x: x[2] > 0.8)
    for n in (1, 4):
        mesh = cube("quad4", n, lambda x: x + [[0], [0], [0.9]])
        high = elastic(mesh, "quad4", "high", held=((at(2, 1.9), (0, 1, 2)),))
        contact = sc.Contact(high.surface(at(2, 0.9)), top, method="node")
        solver = sc.ContactSolver([low, high], [contact])
        if n == 1:
            with pytest.warns(sc.ContactWarning, match=r"'low/.*' lies in the body of 'high/"):
                solver.solve()
        else:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", ".*is strained by", sc.ContactWarning)
                assert solver.solve().normal_force.max() > 0


@every_kind
def test_projection_from_beyond_the_centres_of_curvature(kind):
    """Far from a bent face there are several least distances: nearly always the least is found."""
    surface = body(cube(kind, 1, warped), kind).surface(None)
    rng = np.random.default_rng(0)
    facet = rng.integers(0, len(surface.facets), 600)
    x = surface.points[surface.facets[facet]].mean(axis=1) + 3.0 * rng.standard_normal((600, 3))
    feet = project(surface, facet, x)
    N, _ = surface.kind.shapes(grid(surface.kind, 41))
    where = np.einsum("qk,pkd->pqd", N, surface.points[surface.facets[facet]])
    nearest = np.linalg.norm(where - x[:, None], axis=2).min(axis=1)
    assert np.count_nonzero(np.linalg.norm(feet.foot - x, axis=1) > nearest + 1e-9) <= 3


@pytest.mark.parametrize("kind", ["tri6", "quad9"])
def test_projection_takes_steps_back_that_lead_away(kind):
    """On faces whose nodes are a fifth of a face off a flat one no place of a grid is nearer."""
    kind, rng, count = FACETS[kind], np.random.default_rng(0), 100
    flat = np.column_stack([kind.locations, np.zeros(kind.nodes)])
    nodes = flat + rng.uniform(-0.2, 0.2, (count, kind.nodes, 3))
    x, facets = rng.uniform(-1, 2, (count, 3)), np.arange(count * kind.nodes).reshape(count, -1)
    feet = project(bare_surface(nodes.reshape(-1, 3), facets, "faces"), np.arange(count), x)
    where = np.einsum("qk,pkd->pqd", kind.shapes(grid(kind, 41))[0], nodes)
    nearest = np.linalg.norm(where - x[:, None], axis=2).min(axis=1)
    assert np.all(np.linalg.norm(feet.foot - x, axis=1) <= nearest + 1e-6)


@every_kind
@pytest.mark.parametrize("height", [1e-3, 1e-6, 1e-9])
def test_projection_of_points_that_nearly_touch(kind, height):
    """Points on the normals of a bent face have their feet where those normals stand, to round-off."""
    surface = body(cube(kind, 2, warped), kind).surface(None)
    rng = np.random.default_rng(1)
    facet, xi = rng.integers(0, len(surface.facets), 300), rng.uniform(0.05, 0.45, (300, 2))
    N, dN = surface.kind.shapes(xi)
    x = np.einsum("pk,pkd->pd", N, surface.points[surface.facets[facet]])
    one, other = np.einsum("pki,pkd->ipd", dN, surface.points[surface.facets[facet]])
    up = np.cross(one, other)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    feet = project(surface, facet, x + height * up)
    # places of size one have 16 digits; edges of faces are half as long
    np.testing.assert_allclose(feet.foot, x, rtol=0, atol=5e-15)
    np.testing.assert_allclose(feet.xi, xi, rtol=0, atol=2e-14)


def test_the_search_is_selective_and_complete_on_a_ball():
    """Of a ball of 384 faces a far point is shown few, and the one it sees is among them."""
    ball = body(cube("quad4", 8, onto_ball), "quad4").surface(None)
    rng = np.random.default_rng(0)
    way = rng.standard_normal((500, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    far = np.full(len(way), np.inf)
    for distance in (0.6, 1.0, 1.3, 7.0):
        found = np.zeros((len(way), len(ball.facets)), dtype=bool)
        for item, face in closest_candidates(
            FacetTree.build(ball),
            distance * way,
            -way,
            facing=0.5 * np.pi,
            bound=far,
            outside=np.inf,
            inside=np.inf,
        ):
            found[item, face] = True
        feet = project(
            ball, np.tile(np.arange(len(ball.facets)), len(way)), np.repeat(way, 384, axis=0)
        )
        seen = np.sum((feet.foot - np.repeat(way, 384, axis=0)) ** 2, axis=1).reshape(found.shape)
        assert np.all(found[np.arange(len(way)), seen.argmin(axis=1)])
        assert found.mean() < 0.15


def probe(tip, looks, size=0.02):
    """A small tetrahedron whose tip looks along a direction: the surface of its three sides there."""
    looks = np.asarray(looks, dtype=float) / np.linalg.norm(looks)
    across = np.linalg.svd(looks[None])[2][1:]
    ring = [np.cos(a) * across[0] + np.sin(a) * across[1] for a in (0.3, 2.4, 4.5)]
    p = np.array([tip, *(tip + size * (r - 1.5 * looks) for r in ring)])
    t = np.array([[0, 1, 2, 3]]).T
    one = body(fem.MeshTet(p.T.copy(), t), "tri3")
    surface = one.surface(lambda x: np.linalg.norm(x - tip[:, None], axis=0) < 1.3 * size)
    return surface, int(np.argmin(np.linalg.norm(surface.points - tip, axis=1)))


@pytest.mark.parametrize("angle, expected", [(30, True), (43, True), (50, False)])
def test_round_a_corner_of_a_cube(angle, expected):
    """Beyond the corner (1, 1, 1): paired with it along z as long as it is within 45 degrees of z."""
    surface = body(cube("quad4", 2), "quad4").surface(None)
    across = 0.3 * np.tan(np.radians(angle)) / np.sqrt(2)
    foot, node = probe(np.array([1 + across, 1 + across, 1.3]), (0, 0, -1))
    pairing = node_to_segment(foot, surface)
    assert pairing.paired[node] == expected
    if expected:
        np.testing.assert_allclose(pairing.normal[node], [0, 0, 1], atol=1e-12)
        assert pairing.gap[node] == pytest.approx(0.3)
        corner = np.flatnonzero(np.all(surface.points == 1.0, axis=1))
        assert pairing.primary_weights[node, corner[0]] == pytest.approx(1.0)


def test_ties_in_a_groove_do_not_depend_on_numbers():
    """In the middle of a groove both flanks are as near: one is taken, whatever its number."""

    def groove(x):
        """Two flanks of 45 degrees that meet at x = 0."""
        y = 2 * x[0] - 1
        return np.stack([y, x[1], x[2] * 0.5 + np.abs(y)])

    mesh = cube("quad4", 4, groove)
    found = set()
    for seed in (None, *range(6)):
        one = body(mesh if seed is None else shuffled(mesh, seed), "quad4")
        flanks = one.surface(lambda x: x[2] > np.abs(x[0]) + 0.49)
        tip, node = probe(np.array([0.0, 0.53, 0.7]), (0, 0, -1))
        pairing = node_to_segment(tip, flanks)
        assert pairing.paired[node]
        found.add(tuple(np.round(pairing.normal[node], 9)))
    assert len(found) == 1


def test_nothing_overhangs_what_looks_the_same_way():
    """Beside the rim of a face that looks where the node does there is nothing to be beyond of."""
    low = body(cube("quad4", 2), "quad4").surface(at(2, 1.0))
    beside = cube("quad4", 2, lambda x: x + np.array([[1.05], [0.0], [0.02]]))
    up, down = (body(beside, "quad4").surface(at(2, z)) for z in (1.02, 0.02))
    assert np.all(np.isinf(node_to_segment(up, low).miss))
    raised = cube("quad4", 2, lambda x: x + np.array([[1.05], [0.0], [1.02]]))
    down = body(raised, "quad4").surface(at(2, 1.02))
    miss = node_to_segment(down, low).miss
    np.testing.assert_allclose(miss, down.points[:, 0] - 1.0, rtol=0, atol=1e-12)


def test_a_bend_that_grows_along_its_edge():
    """A roof whose ridge is sharp at one end only is sharp: the bend is not the mean of both ends."""
    t = np.linspace(0, 1, 3)
    mesh = fem.MeshHex.init_tensor(t, t[[0, -1]], t[[0, -1]])
    # flat at y = 0, bent by 60 degrees at y = 1, where the mean of both is 30
    rise = np.tan(np.radians(30.0)) * np.abs(mesh.p[0] - 0.5) * mesh.p[1] * mesh.p[2]
    p = mesh.p - np.array([[0.0], [0.0], [1.0]]) * rise
    surface = body(fem.MeshHex(p, mesh.t), "quad4").surface(mesh.facets_satisfying(at(2, 1.0)))
    sharp = surface.sharp_edges
    assert sharp.sum() == 2  # the same edge from both faces
    assert set(np.flatnonzero(surface.sharp_points)) == set(
        np.flatnonzero(np.isclose(surface.points[:, 0], 0.5))
    )


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("several", [False, True])
def test_one_tangent_lies_along_what_supports_leave(axis, several):
    """Of one held component, or of two, one tangent is held as a whole, on faces at any angle."""
    normal = np.array([[1.0, 2.0, 2.0], [-0.3, 0.1, 0.9]])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    held = np.zeros((2, 3), dtype=bool)
    held[:, axis] = True
    held = ~held if several else held
    frame = along_supports(tangents(normal), normal, held)
    for t, n in zip(frame, normal, strict=True):
        np.testing.assert_allclose(np.vstack([t, n]) @ np.vstack([t, n]).T, np.eye(3), atol=1e-12)
    # the second is square to the axis: held, where all others are; free, where the axis alone is held
    np.testing.assert_allclose(frame[:, 1, axis], 0.0, atol=1e-12)


@pytest.mark.parametrize("kind", ["tri6", "quad8", "quad9"])
def test_steps_that_lead_away_are_halved(kind):
    """On faces bent as far as meshes have them no point of a lattice is nearer than the foot."""
    known, rng = FACETS[kind], np.random.default_rng(0)
    nodes, count = known.nodes, 400
    x = np.zeros((count, nodes, 3))
    x[..., :2] = known.locations
    x += 0.15 * rng.uniform(-1, 1, x.shape)
    surface = bare_surface(x.reshape(-1, 3), np.arange(count * nodes).reshape(count, nodes), "bent")
    points = rng.uniform([-1.5, -1.5, -2.0], [2.5, 2.5, 2.0], (count, 3))
    feet = project(surface, np.arange(count), points)
    at = rng.uniform(size=(2000, 2))
    at = at[at.sum(axis=1) <= 1] if known.corners == 3 else at
    lattice = np.einsum("gk,fkd->fgd", known.shapes(at)[0], x)
    nearest = np.linalg.norm(lattice - points[:, None], axis=2).min(axis=1)
    away = np.linalg.norm(feet.foot - points, axis=1)
    assert np.count_nonzero(away > nearest + 1e-9) <= 1  # of several minima one may be missed
