"""Recognition of matrices that are singular to working precision, and what is raised."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from skfem_contact.errors import SingularMatrix
from skfem_contact.linalg.thresholds import LOST, NEGLIGIBLE, SUSPICIOUS

Solve = Callable[[np.ndarray], np.ndarray]


class NotPositiveDefinite(np.linalg.LinAlgError):
    """A pivot is negative or lost in round-off.

    Attributes
    ----------
    dof : int
        The DOF without stiffness, in the numbering of the matrix.
    point : ndarray, shape (d,)
        Its position [length].
    ratio : float
        Stiffness left divided by the diagonal entry of the matrix; 0 if it is not positive.
    """

    def __init__(self, dof: int, point: np.ndarray, ratio: float) -> None:
        where = ", ".join(f"{coordinate:.6g}" for coordinate in point)
        super().__init__(
            f"The stiffness left at DOF {dof} at ({where}), once the others are eliminated, is "
            f"{ratio:.1e} of its diagonal entry, that is none. Usually a rigid motion is left "
            "free: hold the body, or keep more DOFs. Or K is not positive definite."
        )
        self.dof, self.point, self.ratio = int(dof), np.array(point), float(ratio)


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


def check_pivots(pivots: np.ndarray, scale: np.ndarray, solve: Solve) -> None:
    """Raise `SingularMatrix` where a dense factorisation lost a pivot in round-off."""
    if not pivots.size:
        return
    ratios = pivots / scale
    dof = int(np.argmin(ratios))  # finds a NaN as well
    if not ratios[dof] >= LOST:
        raise singular(dof, ratios[dof])
    if ratios[dof] < SUSPICIOUS:
        check_eigenvalue(scale, solve)


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


def singular(dof: int, ratio: float) -> SingularMatrix:
    """The message for a DOF without stiffness."""
    where = f"at DOF {dof} {ratio:.1e}" if dof >= 0 else "somewhere nothing"
    return SingularMatrix(
        f"The matrix is singular to working precision: {where} of the stiffness is left once the "
        "other DOFs are eliminated. Usually a rigid motion is left free by D, the contacts and "
        "the constraints together.",
        dof,
        ratio,
    )
