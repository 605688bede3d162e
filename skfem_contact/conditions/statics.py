"""Statics of a load: do any forces at the contact points balance it?

On the k free motions ``c`` the loads are ``Q = R'f``, and an equilibrium needs

    Q + N' lambda - T' tau = 0,    lambda >= 0,    |tau| <= mu lambda.

These forces make a cone. If ``-Q`` is outside of it, some motion separates the two (Farkas): the load
drives it, and no force that contact can give does work against it. That is a proof that there is no
equilibrium, whatever the stiffness. The other way round proves nothing where there is friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from skfem_contact.arrays import Array, Mask, largest
from skfem_contact.conditions.friction import Coulomb
from skfem_contact.conditions.interface import Interface
from skfem_contact.conditions.motions import RigidMotions
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.state import LocalState
from skfem_contact.conditions.thresholds import DIRECTIONS, LEFT_ALONG
from skfem_contact.digits import SINGLE, SOLVED


def load_on(motions: RigidMotions, f: Array) -> tuple[Array, float]:
    """Load on each free motion (k,), and the sum of the sizes of its parts, to judge it by [force]."""
    return motions.modes.T @ f, float(np.max(np.abs(motions.modes.T) @ np.abs(f), initial=0.0))


def drives(motions: RigidMotions, f: Array, free: Array, beyond: float = SOLVED) -> bool:
    """Return whether a load does work on some of these motions (k, j), beyond a share of its parts."""
    Q, size = load_on(motions, f)
    return bool(np.max(np.abs(free.T @ Q), initial=0.0) > beyond * size)


def escape(motions: RigidMotions, interface: Interface, paired: Mask, f: Array) -> Array | None:
    """A motion that the load drives and that no contact force can stop; None if there is none.

    Parameters
    ----------
    motions : RigidMotions
    interface : Interface
        Laws of the points. Bounds that do not follow from the normal force alone count as endless.
    paired : ndarray of bool, shape (m,)
        Points that may carry a force.
    f : ndarray, shape (n,)
        Load [force].

    Returns
    -------
    ndarray, shape (k,), or None
    """
    from scipy.optimize import linprog  # half of scipy's import time, for a rare question

    Q, size = load_on(motions, f)
    if size == 0.0:
        return None
    G = _cone(motions, interface, paired)
    one = np.eye(motions.k)
    cost = np.concatenate([np.zeros(G.shape[1]), np.ones(2 * motions.k)])
    found = linprog(
        cost,
        A_eq=np.hstack([G, one, -one]),
        b_eq=-Q / size,
        method="highs",
        options={"primal_feasibility_tolerance": SOLVED, "dual_feasibility_tolerance": SOLVED},
    )
    if found.status != 0 or found.fun <= SOLVED:
        return None
    c = -np.asarray(found.eqlin.marginals)
    proven = np.min(c @ G, initial=0.0) > -SOLVED and c @ Q > 0.5 * SOLVED * size
    return c if proven else None


def _cone(motions: RigidMotions, interface: Interface, paired: Mask) -> Array:
    """Forces on the free motions that contact points can give, as columns of length one, (k, g)."""
    grip = friction_coefficients(interface, len(paired))
    normal, tied = motions.normal, interface.tied & paired
    both_ways = interface.bilateral & paired
    columns = [normal[both_ways].T, -normal[both_ways].T]
    smooth = paired & ~tied & ~(grip > 0)
    endless = paired & ~tied & np.isinf(grip)
    columns += [normal[smooth].T, normal[endless].T]
    rough = paired & ~tied & (grip > 0) & np.isfinite(grip)
    if (tied | endless | rough).any():
        tangential = motions.tangential
        for k in range(tangential.shape[1]):
            both = tangential[tied | endless, k].T
            columns += [both, -both]
        for direction in _directions(tangential.shape[1]):
            along = np.einsum("ikj,k->ij", tangential[rough], direction)
            columns.append((normal[rough] + grip[rough, None] * along).T)
    G = np.concatenate(columns, axis=1)
    size = np.linalg.norm(G, axis=0)
    return np.asarray(G[:, size > 0] / size[size > 0])


def _directions(tangents: int) -> Sequence[Array]:
    if tangents == 1:
        return [np.array([1.0]), np.array([-1.0])]
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return list(np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / DIRECTIONS))


def friction_coefficients(interface: Interface, m: int) -> Array:
    """Largest friction over normal force at every point: endless for laws with cohesion, (m,)."""
    grip = np.zeros(m)
    for contact, part in zip(interface.contacts, interface.point_slices, strict=True):
        law = contact.friction
        grip[part] = np.inf
        if isinstance(law, Coulomb) and type(law) is Coulomb and not np.any(law.cohesion):
            grip[part] = law.mu
        # along the axes of the rows, in which the ellipse is the circle of the larger coefficient
        if type(law) is OrthotropicCoulomb and not np.any(law.cohesion):
            grip[part] = law.larger
    return np.where(interface.frictional, grip, 0.0)


def balanced(
    motions: RigidMotions, f: Array, state: LocalState, noise: float, carried: float = 0.0
) -> bool:
    """Return whether loads and contact forces balance along the motions that supports leave free.

    A body that is hardly held may move by 1e10 of its size: then the round-off of its ``K u`` carries
    any load, equilibrium is met to all digits of that, and nothing balances the load. `noise` and
    `carried` are round-off of the forces in the softest and in the stiffest body that moves no further
    than supports do [force].
    """
    if motions.k == 0:
        return True
    force, friction = state.normal_force, state.tangential_force.ravel()  # zero at open points
    left = motions.normal.T.dot(force) + motions.modes.T.dot(f)
    rubs = bool(np.count_nonzero(friction))
    if rubs:
        left -= motions.tangential.reshape(-1, motions.k).T.dot(friction)
    left = np.abs(left)
    # along a motion that nothing pushes there is only the round-off of what acts across it; the largest
    # displacement of each motion is one. Nearly always the rest need not be looked at
    if largest(left) <= SOLVED * float(np.abs(force).sum()):
        return True
    parts = [(motions.normal, force), (motions.modes, f)]
    if rubs:
        parts.append((motions.tangential.reshape(-1, motions.k), friction))
    across = sum(float(np.abs(values).sum()) for _, values in parts)
    size = sum(np.abs(rows).T @ np.abs(values) for rows, values in parts)
    least = np.maximum(LEFT_ALONG * size, max(SOLVED * across, noise * len(f)))
    least = np.maximum(least, min(carried, SINGLE * across))
    return bool(np.all(left <= least))
