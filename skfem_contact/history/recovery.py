"""Displacements of all bodies, recovered from the contact DOFs when somebody asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.history.load_step import Attempt
from skfem_contact.linalg.resources import single_threaded
from skfem_contact.problem.condensed import Condensed
from skfem_contact.problem.model import LinearModel
from skfem_contact.problem.points import PointSpace
from skfem_contact.problem.response import Load, Response, Source
from skfem_contact.sealed import sealed

Array = NDArray[np.float64]


@dataclass(eq=False)
class Recovery:
    """What it takes to recover the displacements of all bodies for one result, when asked for.

    Vectors over the contact DOFs, and the bodies that all results of a solver share. The dense
    contact problem on the pairing of the result is none of it: where contact slides far, every result
    would keep one of its own.

    Attributes
    ----------
    model : LinearModel
    found : Source, or pair of Load and Response
        What all displacements follow from; on the pairing of the undeformed bodies, which the model
        keeps, the answer that `source` makes it from when somebody asks.
    components : tuple or None
        What the bodies remember of the load; None where they remember nothing.
    case : LoadCase
    moved : bool
        Whether the pairing is another than that of the undeformed bodies.
    unknowns : int
        Gaps and slips of the contact problem; zero where it is not on these.
    shift : ndarray, shape (n,), optional
        Along motions that nothing resists, see `indifference` [length].
    """

    model: LinearModel
    found: Source | tuple[Load, Response]
    components: tuple[Any, ...] | None
    case: LoadCase
    moved: bool
    unknowns: int
    shift: Array | None = None

    @classmethod
    def of(cls, attempt: Attempt, shift: Array | None = None) -> Recovery:
        """That of the last iterate of an attempt."""
        problem, load, response = attempt.problem, attempt.load, attempt.outcome.iterate.response
        moved = problem.u is not None
        return cls(
            model=attempt.model,
            found=problem.source(load, response) if moved else (load, response),
            components=load.components,
            case=attempt.case,
            moved=moved,
            unknowns=0 if problem.points is None else len(problem.points.S),
            shift=shift,
        )

    @cached_property
    def source(self) -> Source:
        """What all displacements follow from."""
        if isinstance(self.found, Source):
            return self.found
        source: Source = self.model.problem_on(None, None).source(*self.found)
        return source

    def __call__(self) -> Array:
        return _recovered([self])[0]

    def at_contact(self) -> Array:
        """Displacements (n,) known without the interior: contact DOFs and prescribed ones."""
        u = self.model.bodies.surface(self.source, self.case)
        return u if self.shift is None else u + self.shift

    def space(self, kin: Any) -> tuple[PointSpace, bool] | None:
        """The contact problem on gaps and slips, and whether supports hold all bodies.

        None where it is not on these. Where contact slides far it is computed anew.
        """
        if not self.unknowns:
            return None
        bodies = self.model.bodies
        points = self.model.problem_on(kin if self.moved else None, None).points
        held = isinstance(bodies, Condensed) and bodies.P.shape[1] == 0
        return None if points is None else (points, held)

    def __getstate__(self) -> dict[str, Any]:
        # elsewhere the bodies are condensed anew, and remember no loads
        return {**vars(self), "found": self.source, "components": None}


def recover_all(answers: Sequence[Answer]) -> None:
    """Recover the displacements of many answers, with one solve per model for all of them."""
    waiting = [r for r in answers if "u" not in r.__dict__]
    _find_sources([answer.recover for answer in waiting])
    groups: dict[tuple[int, bool], list[Answer]] = {}
    for answer in waiting:
        key = id(answer.recover.model), answer.recover.source.forces
        groups.setdefault(key, []).append(answer)
    for group in groups.values():
        for answer, u in zip(group, _recovered([r.recover for r in group]), strict=True):
            vars(answer).setdefault("u", sealed(u))  # another thread may have come first


def _find_sources(some: Sequence[Recovery]) -> None:
    """What the displacements follow from, for all that are on the pairing of the undeformed bodies."""
    groups: dict[int, list[Recovery]] = {}
    for recovery in some:
        if not isinstance(recovery.found, Source) and "source" not in vars(recovery):
            groups.setdefault(id(recovery.model), []).append(recovery)
    for group in groups.values():
        problem = group[0].model.problem_on(None, None)
        sources = problem.sources([r.found for r in group if not isinstance(r.found, Source)])
        for recovery, source in zip(group, sources, strict=True):
            vars(recovery).setdefault("source", source)


def _recovered(some: Sequence[Recovery]) -> list[Array]:
    """Displacements of all bodies for recoveries of one model and kind."""
    bodies = some[0].model.bodies
    with single_threaded():
        sources = Source(np.column_stack([r.source.values for r in some]), some[0].source.forces)
        components = [r.components for r in some]
        u: list[Array] = bodies.recover(sources, components, [r.case for r in some])
    return [v if r.shift is None else v + r.shift for v, r in zip(u, some, strict=True)]
