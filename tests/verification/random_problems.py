"""Random small frictional contact problems: as scikit-fem scenes and, independently, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import skfem as fem
from enumeration import Problem, Solution
from scenes import elastic

import skfem_contact as sc


@dataclass(frozen=True, eq=False)
class Scene:
    """Bodies, the contact, two loads, and the same thing as dense arrays."""

    bodies: list[sc.Body]
    surfaces: tuple
    gap: np.ndarray
    mu: float
    loads: list[tuple[np.ndarray, np.ndarray]]
    problem: Problem
    order: np.ndarray  # points of the surface in the order of the arrays

    def solver(self, loop: str, G: float = np.inf, **options) -> sc.ContactSolver:
        """A solver that takes every load in one step, so that there is one problem to compare."""
        law = sc.Coulomb(self.mu, stiffness=G)
        contact = sc.Contact(*self.surfaces, friction=law, gap=self.gap)
        options = {"max_cuts": 0, **options}
        return sc.ContactSolver(self.bodies, contact, loop=loop, options=sc.Options(**options))

    def step(self, number: int, G: float = np.inf, before: Solution | None = None) -> Problem:
        """The arrays of a load step, after a step that ended with a known solution."""
        f, x = self.loads[number]
        new = replace(self.problem, f=f, x=x, G=G)
        if before is None:
            return new
        return replace(new, slip_before=before.slip, tau_before=before.tau)


def random_scene(seed: int, mu: float, most: int = 5, floating: bool = False, fewest: int = 1) -> Scene:
    """One or two blocks of random shape, stiffness, support, load and gap.

    `floating`: one block on a plane that nothing but contact and friction supports.
    """
    rng = np.random.default_rng(seed)
    kind = "plane" if floating else rng.choice(["plane", "plane", "matching", "refined"])
    support = "none" if floating else rng.choice(["top", "side", "corners"])
    m = int(rng.integers(max(fewest, 1 if kind == "plane" and not floating else 2), most + 1))
    if kind == "refined" and fewest > 5:
        m += 1 - m % 2  # every second node is one of the primary side
    elif kind == "refined":
        m = 3 if most < 5 else int(rng.choice([3, 5]))
    quads = bool(rng.integers(2))
    angle = float(rng.choice([0.0, 0.5 * np.pi, rng.uniform(-np.pi, np.pi)]))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    along = np.cumsum(np.concatenate([[0.0], rng.uniform(0.5, 1.5, max(m - 1, 1))]))
    height = along[-1] * 10 ** rng.uniform(-1, 0.5)

    upper, u_base = _block(rng, along, height, turn, quads, peak=m == 1)
    blocks = [upper]
    if kind != "plane":
        low = along[::2] if kind == "refined" else along
        lower, l_base = _block(rng, low, -height, turn, quads)
        blocks.append(lower)
    bodies, offset, nodes = [], 0, []
    for i, basis in enumerate(blocks):
        E, nu = 10 ** rng.uniform(-1, 1), rng.uniform(0.0, 0.48)
        D = _supported(basis, turn, support if i == 0 else "top")
        form = elastic(E, nu)
        bodies.append(sc.Body(basis, form, D=D, name=f"block {i}"))
        base = u_base if i == 0 else l_base
        nodes.append(offset + basis.nodal_dofs[:, base])
        offset += basis.N
    n = offset
    normal, tangent = turn @ [0.0, 1.0], turn @ [-1.0, 0.0]
    weights = [np.eye(m)]
    if kind != "plane":
        weights.append(-_hat(along, along[::2] if kind == "refined" else along))
    B_n, B_t = np.zeros((m, n)), np.zeros((m, n))
    for W, dofs in zip(weights, nodes, strict=True):
        for c in range(2):
            B_n[:, dofs[c]] += W * normal[c]
            B_t[:, dofs[c]] += W * tangent[c]
    size = along[-1]
    gap = rng.choice([0.0, 0.02]) * size * rng.standard_normal(m)
    if rng.random() < 0.3:
        gap -= 0.02 * size  # interference
    loads = [_load(rng, blocks, turn, size) for _ in range(2)]
    if floating:  # sometimes too much for friction, sometimes tilting or lifting off
        for f, _ in loads:
            push = turn @ [rng.uniform(-1.2, 1.2) * min(mu, 0.5), rng.choice([-1.0, -1.0, -1.0, 0.2])]
            f *= 0.2
            f[blocks[0].nodal_dofs] += push[:, None] * 0.05 * size
    D = np.concatenate(
        [b.D + o for b, o in zip(bodies, np.cumsum([0, blocks[0].N])[: len(bodies)], strict=True)]
    )
    held = np.isin(np.arange(n), D)
    loads = [(f, np.where(held, x, 0.0)) for f, x in loads]  # values elsewhere would be refused
    K = np.zeros((n, n))
    at = 0
    for body in bodies:
        K[at : at + body.n, at : at + body.n] = body.K.toarray()
        at += body.n
    problem = Problem(
        K, loads[0][0], D, loads[0][1], B_n, B_t, gap, mu, np.inf, np.zeros(m), np.zeros(m)
    )
    on = _facets(blocks[0], u_base, m, normal)
    if kind == "plane":
        primary = sc.RigidPlane((0.0, 0.0), normal)
    else:
        primary = bodies[1].surface(_facets(blocks[1], l_base, 2, -normal))
    surface = bodies[0].surface(on)
    order = _order(surface.points, blocks[0].mesh.p[:, u_base].T)
    given = np.full(len(surface.points), 1e3 * size)  # the clamped end of a single tip's edge
    given[order] = gap
    return Scene(bodies, (surface, primary), given, mu, loads, problem, order)


def _block(rng, along, height, turn, quads, peak=False):
    """A block on the line y = 0 and the nodes of its base, from left to right; or a triangle."""
    if peak:
        p = np.array([[0.0, 1.0, -1.0], [0.0, 1.0, 1.0]]) + 0.3 * rng.standard_normal((2, 3))
        p -= p[:, :1]
        p[1, 1:] = 0.3 + np.abs(p[1, 1:])
        if np.linalg.det(p[:, 1:]) < 0:
            p[:, 1:] = p[:, :0:-1]
        mesh = fem.MeshTri(turn @ p, np.array([[0], [1], [2]]))
        return fem.Basis(mesh, fem.ElementVector(fem.ElementTriP1())), np.array([0])
    layers = int(rng.integers(1, 3))
    y = np.sort(np.linspace(0.0, height, layers + 1))
    kind = fem.MeshQuad if quads else fem.MeshTri
    mesh = kind.init_tensor(along, y)
    p = mesh.p.copy()
    p[0] += rng.uniform(-0.5, 0.5) * p[1] * (along[-1] / abs(height)) * 0.5
    base = np.flatnonzero(mesh.p[1] == 0.0)
    base = base[np.argsort(mesh.p[0, base])]
    element = fem.ElementQuad1() if quads else fem.ElementTriP1()
    return fem.Basis(kind(turn @ p, mesh.t), fem.ElementVector(element)), base


def _supported(basis, turn, support):
    x, y = turn.T @ basis.mesh.p
    far = y if y.max() > -y.min() else -y
    if support == "none":
        return np.zeros(0, dtype=int)
    if basis.mesh.nvertices == 3:
        nodes = np.array([1, 2])
    elif support == "top":
        nodes = np.flatnonzero(far > far.max() - 1e-9)
    elif support == "side":  # the left half, above the contact
        nodes = np.flatnonzero(far > 0.3 * far.max())
        nodes = nodes[np.argsort(x[nodes])[: max(2, len(nodes) // 2)]]
    else:
        top = np.flatnonzero(far > far.max() - 1e-9)
        nodes = top[[np.argmin(x[top]), np.argmax(x[top])]]
    return np.unique(basis.nodal_dofs[:, nodes])


def _load(rng, blocks, turn, size):
    f, x = [], []
    for i, basis in enumerate(blocks):
        push = rng.standard_normal((2, basis.mesh.nvertices)) * rng.choice([0.0, 0.02])
        both = turn @ (rng.uniform(0, 0.04) * rng.standard_normal((2, 1)) * size + [[0.0], [-0.01]])
        f_i, x_i = np.zeros(basis.N), np.zeros(basis.N)
        f_i[basis.nodal_dofs] = size * push
        if i == 0:
            x_i[basis.nodal_dofs] = both
        f.append(f_i)
        x.append(x_i)
    return np.concatenate(f), np.concatenate(x)


def _hat(x, nodes):
    return np.array([np.interp(x, nodes, row) for row in np.eye(len(nodes))]).T


def _facets(basis, base, m, up):
    mesh = basis.mesh
    boundary = mesh.boundary_facets()
    inside = np.isin(mesh.facets[:, boundary], base).all(axis=0)
    if m == 1:  # the edge that has the tip as an end and looks down the most
        ends = np.isin(mesh.facets[:, boundary], base).any(axis=0)
        p = mesh.p[:, mesh.facets[:, boundary]]
        along = p[:, 1] - p[:, 0]
        rise = np.abs(up @ along) / np.linalg.norm(along, axis=0)
        inside = np.arange(len(boundary)) == np.argmin(np.where(ends, rise, np.inf))
    return boundary[inside]


def _order(points, wanted):
    return np.array([np.argmin(np.linalg.norm(points - p, axis=1)) for p in wanted])
