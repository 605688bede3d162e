"""Dataclasses that take no time to import: `dataclass` for the values that pass between modules.

That of the standard library writes source text for each method of each class, and compiles it: with a
hundred classes that was half of the time in which this library is imported. Here all classes share one
constructor. `fields`, `field` and `replace` of the standard library work as ever. Classes that users
make, whose signatures are read, are the standard library's own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

T = TypeVar("T")

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # for type checkers it is that
else:

    def dataclass(
        given: type[T] | None = None,
        *,
        init: bool = True,
        repr: bool = True,
        eq: bool = True,
        frozen: bool = False,
    ) -> type[T] | Callable[[type[T]], type[T]]:
        """Make a class with annotated fields one whose instances are made of values for them.

        The parameters are those of the standard library's `dataclass`.

        Examples
        --------
        >>> @dataclass(frozen=True)
        ... class Point:
        ...     x: float
        ...     y: float = 0.0
        >>> Point(1.0), dataclasses.replace(Point(1.0), y=2.0).y, Point(1.0) == Point(x=1.0)
        (Point(x=1.0, y=0.0), 2.0, True)
        >>> Point(1.0).x = 3.0
        Traceback (most recent call last):
            ...
        dataclasses.FrozenInstanceError: cannot assign to field 'x'
        """

        def made(cls: type[T]) -> type[T]:
            has_hash = "__hash__" in vars(cls)
            dataclasses.dataclass(init=False, repr=False, eq=False, match_args=False)(cls)
            fields = dataclasses.fields(cls)
            if init:
                cls.__init__ = _constructor(fields, hasattr(cls, "__post_init__"))
            if repr and "__repr__" not in vars(cls):
                cls.__repr__ = _printed
            if eq:
                cls.__eq__ = _equal
                cls.__hash__ = (cls.__hash__ if has_hash else _hash) if frozen else None
            if frozen:
                cls.__setattr__, cls.__delattr__ = _refuse_set, _refuse_delete
            return cls

        return made if given is None else made(given)


def _constructor(fields: tuple[dataclasses.Field[Any], ...], post: bool) -> Callable[..., None]:
    """The constructor of all instances with these fields, which they have in this order."""
    names = tuple(f.name for f in fields if f.init)
    missing = dataclasses.MISSING
    values = {f.name: f.default for f in fields if f.default is not missing}
    makers = {f.name: f.default_factory for f in fields if f.default_factory is not missing}

    def __init__(self: Any, *args: Any, **given: Any) -> None:
        own = vars(self)
        own.update(zip(names, args, strict=False))
        for name in names[len(args) :]:
            if name in given:
                own[name] = given.pop(name)
            elif name in values:
                own[name] = values[name]
            elif name in makers:
                own[name] = makers[name]()
            else:
                raise TypeError(f"{type(self).__name__}() misses the argument {name!r}")
        if given or len(args) > len(names):
            raise TypeError(f"{type(self).__name__}() takes {', '.join(names)}, and nothing else")
        if post:
            self.__post_init__()

    return __init__


def _printed(self: Any) -> str:
    shown = [f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr]
    return f"{type(self).__qualname__}({', '.join(shown)})"


def _compared(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, f.name) for f in dataclasses.fields(self) if f.compare)


def _equal(self: Any, other: object) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    return _compared(self) == _compared(other)


def _hash(self: Any) -> int:
    own = (f for f in dataclasses.fields(self) if (f.compare if f.hash is None else f.hash))
    return hash(tuple(getattr(self, f.name) for f in own))


def _refuse_set(self: Any, name: str, value: Any) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_delete(self: Any, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
