"""What is made once, when it is first needed, and what never changes: values, dataclasses, names.

**Values.** A solver may be asked by several threads at once. What costs, such as a factorisation, is
made by the thread that asks first; the others wait for it (`once`). Only those who want the same value
of the same object wait: `functools.cached_property` lets all objects of a class wait for each other up
to Python 3.11, and from 3.12 on computes what several threads want as many times.

**Dataclasses.** The standard library writes source text for the methods of each, and compiles it. For
all classes of this library that took half of the time in which it is imported, and a job uses half of
them. So it is asked for a class when the first instance is made, or somebody asks for its fields.

**Names.** ``from skfem_contact.pairing import dual_mortar``: in which module of a package a step of the
theory stands is the package's own matter, and a module that moves is one line in its `__init__`. Of
these names those in the package's `__all__` are public; the others are for tests, see
docs/entrances.md. Modules of the library import from each other by full names.

**Sealed values.** A result is as good as long as all that it was computed from is what it was. NumPy
refuses to write into a sealed array: ``result.u *= 2`` is an error where it is written, ``u = 2 *
result.u`` is not. Of what users give there are copies.

**Pickles.** Bodies, solvers and results are pickled by process pools, joblib and for files. Pickle
knows a function by its name. Lambdas and functions within functions, such as the forms that scikit-fem
makes, have none to be found by; they stay behind, and what needs them later says so.
"""

from __future__ import annotations

import dataclasses
import pickle
from _thread import RLock
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np
from scipy.sparse import csr_matrix

from skfem_contact.errors import InputError

T = TypeVar("T")


class Lock(RLock):  # type: ignore[misc]  # final in the stubs of its module, not in it
    """A lock that a thread may take again while it has it; copies and pickles have one of their own.

    >>> import pickle
    >>> with pickle.loads(pickle.dumps(Lock())):
    ...     pass
    """

    def __reduce__(self) -> tuple[type[Lock], tuple[()]]:
        return Lock, ()


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
        known, turn = vars(instance), f"turn of {self.name}"
        with known.setdefault(turn, Lock()):
            if self.name not in known:
                known.setdefault(self.name, self.function(instance))  # if nobody has set it by now
            known.pop(turn, None)  # who has it by now finds the value
            found: T = known[self.name]
            return found


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


def entrances(
    package: str, public: Sequence[str], modules: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package that hands out names of its modules.

    They are imported when they are asked for; ``dir`` shows the public ones only. A module of another
    package has one more dot, ``".answers.result"``.

    >>> find, names = entrances("skfem_contact.bodies", [], {"normal_field": "twin_edges"})
    >>> find("twin_edges").__module__
    'skfem_contact.bodies.normal_field'
    """
    place = {name: module for module, names in modules.items() for name in names.split()}

    def find(name: str) -> Any:
        if name not in place:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f".{place[name]}", package), name)

    return find, lambda: [*public]


def sealed(array: np.ndarray) -> np.ndarray:
    """The array itself, from now on read-only; for arrays that are nobody else's.

    >>> sealed(np.zeros(2)).flags.writeable
    False
    """
    array.setflags(write=False)
    return array


def sealed_matrix(matrix: csr_matrix) -> csr_matrix:
    """The matrix itself with all its arrays read-only."""
    matrix.has_canonical_format  # noqa: B018 (found out and remembered while it can be)
    for part in (matrix.data, matrix.indices, matrix.indptr):
        sealed(part)
    return matrix


def seal(*values: Any) -> None:
    """Make all arrays and matrices that objects have read-only; for every result, so it is quick."""
    for value in values:
        for part in vars(value).values():
            if isinstance(part, np.ndarray):
                part.setflags(False)  # type: ignore[call-arg]  # write; by keyword it takes thrice as long
            elif type(part) is csr_matrix and part.data.flags.writeable:
                sealed_matrix(part)


def kept(value: Any) -> Any:
    """A value of the user's as it is now: what the user does to it later stays outside.

    Numbers, functions and read-only arrays of their own stay themselves.

    >>> mine = np.ones(2)
    >>> ours = kept((mine, 0.5))
    >>> mine[0] = 3.0
    >>> ours
    (array([1., 1.]), 0.5)
    """
    if isinstance(value, np.ndarray):
        own = not value.flags.writeable and value.base is None
        # a mask is kept for those who refuse it
        return value if own else sealed(np.array(value, subok=np.ma.is_masked(value)))
    if isinstance(value, list | tuple):
        return type(value)([kept(part) for part in value]) if type(value) in (list, tuple) else value
    return value


class ByFields:
    """Of dataclasses: they travel by their fields; what they have found out is found out again.

    >>> @dataclass
    ... class Square(ByFields):
    ...     side: float
    >>> square = Square(2.0)
    >>> square.area = 4.0
    >>> square.__getstate__()
    {'side': 2.0}
    """

    def __getstate__(self) -> dict[str, Any]:
        known = vars(self)
        return {field.name: known[field.name] for field in dataclasses.fields(self)}  # type: ignore[arg-type]


def copied(value: T, **changed: Any) -> T:
    """A dataclass with its fields or others; what it has found out is left out, nothing is checked.

    For what every load step makes: `dataclasses.replace` takes ten times as long.

    >>> copied(LeftBehind("gap"), what="measure")
    LeftBehind(what='measure')
    """
    known, copy = vars(value), object.__new__(type(value))
    names = value.__dataclass_fields__  # type: ignore[attr-defined]
    vars(copy).update({name: known[name] for name in names} | changed)
    return copy


@dataclass(frozen=True)
class LeftBehind:
    """In place of a function that could not be carried along; an error where it is called."""

    what: str

    def __call__(self, *given: Any) -> Any:
        raise InputError(
            f"{self.what} is a function that was left behind when this was pickled or copied: pickle "
            "finds functions by their name in a module, and lambdas and functions within functions "
            "have none. Define it by def at the top of a module, or make the solver where it is used."
        )


def carried(function: Any, what: str) -> Any:
    """The function itself where pickle can take it along, and else what says that it is missing.

    Anything that is no function stays what it is.

    >>> carried(abs, "measure"), carried(lambda x: x, "measure"), carried(0.5, "gap")
    (<built-in function abs>, LeftBehind(what='measure'), 0.5)
    """
    return function if not callable(function) or can_be_carried(function) else LeftBehind(what)


def can_be_carried(thing: Any) -> bool:
    """Return whether pickle takes it."""
    try:
        pickle.dumps(thing)
    except (pickle.PicklingError, AttributeError, TypeError):
        return False
    return True
