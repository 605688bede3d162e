"""Values that several threads share: computed once while the others wait, and locks.

A solver may be asked by several threads at once. What costs, such as a factorisation, is made by the
thread that asks first; the others wait for it. Only those who want the same value of the same object
wait: `functools.cached_property` lets all objects of a class wait for each other up to Python 3.11, and
from 3.12 on computes what several threads want as many times.
"""

from __future__ import annotations

from _thread import RLock
from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


class Lock(RLock):  # type: ignore[misc]  # final in the stubs of its module, not in it
    """A lock that a thread may take again while it has it; copies and pickles have one of their own.

    >>> import pickle
    >>> with pickle.loads(pickle.dumps(Lock())):
    ...     pass
    """

    def __reduce__(self) -> tuple[type[Lock], tuple[()]]:
        return Lock, ()


class _Turn:
    """The lock of a value that is being computed, and how many threads are there for it.

    It is known here as long as somebody is, and not kept by the object, which may be pickled.
    """

    _all: dict[tuple[int, str], _Turn] = {}  # noqa: RUF012 (of all objects together)
    _guard = RLock()

    def __init__(self) -> None:
        self.lock, self.count = RLock(), 0

    @classmethod
    def enter(cls, key: tuple[int, str]) -> _Turn:
        with cls._guard:
            turn = cls._all.get(key)
            if turn is None:
                turn = cls._all[key] = cls()
            turn.count += 1
        turn.lock.acquire()
        return turn

    def leave(self, key: tuple[int, str]) -> None:
        self.lock.release()
        with self._guard:
            self.count -= 1
            if not self.count:
                del self._all[key]


class once(Generic[T]):
    """A property that is computed when first asked for, by one thread; others that ask wait for it.

    >>> class Square:
    ...     @once
    ...     def area(self):
    ...         print("computed")
    ...         return 4.0
    >>> square = Square()
    >>> square.area, square.area
    computed
    (4.0, 4.0)
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function, self.__doc__ = function, function.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> once[T]: ...

    @overload
    def __get__(self, instance: object, owner: type | None = None) -> T: ...

    def __get__(self, instance: object | None, owner: type | None = None) -> once[T] | T:
        # Python comes here as long as the object does not have the value itself
        if instance is None:
            return self
        known, key = vars(instance), (id(instance), self.name)
        turn = _Turn.enter(key)
        try:
            if self.name not in known:
                known.setdefault(self.name, self.function(instance))
            found: T = known[self.name]
            return found
        finally:
            turn.leave(key)
