r"""Strains and rotations of bodies: the limits of linear bodies.

**Locking**: elements that can not keep their volume but by hardly moving at all.

Nearly incompressible bodies deform by shear alone. First-order elements have too few motions for that:
to keep the volume in each of their points, or in each of them, they move by a fraction of what they
should, and forces come out several times too large. The energy shows it. Where a body locks, much of
the energy is in changes of volume :math:`\theta` that are forced upon the elements and take turns,
inside an element or from one to the next; their mean over the elements around a node is next to
nothing. With the mean :math:`\bar\theta` of these patches, interpolated, the share

.. math:: \frac{\int K (\theta^2 - \bar\theta^2)\,dx}{\int \sigma : \varepsilon\,dx}

of the energy is taken back by neighbours. Where pressure is smooth, as elements of second order have
it, it is next to nothing. Of a share s forces are about ``1 / (1 - s)`` times too large, and more where
s is near one: rigid cylinders and balls pressed into rubber of nu .49 to .4999 gave 1.09 for .085, 1.26
for .23, 1.66 for .38, 3.3 for .65, 22 for .93.

Where elements of first order lock altogether hardly any change of volume is left to take turns, and the
share falls again: .19, .02 and .001 where forces are 70, 84 and 1700 times too large. Then pressure
and shear take turns nevertheless. With the share of the shear that averages take away as well, both
times the quotient of bulk and shear modulus, their product is above 800 where forces are twice too
large or more; at most 100 where they are right by 6 %, whatever the mesh.

The moduli are those of an isotropic body that is integrated at all points. What the energy differs by
from theirs is no locking, and taken off: reduced integration, other materials, springs in a matrix.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import skfem

from skfem_contact.answers.answer import Answer
from skfem_contact.answers.validity.validity import LOCKED
from skfem_contact.arrays import Array
from skfem_contact.bodies.assembly import (
    chunks,
    element_values,
    hoop_strain,
    point_volumes,
    scalar_element,
    shape_gradients,
    with_points,
)
from skfem_contact.bodies.body import STIFF_BULK, Body, may_lock

#: Quotient of bulk and shear modulus, times the share of the energy and times that of the shear that
#: averages take away, both: first-order elements that lock altogether. 860 where forces are 120 times
#: too large and nearly all shear is smooth, 4 000 and more else; 100 where they are right by 6 %.
ALTERNATING = 800.0


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


# -- locking ---------------------------------------------------------------------------------------


#: Shape functions of the corners, by the shape of an element.
FIRST_ORDER = {
    element.refdom: element
    for element in (skfem.ElementTriP1, skfem.ElementQuad1, skfem.ElementTetP1, skfem.ElementHex1)
}


def lockable(result: Answer) -> list[str]:
    """Names of the bodies that may lock, where the answer is by their own stiffness."""
    given = dict(zip(result.system.names, result.stiffness, strict=True))
    return [name for name, b in result.system.solids.items() if may_lock(b) and given[name] is b.K]


def locked(result: Answer, name: str) -> float:
    """The `locked_share` of a body in an answer; measured once, for the validity and the estimate."""
    key = "locked", name
    if key not in result.measured:
        body = result.system.solids[name]
        result.measured[key] = locked_share(body, result.stretched(name))
    return result.measured[key]


def locked_share(body: Body, u: Array) -> float:
    """Share of the energy that averages over neighbouring elements take away; 0 without energy.

    It is 1 where first-order elements lock altogether, so that nothing is left to be taken away.

    Parameters
    ----------
    body : Body
        That `may_lock`.
    u : ndarray, shape (n_body,)
        Its displacement [length].
    """
    basis, mesh, known = with_points(body.basis), body.basis.mesh, body.moduli
    energy = float(u @ (body.K @ u))
    if known is None or not energy > 0:
        return 0.0
    found = [
        (*_strain(body, basis, u, elements), point_volumes(basis, elements))
        for elements in chunks(basis, 8 * body.dim * basis.Nbfun * basis.X.shape[1])
    ]
    # in all elements at once: patches go over the parts
    theta, square, dx = (np.concatenate(part) for part in zip(*found, strict=True))
    bulk, shear = (np.broadcast_to(modulus, len(theta)) for modulus in known)
    density = bulk[:, None] * theta**2 + 2 * shear[:, None] * square
    other = abs(float(np.sum(density * dx)) - energy)
    # the pressure of what is nearly incompressible goes through, where materials meet
    some = np.flatnonzero(bulk > STIFF_BULK * shear)
    pressure, dx, bulk = bulk[some, None] * theta[some], dx[some], bulk[some]
    numbers = np.arange(mesh.nelements) if basis.tind is None else np.asarray(basis.tind)
    smooth = _averaged(mesh, numbers[some], basis, pressure, dx)
    taken = np.sum((pressure**2 - smooth**2) * dx / bulk[:, None])
    share = max((float(taken) - other) / energy, 0.0)
    first_order = issubclass(type(scalar_element(basis.elem)), tuple(FIRST_ORDER.values()))
    if first_order and 0 < share <= LOCKED and other <= LOCKED * energy:
        varies = _shear_taken(body, basis, u)
        return 1.0 if share * varies * known.quotient**2 > ALTERNATING else share
    return share


def _shear_taken(body: Body, basis: Any, u: Array) -> float:
    """Share of the squared shear that averages over neighbouring elements take away."""
    mesh, d = basis.mesh, body.dim
    numbers = np.arange(mesh.nelements) if basis.tind is None else np.asarray(basis.tind)
    parts = chunks(basis, 8 * d * d * basis.Nbfun * basis.X.shape[1])
    found = [(gradient(basis, u, some), point_volumes(basis, some)) for some in parts]
    slope, dx = (np.concatenate(part, axis=-2) for part in zip(*found, strict=True))
    strain = 0.5 * (slope + np.swapaxes(slope, 0, 1))
    strain -= np.eye(d)[:, :, None, None] * np.trace(strain) / d
    smooth = sum(
        np.sum(_averaged(mesh, numbers, basis, component, dx) ** 2 * dx)
        for component in strain.reshape(d * d, *dx.shape)
    )
    whole = float(np.sum(strain**2 * dx))
    return 1 - float(smooth) / whole if whole > 0 else 0.0


def _averaged(mesh: Any, numbers: Any, basis: Any, values: Array, dx: Array) -> Array:
    """Values at points of elements (e, q), averaged over those round each corner and interpolated."""
    corners, count = mesh.t[:, numbers], len(mesh.t)
    weight, sums = (
        np.bincount(corners.ravel(), np.tile(one.sum(axis=1), count), mesh.nvertices)
        for one in (dx, values * dx)
    )
    mean = np.divide(sums, weight, out=np.zeros(len(sums)), where=weight > 0)
    linear = FIRST_ORDER[mesh.elem.refdom]()
    shapes = np.array(
        [np.broadcast_to(linear.lbasis(basis.X, i)[0], len(basis.W)) for i in range(count)]
    )
    return np.asarray(mean[corners].T @ shapes)


def _strain(body: Body, basis: Any, u: Array, elements: Any) -> tuple[Array, Array]:
    """Change of volume at the points of integration of some elements, and the rest squared, (e, q).

    The energy is the integral of the bulk modulus times the square of the first, and of twice the
    shear modulus times the other.
    """
    d, slope = body.dim, gradient(basis, u, elements)
    strain = 0.5 * (slope + np.swapaxes(slope, 0, 1))
    theta, square = np.trace(strain), np.einsum("cjeq,cjeq->eq", strain, strain)
    if body.axisymmetric:
        hoop = hoop_strain(basis, u, elements)
        theta, square = theta + hoop, square + hoop**2
    return np.asarray(theta), np.asarray(square - theta**2 / d)
