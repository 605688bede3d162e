"""One contact node: all equilibria by enumeration, and when there is only one of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skfem_contact.errors import InputError
from skfem_contact.reference._check import not_negative, positive

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """One solution of the contact problem of one node.

    Attributes
    ----------
    status : str
        "open", "stick" or "slip".
    u, reaction : ndarray, shape (2,)
        Displacement, and force of the obstacle on the node: tangential, normal.
    """

    status: str
    u: Array
    reaction: Array


def triangle_stiffness(points: ArrayLike, E: float, nu: float) -> Array:
    """Stiffness (2, 2) of the first node of a linear triangle, the others clamped; plane strain.

    Parameters
    ----------
    points : array_like, shape (3, 2)
        Corners in either sense of rotation; unit thickness.

    Examples
    --------
    >>> print(triangle_stiffness(ONE_NODE_TRIANGLE, 1.0, 0.3).round(8))
    [[0.5982906  0.39974972]
     [0.39974972 1.13247863]]
    """
    positive(E=E)
    x = np.asarray(points, dtype=float)
    edges = x[1:] - x[0]
    double_area = abs(np.linalg.det(edges))
    if double_area == 0:
        raise InputError(f"points = {x.tolist()} lie on one line.")
    # gradient of the first shape function: minus the sum of those of the other two
    gradient = -np.linalg.solve(edges, np.ones(2))
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    outer = np.outer(gradient, gradient)
    return double_area / 2 * ((lam + G) * outer + G * gradient @ gradient * np.eye(2))


# first node on the obstacle y >= 0; E = 1, nu = 0.3 gives the example of the docstrings
ONE_NODE_TRIANGLE = (
    (0.0, 0.0),
    (1.3533216244792285, 0.4105125828971653),
    (-0.4105125828971653, 1.3533216244792285),
)


def one_node_equilibria(K: ArrayLike, f: ArrayLike, mu: float) -> list[Equilibrium]:
    """Return every equilibrium of one node above an obstacle, found branch by branch.

    From the unloaded state, no slip before: ``K u = f + r``; open (``r = 0``, ``u_n > 0``),
    stick (``u = 0``, ``|r_t| <= μ r_n``), slip either way (``u_n = 0``,
    ``r_t = -μ r_n sign(u_t)``).

    Parameters
    ----------
    K : array_like, shape (2, 2)
        Stiffness, tangential component first.
    f : array_like, shape (2,)
        Load.
    mu : float
        Coefficient of friction.

    Examples
    --------
    Three answers to one question (friction is above the critical value 1.497):

    >>> K = triangle_stiffness(ONE_NODE_TRIANGLE, 1.0, 0.3)
    >>> for answer in one_node_equilibria(K, [-1.75, -1.0], mu=2.0):
    ...     print(answer.status, answer.u.round(8) + 0.0)
    open [-3.05568975 0.1955985 ]
    stick [0. 0.]
    slip [-1.24249012 0. ]
    """
    not_negative(mu=mu)
    K, f = np.asarray(K, dtype=float), np.asarray(f, dtype=float)
    found = []
    u = np.linalg.solve(K, f)
    if u[1] > 0:
        found.append(Equilibrium("open", u, np.zeros(2)))
    if f[1] <= 0 and abs(f[0]) <= -mu * f[1]:
        found.append(Equilibrium("stick", np.zeros(2), -f))
    for sign in (1.0, -1.0):
        stiffness = K[0, 0] + sign * mu * K[1, 0]
        if stiffness == 0:
            continue
        u_t = (f[0] + sign * mu * f[1]) / stiffness
        r_n = K[1, 0] * u_t - f[1]
        if sign * u_t > 0 and r_n >= 0:
            reaction = np.array([-sign * mu * r_n, r_n])
            found.append(Equilibrium("slip", np.array([u_t, 0.0]), reaction))
    return found


def critical_friction(K: ArrayLike) -> float:
    """Friction ``K_tt/|K_tn|`` below which one node has one equilibrium for every load.

    Examples
    --------
    >>> K = triangle_stiffness(ONE_NODE_TRIANGLE, 1.0, 0.3)
    >>> print(f"{critical_friction(K):.10f}")
    1.4966629547
    """
    K = np.asarray(K, dtype=float)
    return float("inf") if K[0, 1] == 0 else float(K[0, 0] / abs(K[0, 1]))


def worst_triangle_friction(nu: float) -> float:
    """Least critical friction of any linear triangle, ``2 sqrt(2 (1-ν) (1-2ν))`` (plane strain).

    Examples
    --------
    >>> print([round(worst_triangle_friction(nu), 3) for nu in (0.0, 0.3, 0.45, 0.49)])
    [2.828, 1.497, 0.663, 0.286]
    """
    return 2 * math.sqrt(2 * (1 - nu) * (1 - 2 * nu))
