r"""The certificate: how well an answer satisfies the equations, measured from the answer itself.

All numbers are dimensionless. Forces are divided by the largest force in the problem (load, contact
or reaction), lengths by the extent of the bodies. Where unloaded bodies move rigidly, or a step takes
all load back, all forces are round-off and nothing to divide by: the scale is then `GIVEN` of the
terms that cancel in ``K u``, or of the force that strains the softest body by one.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack
from scipy.sparse.csgraph import connected_components

from skfem_contact.answers.answer import Answer, contact_forces
from skfem_contact.arguments import NamesAttributes
from skfem_contact.arrays import Array, Index, cross
from skfem_contact.bodies.member import unit_motions
from skfem_contact.conditions.kinematics import without_columns
from skfem_contact.conditions.state import OPEN, SLIP, STICK
from skfem_contact.digits import COMPUTED, GIVEN, SOLVED
from skfem_contact.records import dataclass

# What is no round-off however well the equations are solved, and the line above it.
OF_THE_MODEL = ("moment_gap", "moment_normal", "placement")
MODELLED = "Of the model and the pairing (not round-off)"


@dataclass(frozen=True)
class Certificate(NamesAttributes):
    """Dimensionless residuals of an answer; round-off where everything holds, but for the last three.

    Those measure what the model leaves out, however well its equations are solved: the moments of
    forces that small sliding and the normals of facets put in another place, and the pairing.

    Attributes
    ----------
    equilibrium : float
        Largest entry of ``K u - f - B_n' lambda + B_t' tau`` on free DOFs, over the largest force.
    penetration : float
        Deepest overlap of any point, over the extent of the bodies.
    complementarity : float
        Largest ``lambda |g|``, over the largest force times the extent.
    tension : float
        Largest tensile force at a unilateral point, over the largest force.
    friction : float
        Largest violation of the friction law, over the largest contact force: a force beyond its
        bound, one below it at a point that slips, or one that is not along its slip.
    slip : float
        Largest difference of the slip that friction and glue have followed from that of the
        displacements, over the extent of the bodies.
    force_balance : float
        Resultant of all loads, reactions and obstacle forces, over the sum of their sizes.
    moment_balance : float
        The same for moments about the centre, less the two known terms below; in 3-D the largest
        about the three axes. NaN for axisymmetric and scalar problems, which have no moments, and with
        bodies of finite strain, whose forces act elsewhere than at first.
    moment_gap : float
        Moment of friction acting across initial gaps: small-sliding kinematics moves it along the
        normal. Over the sum of the forces times the extent.
    moment_normal : float
        Moment of normal forces whose normal is not that of the facet itself, scaled the same way.
    placement : float
        With ``sliding="finite"``: gaps of closed points on the pairing of the answer itself over the
        extent, or the change of the contact forces' distribution, whichever is larger.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> result = sc.ContactSolver(block, foot).solve()
    >>> certificate = result.certificate
    >>> certificate.penetration < 1e-12, certificate.worst < 1e-12
    (True, True)
    """

    equilibrium: float
    penetration: float
    complementarity: float
    tension: float
    friction: float
    slip: float
    force_balance: float
    moment_balance: float
    moment_gap: float
    moment_normal: float
    placement: float = 0.0

    @property
    def worst(self) -> float:
        """The largest of the numbers that have to be round-off."""
        names = "equilibrium penetration complementarity tension friction slip force_balance"
        # NaN anywhere is the worst; only moments may be missing
        moment = 0.0 if np.isnan(self.moment_balance) else self.moment_balance
        return float(np.max([moment, *(getattr(self, name) for name in names.split())]))

    def __str__(self) -> str:
        solved: list[str] = []
        modelled: list[str] = []
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            if not (name.startswith("moment") and np.isnan(value)):
                group = modelled if name in OF_THE_MODEL else solved
                group.append(f"  {name.replace('_', ' '):<16s} {value:9.1e}")
        return "\n".join([*solved, MODELLED, *modelled])


def certified(answer: Answer) -> Certificate:
    """The certificate of an answer, which a solver may have measured before a result is asked."""
    known = vars(answer)
    if "certificate" not in known:
        known["certificate"] = certify(answer)
    found: Certificate = known["certificate"]
    return found


def certify(result: Answer) -> Certificate:
    """Measure the certificate of a result; needs the displacements of all bodies."""
    kin, state, system = result.kin, result.local, result.system
    u, f = result.u, result.load
    contact = contact_forces(result)
    residual = result.internal - f - contact
    reactions = np.zeros(system.n)
    reactions[system.D] = residual[system.D]
    residual[system.D] = 0.0
    force = _largest(f, contact, reactions, state.normal_force, state.tangential_force)
    # a load is a scale however small: a body that ran away with it has not carried it
    floor = 0.0
    if not f.any():
        # of the sums ``K u``: their sizes, added up instead of cancelling
        pairs = zip(system.bodies, result.stiffness, strict=True)
        noise = _largest(*(abs(K) @ np.abs(u[system.slice(body)]) for body, K in pairs))
        floor = GIVEN * noise if force < COMPUTED * noise else 0.0
    if not (f.any() or result.case.x.any()):
        # what is left of earlier forces is no scale for itself: coordinates have rounding errors, and
        # a force that is smaller than what such a distance makes in the softest body is none
        stiffest = [float(K.diagonal().max()) for K in result.stiffness if K.nnz]
        strained = min(stiffest, default=0.0) * system.extent
        floor = max(floor, GIVEN * strained if force < np.finfo(float).eps * strained else 0.0)
    force = max(force, floor)
    length = system.extent
    gap = result.kin.B_n @ u + result.seen.gap0
    gap = np.where(kin.paired, gap, 0.0)
    bilateral = kin.bilateral
    overlap = np.where(bilateral, np.abs(gap), np.maximum(-gap, 0.0))
    total = max(float(np.abs(part).sum()) for part in (f, reactions, contact))
    total = max(total, floor)
    balance, moment, across, normal = _balance(result, f + reactions, total * length)
    # a contact that carries round-off of the others has no digits of its own
    violation = _friction_violation(result, max(floor, SOLVED * force))
    return Certificate(
        equilibrium=_ratio(np.max(np.abs(residual), initial=0.0), force),
        penetration=_ratio(np.max(overlap, initial=0.0), length),
        complementarity=_ratio(np.max(np.abs(state.normal_force * gap), initial=0.0), force * length),
        tension=_ratio(np.max(-state.normal_force[~bilateral], initial=0.0), force),
        friction=violation,
        slip=_ratio(_slip_error(result), length),
        force_balance=_ratio(balance, total),
        moment_balance=moment,
        moment_gap=across,
        moment_normal=normal,
        placement=result.mismatch,
    )


def _friction_violation(result: Answer, floor: float) -> float:
    """Largest distance of a friction force from what the law makes of it and of the slip.

    The law holds exactly if the force is the projection of ``force + r plastic_slip`` onto the bound,
    for any r > 0: within the bound, at the bound where it slips, and along the slip. The r that makes
    the largest slip the largest force gives both the same say. It is at most the stiffness of sticking:
    a spring turns what is wrong with a force into so much slip, which is not wrong once more.
    """
    state, worst = result.local, 0.0
    # slips below this part of the displacements they are differences of have no digits
    still = GIVEN * _largest(result.u)
    for _, part, _, law in result.frictional():
        compressive = np.maximum(state.normal_force[part], 0.0)
        counted, area = (state.slip - state.reference)[part], result.kin.area[part]
        closed = state.status[part] != OPEN
        force = state.tangential_force[part]
        plastic = np.where(closed[:, None], result.plastic_slip[part], 0.0)
        scale = max(_largest(state.normal_force[part], force), floor)
        furthest = max(_largest(plastic), still)
        # a slip so small that no number stretches it to a force is none
        r = scale / furthest if furthest > scale * float(np.finfo(float).tiny) else 0.0
        springs = np.minimum(result.tangential_stiffness[part], r)[:, None]
        lawful, _ = law.force(force + springs * plastic, compressive, area, counted)
        away = np.linalg.norm(force - np.where(closed[:, None], lawful, 0.0), axis=1)
        # np.maximum keeps NaN, which Python's max drops
        worst = np.maximum(worst, _ratio(np.max(away, initial=0.0), scale))
    return float(worst)


def _slip_error(result: Answer) -> float:
    """Largest distance of slips from those of the displacements, where friction or glue holds [length].

    Slips that nothing resists are in no equation.
    """
    kin, state = result.kin, result.local
    moved = (kin.B_t @ result.u).reshape(kin.m, kin.tangents) + result.seen.slip0
    held = np.any(state.tangential_force != 0, axis=1)
    for contact, part in zip(result.contacts, result.slices(), strict=True):
        held[part] |= contact.tied & kin.paired[part]
    return _largest(np.linalg.norm(moved - state.slip, axis=1)[held])


def _balance(result: Answer, external: Array, scale: float) -> tuple[float, float, float, float]:
    """Resultant and moment of loads, reactions and obstacle forces over all bodies."""
    system, kin = result.system, result.kin
    component = np.concatenate([b.dof_component for b in system.bodies])
    points = np.concatenate([b.dof_points for b in system.bodies])
    d = points.shape[1]
    along = np.einsum("ik,ikd->id", -result.local.tangential_force, kin.axes)
    pressing = result.local.normal_force[:, None] * kin.normal
    fixed = np.zeros((kin.m, 1), dtype=bool)
    for contact, part in zip(result.contacts, result.slices(), strict=True):
        fixed[part] = contact.rigid and contact.rigid_body is None
    # without the contact forces between bodies, which have to balance by themselves; with them the
    # sum would be that of K u, zero whatever the contact does
    on_obstacles = np.where(fixed, pressing + along, 0.0)
    axes = sorted(set(component[component < system.bodies[0].components]))
    F = np.array([external[component == k].sum() for k in axes])
    F -= _by_springs(result, [(component == k).astype(float) for k in axes])
    skip = {0} if any(b.axisymmetric for b in system.solids.values()) else set()
    kept = [k for k in axes if k not in skip]
    F += np.array([on_obstacles[:, k].sum() for k in axes])
    resultant = float(np.max(np.abs(F[kept]), initial=0.0))
    if len(axes) < d or skip or any(body.finite_strain for body in system.bodies):
        return resultant, np.nan, np.nan, np.nan  # and moments about where bodies were mean nothing
    centre = points.mean(axis=0)
    turns = _turns(points, centre, component, system.extent)
    M = turns @ external - _by_springs(result, turns)
    # of the pairing's weights, not of the rows that the answer fulfils: the two are compared
    M += cross(kin.offset - centre, on_obstacles).sum(axis=0)
    offset = np.where(fixed, 0.0, kin.offset)
    across, normal = cross(offset, along).sum(axis=0), cross(offset, pressing).sum(axis=0)
    return (
        resultant,
        _ratio(_largest(M + across + normal), scale),
        _ratio(_largest(across), scale),
        _ratio(_largest(normal), scale),
    )


def _turns(points: Array, centre: Array, component: NDArray[np.int32], extent: float) -> Array:
    """Unit turns about each axis, in 2-D the one, at DOFs (n, d): rows (1 or 3, n)."""
    d = points.shape[1]
    turns = unit_motions(points, centre, 1.0)[
        np.arange(len(points)), np.minimum(component, d - 1), d:
    ].T
    for i, turn in enumerate(turns):  # of rigid bodies: here lengths, and their moments are forces
        turn[component >= d] = 0.0
        turn[component == d + i] = extent
    return turns


def _by_springs(result: Answer, modes: Any) -> Array:
    """What springs to the ground inside K take of resultants along rigid motions: ``(K mode)'u``, (k,).

    Zero without any; motions are (k, n).
    """
    total = np.zeros(len(modes))
    for body, K in zip(result.system.bodies, result.stiffness, strict=True):
        if body.nonlinear:  # a tangent under stress resists turns without any spring
            continue
        part, diagonal = result.system.slice(body), np.abs(K.diagonal())
        for i, mode in enumerate(modes):
            resisted, size = K.T @ mode[part], np.abs(mode[part])
            most = float(np.max(np.abs(resisted)))
            # round-off is compared with the terms of K mode; one of them is that of the diagonal, and
            # known at once
            if most > COMPUTED * float(np.max(diagonal * size)) and (
                most > COMPUTED * float(np.max(abs(K) @ size))
            ):
                total[i] += float(resisted @ result.u[part])
    return total


def _largest(*arrays: Array) -> float:
    return float(np.max([np.max(np.abs(a), initial=0.0) for a in arrays], initial=0.0))


def _ratio(value: float, scale: float) -> float:
    return (float(value) if scale == 0 else float(value / scale)) + 0.0  # no negative zeros


# -- forces that the equations leave open ----------------------------------------------------------


def undetermined(answer: Answer) -> tuple[str, ...]:
    """A sentence per group of contacts whose forces are not unique; see `ContactResult.undetermined`.

    Forces of contacts may be undetermined where displacements are not, as conditions of points that
    press depend on each other. Forces v with ``B'v = 0`` can then be added to those of an answer,
    as long as all points still press and no friction exceeds its bound: displacements stay what
    they are. So it is between contacts that share an edge, with friction or walls at an acute
    angle, where a tool that supports hold is finer than what it presses, and where supports and
    friction hold the same node.

    Points that hardly press count for nothing: what is left of them decides on no force.
    """
    if not answer.springs:
        return ()
    from skfem_contact.elimination.constraint import eliminate

    rows, points = _rows(answer)
    redundant = eliminate(rows, np.zeros(len(points))).redundant
    _, group = connected_components(abs(rows) @ abs(rows).T, directed=False)
    of_point = np.repeat(np.arange(len(answer.names)), [p.stop - p.start for p in answer.slices()])
    found: dict[tuple[int, ...], list[int]] = {}
    for g in np.unique(group[redundant]):
        contacts = tuple(np.unique(of_point[points[group == g]]).tolist())
        counts = found.setdefault(contacts, [0, 0])
        counts[0] += np.count_nonzero(group == g)
        counts[1] += np.count_nonzero(group[redundant] == g)
    return tuple(_words(answer, *item) for item in found.items())


def _words(answer: Answer, contacts: tuple[int, ...], counts: list[int]) -> str:
    *first, last = [f"'{answer.names[i]}'" for i in contacts]
    names = f"{', '.join(first)} and {last}" if first else last
    total, more = counts
    return (
        f"The contact forces of {names} are not unique: of {total} conditions at points that press "
        f"{more} follow from the others. Displacements are the same for all forces that fulfil them; "
        "these are chosen by the least squares of friction and of pressure over the surfaces, whatever "
        "the order of contacts and nodes."
    )


def _rows(answer: Answer) -> tuple[csr_matrix, Index]:
    """Return what the forces of points act along, over the free DOFs, and which point each is of.

    A point that slips has one row, as its friction follows the normal force.
    """
    system, state, conditions = answer.system, answer.state, answer.conditions
    free = np.setdiff1d(np.arange(system.n), system.D)
    kin = without_columns(answer.kin, free)
    m, t = kin.m, kin.tangents
    largest = np.max(np.abs(state.normal_force), initial=0.0)
    presses = kin.paired & (kin.bilateral | (state.normal_force > SOLVED * largest))
    presses &= state.status != 0
    rows, points = [kin.B_n], [np.arange(m)]
    if t:
        slips = np.where((state.status == SLIP)[:, None], conditions.coupling, 0.0)
        at = np.arange(m * t)
        spread = csr_matrix((slips.ravel(), (at // t, at)), shape=(m, m * t))
        rows[0] = csr_matrix(kin.B_n - spread @ kin.B_t)
        sticks = np.repeat(presses & (state.status == STICK) & conditions.stick, t)
        rows.append(kin.B_t[sticks])
        points.append(at[sticks] // t)
    rows[0], points[0] = rows[0][presses], points[0][presses]
    all_rows, all_points = csr_matrix(vstack(rows)), np.concatenate(points)
    moves = np.diff(all_rows.indptr) > 0  # the others are data: supports make them
    return csr_matrix(all_rows[moves]), all_points[moves]
