r"""What an answer may be differentiated by, and how a load step changes with it.

Whatever a parameter is, a step sees five changes of it: of the loads and prescribed displacements, of
gaps and slips, and of the friction of points that slip, at the state that it has. The stiffness is one
of them: the bodies bear ``-dK u`` as a load. So is all that makes another scene, such as the place of
nodes (semi-analytic): what two scenes, a little to either side, make of the same displacements and
contact forces, without solving either.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.tangent.tangent import Tangent
from skfem_contact.arguments import known_keywords, numbers, shown
from skfem_contact.bodies.member import Member
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.friction import Coulomb, Tresca
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.loads import LoadCase
from skfem_contact.conditions.state import transport
from skfem_contact.errors import InputError
from skfem_contact.records import dataclass

Array = NDArray[np.float64]
KINDS = "friction", "stiffness", "load", "displacement", "interference", "gap", "motion", "scene"


@dataclass(eq=False)
class Change:
    """What a parameter changes of one load step, at the state that it has.

    Attributes
    ----------
    f, x : ndarray, shape (n,)
    gap0 : ndarray, shape (m,)
    slip0 : ndarray, shape (m, d-1)
    friction : ndarray, shape (m, d-1)
        Of the friction force that the return map makes of the same trial force [force].
    bound : ndarray, shape (m,)
        Of the bound of friction under the same normal force [force].
    area : ndarray, shape (m,), or None
    axes : tuple of ndarray, or None
        Of normals (m, d) and tangents (m, d-1, d).
    """

    f: Array
    x: Array
    gap0: Array
    slip0: Array
    friction: Array
    bound: Array
    area: Array | None = None
    axes: tuple[Array, Array] | None = None

    @classmethod
    def none(cls, answer: Answer) -> Change:
        """No change."""
        m, t = answer.local.slip.shape
        n, still = answer.system.n, np.zeros((m, t))
        return cls(np.zeros(n), np.zeros(n), np.zeros(m), still, still.copy(), np.zeros(m))

    @property
    def parts(self) -> tuple[Array, ...]:
        """The changes of loads, of the contact, and of its friction."""
        return self.f, self.x, self.gap0, self.slip0, self.friction, self.bound


class Parameter:
    r"""What an answer is differentiated by: one number, or a field of them.

    Parameters
    ----------
    kind : str
        "friction"
            The coefficient of `Coulomb`, the bound ``tau_max`` of `Tresca`, of contacts `of`.
        "stiffness"
            A factor on the stiffness of bodies `of`, 1 where it is as it is: Young's modulus over
            what it is. With `along`, a matrix dK/dp of one body.
        "load"
            ``f + p along`` of bodies `of`; a factor on f if `along` is not given. Thermal strains are a
            load too. Where a step is a number it multiplies `along` as it does f.
        "displacement"
            The same of the prescribed displacements x.
        "interference", "gap"
            Of contacts `of`, in every step [length].
        "motion"
            Of the obstacle of a contact, or of this name: a translation in the direction `along`.
        "scene"
            Anything else, such as the place of nodes, by ``between=(before, behind, width)``:
            two solvers of the same scene with the parameter half the width less and more. They are
            set up and not solved. A width of 1e-4 of the range of the parameter leaves 1e-8.
    of : Contact, Body, str or None
        The body or contact, itself or by name; None for all that there are.
    along : number or ndarray, optional
        By how much each point or DOF changes with the parameter; if not given 1.0, everywhere.
    field : bool
        Whether the value at every point or DOF is a parameter of its own; for `ContactSolver.gradient`.
    each_step : bool
        Whether it is another parameter in each load step; for `ContactSolver.gradient`.
    between : tuple of (ContactSolver, ContactSolver, float)

    Raises
    ------
    InputError

    Examples
    --------
    >>> import skfem_contact as sc
    >>> sc.Parameter("interference", of="joint", field=True, each_step=True)
    Parameter('interference', of='joint', field=True, each_step=True)
    """

    @known_keywords()
    def __init__(
        self,
        kind: str,
        of: Member | Contact | str | None = None,
        *,
        along: Any = None,
        field: bool = False,
        each_step: bool = False,
        between: tuple[Any, Any, float] | None = None,
    ) -> None:
        if kind not in KINDS:
            raise InputError(f"a parameter is {shown(kind)}; it may be one of {', '.join(KINDS)}.")
        if (kind == "scene") != (between is not None):
            raise InputError(
                "between=(solver, solver, width) belongs to Parameter('scene'), and is needed there"
            )
        if field and (along is not None or kind in ("stiffness", "scene")):
            raise InputError(
                f"Parameter({kind!r}, field=True): a field has a value for every point or DOF, so "
                "it has no `along`, and there is none of a stiffness or a scene: give these one by one."
            )
        if kind == "motion" and along is None and not field:
            raise InputError("Parameter('motion'): give the direction, along=(1.0, 0.0)")
        self.kind, self.of, self.along = kind, of, along
        self.field, self.each_step, self.between = field, each_step, between

    def __repr__(self) -> str:
        said = [repr(self.kind)]
        said += [f"{k}={v!r}" for k in ("of", "along") if (v := getattr(self, k)) is not None]
        said += [f"{k}=True" for k in ("field", "each_step") if getattr(self, k)]
        return f"Parameter({', '.join(said)})"


def parameter(given: Any) -> Parameter:
    """What `by` names: a `Parameter`, or its kind alone."""
    return given if isinstance(given, Parameter) else Parameter(given)


def change(by: Parameter, tangent: Tangent, answer: Answer) -> Change:
    """What a number changes of the load step of an answer."""
    out = Change.none(answer)
    if by.kind == "scene":
        return _between(by, tangent, answer)
    if by.kind == "stiffness":
        for i in _bodies(by, answer):
            span = answer.system.slice(answer.system.bodies[i])
            out.f[span] = -_stiffness(by, answer, i) @ answer.u[span]
    elif by.kind in ("load", "displacement"):
        _loaded(by, answer, out)
    else:
        for i, part in _contacts(by, answer):
            _contact(by, tangent, answer, i, part, out)
    return out


def _contact(by: Parameter, tangent: Tangent, answer: Answer, i: int, part: slice, out: Change) -> None:
    """Changes of one contact."""
    kin, count = answer.kin, part.stop - part.start
    if by.kind == "motion":
        v = _vector(by, kin.points.shape[1])
        out.gap0[part] = np.where(kin.paired[part], -(kin.normal[part] @ v), 0.0)
        out.slip0[part] = -np.where(kin.paired[part, None], kin.axes[part] @ v, 0.0)
        return
    given = np.zeros(kin.m)
    along = 1.0 if by.along is None else by.along
    given[part] = _field(along, count, f"{by!r}: along")
    if by.kind == "friction":
        steep = by_coefficient(tangent, answer, i, part)
        out.bound[part] = steep * given[part]
        out.friction += tangent.direction * np.where(tangent.slips, out.bound, 0.0)[:, None]
        out.friction[: part.start] = out.friction[part.stop :] = 0.0
        return
    gap = kin.of_rows(given) * (1.0 if by.kind == "gap" else -1.0)
    out.gap0[:] += np.where(kin.paired, gap, 0.0)


def by_coefficient(tangent: Tangent, answer: Answer, i: int, part: slice) -> Array:
    """Derivative of the bounds of a contact by the coefficient of its law, (m_c,)."""
    law, area = answer.contacts[i].friction, answer.local.area[part]
    force = np.maximum(answer.local.normal_force[part], 0.0)
    if type(law) is Tresca:
        return np.where(tangent.closed[part], area, 0.0)
    if type(law) is not Coulomb:
        raise InputError(
            f"Parameter('friction'): contact {answer.names[i]!r} has the law {type(law).__name__}, "
            "which has no single coefficient. Use Parameter('scene', between=(...)) with two solvers "
            "whose laws differ a little."
        )
    free = law.mu * force + law.cohesion * area < law.tau_max * np.maximum(area, 0.0)
    return np.where((free | np.isinf(law.tau_max)) & tangent.closed[part], force, 0.0)


def _loaded(by: Parameter, answer: Answer, out: Change) -> None:
    """Changes of loads, or of prescribed displacements."""
    loads = by.kind == "load"
    factor = answer.case.scale[0 if loads else 1]
    for i in _bodies(by, answer):
        body, span = answer.system.bodies[i], answer.system.slice(answer.system.bodies[i])
        values = (answer.case.f if loads else answer.case.x)[span]
        if by.along is not None:
            scale = answer.system.scale(body)
            values = _field(by.along, body.n, f"{by!r}: along") * (1.0 if factor is None else factor)
            values = values / scale if loads else values * scale
        if loads:
            out.f[span] = values
        else:
            out.x[span][body.D] = values[body.D]


def _between(by: Parameter, tangent: Tangent, answer: Answer) -> Change:
    """Changes between two scenes, at the displacements and forces of the answer."""
    assert by.between is not None
    *ends, width = by.between
    local, u = answer.local, answer.u
    if len({(s.system.n, s.kin.m, s.kin.paired.tobytes()) for s in (*ends, answer)}) != 1:
        raise InputError(
            f"{by!r}: the two scenes and the solver differ in their DOFs, points, or in which points "
            "have a partner; nodes may move, and must stay the same. Take a smaller width."
        )
    if answer.kin.scaled is not None:
        raise InputError(f"{by!r}: not with OrthotropicCoulomb, whose directions turn with the surface")
    found = []
    for solver in ends:
        kin, case = solver.kin, _case_there(solver, answer)
        K = [
            K @ u[answer.system.slice(b)]
            for K, b in zip(solver.linear_model.stiffness, answer.system.bodies, strict=True)
        ]
        f = case.f - np.concatenate(K) + kin.B_n.T @ local.normal_force
        gap0 = np.where(kin.paired, case.gap0, 0.0) + np.where(kin.paired, kin.B_n @ u, 0.0)
        slip0, bound = case.slip0, np.zeros(kin.m)
        friction, axes = np.zeros(local.slip.shape), kin.axes
        if friction.size:
            own = _turned(answer, kin)
            slip0 = slip0 + (kin.B_t @ u).reshape(slip0.shape)
            slip0 = np.einsum("ikl,il->ik", own, slip0)
            f = f - kin.B_t.T @ np.einsum("ikl,ik->il", own, local.tangential_force).ravel()
            rule = FrictionRule(solver.interface.laws, kin.area, local.reference)
            trial = np.where(tangent.slips[:, None], tangent.slopes.trial, 0.0)
            friction = rule.project(trial, local.normal_force, local.slip)[0]
            bound = np.where(tangent.closed, rule.bound(local.normal_force, local.slip), 0.0)
            axes = np.einsum("ikl,ild->ikd", own, kin.axes)
        found.append((f, case.x, gap0, slip0, friction, bound, kin.area, kin.normal, axes))
    rates = [(b - a) / width for a, b in zip(*found, strict=True)]
    f, x, gap0, slip0, friction, bound, area, normal, axes = rates
    return Change(f, x, gap0, slip0, friction, bound, area, (normal, axes))


def _turned(answer: Answer, kin: Any) -> Array:
    """Components along the tangents of an answer from those of another scene, (m, d-1, d-1).

    Tangents in space are a choice, which jumps: those of the answer are turned to the other normals.
    """
    along = np.stack(
        [transport(axis, answer.kin.normal, kin.normal) for axis in answer.kin.axes.transpose(1, 0, 2)],
        axis=1,
    )
    return np.asarray(np.einsum("ikd,ild->ikl", along, kin.axes))


def _case_there(solver: Any, answer: Answer) -> LoadCase:
    """The load case of an answer as another solver of the scene reads it."""
    from copy import copy

    reader, case = solver._reader, copy(answer.case)
    given = np.array(case.interference)
    for part, own, values in zip(
        answer.model.interface.point_slices, case.own, reader._own, strict=True
    ):
        if own:
            given[part] = values
    case.interference = given
    return reader.resumed(case, case.x)


# -- whose ----------------------------------------------------------------------------------------


def _bodies(by: Parameter, answer: Answer) -> list[int]:
    system = answer.system
    if by.of is None:
        return list(range(len(system.bodies)))
    if isinstance(by.of, Contact):
        raise InputError(f"{by!r}: of is a contact; name a body")
    return [system.index(by.of)]


def _contacts(by: Parameter, answer: Answer) -> list[tuple[int, slice]]:
    """Contacts of a parameter, with their points."""
    slices, names = answer.model.interface.point_slices, answer.names
    if by.of is None:
        some = [
            i
            for i, contact in enumerate(answer.contacts)
            if (contact.friction is not None or by.kind != "friction")
            and (contact.rigid or by.kind != "motion")
        ]
        return [(i, slices[i]) for i in some]
    some = [i for i, name in enumerate(names) if name == by.of]
    some += [
        i
        for i, contact in enumerate(answer.contacts)
        if by.kind == "motion" and contact.rigid and by.of == contact.primary.name and i not in some
    ]
    i = None if some else number_of(by.of, answer.contacts)
    some = some if i is None else [i]
    if not some:
        raise InputError(f"{by!r}: there is no such contact; there are {', '.join(map(repr, names))}.")
    return [(i, slices[i]) for i in some]


def _stiffness(by: Parameter, answer: Answer, i: int) -> Any:
    if by.along is None or (np.ndim(by.along) == 0 and not hasattr(by.along, "tocsr")):
        return (1.0 if by.along is None else float(by.along)) * answer.stiffness[i]
    body = answer.system.bodies[i]
    K = by.along.tocsr()
    if K.shape != (body.n, body.n):
        raise InputError(f"{by!r}: along has shape {K.shape}; a body of {body.n} DOFs was named")
    return answer.system.scaled(body, K)


def _field(given: ArrayLike, count: int, what: str) -> Array:
    values = numbers(given, what, "give a number, or one for each point or DOF")
    if values.shape not in ((), (count,)):
        raise InputError(f"{what} has shape {values.shape}, not ({count},): one for each point or DOF")
    return np.broadcast_to(values, count).astype(float)


def _vector(by: Parameter, d: int) -> Array:
    v = numbers(by.along, f"{by!r}: along", f"give {d} components")
    if v.shape != (d,):
        raise InputError(f"{by!r}: along has shape {v.shape}; give the {d} components of a translation")
    return v


# -- fields, from the duals of a step -------------------------------------------------------------


def contracted(by: Parameter, tangent: Tangent, answer: Answer, duals: Change) -> Any:
    """Derivative of a number by a parameter in one step, from its derivatives by all changes."""
    if not by.field:
        parts = zip(change(by, tangent, answer).parts, duals.parts, strict=True)
        return sum(float(np.vdot(a, b)) for a, b in parts)
    if by.kind in ("load", "displacement"):
        which = ("load", "displacement").index(by.kind)
        bodies = _bodies(by, answer)
        if len(bodies) != 1:
            raise InputError(f"{by!r}: name the body, of=...; a field is of one")
        body, factor = answer.system.bodies[bodies[0]], answer.case.scale[which]
        scale = answer.system.scale(body)
        own = (duals.f if which == 0 else duals.x)[answer.system.slice(body)]
        own = own / scale if which == 0 else own * scale
        return own * (1.0 if factor is None else factor)
    contacts = _contacts(by, answer)
    if len(contacts) != 1:
        raise InputError(f"{by!r}: name the contact, of=...; a field is of one")
    i, part = contacts[0]
    if by.kind == "friction":
        along = np.sum(duals.friction * tangent.direction, axis=1) + duals.bound
        return by_coefficient(tangent, answer, i, part) * along[part]
    kin, gap0 = answer.kin, np.where(answer.kin.paired, duals.gap0, 0.0)
    if by.kind == "motion":
        slip0 = np.where(kin.paired[:, None], duals.slip0, 0.0)[part]
        return -(kin.normal[part].T @ gap0[part] + np.einsum("ik,ikd->d", slip0, kin.axes[part]))
    given = gap0 if kin.gap_weights is None else kin.gap_weights.T @ gap0
    return given[part] * (1.0 if by.kind == "gap" else -1.0)


def needs_loads(by: Parameter) -> bool:
    """Whether a parameter changes loads of the bodies, so that duals of the interior are needed."""
    return by.kind in ("stiffness", "load", "displacement", "scene")
