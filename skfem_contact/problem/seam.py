r"""The seam between bodies and contact: `ContactProblem`.

Whatever the bodies are and however they are solved, contact knows them by five questions. A load step
is put to a problem (`load`); an iteration asks for gaps, slips and forces under given conditions
(`solve`); at its end the problem says what the displacements follow from (`source`), those of the
surfaces at once (`surface`), those of the bodies by ``model.bodies.recover`` when somebody asks.

Four problems answer them, each exactly:

=================  =====================  ==========================================================
problem            unknowns               in
=================  =====================  ==========================================================
`PointProblem`     gaps and slips         `condensed`: small and dense
`IteratedProblem`  forces on points       `iterated`: the same where there are very many, by products
                                          with the factors of the bodies
`MultigridProblem` displacements, forces  `multigrid`: for bodies too large to be factorised
`FullProblem`      all DOFs               `full`: sparse, with any linear solver
=================  =====================  ==========================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.kinematics import Kinematics, guided_tangents, prescribed_rows
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.response import Conditions, Load, Resistance, Response, Source

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
P = TypeVar("P", bound="Posed")


class LinearProblem(Protocol):
    """What an iteration asks: gaps, slips and forces under conditions that are linear."""

    @property
    def points(self) -> PointSpace | None:
        """The dense problem on gaps and slips, where it is that: pivoting and uniqueness need it."""
        ...

    def solve(self, conditions: Conditions, load: Load) -> Response:
        """Gaps, slips and forces of all points under these conditions.

        Raises
        ------
        SingularMatrix
            If the conditions do not hold the bodies.
        """
        ...

    @property
    def springs(self) -> Array | None:
        """Compliance of the springs through which points are seen, (m,) [length/force]; see `springs`.

        None where rows do not depend on each other, and there are none. They are a device of the
        iteration: it moves their rest forces until none has a strain.
        """
        ...

    def at_forces(self, load: Load, normal_force: Array, tangential_force: Array) -> Load:
        """A load of `ContactProblem.load` with the forces at which the springs have no strain."""
        ...


class ContactProblem(LinearProblem, Protocol):
    """The bodies reduced to the points of one pairing.

    Attributes
    ----------
    kin : Kinematics
        The pairing; its `gap0` are the gaps at the displacements `u`.
    motions : RigidMotions
        Those that supports leave free, seen from these points.
    u : ndarray, shape (n,) or None
        Displacements of the surfaces at which the pairing was made; None for the undeformed bodies.
    idle : list of ContactProblem
        Of those that `anew` has made the ones that no solve has at the moment, see `workspace`.
    steps : WeakKeyDictionary
        What loops know of the points, by whom they are asked; of this problem's memory.
    on_points : ContactProblem or None
        The same on gaps and slips, where somebody has asked for it; of this problem's memory.
    """

    kin: Kinematics
    motions: RigidMotions
    u: Array | None
    idle: list[Any]
    steps: WeakKeyDictionary[Any, Any]
    on_points: ContactProblem | None

    def anew(self) -> ContactProblem:
        """The same problem with a memory of its own: for one solve at a time."""
        ...

    @property
    def able(self) -> Mask:
        """Points whose gap can change: where it is prescribed, D carries the force instead."""
        ...

    @property
    def guided_tangents(self) -> Mask:
        """Tangents along which supports prescribe the slip, (m, d-1): they take any friction there."""
        ...

    @property
    def resistance(self) -> Resistance:
        """What each point resists by itself: how gaps and slips count beside forces."""
        ...

    def in_series(self, C: Resistance) -> LinearProblem:
        """The same problem with springs of the stiffness C in series with its points."""
        ...

    def load(self, case: LoadCase) -> Load:
        """A load case in the unknowns of the problem."""
        ...

    def source(self, load: Load, response: Response) -> Source:
        """What the displacements of the bodies follow from."""
        ...

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """The same for many answers."""
        ...

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) as far as they are known without the interior [length]."""
        ...


class Bodies(Protocol):
    """The bodies without contact: `Condensed` or `FullSystem`."""

    def attach(self, on: PosedOn, prefer: Mask, labels: Sequence[str]) -> ContactProblem:
        """The contact problem on one pairing.

        Parameters
        ----------
        on : PosedOn
        prefer : ndarray of bool, shape (n,)
            DOFs of the secondary surfaces, which are eliminated where there is a choice.
        labels : sequence of str
            Names of the m points.
        """
        ...

    def surface(self, source: Source, case: LoadCase) -> Array:
        """Displacements (n,) as far as they are known without the interior [length]."""
        ...

    def recover(
        self, sources: Source, components: Sequence[Any], cases: Sequence[LoadCase]
    ) -> list[Array]:
        """All displacements, r arrays (n,), from r sources."""
        ...


@dataclass(frozen=True, eq=False)
class PosedOn:
    """What a contact problem is posed on: a pairing, and what belongs to it.

    Attributes
    ----------
    kin, motions, u
        As of `ContactProblem`.
    slipping : ndarray of bool, shape (m,)
        Points with tangential rows.
    """

    kin: Kinematics
    motions: RigidMotions
    u: Array | None
    slipping: Mask


class Posed:
    """What all contact problems have of the pairing that they are posed on."""

    def __init__(self, on: PosedOn) -> None:
        self.kin, self.motions, self.u = on.kin, on.motions, on.u
        self.idle: list[Any] = []
        self.steps: WeakKeyDictionary[Any, Any] = WeakKeyDictionary()
        self.on_points: ContactProblem | None = None

    def anew(self: P) -> P:
        """The same problem with a memory of its own: for one solve at a time."""
        new = copy(self)
        new._begin_anew()
        return new

    def _begin_anew(self) -> None:
        """Forget all that follows from what was solved before."""
        self.steps, self.on_points = WeakKeyDictionary(), None

    def source(self, load: Load, response: Response) -> Source:
        """What the displacements of the bodies follow from."""
        raise NotImplementedError

    def sources(self, found: Sequence[tuple[Load, Response]]) -> list[Source]:
        """Those of many answers."""
        return [self.source(load, response) for load, response in found]

    @cached_property
    def able(self) -> Mask:
        """Points whose gap can change: where it is prescribed, D carries the force instead."""
        return ~prescribed_rows(self.kin.B_n, self.motions.system.D)

    @cached_property
    def guided_tangents(self) -> Mask:
        """Tangents along which supports prescribe the slip, (m, d-1): they take any friction there."""
        return guided_tangents(self.kin, self.motions.system.D)
