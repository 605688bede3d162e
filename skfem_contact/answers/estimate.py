r"""The worth of an answer: the discretisation error of its tractions, estimated from the answer alone.

The certificate says how well the discrete problem is solved. This says how far its solution may be
from that of the continuous problem, in the L2 norm over the contact, from six sources:

``edges``
    Where contact or sticking ends, tractions behave like the square root of the distance, which no
    shape function resolves: an error of first order, all of it on one or two facets.
``facets``
    Between the edges tractions are smooth and curved, shape functions are not.
``scatter``
    Values that jump from node to node, as node-to-segment contact of unlike meshes gives them.
``bodies``
    Meshes are stiffer than bodies, by the square of the relative energy error; so are their answers.
    Elements count the less the farther they are from the contact.
``stiffness``
    A finite tangential stiffness of the friction law lets sticking points move.
``chords``
    On curves of straight facets nodal forces act along normals of the curve, pressures along the
    facets'.

The first three and the last are in `surface_error`. Of a body the gradient of the displacement, which
jumps from element to element, is compared with its averages at the nodes, interpolated: O. C.
Zienkiewicz and J. Z. Zhu, A simple error estimator and adaptive procedure for practical engineering
analysis, Int. J. Numer. Methods Eng. 24 (1987) 337-357. The difference is measured by the energy of the
body's own bilinear form. Relative to the energy of the displacement it is the relative error of a
compliance. Elements within half a contact width of the contact count in full; farther ones less, by the
square of the distance: what they do wrong reaches the contact as a field that varies little over it.

An answer is not rated, and its total NaN, where one of them is not known: `chords` of second-order
facets that stand straight for a curve, `scatter` where all points are near ends of the surface; and
where a body locks (`validity.strain`), since its answer shows nothing of that error.

What no answer shows of itself is not in it: what else curved bodies lose with straight facets, load
steps too long for a history that depends on the path, the limits of the linear theory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import skfem
from scipy.sparse.csgraph import connected_components
from skfem.element import DiscreteField

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.surface_error import Net, SurfaceError, chords_error, net_of
from skfem_contact.answers.validity.chords import straight_words
from skfem_contact.answers.validity.deformed_boundaries import Rim
from skfem_contact.answers.validity.strain import lockable, locked
from skfem_contact.answers.validity.track import signed_distance
from skfem_contact.answers.validity.validity import A_TENTH, LOCKED
from skfem_contact.answers.values import ContactValues, Elements, ErrorEstimate, ErrorSources
from skfem_contact.arrays import Array, Index, Mask
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.rows import compliance_scale
from skfem_contact.conditions.state import OPEN, STICK
from skfem_contact.digits import SOLVED
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.obstacles.rigid_body import shape_of
from skfem_contact.trees import Tree

#: The parts of an answer that is not rated.
UNKNOWN = ErrorSources(*[np.nan] * 6)


def estimate(result: Answer, values: ContactValues) -> ErrorEstimate:
    """Estimate the error of one contact; needs the displacements of its bodies.

    The six parts, and what would improve the answer; or why it can not be rated.
    """
    contact = values.contact
    surface, closed = values.surface, values.status != OPEN
    if not closed.any():
        none = ErrorSources()
        return ErrorEstimate(none, none, np.zeros(len(closed)), {}, 0, "nothing touches")
    # as vectors: tangents may be another choice from one node to the next
    friction = values.traction - values.pressure[:, None] * values.normal
    both = np.hstack([values.pressure[:, None], friction])
    bodies, elements = bodies_error(result, values)
    stiffness = stiffness_error(result, contact, values, both)
    error = SurfaceError(values, _between_nodes(result, values, contact))
    of_pressure, _ = error(values.pressure[:, None])
    of_both, share = error(both)
    bodies, chords = net_of(result, bodies, chords_error(result, values))
    pressure = ErrorSources(*of_pressure, bodies, 0.0, chords)
    traction = ErrorSources(*of_both, bodies, stiffness, chords)
    across = points_across(error.net, values.status) if surface.dim == 2 else None
    found = ErrorEstimate(pressure, traction, share, elements, across, "")
    why = _unrated(result, values, found)
    if why:
        return replace(found, pressure=UNKNOWN, traction=UNKNOWN, advice=why, unrated=why)
    return replace(found, advice=_advice(result, values, found))


def _unrated(result: Answer, values: ContactValues, found: ErrorEstimate) -> str:
    """Why an answer can not be rated, and what to do; empty where it can."""
    contact = values.contact
    sides = [s for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    for side in sides:
        name = result.system.names[result.system.index(side.body)]
        if name in lockable(result) and locked(result, name) > LOCKED:
            return f"body {name!r} locks (result.validity), and its answer shows little of that error"
        straight = straight_words(side, _pressed(result, values, side))
        if straight:
            return straight
    if "scatter" in found.traction.missing:
        return (
            "all points are near an end of the surface, and none tells how values scatter from node to "
            "node; compare with a finer mesh"
        )
    return ""


def points_across(net: Net, status: Index) -> int:
    """Points of the smallest zone of contact, or of sticking, that has an edge; 0 without one."""
    fewest = []
    for zone in (status != OPEN, status == STICK):
        inside = np.flatnonzero(zone)
        _, number = connected_components(net.joined[inside][:, inside], directed=False)
        with_edge = np.unique(number[net.beside(~zone)[inside]])
        fewest += np.bincount(number)[with_edge].tolist()
    return min(fewest, default=0)


def _between_nodes(result: Answer, values: ContactValues, contact: Contact) -> bool:
    """Return whether nodes press on the other side between its nodes, node by node."""
    if contact.method != "node" or contact.rigid:
        return False
    assert isinstance(contact.primary, ContactSurface)
    rows = result.kin.B_n[result.slices()[result.names.index(values.name)]]
    body = contact.primary.body
    own = 2 if body is contact.secondary.body else 1
    most = rows[:, result.system.slice(body)].getnnz(axis=1)[values.status != OPEN].max(initial=0)
    return bool(most > own * body.components)


def _pressed(result: Answer, values: ContactValues, side: ContactSurface) -> Index:
    """Facets of a side with a node that presses or is pressed."""
    part = result.slices()[result.names.index(values.name)]
    forces = (result.kin.B_n[part].T @ values.normal_force)[result.system.slice(side.body)]
    return np.flatnonzero(forces[side.dofs].any(axis=1)[side.facets].any(axis=1))


def _advice(result: Answer, values: ContactValues, found: ErrorEstimate) -> str:
    """The largest part in words, and what makes it smaller."""
    if found.traction.total <= SOLVED:
        return "nothing to improve: exact, as far as the answer tells"
    said = _of_largest(result, values, found)
    if not np.isnan(found.traction.bodies):
        return said
    contact = values.contact
    sides = [s.body for s in (contact.secondary, contact.primary) if isinstance(s, ContactSurface)]
    why = "a body is not linear" if any(b.nonlinear for b in sides) else "a K was given as a matrix"
    lost = f"What the meshes of the bodies lose, above all in bending, is not in it: {why}"
    return f"{said}. {lost}; compare with a finer mesh, or elements of second order"


def _sharp_edge(result: Answer, values: ContactValues, point: int) -> str:
    """Where an edge of either side presses at a point or beside it, in words; else nothing.

    Not where contact ends by itself at the point, as it does everywhere on strips of few facets. No
    node of the secondary need lie on an edge of the primary, whose stress is felt one node on.
    """
    contact, surface = values.contact, values.surface
    around = np.unique(surface.facets[(surface.facets == point).any(axis=1)])
    open_ = values.status == OPEN
    if np.any(open_[around] & np.isfinite(values.gap[around])):
        return ""
    primary = contact.primary
    if isinstance(primary, ContactSurface) and contact.sliding == "finite":
        both = surface, primary
        surface, primary = (side.moved(result.displacement(side.body)) for side in both)
    ends = surface.facets[:, surface.kind.edges][surface.twins < 0][_over(surface, primary)]
    if np.isin(ends, around[~open_[around]]).any():
        return f"at the end of {contact.secondary.label}"
    if isinstance(primary, ContactSurface) and (pressing := _over(primary, surface)).any():
        rim = Rim.of(primary)
        rim = Rim(rim.corners[pressing], rim.outward[pressing])
        size = np.linalg.norm(surface.points[around] - surface.points[point], axis=1).max()
        if abs(rim.beyond(surface.points[[point]])[0]) <= size:
            return f"where {contact.primary.label} ends"
    return ""


def _over(surface: ContactSurface, other: ContactSurface | Obstacle) -> Mask:
    """Edges of the rim of a surface past which the other side goes on a little way out, (r,).

    An obstacle does where it is no farther there. Not where both end flush, nor on a plane of symmetry.
    """
    rim, facet = Rim.of(surface), np.nonzero(surface.twins < 0)[0]
    middle, step = rim.corners.mean(axis=1), A_TENTH * surface.lengths[facet]
    ahead = middle + step[:, None] * rim.outward
    if isinstance(other, ContactSurface):
        goes_on = Rim.of(other).beyond(ahead) < 0
    else:
        near, far = (signed_distance(shape_of(other), surface, x) for x in (middle, ahead))
        goes_on = far < near + 0.5 * step
    return np.asarray(goes_on & ~surface.mirrored_rim.any(axis=1))


def _of_largest(result: Answer, values: ContactValues, found: ErrorEstimate) -> str:
    largest, across, elements = found.traction.largest, found.points_across, found.elements
    contact, worst = values.contact, int(np.argmax(found.indicator))
    name = contact.secondary.label
    at = "(" + ", ".join(f"{x:.3g}" for x in values.points[worst]) + ")"
    if largest == "edges":
        there = _sharp_edge(result, values, worst)
        if there:
            return (
                f"most of it {there} near {at}: at a sharp edge stress has no bound, which no mesh "
                "resolves; round the edge, or use resultants only"
            )
    if largest == "edges":
        narrow = f" ({across} points across the narrowest zone)" if across else ""
        return (
            f"most of it where contact or sticking ends{narrow}: "
            f"refine {name} near {at}; half the size is half the error"
        )
    if largest == "scatter" and contact.method == "node" and not contact.rigid:
        return f"most of it scatter of the nodal values on {name}: take method='mortar'"
    if largest in ("facets", "scatter"):
        return f"most of it between the points of {name}: refine it near {at}"
    if largest == "chords":
        return (
            f"most of it the straight facets of curved surfaces: refine {name} and its partner, or "
            "take quadratic elements with curved sides"
        )
    if largest == "stiffness":
        return (
            "most of it the motion of sticking points: give the friction law a larger stiffness, or "
            "none for exact sticking"
        )
    coarse = max(elements, key=lambda body: elements[body][1].sum())
    return (
        f"most of it the mesh of {coarse} around the contact: refine it there, or take quadratic "
        "elements"
    )


def bodies_error(result: Answer, values: ContactValues) -> tuple[float, dict[str, Elements]]:
    """Relative energy error of the bodies, as far as the traction feels it."""
    part = result.slices()[result.names.index(values.name)]
    touching = np.unique(result.kin.B_n[part][values.status != OPEN].indices)
    found: dict[str, Elements] = {}
    error = total = 0.0
    for i, (body, name) in enumerate(zip(result.system.bodies, result.system.names, strict=True)):
        span = result.system.slice(body)
        dofs = touching[(touching >= span.start) & (touching < span.stop)] - span.start
        if not len(dofs) or not isinstance(body, Body):
            continue
        if body.nonlinear or body.form is None or result.stiffness[i] is not body.K:
            return np.nan, {}
        # where the body itself is touched: with finite sliding that is not where the other one was
        near, weight = _near(body, body.dof_points[dofs])
        lost, stored = energy_error(body, result.stretched(body), near)
        found[name] = near, weight * lost
        error, total = error + float(weight @ lost), total + float(weight @ stored)
    shares = {name: (near, lost / error if error else lost) for name, (near, lost) in found.items()}
    return (float(error / (error + total)) if total > 0 else 0.0), shares


def _near(body: Body, touched: Array) -> Elements:
    """Elements around touched points, and their influence on the traction there.

    One up to half the width of the contact, from there on it falls with the square of the distance.
    """
    mesh = body.basis.mesh
    corners = mesh.p[:, mesh.t]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=0).max(axis=0)
    reach = np.maximum(0.5 * np.linalg.norm(np.ptp(touched, axis=0)), 2.0 * radius)
    distance = Tree(touched).distances(middle.T)
    weight = np.minimum(1.0, reach / np.maximum(distance, reach)) ** 2
    near = np.flatnonzero(weight >= A_TENTH**2)  # others count for less than a percent
    return near, weight[near]


def stiffness_error(result: Answer, contact: Contact, values: ContactValues, traction: Array) -> float:
    """Return what a finite tangential stiffness G takes from the friction of sticking points.

    A body of stiffness k in series with G bears ``k / (k + G)`` less. The bodies' stiffness at a node
    belongs to motions of one node; all sticking points together are softer by their number.
    """
    stick = values.status == STICK
    if contact.friction is None or not stick.any() or not traction.any():
        return 0.0
    part = result.slices()[result.names.index(values.name)]
    G = result.tangential_stiffness[part]
    if not np.isfinite(G[stick]).any():
        return 0.0
    t = result.kin.tangents
    rows = result.kin.B_t[part.start * t : part.stop * t]
    diagonal = np.concatenate([K.diagonal() for K in result.stiffness])
    k = compliance_scale(rows, diagonal).reshape(-1, t).min(axis=1) / np.sum(stick)
    lost = np.where(stick, k / (k + G), 0.0)[:, None] * traction[:, 1:]
    # of faces some nodes have none, see `pairing.node`
    area = (values.surface if values.surface.dim == 2 else values).area[:, None]
    return float(np.sqrt(np.sum(area * lost**2) / np.sum(area * traction**2)))


def energy_error(body: Body, u: Array, elements: Index) -> tuple[Array, Array]:
    """Energies of the estimated error and of the displacement, per element.

    Parameters
    ----------
    body : Body
        With a `form`.
    u : ndarray, shape (n,)
        Displacement of the body [length].
    elements : ndarray of int, shape (k,)

    Returns
    -------
    tuple of ndarray, each of shape (k,)
        [force length]
    """
    own = body.basis
    scalar = own.elem.elem if isinstance(own.elem, skfem.ElementVector) else own.elem
    shared = {"elements": elements, "dofs": own.dofs}
    basis = skfem.Basis(own.mesh, own.elem, own.mapping, quadrature=own.quadrature, **shared)
    corners = scalar.doflocs.T, np.ones(len(scalar.doflocs))
    at_nodes = skfem.Basis(own.mesh, own.elem, own.mapping, quadrature=corners, **shared)
    raw = np.asarray(at_nodes.interpolate(u).grad)  # (..., k, nodes of an element)
    smooth = basis.with_element(scalar)
    dofs, weight = smooth.element_dofs, np.asarray(basis.dx).sum(axis=1)
    total = np.bincount(dofs.ravel(), np.tile(weight, len(dofs)), smooth.N)
    field = basis.interpolate(u)
    error = np.zeros_like(np.asarray(field.grad))
    for at in np.ndindex(raw.shape[:-2]):
        mean = np.bincount(dofs.ravel(), (raw[at].T * weight).ravel(), smooth.N)
        mean = np.divide(mean, total, out=np.zeros_like(mean), where=total > 0)
        error[at] = np.asarray(smooth.interpolate(mean)) - field.grad[at]
    # the form sees a displacement whose gradient is the difference
    energy = skfem.Functional(lambda w: body.energy_density(w["e"], w))
    difference = DiscreteField(np.zeros_like(np.asarray(field)), error)
    return energy.elemental(basis, e=difference), energy.elemental(basis, e=field)
