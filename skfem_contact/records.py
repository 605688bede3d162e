"""Dataclasses made when they are first needed: `dataclass` for values that pass between modules.

The standard library writes source text for the methods of each dataclass, and compiles it. For all
classes of this library that took half of the time in which it is imported, and a job uses half of
them. So it is asked for a class when the first instance is made, or somebody asks for its fields.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from skfem_contact.once import Lock

MAKING = Lock()

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # for type checkers it is that
else:

    def dataclass(given: type[Any] | None = None, **parameters: Any) -> Any:
        """The `dataclass` of the standard library, later.

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

        `help` shows a class before its first instance:

        >>> import pydoc
        >>> @dataclass
        ... class Rod:
        ...     E: float = dataclasses.field(init=False)
        ...
        ...     def __init__(self) -> None: ...
        >>> "Rod" in pydoc.render_doc(Rod)
        True
        """

        def waits(cls: type[Any]) -> type[Any]:
            later = _Later(cls, parameters)
            for name in later.names():
                setattr(cls, name, NotMade(later, name))
            if parameters.get("frozen", False):
                _freeze(cls)
            return cls

        return waits if given is None else waits(given)


KNOWN = "__dataclass_fields__", "__dataclass_params__"
REFUSES = "__setattr__", "__delattr__"


class _Later:
    """A class whose methods are not made yet."""

    def __init__(self, cls: type[Any], parameters: dict[str, Any]) -> None:
        self.cls, self.parameters = cls, parameters
        self.fields = {k: v for k, v in vars(cls).items() if isinstance(v, dataclasses.Field)}
        for name in self.fields:  # no attribute of the class, which `help` would ask for
            delattr(cls, name)

    def names(self) -> list[str]:
        """Return the names of methods and fields that have to be made."""
        wanted = {"__repr__": "repr", "__eq__": "eq", "__init__": "init"}
        made = [name for name, why in wanted.items() if self.parameters.get(why, True)]
        if self.parameters.get("eq", True) and self.parameters.get("frozen", False):
            made.insert(0, "__hash__")
        return [*KNOWN, *(name for name in made if name not in vars(self.cls))]

    def make(self) -> None:
        """Let the standard library make them, on a twin: other threads see all of them, or none."""
        with MAKING:
            own = dict(vars(self.cls))
            stubs = [name for name, value in own.items() if isinstance(value, NotMade)]
            if not stubs:
                return
            left = {*stubs, *REFUSES, "__dict__", "__weakref__"}
            body = self.fields | {name: value for name, value in own.items() if name not in left}
            metaclass: Any = type(self.cls)
            twin = metaclass(self.cls.__name__, self.cls.__bases__, body)
            made = vars(dataclasses.dataclass(**self.parameters)(twin))
            for name in self.fields.keys() & made.keys():  # defaults stand in the class
                setattr(self.cls, name, made[name])
            for name in stubs:  # the constructor last, for which threads wait here
                setattr(self.cls, name, own[name].then(made[name]))


class NotMade:
    """A method or the fields of a class, which are made when they are asked for.

    `then` is what a decorator of the class makes of a method.
    """

    def __init__(self, later: _Later, name: str) -> None:
        self.later, self.name = later, name
        self.then: Callable[[Any], Any] = lambda made: made

    def __get__(self, instance: Any, owner: type[Any]) -> Any:
        self.later.make()
        return getattr(owner if instance is None else instance, self.name)


def _freeze(cls: type[Any]) -> None:
    """Fields stay as they are; classes of users that derive from this one may set others."""

    def refused(instance: Any, name: str) -> bool:
        return type(instance) is cls or name in cls.__dataclass_fields__

    def set_(instance: Any, name: str, value: Any) -> None:
        if refused(instance, name):
            raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
        super(cls, instance).__setattr__(name, value)

    def delete(instance: Any, name: str) -> None:
        if refused(instance, name):
            raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")
        super(cls, instance).__delattr__(name)

    cls.__setattr__, cls.__delattr__ = set_, delete  # type: ignore[assignment]
