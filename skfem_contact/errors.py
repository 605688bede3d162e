"""The exceptions, each carrying what is needed to understand it.

Every message says what was found with both numbers and the user's own names, what that usually
means, and what to try, naming the argument.
"""

from __future__ import annotations

import sys
import warnings
from math import nan
from typing import Any

__all__ = [
    "ConstraintError",
    "InputError",
    "LinearSolveError",
    "MaterialError",
    "NoEquilibrium",
    "NotConverged",
    "SingularMatrix",
    "UnknownKeyword",
]


class ContactWarning(UserWarning):
    """Something works but is probably not what was meant; the message says what to look at.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> import warnings
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0, -0.3)}, name="block")
    >>> foot = sc.Contact(block.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)))
    >>> with warnings.catch_warnings(record=True) as said:
    ...     warnings.simplefilter("always")
    ...     result = sc.ContactSolver(block, foot).solve()
    >>> said[0].category.__name__, "strain" in str(said[0].message)
    ('ContactWarning', True)
    """


def warn(message: str) -> None:
    """Give a ContactWarning that points at the user's line, however deep in here it is given."""
    frame, level = sys._getframe(1), 2
    # properties that are computed once are called by functools
    inside = (f"{__package__}.", "functools")
    while frame.f_back and frame.f_globals.get("__name__", "").startswith(inside):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, ContactWarning, stacklevel=level)


class ContactError(Exception):
    """Base of all errors of this library.

    Attributes
    ----------
    results : tuple of ContactResult
        Where a step of `history` failed, the results of the steps before it: also those of
        ``list(solver.history(steps))``, which nobody has seen. Any other exception that ends a history
        has them too, KeyboardInterrupt included.

    Examples
    --------
    >>> import skfem_contact as sc
    >>> try:
    ...     sc.Coulomb(-0.3)
    ... except sc.ContactError as error:
    ...     print(type(error).__name__)
    InputError
    """

    results: tuple[Any, ...] = ()


class InputError(ContactError, ValueError):
    """The problem as given can not be set up: shapes, NaN, surfaces, names, element types.

    Examples
    --------
    >>> import skfem_contact as sc
    >>> sc.Coulomb(-0.3)
    Traceback (most recent call last):
    ...
    skfem_contact.errors.InputError: ...
    """


class UnknownKeyword(InputError, TypeError):
    """An argument by a name that there is not; a TypeError as well, as everywhere in Python.

    Examples
    --------
    >>> import skfem_contact as sc
    >>> sc.Options(tol=1e-8)
    Traceback (most recent call last):
    ...
    skfem_contact.errors.UnknownKeyword: ...tolerance...
    """


class ConstraintError(ContactError, ValueError):
    """Constraint rows contradict each other or the prescribed DOFs.

    Attributes
    ----------
    rows : tuple of int
        The rows involved, numbered as they were given.

    Examples
    --------
    >>> import skfem_contact as sc
    >>> try:
    ...     sc.elimination.eliminate(
    ...         [[1.0, 0.0], [1.0, 0.0]], [0.0, 1.0]
    ...     )  # the same DOF is to be 0 and 1
    ... except sc.errors.ConstraintError as error:
    ...     print("contradict" in str(error))
    True
    """

    def __init__(self, message: str, rows: Any = ()) -> None:
        super().__init__(message)
        self.rows = tuple(int(row) for row in rows)


class MaterialError(ContactError):
    """A body has no answer to its displacements: an element is turned inside out, or stress is unknown.

    Newton's method meets it on its way, and shortens the step.

    Attributes
    ----------
    element : int or None
        The first element of the mesh where it is so.

    Examples
    --------
    >>> import numpy as np
    >>> import skfem_contact as sc
    >>> rubber = sc.materials.NeoHooke(shear=1.0, bulk=2.0)
    >>> folded = np.diag([-1.5, 0.0, 0.0])[:, :, None, None]  # a displacement gradient
    >>> try:
    ...     rubber(folded, {})
    ... except sc.errors.MaterialError as error:
    ...     print(error.element)
    0
    """

    def __init__(self, message: str, element: int | None = None) -> None:
        super().__init__(message)
        self.element = element


class NoEquilibrium(ContactError):
    """A rigid motion is left free that contact and friction can not hold.

    Attributes
    ----------
    bodies : tuple of str
        The bodies that move together.
    motion : str
        The motion in words: "translation along x", "translation along x and y with rotation", or of
        bodies that move in different ways "low: translation along x; up: rotation".
    result : ContactResult or None
        The last state reached, where there is one.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> loose = sc.Body(basis, linear_elasticity(), f={"top": (0.5, -1.0)}, name="loose")
    >>> foot = sc.Contact(
    ...     loose.surface("bottom"), sc.RigidPlane((0, 0), (0, 1)), friction=sc.Coulomb(0.3)
    ... )
    >>> try:
    ...     sc.ContactSolver(loose, foot).solve()
    ... except sc.errors.NoEquilibrium as error:
    ...     print(error.bodies, error.motion)
    ('loose',) translation along x
    """

    def __init__(
        self, message: str, bodies: tuple[str, ...] = (), motion: str = "", result: Any = None
    ) -> None:
        super().__init__(message)
        self.bodies = bodies
        self.motion = motion
        self.result = result


class NotConverged(ContactError):
    """The nonlinear loop did not reach its tolerance; nothing is lost.

    Attributes
    ----------
    result : ContactResult
        The best iterate, with its certificate.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> def impatient(record):  # a callback may end a solve where it stands
    ...     raise StopIteration
    >>> solver = sc.ContactSolver(block, foot)
    >>> try:
    ...     solver.solve(x={"block": {"top": (0.02, -0.01)}}, callback=impatient)
    ... except sc.errors.NotConverged as error:
    ...     print(error.result.converged, error.result.pressure.shape)
    False (5,)
    """

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


class SingularMatrix(ContactError):
    """A matrix is singular to working precision.

    Attributes
    ----------
    dof : int
        The DOF (row) at which it shows; -1 where unknown.
    ratio : float
        Stiffness left there divided by its diagonal entry; NaN where unknown.

    Examples
    --------
    >>> import skfem_contact as sc
    >>> from scipy.sparse import csr_matrix
    >>> try:
    ...     sc.linalg.Direct().factorize(csr_matrix([[1.0, 1.0], [1.0, 1.0]]))
    ... except sc.errors.SingularMatrix:
    ...     print("no unique answer")
    no unique answer
    """

    def __init__(self, message: str, dof: int = -1, ratio: float = nan) -> None:
        super().__init__(message)
        self.dof, self.ratio = int(dof), float(ratio)


class LinearSolveError(ContactError):
    """An iterative or foreign solver returned no solution.

    Attributes
    ----------
    residual : float
        ``|b - A x| / |b|`` of the best answer; NaN where unknown.
    iterations : int
        How many were made.

    Examples
    --------
    >>> import skfem as fem
    >>> import skfem_contact as sc
    >>> from skfem.models.elasticity import linear_elasticity
    >>> mesh = fem.MeshQuad().refined(2).with_defaults()
    >>> basis = fem.Basis(mesh, fem.ElementVector(fem.ElementQuad1()), intorder=2)
    >>> block = sc.Body(basis, linear_elasticity(), D="top", x={"top": (0.002, -0.01)}, name="block")
    >>> floor = sc.RigidPlane((0, 0), (0, 1), name="floor")
    >>> foot = sc.Contact(block.surface("bottom"), floor, friction=sc.Coulomb(0.3), name="foot")
    >>> solver = sc.ContactSolver(block, foot, linear=sc.linalg.AMG(tol=1e-14, max_iterations=1))
    >>> try:
    ...     solver.solve()
    ... except sc.errors.LinearSolveError:
    ...     print("not reached")
    not reached
    """

    def __init__(self, message: str, residual: float = nan, iterations: int = 0) -> None:
        super().__init__(message)
        self.residual, self.iterations = float(residual), int(iterations)
