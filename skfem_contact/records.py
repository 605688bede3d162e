"""Dataclasses that take no time to import: `dataclass` for the values that pass between modules.

That of the standard library writes source text for each method of each class, and compiles it: with a
hundred classes that was half of the time in which this library is imported. Here all classes share one
constructor, and the standard library describes the fields of a class, which takes as long again, when
`fields` or `replace` first ask for them. They and `field` work as ever. Classes that users make, whose
signatures are read, are the standard library's own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeVar

T = TypeVar("T")

FOUND = RLock()  # held while a class is described, which asks for its bases

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
            if _plain(cls):
                for known in ("__dataclass_fields__", "__dataclass_params__"):
                    setattr(cls, known, _Later(cls, known))
                names, values, makers = *_annotated(cls), {}
            else:
                names, values, makers = _described(cls)
            if init:
                cls.__init__ = _constructor(names, values, makers, hasattr(cls, "__post_init__"))
            if repr and "__repr__" not in vars(cls):
                cls.__repr__ = _printed
            if eq:
                cls.__eq__ = _equal
                cls.__hash__ = (cls.__hash__ if has_hash else _hash) if frozen else None
            if frozen:
                cls.__setattr__, cls.__delattr__ = _refuse_set, _refuse_delete
            return cls

        return made if given is None else made(given)


class _Later:
    """Stands where the standard library keeps what it knows of a class, until one asks for it."""

    def __init__(self, cls: type[Any], name: str) -> None:
        self.cls, self.name = cls, name

    def __get__(self, instance: Any, owner: type[Any]) -> Any:
        with FOUND:
            if vars(self.cls)[self.name] is self:  # else another thread has found it
                dataclasses.dataclass(init=False, repr=False, eq=False, match_args=False)(self.cls)
        return vars(self.cls)[self.name]


def _above(cls: type[Any]) -> list[type[Any]]:
    """A class after the dataclasses that it inherits from, in the order of their fields."""
    return [*(base for base in cls.__mro__[:0:-1] if "__dataclass_fields__" in vars(base)), cls]


def _plain(cls: type[Any]) -> bool:
    """Whether names and values in the bodies of the classes are all there is to the fields."""
    *bases, own = _above(cls)
    if not all(isinstance(vars(base)["__dataclass_fields__"], _Later) for base in bases):
        return False
    return not any(isinstance(value, dataclasses.Field) for value in vars(own).values())


def _annotated(cls: type[Any]) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Names of the fields and values of those that have one, as they stand in the classes."""
    names: dict[str, None] = {}
    values: dict[str, Any] = {}
    for each in _above(cls):
        own = vars(each)
        for name, kind in each.__annotations__.items():
            if "ClassVar" not in kind:  # annotations are text, by `from __future__ import annotations`
                names[name] = None
                if name in own:
                    values[name] = own[name]
    return tuple(names), values


def _described(cls: type[Any]) -> tuple[tuple[str, ...], dict[str, Any], dict[str, Any]]:
    """Names, values and functions that make values, as the standard library finds them."""
    dataclasses.dataclass(init=False, repr=False, eq=False, match_args=False)(cls)
    fields, missing = dataclasses.fields(cls), dataclasses.MISSING
    names = tuple(f.name for f in fields if f.init)
    values = {f.name: f.default for f in fields if f.default is not missing}
    makers = {f.name: f.default_factory for f in fields if f.default_factory is not missing}
    return names, values, makers


def _constructor(
    names: tuple[str, ...], values: dict[str, Any], makers: dict[str, Any], post: bool
) -> Callable[..., None]:
    """The constructor of all instances with these fields, which they have in this order."""

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
