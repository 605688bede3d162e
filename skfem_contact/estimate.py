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
    Counted over the elements within a contact width of the contact, which shape the pressure
    (Saint-Venant).
``stiffness``
    A finite tangential stiffness of the friction law lets sticking points move.

The first three come from the `misfit` of the nodal tractions: the value at a node against what
its neighbours tell, that is, a mesh of twice the size. By Richardson's argument the error of the mesh
itself is the misfit over ``2**p - 1``: over 1 at an edge, where the order p is one, over 3 on linear
facets and 7 on quadratic ones. The fourth is the estimate of Zienkiewicz and Zhu.

What no answer shows of itself is not in it: curved bodies meshed with straight facets, load steps too
long for a history that depends on the path, the limits of the linear theory.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from skfem_contact.contact import Contact
from skfem_contact.kinematics import compliance_scale
from skfem_contact.misfit import Line, edge_misfit, energy_error, misfit
from skfem_contact.surface import ContactSurface

if TYPE_CHECKING:
    from skfem_contact.body import Body
    from skfem_contact.contact_values import ContactValues
    from skfem_contact.result import ContactResult

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Three = tuple[float, float, float]
Elements = tuple[Index, Array]

#: Below this the misfit is round-off of the solution, with two digits to spare.
ROUND_OFF = 1e-9
#: Elements beyond so many half widths of contact count for less than a percent.
FARTHEST = 10.0
#: At the end of stick a square root misfits its nodes at least ten times as much as those beside
#: them, a smooth function with a jump in its curvature about as much.
SHARPER = 3.0


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
        return float(np.sqrt(sum(np.nan_to_num(getattr(self, f.name)) ** 2 for f in fields(self))))

    @property
    def largest(self) -> str:
        """Name of the largest part."""
        return max((f.name for f in fields(self)), key=lambda n: np.nan_to_num(getattr(self, n)))


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
    bodies, elements = _bodies(result, values)
    of_pressure, _ = _surface_sources(values, line, p)
    of_both, share = _surface_sources(values, line, both)
    stiffness = _stiffness(result, contact, values, both)
    pressure = ErrorSources(*of_pressure, bodies)
    traction = ErrorSources(*of_both, bodies, stiffness)
    across = _points_across(line, values.status)
    advice = _advice(contact, values, line, traction, share, elements, across)
    return ErrorEstimate(pressure, traction, share, elements, across, advice)


# -- the surface ------------------------------------------------------------------------------


def _surface_sources(values: ContactValues, line: Line, traction: Array) -> tuple[Three, Array]:
    """Errors by edges, facets and scatter over the norm of the traction; the share of each point."""
    surface = values.surface
    area, quadratic = surface.area[:, None], surface.quadratic
    size = float(np.sum(area * traction**2))
    first = misfit(line, traction, quadratic)
    sharp = _sharp(line, values.status, first, surface)
    order = np.where(sharp, 1.0, 1 / 7 if quadratic else 1 / 3)[:, None]
    # a hat function has a third of the square of its height, over its area
    squares = area / 3.0 * (order * first) ** 2
    edges = line.edges(values.status != 0, values.gap)
    squares[edges.inside] = squares[edges.outside] = 0.0
    squares[edges.inside] += edge_misfit(line, edges, traction)
    sharp[edges.inside] = True
    scatter = area / 3.0 * _scatter(line, first, sharp, quadratic)
    total = (squares + scatter).sum(axis=1)
    share = total / total.sum() if total.sum() > ROUND_OFF**2 * size else np.zeros(len(total))

    def norm(part: Array) -> float:
        return float(np.sqrt(part.sum() / size)) if size > 0 else 0.0

    return (norm(squares[sharp]), norm(squares[~sharp]), norm(scatter)), share


def _sharp(line: Line, status: Index, first: Array, surface: ContactSurface) -> NDArray[np.bool_]:
    """Points where tractions are no smooth functions: at ends of contact, of stick, of the surface."""
    border = np.zeros(len(status), dtype=bool)
    for link in (line.before, line.after):
        border |= (link >= 0) & (status[link] != status)
    # where slip begins tractions may well be smooth, and then are misfits not larger than beside it
    size, beside = np.linalg.norm(first, axis=1), np.zeros(len(status))
    for link in (line.before, line.after):
        inner = (link >= 0) & ~border[link]
        beside = np.where(inner, np.maximum(beside, size[link]), beside)
    sharp = border & (size > SHARPER * beside)
    # at the end of a surface stress may be singular, but not on a line of symmetry or at a support
    bound = np.asarray(surface.held.any(axis=1))
    supported = np.asarray(surface.held.all(axis=1))[surface.facets].any(axis=1)
    bound[surface.facets[supported]] = True
    return sharp | (line.ends & ~bound)


def _scatter(line: Line, first: Array, sharp: NDArray[np.bool_], quadratic: bool) -> Array:
    """Squared heights of what jumps from node to node, (m, k), times three over those of its hats.

    Taking the misfit again and again leaves of a traction what scatters. It enlarges waves by
    ``1 - cos`` of their phase per node: 2 for a zigzag, 1 for waves of four nodes. Longer ones are as
    good as smooth.
    """
    # only nodes whose neighbours' misfits know no sharp points, and stand between others
    left_out = sharp | line.ends
    for _ in range(3 if quadratic else 2):
        left_out = line.beside(left_out)
    second = np.where(left_out[:, None], 0.0, misfit(line, first, quadratic))
    third = np.where(left_out[:, None], 0.0, misfit(line, second, quadratic))
    scale = float(np.sum(second**2))
    growth = min(float(np.sqrt(np.sum(third**2) / scale)), 2.0) if scale > 0 else 1.0
    # a field of hats with heights a cos(phase i) has the mean square a² (2 + cos phase) / 6
    return (3.0 - growth) * (second / max(growth, 1.0) ** 2) ** 2


def _points_across(line: Line, status: Index) -> int:
    """Points of the shortest run of contact, or of sticking, that touches an edge."""
    fewest = 0
    for zone in (status != 0, status == 1):
        start = zone & ((line.before < 0) | ~zone[line.before])
        for first in np.flatnonzero(start):
            run = [first]
            while line.after[run[-1]] >= 0 and zone[line.after[run[-1]]]:
                run.append(line.after[run[-1]])
                if run[-1] == first:
                    break
            beyond = line.before[run[0]], line.after[run[-1]]
            if any(node >= 0 and not zone[node] for node in beyond):
                fewest = min(fewest, len(run)) if fewest else len(run)
    return fewest


# -- bodies and the friction law --------------------------------------------------------------


def _bodies(result: ContactResult, values: ContactValues) -> tuple[float, dict[str, Elements]]:
    """Relative energy error of the bodies, as far as the traction feels it."""
    part = result.slices()[result.names.index(values.name)]
    touching = np.unique(result.kin.B_n[part][values.status != 0].indices)
    found: dict[str, Elements] = {}
    error = total = 0.0
    for i, (body, name) in enumerate(zip(result.system.bodies, result.system.names, strict=True)):
        span = result.system.slice(body)
        dofs = touching[(touching >= span.start) & (touching < span.stop)] - span.start
        if not len(dofs):
            continue
        if body.form is None or result.stiffness[i] is not body.K:
            return np.nan, {}
        # where the body itself is touched: with finite sliding that is not where the other one was
        near, weight = _near(body, body.dof_points[dofs])
        lost, stored = energy_error(body, result.displacement(body), near)
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
    distance = cKDTree(touched).query(middle.T)[0]
    near = np.flatnonzero(distance <= FARTHEST * reach)
    return near, np.minimum(1.0, reach[near] / np.maximum(distance[near], reach[near])) ** 2


def _stiffness(
    result: ContactResult, contact: Contact, values: ContactValues, traction: Array
) -> float:
    """What a finite tangential stiffness G takes from the friction of sticking points.

    A body of stiffness k in series with G bears ``k / (k + G)`` less. The bodies' stiffness at a node
    belongs to motions of one node; all sticking points together are softer by their number.
    """
    stick = values.status == 1
    if contact.friction is None or not stick.any() or not traction.any():
        return 0.0
    part = result.slices()[result.names.index(values.name)]
    G = result.tangential_stiffness[part]
    t = result.kin.tangents
    rows = result.kin.B_t[part.start * t : part.stop * t]
    diagonal = np.concatenate([K.diagonal() for K in result.stiffness])
    k = compliance_scale(rows, diagonal).reshape(-1, t).min(axis=1) / np.sum(stick)
    lost = np.where(stick, k / (k + G), 0.0)[:, None] * traction[:, 1:]
    area = values.surface.area[:, None]
    return float(np.sqrt(np.sum(area * lost**2) / np.sum(area * traction**2)))


# -- words ------------------------------------------------------------------------------------


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
