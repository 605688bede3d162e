r"""What an answer is worth: the discretisation error of its tractions, estimated from the answer alone.

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

The first three are in `surface`, in 3-D in `faces`, the last in `chords`, the others in `body`. In 3-D
the first three are estimated on linear faces only, and `chords` only where there are none: then the
total is NaN, and the advice names what is missing.

What no answer shows of itself is not in it: what else curved bodies lose with straight facets, load
steps too long for a history that depends on the path, the limits of the linear theory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.error.body import bodies_error, stiffness_error
from skfem_contact.answers.error.chords import chords_error, net
from skfem_contact.answers.error.faces import faces_error
from skfem_contact.answers.error.misfit import Line
from skfem_contact.answers.error.sources import Elements, ErrorEstimate, ErrorSources
from skfem_contact.answers.error.surface import points_across, surface_error
from skfem_contact.answers.thresholds import FLAT, NO_MISFIT
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.surface import FaceSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.state import OPEN
from skfem_contact.pairing.faces.joints import rim_points

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


def estimate(result: Answer, values: ContactValues) -> ErrorEstimate:
    """Estimate the error of one contact; needs the displacements of its bodies."""
    contact = result.contacts[result.names.index(values.name)]
    surface, closed = values.surface, values.status != OPEN
    if not closed.any():
        none = ErrorSources()
        return ErrorEstimate(none, none, np.zeros(len(closed)), {}, 0, "nothing touches")
    if isinstance(surface, FaceSurface):
        return _of_faces(result, values, contact)
    # at prescribed nodes the support bears what contact would, and nobody knows how much of it
    line = Line.of(surface, np.asarray(~surface.held.all(axis=1)))
    p = values.pressure[:, None]
    both = np.hstack([p, values.friction_stress])
    bodies, elements = bodies_error(result, values)
    of_pressure, _ = surface_error(values, line, p)
    of_both, share = surface_error(values, line, both)
    stiffness = stiffness_error(result, contact, values, both)
    bodies, chords = net(result, bodies, chords_error(result, values))
    pressure = ErrorSources(*of_pressure, bodies, 0.0, chords)
    traction = ErrorSources(*of_both, bodies, stiffness, chords)
    across = points_across(line, values.status)
    advice = _advice(contact, values, line.ends, traction, share, elements, across)
    return ErrorEstimate(pressure, traction, share, elements, across, advice)


def _of_faces(result: Answer, values: ContactValues, contact: Contact) -> ErrorEstimate:
    """The same in 3-D; what is not known there is NaN."""
    surface, sides = values.surface, (contact.secondary, contact.primary)
    assert isinstance(surface, FaceSurface)
    # as vectors: tangents may be another choice from one node to the next
    friction = values.traction - values.pressure[:, None] * values.normal
    both = np.hstack([values.pressure[:, None], friction])
    bodies, elements = bodies_error(result, values)
    stiffness = stiffness_error(result, contact, values, both)
    of_pressure = of_both = np.nan, np.nan, np.nan
    share = np.full(len(values.points), np.nan)
    if surface.kind.corners == surface.kind.nodes:
        unlike = _between_nodes(result, values, contact)
        of_pressure, _ = faces_error(values, values.pressure[:, None], unlike)
        of_both, share = faces_error(values, both, unlike)
    straight = [side for side in sides if isinstance(side, FaceSurface) and not side.kind.quadratic]
    chords = np.nan if any(map(_bends, straight)) else 0.0
    pressure = ErrorSources(*of_pressure, bodies, 0.0, chords)
    traction = ErrorSources(*of_both, bodies, stiffness, chords)
    ends = rim_points(surface, mirrored=False)
    advice = _advice(contact, values, ends, traction, share, elements, None)
    return ErrorEstimate(pressure, traction, share, elements, None, advice)


def _between_nodes(result: Answer, values: ContactValues, contact: Contact) -> bool:
    """Whether nodes press on the other side between its nodes, node by node."""
    if contact.method != "node" or contact.rigid:
        return False
    assert isinstance(contact.primary, FaceSurface)
    rows = result.kin.B_n[result.slices()[result.names.index(values.name)]]
    body = contact.primary.body
    own = 2 if body is contact.secondary.body else 1
    most = rows[:, result.system.slice(body)].getnnz(axis=1)[values.status != OPEN].max(initial=0)
    return bool(most > own * body.components)


def _bends(side: FaceSurface) -> bool:
    """Whether normals at nodes are not those of the faces: whether the surface is a curved one."""
    turn = side.facet_node_normals - side.facet_normals[:, None]
    return bool(np.max(np.abs(turn)) > FLAT)


def _advice(
    contact: Contact,
    values: ContactValues,
    ends: Mask,
    sources: ErrorSources,
    share: Array,
    elements: dict[str, Elements],
    across: int | None,
) -> str:
    """The largest part in words, and what makes it smaller; what is not known."""
    left_out = []
    if "edges" in sources.missing:
        left_out.append(
            "what quadratic faces lose where contact or sticking ends, between points and by scatter"
        )
    elif "scatter" in sources.missing:
        left_out.append("scatter from node to node, as all points are near an end of the surface")
    if "chords" in sources.missing:
        left_out.append("what straight faces lose on curved sides")
    if left_out:
        words = f"not estimated in 3-D: {', and '.join(left_out)}; compare with a finer mesh"
        known = {name: size for name, size in vars(sources).items() if name not in sources.missing}
        if max(known.values(), default=0.0) <= NO_MISFIT:
            return words
        largest = max(known, key=lambda name: known[name])
    else:
        words, largest = "", sources.largest
        if sources.total <= NO_MISFIT:
            return "nothing to improve: exact, as far as the answer tells"
    said = _of_largest(contact, values, ends, largest, share, elements, across)
    if words:
        said = f"{words}. Of what is known, {said}"
    if not np.isnan(sources.bodies):
        return said
    return f"{said}. What the meshes of the bodies lose is not in it: a K was given as a matrix"


def _of_largest(
    contact: Contact,
    values: ContactValues,
    ends: Mask,
    largest: str,
    share: Array,
    elements: dict[str, Elements],
    across: int | None,
) -> str:
    worst = int(np.argmax(share))
    name = contact.secondary.label
    at = "(" + ", ".join(f"{x:.3g}" for x in values.points[worst]) + ")"
    # where an end does not touch, it only lies beside the edge of contact
    if largest == "edges" and ends[worst] and values.status[worst] != OPEN:
        return (
            f"most of it at the end of {name} near {at}: at a sharp edge stress has no bound, which no "
            "mesh resolves; round the edge, or use resultants only"
        )
    if largest == "edges":
        narrow = "" if across is None else f" ({across} points across the narrowest zone)"
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
