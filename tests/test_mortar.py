"""Dual mortar: exact integrals, the dual basis at cut facets, the patch test."""

from __future__ import annotations

from dataclasses import replace

import internals
import numpy as np
import pytest
import skfem as fem
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from numpy.testing import assert_allclose
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix
from skfem.models.elasticity import lame_parameters

from skfem_contact import Body
from skfem_contact.bodies import kind_of
from skfem_contact.conditions import carriers
from skfem_contact.errors import InputError
from skfem_contact.pairing import DualBasis, dual_basis, dual_mortar, segment

_on_parabola = internals.beside(segment, "_on_parabola")

ELEMENTS = {
    "P1": fem.ElementTriP1,
    "Q1": fem.ElementQuad1,
    "P2": fem.ElementTriP2,
    "Q2": fem.ElementQuad2,
    "S2": fem.ElementQuadS2,
}
FORM = linear_elasticity(*lame_parameters(1.0, 0.3))
ROUND_OFF = 1e-12  # of sums of tens of numbers of the order of one


def block(kind, x, y, *, slope=0.0, angle=0.0, scale=1.0, form=FORM, **kwargs):
    """Block over ``x`` times ``y``, sheared (y += slope x), turned, and scaled."""
    mesh = fem.MeshQuad.init_tensor(np.asarray(x, float), np.asarray(y, float))
    if kind.startswith("P"):
        mesh = mesh.to_meshtri()
    mesh = mesh.with_defaults()
    p = mesh.p.copy()
    p[1] += slope * p[0]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mesh = replace(mesh, doflocs=scale * turn @ p)
    return Body(fem.Basis(mesh, fem.ElementVector(ELEMENTS[kind]())), form, **kwargs)


def pair_of_blocks(kind, x_low, x_top, *, gap=0.0, both=None, **kwargs):
    low = block(kind, x_low, [0, 1], **kwargs)
    top = block(both or kind, x_top, np.array([1, 2]) + gap, **kwargs)
    return top.surface("bottom"), low.surface("top")


def arc(kind, radius, angles, thickness, *, outer, ahead=0.0):
    """Part of a ring whose contact face is at ``radius``, middle nodes turned ahead by an angle."""
    far = radius - thickness if outer else radius + thickness
    mesh = fem.MeshQuad.init_tensor(np.sort([radius, far]), np.asarray(angles, float))
    mesh = mesh.with_defaults()
    r, a = mesh.p
    mesh = replace(mesh, doflocs=np.stack([r * np.cos(a), r * np.sin(a)]))
    face = mesh.boundaries["right" if outer else "left"]
    if kind == "curved":
        mesh = fem.MeshQuad2.from_mesh(mesh)
        nodes = mesh.dofs.facet_dofs[0, face]
        p = mesh.doflocs.copy()
        p[:, nodes] *= radius / np.linalg.norm(p[:, nodes], axis=0)
        c, s = np.cos(ahead), np.sin(ahead)
        p[:, nodes] = np.array([[c, -s], [s, c]]) @ p[:, nodes]
        mesh = replace(mesh, doflocs=p)
    element = fem.ElementQuad1() if kind == "straight" else fem.ElementQuad2()
    body = Body(fem.Basis(mesh, fem.ElementVector(element)), FORM)
    return body.surface(face)


@pytest.mark.parametrize(
    ("coefficients", "zero"),
    [
        ((-0.3, 1.0), 0.3),  # straight
        ((-0.432, 1.0, 0.2), 0.4),
        ((-0.24, -0.2, 2.0), 0.4),  # falls at first, and rises from end to end
        ((0.24, 0.2, -2.0), 0.4),
        ((0.26, -0.8, 1.0), 0.4),  # is nowhere zero: its vertex
    ],
)
def test_where_the_normal_meets_a_quadratic_line(coefficients, zero):
    """Where it goes the way it goes from end to end, however far off the middle node is."""
    at_nodes = np.polynomial.polynomial.polyval(np.array([0.0, 1.0, 0.5]), coefficients)
    assert_allclose(_on_parabola(at_nodes), [zero], rtol=1e-6)


@pytest.mark.parametrize("ahead", [0.0, 0.03])
@pytest.mark.parametrize("both", [("curved", "curved"), ("curved", "straight"), ("straight", "curved")])
def test_pieces_of_curves_end_at_vertices(both, ahead):
    """Of the one side or of the other, where its normal line goes: between them all is smooth."""
    inner = arc(both[0], 1.0, np.linspace(0.3, 1.5, 6), 0.2, outer=True, ahead=ahead)
    outer = arc(both[1], 1.02, np.linspace(0.2, 1.6, 8), 0.2, outer=False, ahead=-ahead)
    for secondary, primary in ((inner, outer), (outer, inner)):
        pieces = segment(secondary, primary)
        ends = pieces.corners(np.arange(len(pieces.e)))
        off = [1 - np.abs(shape[..., :2]).max(axis=2) for shape in (ends.N, ends.M)]
        assert np.abs(np.minimum(*np.abs(off))).max() < ROUND_OFF
        assert (
            len(pieces.e) == len(secondary.facets) + len(primary.facets) - 1
        )  # the outer one is longer


def breaks(draw, lo=0.0, hi=1.0, most=5):
    """Random nodes of a line, no facet shorter than a twentieth of the mean."""
    sizes = np.array(draw(st.lists(st.floats(0.05, 1.0), min_size=1, max_size=most)))
    return lo + (hi - lo) * np.append(0.0, np.cumsum(sizes)) / sizes.sum()


@st.composite
def overlapping(draw):
    """Two lines of facets that overlap anyhow; the ends where the primary covers the secondary."""
    ends = sorted(draw(st.lists(st.floats(-1, 1), min_size=2, max_size=2, unique=True)))
    width = max(ends[1] - ends[0], 0.05)
    return breaks(draw), breaks(draw, ends[0] + 0.5, ends[0] + 0.5 + width)


def line_shapes(k):
    """Shape functions on [0, 1] as polynomials: start, end, middle."""
    s = Polynomial([0, 1])
    if k == 2:
        return [1 - s, s]
    return [(1 - s) * (1 - 2 * s), s * (2 * s - 1), 4 * s * (1 - s)]


def integral(polynomial, lo, hi):
    primitive = polynomial.integ()
    return primitive(hi) - primitive(lo)


def covered_integrals(surface, lo, hi):
    """``int N_i`` over the part lo < x < hi of a horizontal surface, by exact primitives."""
    out = np.zeros(len(surface.points))
    for nodes in surface.facets:
        start, end = surface.points[nodes[:2], 0]
        cut = np.clip((np.array([lo, hi]) - start) / (end - start), 0, 1)
        for node, N in zip(nodes, line_shapes(len(nodes)), strict=True):
            out[node] += abs(end - start) * integral(N, cut.min(), cut.max())
    return out


# --- the basis --------------------------------------------------------------------------------


def basis_of(mass, without=None):
    """Multipliers of lines of length one, given their mass matrices over what is covered."""
    k = mass.shape[-1]
    whole = np.broadcast_to([[0.5, 0.5], [1 / 6, 1 / 6, 4 / 6]][k - 2], mass.shape[:2])
    return dual_basis(kind_of(2, k), mass, whole, whole, without)


def alone(basis: DualBasis):
    """The same of one facet: A, share and S."""
    return basis.A[0], basis.share[0], basis.S[0]


@pytest.mark.parametrize("k", [2, 3])
@given(start=st.floats(0, 1), width=st.floats(0.001, 1))
@settings(max_examples=50, deadline=None)
def test_biorthogonality(k, start, width):
    """On any covered part ``int phi_i N_j`` is what i has of the share of j: its own, or as heir."""
    lo, hi = start * (1 - width), start * (1 - width) + width
    N = line_shapes(k)
    mass = np.array([[integral(a * b, lo, hi) for b in N] for a in N])
    A, share, S = alone(basis_of(mass[None]))
    phi = [sum(A[i, j] * N[j] for j in range(k)) for i in range(k)]
    D = np.array([[integral(p * n, lo, hi) for n in N] for p in phi])
    assert_allclose(S.sum(axis=0), 1.0, rtol=0, atol=ROUND_OFF)
    expected = S * share
    # the mass matrix of a third of a quadratic facet has condition 1e4
    assert_allclose(D, expected, rtol=0, atol=1e-11 * width)
    assert_allclose(share, [integral(n, lo, hi) for n in N], rtol=0, atol=ROUND_OFF)
    s = np.linspace(lo, hi, 5)
    assert_allclose(sum(p(s) for p in phi), 1.0, rtol=0, atol=1e-10)  # uniform pressure in the space


@pytest.mark.parametrize(("width", "multipliers"), [(0.30, 1), (0.36, 2)])
def test_two_multipliers_become_one_where_a_middle_third_is_covered(width, multipliers):
    """Where their weights would be those of the whole times the root of seven (WEIGHTS_KEPT)."""
    N, ends = line_shapes(2), (0.5 - width / 2, 0.5 + width / 2)
    A, _, _ = alone(basis_of(np.array([[[integral(a * b, *ends) for b in N] for a in N]])))
    assert np.linalg.matrix_rank(A) == multipliers


@pytest.mark.parametrize("k", [2, 3])
def test_whole_facet_has_textbook_basis(k):
    """Uncovered nothing: the dual basis of the literature, and nothing is merged."""
    N = line_shapes(k)
    mass = np.array([[integral(a * b, 0, 1) for b in N] for a in N])
    A, share, S = alone(basis_of(mass[None]))
    s = Polynomial([0, 1])
    phi = sum(A[0, j] * N[j] for j in range(k))
    if k == 2:
        assert_allclose(phi.coef, (2 - 3 * s).coef, rtol=0, atol=ROUND_OFF)
    assert_allclose(share, [0.5, 0.5] if k == 2 else [1 / 6, 1 / 6, 4 / 6], rtol=ROUND_OFF)
    assert_allclose(S, np.eye(k))


@pytest.mark.parametrize(("k", "bound"), [(2, 5), (3, 7)])
def test_weights_stay_bounded(k, bound):
    """However a facet is cut, ``int |phi_i| / int phi_i``, which bounds the weights, is small."""
    width, start = (a.ravel() for a in np.meshgrid(np.linspace(1e-3, 1, 100), np.linspace(0, 1, 30)))
    at, w = np.polynomial.legendre.leggauss(40)
    xi = (start * (1 - width))[:, None] + width[:, None] * 0.5 * (at + 1)
    N = np.stack([np.broadcast_to(f(xi), xi.shape) for f in line_shapes(k)], axis=2)
    weight = 0.5 * width[:, None] * w
    A = basis_of(np.einsum("fq,fqi,fqj->fij", weight, N, N)).A
    phi = np.einsum("fik,fqk->fqi", A, N)
    total, size = (np.einsum("fq,fqi->fi", weight, value) for value in (phi, np.abs(phi)))
    kept = np.abs(A).max(axis=2) > 0
    assert np.all(total[kept] > 0)
    # the kinks of |phi| lie between the 40 Gauss points: two digits
    assert (size[kept] / total[kept]).max() < 1.01 * bound


@pytest.mark.parametrize(
    ("k", "without"), [(2, (0,)), (2, (1,)), (3, (0,)), (3, (1,)), (3, (0, 1)), (3, (0, 2))]
)
def test_prescribed_nodes_have_no_multiplier(k, without):
    """Their part of the facet is in the row of the largest that is left, whatever its own share."""
    N = line_shapes(k)
    mass = np.array([[integral(a * b, 0, 1) for b in N] for a in N])
    held = np.isin(np.arange(k), without)
    A, share, S = alone(basis_of(mass[None], held[None]))
    left = [i for i in (2, 0, 1) if i < k and i not in without]  # by size
    heir = np.where(held, left[0], np.arange(k))
    assert_allclose(S, heir == np.arange(k)[:, None])
    D = A @ mass
    assert_allclose(D, np.where(heir == np.arange(k)[:, None], share, 0.0), atol=ROUND_OFF)
    assert_allclose(A.sum(axis=0), 1.0, atol=ROUND_OFF)  # uniform pressure in the space


# --- rows -------------------------------------------------------------------------------------


UNLIKE = [("Q1", "Q1"), ("Q2", "Q2"), ("Q1", "Q2"), ("P2", "Q1")]
FLAT = {"lines": overlapping(), "angle": st.floats(0, 6.3), "gap": st.floats(0, 0.3)}


@pytest.mark.parametrize("kind", ["Q1", "Q2"])
def test_half_covered_facets_are_the_same_however_they_are_turned(kind):
    """A surface that ends in the middle of a facet: the far node has a quarter of its share to keep."""
    areas = []
    for angle in np.linspace(0.0, 6.0, 13):
        sides = pair_of_blocks(kind, np.linspace(0.2, 1.8, 7), np.linspace(0, 2, 6), angle=angle)
        areas.append(dual_mortar(*sides).area)
    assert_allclose(areas, [areas[0]] * len(areas), rtol=0, atol=1e-12)
    # both ends of the half that is covered, 3/8 and 1/8 of the facet
    if kind == "Q1":
        assert_allclose(np.sort(areas[0]), [0.05, 0.05, 0.35, 0.35, 0.4, 0.4], rtol=1e-12)


@pytest.mark.parametrize("kinds", UNLIKE)
@given(**FLAT)
@settings(max_examples=8, deadline=None)
def test_rows_reproduce_linear_fields(kinds, lines, angle, gap):
    """Any flat overlap: rows sum to 1, agree on linear fields, areas add up to what is covered."""
    reproduce(kinds, lines, angle, gap)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", UNLIKE)
@given(**FLAT)
@settings(max_examples=50, deadline=None)
def test_rows_reproduce_linear_fields_on_many_meshes(kinds, lines, angle, gap):
    """The same over more of them."""
    reproduce(kinds, lines, angle, gap)


def reproduce(kinds, lines, angle, gap):
    """Check the rows of one flat overlap."""
    x_s, x_m = lines
    s, p = pair_of_blocks(kinds[0], x_m, x_s, gap=gap, angle=angle, both=kinds[1])
    pairing = dual_mortar(s, p)
    paired = pairing.paired
    covered = max(min(x_s[-1], x_m[-1]) - max(x_s[0], x_m[0]), 0.0)
    assert_allclose(pairing.area[paired].sum(), covered, rtol=0, atol=ROUND_OFF)
    if covered < 1e-8:
        return
    normal = np.array([-np.sin(angle), np.cos(angle)])
    # weights of cut rows are up to 20, on coordinates of the order 1, with inverses of masses
    tol = 1e-10
    for W, surface in ((pairing.secondary_weights, s), (pairing.primary_weights, p)):
        assert_allclose(np.asarray(W.sum(axis=1)).ravel()[paired], 1.0, rtol=0, atol=tol)
        assert W.shape == (len(s.points), len(surface.points))
    away = pairing.secondary_weights @ s.points - pairing.primary_weights @ p.points
    assert_allclose(away[paired], np.outer(np.full(paired.sum(), gap), normal), rtol=0, atol=tol)
    assert_allclose(pairing.gap[paired], gap, rtol=0, atol=tol)
    assert_allclose(pairing.normal[paired], np.tile(normal, (paired.sum(), 1)), rtol=0, atol=ROUND_OFF)
    assert np.all(np.isinf(pairing.gap[~paired])) and np.all(pairing.area > 0)
    assert np.all(pairing.facet[paired] >= 0)
    assert np.array_equal(pairing.miss > 0, ~paired)


SUPPORTED = [("Q1", "Q1"), ("Q2", "Q2"), ("P2", "Q1")]
HELD = {"lines": overlapping(), "data": st.data(), "angle": st.sampled_from([0.0, 0.4, np.pi / 2])}


@pytest.mark.parametrize("kinds", SUPPORTED)
@given(**HELD)
@settings(max_examples=8, deadline=None)
def test_rows_at_supports_reproduce_linear_fields(kinds, lines, data, angle):
    """Wherever nodes are prescribed, rows agree on linear fields and take all that is covered."""
    reproduce_at_supports(kinds, lines, data, angle)


@pytest.mark.slow
@pytest.mark.parametrize("kinds", SUPPORTED)
@given(**HELD)
@settings(max_examples=50, deadline=None)
def test_rows_at_many_supports_reproduce_linear_fields(kinds, lines, data, angle):
    """The same over more of them."""
    reproduce_at_supports(kinds, lines, data, angle)


@pytest.mark.parametrize(("x", "own"), [(0.4, False), (0.6, True)])
def test_a_primary_less_than_half_of_which_moves_is_held(x, own):
    """A clamped node over a facet whose end at 1 is clamped keeps a row beyond its middle.

    Which nothing closes (MOVING_SHARE); before, neighbours take what the free end at 0 can close.
    """

    secondary, primary = pair_of_blocks("Q1", [0.0, 1.0], [0.0, x, 1.0], gap=0.1)
    secondary, primary = clamped(secondary, x), clamped(primary, 1.0)
    assert dual_mortar(secondary, primary).paired[np.isclose(secondary.points[:, 0], x)] == own


@pytest.mark.parametrize(("beyond", "own"), [(0.18, True), (0.35, False)])
def test_a_primary_is_opposite_up_to_a_quarter_of_a_facet_beyond_its_end(beyond, own):
    """Both are clamped there, and the node keeps a row (OVERHANG); farther, neighbours take it."""
    secondary, primary = pair_of_blocks("Q1", [0.0, 1.0], [0.0, 0.5, 1.0 + beyond], gap=0.1)
    secondary, primary = clamped(secondary, 1.0 + beyond), clamped(primary, 1.0)
    assert dual_mortar(secondary, primary).paired[np.argmax(secondary.points[:, 0])] == own


def clamped(surface, place):
    """A surface whose node at a place is prescribed."""
    D = surface.dofs[np.isclose(surface.points[:, 0], place)].ravel()
    return Body(surface.body.basis, surface.body.K, D=D).surface(surface.mesh_facets)


def reproduce_at_supports(kinds, lines, data, angle):
    """Check the rows of one flat overlap, nodes of which are prescribed by chance."""
    x_s, x_m = lines

    def held(surface):
        parts = data.draw(st.lists(st.sampled_from([0, 0, 1, 2, 3]), min_size=30, max_size=30))
        parts = np.array((*parts, *([0] * len(surface.points))))[: len(surface.points)]
        D = np.concatenate([surface.dofs[parts & 1 > 0, 0], surface.dofs[parts & 2 > 0, 1]])
        body = Body(surface.body.basis, surface.body.K, D=D)
        return body.surface(surface.mesh_facets)

    s, p = map(held, pair_of_blocks(kinds[0], x_m, x_s, gap=0.1, angle=angle, both=kinds[1]))
    pairing = dual_mortar(s, p)
    paired = pairing.paired
    covered = max(min(x_s[-1], x_m[-1]) - max(x_s[0], x_m[0]), 0.0)
    assert_allclose(pairing.area[paired].sum(), covered, atol=ROUND_OFF)
    if covered < 1e-8:
        return
    normal = np.array([-np.sin(angle), np.cos(angle)])
    # a node that is held may end with a small share of a cut facet beside what it is handed
    tol = 1e-9
    weights = [(pairing.secondary_weights, pairing.primary_weights)]
    if pairing.slip_weights is not None:
        weights.append(pairing.slip_weights)
    for W_s, W_m in weights:
        for W in (W_s, W_m):
            assert_allclose(np.asarray(W.sum(axis=1)).ravel()[paired], 1.0, atol=tol)
        away = W_s @ s.points - W_m @ p.points
        assert_allclose(away[paired], np.outer(np.full(paired.sum(), 0.1), normal), atol=tol)
    # who has no row shows those of a point that has one, if anything opposite is covered
    heir = carriers(s, pairing)
    assert np.all(paired[heir] | (pairing.miss > 0))


@pytest.mark.parametrize("kind", ["Q1", "Q2", "S2", "P2"])
def test_matching_meshes_give_identity(kind):
    """Matching flat meshes: each node meets its twin and no other."""
    x = [0, 0.2, 0.5, 0.6, 1]
    s, p = pair_of_blocks(kind, x, x, angle=0.4)
    pairing = dual_mortar(s, p)
    twin = np.array([np.argmin(np.linalg.norm(p.points - at, axis=1)) for at in s.points])
    expected = np.zeros((len(twin), len(twin)))
    expected[np.arange(len(twin)), twin] = 1.0
    assert_allclose(pairing.primary_weights.toarray(), expected, rtol=0, atol=ROUND_OFF)
    assert_allclose(pairing.secondary_weights.toarray(), np.eye(len(twin)), rtol=0, atol=ROUND_OFF)
    assert_allclose(pairing.area, s.area, rtol=ROUND_OFF)


@pytest.mark.parametrize("kind", ["straight", "chord", "curved"])
@pytest.mark.parametrize("outer", [True, False])
def test_matching_curves_give_identity(kind, outer):
    """Matching rings: the twins meet along the radius with zero gap, whichever is secondary."""
    angles = np.linspace(0.1, 2.5, 9)
    s, p = (arc(kind, 2.0, angles, 0.5, outer=o) for o in (outer, not outer))
    pairing = dual_mortar(s, p)
    assert_allclose(pairing.gap, 0.0, atol=ROUND_OFF)
    assert_allclose(pairing.primary_weights @ p.points, s.points, rtol=0, atol=ROUND_OFF)
    assert abs(pairing.primary_weights).sum() == pytest.approx(len(s.points), rel=1e-10)
    radial = s.points / np.linalg.norm(s.points, axis=1, keepdims=True)
    inner = np.bincount(s.facets[:, :2].ravel(), minlength=len(s.points)) == 2
    direction = -1.0 if outer else 1.0
    assert_allclose(pairing.normal[inner], direction * radial[inner], rtol=0, atol=ROUND_OFF)


@pytest.mark.parametrize("kind", ["straight", "curved"])
def test_segments_against_ray_casting(kind):
    """Curved, apart, and not matching: the integrated gap is that of thousands of single rays."""
    s = arc(kind, 2.0, np.linspace(0.4, 2.2, 8), 0.5, outer=True)
    p = arc(kind, 2.2, np.linspace(0.5, 2.6, 12), 0.5, outer=False)
    pairing = dual_mortar(s, p)
    paired = pairing.paired
    k, n = s.facets.shape[1], 4000
    xi = (np.arange(n) + 0.5) / n
    N = np.stack([f(xi) for f in line_shapes(k)], axis=1)
    dN = np.stack([f.deriv()(xi) for f in line_shapes(k)], axis=1)
    fine = np.stack([f(np.linspace(0, 1, 401)) for f in line_shapes(k)], axis=1)
    curve = np.concatenate([fine @ p.points[facet] for facet in p.facets])
    total, covered = np.zeros(2), 0.0
    for facet, normals in zip(s.facets, s.facet_node_normals, strict=True):
        x, normal = N @ s.points[facet], N @ normals
        length = np.linalg.norm(dN @ s.points[facet], axis=1) / n
        for at, direction, weight in zip(x[::20], normal[::20], 20 * length[::20], strict=True):
            side = (curve - at) @ np.array([-direction[1], direction[0]])
            hit = np.flatnonzero((side[1:] * side[:-1] < 0) & ((curve[1:] - at) @ direction > 0))
            if len(hit):
                i, w = hit[0], side[hit[0]] / (side[hit[0]] - side[hit[0] + 1])
                total += weight * (at - (1 - w) * curve[i] - w * curve[i + 1])
                covered += weight
    area = pairing.area * paired
    away = pairing.secondary_weights @ s.points - pairing.primary_weights @ p.points
    # the covered end is found within one of 200 rays per facet
    assert_allclose(area.sum(), covered, rtol=1e-3)
    assert_allclose(area @ away, total, rtol=2e-3, atol=1e-3 * np.linalg.norm(total))


@pytest.mark.parametrize("kind", ["Q1", "Q2"])
def test_moved_rotated_scaled(kind):
    """Weights do not know about the place, the direction, or the unit of length."""
    x_s, x_m = np.linspace(0, 1, 4), np.linspace(0.15, 1.3, 6)
    reference = dual_mortar(*pair_of_blocks(kind, x_m, x_s, gap=0.1, slope=0.2))
    for angle in np.deg2rad([33, 90, 270]):
        for scale in (1e-6, 1e3):
            surfaces = pair_of_blocks(kind, x_m, x_s, gap=0.1, slope=0.2, angle=angle, scale=scale)
            turned = dual_mortar(*surfaces)
            for name in ("secondary_weights", "primary_weights"):
                change = getattr(turned, name) - getattr(reference, name)
                assert abs(change).max() < 1e-10
            assert_allclose(turned.gap, scale * reference.gap, rtol=1e-10)
            assert_allclose(turned.area, scale * reference.area, rtol=1e-10)
            assert np.array_equal(turned.paired, reference.paired)


# --- what meets what --------------------------------------------------------------------------


def test_surfaces_facing_the_same_way():
    """Two tops above each other do not meet; the report says that nothing was found."""
    low = block("Q1", [0, 1], [0, 1]).surface("top")
    high = block("Q1", [0, 0.5, 1], [1, 2]).surface("top")
    pairing = dual_mortar(high, low)
    assert not pairing.paired.any()
    assert np.all(np.isinf(pairing.gap)) and np.all(np.isinf(pairing.miss))
    assert np.all(pairing.facet == -1)
    assert pairing.primary_weights.nnz == 0 and pairing.primary_weights.shape == (3, 2)


def test_overhang_is_reported():
    """Points beside the primary miss it by their distance across the normal."""
    s, p = pair_of_blocks("Q1", [0, 1], np.linspace(0, 2, 5), gap=0.1)
    pairing = dual_mortar(s, p)
    beside = np.maximum(s.points[:, 0] - 1, 0)
    assert np.array_equal(pairing.paired, beside == 0)
    assert_allclose(pairing.miss, beside, rtol=0, atol=ROUND_OFF)
    assert np.all(pairing.facet == 0)


def test_reach():
    """Beyond `reach` nothing meets; within, the gap does not depend on it."""
    s, p = pair_of_blocks("Q1", [0, 0.3, 1], [0, 0.5, 1], gap=0.1)
    assert not dual_mortar(s, p, reach=0.09).paired.any()
    assert np.all(np.isinf(dual_mortar(s, p, reach=0.09).miss))
    assert_allclose(dual_mortar(s, p, reach=0.11).gap, dual_mortar(s, p).gap)
    for wrong in (-1.0, "near"):
        with pytest.raises(InputError, match=f"reach={wrong!r} is not a positive length"):
            dual_mortar(s, p, reach=wrong)


@pytest.mark.parametrize("depth, meets", [(0.48, True), (0.52, False)])
def test_overlaps_are_looked_for_as_deep_as_half_the_smaller_surface(depth, meets):
    """Of surfaces 1 and 3 long an overlap of 0.48 is one, of 0.52 the far side of a body."""
    s, p = pair_of_blocks("Q1", [-1, 2], [0, 0.5, 1], gap=-depth)
    assert np.all(dual_mortar(s, p).paired == meets)
    # gaps have no limit
    assert dual_mortar(*pair_of_blocks("Q1", [-1, 2], [0, 0.5, 1], gap=50.0)).paired.all()


def test_closest_layer_counts():
    """Of two layers below each other the nearer is met, at any spacing of the two meshes."""
    mesh = block("Q1", np.linspace(0, 1, 4), [0, 0.2, 0.5, 1]).basis.mesh
    keep = np.flatnonzero(np.abs(mesh.p[1, mesh.t].mean(axis=0) - 0.35) > 0.1)
    body = Body(fem.Basis(mesh.restrict(keep), fem.ElementVector(fem.ElementQuad1())), FORM)
    up = body.surface(lambda x: np.isclose(x[1], 1) | np.isclose(x[1], 0.2))
    down = block("Q1", np.linspace(0, 1, 6), [1.1, 2]).surface("bottom")
    pairing = dual_mortar(down, up)
    assert_allclose(pairing.gap, 0.1, rtol=1e-12)
    assert_allclose(pairing.area.sum(), 1.0)


def test_back_side_does_not_attract():
    """Whole boundaries: the bottom of a thin plate, facing away, is hidden behind its top."""
    plate = block("Q1", np.linspace(0, 1, 4), [0.9, 1.0]).surface(None)
    punch = block("Q1", np.linspace(0.2, 0.7, 4), [0.98, 2]).surface(None)
    pairing = dual_mortar(punch, plate)
    below = np.isclose(punch.points[:, 1], 0.98)
    assert np.array_equal(pairing.paired, below)
    assert_allclose(pairing.gap[below], -0.02, rtol=1e-10)


def test_far_side_is_no_overlap():
    """A body wholly behind the other does not overlap by its own height."""
    s, p = pair_of_blocks("Q1", [0, 0.5, 1], [0, 1], gap=-0.6)
    assert not dual_mortar(s, p).paired.any()
    assert dual_mortar(s, p, reach=0.7).paired.all()


@pytest.mark.parametrize("kinds", [("straight", "straight"), ("curved", "curved")])
def test_forces_and_moments_balance(kinds):
    """Forces of a ring on a ring cancel; moments too, as far as the gap vector is normal."""
    s = arc(kinds[0], 2.0, np.linspace(0.4, 2.2, 24), 0.5, outer=True)
    p = arc(kinds[1], 2.0, np.linspace(0.3, 2.6, 31), 0.5, outer=False)
    pairing = dual_mortar(s, p)
    force = pairing.area[:, None] * pairing.normal
    on_s = pairing.secondary_weights.T @ force
    on_p = -(pairing.primary_weights.T @ force)
    assert_allclose(on_s.sum(axis=0) + on_p.sum(axis=0), 0.0, atol=ROUND_OFF)
    moment = sum(
        np.sum(at.points[:, 0] * f[:, 1] - at.points[:, 1] * f[:, 0])
        for at, f in ((s, on_s), (p, on_p))
    )
    # lever arm: the gap of the facets' geometry times the turn of the normal over half a facet;
    # of radius 2 and unit pressure the moment could be of the order of 2 * 2 * 1.8
    assert abs(moment) < 2e-5


@pytest.mark.parametrize("kind", ["Q1", "Q2"])
def test_corner_takes_the_side_in_contact(kind):
    """A surface around the corner of a punch: the corner node keeps the normal of the bottom."""
    plate = block(kind, np.linspace(-1, 2, 8), [0, 1]).surface("top")
    punch = block(kind, np.linspace(0, 1, 4), [1.01, 1.5, 2]).surface(["bottom", "left", "right"])
    pairing = dual_mortar(punch, plate)
    below = np.isclose(punch.points[:, 1], 1.01)
    assert np.array_equal(pairing.paired, below)
    assert_allclose(pairing.normal[below], np.tile([0, 1.0], (below.sum(), 1)), rtol=0, atol=ROUND_OFF)
    assert_allclose(pairing.area[below].sum(), 1.0)


def test_tip_of_a_slit_does_not_meet_itself():
    """Two lips of one body share the node at the tip; all others meet, it does not."""
    mesh = fem.MeshQuad.init_tensor(np.linspace(0, 2, 7), np.linspace(0, 2, 7))
    x, y = mesh.p[:, mesh.t].mean(axis=1)
    mesh = mesh.restrict(np.flatnonzero((x < 1) | (y < 1)))
    p = mesh.p.copy()
    p[0] += 4 * np.maximum(p[1] - 1, 0)
    body = Body(fem.Basis(replace(mesh, doflocs=p), fem.ElementVector(fem.ElementQuad1())), FORM)
    lower = body.surface(lambda x: np.isclose(x[1], 1) & (x[0] > 1))
    upper = body.surface(lambda x: np.isclose(x[0], 1 + 4 * (x[1] - 1)) & (x[1] > 1))
    pairing = dual_mortar(lower, upper)
    tip = np.linalg.norm(lower.points - 1, axis=1) < 1e-12
    assert np.array_equal(pairing.paired, ~tip)
    assert np.all(pairing.gap[~tip] > 0)
    assert pairing.secondary_weights[np.flatnonzero(tip)].nnz == 0


def test_a_curve_and_faces_are_refused():
    """Surfaces of a plane body and of a solid do not meet: the error names both."""
    s, _ = pair_of_blocks("Q1", [0, 1], [0, 1])
    solid = fem.Basis(fem.MeshHex().with_defaults(), fem.ElementVector(fem.ElementHex1()))
    face = Body(solid, linear_elasticity(1.0, 1.0)).surface("top")
    for pair in ((s, face), (face, s)):
        with pytest.raises(
            InputError, match=r"(bottom' in 2-D.*top' in 3-D|top' in 3-D.*bottom' in 2-D)"
        ):
            dual_mortar(*pair)


# --- axis of symmetry -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["Q1", "Q2"])
def test_axisymmetric_weights(kind):
    """Areas are ``int N_i 2 pi r dr``; a quadratic node on the axis hands over its multiplier."""

    def measure(x):
        return 2 * np.pi * x[0]

    low = block(kind, [0, 0.4, 0.7, 1.1], [0, 1]).surface("top")
    top = block(kind, [0, 0.3, 1.0], [1, 2], measure=measure).surface("bottom")
    pairing = dual_mortar(top, low)
    axis = np.isclose(top.points[:, 0], 0)
    assert_allclose(pairing.area[pairing.paired].sum(), np.pi, rtol=ROUND_OFF)
    assert np.array_equal(pairing.paired, ~axis | (kind == "Q1"))
    assert np.all(pairing.area > 0)
    assert_allclose(pairing.area[pairing.paired], top.area[pairing.paired], rtol=1e-10)
    field = np.where(pairing.paired, top.points[:, 0] + 1, 0.0)[carriers(top, pairing)]
    nearest = np.argsort(top.points[:, 0])[1]
    expected = 1.0 if kind == "Q1" else top.points[nearest, 0] + 1
    assert_allclose(field[axis], expected)


# --- patch test -------------------------------------------------------------------------------


def traction_load(surface, stress):
    """Load of a uniform stress on all of a body's boundary but the contact surface."""
    body = surface.body

    def work(v, w):
        return sum(stress[i, j] * w.n[j] * v[i] for i in range(2) for j in range(2))

    mesh = body.basis.mesh
    # not by default tags: "right" holds the last facets of top and bottom if they are short
    rest = np.setdiff1d(mesh.boundary_facets(), surface.mesh_facets)
    return fem.LinearForm(work).assemble(fem.FacetBasis(mesh, body.basis.elem, facets=rest))


def normal_rows(body, surface, W, normal):
    """Rows ``normal . (W u)`` over the DOFs of a body, dense."""
    rows = np.zeros((len(normal), body.n))
    for component in range(2):
        spread = np.zeros((len(surface.points), body.n))
        spread[np.arange(len(surface.points)), surface.dofs[:, component]] = 1.0
        rows += normal[:, [component]] * (csr_matrix(W) @ spread)
    return rows


def held_together(s, p, pairing, f_s, f_p):
    """Displacements and forces with all paired points held along the normal: saddle point."""
    at = pairing.paired
    B = np.hstack(
        [
            normal_rows(s.body, s, pairing.secondary_weights, pairing.normal)[at],
            -normal_rows(p.body, p, pairing.primary_weights, pairing.normal)[at],
        ]
    )
    n_s, n = s.body.n, s.body.n + p.body.n
    K = np.zeros((n, n))
    K[:n_s, :n_s], K[n_s:, n_s:] = s.body.K.toarray(), p.body.K.toarray()
    saddle = np.block([[K, -B.T], [B, np.zeros((len(B), len(B)))]])
    rhs = np.concatenate([f_s, f_p, np.zeros(len(B))])
    # free bodies in equilibrium: any rigid motion may be added, the forces are unique
    solution = np.linalg.lstsq(saddle, rhs, rcond=1e-12)[0]
    assert_allclose(saddle @ solution, rhs, rtol=0, atol=1e-9 * np.abs(rhs).max())  # equilibrium exists
    return solution[:n], solution[n:] / pairing.area[at]


@pytest.mark.parametrize("kind", ["P1", "Q1", "P2", "Q2", "S2"])
@given(data=st.data(), slope=st.floats(-0.6, 0.6), angle=st.floats(0, 6.3))
@settings(max_examples=12, deadline=None)
def test_patch_test(kind, data, slope, angle):
    """Blocks on an inclined interface, meshes not matching: a uniform pressure is uniform."""
    x_low, x_top = breaks(data.draw, most=4), breaks(data.draw, most=4)
    s, p = pair_of_blocks(kind, x_low, x_top, slope=slope, angle=angle)
    pairing = dual_mortar(s, p)
    pressure, normal = 0.7, pairing.normal[0]
    stress = -pressure * np.outer(normal, normal)
    f_s, f_p = traction_load(s, stress), traction_load(p, stress)
    _, found = held_together(s, p, pairing, f_s, f_p)
    assert pairing.paired.all()
    assert_allclose(found, pressure, rtol=1e-9)


@pytest.mark.every_value
@pytest.mark.parametrize("kind", ["P1", "Q1", "P2", "Q2", "S2"])
@pytest.mark.parametrize(
    ("x_low", "x_top"),
    [
        ((0, 0.4, 1), (0, 0.3, 0.6, 1.2)),  # secondary longer: two thirds of a facet covered
        ((0, 0.4, 1), (0, 0.3, 0.95, 1.5)),  # a tenth covered
        ((0, 0.4, 1), (0, 0.3, 0.9999999, 1.5)),  # a sliver covered
        ((0, 0.4, 1.3), (0, 0.3, 0.6, 1)),  # primary longer
        ((0.2, 0.5, 1.4), (0, 0.3, 0.6, 1)),  # both overhang
        ((0.2, 0.4, 0.5), (0, 1)),  # the whole primary within one facet
    ],
)
def test_patch_test_with_overhang(kind, x_low, x_top):
    """Pressure on what is not covered, contact on the rest: the contact pressure is the same."""
    s, p = pair_of_blocks(kind, x_low, x_top)
    pairing = dual_mortar(s, p)
    pressure = 0.7
    stress = np.array([[0, 0], [0, -pressure]])
    f_s, f_p = traction_load(s, stress), traction_load(p, stress)
    lo, hi = max(x_low[0], x_top[0]), min(x_low[-1], x_top[-1])
    for surface, f, sign in ((s, f_s, 1.0), (p, f_p, -1.0)):
        f[surface.dofs[:, 1]] += sign * pressure * (surface.area - covered_integrals(surface, lo, hi))
    u, found = held_together(s, p, pairing, f_s, f_p)
    assert_allclose(found, pressure, rtol=1e-9)
    # the uniform state is there in the displacements too: twice the energy of plane strain
    for body, at in ((s.body, slice(0, s.body.n)), (p.body, slice(s.body.n, None))):
        energy = u[at] @ body.K @ u[at]
        width = np.ptp(body.basis.mesh.p[0])
        assert energy == pytest.approx(pressure**2 * (1 - 0.3**2) * width, rel=1e-8)


@pytest.mark.parametrize("kind", ["P2", "Q2", "S2"])
def test_quadratic_bodies_carry_linear_pressure(kind):
    """Bending across meshes that do not match: all nodal pressures lie on the line."""
    form = linear_elasticity(0.0, 0.5)  # E = 1, nu = 0: u_y = -p(x) y is exact with quadratics
    s, p = pair_of_blocks(kind, [0, 0.35, 0.5, 1], [0, 0.2, 0.6, 0.7, 1], form=form)
    pairing = dual_mortar(s, p)

    def load(body, name):
        def work(v, w):
            return -(1 + 2 * w.x[0]) * w.n[1] * v[1]

        facets = fem.FacetBasis(body.basis.mesh, body.basis.elem, facets=name)
        return fem.LinearForm(work).assemble(facets)

    _, found = held_together(s, p, pairing, load(s.body, "top"), load(p.body, "bottom"))
    assert_allclose(found, 1 + 2 * s.points[:, 0], rtol=1e-9)


def test_merging_is_what_keeps_cut_quadratics_positive(monkeypatch):
    """Without merging a quadratic facet, three quarters covered, has a negative area."""
    s, p = pair_of_blocks("Q2", [0, 1], [0, 0.8, 1.2])
    assert np.all(dual_mortar(s, p).area > 0)
    internals.replace(monkeypatch, "pairing.SHARE_KEPT", -np.inf)
    pairing = dual_mortar(s, p)
    assert not pairing.paired.all()
    assert pairing.area[pairing.paired].sum() > 0.8  # what is left adds up to more than is covered
