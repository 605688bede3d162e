r"""A material of small strains, at large ones: its strain is the logarithmic one (Hencky's).

    ``E = 1/2 ln F'F``,    ``S_ab = f(l_a, l_b) T_ab``

Stress T belongs to E by the law of small strains, in the principal axes of ``C = F'F``, whose
eigenvalues are l and ``f`` the divided differences of the logarithm; S is the second Piola-Kirchhoff
stress. The trace of E is ``ln det F``, so that flow without a trace keeps the volume, at any strain;
work is that of the small law, ``T : dE``, and a tangent that is symmetric stays so. Principal axes that
turn within a step are turned with exactly: all follows from F at its end.

See Miehe, Apel and Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 5383-5425.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skfem_contact.arrays import Array
from skfem_contact.materials.material import State, deformation
from skfem_contact.materials.tensors import solid

#: Relative spread of three eigenvalues below which second differences are a Taylor polynomial: it is
#: wrong by the square of the spread there, and differences by round-off over it.
ALIKE = 1e-5


def logarithmic(
    law: Callable[[Array, State], tuple[Array, Array, State]], H: Array, state: State
) -> tuple[Array, Array, State]:
    """First Piola-Kirchhoff stress, its derivative by H, and internal variables.

    Parameters
    ----------
    law : callable
        An isotropic one of small strains, ``(H, state) -> stress, tangent, state``.
    H : ndarray, shape (d, d, e, q)
        Displacement gradient, of any size.
    state : dict of ndarray
        Those of shape (3, 3, e, q) are tensors of the undeformed axes.
    """
    d = len(H)
    F = deformation(H)[0]
    values, N, strain = principal(H)
    back = N.swapaxes(0, 1)
    turned = {key: _turned(N, X) if X.ndim == 4 else X for key, X in state.items()}
    T, A, new = law(strain[:d, :d], turned)
    first, second = _first(values[:, None], values), _second(values[:d])
    S = first * T
    M = np.einsum("im...,ma...->ia...", F, N)
    stress = np.einsum("ia...,ab...,jb...->ij...", M, S, N, optimize=True)
    # dS_ac = 1/2 D_acbd dC_bd: of the law, and of principal axes and stretches that change
    f, t, one = first[:d, :d], T[:d, :d], np.eye(d)
    D = f[:, :, None, None] * f * A
    g = np.einsum("acb...,ab...->abc...", second, t)
    turns = np.einsum("abc...,cd->acbd...", g, one)
    turns = turns + turns.swapaxes(0, 1)
    D = D + turns + turns.swapaxes(2, 3)
    m, n = M[:d, :d], N[:d, :d]
    push = np.einsum("ia...,jc...->ijac...", m, n)
    tangent = np.einsum("ijac...,acbd...,klbd...->ijkl...", push, D, push, optimize=True)
    undeformed = np.einsum("ja...,ab...,lb...->jl...", n, S[:d, :d], n, optimize=True)
    tangent += np.einsum("ik,jl...->ijkl...", one, undeformed)
    return stress, tangent, {k: _turned(back, X) if X.ndim == 4 else X for k, X in new.items()}


def principal(H: Array) -> tuple[Array, Array, Array]:
    """Squared stretches (3, ...), their axes as columns (3, 3, ...), and E (3, 3, ...) in these."""
    h, d = solid(H), len(H)
    # C - 1, and not C: far from where a body yields strains are as small as round-off of the 1
    beyond = h + h.swapaxes(0, 1) + np.einsum("mi...,mj...->ij...", h, h)
    x, N, strain = np.zeros(beyond.shape[1:]), np.zeros_like(beyond), np.zeros_like(beyond)
    N[2, 2] = 1.0
    found, axes = np.linalg.eigh(np.moveaxis(beyond[:d, :d], (0, 1), (-2, -1)))
    x[:d], N[:d, :d] = np.moveaxis(found, -1, 0), np.moveaxis(axes, (-2, -1), (0, 1))
    for i in range(d):
        strain[i, i] = 0.5 * np.log1p(x[i])
    return 1.0 + x, N, strain


def undeformed_axes(H: Array) -> Array:
    """The logarithmic strain (3, 3, e, q) in the axes of the undeformed body."""
    _, N, strain = principal(H)
    return _turned(N.swapaxes(0, 1), strain)


def _turned(N: Array, X: Array) -> Array:
    """A tensor in other axes, the columns of N."""
    return np.asarray(np.einsum("ia...,ij...,jb...->ab...", N, X, N, optimize=True))


def _second(values: Array) -> Array:
    """Second divided differences of the logarithm at values (d, ...) that ascend, (d, d, d, ...)."""
    low, mid, high = values[np.sort(np.indices((len(values),) * 3), axis=0)]
    spread = high - low
    with np.errstate(invalid="ignore", divide="ignore"):
        apart = (_first(mid, high) - _first(low, mid)) / spread
    near = -0.5 * (3.0 / (low + mid + high)) ** 2
    return np.where(spread > ALIKE * low, apart, near)


def _first(a: Array, b: Array) -> Array:
    """First divided differences of the logarithm."""
    x = (a - b) / b
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(x == 0.0, 1.0, np.log1p(x) / x) / b)
