"""`Answer`: what one load step has come to, as certificate, validity and estimates see it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.validity.watched import Watched
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.interface import point_slices
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import State
from skfem_contact.loops.step import Record
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Answer:
    """The numbers of an answer, without what is said of them; `ContactResult` has its attributes."""

    system: System
    contacts: tuple[Contact, ...]
    names: tuple[str, ...]
    kin: Kinematics
    stiffness: tuple[Any, ...]
    case: LoadCase
    seen: LoadCase
    state: State
    gap: Array = field(repr=False)
    plastic_slip: Array = field(repr=False)
    mismatch: float
    converged: bool
    message: str
    iterations: int
    trace: tuple[Record, ...]
    timings: dict[str, float]
    tangential_stiffness: Array = field(repr=False)
    dissipation_by_contact: Array
    dissipation_before: Array
    residual_by_contact: Array
    recover: Any = field(repr=False)
    settings: Any = field(repr=False)
    factor: float | None = None
    indifferent: tuple[str, ...] = ()
    watched: Watched = field(default_factory=Watched, repr=False)

    @cached_property
    def u(self) -> Array:
        """Displacements of all bodies, shape (n,) [length]; recovered when first asked for."""
        return sealed(self.recover())

    def displacement(self, body: Any) -> Array:
        """Displacements of one body, by name or itself, as its basis numbers them, (n_body,)."""
        return self.u[self.system.slice(body)]

    def slices(self) -> list[slice]:
        """The points of each contact in the joint numbering."""
        return list(point_slices(self.contacts))
