r"""The return map of friction: what it makes of a trial force, and how that changes.

A law bounds the friction force of a point, ``|tau| <= L(lambda)``; the point sticks below the
bound and slips on it. A trial force ``t`` within the bound ``L`` is the friction force; one beyond it
is brought back onto the circle (in the plane: onto the interval) of radius ``L``, along itself ([M]
eq. (11); [M] is V. L. Marchenko, 2014):

    tau = L d,   d = t / |t|,        d tau = L / |t| (1 - d d') dt + d dL,
                                     dL = dL/dlambda dlambda + dL/ds . ds .

With one tangent ``1 - d d'`` is zero: the direction of friction does not turn.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import numpy as np

from skfem_contact.arguments import numbers, shown
from skfem_contact.arrays import Array, Mask, lengths
from skfem_contact.conditions.thresholds import AGREE, DIFFERENCE
from skfem_contact.errors import InputError


class Derivatives(NamedTuple):
    """Derivatives of friction forces, component by component of the force.

    Attributes
    ----------
    trial : ndarray, shape (m, d-1, d-1)
        By the trial force.
    normal_force : ndarray, shape (m, d-1)
    slip : ndarray, shape (m, d-1, d-1)
        By the slip that the bound depends on [force/length].
    """

    trial: Array
    normal_force: Array
    slip: Array


Mapped = tuple[Array, Mask, Derivatives]


class Bound(Protocol):
    """A law by its bound; see `FrictionLaw`."""

    def limit(self, normal_force: Array, area: Array, slip: Array, /) -> Array: ...

    def slope(self, normal_force: Array, area: Array, slip: Array, /) -> Array: ...


def radial_return(trial: Array, limit: Array) -> tuple[Array, Mask]:
    """Bring a trial friction force back onto the friction cone ([M] eq. (11)).

    Parameters
    ----------
    trial : ndarray, shape (m, d-1)
        Elastic predictor ``tau_n + G (s - s_n)`` [force].
    limit : ndarray, shape (m,)
        Friction bound [force].

    Returns
    -------
    tangential : ndarray, shape (m, d-1)
        `trial` where it is admissible, else its projection onto the circle of radius `limit`.
    slips : ndarray of bool, shape (m,)

    Examples
    --------
    >>> radial_return(np.array([[3.0, 4.0], [0.3, 0.4]]), np.array([1.0, 1.0]))
    (array([[0.6, 0.8],
           [0.3, 0.4]]), array([ True, False]))
    """
    if trial.shape[1] == 1:
        force = np.copysign(np.minimum(np.abs(trial), limit[:, None]), trial)
        return force, np.abs(trial[:, 0]) > limit
    size = lengths(trial)
    slips = size > limit
    kept = np.divide(limit, size, out=np.ones(len(trial)), where=slips)
    return trial * kept[:, None], slips


def map_by_bound(
    law: Bound, trial: Array, normal_force: Array, area: Array, slip: Array, hardens: bool = True
) -> Mapped:
    """The return map of a law that is given by its bound; see `FrictionLaw.return_map`.

    Parameters
    ----------
    law : Bound
    trial, slip : ndarray, shape (m, d-1)
    normal_force, area : ndarray, shape (m,)
    hardens : bool
        Whether the bound depends on the slip.
    """
    limit = np.asarray(law.limit(normal_force, area, slip))
    if trial.shape[1] == 1:  # nothing turns: along the only tangent what slips has its bound
        force, slips = radial_return(trial, limit)
        direction, by_trial = np.sign(trial) * slips[:, None], (~slips)[:, None, None].astype(float)
    else:
        size = lengths(trial)
        slips = size > limit
        kept = np.divide(limit, size, out=np.ones(len(trial)), where=slips)[:, None]
        force = trial * kept
        direction = np.divide(trial, size[:, None], out=np.zeros(trial.shape), where=slips[:, None])
        by_trial = np.eye(trial.shape[1]) - direction[:, :, None] * direction[:, None, :]
        by_trial *= kept[:, :, None]
    by_normal = law.slope(normal_force, area, slip)[:, None] * direction
    by_slip = np.zeros(by_trial.shape)
    if hardens:
        ask = partial(law.limit, normal_force, area)
        by_slip = direction[:, :, None] * slip_gradient(ask, limit, slip, direction)[:, None, :]
    return force, slips, Derivatives(by_trial, by_normal, by_slip)


def slip_gradient(limit: Callable[[Array], Array], here: Array, slip: Array, direction: Array) -> Array:
    """Derivative of a bound by the slip where points slip, shape (m, d-1): difference quotients.

    Along `direction` it is that ahead: where slip begins, a bound that depends on its size has a kink.
    Across it is the mean of both sides.

    Parameters
    ----------
    limit : callable
        Gives the bounds (m,) at a slip (m, d-1).
    here : ndarray, shape (m,)
        The bounds at `slip`.
    direction : ndarray, shape (m, d-1)
        Unit directions of friction; zero where nothing slips.
    """
    step = DIFFERENCE * float(np.max(np.abs(slip), initial=0.0))
    if step == 0.0:
        return np.zeros_like(direction)
    ahead = np.asarray((limit(slip + step * direction) - here) / step)
    gradient = ahead[:, None] * direction
    if direction.shape[1] == 1:  # one tangent: nothing is across
        return gradient
    slides = np.linalg.norm(direction, axis=1) > 0
    for k, axis in enumerate(np.eye(direction.shape[1])):
        across = step * np.where(slides[:, None], axis - direction * direction[:, k, None], 0.0)
        difference = limit(slip + across) - limit(slip - across)
        gradient[:, k] += difference / (2 * step)
    return gradient


def mapped_arrays(found: Any, name: str, trial: Array) -> Mapped:
    """Return what a user's return map gave, as arrays of the shapes that they must have.

    Raises
    ------
    InputError
        It is something else.
    """
    m, t = trial.shape
    usage = "it must return (force, slips, (by_trial, by_normal_force, by_slip)), all of them arrays"
    what = f"what {name} returned"
    try:
        force, slips, (by_trial, by_normal, by_slip) = found
    except (TypeError, ValueError):
        raise InputError(f"{what} is {shown(found)}; {usage}") from None
    slips = np.asarray(slips)
    if slips.shape != (m,) or slips.dtype != bool:
        raise InputError(f"slips of {what} is {shown(slips)}, not one True or False for each point")
    given = {"force": force, "by_trial": by_trial, "by_normal_force": by_normal, "by_slip": by_slip}
    shapes = (m, t), (m, t, t), (m, t), (m, t, t)
    arrays = []
    for (part, value), shape in zip(given.items(), shapes, strict=True):
        array = numbers(value, f"{part} of {what}", usage)
        if array.shape != shape:
            raise InputError(
                f"{part} of {what} has shape {array.shape} for {m} points with {t} tangent"
                f"{'s' if t > 1 else ''}, where it must have shape {shape}; {usage}"
            )
        arrays.append(array)
    return arrays[0], slips, Derivatives(*arrays[1:])


def unlawful(trial: Array, limit: Array, force: Array, slips: Mask, by: Derivatives) -> Mask:
    """Points where a return map is none: off the bound where it slips, or not finite, (m,)."""
    size, wanted = np.linalg.norm(force, axis=1), np.linalg.norm(trial, axis=1)
    alike = AGREE * np.max(limit[np.isfinite(limit)], initial=0.0)
    slides = (np.abs(size - limit) <= alike) & (wanted >= limit - alike)
    for array in by:
        slides &= np.isfinite(array).reshape(len(array), -1).all(axis=1)
    sticks = (np.linalg.norm(force - trial, axis=1) <= alike) & (wanted <= limit + alike)
    return ~np.where(slips, slides, sticks)
