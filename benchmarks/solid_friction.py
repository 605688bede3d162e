"""Friction between solids, measured at nodes: forces from `K u - f`, slips from displacements.

Linear faces only: the force of a node is that of its contact point there, and the slip of a point is
that of the node, or by mortar the mean of the slip with the dual function of the node, which is made
here a second time. Every allowance is a sentence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import skfem as fem
from solid_checks import FORCE, LOADED, Answer, Court, Finding, Patch, angles, feet
from solid_scenes import ContactSpec, Made, facet_basis, on_circle

#: Samples of a face a side. Slips bend where faces of the primary meet, within a sample.
FINE = 8
#: The mean of what bends within samples, with functions between -1 and 3, of how much it varies.
SAMPLED = 0.1
#: Displacements that were solved for have lost this part to the condition of `K`.
MOVED = 1e-7


@dataclass(frozen=True, eq=False)
class Points:
    """The nodes of a secondary surface, and how their slip is measured.

    `clean` are those whose faces lie wholly on the primary, away from supports and other contacts.
    """

    nodes: np.ndarray
    dofs: np.ndarray  # (m, 3)
    area: np.ndarray
    normal: np.ndarray
    clean: np.ndarray
    off: float  # angle to which normals are known
    weights: np.ndarray  # (m, q): of samples, in the mean that is a slip
    jump: Any  # displacements of all bodies -> relative displacement of the samples (q, 3)

    def slip(self, u: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Relative displacements (m, 3) along the surface, how they vary (m,), and across it (m,)."""
        at = self.jump(u)
        mean = self.weights @ at
        here = self.weights != 0
        vary = np.array([np.ptp(at[row], axis=0).max(initial=0.0) for row in here])
        across = np.sum(mean * self.normal, axis=1)
        along = mean - across[:, None] * self.normal
        return along, vary * (here.sum(axis=1) > 1), np.abs(across)


def points(court: Court, c: ContactSpec, a: Answer) -> Points | None:
    """The points of a contact, where its secondary has linear faces."""
    m, one = court.placed[c.secondary[0]], court.patches[c.secondary]
    if one.fine:
        return None
    mesh, basis = m.basis.mesh, m.basis
    dofs = basis.nodal_dofs[:, one.nodes].T
    facets = mesh.facets[:, one.facets]
    place = np.full(mesh.nvertices, -1)
    place[one.nodes] = np.arange(len(one.nodes))
    loose = ~np.isin(dofs, m.D).any(axis=1)
    for side, patch in court.patches.items():
        if side[0] == c.secondary[0] and side != c.secondary:
            loose &= ~np.isin(dofs, patch.dofs).any(axis=1)
    x = mesh.p[:, one.nodes].T
    turn = float(one.turn.max())
    if c.primary is None:
        normal, area = court.obstacle_normals(c, x, a), _areas(m, one)
        own = {c.secondary[0]: np.eye(len(x))}
        off = 2 * turn if c.obstacle[0] != "plane" else 0.0
        return Points(
            one.nodes, dofs, area, normal, loose, off, np.eye(len(x)), _at_nodes(c, dofs, own, None)
        )
    two = court.patches[c.primary]
    bent = max(turn, float(two.turn.max()))
    f = feet(x, two)
    tilt = angles(-one.normal, f.normal)[f.off <= 1e-6 * one.h].max(initial=0.0)
    off = 2 * max(bent, tilt) if max(bent, tilt) > 1e-7 else 0.0  # the arc cosine knows 1 to 1e-16
    if c.method == "node":
        area = _areas(m, one)
        clean = loose & (f.off <= 1e-6 * one.h)
        weights, jump = np.eye(len(x)), _at_nodes(c, dofs, None, (f, two))
        return Points(one.nodes, dofs, area, f.normal, clean, off, weights, jump)
    weights, samples, f, whole = _dual(m, one, two, place)
    good = loose & whole
    beside = np.zeros(len(x), dtype=bool)  # rows are merged into those of neighbours
    beside[place[facets[:, ~good[place[facets]].all(axis=0)]]] = True
    jump = _at_samples(c, samples, f, two)
    normal, area = feet(x, two).normal, _areas(m, one)
    return Points(one.nodes, dofs, area, normal, good & ~beside, off, weights, jump)


def _at_nodes(c: ContactSpec, dofs: np.ndarray, own: Any, other: Any) -> Any:
    def jump(u: dict[str, np.ndarray]) -> np.ndarray:
        out = u[c.secondary[0]][dofs]
        if other is None:
            return out
        f, two = other
        return out - f.of(two, two.displaced(u[c.primary[0]]))

    return jump


def _at_samples(c: ContactSpec, samples: Any, f: Any, two: Patch) -> Any:
    def jump(u: dict[str, np.ndarray]) -> np.ndarray:
        one = np.moveaxis(np.asarray(samples.interpolate(u[c.secondary[0]])), 0, -1).reshape(-1, 3)
        return one - f.of(two, two.displaced(u[c.primary[0]]))

    return jump


def _linear(m: Made) -> Any:
    return fem.ElementTetP1() if m.spec.element.startswith("tet") else fem.ElementHex1()


def _areas(m: Made, one: Patch) -> np.ndarray:
    """Integrals of the hats of all nodes."""
    hats = facet_basis(m.basis.mesh, _linear(m), facets=one.facets, intorder=6)
    total = fem.LinearForm(lambda v, w: v).assemble(hats)
    return np.asarray(total[one.nodes])


def _dual(m: Made, one: Patch, two: Patch, place: np.ndarray) -> tuple[Any, ...]:
    """Means with dual functions, which integrate to zero with the hats of other nodes of a face."""
    triangle = m.spec.element.startswith("tet")
    X, w = cells(triangle, FINE)
    samples = facet_basis(m.basis.mesh, m.basis.elem, facets=one.facets, quadrature=(X, w))
    hats = facet_basis(m.basis.mesh, _linear(m), facets=one.facets, quadrature=(X, w))
    x = np.moveaxis(np.asarray(samples.global_coordinates()), 0, -1).reshape(-1, 3)
    f = feet(x, two, coarse=True)
    covered = (f.off <= 1e-6 * one.h).reshape(len(one.facets), -1)
    dx, q = np.asarray(hats.dx), X.shape[1]
    weights, area = np.zeros((len(one.nodes), len(x))), np.zeros(len(one.nodes))
    whole = np.ones(len(one.nodes), dtype=bool)
    for e in range(len(one.facets)):
        at = place[hats.element_dofs[:, e]]
        on = np.flatnonzero(at >= 0)
        N = np.array([np.broadcast_to(np.asarray(hats.basis[i][0]), dx.shape)[e] for i in on])
        D = np.diag(N @ dx[e])
        psi = D @ np.linalg.solve((N * dx[e]) @ N.T, N)
        weights[np.ix_(at[on], np.arange(q * e, q * e + q))] += psi * dx[e]
        area[at[on]] += N @ dx[e]
        whole[at[on]] &= covered[e].all()
    return weights / area[:, None], samples, f, whole


def cells(triangle: bool, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles of n^2 equal parts of the reference face, and their areas."""
    i, j = (v.ravel() for v in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    if not triangle:
        return (np.array([i, j]) + 0.5) / n, np.full(n * n, 1 / n**2)
    up, down = i + j < n, i + j < n - 1
    X = np.hstack([np.array([i, j])[:, up] + 1 / 3, np.array([i, j])[:, down] + 2 / 3]) / n
    return X, np.full(X.shape[1], 0.5 / n**2)


def bounds(court: Court, c: ContactSpec, N: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Bounds of friction under normal forces."""
    if c.friction is None:
        return np.zeros(len(N))
    area = area * court.s.unit
    if c.friction[0] == "tresca":
        return c.friction[1] * area
    _, mu, cap, cohesion = c.friction
    bound = mu * np.maximum(N, 0.0) + cohesion * area
    return np.minimum(bound, cap * area) if np.isfinite(cap) else bound


def rubbing(
    court: Court, k: int, a: Answer, before: Answer | None, c: ContactSpec, R: Any, noise: Any
) -> list[Finding]:
    """All that is asked of friction at the nodes of a contact in a step."""
    p = points(court, c, a)
    if p is None or c.tied:
        return []
    name = c.secondary[0]
    F = R[name][p.dofs]
    N = np.sum(F * p.normal, axis=1)
    Ft = on_circle(court.s, c, p.normal, F - N[:, None] * p.normal, -1)
    T, size = np.linalg.norm(Ft, axis=1), np.linalg.norm(F, axis=1)
    most = float(size.max(initial=0.0))
    tiny = FORCE * most + noise[name] + court.faint + court.settled * most + 1e-3 * court.least(a)
    mu = c.friction[1] if c.friction and c.friction[0] == "coulomb" else 0.0
    b = bounds(court, c, N, p.area)
    slack = (1 + mu) * (p.off * size + tiny) / (1.0 if c.grain is None else c.grain[3])
    out = []

    def note(check: str, wrong: np.ndarray, words: str, *values: np.ndarray) -> None:
        found = np.flatnonzero(wrong & p.clean)
        if len(found):
            told = ", ".join(f"{v[found[0]]:.4g}" for v in values)
            out.append(Finding(check, k, f"{c.name}: {words} {told} at {len(found)} nodes"))

    note("compression", p.off * size + tiny < -N, "a node is pulled: normal force, size", N, size)
    note("bound", T - b > slack, "friction, bound, normal force", T, b, N)
    if c.friction is None or a.cut:
        return out
    ds, allowed = increments(court, c, p, a, before)
    ds = on_circle(court.s, c, p.normal, ds, 1)
    tau = np.zeros_like(Ft)
    R0 = None
    if before is not None:
        R0 = court.residual(k - 1, name, before.u[name])[0]
        then = R0[p.dofs] @ court.turned(c, a, before).T  # friction turns with a tool
        tau = then - np.sum(then * p.normal, axis=1)[:, None] * p.normal
        tau = on_circle(court.s, c, p.normal, tau, -1)
    if c.G is not None:  # friction is a spring up to its bound: what its force changes by is no sliding
        G = c.G * court.made[name].spec.E * court.s.unit * court.s.size
        ds = ds + (Ft - tau) / G
        # normals turn between the steps, and the normal force of then has a part along today's surface
        then = 0.0 if R0 is None else np.linalg.norm(R0[p.dofs], axis=1)
        allowed = allowed + (slack + (p.off + court.spun(c, a, before)) * then) / G
    way = np.linalg.norm(ds, axis=1)
    bears = np.maximum(most * LOADED, 10 * slack) < N
    note(
        "stick",
        bears & (b * (1 - 1e-3) - slack > T) & (way > allowed),
        "slips below the bound: slip, known to, friction, bound",
        way,
        allowed,
        T,
        b,
    )
    slides = bears & (way > 5 * allowed) & (10 * slack < T)
    apart = np.linalg.norm(
        Ft / np.where(T > 0, T, 1.0)[:, None] + ds / np.where(way > 0, way, 1.0)[:, None], axis=1
    )
    known = 4 * allowed / np.where(way > 0, way, 1.0) + 4 * slack / np.where(T > 0, T, 1.0) + 1e-5
    note(
        "against", slides & (apart > known), "friction is not against slip: by, known to", apart, known
    )
    if before is not None and (c.method == "node" or c.primary is None) and p.off == 0.0:
        out += _lost(court, k, a, before, c, p, (b, R0, way, allowed))
    return out


def increments(
    court: Court, c: ContactSpec, p: Points, a: Answer, before: Answer | None
) -> tuple[np.ndarray, np.ndarray]:
    """Slips (m, 3) in a step, and how well they are known (m,)."""
    now, vary, across = p.slip(a.u)
    ds = now
    moved = max(float(np.abs(u).max()) for u in a.u.values())
    if before is not None:
        then = p.slip(before.u)[0]
        du = {n: a.u[n] - before.u[n] for n in a.u}
        _, vary, across = p.slip(du)
        ds = now - then
        moved = max(moved, *(float(np.abs(u).max()) for u in before.u.values()))
    spun, off = 0.0, p.off
    if c.name in a.motions and court.s.finite:  # in the axes of the tool, as they are turned now
        jump = court.seen(c, p.nodes, a) - court.seen(c, p.nodes, before)
        jump = jump @ court.turned(c, a, None).T
        across = np.abs(np.sum(jump * p.normal, axis=1))
        ds = jump - np.sum(jump * p.normal, axis=1)[:, None] * p.normal
        # it turns on the way, and friction with it or with the body; a step is straight, off an arc by
        # half the square of the turn times the arm
        turns = [court.spun(c, a, before), *(court.spun(c, q, None) for q in (a, before) if q)]
        off = off + turns[0]
        x = court.placed[c.secondary[0]].basis.mesh.p[:, p.nodes].T
        arm = np.linalg.norm(x - a.motions[c.name][2], axis=1)
        spun = turns[0] * sum(turns[1:]) / 2 * arm
    elif c.name in a.motions:
        x = court.placed[c.secondary[0]].basis.mesh.p[:, p.nodes].T
        ds = ds - court.carried(c, x, a)
        ds += 0.0 if before is None else court.carried(c, x, before)
        ds -= np.sum(ds * p.normal, axis=1)[:, None] * p.normal
        # arms of its turn end at its surface, or at the node across the gap
        turns = [answer.motions[c.name][1] for answer in (a, before) if answer is not None]
        spun = sum(np.linalg.norm(turn) for turn in turns) * np.abs(court.distance(c, x))
    far = np.linalg.norm(ds, axis=1)
    if c.primary is not None:  # quadratic faces are drawn by triangles
        two = court.patches[c.primary]
        u = a.u[c.primary[0]] - (0.0 if before is None else before.u[c.primary[0]])
        moved += two.crooked(two.displaced(u)) / MOVED
        # on warped faces feet across a gap are known to the angle of the normals
        gap = np.abs(court.gap0(c)).max(initial=0.0) + c.interference * court.s.size
        spun += p.off * float(gap) / two.h * float(np.ptp(two.displaced(u), axis=0).max())
    allowed = SAMPLED * vary + 2 * off * (far + across) + MOVED * moved + court.settled * far + spun
    return ds, allowed


def _lost(
    court: Court, k: int, a: Answer, before: Answer, c: ContactSpec, p: Points, values: Any
) -> list[Finding]:
    """The energy that is reported is the mean of the bounds times the slip."""
    b, R0, way, allowed = values
    told = a.contacts[c.name]
    if a.indifferent or not p.clean.all() or len(told.points) != len(p.nodes):
        return []
    N0 = np.sum(R0[p.dofs] * p.normal, axis=1)
    x = court.made[c.secondary[0]].basis.mesh.p[:, p.nodes].T
    far = np.linalg.norm(x[:, None] - told.points[None], axis=2)
    which = far.argmin(axis=1)
    closed, was = (t.contacts[c.name].status[which] > 0 for t in (a, before))
    own = 0.5 * (b * closed + bounds(court, c, N0, p.area) * was) * way
    most = float(np.abs(told.forces).sum()) * max(float(np.abs(u).max()) for u in a.u.values())
    off = abs(float(own.sum()) - told.dissipation)
    if off <= (1e-6 + 1e3 * court.settled) * float(own.sum()) + 1e-7 * most + float(b @ allowed):
        return []
    return [
        Finding(
            "energy", k, f"{c.name}: {told.dissipation:.4g} is said to be lost, not {own.sum():.4g}"
        )
    ]
