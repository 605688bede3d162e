"""Positions of bodies and obstacles in a picture: displacements magnified, what all share taken off.

A point at X with the displacement u is drawn at ``X + c + s (u - c)``: s is the factor and c a
translation that all bodies share. An obstacle that has moved by t is drawn as moved by
``c + s (t - c)``, so points that touch it do so in the picture, but for initial gaps, which are not
magnified.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from skfem_contact.answers.answer import answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.arguments import number
from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.state import OPEN, Motion
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.shapes import RigidCylinder, RigidPlane, RigidSphere
from skfem_contact.output.fields import body_nodes
from skfem_contact.output.tools import Tool, fits, tools
from skfem_contact.records import dataclass

Box = tuple[Array, Array]

# A factor is rounded down to one of these times a power of ten.
ROUND = (1.0, 2.0, 5.0)


@dataclass(frozen=True, eq=False)
class View:
    """A choice of how displacements are shown.

    Attributes
    ----------
    factor : float
    shared : ndarray, shape (d,)
        The translation that is not magnified [length].
    """

    factor: float
    shared: Array

    def place(self, points: Array, displacements: Array) -> Array:
        """Places (p, d) of points in the picture."""
        return points + self.shared + self.factor * (displacements - self.shared)

    def nodes(self, result: ContactResult) -> list[Array]:
        """Places of the nodes of all bodies with a mesh, in the order of `body_nodes`."""
        of = [(body, body_nodes(body)) for body in result.system.solids.values()]
        u = result.displacement
        return [self.place(body.dof_points[own[:, 0]], u(body)[own]) for body, own in of]

    def surface(self, result: ContactResult, surface: ContactSurface) -> Array:
        """Places of the points of a surface."""
        return self.place(surface.points, result.displacement(surface.body)[surface.dofs])

    def box(self, result: ContactResult) -> Box:
        """Corners of the box around all bodies."""
        x = np.concatenate(self.nodes(result))
        return x.min(axis=0), x.max(axis=0)

    def motion(self, motion: Motion) -> Motion:
        """Return the motion of an obstacle in the picture."""
        translation = self.shared + self.factor * (motion.translation - self.shared)
        return Motion(translation, self.factor * motion.angle, motion.centre)

    @property
    def words(self) -> str:
        """For the title."""
        return f"deformation magnified {self.factor:g} times" if self.factor != 1 else "true positions"


#: Everything where it is.
TRUE = View(1.0, np.zeros(1))


def view(result: ContactResult, scale: float | Literal["auto"] = "auto") -> View:
    """The view with a factor, or with one that shows the deformation.

    "auto": a round factor, with displacements up to 6 % of the extent and closed gaps overlapping by
    1 %, and never below one. What moves far is where it is, unless all bodies move so together.
    """
    d = next(iter(result.system.solids.values())).dim
    if not isinstance(scale, str) or scale != "auto":
        factor = number(scale, "scale", "give a factor, or 'auto'")
        if not np.isfinite(factor):
            raise InputError(f"scale is {factor}; give a finite factor, or 'auto'")
        return View(factor, np.zeros(d))
    u = np.concatenate([nodal(body, result) for body in result.system.solids.values()])
    known = tools(result)
    together = 0.5 * (u.max(axis=0) + u.min(axis=0))
    views = [View(_factor(result, u, known, shared), shared) for shared in (np.zeros(d), together)]
    return views[1] if views[1].factor > 4.0 * views[0].factor else views[0]


def nodal(body: Member, result: ContactResult) -> Array:
    """Displacements of a body by node, in any order, shape (nodes, d)."""
    u = result.displacement(body)
    return np.column_stack([u[body.dof_component == k] for k in range(body.dim)])


def _factor(result: ContactResult, u: Array, known: list[Tool], shared: Array) -> float:
    answer = answer_of(result)
    extent = answer.system.extent
    largest = float(np.abs(u - shared).max(initial=0.0))
    largest = max([largest, *(_moved(tool, result, shared) for tool in known)])
    if largest == 0.0:
        return 1.0
    factor = 0.06 * extent / largest  # bodies keep their shapes
    gap = _closed_gap(result)
    if gap > 0.0:
        factor = min(factor, 1.0 + 0.01 * extent / gap)  # further, bodies would be seen in each other
    power = 10.0 ** np.floor(np.log10(factor))
    rounded = power * max(k for k in ROUND if k * power <= factor * (1 + COMPUTED))
    return max(1.0, float(rounded))


def gaps_overlap(result: ContactResult, seen: View) -> bool:
    """Return whether closed gaps, which are not magnified, are seen to overlap in the picture."""
    extent = answer_of(result).system.extent
    return abs(seen.factor - 1.0) * _closed_gap(result) > 0.002 * extent  # the width of a line


def _closed_gap(result: ContactResult) -> float:
    """The largest initial gap of the points that are closed now [length]."""
    answer = answer_of(result)
    closed = (answer.state.status != OPEN) & answer.kin.paired
    return float(np.abs(_initial_gaps(result))[closed].max(initial=0.0))


def _initial_gaps(result: ContactResult) -> Array:
    """Gaps (m,) of the undeformed bodies and the obstacles where they were made [length]."""
    answer = answer_of(result)
    gap = np.array(answer.case.gap0)
    for contact, motion, part in zip(answer.contacts, answer.case.motion, answer.slices(), strict=True):
        shift = motion.shift(contact.secondary.points)  # none of bodies
        gap[part] += np.einsum("md,md->m", answer.kin.normal[part], shift)
    return gap


def _moved(tool: Tool, result: ContactResult, shared: Array) -> float:
    """Return how far an obstacle has moved from where the bodies are, as far as its shape shows it."""
    shape = tool.obstacle
    if isinstance(shape, RigidCylinder | RigidSphere):
        return float(np.abs(tool.motion.shift(shape.centre[None])[0] - shared).max())
    points = np.concatenate([result.contacts[i].secondary.points for i in tool.contacts])
    moved = tool.motion.shift(points) - shared
    if isinstance(shape, RigidPlane):
        moved = moved @ shape.normal
    return float(np.abs(moved).max(initial=0.0))


def placed_tools(result: ContactResult, view: View, box: Box) -> list[tuple[Array, Index]]:
    """Points and lines or triangles of all obstacles in a picture of what is in a box."""
    found = []
    for tool in tools(result):
        motion = view.motion(tool.motion) if view.factor != 1 else tool.motion
        points, cells = tool.at(motion).outline(*box)
        found.append((points + motion.shift(points), cells))
    return found


def with_tools(result: ContactResult, view: View, box: Box) -> Box:
    """A box around bodies that has the places next to them on obstacles, and small ones as a whole."""
    low, high = box
    size = float(np.max(high - low))
    for values in result:
        if not values.contact.rigid:
            continue
        # the obstacle is behind the point by the gap, initial gaps are not magnified
        near = np.isfinite(values.gap)
        if near.any():
            i = int(np.argmin(np.where(near, values.gap, np.inf)))
            place = view.surface(result, values.contact.secondary)[i]
            foot = place - values.gap[i] * values.normal[i]
            low, high = np.minimum(low, foot), np.maximum(high, foot)
    drawn = placed_tools(result, view, (low, high))
    for tool, (points, _) in zip(tools(result), drawn, strict=True):
        if fits(tool.obstacle, 1.5 * size):
            low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    return low, high
