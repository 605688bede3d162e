"""What users give a `RigidBody`: DOFs by name, a point, forces and springs, checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix, issparse

from skfem_contact.arguments import numbers, shown, suggest
from skfem_contact.bodies.inputs import csr32
from skfem_contact.bodies.thresholds import UNSYMMETRIC
from skfem_contact.errors import InputError
from skfem_contact.obstacles.obstacle import Obstacle
from skfem_contact.sealed import sealed, sealed_matrix

#: Names of the DOFs, by the dimension of space.
DIRECTIONS = {
    2: ("x", "y", "rotation"),
    3: ("x", "y", "z", "rotation x", "rotation y", "rotation z"),
}


def held_dofs(D: Any, directions: tuple[str, ...], what: str) -> np.ndarray:
    """Sorted numbers of the DOFs that a user means by names or numbers."""
    if D is None:
        return np.zeros(0, dtype=np.int64)
    try:
        given = [D] if isinstance(D, str) or np.ndim(D) == 0 else list(D)
    except (TypeError, ValueError):
        raise InputError(f"{what} is {shown(D)}; give names of DOFs") from None
    return np.array(sorted({dof_number(entry, directions, what) for entry in given}), dtype=np.int64)


def dof_number(entry: Any, directions: tuple[str, ...], what: str) -> int:
    """The DOF that a user means by its name or number."""
    if isinstance(entry, str):
        if entry not in directions:
            raise InputError(f"{what}: {entry!r} is none{suggest(entry, directions, 'DOFs')}")
        return directions.index(entry)
    if (
        not isinstance(entry, int | np.integer)
        or isinstance(entry, bool)
        or not 0 <= entry < len(directions)
    ):
        known = ", ".join(map(repr, directions))
        raise InputError(f"{what} is {shown(entry)}, no DOF of a rigid body; it has {known}")
    return int(entry)


def springs_of(K: Any, n: int, what: str) -> csr_matrix:
    """Springs (n, n) that a user means: a stiffness for every DOF, a matrix, or none."""
    usage = f"give {n} numbers, or a symmetric ({n}, {n}) matrix"
    given = np.zeros(n) if K is None else numbers(K.toarray() if issparse(K) else K, what, usage)
    matrix = np.diag(given) if given.shape == (n,) else given
    if matrix.shape != (n, n) or not np.isfinite(matrix).all():
        raise InputError(f"{what} has shape {given.shape}, or is not finite; {usage}")
    # each entry against the two springs that it couples: forces and moments have other units
    diagonal = np.diag(matrix)
    scale = np.sqrt(np.abs(np.outer(diagonal, diagonal)))
    if np.any(np.abs(matrix - matrix.T) > UNSYMMETRIC * scale):
        raise InputError(f"{what} is not symmetric; {usage}")
    root = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    if np.linalg.eigvalsh(matrix / np.outer(root, root))[0] < -UNSYMMETRIC:
        raise InputError(f"{what} pushes along some motion: springs have a stiffness >= 0")
    return sealed_matrix(csr32(csr_matrix(0.5 * (matrix + matrix.T))))


def about_of(about: Any, obstacle: Obstacle, whose: str) -> np.ndarray:
    """The point (d,) that a user means, or that of the obstacle itself [length]."""
    if about is None:
        about = obstacle.reference
    if about is None:
        raise InputError(
            f"{whose} needs the point that its force acts at and its rotation is counted about: "
            f"{obstacle.label!r} has no centre of its own, give about=(...)"
        )
    point = numbers(about, f"about of {whose}", "give 2 or 3 finite coordinates")
    own = obstacle.reference
    if point.shape not in ((2,), (3,)) or not np.isfinite(point).all():
        raise InputError(f"about of {whose} is {shown(about)}; give 2 or 3 finite coordinates")
    if own is not None and len(own) != len(point):
        raise InputError(f"about of {whose} is {shown(about)}, but its obstacle is {len(own)}-D")
    return sealed(point)


def vector_of(value: Any, size: int, what: str) -> np.ndarray:
    """A vector of this size that a user means; zero where not given."""
    if value is None:
        return np.zeros(size)
    usage = f"give {size} finite numbers"
    array = numbers(value, what, usage)
    if array.shape != (size,) or not np.isfinite(array).all():
        raise InputError(f"{what} is {shown(value)}; {usage}")
    return array
