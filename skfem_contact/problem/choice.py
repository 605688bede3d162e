"""How the bodies enter the contact problem: as chosen, or by the memory that each way takes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.bodies.remote import check_whole
from skfem_contact.bodies.system import System
from skfem_contact.errors import InputError
from skfem_contact.linalg.direct import Direct, as_linear_solver
from skfem_contact.linalg.multifrontal.fronts import FactorSize
from skfem_contact.linalg.resources import Limits, factor_bound, written_bytes
from skfem_contact.problem.condensed import dense_bytes
from skfem_contact.problem.substructure import Substructure, wanted_of

Index = NDArray[np.intp]


def checked_linear(linear: Any) -> Any:
    """The argument `linear` of a solver, refused at once where it is nothing that solves."""
    if isinstance(linear, str) and linear not in ("auto", "condensed", "iterated"):
        raise InputError(
            f"linear = {linear!r} is neither 'auto' nor 'condensed' nor 'iterated'; a backend is "
            "given as an object, Direct(), AMG() or PETSc(), or as a callable solver(A, b)."
        )
    if not isinstance(linear, str):
        as_linear_solver(linear)
    return linear


def check_distributed(linear: Any, stiffness: Sequence[Any]) -> None:
    """Refuse what can not solve with a stiffness that is held elsewhere."""
    if not getattr(linear, "distributed", False):
        given = repr(linear) if isinstance(linear, str) else type(linear).__name__
        check_whole(stiffness, f"linear = {given} needs it whole: give the PETSc() that assembled it")


class Choice:
    """One of the routes, and why it was taken.

    Parameters
    ----------
    linear : "auto", "condensed", "iterated", a backend or a solver callable
        As for `ContactSolver`.
    limits : Limits
        Memory up to which "auto" forms dense matrices, and factorises.
    system : System
    stiffness : sequence of csr_matrix
        Of each body.
    rows : int
        Gaps and slips of the points that have a partner.
    wanted : callable
        Gives the DOFs (stacked) that contact rows may touch; called where something depends on them.
    """

    def __init__(
        self,
        linear: Any,
        limits: Limits,
        system: System,
        stiffness: Sequence[csr_matrix],
        rows: int,
        wanted: Callable[[], Index],
    ) -> None:
        self.linear, self.limits = linear, limits
        self.system, self.stiffness = system, stiffness
        self.rows, self._wanted = rows, wanted

    @property
    def route(self) -> str:
        """How the bodies enter the contact problem.

        "condensed" to their contact DOFs, "iterated" by products with their factors, by "multigrid"
        without factors, or "full", with contact eliminated from all of their DOFs.
        """
        if not self.by_memory:
            if isinstance(self.linear, str):
                return self.linear
            from skfem_contact.linalg.amg import AMG  # few choose it

            return "multigrid" if isinstance(self.linear, AMG) else "full"
        if isinstance(self.linear, str) and self.factor_bytes > self.limits.factors:
            return "multigrid"
        return "condensed" if self.dense_bytes <= self.limits.dense else "iterated"

    @property
    def by_memory(self) -> bool:
        """Whether the route follows from memory: by default, and where a backend condenses bodies."""
        if isinstance(self.linear, str):
            return self.linear == "auto"
        return bool(getattr(self.linear, "condenses", False))

    @property
    def reason(self) -> str:
        """Why this route, in words."""
        if not self.by_memory:
            return "as chosen"
        if self.route == "multigrid":
            most = f"max_factor_bytes allows {written_bytes(self.limits.factors)}"
            return f"because factors would take {written_bytes(self.factor_bytes)}: {most}"
        most = f"max_dense_bytes allows {written_bytes(self.limits.dense)}"
        if self.route == "condensed":
            return most
        return f"because dense matrices would take {written_bytes(self.dense_bytes)}: {most}"

    @cached_property
    def said(self) -> str:
        """What a report says of the route: nothing of the usual one."""
        words = {
            "iterated": "forces by GMRES through the factors of the bodies",
            "multigrid": "displacements and forces by GMRES with multigrid",
        }
        return f"{words[self.route]}, {self.reason}" if self.route in words else ""

    @cached_property
    def factor_bytes(self) -> float:
        """Memory that the factorisation of all bodies takes at most, or would [bytes].

        A bound where this is far from the limit, as it costs nothing; else what it will be.
        """
        bodies = self.system.bodies
        bound = sum(factor_bound(body.n - len(body.D), body.dim) for body in bodies)
        if bound <= self.limits.factors:
            return bound
        sizes = self._sizes(Substructure).values()
        waiting = max((size.peak - size.memory for size in sizes), default=0)
        return float(sum(size.memory for size in sizes) + waiting)

    @cached_property
    def dense_bytes(self) -> int:
        """Memory that the dense matrices of the contact problem take at most, or would [bytes]."""
        enters = np.zeros(self.system.n, dtype=bool)
        enters[self._wanted()] = True
        enters[self.system.D] = False
        kept = np.diff(np.searchsorted(np.flatnonzero(enters), self.system.offsets))
        copies = getattr(self.linear, "complements", 0)
        return dense_bytes(kept.tolist(), self.rows) + copies * int(8 * np.sum(kept**2))

    @property
    def backend(self) -> Any:
        """What factorises the bodies, or solves where nothing is factorised beforehand."""
        if isinstance(self.linear, str):
            if self.route != "multigrid":
                return Direct()
            from skfem_contact.linalg.amg import AMG

            return AMG()
        return self.linear

    def sizes(self) -> dict[str, FactorSize]:
        """What the factorisation of each body in contact will take, before anything is computed."""
        if self.by_memory and not isinstance(self.linear, str):
            raise InputError(
                f"{self.linear!r} factorises the bodies, and how large that will be it does not say in "
                "advance; linear='auto' does."
            )
        if self.route != "iterated":
            return self._sizes(Substructure)
        from skfem_contact.problem.whole import WholeBody

        return self._sizes(WholeBody)

    def _sizes(self, kind: type[Substructure]) -> dict[str, FactorSize]:
        check_whole(self.stiffness, "a factorisation, and its size, needs all of it")
        out, wanted = {}, self._wanted()
        for i, (name, K) in enumerate(zip(self.system.names, self.stiffness, strict=True)):
            body = self.system.bodies[i]
            mine = wanted_of(body, self.system, wanted)
            if len(mine):
                out[name] = kind(body, K, mine, modes=self.system.modes(i)).factor_size()
        return out
