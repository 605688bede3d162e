"""Memory in words."""

from __future__ import annotations


def written_bytes(count: float) -> str:
    """A number of bytes with three digits.

    >>> written_bytes(80), written_bytes(1234567), written_bytes(3e9)
    ('80 B', '1.23 MB', '3 GB')
    """
    for unit, size in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count:.0f} B"
