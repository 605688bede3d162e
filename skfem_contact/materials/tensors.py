"""Second-order tensors at many points: arrays (3, 3, ...), components first."""

from __future__ import annotations

from typing import Any

import numpy as np

from skfem_contact.arrays import Array


def solid(H: Array) -> Array:
    """Return a tensor (d, d, ...) with its third row and column, zeros in plane strain.

    >>> solid(np.ones((2, 2, 1, 1)))[:, :, 0, 0].tolist()
    [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]
    """
    if len(H) == 3:
        return H
    out = np.zeros((3, 3, *H.shape[2:]))
    out[:2, :2] = H
    return out


def unit(points: Any) -> Array:
    """Return the unit tensor (3, 3, 1, 1, ...) for arrays of points of this many axes."""
    return np.eye(3).reshape(3, 3, *[1] * points)


def symmetric(H: Array) -> Array:
    """Return the symmetric part."""
    return 0.5 * (H + H.swapaxes(0, 1))


def trace(T: Array) -> Array:
    return np.asarray(np.einsum("ii...->...", T))


def deviator(T: Array) -> Array:
    """Return a tensor (3, 3, ...) less its mean on the diagonal."""
    return T - trace(T) / 3.0 * unit(T.ndim - 2)


def double(A: Array, B: Array) -> Array:
    """Return the product ``A_ij B_ij``."""
    return np.asarray(np.einsum("ij...,ij...->...", A, B))


def isotropic(bulk: float, shear: float, d: int) -> Array:
    """Return ``bulk 1 x 1 + 2 shear I_dev`` of d rows, I_dev symmetric.

    Examples
    --------
    >>> isotropic(1.0, 0.5, 2)[0, 0, 0, 0].round(3), isotropic(1.0, 0.5, 2)[0, 1, 1, 0]
    (np.float64(1.667), np.float64(0.5))
    """
    one = np.eye(d)
    both = np.einsum("ik,jl->ijkl", one, one) + np.einsum("il,jk->ijkl", one, one)
    return (bulk - 2.0 / 3.0 * shear) * np.multiply.outer(one, one) + shear * both
