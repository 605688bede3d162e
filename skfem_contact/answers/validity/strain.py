r"""Strains and rotations of bodies: the limits of linear bodies.

With finite sliding the frames of the contact points turn with the surfaces; the linear bodies do
not. Their stiffness and loads keep their directions, and a rotation by :math:`\theta` is a strain
:math:`\cos\theta - 1` to them. Forces that contact passes on are off by about :math:`\theta`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from skfem_contact.answers.thresholds import A_TENTH
from skfem_contact.arrays import Array
from skfem_contact.bodies.body import Body
from skfem_contact.bodies.quadrature import (
    chunks,
    element_values,
    hoop_strain,
    point_volumes,
    shape_gradients,
    with_points,
)
from skfem_contact.bodies.surface import ContactSurface
from skfem_contact.bodies.system import System
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.geometry import surface_dofs


def strains(body: Body, u: Array) -> tuple[float, float, float]:
    """Strain and rotation of a body.

    Parameters
    ----------
    body : Body
    u : ndarray, shape (n_body,)
        [length]

    Returns
    -------
    mean : float
        Largest principal strain, averaged with its own square: where most of the energy is.
    largest : float
        In any point of integration.
    rotation : float
        Root of the mean square over the body [rad].
    """
    square = cubed = turned = whole = largest = 0.0
    basis = with_points(body.basis)
    for elements in chunks(basis, 8 * basis.Nbfun * basis.X.shape[1]):
        size, turn, volume = _strained(body, basis, u, elements)
        square += float(np.sum(size**2 * volume))
        cubed += float(np.sum(size**3 * volume))
        turned += float(np.sum(turn * volume))
        whole += float(np.sum(volume))
        largest = float(np.maximum(largest, np.max(size)))  # keeps NaN
    return (cubed / square if square > 0 else 0.0), largest, float(np.sqrt(turned / whole))


def gradient(basis: Any, u: Array, elements: Any) -> Array:
    """Derivatives of the displacement at the points of integration of some elements, (d, d, e, q)."""
    moved = element_values(basis, u, elements)
    # (e, c, k) @ (e, k, q) for each coordinate j: derivatives by j of component c
    G = shape_gradients(basis, elements)
    moved_by = np.ascontiguousarray(np.moveaxis(moved, 2, 0).swapaxes(1, 2))
    return np.stack([np.moveaxis(moved_by @ G[:, j], 1, 0) for j in range(G.shape[1])], axis=1)


def _strained(body: Body, basis: Any, u: Array, elements: Any) -> tuple[Array, Array, Array]:
    """Largest principal strain, squared rotation and volume at the points of some elements, (e, q)."""
    slope, volume = gradient(basis, u, elements), point_volumes(basis, elements)
    if body.dim == 3:
        G = np.moveaxis(slope, (0, 1), (2, 3))
        other = np.swapaxes(G, 2, 3)
        size = np.abs(np.linalg.eigvalsh(0.5 * (G + other))).max(axis=2)
        # half of the squares of a skew matrix are those of its vector
        return size, np.sum((0.5 * (G - other)) ** 2, axis=(2, 3)) / 2, volume
    (a, b), (c, e) = slope
    middle, radius = 0.5 * (a + e), np.sqrt(0.25 * (a - e) ** 2 + 0.25 * (b + c) ** 2)
    size = np.abs(middle) + radius
    if body.axisymmetric:
        r = basis.mapping.F(basis.X, elements)[0]
        size, volume = np.maximum(size, np.abs(hoop_strain(basis, u, elements))), volume * r
    return size, 0.25 * (c - b) ** 2, volume


def rigid_rotations(system: System, contacts: Sequence[Contact], surface: Array) -> dict[str, float]:
    """Mean rotation of the surfaces that slide far, by body name [rad], counterclockwise.

    The angle of the rigid motion that is closest to the displacements of all nodes of a body that
    belong to such a surface; in 3-D the size of its rotation vector. Bodies without such a surface are
    left out.

    Parameters
    ----------
    system : System
    contacts : sequence of Contact
    surface : ndarray
        Displacements of the surfaces, in the order of `surface_dofs` [length].
    """
    dofs = surface_dofs(system, contacts)
    nodes: dict[int, list[tuple[Array, Array]]] = {}
    for contact in contacts:
        for side in (contact.secondary, contact.primary):
            if contact.sliding == "small" or not isinstance(side, ContactSurface):
                continue
            if side.dofs.shape[1] != side.dim:
                continue
            i = system.index(side.body)
            u = surface[np.searchsorted(dofs, system.offsets[i] + side.dofs)]
            nodes.setdefault(i, []).append((side.points, u))
    angles = {}
    for i, pairs in sorted(nodes.items()):
        x = np.concatenate([points for points, _ in pairs])
        y = x + np.concatenate([u for _, u in pairs])
        x, y = x - x.mean(axis=0), y - y.mean(axis=0)
        if x.shape[1] == 3:
            angles[system.names[i]] = _angle(x, y)
            continue
        turned = np.sum(x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])
        angles[system.names[i]] = float(np.arctan2(turned, np.sum(x * y)))
    return angles


def _angle(x: Array, y: Array) -> float:
    """Of the rotation that brings points (m, 3) closest to others: the polar factor of y'x [rad].

    >>> x = np.array([[1.0, 0, 0], [0, 1, 0], [-1, -1, 0]])
    >>> y = np.array([[0.0, 1, 0], [-1, 0, 0], [1, -1, 0]])
    >>> round(_angle(x, y) / np.pi, 12)
    0.5
    """
    left, _, right = np.linalg.svd(y.T @ x)
    left[:, -1] *= np.sign(np.linalg.det(left) * np.linalg.det(right))  # no mirror image
    turn = left @ right
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return float(np.arctan2(np.linalg.norm(vector), np.trace(turn) - 1))


def leaning(shares: dict[str, float]) -> dict[tuple[str, str], str]:
    """What moments of second order change of rigid bodies' motion, beyond its bound, in words."""
    far = {name: share for name, share in shares.items() if share > A_TENTH}
    return {("second order", name): leaning_words({name: share}) for name, share in far.items()}


def leaning_words(far: dict[str, float]) -> str:
    """Say that the loads of rigid bodies go along with them further than small sliding has it."""
    listed = " and ".join(f"{name!r} by {100 * share:.3g} %" for name, share in far.items())
    return (
        "Rigid bodies carry their loads along, and contact forces act where the points have moved to: "
        "small sliding, which has the arms of the undeformed place, leaves out the moment of that. It "
        f"would change the motion of {listed} at first, and without end where a body rolls off or "
        "topples. Give its contacts sliding='finite', or hold its rotation by D."
    )
