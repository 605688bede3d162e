"""Checks of the arguments shared by the closed forms."""

from __future__ import annotations

from skfem_contact.errors import InputError


def positive(**values: float) -> None:
    """Raise `InputError` unless every named value is a positive number.

    Examples
    --------
    >>> positive(R=1.0, P=2.0)
    >>> positive(R=-1.0)
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: R = -1.0 must be positive.
    """
    for name, value in values.items():
        if not value > 0:
            raise InputError(f"{name} = {value} must be positive.")


def not_negative(**values: float) -> None:
    """Raise `InputError` unless every named value is zero or positive."""
    for name, value in values.items():
        if not value >= 0:
            raise InputError(f"{name} = {value} must be zero or positive.")


def poisson(*ratios: float) -> None:
    """Raise `InputError` unless every Poisson's ratio lies in (-1, 0.5]."""
    for nu in ratios:
        if not -1 < nu <= 0.5:
            raise InputError(f"Poisson's ratio nu = {nu} must lie in (-1, 0.5].")
