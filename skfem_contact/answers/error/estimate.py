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

The first three are in `surface`, the last in `chords`, the others in `body`. In 3-D only the others are
estimated yet: the total is NaN, and the advice names what is missing.

What no answer shows of itself is not in it: what else curved bodies lose with straight facets, load
steps too long for a history that depends on the path, the limits of the linear theory.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.error.body import bodies_error, stiffness_error
from skfem_contact.answers.error.chords import chords_error, net
from skfem_contact.answers.error.misfit import Line
from skfem_contact.answers.error.sources import Elements, ErrorEstimate, ErrorSources
from skfem_contact.answers.error.surface import points_across, surface_error
from skfem_contact.answers.thresholds import FLAT, NO_MISFIT
from skfem_contact.answers.values import ContactValues
from skfem_contact.bodies.surface import FaceSurface
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.state import OPEN

Array = NDArray[np.float64]
Index = NDArray[np.intp]


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
    advice = _advice(contact, values, line, traction, share, elements, across)
    return ErrorEstimate(pressure, traction, share, elements, across, advice)


def _of_faces(result: Answer, values: ContactValues, contact: Contact) -> ErrorEstimate:
    """What is known in 3-D: the parts of the bodies and of sticking points."""
    both = np.hstack([values.pressure[:, None], values.friction_stress])
    bodies, elements = bodies_error(result, values)
    stiffness = stiffness_error(result, contact, values, both)
    curved = any(
        isinstance(side, FaceSurface) and side.kind.corners == side.kind.nodes and _bends(side)
        for side in (contact.secondary, contact.primary)
    )
    chords = np.nan if curved else 0.0
    missing = np.nan, np.nan, np.nan
    pressure = ErrorSources(*missing, bodies, 0.0, chords)
    traction = ErrorSources(*missing, bodies, stiffness, chords)
    unknown = np.full(len(values.points), np.nan)
    advice = (
        "not estimated in 3-D: what the surface mesh loses where contact or sticking ends, between its "
        "points and by scatter"
    )
    advice += ", and by straight faces on curved sides; " if curved else "; "
    advice += "compare with a finer mesh"
    if elements and bodies > NO_MISFIT:
        coarse = max(elements, key=lambda body: elements[body][1].sum())
        advice += f". Of what is known, the mesh of {coarse} around the contact has most"
    return ErrorEstimate(pressure, traction, unknown, elements, None, advice)


def _bends(side: FaceSurface) -> bool:
    """Whether normals at nodes are not those of the faces: whether the surface is a curved one."""
    turn = side.facet_node_normals - side.facet_normals[:, None]
    return bool(np.max(np.abs(turn)) > FLAT)


def _advice(
    contact: Contact,
    values: ContactValues,
    line: Line,
    sources: ErrorSources,
    share: Array,
    elements: dict[str, Elements],
    across: int,
) -> str:
    """The largest part in words, and what makes it smaller; what is not known."""
    known = _of_largest(contact, values, line, sources, share, elements, across)
    if not np.isnan(sources.bodies):
        return known
    return f"{known}. What the meshes of the bodies lose is not in it: a K was given as a matrix"


def _of_largest(
    contact: Contact,
    values: ContactValues,
    line: Line,
    sources: ErrorSources,
    share: Array,
    elements: dict[str, Elements],
    across: int,
) -> str:
    if sources.total <= NO_MISFIT:
        return "nothing to improve: exact, as far as the answer tells"
    worst, largest = int(np.argmax(share)), sources.largest
    name = contact.secondary.label
    at = "(" + ", ".join(f"{x:.3g}" for x in values.points[worst]) + ")"
    if largest == "edges" and line.ends[worst]:
        return (
            f"most of it at the end of {name} near {at}: at a sharp edge stress has no bound, which no "
            "mesh resolves; round the edge, or use resultants only"
        )
    if largest == "edges":
        return (
            f"most of it where contact or sticking ends ({across} points across the narrowest zone): "
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
