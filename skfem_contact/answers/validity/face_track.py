r"""How far contact of solids has drifted from where ``sliding="small"`` takes it: `drift` for faces.

With the slip vector s of a point, the curvature of the other side as a tensor K (``K t`` is the change
of the normal along t) and the root w of the closed area: normals are off by ``|K s|``, gaps by
``|s.K s| / 2``, and forces act by ``|s| / w`` of the contact beside their place. What is off at
obstacles is in `solids`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import EQUALLY_FAR, NEEDLE, NO_LENGTH
from skfem_contact.answers.validity.chords import sagittas
from skfem_contact.answers.validity.drift import Track, slid
from skfem_contact.bodies.surface import ContactSurface, FaceSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.loads import LoadCase, Motion
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.pairing.faces.projection import project
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.vectors import dot
from skfem_contact.trees import kd_tree

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class FaceTrack(Track):
    """Where the points of one contact of solids may be led by their slip; as `Track`.

    Slips are vectors in global axes, in the tangent plane, shape (m, 3).
    """

    def __init__(
        self, contact: Contact, pairing: Pairing, gap0: Array, own: Array | float = 0.0
    ) -> None:
        secondary, primary = contact.secondary, contact.primary
        self.secondary, self.primary = secondary, primary
        self.points, self.paired = secondary.points, pairing.paired
        self.normal, self.tangent = pairing.normal, pairing.tangent
        measured = np.where(pairing.paired, pairing.gap, 0.0)
        self.feet = self.points - measured[:, None] * pairing.normal
        self.spacing = np.sqrt(np.maximum(pairing.area, 0.0))
        self.added = np.where(self.paired, gap0 + own, 0.0) - measured
        self.follows = not contact.tied
        self.chord, self.curved = np.zeros(len(self.points)), False
        if not isinstance(primary, FaceSurface):
            return
        facet = np.where(self.paired, pairing.facet, 0)
        self.facet = primary.lengths[facet]
        self.bends = curvature_tensors(primary)[facet] * float(self.follows)
        self.turns = bool(self.bends.any())
        measures = contact.gap is None and not contact.adjust and not contact.bilateral
        if measures and contact.method == "node" and contact.sliding == "small" and self.turns:
            self.chord = np.where(self.paired, self._chords(primary, facet), 0.0)
        # a gap that is given knows the curves
        self.nodal = contact.method == "node"
        self.sagittas = self.chord
        if measures:
            self.sagittas = sagittas(secondary, primary, facet, self.nodal)
        self.curved = measures and bool(self.sagittas.any())
        self.rim = Rim.of(primary)
        self.room = self.rim.at_least(self.feet)

    def _chords(self, primary: FaceSurface, facet: Index) -> Array:
        """How far linear faces are off the smooth surface through their nodes, at the feet, (m,)."""
        if primary.quadratic:
            return np.zeros(len(facet))
        feet = project(primary, facet, self.feet)
        away = primary.points[primary.facets[facet]] - feet.foot[:, None]
        heights = np.einsum("mkd,mde,mke->mk", away, self.bends, away)
        return np.asarray(0.5 * np.abs(np.sum(feet.shape * heights, axis=1)))

    def breadth(self, closed: Mask) -> float:
        """Root of the closed area [length]."""
        return float(np.sqrt(np.sum(self.spacing[closed] ** 2)))

    def drift(
        self,
        closed: Mask,
        slip: Array,
        gap: Array,
        force: Array,
        approach: float,
        case: LoadCase,
        i: int,
        part: slice,
        tool: tuple[Motion, Array] | None = None,
    ) -> dict[str, Any]:
        """The numbers of `Drift` that are those of small sliding, see `Track.drift`."""
        found: dict[str, Any] = {}
        if isinstance(self.primary, Obstacle) and tool is None:  # else it is part of the slip
            slip = slip - self.tangential(slid(case.motion[i], self.points))
        way = np.linalg.norm(slip, axis=1)
        if closed.any():
            found["slip"] = float(way[closed].max())
            found["widths"] = (
                found["slip"] / self.breadth(closed) if self.breadth(closed) > 0 else np.inf
            )
        if isinstance(self.primary, Obstacle) or not closed.any():
            return found
        found["facets"] = float((way / self.facet)[closed].max())
        if self.turns:
            turned = np.einsum("mde,me->md", self.bends, slip)[closed]
            found["tilt"] = float(np.linalg.norm(turned, axis=1).max())
            error = float(np.max(0.5 * np.abs(dot(turned, slip[closed]))))
            found["gap_error"] = error
            found["gap_share"] = error / approach if approach > 0 else 0.0
        far = closed & (way >= self.room)
        none = {"beyond": 0, "overhang": 0.0, "beyond_share": 0.0}
        return found | (self._past_rim(far, slip, np.abs(force), closed) if far.any() else none)

    def slip(self, vectors: Array, given: Array) -> Array:
        """Slips (m, 3), less what obstacles give along the tangents, (m, 2)."""
        return np.asarray(vectors - np.einsum("mk,mkd->md", given, self.tangent))

    def spread(self, stretch: Array) -> float:
        """By how much slips differ from point to point [length]."""
        return float(np.linalg.norm(np.ptp(stretch, axis=0)))

    def tangential(self, vectors: Array) -> Array:
        """The part of vectors (m, 3) in the tangent plane of each point."""
        return np.asarray(vectors - dot(vectors, self.normal)[:, None] * self.normal)

    def _past_rim(self, far: Mask, slip: Array, force: Array, closed: Mask) -> dict[str, Any]:
        """What has slid past the rim of the primary."""
        share = self.spacing[far]
        before = self.rim.beyond(self.feet[far])
        past = self.rim.beyond(self.feet[far] + slip[far])
        beyond = (past >= 0.5 * share) & (past > before)
        # of the share of a point, as much as was above the surface and is no more
        above = np.clip(0.5 * share - before, 0.0, share)
        now = np.clip(0.5 * share - past, 0.0, above)
        there = above > 0
        lost = np.where(there, 1 - now / np.where(there, above, 1.0), 0.0)
        total = max(float(force[closed].sum()), np.finfo(float).tiny)
        return {
            "beyond": int(beyond.sum()),
            "overhang": float(np.max(past[beyond], initial=0.0)),
            "beyond_share": float(lost @ force[far] / total),
        }


class Rim:
    """The edges where a surface ends.

    Attributes
    ----------
    start, end : ndarray, shape (e, 3)
        Chords of the edges [length].
    outward : ndarray, shape (e, 3)
        Unit vectors out of the surface, in the plane of the face.
    """

    def __init__(self, start: Array, end: Array, normal: Array) -> None:
        self.start, self.end = start, end
        outward = np.cross(end - start, normal)
        self.outward = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        self.tree = kd_tree(0.5 * (start + end)) if len(start) else None
        self.half = 0.5 * float(np.max(np.linalg.norm(end - start, axis=1), initial=0.0))

    @classmethod
    def of(cls, surface: FaceSurface) -> Rim:
        """That of a surface."""
        face, edge = np.nonzero(surface.twins < 0)
        corners = surface.facets[:, : surface.kind.corners]
        after = (edge + 1) % surface.kind.corners
        x = surface.points
        return cls(x[corners[face, edge]], x[corners[face, after]], surface.facet_normals[face])

    def at_least(self, points: Array) -> Array:
        """What points are away from the rim at least, (m,); ``inf`` where there is none [length]."""
        if self.tree is None:
            return np.full(len(points), np.inf)
        return np.maximum(self.tree.query(points)[0] - self.half, 0.0)

    def beyond(self, points: Array) -> Array:
        """How far points lie beyond the rim along the surface, negative above it, (p,) [length]."""
        assert self.tree is not None
        few = min(8, len(self.start))
        near = np.asarray(self.tree.query(points, k=few)[1]).reshape(len(points), few)
        way = self.end[near] - self.start[near]
        away = points[:, None] - self.start[near]
        part = np.clip(np.sum(away * way, axis=2) / np.sum(way**2, axis=2), 0.0, 1.0)
        away = away - part[..., None] * way
        distance = np.linalg.norm(away, axis=2)
        # of two edges that meet at the nearest corner the one that the point is farther out of
        out = np.sum(away * self.outward[near], axis=2)
        nearest = distance <= distance.min(axis=1, keepdims=True) * (1 + EQUALLY_FAR)
        out = np.where(nearest, out, -np.inf).max(axis=1)
        return np.where(out > 0, 1.0, -1.0) * distance.min(axis=1)


def curvature_tensors(surface: ContactSurface) -> Array:
    """How normals change along each face, by the averaged ones at its corners, (nf, 3, 3) [1/length].

    >>> import numpy as np
    >>> import skfem as fem
    >>> from skfem_contact.bodies.body import Body
    >>> mesh = fem.MeshHex.init_tensor(*3 * [np.linspace(0, 1, 4)]).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> cube = Body(basis, np.eye(basis.N)).surface("top")
    >>> bool(curvature_tensors(cube).any())
    False
    """
    c = surface.kind.corners
    x = surface.points[surface.facets[:, :c]]
    n = surface.facet_node_normals[:, :c]
    if np.max(np.abs(n - surface.facet_normals[:, None])) < NO_LENGTH**0.5:
        return np.zeros((len(x), 3, 3))
    x, n = x - x.mean(axis=1, keepdims=True), n - n.mean(axis=1, keepdims=True)
    square = np.einsum("fkd,fke->fde", x, x)
    change = np.einsum("fkd,fke->fde", n, x)
    K = change @ np.linalg.pinv(square, rcond=NEEDLE, hermitian=True)
    across = surface.facet_normals
    plane = np.eye(3) - across[:, :, None] * across[:, None, :]
    K = plane @ K @ plane
    return np.asarray(0.5 * (K + np.swapaxes(K, 1, 2)))
