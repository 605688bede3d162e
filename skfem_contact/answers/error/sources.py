"""`ErrorEstimate`: what is estimated of the error of one contact, by its sources."""

from __future__ import annotations

from dataclasses import field, fields

import numpy as np
from numpy.typing import NDArray

from skfem_contact.answers.thresholds import ESTIMATED
from skfem_contact.arrays import Array
from skfem_contact.digits import SOLVED
from skfem_contact.records import dataclass

Elements = tuple[NDArray[np.intp], Array]
Three = tuple[float, float, float]


@dataclass(frozen=True)
class ErrorSources:
    """Parts of an estimated error, relative to the L2 norm of the traction; their squares add up.

    Attributes
    ----------
    edges, facets, scatter, bodies, stiffness, chords : float
        See the top of the module `estimate`. `bodies` is NaN where a body was given a matrix instead
        of a `BilinearForm`: then there is no measure of energy, and it is left out. Where another one
        is NaN the answer is not rated, and `total` is NaN, too.

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
    >>> parts = result.error_estimate.pressure
    >>> parts.chords, parts.stiffness, bool(parts.total >= parts.facets)
    (0.0, 0.0, True)
    """

    edges: float = 0.0
    facets: float = 0.0
    scatter: float = 0.0
    bodies: float = 0.0
    stiffness: float = 0.0
    chords: float = 0.0

    @property
    def total(self) -> float:
        """Root of the sum of squares; NaN where more is missing than `bodies`."""
        return float(np.sqrt(sum(size**2 for size in self._known().values())))

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the parts that are not estimated."""
        return tuple(f.name for f in fields(self) if np.isnan(getattr(self, f.name)))

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
    points_across : int or None
        Points across the narrowest zone of contact, or of sticking, that has edges; 0 without edges.
        None in 3-D.
    advice : str
        What would improve the answer most.
    unrated : str
        Why the answer can not be rated; empty where it is. Then the totals are NaN.

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
    >>> error = result.error_estimate
    >>> error.pressure.largest, bool(0 < error.pressure.total < 1)
    ('edges', True)
    """

    pressure: ErrorSources
    traction: ErrorSources
    indicator: Array = field(repr=False)
    elements: dict[str, Elements] = field(repr=False)
    points_across: int | None
    advice: str
    unrated: str = ""

    def __str__(self) -> str:
        if self.unrated:
            return f"not rated: {self.unrated}"
        parts = ", ".join(
            f"{f.name} {percent(getattr(self.traction, f.name))}"
            for f in fields(self.traction)
            if getattr(self.traction, f.name) != 0
        )
        return f"{self.words} of the L2 norm ({parts or 'no part'}); {self.advice}"

    @property
    def words(self) -> str:
        """The totals of pressure and traction, in percent up to what can be estimated."""
        if self.unrated:
            return "not rated"
        if max(self.pressure.total, self.traction.total) > ESTIMATED:
            return f"more than {percent(ESTIMATED)}, beyond what can be estimated"
        return f"pressure {percent(self.pressure.total)}, traction {percent(self.traction.total)}"


def percent(share: float) -> str:
    """A share in percent, with two digits."""
    if np.isnan(share):
        return "not known"
    return f"{100 * share:.2g} %" if share > SOLVED else "0 %"


def relative(edges: Array, facets: Array, scatter: Array, size: float) -> tuple[Three, Array]:
    """Norms of three squared errors over points, relative to a norm; the share of each point.

    Parameters
    ----------
    edges, facets, scatter : ndarray, shape (m,)
        Squares of the errors.
    size : float
        Of the traction, squared.
    """
    total = edges + facets + scatter
    share = total / total.sum() if total.sum() > SOLVED**2 * size else np.zeros(len(total))
    norms = [
        float(np.sqrt(part.sum() / size)) if size > 0 else 0.0 for part in (edges, facets, scatter)
    ]
    return (norms[0], norms[1], norms[2]), share
