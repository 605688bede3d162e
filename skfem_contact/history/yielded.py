"""`Yielded`: the results of a history so far, in little memory, for the exception of a step that fails.

``[result.force for result in solver.history(steps)]`` keeps no result: when a step fails, what was
found before it must be there all the same. Each is kept as vectors over the contact points and contact
DOFs; displacements, which are recovered again where somebody asks, and loads that are multiples of the
bodies' own are left out.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer, answer_of
from skfem_contact.answers.result import ContactResult
from skfem_contact.carried import copied
from skfem_contact.history.read import StepReader

Array = NDArray[np.float64]
NONE = np.zeros(0)


@dataclass(eq=False)
class Yielded:
    """Results of one history, in their order."""

    _light: list[tuple[Answer, StepReader]] = field(default_factory=list)
    _alive: list[weakref.ref[ContactResult]] = field(default_factory=list)

    def add(self, result: ContactResult, reader: StepReader) -> None:
        """Keep a result; `reader` knows the loads that a number stands for."""
        answer = answer_of(result)
        light = copied(answer) if answer.factor is None else _with_loads(answer, NONE, NONE)
        self._light.append((light, reader))
        self._alive.append(weakref.ref(result))

    def all(self) -> tuple[ContactResult, ...]:
        """The results themselves where they are still held by somebody, and equal ones elsewhere."""
        found = []
        for (light, reader), alive in zip(self._light, self._alive, strict=True):
            result = alive()
            if result is None:
                if light.factor is not None:
                    loads = reader.read(light.factor, light.case)
                    light = _with_loads(light, loads.f, loads.x)
                result = ContactResult(light)
            found.append(result)
        return tuple(found)


def _with_loads(answer: Answer, f: Array, x: Array) -> Answer:
    """The same answer with other vectors of loads, and without what it remembers."""
    case = copied(answer.case, f=f, x=x)
    seen = case if answer.seen is answer.case else copied(answer.seen, f=f, x=x)
    return copied(answer, case=case, seen=seen, recover=copied(answer.recover, case=case))
