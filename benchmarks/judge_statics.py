"""Whether rigid bodies can rest: linear programming of their balance, with friction cones."""

from __future__ import annotations

import numpy as np
from judge_geometry import Line, nearest
from judge_scenes import Made, Scene
from scipy.optimize import linprog

#: Friction is taken this much smaller: loads on the very edge may be refused.
SHARE = 0.98
#: Where contact slides far, normals turn with the strains: a share of the largest load, along any
#: motion.
PUSH = 1e-3


def feasible(
    scene: Scene,
    made: dict[str, Made],
    lines: dict[tuple[str, str], Line],
    step: tuple[float, float],
    obstacles: dict[str, np.ndarray],
    pushed: bool = False,
) -> bool | None:
    """Whether forces exist that hold all bodies in a load step, and not just on the edge.

    A body rests if its load, the reactions of its supports and the contact forces, compressive and
    within the bounds of friction, balance in force and moment. None if it could not be decided.
    `pushed`: also with a small load more along each motion of each body, either way.
    """
    names = list(made)
    columns: list[np.ndarray] = []
    signs: list[tuple[float | None, float | None]] = []
    upper: list[tuple[dict[int, float], float]] = []
    centre = np.mean([m.doflocs.mean(axis=0) for m in made.values()], axis=0)
    size = max(np.ptp(m.doflocs, axis=0).max() for m in made.values())

    def wrench(body: str, at: np.ndarray, force: np.ndarray, out: np.ndarray) -> None:
        k = 3 * names.index(body)
        arm = (at - centre) / size
        out[k : k + 3] += [force[0], force[1], arm[0] * force[1] - arm[1] * force[0]]

    rhs = np.zeros(3 * len(names))
    for name, m in made.items():
        f = m.f(*step)
        component = _components(m)
        for c in range(2):
            mine = component == c
            F = np.zeros((mine.sum(), 2))
            F[:, c] = f[mine]
            k = 3 * names.index(name)
            arm = (m.doflocs[mine] - centre) / size
            moments = arm[:, 0] * F[:, 1] - arm[:, 1] * F[:, 0]
            rhs[k : k + 3] -= [*F.sum(axis=0), moments.sum()]
        for dof in m.D:
            column = np.zeros(len(rhs))
            force = np.eye(2)[component[dof]]
            wrench(name, m.doflocs[dof], force, column)
            columns.append(column)
            signs.append((None, None))
    for spec in scene.contacts:
        secondary = lines[spec.secondary]
        if spec.primary is None:
            points, normal = secondary.X, obstacles[spec.name]
        else:
            points, normal = _facing(secondary, lines[spec.primary])
        area = secondary.area
        for i in np.flatnonzero(np.isfinite(normal[:, 0])):
            n = normal[i]
            t = np.array([-n[1], n[0]])
            here = []
            for d in (n, t):
                if d is t and spec.friction is None and not spec.tied:
                    continue
                column = np.zeros(len(rhs))
                wrench(spec.secondary[0], points[i], d, column)
                if spec.primary is not None:
                    wrench(spec.primary[0], points[i], -d, column)
                here.append(len(columns))
                columns.append(column)
                signs.append((None, None) if spec.tied or d is t else (0.0, None))
            if spec.friction is not None and not spec.tied:
                upper += _cone(spec.friction, here[0], here[1], area[i] * scene.unit)
    if not columns:
        return None
    A = np.array(columns).T
    scale = float(np.abs(rhs).max())
    if scale == 0.0 and not pushed:
        return True  # nothing has to be held
    scale = scale or 1.0
    if upper:
        B = np.zeros((len(upper), A.shape[1]))
        for row, (entries, _) in enumerate(upper):
            for k, v in entries.items():
                B[row, k] = v
        b = np.array([v for _, v in upper]) / scale
    else:
        B = b = None
    answers = []
    for push in np.vstack([np.eye(len(rhs)), -np.eye(len(rhs))]) * PUSH if pushed else [0.0]:
        load = rhs / scale + push
        found = linprog(np.zeros(A.shape[1]), B, b, A, load, bounds=signs, method="highs")
        answers.append({0: True, 2: False}.get(found.status))
    return False if False in answers else (None if None in answers else True)


def _components(m: Made) -> np.ndarray:
    component = np.zeros(m.basis.N, dtype=int)
    for rows in (m.basis.nodal_dofs, m.basis.facet_dofs, m.basis.interior_dofs):
        if rows.size:
            component[rows] = (np.arange(rows.shape[0]) % 2)[:, None]
    return component


def _facing(secondary: Line, primary: Line) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of the primary side that they look at; NaN where they look past it."""
    zero = np.zeros(primary.dofs.max() + 1)
    pieces, normals = primary.pieces(zero), primary.normals(zero)
    far, which, share = nearest(secondary.X, pieces)
    reach = np.max(np.linalg.norm(pieces[:, 1] - pieces[:, 0], axis=1))
    foot = pieces[which, 0] + share[:, None] * (pieces[which, 1] - pieces[which, 0])
    off = secondary.X - foot
    n = normals[which].copy()
    past = np.abs(n[:, 0] * off[:, 1] - n[:, 1] * off[:, 0]) > 1e-6 * reach + 0.5 * far
    n[past] = np.nan
    return secondary.X, n


def _cone(law: tuple, normal: int, tangent: int, area: float) -> list[tuple[dict[int, float], float]]:
    """Rows ``|tau| <= bound`` of a point: entries by column, and the right-hand side."""
    rows = []
    for sign in (1.0, -1.0):
        if law[0] == "tresca":
            rows.append(({tangent: sign}, SHARE * law[1] * area))
            continue
        _, mu, cap, cohesion = law
        rows.append(({tangent: sign, normal: -SHARE * mu}, SHARE * cohesion * area))
        if np.isfinite(cap):
            rows.append(({tangent: sign}, SHARE * cap * area))
    return rows
