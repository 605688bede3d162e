"""Each body of a system reduced on its own, to the DOFs that contact rows may touch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.body import Body
from skfem_contact.bodies.member import Member
from skfem_contact.bodies.system import System
from skfem_contact.linalg.backend import Backend
from skfem_contact.problem.substructure import Substructure

Index = NDArray[np.intp]
S = TypeVar("S", bound=Substructure)


def reduced(
    kind: type[S],
    system: System,
    stiffness: Sequence[csr_matrix],
    wanted: Index,
    reuse: Sequence[Substructure | None],
    backend: Backend | None,
) -> list[S]:
    """The parts of all bodies.

    Parameters
    ----------
    kind : type of Substructure
    system : System
    stiffness : sequence of csr_matrix
        Of each body.
    wanted : ndarray of int
        DOFs (stacked) that contact rows may touch.
    reuse : sequence of Substructure or None
        Parts that are still good, if they are of this kind.
    backend : Backend, optional
        What factorises the bodies, see `Substructure`.
    """
    found = []
    for i, body in enumerate(system.bodies):
        old = reuse[i] if len(reuse) else None
        if not isinstance(old, kind):
            firm = firmness(system, stiffness, wanted) if len(body.rotations) else 0.0
            old = kind(body, stiffness[i], wanted_of(body, system, wanted), firm, backend)
        found.append(old)
    return found


def wanted_of(body: Member, system: System, wanted: Index) -> Index:
    """Of stacked DOFs those of one body that are not prescribed, in its own numbering."""
    span = system.slice(body)
    chosen = np.zeros(body.n, dtype=bool)
    chosen[wanted[(wanted >= span.start) & (wanted < span.stop)] - span.start] = True
    chosen[body.D] = False
    return np.flatnonzero(chosen)


def firmness(system: System, stiffness: Sequence[csr_matrix], wanted: Index) -> float:
    """Stiffness that rigid bodies meet: the median over contact DOFs of the other bodies."""
    solid = np.concatenate([np.full(body.n, isinstance(body, Body)) for body in system.bodies])
    diagonal = np.concatenate([K.diagonal() for K in stiffness])
    return float(np.median(diagonal[wanted[solid[wanted]]]))
