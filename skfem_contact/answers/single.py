"""Where a result has one contact: the properties of its `ContactValues`, on the result itself."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.answers.error.sources import ErrorEstimate
from skfem_contact.answers.values import ContactValues

Array = NDArray[np.float64]


class OfTheContact(ABC):
    """Properties of the contact itself, for results with one contact.

    With several contacts they are AttributeErrors that name the contacts: nothing is joined.
    """

    @abstractmethod
    def _only(self, name: str) -> ContactValues:
        """The values of the only contact; `name` is the property that is asked for."""

    @property
    def points(self) -> Array:
        """Positions on the undeformed secondary surface, shape (m, d) [length]."""
        return self._only("points").points

    @property
    def normal(self) -> Array:
        """Unit normals from primary to secondary, shape (m, d)."""
        return self._only("normal").normal

    @property
    def tangent(self) -> Array:
        """Unit tangents, shape (m, d-1, d)."""
        return self._only("tangent").tangent

    @property
    def area(self) -> Array:
        """Tributary area of the points, shape (m,) [area]."""
        return self._only("area").area

    @property
    def gap(self) -> Array:
        """Positive where open, ``inf`` where a point has no partner, shape (m,) [length]."""
        return self._only("gap").gap

    @property
    def slip(self) -> Array:
        """Of the secondary relative to the primary, (m, d-1) [length]; see `ContactValues.slip`."""
        return self._only("slip").slip

    @property
    def slip_vector(self) -> Array:
        """The slip in global axes, shape (m, d) [length]; see `ContactValues.slip_vector`."""
        return self._only("slip_vector").slip_vector

    @property
    def status(self) -> NDArray[np.intp]:
        """0 open, 1 stick, 2 slip, shape (m,)."""
        return self._only("status").status

    @property
    def pressure(self) -> Array:
        """Not negative in compression, shape (m,) [stress]; see `ContactValues.pressure`."""
        return self._only("pressure").pressure

    @property
    def traction(self) -> Array:
        """Stress vector on the secondary, in global axes, shape (m, d) [stress]."""
        return self._only("traction").traction

    @property
    def friction_stress(self) -> Array:
        """Friction over tributary area along the tangents, shape (m, d-1) [stress]."""
        return self._only("friction_stress").friction_stress

    @property
    def normal_force(self) -> Array:
        """Compressive force of each point, shape (m,) [force]."""
        return self._only("normal_force").normal_force

    @property
    def tangential_force(self) -> Array:
        """Friction on the secondary along the tangents, shape (m, d-1) [force]."""
        return self._only("tangential_force").tangential_force

    @property
    def tangential_force_vector(self) -> Array:
        """Friction on the secondary in global axes, shape (m, d) [force]."""
        return self._only("tangential_force_vector").tangential_force_vector

    @property
    def forces(self) -> Array:
        """Force on the secondary at each point, in global axes, shape (m, d) [force]."""
        return self._only("forces").forces

    @property
    def force(self) -> Array:
        """Resultant on the secondary body, shape (d,) [force]."""
        return self._only("force").force

    @property
    def force_on_primary(self) -> Array:
        """Resultant on the other side, a body or a rigid obstacle, shape (d,) [force]."""
        return self._only("force_on_primary").force_on_primary

    @property
    def moment(self) -> Callable[..., Any]:
        """``moment(about)`` of the forces on the secondary; see `ContactValues.moment`."""
        return self._only("moment").moment

    @property
    def contact_area(self) -> float:
        """Area in contact, up to the edges between nodes [area]."""
        return self._only("contact_area").contact_area

    @property
    def wear_depth(self) -> Array:
        """Depth worn off so far, shape (m,) [length]; see `Archard`."""
        return self._only("wear_depth").wear_depth

    @property
    def worn_volume(self) -> float:
        """Volume worn off so far [volume]; see `Archard`."""
        return self._only("worn_volume").worn_volume

    @property
    def contact_edges(self) -> Array:
        """Where contact ends, within a facet: points (k, 2), in 3-D segments (s, 2, 3) [length]."""
        return self._only("contact_edges").contact_edges

    @property
    def error_estimate(self) -> ErrorEstimate:
        """Estimated error of pressure and friction, in 3-D a part of it; computed when asked for."""
        return self._only("error_estimate").error_estimate

    @property
    def interpolate(self) -> Callable[[ArrayLike, ArrayLike], Array]:
        """``interpolate(values, points)`` between the points; see `ContactValues.interpolate`."""
        return self._only("interpolate").interpolate

    @property
    def integrate(self) -> Callable[[ArrayLike], Any]:
        """``integrate(values)`` over the points; see `ContactValues.integrate`."""
        return self._only("integrate").integrate
