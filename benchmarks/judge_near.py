"""What the nodes of a secondary surface have before them: feet, normals, turns, areas."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from judge_geometry import Line, angle, nearest
from judge_scenes import ContactSpec, place, turn

#: Nearer to a node than this part of a facet a force is that of the node, but for what shape functions
#: of slope up to 3 hand on (Court._points).
AWAY = 0.02


class Foot:
    """Nearest points of an undeformed line, and values there."""

    def __init__(self, surface: Line, points: np.ndarray, u: np.ndarray | None = None) -> None:
        still = np.zeros(surface.dofs.max() + 1) if u is None else u
        pieces = surface.pieces(still)
        self.distance, self.which, share = nearest(points, pieces)
        per = len(surface.xi) - 1
        self.facet = self.which // per
        xi = (self.which % per + share) / per
        self.weights = surface.weights(xi)
        self.nodes = surface.facets[self.facet]

    def at(self, values: np.ndarray) -> np.ndarray:
        """Interpolated nodal values."""
        return np.einsum("pk,pk...->p...", self.weights, values[self.nodes])


class Near:
    """What the nodes of a secondary surface have before them: normals, distances, turns."""

    def __init__(self, court: Any, spec: ContactSpec, answer: Any, deformed: bool) -> None:
        self.court, self.spec, self.answer = court, spec, answer
        surface = court.lines[spec.secondary]
        u = answer.u[spec.secondary[0]]
        u = u if deformed else np.zeros_like(u)
        self.nodes = at = surface.nodes(u)
        h, theta = _raw(surface, u)
        self.h, self.turned = np.zeros(len(at)), np.zeros(len(at))
        np.maximum.at(self.h, surface.facets, h[:, None])
        np.maximum.at(self.turned, surface.facets, theta[:, None])
        own = _node_normals(surface, u)
        self.area = _generous(surface)
        self.full_area = self.area == surface.area  # otherwise a bound by area is known from above only
        self.surface = surface
        if spec.primary is None:
            kind, point, form = court_obstacle(spec)
            here = place(court.scene, point) if kind != "plane" else None
            if kind == "plane":
                normal = np.tile(turn(court.scene) @ np.array(form), (len(at), 1))
                self.apart = np.abs((at - place(court.scene, point)) @ normal[0])
            else:
                arm = at - here
                normal = arm / np.linalg.norm(arm, axis=1)[:, None]
                self.apart = np.abs(np.linalg.norm(arm, axis=1) - form * court.scene.size)
            # an obstacle's normal is exact where it was, or where it has moved to
            self.normal = normal
            self.off = np.zeros(len(at))
            if kind != "plane":
                steps = range(len(court.scene.steps))
                moved = max(np.linalg.norm(court.motion(spec, k)) for k in steps)
                moved += float(np.abs(answer.u[spec.secondary[0]]).max())
                self.off += moved / (form * court.scene.size)
            return
        line2 = court.lines[spec.primary]
        u2 = answer.u[spec.primary[0]]
        u2 = u2 if deformed else np.zeros_like(u2)
        self.u2 = u2
        self.foot = Foot(line2, at, u2)
        self.apart = self.foot.distance
        m = line2.normals(u2)[self.foot.which]
        h2, theta2 = _raw(line2, u2)
        self.turned = self.turned + theta2[self.foot.facet]
        normal = m - own
        small = np.linalg.norm(normal, axis=1) < 0.5
        normal[small] = m[small]
        self.normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        # of two surfaces the normal is that of one, of the other, or between
        self.off = np.abs(angle(m, -own)) + self.turned
        self.h = np.maximum(self.h, h2[self.foot.facet])

    @cached_property
    def groups(self) -> list[np.ndarray]:
        """Nodes whose forces are judged by their sum: of facets that the other side covers in part, and
        of those between whose nodes a force acts."""
        if self.spec.primary is None:
            return []
        if self.spec.method == "node":
            return self._between()
        surface, line2 = self.surface, self.court.lines[self.spec.primary]
        xi = np.linspace(0.0, 1.0, 9)
        samples = surface.at(self.nodes, xi).reshape(-1, 2)
        past = _past(samples, line2.pieces(self.u2))
        part = past.reshape(len(surface.facets), -1).any(axis=1)
        return _joined(list(surface.facets[part]))

    def _between(self) -> list[np.ndarray]:
        """Where contact slides far a vertex of the primary may press in the place of a node.

        Its force acts on the nodes of a facet by their shape functions: a part at an end may pull.
        """
        told = self.answer.contacts.get(self.spec.name)
        if self.spec.sliding != "finite" or told is None or told.action is None:
            return []
        node = np.linalg.norm(self.surface.X[:, None] - told.points[None], axis=2).argmin(axis=0)
        far = np.linalg.norm(told.action - self.nodes[node], axis=1) > AWAY * self.h[node]
        far &= np.linalg.norm(told.forces, axis=1) > 0
        if not far.any():
            return []
        foot = Foot(self.surface, told.action[far], self.answer.u[self.spec.secondary[0]])
        return _joined([np.append(f, i) for f, i in zip(foot.nodes, node[far], strict=True)])

    def beyond(self, answer: Any) -> np.ndarray:
        """Nodes that the motion brought to or past the end of the other line."""
        if self.spec.primary is None:
            return np.zeros(len(self.nodes), dtype=bool)
        line2 = self.court.lines[self.spec.primary]
        here = self.surface.nodes(answer.u[self.spec.secondary[0]])
        return _at_end(here, line2, line2.pieces(answer.u[self.spec.primary[0]]))

    def began_beyond(self) -> np.ndarray:
        """Nodes that were past the end of the other line, not at it, when nothing had moved."""
        if self.spec.primary is None:
            return np.zeros(len(self.nodes), dtype=bool)
        line2 = self.court.lines[self.spec.primary]
        pieces = line2.pieces(np.zeros(line2.dofs.max() + 1))
        return _at_end(self.surface.X, line2, pieces) & _past(self.surface.X, pieces)

    def lost(self, answer: Any) -> np.ndarray:
        """The part of what a node had before it when undeformed that now lies past an end."""
        assert self.spec.primary is not None
        line2 = self.court.lines[self.spec.primary]
        u, u2 = answer.u[self.spec.secondary[0]], answer.u[self.spec.primary[0]]
        now, before = self._before(line2, u, u2), self._before(line2, 0 * u, 0 * u2)
        return np.where(before > 0, 1 - np.minimum(now / np.where(before > 0, before, 1.0), 1.0), 0.0)

    def _before(self, line2: Line, u: np.ndarray, u2: np.ndarray) -> np.ndarray:
        """How much of a node's facets has the other line before it, not its end."""
        surface, xi = self.surface, np.linspace(0.0, 1.0, 33)
        samples = surface.at(surface.nodes(u), xi).reshape(-1, 2)
        past = _past(samples, line2.pieces(u2))
        above = ~past.reshape(len(surface.facets), -1)
        out = np.zeros(len(surface.X))
        for column, hat in ((0, 1 - xi), (1, xi)):
            np.add.at(out, surface.facets[:, column], above @ hat)
        return out

    def jump(self, answer: Any) -> np.ndarray:
        """Displacement of the nodes relative to the point before them."""
        u = answer.u[self.spec.secondary[0]][self.surface.dofs]
        if self.spec.primary is None:
            return u
        line2 = self.court.lines[self.spec.primary]
        return u - self.foot.at(answer.u[self.spec.primary[0]][line2.dofs])

    def other_spread(self, answer: Any, before: Any) -> np.ndarray:
        """By how much displacements differ along the primary within a facet of the secondary."""
        line2 = self.court.lines[self.spec.primary]
        name = self.spec.primary[0]
        du = (answer.u[name] - before.u[name])[line2.dofs]
        away = (
            np.linalg.norm(self.surface.X[:, None] - line2.X[None], axis=2)
            <= 1.5 * self.h[:, None] + self.apart[:, None]
        )
        out = np.zeros(len(self.surface.X))
        for i, mine in enumerate(away):
            if mine.sum() > 1:
                out[i] = np.linalg.norm(np.ptp(du[mine], axis=0))
        return out


def _at_end(points: np.ndarray, line2: Line, pieces: np.ndarray) -> np.ndarray:
    """Which points have the end of a line before them."""
    _, which, share = nearest(points, pieces)
    per = len(line2.xi) - 1
    degree = np.bincount(line2.facets[:, :2].ravel(), minlength=len(line2.X))
    first, last = (degree[line2.facets[which // per, c]] == 1 for c in (0, 1))
    at_start = first & (which % per == 0) & (share <= 0.0)
    return at_start | last & (which % per == per - 1) & (share >= 1.0)


def _joined(sets: list[np.ndarray]) -> list[np.ndarray]:
    """Sets of nodes, those that share nodes as one."""
    groups: list[np.ndarray] = []
    for nodes in sets:
        mine = [g for g in groups if np.isin(g, nodes).any()]
        rest = [g for g in groups if not np.isin(g, nodes).any()]
        groups = [*rest, np.unique(np.concatenate([nodes, *mine]))]
    return groups


def _past(points: np.ndarray, pieces: np.ndarray) -> np.ndarray:
    """Which points have the end of a piece before them, not the piece."""
    _, which, share = nearest(points, pieces)
    d = pieces[which, 1] - pieces[which, 0]
    foot = pieces[which, 0] + share[:, None] * d
    return np.abs(((points - foot) * d).sum(axis=1)) > 1e-6 * (d * d).sum(axis=1)


def court_obstacle(spec: ContactSpec) -> tuple[Any, ...]:
    """The obstacle of a contact in local coordinates."""
    assert spec.obstacle is not None
    return spec.obstacle


def _raw(surface: Line, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Length and turn of each facet, corners included."""
    turned = np.abs(surface._turns(u))
    p = surface.pieces(u).reshape(len(surface.facets), -1, 2, 2)
    d = p[:, :, 1] - p[:, :, 0]
    inner = np.abs(angle(d[:, :-1], d[:, 1:])).sum(axis=1)
    after = np.zeros(len(turned))
    has = surface.before >= 0
    after[surface.before[has]] = turned[has]
    return np.linalg.norm(d, axis=2).sum(axis=1), inner + turned + after


def _node_normals(surface: Line, u: np.ndarray) -> np.ndarray:
    n = surface.normals(u).reshape(len(surface.facets), -1, 2)
    out = np.zeros((len(surface.X), 2))
    np.add.at(out, surface.facets[:, 0], n[:, 0])
    np.add.at(out, surface.facets[:, 1], n[:, -1])
    if surface.facets.shape[1] == 3:
        np.add.at(out, surface.facets[:, 2], n[:, n.shape[1] // 2])
    return out / np.linalg.norm(out, axis=1)[:, None]


def _generous(surface: Line) -> np.ndarray:
    """Area of each node, with its neighbours': at ends the mortar method merges nodes."""
    area = surface.area
    out = area.copy()
    for column in surface.facets.T:
        np.maximum.at(out, column, area[surface.facets].sum(axis=1))
    ends = np.bincount(surface.facets[:, :2].ravel(), minlength=len(area)) == 1
    near_end = np.zeros(len(area), dtype=bool)
    near_end[surface.facets[ends[surface.facets[:, :2]].any(axis=1)]] = True
    return np.where(near_end, out, area)


def grouped(near: Near, surface: Line, *values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Sums of forces over facets of which the other side covers a part only.

    There the forces that are equivalent to a pressure may pull at one node, as those of a pressure on
    half of a quadratic facet do; their sum may not.
    """
    F, Fn, Ft, size, bound, free, off = (v.copy() for v in values)
    for group in near.groups:
        free[group] = free[group].all()
        off[group] = off[group].max()
    return *(summed(near, v) for v in (F, Fn, Ft, size, bound)), free, off


def summed(near: Near, values: np.ndarray) -> np.ndarray:
    """Nodal values, at nodes of a group their sum."""
    out = values.copy()
    for group in near.groups:
        out[group] = values[group].sum(axis=0)
    return out


def spread_of(surface: Line, values: np.ndarray) -> np.ndarray:
    """Difference of nodal values over the facets of each node."""
    low, high = values.copy(), values.copy()
    on = values[surface.facets]
    np.minimum.at(low, surface.facets, on.min(axis=1)[:, None])
    np.maximum.at(high, surface.facets, on.max(axis=1)[:, None])
    return high - low
