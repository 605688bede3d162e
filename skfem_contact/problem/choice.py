"""The way of the bodies into the contact problem: as chosen, or by memory and time.

Dense matrices of the contact DOFs take the cube of their number to make, and hardly anything in each
load step. Iterated forces take products with the factors of the bodies in each load step, and nothing
before. Multigrid needs no factors either, which in solids take the cube of what a cut through them
meets; each of its load steps reads K some hundred times. So the number of load steps decides: factors,
and then dense matrices, are made where going without them would take longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from skfem_contact.arrays import Index
from skfem_contact.bodies.member import check_whole
from skfem_contact.bodies.system import System
from skfem_contact.digits import COMPUTED
from skfem_contact.errors import InputError
from skfem_contact.linalg.direct import Direct, as_linear_solver
from skfem_contact.linalg.multifrontal.fronts import FactorSize
from skfem_contact.linalg.resources import Limits, factor_bound, written_bytes
from skfem_contact.problem.condensed import wanted_of
from skfem_contact.problem.substructure import Substructure
from skfem_contact.problem.zone import KEPT_BESIDE

# Matrices of the size of all gaps and slips that are there at once: the stiffness, its factorisation,
# and half of one for the columns of points that slip, or for what is eliminated of open ones.
PER_ROWS = 2.5


# Cubes of contact DOFs per byte of the bound of the factors and load step from which on iterated forces
# take less time. Condensing takes three operations for each, at the peak of a processor; a load step
# some 60 products with the factors, each of which reads all bytes twice, a third of the bound: with
# 2 200 points on solids of 100 000 DOFs the two meet at 2.6 load steps, and by this number at 2.7.
PER_BYTE = 100.0


# Cubes of DOFs between halves of bodies, per entry of K and load step, up to which multigrid takes less
# time than factors. One step on two blocks takes as long by both at 300 (24 500 DOFs), half as long by
# multigrid at 970 (92 600), a quarter at 4 000 (362 600): twice what is even, as elements of second
# order, thin ones and a Poisson's ratio of .49 take twice as many cycles.
CUBES_PER_ENTRY = 600.0


# Cycles of multigrid in one linear problem after which factors are made, where both are at hand. Well
# posed problems take 10 to 60.
CYCLES = 60


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
    steps : float
        Load steps that are known to come, infinite where many may; zero where nothing is known.
    plain : bool
        Whether supports hold the bodies, and a load step has one pairing and one stiffness: what
        multigrid takes is known of these, and is several times as much of others.
    """

    def __init__(
        self,
        linear: Any,
        limits: Limits,
        system: System,
        stiffness: Sequence[csr_matrix],
        rows: int,
        wanted: Callable[[], Index],
        steps: float = 0.0,
        plain: bool = True,
    ) -> None:
        self.linear, self.limits, self.plain = linear, limits, plain
        self.system, self.stiffness = system, stiffness
        self.rows, self._wanted, self.steps = rows, wanted, steps

    @property
    def route(self) -> str:
        """Return how the bodies enter the contact problem.

        "condensed" to their contact DOFs, "iterated" by products with their factors, by "multigrid"
        without factors, or "full", with contact eliminated from all of their DOFs.
        """
        if not self.by_memory:
            if isinstance(self.linear, str):
                return self.linear
            from skfem_contact.linalg.amg import AMG  # few choose it

            return "multigrid" if isinstance(self.linear, AMG) else "full"
        if self.chooses and (self.few_steps or self.factor_bytes > self.limits.factors):
            return "multigrid"
        if self.dense_bytes > self.limits.dense:
            return "iterated"
        return "iterated" if 0 < self.steps < self.pays_from else "condensed"

    @property
    def chooses(self) -> bool:
        """Whether the backend is left to this choice, as by "auto"."""
        return isinstance(self.linear, str) and self.by_memory

    @property
    def few_steps(self) -> bool:
        """Whether multigrid takes less time than factors for the load steps that are known to come."""
        return 0 < self.steps < self.factors_pay_from

    @property
    def condenses(self) -> bool:
        """Whether there is a problem on gaps and slips as well: where memory allows to condense bodies.

        Not in place of an iterative solver, which is chosen where a factorisation is too much.
        """
        if self.route == "full":
            return isinstance(self.backend, Direct)
        fits = self.chooses and self._factor_bound <= self.limits.factors
        return self.route == "condensed" or (fits and self.dense_bytes <= self.limits.dense)

    @property
    def way(self) -> tuple[str, bool]:
        """Return what a model is made for: the route, and whether few steps are to come."""
        return self.route, self.few_steps

    def expecting(self, steps: float) -> Choice:
        """The same with more load steps to come."""
        new = copy(self)
        new.steps += steps
        return new

    @cached_property
    def pays_from(self) -> float:
        """Number of load steps from which on dense matrices take less time than iterated forces.

        Both backends of the bodies are the multifrontal method; of others nothing is known. Small
        matrices are there in half a second, whatever the bodies are.
        """
        if not isinstance(self.linear, str) or self.dense_bytes <= KEPT_BESIDE:
            return 0.0
        return float(np.sum(self._kept.astype(float) ** 3)) / (PER_BYTE * max(self._factor_bound, 1.0))

    @cached_property
    def factors_pay_from(self) -> float:
        """Number of load steps from which on factors take less time than multigrid, zero if always."""
        if not (self.chooses and self.plain):  # nobody asks, and ranks have no matrix to count
            return 0.0
        bodies = zip(self.system.bodies, self.stiffness, strict=True)
        cubes = sum(float(_cut(K, body.dof_points)) ** 3 for body, K in bodies)
        entries = sum(K.nnz for K in self.stiffness)
        # a body without stiffness is refused in words, later
        return cubes / (CUBES_PER_ENTRY * entries) if entries else 0.0

    @property
    def by_memory(self) -> bool:
        """Whether the route follows from memory and time: by default, or by backends that condense."""
        if isinstance(self.linear, str):
            return self.linear == "auto"
        return bool(getattr(self.linear, "condenses", False))

    @property
    def reason(self) -> str:
        """Why this route, in words."""
        if not self.by_memory:
            return "as chosen"
        told = f"{self.steps:.0f} load step{'s' * (self.steps > 1)}"
        pays = "{} pay from {} load steps on".format
        dense = pays("they", math.ceil(self.pays_from))
        if self.route == "multigrid" and self.few_steps:
            factors = pays("they", math.ceil(self.factors_pay_from))
            return f"as factors are not worth their time for {told}: {factors}"
        if self.route == "multigrid":
            most = f"max_factor_bytes allows {written_bytes(self.limits.factors)}"
            return f"because factors would take {written_bytes(self.factor_bytes)}: {most}"
        most = f"max_dense_bytes allows {written_bytes(self.limits.dense)}"
        if self.route == "condensed":
            factors = pays("factors", math.ceil(self.factors_pay_from))
            more = (factors, self.factors_pay_from), (dense, self.pays_from)
            return "; ".join([most, *(words for words, steps in more if steps > 1)])
        if self.dense_bytes <= self.limits.dense:
            return f"as dense matrices are not worth their time for {told}: {dense}"
        return f"because dense matrices would take {written_bytes(self.dense_bytes)}: {most}"

    @property
    def said(self) -> str:
        """Return what a report says of the route: nothing of the usual one."""
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
        if self._factor_bound <= self.limits.factors:
            return self._factor_bound
        sizes = self._sizes().values()
        waiting = max((size.peak - size.memory for size in sizes), default=0)
        return float(sum(size.memory for size in sizes) + waiting)

    @cached_property
    def dense_bytes(self) -> int:
        """Memory that the dense matrices of the contact problem take at most, or would [bytes]."""
        copies = getattr(self.linear, "complements", 0)
        return dense_bytes(self._kept.tolist(), self.rows) + copies * int(8 * np.sum(self._kept**2))

    @cached_property
    def _kept(self) -> Index:
        """Contact DOFs of each body."""
        enters = np.zeros(self.system.n, dtype=bool)
        enters[self._wanted()] = True
        enters[self.system.D] = False
        return np.diff(np.searchsorted(np.flatnonzero(enters), self.system.offsets))

    @cached_property
    def _factor_bound(self) -> float:
        bodies = self.system.bodies
        return float(sum(factor_bound(body.n - len(body.D), body.dim) for body in bodies))

    @property
    def backend(self) -> Any:
        """Return what factorises the bodies, or solves where nothing is factorised beforehand."""
        if isinstance(self.linear, str):
            if self.route != "multigrid":
                return Direct()
            from skfem_contact.linalg.amg import AMG

            return AMG(tol=COMPUTED, max_iterations=CYCLES) if self.few_steps else AMG()
        return self.linear

    def sizes(self) -> dict[str, FactorSize]:
        """What the factorisation of each body in contact will take, before anything is computed."""
        if self.by_memory and not isinstance(self.linear, str):
            raise InputError(
                f"{self.linear!r} factorises the bodies, and how large that will be it does not say in "
                "advance; linear='auto' does."
            )
        return self._sizes(keeping=self.route != "iterated")

    def _sizes(self, keeping: bool = True) -> dict[str, FactorSize]:
        """With contact DOFs kept, or eliminated like all others."""
        check_whole(self.stiffness, "a factorisation, and its size, needs all of it")
        out, wanted = {}, self._wanted()
        for i, (name, K) in enumerate(zip(self.system.names, self.stiffness, strict=True)):
            body = self.system.bodies[i]
            mine = wanted_of(body, self.system.slice(body), wanted)
            if len(mine):
                part = Substructure(body, K, mine, modes=self.system.modes(i))
                out[name] = part.factor_size(part.columns if keeping else part.anchors)
        return out


def _cut(K: csr_matrix, points: NDArray[np.float64]) -> int:
    """Fewest DOFs that separate two halves of a body, along an axis, from each other.

    Its cube is in proportion to what a factorisation takes (A. George, SIAM J. Numer. Anal. 10 (1973)
    345-363): a thirteenth to a sixteenth of the operations for blocks of 14 000 to 93 000 DOFs.
    """
    beyond = points > np.median(points, axis=0)
    pattern = csr_matrix((np.ones(K.nnz, dtype=np.float32), K.indices, K.indptr), shape=K.shape)
    above = pattern @ beyond
    below = np.diff(K.indptr)[:, None] - above
    touching = np.stack([(above > 0) & ~beyond, (below > 0) & beyond])
    return int(np.count_nonzero(touching, axis=1).min())


def dense_bytes(kept: Sequence[int], rows: int) -> int:
    """Memory of the dense matrices of a contact problem at most, before any of them is there [bytes].

    That is the flexibility of each body, the stiffness of gaps and slips, and what an iteration makes
    of it: a factorisation, and what friction adds.

    Parameters
    ----------
    kept : sequence of int
        Contact DOFs of each body.
    rows : int
        Gaps and slips.

    Examples
    --------
    Two bodies of 1000 points, which all have three rows: four and a half matrices.

    >>> dense_bytes([3000, 3000], 3000) / (8 * 3000**2)
    4.5
    """
    return sum(8 * int(n) ** 2 for n in kept) + int(PER_ROWS * 8 * rows**2)
