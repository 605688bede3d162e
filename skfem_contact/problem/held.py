r"""The rows on which contact acts under some conditions, and their equations.

Of the gaps and slips z a closed point knows its gap, a sticking one its slip, and of a slipping one it
is known that ``-p_t = offset + K (slip0 + z_t) + coupling p_n``. That times ``(K + r)^-1``, r being the
point's own stiffness, is

    ``P z_t + (1 - P) (p_t + coupling p_n) / r = known``     with     ``P = K (K + r)^-1``:

all between free slip, ``P = 0``, and sticking, ``P = 1``, in one scale.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.problem.response import Conditions, Load

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Held:
    """The rows on which contact acts under some conditions; s points of them have slips.

    Attributes
    ----------
    rows : ndarray of int, shape (h,)
        Normal rows of closed points, then tangential ones.
    known : ndarray, shape (h,)
        What the equations are to give [length].
    sticks : ndarray, shape (s, t, t)
        P of each point.
    stiffness : ndarray, shape (s, 1)
        Its own stiffness r [force/length].
    coupling : ndarray, shape (s, t)
    place : ndarray of int, shape (s, t)
        Its tangential rows among the h, or h where a row does not exist.
    normal : ndarray of int, shape (s,)
        Its normal row among the h, or h.
    """

    rows: Index
    known: Array
    sticks: Array
    stiffness: Array
    coupling: Array
    place: Index
    normal: Index

    @classmethod
    def under(
        cls, conditions: Conditions, load: Load, normal_rows: Index, tangential_rows: Index, own: Array
    ) -> Held:
        """The rows held by some conditions.

        Parameters
        ----------
        conditions : Conditions
        load : Load
        normal_rows, tangential_rows : ndarray of int, shapes (m,) and (m, t)
            Rows of the points among all q; -1 where there is none.
        own : ndarray, shape (q,)
            Stiffness of each row [force/length].
        """
        closed = np.flatnonzero(conditions.closed)
        touching = closed[normal_rows[closed] >= 0]
        exists = tangential_rows[closed] >= 0
        closed, exists = closed[exists.any(axis=1)], exists[exists.any(axis=1)]
        on, stick = tangential_rows[closed], conditions.stick[closed][:, None]
        rows = np.concatenate([normal_rows[touching], on[exists]])
        where = np.full(len(own) + 1, len(rows))
        where[rows] = np.arange(len(rows))

        slip0, spring = load.slip0[closed], conditions.spring[closed]
        r = np.max(np.append(own, 0.0)[on], axis=1, initial=0.0)[:, None]
        K = np.where(exists[:, :, None] & exists[:, None, :] & ~stick[:, None], spring, 0.0)
        soft = np.linalg.inv(K + r[:, None] * np.eye(on.shape[1]))
        asked = np.where(
            exists, conditions.offset[closed] + np.einsum("ikl,il->ik", spring, slip0), 0.0
        )
        slides = -np.einsum("ikl,il->ik", soft, asked)
        known = np.where(stick, conditions.anchor[closed] - slip0, slides)
        return cls(
            rows=rows,
            known=np.concatenate([-load.gap0[touching], known[exists]]),
            sticks=np.where(stick[:, None], np.eye(on.shape[1]) * exists[:, None], K @ soft),
            stiffness=r,
            coupling=np.where(exists & ~stick, conditions.coupling[closed], 0.0),
            place=np.where(exists, where[on], len(rows)),
            normal=where[normal_rows[closed]],
        )

    def equations(self, z: Array, p: Array) -> Array:
        """The left-hand sides: gaps, and of slips their mixture with forces, (h,) [length]."""
        out, z, p = np.append(z, 0.0), np.append(z, 0.0), np.append(p, 0.0)
        free = (p[self.place] + self.coupling * p[self.normal][:, None]) / self.stiffness
        out[self.place] = _times(self.sticks, z[self.place] - free) + free
        return out[:-1]

    def solved(self, known: Array, stiffness: Callable[[Array], Array]) -> Array:
        """Forces (h,) that about fulfil the equations, from a stiffness of all rows."""
        known = np.append(known, 0.0)
        slips = known[self.place]
        given = known.copy()
        given[self.place] = _times(self.sticks, slips)
        p = np.append(stiffness(given[:-1]), 0.0)
        free = self.stiffness * slips - self.coupling * p[self.normal][:, None]
        p[self.place] = _times(self.sticks, p[self.place] - free) + free
        return p[:-1]


def _times(A: Array, x: Array) -> Array:
    return np.asarray(np.einsum("ikl,il->ik", A, x))
