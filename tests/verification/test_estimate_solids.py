"""The error estimate of faces of solids against closed forms."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).parent.parent.parent
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "benchmarks")]
import effectivity_solids  # noqa: E402
import internals  # noqa: E402
from solid_meshes import at, body, cube, elastic, shuffled  # noqa: E402
from statuses import OPEN, SLIP, STICK  # noqa: E402

import skfem_contact as sc  # noqa: E402
from skfem_contact.answers import Net  # noqa: E402

_between = internals.beside(Net, "between")
_near_ends = internals.beside(Net, "near_ends")
_scatter = internals.beside(Net, "scatter")
_sharp = internals.beside(Net, "sharp")

PROBLEMS = dict(effectivity_solids.problems())
FEW = "H2 rigid sphere, hexahedra, 4 per radius"
QUICK = (FEW, "Press fit of rings, 20-node, 5 on 7", "Press fit of rings, 8-node, 12 on 16")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in PROBLEMS]
)
def test_effectivity(name):
    """Within a factor of three; of five, where only nine points are off the ends of the surface."""
    result, pressure, friction = PROBLEMS[name]()
    true = effectivity_solids.true_errors(result, pressure, friction)
    estimate = result.values[0].error_estimate
    for part, exact in zip((estimate.pressure, estimate.traction), true, strict=True):
        assert part.missing == ()
        assert part.total / exact < 3.0
        assert part.total / exact > (0.2 if "8 on 5" in name else 0.3)
    assert estimate.unrated == ""
    if not (name.startswith("Ball") or "8-node" in name):  # of these the bodies' part may be all
        assert_allclose(estimate.indicator.sum(), 1.0)
    if name == FEW:  # measured .95: no part counts twice, none is left out
        assert estimate.pressure.total / true[0] == pytest.approx(0.95, abs=0.05)
        assert estimate.pressure.facets == pytest.approx(0.0187, rel=0.1)


def test_what_can_not_be_estimated():
    """A ball on four nodes: the number is there, and what is printed says that it is none to go by."""
    estimate = effectivity_solids.ball("quad9", 5, 0.12)[0].error_estimate
    assert 0.3 < estimate.pressure.total < 0.4  # true: .30
    assert "more than 30 %, beyond what can be estimated" in str(estimate)
    fine = effectivity_solids.ball("quad9", 7, 0.12)[0]
    assert fine.error_estimate.pressure.total < 0.3  # true: .18
    assert "pressure 17 % in L2" in fine.report() and "beyond" not in str(fine.error_estimate)


def test_the_end_of_a_surface_is_an_edge():
    """A block narrower than the one it is pressed on: most of the error is at its rim."""
    low = elastic(cube("quad4", 3), "quad4", "low", held=((at(2, 0.0), (0, 1, 2)),))
    narrow = cube("quad4", 4, lambda x: 0.6 * x + np.array([[0.2], [0.17], [1.0]]))
    top = at(2, 1.6)
    high = elastic(narrow, "quad4", "high", held=((top, (0, 1, 2)),), push=(top, (0.0, 0.0, -0.01)))
    sides = high.surface(at(2, 1.0)), low.surface(at(2, 1.0))
    estimate = sc.ContactSolver([high, low], sc.Contact(*sides)).solve().error_estimate
    assert estimate.pressure.largest == "edges" and estimate.pressure.edges > 0.05
    assert "at the end of high/surface" in estimate.advice


@pytest.mark.parametrize("narrow_first", [True, False])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_no_mesh_resolves_a_sharp_edge_of_either_side(narrow_first, mu):
    """Whichever side is the secondary, and where sticking ends beside the edge."""
    low = elastic(cube("quad4", 8), "quad4", "low", held=((at(2, 0.0), (0, 1, 2)),))
    narrow = cube("quad4", 6, lambda x: 0.6 * x + np.array([[0.2], [0.17], [1.0]]))
    top = at(2, 1.6)
    push = top, (0.002, 0.0, -0.01)
    high = elastic(narrow, "quad4", "high", held=((top, (0, 1, 2)),), push=push)
    sides = high.surface(at(2, 1.0)), low.surface(at(2, 1.0))
    sides = sides if narrow_first else sides[::-1]
    law = sc.Coulomb(mu) if mu else None
    contact = sc.Contact(*sides, friction=law, method="mortar")
    estimate = sc.ContactSolver([high, low], contact).solve().error_estimate
    assert estimate.traction.largest == "edges"
    assert "at a sharp edge stress has no bound" in estimate.advice
    assert "half the error" not in estimate.advice
    where = "at the end of high/surface" if narrow_first else "where high/surface ends"
    assert where in estimate.advice


STRIP = np.linspace(0, 1, 3)
HEXES = {1: fem.ElementHex1(), 2: fem.ElementHex2()}


def brick(name, along, up, order=1, **given):
    """A strip that is two elements thick, its side z = 0 on a plane of symmetry."""
    mesh = fem.MeshHex.init_tensor(along, up, STRIP).with_boundaries(
        {
            "low": lambda p: np.isclose(p[1], up[0]),
            "high": lambda p: np.isclose(p[1], up[-1]),
            "end": lambda p: np.isclose(p[0], along[0]),
            "middle": lambda p: np.isclose(p[2], 0),
            "load": lambda p: np.isclose(p[1], up[-1]) & (p[0] <= along[0] + 1),
        }
    )
    given = {"E": 1e3, **given}
    law = sc.Elastic(given.pop("E"), 0.3)
    return sc.Body.from_mesh(mesh, fem.ElementVector(HEXES[order]), law, name=name, **given)


def arc_of_contact():
    """Blocks that are flush at all sides, with a gap that opens along them: as a pin in a lug."""
    x = np.linspace(0, 4, 17)
    up = brick("up", x, [0, 1, 2], D=["high", {"end": "x", "middle": "z"}], x={"high": (0, -0.02, 0)})
    low = brick("low", x, [-2, -1, 0], D=["low", {"end": "x", "middle": "z"}])
    return [up, low], sc.Contact(up.surface("low"), low.surface("high"), gap=lambda p: 0.01 * p[0] ** 2)


def beam_that_lifts_off():
    """Half a beam on a soft bed, both of one width, under a force in its middle."""
    x = np.linspace(0, 20, 41)
    beam = brick("beam", x, [0, 1], 2, f={"load": (0, -1, 0)}, D={"end": "x", "middle": "z"}, E=2e5)
    bed = brick("bed", x, [-0.1, 0], D="low", E=5)
    return [beam, bed], sc.Contact(bed.surface("high"), beam.surface("low"))


def bar_on_a_roller():
    """One node across touches, and both sides of the bar end on the roller."""
    down = {"high": (0, -1e-3, 0)}
    bar = brick("bar", np.linspace(-4, 4, 9), [0, 1], 2, D="high", x=down)
    return [bar], sc.Contact(bar.surface("low"), sc.RigidCylinder((0, -4, 0), 4, axis=(0, 0, 1)))


def strip_of_a_punch(narrow_first=True):
    """Narrower than what it stands on along the strip alone."""
    up = brick(
        "up", np.linspace(0, 2, 9), [0, 1, 2], D=["high", {"middle": "z"}], x={"high": (0, -0.01, 0)}
    )
    low = brick("low", np.linspace(-2, 4, 25), [-3, -2, -1, 0], D=["low", {"middle": "z"}])
    sides = up.surface("low"), low.surface("high")
    return [up, low], sc.Contact(*sides[:: 1 if narrow_first else -1], method="mortar")


def block_stuck_to_a_floor():
    """What is rigid goes on past the block, and holds its edge."""
    block = brick(
        "block", np.linspace(0, 2, 9), [0, 1, 2], D=["high", {"middle": "z"}], x={"high": (0, -0.01, 0)}
    )
    floor = sc.RigidPlane((0, 0, 0), (0, 1, 0))
    return [block], sc.Contact(block.surface("low"), floor, friction=sc.Coulomb(0.9))


@pytest.mark.filterwarnings("ignore:.*contact is about as small as a facet")
@pytest.mark.parametrize(
    ("made", "sharp"),
    [
        (arc_of_contact, ""),
        (beam_that_lifts_off, ""),
        (bar_on_a_roller, ""),
        (strip_of_a_punch, "at the end of up/low"),
        (lambda: strip_of_a_punch(False), "where up/low ends"),
        (block_stuck_to_a_floor, "at the end of block/low"),
    ],
)
def test_a_sharp_edge_is_one_that_presses_on_what_goes_on(made, sharp):
    """Not the sides of strips that end flush or by symmetry, nor where contact ends by itself."""
    bodies, contact = made()
    estimate = sc.ContactSolver(bodies, contact).solve().error_estimate
    assert estimate.traction.largest == "edges"
    assert ("no bound" in estimate.advice) == bool(sharp)
    assert (sharp or "where contact or sticking ends") in estimate.advice


def test_where_contact_ends_by_itself_smaller_faces_help():
    """Under a ball the zone of contact ends far from all ends of the surfaces."""
    result, _, _ = PROBLEMS[FEW]()
    advice = result.error_estimate.advice
    assert "sharp edge" not in advice


def moved(kind, n):
    """The top of a cube whose nodes inside are moved along it."""

    def place(x):
        y, w = x.copy(), np.prod(np.sin(np.pi * x[:2]) ** 2, axis=0)
        y[0] += 0.15 * w * np.sin(7 * x[1])
        y[1] += 0.1 * w * np.cos(5 * x[0])
        return y

    mesh = shuffled(cube(kind, n, place))
    surface = body(mesh, kind).surface(at(2, 1.0))
    return surface, Net(surface, np.ones(len(surface.points), dtype=bool))


@pytest.mark.parametrize("kind", ["quad4", "tri3"])
def test_neighbours_tell_planes_and_parabolas(kind):
    """Of what is linear nothing is left; second derivatives of parabolas are theirs, on any mesh."""
    surface, net = moved(kind, 6)
    x, y, _ = surface.points.T
    assert np.abs(net.misfit(np.column_stack([2 * x - 3 * y + 1, y]))).max() < 1e-12
    H = net.curvatures(np.column_stack([x**2 + 3 * x * y - 2 * y**2 + x, 5 * y]))
    exact = np.zeros((3, 3, 2))
    exact[:2, :2, 0] = [[2.0, 3.0], [3.0, -4.0]]
    # sums over a dozen points, times the number of elements squared
    assert_allclose(H, np.broadcast_to(exact, H.shape), rtol=0, atol=1e-9)


@pytest.mark.parametrize("n", [5, 8])
def test_parabolas_between_nodes(n):
    """Bilinear interpolation of a x^2 + b y^2 on squares of h: h^4 (a^2 + b^2) / 30 + h^4 a b / 18."""
    surface = body(cube("quad4", n), "quad4").surface(at(2, 1.0))
    net = Net(surface, np.ones(len(surface.points), dtype=bool))
    a, b = 2.0, -0.7
    field = (surface.points[:, :2] ** 2) @ np.array([a, b])
    found = _between(surface, net, np.ones(n * n, dtype=bool), field[:, None]).sum()
    assert found == pytest.approx(((a**2 + b**2) / 30 + a * b / 18) / n**4, rel=1e-9)


@pytest.mark.parametrize(("across", "factor"), [(np.pi, 1 / 9), (np.pi / 2, 4 / 9)])
def test_scatter(across, factor):
    """Of fields of hats: the mean square of zigzags is 1/9 of that of heights, of waves of four 4/9."""
    n, t = 40, np.linspace(0, 1, 41)
    surface = body(fem.MeshHex.init_tensor(t, t, t[[0, -1]]), "quad4").surface(at(2, 1.0))
    net = Net(surface, np.ones(len(surface.points), dtype=bool))
    i = np.round(surface.points[:, :2] * n)
    field = 0.3 * np.prod(np.cos(across * i), axis=1)[:, None]
    smooth = np.zeros(len(i), dtype=bool)
    left_out = _near_ends(net, smooth)
    square = _scatter(net, net.misfit(field), left_out)
    inner = np.all((i > 3) & (i < n - 3), axis=1)
    mean = np.mean(field[inner] ** 2)
    assert square[inner].mean() == pytest.approx(factor * mean, rel=0.15)
    # what a curve of the size of the surface leaves is next to nothing
    long = 0.3 * np.cos(i @ [2.0, 1.0] / n)[:, None]
    assert _scatter(net, net.misfit(long), left_out)[inner].mean() < 1e-4 * mean


@pytest.mark.parametrize(("beside", "sharp"), [(0.3, True), (0.4, False)])
def test_where_tractions_are_sharp(beside, sharp):
    """At the end of stick, if it misfits more than three times as much as what is beside it; at ends.

    Not on a plane of symmetry, nor where the end of the surface is open.
    """
    mesh, symmetric = cube("quad4", 10, layers=1), ((at(0, 0.0), (0,)),)
    surface = elastic(mesh, "quad4", "block", held=symmetric).surface(at(2, 1.0))
    x, y, _ = surface.points.T
    net = Net(surface, np.ones(len(x), dtype=bool))
    i, j = np.round(10 * x), np.round(10 * y)
    sticks, opened = (i >= 3) & (i <= 5) & (j >= 3) & (j <= 5), j == 10
    status = np.where(opened, OPEN, np.where(sticks, STICK, SLIP))
    off = np.maximum(abs(i - 4), abs(j - 4))
    corner = (abs(i - 4) == off) & (abs(j - 4) == off)
    # the corners of the ring around stick have no neighbour in it, those of stick none off the border
    border = (off == 1) | ((off == 2) & ~corner)
    first = np.where(border, 1.0, beside)[:, None]
    ends = ((i == 10) | (j == 0)) & (i > 0)
    assert_array_equal(_sharp(net, status, first), (border & (sharp | corner)) | (ends & ~opened))


@pytest.mark.parametrize(("n", "told"), [((5, 3), False), ((4, 4), True)])
def test_scatter_that_nothing_tells_is_missing(n, told):
    """Node by node on an unlike mesh, all points near an end; on a mesh that matches it is zero."""
    result, *_ = effectivity_solids.patch("quad4", n)
    estimate = result.error_estimate
    assert ("all points are near an end of the surface" in estimate.unrated) is not told
    assert np.isnan(estimate.traction.total) is not told
    if told:
        assert estimate.traction.total < 1e-6


def test_the_estimate_does_not_depend_on_frames():
    """A dome dragged over a plane, turned as a whole: tangents differ, the error does not."""
    found = []
    for turn in (np.eye(3), Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()):

        def place(x, turn=turn):
            y = np.stack([x[0] - 0.5, x[1] - 0.5, x[2]])
            y[2] += (1 - x[2]) * 0.15 * (y[0] ** 2 + 1.3 * y[1] ** 2 + 0.4 * y[0] * y[1])
            return turn @ y

        def top(x, turn=turn):
            return np.isclose(np.einsum("d,d...->...", turn[:, 2], x), 1.0)

        mesh = cube("quad4", 8, place)
        low = cube("quad4", 8).facets_satisfying(at(2, 0.0))
        dome = elastic(mesh, "quad4", "dome", held=((top, (0, 1, 2)),))
        floor = sc.RigidPlane((0, 0, 0), turn[:, 2], name="floor")
        contact = sc.Contact(dome.surface(low), floor, friction=sc.Coulomb(0.4), name="joint")
        x = np.zeros(dome.n)
        x[dome.D] = (turn @ [0.006, 0.002, -0.03])[dome.dof_component[dome.D]]
        result = sc.ContactSolver([dome], contact).solve(x={"dome": x})
        assert {0, 1, 2} == set(result.status)
        estimate = result.error_estimate
        found.append([estimate.traction.edges, estimate.traction.facets, estimate.traction.scatter])
    assert min(found[0][:2]) > 0
    assert_allclose(found[1], found[0], rtol=1e-6, atol=1e-9)
