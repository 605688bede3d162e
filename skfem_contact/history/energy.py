"""The energy that friction takes between two states, and the bounds of its forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skfem_contact.arrays import lengths
from skfem_contact.conditions.friction_rule import FrictionRule
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.state import OPEN, SLIP, LocalState

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(eq=False)
class Energy:
    """Energies of the way so far, per contact [energy].

    Attributes
    ----------
    lost : ndarray
        By friction, see `friction_energy`.
    residual : ndarray
        What the energy balance misses.
    """

    lost: Array
    residual: Array

    def __add__(self, other: Energy) -> Energy:
        return Energy(self.lost + other.lost, self.residual + other.residual)


def friction_energy(
    interface: Interface, last: LocalState, new: LocalState, plastic: Array, bound: Array
) -> Energy:
    r"""Energy that friction takes between two states, and what the energy balance misses.

    On its plastic slip ``s_p`` a point loses the mean of its friction bounds at both ends,

        ``D = (L_n + L_n+1) / 2 |s_p|``,      ``L = 0`` where it is open,

    never less than nothing; exact where the bound is constant, also if the slip turns round, and
    where bound and slip grow in proportion. The forces themselves do other work in steps so large
    that they do not follow their bounds, and so do the pressures of points that close or open: with
    the loads' work ``W`` by the trapezoidal rule and the elastic energy ``U``,

        ``W = U_n+1 - U_n + D + residual``.

    Friction and opening make the residual: it is of second order in the step, and takes no ``K u``.
    Overlaps of the meshes count as misfit that the loads' work has in it. `plastic` and `bound` are the
    `plastic_slip` between the two and the `friction_bound` of the new one.
    """
    bounds, way = friction_bound(interface, last) + bound, lengths(plastic)
    friction = last.tangential_force + new.tangential_force
    pressing = last.normal_force + new.normal_force
    found = nothing(interface)
    for k, part in enumerate(interface.point_slices):  # the means are halves of sums
        found.lost[k] = 0.5 * bounds[part].dot(way[part])
        found.residual[k] = 0.5 * np.vdot(friction[part], plastic[part]) - found.lost[k]
    opens = (pressing != 0) & ((new.gap > 0) | (last.gap > 0))
    if np.count_nonzero(opens):
        # points without partner have no gap, also one that finds or loses it between the two states
        opens &= np.isfinite(new.gap) & np.isfinite(last.gap)
        moved = np.zeros(len(opens))
        moved[opens] = np.maximum(new.gap[opens], 0.0) - np.maximum(last.gap[opens], 0.0)
        for k, part in enumerate(interface.point_slices):
            found.residual[k] -= 0.5 * (pressing[part] @ moved[part])
    return found


def plastic_slip(interface: Interface, last: LocalState, new: LocalState) -> Array:
    """Slip between two states that a finite tangential stiffness does not give back, (m, d-1)."""
    G = interface.stiffness[:, None]
    elastic = (new.tangential_force - last.tangential_force) / G  # zero where sticking is exact
    return np.where(interface.frictional[:, None], new.slip - last.slip - elastic, 0.0)


def friction_bound(interface: Interface, state: LocalState) -> Array:
    """Bound of the friction force in a state by the present laws; zero at open points, (m,)."""
    rule = FrictionRule(interface.laws, state.area, state.reference)
    bound = rule.bound(state.normal_force, state.slip)
    return np.where(state.status == OPEN, 0.0, bound)


def resisting_slips(interface: Interface, state: LocalState) -> Mask:
    """Points that slip against a bound that grows with the slip: a spring along it, (m,)."""
    rule, slips = FrictionRule(interface.laws, state.area, state.reference), state.status == SLIP
    if rule.steady or not np.count_nonzero(slips):
        return np.zeros(len(slips), dtype=bool)
    size = lengths(state.tangential_force)
    direction = state.tangential_force / np.where(size > 0, size, 1.0)[:, None]
    return slips & rule.hardens(direction, state.normal_force, state.slip)


def rough_at_rest(interface: Interface, area: Array, tangents: int) -> bool:
    """Whether some friction bound is not zero where nothing presses: it jumps where a point opens."""
    still = np.zeros((len(area), tangents))
    bound = FrictionRule(interface.laws, area, still).bound(np.zeros(len(area)), still)
    return bool(np.any(bound[~interface.bilateral] > 0))  # what is bilateral never opens


def nothing(interface: Interface) -> Energy:
    """No energy lost."""
    contacts = len(interface.point_slices)
    return Energy(np.zeros(contacts), np.zeros(contacts))
