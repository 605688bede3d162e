"""Rigid motions in words, for messages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from skfem_contact.conditions.thresholds import NOT_NAMED

Array = NDArray[np.float64]


def motion_words(modes: Array, names: tuple[str, ...], u: Array) -> str:
    """The motion u (n,), or motions (n, j), in words: which rigid modes (n, k) have a part in it."""
    scaled = modes / np.max(np.abs(modes), axis=0)
    share = np.abs(np.linalg.lstsq(scaled, u, rcond=None)[0])
    share = share if share.ndim == 1 else np.max(share, axis=1)
    return joined([name for name, s in zip(names, share, strict=True) if s > NOT_NAMED * share.max()])


def joined(names: Sequence[str]) -> str:
    """Rigid motions as one: those of a kind by their axes, one kind with the other.

    >>> joined(["translation along x", "translation along y", "rotation"])
    'translation along x and y with rotation'
    >>> joined(
    ...     [
    ...         "translation along x of part 2",
    ...         "rotation about x",
    ...         "rotation about y",
    ...         "rotation about z",
    ...     ]
    ... )
    'translation along x of part 2 with rotation about x, y and z'
    """
    kinds: dict[tuple[str, str], list[str]] = {}
    for name in names:
        motion, _, part = name.partition(" of part ")
        kind, _, axis = motion.rpartition(" ")
        if axis not in ("x", "y", "z"):
            kind, axis = motion, ""
        kinds.setdefault((kind, part), []).append(axis)
    words = []
    for (kind, part), axes in kinds.items():
        listed = " and ".join(filter(None, (", ".join(axes[:-1]), axes[-1])))
        words.append(f"{kind} {listed}".strip() + (f" of part {part}" if part else ""))
    return " with ".join(words)
