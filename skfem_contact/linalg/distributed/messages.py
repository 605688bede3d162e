"""Arrays from one rank to another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from skfem_contact.linalg.distributed.thresholds import AT_ONCE


def send(comm: Any, arrays: list[Any], rank: int) -> None:
    """Send arrays of any size."""
    comm.send([(array.shape, array.dtype.str) for array in arrays], dest=rank)
    for array in arrays:
        for piece in _pieces(np.ascontiguousarray(array)):
            comm.Send(piece, dest=rank)


def receive(comm: Any, rank: int) -> list[Any]:
    """What another rank sends."""
    arrays = [np.empty(shape, dtype) for shape, dtype in comm.recv(source=rank)]
    for array in arrays:
        for piece in _pieces(array):
            comm.Recv(piece, source=rank)
    return arrays


def _pieces(array: Any) -> Iterator[Any]:
    flat = array.reshape(-1)
    return (flat[first : first + AT_ONCE] for first in range(0, len(flat), AT_ONCE))
