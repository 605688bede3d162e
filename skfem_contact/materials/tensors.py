r"""Second-order tensors at many points: arrays (3, 3, ...), components first.

A law of small strains holds at large ones if its strain is the logarithmic one (Hencky's),

    ``E = 1/2 ln F'F``,    ``S_ab = f(l_a, l_b) T_ab``

Stress T belongs to E by the law of small strains, in the principal axes of ``C = F'F``, whose
eigenvalues are l and ``f`` the divided differences of the logarithm; S is the second Piola-Kirchhoff
stress. The trace of E is ``ln det F``, so that flow without a trace keeps the volume, at any strain;
work is that of the small law, ``T : dE``, and a tangent that is symmetric stays so. Principal axes that
turn within a step are turned with exactly: all follows from F at its end.

See Miehe, Apel and Lambrecht, Comput. Methods Appl. Mech. Engrg. 191 (2002) 5383-5425.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from skfem.helpers import ddot, det, inv, trace, transpose

from skfem_contact.arrays import Array
from skfem_contact.errors import MaterialError

#: Relative spread of three eigenvalues below which second differences are a Taylor polynomial: it is
#: wrong by the square of the spread there, and differences by round-off over it.
ALIKE = 1e-5


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


def small(H: Array) -> Array:
    """Return the small strain (3, 3, ...) of a displacement gradient (d, d, ...)."""
    H = solid(H)
    return 0.5 * (H + H.swapaxes(0, 1))


def deviator(T: Array) -> Array:
    """Return a tensor (3, 3, ...) less its mean on the diagonal."""
    return T - trace(T) / 3.0 * unit(T.ndim - 2)


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


def green(H: Array) -> Array:
    """Return Green's strain ``(F'F - 1) / 2`` (3, 3, ...) of a displacement gradient (d, d, ...).

    Without the 1, of whose round-off strains are far from where a body yields.
    """
    return small(H) + 0.5 * squared(solid(H))


def squared(F: Array) -> Array:
    """Return ``F'F``."""
    return np.asarray(np.einsum("mi...,mj...->ij...", F, F))


def first_piola(F: Array, S: Array, D: Array) -> tuple[Array, Array]:
    """Return the first Piola-Kirchhoff stress F S, and its derivative by F.

    Parameters
    ----------
    F, S : ndarray, shape (3, 3, e, q)
        Deformation gradient and second Piola-Kirchhoff stress.
    D : ndarray, shape (d, d, d, d, e, q) or what broadcasts to it
        The derivative of S by Green's strain.
    """
    d = len(D)
    f = F[:d, :d]
    A = np.einsum("ik,jl...->ijkl...", np.eye(d), S[:d, :d])
    if D.any():  # not so of neo-Hooke's law
        A += np.einsum("im...,mjnl...,kn...->ijkl...", f, D, f, optimize=True)
    return np.einsum("im...,mj...->ij...", F, S), A


def deformation(H: Array) -> tuple[Array, Array, Array]:
    """Return F (3, 3, e, q), its determinant (e, q), which has to be positive, and F^-T."""
    F = solid(H) + unit(H.ndim - 2)
    J = det(F)
    if not (J > 0).all():  # or NaN
        raise MaterialError(
            f"an element is turned inside out: det F = {np.nanmin(J):.3g}",
            int(np.argwhere(~(J > 0))[0, 0]),
        )
    return F, J, transpose(inv(F))


def dilatation(H: Array, finite: bool) -> tuple[Array, Array, Any]:
    """Return ``J - 1`` (e, q), its derivative (3, 3, e, q), and d rows of the second one, if not zero.

    Without the one, beside which small strains lose their digits: far from a small contact stresses
    of that round-off act on large areas.
    """
    small = trace(H)
    if not finite:
        return small, np.broadcast_to(unit(2), (3, 3, *H.shape[2:])), None
    _, J, G = deformation(H)
    g = G[: len(H), : len(H)]
    bend = np.einsum("ij...,kl...->ijkl...", J * g, g)
    h = solid(H)
    growth = small + 0.5 * (small**2 - ddot(h, transpose(h))) + det(h)
    return growth, J * G, bend - bend.transpose(0, 3, 2, 1, 4, 5)


# -- logarithmic strain ---------------------------------------------------------------------


def logarithmic(
    law: Callable[..., Any], H: Array, state: Mapping[str, Array]
) -> tuple[Array, Array, Mapping[str, Array]]:
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
    # dS_ac = 1/2 D_acbd dC_bd: of the law, and of principal axes and stretches that change
    f, t, one = first[:d, :d], T[:d, :d], np.eye(d)
    g = np.einsum("acb...,ab...->abc...", second, t)
    turns = np.einsum("abc...,cd->acbd...", g, one)
    turns = turns + turns.swapaxes(0, 1)
    D = f[:, :, None, None] * f * A + turns + turns.swapaxes(2, 3)
    n = N[:d, :d]
    turn = np.einsum("ia...,jc...->ijac...", n, n)
    D = np.einsum("ijac...,acbd...,klbd...->ijkl...", turn, D, turn, optimize=True)
    stress, tangent = first_piola(F, _turned(back, first * T), D)
    return stress, tangent, {k: _turned(back, X) if X.ndim == 4 else X for k, X in new.items()}


def principal(H: Array) -> tuple[Array, Array, Array]:
    """Squared stretches (3, ...), their axes as columns (3, 3, ...), and E (3, 3, ...) in these."""
    d, beyond = len(H), 2.0 * green(H)
    x, N, strain = np.zeros(beyond.shape[1:]), np.zeros_like(beyond), np.zeros_like(beyond)
    N[2, 2] = 1.0
    found, axes = np.linalg.eigh(np.moveaxis(beyond[:d, :d], (0, 1), (-2, -1)))
    x[:d], N[:d, :d] = np.moveaxis(found, -1, 0), np.moveaxis(axes, (-2, -1), (0, 1))
    strain[range(d), range(d)] = 0.5 * np.log1p(x[:d])
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
