"""Whether rigid solids can rest: linear programming of their balance, with cones of flat sides."""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem as fem
from scipy.optimize import linprog
from scipy.sparse import csr_matrix
from solid_checks import Court, feet
from solid_scenes import ContactSpec, components, facet_basis, given

#: Friction is taken this much smaller: loads on the very edge may be refused.
SHARE = 0.98
SIDES = 12  # of the pyramid within a friction cone


def feasible(court: Court, k: int) -> bool | None:
    """Whether forces exist that hold all bodies of a scene in a step; None if it is not decided."""
    s, made = court.s, court.made
    court.place({n: np.zeros(m.basis.N) for n, m in made.items()})
    names = list(made)
    centre = np.mean([m.basis.doflocs.mean(axis=1) for m in made.values()], axis=0)
    columns: list[np.ndarray] = []
    signs: list[tuple[float | None, float | None]] = []
    upper: list[tuple[list[int], list[float], float]] = []

    def push(parts: list[tuple[str, np.ndarray, np.ndarray]], sign: float | None) -> int:
        column = np.zeros(6 * len(names))
        for body, at, force in parts:
            i = 6 * names.index(body)
            column[i : i + 3] += force
            column[i + 3 : i + 6] += np.cross((at - centre) / s.size, force)
        columns.append(column)
        signs.append((sign, None))
        return len(columns) - 1

    rhs = np.zeros(6 * len(names))
    for b, (name, m) in enumerate(made.items()):
        if m.spec.bed or (name == names[-1] and s.drive == "x"):
            for i in range(6):
                column = np.zeros_like(rhs)
                column[6 * b + i] = 1.0
                columns.append(column)
                signs.append((None, None))
        x, rows = m.basis.doflocs, components(m.basis)
        for c, dofs in enumerate(rows):
            for dof in np.intersect1d(dofs, m.D):
                push([(name, x[:, dof], np.eye(3)[c])], None)
        if name == names[-1] and s.drive == "f":
            f = given(s, m, s.steps[k])
            for c, dofs in enumerate(rows):
                rhs[6 * b + c] -= f[dofs].sum()
                arm = (x[:, dofs].T - centre) / s.size
                rhs[6 * b + 3 : 6 * b + 6] -= (np.cross(arm, np.eye(3)[c]) * f[dofs][:, None]).sum(
                    axis=0
                )
    for spec in s.contacts:
        for at, normal, area in _nodes(court, spec):
            _point(s, spec, at, normal, area, push, upper)
    if not upper:
        A_ub = b_ub = None
    else:
        A_ub = np.zeros((len(upper), len(columns)))
        for i, (where, values, _) in enumerate(upper):
            A_ub[i, where] = values
        b_ub = np.array([bound for *_, bound in upper])
    scale = float(np.abs(rhs).max()) or 1.0
    found = linprog(
        np.zeros(len(columns)),
        None if A_ub is None else csr_matrix(A_ub),
        None if b_ub is None else b_ub / scale,
        csr_matrix(np.array(columns).T),
        rhs / scale,
        bounds=signs,
        method="highs",
    )
    return {0: True, 2: False}.get(found.status)


def _point(s: Any, spec: ContactSpec, at: Any, normal: Any, area: float, push: Any, upper: Any) -> None:
    """The forces that a point may carry."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    less = 1.0
    if spec.grain is not None:
        grain, less = s.R @ spec.grain[:3], spec.grain[3]
        first = grain - (grain @ normal) * normal
    first /= np.linalg.norm(first)
    ways = [first, np.cross(normal, first)]

    def pair(force: np.ndarray, sign: float | None) -> int:
        parts = [(spec.secondary[0], at, force)]
        if spec.primary is not None:
            parts.append((spec.primary[0], at, -force))
        return int(push(parts, sign))

    pressed = pair(normal, None if spec.tied else 0.0)
    if not (spec.tied or spec.friction):
        return
    along = [pair(t, None) for t in ways]
    if spec.tied:
        return
    within = SHARE * np.cos(np.pi / SIDES)
    for angle in 2 * np.pi * np.arange(SIDES) / SIDES:
        d = [float(np.cos(angle)) / less, float(np.sin(angle))]
        if spec.friction[0] == "tresca":
            upper.append((along, d, within * spec.friction[1] * s.unit * area))
            continue
        _, mu, cap, cohesion = spec.friction
        upper.append(([*along, pressed], [*d, -within * mu], within * cohesion * s.unit * area))
        if np.isfinite(cap):
            upper.append((along, d, within * cap * s.unit * area))


def _nodes(court: Court, c: ContactSpec) -> Any:
    """Nodes of the secondary that look at the primary, normals, and areas."""
    m, one = court.made[c.secondary[0]], court.patches[c.secondary]
    x = m.basis.mesh.p[:, one.nodes].T
    linear = fem.ElementTetP1() if m.spec.element.startswith("tet") else fem.ElementHex1()
    hats = facet_basis(m.basis.mesh, linear, facets=one.facets, intorder=6)
    area = np.asarray(fem.LinearForm(lambda v, w: v).assemble(hats))[one.nodes]
    if c.primary is None:
        return zip(x, court.obstacle_normals(c, x), area, strict=True)
    f = feet(x, court.patches[c.primary])
    on = f.off <= 1e-6 * one.h
    return zip(x[on], f.normal[on], area[on], strict=True)
