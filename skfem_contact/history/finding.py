"""The answer to a load step, whether or not contact holds all bodies in one place."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.conditions.motions import no_equilibrium
from skfem_contact.conditions.statics import drives, escape
from skfem_contact.history.checkpoint import SavedState
from skfem_contact.history.cutting import advance
from skfem_contact.history.grip import Grip
from skfem_contact.history.indifference import Indifference
from skfem_contact.history.load_step import Advance, Attempt, LoadStep
from skfem_contact.history.nearest import Rest
from skfem_contact.history.stepper import Stepper
from skfem_contact.linalg.singular import SingularMatrix
from skfem_contact.problem.model import EVEN_CLOSED

Array = NDArray[np.float64]
Known = Answer | SavedState | None

CAN_CARRY = "with the forces that contact can carry"


@dataclass(eq=False)
class Finding:
    """Looks for the answer to one load step, and has what it came to.

    Attributes
    ----------
    stepper : Stepper
    step : LoadStep
    start : Answer, SavedState or None
        What the step goes on from; None where nothing was before.
    advance : Advance
    rest : Rest or None
        Where the answer leaves motions free, that of `advance`; or, with a `pull`, what it would take
        to hold a motion that strains alone drive.
    refuted : ndarray, shape (k,), or None
        A motion by which statics alone shows that there is no equilibrium.
    grip : Grip or None
        What holds the bodies of an attempt that was good, where supports do not.
    """

    stepper: Stepper
    step: LoadStep
    start: Known
    advance: Advance = field(init=False)
    rest: Rest | None = None
    refuted: Array | None = None
    grip: Grip | None = None

    @property
    def settled(self) -> Rest | None:
        """The answer that leaves motions free, where it is one."""
        return None if self.rest is None or self.rest.pull else self.rest

    def find(self) -> None:
        """Find the answer; where it leaves motions free, at the place that moves least."""
        model, f = self.stepper.model, self.step.target.f
        if model.loose.shape[1] and drives(model.motions, f, model.loose):
            raise no_equilibrium(model.motions, model.loose, EVEN_CLOSED, f, shown=True)
        may_float = bool(model.motions.k)
        try:
            self.advance = advance(self.stepper.held, self.step, self._doubt if may_float else None)
        except SingularMatrix as error:  # round-off decides whether a free motion makes it so
            if not may_float:
                raise
            self._free(error)
            return
        if may_float and self.advance.attempt.good:
            self.grip = Grip.of(model, self.advance.attempt)
            if self.grip.idles:
                self._press()
            if model.loose.shape[1] or self.grip.idles:
                self.rest = self._try_settle()
        rest = self.settled
        if rest is not None:
            rest.advance.trace[:0] = self.advance.trace
            self.advance = rest.advance

    def _doubt(self, failed: Attempt, last: bool) -> bool:
        """After a failure: is there no equilibrium, or one that leaves a motion free?

        Not where bodies move on under less than the load: it drives what is free.
        """
        model = self.stepper.model
        if not model.geometry.follows:  # other points may meet
            self.refuted = escape(model.motions, model.interface, model.kin.paired, self.step.target.f)
        if self.refuted is not None:
            return True
        if failed.at_limit:
            return False
        self.rest = self._try_settle(last)
        return self.settled is not None

    def _press(self) -> None:
        """Take an answer that holds all bodies where they were pressed before, if there is one.

        A block between inclined sides may stand loose as well as squeezed by friction. From squeezed it
        comes to loose by no small step, but iterations may jump there: pivoting has no such jumps.
        """
        by = self.stepper.held
        if "pivoting" not in by.starts or not np.any(self.step.state.normal_force > 0):
            return
        once = replace(by, options=replace(by.options, max_cuts=0))
        try:
            found = advance(once, self.step, begin=["pivoting"])
        except SingularMatrix:  # where it leads leaves a motion free as well
            return
        if not found.attempt.good:
            return
        grip = Grip.of(self.stepper.model, found.attempt)
        if not grip.idles:
            found.trace[:0] = self.advance.trace
            self.advance, self.grip = found, grip

    def _free(self, error: SingularMatrix) -> None:
        """Take the answer where a set of points left a motion free; none is no equilibrium.

        Where DOFs that hold the motion do not help and contact leaves none free, the matrix is singular
        of itself: `error`.
        """
        model = self.stepper.model
        motions, kin = model.motions, model.kin
        free = motions.free(kin.paired, kin.paired & model.interface.slipping)
        try:
            self.rest = rest = self._settle(True)
        except SingularMatrix:
            if not free.shape[1]:
                raise error from None
            rest = None
        if rest is not None and rest.pull:
            raise no_equilibrium(motions, rest.free, CAN_CARRY, pull=rest.pull) from error
        if rest is not None:
            self.advance = rest.advance
            return
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
