"""Arrays from one rank to another."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from skfem_contact.linalg.distributed.thresholds import AT_ONCE


def send(comm: Any, arrays: list[Any], rank: int) -> None:
    """Send arrays of any size."""
    arrays = [_plain(array) for array in arrays]
    comm.send([(array.shape, array.dtype.str) for array in arrays], dest=rank)
    for array in arrays:
        for piece in _pieces(array):
            comm.Send(piece, dest=rank)


def receive(comm: Any, rank: int) -> list[Any]:
    """What another rank sends."""
    arrays = [np.empty(shape, dtype) for shape, dtype in comm.recv(source=rank)]
    for array in arrays:
        for piece in _pieces(array):
            comm.Recv(piece, source=rank)
    return arrays


def _plain(array: Any) -> Any:
    """In the order of memory and of bytes that MPI sends, and of a type that does not name the latter.

    >>> named = np.zeros((2, 1), dtype=np.dtype(float).newbyteorder("<"))
    >>> memoryview(named).format, memoryview(_plain(named)).format
    ('<d', 'd')
    """
    plain = np.dtype(array.dtype.type)
    return np.ascontiguousarray(array.astype(plain, copy=False)).view(plain)


def _pieces(array: Any) -> Iterator[Any]:
    flat = array.reshape(-1)
    return (flat[first : first + AT_ONCE] for first in range(0, len(flat), AT_ONCE))
