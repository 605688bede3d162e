"""Motions of a body without strain, and their names."""

from __future__ import annotations

import numpy as np

from skfem_contact.arrays import Array, Index


def motion_names(dim: int, components: int, axisymmetric: bool = False) -> tuple[str, ...]:
    """The rigid motions of one piece in words.

    Parameters
    ----------
    dim : int
        Of space.
    components : int
        Of a displacement; 1 of a scalar field.
    axisymmetric : bool
        Whether the axis is all that it can move along.

    Examples
    --------
    >>> motion_names(2, 2)
    ('translation along x', 'translation along y', 'rotation')
    """
    if components == 1:
        return ("constant",)
    if axisymmetric:
        return ("translation along the axis",)
    axes = "xyz"[:dim]
    turns = ("rotation",) if dim == 2 else tuple(f"rotation about {a}" for a in axes)
    return tuple(f"translation along {a}" for a in axes) + turns


def rigid_modes(
    points: Array, component: Index, components: int, axisymmetric: bool, parts: Index
) -> Array:
    """Displacements (n, k) by the motions of `motion_names`, for each piece of the mesh.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        Of the DOFs [length].
    component : ndarray of int, shape (n,)
        That each DOF stands for.
    components, axisymmetric
        As for `motion_names`.
    parts : ndarray of int, shape (n,)
        The piece that each DOF belongs to.
    """
    if not parts.any():
        return _of_piece(points, component, components, axisymmetric)
    blocks = []
    for part in range(parts.max() + 1):
        mine = parts == part
        own = _of_piece(points[mine], component[mine], components, axisymmetric)
        block = np.zeros((len(points), own.shape[1]))
        block[mine] = own
        blocks.append(block)
    return np.concatenate(blocks, axis=1)


def _of_piece(points: Array, component: Index, components: int, axisymmetric: bool) -> Array:
    dim = points.shape[1]
    if components == 1:
        return np.ones((len(component), 1))
    translations = np.eye(dim).take(component, axis=0)
    if axisymmetric:
        return translations[:, 1:]
    arm = points - points.mean(axis=0)
    arm /= np.abs(arm).max()
    # the rotation in the plane (i, j) moves j by the lever arm along i, and i by minus that along j
    planes = [(0, 1)] if dim == 2 else [(1, 2), (2, 0), (0, 1)]
    rotations = [
        np.where(component == j, arm[:, i], 0.0) - np.where(component == i, arm[:, j], 0.0)
        for i, j in planes
    ]
    return np.column_stack([translations, *rotations])


def largest(modes: Array) -> Array:
    """Largest entry of each of k modes (n, k); of all of them at once NumPy takes ten times as long.

    >>> largest(np.array([[1.0, -3.0], [-2.0, 0.0]])).tolist()
    [2.0, 3.0]
    """
    return np.array([np.max(np.abs(mode), initial=0.0) for mode in modes.T])
