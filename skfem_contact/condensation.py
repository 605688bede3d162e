r"""Only what contact needs of linear bodies: static condensation, and the way back.

Two exact reductions, once per stiffness:

1. every body onto its contact DOFs, ``S = K_cc - K_ci K_ii^-1 K_ic``, by one factorisation with the
   contact DOFs ordered last (the trailing block of the factors is S);
2. all contact DOFs onto the gaps and slips ``z = B u`` of the candidate points (a Delassus operator,
   as in Francavilla and Zienkiewicz, 1975). Bodies may float, so both sides are shifted by springs
   ``A`` between the points: with ``W = B (S + B'A B)^-1 B'`` the stiffness against relative
   displacements is ``W^-1 - A``, singular exactly where free motion is.

The interior is recovered, for the steps that somebody asks for, with the same factors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, block_diag, cho_factor, cho_solve
from scipy.sparse import csr_matrix

from skfem_contact.body import Body, System
from skfem_contact.errors import InputError
from skfem_contact.kinematics import Kinematics, compliance_scale, without_columns
from skfem_contact.linear import Dense
from skfem_contact.multifrontal import MultifrontalCholesky
from skfem_contact.spaces import Load, PointSpace, SparseSpace

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class LoadCase:
    """Loads of one step over all bodies and contact points.

    Attributes
    ----------
    f, x : ndarray, shape (n,)
        Load [force] and prescribed displacements [length].
    gap0 : ndarray, shape (m,)
        Initial gap less interference and obstacle motion [length].
    slip0 : ndarray, shape (m, d-1)
        Slip by obstacle motion alone [length].
    """

    f: Array
    x: Array
    gap0: Array
    slip0: Array

    def towards(self, other: LoadCase, share: float) -> LoadCase:
        """The load on the straight way from this one to another."""
        if share == 1.0:
            return other
        gap0 = np.where(np.isinf(other.gap0), np.inf, self.gap0)
        change = np.where(np.isinf(gap0), 0.0, other.gap0 - np.where(np.isinf(gap0), 0.0, gap0))
        return LoadCase(
            self.f + share * (other.f - self.f),
            self.x + share * (other.x - self.x),
            gap0 + share * change,
            self.slip0 + share * (other.slip0 - self.slip0),
        )


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
        Contact DOFs, and a few more where those alone would leave the interior a rigid motion.
    S : ndarray, shape (n_c, n_c)
    """

    def __init__(self, body: Body, K: csr_matrix, wanted: Index) -> None:
        self.body, self.K = body, K
        self.free = np.setdiff1d(np.arange(body.n), body.D)
        self.kept = with_anchors(body, wanted) if len(wanted) else wanted
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
            return self._factor.reduce_load(b)  # type: ignore[no-any-return]
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
        return f[self.free] - self._K_fD @ x[self.body.D]  # type: ignore[no-any-return]


def with_anchors(body: Body, wanted: Index) -> Index:
    """Kept DOFs that stop all rigid motions of the interior: not so with one contact node."""
    R = body.rigid_modes / np.max(np.abs(body.rigid_modes), axis=0)
    kept = np.unique(wanted)
    for _ in range(body.dim):
        values = np.linalg.svd(R[np.union1d(kept, body.D)], compute_uv=False)
        if len(values) >= R.shape[1] and values[-1] > 1e-6 * values[0]:
            break
        points = body.dof_points
        distance = np.min(
            [np.linalg.norm(points - points[i], axis=1) for i in kept[:: max(1, len(kept) // 8)]],
            axis=0,
        )
        distance[body.D] = -1.0
        node = np.all(points == points[np.argmax(distance)], axis=1)
        kept = np.union1d(kept, np.setdiff1d(np.flatnonzero(node), body.D))
    return kept


class Condensed:
    """The contact problem on contact DOFs or points, and the way back to all DOFs."""

    def __init__(
        self,
        system: System,
        stiffness: Sequence[csr_matrix],
        kin: Kinematics,
        active: Mask,
        slipping: Mask,
        prefer: Mask,
        labels: Sequence[str],
        reuse: Sequence[Substructure | None] = (),
    ) -> None:
        self.system = system
        tangential = kin.B_t[np.repeat(active & slipping, kin.tangents)]
        touched = np.union1d(kin.B_n[active].indices, tangential.indices)
        touched = np.setdiff1d(touched, system.D)
        self.parts = []
        for i, body in enumerate(system.bodies):
            span = slice(system.offsets[i], system.offsets[i + 1])
            wanted = touched[(touched >= span.start) & (touched < span.stop)] - span.start
            old = reuse[i] if len(reuse) else None
            keep = old is not None and np.array_equal(old.kept, with_anchors(body, wanted))
            self.parts.append(old if old and keep else Substructure(body, stiffness[i], wanted))
        self.columns = np.concatenate(
            [part.kept + system.offsets[i] for i, part in enumerate(self.parts)]
        )
        self.kin = without_columns(kin, self.columns)
        self.kin_D = without_columns(kin, system.D)
        self.S = block_diag(*(part.S for part in self.parts if len(part.kept)))
        self.space: PointSpace | SparseSpace
        try:
            self.space = self._point_space(active, slipping)
        except LinAlgError:  # rows that depend on each other: a corner, a chain
            self._shifted = None
            self.space = SparseSpace(
                K=csr_matrix(self.S),
                kin=self.kin,
                D=np.zeros(0, dtype=int),
                prefer=prefer[self.columns],
                backend=Dense(),
                labels=labels,
                scale=system.extent,
                frictional=slipping,
            )

    def _point_space(self, active: Mask, slipping: Mask) -> PointSpace:
        kin, t = self.kin, self.kin.tangents
        row_size = np.sqrt(np.asarray(kin.B_n.multiply(kin.B_n).sum(axis=1)).ravel())
        normal = np.flatnonzero(active & (row_size > FIXED))
        size_t = np.sqrt(np.asarray(kin.B_t.multiply(kin.B_t).sum(axis=1)).ravel())
        tangential = np.flatnonzero(np.repeat(active & slipping, t) & (size_t > FIXED))
        B = np.concatenate([kin.B_n[normal].toarray(), kin.B_t[tangential].toarray()])
        shift = compliance_scale(csr_matrix(B), np.diag(self.S))
        shifted = cho_factor(self.S + (B.T * shift) @ B, lower=True, check_finite=False)
        W = B @ cho_solve(shifted, B.T, check_finite=False)
        scale = np.sqrt(np.diag(W))
        lower = np.linalg.cholesky(W / np.outer(scale, scale))
        if np.min(np.diag(lower), initial=1.0) < DEPENDENT:
            raise LinAlgError("dependent contact rows")
        inverse = cho_solve((lower, True), np.eye(len(W))) / np.outer(scale, scale)
        self._B, self._shift, self._shifted, self._inverse = B, shift, shifted, inverse
        S = 0.5 * (inverse + inverse.T)
        S[np.diag_indices(len(S))] -= shift
        normal_rows = np.full(kin.m, -1)
        normal_rows[normal] = np.arange(len(normal))
        tangential_rows = np.full(kin.m * t, -1)
        tangential_rows[tangential] = len(normal) + np.arange(len(tangential))
        return PointSpace(S, normal_rows, tangential_rows.reshape(kin.m, t))

    def load(self, case: LoadCase) -> Load:
        """A load case in the unknowns of the space."""
        pieces = [
            part.load(case.f[span], case.x[span])
            for part, span in zip(self.parts, self._spans(), strict=True)
        ]
        f_c = np.concatenate([p for p, part in zip(pieces, self.parts, strict=True) if len(part.kept)])
        x_D = case.x[self.system.D]
        gap0 = case.gap0 + self.kin_D.B_n @ x_D
        slip0 = case.slip0 + (self.kin_D.B_t @ x_D).reshape(case.slip0.shape)
        if isinstance(self.space, PointSpace):
            free = self._B @ cho_solve(self._shifted, f_c, check_finite=False)
            return Load(self._inverse @ free, gap0, slip0, f_c)
        return Load(f_c, gap0, slip0, np.zeros(len(f_c)))

    def recover(self, loads: Sequence[Load], cases: Sequence[LoadCase], z: Array) -> Array:
        """Displacements of all bodies (n, r) for r solutions of the space (q, r)."""
        u_c = z
        if isinstance(self.space, PointSpace):
            f_c = np.column_stack([load.prescribed for load in loads])
            h = np.column_stack([load.force for load in loads])
            p = self.space.S @ z - h + self._shift[:, None] * z
            u_c = cho_solve(self._shifted, f_c + self._B.T @ p, check_finite=False)
        f = np.column_stack([case.f for case in cases])
        x = np.column_stack([case.x for case in cases])
        u, start = np.empty_like(f), 0
        for part, span in zip(self.parts, self._spans(), strict=True):
            stop = start + len(part.kept)
            u[span] = part.recover(u_c[start:stop], f[span], x[span])
            start = stop
        return u

    def _spans(self) -> list[slice]:
        offsets = self.system.offsets
        return [slice(offsets[i], offsets[i + 1]) for i in range(len(self.parts))]


# Load directions that are remembered; a history of more is condensed step by step.
MOST_DIRECTIONS = 12
# A row whose free coefficients are below this is prescribed: its largest coefficient was one.
FIXED = 1e-12
# Pivot of a contact row (of unit diagonal) below which it depends on the others.
DEPENDENT = 1e-6
