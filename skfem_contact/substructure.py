"""Static condensation of one linear body onto the DOFs that contact needs, and the way back.

``S = K_cc - K_ci K_ii^-1 K_ic`` comes from one factorisation with the contact DOFs ordered last: the
trailing block of the factors is S, and the same factors recover the interior.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.sparse import csr_matrix

from skfem_contact.body import Body
from skfem_contact.errors import InputError
from skfem_contact.multifrontal import MultifrontalCholesky

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Ratio of singular values of the rigid modes on some DOFs above which these hold the body firmly.
HELD = 1e-2
# Load directions that are remembered; a history of more is condensed step by step.
MOST_DIRECTIONS = 12


class LoadSpan:
    """The few directions that the loads of a history span, and what follows from each of them.

    Load steps are as a rule multiples and sums of few vectors. Each direction is condensed, and its
    interior recovered, once; a load step then costs a few scalar products.
    """

    def __init__(self, n: int, kept: int) -> None:
        self._basis = np.zeros((n, 0))
        self._reduced = np.zeros((kept, 0))
        self._interior = np.zeros((n, 0))

    def coefficients(self, b: Array) -> Array | None:
        """Components of a load along the directions; adds one where they do not span it.

        None where there are too many directions already.
        """
        Q = self._basis
        c = Q.T @ b
        rest = b - Q @ c
        again = Q.T @ rest  # once more: the first pass leaves round-off of |b|
        c, rest = c + again, rest - Q @ again
        size = np.linalg.norm(rest)
        if size <= 1e-15 * np.linalg.norm(b):
            return c
        if Q.shape[1] >= MOST_DIRECTIONS:
            return None
        self._basis = np.column_stack([Q, rest / size])
        return np.append(c, size)

    def combine_reduced(self, c: Array, reduce: Callable[[Array], Array]) -> Array:
        """The condensed load with these components."""
        self._reduced = self._extended(self._reduced, reduce)
        return self._reduced[:, : len(c)] @ c

    def combine_interior(self, c: Array, recover: Callable[[Array], Array]) -> Array:
        """Displacements under this load with the kept DOFs held."""
        self._interior = self._extended(self._interior, recover)
        return self._interior[:, : len(c)] @ c

    def _extended(self, known: Array, apply: Callable[[Array], Array]) -> Array:
        count = known.shape[1]
        if count == self._basis.shape[1]:
            return known
        return np.column_stack([known, apply(self._basis[:, count:])])


class Substructure:
    """One body condensed onto the DOFs that contact needs.

    Parameters
    ----------
    body : Body
    K : csr_matrix, shape (n, n)
        Its stiffness.
    wanted : ndarray of int
        DOFs that occur in contact rows, without prescribed ones.

    Attributes
    ----------
    kept : ndarray of int
        Contact DOFs and anchors, sorted.
    anchors : ndarray of int
        DOFs that stop the rigid motions of a body which its supports do not hold.
    S : ndarray, shape (n_c, n_c)
    """

    def __init__(self, body: Body, K: csr_matrix, wanted: Index) -> None:
        self.body, self.K = body, K
        self.free = np.setdiff1d(np.arange(body.n), body.D)
        self.anchors = anchors(body, wanted) if len(wanted) else wanted
        self.kept = np.union1d(wanted, self.anchors)
        self._K_fD = csr_matrix(K[self.free][:, body.D])
        self._span = LoadSpan(len(self.free), len(self.kept))

    @cached_property
    def _factor(self) -> MultifrontalCholesky:
        K_ff = csr_matrix(self.K[self.free][:, self.free])
        place = np.searchsorted(self.free, self.kept)
        try:
            return MultifrontalCholesky(K_ff, self.body.dof_points[self.free], place)
        except LinAlgError as error:
            raise InputError(
                f"The stiffness of body '{self.body.name or 'unnamed'}' is not positive definite "
                f"({error}). Usually a material parameter is negative or zero, nodes belong to no "
                "element, or K is not that of an elastic body."
            ) from None

    @property
    def S(self) -> Array:
        """The condensed stiffness, in the order of `kept`."""
        return self._factor.S if len(self.kept) else np.zeros((0, 0))

    @cached_property
    def springs(self) -> Array:
        """Springs to the ground on the anchors, ``P`` with stiffness ``P P'``, shape (n_c, k)."""
        P = np.zeros((len(self.kept), len(self.anchors)))
        place = np.searchsorted(self.kept, self.anchors)
        P[place, np.arange(len(place))] = np.sqrt(np.diag(self.S)[place])
        return P

    @cached_property
    def flexibility(self) -> Array:
        """``(S + P P')^-1``, shape (n_c, n_c) [length/force]."""
        if len(self.kept) == 0:
            return np.zeros((0, 0))
        factor = cho_factor(self.S + self.springs @ self.springs.T, lower=True, check_finite=False)
        return np.asarray(cho_solve(factor, np.eye(len(self.S)), check_finite=False))

    @property
    def memory(self) -> int:
        """Bytes of the factors."""
        return int(self._factor.memory)

    def load(self, f: Array, x: Array) -> Array:
        """Load on the kept DOFs, those of the interior and of prescribed DOFs included."""
        if len(self.kept) == 0:  # no part in the contact problem: nothing to factorise yet
            return np.zeros(0)
        b = self._free_load(f, x)
        c = self._span.coefficients(b)
        if c is None:
            return self._factor.reduce_load(b)
        return self._span.combine_reduced(c, self._factor.reduce_load)

    def recover(self, kept: Array, f: Array, x: Array) -> Array:
        """All displacements (n, r) from those of the kept DOFs (n_c, r)."""
        u_free = self._factor.recover(kept)
        for column, b in zip(u_free.T, self._free_load(f, x).T, strict=True):
            c = self._span.coefficients(b)
            if c is None:
                column += self._interior(b[:, None])[:, 0]
            else:
                column += self._span.combine_interior(c, self._interior)
        u = np.array(x, dtype=float)
        u[self.free] = u_free
        return u

    def _interior(self, f: Array) -> Array:
        """Displacements under a load with the kept DOFs held."""
        return self._factor.recover(np.zeros((len(self.kept), f.shape[1])), f)

    def _free_load(self, f: Array, x: Array) -> Array:
        return f[self.free] - self._K_fD @ x[self.body.D]


def anchors(body: Body, wanted: Index) -> Index:
    """Free DOFs of a few nodes away from contact that stop the motions which supports leave free.

    One or two nodes for each part of the mesh that prescribed DOFs do not hold: springs on them make
    the condensed stiffness definite, and as further kept DOFs they do the same for the interior.
    """
    R = body.rigid_modes / np.max(np.abs(body.rigid_modes), axis=0)
    points, chosen = body.dof_points, np.zeros(0, dtype=int)
    touched = np.zeros(body.n, dtype=bool)
    touched[body.D], touched[wanted] = True, True
    for part in np.unique(body.parts[wanted]):
        mine = body.parts == part
        modes = R[:, np.any(R[mine] != 0, axis=0)]
        seeds = points[wanted[body.parts[wanted] == part]][:1]
        for _ in range(body.dim):
            held = np.union1d(body.D[mine[body.D]], chosen[mine[chosen]])
            values = np.linalg.svd(modes[held], compute_uv=False)
            if len(values) == modes.shape[1] and values[-1] > HELD * values[0]:
                break
            distance = np.min(np.linalg.norm(points[:, None] - seeds, axis=2), axis=1)
            distance = distance / distance.max() + (mine & ~touched)
            distance[~mine] = -1.0
            distance[chosen] = -1.0
            place = points[np.argmax(distance)]
            node = mine & np.all(points == place, axis=1)
            node[body.D] = False
            chosen = np.union1d(chosen, np.flatnonzero(node))
            seeds = np.concatenate([seeds, place[None]])
    return chosen
