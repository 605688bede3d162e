"""What an answer in 3-D has to satisfy, measured without any of the library's operators.

Equilibrium is the judge's own `K u - f`; contact forces are what is left of it on the contact
surfaces; overlaps are distances between triangles of the deformed faces. Every allowance is a sentence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem as fem
from scipy.spatial import cKDTree
from solid_scenes import ContactSpec, Made, Scene, components, given

EPS = np.finfo(float).eps
GROWTH = 1e3  # of round-off in a factorisation
FORCE = 1e-7  # of the largest force of a body: the tolerance of the loops is far below
#: A face of size h between normals that turn by t lies up to h t / 8 off a smooth surface; of two faces
#: each may, and mortar weighs gaps with functions between -1 and 3.
CHORD = 0.5
#: Where the mean with dual functions is zero, that with hats is at most 0.84 of what the gap varies by
#: on triangles (dual functions are negative at neighbours), more on quadrilaterals and where a node
#: has shares of neighbours whose faces are covered in part: 1.15 was seen.
MEAN = 2.0
LOADED = 0.02  # of the largest nodal force: a point that carries


@dataclass(frozen=True)
class Finding:
    """A condition that an answer violates."""

    check: str
    step: int
    words: str
    geometric: bool = False


@dataclass(frozen=True, eq=False)
class Told:
    """What the library reports of a contact."""

    points: np.ndarray
    forces: np.ndarray
    normal: np.ndarray
    normal_force: np.ndarray
    area: np.ndarray
    gap: np.ndarray
    status: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    dissipation: float


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer as a user reads it."""

    u: dict[str, np.ndarray]
    contacts: dict[str, Told]


class Patch:
    """Faces of a body as triangles of a lattice, and integrals of hats over them."""

    def __init__(self, m: Made, tag: str) -> None:
        self.facets = m.tags[tag]
        mesh, self.fine = m.basis.mesh, m.spec.curved or "2" in m.spec.element
        triangle = m.spec.element.startswith("tet")
        X, cells = lattice(triangle, 4 if self.fine or not triangle else 2)
        basis = fem.FacetBasis(
            mesh, m.basis.elem, facets=self.facets, quadrature=(X, np.ones(X.shape[1]))
        )
        self.basis, self.n = basis, X.shape[1]
        where = {tuple(np.round(4 * x).astype(int)): q for q, x in enumerate(X.T)}
        ways = ((1, 0), (0, 1), (1, -1), (1, 1))
        triples = [
            [where.get((i - a, j - b)), q, where.get((i + a, j + b))]
            for (i, j), q in where.items()
            for a, b in ways
        ]
        triples = np.array([t for t in triples if None not in t], dtype=int).reshape(-1, 3)
        self.bends = (self.n * np.arange(len(self.facets))[:, None, None] + triples).reshape(-1, 3)
        self.x = self._rows(basis.global_coordinates())
        self.outward = self._rows(basis.normals)
        base = self.n * np.arange(len(self.facets))[:, None, None]
        self.triangles = (base + cells).reshape(-1, 3)
        corners = mesh.p[:, mesh.facets[:, self.facets]]
        self.h = float(np.sqrt(np.mean(np.sum(np.ptp(corners, axis=1) ** 2, axis=0) / 2)))
        linear = fem.ElementTetP1() if triangle else fem.ElementHex1()
        self.hats = fem.FacetBasis(
            mesh, linear, facets=self.facets, quadrature=(X, self._weights(triangle))
        )
        self.nodes = np.unique(mesh.facets[:, self.facets])
        self.phi = self._hats(mesh)  # (nodes, samples): weights of a mean over the neighbourhood
        self.dofs = np.unique(m.basis.get_dofs(self.facets).all())
        at, own = self.x, cKDTree(self.x)
        near = own.query_ball_point(mesh.p[:, self.nodes].T, 1e-6 * self.h)
        self.point = np.zeros_like(self.phi)  # the same at the node alone
        for row, i in zip(self.point, near, strict=True):
            row[i] = 1.0 / len(i)
        self.nodal = m.spec.element in (
            "tet P1",
            "hex Q1",
            "hex Q2",
        )  # others are held at control points
        self.turn = np.array([_spread(self.outward[i]) for i in near])
        self.normal = np.array([_unit(self.outward[i].mean(axis=0)) for i in near])
        assert len(at) == len(self.outward)

    def means(self, c: ContactSpec) -> np.ndarray:
        """Weights of the mean in which a contact closes: at nodes, or over their neighbourhood."""
        return self.point if self.nodal and (c.method == "node" or c.primary is None) else self.phi

    @staticmethod
    def _rows(values: np.ndarray) -> np.ndarray:
        return np.moveaxis(np.asarray(values), 0, -1).reshape(-1, 3)

    def _weights(self, triangle: bool) -> np.ndarray:
        return np.full(self.n, (0.5 if triangle else 1.0) / self.n)

    def _hats(self, mesh: Any) -> np.ndarray:
        out = np.zeros((len(self.nodes), len(self.x)))
        place = np.full(mesh.nvertices, -1)
        place[self.nodes] = np.arange(len(self.nodes))
        dx = np.asarray(self.hats.dx)
        for i in range(self.hats.Nbfun):
            value = np.broadcast_to(np.asarray(self.hats.basis[i][0]), dx.shape)
            dof = place[self.hats.element_dofs[i]]
            for f in np.flatnonzero(dof >= 0):
                out[dof[f], f * self.n : (f + 1) * self.n] += value[f] * dx[f]
        return out

    def crooked(self, values: np.ndarray) -> float:
        """How far triangles of the lattice are from values that are quadratic on faces."""
        if not self.fine or not len(self.bends):
            return 0.0
        a, b, c = (values[self.bends[:, i]] for i in range(3))
        return float(np.linalg.norm(a - 2 * b + c, axis=1).max()) / 4

    def displaced(self, u: np.ndarray) -> np.ndarray:
        """Displacements at the samples."""
        return self._rows(self.basis.interpolate(u))


def lattice(triangle: bool, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the reference face (2, q), and the triangles between them."""
    number, points, cells = {}, [], []
    for i in range(n + 1):
        for j in range(n + 1 - (i if triangle else 0)):
            number[i, j] = len(points)
            points.append((i / n, j / n))
    for i, j in number:
        for square in (((i, j), (i + 1, j), (i, j + 1)), ((i + 1, j + 1), (i, j + 1), (i + 1, j))):
            if all(c in number for c in square):
                cells.append([number[c] for c in square])
    return np.array(points).T, np.array(cells)


def _unit(v: np.ndarray) -> np.ndarray:
    return v / max(float(np.linalg.norm(v)), 1e-300)


def _spread(normals: np.ndarray) -> float:
    mean = _unit(normals.mean(axis=0))
    return float(np.arccos(np.clip(normals @ mean, -1, 1)).max())


def closest(x: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (p, t, 3) of the points of triangles (t, 3) nearest to x (p, 3)."""
    ab, ac, ap = b - a, c - a, x[:, None] - a
    dot = lambda u, v: np.sum(u * v, axis=-1)  # noqa: E731
    d00, d01, d11 = dot(ab, ab), dot(ab, ac), dot(ac, ac)
    d20, d21 = dot(ap, ab), dot(ap, ac)
    det = d00 * d11 - d01**2
    v, w = (d11 * d20 - d01 * d21) / det, (d00 * d21 - d01 * d20) / det
    best = np.stack([1 - v - w, v, w], axis=-1)
    inside = np.all(best >= 0, axis=-1)
    least = np.where(inside, 0.0, np.inf)
    corners = np.stack([a, b, c])
    for i in range(3):
        j = (i + 1) % 3
        p, q = corners[i], corners[j]
        t = np.clip(dot(x[:, None] - p, q - p) / dot(q - p, q - p), 0, 1)
        far = np.sum((x[:, None] - p - t[..., None] * (q - p)) ** 2, axis=-1)
        edge = np.zeros((*t.shape, 3))
        edge[..., i], edge[..., j] = 1 - t, t
        better = ~inside & (far < least)
        best = np.where(better[..., None], edge, best)
        least = np.where(better, far, least)
    return best


@dataclass(frozen=True, eq=False)
class Feet:
    """Nearest points of one patch to points of another."""

    triangle: np.ndarray
    share: np.ndarray
    normal: np.ndarray
    foot: np.ndarray
    off: np.ndarray  # distance of the foot from the line along the normal: beyond an end

    samples: np.ndarray

    def of(self, patch: Patch, values: np.ndarray) -> np.ndarray:
        """Values of the patch's samples at the feet."""
        return np.einsum("pk,pkd->pd", self.share, values[self.samples])


def feet(x: np.ndarray, patch: Patch) -> Feet:
    """The nearest points of a patch, undeformed."""
    a, b, c = (patch.x[patch.triangles[:, i]] for i in range(3))
    share = closest(x, a, b, c)
    foot = share[..., [0]] * a + share[..., [1]] * b + share[..., [2]] * c
    t = np.argmin(np.sum((x[:, None] - foot) ** 2, axis=-1), axis=1)
    p = np.arange(len(x))
    normal = np.cross(b - a, c - a)[t]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    flip = np.sum(normal * patch.outward[patch.triangles[t, 0]], axis=1) < 0
    normal[flip] *= -1
    away = x - foot[p, t]
    off = np.linalg.norm(away - np.sum(away * normal, axis=1)[:, None] * normal, axis=1)
    if patch.fine or patch.n < 25:
        return Feet(t, share[p, t], normal, foot[p, t], off, patch.triangles[t])
    # bilinear faces: the triangles only say where to begin
    samples = patch.n * (patch.triangles[t, 0] // patch.n)[:, None] + np.array([0, 4, 20, 24])
    N = bilinear(x, patch.x[samples], normal)
    return Feet(t, N, normal, np.einsum("pk,pkd->pd", N, patch.x[samples]), off, samples)


def bilinear(x: np.ndarray, corners: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Shape functions (p, 4) where lines along the normals through x meet quadrilaterals."""
    xi = np.full((len(x), 2), 0.5)
    for _ in range(30):
        a, b = xi.T
        N = np.stack([(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b], axis=1)
        da = np.stack([b - 1, -b, 1 - b, b], axis=1)
        db = np.stack([a - 1, 1 - a, -a, a], axis=1)
        J = np.stack([*(np.einsum("pk,pkd->pd", d, corners) for d in (da, db)), normal], axis=2)
        step = np.linalg.solve(J, (x - np.einsum("pk,pkd->pd", N, corners))[..., None])[:, :2, 0]
        xi = np.clip(xi + step, 0, 1)
    return N


class Court:
    """A scene, and all that is judged about its answers."""

    def __init__(self, s: Scene, made: dict[str, Made]) -> None:
        self.s, self.made = s, made
        self.patches = {
            side: Patch(made[side[0]], side[1])
            for c in s.contacts
            for side in (c.secondary, c.primary)
            if side is not None
        }
        self.most = 0.0

    def least(self, a: Answer) -> float:
        """A force that counts as none: what moves the softest body by a millionth of what has moved."""
        moved = max(float(np.abs(u).max()) for u in a.u.values())
        return 1e-6 * min(b.E for b in self.s.bodies) * self.s.unit * self.s.size * moved

    def residual(self, k: int, name: str, u: np.ndarray) -> tuple[np.ndarray, float]:
        """`K u - f` of a body, and its round-off."""
        m = self.made[name]
        last = name == self.s.bodies[-1].name and self.s.drive == "f"
        f = given(self.s, m, self.s.steps[k]) if last else np.zeros(m.basis.N)
        size = abs(m.K) @ np.abs(u) + np.abs(f)
        return m.K @ u - f, GROWTH * EPS * float(size.max())

    def examine(self, answers: list[Answer]) -> list[Finding]:
        """All findings on the answers of a history."""
        out = []
        before: Answer | None = None
        for k, a in enumerate(answers):
            R, noise = {}, {}
            for name in self.made:
                R[name], noise[name] = self.residual(k, name, a.u[name])
            self.most = max([self.most, self.least(a), *(float(np.abs(r).max()) for r in R.values())])
            noise = {n: v + 1e-9 * self.most for n, v in noise.items()}
            out += self.equilibrium(k, a, R, noise)
            for c in self.s.contacts:
                out += self.balance(k, a, c, R, noise)
                out += self.friction(k, a, before, c)
                out += self.overlap(k, a, c)
            before = a
        return out

    def equilibrium(self, k: int, a: Answer, R: Any, noise: Any) -> list[Finding]:
        """Nothing is left of `K u - f` but on contact surfaces and at supports."""
        out = []
        for name, m in self.made.items():
            inner = np.ones(m.basis.N, dtype=bool)
            inner[m.D] = False
            for side, patch in self.patches.items():
                if side[0] == name:
                    inner[patch.dofs] = False
            left = float(np.abs(R[name][inner]).max(initial=0.0))
            if not left <= FORCE * np.abs(R[name]).max() + noise[name]:
                out.append(Finding("equilibrium", k, f"{name}: {left:.3g} left inside"))
            driven = name == self.s.bodies[-1].name and self.s.drive == "x"
            x = given(self.s, m, self.s.steps[k]) if driven else np.zeros(m.basis.N)
            off = float(np.abs(a.u[name] - x)[m.D].max(initial=0.0))
            if not off <= 1e-12 * max(np.abs(x).max(), np.abs(a.u[name]).max()):
                out.append(
                    Finding("supports", k, f"{name}: prescribed displacements are off by {off:.3g}")
                )
        return out

    def _resultant(self, side: tuple[str, str], R: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
        """Force and moment left on a surface; whether supports or another contact have a part in it."""
        m, dofs = self.made[side[0]], self.patches[side].dofs
        force = np.zeros((m.basis.N, 3))
        for c, i in enumerate(components(m.basis)):
            force[i, c] = R[i]
        others = [p.dofs for other, p in self.patches.items() if other[0] == side[0] and other != side]
        shared = bool(np.isin(dofs, np.concatenate([m.D, *others])).any())
        F, x = force[dofs], m.basis.doflocs[:, dofs].T
        return F.sum(axis=0), np.cross(x, F).sum(axis=0), shared

    def balance(self, k: int, a: Answer, c: ContactSpec, R: Any, noise: Any) -> list[Finding]:
        """What is left on both surfaces is what is reported, and opposite."""
        out, told = [], a.contacts[c.name]
        size = float(np.abs(told.forces).sum())
        arm = max(float(np.abs(self.patches[c.secondary].x).max()), self.s.size)
        for side, sign in ((c.secondary, 1.0), (c.primary, -1.0)):
            if side is None:
                continue
            force, moment, shared = self._resultant(side, R[side[0]])
            if shared:
                continue
            allowed = 1e-6 * size + noise[side[0]] * len(self.patches[side].dofs)
            off = float(np.abs(force - sign * told.force).max())
            if not off <= allowed:
                out.append(
                    Finding(
                        "balance", k, f"{c.name}, {side[0]}: forces differ by {off:.3g} of {size:.3g}"
                    )
                )
            off = float(np.abs(moment - sign * told.moment).max())
            # moments across a gap: the pair of tangential forces, and normals that are not the line
            lever = 0.0 if side == c.secondary else self._lever(a, c)
            if not off <= allowed * arm + lever:
                out.append(
                    Finding(
                        "moment",
                        k,
                        f"{c.name}, {side[0]}: moments differ by {off:.3g} of {size * arm:.3g}",
                    )
                )
        return out

    def _lever(self, a: Answer, c: ContactSpec) -> float:
        """Moment that forces across a gap may leave: friction times gap, and normals times the turn."""
        one, two = self.patches[c.secondary], self.patches[c.primary]
        apart = float(np.abs(self._gap0(c)).max())
        turn = max(float(one.turn.max()), float(two.turn.max()))
        chord = turn * (one.h + two.h) * (turn > 1e-9)
        size = float(np.abs(a.contacts[c.name].forces).sum())
        friction = 0.0 if c.friction is None and not c.tied else 1.0
        return (
            2
            * size
            * ((apart + chord) * (friction + 2 * turn) + 2 * c.interference * self.s.size * friction)
        )

    def _gap0(self, c: ContactSpec) -> np.ndarray:
        one, two = self.patches[c.secondary], self.patches[c.primary]
        f = feet(one.x, two)
        g = np.sum((one.x - f.foot) * f.normal, axis=1)
        return g[f.off < 1e-6 * one.h]

    def friction(self, k: int, a: Answer, before: Answer | None, c: ContactSpec) -> list[Finding]:
        """Compression, the bound, and work against the slip."""
        told, out = a.contacts[c.name], []
        if c.tied:
            return out
        size = float(np.abs(told.forces).sum()) + 1e-9 * self.most
        N = np.sum(told.forces * told.normal, axis=1)
        T = np.linalg.norm(told.forces - N[:, None] * told.normal, axis=1)
        if not N.min(initial=0.0) >= -1e-9 * size - 1e-9 * self.most:
            out.append(
                Finding("compression", k, f"{c.name}: a point pulls with {N.min():.3g} of {size:.3g}")
            )
        bound = np.zeros(len(N))
        if c.friction is not None:
            unit = self.s.unit
            if c.friction[0] == "tresca":
                bound = c.friction[1] * unit * told.area * (told.status > 0)
            else:
                _, mu, cap, cohesion = c.friction
                bound = np.minimum(
                    mu * np.maximum(N, 0) + cohesion * unit * told.area, cap * unit * told.area
                )
        over = float((T - bound).max(initial=0.0))
        if not over <= 1e-7 * size:
            out.append(
                Finding("bound", k, f"{c.name}: friction is {over:.3g} above its bound, of {size:.3g}")
            )
        if c.friction is not None:
            if not told.dissipation >= -1e-9 * size * self._moved(a, before):
                out.append(
                    Finding("dissipation", k, f"{c.name}: friction gives {-told.dissipation:.3g}")
                )
            out += self._against(k, a, before, c, N, T, bound, size)
        return out

    def _moved(self, a: Answer, before: Answer | None) -> float:
        return max(
            float(np.abs(u).max()) + (float(np.abs(before.u[n]).max()) if before else 0.0)
            for n, u in a.u.items()
        )

    def _against(self, k, a, before, c, N, T, bound, size) -> list[Finding]:  # type: ignore[no-untyped-def]
        """Sliding friction points against the slip of the step, by displacements of both sides."""
        if c.method != "node" and c.primary is not None:
            return []
        told, one = a.contacts[c.name], self.patches[c.secondary]
        if one.fine:
            return []
        tree = cKDTree(one.x)
        far, i = tree.query(told.points)
        here = far < 1e-6 * one.h

        def relative(answer: Answer) -> np.ndarray:
            u = one.displaced(answer.u[c.secondary[0]])[i]
            if c.primary is None:
                return u
            two = self.patches[c.primary]
            return u - feet(told.points, two).of(two, two.displaced(answer.u[c.primary[0]]))

        ds = relative(a) - (relative(before) if before else 0.0)
        ds -= np.sum(ds * told.normal, axis=1)[:, None] * told.normal
        F = told.forces - N[:, None] * told.normal
        slip = np.linalg.norm(ds, axis=1)
        # a point that was open before has slid before it closed
        on = (
            here
            & (LOADED * np.abs(N).max() < N)
            & (before is None or before.contacts[c.name].normal_force > 0)
        )
        if before is None:
            on &= (
                told.gap <= 0
            )  # all that touch since the beginning is not known: judged from step 1 on
            return []
        sticks = on & (0.999 * bound > T)
        travel = max(slip[on].max(initial=0.0), 1e-9 * self._moved(a, before))
        turn = max(one.turn.max(), 0.0 if c.primary is None else self.patches[c.primary].turn.max())
        lead = 1e-6 + 3 * float(turn)
        out = []
        if (slip[sticks] > 1e-5 * travel + lead * travel + 1e-8 * self._moved(a, before)).any():
            out.append(
                Finding(
                    "stick",
                    k,
                    f"{c.name}: slips by {slip[sticks].max():.3g} of {travel:.3g} below the bound",
                )
            )
        slides = on & (slip > 1e-3 * travel)
        work = np.sum(F * ds, axis=1)
        wrong = slides & (work > (1e-6 + lead) * T * slip)
        if wrong.any():
            out.append(
                Finding(
                    "against",
                    k,
                    f"{c.name}: friction pushes along the slip at {int(wrong.sum())} points",
                )
            )
        return out

    def overlap(self, k: int, a: Answer, c: ContactSpec) -> list[Finding]:
        """No overlap of the deformed faces, and no force across a gap."""
        one = self.patches[c.secondary]
        moved = one.displaced(a.u[c.secondary[0]])
        turn = one.turn
        if c.primary is None:
            gap, allowed, covered = self._to_obstacle(c, one, moved)
        else:
            two = self.patches[c.primary]
            f = feet(one.x, two)
            away = moved - f.of(two, two.displaced(a.u[c.primary[0]]))
            gap = np.sum(f.normal * (one.x - f.foot + away), axis=1) - c.interference * self.s.size
            covered = f.off <= 1e-6 * one.h
            facing = -np.sum(one.outward * f.normal, axis=1)[covered]
            tilt = float(np.arccos(np.clip(facing, -1, 1)).max(initial=0.0))
            bent = max(float(turn.max()), float(two.turn.max()), tilt if tilt > 1e-7 else 0.0)
            # normals of both sides differ by that; slip along them
            allowed = 2 * bent * np.linalg.norm(away, axis=1).max() + CHORD * bent * max(one.h, two.h)
            if bent > 1e-9:
                allowed += CHORD * bent * float(np.abs(self._gap0(c)).max())
            allowed += two.crooked(two.x) + two.crooked(two.displaced(a.u[c.primary[0]]))
            if c.tied:
                return self._glued(k, c, one, away, gap, covered, allowed)
        told = a.contacts[c.name]
        return self._means(k, c, one, told, gap, covered, allowed)

    def _to_obstacle(self, c: ContactSpec, one: Patch, moved: np.ndarray) -> Any:
        kind, point, form = c.obstacle
        x, p = one.x + moved, self.s.at(point)
        size = float(np.abs(moved).max())
        if kind == "plane":
            n = self.s.R @ np.array(form)
            return (x - p) @ n, 1e-9 * self.s.size * 0 + 1e-12 * np.abs(x).max(), np.ones(len(x), bool)
        d, radius = x - p, form * self.s.size
        if kind == "cylinder":
            axis = self.s.R @ np.array([0.0, 1.0, 0.0])
            d = d - (d @ axis)[:, None] * axis
        # faces are chords of the obstacle; small sliding keeps its tangent planes
        allowed = (one.h**2 + size**2) / radius
        return np.linalg.norm(d, axis=1) - radius, allowed, np.ones(len(x), bool)

    def _glued(self, k, c, one, away, gap, covered, allowed) -> list[Finding]:  # type: ignore[no-untyped-def]
        """Glued surfaces do not come apart, in the mean over the neighbourhood of a node."""
        phi = one.means(c)
        whole = phi[:, ~covered].sum(axis=1) < 1e-12
        mean = phi @ away / phi.sum(axis=1)[:, None]
        off = np.linalg.norm(mean, axis=1)
        out = []
        for i in np.flatnonzero(whole):
            on = phi[i] > 0
            vary = float(np.ptp(away[on], axis=0).max())
            if off[i] > MEAN * vary + allowed + 1e-9 * float(np.abs(away).max()) + 1e-13 * self.s.size:
                out.append(
                    Finding("glue", k, f"{c.name}: apart by {off[i]:.3g}, varying by {vary:.3g}", True)
                )
                break
        return out

    def _means(self, k, c, one, told, gap, covered, allowed) -> list[Finding]:  # type: ignore[no-untyped-def]
        """Means of the gap over the neighbourhood of nodes that are covered."""
        out = []
        forces = np.zeros(len(one.nodes))
        near = cKDTree(self.made[c.secondary[0]].basis.mesh.p[:, one.nodes].T)
        far, node = near.query(told.points)
        here = far < 1e-6 * one.h
        np.add.at(forces, node[here], told.normal_force[here])
        phi = one.means(c)
        whole = phi[:, ~covered].sum(axis=1) < 1e-12
        tiny = (
            1e-9 * float(np.abs(gap[np.isfinite(gap)]).max(initial=0.0)) + 1e-12 * np.abs(one.x).max()
        )
        for i in np.flatnonzero(whole):
            on = phi[i] > 0
            mean = float(phi[i] @ gap / phi[i].sum())
            vary = float(np.ptp(gap[on]))
            loose = MEAN * vary + allowed + tiny
            if mean < -loose:
                out.append(Finding("overlap", k, f"{c.name}: {-mean:.3g}, varying by {vary:.3g}", True))
                break
            if forces[i] > LOADED * max(forces.max(), 1e-9 * self.most) and mean > loose:
                out.append(
                    Finding(
                        "gap", k, f"{c.name}: a force across {mean:.3g}, varying by {vary:.3g}", True
                    )
                )
                break
        return out
