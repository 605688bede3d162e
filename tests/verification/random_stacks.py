"""Random stacks of two to four blocks, and whether statics alone lets them rest.

The blocks are plain scikit-fem meshes. Some carry no load at all, some hover over others, some are
held by nothing but contact. Whether forces exist that keep every block in equilibrium is asked of a
linear program that knows no stiffness and none of the library's operators: a force at every
node of the secondary sides that has a surface below it, compressive, friction within its bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenes import block_basis, elastic, weight_load
from scipy.optimize import linprog

import skfem_contact as sc


@dataclass(frozen=True, eq=False)
class Stack:
    """Blocks from the lowest to the highest, and what stands on what.

    `pairs` holds (upper, lower); a lower of -1 is the rigid floor.
    """

    bases: tuple
    loads: tuple[np.ndarray, ...]
    supports: tuple[np.ndarray, ...]
    x: tuple[np.ndarray, ...]
    moduli: tuple[float, ...]
    pairs: tuple[tuple[int, int], ...]
    mu: tuple[float | None, ...]
    method: str

    def solver(
        self,
        bodies: list[int] | None = None,
        contacts: list[int] | None = None,
        **settings,
    ) -> sc.ContactSolver:
        """The contact problem, bodies and contacts in the order wanted."""
        made = {
            i: sc.Body(
                self.bases[i],
                elastic(self.moduli[i], 0.3),
                self.loads[i],
                D=self.supports[i],
                x=self.x[i],
                name=f"block {i}",
            )
            for i in (bodies or range(len(self.bases)))
        }
        order = range(len(self.pairs)) if contacts is None else contacts
        joints = []
        for k in order:
            upper, lower = self.pairs[k]
            primary = FLOOR if lower < 0 else made[lower].surface("top")
            law = None if self.mu[k] is None else sc.Coulomb(self.mu[k])
            joints.append(
                sc.Contact(
                    made[upper].surface("bottom"),
                    primary,
                    friction=law,
                    method=self.method,
                    name=f"joint {k}",
                )
            )
        return sc.ContactSolver(list(made.values()), joints, **settings)


FLOOR = sc.RigidPlane((0.0, 0.0), (0.0, 1.0), name="floor")


def random_stack(seed: int, friction: bool | None = None) -> Stack:
    """The stack of a number."""
    rng = np.random.default_rng([seed, 4711])
    count = int(rng.integers(2, 5))
    on_floor = bool(rng.random() < 0.3)
    rough = bool(rng.random() < 0.5) if friction is None else friction
    bases, loads, supports, x, moduli, pairs, mu = [], [], [], [], [], [], []
    y, left, right = 0.0, 0.0, rng.uniform(1.0, 2.0)
    gaps = rng.random() < 0.4
    for i in range(count):
        height = rng.uniform(0.3, 1.0)
        if i:
            width = rng.uniform(0.4, 1.3) * (right - left)
            centre = rng.uniform(left, right) if rng.random() < 0.3 else 0.5 * (left + right)
            left, right = centre - 0.5 * width, centre + 0.5 * width
        if gaps and (i or on_floor):
            y += rng.choice([0.0, 0.01, 0.05])
        kind = str(rng.choice(["Q1", "P1"]))
        cells = int(rng.integers(1, 6)), int(rng.integers(1, 4))
        basis = block_basis(
            np.linspace(left, right, cells[0] + 1), np.linspace(y, y + height, cells[1] + 1), kind=kind
        )
        y += height
        bases.append(basis)
        load, x_i, D = np.zeros(basis.N), np.zeros(basis.N), np.zeros(0, dtype=int)
        E = float(10 ** rng.uniform(-1, 1))
        what = rng.choice(["none", "weight", "points"], p=[0.4, 0.3, 0.3])
        if what == "weight":
            load = weight_load(basis, (0.0, -1e-3 * rng.uniform(0.5, 2)))
        elif what == "points":
            nodes = rng.integers(0, basis.mesh.p.shape[1], 2)
            for node in nodes:
                down = -1e-3 * rng.uniform(0.2, 1.0)
                side = 1e-4 * rng.standard_normal() if rough and rng.random() < 0.5 else 0.0
                load[basis.nodal_dofs[:, node]] += (side, down)
        if i == 0 and not on_floor:
            D = basis.get_dofs("bottom").all()
        elif rng.random() < 0.25:  # held or pressed at one side or at the top
            side = str(rng.choice(["top", "left"]))
            D = basis.get_dofs(side).all()
            x_i[D[::1]] = 0.0
            x_i[np.intersect1d(basis.nodal_dofs[1], D)] = rng.choice([0.0, -0.005, 0.01, -0.02])
        elif not rough and rng.random() < 0.8:  # guided
            D = basis.nodal_dofs[0, [int(np.argmax(basis.mesh.p[1] - 1e-6 * basis.mesh.p[0]))]]
        bases[-1] = basis
        loads.append(load)
        supports.append(np.asarray(D, dtype=int))
        x.append(x_i)
        moduli.append(E)
        if i or on_floor:
            pairs.append((i, i - 1))
            if not rough:
                mu.append(None)
            else:
                mu.append(float(rng.choice([0.1, 0.3, 0.6, 1.0])))
    method = str(rng.choice(["mortar", "node"]))
    return Stack(
        tuple(bases),
        tuple(loads),
        tuple(supports),
        tuple(x),
        tuple(moduli),
        tuple(pairs),
        tuple(mu),
        method,
    )


def can_rest(stack: Stack) -> bool | None:
    """Whether forces exist that keep every block in equilibrium; None on the edge of it.

    With mortar a multiplier acts at its node, which may be beyond the end of the surface below: there
    blocks that rest on such points alone are not judged, nor those within 1e-6 of their friction.
    """
    surely, perhaps = _feasible(stack, -1e-6, "node"), _feasible(stack, 1e-6, stack.method)
    return surely if surely == perhaps else None


def _feasible(stack: Stack, slack: float, method: str) -> bool:
    """By a linear program in normal forces and friction at the nodes that have something below them,
    and reactions of prescribed DOFs; `slack` widens, or narrows, the bounds of friction."""
    size = max(np.max(np.abs(load), initial=0.0) for load in stack.loads) or 1.0
    rows = 3 * len(stack.bases)
    columns, bounds, friction = [], [], []
    for k, (upper, lower) in enumerate(stack.pairs):
        p, mu = stack.bases[upper].mesh.p, stack.mu[k] or 0.0
        for node in touching(stack, k, method):
            for direction in np.eye(2)[::-1]:
                column = np.zeros(rows)
                column[3 * upper : 3 * upper + 3] = _wrench(p[:, node], direction)
                if lower >= 0:
                    column[3 * lower : 3 * lower + 3] = -_wrench(p[:, node], direction)
                columns.append(column)
            friction.append((len(columns) - 1, mu * (1 + slack)))
            bounds += [(0.0, None), (None, None)]
    target = np.zeros(rows)
    for i, basis in enumerate(stack.bases):
        for dof in stack.supports[i]:
            columns.append(np.zeros(rows))
            columns[-1][3 * i : 3 * i + 3] = _dof_wrench(basis, dof)
            bounds.append((None, None))
        for dof in np.setdiff1d(np.flatnonzero(stack.loads[i]), stack.supports[i]):
            target[3 * i : 3 * i + 3] -= stack.loads[i][dof] / size * _dof_wrench(basis, dof)
    bound = np.zeros((2 * len(friction), len(columns)))
    for row, (t, mu) in enumerate(friction):
        bound[2 * row, [t, t - 1]] = 1.0, -mu
        bound[2 * row + 1, [t, t - 1]] = -1.0, -mu
    found = linprog(
        np.zeros(len(columns)),
        A_ub=bound,
        b_ub=np.zeros(len(bound)),
        A_eq=np.array(columns).T,
        b_eq=target,
        bounds=bounds,
        method="highs",
    )
    return bool(found.status == 0)


def touching(stack: Stack, k: int, method: str) -> np.ndarray:
    """Nodes of the upper side of a joint that can carry a force: above the lower side, or, with
    mortar, at the end of a facet that is so in part."""
    upper, lower = stack.pairs[k]
    p = stack.bases[upper].mesh.p
    base = np.flatnonzero(p[1] < p[1].min() + 1e-9)
    if lower < 0:
        return base
    base = base[np.argsort(p[0, base])]
    q = stack.bases[lower].mesh.p
    top = q[0, q[1] > q[1].max() - 1e-9]
    x = p[0, base]
    inside = (x > top.min() - 1e-9) & (x < top.max() + 1e-9)
    if method == "mortar":
        over = (x[1:] > top.min() + 1e-9) & (x[:-1] < top.max() - 1e-9)
        inside = np.append(over, False) | np.append(False, over)
    return base[inside]


def _wrench(point, direction) -> np.ndarray:
    return np.array([*direction, point[0] * direction[1] - point[1] * direction[0]])


def _dof_wrench(basis, dof) -> np.ndarray:
    component, node = np.argwhere(basis.nodal_dofs == dof)[0]
    return _wrench(basis.mesh.p[:, node], np.eye(2)[component])
