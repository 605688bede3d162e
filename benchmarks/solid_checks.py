"""What an answer in 3-D has to satisfy, measured without any of the library's operators.

Equilibrium is the judge's own `K u - f`; contact forces are what is left of it on the contact
surfaces; overlaps are distances between triangles of the deformed faces. Every allowance is a sentence.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import skfem as fem
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from solid_scenes import (
    ContactSpec,
    Made,
    Scene,
    components,
    facet_basis,
    given,
    moved,
    on_circle,
)

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
ENDS = 0.1  # of a facet: points so far beyond the end of the primary press on it, node by node
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

    def moment_about(self, centre: np.ndarray) -> np.ndarray:
        """The moment of its forces about a point."""
        return self.moment - np.cross(centre, self.force)


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer as a user reads it; `motions` are those of rigid bodies: translation, turn, centre."""

    u: dict[str, np.ndarray]
    contacts: dict[str, Told]
    message: str = ""
    motions: dict[str, tuple[np.ndarray, ...]] = field(default_factory=dict)
    indifferent: bool = False  # whether the place of some body is said to be

    @property
    def cut(self) -> bool:
        """Whether the way through the step is not known."""
        return "cut" in self.message


class Patch:
    """Faces of a body as triangles of a lattice, and integrals of hats over them."""

    def __init__(self, m: Made, tag: str) -> None:
        self.facets = m.tags[tag]
        mesh, self.fine = m.basis.mesh, m.spec.curved or "2" in m.spec.element
        triangle = m.spec.element.startswith("tet")
        X, cells = lattice(triangle, 4 if self.fine or not triangle else 2)
        basis = facet_basis(mesh, m.basis.elem, facets=self.facets, quadrature=(X, np.ones(X.shape[1])))
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
        halves = np.array([[0, 4, 20], [24, 20, 4]]) if self.n == 25 else cells
        self.coarse = (base + halves).reshape(-1, 3)
        corners = mesh.p[:, mesh.facets[:, self.facets]]
        self.h = float(np.sqrt(np.mean(np.sum(np.ptp(corners, axis=1) ** 2, axis=0) / 2)))
        linear = fem.ElementTetP1() if triangle else fem.ElementHex1()
        self.hats = facet_basis(
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


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Angles between unit vectors (p, 3)."""
    return np.asarray(np.arccos(np.clip(np.sum(one * other, axis=1), -1, 1)))


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


def feet(x: np.ndarray, patch: Patch, coarse: bool = False) -> Feet:
    """The nearest points of a patch; `coarse` takes two triangles a face to begin with."""
    triangles = patch.coarse if coarse and not patch.fine else patch.triangles
    a, b, c = (patch.x[triangles[:, i]] for i in range(3))
    share = closest(x, a, b, c)
    foot = share[..., [0]] * a + share[..., [1]] * b + share[..., [2]] * c
    t = np.argmin(np.sum((x[:, None] - foot) ** 2, axis=-1), axis=1)
    p = np.arange(len(x))
    normal = np.cross(b - a, c - a)[t]
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    flip = np.sum(normal * patch.outward[triangles[t, 0]], axis=1) < 0
    normal[flip] *= -1
    away = x - foot[p, t]
    off = np.linalg.norm(away - np.sum(away * normal, axis=1)[:, None] * normal, axis=1)
    if patch.fine or patch.n < 25:
        return Feet(t, share[p, t], normal, foot[p, t], off, triangles[t])
    # bilinear faces: the triangles only say where to begin
    samples = patch.n * (triangles[t, 0] // patch.n)[:, None] + np.array([0, 4, 20, 24])
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
        self.most = self.faint = 0.0
        #: to what part of its forces finite sliding is settled
        self.settled = 10 * s.placement if s.finite else 0.0
        self.place(None)

    def place(self, u: dict[str, np.ndarray] | None) -> None:
        """Take the surfaces where the bodies are; where nothing slides far, the undeformed ones."""
        if u is not None and not self.s.finite:
            return
        self.placed = self.made if u is None else {n: moved(m, u[n]) for n, m in self.made.items()}
        self.patches = {
            side: Patch(self.placed[side[0]], side[1])
            for c in self.s.contacts
            for side in (c.secondary, c.primary)
            if side is not None
        }

    @cached_property
    def groups(self) -> list[tuple[str, ...]]:
        """Contacts, or several with friction that share nodes: what each of them carries is free."""
        out: list[tuple[str, ...]] = []
        rough = any(c.friction or c.tied for c in self.s.contacts)
        for c in self.s.contacts:
            dofs = self.patches[c.secondary].dofs
            other = next(
                (d for d in self.s.contacts if d.secondary[0] == c.secondary[0] and d is not c), None
            )
            if rough and other and np.isin(dofs, self.patches[other.secondary].dofs).any():
                if (other.name, c.name) not in out:
                    out.append((c.name, other.name))
                continue
            out.append((c.name,))
        return out

    def displaced(self, side: tuple[str, str], a: Answer) -> np.ndarray:
        """Displacements of the samples of a surface from where `place` has put it."""
        patch = self.patches[side]
        return np.zeros_like(patch.x) if self.s.finite else patch.displaced(a.u[side[0]])

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

    def felt(self, k: int, a: Answer) -> tuple[dict[str, np.ndarray], dict[str, float]]:
        """`K u - f` of all bodies, and its round-off."""
        R, noise = {}, {}
        for name in self.made:
            R[name], noise[name] = self.residual(k, name, a.u[name])
        self.most = max([self.most, self.least(a), *(float(np.abs(r).max()) for r in R.values())])
        noise = {n: v + 1e-9 * self.most for n, v in noise.items()}
        # where nothing presses, contact hands on the round-off of the stiffest body
        moved = max(float(np.abs(u).max()) for u in a.u.values())
        stiff = max(float(m.K.diagonal().max()) for m in self.made.values())
        self.faint = 10 * EPS * stiff * moved + max(noise.values())
        return R, noise

    def examine(self, k: int, a: Answer, before: Answer | None, R: Any, noise: Any) -> list[Finding]:
        """All findings on an answer but those at the nodes of friction."""
        self.place(a.u)
        out = self.equilibrium(k, a, R, noise)
        out += self.springs(k, a)
        for c in self.s.contacts:
            out += self.balance(k, a, c, R, noise)
            out += self.friction(k, a, before, c)
            out += self.overlap(k, a, c)
        return out

    def springs(self, k: int, a: Answer) -> list[Finding]:
        """The springs of a rigid body carry what contact brings."""
        out = []
        for name, (way, turn, centre) in a.motions.items():
            stiff, arm = self.s.springs(name)
            mine = [c for c in self.s.contacts if c.name == name]
            told = [a.contacts[c.name] for c in mine]
            force = -sum((t.force for t in told), np.zeros(3))
            moment = -sum((t.moment_about(centre) for t in told), np.zeros(3))
            size = sum(float(np.abs(t.forces).sum()) for t in told) + 1e6 * self.faint
            if not np.abs(stiff * way - force).max() <= 1e-6 * size:
                out.append(Finding("springs", k, f"{name}: {stiff * way} against {force}"))
            # small sliding leaves friction and its arms where points began, across a gap
            rub = sum(float(np.abs(self.across(c, a)).sum()) for c in mine)
            known = 4e-6 * size * self.s.size + 2 * rub + self.settled * size * self.s.size
            if not np.abs(stiff * arm**2 * turn - moment).max() <= known:
                out.append(Finding("springs", k, f"{name}: {stiff * arm**2 * turn} against {moment}"))
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
            if not off <= 1e-12 * max(float(np.abs(u).max()) for u in a.u.values()):
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
        F, x = force[dofs], self.placed[side[0]].basis.doflocs[:, dofs].T
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
            lever += self.settled * size * arm
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
        apart = float(np.abs(self.gap0(c)).max())
        turn = max(float(one.turn.max()), float(two.turn.max()))
        chord = turn * (one.h + two.h) * (turn > 1e-9)
        told = a.contacts[c.name]
        size = float(np.abs(told.forces).sum())
        friction = 0.0 if c.friction is None and not c.tied else 1.0
        beside = 0.0
        if self.s.finite and c.method == "node":
            # points up to a tenth of a facet beyond the end press on the end (docs/sliding.md)
            off = feet(told.points, two).off
            off[off > ENDS * min(one.h, two.h)] = 0.0
            beside = float(np.abs(told.forces).sum(axis=1) @ off)
        return beside + 2 * size * (
            (apart + chord) * (friction + 2 * turn) + 2 * c.interference * self.s.size * friction
        )

    def gap0(self, c: ContactSpec) -> np.ndarray:
        """Distances of the samples of one side from the other, where `place` has put them."""
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
        along = told.forces - N[:, None] * told.normal
        T = np.linalg.norm(on_circle(self.s, c, told.normal, along, -1), axis=1)
        if not N.min(initial=0.0) >= -1e-9 * size - self.faint:
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
                bound = mu * np.maximum(N, 0) + cohesion * unit * told.area
                if np.isfinite(cap):
                    bound = np.minimum(bound, cap * unit * told.area)
        # corners of quadratic faces without a row of their own have negative areas, and no force
        over = float((T - np.maximum(bound, 0.0)).max(initial=0.0))
        if not over <= 1e-7 * size + self.faint:
            out.append(
                Finding("bound", k, f"{c.name}: friction is {over:.3g} above its bound, of {size:.3g}")
            )
        if not told.dissipation >= -1e-9 * size * self._moved(a, before):
            out.append(Finding("dissipation", k, f"{c.name}: friction gives {-told.dissipation:.3g}"))
        return out

    def _moved(self, a: Answer, before: Answer | None) -> float:
        return max(
            float(np.abs(u).max()) + (float(np.abs(before.u[n]).max()) if before else 0.0)
            for n, u in a.u.items()
        )

    def overlap(self, k: int, a: Answer, c: ContactSpec) -> list[Finding]:
        """No overlap of the deformed faces, and no force across a gap."""
        one = self.patches[c.secondary]
        came = self.displaced(c.secondary, a)
        turn = one.turn
        if c.primary is None:
            gap, allowed, covered = self._to_obstacle(c, one, came, a)
        else:
            two = self.patches[c.primary]
            f = feet(one.x, two)
            away = came - f.of(two, self.displaced(c.primary, a))
            gap = np.sum(f.normal * (one.x - f.foot + away), axis=1) - c.interference * self.s.size
            covered = f.off <= 1e-6 * one.h
            facing = -np.sum(one.outward * f.normal, axis=1)[covered]
            tilt = float(np.arccos(np.clip(facing, -1, 1)).max(initial=0.0))
            bent = max(float(turn.max()), float(two.turn.max()), tilt if tilt > 1e-7 else 0.0)
            # normals of both sides differ by that; slip along them
            allowed = 2 * bent * np.linalg.norm(away, axis=1).max() + CHORD * bent * max(one.h, two.h)
            if bent > 1e-9:
                allowed += CHORD * bent * float(np.abs(self.gap0(c)).max())
            allowed += two.crooked(two.x) + two.crooked(two.displaced(a.u[c.primary[0]]))
            allowed += self.settled * self.s.size
            if c.tied:
                return self._glued(k, c, one, away, gap, covered, allowed)
        told = a.contacts[c.name]
        return self._means(k, c, one, told, gap, covered, allowed)

    def _to_obstacle(self, c: ContactSpec, one: Patch, came: np.ndarray, a: Answer) -> Any:
        kind, point, form = c.obstacle
        x, p = one.x + came, self.s.at(point)
        size = float(np.abs(came).max())
        every, spun = np.ones(len(x), bool), 0.0
        if c.name in a.motions:  # to first order, as small sliding takes it
            way, turn, centre = a.motions[c.name]
            x = x - way - np.cross(turn, one.x - centre)
            spun = float(np.abs(turn).max() * np.abs(came).max())
        if kind == "plane":
            n = self.s.R @ np.array(form)
            return (x - p) @ n, 1e-12 * np.abs(x).max() + spun + self.settled * self.s.size, every
        d, radius = x - p, form * self.s.size
        if kind == "cylinder":
            axis = self.s.R @ np.array([0.0, 1.0, 0.0])
            d = d - (d @ axis)[:, None] * axis
        # faces are chords of the obstacle; small sliding keeps its tangent planes
        allowed = (one.h**2 + size**2) / radius + spun + self.settled * self.s.size
        return np.linalg.norm(d, axis=1) - radius, allowed, every

    def across(self, c: ContactSpec, a: Answer) -> np.ndarray:
        """Forces of the points of an obstacle times their distance from it, undeformed."""
        told = a.contacts[c.name]
        across = np.linalg.norm(told.forces, axis=1) * self.distance(c, told.points)
        if c.method == "node" or c.obstacle[0] == "plane":
            return across
        # by mortar arms of friction end at means over faces, which are chords of the obstacle
        N = np.sum(told.forces * told.normal, axis=1)
        rub = np.linalg.norm(told.forces - N[:, None] * told.normal, axis=1)
        return across + rub * self.patches[c.secondary].h ** 2 / (c.obstacle[2] * self.s.size)

    def distance(self, c: ContactSpec, x: np.ndarray) -> np.ndarray:
        """Distances of points from a rigid obstacle that has not moved."""
        kind, point, form = c.obstacle
        d = x - self.s.at(point)
        if kind == "plane":
            return d @ (self.s.R @ np.array(form))
        if kind == "cylinder":
            axis = self.s.R @ np.array([0.0, 1.0, 0.0])
            d = d - (d @ axis)[:, None] * axis
        return np.linalg.norm(d, axis=1) - form * self.s.size

    def obstacle_normals(self, c: ContactSpec, x: np.ndarray, a: Answer | None = None) -> np.ndarray:
        """Unit normals of a rigid obstacle at points near it; finite sliding turns them with it."""
        kind, point, form = c.obstacle
        if a is not None and self.s.finite and c.name in a.motions:
            return self.obstacle_normals(c, self.still(c, x, a)) @ self.turned(c, a, None).T
        if kind == "plane":
            return np.tile(self.s.R @ np.array(form, dtype=float), (len(x), 1))
        d = x - self.s.at(point)
        if kind == "cylinder":
            axis = self.s.R @ np.array([0.0, 1.0, 0.0])
            d = d - (d @ axis)[:, None] * axis
        return d / np.linalg.norm(d, axis=1, keepdims=True)

    def turned(self, c: ContactSpec, a: Answer, before: Answer | None) -> np.ndarray:
        """The rotation (3, 3) of an obstacle from one answer to another, where it slides far."""
        if not self.s.finite or c.name not in a.motions:
            return np.eye(3)
        now, then = (
            Rotation.identity() if q is None else Rotation.from_rotvec(q.motions[c.name][1])
            for q in (a, before)
        )
        return np.asarray((now * then.inv()).as_matrix())

    def spun(self, c: ContactSpec, a: Answer, before: Answer | None) -> float:
        """The angle of that rotation."""
        return float(np.linalg.norm(Rotation.from_matrix(self.turned(c, a, before)).as_rotvec()))

    def still(self, c: ContactSpec, x: np.ndarray, a: Answer) -> np.ndarray:
        """Where points (p, 3) are, seen from an obstacle that slides far, in the axes it began with."""
        way, _, centre = a.motions[c.name]
        return (x - way - centre) @ self.turned(c, a, None) + centre

    def seen(self, c: ContactSpec, nodes: np.ndarray, a: Answer | None) -> np.ndarray:
        """Where nodes of the secondary are, seen from there; without an answer where they began."""
        name = c.secondary[0]
        x = self.made[name].basis.mesh.p[:, nodes].T
        if a is None:
            return x
        return self.still(c, x + a.u[name][self.made[name].basis.nodal_dofs[:, nodes].T], a)

    def carried(self, c: ContactSpec, x: np.ndarray, a: Answer) -> np.ndarray:
        """How far an obstacle has moved points (p, 3) that are on it."""
        if c.name not in a.motions:
            return np.zeros_like(x)
        way, turn, centre = a.motions[c.name]
        return way + np.cross(turn, x - centre)

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
