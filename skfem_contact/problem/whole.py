r"""Bodies by their factors alone: what forces on contact DOFs move there, without a dense matrix.

Where a surface has too many points for dense matrices, the contact DOFs are eliminated like all
others. Displacements at the contact under forces there, ``F f``, then cost a substitution through the
fronts above the contact DOFs, somewhat more than half of them in a solid.

What is dense are the springs on the anchors of bodies that their supports do not hold, as in
`condensed`: ``F = R (K + P P')^-1 R'``, R selecting contact DOFs and anchors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csr_matrix

from skfem_contact.bodies.system import System, slices
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.linalg.backend import Backend, Surface
from skfem_contact.linalg.direct import Direct
from skfem_contact.once import once
from skfem_contact.problem.parts import reduced
from skfem_contact.problem.response import Source
from skfem_contact.problem.substructure import Components, Substructure
from skfem_contact.problem.thresholds import RECOVERED_AT_ONCE

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class WholeBody(Substructure):
    """One body with all its factors, of which only the anchors are left.

    Attributes
    ----------
    columns : ndarray of int
        Contact DOFs and anchors, sorted.
    kept : ndarray of int
        The anchors.
    """

    keeps_contact = False

    @once
    def _place(self) -> Index:
        return np.searchsorted(self.free, self.columns)

    @once
    def _response(self) -> Surface:
        return self._factor.response(self._place)

    @once
    def springs(self) -> Array:
        """Springs to the ground on the anchors, ``P`` with stiffness ``P P'``, shape (k, k).

        As stiff as K itself there: what anchors alone feel of a body that floats may be nothing.
        """
        return np.diag(np.sqrt(np.maximum(self.K.diagonal()[self.anchors], self._firm)))

    @property
    def P(self) -> Array:
        """Springs to the ground on the anchors over the contact DOFs, (n_c, k)."""
        P = np.zeros((len(self.columns), len(self.anchors)))
        P[np.searchsorted(self.columns, self.kept)] = self.springs
        return P

    def respond(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        if not len(self.columns):
            return np.zeros(0)
        return self._response(force, self.flexibility)

    def displaced(self, force: Array) -> Array:
        """Displacements of all free DOFs under forces on them, (n_f, r) -> (n_f, r)."""
        x = self._factor.eliminate(force)
        kept = self.flexibility @ x[len(x) - len(self.kept) :]
        u = np.empty_like(x)
        u[self._factor.order] = self._factor.substitute(kept, x)
        return u

    def free_load(self, f: Array, x: Array) -> Array:
        """Load on the free DOFs, that of prescribed displacements included, (n_f,)."""
        return self._free_load(f, x)


class Whole:
    """All bodies by their factors.

    Parameters
    ----------
    system : System
    stiffness : sequence of csr_matrix
        Of each body.
    wanted : ndarray of int
        DOFs (stacked) that contact rows may touch.
    reuse : sequence of Substructure or None
        Parts that are still good.
    backend : Backend, optional
        What factorises the bodies, see `Substructure`.

    Attributes
    ----------
    columns : ndarray of int, shape (n_c,)
        Contact DOFs and anchors.
    P : ndarray, shape (n_c, k)
        Springs on the anchors.
    """

    kind = WholeBody
    substructures: Sequence[WholeBody]

    def __init__(
        self,
        system: System,
        stiffness: Sequence[csr_matrix],
        wanted: Index,
        reuse: Sequence[Substructure | None] = (),
        backend: Backend | None = None,
    ) -> None:
        self.system, self.stiffness = system, stiffness
        self.backend = backend or Direct()
        self.spans = slices(system.offsets)
        self.substructures = parts = reduced(self.kind, system, stiffness, wanted, reuse, self.backend)
        columns = [part.columns + span.start for part, span in zip(parts, self.spans, strict=True)]
        self.columns = np.concatenate(columns)
        self.column_spans = slices(np.cumsum([0, *map(len, columns)]))
        springs = [part.P for part in parts if len(part.columns)]
        self.P = block_diag(*springs) if springs else np.zeros((0, 0))

    def flexibility(self, force: Array) -> Array:
        """``F`` times forces on the contact DOFs, (n_c,) -> (n_c,)."""
        pieces = zip(self.substructures, self.column_spans, strict=True)
        return np.concatenate([part.respond(force[span]) for part, span in pieces])

    def load(self, case: LoadCase) -> Array:
        """Displacements (n_c,) of the contact DOFs where contact carries nothing, on the springs."""
        pieces = []
        for part, span in zip(self.substructures, self.spans, strict=True):
            force = part.free_load(case.f[span], case.x[span])
            some = len(part.columns) and force.any()
            moved = part.displaced(force[:, None])[:, 0] if some else np.zeros(len(part.free))
            pieces.append(moved[np.searchsorted(part.free, part.columns)])
        return np.concatenate(pieces)

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) known without further work: here of all DOFs, which take as much."""
        if not source.forces:
            return source.values
        return self.recover(Source(source.values[:, None], True), (), [case])[0]

    def recover(
        self,
        sources: Source,
        components: Sequence[tuple[Components | None, ...] | None],
        cases: Sequence[LoadCase],
    ) -> list[Array]:
        """All displacements, r arrays (n,), from r sources: forces on the contact DOFs (n_c, r).

        Or from displacements of all DOFs (n, r).
        """
        if not sources.forces:
            return [np.array(u) for u in sources.values.T]
        u = [np.array(case.x) for case in cases]
        for part, span, own in zip(self.substructures, self.spans, self.column_spans, strict=True):
            place = np.searchsorted(part.free, part.columns)
            for first in range(0, len(u), RECOVERED_AT_ONCE):
                some = slice(first, first + RECOVERED_AT_ONCE)
                loads = [part.free_load(case.f[span], case.x[span]) for case in cases[some]]
                force = np.column_stack(loads)
                force[place] += sources.values[own, some]
                for column, out in zip(part.displaced(force).T, u[some], strict=True):
                    out[span.start + part.free] = column
        return u
