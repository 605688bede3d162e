"""The answer to a load step, whether or not contact holds all bodies in one place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.conditions.motions import no_equilibrium
from skfem_contact.conditions.statics import drives, escape
from skfem_contact.history.checkpoint import SavedState
from skfem_contact.history.cutting import advance
from skfem_contact.history.grip import Grip
from skfem_contact.history.indifference import Indifference
from skfem_contact.history.load_step import Advance, LoadStep
from skfem_contact.history.nearest import Rest
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.problem.model import EVEN_CLOSED

Array = NDArray[np.float64]
Known = Answer | SavedState | None

CAN_CARRY = "with the forces that contact can carry"


@dataclass(frozen=True, eq=False)
class Found:
    """What a load step has come to.

    Attributes
    ----------
    advance : Advance
    rest : Rest or None
        Where the answer leaves motions free, that of `advance`; or, with a `pull`, what it would take
        to hold a motion that strains alone drive.
    refuted : ndarray, shape (k,), or None
        A motion by which statics alone shows that there is no equilibrium.
    grip : Grip or None
        What holds the bodies of an attempt that was good, where supports do not.
    """

    advance: Advance
    rest: Rest | None = None
    refuted: Array | None = None
    grip: Grip | None = None

    @property
    def settled(self) -> Rest | None:
        """The answer that leaves motions free, where it is one."""
        return None if self.rest is None or self.rest.pull else self.rest


@dataclass(eq=False)
class Finder:
    """Looks for the answer to one load step from a result or a file; none is the start of all."""

    stepper: Stepper
    step: LoadStep
    start: Known
    _rest: Rest | None = None
    _refuted: Array | None = None

    def find(self) -> Found:
        """The answer; where it leaves motions free, at the place that moves least."""
        model, f = self.stepper.model, self.step.target.f
        if model.loose.shape[1] and drives(model.motions, f, model.loose):
            raise no_equilibrium(model.motions, model.loose, EVEN_CLOSED, f, shown=True)
        may_float = bool(model.motions.k)
        try:
            found = advance(self.stepper.held, self.step, self._doubt if may_float else None)
        except SingularMatrix as error:  # round-off decides whether a free motion makes it so
            if not may_float:
                raise
            return self._freed(error)
        grip = Grip.of(model, found.attempt) if found.attempt.good and may_float else None
        if grip is not None and grip.idles:
            other = self._pressed()
            if other is not None:
                trace, (found, grip) = found.trace, other
                found.trace[:0] = trace
        if grip is not None and (model.loose.shape[1] or grip.idles):
            self._rest = self._try_settle()
        if self._rest is not None and not self._rest.pull:
            self._rest.advance.trace[:0] = found.trace
            return Found(self._rest.advance, self._rest)
        return Found(found, self._rest, self._refuted, grip)

    def _doubt(self, last: bool) -> bool:
        """After a failure: is there no equilibrium, or one that leaves a motion free?"""
        model = self.stepper.model
        if not model.geometry.follows:  # other points may meet
            self._refuted = escape(model.motions, model.interface, model.kin.paired, self.step.target.f)
        if self._refuted is not None:
            return True
        self._rest = self._try_settle(last)
        return self._rest is not None and not self._rest.pull

    def _pressed(self) -> tuple[Advance, Grip] | None:
        """An answer that holds all bodies where they were pressed before; None if there is none.

        A block between inclined sides may stand loose as well as squeezed by friction. From squeezed it
        comes to loose by no small step, but iterations may jump there: pivoting has no such jumps.
        """
        by = self.stepper.held
        if "pivoting" not in by.starts() or not np.any(self.step.state.normal_force > 0):
            return None
        once = replace(by, options=replace(by.options, max_cuts=0))
        try:
            found = advance(once, self.step, begin=["pivoting"])
        except SingularMatrix:  # where it leads leaves a motion free as well
            return None
        if not found.attempt.good:
            return None
        grip = Grip.of(self.stepper.model, found.attempt)
        return None if grip.idles else (found, grip)

    def _freed(self, error: SingularMatrix) -> Found:
        """The answer where a set of points left a motion free; no answer is no equilibrium.

        Where DOFs that hold the motion do not help, the matrix is singular of itself: `error`.
        """
        try:
            rest = self._settle(True)
        except SingularMatrix:
            raise error from None
        model = self.stepper.model
        motions, kin = model.motions, model.kin
        if rest is not None and rest.pull:
            raise no_equilibrium(motions, rest.free, CAN_CARRY, pull=rest.pull) from error
        if rest is not None:
            return Found(rest.advance, rest)
        free = motions.free(kin.paired, kin.paired & model.interface.slipping)
        free = free if free.shape[1] else np.eye(motions.k)
        raise no_equilibrium(motions, free, CAN_CARRY, self.step.target.f) from error

    def _settle(self, last: bool) -> Rest | None:
        u_last = np.zeros(self.stepper.model.system.n) if self.start is None else self.start.u
        return Indifference(self.stepper, self.step, u_last).settle(last)

    def _try_settle(self, last: bool = False) -> Rest | None:
        try:
            return self._settle(last)
        except SingularMatrix:  # springs as weak as these do not hold a body everywhere
            return None
