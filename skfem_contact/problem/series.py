r"""The contact problem with a spring in series with every point, which forces are taken from.

Gaps and slips z of the points are seen through springs with the stiffness C, which have no strain at
forces ``p_0 = (lambda, -tau)``,

    seen = z + C^-1 (p - p_0).

Where ``p = p_0`` comes out they are as good as not there: it is the answer of the problem itself. On
displacements this is an augmented Lagrangian.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bmat, csr_matrix, diags, hstack, identity, vstack

from skfem_contact.linalg.backend import Stacked
from skfem_contact.linalg.dense_factors import lu, symmetrise
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.response import Conditions, Load, Resistance, Response
from skfem_contact.problem.sparse import SparseSpace
from skfem_contact.problem.springs import on_rows

Array = NDArray[np.float64]


class PointsInSeries:
    """On gaps and slips, ``S z = h + p``, where ``S = (W + E)^-1`` has springs E already, or none.

    With those of the stiffness C in their place, ``D = C^-1 - E``,

        (1 + S D)^-1 S seen = (1 + S D)^-1 (h - S C^-1 p_0) + p.

    Parameters
    ----------
    space : PointSpace
    C : Resistance
        Stiffness of the springs of each point.
    own : ndarray, shape (m,), optional
        Compliance E of the springs that are in S.
    """

    springs = None  # that are to lose their strain

    def __init__(self, space: PointSpace, C: Resistance, own: Array | None = None) -> None:
        self._space = space
        shape = space.tangential_rows.shape
        soft = 1.0 / C.normal, np.broadcast_to(1.0 / C.tangential[:, None], shape)
        self._give = self._on_rows(*soft)
        replaced = np.zeros(len(space.S))
        if own is not None:
            replaced = self._on_rows(own, np.broadcast_to(own[:, None], shape))
        self._factor = lu(np.eye(len(space.S)) + space.S * (self._give - replaced))
        S = self._factor.solve(space.S)
        symmetrise(S)
        self.points = PointSpace(S, space.normal_rows, space.tangential_rows)

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        p = self._on_rows(normal_force, -tangential_force)
        return replace(load, force=self._factor.solve(load.force) - self.points.S @ (self._give * p))

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps and slips as they are seen, and forces, under these conditions."""
        return self.points.solve(conditions, load)

    def _on_rows(self, normal: Array, tangential: Array) -> Array:
        space = self._space
        return on_rows((normal, tangential), space.normal_rows, space.tangential_rows, len(space.S))


class DisplacementsInSeries:
    """On displacements u and gaps and slips w that are seen:

        [K + B'C B,  -B'C] [u]   [f + B'p_0]   [0]
        [  -C B,       C ] [w] = [   -p_0  ] + [p].

    Parameters
    ----------
    space : SparseSpace
    C : Resistance
        Stiffness of the springs of each point.
    """

    points = None
    springs = None

    def __init__(self, space: SparseSpace, C: Resistance) -> None:
        kin, n = space.kin, space.K.shape[0]
        slips = bool(space.frictional.any())
        self._B = B = csr_matrix(vstack([kin.B_n, kin.B_t]) if slips else kin.B_n)
        stiff = np.concatenate([C.normal, np.repeat(C.tangential, kin.tangents)])[: B.shape[0]]
        pull = diags(stiff) @ B
        if isinstance(space.K, Stacked):
            springs = bmat([[B.T @ pull, -pull.T], [-pull, diags(stiff)]], format="csr")
            K = space.K.bordered(B) + springs
        else:
            K = bmat([[space.K + B.T @ pull, -pull.T], [-pull, diags(stiff)]], format="csr")
        q, m = B.shape[0], kin.m
        own = csr_matrix(hstack([csr_matrix((q, n)), identity(q)]))
        t_rows = own[m:] if slips else csr_matrix((m * kin.tangents, n + q))
        places = None
        if space.points is not None:
            where = np.concatenate([kin.points, np.repeat(kin.points, kin.tangents, axis=0)])
            places = np.concatenate([space.points, where[:q]])
        modes = None if space.modes is None else np.concatenate([space.modes, B @ space.modes])
        self._extra = np.zeros(q)
        self.space = replace(
            space,
            K=K,
            kin=replace(kin, B_n=csr_matrix(own[:m]), tangential=lambda: csr_matrix(t_rows)),
            prefer=np.concatenate([np.zeros(n, dtype=bool), np.ones(q, dtype=bool)]),
            points=places,
            modes=modes,
            _key=b"",
            _factor=None,
        )

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        p = np.concatenate([normal_force, -tangential_force.ravel()])[: self._B.shape[0]]
        force = np.concatenate([load.force + self._B.T @ p, -p])
        return replace(load, force=force, prescribed=np.concatenate([load.prescribed, self._extra]))

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps and slips as they are seen, and forces, under these conditions."""
        return self.space.solve(conditions, load)
