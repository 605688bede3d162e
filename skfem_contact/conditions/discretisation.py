r"""Each contact paired by its discretisation: node by node, dual mortar, or a rigid obstacle.

**Frames of small sliding**: the normal of the loaded interface, the same whichever side is secondary.

With small sliding a frame is made once and has to be that of the interface under load. Two bodies
whose boundaries have the slopes ``s_a``, ``s_b`` are deformed by one and the same pressure, so that
their slopes change by ``-c_a h`` and ``c_b h`` with a function h of the pressure and the compliances
``c = 1 / E*`` of two half-planes. Closed, both have the slope

    s = (c_b s_a + c_a s_b) / (c_a + c_b) :

the stiffer side keeps its shape. Equal bodies meet in the mean of both normals, a rigid one shows its
own. So friction, which acts along the interface, is as well resolved as with `sliding="finite"`,
where the frames are those of the deformed surfaces.

The compliance at a node is measured on K itself, see `plane_moduli`. What it leaves out is of second
order in the answer: a weight that is wrong by a tenth turns the frame by a twentieth of the tilt.

What supports hold along the interface is a tangent of its own (rules 3 and 4 of `pairing.dual`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.arguments import shown
from skfem_contact.arrays import Array, Index, Mask, angle_between, dot, entries, sizes, tangents, unit
from skfem_contact.bodies.facet_kinds import area_integrals
from skfem_contact.bodies.selection import written
from skfem_contact.bodies.surface import ContactSurface, NoBody
from skfem_contact.conditions.contact import Contact
from skfem_contact.digits import DECIMALS, GIVEN, SOLVED
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import MotionLike, Obstacle
from skfem_contact.pairing.corners import Names, corner_contacts
from skfem_contact.pairing.dual import can_move, held_rows
from skfem_contact.pairing.mortar import dual_mortar
from skfem_contact.pairing.node import (
    Pairing,
    at_control_points,
    gap_vectors,
    node_to_segment,
    poor_nodes,
)
from skfem_contact.pairing.projection import rim_points
from skfem_contact.pairing.search import FACING
from skfem_contact.trees import Tree


def pair(
    contact: Contact,
    *,
    moved: Sequence[Array] = (),
    motion: MotionLike | None = None,
    known: Names = frozenset(),
) -> Pairing:
    """Find the partner of every point of the secondary surface.

    Parameters
    ----------
    contact : Contact
    moved : pair of ndarray, optional
        Displacements of the secondary and the primary body, for the deformed geometry [length].
    motion : optional
        Motion of a rigid obstacle: translation (d,), or (translation, angle, centre).
    known : frozenset
        Vertices that carried in a round before, `Pairing.corners`.
    """
    secondary, primary = contact.secondary, contact.primary
    if len(moved):
        secondary = secondary.moved(moved[0])
    partner: ContactSurface | None
    if isinstance(primary, Obstacle):
        placed = primary if motion is None else primary.moved(motion)
        partner = placed.outline
    else:
        partner = primary.moved(moved[1]) if len(moved) else primary
    if partner is None:
        pairing = _near(contact, placed.pair(secondary))
        away = np.where(pairing.paired, pairing.gap, 0.0)[:, None] * pairing.normal
        pairing = _with_signs(contact, secondary, pairing, away)
    elif partner.dim != secondary.dim:
        raise _unlike(contact, partner.dim)
    else:
        pairing = _pair_surfaces(contact, secondary, partner, known)
        if contact.sliding == "small" and not contact.tied and not len(moved):
            pairing = loaded_frames(secondary, partner, pairing)
        pairing = _without_nodes(pairing) if contact.rigid else pairing
    if secondary.dim == 2:  # there is one tangent only
        return pairing
    tangent = along_supports(pairing.tangent, pairing.normal, secondary.held)
    pairing = replace(pairing, tangent=tangent)
    if partner is None:
        return pairing
    pairing = held_tangents(secondary, partner, pairing)
    return guided_tangents(secondary, partner, pairing) if contact.tied else pairing


def _unlike(contact: Contact, d: int) -> InputError:
    """The error for a plane body and a solid: the primary is of d dimensions."""
    kind = "surface " if not contact.rigid else ""
    return InputError(
        f"contact {contact.label}: surface {contact.secondary.label!r} is {contact.secondary.dim}-D, "
        f"{kind}{contact.primary.label!r} {d}-D"
    )


def _pair_surfaces(
    contact: Contact, secondary: ContactSurface, primary: ContactSurface, known: Names
) -> Pairing:
    """Pair surfaces of two bodies, or one and the edges or triangles of an obstacle node by node."""
    if callable(contact.method) and not contact.rigid:
        pairing = contact.method(secondary, primary, reach=contact.reach)
        return _without_idle(contact, _checked(contact, secondary, primary, pairing))
    mortar = contact.method == "mortar" and not contact.rigid
    extended = contact.sliding == "finite"
    if secondary.dim == 3:
        if mortar:
            return dual_mortar(secondary, primary, reach=contact.reach)
        pairing = node_to_segment(secondary, primary, reach=contact.reach, extended=extended)
        away = gap_vectors(secondary, primary, pairing.secondary_weights, pairing.primary_weights)
        return _with_signs(contact, secondary, pairing, away)
    corners, reach = None, contact.reach
    if not contact.bilateral:
        # with small sliding only what corners overlap now
        small = contact.sliding == "small"
        corners = corner_contacts(secondary, primary, reach=reach, only_overlaps=small, known=known)
    if mortar:
        pressed = None if corners is None else corners.pressed
        pairing = dual_mortar(secondary, primary, reach=reach, pressed=pressed)
        pairing = held_tangents(secondary, primary, pairing)
    else:
        pairing = node_to_segment(secondary, primary, reach=reach, extended=extended)
    pairing = pairing if corners is None else corners.rows(pairing, every=mortar)
    return pairing if mortar else _without_idle(contact, pairing)


def _checked(
    contact: Contact, secondary: ContactSurface, primary: ContactSurface, pairing: Any
) -> Pairing:
    """Refuse what a discretisation of the user's returns if forces would not be in balance by it."""
    whose = f"Contact {contact.label}: method={contact.method_name}"
    if not isinstance(pairing, Pairing):
        raise InputError(f"{whose} returns {shown(pairing)}, not a skfem_contact.pairing.node.Pairing")
    m, d = secondary.points.shape
    shapes = {
        "points": (m, d),
        "normal": (m, d),
        "tangent": (m, d - 1, d),
        "gap": (m,),
        "area": (m,),
        "secondary_weights": (m, m),
        "primary_weights": (m, len(primary.points)),
        "paired": (m,),
        "miss": (m,),
        "facet": (m,),
    }
    for name, shape in shapes.items():
        value = getattr(pairing, name)
        if np.shape(value) != shape:
            raise InputError(f"{whose} returns {name} of shape {np.shape(value)}; it has to be {shape}")
    at = np.asarray(pairing.paired, dtype=bool)
    sums = [csr_matrix(w)[at].sum(axis=1) for w in (pairing.secondary_weights, pairing.primary_weights)]
    rules = {
        "weights of both sides that add up to one in each row": [np.ravel(s) - 1 for s in sums],
        "normals of length one": [np.linalg.norm(pairing.normal[at], axis=1) - 1],
        "finite gaps where points are paired": [0.0 * pairing.gap[at]],
    }
    for rule, errors in rules.items():
        wrong = ~np.all([np.abs(error) <= SOLVED for error in errors], axis=0)
        if wrong.any():
            i = int(np.flatnonzero(at)[np.argmax(wrong)])
            raise InputError(
                f"{whose} has to return {rule}; point {i} at {written(pairing.points[i])} has not"
            )
    return pairing


def _with_signs(contact: Contact, secondary: ContactSurface, pairing: Pairing, away: Array) -> Pairing:
    """The pairing of nodes with rows whose forces are as pressures are; glued, nodes will do."""
    if contact.tied:
        return pairing
    return _without_idle(contact, at_control_points(secondary, pairing, away))


def _near(contact: Contact, pairing: Pairing) -> Pairing:
    """The pairing less points whose partner is out of reach."""
    if contact.reach is None:
        return pairing
    far = ~(np.abs(pairing.gap) <= contact.reach)
    return replace(_without(pairing, far), miss=np.where(far, np.inf, pairing.miss))


def _without_nodes(pairing: Pairing) -> Pairing:
    """The pairing with edges of a rigid obstacle, which has no nodes that move."""
    m = len(pairing.gap)
    return replace(
        pairing,
        primary_weights=csr_matrix((m, 0)),
        facet=np.full(m, -1),
        secondary_normal=None,
        primary_normal=None,
    )


def _without_idle(contact: Contact, pairing: Pairing) -> Pairing:
    """The pairing less points whose force has nothing to do with the pressure.

    The end of a quadratic facet on the axis of symmetry has next to no area: its force vanishes with
    any constant pressure, and the sign of what is left is not that of the pressure. Glued, it may stay.
    """
    idle = _idle_points(contact.secondary)
    if contact.tied or not (idle & pairing.paired).any():
        return pairing
    return _without(pairing, idle)


def _without(pairing: Pairing, left_out: Mask) -> Pairing:
    """The pairing less some points."""
    gap = np.where(left_out, np.inf, pairing.gap)
    return replace(pairing, paired=pairing.paired & ~left_out, gap=gap)


def _idle_points(surface: ContactSurface) -> Mask:
    """Points whose function has next to no integral on any facet, shape (m,)."""
    idle = np.ones(len(surface.points), dtype=bool)
    idle[surface.facets[~poor_nodes(surface)]] = False
    return idle


def carriers(surface: ContactSurface, pairing: Pairing) -> Index:
    """The point whose pressure holds at each point, shape (m,).

    It is the point itself, except that a node merged by `dual_mortar` takes that of its heir, and
    one without area that of the middle of its facet. Of several heirs it is the one with the largest
    weight, of equal ones the one with the smaller gap: numbers of nodes have no say in it.
    """
    heir: Index = np.arange(len(pairing.gap))
    if surface.dim == 2 and surface.quadratic:
        at, middle = surface.facets, heir.copy()
        middle[at[:, :2]] = at[:, 2:]
        lonely = _idle_points(surface) & ~pairing.paired
        heir = np.where(lonely, middle, heir)
    row, col, weight = entries(pairing.secondary_weights)
    lent = ~pairing.paired[col] & (row != col)
    row, col, weight = row[lent], col[lent], weight[lent]
    order = np.lexsort((-pairing.gap[row], np.round(weight, DECIMALS)))
    # of those written to one place the last stays, with the largest weight
    heir[col[order]] = row[order]
    return heir


def loaded_frames(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing in the frames of the loaded interface, its gaps measured along the new normals.

    Parameters
    ----------
    secondary, primary : ContactSurface
    pairing : Pairing
        With the normals of both sides.

    Returns
    -------
    Pairing
        The very same where the two sides have one normal, or a row has no direction.
    """
    of_secondary, of_primary = pairing.secondary_normal, pairing.primary_normal
    if of_secondary is None or of_primary is None or secondary.dofs.shape[1] != secondary.dim:
        return pairing
    apart = [angle_between(pairing.normal, side) for side in (of_secondary, of_primary)]
    turns = pairing.paired & (np.maximum(*apart) > GIVEN)
    if secondary.dim == 2:
        # not on a line of symmetry, in which the node's own normal lies exactly
        across = np.abs(np.sum(secondary.normals * secondary.held, axis=1))
        turns &= (secondary.held.sum(axis=1) != 1) | (across > GIVEN)
    if not turns.any():
        return pairing
    soft_s = _mean(pairing.secondary_weights, compliances(secondary))
    soft_p = _mean(pairing.primary_weights, compliances(primary))
    both = soft_s + soft_p
    share = np.divide(soft_p, both, out=np.full_like(both, 0.5), where=both > 0)[:, None]
    mean = share * of_secondary + (1 - share) * of_primary
    if secondary.dim == 3:  # what stands across a plane of symmetry stays there
        mean = np.where(secondary.held & (np.abs(of_secondary) <= GIVEN), 0.0, mean)
    mean = unit(mean)
    normal = np.where(turns[:, None], mean, pairing.normal)
    weights = pairing.secondary_weights, pairing.primary_weights, pairing.primary_bulge
    away = gap_vectors(secondary, primary, *weights)
    measured = dot(normal, away)
    if pairing.smooth is not None:
        known = np.where(pairing.paired, pairing.gap, 0.0)
        # a distance between smooth boundaries, and not a part of the vector between facets
        measured = np.where(pairing.smooth > 0, known * dot(normal, pairing.normal), measured)
    measured = np.where(pairing.gap == 0.0, 0.0, measured)  # closed ones stay closed
    if pairing.least_gap is not None:
        measured = np.maximum(measured, np.minimum(pairing.least_gap, pairing.gap))
    gap = np.where(turns, measured, pairing.gap)
    return replace(pairing, normal=normal, tangent=tangents(normal), gap=gap)


def _mean(weights: csr_matrix, values: Array) -> Array:
    """Means of nodal values over the rows of a pairing; zero where a row is empty."""
    row, column, part = entries(weights)
    size, m = np.abs(part), weights.shape[0]
    total, sums = np.bincount(row, size, m), np.bincount(row, size * values[column], m)
    return np.divide(sums, total, out=np.zeros(m), where=total > 0)


# Of the undeformed surfaces that are still in use: the stiffness of a body does not change.
_COMPLIANCES: WeakKeyDictionary[ContactSurface, Array] = WeakKeyDictionary()


def compliances(surface: ContactSurface) -> Array:
    """One over `plane_moduli`, and zero at nodes that are prescribed altogether or rigid, (m,)."""
    if isinstance(surface.body, NoBody):
        return np.zeros(len(surface.points))
    first = surface.original
    if first not in _COMPLIANCES:
        _COMPLIANCES[first] = np.where(first.held.all(axis=1), 0.0, 1.0 / plane_moduli(first))
    return _COMPLIANCES[first]


def plane_moduli(surface: ContactSurface) -> Array:
    r"""Plane modulus ``E* = E / (1 - nu^2)`` of the body at the nodes of a surface, shape (m,).

    Read off the stiffness, whatever mesh and element: under a displacement linear in the position
    the stress is uniform around a node, and its nodal force is ``sigma a`` with the vector
    ``a = int N n dA`` of the boundary. In d dimensions a dilatation gives a force of
    ``P = (d lambda + 2 mu) |a|``, shears ``Q = 2 mu |a|``, and the plane modulus is
    ``4 mu (lambda + mu) / (lambda + 2 mu)``. For plane stress lambda is the one of plane stress, as it
    stands in K. Bodies need not be homogeneous but around a node; springs to the ground do not matter.

    Where K is not that of an elastic body, its diagonal stands in for the modulus, which it is but
    for a factor of the order of one. The ends of a surface, whose nodes have other boundaries too,
    take the value of the node next to them.

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity, lame_parameters
    >>> from skfem_contact.bodies.body import Body
    >>> basis = fem.Basis(
    ...     fem.MeshTri().refined(2).with_defaults(), fem.ElementVector(fem.ElementTriP2())
    ... )
    >>> top = Body(basis, linear_elasticity(*lame_parameters(0.91, 0.3))).surface("top")
    >>> bool(abs(plane_moduli(top) - 1.0).max() < 1e-12)
    True
    """
    d, kind = surface.dim, surface.kind
    area, total = area_integrals(surface.points, surface.facets, kind, surface.body.measure)
    dilated, Q = _strained(surface)
    size, P = sizes(area), sizes(dilated)
    with np.errstate(divide="ignore", invalid="ignore"):
        # on a plane of symmetry the force has a part across that plane, from the boundary there
        p, ratio = dot(dilated, area) / size**2, Q / P
        modulus = ratio * (2 + (d - 2) * ratio) / (1 + (d - 1) * ratio) * p
    # under an isotropic strain a nodal force that points into the body is not that of an elastic one
    elastic = np.isfinite(modulus) & (modulus > 0)
    elastic &= size > GIVEN * total  # at corners of quadratic triangles a is round-off
    inner = ~rim_points(surface, mirrored=False)
    known = elastic & inner
    if not (known.any() and elastic.all()):  # the diagonal takes as long as K is large
        diagonal = surface.body.K.diagonal()[surface.dofs].mean(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            diagonal = diagonal * total ** (1 / kind.dim) / size
        if not known.any():
            return np.where(np.isfinite(diagonal) & (diagonal > 0), diagonal, 1.0)
        modulus = np.where(elastic, modulus, diagonal)
    borrowed = ~inner | ~np.isfinite(modulus) | ~(modulus > 0)
    _, nearest = Tree(surface.points[known]).query(surface.points[borrowed])
    modulus[borrowed] = modulus[known][nearest]
    return modulus


def _strained(surface: ContactSurface) -> tuple[Array, Array]:
    """Nodal forces ``(d lambda + 2 mu) a`` of K under a dilatation (m, d), and ``2 mu |a|``, (m,).

    The shears are an orthonormal basis of the strains without a trace, 2 in the plane and 5 in space;
    their squares add up to 1 and 5/3 of the identity.
    """
    d, body, centre = surface.dim, surface.body, surface.points.mean(axis=0)
    strains = np.array([np.eye(d), *_shears(d)])
    own = body.dof_component[:, None]
    at = body.dof_points - centre
    columns = [np.take_along_axis(at @ strain, own, axis=1)[:, 0] for strain in strains]
    unit_x = (np.arange(d) == own).astype(float)
    forces = body.K[surface.dofs.ravel()] @ np.column_stack([*columns, unit_x])
    forces = forces.reshape(len(surface.points), d, -1)
    # the fields vanish at the node itself: less their value there, a translation
    here = np.einsum("sij,mj->mis", strains, surface.points - centre)
    found = forces[:, :, :-d] - np.einsum("mci,mis->mcs", forces[:, :, -d:], here)
    squares = np.sum(found[:, :, 1:] ** 2, axis=(1, 2))
    return found[:, :, 0], np.sqrt(squares * 2 * d / ((d + 2) * (d - 1)))


def _shears(d: int) -> list[Array]:
    """An orthonormal basis of symmetric tensors (d, d) without a trace."""
    basis = []
    for j in range(1, d):
        basis.append(np.diag([1.0] * j + [-j] + [0.0] * (d - j - 1)) / np.sqrt(j * (j + 1)))
        for i in range(j):
            basis.append(np.zeros((d, d)))
            basis[-1][i, j] = basis[-1][j, i] = np.sqrt(0.5)
    return basis


def guided_tangents(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing of glue in space, its tangents along what supports hold `Pairing.still` (rule 4)."""
    guided = np.array(np.broadcast_to(pairing.paired[:, None], pairing.normal.shape))
    sides = (pairing.secondary_weights, secondary), (pairing.primary_weights, primary)
    for weights, surface in sides:
        size = abs(weights)
        free = size @ (~surface.held).astype(float)
        guided &= free <= GIVEN * np.asarray(size.sum(axis=1))
    still = ~can_move(guided[:, None], pairing.tangent)
    # one direction is left, and the normal has it
    alone: Mask = (np.sum(guided, axis=1) == 2) & can_move(guided, pairing.normal)
    still |= alone[:, None]
    still &= np.any(guided, axis=1, keepdims=True)
    if not still.any():
        return pairing
    return replace(pairing, still=still if pairing.still is None else still | pairing.still)


def held_tangents(secondary: ContactSurface, primary: ContactSurface, pairing: Pairing) -> Pairing:
    """The pairing with what supports hold on both sides along the interface as `Pairing.still`.

    On a line or plane of symmetry, and at a wall that guides both bodies, the mortar row across it has
    some nodes of the primary that are not on it. The shear there is zero, the multiplier vanishes, and
    the neighbours keep theirs (rule 3).
    """
    if pairing.slip_weights is None:
        return pairing
    sides = list(zip(pairing.slip_weights, (secondary, primary), (1.0, -1.0), strict=True))
    some, along = secondary.held.any(axis=1), pairing.tangent
    if secondary.dim == 2:  # along the one axis that is held: across it one row is left
        some = (secondary.held.sum(axis=1) == 1) & can_move(secondary.held, pairing.normal)
        along = secondary.held[:, None].astype(float)
    still = [some & held_rows(sides, way) for way in np.moveaxis(along, 1, 0)]
    if not np.any(still):
        return replace(pairing, slip_weights=None)
    return replace(pairing, still=np.stack(still, axis=1))


def along_supports(tangent: Array, normal: Array, held: Mask) -> Array:
    """Tangents (m, 2, 3) turned about the normal so that what supports hold is one of them.

    A roller or a plane of symmetry through the contact takes one direction from the slip. It has to be
    along a tangent: else both rows would be half held, and stand for the one direction that is left
    together.

    Parameters
    ----------
    tangent : ndarray, shape (m, 2, 3)
    normal : ndarray, shape (m, 3)
    held : ndarray of bool, shape (m, 3)
        Prescribed components of the nodes.

    Examples
    --------
    >>> frame = np.array([[[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]]])
    >>> turned = along_supports(frame, np.array([[0.0, 0.0, 1.0]]), np.array([[True, False, False]]))
    >>> turned.tolist()
    [[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]
    """
    count = held.sum(axis=1)
    # the only one that is held, or the only one that is free
    axis = np.where(count == 1, np.argmax(held, axis=1), np.argmin(held, axis=1))
    across = np.eye(3)[axis] - normal[np.arange(len(normal)), axis][:, None] * normal
    some = ((count == 1) | (count == 2)) & (np.linalg.norm(across, axis=1) > FACING)
    first = unit(np.where(some[:, None], across, tangent[:, 0]))
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    return np.where(some[:, None, None], frame, tangent)
