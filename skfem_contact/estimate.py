r"""What an answer is worth: the discretisation error of its tractions, estimated from the answer alone.

The certificate says how well the discrete problem is solved. This says how far its solution may be
from that of the continuous problem, in the L2 norm over the contact, from five sources:

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

The first three are in `surface_error`, the others in `body_error`.

What no answer shows of itself is not in it: curved bodies meshed with straight facets, load steps too
long for a history that depends on the path, the limits of the linear theory.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from skfem_contact.body_error import Elements, bodies_error, stiffness_error
from skfem_contact.contact import Contact
from skfem_contact.misfit import Line
from skfem_contact.surface_error import ROUND_OFF, points_across, surface_error

if TYPE_CHECKING:
    from skfem_contact.contact_values import ContactValues
    from skfem_contact.result import ContactResult

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class ErrorSources:
    """Parts of an estimated error, relative to the L2 norm of the traction; their squares add up.

    Attributes
    ----------
    edges, facets, scatter, bodies, stiffness : float
        See the top of the module `estimate`. `bodies` is NaN where a body was given a matrix instead
        of a `BilinearForm`: then there is no measure of energy, and it is left out.
    """

    edges: float = 0.0
    facets: float = 0.0
    scatter: float = 0.0
    bodies: float = 0.0
    stiffness: float = 0.0

    @property
    def total(self) -> float:
        """Root of the sum of squares."""
        return float(np.sqrt(sum(size**2 for size in self._known().values())))

    @property
    def largest(self) -> str:
        """Name of the largest part."""
        known = self._known()
        return max(known, key=lambda name: np.inf if np.isnan(known[name]) else known[name])

    def _known(self) -> dict[str, float]:
        """The parts; without `bodies` where it is not known. NaN in any other is a defect, and seen."""
        parts = {f.name: float(getattr(self, f.name)) for f in fields(self)}
        return {k: v for k, v in parts.items() if not (k == "bodies" and np.isnan(v))}


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated discretisation error of the tractions of one contact.

    Attributes
    ----------
    pressure, traction : ErrorSources
        Of the pressure, over the L2 norm of the pressure; and of pressure and friction together.
    indicator : ndarray, shape (m,)
        Share of every point in the squared error of the traction that comes from the surface (edges,
        facets, scatter); adds up to one where there is any.
    elements : dict of (ndarray of int, ndarray)
        By name of the body: elements around the contact, and the share of each in the energy error.
    points_across : int
        Points across the narrowest zone of contact, or of sticking, that has edges; 0 without edges.
    advice : str
        What would improve the answer most.
    """

    pressure: ErrorSources
    traction: ErrorSources
    indicator: Array = field(repr=False)
    elements: dict[str, Elements] = field(repr=False)
    points_across: int
    advice: str

    def __str__(self) -> str:
        parts = ", ".join(
            f"{f.name} {percent(getattr(self.traction, f.name))}"
            for f in fields(self.traction)
            if getattr(self.traction, f.name) != 0
        )
        return (
            f"pressure {percent(self.pressure.total)}, traction {percent(self.traction.total)} "
            f"of its L2 norm ({parts or 'no part'}); {self.advice}"
        )


def percent(share: float) -> str:
    """A share in percent, with two digits."""
    if np.isnan(share):
        return "not known"
    return f"{100 * share:.2g} %" if share > ROUND_OFF else "0 %"


def estimate(result: ContactResult, values: ContactValues) -> ErrorEstimate:
    """Estimate the error of one contact; needs the displacements of its bodies."""
    contact = result.contacts[result.names.index(values.name)]
    surface, closed = values.surface, values.status != 0
    if not closed.any():
        none = ErrorSources()
        return ErrorEstimate(none, none, np.zeros(len(closed)), {}, 0, "nothing touches")
    # at prescribed nodes the support bears what contact would, and nobody knows how much of it
    line = Line.of(surface, np.asarray(~surface.held.all(axis=1)))
    p = values.pressure[:, None]
    both = np.hstack([p, values.friction_stress])
    bodies, elements = bodies_error(result, values)
    of_pressure, _ = surface_error(values, line, p)
    of_both, share = surface_error(values, line, both)
    stiffness = stiffness_error(result, contact, values, both)
    pressure = ErrorSources(*of_pressure, bodies)
    traction = ErrorSources(*of_both, bodies, stiffness)
    across = points_across(line, values.status)
    advice = _advice(contact, values, line, traction, share, elements, across)
    return ErrorEstimate(pressure, traction, share, elements, across, advice)


def _advice(
    contact: Contact,
    values: ContactValues,
    line: Line,
    sources: ErrorSources,
    share: Array,
    elements: dict[str, Elements],
    across: int,
) -> str:
    """The largest part in words, and what makes it smaller."""
    if sources.total <= ROUND_OFF:
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
