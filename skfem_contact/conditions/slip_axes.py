r"""Axes that slips are taken along: unit tangents, scaled where friction has a material direction.

The ellipse of `orthotropic` has the axes ``d_1`` (along) and ``d_2`` (across) and, over the larger
coefficient, the ratios ``r_1, r_2``. Components of the slip s along any two vectors ``e_k`` with

    (e_1 . s)^2 + (e_2 . s)^2 = (r_1 d_1 . s)^2 + (r_2 d_2 . s)^2

make a circle of it; ``e_k = r_k d_k`` is one choice of many. Here they are combinations of the tangents
of the pairing of which one is a multiple of a single tangent: of the one that supports hold, if they
hold one, so that no row is half held. With one coefficient they are the tangents themselves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix

from skfem_contact.bodies.selection import written
from skfem_contact.conditions.contact import Contact
from skfem_contact.conditions.orthotropic import OrthotropicCoulomb
from skfem_contact.conditions.thresholds import NO_PROJECTION
from skfem_contact.errors import InputError
from skfem_contact.pairing.node import Pairing

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def material_frame(contact: Contact, pairing: Pairing) -> Array:
    """Unit tangents along and across the direction of the contact's friction, shape (m, 2, 3).

    Points without partner keep the tangents of the pairing, which nothing is measured along.

    Raises
    ------
    InputError
        Where the direction is normal to the surface, or nearly so.
    """
    law = contact.friction
    assert isinstance(law, OrthotropicCoulomb)
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
            f"contact '{contact.label}': the direction {written(given[worst])} of its friction is "
            f"normal to the surface at point {worst} at {written(pairing.points[worst])}. It has to be "
            "along the surface; where that turns, give a function of the position."
        )
    first = np.where(known[:, None], across / length, pairing.tangent[:, 0])
    frame = np.stack([first, np.cross(normal, first)], axis=1)
    return np.where(known[:, None, None], frame, pairing.tangent)


def combinations(frame: Array, ratios: Array, tangent: Array, first_held: Mask) -> Array:
    r"""What combinations of the tangents the axes are, shape (m, 2, 2): triangular matrices A.

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


def combined_rows(A: Array, rows: csr_matrix) -> csr_matrix:
    """Combinations (m, t, t) of the rows of each point, of a matrix (m t, n)."""
    m = len(A)
    out = csr_matrix(bsr_matrix((A, np.arange(m), np.arange(m + 1))) @ rows)
    out.sum_duplicates()
    out.eliminate_zeros()
    return out
