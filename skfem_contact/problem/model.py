"""`LinearModel`: the bodies, condensed once or taken whole, and the contact problem put upon them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body
from skfem_contact.conditions.geometry import Geometry, secondary_dofs
from skfem_contact.conditions.interface import Interface, point_labels
from skfem_contact.conditions.kinematics import Kinematics
from skfem_contact.conditions.motions import RigidMotions, no_equilibrium, rigid_motions
from skfem_contact.conditions.state import LoadCase
from skfem_contact.linalg.dense_factors import Limits, single_threaded
from skfem_contact.problem.condensed import (
    Choice,
    Condensed,
    check_distributed,
    checked_linear,
    firmness,
)
from skfem_contact.problem.seam import ContactProblem, PosedOn
from skfem_contact.problem.substructure import Substructure
from skfem_contact.problem.zone import PointProblem
from skfem_contact.records import Lock, carried, once, seal

if TYPE_CHECKING:
    from skfem_contact.problem.full import FullSystem
    from skfem_contact.problem.iterated import IteratedBodies, MultigridBodies

    AnyBodies: TypeAlias = Condensed | IteratedBodies | MultigridBodies | FullSystem


EVEN_CLOSED = "even with every contact point closed"


# Sets of springs whose twins are kept: two weak ones, and some of single DOFs.
MOST_TWINS = 6


class LinearModel:
    """The part of a problem that depends on the stiffness and not on loads; factorised when needed.

    All solves share it, those of several threads too: what it computes stays as it is, and is computed
    by the first who asks for it, while the others wait. What a solve changes is in its `Workspace`.

    Parameters
    ----------
    geometry : Geometry
        Its bodies, contacts, and pairing of the undeformed bodies.
    interface : Interface
    stiffness : sequence of csr_matrix
        Of each body.
    motions : RigidMotions
        Those that supports and stiffness leave free.
    linear : "auto", "condensed", "iterated", a backend or a solver callable
        As for `ContactSolver`.
    limits : Limits
        Memory up to which "auto" forms dense matrices, and factorises.
    timings : dict
        Seconds by stage are added here.
    reuse : sequence of Substructure or None
        Bodies that are still as they were condensed.
    steps : float
        Load steps that are known to come, see `Choice`.
    """

    def __init__(
        self,
        geometry: Geometry,
        interface: Interface,
        stiffness: Sequence[csr_matrix],
        motions: RigidMotions,
        linear: Any,
        limits: Limits,
        timings: dict[str, float],
        reuse: Sequence[Substructure | None] = (),
        steps: float = 0.0,
    ) -> None:
        self.geometry, self.interface = geometry, interface
        self.system, self.kin = geometry.system, geometry.kin
        self.stiffness = tuple(stiffness)
        self.motions = motions
        self.linear, self.limits = checked_linear(linear), limits
        check_distributed(self.linear, self.stiffness)
        self.timings = timings
        self._reuse, self._steps = list(reuse), steps
        self._sprung: dict[bytes, LinearModel] = {}
        self._undeformed: LinearModel | None = None  # of which this has the tangents
        self._decided = False  # on a route: bodies are made, or being made
        self._lock = Lock()

    def __getstate__(self) -> dict[str, Any]:
        """Without what is computed: elsewhere bodies are condensed when they are first asked for."""
        linear = carried(self.linear, "linear")
        known = {**vars(self), "linear": linear, "_sprung": {}, "_reuse": [], "_decided": False}
        for made in ("_wanted", "choice", "bodies", "base", "_for_pivoting", "for_tangents"):
            known.pop(made, None)
        return known | {"_undeformed": None}

    @cached_property
    def diagonals(self) -> tuple[Array, ...]:
        """Diagonal of K of each body; load steps ask, and K has the whole interior.

        Of rigid bodies, which have no stiffness of their own, at least that of what they touch.
        """
        own = [K.diagonal() for K in self.stiffness]
        if all(isinstance(body, Body) for body in self.system.bodies):
            return tuple(own)
        firm = firmness(self.system, self.stiffness, self._wanted)
        return tuple(
            diagonal if isinstance(body, Body) else np.maximum(diagonal, firm)
            for body, diagonal in zip(self.system.bodies, own, strict=True)
        )

    @cached_property
    def stiffest(self) -> tuple[float, ...]:
        """Largest diagonal entry of K of each body."""
        return tuple(float(np.max(diagonal)) for diagonal in self.diagonals)

    def moves(self, case: LoadCase) -> tuple[float, ...]:
        """Largest prescribed displacement of each body [length]."""
        moved = np.abs(case.x[self.system.D])
        own = [moved[part] for part in self.system.supports]
        return tuple([float(sizes.max()) if sizes.size else 0.0 for sizes in own])

    def with_interface(
        self, interface: Interface, timings: dict[str, float], geometry: Geometry
    ) -> LinearModel:
        """The same bodies under other friction laws; shared, where the laws need the same rows."""
        same = np.array_equal(interface.slipping, self.interface.slipping)
        own = geometry is self.geometry
        motions = self.motions if own else self.motions.seen_by(geometry.kin)
        if same and own:
            self.prepare()
        twin = self._like(geometry=geometry, interface=interface, motions=motions, timings=timings)
        if same and own:
            made = vars(self).keys() & {"bodies", "base"}
            vars(twin).update({name: vars(self)[name] for name in made})
        elif same and np.array_equal(twin._wanted, self._wanted):  # slips have other axes
            vars(twin)["bodies"] = self.bodies
            twin._steps = self.choice.steps
        return twin

    def with_springs(self, springs: NDArray[np.float64]) -> LinearModel:
        """The same with springs to the ground on its DOFs (n,); kept, as load steps ask again."""
        if not springs.any():
            return self
        parts = [springs[self.system.slice(body)] for body in self.system.bodies]
        return self.with_other(
            springs.tobytes(),
            lambda: {
                i: self.stiffness[i] + csr_matrix(diags(own))
                for i, own in enumerate(parts)
                if own.any()
            },
        )

    def with_other(self, key: bytes, changed: Callable[[], Mapping[int, Any]]) -> LinearModel:
        """The same with another stiffness of some bodies, by their number; kept by a key."""
        with self._lock:
            known = self._sprung.get(key)
            if known is None:
                if len(self._sprung) >= MOST_TWINS:
                    self._sprung.pop(next(iter(self._sprung)))
                known = self._sprung[key] = self._with(changed())
            return known

    def _with(self, changed: Mapping[int, Any]) -> LinearModel:
        stiffness = [changed.get(i, K) for i, K in enumerate(self.stiffness)]
        reuse = [None if i in changed else part for i, part in enumerate(self.substructures)]
        motions = rigid_motions(self.system, self.kin, stiffness)
        twin = self._like(stiffness=stiffness, motions=motions, reuse=reuse)
        # one of the pattern of K and of what supports hold, which springs that are added do not change
        vars(twin)["choice"] = self.choice
        return twin

    def _like(self, **changed: Any) -> LinearModel:
        """Another model, which differs in some of its parameters."""
        same = "geometry", "interface", "stiffness", "motions", "linear", "limits", "timings"
        given = {name: getattr(self, name) for name in same} | {"steps": self.choice.steps}
        return LinearModel(**(given | changed))

    def expecting(self, steps: float) -> LinearModel:
        """The model for more load steps to come; another one where so many are worth another route.

        Results that are there keep the one they have.
        """
        with self._lock:
            old, new = self.choice, self.choice.expecting(steps)
            if self._decided or "bodies" in vars(self) or self._sprung:  # which have their choice here
                same = new.route == old.route
                if not same or new.few_steps != old.few_steps:
                    return self._like(reuse=self.substructures if same else (), steps=new.steps)
            self.choice = new
            return self

    def with_tangents(self, stiffness: Sequence[csr_matrix]) -> LinearModel:
        """The same bodies with the tangents of an iterate; those with the same matrix stay condensed.

        What is condensed for one iterate serves those that follow, whoever began; what bodies remember
        of loads does not: an answer is the same to the last bit in a solver that goes on from a file.
        """
        known = zip(self.substructures, self.stiffness, stiffness, strict=False)
        reuse = [part.unloaded() if part and new is old else None for part, old, new in known]
        # without supports it is a matter of the tangent what holds: a stressed one resists rotations
        motions = self.motions
        if motions.k:
            motions = rigid_motions(self.system, self.kin, list(stiffness))
        twin = self._like(stiffness=stiffness, motions=motions, reuse=reuse, steps=0.0)
        twin._undeformed = self
        for name in ("_wanted", "_prefer", "labels", "choice"):  # of the pairing and the pattern of K
            vars(twin)[name] = getattr(self, name)
        return twin

    def _keep_parts(self, bodies: AnyBodies, stiffness: Sequence[csr_matrix]) -> None:
        """Take the bodies that another model has condensed, and that are the same here."""
        if "bodies" in vars(self) or self.substructures:
            return
        parts = getattr(bodies, "substructures", ())
        known = zip(parts, self.stiffness, stiffness, strict=False)
        self._reuse = [part if own is other else None for part, own, other in known]

    def prepare(self) -> None:
        """Do now what the first load step would do once."""
        with single_threaded:
            self.bodies if self.geometry.follows else self.base  # noqa: B018 (made when first asked for)

    @once
    def bodies(self) -> AnyBodies:
        """The linear problem of the bodies without contact, made when first asked for."""
        if self.loose.shape[1]:
            raise no_equilibrium(self.motions, self.loose, EVEN_CLOSED)
        start = time.perf_counter()
        with self._lock:  # another thread may let more steps be known
            self._decided = True
        with single_threaded:
            made = self._made(self.route)
        self.timings["condensation"] = time.perf_counter() - start
        if self._undeformed is not None:
            self._undeformed._keep_parts(made, self.stiffness)
        return made

    def _made(self, route: str) -> AnyBodies:
        parts = self.system, self.stiffness, self._wanted, self._reuse
        if route == "condensed":
            return Condensed(*parts, self.choice.backend)
        # the other routes are for few and large problems
        from skfem_contact.problem.full import FullSystem
        from skfem_contact.problem.iterated import IteratedBodies, MultigridBodies

        if route == "full":
            return FullSystem(self.system, self.stiffness, self.choice.backend)
        kind = IteratedBodies if route == "iterated" else MultigridBodies
        return kind(*parts, self.choice.backend)

    @property
    def known(self) -> np.ndarray:
        """DOFs whose displacements a load step knows without the interior, supports apart."""
        return self._wanted if self.route == "condensed" else np.arange(self.system.n)

    @property
    def substructures(self) -> list[Substructure | None]:
        """The bodies as condensed so far; empty where they are not."""
        # those of the condensed and of the iterated route
        return list(getattr(vars(self).get("bodies"), "substructures", self._reuse))

    @cached_property
    def choice(self) -> Choice:
        """Return how the bodies enter the contact problem, and why."""
        slipping = self.kin.paired & self.interface.slipping
        rows = int(self.kin.paired.sum() + self.kin.tangents * slipping.sum())
        given = self.linear, self.limits, self.system, self.stiffness
        bends = self.geometry.follows or any(body.nonlinear for body in self.system.bodies)
        plain = not (bends or self.motions.k)
        return Choice(*given, rows, lambda: self._wanted, self._steps, plain)

    @property
    def route(self) -> str:
        """Return how the bodies enter the contact problem, see `Choice.route`."""
        return self.choice.route

    def problem_on(self, kin: Kinematics | None, u: Array | None) -> ContactProblem:
        """The contact problem on a pairing; without one, on that of the undeformed bodies."""
        return self.base if kin is None else self._posed(self.bodies, kin, u)

    @once
    def base(self) -> ContactProblem:
        """The contact problem on the pairing of the undeformed bodies."""
        return self._posed(self.bodies, self.kin, None)

    def _posed(self, bodies: AnyBodies, kin: Kinematics, u: Array | None) -> ContactProblem:
        own, base = kin is self.kin, self._undeformed

        def independent() -> bool:
            return base is not None and base.problem_on(None if own else kin, u).springs is None

        motions = self.motions if own else self.motions.seen_by(kin)
        prefer = self._prefer if self.route == "full" else None
        seal(kin)
        on = PosedOn(kin, motions, u, self.interface.slipping, prefer, independent)
        start = time.perf_counter()
        problem = bodies.attach(on)
        with self._lock:
            before = self.timings.get("contact problem", 0.0)
            self.timings["contact problem"] = before + time.perf_counter() - start
        return problem

    def on_points(self, problem: ContactProblem) -> ContactProblem:
        """The same problem on gaps and slips; on the sparse route condensed for this alone.

        The problem is one that nobody else solves at the moment.
        """
        if self.route == "condensed" or not self.choice.condenses:
            return problem
        if problem.on_points is None:
            problem.on_points = self._posed(self._for_pivoting, problem.kin, problem.u)
        return problem.on_points

    @once
    def _for_pivoting(self) -> Condensed:
        return Condensed(self.system, self.stiffness, self._wanted)

    @once
    def for_tangents(self) -> PointProblem | None:
        """The problem on gaps and slips that derivatives are taken on; None where there is none.

        It is read by several threads at once: nothing but its matrices is to be used.
        """
        if not self.choice.condenses:
            return None
        with single_threaded:
            found = self.on_points(self.base)
        return found if isinstance(found, PointProblem) else None

    @cached_property
    def _wanted(self) -> NDArray[np.intp]:
        """DOFs that contact rows may touch: those of now, and of surfaces that slide far."""
        return np.union1d(self.touched(), self.geometry.surface_dofs)

    def touched(self) -> NDArray[np.intp]:
        """DOFs that occur in the rows of points with a partner."""
        kin, slips = self.kin, self.kin.paired & self.interface.slipping
        found = np.zeros(self.system.n, dtype=bool)
        found[kin.B_n.indices] = True  # points without partner have none
        if slips.any():
            found[kin.B_t[np.repeat(slips, kin.tangents)].indices] = True
        return np.flatnonzero(found)

    @cached_property
    def _prefer(self) -> NDArray[np.bool_]:
        return secondary_dofs(self.system, self.interface.contacts)

    @cached_property
    def labels(self) -> list[str]:
        """Names of all points."""
        contacts = self.interface.contacts
        sizes = [part.stop - part.start for part in self.interface.point_slices]
        named = [point_labels(c, m) for c, m in zip(contacts, sizes, strict=True)]
        return [str(label) for label in np.concatenate(named)]

    @cached_property
    def loose(self) -> Array:
        """Motions that stay free even with every point closed and sticking, shape (k, j)."""
        if self.geometry.follows:  # other points will meet
            return np.zeros((self.motions.k, 0))
        return self.motions.free(self.kin.paired, self.interface.slipping & self.kin.paired)
