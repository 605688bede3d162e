r"""Friction with two coefficients: along a material direction (grain, rolling, grooves) and across it.

The bound is an ellipse in the tangent plane, and slip is normal to it (the associated rule):

    (tau_1 / mu_1)^2 + (tau_2 / mu_2)^2 <= lambda^2,
    tau_i = mu_i^2 v_i lambda / sqrt(mu_1^2 v_1^2 + mu_2^2 v_2^2)      for a slip v.

With the ratios ``r_i = mu_i / mu`` to the larger coefficient, slips ``r_i s_i`` and forces
``tau_i / r_i`` do the same work, the ellipse is a circle, and the rule is that of Coulomb's law. So
slips are taken along axes scaled like that (`Kinematics.axes`), and whatever is made of slips and
forces (loops, routes, energies, the certificate) is that of isotropic friction. With the axes ``d_1``
(along) and ``d_2`` (across) of the ellipse, components of the slip s along any two vectors ``e_k`` with

    (e_1 . s)^2 + (e_2 . s)^2 = (r_1 d_1 . s)^2 + (r_2 d_2 . s)^2

make a circle of it; ``e_k = r_k d_k`` is one choice of many. They are combinations of the tangents of
the pairing of which one is a multiple of a single tangent: of the one that supports hold, if they hold
one, so that no row is half held. With one coefficient they are the tangents themselves.

References
----------
R. Michalowski, Z. Mroz, Arch. Mech. 30 (1978) 259-276: ellipse and associated rule.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skfem_contact.arguments import numbers, shown, with_known_keywords
from skfem_contact.arrays import Array, Mask
from skfem_contact.bodies.selection import written
from skfem_contact.conditions.friction import Coulomb, LinearLaw
from skfem_contact.conditions.friction_rule import LinearBound
from skfem_contact.digits import SOLVED
from skfem_contact.errors import InputError
from skfem_contact.pairing.node import Pairing
from skfem_contact.records import carried, dataclass, kept, sealed

# Least ratio of two coefficients of friction. Rows of slips are multiplied by it, and have to stay far
# above GIVEN, below which a row counts as prescribed.
SMOOTHEST = 1e-3

# Sine of the angle to the normal below which a direction has no projection to speak of: half a degree,
# where the turns that a body makes under load decide where it points.
NO_PROJECTION = 1e-2

COEFFICIENTS = "OrthotropicCoulomb: mu"
PAIR = "give the coefficients along the direction and across it, mu=(mu_1, mu_2), or an array (m, 2)"
DIRECTION = "OrthotropicCoulomb: direction"
VECTORS = (
    "give 3 numbers, an array (m, 3) with a vector per point, or a function of x, (3, m) -> (3, m)"
)


@with_known_keywords(
    mu_1="write mu=(mu_1, mu_2)",
    mu1="write mu=(mu1, mu2)",
    axis="write direction",
    grain="write direction",
    ratio="write mu=(mu_1, mu_2)",
)
@dataclass(frozen=True, eq=False)
class OrthotropicCoulomb(LinearLaw):
    r"""Coulomb friction in space with other coefficients along a material direction than across it.

    Friction of a point lies within the ellipse ``(tau_1 / mu_1)^2 + (tau_2 / mu_2)^2 <= lambda^2``
    with the normal force ``lambda``. Where it slips it is on the ellipse, and the slip is normal to it
    (the associated rule of Michalowski and Mroz): a slip `v` is resisted by
    ``tau_i = mu_i^2 v_i lambda / sqrt(mu_1^2 v_1^2 + mu_2^2 v_2^2)``. So friction is against the slip
    for slips along the two axes only, and else turned towards the rough one.

    Parameters
    ----------
    mu : (float, float), or ndarray of shape (m, 2)
        Coefficients along the direction and across it; both positive, neither more than a thousand
        times the other.
    direction : vector of 3 numbers, ndarray of shape (m, 3), or callable
        The direction of the first coefficient on the secondary surface, of any length and sign. What of
        it is along the normal of a point does not count. A callable takes the component-first positions
        (3, m) of the undeformed points and returns vectors (3, m).
    tau_max : (float, float), optional
        Caps of the friction stress along and across [stress].
    cohesion : (float, float), optional
        Shear strengths at zero pressure along and across [stress]. An ellipse keeps its shape: both
        pairs have to be in the ratio of the coefficients.

    Raises
    ------
    InputError
        If a parameter is not that. From `Contact` where the contact is in the plane, and from the
        solver where the direction is normal to the surface.

    Notes
    -----
    Of a contact with this friction ``values.tangent``, and with it the components of slip and friction,
    are along the direction and across it.

    `limit` is the bound along the rougher of the two axes. So is `stiffness`, if there is one: along
    the other axis it is smaller by the square of the ratio of the coefficients.

    The direction is fixed to the secondary body, which rotates little: with ``sliding="finite"`` it is
    projected onto the tangent plane of each place that a point comes to. Of two bodies make the one
    with the grain the secondary.

    Examples
    --------
    A block dragged at 45 degrees to grooves, across which there is three times as much friction:

    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshHex().with_boundaries({"low": lambda x: x[2] == 0, "high": lambda x: x[2] == 1})
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementHex1()), intorder=2)
    >>> drag = {"high": (10.0, 10.0, -0.01)}
    >>> block = sc.Body(basis, linear_elasticity(0.0, 0.5), D="high", x=drag, name="block")
    >>> law = sc.conditions.OrthotropicCoulomb(mu=(0.1, 0.3), direction=(1, 0, 0))
    >>> foot = sc.Contact(block.surface("low"), sc.RigidPlane((0, 0, 0), (0, 0, 1)), friction=law)
    >>> force = sc.ContactSolver(block, foot).solve().force
    >>> (force / force[2]).round(3)
    array([-0.032, -0.285,  1.   ])
    """

    mu: ArrayLike
    direction: ArrayLike | Callable[[Array], ArrayLike]
    tau_max: ArrayLike = np.inf
    cohesion: ArrayLike = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("mu", "direction", "tau_max", "cohesion"):
            object.__setattr__(self, name, kept(getattr(self, name)))
        _check_coefficients(self._pairs)
        if not callable(self.direction):
            _check_direction(self.direction)
        self._circle  # noqa: B018 (checks caps and cohesion)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "direction": carried(self.direction, "direction of OrthotropicCoulomb")}

    @property
    def is_linear(self) -> bool:
        return self._circle.is_linear

    def by_pressure(self, area: Array) -> LinearBound:
        return self._circle.by_pressure(area)

    @property
    def smaller(self) -> Array:
        """The smaller of the two coefficients, one number or (m,)."""
        return np.asarray(self._pairs.min(axis=-1))

    @property
    def larger(self) -> Array:
        """The larger of the two coefficients, one number or (m,)."""
        return np.asarray(self._pairs.max(axis=-1))

    @cached_property
    def ratios(self) -> Array:
        """Both coefficients over the larger one, shape (2,) or (m, 2)."""
        return sealed(self._pairs / self._pairs.max(axis=-1, keepdims=True))

    def on(self, points: Array) -> OrthotropicCoulomb:
        """The law at the points of a surface (m, 3), with the directions that a function gives there.

        Raises
        ------
        InputError
            Arrays are for another number of points, or the function returns something else.
        """
        m = len(points)
        for name in ("mu", "direction"):
            size = np.shape(getattr(self, name))
            if len(size) == 2 and size[0] != m:
                raise InputError(
                    f"OrthotropicCoulomb: {name} has shape {size}, but the contact has {m} points; "
                    "give one for all, or one per point of the secondary surface."
                )
        if not callable(self.direction):
            return self
        found = numbers(self.direction(points.T), f"what {DIRECTION} returned", VECTORS)
        if found.shape == (3,):  # the same everywhere
            found = np.broadcast_to(found[:, None], points.T.shape)
        if found.shape != points.T.shape:
            raise InputError(
                f"{DIRECTION} returned an array of shape {found.shape} for positions of shape "
                f"{points.T.shape}; {VECTORS}"
            )
        none = ~(np.isfinite(found).all(axis=0) & found.any(axis=0))
        if none.any():
            raise InputError(
                f"{DIRECTION} is not finite, or zero, at {written(points[np.argmax(none)])}. Let the "
                "function return any direction along the surface where it has none."
            )
        return replace(self, direction=sealed(np.ascontiguousarray(found.T)))

    @cached_property
    def _pairs(self) -> Array:
        return numbers(self.mu, COEFFICIENTS, PAIR)

    @cached_property
    def _circle(self) -> Coulomb:
        """The law along the rougher axis."""
        larger = self.larger
        cap, strength = (self._of_rough(name) for name in ("tau_max", "cohesion"))
        return Coulomb(larger if larger.ndim else float(larger), cap, strength)

    def _of_rough(self, name: str) -> float:
        """The cap or cohesion along the rougher axis; both are in the ratio of the coefficients."""
        what = f"OrthotropicCoulomb: {name}"
        given = numbers(getattr(self, name), what, "give a pair of stresses, along and across")
        none = {"tau_max": np.inf, "cohesion": 0.0}[name]
        if given.shape in ((), (2,)) and (given == none).all():
            return none
        if given.shape != (2,):
            raise InputError(
                f"{what} has shape {given.shape} and has to be a pair of stresses, along the direction "
                "and across it: with one value for all directions the bound were no ellipse."
            )
        one, other = np.moveaxis(self._pairs, -1, 0)
        off = np.abs(given[0] * other - given[1] * one) > SOLVED * np.abs(given[0] * other)
        if not np.isfinite(given).all() or (given < 0).any() or off.any():
            fits = f"({given[0]:.6g}, {given[0] * float(np.ravel(other / one)[0]):.6g})"
            raise InputError(
                f"{what} = {shown(given.tolist())} does not fit mu: the ellipse keeps its shape, so "
                f"both have to be >= 0, finite, and in the ratio of the coefficients, as in {fits}."
            )
        return float(given.max())


def _check_coefficients(mu: Array) -> None:
    if mu.shape[-1:] != (2,) or mu.ndim > 2 or mu.size == 0:
        words = "For one in all directions there is Coulomb."
        raise InputError(f"{COEFFICIENTS} has shape {mu.shape}; {PAIR}. {words}")
    if not (np.isfinite(mu) & (mu > 0)).all():
        words = f"has to be positive and finite; {PAIR}"
        raise InputError(f"{COEFFICIENTS} = {shown(mu.tolist())} {words}.")
    if (mu.min(axis=-1) < SMOOTHEST * mu.max(axis=-1)).any():
        raise InputError(
            f"{COEFFICIENTS} = {shown(mu.tolist())}: one is more than {1 / SMOOTHEST:.0f} times the "
            "other. Slips are scaled by them; raise the smaller one to that, it hardly matters."
        )


def _check_direction(direction: Any) -> None:
    given = numbers(direction, DIRECTION, VECTORS)
    if given.shape[-1:] != (3,) or given.ndim > 2:
        raise InputError(f"{DIRECTION} has shape {given.shape}; {VECTORS}.")
    if not np.isfinite(given).all() or not given.any(axis=-1).all():
        raise InputError(f"{DIRECTION} is not finite, or zero; {VECTORS}.")


def material_frame(law: OrthotropicCoulomb, pairing: Pairing, label: str) -> Array:
    """Unit tangents along and across the direction of a contact's friction, shape (m, 2, 3).

    Points without partner keep the tangents of the pairing, which nothing is measured along.

    Raises
    ------
    InputError
        Where the direction is normal to the surface, or nearly so.
    """
    normal = pairing.normal
    given = np.broadcast_to(np.asarray(law.direction, dtype=float), normal.shape)
    # of any length: by a power of two first, or squares of it may be zero or infinite
    given = np.ldexp(given, -np.frexp(np.abs(given).max(axis=1))[1][:, None])
    given = given / np.linalg.norm(given, axis=1)[:, None]
    across = given - np.einsum("md,md->m", given, normal)[:, None] * normal
    size = np.linalg.norm(across, axis=1)
    known = size > NO_PROJECTION
    length = np.where(known, size, 1.0)[:, None]
    if not known[pairing.paired].all():
        worst = int(np.flatnonzero(pairing.paired & ~known)[0])
        raise InputError(
            f"contact '{label}': the direction {written(given[worst])} of its friction is "
            f"normal to the surface at point {worst} at {written(pairing.points[worst])}. It has to be "
            "along the surface; where that turns, give a function of the position."
        )
    first = np.where(known[:, None], across / length, pairing.tangent[:, 0])
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    return np.where(known[:, None, None], frame, pairing.tangent)


def combinations(frame: Array, ratios: Array, tangent: Array, first_held: Mask) -> Array:
    r"""Return the triangular matrices A (m, 2, 2) that combine the tangents to the axes.

    ``A'A = r_2^2 + (r_1^2 - r_2^2) d d'`` with the components d of the direction along the tangents.

    Parameters
    ----------
    frame : ndarray, shape (m, 2, 3)
        Along the material direction and across it.
    ratios : ndarray, shape (2,) or (m, 2)
    tangent : ndarray, shape (m, 2, 3)
        Of the pairing.
    first_held : ndarray of bool, shape (m,)
        Where supports hold the first tangent; it is an axis then, but for its length, else the second.

    Examples
    --------
    A direction along the bisector, with a ratio of 1/2:

    >>> tangent = np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    >>> frame = np.array([[[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]]]) / np.sqrt(2)
    >>> A = combinations(frame, np.array([0.5, 1.0]), tangent, np.array([False]))[0]
    >>> bool(np.allclose(A.T @ A, [[0.625, -0.375], [-0.375, 0.625]])), float(A[1, 0])
    (True, 0.0)
    """
    d = np.einsum("md,mkd->mk", frame[:, 0], tangent)
    one, other = np.moveaxis(np.broadcast_to(ratios, d.shape), -1, 0) ** 2
    metric = (one - other)[:, None, None] * d[:, :, None] * d[:, None, :]
    metric += other[:, None, None] * np.eye(2)
    # the axis that is no multiple of a single tangent, and that tangent
    mixed = np.where(first_held, 1, 0)
    rows, single = np.arange(len(d)), 1 - mixed
    length = np.sqrt(metric[rows, mixed, mixed])
    A = np.zeros(metric.shape)
    A[rows, mixed, mixed] = length
    A[rows, mixed, single] = metric[rows, 0, 1] / length
    A[rows, single, single] = np.sqrt(one * other) / length
    return A


def duals(axes: Array, normal: Array) -> Array:
    """Tangential vectors (m, 2, 3) with ``dual_k . axis_l`` one for k = l, else zero.

    Of components along the axes they make the vector again; of a force they take the components.
    """
    beside = np.stack([np.cross(axes[:, 1], normal), np.cross(normal, axes[:, 0])], axis=1)
    size = np.einsum("mkd,mkd->mk", beside, axes)[:, :, None]
    return np.divide(beside, size, out=np.zeros_like(axes), where=size != 0)  # where there is a normal
