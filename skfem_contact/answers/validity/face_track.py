r"""How far contact of solids has drifted from where ``sliding="small"`` takes it: `track` for faces.

With the slip vector s of a point, the curvature of the other side as a tensor K (``K t`` is the change
of the normal along t) and the root w of the closed area: normals are off by ``|K s|``, gaps by
``|s.K s| / 2``, and forces act by ``|s| / w`` of the contact beside their place. What is off at
obstacles is in `solids`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.validity.curvature import curvature_tensors
from skfem_contact.answers.validity.ends import Rim
from skfem_contact.answers.validity.track import Track
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.digits import COMPUTED
from skfem_contact.pairing.node import Pairing
from skfem_contact.pairing.vectors import dot

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class FaceTrack(Track):
    """That of a contact of solids; slips are vectors in global axes, in the tangent plane, (m, 3)."""

    def breadth(self, closed: Mask) -> float:
        """Root of the closed area [length]."""
        return float(np.sqrt(np.sum(self.spacing[closed] ** 2)))

    def slip(self, vectors: Array, given: Array) -> Array:
        """Slips (m, 3), less what obstacles give along the tangents, (m, 2)."""
        return np.asarray(vectors - np.einsum("mk,mkd->md", given, self.tangent))

    def tangential(self, vectors: Array) -> Array:
        """The part of vectors (m, 3) in the tangent plane of each point."""
        return np.asarray(vectors - dot(vectors, self.normal)[:, None] * self.normal)

    def spread(self, stretch: Array) -> float:
        """By how much slips differ from point to point [length]."""
        return float(np.linalg.norm(np.ptp(stretch, axis=0)))

    def _spacing(self, pairing: Pairing) -> Array:
        return np.sqrt(np.maximum(pairing.area, 0.0))

    def _look_at_primary(self, primary: ContactSurface, facet: Index) -> None:
        self.bends = curvature_tensors(primary)[facet] * float(self.follows)
        self.turns = bool(self.bends.any())
        self.rim = Rim.of(primary)
        self.room = self.rim.at_least(self.feet)

    def _on_one_surface(self, gap: Array) -> Mask:
        """Where all nodes up to two faces away are on the other side: no curves differ between them.

        Node by node that is all that contact asks. Faces of other kinds between the same nodes seem to
        bend in other ways. Two by two faces say how a surface bends, less do not.
        """
        away = np.abs(gap) > COMPUTED * np.abs(self.points).max()
        if not self.nodal or len(gap) < 9:
            return np.zeros(len(gap), dtype=bool)
        away |= ~self.paired
        for _ in range(2):
            faces = self.secondary.facets
            away[faces[away[faces].any(axis=1)]] = True
        return ~away

    def _along_tangents(self, vectors: Array) -> Array:
        return self.tangential(vectors)

    def _size(self, slip: Array) -> Array:
        return np.asarray(np.linalg.norm(slip, axis=1))

    def _off_by_curvature(self, closed: Mask, slip: Array) -> tuple[float, float]:
        turned = np.einsum("mde,me->md", self.bends, slip)[closed]
        off = np.abs(dot(turned, slip[closed]))
        return float(np.linalg.norm(turned, axis=1).max()), float(np.max(0.5 * off))

    def _past_end(self, closed: Mask, far: Mask, slip: Array, force: Array) -> dict[str, Any]:
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
