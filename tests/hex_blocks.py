"""Two blocks of hexahedra with friction between them, paired by hand, and what judges their answers.

The interface is a graph ``z = h(x, y)``, plane or wavy; the nodes of the upper block meet the lower
one's where the meshes match, else their bilinear weights. Tangents are turned at random about the
normals. The lower block stands on its bottom, the top of the upper one is moved rigidly.

The judge knows of the library nothing but stiffness and rows: displacements follow from the contact
forces by a factorisation of all DOFs, and the conditions are one projection, point by point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import skfem as fem
from quick_elasticity import linear_elasticity
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu
from skfem.models.elasticity import lame_parameters
from statuses import OPEN

import skfem_contact as sc
from skfem_contact.bodies import stack
from skfem_contact.conditions import CheckedLaw, FrictionRule, Kinematics, LoadCase, rigid_motions
from skfem_contact.linalg import AMG, Direct
from skfem_contact.loops import (
    LOOPS,
    Step,
    admissible,
    drive,
    natural_state,
    possible_starts,
    starting_values,
)
from skfem_contact.problem import Condensed, FullSystem, IteratedBodies, MultigridBodies, PosedOn


@dataclass(frozen=True)
class Scene:
    """What is varied; lengths are shares of the edge of the blocks, 1."""

    nodes: int = 5  # of the upper block along an edge
    below: int = 0  # of the lower one; 0: as many
    mu: float = 0.3
    wave: float = 0.0  # height of the waves, which are as long as the blocks
    ratio: float = 1.0  # modulus of the upper block; that of the lower one is 1
    poisson: float = 0.3
    bulge: float = 0.0  # gap at the corners, of a sphere
    thick: float = 1.0
    frames: int = 0  # seed of the tangents
    held: bool = True  # whether the top of the upper block is


def random_scene(rng, coefficients, nodes=(5, 6)):
    """Any of these; slopes up to 36 and 57 degrees."""
    n = int(rng.choice(nodes))
    return Scene(
        nodes=n,
        below=int(rng.choice([0, 0, n - 1, n + 1])),
        mu=float(rng.choice(coefficients)),
        wave=float(rng.choice([0, 0, 0.116, 0.245])),
        ratio=float(rng.choice([1, 1, 0.01, 1000])),
        poisson=float(rng.choice([0.3, 0.45])),
        bulge=float(rng.choice([0, 0, 0.02])),
        thick=float(rng.choice([1.0, 0.3])),
        frames=int(rng.integers(1e6)),
    )


HISTORIES = ("random", "torsion", "turning", "cycles", "large", "bare")


def history(rng, kind):
    """Eight rigid motions of the top, each a shift and a turn."""
    deep = 0.02 * rng.uniform(0.5, 1.5)
    k = np.arange(8)
    shift, turn = np.zeros((8, 3)), np.zeros((8, 3))
    shift[:, 2] = -deep
    if kind == "random":
        shift = rng.standard_normal((8, 3)) * deep
        shift[:, 2] = -deep * rng.uniform(0.3, 1.5, 8)
        turn = rng.standard_normal((8, 3)) * deep * [0.5, 0.5, 1]
    elif kind == "torsion":  # and back
        turn[:, 2] = np.array([0, 1, 2, 3, 2, 1, -1, 0]) * deep * rng.uniform(0.3, 1, 8)
    elif kind == "turning":  # along a circle
        shift[:, :2] = deep * np.column_stack([np.cos(0.5 * k), np.sin(0.5 * k)])
    elif kind == "cycles":  # pressed, slid, let go in part
        shift[:, 0] = deep * np.array([0, 1, 1, -1, -1, 1, 1, -1])
        shift[:, 1] = deep * 0.3 * k * rng.uniform(size=8)
        shift[:, 2] *= [1, 1, 0.5, 0.5, 1, 1, 0.2, 0.5]
    elif kind == "large":
        shift = rng.standard_normal((8, 3)) * 5 * deep
        shift[:, 2] = -deep * rng.uniform(-0.3, 3, 8)
        turn = rng.standard_normal((8, 3)) * deep * [1, 1, 5]
    else:  # bare: nothing is pressed before
        shift = rng.standard_normal((8, 3)) * deep
        shift[:, 2] = deep * rng.uniform(-1, 1, 8)
        turn = rng.standard_normal((8, 3)) * deep
    return list(zip(shift, turn, strict=True))


def interface(x, y, scene):
    """Heights, unit normals and tangents, the tangents turned at random."""
    k, a = 2 * np.pi, scene.wave
    h = a * np.sin(k * x) * np.cos(k * y)
    slopes = a * k * np.cos(k * x) * np.cos(k * y), -a * k * np.sin(k * x) * np.sin(k * y)
    normal = np.column_stack([-slopes[0], -slopes[1], np.ones_like(x)])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    rng = np.random.default_rng(scene.frames)
    first = np.cross(normal, rng.standard_normal(normal.shape))
    first /= np.linalg.norm(first, axis=1)[:, None]
    return h, normal, np.stack([first, np.cross(normal, first)], axis=1)


def block(count, low, high, scene, E, name, held):
    """A block between two heights whose side at z = 0 follows the waves, and the nodes there."""
    grid = np.linspace(0, 1, count)
    mesh = fem.MeshHex.init_tensor(grid, grid, np.linspace(low, high, 3))
    p, far = mesh.p.copy(), low + high
    side = np.flatnonzero(p[2] == 0)
    side = side[np.lexsort((p[1, side], p[0, side]))]
    opposite = p[2] == far
    p[2] += interface(p[0], p[1], scene)[0] * (1 - p[2] / far)
    basis = fem.Basis(fem.MeshHex(p, mesh.t), fem.ElementVector(fem.ElementHex1()), intorder=2)
    D = basis.nodal_dofs[:, opposite].ravel() if held else np.zeros(0, dtype=int)
    form = linear_elasticity(*lame_parameters(E, scene.poisson))
    return sc.Body(basis, form, D=D, name=name), side


def hats(x, count):
    """Values of the piecewise linear hats on a grid of [0, 1], shape (len(x), count)."""
    grid = np.linspace(0, 1, count)
    return np.column_stack([np.interp(x, grid, row) for row in np.eye(count)])


def checked_law(law, points):
    """A law whose bounds are looked at, at points of one contact."""
    return CheckedLaw(law, "joint", np.asarray(points, dtype=float))


def friction_rule(law, points, area, reference):
    """The rule of friction of points that have one law, or none of it."""
    laws = () if law is None else ((slice(0, len(points)), checked_law(law, points)),)
    return FrictionRule(laws, area, reference)


class Blocks:
    """Two blocks, their rows, and the contact problem: by one of the routes."""

    def __init__(self, scene, route="points"):
        self.scene = scene
        below = scene.below or scene.nodes
        self.lower, bottom = block(below, -scene.thick, 0.0, scene, 1.0, "lower", True)
        self.upper, top = block(scene.nodes, 0.0, scene.thick, scene, scene.ratio, "upper", scene.held)
        self.system = stack([self.lower, self.upper])
        self.stiffness = [self.lower.K, self.upper.K]
        points = self.upper.basis.mesh.p[:, top].T
        x, y = points[:, 0], points[:, 1]
        _, normal, tangent = interface(x, y, scene)
        weights = np.einsum("ia,ib->iab", hats(x, below), hats(y, below)).reshape(len(x), -1)
        m, n = len(x), self.system.n
        up = self.system.offsets[1] + self.upper.basis.nodal_dofs[:, top].T
        down = self.lower.basis.nodal_dofs[:, bottom].T

        def rows(direction):
            B = np.zeros((m, n))
            for c in range(3):
                B[np.arange(m), up[:, c]] += direction[:, c]
                B[:, down[:, c]] -= weights * direction[:, c, None]
            return B

        B_t = csr_matrix(np.stack([rows(tangent[:, k]) for k in (0, 1)], axis=1).reshape(2 * m, n))
        ends = [np.where((v == 0) | (v == 1), 0.5, 1.0) / (scene.nodes - 1) for v in (x, y)]
        true, own, zero = np.ones(m, dtype=bool), np.arange(m), np.zeros(m)
        self.kin = Kinematics(
            B_n=csr_matrix(rows(normal)),
            tangential=lambda: B_t,
            tangents=2,
            gap0=2 * scene.bulge * ((x - 0.5) ** 2 + (y - 0.5) ** 2),
            area=ends[0] * ends[1],
            points=points,
            normal=normal,
            tangent=tangent,
            paired=true,
            tied=~true,
            bilateral=~true,
            heir=own,
            action=points,
            offset=np.zeros_like(points),
            tilt=zero,
            vertex=np.full(m, -1),
        )
        prefer = np.zeros(n, dtype=bool)
        prefer[up] = True
        motions = rigid_motions(self.system, self.kin, self.stiffness)
        on = PosedOn(self.kin, motions, None, true, prefer)
        wanted = np.unique(np.r_[self.kin.B_n.indices, B_t.indices])
        if route == "full":
            bodies = FullSystem(self.system, self.stiffness, Direct())
        elif route == "multigrid":
            bodies = MultigridBodies(self.system, self.stiffness, wanted, backend=AMG(tol=1e-12))
        else:
            kind = {"points": Condensed, "iterated": IteratedBodies}[route]
            bodies = kind(self.system, self.stiffness, wanted)
        self.problem = bodies.attach(on)
        self.law = sc.Coulomb(scene.mu)

    def moved(self, shift, turn=(0.0, 0.0, 0.0)):
        """A load case: the top shifted, and turned about its middle."""
        x, start, body = np.zeros(self.system.n), self.system.offsets[1], self.upper
        arm = body.dof_points[body.D] - [0.5, 0.5, self.scene.thick]
        u = np.asarray(shift) + np.cross(np.asarray(turn, dtype=float), arm)
        x[start + body.D] = u[np.arange(len(u)), body.dof_component[body.D]]
        return self.case(x)

    def case(self, x, f=None):
        m, f = self.kin.m, np.zeros(self.system.n) if f is None else f
        return LoadCase(f, x, self.kin.gap0, np.zeros((m, 2)), np.zeros(m), ())

    def rule(self, law, last):
        """The rule of friction, the same law at all points."""
        return friction_rule(law, self.kin.points, self.kin.area, last.reference)

    def rest(self):
        return natural_state(self.kin, 0).along(self.kin)

    def step(self, case, last, **changes):
        m, true = self.kin.m, np.ones(self.kin.m, dtype=bool)
        softest = min(K.diagonal().max() for K in self.stiffness)
        terms = max(np.abs(case.f).max(), softest * np.abs(case.x).max())
        one = Step(
            problem=self.problem,
            load=self.problem.load(case),
            motions=self.problem.motions,
            paired=true,
            tied=~true,
            bilateral=~true,
            friction=self.rule(self.law, last),
            frictional=true,
            stiffness=np.full(m, np.inf),
            last=last,
            rank=np.arange(m),
            noise=10 * np.finfo(float).eps * terms,
            resistance=self.problem.resistance,
        )
        return replace(one, **changes)

    def state(self, it, last):
        """What is remembered of an iterate."""
        r, opened = it.response, it.status == OPEN
        return replace(
            last,
            status=it.status,
            slip=r.slip,
            tangential_force=np.where(opened[:, None], 0.0, r.tangential_force),
            normal_force=np.where(opened, 0.0, r.normal_force),
            reference=np.where(opened[:, None], r.slip, last.reference),
            gap=r.gap,
        )

    @cached_property
    def _judge(self):
        K = self.system.K.tocsc()
        free = np.setdiff1d(np.arange(self.system.n), self.system.D)
        factor, rows = splu(K[free][:, free]), self.kin.B_n[:, free].toarray()
        return K, free, factor, 1 / np.einsum("ij,ji->i", rows, factor.solve(rows.T))

    def residual(self, case, last, state, law=None):
        """Largest distance from the contact conditions, over the force that holds a point stuck.

        Displacements follow from the contact forces; nothing of the contact problem is used.
        """
        K, free, factor, r = self._judge  # any positive numbers r serve
        lam, tau = state.normal_force, state.tangential_force
        u = case.x.copy()
        rhs = case.f + self.kin.B_n.T @ lam - self.kin.B_t.T @ tau.ravel() - K @ case.x
        u[free] += factor.solve(rhs[free])
        gap = case.gap0 + self.kin.B_n @ u
        slip = (self.kin.B_t @ u).reshape(tau.shape)
        counted = slip - last.reference
        limit = (law or self.law).limit(np.maximum(lam, 0), self.kin.area, counted)
        trial = tau + r[:, None] * (slip - last.slip)
        size = np.linalg.norm(trial, axis=1)
        back = trial * np.minimum(1, limit / np.where(size > 0, size, 1))[:, None]
        back[lam <= 0] = 0
        wrong = max(np.abs(lam - np.maximum(lam - r * gap, 0)).max(), np.abs(tau - back).max())
        return wrong / (r.max() * np.abs(case.x).max())


def attempts(blocks, step, last, loop="newton", tolerance=1e-11):
    """The outcomes of the starts that a load step has, until one is good."""
    turns = step.turns
    one = LOOPS[loop]
    for start in possible_starts(len(step.paired), loop, turns):
        if start == "warm" and not last.status.any():
            continue
        found = starting_values(start, last, step, tolerance, loop, step)
        guess, spent = admissible(found.guess, step), found.spent
        outcome = drive(one.iterates, step, guess, tolerance, one.most, None, one.patience)
        if spent:
            outcome = replace(outcome, trace=(*spent.trace, *outcome.trace))
        yield start, outcome
        if outcome.converged:
            return


def advance(blocks, before, case, last, cuts=6):
    """The states and outcomes on the way to a load case; where all starts fail the step is halved."""
    step = blocks.step(case, last)
    outcomes = list(attempts(blocks, step, last))
    if outcomes[-1][1].converged:
        state = blocks.state(outcomes[-1][1].iterate, last)
        return [(case, last, state, outcomes)]
    assert cuts, outcomes[-1][1].message
    first = advance(blocks, before, before.towards(case, 0.5), last, cuts - 1)
    middle, _, state, _ = first[-1]
    return first + advance(blocks, middle, case, state, cuts - 1)
