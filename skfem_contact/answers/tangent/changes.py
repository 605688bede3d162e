r"""What an answer may be differentiated by, and how a load step changes with it.

Whatever a parameter is, a step sees five changes of it: of the loads and prescribed displacements, of
gaps and slips, and of the friction of points that slip, at the state that it has. The stiffness is one
of them: the bodies bear ``-dK u`` as a load. So is all that makes another scene, such as the place of
nodes (semi-analytic): what two scenes, a little to either side, make of the same displacements and
contact forces, without solving either.
"""

from __future__ import annotations

from dataclasses import field
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
#: What changes loads of bodies, so that derivatives by these are needed inside; then what does not.
LOADS = "stiffness", "load", "displacement", "scene"
BOLTS = "bolt_force", "bolt_stretch"
GAPS = "interference", "gap"
KINDS = "friction", *LOADS, *GAPS, "motion", *BOLTS


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
    drive, tension : ndarray, shape (b,)
        Of the stretch of bolts, at the same displacements, and of their forces at the same stretch too.
    shape : dict of ndarray
        Of areas, normals and axes, as `Weights.points` has them; empty where they stay.
    """

    f: Array
    x: Array
    gap0: Array
    slip0: Array
    friction: Array
    bound: Array
    drive: Array
    tension: Array
    shape: dict[str, Array] = field(default_factory=dict)

    @classmethod
    def none(cls, answer: Answer, loads: bool = True) -> Change:
        """No change; without `loads` f and x are empty."""
        m, t = answer.local.slip.shape
        n, still = answer.system.n if loads else 0, np.zeros((m, t))
        bolts = np.zeros((2, len(answer.bolt_names)))
        return cls(np.zeros(n), np.zeros(n), np.zeros(m), still, still.copy(), np.zeros(m), *bolts)

    @property
    def parts(self) -> tuple[Array, ...]:
        """The changes of loads, of the contact, of its friction, and of bolts."""
        contact = self.gap0, self.slip0, self.friction, self.bound
        return self.f, self.x, *contact, self.drive, self.tension

    def dot(self, by: Change) -> float:
        """What it makes of a number that has these derivatives, but for `shape`."""
        return sum(float(np.vdot(a, b)) for a, b in zip(self.parts, by.parts, strict=True) if b.size)

    @property
    def case(self) -> LoadCase:
        """Return what the bodies and the points see of it, as a load case."""
        return LoadCase(self.f, self.x, self.gap0, self.slip0, np.zeros(len(self.gap0)), ())

    def minus(self, other: Change, factor: float) -> Change:
        """The difference to another one, times a factor."""
        shape = {name: factor * (own - other.shape.get(name, 0.0)) for name, own in self.shape.items()}
        parts = [factor * (own - away) for own, away in zip(self.parts, other.parts, strict=True)]
        f, x, gap0, slip0, friction, bound, drive, tension = parts
        return Change(f, x, gap0, slip0, friction, bound, drive, tension, shape)


class Parameter:
    r"""A parameter by which answers are differentiated: one number, or a field of them.

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
        "bolt_force", "bolt_stretch"
            Of bolts `of`, in all load steps that give it.
        "scene"
            Anything else, such as the place of nodes, by ``between=(before, behind, width)``:
            two solvers of the same scene with the parameter half the width less and more. They are
            set up and not solved. A width of 1e-4 of the range of the parameter leaves 1e-8.
    of : Contact, Body, Bolt, str or None
        The body, contact or bolt, itself or by name; None for all that there are.
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
    >>> sc.answers.Parameter("interference", of="joint", field=True, each_step=True)
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
            raise InputError("between=(solver, solver, width) belongs to 'scene', and is needed there")
        if field and (along is not None or kind in ("stiffness", "scene", *BOLTS)):
            raise InputError(
                f"Parameter({kind!r}, field=True): a field has a value for every point or DOF, so it "
                "has no `along`; a stiffness, scene or bolt has none: give them one by one."
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
    """Return what `by` names: a `Parameter`, or its kind alone."""
    return given if isinstance(given, Parameter) else Parameter(given)


def change(by: Parameter, tangent: Tangent) -> Change:
    """Return what a number changes of the load step of an answer."""
    answer, out = tangent.answer, Change.none(tangent.answer)
    if by.kind == "scene":
        return _between(by, tangent)
    if by.kind in BOLTS:
        if bolts := tangent.bolts:
            named = bolts.given if by.kind == "bolt_force" else ~bolts.given & ~bolts.kept
            along = np.where(named & _bolts(by, answer), 1.0 if by.along is None else by.along, 0.0)
            out.drive = along / np.where(bolts.given, bolts.k, 1.0)
        return out
    for i, at in _places(by, answer):
        if by.kind == "stiffness":
            out.f[at] = -_borne(by, tangent, i)
            continue
        own = {"load": answer.case.applied, "displacement": answer.case.x}.get(by.kind)
        for name, factor in _factors(by, tangent, i, at):
            count = factor.shape[-1]
            if by.along is None:
                values = np.ones(count) if own is None else own[at]
            else:
                values = _field(by, by.along, count)
            getattr(out, name)[at] = factor @ values if by.kind == "motion" else (factor * values).T
    if by.kind == "stiffness":
        out.drive, out.tension = _pulled(tangent, -out.f)
    elif by.kind in GAPS:
        out.gap0 = np.where(answer.kin.paired, answer.kin.of_rows(out.gap0), 0.0)
    D, x = answer.system.D, out.x
    out.x = np.zeros(len(x))
    out.x[D] = x[D]
    return out


def contracted(by: Parameter, tangent: Tangent, duals: Change, weights: Any) -> Any:
    """Derivative of a number by a parameter in one step: a number, or the array of a field.

    From its derivatives by all changes of the step: `change` transposed.
    """
    if not by.field:
        found = change(by, tangent)
        return found.dot(duals) + weights.at(found.shape)
    kin, places = tangent.answer.kin, _places(by, tangent.answer)
    if len(places) != 1:
        raise InputError(f"{by!r}: a field is of one body or contact; name it, of=...")
    [(i, at)], total = places, 0.0
    for name, factor in _factors(by, tangent, i, at):
        dual, count = getattr(duals, name), factor.shape[-1]
        if by.kind in GAPS:
            dual = np.where(kin.paired, dual, 0.0)
            dual = dual if kin.gap_weights is None else kin.gap_weights.T @ dual
        dual = dual[at]
        each = dual[..., None] * factor if by.kind == "motion" else dual.T * factor
        total = total + each.reshape(-1, count).sum(axis=0)
    return total


def _factors(by: Parameter, tangent: Tangent, i: int, at: slice) -> list[tuple[str, Array]]:
    """What a parameter changes of its body or contact, over its values there, (..., count).

    Each with its name; of every point or DOF by the value there, of a motion by all its components.
    """
    answer, kin = tangent.answer, tangent.answer.kin
    if by.kind in LOADS:
        share = 1.0 if by.along is None and not by.field else _factor(by, answer, i)
        return [("f" if by.kind == "load" else "x", np.full(at.stop - at.start, share))]
    if by.kind == "friction":
        steep = by_coefficient(tangent, i, at)
        return [("bound", steep), ("friction", tangent.direction[at].T * steep)]
    if by.kind == "motion":
        paired = kin.paired[at, None]
        axes = np.where(paired[..., None], -kin.axes[at], 0.0)
        return [("gap0", np.where(paired, -kin.normal[at], 0.0)), ("slip0", axes)]
    return [("gap0", np.full(at.stop - at.start, 1.0 if by.kind == "gap" else -1.0))]


def by_coefficient(tangent: Tangent, i: int, part: slice) -> Array:
    """Derivative of the bounds of a contact by the coefficient of its law, (m_c,)."""
    answer = tangent.answer
    law, area = answer.contacts[i].friction, answer.local.area[part]
    force = np.maximum(answer.local.normal_force[part], 0.0)
    if type(law) is Tresca:
        return np.where(tangent.closed[part], area, 0.0)
    if type(law) is not Coulomb:
        raise InputError(
            f"contact {answer.names[i]!r} has the law {type(law).__name__}, which has no single "
            "coefficient. Use Parameter('scene', between=(...)), two solvers whose laws differ."
        )
    free = law.mu * force + law.cohesion * area < law.tau_max * np.maximum(area, 0.0)
    return np.where((free | np.isinf(law.tau_max)) & tangent.closed[part], force, 0.0)


def _between(by: Parameter, tangent: Tangent) -> Change:
    """Changes between two scenes, at the displacements and forces of the answer."""
    assert by.between is not None
    *ends, width = by.between
    answer = tangent.answer
    if len({(s.system.n, s.kin.m, s.kin.paired.tobytes()) for s in (*ends, answer)}) != 1:
        raise InputError(
            f"{by!r}: the two scenes and the solver differ in their DOFs, points, or in which points "
            "have a partner; nodes may move, and must stay the same. Take a smaller width."
        )
    if answer.kin.scaled is not None:
        raise InputError(f"{by!r}: not with OrthotropicCoulomb, whose directions turn with the surface")
    less, more = (_in_scene(solver, tangent) for solver in ends)
    return more.minus(less, 1.0 / width)


def _in_scene(solver: Any, tangent: Tangent) -> Change:
    """What a scene makes of the displacements and forces of an answer, with loads and geometry."""
    answer, local, u = tangent.answer, tangent.local, tangent.answer.u
    kin, case, bodies = solver.kin, _case_there(solver, answer), answer.system.bodies
    stiffness = zip(solver.linear_model.stiffness, bodies, strict=True)
    borne = np.concatenate([K @ answer.stretched(body) for K, body in stiffness])
    f = case.f - borne + kin.B_n.T @ local.normal_force
    gap0 = np.where(kin.paired, case.gap0, 0.0) + np.where(kin.paired, kin.B_n @ u, 0.0)
    slip0, bound = case.slip0, np.zeros(kin.m)
    friction, axes = np.zeros(local.slip.shape), kin.axes
    if friction.size:
        own = _turned(answer, kin)
        slip0 = np.einsum("ikl,il->ik", own, slip0 + (kin.B_t @ u).reshape(slip0.shape))
        f = f - kin.B_t.T @ np.einsum("ikl,ik->il", own, local.tangential_force).ravel()
        rule = FrictionRule(solver.interface.laws, kin.area, local.reference)
        trial = np.where(tangent.slips[:, None], tangent.slopes.trial, 0.0)
        friction = rule.project(trial, local.normal_force, local.slip)[0]
        bound = np.where(tangent.closed, rule.bound(local.normal_force, local.slip), 0.0)
        axes = np.einsum("ikl,ild->ikd", own, kin.axes)
    shape = {"area": kin.area[:, None], "normal": kin.normal, "axes": axes.reshape(kin.m, -1)}
    return Change(f, case.x, gap0, slip0, friction, bound, *_pulled(tangent, borne), shape)


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
    case.f = answer.case.applied  # without the load of bolts
    given = np.array(case.interference)
    for part, own, values in zip(
        answer.model.interface.point_slices, case.own, reader._own, strict=True
    ):
        if own:
            given[part] = values
    case.interference = given
    return reader.resumed(case, case.x)


# -- whose ----------------------------------------------------------------------------------------


def _places(by: Parameter, answer: Answer) -> list[tuple[int, slice]]:
    """Bodies of a parameter with their DOFs, or contacts with their points."""
    if by.kind not in LOADS:
        return _contacts(by, answer)
    system = answer.system
    if isinstance(by.of, Contact):
        raise InputError(f"{by!r}: of is a contact; name a body")
    some = range(len(system.bodies)) if by.of is None else [system.index(by.of)]
    return [(i, system.slice(system.bodies[i])) for i in some]


def _contacts(by: Parameter, answer: Answer) -> list[tuple[int, slice]]:
    """Contacts of a parameter, with their points."""
    names, contacts = answer.names, list(enumerate(answer.contacts))
    if by.of is None:
        lacks = {"friction": "friction", "motion": "rigid"}.get(by.kind, "name")
        some = [i for i, contact in contacts if lacks == "name" or getattr(contact, lacks)]
    else:
        some = [i for i, contact in contacts if by.of == names[i]]
        if by.kind == "motion":
            some = some or [i for i, c in contacts if c.rigid and by.of == c.primary.name]
        i = None if some else number_of(by.of, answer.contacts)
        some = some if i is None else [i]
    if not some and by.of is not None:
        raise InputError(f"{by!r}: there is no such contact; there are {', '.join(map(repr, names))}.")
    return [(i, answer.model.interface.point_slices[i]) for i in some]


def _bolts(by: Parameter, answer: Answer) -> NDArray[np.bool_]:
    """Bolts of a parameter, as a mask (b,)."""
    assert answer.bolts is not None
    known = list(zip(answer.bolt_names, answer.bolts.bolts, strict=True))
    found = np.array([by.of is None or by.of == name or by.of is bolt for name, bolt in known])
    if not found.any():
        raise InputError(f"{by!r}: there is no such bolt; there are {', '.join(answer.bolt_names)}.")
    return found


def _pulled(tangent: Tangent, borne: Array) -> tuple[Array, Array]:
    """Changes of stretch and force of bolts, from those of what all bodies bear, (n,)."""
    if (bolts := tangent.bolts) is None:
        return np.zeros(0), np.zeros(0)
    tension = np.asarray(bolts.slides @ borne)
    return np.where(bolts.given, -tension / bolts.k, 0.0), tension


def _borne(by: Parameter, tangent: Tangent, i: int) -> Array:
    """What a change of the stiffness of a body makes it bear, its bolts drawn together, (n_body,)."""
    answer = tangent.answer
    body, u = answer.system.bodies[i], answer.stretched(answer.system.bodies[i])
    if not hasattr(by.along, "tocsr"):
        borne, bolts = answer.stiffness[i] @ u, tangent.bolts
        if bolts:  # the stiffness of a step that gives their forces lets them slide
            span = answer.system.slice(body)
            P = bolts.P[:, span]
            borne = borne + P.T @ np.where(bolts.given, P @ u / bolts.k, 0.0)
        return np.asarray((1.0 if by.along is None else float(by.along)) * borne)
    K = by.along.tocsr()
    if K.shape != (body.n, body.n):
        raise InputError(f"{by!r}: along has shape {K.shape}; a body of {body.n} DOFs was named")
    return np.asarray(answer.system.scaled(body, K) @ u)


def _factor(by: Parameter, answer: Answer, i: int) -> Any:
    """Of the loads or displacements of a body in a step over those that a user gives."""
    scale, of_step = answer.system.scale(answer.system.bodies[i]), answer.case.scale
    own = (1.0 / scale, of_step[0]) if by.kind == "load" else (scale, of_step[1])
    return own[0] * (1.0 if own[1] is None else own[1])


def _field(by: Parameter, given: ArrayLike, count: int) -> Array:
    values = numbers(given, f"{by!r}: along", "give a number, or one for each point or DOF")
    if values.shape != (count,) and (values.shape or by.kind == "motion"):
        raise InputError(f"{by!r}: along has shape {values.shape}, not ({count},)")
    return np.broadcast_to(values, count).astype(float)
