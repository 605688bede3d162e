"""`Named`: a sequence whose members have names."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Generic, TypeVar, overload

from skfem_contact.arguments import suggest
from skfem_contact.errors import InputError

T = TypeVar("T")


class Named(Sequence[T], Generic[T]):
    """A sequence that never changes, asked by position or by name.

    >>> few = Named(["x", "y"], ["first", "second"], "letters")
    >>> few["second"], few[0], list(few), few.names
    ('y', 'x', ['x', 'y'], ('first', 'second'))
    >>> few
    <letters: first, second>
    """

    def __init__(self, members: Sequence[T], names: Sequence[str], kind: str) -> None:
        self._members, self.names, self._kind = tuple(members), tuple(names), kind

    def __len__(self) -> int:
        return len(self._members)

    def __repr__(self) -> str:
        return f"<{self._kind}: {', '.join(self.names)}>"

    @overload
    def __getitem__(self, key: int | str) -> T: ...
    @overload
    def __getitem__(self, key: slice) -> Sequence[T]: ...
    def __getitem__(self, key: Any) -> Any:
        return self._members[self.index_of(key) if isinstance(key, str) else key]

    def index_of(self, name: str) -> int:
        """The position of a member by its name."""
        if name not in self.names:
            raise InputError(
                f"there is no {name!r} among the {self._kind}{suggest(name, self.names, self._kind)}"
            )
        return self.names.index(name)
