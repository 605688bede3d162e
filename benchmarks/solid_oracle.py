"""Frictionless contact solved a second time, by least squares with bounds, with the judge's own gaps.

Where the faces of two bodies are one plane, node to face contact is known without any pairing: the
point of the primary at a node of the secondary is on that plane, and found by the judge's own search.
What is left is ``min 1/2 l W l + q l, l >= 0``, by `scipy.optimize.nnls`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.linalg as sl
from scipy.optimize import nnls
from solid_checks import Answer, Patch, feet
from solid_scenes import ContactSpec, Scene, components, given

SAME = 1e-6  # of the largest force


def fits(s: Scene) -> bool:
    """Whether the own solution knows the scene: smooth, node to face on planes, linear faces, held."""
    if s.finite or s.rigid:
        return False
    for c in s.contacts:
        upper = max(int(side[0][4:]) for side in (c.secondary, c.primary) if side is not None)
        if c.friction or (c.primary and (c.method != "node" or c.tied)):
            return False
        if c.obstacle and c.obstacle[0] != "plane":
            return False
        if c.primary and not (s.bodies[upper].bottom.plane and s.bodies[upper - 1].top.plane):
            return False
    sides = {side[0] for c in s.contacts for side in (c.secondary, c.primary) if side is not None}
    driven = s.bodies[-1].name
    return all(
        b.element in ("tet P1", "hex Q1")
        and (b.bed or b.clamped or (b.name == driven and s.drive == "x"))
        for b in s.bodies
        if b.name in sides
    )


def rows(
    s: Scene, made: Any, c: ContactSpec, start: dict[str, int], n: int
) -> tuple[np.ndarray, np.ndarray]:
    """Gaps of a contact as ``G u + g``."""
    one = Patch(made[c.secondary[0]], c.secondary[1])
    m = made[c.secondary[0]]
    nodes = m.basis.mesh.p[:, one.nodes].T
    G = np.zeros((len(nodes), n))
    if c.primary is None:
        normal = s.R @ np.array(c.obstacle[2], dtype=float)
        keep, g = np.ones(len(nodes), bool), (nodes - s.at(c.obstacle[1])) @ normal
        normal = np.tile(normal, (len(nodes), 1))
    else:
        other = made[c.primary[0]]
        two = Patch(other, c.primary[1])
        f = feet(nodes, two)
        normal, keep = f.normal, f.off < 1e-6 * one.h
        g = np.sum((nodes - f.foot) * normal, axis=1) - c.interference * s.size
        for dof in two.dofs:  # a unit displacement of each degree of freedom, seen at the feet
            u = np.zeros(other.basis.N)
            u[dof] = 1.0
            G[:, start[c.primary[0]] + dof] -= np.sum(normal * f.of(two, two.displaced(u)), axis=1)
    where = m.basis.nodal_dofs[:, one.nodes]
    for i in range(3):
        G[np.arange(len(nodes)), start[c.secondary[0]] + where[i]] += normal[:, i]
    assert len(components(m.basis)) == 3
    return G[keep], g[keep]


def solve(s: Scene, made: Any) -> list[dict[str, np.ndarray]]:
    """Resultant normal forces of all contacts, by step."""
    names = [b.name for b in s.bodies]
    sizes = [made[name].basis.N for name in names]
    start = dict(zip(names, np.cumsum([0, *sizes[:-1]]), strict=True))
    n = sum(sizes)
    K = sl.block_diag(*(made[name].K.toarray() for name in names))
    D = np.concatenate([made[name].D + start[name] for name in names])
    free = np.setdiff1d(np.arange(n), D)
    parts = [rows(s, made, c, start, n) for c in s.contacts]
    G, g = np.vstack([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    factor = sl.cho_factor(K[np.ix_(free, free)])
    V = sl.cho_solve(factor, G[:, free].T)
    W = G[:, free] @ V
    some = np.flatnonzero(W.diagonal() > 1e-9 * W.diagonal().max() * 1e-6)
    out = []
    for step in s.steps:
        f, x = np.zeros(n), np.zeros(n)
        last = slice(start[names[-1]], n)
        (x if s.drive == "x" else f)[last] = given(s, made[names[-1]], step)
        u = x.copy()
        u[free] = sl.cho_solve(factor, (f - K @ x)[free])
        q = G @ u + g
        size = 1 / np.sqrt(W.diagonal()[some])
        scaled = size[:, None] * W[np.ix_(some, some)] * size
        values, vectors = np.linalg.eigh(scaled)
        kept = values > 1e-13 * values.max()
        root = np.sqrt(values[kept])
        A, b = root[:, None] * vectors[:, kept].T, -(vectors[:, kept].T @ (size * q[some])) / root
        force = np.zeros(len(g))
        force[some] = size * nnls(A, b, maxiter=50 * len(some))[0]
        ends = np.cumsum([0, *(len(p[1]) for p in parts)])
        total = {}
        for c, i, j in zip(s.contacts, ends[:-1], ends[1:], strict=True):
            part = slice(start[c.secondary[0]], start[c.secondary[0]] + made[c.secondary[0]].basis.N)
            nodal = G[i:j, part].T @ force[i:j]
            total[c.name] = np.array([nodal[k].sum() for k in components(made[c.secondary[0]].basis)])
        out.append(total)
    return out


def against_oracle(s: Scene, made: Any, answers: list[Answer]) -> list[str]:
    """Where the library's forces are not those of the own solution."""
    if not fits(s) or not answers:
        return []
    out = []
    own = solve(s, made)
    most = max(float(np.abs(f).max()) for step in own for f in step.values())
    for k, a in enumerate(answers):
        for name, force in own[k].items():
            off = float(np.abs(a.contacts[name].force - force).max())
            if off > SAME * most + 1e-300:
                out.append(f"own solution, step {k}: {name}: {a.contacts[name].force} against {force}")
    return out
