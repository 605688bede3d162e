"""Displacements of all bodies, recovered from the contact DOFs when somebody asks for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skfem_contact.loads import LoadCase
from skfem_contact.result import ContactResult
from skfem_contact.threads import single_threaded

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Recovery:
    """What it takes to recover the displacements of all bodies for one result, when asked for."""

    rows: Any
    load: Any
    case: LoadCase
    solution: Array
    shift: Array | None = None  # along motions that nothing resists, see `indifference`

    def __call__(self) -> Array:
        with single_threaded():
            u: Array = self.rows.recover([self.load], [self.case], self.solution[:, None])[0]
        return u if self.shift is None else u + self.shift


def recover_all(results: Sequence[ContactResult]) -> None:
    """Recover the displacements of many results, with one solve per pairing for all of them."""
    waiting = [r for r in results if "u" not in r.__dict__]
    for rows in {id(r.recover.rows): r.recover.rows for r in waiting}.values():
        group = [r for r in waiting if r.recover.rows is rows]
        with single_threaded():
            u = rows.recover(
                [r.recover.load for r in group],
                [r.case for r in group],
                np.column_stack([r.recover.solution for r in group]),
            )
        for result, displacement in zip(group, u, strict=True):
            shift = result.recover.shift
            result.__dict__["u"] = displacement if shift is None else displacement + shift
