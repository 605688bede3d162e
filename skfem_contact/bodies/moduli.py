"""Bulk and shear modulus of a body, read from its form, or from its stiffness.

A form is asked for its values under unit gradients, as in `assembly`: an even expansion gives the bulk
modulus, unit shears the shear modulus. Of a matrix they are the means over the body: displacements
linear in the position have these gradients everywhere. In plane strain they are those of the plane,
``lambda + mu`` and ``mu``, whose quotient ``1 / (1 - 2 nu)`` has no bound, as that of solids; in plane
stress it has.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from skfem.assembly import BilinearForm
from skfem.assembly.form.form import FormExtraParams
from skfem.element import DiscreteField

from skfem_contact.arrays import Array, Index
from skfem_contact.bodies.quadrature import parts


class Moduli(NamedTuple):
    """Of every element, shape (e,), or of all of them, shape (1,) [stress]."""

    bulk: Array
    shear: Array

    @property
    def quotient(self) -> float:
        """The largest bulk over shear modulus of an element; 0 where none resists shear."""
        there = self.shear > 0
        return float(np.max(self.bulk[there] / self.shear[there], initial=0.0))


def moduli(form: BilinearForm, basis: Any, tensor: Array | None) -> Moduli | None:
    """Return the moduli of the material of every element; None if the form does not tell.

    Parameters
    ----------
    form : BilinearForm
        Of displacements. Weights of the area, such as ``2 pi r``, are in both moduli.
    basis : skfem.CellBasis
    tensor : ndarray, shape (d, d, d, d), or None
        Of a form that is the same everywhere and sees gradients alone, see `assembly`.

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity, lame_parameters
    >>> basis = fem.Basis(fem.MeshHex(), fem.ElementVector(fem.ElementHex1()))
    >>> found = moduli(linear_elasticity(*lame_parameters(1.0, 0.49)), basis, None)
    >>> found.bulk.round(3).tolist(), found.shear.round(3).tolist(), round(found.quotient, 3)
    ([16.667], [0.336], 49.667)
    """
    d = basis.mesh.dim()
    gradients = [np.eye(d), *(_shear(d, i, j) for i, j in combinations(range(d), 2))]
    if tensor is not None:
        energies = np.array([[np.einsum("cj,cjek,ek", G, tensor, G)] for G in gradients])
    else:
        try:
            some = [_energies(form, part, gradients) for part in parts(basis)]
        except Exception:  # whatever a user's function does with fields that no basis has made
            return None
        energies = np.concatenate(some, axis=1)
    if not np.isfinite(energies).all():
        return None
    return Moduli(energies[0] / d**2, energies[1:].mean(axis=0) / 4)


def mean_moduli(K: csr_matrix, points: Array, component: Index, volume: float) -> Moduli:
    """Return the moduli of a stiffness, as means over the body.

    Parameters
    ----------
    K : csr_matrix, shape (n, n)
        Without supports.
    points : ndarray, shape (n, d)
        Where each DOF is [length].
    component : ndarray of int, shape (n,)
        The component of the displacement that each DOF is.
    volume : float
        Of the body [length^d].

    Examples
    --------
    >>> import skfem as fem
    >>> from skfem.models.elasticity import linear_elasticity, lame_parameters
    >>> basis = fem.Basis(fem.MeshTri().refined(2), fem.ElementVector(fem.ElementTriP1()))
    >>> K = linear_elasticity(*lame_parameters(1.0, 0.49)).assemble(basis)
    >>> found = mean_moduli(K, basis.doflocs.T, np.arange(basis.N) % 2, 1.0)
    >>> found.bulk.round(3).tolist(), found.shear.round(3).tolist(), round(found.quotient, 3)
    ([16.779], [0.336], 50.0)
    """
    d = points.shape[1]
    at, unit = points - points.mean(axis=0), np.eye(d)[component]
    gradients = [np.eye(d), *(_shear(d, i, j) for i, j in combinations(range(d), 2))]
    fields = np.column_stack([np.sum(unit * (at @ G), axis=1) for G in gradients])
    energies = np.einsum("ng,ng->g", fields, K @ fields) / volume
    return Moduli(energies[:1] / d**2, energies[1:].mean(keepdims=True) / 4)


def _shear(d: int, i: int, j: int) -> Array:
    out = np.zeros((d, d))
    out[i, j] = out[j, i] = 1.0
    return out


def _energies(form: BilinearForm, basis: Any, gradients: list[Array]) -> Array:
    """Means of the form over every element under uniform gradients (d, d), shape (g, e)."""
    d, dx = basis.mesh.dim(), np.asarray(basis.dx)
    w = FormExtraParams(basis.default_parameters())
    out = []
    for gradient in gradients:
        at = np.array(np.broadcast_to(gradient[:, :, None, None], (d, d, *dx.shape)))
        field = DiscreteField(np.zeros((d, *dx.shape)), at)
        values = np.broadcast_to(np.asarray(form.form(field, field, w), dtype=float), dx.shape)
        out.append((values * dx).sum(axis=1) / dx.sum(axis=1))
    return np.array(out)
