"""Recognition of matrices that are singular to working precision, and what is raised."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from skfem_contact.errors import SingularMatrix

# A pivot divided by its diagonal entry: 0.1 in a body that is well held, 1e-9 in a cantilever of
# 1000 elements, round-off where a rigid motion is free: up to 1e-12, as it grows with the mesh.
# So suspicious pivots are followed by an estimate of the smallest eigenvalue of K scaled to a unit
# diagonal. That is below 1e-16 for a rigid motion, and 1e-12 for the same cantilever.
LOST, SUSPICIOUS, NEGLIGIBLE = 1e-13, 1e-8, 1e-15

Solve = Callable[[np.ndarray], np.ndarray]


def smallest_eigenvalue(scale: np.ndarray, solve: Solve) -> tuple[float, int]:
    """Estimate for a matrix scaled symmetrically to a unit diagonal, by inverse iteration.

    Parameters
    ----------
    scale : ndarray, shape (n,)
        Diagonal of the matrix.
    solve : callable
        Product of its inverse with a vector.

    Returns
    -------
    smallest : float
    dof : int
        Where the eigenvector is largest.

    Examples
    --------
    >>> import numpy as np
    >>> value, dof = smallest_eigenvalue(np.array([4.0, 9.0]), lambda b: b / np.array([4.0, 9e-6]))
    >>> round(value, 12), dof
    (1e-06, 1)
    """
    size = np.sqrt(scale)
    vector = np.random.default_rng(0).standard_normal(size.size)
    for _ in range(2):
        vector /= np.linalg.norm(vector)
        vector = size * solve(size * vector)
    return float(1.0 / np.linalg.norm(vector)), int(np.argmax(np.abs(vector)))


def check_diagonal(diagonal: np.ndarray) -> None:
    """Raise `SingularMatrix` where a matrix that is to be positive definite can not be.

    >>> try:
    ...     check_diagonal(np.array([2.0, 0.0]))
    ... except SingularMatrix as error:
    ...     print(error.dof)
    1
    """
    wrong = np.flatnonzero(~(diagonal > 0.0))  # finds a NaN as well
    if len(wrong):
        raise singular(int(wrong[0]), 0.0)


def check_eigenvalue(scale: np.ndarray, solve: Solve) -> None:
    """Raise `SingularMatrix` where the scaled matrix has an eigenvalue of zero."""
    smallest, dof = smallest_eigenvalue(scale, solve)
    if not smallest >= NEGLIGIBLE:
        raise singular(dof, smallest)


def singular(dof: int, ratio: float, point: Sequence[float] = ()) -> SingularMatrix:
    """The error for a DOF without stiffness, at a point where that is known; -1 is any DOF."""
    where = f"at DOF {dof}" if dof >= 0 else "somewhere"
    if len(point):
        where += f" at ({', '.join(f'{coordinate:.6g}' for coordinate in point)})"
    return SingularMatrix(
        f"The stiffness left {where}, once the other DOFs are eliminated, is {ratio:.1e} of its "
        "diagonal entry: the matrix is singular to working precision, or not positive definite. "
        "Usually a rigid motion is left free by D, the contacts and the constraints together.",
        dof,
        ratio,
    )
