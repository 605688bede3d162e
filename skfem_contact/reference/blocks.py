"""Line load on a block of finite depth and width: the correction of Hertz' half plane.

The far field of a block adds a curvature to the surface under the load. Under a line load P on
a block of depth H,

    1/R_effective = 1/R + Σ C_i P / (E_i* H_i²),     E_i* = E_i / (1 - nu_i²)

summed over the deformable bodies. For a layer of infinite width C is a Fourier integral,
computed here; finite widths scale it by ratios that were tabulated once from plane finite
element solutions of the load on the block (sides free).
"""

from __future__ import annotations

import math

import numpy as np
import scipy  # its parts are imported when they are used

from skfem_contact.errors import InputError
from skfem_contact.reference._check import not_negative, poisson, positive

# half width over depth, and C of the block over C of the infinite layer
WIDTHS = (1.0, 1.5, 2.0, 3.0, 5.0)
FIXED_NU_0 = tuple(c / 0.731 for c in (0.701, 0.728, 0.734, 0.731, 0.731))
FIXED_NU_3 = tuple(c / 0.912 for c in (0.983, 0.926, 0.913, 0.912, 0.912))
ROLLER = tuple(c / 0.663 for c in (0.561, 0.664, 0.669, 0.663, 0.663))


def _layer_compliance(xi: float, base: str, nu: float) -> float:
    """Surface compliance of a layer over that of the half plane, at wave number ``xi/H``."""
    e = math.exp(-2 * xi)
    if base == "roller":
        return (1 - e) ** 2 / (1 - e**2 + 4 * xi * e)
    kappa = 3 - 4 * nu
    numerator = kappa * (1 - e**2) - 4 * xi * e
    return numerator / (kappa * (1 + e**2) + (4 * xi**2 + 1 + kappa**2) * e)


def block_coefficient(base: str = "fixed", nu: float = 0.3, width: float = math.inf) -> float:
    r"""Coefficient C of the curvature that the finite size of a block adds, ``C P/(E* H²)``.

    Infinite layer: ``C = (2/π) ∫ ξ (1 - M(ξ)) dξ`` with the compliance ``M`` of a layer on a
    smooth or bonding rigid base relative to the half plane (Vorovich et al.; Johnson 5.8). The
    ratios for finite width are accurate to about 0.002, so ``a`` to 0.001 at ``a/H = 0.1``.

    Parameters
    ----------
    base : {"fixed", "roller"}
        Support of the bottom of the block; the sides are free.
    nu : float
        Poisson's ratio (plane strain); matters for the fixed base only.
    width : float
        Half width over depth, W/H >= 1. Below 3 on a fixed base `nu` is limited to 0...0.3,
        the range of the table.

    Raises
    ------
    InputError
        Outside the table, or for an unknown base.

    Examples
    --------
    >>> print(f"{block_coefficient('fixed', 0.3, 2.0):.3f} {block_coefficient('roller'):.3f}")
    0.913 0.663
    """
    poisson(nu)
    if base not in ("fixed", "roller"):
        raise InputError(f"base = {base!r} is not known: use 'fixed' or 'roller'.")
    if not width >= WIDTHS[0]:
        raise InputError(f"width W/H = {width} is below 1, where the table of C ends.")
    if base == "fixed" and width < 3 and not 0 <= nu <= 0.3:
        raise InputError(
            f"nu = {nu} with W/H = {width}: C on a fixed base is tabulated for nu from 0 to 0.3;"
            " a wider block (width >= 3) takes any nu."
        )
    # beyond xi = 40 the integrand is below the round-off of its integral
    layer = scipy.integrate.quad(
        lambda xi: xi * (1 - _layer_compliance(xi, base, nu)), 0, 40, limit=200
    )[0]
    w = min(width, WIDTHS[-1])
    if base == "roller":
        ratio = float(scipy.interpolate.PchipInterpolator(WIDTHS, ROLLER)(w))
    else:
        at_0, at_3 = scipy.interpolate.PchipInterpolator(
            WIDTHS, np.transpose([FIXED_NU_0, FIXED_NU_3])
        )(w)
        ratio = float(at_0 + (at_3 - at_0) * nu / 0.3) if width < 3 else 1.0
    return 2 / math.pi * layer * ratio


def block_curvature(
    P: float, H: float, E: float, nu: float, *, base: str = "fixed", width: float = math.inf
) -> float:
    """Curvature ``C P / (E* H²)`` that one block of depth `H` adds under a line load [1/length].

    Give the sum over both bodies to ``hertz_line(..., added_curvature=...)``. Good for
    ``a/H <= 0.2``: without it Hertz errs by ``π C/8 (a/H)²``.

    Examples
    --------
    The half width at ``a0/H = 0.1`` on a fixed block, ``(1 + C π/4 (a0/H)²)**-0.5`` of Hertz':

    >>> from skfem_contact.reference import effective_modulus, hertz_line
    >>> E_star = effective_modulus(1.0, 0.3)
    >>> P = 1e-4 * 3.141592653589793 / 4 * E_star
    >>> added = block_curvature(P, H=0.1, E=1.0, nu=0.3, width=2.0)
    >>> half_plane = hertz_line(P, 1.0, E_star)
    >>> block = hertz_line(P, 1.0, E_star, added_curvature=added)
    >>> print(f"{half_plane.a:.4f} {block.a / half_plane.a:.4f}")
    0.0100 0.9964
    """
    not_negative(P=P)
    positive(H=H, E=E)
    return block_coefficient(base, nu, width) * P * (1 - nu**2) / (E * H**2)
