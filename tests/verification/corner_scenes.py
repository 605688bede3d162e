"""A disc, or a square, over the 90 degree corner of a block, and overlaps measured from outside."""

from __future__ import annotations

import numpy as np
import skfem as fem
from matplotlib.path import Path
from sliding_scenes import QUAD, elastic, rectangle

import skfem_contact as sc

RADIUS, FACET, PUSH = 0.5, 0.1, 0.02
CORNER = np.array([1.0, 0.0])
#: Where the tool is meshed: just above the block.
HOME = CORNER + [-0.2, RADIUS + PUSH]


def ring(facet=FACET, turn=0.0):
    """Basis of an annulus with radii 0.2 and 0.5, its facets outside about as long as asked."""
    n = round(2 * np.pi * RADIUS / facet)
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False) + turn
    layers = np.linspace(0.2, RADIUS, 5)
    p = np.array([np.outer(layers, np.cos(angle)).ravel(), np.outer(layers, np.sin(angle)).ravel()])
    i, k = np.meshgrid(np.arange(n), np.arange(len(layers) - 1))
    i, k, j = i.ravel(), k.ravel(), (i.ravel() + 1) % n
    t = np.array([k * n + i, (k + 1) * n + i, (k + 1) * n + j, k * n + j])
    mesh = fem.MeshQuad(p, t)
    tags = {
        "inner": mesh.facets_satisfying(lambda x: np.hypot(*x) < 0.21, True),
        "outer": mesh.facets_satisfying(lambda x: np.hypot(*x) > 0.4, True),
    }
    mesh = mesh.with_boundaries(tags).translated(HOME)
    return fem.Basis(mesh.with_boundaries(tags), QUAD, intorder=3)


def square(facet=FACET):
    """Basis of a square of the disc's width."""
    x = np.linspace(-RADIUS, RADIUS, round(2 * RADIUS / facet) + 1)
    return rectangle(HOME[0] + x, HOME[1] + x)


def block(facet=FACET):
    """Basis of the unit square below its corner at (1, 0)."""
    x = np.linspace(0, 1, round(1 / facet) + 1)
    return rectangle(x, x - 1)


def placed(basis, D, centre, angle=0.0):
    """Prescribed displacements that put the core at a place, turned clockwise by an angle.

    The rotation is a linear one, which costs a linear body no strain: it grows by sqrt(1 + angle^2).
    """
    x, y = basis.doflocs - HOME[:, None]
    move = np.array([angle * y, -angle * x]) + (np.asarray(centre) - HOME)[:, None]
    out = np.zeros(basis.N)
    for i in range(2):
        out[basis.nodal_dofs[i]] = move[i, basis.nodal_dofs[i]]
    keep = np.zeros(basis.N)
    keep[D] = out[D]
    return keep


def scene(
    secondary="disc",
    method="node",
    where="top",
    shape="disc",
    mu=0.1,
    facet=FACET,
    other=FACET,
    turn=0.0,
    stiff=1.0,
    options=None,
):
    """Solver of a disc (or a square) over a block; returns also what places the disc."""
    low = block(other)
    tool = ring(facet, turn) if shape == "disc" else square(facet)
    if shape == "disc":
        D = tool.get_dofs("inner").all()
    else:
        D = np.flatnonzero(np.max(np.abs(tool.doflocs - HOME[:, None]), axis=0) < 0.21)
    a = sc.Body(low, elastic(1.0), D="bottom", name="block")
    b = sc.Body(tool, elastic(stiff), D=D, name="disc")
    m = low.mesh
    if where == "both":
        chosen = m.facets_satisfying(lambda x: (x[1] > -1e-9) | (x[0] > 1 - 1e-9), True)
    else:
        chosen = "top"
    face = a.surface(chosen, name="face")
    outer = b.surface("outer") if shape == "disc" else b.surface(None)
    sides = (outer, face) if secondary == "disc" else (face, outer)
    contact = sc.Contact(
        *sides, friction=sc.Coulomb(mu) if mu else None, method=method, sliding="finite", name="c"
    )
    solver = sc.ContactSolver([a, b], contact, options=options or sc.Options())
    return solver, lambda centre, angle=0.0: {"x": {"disc": placed(tool, D, centre, angle)}}


def path(kind, steps=12, push=PUSH, rolled=False, width=0.2):
    """Centres, and angles by which a disc rolls, so that it is always pushed in as deep.

    "straight": on along the top, beyond the corner; "round": along the top and around the corner.
    """
    if kind == "straight":
        way = np.linspace(-width, width, 2 * steps + 1)
        places = [(s, np.array([0.0, 1.0]), np.array([s, 0.0]), s / RADIUS) for s in way]
    else:
        flat = np.linspace(-width, 0, steps, endpoint=False)
        places = [(s, np.array([0.0, 1.0]), np.array([s, 0.0]), s / RADIUS) for s in flat]
        places += [
            (a, np.array([np.sin(a), np.cos(a)]), np.zeros(2), a)
            for a in np.linspace(0, np.pi / 2, 2 * steps + 1)
        ]
        middle = np.pi / 4
        places = [(s, n, at, a - middle) for s, n, at, a in places]
    out = []
    for _, normal, at, angle in places:
        angle = angle if rolled else 0.0
        out.append((CORNER + at + (RADIUS * np.sqrt(1 + angle**2) - push) * normal, angle))
    return out


def outline(basis, u):
    """The deformed boundaries, a polygon (n, 2) for each closed curve."""
    mesh = basis.mesh
    moved = mesh.p + u[basis.nodal_dofs[:, : mesh.p.shape[1]]]
    facets = mesh.boundary_facets()
    ends = mesh.facets[:, facets].T
    links = {}
    for i, j in ends:
        links.setdefault(i, []).append(j)
        links.setdefault(j, []).append(i)
    loops = []
    while links:
        first = next(iter(links))
        loop, last, here = [first], None, first
        while True:
            onward = [k for k in links[here] if k != last]
            last, here = here, onward[0]
            if here == first:
                break
            loop.append(here)
        for i in loop:
            del links[i]
        loops.append(moved[:, loop].T)
    return max(loops, key=lambda loop: np.ptp(loop[:, 0]) * np.ptp(loop[:, 1]))


def depth(points, polygon):
    """How deep points lie in a polygon."""
    inside = Path(np.vstack([polygon, polygon[:1]])).contains_points(points)
    if not inside.any():
        return 0.0
    a, b = polygon, np.roll(polygon, -1, axis=0)
    x = points[inside][:, None]
    s = np.clip(np.sum((x - a) * (b - a), axis=2) / np.sum((b - a) ** 2, axis=1), 0, 1)
    return float(np.linalg.norm(x - a - s[..., None] * (b - a), axis=2).min(axis=1).max())


def overlap(result, names=("block", "disc")):
    """Deepest overlap of two deformed bodies: nodes and points between them, both ways."""
    a, b = (
        outline(result.system.bodies[result.system.names.index(name)].basis, result.displacement(name))
        for name in names
    )
    return max(depth(densely(a), b), depth(densely(b), a))


def densely(polygon, parts=8):
    """Points along a closed polygon."""
    s = np.arange(parts)[:, None, None] / parts
    return ((1 - s) * polygon + s * np.roll(polygon, -1, axis=0)).reshape(-1, 2)


def wedge(secondary="block", method="node", friction=None, facet=FACET):
    """Solver of a stiff wedge whose 90 degree vertex, at (0.34, 0), is dragged over a flat block.

    Returns also what moves the wedge to the right and down.
    """
    low = rectangle(np.linspace(0, 1, round(1 / facet) + 1), np.linspace(-0.5, 0, 6))
    upright = rectangle(np.linspace(0, 0.3, 4), np.linspace(0, 0.3, 4)).mesh
    turn = np.sqrt(0.5) * np.array([[1, -1], [1, 1]])
    mesh = fem.MeshQuad(turn @ upright.p + np.array([[0.34], [0.0]]), upright.t)
    middle = 0.3 * np.sqrt(0.5)
    tags = {
        "under": mesh.facets_satisfying(lambda x: x[1] < middle, True),
        "over": mesh.facets_satisfying(lambda x: x[1] > middle, True),
    }
    tool = fem.Basis(mesh.with_boundaries(tags), QUAD, intorder=2)
    a = sc.Body(low, elastic(1.0), D="bottom", name="block")
    b = sc.Body(tool, elastic(1e3), D="over", name="wedge")
    sides = [a.surface("top"), b.surface("under")]
    if secondary != "block":
        sides.reverse()
    contact = sc.Contact(*sides, friction=friction, method=method, sliding="finite", name="c")

    def put(right, down):
        moved = np.zeros(tool.N)
        for i, value in enumerate((right, -down)):
            moved[b.D[np.isin(b.D, tool.nodal_dofs[i])]] = value
        return {"x": {"wedge": moved}}

    return sc.ContactSolver([a, b], contact), put
