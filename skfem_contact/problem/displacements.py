"""What contact problems on displacements share."""

from __future__ import annotations

from skfem_contact.problem.response import Conditions, Load, Resistance, Response, Source
from skfem_contact.problem.series import DisplacementsInSeries
from skfem_contact.problem.sparse import SparseSpace


class OnDisplacements:
    """What contact problems on displacements share: a `space`, whose solutions these are."""

    space: SparseSpace
    points = None

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces under these conditions."""
        return self.space.solve(conditions, load)

    def source(self, load: Load, response: Response) -> Source:
        """What the displacements follow from: those of the problem's own DOFs."""
        return Source(response.solution, forces=False)

    def in_series(self, C: Resistance) -> DisplacementsInSeries:
        """The same problem with springs of the stiffness C in series with its points."""
        return DisplacementsInSeries(self.space, C)
