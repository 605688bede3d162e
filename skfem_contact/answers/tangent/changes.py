r"""What an answer may be differentiated by, and how a load step changes with it.

Whatever a parameter is, a step sees a few changes of it: of the loads and prescribed displacements, of
gaps and slips, of the friction of points that slip, at the state that it has, and of bolts. The
stiffness is a load, ``-dK u``. So is all that makes another scene, such as the place of nodes
(semi-analytic): what two scenes, a little to either side, make of the same displacements and contact
forces, without solving either.
"""

from __future__ import annotations

from dataclasses import KW_ONLY
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, diags, issparse

from skfem_contact.answers.answer import Answer, fluid_beyond, point_forces
from skfem_contact.answers.tangent.rates import Maps, take
from skfem_contact.answers.tangent.tangent import Tangent, Values
from skfem_contact.arguments import numbers, shown, with_known_keywords
from skfem_contact.arrays import Array
from skfem_contact.bodies.member import Member
from skfem_contact.conditions.contact import Contact, number_of
from skfem_contact.conditions.friction import Coulomb, Tresca
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.state import transport
from skfem_contact.errors import InputError
from skfem_contact.records import copied, dataclass

#: What changes loads of bodies, so that derivatives by these are needed inside; then what does not.
LOADS = "stiffness", "load", "displacement", "scene"
BOLTS = "bolt_force", "bolt_stretch"
#: Bodies with their DOFs, contacts with their points, or bolts.
Places = list[tuple[int, Any]]
#: The name of the values of a parameter at each point or DOF.
FIELD = "field"
KINDS = "friction", *LOADS, "interference", "gap", "motion", *BOLTS


@with_known_keywords()
@dataclass(eq=False, repr=False)
class Parameter:
    r"""A parameter by which answers are differentiated: one number, or a field of them.

    Parameters
    ----------
    kind : str
        "friction"
            The coefficient of `Coulomb`, the bound ``tau_max`` of `Tresca`, of contacts `of`.
        "stiffness"
            A factor on the stiffness of bodies `of`, 1 where it is as it is: Young's modulus over
            what it is, with the load ``steel.warmed(T)`` that grows with it. With `along`, a matrix
            dK/dp of one body.
        "load"
            ``f + p along`` of bodies `of`; a factor on f if `along` is not given. Thermal strains are a
            load too. A number that a step gives, for all or the body, multiplies `along` as it does f.
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

    kind: str
    of: Member | Contact | str | None = None
    _: KW_ONLY
    along: Any = None
    field: bool = False
    each_step: bool = False
    between: tuple[Any, Any, float] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"a parameter is {shown(self.kind)}; it may be one of {', '.join(KINDS)}")
        if (self.kind == "scene") != (self.between is not None):
            raise InputError("between=(solver, solver, width) belongs to 'scene', and is needed there")
        if self.field and (self.along is not None or self.kind in ("stiffness", "scene", *BOLTS)):
            words = f"Parameter({self.kind!r}, field=True): a field has a value for every point, and no"
            raise InputError(f"{words} `along`; a stiffness, scene or bolt has none: give one by one.")
        if self.kind == "motion" and self.along is None and not self.field:
            raise InputError("Parameter('motion'): give the direction, along=(1.0, 0.0)")

    def __repr__(self) -> str:
        said = {name: getattr(self, name) for name in ("of", "along", "field", "each_step")}
        words = [f"{name}={v!r}" for name, v in said.items() if v is not None and v is not False]
        return f"Parameter({', '.join([repr(self.kind), *words])})"


def parameters(by: Any, many: bool) -> tuple[Parameter, ...]:
    """What `by` names, by parameters or their kinds alone; one number each, if not `many`."""
    given = [by] if isinstance(by, str | Parameter) else list(by)
    found = tuple(p if isinstance(p, Parameter) else Parameter(p) for p in given)
    if not found:
        raise InputError("by is empty: name what to differentiate by, by=['friction']")
    for p in found:
        if not many and (p.field or p.each_step):
            raise InputError(f"{p!r} is many numbers, for gradient; give a direction, along=..., here")
    return found


def change(by: Parameter, tangent: Tangent) -> Values:
    """What a number changes of the load step of an answer, at the state that it has, by name.

    Loads f and x (n,); gap0 (m, 1) and slip0 (m, d-1); of the friction force that the return map makes
    of the same trial force, `mapped` (m, d-1), and of its bound under the same normal force (m, 1); of
    what bodies bear at the same displacements, `borne` (n,); of the stretch of bolts there, `drive`,
    and of their tension at the same stretch too (b,); of area (m, 1), normal (m, d) and axes.
    """
    if by.kind == "scene":
        return _between(by, tangent)
    answer, places = tangent.answer, _places(by, tangent.answer)
    if by.kind in BOLTS and tangent.bolts is None:
        return {}
    (m, d), b = answer.kin.normal.shape, len(answer.bolt_names)
    of_dofs, of_bolts = dict.fromkeys(LOADS, (answer.system.n,)), dict.fromkeys(BOLTS, (b,))
    p = np.zeros((of_dofs | of_bolts | {"motion": (m, d)}).get(by.kind, (m, 1)))
    for _, at in places:
        p[at] = _field(by, p[at])
    return take(_maps(by, tangent, places), {FIELD: p})


def contracted(by: Parameter, tangent: Tangent, duals: Values) -> Any:
    """Derivative of a number by a parameter in one step: a number, or the array of a field.

    From its derivatives by all changes of the step: `change` transposed.
    """
    if not by.field:
        found = change(by, tangent)
        return sum(float(np.vdot(own, duals[name])) for name, own in found.items() if name in duals)
    places = _places(by, tangent.answer)
    if len(places) != 1:
        raise InputError(f"{by!r}: a field is of one body or contact; name it, of=...")
    own = take(_maps(by, tangent, places), dict(duals), back=True)[FIELD][places[0][1]]
    return own.sum(axis=0) if by.kind == "motion" else own.ravel()


def _maps(by: Parameter, tangent: Tangent, places: Places) -> Maps:
    """What the values of a parameter at each point or DOF change, which are zero at other places."""
    answer, bolts, kind = tangent.answer, tangent.bolts, by.kind
    case, system, kin = answer.case, answer.system, answer.kin
    if kind in BOLTS:
        shift = 1.0 * ~(tangent.tightened | tangent.locked)
        return [("drive", FIELD, -tangent.by_pull if kind == "bolt_force" else shift)]
    if kind == "stiffness":
        borne, along = np.zeros(system.n), by.along
        for i, at in places:
            body, u = system.bodies[i], answer.stretched(system.bodies[i])
            if not issparse(along):
                borne[at] = _borne(body, answer.stiffness[i], u)
                if not body.finite_strain and i in case.apart:
                    borne[at] -= case.apart[i][: body.n]
                if bolts:  # the stiffness of a step that gives their forces lets them slide
                    P = bolts.pulls[:, at]
                    borne[at] -= P.T @ (tangent.by_pull * (P @ u))
            elif along.shape == (body.n, body.n):
                borne[at] = system.scaled(body, along) @ u
            else:
                raise InputError(f"{by!r}: along has shape {along.shape}; the body has {body.n} DOFs")
        return [("borne", FIELD, borne)]
    if kind in LOADS:
        load = kind == "load"
        # of a body in a step over those that a user gives; or of all, with what fluids have by now
        each = (system.units if not load else 1.0 / system.units) * np.ones(system.n)
        for i, at in places:
            each[at] *= case.multiple(i, not load)
        if by.field or by.along is not None:
            return [("f" if load else "x", FIELD, each)]
        if not load:
            return [("x", FIELD, case.x)]
        maps: Maps = [("f", FIELD, case.applied + (answer.load - case.f))]
        if bolts is not None:
            maps.append(("tension", FIELD, -bolts.slides.multiply(bolts.thermal(case))))
        return maps
    if kind == "friction":
        on = np.zeros((kin.m, 1))
        for i, at in places:
            on[at, 0] = _by_coefficient(tangent, i, at)
        return [("bound", FIELD, on), ("mapped", FIELD, (tangent.direction * on)[:, :, None])]
    if kind == "motion":
        way = -1.0 * kin.paired[:, None, None]
        return [("gap0", FIELD, way * kin.normal[:, None]), ("slip0", FIELD, way * kin.axes)]
    paired = kin.paired.astype(float)
    rows = paired[:, None] if kin.gap_weights is None else diags(paired) @ kin.gap_weights
    return [("given", FIELD, 1.0 if kind == "gap" else -1.0), ("gap0", "given", rows)]


def _by_coefficient(tangent: Tangent, i: int, part: slice) -> Array:
    """Derivative of the bounds of a contact by the coefficient of its law, (m_c,)."""
    answer, closed = tangent.answer, tangent.closed[part]
    law, area = answer.contacts[i].friction, answer.local.area[part]
    force = np.maximum(answer.local.normal_force[part], 0.0)
    if type(law) is Tresca:
        return closed * area
    if type(law) is not Coulomb:
        own = f"the law {type(law).__name__}, which has no single coefficient" if law else "no friction"
        words = "Use Parameter('scene', between=(...)), two solvers whose laws differ."
        raise InputError(f"contact {answer.names[i]!r} has {own}. {words if law else ''}")
    free = law.mu * force + law.cohesion * area < law.tau_max * np.maximum(area, 0.0)
    return (free | np.isinf(law.tau_max)) * closed * force


def _between(by: Parameter, tangent: Tangent) -> Values:
    """Changes between two scenes, at the displacements and forces of the answer."""
    assert by.between is not None
    *ends, width = by.between
    answer = tangent.answer
    if len({(s.system.n, s.kin.m, s.kin.paired.tobytes()) for s in (*ends, answer)}) != 1:
        words = f"{by!r}: the two scenes and the solver differ in their DOFs, points or partners"
        raise InputError(f"{words}; nodes may move, and must stay the same. Take a smaller width.")
    axes = [s.kin.axes.round(12).tobytes() for s in (*ends, answer)]
    if answer.kin.scaled is not None and len(set(axes)) != 1:
        words = f"{by!r}: axes of OrthotropicCoulomb differ between the scenes. Leave the surface"
        raise InputError(f"{words} where it is, and change both coefficients by one factor.")
    less, more = (_in_scene(solver, tangent) for solver in ends)
    return {name: (more[name] - less[name]) / width for name in less}


def _in_scene(solver: Any, tangent: Tangent) -> Values:
    """What a scene makes of the displacements and forces of an answer, with loads and geometry."""
    answer, local, u = tangent.answer, tangent.local, tangent.answer.u
    kin, reader = solver.kin, solver._reader
    # an interference that no step gives is the scene's own
    own = np.repeat(answer.case.own, [len(values) for values in reader._own])
    given = np.where(own, np.concatenate(reader._own), answer.case.interference)
    case = reader.resumed(copied(answer.case, interference=given), answer.case.x)
    bodies = zip(answer.system.bodies, solver.system.bodies, solver.linear_model.stiffness, strict=True)
    borne = [_borne(there, K, answer.stretched(body)) for body, there, K in bodies]
    # tangents in space are a choice, which jumps: those of the answer are turned to these normals
    turned = transport(answer.kin.axes.swapaxes(0, 1), answer.kin.normal, kin.normal)
    own = np.einsum("kid,ild->ikl", turned, kin.axes)
    if kin.scaled is not None:  # and stay, see above
        own = np.broadcast_to(np.eye(kin.tangents), own.shape)
    friction = np.einsum("ikl,ik->il", own, local.tangential_force)
    f = case.f + point_forces(kin, copied(local, tangential_force=friction))
    for i, body in enumerate(solver.system.bodies):
        if body.finite_strain and i in case.apart:
            part = solver.system.slice(body)
            f[part] += fluid_beyond(body, case.apart[i], u[part])[0]
    gap0 = np.where(kin.paired, case.gap0 + kin.B_n @ u, 0.0)
    slips = case.slip0 + (kin.B_t @ u).reshape(local.slip.shape)
    rule = FrictionRule(solver.interface.laws, kin.area, local.reference)
    trial = np.where(tangent.slips[:, None], tangent.slopes.trial, 0.0)
    bound = np.where(tangent.closed, rule.bound(local.normal_force, local.slip), 0.0)
    out = {"f": f, "x": case.x, "borne": np.concatenate(borne), "gap0": gap0[:, None]}
    out |= {"slip0": np.einsum("ikl,il->ik", own, slips), "bound": bound[:, None]}
    out |= {"mapped": rule.project(trial, local.normal_force, local.slip)[0], "area": kin.area[:, None]}
    axes = np.einsum("ikl,ild->ikd", own, kin.axes).reshape(kin.m, -1)
    return out | {"normal": kin.normal, "axes": axes}


# -- what bodies bear ---------------------------------------------------------------------------


def _borne(body: Member, K: csr_matrix, u: Array) -> Array:
    """Internal forces of a body, (n_body,)."""
    return np.asarray(body.linearize(u)[1] if body.nonlinear else K @ u)


# -- whose ----------------------------------------------------------------------------------------


def _places(by: Parameter, answer: Answer) -> Places:
    """Bodies of a parameter with their DOFs, contacts with their points, or bolts with their number."""
    if by.kind in LOADS:
        system = answer.system
        if isinstance(by.of, Contact):
            raise InputError(f"{by!r}: of is a contact; name a body")
        bodies = system.bodies if by.of is None else [system.bodies[system.index(by.of)]]
        return [(system.bodies.index(body), system.slice(body)) for body in bodies]
    bolts, motion, contacts, of = answer.bolts, by.kind == "motion", answer.contacts, by.of
    places: Places = [*enumerate(answer.model.interface.point_slices)]
    if by.kind in BOLTS:
        what, names = "bolt", [*answer.bolt_names]
        meant = [of in (None, *own) for own in zip(names, bolts.bolts if bolts else (), strict=True)]
        places = [(0, [i]) for i in range(len(names))]
    else:
        number, tools = number_of(of, contacts), [c.primary.name if c.rigid else None for c in contacts]
        able = [bool(c.rigid if motion else c.friction or by.kind != "friction") for c in contacts]
        known = zip(answer.names, tools, strict=True)
        named = [of in own[: 1 + motion] or i == number for i, own in enumerate(known)]
        both = zip(named, able, strict=True)
        meant = able if of is None else [a and (b or not motion) for a, b in both]
        what = "obstacle" if motion else "contact with friction" if by.kind == "friction" else "contact"
        names = [str(own) for own in np.array(tools if motion else answer.names)[able]]
    if not any(meant):
        there = ", ".join(map(repr, names)) or "none"
        raise InputError(f"{by!r}: there is no such {what}; there are {there}.")
    return [place for place, own in zip(places, meant, strict=True) if own]


def _field(by: Parameter, there: Array) -> Array | float:
    """The values of `along` in the shape that they have there; one, where it is none or a matrix."""
    if by.along is None or (by.kind == "stiffness" and issparse(by.along)):
        return 1.0
    wanted = {"motion": there.shape[1:], "stiffness": ()}.get(by.kind, there.shape[:1])
    usage = "translation, (1.0, 0.0)" if by.kind == "motion" else "number, or one for each point or DOF"
    values = numbers(by.along, f"{by!r}: along", f"give a {usage}")
    if values.shape != wanted and (values.shape or by.kind == "motion"):
        raise InputError(f"{by!r}: along has shape {values.shape}, not {wanted}")
    return values.reshape(-1, *there.shape[1:])
