"""Memory: how much a factorisation may take, before anything is known of it, and in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skfem_contact.linalg.thresholds import FACTORS_2D, FACTORS_3D


@dataclass(frozen=True)
class Limits:
    """What a solver may take [bytes]."""

    dense: float
    factors: float


def factor_bound(n: int, dim: int) -> float:
    """About twice what the factors of a body of n DOFs take in general [bytes].

    Where this is allowed, nobody needs to look closer.

    >>> f"{factor_bound(100_000, 3):.2g}", f"{factor_bound(100_000, 2):.2g}"
    ('2.1e+09', '4e+08')
    """
    if n < 2:
        return 0.0
    if dim < 3:
        return float(FACTORS_2D * n * np.log2(n))
    return float(FACTORS_3D * n**1.37)


def written_bytes(count: float) -> str:
    """A number of bytes with three digits.

    >>> written_bytes(80), written_bytes(1234567), written_bytes(3e9)
    ('80 B', '1.23 MB', '3 GB')
    """
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
