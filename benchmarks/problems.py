"""The four problems on which speed is traded for accuracy (`trade.py`): settings, scripts, errors.

Each is a whole script, from the meshes to the displacements, as a function of a `Setting`; and each
has an answer that is known:

* Hertz, two blocks with a parabolic gap, against the closed form (pressure);
* the same blocks pushed sideways, against Cattaneo and Mindlin (friction);
* Raous' block on a rigid plane, against the finest answer of another program (displacements);
* a parabolic die that is pressed onto a block, dragged along it and pulled back, against Hertz, the
  friction law and Cattaneo and Mindlin (pressure and friction together).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import skfem as fem

import skfem_contact as sc
from skfem_contact.reference import (
    RAOUS,
    block_curvature,
    cattaneo_mindlin,
    effective_modulus,
    hertz_line,
)

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "verification"))
sys.path.append(str(Path(__file__).parents[1] / "tests"))

from scenes import elastic, pressure_load
from smooth_contacts import graded, ordered
from test_mortar_hertz import scene
from unlike_meshes import KINDS, QUADRATIC, named_sides, rectangle

LINEAR = {"condensed": "condensed", "Direct()": sc.linalg.Direct(), "AMG()": sc.linalg.AMG()}


@dataclass(frozen=True)
class Setting:
    """What a user may choose.

    Attributes
    ----------
    kind : {"P1", "Q1", "P2", "Q2"}
    points : float
        Elements per half width of contact, or per side of Raous' block; quadratic elements have
        twice the size, so that `points` counts nodes for all of them.
    method, loop, sliding : as in `Contact` and `ContactSolver`
    linear : {"condensed", "Direct()", "AMG()"}
    G : float, optional
        Tangential stiffness of sticking points over E; by default that of the loop.
    increments : int
        Load steps: of the push, of the load, or of the way of the die.
    secondary : {"die", "block"}
        Which side of the sliding history carries the contact points.
    options : Options
    """

    kind: str = "Q1"
    points: float = 16.5
    method: str = "mortar"
    loop: str = "newton"
    linear: str = "condensed"
    G: float | None = None
    increments: int = 1
    sliding: str = "small"
    secondary: str = "die"
    options: sc.Options = field(default_factory=sc.Options)

    @property
    def solver(self) -> dict[str, Any]:
        """The arguments of `ContactSolver`."""
        return {"loop": self.loop, "linear": LINEAR[self.linear], "options": self.options}

    @property
    def elements(self) -> float:
        """Elements on the length that `points` refers to."""
        return self.points / 2 if self.kind in QUADRATIC else self.points

    def coulomb(self, mu: float, E: float) -> sc.Coulomb:
        """The friction law, with the tangential stiffness."""
        return sc.Coulomb(mu, stiffness=None if self.G is None else self.G * E)


@dataclass(frozen=True)
class Answer:
    """What a script ends with: its results, and how to find their error (which is not timed)."""

    results: list[sc.answers.ContactResult]
    error: Callable[[], float]

    def forces(self) -> np.ndarray:
        """Nodal forces of the last state over the largest, to compare answers on equal meshes."""
        force = np.asarray(self.results[-1].forces)
        return force / np.abs(force).max()


# -- Hertz, Cattaneo and Mindlin ----------------------------------------------------------------

RATIO = 4 / 3  # element size of the lower block over that of the upper one
PUSH, SHARE = 0.5, 0.6  # coefficient of friction; tangential load over its limit


def _blocks(setting: Setting, law: sc.conditions.FrictionLaw | None) -> tuple[Any, float, Any]:
    return scene(
        setting.elements,
        law,
        ratio=RATIO,
        method=setting.method,
        kind=setting.kind,
        sliding=setting.sliding,
        settings=setting.solver,
    )


def hertz(setting: Setting) -> Answer:
    """Two blocks pressed together by a given load; error of the nodal pressure in L2."""
    blocks, P, exact = _blocks(setting, None)
    result, _ = blocks.press(P, 1.0)
    result.u  # noqa: B018 (the displacements belong to the answer)

    def error() -> float:
        x, area, p, _ = ordered(result)
        true = exact.pressure(x)
        return float(np.sqrt(area @ (p - true) ** 2 / (area @ true**2)))

    return Answer([result], error)


def mindlin(setting: Setting) -> Answer:
    """Then pushed to 0.6 of the friction limit; error of the nodal friction in L2."""
    blocks, P, exact = _blocks(setting, setting.coulomb(PUSH, 1.0))
    normal, depth = blocks.press(P, 1.0)
    Q = SHARE * PUSH * P
    shares = np.linspace(0, 1, setting.increments + 1)[1:]
    base = blocks.lowered(depth)
    steps = [{"x": base, "f": blocks.push(s * Q)} for s in shares]
    results = list(blocks.solver.history(steps, start=normal))
    results[-1].u  # noqa: B018

    def error() -> float:
        x, area, _, q = ordered(results[-1])
        true = np.sign(q.sum()) * cattaneo_mindlin(exact, PUSH, Q).traction(x)
        return float(np.sqrt(area @ (q - true) ** 2 / (area @ true**2)))

    return Answer(results, error)


# -- Raous --------------------------------------------------------------------------------------


def raous(setting: Setting) -> Answer:
    """Raous' block; error of the slip of its points A to E, root of the mean square."""
    line = np.linspace(0, RAOUS.side, round(setting.elements) + 1)
    basis = rectangle(setting.kind, line, line)
    f = pressure_load(basis, "right", RAOUS.lateral_pressure)
    f = f + pressure_load(basis, "top", RAOUS.top_pressure)
    D = basis.get_dofs("left").all("u^1")
    body = sc.Body(basis, elastic(RAOUS.E, RAOUS.nu), f, D=D, name="block")
    plane = sc.RigidPlane((0, 0), (0, 1), name="plane")
    contact = sc.Contact(
        body.surface("bottom"),
        plane,
        friction=setting.coulomb(RAOUS.mu, RAOUS.E),
        method=setting.method,
        sliding=setting.sliding,
    )
    solver = sc.ContactSolver(body, contact, **setting.solver)
    results = list(solver.history(np.linspace(0, 1, setting.increments + 1)[1:]))
    u = results[-1].u

    def error() -> float:
        order = np.argsort(results[-1].points[:, 0])
        x = results[-1].points[order, 0]
        slip = np.abs(u[body.surface("bottom").dofs][order, 0])
        at = along(np.array(RAOUS.points), x, slip, 2 if setting.kind in QUADRATIC else 1)
        off = at / np.array(RAOUS.converged) - 1
        return float(np.sqrt(np.mean(off**2)))

    return Answer(results, error)


def along(points: np.ndarray, x: np.ndarray, values: np.ndarray, order: int) -> np.ndarray:
    """Values between the nodes of a line of facets, by their own shape functions."""
    if order == 1:
        return np.interp(points, x, values)
    first = 2 * np.clip((np.searchsorted(x, points) - 1) // 2, 0, len(x) // 2 - 1)
    t = (points - x[first]) / (x[first + 2] - x[first])
    shape = np.array([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    return np.sum(shape * values[first + np.arange(3)[:, None]], axis=0)


# -- a sliding history --------------------------------------------------------------------------

R, H, WIDTH, MU = 100.0, 20.0, 2.0, 0.3  # of the die, the blocks, and their friction
WAY = 2.0  # half widths of contact
BACK = 0.01  # pulled back so far at the end: friction turns round in part of the contact


def half(kind: str, h: float, side: int, fine: float) -> fem.CellBasis:
    """The upper block with its parabola (of second order on quadratic elements), or the lower one."""
    x, y = graded(h, fine, WIDTH * H), graded(h, 0.4, H)
    mesh = fem.MeshQuad.init_tensor(np.concatenate([-x[:0:-1], x]), y if side > 0 else -y[::-1])
    mesh = named_sides(mesh if kind.startswith("Q") else mesh.to_meshtri())
    if side > 0:
        sides = mesh.boundaries
        if kind in QUADRATIC:
            curved = fem.MeshQuad2 if kind.startswith("Q") else fem.MeshTri2
            mesh = curved.from_mesh(mesh)
        p = np.array(mesh.doflocs)
        # beyond twice the half width a tangent and then a plane: nothing touches there
        away = np.minimum(np.abs(p[0]), 3.0)
        profile = np.where(away < 2, away**2 / 2, 2 * away - 2) / R
        p[1] += profile * (1 - p[1] / H)
        mesh = replace(mesh, doflocs=p).with_boundaries(sides)
    order = 4 if kind in QUADRATIC else 2
    return fem.Basis(mesh, fem.ElementVector(KINDS[kind]()), intorder=order)


def sliding(setting: Setting) -> Answer:
    """The die pressed, dragged and pulled back; error of the tractions in three states."""
    h = 1 / setting.elements
    upper, lower = half(setting.kind, h, 1, 1.4), half(setting.kind, RATIO * h, -1, 1.4 + WAY)
    held = upper.get_dofs("top")
    right, down = np.zeros((2, upper.N))
    right[held.all("u^1")], down[held.all("u^2")] = 1.0, -1.0
    die = sc.Body(upper, elastic(1.0, 0.3), D=held, name="die")
    block = sc.Body(lower, elastic(1.0, 0.3), D="bottom", name="block")
    sides = [block.surface("top"), die.surface("bottom")]
    contact = sc.Contact(
        *(sides if setting.secondary == "block" else sides[::-1]),
        friction=setting.coulomb(MU, 1.0),
        method=setting.method,
        sliding=setting.sliding,
    )
    solver = sc.ContactSolver([die, block], contact, **setting.solver)
    depth = np.log(2 * H) / 2 / R  # Johnson's approach of two layers for a half width of one
    way = np.linspace(0, WAY, setting.increments + 1)[1:]
    steps = [depth / 2 * down, depth * down]
    steps += [depth * down + s * right for s in way]
    steps += [depth * down + (WAY - s) * right for s in BACK * np.arange(1, 5) / 4]
    results = list(solver.history({"x": {"die": x}} for x in steps))
    results[-1].u  # noqa: B018

    def error() -> float:
        half_way, end = results[1 + setting.increments // 2], results[1 + setting.increments]
        found = [travelling_error(r, setting.secondary, back=False) for r in (half_way, end)]
        found.append(travelling_error(results[-1], setting.secondary, back=True))
        return float(np.sqrt(np.mean(np.square(found))))

    return Answer(results, error)


def travelling_error(result: sc.answers.ContactResult, secondary: str, *, back: bool) -> float:
    """Error of pressure and friction in L2 against the closed form where the die stands now.

    The normal force is the measured one; so is the tangential one after the way back.
    """
    P = float(result.normal_force.sum())
    added = 2 * block_curvature(P, H, 1.0, 0.3, base="fixed", width=WIDTH)
    exact = hertz_line(P, R, effective_modulus(1.0, 0.3, 1.0, 0.3), added_curvature=added)
    # the tip of the die, on the undeformed secondary surface
    tip = surface_displacement(result, "die", "bottom", 0.0)
    place = tip - surface_displacement(result, "block", "top", tip) if secondary == "block" else 0.0
    x = result.points[:, 0] - place
    # friction along the surface, where the closed form knows no tilt; it drags the block along
    towards = np.sign(result.tangent[:, 0, 0]) * (1.0 if secondary == "block" else -1.0)
    force = towards * result.tangential_force[:, 0]
    p, q = result.pressure, np.divide(force, result.area, out=0 * force, where=result.area > 0)
    true_p, true_q = exact.pressure(x), MU * exact.pressure(x)
    if back:
        Q = float(np.clip(force.sum(), -MU * P, MU * P))
        true_q = cattaneo_mindlin(exact, MU, Q, after=(MU * P,)).traction(x)
    wrong = result.area @ ((p - true_p) ** 2 + (q - true_q) ** 2)
    return float(np.sqrt(wrong / (result.area @ (true_p**2 + true_q**2))))


def surface_displacement(result: sc.answers.ContactResult, name: str, side: str, x: float) -> float:
    """Horizontal displacement of a body's surface at an abscissa."""
    body = next(b for b in result.system.bodies if b.name == name)
    dofs = body.basis.get_dofs(side).all("u^1")
    order = dofs[np.argsort(body.basis.doflocs[0, dofs])]
    return float(np.interp(x, body.basis.doflocs[0, order], result.displacement(name)[order]))
