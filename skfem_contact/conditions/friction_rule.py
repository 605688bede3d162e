r"""The return map of friction, and the rule at all points: the laws of all contacts as one.

The return map is what a law makes of a trial force ``t``: within the bound ``L`` it is the friction
force; beyond it is brought back onto the circle (in the plane: onto the interval) of radius ``L``,
along itself ([M] eq. (11)):

    tau = L d,   d = t / |t|,        d tau = L / |t| (1 - d d') dt + d dL,
                                     dL = dL/dlambda dlambda + dL/ds . ds .

With one tangent ``1 - d d'`` is zero: the direction of friction does not turn.

A bound that is a line in the normal force, with a cap, is three numbers at each point: those of all
contacts are put together once, and asked as arrays. `FrictionRule` asks other laws by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from skfem_contact.arrays import Array, Index, Mask, lengths, unit_vectors
from skfem_contact.digits import SINGLE

# A trial force beyond any bound, for points that slip in a known direction. A power of two, so that the
# force on the bound has no round-off; and its fourth power is still a number.
BEYOND = 2.0**250


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
    trial: Array, limit: Array, slope: Array, slip: Array, at: Callable[[Array], Array] | None
) -> Mapped:
    """The return map of a law that is given by its bound; see `FrictionLaw.return_map`.

    Parameters
    ----------
    trial, slip : ndarray, shape (m, d-1)
    limit, slope : ndarray, shape (m,)
        The bounds, and their derivatives by the normal force.
    at : callable or None
        Gives the bounds (m,) at a slip (m, d-1), if they depend on it.
    """
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
    by_normal = slope[:, None] * direction
    by_slip = np.zeros(by_trial.shape)
    if at is not None:
        by_slip = direction[:, :, None] * slip_gradient(at, limit, slip, direction)[:, None, :]
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
    step = SINGLE * float(np.max(np.abs(slip), initial=0.0))
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


class LinearBound(NamedTuple):
    """Bounds ``min(mu lambda + least, cap)`` of friction forces, numbers or one per point (m,).

    Attributes
    ----------
    mu : float or ndarray
    least, cap : float or ndarray
        [force]

    Examples
    --------
    >>> LinearBound(0.5, 1.0, 4.0).at(np.array([2.0, 10.0]))
    array([2., 4.])
    """

    mu: Any
    least: Any
    cap: Any

    def at(self, normal_force: Array) -> Array:
        """Bounds under normal forces, (m,) [force]."""
        return np.asarray(np.minimum(self.mu * normal_force + self.least, self.cap))

    def slope(self, normal_force: Array) -> Array:
        """Their derivatives by the normal force, (m,)."""
        if self.cap is np.inf:
            return np.full(len(normal_force), self.mu, dtype=float)
        return np.where(self.mu * normal_force + self.least >= self.cap, 0.0, self.mu)


#: The points of each law, and the law: a `friction.CheckedLaw`, which stands above this module.
Laws = Sequence[tuple[slice, Any]]


class FrictionRule:
    """Friction at all points: the laws of all contacts, asked as one; zero where there is none.

    It alone answers what friction makes of a trial force (`project`), how that changes (`mapped`),
    which points slip, and by how much a force is off the law (`excess`).

    Parameters
    ----------
    laws : tuple of (slice, CheckedLaw)
        The points of each law.
    area : ndarray, shape (m,)
        Tributary areas [area].
    reference : ndarray, shape (m, d-1)
        Slip at which each point closed, from which laws count it [length].

    Attributes
    ----------
    steady : bool
        Whether no bound changes with the slip: see `CheckedLaw.steady`.
    by_bound : bool
        Whether all laws are given by their bounds.

    Examples
    --------
    >>> from skfem_contact.conditions.friction import CheckedLaw, Coulomb
    >>> law = CheckedLaw(Coulomb(0.5), "joint", np.zeros((1, 2)))
    >>> rule = FrictionRule(((slice(0, 1), law),), np.ones(1), np.zeros((1, 1)))
    >>> rule.project(np.array([[-3.0]]), np.array([2.0]), np.zeros((1, 1)))
    (array([[-1.]]), array([ True]), array([1.]))
    """

    def __init__(self, laws: Laws, area: Array, reference: Array) -> None:
        self.laws, self.area, self.reference, m = laws, area, reference, len(area)
        lines = [(part, law.law.by_pressure(area[part])) for part, law in laws if law.steady]
        self._asked_alone = [(part, law) for part, law in laws if not law.steady]
        self.steady = not self._asked_alone
        self.by_bound = all(law.by_bound for _, law in laws)
        if len(lines) == 1 and lines[0][0] == slice(0, m):
            self._line = lines[0][1]
        else:
            self._line = LinearBound(np.zeros(m), np.zeros(m), np.full(m, np.inf))
            for part, line in lines:
                for whole, values in zip(self._line, line, strict=True):
                    whole[part] = values

    def since(self, reference: Array) -> FrictionRule:
        """The same laws at points that closed at other slips (m, d-1)."""
        rule = object.__new__(FrictionRule)
        vars(rule).update(vars(self), reference=reference)
        return rule

    def bound(self, normal_force: Array, slip: Array) -> Array:
        """Bound of the friction force of every point, (m,) [force]."""
        pressing = np.maximum(normal_force, 0.0)
        # areas of points that carry nothing, vertices of quadratic faces by mortar, may be negative
        bound = np.maximum(self._line.at(pressing), 0.0)
        for part, law in self._asked_alone:
            bound[part] = law.limit(*self._counted(part, pressing, slip))
        return bound

    def slope(self, normal_force: Array, slip: Array) -> Array:
        """Derivative of the bound by the normal force, (m,)."""
        pressing = np.maximum(normal_force, 0.0)
        slope = self._line.slope(pressing)
        for part, law in self._asked_alone:
            slope[part] = law.slope(*self._counted(part, pressing, slip))
        return slope

    def project(self, trial: Array, normal_force: Array, slip: Array) -> tuple[Array, Mask, Array]:
        """Friction forces (m, d-1) of trial forces, which points slip, and bounds, (m,) each."""
        bound = self.bound(normal_force, slip)
        if self.by_bound:
            return *radial_return(trial, bound), bound
        return *self.mapped(trial, normal_force, slip)[:2], bound

    def mapped(self, trial: Array, normal_force: Array, slip: Array) -> Mapped:
        """The same forces and points, and the derivatives of the forces."""
        pressing = np.maximum(normal_force, 0.0)
        limit, slope = np.maximum(self._line.at(pressing), 0.0), self._line.slope(pressing)
        force, slips, by = map_by_bound(trial, limit, slope, slip, None)
        for part, law in self._asked_alone:
            given = self._counted(part, pressing, slip)
            force[part], slips[part], own_by = law.return_map(trial[part], *given)
            for whole, values in zip(by, own_by, strict=True):
                whole[part] = values
        return force, slips, by

    def slipping(
        self, direction: Array, size: Array | float, normal_force: Array, slip: Array
    ) -> Mapped:
        """As `mapped`, of points that slip under trial forces of a size, (m, 1), along `direction`."""
        if direction.shape[1] > 1 or not self.steady:
            return self.mapped(size * direction, normal_force, slip)
        # along the only tangent the force is the bound, whatever the trial force is
        still = np.zeros((len(direction), 1, 1))
        by = Derivatives(still, self.slope(normal_force, slip)[:, None] * direction, still)
        return direction * self.bound(normal_force, slip)[:, None], direction[:, 0] != 0, by

    def hardens(self, direction: Array, normal_force: Array, slip: Array) -> Mask:
        """Points whose bound grows with slip along `direction`: a spring along it, (m,)."""
        if self.steady:
            return np.zeros(len(direction), dtype=bool)
        return grows(self.mapped(BEYOND * direction, normal_force, slip)[2])

    def excess(self, trial: Array, normal_force: Array, slip: Array) -> Array:
        """Return the distance of trial forces (m, d-1) from the forces they are mapped to, (m,)."""
        if self.by_bound:
            return np.maximum(lengths(trial) - self.bound(normal_force, slip), 0.0)
        return lengths(trial - self.project(trial, normal_force, slip)[0])

    def _counted(self, part: slice, pressing: Array, slip: Array) -> tuple[Array, Array, Array]:
        """Return what a law is asked with: normal force, area, slip since its points closed."""
        return pressing[part], self.area[part], slip[part] - self.reference[part]


def grows(by: Derivatives) -> Mask:
    """Points whose bound grows with the slip, (m,)."""
    return np.asarray(np.einsum("ikk->i", by.slip) > 0)


class Slid(Protocol):
    """A state of friction at the points along the tangents of a pairing; see `state.LocalState`."""

    status: Index
    area: Array
    reference: Array
    slip: Array
    normal_force: Array
    tangential_force: Array


def friction_bound(laws: Laws, state: Slid, rule: FrictionRule | None = None) -> Array:
    """Bound of the friction force in a state by the present laws; zero at open points, (m,).

    `rule` has these laws on a pairing, which may be that of the state.
    """
    if rule is None or rule.area is not state.area:
        rule = FrictionRule(laws, state.area, state.reference)
    bound = rule.since(state.reference).bound(state.normal_force, state.slip)
    return np.where(state.status > 0, bound, 0.0)


def resisting_slips(laws: Laws, state: Slid, slips: Mask) -> Mask:
    """Those of points that slip against a bound that grows with the slip: a spring along it, (m,)."""
    if all(law.steady for _, law in laws):
        return np.zeros(len(slips), dtype=bool)
    rule = FrictionRule(laws, state.area, state.reference)
    direction = unit_vectors(state.tangential_force)
    return slips & rule.hardens(direction, state.normal_force, state.slip)


def jumps_open(laws: Laws, area: Array, tangents: int, opens: Mask) -> bool:
    """Whether some friction bound is not zero where nothing presses: it jumps where a point opens."""
    still, none = np.zeros((len(area), tangents)), np.zeros(len(area))
    return bool(np.any(FrictionRule(laws, area, still).bound(none, still)[opens] > 0))
