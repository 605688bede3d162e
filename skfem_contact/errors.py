"""The exceptions, each carrying what is needed to understand it.

Every message says what was found with both numbers and the user's own names, what that usually
means, and what to try, naming the argument.
"""

from __future__ import annotations

from typing import Any


class ContactWarning(UserWarning):
    """Something works but is probably not what was meant; the message says what to look at."""


class ContactError(Exception):
    """Base of all errors of this library.

    Attributes
    ----------
    results : tuple of ContactResult
        Where a step of `history` failed, the results of the steps before it: also those of
        ``list(solver.history(steps))``, which nobody has seen. Any other exception that ends a history
        has them too, KeyboardInterrupt included.
    """

    results: tuple[Any, ...] = ()


class InputError(ContactError, ValueError):
    """The problem as given can not be set up: shapes, NaN, surfaces, names, element types."""


class UnknownKeyword(InputError, TypeError):
    """An argument by a name that there is not; a TypeError as well, as everywhere in Python."""


class ConstraintError(ContactError, ValueError):
    """Constraint rows contradict each other or the prescribed DOFs.

    Attributes
    ----------
    rows : tuple of int
        The rows involved, numbered as they were given.
    """

    def __init__(self, message: str, rows: Any = ()) -> None:
        super().__init__(message)
        self.rows = tuple(int(row) for row in rows)


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
    """

    def __init__(
        self,
        message: str,
        bodies: tuple[str, ...] = (),
        motion: str = "",
        result: Any = None,
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
    """

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result
