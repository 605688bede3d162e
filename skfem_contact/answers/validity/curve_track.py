"""Where the points of a plane contact may be led by their slip: `track` for curves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.validity.curvature import curvatures
from skfem_contact.answers.validity.ends import ways_to_ends
from skfem_contact.answers.validity.meeting import distances
from skfem_contact.answers.validity.track import Track, gaps_at_obstacle
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.loads import LoadCase, Motion
from skfem_contact.digits import COMPUTED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.obstacles.shapes import RigidPlane
from skfem_contact.pairing.node import Pairing

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class CurveTrack(Track):
    """That of a contact of a plane body, see `Track`; slips are numbers along the tangents, (m,)."""

    def __init__(
        self, contact: Contact, pairing: Pairing, gap0: Array, own: Array | float = 0.0
    ) -> None:
        super().__init__(contact, pairing, gap0, own)
        # rows of corners are not of the nodes that they stand for
        self.by_node = np.ones(len(self.points), dtype=bool)
        self.by_node[[node for side, node in pairing.corners if side == 0]] = False
        if pairing.vertex is not None:
            self.by_node &= pairing.vertex < 0

    def breadth(self, closed: Mask) -> float:
        """Of the contact [length]."""
        return float(self.spacing.dot(closed))

    def slip(self, vectors: Array, given: Array) -> Array:
        """Displacements along the tangents (m,) from slips (m, 2), less given ones (m, 1)."""
        x, y = vectors.T, self.tangent[:, 0].T
        return np.asarray(x[0] * y[0] + x[1] * y[1] - given[:, 0])

    def tangential(self, vectors: Array) -> Array:
        """What is along the tangents: in the plane rows of motions are already."""
        return vectors

    def spread(self, stretch: Array) -> float:
        """By how much slips differ from point to point [length]."""
        return float(stretch[stretch.argmax()] - stretch[stretch.argmin()])

    def _spacing(self, pairing: Pairing) -> Array:
        return node_lengths(self.secondary)

    def _look_at_primary(self, primary: ContactSurface, facet: Index) -> None:
        self.curvature = np.where(self.follows, curvatures(primary)[facet], 0.0)
        self.turns = bool(self.curvature.any())
        # of a node beyond the end at the start, the facet before it is in contact
        behind, ahead = ways_to_ends(primary, facet, self.points)
        self.behind, self.ahead = np.maximum(behind, 0.0), np.maximum(ahead, 0.0)
        # of an end node the surface has only half of the share
        ends = self.secondary.facets[:, :2][self.secondary.neighbours < 0]
        self.width = self.spacing.copy()
        self.width[ends] *= 2.0
        self.room = np.minimum(self.behind, self.ahead) - 0.5 * self.width

    def _along_tangents(self, vectors: Array) -> Array:
        return np.asarray(np.einsum("md,md->m", self.tangent[:, 0], vectors))

    def _size(self, slip: Array) -> Array:
        return np.abs(slip)

    def _off_by_curvature(self, closed: Mask, slip: Array) -> tuple[float, float]:
        way, curvature = np.abs(slip[closed]), self.curvature[closed]
        return float(np.max(curvature * way)), float(np.max(0.5 * curvature * way**2))

    def _past_end(self, closed: Mask, far: Mask, slip: Array, force: Array) -> dict[str, Any]:
        slip, force = slip[closed], force[closed]
        ahead, behind, share = self.ahead[closed], self.behind[closed], self.width[closed]
        past = np.maximum(slip - ahead, -slip - behind)
        beyond = past >= 0.5 * self.spacing[closed]
        # of the share of a point, as much as was above the surface and is no more
        lost = np.zeros(len(past))
        for way_there, way_on in ((ahead, slip), (behind, -slip)):
            above = np.minimum(0.5 * share + way_there, share)
            now = np.clip(0.5 * share + way_there - way_on, 0.0, above)
            lost = np.maximum(lost, 1 - now / above)
        return {
            "beyond": int(beyond.sum()),
            "overhang": float(np.max(past[beyond], initial=0.0)),
            "beyond_share": float(lost @ force / max(force.sum(), np.finfo(float).tiny)),
        }

    def _at_obstacle(
        self,
        closed: Mask,
        slip: Array,
        gap: Array,
        approach: float,
        case: LoadCase,
        i: int,
        part: slice,
        tool: tuple[Motion, Array] | None,
    ) -> dict[str, Any]:
        assert isinstance(self.primary, Obstacle)
        motion, carried = tool or (case.motion[i], np.zeros((1, 1)))
        obstacle = shape_of(self.primary)
        found: dict[str, Any] = {}
        moved = np.linalg.norm(motion.shift(self.points), axis=1)
        found["motion"] = float(np.max(moved[closed], initial=0.0))
        if not self.follows or (isinstance(obstacle, RigidPlane) and not motion.turns):
            return found
        gap = np.where(self.paired, gap, 0.0)  # without a partner there is none
        lifted = gap - np.where(self.paired, case.gap0[part], 0.0)
        u = self.normal * lifted[:, None] + self.tangent[:, 0] * slip[:, None] + carried
        u[~self.paired] = 0.0
        added = self.added - case.interference[part]
        at = replace(self.secondary, points=self.points + u)
        distance, normal, facing = distances(obstacle.moved(motion.as_argument()), at)
        true = distance + added
        cross = self.normal[:, 0] * normal[:, 1] - self.normal[:, 1] * normal[:, 0]
        angle = np.arctan2(np.abs(cross), np.einsum("md,md->m", self.normal, normal))
        found["tilt"] = float(np.max(angle[closed & self.by_node], initial=0.0))
        sunk, noise = ~closed & facing & self.paired, COMPUTED * float(np.max(np.abs(at.points)))
        return found | gaps_at_obstacle(true, gap, closed & self.by_node, sunk, approach, noise)


def node_lengths(surface: ContactSurface) -> Array:
    """The share of every node in the length of the surface, shape (m,) [length]."""
    share = np.array([0.5, 0.5] if surface.facets.shape[1] == 2 else [0.25, 0.25, 0.5])
    length = (surface.lengths[:, None] * share).ravel()
    return np.asarray(np.bincount(surface.facets.ravel(), length, len(surface.points)), dtype=float)
