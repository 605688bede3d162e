"""What an answer has to satisfy, measured without any of the library's operators.

Equilibrium is the judge's own `K u - f`, contact forces are what is left of it at the nodes of the
contact surfaces, overlap is that of the deformed boundaries. Every allowance is a sentence.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from judge_geometry import CORNER, PIECES, Line, angle, inside, line, nearest
from judge_near import AWAY, Foot, Near, grouped, spread_of, summed
from judge_scenes import ContactSpec, Made, Scene, place, turn

EPS = np.finfo(float).eps
#: Residuals are round-off: what `K u` itself leaves, times the growth of a factorisation.
GROWTH = 1e3
#: Beyond that, a part of the largest force of the body: the tolerance of the loops, 1e-10 of the
#: largest contact force, and of the geometry of finite sliding, are far below it.
FORCE = 1e-7
#: Round-off of the largest force of the scene at points that carry none: ten times the tolerance of
#: the loops.
REST = 1e-9
#: A facet of length h between ends that turn by an angle of t lies up to h t / 8 off the curve through
#: its ends. Of two lines each may, on either side. Mortar sets means of the gap to zero whose weights
#: run from -1 to 2, so that a gap may lie off by twice as much again.
CHORD = 0.5
#: Mortar weighs gaps with dual functions, the judge with hats. Where the one mean is zero, the other
#: was at most 0.31 of the variation of the gap over the node's facets in 100 random scenes (one: 0.44);
#: a node of its own that is let through has two thirds.
MEAN = 0.5
#: Small sliding is linear: what it neglects is of the second order, slip times angles. It is meant
#: for less than this part of a facet; beyond, a warning is due.
SECOND_ORDER = 0.1
#: Small sliding leaves forces where they began: below a facet the mesh does not resolve it, as long as
#: no more than this part of the force is beyond the end of the other line.
BEYOND = 0.1
#: Displacements that were solved for have lost this part to the condition of `K`.
MOVED = 1e-8
#: A rigid motion of a body without supports that is smaller than this part of what has moved may be the
#: round-off of forces over what hardly holds it.
SOFT = 1e-3


@dataclass(frozen=True)
class Finding:
    """A condition that an answer violates."""

    check: str
    step: int
    words: str
    excess: float  # violation over what is allowed
    geometric: bool = False  # a warning about kinematics covers it


@dataclass(frozen=True, eq=False)
class Told:
    """What the library reports of a contact, at its points."""

    points: np.ndarray
    forces: np.ndarray
    normal_force: np.ndarray
    tangential_force: np.ndarray
    status: np.ndarray
    gap: np.ndarray
    force: np.ndarray
    dissipation: float
    action: np.ndarray | None = None  # where the forces act


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer as a user reads it: displacements by body, values by contact."""

    u: dict[str, np.ndarray]
    contacts: dict[str, Told]
    message: str
    warned: tuple[str, ...] = ()
    several: bool = False

    @property
    def cut(self) -> bool:
        """Whether the way through the step is not known."""
        return "cut" in self.message


class Court:
    """A scene, and all that is judged about its answers."""

    def __init__(self, scene: Scene, made: dict[str, Made]) -> None:
        self.scene, self.made = scene, made
        self.lines: dict[tuple[str, str], Line] = {}
        self.boundary: dict[str, Line] = {}
        for spec in scene.contacts:
            for side in (spec.secondary, spec.primary):
                if side is not None and side not in self.lines:
                    m = made[side[0]]
                    self.lines[side] = line(m.basis, m.facets(side[1]))
        for name, m in made.items():
            self.boundary[name] = line(m.basis, m.basis.mesh.boundary_facets())
        self.stiff = {name: abs(m.K) for name, m in made.items()}
        X = np.concatenate([m.doflocs for m in made.values()])
        self.extent, self.centre = float(np.ptp(X, axis=0).max()), X.mean(axis=0)
        self.tiny = 1e-13 * (self.extent + np.abs(X).max())
        self.most = 0.0  # the largest force that any step had
        self.stiffest = max(float(m.K.diagonal().max()) for m in made.values())
        # round-off of the stiffest body, which contact hands on to all others: a gap is the difference
        # of two coordinates
        self.faint = 10 * EPS * self.stiffest * float(np.abs(X).max())

    @cached_property
    def shared(self) -> dict[str, np.ndarray]:
        """DOFs of a body that belong to more than one contact."""
        out = {}
        for name, m in self.made.items():
            count = np.zeros(m.basis.N, dtype=int)
            for spec in self.scene.contacts:
                for side in {spec.secondary, spec.primary} - {None}:
                    if side[0] == name:
                        count[self.lines[side].dofs.ravel()] += 1
            out[name] = count > 1
        return out

    @cached_property
    def give(self) -> dict[str, float]:
        """What forces of one on all DOFs, of random sign, do to a body beside its rigid motion."""
        out = {}
        for name, m in self.made.items():
            free = np.setdiff1d(np.arange(m.basis.N), m.D)
            size, way = np.linalg.eigh(m.K[free][:, free].toarray())
            elastic = size > 1e-12 * size.max()
            out[name] = float(np.linalg.norm(way[:, elastic] / size[elastic], axis=1).max())
        return out

    def felt(self, forces: Forces) -> float:
        """What round-off of the forces moves the bodies: one lies on the other, so that it adds up."""
        return sum(noise * self.give[name] for name, noise in forces.noise.items())

    def strained(self, name: str, u: np.ndarray, moved: float) -> np.ndarray:
        """A difference of displacements without a small rigid motion, of a body that is not held.

        What hardly holds a body (a polygon in another one holds it against turning) lets round-off of
        the forces move it by far more than it strains it. Up to `SOFT` of the displacements count as
        that; forces have agreed before this is asked.
        """
        body = self.made[name].basis
        if len(self.made[name].D):
            return u
        x, component = body.doflocs.T, np.zeros(body.N, dtype=int)
        component[body.get_dofs(elements=True).all("u^2")] = 1
        turned = np.where(component == 0, -x[:, 1], x[:, 0])
        modes = np.column_stack([component == 0, component == 1, turned]).astype(float)
        rigid = modes @ np.linalg.lstsq(modes, u, rcond=None)[0]
        return u - rigid if np.abs(rigid).max() <= SOFT * moved else u

    def motion(self, spec: ContactSpec, k: int) -> np.ndarray:
        """Translation of an obstacle in a step."""
        a, b = self.scene.steps[k]
        out = np.zeros(2)
        for d in self.scene.drives:
            if d.kind == "motion" and d.target == spec.name:
                out += a * np.array(d.normal) + b * np.array(d.tangential)
        return self.scene.size * (turn(self.scene) @ out)

    # Forces

    def forces(self, k: int, answer: Answer) -> Forces:
        """Residuals of all bodies."""
        R, noise, scale = {}, {}, {}
        for name, m in self.made.items():
            u, f = answer.u[name], m.f(*self.scene.steps[k])
            R[name] = m.K @ u - f
            size = self.stiff[name] @ np.abs(u) + np.abs(f)
            noise[name] = GROWTH * EPS * float(size.max())
            scale[name] = max(float(np.abs(f).max()), float(np.abs(R[name]).max()))
        # where nothing presses any more, forces are round-off of those that did; and a gap is the
        # difference of two displacements, whose round-off is felt as a force
        self.most = max([self.most, *scale.values()])
        moved = max(float(np.abs(u).max()) for u in answer.u.values())
        self.faint = max(self.faint, 10 * EPS * self.stiffest * moved)
        for name, m in self.made.items():
            noise[name] += REST * self.most + 10 * EPS * float(m.K.diagonal().max()) * moved
        return Forces(R, noise, scale)

    def equilibrium(self, k: int, answer: Answer, forces: Forces) -> list[Finding]:
        """Nothing is left of `K u - f` but at contact nodes and where displacements are prescribed."""
        out = []
        for name, m in self.made.items():
            inner = np.ones(m.basis.N, dtype=bool)
            inner[m.D] = False
            for side, surface in self.lines.items():
                if side[0] == name:
                    inner[surface.dofs.ravel()] = False
            left = float(np.abs(forces.R[name][inner]).max(initial=0.0))
            allowed = FORCE * forces.scale[name] + forces.noise[name]
            if not left <= allowed:
                words = f"{name}: {left:.3g} left inside, forces are {forces.scale[name]:.3g}"
                out.append(Finding("equilibrium", k, words, left / max(allowed, 1e-300)))
            x = m.x(*self.scene.steps[k])[m.D]
            off = float(np.abs(answer.u[name][m.D] - x).max(initial=0.0))
            if not off <= 1e-9 * float(np.abs(x).max(initial=0.0)) + self.tiny:
                words = f"{name}: prescribed displacements missed by {off:.3g}"
                out.append(Finding("prescribed", k, words, np.inf))
        return out

    def rest(self, k: int, answer: Answer, forces: Forces) -> list[Finding]:
        """Loads and reported contact forces hold a body without supports, whatever its `K u` says."""
        out = []
        for name, m in self.made.items():
            if len(m.D):
                continue
            f = m.f(*self.scene.steps[k])
            total = np.array([f[self._component(name) == c].sum() for c in range(2)])
            size = float(np.abs(f).sum())
            for spec in self.scene.contacts:
                told = answer.contacts[spec.name]
                for side, sign in ((spec.secondary, 1.0), (spec.primary, -1.0)):
                    if side is not None and side[0] == name:
                        total = total + sign * told.force
                        size += float(np.abs(told.forces).sum())
            off = float(np.abs(total).max())
            # the contact forces that a body is held by are known to the tolerance of the loops
            # round-off of gaps, as felt by the stiffness; a body that flies away has no excuse
            moved = min(max(float(np.abs(u).max()) for u in answer.u.values()), self.extent)
            noise = 100 * EPS * float(m.K.diagonal().max()) * moved
            if not off <= 10 * FORCE * size + REST * self.most + noise:
                words = f"{name}: loads and contact forces leave {off:.3g} of {size:.3g}"
                out.append(Finding("statics", k, words, np.inf))
        return out

    def _component(self, name: str) -> np.ndarray:
        basis = self.made[name].basis
        component = np.zeros(basis.N, dtype=int)
        for rows in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
            if rows.size:
                component[rows] = (np.arange(rows.shape[0]) % 2)[:, None]
        return component

    def blind(self, forces: Forces) -> bool:
        """Whether round-off of rigid motions hides what a thousandth of the forces would be."""
        most = max(forces.scale.values())
        hidden = any(n > 1e-3 * self.most for n in forces.noise.values())
        return most > 0 and (hidden or self.faint > self.most)

    def _side(self, side: tuple[str, str], forces: Forces) -> np.ndarray | None:
        """Contact forces at the nodes of a surface; None where supports or contacts share nodes."""
        name, surface = side[0], self.lines[side]
        if np.isin(surface.dofs, self.made[name].D).any() or self.shared[name][surface.dofs].any():
            return None
        return forces.R[name][surface.dofs]

    def held_alone(self, spec: ContactSpec) -> bool:
        """Whether a held node of one surface lies before a part of the other that moves."""
        sides = [side for side in (spec.secondary, spec.primary) if side is not None]
        held = [np.isin(self.lines[s].dofs, self.made[s[0]].D).all(axis=1) for s in sides]
        for own, other, mine, theirs in zip(sides, sides[::-1], held, held[::-1], strict=True):
            foot = Foot(self.lines[other], self.lines[own].X[mine])
            if not theirs[foot.nodes].any(axis=1).all():
                return True
        return False

    def where(self, side: tuple[str, str], spec: ContactSpec, answer: Answer) -> np.ndarray:
        """Positions on which the kinematics of a contact stands: deformed if it slides far."""
        surface = self.lines[side]
        return surface.nodes(answer.u[side[0]]) if spec.sliding == "finite" else surface.X

    def balance(self, k: int, answer: Answer, forces: Forces) -> list[Finding]:
        """What acts on one surface acts on the other, is what is reported, and at the same place."""
        out = []
        for spec in self.scene.contacts:
            told = answer.contacts[spec.name]
            second = self._side(spec.secondary, forces)
            first = None if spec.primary is None else self._side(spec.primary, forces)
            names = [s[0] for s in (spec.secondary, spec.primary) if s is not None]
            noise = sum(forces.noise[n] * len(told.points) for n in names)
            sums = [np.abs(s).sum() for s in (second, first) if s is not None]
            size = max([*sums, float(np.abs(told.forces).sum())])
            allowed = 10 * FORCE * size + noise
            pairs = []
            if second is not None:
                pairs.append(("on the secondary", second.sum(axis=0), told.force))
            if first is not None:
                pairs.append(("on the primary", first.sum(axis=0), -told.force))
            if second is not None and first is not None:
                pairs.append(("on the two sides", second.sum(axis=0), -first.sum(axis=0)))
            for what, one, two in pairs:
                off = float(np.abs(one - two).max())
                if not off <= allowed:
                    words = f"{spec.name}: forces {what} differ by {off:.3g} of {size:.3g}"
                    out.append(Finding("balance", k, words, off / max(allowed, 1e-300)))
            if second is not None and first is not None:
                out += self._moment(k, spec, answer, (second, first), allowed)
            if second is not None and (spec.method == "node" or spec.primary is None):
                out += self._points(k, spec, answer, second, allowed)
        return out

    def _moment(
        self,
        k: int,
        spec: ContactSpec,
        answer: Answer,
        sides: tuple[np.ndarray, np.ndarray],
        allowed: float,
    ) -> list[Finding]:
        total, spread = 0.0, 0.0
        for side, F in zip((spec.secondary, spec.primary), sides, strict=True):
            arm = self.where(side, spec, answer) - self.centre
            total += float(np.sum(arm[:, 0] * F[:, 1] - arm[:, 1] * F[:, 0]))
        near = self._near(spec, answer, deformed=spec.sliding == "finite")
        F = sides[0]
        n = near.normal
        tangential = np.abs(F[:, 1] * n[:, 0] - F[:, 0] * n[:, 1])
        size = np.linalg.norm(F, axis=1)
        # small sliding moves friction along the normal across the gap; and a normal that is
        # averaged is off by the turn of the facets, at an arm of the gap and of the chords
        apart = near.apart + np.abs(spec.interference) * self.scene.size
        spread = float(np.sum(tangential * apart + size * near.turned * (apart + near.h * near.turned)))
        if spec.sliding == "finite":
            spread += self.placement * self.extent * float(size.sum())
        allowed = allowed * self.extent + 2 * spread
        if abs(total) <= allowed:
            return []
        words = f"{spec.name}: moments of the two sides differ by {total:.3g}, explained {allowed:.3g}"
        return [Finding("moment", k, words, abs(total) / max(allowed, 1e-300))]

    @property
    def placement(self) -> float:
        """Tolerance of the pairing of finite sliding; the default is that of the documentation."""
        return 1e-4 if self.scene.placement is None else self.scene.placement

    def _points(
        self, k: int, spec: ContactSpec, answer: Answer, second: np.ndarray, allowed: float
    ) -> list[Finding]:
        surface, told = self.lines[spec.secondary], answer.contacts[spec.name]
        which = np.linalg.norm(surface.X[:, None] - told.points[None], axis=2).argmin(axis=0)
        forces = np.zeros_like(second)
        np.add.at(forces, which, told.forces)
        near = self._near(spec, answer, deformed=spec.sliding == "finite")
        if spec.sliding == "finite" and told.action is not None:
            beside = np.linalg.norm(told.action - near.nodes[which], axis=1) / near.h[which]
            sizes = np.linalg.norm(told.forces, axis=1)
            acts = (sizes > 0) & (beside <= AWAY)
            # the steepest shape function of a quadratic facet, that of its middle, rises by 4 / h
            allowed += float(4 * sizes[acts] @ beside[acts])
        off = float(np.abs(summed(near, second) - summed(near, forces))[which].max())
        if off <= allowed:
            return []
        words = f"{spec.name}: force of a point differs from what its node feels by {off:.3g}"
        return [Finding("nodal force", k, words, off / max(allowed, 1e-300))]

    # Friction

    def friction(self, k: int, answer: Answer, before: Answer | None, forces: Forces) -> list[Finding]:
        """Forces press, stay within the bound, and oppose the slip."""
        out = []
        for spec in self.scene.contacts:
            told = answer.contacts[spec.name]
            size = float(np.abs(told.forces).sum()) * max(
                float(np.abs(u).max()) for u in answer.u.values()
            )
            if not told.dissipation >= -1e-9 * size:
                words = f"{spec.name}: energy lost by friction is {told.dissipation:.3g}"
                out.append(Finding("dissipation", k, words, np.inf))
            if not spec.tied:
                out += self._cones(k, spec, answer, before, forces)
        return out

    def _cones(
        self, k: int, spec: ContactSpec, answer: Answer, before: Answer | None, forces: Forces
    ) -> list[Finding]:
        name, surface = spec.secondary[0], self.lines[spec.secondary]
        F = forces.R[name][surface.dofs]
        free = ~np.isin(surface.dofs, self.made[name].D).any(axis=1)
        free &= ~self.shared[name][surface.dofs].any(axis=1)
        near = self._near(spec, answer, deformed=spec.sliding == "finite")
        n, off = near.normal, near.off
        Fn = (F * n).sum(axis=1)
        t = np.column_stack([-n[:, 1], n[:, 0]])
        Ft = (F * t).sum(axis=1)
        size = np.linalg.norm(F, axis=1)
        largest = float(size[free].max(initial=0.0))
        noise = FORCE * largest + forces.noise[name]
        if spec.sliding == "finite":  # the pairing is known to its tolerance: forces and their frames
            noise += 2 * self.placement * largest
        mu, bound = self._bound(spec, Fn, near.area)
        bears = size > 1e-3 * largest + 10 * noise
        F, Fn, Ft, size, bound, free, off = grouped(near, surface, F, Fn, Ft, size, bound, free, off)
        out = []
        pulls = np.where(free, -Fn - size * off - noise, -np.inf)
        slides = np.where(free, np.abs(Ft) - bound - (1 + mu) * (size * off + noise), -np.inf)
        for what, over in (("tension", pulls), ("friction bound", slides)):
            i = int(over.argmax())
            if over[i] > 0:
                words = (
                    f"{spec.name}: at {surface.X[i].round(6).tolist()} normal {Fn[i]:.4g}, "
                    f"tangential {Ft[i]:.4g}, bound {bound[i]:.4g}, angles known to {off[i]:.2g}"
                )
                out.append(Finding(what, k, words, 1 + over[i] / max(noise, 1e-300)))
        if before is None or answer.cut or spec.friction is None:
            return out
        values = (F, Ft, t, free, noise, bound, near, off, bears)
        return out + self._direction(k, spec, answer, before, values)

    def _bound(self, spec: ContactSpec, Fn: np.ndarray, area: np.ndarray) -> tuple[float, np.ndarray]:
        if spec.friction is None:
            return 0.0, np.zeros_like(Fn)
        unit = self.scene.unit
        if spec.friction[0] == "tresca":
            return 0.0, spec.friction[1] * unit * area
        _, mu, cap, cohesion = spec.friction
        bound = mu * np.maximum(Fn, 0.0) + cohesion * unit * area
        if np.isfinite(cap):
            bound = np.minimum(bound, cap * unit * area)
        return mu, bound

    def _direction(
        self, k: int, spec: ContactSpec, answer: Answer, before: Answer, values: tuple
    ) -> list[Finding]:
        F, Ft, t, free, noise, bound, near, off, bears = values
        name, surface = spec.secondary[0], self.lines[spec.secondary]
        slid = near.jump(answer) - near.jump(before)
        if spec.primary is None:
            slid = slid - (self.motion(spec, k) - self.motion(spec, k - 1))
        along = (slid * t).sum(axis=1)
        # mortar sets means over a node's facets to zero: a point moves by as much as they differ
        spread = spread_of(surface, along)
        if spec.primary is not None:
            spread = np.maximum(spread, near.other_spread(answer, before))
        moved = max(float(np.abs(u).max()) for u in answer.u.values())
        # a normal that is off by an angle takes that part of what closes or opens for slip
        came = np.abs((slid * near.normal).sum(axis=1)) * near.off
        allowed = spread + came + MOVED * moved + self.tiny
        if spec.sliding == "finite":
            return []
        name2 = self.made[name]
        R = (name2.K @ before.u[name] - name2.f(*self.scene.steps[k - 1]))[surface.dofs]
        if spec.G is not None:
            # friction is a spring up to its bound: it goes along with what its force changes by, and
            # comes back where the force falls but does not turn
            E = self.made[name].spec.E * self.scene.unit
            changed = Ft - summed(near, (R * t).sum(axis=1))
            allowed = allowed + np.abs(changed) / (spec.G * E)
        size = np.abs(F).max()
        # a normal that is off by an angle takes that part of the force for friction, of either sign
        unsure = np.linalg.norm(F, axis=1) * off
        carries = free & (np.abs(Ft) > 1e-3 * size + 10 * noise + unsure)
        along_friction = np.where(carries, along * np.sign(Ft) - allowed, -np.inf)
        for group in near.groups:
            # their sum acts somewhere between the nodes that bear it, and slips as that place does
            some = group[bears[group]]
            along_friction[group] = along_friction[some].min(initial=np.inf) if len(some) else -np.inf
        i = int(along_friction.argmax())
        if along_friction[i] > 0:
            words = (
                f"{spec.name}: at {surface.X[i].round(6).tolist()} friction {Ft[i]:.4g} pushes along "
                f"its slip {along[i]:.4g}, known to {allowed[i]:.2g}"
            )
            return [Finding("friction along slip", k, words, 1 + along_friction[i] / allowed[i])]
        # what slides through a step from closed to closed carries the bound
        closed = np.linalg.norm(R, axis=1) > 1e-3 * size + 10 * noise
        closed &= np.linalg.norm(F, axis=1) > 1e-3 * size + 10 * noise
        closed &= (bound > 1e-3 * size + 10 * noise) & (near.full_area) & free
        for group in near.groups:
            closed[group] = False
        mu = spec.friction[1] if spec.friction[0] == "coulomb" else 0.0
        room = bound * (1 - 1e-3) - np.abs(Ft) - (1 + mu) * (np.linalg.norm(F, axis=1) * off + noise)
        slides = np.where(closed & (room > 0), np.abs(along) - 2 * allowed, -np.inf)
        i = int(slides.argmax())
        if slides[i] > 0:
            words = (
                f"{spec.name}: at {surface.X[i].round(6).tolist()} the slip grows by {along[i]:.4g}, "
                f"known to {2 * allowed[i]:.2g}, friction {Ft[i]:.4g} is below the bound {bound[i]:.4g}"
            )
            return [Finding("slip below the bound", k, words, 1 + slides[i] / allowed[i])]
        return []

    # Geometry

    def _near(self, spec: ContactSpec, answer: Answer, deformed: bool) -> Near:
        return Near(self, spec, answer, deformed)

    def overlap(self, k: int, answer: Answer, forces: Forces) -> list[Finding]:
        """Deformed boundaries do not overlap, and forces act where they touch."""
        out = []
        for spec in self.scene.contacts:
            if spec.tied:
                continue
            for side, other in ((spec.secondary, spec.primary), (spec.primary, spec.secondary)):
                if side is None:
                    continue
                out += self._overlap(k, spec, side, other, answer, forces)
        return out

    def _overlap(
        self,
        k: int,
        spec: ContactSpec,
        side: tuple[str, str],
        other: tuple[str, str] | None,
        answer: Answer,
        forces: Forces,
    ) -> list[Finding]:
        surface, u = self.lines[side], answer.u[side[0]]
        xi = np.linspace(0.0, 1.0, 5 if surface.facets.shape[1] == 2 else 9)
        samples = surface.at(surface.nodes(u), xi)
        shape = samples.shape[:2]
        samples = samples.reshape(-1, 2)
        if other is None:
            gap = self._obstacle_gap(spec, k, samples)
        else:
            u2 = answer.u[other[0]]
            gap = self._signed(other, u2, samples)
        target = spec.interference * self.scene.size
        allowed = self._allowed(spec, side, other, answer, samples, shape, k)
        with np.errstate(invalid="ignore"):
            deep = np.where(np.isfinite(gap), target - gap - allowed, -np.inf)
        out = []
        i = int(deep.argmax())
        if deep[i] > 0:
            words = (
                f"{spec.name}: {side[0]} overlaps by {target - gap[i]:.4g} near "
                f"{samples[i].round(6).tolist()}, explained {allowed[i]:.3g}"
            )
            out.append(Finding("overlap", k, words, (target - gap[i]) / allowed[i], True))
        if side == spec.secondary:
            out += self._touching(k, spec, side, answer, forces, gap - target - allowed, shape)
            out += self._at_nodes(k, spec, answer, forces, (gap - target).reshape(shape))
        return out

    def _at_nodes(
        self, k: int, spec: ContactSpec, answer: Answer, forces: Forces, gap: np.ndarray
    ) -> list[Finding]:
        """Node by node gaps are kept at nodes; by mortar their means over the facets of a node are."""
        name, surface = spec.secondary[0], self.lines[spec.secondary]
        near = self._near(spec, answer, deformed=spec.sliding == "finite")
        keep = ~np.isin(surface.dofs, self.made[name].D).any(axis=1)
        keep &= ~self.shared[name][surface.dofs].any(axis=1)
        ends = np.bincount(surface.facets[:, :2].ravel(), minlength=len(keep)) == 1
        keep &= ~ends & ~near.beyond(answer)
        if spec.sliding == "small":
            # what had no partner gets none: below a facet the mesh does not resolve where it is
            keep &= ~near.began_beyond() | (np.linalg.norm(near.jump(answer), axis=1) > near.h)
        for group in near.groups:
            keep[group] = False
        F = np.linalg.norm(forces.R[name][surface.dofs], axis=1)
        felt = 1e-3 * float(F.max()) + 10 * forces.noise[name]
        closed = felt < F
        u = answer.u[name]
        h, theta = surface.roughness(u)
        shape = gap.shape
        allowed = MOVED * max(float(np.abs(v).max()) for v in answer.u.values()) + self.tiny
        if spec.sliding == "finite":
            beside = np.full(shape[0], self.placement * self.extent)
        else:
            args = (spec, spec.secondary, spec.primary, answer, shape, np.repeat(h, shape[1]), k)
            beside = self._second_order(*args).reshape(shape).max(axis=1)
        beside = beside + allowed + h * theta / (8 * PIECES**2)  # curves are drawn with pieces
        if spec.primary is not None:
            h2, theta2 = self.lines[spec.primary].roughness(answer.u[spec.primary[0]])
            beside = beside + float((h2 * theta2).max()) / (8 * PIECES**2)
        xi = np.linspace(0.0, 1.0, shape[1])
        weight = np.where(np.isin(xi, (0.0, 1.0)), 0.5, 1.0)
        total, mass = np.zeros(len(keep)), np.zeros(len(keep))
        high, low = np.full(len(keep), -np.inf), np.full(len(keep), np.inf)
        slack = np.zeros(len(keep))
        at_node = np.full(len(keep), np.nan)
        unknown = ~np.isfinite(gap).all(axis=1)  # within the body, nearer to another edge of it
        keep[surface.facets[unknown].ravel()] = False
        gap = np.where(unknown[:, None], 0.0, gap)
        most, least = gap.max(axis=1), gap.min(axis=1)
        for column, hat in ((0, 1 - xi), (1, xi)):
            nodes = surface.facets[:, column]
            np.add.at(total, nodes, gap @ (hat * weight) * h)
            np.add.at(mass, nodes, h * (hat * weight).sum())
            np.maximum.at(high, nodes, most)
            np.minimum.at(low, nodes, least)
            np.maximum.at(slack, nodes, beside)
            at_node[nodes] = gap[:, -column]
        vertex = mass > 0
        keep &= vertex & np.isfinite(total)
        value = at_node
        if spec.primary is not None and spec.method == "mortar":
            value = np.divide(total, mass, out=np.zeros_like(total), where=vertex)
            slack = slack + MEAN * np.where(keep, high - low, 0.0)
        if spec.primary is not None:
            # gaps are those of the smooth boundaries through the nodes, from which facets are off
            slack = slack + sum(self.lines[side].sagitta() for side in (spec.secondary, spec.primary))
        out = []
        deep = np.where(keep, -value - slack, -np.inf)
        wide = np.where(keep & closed, value - slack, -np.inf)
        what = "mean gap about" if spec.method == "mortar" and spec.primary else "gap of"
        for check, over in (("overlap", deep), ("force across a gap", wide)):
            i = int(over.argmax())
            if over[i] > 0:
                words = (
                    f"{spec.name}: {what} the node at {surface.X[i].round(6).tolist()} is "
                    f"{value[i]:.4g}, explained {slack[i]:.3g}"
                )
                out.append(Finding(check, k, words, 1 + over[i] / max(slack[i], 1e-300), True))
        return out

    def _touching(
        self,
        k: int,
        spec: ContactSpec,
        side: tuple[str, str],
        answer: Answer,
        forces: Forces,
        over: np.ndarray,
        shape: tuple[int, int],
    ) -> list[Finding]:
        """Nodes with a force have a sample on their facets that touches."""
        surface = self.lines[side]
        F = np.linalg.norm(forces.R[side[0]][surface.dofs], axis=1)
        free = ~np.isin(surface.dofs, self.made[side[0]].D).any(axis=1)
        free &= ~self.shared[side[0]][surface.dofs].any(axis=1)
        least = np.full(len(surface.X), np.inf)
        over = np.where(np.isfinite(over), over, -np.inf).reshape(shape).min(axis=1)
        np.minimum.at(least, surface.facets, over[:, None])
        largest = float(F[free].max(initial=0.0))
        felt = 1e-3 * largest + 10 * forces.noise[side[0]]
        if spec.sliding == "small" and spec.primary is not None:
            near = self._near(spec, answer, deformed=False)
            past = near.beyond(answer) & (np.linalg.norm(near.jump(answer), axis=1) <= near.h)
            if F @ near.lost(answer) <= BEYOND * F.sum():
                free &= ~past
        far = np.where(free & (felt < F), least, -np.inf)
        i = int(far.argmax())
        if not far[i] > 0:
            return []
        words = (
            f"{spec.name}: a force of {F[i]:.3g} acts at {surface.X[i].round(6).tolist()} across a gap "
            f"that is {far[i]:.3g} wider than explained"
        )
        return [Finding("force across a gap", k, words, np.inf, True)]

    def _signed(self, other: tuple[str, str], u: np.ndarray, samples: np.ndarray) -> np.ndarray:
        """Signed distance to a surface; NaN within the body but nearer to another edge of it."""
        pieces = self.lines[other].pieces(u)
        far = nearest(samples, pieces)[0]
        all_pieces = self.boundary[other[0]].pieces(u)
        within = inside(samples, all_pieces)
        edge = nearest(samples[within], all_pieces)[0]
        gap = far.copy()
        gap[within] = np.where(far[within] <= edge * (1 + 1e-9) + self.tiny, -far[within], np.nan)
        return gap

    def _obstacle_gap(self, spec: ContactSpec, k: int, samples: np.ndarray) -> np.ndarray:
        kind, point, form = spec.obstacle
        at = place(self.scene, point) + self.motion(spec, k)
        if kind == "plane":
            return (samples - at) @ (turn(self.scene) @ np.array(form))
        return np.linalg.norm(samples - at, axis=1) - form * self.scene.size

    def _allowed(
        self,
        spec: ContactSpec,
        side: tuple[str, str],
        other: tuple[str, str] | None,
        answer: Answer,
        samples: np.ndarray,
        shape: tuple[int, int],
        k: int,
    ) -> np.ndarray:
        """How far a sample may be from where it should, explained by facets and kinematics."""
        lines = [(self.lines[s], answer.u[s[0]]) for s in (side, other) if s is not None]
        rough = [s.roughness(u) for s, u in lines]
        own_h = np.repeat(rough[0][0], shape[1])
        widest = own_h.copy()
        away = []
        for (s, u), (h, _) in zip(lines, rough, strict=True):
            middle = s.at(s.nodes(u), np.array([0.5]))[:, 0]
            far = np.linalg.norm(samples[:, None] - middle[None], axis=2)
            away.append(far)
            widest = np.maximum(widest, h[far.argmin(axis=1)])
        explained = np.zeros(len(samples))
        for far, (_, theta) in zip(away, rough, strict=True):
            around = np.where(far < 2 * widest[:, None], theta[None], 0.0)
            explained += CHORD * widest * around.max(axis=1)
        if spec.method == "node" and other is not None:
            # node by node only nodes of the secondary are kept out. The last node of the primary,
            # between two of them, is as far in as its facet is turned against the next
            free = np.ones(shape, dtype=bool)
            if side == spec.secondary:
                alone = np.zeros(len(lines[0][0].X), dtype=bool)
                if spec.sliding == "small":  # what had no partner when nothing had moved gets none
                    alone = self._near(spec, answer, False).began_beyond()
                free[:, [0, -1]] = alone[lines[0][0].facets[:, :2]]
            free = free.ravel()
            near_end = np.zeros(len(samples), dtype=bool)
            for far, (s, _) in zip(away, lines, strict=True):
                last = np.bincount(s.facets[:, :2].ravel(), minlength=len(s.X)) == 1
                ends = last[s.facets[:, :2]].any(axis=1)
                near_end |= (far[:, ends] < widest[:, None]).any(axis=1)
            explained[free & near_end] *= 2
            explained[free] += self._tilt(lines, away, widest, 1.0)[free]
        elif other is not None:
            part = 2 / 3 if self.held_alone(spec) else 0.5
            explained += self._tilt(lines, away, widest, part)
        if spec.primary is None and spec.obstacle[0] == "cylinder":
            # a straight facet on a round obstacle: the sagitta between its nodes
            explained += own_h**2 / (8 * spec.obstacle[2] * self.scene.size)
        moved = max(float(np.abs(u).max()) for _, u in lines)
        explained += MOVED * moved + self.tiny
        if spec.sliding == "finite":
            return explained + self.placement * self.extent
        return explained + self._second_order(spec, side, other, answer, shape, own_h, k)

    def _tilt(self, lines: list, away: list, widest: np.ndarray, part: float) -> np.ndarray:
        """Lines that cross at an angle near the end of one overlap by a part of a facet of it.

        By mortar there is one mean there: of a gap with a slope it is off at the end by half a facet.
        A held end has no multiplier: the mean is that of a facet and a half, and two thirds are left.
        Node by node the last node before the other line may be a whole facet from the end of that.
        """
        near_end = np.zeros(len(widest), dtype=bool)
        for far, (s, _) in zip(away, lines, strict=True):
            last = np.bincount(s.facets[:, :2].ravel(), minlength=len(s.X)) == 1
            ends = last[s.facets[:, :2]].any(axis=1)
            near_end |= (far[:, ends] < widest[:, None]).any(axis=1)
        (s1, u1), (s2, u2) = lines
        which = [far.argmin(axis=1) for far in away]
        normals = [s.normals(u).reshape(len(s.facets), -1, 2)[:, 0] for s, u in ((s1, u1), (s2, u2))]
        across = np.abs(angle(normals[0][which[0]], -normals[1][which[1]]))
        return np.where(near_end & (across < CORNER), part * widest * across, 0.0)

    def _second_order(
        self,
        spec: ContactSpec,
        side: tuple[str, str],
        other: tuple[str, str] | None,
        answer: Answer,
        shape: tuple[int, int],
        own_h: np.ndarray,
        k: int,
    ) -> np.ndarray:
        """Slip times the angles that small sliding does not see."""
        surface, u = self.lines[side], answer.u[side[0]]
        still = np.zeros_like(u)
        n0, n1 = surface.normals(still), surface.normals(u)
        turned = np.abs(angle(n0, n1)).reshape(len(surface.facets), -1).max(axis=1)
        xi = np.linspace(0.0, 1.0, shape[1])
        start = surface.at(surface.X, xi).reshape(-1, 2)
        motion = surface.at(u[surface.dofs], xi).reshape(-1, 2)
        angles = np.repeat(turned, shape[1])
        if other is None:
            kind, _, form = spec.obstacle
            slip = np.linalg.norm(motion - self.motion(spec, k), axis=1)
            if kind == "cylinder":
                angles = angles + slip / (form * self.scene.size)
            return np.minimum(slip * angles, SECOND_ORDER * own_h)
        line2, u2 = self.lines[other], answer.u[other[0]]
        near = Foot(line2, start)
        slip = np.linalg.norm(motion - near.at(u2[line2.dofs]), axis=1)
        m0, m1 = line2.normals(np.zeros_like(u2)), line2.normals(u2)
        angles = angles + np.abs(angle(m0, m1))[near.which]
        per = np.repeat(np.arange(len(surface.facets)), shape[1])
        opposite = np.abs(angle(n0.reshape(len(surface.facets), -1, 2)[per, 0], -m0[near.which]))
        angles = angles + np.where(opposite < CORNER, opposite, 0.0)
        for s, v in ((surface, still), (line2, np.zeros_like(u2))):
            h, theta = s.roughness(v)
            angles = angles + slip * float((theta / h).max())
        return np.minimum(slip * angles, SECOND_ORDER * own_h)


@dataclass(frozen=True, eq=False)
class Forces:
    """Residuals `K u - f` of all bodies: contact forces and reactions."""

    R: dict[str, np.ndarray]
    noise: dict[str, float]
    scale: dict[str, float]
