"""Curved bodies on straight facets that do not match, their gaps measured on the meshes themselves.

Press fits against Lame and against the same meshes with the gap told; gaps of two meshes of one
surface; balls in sockets; curved second-order rings.
"""

from __future__ import annotations

import sys
import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from scenes import ring_basis
from smooth_contacts import graded

sys.path.insert(0, str(Path(__file__).parent.parent))
from quick_elasticity import linear_elasticity
from skfem.models.elasticity import lame_parameters
from solid_meshes import as_eight_nodes, at, body, cube, elastic, octant_shell, onto_octant

import skfem_contact as sc
from skfem_contact.pairing import dual_mortar, node_to_segment
from skfem_contact.reference import lame_rings

R = 20.0
STEEL, ALUMINIUM = (210e3, 0.3), (70e3, 0.33)
SECOND = {"hex27": fem.ElementHex2, "hex20": fem.ElementHexS2}


def ring(d, inner, outer, n, material, name, kind=None, height=(1.0, 1, (0.0, 1.0))):
    """A quarter of a ring of radii inner to outer with n facets on its arcs, and its sides' names.

    `height`: of solids, with the number of layers, and the ends that are held along the axis.
    """
    layers = max(2, round(n * (outer - inner) / (np.pi / 2 * R)))
    radii, angles = np.linspace(inner, outer, layers + 1), np.linspace(0, np.pi / 2, n + 1)
    form = linear_elasticity(*lame_parameters(*material))
    if d == 2:
        basis = ring_basis(radii, angles)
        D = [basis.get_dofs("start").all("u^2"), basis.get_dofs("end").all("u^1")]
        return sc.Body(basis, form, D=np.concatenate(D), name=name)
    mesh = fem.MeshHex.init_tensor(radii, angles, np.linspace(0.0, height[0], height[1] + 1))
    mesh = fem.MeshHex2.from_mesh(mesh) if kind else mesh
    r, a, z = mesh.doflocs
    p = np.array([r * np.cos(a), r * np.sin(a), z])
    mesh = type(mesh)(as_eight_nodes(mesh, p) if kind == "hex20" else p, mesh.t)
    element = SECOND[kind]() if kind else fem.ElementHex1()
    basis = fem.Basis(mesh, fem.ElementVector(element), intorder=4 if kind else 2)
    D = []
    for axis, value in ((1, 0.0), (0, 0.0), *((2, end) for end in height[2])):
        side = mesh.facets_satisfying(at(axis, value), boundaries_only=True)
        D.append(basis.get_dofs(side).all(f"u^{axis + 1}"))
    return sc.Body(basis, form, D=np.unique(np.concatenate(D)), name=name)


def on_radius(solid, radius):
    """The facets whose corners are at a distance from the axis."""
    mesh = solid.basis.mesh
    facets = mesh.boundary_facets()
    corners = mesh.p[:2][:, mesh.facets[:, facets]]
    there = np.isclose(np.linalg.norm(corners, axis=0), radius, rtol=1e-9).all(axis=0)
    return solid.surface(facets[there], name="side")


@lru_cache
def press_fit(d, n, interference, swap=False, told=False, kind=None, **settings):
    """Error of the worst node's pressure against Lame, and how many points are open."""
    outer = R if told else R + interference
    shaft = ring(d, 10.0, outer, n[0], STEEL, "shaft", kind)
    hub = ring(d, R, 35.0, n[1], ALUMINIUM, "hub", kind)
    sides = on_radius(shaft, outer), on_radius(hub, R)
    given = {"gap": 0.0, "interference": interference} if told else {}
    contact = sc.Contact(*(sides[::-1] if swap else sides), **given, **settings)
    with warnings.catch_warnings():
        if min(n) <= 3:  # facets of 30 degrees: vertices stand in them by far more than what presses
            warnings.simplefilter("ignore", sc.ContactWarning)
        result = sc.ContactSolver([shaft, hub], [contact]).solve()
    exact = lame_rings(10, R, 35, STEEL, ALUMINIUM, interference=interference).pressure
    return np.abs(result.pressure / exact - 1).max(), np.count_nonzero(result.status == 0)


SIZES = [
    (3, 4),
    (4, 3),
    (12, 16),
    *(pytest.param(n, marks=pytest.mark.slow) for n in ((6, 8), (12, 47), (24, 32), (48, 64))),
]


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("d", [2, 3])
def test_press_fits(d, n, swap):
    """At most 1 %, or what the bodies leave with the gap told and half a percent; none open."""
    bound = max(0.01, press_fit(d, n, 1e-3 * R, swap, True)[0] + 0.005)
    for relative in (1e-5, 1e-3, 1e-2):
        worst, opened = press_fit(d, n, relative * R, swap)
        assert worst <= bound and not opened, relative


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_press_fits_node_by_node_and_with_finite_sliding(d, swap):
    """As with the gap told: nodes do not pass the patch test, and are off by 4 to 19 %."""
    for settings in ({"method": "node"}, {"sliding": "finite"}):
        bound = max(0.01, press_fit(d, (12, 16), 1e-3 * R, swap, True, method="node")[0] + 0.005)
        if "sliding" in settings:
            bound = 0.01
        worst, opened = press_fit(d, (12, 16), 1e-3 * R, swap, **settings)
        assert worst <= bound and not opened


@pytest.mark.parametrize("kind", SECOND)
@pytest.mark.parametrize("swap", [False, True])
def test_curved_second_order_rings(kind, swap):
    """Curved faces that do not match, 5 and 7 per quarter: below 1.5 %, or as with the gap told."""
    bound = max(0.015, press_fit(3, (5, 7), 1e-3 * R, swap, True, kind)[0] + 0.005)
    worst, opened = press_fit(3, (5, 7), 1e-3 * R, swap, False, kind)
    assert worst <= bound and not opened


def closed_ring(inner, outer, n, material, turned, held, angle=0.0, along=1):
    """A ring of hexahedra with n facets round it, held at a radius, which is turned by an angle."""
    layers = max(2, round(n * (outer - inner) / (2 * np.pi * R)))
    grid = fem.MeshHex.init_tensor(
        np.linspace(inner, outer, layers + 1), np.arange(n + 1.0), np.linspace(0.0, 2.0, along + 1)
    )
    r, place, z = grid.p
    _, first, same = np.unique(
        np.array([r, place % n, z]), axis=1, return_index=True, return_inverse=True
    )
    a = 2 * np.pi * place / n + turned
    p = np.array([r * np.cos(a), r * np.sin(a), z])[:, first]
    mesh = fem.MeshHex(p, same.ravel()[grid.t])
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    rim, ends = np.isclose(np.hypot(*mesh.p[:2]), held), np.isclose(mesh.p[2] * (2 - mesh.p[2]), 0)
    along, across, up = basis.nodal_dofs
    x = np.zeros(basis.N)
    x[along[rim]], x[across[rim]] = -angle * mesh.p[1, rim], angle * mesh.p[0, rim]
    D = np.concatenate([along[rim], across[rim], up[ends]])
    form = linear_elasticity(*lame_parameters(*material))
    return sc.Body(basis, form, D=D, x=x)


@pytest.mark.parametrize("swap", [False, True])
def test_torque_of_closed_rings(swap):
    """40 on 52 facets round a press fit that slips: within .2 % of the torque with the gap told."""
    torque = []
    for told in (False, True):
        outer = R if told else R + 0.02
        shaft = closed_ring(10.0, outer, 40, STEEL, 0.0, 10.0)
        hub = closed_ring(R, 35.0, 52, ALUMINIUM, 0.03, 35.0, 0.004)
        sides = on_radius(shaft, outer), on_radius(hub, R)
        given = {"gap": 0.0, "interference": 0.02} if told else {}
        contact = sc.Contact(*(sides[::-1] if swap else sides), friction=sc.Coulomb(0.2), **given)
        result = sc.ContactSolver([shaft, hub], [contact]).solve()
        assert np.all(result.status == 2)
        torque.append(result["contact 1"].moment((0.0, 0.0, 0.0))[2])
    assert torque[0] == pytest.approx(torque[1], rel=2e-3)


@pytest.mark.parametrize("swap", [False, True])
def test_nodes_at_held_ends_keep_their_partners(swap):
    """Rings whose layers along the axis do not match, node by node: finite sliding as small sliding.

    Pressures differ from layer to layer and tilt the faces at the ends, on planes of symmetry.
    """
    found = []
    for sliding in ("small", "finite"):
        shaft = closed_ring(10.0, R, 20, STEEL, 0.0, 10.0, along=2)
        hub = closed_ring(R, 35.0, 26, ALUMINIUM, 0.03, 35.0, along=3)
        sides = on_radius(shaft, R), on_radius(hub, R)
        contact = sc.Contact(
            *(sides[::-1] if swap else sides),
            gap=0.0,
            interference=0.02,
            method="node",
            sliding=sliding,
        )
        found.append(sc.ContactSolver([shaft, hub], [contact]).solve())
    small, finite = found
    assert (small.status != 0).all() and (finite.status != 0).all()
    # partners and normals turn by the interference over a facet, a hundredth of the smallest
    assert np.abs(finite.pressure - small.pressure).max() < 0.02 * small.pressure.max()


@pytest.mark.parametrize("layers", [(2, 2), (3, 3), (2, 3)])
@pytest.mark.parametrize("held", [(), (0.0,)])
@pytest.mark.parametrize("swap", [False, True])
def test_free_ends_that_strains_move_apart(layers, held, swap):
    """Flush ends of a press fit, free or on one side, node by node: finite sliding as small sliding.

    By Poisson's effect the ends of the shaft leave those of the hub by a thousandth of a facet; they
    lost all of their pressure without a word.
    """
    found = []
    for sliding in ("small", "finite"):
        shaft = ring(3, 10.0, R + 0.02, 14, STEEL, "shaft", height=(3.0, layers[0], held))
        hub = ring(3, R, 35.0, 10, ALUMINIUM, "hub", height=(3.0, layers[1], held))
        sides = on_radius(shaft, R + 0.02), on_radius(hub, R)
        contact = sc.Contact(*(sides[::-1] if swap else sides), method="node", sliding=sliding)
        with warnings.catch_warnings():  # nothing holds the shaft along the axis, nothing pushes it
            warnings.filterwarnings("ignore", ".*is indifferent")
            found.append(sc.ContactSolver([shaft, hub], [contact]).solve())
    small, finite = found
    assert not finite["contact 1"].lost.any()
    assert np.abs(finite.pressure - small.pressure).max() < 0.01 * small.pressure.max()


# -- gaps of two meshes of one surface ---------------------------------------------------------


def sphere(s, t, z):
    way = np.array([np.tan(s), np.tan(t), np.ones_like(s)])
    return way / np.linalg.norm(way, axis=0) * (1 + z)


def cylinder(s, t, z):
    return np.array([(1 + z) * np.cos(s), (1 + z) * np.sin(s), t])


def torus(s, t, z):
    out = 2 + (1 + z) * np.cos(t)
    return np.array([out * np.cos(s), out * np.sin(s), (1 + z) * np.sin(t)])


def plane(s, t, z):
    return np.array([s + 0.1 * t, t, z + 0.3 * s])


def renumbered(mesh, numbering):
    """The same mesh with its nodes in another order; 0 is the given one."""
    if not numbering:
        return mesh
    new = np.random.default_rng(numbering).permutation(mesh.nvertices)
    return type(mesh)(np.ascontiguousarray(mesh.p[:, np.argsort(new)]), new[mesh.t])


def patch(kind, n, place, up, seed, numbering=0):
    """The upper or the lower side of a plate of n x n faces on a surface, its nodes shaken along it."""
    rng = np.random.default_rng(seed)

    def put(x):
        s, t, z = x
        shake = 0.25 / n * rng.uniform(-1, 1, (2, len(s))) * (z > 0.5 if up else z < 0.5)
        s = s + shake[0] * ((s > 1e-9) & (s < 1 - 1e-9))
        t = t + shake[1] * ((t > 1e-9) & (t < 1 - 1e-9))
        return place(s - 0.5, t - 0.5, 0.3 * (z - 1 if up else z))

    plain = renumbered(cube(kind, n, layers=1), numbering)
    facets = plain.facets_satisfying(at(2, 1.0 if up else 0.0), boundaries_only=True)
    mesh = renumbered(cube(kind, n, put, layers=1), numbering)
    return body(mesh, kind).surface(facets, name="side")


def largest_gap(place, n, kinds=("tri3", "quad4"), pair=dual_mortar):
    sides = patch(kinds[0], n, place, True, 1), patch(kinds[1], n + n // 4 + 1, place, False, 2)
    pairing = pair(*sides)
    return np.abs(pairing.gap[pairing.paired]).max()


@pytest.mark.parametrize("pair", [dual_mortar, node_to_segment])
@pytest.mark.parametrize("kinds", [("tri3", "tri3"), ("quad4", "tri3"), ("quad4", "quad4")])
def test_two_meshes_of_one_surface(pair, kinds):
    """Spheres and cylinders are met exactly, and planes stay planes."""
    assert largest_gap(plane, 5, kinds, pair) < 1e-13
    for place in (sphere, cylinder):
        assert largest_gap(place, 5, kinds, pair) < 1e-11


@pytest.mark.parametrize("kinds", [("tri3", "quad4"), ("quad4", "quad4")])
def test_gaps_between_two_meshes_of_a_torus(kinds):
    """They fall with the third power of the size of the faces."""
    coarse, fine = (largest_gap(torus, n, kinds) for n in (4, 16))
    assert np.log2(coarse / fine) / 2 >= 2.8


def test_how_gaps_move_with_the_nodes_does_not_depend_on_their_numbers():
    """It was told from the first triangle of each piece, whichever that was: off by 8e-5."""
    upper, moved = patch("quad4", 3, torus, True, 1), []
    for numbering in range(3):
        lower = patch("tri3", 4, torus, False, 2, numbering)
        u = np.sin(lower.points @ np.array([[3.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 3.0, 1.0]]))
        moved.append(dual_mortar(upper, lower).primary_bulge @ u.ravel())
    assert np.abs(moved[0]).max() > 1e-3
    for other in moved[1:]:
        np.testing.assert_allclose(other, moved[0], rtol=0, atol=1e-12 * np.abs(moved[0]).max())


def test_heights_turn_with_the_faces():
    """A turn of the primary turns what smooth boundaries add to gaps, about its own normal too."""
    upper, lower = patch("quad4", 3, torus, True, 1), patch("tri3", 4, torus, False, 2)
    moves, x = dual_mortar(upper, lower).primary_bulge, lower.points
    added = (moves @ x.ravel()).reshape(-1, 3)  # as bodies that swell evenly keep their shape
    for axis in np.eye(3):
        turned = (moves @ np.cross(axis, x).ravel()).reshape(-1, 3)
        np.testing.assert_allclose(turned, np.cross(axis, added), atol=1e-12 * np.abs(added).max())


def test_a_fillet_is_exact_and_its_flats_are_flat():
    """A flat that passes into an arc of radius 1 where edges of both meshes lie."""

    def bent(s, t, z):
        angle = np.maximum(s, 0.0)
        return np.array(
            [
                np.where(s < 0, s, (1 + z) * np.sin(angle)),
                t,
                np.where(s < 0, 1 + z, (1 + z) * np.cos(angle)),
            ]
        )

    def side(n, up):
        plain = cube("quad4", n, layers=1)
        facets = plain.facets_satisfying(at(2, 1.0 if up else 0.0), boundaries_only=True)
        mesh = cube(
            "quad4",
            n,
            lambda x: bent(2 * x[0] - 1, x[1], 0.3 * (x[2] - 1 if up else x[2])),
            layers=1,
        )
        return body(mesh, "quad4").surface(facets, name="side")

    for pair in (dual_mortar, node_to_segment):
        pairing = pair(side(8, True), side(6, False))
        assert pairing.paired.all() and np.abs(pairing.gap).max() < 1e-10


# -- balls in sockets ---------------------------------------------------------------------------


def socket(kinds, n, swap, told):
    """A steel ball of radius 10 in a plastic socket with a clearance of 0.05, pressed in by 0.03."""
    clearance = 0.05
    ball_mesh = cube(kinds[0], n[0], lambda x: 10.0 * onto_octant(x))
    mesh = octant_shell(kinds[1], n[1], max(2, n[1] // 2), 10 + clearance, 20.0)
    mesh = type(mesh)(mesh.doflocs - np.array([[0.0], [0.0], [clearance]]), mesh.t)
    rollers = [(at(0, 0.0), (0,)), (at(1, 0.0), (1,))]

    def from_centre(x):
        return np.stack([x[0], x[1], x[2] + clearance])

    def rim(x):
        return np.linalg.norm(from_centre(x), axis=0) > 19.9

    foot = at(2, 0.0)
    held = ((foot, (2,)), *rollers)
    ball = elastic(ball_mesh, kinds[0], "ball", E=210e3, nu=0.3, held=held, push=(foot, (0, 0, 0.03)))
    cup = elastic(mesh, kinds[1], "cup", E=3e3, nu=0.4, held=((rim, (0, 1, 2)), *rollers))

    def side(solid, radius, centre):
        facets = solid.basis.mesh.boundary_facets()
        x = solid.basis.mesh.p[:, solid.basis.mesh.facets[:, facets]] - np.array(centre)[:, None, None]
        on = np.isclose(np.linalg.norm(x, axis=0), radius, atol=1e-6).all(axis=0)
        return solid.surface(facets[on], name="side")

    sides = side(ball, 10.0, (0, 0, 0)), side(cup, 10 + clearance, (0, 0, -clearance))

    def gap(x):  # along the normal of the secondary
        if not swap:
            return 10 + clearance - np.linalg.norm(from_centre(x), axis=0)
        y = from_centre(x)
        along = np.sum(x * y, axis=0) / np.linalg.norm(y, axis=0)
        return along - np.sqrt(along**2 - np.sum(x * x, axis=0) + 100.0)

    given = {"gap": gap} if told else {}
    contact = sc.Contact(*(sides[::-1] if swap else sides), **given)
    return sc.ContactSolver([ball, cup], [contact]).solve()


@pytest.mark.parametrize(
    ("kinds", "n", "swap", "bound"),
    [
        (("tri3", "quad4"), (4, 6), True, 0.01),
        pytest.param(("quad4", "quad4"), (4, 6), True, 0.01, marks=pytest.mark.slow),
        pytest.param(("tri3", "tri3"), (5, 3), True, 0.01, marks=pytest.mark.slow),
        pytest.param(("tri3", "quad4"), (4, 6), False, 0.01, marks=pytest.mark.slow),
    ],
)
def test_a_ball_in_a_socket(kinds, n, swap, bound):
    """The pressures of the same meshes with the gap told, tetrahedra in hexahedra too."""
    measured, told = (socket(kinds, n, swap, known) for known in (False, True))
    assert np.array_equal(measured.status == 0, told.status == 0)
    peak = told.pressure.max()
    assert np.abs(measured.pressure - told.pressure).max() <= bound * peak
    assert measured.force[2] == pytest.approx(told.force[2], rel=bound)


# -- Hertz: the difference of curvatures is all that counts ----------------------------------------


def bowed_block(n, radius, up, x=None, shift=0.37):
    """The side, an arc, of a block with n elements on the half width of contact 1."""
    depth, wide, fine = 12.0, 12.0, 1.6
    across, down = graded(1 / n, fine, wide), graded(1 / n, fine, depth)
    across = np.concatenate([-across[:0:-1], across]) + (0.0 if up else shift / n)
    mesh = fem.MeshQuad.init_tensor(across, down if up else -down[::-1])

    def rise(s):
        return 0.0 * s if np.isinf(radius) else radius - np.sqrt(radius**2 - s**2)

    p = mesh.p.copy()
    p[1] += rise(p[0]) * (1 - np.abs(p[1]) / depth)
    mesh = fem.MeshQuad(p, mesh.t)
    facets = mesh.boundary_facets()
    ends = mesh.p[:, mesh.facets[:, facets]]
    side = facets[np.isclose(ends[1], rise(ends[0]), atol=1e-9).all(axis=0)]
    basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()))
    far = basis.get_dofs(lambda y: np.isclose(y[1], depth if up else -depth))
    moved = np.zeros(basis.N)
    moved[far.all("u^2")] = 0.0 if x is None else x
    form = linear_elasticity(*lame_parameters(1.0, 0.3))
    return sc.Body(basis, form, D=far.all(), x=moved, name="upper" if up else "lower").surface(side)


def arc_in_hollow(radius, hollow, n=(8, 6)):
    """Pressures over Hertz' peak by place over the half width, at a half width of about 1."""
    relative, modulus = 1 / (1 / radius - 1 / hollow), 1 / (2 * (1 - 0.3**2))
    lower, load = bowed_block(n[1], hollow, False), np.pi / 4 * modulus / relative
    approach = 6 * load / np.pi / modulus
    for _ in range(4):
        upper = bowed_block(n[0], radius, True, -approach)
        result = sc.ContactSolver([upper.body, lower.body], [sc.Contact(upper, lower)]).solve()
        force = abs(result.force[1])
        approach *= (load / force) ** 0.85
    half = np.sqrt(4 * force * relative / np.pi / modulus)
    return result.points[:, 0] / half, result.pressure * np.pi * half / (2 * force)


def test_the_difference_of_curvatures_is_all_that_counts():
    """Equal bodies, an arc on a flat and in hollows of 3/2 and 6/5 of its radius: one error.

    It is that of 8 elements on the half width, 1.8 % of the peak; the three differ by .1 % of it.
    """
    errors = []
    for radius, hollow in ((200.0, np.inf), (200 / 3, 100.0), (200 / 6, 40.0)):
        place, share = arc_in_hollow(radius, hollow)
        inside = np.abs(place) < 0.8
        errors.append((share - np.sqrt(1 - np.minimum(np.abs(place), 1) ** 2))[inside])
        assert np.abs(errors[-1]).max() < 0.02
    for other in errors[1:]:
        assert np.abs(other - errors[0]).max() < 1e-3


@pytest.mark.parametrize("steps", [1, 4])
@pytest.mark.parametrize("half", [0.06, 0.015])
def test_friction_that_pressing_leaves(half, steps):
    """Equal bodies of one mesh: below the half width over the radius, in parts of mu times the peak.

    An arc and a flat are not mirror images: the two sides stretch differently by this order.
    """
    modulus = 1 / (2 * (1 - 0.3**2))
    upper, lower = bowed_block(8, 1 / half, True, -1.5 * half), bowed_block(8, np.inf, False, shift=0)
    contact = sc.Contact(upper, lower, friction=sc.Coulomb(0.3))
    solver = sc.ContactSolver([upper.body, lower.body], [contact])
    x = np.array(upper.body.x)
    *_, result = solver.history([{"x": {"upper": x * k / steps}} for k in range(1, steps + 1)])
    force = abs(result.force[1])
    a = np.sqrt(4 * force / half / np.pi / modulus)
    left = np.abs(result["contact 1"].friction_stress)[np.abs(result.points[:, 0]) < 0.8 * a]
    assert left.max() < half * 0.3 * 2 * force / np.pi / a


def test_coarse_facets_that_are_nearly_flat_keep_those_of_what_presses_them():
    """Heights are of the size of one's own: c is at most twice the curvature of the secondary."""
    hollow = bowed_block(1, 1000.0, False)
    ball = bowed_block(8, 20.0, True)
    facets, gap = (dual_mortar(side, ball).gap for side in (bowed_block(1, np.inf, False), hollow))
    there = np.isfinite(gap) & np.isfinite(facets) & (np.abs(hollow.points[:, 0]) < 1.5)
    own = 1.0 / (8 * 1000.0)  # height of its arc over a facet
    rise = np.where(there, hollow.points[:, 1], 0.0)
    assert np.abs(gap + rise - facets)[there].max() < 2 * own
