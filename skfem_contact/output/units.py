"""Units for labels and files: the user's own words, since the library has none."""

from __future__ import annotations

from collections.abc import Mapping

from skfem_contact.arguments import shown, suggest
from skfem_contact.errors import InputError

KINDS = ("length", "force", "stress", "area", "energy", "time")
USAGE = "give a dict such as {'length': 'mm', 'force': 'N', 'stress': 'MPa'}"


def checked(units: Mapping[str, str] | None) -> dict[str, str]:
    """Units by kind of quantity, as users give them.

    >>> checked({"lenght": "mm"})
    Traceback (most recent call last):
        ...
    skfem_contact.errors.InputError: units has no kind 'lenght'; did you mean 'length'? Known kinds: ...
    """
    if units is None:
        return {}
    if not isinstance(units, Mapping):
        raise InputError(f"units is {shown(units)}; {USAGE}")
    for kind, unit in units.items():
        if kind not in KINDS:
            raise InputError(f"units has no kind {kind!r}{suggest(kind, KINDS, 'kinds')}")
        if not isinstance(unit, str):
            raise InputError(f"units[{kind!r}] is {shown(unit)}, which is no word; {USAGE}")
    return dict(units)


def labelled(words: str, kind: str, units: Mapping[str, str]) -> str:
    """A label with its unit, where there is one.

    >>> labelled("pressure", "stress", {"stress": "MPa"}), labelled("x", "length", {})
    ('pressure [MPa]', 'x')
    """
    return f"{words} [{units[kind]}]" if units.get(kind) else words


def quantity(value: float, kind: str, units: Mapping[str, str]) -> str:
    """A number in words with its unit.

    >>> quantity(104.73, "stress", {"stress": "MPa"})
    '105 MPa'
    """
    return f"{value:.3g} {units.get(kind, '')}".strip()
