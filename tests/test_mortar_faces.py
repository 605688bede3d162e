"""Dual mortar between faces: multipliers, integrals, what passes between meshes that do not match."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import internals
import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.spatial.transform import Rotation
from solid_meshes import KINDS, as_eight_nodes, at, basis_on, body, cube, onto_octant, shuffled

from skfem_contact import Body, Contact
from skfem_contact.bodies import KINDS as FACETS
from skfem_contact.bodies import angle_between, kink_angles, positive_functions
from skfem_contact.conditions import pair
from skfem_contact.errors import InputError
from skfem_contact.pairing import (
    clip,
    dual_basis,
    dual_mortar,
    least_gaps,
    node_rows,
    segment,
    signed_areas,
    whole_shares,
)

find_supports = internals.beside(dual_basis, "find_supports")

ROUND_OFF = 1e-12  # of sums of hundreds of numbers of the order of one
FACES = [name for name, kind in FACETS.items() if kind.dim == 2]
TURN = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
every_face = pytest.mark.parametrize("kind", FACES)


def block(kind, x, y, z, *, moved=None, place=None, seed=None, **options):
    """A body of the cells between lines; vertices inside the faces z moved in the plane; placed."""
    linear, curved, _ = KINDS[kind]
    lines = [np.linspace(0, 1, n + 1) if isinstance(n, int) else np.asarray(n, float) for n in (x, y)]
    mesh = linear.init_tensor(*lines, np.asarray(z, float))
    p = mesh.p.copy()
    if moved is not None:
        rng = np.random.default_rng(moved)
        inside = [(q > line[0]) & (q < line[-1]) for q, line in zip(p, lines, strict=False)]
        inner = np.all(inside, axis=0)
        size = np.array([np.diff(line).min() for line in lines])[:, None]
        p[:2, inner] += rng.uniform(-0.25, 0.25, (2, np.count_nonzero(inner))) * size
        mesh = linear(p, mesh.t)
    if seed is not None:
        mesh = shuffled(mesh, seed)
    mesh = curved.from_mesh(mesh) if curved is not linear else mesh
    named = {
        "low": mesh.facets_satisfying(lambda q: np.isclose(q[2], z[0])),
        "up": mesh.facets_satisfying(lambda q: np.isclose(q[2], z[-1])),
    }
    if place is not None:
        mesh = placed(mesh, kind, place)
    return body(mesh.with_boundaries(named), kind, **options)


def placed(mesh, kind, place):
    """The mesh with its nodes mapped; of eight-node faces the middles are where those have them."""
    p = np.ascontiguousarray(place(mesh.doflocs))
    return type(mesh)(as_eight_nodes(mesh, p) if kind == "quad8" else p, mesh.t)


def turned(x):
    return TURN @ x


def flat_pair(secondary, primary, n=(4, 3), moved=None, **options):
    """Surfaces of two blocks on top of each other that do not match, turned in space."""
    seeds = (None, None) if moved is None else (moved, moved + 1)
    top = block(secondary, n[0], n[0], [1, 2], moved=seeds[0], place=turned, **options)
    low = block(primary, n[1], n[1], [0, 1], moved=seeds[1], place=turned)
    return top.surface("low"), low.surface("up")


# --- the basis ------------------------------------------------------------------------------------


@cache
def covers(kind):
    """Parts of a face inside random slim and small polygons: shape functions, weights, whose."""
    rng, at = np.random.default_rng(3), FACETS[kind].locations[: FACETS[kind].corners]
    turn = np.arange(4) * np.pi / 2 + rng.uniform(-0.6, 0.6, (4000, 4))
    long = 10 ** rng.uniform(-2, 1, (4000, 1))
    wide = long * 10 ** rng.uniform(-2, 0, (4000, 1))
    slim = np.stack([long * np.cos(turn), wide * np.sin(turn)], axis=-1)
    a = rng.uniform(0, 2 * np.pi, 4000)
    slim = slim @ np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]).T.swapaxes(1, 2)
    polygons = slim + rng.uniform(-0.2, 1.2, (4000, 1, 2))
    parts = clip(polygons, np.broadcast_to(at, (4000, *at.shape)))
    parts = parts.some(np.flatnonzero(parts.areas > 1e-6))
    whose, triangles = parts.simplices(round_middle=True)
    xi, w = FACETS["tri3"].quadrature(8)
    N, _ = FACETS[kind].shapes(FACETS["tri3"].shapes(xi)[0] @ triangles)
    return N, 2 * signed_areas(triangles)[:, None] * w, whose, len(parts.count)


def summed(values, whose, count):
    out = np.zeros((count, *values.shape[1:]))
    np.add.at(out, whose, values)
    return out


def basis_of(kind, without=None):
    """Multipliers on all `covers`, and the integrals over whole faces."""
    N, w, whose, count = covers(kind)
    mass = summed(np.swapaxes(N * w[..., None], 1, 2) @ N, whose, count)
    at, weight = FACETS[kind].quadrature(8)
    whole = weight @ FACETS[kind].shapes(at)[0] @ positive_functions(FACETS[kind]).T
    whole = np.tile(whole, (count, 1))
    return dual_basis(FACETS[kind], mass, whole, whole, without), whole


@pytest.mark.parametrize("other", ["tri3", "quad4"])
@pytest.mark.parametrize(("width", "above"), [(1.4, 12), (1.1, 10)])
def test_held_nodes_see_what_is_above_them(other, width, above):
    """Anywhere on a face, also near its corners; what the primary ends before it sees nothing."""
    mesh = cube("quad4", 3, lambda x: x + np.array([[0.0], [0.0], [1.0]]))
    up = body(mesh, "quad4", D=basis_on(mesh, "quad4", 2).get_dofs(at(0, 0.0)))
    low = body(cube(other, 5, lambda x: width * x - np.array([[0.2], [0.2], [width - 1]])), other)
    found = find_supports(segment(up.surface(at(2, 1.0)), low.surface(at(2, 1.0))))
    assert found.above.size == 12 and np.count_nonzero(found.above) == above


@every_face
def test_multipliers_are_dual_on_any_part(kind):
    """``int phi_i N_j`` is what D is made of, and the multipliers add up to one, on any part."""
    basis, _ = basis_of(kind)
    N, w, whose, count = covers(kind)
    phi = N @ np.swapaxes(basis.A, 1, 2)[whose]
    D = summed(np.swapaxes(phi * w[..., None], 1, 2) @ N, whose, count)
    expected = (basis.S * basis.share[:, None, :]) @ node_rows(FACETS[kind])
    # round-off in the inverse of mass matrices of condition up to 1e8
    area = summed(w.sum(axis=1), whose, count)[:, None, None]
    assert (np.abs(D - expected) / area).max() < 1e-9
    assert_allclose(basis.S.sum(axis=1), 1.0, rtol=0, atol=ROUND_OFF)
    assert np.abs(phi.sum(axis=2) - 1).max() < 1e-7  # its values, not its integrals


@every_face
def test_weights_stay_bounded(kind):
    """However little is covered, ``int |phi_i| / int phi_i`` is small, and no area is negative."""
    basis, _ = basis_of(kind)
    N, w, whose, count = covers(kind)
    phi = N @ np.swapaxes(basis.A, 1, 2)[whose]
    size = summed((np.abs(phi) * w[..., None]).sum(axis=1), whose, count)
    area = (basis.S @ basis.share[..., None])[..., 0]
    there = basis.A.any(axis=2)
    assert np.all(area[there] > 0) and np.all(area[~there] == 0)
    bound = {"tri3": 8, "quad4": 11, "tri6": 17, "quad8": 20, "quad9": 24}[kind]
    assert (size[there] / area[there]).max() < bound
    several = np.mean(there.sum(axis=1) > 1)
    assert several > 0.1  # and not because only one multiplier is left everywhere


@every_face
def test_whole_faces_merge_nothing(kind):
    """On a whole face every node has its own multiplier, with a positive area."""
    face = FACETS[kind]
    at, w = face.quadrature(8)
    N = face.shapes(at)[0]
    mass = (N * w[:, None]).T @ N
    whole = (positive_functions(face) @ mass.sum(axis=1))[None]
    basis = dual_basis(face, mass[None], whole, whole)
    assert_allclose(basis.S[0], np.eye(face.nodes), rtol=0, atol=0)
    assert whole.min() > 0.02 * w.sum()
    if kind == "tri3":  # the textbook: 3 on the node, -1 on the others
        assert_allclose(basis.A[0], 4 * np.eye(3) - 1, rtol=0, atol=ROUND_OFF)


def test_half_a_face_is_merged_without_a_preference():
    """What is cut off goes to the neighbours across, each to its own; mirrored faces alike."""
    face = FACETS["quad4"]
    xi, w = face.quadrature(6)
    N = face.shapes(xi * [0.4, 1.0])[0]
    mass = 0.4 * (N * w[:, None]).T @ N
    whole = np.full((1, 4), 0.25)
    basis = dual_basis(face, mass[None], whole, whole)
    expected = np.array([[1, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1, 1]])
    assert_allclose(basis.S[0], expected, rtol=0, atol=ROUND_OFF)


def test_one_multiplier_is_that_of_the_node_that_most_is_covered_of():
    """Of nodes with as much, that of the node that has more on all its faces together."""
    face = FACETS["tri3"]
    whole, total, one = np.full((1, 3), 4.0), np.array([[8.0, 9.0, 12.0]]), np.array([True])
    for covered, node in (([3.0, 2.0, 1.0], 0), ([1.0, 3.0, 3.0], 2), ([3.0, 3.0, 1.0], 1)):
        basis = dual_basis(face, np.diag(covered)[None], whole, total, constant=one)
        assert np.flatnonzero(basis.S[0].any(axis=1)).tolist() == [node]


def test_a_strip_across_the_middle_keeps_one_edge():
    """Two multipliers along the strip, each constant across it: all four would have to extrapolate."""
    face = FACETS["quad4"]
    xi, w = face.quadrature(6)
    N = face.shapes(np.array([0.45, 0.0]) + xi * [0.2, 1.0])[0]
    mass = 0.2 * (N * w[:, None]).T @ N
    whole = np.full((1, 4), 0.25)
    basis = dual_basis(face, mass[None], whole, whole)
    expected = np.array([[0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 0]])
    assert_allclose(basis.S[0], expected, rtol=0, atol=ROUND_OFF)
    phi = face.shapes(np.array([[0.5, 0.0], [0.6, 0.0], [0.5, 1.0]]))[0] @ basis.A[0, 1]
    assert_allclose(phi, [2, 2, -1], rtol=0, atol=1e-10)  # of a line: 2 at its own end, -1 at the other


# --- flat interfaces --------------------------------------------------------------------------------


@pytest.mark.pairwise
@pytest.mark.parametrize("moved", [None, 11, 23])
@pytest.mark.parametrize("primary", FACES)
@pytest.mark.parametrize("secondary", FACES)
def test_uniform_pressure_passes(secondary, primary, moved):
    """Its nodal forces are those of the faces on both sides, whatever elements meet, at any angle."""
    s, p = flat_pair(secondary, primary, moved=moved)
    pairing = dual_mortar(s, p)
    assert pairing.paired.all()
    # quadrilaterals with corners moved by a quarter of their size: what the rule leaves
    tolerance = ROUND_OFF if moved is None else 1e-9
    scale = p.area.max()
    assert_allclose(pairing.secondary_weights.T @ pairing.area, s.area, rtol=0, atol=tolerance * scale)
    assert_allclose(pairing.primary_weights.T @ pairing.area, p.area, rtol=0, atol=tolerance * scale)
    assert pairing.area.min() > 0
    assert_allclose(pairing.gap, 0.0, rtol=0, atol=ROUND_OFF)
    assert_allclose(pairing.normal, np.tile(TURN @ [0, 0, 1], (len(s.points), 1)), atol=ROUND_OFF)


@pytest.mark.parametrize(
    "kinds", [("tri3", "quad4"), ("quad4", "tri3"), ("quad8", "tri6"), ("tri6", "quad9")]
)
def test_motions_of_the_plane_are_exact(kinds):
    """Rows of linear fields: both sides see the same, so translations and rotations strain nothing."""
    s, p = flat_pair(*kinds, moved=5)
    pairing = dual_mortar(s, p)
    away = pairing.secondary_weights @ s.points - pairing.primary_weights @ p.points
    assert_allclose(away, 0.0, rtol=0, atol=ROUND_OFF)
    for W in (pairing.secondary_weights, pairing.primary_weights):
        assert_allclose(np.asarray(W.sum(axis=1)).ravel(), 1.0, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("kind", FACES)
def test_gap_of_blocks_apart(kind):
    """Parallel faces at a distance are open by it; along the normal of the secondary."""
    top = block(kind, 3, 3, [1.25, 2], place=turned).surface("low")
    low = block(kind, 4, 4, [0, 1], place=turned).surface("up")
    pairing = dual_mortar(top, low)
    assert_allclose(pairing.gap, 0.25, rtol=0, atol=ROUND_OFF)
    assert not dual_mortar(top, low, reach=0.2).paired.any()
    assert dual_mortar(top, low, reach=0.3).paired.all()
    deep = block(kind, 3, 3, [0.7, 2], place=turned).surface("low")
    assert_allclose(dual_mortar(deep, low).gap, -0.3, rtol=0, atol=ROUND_OFF)
    assert not dual_mortar(deep, low, reach=0.2).paired.any()
    far = block(kind, 3, 3, [-0.8, 2], place=turned).surface(
        "low"
    )  # the box has half a diagonal of 0.71
    assert not dual_mortar(far, low).paired.any()
    with pytest.raises(InputError, match="positive length"):
        dual_mortar(top, low, reach=-1.0)


@pytest.mark.every_value
@pytest.mark.parametrize("kind", FACES)
@pytest.mark.parametrize("width", [(1.3, 0.9), (0.62, 0.55), (0.3, 1.4)])
def test_part_of_the_secondary_is_covered(kind, width):
    """The rows have the area of what is covered, and the mean of a linear field over it."""
    top = block(kind, 4, 4, [1, 2]).surface("low")
    lines = [np.linspace(-0.07, -0.07 + size, 4) for size in width]
    low = block(kind, *lines, [0, 1]).surface("up")
    pairing = dual_mortar(top, low)
    sides = [(0.0, min(1.0, line[-1])) for line in lines]
    area = np.prod([b - a for a, b in sides])
    assert_allclose(pairing.area[pairing.paired].sum(), area, rtol=ROUND_OFF)
    middle = np.append([0.5 * (a + b) for a, b in sides], 1.0)
    for W, surface in ((pairing.secondary_weights, top), (pairing.primary_weights, low)):
        force = W.T @ np.where(pairing.paired, pairing.area, 0.0)
        assert_allclose(force @ surface.points, area * middle, rtol=0, atol=1e-10)
    assert_allclose(pairing.gap[pairing.paired], 0.0, atol=ROUND_OFF)
    # beyond the end by how much, or with the multiplier of a neighbour
    out = ~pairing.paired
    beyond = np.max([top.points[:, k] - sides[k][1] for k in (0, 1)], axis=0)
    assert out.any() == (min(width) < 1)
    assert np.all(pairing.miss[~out] == 0) and np.all(pairing.miss[out] >= 0)
    assert np.all(out[beyond > 0.3]) and not np.any(out & (beyond < -ROUND_OFF))
    assert np.all(np.isinf(pairing.gap[out])) and pairing.area.min() > 0


def sheared(x):
    return np.stack([x[0], x[1] + 0.3 * x[0], *x[2:]])


def plane_and_thick(kind, element, x, y, side, sheared=sheared):
    """A side of a plane body of cells between lines, and of the same one element thick."""
    mesh = fem.MeshQuad.init_tensor(x, np.asarray(y, float))
    facets = mesh.facets_satisfying(lambda q: np.isclose(q[1], y[0 if side == "low" else 1]))
    basis = fem.Basis(fem.MeshQuad(sheared(mesh.p), mesh.t), fem.ElementVector(element()))
    thick = block(kind, x, [0, 0.7], y, place=lambda q: sheared(q[[0, 2, 1]] * [[1], [1], [-1]]))
    return Body(basis, linear_elasticity()).surface(facets), thick.surface(side)


@pytest.mark.every_value
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    ("kind", "element"), [("quad4", fem.ElementQuad1), ("quad9", fem.ElementQuad2)], ids=["Q1", "Q2"]
)
def test_rows_are_those_of_plane_bodies_one_element_thick(kind, element, seed):
    """Lines that overlap anyhow, sheared: rows, gaps and normals in space are those in the plane."""
    rng = np.random.default_rng(seed)
    x_top = np.append(0.0, np.cumsum(rng.uniform(0.2, 1.0, 4)))
    x_low = np.append(0.0, np.cumsum(rng.uniform(0.2, 1.0, 5))) + rng.uniform(-0.6, 0.6)
    top = plane_and_thick(kind, element, x_top, [1, 2], "low")
    low = plane_and_thick(kind, element, x_low, [0, 1], "up")
    compared(top, low)


@pytest.mark.parametrize("seed", range(4))
def test_chamfers_are_met_as_those_of_plane_bodies(seed):
    """A flat that turns into a chamfer, of the lower or of the upper body: gaps and frames alike."""
    rng = np.random.default_rng(seed)
    x_top = np.append(0.0, np.cumsum(rng.uniform(0.4, 0.6, 5)))
    x_low = np.append(0.0, np.cumsum(rng.uniform(0.4, 0.6, 5)))
    turns = (x_top[3], 0.4) if seed % 2 else (x_low[3], -0.4)

    def bent(x):
        return np.stack([x[0], x[1] + turns[1] * np.maximum(x[0] - turns[0], 0), *x[2:]])

    shapes = (bent, np.array) if seed % 2 else (np.array, bent)
    top = plane_and_thick("quad4", fem.ElementQuad1, x_top, [1, 2], "low", shapes[0])
    low = plane_and_thick("quad4", fem.ElementQuad1, x_low, [0, 1], "up", shapes[1])
    # where normals turn along a face integrands are no polynomials: rules of degree 5 in both; and
    # the least gap, which here is that of the corners, is continued from the points of the rule there
    tolerances = (1e-5, 1e-3) if seed % 2 else (1e-9, 1e-9)
    thick = compared(top, low, *tolerances)
    away = thick.secondary_weights @ top[1].points - thick.primary_weights @ low[1].points
    weighted = np.sum(away * thick.normal, axis=1)[thick.paired]
    # the flats touch; the weighted gap alone would be an overlap where the other side has the chamfer
    assert thick.gap[thick.paired].min() >= -ROUND_OFF
    assert seed % 2 or weighted.min() < -1e-3


def compared(top, low, tolerance=1e-9, of_gaps=1e-9):
    """The rows in space, compared with those in the plane."""
    flat, thick = dual_mortar(top[0], low[0]), dual_mortar(top[1], low[1])
    order = []
    for plane, space in (top, low):
        away = np.linalg.norm(space.points[:, None, :2] - plane.points, axis=2) + abs(
            space.points[:, 2:]
        )
        order.append(np.argmin(away, axis=0))
        assert np.min(away, axis=0).max() < ROUND_OFF
    own, other = order
    assert np.array_equal(thick.paired[own], flat.paired)
    weights = thick.secondary_weights[own][:, own].toarray()
    assert_allclose(weights, flat.secondary_weights.toarray(), rtol=0, atol=tolerance)
    weights = thick.primary_weights[own][:, other].toarray()
    assert_allclose(weights, flat.primary_weights.toarray(), rtol=0, atol=tolerance)
    there = flat.paired
    assert_allclose(thick.gap[own][there], flat.gap[there], rtol=0, atol=of_gaps)
    assert_allclose(thick.normal[own][there][:, :2], flat.normal[there], rtol=0, atol=tolerance)
    for side in ("secondary_normal", "primary_normal"):
        ours, theirs = getattr(thick, side)[own][there], getattr(flat, side)[there]
        assert_allclose(ours[:, :2], theirs, rtol=0, atol=tolerance)
    return thick


def test_numbering_and_direction_do_not_matter():
    """The same interface with nodes and elements in another order, and turned: the same rows."""
    found = []
    for seed, place in ((None, None), (4, turned)):
        top = block("quad4", 4, 4, [1, 2], moved=3, seed=seed, place=place).surface("low")
        lines = [-0.1, 0.3, 0.9], [0.1, 0.6, 1.2]
        low = block("quad4", *lines, [0, 1], seed=seed, place=place).surface("up")
        pairing = dual_mortar(top, low)
        back = np.eye(3) if place is None else TURN
        order = [np.lexsort(np.round(s.points @ back, 9).T) for s in (top, low)]
        found.append(
            [
                pairing.area[order[0]],
                pairing.paired[order[0]],
                (pairing.normal @ back)[order[0]],
                pairing.secondary_weights.toarray()[order[0]][:, order[0]],
                pairing.primary_weights.toarray()[order[0]][:, order[1]],
            ]
        )
    for one, other in zip(*found, strict=True):
        assert_allclose(one, other, rtol=0, atol=1e-10)


def test_measure_weighs_the_areas():
    """A body with a ``measure``: areas are its integrals, here linear in x."""
    kwargs = {"measure": lambda x: 1 + x[0]}
    top = block("quad4", 4, 3, [1, 2], moved=1, **kwargs).surface("low")
    low = block("tri3", 3, 3, [0, 1]).surface("up")
    pairing = dual_mortar(top, low)
    assert_allclose(pairing.area, top.area, rtol=0, atol=1e-9)
    assert_allclose(pairing.area.sum(), 1.5, rtol=1e-9)


@every_face
@pytest.mark.every_value
@pytest.mark.parametrize("thick", [1, 3])
def test_kinks_are_found_and_curves_are_none(kind, thick):
    """A chamfer of 20 degrees turns by that at its edge alone; cylinders and spheres have no kinks."""

    def bent(x):
        return np.stack([x[0], x[1], x[2] - np.tan(np.radians(20)) * x[2] * np.maximum(x[0] - 0.5, 0)])

    def round_(x):
        angle, r = 1.2 * (x[0] - 0.5), 1 + x[2]
        return np.stack([r * np.sin(angle), x[1], r * np.cos(angle)])

    surface = block(kind, 4, thick, [0, 1], place=bent).surface("up")
    edge = np.isclose(surface.points[:, 0], 0.5)
    expected = np.where(edge, np.radians(20), 0.0)
    assert_allclose(surface.kinks, expected, rtol=0, atol=1e-7)
    for curved in (block(kind, 5, thick, [0, 1], place=round_), shell(kind, 4, 0.8, 1.0)):
        assert np.all(curved.surface("up").kinks == 0)


@pytest.mark.every_value
@pytest.mark.parametrize("seed", range(12))
def test_random_interfaces(seed):
    """Faces of all kinds and sizes, flat or bent, that cover each other anyhow: rows are means.

    On flat interfaces they hold the area that is covered, and points of both sides at one place.
    """
    rng = np.random.default_rng(seed)
    bend, turn = rng.choice([0.0, 0.0, 0.2, 0.6]), Rotation.random(random_state=seed).as_matrix()

    def place(x):
        y = x.copy()
        y[2] += bend * ((x[0] - 0.4) ** 2 - 0.5 * (x[1] - 0.6) * x[0])
        return turn @ y

    own, other = rng.choice(FACES, 2)
    numbers, size = rng.integers(1, 7, 4), 10 ** rng.uniform(-1, 0.5, 2)
    start, gap = rng.uniform(-0.6, 0.6, 2), rng.choice([0.0, 0.05, -0.02])
    lines = [np.linspace(a, a + b, n + 1) for a, b, n in zip(start, size, numbers[2:], strict=True)]
    moved = seed if min(numbers[:2]) > 1 and bend == 0 else None
    top = block(own, *map(int, numbers[:2]), [1 + gap, 2], moved=moved, place=place).surface("low")
    low = block(other, *lines, [0, 1], place=place).surface("up")
    pairing = dual_mortar(top, low)
    there = pairing.paired
    assert np.isfinite(pairing.gap[there]).all() and np.isfinite(pairing.normal).all()
    assert pairing.area.min() > 0
    for W in (pairing.secondary_weights, pairing.primary_weights):
        assert np.isfinite(W.data).all()
        assert_allclose(np.asarray(W.sum(axis=1)).ravel(), there, rtol=0, atol=1e-9)
    if bend:
        return
    sides = np.minimum(1, start + size) - np.maximum(0, start)
    area = np.prod(np.maximum(sides, 0))
    assert_allclose(pairing.area[there].sum(), area, rtol=0, atol=1e-8)
    away = pairing.secondary_weights @ top.points - pairing.primary_weights @ low.points
    expected = np.outer(there * gap, turn[:, 2])
    assert_allclose(away, expected, rtol=0, atol=1e-7)


# --- several layers, edges --------------------------------------------------------------------------


def layers(kind, heights, spans):
    """One body of blocks with their upper faces at heights, as one surface."""
    meshes = []
    for height, span in zip(heights, spans, strict=True):
        lines = np.linspace(*span, 4), np.linspace(-0.1, 1.1, 4)
        meshes.append(KINDS[kind][0].init_tensor(*lines, np.array([height - 0.2, height])))
    p = np.hstack([mesh.p for mesh in meshes])
    t = np.hstack([mesh.t + k * meshes[0].p.shape[1] for k, mesh in enumerate(meshes)])
    mesh = KINDS[kind][0](p, t)
    names = {"all": mesh.boundary_facets()}
    return body(mesh.with_boundaries(names), kind).surface("all")


@pytest.mark.parametrize("kind", ["tri3", "quad4"])
def test_the_nearest_of_two_layers_counts(kind):
    """A plate over two others, all of whose faces are given: the upper one, where it reaches."""
    top = block(kind, 5, 3, [1, 2]).surface("low")
    low = layers(kind, [0.9, 0.4], [(-0.1, 0.63), (0.31, 1.1)])
    pairing = dual_mortar(top, low)
    assert pairing.paired.all()
    assert_allclose(pairing.area.sum(), 1.0, rtol=ROUND_OFF)
    force = pairing.primary_weights.T @ pairing.area
    upper = np.isclose(low.points[:, 2], 0.9)
    assert_allclose(force[upper].sum(), 0.63, rtol=ROUND_OFF)
    assert_allclose(force[np.isclose(low.points[:, 2], 0.4)].sum(), 0.37, rtol=ROUND_OFF)


def test_at_a_sharp_edge_each_face_has_its_normal():
    """A block in a corner of two walls: nodes on its edge look along the covered face's normal."""
    mesh = block("quad4", 3, 3, np.linspace(0, 1, 4)).basis.mesh
    sides = mesh.facets_satisfying(lambda x: np.isclose(x[2], 0) | np.isclose(x[0], 0))
    both = body(mesh, "quad4").surface(sides)
    floor = block("quad4", np.linspace(-0.2, 1.2, 3), np.linspace(-0.2, 1.2, 4), [-1, 0]).surface("up")
    pairing = dual_mortar(both, floor)
    below = np.isclose(both.points[:, 2], 0)
    assert np.array_equal(pairing.paired, below)
    assert_allclose(pairing.normal[below], [[0, 0, 1]] * below.sum(), atol=ROUND_OFF)
    assert_allclose(pairing.area[below].sum(), 1.0, rtol=ROUND_OFF)


# --- curved interfaces ------------------------------------------------------------------------------


def shell(kind, n, inner, outer, turn=0.0):
    """Part of a spherical shell, n x n faces on both sides."""

    def place(x):
        d = onto_octant(np.stack([0.2 + 0.6 * x[0], 0.2 + 0.6 * x[1], np.ones_like(x[0])]))
        d = Rotation.from_rotvec([0, 0, turn]).as_matrix() @ (d / np.linalg.norm(d, axis=0))
        return (inner + (outer - inner) * x[2]) * d

    return block(kind, n, n, [0, 1], place=place)


@every_face
def test_matching_curved_faces_touch(kind):
    """Concentric shells with one mesh: rows of one node on one node, and no gap."""
    s, p = shell(kind, 3, 1.0, 1.2).surface("low"), shell(kind, 3, 0.8, 1.0).surface("up")
    pairing = dual_mortar(s, p)
    # the corners of cells of curved quadrilaterals are off their planes: round-off of the search
    assert_allclose(pairing.gap, 0.0, rtol=0, atol=1e-12)
    away = pairing.secondary_weights @ s.points - pairing.primary_weights @ p.points
    assert_allclose(away, 0.0, rtol=0, atol=1e-9)
    nearest = np.argmin(np.linalg.norm(s.points[:, None] - p.points, axis=2), axis=1)
    own = np.zeros(pairing.primary_weights.shape)
    own[np.arange(len(nearest)), nearest] = 1.0
    ours = np.linalg.solve(pairing.secondary_weights.toarray(), pairing.primary_weights.toarray())
    assert_allclose(ours, own, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "most"),
    [("tri3", 6e-3), ("quad4", 6e-3), ("tri6", 4e-4), ("quad8", 1e-5), ("quad9", 1e-5)],
)
def test_curved_faces_that_do_not_match(kind, most):
    """Nodal forces of a uniform pressure on shells: those of the faces, by an error of second order."""
    error = []
    for n in (4, 8):
        s = shell(kind, n, 1.0, 1.2).surface("low")
        p = shell(kind, n * 3 // 4, 0.8, 1.0).surface("up")
        pairing = dual_mortar(s, p)
        force = pairing.primary_weights.T @ np.where(pairing.paired, pairing.area, 0.0)
        inner = np.ones(len(p.points), dtype=bool)
        for facet, side in np.argwhere(p.neighbours < 0):
            inner[p.facets[facet][p.kind.edges[side]]] = False
        error.append(np.abs(force - p.area)[inner].max() / p.area.max())
        for W in (pairing.secondary_weights, pairing.primary_weights):
            total = np.asarray(W.sum(axis=1)).ravel()  # translations are exact on any surface
            assert_allclose(total[pairing.paired], 1.0, rtol=0, atol=ROUND_OFF)
    assert error[1] < most
    assert np.log2(error[0] / error[1]) > 1.5  # quadratic faces have not much more to gain at 1e-5


@pytest.mark.parametrize("kind", ["tri3", "quad4", "quad9"])
def test_curved_faces_far_apart_see_each_other_along_their_normals(kind):
    """A shell inside a much larger one: the normals fan out, and all of the inner one has partners."""
    s, p = shell(kind, 4, 0.9, 1.0).surface("up"), shell(kind, 5, 2.5, 2.6).surface("low")
    pairing = dual_mortar(s, p)
    inner = np.ones(len(s.points), dtype=bool)
    for facet, side in np.argwhere(s.neighbours < 0):
        inner[s.facets[facet][s.kind.edges[side]]] = False
    assert pairing.paired[inner].all()
    assert_allclose(pairing.gap[inner], 1.5, rtol=0, atol=0.03)  # chords of the larger shell
    # faces at the rim lack what lies between the chords of both rims
    assert_allclose(pairing.area[inner], nominal_areas(s)[inner], rtol=3e-3)


def nominal_areas(surface):
    """Areas of nodes whose faces are all covered."""
    return np.bincount(surface.facets.ravel(), whole_shares(surface).ravel(), len(surface.points))


def test_frames_are_those_of_the_loaded_interface():
    """Where one side is round the normal of a row stands between those of both sides."""

    def round_(x):
        angle, r = 0.8 * (x[0] - 0.5), 3 - x[2]
        return np.stack([r * np.sin(angle), x[1], 2 + r * np.cos(angle) - 4])

    top = block("quad4", 6, 2, [1, 2], place=lambda x: np.stack([x[0] - 0.5, x[1], x[2] + 0.5]))
    low = block("quad4", 5, 2, [1, 2], place=lambda x: round_(np.stack([x[0], x[1], 2 - x[2]])))
    contact = Contact(top.surface("low"), low.surface("up"))
    pairing = pair(contact)
    there = pairing.paired
    sides = pairing.secondary_normal[there], pairing.primary_normal[there]
    apart = [angle_between(pairing.normal[there], side) for side in sides]
    tilt = pairing.tilt[there]
    assert tilt.max() > 0.1
    assert_allclose(apart[0] + apart[1], tilt, rtol=0, atol=1e-9)
    assert np.all(np.maximum(*apart)[tilt > 0.01] < 0.99 * tilt[tilt > 0.01])


# --- supports ---------------------------------------------------------------------------------------


def clamped(kind, lines, z, at, **options):
    """A block whose nodes at given places are held, all components or one."""
    mesh = block(kind, *lines, z).basis.mesh
    component = options.pop("component", None)
    basis = fem.Basis(mesh, fem.ElementVector(KINDS[kind][2]()), intorder=2)
    dofs = np.flatnonzero(at(basis.doflocs))
    if component is not None:
        x, y, zed = (np.flatnonzero(part) for part in components(basis))
        dofs = np.intersect1d(dofs, (x, y, zed)[component])
    return body(mesh, kind, D=dofs, **options)


def components(basis):
    """Which DOFs are displacements along each axis, from those of a linear field."""
    found = []
    for k in range(3):
        unit = np.zeros(basis.N, dtype=bool)
        for table in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs):
            if table.size:
                unit[table[k::3].ravel()] = True
        found.append(unit)
    return found


@pytest.mark.parametrize(
    "kinds", [("quad4", "tri3"), ("tri6", "quad4"), ("quad8", "quad9"), ("tri3", "quad8")]
)
def test_held_nodes_have_no_multiplier(kinds):
    """Rows of nodes that are clamped go to their neighbours; what a uniform pressure does stays."""
    lines = (np.linspace(0, 1, 5), np.linspace(0, 1, 4))
    top = clamped(kinds[0], lines, [1, 2], lambda x: np.isclose(x[0], 0)).surface("low")
    low = block(kinds[1], 3, 3, [0, 1]).surface("up")
    free = dual_mortar(block(kinds[0], *lines, [1, 2]).surface("low"), low)
    pairing = dual_mortar(top, low)
    at_wall = np.isclose(top.points[:, 0], 0)
    assert not pairing.paired[at_wall].any() and pairing.paired[~at_wall].all()
    assert np.all(pairing.miss == 0)
    area = np.where(pairing.paired, pairing.area, 0.0)
    for weights in ("secondary_weights", "primary_weights"):
        force = getattr(free, weights).T @ free.area
        assert_allclose(getattr(pairing, weights).T @ area, force, rtol=0, atol=ROUND_OFF)
    # what is far from the wall has the rows it had
    far = top.points[:, 0] > 0.6
    for weights in ("secondary_weights", "primary_weights"):
        same = getattr(pairing, weights)[far].toarray(), getattr(free, weights)[far].toarray()
        assert_allclose(*same, rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize(
    "kinds", [("quad4", "quad4"), ("tri3", "quad9"), ("quad8", "tri3"), ("tri6", "tri6")]
)
def test_nodes_held_on_both_sides_meet_what_is_held(kinds):
    """Two blocks clamped on one wall: there rows hold nothing that moves, and all forces stay."""
    lines = (np.linspace(0, 1, 5), np.linspace(0, 1, 4))
    other = (np.linspace(0, 1, 4), np.linspace(0, 1, 5))
    bodies = [
        clamped(kind, own, z, lambda x: np.isclose(x[0], 0))
        for kind, own, z in zip(kinds, (lines, other), ([1, 2], [0, 1]), strict=True)
    ]
    top, low = bodies[0].surface("low"), bodies[1].surface("up")
    free = dual_mortar(
        block(kinds[0], *lines, [1, 2]).surface("low"), block(kinds[1], *other, [0, 1]).surface("up")
    )
    pairing = dual_mortar(top, low)
    at_wall = np.isclose(top.points[:, 0], 0)
    assert pairing.paired.all()
    moving = ~low.held.all(axis=1)
    assert np.abs(pairing.primary_weights[at_wall][:, moving]).max() < ROUND_OFF
    for weights in ("secondary_weights", "primary_weights"):
        force = getattr(free, weights).T @ free.area
        assert_allclose(getattr(pairing, weights).T @ pairing.area, force, rtol=0, atol=ROUND_OFF)
    away = pairing.secondary_weights @ top.points - pairing.primary_weights @ low.points
    assert_allclose(away, 0.0, rtol=0, atol=1e-10)


def test_kinks_are_those_of_the_undeformed_bodies():
    """Bent by strains, a chamfer of 3 degrees stays one: its row has the least gap in its support."""

    def chamfered(x):
        """The unit cube over z = 0 with the part beyond x = 0.5 of its lower side raised."""
        return np.stack([x[0], x[1], x[2] + (1 - x[2]) * 0.05 * np.maximum(x[0] - 0.5, 0.0)])

    high = body(cube("quad4", 4, chamfered), "quad4", name="high")
    low = body(
        cube("quad4", 3, lambda x: np.stack([1.2 * x[0] - 0.1, 1.2 * x[1] - 0.1, x[2] - 1])), "quad4"
    )
    foot = high.surface(lambda x: x[2] < 0.06)
    contact = Contact(foot, low.surface(at(2, 0.0)), sliding="finite")
    # from face to face by two thirds of the angle of the chamfer
    bend = np.zeros(high.n)
    up = high.dof_component == 2
    bend[up] = 0.05 / 0.75 * high.dof_points[up, 0] ** 2
    moved = bend, np.zeros(low.n)
    bent = foot.moved(bend)
    kinks = kink_angles(bent.points, bent.facets, bent.kind, bent.twins)
    assert foot.kinks.any() and bent.kinks is foot.kinks and not kinks.any()
    forgotten = replace(bent)
    vars(forgotten)["kinks"] = kinks
    known, lost = pair(contact, moved=moved), dual_mortar(forgotten, contact.primary)
    assert lost.least_gap is None and np.isfinite(known.least_gap).any()


def test_flanks_too_steep_to_face_are_not_met():
    """A ramp at 87 degrees between two flats under a plate: where it is nothing presses."""

    def place(x):
        return x * np.stack([1 + 0 * x[0], 1 + 0 * x[0], 1.0 + (x[0] > 0.525)])

    low = block("quad4", np.array([0.0, 0.5, 0.55, 1.0]), 2, [0, 1], place=place).surface("up")
    plate = block("quad4", 4, 3, [2.1, 3]).surface("low")
    pairing = dual_mortar(plate, low)
    assert_allclose(pairing.area[pairing.paired].sum(), 0.95, rtol=1e-9)


@every_face
def test_functions_that_multipliers_are_dual_to(kind):
    """They add up to one, and have the integrals that the module names, none of them negative."""
    B, (at, weight) = positive_functions(FACETS[kind]), FACETS[kind].quadrature(6)
    N = FACETS[kind].shapes(at)[0]
    assert_allclose(B.sum(axis=0), 1.0, rtol=0, atol=ROUND_OFF)
    share = B @ (weight @ N) / weight.sum()
    expected = {
        "tri3": (1 / 3,),
        "quad4": (1 / 4,),
        "tri6": (2 / 15, 3 / 15),
        "quad8": (1 / 20, 4 / 20),
        "quad9": (1 / 36, 4 / 36, 16 / 36),
    }[kind]
    c = FACETS[kind].corners
    counts = (c, c, 1)[: len(expected)]
    assert_allclose(share, np.repeat(expected, counts), rtol=ROUND_OFF)


def test_least_gap_over_a_kink():
    """A plate over a flat that goes on as a ramp at 20 degrees: the least under each row's faces."""
    slope, lines = np.tan(np.radians(20.0)), np.array([0.0, 0.25, 0.5, 0.75, 1.0])

    def place(x):
        return np.stack([x[0], x[1], x[2] - x[2] * slope * np.maximum(x[0] - 0.5, 0.0)])

    low = block("quad4", lines, 1, [0, 1], place=place).surface("up")
    plate = block("quad4", 5, 1, [1.2, 2]).surface("low")
    every = np.ones(plate.facets.shape, dtype=bool)
    least = least_gaps(segment(plate, low), every)
    x = plate.points[:, 0]
    near = np.maximum(x - 0.2, 0.0)  # where the faces of a node begin
    expected = 0.2 + slope * np.maximum(near - 0.5, 0.0)
    # faces of the plate between .2 and .8 meet those beside the kink
    assert_allclose(least, np.where(np.isfinite(least), expected, -np.inf), rtol=0, atol=1e-12)
    assert np.all(np.isfinite(least[(x > 0.3) & (x < 0.7)])) and np.isfinite(least[x > 0.75]).any()
