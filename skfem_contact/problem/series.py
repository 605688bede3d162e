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

from skfem_contact.linalg.dense_factors import cholesky
from skfem_contact.linalg.stacked import Stacked
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.response import Conditions, Load, Resistance, Response
from skfem_contact.problem.sparse import SparseSpace

Array = NDArray[np.float64]


class PointsInSeries:
    """On gaps and slips: with ``S z = h + p`` and the factors of ``C + S``,

        (C - C (C + S)^-1 C) seen = C (C + S)^-1 (h + p_0) - p_0 + p.

    Parameters
    ----------
    space : PointSpace
    C : Resistance
        Stiffness of the springs of each point.
    """

    def __init__(self, space: PointSpace, C: Resistance) -> None:
        self._space = space
        tangential = np.broadcast_to(C.tangential[:, None], space.tangential_rows.shape)
        self._C = self._on_rows(C.normal, tangential)
        self._factor = cholesky(space.S + np.diag(self._C))
        S = np.diag(self._C) - self._C[:, None] * self._factor.solve(np.diag(self._C))
        self.points = PointSpace(0.5 * (S + S.T), space.normal_rows, space.tangential_rows)

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """The load with the forces at which the springs have no strain."""
        p = self._on_rows(normal_force, -tangential_force)
        return replace(load, force=self._C * self._factor.solve(load.force + p) - p)

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps and slips as they are seen, and forces, under these conditions."""
        return self.points.solve(conditions, load)

    def _on_rows(self, normal: Array, tangential: Array) -> Array:
        """Values of points and their tangents, on the rows that there are."""
        out = np.zeros(len(self._space.S) + 1)  # the last for rows of -1, which there are not
        out[self._space.normal_rows] = normal
        out[self._space.tangential_rows] = tangential
        return out[:-1]


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
