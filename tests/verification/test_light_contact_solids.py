"""Balls of coarse faces that are hardly pressed: contact within a face is warned of, and only that.

A sphere of radius 1 with faces as long as the sides of a polygon of 36 is pressed on a flat block by a
multiple of the height of its chords. The reference is a quarter of the same bodies on a mesh that
resolves the contact.
"""

from __future__ import annotations

import sys
import warnings
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import skfem as fem
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parent.parent))
import internals
from solid_meshes import KINDS, at, body, cube, elastic, octant_shell

import skfem_contact as sc
from skfem_contact.answers import answer_of, bends, sagittas

SAGITTA = internals.original("answers.SAGITTA")

SIZE = 0.6
CHORD = np.pi / 18
HEIGHT = CHORD**2 / 8
WORDS = "over the length of one facet the curves stand"


def sphere(x):
    """Height of the lower side of the ball above its lowest point; it ends at the radius 0.995."""
    return 1 - np.sqrt(1 - np.minimum(x[0] ** 2 + x[1] ** 2, 0.99))


def block(name, x, y, z, kind="quad4"):
    """Cells between lines, with a sphere of radius 1 as the lower side of the ball."""
    linear, curved, _ = KINDS[kind]
    mesh = linear.init_tensor(x, y, z if name == "ball" else -z[::-1])
    mesh = mesh if curved is linear else curved.from_mesh(mesh)
    p = mesh.doflocs.copy()
    if name == "ball":
        p[2] += sphere(p) * (1 - p[2] / SIZE)
    return type(mesh)(p, mesh.t)


def lines(facet, shift):
    """Steps of a length from one side of a block to the other, moved by a part of them."""
    steps = np.arange(-round(2 * SIZE / facet), round(2 * SIZE / facet) + 1)
    x = (steps + shift) * facet
    return np.concatenate([[-SIZE], x[np.abs(x) < SIZE - 0.3 * facet], [SIZE]])


def low_side(ball):
    """The faces on the sphere."""
    mesh = ball.basis.mesh
    faces = mesh.boundary_facets()
    x = mesh.p[:, mesh.facets[:, faces]]
    return ball.surface(faces[np.isclose(x[2], sphere(x), rtol=0, atol=1e-9).all(axis=0)], name="low")


def solved(meshes, kind, heights, secondary="flat", method="node", rollers=(), **settings):
    """The result of the ball pressed by a multiple of the height of the coarse chords."""
    top = at(2, SIZE)
    push = top, (0.0, 0.0, -heights * HEIGHT)
    ball = elastic(meshes[0], kind, "ball", held=((top, (0, 1, 2)), *rollers), push=push)
    flat = elastic(meshes[1], kind, "flat", held=((at(2, -SIZE), (0, 1, 2)), *rollers))
    pair = low_side(ball), flat.surface(at(2, 0.0))
    contact = sc.Contact(*pair[:: 1 if secondary == "ball" else -1], method=method, **settings)
    return sc.ContactSolver([ball, flat], [contact]).solve()


@lru_cache
def fine(heights):
    """The force by a mesh with eight faces on the radius of contact; four times as many: .4 % less."""
    x = np.arange(7) * np.sqrt(heights * HEIGHT / 2) / 4
    step = x[1] * 1.5 ** np.arange(1, 20)
    outer = x[-1] + np.cumsum(step)[: 1 + np.argmax(x[-1] + np.cumsum(step) > SIZE)]
    x = np.concatenate([x, x[-1] + (outer - x[-1]) * (SIZE - x[-1]) / (outer[-1] - x[-1])])
    meshes = [block(name, x, x, np.delete(x, [1, 3, 5])) for name in ("ball", "flat")]
    rollers = (at(0, 0.0), (0,)), (at(1, 0.0), (1,))
    return 4 * solved(meshes, "quad4", heights, rollers=rollers).normal_force.sum()


def said(heights, shift, *args, kind="quad4", facets=(CHORD, CHORD), **settings):
    """Force over that of the fine mesh; whether it was warned of; and the result."""
    z = [np.linspace(0, SIZE, round(SIZE / facet) + 1) for facet in facets]
    meshes = [
        block(name, *(lines(facet, s) for s in by), depth, kind)
        for name, facet, by, depth in zip(("ball", "flat"), facets, shift, z, strict=True)
    ]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = solved(meshes, kind, heights, *args, **settings)
    texts = [str(w.message) for w in caught]  # of large strains as well
    return result.normal_force.sum() / fine(heights), any(WORDS in text for text in texts), result


# how nodes of the ball and of the flat lie to the axis
PLACES = [((0.25, 0.4), (0.5, 0.5)), ((0, 0), (0, 0)), ((0, 0), (0.5, 0.5)), ((0.5, 0.5), (0, 0))]


@pytest.mark.parametrize(
    ("method", "secondary", "kind", "places"),
    [
        ("mortar", "flat", "quad4", PLACES[:1]),
        ("node", "ball", "quad4", PLACES[:1]),
        ("mortar", "ball", "tri6", PLACES[1:2]),
        *(
            pytest.param(method, secondary, kind, PLACES, marks=pytest.mark.slow)
            for method in ("mortar", "node")
            for secondary in ("flat", "ball")
            for kind in ("quad4", "tri3")
        ),
        *(
            pytest.param(method, secondary, kind, PLACES[:2], marks=pytest.mark.slow)
            for method in ("mortar", "node")
            for secondary in ("flat", "ball")
            for kind in ("quad8", "quad9", "tri6")
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{len(value)} places",
)
def test_a_force_that_is_wrong_is_warned_of(method, secondary, kind, places):
    """However nodes lie to each other: silent forces are right within a fifth or so."""
    for shift in places:
        for heights in (3, 10, 30):
            ratio, warned, result = said(heights, shift, secondary, method, kind=kind)
            if result.normal_force.any():
                assert warned or abs(ratio - 1) <= SAGITTA, (shift, heights, ratio)
            if heights == 30:  # some one and a half faces on the radius of contact
                assert not warned


def test_what_is_said_and_measured():
    """A force that is too large by half: the words, the numbers on request, and the bound."""
    ratio, warned, result = said(1.02, PLACES[1], "ball", "mortar")
    assert ratio > 1.15 and warned
    assert result.validity.holds is False and ("facets", "contact 1") in result.validity.problems
    share = result.validity.contacts["contact 1"].drift.sagitta_share
    assert result.validity.worst == pytest.approx(share / SAGITTA)
    assert "of the elastic approach (up to 20 %)" in str(result.validity)


def test_a_given_gap_knows_the_ball():
    """Who gives the gap has it measured on no chord."""
    _, warned, _ = said(3, PLACES[0], gap=lambda x: 0.5 * (x[0] ** 2 + x[1] ** 2))
    assert not warned


@pytest.mark.parametrize("sliding", ["small", "finite"])
def test_the_height_over_a_face(sliding):
    """That of the longer edges; node by node what comes down over a whole face of the flat."""
    for method, secondary, times in (
        ("mortar", "flat", 1),
        ("mortar", "ball", 1),
        ("node", "ball", 1),
        ("node", "flat", 2),
    ):
        *_, result = said(10, PLACES[1], secondary, method, sliding=sliding)
        sagitta = answer_of(result).diagnostics.drifts[0].sagitta
        # faces of equal steps in x are longer on the sphere, by 1 to 2 % where it stands
        assert sagitta == pytest.approx(times * HEIGHT, rel=0.06)


def beside_no_rim(surface):
    """Faces none of whose corners is on the rim, where normals are those of one face."""
    rim = np.zeros(len(surface.points), dtype=bool)
    rim[surface.facets[:, surface.kind.edges][surface.twins < 0]] = True
    return np.flatnonzero(~rim[surface.facets].any(axis=1))


@pytest.mark.parametrize("kind", KINDS)
def test_how_a_sphere_bends(kind):
    """By 1 / R in all directions, hollow inside and convex outside; curved faces count as quarters."""
    part = body(octant_shell(kind, 4, 1, 1.0, 2.0), kind, name="shell")
    mesh = part.basis.mesh
    faces = mesh.boundary_facets()
    radius = np.linalg.norm(mesh.p[:, mesh.facets[:, faces]], axis=0)
    for R, sign in ((1.0, -1.0), (2.0, 1.0)):
        side = part.surface(faces[np.isclose(radius, R).all(axis=0)], name="side")
        bend, edges = bends(side)
        middle, n = beside_no_rim(side), side.facet_normals
        assert len(middle) > 5
        plane = np.eye(3) - np.einsum("fd,fe->fde", n, n)
        np.testing.assert_allclose(bend[middle], sign * plane[middle] / R, rtol=0, atol=0.05 / R)
        ends = (
            side.points[side.facets[:, side.kind.edges[:, 1]]]
            - side.points[side.facets[:, side.kind.edges[:, 0]]]
        )
        np.testing.assert_allclose(edges[middle], ends[middle] * (0.5 if side.quadratic else 1.0))
        if side.quadratic:
            continue
        # two like spheres: their curvatures add; in a hollow one of the same radius there is no height
        facet = np.zeros(len(side.points), dtype=int)
        facet[side.facets[middle]] = middle[:, None]
        inner = np.unique(side.facets[middle])
        double = sagittas(side, side, facet)[inner] / (
            np.linalg.norm(edges[middle], axis=2).max() ** 2 / 4
        )
        assert np.all(double / R < 1.05 / R**2) and double.max() * R == pytest.approx(1.0, rel=0.05)


def bent(steps):
    """The upper faces of a long plate whose top is bent over its length, by points (x, z)."""
    x, z = np.array(steps, dtype=float).T
    mesh = fem.MeshHex.init_tensor(x, np.linspace(0, 4, 3), np.array([-1.0, 0.0]))
    p = mesh.p.copy()
    p[2] += np.interp(p[0], x, z) * (p[2] + 1)
    return body(fem.MeshHex(p, mesh.t), "quad4").surface(
        mesh.facets_satisfying(lambda q: np.isclose(q[2], 0.0)), name="top"
    )


def test_what_is_no_curve_does_not_bend():
    """A cylinder bends across its axis, whatever the length of faces; chamfers and roofs do not."""
    turn = np.linspace(-0.6, 0.6, 9)
    arc = bent(np.column_stack([np.sin(turn), np.cos(turn) - 1]))
    bend, _ = bends(arc)
    # faces beside both ends know one normal only
    inner = (np.abs(arc.points[arc.facets, 0]) < 0.5).all(axis=1)
    along = np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(bend[inner] @ along, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.trace(bend[inner], axis1=1, axis2=2), 1.0, rtol=0.01)
    flat = bent([(x, 0) for x in np.linspace(-1, 1, 21)])
    heights = sagittas(arc, flat, np.zeros(len(arc.points), dtype=int))
    assert heights.max() == pytest.approx(0.15**2 / 8, rel=0.02)  # not that of their length of 2
    for steps in (
        [(-3, -1), (-1, 0), (1, 0), (3, -1)],  # chamfers of 27 degrees
        [(-2, -0.5), (-1, -0.2), (0, 0.3), (1, -0.2), (2, -0.5)],  # a roof
    ):
        assert np.abs(bends(bent(steps))[0]).max() < 1e-15


@pytest.mark.parametrize("kind", ["quad4", "quad8"])
def test_how_a_wavy_side_bends(kind):
    """Faces are twisted, and bend to both sides."""

    def wavy(x):
        wave = 0.04 * np.sin(2 * x[0]) * np.cos(2 * x[1])
        return np.array([x[0], x[1], 0.7 * x[2] + x[2] * wave])

    mesh = cube(kind, 4, wavy)
    side = body(mesh, kind).surface(lambda x: x[2] > 0.65)
    bend, _ = bends(side)
    assert 0.05 < np.abs(bend).max() < 0.04 * 4 * 1.5  # its curvatures are .04 x 4 at most


def test_plane_faces_have_no_height():
    """Normals that differ by round-off are no curves."""
    turn = Rotation.random(random_state=3).as_matrix()
    one, two = (
        body(cube("quad8", 3, lambda x, z=z: turn @ (x + np.array([[0.1], [0.2], [z]]))), "quad8")
        for z in (1.0, 0.0)
    )
    up, low = (
        b.surface(lambda x, c=c: np.abs(turn[:, 2] @ x - 1.0 - c) < 0.05)
        for b, c in ((one, 0.0), (two, 0.0))
    )
    facet = np.zeros(len(up.points), dtype=int)
    for by_node in (False, True):
        assert not sagittas(up, low, facet, by_node).any()


def wave(x):
    """Height of the side on which two blocks meet."""
    return 0.5 + 0.04 * np.sin(2 * x[0]) * np.cos(2 * x[1])


def between(x):
    """Faces there."""
    return (np.abs(x[2] - wave(x)) < 0.01) & (np.abs(x[:2] - 0.5) < 0.499).all(axis=0)


def on_a_wave(kind, n, shift=0.0):
    """Force and warnings of a block pressed on another one, n by n faces between them."""
    bodies = []
    for name, of, away in (("low", "quad4", 0.0), ("up", kind, shift)):
        x = np.linspace(0, 1, n + 1)
        x[1:-1] += away / n
        mesh = KINDS[of][0].init_tensor(x, x, np.linspace(0, 1, 1 + n // 2))
        p, up = mesh.p.copy(), name == "up"
        p[2] = wave(p) + (1 - wave(p)) * p[2] if up else wave(p) * p[2]
        end = at(2, float(up))
        settings = {"push": (end, (0.0, 0.0, -1e-3))} if up else {}
        held = ((end, (0, 1, 2)),)
        bodies.append(elastic(type(mesh)(p, mesh.t), of, name, held=held, **settings))
    low, up = (body.surface(between, name="wave") for body in bodies)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = sc.ContactSolver(bodies, [sc.Contact(up, low, method="node")]).solve()
    return result.normal_force.sum(), [str(w.message) for w in caught]


@pytest.mark.parametrize("shift", [0.0, 0.4])
def test_unlike_faces_on_one_wave_are_one_surface(shift):
    """Tetrahedra on hexahedra on a wave, with the same nodes or with nodes of one side between those of
    the other: node by node no curves differ, and the force is that of a finer mesh."""
    force, texts = on_a_wave("tri3", 6, shift)
    assert not any(WORDS in text for text in texts)
    assert 0.95 < force / on_a_wave("tri3", 12)[0] < 1.05
