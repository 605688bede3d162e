"""Shapes that are none are refused wherever they lie, and those that are fine taken."""

from __future__ import annotations

import numpy as np
import pytest
import skfem as fem
from placed import everywhere
from quick_elasticity import linear_elasticity

import skfem_contact as sc

# -- outlines --------------------------------------------------------------------------------------

ARROW = [(0, 0), (2, 0), (2, 1), (1, 0.1), (0, 1)]  # its notch stays a tenth off the base
BOW = [(0, 0), (2, 2), (2, 0), (0, 2)]

REFUSED_OUTLINES = {
    "a point twice": ([(0, 0), (1, 0), (1, 0), (0, 1)], {}, "1 edges .* have no length"),
    "a bow tie": (BOW, {"closed": True}, r"crosses itself: the edge from point 0 .* from point 2"),
    "an open bow": (BOW, {}, r"crosses itself: the edge from point 0 .* from point 2"),
    "a spike through the base": (
        [(0, 0), (2, 0), (2, 1), (1, -0.1), (0, 1)],
        {"closed": True},
        "crosses itself",
    ),
    "the last edge crosses": ([(0, 0), (2, 0), (2, 1), (1, -0.2)], {}, "crosses itself"),
    # what touches does so to round-off: once turned and moved, a little to this side or that
    "the notch on the base": (
        [(0, 0), (2, 0), (2, 1), (1, 0), (0, 1)],
        {"closed": True},
        "crosses itself",
    ),
    "an open one that ends on its first edge": (
        [(0, 0), (2, 0), (2, 1), (0.7, 0)],
        {},
        "crosses itself",
    ),
    "an edge along another": (
        [(0, 0), (2, 0), (2, 1), (3, 1), (3, 0), (1, 0), (1, -1), (0, -1)],
        {"closed": True},
        "crosses itself",
    ),
    "corner on corner": (
        [(0, 0), (1, 0), (1, 1), (2, 1), (2, 2), (1, 1), (0, 1)],
        {"closed": True},
        "crosses itself",
    ),
    "there and back in short edges": (
        [(0, 0), (0.01, 0), (0.004, 0)],
        {},
        "goes back on itself at point 1",
    ),
    "there and back": ([(0, 0), (2, 0), (1, 0)], {}, "goes back on itself at point 1"),
    "back at the closing point": (
        [(1, 0), (2, 0), (2, 1), (0.5, 1), (0.5, 0.5), (3, -0.0)][:4] + [(3, -1), (3, 0)],
        {"closed": True},
        "crosses itself",
    ),
}
TAKEN_OUTLINES = {
    "an arrow": (ARROW, {"closed": True}),
    "an open arrow": (ARROW, {}),
    "clockwise": (ARROW[::-1], {"closed": True}),
    "hollow": (ARROW, {"closed": True, "hollow": True}),
    "straight on": ([(0, 0), (1, 0), (2, 0)], {}),
    "a notch that all but touches": ([(0, 0), (2, 0), (2, 1), (1, 1e-9), (0, 1)], {}),
    "parallel legs": ([(0, 1), (0, 0), (1, 0), (1, 1)], {}),
    "legs that would meet beyond their ends": ([(0, 1), (0.9, 0), (-1, 0), (-1, -1), (0, -2)], {}),
    "a spiral": ([(0, 0), (3, 0), (3, 3), (0.5, 3), (0.5, 1), (2, 1)], {}),
}


@everywhere
@pytest.mark.parametrize("case", REFUSED_OUTLINES)
def test_outlines_are_refused_everywhere(case, placed):
    """An outline that crosses or goes back on itself, or repeats a point, is refused in any place."""
    points, given, words = REFUSED_OUTLINES[case]
    with pytest.raises(sc.errors.InputError, match=words):
        sc.RigidPolyline(placed.points(points), **given)


@everywhere
@pytest.mark.parametrize("case", TAKEN_OUTLINES)
def test_outlines_are_taken_everywhere(case, placed):
    """An outline that comes near itself without touching is taken, and its inside is found."""
    points, given = TAKEN_OUTLINES[case]
    shape = sc.RigidPolyline(placed.points(points), **given)
    if given.get("closed"):
        x = placed.points([(1.0, 0.05), (1.0, 0.15)])  # under the notch of the arrow, and in it
        outside = -1 if given.get("hollow") else 1
        assert np.sign(shape.signed_distance(x)).tolist() == [-outside, outside]


# -- triangles -------------------------------------------------------------------------------------

TIP = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
SIDES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
SHEET = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
FOLDED = [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]
BESIDE = [*TIP, *(np.array(TIP) + [2.0, 0, 0])]
IN_IT = [*TIP, *(0.2 * np.array(TIP) + 0.1)]
OUTWARDS = [(a + 4, b + 4, c + 4) for a, b, c in SIDES]
INWARDS = [(a, c, b) for a, b, c in OUTWARDS]

REFUSED_TRIANGLES = {
    "a corner twice": (TIP, [*SIDES, (0, 1, 1)], "1 triangles .* have no area"),
    "a flat triangle": ([*TIP, (0.5, 0, 0)], [(0, 1, 4)], "1 triangles .* have no area"),
    "a corner given twice": ([*TIP, (1, 0, 0)], [(1, 4, 2)], "1 triangles .* have no area"),
    "a triangle twice": (TIP, [*SIDES, (1, 0, 2)], "1 triangles .* are given twice"),
    "unlike sides": (TIP, [*SIDES[:3], (0, 2, 3)], "two triangles look to opposite sides"),
    "three at an edge": ([*TIP, (1, 1, 1)], [*SIDES, (0, 1, 4)], "more than two triangles"),
    "no volume": (SHEET, FOLDED, "no volume"),
    "another inside out": (BESIDE, [*SIDES, *INWARDS], r"2 closed parts.*opposite side"),
}
TAKEN_TRIANGLES = {
    "a tip": (TIP, SIDES),
    "a tip listed inwards": (TIP, [t[::-1] for t in SIDES]),
    "with a rim": (TIP, SIDES[:3]),
    "two": (BESIDE, [*SIDES, *OUTWARDS]),
    "a cavity": (IN_IT, [*SIDES, *INWARDS]),
}


@everywhere
@pytest.mark.parametrize("case", REFUSED_TRIANGLES)
def test_triangles_are_refused_everywhere(case, placed):
    """Flat, repeated, crowded and inverted triangles are refused in any place."""
    points, triangles, words = REFUSED_TRIANGLES[case]
    with pytest.raises(sc.errors.InputError, match=words):
        sc.RigidSurface(placed.points(points), triangles)


@everywhere
@pytest.mark.parametrize("case", TAKEN_TRIANGLES)
def test_triangles_are_taken_everywhere(case, placed):
    """Closed parts, parts with a rim and cavities are taken, and the sides are where they were."""
    points, triangles = TAKEN_TRIANGLES[case]
    shape = sc.RigidSurface(placed.points(points), triangles)
    if case != "with a rim":
        deep, out = placed.points([(0.05, 0.3, 0.3), (0.6, 0.6, 0.6)])
        assert shape.signed_distance([deep])[0] < 0 < shape.signed_distance([out])[0]
    if case == "a cavity":
        assert shape.signed_distance(placed.points([(0.15, 0.15, 0.15)]))[0] > 0


# -- surfaces of meshes ----------------------------------------------------------------------------


def body(mesh, placed, name="part", **given):
    """A body on a mesh in its place; boundaries keep their names."""
    element = {2: fem.ElementQuad1, 3: fem.ElementHex1}[mesh.dim()]()
    basis = fem.Basis(placed.mesh(mesh), fem.ElementVector(element), intorder=2)
    return sc.Body(basis, linear_elasticity(), name=name, **given)


def with_sides(mesh, **where):
    """The mesh with boundaries that are named where it is described, not where it will lie."""
    return mesh.with_boundaries({**where, "all": lambda x: x[0] > -np.inf})


def square_without_a_side():
    p = np.array([[0.0, 1.0, 0.5, 0.5], [0.0, 0.0, 1.0, 1.0]])
    return with_sides(fem.MeshQuad(p, np.array([[0], [1], [2], [3]])))


def slit():
    """Two squares with a common line but nodes of their own."""
    low = fem.MeshQuad().refined(1)
    p, t = low.p, low.t
    mesh = fem.MeshQuad(np.hstack([p, p + [[0.0], [1.0]]]), np.hstack([t, t + p.shape[1]]))
    return with_sides(mesh, lips=lambda x: np.isclose(x[1], 1.0))


def cube_without_an_edge():
    mesh = fem.MeshHex.init_tensor([0, 1], [0, 1], [0, 1])
    p = mesh.p.copy()
    p[:, mesh.t[7]] = p[:, mesh.t[4]]
    return with_sides(fem.MeshHex(p, mesh.t))


def folded_cube():
    mesh = fem.MeshHex.init_tensor([0, 1], [0, 1], [0, 1])
    p = mesh.p.copy()
    p[:, mesh.t[7]] = [[1.0], [0.2], [0.2]]
    return with_sides(fem.MeshHex(p, mesh.t))


def crack():
    one = fem.MeshHex.init_tensor([0, 1], [0, 1], [0, 1])
    mesh = fem.MeshHex(np.hstack([one.p, one.p + [[1.0], [0], [0]]]), np.hstack([one.t, one.t + 8]))
    return with_sides(mesh, lips=lambda x: np.isclose(x[0], 1.0))


REFUSED_SURFACES = [
    (square_without_a_side, "all", "1 facets have no length"),
    (slit, "lips", "2 facets lie twice at the same place"),
    (cube_without_an_edge, "all", r"\d faces have no area"),
    (folded_cube, "all", "faces fold over"),
    (crack, "lips", "1 faces lie twice at the same place"),
]


@everywhere
@pytest.mark.parametrize(
    ("mesh", "side", "words"), REFUSED_SURFACES, ids=lambda v: getattr(v, "__name__", "")
)
def test_surfaces_are_refused_everywhere(mesh, side, words, placed):
    """Facets without extent, folded faces and both lips of a slit are refused in any place."""
    # what is wrong is the mesh: any symmetric K will do, for an element without area has none
    element = {2: fem.ElementQuad1, 3: fem.ElementHex1}[mesh().dim()]()
    with np.errstate(all="ignore"):
        basis = fem.Basis(placed.mesh(mesh()), fem.ElementVector(element), intorder=2)
    part = sc.Body(basis, fem.BilinearForm(lambda u, v, w: 0.0 * u[0] * v[0]).assemble(basis), name="p")
    with pytest.raises(sc.errors.InputError, match=words):
        part.surface(side)


def graded():
    """Facets of a thousandth of the body beside long ones."""
    x = np.array([0.0, 0.001, 0.002, 0.5, 1.0])
    return with_sides(fem.MeshQuad.init_tensor(x, np.linspace(0, 1, 3)))


@everywhere
def test_short_facets_are_taken_everywhere(placed):
    """A facet of a thousandth of the body has a length, and its normal looks outwards."""
    surface = body(graded(), placed).surface("all")
    lengths = surface.lengths / placed.unit
    # a move of a thousand sizes leaves 13 digits of a coordinate, 10 of the short facets
    assert np.isclose(lengths.min(), 1e-3, rtol=1e-9)
    assert np.isclose(lengths.sum(), 4.0, rtol=1e-9)


# -- pairs of sides --------------------------------------------------------------------------------


def blocks(dim, n, placed):
    """A table and a punch upon it, of size one; the second axis points up."""
    made = []
    for name, y, count in (("table", -1.0, 4), ("punch", 0.0, n)):
        grid = [np.linspace(0.0, 1.0, count + 1) for _ in range(dim)]
        grid[1] = grid[1] + y
        sides = {"left": (0, 0.0), "right": (0, 1.0), "bottom": (1, y), "top": (1, y + 1.0)}
        mesh = (
            {2: fem.MeshQuad, 3: fem.MeshHex}[dim]
            .init_tensor(*grid)
            .with_boundaries(
                {side: lambda x, i=i, at=at: np.isclose(x[i], at) for side, (i, at) in sides.items()}
            )
        )
        made.append(body(mesh, placed, name, D="bottom"))
    return made


LOOKS = {
    ("top", "bottom"): r"look away from each other",
    ("left", "right"): r"look away from each other",
    ("top", "top"): r"the two face the same way \(normals",
    ("left", "top"): r"the two do not face each other \(normals",
}


@everywhere
@pytest.mark.parametrize("settings", [{}, {"method": "node"}], ids=["mortar", "node"])
@pytest.mark.parametrize("dim", [2, 3])
def test_sides_that_can_not_meet_are_refused_everywhere(dim, settings, placed):
    """Sides that look the same way or away from each other are refused, those that meet are taken."""
    table, punch = blocks(dim, 3, placed)
    for (up, low), words in LOOKS.items():
        contact = sc.Contact(punch.surface(up), table.surface(low), **settings)
        with pytest.raises(sc.errors.InputError, match=rf"None of the \d+ points .*{words}"):
            sc.ContactSolver([table, punch], contact)
    contact = sc.Contact(punch.surface("bottom"), table.surface("top"), **settings)
    solver = sc.ContactSolver([table, punch], contact)
    assert solver.kin.paired.all()
    # the gaps are differences of coordinates that are up to a thousand sizes large
    assert np.abs(solver.kin.gap0).max() <= 1e-12 * placed.unit * max(1.0, placed.move)


@everywhere
def test_lines_the_wrong_way_round_are_refused_everywhere(placed):
    """An open polyline is solid on its left: the other way round nothing meets it."""
    table, _ = blocks(2, 3, placed)
    ends = placed.points([(-1.0, 0.0), (2.0, 0.0)])
    sc.ContactSolver([table], sc.Contact(table.surface("top"), sc.RigidPolyline(ends)))
    wrong = sc.Contact(table.surface("top"), sc.RigidPolyline(ends[::-1]))
    with pytest.raises(sc.errors.InputError, match="None of the 5 points"):
        sc.ContactSolver([table], wrong)


@everywhere
@pytest.mark.parametrize("dim", [2, 3])
def test_planes_the_wrong_way_round_are_refused_everywhere(dim, placed):
    """A plane whose normal looks along that of the surface has it inside, and is refused."""
    _, punch = blocks(dim, 3, placed)
    up = placed.vectors(np.eye(dim)[1])
    point = placed.points([np.zeros(dim)])[0]
    sc.ContactSolver([punch], sc.Contact(punch.surface("bottom"), sc.RigidPlane(point, up)))
    wrong = sc.Contact(punch.surface("bottom"), sc.RigidPlane(point, -up))
    with pytest.raises(sc.errors.InputError, match="look away from it"):
        sc.ContactSolver([punch], wrong)
